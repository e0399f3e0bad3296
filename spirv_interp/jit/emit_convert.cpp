// Conversions between types.
#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

namespace I = x86::Inst;

namespace {
//! An i32 whose sign bit is clear: fields of packed texels, mostly.
bool isNonNegative(const Function& f, Value v) {
  const Inst& i = f.insts[v];
  const auto o = f.operands(v);
  const auto small = [&](Value x) { return f.insts[x].op == Op::Const && uint32_t(f.insts[x].imm) < 0x80000000u; };
  switch (i.op) {
    case Op::Const: return small(v);
    case Op::And:
    case Op::UMin: return small(o[0]) || small(o[1]);
    case Op::LShr: return f.insts[o[1]].op == Op::Const && (f.insts[o[1]].imm & 31) != 0;
    case Op::ZExt: return ir::typeBytes(f.type(o[0])) < 4;
    default: return false;
  }
}
//! An i32 below 2^16.
bool hasOnlyLowHalf(const Function& f, Value v) {
  const Inst& i = f.insts[v];
  const auto o = f.operands(v);
  if (i.op == Op::LShr) return f.insts[o[1]].op == Op::Const && (f.insts[o[1]].imm & 31) >= 16;
  if (i.op == Op::And) return f.insts[o[1]].op == Op::Const && uint32_t(f.insts[o[1]].imm) <= 0xffff;
  return false;
}
}  // namespace

