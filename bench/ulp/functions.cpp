#include "bench/ulp/functions.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "spirv_interp/ir/fold.h"
#include "tests/ir/mpfr_reference.h"

namespace pumice::ulp {

using ir::Op, ir::Type;

namespace {
constexpr double kPi = 3.14159265358979323846;

double unit(Type t, double x) {
  const ir::FloatFormat f = ir::floatFormat(t);
  const int e = x == 0 || !std::isfinite(x) ? f.lowestExponent : std::max(std::ilogb(x), f.lowestExponent);
  return std::ldexp(1.0, e - f.precision + 1);
}

std::vector<double> dense(Type t, double low, double high, size_t count, std::mt19937_64& random) {
  std::uniform_real_distribution<double> within(low, high);
  std::vector<double> v;
  while (v.size() < count) {
    // Half of them evenly spread, half at random.
    const double x =
        v.size() % 2 ? within(random) : low + (high - low) * (double(v.size()) + 0.5) / double(count);
    v.push_back(ir::floatValue(t, ir::floatBits(t, x)));
  }
  return v;
}

std::vector<double> extreme(Type t, size_t count, std::mt19937_64& random) {
  const ir::FloatFormat f = ir::floatFormat(t);
  const double smallest = std::ldexp(1.0, f.lowestExponent),
               largest = std::ldexp(2 - std::ldexp(1.0, 1 - f.precision), f.highestExponent);
  std::vector<double> v;
  for (double x :
       {0.0, 1.0, 0.5, 2.0, smallest, largest, smallest / 2, smallest * std::ldexp(1.0, 1 - f.precision),
        double(INFINITY), 1 - std::ldexp(1.0, -f.precision), 1 + std::ldexp(1.0, 1 - f.precision),
        f.highestExponent * std::log(2.0), double(f.highestExponent + 1), f.lowestExponent * std::log(2.0),
        double(f.lowestExponent), kPi, kPi / 2, 1e6})
    v.insert(v.end(), {ir::floatValue(t, ir::floatBits(t, x)), ir::floatValue(t, ir::floatBits(t, -x))});
  v.push_back(NAN);
  if (t == Type::F16) {
    for (uint32_t h = 0; h < 0x10000; ++h) v.push_back(ir::halfToDouble(uint16_t(h)));
  } else {
    while (v.size() < count) v.push_back(ir::floatValue(t, random() >> (64 - 8 * typeBytes(t))));
  }
  return v;
}

//! Arithmetic with 200 bits.
struct Exact {
  mpfr_t v;
  Exact(double x = 0) {
    mpfr_init2(v, 200);
    mpfr_set_d(v, x, MPFR_RNDN);
  }
  Exact(mpfr_srcptr x) {
    mpfr_init2(v, 200);
    mpfr_set(v, x, MPFR_RNDN);
  }
  Exact(const Exact& other) : Exact(mpfr_srcptr(other.v)) {}
  Exact& operator=(const Exact&) = delete;
  ~Exact() { mpfr_clear(v); }
};
#define PUMICE_EXACT(name, call)                    \
  Exact name(const Exact& a, const Exact& b) {      \
    Exact r;                                        \
    call(r.v, a.v, b.v, MPFR_RNDN);                 \
    return r;                                       \
  }
PUMICE_EXACT(operator+, mpfr_add)
PUMICE_EXACT(operator-, mpfr_sub)
PUMICE_EXACT(operator*, mpfr_mul)
PUMICE_EXACT(operator/, mpfr_div)
#undef PUMICE_EXACT
Exact root(const Exact& a) {
  Exact r;
  mpfr_sqrt(r.v, a.v, MPFR_RNDN);
  return r;
}
Exact floorOf(const Exact& a) {
  Exact r;
  mpfr_floor(r.v, a.v);
  return r;
}
Exact pi() {
  Exact r;
  mpfr_const_pi(r.v, MPFR_RNDN);
  return r;
}
void set(mpfr_ptr r, const Exact& a) { mpfr_set(r, a.v, MPFR_RNDN); }

#define PUMICE_IS(expression) \
  [](mpfr_ptr r, mpfr_srcptr xs, [[maybe_unused]] mpfr_srcptr ys) { \
    const Exact x(xs);                                              \
    [[maybe_unused]] const Exact y(ys);                             \
    set(r, expression);                                             \
  }

void smoothstepOf(mpfr_ptr r, mpfr_srcptr xs, mpfr_srcptr) {
  const Exact t = (Exact(xs) + 1) / 2;
  if (mpfr_nan_p(t.v)) return mpfr_set_nan(r);
  if (mpfr_cmp_d(t.v, 0) <= 0) return void(mpfr_set_d(r, 0, MPFR_RNDN));
  if (mpfr_cmp_d(t.v, 1) >= 0) return void(mpfr_set_d(r, 1, MPFR_RNDN));
  set(r, t * t * (Exact(3) - Exact(2) * t));
}
void ldexpOf(mpfr_ptr r, mpfr_srcptr x, mpfr_srcptr y) {
  mpfr_mul_2si(r, x, mpfr_nan_p(y) ? 0 : long(std::clamp(mpfr_get_d(y, MPFR_RNDN), -2200.0, 2200.0)), MPFR_RNDN);
}
//! Of I = (0.25, x), N = (0, 1), eta = y: the second component.
void refractOf(mpfr_ptr r, mpfr_srcptr xs, mpfr_srcptr ys) {
  const Exact x(xs), y(ys), k = Exact(1) - y * y * (Exact(1) - x * x);
  if (mpfr_cmp_d(k.v, 0) < 0) return void(mpfr_set_d(r, 0, MPFR_RNDN));
  set(r, y * x - (y * x + root(k)));
}
}  // namespace

const std::vector<Function> kFunctions = {
    {"x / y", "x / y", Op::FDiv, 2, -2, 2, 0.5, 4, 0.5},
    {"sqrt", "sqrt(x)", Op::FSqrt, 1, 0, 4, 0, 0, 0.5},
    {"inversesqrt", "inversesqrt(x)", Op::FRsqrt, 1, 1e-3, 4, 0, 0, 2},
    {"exp2", "exp2(x)", Op::FExp2, 1, -14, 15, 0, 0, 2},
    {"log2", "log2(x)", Op::FLog2, 1, 1e-3, 4, 0, 0, 2},
    {"exp", "exp(x)", Op::FExp, 1, -10, 10, 0, 0, 2},
    {"log", "log(x)", Op::FLog, 1, 1e-3, 4, 0, 0, 2},
    {"pow", "pow(x, y)", Op::FPow, 2, 1e-3, 4, -4, 4, 4},
    {"sin", "sin(x)", Op::FSin, 1, -kPi, kPi, 0, 0, 4},
    {"cos", "cos(x)", Op::FCos, 1, -kPi, kPi, 0, 0, 4},
    {"tan", "tan(x)", Op::FTan, 1, -kPi, kPi, 0, 0, 4},
    {"asin", "asin(x)", Op::FAsin, 1, -1, 1, 0, 0, 4},
    {"acos", "acos(x)", Op::FAcos, 1, -1, 1, 0, 0, 4},
    {"atan", "atan(x)", Op::FAtan, 1, -8, 8, 0, 0, 4},
    {"atan(y, x)", "atan(x, y)", Op::FAtan2, 2, -2, 2, -2, 2, 4},
    {"sinh", "sinh(x)", Op::FSinh, 1, -10, 10, 0, 0, 4},
    {"cosh", "cosh(x)", Op::FCosh, 1, -10, 10, 0, 0, 4},
    {"tanh", "tanh(x)", Op::FTanh, 1, -4, 4, 0, 0, 4},
    {"asinh", "asinh(x)", Op::FAsinh, 1, -8, 8, 0, 0, 4},
    {"acosh", "acosh(x)", Op::FAcosh, 1, 1, 8, 0, 0, 4},
    {"atanh", "atanh(x)", Op::FAtanh, 1, -1, 1, 0, 0, 4},
    {"radians", "radians(x)", Op::Nop, 1, -360, 360, 0, 0, 1, PUMICE_IS(x * pi() / 180), false},
    {"degrees", "degrees(x)", Op::Nop, 1, -7, 7, 0, 0, 1, PUMICE_IS(x * 180 / pi()), false},
    {"fract", "fract(x)", Op::Nop, 1, -8, 8, 0, 0, 0.5, PUMICE_IS(x - floorOf(x))},
    {"mod", "mod(x, y)", Op::Nop, 2, -8, 8, 0.5, 4, INFINITY, PUMICE_IS(x - y * floorOf(x / y))},
    {"fma(x, y, x)", "fma(x, y, x)", Op::Nop, 2, -2, 2, -2, 2, 0.5, PUMICE_IS(x * y + x)},
    {"ldexp", "ldexp(x, y == y ? int(clamp(y, T(-2200), T(2200))) : 0)", Op::Nop, 2, -2, 2, -24, 15, 0.5, ldexpOf},
    {"mix(x, y, 1/4)", "mix(x, y, T(0.25))", Op::Nop, 2, 0, 2, 0, 2, 4, PUMICE_IS(x * 0.75 + y * 0.25)},
    {"smoothstep(-1, 1, x)", "smoothstep(T(-1), T(1), x)", Op::Nop, 1, -1, 1, 0, 0, INFINITY, smoothstepOf},
    {"length(x, y)", "length(V2(x, y))", Op::Nop, 2, -2, 2, -2, 2, 4, PUMICE_IS(root(x * x + y * y))},
    {"distance((x, y), (y, 1))", "distance(V2(x, y), V2(y, T(1)))", Op::Nop, 2, -2, 2, -2, 2, INFINITY,
     PUMICE_IS(root((x - y) * (x - y) + (y - 1) * (y - 1)))},
    {"normalize(x, y).x", "normalize(V2(x, y)).x", Op::Nop, 2, -2, 2, -2, 2, 4, PUMICE_IS(x / root(x * x + y * y))},
    {"reflect((x, 1), (y, 1/2)).x", "reflect(V2(x, T(1)), V2(y, T(0.5))).x", Op::Nop, 2, 0, 1, 1, 2, INFINITY,
     PUMICE_IS(x - (x * y + 0.5) * 2 * y)},
    {"refract((1/4, x), (0, 1), y).y", "refract(V2(T(0.25), x), V2(T(0), T(1)), y).y", Op::Nop, 2, -1, 1, 0.25, 0.75,
     INFINITY, refractOf},
    {"determinant(x, y; y, 1)", "determinant(M2(x, y, y, T(1)))", Op::Nop, 2, 2, 4, -1, 1, 4, PUMICE_IS(x - y * y)},
    {"inverse(x, y; y, 1)[0][0]", "inverse(M2(x, y, y, T(1)))[0][0]", Op::Nop, 2, 2, 4, -1, 1, 4, PUMICE_IS(Exact(1) / (x - y * y))},
};

std::vector<Inputs> inputsFor(const Function& f, Type t, size_t count) {
  std::mt19937_64 random((uint64_t(f.op) + (f.exact ? uint64_t(f.glsl[0]) << 8 | uint64_t(f.glsl[1]) << 16 : 0)) * 16 + uint64_t(t));
  std::vector<Inputs> all;
  auto add = [&](std::string name, std::vector<double> x, double yLow, double yHigh, bool wild) {
    Inputs i{std::move(name), std::move(x), {}};
    if (f.arguments == 2) {
      i.y = wild ? extreme(t, i.x.size(), random) : dense(t, yLow, yHigh, i.x.size(), random);
      std::shuffle(i.y.begin(), i.y.end(), random);
      i.y.resize(i.x.size());
    }
    all.push_back(std::move(i));
  };
  auto number = [](double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", x);
    return std::string(text);
  };
  std::string name = number(f.low) + " .. " + number(f.high);
  if (f.arguments == 2) name += ", " + number(f.yLow) + " .. " + number(f.yHigh);
  add(name, dense(t, f.low, f.high, count, random), f.yLow, f.yHigh, false);
  if (f.op == Op::FSin || f.op == Op::FCos || f.op == Op::FTan) {
    const double far = t == Type::F16 ? 65504 : 1e6;
    add("to " + number(far), dense(t, -far, far, count, random), 0, 0, false);
  }
  add("extremes", extreme(t, count, random), 0, 0, true);
  return all;
}

double vulkanAllows(const Function& f, Type t, double x, double y, double exact) {
  constexpr double kNothingSaid = INFINITY;
  const bool half = t == Type::F16;
  const ir::FloatFormat format = ir::floatFormat(t);
  const double smallest = std::ldexp(1.0, format.lowestExponent), u = unit(t, exact);
  // Denormal operands and results may be flushed; beyond the largest number either it or infinity may follow.
  if (!std::isfinite(exact) || !std::isfinite(x) || !std::isfinite(y)) return kNothingSaid;
  if (std::fabs(exact) >= std::ldexp(1 - std::ldexp(1.0, -format.precision), format.highestExponent + 1))
    return kNothingSaid;
  if (std::fabs(exact) < smallest || (x != 0 && std::fabs(x) < smallest) ||
      (y != 0 && std::fabs(y) < smallest))
    return kNothingSaid;
  auto expError = [&](double a) { return ((half ? 1 : 3) + 2 * std::fabs(a)) * unit(t, std::exp(a)); };
  auto logError = [&](double argument, double value) {
    return argument >= 0.5 && argument <= 2 ? (half ? 0x1p-7 : 0x1p-21) : 3 * unit(t, value);
  };
  const double angle = half ? 0x1p-7 : 0x1p-11;
  const double root = std::sqrt(std::fabs(x * x - 1));
  switch (f.op) {
    case Op::FDiv:
      return std::fabs(y) <= 1 / smallest ? 2.5 * u : kNothingSaid;
    case Op::FSqrt:
      return 2.5 * u;
    case Op::FRsqrt:
      return 2 * u;
    case Op::FExp:
    case Op::FExp2:
      return ((half ? 1 : 3) + 2 * std::fabs(x)) * u;
    case Op::FLog:
    case Op::FLog2:
      return logError(x, exact);
    case Op::FPow: {
      if (!(x > 0)) return kNothingSaid;
      const double l = std::log2(x), p = y * l, error = std::fabs(y) * logError(x, l) + 0.5 * unit(t, p);
      return exact * (std::exp2(error) - 1) + ((half ? 1 : 3) + 2 * std::fabs(p)) * u;
    }
    case Op::FSin:
    case Op::FCos:
      return std::fabs(x) <= kPi ? angle : kNothingSaid;
    case Op::FTan:
      return std::fabs(x) <= kPi ? angle * (1 + std::fabs(exact)) / std::fabs(std::cos(x)) : kNothingSaid;
    case Op::FAsin:
    case Op::FAcos:
    case Op::FAtan:
    case Op::FAtan2:
      return (half ? 5 : 4096) * u;
    case Op::FSinh:
    case Op::FCosh:
      return 0.5 * (expError(x) + expError(-x));
    case Op::FTanh:
      return 0.5 * (expError(x) + expError(-x)) / std::cosh(x);
    case Op::FAsinh:
      return logError(std::exp(std::fabs(exact)), exact);
    case Op::FAcosh:
      return logError(x + root, exact);
    case Op::FAtanh:
      return 0.5 * logError((1 + x) / (1 - x), 2 * exact);
    default:
      return kNothingSaid;
  }
}

}  // namespace pumice::ulp
