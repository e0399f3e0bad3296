// The lowerings that f32 and f64 share. `Derived` is the set of one type: it derives from MathOf<Derived,
// Numbers> and adds logTail(), logAtanhTail(), nearAngle() and farAngle(); `Numbers` holds the type's
// constants and polynomials.
//
// Methods: Cody-Waite argument reduction with fused multiply-add and minimax polynomials; see J.-M. Muller,
// "Elementary Functions" (2016), and S. Moshier's Cephes for the choice of ranges. Angles too large for that
// are multiplied by as many bits of 2/pi as they need (M. Payne, R. Hanek, SIGNUM 18, 1983).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/lower_math.h"

namespace pumice::ir {

//! 2/pi, 32 bits a word, after one word of zeros.
inline constexpr uint32_t kTwoOverPiBits[] = {
    0,          0xa2f9836e, 0x4e441529, 0xfc2757d1, 0xf534ddc0, 0xdb629599, 0x3c439041, 0xfe5163ab,
    0xdebbc561, 0xb7246e3a, 0x424dd2e0, 0x06492eea, 0x09d1921c, 0xfe1deb1c, 0xb129a73e, 0xe88235f5,
    0x2ebb4484, 0xe99c7026, 0xb45f7e41, 0x3991d639, 0x835339f4, 0x9c845f8b, 0xbdf9283b, 0x1ff897ff,
    0xde05980f, 0xef2f118b, 0x5a0a6d1f, 0x6d367ecf, 0x27cb09b7, 0x4f463f66, 0x9e5fea2d, 0x7527bac7,
    0xebe5f17b, 0x3d0739f7, 0x8a5292ea, 0x6bfb5fb1, 0x1f8d5d08, 0x56033046};

template <class Derived, class N>
class MathOf {
 public:
  using Float = typename N::Float;

  MathOf(Builder& b, bool uniform, AngleCache& cache) : b_(b), uniform_(uniform), cache_(cache) {}

  Value lower(Op op, std::span<const Value> v) {
    switch (op) {
      case Op::FRsqrt:
        return b_.fdiv(c(1), b_.fsqrt(v[0]));
      case Op::FExp2:
        return exp2(v[0]);
      case Op::FLog2:
        return log2(v[0]);
      case Op::FExp:
        return exp(v[0]);
      case Op::FLog:
        return log(v[0]);
      case Op::FPow:
        return pow(v[0], v[1]);
      case Op::FSin:
        return sin(v[0]);
      case Op::FCos:
        return cos(v[0]);
      case Op::FTan:
        return tan(v[0]);
      case Op::FAsin:
        return asin(v[0]);
      case Op::FAcos:
        return acos(v[0]);
      case Op::FAtan:
        return atan(v[0]);
      case Op::FAtan2:
        return atan2(v[0], v[1]);
      case Op::FSinh:
        return sinh(v[0]);
      case Op::FCosh:
        return cosh(v[0]);
      case Op::FTanh:
        return tanh(v[0]);
      case Op::FAsinh:
        return asinh(v[0]);
      case Op::FAcosh:
        return acosh(v[0]);
      case Op::FAtanh:
        return atanh(v[0]);
      default:
        return 0;
    }
  }

 protected:
  struct Pair {
    Value high, low;
  };
  struct Split {
    Value exponent, fraction;
  };
  struct SineCosine {
    Value quadrant, sine, cosine;
  };

  Value exp2(Value x) {
    const Value clamped = clamp(x, N::kExp2Lowest, N::kExp2Highest);
    const Value n = roundEven(clamped), r = b_.fsub(clamped, n);
    return keepNan(x, scale(b_.fma(r, polynomial(N::kExp2, r), c(1)), n));
  }

  // e^x * 2^shift, for functions whose own result overflows later than e^x does.
  Value exp(Value x, Float shift = 0) {
    const Value clamped = clamp(x, N::kExpLowest, N::kExpHighest);
    const Value n = roundEven(b_.fmul(clamped, c(N::kLog2E))), minusN = b_.fneg(n);
    Value r = b_.fma(minusN, c(N::kLn2), clamped);
    r = b_.fma(minusN, c(N::kLn2Low), r);
    const Value p = b_.fma(b_.fmul(r, r), polynomial(N::kExp, r), r);
    return keepNan(x, scale(b_.fadd(p, c(1)), shift == 0 ? n : b_.fadd(n, c(shift))));
  }

