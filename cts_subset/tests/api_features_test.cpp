// What the API of 1.1 to 1.3 brought, end to end: each test draws or dispatches and reads back what must be there.
#include "cts_subset/tests/graphics.h"

#include <bit>
#include <chrono>

namespace pumice::cts {
namespace {

constexpr VkExtent2D kSize{8, 8};
constexpr VkFormat kUint = VK_FORMAT_R32G32B32A32_UINT;
constexpr VkShaderStageFlags kGraphics = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

class ApiFeatures : public OnDevice {
 protected:
  void SetUp() override {
    OnDevice::SetUp();
    if (HasFatalFailure() || IsSkipped()) return;
    work = std::make_unique<Workspace>(device());
  }
  void TearDown() override { work.reset(); }
  VkDevice handle() { return device().handle; }

  Image target(VkFormat format, uint32_t layers = 1, VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT, VkImageUsageFlags usage = 0) {
    ImageSpec spec;
    spec.format = format;
    spec.extent = {kSize.width, kSize.height, 1};
    spec.layers = layers;
    spec.samples = samples;
    spec.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT | usage |
                 (aspectsOf(format) & VK_IMAGE_ASPECT_COLOR_BIT ? VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT : VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT);
    Image image = work->image(spec);
    toGeneral(*work, image);
    return image;
  }
  Words pixels(const Image& image, uint32_t layer = 0) { return valuesOf<uint32_t>(wordsOf(download(*work, image, 0, layer, VK_IMAGE_ASPECT_COLOR_BIT, 16))); }
  // Word `component` of the pixel.
  uint32_t at(const Words& p, uint32_t x, uint32_t y, uint32_t component) { return p[(y * kSize.width + x) * 4 + component]; }
  VkPipelineLayout pushLayout() { return makePipelineLayout(*work, {}, 16, kGraphics); }
  void push(VkCommandBuffer commands, VkPipelineLayout layout, float x, float y, float z, float w) {
    float v[4] = {x, y, z, w};
    vkCmdPushConstants(commands, layout, kGraphics, 0, sizeof v, v);
  }

  std::unique_ptr<Workspace> work;
};

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

TEST_P(ApiFeatures, MultiviewInDynamicRendering) {
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
    VkRenderingInfo info = renderingInfo(kSize, colors, spec.viewMask);
    vkCmdBeginRendering(commands, &info);
    wholeTarget(commands, {4, 8});   // the right half stays as it was cleared
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    push(commands, layout, 1, 0, 0, 0.5f);
    vkCmdDraw(commands, 3, 1, 0, 0);
    VkClearAttachment attachment{VK_IMAGE_ASPECT_COLOR_BIT, 0, {}};
    attachment.clearValue.color.uint32[0] = 60;
    VkClearRect rect{{{7, 0}, {1, 1}}, 0, 1};
    vkCmdClearAttachments(commands, 1, &attachment, 1, &rect);
    push(commands, layout, 2, 0, 0, 0.5f);
    VkRect2D one{{0, 0}, {1, 1}};
    vkCmdSetScissor(commands, 0, 1, &one);
    vkCmdDraw(commands, 3, 1, 0, 0);
    vkCmdEndRendering(commands);
    fullBarrier(commands);
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
TEST_P(ApiFeatures, MultiviewRenderPass2WithInputAttachmentAndImagelessFramebuffer) {
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
  VkRenderPass pass = VK_NULL_HANDLE;
  check(vkCreateRenderPass2(handle(), &passInfo, nullptr, &pass), "vkCreateRenderPass2");
  work->onDestroy([d = handle(), pass] { vkDestroyRenderPass(d, pass, nullptr); });

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
  VkFramebuffer framebuffer = VK_NULL_HANDLE;
  check(vkCreateFramebuffer(handle(), &framebufferInfo, nullptr, &framebuffer), "vkCreateFramebuffer");
  work->onDestroy([d = handle(), framebuffer] { vkDestroyFramebuffer(d, framebuffer, nullptr); });

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
    push(commands, layout, 5, 0, 0, 0.5f);
    vkCmdDraw(commands, 3, 1, 0, 0);
    vkCmdNextSubpass2(commands, &subpassBegin, &subpassEnd);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, read);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, readLayout, 0, 1, &set, 0, nullptr);
    push(commands, readLayout, 6, 0, 0, 0.5f);
    vkCmdDraw(commands, 3, 1, 0, 0);
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
TEST_P(ApiFeatures, InputAttachmentThatIsTheDepthAttachment) {
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
  VkRenderPass pass = VK_NULL_HANDLE;
  check(vkCreateRenderPass(handle(), &passInfo, nullptr, &pass), "vkCreateRenderPass");
  work->onDestroy([d = handle(), pass] { vkDestroyRenderPass(d, pass, nullptr); });
  VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, pass, 2, views, kSize.width, kSize.height, 1};
  VkFramebuffer framebuffer = VK_NULL_HANDLE;
  check(vkCreateFramebuffer(handle(), &framebufferInfo, nullptr, &framebuffer), "vkCreateFramebuffer");
  work->onDestroy([d = handle(), framebuffer] { vkDestroyFramebuffer(d, framebuffer, nullptr); });

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
  spec.pass = pass;
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
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, kSize}, 2, clears};
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
TEST_P(ApiFeatures, DepthStencilResolve) {
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
        vkCmdBeginRendering(commands, &info);
        wholeTarget(commands, kSize);
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        push(commands, layout, 3.5f / 4 - 1, 0, 0, 0.25f);
        vkCmdDraw(commands, 4, 1, 0, 0);
        vkCmdEndRendering(commands);
        fullBarrier(commands);
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

TEST_P(ApiFeatures, DynamicRenderingLeavesTheOtherAspectAlone) {
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
    vkCmdBeginRendering(commands, &info);
    wholeTarget(commands, {4, 8});
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, depthOnly);
    push(commands, layout, 0, 0, 0, 0.5f);
    vkCmdDraw(commands, 3, 1, 0, 0);
    vkCmdEndRendering(commands);
    fullBarrier(commands);
    info.pDepthAttachment = nullptr;
    info.pStencilAttachment = &attachment;
    attachment.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    vkCmdBeginRendering(commands, &info);
    wholeTarget(commands, {8, 4});
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, stencilOnly);
    push(commands, layout, 0, 0, 0, 0.1f);
    vkCmdDraw(commands, 3, 1, 0, 0);
    vkCmdEndRendering(commands);
    fullBarrier(commands);
  });
  std::vector<float> depth = valuesOf<float>(wordsOf(download(*work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
  Bytes stencil = download(*work, image, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
  for (uint32_t y : {1u, 6u})
    for (uint32_t x : {1u, 6u}) {
      EXPECT_EQ(depth[y * 8 + x], x < 4 ? 0.5f : 0.9f) << x << " " << y;
      EXPECT_EQ(stencil[y * 8 + x], y < 4 ? 33 : 77) << x << " " << y;
    }
}

TEST_P(ApiFeatures, SuspendedRenderingGoesOnInTheNextCommandBuffer) {
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
      push(commands, layout, part ? 20 : 10, 0, 0, 0.5f);
      vkCmdDraw(commands, 3, 1, 0, 0);
      vkCmdEndRendering(commands);
    }
    fullBarrier(commands);
  });
  Words p = pixels(image);
  EXPECT_EQ(at(p, 1, 1, 0), 20u);
  EXPECT_EQ(at(p, 3, 1, 0), 10u);
  EXPECT_EQ(at(p, 6, 1, 0), 3u);
}

