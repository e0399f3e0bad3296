// Routines that outlive their pipeline: found again they give the same pictures without being linked, and no bytes in their
// place lead the executors astray.
#include <gtest/gtest.h>

#include "pipeline/saved_routines.h"
#include "spirv_interp/ir/bytes.h"
#include "spirv_interp/ir/one_record.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

const char* const kWaves = R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = vec4(fract(color.xy * 3.0 + gl_FragCoord.xy * 0.25), color.zw) * (gl_FrontFacing ? 0.5 : 1.0); })";
const char* const kLocals = R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() {
  float t[4] = float[](color.x, color.y, 0.25, 0.75);
  int k = int(color.x * 7.0);
  t[(1 + k) & 3] += t[1] * 0.125;
  t[(k * 3) & 3] -= t[k & 1] * 0.25;
  target = vec4(t[0], t[1], t[k & 3], 1);
})";

//! Reads no memory: what it becomes when its bytes are changed has no address to go wrong with (saved_routines.h).
const char* const kFromIndex = R"(#version 450
layout(location = 0) out vec4 outColor;
void main() {
  vec2 p = vec2(gl_VertexIndex % 2, gl_VertexIndex / 2 % 2) * 1.9;
  gl_Position = vec4(p * (1.0 - 0.25 * float(gl_VertexIndex / 3)) - 0.95, 0.25 + 0.1 * float(gl_VertexIndex), 1);
  outColor = vec4(p, 0.5, 0.75);
})";

//! A pass of rectangles, one of them with an equal depth, in an image that holds whole blocks and borders of primitives.
struct Pictured {
  Scene scene;
  std::shared_ptr<const frontend::Shader> vertex, fragment;
  GraphicsState state;

  explicit Pictured(const char* source, uint32_t size = 200, bool blend = false, const char* vertexSource = kColorVertex)
      : scene(size, size, VK_FORMAT_D32_SFLOAT), vertex(compile(frontend::Stage::Vertex, vertexSource)), fragment(compile(frontend::Stage::Fragment, source)), state(scene.state()) {
    state.depthTest = state.depthWrite = true;
    state.depthCompare = VK_COMPARE_OP_LESS_OR_EQUAL;
    if (blend) {
      state.blend[0].blendEnable = VK_TRUE;
      state.blend[0].srcColorBlendFactor = state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
    }
  }
  std::shared_ptr<GraphicsPipeline> make(std::shared_ptr<PipelineStore> store) {
    auto p = createGraphicsPipeline(state, std::make_shared<Layout>(), vertex, fragment, {std::move(store), {1, 2}, {3, 4}});
    EXPECT_TRUE(p.hasValue()) << (p ? "" : p.error().message);
    return p ? *p : nullptr;
  }
  std::vector<std::byte> draw(std::shared_ptr<PipelineStore> store, uint32_t passes = 1) {
    auto pipeline = make(std::move(store));
    if (!pipeline) return {};
    const DrawState d = scene.drawState(pipeline);
    const float side = float(scene.width);
    for (uint32_t pass = 0; pass < passes; ++pass) {
      scene.begin(0.1f, 0.2f, 0.3f, 1);
      scene.draw(d, rectangle(scene, 0, 0, side, side, 0.9f, {0.3f, 0.6f, 0.9f, 0.5f}));
      scene.draw(d, triangle(scene, {3, 5, side - 9, side * 0.3f, side * 0.2f, side - 3}, 0.5f, {0.9f, 0.1f, 0.4f, 0.7f}));
      scene.end();
    }
    return {scene.color.bytes.begin(), scene.color.bytes.end()};
  }
};

//! What a later run has of the store.
std::shared_ptr<PipelineStore> reloaded(const PipelineStore& store) {
  auto again = std::make_shared<PipelineStore>();
  for (const auto& [key, saved] : store.pipelines()) {
    auto read = SavedPipeline::fromBytes(saved->toBytes());
    EXPECT_TRUE(read);
    if (read) again->insert(key, read);
  }
  return again;
}

