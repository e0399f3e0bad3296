#include "base/hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace pumice::base {

uint64_t hashBytes(const void* bytes, size_t size, uint64_t seed) {
  return XXH3_64bits_withSeed(bytes, size, seed);
}

}  // namespace pumice::base