TEST_P(ApiFeatures, ExtendedDynamicState) {
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
      push(c, layout, 1, 0, 0, 0.5f);
      vkCmdDraw(c, 3, 1, 0, 0);
      change();
      push(c, layout, value, 0, 0, z);
      vkCmdDraw(c, 3, 1, 0, 0);
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

TEST_P(ApiFeatures, DrawParametersAndIndirectCount) {
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
  device().run([&](VkCommandBuffer c) {
    VkClearValue clear{};
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    VkRenderingInfo info = renderingInfo(kSize, colors);
    vkCmdBeginRendering(c, &info);
    wholeTarget(c, kSize);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    vkCmdDrawIndirectCount(c, commandsBuffer.handle, 0, count.handle, 4, 8, sizeof(VkDrawIndirectCommand));
    vkCmdEndRendering(c);
    fullBarrier(c);
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
TEST_P(ApiFeatures, IndicesDrawsAndAttributesOfExtensions) {
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
  device().run([&](VkCommandBuffer c) {
    VkClearValue clear{};
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    VkRenderingInfo info = renderingInfo(kSize, colors);
    vkCmdBeginRendering(c, &info);
    wholeTarget(c, kSize);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
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
    vkCmdEndRendering(c);
    fullBarrier(c);
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
TEST_P(ApiFeatures, SubgroupsOfVertexAndFragmentShaders) {
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
  device().run([&](VkCommandBuffer c) {
    VkClearValue clear{};
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    VkRenderingInfo info = renderingInfo(kSize, colors);
    vkCmdBeginRendering(c, &info);
    wholeTarget(c, kSize);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    push(c, layout, 0, 0, 0, 0.5f);
    vkCmdDraw(c, 3, 1, 0, 0);
    vkCmdEndRendering(c);
    fullBarrier(c);
  });
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

TEST_P(ApiFeatures, BudgetPrioritiesAndCalibratedTimestamps) {
  PUMICE_NEED_FEATURE(device().has(VK_EXT_MEMORY_BUDGET_EXTENSION_NAME) && device().has(VK_EXT_CALIBRATED_TIMESTAMPS_EXTENSION_NAME));
  auto usage = [&] {
    VkPhysicalDeviceMemoryBudgetPropertiesEXT budget{};
    budget.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_BUDGET_PROPERTIES_EXT;
    VkPhysicalDeviceMemoryProperties2 m{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_PROPERTIES_2, &budget, {}};
    vkGetPhysicalDeviceMemoryProperties2(device().physical, &m);
    EXPECT_GT(budget.heapBudget[0], 0u);
    EXPECT_LE(budget.heapBudget[0], m.memoryProperties.memoryHeaps[0].size);
    return budget.heapUsage[0];
  };
  uint64_t before = usage();
  work->buffer(64 << 20, kStorage);
  if (GetParam() == Role::kTested) {
    EXPECT_GE(usage(), before + (64 << 20));
  }
  auto domains = reinterpret_cast<PFN_vkGetPhysicalDeviceCalibrateableTimeDomainsEXT>(
      vkGetInstanceProcAddr(world().instance->handle(), "vkGetPhysicalDeviceCalibrateableTimeDomainsEXT"));
  auto calibrated = reinterpret_cast<PFN_vkGetCalibratedTimestampsEXT>(vkGetDeviceProcAddr(handle(), "vkGetCalibratedTimestampsEXT"));
  ASSERT_TRUE(domains && calibrated);
  uint32_t count = 0;
  check(domains(device().physical, &count, nullptr), "vkGetPhysicalDeviceCalibrateableTimeDomainsEXT");
  std::vector<VkTimeDomainEXT> all(count);
  check(domains(device().physical, &count, all.data()), "vkGetPhysicalDeviceCalibrateableTimeDomainsEXT");
  EXPECT_NE(std::find(all.begin(), all.end(), VK_TIME_DOMAIN_DEVICE_EXT), all.end());
  std::vector<VkCalibratedTimestampInfoEXT> infos;
  for (VkTimeDomainEXT d : all) infos.push_back({VK_STRUCTURE_TYPE_CALIBRATED_TIMESTAMP_INFO_EXT, nullptr, d});
  std::vector<uint64_t> first(count), second(count);
  uint64_t deviation = 0;
  check(calibrated(handle(), count, infos.data(), first.data(), &deviation), "vkGetCalibratedTimestampsEXT");
  check(calibrated(handle(), count, infos.data(), second.data(), &deviation), "vkGetCalibratedTimestampsEXT");
  for (uint32_t i = 0; i < count; i++) EXPECT_GE(second[i], first[i]) << all[i];
  // A timestamp of the queue lies between two of the device's domain.
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_TIMESTAMP, 1, 0};
  VkQueryPool queries = VK_NULL_HANDLE;
  check(vkCreateQueryPool(handle(), &queryInfo, nullptr, &queries), "vkCreateQueryPool");
  work->onDestroy([d = handle(), queries] { vkDestroyQueryPool(d, queries, nullptr); });
  device().run([&](VkCommandBuffer c) {
    vkCmdResetQueryPool(c, queries, 0, 1);
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 0);
  });
  uint64_t stamp = 0, third = 0;
  check(vkGetQueryPoolResults(handle(), queries, 0, 1, 8, &stamp, 8, VK_QUERY_RESULT_64_BIT), "vkGetQueryPoolResults");
  VkCalibratedTimestampInfoEXT own{VK_STRUCTURE_TYPE_CALIBRATED_TIMESTAMP_INFO_EXT, nullptr, VK_TIME_DOMAIN_DEVICE_EXT};
  check(calibrated(handle(), 1, &own, &third, &deviation), "vkGetCalibratedTimestampsEXT");
  uint64_t device0 = second[std::find(all.begin(), all.end(), VK_TIME_DOMAIN_DEVICE_EXT) - all.begin()];
  EXPECT_LE(device0, stamp);
  EXPECT_LE(stamp, third);
  if (device().has(VK_KHR_GLOBAL_PRIORITY_EXTENSION_NAME)) {
    VkQueueFamilyGlobalPriorityPropertiesKHR priorities{};
    priorities.sType = VK_STRUCTURE_TYPE_QUEUE_FAMILY_GLOBAL_PRIORITY_PROPERTIES_KHR;
    VkQueueFamilyProperties2 family{VK_STRUCTURE_TYPE_QUEUE_FAMILY_PROPERTIES_2, &priorities, {}};
    uint32_t one = 1;
    vkGetPhysicalDeviceQueueFamilyProperties2(device().physical, &one, &family);
    EXPECT_GE(priorities.priorityCount, 1u);
  }
}

// A timestamp of the bottom of the pipe inside a pass comes after the draws before it, whenever they run.
TEST_P(ApiFeatures, TimestampsInAPassWaitForItsDraws) {
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
  VkQueryPool queries = VK_NULL_HANDLE;
  check(vkCreateQueryPool(handle(), &queryInfo, nullptr, &queries), "vkCreateQueryPool");
  work->onDestroy([d = handle(), queries] { vkDestroyQueryPool(d, queries, nullptr); });
  device().run([&](VkCommandBuffer c) {
    vkCmdResetQueryPool(c, queries, 0, 3);
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 0);
    std::vector<VkRenderingAttachmentInfo> attachments{rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, {})};
    VkRenderingInfo info = renderingInfo(kSize, attachments);
    vkCmdBeginRendering(c, &info);
    wholeTarget(c, kSize);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, slow);
    push(c, layout, 1, 0, 0, 0.5f);
    vkCmdDraw(c, 3, 1, 0, 0);
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 1);
    vkCmdEndRendering(c);
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 2);
  });
  uint64_t t[3]{};
  check(vkGetQueryPoolResults(handle(), queries, 0, 3, sizeof t, t, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT), "vkGetQueryPoolResults");
  EXPECT_LE(t[1], t[2]);
  EXPECT_GT(t[1] - t[0], (t[2] - t[0]) / 2) << "inside " << t[1] - t[0] << ", after the pass " << t[2] - t[0];
}

TEST_P(ApiFeatures, LoadAndStoreNothing) {
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

TEST_P(ApiFeatures, DemoteAndTerminate) {
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
    device().run([&](VkCommandBuffer c) {
      VkClearValue clear{};
      clear.color.uint32[0] = 99;
      std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
      VkRenderingInfo info = renderingInfo(kSize, colors);
      vkCmdBeginRendering(c, &info);
      wholeTarget(c, kSize);
      vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
      push(c, layout, 0, 0, 0, 0.5f);
      vkCmdDraw(c, 3, 1, 0, 0);
      vkCmdEndRendering(c);
      fullBarrier(c);
    });
    Words p = pixels(image);
    for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(at(p, x, 5, 0), (i ? x & 2 : x & 1) ? 99u : i ? 8u : 3u) << x;
    if (!i) {
      EXPECT_EQ(at(p, 2, 5, 1), 0u) << "not a helper";
    }
  }
}

const char* const kSumShader = R"(#version 460
layout(local_size_x = 1) in;
layout(binding = 0) uniform U { uvec4 u; };
layout(binding = 1) readonly buffer A { uint a[]; };
layout(binding = 2) buffer Out { uint r[]; };
layout(push_constant) uniform P { uint index; };
void main() { r[index] = u.x * 1000 + u.y * 100 + a[0] * 10 + a[1]; }
)";

