// What lane IR means: every operation as ops.inc states it, one lane at a time, control flow as ir.h states it.
// Slow and plain, and independent of the interpreter: executors are compared with it. Arithmetic is ir::foldConstant.
#pragma once

#include <span>
#include <string>

#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/ir.h"

namespace pumice::testing {

//! Runs the rows of one work group in step, so barriers need nothing. High-level maths must have been lowered.
//! Gives what could not be done, or nothing.
std::string runReference(const ir::Function& f, std::span<const interp::ExecContext> rows, uint64_t maxSteps = 1'000'000);

}  // namespace pumice::testing
