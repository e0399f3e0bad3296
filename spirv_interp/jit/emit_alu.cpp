// Arithmetic, comparisons, masks, selects.
#include <array>
#include <bit>

#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {
namespace {

namespace I = x86::Inst;

//! Operations that are one instruction.
struct Simple {
  InstId id = 0;
  bool commutes = false;
  uint32_t imm = ~0u;      //!< vround's
};
struct SimpleRow {
  Op op;
  Type type;
  Simple simple;
};
// Rounding: bit 3 suppresses the inexact exception.
constexpr SimpleRow kSimple[] = {
    {Op::FAdd, Type::F32, {I::kIdVaddps, true}},      {Op::FAdd, Type::F64, {I::kIdVaddpd, true}},
    {Op::FSub, Type::F32, {I::kIdVsubps}},            {Op::FSub, Type::F64, {I::kIdVsubpd}},
    {Op::FMul, Type::F32, {I::kIdVmulps, true}},      {Op::FMul, Type::F64, {I::kIdVmulpd, true}},
    {Op::FDiv, Type::F32, {I::kIdVdivps}},            {Op::FDiv, Type::F64, {I::kIdVdivpd}},
    {Op::FSqrt, Type::F32, {I::kIdVsqrtps}},          {Op::FSqrt, Type::F64, {I::kIdVsqrtpd}},
    {Op::FRoundEven, Type::F32, {I::kIdVroundps, false, 8}},  {Op::FRoundEven, Type::F64, {I::kIdVroundpd, false, 8}},
    {Op::FFloor, Type::F32, {I::kIdVroundps, false, 9}},      {Op::FFloor, Type::F64, {I::kIdVroundpd, false, 9}},
    {Op::FCeil, Type::F32, {I::kIdVroundps, false, 10}},      {Op::FCeil, Type::F64, {I::kIdVroundpd, false, 10}},
    {Op::FTrunc, Type::F32, {I::kIdVroundps, false, 11}},     {Op::FTrunc, Type::F64, {I::kIdVroundpd, false, 11}},
    {Op::IAdd, Type::I32, {I::kIdVpaddd, true}},      {Op::IAdd, Type::I64, {I::kIdVpaddq, true}},
    {Op::ISub, Type::I32, {I::kIdVpsubd}},            {Op::ISub, Type::I64, {I::kIdVpsubq}},
    {Op::IMul, Type::I32, {I::kIdVpmulld, true}},
    {Op::And, Type::I32, {I::kIdVpand, true}},        {Op::And, Type::I64, {I::kIdVpand, true}},
    {Op::And, Type::I16, {I::kIdVpand, true}},        {Op::And, Type::I8, {I::kIdVpand, true}},
    {Op::Or, Type::I32, {I::kIdVpor, true}},          {Op::Or, Type::I64, {I::kIdVpor, true}},
    {Op::Or, Type::I16, {I::kIdVpor, true}},          {Op::Or, Type::I8, {I::kIdVpor, true}},
    {Op::Xor, Type::I32, {I::kIdVpxor, true}},        {Op::Xor, Type::I64, {I::kIdVpxor, true}},
    {Op::Xor, Type::I16, {I::kIdVpxor, true}},        {Op::Xor, Type::I8, {I::kIdVpxor, true}},
    {Op::SMin, Type::I32, {I::kIdVpminsd, true}},     {Op::SMax, Type::I32, {I::kIdVpmaxsd, true}},
    {Op::UMin, Type::I32, {I::kIdVpminud, true}},     {Op::UMax, Type::I32, {I::kIdVpmaxud, true}},
    {Op::UMin, Type::I16, {I::kIdVpminud, true}},     {Op::UMax, Type::I16, {I::kIdVpmaxud, true}},
    {Op::UMin, Type::I8, {I::kIdVpminud, true}},      {Op::UMax, Type::I8, {I::kIdVpmaxud, true}},
    {Op::MaskAnd, Type::Mask, {I::kIdVandps, true}},  {Op::MaskOr, Type::Mask, {I::kIdVorps, true}},
    {Op::MaskXor, Type::Mask, {I::kIdVxorps, true}},
};
constexpr size_t kTypes = size_t(Type::Tuple) + 1;
using SimpleTable = std::array<std::array<Simple, kTypes>, size_t(Op::kCount)>;
constexpr SimpleTable makeTable() {
  SimpleTable t{};
  for (const SimpleRow& r : kSimple) t[size_t(r.op)][size_t(r.type)] = r.simple;
  return t;
}
constexpr SimpleTable kTable = makeTable();

constexpr uint32_t kEq = 0, kUnordered = 3, kNeqUnordered = 4, kLt = 17, kLe = 18;

bool isZero(Type t, uint64_t bits) { return (t == Type::F64 ? bits << 1 : bits << 33) == 0; }
bool isNan(Type t, uint64_t bits) {
  return t == Type::F64 ? (bits & ~(uint64_t(1) << 63)) > 0x7ff0000000000000u : (bits & 0x7fffffffu) > 0x7f800000u;
}

}  // namespace