struct SumBuffers {
  explicit SumBuffers(Workspace& work)
      : u{work.bufferOf(Words{1, 2, 0, 0}, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT), work.bufferOf(Words{3, 4, 0, 0}, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT)},
        a{work.bufferOf(Words{5, 6}, kStorage), work.bufferOf(Words{7, 8}, kStorage)},
        out(work.bufferOf(Words(8, 0), kStorage)) {}
  Buffer u[2], a[2], out;
  uint32_t result(uint32_t i) const {
    uint32_t v;
    std::memcpy(&v, out.mapped + 4 * i, 4);
    return v;
  }
};

TEST_P(ApiFeatures, PushDescriptors) {
  PUMICE_NEED_FEATURE(device().has(VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME));
  auto pushSet = reinterpret_cast<PFN_vkCmdPushDescriptorSetKHR>(vkGetDeviceProcAddr(handle(), "vkCmdPushDescriptorSetKHR"));
  auto pushTemplate = reinterpret_cast<PFN_vkCmdPushDescriptorSetWithTemplateKHR>(vkGetDeviceProcAddr(handle(), "vkCmdPushDescriptorSetWithTemplateKHR"));
  ASSERT_TRUE(pushSet && pushTemplate);
  SumBuffers b(*work);
  VkDescriptorSetLayout setLayout = makeSetLayout(*work,
                                                  {computeBinding(0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER),
                                                   computeBinding(2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)},
                                                  VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR);
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 4);
  VkPipeline pipeline = makeCompute(*work, work->shader(VK_SHADER_STAGE_COMPUTE_BIT, kSumShader), layout);
  VkDescriptorUpdateTemplateEntry entry{1, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 8, 0};
  VkDescriptorUpdateTemplateCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO, nullptr, 0, 1, &entry,
                                            VK_DESCRIPTOR_UPDATE_TEMPLATE_TYPE_PUSH_DESCRIPTORS_KHR, setLayout, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0};
  VkDescriptorUpdateTemplate update = VK_NULL_HANDLE;
  check(vkCreateDescriptorUpdateTemplate(handle(), &info, nullptr, &update), "vkCreateDescriptorUpdateTemplate");
  work->onDestroy([d = handle(), update] { vkDestroyDescriptorUpdateTemplate(d, update, nullptr); });
  device().run([&](VkCommandBuffer c) {
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    VkDescriptorBufferInfo infos[4] = {{b.u[0].handle, 0, VK_WHOLE_SIZE}, {b.a[0].handle, 0, VK_WHOLE_SIZE}, {b.out.handle, 0, VK_WHOLE_SIZE}, {b.u[1].handle, 0, VK_WHOLE_SIZE}};
    VkWriteDescriptorSet writes[3] = {writeBuffer(VK_NULL_HANDLE, 0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, &infos[0]),
                                      writeBuffer(VK_NULL_HANDLE, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[1]),
                                      writeBuffer(VK_NULL_HANDLE, 2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[2])};
    auto dispatch = [&](uint32_t index) {
      vkCmdPushConstants(c, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &index);
      vkCmdDispatch(c, 1, 1, 1);
    };
    pushSet(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 3, writes);
    dispatch(0);
    // One binding changes, the others stay.
    VkWriteDescriptorSet other = writeBuffer(VK_NULL_HANDLE, 0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, &infos[3]);
    pushSet(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &other);
    dispatch(1);
    struct {
      uint64_t before;
      VkDescriptorBufferInfo info;
    } data{0, {b.a[1].handle, 0, VK_WHOLE_SIZE}};
    pushTemplate(c, update, layout, 0, &data);
    dispatch(2);
    fullBarrier(c);
  });
  EXPECT_EQ(b.result(0), 1256u);
  EXPECT_EQ(b.result(1), 3456u);
  EXPECT_EQ(b.result(2), 3478u);
}

