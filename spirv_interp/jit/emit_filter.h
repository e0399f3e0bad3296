// Footprints of four texels as one operation: what the code for each kind of texel (emit_filter.cpp, emit_filter_bytes.cpp) is given.
#pragma once

#include "spirv_interp/jit/emit_range.h"

namespace pumice::jit {

enum FilterOperand { kRow0, kRow1, kColumn0, kColumn1, kWeightX, kWeightY };
//! Of FilterLevel(s): levels are kLevelWords operands each.
enum LevelOperand { kPlaceX, kPlaceY, kFirstLevel };
enum LevelWord { kWidth, kHeight, kPitch, kOffset, kLevelWords };
constexpr uint32_t kLevelWeight = kFirstLevel + 2 * kLevelWords, kFilterOperands = kLevelWeight + 1;

// Scratch in the frame: operands that stood in registers, the offsets of the corners, texels in place of those out of bounds, results.
constexpr uint32_t kFilterCorners = kFilterOperands * kMaxUnroll * kVectorBytes;
constexpr uint32_t kFilterTexels = kFilterCorners + 4 * kVectorBytes;
constexpr uint32_t kFilterResults = kFilterTexels + 32 * 8;
constexpr uint32_t kFilterInside = kFilterResults + 4 * kMaxUnroll * kVectorBytes;   //!< FilterLevel(s): where the last pair of texels lies
//! By level and part: both rows' offsets, which lanes leave the level (by sign), weights. Addresses are found before the first texel is waited for.
constexpr uint32_t kFilterFound = kFilterInside + kVectorBytes, kFoundWords = 5;
constexpr uint32_t kFilterScratchBytes = kFilterFound + 2 * kMaxUnroll * kFoundWords * kVectorBytes;

//! Eight lanes of a footprint. All vector registers may be overwritten but those that filterBytes() fills once for all parts.
struct Emitter::FootprintPart {
  x86::Mem operand[kFilterOperands];
  bool shared[kFilterOperands] = {};   //!< operand: of all parts, an element for each quad (quads.h)
  uint8_t lanes = 0;      //!< which of a shared operand's elements are this part's: of a permutation
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
