#include "bench/scenes/passes.h"

#include <array>

namespace pumice::bench {

using cts::check;

Target makeTarget(cts::Workspace& workspace, uint32_t width, uint32_t height, VkFormat format) {
  const bool isColour = cts::aspectsOf(format) == VK_IMAGE_ASPECT_COLOR_BIT;
  Target target;
  cts::ImageSpec spec;
  spec.format = format;
  spec.extent = {width, height, 1};
  spec.usage = VK_IMAGE_USAGE_SAMPLED_BIT |
               (isColour ? VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT : VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT);
  target.image = workspace.image(spec);
  target.view = workspace.view(target.image);

  VkAttachmentDescription attachment{};
  attachment.format = format;
  attachment.samples = VK_SAMPLE_COUNT_1_BIT;
  attachment.loadOp = isColour ? VK_ATTACHMENT_LOAD_OP_DONT_CARE : VK_ATTACHMENT_LOAD_OP_CLEAR;
  attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  attachment.finalLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
  VkAttachmentReference reference{0, isColour ? VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL
                                              : VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = isColour;
  subpass.pColorAttachments = isColour ? &reference : nullptr;
  subpass.pDepthStencilAttachment = isColour ? nullptr : &reference;
  const VkPipelineStageFlags written =
      isColour ? VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT
               : VK_PIPELINE_STAGE_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT;
  const VkAccessFlags access = isColour ? VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT
                                        : VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
  std::array<VkSubpassDependency, 2> dependencies{};
  dependencies[0] = {VK_SUBPASS_EXTERNAL, 0, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, written, VK_ACCESS_SHADER_READ_BIT, access, 0};
  dependencies[1] = {0, VK_SUBPASS_EXTERNAL, written, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, access, VK_ACCESS_SHADER_READ_BIT, 0};
  VkRenderPassCreateInfo passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  passInfo.attachmentCount = passInfo.subpassCount = 1;
  passInfo.pAttachments = &attachment;
  passInfo.pSubpasses = &subpass;
  passInfo.dependencyCount = uint32_t(dependencies.size());
  passInfo.pDependencies = dependencies.data();
  target.pass = workspace.make(passInfo);

  target.framebuffer = workspace.framebufferOf(target.pass, {target.view}, {width, height});
  return target;
}

}  // namespace pumice::bench
