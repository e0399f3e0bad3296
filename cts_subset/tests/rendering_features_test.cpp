// What 1.1 to 1.3 and extensions brought to drawing, end to end: each test draws and reads back what must be there.
#include "cts_subset/tests/graphics.h"

#include <bit>

namespace pumice::cts {
namespace {

class RenderingFeatures : public DrawTest {};

const char* const kViewVertex = R"(#version 460
#extension GL_EXT_multiview : require
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) flat out uint view;
void main() {
  gl_Position = vec4(vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1, given.w, 1);
  view = gl_ViewIndex;
}
)";
const char* const kViewFragment = R"(#version 460
#extension GL_EXT_multiview : require
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) flat in uint view;
layout(location = 0) out uvec4 color;
void main() { color = uvec4(gl_ViewIndex + 1, uint(gl_FragCoord.x), uint(given.x), view); }
)";

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

// Two subpasses, the second reads what the first one wrote into the same view; an imageless framebuffer.
TEST_P(RenderingFeatures, MultiviewRenderPass2WithInputAttachmentAndImagelessFramebuffer) {
  PUMICE_NEED_FEATURE(device().vulkan11.multiview && device().vulkan12.imagelessFramebuffer);
  if (GetParam() == Role::kPeer) GTEST_SKIP() << "lavapipe 22.3 leaves out these draws in all views but the first";
  Image first = target(kUint, 2, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT), second = target(kUint, 2);
  VkImageView views[2] = {work->view(first), work->view(second)};
  VkAttachmentDescription2 attachments[2]{};
  for (auto& a : attachments) {
    a.sType = VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_2;
    a.format = kUint;
    a.samples = VK_SAMPLE_COUNT_1_BIT;
    a.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    a.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    a.initialLayout = a.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
  }
  VkAttachmentReference2 references[2]{};
  for (uint32_t i = 0; i < 2; i++) references[i] = {VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2, nullptr, i, VK_IMAGE_LAYOUT_GENERAL, VK_IMAGE_ASPECT_COLOR_BIT};
  VkSubpassDescription2 subpasses[2]{};
  for (uint32_t i = 0; i < 2; i++) {
    subpasses[i].sType = VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_2;
    subpasses[i].viewMask = 0b11;
    subpasses[i].colorAttachmentCount = 1;
    subpasses[i].pColorAttachments = &references[i];
  }
  subpasses[1].inputAttachmentCount = 1;
  subpasses[1].pInputAttachments = &references[0];
  VkSubpassDependency2 dependency{};
  dependency.sType = VK_STRUCTURE_TYPE_SUBPASS_DEPENDENCY_2;
  dependency.dstSubpass = 1;
  dependency.srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  dependency.dstStageMask = VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT;
  dependency.srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  dependency.dstAccessMask = VK_ACCESS_INPUT_ATTACHMENT_READ_BIT;
  dependency.dependencyFlags = VK_DEPENDENCY_BY_REGION_BIT | VK_DEPENDENCY_VIEW_LOCAL_BIT;
  VkRenderPassCreateInfo2 passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO_2;
  passInfo.attachmentCount = 2;
  passInfo.pAttachments = attachments;
  passInfo.subpassCount = 2;
  passInfo.pSubpasses = subpasses;
  passInfo.dependencyCount = 1;
  passInfo.pDependencies = &dependency;
  VkRenderPass pass = work->make(passInfo);

  VkFramebufferAttachmentImageInfo imageInfos[2]{};
  for (uint32_t i = 0; i < 2; i++) {
    imageInfos[i].sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_ATTACHMENT_IMAGE_INFO;
    imageInfos[i].usage = (i ? second : first).spec.usage;
    imageInfos[i].width = kSize.width, imageInfos[i].height = kSize.height, imageInfos[i].layerCount = 2;
    imageInfos[i].viewFormatCount = 1;
    imageInfos[i].pViewFormats = &kUint;
  }
  VkFramebufferAttachmentsCreateInfo attachmentsInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_ATTACHMENTS_CREATE_INFO, nullptr, 2, imageInfos};
  VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, &attachmentsInfo, VK_FRAMEBUFFER_CREATE_IMAGELESS_BIT, pass, 2, nullptr,
                                          kSize.width, kSize.height, 1};
  VkFramebuffer framebuffer = work->make(framebufferInfo);

  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.vertex = kViewVertex;
  spec.fragment = kViewFragment;
  spec.pass = pass;
  spec.colorCount = 1;
  VkPipeline draw = makeGraphics(*work, layout, spec);
  VkDescriptorSetLayout setLayout = makeSetLayout(*work, {{0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr}});
  VkPipelineLayout readLayout = makePipelineLayout(*work, {setLayout}, 16, kGraphics);
  spec.subpass = 1;
  spec.vertex = kWholeTarget;
  spec.fragment = R"(#version 460
