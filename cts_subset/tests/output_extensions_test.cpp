// Extensions that say what becomes of fragments and their depth, on devices that enable one of them alone.
#include "cts_subset/tests/graphics.h"
#include "cts_subset/tests/one_extension.h"

namespace pumice::cts {
namespace {

constexpr VkShaderStageFlags kGraphics = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

class OutputExtensionFeatures : public OneExtensionTest {
 protected:
  static constexpr VkExtent2D kSize{8, 8};
  using Draw = std::function<void(uint32_t x, VkPipeline pipeline, std::array<float, 4> given)>;

  // With dynamic rendering beside the extension's own features.
  Device& openForDrawing(const char* extension, void* features = nullptr, const VkPhysicalDeviceFeatures& core = {}) {
    rendering.pNext = features;
    return open(extension, &rendering, core);
  }
  bool drawing() { return device().vulkan13.dynamicRendering; }
  Image target(Workspace& work, VkFormat format, VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT) {
    ImageSpec spec;
    spec.format = format;
    spec.extent = {kSize.width, kSize.height, 1};
    spec.samples = samples;
    spec.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | (aspectsOf(format) & VK_IMAGE_ASPECT_COLOR_BIT ? VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT
                                                                                                  : VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT);
    Image image = work.image(spec);
    toGeneral(work, image);
    return image;
  }
  // One pass; draw(x, pipeline, given) covers the columns from x on, `width` of them.
  void pass(Workspace& work, const VkRenderingInfo& info, VkPipelineLayout layout, const std::function<void(VkCommandBuffer, const Draw&)>& body,
            VkViewport viewport = {0, 0, kSize.width, kSize.height, 0, 1}, uint32_t width = 1) {
    work.device.run([&](VkCommandBuffer c) {
      vkCmdBeginRendering(c, &info);
      vkCmdSetViewport(c, 0, 1, &viewport);
      body(c, [&](uint32_t x, VkPipeline pipeline, std::array<float, 4> given) {
        vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        VkRect2D scissor{{int32_t(x), 0}, {width, kSize.height}};
        vkCmdSetScissor(c, 0, 1, &scissor);
        vkCmdPushConstants(c, layout, kGraphics, 0, sizeof given, given.data());
        vkCmdDraw(c, 3, 1, 0, 0);
      });
      vkCmdEndRendering(c);
      fullBarrier(c);
    });
  }
  template <class F>
  F command(Workspace& work, const char* name) {
    return reinterpret_cast<F>(vkGetDeviceProcAddr(work.device.handle, name));
  }

