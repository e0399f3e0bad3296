// A square colour target, a pass that clears and stores it, and a pipeline that draws into it.
#pragma once

#include "tests/icd/driver.h"

namespace pumice::icd::test {

std::vector<uint32_t> vertexShader(const char* glsl);
std::vector<uint32_t> fragmentShader(const char* glsl);
std::vector<uint32_t> computeShader(const char* glsl);

//! gl_VertexIndex 0, 1, 2: one triangle over everything.
extern const char* const kCoverAll;

struct GraphicsPipelineInfo {
  //! Points into itself: not copied.
  GraphicsPipelineInfo(VkShaderModule vertex, VkShaderModule fragment, VkPipelineLayout layout,
                       VkRenderPass pass, uint32_t subpass, VkExtent2D size);
  GraphicsPipelineInfo(const GraphicsPipelineInfo&) = delete;
  VkPipelineShaderStageCreateInfo stages[2]{};
  VkPipelineVertexInputStateCreateInfo input{};
  VkPipelineInputAssemblyStateCreateInfo assembly{};
  VkViewport viewport{};
  VkRect2D scissor{};
  VkPipelineViewportStateCreateInfo viewports{};
  VkPipelineRasterizationStateCreateInfo raster{};
  VkPipelineMultisampleStateCreateInfo multisample{};
  VkPipelineColorBlendAttachmentState attachment{};
  VkPipelineColorBlendStateCreateInfo blend{};
  VkGraphicsPipelineCreateInfo info{};
};

struct Target {
  Target(TestDevice& device, VkFormat format, VkExtent2D size,
         VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT, VkImageUsageFlags more = 0);
  ~Target();
  Target(const Target&) = delete;
  //! One attachment, `subpasses` subpasses that all draw into it. The first use clears.
  VkRenderPass pass(uint32_t subpasses = 1) const;
  VkFramebuffer framebuffer(VkRenderPass pass, bool imageless = false) const;
  VkPipelineLayout layout(uint32_t pushBytes = 0) const;
  VkPipeline pipeline(const std::vector<uint32_t>& vertex, const std::vector<uint32_t>& fragment,
                      VkPipelineLayout layout, VkRenderPass pass, uint32_t subpass = 0) const;
  //! Appends the copy of the target to a buffer of its size.
  void read(VkCommandBuffer commands, VkBuffer to) const;

  TestDevice& device;
  VkFormat format;
  VkExtent2D size;
  VkSampleCountFlagBits samples;
  VkImage image = VK_NULL_HANDLE;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  VkImageView view = VK_NULL_HANDLE;
};

}  // namespace pumice::icd::test