TEST(SavedRoutines, ALaterRunLinksNothingAndDrawsTheSame) {
  for (const char* source : {kColorFragment, kWaves, kLocals})
    for (bool blend : {false, true}) {
      Pictured p(source, 1000, blend);
      const auto usual = p.draw(nullptr, 3);
      auto store = std::make_shared<PipelineStore>();
      EXPECT_TRUE(p.draw(store, 3) == usual);
      const RoutineCounts before = routineCounts();
      auto later = reloaded(*store);
      EXPECT_TRUE(p.draw(later, 3) == usual);
      EXPECT_EQ(routineCounts().linked, before.linked);
      EXPECT_GE(routineCounts().restored, before.restored + 2);
      const SavedKeys keys = later->pipelines().begin()->second->keys();
      EXPECT_EQ(keys.vertex.size(), 1u);
      size_t ofKinds = 0;
      for (const FragmentKey& k : keys.fragment) ofKinds += k.rows != Rows::Any;
      EXPECT_GE(ofKinds, 1u) << "a million pixels a pass are worth a routine for rows of a kind";
    }
}

TEST(SavedRoutines, OtherStateIsAnotherPipeline) {
  Pictured p(kColorFragment);
  auto store = std::make_shared<PipelineStore>();
  p.draw(store);
  const auto changes = std::vector<std::function<void(GraphicsState&)>>{
      [](GraphicsState& s) { s.depthCompare = VK_COMPARE_OP_GREATER; }, [](GraphicsState& s) { s.blend[0].colorWriteMask = 7; },
      [](GraphicsState& s) { s.vertexAttributes[1].offset = 12; },       [](GraphicsState& s) { s.sampleMask = 0; },
      [](GraphicsState& s) { s.unrestrictedDepth = true; },              [](GraphicsState& s) { s.numerics = ir::Numerics::Oracle; }};
  for (size_t i = 0; i < changes.size(); ++i) {
    const GraphicsState kept = p.state;
    changes[i](p.state);
    const uint64_t before = routineCounts().restored;
    p.make(store);
    EXPECT_EQ(routineCounts().restored, before) << "change " << i;
    EXPECT_EQ(store->pipelines().size(), i + 2);
    p.state = kept;
  }
  // What no code is made from.
  p.state.viewport.width = 17;
  p.state.lineWidth = 3;
  const uint64_t before = routineCounts().linked;
  p.make(store);
  EXPECT_EQ(routineCounts().linked, before);
}

TEST(SavedRoutines, StoresAreMerged) {
  Pictured p(kWaves), q(kLocals);
  auto one = std::make_shared<PipelineStore>(), all = std::make_shared<PipelineStore>();
  const auto usual = p.draw(one);
  all->merge(*one);
  all->merge(*all);
  const uint64_t before = routineCounts().linked;
  EXPECT_TRUE(p.draw(all) == usual);
  EXPECT_EQ(routineCounts().linked, before);
}

