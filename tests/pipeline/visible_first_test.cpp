// Visible first, then shade; and Hi-Z: they save what they say, and never change a bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "pipeline/builders.h"
#include "pipeline/ideas.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

constexpr Ideas kBoth = bit(Idea::VisibleFirst) | bit(Idea::HiZ);

void layers(bool frontToBack, uint32_t samples) {
  Scene s(200, 136, VK_FORMAT_D32_SFLOAT, 2);
  Image many(VK_FORMAT_R8G8B8A8_UNORM, 200, 136, 1, samples), depth(VK_FORMAT_D32_SFLOAT, 200, 136, 1, samples);
  s.executor.disable(0);
  s.executor.collectStatistics(true);
  GraphicsState state = s.state();
  state.samples = samples;
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state));
  s.begin();
  s.pass.color[0].memory = many.memory();
  s.pass.depthStencil.memory = depth.memory();
  s.executor.begin(s.pass);
  for (int i = 0; i < 50; i++) {
    const float at = float(frontToBack ? i : 49 - i) / 64;
    auto layer = triangle(s, {0, 0, 800, 0, 0, 800}, at, {at, 1, 0, 1});   // one triangle, so that no pixel is an edge between two
    for (auto& v : layer) v.position[2] += v.position[0] / 1024;   // sloped, without cutting its neighbours
    for (auto& v : layer) v.position[2] += 1.0f / 64;
    s.draw(d, layer);
  }
  s.end();
  const PassCounters& c = s.executor.counters();
  EXPECT_EQ(c.fragmentsShaded, 200u * 136);
  EXPECT_EQ(c.samplesTested, 50u * 200 * 136 * samples);
  if (frontToBack) {
    EXPECT_EQ(c.samplesPassed, 200u * 136 * samples);
    EXPECT_EQ(c.samplesRejected, 49u * 200 * 136 * samples) << "all but the first layer fall to Hi-Z";
    EXPECT_EQ(c.samplesHidden, 0u);
  } else {
    EXPECT_EQ(c.samplesPassed, c.samplesTested);
    EXPECT_EQ(c.samplesHidden, 49u * 200 * 136 * samples);
  }
}

TEST(VisibleFirst, FiftyOpaqueLayersShadeEachPixelOnceFrontToBack) { layers(true, 1); }
TEST(VisibleFirst, FiftyOpaqueLayersShadeEachPixelOnceBackToFront) { layers(false, 1); }
TEST(VisibleFirst, FiftyOpaqueLayersShadeEachPixelOnceWithFourSamples) {
  layers(true, 4);
  layers(false, 4);
}

TEST(OneRecord, RowsOfOneTriangleHaveTheSameBitsBeforeAndAfterTheirRoutineIsMade) {
  for (bool blend : {false, true}) {
    Scene s(512, 512);
    GraphicsState state = s.state();
    state.blend[0].blendEnable = blend;
    state.blend[0].srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
    state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
    auto d = s.drawState(s.pipeline(state, R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 outColor;
layout(location = 1) flat out vec4 corner;
layout(location = 2) noperspective out float level;
void main() { gl_Position = position; outColor = color; corner = color; level = position.x; })", R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 1) flat in vec4 corner;
layout(location = 2) noperspective in float level;
layout(location = 0) out vec4 target;
void main() {
  vec4 c = color * 0.5 + corner * 0.25 + vec4(fract(level * 7), gl_FragCoord.z, gl_FrontFacing ? 0.125 : 0, 0.25);
  c.x += abs(dFdx(color.y)) * 16;
  target = c / (1 + gl_FragCoord.w);
})"));
    auto v = triangle(s, {-20, -30, 1200, 10, 5, 1100}, 0.25f, {1, 0.5f, 0.25f, 0.5f});
    for (int i = 0; i < 3; i++) {
      const float w = 1 + float(i);
      for (float& x : v[size_t(i)].position) x *= w;
      v[size_t(i)].color[i] = 0.1f;
    }
    const auto pass = [&](uint32_t size) {
      s.begin();
      s.pass.renderArea = {{0, 0}, {size, size}};
      s.executor.begin(s.pass);
      s.draw(d, v);
      s.end();
      return s.color.bytes;
    };
    const auto before = pass(128);   // 128 rows: too few
    for (int i = 0; i < 3; i++) pass(512);
    std::fill(s.color.bytes.begin(), s.color.bytes.end(), std::byte(0));
    EXPECT_EQ(pass(128), before) << "blend " << blend;
  }
}