  Value log2(Value x) {
    const Split s = split(x);
    const Value f = s.fraction, low = b_.fmul(f, c(N::kLog2ELow));
    const Value l = b_.fma(f, c(N::kLog2E), b_.fma(self().logTail(f), c(N::kLog2E), low));
    return logSpecials(x, b_.fadd(s.exponent, l));
  }

  Value log(Value x) {
    const Split s = split(x);
    const Value l = b_.fadd(s.fraction, self().logTail(s.fraction));
    return logSpecials(x, b_.fma(s.exponent, c(N::kLn2), b_.fma(s.exponent, c(N::kLn2Low), l)));
  }

  // exp2(y * log2(x)) with the logarithm and the product in two floats each, since the product's absolute
  // error becomes the result's relative error.
  Value pow(Value x, Value y) {
    uint64_t bits = 0;
    if (b_.isConstant(y, &bits)) {
      const double exponent = floatValue(N::kFloat, bits), size = std::abs(exponent);
      if (size >= 0x1p-20 && size <= 64) return power(x, y, exponent);
    }
    const Pair log = twoFloatLog2(x);
    const Value l = logSpecials(x, log.high);

    const Value product = b_.fmul(y, l);
    const Value productLow = b_.fma(y, log.low, b_.fma(y, l, b_.fneg(product)));
    const Value clamped = clamp(product, N::kPowLowest, N::kPowHighest);
    const Value n = roundEven(clamped);
    const Value low = b_.select(b_.feq(clamped, product), productLow, c(0));
    const Value r = b_.fadd(b_.fsub(clamped, n), low);
    const Value result = keepNan(product, scale(b_.fma(r, polynomial(N::kExp2, r), c(1)), n));
    // x^0 = 1 also for x = 0 and infinity, and 1^y = 1 also for infinite y, where the product above is NaN.
    const Value one = b_.maskOr(b_.feq(x, c(1)), b_.maskAnd(b_.feq(y, c(0)), b_.fle(c(0), x)));
    return b_.select(one, c(1), result);
  }
  // The same bits for a constant exponent that is neither tiny nor huge: the product is finite whatever x is, so that what
  // x must be tested for can wait until the end, and 1^y comes out as 1. Where the product is clamped the result is 0 or
  // infinite, whatever the product's low part.
  Value power(Value x, Value y, double exponent) {
    const Limits known = limitsOf(b_.function(), x);
    const Pair log = twoFloatLog2(x);
    const Value product = b_.fmul(y, log.high);
    const Value productLow = b_.fma(y, log.low, b_.fma(y, log.high, b_.fneg(product)));
    const double leastLog = -double(N::kBias + N::kMantissa), mostLog = known.high <= 1 ? 0 : N::kBias + 1;
    const double least = std::min(exponent * leastLog, exponent * mostLog) - 1,
                 most = std::max(exponent * leastLog, exponent * mostLog) + 1;
    const bool below = least < N::kPowLowest, above = most > N::kPowHighest;
    Value clamped = product;
    if (below) clamped = b_.fmax(clamped, c(N::kPowLowest));
    if (above) clamped = b_.fmin(clamped, c(N::kPowHighest));
    const Value n = roundEven(clamped), r = b_.fadd(b_.fsub(clamped, n), productLow);
    const Value p = b_.fma(r, polynomial(N::kExp2, r), c(1));
    // Says where n is, off the longest chain, and so that it needs no care when it becomes an integer.
    Value held = n;
    if (!below) held = b_.fmax(held, c(Float(std::floor(least))));
    if (!above) held = b_.fmin(held, c(Float(std::ceil(most))));
    // Numbers that are not denormal need one step; the lowest bits of the sum are the exponent.
    const bool oneStep = known.number && known.low >= 0 && least > 3 - double(N::kBias) && most < double(N::kBias);
    constexpr Float kExponentLast = Float(uint64_t(3) << (N::kMantissa - 1)) + N::kBias;
    const Value result = oneStep ? b_.fmul(p, b_.bitcast(N::kFloat, b_.shl(b_.bitcast(N::kInt, b_.fadd(held, c(kExponentLast))), integer(N::kMantissa))))
                                 : scale(p, held);
    const Value ofZero = c(exponent > 0 ? 0 : kInf), ofInfinity = c(exponent > 0 ? kInf : 0);
    const auto isInfinite = [&] { return b_.feq(x, c(kInf)); };
    if (!known.number || known.low < 0) {
      const Value ordinary = b_.maskAnd(b_.flt(c(0), x), b_.flt(x, c(kInf)));
      const Value positive = b_.select(isInfinite(), ofInfinity, c(kNan));
      return b_.select(ordinary, result, b_.select(b_.feq(x, c(0)), ofZero, positive));
    }
    const Value finite = known.high < HUGE_VAL ? result : b_.select(isInfinite(), ofInfinity, result);
    return known.low > 0 ? finite : b_.select(b_.flt(c(0), x), finite, ofZero);
  }

