#include "base/hash.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <vector>

namespace pumice::base {
namespace {

TEST(Hash, EveryByteAndTheSeedCount) {
  std::vector<uint8_t> bytes(200, 0);
  std::set<uint64_t> seen;
  size_t made = 0;
  for (size_t i = 0; i < bytes.size(); i++) {
    for (int bit = 0; bit < 8; bit++) {
      bytes[i] = uint8_t(1 << bit);
      seen.insert(hashBytes(bytes.data(), bytes.size()));
      made++;
    }
    bytes[i] = 0;
  }
  for (size_t size = 0; size <= bytes.size(); size++, made++) seen.insert(hashBytes(bytes.data(), size));
  seen.insert(hashBytes(bytes.data(), bytes.size(), 1));
  EXPECT_EQ(seen.size(), made + 1);
}

TEST(Hash, EqualObjectsHaveEqualHashes) {
  struct Key {
    uint32_t a, b;
  };
  EXPECT_EQ(hashObject(Key{1, 2}), hashObject(Key{1, 2}));
  EXPECT_NE(hashObject(Key{1, 2}), hashObject(Key{2, 1}));
  std::array<uint32_t, 2> words{1, 2};
  EXPECT_EQ(hashSpan(std::span<const uint32_t>(words)), hashObject(Key{1, 2}));
}

TEST(Hash, CombineKeepsTheOrder) {
  EXPECT_NE(hashCombine(1, 2), hashCombine(2, 1));
  EXPECT_NE(hashCombine(0, 0), 0u);
  std::set<uint64_t> seen;
  for (uint64_t i = 0; i < 100; i++)
    for (uint64_t j = 0; j < 100; j++) seen.insert(hashCombine(i, j));
  EXPECT_EQ(seen.size(), 10000u);
}

}  // namespace
}  // namespace pumice::base
