// Graphics pipelines and passes for tests of the API: small targets, a triangle that covers all of them, words read back.
#pragma once

#include "cts_subset/tests/compute.h"

#include <algorithm>
#include <functional>
#include <memory>

namespace pumice::cts {

inline const char* const kWholeTarget = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
void main() { gl_Position = vec4(vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1, given.w, 1); }
)";

inline const char* const kGivenFragment = R"(#version 460
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) out uvec4 color;
void main() { color = uvec4(given); }
)";

// The same triangle, and what each view makes of it.
inline const char* const kViewVertex = R"(#version 460
#extension GL_EXT_multiview : require
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) flat out uint view;
void main() {
  gl_Position = vec4(vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1, given.w, 1);
  view = gl_ViewIndex;
}
)";
inline const char* const kViewFragment = R"(#version 460
#extension GL_EXT_multiview : require
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) flat in uint view;
layout(location = 0) out uvec4 color;
void main() { color = uvec4(gl_ViewIndex + 1, uint(gl_FragCoord.x), uint(given.x), view); }
)";

struct GraphicsSpec {
  std::string vertex = kWholeTarget, fragment;
  ShaderTarget shaders = ShaderTarget::kVulkan13;
  std::vector<VkFormat> colors;          // of dynamic rendering
  VkFormat depth = VK_FORMAT_UNDEFINED, stencil = VK_FORMAT_UNDEFINED;
  uint32_t viewMask = 0;
  VkRenderPass pass = VK_NULL_HANDLE;    // instead of them
  uint32_t subpass = 0, colorCount = 0;  // of the subpass
  VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT;
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  bool depthTest = false, depthWrite = true, stencilTest = false;
  uint32_t stencilReference = 0;         // replaces, unless `stencilOps` says otherwise
  std::vector<VkPipelineColorBlendAttachmentState> blends;   // none: no blending, all components
  std::vector<VkDynamicState> dynamic;   // besides viewport and scissor
  std::vector<VkVertexInputBindingDescription> bindings;
  std::vector<VkVertexInputAttributeDescription> attributes;
  const void *inputNext = nullptr, *viewportNext = nullptr, *blendNext = nullptr;
  bool logicOp = false;                  // dynamic
  bool depthClamp = false;
  VkPipelineColorBlendStateCreateFlags blendFlags = 0;
  VkPipelineDepthStencilStateCreateFlags depthFlags = 0;
  VkStencilOpState stencilOps{VK_STENCIL_OP_KEEP, VK_STENCIL_OP_REPLACE, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_ALWAYS, 0xff, 0xff, 0};
  bool primitiveRestart = false;
  bool alphaToCoverage = false;
  VkPipelineCreateFlags flags = 0;
  const void* next = nullptr;
  const void* stageNext = nullptr;       // of both stages
};

