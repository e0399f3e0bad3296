// Render pass objects: subpasses, input attachments, aspects with layouts, loads and resolves of their own.
#include "cts_subset/tests/graphics.h"

#include <bit>

namespace pumice::cts {
namespace {

class SubpassFeatures : public DrawTest {};

// Two subpasses, the second reads what the first one wrote into the same view; an imageless framebuffer.
TEST_P(SubpassFeatures, MultiviewRenderPass2WithInputAttachmentAndImagelessFramebuffer) {
  PUMICE_NEED_FEATURE(device().vulkan11.multiview && device().vulkan12.imagelessFramebuffer);
  if (GetParam() == Role::kPeer) GTEST_SKIP() << "lavapipe 22.3 leaves out these draws in all views but the first";
  Image first = target(kUint, 2, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT), second = target(kUint, 2);
  VkImageView views[2] = {work->view(first), work->view(second)};
  const VkAttachmentReference2 references[2] = {referenceTo(0, VK_IMAGE_ASPECT_COLOR_BIT), referenceTo(1, VK_IMAGE_ASPECT_COLOR_BIT)};
  std::vector<VkSubpassDescription2> subpasses = {subpass(&references[0]), subpass(&references[1])};
  subpasses[0].viewMask = subpasses[1].viewMask = 0b11;
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
  VkRenderPass pass = makePass(*work, {attachmentOf(kUint), attachmentOf(kUint)}, subpasses, {dependency});

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
  DescriptorSet set = work->descriptors({inputBinding(views[0])});
  VkPipelineLayout readLayout = makePipelineLayout(*work, {set.layout}, 16, kGraphics);
  spec.subpass = 1;
  spec.vertex = kWholeTarget;
  spec.fragment = R"(#version 460
#extension GL_EXT_multiview : require
layout(input_attachment_index = 0, binding = 0) uniform usubpassInput before;
layout(location = 0) out uvec4 color;
void main() { uvec4 b = subpassLoad(before); color = uvec4(b.x * 100 + gl_ViewIndex, b.yzw); }
)";
  VkPipeline read = makeGraphics(*work, readLayout, spec);
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
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, readLayout, 0, 1, &set.handle, 0, nullptr);
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
TEST_P(SubpassFeatures, InputAttachmentThatIsTheDepthAttachment) {
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
  VkFramebuffer framebuffer = work->framebufferOf(renderPass, {views[0], views[1]}, kSize);

  DescriptorSet set = work->descriptors({inputBinding(views[1])});
  VkPipelineLayout layout = makePipelineLayout(*work, {set.layout}, 16, kGraphics);
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
  device().run([&](VkCommandBuffer commands) {
    VkClearValue clears[2]{};
    clears[1].depthStencil = {0.875f, 0};
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, renderPass, framebuffer, {{0, 0}, kSize}, 2, clears};
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    wholeTarget(commands, kSize);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set.handle, 0, nullptr);
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
  EXPECT_EQ(depths(depth)[0], 0.25f);
}

// The load operation of a resolve attachment shows in an aspect that is not resolved.
TEST_P(SubpassFeatures, AnAspectThatIsNotResolvedIsCleared) {
  PUMICE_NEED_FEATURE(device().properties.limits.framebufferDepthSampleCounts & VK_SAMPLE_COUNT_4_BIT);
  const auto v12 = properties<VkPhysicalDeviceVulkan12Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES);
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
    std::vector<VkAttachmentDescription2> attachments = {attachmentOf(kFormat, VK_SAMPLE_COUNT_4_BIT), attachmentOf(kFormat)};
    attachments[1].loadOp = attachments[1].stencilLoadOp = c.load;
    const VkAttachmentReference2 references[2] = {referenceTo(0, kAspects), referenceTo(1, kAspects)};
    VkSubpassDescriptionDepthStencilResolve resolve{VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_DEPTH_STENCIL_RESOLVE, nullptr, c.depth, c.stencil, &references[1]};
    VkSubpassDescription2 resolving = subpass(nullptr, &references[0]);
    resolving.pNext = &resolve;
    VkRenderPass renderPass = makePass(*work, attachments, {resolving});
    VkFramebuffer framebuffer = work->framebufferOf(renderPass, {work->view(many), work->view(one)}, kSize);
    device().run([&](VkCommandBuffer commands) {
      clear(commands, one, VkClearDepthStencilValue{0.75f, 77});
      VkClearValue clears[2]{};
      clears[0].depthStencil = {0.5f, 2};
      clears[1].depthStencil = {0.25f, 9};
      VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, renderPass, framebuffer, {{0, 0}, {4, kSize.height}}, 2, clears};
      vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
      vkCmdEndRenderPass(commands);
      fullBarrier(commands);
    });
    const bool clears = c.load == VK_ATTACHMENT_LOAD_OP_CLEAR;
    std::vector<float> depth = depths(one);
    EXPECT_EQ(depth[1], c.depth ? 0.5f : clears ? 0.25f : 0.75f);
    EXPECT_EQ(depth[5], 0.75f) << "outside the render area";
    Bytes stencil = stencils(one);
    EXPECT_EQ(uint32_t(stencil[1]), c.stencil ? 2u : clears ? 9u : 77u);
    EXPECT_EQ(uint32_t(stencil[5]), 77u) << "outside the render area";
  }
}

