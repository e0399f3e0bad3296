// The fixed function after the shader: depth, stencil, discard, blending, masks, occlusion.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

using Rgba = std::array<uint8_t, 4>;

bool passes(VkCompareOp op, double a, double b) {
  switch (op) {
    case VK_COMPARE_OP_NEVER: return false;
    case VK_COMPARE_OP_LESS: return a < b;
    case VK_COMPARE_OP_EQUAL: return a == b;
    case VK_COMPARE_OP_LESS_OR_EQUAL: return a <= b;
    case VK_COMPARE_OP_GREATER: return a > b;
    case VK_COMPARE_OP_NOT_EQUAL: return a != b;
    case VK_COMPARE_OP_GREATER_OR_EQUAL: return a >= b;
    default: return true;
  }
}

class DepthFormats : public testing::TestWithParam<VkFormat> {};

TEST_P(DepthFormats, EveryCompareOperationDecidesAndWrites) {
  for (int op = 0; op < 8; ++op)
    for (float z : {0.25f, 0.5f, 0.75f}) {
      Scene s(20, 12, GetParam());
      GraphicsState state = s.state();
      state.depthTest = state.depthWrite = true;
      state.depthCompare = VkCompareOp(op);
      auto d = s.drawState(s.pipeline(state));
      s.begin(0, 0, 0, 1, 0.5f);
      s.draw(d, rectangle(s, 4, 4, 12, 8, z, {1, 1, 1, 1}));
      s.end();
      const bool pass = passes(VkCompareOp(op), z, 0.5);
      EXPECT_EQ(s.color.rgba(5, 5)[0], pass ? 255 : 0) << "op " << op << " z " << z;
      EXPECT_EQ(s.color.rgba(3, 5)[0], 0);
      const double stored = pass ? z : 0.5;
      if (GetParam() == VK_FORMAT_D16_UNORM) {
        EXPECT_EQ(s.depth->at<uint16_t>(6, 6, VK_IMAGE_ASPECT_DEPTH_BIT), std::lround(stored * 65535)) << op;
      } else if (GetParam() == VK_FORMAT_D24_UNORM_S8_UINT) {
        EXPECT_NEAR(s.depth->at<uint32_t>(6, 6, VK_IMAGE_ASPECT_DEPTH_BIT) & 0xffffff, stored * 0xffffff, 0.51) << op;
      } else {
        EXPECT_EQ(s.depth->at<float>(6, 6, VK_IMAGE_ASPECT_DEPTH_BIT), float(stored)) << op;
      }
    }
}
INSTANTIATE_TEST_SUITE_P(All, DepthFormats,
                         testing::Values(VK_FORMAT_D16_UNORM, VK_FORMAT_D24_UNORM_S8_UINT, VK_FORMAT_D32_SFLOAT, VK_FORMAT_D32_SFLOAT_S8_UINT));

TEST(Fragment, NearerPrimitiveWinsInEitherOrderWithinOneDraw) {
  for (bool nearFirst : {false, true}) {
    Scene s(64, 64, VK_FORMAT_D32_SFLOAT);
    GraphicsState state = s.state();
    state.depthTest = state.depthWrite = true;
    state.depthCompare = VK_COMPARE_OP_LESS;
    auto d = s.drawState(s.pipeline(state));
    auto first = rectangle(s, 0, 0, 8, 8, nearFirst ? 0.2f : 0.8f, {nearFirst ? 1.f : 0.f, 0, 0, 1});
    auto second = rectangle(s, 4, 4, 12, 12, nearFirst ? 0.8f : 0.2f, {nearFirst ? 0.f : 1.f, 0, 0, 1});
    first.insert(first.end(), second.begin(), second.end());
    s.begin();
    s.draw(d, first);
    s.end();
    EXPECT_EQ(s.color.rgba(6, 6)[0], 255) << nearFirst;
    EXPECT_EQ(s.color.rgba(2, 2)[0], nearFirst ? 255 : 0);
    EXPECT_EQ(s.color.rgba(10, 10)[0], nearFirst ? 0 : 255);
  }
}