#extension GL_EXT_multiview : require
layout(input_attachment_index = 0, binding = 0) uniform usubpassInput before;
layout(location = 0) out uvec4 color;
void main() { uvec4 b = subpassLoad(before); color = uvec4(b.x * 100 + gl_ViewIndex, b.yzw); }
)";
  VkPipeline read = makeGraphics(*work, readLayout, spec);
  VkDescriptorSet set = makeSet(*work, makePool(*work, {{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 1}}), setLayout);
  VkDescriptorImageInfo imageInfo{VK_NULL_HANDLE, views[0], VK_IMAGE_LAYOUT_GENERAL};
  VkWriteDescriptorSet write = writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, nullptr);
  write.pImageInfo = &imageInfo;
  vkUpdateDescriptorSets(handle(), 1, &write, 0, nullptr);
  device().run([&](VkCommandBuffer commands) {
    VkClearValue clears[2]{};
    VkRenderPassAttachmentBeginInfo bound{VK_STRUCTURE_TYPE_RENDER_PASS_ATTACHMENT_BEGIN_INFO, nullptr, 2, views};
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, &bound, pass, framebuffer, {{0, 0}, kSize}, 2, clears};
    VkSubpassBeginInfo subpassBegin{VK_STRUCTURE_TYPE_SUBPASS_BEGIN_INFO, nullptr, VK_SUBPASS_CONTENTS_INLINE};
    VkSubpassEndInfo subpassEnd{VK_STRUCTURE_TYPE_SUBPASS_END_INFO, nullptr};
    vkCmdBeginRenderPass2(commands, &begin, &subpassBegin);
    wholeTarget(commands, kSize);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw);
    drawWhole(commands, layout, 5);
    vkCmdNextSubpass2(commands, &subpassBegin, &subpassEnd);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, read);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, readLayout, 0, 1, &set, 0, nullptr);
    drawWhole(commands, readLayout, 6);
    vkCmdEndRenderPass2(commands, &subpassEnd);
    fullBarrier(commands);
  });
  for (uint32_t layer = 0; layer < 2; layer++) {
    Words p = pixels(second, layer);
    EXPECT_EQ(at(p, 3, 4, 0), (layer + 1) * 100 + layer) << "layer " << layer;
    EXPECT_EQ(at(p, 3, 4, 1), 3u);
    EXPECT_EQ(at(p, 3, 4, 2), 5u);
  }
}

// The depth attachment is read by the very fragments that then write it: what they read must be from before.
TEST_P(RenderingFeatures, InputAttachmentThatIsTheDepthAttachment) {
  constexpr VkFormat kDepth = VK_FORMAT_D32_SFLOAT;
  Image color = target(kUint), depth = target(kDepth, 1, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT);
  VkImageView views[2] = {work->view(color), work->view(depth)};
  VkAttachmentDescription attachments[2]{};
  for (auto& a : attachments) {
    a.format = kUint;
    a.samples = VK_SAMPLE_COUNT_1_BIT;
    a.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    a.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    a.initialLayout = a.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
  }
  attachments[1].format = kDepth;
  VkAttachmentReference references[2] = {{0, VK_IMAGE_LAYOUT_GENERAL}, {1, VK_IMAGE_LAYOUT_GENERAL}};
  VkSubpassDescription subpass{};
  subpass.colorAttachmentCount = subpass.inputAttachmentCount = 1;
  subpass.pColorAttachments = &references[0];
  subpass.pInputAttachments = subpass.pDepthStencilAttachment = &references[1];
  VkSubpassDependency itself{};
  itself.srcStageMask = VK_PIPELINE_STAGE_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT;
  itself.dstStageMask = VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT;
  itself.srcAccessMask = VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
  itself.dstAccessMask = VK_ACCESS_INPUT_ATTACHMENT_READ_BIT;
  itself.dependencyFlags = VK_DEPENDENCY_BY_REGION_BIT;
  VkRenderPassCreateInfo passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  passInfo.attachmentCount = 2;
  passInfo.pAttachments = attachments;
  passInfo.subpassCount = 1;
  passInfo.pSubpasses = &subpass;
  passInfo.dependencyCount = 1;
  passInfo.pDependencies = &itself;
  VkRenderPass renderPass = work->make(passInfo);
  VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, renderPass, 2, views, kSize.width, kSize.height, 1};
  VkFramebuffer framebuffer = work->make(framebufferInfo);

  VkDescriptorSetLayout setLayout = makeSetLayout(*work, {{0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr}});
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 16, kGraphics);
  GraphicsSpec spec;
  spec.vertex = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
void main() { gl_Position = vec4(vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1, given.z, 1); }
)";
  spec.fragment = R"(#version 460
