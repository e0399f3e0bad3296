// Blocks of multisampled attachments whose samples agree: they are one plane until something tells the samples apart, and nobody
// can see it.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "pipeline/ideas.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

constexpr Ideas kOff = bit(Idea::OneColor);

//! Plane of one sample, as bytes.
std::vector<std::byte> plane(Image& image, uint32_t sample) {
  const texture::PlaneLayout& p = image.layout.planes[0];
  const std::byte* first = image.memory().base + p.offset + sample * p.samplePitch;
  return {first, first + p.samplePitch};
}

constexpr uint32_t kWidth = 150, kHeight = 99;   // blocks that the framebuffer cuts
constexpr uint32_t kBlocksX = 38, kBlocksY = 25;

//! A multisampled attachment with a target to resolve to.
struct Antialiased : Scene {
  Image many;
  GraphicsState fixed;
  Antialiased(uint32_t samples, VkFormat format = VK_FORMAT_R8G8B8A8_UNORM, unsigned threads = 1)
      : Scene(kWidth, kHeight, VK_FORMAT_UNDEFINED, threads, format), many(format, kWidth, kHeight, 1, samples), fixed(state()) {
    executor.disable(0);
    fixed.samples = samples;
    std::memset(many.memory().base, 0x77, many.layout.size);
  }
  void start(VkAttachmentStoreOp store) {
    Scene::begin(0.25f, 0.5f, 0.75f, 1);
    pass.resolve[0] = pass.color[0];
    pass.color[0].memory = many.memory();
    pass.color[0].storeOp = store;
    executor.begin(pass);
  }
  //! Blocks of the image of which a plane behind the first has not been touched.
  uint32_t untouched() {
    uint32_t count = 0;
    const std::array<uint8_t, 4> sentinel{0x77, 0x77, 0x77, 0x77};
    for (uint32_t y = 0; y < kHeight; y += 4)
      for (uint32_t x = 0; x < kWidth; x += 4) {
        bool same = true;
        for (uint32_t i = 0; i < 16; ++i)   // a block lies in one piece
          same &= !std::memcmp(many.memory().base + many.layout.elementOffset(many.layout.planes[0], 0, 0, fixed.samples - 1, x, y, 0) + 4 * i, sentinel.data(), 4);
        count += same;
      }
    return count;
  }
};

TEST(OneColor, ADrawThatCoversEverythingWritesOnePlane) {
  for (uint32_t samples : {2u, 4u, 8u, 16u})
    for (bool drawn : {false, true})
      for (bool blend : {false, true}) {
        SCOPED_TRACE(testing::Message() << samples << " samples, drawn " << drawn << ", blend " << blend);
        Antialiased s(samples);
        s.fixed.blend[0].blendEnable = blend;
        s.fixed.blend[0].srcColorBlendFactor = s.fixed.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
        auto d = s.drawState(s.pipeline(s.fixed));
        s.start(VK_ATTACHMENT_STORE_OP_DONT_CARE);
        if (drawn) s.draw(d, triangle(s, {-10, -10, 700, -10, -10, 700}, 0.5f, {0.25f, 0.5f, 0.75f, 0.5f}));
        s.end();
        const PassCounters& c = s.executor.counters();
        // Where the framebuffer cuts a block, the draw does not cover all of it.
        const uint32_t cut = drawn && samples > 1 ? kBlocksX + kBlocksY - 1 : 0;
        EXPECT_EQ(c.blocksSplit, cut);
        EXPECT_EQ(c.blocksOneColor, kBlocksX * kBlocksY - cut);
        EXPECT_EQ(c.blocksStored, 0u);
        EXPECT_EQ(s.untouched(), kBlocksX * kBlocksY - cut) << "the counter says what memory shows";
        const uint8_t alpha = !drawn ? 255 : blend ? 0 : 128;
        for (uint32_t x : {0u, 77u, 149u})
          for (uint32_t y : {0u, 50u, 98u}) EXPECT_EQ(s.color.rgba(x, y), (std::array<uint8_t, 4>{64, 128, 191, alpha}));
      }
}