TEST(Fragment, DiscardedPixelsLeaveColourAndDepthAlone) {
  Scene s(32, 32, VK_FORMAT_D32_SFLOAT);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state, kColorVertex, R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() {
  if ((int(gl_FragCoord.x) + int(gl_FragCoord.y)) % 3 == 0) discard;
  target = color;
})"));
  s.begin(0, 0, 0, 0, 1);
  s.draw(d, rectangle(s, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1}));
  s.end();
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) {
      const bool gone = (x + y) % 3 == 0;
      ASSERT_EQ(s.color.rgba(x, y)[0], gone ? 0 : 255) << x << ", " << y;
      ASSERT_EQ(s.depth->at<float>(x, y, VK_IMAGE_ASPECT_DEPTH_BIT), gone ? 1.f : 0.5f);
    }
}

TEST(Fragment, DerivativesSeeHelperLanesAtEdges) {
  Scene s(32, 32);
  auto d = s.drawState(s.pipeline(s.state(), kColorVertex, R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = vec4(dFdx(gl_FragCoord.x) * 0.5, dFdy(gl_FragCoord.y) * 0.25, dFdx(color.x) * 32.0 * 0.5, 1); })"));
  auto v = triangle(s, {1, 1, 30, 3, 5, 29}, 0.5f, {0, 0, 0, 1});
  for (auto& p : v) p.color[0] = p.position[0];   // 2 over 32 pixels
  s.begin();
  s.draw(d, v);
  s.end();
  int covered = 0;
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) {
      const Rgba c = s.color.rgba(x, y);
      if (!c[3]) continue;
      ++covered;
      ASSERT_EQ(c[0], 128) << x << ", " << y;
      ASSERT_EQ(c[1], 64);
      ASSERT_EQ(c[2], 255);
    }
  EXPECT_GT(covered, 300);
}

TEST(Fragment, StencilCountsAndMasks) {
  Scene s(32, 32, VK_FORMAT_D24_UNORM_S8_UINT);
  GraphicsState state = s.state();
  state.stencilTest = true;
  state.stencilFront = {VK_STENCIL_OP_KEEP, VK_STENCIL_OP_INCREMENT_AND_WRAP, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_ALWAYS, 0xff, 0xff, 0};
  state.stencilBack = {VK_STENCIL_OP_KEEP, VK_STENCIL_OP_DECREMENT_AND_WRAP, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_ALWAYS, 0xff, 0xff, 0};
  auto count = s.drawState(s.pipeline(state));
  state.stencilFront = state.stencilBack = {VK_STENCIL_OP_ZERO, VK_STENCIL_OP_REPLACE, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_EQUAL, 0xff, 0x0f, 0x12};
  auto pick = s.drawState(s.pipeline(state));
  s.begin(0, 0, 0, 1, 1, 0x11);
  // Clockwise on the screen (y down) faces away when counter-clockwise is the front.
  s.draw(count, triangle(s, {0, 0, 0, 64, 64, 0}, 0.5f, {0, 0, 0, 1}));
  s.draw(count, triangle(s, {0, 0, 16, 0, 0, 16}, 0.5f, {0, 0, 0, 1}));
  s.draw(pick, rectangle(s, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1}));
  s.end();
  // Corner: +1 - 1 = 0x11, differs from 0x12: zeroed. Elsewhere 0x12 passes, low four bits replaced by 2.
  const uint8_t inside = s.depth->at<uint8_t>(2, 2, VK_IMAGE_ASPECT_STENCIL_BIT), outside = s.depth->at<uint8_t>(20, 20, VK_IMAGE_ASPECT_STENCIL_BIT);
  EXPECT_EQ(outside, 0x12);
  EXPECT_EQ(s.color.rgba(20, 20)[0], 255);
  EXPECT_EQ(inside, 0x11 & 0xf0);
  EXPECT_EQ(s.color.rgba(2, 2)[0], 0);
}

