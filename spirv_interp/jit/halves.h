// f16 arithmetic as f32 (fma: f64) and conversions, which rounds to the same half; the executors agree on it.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

void widenHalves(ir::Function& f);

}  // namespace pumice::jit
