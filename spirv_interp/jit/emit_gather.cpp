// Loads from where each lane has a base, a size or a 64-bit offset of its own (levels of images, device addresses): 64-bit
// addresses, four lanes at a time. Only lanes that are active may be looked at.
#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

namespace I = x86::Inst;

void Emitter::loadAddresses(Value v) {
  const Inst& i = f_.insts[v];
  const Value base = f_.operands(v)[0], offset = f_.operands(v)[1], size = f_.operands(v)[2];
  const uint32_t bytes = ir::typeBytes(i.type), mask = p_.regions[region_].mask;
  const int32_t back = -int32_t(bytes - 1);
  const bool wideOffset = f_.type(offset) == Type::I64;
  const x86::Mem sign = pool64(uint64_t(1) << 63), last = pool64(uint64_t(uint32_t(i.imm)) + bytes - 1);
  if (bytes < 4) {
    a_.vpxor(t0(), t0(), t0());
    for (uint32_t part = 0; part < p_.unroll; part++) a_.vmovaps(frameMem(frameRow(5), part), t0());
    a_.xor_(x86::r8d, x86::r8d);
  }
  for (uint32_t k = 0; k < p_.unroll * 2; k++) {
    // t0: where the last byte lies; t1: whether that is inside, without wrapping.
    if (wideOffset) {
      move(t0(), source(offset, k));
    } else {
      const Source s = source(offset, k / 2);
      if (!s.isReg) {
        x86::Mem m = s.mem();
        m.addOffset(k & 1 ? 16 : 0);
        m.setSize(16);
        a_.vpmovzxdq(t0(), m);
      } else if (k & 1) {
        a_.vextracti128(t0().xmm(), s.reg(), 1);
        a_.vpmovzxdq(t0(), t0().xmm());
      } else {
        a_.vpmovzxdq(t0(), s.reg().xmm());
      }
    }
    a_.vpaddq(t0(), t0(), last);
    a_.vpxor(t2(), t0(), sign);
    move(t1(), source(size, k));
    a_.vpxor(t1(), t1(), sign);
    a_.vpcmpgtq(t1(), t1(), t2());
    if (wideOffset) {
      move(t0(), source(offset, k));
      a_.vpxor(t0(), t0(), sign);
      a_.vpcmpgtq(t0(), t0(), t2());
      a_.vpandn(t1(), t0(), t1());
      a_.vpxor(t0(), t2(), sign);
    }
    wideMaskOf(vregSource(mask, k / 2), k, t2());
    a_.vpand(t1(), t1(), t2());
    a_.vpxor(t2(), t2(), t2());
    a_.emit(I::kIdVpcmpeqq, t2(), t2(), source(base, k));
    a_.vpandn(t1(), t2(), t1());
    a_.emit(I::kIdVpaddq, t0(), t0(), source(base, k));
    a_.xor_(x86::eax, x86::eax);
    const x86::Mem elements = x86::ptr(x86::rax, t0(), 0, back);
    if (bytes == 8) {
      const Ymm d = target(v, k);
      a_.vpxor(d, d, d);
      a_.vgatherqpd(d, elements, t1());
      finish(v, k, d);
    } else if (bytes == 4) {
      a_.vextracti128(t2().xmm(), t1(), 1);
      a_.vshufps(t1().xmm(), t1().xmm(), t2().xmm(), 0x88);
      a_.vpxor(t2().xmm(), t2().xmm(), t2().xmm());
      a_.vgatherqps(t2().xmm(), elements, t1().xmm());
      if (k & 1) {
        a_.vmovaps(t0().xmm(), frameMem(frameRow(0)));
        const Ymm d = target(v, k / 2);
        a_.vinserti128(d, t0(), t2().xmm(), 1);
        finish(v, k / 2, d);
      } else {
        a_.vmovaps(frameMem(frameRow(0)), t2().xmm());
      }
    } else {
      a_.vmovaps(frameMem(frameRow(0), k), t0());
      a_.vmovmskpd(x86::ecx, t1());
      if (k) a_.shl(x86::ecx, 4 * k);
      a_.or_(x86::r8d, x86::ecx);
    }
  }
  if (bytes >= 4) return;
  const asmjit::Label again = a_.newLabel(), done = a_.newLabel();
  a_.test(x86::r8d, x86::r8d);
  a_.jz(done);
  a_.bind(again);
  a_.tzcnt(x86::edx, x86::r8d);
  a_.mov(x86::rax, x86::ptr(frame_, x86::rdx, 3, int32_t(frameRow(0))));
  if (bytes == 2) a_.movzx(x86::eax, x86::word_ptr(x86::rax, back));
  else a_.movzx(x86::eax, x86::byte_ptr(x86::rax, back));
  a_.mov(x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(5))), x86::eax);
  a_.blsr(x86::r8d, x86::r8d);
  a_.jnz(again);
  a_.bind(done);
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm d = target(v, part);
    a_.vmovaps(d, frameMem(frameRow(5), part));
    finish(v, part, d);
  }
}

}  // namespace pumice::jit
