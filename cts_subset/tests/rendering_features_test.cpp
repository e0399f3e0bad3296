// Dynamic rendering and what belongs to a pass: views, resolves, aspects, blending, queries; each test draws and reads back.
#include "cts_subset/tests/graphics.h"

#include <bit>

namespace pumice::cts {
namespace {

class RenderingFeatures : public DrawTest {};

TEST_P(RenderingFeatures, MultiviewInDynamicRendering) {
  PUMICE_NEED_FEATURE(device().vulkan11.multiview && device().vulkan13.dynamicRendering);
  if (GetParam() == Role::kPeer) GTEST_SKIP() << "lavapipe 22.3 leaves out these draws in all views but the first";
  Image image = target(kUint, 4);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.vertex = kViewVertex;
  spec.fragment = kViewFragment;
  spec.colors = {kUint};
  spec.viewMask = 0b1011;
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  device().run([&](VkCommandBuffer commands) {
    VkClearColorValue before{};
    before.uint32[0] = 99;
    VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 4};
    vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &before, 1, &all);
    fullBarrier(commands);
    VkClearValue clear{};
    clear.color.uint32[0] = 50;
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    pass(commands, renderingInfo(kSize, colors, spec.viewMask), pipeline, [&] {
      drawWhole(commands, layout, 1);
      VkClearAttachment attachment{VK_IMAGE_ASPECT_COLOR_BIT, 0, {}};
      attachment.clearValue.color.uint32[0] = 60;
      VkClearRect rect{{{7, 0}, {1, 1}}, 0, 1};
      vkCmdClearAttachments(commands, 1, &attachment, 1, &rect);
      VkRect2D one{{0, 0}, {1, 1}};
      vkCmdSetScissor(commands, 0, 1, &one);
      drawWhole(commands, layout, 2);
    }, {4, 8});   // the right half stays as it was cleared
  });
  for (uint32_t layer = 0; layer < 4; layer++) {
    SCOPED_TRACE(testing::Message() << "layer " << layer);
    Words p = pixels(image, layer);
    bool drawn = spec.viewMask >> layer & 1;
    EXPECT_EQ(at(p, 1, 3, 0), drawn ? layer + 1 : 99);
    EXPECT_EQ(at(p, 1, 3, 3), drawn ? layer : 0) << "of the vertex stage";
    EXPECT_EQ(at(p, 3, 3, 1), drawn ? 3u : 0u);
    EXPECT_EQ(at(p, 5, 3, 0), drawn ? 50u : 99u);
    EXPECT_EQ(at(p, 7, 0, 0), drawn ? 60u : 99u);
    EXPECT_EQ(at(p, 0, 0, 2), drawn ? 2u : 0u);
    EXPECT_EQ(at(p, 1, 0, 2), drawn ? 1u : 0u);
  }
}

