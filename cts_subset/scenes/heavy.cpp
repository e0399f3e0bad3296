// Scenes with much work: meshes, thousands of draws, sizes that fit no tile, stencil, four samples.
#include <glm/gtc/matrix_transform.hpp>

#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

// A hilly landscape of 2 * kCells * kCells triangles, most of them a few pixels large.
constexpr int kCells = 120;
constexpr uint32_t kMeshWidth = 333, kMeshHeight = 217;  // no multiple of anything

std::vector<Vertex> landscape() {
  glm::mat4 projection = glm::perspective(glm::radians(55.0f), 333.0f / 217.0f, 0.5f, 40.0f);
  projection[1][1] = -projection[1][1];
  glm::mat4 view = glm::lookAt(glm::vec3(0, 3.5f, 7), glm::vec3(0, 0, 0), glm::vec3(0, 1, 0));
  std::vector<Vertex> grid;
  for (int j = 0; j <= kCells; ++j)
    for (int i = 0; i <= kCells; ++i) {
      float x = (float(i) / kCells - 0.5f) * 10, z = (float(j) / kCells - 0.5f) * 10;
      float y = 0.7f * std::sin(x * 1.3f) * std::cos(z * 1.1f) + 0.2f * std::sin(x * 3 + z * 2);
      grid.push_back({projection * view * glm::vec4(x, y, z, 1),
                      {0.5f + 0.5f * y, 0.45f + 0.04f * x, 0.5f - 0.05f * z, 1}});
    }
  return grid;
}

std::vector<uint32_t> landscapeIndices() {
  std::vector<uint32_t> indices;
  for (uint32_t j = 0; j < kCells; ++j)
    for (uint32_t i = 0; i < kCells; ++i) {
      uint32_t a = j * (kCells + 1) + i, b = a + 1, c = a + kCells + 1, d = c + 1;
      for (uint32_t k : {a, b, c, b, d, c}) indices.push_back(k);
    }
  return indices;
}

Picture renderLandscape(Device& device, Variant variant) {
  Canvas canvas(device, kMeshWidth, kMeshHeight, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  if (variant == Variant::kBroken) spec.compare = VK_COMPARE_OP_GREATER;
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<uint32_t> indices = landscapeIndices();
  Buffer indexBuffer = canvas.bufferOf(indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  return canvas.draw(
      {0.4f, 0.6f, 0.8f, 1},
      [&](VkCommandBuffer commands) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
        canvas.bindVertices(commands, landscape());
        vkCmdBindIndexBuffer(commands, indexBuffer.handle, 0, VK_INDEX_TYPE_UINT32);
        vkCmdDrawIndexed(commands, uint32_t(indices.size()), 1, 0, 0, 0);
      },
      false, variant == Variant::kBroken ? 0.0f : 1.0f);
}

Expectation landscapeExpectation() {
  Expectation e;
  e.onGrid = false;
  std::vector<Vertex> grid = landscape();
  std::vector<glm::vec4> corners;
  for (uint32_t index : landscapeIndices()) corners.push_back(grid[index].position);
  e.edges = edgesOfTriangles(corners, {0, 0, kMeshWidth, kMeshHeight});
  return e;
}

// Thousands of overlapping draws, opaque and blended by turns: the order of all of them shows.
Picture renderManyDraws(Device& device, Variant variant) {
  constexpr int kDraws = 3000;
  Canvas canvas(device, 256, 256);
  struct Push {
    glm::vec4 rectangle;
    glm::vec4 colour;
  };
  PipelineSpec spec;
  spec.vertex = R"(#version 450
layout(push_constant) uniform Push { vec4 rectangle; vec4 colour; } push;
const vec2 corners[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(1, 1), vec2(0, 0), vec2(1, 1), vec2(0, 1));
void main() {
  vec2 p = mix(push.rectangle.xy, push.rectangle.zw, corners[gl_VertexIndex]);
  gl_Position = vec4(p / 128.0 - 1.0, 0.0, 1.0);
}
)";
  spec.fragment = R"(#version 450
layout(location = 0) out vec4 colour;
layout(push_constant) uniform Push { vec4 rectangle; vec4 colour; } push;
void main() { colour = push.colour; }
)";
  spec.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof(Push)}};
  spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};
  Pipeline opaque = canvas.pipeline(spec);
  VkPipelineColorBlendAttachmentState add{};
  add.blendEnable = VK_TRUE;
  add.srcColorBlendFactor = VK_BLEND_FACTOR_ONE;
  add.dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
  add.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  add.dstAlphaBlendFactor = VK_BLEND_FACTOR_ZERO;
  spec.blend = add;
  Pipeline blended = canvas.pipeline(spec);
  Buffer unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
    uint32_t state = 7;
    auto random = [&](uint32_t below) { return (state = state * 1664525u + 1013904223u) / 65536 % below; };
    for (int i = 0; i < kDraws; ++i) {
      const Pipeline& pipeline = i % 3 == 0 ? opaque : blended;
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
      float x = float(random(250)), y = float(random(250));
      Push push{{x, y, x + float(1 + random(40)), y + float(1 + random(40))}, {}};
      // Exact in 8 bits, so that sums are exact too.
      push.colour = glm::vec4(random(64), random(64), random(64), 255) / 255.0f;
      if (variant == Variant::kBroken && i == kDraws - 40) continue;
      vkCmdPushConstants(commands, pipeline.layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT,
                         0, sizeof push, &push);
      vkCmdDraw(commands, 6, 1, 0, 0);
    }
  });
}