TEST_P(ApiFeatures, InlineUniformBlocksAndUpdateTemplates) {
  PUMICE_NEED_FEATURE(device().vulkan13.inlineUniformBlock);
  SumBuffers b(*work);
  VkDescriptorSetLayout setLayout = makeSetLayout(*work, {computeBinding(0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, 16),
                                                          computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)});
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 4);
  VkPipeline pipeline = makeCompute(*work, work->shader(VK_SHADER_STAGE_COMPUTE_BIT, kSumShader), layout);
  VkDescriptorPoolInlineUniformBlockCreateInfo blocks{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_INLINE_UNIFORM_BLOCK_CREATE_INFO, nullptr, 3};
  VkDescriptorPool pool = makePool(*work, {{VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, 48}, {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 6}}, 3, 0, &blocks);
  VkDescriptorSet sets[3];
  for (auto& s : sets) s = makeSet(*work, pool, setLayout);
  // The first is written, the second copied and changed in part, the third comes by a template.
  VkDescriptorBufferInfo infos[2] = {{b.a[0].handle, 0, VK_WHOLE_SIZE}, {b.out.handle, 0, VK_WHOLE_SIZE}};
  const uint32_t data[4] = {1, 2, 0, 0}, four = 4;
  VkWriteDescriptorSetInlineUniformBlock block{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_INLINE_UNIFORM_BLOCK, nullptr, 16, data}, part = block;
  part.dataSize = 4, part.pData = &four;
  VkWriteDescriptorSet writes[3] = {writeBuffer(sets[0], 0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, nullptr, 0, 16),
                                    writeBuffer(sets[0], 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[0]), writeBuffer(sets[0], 2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[1])};
  writes[0].pNext = &block;
  vkUpdateDescriptorSets(handle(), 3, writes, 0, nullptr);
  VkCopyDescriptorSet copies[3]{};
  for (uint32_t i = 0; i < 3; i++) copies[i] = {VK_STRUCTURE_TYPE_COPY_DESCRIPTOR_SET, nullptr, sets[0], i, 0, sets[1], i, 0, i ? 1u : 16u};
  vkUpdateDescriptorSets(handle(), 0, nullptr, 3, copies);
  VkWriteDescriptorSet change = writeBuffer(sets[1], 0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, nullptr, 4, 4);
  change.pNext = &part;
  vkUpdateDescriptorSets(handle(), 1, &change, 0, nullptr);
  struct Data {
    uint32_t words[4];
    VkDescriptorBufferInfo a, out;
  } source{{7, 8, 0, 0}, {b.a[1].handle, 0, VK_WHOLE_SIZE}, {b.out.handle, 0, VK_WHOLE_SIZE}};
  VkDescriptorUpdateTemplateEntry entries[3] = {{0, 0, 16, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, offsetof(Data, words), 0},
                                                {1, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, offsetof(Data, a), 0},
                                                {2, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, offsetof(Data, out), 0}};
  VkDescriptorUpdateTemplateCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO, nullptr, 0, 3, entries,
                                            VK_DESCRIPTOR_UPDATE_TEMPLATE_TYPE_DESCRIPTOR_SET, setLayout, VK_PIPELINE_BIND_POINT_COMPUTE, VK_NULL_HANDLE, 0};
  VkDescriptorUpdateTemplate update = VK_NULL_HANDLE;
  check(vkCreateDescriptorUpdateTemplate(handle(), &info, nullptr, &update), "vkCreateDescriptorUpdateTemplate");
  work->onDestroy([d = handle(), update] { vkDestroyDescriptorUpdateTemplate(d, update, nullptr); });
  vkUpdateDescriptorSetWithTemplate(handle(), sets[2], update, &source);
  device().run([&](VkCommandBuffer c) {
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    for (uint32_t i = 0; i < 3; i++) {
      vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &sets[i], 0, nullptr);
      vkCmdPushConstants(c, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &i);
      vkCmdDispatch(c, 1, 1, 1);
    }
    fullBarrier(c);
  });
  EXPECT_EQ(b.result(0), 1256u);
  EXPECT_EQ(b.result(1), 1456u);
  EXPECT_EQ(b.result(2), 7878u);
}

