// The measured programs in C++, one invocation at a time, as a compiler makes them for AVX2 and FMA at -O2 and at -O3.
#pragma once

#include <cstdint>

namespace pumice::bench {

struct NativeInput {
  const float* x[3];
  const uint32_t* n[2];
  const uint32_t* table;       // 4096 words
  float a, c;
  unsigned lanes;              // at most 128
};

#define PUMICE_NATIVE_PROGRAMS(P) P(floatAlu) P(intAlu) P(transcendental) P(unsignedDivision) P(signedDivision) P(gather) P(divergent) P(shared)
#define PUMICE_DECLARE(name) void name(const NativeInput& in, uint32_t* out);
namespace o2 { PUMICE_NATIVE_PROGRAMS(PUMICE_DECLARE) }
namespace o3 { PUMICE_NATIVE_PROGRAMS(PUMICE_DECLARE) }
#undef PUMICE_DECLARE

}  // namespace pumice::bench