TEST(Fragment, WriteMaskKeepsComponents) {
  Scene s(16, 16);
  GraphicsState state = s.state();
  state.blend[0].colorWriteMask = VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_A_BIT;
  auto d = s.drawState(s.pipeline(state));
  s.begin(0.2f, 0.4f, 0.6f, 0.8f);
  s.draw(d, rectangle(s, 0, 0, 16, 16, 0.5f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ(s.color.rgba(7, 7), (Rgba{51, 255, 153, 255}));
}

struct Factor { VkBlendFactor factor; double (*value)(const double* s, const double* d, const double* k, int c); };
const Factor kFactors[] = {
    {VK_BLEND_FACTOR_ZERO, [](auto, auto, auto, int) { return 0.0; }},
    {VK_BLEND_FACTOR_ONE, [](auto, auto, auto, int) { return 1.0; }},
    {VK_BLEND_FACTOR_SRC_COLOR, [](auto s, auto, auto, int c) { return s[c]; }},
    {VK_BLEND_FACTOR_ONE_MINUS_SRC_COLOR, [](auto s, auto, auto, int c) { return 1 - s[c]; }},
    {VK_BLEND_FACTOR_DST_COLOR, [](auto, auto d, auto, int c) { return d[c]; }},
    {VK_BLEND_FACTOR_ONE_MINUS_DST_COLOR, [](auto, auto d, auto, int c) { return 1 - d[c]; }},
    {VK_BLEND_FACTOR_SRC_ALPHA, [](auto s, auto, auto, int) { return s[3]; }},
    {VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA, [](auto s, auto, auto, int) { return 1 - s[3]; }},
    {VK_BLEND_FACTOR_DST_ALPHA, [](auto, auto d, auto, int) { return d[3]; }},
    {VK_BLEND_FACTOR_ONE_MINUS_DST_ALPHA, [](auto, auto d, auto, int) { return 1 - d[3]; }},
    {VK_BLEND_FACTOR_CONSTANT_COLOR, [](auto, auto, auto k, int c) { return k[c]; }},
    {VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_COLOR, [](auto, auto, auto k, int c) { return 1 - k[c]; }},
    {VK_BLEND_FACTOR_CONSTANT_ALPHA, [](auto, auto, auto k, int) { return k[3]; }},
    {VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_ALPHA, [](auto, auto, auto k, int) { return 1 - k[3]; }},
    {VK_BLEND_FACTOR_SRC_ALPHA_SATURATE, [](auto s, auto d, auto, int c) { return c == 3 ? 1 : std::min(s[3], 1 - d[3]); }},
};

TEST(Fragment, EveryBlendFactorAndOperation) {
  const double source[4] = {0.8, 0.35, 0.1, 0.6}, target[4] = {51 / 255.0, 204 / 255.0, 102 / 255.0, 153 / 255.0}, constant[4] = {0.3, 0.5, 0.9, 0.7};
  for (size_t i = 0; i < std::size(kFactors); ++i)
    for (int op = 0; op < 5; ++op) {
      const Factor &f = kFactors[i], &g = kFactors[(i * 7 + 3) % std::size(kFactors)];
      Scene s(8, 8);
      GraphicsState state = s.state();
      auto& b = state.blend[0];
      b.blendEnable = true;
      b.srcColorBlendFactor = b.srcAlphaBlendFactor = f.factor;
      b.dstColorBlendFactor = b.dstAlphaBlendFactor = g.factor;
      b.colorBlendOp = b.alphaBlendOp = VkBlendOp(op);
      for (int c = 0; c < 4; ++c) state.blendConstants[c] = float(constant[c]);
      auto d = s.drawState(s.pipeline(state));
      s.begin(float(target[0]), float(target[1]), float(target[2]), float(target[3]));
      s.draw(d, rectangle(s, 0, 0, 8, 8, 0.5f, {float(source[0]), float(source[1]), float(source[2]), float(source[3])}));
      s.end();
      for (int c = 0; c < 4; ++c) {
        const double x = source[c] * f.value(source, target, constant, c), y = target[c] * g.value(source, target, constant, c);
        const double results[5] = {x + y, x - y, y - x, std::min(source[c], target[c]), std::max(source[c], target[c])};
        const double expected = std::clamp(results[op], 0.0, 1.0) * 255;
        EXPECT_NEAR(s.color.rgba(3, 3)[size_t(c)], expected, 0.51) << "factors " << f.factor << ", " << g.factor << " op " << op << " component " << c;
      }
    }
}

TEST(Fragment, OcclusionCountsTheSamplesThatPass) {
  Scene s(130, 70, VK_FORMAT_D32_SFLOAT, 2);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state));
  uint64_t all = 0, some = 0;
  s.begin(0, 0, 0, 1, 1);
  s.draw(d, rectangle(s, 0, 0, 10, 70, 0.1f, {1, 0, 0, 1}));
  s.executor.beginOcclusion(&some);
  s.draw(d, rectangle(s, 0, 0, 130, 70, 0.5f, {0, 1, 0, 1}));
  s.executor.endOcclusion();
  s.executor.beginOcclusion(&all);
  s.draw(d, rectangle(s, 0, 0, 130, 70, 0.05f, {0, 0, 1, 1}));
  s.executor.endOcclusion();
  s.end();
  EXPECT_EQ(some, 120u * 70);
  EXPECT_EQ(all, 130u * 70);
}

