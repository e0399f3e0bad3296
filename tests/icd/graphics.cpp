#include "tests/icd/graphics.h"

#include <gtest/gtest.h>

#include "tests/frontend/compile.h"

namespace pumice::icd::test {
namespace {

std::vector<uint32_t> compile(frontend::test::GlslStage stage, const char* glsl) {
  std::string log;
  std::vector<uint32_t> words = frontend::test::compileGlsl(stage, glsl, &log, true);
  EXPECT_FALSE(words.empty()) << log;
  return words;
}

}  // namespace

std::vector<uint32_t> vertexShader(const char* glsl) {
  return compile(frontend::test::GlslStage::Vertex, glsl);
}
std::vector<uint32_t> fragmentShader(const char* glsl) {
  return compile(frontend::test::GlslStage::Fragment, glsl);
}
std::vector<uint32_t> computeShader(const char* glsl) {
  return compile(frontend::test::GlslStage::Compute, glsl);
}

const char* const kCoverAll = R"(#version 450
void main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.5, 1.0); }
)";

GraphicsPipelineInfo::GraphicsPipelineInfo(VkShaderModule vertex, VkShaderModule fragment,
                                           VkPipelineLayout layout, VkRenderPass pass, uint32_t subpass,
                                           VkExtent2D size) {
  for (int i = 0; i < 2; i++) {
    stages[i].sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    stages[i].stage = i ? VK_SHADER_STAGE_FRAGMENT_BIT : VK_SHADER_STAGE_VERTEX_BIT;
    stages[i].module = i ? fragment : vertex;
    stages[i].pName = "main";
  }
  input.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
  assembly.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
  assembly.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  viewport = {0, 0, float(size.width), float(size.height), 0, 1};
  scissor = {{0, 0}, size};
  viewports.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
  viewports.viewportCount = viewports.scissorCount = 1;
  viewports.pViewports = &viewport;
  viewports.pScissors = &scissor;
  raster.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
  raster.polygonMode = VK_POLYGON_MODE_FILL;
  raster.lineWidth = 1;
  multisample.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
  multisample.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
  attachment.colorWriteMask = 15;
  blend.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
  blend.attachmentCount = 1;
  blend.pAttachments = &attachment;
  info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
  info.stageCount = 2;
  info.pStages = stages;
  info.pVertexInputState = &input;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &viewports;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &multisample;
  info.pColorBlendState = &blend;
  info.layout = layout;
  info.renderPass = pass;
  info.subpass = subpass;
}

Target::Target(TestDevice& d, VkFormat f, VkExtent2D s, VkSampleCountFlagBits n, VkImageUsageFlags more)
    : device(d), format(f), size(s), samples(n) {
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = format;
  info.extent = {size.width, size.height, 1};
  info.mipLevels = info.arrayLayers = 1;
  info.samples = samples;
  info.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | more;
  EXPECT_EQ(VK(vkCreateImage)(device.handle, &info, nullptr, &image), VK_SUCCESS);
  VkMemoryRequirements needs;
  VK(vkGetImageMemoryRequirements)(device.handle, image, &needs);
  memory = device.allocate(needs.size);
  EXPECT_EQ(VK(vkBindImageMemory)(device.handle, image, memory, 0), VK_SUCCESS);
  VkImageViewCreateInfo viewInfo{};
  viewInfo.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  viewInfo.image = image;
  viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D;
  viewInfo.format = format;
  viewInfo.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  EXPECT_EQ(VK(vkCreateImageView)(device.handle, &viewInfo, nullptr, &view), VK_SUCCESS);
}

Target::~Target() {
  VK(vkDestroyImageView)(device.handle, view, nullptr);
  VK(vkDestroyImage)(device.handle, image, nullptr);
  VK(vkFreeMemory)(device.handle, memory, nullptr);
}

VkRenderPass Target::pass(uint32_t count) const {
  VkAttachmentDescription attachment{0,
                                     format,
                                     samples,
                                     VK_ATTACHMENT_LOAD_OP_CLEAR,
                                     VK_ATTACHMENT_STORE_OP_STORE,
                                     VK_ATTACHMENT_LOAD_OP_DONT_CARE,
                                     VK_ATTACHMENT_STORE_OP_DONT_CARE,
                                     VK_IMAGE_LAYOUT_UNDEFINED,
                                     VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL};
  VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  std::vector<VkSubpassDescription> subpasses(count, subpass);
  VkRenderPassCreateInfo info{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO,
                              nullptr,
                              0,
                              1,
                              &attachment,
                              count,
                              subpasses.data(),
                              0,
                              nullptr};
  VkRenderPass pass = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreateRenderPass)(device.handle, &info, nullptr, &pass), VK_SUCCESS);
  return pass;
}

VkFramebuffer Target::framebuffer(VkRenderPass pass, bool imageless) const {
  VkFramebufferAttachmentImageInfo image{};
  image.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_ATTACHMENT_IMAGE_INFO;
  image.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  image.width = size.width;
  image.height = size.height;
  image.layerCount = 1;
  image.viewFormatCount = 1;
  image.pViewFormats = &format;
  VkFramebufferAttachmentsCreateInfo images{VK_STRUCTURE_TYPE_FRAMEBUFFER_ATTACHMENTS_CREATE_INFO, nullptr, 1,
                                            &image};
  VkFramebufferCreateInfo info{
      VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, pass, 1, &view, size.width, size.height, 1};
  if (imageless)
    info.pNext = &images, info.flags = VK_FRAMEBUFFER_CREATE_IMAGELESS_BIT, info.pAttachments = nullptr;
  VkFramebuffer framebuffer = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreateFramebuffer)(device.handle, &info, nullptr, &framebuffer), VK_SUCCESS);
  return framebuffer;
}

VkPipelineLayout Target::layout(uint32_t pushBytes) const {
  VkPushConstantRange range{VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, pushBytes};
  VkPipelineLayoutCreateInfo info{
      VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 0, nullptr, pushBytes ? 1u : 0u, &range};
  VkPipelineLayout layout = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreatePipelineLayout)(device.handle, &info, nullptr, &layout), VK_SUCCESS);
  return layout;
}

VkPipeline Target::pipeline(const std::vector<uint32_t>& vertex, const std::vector<uint32_t>& fragment,
                            VkPipelineLayout layout, VkRenderPass pass, uint32_t subpass) const {
  VkShaderModule v = device.module(vertex), f = device.module(fragment);
  GraphicsPipelineInfo info(v, f, layout, pass, subpass, size);
  VkPipeline pipeline = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreateGraphicsPipelines)(device.handle, VK_NULL_HANDLE, 1, &info.info, nullptr, &pipeline),
            VK_SUCCESS);
  VK(vkDestroyShaderModule)(device.handle, v, nullptr);
  VK(vkDestroyShaderModule)(device.handle, f, nullptr);
  return pipeline;
}

void Target::read(VkCommandBuffer commands, VkBuffer to) const {
  VkBufferImageCopy copy{
      0, 0, 0, {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1}, {0, 0, 0}, {size.width, size.height, 1}};
  VK(vkCmdCopyImageToBuffer)(commands, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to, 1, &copy);
}

}  // namespace pumice::icd::test
