// Extensions younger than the system's headers, each on a device that enables it alone, as a new program would.
// Older loaders and validation layers do not know them: these tests run without the layer.
#include "cts_subset/tests/one_extension.h"

#include <newer_vulkan.h>

namespace pumice::cts {
namespace {

class NewerExtensions : public OneExtensionTest {};

// A shader over 64 invocations that has its index as %i and stores %result.
std::string shaderOf(const std::string& capabilities, const std::string& constants, const std::string& body) {
  return "OpCapability Shader\n" + capabilities + R"(
OpMemoryModel Logical GLSL450
OpEntryPoint GLCompute %main "main" %id %in %out
OpExecutionMode %main LocalSize 64 1 1
OpDecorate %id BuiltIn LocalInvocationIndex
OpDecorate %array ArrayStride 4
OpDecorate %block Block
OpMemberDecorate %block 0 Offset 0
OpDecorate %in DescriptorSet 0
OpDecorate %in Binding 0
OpDecorate %out DescriptorSet 0
OpDecorate %out Binding 1
%void = OpTypeVoid
%function = OpTypeFunction %void
%bool = OpTypeBool
%uint = OpTypeInt 32 0
%array = OpTypeRuntimeArray %uint
%block = OpTypeStruct %array
%pointer = OpTypePointer StorageBuffer %block
%element = OpTypePointer StorageBuffer %uint
%input = OpTypePointer Input %uint
%id = OpVariable %input Input
%in = OpVariable %pointer StorageBuffer
%out = OpVariable %pointer StorageBuffer
%zero = OpConstant %uint 0
%subgroup = OpConstant %uint 3
)" + constants + R"(
%main = OpFunction %void None %function
%label = OpLabel
%i = OpLoad %uint %id
%from = OpAccessChain %element %in %zero %i
%value = OpLoad %uint %from
)" + body + R"(
%to = OpAccessChain %element %out %zero %i
OpStore %to %result
OpReturn
OpFunctionEnd
)";
}

Words numbers(uint32_t count) {
  Words in(count);
  for (uint32_t i = 0; i < count; i++) in[i] = i * 2654435761u;
  return in;
}

TEST_P(NewerExtensions, SubgroupRotate) {
  PUMICE_NEED_FEATURE(available(VK_KHR_SHADER_SUBGROUP_ROTATE_EXTENSION_NAME));
  auto wanted = features<VkPhysicalDeviceShaderSubgroupRotateFeaturesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_SUBGROUP_ROTATE_FEATURES_KHR);
  PUMICE_NEED_FEATURE(wanted.shaderSubgroupRotate);
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  EXPECT_TRUE(v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_ROTATE_BIT_KHR);
  EXPECT_EQ(!!(v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_ROTATE_CLUSTERED_BIT_KHR), !!wanted.shaderSubgroupRotateClustered);
  Device& d = open(VK_KHR_SHADER_SUBGROUP_ROTATE_EXTENSION_NAME, &wanted);
  const Words in = numbers(64);
  for (uint32_t cluster : {0u, 1u, 2u, 8u, v11.subgroupSize})   // 0: the whole subgroup
    for (uint32_t delta : {0u, 1u, 5u, v11.subgroupSize - 1, v11.subgroupSize + 3}) {
      if (cluster && !wanted.shaderSubgroupRotateClustered) continue;
      SCOPED_TRACE("cluster " + std::to_string(cluster) + ", delta " + std::to_string(delta));
      const uint32_t size = cluster ? cluster : v11.subgroupSize;
      Words expected;
      for (uint32_t i = 0; i < 64; i++) expected.push_back(in[i / size * size + (i % size + delta) % size]);
      const std::string constants = "%delta = OpConstant %uint " + std::to_string(delta) + "\n%cluster = OpConstant %uint " + std::to_string(std::max(cluster, 1u));
      expect(runCompute(d, assemble(shaderOf("OpCapability GroupNonUniform\nOpCapability GroupNonUniformRotateKHR\nOpExtension \"SPV_KHR_subgroup_rotate\"", constants,
                                             "%result = OpGroupNonUniformRotateKHR %uint %subgroup %value %delta" + std::string(cluster ? " %cluster" : ""))),
                        in, 64),
             expected);
    }
}

