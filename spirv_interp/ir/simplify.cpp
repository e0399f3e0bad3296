#include <bit>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/fold.h"

namespace pumice::ir {

namespace {

// `(x op inner) op c`, where the definition of `v` is x op inner with a constant inner.
bool constantChain(Builder& b, Op op, Value v, Value& x, uint64_t& inner) {
  const Function& f = b.function();
  if (f.insts[v].op != op) return false;
  x = f.operands(v)[0];
  return b.isConstant(f.operands(v)[1], &inner);
}

Value simplifyWithConstant(Builder& b, Op op, Type t, Value x, uint64_t c) {
  const uint64_t ones = allOnes(t);
  const bool powerOfTwo = std::has_single_bit(c);
  const unsigned log2 = unsigned(std::countr_zero(c));
  Value inner = 0;
  uint64_t d = 0;
  switch (op) {
    case Op::IAdd:
      if (c == 0) return x;
      if (constantChain(b, op, x, inner, d)) return b.iadd(inner, b.constant(t, c + d));
      return 0;
    case Op::ISub:
      return b.iadd(x, b.constant(t, 0 - c));
    case Op::IMul:
      if (c == 0) return b.zero(t);
      if (c == 1) return x;
      if (powerOfTwo) return b.shl(x, b.constant(t, log2));
      return 0;
    case Op::UDiv:
      if (c == 1) return x;
      if (powerOfTwo) return b.lshr(x, b.constant(t, log2));
      return 0;
    case Op::SDiv:
      return c == 1 ? x : 0;
    case Op::URem:
      return powerOfTwo ? b.and_(x, b.constant(t, c - 1)) : 0;
    case Op::And:
      if (c == 0) return b.zero(t);
      if (c == ones) return x;
      if (constantChain(b, op, x, inner, d)) return b.and_(inner, b.constant(t, c & d));
      return 0;
    case Op::Or:
      return c == 0 ? x : c == ones ? b.constant(t, ones) : 0;
    case Op::Xor:
      return c == 0 ? x : 0;
    case Op::Shl:
      if (const uint64_t count = c & (typeBytes(t) * 8 - 1); count && constantChain(b, Op::IAdd, x, inner, d) && ((d << count) & ones) == 0)
        return b.shl(inner, b.constant(t, count));
      [[fallthrough]];
    case Op::LShr:
    case Op::AShr:
      return (c & (typeBytes(t) * 8 - 1)) == 0 ? x : 0;
    case Op::UMin:
      return c == 0 ? b.zero(t) : c == ones ? x : 0;
    case Op::UMax:
      return c == 0 ? x : 0;
    case Op::MaskAnd:
      return c ? x : b.mask(false);
    case Op::MaskOr:
      return c ? b.mask(true) : x;
    case Op::MaskXor:
      return c ? b.maskNot(x) : x;
    default:
      return 0;
  }
}

Value simplifySame(Builder& b, Op op, Type t, Value x) {
  switch (op) {
    case Op::ISub:
    case Op::Xor:
      return b.zero(t);
    case Op::And:
    case Op::Or:
    case Op::SMin:
    case Op::SMax:
    case Op::UMin:
    case Op::UMax:
    case Op::MaskAnd:
    case Op::MaskOr:
      return x;
    case Op::MaskXor:
    case Op::INe:
    case Op::SLt:
    case Op::ULt:
      return b.mask(false);
    case Op::IEq:
    case Op::SLe:
    case Op::ULe:
      return b.mask(true);
    default:
      return 0;
  }
}

Value simplifySelect(Builder& b, Type t, Value m, Value x, Value y) {
  if (x == y) return x;
  const Function& f = b.function();
  uint64_t c = 0, d = 0;
  if (b.isConstant(m, &c)) return c ? x : y;
  if (f.insts[m].op == Op::MaskNot) return b.select(f.operands(m)[0], y, x);
  if (t != Type::Mask) return 0;
  if (b.isConstant(x, &c)) return c ? b.maskOr(m, y) : b.maskAnd(b.maskNot(m), y);
  if (b.isConstant(y, &d)) return d ? b.maskOr(b.maskNot(m), x) : b.maskAnd(m, x);
  return 0;
}

}  // namespace

Value simplify(Builder& b, Op op, Type type, std::span<const Value> v) {
  const Function& f = b.function();
  if (op == Op::Select) return simplifySelect(b, type, v[0], v[1], v[2]);
  if (v.size() == 2) {
    uint64_t c = 0;
    if (b.isConstant(v[1], &c)) return simplifyWithConstant(b, op, type, v[0], c);
    return v[0] == v[1] ? simplifySame(b, op, type, v[0]) : 0;
  }
  if (v.size() != 1) return 0;
  const Inst& inner = f.insts[v[0]];
  const Value x = inner.operandCount ? f.operands(v[0])[0] : 0;
  switch (op) {
    case Op::Not:
    case Op::FNeg:
    case Op::MaskNot:
      return inner.op == op ? x : 0;
    case Op::FAbs:
      if (inner.op == Op::FAbs) return v[0];
      return inner.op == Op::FNeg ? b.fabs(x) : 0;
    case Op::FFloor:
    case Op::FCeil:
    case Op::FTrunc:
    case Op::FRoundEven:
      return inner.op == op ? v[0] : 0;
    case Op::BitCast:
      if (inner.op == Op::BitCast) return b.bitcast(type, x);
      return f.type(v[0]) == type ? v[0] : 0;
    case Op::Trunc:
      return (inner.op == Op::ZExt || inner.op == Op::SExt) && f.type(x) == type ? x : 0;
    default:
      return 0;
  }
}

}  // namespace pumice::ir
