// Questions to a driver's texture unit: a compute shader asks, storage buffers carry exact answers.
#pragma once

#include "cts_subset/tests/devices.h"

#include <glm/glm.hpp>


namespace pumice::cts {

template <typename T>
T structure(VkStructureType type) {
  T s{};
  s.sType = type;
  return s;
}

struct ViewSpec {
  VkImageViewType type = VK_IMAGE_VIEW_TYPE_2D;
  VkFormat format = VK_FORMAT_UNDEFINED;  // the image's
  VkImageAspectFlags aspect = 0;          // all of the image's
  uint32_t mip = 0, mips = VK_REMAINING_MIP_LEVELS;
  uint32_t layer = 0, layers = VK_REMAINING_ARRAY_LAYERS;
  VkImageUsageFlags usage = 0;            // 0: the image's
};

inline VkImageView makeView(Workspace& work, const Image& image, const ViewSpec& spec) {
  VkImageViewUsageCreateInfo usage{VK_STRUCTURE_TYPE_IMAGE_VIEW_USAGE_CREATE_INFO, nullptr, spec.usage};
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  if (spec.usage) info.pNext = &usage;
  info.image = image.handle;
  info.viewType = spec.type;
  info.format = spec.format ? spec.format : image.spec.format;
  info.subresourceRange = {spec.aspect ? spec.aspect : image.aspects, spec.mip, spec.mips, spec.layer, spec.layers};
  return work.make(info);
}

inline VkSamplerCreateInfo samplerInfo(VkFilter filter = VK_FILTER_NEAREST,
                                       VkSamplerAddressMode mode = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
                                       VkSamplerMipmapMode mipmaps = VK_SAMPLER_MIPMAP_MODE_NEAREST) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = filter;
  info.mipmapMode = mipmaps;
  info.addressModeU = info.addressModeV = info.addressModeW = mode;
  info.maxAnisotropy = 1;
  info.maxLod = VK_LOD_CLAMP_NONE;
  return info;
}

inline VkSampler makeSampler(Workspace& work, const VkSamplerCreateInfo& info) {
  return work.make(info);
}