TEST_P(NewerExtensions, ExpectAndAssume) {
  PUMICE_NEED_FEATURE(available(VK_KHR_SHADER_EXPECT_ASSUME_EXTENSION_NAME));
  auto wanted = features<VkPhysicalDeviceShaderExpectAssumeFeaturesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_EXPECT_ASSUME_FEATURES_KHR);
  PUMICE_NEED_FEATURE(wanted.shaderExpectAssume);
  const Words in = numbers(64);
  Words expected;
  for (uint32_t v : in) expected.push_back(v & 1 ? v : v + 7);
  // What is expected need not be what happens.
  expect(runCompute(open(VK_KHR_SHADER_EXPECT_ASSUME_EXTENSION_NAME, &wanted),
                    assemble(shaderOf("OpCapability ExpectAssumeKHR\nOpExtension \"SPV_KHR_expect_assume\"",
                                      "%one = OpConstant %uint 1\n%seven = OpConstant %uint 7\n%many = OpConstant %uint 64", R"(
%inside = OpULessThan %bool %i %many
OpAssumeTrueKHR %inside
%bit = OpBitwiseAnd %uint %value %one
%usual = OpExpectKHR %uint %bit %one
%odd = OpINotEqual %bool %usual %zero
%more = OpIAdd %uint %value %seven
%result = OpSelect %uint %odd %value %more)")),
                    in, 64),
         expected);
}

TEST_P(NewerExtensions, MapMemory2) {
  PUMICE_NEED_FEATURE(available(VK_KHR_MAP_MEMORY_2_EXTENSION_NAME));
  Device& d = open(VK_KHR_MAP_MEMORY_2_EXTENSION_NAME);
  auto map = reinterpret_cast<PFN_vkMapMemory2KHR>(vkGetDeviceProcAddr(d.handle, "vkMapMemory2KHR"));
  auto unmap = reinterpret_cast<PFN_vkUnmapMemory2KHR>(vkGetDeviceProcAddr(d.handle, "vkUnmapMemory2KHR"));
  ASSERT_TRUE(map && unmap);
  VkMemoryAllocateInfo allocate{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, 4096, d.memoryType(~0u, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT)};
  VkDeviceMemory memory = VK_NULL_HANDLE;
  check(vkAllocateMemory(d.handle, &allocate, nullptr, &memory), "vkAllocateMemory");
  VkMemoryUnmapInfoKHR over{VK_STRUCTURE_TYPE_MEMORY_UNMAP_INFO_KHR, nullptr, 0, memory};
  VkMemoryMapInfoKHR some{VK_STRUCTURE_TYPE_MEMORY_MAP_INFO_KHR, nullptr, 0, memory, 1024, 64};
  void* data = nullptr;
  ASSERT_EQ(map(d.handle, &some, &data), VK_SUCCESS);
  std::memset(data, 0x5a, 64);
  EXPECT_EQ(unmap(d.handle, &over), VK_SUCCESS);
  VkMemoryMapInfoKHR all{VK_STRUCTURE_TYPE_MEMORY_MAP_INFO_KHR, nullptr, 0, memory, 0, VK_WHOLE_SIZE};
  ASSERT_EQ(map(d.handle, &all, &data), VK_SUCCESS);
  EXPECT_EQ(static_cast<uint8_t*>(data)[1024], 0x5a);
  EXPECT_EQ(static_cast<uint8_t*>(data)[1087], 0x5a);
  EXPECT_EQ(unmap(d.handle, &over), VK_SUCCESS);
  vkFreeMemory(d.handle, memory, nullptr);
}

