#include "raster/coverage_box.h"
#include "raster_fixture.h"

namespace pumice::raster::test {
namespace {

using Corners = std::array<std::array<int64_t, 2>, 3>;

constexpr uint32_t kSize = 256;  // a power of two: positions on the grid come through the viewport exactly

Draw drawOf(const Corners& c, uint32_t samples) {
  Draw draw(kSize, kSize);
  draw.state.samples = samples;
  for (const auto& p : c) draw.addPixel(double(p[0]) / 256, double(p[1]) / 256);
  draw.setup();
  return draw;
}

// Compares every sample of the framebuffer (or of the triangle's surroundings) with the exact rule.
void expectExact(const Corners& c, uint32_t samples, const VkRect2D* bounds = nullptr) {
  Draw draw(kSize, kSize);
  draw.state.samples = samples;
  if (bounds) draw.state.bounds = *bounds;
  for (const auto& p : c) draw.addPixel(double(p[0]) / 256, double(p[1]) / 256);
  draw.setup();
  Picture picture(kSize, kSize, samples);
  picture.draw(draw);
  const auto locations = sampleLocations(samples);
  const VkRect2D b = draw.state.bounds;
  for (uint32_t y = 0; y < kSize; y++)
    for (uint32_t x = 0; x < kSize; x++)
      for (uint32_t s = 0; s < samples; s++) {
        const bool allowed = x >= uint32_t(b.offset.x) && x < b.offset.x + b.extent.width && y >= uint32_t(b.offset.y) &&
                             y < b.offset.y + b.extent.height;
        const bool expected = allowed && insideTriangle(c, x * 256 + locations[s][0] * 16, y * 256 + locations[s][1] * 16);
        ASSERT_EQ(picture.at(x, y, s), expected)
            << "pixel " << x << "," << y << " sample " << s << " of (" << c[0][0] << "," << c[0][1] << ") (" << c[1][0] << ","
            << c[1][1] << ") (" << c[2][0] << "," << c[2][1] << ")";
      }
}

Corners randomCorners(std::mt19937& random, int64_t low, int64_t high, int64_t grid) {
  std::uniform_int_distribution<int64_t> place(low / grid, high / grid);
  Corners c;
  for (auto& p : c) p = {place(random) * grid, place(random) * grid};
  return c;
}

constexpr uint32_t kSampleCounts[] = {1, 2, 4, 8, 16};

TEST(Coverage, RandomTrianglesInsideTheFramebufferAreExact) {
  std::mt19937 random(1);
  for (int i = 0; i < 120; i++) expectExact(randomCorners(random, 0, kSize * 256, 1), kSampleCounts[i % 5]);
}

TEST(Coverage, TrianglesOnPixelCentresAndHalfPixelsAreExact) {
  std::mt19937 random(2);
  for (int i = 0; i < 120; i++) expectExact(randomCorners(random, 0, kSize * 256, i & 1 ? 128 : 64), kSampleCounts[i % 5]);
}

TEST(Coverage, SubpixelTrianglesAreExact) {
  std::mt19937 random(3);
  for (int i = 0; i < 150; i++) {
    std::uniform_int_distribution<int64_t> place(0, (kSize - 8) * 256);
    const int64_t x = place(random), y = place(random);
    Corners c = randomCorners(random, 0, 16 << (i % 8), 1);
    for (auto& p : c) p = {p[0] + x, p[1] + y};
    expectExact(c, kSampleCounts[i % 5]);
  }
}

TEST(Coverage, SliversAreExact) {
  std::mt19937 random(4);
  for (int i = 0; i < 120; i++) {
    Corners c = randomCorners(random, 0, kSize * 256, 1);
    std::uniform_int_distribution<int64_t> nudge(-3, 3);
    // The third corner almost on the line of the others.
    c[2] = {(c[0][0] + c[1][0]) / 2 + nudge(random), (c[0][1] + c[1][1]) / 2 + nudge(random)};
    expectExact(c, kSampleCounts[i % 5]);
  }
}

TEST(Coverage, LongEdgesAreExactAtEverySampleCount) {
  // Up to just inside of the guard band: the edges that need 64 bits. Floats hold k * 256 / 256 pixels up to 2^20 exactly
  // as clip coordinates of this viewport, when they are whole pixels.
  std::mt19937 random(5);
  for (int i = 0; i < 150; i++) {
    const int64_t reach = int64_t(1) << (18 + i % 11);  // 2^10 to 2^20 pixels
    Corners c = randomCorners(random, -reach + 512 * 256, reach - 512 * 256, 256);
    expectExact(c, kSampleCounts[i % 5]);
  }
}

TEST(Coverage, ScissorLimitsTheMasks) {
  std::mt19937 random(6);
  std::uniform_int_distribution<int32_t> place(0, kSize - 1);
  for (int i = 0; i < 150; i++) {
    VkRect2D bounds{{place(random), place(random)}, {}};
    bounds.extent.width = uint32_t(place(random)) % (kSize - bounds.offset.x) + 1;
    bounds.extent.height = uint32_t(place(random)) % (kSize - bounds.offset.y) + 1;
    expectExact(randomCorners(random, -64 * 256, (kSize + 64) * 256, 2), kSampleCounts[i % 5], &bounds);
  }
}

TEST(Coverage, RasterizeObeysBoundsTighterThanThePrimitive) {
  Draw draw = drawOf({{{0, 0}, {512 * 256, 0}, {0, 512 * 256}}}, 1);
  Picture picture(kSize, kSize, 1);
  picture.draw(draw.primitives, {{5, 7}, {70, 3}});
  EXPECT_EQ(picture.total(), 70u * 3);
  EXPECT_EQ(picture.at(5, 7), 1);
  EXPECT_EQ(picture.at(74, 9), 1);
}

TEST(Coverage, TopLeftRuleDecidesTies) {
  // A square through pixel centres: left and top sides are in, right and bottom sides are out; either diagonal.
  for (int turned = 0; turned < 2; turned++) {
    const std::array<int64_t, 2> a{10 * 256 + 128, 20 * 256 + 128}, b{14 * 256 + 128, 20 * 256 + 128}, c{14 * 256 + 128, 24 * 256 + 128},
        d{10 * 256 + 128, 24 * 256 + 128};
    Picture picture(kSize, kSize, 1);
    picture.draw(drawOf(turned ? Corners{a, b, d} : Corners{a, b, c}, 1));
    picture.draw(drawOf(turned ? Corners{b, c, d} : Corners{c, d, a}, 1));
    EXPECT_EQ(picture.total(), 16u);
    for (uint32_t y = 20; y < 24; y++)
      for (uint32_t x = 10; x < 14; x++) EXPECT_EQ(picture.at(x, y), 1) << x << "," << y;
  }
}

TEST(Coverage, EveryTriangulationOfAMeshCoversEachSampleOnce) {
  std::mt19937 random(7);
  for (uint32_t samples : kSampleCounts)
    for (int64_t grid : {1, 32, 128}) {
      // A lattice over the whole framebuffer with jittered inner points, each cell cut along a random diagonal.
      constexpr int kCells = 9;
      std::array<std::array<std::array<int64_t, 2>, kCells + 1>, kCells + 1> points;
      for (int y = 0; y <= kCells; y++)
        for (int x = 0; x <= kCells; x++) {
          std::uniform_int_distribution<int64_t> jitter(-6 * 256 / grid, 6 * 256 / grid);
          auto place = [&](int i) { return i == 0 ? 0 : i == kCells ? kSize * 256 : (i * int64_t(kSize) * 256 / kCells + jitter(random) * grid) / grid * grid; };
          points[y][x] = {place(x), place(y)};
        }
      Draw draw(kSize, kSize);
      draw.state.samples = samples;
      auto add = [&](const std::array<int64_t, 2>& p) { draw.addPixel(double(p[0]) / 256, double(p[1]) / 256); };
      for (int y = 0; y < kCells; y++)
        for (int x = 0; x < kCells; x++) {
          const auto &a = points[y][x], &b = points[y][x + 1], &c = points[y + 1][x + 1], &d = points[y + 1][x];
          const bool flip = random() & 1;
          for (const auto& p : flip ? std::array{a, b, c, a, c, d} : std::array{b, d, a, d, b, c}) add(p);
        }
      draw.setup();
      Picture picture(kSize, kSize, samples);
      picture.draw(draw);
      for (size_t i = 0; i < picture.counts.size(); i++) ASSERT_EQ(picture.counts[i], 1) << "sample index " << i;
    }
}

TEST(Coverage, AFanAroundAPixelCentreCoversEachPixelOnce) {
  for (int spokes : {3, 5, 17, 360}) {
    Draw draw(kSize, kSize);
    draw.state.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN;
    draw.addPixel(100.5, 90.5);
    for (int i = 0; i <= spokes; i++)
      draw.addPixel(100.5 + 2000 * std::cos(2 * M_PI * (i % spokes) / spokes), 90.5 + 2000 * std::sin(2 * M_PI * (i % spokes) / spokes));
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    for (size_t i = 0; i < picture.counts.size(); i++) ASSERT_EQ(picture.counts[i], 1);
  }
}

TEST(Coverage, FullScreenTriangleReportsEveryBlockOnce) {
  Draw draw(128, 64);
  draw.add({-1, -1});
  draw.add({3, -1});
  draw.add({-1, 3});
  draw.setup();
  Picture picture(128, 64, 1);
  picture.draw(draw);
  EXPECT_EQ(picture.total(), 128u * 64);
}

TEST(Bins, SayWhichTilesAPrimitiveCoversAsAWhole) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> at(-300, 700);
  uint32_t whole = 0, covered = 0;
  for (int round = 0; round < 300; round++) {
    const uint32_t samples = 1u << random() % 3;
    Draw draw(384, 256);
    draw.state.samples = samples;
    if (random() % 2) draw.state.bounds = {{int32_t(random() % 130), int32_t(random() % 130)}, {64 + random() % 130, 64 + random() % 60}};
    for (int corner = 0; corner < 3; corner++) draw.addPixel(at(random), at(random));
    draw.setup();
    for (const Primitive& p : draw.primitives) {
      Bins bins{TileGrid(384, 256)};
      bins.add(0, p);
      Picture picture(384, 256, samples);
      picture.draw({p}, draw.state.bounds);
      for (uint32_t t = 0; t < bins.grid().count(); t++) {
        uint32_t count = 0;
        for (uint32_t y = 0; y < 64; y++)
          for (uint32_t x = 0; x < 64; x++)
            for (uint32_t s = 0; s < samples; s++) count += picture.at(t % 6 * 64 + x, t / 6 * 64 + y, s);
        const bool all = count == 64 * 64 * samples, said = !bins.tile(t).empty() && bins.tile(t)[0].whole;
        ASSERT_TRUE(all || !said) << "round " << round << ", tile " << t << ": " << count << " samples are covered";
        covered += all && p.maxX - p.minX >= 64;
        whole += said;
      }
    }
  }
  EXPECT_GT(covered, 300u);
  EXPECT_GT(whole, covered * 9 / 10) << "hardly any are left out that an edge touches at a corner";
}

TEST(Bins, LeaveOutTilesBeyondAnEdge) {
  Draw draw(1024, 1024);
  draw.addPixel(0, 0);
  draw.addPixel(1024, 0);
  draw.addPixel(0, 1024);
  draw.setup();
  Bins bins{TileGrid(1024, 1024)};
  EXPECT_TRUE(bins.empty());
  for (const Primitive& p : draw.primitives) bins.add(3, p);
  EXPECT_FALSE(bins.empty());
  EXPECT_EQ(bins.tile(0).size(), 1u);
  EXPECT_EQ(bins.tile(0)[0].draw, 3u);
  EXPECT_EQ(bins.tile(15 * 16 + 15).size(), 0u);
  size_t used = 0;
  for (uint32_t t = 0; t < bins.grid().count(); t++) used += bins.tile(t).size();
  EXPECT_LE(used, 16u * 17 / 2 + 15);
  bins.clear();
  EXPECT_TRUE(bins.empty());
}

//! Whether the primitive's edges let a sample in: the sums of tiles.h, without any short cut.
bool edgesLetIn(const Primitive& p, int64_t x, int64_t y) {
  for (uint32_t k = 0; k < p.edgeCount; k++)
    if (p.edges[k].a * x + p.edges[k].b * y + p.edges[k].c < 0) return false;
  return true;
}

TEST(Coverage, BoxesGiveWhatTheEdgesSay) {
  const CoverBox cover = coverBox();
  if (!cover) GTEST_SKIP() << "this processor has no such function";
  std::mt19937 random(11);
  const auto between = [&](int64_t low, int64_t high) { return std::uniform_int_distribution<int64_t>(low, high)(random); };
  uint32_t covered = 0, refused = 0, whole = 0;
  for (int i = 0; i < 20000; i++) {
    const uint32_t samples = kSampleCounts[random() % 5];
    const auto locations = sampleLocations(samples);
    const int originX = int(between(0, 255)) * 64, originY = int(between(0, 255)) * 64;
    TileBox box;
    box.x0 = int(between(0, 63)), box.y0 = int(between(0, 63));
    box.x1 = std::min<int>(63, std::min<int>((box.x0 & ~3) + 31, box.x0 + int(between(0, 31))));
    box.y1 = std::min<int>(63, std::min<int>((box.y0 & ~3) + 31, box.y0 + int(between(0, 31))));
    // Corners about the box, at all distances; some exactly on sample places. Triangles and parallelograms, turned inside.
    const int64_t reach = int64_t(1) << between(4, i % 4 ? 14 : 28);
    const int64_t atX = (originX + box.x0) * 256, atY = (originY + box.y0) * 256, grid = i % 3 ? 1 : 16;
    std::array<std::array<int64_t, 2>, 4> c;
    for (auto& corner : c) corner = {(atX + between(-reach, reach)) / grid * grid, (atY + between(-reach, reach)) / grid * grid};
    Primitive p;
    p.edgeCount = random() % 4 ? 3 : 4;
    if (p.edgeCount == 4) c[3] = {c[0][0] + c[2][0] - c[1][0], c[0][1] + c[2][1] - c[1][1]};
    const auto cross = [&](int k, int l, int64_t x, int64_t y) {
      return (c[l][0] - c[k][0]) * (y - c[k][1]) - (c[l][1] - c[k][1]) * (x - c[k][0]);
    };
    const int64_t turn = cross(0, 1, c[2][0], c[2][1]) < 0 ? -1 : 1;
    bool fits = true;
    for (uint32_t k = 0; k < p.edgeCount; k++) {
      const auto &from = c[k], &to = c[(k + 1) % p.edgeCount];
      const int64_t a = turn * (from[1] - to[1]), b = turn * (to[0] - from[0]);
      fits &= std::abs(a) < 1 << 30 && std::abs(b) < 1 << 30;
      p.edges[k] = {int32_t(a), int32_t(b), -(a * from[0] + b * from[1]) - int64_t(random() % 2)};
    }
    if (!fits) continue;
    BlockList list;
    list.samples = samples;
    if (!cover(p, originX, originY, box, locations, list)) {
      EXPECT_EQ(list.count, 0u);
      bool isLong = false;
      for (uint32_t k = 0; k < p.edgeCount; k++) isLong |= std::abs(p.edges[k].a) + std::abs(p.edges[k].b) > 1 << 23;
      EXPECT_TRUE(isLong);
      refused++;
      continue;
    }
    std::vector<uint16_t> expected(kBlocksPerTile * samples), found(kBlocksPerTile * samples);
    for (int y = box.y0; y <= box.y1; y++)
      for (int x = box.x0; x <= box.x1; x++)
        for (uint32_t s = 0; s < samples; s++)
          if (edgesLetIn(p, (originX + x) * 256 + locations[s][0] * 16, (originY + y) * 256 + locations[s][1] * 16)) {
            const uint32_t place = (x & 1) | (y & 1) << 1 | (x & 2) << 1 | (y & 2) << 2;
            expected[blockNumber(uint32_t(x), uint32_t(y)) * samples + s] |= uint16_t(1u << place);
            covered++;
          }
    for (uint32_t n = 0; n < list.count; n++) {
      uint32_t any = 0;
      for (uint32_t s = 0; s < samples; s++) {
        uint16_t& f = found[list.numbers[n] * samples + s];
        EXPECT_EQ(f, 0) << "a block comes twice";
        any |= f = list.masks[n * samples + s];
        whole += f == 0xffff;
      }
      EXPECT_NE(any, 0u) << "a block without coverage";
    }
    ASSERT_EQ(found, expected) << "case " << i << ": box " << box.x0 << "," << box.y0 << " to " << box.x1 << "," << box.y1 << " of the tile at " << originX << ","
                               << originY << ", " << samples << " samples";
  }
  EXPECT_GT(covered, 100000u);
  EXPECT_GT(refused, 100u);
  EXPECT_GT(whole, 1000u);
}

}  // namespace
}  // namespace pumice::raster::test
