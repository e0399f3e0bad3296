// Lowerings of the high-level float operations, one set per number type.
#pragma once

#include "spirv_interp/ir/builder.h"

namespace pumice::ir {

//! f32: plain operations only, no tables, no branches; the same bits everywhere. Errors measured against
//! double in tests/ir/lower_math_test.cpp, all well inside Vulkan's "Precision and Operation of SPIR-V
//! Instructions". 0 if the operation is not a high-level one.
Value lowerF32(Builder& b, Op op, std::span<const Value> operands);

}  // namespace pumice::ir