TEST(OneColor, StoredAttachmentsAreCompleteAfterThePass) {
  Antialiased s(4);
  auto d = s.drawState(s.pipeline(s.fixed));
  s.start(VK_ATTACHMENT_STORE_OP_STORE);
  s.draw(d, triangle(s, {-10, -10, 700, -10, -10, 700}, 0.5f, {0.25f, 0.5f, 0.75f, 0.5f}));
  s.end();
  EXPECT_EQ(s.executor.counters().blocksStored, s.executor.counters().blocksOneColor);
  EXPECT_GT(s.executor.counters().blocksStored, 0u);
  for (uint32_t n = 1; n < 4; ++n) EXPECT_EQ(plane(s.many, n), plane(s.many, 0));
}

TEST(OneColor, AnEdgeSplitsTheBlocksThatItCrosses) {
  Antialiased s(4);
  auto d = s.drawState(s.pipeline(s.fixed));
  s.start(VK_ATTACHMENT_STORE_OP_DONT_CARE);
  // Everything right of x = 20.5: of the sixth column of blocks a part.
  s.draw(d, triangle(s, {20.5f, -900, 900, 50, 20.5f, 900}, 0.5f, {1, 1, 1, 1}));
  s.end();
  const PassCounters& c = s.executor.counters();
  // That column; the last one and the last row, which the framebuffer cuts.
  const uint32_t crossed = kBlocksY + kBlocksY + (kBlocksX - 7);
  EXPECT_EQ(c.blocksSplit, crossed);
  EXPECT_EQ(c.blocksOneColor, kBlocksX * kBlocksY - crossed);
  EXPECT_EQ(s.untouched(), kBlocksX * kBlocksY - crossed);
  for (uint32_t y : {0u, 30u, 98u}) {
    EXPECT_EQ(s.color.rgba(19, y), (std::array<uint8_t, 4>{64, 128, 191, 255}));
    EXPECT_EQ(s.color.rgba(20, y), (std::array<uint8_t, 4>{159, 191, 223, 255})) << "half of it";
    EXPECT_EQ(s.color.rgba(21, y), (std::array<uint8_t, 4>{255, 255, 255, 255}));
    EXPECT_EQ(s.color.rgba(149, y), (std::array<uint8_t, 4>{255, 255, 255, 255}));
  }
}

TEST(OneColor, ClearsInThePassMakeBlocksOneAgain) {
  Antialiased s(4);
  auto d = s.drawState(s.pipeline(s.fixed));
  s.start(VK_ATTACHMENT_STORE_OP_DONT_CARE);
  s.draw(d, triangle(s, {3, 5, 140, 30, 40, 90}, 0.5f, {1, 1, 1, 1}));
  VkClearAttachment clear{VK_IMAGE_ASPECT_COLOR_BIT, 0, {}};
  clear.clearValue.color = {{0, 1, 0, 1}};
  s.executor.clear(clear, {{{0, 0}, {kWidth, kHeight}}, 0, 1});
  s.end();
  EXPECT_GT(s.executor.counters().blocksSplit, 0u);
  EXPECT_EQ(s.executor.counters().blocksOneColor, kBlocksX * kBlocksY);
  for (uint32_t x = 0; x < kWidth; ++x) ASSERT_EQ(s.color.rgba(x, 40), (std::array<uint8_t, 4>{0, 255, 0, 255}));
}

