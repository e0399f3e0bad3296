// The functions whose error is measured: where, and what Vulkan allows them.
#pragma once

#include <mpfr.h>

#include <cstdint>
#include <string>
#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::ulp {

struct Inputs {
  std::string name;  //!< of the domain, as printed
  std::vector<double> x, y;
};

struct Function {
  const char* name;
  const char* glsl;  //!< of x and y; T is their type, V2 and M2 a vector and a matrix of it
  ir::Op op;         //!< Nop: made of several operations, measured through the Vulkan driver
  unsigned arguments;
  double low, high;    //!< the dense domain of x
  double yLow, yHigh;  //!< of y, where there are two arguments
  double
      aim;  //!< largest error in the dense domain that Pumice aims at, in units of the last place (f32, f64)
  void (*exact)(mpfr_ptr result, mpfr_srcptr x, mpfr_srcptr y) = nullptr;  //!< where op is Nop
  bool ofDoubles = true;
};
extern const std::vector<Function> kFunctions;

//! Values of the type: the dense domain; for angles also up to 1e6; and everything else: random bits of
//! either sign and any exponent, infinities, NaN, zeros, denormals, the borders of overflow.
std::vector<Inputs> inputsFor(const Function& f, ir::Type type, size_t count);

//! The absolute error that "Precision of GLSL.std.450 Instructions" allows a result, where it says so;
//! infinity elsewhere (angles beyond pi, denormal results). Functions defined by others get at most what
//! follows from them.
double vulkanAllows(const Function& f, ir::Type type, double x, double y, double exact);

}  // namespace pumice::ulp