inline Binding sampledBinding(VkImageView view, VkSampler sampler, VkImageLayout layout = VK_IMAGE_LAYOUT_GENERAL) {
  Binding b{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  b.image = {sampler, view, layout};
  return b;
}
inline Binding storageBinding(VkImageView view) {
  Binding b{VK_DESCRIPTOR_TYPE_STORAGE_IMAGE};
  b.image = {VK_NULL_HANDLE, view, VK_IMAGE_LAYOUT_GENERAL};
  return b;
}

// Runs `body` once for each question. In it: `vec4 q[]` are the questions (`perQuestion` vec4 each, `vec4 ask(int k)`),
// and it must set `vec4 answer` (or `uvec4 bits`, where `asBits`). `declarations` come before: bindings 2 and up are `bindings`.
inline std::vector<glm::vec4> probe(Workspace& work, const std::string& declarations, const std::string& body,
                                    const std::vector<Binding>& bindings, const std::vector<glm::vec4>& questions,
                                    uint32_t perQuestion = 1) {
  const uint32_t count = uint32_t(questions.size()) / perQuestion;
  Buffer in = work.bufferOf(questions, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  Buffer out = work.buffer(VkDeviceSize(count) * 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  std::vector<Binding> all(2, Binding{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER});
  all[0].buffer = {in.handle, 0, VK_WHOLE_SIZE};
  all[1].buffer = {out.handle, 0, VK_WHOLE_SIZE};
  all.insert(all.end(), bindings.begin(), bindings.end());

  VkDevice d = work.device.handle;
  VkShaderModule module = work.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 450
#extension GL_EXT_shader_image_load_formatted : enable
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer In { vec4 q[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Out { vec4 a[]; };
layout(push_constant) uniform Push { uint count; };
)" + declarations + "\nvec4 ask(int k) { return q[gl_GlobalInvocationID.x * " +
                                                                     std::to_string(perQuestion) + R"( + k]; }
void main() {
  if (gl_GlobalInvocationID.x >= count) return;
  vec4 answer = vec4(0);
)" + body + "\n  a[gl_GlobalInvocationID.x] = answer;\n}\n");

  std::vector<VkDescriptorSetLayoutBinding> layout;
  std::vector<VkDescriptorPoolSize> sizes;
  for (uint32_t i = 0; i < all.size(); ++i) {
    layout.push_back({i, all[i].type, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
    sizes.push_back({all[i].type, 1});
  }
  auto setInfo = structure<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  setInfo.bindingCount = uint32_t(layout.size());
  setInfo.pBindings = layout.data();
  VkDescriptorSetLayout setLayout = work.make(setInfo);
  auto poolInfo = structure<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  poolInfo.maxSets = 1;
  poolInfo.poolSizeCount = uint32_t(sizes.size());
  poolInfo.pPoolSizes = sizes.data();
  VkDescriptorPool pool = work.make(poolInfo);
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1, &setLayout};
  VkDescriptorSet set = VK_NULL_HANDLE;
  check(vkAllocateDescriptorSets(d, &allocate, &set), "vkAllocateDescriptorSets");
  for (uint32_t i = 0; i < all.size(); ++i) {
    auto write = structure<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
    write.dstSet = set;
    write.dstBinding = i;
    write.descriptorCount = 1;
    write.descriptorType = all[i].type;
    write.pBufferInfo = &all[i].buffer;
    write.pImageInfo = &all[i].image;
    write.pTexelBufferView = &all[i].texels;
    vkUpdateDescriptorSets(d, 1, &write, 0, nullptr);
  }
  VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, 4};
  auto layoutInfo = structure<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &setLayout;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &push;
  VkPipelineLayout pipelineLayout = work.make(layoutInfo);
  auto info = structure<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.layout = pipelineLayout;
  VkPipeline pipeline = work.make(info);
  work.device.run([&](VkCommandBuffer commands) {
    fullBarrier(commands);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelineLayout, 0, 1, &set, 0, nullptr);
    vkCmdPushConstants(commands, pipelineLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &count);
    vkCmdDispatch(commands, (count + 63) / 64, 1, 1);
    fullBarrier(commands);
  });
  std::vector<glm::vec4> answers(count);
  std::memcpy(answers.data(), out.mapped, size_t(count) * 16);
  return answers;
}

// Draws one triangle over the whole of a colour attachment in GENERAL, keeping what is there where nothing is drawn, or `points`
// points by a vertex shader of one's own.
struct Painting {
  VkExtent2D extent{};
  VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT;
  uint32_t layers = 1;
  std::string fragment;
  std::string vertex = "#version 450\nvoid main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1, 0.5, 1); }";
  bool blend = false;
  uint32_t points = 0;
  VkFormat attribute = VK_FORMAT_UNDEFINED;  // at location 0
  uint32_t stride = 0;
  VkBuffer vertices = VK_NULL_HANDLE;
};

inline void paint(Workspace& work, VkImageView view, VkFormat format, const Painting& p) {
  VkAttachmentDescription attachment{};
  attachment.format = format;
  attachment.samples = p.samples;
  attachment.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  attachment.initialLayout = attachment.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
  VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_GENERAL};
  VkSubpassDescription subpass{};
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  auto passInfo = structure<VkRenderPassCreateInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO);
  passInfo.attachmentCount = passInfo.subpassCount = 1;
  passInfo.pAttachments = &attachment;
  passInfo.pSubpasses = &subpass;
  VkRenderPass pass = work.make(passInfo);
  auto targetInfo = structure<VkFramebufferCreateInfo>(VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO);
  targetInfo.renderPass = pass;
  targetInfo.attachmentCount = 1;
  targetInfo.pAttachments = &view;
  targetInfo.width = p.extent.width;
  targetInfo.height = p.extent.height;
  targetInfo.layers = p.layers;
  VkFramebuffer target = work.make(targetInfo);
  auto layoutInfo = structure<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  VkPipelineLayout layout = work.make(layoutInfo);

  VkPipelineShaderStageCreateInfo stages[2] = {};
  for (int i = 0; i < 2; ++i) {
    stages[i].sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    stages[i].stage = i ? VK_SHADER_STAGE_FRAGMENT_BIT : VK_SHADER_STAGE_VERTEX_BIT;
    stages[i].module = work.shader(stages[i].stage, i ? p.fragment : p.vertex);
    stages[i].pName = "main";
  }
  VkVertexInputBindingDescription binding{0, p.stride, VK_VERTEX_INPUT_RATE_VERTEX};
  VkVertexInputAttributeDescription attribute{0, 0, p.attribute, 0};
  auto input = structure<VkPipelineVertexInputStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO);
  if (p.attribute) {
    input.vertexBindingDescriptionCount = input.vertexAttributeDescriptionCount = 1;
    input.pVertexBindingDescriptions = &binding;
    input.pVertexAttributeDescriptions = &attribute;
  }
  auto assembly = structure<VkPipelineInputAssemblyStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO);
  assembly.topology = p.points ? VK_PRIMITIVE_TOPOLOGY_POINT_LIST : VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  VkViewport viewport{0, 0, float(p.extent.width), float(p.extent.height), 0, 1};
  VkRect2D scissor{{0, 0}, p.extent};
  auto viewports = structure<VkPipelineViewportStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO);
  viewports.viewportCount = viewports.scissorCount = 1;
  viewports.pViewports = &viewport;
  viewports.pScissors = &scissor;
  auto raster = structure<VkPipelineRasterizationStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO);
  raster.lineWidth = 1;
  auto multisample = structure<VkPipelineMultisampleStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO);
  multisample.rasterizationSamples = p.samples;
  VkPipelineColorBlendAttachmentState blending{};
  blending.colorWriteMask = 0xf;
  blending.blendEnable = p.blend;
  blending.srcColorBlendFactor = blending.srcAlphaBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
  blending.dstColorBlendFactor = blending.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  auto colour = structure<VkPipelineColorBlendStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO);
  colour.attachmentCount = 1;
  colour.pAttachments = &blending;
  auto info = structure<VkGraphicsPipelineCreateInfo>(VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO);
  info.stageCount = 2;
  info.pStages = stages;
  info.pVertexInputState = &input;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &viewports;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &multisample;
  info.pColorBlendState = &colour;
  info.layout = layout;
  info.renderPass = pass;
  VkPipeline pipeline = work.make(info);
  work.device.run([&](VkCommandBuffer commands) {
    fullBarrier(commands);
    auto begin = structure<VkRenderPassBeginInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO);
    begin.renderPass = pass;
    begin.framebuffer = target;
    begin.renderArea = scissor;
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    VkDeviceSize zero = 0;
    if (p.vertices) vkCmdBindVertexBuffers(commands, 0, 1, &p.vertices, &zero);
    vkCmdDraw(commands, p.points ? p.points : 3, 1, 0, 0);
    vkCmdEndRenderPass(commands);
    fullBarrier(commands);
  });
}

}  // namespace pumice::cts
