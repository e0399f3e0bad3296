// Lowerings of the high-level float operations, one set per number type.
//
// Plain operations only, no tables; the same bits everywhere. The methods are shared (lower_math_common.h);
// each type brings its polynomials, its logarithm and its reduction of angles. Errors are measured against
// MPFR in tests/ir/lower_math_*_test.cpp and, for the report, by bench/ulp.
#pragma once

#include <cmath>

#include "spirv_interp/ir/builder.h"

namespace pumice::ir {

//! x = quadrant * pi/2 + high + low, |high| <= pi/4 (a little more for large x). The last angle that was
//! reduced is kept, since sine and cosine of one angle often stand together.
struct ReducedAngle {
  Value quadrant = 0, high = 0, low = 0;
};
struct AngleCache {
  Value x = 0;  //!< 0: nothing
  ReducedAngle angle;
};

//! `uniform`: the operands do not depend on the lane, so only pure operations may be used.
//! 0 if the operation is not a high-level one of float numbers.
Value lowerF32(Builder& b, Op op, std::span<const Value> operands, bool uniform, AngleCache& cache);
//! At least 2^-45 relative accuracy (2^-49 measured), pow included.
Value lowerF64(Builder& b, Op op, std::span<const Value> operands, bool uniform, AngleCache& cache);

//! What the operations around a float value say of it: a number (no NaN) or not, and where it lies if it is one.
struct Limits {
  double low = -HUGE_VAL, high = HUGE_VAL;
  bool number = false;
};
Limits limitsOf(const Function& f, Value x, unsigned depth = 4);

//! Filters (isFilter) in plain operations; the components of one footprint share their loads. `component`: the immediate.
Value lowerFilter(Builder& b, Op op, std::span<const Value> operands, uint32_t component);

}  // namespace pumice::ir
