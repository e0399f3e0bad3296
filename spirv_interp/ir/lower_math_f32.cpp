// Methods: Cody-Waite argument reduction with fused multiply-add and minimax polynomials (Remez exchange,
// weighted for relative error, coefficients rounded to f32 one after the other, each followed by a new fit of
// the rest). See J.-M. Muller, "Elementary Functions" (2016), and S. Moshier's Cephes for the choice of
// ranges.
#include <cstddef>
#include <limits>

#include "spirv_interp/ir/lower_math.h"

namespace pumice::ir {

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kPi = 0x1.921fb6p+1f, kHalfPi = 0x1.921fb6p+0f, kQuarterPi = 0x1.921fb6p-1f;
constexpr float kLn2 = 0x1.62e430p-1f, kLn2Low = -0x1.05c610p-29f;
constexpr float kHalfPiLow = -0x1.777a5cp-25f, kHalfPiLowest = -0x1.ee59dap-50f, kTwoOverPi = 0x1.45f306p-1f;
constexpr float kTwoLog2E = 0x1.715476p+1f, kTwoLog2ELow = 0x1.4ae0c0p-25f;
constexpr float kLog2E = 0x1.715476p+0f, kLog2ELow = 0x1.4ae0c0p-26f;

// (2^r - 1) / r, |r| <= 1/2; error 2^-27.5 of the function
constexpr float kExp2[] = {0x1.62e432p-1f, 0x1.ebfbe6p-3f,  0x1.c6ada6p-5f,
                           0x1.3b21c6p-7f, 0x1.5fc016p-10f, 0x1.4bc6e8p-13f};
// (e^r - 1 - r) / r^2, |r| <= ln2 / 2; error 2^-28.2 of the function
constexpr float kExp[] = {0x1.fffffcp-2f, 0x1.55548ap-3f, 0x1.55584ep-5f, 0x1.123edap-7f, 0x1.6ac862p-10f};
// (log(1+f) - f + f^2/2) / f^3, 1+f in [sqrt(1/2), sqrt(2)]; error 2^-28.4 of the function
constexpr float kLog[] = {0x1.555548p-2f,  -0x1.000016p-2f, 0x1.99a45cp-3f,  -0x1.55579ep-3f, 0x1.233ebp-3f,
                          -0x1.fce2d6p-4f, 0x1.e74dbep-4f,  -0x1.d9229ap-4f, 0x1.0c8012p-4f};
// 2/ln2 (atanh(q) - q) / q^3, of q^2; error 2^-36.4 of the function
constexpr float kLogAtanh[] = {0x1.ec709ep-1f, 0x1.2776ep-1f, 0x1.a5d04p-2f, 0x1.58915cp-2f};
// (sin r - r) / r^3, of r^2, |r| <= pi/4; error 2^-27.8 of the function
constexpr float kSin[] = {-0x1.555544p-3f, 0x1.1106c6p-7f, -0x1.991c28p-13f};
// (cos r - 1 + r^2/2) / r^4, of r^2; error 2^-32.9 of the function
constexpr float kCos[] = {0x1.55554ap-5f, -0x1.6c0c1ep-10f, 0x1.99e336p-16f};
// (asin x - x) / x^3, of x^2, x <= 1/2; error 2^-27.6 of the function
constexpr float kAsin[] = {0x1.5555c8p-3f, 0x1.330204p-4f, 0x1.747bbap-5f, 0x1.8c3e28p-6f, 0x1.595c96p-5f};
// (atan x - x) / x^3, of x^2, x <= tan(pi/8); error 2^-30.4 of the function
constexpr float kAtan[] = {-0x1.55554ap-2f, 0x1.9991ep-3f, -0x1.23b966p-3f, 0x1.b21ff8p-4f, -0x1.f2cc0ap-5f};
// (sinh x - x) / x^3, of x^2, x <= 1; error 2^-31.6 of the function
constexpr float kSinh[] = {0x1.555556p-3f, 0x1.1110ep-7f, 0x1.a022bcp-13f, 0x1.756c14p-19f};
// (tanh x - x) / x^3, of x^2, x <= 5/8; error 2^-27.7 of the function
constexpr float kTanh[] = {-0x1.555532p-2f, 0x1.1106f6p-3f, -0x1.b835a4p-5f, 0x1.51f8cep-6f, -0x1.750ce6p-8f};
// (asinh x - x) / x^3, of x^2, x <= 1/2; error 2^-29.6 of the function
constexpr float kAsinh[] = {-0x1.555536p-3f, 0x1.3324f2p-4f, -0x1.6b95bep-5f, 0x1.cd622ep-6f,
                            -0x1.b1424ap-7f};
// acosh(1+t) / sqrt(2t), t <= 1/2; error 2^-29.6 of the function
constexpr float kAcosh[] = {0x1.0p+0f,       -0x1.555536p-4f, 0x1.3324f2p-6f,
                            -0x1.6b95bep-8f, 0x1.cd622ep-10f, -0x1.b1424ap-12f};
// (atanh x - x) / x^3, of x^2, x <= 1/2; error 2^-29.4 of the function
constexpr float kAtanh[] = {0x1.55554p-2f,  0x1.99a676p-3f, 0x1.234d98p-3f,
                            0x1.e40008p-4f, 0x1.a6bbc6p-5f, 0x1.693a1cp-3f};

class F32Math {
 public:
  explicit F32Math(Builder& b) : b_(b) {}