// Sums, so that every component of what was there counts; a plane of its own for each sample.
TEST(WholeBlocks, RowsOfWholeBlocksHaveTheSameBitsWithAndWithoutRoutinesOfTheirOwn) {
  struct Case {
    VkFormat format;
    bool blend, perspective;
    uint32_t samples;
    VkColorComponentFlags mask = 15;
  };
  const Case cases[] = {
      {VK_FORMAT_R8G8B8A8_UNORM, false, false, 1},      {VK_FORMAT_R8G8B8A8_UNORM, true, true, 1},       {VK_FORMAT_B8G8R8A8_UNORM, true, false, 4},
      {VK_FORMAT_R16G16B16A16_SFLOAT, false, false, 1}, {VK_FORMAT_R16G16B16A16_SFLOAT, true, false, 1}, {VK_FORMAT_R32G32B32A32_SFLOAT, true, true, 1},
      {VK_FORMAT_R8_UNORM, true, false, 1},             {VK_FORMAT_R5G6B5_UNORM_PACK16, true, false, 1}, {VK_FORMAT_R8G8B8A8_UNORM, false, false, 1, 5},
      {VK_FORMAT_R8G8B8A8_SRGB, true, false, 1},        {VK_FORMAT_A2B10G10R10_UNORM_PACK32, true, false, 1}};
  for (const Case& c : cases) {
    Scene s(320, 200);
    Image target(c.format, 320, 200, 1, c.samples);
    GraphicsState state = s.state();
    state.colorFormats[0] = c.format;
    state.samples = c.samples;
    state.blend[0].blendEnable = c.blend;
    state.blend[0].colorWriteMask = c.mask;
    state.blend[0].srcColorBlendFactor = state.blend[0].srcAlphaBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
    state.blend[0].dstColorBlendFactor = state.blend[0].dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
    auto d = s.drawState(s.pipeline(state, kColorVertex, R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = color + vec4(dFdx(color.x), gl_FragCoord.x * 0.001, gl_FragCoord.w * 0.25, 0); })"));
    std::vector<ColorVertex> v;
    for (float at : {0.0f, 90.0f}) {
      auto more = triangle(s, {at - 40, -10, at + 500, 20, at, 700}, 0.25f, {1, 0.5f, 0.25f, 0.5f});
      for (int i = 0; i < 3; i++) {
        if (c.perspective)
          for (float& x : more[size_t(i)].position) x *= 1 + float(i);
        more[size_t(i)].color[i] = -0.1f;
      }
      v.insert(v.end(), more.begin(), more.end());
    }
    const auto pass = [&](Ideas off) {
      s.executor.disable(off);
      s.begin(0.25f, 0.5f, 0.75f, 1);
      s.pass.color[0].memory = target.memory();
      s.pass.color[0].format = c.format;
      s.executor.begin(s.pass);
      s.draw(d, v);
      s.end();
      return std::vector<std::byte>(target.memory().base, target.memory().base + target.layout.size);
    };
    const auto before = pass(bit(Idea::WholeBlocks) | bit(Idea::LazyClear));
    for (int i = 0; i < 4; i++) pass(0);
    EXPECT_EQ(pass(0), before) << "format " << c.format << ", blend " << c.blend << ", samples " << c.samples;
    EXPECT_EQ(pass(bit(Idea::VisibleFirst)), before) << "format " << c.format << ", blend " << c.blend << ", samples " << c.samples;
  }
}

