// The f32 lowerings against the C library in double: dense samples, random bits and the extremes.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <random>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/passes.h"
#include "tests/ir/evaluate.h"

namespace pumice::ir {
namespace {

Function lowered(Op op, Type t, unsigned arguments) {
  Function f;
  Builder b(f);
  const Value in[] = {b.input(t, 0), b.input(t, 1)};
  b.output(0, b.emit(op, t, std::span<const Value>(in, arguments)));
  lowerMath(f, Numerics::F32);
  EXPECT_EQ(verify(f), "") << opInfo(op).text;
  return f;
}

std::vector<float> run(Op op, const std::vector<float>& x, const std::vector<float>& y = {}) {
  const Function f = lowered(op, Type::F32, y.empty() ? 1 : 2);
  std::vector<float> result(x.size());
  for (size_t first = 0; first < x.size(); first += 4096) {
    Evaluation e;
    e.lanes = std::min<size_t>(4096, x.size() - first);
    for (size_t k = 0; k < e.lanes; ++k) {
      e.inputs[0].push_back(std::bit_cast<uint32_t>(x[first + k]));
      if (!y.empty()) e.inputs[1].push_back(std::bit_cast<uint32_t>(y[first + k]));
    }
    evaluate(f, e);
    EXPECT_EQ(e.error, "");
    for (size_t k = 0; k < e.lanes; ++k) result[first + k] = std::bit_cast<float>(uint32_t(e.outputs[0][k]));
  }
  return result;
}
float one(Op op, float x) { return run(op, {x})[0]; }
float one(Op op, float x, float y) { return run(op, {x}, {y})[0]; }

// Error in units of the exact result's last place (of the smallest denormal below the normal range).
double ulps(float got, double exact) {
  if (std::isnan(exact) || std::isnan(got)) return std::isnan(exact) == std::isnan(got) ? 0 : INFINITY;
  const auto nearest = float(exact);
  if (got == nearest)
    return std::isinf(nearest)
               ? 0
               : std::fabs(got - exact) /
                     std::ldexp(1.0, std::max(std::ilogb(exact == 0 ? 1e-45 : exact), -126) - 23);
  if (std::isinf(got) || std::isinf(nearest)) {
    // One step across the border of overflow is one unit.
    const double g = std::isinf(got) ? std::copysign(0x1p128, got) : got;
    return std::fabs(g - std::clamp(exact, -0x1p128, 0x1p128)) / 0x1p104;
  }
  return std::fabs(got - exact) /
         std::ldexp(1.0, std::max(std::ilogb(exact == 0 ? 1e-45 : exact), -126) - 23);
}

std::vector<float> line(double from, double to, size_t count) {
  std::vector<float> x;
  for (size_t k = 0; k < count; ++k) x.push_back(float(from + (to - from) * double(k) / double(count - 1)));
  return x;
}
// Every exponent, random mantissas, both signs, and the special values.
std::vector<float> everywhere(size_t count) {
  std::mt19937 random(7);
  std::vector<float> x{0.f,
                       -0.f,
                       1.f,
                       -1.f,
                       INFINITY,
                       -INFINITY,
                       NAN,
                       0x1p-149f,
                       -0x1p-149f,
                       0x1p-126f,
                       0x1.fffffcp-127f,
                       0x1.fffffep127f,
                       -0x1.fffffep127f,
                       0.5f,
                       -0.5f,
                       2.f,
                       std::nextafter(1.f, 0.f),
                       std::nextafter(1.f, 2.f)};
  while (x.size() < count) x.push_back(std::bit_cast<float>(uint32_t(random())));
  return x;
}

double worst(Op op, const std::vector<float>& x, double (*exact)(double)) {
  const std::vector<float> got = run(op, x);
  double most = 0;
  float where = 0;
  for (size_t k = 0; k < x.size(); ++k)
    if (const double u = ulps(got[k], exact(x[k])); !(u <= most)) most = u, where = x[k];
  ::testing::Test::RecordProperty(opInfo(op).text, std::to_string(most));
  std::printf("    %-7s worst error %.3f ulp at %a\n", opInfo(op).text, most, double(where));
  return most;
}

double rsqrt(double x) { return 1 / std::sqrt(x); }

TEST(LowerMath, exponentials) {
  for (const auto& x : {line(-160, 140, 30001), line(-1, 1, 10001), everywhere(30000)}) {
    EXPECT_LT(worst(Op::FExp2, x, std::exp2), 1.1);
    EXPECT_LT(worst(Op::FExp, x, std::exp), 1.6);
  }
}

TEST(LowerMath, logarithms) {
  for (const auto& x :
       {line(0, 4, 30001), line(0.99, 1.01, 10001), line(1e-40, 1e-37, 5001), everywhere(30000)}) {
    EXPECT_LT(worst(Op::FLog2, x, std::log2), 2.5);
    EXPECT_LT(worst(Op::FLog, x, std::log), 1.6);
  }
}

TEST(LowerMath, trigonometry) {
  for (const auto& x :
       {line(-3.15, 3.15, 30001), line(-100, 100, 20001), line(-2e5, 2e5, 30001), line(-5e5, 5e5, 20001)}) {
    EXPECT_LT(worst(Op::FSin, x, std::sin), 2.0);
    EXPECT_LT(worst(Op::FCos, x, std::cos), 2.0);
    EXPECT_LT(worst(Op::FTan, x, std::tan), 3.5);
  }
}

TEST(LowerMath, hugeAnglesStayBounded) {
  for (const auto& [op, exact] :
       {std::pair{Op::FSin, static_cast<double (*)(double)>(std::sin)}, {Op::FCos, std::cos}}) {
    const std::vector<float> x = line(-0x1p22, 0x1p22, 20001), got = run(op, x);
    for (size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(got[k], exact(x[k]), 1e-5);
  }
  for (Op op : {Op::FSin, Op::FCos})
    for (float r : run(op, {1e7f, -1e10f, 0x1p127f, 0x1.fffffep127f})) EXPECT_LE(std::fabs(r), 1.f);
  for (Op op : {Op::FSin, Op::FCos, Op::FTan})
    for (float x : {INFINITY, -INFINITY, NAN}) EXPECT_TRUE(std::isnan(one(op, x)));
}

TEST(LowerMath, inverseTrigonometry) {
  for (const auto& x : {line(-1, 1, 30001), line(-1e-3, 1e-3, 5001), everywhere(20000)}) {
    EXPECT_LT(worst(Op::FAsin, x, std::asin), 2.5);
    EXPECT_LT(worst(Op::FAcos, x, std::acos), 2.5);
    EXPECT_LT(worst(Op::FAtan, x, std::atan), 2.5);
  }
  EXPECT_LT(worst(Op::FAtan, line(-20, 20, 20001), std::atan), 2.5);
}

TEST(LowerMath, hyperbolic) {
  for (const auto& x : {line(-95, 95, 20001), line(-2, 2, 20001), everywhere(20000)}) {
    EXPECT_LT(worst(Op::FSinh, x, std::sinh), 3.0);
    EXPECT_LT(worst(Op::FCosh, x, std::cosh), 2.5);
    EXPECT_LT(worst(Op::FTanh, x, std::tanh), 2.5);
    EXPECT_LT(worst(Op::FAsinh, x, std::asinh), 3.5);
    EXPECT_LT(worst(Op::FAcosh, x, std::acosh), 3.5);
    EXPECT_LT(worst(Op::FAtanh, x, std::atanh), 3.5);
  }
}

TEST(LowerMath, reciprocalSquareRoot) {
  EXPECT_LT(worst(Op::FRsqrt, line(0, 10, 10001), rsqrt), 1.5);
  EXPECT_LT(worst(Op::FRsqrt, everywhere(10000), rsqrt), 1.5);
}

TEST(LowerMath, powersOverTheWholeRange) {
  std::mt19937 random(3);
  std::vector<float> x, y;
  std::uniform_real_distribution<double> exponent(-126, 127), result(-148, 128);
  while (x.size() < 60000) {
    const double l = exponent(random);
    x.push_back(float(std::exp2(x.size() % 3 ? l : l / 200)));
    y.push_back(float(result(random) / std::log2(double(x.back()))));
  }
  const std::vector<float> got = run(Op::FPow, x, y);
  double most = 0;
  for (size_t k = 0; k < x.size(); ++k) {
    const double exact = std::pow(double(x[k]), double(y[k]));
    const double u = ulps(got[k], exact);
    if (u > most) most = u;
    ASSERT_LT(u, 5.0) << x[k] << " ^ " << y[k];
  }
  std::printf("    fpow    worst error %.3f ulp\n", most);
}

// A constant exponent and what is known of x change which operations there are, but no bit.
TEST(LowerMath, powersWithConstantExponents) {
  const auto hold = [](Builder& b, Value x, int how) {
    switch (how) {
      case 1: return b.fmax(x, b.zero(b.type(x)));
      case 2: return b.fmin(b.fmax(x, b.zero(b.type(x))), b.floatConstant(b.type(x), 1));
      case 3: return b.fabs(x);
      case 4: return b.fmin(b.fmax(b.floatConstant(b.type(x), 1e-3), x), b.floatConstant(b.type(x), 40));
      default: return x;
    }
  };
  std::vector<float> x = everywhere(200);
  for (const std::vector<float>& more : {line(0, 1, 150), line(0, 3, 50), line(0, 1e-37, 30)}) x.insert(x.end(), more.begin(), more.end());
  for (Type t : {Type::F32, Type::F64, Type::F16})
    for (int how = 0; how < 5; ++how)
      for (double exponent : {1 / 2.2, 2.2, 0.5, 2.0, 5.0, 16.0, 32.0, 64.0, 1 / 2.4, 1e-3, 0.75, 0.84, -0.5, -1.0, -2.4, -64.0, 0.0, 100.0, 1e-7}) {
        Function constant, varying;
        size_t operations[2];
        for (Function* f : {&constant, &varying}) {
          Builder b(*f);
          const Value y = f == &constant ? b.floatConstant(t, exponent) : b.input(t, 1);
          b.output(0, b.emit(Op::FPow, t, {hold(b, b.input(t, 0), how), y}));
          lowerMath(*f, Numerics::F32);
          ASSERT_EQ(verify(*f), "");
          operations[f == &varying] = f->insts.size();
        }
        if (how == 2 && exponent == 2.0) {
          EXPECT_LT(operations[0] + 12, operations[1]);
        }
        Evaluation a, v;
        a.lanes = v.lanes = x.size();
        for (float at : x) {
          a.inputs[0].push_back(floatBits(t, t == Type::F64 ? double(at) * (std::fabs(at) < 1e-30f ? 1e-270 : 1) : at));
          v.inputs[1].push_back(floatBits(t, exponent));
        }
        v.inputs[0] = a.inputs[0];
        evaluate(constant, a);
        evaluate(varying, v);
        for (size_t k = 0; k < x.size(); ++k)
          ASSERT_EQ(a.outputs[0][k], v.outputs[0][k]) << x[k] << " (" << how << ") ^ " << exponent << " as " << int(t);
      }
}

TEST(LowerMath, powersOfTheExtremes) {
  EXPECT_EQ(one(Op::FPow, 0, 2), 0);
  EXPECT_EQ(one(Op::FPow, 0, -2), INFINITY);
  EXPECT_EQ(one(Op::FPow, 0, 0), 1);
  EXPECT_EQ(one(Op::FPow, INFINITY, 2), INFINITY);
  EXPECT_EQ(one(Op::FPow, INFINITY, -2), 0);
  EXPECT_EQ(one(Op::FPow, INFINITY, 0), 1);
  EXPECT_EQ(one(Op::FPow, 2, INFINITY), INFINITY);
  EXPECT_EQ(one(Op::FPow, 2, -INFINITY), 0);
  EXPECT_EQ(one(Op::FPow, 0.5, INFINITY), 0);
  EXPECT_EQ(one(Op::FPow, 1, 1e30f), 1);
  EXPECT_EQ(one(Op::FPow, 3, 2), 9);
  EXPECT_TRUE(std::isnan(one(Op::FPow, -2, 2)));
  EXPECT_TRUE(std::isnan(one(Op::FPow, NAN, 2)));
  EXPECT_TRUE(std::isnan(one(Op::FPow, 2, NAN)));
}

TEST(LowerMath, arcTangentOfTwo) {
  std::vector<float> y = everywhere(40000), x = everywhere(40000);
  std::mt19937 random(5);
  std::shuffle(x.begin(), x.end(), random);
  for (float s : {0.f, -0.f, 1.f, -1.f, INFINITY, -INFINITY, NAN, 0x1p-149f, 0x1.fffffep127f})
    for (float t :
         {0.f, -0.f, 1.f, -1.f, INFINITY, -INFINITY, NAN, 0x1p-149f, -0x1.fffffep127f, 0x1.fffffep127f})
      y.push_back(s), x.push_back(t);
  for (double a = -3.2; a < 3.2; a += 1e-3) y.push_back(float(std::sin(a))), x.push_back(float(std::cos(a)));
  const std::vector<float> got = run(Op::FAtan2, y, x);
  for (size_t k = 0; k < x.size(); ++k) {
    const double exact = std::atan2(double(y[k]), double(x[k]));
    ASSERT_LT(ulps(got[k], exact), 2.5) << y[k] << ", " << x[k] << " gives " << got[k] << " not " << exact;
    ASSERT_TRUE(std::isnan(exact) || std::signbit(got[k]) == std::signbit(exact)) << y[k] << ", " << x[k];
  }
}

TEST(LowerMath, halvesAreRoundedOnce) {
  const Function f = lowered(Op::FExp2, Type::F16, 1);
  Evaluation e;
  e.lanes = 0x7c00;
  for (uint32_t h = 0; h < e.lanes; ++h) e.inputs[0].push_back(h);
  evaluate(f, e);
  ASSERT_EQ(e.error, "");
  size_t off = 0;
  for (uint32_t h = 0; h < e.lanes; ++h)
    off += e.outputs[0][h] != halfFromDouble(std::exp2(halfToDouble(uint16_t(h))));
  EXPECT_LT(off, 30u) << "only near midpoints may the two roundings differ";
}

}  // namespace
}  // namespace pumice::ir
