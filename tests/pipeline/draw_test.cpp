// Whole draws: coverage, order, threads, clears, indices.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

using Rgba = std::array<uint8_t, 4>;

TEST(Draw, TriangleCoversExactlyThePixelsWhoseCentresAreInsideAndInterpolatesColours) {
  Scene s(100, 80);
  auto d = s.drawState(s.pipeline(s.state()));
  auto v = triangle(s, {10.3f, 5.6f, 90.2f, 20.1f, 30.7f, 70.9f}, 0.5f, {1, 1, 1, 1});
  const float colors[3][4] = {{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 1}};
  for (int i = 0; i < 3; ++i) std::copy(colors[i], colors[i] + 4, v[i].color);
  s.begin(0, 0, 0, 0.5f);
  s.draw(d, v);
  s.end();

  const double x[3] = {10.3, 90.2, 30.7}, y[3] = {5.6, 20.1, 70.9};
  const auto edge = [&](int a, int b, double px, double py) { return (x[b] - x[a]) * (py - y[a]) - (y[b] - y[a]) * (px - x[a]); };
  const double area = edge(0, 1, x[2], y[2]);
  int covered = 0;
  for (uint32_t py = 0; py < s.height; ++py)
    for (uint32_t px = 0; px < s.width; ++px) {
      const double cx = px + 0.5, cy = py + 0.5;
      double w[3] = {edge(1, 2, cx, cy) / area, edge(2, 0, cx, cy) / area, edge(0, 1, cx, cy) / area};
      const double nearest = std::min({w[0], w[1], w[2]});
      if (std::abs(nearest) < 0.001) continue;   // snapping to 1/256 pixel decides
      const Rgba c = s.color.rgba(px, py);
      if (nearest < 0) {
        ASSERT_EQ(c, (Rgba{0, 0, 0, 128})) << px << ", " << py;
        continue;
      }
      ++covered;
      for (int i = 0; i < 3; ++i) ASSERT_NEAR(c[i], w[i] * 255, 1.01) << px << ", " << py;
      ASSERT_EQ(c[3], 255);
    }
  EXPECT_GT(covered, 2000);
  EXPECT_EQ(s.executor.counters().draws, 1u);
  EXPECT_GE(s.executor.counters().fragmentsCovered, uint64_t(covered));
}

TEST(Draw, PerspectiveIsCorrected) {
  // A rectangle whose right edge is four times as far away: 1/w is linear on the screen, colour/w too.
  Scene s(64, 64);
  auto d = s.drawState(s.pipeline(s.state()));
  std::vector<ColorVertex> v;
  const float w1 = 4;
  const auto at = [&](float x, float y) {
    const float w = x > 0 ? w1 : 1;
    v.push_back({{x * w, y * w, 0.5f * w, w}, {x > 0 ? 1.f : 0.f, 0, 0, 1}});
  };
  for (auto [x, y] : {std::pair{-1.f, -1.f}, {1.f, -1.f}, {-1.f, 1.f}, {1.f, -1.f}, {1.f, 1.f}, {-1.f, 1.f}}) at(x, y);
  s.begin();
  s.draw(d, v);
  s.end();
  for (uint32_t px = 0; px < 64; ++px) {
    const double t = (px + 0.5) / 64;
    const double expected = (t / w1) / ((1 - t) + t / w1) * 255;
    EXPECT_NEAR(s.color.rgba(px, 20)[0], expected, 1.01) << px;
    EXPECT_NEAR(s.color.rgba(px, 50)[0], expected, 1.01) << px;
  }
}

TEST(Draw, OverlappingPrimitivesOfOneDrawBlendInOrder) {
  Scene s(64, 64);
  GraphicsState state = s.state();
  auto& b = state.blend[0];
  b.blendEnable = true;
  b.srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
  b.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  b.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  b.dstAlphaBlendFactor = VK_BLEND_FACTOR_ZERO;
  auto d = s.drawState(s.pipeline(state));
  std::vector<ColorVertex> v;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0, 1);
  double expected[3] = {0, 0, 0};
  for (int i = 0; i < 40; ++i) {
    const std::array<float, 4> c{unit(random), unit(random), unit(random), 0.25f + 0.5f * unit(random)};
    const auto r = rectangle(s, 8, 8, 12, 12, 0.5f, c);   // four pixels wide: many primitives would fit into one row of lanes
    v.insert(v.end(), r.begin(), r.end());
    for (int k = 0; k < 3; ++k) expected[k] = std::nearbyint(255 * (c[k] * c[3] + expected[k] / 255 * (1 - c[3])));
  }
  s.begin(0, 0, 0, 0);
  s.draw(d, v);
  s.end();
  for (uint32_t y = 8; y < 12; ++y)
    for (uint32_t x = 8; x < 12; ++x)
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(s.color.rgba(x, y)[k], expected[k], 1.01) << x << ", " << y;
  EXPECT_EQ(s.color.rgba(7, 8), (Rgba{0, 0, 0, 0}));
  EXPECT_EQ(s.color.rgba(12, 11), (Rgba{0, 0, 0, 0}));
}

