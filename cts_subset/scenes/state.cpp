// Pipeline state and dynamic state: viewport, scissor, culling, blending, write masks.
#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

std::vector<Vertex> bigTriangle() {
  return {{{-0.9375f, -0.875f, 0.5f, 1}, {1, 0.2f, 0.2f, 1}},
          {{0.96875f, -0.5f, 0.5f, 1}, {0.2f, 1, 0.2f, 1}},
          {{-0.25f, 0.9375f, 0.5f, 1}, {0.2f, 0.2f, 1, 1}}};
}

// The same triangle in four viewports of dyadic size, each with its own scissor; the last
// viewport reaches outside the picture.
Picture renderViewports(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  Pipeline pipeline = canvas.pipeline({});
  int32_t off = variant == Variant::kBroken ? 1 : 0;
  return canvas.draw({0.05f, 0.05f, 0.1f, 1}, [&](VkCommandBuffer commands) {
    setViewport(commands, 0, 0, 128, 128);
    setScissor(commands, 17, 9, 90, 77);
    canvas.drawVertices(commands, pipeline, bigTriangle());
    setViewport(commands, 128.5f, 3.25f, 128, 64);
    setScissor(commands, 0, 0, kSize, kSize);
    canvas.drawVertices(commands, pipeline, bigTriangle());
    setViewport(commands, 16, 112, 64, 128);
    setScissor(commands, 30 + off, 120, 1, 100);
    canvas.drawVertices(commands, pipeline, bigTriangle());
    setScissor(commands, 34, 120, 40, 100);
    canvas.drawVertices(commands, pipeline, bigTriangle());
    setViewport(commands, 96, 96, 256, 256);
    setScissor(commands, 96, 96, 400, 400);
    canvas.drawVertices(commands, pipeline, bigTriangle());
    setScissor(commands, 40, 40, 0, 10);  // nothing
    canvas.drawVertices(commands, pipeline, bigTriangle());
  });
}

// Depth range of the viewport: same geometry, other depths.
Picture renderDepthRange(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  spec.compare = VK_COMPARE_OP_ALWAYS;
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = bigTriangle();
  vertices[0].position.z = 0.125f, vertices[1].position.z = 0.875f;
  return canvas.draw(
      {0, 0, 0, 1},
      [&](VkCommandBuffer commands) {
        float low = variant == Variant::kBroken ? 0.251f : 0.25f;
        setViewport(commands, 0, 0, 128, 256, low, 0.75f);
        canvas.drawVertices(commands, pipeline, vertices);
        setViewport(commands, 128, 0, 128, 256, 1.0f, 0.0f);  // reversed
        canvas.drawVertices(commands, pipeline, vertices);
      },
      true);
}

// Four rows: cull none, front, back, both; left clockwise, right counter-clockwise; the lower
// half of the picture with the other front face.
Picture renderCulling(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  const VkCullModeFlags kModes[] = {VK_CULL_MODE_NONE, VK_CULL_MODE_FRONT_BIT, VK_CULL_MODE_BACK_BIT,
                                    VK_CULL_MODE_FRONT_AND_BACK};
  std::vector<Pipeline> pipelines;
  for (VkFrontFace face : {VK_FRONT_FACE_COUNTER_CLOCKWISE, VK_FRONT_FACE_CLOCKWISE})
    for (VkCullModeFlags mode : kModes) {
      PipelineSpec spec;
      spec.cull = mode;
      spec.frontFace = variant == Variant::kBroken ? VK_FRONT_FACE_CLOCKWISE : face;
      // gl_FrontFacing shows which side a driver thinks it sees.
      spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = gl_FrontFacing ? passed : passed.bgra; }
)";
      pipelines.push_back(canvas.pipeline(spec));
    }
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (int row = 0; row < 8; ++row)
      for (int column = 0; column < 2; ++column) {
        double x = column * 128 + 8, y = row * 32 + 2;
        glm::vec4 colour(1, 0.6f, 0.1f * float(row), 1);
        Vertex a{atPixel(canvas.size(), x, y), colour};
        Vertex b{atPixel(canvas.size(), x + 100, y), colour};
        Vertex c{atPixel(canvas.size(), x + 50, y + 28), colour};
        canvas.drawVertices(commands, pipelines[row],
                            column ? std::vector<Vertex>{a, c, b} : std::vector<Vertex>{a, b, c});
      }
  });
}

bool blendSupported(const Device& device) {
  return device.supports(Canvas::kColourFormat, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT);
}

Picture renderAlphaBlend(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  VkPipelineColorBlendAttachmentState over{};
  over.blendEnable = VK_TRUE;
  over.srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
  over.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  over.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  over.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  if (variant == Variant::kBroken) over.dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
  spec.blend = over;
  Pipeline pipeline = canvas.pipeline(spec);
  return canvas.draw({0.9f, 0.9f, 0.8f, 1}, [&](VkCommandBuffer commands) {
    const glm::vec4 kColours[] = {{1, 0, 0, 0.5f}, {0, 0.7f, 0, 0.4f}, {0, 0.2f, 1, 0.6f}};
    for (int i = 0; i < 3; ++i) {
      auto vertices = bigTriangle();
      for (Vertex& v : vertices) {
        v.position.x = v.position.x * 0.75f + 0.125f * float(i - 1);
        v.position.y = v.position.y * 0.75f + 0.125f * float(1 - i);
        v.attribute = kColours[i];
      }
      canvas.drawVertices(commands, pipeline, vertices);
    }
  });
}