// Colours between 0 and 1 need no clamping; elsewhere they are clamped as ever. Zeros of both signs, and what leaves the interval within a tile.
TEST(WholeBlocks, ClampsAreLeftOutOnlyWhereTheyChangeNothing) {
  for (const bool blend : {false, true})
    for (const uint32_t samples : {1u, 4u}) {
      Scene s(320, 200);
      Image target(VK_FORMAT_R8G8B8A8_UNORM, 320, 200, 1, samples);
      GraphicsState state = s.state();
      state.samples = samples;
      state.blend[0].blendEnable = blend;
      state.blend[0].srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
      state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
      // The sign of a zero decides.
      auto pipeline = s.pipeline(state, kColorVertex, R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() {
  vec4 c = clamp(color, 0.0, 1.0);
  target = vec4(c.xyz, floatBitsToInt(c.w) < 0 ? 1.0 : 0.5);
})");
      auto d = s.drawState(pipeline);
      const float corners[][3][4] = {
          {{0.1f, 0.2f, 0.3f, 0.5f}, {0.9f, 0.8f, 0.7f, 0.5f}, {0.5f, 0.4f, 1, 0.5f}},   // inside everywhere
          {{0, 1, 0, 0}, {0, 1, 0, 0}, {0, 1, 0, 0}},                                    // on the ends
          {{-0.0f, 1, -0.0f, -0.0f}, {-0.0f, 1, -0.0f, -0.0f}, {-0.0f, 1, -0.0f, -0.0f}},
          {{-1, 0, 0.5f, 2}, {2, 0.5f, 0.5f, -1}, {0.5f, 3, 0, 0.25f}},                  // within some tiles
      };
      std::vector<ColorVertex> v;
      for (const auto& corner : corners) {
        auto more = triangle(s, {-40, -10, 700, 20, 0, 700}, 0.25f, {});
        for (int i = 0; i < 3; i++) std::copy_n(corner[i], 4, &more[size_t(i)].color[0]);
        std::vector<ColorVertex> all;
        const auto pass = [&](Ideas off) {
          s.executor.disable(off);
          s.begin(0.25f, 0.5f, 0.75f, 1);
          s.pass.color[0].memory = target.memory();
          s.executor.begin(s.pass);
          s.draw(d, v);
          s.draw(d, more);
          s.end();
          return std::vector<std::byte>(target.memory().base, target.memory().base + target.layout.size);
        };
        const auto before = pass(bit(Idea::WholeBlocks) | bit(Idea::LazyClear));
        for (int i = 0; i < 12; i++) pass(0);
        EXPECT_EQ(pass(0), before) << "blend " << blend << ", samples " << samples;
        EXPECT_EQ(pass(bit(Idea::InUnit)), before) << "blend " << blend << ", samples " << samples;
        v.insert(v.end(), more.begin(), more.end());
      }
      FragmentKey key;
      key.settled = !blend;
      size_t instructions[2];
      for (const bool unit : {false, true}) {
        key.rows = unit ? Rows::WholeUnit : Rows::WholeFlat;
        auto routine = buildFragmentRoutine(*pipeline, key);
        ASSERT_TRUE(routine.hasValue());
        ASSERT_TRUE((*routine)->code.ready());
        instructions[unit] = (*routine)->code->instructionCount();
      }
      EXPECT_LE(instructions[1] + 8, instructions[0]) << "a minimum and a maximum of four components";
    }
}