InstId commutative(Op op, Type t) {
  const Simple& s = kTable[size_t(op)][size_t(t)];
  return s.commutes ? s.id : 0;
}

bool Emitter::alu(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  if (i.type != Type::None) {
    const Simple& s = kTable[size_t(i.op)][size_t(i.type)];
    if (s.id) {
      const Parts x = parts(o[0]), y = parts(o.back());
      if (o.size() == 2 && binParts(s.id, v, x, y, s.commutes)) return true;
      for (uint32_t part = 0; part < partsOf(i.type); part++) {
        const Ymm d = target(v, part);
        if (o.size() == 2) bin(s.id, d, source(x, part), source(y, part), s.commutes);
        else if (s.imm != ~0u) a_.emit(s.id, d, source(x, part), asmjit::imm(s.imm));
        else a_.emit(s.id, d, source(x, part));
        finish(v, part, d);
      }
      return true;
    }
  }
  switch (i.op) {
    case Op::FMin:
    case Op::FMax: floatMinMax(v); return true;
    case Op::FNeg:
    case Op::FAbs:
    case Op::Not:
    case Op::MaskNot: negate(v); return true;
    case Op::Fma: fma(v); return true;
    case Op::FEq:
    case Op::FNe:
    case Op::FLt:
    case Op::FLe:
    case Op::IEq:
    case Op::INe:
    case Op::SLt:
    case Op::SLe:
    case Op::ULt:
    case Op::ULe: compare(v); return true;
    case Op::Select: select(v); return true;
    case Op::Shl:
    case Op::LShr:
    case Op::AShr:
      if (i.type != Type::I32 && i.type != Type::I64) return false;
      shift(v);
      return true;
    case Op::SDiv:
    case Op::SRem:
      if (i.type != Type::I32) return false;
      divide(v);
      return true;
    case Op::UDiv:
    case Op::URem:
      if (i.type == Type::I64) return false;
      divide(v);
      return true;
    case Op::IAdd:
    case Op::ISub:
    case Op::IMul: {
      if (i.type == Type::I64) {   // sums have one instruction
        multiplyWide(v);
        return true;
      }
      if (i.type != Type::I8 && i.type != Type::I16) return false;
      const InstId id = i.op == Op::IAdd ? I::kIdVpaddd : i.op == Op::ISub ? I::kIdVpsubd : I::kIdVpmulld;
      const x86::Mem keep = pool32(i.type == Type::I8 ? 0xff : 0xffff);
      for (uint32_t part = 0; part < partsOf(i.type); part++) {
        const Ymm d = target(v, part);
        bin(id, d, source(o[0], part), source(o[1], part), i.op != Op::ISub);
        a_.vpand(d, d, keep);
        finish(v, part, d);
      }
      return true;
    }
    case Op::SMulHi:
    case Op::UMulHi: return i.type == Type::I32 && multiplyHigh(v);
    case Op::ExecMask: {
      if (preamble_) return false;
      for (uint32_t part = 0; part < p_.unroll; part++) {
        const Ymm d = target(v, part);
        move(d, vregSource(p_.regions[region_].mask, part));
        finish(v, part, d);
      }
      return true;
    }
    case Op::VarSet: varSet(v); return true;
    case Op::VarGet:
      if (p_.a.aliasesVar[v]) return true;
      for (uint32_t part = 0; part < partsOf(i.type); part++) {
        const Ymm d = target(v, part);
        move(d, source(o[0], part));
        finish(v, part, d);
      }
      return true;
    default: return false;
  }
}