// The queue waits for a value that the host signals later; the host waits for what the queue signals.
TEST_P(ApiFeatures, TimelineSemaphoresWithSubmit2) {
  PUMICE_NEED_FEATURE(device().vulkan12.timelineSemaphore && device().vulkan13.synchronization2);
  VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO, nullptr, VK_SEMAPHORE_TYPE_TIMELINE, 5};
  VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type, 0};
  VkSemaphore timeline = VK_NULL_HANDLE;
  check(vkCreateSemaphore(handle(), &info, nullptr, &timeline), "vkCreateSemaphore");
  work->onDestroy([d = handle(), timeline] { vkDestroySemaphore(d, timeline, nullptr); });
  uint64_t value = 0;
  check(vkGetSemaphoreCounterValue(handle(), timeline, &value), "vkGetSemaphoreCounterValue");
  EXPECT_EQ(value, 5u);
  Buffer buffer = work->bufferOf(Words{0}, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, device().family};
  VkCommandPool pool = VK_NULL_HANDLE;
  check(vkCreateCommandPool(handle(), &poolInfo, nullptr, &pool), "vkCreateCommandPool");
  work->onDestroy([d = handle(), pool] { vkDestroyCommandPool(d, pool, nullptr); });
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
  VkCommandBuffer commands = VK_NULL_HANDLE;
  check(vkAllocateCommandBuffers(handle(), &allocate, &commands), "vkAllocateCommandBuffers");
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
  check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
  vkCmdFillBuffer(commands, buffer.handle, 0, 4, 123);
  VkMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, nullptr, VK_PIPELINE_STAGE_2_CLEAR_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_HOST_BIT,
                           VK_ACCESS_2_HOST_READ_BIT};
  VkDependencyInfo dependency{};
  dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &barrier;
  vkCmdPipelineBarrier2(commands, &dependency);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  VkSemaphoreSubmitInfo wait{VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO, nullptr, timeline, 8, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, 0}, signal = wait;
  signal.value = 10;
  VkCommandBufferSubmitInfo one{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO, nullptr, commands, 0};
  VkSubmitInfo2 submit{VK_STRUCTURE_TYPE_SUBMIT_INFO_2, nullptr, 0, 1, &wait, 1, &one, 1, &signal};
  check(vkQueueSubmit2(device().queue, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit2");
  uint64_t ten = 10;
  VkSemaphoreWaitInfo waitInfo{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO, nullptr, 0, 1, &timeline, &ten};
  EXPECT_EQ(vkWaitSemaphores(handle(), &waitInfo, 20'000'000), VK_TIMEOUT) << "nobody has signalled 8";
  VkSemaphoreSignalInfo seven{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO, nullptr, timeline, 7};
  check(vkSignalSemaphore(handle(), &seven), "vkSignalSemaphore");
  EXPECT_EQ(vkWaitSemaphores(handle(), &waitInfo, 20'000'000), VK_TIMEOUT) << "7 is not enough";
  seven.value = 9;
  check(vkSignalSemaphore(handle(), &seven), "vkSignalSemaphore");
  EXPECT_EQ(vkWaitSemaphores(handle(), &waitInfo, 10'000'000'000ull), VK_SUCCESS);
  uint32_t word;
  std::memcpy(&word, buffer.mapped, 4);
  EXPECT_EQ(word, 123u);
  device().waitIdle();
}

TEST_P(ApiFeatures, Synchronization2CommandsAndCopies2) {
  PUMICE_NEED_FEATURE(device().vulkan13.synchronization2);
  VkEventCreateInfo eventInfo{VK_STRUCTURE_TYPE_EVENT_CREATE_INFO, nullptr, 0};
  VkEvent event = VK_NULL_HANDLE;
  check(vkCreateEvent(handle(), &eventInfo, nullptr, &event), "vkCreateEvent");
  work->onDestroy([d = handle(), event] { vkDestroyEvent(d, event, nullptr); });
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_TIMESTAMP, 2, 0};
  VkQueryPool queries = VK_NULL_HANDLE;
  check(vkCreateQueryPool(handle(), &queryInfo, nullptr, &queries), "vkCreateQueryPool");
  work->onDestroy([d = handle(), queries] { vkDestroyQueryPool(d, queries, nullptr); });
  vkResetQueryPool(handle(), queries, 0, 2);
  Words data(64);
  for (uint32_t i = 0; i < 64; i++) data[i] = i * 3;
  constexpr VkBufferUsageFlags kBoth = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  Buffer a = work->bufferOf(data, kBoth), b = work->bufferOf(Words(64, 0), kBoth), c = work->bufferOf(Words(64, 0), kBoth);
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {8, 8, 1};
  Image first = work->image(spec), second = work->image(spec);
  toGeneral(*work, first);
  toGeneral(*work, second);
  device().run([&](VkCommandBuffer commands) {
    VkMemoryBarrier2 all{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, nullptr, VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
                         VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT};
    VkDependencyInfo dependency{};
    dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    dependency.memoryBarrierCount = 1;
    dependency.pMemoryBarriers = &all;
    vkCmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries, 0);
    VkBufferCopy2 whole{VK_STRUCTURE_TYPE_BUFFER_COPY_2, nullptr, 0, 0, 256};
    VkCopyBufferInfo2 buffers{VK_STRUCTURE_TYPE_COPY_BUFFER_INFO_2, nullptr, a.handle, b.handle, 1, &whole};
    vkCmdCopyBuffer2(commands, &buffers);
    vkCmdSetEvent2(commands, event, &dependency);
    vkCmdWaitEvents2(commands, 1, &event, &dependency);
    VkBufferImageCopy2 region{};
    region.sType = VK_STRUCTURE_TYPE_BUFFER_IMAGE_COPY_2;
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {8, 8, 1};
    VkCopyBufferToImageInfo2 upload{VK_STRUCTURE_TYPE_COPY_BUFFER_TO_IMAGE_INFO_2, nullptr, b.handle, first.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &region};
    vkCmdCopyBufferToImage2(commands, &upload);
    vkCmdPipelineBarrier2(commands, &dependency);
    VkImageCopy2 image{};
    image.sType = VK_STRUCTURE_TYPE_IMAGE_COPY_2;
    image.srcSubresource = image.dstSubresource = region.imageSubresource;
    image.srcOffset = {1, 0, 0};
    image.extent = {7, 8, 1};
    VkCopyImageInfo2 images{VK_STRUCTURE_TYPE_COPY_IMAGE_INFO_2, nullptr, first.handle, VK_IMAGE_LAYOUT_GENERAL, second.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &image};
    vkCmdCopyImage2(commands, &images);
    vkCmdPipelineBarrier2(commands, &dependency);
    VkImageBlit2 mirror{};
    mirror.sType = VK_STRUCTURE_TYPE_IMAGE_BLIT_2;
    mirror.srcSubresource = mirror.dstSubresource = region.imageSubresource;
    mirror.srcOffsets[1] = {7, 8, 1};
    mirror.dstOffsets[0] = {7, 0, 0};
    mirror.dstOffsets[1] = {0, 8, 1};
    VkBlitImageInfo2 blit{VK_STRUCTURE_TYPE_BLIT_IMAGE_INFO_2, nullptr, second.handle, VK_IMAGE_LAYOUT_GENERAL, first.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &mirror, VK_FILTER_NEAREST};
    vkCmdBlitImage2(commands, &blit);
    all.srcStageMask |= VK_PIPELINE_STAGE_2_BLIT_BIT;
    vkCmdPipelineBarrier2(commands, &dependency);
    VkCopyImageToBufferInfo2 back{VK_STRUCTURE_TYPE_COPY_IMAGE_TO_BUFFER_INFO_2, nullptr, first.handle, VK_IMAGE_LAYOUT_GENERAL, c.handle, 1, &region};
    vkCmdCopyImageToBuffer2(commands, &back);
    vkCmdResetEvent2(commands, event, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT);
    vkCmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries, 1);
    fullBarrier(commands);
  });
  Words r = valuesOf<uint32_t>(wordsOf(bytesOf(c)));
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(r[y * 8 + x], (x < 7 ? y * 8 + 7 - x : y * 8 + 7) * 3) << x << " " << y;
  uint64_t times[2];
  EXPECT_EQ(vkGetQueryPoolResults(handle(), queries, 0, 2, sizeof times, times, 8, VK_QUERY_RESULT_64_BIT), VK_SUCCESS);
  EXPECT_LE(times[0], times[1]);
  EXPECT_EQ(vkGetEventStatus(handle(), event), VK_EVENT_RESET);
}

