#include <limits>

#include "raster_fixture.h"

namespace pumice::raster::test {
namespace {

constexpr uint32_t kSize = 64;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

TEST(Setup, PositionsThatAreNotFiniteMakeTrianglesVanish) {
  for (float bad : {kNaN, -kNaN, kInfinity, -kInfinity})
    for (int component = 0; component < 4; component++)
      for (int vertex = 0; vertex < 3; vertex++) {
        Draw draw(kSize, kSize);
        draw.add({-1, -1, 0.5f, 1});
        draw.add({1, -1, 0.5f, 1});
        draw.add({-1, 1, 0.5f, 1});
        draw.rows[component][vertex] = bad;
        draw.setup();
        EXPECT_TRUE(draw.primitives.empty());
        EXPECT_EQ(draw.counters.clippedAway, 1u);
      }
}

TEST(Setup, AViewportThatIsNotANumberDrawsNothing) {
  for (int field = 0; field < 4; field++) {
    Draw draw(kSize, kSize);
    float* fields[] = {&draw.state.viewport.x, &draw.state.viewport.y, &draw.state.viewport.width, &draw.state.viewport.height};
    *fields[field] = kNaN;
    draw.add({-1, -1});
    draw.add({1, -1});
    draw.add({-1, 1});
    draw.setup();
    EXPECT_TRUE(draw.primitives.empty());
  }
}

TEST(Setup, ExtremeFinitePositionsDoNotOverflow) {
  std::mt19937 random(31);
  constexpr float kMax = std::numeric_limits<float>::max(), kMin = std::numeric_limits<float>::denorm_min();
  const float values[] = {0, -0.0f, kMax, -kMax, kMin, -kMin, 1, -1, 0.5f, 1e20f, -1e20f, 1e-20f};
  for (int i = 0; i < 20000; i++) {
    Draw draw(kSize, kSize);
    draw.state.depthClipEnable = i & 1;
    for (int k = 0; k < 3; k++) draw.add({values[random() % 12], values[random() % 12], values[random() % 12], values[random() % 12]});
    draw.setup();
    Picture picture(kSize, kSize, 1);
    picture.draw(draw);
    for (uint8_t count : picture.counts) ASSERT_LE(count, 1) << "run " << i;
    for (const Primitive& p : draw.primitives) {
      ASSERT_GE(p.minX, 0);
      ASSERT_LT(p.maxX, int32_t(kSize));
      for (const Edge& e : {p.edges[0], p.edges[1], p.edges[2]}) {
        ASSERT_LE(std::abs(e.a), (int64_t(1) << 29) + 1024);
        ASSERT_LE(std::abs(e.b), (int64_t(1) << 29) + 1024);
      }
    }
  }
}

TEST(Setup, SlotsBeyondTheVerticesAreIgnored) {
  Draw draw(kSize, kSize);
  draw.add({-1, -1});
  draw.add({1, -1});
  draw.add({-1, 1});
  draw.slots = {0, 1, 99};
  draw.setup();
  EXPECT_TRUE(draw.primitives.empty());
}

TEST(Setup, ReasonsForDroppingAreCounted) {
  auto count = [](std::initializer_list<Position> positions) {
    Draw draw(kSize, kSize);
    draw.state.cullMode = VK_CULL_MODE_BACK_BIT;  // counter-clockwise is in front
    for (const Position& p : positions) draw.add(p);
    draw.setup();
    EXPECT_EQ(draw.counters.input, 1u);
    EXPECT_EQ(draw.counters.output, draw.primitives.size());
    return draw.counters;
  };
  EXPECT_EQ(count({{-1, -1}, {-1, 1}, {1, -1}}).output, 1u);
  EXPECT_EQ(count({{-1, -1}, {1, -1}, {-1, 1}}).culledFace, 1u);
  EXPECT_EQ(count({{-1, -1}, {0, 0}, {1, 1}}).culledZeroArea, 1u);
  EXPECT_EQ(count({{-5, -1}, {-5, 1}, {-3, -1}}).culledOutside, 1u);
  EXPECT_EQ(count({{-1, -1, -1}, {-1, 1, -1}, {1, -1, -0.5f}}).clippedAway, 1u);
  EXPECT_EQ(count({{0, 0}, {0, 0.01f}, {0.01f, 0}}).culledNoSample, 1u);
}

TEST(Setup, FacingFollowsTheSpecificationsArea) {
  // In the framebuffer, y down: (10,10) (50,10) (10,50) goes clockwise on the screen.
  for (bool clockwise : {false, true})
    for (VkFrontFace face : {VK_FRONT_FACE_CLOCKWISE, VK_FRONT_FACE_COUNTER_CLOCKWISE})
      for (VkCullModeFlags cull : {VK_CULL_MODE_NONE, VK_CULL_MODE_FRONT_BIT, VK_CULL_MODE_BACK_BIT, VK_CULL_MODE_FRONT_AND_BACK}) {
        Draw draw(kSize, kSize);
        draw.state.frontFace = face;
        draw.state.cullMode = cull;
        draw.addPixel(10, 10);
        draw.addPixel(clockwise ? 50 : 10, clockwise ? 10 : 50);
        draw.addPixel(clockwise ? 10 : 50, clockwise ? 50 : 10);
        draw.setup();
        const bool front = clockwise == (face == VK_FRONT_FACE_CLOCKWISE);
        const bool culled = cull & (front ? VK_CULL_MODE_FRONT_BIT : VK_CULL_MODE_BACK_BIT);
        ASSERT_EQ(draw.primitives.size(), culled ? 0u : 1u);
        if (!culled) {
          EXPECT_EQ(draw.primitives[0].frontFacing, front);
        }
      }
}

TEST(Setup, ClippedTrianglesKeepTheirFacing) {
  std::mt19937 random(32);
  std::uniform_real_distribution<float> place(-1, 1);
  for (int i = 0; i < 500; i++) {
    float x[3], y[3];
    for (int k = 0; k < 3; k++) x[k] = place(random), y[k] = place(random);
    bool front[2];
    size_t made[2];
    for (int clipped = 0; clipped < 2; clipped++) {
      Draw draw(kSize, kSize);
      // The same screen positions; the second is cut at its first corner by the near plane.
      for (int k = 0; k < 3; k++) draw.add({x[k], y[k], clipped && k == 0 ? -0.1f : 0.9f, 1});
      draw.setup();
      made[clipped] = draw.primitives.size();
      if (made[clipped]) front[clipped] = draw.primitives[0].frontFacing;
      for (const Primitive& p : draw.primitives) EXPECT_EQ(p.frontFacing, front[clipped]);
    }
    if (made[0] && made[1]) {
      EXPECT_EQ(front[0], front[1]);
    }
  }
}

TEST(Setup, NegativeViewportHeightTurnsThePictureAndTheFacing) {
  Draw up(kSize, kSize), down(kSize, kSize);
  down.state.viewport = {0, float(kSize), float(kSize), -float(kSize), 0, 1};
  for (Draw* draw : {&up, &down}) {
    draw->add({-1, -1});
    draw->add({1, -1});
    draw->add({-1, 1});
    draw->setup();
    ASSERT_EQ(draw->primitives.size(), 1u);
  }
  EXPECT_FALSE(up.primitives[0].frontFacing);
  EXPECT_TRUE(down.primitives[0].frontFacing);
  Picture a(kSize, kSize, 1), b(kSize, kSize, 1);
  a.draw(up);
  b.draw(down);
  EXPECT_EQ(a.at(2, 2), 1);
  EXPECT_EQ(b.at(2, 2), 0);
  EXPECT_EQ(b.at(2, kSize - 3), 1);
}

TEST(Setup, NothingIsDrawnOutsideTheViewport) {
  Draw draw(kSize, kSize);
  draw.state.viewport = {16, 8, 32, 16, 0, 1};
  draw.add({-3, -3});
  draw.add({9, -3});
  draw.add({-3, 9});
  draw.setup();
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  EXPECT_EQ(picture.total(), 32u * 16);
  EXPECT_EQ(picture.at(16, 8), 1);
  EXPECT_EQ(picture.at(47, 23), 1);
}

TEST(Setup, EmptyBoundsProduceNothing) {
  Draw draw(kSize, kSize);
  draw.state.bounds = {{5, 5}, {0, 10}};
  draw.add({-1, -1});
  draw.add({1, -1});
  draw.add({-1, 1});
  draw.setup();
  EXPECT_TRUE(draw.primitives.empty());
}

// Each vertex carries its number in row 4; the primitive's vertices are told apart by value and order.
struct Assembled {
  std::vector<uint32_t> ids, provoking;
  std::vector<bool> front;
};
Assembled assemble(VkPrimitiveTopology topology, bool last, const std::vector<std::array<float, 2>>& points) {
  Draw draw(kSize, kSize);
  draw.state.topology = topology;
  draw.state.provokingLast = last;
  draw.varyings = {{4, VaryingMode::Flat}};
  float number = 0;
  for (const auto& p : points) {
    draw.addPixel(p[0], p[1], 0, 1, {number});
    number++;
  }
  draw.setup(100);
  Assembled a;
  for (const Primitive& p : draw.primitives) {
    a.ids.push_back(p.primitiveId);
    a.provoking.push_back(uint32_t(std::bit_cast<float>(p.flat[0])));
    a.front.push_back(p.frontFacing);
  }
  return a;
}

using Numbers = std::vector<uint32_t>;

TEST(Assembly, StripsAlternateTheirWindingAndKeepTheProvokingVertex) {
  // A zigzag: with the alternation all triangles face the same way.
  const std::vector<std::array<float, 2>> zigzag = {{4, 4}, {4, 20}, {20, 4}, {20, 20}, {36, 4}, {36, 20}};
  const Assembled first = assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP, false, zigzag);
  EXPECT_EQ(first.ids, (Numbers{100, 101, 102, 103}));
  EXPECT_EQ(first.provoking, (Numbers{0, 1, 2, 3}));
  EXPECT_EQ(first.front, (std::vector<bool>{true, true, true, true}));
  EXPECT_EQ(assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP, true, zigzag).provoking, (Numbers{2, 3, 4, 5}));
}

