// What a scene does not need is not done: counters, held against what can be seen of the work itself.
#include <gtest/gtest.h>

#include "pipeline/ideas.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

TEST(Statistics, EarlyDepthRejectsBeforeTheShader) {
  Scene s(64, 64, VK_FORMAT_D32_SFLOAT);
  s.executor.collectStatistics(true);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state));
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 64, 64, 0.25f, {1, 0, 0, 1}));
  s.draw(d, rectangle(s, 0, 0, 64, 32, 0.5f, {0, 1, 0, 1}));   // behind
  s.draw(d, rectangle(s, 0, 0, 32, 32, 0.125f, {0, 0, 1, 1}));
  s.end();
  const PassCounters& c = s.executor.counters();
  EXPECT_EQ(c.fragmentsCovered, 64u * 64 + 64 * 32 + 32 * 32);
  EXPECT_EQ(c.fragmentsShaded, 64u * 64) << "the last rectangle hides part of the first, which is not shaded there";
  EXPECT_EQ(c.samplesTested, c.fragmentsCovered);
  EXPECT_EQ(c.samplesPassed, 64u * 64 + 32 * 32);
  EXPECT_EQ(c.samplesHidden, 32u * 32);
  EXPECT_EQ(c.varyingsInterpolated, 12u);
}

TEST(Statistics, ShadersThatMayNotBeSkippedRun) {
  // A discard makes the test late: the fragments that fail it are shaded.
  Scene s(32, 32, VK_FORMAT_D32_SFLOAT);
  s.executor.disable(bit(Idea::HiZ));
  s.executor.collectStatistics(true);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state, kColorVertex, R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { if (color.a < 0.5) discard; target = color; })"));
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 32, 32, 0.25f, {1, 0, 0, 1}));
  s.draw(d, rectangle(s, 0, 0, 32, 16, 0.5f, {0, 1, 0, 1}));
  s.draw(d, rectangle(s, 0, 0, 16, 16, 0.125f, {0, 0, 1, 0}));
  s.end();
  EXPECT_EQ(s.executor.counters().fragmentsShaded, 32u * 32 + 32 * 16 + 16 * 16);
  EXPECT_EQ(s.executor.counters().samplesPassed, 32u * 32);
}

TEST(Statistics, DepthOnlyPassRunsNoFragmentShaderAndDropsVaryings) {
  Scene s(64, 64, VK_FORMAT_D32_SFLOAT);
  s.executor.collectStatistics(true);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  state.colorCount = 0;
  state.blend.clear();
  auto d = s.drawState(s.pipeline(state, kColorVertex, ""));
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 64, 64, 0.25f, {1, 0, 0, 1}));
  s.end();
  const PassCounters& c = s.executor.counters();
  EXPECT_EQ(s.depth->at<float>(5, 5, VK_IMAGE_ASPECT_DEPTH_BIT), 0.25f);
  EXPECT_EQ(c.fragmentsCovered, 64u * 64);
  EXPECT_EQ(c.fragmentsShaded, 0u);
  EXPECT_EQ(c.varyingsInterpolated, 0u);
  EXPECT_EQ(c.varyingsDropped, 4u);
}

TEST(Statistics, AFragmentShaderWhoseColorsAreMaskedIsNotRun) {
  for (bool masked : {true, false}) {
    Scene s(64, 64, VK_FORMAT_D32_SFLOAT);
    s.executor.collectStatistics(true);
    GraphicsState state = s.state();
    state.depthTest = state.depthWrite = true;
    state.depthCompare = VK_COMPARE_OP_LESS;
    if (masked) state.blend[0].colorWriteMask = 0;
    auto d = s.drawState(s.pipeline(state));
    s.begin(0, 0, 1, 1);
    s.draw(d, rectangle(s, 0, 0, 64, 64, 0.25f, {1, 0, 0, 1}));
    s.end();
    const PassCounters& c = s.executor.counters();
    EXPECT_EQ(s.depth->at<float>(5, 5, VK_IMAGE_ASPECT_DEPTH_BIT), 0.25f);
    EXPECT_EQ(s.color.rgba(5, 5), (masked ? std::array<uint8_t, 4>{0, 0, 255, 255} : std::array<uint8_t, 4>{255, 0, 0, 255}));
    EXPECT_EQ(c.fragmentsShaded, masked ? 0u : 64u * 64);
    EXPECT_EQ(c.varyingsInterpolated, masked ? 0u : 4u);
  }
}