// An edge through the middle of pixel 3: two of its four samples lie to the left.
TEST_P(RenderingFeatures, DepthStencilResolve) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  PUMICE_NEED_FEATURE(device().properties.limits.framebufferDepthSampleCounts & VK_SAMPLE_COUNT_4_BIT);
  const auto v12 = properties<VkPhysicalDeviceVulkan12Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES);
  struct Case {
    VkResolveModeFlagBits depth, stencil;
    float depthThere;
    uint8_t stencilThere;
  };
  for (VkFormat format : {VK_FORMAT_D32_SFLOAT_S8_UINT, VK_FORMAT_D24_UNORM_S8_UINT})
    for (const Case& c : {Case{VK_RESOLVE_MODE_SAMPLE_ZERO_BIT, VK_RESOLVE_MODE_SAMPLE_ZERO_BIT, 0.25f, 9}, Case{VK_RESOLVE_MODE_MAX_BIT, VK_RESOLVE_MODE_MAX_BIT, 1.0f, 9},
                          Case{VK_RESOLVE_MODE_MIN_BIT, VK_RESOLVE_MODE_MIN_BIT, 0.25f, 2}, Case{VK_RESOLVE_MODE_AVERAGE_BIT, VK_RESOLVE_MODE_NONE, 0.625f, 77},
                          Case{VK_RESOLVE_MODE_NONE, VK_RESOLVE_MODE_SAMPLE_ZERO_BIT, 0.75f, 9}}) {
      if (!device().supports(format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT)) continue;
      if ((c.depth & ~v12.supportedDepthResolveModes) || (c.stencil & ~v12.supportedStencilResolveModes)) continue;
      if (c.depth != c.stencil && !(v12.independentResolveNone && v12.independentResolve)) continue;
      SCOPED_TRACE(testing::Message() << "format " << format << " modes " << c.depth << " and " << c.stencil);
      Image many = target(format, 1, VK_SAMPLE_COUNT_4_BIT), one = target(format);
      VkPipelineLayout layout = pushLayout();
      GraphicsSpec spec;
      spec.vertex = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
void main() {
  float x = (gl_VertexIndex & 1) != 0 ? given.x : -1.0, y = (gl_VertexIndex & 2) != 0 ? 1.0 : -1.0;
  gl_Position = vec4(x, y, given.w, 1);
}
)";
      spec.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP;
      spec.depth = spec.stencil = format;
      spec.depthTest = spec.stencilTest = true;
      spec.stencilReference = 9;
      spec.samples = VK_SAMPLE_COUNT_4_BIT;
      VkPipeline pipeline = makeGraphics(*work, layout, spec);
      VkImageView manyView = work->view(many), oneView = work->view(one);
      device().run([&](VkCommandBuffer commands) {
        clear(commands, one, VkClearDepthStencilValue{0.75f, 77});
        VkClearValue clear{};
        clear.depthStencil = {1.0f, 2};
        VkRenderingAttachmentInfo depth = rendered(manyView, VK_ATTACHMENT_LOAD_OP_CLEAR, clear), stencil = depth;
        depth.resolveMode = c.depth;
        stencil.resolveMode = c.stencil;
        depth.resolveImageView = stencil.resolveImageView = oneView;
        depth.resolveImageLayout = stencil.resolveImageLayout = VK_IMAGE_LAYOUT_GENERAL;
        VkRenderingInfo info = renderingInfo(kSize, {});
        info.pDepthAttachment = &depth;
        info.pStencilAttachment = &stencil;
        pass(commands, info, pipeline, [&] {
          push(commands, layout, 3.5f / 4 - 1, 0, 0, 0.25f);
          vkCmdDraw(commands, 4, 1, 0, 0);
        });
      });
      Bytes stencil = stencils(one);
      Words depth = valuesOf<uint32_t>(wordsOf(download(*work, one, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
      auto value = [&](uint32_t x) {
        uint32_t bits = depth[4 * kSize.width + x];
        return format == VK_FORMAT_D24_UNORM_S8_UINT ? float(double(bits & 0xffffff) / 0xffffff) : std::bit_cast<float>(bits);
      };
      EXPECT_NEAR(value(3), c.depthThere, 1e-6f);
      EXPECT_EQ(stencil[4 * kSize.width + 3], c.stencilThere);
      bool d = c.depth != VK_RESOLVE_MODE_NONE, s = c.stencil != VK_RESOLVE_MODE_NONE;
      EXPECT_NEAR(value(1), d ? 0.25f : 0.75f, 1e-6f);
      EXPECT_NEAR(value(6), d ? 1.0f : 0.75f, 1e-6f);
      EXPECT_EQ(stencil[4 * kSize.width + 1], s ? 9 : 77);
      EXPECT_EQ(stencil[4 * kSize.width + 6], s ? 2 : 77);
    }
}

TEST_P(RenderingFeatures, DynamicRenderingLeavesTheOtherAspectAlone) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  Image image = target(VK_FORMAT_D32_SFLOAT_S8_UINT);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.depth = VK_FORMAT_D32_SFLOAT_S8_UINT;
  spec.depthTest = true;
  VkPipeline depthOnly = makeGraphics(*work, layout, spec);
  spec.depth = VK_FORMAT_UNDEFINED;
  spec.stencil = VK_FORMAT_D32_SFLOAT_S8_UINT;
  spec.stencilTest = true;
  spec.stencilReference = 33;
  // Without a depth attachment the depth test is off, whatever the pipeline says. (lavapipe 22.3 goes on with it.)
  if (GetParam() == Role::kPeer) spec.depthTest = false;
  VkPipeline stencilOnly = makeGraphics(*work, layout, spec);
  device().run([&](VkCommandBuffer commands) {
    clear(commands, image, VkClearDepthStencilValue{0.75f, 77});
    VkClearValue clear{};
    clear.depthStencil = {0.9f, 11};
    VkRenderingAttachmentInfo attachment = rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear);
    VkRenderingInfo info = renderingInfo(kSize, {});
    info.pDepthAttachment = &attachment;
    pass(commands, info, depthOnly, [&] { drawWhole(commands, layout); }, {4, 8});
    info.pDepthAttachment = nullptr;
    info.pStencilAttachment = &attachment;
    attachment.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    pass(commands, info, stencilOnly, [&] { drawWhole(commands, layout, 0, 0.1f); }, {8, 4});
  });
  std::vector<float> depth = depths(image);
  Bytes stencil = stencils(image);
  for (uint32_t y : {1u, 6u})
    for (uint32_t x : {1u, 6u}) {
      EXPECT_EQ(depth[y * 8 + x], x < 4 ? 0.5f : 0.9f) << x << " " << y;
      EXPECT_EQ(stencil[y * 8 + x], y < 4 ? 33 : 77) << x << " " << y;
    }
}