layout(input_attachment_index = 0, binding = 0) uniform subpassInput before;
layout(location = 0) out uvec4 color;
void main() { color = uvec4(floatBitsToUint(subpassLoad(before).x), floatBitsToUint(gl_FragCoord.z), 7, 8); }
)";
  spec.pass = renderPass;
  spec.colorCount = 1;
  spec.depthTest = true;
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  VkDescriptorSet set = makeSet(*work, makePool(*work, {{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 1}}), setLayout);
  VkDescriptorImageInfo imageInfo{VK_NULL_HANDLE, views[1], VK_IMAGE_LAYOUT_GENERAL};
  VkWriteDescriptorSet write = writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, nullptr);
  write.pImageInfo = &imageInfo;
  vkUpdateDescriptorSets(handle(), 1, &write, 0, nullptr);
  device().run([&](VkCommandBuffer commands) {
    VkClearValue clears[2]{};
    clears[1].depthStencil = {0.875f, 0};
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, renderPass, framebuffer, {{0, 0}, kSize}, 2, clears};
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    wholeTarget(commands, kSize);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set, 0, nullptr);
    for (float z : {0.5f, 0.25f, 0.75f}) {  // the last is behind and writes nothing
      push(commands, layout, 0, 0, z, 0);
      vkCmdDraw(commands, 3, 1, 0, 0);
      VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, itself.srcAccessMask, itself.dstAccessMask};
      vkCmdPipelineBarrier(commands, itself.srcStageMask, itself.dstStageMask, VK_DEPENDENCY_BY_REGION_BIT, 1, &barrier, 0, nullptr, 0, nullptr);
    }
    vkCmdEndRenderPass(commands);
    fullBarrier(commands);
  });
  Words p = pixels(color);
  EXPECT_EQ(std::bit_cast<float>(at(p, 3, 4, 0)), 0.5f) << "what the fragment read";
  EXPECT_EQ(std::bit_cast<float>(at(p, 3, 4, 1)), 0.25f) << "where it lay";
  EXPECT_EQ(valuesOf<float>(wordsOf(download(*work, depth, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)))[0], 0.25f);
}