//! bin() for all parts: what they have in common is looked at once. False: nothing is done yet.
bool Emitter::binParts(InstId id, Value v, const Parts& x, const Parts& y, bool commutes) {
  const uint32_t count = partsOf(f_.type(v));
  uint8_t* at = preamble_ || kVexRows[id].form != VexForm::Rvm ? nullptr : a_.room(3 * count);
  if (!at) return false;
  const Vreg& to = p_.vregs[p_.vregOf[v]];
  for (uint32_t part = 0; part < count; part++) {
    const Source p = source(x, part), q = source(y, part);
    const bool swap = commutes && !p.isReg && q.isReg;
    const Source &a = swap ? q : p, &b = swap ? p : q;
    const bool inFrame = to.reg[part] < 0;
    const uint32_t d = inFrame ? t2().id() : uint32_t(to.reg[part]);
    uint32_t first = a.id;
    if (!a.isReg) {
      first = b.isReg && b.id == d ? t0().id() : d;   // t0 is free when an operand stands in the result
      at = encodeLoad(at, first, a.id, a.offset);
    }
    at = encodeRvm(at, id, d, first, !b.isReg, b.id, b.offset);
    if (inFrame) {
      const Source slot = slotSource(to.slot[part]);
      at = encodeStore(at, d, slot.id, slot.offset);
    }
  }
  a_.wrote(at);
  return true;
}

//! The smaller; of equals (zeros) the union of the signs; of a NaN and a number the number. The instruction gives its
//! second operand for NaNs and equals, which is right for most constants in second place.
void Emitter::floatMinMax(Value v) {
  const Inst& i = f_.insts[v];
  const bool wide = i.type == Type::F64, least = i.op == Op::FMin;
  Value a = f_.operands(v)[0], b = f_.operands(v)[1];
  const InstId pick = least ? (wide ? I::kIdVminpd : I::kIdVminps) : wide ? I::kIdVmaxpd : I::kIdVmaxps;
  const InstId merge = least ? I::kIdVorps : I::kIdVandps;
  const InstId test = wide ? I::kIdVcmppd : I::kIdVcmpps;
  if (isConst(a) && !isConst(b)) std::swap(a, b);   // NaNs apart (and those are equally good), both orders give the same
  else if (p_.number[a] && !p_.number[b] && !isConst(b)) std::swap(a, b);
  const uint64_t bits = f_.insts[b].imm;
  const bool number = p_.number[b] || (isConst(b) && !isNan(i.type, bits));
  // A zero must be the one that wins among zeros.
  const bool negative = bits >> (wide ? 63 : 31) & 1;
  const bool direct = number && (p_.signless[v] || (isConst(b) && (!isZero(i.type, bits) || negative == least)));
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Source x = source(a, part), y = source(b, part);
    const Ymm d = target(v, part);
    if (direct) {
      bin(pick, d, x, y);
    } else {
      bin(pick, t1(), x, y);
      bin(merge, t2(), x, y, true);
      cmp(test, t0(), x, y, kEq);
      if (number) {
        blend(d, reg(t1()), reg(t2()), t0());
      } else {
        blend(t1(), reg(t1()), reg(t2()), t0());
        cmp(test, t0(), y, y, kUnordered);
        blend(d, reg(t1()), x, t0());
      }
    }
    finish(v, part, d);
  }
}

void Emitter::negate(Value v) {
  const Inst& i = f_.insts[v];
  const Value o = f_.operands(v)[0];
  x86::Mem constant;
  InstId id = I::kIdVxorps;
  switch (i.op) {
    case Op::FNeg: constant = i.type == Type::F64 ? pool64(uint64_t(1) << 63) : pool32(i.type == Type::F16 ? 0x8000 : 0x80000000u); break;
    case Op::FAbs:
      constant = i.type == Type::F64 ? pool64(~(uint64_t(1) << 63)) : pool32(i.type == Type::F16 ? 0x7fff : 0x7fffffff);
      id = I::kIdVandps;
      break;
    default: constant = pool32(i.type == Type::I8 ? 0xff : i.type == Type::I16 ? 0xffff : ~0u);
  }
  const bool looks = ir::isFloat(i.type) && p_.a.exposed[v];
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Source s = looks ? settled(o, part, t0()) : source(o, part);
    const Ymm d = target(v, part);
    bin(id, d, s, mem(constant));
    finish(v, part, d);
  }
}