TEST(OneColor, PassesThatOverflowTheirBinsKeepWhatTheyKnow) {
  std::vector<std::byte> pictures[2];
  for (Ideas off : {Ideas(0), kOff}) {
    Antialiased s(4);
    s.executor.disable(off);
    s.fixed.blend[0].blendEnable = true;
    s.fixed.blend[0].srcColorBlendFactor = s.fixed.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
    auto d = s.drawState(s.pipeline(s.fixed));
    // Half a million triangles that cover little, so that tiles are finished several times.
    std::vector<ColorVertex> dust;
    for (int i = 0; i < 500000; ++i) {
      const auto t = triangle(s, {1, 1, 2, 1, 1, 2}, 0.5f, {1, 0, 0, 0.5f});
      dust.insert(dust.end(), t.begin(), t.end());
    }
    s.start(VK_ATTACHMENT_STORE_OP_DONT_CARE);
    s.draw(d, triangle(s, {-10, -10, 700, -10, -10, 700}, 0.5f, {0.25f, 0.5f, 0.75f, 0.5f}));
    s.draw(d, dust);
    s.draw(d, triangle(s, {30, 30, 90, 35, 40, 80}, 0.5f, {1, 0.5f, 0.75f, 0.5f}));
    s.end();
    pictures[off != 0].assign(s.color.memory().base, s.color.memory().base + s.color.layout.size);
    if (!off) EXPECT_GT(s.executor.counters().blocksOneColor, 500u);
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

TEST(OneColor, InputAttachmentsOfThePassSeeAllSamples) {
  const uint32_t samples = 4;
  std::vector<std::byte> pictures[2];
  for (Ideas off : {Ideas(0), kOff}) {
    Antialiased s(samples);
    s.executor.disable(off);
    Image second(VK_FORMAT_R8G8B8A8_UNORM, kWidth, kHeight, 1, samples);
    auto layout = std::make_shared<Layout>();
    Binding b;
    b.type = VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT;
    b.count = 1;
    b.stride = texture::descriptorStride(b.type);
    layout->sets.resize(1);
    layout->sets[0].bindings.set(0, b);
    layout->sets[0].size = b.stride;
    layout->dynamicBase = {0};
    texture::ImageDescriptor view;
    const texture::ImageLayout& l = s.many.layout;
    view.base = uint64_t(s.many.memory().base) + l.planes[0].offset;
    view.levels = uint64_t(&l.planes[0].levels[0]);
    view.layerPitch = l.planes[0].layerPitch;
    view.samplePitch = l.planes[0].samplePitch;
    view.size = l.size - l.planes[0].offset;
    view.width = kWidth, view.height = kHeight;
    view.depth = view.layerCount = view.levelCount = 1;
    view.samples = samples;
    view.key.format = uint16_t(l.format - texture::allFormats().data() + 1);
    view.key.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.key.tiled = 1;
    view.key.aspect = VK_IMAGE_ASPECT_COLOR_BIT;
    for (uint8_t c = 0; c < 4; ++c) view.key.swizzle[c] = uint8_t(VK_COMPONENT_SWIZZLE_R + c);
    view.key.samples = samples;
    view.key.singleLevel = 1;
    s.fixed.colorCount = 2;
    s.fixed.colorFormats[1] = VK_FORMAT_R8G8B8A8_UNORM;
    s.fixed.blend.resize(2);
    s.fixed.blend[1].colorWriteMask = 15;
    auto draw = s.drawState(s.pipeline(s.fixed));   // writes the first alone
    auto read = s.drawState(s.pipeline(s.fixed, kColorVertex, R"(#version 450
layout(input_attachment_index = 0, binding = 0) uniform subpassInputMS before;
layout(location = 0) in vec4 color;
layout(location = 1) out vec4 target;
void main() {
  target = color * 0.125;
  for (int i = 0; i < 4; i++) target += subpassLoad(before, i) * vec4(0.1, 0.2, 0.3, 0.05) * float(i + 1);
})", layout));
    read.setMemory[0] = reinterpret_cast<const std::byte*>(&view);
    read.setSize[0] = sizeof view;
    s.start(VK_ATTACHMENT_STORE_OP_DONT_CARE);
    s.pass.colorCount = 2;
    s.pass.color[1] = s.pass.color[0];
    s.pass.color[1].memory = second.memory();
    s.pass.color[1].storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    s.executor.begin(s.pass);
    for (int i = 0; i < 3; ++i) {
      s.draw(draw, triangle(s, {-10, -10, 700, -10, -10, 700}, 0.5f, {0.25f * float(i), 0.5f, 0.75f, 0.5f}));
      s.draw(draw, triangle(s, {13, 8, 140, 20, 30 + 20 * float(i), 90}, 0.5f, {1, 0.25f * float(i), 0, 1}));
      s.draw(read, triangle(s, {float(i) * 20, -10, 700, -10, float(i) * 10, 700}, 0.5f, {1, 0, 0, 1}));
    }
    s.end();
    pictures[off != 0].assign(second.memory().base, second.memory().base + second.layout.size);
  }
  EXPECT_EQ(pictures[0], pictures[1]);
}

// ---- random passes

struct Outcome {
  std::vector<std::byte> bytes;   //!< of all attachments and targets of resolves
  uint64_t occlusion[2] = {};
  PassCounters counters;
};

//! The elements of an image: what lies in blocks beyond it is nobody's.
void append(std::vector<std::byte>& to, Image& image, VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT) {
  const texture::PlaneLayout& p = image.layout.plane(aspect);
  const std::byte* base = image.memory().base;
  for (uint32_t layer = 0; layer < image.layout.arrayLayers; ++layer)
    for (uint32_t sample = 0; sample < image.layout.samples; ++sample)
      for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
          const std::byte* element = base + image.layout.elementOffset(p, 0, layer, sample, x, y, 0);
          to.insert(to.end(), element, element + p.elementBytes);
        }
}

//! Shaders are few, pipelines many.
std::shared_ptr<const frontend::Shader> cached(frontend::Stage stage, const std::string& glsl) {
  static std::map<std::string, std::shared_ptr<const frontend::Shader>> known;
  auto& shader = known[glsl];
  if (!shader) shader = compile(stage, glsl);
  return shader;
}

const char* outputType(VkFormat f) { return texture::formatInfo(f)->isInteger() ? "uvec4" : "vec4"; }

Outcome randomPass(uint32_t seed, const std::vector<VkFormat>& formats, uint32_t samples, Ideas disabled) {
  std::mt19937 random(seed);
  const auto one = [&](uint32_t in) { return random() % in == 0; };
  const uint32_t layers = 1 + seed % 2;
  const VkFormat depthFormat = VK_FORMAT_D24_UNORM_S8_UINT;
  Scene s(kWidth, kHeight, depthFormat, 1 + seed % 2);
  std::vector<Image> many, resolved;
  for (VkFormat f : formats) {
    many.emplace_back(f, kWidth, kHeight, layers, samples);
    resolved.emplace_back(f, kWidth, kHeight, layers);
    std::byte* base = many.back().memory().base;
    for (uint64_t i = 0; i < many.back().layout.size; ++i) base[i] = std::byte(random() & 0x3f);   // no NaN
  }
  Image depth(depthFormat, kWidth, kHeight, layers, samples);
  s.executor.disable(disabled);
  s.executor.collectStatistics(seed % 3 == 0);
  PassBegin& p = s.pass;
  p = {};
  p.renderArea = {{0, 0}, {kWidth, kHeight}};
  if (seed % 3 == 1) p.renderArea = {{13, 7}, {kWidth - 20, kHeight - 9}};
  p.width = kWidth;
  p.height = kHeight;
  p.layers = layers;
  p.colorCount = uint32_t(formats.size());
  std::vector<bool> visible;   // what of the attachments is defined afterwards
  for (uint32_t a = 0; a < formats.size(); ++a) {
    p.color[a].memory = many[a].memory();
    p.color[a].format = formats[a];
    p.color[a].layerCount = layers;
    p.color[a].loadOp = one(3) ? VK_ATTACHMENT_LOAD_OP_LOAD : VK_ATTACHMENT_LOAD_OP_CLEAR;
    for (int c = 0; c < 4; ++c)
      if (texture::formatInfo(formats[a])->isInteger()) p.color[a].clear.color.uint32[c] = uint32_t(c + 3);
      else p.color[a].clear.color.float32[c] = float(c) * 0.3f;
    visible.push_back(!one(3));
    if (!visible.back()) p.color[a].storeOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    p.resolve[a].memory = resolved[a].memory();
    p.resolve[a].format = formats[a];
    p.resolve[a].layerCount = layers;
  }
  p.depthStencil.memory = depth.memory();
  p.depthStencil.format = depthFormat;
  p.depthStencil.layerCount = layers;
  p.depthStencil.loadOp = p.depthStencil.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  p.depthStencil.clear.depthStencil = {0.9f, 3};
  s.executor.begin(p);
  Outcome out;
  std::uniform_real_distribution<float> x(-20, kWidth + 20), y(-20, kHeight + 20), unit(0, 1);
  for (int i = 0; i < 16; ++i) {
    GraphicsState state = s.state();
    state.samples = samples;
    state.depthStencilFormat = depthFormat;
    state.colorCount = uint32_t(formats.size());
    const bool blend = one(2), mask = one(5);
    for (uint32_t a = 0; a < formats.size(); ++a) {
      state.colorFormats[a] = formats[a];
      VkPipelineColorBlendAttachmentState e{};
      e.colorWriteMask = mask ? 1 + random() % 15 : 15;
      e.blendEnable = blend;
      e.srcColorBlendFactor = e.srcAlphaBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
      e.dstColorBlendFactor = e.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
      state.blend.resize(std::max<size_t>(state.blend.size(), a + 1));
      state.blend[a] = e;
    }
    state.logicOpEnable = one(8);
    state.logicOp = VK_LOGIC_OP_XOR;
    state.sampleMask = one(5) ? random() : ~0u;
    state.alphaToCoverage = one(8);
    state.alphaToOne = one(10);
    state.sampleShading = one(8);
    state.minSampleShading = 1;
    state.depthTest = one(2);
    state.depthWrite = one(2);
    state.depthCompare = one(3) ? VkCompareOp(random() % 8) : VK_COMPARE_OP_LESS;
    state.stencilTest = one(8);
    state.stencilFront = state.stencilBack = {VK_STENCIL_OP_KEEP, VK_STENCIL_OP_INCREMENT_AND_CLAMP, VK_STENCIL_OP_INVERT, VK_COMPARE_OP_NOT_EQUAL, 255, 255, 5};
    // A shader that writes some of the attachments.
    std::string outputs, writes;
    for (uint32_t a = 0; a < formats.size(); ++a) {
      if (formats.size() > 1 && one(4)) continue;
      const std::string n = std::to_string(a), type = outputType(formats[a]);
      outputs += "layout(location = " + n + ") out " + type + " target" + n + ";\n";
      writes += "  target" + n + " = " + (type == "vec4" ? "c" : "uvec4(c * 100)") + ";\n";
    }
    std::string body = "  vec4 c = color;\n";
    if (one(6)) body += "  if (color.x > color.y) discard;\n";
    if (one(6)) body += "  c.x += abs(dFdx(color.y)) * 8;\n";
    if (one(8)) body += "  c.y += bitCount(gl_SampleMaskIn[0]) * 0.1;\n";
    if (one(8)) body += "  gl_SampleMask[0] = int(color.z * 16);\n";
    const std::string fragment = "#version 450\nlayout(location = 0) " + std::string(one(6) ? "centroid " : one(10) ? "sample " : "") + "in vec4 color;\n" + outputs + "void main() {\n" + body + writes + "}";
    const char* const layered = R"(#version 450
#extension GL_ARB_shader_viewport_layer_array : require
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 outColor;
void main() { gl_Position = position; gl_Layer = int(color.w * 8) % 2; outColor = color; })";
    auto pipeline = createGraphicsPipeline(state, std::make_shared<Layout>(), cached(frontend::Stage::Vertex, layers > 1 ? layered : kColorVertex),
                                           cached(frontend::Stage::Fragment, fragment));
    EXPECT_TRUE(pipeline.hasValue());
    if (!pipeline) return out;
    auto d = s.drawState(*pipeline);
    if (one(4)) d.scissor = {{int32_t(random() % 60), int32_t(random() % 60)}, {uint32_t(random() % 100), uint32_t(random() % 60)}};
    std::vector<ColorVertex> vertices;
    for (uint32_t t = 0, n = 1 + random() % 5; t < n; ++t) {
      const float cx = x(random), cy = y(random), size = t % 3 ? 30 : 400, z = unit(random), alpha = unit(random);
      for (int v = 0; v < 3; ++v)
        vertices.push_back({{(cx + (unit(random) - 0.5f) * size) / kWidth * 2 - 1, (cy + (unit(random) - 0.5f) * size) / kHeight * 2 - 1, z, 1}, {unit(random), unit(random), unit(random), alpha}});
    }
    const bool counted = one(3);
    if (counted) s.executor.beginOcclusion(&out.occlusion[i & 1]);
    s.draw(d, vertices);
    if (counted) s.executor.endOcclusion();
    if (one(6)) {
      VkClearAttachment c{VK_IMAGE_ASPECT_COLOR_BIT, uint32_t(random() % formats.size()), {}};
      c.clearValue.color.uint32[0] = 0;
      s.executor.clear(c, {{{int32_t(random() % 80), int32_t(random() % 60)}, {64, 32}}, 0, layers});
    }
  }
  s.end();
  for (uint32_t a = 0; a < formats.size(); ++a) {
    append(out.bytes, resolved[a]);
    if (visible[a]) append(out.bytes, many[a]);
  }
  append(out.bytes, depth, VK_IMAGE_ASPECT_DEPTH_BIT);
  append(out.bytes, depth, VK_IMAGE_ASPECT_STENCIL_BIT);
  out.counters = s.executor.counters();
  return out;
}

class OneColorAblation : public testing::TestWithParam<uint32_t> {};

TEST_P(OneColorAblation, RandomPassesHaveTheSameBitsWithAndWithoutOneColor) {
  const std::vector<std::vector<VkFormat>> sets = {
      {VK_FORMAT_R8G8B8A8_UNORM},
      {VK_FORMAT_R8G8B8A8_SRGB, VK_FORMAT_R16G16B16A16_SFLOAT, VK_FORMAT_R8_UNORM},
      {VK_FORMAT_R32G32B32A32_UINT, VK_FORMAT_B8G8R8A8_UNORM},
      {VK_FORMAT_R32_SFLOAT, VK_FORMAT_R8G8_UINT, VK_FORMAT_A2B10G10R10_UNORM_PACK32, VK_FORMAT_R8G8B8A8_SNORM}};
  uint64_t kept = 0, split = 0;
  for (uint32_t seed = 0; seed < 12; ++seed) {
    const auto& formats = sets[seed % sets.size()];
    const Outcome off = randomPass(seed, formats, GetParam(), kOff);
    for (Ideas more : {Ideas(0), bit(Idea::VisibleFirst), bit(Idea::LazyClear)}) {
      const Outcome on = randomPass(seed, formats, GetParam(), more);
      ASSERT_TRUE(on.bytes == off.bytes) << "seed " << seed << ", off " << more << ": byte "
                                          << std::mismatch(on.bytes.begin(), on.bytes.end(), off.bytes.begin()).first - on.bytes.begin() << " of " << on.bytes.size();
      for (int i = 0; i < 2; ++i) ASSERT_EQ(on.occlusion[i], off.occlusion[i]) << "seed " << seed << ", off " << more;
      if (!(more & bit(Idea::VisibleFirst))) {
        ASSERT_EQ(on.counters.samplesPassed, off.counters.samplesPassed) << "seed " << seed;
        ASSERT_EQ(on.counters.samplesTested, off.counters.samplesTested) << "seed " << seed;
        ASSERT_EQ(on.counters.fragmentsShaded, off.counters.fragmentsShaded) << "seed " << seed;
      }
      kept += on.counters.blocksOneColor;
      split += on.counters.blocksSplit;
    }
    EXPECT_EQ(off.counters.blocksOneColor + off.counters.blocksSplit, 0u);
  }
  EXPECT_GT(kept, 0u);
  EXPECT_GT(split, 0u);
}

INSTANTIATE_TEST_SUITE_P(Samples, OneColorAblation, testing::Values(2u, 4u, 8u, 16u), [](const auto& info) { return "x" + std::to_string(info.param); });

// Often enough that rows of whole blocks have routines of their own.
TEST(OneColor, RowsOfWholeBlocksHaveTheSameBits) {
  for (VkFormat format : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R16G16B16A16_SFLOAT})
    for (uint32_t kind = 0; kind < 4; ++kind) {   // blended; perspective
      const bool blend = kind & 1, perspective = kind & 2;
      Scene s(320, 200, VK_FORMAT_UNDEFINED, 1, format);
      Image many(format, 320, 200, 1, 4);
      GraphicsState state = s.state();
      state.samples = 4;
      state.blend[0].blendEnable = blend;
      state.blend[0].srcColorBlendFactor = state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
      auto d = s.drawState(s.pipeline(state));
      std::vector<ColorVertex> v;
      for (float at : {0.0f, 90.0f}) {
        auto more = triangle(s, {at - 40, -10, at + 500, 20, at, 700}, 0.25f, {1, 0.5f, 0.25f, 0.5f});
        for (int i = 0; i < 3; ++i) {
          if (perspective)
            for (float& x : more[size_t(i)].position) x *= 1 + float(i);
          more[size_t(i)].color[i] = 0.1f;
        }
        v.insert(v.end(), more.begin(), more.end());
      }
      const auto pass = [&](Ideas off) {
        s.executor.disable(off);
        s.begin(0.25f, 0.5f, 0.75f, 1);
        s.pass.resolve[0] = s.pass.color[0];
        s.pass.color[0].memory = many.memory();
        s.executor.begin(s.pass);
        for (int i = 0; i < 2; ++i) s.draw(d, v);
        s.end();
        auto bytes = s.color.bytes;
        bytes.insert(bytes.end(), many.memory().base, many.memory().base + many.layout.size);
        return bytes;
      };
      const auto before = pass(kOff | bit(Idea::WholeBlocks));
      for (int i = 0; i < 4; ++i) pass(0);
      EXPECT_TRUE(pass(0) == before) << "format " << format << ", blend " << blend << ", perspective " << perspective;
      EXPECT_TRUE(pass(bit(Idea::VisibleFirst)) == before) << "format " << format << ", blend " << blend << ", perspective " << perspective;
      EXPECT_TRUE(pass(kOff) == before) << "format " << format << ", blend " << blend << ", perspective " << perspective;
    }
}

