#include <algorithm>

#include "raster_fixture.h"

namespace pumice::raster::test {
namespace {

constexpr uint32_t kSize = 64;

Draw drawOf(VkPrimitiveTopology topology) {
  Draw draw(kSize, kSize);
  draw.state.topology = topology;
  return draw;
}

TEST(Lines, EveryColumnOfAFlatLineGetsOnePixelInEitherDirection) {
  std::mt19937 random(41);
  for (int i = 0; i < 300; i++) {
    Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_LINE_LIST);
    draw.state.lineMode = LineMode::Bresenham;
    const bool steep = i & 1, back = i & 2;
    const double from = 4.25, to = 59.75, a = 8 + random() % 40, b = a + double(random() % 8);
    const std::array<double, 2> one{from, a}, two{to, b};
    for (const auto& p : back ? std::array{two, one} : std::array{one, two}) steep ? draw.addPixel(p[1], p[0]) : draw.addPixel(p[0], p[1]);
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    // Centres 4.5 to 59.5.
    EXPECT_EQ(picture.total(), 56u);
    for (uint32_t k = 0; k < kSize; k++) {
      uint32_t sum = 0;
      for (uint32_t j = 0; j < kSize; j++) sum += steep ? picture.at(j, k) : picture.at(k, j);
      ASSERT_EQ(sum, k >= 4 && k <= 59 ? 1u : 0u);
    }
  }
}

// A pixel is drawn when the segment enters its diamond and does not end there.
TEST(Lines, BresenhamIsTheDiamondExitRule) {
  std::mt19937 random(42);
  uint32_t drawn = 0, unsure = 0;
  for (int i = 0; i < 2000; i++) {
    double x[2], y[2];
    for (int e = 0; e < 2; e++) {
      // Half of them are shorter than three pixels.
      const double reach = e && i & 1 ? 3 * 256 : 60 * 256;
      x[e] = (e && i & 1 ? x[0] - 1.5 : 2) + double(random() % int(reach)) / 256;
      y[e] = (e && i & 1 ? y[0] - 1.5 : 2) + double(random() % int(reach)) / 256;
    }
    Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_LINE_LIST);
    draw.state.lineMode = LineMode::Bresenham;
    for (int e = 0; e < 2; e++) draw.addPixel(x[e], y[e]);
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    for (uint32_t py = 0; py < kSize; py++)
      for (uint32_t px = 0; px < kSize; px++) {
        const double mx = px + 0.5, my = py + 0.5, dx = x[1] - x[0], dy = y[1] - y[0];
        const auto distance = [&](double t) { return std::abs(x[0] + t * dx - mx) + std::abs(y[0] + t * dy - my); };
        // Piecewise linear in t: the smallest is at an end or where it bends.
        double least = std::min(distance(0), distance(1));
        if (dx != 0) least = std::min(least, distance(std::clamp((mx - x[0]) / dx, 0.0, 1.0)));
        if (dy != 0) least = std::min(least, distance(std::clamp((my - y[0]) / dy, 0.0, 1.0)));
        if (std::abs(least - 0.5) < 1e-9 || std::abs(distance(1) - 0.5) < 1e-9) {
          unsure++;
          continue;
        }
        const bool expected = least < 0.5 && distance(1) > 0.5;
        drawn += expected;
        ASSERT_EQ(picture.at(px, py), expected ? 1 : 0) << "pixel " << px << ", " << py << " of (" << x[0] << ", " << y[0] << ") to (" << x[1] << ", " << y[1] << ")";
      }
  }
  EXPECT_GT(drawn, 20000u);
  EXPECT_LT(unsure, 2000u);
}