  Value exp2(Value x) {
    const Value clamped = clamp(x, -152.f, 129.f);
    const Value n = roundEven(clamped), r = b_.fsub(clamped, n);
    return keepNan(x, scale(b_.fma(r, polynomial(kExp2, r), c(1)), n));
  }

  // e^x * 2^shift, for functions whose own result overflows later than e^x does.
  Value exp(Value x, float shift = 0) {
    const Value clamped = clamp(x, -106.f, 90.f);
    const Value n = roundEven(b_.fmul(clamped, c(kLog2E))), minusN = b_.fneg(n);
    Value r = b_.fma(minusN, c(kLn2), clamped);
    r = b_.fma(minusN, c(kLn2Low), r);
    const Value p = b_.fma(b_.fmul(r, r), polynomial(kExp, r), r);
    return keepNan(x, scale(b_.fadd(p, c(1)), shift == 0 ? n : b_.fadd(n, c(shift))));
  }

  Value log2(Value x) {
    const Split s = split(x);
    const Value l = log1p(s.fraction);
    return logSpecials(x, b_.fma(l, c(kLog2E), b_.fma(l, c(kLog2ELow), s.exponent)));
  }

  Value log(Value x) {
    const Split s = split(x);
    const Value l = log1p(s.fraction);
    return logSpecials(x, b_.fma(s.exponent, c(kLn2), b_.fma(s.exponent, c(kLn2Low), l)));
  }

  // exp2(y * log2(x)) with the logarithm and the product in two floats each, since the product's absolute
  // error becomes the result's relative error.
  Value pow(Value x, Value y) {
    const Split s = split(x);
    const Value f = s.fraction;
    // log2(1 + f) = 2/ln2 * atanh(f / (2 + f)), the quotient in two floats
    const Value d = b_.fadd(c(2), f), dLow = b_.fsub(f, b_.fsub(d, c(2)));
    const Value reciprocal = b_.fdiv(c(1), d);
    const Value q = b_.fmul(f, reciprocal), minusQ = b_.fneg(q);
    const Value qLow = b_.fmul(b_.fma(minusQ, dLow, b_.fma(minusQ, d, f)), reciprocal);
    const Value z = b_.fmul(q, q);
    const Value t = b_.fmul(q, c(kTwoLog2E));
    Value tLow = b_.fma(q, c(kTwoLog2E), b_.fneg(t));
    tLow = b_.fma(q, c(kTwoLog2ELow), b_.fma(qLow, c(kTwoLog2E), tLow));
    tLow = b_.fma(b_.fmul(z, q), polynomial(kLogAtanh, z), tLow);
    const Value sum = b_.fadd(s.exponent, t);
    const Value sumLow = b_.fadd(b_.fadd(b_.fsub(s.exponent, sum), t), tLow);
    Value l = b_.fadd(sum, sumLow);
    const Value lLow = b_.fsub(sumLow, b_.fsub(l, sum));
    l = logSpecials(x, l);

    const Value product = b_.fmul(y, l);
    const Value productLow = b_.fma(y, lLow, b_.fma(y, l, b_.fneg(product)));
    const Value clamped = clamp(product, -160.f, 140.f);
    const Value n = roundEven(clamped);
    const Value low = b_.select(b_.feq(clamped, product), productLow, c(0));
    const Value r = b_.fadd(b_.fsub(clamped, n), low);
    const Value result = keepNan(product, scale(b_.fma(r, polynomial(kExp2, r), c(1)), n));
    // x^0 = 1 also for x = 0 and infinity, where the product above is NaN.
    return b_.select(b_.maskAnd(b_.feq(y, c(0)), b_.fle(c(0), x)), c(1), result);
  }

