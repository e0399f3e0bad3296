// Rows of the differential test of instruction families (families_test.cpp): GLSL expressions over one invocation's inputs.
//
// Inputs: uint a, b, c, d and float x, y, z, w, random and extreme; int i = a, j = b; uint n: the invocation's number, 64 to a group.
// Beside them `img`, a storage image of 64 x 16 words, `tex`, a sampled one with linear filtering, and `address`, of 64 KiB of memory.
#pragma once

#include "cts_subset/harness/vulkan_context.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace pumice::cts {

struct Lane {
  uint32_t a, b, c, d;
  float x, y, z, w;
};

// How far one device may be from the truth `v`, by the specification's table of precision; infinite: nothing is said. Null: not at all.
using Allowed = double (*)(const Lane& in, double v);

struct Row {
  const char* expression;
  bool isFloat = false;
  Allowed allowed = nullptr;
};
struct InstructionFamily {
  const char* name;
  std::string declarations;
  std::vector<Row> rows;
  bool (*present)(const Device&) = [](const Device&) { return true; };
};

// Spacing of 32-bit floats at v; denormals may be flushed.
inline double ulp(double v) {
  v = std::fabs(v);
  if (!(v < 3.5e38)) return std::numeric_limits<double>::infinity();
  return std::ldexp(1.0, std::max(std::ilogb(std::max(v, 1e-300)), -126) - 23);
}

const std::vector<InstructionFamily>& instructionFamilies();

}  // namespace pumice::cts
