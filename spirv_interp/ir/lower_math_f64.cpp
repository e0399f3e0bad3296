// The coefficients come from bench/ulp/fit.py. Errors of about one unit in the last place: sums are arranged
// so that only the last addition rounds at the result's size.
#include "spirv_interp/ir/lower_math_common.h"

namespace pumice::ir {

namespace {

struct F64Numbers {
  using Float = double;
  static constexpr Type kFloat = Type::F64, kInt = Type::I64;
  static constexpr unsigned kMantissa = 52, kBias = 1023;
  static constexpr uint64_t kSqrtHalfBits = 0x3fe6a09e667f3bcd;
  static constexpr double kExp2Lowest = -1080, kExp2Highest = 1025, kExpLowest = -748, kExpHighest = 711;
  static constexpr double kPowLowest = -1100, kPowHighest = 1040;
  static constexpr double kRootIsArgument = 0x1p28;
  static constexpr double kNearAngle = 0x1p30;

  static constexpr double kHalfPi = 0x1.921fb54442d18p+0, kHalfPiLow = 0x1.1a62633145c07p-54,
                          kHalfPiLowest = -0x1.f1976b7ed8fbcp-110;
  static constexpr double kTwoOverPi = 0x1.45f306dc9c883p-1;
  static constexpr double kLn2 = 0x1.62e42fefa39efp-1, kLn2Low = 0x1.abc9e3b39803fp-56;
  static constexpr double kTwoLog2E = 0x1.71547652b82fep+1, kTwoLog2ELow = 0x1.777d0ffda0d24p-55;
  static constexpr double kLog2E = 0x1.71547652b82fep+0, kLog2ELow = 0x1.777d0ffda0d24p-56;