 private:
  VkPhysicalDeviceVulkan13Features rendering = [] {
    VkPhysicalDeviceVulkan13Features f{};
    f.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
    f.dynamicRendering = VK_TRUE;
    return f;
  }();
};

// Eight attachments, some blended, some with a mask; every draw writes those that are enabled, and all of them write depth.
TEST_P(OutputExtensionFeatures, ColorWriteEnable) {
  PUMICE_NEED_FEATURE(available(VK_EXT_COLOR_WRITE_ENABLE_EXTENSION_NAME) && drawing() && device().features.independentBlend);
  auto wanted = features<VkPhysicalDeviceColorWriteEnableFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COLOR_WRITE_ENABLE_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.colorWriteEnable);
  VkPhysicalDeviceFeatures core{};
  core.independentBlend = VK_TRUE;
  constexpr uint32_t kTargets = 8;
  Workspace work(openForDrawing(VK_EXT_COLOR_WRITE_ENABLE_EXTENSION_NAME, &wanted, core));
  auto setEnables = command<PFN_vkCmdSetColorWriteEnableEXT>(work, "vkCmdSetColorWriteEnableEXT");
  ASSERT_NE(setEnables, nullptr);
  std::vector<Image> targets;
  std::vector<VkRenderingAttachmentInfo> attachments;
  GraphicsSpec spec;
  for (uint32_t i = 0; i < kTargets; i++) {
    targets.push_back(target(work, VK_FORMAT_R32G32_SFLOAT));
    VkClearValue clear{};
    clear.color.float32[0] = clear.color.float32[1] = 100;
    attachments.push_back(rendered(work.view(targets[i]), VK_ATTACHMENT_LOAD_OP_CLEAR, clear));
    spec.colors.push_back(VK_FORMAT_R32G32_SFLOAT);
    VkPipelineColorBlendAttachmentState blend{i % 3 == 1, VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ONE, VK_BLEND_OP_ADD, VK_BLEND_FACTOR_ONE, VK_BLEND_FACTOR_ONE, VK_BLEND_OP_ADD, 0xf};
    if (i % 3 == 2) blend.colorWriteMask = VK_COLOR_COMPONENT_G_BIT;
    spec.blends.push_back(blend);
  }
  Image depth = target(work, VK_FORMAT_D32_SFLOAT);
  spec.depth = VK_FORMAT_D32_SFLOAT;
  spec.depthTest = true;
  spec.fragment = "#version 460\nlayout(push_constant) uniform P { vec4 given; };\n";
  std::string body;
  for (uint32_t i = 0; i < kTargets; i++) {
    const std::string n = std::to_string(i);
    spec.fragment += "layout(location = " + n + ") out vec2 o" + n + ";\n";
    body += "o" + n + " = vec2(given.x + " + n + ", given.y);\n";
  }
  spec.fragment += "void main() {\n" + body + "}\n";
  VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
  // One pipeline has its enables, the other leaves them to the command.
  constexpr uint32_t kStatic = 0b10110101;
  auto enablesOf = [](uint32_t mask) {
    std::array<VkBool32, kTargets> e{};
    for (uint32_t i = 0; i < kTargets; i++) e[i] = mask >> i & 1;
    return e;
  };
  const auto staticEnables = enablesOf(kStatic);
  VkPipelineColorWriteCreateInfoEXT writes{VK_STRUCTURE_TYPE_PIPELINE_COLOR_WRITE_CREATE_INFO_EXT, nullptr, kTargets, staticEnables.data()};
  spec.blendNext = &writes;
  VkPipeline fixed = makeGraphics(work, layout, spec);
  spec.dynamic = {VK_DYNAMIC_STATE_COLOR_WRITE_ENABLE_EXT};
  VkPipeline dynamic = makeGraphics(work, layout, spec);

