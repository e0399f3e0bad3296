// Compute: short loops with a known number of turns become their turns, so that counters become part of addresses.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

//! Innermost loops without branches. Rates must be computed again if it returns true.
bool unrollLoops(ir::Function& f);

}  // namespace pumice::jit