// Rows of quads end in the middle of blocks: what waits in them is written before its block's samples part.
TEST(OneColor, ManyTrianglesOfOneDrawHaveTheSameBits) {
  uint64_t split = 0;
  for (VkFormat format : {VK_FORMAT_R32_SFLOAT, VK_FORMAT_R8G8B8A8_UNORM})
    for (uint32_t seed = 0; seed < 12; ++seed) {
      std::mt19937 random(seed);
      std::uniform_real_distribution<float> place(-20, 100);
      // In the first, two quads of a block wait while a triangle comes that has the other two.
      std::vector<std::array<float, 6>> corners = {{24.195312f, 35.578125f, 26.777344f, 53.835938f, -3.1992188f, 35.371094f},
                                                   {16.253906f, 41.804688f, 53.292969f, 77.730469f, 13.511719f, 100.33594f},
                                                   {6.5820312f, 45.921875f, 34.824219f, 50.207031f, 41.199219f, 41.070312f},
                                                   {44.324219f, 67.703125f, 34.589844f, 42.488281f, 74.285156f, 117.57031f}};
      for (auto& t : corners)
        for (float& at : t) at = seed ? place(random) : at;
      std::vector<ColorVertex> triangles;
      Antialiased shape(4);
      for (const auto& t : corners) {
        const auto more = triangle(shape, t, 0.5f, {0.25f, 0.25f, 0.25f, 0.25f});
        triangles.insert(triangles.end(), more.begin(), more.end());
      }
      std::vector<std::byte> bytes[2];
      for (Ideas off : {Ideas(0), kOff}) {
        Antialiased s(4, format);
        s.executor.disable(off);
        s.fixed.blend[0].blendEnable = true;
        s.fixed.blend[0].srcColorBlendFactor = s.fixed.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
        auto d = s.drawState(s.pipeline(s.fixed));
        s.start(VK_ATTACHMENT_STORE_OP_STORE);
        s.draw(d, triangles);
        s.end();
        bytes[off == kOff].assign(s.many.memory().base, s.many.memory().base + s.many.layout.size);
        split += s.executor.counters().blocksSplit;
      }
      ASSERT_TRUE(bytes[0] == bytes[1]) << "format " << format << ", seed " << seed << ": byte "
                                         << std::mismatch(bytes[0].begin(), bytes[0].end(), bytes[1].begin()).first - bytes[0].begin();
    }
  EXPECT_GT(split, 0u);
}

}  // namespace
}  // namespace pumice::pipeline::test
