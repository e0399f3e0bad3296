#include "homogeneous_reference.h"
#include "raster/clip.h"

namespace pumice::raster::test {
namespace {

constexpr uint32_t kSize = 64;

float uniform(std::mt19937& random, float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); }

// Against the homogeneous reference: only pixels within 1/128 pixel of a side may differ.
void expectCoverage(Draw& draw, uint64_t& covered, uint64_t& undecided) {
  draw.setup();
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  const Reference reference(draw, {0, 1, 2});
  if (!reference.valid) return;
  for (uint32_t y = 0; y < kSize; y++)
    for (uint32_t x = 0; x < kSize; x++) {
      const auto d = reference.distance(x + 0.5L, y + 0.5L, draw.state.depthClipEnable);
      covered += picture.at(x, y);
      if (std::fabs(d) < 1 / 128.0L) {
        undecided++;
        ASSERT_LE(picture.at(x, y), 1);
      } else {
        ASSERT_EQ(picture.at(x, y), d > 0 ? 1 : 0) << "pixel " << x << "," << y << " at distance " << double(d);
      }
    }
}

TEST(Clip, TrianglesThroughTheEyePlaneCoverWhatIsInFront) {
  std::mt19937 random(11);
  uint64_t covered = 0, undecided = 0, produced = 0;
  for (int i = 0; i < 500; i++) {
    Draw draw(kSize, kSize);
    draw.state.depthClipEnable = i & 1;
    for (int k = 0; k < 3; k++)
      draw.add({uniform(random, -3, 3), uniform(random, -3, 3), uniform(random, -1, 2), uniform(random, -1.5f, 2.5f)});
    expectCoverage(draw, covered, undecided);
    if (HasFatalFailure()) return;
    produced += draw.primitives.size();
  }
  EXPECT_GT(produced, 300u);
  EXPECT_GT(covered, 30000u);
  EXPECT_LT(undecided, covered / 50);
}

TEST(Clip, TrianglesFarBeyondTheGuardBandKeepTheirEdges) {
  std::mt19937 random(12);
  uint64_t covered = 0, undecided = 0;
  for (int i = 0; i < 400; i++) {
    Draw draw(kSize, kSize);
    draw.state.depthClipEnable = false;
    const float reach = std::ldexp(1.0f, 10 + i % 30);
    for (int k = 0; k < 3; k++)
      draw.add({uniform(random, -reach, reach), uniform(random, -reach, reach), 0.5f, i % 3 ? 1.0f : uniform(random, -1, 1)});
    expectCoverage(draw, covered, undecided);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(covered, 30000u);
}

// A jittered mesh whose cells are cut along random diagonals, as indexed triangles.
template <typename Place>
void addMesh(Draw& draw, std::mt19937& random, int cells, Place&& place) {
  for (int y = 0; y <= cells; y++)
    for (int x = 0; x <= cells; x++) draw.add(place(x, y));
  draw.slots.clear();
  for (int y = 0; y < cells; y++)
    for (int x = 0; x < cells; x++) {
      const uint32_t a = uint32_t(y * (cells + 1) + x), b = a + 1, d = a + uint32_t(cells) + 1, c = d + 1;
      const bool flip = random() & 1, turn = random() & 1;
      std::array<uint32_t, 6> s = flip ? std::array{a, b, c, a, c, d} : std::array{b, d, a, d, b, c};
      if (turn) std::swap(s[1], s[2]);
      draw.slots.insert(draw.slots.end(), s.begin(), s.end());
    }
}

TEST(Clip, AGroundMeshThroughTheEyeCoversEachPixelOnce) {
  std::mt19937 random(13);
  for (int run = 0; run < 40; run++) {
    Draw draw(kSize, kSize);
    draw.state.depthClipEnable = run & 1;
    const float width = std::ldexp(1.0f, 3 + run % 24);   // up to far beyond the guard band
    const float roll = uniform(random, -0.2f, 0.2f);
    addMesh(draw, random, 8, [&](int x, int y) {
      const float jitterX = x % 8 ? uniform(random, -0.3f, 0.3f) : 0, jitterY = y % 8 ? uniform(random, -0.3f, 0.3f) : 0;
      const float across = (float(x) + jitterX - 4) * width, ahead = (float(y) + jitterY - 2) * 10;
      // Looking ahead over ground one unit below; rolled.
      return Position{across - roll, 1 + roll * across, (ahead - 0.001f) * 1.000001f, ahead};
    });
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    uint64_t once = 0;
    for (uint8_t count : picture.counts) {
      ASSERT_LE(count, 1) << "run " << run;
      once += count;
    }
    if (width >= 64) {
      EXPECT_GT(once, kSize * kSize / 4) << "run " << run;
    }
    // Where the ground surely is: no holes either.
    if (width >= 256)
      for (uint32_t y = 0; y < kSize; y++)
        for (uint32_t x = 0; x < kSize; x++) {
          const float across = (float(x) + 0.5f) / kSize * 2 - 1, down = (float(y) + 0.5f) / kSize * 2 - 1;
          // Invert the projection: across = (X - roll) / w, down = (1 + roll * X) / w.
          const float w = (1 + roll * roll) / (down - roll * across), X = across * w + roll;
          if (w > 0.01f && w < 50 && std::fabs(X) < width) {
            ASSERT_EQ(picture.at(x, y), 1) << "run " << run << " " << x << "," << y;
          }
        }
  }
}

TEST(Clip, AMeshThroughNearAndFarPlanesIsCutOnceAndCleanly) {
  std::mt19937 random(14);
  for (int run = 0; run < 20; run++) {
    Draw draw(kSize, kSize);
    // Depth rises to the right from -1 to 2: one third is visible. Slanted so that the cuts cross many edges.
    addMesh(draw, random, 7, [&](int x, int y) {
      const float px = float(x) / 3.5f - 1 + (x % 7 ? uniform(random, -0.05f, 0.05f) : 0);
      const float py = float(y) / 3.5f - 1 + (y % 7 ? uniform(random, -0.05f, 0.05f) : 0);
      const float w = 1.5f + 0.3f * py;
      const float z = 1.5f * px + 0.5f + 0.2f * py;
      return Position{px * w, py * w, z * w, w};
    });
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    for (uint32_t y = 0; y < kSize; y++)
      for (uint32_t x = 0; x < kSize; x++) {
        const double px = (x + 0.5) / kSize * 2 - 1, py = (y + 0.5) / kSize * 2 - 1, z = 1.5 * px + 0.5 + 0.2 * py;
        ASSERT_LE(picture.at(x, y), 1) << x << "," << y;
        const double pixel = 1.6 * 2 / kSize;
        if (z > pixel && z < 1 - pixel) {
          ASSERT_EQ(picture.at(x, y), 1) << x << "," << y;
        }
        if (z < -pixel || z > 1 + pixel) {
          ASSERT_EQ(picture.at(x, y), 0) << x << "," << y;
        }
      }
  }
}

TEST(Clip, PartsOfAClippedSliverNeverOverlap) {
  // Thin triangles cut by several planes: snapped corners may fall together or dent the polygon.
  std::mt19937 random(16);
  uint64_t parts = 0;
  for (int i = 0; i < 20000; i++) {
    Draw draw(kSize, kSize);
    const float size = std::ldexp(1.0f, -(i % 10));
    const float x = uniform(random, -1, 1), y = uniform(random, -1, 1);
    for (int k = 0; k < 3; k++) {
      const float w = uniform(random, 0.5f, 2);
      draw.add({(x + uniform(random, -size, size)) * w, (y + uniform(random, -size, size)) * w, uniform(random, -1, 2) * w, w});
    }
    if (i & 1) {
      for (int row : {0, 1, 3}) draw.rows[row][2] = (draw.rows[row][0] + draw.rows[row][1]) / 2 + uniform(random, -2e-3f, 2e-3f);
    }
    draw.state.samples = 16;
    draw.setup();
    if (draw.primitives.size() < 2) continue;
    parts += draw.primitives.size();
    Picture picture(kSize, kSize, 16);
    picture.draw(draw);
    for (uint8_t count : picture.counts) ASSERT_LE(count, 1) << "run " << i;
  }
  EXPECT_GT(parts, 1000u);
}

TEST(Clip, BothDirectionsOfAnEdgeMeetThePlaneInTheSamePoint) {
  std::mt19937 random(15);
  ClipVolume volume;
  volume.left = volume.top = -double(kGuardBand);
  volume.right = volume.bottom = double(kGuardBand);
  for (int i = 0; i < 2000; i++) {
    ClipVertex a{}, b{}, other{};
    for (ClipVertex* v : {&a, &b, &other})
      *v = {uniform(random, -1e9f, 1e9f), uniform(random, -1e9f, 1e9f), uniform(random, -1, 1), uniform(random, -1, 1), {}};
    const uint32_t cutting = outcode(volume, a) | outcode(volume, b) | outcode(volume, other);
    ClipVertex one[kMaxClipVertices] = {a, b, other}, two[kMaxClipVertices] = {b, a, other};
    const uint32_t n = clipPolygon(volume, cutting, one, 3), m = clipPolygon(volume, cutting, two, 3);
    ASSERT_EQ(n, m);
    // The same vertices, bit for bit, in opposite order.
    for (uint32_t k = 0; k < n; k++) {
      bool found = false;
      for (uint32_t j = 0; j < m; j++) found |= one[k].x == two[j].x && one[k].y == two[j].y && one[k].z == two[j].z && one[k].w == two[j].w;
      ASSERT_TRUE(found);
    }
  }
}

TEST(Clip, SnapRoundsToNearestEven) {
  EXPECT_EQ(snap(1.0), 256);
  EXPECT_EQ(snap(1.0 + 1 / 512.0), 256);
  EXPECT_EQ(snap(1.0 + 3 / 512.0), 258);
  EXPECT_EQ(snap(-1.0 - 1 / 512.0), -256);
  EXPECT_EQ(snap(-1.0 - 3 / 512.0), -258);
  EXPECT_EQ(snap(-double(kGuardBand)), -kGuardBand * 256);
}

}  // namespace
}  // namespace pumice::raster::test