namespace {
struct FmaForms {
  InstId f132, f213, f231;
};
//! a * b + c as moves (the first `moves`) and one instruction.
struct FmaSteps {
  uint32_t moves = 0;
  struct {
    uint8_t to = 0;
    Source from;
  } move[2];
  InstId id = 0;
  uint8_t second = 0;   //!< vector register
  Source third;
  void load(uint32_t to, Source from) {
    move[moves].to = uint8_t(to);
    move[moves++].from = from;
  }
};
const FmaForms& fmaForms(bool wide, bool negative, bool subtract) {
#define PUMICE_FMA(name, type) {I::kIdV##name##132##type, I::kIdV##name##213##type, I::kIdV##name##231##type}
  static constexpr FmaForms kForms[2][2][2] = {{{PUMICE_FMA(fmadd, ps), PUMICE_FMA(fmsub, ps)}, {PUMICE_FMA(fnmadd, ps), PUMICE_FMA(fnmsub, ps)}},
                                               {{PUMICE_FMA(fmadd, pd), PUMICE_FMA(fmsub, pd)}, {PUMICE_FMA(fnmadd, pd), PUMICE_FMA(fnmsub, pd)}}};
#undef PUMICE_FMA
  return kForms[wide][negative][subtract];
}
inline FmaSteps fmaSteps(const FmaForms& f, uint32_t d, Source a, Source b, Source c, uint32_t scratch) {
  FmaSteps s;
  const auto is = [&](const Source& x) { return x.isReg && x.id == d; };
  const auto inReg = [&](const Source& x) {
    if (x.isReg) return x.id;
    s.load(scratch, x);
    return uint8_t(scratch);
  };
  const auto make = [&](InstId id, uint8_t second, const Source& third) {
    s.id = id;
    s.second = second;
    s.third = third;
  };
  // 213: d = d * 2nd + 3rd, 132: d = d * 3rd + 2nd, 231: d = d + 2nd * 3rd; the 3rd may be in memory.
  if (is(a) || is(b)) {
    const Source& other = is(a) ? b : a;
    if (other.isReg) make(f.f213, other.id, c);
    else make(f.f132, inReg(c), other);
  } else if (is(c)) {
    if (!a.isReg && b.isReg) make(f.f231, b.id, a);
    else make(f.f231, inReg(a), b);
  } else if (a.isReg || b.isReg) {
    s.load(d, c);
    if (a.isReg) make(f.f231, a.id, b);
    else make(f.f231, b.id, a);
  } else {
    s.load(d, a);
    if (c.isReg) make(f.f132, c.id, b);
    else make(f.f213, inReg(b), c);
  }
  return s;
}
}  // namespace

void Emitter::mul(Ymm d, Source a, Source b, Source c, bool wide, bool negative, bool subtract) {
  const FmaSteps s = fmaSteps(fmaForms(wide, negative, subtract), d.id(), a, b, c, t0().id());
  for (uint32_t k = 0; k < s.moves; k++) a_.move(Ymm(s.move[k].to), s.move[k].from);
  a_.emit(s.id, d, Ymm(s.second), s.third);
}