std::vector<std::byte> manyTriangles(unsigned threads, int passes = 1) {
  Scene s(200, 150, VK_FORMAT_D32_SFLOAT, threads);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS_OR_EQUAL;
  auto opaque = s.drawState(s.pipeline(state));
  state.depthWrite = false;
  state.blend[0].blendEnable = true;
  state.blend[0].srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
  state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  auto blended = s.drawState(s.pipeline(state));
  std::vector<std::byte> bytes;
  for (int pass = 0; pass < passes; ++pass) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> unit(0, 1);
    s.begin(0.2f, 0.3f, 0.4f, 1);
    for (int draw = 0; draw < 6; ++draw) {
      std::vector<ColorVertex> v;
      for (int i = 0; i < 700; ++i) {
        const float x = unit(random) * 220 - 10, y = unit(random) * 170 - 10, size = 5 + 40 * unit(random) * unit(random);
        auto t = triangle(s, {x, y, x + size * unit(random), y + size, x - size, y + size * unit(random)}, unit(random),
                          {unit(random), unit(random), unit(random), unit(random)});
        v.insert(v.end(), t.begin(), t.end());
      }
      s.draw(draw & 1 ? blended : opaque, v);
    }
    s.end();
  }
  bytes = s.color.bytes;
  bytes.insert(bytes.end(), s.depth->bytes.begin(), s.depth->bytes.end());
  // The images start at the next multiple of 64: compare elements, not slack.
  std::vector<std::byte> pixels;
  for (uint32_t y = 0; y < s.height; ++y)
    for (uint32_t x = 0; x < s.width; ++x) {
      const auto c = s.color.at<std::array<std::byte, 4>>(x, y);
      const auto z = s.depth->at<std::array<std::byte, 4>>(x, y, VK_IMAGE_ASPECT_DEPTH_BIT);
      pixels.insert(pixels.end(), c.begin(), c.end());
      pixels.insert(pixels.end(), z.begin(), z.end());
    }
  return pixels;
}

TEST(Draw, AnyNumberOfThreadsGivesTheSameBytes) {
  const auto one = manyTriangles(1);
  EXPECT_EQ(one, manyTriangles(2));
  EXPECT_EQ(one, manyTriangles(4));
}

TEST(Draw, AnExecutorCanBeUsedAgain) { EXPECT_EQ(manyTriangles(2), manyTriangles(2, 3)); }

TEST(Draw, ClearInThePassTakesItsPlaceAmongTheDraws) {
  Scene s(150, 70);
  auto d = s.drawState(s.pipeline(s.state()));
  s.begin(0, 0, 0, 1);
  s.draw(d, rectangle(s, 0, 0, 150, 70, 0.5f, {1, 0, 0, 1}));
  VkClearAttachment c{};
  c.aspectMask = VK_IMAGE_ASPECT_COLOR_BIT;
  c.clearValue.color = {{0, 0, 1, 1}};
  s.executor.clear(c, {{{10, 10}, {100, 50}}, 0, 1});
  s.draw(d, rectangle(s, 20, 20, 30, 30, 0.5f, {0, 1, 0, 1}));
  s.end();
  EXPECT_EQ(s.color.rgba(5, 5), (Rgba{255, 0, 0, 255}));
  EXPECT_EQ(s.color.rgba(10, 10), (Rgba{0, 0, 255, 255}));
  EXPECT_EQ(s.color.rgba(109, 59), (Rgba{0, 0, 255, 255}));
  EXPECT_EQ(s.color.rgba(110, 59), (Rgba{255, 0, 0, 255}));
  EXPECT_EQ(s.color.rgba(109, 60), (Rgba{255, 0, 0, 255}));
  EXPECT_EQ(s.color.rgba(25, 25), (Rgba{0, 255, 0, 255}));
}

