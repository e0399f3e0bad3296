// What happens to fragments after shading: logic operations, dual-source blending, depth clamp, bias and bounds, draws whose
// parameters lie in buffers, stores and atomics.
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

std::vector<Vertex> rectangle(const glm::uvec2& canvas, double x0, double y0, double x1, double y1, glm::vec4 colour, float z0 = 0.5f,
                              float z1 = 0.5f) {
  Vertex a{atPixel(canvas, x0, y0, z0), colour}, b{atPixel(canvas, x1, y0, z1), colour}, c{atPixel(canvas, x1, y1, z1), colour},
      d{atPixel(canvas, x0, y1, z0), colour};
  return {a, b, c, a, c, d};
}

bool hasDepth(const Device& device) {
  return device.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
}

Picture renderLogic(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  std::vector<Pipeline> pipelines;
  for (int op = 0; op < 16; ++op) {
    PipelineSpec spec;
    spec.adjust = [&](PipelineStates& s) {
      s.blend.logicOpEnable = VK_TRUE;
      s.blend.logicOp = variant == Variant::kBroken && op == VK_LOGIC_OP_XOR ? VK_LOGIC_OP_OR : VkLogicOp(op);
    };
    pipelines.push_back(canvas.pipeline(spec));
  }
  return canvas.draw(glm::vec4(0x35, 0xca, 0x0f, 0xf1) / 255.0f, [&](VkCommandBuffer commands) {
    for (int op = 0; op < 16; ++op)
      canvas.drawVertices(commands, pipelines[op], rectangle(canvas.size(), op * 16 + 2, 4, op * 16 + 14, 60, glm::vec4(0x53, 0xa5, 0x3c, 0x99) / 255.0f));
  });
}

Picture renderDualSource(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  const std::pair<VkBlendFactor, VkBlendFactor> kFactors[] = {{VK_BLEND_FACTOR_SRC1_COLOR, VK_BLEND_FACTOR_ONE_MINUS_SRC1_COLOR},
                                                              {VK_BLEND_FACTOR_SRC1_ALPHA, VK_BLEND_FACTOR_ONE_MINUS_SRC1_ALPHA},
                                                              {VK_BLEND_FACTOR_ONE_MINUS_SRC1_COLOR, VK_BLEND_FACTOR_SRC1_ALPHA},
                                                              {VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_SRC1_COLOR}};
  std::vector<Pipeline> pipelines;
  for (auto [source, destination] : kFactors) {
    PipelineSpec spec;
    spec.fragment = std::string(R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0, index = 0) out vec4 colour;
layout(location = 0, index = 1) out vec4 weight;
void main() { colour = passed; weight = )") + (variant == Variant::kBroken ? "colour" : "vec4(0.2, 0.4, 0.6, 0.8)") + "; }\n";
    VkPipelineColorBlendAttachmentState blend{};
    blend.blendEnable = VK_TRUE;
    blend.srcColorBlendFactor = blend.srcAlphaBlendFactor = source;
    blend.dstColorBlendFactor = blend.dstAlphaBlendFactor = destination;
    spec.blend = blend;
    pipelines.push_back(canvas.pipeline(spec));
  }
  return canvas.draw(glm::vec4(51, 153, 204, 102) / 255.0f, [&](VkCommandBuffer commands) {
    for (int i = 0; i < 4; ++i)
      canvas.drawVertices(commands, pipelines[i], rectangle(canvas.size(), i * 64 + 4, 4, i * 64 + 60, 60, glm::vec4(255, 102, 51, 204) / 255.0f));
  });
}

// Slopes through the near and the far plane: clipped, clamped, and (below) neither.
Picture renderDepthClamp(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  spec.compare = VK_COMPARE_OP_ALWAYS;
  Pipeline clipped = canvas.pipeline(spec);
  spec.adjust = [&](PipelineStates& s) { s.raster.depthClampEnable = variant != Variant::kBroken; };
  Pipeline clamped = canvas.pipeline(spec);
  VkPipelineRasterizationDepthClipStateCreateInfoEXT clip{};
  clip.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_DEPTH_CLIP_STATE_CREATE_INFO_EXT;
  clip.depthClipEnable = VK_TRUE;
  spec.adjust = [&](PipelineStates& s) {
    s.raster.depthClampEnable = VK_TRUE;
    s.raster.pNext = &clip;
  };
  Pipeline both = device.depthClip.depthClipEnable ? canvas.pipeline(spec) : clipped;
  return canvas.draw(
      {0, 0, 0, 1},
      [&](VkCommandBuffer commands) {
        setViewport(commands, 0, 0, kSize, kSize, 0.25f, 0.75f);
        canvas.drawVertices(commands, clipped, rectangle(canvas.size(), 8, 8, 248, 72, {1, 0.5f, 0, 1}, -0.5f, 1.5f));
        canvas.drawVertices(commands, clamped, rectangle(canvas.size(), 8, 88, 248, 152, {0, 1, 0.5f, 1}, -0.5f, 1.5f));
        canvas.drawVertices(commands, both, rectangle(canvas.size(), 8, 168, 248, 232, {0.5f, 0, 1, 1}, -0.5f, 1.5f));
      },
      true);
}

