// One compute shader, its buffers and its words: what tests of shader features need.
#pragma once

#include "cts_subset/tests/devices.h"

#include <algorithm>
#include <cstring>

namespace pumice::cts {

using Words = std::vector<uint32_t>;

template <class T>
Words wordsOf(const std::vector<T>& values) {
  Words out((values.size() * sizeof(T) + 3) / 4);
  if (!values.empty()) std::memcpy(out.data(), values.data(), values.size() * sizeof(T));
  return out;
}
template <class T>
std::vector<T> valuesOf(const Words& words) {
  std::vector<T> out(words.size() * 4 / sizeof(T));
  std::memcpy(out.data(), words.data(), out.size() * sizeof(T));
  return out;
}

struct ComputeSpec {
  VkPipelineCreateFlags pipelineFlags = 0;
  VkPipelineShaderStageCreateFlags stageFlags = 0;
  const void* stageNext = nullptr;
  const VkSpecializationInfo* specialization = nullptr;
  std::vector<uint8_t> push;
  Words uniform;         // binding 2, when not empty
  uint32_t groups = 1;
};

inline VkPipeline makeCompute(Workspace& work, VkShaderModule module, VkPipelineLayout layout, const ComputeSpec& spec = {}) {
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.flags = spec.pipelineFlags;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.pNext = spec.stageNext;
  info.stage.flags = spec.stageFlags;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = spec.specialization;
  info.layout = layout;
  return work.make(info);
}

inline VkDescriptorSetLayout makeSetLayout(Workspace& work, const std::vector<VkDescriptorSetLayoutBinding>& bindings,
                                           VkDescriptorSetLayoutCreateFlags flags = 0, const void* next = nullptr) {
  VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, next, flags,
                                       uint32_t(bindings.size()), bindings.data()};
  return work.make(info);
}

inline VkPipelineLayout makePipelineLayout(Workspace& work, const std::vector<VkDescriptorSetLayout>& sets, uint32_t pushBytes = 0,
                                           VkShaderStageFlags stages = VK_SHADER_STAGE_COMPUTE_BIT) {
  VkPushConstantRange range{stages, 0, pushBytes};
  VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, uint32_t(sets.size()), sets.data(),
                                  pushBytes ? 1u : 0u, &range};
  return work.make(info);
}

inline VkDescriptorPool makePool(Workspace& work, const std::vector<VkDescriptorPoolSize>& sizes, uint32_t sets = 4,
                                 VkDescriptorPoolCreateFlags flags = 0, const void* next = nullptr) {
  VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, next, flags, sets, uint32_t(sizes.size()), sizes.data()};
  return work.make(info);
}

inline VkDescriptorSet makeSet(Workspace& work, VkDescriptorPool pool, VkDescriptorSetLayout layout, const void* next = nullptr) {
  VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, next, pool, 1, &layout};
  VkDescriptorSet made = VK_NULL_HANDLE;
  check(vkAllocateDescriptorSets(work.device.handle, &info, &made), "vkAllocateDescriptorSets");
  return made;
}

inline VkDescriptorSetLayoutBinding computeBinding(uint32_t number, VkDescriptorType type, uint32_t count = 1) {
  return {number, type, count, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
}

inline VkWriteDescriptorSet writeBuffer(VkDescriptorSet set, uint32_t binding, VkDescriptorType type, const VkDescriptorBufferInfo* info,
                                        uint32_t element = 0, uint32_t count = 1) {
  VkWriteDescriptorSet w{};
  w.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
  w.dstSet = set;
  w.dstBinding = binding;
  w.dstArrayElement = element;
  w.descriptorCount = count;
  w.descriptorType = type;
  w.pBufferInfo = info;
  return w;
}

inline constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;

// The whole of the buffer, for Workspace::descriptors.
inline Binding bufferBinding(const Buffer& buffer, VkDescriptorType type = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER) {
  Binding b{type};
  b.buffer = {buffer.handle, 0, VK_WHOLE_SIZE};
  return b;
}

// A buffer that shaders reach by its address, at the start of host-visible memory of its own, which may be larger.
struct AddressedBuffer {
  uint64_t address = 0;
  void* mapped = nullptr;
};

inline AddressedBuffer addressedBuffer(Workspace& work, VkDeviceSize bytes, VkDeviceSize memoryBytes = 0) {
  AddressedBuffer made;
  VkDevice d = work.device.handle;
  VkBuffer buffer = work.make(VkBufferCreateInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, nullptr, 0, bytes, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | kStorage,
                                                 VK_SHARING_MODE_EXCLUSIVE, 0, nullptr});
  VkMemoryRequirements needs;
  vkGetBufferMemoryRequirements(d, buffer, &needs);
  // Device addresses need memory allocated for them.
  VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, nullptr, VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT, 0};
  VkDeviceMemory memory = work.make(VkMemoryAllocateInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, std::max(needs.size, memoryBytes),
      work.device.memoryType(needs.memoryTypeBits, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT)});
  check(vkBindBufferMemory(d, buffer, memory, 0), "vkBindBufferMemory");
  check(vkMapMemory(d, memory, 0, VK_WHOLE_SIZE, 0, &made.mapped), "vkMapMemory");
  VkBufferDeviceAddressInfo ask{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer};
  made.address = vkGetBufferDeviceAddress(d, &ask);
  return made;
}

// Runs a shader with `in` at binding 0 and gives back the words of binding 1.
inline Words runCompute(Device& device, const std::vector<uint32_t>& spirv, const Words& in, size_t outWords, const ComputeSpec& spec = {}) {
  Workspace work(device);
  Buffer source = work.bufferOf(in, kStorage);
  Buffer target = work.bufferOf(Words(outWords, 0xcdcdcdcd), kStorage);
  std::vector<Binding> bindings = {bufferBinding(source), bufferBinding(target)};
  if (!spec.uniform.empty())
    bindings.push_back(bufferBinding(work.bufferOf(spec.uniform, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT), VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER));
  DescriptorSet set = work.descriptors(bindings);
  VkPipelineLayout layout = makePipelineLayout(work, {set.layout}, uint32_t(spec.push.size()));
  VkPipeline pipeline = makeCompute(work, work.shader(spirv), layout, spec);
  device.run([&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set.handle, 0, nullptr);
    if (!spec.push.empty()) vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, uint32_t(spec.push.size()), spec.push.data());
    vkCmdDispatch(commands, spec.groups, 1, 1);
    fullBarrier(commands);
  });
  Words out(outWords);
  std::memcpy(out.data(), target.mapped, outWords * 4);
  return out;
}

inline Words runCompute(Device& device, const std::string& glsl, const Words& in, size_t outWords, const ComputeSpec& spec = {}) {
  return runCompute(device, compileGlsl(VK_SHADER_STAGE_COMPUTE_BIT, "#version 460\n" + glsl, ShaderTarget::kVulkan13), in, outWords, spec);
}

// Tests that compare words with words.
class ComputeTest : public OnDevice {
 protected:
  template <class T>
  void expect(const std::vector<T>& found, const std::vector<T>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    size_t wrong = 0;
    for (size_t i = 0; i < found.size(); i++)
      if (std::memcmp(&found[i], &expected[i], sizeof(T)) && ++wrong <= 5)
        ADD_FAILURE() << "element " << i << " is " << +found[i] << ", expected " << +expected[i];
    EXPECT_EQ(wrong, 0u) << "of " << found.size();
  }
};

// A test of what a device need not have.
#define PUMICE_NEED_FEATURE(feature) \
  if (!(feature)) GTEST_SKIP() << device().name() << " has no " #feature

}  // namespace pumice::cts
