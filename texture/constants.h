// Layout of the table ir::kTableConstants.
#pragma once

#include <cstddef>
#include <cstdint>

#include "texture/block_tables.h"

namespace pumice::texture {

// Buckets of f32 values by exponent and seven mantissa bits, from 2^-13 (below the first code's threshold) to 1.
constexpr uint32_t kSrgbFirstBits = (127 - 13) << 23;
constexpr uint32_t kSrgbShift = 16;
constexpr uint32_t kSrgbBuckets = 13 * 128 + 1;  //!< the last one holds 1.0

struct SrgbBucket {
  uint32_t code;     //!< below the threshold; one more from it on
  float threshold;   //!< infinity: none in this bucket
};

struct SrgbTables {
  float decode[256];  //!< correctly rounded
  SrgbBucket encode[kSrgbBuckets];
};

struct ConstantTables {
  SrgbTables srgb;  // first: pack.cpp addresses it from the table's start
  BlockTables blocks;
};

}  // namespace pumice::texture