// Every pair of blend factor and operation that core Vulkan has, as small squares.
Picture renderBlendTable(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 128);
  std::vector<Pipeline> pipelines;
  for (int op = 0; op < 5; ++op)
    for (int factor = 0; factor <= VK_BLEND_FACTOR_SRC_ALPHA_SATURATE; ++factor) {
      PipelineSpec spec;
      VkPipelineColorBlendAttachmentState state{};
      state.blendEnable = VK_TRUE;
      state.srcColorBlendFactor = VkBlendFactor(factor);
      state.dstColorBlendFactor = VkBlendFactor(VK_BLEND_FACTOR_ONE_MINUS_DST_ALPHA - factor % 10);
      state.colorBlendOp = VkBlendOp(variant == Variant::kBroken && op == 1 ? 2 : op);
      state.srcAlphaBlendFactor = VkBlendFactor(factor % 10);
      state.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
      state.alphaBlendOp = VkBlendOp(op);
      spec.blend = state;
      pipelines.push_back(canvas.pipeline(spec));
    }
  // Values that 8 bits hold exactly: no doubt about how source and destination are rounded.
  return canvas.draw(glm::vec4(77, 153, 115, 178) / 255.0f, [&](VkCommandBuffer commands) {
    for (size_t i = 0; i < pipelines.size(); ++i) {
      double x = double(i % 15) * 16 + 4, y = double(i / 15) * 24 + 4;
      glm::vec4 colour = glm::vec4(204, 64, 140, 89) / 255.0f;
      Vertex a{atPixel(canvas.size(), x, y), colour};
      Vertex b{atPixel(canvas.size(), x + 12, y), colour};
      Vertex c{atPixel(canvas.size(), x + 12, y + 20), colour};
      Vertex d{atPixel(canvas.size(), x, y + 20), colour};
      canvas.drawVertices(commands, pipelines[i], {a, b, c, a, c, d});
    }
  });
}

Picture renderWriteMask(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  std::vector<Pipeline> pipelines;
  for (uint32_t mask = 0; mask < 16; ++mask) {
    PipelineSpec spec;
    spec.writeMask = variant == Variant::kBroken ? mask | 1 : mask;
    pipelines.push_back(canvas.pipeline(spec));
  }
  return canvas.draw({0.2f, 0.4f, 0.6f, 0.8f}, [&](VkCommandBuffer commands) {
    for (int i = 0; i < 16; ++i) {
      setViewport(commands, float(i * 16), 0, 16, 64);
      auto vertices = bigTriangle();
      for (Vertex& v : vertices) v.attribute = {0.9f, 0.9f, 0.9f, 0.1f};
      canvas.drawVertices(commands, pipelines[i], vertices);
    }
  });
}

// vkCmdClearAttachments inside the pass, in rectangles.
Picture renderClearAttachments(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  Pipeline pipeline = canvas.pipeline(spec);
  return canvas.draw(
      {0, 0, 0.2f, 1},
      [&](VkCommandBuffer commands) {
        canvas.drawVertices(commands, pipeline, bigTriangle());
        VkClearAttachment clears[2]{};
        clears[0].aspectMask = VK_IMAGE_ASPECT_COLOR_BIT;
        clears[0].clearValue.color = {{0.7f, 0.1f, 0.3f, 1}};
        clears[1].aspectMask = VK_IMAGE_ASPECT_DEPTH_BIT;
        clears[1].clearValue.depthStencil = {0.25f, 0};
        int32_t x = variant == Variant::kBroken ? 61 : 60;
        VkClearRect rectangles[2] = {{{{x, 50}, {33, 41}}, 0, 1}, {{{130, 100}, {70, 9}}, 0, 1}};
        vkCmdClearAttachments(commands, 2, clears, 2, rectangles);
        // Behind the cleared depth, in front of the rest.
        auto vertices = bigTriangle();
        for (Vertex& v : vertices) {
          v.position.z = 0.375f;
          v.position.x *= 0.5f;
          v.attribute = {1, 1, 1, 1};
        }
        canvas.drawVertices(commands, pipeline, vertices);
      },
      true);
}

}  // namespace

void addStateScenes(SceneList& scenes) {
  Scene viewports;
  viewports.name = "viewport_scissor";
  viewports.broken = "a one-pixel scissor one pixel off";
  viewports.render = renderViewports;
  scenes.push_back(viewports);

  auto depth = [](const Device& device) {
    return device.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
  };
  Scene range;
  range.name = "viewport_depth_range";
  range.broken = "minDepth 0.001 off";
  range.render = renderDepthRange;
  range.expectation = [] {
    Expectation e;
    e.depthTolerance = 1e-6;
    return e;
  };
  range.supported = depth;
  scenes.push_back(range);

  Scene culling;
  culling.name = "culling";
  culling.broken = "the front face is always clockwise";
  culling.render = renderCulling;
  scenes.push_back(culling);

  Scene blend;
  blend.name = "alpha_blend";
  blend.broken = "the destination is not weighted";
  blend.render = renderAlphaBlend;
  blend.supported = blendSupported;
  scenes.push_back(blend);

  Scene table;
  table.name = "blend_table";
  table.broken = "SUBTRACT the wrong way round";
  table.render = renderBlendTable;
  table.supported = blendSupported;
  scenes.push_back(table);

  Scene mask;
  mask.name = "write_mask";
  mask.broken = "red is always written";
  mask.render = renderWriteMask;
  scenes.push_back(mask);

  Scene clears;
  clears.name = "clear_attachments";
  clears.broken = "a rectangle one pixel off";
  clears.render = renderClearAttachments;
  clears.expectation = range.expectation;
  clears.supported = depth;
  scenes.push_back(clears);
}

}  // namespace pumice::cts
