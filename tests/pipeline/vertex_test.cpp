// The front end: indices, instances, attribute formats, robust fetches, uniform buffers, linking of stages.
#include <gtest/gtest.h>

#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

using Rgba = std::array<uint8_t, 4>;

TEST(Vertex, IndicesAreReadAndSharedVerticesRunOnce) {
  Scene s(64, 64);
  auto d = s.drawState(s.pipeline(s.state()));
  auto corners = rectangle(s, 8, 8, 24, 24, 0.5f, {1, 0, 0, 1});
  const std::vector<ColorVertex> v = {{{9, 9, 9, 1}, {}}, corners[0], corners[1], corners[2], corners[4]};
  const uint16_t indices[] = {77, 0, 1, 2, 1, 3, 2};
  d.vertexBuffers[0] = {uint64_t(v.data()), v.size() * sizeof(ColorVertex)};
  d.indexBase = uint64_t(indices);
  d.indexSize = sizeof indices;
  d.indexType = VK_INDEX_TYPE_UINT16;
  DrawParams p;
  p.indexed = true;
  p.count = 6;
  p.first = 1;
  p.vertexOffset = 1;
  s.begin();
  s.draw(d, p);
  s.end();
  EXPECT_EQ(s.color.rgba(8, 8)[0], 255);
  EXPECT_EQ(s.color.rgba(23, 23)[0], 255);
  EXPECT_EQ(s.color.rgba(24, 23)[0], 0);
  EXPECT_EQ(s.executor.counters().verticesShaded, 4u);
  EXPECT_EQ(s.executor.counters().verticesReused, 2u);
}

TEST(Vertex, StripRestartsAtTheRestartIndex) {
  Scene s(64, 64);
  GraphicsState state = s.state();
  state.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP;
  state.primitiveRestart = true;
  state.cullMode = VK_CULL_MODE_BACK_BIT;
  state.frontFace = VK_FRONT_FACE_CLOCKWISE;
  auto d = s.drawState(s.pipeline(state));
  std::vector<ColorVertex> v;
  for (float x : {4.f, 36.f}) {
    const auto r = rectangle(s, x, 4, x + 20, 24, 0.5f, {1, 1, 1, 1});
    for (int i : {0, 1, 2, 4}) v.push_back(r[size_t(i)]);
  }
  const uint8_t indices[] = {0, 1, 2, 3, 255, 4, 5, 6, 7};
  d.vertexBuffers[0] = {uint64_t(v.data()), v.size() * sizeof(ColorVertex)};
  d.indexBase = uint64_t(indices);
  d.indexSize = sizeof indices;
  d.indexType = VK_INDEX_TYPE_UINT8_EXT;
  DrawParams p;
  p.indexed = true;
  p.count = 9;
  s.begin();
  s.draw(d, p);
  s.end();
  int covered = 0;
  for (uint32_t y = 0; y < 64; ++y)
    for (uint32_t x = 0; x < 64; ++x) covered += s.color.rgba(x, y)[0] == 255;
  EXPECT_EQ(covered, 2 * 20 * 20);
  EXPECT_EQ(s.color.rgba(30, 10)[0], 0);
}

TEST(Vertex, LongStripKeepsItsWindingFromChunkToChunk) {
  Scene s(256, 64);
  GraphicsState state = s.state();
  state.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP;
  state.cullMode = VK_CULL_MODE_BACK_BIT;
  state.frontFace = VK_FRONT_FACE_CLOCKWISE;
  auto d = s.drawState(s.pipeline(state));
  std::vector<ColorVertex> v;
  for (int i = 0; i <= 2000; ++i) {
    const float x = float(i / 2) * 0.256f / 256 * 2 - 1;
    v.push_back({{x, i & 1 ? 0.5f : -0.5f, 0.5f, 1}, {1, 1, 1, 1}});
  }
  std::vector<ColorVertex> turned;   // upper vertex second: clockwise on the screen
  for (size_t i = 0; i + 1 < v.size(); i += 2) turned.push_back(v[i + 1]), turned.push_back(v[i]);
  s.begin();
  s.draw(d, turned);
  s.end();
  for (uint32_t x = 0; x < 255; ++x) ASSERT_EQ(s.color.rgba(x, 32)[0], 255) << x;
}