TEST_P(ApiFeatures, PipelineCreationCacheControlAndFeedback) {
  PUMICE_NEED_FEATURE(device().vulkan13.pipelineCreationCacheControl && device().vulkan13.dynamicRendering);
  VkPipelineLayout layout = pushLayout();
  VkPipelineCreationFeedback whole{}, stages[2]{};
  VkPipelineCreationFeedbackCreateInfo feedback{VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO, nullptr, &whole, 2, stages};
  GraphicsSpec spec;
  // A shader that no cache can know.
  spec.fragment = "#version 460\nlayout(location = 0) out uvec4 color;\nvoid main() { color = uvec4(" +
                  std::to_string(std::chrono::steady_clock::now().time_since_epoch().count() & 0xffffff) + "); }\n";
  spec.colors = {kUint};
  spec.flags = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;
  VkPipeline pipeline = VkPipeline(0x1);
  VkResult result = tryGraphics(*work, layout, spec, &pipeline);
  EXPECT_TRUE(result == VK_PIPELINE_COMPILE_REQUIRED || result == VK_SUCCESS) << result;
  EXPECT_EQ(pipeline != VK_NULL_HANDLE, result == VK_SUCCESS);
  spec.flags = 0;
  spec.next = &feedback;
  pipeline = VK_NULL_HANDLE;
  EXPECT_EQ(tryGraphics(*work, layout, spec, &pipeline), VK_SUCCESS);
  if (whole.flags & VK_PIPELINE_CREATION_FEEDBACK_VALID_BIT) {
    EXPECT_GT(whole.duration, 0u);
  }
}

