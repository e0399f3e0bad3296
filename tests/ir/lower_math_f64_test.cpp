// The f64 lowerings, the oracle's and the reduction of huge angles against MPFR.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/passes.h"
#include "tests/ir/evaluate.h"
#include "tests/ir/mpfr_reference.h"

namespace pumice::ir {
namespace {

Function lowered(Op op, Type t, unsigned arguments, Numerics numerics = Numerics::F32, bool uniform = false) {
  Function f;
  Builder b(f);
  const Value in[] = {uniform ? b.uniform(t, 0) : b.input(t, 0), uniform ? b.uniform(t, 8) : b.input(t, 1)};
  b.output(0, b.emit(op, t, std::span<const Value>(in, arguments)));
  lowerMath(f, numerics);
  EXPECT_EQ(verify(f), "") << opInfo(op).text;
  return f;
}

std::vector<double> run(Op op, Type t, const std::vector<double>& x, const std::vector<double>& y = {}) {
  const Function f = lowered(op, t, y.empty() ? 1 : 2);
  std::vector<double> result(x.size());
  for (size_t first = 0; first < x.size(); first += 4096) {
    Evaluation e;
    e.lanes = std::min<size_t>(4096, x.size() - first);
    for (size_t k = 0; k < e.lanes; ++k) {
      e.inputs[0].push_back(floatBits(t, x[first + k]));
      if (!y.empty()) e.inputs[1].push_back(floatBits(t, y[first + k]));
    }
    evaluate(f, e);
    EXPECT_EQ(e.error, "");
    for (size_t k = 0; k < e.lanes; ++k) result[first + k] = floatValue(t, e.outputs[0][k]);
  }
  return result;
}
double one(Op op, double x) { return run(op, Type::F64, {x})[0]; }
double one(Op op, double x, double y) { return run(op, Type::F64, {x}, {y})[0]; }

double worst(Op op, Type t, const std::vector<double>& x, const std::vector<double>& y = {}) {
  const std::vector<double> got = run(op, t, x, y);
  Reference exact;
  double most = 0;
  size_t where = 0;
  for (size_t k = 0; k < x.size(); ++k) {
    exact.evaluate(op, x[k], y.empty() ? 0 : y[k]);
    if (const double u = exact.ulps(floatFormat(t), got[k]); !(u <= most)) most = u, where = k;
  }
  std::printf("    %-7s worst error %.3f ulp at %a %a\n", opInfo(op).text, most, x[where],
              y.empty() ? 0 : y[where]);
  return most;
}

std::vector<double> line(double from, double to, size_t count) {
  std::vector<double> x;
  for (size_t k = 0; k < count; ++k) x.push_back(from + (to - from) * (double(k) + 0.3) / double(count));
  return x;
}
std::vector<double> everywhere(size_t count, unsigned seed = 7) {
  std::mt19937_64 random(seed);
  std::vector<double> x{0.,
                        -0.,
                        1.,
                        -1.,
                        INFINITY,
                        -INFINITY,
                        NAN,
                        0x1p-1074,
                        -0x1p-1074,
                        0x1p-1022,
                        0x1.ffffffffffffep-1023,
                        0x1.fffffffffffffp1023,
                        -0x1.fffffffffffffp1023,
                        0.5,
                        -0.5,
                        2.,
                        std::nextafter(1., 0.),
                        std::nextafter(1., 2.),
                        709.782712893384,
                        709.7827128933841,
                        710.4758600739439,
                        710.475860073944,
                        -745.1332191019411,
                        -745.1332191019412,
                        1023.9999999999999,
                        1024.,
                        -1074.,
                        -1075.,
                        -1074.9999999999998};
  while (x.size() < count) x.push_back(std::bit_cast<double>(random()));
  return x;
}
// Angles of which much cancels: the doubles nearest to multiples of pi/2, up to the largest.
std::vector<double> nearMultiples() {
  std::vector<double> x{0x1.6ac5b262ca1ffp+849, 0x1.6ac5b262ca1ffp+850, 0x1.921fb54442d18p+0,
                        0x1.921fb54442d18p+1, 0x1.4c5f5bcd1d6bdp+10};
  mpfr_t p;
  mpfr_init2(p, 1300);
  std::mt19937_64 random(3);
  for (int e = 0; e < 1020; e += 3) {
    mpfr_const_pi(p, MPFR_RNDN);
    mpfr_mul_ui(p, p, (random() >> 20) | 1, MPFR_RNDN);
    mpfr_mul_2si(p, p, e > 980 ? 979 : e - 1, MPFR_RNDN);
    x.push_back(mpfr_get_d(p, MPFR_RNDN));
  }
  mpfr_clear(p);
  return x;
}

TEST(LowerMathF64, everyFunctionIsExactToTwoToTheMinus49) {
  constexpr Op kOps[] = {Op::FRsqrt, Op::FExp2, Op::FLog2,  Op::FExp,   Op::FLog,  Op::FSin,
                         Op::FCos,   Op::FTan,  Op::FAsin,  Op::FAcos,  Op::FAtan, Op::FSinh,
                         Op::FCosh,  Op::FTanh, Op::FAsinh, Op::FAcosh, Op::FAtanh};
  // The error of the unit in the last place is 2^-53 to 2^-52 of the value.
  for (Op op : kOps)
    for (const auto& x : {line(-1, 1, 3001), line(-7, 7, 2001), line(0.9, 1.1, 1001), line(-760, 760, 3001),
                          everywhere(3000)})
      EXPECT_LT(worst(op, Type::F64, x), 4.0) << opInfo(op).text;
}

TEST(LowerMathF64, hugeAngles) {
  for (Op op : {Op::FSin, Op::FCos, Op::FTan})
    for (const auto& x : {nearMultiples(), line(0x1p29, 0x1p31, 1001), line(-0x1p53, 0x1p53, 1001)})
      EXPECT_LT(worst(op, Type::F64, x), 3.0);
  for (Op op : {Op::FSin, Op::FCos, Op::FTan})
    for (double x : {double(INFINITY), -double(INFINITY), double(NAN)}) EXPECT_TRUE(std::isnan(one(op, x)));
}

TEST(LowerMathF64, hugeAnglesOfFloats) {
  std::mt19937 random(9);
  std::vector<double> x{0x1.fffffep127f, -0x1.fffffep127f,
                        0x1.000002p19f,  0x1.5b2c7cp+25f,
                        0x1.f37f9ep+79f, 1e6f,
                        -1e6f,           1e10f};
  while (x.size() < 40000) {
    const auto f = std::bit_cast<float>(uint32_t(random()));
    if (std::fabs(f) > 0x1p18f && std::isfinite(f)) x.push_back(f);
  }
  for (double m : nearMultiples())
    if (std::fabs(m) < 0x1p127) x.push_back(float(m));
  EXPECT_LT(worst(Op::FSin, Type::F32, x), 2.0);
  EXPECT_LT(worst(Op::FCos, Type::F32, x), 2.0);
  EXPECT_LT(worst(Op::FTan, Type::F32, x), 3.5);
}

TEST(LowerMathF64, uniformAnglesGiveTheSameBits) {
  for (Type t : {Type::F32, Type::F64})
    for (Op op : {Op::FSin, Op::FCos, Op::FTan})
      for (double x : {0.0, -0.0, 1.0, -3.0, 1e5, 1e6, -1e10, 0x1p100, 0x1.fffffep127, double(INFINITY)}) {
        const Function f = lowered(op, t, 1, Numerics::F32, true), g = lowered(op, t, 1);
        for (const Inst& i : f.insts) EXPECT_FALSE(opInfo(i.op).flags & kControl);
        Evaluation a, b;
        const uint64_t bits = floatBits(t, x);
        a.tables[kTableDraw].resize(16);
        std::memcpy(a.tables[kTableDraw].data(), &bits, 8);
        b.inputs[0] = {bits};
        evaluate(f, a);
        evaluate(g, b);
        ASSERT_EQ(a.error + b.error, "");
        EXPECT_EQ(a.outputs[0][0], b.outputs[0][0]) << opInfo(op).text << " of " << x;
      }
}

TEST(LowerMathF64, powersOverTheWholeRange) {
  std::mt19937 random(3);
  std::vector<double> x, y;
  std::uniform_real_distribution<double> exponent(-1022, 1023), result(-1070, 1024);
  while (x.size() < 20000) {
    const double l = exponent(random);
    x.push_back(std::exp2(x.size() % 3 ? l : l / 2000));
    y.push_back(result(random) / std::log2(x.back()));
  }
  EXPECT_LT(worst(Op::FPow, Type::F64, x, y), 2.0);
  EXPECT_LT(worst(Op::FPow, Type::F64, everywhere(3000), everywhere(3000, 8)), 2.0);
}

TEST(LowerMathF64, powersOfTheExtremes) {
  EXPECT_EQ(one(Op::FPow, 0, 2), 0);
  EXPECT_EQ(one(Op::FPow, 0, -2), INFINITY);
  EXPECT_EQ(one(Op::FPow, 0, 0), 1);
  EXPECT_EQ(one(Op::FPow, INFINITY, 0), 1);
  EXPECT_EQ(one(Op::FPow, INFINITY, -1), 0);
  EXPECT_EQ(one(Op::FPow, 1, INFINITY), 1);
  EXPECT_EQ(one(Op::FPow, 0.5, INFINITY), 0);
  EXPECT_EQ(one(Op::FPow, 3, 20), 3486784401.0);
  EXPECT_TRUE(std::isnan(one(Op::FPow, -2, 2)));
  EXPECT_TRUE(std::isnan(one(Op::FPow, NAN, 2)));
  EXPECT_TRUE(std::isnan(one(Op::FPow, 2, NAN)));
}

TEST(LowerMathF64, arcTangentOfTwo) {
  std::vector<double> y = everywhere(8000), x = everywhere(8000, 11);
  for (double s : {0., -0., 1., -1., double(INFINITY), -double(INFINITY), double(NAN), 0x1p-1074,
                   0x1.fffffffffffffp1023})
    for (double t : {0., -0., 1., -1., double(INFINITY), -double(INFINITY), double(NAN), 0x1p-1074,
                     -0x1.fffffffffffffp1023})
      y.push_back(s), x.push_back(t);
  for (double a = -3.2; a < 3.2; a += 1e-3) y.push_back(std::sin(a)), x.push_back(std::cos(a));
  EXPECT_LT(worst(Op::FAtan2, Type::F64, y, x), 3.0);
  const std::vector<double> got = run(Op::FAtan2, Type::F64, y, x);
  for (size_t k = 0; k < x.size(); ++k)
    if (!std::isnan(got[k])) {
      ASSERT_EQ(std::signbit(got[k]), std::signbit(y[k])) << y[k] << ", " << x[k];
    }
}

TEST(LowerMathF64, zerosKeepTheirSign) {
  for (Type t : {Type::F16, Type::F32, Type::F64})
    for (Op op : {Op::FSin, Op::FTan, Op::FAsin, Op::FAtan, Op::FSinh, Op::FTanh, Op::FAsinh, Op::FAtanh}) {
      const std::vector<double> r = run(op, t, {-0.0, 0.0});
      EXPECT_TRUE(r[0] == 0 && std::signbit(r[0])) << opInfo(op).text;
      EXPECT_TRUE(r[1] == 0 && !std::signbit(r[1])) << opInfo(op).text;
    }
}

TEST(LowerMathF64, sineAndCosineShareOneReduction) {
  Function f;
  Builder b(f);
  const Value x = b.input(Type::F32, 0);
  b.output(0, b.unary(Op::FSin, x));
  b.output(1, b.unary(Op::FCos, x));
  lowerMath(f, Numerics::F32);
  size_t branches = 0;
  for (const Inst& i : f.insts) branches += i.op == Op::If;
  EXPECT_EQ(branches, 1u);
}

TEST(LowerMathF64, theOracleComputesFloatsInDoubleAndKeepsThem) {
  for (Type t : {Type::F16, Type::F32}) {
    const Function f = lowered(Op::FExp, t, 1, Numerics::Oracle);
    size_t kept = 0;
    for (const Inst& i : f.insts) {
      if (i.op == Op::FToF) {
        EXPECT_TRUE(i.flags & kInstKeep);
        ++kept;
      } else if (i.op != Op::Input && isFloat(i.type)) {
        EXPECT_EQ(i.type, Type::F64) << opInfo(i.op).text;
      }
    }
    EXPECT_EQ(kept, 2u);
  }
  // Also of constants nothing is rounded away.
  Function f;
  Builder b(f);
  b.output(0, b.unary(Op::FSin, b.f32(1)));
  lowerMath(f, Numerics::Oracle);
  EXPECT_NE(print(f).find("keep"), std::string::npos);
}

}  // namespace
}  // namespace pumice::ir
