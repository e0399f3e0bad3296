// What extensions add, on devices that enable one of them alone.
#include "cts_subset/tests/graphics.h"
#include "cts_subset/tests/one_extension.h"

namespace pumice::cts {
namespace {

class ExtensionFeatures : public OneExtensionTest {};

TEST_P(ExtensionFeatures, ShaderClock) {
  PUMICE_NEED_FEATURE(available(VK_KHR_SHADER_CLOCK_EXTENSION_NAME) && device().features.shaderInt64);
  auto wanted = features<VkPhysicalDeviceShaderClockFeaturesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_CLOCK_FEATURES_KHR);
  PUMICE_NEED_FEATURE(wanted.shaderSubgroupClock && wanted.shaderDeviceClock);
  VkPhysicalDeviceMaintenance4Features localSizeIds{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_FEATURES, nullptr, VK_TRUE};
  wanted.pNext = &localSizeIds;
  VkPhysicalDeviceFeatures core{};
  core.shaderInt64 = VK_TRUE;
  std::vector<uint64_t> r = valuesOf<uint64_t>(runCompute(open(VK_KHR_SHADER_CLOCK_EXTENSION_NAME, &wanted, core), R"(
#extension GL_ARB_gpu_shader_int64 : require
#extension GL_ARB_shader_clock : require
#extension GL_EXT_shader_realtime_clock : require
layout(local_size_x = 64) in;
layout(binding = 1) buffer Out { uint64_t r[]; };
uint busy(uint x) { for (int i = 0; i < 20000; i++) x = x * 1664525u + 1013904223u; return x; }
void main() {
  uint i = gl_LocalInvocationIndex, o = i * 5;
  uint64_t t0 = clockRealtimeEXT(), s0 = clockARB();
  r[o + 4] = busy(i);
  uvec2 s1 = clock2x32ARB(), t1 = clockRealtime2x32EXT();
  r[o] = t0; r[o + 1] = uint64_t(t1.y) << 32 | t1.x; r[o + 2] = s0; r[o + 3] = uint64_t(s1.y) << 32 | s1.x;
})", Words(1), 64 * 10));
  for (uint32_t i = 0; i < 64; i++) {
    EXPECT_LT(r[i * 5], r[i * 5 + 1]) << i;
    EXPECT_LT(r[i * 5 + 2], r[i * 5 + 3]) << i;
  }
}

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

// As many sets as there may be, each with a buffer of its own.
TEST_P(ExtensionFeatures, AllDescriptorSets) {
  const uint32_t sets = std::min(device().properties.limits.maxBoundDescriptorSets, 32u);
  if (GetParam() == Role::kTested) {
    EXPECT_EQ(sets, 32u);
  }
  Workspace work(device());
  std::string shader = "#version 460\nlayout(local_size_x = 1) in;\nlayout(set = 0, binding = 1) buffer Out { uint r[]; };\n", body;
  for (uint32_t i = 0; i < sets; i++) {
    const std::string n = std::to_string(i);
    shader += "layout(set = " + n + ", binding = 0) readonly buffer B" + n + " { uint v; } b" + n + ";\n";
    body += "  r[" + n + "] = b" + n + ".v;\n";
  }
  VkDescriptorSetLayout one = makeSetLayout(work, {computeBinding(0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)});
  VkPipelineLayout layout = makePipelineLayout(work, std::vector<VkDescriptorSetLayout>(sets, one));
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, shader + "void main() {\n" + body + "}\n", ShaderTarget::kVulkan13), layout);
  VkDescriptorPool pool = makePool(work, {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2 * sets}}, sets);
  Buffer out = work.bufferOf(Words(sets, 0), kStorage);
  std::vector<VkDescriptorSet> all;
  for (uint32_t i = 0; i < sets; i++) {
    all.push_back(makeSet(work, pool, one));
    Buffer in = work.bufferOf(Words{1000 + i}, kStorage);
    VkDescriptorBufferInfo infos[2] = {{in.handle, 0, VK_WHOLE_SIZE}, {out.handle, 0, VK_WHOLE_SIZE}};
    VkWriteDescriptorSet writes[2] = {writeBuffer(all[i], 0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[0]),
                                      writeBuffer(all[i], 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[1])};
    vkUpdateDescriptorSets(work.device.handle, 2, writes, 0, nullptr);
  }
  work.device.run([&](VkCommandBuffer c) {
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, sets - 1, all.data(), 0, nullptr);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, sets - 1, 1, &all[sets - 1], 0, nullptr);
    vkCmdDispatch(c, 1, 1, 1);
    fullBarrier(c);
  });
  Words found(sets), expected;
  std::memcpy(found.data(), out.mapped, sets * 4);
  for (uint32_t i = 0; i < sets; i++) expected.push_back(1000 + i);
  expect(found, expected);
}

PUMICE_ON_BOTH_DEVICES(ExtensionFeatures);

}  // namespace
}  // namespace pumice::cts