// Every stencil operation (columns) where the test fails, where the depth test fails, and where both pass
// (rows); afterwards the stencil values are shown by drawing where they match.
Picture renderStencil(Device& device, Variant variant, VkFormat format) {
  Canvas canvas(device, 256, 128, format);
  auto square = [&](double x, double y, double w, double h, float z, glm::vec4 colour) {
    Vertex a{atPixel(canvas.size(), x, y, z), colour}, b{atPixel(canvas.size(), x + w, y, z), colour};
    Vertex c{atPixel(canvas.size(), x + w, y + h, z), colour}, d{atPixel(canvas.size(), x, y + h, z), colour};
    return std::vector<Vertex>{a, b, c, a, c, d};
  };
  VkStencilOpState fill{VK_STENCIL_OP_REPLACE,
                        VK_STENCIL_OP_REPLACE,
                        VK_STENCIL_OP_REPLACE,
                        VK_COMPARE_OP_ALWAYS,
                        0xff,
                        0xff,
                        0};
  std::vector<std::pair<Pipeline, std::vector<Vertex>>> draws;
  // Start values: 0, 5 and 255 in three stripes of every column.
  for (uint32_t k = 0; k < 3; ++k) {
    const uint32_t kStart[] = {0, 5, 255};
    fill.reference = kStart[k];
    PipelineSpec spec;
    spec.stencil = fill;
    spec.writeMask = 0;
    Pipeline pipeline = canvas.pipeline(spec);
    for (int op = 0; op < 8; ++op)
      draws.push_back({pipeline, square(op * 32 + k * 10, 0, 10, 128, 0.5f, {})});
  }
  for (int op = 0; op < 8; ++op)
    for (int row = 0; row < 3; ++row) {
      VkStencilOpState state{
          VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_ALWAYS, 0xff, 0x7f, 9};
      auto kind = VkStencilOp(variant == Variant::kBroken && op == VK_STENCIL_OP_INCREMENT_AND_WRAP
                                  ? VK_STENCIL_OP_INCREMENT_AND_CLAMP
                                  : op);
      if (row == 0) state.failOp = kind, state.compareOp = VK_COMPARE_OP_NEVER;
      if (row == 1) state.depthFailOp = kind;
      if (row == 2) state.passOp = kind, state.writeMask = 0xff;
      // The depth buffer holds 1: a compare of GREATER is never true, so every pixel fails.
      PipelineSpec spec;
      spec.stencil = state;
      spec.depthTest = true;
      spec.compare = row == 1 ? VK_COMPARE_OP_GREATER : VK_COMPARE_OP_LESS;
      spec.writeMask = 0;
      draws.push_back({canvas.pipeline(spec), square(op * 32, row * 40 + 4, 30, 30, 0.5f, {})});
    }
  // Show bit after bit of the result.
  for (uint32_t bit = 0; bit < 8; ++bit) {
    VkStencilOpState show{
        VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_EQUAL, 1u << bit, 0,
        1u << bit};
    VkColorComponentFlags mask = bit < 3 ? 1u : bit < 6 ? 2u : 4u;
    float amount = float(128 >> (bit % 3)) / 255.0f;
    PipelineSpec spec;
    spec.stencil = show;
    VkPipelineColorBlendAttachmentState add{};
    add.blendEnable = VK_TRUE;
    add.srcColorBlendFactor = add.dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
    spec.blend = add;
    spec.writeMask = mask;
    draws.push_back({canvas.pipeline(spec), square(0, 0, 256, 128, 0.5f, glm::vec4(amount))});
  }
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (const auto& [pipeline, vertices] : draws) canvas.drawVertices(commands, pipeline, vertices);
  });
}

