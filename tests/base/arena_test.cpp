#include "base/arena.h"
#include "base/arena_slices.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <string>
#include <thread>
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

// Fills an arena with pieces that say whose they are.
struct Marked {
  Arena arena;
  std::vector<std::span<uint32_t>> pieces;
  uint32_t mark;
  explicit Marked(uint32_t m) : mark(m) {}
  void add(size_t bytes) {
    std::span<uint32_t> piece(arena.alloc<uint32_t>(bytes / 4, 64), bytes / 4);
    std::fill(piece.begin(), piece.end(), mark);
    pieces.push_back(piece);
  }
  bool intact() const {
    for (std::span<uint32_t> piece : pieces)
      for (uint32_t word : piece)
        if (word != mark) return false;
    return true;
  }
  void reset() {
    pieces.clear();
    arena.reset();
  }
};

TEST(Arena, LargeOnesUseWhatOthersHaveGivenBack) {
  trimArenaSlices();
  ASSERT_EQ(arenaSlicesFootprint(), 0u);
  Marked a(1), b(2);
  const auto grow = [](Marked& m) {
    for (int i = 0; i < 150; i++) m.add(64 * 1000);
  };
  grow(a);
  const size_t once = arenaSlicesFootprint();
  EXPECT_GT(once, 6u << 20);
  EXPECT_LT(once, 12u << 20);
  for (int i = 0; i < 3; i++) {
    a.reset();
    EXPECT_LE(a.arena.footprint(), 1u << 20);
    a.add(64 * 1000);   // what is left is still its own
    grow(b);
    EXPECT_TRUE(a.intact());
    EXPECT_TRUE(b.intact());
    b.reset();
    grow(a);
    EXPECT_TRUE(a.intact());
    EXPECT_LE(arenaSlicesFootprint(), once + (2u << 20));
  }
  a.arena.release();
  b.arena.release();
  trimArenaSlices();
  EXPECT_EQ(arenaSlicesFootprint(), 0u);
}

TEST(Arena, ThreadsShareSlicesWithoutSharingContents) {
  std::vector<std::thread> threads;
  for (uint32_t t = 0; t < 4; t++)
    threads.emplace_back([t] {
      std::mt19937 random(t);
      Marked m(t + 1);
      for (int i = 0; i < 1500; i++) {
        m.add(4 * (1 + random() % 20000));
        if (random() % 100) continue;
        ASSERT_TRUE(m.intact());
        if (random() % 2) m.reset();
        else m.pieces.clear(), m.arena.release();
      }
      ASSERT_TRUE(m.intact());
    });
  for (std::thread& t : threads) t.join();
  trimArenaSlices();
  EXPECT_EQ(arenaSlicesFootprint(), 0u);
}

}  // namespace
}  // namespace pumice::base
