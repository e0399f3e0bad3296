// Records of discrete decisions, for comparing two runs of one program in different numerics.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

//! Between the instructions [first, end) of a routine, every comparison of floats, conversion from float to integer and rounding to
//! a whole number goes into the variable (i32), a hash: two runs that agree in it took the same branches, texels and levels. The
//! instructions are renumbered. Before the passes.
void recordDecisions(Function& f, Value first, Value end, Value variable);

class Builder;
//! Takes one more word (i32) into a hash of decisions.
Value mixDecision(Builder& b, Value hash, Value word);

}  // namespace pumice::ir
