#include "tests/pipeline/scene.h"

#include <gtest/gtest.h>

#include "tests/frontend/compile.h"

namespace pumice::pipeline::test {

const char* const kColorVertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 outColor;
void main() { gl_Position = position; outColor = color; })";

const char* const kColorFragment = R"(#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = color; })";

Image::Image(VkFormat format, uint32_t width, uint32_t height, uint32_t layers, uint32_t samples) {
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = format;
  info.extent = {width, height, 1};
  info.mipLevels = 1;
  info.arrayLayers = layers;
  info.samples = VkSampleCountFlagBits(samples);
  info.tiling = VK_IMAGE_TILING_OPTIMAL;
  info.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  layout = texture::imageLayout(info);
  bytes.resize(layout.size + 64);
}

std::shared_ptr<const frontend::Shader> compile(frontend::Stage stage, const std::string& glsl) {
  using frontend::test::GlslStage;
  std::string log;
  const GlslStage s = stage == frontend::Stage::Vertex ? GlslStage::Vertex : stage == frontend::Stage::Fragment ? GlslStage::Fragment : GlslStage::Compute;
  const auto words = frontend::test::compileGlsl(s, glsl, &log);
  EXPECT_FALSE(words.empty()) << log;
  auto module = frontend::parseModule(words);
  EXPECT_TRUE(module.hasValue()) << (module ? "" : module.error().message);
  if (!module) return nullptr;
  auto shader = frontend::translate(**module, stage, "main", {});
  EXPECT_TRUE(shader.hasValue()) << (shader ? "" : shader.error().message);
  return shader ? *shader : nullptr;
}

Scene::Scene(uint32_t w, uint32_t h, VkFormat depthFormat, unsigned threads, VkFormat colorFormat)
    : width(w), height(h), pool(threads), executor(pool), color(colorFormat, w, h) {
  if (depthFormat) depth = std::make_unique<Image>(depthFormat, w, h);
}

GraphicsState Scene::state() const {
  GraphicsState s;
  s.vertexBindings = {{0, sizeof(ColorVertex), VK_VERTEX_INPUT_RATE_VERTEX}};
  s.vertexAttributes = {{0, 0, VK_FORMAT_R32G32B32A32_SFLOAT, 0}, {1, 0, VK_FORMAT_R32G32B32A32_SFLOAT, 16}};
  s.viewport = {0, 0, float(width), float(height), 0, 1};
  s.scissor = {{0, 0}, {width, height}};
  VkPipelineColorBlendAttachmentState blend{};
  blend.colorWriteMask = 15;
  s.blend = {blend};
  s.colorFormats[0] = color.layout.format->format;
  s.colorCount = 1;
  if (depth) s.depthStencilFormat = depth->layout.format->format;
  return s;
}

std::shared_ptr<GraphicsPipeline> Scene::pipeline(GraphicsState state, const std::string& vertex, const std::string& fragment,
                                                  std::shared_ptr<Layout> layout) {
  auto v = compile(frontend::Stage::Vertex, vertex);
  auto f = fragment.empty() ? nullptr : compile(frontend::Stage::Fragment, fragment);
  auto p = createGraphicsPipeline(std::move(state), layout ? layout : std::make_shared<Layout>(), v, f);
  EXPECT_TRUE(p.hasValue()) << (p ? "" : p.error().message);
  return p ? *p : nullptr;
}

DrawState Scene::drawState(std::shared_ptr<GraphicsPipeline> pipeline) {
  DrawState d;
  const GraphicsState& s = graphicsState(*pipeline);
  d.viewport = s.viewport;
  d.scissor = s.scissor;
  std::copy(std::begin(s.blendConstants), std::end(s.blendConstants), d.blendConstants);
  const VkStencilOpState faces[2] = {s.stencilFront, s.stencilBack};
  for (int i = 0; i < 2; ++i) {
    d.stencilReference[i] = faces[i].reference;
    d.stencilCompareMask[i] = faces[i].compareMask;
    d.stencilWriteMask[i] = faces[i].writeMask;
  }
  d.pipeline = std::move(pipeline);
  return d;
}

void Scene::begin(float r, float g, float b, float a, float clearDepth, uint32_t stencil) {
  pass = {};
  pass.renderArea = {{0, 0}, {width, height}};
  pass.width = width;
  pass.height = height;
  pass.colorCount = 1;
  Attachment& c = pass.color[0];
  c.memory = color.memory();
  c.format = color.layout.format->format;
  c.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  c.clear.color = {{r, g, b, a}};
  if (depth) {
    Attachment& d = pass.depthStencil;
    d.memory = depth->memory();
    d.format = depth->layout.format->format;
    d.loadOp = d.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    d.clear.depthStencil = {clearDepth, stencil};
  }
  executor.begin(pass);
}

void Scene::draw(const DrawState& state, const std::vector<ColorVertex>& vertices) {
  kept_.push_back(std::make_unique<std::vector<ColorVertex>>(vertices));
  DrawState d = state;
  d.vertexBuffers[0] = {uint64_t(kept_.back()->data()), vertices.size() * sizeof(ColorVertex)};
  DrawParams p;
  p.count = uint32_t(vertices.size());
  executor.draw(d, p);
}

std::vector<ColorVertex> triangle(const Scene& scene, std::array<float, 6> xy, float z, std::array<float, 4> color) {
  std::vector<ColorVertex> v;
  for (int i = 0; i < 3; ++i)
    v.push_back({{xy[2 * i] / float(scene.width) * 2 - 1, xy[2 * i + 1] / float(scene.height) * 2 - 1, z, 1},
                 {color[0], color[1], color[2], color[3]}});
  return v;
}

std::vector<ColorVertex> rectangle(const Scene& scene, float x0, float y0, float x1, float y1, float z, std::array<float, 4> color) {
  auto v = triangle(scene, {x0, y0, x1, y0, x0, y1}, z, color);
  const auto second = triangle(scene, {x1, y0, x1, y1, x0, y1}, z, color);
  v.insert(v.end(), second.begin(), second.end());
  return v;
}

}  // namespace pumice::pipeline::test
