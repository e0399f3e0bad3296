// Lists of blocks taken in vectors against blocks taken one by one by functions for any processor: the same depths, winners and counters.
#include <algorithm>
#include <cstring>
#include <tuple>

#include "raster/visibility.h"
#include "raster_fixture.h"

namespace pumice::raster::test {
namespace {

struct Tile {
  Visibility visibility;
  std::vector<uint32_t> memory;
  Tile(bool hiZ, bool vectors, bool squares, uint32_t samples, DepthKind kind, const std::vector<uint32_t>& before)
      : visibility(hiZ, vectors, squares), memory(before) {
    DepthMemory depth;
    depth.base = reinterpret_cast<std::byte*>(memory.data());
    depth.samplePitch = 64 * 64 * 4;
    depth.rowElements = 64 * 4;
    depth.kind = kind;
    visibility.begin(0, 0, samples, depth, true);
  }
};

//! Of each sample: the primitive that won it; in the order of draws.
std::vector<std::tuple<void*, uint32_t, const Primitive*, std::vector<uint16_t>>> winnersOf(Visibility& v, const Visibility::Winners& winners,
                                                                                             uint32_t samples) {
  std::vector<std::tuple<void*, uint32_t, const Primitive*, std::vector<uint16_t>>> all;
  for (const Visibility::Item& item : winners.items)
    for (uint32_t block = item.block; block < uint32_t(item.block) + item.blocks; block++)
      all.push_back({v.entry(item.entry).user, block, v.entry(item.entry).primitive,
                     std::vector<uint16_t>(winners.masks + item.masks, winners.masks + item.masks + samples)});
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end(), [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); }));
  std::sort(all.begin(), all.end());
  return all;
}

//! Random draws into two tiles: one with all there is, the other without vectors, or without squares that are kept as one.
void compare(bool squares) {
  std::mt19937 random(squares ? 22 : 21);
  const auto unit = [&] { return std::uniform_real_distribution<float>(0, 1)(random); };
  uint64_t passed = 0, rejected = 0, failed = 0, whole = 0, hidden = 0;
  for (int round = 0; round < 300; round++) {
    const uint32_t samples = 1u << random() % 5;
    const DepthKind kind = DepthKind(random() % 3);
    const bool hiZ = random() % 4 != 0;
    // Depths that are there before, some of them NaN; or a clear value.
    std::vector<uint32_t> before(64 * 64 * samples);
    for (uint32_t& word : before) {
      const float z = random() % 500 ? unit() : NAN;
      std::memcpy(&word, &z, 4);
      if (kind != DepthKind::Float32) word = random();
    }
    Tile one(hiZ, true, true, samples, kind, before), other(hiZ, squares, !squares, samples, kind, before);
    if (random() % 2) {
      const float clear = unit();
      uint32_t stored = random() & (kind == DepthKind::Unorm16 ? 0xffff : 0xffffff);
      if (kind == DepthKind::Float32) std::memcpy(&stored, &clear, 4);
      for (Tile* t : {&one, &other}) t->visibility.clearDepth({{0, 0}, {64, 64}}, stored);
    }
    // Triangles of all sizes; some leave the range that depth is clamped to, or lie on its ends.
    Draw draw(64, 64);
    draw.state.samples = samples;
    draw.state.depthClampEnable = true;
    const int count = 1 + int(random() % 150);
    for (int i = 0; i < count; i++) {
      const float size = float(1 << random() % (squares ? 10 : 8)), x = unit() * 64, y = unit() * 64, z = unit(), slope = random() % 3 ? 0.01f : random() % 2 ? 0.f : 2.f;
      for (int corner = 0; corner < 3; corner++)
        draw.addPixel(x + (unit() - 0.5f) * size, y + (unit() - 0.5f) * size, random() % 30 ? z + (unit() - 0.5f) * slope : float(random() % 2));
    }
    draw.setup();
    Bins bins{TileGrid(64, 64)};
    for (const Primitive& p : draw.primitives) bins.add(0, p);
    std::vector<bool> wholes(draw.primitives.size());   // some of them said to be so
    for (const BinEntry& e : bins.tile(0)) wholes[size_t(e.primitive - draw.primitives.data())] = e.whole && random() % 2;
    // Some draws of them, each with its own test.
    int user = 0;
    for (size_t i = 0; i < draw.primitives.size();) {
      const DepthTest test{random() % 8 != 0, random() % 4 != 0, random() % 3 ? VK_COMPARE_OP_LESS_OR_EQUAL : VkCompareOp(random() % 8)};
      const bool shaded = random() % 5 != 0;
      const uint32_t mask = random() % 6 ? 0xffff : random();
      const DepthRange clamp = random() % 3 ? DepthRange{0, 1} : DepthRange{0.25f, 0.75f};
      for (Tile* t : {&one, &other}) t->visibility.beginDraw(reinterpret_cast<void*>(size_t(user + 1)), test, shaded);
      user++;
      for (size_t left = 1 + random() % 60; left && i < draw.primitives.size(); left--, i++)
        for (Tile* t : {&one, &other}) t->visibility.draw(draw.primitives[i], clamp, mask, {{0, 0}, {64, 64}}, wholes[i]);
    }
    const VisibilityCounters &a = one.visibility.counters, &b = other.visibility.counters;
    ASSERT_EQ(one.visibility.drawPassed, other.visibility.drawPassed);
    const Visibility::Winners mine = one.visibility.takeWinners(), theirs = other.visibility.takeWinners();
    const auto said = winnersOf(one.visibility, mine, samples), saidToo = winnersOf(other.visibility, theirs, samples);
    ASSERT_EQ(said, saidToo) << "round " << round;
    for (const Visibility::Item& m : mine.items) whole += m.blocks;
    one.visibility.materialise();
    if (round % 2) other.visibility.materialise();
    else other.visibility.storeDepth();
    ASSERT_EQ(std::memcmp(one.memory.data(), other.memory.data(), one.memory.size() * 4), 0) << "round " << round;
    ASSERT_EQ(a.fragments, b.fragments);
    ASSERT_EQ(a.tested, b.tested);
    ASSERT_EQ(a.passed, b.passed);
    ASSERT_EQ(a.rejected, b.rejected);
    ASSERT_EQ(a.hidden, b.hidden);
    passed += a.passed, rejected += a.rejected, failed += a.tested - a.passed, hidden += a.hidden;
  }
  EXPECT_GT(passed, 100000u);
  EXPECT_GT(rejected, 10000u);
  EXPECT_GT(failed - rejected, 10000u);
  EXPECT_GT(whole, 1000u);
  EXPECT_GT(hidden, 10000u);
}

TEST(VisibleBlocks, ListsInVectorsAreAsBlocksOneByOne) { compare(false); }
TEST(VisibleBlocks, SquaresKeptAsOneAreAsBlocksOneByOne) { compare(true); }

}  // namespace
}  // namespace pumice::raster::test
