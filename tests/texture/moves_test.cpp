// Copies and fills of bytes: every alignment and many lengths, on both sides of what the vector loops take at a time.
#include "texture/moves.h"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace pumice::texture {
namespace {

constexpr std::byte kUntouched{0xee};
constexpr Store kStores[] = {Store::kCached, Store::kStream};

TEST(Moves, CopiesExactlyTheBytesOfEveryAlignmentAndLength) {
  std::vector<std::byte> source(2048);
  for (size_t i = 0; i < source.size(); ++i) source[i] = std::byte(i * 7 + i / 256);
  for (Store store : kStores)
    for (uint64_t from : {0, 1, 8, 15})
      for (uint64_t to = 0; to < 17; ++to)
        for (uint64_t bytes : {0, 1, 15, 64, 255, 256, 257, 271, 272, 320, 511, 1024, 1337}) {
          std::vector<std::byte> out(2048, kUntouched), expected = out;
          std::memcpy(expected.data() + to, source.data() + from, bytes);
          copyBytes(out.data() + to, source.data() + from, bytes, store);
          ASSERT_EQ(out, expected) << "from " << from << " to " << to << ", " << bytes << " bytes, store " << int(store);
        }
}

TEST(Moves, FillsRepeatThePatternFromTheStart) {
  std::byte pattern[32];
  for (int i = 0; i < 32; ++i) pattern[i] = std::byte(i + 1);
  for (Store store : kStores)
    for (uint64_t to = 0; to < 17; ++to)
      for (uint64_t bytes : {0, 1, 31, 32, 33, 63, 64, 65, 96, 127, 128, 160, 1000}) {
        std::vector<std::byte> out(1200, kUntouched), expected = out;
        for (uint64_t i = 0; i < bytes; ++i) expected[to + i] = pattern[i % 32];
        fillBytes(out.data() + to, bytes, pattern, store);
        ASSERT_EQ(out, expected) << "to " << to << ", " << bytes << " bytes, store " << int(store);
      }
}

}  // namespace
}  // namespace pumice::texture