  // log2(x) in two floats, for positive finite x; some finite number for all others.
  Pair twoFloatLog2(Value x) {
    const Split s = split(x);
    const Value f = s.fraction;
    // log2(1 + f) = 2/ln2 * atanh(f / (2 + f)), the quotient in two floats
    const Value d = b_.fadd(c(2), f), dLow = b_.fsub(f, b_.fsub(d, c(2)));
    const Value reciprocal = b_.fdiv(c(1), d);
    const Value q = b_.fmul(f, reciprocal), minusQ = b_.fneg(q);
    const Value qLow = b_.fmul(b_.fma(minusQ, dLow, b_.fma(minusQ, d, f)), reciprocal);
    const Value z = b_.fmul(q, q);
    const Value t = b_.fmul(q, c(N::kTwoLog2E));
    Value tLow = b_.fma(q, c(N::kTwoLog2E), b_.fneg(t));
    tLow = b_.fma(q, c(N::kTwoLog2ELow), b_.fma(qLow, c(N::kTwoLog2E), tLow));
    const Pair tail = self().logAtanhTail(q, qLow, z, tLow);
    tLow = tail.low;
    Value fractionLog = t;
    if (tail.high) {
      fractionLog = b_.fadd(t, tail.high);
      tLow = b_.fadd(b_.fsub(tail.high, b_.fsub(fractionLog, t)), tLow);
    }
    const Value sum = b_.fadd(s.exponent, fractionLog);
    const Value sumLow = b_.fadd(b_.fadd(b_.fsub(s.exponent, sum), fractionLog), tLow);
    const Value l = b_.fadd(sum, sumLow);
    return {l, b_.fsub(sumLow, b_.fsub(l, sum))};
  }

  Value sin(Value x) {
    const SineCosine r = sineCosine(x);
    const Value s = negateIf(isSet(r.quadrant, 2), b_.select(isSet(r.quadrant, 1), r.cosine, r.sine));
    return b_.select(b_.feq(x, c(0)), x, s);
  }
  Value cos(Value x) {
    const SineCosine r = sineCosine(x);
    const Value quadrant = b_.iadd(r.quadrant, b_.i32(1));
    return negateIf(isSet(quadrant, 2), b_.select(isSet(r.quadrant, 1), r.sine, r.cosine));
  }
  Value tan(Value x) {
    const SineCosine r = sineCosine(x);
    const Value odd = isSet(r.quadrant, 1);
    const Value numerator = b_.select(odd, r.cosine, r.sine),
                denominator = b_.select(odd, b_.fneg(r.sine), r.cosine);
    return b_.select(b_.feq(x, c(0)), x, b_.fdiv(numerator, denominator));
  }

  Value asin(Value x) {
    const Value a = b_.fabs(x), large = b_.flt(c(0.5f), a);
    const Value p = asinCore(a, large);
    // pi/2 - 2 asin(sqrt((1 - a) / 2))
    return copySign(b_.select(large, b_.fadd(b_.fma(c(-2), p, c(N::kHalfPiLow)), c(N::kHalfPi)), p), x);
  }
  Value acos(Value x) {
    const Value a = b_.fabs(x), large = b_.flt(c(0.5f), a), negative = b_.flt(x, c(0));
    const Value p = asinCore(a, large), twice = b_.fadd(p, p);
    const Value far =
        b_.select(negative, b_.fadd(b_.fsub(c(2 * N::kHalfPiLow), twice), c(2 * N::kHalfPi)), twice);
    const Value near = b_.fadd(c(N::kHalfPi), b_.fsub(c(N::kHalfPiLow), copySign(p, x)));
    return b_.select(large, far, near);
  }

