// Buffers beyond 2 GiB: offsets are 32 bits without a sign, and what is beyond 4 GiB does not wrap back.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/icd/dispatch.h"
#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

uint64_t availableMemory() {
  std::FILE* file = std::fopen("/proc/meminfo", "r");
  char line[128];
  unsigned long long kilobytes = 0;
  while (file && std::fgets(line, sizeof line, file))
    if (std::sscanf(line, "MemAvailable: %llu", &kilobytes) == 1) break;
  if (file) std::fclose(file);
  return kilobytes * 1024;
}

TEST(LargeBuffer, isReadAndWrittenBeyondTwoGibibytesAndNotBeyondItsEnd) {
  constexpr VkDeviceSize kBytes = 3500ull << 20;
  if (availableMemory() < 6ull << 30) GTEST_SKIP() << "needs 6 GiB of free memory";
  TestDevice device;
  VkPhysicalDeviceMemoryProperties memory;
  VK(vkGetPhysicalDeviceMemoryProperties)(physicalDevice(commonInstance()), &memory);
  if (memory.memoryHeaps[0].size < kBytes) GTEST_SKIP() << "the device's heap is smaller than the buffer";
  uint32_t* words = nullptr;
  dispatch(device, computeShader(R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { uint v[]; };
void main() {
  uint i = gl_LocalInvocationIndex;
  v[i] = v[800000000u + i];                       // neighbours
  v[64u + i] = v[i * 14000001u];                  // all over the buffer
  v[870000000u - i * 3u] = i + 7u;
  v[128u + i] = v[0x40000000u + 192u + i];        // as 32 bits this would wrap to 192 + i
  v[0x40000000u + 256u + i] = 99u;
  v[320u + i] = v[int(i) - 64];                   // before the beginning
}
)"), 1, [&](TestDevice& d, VkCommandBuffer commands) {
    for (uint32_t i = 0; i < 64; i++) {
      words[800000000u + i] = 1000 + i;
      words[i * 14000001u] = 2000 + i;
      words[192 + i] = 3000 + i;
    }
    d.run(commands);
    for (uint32_t i = 0; i < 64; i++) {
      EXPECT_EQ(words[i], 1000 + i) << i;
      EXPECT_EQ(words[64 + i], i ? 2000 + i : 1000u) << i;
      EXPECT_EQ(words[870000000u - i * 3], i + 7) << i;
      EXPECT_EQ(words[128 + i], 0u) << i;
      EXPECT_EQ(words[256 + i], 0u) << i;
      EXPECT_EQ(words[320 + i], 0u) << i;
    }
  }, kBytes, &words);
}

}  // namespace
}  // namespace pumice::icd::test