// Depths that nobody keeps are not written, where planes say what they are; the picture is the same.
TEST(VisibleFirst, DepthThatIsNotStoredIsNotWrittenButWhereItWasNeeded) {
  std::vector<std::byte> pictures[2];
  for (bool store : {true, false}) {
    Scene s(128, 128, VK_FORMAT_D32_SFLOAT);
    s.executor.disable(0);
    GraphicsState state = s.state();
    state.depthTest = state.depthWrite = true;
    state.depthCompare = VK_COMPARE_OP_LESS;
    auto d = s.drawState(s.pipeline(state));
    s.begin();
    std::memset(s.depth->memory().base, 0x77, s.depth->layout.size);
    if (!store) s.pass.depthStencil.storeOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    s.executor.begin(s.pass);
    s.draw(d, triangle(s, {-10, -10, 500, -10, -10, 500}, 0.75f, {1, 0, 0, 1}));
    s.draw(d, triangle(s, {64, 0, 64, 0, 0, 0}, 0.5f, {0, 1, 0, 1}));
    s.draw(d, rectangle(s, 2, 2, 30, 30, 0.5f, {0, 1, 0, 1}));
    s.draw(d, rectangle(s, 20, 20, 40, 40, 0.625f, {0, 0, 1, 1}));
    s.end();
    pictures[store].assign(s.color.memory().base, s.color.memory().base + s.color.layout.size);
    constexpr uint32_t kSentinel = 0x77777777;
    uint32_t written = 0;
    for (uint32_t y = 0; y < 128; ++y)
      for (uint32_t x = 0; x < 128; ++x) written += s.depth->at<uint32_t>(x, y, VK_IMAGE_ASPECT_DEPTH_BIT) != kSentinel;
    if (store) EXPECT_EQ(written, 128u * 128);
    else EXPECT_LT(written, 40u * 40) << "only blocks along edges needed their depths";
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

//! Shaders are few, pipelines many.
std::shared_ptr<const frontend::Shader> cached(frontend::Stage stage, const std::string& glsl) {
  static std::map<std::string, std::shared_ptr<const frontend::Shader>> known;
  if (glsl.empty()) return nullptr;
  auto& shader = known[glsl];
  if (!shader) shader = compile(stage, glsl);
  return shader;
}

//! What one pass of random draws leaves in the attachments, and counts.
struct Outcome {
  std::vector<std::byte> color, depth;
  uint64_t occlusion[2] = {};
  PassCounters counters;
};

constexpr uint32_t kWidth = 150, kHeight = 99;   // blocks that the framebuffer cuts

struct Kind {
  bool depthTest, depthWrite;
  VkCompareOp compare;
  bool blend, discards, derivative, stencil, bias, clamp, depthOnly;
  uint32_t sampleMask;
};

Kind randomKind(std::mt19937& random, VkCompareOp usual) {
  const auto one = [&](uint32_t in) { return random() % in == 0; };
  Kind k{};
  k.depthTest = !one(6);
  k.depthWrite = !one(4);
  k.compare = one(3) ? VkCompareOp(random() % 8) : usual;
  k.blend = one(8);
  k.discards = one(8);
  k.derivative = one(4);
  k.stencil = one(10);
  k.bias = one(6);
  k.clamp = one(6);
  k.depthOnly = one(8);
  k.sampleMask = one(6) ? random() : ~0u;
  return k;
}

Outcome randomPass(uint32_t seed, VkFormat depthFormat, uint32_t samples, Ideas disabled) {
  std::mt19937 random(seed);
  Scene s(kWidth, kHeight, depthFormat, 1 + seed % 2);
  Image color(VK_FORMAT_R8G8B8A8_UNORM, kWidth, kHeight, 1, samples), depth(depthFormat, kWidth, kHeight, 1, samples);
  s.executor.disable(disabled);
  s.executor.collectStatistics(seed % 3 == 0);
  const VkCompareOp usual = seed % 2 ? VK_COMPARE_OP_LESS_OR_EQUAL : VK_COMPARE_OP_GREATER;
  s.begin(0.1f, 0.2f, 0.3f, 1, usual == VK_COMPARE_OP_GREATER ? 0.1f : 0.9f, 3);
  s.pass.color[0].memory = color.memory();
  s.pass.depthStencil.memory = depth.memory();
  if (seed % 5 == 0) s.pass.depthStencil.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  if (seed % 4 == 0) s.pass.renderArea = {{13, 7}, {kWidth - 20, kHeight - 9}};
  s.executor.begin(s.pass);
  Outcome out;
  std::uniform_real_distribution<float> x(-20, kWidth + 20), y(-20, kHeight + 20), unit(0, 1);
  for (int i = 0; i < 24; i++) {
    const Kind k = randomKind(random, usual);
    GraphicsState state = s.state();
    state.samples = samples;
    state.sampleMask = k.sampleMask;
    state.depthTest = k.depthTest;
    state.depthWrite = k.depthWrite;
    state.depthCompare = k.compare;
    state.depthBias = k.bias;
    state.depthClamp = k.clamp;
    state.depthClip = !k.clamp;
    state.stencilTest = k.stencil;
    state.stencilFront = state.stencilBack = {VK_STENCIL_OP_KEEP, VK_STENCIL_OP_INCREMENT_AND_CLAMP, VK_STENCIL_OP_INVERT, VK_COMPARE_OP_NOT_EQUAL, 255, 255, 5};
    if (k.blend) {
      state.blend[0].blendEnable = true;
      state.blend[0].srcColorBlendFactor = state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
    }
    std::string fragment = kColorFragment;
    if (k.derivative) fragment.replace(fragment.find("= color"), 7, "= color + vec4(dFdx(color.x) * 8, dFdy(color.y) * 8, 0, 0)");
    if (k.discards) fragment.replace(fragment.find("target ="), 8, "if (color.x > color.y) discard; target =");
    auto pipeline = createGraphicsPipeline(state, std::make_shared<Layout>(), cached(frontend::Stage::Vertex, kColorVertex),
                                           cached(frontend::Stage::Fragment, k.depthOnly ? "" : fragment));
    EXPECT_TRUE(pipeline.hasValue());
    if (!pipeline) return out;
    auto d = s.drawState(*pipeline);
    d.depthBiasConstant = 3;
    d.depthBiasSlope = 1.5f;
    if (random() % 5 == 0) d.viewport.minDepth = 0.75f, d.viewport.maxDepth = 0.25f;
    if (random() % 4 == 0) d.scissor = {{int32_t(random() % 60), int32_t(random() % 60)}, {uint32_t(random() % 100), uint32_t(random() % 60)}};
    std::vector<ColorVertex> vertices;
    const uint32_t triangles = 1 + random() % (i % 6 ? 6 : 300);
    for (uint32_t t = 0; t < triangles; t++) {
      const float cx = x(random), cy = y(random), size = t % 7 ? 8 : 300, z = unit(random);
      for (int v = 0; v < 3; v++) {
        const float w = 1 + (random() % 4 ? 0 : unit(random));
        const float px = (cx + (unit(random) - 0.5f) * size) / kWidth * 2 - 1, py = (cy + (unit(random) - 0.5f) * size) / kHeight * 2 - 1;
        const float depth = std::clamp(z + (t % 3 ? 0 : unit(random) - 0.5f), k.clamp ? -0.5f : 0.0f, k.clamp ? 1.5f : 1.0f);
        vertices.push_back({{px * w, py * w, depth * w, w}, {unit(random), unit(random), unit(random), 0.5f}});
      }
    }
    const bool counted = random() % 3 == 0;
    if (counted) s.executor.beginOcclusion(&out.occlusion[i & 1]);
    s.draw(d, vertices);
    if (counted) s.executor.endOcclusion();
    if (random() % 10 == 0) {
      VkClearAttachment c{VK_IMAGE_ASPECT_COLOR_BIT, 0, {}};
      if (random() & 1) c.aspectMask = VK_IMAGE_ASPECT_DEPTH_BIT, c.clearValue.depthStencil = {0.5f, 0};
      s.executor.clear(c, {{{int32_t(random() % 80), int32_t(random() % 60)}, {64, 32}}, 0, 1});
    }
  }
  s.end();
  out.color.assign(color.memory().base, color.memory().base + color.layout.size);
  out.depth.assign(depth.memory().base, depth.memory().base + depth.layout.size);
  out.counters = s.executor.counters();
  return out;
}

class Ablation : public testing::TestWithParam<std::tuple<VkFormat, uint32_t>> {};

TEST_P(Ablation, RandomPassesHaveTheSameBitsWithEachIdeaOnOrOff) {
  const auto [format, samples] = GetParam();
  uint64_t hidden = 0, rejected = 0;
  for (uint32_t seed = 0; seed < 4; seed++) {
    const Outcome usual = randomPass(seed, format, samples, kBoth);
    for (Ideas off : {Ideas(0), bit(Idea::VisibleFirst), bit(Idea::HiZ), bit(Idea::LazyClear), bit(Idea::Squares), bit(Idea::InUnit)}) {
      const Outcome other = randomPass(seed, format, samples, off);
      EXPECT_EQ(other.color, usual.color) << "seed " << seed << ", off " << off;
      EXPECT_EQ(other.depth, usual.depth) << "seed " << seed << ", off " << off;
      for (int i = 0; i < 2; i++) EXPECT_EQ(other.occlusion[i], usual.occlusion[i]) << "seed " << seed << ", off " << off;
      if (off == 0) hidden += other.counters.samplesHidden, rejected += other.counters.samplesRejected;
      if (::testing::Test::HasFailure()) return;
    }
  }
  // The passes are worth something only if there was something to save.
  EXPECT_GT(hidden, 0u);
  EXPECT_GT(rejected, 0u);
}

INSTANTIATE_TEST_SUITE_P(All, Ablation,
                         testing::Combine(testing::Values(VK_FORMAT_D32_SFLOAT, VK_FORMAT_D16_UNORM, VK_FORMAT_D24_UNORM_S8_UINT), testing::Values(1u, 4u)),
                         [](const auto& info) {
                           const VkFormat f = std::get<0>(info.param);
                           return std::string(f == VK_FORMAT_D32_SFLOAT ? "Float32" : f == VK_FORMAT_D16_UNORM ? "Unorm16" : "Unorm24Stencil") + "_x" +
                                  std::to_string(std::get<1>(info.param));
                         });

}  // namespace
}  // namespace pumice::pipeline::test