TEST_P(ApiFeatures, PrivateDataRequirementsAndFormatFlags) {
  PUMICE_NEED_FEATURE(device().vulkan13.privateData && device().vulkan13.maintenance4);
  VkPrivateDataSlotCreateInfo slotInfo{VK_STRUCTURE_TYPE_PRIVATE_DATA_SLOT_CREATE_INFO, nullptr, 0};
  VkPrivateDataSlot slot = VK_NULL_HANDLE;
  check(vkCreatePrivateDataSlot(handle(), &slotInfo, nullptr, &slot), "vkCreatePrivateDataSlot");
  work->onDestroy([d = handle(), slot] { vkDestroyPrivateDataSlot(d, slot, nullptr); });
  Buffer buffer = work->bufferOf(Words(100), kStorage);
  uint64_t data = 1;
  vkGetPrivateData(handle(), VK_OBJECT_TYPE_BUFFER, uint64_t(buffer.handle), slot, &data);
  EXPECT_EQ(data, 0u);
  EXPECT_EQ(vkSetPrivateData(handle(), VK_OBJECT_TYPE_BUFFER, uint64_t(buffer.handle), slot, 0x123456789abcull), VK_SUCCESS);
  vkGetPrivateData(handle(), VK_OBJECT_TYPE_BUFFER, uint64_t(buffer.handle), slot, &data);
  EXPECT_EQ(data, 0x123456789abcull);

  // Requirements from the create-info alone are those of the object.
  VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, nullptr, 0, 400, kStorage, VK_SHARING_MODE_EXCLUSIVE, 0, nullptr};
  VkDeviceBufferMemoryRequirements ask{VK_STRUCTURE_TYPE_DEVICE_BUFFER_MEMORY_REQUIREMENTS, nullptr, &bufferInfo};
  VkMemoryRequirements2 found{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2, nullptr, {}};
  vkGetDeviceBufferMemoryRequirements(handle(), &ask, &found);
  VkMemoryRequirements own;
  vkGetBufferMemoryRequirements(handle(), buffer.handle, &own);
  EXPECT_EQ(found.memoryRequirements.size, own.size);
  EXPECT_EQ(found.memoryRequirements.alignment, own.alignment);
  EXPECT_EQ(found.memoryRequirements.memoryTypeBits, own.memoryTypeBits);

  for (VkFormat format : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_D32_SFLOAT, VK_FORMAT_R32_UINT}) {
    VkFormatProperties3 three{};
    three.sType = VK_STRUCTURE_TYPE_FORMAT_PROPERTIES_3;
    VkFormatProperties2 two{VK_STRUCTURE_TYPE_FORMAT_PROPERTIES_2, &three, {}};
    vkGetPhysicalDeviceFormatProperties2(device().physical, format, &two);
    EXPECT_EQ(three.optimalTilingFeatures & two.formatProperties.optimalTilingFeatures, two.formatProperties.optimalTilingFeatures) << format;
    EXPECT_EQ(three.bufferFeatures & two.formatProperties.bufferFeatures, two.formatProperties.bufferFeatures) << format;
    if (format == VK_FORMAT_D32_SFLOAT) {
      EXPECT_TRUE(three.optimalTilingFeatures & VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_DEPTH_COMPARISON_BIT);
    }
  }
  uint32_t tools = 77;
  EXPECT_EQ(vkGetPhysicalDeviceToolProperties(device().physical, &tools, nullptr), VK_SUCCESS);
  EXPECT_LT(tools, 77u);
}

PUMICE_ON_BOTH_DEVICES(ApiFeatures);

}  // namespace
}  // namespace pumice::cts