  // (2^r - 1) / r, |r| <= 1/2; error 2^-55.5 of the function
  static constexpr double kExp2[] = {0x1.62e42fefa39efp-1,  0x1.ebfbdff82c58fp-3,  0x1.c6b08d704a0c6p-5,
                                     0x1.3b2ab6fba4e79p-7,  0x1.5d87fe78a3f9cp-10, 0x1.430912f86b7dbp-13,
                                     0x1.ffcbfc6da6ed1p-17, 0x1.62c02242b879cp-20, 0x1.b524ebd13a55fp-24,
                                     0x1.e4cf10dec0f59p-28, 0x1.e9ec1fcb69a7fp-32, 0x1.c4a29324a1038p-36};
  // (e^r - 1 - r) / r^2, |r| <= ln2 / 2; error 2^-55.8 of the function
  static constexpr double kExp[] = {0x1.0000000000001p-1,  0x1.5555555555556p-3,  0x1.5555555553d64p-5,
                                    0x1.11111111109b4p-7,  0x1.6c16c1788b646p-10, 0x1.a01a01a7c3d59p-13,
                                    0x1.a019b90eefe8ep-16, 0x1.71de0daf7a6ccp-19, 0x1.2891834686c7ep-22,
                                    0x1.af38a71a18cb9p-26};
  // 2 (atanh(s) - s) / s^3, of s^2, |s| <= (sqrt(2) - 1)^2; error 2^-60.7 of the function
  static constexpr double kLog[] = {0x1.5555555555555p-1, 0x1.9999999999a38p-2, 0x1.2492492476c8bp-2,
                                    0x1.c71c720160332p-3, 0x1.745cf90196560p-3, 0x1.3b1c35fbecd93p-3,
                                    0x1.0fbe84f5caccap-3, 0x1.0c044ccf380aap-3};
  // 2/ln2 ((atanh(q) - q) / q^3 - 1/3) / q^2, of q^2; error 2^-65.8 of the function
  static constexpr double kLogAtanh[] = {0x1.2776c50ef9bfep-1, 0x1.a61762a7adfa8p-2, 0x1.484b13d79c3bcp-2,
                                         0x1.0c9a84bf502d5p-2, 0x1.c68f2f021b956p-3, 0x1.89fed26ce8ca2p-3,
                                         0x1.59e089a31e6d8p-3, 0x1.5a609dead895ep-3};
  static constexpr double kLogAtanhFirst = 0x1.ec709dc3a03fdp-1,
                          kLogAtanhFirstLow = 0x1.d27f05548af0cp-55;  // 2/(3 ln2)
  // (sin r - r) / r^3, of r^2, |r| <= pi/4; error 2^-57.1 of the function
  static constexpr double kSin[] = {-0x1.5555555555555p-3, 0x1.1111111111110p-7,   -0x1.a01a01a01990ap-13,
                                    0x1.71de3a545b148p-19, -0x1.ae6454093c147p-26, 0x1.61217781a8ccdp-33,
                                    -0x1.ab13654fd392ap-41};
  // (cos r - 1 + r^2/2) / r^4, of r^2; error 2^-59.5 of the function
  static constexpr double kCos[] = {0x1.5555555555555p-5,   -0x1.6c16c16c16c16p-10, 0x1.a01a01a019cf6p-16,
                                    -0x1.27e4fb7710638p-22, 0x1.1eed8de759d0dp-29,  -0x1.9394b3581cec8p-37,
                                    0x1.ab746999271a1p-45};
  // (asin x - x) / x^3, of x^2, x <= 1/2; error 2^-57.4 of the function
  static constexpr double kAsin[] = {0x1.5555555555556p-3, 0x1.3333333332ecap-4, 0x1.6db6db6e31f13p-5,
                                     0x1.f1c71c1db0623p-6, 0x1.6e8bb1c8209a2p-6, 0x1.1c4d35cf95421p-6,
                                     0x1.c9cf07674736ap-7, 0x1.782651caa6547p-7, 0x1.52420b04b37bep-7,
                                     0x1.65a9c4dfcf8b2p-8, 0x1.1d189408314eep-6, -0x1.e6aaa8a0a04ccp-7,
                                     0x1.d72b2bc8155f8p-6};
  // (atan x - x) / x^3, of x^2, x <= tan(pi/8); error 2^-58.1 of the function
  static constexpr double kAtan[] = {-0x1.5555555555555p-2, 0x1.9999999999953p-3,  -0x1.249249248d7d1p-3,
                                     0x1.c71c71c3035c8p-4,  -0x1.745d165db0b8dp-4, 0x1.3b1392d24f335p-4,
                                     -0x1.110e878213482p-4, 0x1.e19a07798598ep-5,  -0x1.ac7a3950dffbap-5,
                                     0x1.74dc387c1a6f4p-5,  -0x1.1b2f96cc7eca8p-5, 0x1.0aca40aeebce0p-6};
  // (sinh x - x) / x^3, of x^2, x <= 1; error 2^-56.8 of the function
  static constexpr double kSinh[] = {0x1.5555555555555p-3,  0x1.1111111111111p-7,  0x1.a01a01a01a001p-13,
                                     0x1.71de3a556f96cp-19, 0x1.ae6456792a77fp-26, 0x1.612467ccb2260p-33,
                                     0x1.ae777c36fd5b6p-41, 0x1.99f0806c2628dp-49};
  // (tanh x - x) / x^3, of x^2, x <= 5/8; error 2^-56.7 of the function
  static constexpr double kTanh[] = {-0x1.5555555555555p-2,  0x1.11111111110a8p-3,   -0x1.ba1ba1ba0f0cbp-5,
                                     0x1.664f487e08907p-6,   -0x1.226e34738a3aap-7,  0x1.d6d39ad329565p-9,
                                     -0x1.7d9f6e2122829p-10, 0x1.3526dfb7d51b5p-11,  -0x1.f242fe2566072p-13,
                                     0x1.844375ceb8cc4p-14,  -0x1.05b72f52995cap-15, 0x1.b324134ba5eb6p-18};
  // (asinh x - x) / x^3, of x^2, x <= 1/2; error 2^-58.3 of the function
  static constexpr double kAsinh[] = {-0x1.5555555555555p-3, 0x1.33333333332fap-4,  -0x1.6db6db6db086ep-5,
                                      0x1.f1c71c6d66156p-6,  -0x1.6e8ba21ea4fe4p-6, 0x1.1c4eaf29403b6p-6,
                                      -0x1.c9969396f4545p-7, 0x1.7a633fba31150p-7,  -0x1.3eb1386278c61p-7,
                                      0x1.0c1eacb8f71b5p-7,  -0x1.a851c6e415a26p-8, 0x1.0f3620d560e0dp-8,
                                      -0x1.88e92bd4ca98ep-10};
  // acosh(1+t) / sqrt(2t), t <= 1/2; error 2^-58.2 of the function
  static constexpr double kAcosh[] = {0x1.0000000000000p+0,   -0x1.5555555555553p-4,  0x1.3333333332f5cp-6,
                                      -0x1.6db6db6d8573dp-8,  0x1.f1c71c5cfd48ep-10,  -0x1.6e8ba047f04bfp-11,
                                      0x1.1c4e8d9a714c3p-12,  -0x1.c9936472b3ea4p-14, 0x1.7a48ed27d1fd7p-15,
                                      -0x1.3e1c82b1b8185p-16, 0x1.09e99d995dcafp-17,  -0x1.9d8838d087989p-19,
                                      0x1.ffccfd0cbc6e4p-21,  -0x1.628a1ae57eadap-23};
  // (atanh x - x) / x^3, of x^2, x <= 1/2; error 2^-57.6 of the function
  static constexpr double kAtanh[] = {0x1.5555555555555p-2,  0x1.9999999999ad1p-3, 0x1.249249247e911p-3,
                                      0x1.c71c71d6cc5d1p-4,  0x1.745d1406b992ep-4, 0x1.3b1417e6e07dfp-4,
                                      0x1.1108e26d64a6dp-4,  0x1.e2c342108eb1fp-5, 0x1.a6c53053bf30cp-5,
                                      0x1.bdcd3cefa72cep-5,  0x1.92cc88a36f708p-7, 0x1.15aa7698edf42p-3,
                                      -0x1.27f230f3831a3p-3, 0x1.b016cba23eee4p-3};
};

class F64Math : public MathOf<F64Math, F64Numbers> {
 public:
  using N = F64Numbers;
  using MathOf::MathOf;