  Value atan(Value x) {
    const Value a = b_.fabs(x);
    const Value r = atanQuotient(b_.fmin(a, c(1)), b_.fmax(a, c(1)));
    return keepNan(x, copySign(b_.select(b_.flt(c(1), a), fromHalfPi(r), r), x));
  }
  Value atan2(Value y, Value x) {
    const Value ay = b_.fabs(y), ax = b_.fabs(x);
    Value low = b_.fmin(ay, ax), high = b_.fmax(ay, ax);
    // The quotient of two infinities counts as 1, that of two zeros as 0; the sum below must not overflow.
    const Value infinite = b_.feq(high, c(kInf));
    low = b_.select(infinite, b_.select(b_.feq(low, c(kInf)), c(1), c(0)), low);
    high = b_.select(infinite, c(1), b_.select(b_.feq(high, c(0)), c(1), high));
    const Value factor = b_.select(b_.flt(c(std::numeric_limits<Float>::max() / 4), high), c(0.25f), c(1));
    Value r = atanQuotient(b_.fmul(low, factor), b_.fmul(high, factor));
    r = b_.select(b_.flt(ax, ay), fromHalfPi(r), r);
    const Value negative = b_.compare(Op::SLt, b_.bitcast(N::kInt, x), b_.zero(N::kInt));
    r = copySign(b_.select(negative, b_.fadd(c(2 * N::kHalfPi), b_.fsub(c(2 * N::kHalfPiLow), r)), r), y);
    return b_.select(b_.maskAnd(b_.feq(x, x), b_.feq(y, y)), r, c(kNan));
  }

  Value sinh(Value x) {
    const Value a = b_.fabs(x), half = exp(a, -1);
    const Value large = b_.fsub(half, b_.fdiv(c(0.25f), half));
    return copySign(b_.select(b_.flt(a, c(1)), odd(N::kSinh, a), large), x);
  }
  Value cosh(Value x) {
    const Value half = exp(b_.fabs(x), -1);
    return b_.fadd(half, b_.fdiv(c(0.25f), half));
  }
  Value tanh(Value x) {
    const Value a = b_.fabs(x), e = exp(b_.fadd(a, a));
    const Value large = b_.fsub(c(1), b_.fdiv(c(2), b_.fadd(e, c(1))));
    return copySign(b_.select(b_.flt(a, c(0.625f)), odd(N::kTanh, a), large), x);
  }
  Value asinh(Value x) {
    const Value a = b_.fabs(x);
    const Value root = b_.fsqrt(b_.fma(a, a, c(1)));
    return copySign(b_.select(b_.flt(a, c(0.5f)), odd(N::kAsinh, a), logOfSum(a, root)), x);
  }
  Value acosh(Value x) {
    const Value t = b_.fsub(x, c(1));
    const Value near = b_.fmul(b_.fsqrt(b_.fadd(t, t)), polynomial(N::kAcosh, t));
    return b_.select(b_.flt(t, c(0.5f)), near, logOfSum(x, b_.fsqrt(b_.fma(x, x, c(-1)))));
  }
  Value atanh(Value x) {
    const Value a = b_.fabs(x);
    const Value large = b_.fmul(c(0.5f), log(b_.fdiv(b_.fadd(c(1), a), b_.fsub(c(1), a))));
    return copySign(b_.select(b_.flt(a, c(0.5f)), odd(N::kAtanh, a), large), x);
  }

  // --- parts

  static constexpr Float kInf = std::numeric_limits<Float>::infinity();
  static constexpr Float kNan = std::numeric_limits<Float>::quiet_NaN();

  Derived& self() { return static_cast<Derived&>(*this); }
  Value c(Float x) { return b_.floatConstant(N::kFloat, x); }
  Value integer(uint64_t x) { return b_.constant(N::kInt, x); }
  Value roundEven(Value x) { return b_.unary(Op::FRoundEven, x); }
  Value clamp(Value x, Float low, Float high) { return b_.fmin(b_.fmax(x, c(low)), c(high)); }
  Value keepNan(Value x, Value result) { return b_.select(b_.feq(x, x), result, c(kNan)); }

  template <size_t Terms>
  Value polynomial(const Float (&k)[Terms], Value x) {
    Value p = c(k[Terms - 1]);
    for (size_t i = Terms - 1; i-- > 0;) p = b_.fma(p, x, c(k[i]));
    return p;
  }
  // x + x^3 p(x^2)
  template <size_t Terms>
  Value odd(const Float (&k)[Terms], Value x) {
    const Value z = b_.fmul(x, x);
    return b_.fma(b_.fmul(x, z), polynomial(k, z), x);
  }

