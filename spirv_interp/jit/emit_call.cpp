// Operations without code of their own: a call of the interpreter's kernel on rows in the frame.
#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

void Emitter::callThunk(const void* function, const void* site) {
  usesThunk_ = true;
  quadPointers_ = false;
  a_.mov(x86::rdi, frame_);
  a_.mov(x86::rsi, uint64_t(reinterpret_cast<uintptr_t>(site)));
  a_.mov(x86::rdx, call_);
  a_.mov(x86::rax, uint64_t(reinterpret_cast<uintptr_t>(function)));
  a_.call(thunk_);
}

bool Emitter::callOut(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const ir::OpInfo& info = ir::opInfo(i.op);
  // What depends on the place of the chunk in the row, or on more than its operands, has code of its own.
  if (o.size() > 5 || (o.empty() && i.op != Op::Clock) || i.op == Op::Check || (info.flags & (ir::kControl | ir::kHigh))) return false;
  auto site = std::make_unique<CallOut>();
  const bool compares = info.operands == ir::OperandRule::CmpF || info.operands == ir::OperandRule::CmpI;
  const Type type = compares ? f_.type(o[0]) : i.type != Type::None ? i.type : f_.type(o.back());
  site->kernel = info.operands == ir::OperandRule::Cvt ? kernels_.convert[unsigned(i.op)][unsigned(f_.type(o[0]))][unsigned(i.type)]
                                                       : kernels_.op[unsigned(i.op)][unsigned(type)][0];
  if (!site->kernel) return false;
  const bool bits = (info.flags & ir::kEffect) || i.op == Op::BitCast;   // of floats are looked at
  site->uniform = single_;
  site->lanes = single_ ? kVectorLanes : p_.unroll * kVectorLanes;
  site->result = i.type;
  site->code.imm = i.imm;
  if (info.operandCount >= 3 && (i.op == Op::Load || i.op == Op::LoadConst || i.op == Op::Store || i.op == Op::Atomic || i.op == Op::AtomicCas) &&
      f_.type(o[1]) == Type::I64)
    site->code.imm |= interp::kImmOffset64;
  for (size_t k = 0; k < o.size(); k++) {
    const Type t = f_.type(o[k]);
    site->operands[k] = t;
    site->code.src[k] = frameRow(uint32_t(k)) - kFrameRows;
    if (t == Type::Mask) {
      if (preamble_) a_.mov(x86::eax, scalar(o[k]));
      else maskBits(x86::eax, o[k]);
      a_.mov(x86::dword_ptr(frame_, int32_t(frameRow(uint32_t(k)))), x86::eax);
      continue;
    }
    // One vector of any type stands for all lanes, the kernel wants 8 elements.
    const uint32_t parts = single_ ? (ir::typeBytes(t) == 8 ? 2 : 1) : partsOf(t);
    for (uint32_t part = 0; part < parts; part++) {
      const Ymm s = bits ? loadSettled(o[k], part, t0()) : load(o[k], part, t0());
      a_.vmovaps(frameMem(frameRow(uint32_t(k)), part), s);
    }
  }
  site->code.dst = frameRow(5) - kFrameRows;
  if (single_) a_.mov(x86::eax, 0xff);
  else if ((info.flags & ir::kPure) && i.op != Op::LoadConst) a_.mov(x86::eax, ~0u);   // the mask need not live any more
  else vregMaskBits(x86::eax, p_.regions[region_].mask);
  a_.mov(x86::dword_ptr(frame_, kFrameExec), x86::eax);
  callThunk(reinterpret_cast<const void*>(&runCallOut), site.get());
  out_->callOuts.push_back(std::move(site));
  if (i.type == Type::None) return true;
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Ymm d = target(v, part);
    if (i.type == Type::Mask) {
      a_.mov(x86::eax, x86::dword_ptr(frame_, int32_t(frameRow(5))));
      maskFromBits(d, x86::eax, part);
    } else {
      a_.vmovaps(d, frameMem(frameRow(5), part));
    }
    finish(v, part, d);
  }
  return true;
}

}  // namespace pumice::jit