// Depth that is only tested and sampled, beside stencil that is written: layouts, transitions and references of one aspect each.
TEST_P(SubpassFeatures, SeparateDepthAndStencilLayouts) {
  PUMICE_NEED_FEATURE(device().vulkan12.separateDepthStencilLayouts);
  constexpr VkFormat kFormat = VK_FORMAT_D32_SFLOAT_S8_UINT;
  PUMICE_NEED_FEATURE(device().supports(kFormat, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT));
  Image image = target(kFormat, 1, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_USAGE_SAMPLED_BIT), color = target(kUint);

  VkAttachmentDescriptionStencilLayout stencilLayouts{VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_STENCIL_LAYOUT, nullptr, VK_IMAGE_LAYOUT_STENCIL_ATTACHMENT_OPTIMAL,
                                                      VK_IMAGE_LAYOUT_GENERAL};
  std::vector<VkAttachmentDescription2> attachments = {attachmentOf(kUint), attachmentOf(kFormat)};
  for (auto& a : attachments) a.loadOp = a.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  attachments[1].pNext = &stencilLayouts;
  attachments[1].initialLayout = VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL;
  VkAttachmentReferenceStencilLayout stencilReference{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_STENCIL_LAYOUT, nullptr, VK_IMAGE_LAYOUT_STENCIL_ATTACHMENT_OPTIMAL};
  const VkAttachmentReference2 colorReference = referenceTo(0, VK_IMAGE_ASPECT_COLOR_BIT);
  VkAttachmentReference2 depthReference = referenceTo(1, VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT);
  depthReference.pNext = &stencilReference;
  depthReference.layout = VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL;
  VkRenderPass renderPass = makePass(*work, attachments, {subpass(&colorReference, &depthReference)});
  VkFramebuffer framebuffer = work->framebufferOf(renderPass, {work->view(color), work->view(image)}, kSize);

  Binding depthOnly{VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE};
  depthOnly.image = {VK_NULL_HANDLE, work->view(image, VK_IMAGE_ASPECT_DEPTH_BIT), VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL};
  DescriptorSet set = work->descriptors({depthOnly});
  VkPipelineLayout layout = makePipelineLayout(*work, {set.layout}, 16, kGraphics);
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
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set.handle, 0, nullptr);
    drawWhole(c, layout, 1, 0.5f);   // passes, on the left
    wholeTarget(c, kSize);
    drawWhole(c, layout, 2, 0.9f);   // behind: nothing
    vkCmdEndRenderPass(c);
    fullBarrier(c);
  });
  Words p = pixels(color);
  std::vector<float> depth = depths(image);
  Bytes stencil = stencils(image);
  for (uint32_t x : {1u, 6u}) {
    SCOPED_TRACE(testing::Message() << "column " << x);
    EXPECT_EQ(at(p, x, 2, 0), x < 4 ? 75u : 0u);
    EXPECT_EQ(at(p, x, 2, 1), x < 4 ? 1u : 0u);
    EXPECT_EQ(stencil[2 * 8 + x], x < 4 ? 9 : 3);
    EXPECT_EQ(depth[2 * 8 + x], 0.75f);
  }
}

PUMICE_ON_BOTH_DEVICES(SubpassFeatures);

}  // namespace
}  // namespace pumice::cts