// An edge through the middle of pixel 3: two of its four samples lie to the left.
TEST_P(RenderingFeatures, DepthStencilResolve) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  PUMICE_NEED_FEATURE(device().properties.limits.framebufferDepthSampleCounts & VK_SAMPLE_COUNT_4_BIT);
  VkPhysicalDeviceVulkan12Properties v12{};
  v12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES;
  VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &v12, {}};
  vkGetPhysicalDeviceProperties2(device().physical, &p2);
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
        VkClearDepthStencilValue before{0.75f, 77};
        VkImageSubresourceRange range{VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT, 0, 1, 0, 1};
        vkCmdClearDepthStencilImage(commands, one.handle, VK_IMAGE_LAYOUT_GENERAL, &before, 1, &range);
        fullBarrier(commands);
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
      Bytes stencil = download(*work, one, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
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

// The load operation of a resolve attachment shows in an aspect that is not resolved.
TEST_P(RenderingFeatures, AnAspectThatIsNotResolvedIsCleared) {
  PUMICE_NEED_FEATURE(device().properties.limits.framebufferDepthSampleCounts & VK_SAMPLE_COUNT_4_BIT);
  VkPhysicalDeviceVulkan12Properties v12{};
  v12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES;
  VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &v12, {}};
  vkGetPhysicalDeviceProperties2(device().physical, &p2);
  PUMICE_NEED_FEATURE(v12.independentResolveNone);
  struct Case {
    VkResolveModeFlagBits depth, stencil;
    VkAttachmentLoadOp load;
  };
  constexpr VkFormat kFormat = VK_FORMAT_D32_SFLOAT_S8_UINT;
  constexpr VkImageAspectFlags kAspects = VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT;
  constexpr VkResolveModeFlagBits kNone = VK_RESOLVE_MODE_NONE, kZero = VK_RESOLVE_MODE_SAMPLE_ZERO_BIT;
  for (const Case& c : {Case{kNone, kZero, VK_ATTACHMENT_LOAD_OP_CLEAR}, Case{kZero, kNone, VK_ATTACHMENT_LOAD_OP_CLEAR}, Case{kNone, kZero, VK_ATTACHMENT_LOAD_OP_LOAD}}) {
    SCOPED_TRACE(testing::Message() << "modes " << c.depth << " and " << c.stencil << " load " << c.load);
    Image many = target(kFormat, 1, VK_SAMPLE_COUNT_4_BIT), one = target(kFormat);
    VkImageView views[2] = {work->view(many), work->view(one)};
    VkAttachmentDescription2 attachments[2]{};
    VkAttachmentReference2 references[2]{};
    for (uint32_t i = 0; i < 2; ++i) {
      VkAttachmentDescription2& a = attachments[i];
      a.sType = VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_2;
      a.format = kFormat;
      a.samples = i ? VK_SAMPLE_COUNT_1_BIT : VK_SAMPLE_COUNT_4_BIT;
      a.loadOp = a.stencilLoadOp = i ? c.load : VK_ATTACHMENT_LOAD_OP_CLEAR;
      a.storeOp = a.stencilStoreOp = VK_ATTACHMENT_STORE_OP_STORE;
      a.initialLayout = a.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
      references[i] = {VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2, nullptr, i, VK_IMAGE_LAYOUT_GENERAL, kAspects};
    }
    VkSubpassDescriptionDepthStencilResolve resolve{VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_DEPTH_STENCIL_RESOLVE, nullptr, c.depth, c.stencil, &references[1]};
    VkSubpassDescription2 subpass{};
    subpass.sType = VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_2;
    subpass.pNext = &resolve;
    subpass.pDepthStencilAttachment = &references[0];
    VkRenderPassCreateInfo2 passInfo{};
    passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO_2;
    passInfo.attachmentCount = 2;
    passInfo.pAttachments = attachments;
    passInfo.subpassCount = 1;
    passInfo.pSubpasses = &subpass;
    VkRenderPass renderPass = work->make(passInfo);
    VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, renderPass, 2, views, kSize.width, kSize.height, 1};
    VkFramebuffer framebuffer = work->make(framebufferInfo);
    device().run([&](VkCommandBuffer commands) {
      VkClearDepthStencilValue before{0.75f, 77};
      VkImageSubresourceRange range{kAspects, 0, 1, 0, 1};
      vkCmdClearDepthStencilImage(commands, one.handle, VK_IMAGE_LAYOUT_GENERAL, &before, 1, &range);
      fullBarrier(commands);
      VkClearValue clears[2]{};
      clears[0].depthStencil = {0.5f, 2};
      clears[1].depthStencil = {0.25f, 9};
      VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, renderPass, framebuffer, {{0, 0}, {4, kSize.height}}, 2, clears};
      vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
      vkCmdEndRenderPass(commands);
      fullBarrier(commands);
    });
    const bool clears = c.load == VK_ATTACHMENT_LOAD_OP_CLEAR;
    std::vector<float> depth = valuesOf<float>(wordsOf(download(*work, one, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
    EXPECT_EQ(depth[1], c.depth ? 0.5f : clears ? 0.25f : 0.75f);
    EXPECT_EQ(depth[5], 0.75f) << "outside the render area";
    Bytes stencil = download(*work, one, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
    EXPECT_EQ(uint32_t(stencil[1]), c.stencil ? 2u : clears ? 9u : 77u);
    EXPECT_EQ(uint32_t(stencil[5]), 77u) << "outside the render area";
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
    VkClearDepthStencilValue before{0.75f, 77};
    VkImageSubresourceRange range{VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT, 0, 1, 0, 1};
    vkCmdClearDepthStencilImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &before, 1, &range);
    fullBarrier(commands);
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
  std::vector<float> depth = valuesOf<float>(wordsOf(download(*work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
  Bytes stencil = download(*work, image, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
  for (uint32_t y : {1u, 6u})
    for (uint32_t x : {1u, 6u}) {
      EXPECT_EQ(depth[y * 8 + x], x < 4 ? 0.5f : 0.9f) << x << " " << y;
      EXPECT_EQ(stencil[y * 8 + x], y < 4 ? 33 : 77) << x << " " << y;
    }
}

// Depth that is only tested and sampled, beside stencil that is written: layouts, transitions and references of one aspect each.
TEST_P(RenderingFeatures, SeparateDepthAndStencilLayouts) {
  PUMICE_NEED_FEATURE(device().vulkan12.separateDepthStencilLayouts);
  constexpr VkFormat kFormat = VK_FORMAT_D32_SFLOAT_S8_UINT;
  PUMICE_NEED_FEATURE(device().supports(kFormat, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT));
  Image image = target(kFormat, 1, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_USAGE_SAMPLED_BIT), color = target(kUint);
  VkImageView views[2] = {work->view(color), work->view(image)}, depthView = work->view(image, VK_IMAGE_ASPECT_DEPTH_BIT);

  VkAttachmentDescriptionStencilLayout stencilLayouts{VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_STENCIL_LAYOUT, nullptr, VK_IMAGE_LAYOUT_STENCIL_ATTACHMENT_OPTIMAL,
                                                      VK_IMAGE_LAYOUT_GENERAL};
  VkAttachmentDescription2 attachments[2]{};
  for (auto& a : attachments) {
    a.sType = VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_2;
    a.format = kUint;
    a.samples = VK_SAMPLE_COUNT_1_BIT;
    a.loadOp = a.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    a.storeOp = a.stencilStoreOp = VK_ATTACHMENT_STORE_OP_STORE;
    a.initialLayout = a.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
  }
  attachments[1].format = kFormat;
  attachments[1].pNext = &stencilLayouts;
  attachments[1].initialLayout = VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL;
  VkAttachmentReferenceStencilLayout stencilReference{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_STENCIL_LAYOUT, nullptr, VK_IMAGE_LAYOUT_STENCIL_ATTACHMENT_OPTIMAL};
  VkAttachmentReference2 colorReference{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2, nullptr, 0, VK_IMAGE_LAYOUT_GENERAL, VK_IMAGE_ASPECT_COLOR_BIT};
  VkAttachmentReference2 depthReference{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2, &stencilReference, 1, VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL,
                                        VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT};
  VkSubpassDescription2 subpass{};
  subpass.sType = VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_2;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &colorReference;
  subpass.pDepthStencilAttachment = &depthReference;
  VkRenderPassCreateInfo2 passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO_2;
  passInfo.attachmentCount = 2;
  passInfo.pAttachments = attachments;
  passInfo.subpassCount = 1;
  passInfo.pSubpasses = &subpass;
  VkRenderPass renderPass = work->make(passInfo);
  VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, renderPass, 2, views, kSize.width, kSize.height, 1};
  VkFramebuffer framebuffer = work->make(framebufferInfo);

  VkDescriptorSetLayout setLayout = makeSetLayout(*work, {{0, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr}});
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 16, kGraphics);
  VkDescriptorSet set = makeSet(*work, makePool(*work, {{VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, 1}}), setLayout);
  VkDescriptorImageInfo imageInfo{VK_NULL_HANDLE, depthView, VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL};
  VkWriteDescriptorSet write = writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, nullptr);
  write.pImageInfo = &imageInfo;
  vkUpdateDescriptorSets(handle(), 1, &write, 0, nullptr);
  GraphicsSpec spec;
  spec.pass = renderPass;
  spec.colorCount = 1;
  spec.depthTest = spec.stencilTest = true;
  spec.depthWrite = false;
  spec.stencilReference = 9;
  spec.fragment = R"(#version 460
#extension GL_EXT_samplerless_texture_functions : require
layout(push_constant) uniform P { vec4 given; };
layout(binding = 0) uniform texture2D depth;
layout(location = 0) out uvec4 color;
void main() { color = uvec4(texelFetch(depth, ivec2(gl_FragCoord.xy), 0).x * 100, given.x, 0, 0); }
)";
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  device().run([&](VkCommandBuffer c) {
    VkClearDepthStencilValue before{0.75f, 3};
    VkClearColorValue black{};
    VkImageSubresourceRange both{VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT, 0, 1, 0, 1}, all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdClearDepthStencilImage(c, image.handle, VK_IMAGE_LAYOUT_GENERAL, &before, 1, &both);
    vkCmdClearColorImage(c, color.handle, VK_IMAGE_LAYOUT_GENERAL, &black, 1, &all);
    VkImageMemoryBarrier barriers[2]{};
    for (auto& b : barriers) {
      b.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
      b.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
      b.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
      b.oldLayout = VK_IMAGE_LAYOUT_GENERAL;
      b.srcQueueFamilyIndex = b.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
      b.image = image.handle;
      b.subresourceRange = both;
    }
    barriers[0].newLayout = VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL;
    barriers[0].subresourceRange.aspectMask = VK_IMAGE_ASPECT_DEPTH_BIT;
    barriers[1].newLayout = VK_IMAGE_LAYOUT_STENCIL_ATTACHMENT_OPTIMAL;
    barriers[1].subresourceRange.aspectMask = VK_IMAGE_ASPECT_STENCIL_BIT;
    vkCmdPipelineBarrier(c, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0, nullptr, 0, nullptr, 2, barriers);
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, renderPass, framebuffer, {{0, 0}, kSize}, 0, nullptr};
    vkCmdBeginRenderPass(c, &begin, VK_SUBPASS_CONTENTS_INLINE);
    wholeTarget(c, {4, 8});
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set, 0, nullptr);
    drawWhole(c, layout, 1, 0.5f);   // passes, on the left
    wholeTarget(c, kSize);
    drawWhole(c, layout, 2, 0.9f);   // behind: nothing
    vkCmdEndRenderPass(c);
    fullBarrier(c);
  });
  Words p = pixels(color);
  std::vector<float> depth = valuesOf<float>(wordsOf(download(*work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
  Bytes stencil = download(*work, image, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
  for (uint32_t x : {1u, 6u}) {
    SCOPED_TRACE(testing::Message() << "column " << x);
    EXPECT_EQ(at(p, x, 2, 0), x < 4 ? 75u : 0u);
    EXPECT_EQ(at(p, x, 2, 1), x < 4 ? 1u : 0u);
    EXPECT_EQ(stencil[2 * 8 + x], x < 4 ? 9 : 3);
    EXPECT_EQ(depth[2 * 8 + x], 0.75f);
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
  spec.fragment = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) out uvec4 color;
void main() { color = uvec4(given); }
)";
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

TEST_P(RenderingFeatures, ExtendedDynamicState) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  Image image = target(kUint), depthImage = target(VK_FORMAT_D32_SFLOAT);
  VkImageView view = work->view(image), depthView = work->view(depthImage);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.vertex = R"(#version 460
layout(location = 0) in vec2 position;
layout(push_constant) uniform P { vec4 given; };
void main() { gl_Position = vec4(position, given.w, 1); }
)";
  spec.fragment = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) out uvec4 color;
void main() { color = uvec4(given); }
)";
  spec.colors = {kUint};
  spec.depth = VK_FORMAT_D32_SFLOAT;
  spec.bindings = {{0, 0, VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32G32_SFLOAT, 0}};
  spec.dynamic = {VK_DYNAMIC_STATE_CULL_MODE, VK_DYNAMIC_STATE_FRONT_FACE, VK_DYNAMIC_STATE_PRIMITIVE_TOPOLOGY, VK_DYNAMIC_STATE_VERTEX_INPUT_BINDING_STRIDE,
                  VK_DYNAMIC_STATE_DEPTH_TEST_ENABLE, VK_DYNAMIC_STATE_DEPTH_WRITE_ENABLE, VK_DYNAMIC_STATE_DEPTH_COMPARE_OP, VK_DYNAMIC_STATE_DEPTH_BOUNDS_TEST_ENABLE,
                  VK_DYNAMIC_STATE_STENCIL_TEST_ENABLE, VK_DYNAMIC_STATE_STENCIL_OP, VK_DYNAMIC_STATE_RASTERIZER_DISCARD_ENABLE, VK_DYNAMIC_STATE_DEPTH_BIAS_ENABLE,
                  VK_DYNAMIC_STATE_PRIMITIVE_RESTART_ENABLE, VK_DYNAMIC_STATE_VIEWPORT_WITH_COUNT, VK_DYNAMIC_STATE_SCISSOR_WITH_COUNT};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  // Each vertex is followed by one that a wrong stride would take.
  const float corners[] = {-1, -1, 9, 9, 3, -1, 9, 9, -1, 3, 9, 9};
  Buffer vertices = work->buffer(sizeof corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT, corners);
  device().run([&](VkCommandBuffer c) {
    VkClearValue clear{}, far{};
    far.depthStencil.depth = 1;
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    VkRenderingAttachmentInfo depth = rendered(depthView, VK_ATTACHMENT_LOAD_OP_CLEAR, far);
    VkRenderingInfo info = renderingInfo(kSize, colors);
    info.pDepthAttachment = &depth;
    vkCmdBeginRendering(c, &info);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    VkViewport viewport{0, 0, 8, 8, 0, 1};
    vkCmdSetViewportWithCount(c, 1, &viewport);
    VkDeviceSize offset = 0, size = sizeof corners, stride = 16;
    vkCmdBindVertexBuffers2(c, 0, 1, &vertices.handle, &offset, &size, &stride);
    vkCmdSetCullMode(c, VK_CULL_MODE_NONE);
    vkCmdSetFrontFace(c, VK_FRONT_FACE_CLOCKWISE);
    vkCmdSetPrimitiveTopology(c, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST);
    vkCmdSetDepthTestEnable(c, VK_TRUE);
    vkCmdSetDepthWriteEnable(c, VK_TRUE);
    vkCmdSetDepthCompareOp(c, VK_COMPARE_OP_LESS);
    vkCmdSetDepthBoundsTestEnable(c, VK_FALSE);
    vkCmdSetStencilTestEnable(c, VK_FALSE);
    vkCmdSetStencilOp(c, VK_STENCIL_FACE_FRONT_AND_BACK, VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_ALWAYS);
    vkCmdSetRasterizerDiscardEnable(c, VK_FALSE);
    vkCmdSetDepthBiasEnable(c, VK_FALSE);
    vkCmdSetPrimitiveRestartEnable(c, VK_FALSE);
    // Column n is drawn by step n.
    uint32_t column = 0;
    auto step = [&](float value, float z, const std::function<void()>& change) {
      VkRect2D scissor{{int32_t(column++), 0}, {1, 8}};
      vkCmdSetScissorWithCount(c, 1, &scissor);
      drawWhole(c, layout, 1);
      change();
      drawWhole(c, layout, value, z);
    };
    step(2, 0.4f, [] {});                                                                // nearer: 2
    step(3, 0.6f, [] {});                                                                // farther: 1
    step(4, 0.6f, [&] { vkCmdSetDepthTestEnable(c, VK_FALSE); });                        // no test: 4
    vkCmdSetDepthTestEnable(c, VK_TRUE);
    step(5, 0.6f, [&] { vkCmdSetDepthCompareOp(c, VK_COMPARE_OP_GREATER); });            // 5
    vkCmdSetDepthCompareOp(c, VK_COMPARE_OP_LESS);
    step(6, 0.4f, [&] { vkCmdSetCullMode(c, VK_CULL_MODE_FRONT_BIT); });                 // clockwise is front: culled, 1
    step(7, 0.4f, [&] { vkCmdSetFrontFace(c, VK_FRONT_FACE_COUNTER_CLOCKWISE); });       // no longer: 7 (the first draw too)
    vkCmdSetCullMode(c, VK_CULL_MODE_NONE);
    step(8, 0.4f, [&] { vkCmdSetRasterizerDiscardEnable(c, VK_TRUE); });                 // 1
    vkCmdSetRasterizerDiscardEnable(c, VK_FALSE);
    step(9, 0.4f, [&] { vkCmdSetPrimitiveTopology(c, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP); });   // 9
    vkCmdEndRendering(c);
    fullBarrier(c);
  });
  Words p = pixels(image);
  const uint32_t expected[8] = {2, 1, 4, 5, 1, 7, 1, 9};
  for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(at(p, x, 3, 0), expected[x]) << "column " << x;
}