TEST(Assembly, FansShareTheirFirstVertex) {
  const std::vector<std::array<float, 2>> fan = {{30, 30}, {60, 30}, {60, 4}, {30, 4}, {4, 4}};
  const Assembled first = assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN, false, fan);
  EXPECT_EQ(first.ids, (Numbers{100, 101, 102}));
  EXPECT_EQ(first.provoking, (Numbers{1, 2, 3}));
  EXPECT_EQ(first.front, (std::vector<bool>{true, true, true}));
  EXPECT_EQ(assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN, true, fan).provoking, (Numbers{2, 3, 4}));
}

TEST(Assembly, ListsIgnoreAnIncompleteLastPrimitive) {
  const std::vector<std::array<float, 2>> list = {{4, 4}, {4, 20}, {20, 4}, {24, 4}, {24, 20}, {40, 4}, {50, 50}, {60, 60}};
  const Assembled a = assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, false, list);
  EXPECT_EQ(a.ids, (Numbers{100, 101}));
  EXPECT_EQ(a.provoking, (Numbers{0, 3}));
  EXPECT_EQ(assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, true, list).provoking, (Numbers{2, 5}));
}

TEST(Assembly, AdjacentVerticesAreSkipped) {
  const std::vector<std::array<float, 2>> list = {{4, 4}, {0, 0}, {4, 20}, {0, 0}, {20, 4}, {0, 0}};
  const Assembled a = assemble(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST_WITH_ADJACENCY, false, list);
  EXPECT_EQ(a.provoking, (Numbers{0}));
  EXPECT_EQ(a.front, (std::vector<bool>{true}));
}