  // 2/ln2 (atanh(q) - q), in two doubles: its first term, and the rest added to `low`.
  Pair logAtanhTail(Value q, Value qLow, Value z, Value low) {
    const Value zLow = b_.fma(b_.fadd(q, q), qLow, b_.fma(q, q, b_.fneg(z)));
    const Value cube = b_.fmul(z, q);
    const Value cubeLow = b_.fma(z, qLow, b_.fma(zLow, q, b_.fma(z, q, b_.fneg(cube))));
    const Value first = c(N::kLogAtanhFirst), high = b_.fmul(cube, first);
    low = b_.fadd(low, b_.fma(cube, c(N::kLogAtanhFirstLow),
                              b_.fma(cubeLow, first, b_.fma(cube, first, b_.fneg(high)))));
    return {high, b_.fma(b_.fmul(cube, z), polynomial(N::kLogAtanh, z), low)};
  }

  // log(1 + f) - f, from log(1 + f) = 2 atanh(s), s = f / (2 + f) (as in FreeBSD's e_log.c)
  Value logTail(Value f) {
    const Value s = b_.fdiv(f, b_.fadd(c(2), f)), z = b_.fmul(s, s);
    const Value halfSquare = b_.fmul(b_.fmul(f, f), c(0.5));
    return b_.fsub(b_.fmul(s, b_.fma(z, polynomial(N::kLog, z), halfSquare)), halfSquare);
  }

  // pi/2 in three doubles: the first product's remainder is exact, the second product is kept in two doubles.
  ReducedAngle nearAngle(Value x) {
    const Value n = roundEven(b_.fmul(x, c(N::kTwoOverPi))), minusN = b_.fneg(n);
    const Value first = b_.fma(minusN, c(N::kHalfPi), x);
    const Value second = b_.fmul(minusN, c(N::kHalfPiLow)),
                secondLow = b_.fma(minusN, c(N::kHalfPiLow), b_.fneg(second));
    const Value sum = b_.fadd(first, second), part = b_.fsub(sum, first);
    const Value lost = b_.fadd(b_.fsub(first, b_.fsub(sum, part)), b_.fsub(second, part));
    const Value low = b_.fma(minusN, c(N::kHalfPiLowest), b_.fadd(lost, secondLow));
    const Value high = b_.fadd(sum, low);
    return {b_.convert(Op::FToS, Type::I32, n), high, b_.fadd(b_.fsub(sum, high), low)};
  }