  struct Step {
    uint32_t column;
    VkPipeline pipeline;
    uint32_t mask;
    float value, z;
  };
  const std::vector<Step> steps = {{0, dynamic, 0xff, 1, 0.9f},  {1, dynamic, 0x00, 2, 0.9f}, {2, dynamic, 0x55, 3, 0.9f}, {3, dynamic, 0xaa, 4, 0.9f},
                                   {4, fixed, kStatic, 5, 0.9f}, {5, dynamic, 0x80, 6, 0.9f}, {0, dynamic, 0x0f, 7, 0.5f}, {4, dynamic, 0xf0, 8, 0.5f},
                                   {2, fixed, kStatic, 9, 0.5f}, {1, dynamic, 0xff, 10, 0.95f}, {6, dynamic, 0x00, 11, 0.25f}, {6, dynamic, 0xff, 12, 0.5f}};
  std::vector<std::array<float, 2>> expected(kTargets * kSize.width, {100, 100});
  std::vector<float> depths(kSize.width, 1);
  for (const Step& s : steps) {
    if (s.z >= depths[s.column]) continue;
    depths[s.column] = s.z;
    for (uint32_t i = 0; i < kTargets; i++) {
      auto& e = expected[i * kSize.width + s.column];
      if (!(s.mask >> i & 1)) continue;
      if (i % 3 != 2) e[0] = s.value + float(i) + (i % 3 == 1 ? e[0] : 0);
      e[1] = -s.value + (i % 3 == 1 ? e[1] : 0);
    }
  }
  VkRenderingInfo info = renderingInfo(kSize, attachments);
  VkClearValue far{};
  far.depthStencil.depth = 1;
  VkRenderingAttachmentInfo depthAttachment = rendered(work.view(depth), VK_ATTACHMENT_LOAD_OP_CLEAR, far);
  info.pDepthAttachment = &depthAttachment;
  pass(work, info, layout, [&](VkCommandBuffer c, const Draw& draw) {
    for (const Step& s : steps) {
      vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, s.pipeline);
      if (s.pipeline == dynamic) setEnables(c, kTargets, enablesOf(s.mask).data());
      draw(s.column, s.pipeline, {s.value, -s.value, 0, s.z});
    }
  });
  for (uint32_t i = 0; i < kTargets; i++) {
    std::vector<float> found = valuesOf<float>(wordsOf(download(work, targets[i], 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 8)));
    for (uint32_t x = 0; x < kSize.width; x++) {
      EXPECT_EQ(found[(3 * kSize.width + x) * 2], expected[i * kSize.width + x][0]) << "attachment " << i << ", column " << x;
      EXPECT_EQ(found[(3 * kSize.width + x) * 2 + 1], expected[i * kSize.width + x][1]) << "attachment " << i << ", column " << x;
    }
  }
  std::vector<float> found = valuesOf<float>(wordsOf(download(work, depth, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
  for (uint32_t x = 0; x < kSize.width; x++) EXPECT_NEAR(found[x], depths[x], 1e-6) << "depth of column " << x;
}

TEST_P(OutputExtensionFeatures, DynamicLogicOp) {
  PUMICE_NEED_FEATURE(available(VK_EXT_EXTENDED_DYNAMIC_STATE_2_EXTENSION_NAME) && drawing() && device().features.logicOp);
  auto wanted = features<VkPhysicalDeviceExtendedDynamicState2FeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTENDED_DYNAMIC_STATE_2_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.extendedDynamicState2LogicOp);
  VkPhysicalDeviceFeatures core{};
  core.logicOp = VK_TRUE;
  Workspace work(openForDrawing(VK_EXT_EXTENDED_DYNAMIC_STATE_2_EXTENSION_NAME, &wanted, core));
  auto setLogicOp = command<PFN_vkCmdSetLogicOpEXT>(work, "vkCmdSetLogicOpEXT");
  ASSERT_NE(setLogicOp, nullptr);
  GraphicsSpec spec;
  spec.fragment = kGivenFragment;
  spec.colors = {VK_FORMAT_R8G8B8A8_UINT};
  spec.logicOp = true;
  spec.dynamic = {VK_DYNAMIC_STATE_LOGIC_OP_EXT};
  VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
  VkPipeline pipeline = makeGraphics(work, layout, spec);
  constexpr uint32_t kSource = 0x35, kBefore = 0x5c;
  constexpr uint32_t kResults[16] = {
      0, kSource & kBefore, kSource & ~kBefore, kSource, ~kSource & kBefore, kBefore, kSource ^ kBefore, kSource | kBefore,
      ~(kSource | kBefore), ~(kSource ^ kBefore), ~kBefore, kSource | ~kBefore, ~kSource, ~kSource | kBefore, ~(kSource & kBefore), ~0u};
  for (uint32_t first : {0u, 8u}) {
    Image image = target(work, VK_FORMAT_R8G8B8A8_UINT);
    VkClearValue clear{};
    for (uint32_t& v : clear.color.uint32) v = kBefore;
    std::vector<VkRenderingAttachmentInfo> attachments = {rendered(work.view(image), VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    pass(work, renderingInfo(kSize, attachments), layout, [&](VkCommandBuffer c, const Draw& draw) {
      for (uint32_t i = 0; i < 8; i++) {
        setLogicOp(c, VkLogicOp(first + i));
        draw(i, pipeline, {kSource, kSource, kSource, 0.5f});
      }
    });
    Bytes found = download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    for (uint32_t i = 0; i < 8; i++) EXPECT_EQ(found[i * 4 + 1], uint8_t(kResults[first + i])) << "logic operation " << first + i;
  }
}

// References from the shader take part in the comparison and in what is written; not where tests come before the shader.
TEST_P(OutputExtensionFeatures, StencilExport) {
  PUMICE_NEED_FEATURE(available(VK_EXT_SHADER_STENCIL_EXPORT_EXTENSION_NAME) && drawing());
  for (VkFormat format : {VK_FORMAT_S8_UINT, VK_FORMAT_D32_SFLOAT_S8_UINT, VK_FORMAT_D24_UNORM_S8_UINT}) {
    if (!device().supports(format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT)) continue;
    SCOPED_TRACE("format " + std::to_string(format));
    Workspace work(openForDrawing(VK_EXT_SHADER_STENCIL_EXPORT_EXTENSION_NAME));
    Image image = target(work, format);
    VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
    GraphicsSpec spec;
    spec.stencil = format;
    if (aspectsOf(format) & VK_IMAGE_ASPECT_DEPTH_BIT) spec.depth = format;
    spec.depthTest = spec.depth != VK_FORMAT_UNDEFINED;
    spec.stencilTest = true;
    spec.stencilReference = 0xf7;
    spec.stencilOps = {VK_STENCIL_OP_INVERT, VK_STENCIL_OP_REPLACE, VK_STENCIL_OP_ZERO, VK_COMPARE_OP_GREATER, 0xf0, 0xfc, 0};
    const std::string head = "#version 460\n#extension GL_ARB_shader_stencil_export : require\nlayout(push_constant) uniform P { vec4 given; };\n";
    spec.fragment = head + R"(
void main() {
  gl_FragStencilRefARB = int(gl_FragCoord.y) * 32 + int(given.x);
  if (given.y > 0 && int(gl_FragCoord.y) == 3) discard;
})";
    VkPipeline late = makeGraphics(work, layout, spec);
    spec.fragment = head + "layout(early_fragment_tests) in;\nvoid main() { gl_FragStencilRefARB = int(given.x); }\n";
    VkPipeline early = makeGraphics(work, layout, spec);
    constexpr uint32_t kBefore = 100;
    VkClearValue clear{};
    clear.depthStencil = {0.75f, kBefore};
    VkRenderingAttachmentInfo attachment = rendered(work.view(image), VK_ATTACHMENT_LOAD_OP_CLEAR, clear);
    VkRenderingInfo info = renderingInfo(kSize, {});
    info.pStencilAttachment = &attachment;
    if (spec.depth) info.pDepthAttachment = &attachment;
    pass(work, info, layout, [&](VkCommandBuffer, const Draw& draw) {
      draw(0, late, {0, 0, 0, 0.5f});
      draw(1, late, {7, 1, 0, 0.5f});
      draw(2, early, {1, 0, 0, 0.5f});
      draw(3, late, {7, 0, 0, 0.9f});
    });
    auto expected = [](uint32_t reference, bool near) {
      const uint32_t result = (reference & 0xf0) > (kBefore & 0xf0) ? near ? reference : 0 : ~kBefore;
      return (result & 0xfc) | (kBefore & 3);
    };
    Bytes found = download(work, image, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
    for (uint32_t y = 0; y < kSize.height; y++) {
      const uint8_t* row = &found[y * kSize.width];
      EXPECT_EQ(row[0], expected(y * 32, true)) << "row " << y;
      EXPECT_EQ(row[1], y == 3 ? kBefore : expected(y * 32 + 7, true)) << "row " << y;
      // lavapipe 22 takes the shader's reference all the same.
      if (GetParam() == Role::kTested) {
        EXPECT_EQ(row[2], expected(0xf7, true)) << "row " << y;
      }
      EXPECT_EQ(row[3], expected(y * 32 + 7, !spec.depthTest)) << "row " << y;
      EXPECT_EQ(row[4], kBefore) << "row " << y;
    }
  }
}

// Each sample has a reference of its own; one in four passes.
TEST_P(OutputExtensionFeatures, StencilExportPerSample) {
  PUMICE_NEED_FEATURE(available(VK_EXT_SHADER_STENCIL_EXPORT_EXTENSION_NAME) && drawing() && device().features.sampleRateShading);
  constexpr VkFormat kFormat = VK_FORMAT_D32_SFLOAT_S8_UINT;
  VkPhysicalDeviceFeatures core{};
  core.sampleRateShading = VK_TRUE;
  Workspace work(openForDrawing(VK_EXT_SHADER_STENCIL_EXPORT_EXTENSION_NAME, nullptr, core));
  Image stencil = target(work, kFormat, VK_SAMPLE_COUNT_4_BIT), samples = target(work, VK_FORMAT_R32_SFLOAT, VK_SAMPLE_COUNT_4_BIT);
  Image image = target(work, VK_FORMAT_R32_SFLOAT);
  VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
  GraphicsSpec spec;
  spec.colors = {VK_FORMAT_R32_SFLOAT};
  spec.stencil = kFormat;
  spec.samples = VK_SAMPLE_COUNT_4_BIT;
  spec.stencilTest = true;
  spec.stencilOps.compareOp = VK_COMPARE_OP_EQUAL;
  spec.fragment = R"(#version 460
#extension GL_ARB_shader_stencil_export : require
layout(location = 0) out float color;
void main() {
  gl_FragStencilRefARB = gl_SampleID == int(gl_FragCoord.x) % 4 ? 2 : 3;
  color = 4 << 2 * gl_SampleID;
})";
  VkPipeline pipeline = makeGraphics(work, layout, spec);
  VkClearValue clear{}, two{};
  two.depthStencil.stencil = 2;
  std::vector<VkRenderingAttachmentInfo> colors = {rendered(work.view(samples), VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
  colors[0].resolveMode = VK_RESOLVE_MODE_AVERAGE_BIT;
  colors[0].resolveImageView = work.view(image);
  colors[0].resolveImageLayout = VK_IMAGE_LAYOUT_GENERAL;
  VkRenderingAttachmentInfo attachment = rendered(work.view(stencil), VK_ATTACHMENT_LOAD_OP_CLEAR, two);
  VkRenderingInfo info = renderingInfo(kSize, colors);
  info.pStencilAttachment = &attachment;
  pass(work, info, layout, [&](VkCommandBuffer, const Draw& draw) { draw(0, pipeline, {0, 0, 0, 0.5f}); }, {0, 0, 8, 8, 0, 1}, 8);
  std::vector<float> found = valuesOf<float>(wordsOf(download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4)));
  for (uint32_t x = 0; x < kSize.width; x++) EXPECT_EQ(found[x], float(1 << 2 * (x % 4))) << "column " << x;
}

// Clip-space depth from -w to w: clipped, clamped and in a viewport of its own range.
TEST_P(OutputExtensionFeatures, DepthClipControl) {
  PUMICE_NEED_FEATURE(available(VK_EXT_DEPTH_CLIP_CONTROL_EXTENSION_NAME) && drawing() && device().features.depthClamp);
  auto wanted = features<VkPhysicalDeviceDepthClipControlFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEPTH_CLIP_CONTROL_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.depthClipControl);
  VkPhysicalDeviceFeatures core{};
  core.depthClamp = VK_TRUE;
  for (bool fromMinusOne : {true, false})
    for (bool clamp : {false, true}) {
      SCOPED_TRACE(std::string(fromMinusOne ? "-1 to 1" : "0 to 1") + (clamp ? ", clamped" : ""));
      Workspace work(openForDrawing(VK_EXT_DEPTH_CLIP_CONTROL_EXTENSION_NAME, &wanted, core));
      Image image = target(work, VK_FORMAT_D32_SFLOAT);
      VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
      VkPipelineViewportDepthClipControlCreateInfoEXT control{VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_DEPTH_CLIP_CONTROL_CREATE_INFO_EXT, nullptr, fromMinusOne};
      GraphicsSpec spec;
      spec.viewportNext = &control;
      spec.depth = VK_FORMAT_D32_SFLOAT;
      spec.depthTest = true;
      spec.depthClamp = clamp;
      // Depth is x times `given.x` plus `given.y`.
      spec.vertex = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
void main() {
  vec2 at = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1;
  gl_Position = vec4(at, at.x * given.x + given.y, 1) * given.z;
})";
      VkPipeline pipeline = makeGraphics(work, layout, spec);
      for (std::array<float, 4> given : {std::array<float, 4>{2, 0, 1, 0}, {0.5f, -0.25f, 4, 0}, {0, -1, 0.5f, 0}, {0, 1, 2, 0}, {-1.5f, 0.5f, 1, 0}}) {
        VkClearValue far{};
        far.depthStencil.depth = 1;
        VkRenderingAttachmentInfo attachment = rendered(work.view(image), VK_ATTACHMENT_LOAD_OP_CLEAR, far);
        VkRenderingInfo info = renderingInfo(kSize, {});
        info.pDepthAttachment = &attachment;
        const float low = 0.125f, high = 0.875f;
        pass(work, info, layout, [&](VkCommandBuffer, const Draw& draw) { draw(0, pipeline, given); }, {0, 0, 8, 8, low, high}, 8);
        std::vector<float> found = valuesOf<float>(wordsOf(download(work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
        for (uint32_t x = 0; x < kSize.width; x++) {
          const float at = (float(x) + 0.5f) / 4 - 1, z = at * given[0] + given[1], depth = fromMinusOne ? z / 2 + 0.5f : z;
          const bool visible = clamp || (depth >= 0 && depth <= 1);
          EXPECT_NEAR(found[x], visible ? low + (high - low) * std::clamp(depth, 0.0f, 1.0f) : 1, 1e-5) << "x " << x << ", z = " << given[0] << " x + " << given[1];
        }
      }
    }
}

PUMICE_ON_BOTH_DEVICES(OutputExtensionFeatures);

}  // namespace
}  // namespace pumice::cts
