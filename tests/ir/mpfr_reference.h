// The exact values of the float operations, by MPFR, and the error of a result in units of the last place.
#pragma once

#include <mpfr.h>

#include <cmath>
#include <limits>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

struct FloatFormat {
  int precision, lowestExponent, highestExponent;  //!< of the normal numbers: 1.m * 2^e
};
constexpr FloatFormat floatFormat(Type t) {
  return t == Type::F16   ? FloatFormat{11, -14, 15}
         : t == Type::F32 ? FloatFormat{24, -126, 127}
                          : FloatFormat{53, -1022, 1023};
}

class Reference {
 public:
  Reference() {
    for (mpfr_ptr v : {x_, y_, exact_, error_}) mpfr_init2(v, 200);
  }
  ~Reference() {
    for (mpfr_ptr v : {x_, y_, exact_, error_}) mpfr_clear(v);
  }
  Reference(const Reference&) = delete;
  Reference& operator=(const Reference&) = delete;

  //! Sets the exact value of op(x) or op(x, y), of which value() is the nearest double. False: no such
  //! operation.
  bool evaluate(Op op, double x, double y = 0) {
    mpfr_set_d(x_, x, MPFR_RNDN);
    mpfr_set_d(y_, y, MPFR_RNDN);
    switch (op) {
#define PUMICE_UNARY(Name, call) \
  case Op::Name:                 \
    call(exact_, x_, MPFR_RNDN); \
    return true;
      PUMICE_UNARY(FSqrt, mpfr_sqrt)
      PUMICE_UNARY(FExp2, mpfr_exp2)
      PUMICE_UNARY(FLog2, mpfr_log2)
      PUMICE_UNARY(FExp, mpfr_exp)
      PUMICE_UNARY(FLog, mpfr_log)
      PUMICE_UNARY(FSin, mpfr_sin)
      PUMICE_UNARY(FCos, mpfr_cos)
      PUMICE_UNARY(FTan, mpfr_tan)
      PUMICE_UNARY(FAsin, mpfr_asin)
      PUMICE_UNARY(FAcos, mpfr_acos)
      PUMICE_UNARY(FAtan, mpfr_atan)
      PUMICE_UNARY(FSinh, mpfr_sinh)
      PUMICE_UNARY(FCosh, mpfr_cosh)
      PUMICE_UNARY(FTanh, mpfr_tanh)
      PUMICE_UNARY(FAsinh, mpfr_asinh)
      PUMICE_UNARY(FAcosh, mpfr_acosh)
      PUMICE_UNARY(FAtanh, mpfr_atanh)
#undef PUMICE_UNARY
      case Op::FRsqrt:
        mpfr_sqrt(exact_, x_, MPFR_RNDN);
        mpfr_ui_div(exact_, 1, exact_, MPFR_RNDN);
        return true;
      case Op::FDiv:
        mpfr_div(exact_, x_, y_, MPFR_RNDN);
        return true;
      case Op::FAtan2:
        mpfr_atan2(exact_, x_, y_, MPFR_RNDN);
        return true;
      case Op::FPow:
        // exp2(y * log2(x)), so of negative and NaN bases NaN; zero counts as positive.
        if (!(x >= 0)) {
          mpfr_set_nan(exact_);
          return true;
        }
        mpfr_abs(x_, x_, MPFR_RNDN);
        mpfr_pow(exact_, x_, y_, MPFR_RNDN);
        return true;
      default:
        return false;
    }
  }

  //! The same for what `f(exact, x, y)` sets.
  template <class F>
  void evaluateWith(const F& f, double x, double y) {
    mpfr_set_d(x_, x, MPFR_RNDN);
    mpfr_set_d(y_, y, MPFR_RNDN);
    f(exact_, x_, y_);
  }

  double value() const { return mpfr_get_d(exact_, MPFR_RNDN); }

  //! |got - exact| in units of the exact value's last place in the format; of the smallest denormal's below
  //! the normal range. Infinity where only one of them is NaN, or an infinity is missed or invented.
  double ulps(FloatFormat f, double got) {
    if (mpfr_nan_p(exact_) || std::isnan(got))
      return bool(mpfr_nan_p(exact_)) == std::isnan(got) ? 0 : INFINITY;
    const double overflow = f.highestExponent == 1023 ? INFINITY : std::ldexp(1.0, f.highestExponent + 1);
    const bool negative = mpfr_signbit(exact_);
    // What rounds to infinity is infinite; an infinity where the last numbers before it are due
    // counts as the next number beyond the range.
    mpfr_set_ui_2exp(error_, (1ul << 54) - (1ul << (54 - f.precision - 1)), f.highestExponent + 1 - 54,
                     MPFR_RNDN);
    const bool infinite = mpfr_cmpabs(exact_, error_) >= 0;
    if (std::isinf(got) && infinite) return std::signbit(got) == negative ? 0 : INFINITY;
    if (mpfr_inf_p(exact_)) return INFINITY;
    if (std::isinf(got) && mpfr_get_exp(exact_) <= f.highestExponent) return INFINITY;
    if (std::isinf(got) && std::isinf(overflow)) {
      mpfr_set_ui_2exp(error_, 1, 1024, MPFR_RNDN);
      if (got < 0) mpfr_neg(error_, error_, MPFR_RNDN);
    } else {
      mpfr_set_d(error_, std::isinf(got) ? std::copysign(overflow, got) : got, MPFR_RNDN);
    }
    mpfr_sub(error_, error_, exact_, MPFR_RNDN);
    mpfr_abs(error_, error_, MPFR_RNDN);
    long exponent = mpfr_zero_p(exact_) ? f.lowestExponent : long(mpfr_get_exp(exact_)) - 1;
    if (exponent < f.lowestExponent) exponent = f.lowestExponent;
    if (exponent > f.highestExponent) exponent = f.highestExponent;
    mpfr_mul_2si(error_, error_, f.precision - 1 - exponent, MPFR_RNDN);
    return mpfr_get_d(error_, MPFR_RNDN);
  }

  //! |got - exact|.
  double difference(double got) {
    if (mpfr_nan_p(exact_) || std::isnan(got))
      return bool(mpfr_nan_p(exact_)) == std::isnan(got) ? 0 : INFINITY;
    mpfr_set_d(error_, got, MPFR_RNDN);
    if (mpfr_equal_p(error_, exact_)) return 0;
    mpfr_sub(error_, error_, exact_, MPFR_RNDN);
    return std::fabs(mpfr_get_d(error_, MPFR_RNDN));
  }

 private:
  mpfr_t x_, y_, exact_, error_;
};

}  // namespace pumice::ir