Draw biased(VkFormat format, float z, float constant, float slope, float clamp) {
  Draw draw(kSize, kSize);
  draw.state.depthFormat = format;
  draw.state.depthBiasEnable = true;
  draw.state.depthBiasConstant = constant;
  draw.state.depthBiasSlope = slope;
  draw.state.depthBiasClamp = clamp;
  // Depth rises by 1/1024 per pixel to the right when slope is asked for.
  const float rise = slope != 0 ? 1.0f / 16 : 0;
  draw.addPixel(0, 0, z);
  draw.addPixel(64, 0, z + rise);
  draw.addPixel(0, 64, z);
  draw.setup();
  return draw;
}

TEST(DepthBias, TheUnitFollowsTheFormat) {
  EXPECT_EQ(biased(VK_FORMAT_D16_UNORM, 0.5f, 3, 0, 0).primitives.at(0).planes[0].origin, 0.5 + 3 * 0x1p-16);
  EXPECT_EQ(biased(VK_FORMAT_D24_UNORM_S8_UINT, 0.5f, 3, 0, 0).primitives.at(0).planes[0].origin, 0.5 + 3 * 0x1p-24);
  // Floating point: one unit in the last place of the largest depth.
  EXPECT_EQ(biased(VK_FORMAT_D32_SFLOAT, 0.5f, 3, 0, 0).primitives.at(0).planes[0].origin, 0.5 + 3 * 0x1p-24);
  EXPECT_EQ(biased(VK_FORMAT_D32_SFLOAT, 0.25f, -3, 0, 0).primitives.at(0).planes[0].origin, 0.25 - 3 * 0x1p-25);
  EXPECT_EQ(biased(VK_FORMAT_D32_SFLOAT, 0.0f, 3, 0, 0).primitives.at(0).planes[0].origin, 0.0);
}

TEST(DepthBias, SlopeAndClamp) {
  EXPECT_DOUBLE_EQ(biased(VK_FORMAT_D16_UNORM, 0.5f, 0, 2, 0).primitives.at(0).planes[0].origin, 0.5 + 2.0 / 1024);
  EXPECT_DOUBLE_EQ(biased(VK_FORMAT_D16_UNORM, 0.5f, 0, 2, 0.0009765625f).primitives.at(0).planes[0].origin, 0.5 + 1.0 / 1024);
  EXPECT_DOUBLE_EQ(biased(VK_FORMAT_D16_UNORM, 0.5f, 0, -2, -0.0009765625f).primitives.at(0).planes[0].origin, 0.5 - 1.0 / 1024);
}

TEST(DepthClamp, KeepsWhatLiesBeyondNearAndFarAndBoundsItsDepth) {
  Draw draw(kSize, kSize);
  draw.state.depthClampEnable = true;
  draw.state.depthClipEnable = false;
  draw.add({-1, -1, -3, 1});
  draw.add({3, -1, 5, 1});
  draw.add({-1, 3, -3, 1});
  draw.setup();
  Picture picture(kSize, kSize, 1);
  picture.draw(draw);
  EXPECT_EQ(picture.total(), kSize * kSize);
  EXPECT_NEAR(draw.primitives.at(0).minZ, 0, 1e-6);
  EXPECT_NEAR(draw.primitives.at(0).maxZ, 1, 1e-6);
}

}  // namespace
}  // namespace pumice::raster::test
