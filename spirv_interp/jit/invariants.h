// Loops: what does not change from turn to turn is computed before them.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

//! Moves arithmetic and what fills tables of constants, no loads; bits stay the same. Offsets that come out as 0 (`vec2(1, 0) / size`) are taken away first, where a
//! coordinate does not depend on the turn but for them; of tables of up to eight constants words are chosen by comparing, so that such
//! a routine needs no memory of its lanes' own. Rates must be computed again if it returns true.
bool hoistInvariants(ir::Function& f);

}  // namespace pumice::jit
