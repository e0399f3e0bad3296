// Layout of the table ir::kTableConstants.
#pragma once

#include <cstdint>

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

const SrgbTables& srgbTables();

}  // namespace pumice::texture
