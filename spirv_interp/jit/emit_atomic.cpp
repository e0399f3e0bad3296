// Atomic operations on 32-bit elements, lane by lane. A work group runs on one thread, so work-group memory needs no locks.
#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

using ir::AtomicOp;

//! Of which nobody takes the result: each lane's word is changed in place, without a loop where all lanes are active and within bounds.
void Emitter::updateShared(Value v, InstId change, const x86::Mem& limit) {
  const auto o = f_.operands(v);
  const uint32_t mask = p_.regions[region_].mask, lanes = p_.unroll * kVectorLanes;
  const asmjit::Label some = a_.newLabel(), done = a_.newLabel();
  const bool same = isUniform(o[1]) || p_.flat[o[1]];
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm off = load(o[0], part, t0());
    a_.vmovaps(frameMem(frameRow(0), part), off);
    a_.vpminud(t1(), off, limit);
    a_.vpcmpeqd(t1(), t1(), off);
    if (!allActive()) a_.emit(x86::Inst::kIdVpand, t1(), t1(), vregSource(mask, part));
    const x86::Gp bits = part ? x86::r11d : x86::ecx;
    a_.vmovmskps(bits, t1());
    if (part) {
      a_.shl(bits, 8 * part);
      a_.or_(x86::ecx, bits);
    }
    if (!same) a_.vmovaps(frameMem(frameRow(1), part), load(o[1], part, t0()));
  }
  if (same) {
    const Source s = source(o[1], 0);
    if (s.isReg) {
      a_.vmovd(x86::r8d, s.reg().xmm());
    } else {
      x86::Mem m = s.mem();
      m.setSize(4);
      a_.mov(x86::r8d, m);
    }
  }
  const auto one = [this, same, change](const x86::Mem& offset, const x86::Mem& value) {
    a_.mov(x86::eax, offset);
    if (!same) a_.mov(x86::r8d, value);
    a_.emit(change, x86::dword_ptr(x86::rsi, x86::rax), x86::r8d);
  };
  a_.cmp(x86::ecx, int32_t(uint32_t((uint64_t(1) << lanes) - 1)));
  a_.jne(some);
  for (uint32_t l = 0; l < lanes; l++) one(x86::dword_ptr(frame_, int32_t(frameRow(0) + 4 * l)), x86::dword_ptr(frame_, int32_t(frameRow(1) + 4 * l)));
  a_.bind(done);
  later([this, some, done, one] {
    const asmjit::Label again = a_.newLabel();
    a_.bind(some);
    a_.test(x86::ecx, x86::ecx);
    a_.jz(done);
    a_.bind(again);
    a_.tzcnt(x86::edx, x86::ecx);
    one(x86::dword_ptr(frame_, x86::rdx, 2, int32_t(frameRow(0))), x86::dword_ptr(frame_, x86::rdx, 2, int32_t(frameRow(1))));
    a_.blsr(x86::ecx, x86::ecx);
    a_.jnz(again);
    a_.jmp(done);
  });
}

