// Footprints of four texels as one operation: what the code for each kind of texel (emit_filter.cpp, emit_filter_bytes.cpp) is given.
#pragma once

#include "spirv_interp/jit/emit_range.h"

namespace pumice::jit {

enum FilterOperand { kRow0, kRow1, kColumn0, kColumn1, kWeightX, kWeightY, kFilterOperands };

// Scratch in the frame: operands that stood in registers, the offsets of the corners, texels in place of those out of bounds, results.
constexpr uint32_t kFilterCorners = kFilterOperands * kMaxUnroll * kVectorBytes;
constexpr uint32_t kFilterTexels = kFilterCorners + 4 * kVectorBytes;
constexpr uint32_t kFilterResults = kFilterTexels + 32 * 8;
constexpr uint32_t kFilterScratchBytes = kFilterResults + 4 * kMaxUnroll * kVectorBytes;

//! Eight lanes of a footprint. All vector registers may be overwritten but those that filterBytes() fills once for all parts.
struct Emitter::FootprintPart {
  x86::Mem operand[kFilterOperands];
  x86::Mem limit;         //!< a range's vector
  x86::Mem result[4];     //!< by component
  uint32_t wanted = 0;    //!< bit by component
  bool neighbours = false;   //!< columns are mostly side by side
};

inline x86::Mem at(x86::Mem m, int32_t offset, uint32_t size) {
  m.addOffset(offset);
  m.setSize(size);
  return m;
}

}  // namespace pumice::jit