inline VkResult tryGraphics(Workspace& work, VkPipelineLayout layout, const GraphicsSpec& spec, VkPipeline* made) {
  VkPipelineShaderStageCreateInfo stages[2]{};
  for (auto& s : stages) s.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, s.pName = "main", s.pNext = spec.stageNext;
  stages[0].stage = VK_SHADER_STAGE_VERTEX_BIT;
  stages[0].module = work.shader(VK_SHADER_STAGE_VERTEX_BIT, spec.vertex, spec.shaders);
  stages[1].stage = VK_SHADER_STAGE_FRAGMENT_BIT;
  if (!spec.fragment.empty()) stages[1].module = work.shader(VK_SHADER_STAGE_FRAGMENT_BIT, spec.fragment, spec.shaders);
  VkPipelineVertexInputStateCreateInfo input{};
  input.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
  input.pNext = spec.inputNext;
  input.vertexBindingDescriptionCount = uint32_t(spec.bindings.size());
  input.pVertexBindingDescriptions = spec.bindings.data();
  input.vertexAttributeDescriptionCount = uint32_t(spec.attributes.size());
  input.pVertexAttributeDescriptions = spec.attributes.data();
  VkPipelineInputAssemblyStateCreateInfo assembly{};
  assembly.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
  assembly.topology = spec.topology;
  assembly.primitiveRestartEnable = spec.primitiveRestart;
  bool counted = std::find(spec.dynamic.begin(), spec.dynamic.end(), VK_DYNAMIC_STATE_VIEWPORT_WITH_COUNT) != spec.dynamic.end();
  VkPipelineViewportStateCreateInfo viewport{};
  viewport.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
  viewport.pNext = spec.viewportNext;
  viewport.viewportCount = viewport.scissorCount = counted ? 0 : 1;
  VkPipelineRasterizationStateCreateInfo raster{};
  raster.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
  raster.lineWidth = 1;
  raster.depthClampEnable = spec.depthClamp;
  VkPipelineMultisampleStateCreateInfo multisample{};
  multisample.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
  multisample.rasterizationSamples = spec.samples;
  multisample.alphaToCoverageEnable = spec.alphaToCoverage;
  VkPipelineDepthStencilStateCreateInfo depth{};
  depth.sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO;
  depth.flags = spec.depthFlags;
  depth.depthTestEnable = spec.depthTest;
  depth.depthWriteEnable = spec.depthTest && spec.depthWrite;
  depth.depthCompareOp = VK_COMPARE_OP_LESS;
  depth.stencilTestEnable = spec.stencilTest;
  depth.front = spec.stencilOps;
  depth.front.reference = spec.stencilReference;
  depth.back = depth.front;
  std::vector<VkPipelineColorBlendAttachmentState> attachments = spec.blends;
  VkPipelineColorBlendAttachmentState written{};
  written.colorWriteMask = 0xf;
  attachments.resize(spec.pass ? spec.colorCount : spec.colors.size(), written);
  VkPipelineColorBlendStateCreateInfo blend{};
  blend.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
  blend.pNext = spec.blendNext;
  blend.flags = spec.blendFlags;
  blend.logicOpEnable = spec.logicOp;
  blend.attachmentCount = uint32_t(attachments.size());
  blend.pAttachments = attachments.data();
  std::vector<VkDynamicState> dynamic = spec.dynamic;
  if (!counted) dynamic.insert(dynamic.end(), {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR});
  VkPipelineDynamicStateCreateInfo dynamicInfo{};
  dynamicInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO;
  dynamicInfo.dynamicStateCount = uint32_t(dynamic.size());
  dynamicInfo.pDynamicStates = dynamic.data();
  VkPipelineRenderingCreateInfo rendering{};
  rendering.sType = VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO;
  rendering.pNext = spec.next;
  rendering.viewMask = spec.viewMask;
  rendering.colorAttachmentCount = uint32_t(spec.colors.size());
  rendering.pColorAttachmentFormats = spec.colors.data();
  rendering.depthAttachmentFormat = spec.depth;
  rendering.stencilAttachmentFormat = spec.stencil;
  VkGraphicsPipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
  info.pNext = spec.pass ? spec.next : &rendering;
  info.flags = spec.flags;
  info.stageCount = spec.fragment.empty() ? 1 : 2;
  info.pStages = stages;
  info.pVertexInputState = &input;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &viewport;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &multisample;
  info.pDepthStencilState = &depth;
  info.pColorBlendState = &blend;
  info.pDynamicState = &dynamicInfo;
  info.layout = layout;
  info.renderPass = spec.pass;
  info.subpass = spec.subpass;
  VkDevice d = work.device.handle;
  VkResult result = vkCreateGraphicsPipelines(d, VK_NULL_HANDLE, 1, &info, nullptr, made);
  if (*made) work.onDestroy([d, p = *made] { vkDestroyPipeline(d, p, nullptr); });
  return result;
}

inline VkPipeline makeGraphics(Workspace& work, VkPipelineLayout layout, const GraphicsSpec& spec) {
  VkPipeline made = VK_NULL_HANDLE;
  check(tryGraphics(work, layout, spec, &made), "vkCreateGraphicsPipelines");
  return made;
}

inline VkRenderingAttachmentInfo rendered(VkImageView view, VkAttachmentLoadOp load, VkClearValue clear = {}) {
  VkRenderingAttachmentInfo a{};
  a.sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO;
  a.imageView = view;
  a.imageLayout = VK_IMAGE_LAYOUT_GENERAL;
  a.loadOp = load;
  a.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  a.clearValue = clear;
  return a;
}

inline VkRenderingInfo renderingInfo(VkExtent2D extent, const std::vector<VkRenderingAttachmentInfo>& colors, uint32_t viewMask = 0) {
  VkRenderingInfo r{};
  r.sType = VK_STRUCTURE_TYPE_RENDERING_INFO;
  r.renderArea.extent = extent;
  r.layerCount = 1;
  r.viewMask = viewMask;
  r.colorAttachmentCount = uint32_t(colors.size());
  r.pColorAttachments = colors.data();
  return r;
}