TEST_P(RenderingFeatures, DrawParametersAndIndirectCount) {
  PUMICE_NEED_FEATURE(device().vulkan11.shaderDrawParameters && device().vulkan12.drawIndirectCount && device().features.multiDrawIndirect &&
                      device().features.drawIndirectFirstInstance && device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
  spec.vertex = R"(#version 460
layout(location = 0) flat out uvec4 passed;
void main() {
  passed = uvec4(gl_BaseVertex, gl_BaseInstance, gl_DrawID, gl_VertexIndex * 100 + gl_InstanceIndex);
  gl_Position = vec4((gl_DrawID + 0.5) / 4.0 - 1.0, 0.125, 0.5, 1);
  gl_PointSize = 1.0;
}
)";
  spec.fragment = R"(#version 460
layout(location = 0) flat in uvec4 passed;
layout(location = 0) out uvec4 color;
void main() { color = passed; }
)";
  spec.colors = {kUint};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  std::vector<VkDrawIndirectCommand> draws;
  for (uint32_t i = 0; i < 8; i++) draws.push_back({1, 1, 10 + i, 3 * i});
  Buffer commandsBuffer = work->bufferOf(draws, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  Buffer count = work->bufferOf(Words{0, 5}, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  drawInto(view, pipeline, [&](VkCommandBuffer c) {
    vkCmdDrawIndirectCount(c, commandsBuffer.handle, 0, count.handle, 4, 8, sizeof(VkDrawIndirectCommand));
  });
  Words p = pixels(image);
  for (uint32_t i = 0; i < 8; i++) {
    SCOPED_TRACE(testing::Message() << "draw " << i);
    bool drawn = i < 5;
    EXPECT_EQ(at(p, i, 4, 0), drawn ? 10 + i : 0);
    EXPECT_EQ(at(p, i, 4, 1), drawn ? 3 * i : 0);
    EXPECT_EQ(at(p, i, 4, 2), drawn ? i : 0);
    EXPECT_EQ(at(p, i, 4, 3), drawn ? (10 + i) * 100 + 3 * i : 0);
  }
}

// Indices of one byte with restarts in a list, several draws of one command, attributes that advance every third instance,
// and an attribute that lies beyond the buffer in part.
TEST_P(RenderingFeatures, IndicesDrawsAndAttributesOfExtensions) {
  PUMICE_NEED_FEATURE(device().indexTypeUint8.indexTypeUint8 && device().listRestart.primitiveTopologyListRestart && device().multiDraw.multiDraw &&
                      device().divisor.vertexAttributeInstanceRateDivisor && device().divisor.vertexAttributeInstanceRateZeroDivisor &&
                      device().robustness2.robustBufferAccess2 && device().vulkan13.dynamicRendering);
  auto drawMulti = reinterpret_cast<PFN_vkCmdDrawMultiEXT>(vkGetDeviceProcAddr(handle(), "vkCmdDrawMultiEXT"));
  auto drawMultiIndexed = reinterpret_cast<PFN_vkCmdDrawMultiIndexedEXT>(vkGetDeviceProcAddr(handle(), "vkCmdDrawMultiIndexedEXT"));
  ASSERT_TRUE(drawMulti && drawMultiIndexed);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
  // A point at column VertexIndex, row InstanceIndex.
  spec.vertex = R"(#version 460
layout(location = 0) in uint slow;
layout(location = 1) in uint never;
layout(location = 2) in uvec3 beyond;
layout(location = 0) flat out uvec4 passed;
void main() {
  passed = uvec4(slow, never, gl_DrawID, beyond.x + beyond.y + beyond.z + 1);
  gl_Position = vec4((gl_VertexIndex + 0.5) / 4.0 - 1.0, (gl_InstanceIndex + 0.5) / 4.0 - 1.0, 0.5, 1);
  gl_PointSize = 1.0;
}
)";
  spec.fragment = R"(#version 460
layout(location = 0) flat in uvec4 passed;
layout(location = 0) out uvec4 color;
void main() { color = passed; }
)";
  spec.colors = {kUint};
  spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_INSTANCE}, {1, 4, VK_VERTEX_INPUT_RATE_INSTANCE}, {2, 12, VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32_UINT, 0}, {1, 1, VK_FORMAT_R32_UINT, 0}, {2, 2, VK_FORMAT_R32G32B32_UINT, 0}};
  const VkVertexInputBindingDivisorDescriptionEXT divisors[2] = {{0, 3}, {1, 0}};
  VkPipelineVertexInputDivisorStateCreateInfoEXT divisorInfo{VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_DIVISOR_STATE_CREATE_INFO_EXT, nullptr, 2, divisors};
  spec.inputNext = &divisorInfo;
  spec.primitiveRestart = true;
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  Buffer slow = work->bufferOf(Words{10, 20, 30, 40, 50, 60, 70, 80}, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  // Two whole vertices, then two of the third one's three words.
  Buffer beyond = work->bufferOf(Words{1, 2, 3, 4, 5, 6, 7, 8}, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  const uint8_t bytes[8] = {0, 0xff, 2, 1, 3, 0xff, 4, 0};
  Buffer indices = work->buffer(sizeof bytes, VK_BUFFER_USAGE_INDEX_BUFFER_BIT, bytes);
  drawInto(view, pipeline, [&](VkCommandBuffer c) {
    VkBuffer buffers[3] = {slow.handle, slow.handle, beyond.handle};
    VkDeviceSize offsets[3]{};
    vkCmdBindVertexBuffers(c, 0, 3, buffers, offsets);
    vkCmdBindIndexBuffer(c, indices.handle, 0, VK_INDEX_TYPE_UINT8_EXT);
    // Rows 1 to 5: vertices 0 and 2 by the first draw, 3 and 4 by the second (with the restarts between them).
    const VkMultiDrawIndexedInfoEXT indexed[2] = {{0, 3, 0}, {4, 3, 0}};
    drawMultiIndexed(c, 2, indexed, 5, 1, sizeof(VkMultiDrawIndexedInfoEXT), nullptr);
    // Row 7: vertices 0 and 5.
    const VkMultiDrawInfoEXT plain[2] = {{0, 1}, {5, 1}};
    drawMulti(c, 2, plain, 1, 7, sizeof(VkMultiDrawInfoEXT));
  });
  Words p = pixels(image);
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << " " << y);
      bool first = y >= 1 && y <= 5 && (x == 0 || x == 2 || x == 3 || x == 4), last = y == 7 && (x == 0 || x == 5);
      EXPECT_EQ(at(p, x, y, 0), first ? 20 + (y - 1) / 3 * 10 : last ? 80u : 0u);
      EXPECT_EQ(at(p, x, y, 1), first ? 20u : last ? 80u : 0u);
      if (GetParam() == Role::kTested || !first) {   // lavapipe 22.3 forgets the draw's number where indices restart
        EXPECT_EQ(at(p, x, y, 2), (first && x >= 3) || (last && x == 5) ? 1u : 0u);
      }
      EXPECT_EQ(at(p, x, y, 3), first || last ? (x == 0 ? 7u : 1u) : 0u);
    }
}