TEST_P(NewerExtensions, CalibratedTimestamps) {
  PUMICE_NEED_FEATURE(available(VK_KHR_CALIBRATED_TIMESTAMPS_EXTENSION_NAME));
  Device& d = open(VK_KHR_CALIBRATED_TIMESTAMPS_EXTENSION_NAME);
  auto domains = reinterpret_cast<PFN_vkGetPhysicalDeviceCalibrateableTimeDomainsKHR>(
      vkGetInstanceProcAddr(world().instance->handle(), "vkGetPhysicalDeviceCalibrateableTimeDomainsKHR"));
  auto calibrated = reinterpret_cast<PFN_vkGetCalibratedTimestampsKHR>(vkGetDeviceProcAddr(d.handle, "vkGetCalibratedTimestampsKHR"));
  ASSERT_TRUE(domains && calibrated);
  EXPECT_EQ(vkGetDeviceProcAddr(d.handle, "vkGetCalibratedTimestampsEXT"), nullptr) << "that extension is not enabled";
  uint32_t count = 0;
  check(domains(d.physical, &count, nullptr), "vkGetPhysicalDeviceCalibrateableTimeDomainsKHR");
  ASSERT_GT(count, 0u);
  VkCalibratedTimestampInfoKHR info{VK_STRUCTURE_TYPE_CALIBRATED_TIMESTAMP_INFO_KHR, nullptr, VK_TIME_DOMAIN_DEVICE_EXT};
  uint64_t first = 0, second = 0, deviation = 0;
  check(calibrated(d.handle, 1, &info, &first, &deviation), "vkGetCalibratedTimestampsKHR");
  check(calibrated(d.handle, 1, &info, &second, &deviation), "vkGetCalibratedTimestampsKHR");
  EXPECT_LE(first, second);
}

// New names of what has tests under its old one: only the names are asked for here.
TEST_P(NewerExtensions, NewNames) {
  if (available(VK_KHR_VERTEX_ATTRIBUTE_DIVISOR_EXTENSION_NAME)) {
    auto wanted = features<VkPhysicalDeviceVertexAttributeDivisorFeaturesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VERTEX_ATTRIBUTE_DIVISOR_FEATURES_KHR);
    EXPECT_TRUE(wanted.vertexAttributeInstanceRateDivisor);
    auto p = properties<VkPhysicalDeviceVertexAttributeDivisorPropertiesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VERTEX_ATTRIBUTE_DIVISOR_PROPERTIES_KHR);
    EXPECT_GE(p.maxVertexAttribDivisor, (1u << 16) - 1);
    EXPECT_EQ(p.supportsNonZeroFirstInstance, VK_TRUE);   // drawn in RenderingFeatures
    open(VK_KHR_VERTEX_ATTRIBUTE_DIVISOR_EXTENSION_NAME, &wanted);
  }
  if (available(VK_KHR_INDEX_TYPE_UINT8_EXTENSION_NAME)) {
    auto wanted = features<VkPhysicalDeviceIndexTypeUint8FeaturesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_INDEX_TYPE_UINT8_FEATURES_KHR);
    EXPECT_TRUE(wanted.indexTypeUint8);
    open(VK_KHR_INDEX_TYPE_UINT8_EXTENSION_NAME, &wanted);
  }
  if (available(VK_KHR_LINE_RASTERIZATION_EXTENSION_NAME)) {
    auto wanted = features<VkPhysicalDeviceLineRasterizationFeaturesKHR>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_LINE_RASTERIZATION_FEATURES_KHR);
    EXPECT_TRUE(wanted.rectangularLines || wanted.bresenhamLines);
    Device& d = open(VK_KHR_LINE_RASTERIZATION_EXTENSION_NAME, &wanted);
    EXPECT_NE(vkGetDeviceProcAddr(d.handle, "vkCmdSetLineStippleKHR"), nullptr);
  }
  if (available(VK_KHR_LOAD_STORE_OP_NONE_EXTENSION_NAME)) open(VK_KHR_LOAD_STORE_OP_NONE_EXTENSION_NAME);
}

PUMICE_ON_BOTH_DEVICES(NewerExtensions);

}  // namespace
}  // namespace pumice::cts