// One attachment is added to, one replaced in part, one left alone.
TEST_P(RenderingFeatures, IndependentBlending) {
  PUMICE_NEED_FEATURE(device().features.independentBlend && device().vulkan13.dynamicRendering);
  constexpr VkFormat kFormat = VK_FORMAT_R8G8B8A8_UNORM;
  std::vector<Image> images;
  std::vector<VkRenderingAttachmentInfo> colors;
  VkClearValue clear{};
  clear.color = {{0.2f, 0.2f, 0.2f, 0.2f}};
  GraphicsSpec spec;
  for (int i = 0; i < 3; i++) {
    images.push_back(target(kFormat));
    colors.push_back(rendered(work->view(images[i]), VK_ATTACHMENT_LOAD_OP_CLEAR, clear));
    spec.colors.push_back(kFormat);
    VkPipelineColorBlendAttachmentState blend{};
    blend.blendEnable = i == 0;
    blend.srcColorBlendFactor = blend.dstColorBlendFactor = blend.srcAlphaBlendFactor = blend.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
    blend.colorWriteMask = i == 0 ? 0xf : i == 1 ? VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_A_BIT : 0;
    spec.blends.push_back(blend);
  }
  spec.fragment = R"(#version 460
layout(location = 0) out vec4 a;
layout(location = 1) out vec4 b;
layout(location = 2) out vec4 c;
void main() { a = b = c = vec4(0.4); }
)";
  VkPipelineLayout layout = pushLayout();
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  device().run([&](VkCommandBuffer c) { pass(c, renderingInfo(kSize, colors), pipeline, [&] { drawWhole(c, layout); }); });
  const Bytes expected[3] = {{153, 153, 153, 153}, {51, 102, 51, 102}, {51, 51, 51, 51}};
  for (int i = 0; i < 3; i++) {
    Bytes p = download(*work, images[i], 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    EXPECT_EQ(Bytes(p.begin() + 4 * 27, p.begin() + 4 * 28), expected[i]) << "attachment " << i;
  }
}

// A query of the primary command buffer counts what secondary ones draw.
TEST_P(RenderingFeatures, InheritedQueries) {
  PUMICE_NEED_FEATURE(device().features.inheritedQueries && device().features.occlusionQueryPrecise && device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.colors = {kUint};
  spec.fragment = "#version 460\nlayout(location = 0) out uvec4 color;\nvoid main() { color = uvec4(5); }\n";
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_OCCLUSION, 1, 0};
  VkQueryPool queries = work->make(queryInfo);
  VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, device().family};
  VkCommandPool pool = work->make(poolInfo);
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, VK_COMMAND_BUFFER_LEVEL_SECONDARY, 1};
  VkCommandBuffer secondary = VK_NULL_HANDLE;
  check(vkAllocateCommandBuffers(handle(), &allocate, &secondary), "vkAllocateCommandBuffers");
  VkCommandBufferInheritanceRenderingInfo rendering{};
  rendering.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_RENDERING_INFO;
  rendering.colorAttachmentCount = 1;
  rendering.pColorAttachmentFormats = &kUint;
  rendering.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
  VkCommandBufferInheritanceInfo inheritance{};
  inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
  inheritance.pNext = &rendering;
  inheritance.occlusionQueryEnable = VK_TRUE;
  inheritance.queryFlags = VK_QUERY_CONTROL_PRECISE_BIT;
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, VK_COMMAND_BUFFER_USAGE_RENDER_PASS_CONTINUE_BIT, &inheritance};
  check(vkBeginCommandBuffer(secondary, &begin), "vkBeginCommandBuffer");
  wholeTarget(secondary, {5, 3});
  vkCmdBindPipeline(secondary, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
  drawWhole(secondary, layout);
  drawWhole(secondary, layout);
  check(vkEndCommandBuffer(secondary), "vkEndCommandBuffer");
  device().run([&](VkCommandBuffer c) {
    vkCmdResetQueryPool(c, queries, 0, 1);
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR)};
    VkRenderingInfo info = renderingInfo(kSize, colors);
    info.flags = VK_RENDERING_CONTENTS_SECONDARY_COMMAND_BUFFERS_BIT;
    vkCmdBeginQuery(c, queries, 0, VK_QUERY_CONTROL_PRECISE_BIT);
    vkCmdBeginRendering(c, &info);
    vkCmdExecuteCommands(c, 1, &secondary);
    vkCmdEndRendering(c);
    vkCmdEndQuery(c, queries, 0);
    fullBarrier(c);
  });
  uint64_t samples = 0;
  check(vkGetQueryPoolResults(handle(), queries, 0, 1, 8, &samples, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT), "vkGetQueryPoolResults");
  EXPECT_EQ(samples, 30u);
}

