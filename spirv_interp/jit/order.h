// The order of instructions, for the sake of registers.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

//! Moves what has no effect and reads nothing that changes to where it is first needed, within its stretch of straight code; in loops
//! only what takes a value apart. Changes no value.
void computeWhenNeeded(ir::Function& f);

}  // namespace pumice::jit
