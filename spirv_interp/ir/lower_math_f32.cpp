// Minimax polynomials (Remez exchange, weighted for relative error, coefficients rounded to f32 one after the
// other, each followed by a new fit of the rest).
#include "spirv_interp/ir/lower_math_common.h"

namespace pumice::ir {

namespace {

struct F32Numbers {
  using Float = float;
  static constexpr Type kFloat = Type::F32, kInt = Type::I32;
  static constexpr unsigned kMantissa = 23, kBias = 127;
  static constexpr uint64_t kSqrtHalfBits = 0x3f3504f3;
  static constexpr float kExp2Lowest = -152, kExp2Highest = 129, kExpLowest = -106, kExpHighest = 90;
  static constexpr float kPowLowest = -160, kPowHighest = 140;
  static constexpr float kRootIsArgument = 0x1p14f;
  static constexpr float kNearAngle = 0x1p19f;

  static constexpr float kHalfPi = 0x1.921fb6p+0f, kHalfPiLow = -0x1.777a5cp-25f,
                         kHalfPiLowest = -0x1.ee59dap-50f;
  static constexpr float kTwoOverPi = 0x1.45f306p-1f;
  static constexpr float kLn2 = 0x1.62e430p-1f, kLn2Low = -0x1.05c610p-29f;
  static constexpr float kTwoLog2E = 0x1.715476p+1f, kTwoLog2ELow = 0x1.4ae0c0p-25f;
  static constexpr float kLog2E = 0x1.715476p+0f, kLog2ELow = 0x1.4ae0c0p-26f;

  // (2^r - 1) / r, |r| <= 1/2; error 2^-27.5 of the function
  static constexpr float kExp2[] = {0x1.62e432p-1f, 0x1.ebfbe6p-3f,  0x1.c6ada6p-5f,
                                    0x1.3b21c6p-7f, 0x1.5fc016p-10f, 0x1.4bc6e8p-13f};
  // (e^r - 1 - r) / r^2, |r| <= ln2 / 2; error 2^-28.2 of the function
  static constexpr float kExp[] = {0x1.fffffcp-2f, 0x1.55548ap-3f, 0x1.55584ep-5f, 0x1.123edap-7f,
                                   0x1.6ac862p-10f};
  // (log(1+f) - f + f^2/2) / f^3, 1+f in [sqrt(1/2), sqrt(2)]; error 2^-28.4 of the function
  static constexpr float kLog[] = {0x1.555548p-2f,  -0x1.000016p-2f, 0x1.99a45cp-3f,
                                   -0x1.55579ep-3f, 0x1.233ebp-3f,   -0x1.fce2d6p-4f,
                                   0x1.e74dbep-4f,  -0x1.d9229ap-4f, 0x1.0c8012p-4f};
  // 2/ln2 (atanh(q) - q) / q^3, of q^2; error 2^-36.4 of the function
  static constexpr float kLogAtanh[] = {0x1.ec709ep-1f, 0x1.2776ep-1f, 0x1.a5d04p-2f, 0x1.58915cp-2f};
  // (sin r - r) / r^3, of r^2, |r| <= pi/4; error 2^-27.8 of the function
  static constexpr float kSin[] = {-0x1.555544p-3f, 0x1.1106c6p-7f, -0x1.991c28p-13f};
  // (cos r - 1 + r^2/2) / r^4, of r^2; error 2^-32.9 of the function
  static constexpr float kCos[] = {0x1.55554ap-5f, -0x1.6c0c1ep-10f, 0x1.99e336p-16f};
  // (asin x - x) / x^3, of x^2, x <= 1/2; error 2^-27.6 of the function
  static constexpr float kAsin[] = {0x1.5555c8p-3f, 0x1.330204p-4f, 0x1.747bbap-5f, 0x1.8c3e28p-6f,
                                    0x1.595c96p-5f};
  // (atan x - x) / x^3, of x^2, x <= tan(pi/8); error 2^-30.4 of the function
  static constexpr float kAtan[] = {-0x1.55554ap-2f, 0x1.9991ep-3f, -0x1.23b966p-3f, 0x1.b21ff8p-4f,
                                    -0x1.f2cc0ap-5f};
  // (sinh x - x) / x^3, of x^2, x <= 1; error 2^-31.6 of the function
  static constexpr float kSinh[] = {0x1.555556p-3f, 0x1.1110ep-7f, 0x1.a022bcp-13f, 0x1.756c14p-19f};
  // (tanh x - x) / x^3, of x^2, x <= 5/8; error 2^-27.7 of the function
  static constexpr float kTanh[] = {-0x1.555532p-2f, 0x1.1106f6p-3f, -0x1.b835a4p-5f, 0x1.51f8cep-6f,
                                    -0x1.750ce6p-8f};
  // (asinh x - x) / x^3, of x^2, x <= 1/2; error 2^-29.6 of the function
  static constexpr float kAsinh[] = {-0x1.555536p-3f, 0x1.3324f2p-4f, -0x1.6b95bep-5f, 0x1.cd622ep-6f,
                                     -0x1.b1424ap-7f};
  // acosh(1+t) / sqrt(2t), t <= 1/2; error 2^-29.6 of the function
  static constexpr float kAcosh[] = {0x1.0p+0f,       -0x1.555536p-4f, 0x1.3324f2p-6f,
                                     -0x1.6b95bep-8f, 0x1.cd622ep-10f, -0x1.b1424ap-12f};
  // (atanh x - x) / x^3, of x^2, x <= 1/2; error 2^-29.4 of the function
  static constexpr float kAtanh[] = {0x1.55554p-2f,  0x1.99a676p-3f, 0x1.234d98p-3f,
                                     0x1.e40008p-4f, 0x1.a6bbc6p-5f, 0x1.693a1cp-3f};
};

class F32Math : public MathOf<F32Math, F32Numbers> {
 public:
  using N = F32Numbers;
  using MathOf::MathOf;