// What the check is there for, thing by thing.
TEST(SavedRoutines, WhatIsNotThereMayNotBeNamed) {
  Surroundings s;
  s.inputs = {ir::Type::F32, ir::Type::None, ir::Type::I32};
  s.outputs = {ir::Type::F32};
  s.planes = {0, 4};
  s.recordBytes = 32;
  s.sets = 2;
  const auto refused = [&](const char* body) {
    ir::Function f;
    std::string error;
    EXPECT_TRUE(ir::parse(std::string("function \"f\"\n") + body, f, error)) << error << body;
    return !check(f, s).empty();
  };
  EXPECT_FALSE(refused("%1 = input f32 0\n%2 = input i32 2\noutput 0 %1\n"));
  EXPECT_TRUE(refused("%1 = input f32 1\n"));
  EXPECT_TRUE(refused("%1 = input f32 3\n"));
  EXPECT_TRUE(refused("%1 = input f64 0\n"));
  EXPECT_TRUE(refused("%1 = input f32 0\noutput 1 %1\n"));
  EXPECT_TRUE(refused("%1 = const f64 1\noutput 0 %1\n"));
  EXPECT_FALSE(refused("%1 = tile.load f32 1:4+0\n"));
  EXPECT_TRUE(refused("%1 = tile.load f32 0:4+0\n"));
  EXPECT_TRUE(refused("%1 = tile.load f32 2:4+0\n"));
  EXPECT_TRUE(refused("%1 = tile.load f32 1:8+4\n"));
  EXPECT_TRUE(refused("%1 = const f32 1\ntile.store 1:8+0 %1\n"));
  EXPECT_FALSE(refused("%1 = quad.load f32 28\n"));
  EXPECT_TRUE(refused("%1 = quad.load f32 29\n"));
  EXPECT_TRUE(refused("%1 = quad.load f64 28\n"));
  EXPECT_TRUE(refused(("%1 = quad.load f32 " + std::to_string(ir::kOneRecord) + "\n").c_str()));
  EXPECT_TRUE(refused("%1 = uniform i32 100000\n"));
  EXPECT_FALSE(refused("%1 = const i32 0\n%2 = table.load i32 set1+16 %1\n"));
  EXPECT_TRUE(refused("%1 = const i32 0\n%2 = table.load i32 set2+16 %1\n"));
  EXPECT_TRUE(refused("barrier\n"));
  EXPECT_TRUE(refused("%1 = const i32 0\n%2 = shared.load i32 +0 %1\n"));
  EXPECT_TRUE(refused("%1 = local.alloc i32 2000000\n"));
  EXPECT_TRUE(refused("%1 = helper.mask mask\n"));
  EXPECT_TRUE(refused("%1 = builtin i32 42:0\n"));
  EXPECT_TRUE(refused("%1 = shader.input f32 0:0\n"));
  s.workGroup = true;
  EXPECT_FALSE(refused("barrier\n%1 = const i32 0\n%2 = shared.load i32 +0 %1\n"));
}

// Each byte of each routine in turn: refused, or run. (Without loops: like any shader's, one may become endless.) Under a sanitizer the interpreter would be caught outside of its memory.
TEST(SavedRoutines, AnyOtherBytesAreRefusedOrHarmless) {
  size_t refused = 0, taken = 0;
  uint32_t random = 1;
  for (const char* source : {kWaves, kLocals}) {
    Pictured p(source, 24, source == kWaves, kFromIndex);
    auto store = std::make_shared<PipelineStore>();
    p.draw(store);
    const auto [key, saved] = *store->pipelines().begin();
    const auto bytes = saved->toBytes();
    for (size_t at = 0; at < bytes.size(); ++at)
      for (int k = 0; k < 3; ++k) {
        auto changed = bytes;
        random = random * 1664525u + 1013904223u;
        changed[at] = k == 0 ? ~bytes[at] : k == 1 ? bytes[at] ^ std::byte(1) : std::byte(random >> 24);
        auto read = SavedPipeline::fromBytes(changed);
        if (!read) {
          ++refused;
          continue;
        }
        auto hostile = std::make_shared<PipelineStore>();
        hostile->insert(key, read);
        const uint64_t before = routineCounts().restored;
        p.draw(hostile);
        ++(routineCounts().restored >= before + 2 ? taken : refused);
      }
    for (size_t n = 0; n < bytes.size(); ++n) ASSERT_FALSE(SavedPipeline::fromBytes({bytes.data(), n})) << n << " of " << bytes.size() << " bytes";
  }
  EXPECT_GT(refused, taken / 4) << "of " << taken + refused;
  EXPECT_GT(taken, 100u);
}

}  // namespace
}  // namespace pumice::pipeline::test