// Subgroups of the other stages: whatever their lanes are, the operations agree with each other.
TEST_P(RenderingFeatures, SubgroupsOfVertexAndFragmentShaders) {
  VkPhysicalDeviceVulkan11Properties v11{};
  v11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES;
  VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &v11, {}};
  vkGetPhysicalDeviceProperties2(device().physical, &p2);
  constexpr VkSubgroupFeatureFlags kNeeded = VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT | VK_SUBGROUP_FEATURE_QUAD_BIT;
  PUMICE_NEED_FEATURE((v11.subgroupSupportedStages & kGraphics) == kGraphics && (v11.subgroupSupportedOperations & kNeeded) == kNeeded &&
                      device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.vertex = R"(#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) flat out uint right;
void main() {
  gl_Position = vec4(vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1, given.w, 1);
  uint lanes = subgroupBallotBitCount(subgroupBallot(true));
  right = subgroupAdd(1u) == lanes && lanes >= 1 && subgroupInclusiveAdd(1u) <= lanes && subgroupBroadcastFirst(5u) == 5u ? 1u : 0u;
}
)";
  spec.fragment = R"(#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_quad : require
layout(location = 0) flat in uint right;
layout(location = 0) out uvec4 color;
void main() {
  uint lanes = subgroupBallotBitCount(subgroupBallot(true)), x = uint(gl_FragCoord.x), y = uint(gl_FragCoord.y);
  bool ok = subgroupAdd(1u) == lanes && subgroupMax(gl_SubgroupInvocationID) < gl_SubgroupSize && lanes >= 4;
  color = uvec4(right, ok ? 1 : 0, subgroupQuadSwapHorizontal(x) * 10 + subgroupQuadSwapVertical(y), gl_SubgroupSize);
}
)";
  spec.colors = {kUint};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  drawInto(view, pipeline, [&](VkCommandBuffer c) { drawWhole(c, layout); });
  Words p = pixels(image);
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << " " << y);
      EXPECT_EQ(at(p, x, y, 0), 1u);
      EXPECT_EQ(at(p, x, y, 1), 1u);
      EXPECT_EQ(at(p, x, y, 2), (x ^ 1) * 10 + (y ^ 1));
      EXPECT_EQ(at(p, x, y, 3), v11.subgroupSize);
    }
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

