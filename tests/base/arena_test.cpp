#include "base/arena.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

namespace pumice::base {
namespace {

bool aligned(const void* pointer, size_t alignment) {
  return reinterpret_cast<uintptr_t>(pointer) % alignment == 0;
}

TEST(Arena, PiecesAreAlignedAndDoNotOverlap) {
  Arena arena(256);
  std::vector<std::pair<uint8_t*, size_t>> pieces;
  for (size_t i = 0; i < 500; i++) {
    size_t size = i % 97;
    size_t alignment = size_t(1) << (i % 8);
    auto* piece = static_cast<uint8_t*>(arena.allocBytes(size, alignment));
    ASSERT_NE(piece, nullptr);
    ASSERT_TRUE(aligned(piece, alignment));
    std::memset(piece, int(i & 255), size);
    pieces.push_back({piece, size});
  }
  for (size_t i = 0; i < pieces.size(); i++)
    for (size_t k = 0; k < pieces[i].second; k++) ASSERT_EQ(pieces[i].first[k], uint8_t(i));
}

TEST(Arena, LargePiecesAndLargeAlignmentsFit) {
  Arena arena(128);
  auto* large = arena.alloc<double>(100000, 64);
  ASSERT_TRUE(large && aligned(large, 64));
  large[99999] = 1;
  EXPECT_TRUE(aligned(arena.alloc<char>(1, Arena::kMaxAlignment), Arena::kMaxAlignment));
}

TEST(Arena, ResetUsesTheSameMemoryAgain) {
  Arena arena(1024);
  auto fill = [&] {
    for (int i = 0; i < 1000; i++) ASSERT_NE(arena.alloc<uint64_t>(i % 50 + 1), nullptr);
    ASSERT_NE(arena.alloc<char>(300000), nullptr);
  };
  fill();
  size_t footprint = arena.footprint();
  for (int round = 0; round < 20; round++) {
    arena.reset();
    fill();
  }
  EXPECT_EQ(arena.footprint(), footprint);
  arena.release();
  EXPECT_EQ(arena.footprint(), 0u);
  fill();
}

TEST(Arena, ObjectsAreMadeAndCopied) {
  struct Node {
    int value;
    Node* next = nullptr;
  };
  Arena arena;
  Node* first = arena.make<Node>(1);
  Node* second = arena.make<Node>(2, first);
  EXPECT_EQ(second->next->value, 1);
  Node* many = arena.alloc<Node>(3);
  EXPECT_EQ(many[2].next, nullptr);
  int numbers[] = {4, 5, 6};
  auto copy = arena.copy(std::span<const int>(numbers));
  numbers[0] = 0;
  EXPECT_EQ(copy[0], 4);
  std::string_view text = arena.copyString(std::string("words"));
  EXPECT_EQ(text, "words");
  EXPECT_EQ(text.data()[5], 0);
}

TEST(Arena, MovesWithItsContents) {
  Arena first;
  int* number = first.make<int>(42);
  Arena second(std::move(first));
  EXPECT_EQ(*number, 42);
  EXPECT_EQ(first.footprint(), 0u);
  ASSERT_NE(first.alloc<int>(), nullptr);
  first = std::move(second);
  EXPECT_EQ(*number, 42);
}

TEST(Arena, ImpossibleSizesGiveNull) {
  Arena arena;
  EXPECT_EQ(arena.alloc<uint64_t>(std::numeric_limits<size_t>::max() / 4), nullptr);
  EXPECT_EQ(arena.allocBytes(std::numeric_limits<size_t>::max() - 8), nullptr);
  EXPECT_NE(arena.alloc<int>(), nullptr);
}

}  // namespace
}  // namespace pumice::base