void Emitter::fma(Value v) {
  Value o[3];
  bool negative[3];
  for (size_t k = 0; k < 3; k++) {
    o[k] = f_.operands(v)[k];
    negative[k] = !preamble_ && p_.folded[o[k]];
    if (negative[k]) o[k] = f_.operands(o[k])[0];
  }
  const Type t = f_.type(v);
  const Parts x = parts(o[0]), y = parts(o[1]), z = parts(o[2]);
  const FmaForms& forms = fmaForms(t == Type::F64, negative[0] != negative[1], negative[2]);
  const uint32_t count = partsOf(t);
  uint8_t* at = preamble_ ? nullptr : a_.room(4 * count);
  for (uint32_t part = 0; part < count; part++) {
    const Ymm d = target(v, part);
    const FmaSteps s = fmaSteps(forms, d.id(), source(x, part), source(y, part), source(z, part), t0().id());
    if (!at) {
      for (uint32_t k = 0; k < s.moves; k++) a_.move(Ymm(s.move[k].to), s.move[k].from);
      a_.emit(s.id, d, Ymm(s.second), s.third);
      finish(v, part, d);
      continue;
    }
    for (uint32_t k = 0; k < s.moves; k++) {
      const Source& from = s.move[k].from;
      at = encodeRvm(at, I::kIdVmovaps, s.move[k].to, 0, !from.isReg, from.id, from.offset);
    }
    at = encodeRvm(at, s.id, d.id(), s.second, !s.third.isReg, s.third.id, s.third.offset);
    if (const Vreg& to = p_.vregs[p_.vregOf[v]]; to.reg[part] < 0) {
      const Source slot = slotSource(to.slot[part]);
      at = encodeStore(at, d.id(), slot.id, slot.offset);
    }
  }
  if (at) a_.wrote(at);
}

void Emitter::compare(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const Type t = f_.type(o[0]);
  const bool wide = ir::typeBytes(t) == 8;
  //! One vector of it in d (t0 .. t2 or the target).
  const auto one = [&](Ymm d, uint32_t part) {
    const Source a = source(o[0], part), b = source(o[1], part);
    const InstId test = wide ? I::kIdVcmppd : I::kIdVcmpps;
    bool invert = false;
    switch (i.op) {
      case Op::FEq: return cmp(test, d, a, b, kEq);
      case Op::FNe: return cmp(test, d, a, b, kNeqUnordered);
      case Op::FLt: return cmp(test, d, a, b, kLt);
      case Op::FLe: return cmp(test, d, a, b, kLe);
      case Op::IEq:
      case Op::INe:
        bin(wide ? I::kIdVpcmpeqq : I::kIdVpcmpeqd, d, a, b, true);
        invert = i.op == Op::INe;
        break;
      case Op::ULt:
      case Op::ULe:
        if (!wide) {
          // a <= b: the smaller is a; a < b: not (b <= a).
          const Source& least = i.op == Op::ULe ? a : b;
          bin(I::kIdVpminud, t1(), a, b, true);
          bin(I::kIdVpcmpeqd, d, reg(t1()), least, true);
          invert = i.op == Op::ULt;
          break;
        }
        [[fallthrough]];
      default: {
        const bool orEqual = i.op == Op::SLe || i.op == Op::ULe;   // not (a > b); a < b: b > a
        const Source &x = orEqual ? a : b, &y = orEqual ? b : a;
        const uint64_t sign = t == Type::I8 ? 0x80 : t == Type::I16 ? 0x8000 : 0;
        if (i.op == Op::ULt || i.op == Op::ULe || sign) {
          // Another order: the sign bit turned over.
          const x86::Mem flip = wide ? pool64(uint64_t(1) << 63) : pool32(uint32_t(sign));
          move(t1(), x);
          a_.vpxor(t1(), t1(), flip);
          move(t0(), y);
          a_.vpxor(t0(), t0(), flip);
          a_.emit(wide ? I::kIdVpcmpgtq : I::kIdVpcmpgtd, d, t1(), t0());
        } else {
          bin(wide ? I::kIdVpcmpgtq : I::kIdVpcmpgtd, d, x, y);
        }
        invert = orEqual;
      }
    }
    if (invert) a_.vpxor(d, d, pool64(~uint64_t(0)));
  };
  for (uint32_t part = 0; part < partsOf(Type::Mask); part++) {
    const Ymm d = target(v, part);
    if (!wide || single_) {
      one(d, part);
      finish(v, part, d);
    } else {
      // The upper half waits in the frame: `one` needs the scratch registers.
      one(t2(), part * 2 + 1);
      a_.vmovaps(frameMem(frameRow(0)), t2());
      one(t2(), part * 2);
      a_.vshufps(t2(), t2(), frameMem(frameRow(0)), 0x88);
      a_.vpermq(d, t2(), 0xd8);
      finish(v, part, d);
    }
  }
}

