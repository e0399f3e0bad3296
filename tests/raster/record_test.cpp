// Records that setup makes for triangles inside of one grid cell are those that the tile would make from planes.
#include <cstring>

#include "tests/raster/raster_fixture.h"

namespace pumice::raster::test {
namespace {

std::vector<Primitive> triangles(Draw& d, bool cellRecords) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-5, 260), unit(0, 1);
  d.varyings = {{4, VaryingMode::Perspective}, {5, VaryingMode::Linear}, {6, VaryingMode::Flat}};
  d.state.depthBiasEnable = true;
  d.state.depthFormat = VK_FORMAT_D32_SFLOAT;
  d.state.depthBiasSlope = 1.25f;
  d.state.viewport.minDepth = 0.125f;
  d.state.cellRecords = cellRecords;
  for (int t = 0; t < 500; t++) {
    const float x = place(random), y = place(random), size = t % 5 ? 6 : 90;
    for (int i = 0; i < 3; i++)
      d.addPixel(x + unit(random) * size, y + unit(random) * size, unit(random), 1 + unit(random), {unit(random), unit(random), unit(random)});
  }
  d.setup(1000);
  return d.primitives;
}

TEST(Record, OfOneCellIsTheSameAsFromPlanes) {
  Draw from(256, 256), direct(256, 256);
  const auto planes = triangles(from, false), records = triangles(direct, true);
  ASSERT_EQ(planes.size(), records.size());
  const DepthRange depth{0.125f, 1};
  size_t made = 0;
  for (size_t i = 0; i < planes.size(); i++) {
    ASSERT_TRUE(planes[i].planes && !planes[i].record);
    const Primitive& p = records[i];
    const uint32_t x = uint32_t(p.minX) / kGridCell, y = uint32_t(p.minY) / kGridCell;
    const bool oneCell = x == uint32_t(p.maxX) / kGridCell && y == uint32_t(p.maxY) / kGridCell;
    EXPECT_EQ(p.record != nullptr, oneCell);
    EXPECT_EQ(p.planes == nullptr, oneCell);
    EXPECT_EQ(p.minZ, planes[i].minZ);
    EXPECT_EQ(p.maxZ, planes[i].maxZ);
    if (!oneCell) continue;
    made++;
    std::byte record[recordBytes(3)];
    fillRecord(planes[i], from.varyings, x * kGridCell, y * kGridCell, record, depth);
    EXPECT_EQ(std::memcmp(record, p.record, sizeof record), 0) << "primitive " << i;
  }
  EXPECT_GT(made, 100u);
  EXPECT_LT(made, planes.size());
}

}  // namespace
}  // namespace pumice::raster::test