// An attachment of a render pass that is cleared and stored and stays in GENERAL.
inline VkAttachmentDescription2 attachmentOf(VkFormat format, VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT) {
  VkAttachmentDescription2 a{};
  a.sType = VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_2;
  a.format = format;
  a.samples = samples;
  a.loadOp = a.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  a.storeOp = a.stencilStoreOp = VK_ATTACHMENT_STORE_OP_STORE;
  a.initialLayout = a.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
  return a;
}

inline VkAttachmentReference2 referenceTo(uint32_t attachment, VkImageAspectFlags aspects) {
  return {VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2, nullptr, attachment, VK_IMAGE_LAYOUT_GENERAL, aspects};
}

// With one colour attachment or none.
inline VkSubpassDescription2 subpass(const VkAttachmentReference2* color, const VkAttachmentReference2* depthStencil = nullptr) {
  VkSubpassDescription2 s{};
  s.sType = VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_2;
  s.colorAttachmentCount = color ? 1 : 0;
  s.pColorAttachments = color;
  s.pDepthStencilAttachment = depthStencil;
  return s;
}

inline VkRenderPass makePass(Workspace& work, const std::vector<VkAttachmentDescription2>& attachments, const std::vector<VkSubpassDescription2>& subpasses,
                             const std::vector<VkSubpassDependency2>& dependencies = {}) {
  VkRenderPassCreateInfo2 info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO_2;
  info.attachmentCount = uint32_t(attachments.size());
  info.pAttachments = attachments.data();
  info.subpassCount = uint32_t(subpasses.size());
  info.pSubpasses = subpasses.data();
  info.dependencyCount = uint32_t(dependencies.size());
  info.pDependencies = dependencies.data();
  return work.make(info);
}

inline Binding inputBinding(VkImageView view) {
  Binding b{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT};
  b.image = {VK_NULL_HANDLE, view, VK_IMAGE_LAYOUT_GENERAL};
  return b;
}

// Viewport and scissor of the whole target.
inline void wholeTarget(VkCommandBuffer commands, VkExtent2D extent) {
  VkViewport viewport{0, 0, float(extent.width), float(extent.height), 0, 1};
  VkRect2D scissor{{0, 0}, extent};
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &scissor);
}

// Tests that draw into small targets and read them back word by word.
class DrawTest : public OnDevice {
 protected:
  static constexpr VkExtent2D kSize{8, 8};
  static constexpr VkFormat kUint = VK_FORMAT_R32G32B32A32_UINT;
  static constexpr VkShaderStageFlags kGraphics = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

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
  std::vector<float> depths(const Image& image) { return valuesOf<float>(wordsOf(download(*work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4))); }
  Bytes stencils(const Image& image) { return download(*work, image, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1); }
  void clear(VkCommandBuffer commands, const Image& image, VkClearDepthStencilValue value) {
    VkImageSubresourceRange all{VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT, 0, 1, 0, 1};
    vkCmdClearDepthStencilImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &all);
    fullBarrier(commands);
  }
  // Word `component` of the pixel.
  uint32_t at(const Words& p, uint32_t x, uint32_t y, uint32_t component) { return p[(y * kSize.width + x) * 4 + component]; }
  VkPipelineLayout pushLayout() { return makePipelineLayout(*work, {}, 16, kGraphics); }
  void push(VkCommandBuffer commands, VkPipelineLayout layout, float x, float y, float z, float w) {
    float v[4] = {x, y, z, w};
    vkCmdPushConstants(commands, layout, kGraphics, 0, sizeof v, v);
  }

  // One pass of dynamic rendering: `draw` draws through `pipeline` into the upper left part of the target.
  void pass(VkCommandBuffer c, const VkRenderingInfo& info, VkPipeline pipeline, const std::function<void()>& draw, VkExtent2D part = kSize) {
    vkCmdBeginRendering(c, &info);
    wholeTarget(c, part);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    draw();
    vkCmdEndRendering(c);
    fullBarrier(c);
  }
  // The triangle over all of it, at depth `z`.
  void drawWhole(VkCommandBuffer c, VkPipelineLayout layout, float x = 0, float z = 0.5f) {
    push(c, layout, x, 0, 0, z);
    vkCmdDraw(c, 3, 1, 0, 0);
  }
  // A submission with one pass over `view`, which is cleared to the number `before`.
  void drawInto(VkImageView view, VkPipeline pipeline, const std::function<void(VkCommandBuffer)>& draw, uint32_t before = 0) {
    device().run([&](VkCommandBuffer c) {
      VkClearValue clear{};
      clear.color.uint32[0] = before;
      std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
      pass(c, renderingInfo(kSize, colors), pipeline, [&] { draw(c); });
    });
  }

  std::unique_ptr<Workspace> work;
};

}  // namespace pumice::cts
