#include "cts_subset/harness/canvas.h"

#include <array>

namespace pumice::cts {

const char* const kPassVertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
void main() { gl_Position = position; passed = given; }
)";

const char* const kPassVertexAffine = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) noperspective out vec4 passed;
void main() { gl_Position = position; passed = given; }
)";

const char* const kColourFragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = passed; }
)";

Canvas::Canvas(Device& d, uint32_t w, uint32_t h, VkFormat depthFormatWanted,
               VkSampleCountFlagBits samplesWanted, VkAttachmentStoreOp storeDepth)
    : Workspace(d), width(w), height(h), depthFormat(depthFormatWanted), samples(samplesWanted) {
  bool hasDepth = depthFormat != VK_FORMAT_UNDEFINED, resolves = samples != VK_SAMPLE_COUNT_1_BIT;
  ImageSpec spec;
  spec.format = kColourFormat;
  spec.extent = {width, height, 1};
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  colour = image(spec);
  std::vector<VkImageView> views{view(colour)};
  spec.samples = samples;
  if (resolves) {  // drawn to the first view, resolved to the last
    spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSIENT_ATTACHMENT_BIT;
    views.insert(views.begin(), view(image(spec)));
  }
  if (hasDepth) {
    spec.format = depthFormat;
    spec.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    depth = image(spec);
    views.insert(views.begin() + 1, view(depth));
  }

  std::vector<VkAttachmentDescription> attachments(1);
  attachments[0].format = kColourFormat;
  attachments[0].samples = samples;
  attachments[0].loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  attachments[0].storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachments[0].stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  attachments[0].stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  attachments[0].initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  attachments[0].finalLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  if (hasDepth) {
    attachments.push_back(attachments[0]);
    attachments[1].format = depthFormat;
    attachments[1].storeOp = storeDepth;
    attachments[1].stencilLoadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  }
  if (resolves) {
    attachments.push_back(attachments[0]);
    attachments.back().samples = VK_SAMPLE_COUNT_1_BIT;
    attachments.back().loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    attachments[0].storeOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    attachments[0].finalLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
  }
  VkAttachmentReference colourRef{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkAttachmentReference resolveRef{uint32_t(attachments.size()) - 1,
                                   VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkAttachmentReference depthRef{1, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &colourRef;
  subpass.pResolveAttachments = resolves ? &resolveRef : nullptr;
  subpass.pDepthStencilAttachment = hasDepth ? &depthRef : nullptr;
  std::array<VkSubpassDependency, 2> dependencies{};
  dependencies[0].srcSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[0].srcStageMask = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
  dependencies[0].dstStageMask = VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT;
  dependencies[0].srcAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  dependencies[0].dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  dependencies[1] = dependencies[0];
  dependencies[1].srcStageMask = VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT;
  dependencies[1].dstStageMask = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
  dependencies[1].srcSubpass = 0;
  dependencies[1].dstSubpass = VK_SUBPASS_EXTERNAL;
  VkRenderPassCreateInfo passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  passInfo.attachmentCount = uint32_t(attachments.size());
  passInfo.pAttachments = attachments.data();
  passInfo.subpassCount = 1;
  passInfo.pSubpasses = &subpass;
  passInfo.dependencyCount = uint32_t(dependencies.size());
  passInfo.pDependencies = dependencies.data();
  renderPass = make(passInfo);

  framebuffer = framebufferOf(renderPass, views, {width, height});

  readback = buffer(VkDeviceSize(width) * height * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  if (hasDepth) depthReadback = buffer(VkDeviceSize(width) * height * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
}

VkResult Canvas::tryPipeline(const PipelineSpec& spec, VkShaderModule vertex, VkShaderModule fragment,
                             Pipeline& made) {
  VkDevice v = device.handle;
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = uint32_t(spec.sets.size());
  layoutInfo.pSetLayouts = spec.sets.data();
  layoutInfo.pushConstantRangeCount = uint32_t(spec.pushConstants.size());
  layoutInfo.pPushConstantRanges = spec.pushConstants.data();
  made.layout = make(layoutInfo);

  std::array<VkPipelineShaderStageCreateInfo, 2> stages{};
  stages[0].sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  stages[0].stage = VK_SHADER_STAGE_VERTEX_BIT;
  stages[0].module = vertex;
  stages[0].pName = "main";
  stages[1] = stages[0];
  stages[1].stage = VK_SHADER_STAGE_FRAGMENT_BIT;
  stages[1].module = fragment;
  stages[1].pSpecializationInfo = spec.fragmentSpecialization;

  std::vector<VkVertexInputBindingDescription> bindings = spec.bindings;
  std::vector<VkVertexInputAttributeDescription> attributes = spec.attributes;
  if (bindings.empty()) {
    bindings = {{0, sizeof(Vertex), VK_VERTEX_INPUT_RATE_VERTEX}};
    attributes = {{0, 0, VK_FORMAT_R32G32B32A32_SFLOAT, offsetof(Vertex, position)},
                  {1, 0, VK_FORMAT_R32G32B32A32_SFLOAT, offsetof(Vertex, attribute)}};
  }
  VkPipelineVertexInputStateCreateInfo input{};
  input.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
  input.vertexBindingDescriptionCount = uint32_t(bindings.size());
  input.pVertexBindingDescriptions = bindings.data();
  input.vertexAttributeDescriptionCount = uint32_t(attributes.size());
  input.pVertexAttributeDescriptions = attributes.data();
  VkPipelineInputAssemblyStateCreateInfo assembly{};
  assembly.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
  assembly.topology = spec.topology;
  assembly.primitiveRestartEnable = spec.primitiveRestart;
  PipelineStates states;
  VkPipelineViewportStateCreateInfo& viewport = states.viewport;
  viewport.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
  viewport.viewportCount = viewport.scissorCount = 1;
  VkPipelineRasterizationStateCreateInfo& raster = states.raster;
  raster.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
  raster.polygonMode = VK_POLYGON_MODE_FILL;
  raster.cullMode = spec.cull;
  raster.frontFace = spec.frontFace;
  raster.lineWidth = 1;
  if (spec.depthBias) {
    raster.depthBiasEnable = VK_TRUE;
    raster.depthBiasConstantFactor = spec.depthBias->x;
    raster.depthBiasSlopeFactor = spec.depthBias->y;
  }
  VkPipelineMultisampleStateCreateInfo& multisample = states.multisample;
  multisample.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
  multisample.rasterizationSamples = samples;
  VkPipelineDepthStencilStateCreateInfo& depthState = states.depth;
  depthState.sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO;
  depthState.depthTestEnable = spec.depthTest;
  depthState.depthWriteEnable = spec.depthWrite;
  depthState.depthCompareOp = spec.compare;
  depthState.maxDepthBounds = 1;
  if (spec.stencil) {
    depthState.stencilTestEnable = VK_TRUE;
    depthState.front = depthState.back = *spec.stencil;
  }
  VkPipelineColorBlendAttachmentState attachment{};
  if (spec.blend) attachment = *spec.blend;
  attachment.colorWriteMask = spec.writeMask;
  VkPipelineColorBlendStateCreateInfo& blend = states.blend;
  blend.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
  blend.attachmentCount = 1;
  blend.pAttachments = &attachment;
  states.renderPass = renderPass;
  if (spec.adjust) spec.adjust(states);
  const VkDynamicState kDynamic[] = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
  VkPipelineDynamicStateCreateInfo dynamic{};
  dynamic.sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO;
  dynamic.dynamicStateCount = 2;
  dynamic.pDynamicStates = kDynamic;

  VkGraphicsPipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
  info.stageCount = uint32_t(stages.size());
  info.pStages = stages.data();
  info.pVertexInputState = &input;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &viewport;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &multisample;
  info.pDepthStencilState = &depthState;
  info.pColorBlendState = &blend;
  info.pDynamicState = &dynamic;
  info.layout = made.layout;
  info.renderPass = states.renderPass;
  info.subpass = states.subpass;
  VkResult result = vkCreateGraphicsPipelines(v, device.pipelineCache, 1, &info, nullptr, &made.handle);
  if (result == VK_SUCCESS) onDestroy([v, p = made.handle] { vkDestroyPipeline(v, p, nullptr); });
  return result;
}

Pipeline Canvas::pipeline(const PipelineSpec& spec) {
  Pipeline made;
  check(tryPipeline(spec, shader(VK_SHADER_STAGE_VERTEX_BIT, spec.vertex),
                    shader(VK_SHADER_STAGE_FRAGMENT_BIT, spec.fragment), made),
        "vkCreateGraphicsPipelines");
  return made;
}

Picture Canvas::draw(const glm::vec4& clearColour, const std::function<void(VkCommandBuffer)>& record,
                     bool showDepth, float clearDepth) {
  std::array<VkClearValue, 2> clears{};
  clears[0].color = {{clearColour.r, clearColour.g, clearColour.b, clearColour.a}};
  clears[1].depthStencil = {clearDepth, 0};
  device.run([&](VkCommandBuffer commands) {
    VkRenderPassBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
    begin.renderPass = renderPass;
    begin.framebuffer = framebuffer;
    begin.renderArea = {{0, 0}, {width, height}};
    begin.clearValueCount = depthFormat == VK_FORMAT_UNDEFINED ? 1 : 2;
    begin.pClearValues = clears.data();
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    setViewport(commands, 0, 0, float(width), float(height));
    setScissor(commands, 0, 0, width, height);
    record(commands);
    vkCmdEndRenderPass(commands);

    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {width, height, 1};
    vkCmdCopyImageToBuffer(commands, colour.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, readback.handle, 1,
                           &region);
    if (showDepth) {
      region.imageSubresource.aspectMask = VK_IMAGE_ASPECT_DEPTH_BIT;
      vkCmdCopyImageToBuffer(commands, depth.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                             depthReadback.handle, 1, &region);
    }
    fullBarrier(commands);
  });
  Picture picture(width, height);
  std::memcpy(picture.rgba.data(), readback.mapped, picture.rgba.size());
  if (showDepth) picture.depth = unpackDepth(depthReadback);
  return picture;
}

std::vector<float> Canvas::unpackDepth(const Buffer& bytes) const {
  std::vector<float> out(size_t(width) * height);
  for (size_t i = 0; i < out.size(); ++i) {
    uint32_t word = 0;
    if (depthFormat == VK_FORMAT_D16_UNORM) {
      std::memcpy(&word, bytes.mapped + i * 2, 2);
      out[i] = float(word / 65535.0);
    } else if (depthFormat == VK_FORMAT_D32_SFLOAT || depthFormat == VK_FORMAT_D32_SFLOAT_S8_UINT) {
      std::memcpy(&out[i], bytes.mapped + i * 4, 4);
    } else {  // 24 bits, the upper eight undefined
      std::memcpy(&word, bytes.mapped + i * 4, 4);
      out[i] = float((word & 0xffffff) / 16777215.0);
    }
  }
  return out;
}

void Canvas::bindVertices(VkCommandBuffer commands, const std::vector<Vertex>& vertices) {
  Buffer made = bufferOf(vertices, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  VkDeviceSize offset = 0;
  vkCmdBindVertexBuffers(commands, 0, 1, &made.handle, &offset);
}

void Canvas::drawVertices(VkCommandBuffer commands, const Pipeline& pipeline,
                          const std::vector<Vertex>& vertices) {
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
  bindVertices(commands, vertices);
  vkCmdDraw(commands, uint32_t(vertices.size()), 1, 0, 0);
}

void setViewport(VkCommandBuffer commands, float x, float y, float width, float height, float minDepth,
                 float maxDepth) {
  VkViewport viewport{x, y, width, height, minDepth, maxDepth};
  vkCmdSetViewport(commands, 0, 1, &viewport);
}

void setScissor(VkCommandBuffer commands, int32_t x, int32_t y, uint32_t width, uint32_t height) {
  VkRect2D rectangle{{x, y}, {width, height}};
  vkCmdSetScissor(commands, 0, 1, &rectangle);
}

glm::vec4 atPixel(const glm::uvec2& canvas, double x, double y, float z) {
  return {float(x / canvas.x * 2 - 1), float(y / canvas.y * 2 - 1), z, 1.0f};
}

}  // namespace pumice::cts