  // x = m * 2^(e - 1075), m of 53 bits. Of 2/pi only the 192 bits count whose product is below 4 and not
  // negligible: the product's upper 128 bits are quadrant (2) and fraction (126, of which at most 62 cancel).
  ReducedAngle farAngle(Value x) {
    const Value bits = b_.bitcast(Type::I64, x), half = b_.i64(32), low32 = b_.i64(0xffffffff);
    const Value e = b_.and_(b_.convert(Op::Trunc, Type::I32, b_.lshr(bits, b_.i64(52))), b_.i32(2047));
    const Value m = b_.or_(b_.and_(bits, b_.i64((uint64_t(1) << 52) - 1)), b_.i64(uint64_t(1) << 52));
    const Value m0 = b_.and_(m, low32), m1 = b_.lshr(m, half);
    const auto w = twoOverPi<6>(b_.isub(e, b_.i32(1045)), 5);
    // Columns of 32 bits, the least significant one last; each sum stays below 2^64. What is left out carries
    // at most 3 into the last one.
    Value column[4];
    for (size_t k = 0; k < 4; ++k) {
      column[k] = b_.iadd(b_.and_(b_.imul(m0, w[k]), low32), b_.lshr(b_.imul(m0, w[k + 1]), half));
      column[k] = b_.iadd(column[k], b_.and_(b_.imul(m1, w[k + 1]), low32));
      column[k] = b_.iadd(column[k], b_.lshr(b_.imul(m1, w[k + 2]), half));
    }
    for (size_t k = 3; k > 0; --k) column[k - 1] = b_.iadd(column[k - 1], b_.lshr(column[k], half));
    Value top = b_.or_(b_.shl(column[0], half), b_.and_(column[1], low32));
    Value bottom = b_.or_(b_.shl(column[2], half), b_.and_(column[3], low32));
    const Value negative = b_.slt(bits, b_.i64(0)),
                flip = b_.select(negative, b_.i64(~uint64_t(0)), b_.i64(0));
    top = b_.xor_(top, flip);  // not of all bits: minus, but for 2^-126
    bottom = b_.xor_(bottom, flip);

    const Value quadrant = b_.lshr(b_.iadd(top, b_.i64(uint64_t(1) << 61)), b_.i64(62));
    const Value fraction = b_.or_(b_.shl(top, b_.i64(2)), b_.lshr(bottom, b_.i64(62)));
    const Value rest = b_.shl(bottom, b_.i64(2));
    auto part = [&](Value bits32, double weight) {
      return b_.fmul(b_.convert(Op::SToF, Type::F64, bits32), b_.f64(weight));
    };
    const Value a = part(b_.ashr(fraction, half), 0x1p-32), second = part(b_.and_(fraction, low32), 0x1p-64);
    const Value third = part(b_.lshr(rest, half), 0x1p-96), fourth = part(b_.and_(rest, low32), 0x1p-128);
    Value high = b_.fadd(a, second), low = b_.fadd(b_.fsub(second, b_.fsub(high, a)), b_.fadd(third, fourth));
    const Value sum = b_.fadd(high, low);
    low = b_.fadd(b_.fsub(high, sum), low);
    high = sum;
    const Value r = b_.fmul(high, c(N::kHalfPi));
    const Value product = b_.fma(high, c(N::kHalfPi), b_.fneg(r));
    const Value rLow = b_.fma(low, c(N::kHalfPi), b_.fma(high, c(N::kHalfPiLow), product));
    const Value result = b_.fadd(r, rLow);
    return {b_.convert(Op::Trunc, Type::I32, quadrant), result, b_.fadd(b_.fsub(r, result), rLow)};
  }
};

}  // namespace

Value lowerF64(Builder& b, Op op, std::span<const Value> v, bool uniform, AngleCache& cache) {
  return F64Math(b, uniform, cache).lower(op, v);
}

}  // namespace pumice::ir