Picture renderBiasClamp(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  std::vector<Pipeline> pipelines;
  // A positive clamp bounds from above, a negative one from below.
  const glm::vec3 kBias[] = {{0, 32, 0}, {0, 32, 0.02f}, {0, -32, -0.02f}, {0, 32, -0.02f}};
  for (glm::vec3 bias : kBias) {
    PipelineSpec spec;
    spec.depthTest = spec.depthWrite = true;
    spec.compare = VK_COMPARE_OP_ALWAYS;
    spec.depthBias = glm::vec2(bias.x, bias.y);
    spec.adjust = [&](PipelineStates& s) { s.raster.depthBiasClamp = variant == Variant::kBroken ? 0 : bias.z; };
    pipelines.push_back(canvas.pipeline(spec));
  }
  return canvas.draw(
      {0, 0, 0, 1},
      [&](VkCommandBuffer commands) {
        for (int i = 0; i < 4; ++i)
          canvas.drawVertices(commands, pipelines[i], rectangle(canvas.size(), 8, 8 + i * 60, 248, 60 + i * 60, {1, 0.2f * float(i), 0, 1}, 0.25f, 0.75f));
      },
      true);
}

// A slope is laid down, then a second colour is drawn where the stored depths lie within bounds.
constexpr float kBounds[2] = {0.375f, 0.625f};
Picture renderDepthBounds(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  spec.compare = VK_COMPARE_OP_ALWAYS;
  Pipeline lay = canvas.pipeline(spec);
  spec.depthTest = spec.depthWrite = false;
  spec.adjust = [&](PipelineStates& s) {
    s.depth.depthBoundsTestEnable = variant != Variant::kBroken;
    s.depth.minDepthBounds = kBounds[0];
    s.depth.maxDepthBounds = kBounds[1];
  };
  Pipeline within = canvas.pipeline(spec);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, lay, rectangle(canvas.size(), 0, 0, 256, 64, {1, 0, 0, 1}, 0, 1));
    canvas.drawVertices(commands, within, rectangle(canvas.size(), 0, 0, 256, 64, {0, 1, 0, 1}, 0.5f, 0.5f));
  });
}

std::string verifyDepthBounds(const Picture& picture) {
  for (uint32_t x = 0; x < kSize; ++x) {
    double depth = (x + 0.5) / kSize;
    bool inside = depth >= kBounds[0] && depth <= kBounds[1];
    if ((picture.pixel(x, 32)[1] == 255) != inside) return "column " + std::to_string(x) + " is on the wrong side of the depth bounds";
  }
  return {};
}

// Several draws from one indirect buffer, as many as a counter says; colours come from the draw parameters.
Picture renderIndirect(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  spec.vertex = R"(#version 450
#extension GL_ARB_shader_draw_parameters : require
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
void main() {
  gl_Position = position + vec4(0.0625 * float(gl_InstanceIndex - gl_BaseInstanceARB), 0.25 * float(gl_DrawIDARB), 0, 0);
  passed = vec4(float(gl_BaseVertexARB) / 8, float(gl_BaseInstanceARB) / 8, float(gl_DrawIDARB) / 4 + given.b / 8, 1);
}
)";
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = rectangle(canvas.size(), 8, 4, 20, 28, {0, 0, 1, 1});
  auto more = rectangle(canvas.size(), 108, 4, 120, 28, {0, 0, 0, 1});
  vertices.insert(vertices.end(), more.begin(), more.end());
  Buffer indices = canvas.bufferOf(std::vector<uint32_t>{0, 1, 2, 0, 2, 5, 0, 1, 2}, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  const VkBufferUsageFlags kIndirect = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
  std::vector<VkDrawIndexedIndirectCommand> indexed = {
      {6, 3, 0, 0, 0}, {6, 5, 0, 6, 3}, {3, 2, 6, 6, variant == Variant::kBroken ? 4u : 5u}, {6, 8, 0, 0, 7}};
  std::vector<VkDrawIndirectCommand> plain = {{6, 1, 0, 1}, {3, 2, 6, 2}, {6, 2, 0, 0}};
  Buffer indexedCommands = canvas.bufferOf(indexed, kIndirect), plainCommands = canvas.bufferOf(plain, kIndirect);
  Buffer counter = canvas.bufferOf(std::vector<uint32_t>{77, 3}, kIndirect);
  auto indexedCount = reinterpret_cast<PFN_vkCmdDrawIndexedIndirectCountKHR>(vkGetDeviceProcAddr(device.handle, "vkCmdDrawIndexedIndirectCountKHR"));
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    canvas.bindVertices(commands, vertices);
    vkCmdBindIndexBuffer(commands, indices.handle, 0, VK_INDEX_TYPE_UINT32);
    // The last of the four is beyond the count.
    indexedCount(commands, indexedCommands.handle, 0, counter.handle, 4, 4, sizeof(VkDrawIndexedIndirectCommand));
    setViewport(commands, 0, 128, kSize, 128);
    vkCmdDrawIndirect(commands, plainCommands.handle, 0, 3, sizeof(VkDrawIndirectCommand));
  });
}