bool Emitter::atomic(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const bool shared = i.op == Op::SharedAtomic;
  const Value offset = o[shared ? 0 : 1], value = o[shared ? 1 : 3];
  const auto operation = AtomicOp(i.imm >> 32 & 0xff);
  const uint32_t constant = uint32_t(i.imm), mask = p_.regions[region_].mask;
  if (ir::typeBytes(i.type) != 4 || f_.type(offset) != Type::I32 || (operation == AtomicOp::FAdd && i.type != Type::F32)) return false;
  if (!shared && (!isUniform(o[0]) || !isUniform(o[2]) || isUnbounded(o[2]))) return false;
  const x86::Mem limit = shared ? sharedRange(constant, 4, true) : bufferRange(o[0], o[2], constant, 4, true);
  if (shared && !p_.taken[v] && isStaticRange(constant, 4)) {
    const InstId plain = operation == AtomicOp::Add ? x86::Inst::kIdAdd
                         : operation == AtomicOp::And ? x86::Inst::kIdAnd
                         : operation == AtomicOp::Or ? x86::Inst::kIdOr
                         : operation == AtomicOp::Xor ? x86::Inst::kIdXor
                                                      : 0;
    if (plain) {
      updateShared(v, plain, limit);
      return true;
    }
  }

  // ecx: lanes that access.
  a_.vpxor(t2(), t2(), t2());
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm off = load(offset, part, t0());
    a_.vmovaps(frameMem(frameRow(0), part), off);
    a_.vmovaps(frameMem(frameRow(5), part), t2());
    a_.vpminud(t1(), off, limit);
    a_.vpcmpeqd(t1(), t1(), off);
    a_.emit(x86::Inst::kIdVpand, t1(), t1(), vregSource(mask, part));
    const x86::Gp bits = part ? x86::r11d : x86::ecx;
    a_.vmovmskps(bits, t1());
    if (part) {
      a_.shl(bits, 8 * part);
      a_.or_(x86::ecx, bits);
    }
  }
  for (uint32_t part = 0; part < p_.unroll; part++) a_.vmovaps(frameMem(frameRow(1), part), loadSettled(value, part, t0()));
  const asmjit::Label again = a_.newLabel(), done = a_.newLabel();
  // A range without room for the element stands for nothing at all.
  a_.mov(x86::rax, uint64_t(reinterpret_cast<uintptr_t>(sinkBlock())));
  a_.cmp(x86::rsi, x86::rax);
  a_.je(done);
  a_.test(x86::ecx, x86::ecx);
  a_.jz(done);
  a_.bind(again);
  a_.tzcnt(x86::edx, x86::ecx);
  a_.mov(x86::r10d, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(0))));
  a_.add(x86::r10, x86::rsi);
  a_.mov(x86::r8d, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(1))));
  const x86::Mem element = x86::dword_ptr(x86::r10);
  //! r11d: what eax (the old value) and r8d make.
  const auto update = [&] {
    const auto pick = [&](auto take) {
      a_.mov(x86::r11d, x86::r8d);
      a_.cmp(x86::eax, x86::r8d);
      take();
    };
    switch (operation) {
      case AtomicOp::Add: a_.lea(x86::r11d, x86::ptr(x86::rax, x86::r8)); break;
      case AtomicOp::SMin: pick([&] { a_.cmovl(x86::r11d, x86::eax); }); break;
      case AtomicOp::SMax: pick([&] { a_.cmovg(x86::r11d, x86::eax); }); break;
      case AtomicOp::UMin: pick([&] { a_.cmovb(x86::r11d, x86::eax); }); break;
      case AtomicOp::UMax: pick([&] { a_.cmova(x86::r11d, x86::eax); }); break;
      case AtomicOp::And:
        a_.mov(x86::r11d, x86::r8d);
        a_.and_(x86::r11d, x86::eax);
        break;
      case AtomicOp::Or:
        a_.mov(x86::r11d, x86::r8d);
        a_.or_(x86::r11d, x86::eax);
        break;
      case AtomicOp::Xor:
        a_.mov(x86::r11d, x86::r8d);
        a_.xor_(x86::r11d, x86::eax);
        break;
      case AtomicOp::FAdd: {
        const asmjit::Label number = a_.newLabel();
        a_.vmovd(t0().xmm(), x86::eax);
        a_.vmovd(t1().xmm(), x86::r8d);
        a_.vaddss(t0().xmm(), t0().xmm(), t1().xmm());
        a_.vmovd(x86::r11d, t0().xmm());
        a_.vucomiss(t0().xmm(), t0().xmm());
        a_.jnp(number);
        a_.mov(x86::r11d, 0x7fc00000);
        a_.bind(number);
        break;
      }
      default: a_.mov(x86::r11d, x86::r8d);
    }
  };
  switch (operation) {
    case AtomicOp::Load: a_.mov(x86::eax, element); break;
    case AtomicOp::Store:
      a_.xchg(element, x86::r8d);
      a_.xor_(x86::eax, x86::eax);
      break;
    case AtomicOp::Exchange:
      a_.xchg(element, x86::r8d);
      a_.mov(x86::eax, x86::r8d);
      break;
    default:
      if (shared) {
        a_.mov(x86::eax, element);
        update();
        a_.mov(element, x86::r11d);
      } else if (operation == AtomicOp::Add) {
        a_.lock().xadd(element, x86::r8d);
        a_.mov(x86::eax, x86::r8d);
      } else {
        const asmjit::Label retry = a_.newLabel();
        a_.mov(x86::eax, element);
        a_.bind(retry);
        update();
        a_.lock().cmpxchg(element, x86::r11d, x86::eax);
        a_.jnz(retry);
      }
  }
  a_.mov(x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(5))), x86::eax);
  a_.blsr(x86::ecx, x86::ecx);
  a_.jnz(again);
  a_.bind(done);
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm d = target(v, part);
    a_.vmovaps(d, frameMem(frameRow(5), part));
    finish(v, part, d);
  }
  return true;
}

}  // namespace pumice::jit