TEST_P(RenderingFeatures, DemoteAndTerminate) {
  PUMICE_NEED_FEATURE(device().vulkan13.shaderDemoteToHelperInvocation && device().vulkan13.shaderTerminateInvocation && device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.colors = {kUint};
  // A demoted invocation goes on for its neighbours' derivatives.
  const char* fragments[2] = {R"(#version 460
#extension GL_EXT_demote_to_helper_invocation : require
layout(location = 0) out uvec4 color;
void main() {
  uint x = uint(gl_FragCoord.x);
  if ((x & 1) == 1) demote;
  float d = dFdx(gl_FragCoord.x * 3.0);
  color = uvec4(uint(d), helperInvocationEXT() ? 1 : 0, x, 5);
}
)",
                              R"(#version 460
#extension GL_EXT_terminate_invocation : require
layout(location = 0) out uvec4 color;
void main() {
  uint x = uint(gl_FragCoord.x);
  if ((x & 2) == 2) terminateInvocation;
  color = uvec4(8, 0, x, 5);
}
)"};
  for (int i = 0; i < 2; i++) {
    spec.fragment = fragments[i];
    VkPipeline pipeline = makeGraphics(*work, layout, spec);
    drawInto(view, pipeline, [&](VkCommandBuffer c) { drawWhole(c, layout); }, 99);
    Words p = pixels(image);
    for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(at(p, x, 5, 0), (i ? x & 2 : x & 1) ? 99u : i ? 8u : 3u) << x;
    if (!i) {
      EXPECT_EQ(at(p, 2, 5, 1), 0u) << "not a helper";
    }
  }
}

PUMICE_ON_BOTH_DEVICES(RenderingFeatures);

}  // namespace
}  // namespace pumice::cts
