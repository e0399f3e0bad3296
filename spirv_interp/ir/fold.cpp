#include "spirv_interp/ir/fold.h"

#include <bit>
#include <cmath>
#include <limits>

namespace pumice::ir {

uint16_t halfFromDouble(double x) {
  const uint64_t bits = std::bit_cast<uint64_t>(x);
  const uint16_t sign = uint16_t(bits >> 48 & 0x8000);
  const double a = std::fabs(x);
  if (x != x) return 0x7e00;
  if (a >= 65520.0) return sign | 0x7c00;  // the midpoint between 65504 and 2^16 rounds to even: infinity
  // Adding a power of two whose unit is the half's unit makes the addition round for us.
  int e = a == 0 ? -14 : std::ilogb(a);
  if (e < -14) e = -14;
  const double magic = std::ldexp(1.5, e + 42);  // unit in the last place 2^(e-10)
  const double rounded = (a + magic) - magic;
  const auto units = uint32_t(std::ldexp(rounded, 10 - e));  // in [0, 2048]
  // A carry into the next binade comes out right: units == 2048 adds one to the exponent.
  return uint16_t(sign + (uint32_t(e + 14) << 10) + units);
}

double halfToDouble(uint16_t h) {
  const uint32_t exponent = h >> 10 & 31, mantissa = h & 1023;
  double a;
  if (exponent == 31)
    a = mantissa ? NAN : INFINITY;
  else if (exponent == 0)
    a = std::ldexp(double(mantissa), -24);
  else
    a = std::ldexp(double(mantissa + 1024), int(exponent) - 25);
  return h & 0x8000 ? -a : a;
}

uint64_t floatBits(Type t, double x) {
  if (t == Type::F16) return halfFromDouble(x);
  if (t == Type::F32) return x != x ? 0x7fc00000u : std::bit_cast<uint32_t>(float(x));
  return x != x ? 0x7ff8000000000000u : std::bit_cast<uint64_t>(x);
}

double floatValue(Type t, uint64_t bits) {
  if (t == Type::F16) return halfToDouble(uint16_t(bits));
  if (t == Type::F32) return std::bit_cast<float>(uint32_t(bits));
  return std::bit_cast<double>(bits);
}

namespace {

uint64_t signBit(Type t) { return uint64_t(1) << (typeBytes(t) * 8 - 1); }

int64_t asSigned(Type t, uint64_t x) {
  const unsigned shift = 64 - typeBytes(t) * 8;
  return int64_t(x << shift) >> shift;
}

// Double arithmetic rounded once more to f32 or f16 is correct for + - * / sqrt (2p+2 bits suffice).
uint64_t foldFma(Type t, double a, double b, double c) {
  if (t == Type::F64) return floatBits(t, std::fma(a, b, c));
  if (t == Type::F32) return floatBits(t, std::fma(float(a), float(b), float(c)));
  // The product of two halves is exact (22 bits). Where the sum is not, one addend is too small to reach
  // the midpoint of two halves, so rounding twice does no harm.
  return floatBits(t, a * b + c);
}

double foldMinMax(double a, double b, bool max) {
  if (a != a) return b;
  if (b != b) return a;
  if (a == b) return std::signbit(a) == max ? b : a;
  return (a < b) == max ? b : a;
}

uint64_t foldToInt(Type to, double x, bool isSigned) {
  if (x != x) return 0;
  const int bits = int(typeBytes(to)) * 8;
  const double lo = isSigned ? -std::ldexp(1.0, bits - 1) : 0.0;
  const double hi = std::ldexp(1.0, isSigned ? bits - 1 : bits);  // exclusive
  const double t = std::trunc(x);
  if (t < lo) return isSigned ? signBit(to) : 0;
  if (t >= hi) return isSigned ? signBit(to) - 1 : allOnes(to);
  return (isSigned ? uint64_t(int64_t(t)) : uint64_t(t)) & allOnes(to);
}

// An i64 converted to f32 or f16 must round once; through double it would round twice.
uint64_t foldFromInt(Type to, Type from, uint64_t x, bool isSigned) {
  const int64_t s = asSigned(from, x);
  if (to == Type::F64) return floatBits(to, isSigned ? double(s) : double(x));
  if (to == Type::F32) return std::bit_cast<uint32_t>(isSigned ? float(s) : float(x));
  // f16: beyond 2^17 everything is infinite, below it a double is exact
  if (isSigned) return halfFromDouble(s > 100000 ? INFINITY : s < -100000 ? -INFINITY : double(s));
  return halfFromDouble(x > 100000 ? INFINITY : double(x));
}

bool foldFloat(Op op, Type t, std::span<const uint64_t> args, uint64_t& r) {
  const double a = args.size() > 0 ? floatValue(t, args[0]) : 0;
  const double b = args.size() > 1 ? floatValue(t, args[1]) : 0;
  switch (op) {
    case Op::FAdd:
      r = floatBits(t, a + b);
      return true;
    case Op::FSub:
      r = floatBits(t, a - b);
      return true;
    case Op::FMul:
      r = floatBits(t, a * b);
      return true;
    case Op::FDiv:
      r = floatBits(t, a / b);
      return true;
    case Op::Fma:
      r = foldFma(t, a, b, floatValue(t, args[2]));
      return true;
    case Op::FNeg:
      r = args[0] ^ signBit(t);
      return true;
    case Op::FAbs:
      r = args[0] & ~signBit(t);
      return true;
    case Op::FMin:
      r = floatBits(t, foldMinMax(a, b, false));
      return true;
    case Op::FMax:
      r = floatBits(t, foldMinMax(a, b, true));
      return true;
    case Op::FSqrt:
      r = floatBits(t, std::sqrt(a));
      return true;
    case Op::FFloor:
      r = floatBits(t, std::floor(a));
      return true;
    case Op::FCeil:
      r = floatBits(t, std::ceil(a));
      return true;
    case Op::FTrunc:
      r = floatBits(t, std::trunc(a));
      return true;
    case Op::FRoundEven:
      r = floatBits(t, std::nearbyint(a));
      return true;
    default:
      return false;
  }
}

uint64_t reverseBits(uint64_t x, unsigned bits) {
  uint64_t r = 0;
  for (unsigned i = 0; i < bits; ++i) r |= (x >> i & 1) << (bits - 1 - i);
  return r;
}

bool foldInt(Op op, Type t, std::span<const uint64_t> args, uint64_t& r) {
  const unsigned bits = typeBytes(t) * 8;
  const uint64_t a = args[0], b = args.size() > 1 ? args[1] : 0;
  const int64_t sa = asSigned(t, a), sb = asSigned(t, b);
  const unsigned shift = unsigned(b & (bits - 1));
  switch (op) {
    case Op::IAdd:
      r = a + b;
      break;
    case Op::ISub:
      r = a - b;
      break;
    case Op::IMul:
      r = a * b;
      break;
    case Op::SMulHi:
      if (bits > 32) return false;
      r = uint64_t((sa * sb) >> bits);
      break;
    case Op::UMulHi:
      if (bits > 32) return false;
      r = (a * b) >> bits;
      break;
    case Op::SDiv:
      r = sb == 0 ? ~uint64_t(0) : sb == -1 ? 0 - a : uint64_t(sa / sb);
      break;
    case Op::UDiv:
      r = b == 0 ? ~uint64_t(0) : a / b;
      break;
    case Op::SRem:
      r = sb == 0 ? a : sb == -1 ? 0 : uint64_t(sa % sb);
      break;
    case Op::URem:
      r = b == 0 ? a : a % b;
      break;
    case Op::And:
      r = a & b;
      break;
    case Op::Or:
      r = a | b;
      break;
    case Op::Xor:
      r = a ^ b;
      break;
    case Op::Not:
      r = ~a;
      break;
    case Op::Shl:
      r = a << shift;
      break;
    case Op::LShr:
      r = a >> shift;
      break;
    case Op::AShr:
      r = uint64_t(sa >> shift);
      break;
    case Op::SMin:
      r = sa < sb ? a : b;
      break;
    case Op::SMax:
      r = sa > sb ? a : b;
      break;
    case Op::UMin:
      r = a < b ? a : b;
      break;
    case Op::UMax:
      r = a > b ? a : b;
      break;
    case Op::PopCount:
      r = uint64_t(std::popcount(a));
      break;
    case Op::BitReverse:
      r = reverseBits(a, bits);
      break;
    case Op::FindMsb:
      r = a ? 63 - uint64_t(std::countl_zero(a)) : ~uint64_t(0);
      break;
    case Op::FindLsb:
      r = a ? uint64_t(std::countr_zero(a)) : ~uint64_t(0);
      break;
    default:
      return false;
  }
  r &= allOnes(t);
  return true;
}

bool foldCompare(Op op, Type t, uint64_t a, uint64_t b, uint64_t& r) {
  const double fa = isFloat(t) ? floatValue(t, a) : 0, fb = isFloat(t) ? floatValue(t, b) : 0;
  const int64_t sa = isInt(t) ? asSigned(t, a) : 0, sb = isInt(t) ? asSigned(t, b) : 0;
  switch (op) {
    case Op::FEq:
      r = fa == fb;
      return true;
    case Op::FNe:
      r = !(fa == fb);
      return true;
    case Op::FLt:
      r = fa < fb;
      return true;
    case Op::FLe:
      r = fa <= fb;
      return true;
    case Op::IEq:
      r = a == b;
      return true;
    case Op::INe:
      r = a != b;
      return true;
    case Op::SLt:
      r = sa < sb;
      return true;
    case Op::SLe:
      r = sa <= sb;
      return true;
    case Op::ULt:
      r = a < b;
      return true;
    case Op::ULe:
      r = a <= b;
      return true;
    default:
      return false;
  }
}

bool foldConversion(Op op, Type to, Type from, uint64_t a, uint64_t& r) {
  switch (op) {
    case Op::FToF:
      r = floatBits(to, floatValue(from, a));
      return true;
    case Op::FToS:
      r = foldToInt(to, floatValue(from, a), true);
      return true;
    case Op::FToU:
      r = foldToInt(to, floatValue(from, a), false);
      return true;
    case Op::SToF:
      r = foldFromInt(to, from, a, true);
      return true;
    case Op::UToF:
      r = foldFromInt(to, from, a, false);
      return true;
    case Op::SExt:
      r = uint64_t(asSigned(from, a)) & allOnes(to);
      return true;
    case Op::ZExt:
      r = a;
      return true;
    case Op::Trunc:
      r = a & allOnes(to);
      return true;
    case Op::BitCast:
      r = a;
      return true;
    default:
      return false;
  }
}

}  // namespace

bool foldConstant(Op op, Type type, Type operandType, std::span<const uint64_t> args, uint64_t& result) {
  const OpInfo& info = opInfo(op);
  if (args.empty() || !(info.flags & kPure) || (info.flags & kHigh)) return false;
  switch (info.operands) {
    case OperandRule::Float:
      return foldFloat(op, type, args, result);
    case OperandRule::Int:
      return foldInt(op, type, args, result);
    case OperandRule::CmpF:
    case OperandRule::CmpI:
      return foldCompare(op, operandType, args[0], args[1], result);
    case OperandRule::Cvt:
      return foldConversion(op, type, operandType, args[0], result);
    case OperandRule::Sel:
      result = args[0] ? args[1] : args[2];
      return true;
    case OperandRule::Mask:
      switch (op) {
        case Op::MaskAnd:
          result = args[0] & args[1];
          return true;
        case Op::MaskOr:
          result = args[0] | args[1];
          return true;
        case Op::MaskXor:
          result = args[0] ^ args[1];
          return true;
        case Op::MaskNot:
          result = args[0] ^ 1;
          return true;
        default:
          return false;
      }
    default:
      return false;
  }
}

Op reduceOperation(ReduceOp op) {
  constexpr Op kOps[] = {Op::IAdd, Op::FAdd, Op::IMul, Op::FMul, Op::SMin, Op::SMax, Op::UMin,
                         Op::UMax, Op::FMin, Op::FMax, Op::And,  Op::Or,   Op::Xor};
  return kOps[static_cast<size_t>(op)];
}

uint64_t reduceIdentity(ReduceOp op, Type t) {
  const double infinity = std::numeric_limits<double>::infinity();
  switch (op) {
    case ReduceOp::IMul:
      return 1;
    case ReduceOp::FMul:
      return floatBits(t, 1);
    case ReduceOp::SMin:
      return allOnes(t) >> 1;
    case ReduceOp::SMax:
      return (allOnes(t) >> 1) + 1;
    case ReduceOp::UMin:
    case ReduceOp::And:
      return allOnes(t);
    case ReduceOp::FMin:
      return floatBits(t, infinity);
    case ReduceOp::FMax:
      return floatBits(t, -infinity);
    default:
      return 0;
  }
}

}  // namespace pumice::ir