bool Emitter::convert(Value v) {
  const Inst& i = f_.insts[v];
  if (ir::opInfo(i.op).operands != ir::OperandRule::Cvt) return false;
  const Value o = f_.operands(v)[0];
  const Type from = f_.type(o), to = i.type;
  const bool fromWide = ir::typeBytes(from) == 8, toWide = ir::typeBytes(to) == 8;
  //! Part of a source with as many elements per part as the result has, or the half of one with more.
  const auto half = [&](uint32_t part) {   // the xmm of four 32-bit elements for the 64-bit part, in t0
    const Source s = source(o, part / 2);
    if (!s.isReg) {
      x86::Mem m = s.mem();
      m.addOffset(part & 1 ? 16 : 0);
      a_.vmovups(t0().xmm(), m);
      return t0().xmm();
    }
    if (!(part & 1)) return s.reg().xmm();
    a_.vextracti128(t0().xmm(), s.reg(), 1);
    return t0().xmm();
  };
  const auto each = [&](auto f) {
    for (uint32_t part = 0; part < partsOf(to); part++) {
      const Ymm d = target(v, part);
      f(d, part);
      finish(v, part, d);
    }
    return true;
  };

  switch (i.op) {
    case Op::BitCast:
      if (!preamble_ && p_.inRegister(o) && p_.vregOf[v] == p_.vregOf[o]) return true;
      return each([&](Ymm d, uint32_t part) { move(d, settled(o, part, d)); });
    case Op::ZExt:
      if (!toWide) return each([&](Ymm d, uint32_t part) { move(d, source(o, part)); });
      return each([&](Ymm d, uint32_t part) { a_.vpmovzxdq(d, half(part)); });
    case Op::SExt: {
      const uint32_t up = 32 - 8 * ir::typeBytes(from);
      if (toWide)
        return each([&](Ymm d, uint32_t part) {
          x86::Xmm x = half(part);
          if (up) {
            a_.vpslld(t0().xmm(), x, up);
            a_.vpsrad(t0().xmm(), t0().xmm(), up);
            x = t0().xmm();
          }
          a_.vpmovsxdq(d, x);
        });
      return each([&](Ymm d, uint32_t part) {
        a_.vpslld(t0(), load(o, part, t0()), up);
        a_.vpsrad(t0(), t0(), up);
        if (to == Type::I16) a_.vpand(d, t0(), pool32(0xffff));
        else move(d, reg(t0()));
      });
    }
    case Op::Trunc:
      return each([&](Ymm d, uint32_t part) {
        const uint32_t keep = to == Type::I8 ? 0xff : to == Type::I16 ? 0xffff : ~0u;
        if (!fromWide && to == Type::I16 && hasOnlyLowHalf(f_, o)) {
          move(d, source(o, part));
          return;
        }
        if (!fromWide) {
          bin(I::kIdVpand, d, source(o, part), mem(pool32(keep)));
          return;
        }
        const uint32_t low = single_ ? 0 : part * 2, high = single_ ? 0 : part * 2 + 1;
        const bool upper = !preamble_ && p_.folded[o];
        const Value x = upper ? f_.operands(o)[0] : o;
        const Ymm a = load(x, low, t0());
        const bool inOrder = !preamble_ && p_.crossed[x];
        const Ymm words = inOrder && keep == ~0u ? d : t0();
        a_.emit(I::kIdVshufps, words, a, source(x, high), asmjit::imm(upper ? 0xdd : 0x88));
        if (!inOrder) a_.vpermq(t0(), t0(), 0xd8);
        else if (keep == ~0u) return;
        if (keep != ~0u) a_.vpand(d, t0(), pool32(keep));
        else move(d, reg(t0()));
      });
    case Op::FToF:
      if (from == Type::F16 && to == Type::F32) {
        Value word = o;
        bool upper = false;
        for (; !preamble_ && p_.folded[word]; word = f_.operands(word)[0]) upper |= f_.insts[word].op == Op::LShr;
        if (word != o) {
          static constexpr uint32_t kLower[8] = {0x05040100, 0x0d0c0908, ~0u, ~0u, 0x05040100, 0x0d0c0908, ~0u, ~0u};
          static constexpr uint32_t kUpper[8] = {0x07060302, 0x0f0e0b0a, ~0u, ~0u, 0x07060302, 0x0f0e0b0a, ~0u, ~0u};
          return each([&](Ymm d, uint32_t part) {
            a_.vpshufb(t0(), load(word, part, t0()), upper ? poolVector(kUpper) : poolVector(kLower));
            a_.vpermq(t0(), t0(), 0x08);
            a_.vcvtph2ps(d, t0().xmm());
          });
        }
        return each([&](Ymm d, uint32_t part) {
          const Ymm x = load(o, part, t0());
          a_.vextracti128(t1().xmm(), x, 1);
          a_.vpackusdw(t0().xmm(), x.xmm(), t1().xmm());
          a_.vcvtph2ps(d, t0().xmm());
        });
      }
      if (from == Type::F32 && to == Type::F16) {
        return each([&](Ymm d, uint32_t part) {
          const Ymm x = load(o, part, t0());
          a_.vcvtps2ph(t0().xmm(), x, 0);   // to nearest even
          a_.vpmovzxwd(d, t0().xmm());
        });
      }
      if (from == Type::F32 && to == Type::F64) return each([&](Ymm d, uint32_t part) { a_.vcvtps2pd(d, half(part)); });
      if (from == Type::F16 && to == Type::F64) {
        return each([&](Ymm d, uint32_t part) {
          const x86::Xmm x = half(part);
          a_.vpackusdw(t0().xmm(), x, x);
          a_.vcvtph2ps(t0().xmm(), t0().xmm());
          a_.vcvtps2pd(d, t0().xmm());
        });
      }
      if (from == Type::F64 && to == Type::F32) {
        return each([&](Ymm d, uint32_t part) {
          const uint32_t low = single_ ? 0 : part * 2, high = single_ ? 0 : part * 2 + 1;
          a_.vcvtpd2ps(t0().xmm(), load(o, low, t0()));
          a_.vcvtpd2ps(t1().xmm(), load(o, high, t1()));
          a_.vinsertf128(d, t0(), t1().xmm(), 1);
        });
      }
      return false;
    case Op::FToS:
      // Out of range gives 0x80000000: right below, turned over above; NaN is masked.
      if (from != Type::F32 || to != Type::I32) return false;
      if (p_.fitsInt[v]) return each([&](Ymm d, uint32_t part) { a_.emit(I::kIdVcvttps2dq, d, source(o, part).op()); });
      return each([&](Ymm d, uint32_t part) {
        const Ymm x = load(o, part, t0());
        a_.vcmpps(t1(), x, pool32(0x4f000000), 29);   // >= 2^31, false for NaN
        a_.vcvttps2dq(t2(), x);
        a_.vpxor(t2(), t2(), t1());
        a_.vcmpps(t1(), x, x, 7);                     // ordered
        a_.vpand(d, t2(), t1());
      });
    case Op::FToU:
      if (from != Type::F32 || to != Type::I32) return false;
      return each([&](Ymm d, uint32_t part) {
        const Ymm x = load(o, part, t0());
        a_.vxorps(t1(), t1(), t1());
        a_.vmaxps(t0(), x, t1());                     // NaN and negative: 0
        if (a_.evex()) {
          a_.vcvttps2udq(d, t0());                    // out of range: all ones
          return;
        }
        a_.vcmpps(t1(), t0(), pool32(0x4f000000), 29);
        a_.vandps(t2(), t1(), pool32(0x4f000000));
        a_.vsubps(t2(), t0(), t2());                  // less 2^31: exact
        a_.vcvttps2dq(t2(), t2());
        a_.vpslld(t1(), t1(), 31);
        a_.vpxor(t2(), t2(), t1());
        a_.vcmpps(t1(), t0(), pool32(0x4f800000), 29);
        a_.vpor(d, t2(), t1());
      });
    case Op::SToF:
      if (from != Type::I32) return false;
      if (to == Type::F32) return each([&](Ymm d, uint32_t part) { a_.emit(I::kIdVcvtdq2ps, d, source(o, part)); });
      if (to == Type::F64) return each([&](Ymm d, uint32_t part) { a_.vcvtdq2pd(d, half(part)); });
      return false;
    case Op::UToF:
      if (to != Type::F32) return false;
      if (from == Type::I8 || from == Type::I16 || (from == Type::I32 && isNonNegative(f_, o)))
        return each([&](Ymm d, uint32_t part) { a_.emit(I::kIdVcvtdq2ps, d, source(o, part)); });
      if (from != Type::I32) return false;
      if (a_.evex()) return each([&](Ymm d, uint32_t part) { a_.emit(I::kIdVcvtudq2ps, d, source(o, part)); });
      return each([&](Ymm d, uint32_t part) {
        // Both halves are exact, so only the sum rounds.
        const Ymm x = load(o, part, t0());
        a_.vpand(t1(), x, pool32(0xffff));
        a_.vpsrld(t0(), x, 16);
        a_.vcvtdq2ps(t1(), t1());
        a_.vcvtdq2ps(t0(), t0());
        a_.vmulps(t0(), t0(), pool32(0x47800000));
        a_.vaddps(d, t0(), t1());
      });
    default: return false;
  }
}

}  // namespace pumice::jit