TEST(Draw, NothingOutsideScissorAndRenderAreaChanges) {
  Scene s(100, 100);
  auto d = s.drawState(s.pipeline(s.state()));
  s.begin(0.5f, 0.5f, 0.5f, 1);
  s.end();
  s.begin(0, 0, 0, 1);
  s.pass.renderArea = {{17, 9}, {70, 80}};
  s.executor.begin(s.pass);
  d.scissor = {{10, 20}, {50, 200}};
  s.draw(d, rectangle(s, 0, 0, 100, 100, 0.5f, {1, 1, 1, 1}));
  s.end();
  for (uint32_t y = 0; y < 100; ++y)
    for (uint32_t x = 0; x < 100; ++x) {
      const bool area = x >= 17 && x < 87 && y >= 9 && y < 89, scissor = x >= 10 && x < 60 && y >= 20;
      const uint8_t expected = !area ? 128 : scissor ? 255 : 0;
      ASSERT_EQ(s.color.rgba(x, y)[0], expected) << x << ", " << y;
    }
}

//! A state in which the order of primitives shows.
GraphicsState blending(const Scene& s) {
  GraphicsState state = s.state();
  auto& b = state.blend[0];
  b.blendEnable = true;
  b.srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
  b.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  return state;
}

// Small draws are worked on many at a time, by all threads.
TEST(Draw, ThousandsOfSmallDrawsAreAsOneLargeOne) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<std::vector<ColorVertex>> triangles;
  Scene once(96, 80), many(96, 80, VK_FORMAT_UNDEFINED, 3);
  for (int i = 0; i < 5000; ++i) {
    const float x = unit(random) * 96, y = unit(random) * 80, size = 4 + 30 * unit(random);
    triangles.push_back(triangle(once, {x, y, x + size, y + size * unit(random), x - size * unit(random), y + size}, 0.5f,
                                 {unit(random), unit(random), unit(random), unit(random)}));
  }
  VkClearAttachment clear{};
  clear.aspectMask = VK_IMAGE_ASPECT_COLOR_BIT;
  clear.clearValue.color = {{0.25f, 0.5f, 0.75f, 1}};
  const VkClearRect rect{{{30, 20}, {40, 50}}, 0, 1};
  // In one draw, but for the clear after 900 triangles
  auto d = once.drawState(once.pipeline(blending(once)));
  std::vector<ColorVertex> before, after;
  for (size_t i = 0; i < triangles.size(); ++i) (i < 900 ? before : after).insert((i < 900 ? before : after).end(), triangles[i].begin(), triangles[i].end());
  once.begin(0, 0, 0, 1);
  once.draw(d, before);
  once.executor.clear(clear, rect);
  once.draw(d, after);
  once.end();
  // One by one
  d = many.drawState(many.pipeline(blending(many)));
  many.begin(0, 0, 0, 1);
  for (size_t i = 0; i < triangles.size(); ++i) {
    if (i == 900) many.executor.clear(clear, rect);
    many.draw(d, triangles[i]);
  }
  many.end();
  EXPECT_EQ(many.executor.counters().draws, triangles.size());
  EXPECT_EQ(many.executor.counters().primitives, once.executor.counters().primitives);
  for (uint32_t y = 0; y < 80; ++y)
    for (uint32_t x = 0; x < 96; ++x) ASSERT_EQ(many.color.rgba(x, y), once.color.rgba(x, y)) << x << ", " << y;
}

TEST(Draw, ThatDiscardsItsPrimitivesLeavesThoseBeforeIt) {
  Scene s(64, 64);
  auto d = s.drawState(s.pipeline(s.state()));
  GraphicsState state = s.state();
  state.rasterizerDiscard = true;
  auto discarded = s.drawState(s.pipeline(state));
  PipelineStatistics counted;
  s.begin(0, 0, 0, 1);
  s.draw(d, rectangle(s, 0, 0, 64, 64, 0.5f, {1, 0, 0, 1}));
  s.executor.beginStatistics(&counted);
  s.draw(discarded, rectangle(s, 0, 0, 64, 64, 0.5f, {0, 1, 0, 1}));
  s.executor.endStatistics();
  s.end();
  EXPECT_EQ(s.color.rgba(10, 10), (Rgba{255, 0, 0, 255}));
  EXPECT_EQ(counted.values[PipelineStatistics::VertexInvocations], 6u);
  EXPECT_EQ(s.executor.counters().primitives, 2u);
}

}  // namespace
}  // namespace pumice::pipeline::test