  Value isSet(Value bits, uint32_t bit) { return b_.ine(b_.and_(bits, b_.i32(bit)), b_.i32(0)); }
  Value negateIf(Value m, Value x) { return b_.select(m, b_.fneg(x), x); }
  // a, which is not negative, with the sign of x; a NaN stays canonical in all but its sign.
  Value copySign(Value a, Value x) {
    const Value sign = b_.and_(b_.bitcast(N::kInt, x), integer(uint64_t(1) << (8 * sizeof(Float) - 1)));
    return b_.bitcast(N::kFloat, b_.xor_(b_.bitcast(N::kInt, a), sign));
  }

  // p * 2^n for whole n, |n| < 2 kBias, in two steps so that denormal results round once.
  Value scale(Value p, Value n) {
    const Value whole = b_.convert(Op::FToS, N::kInt, n), half = b_.ashr(whole, integer(1));
    return b_.fmul(b_.fmul(p, powerOfTwo(half)), powerOfTwo(b_.isub(whole, half)));
  }
  Value powerOfTwo(Value n) {
    return b_.bitcast(N::kFloat, b_.shl(b_.iadd(n, integer(N::kBias)), integer(N::kMantissa)));
  }

  // x = 2^exponent * (1 + fraction), 1 + fraction in [sqrt(1/2), sqrt(2)), for positive finite x.
  Split split(Value x) {
    if (const Limits known = limitsOf(b_.function(), x); known.number && known.low >= std::numeric_limits<Float>::min() && known.high < HUGE_VAL) {
      const Value bits = b_.bitcast(N::kInt, x), mantissa = integer(N::kMantissa);
      const Value n = b_.ashr(b_.isub(bits, integer(N::kSqrtHalfBits)), mantissa);
      const Value m = b_.bitcast(N::kFloat, b_.isub(bits, b_.shl(n, mantissa)));
      return {b_.convert(Op::SToF, N::kFloat, n), b_.fsub(m, c(1))};
    }
    const Value tiny = b_.flt(x, c(std::numeric_limits<Float>::min()));
    const Value scaled = b_.select(tiny, b_.fmul(x, c(Float(uint64_t(1) << N::kMantissa))), x);
    const Value bits = b_.bitcast(N::kInt, scaled), mantissa = integer(N::kMantissa);
    const Value n = b_.ashr(b_.isub(bits, integer(N::kSqrtHalfBits)), mantissa);
    const Value m = b_.bitcast(N::kFloat, b_.isub(bits, b_.shl(n, mantissa)));
    const Value exponent = b_.iadd(n, b_.select(tiny, integer(0 - uint64_t(N::kMantissa)), integer(0)));
    return {b_.convert(Op::SToF, N::kFloat, exponent), b_.fsub(m, c(1))};
  }
  Value logSpecials(Value x, Value result) {
    if (const Limits known = limitsOf(b_.function(), x); known.number && known.low > 0 && known.high < HUGE_VAL) return result;
    const Value ordinary = b_.maskAnd(b_.flt(c(0), x), b_.flt(x, c(kInf)));
    const Value positive = b_.select(b_.feq(x, c(kInf)), c(kInf), c(kNan));
    return b_.select(ordinary, result, b_.select(b_.feq(x, c(0)), c(-kInf), positive));
  }
  // log(a + root); where the squares may overflow, root is about a.
  Value logOfSum(Value a, Value root) {
    const Value big = b_.flt(c(N::kRootIsArgument), a);
    return b_.fadd(log(b_.select(big, a, b_.fadd(a, root))), b_.select(big, c(N::kLn2), c(0)));
  }