TEST(Vertex, InstancesStepTheirAttributesAndShareRows) {
  Scene s(64, 64);
  GraphicsState state = s.state();
  state.vertexBindings = {{0, 8, VK_VERTEX_INPUT_RATE_VERTEX}, {3, 12, VK_VERTEX_INPUT_RATE_INSTANCE}};
  state.vertexAttributes = {{0, 0, VK_FORMAT_R32G32_SFLOAT, 0}, {2, 3, VK_FORMAT_R8G8B8A8_UNORM, 8}, {1, 3, VK_FORMAT_R16G16_SNORM, 0}, {4, 3, VK_FORMAT_R32_UINT, 4}};
  auto d = s.drawState(s.pipeline(state, R"(#version 450
layout(location = 0) in vec4 corner;
layout(location = 1) in vec2 offset;
layout(location = 2) in vec4 color;
layout(location = 4) in uint number;
layout(location = 0) out vec4 outColor;
void main() {
  gl_Position = vec4(corner.xy / 16.0 + offset, corner.z, corner.w);   // z and w are filled up with 0 and 1
  outColor = number == uint(gl_InstanceIndex) ? color : vec4(1);
})"));
  const float corners[6][2] = {{-1, -1}, {1, -1}, {-1, 1}, {1, -1}, {1, 1}, {-1, 1}};
  struct Instance { int16_t offset[2]; uint32_t number; Rgba color; };
  std::vector<Instance> instances;
  for (uint32_t i = 0; i < 64; ++i) {
    const float x = (float(i % 8) + 0.5f) / 4 - 1, y = (float(i / 8) + 0.5f) / 4 - 1;
    instances.push_back({{int16_t(x * 32767), int16_t(y * 32767)}, i, {uint8_t(i), uint8_t(255 - i), 7, 255}});
  }
  d.vertexBuffers[0] = {uint64_t(corners), sizeof corners};
  d.vertexBuffers[3] = {uint64_t(instances.data()), instances.size() * sizeof(Instance)};
  DrawParams p;
  p.count = 6;
  p.instanceCount = 62;
  p.firstInstance = 2;
  s.begin();
  s.draw(d, p);
  s.end();
  for (uint32_t i = 0; i < 64; ++i) {
    const Rgba c = s.color.rgba(i % 8 * 8 + 4, i / 8 * 8 + 4);
    EXPECT_EQ(c, i < 2 ? (Rgba{0, 0, 0, 0}) : (Rgba{uint8_t(i), uint8_t(255 - i), 7, 255})) << i;
  }
}

TEST(Vertex, FetchesOutsideTheBufferAreHarmless) {
  Scene s(32, 32);
  auto d = s.drawState(s.pipeline(s.state()));
  auto v = rectangle(s, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1});
  const uint32_t indices[] = {0, 1, 2, 0xfffffff0u, 0x80000000u, 12345678u};
  d.vertexBuffers[0] = {uint64_t(v.data()), 3 * sizeof(ColorVertex)};
  d.indexBase = uint64_t(indices);
  d.indexSize = sizeof indices;
  d.indexType = VK_INDEX_TYPE_UINT32;
  DrawParams p;
  p.indexed = true;
  p.count = 60;   // beyond the index buffer too
  s.begin();
  s.draw(d, p);
  s.end();
  EXPECT_EQ(s.color.rgba(2, 2)[0], 255);
  EXPECT_EQ(s.color.rgba(30, 30)[0], 0);
}

TEST(Vertex, UniformAndPushConstantsReachBothStages) {
  Scene s(32, 32);
  auto layout = std::make_shared<Layout>();
  layout->sets.resize(2);
  Binding uniform;
  uniform.type = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC;
  uniform.count = 1;
  uniform.offset = 64;
  uniform.stride = texture::descriptorStride(uniform.type);
  layout->sets[1].bindings.set(3, uniform);
  layout->sets[1].size = 128;
  layout->sets[1].dynamicCount = 1;
  layout->dynamicBase = {0, 0};
  layout->pushBytes = 16;
  const char* declarations = R"(#version 450
layout(set = 1, binding = 3) uniform U { vec4 scale; vec4 tint; } u;
layout(push_constant) uniform P { vec4 move; } p;
)";
  auto d = s.drawState(s.pipeline(s.state(), std::string(declarations) + R"(
layout(location = 0) in vec4 position;
void main() { gl_Position = position * u.scale + p.move; })",
                                  std::string(declarations) + R"(
layout(location = 0) out vec4 target;
void main() { target = u.tint + vec4(0, p.move.y, 0, 0); })",
                                  layout));
  const float buffer[24] = {9, 9, 9, 9, 9, 9, 9, 9, 0.5f, 1, 1, 1, 0.2f, 0.4f, 0.6f, 1};
  std::array<std::byte, 128> set{};
  texture::BufferDescriptor descriptor;
  descriptor.base = uint64_t(buffer);
  descriptor.size = 32;
  std::memcpy(set.data() + 64, &descriptor, sizeof descriptor);
  d.setMemory[1] = set.data();
  d.setSize[1] = set.size();
  d.dynamicOffsets[0] = 32;
  const float push[4] = {0.5f, 0, 0, 0};
  std::memcpy(d.push, push, sizeof push);
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ(s.color.rgba(15, 16), (Rgba{0, 0, 0, 0}));
  EXPECT_EQ(s.color.rgba(16, 16), (Rgba{51, 102, 153, 255}));
  EXPECT_EQ(s.color.rgba(31, 0), (Rgba{51, 102, 153, 255}));
}

TEST(Vertex, InputsThatTheVertexShaderDoesNotWriteAreZeroAndFlatOnesComeFromTheFirstVertex) {
  Scene s(32, 32);
  auto d = s.drawState(s.pipeline(s.state(), R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 2) flat out uint number;
layout(location = 5) out vec4 unread;
void main() { gl_Position = position; number = 100u + uint(gl_VertexIndex); unread = position; })",
                                  R"(#version 450
layout(location = 2) flat in uint number;
layout(location = 3) in vec2 missing;
layout(location = 0) out vec4 target;
void main() { target = vec4(float(number) / 255.0, missing, gl_FrontFacing ? 1.0 : 0.5); })"));
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ(s.color.rgba(3, 3), (Rgba{100, 0, 0, 128}));
  EXPECT_EQ(s.color.rgba(30, 30), (Rgba{103, 0, 0, 128}));
}

}  // namespace
}  // namespace pumice::pipeline::test
