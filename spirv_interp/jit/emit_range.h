// How a range (Emitter::Range, SharedRange) lies in the bank or the frame: the highest offset allowed, as a vector, then these.
#pragma once

#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

constexpr int32_t kRangeBase = 32, kRangeBiased = 40, kRangeLast = 48;   //!< biased: base + 2^31

inline x86::Mem at(x86::Mem m, int32_t offset) {
  m.addOffset(offset);
  return m;
}

}  // namespace pumice::jit