  Value sin(Value x) {
    const Reduced r = reduce(x);
    return negateIf(isSet(r.quadrant, 2), b_.select(isSet(r.quadrant, 1), r.cosine, r.sine));
  }
  Value cos(Value x) {
    const Reduced r = reduce(x);
    const Value quadrant = b_.iadd(r.quadrant, b_.i32(1));
    return negateIf(isSet(quadrant, 2), b_.select(isSet(r.quadrant, 1), r.sine, r.cosine));
  }
  Value tan(Value x) {
    const Reduced r = reduce(x);
    const Value odd = isSet(r.quadrant, 1);
    const Value numerator = b_.select(odd, r.cosine, r.sine),
                denominator = b_.select(odd, b_.fneg(r.sine), r.cosine);
    return b_.fdiv(numerator, denominator);
  }

  Value asin(Value x) {
    const Value a = b_.fabs(x), large = b_.flt(c(0.5f), a);
    const Value p = asinCore(a, large);
    // pi/2 - 2 asin(sqrt((1 - a) / 2))
    return copySign(b_.select(large, b_.fadd(b_.fma(c(-2), p, c(kHalfPiLow)), c(kHalfPi)), p), x);
  }
  Value acos(Value x) {
    const Value a = b_.fabs(x), large = b_.flt(c(0.5f), a), negative = b_.flt(x, c(0));
    const Value p = asinCore(a, large), twice = b_.fadd(p, p);
    const Value far = b_.select(negative, b_.fadd(b_.fsub(c(2 * kHalfPiLow), twice), c(kPi)), twice);
    const Value near = b_.fadd(c(kHalfPi), b_.fsub(c(kHalfPiLow), copySign(p, x)));
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
    const Value factor = b_.select(b_.flt(c(0x1p125f), high), c(0.25f), c(1));
    Value r = atanQuotient(b_.fmul(low, factor), b_.fmul(high, factor));
    r = b_.select(b_.flt(ax, ay), fromHalfPi(r), r);
    const Value negative = b_.compare(Op::SLt, b_.bitcast(Type::I32, x), b_.i32(0));
    r = copySign(b_.select(negative, b_.fadd(c(kPi), b_.fsub(c(2 * kHalfPiLow), r)), r), y);
    const Value ordered = b_.maskAnd(b_.feq(x, x), b_.feq(y, y));
    return b_.select(ordered, r, c(std::numeric_limits<float>::quiet_NaN()));
  }

  Value sinh(Value x) {
    const Value a = b_.fabs(x), half = exp(a, -1);
    const Value large = b_.fsub(half, b_.fdiv(c(0.25f), half));
    return copySign(b_.select(b_.flt(a, c(1)), odd(kSinh, a), large), x);
  }
  Value cosh(Value x) {
    const Value half = exp(b_.fabs(x), -1);
    return b_.fadd(half, b_.fdiv(c(0.25f), half));
  }
  Value tanh(Value x) {
    const Value a = b_.fabs(x), e = exp(b_.fadd(a, a));
    const Value large = b_.fsub(c(1), b_.fdiv(c(2), b_.fadd(e, c(1))));
    return copySign(b_.select(b_.flt(a, c(0.625f)), odd(kTanh, a), large), x);
  }
  Value asinh(Value x) {
    const Value a = b_.fabs(x);
    const Value root = b_.fsqrt(b_.fma(a, a, c(1)));
    return copySign(b_.select(b_.flt(a, c(0.5f)), odd(kAsinh, a), logOfSum(a, root)), x);
  }
  Value acosh(Value x) {
    const Value t = b_.fsub(x, c(1));
    const Value near = b_.fmul(b_.fsqrt(b_.fadd(t, t)), polynomial(kAcosh, t));
    return b_.select(b_.flt(t, c(0.5f)), near, logOfSum(x, b_.fsqrt(b_.fma(x, x, c(-1)))));
  }
  Value atanh(Value x) {
    const Value a = b_.fabs(x);
    const Value large = b_.fmul(c(0.5f), log(b_.fdiv(b_.fadd(c(1), a), b_.fsub(c(1), a))));
    return copySign(b_.select(b_.flt(a, c(0.5f)), odd(kAtanh, a), large), x);
  }

