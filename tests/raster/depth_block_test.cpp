// Depth of blocks: every set of kernels gives the same bits, and bounds are exact.
#include "raster/depth_block.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace pumice::raster {
namespace {

constexpr DepthKind kKinds[] = {DepthKind::Float32, DepthKind::Unorm16, DepthKind::Unorm24};

//! Equations as draws have them, and some that nobody should have.
DepthEquation randomEquation(std::mt19937& random) {
  std::uniform_real_distribution<float> unit(-1, 1);
  DepthEquation d;
  d.origin = unit(random);
  d.dx = unit(random) * std::exp2(float(random() % 20) - 18);
  d.dy = unit(random) * std::exp2(float(random() % 20) - 18);
  if (random() % 8 == 0) d.dx = d.dy = 0;
  if (random() % 8 == 0) d.origin = 0;
  if (random() % 8 == 0) d.origin = -0.0f;
  if (random() % 4 == 0) d.low = -2, d.high = 2;
  if (random() % 4 == 0) d.low = 0.25f, d.high = 0.5f;
  if (random() % 16 == 0) d.dx *= 1e38f, d.low = -std::numeric_limits<float>::infinity(), d.high = std::numeric_limits<float>::infinity();
  return d;
}

void randomMemory(std::mt19937& random, DepthKind kind, std::byte (&memory)[64]) {
  for (uint32_t i = 0; i < 16; i++) {
    uint32_t word = random();
    if (kind == DepthKind::Float32) {
      float f = float(word % 1000) / 999;
      if (word % 61 == 0) f = std::numeric_limits<float>::quiet_NaN();
      if (word % 67 == 0) f = -0.0f;
      std::memcpy(&word, &f, 4);
    }
    std::memcpy(memory + i * depthBytes(kind), &word, depthBytes(kind));
  }
}

TEST(DepthBlock, AllKernelsGiveTheSameBits) {
  NamedDepthKernels all[2];
  const size_t count = availableDepthKernels(all);
  if (count < 2) GTEST_SKIP() << "this processor has one set only";
  std::mt19937 random(7);
  for (int round = 0; round < 20000; round++) {
    const DepthKind kind = kKinds[random() % 3];
    const DepthEquation d = randomEquation(random);
    const uint32_t samples = 1u << random() % 3;
    const float blockX = float(random() % 16 * 4), blockY = float(random() % 16 * 4);
    float sampleX[4], sampleY[4];
    uint16_t masks[4];
    for (int s = 0; s < 4; s++) {
      sampleX[s] = float(random() % 16) / 16, sampleY[s] = float(random() % 16) / 16;
      masks[s] = uint16_t(random() & 3 ? random() & 0xffff : random() & 1 ? 0xffff : 0);
    }
    const float x = blockX + sampleX[0], y = blockY + sampleY[0];
    const VkCompareOp op = VkCompareOp(random() % 8);
    const bool write = random() & 1;
    std::byte before[4][64] = {}, memory[2][4][64];
    for (auto& plane : before) randomMemory(random, kind, plane);
    KeyBounds bounds[2];
    uint16_t passed[2][4] = {};
    for (int k = 0; k < 2; k++) {
      std::memcpy(memory[k], before, sizeof before);
      all[k].kernels->test(d, kind, op, write, {samples, sampleX, sampleY, blockX, blockY, memory[k][0], 64}, masks, passed[k], bounds[k]);
    }
    for (int s = 0; s < 4; s++) ASSERT_EQ(passed[0][s], passed[1][s]) << "round " << round << ", compare " << op << ", kind " << int(kind);
    ASSERT_EQ(std::memcmp(memory[0], memory[1], sizeof before), 0) << "round " << round << ", compare " << op << ", kind " << int(kind);
    ASSERT_EQ(bounds[0].low, bounds[1].low) << "round " << round;
    ASSERT_EQ(bounds[0].high, bounds[1].high) << "round " << round;
    for (int k = 0; k < 2; k++) all[k].kernels->write(d, kind, x, y, memory[k][0]);
    ASSERT_EQ(std::memcmp(memory[0], memory[1], sizeof before), 0) << "write, round " << round << ", kind " << int(kind);
    if (!d.tame()) continue;
    float low[2][16], high[2][16];
    for (int k = 0; k < 2; k++) {
      bounds[k] = all[k].kernels->bounds(d, kind, {x, y, x + 15, y + 15});
      all[k].kernels->boundsOfBlocks(d, kind, {x, y, x + 3, y + 3}, low[k], high[k]);
    }
    ASSERT_EQ(bounds[0].low, bounds[1].low);
    ASSERT_EQ(bounds[0].high, bounds[1].high);
    for (int i = 0; i < 16; i++) ASSERT_TRUE(low[0][i] == low[1][i] && high[0][i] == high[1][i]) << "block " << i;
    // Squares: bounds as bounds() has them, and what compareBounds() says of them.
    float storedLow[16], storedHigh[16];
    for (int i = 0; i < 16; i++) {
      storedLow[i] = random() % 4 ? low[0][random() % 16] : -std::numeric_limits<float>::infinity();
      storedHigh[i] = random() % 4 ? std::max(storedLow[i], high[0][random() % 16]) : std::numeric_limits<float>::infinity();
    }
    const Places first{sampleX[0], sampleY[0], sampleX[0] + 15, sampleY[0] + 15};
    SquareOutcomes outcomes[2];
    for (int k = 0; k < 2; k++) outcomes[k] = all[k].kernels->testSquares(d, kind, op, first, storedLow, storedHigh, low[k], high[k]);
    for (int i = 0; i < 16; i++) {
      const float right = float(i % 4 * 16), down = float(i / 4 * 16);
      const KeyBounds b = all[0].kernels->bounds(d, kind, {first.x0 + right, first.y0 + down, first.x1 + right, first.y1 + down});
      for (int k = 0; k < 2; k++) ASSERT_TRUE(low[k][i] == b.low && high[k][i] == b.high) << "square " << i;
      const Outcome expected = compareBounds(op, b, {storedLow[i], storedHigh[i]});
      for (int k = 0; k < 2; k++) {
        ASSERT_EQ(outcomes[k].fails >> i & 1, uint32_t(expected == Outcome::Fails)) << "compare " << op << ", square " << i;
        ASSERT_EQ(outcomes[k].passes >> i & 1, uint32_t(expected == Outcome::Passes)) << "compare " << op << ", square " << i;
      }
    }
  }
}

TEST(DepthBlock, BoundsAreThoseOfTheValues) {
  const DepthKernels& kernels = depthKernels();
  std::mt19937 random(8);
  for (int round = 0; round < 5000; round++) {
    const DepthKind kind = kKinds[random() % 3];
    const DepthEquation d = randomEquation(random);
    if (!d.tame()) continue;
    const float x = float(random() % 16 * 4) + 0.5f, y = float(random() % 16 * 4) + 0.5f;
    std::byte memory[64];
    kernels.write(d, kind, x, y, memory);
    float low = std::numeric_limits<float>::infinity(), high = -low;
    for (uint32_t i = 0; i < 16; i++) {
      uint32_t word = 0;
      std::memcpy(&word, memory + i * depthBytes(kind), depthBytes(kind));
      low = std::min(low, depthKey(kind, word));
      high = std::max(high, depthKey(kind, word));
    }
    const KeyBounds bounds = kernels.bounds(d, kind, {x, y, x + 3, y + 3});
    ASSERT_EQ(bounds.low, low) << "round " << round;
    ASSERT_EQ(bounds.high, high) << "round " << round;
    // What bounds decide is what each sample says.
    for (uint32_t op = 0; op < 8; op++) {
      std::byte stored[64];
      randomMemory(random, kind, stored);
      KeyBounds there, after;
      DepthEquation nothing = d;
      const float zero = 0;
      const uint16_t none = 0, every = 0xffff;
      uint16_t passed = 1;
      kernels.test(nothing, kind, VK_COMPARE_OP_NEVER, false, {1, &zero, &zero, x, y, stored, 0}, &none, &passed, there);
      EXPECT_EQ(passed, 0u);
      const Outcome outcome = compareBounds(VkCompareOp(op), bounds, there);
      kernels.test(d, kind, VkCompareOp(op), true, {1, &zero, &zero, x, y, stored, 0}, &every, &passed, after);
      if (outcome == Outcome::Fails) { EXPECT_EQ(passed, 0u) << "compare " << op; }
      if (outcome == Outcome::Passes) { EXPECT_EQ(passed, 0xffffu) << "compare " << op; }
    }
  }
}

}  // namespace
}  // namespace pumice::raster
