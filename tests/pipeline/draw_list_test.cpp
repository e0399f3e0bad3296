// The list of collected draws: what is kept, what is used again; and draws with values of their own, more than are collected at once.
#include <gtest/gtest.h>

#include <cstring>

#include "pipeline/pass_impl.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

constexpr uint32_t kConstants = 100, kPush = 20, kTables = 5, kRanges = 2;

//! A record whose values all say `n`; `more` further tables.
void add(DrawList& list, uint32_t n, uint32_t more = 0) {
  DrawRecord& record = list.add();
  const DrawList::Values v = list.makeValues({kConstants, kPush, kTables + more, kRanges});
  record.samples = n;
  std::memset(v.constants, int(n & 0xff), kConstants);
  std::memset(v.push, int(n & 0xff), kPush);
  for (uint32_t t = 0; t < kTables + more; ++t) record.tables[t] = {v.constants, n};
  for (uint32_t r = 0; r < kRanges; ++r) record.depthRanges[r] = {float(n), float(n) + 1};
}

void expect(DrawList& list, size_t i, uint32_t n, uint32_t more = 0) {
  const DrawRecord& record = list[i];
  ASSERT_EQ(record.samples, n);
  for (uint32_t t = 0; t < kTables + more; ++t) {
    ASSERT_EQ(record.tables[t].size, n);
    for (uint32_t b = 0; b < kConstants; ++b) ASSERT_EQ(record.tables[t].data[b], std::byte(n & 0xff)) << n << ", byte " << b;
  }
  for (uint32_t r = 0; r < kRanges; ++r) ASSERT_EQ(record.depthRanges[r].high, float(n) + 1);
}

TEST(DrawList, RecordsAndTheirValuesStayUntilTheyAreForgotten) {
  DrawList list;
  uint32_t n = 0;
  for (uint32_t round = 0; round < 5; ++round) {   // each begins at another place of a slab
    const uint32_t first = n;
    std::vector<const std::byte*> places;
    for (uint32_t i = 0; i < 333; ++i, ++n) {
      add(list, n, n % 7 == 3 ? 30 : 0);
      places.push_back(list[list.size() - 1].tables[0].data);
    }
    const size_t kept = list.size() - 333;   // the last one of the round before
    ASSERT_EQ(kept, round ? 1u : 0u);
    if (kept) expect(list, 0, first - 1, (first - 1) % 7 == 3 ? 30 : 0);
    for (uint32_t i = 0; i < 333; ++i) {
      expect(list, kept + i, first + i, (first + i) % 7 == 3 ? 30 : 0);
      ASSERT_EQ(list[kept + i].tables[0].data, places[i]) << "it moved";
    }
    list.keepLast();
    ASSERT_EQ(list.size(), 1u);
    expect(list, 0, n - 1, (n - 1) % 7 == 3 ? 30 : 0);
    ASSERT_EQ(list[0].tables[0].data, places.back()) << "it moved";
  }
  list.clear();
  EXPECT_EQ(list.size(), 0u);
}

TEST(DrawList, ValuesOfADrawThatIsTakenBackAreUsedAgain) {
  DrawList list;
  add(list, 1);
  add(list, 2);
  const std::byte* place = list[1].tables[0].data;
  for (uint32_t i = 0; i < 1000; ++i) {
    list.removeLast();
    add(list, 3 + i);
    ASSERT_EQ(list[1].tables[0].data, place);
  }
  expect(list, 0, 1);
  expect(list, 1, 1002);
}

//! Pixels of 2 x 2, each a draw with its own push constants and dynamic offset.
void mosaic(uint32_t sets, uint32_t offsets) {
  constexpr uint32_t kColumns = 64, kRows = 100, kCount = kColumns * kRows;
  static_assert(kCount > 3 * kDrawBudget);
  Scene s(kColumns * 2, kRows * 2, VK_FORMAT_UNDEFINED, 2);
  auto layout = std::make_shared<Layout>();
  layout->pushBytes = 32;
  layout->sets.resize(sets);
  layout->dynamicBase.assign(sets, 0);
  layout->dynamicBase.back() = offsets - 1;
  layout->sets.back().dynamicCount = 1;
  Binding b;
  b.type = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC;
  b.count = 1;
  b.stride = texture::descriptorStride(b.type);
  layout->sets.back().bindings.set(0, b);
  layout->sets.back().size = b.stride;
  std::vector<float> greens(kRows * 4);
  for (uint32_t y = 0; y < kRows; ++y) greens[y * 4] = float(y) / 255;
  std::vector<std::byte> set(b.stride);
  texture::BufferDescriptor descriptor;
  descriptor.base = reinterpret_cast<uint64_t>(greens.data());
  descriptor.size = greens.size() * 4;
  std::memcpy(set.data(), &descriptor, sizeof descriptor);
  auto d = s.drawState(s.pipeline(s.state(), R"(#version 450
layout(push_constant) uniform Push { layout(offset = 8) vec2 corner; float red; };
void main() { gl_Position = vec4(corner + vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * vec2(4.0 / 128, 4.0 / 200), 0.5, 1); })",
                                  "#version 450\nlayout(set = " + std::to_string(sets - 1) + R"(, binding = 0) uniform Green { float green; };
layout(push_constant) uniform Push { layout(offset = 16) float red; };
layout(location = 0) out vec4 target;
void main() { target = vec4(red, green, 1, 1); })", layout));
  d.setMemory[sets - 1] = set.data();
  d.setSize[sets - 1] = set.size();
  s.begin();
  for (uint32_t y = 0; y < kRows; ++y)
    for (uint32_t x = 0; x < kColumns; ++x) {
      // Half of the pixel's triangle lies beyond its 2 x 2: the next ones cover it.
      const float push[3] = {float(x) / kColumns * 2 - 1, float(y) / kRows * 2 - 1, float(x) / 255};
      std::memcpy(d.push + 8, push, sizeof push);
      d.dynamicOffsets[offsets - 1] = y * 16;
      s.draw(d, {.count = 3, .drawIndex = y * kColumns + x});
    }
  s.end();
  EXPECT_EQ(s.executor.counters().draws, kCount);
  for (uint32_t y = 0; y < kRows; ++y)
    for (uint32_t x = 0; x < kColumns; ++x)
      ASSERT_EQ(s.color.rgba(x * 2, y * 2), (std::array<uint8_t, 4>{uint8_t(x), uint8_t(y), 255, 255})) << x << ", " << y << ", " << sets << " sets";
}

TEST(DrawList, EachOfThousandsOfDrawsSeesItsOwnValues) {
  mosaic(1, 1);
  mosaic(4, 32);
  mosaic(32, 7);   // more than a slab holds for each
}

}  // namespace
}  // namespace pumice::pipeline::test