void Emitter::select(Value v) {
  const auto o = f_.operands(v);
  const Type t = f_.type(v);
  const bool keep = p_.a.nan[v] == interp::NanBits::Kept, wide = ir::typeBytes(t) == 8 && !single_;
  const bool orZero = f_.insts[o[2]].op == Op::Const && !f_.insts[o[2]].imm;
  for (uint32_t part = 0; part < partsOf(t); part++) {
    if (orZero) {
      const Ymm m = wide ? wideMask(o[0], part, t1()) : load(o[0], part, t1());
      a_.emit(I::kIdVandps, target(v, part), m, keep ? settled(o[1], part, t0()) : source(o[1], part));
      finish(v, part, target(v, part));
      continue;
    }
    Source yes = keep ? settled(o[1], part, t0()) : source(o[1], part);
    Source no = keep ? settled(o[2], part, t2()) : source(o[2], part);
    const Ymm m = wide ? wideMask(o[0], part, t1()) : load(o[0], part, t1());
    const Ymm d = target(v, part);
    if (!no.isReg) {
      a_.move(t2(), no);
      no = reg(t2());
    }
    a_.emit(I::kIdVblendvps, d, no.reg(), yes, m);
    finish(v, part, d);
  }
}

void Emitter::shift(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const bool wide = i.type == Type::I64;
  const InstId byImm = i.op == Op::Shl    ? (wide ? I::kIdVpsllq : I::kIdVpslld)
                       : i.op == Op::LShr ? (wide ? I::kIdVpsrlq : I::kIdVpsrld)
                                          : (wide ? I::kIdVpsraq : I::kIdVpsrad);
  const InstId byLane = i.op == Op::Shl    ? (wide ? I::kIdVpsllvq : I::kIdVpsllvd)
                        : i.op == Op::LShr ? (wide ? I::kIdVpsrlvq : I::kIdVpsrlvd)
                                           : (wide ? I::kIdVpsravq : I::kIdVpsravd);
  const uint32_t width = wide ? 63 : 31;
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Ymm d = target(v, part);
    if (wide && i.op == Op::AShr && !a_.evex()) {
      // The sign fills from above; shifts by 64 give zero.
      const Source x = source(o[0], part);
      if (isConst(o[1])) {
        const uint32_t count = uint32_t(f_.insts[o[1]].imm) & 63;
        a_.vpsrlq(t2(), load(o[0], part, t2()), count);
        a_.vpxor(t0(), t0(), t0());
        a_.emit(I::kIdVpcmpgtq, t0(), t0(), x);
        a_.vpsllq(t0(), t0(), 64 - count);
      } else {
        a_.vpand(t1(), load(o[1], part, t1()), pool64(63));
        a_.vpsrlvq(t2(), load(o[0], part, t2()), t1());
        a_.vmovaps(t0(), pool64(64));
        a_.vpsubq(t1(), t0(), t1());
        a_.vpxor(t0(), t0(), t0());
        a_.emit(I::kIdVpcmpgtq, t0(), t0(), x);
        a_.vpsllvq(t0(), t0(), t1());
      }
      a_.vpor(d, t0(), t2());
      finish(v, part, d);
      continue;
    }
    if (isConst(o[1])) {
      const Ymm x = load(o[0], part, t0());
      a_.emit(byImm, d, x, asmjit::imm(uint32_t(f_.insts[o[1]].imm) & width));
    } else {
      const Ymm count = load(o[1], part, t1());
      a_.vpand(t1(), count, wide ? pool64(width) : pool32(width));
      const Ymm x = load(o[0], part, t0());
      a_.emit(byLane, d, x, t1());
    }
    finish(v, part, d);
  }
}