TEST_P(RenderingFeatures, SuspendedRenderingGoesOnInTheNextCommandBuffer) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.fragment = kGivenFragment;
  spec.colors = {kUint};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  device().run([&](VkCommandBuffer commands) {
    VkClearValue clear{};
    clear.color.uint32[0] = 3;
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    for (uint32_t part = 0; part < 2; part++) {
      VkRenderingInfo info = renderingInfo(kSize, colors);
      info.flags = part ? VK_RENDERING_RESUMING_BIT : VK_RENDERING_SUSPENDING_BIT;
      vkCmdBeginRendering(commands, &info);
      wholeTarget(commands, {part ? 2u : 4u, 8});
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
      drawWhole(commands, layout, part ? 20 : 10);
      vkCmdEndRendering(commands);
    }
    fullBarrier(commands);
  });
  Words p = pixels(image);
  EXPECT_EQ(at(p, 1, 1, 0), 20u);
  EXPECT_EQ(at(p, 3, 1, 0), 10u);
  EXPECT_EQ(at(p, 6, 1, 0), 3u);
}

// A timestamp of the bottom of the pipe inside a pass comes after the draws before it, whenever they run.
TEST_P(RenderingFeatures, TimestampsInAPassWaitForItsDraws) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.colors = {kUint};
  spec.fragment = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) out uvec4 color;
void main() {
  float x = gl_FragCoord.x;
  for (int i = 0; i < 200000; i++) x = sin(x + given.x);
  color = uvec4(x * 9);
})";
  VkPipeline slow = makeGraphics(*work, layout, spec);
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_TIMESTAMP, 3, 0};
  VkQueryPool queries = work->make(queryInfo);
  device().run([&](VkCommandBuffer c) {
    vkCmdResetQueryPool(c, queries, 0, 3);
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 0);
    std::vector<VkRenderingAttachmentInfo> attachments{rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, {})};
    pass(c, renderingInfo(kSize, attachments), slow, [&] {
      drawWhole(c, layout, 1);
      vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 1);
    });
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 2);
  });
  uint64_t t[3]{};
  check(vkGetQueryPoolResults(handle(), queries, 0, 3, sizeof t, t, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT), "vkGetQueryPoolResults");
  EXPECT_LE(t[1], t[2]);
  EXPECT_GT(t[1] - t[0], (t[2] - t[0]) / 2) << "inside " << t[1] - t[0] << ", after the pass " << t[2] - t[0];
}

TEST_P(RenderingFeatures, LoadAndStoreNothing) {
  PUMICE_NEED_FEATURE(device().has(VK_EXT_LOAD_STORE_OP_NONE_EXTENSION_NAME) && device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  device().run([&](VkCommandBuffer c) {
    VkClearColorValue before{};
    before.uint32[0] = 31;
    VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdClearColorImage(c, image.handle, VK_IMAGE_LAYOUT_GENERAL, &before, 1, &all);
    fullBarrier(c);
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_NONE_EXT)};
    colors[0].storeOp = VK_ATTACHMENT_STORE_OP_NONE;
    VkRenderingInfo info = renderingInfo(kSize, colors);
    vkCmdBeginRendering(c, &info);
    vkCmdEndRendering(c);
    fullBarrier(c);
  });
  EXPECT_EQ(at(pixels(image), 3, 3, 0), 31u);
}

PUMICE_ON_BOTH_DEVICES(RenderingFeatures);

}  // namespace
}  // namespace pumice::cts
