// Samples of one pixel with different contents: drawn through a sample mask, read one by one in a shader,
// resolved.
#include <gtest/gtest.h>

#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

TEST(Multisample, EachSampleIsDrawnFetchedAndResolved) {
  constexpr VkExtent2D kSize{13, 9};
  constexpr uint32_t kPixels = kSize.width * kSize.height;
  TestDevice device;
  Target target(device, VK_FORMAT_R8G8B8A8_UNORM, kSize, VK_SAMPLE_COUNT_4_BIT, VK_IMAGE_USAGE_SAMPLED_BIT);
  Target resolved(device, VK_FORMAT_R8G8B8A8_UNORM, kSize, VK_SAMPLE_COUNT_1_BIT,
                  VK_IMAGE_USAGE_TRANSFER_DST_BIT);
  TestDevice::Buffer fetched = device.buffer(kPixels * 4 * 4), pixels = device.buffer(kPixels * 4);
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipelineLayout layout = target.layout();
  VkShaderModule vertex = device.module(vertexShader(kCoverAll));
  VkShaderModule fragment = device.module(fragmentShader(
      "#version 450\nlayout(location = 0) out vec4 c; void main() { c = vec4(1, 0, 0, 1); }\n"));
  GraphicsPipelineInfo info(vertex, fragment, layout, pass, 0, kSize);
  VkSampleMask mask = 0b0110;
  info.multisample.rasterizationSamples = VK_SAMPLE_COUNT_4_BIT;
  info.multisample.pSampleMask = &mask;
  VkPipeline draw = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateGraphicsPipelines)(device.handle, VK_NULL_HANDLE, 1, &info.info, nullptr, &draw),
            VK_SUCCESS);

  VkDescriptorSetLayoutBinding bindings[] = {
      {0, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr},
      {1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr}};
  VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 2,
                                          bindings};
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateDescriptorSetLayout)(device.handle, &setInfo, nullptr, &setLayout), VK_SUCCESS);
  VkPipelineLayoutCreateInfo layoutInfo{
      VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout, 0, nullptr};
  VkPipelineLayout computeLayout = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreatePipelineLayout)(device.handle, &layoutInfo, nullptr, &computeLayout), VK_SUCCESS);
  VkShaderModule compute = device.module(computeShader(R"(#version 450
layout(local_size_x = 4) in;
layout(set = 0, binding = 0) uniform sampler2DMS image;
layout(set = 0, binding = 1) buffer B { uint v[]; };
void main() {
  uvec3 g = gl_WorkGroupID;
  uint s = gl_LocalInvocationID.x;
  v[(g.y * 13u + g.x) * 4u + s] = packUnorm4x8(texelFetch(image, ivec2(g.xy), int(s)));
}
)"));
  VkComputePipelineCreateInfo computeInfo{};
  computeInfo.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  computeInfo.stage = info.stages[0];
  computeInfo.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  computeInfo.stage.module = compute;
  computeInfo.layout = computeLayout;
  VkPipeline fetch = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateComputePipelines)(device.handle, VK_NULL_HANDLE, 1, &computeInfo, nullptr, &fetch),
            VK_SUCCESS);
  VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1},
                                  {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1}};
  VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 2, sizes};
  VkDescriptorPool pool = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateDescriptorPool)(device.handle, &poolInfo, nullptr, &pool), VK_SUCCESS);
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1,
                                       &setLayout};
  VkDescriptorSet set = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &allocate, &set), VK_SUCCESS);
  VkSamplerCreateInfo samplerInfo{};
  samplerInfo.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  VkSampler sampler = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateSampler)(device.handle, &samplerInfo, nullptr, &sampler), VK_SUCCESS);
  VkDescriptorImageInfo imageInfo{sampler, target.view, VK_IMAGE_LAYOUT_GENERAL};
  VkDescriptorBufferInfo bufferInfo{fetched.handle, 0, VK_WHOLE_SIZE};
  VkWriteDescriptorSet writes[] = {{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set, 0, 0, 1,
                                    VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, &imageInfo, nullptr, nullptr},
                                   {VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set, 1, 0, 1,
                                    VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, nullptr, &bufferInfo, nullptr}};
  VK(vkUpdateDescriptorSets)(device.handle, 2, writes, 0, nullptr);

  VkCommandBuffer commands = device.begin();
  VkClearValue clear{{{0, 0, 1, 1}}};
  VkRenderPassBeginInfo begin{
      VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, kSize}, 1, &clear};
  VK(vkCmdBeginRenderPass)(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw);
  VK(vkCmdDraw)(commands, 3, 1, 0, 0);
  VK(vkCmdEndRenderPass)(commands);
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, fetch);
  VK(vkCmdBindDescriptorSets)
  (commands, VK_PIPELINE_BIND_POINT_COMPUTE, computeLayout, 0, 1, &set, 0, nullptr);
  VK(vkCmdDispatch)(commands, kSize.width, kSize.height, 1);
  VkImageSubresourceLayers layers{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  VkImageResolve region{layers, {0, 0, 0}, layers, {0, 0, 0}, {kSize.width, kSize.height, 1}};
  VK(vkCmdResolveImage)
  (commands, target.image, VK_IMAGE_LAYOUT_GENERAL, resolved.image, VK_IMAGE_LAYOUT_GENERAL, 1, &region);
  resolved.read(commands, pixels.handle);
  device.run(commands);
  constexpr uint32_t kRed = 0xff0000ff, kBlue = 0xffff0000;
  for (uint32_t i = 0; i < kPixels; i++) {
    for (uint32_t s = 0; s < 4; s++)
      ASSERT_EQ(fetched.words[i * 4 + s], mask >> s & 1 ? kRed : kBlue) << "pixel " << i << " sample " << s;
    // 127.5 rounds either way.
    for (uint32_t shift : {0u, 16u})
      ASSERT_NEAR(pixels.words[i] >> shift & 0xff, 127.5, 0.6) << "pixel " << i;
    ASSERT_EQ(pixels.words[i] & 0xff00ff00, 0xff000000u);
  }
  VK(vkDestroySampler)(device.handle, sampler, nullptr);
  VK(vkDestroyDescriptorPool)(device.handle, pool, nullptr);
  for (VkPipeline p : {draw, fetch}) VK(vkDestroyPipeline)(device.handle, p, nullptr);
  for (VkShaderModule m : {vertex, fragment, compute}) VK(vkDestroyShaderModule)(device.handle, m, nullptr);
  for (VkPipelineLayout l : {layout, computeLayout}) VK(vkDestroyPipelineLayout)(device.handle, l, nullptr);
  VK(vkDestroyDescriptorSetLayout)(device.handle, setLayout, nullptr);
  VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
  device.release(fetched);
  device.release(pixels);
}

}  // namespace
}  // namespace pumice::icd::test