TEST(Lines, BresenhamCoversAllSamplesOfAPixelOrNone) {
  std::mt19937 random(43);
  for (uint32_t samples : {2u, 4u, 8u, 16u})
    for (int i = 0; i < 50; i++) {
      std::array<double, 4> at;
      for (double& v : at) v = double(random() % (80 * 256)) / 256 - 8;
      auto drawn = [&](uint32_t count) {
        Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_LINE_LIST);
        draw.state.lineMode = LineMode::Bresenham;
        draw.state.samples = count;
        draw.state.lineWidth = float(1 + i % 3);
        draw.addPixel(at[0], at[1]);
        draw.addPixel(at[2], at[3]);
        draw.setup();
        Picture picture(kSize, kSize, count);
        picture.draw(draw);
        return picture;
      };
      Picture one = drawn(1), many = drawn(samples);
      for (uint32_t y = 0; y < kSize; y++)
        for (uint32_t x = 0; x < kSize; x++)
          for (uint32_t s = 0; s < samples; s++) ASSERT_EQ(many.at(x, y, s), one.at(x, y)) << samples << " samples, " << x << ", " << y;
    }
}

TEST(Lines, StripsDrawTheirInnerVerticesOnce) {
  Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_LINE_STRIP);
  draw.state.lineMode = LineMode::Bresenham;
  draw.addPixel(4.5, 10.5);
  draw.addPixel(20.5, 10.5);
  draw.addPixel(40.5, 10.5);
  draw.setup();
  ASSERT_EQ(draw.primitives.size(), 2u);
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  for (uint32_t x = 4; x < 40; x++) EXPECT_EQ(picture.at(x, 10), 1) << x;
  EXPECT_EQ(picture.total(), 36u);
}

TEST(Lines, AreClippedToTheViewVolumeAndKeepTheirValues) {
  Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_LINE_LIST);
  draw.varyings = {{4, VaryingMode::Perspective}, {4, VaryingMode::Linear}};
  draw.add({-3, 0.1f, 0, 1}, {0});
  draw.add({3, 0.1f, 0, 1}, {6});
  draw.setup();
  ASSERT_EQ(draw.primitives.size(), 1u);
  for (int plane : {2, 3}) {
    const Plane& p = draw.primitives[0].planes[plane];
    EXPECT_NEAR(p.origin, 2, 1e-9);
    EXPECT_NEAR(p.origin + 64 * p.dx, 4, 1e-9);
    EXPECT_NEAR(p.dy, 0, 1e-9);
  }
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  EXPECT_EQ(picture.total(), 64u);
}

TEST(Lines, WidthCountsPixelsAcross) {
  Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_LINE_LIST);
  draw.state.lineWidth = 5;
  draw.addPixel(10, 30.5);
  draw.addPixel(20, 30.5);
  draw.setup();
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  EXPECT_EQ(picture.total(), 50u);
}

TEST(Points, AreSquaresOfTheirSize) {
  for (int size : {1, 2, 3, 8}) {
    Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_POINT_LIST);
    draw.pointSizeRow = 4;
    draw.varyings = {{4, VaryingMode::Perspective}};
    draw.addPixel(20.5, 30.5, 0.25f, 2, {float(size)});
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    EXPECT_EQ(picture.total(), uint64_t(size * size));
    EXPECT_EQ(picture.at(20, 30), 1);
    const Primitive& p = draw.primitives.at(0);
    EXPECT_TRUE(p.frontFacing);
    EXPECT_EQ(p.planes[0].origin, 0.25);
    EXPECT_EQ(p.planes[1].origin, 0.5);
    EXPECT_EQ(p.planes[2].origin, size / 2.0);
  }
}

TEST(Points, WithTheirCentreOutsideAreDropped) {
  Draw draw = drawOf(VK_PRIMITIVE_TOPOLOGY_POINT_LIST);
  draw.pointSizeRow = 4;
  draw.add({1.01f, 0, 0, 1}, {20});
  draw.add({0, 0, -0.1f, 1}, {20});
  draw.add({0, 0, 0, -1}, {20});
  draw.add({1, 0, 0, 1}, {20});
  draw.setup();
  ASSERT_EQ(draw.primitives.size(), 1u);
  EXPECT_EQ(draw.primitives[0].primitiveId, 3u);
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  EXPECT_EQ(picture.total(), 10u * 20);
}

}  // namespace
}  // namespace pumice::raster::test
