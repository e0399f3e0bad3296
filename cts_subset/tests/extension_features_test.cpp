// What extensions add, on devices that enable one of them alone.
#include "cts_subset/tests/graphics.h"
#include "cts_subset/tests/one_extension.h"

namespace pumice::cts {
namespace {

class ExtensionFeatures : public OneExtensionTest {};

// Depths outside [0, 1] of a float format, from the viewport, the shader and clears.
TEST_P(ExtensionFeatures, DepthRangeUnrestricted) {
  PUMICE_NEED_FEATURE(available(VK_EXT_DEPTH_RANGE_UNRESTRICTED_EXTENSION_NAME) && device().vulkan13.dynamicRendering);
  VkPhysicalDeviceVulkan13Features wanted{};
  wanted.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
  wanted.dynamicRendering = VK_TRUE;
  for (bool enabled : {true, false}) {
    SCOPED_TRACE(enabled ? "enabled" : "not enabled");
    Workspace work(open(enabled ? VK_EXT_DEPTH_RANGE_UNRESTRICTED_EXTENSION_NAME : VK_KHR_DRIVER_PROPERTIES_EXTENSION_NAME, &wanted));
    ImageSpec image;
    image.format = VK_FORMAT_D32_SFLOAT;
    image.extent = {8, 8, 1};
    image.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
    Image target = work.image(image);
    toGeneral(work, target);
    VkImageView view = work.view(target);
    VkPipelineLayout layout = makePipelineLayout(work, {}, 16, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT);
    GraphicsSpec spec;
    spec.depth = image.format;
    spec.depthTest = true;
    VkPipeline fromViewport = makeGraphics(work, layout, spec);
    spec.fragment = "#version 460\nvoid main() { gl_FragDepth = gl_FragCoord.y < 2 ? -3.5 : 7.25; }\n";
    VkPipeline fromShader = makeGraphics(work, layout, spec);
    work.device.run([&](VkCommandBuffer c) {
      VkClearValue clear{};
      clear.depthStencil.depth = enabled ? 100.0f : 1.0f;
      VkRenderingAttachmentInfo depth = rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear);
      VkRenderingInfo info = renderingInfo({8, 8}, {});
      info.pDepthAttachment = &depth;
      vkCmdBeginRendering(c, &info);
      auto draw = [&](VkPipeline pipeline, int x, float low, float high) {
        vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        VkViewport viewport{0, 0, 8, 8, low, high};
        VkRect2D scissor{{x, 0}, {2, 8}};
        vkCmdSetViewport(c, 0, 1, &viewport);
        vkCmdSetScissor(c, 0, 1, &scissor);
        float given[4] = {0, 0, 0, 0.25f};
        vkCmdPushConstants(c, layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof given, given);
        vkCmdDraw(c, 3, 1, 0, 0);
      };
      draw(fromShader, 0, enabled ? -10.0f : 0.0f, enabled ? 10.0f : 1.0f);
      if (enabled) {
        draw(fromViewport, 2, 2, 6);
        draw(fromViewport, 4, -4, -20);
      }
      vkCmdEndRendering(c);
      fullBarrier(c);
    });
    std::vector<float> depth = valuesOf<float>(wordsOf(download(work, target, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)));
    if (enabled) {
      EXPECT_EQ(depth[1], -3.5f);
      EXPECT_EQ(depth[4 * 8 + 1], 7.25f);
      EXPECT_EQ(depth[2], 3.0f);
      EXPECT_EQ(depth[4], -8.0f);
      EXPECT_EQ(depth[7], 100.0f);
    } else {
      EXPECT_EQ(depth[1], 0.0f);
      EXPECT_EQ(depth[4 * 8 + 1], 1.0f) << "of 7.25, and so not less than what was there";
    }
  }
}

PUMICE_ON_BOTH_DEVICES(ExtensionFeatures);

}  // namespace
}  // namespace pumice::cts
