// Memory of each lane's own: word w of lane l of the chunk lies at word w * lanes + l, so that lanes with equal offsets
// are neighbours. 32-bit elements at offsets that are multiples of 4 for sure are done here, the rest by a call.
#include <bit>

#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

namespace I = x86::Inst;

//! Whether a byte offset is a multiple of 4, as those of words in arrays are.
bool Emitter::isAligned(Value offset) {
  if (aligned_.empty()) {
    aligned_.assign(f_.insts.size(), 0);
    for (Value v = 1; v < f_.insts.size(); v++) {
      const Inst& i = f_.insts[v];
      const auto o = f_.operands(v);
      switch (i.op) {
        case Op::Const: aligned_[v] = i.imm % 4 == 0; break;
        case Op::Shl: aligned_[v] = isConst(o[1]) && (f_.insts[o[1]].imm & 31) >= 2; break;
        case Op::IMul:
        case Op::And: aligned_[v] = aligned_[o[0]] || aligned_[o[1]]; break;
        case Op::IAdd:
        case Op::ISub: aligned_[v] = aligned_[o[0]] && aligned_[o[1]]; break;
        case Op::Select: aligned_[v] = aligned_[o[1]] && aligned_[o[2]]; break;
        default: break;
      }
    }
  }
  return aligned_[offset];
}

void Emitter::localMemory(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const bool store = i.op == Op::LocalStore;
  const Type t = store ? f_.type(o[2]) : i.type;
  const Value offset = o[1];
  const uint32_t constant = uint32_t(i.imm), bytes = ir::typeBytes(t), lanes = p_.unroll * kVectorLanes;
  const uint64_t size = f_.insts[o[0]].imm, mask = p_.regions[region_].mask;

  if (bytes == 4 && constant % 4 == 0 && isAligned(offset) && size >= uint64_t(constant) + bytes) {
    const uint32_t shift = uint32_t(std::countr_zero(lanes));
    const x86::Mem limit = pool32(uint32_t(size - constant - bytes));
    const x86::Mem limitScalar = limit;
    a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, local)));
    a_.add(x86::rsi, localArea_[o[0]] + constant * lanes);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      uint32_t own[8];
      for (uint32_t k = 0; k < 8; k++) own[k] = (part * kVectorLanes + k) * 4;
      const Ymm off = load(offset, part, t0());
      const asmjit::Label general = a_.newLabel(), done = a_.newLabel();
      // All lanes at one offset within bounds: a row.
      a_.vpbroadcastd(t1(), off.xmm());
      a_.vpxor(t1(), t1(), off);
      a_.vmovd(x86::eax, off.xmm());
      a_.vptest(t1(), t1());
      a_.jnz(general);
      a_.cmp(x86::eax, limitScalar);
      a_.ja(general);
      a_.shl(x86::eax, shift);
      const x86::Mem row = x86::ptr(x86::rsi, x86::rax, 0, int32_t(part * kVectorBytes));
      if (!store) {
        const Ymm d = target(v, part);
        a_.vmovups(d, row);
        a_.jmp(done);
        a_.bind(general);
        a_.vpminud(t1(), off, limit);
        a_.vpcmpeqd(t1(), t1(), off);
        a_.vpslld(t0(), off, shift);
        a_.vpaddd(t0(), t0(), poolVector(own));
        a_.vpxor(d, d, d);
        a_.vgatherdps(d, x86::ptr(x86::rsi, t0()), t1());
        a_.bind(done);
        finish(v, part, d);
        continue;
      }
      const Ymm s = loadSettled(o[2], part, t2());
      const Ymm m = vregLoad(uint32_t(mask), part, t1());
      a_.vmovups(t0(), row);
      a_.vblendvps(t0(), t0(), s, m);
      a_.vmovups(row, t0());
      a_.jmp(done);
      a_.bind(general);
      const asmjit::Label again = a_.newLabel();
      a_.vmovaps(frameMem(frameRow(0)), off);
      a_.vpminud(t1(), off, limit);
      a_.vpcmpeqd(t1(), t1(), off);
      a_.emit(I::kIdVpand, t1(), t1(), vregSource(uint32_t(mask), part));
      a_.vmovmskps(x86::ecx, t1());
      a_.vmovaps(frameMem(frameRow(1)), loadSettled(o[2], part, t2()));
      a_.test(x86::ecx, x86::ecx);
      a_.jz(done);
      a_.bind(again);
      a_.tzcnt(x86::edx, x86::ecx);
      a_.mov(x86::eax, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(0))));
      a_.mov(x86::r8d, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(1))));
      a_.shl(x86::eax, shift);
      a_.add(x86::rax, x86::rsi);
      a_.mov(x86::ptr(x86::rax, x86::rdx, 2, int32_t(part * kVectorBytes)), x86::r8d);
      a_.blsr(x86::ecx, x86::ecx);
      a_.jnz(again);
      a_.bind(done);
    }
    return;
  }

  auto site = std::make_unique<LocalAccess>();
  *site = {localArea_[o[0]], uint32_t(size), constant, bytes, lanes, store};
  for (uint32_t part = 0; part < p_.unroll; part++) a_.vmovaps(frameMem(frameRow(0), part), load(offset, part, t0()));
  if (store)
    for (uint32_t part = 0; part < partsOf(t); part++) a_.vmovaps(frameMem(frameRow(1), part), loadSettled(o[2], part, t0()));
  vregMaskBits(x86::eax, uint32_t(mask));
  a_.mov(x86::dword_ptr(frame_, kFrameExec), x86::eax);
  callThunk(reinterpret_cast<const void*>(&runLocalAccess), site.get());
  out_->localAccesses.push_back(std::move(site));
  if (store) return;
  for (uint32_t part = 0; part < partsOf(t); part++) {
    const Ymm d = target(v, part);
    a_.vmovaps(d, frameMem(frameRow(5), part));
    finish(v, part, d);
  }
}

}  // namespace pumice::jit