// Counts fragments and vertices with atomics, and shows the counters as stripes of a second draw.
Picture renderAtomics(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  Buffer counters = canvas.buffer(16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  std::memset(counters.mapped, 0, 16);
  Binding binding{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER};
  binding.buffer = {counters.handle, 0, VK_WHOLE_SIZE};
  DescriptorSet set = canvas.descriptors({binding});
  PipelineSpec spec;
  spec.sets = {set.layout};
  spec.vertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(set = 0, binding = 0) buffer Counters { uint fragments, vertices, largest; };
layout(location = 0) out vec4 passed;
void main() { gl_Position = position; passed = given; atomicAdd(vertices, 1u); }
)";
  spec.fragment = std::string(R"(#version 450
layout(location = 0) in vec4 passed;
layout(set = 0, binding = 0) buffer Counters { uint fragments, vertices, largest; };
layout(location = 0) out vec4 colour;
void main() {
  if (uint(gl_FragCoord.x) % 7u == 3u) discard;
  atomicAdd(fragments, )") + (variant == Variant::kBroken ? "2u" : "1u") + R"();
  atomicMax(largest, uint(gl_FragCoord.x) * 256u + uint(gl_FragCoord.y));
  colour = passed;
}
)";
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = rectangle(canvas.size(), 8, 8, 120, 120, {1, 0.5f, 0, 1});
  canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, pipeline, vertices);
  });
  spec.vertex = kPassVertex;
  spec.fragment = R"(#version 450
layout(set = 0, binding = 0) readonly buffer Counters { uint fragments, vertices, largest; };
layout(location = 0) out vec4 colour;
void main() {
  uint bit = uint(gl_FragCoord.x) / 8u, row = uint(gl_FragCoord.y) / 64u;
  uint value = row == 0u ? fragments : row == 1u ? largest : uint(vertices >= 4u && vertices <= 6u);
  colour = vec4(float(value >> bit & 1u), 0.5, 0, 1);
}
)";
  Pipeline show = canvas.pipeline(spec);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, show.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, show, rectangle(canvas.size(), 0, 0, 256, 256, {1, 1, 1, 1}));
  });
}

}  // namespace

void addOutputScenes(SceneList& scenes) {
  auto add = [&](const char* name, const char* broken, Picture (*render)(Device&, Variant), bool (*supported)(const Device&)) -> Scene& {
    Scene scene;
    scene.name = name;
    scene.broken = broken;
    scene.render = render;
    scene.supported = supported;
    scenes.push_back(scene);
    return scenes.back();
  };
  add("logic_operations", "XOR is OR", renderLogic, [](const Device& d) { return bool(d.features.logicOp); });
  add("dual_source", "the second source is the first", renderDualSource, [](const Device& d) { return bool(d.features.dualSrcBlend); });
  auto depthError = [] {
    Expectation e;
    e.depthTolerance = 1e-6;
    e.onGrid = false;   // where the slope leaves the depth range
    for (double x : {68.0, 188.0}) e.edges.push_back({{x, 0}, {x, 256}, 1.0 / 64});
    return e;
  };
  add("depth_clamp", "clipped instead of clamped", renderDepthClamp, [](const Device& d) { return d.features.depthClamp && hasDepth(d); })
      .expectation = depthError;
  add("depth_bias_clamp", "the clamp is left out", renderBiasClamp, [](const Device& d) { return d.features.depthBiasClamp && hasDepth(d); })
      .expectation = depthError;
  add("depth_bounds", "the test is off", renderDepthBounds, [](const Device& d) { return d.features.depthBounds && hasDepth(d); }).verify =
      verifyDepthBounds;
  add("indirect_draws", "another first instance", renderIndirect, [](const Device& d) {
    return d.features.multiDrawIndirect && d.features.drawIndirectFirstInstance && d.vulkan11.shaderDrawParameters &&
           d.has(VK_KHR_DRAW_INDIRECT_COUNT_EXTENSION_NAME) && d.has(VK_KHR_SHADER_DRAW_PARAMETERS_EXTENSION_NAME);
  });
  add("stores_and_atomics", "fragments count twice", renderAtomics,
      [](const Device& d) { return d.features.fragmentStoresAndAtomics && d.features.vertexPipelineStoresAndAtomics; });
}

}  // namespace pumice::cts