TEST(Statistics, UnreadVaryingIsNeitherWrittenNorInterpolated) {
  Scene s(16, 16);
  auto p = s.pipeline(s.state(), R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 unread;
layout(location = 1) out vec4 half_read;
void main() { gl_Position = position; unread = color * 3; half_read = color; })", R"(#version 450
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = vec4(color.xy, 0, 1); })");
  s.executor.collectStatistics(true);
  auto d = s.drawState(p);
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 16, 16, 0.25f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ(s.executor.counters().varyingsInterpolated, 2u);
  EXPECT_EQ(s.executor.counters().varyingsDropped, 6u);
  EXPECT_EQ(s.color.rgba(3, 3), (std::array<uint8_t, 4>{255, 255, 0, 255}));
}

TEST(Statistics, DontCareMovesNoBytes) {
  Scene s(128, 64, VK_FORMAT_D32_SFLOAT);
  s.executor.collectStatistics(true);
  auto d = s.drawState(s.pipeline(s.state()));
  s.begin(0, 0, 1, 1, 0.75f);
  s.end();
  EXPECT_EQ(s.executor.counters().bytesCleared, 2u * 128 * 64 * 4);
  // Then: nothing loaded, nothing kept, one tile of two drawn. What no draw reaches is left as it was.
  s.begin();
  for (Attachment* a : {&s.pass.color[0], &s.pass.depthStencil}) {
    a->loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    a->storeOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  }
  s.executor.begin(s.pass);
  s.draw(d, rectangle(s, 4, 4, 8, 8, 0.25f, {1, 0, 0, 1}));
  s.end();
  const PassCounters& c = s.executor.counters();
  EXPECT_EQ(c.tilesTouched, 1u);
  EXPECT_EQ(c.bytesCleared + c.bytesLoaded + c.bytesStored, 0u);
  EXPECT_EQ(s.color.rgba(100, 20), (std::array<uint8_t, 4>{0, 0, 255, 255}));
  EXPECT_EQ(s.depth->at<float>(5, 5, VK_IMAGE_ASPECT_DEPTH_BIT), 0.75f) << "the draw has no depth state, so it writes none";
  // Loading and keeping the colour: the drawn tile counts.
  s.pass.color[0].loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  s.pass.color[0].storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  s.executor.begin(s.pass);
  s.draw(d, rectangle(s, 4, 4, 8, 8, 0.25f, {1, 0, 0, 1}));
  s.end();
  EXPECT_EQ(s.executor.counters().bytesLoaded, 64u * 64 * 4);
  EXPECT_EQ(s.executor.counters().bytesStored, 64u * 64 * 4);
}

TEST(Statistics, TrianglesAreCountedByTheReasonTheyGoFor) {
  Scene s(64, 64);
  GraphicsState state = s.state();
  state.cullMode = VK_CULL_MODE_BACK_BIT;
  state.frontFace = VK_FRONT_FACE_CLOCKWISE;
  auto d = s.drawState(s.pipeline(state));
  s.begin();
  s.draw(d, triangle(s, {2, 2, 60, 2, 2, 60}, 0.5f, {1, 1, 1, 1}));       // stays
  s.draw(d, triangle(s, {2, 2, 2, 60, 60, 2}, 0.5f, {1, 1, 1, 1}));       // faces away
  s.draw(d, triangle(s, {2, 2, 30, 30, 60, 60}, 0.5f, {1, 1, 1, 1}));     // no area
  s.draw(d, triangle(s, {2, 2, 60, 2, 2, 60}, 1.5f, {1, 1, 1, 1}));       // beyond the far plane
  s.draw(d, triangle(s, {100, 2, 160, 2, 100, 60}, 0.5f, {1, 1, 1, 1}));  // right of the framebuffer
  s.draw(d, triangle(s, {5.6f, 5.6f, 5.9f, 5.6f, 5.6f, 5.9f}, 0.5f, {1, 1, 1, 1}));   // between pixel centres
  s.end();
  const raster::SetupCounters& c = s.executor.counters().setup;
  EXPECT_EQ(c.input, 6u);
  EXPECT_EQ(c.output, 1u);
  EXPECT_EQ(c.culledFace, 1u);
  EXPECT_EQ(c.culledZeroArea, 1u);
  EXPECT_EQ(c.clippedAway, 1u);
  EXPECT_EQ(c.culledOutside, 1u);
  EXPECT_EQ(c.culledNoSample, 1u);
}

}  // namespace
}  // namespace pumice::pipeline::test
