#include <cstring>

#include "homogeneous_reference.h"

namespace pumice::raster::test {
namespace {

constexpr uint32_t kSize = 128;

float uniform(std::mt19937& random, float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); }

double at(const Plane& p, double x, double y) { return p.origin + p.dx * x + p.dy * y; }

// What a fragment routine computes: from the record of the pixel's grid cell, in float.
float recordAt(const std::vector<std::byte>& record, uint32_t plane, float x, float y) {
  float v[3];
  std::memcpy(v, record.data() + kRecordPlanes + 12 * plane, 12);
  return v[0] + v[1] * x + v[2] * y;
}

struct Visit final : BlockSink {
  std::vector<std::array<uint32_t, 2>> pixels;
  void block(uint32_t x, uint32_t y, const uint16_t* masks) override {
    for (uint32_t i = 0; i < 16; i++)
      if (masks[0] >> i & 1) pixels.push_back({x + ((i & 1) | (i >> 2 & 1) << 1), y + ((i >> 1 & 1) | (i >> 3 & 1) << 1)});
  }
};

std::vector<std::array<uint32_t, 2>> pixelsOf(const Primitive& p, const Draw& draw) {
  Visit visit;
  for (uint32_t y = 0; y < kSize / kTileSize; y++)
    for (uint32_t x = 0; x < kSize / kTileSize; x++) rasterize(p, x, y, draw.state.bounds, 1, visit);
  return visit.pixels;
}

void expectPlanes(bool behind, unsigned seed, int runs) {
  std::mt19937 random(seed);
  uint64_t compared = 0;
  for (int i = 0; i < runs; i++) {
    Draw draw(kSize, kSize);
    draw.state.viewport.minDepth = 0.25f;
    draw.state.viewport.maxDepth = 0.75f;
    draw.state.depthClipEnable = i & 1;
    draw.varyings = {{4, VaryingMode::Perspective}, {5, VaryingMode::Linear}};
    for (int k = 0; k < 3; k++) {
      const float w = behind ? uniform(random, -1, 3) : uniform(random, 0.5f, 20);
      const float reach = behind ? 3 : 1.5f * w;
      draw.add({uniform(random, -reach, reach), uniform(random, -reach, reach), behind ? uniform(random, -1, 2) : w * uniform(random, 0, 1), w},
               {uniform(random, -100, 100), uniform(random, -100, 100)});
    }
    draw.setup();
    const Reference reference(draw, {0, 1, 2});
    if (!reference.valid) continue;
    using Real = Reference::Real;
    const Real ones[3] = {1, 1, 1};
    const Real u[3] = {draw.rows[4][0], draw.rows[4][1], draw.rows[4][2]};
    Real linear[3];
    for (int k = 0; k < 3; k++) linear[k] = reference.w[k] * draw.rows[5][k];
    // Thin triangles deliberately use snapped positions (planes.h); they have a test of their own.
    Real height = 1e9L;
    for (int k = 0; k < 3; k++) height = std::min(height, 1 / std::hypot(reference.gradientX[k], reference.gradientY[k]) / std::max<Real>(std::fabs(reference.w[k]), 1e-3L));
    if (!behind && height < 1) continue;
    for (const Primitive& p : draw.primitives) {
      if (behind && (p.maxX - p.minX < 8 || p.maxY - p.minY < 8)) continue;
      for (const auto& [px, py] : pixelsOf(p, draw)) {
        const Real x = px + 0.5L, y = py + 0.5L;
        if (reference.distance(x, y, false) < 0) continue;
        const Real depth = 0.25L + 0.5L * reference.sum(reference.z, x, y), inverseW = reference.sum(ones, x, y);
        const Real uw = reference.sum(u, x, y), lin = reference.sum(linear, x, y);
        // Coefficients may be far larger than their sum: errors are relative to them.
        auto near = [&](double got, Real expected, const Real (&values)[3]) {
          Real scale = 1;
          for (int k = 0; k < 3; k++)
            scale += std::fabs(values[k]) * (std::fabs(reference.gradientX[k]) * x + std::fabs(reference.gradientY[k]) * y + std::fabs(reference.atOrigin[k]));
          ASSERT_NEAR(got, double(expected), double(scale) * 1e-11) << "pixel " << px << "," << py << " run " << i;
        };
        near(at(p.planes[0], double(x), double(y)), depth, reference.z);
        near(at(p.planes[1], double(x), double(y)), inverseW, ones);
        near(at(p.planes[2], double(x), double(y)), uw, u);
        near(at(p.planes[3], double(x), double(y)), lin, linear);
        if (testing::Test::HasFatalFailure()) return;
        compared++;
      }
    }
  }
  EXPECT_GT(compared, 10000u);
}

TEST(Interpolation, PlanesAreTheExactPerspective) { expectPlanes(false, 21, 150); }
TEST(Interpolation, ClippingDoesNotChangeThePlanes) { expectPlanes(true, 22, 300); }

TEST(Interpolation, AllPartsOfAClippedTriangleShareTheirPlanes) {
  Draw draw(kSize, kSize);
  draw.add({-0.5f, -0.5f, -0.5f, 1});
  draw.add({0.9f, -0.5f, 0.5f, 1});
  draw.add({0.0f, 0.9f, 0.9f, 1});
  draw.setup(7);
  ASSERT_EQ(draw.primitives.size(), 2u);
  EXPECT_EQ(draw.primitives[0].planes, draw.primitives[1].planes);
  EXPECT_EQ(draw.primitives[0].primitiveId, 7u);
  EXPECT_EQ(draw.primitives[1].primitiveId, 7u);
}

TEST(Interpolation, RecordsGiveTheReferenceToFloatPrecision) {
  // A floor at a steep angle over a large framebuffer: the case where coefficients rebased to the framebuffer's corner would fail.
  std::mt19937 random(23);
  Draw draw(4096, 4096);
  draw.varyings = {{4, VaryingMode::Perspective}};
  draw.add({-8, 1, 0.1f, 1}, {0});
  draw.add({8, 1, 0.2f, 1}, {16});
  draw.add({0, 0.5f, 9, 40}, {8});
  draw.setup();
  ASSERT_FALSE(draw.primitives.empty());
  const Reference reference(draw, {0, 1, 2});
  using Real = Reference::Real;
  const Real ones[3] = {1, 1, 1}, u[3] = {0, 16, 8};
  double worst = 0;
  for (int i = 0; i < 2000; i++) {
    const uint32_t px = random() % 4096, py = 2100 + random() % 1990;
    if (reference.distance(px + 0.5L, py + 0.5L, true) < 1) continue;
    const uint32_t cellX = px / kGridCell * kGridCell, cellY = py / kGridCell * kGridCell;
    std::vector<std::byte> record(recordBytes(1));
    fillRecord(draw.primitives[0], draw.varyings, cellX, cellY, record.data());
    const float x = float(px - cellX) + 0.5f, y = float(py - cellY) + 0.5f;
    const float got = recordAt(record, 2, x, y) / recordAt(record, 1, x, y);
    const Real expected = reference.sum(u, px + 0.5L, py + 0.5L) / reference.sum(ones, px + 0.5L, py + 0.5L);
    worst = std::max(worst, double(std::fabs(got - expected)));
  }
  EXPECT_LT(worst, 16 * 0x1p-20);
  EXPECT_GT(worst, 0);
}

TEST(Interpolation, DepthStaysWithinItsBounds) {
  std::mt19937 random(24);
  uint64_t compared = 0;
  for (int i = 0; i < 3000; i++) {
    Draw draw(kSize, kSize);
    const float size = i % 3 == 0 ? 0.02f : i % 3 == 1 ? 0.2f : 2;
    const float x = uniform(random, -1, 1), y = uniform(random, -1, 1);
    for (int k = 0; k < 3; k++) draw.add({x + uniform(random, -size, size), y + uniform(random, -size, size), uniform(random, 0, 1), 1});
    if (i % 5 == 0) {  // a sliver
      draw.rows[0][2] = (draw.rows[0][0] + draw.rows[0][1]) / 2 + uniform(random, -1e-3f, 1e-3f);
      draw.rows[1][2] = (draw.rows[1][0] + draw.rows[1][1]) / 2 + uniform(random, -1e-3f, 1e-3f);
    }
    draw.state.depthFormat = VK_FORMAT_D32_SFLOAT;
    draw.state.depthBiasEnable = i & 1;
    draw.state.depthBiasConstant = 3;
    draw.state.depthBiasSlope = 0.5f;
    draw.setup();
    for (const Primitive& p : draw.primitives)
      for (const auto& [px, py] : pixelsOf(p, draw)) {
        const uint32_t cellX = px / kGridCell * kGridCell, cellY = py / kGridCell * kGridCell;
        std::vector<std::byte> record(recordBytes(0));
        fillRecord(p, {}, cellX, cellY, record.data());
        const float z = recordAt(record, 0, float(px - cellX) + 0.5f, float(py - cellY) + 0.5f);
        ASSERT_GE(z, p.minZ);
        ASSERT_LE(z, p.maxZ);
        compared++;
      }
  }
  EXPECT_GT(compared, 10000u);
}

TEST(Interpolation, ThinTrianglesInterpolateBetweenTheirVertices) {
  std::mt19937 random(25);
  uint64_t compared = 0;
  for (int i = 0; i < 4000; i++) {
    Draw draw(kSize, kSize);
    draw.varyings = {{4, VaryingMode::Linear}};
    const float y = uniform(random, -0.9f, 0.9f);
    draw.add({-0.9f, y, 0, 1}, {1});
    draw.add({0.9f, y + uniform(random, -0.3f, 0.3f), 0, 1}, {1});
    draw.add({(draw.rows[0][0] + draw.rows[0][1]) / 2, (draw.rows[1][0] + draw.rows[1][1]) / 2 + uniform(random, -3e-3f, 3e-3f), 0, 1}, {2});
    draw.setup();
    for (const Primitive& p : draw.primitives)
      for (const auto& [px, py] : pixelsOf(p, draw)) {
        const double v = at(p.planes[2], px + 0.5, py + 0.5);
        ASSERT_GE(v, 1 - 0.03);
        ASSERT_LE(v, 2 + 0.03);
        compared++;
      }
  }
  EXPECT_GT(compared, 1000u);
}

TEST(Interpolation, FlatWordsComeFromTheProvokingVertexBitForBit) {
  for (bool last : {false, true})
    for (bool clipped : {false, true}) {
      Draw draw(kSize, kSize);
      draw.state.provokingLast = last;
      draw.varyings = {{4, VaryingMode::Perspective}, {5, VaryingMode::Flat}};
      float words[3];
      const uint32_t bits[3] = {0x7fc12345, 0x00000001, 0xffffffff};  // no arithmetic survives these
      std::memcpy(words, bits, 12);
      draw.add({-0.5f, -0.5f, clipped ? -0.5f : 0.5f, 1}, {1, words[0]});
      draw.add({0.9f, -0.5f, 0.5f, 1}, {1, words[1]});
      draw.add({0.0f, 0.9f, 0.9f, 1}, {1, words[2]});
      draw.setup(5);
      ASSERT_EQ(draw.primitives.size(), clipped ? 2u : 1u);
      for (const Primitive& p : draw.primitives) {
        std::vector<std::byte> record(recordBytes(2));
        fillRecord(p, draw.varyings, 64, 0, record.data());
        RecordHeader header;
        std::memcpy(&header, record.data(), sizeof header);
        EXPECT_EQ(header.primitiveId, 5u);
        EXPECT_EQ(header.cellX, 64.0f);
        uint32_t flat[3];
        std::memcpy(flat, record.data() + kRecordPlanes + 12 * 3, 12);
        EXPECT_EQ(flat[0], bits[last ? 2 : 0]);
        EXPECT_EQ(flat[1], 0u);
        EXPECT_EQ(flat[2], 0u);
      }
    }
}

}  // namespace
}  // namespace pumice::raster::test