  // Large angles are rare: they get a branch, unless that would keep a draw-uniform value from being hoisted.
  ReducedAngle reduce(Value x) {
    if (cache_.x == x) return cache_.angle;
    ReducedAngle r = self().nearAngle(x);
    const Value a = b_.fabs(x);
    const Value far = b_.maskAnd(b_.flt(c(N::kNearAngle), a), b_.flt(a, c(kInf)));
    if (uniform_) {
      const ReducedAngle f = self().farAngle(x);
      r = {b_.select(far, f.quadrant, r.quadrant), b_.select(far, f.high, r.high),
           r.low ? b_.select(far, f.low, r.low) : 0};
    } else {
      Value* parts[] = {&r.quadrant, &r.high, &r.low};
      Value vars[3] = {};
      for (size_t k = 0; k < 3; ++k)
        if (*parts[k]) b_.set(vars[k] = b_.var(b_.type(*parts[k])), *parts[k]);
      b_.beginIf(far);
      const ReducedAngle f = self().farAngle(x);
      const Value farParts[] = {f.quadrant, f.high, f.low};
      for (size_t k = 0; k < 3; ++k)
        if (vars[k]) b_.set(vars[k], farParts[k]);
      b_.endIf();
      for (size_t k = 0; k < 3; ++k)
        if (vars[k]) *parts[k] = b_.get(vars[k]);
    }
    cache_ = {x, r};
    return r;
  }
  SineCosine sineCosine(Value x) {
    const ReducedAngle a = reduce(x);
    const Value r = a.high, z = b_.fmul(r, r);
    Value sine = b_.fmul(b_.fmul(r, z), polynomial(N::kSin, z));
    Value cosine = b_.fmul(b_.fmul(z, z), polynomial(N::kCos, z));
    const Value w = b_.fma(z, c(-0.5f), c(1));
    if (!a.low) {
      sine = b_.fma(b_.fmul(r, z), polynomial(N::kSin, z), r);
      cosine = b_.fma(b_.fmul(z, z), polynomial(N::kCos, z), w);
    } else {
      sine = b_.fadd(r, b_.fma(a.low, w, sine));
      const Value rest = b_.fma(z, c(-0.5f), b_.fsub(c(1), w));  // what the rounding of w lost
      cosine = b_.fadd(w, b_.fadd(rest, b_.fma(b_.fneg(r), a.low, cosine)));
    }
    return {a.quadrant, sine, cosine};
  }

  // `count` words of 2/pi from bit `offset` on (as i64). The offset is below 32 * (1 << bits).
  template <size_t Count>
  std::array<Value, Count> twoOverPi(Value offset, unsigned bits) {
    std::vector<Value> words;
    const size_t all = (size_t(1) << bits) + Count;
    for (size_t k = 0; k < all; ++k)
      words.push_back(b_.i32(k < std::size(kTwoOverPiBits) ? kTwoOverPiBits[k] : 0));
    for (unsigned bit = bits; bit-- > 0;) {
      const size_t step = size_t(1) << bit;
      const Value m = isSet(offset, 32u << bit);
      std::vector<Value> next;
      for (size_t k = 0; k < step + Count; ++k) next.push_back(b_.select(m, words[k + step], words[k]));
      words = std::move(next);
    }
    const Value shift = zeroExtend(b_.and_(offset, b_.i32(31))), low = b_.i64(0xffffffff), half = b_.i64(32);
    std::array<Value, Count> aligned;
    for (size_t k = 0; k < Count; ++k) {
      const Value pair = b_.or_(b_.shl(zeroExtend(words[k]), half), zeroExtend(words[k + 1]));
      aligned[k] = b_.and_(b_.lshr(b_.shl(pair, shift), half), low);
    }
    return aligned;
  }
  Value zeroExtend(Value x) { return b_.convert(Op::ZExt, Type::I64, x); }

  // asin(a), or asin(sqrt((1 - a) / 2)) where `large`; NaN beyond 1.
  Value asinCore(Value a, Value large) {
    const Value z = b_.select(large, b_.fma(a, c(-0.5f), c(0.5f)), b_.fmul(a, a));
    const Value s = b_.select(large, b_.fsqrt(z), a);
    return b_.fma(b_.fmul(s, z), polynomial(N::kAsin, z), s);
  }
  // atan(low / high), 0 <= low <= high, in one division: beyond tan(pi/8) it is pi/4 + atan((l - h) / (l +
  // h)).
  Value atanQuotient(Value low, Value high) {
    const Value upper = b_.flt(b_.fmul(high, c(Float(0x1.a8279ap-2))), low);
    const Value numerator = b_.select(upper, b_.fsub(low, high), low);
    const Value denominator = b_.select(upper, b_.fadd(low, high), high);
    const Value p = odd(N::kAtan, b_.fdiv(numerator, denominator));
    return b_.select(upper, b_.fadd(p, c(N::kHalfPi / 2)), p);
  }
  Value fromHalfPi(Value r) { return b_.fadd(c(N::kHalfPi), b_.fsub(c(N::kHalfPiLow), r)); }

  Builder& b_;

 private:
  const bool uniform_;
  AngleCache& cache_;
};

}  // namespace pumice::ir
