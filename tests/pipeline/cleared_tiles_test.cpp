// Tiles that a pass only clears may be marked instead of written: what is marked and what is in memory together is the same picture.
#include "texture/cleared.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/ideas.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

constexpr uint32_t kWidth = 200, kHeight = 130;   // 4x3 tiles
using Pixel = std::array<uint8_t, 4>;

struct Marked : Scene {
  texture::ClearedTiles cleared{kWidth, kHeight};
  explicit Marked(unsigned threads) : Scene(kWidth, kHeight, VK_FORMAT_UNDEFINED, threads) {
    begin();   // fills in `pass`
    end();
    std::fill(color.bytes.begin(), color.bytes.end(), std::byte(0xaa));
  }
  void start(bool marks, std::array<float, 4> ground, VkAttachmentLoadOp load = VK_ATTACHMENT_LOAD_OP_CLEAR) {
    pass.color[0].memory.cleared = marks ? &cleared : nullptr;
    pass.color[0].loadOp = load;
    std::copy(ground.begin(), ground.end(), pass.color[0].clear.color.float32);
    executor.begin(pass);
  }
  size_t marks() const { return size_t(std::count(cleared.marks.begin(), cleared.marks.end(), 1)); }
  std::vector<Pixel> picture() {
    std::vector<Pixel> p;
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) p.push_back(color.rgba(x, y));
    return p;
  }
};

TEST(ClearedTiles, AreMarkedWhereNothingIsDrawnAndWrittenWhenAsked) {
  Marked s(2);
  auto d = s.drawState(s.pipeline(s.state()));
  s.start(true, {1, 0, 0, 1});
  s.draw(d, rectangle(s, 70, 10, 90, 30, 0.5f, {0, 1, 0, 1}));
  s.end();
  EXPECT_EQ(s.marks(), 11u);
  EXPECT_EQ(s.color.rgba(0, 0), (Pixel{0xaa, 0xaa, 0xaa, 0xaa}));   // known, not written
  EXPECT_EQ(s.color.rgba(64, 0), (Pixel{255, 0, 0, 255}));
  EXPECT_EQ(s.color.rgba(80, 20), (Pixel{0, 255, 0, 255}));
  texture::writeCleared(s.pass.color[0].memory);
  EXPECT_EQ(s.marks(), 0u);
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x)
      ASSERT_EQ(s.color.rgba(x, y), (x >= 70 && x < 90 && y >= 10 && y < 30 ? Pixel{0, 255, 0, 255} : Pixel{255, 0, 0, 255})) << x << " " << y;
}

TEST(ClearedTiles, AreForgottenByTheNextWholeClearAndWrittenBeforeAnyOtherPass) {
  Marked s(1);
  s.start(true, {1, 0, 0, 1});
  s.end();
  EXPECT_EQ(s.marks(), 12u);
  s.start(true, {0, 0, 1, 1});
  s.end();
  EXPECT_EQ(s.marks(), 12u);
  s.pass.renderArea = {{10, 10}, {20, 20}};
  s.start(true, {0, 1, 0, 1});
  s.end();
  EXPECT_EQ(s.marks(), 0u);
  EXPECT_EQ(s.color.rgba(15, 15), (Pixel{0, 255, 0, 255}));
  EXPECT_EQ(s.color.rgba(199, 129), (Pixel{0, 0, 255, 255}));
  s.pass.renderArea = {{0, 0}, {kWidth, kHeight}};
  s.start(true, {1, 1, 1, 1});
  s.end();
  s.start(true, {}, VK_ATTACHMENT_LOAD_OP_LOAD);
  EXPECT_EQ(s.marks(), 0u);
  s.end();
  EXPECT_EQ(s.color.rgba(15, 15), (Pixel{255, 255, 255, 255}));
  s.executor.disable(bit(Idea::LazyClear));
  s.start(true, {1, 0, 0, 1});
  s.end();
  EXPECT_EQ(s.marks(), 0u);
  EXPECT_EQ(s.color.rgba(199, 129), (Pixel{255, 0, 0, 255}));
}

// Tiles are then finished more than once, and drawn to after they were marked.
TEST(ClearedTiles, PassesThatOverflowTheirBinsDrawOverThem) {
  std::vector<Pixel> pictures[2];
  int times = 0;   // until the pass has finished tiles once
  for (bool marks : {true, false}) {
    Marked s(2);
    auto state = s.state();
    state.blend[0].blendEnable = true;
    state.blend[0].srcColorBlendFactor = state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
    auto d = s.drawState(s.pipeline(state));
    std::vector<ColorVertex> dust;
    for (int i = 0; i < 500000; ++i) {
      const auto t = triangle(s, {1, 1, 4, 1, 1, 4}, 0.5f, {1, 0, 0, 0.5f});
      dust.insert(dust.end(), t.begin(), t.end());
    }
    s.start(marks, {0.25f, 0.5f, 0.75f, 1});
    if (marks) {
      for (; times < 8 && !s.marks(); ++times) s.draw(d, dust);
      ASSERT_EQ(s.marks(), 11u);
    } else {
      for (int i = 0; i < times; ++i) s.draw(d, dust);
    }
    s.draw(d, triangle(s, {70, 30, 150, 35, 100, 100}, 0.5f, {1, 0.5f, 0.75f, 0.5f}));
    s.end();
    if (marks) texture::writeCleared(s.pass.color[0].memory);
    pictures[marks] = s.picture();
  }
  EXPECT_TRUE(pictures[0] == pictures[1]);
}

}  // namespace
}  // namespace pumice::pipeline::test
