// Setup of four triangles at once against setup one by one: the same primitives, records, planes and counters, to the bit.
#include <cstring>
#include <limits>

#include "raster_fixture.h"
#include "raster/setup.h"

namespace pumice::raster::test {
namespace {

struct Both {
  Draw one, four;
  Both(uint32_t width, uint32_t height) : one(width, height), four(width, height) { one.state.singly = true; }
  template <typename F>
  void each(F&& f) {
    f(one);
    f(four);
  }
};

//! NaN is NaN, whatever its bits: which operand's payload wins is not ours to choose.
bool same(float a, float b) { return std::memcmp(&a, &b, 4) == 0 || (a != a && b != b); }
bool same(double a, double b) { return std::memcmp(&a, &b, 8) == 0 || (a != a && b != b); }

void comparePrimitive(const Draw& d, const Primitive& a, const Primitive& b) {
  for (int k = 0; k < 4; k++) {
    EXPECT_EQ(a.edges[k].a, b.edges[k].a) << "edge " << k;
    EXPECT_EQ(a.edges[k].b, b.edges[k].b) << "edge " << k;
    EXPECT_EQ(a.edges[k].c, b.edges[k].c) << "edge " << k;
  }
  EXPECT_EQ(a.edgeCount, b.edgeCount);
  EXPECT_EQ(a.frontFacing, b.frontFacing);
  EXPECT_EQ(a.wholePixels, b.wholePixels);
  EXPECT_EQ(a.layer, b.layer);
  EXPECT_EQ(a.viewport, b.viewport);
  EXPECT_EQ(a.primitiveId, b.primitiveId);
  EXPECT_EQ(a.minX, b.minX);
  EXPECT_EQ(a.minY, b.minY);
  EXPECT_EQ(a.maxX, b.maxX);
  EXPECT_EQ(a.maxY, b.maxY);
  EXPECT_TRUE(same(a.minZ, b.minZ)) << a.minZ << " " << b.minZ;
  EXPECT_TRUE(same(a.maxZ, b.maxZ)) << a.maxZ << " " << b.maxZ;
  ASSERT_EQ(a.record != nullptr, b.record != nullptr);
  ASSERT_EQ(a.planes != nullptr, b.planes != nullptr);
  ASSERT_EQ(a.flat != nullptr, b.flat != nullptr);
  const size_t planes = 2 + d.varyings.size();
  if (a.record) {
    EXPECT_EQ(std::memcmp(a.record, b.record, kRecordPlanes), 0) << "header";
    for (size_t i = 0; i < 3 * planes; i++) {
      float x, y;
      std::memcpy(&x, a.record + kRecordPlanes + 4 * i, 4);
      std::memcpy(&y, b.record + kRecordPlanes + 4 * i, 4);
      EXPECT_TRUE(same(x, y)) << "record: number " << i % 3 << " of plane " << i / 3 << ": " << x << " " << y;
    }
  }
  for (size_t i = 0; a.planes && i < planes; i++) {
    if (i >= 2 && d.varyings[i - 2].mode == VaryingMode::Flat) {
      EXPECT_EQ(a.flat[i - 2], b.flat[i - 2]) << "flat " << i;
      continue;
    }
    EXPECT_TRUE(same(a.planes[i].dx, b.planes[i].dx) && same(a.planes[i].dy, b.planes[i].dy) && same(a.planes[i].origin, b.planes[i].origin))
        << "plane " << i << ": " << a.planes[i].dx << " " << a.planes[i].dy << " " << a.planes[i].origin << " and " << b.planes[i].dx << " "
        << b.planes[i].dy << " " << b.planes[i].origin;
  }
}

void compare(const Both& both) {
  const Draw &a = both.one, &b = both.four;
  EXPECT_EQ(a.counters.input, b.counters.input);
  EXPECT_EQ(a.counters.clippedAway, b.counters.clippedAway);
  EXPECT_EQ(a.counters.culledFace, b.counters.culledFace);
  EXPECT_EQ(a.counters.culledZeroArea, b.counters.culledZeroArea);
  EXPECT_EQ(a.counters.culledOutside, b.counters.culledOutside);
  EXPECT_EQ(a.counters.culledNoSample, b.counters.culledNoSample);
  EXPECT_EQ(a.counters.output, b.counters.output);
  ASSERT_EQ(a.primitives.size(), b.primitives.size());
  for (size_t i = 0; i < a.primitives.size(); i++) {
    SCOPED_TRACE(testing::Message() << "primitive " << i << " of " << a.primitives.size() << ", id " << a.primitives[i].primitiveId);
    comparePrimitive(a, a.primitives[i], b.primitives[i]);
    if (testing::Test::HasFailure()) return;
  }
}

class Batch : public testing::TestWithParam<uint32_t> {
 protected:
  void SetUp() override {
    if (!fourAtOnce()) GTEST_SKIP() << "this processor (or PUMICE_ISA) sets up triangles one by one";
  }
};

// Vertices near to one another, so that triangles have between no and a few thousand pixels, with everything that is rare as often.
struct Vertices {
  std::mt19937 random;
  float in(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); }
  bool oneIn(uint32_t n) { return random() % n == 0; }