 private:
  struct Split {
    Value exponent, fraction;
  };
  struct Reduced {
    Value quadrant, sine, cosine;
  };

  Value c(float x) { return b_.f32(x); }
  Value roundEven(Value x) { return b_.unary(Op::FRoundEven, x); }
  Value clamp(Value x, float low, float high) { return b_.fmin(b_.fmax(x, c(low)), c(high)); }
  Value keepNan(Value x, Value result) {
    return b_.select(b_.feq(x, x), result, c(std::numeric_limits<float>::quiet_NaN()));
  }

  template <size_t N>
  Value polynomial(const float (&k)[N], Value x) {
    Value p = c(k[N - 1]);
    for (size_t i = N - 1; i-- > 0;) p = b_.fma(p, x, c(k[i]));
    return p;
  }
  // x + x^3 p(x^2)
  template <size_t N>
  Value odd(const float (&k)[N], Value x) {
    const Value z = b_.fmul(x, x);
    return b_.fma(b_.fmul(x, z), polynomial(k, z), x);
  }

  Value sign(Value x) { return b_.and_(b_.bitcast(Type::I32, x), b_.i32(0x80000000)); }
  Value flipSign(Value x, Value sign) {
    return b_.bitcast(Type::F32, b_.xor_(b_.bitcast(Type::I32, x), sign));
  }
  // a, which is not negative, with the sign of x; a NaN stays canonical in all but its sign.
  Value copySign(Value a, Value x) { return flipSign(a, sign(x)); }
  Value isSet(Value bits, uint32_t bit) { return b_.ine(b_.and_(bits, b_.i32(bit)), b_.i32(0)); }
  Value negateIf(Value m, Value x) { return b_.select(m, b_.fneg(x), x); }

  // p * 2^n for whole n in [-252, 254], in two steps so that denormal results round once.
  Value scale(Value p, Value n) {
    const Value whole = b_.convert(Op::FToS, Type::I32, n), half = b_.ashr(whole, b_.i32(1));
    return b_.fmul(b_.fmul(p, powerOfTwo(half)), powerOfTwo(b_.isub(whole, half)));
  }
  Value powerOfTwo(Value n) { return b_.bitcast(Type::F32, b_.shl(b_.iadd(n, b_.i32(127)), b_.i32(23))); }

  // x = 2^exponent * (1 + fraction), 1 + fraction in [sqrt(1/2), sqrt(2)), for positive finite x.
  Split split(Value x) {
    const Value tiny = b_.flt(x, c(0x1p-126f));
    const Value bits = b_.bitcast(Type::I32, b_.select(tiny, b_.fmul(x, c(0x1p23f)), x));
    const Value n = b_.ashr(b_.isub(bits, b_.i32(0x3f3504f3)), b_.i32(23));
    const Value m = b_.bitcast(Type::F32, b_.isub(bits, b_.shl(n, b_.i32(23))));
    const Value exponent =
        b_.convert(Op::SToF, Type::F32, b_.select(tiny, b_.iadd(n, b_.i32(uint32_t(-23))), n));
    return {exponent, b_.fsub(m, c(1))};
  }
  Value log1p(Value f) {
    const Value z = b_.fmul(f, f);
    return b_.fadd(f, b_.fma(b_.fmul(z, f), polynomial(kLog, f), b_.fmul(z, c(-0.5f))));
  }
  Value logSpecials(Value x, Value result) {
    const Value ordinary = b_.maskAnd(b_.flt(c(0), x), b_.flt(x, c(kInf)));
    const Value positive = b_.select(b_.feq(x, c(kInf)), c(kInf), c(std::numeric_limits<float>::quiet_NaN()));
    return b_.select(ordinary, result, b_.select(b_.feq(x, c(0)), c(-kInf), positive));
  }
  // log(a + root); where the squares overflow, root is about a.
  Value logOfSum(Value a, Value root) {
    const Value big = b_.flt(c(0x1p14f), a);
    return b_.fadd(log(b_.select(big, a, b_.fadd(a, root))), b_.select(big, c(kLn2), c(0)));
  }