//! In double: the quotient of two 32-bit integers is at least 1/b below the next integer, far more than it is rounded by.
//! What division by zero leaves (infinity, NaN) is or-ed away: all ones.
void Emitter::divide(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const bool isSigned = i.op == Op::SDiv || i.op == Op::SRem, remainder = i.op == Op::SRem || i.op == Op::URem;
  const x86::Mem magic = pool64(0x4330000000000000);   // 2^52: its low bits are an integer's
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Source a = source(o[0], part), b = source(o[1], part);
    //! Four lanes as doubles.
    const auto widen = [&](Ymm to, Source s, bool upper) {
      const InstId id = isSigned ? I::kIdVcvtdq2pd : I::kIdVpmovzxdq;
      if (!s.isReg) {
        x86::Mem m = s.mem();
        m.addOffset(upper ? 16 : 0);
        m.setSize(16);
        a_.emit(id, to, m);
      } else if (upper) {
        a_.vextracti128(to.xmm(), s.reg(), 1);
        a_.emit(id, to, to.xmm());
      } else {
        a_.emit(id, to, s.reg().xmm());
      }
      if (isSigned) return;
      a_.vpor(to, to, magic);
      a_.vsubpd(to, to, magic);
    };
    for (const bool upper : {false, true}) {
      widen(t0(), a, upper);
      widen(t1(), b, upper);
      a_.vdivpd(t0(), t0(), t1());
      if (isSigned) {
        a_.vcvttpd2dq(upper ? t0().xmm() : t2().xmm(), t0());
        if (upper) a_.vinserti128(t2(), t2(), t0().xmm(), 1);
      } else {
        a_.vroundpd(t0(), t0(), 11);
        a_.vaddpd(upper ? t0() : t2(), t0(), magic);
        if (upper) narrowMask(t2(), t0());
      }
    }
    a_.vpxor(t0(), t0(), t0());
    bin(I::kIdVpcmpeqd, t0(), reg(t0()), b);
    a_.vpor(t2(), t2(), t0());
    const Ymm d = target(v, part);
    if (remainder) {
      bin(I::kIdVpmulld, t2(), reg(t2()), b);
      const Ymm x = load(o[0], part, t0());
      a_.vpsubd(d, x, t2());
    } else {
      move(d, reg(t2()));
    }
    if (const uint32_t bytes = ir::typeBytes(i.type); bytes < 4) a_.vpand(d, d, pool32(bytes == 1 ? 0xff : 0xffff));
    finish(v, part, d);
  }
}

void Emitter::multiplyWide(Value v) {
  const auto o = f_.operands(v);
  for (uint32_t part = 0; part < partsOf(Type::I64); part++) {
    if (a_.evex()) {
      const Ymm d = target(v, part);
      bin(I::kIdVpmullq, d, source(o[0], part), source(o[1], part), true);
      finish(v, part, d);
      continue;
    }
    const Ymm a = load(o[0], part, t2());
    const Source b = source(o[1], part);
    a_.vpsrlq(t0(), a, 32);
    bin(I::kIdVpmuludq, t0(), reg(t0()), b);
    move(t1(), b);
    a_.vpsrlq(t1(), t1(), 32);
    a_.vpmuludq(t1(), t1(), a);
    a_.vpaddq(t0(), t0(), t1());
    a_.vpsllq(t0(), t0(), 32);
    bin(I::kIdVpmuludq, t1(), reg(a), b);
    const Ymm d = target(v, part);
    a_.vpaddq(d, t0(), t1());
    finish(v, part, d);
  }
}

//! Even and odd lanes apart: the instruction multiplies to 64 bits.
bool Emitter::multiplyHigh(Value v) {
  const auto o = f_.operands(v);
  const InstId id = f_.insts[v].op == Op::SMulHi ? I::kIdVpmuldq : I::kIdVpmuludq;
  for (uint32_t part = 0; part < partsOf(Type::I32); part++) {
    const Ymm a = load(o[0], part, t0()), b = load(o[1], part, t1());
    a_.emit(id, t2(), a, b);
    a_.vpsrlq(t2(), t2(), 32);
    a_.vpsrlq(t0(), a, 32);
    a_.vpsrlq(t1(), b, 32);
    a_.emit(id, t0(), t0(), t1());
    const Ymm d = target(v, part);
    a_.vpblendd(d, t2(), t0(), 0xaa);
    finish(v, part, d);
  }
  return true;
}

}  // namespace pumice::jit
