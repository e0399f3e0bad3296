// What the raster tests share: a draw made of plain vertices, and a picture of how often each sample was covered.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "raster/tiles.h"

namespace pumice::raster::test {

struct Position {
  float x, y, z = 0, w = 1;
};

//! Vertices with `extra` rows after the position, and everything setupPrimitives wants.
class Draw {
 public:
  SetupState state;
  std::vector<std::vector<float>> rows = std::vector<std::vector<float>>(4);
  std::vector<Varying> varyings;
  std::vector<uint32_t> slots;
  base::Arena arena;
  std::vector<Primitive> primitives;
  SetupCounters counters;
  int32_t pointSizeRow = -1;

  Draw(uint32_t width, uint32_t height) {
    state.viewport = {0, 0, float(width), float(height), 0, 1};
    state.bounds = {{0, 0}, {width, height}};
  }
  void add(const Position& p, std::initializer_list<float> extra = {}) {
    slots.push_back(uint32_t(rows[0].size()));
    rows[0].push_back(p.x);
    rows[1].push_back(p.y);
    rows[2].push_back(p.z);
    rows[3].push_back(p.w);
    size_t r = 4;
    for (float value : extra) {
      if (rows.size() <= r) rows.resize(r + 1);
      rows[r++].push_back(value);
    }
  }
  //! A vertex at framebuffer pixels (x, y). Exact when the viewport's size is a power of two and the position on the 1/256 grid.
  void addPixel(double x, double y, float z = 0, float w = 1, std::initializer_list<float> extra = {}) {
    const VkViewport& v = state.viewport;
    add({float((x - v.x) / v.width * 2 - 1) * w, float((y - v.y) / v.height * 2 - 1) * w, z * w, w}, extra);
  }
  void setup(uint32_t firstId = 0) {
    std::vector<const float*> pointers;
    for (auto& row : rows) pointers.push_back(row.data());
    VertexOutputs outputs;
    outputs.rows = pointers.data();
    outputs.rowCount = uint32_t(pointers.size());
    outputs.vertexCount = uint32_t(rows[0].size());
    outputs.pointSizeRow = pointSizeRow;
    state.varyings = varyings;
    setupPrimitives(state, outputs, slots, firstId, arena, primitives, counters);
  }
};

//! Counts per (pixel, sample).
class Picture final : public BlockSink {
 public:
  Picture(uint32_t width, uint32_t height, uint32_t samples)
      : width(width), height(height), samples(samples), counts(size_t(width) * height * samples) {}
  void block(uint32_t x, uint32_t y, const uint16_t* masks) override {
    ASSERT_EQ(x % 4, 0u);
    ASSERT_EQ(y % 4, 0u);
    uint32_t any = 0;
    for (uint32_t s = 0; s < samples; s++) {
      any |= masks[s];
      for (uint32_t i = 0; i < 16; i++)
        if (masks[s] >> i & 1) {
          const uint32_t px = x + ((i & 1) | (i >> 2 & 1) << 1), py = y + ((i >> 1 & 1) | (i >> 3 & 1) << 1);
          ASSERT_LT(px, width);
          ASSERT_LT(py, height);
          at(px, py, s)++;
        }
    }
    ASSERT_NE(any, 0u) << "a block without coverage was reported";
  }
  uint8_t& at(uint32_t x, uint32_t y, uint32_t s = 0) { return counts[(size_t(y) * width + x) * samples + s]; }
  //! Through bins, as a render pass does it.
  void draw(const std::vector<Primitive>& primitives, const VkRect2D& bounds) {
    Bins bins{TileGrid(width, height)};
    for (const Primitive& p : primitives) bins.add(0, p);
    for (uint32_t t = 0; t < bins.grid().count(); t++)
      for (const BinEntry& entry : bins.tile(t))
        rasterize(*entry.primitive, t % bins.grid().tilesX, t / bins.grid().tilesX, bounds, samples, *this);
  }
  void draw(const Draw& d) { draw(d.primitives, d.state.bounds); }
  uint64_t total() const {
    uint64_t sum = 0;
    for (uint8_t c : counts) sum += c;
    return sum;
  }

  uint32_t width, height, samples;
  std::vector<uint8_t> counts;
};

//! The exact rule, written independently of the rasterizer: a point in 1/256 pixels against a snapped triangle.
inline bool insideTriangle(const std::array<std::array<int64_t, 2>, 3>& v, int64_t x, int64_t y) {
  using Wide = __int128;
  auto cross = [](const std::array<int64_t, 2>& a, const std::array<int64_t, 2>& b, int64_t px, int64_t py) {
    return Wide(b[0] - a[0]) * (py - a[1]) - Wide(b[1] - a[1]) * (px - a[0]);
  };
  const Wide area = cross(v[0], v[1], v[2][0], v[2][1]);
  if (area == 0) return false;
  for (int i = 0; i < 3; i++) {
    auto a = v[i], b = v[(i + 1) % 3];
    if (area < 0) std::swap(a, b);
    const Wide e = cross(a, b, x, y);
    if (e < 0) return false;
    if (e == 0) {
      // y down, clockwise on the screen: a left edge goes up, a top edge is level and goes right.
      const bool left = b[1] < a[1], top = b[1] == a[1] && b[0] > a[0];
      if (!left && !top) return false;
    }
  }
  return true;
}

}  // namespace pumice::raster::test