  // x = quadrant * pi/2 + r, |r| <= pi/4 (a little more for large x). Up to 2^22 the first product's
  // remainder is exact; beyond that no bit of f32's angle means much any more, and the angle counts as 0
  // (infinities give NaN).
  Reduced reduce(Value x) {
    const Value usable = b_.fle(b_.fabs(x), c(0x1p22f));
    x = b_.select(usable, x, b_.fmul(x, c(0)));
    const Value n = roundEven(b_.fmul(x, c(kTwoOverPi))), minusN = b_.fneg(n);
    Value r = b_.fma(minusN, c(kHalfPi), x);
    r = b_.fma(minusN, c(kHalfPiLow), r);
    r = b_.fma(minusN, c(kHalfPiLowest), r);
    const Value z = b_.fmul(r, r);
    const Value cosine = b_.fma(b_.fmul(z, z), polynomial(kCos, z), b_.fma(z, c(-0.5f), c(1)));
    return {b_.convert(Op::FToS, Type::I32, n), odd(kSin, r), cosine};
  }

  // asin(a), or asin(sqrt((1 - a) / 2)) where `large`; NaN beyond 1.
  Value asinCore(Value a, Value large) {
    const Value z = b_.select(large, b_.fma(a, c(-0.5f), c(0.5f)), b_.fmul(a, a));
    const Value s = b_.select(large, b_.fsqrt(z), a);
    return b_.fma(b_.fmul(s, z), polynomial(kAsin, z), s);
  }
  // atan(low / high), 0 <= low <= high, in one division: beyond tan(pi/8) it is pi/4 + atan((l - h) / (l +
  // h)).
  Value atanQuotient(Value low, Value high) {
    const Value upper = b_.flt(b_.fmul(high, c(0x1.a8279ap-2f)), low);
    const Value numerator = b_.select(upper, b_.fsub(low, high), low);
    const Value denominator = b_.select(upper, b_.fadd(low, high), high);
    const Value p = odd(kAtan, b_.fdiv(numerator, denominator));
    return b_.select(upper, b_.fadd(p, c(kQuarterPi)), p);
  }
  Value fromHalfPi(Value r) { return b_.fadd(c(kHalfPi), b_.fsub(c(kHalfPiLow), r)); }

  Builder& b_;
};

}  // namespace

Value lowerF32(Builder& b, Op op, std::span<const Value> v) {
  F32Math m(b);
  switch (op) {
    case Op::FExp2:
      return m.exp2(v[0]);
    case Op::FLog2:
      return m.log2(v[0]);
    case Op::FExp:
      return m.exp(v[0]);
    case Op::FLog:
      return m.log(v[0]);
    case Op::FPow:
      return m.pow(v[0], v[1]);
    case Op::FSin:
      return m.sin(v[0]);
    case Op::FCos:
      return m.cos(v[0]);
    case Op::FTan:
      return m.tan(v[0]);
    case Op::FAsin:
      return m.asin(v[0]);
    case Op::FAcos:
      return m.acos(v[0]);
    case Op::FAtan:
      return m.atan(v[0]);
    case Op::FAtan2:
      return m.atan2(v[0], v[1]);
    case Op::FSinh:
      return m.sinh(v[0]);
    case Op::FCosh:
      return m.cosh(v[0]);
    case Op::FTanh:
      return m.tanh(v[0]);
    case Op::FAsinh:
      return m.asinh(v[0]);
    case Op::FAcosh:
      return m.acosh(v[0]);
    case Op::FAtanh:
      return m.atanh(v[0]);
    default:
      return 0;
  }
}

}  // namespace pumice::ir