// Depth bias lifts the second square over the first, or does not.
Picture renderDepthBias(Device& device, Variant variant) {
  Canvas canvas(device, 256, 64, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  Pipeline plain = canvas.pipeline(spec);
  const glm::vec2 kBias[] = {{0, 0},    {-2, 0},      {2, 0},       {0, -1.5f},
                             {0, 1.5f}, {-400000, 0}, {400000, -3}, {-1, -1}};
  std::vector<Pipeline> biased;
  for (const glm::vec2& bias : kBias) {
    spec.depthBias = variant == Variant::kBroken ? -bias : bias;  // constant and slope factors
    biased.push_back(canvas.pipeline(spec));
  }
  return canvas.draw(
      {0, 0, 0, 1},
      [&](VkCommandBuffer commands) {
        for (int i = 0; i < 8; ++i) {
          auto quad = [&](double inset, glm::vec4 colour) {
            auto at = [&](double x, double y) {
              return Vertex{atPixel(canvas.size(), i * 32 + x, y, float(0.25 + (x + y) / 256)), colour};
            };
            Vertex a = at(2 + inset, 2 + inset), b = at(30 - inset, 2 + inset),
                   c = at(30 - inset, 62 - inset), d = at(2 + inset, 62 - inset);
            return std::vector<Vertex>{a, b, c, a, c, d};
          };
          canvas.drawVertices(commands, plain, quad(0, {0.2f, 0.4f, 0.8f, 1}));
          canvas.drawVertices(commands, biased[size_t(i)], quad(6, {1, 0.8f, 0.2f, 1}));
        }
      },
      true);
}

}  // namespace

void addHeavyScenes(SceneList& scenes) {
  auto depth = [](const Device& device) {
    return device.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
  };
  Scene mesh;
  mesh.name = "landscape";
  mesh.broken = "the farthest hill wins";
  mesh.render = renderLandscape;
  mesh.expectation = landscapeExpectation;
  mesh.supported = depth;
  scenes.push_back(mesh);

  auto blend = [](const Device& device) {
    return device.supports(Canvas::kColourFormat, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT);
  };
  Scene draws;
  draws.name = "many_draws";
  draws.broken = "one of 3000 draws is lost";
  draws.render = renderManyDraws;
  draws.supported = blend;
  scenes.push_back(draws);

  const struct {
    VkFormat format;
    const char* name;
  } kStencil[] = {{VK_FORMAT_D24_UNORM_S8_UINT, "stencil_d24s8"},
                  {VK_FORMAT_D32_SFLOAT_S8_UINT, "stencil_d32s8"}};
  for (const auto& entry : kStencil) {
    Scene stencil;
    stencil.name = entry.name;
    stencil.broken = "INCREMENT_AND_WRAP clamps";
    stencil.render = [format = entry.format](Device& device, Variant variant) {
      return renderStencil(device, variant, format);
    };
    stencil.supported = [format = entry.format, blend](const Device& device) {
      return blend(device) && device.supports(format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
    };
    scenes.push_back(stencil);
  }

  Scene bias;
  bias.name = "depth_bias";
  bias.broken = "the bias has the wrong sign";
  bias.render = renderDepthBias;
  bias.expectation = [] {
    Expectation e;
    e.depthTolerance = 3e-7;
    return e;
  };
  bias.supported = depth;
  scenes.push_back(bias);
}

}  // namespace pumice::cts