  float strange() {
    constexpr float kStrange[] = {0.0f, -0.0f, 1e30f, -1e30f, 3e38f, 1e-40f, std::numeric_limits<float>::infinity(),
                                  -std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(), 1.0f, -1.0f, 16384, -70000, 2e6f};
    return kStrange[random() % std::size(kStrange)];
  }
  void add(Both& both, float centreX, float centreY, float radius, uint32_t strangeOneIn, uint32_t snappedOneIn) {
    float x = centreX + in(-radius, radius), y = centreY + in(-radius, radius), z = in(0, 1), w = oneIn(2) ? 1 : std::exp2(in(-6, 6));
    if (oneIn(snappedOneIn)) {   // sample points, corners of pixels and the grid of subpixels
      x = std::floor(x * 2) / 2;
      y = std::floor(y * 2) / 2;
    }
    if (oneIn(8)) z = in(-0.2f, 1.2f);
    const VkViewport& v = both.one.state.viewport;
    Position p{((x - v.x) / v.width * 2 - 1) * w, ((y - v.y) / v.height * 2 - 1) * w, z * w, w};
    if (oneIn(strangeOneIn)) {
      float* const which[] = {&p.x, &p.y, &p.z, &p.w};
      *which[random() % 4] = strange();
    }
    float extra[4];
    for (float& e : extra) e = oneIn(40) ? strange() : in(-3, 3);
    both.each([&](Draw& d) { d.add(p, {extra[0], extra[1], extra[2], extra[3]}); });
  }
};

constexpr VkPrimitiveTopology kTopologies[] = {VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP,
                                               VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST_WITH_ADJACENCY,
                                               VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP_WITH_ADJACENCY};

TEST_P(Batch, RandomTriangles) {
  SetupCounters sum;
  uint64_t records = 0, planes = 0;
  for (uint32_t round = 0; round < 200; round++) {
    Vertices vertices{std::mt19937(GetParam() * 1000 + round)};
    auto& random = vertices.random;
    Both both(random() % 2 ? 1024 : 333, random() % 2 ? 512 : 217);
    const VkPrimitiveTopology topology = kTopologies[random() % std::size(kTopologies)];
    constexpr uint32_t kSamples[] = {1, 1, 1, 2, 4, 8, 16};
    const uint32_t samples = kSamples[random() % std::size(kSamples)], modes = random(), switches = random(), bounds = random();
    both.each([&](Draw& d) {
      d.state.topology = topology;
      d.state.samples = samples;
      d.state.cellRecords = switches & 3;
      d.state.depthClampEnable = switches >> 2 & 1;
      d.state.depthClipEnable = switches >> 3 & 1;
      d.state.depthFromMinusOne = (switches >> 4 & 3) == 0;
      d.state.provokingLast = switches >> 6 & 1;
      d.state.cullMode = (switches >> 7 & 1 ? VK_CULL_MODE_FRONT_BIT : 0) | ((switches >> 8 & 3) == 0 ? VK_CULL_MODE_BACK_BIT : 0);
      d.state.frontFace = switches >> 10 & 1 ? VK_FRONT_FACE_CLOCKWISE : VK_FRONT_FACE_COUNTER_CLOCKWISE;
      d.state.depthFormat = VK_FORMAT_D32_SFLOAT;
      if ((switches >> 11 & 3) == 0) {
        d.state.depthBiasEnable = true;
        d.state.depthBiasConstant = 3;
        d.state.depthBiasSlope = switches >> 18 & 1 ? 0.5f : -2;
        d.state.depthBiasClamp = switches >> 13 & 1 ? switches >> 17 & 1 ? 0.01f : -0.01f : 0;
        if (switches >> 14 & 1) d.state.depthFormat = VK_FORMAT_D16_UNORM;
      }
      if (switches >> 15 & 1) d.state.viewport = {-3.25f, 7.5f, 211.5f, -99.75f, 0.875f, 0.125f};
      if ((switches >> 16 & 3) == 0) d.state.viewport.width = 9000;
      if (bounds & 1) d.state.bounds = {{int32_t(bounds >> 8 & 63), int32_t(bounds >> 16 & 63)}, {bounds >> 20 & 255, bounds >> 24 & 127}};
      for (uint32_t v = 0; v < modes % 6; v++) {
        constexpr VaryingMode kModes[] = {VaryingMode::Perspective, VaryingMode::Perspective, VaryingMode::Linear, VaryingMode::Flat, VaryingMode::PointX};
        d.varyings.push_back({uint16_t(4 + (modes >> (4 + 2 * v) & 3)), kModes[(modes >> (14 + 3 * v)) % 5]});
      }
    });
    const float radius = std::exp2(vertices.in(-2, 6));
    const uint32_t strange = random() % 3 ? 1000000 : 20, snapped = random() % 3 ? 50 : 2,
                   count = random() % 5 ? 4 + random() % 700 : 3 + random() % 12;
    float x = 0, y = 0;
    for (uint32_t i = 0; i < count; i++) {
      if (i % 3 == 0 && (topology == VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST || i % 60 == 0)) {
        x = vertices.in(-20, 1050);
        y = vertices.in(-20, 530);
      }
      vertices.add(both, x, y, radius, strange, snapped);
    }
    if (random() % 2) {   // as an index buffer would have it, sometimes outside
      std::vector<uint32_t> slots(count);
      const uint32_t reach = 1 + random() % 40, outside = random() % 4 == 0;
      for (uint32_t i = 0; i < count; i++) slots[i] = std::min(i / 2 + uint32_t(random()) % reach, count - 1 + outside);
      both.each([&](Draw& d) { d.slots = slots; });
    }
    both.each([&](Draw& d) { d.setup(round * 7); });
    SCOPED_TRACE(testing::Message() << "round " << round << ", topology " << topology);
    compare(both);
    if (HasFailure()) return;
    const SetupCounters& c = both.four.counters;
    sum.clippedAway += c.clippedAway, sum.culledFace += c.culledFace, sum.culledZeroArea += c.culledZeroArea;
    sum.culledOutside += c.culledOutside, sum.culledNoSample += c.culledNoSample, sum.output += c.output;
    for (const Primitive& p : both.four.primitives) (p.record ? records : planes)++;
  }
  // Otherwise the comparison means little.
  EXPECT_GT(sum.clippedAway, 50u);
  EXPECT_GT(sum.culledFace, 100u);
  EXPECT_GT(sum.culledZeroArea, 10u);
  EXPECT_GT(sum.culledOutside, 100u);
  EXPECT_GT(sum.culledNoSample, 100u);
  EXPECT_GT(records, 200u);
  EXPECT_GT(planes, 200u);
}
INSTANTIATE_TEST_SUITE_P(Seeds, Batch, testing::Range(0u, 20u));

// Small triangles whose corners lie on and next to sample points: where a wrong rule for edges would show.
TEST_F(Batch, AroundSamplePoints) {
  std::mt19937 random(5);
  Both both(64, 64);
  for (uint32_t i = 0; i < 3 * 20000; i++) {
    const double x = 32 + (int(random() % 9) - 4) / 2.0 + (int(random() % 3) - 1) / 256.0,
                 y = 32 + (int(random() % 9) - 4) / 2.0 + (int(random() % 3) - 1) / 256.0;
    both.each([&](Draw& d) { d.addPixel(x, y, 0.5f); });
  }
  both.each([](Draw& d) { d.state.cellRecords = true; });
  both.each([](Draw& d) { d.setup(); });
  compare(both);
  EXPECT_GT(both.four.counters.culledNoSample, 1000u);
  EXPECT_GT(both.four.counters.output, 1000u);
}

// The bounds of the range in which four are set up at once.
TEST_F(Batch, FarAway) {
  std::mt19937 random(6);
  Both both(16384, 16384);
  for (uint32_t i = 0; i < 3 * 4000; i++) {
    const auto place = [&] {
      constexpr double kPlaces[] = {-16385, -16384, -16383.5, 0, 0.5, 8192, 16383.5, 16384, 16384 + 1.0 / 256, 16390, 40000, 1 << 20};
      return kPlaces[random() % std::size(kPlaces)] + (int(random() % 3) - 1) / 256.0;
    };
    const double x = place(), y = place();
    const float z = float(random() % 1000) / 999;
    both.each([&](Draw& d) { d.addPixel(x, y, z); });
  }
  both.each([](Draw& d) { d.setup(); });
  compare(both);
  EXPECT_GT(both.four.counters.output, 1000u);
}

}  // namespace
}  // namespace pumice::raster::test
