// f16 arithmetic as f32 (fma: f64) and conversions, which rounds to the same half; the executors agree on it.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

//! Gives whether there was any: the rates are to be computed again.
bool widenHalves(ir::Function& f);

}  // namespace pumice::jit
