#include "tests/icd/dispatch.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace pumice::icd::test {

void dispatch(TestDevice& device, const std::vector<uint32_t>& spirv, uint32_t groups, const std::function<void(TestDevice&, VkCommandBuffer)>& finish,
              VkDeviceSize bytes, uint32_t** words) {
  TestDevice::Buffer buffer = device.buffer(bytes);
  if (words) *words = buffer.words;
  std::fill(buffer.words, buffer.words + 1024, 0);
  VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1, &binding};
  VkDescriptorSetLayout setLayout;
  ASSERT_EQ(VK(vkCreateDescriptorSetLayout)(device.handle, &setInfo, nullptr, &setLayout), VK_SUCCESS);
  VkPipelineLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout, 0, nullptr};
  VkPipelineLayout layout;
  ASSERT_EQ(VK(vkCreatePipelineLayout)(device.handle, &layoutInfo, nullptr, &layout), VK_SUCCESS);
  VkShaderModule module = device.module(spirv);
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, nullptr, 0, VK_SHADER_STAGE_COMPUTE_BIT, module, "main", nullptr};
  info.layout = layout;
  VkPipeline pipeline;
  ASSERT_EQ(VK(vkCreateComputePipelines)(device.handle, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), VK_SUCCESS);
  VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1};
  VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 1, &size};
  VkDescriptorPool pool;
  ASSERT_EQ(VK(vkCreateDescriptorPool)(device.handle, &poolInfo, nullptr, &pool), VK_SUCCESS);
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1, &setLayout};
  VkDescriptorSet set;
  ASSERT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &allocate, &set), VK_SUCCESS);
  VkDescriptorBufferInfo range{buffer.handle, 0, VK_WHOLE_SIZE};
  VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set, 0, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, nullptr, &range, nullptr};
  VK(vkUpdateDescriptorSets)(device.handle, 1, &write, 0, nullptr);

  VkCommandBuffer commands = device.begin();
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  VK(vkCmdBindDescriptorSets)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
  VK(vkCmdDispatch)(commands, groups, 1, 1);
  finish(device, commands);

  VK(vkDestroyDescriptorPool)(device.handle, pool, nullptr);
  VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
  VK(vkDestroyShaderModule)(device.handle, module, nullptr);
  VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
  VK(vkDestroyDescriptorSetLayout)(device.handle, setLayout, nullptr);
  device.release(buffer);
}

}  // namespace pumice::icd::test