  // log(1 + f) - f
  Value logTail(Value f) {
    const Value z = b_.fmul(f, f);
    return b_.fma(b_.fmul(z, f), polynomial(N::kLog, f), b_.fmul(z, c(-0.5f)));
  }

  // 2/ln2 (atanh(q) - q), added to `low`
  Pair logAtanhTail(Value q, Value, Value z, Value low) {
    return {0, b_.fma(b_.fmul(z, q), polynomial(N::kLogAtanh, z), low)};
  }

  // The first product's remainder is exact. Infinities give NaN.
  ReducedAngle nearAngle(Value x) {
    const Value n = roundEven(b_.fmul(x, c(N::kTwoOverPi))), minusN = b_.fneg(n);
    Value r = b_.fma(minusN, c(N::kHalfPi), x);
    r = b_.fma(minusN, c(N::kHalfPiLow), r);
    r = b_.fma(minusN, c(N::kHalfPiLowest), r);
    return {b_.convert(Op::FToS, Type::I32, n), r, 0};
  }

  // x = m * 2^(e - 150), m of 24 bits. Of 2/pi only the 96 bits count whose product is below 4 and not
  // negligible: the product's upper 64 bits are quadrant (2) and fraction (62, of which at most 31 cancel).
  ReducedAngle farAngle(Value x) {
    const Value bits = b_.bitcast(Type::I32, x), e = b_.and_(b_.lshr(bits, b_.i32(23)), b_.i32(255));
    const Value m = zeroExtend(b_.or_(b_.and_(bits, b_.i32(0x7fffff)), b_.i32(0x800000)));
    const auto w = twoOverPi<3>(b_.isub(e, b_.i32(120)), 3);
    const Value half = b_.i64(32);
    Value p =
        b_.iadd(b_.iadd(b_.shl(b_.imul(m, w[0]), half), b_.imul(m, w[1])), b_.lshr(b_.imul(m, w[2]), half));
    p = b_.select(b_.slt(bits, b_.i32(0)), b_.isub(b_.i64(0), p), p);
    const Value quadrant = b_.lshr(b_.iadd(p, b_.i64(uint64_t(1) << 61)), b_.i64(62));
    const Value fraction = b_.convert(Op::SToF, Type::F64, b_.shl(p, b_.i64(2)));
    const Value r = b_.fmul(fraction, b_.f64(0x1.921fb54442d18p-64));
    return {b_.convert(Op::Trunc, Type::I32, quadrant), b_.convert(Op::FToF, Type::F32, r), 0};
  }
};

}  // namespace

Value lowerF32(Builder& b, Op op, std::span<const Value> v, bool uniform, AngleCache& cache) {
  return F32Math(b, uniform, cache).lower(op, v);
}

}  // namespace pumice::ir