TEST(Fragment, ShaderDepthReplacesTheInterpolatedOne) {
  Scene s(16, 16, VK_FORMAT_D32_SFLOAT);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state, kColorVertex, R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = color; gl_FragDepth = gl_FragCoord.x < 8.0 ? 0.25 : 0.75; })"));
  s.begin(0, 0, 0, 1, 0.5f);
  s.draw(d, rectangle(s, 0, 0, 16, 16, 0.1f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ(s.depth->at<float>(3, 3, VK_IMAGE_ASPECT_DEPTH_BIT), 0.25f);
  EXPECT_EQ(s.depth->at<float>(12, 3, VK_IMAGE_ASPECT_DEPTH_BIT), 0.5f);
  EXPECT_EQ(s.color.rgba(3, 3)[0], 255);
  EXPECT_EQ(s.color.rgba(12, 3)[0], 0);
}

TEST(Fragment, WithoutAFragmentShaderOnlyDepthIsWritten) {
  Scene s(16, 16, VK_FORMAT_D16_UNORM);
  GraphicsState state = s.state();
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state, kColorVertex, ""));
  state.rasterizerDiscard = true;
  auto discarded = s.drawState(s.pipeline(state));
  s.begin(0.2f, 0, 0, 1);
  s.draw(d, rectangle(s, 0, 0, 8, 16, 0.5f, {1, 1, 1, 1}));
  s.draw(discarded, rectangle(s, 0, 0, 16, 16, 0.25f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ(s.depth->at<uint16_t>(3, 3, VK_IMAGE_ASPECT_DEPTH_BIT), 0x8000);
  EXPECT_EQ(s.depth->at<uint16_t>(12, 3, VK_IMAGE_ASPECT_DEPTH_BIT), 0xffff);
  EXPECT_EQ(s.color.rgba(3, 3)[0], 51);
}

TEST(Fragment, IntegerAttachmentTakesTheShadersBits) {
  Scene s(16, 16, VK_FORMAT_UNDEFINED, 1, VK_FORMAT_R32G32_UINT);
  auto d = s.drawState(s.pipeline(s.state(), kColorVertex, R"(#version 450
layout(location = 0) out uvec4 target;
void main() { target = uvec4(0xfffffff0u, uint(gl_FragCoord.y) * 16u + uint(gl_FragCoord.x), 0, 0); })"));
  s.begin();
  s.draw(d, rectangle(s, 0, 0, 16, 16, 0.5f, {1, 1, 1, 1}));
  s.end();
  EXPECT_EQ((s.color.at<std::array<uint32_t, 2>>(5, 9)), (std::array<uint32_t, 2>{0xfffffff0u, 9 * 16 + 5}));
}

}  // namespace
}  // namespace pumice::pipeline::test
