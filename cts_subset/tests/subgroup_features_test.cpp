// Operations between the invocations of a subgroup, through compute shaders; of vertex and fragment shaders in rendering_features_test.cpp.
#include "cts_subset/tests/compute.h"

#include <algorithm>
#include <bit>

namespace pumice::cts {
namespace {

class SubgroupFeatures : public ComputeTest {};

// Results by subgroup size: the driver under test and its peer have different ones.
TEST_P(SubgroupFeatures, Operations) {
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  constexpr VkSubgroupFeatureFlags kTested = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT | VK_SUBGROUP_FEATURE_ARITHMETIC_BIT |
                                             VK_SUBGROUP_FEATURE_BALLOT_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_RELATIVE_BIT |
                                             VK_SUBGROUP_FEATURE_QUAD_BIT;
  PUMICE_NEED_FEATURE((v11.subgroupSupportedOperations & kTested) == kTested && (v11.subgroupSupportedStages & VK_SHADER_STAGE_COMPUTE_BIT));
  const uint32_t size = v11.subgroupSize;
  Words in(128);
  for (uint32_t i = 0; i < in.size(); i++) in[i] = i * 2654435761u >> 20;
  Words expected;
  for (uint32_t i = 0; i < 128; i++) {
    uint32_t lane = i % size, first = i - lane, sum = 0, before = 0, most = 0, ballot = 0;
    bool any = false, all = true;
    for (uint32_t k = 0; k < size; k++) {
      uint32_t v = in[first + k];
      sum += v;
      if (k < lane) before += v;
      most = std::max(most, v);
      if (v & 1) ballot |= 1u << k;
      any |= v > 4000, all &= v < 4090;
    }
    uint32_t x = lane ^ 3;
    expected.insert(expected.end(), {sum, before, most, ballot, uint32_t(any) | uint32_t(all) << 1, in[first + x], lane ? in[i - 1] : 0u, in[i ^ 1], in[first + 2],
                                     lane, uint32_t(lane == 0), i / size});
  }
  expect(runCompute(device(), R"(
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_quad : require
layout(local_size_x = 128) in;
layout(binding = 0) readonly buffer In { uint a[]; };
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint i = gl_LocalInvocationIndex, o = i * 12, v = a[i];
  r[o] = subgroupAdd(v); r[o + 1] = subgroupExclusiveAdd(v); r[o + 2] = subgroupMax(v); r[o + 3] = subgroupBallot((v & 1) != 0).x;
  r[o + 4] = (subgroupAny(v > 4000) ? 1 : 0) | (subgroupAll(v < 4090) ? 2 : 0);
  r[o + 5] = subgroupShuffle(v, gl_SubgroupInvocationID ^ 3);
  uint up = subgroupShuffleUp(v, 1); r[o + 6] = gl_SubgroupInvocationID == 0 ? 0 : up;
  r[o + 7] = subgroupQuadSwapHorizontal(v); r[o + 8] = subgroupBroadcast(v, 2);
  r[o + 9] = gl_SubgroupInvocationID; r[o + 10] = subgroupElect() ? 1 : 0; r[o + 11] = gl_SubgroupID;
})", in, 128 * 12), expected);
}

TEST_P(SubgroupFeatures, ExtendedTypes) {
  PUMICE_NEED_FEATURE(device().vulkan12.shaderSubgroupExtendedTypes && device().features.shaderInt64 && device().features.shaderInt16 &&
                      device().vulkan12.shaderInt8 && device().vulkan12.shaderFloat16);
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  PUMICE_NEED_FEATURE(v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_ARITHMETIC_BIT);
  const uint32_t size = v11.subgroupSize;
  std::vector<uint64_t> expected;
  for (uint32_t i = 0; i < 64; i++) {
    uint32_t first = i / size * size;
    uint64_t wide = 0;
    uint16_t half = 0;
    uint8_t byte = 0;
    float f = 0;
    for (uint32_t k = first; k < first + size; k++) wide += uint64_t(k) << 32 | k, half = uint16_t(half + k * 3000), byte = uint8_t(byte + k * 77), f += 0.5f * float(k % 4);
    expected.insert(expected.end(), {wide, half, byte, std::bit_cast<uint32_t>(f), uint64_t(first) << 40});
  }
  expect(valuesOf<uint64_t>(runCompute(device(), R"(
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_subgroup_extended_types_int8 : require
#extension GL_EXT_shader_subgroup_extended_types_int16 : require
#extension GL_EXT_shader_subgroup_extended_types_int64 : require
#extension GL_EXT_shader_subgroup_extended_types_float16 : require
layout(local_size_x = 64) in;
layout(binding = 1) buffer Out { uint64_t r[]; };
void main() {
  uint i = gl_LocalInvocationIndex, o = i * 5;
  r[o] = subgroupAdd(uint64_t(i) << 32 | uint64_t(i));
  r[o + 1] = uint64_t(subgroupAdd(uint16_t(i * 3000)));
  r[o + 2] = uint64_t(subgroupAdd(uint8_t(i * 77)));
  r[o + 3] = uint64_t(floatBitsToUint(float(subgroupAdd(float16_t(0.5) * float16_t(i % 4)))));
  r[o + 4] = subgroupBroadcastFirst(uint64_t(i) << 40);
})", Words(1), 64 * 10)), expected);
}

TEST_P(SubgroupFeatures, SizeControlAndSpecializedSizes) {
  PUMICE_NEED_FEATURE(device().vulkan13.subgroupSizeControl && device().vulkan13.computeFullSubgroups && device().vulkan13.maintenance4);
  const auto v13 = properties<VkPhysicalDeviceVulkan13Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES);
  const uint32_t localSize = 4 * v13.maxSubgroupSize;
  VkSpecializationMapEntry entry{0, 0, 4};
  VkSpecializationInfo specialization{1, &entry, 4, &localSize};
  VkPipelineShaderStageRequiredSubgroupSizeCreateInfo required{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO, nullptr, v13.maxSubgroupSize};
  ComputeSpec spec;
  spec.specialization = &specialization;
  spec.stageFlags = VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT;
  if (v13.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT) spec.stageNext = &required;
  Words r = runCompute(device(), R"(
#extension GL_KHR_shader_subgroup_ballot : require
layout(local_size_x_id = 0) in;
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint lanes = subgroupBallotBitCount(subgroupBallot(true));
  if (gl_LocalInvocationIndex < 128) r[gl_LocalInvocationIndex] = lanes;
  if (gl_LocalInvocationIndex == 0) { r[128] = gl_WorkGroupSize.x; r[129] = gl_NumSubgroups; }
})", Words(1), 130, spec);
  for (uint32_t i = 0; i < std::min(128u, localSize); i++) EXPECT_EQ(r[i], v13.maxSubgroupSize) << i;
  EXPECT_EQ(r[128], localSize);
  EXPECT_EQ(r[129], 4u);
}

TEST_P(SubgroupFeatures, OlderExtensions) {
  PUMICE_NEED_FEATURE(device().has(VK_EXT_SHADER_SUBGROUP_BALLOT_EXTENSION_NAME) && device().has(VK_EXT_SHADER_SUBGROUP_VOTE_EXTENSION_NAME) && device().features.shaderInt64);
  Words r = runCompute(device(), R"(
#extension GL_ARB_shader_ballot : require
#extension GL_ARB_shader_group_vote : require
#extension GL_ARB_gpu_shader_int64 : require
layout(local_size_x = 64) in;
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint i = gl_LocalInvocationIndex, lane = gl_SubGroupInvocationARB;
  uint64_t even = ballotARB((lane & 1) == 0);
  bool right = (uint(even) & 3) == 1;
  right = right && readFirstInvocationARB(lane) == 0 && readInvocationARB(lane * 3, 2) == 6;
  right = right && anyInvocationARB(lane == 1) && !allInvocationsARB(lane == 1) && allInvocationsEqualARB(lane < 1000);
  r[i] = right ? 1 : 0;
})", Words(1), 64);
  expect(r, Words(64, 1));
}

// An invocation's number that is not a constant, only the same for all.
TEST_P(SubgroupFeatures, BroadcastOfADynamicNumber) {
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  PUMICE_NEED_FEATURE(device().vulkan12.subgroupBroadcastDynamicId && (v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_BALLOT_BIT) &&
                      (v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_QUAD_BIT));
  const uint32_t size = v11.subgroupSize;
  ComputeSpec spec;
  spec.push = {3, 0, 0, 0, 2, 0, 0, 0};
  Words in(64), expected;
  for (uint32_t i = 0; i < 64; i++) in[i] = i * 77 + 5;
  for (uint32_t i = 0; i < 64; i++) {
    uint32_t first = i / size * size, sum = 0;
    for (uint32_t k = 0; k < size; k++) sum += in[first + k] * (k + 1);
    expected.insert(expected.end(), {in[first + 3 % size], in[i / 4 * 4 + 2], sum});
  }
  expect(runCompute(device(), R"(
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_quad : require
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { uint a[]; };
layout(binding = 1) buffer Out { uint r[]; };
layout(push_constant) uniform P { uint lane, ofQuad; };
void main() {
  uint i = gl_LocalInvocationIndex, o = i * 3, sum = 0;
  r[o] = subgroupBroadcast(a[i], lane % gl_SubgroupSize);
  r[o + 1] = subgroupQuadBroadcast(a[i], ofQuad);
  for (uint k = 0; k < gl_SubgroupSize; k++) sum += subgroupBroadcast(a[i], k) * (k + 1);
  r[o + 2] = sum;
})", in, 64 * 3, spec), expected);
}

// Reductions within clusters of every size, over all invocations and over every third.
TEST_P(SubgroupFeatures, Clusters) {
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  PUMICE_NEED_FEATURE((v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_CLUSTERED_BIT) && (v11.subgroupSupportedStages & VK_SHADER_STAGE_COMPUTE_BIT));
  struct Reduction {
    const char* name;
    uint32_t identity;
    uint32_t (*apply)(uint32_t, uint32_t);
  };
  const Reduction reductions[] = {
      {"Add", 0, [](uint32_t a, uint32_t b) { return a + b; }},           {"Mul", 1, [](uint32_t a, uint32_t b) { return a * b; }},
      {"Min", ~0u, [](uint32_t a, uint32_t b) { return std::min(a, b); }}, {"Max", 0, [](uint32_t a, uint32_t b) { return std::max(a, b); }},
      {"And", ~0u, [](uint32_t a, uint32_t b) { return a & b; }},         {"Or", 0, [](uint32_t a, uint32_t b) { return a | b; }},
      {"Xor", 0, [](uint32_t a, uint32_t b) { return a ^ b; }}};
  Words in(64);
  for (uint32_t i = 0; i < 64; i++) in[i] = (i * 2654435761u) ^ (i << 3);
  for (uint32_t cluster = 1; cluster <= v11.subgroupSize; cluster *= 2) {
    SCOPED_TRACE(testing::Message() << "clusters of " << cluster);
    std::string body;
    Words expected(64 * 15, 0);
    for (uint32_t n = 0; n < 7; n++) {
      const std::string call = "subgroupClustered" + std::string(reductions[n].name) + "(a[i], " + std::to_string(cluster) + "u)";
      body += "  r[o + " + std::to_string(2 * n) + "] = " + call + ";\n  if (i % 3 == 0) r[o + " + std::to_string(2 * n + 1) + "] = " + call + ";\n";
      for (uint32_t i = 0; i < 64; i++)
        for (uint32_t thirds : {0u, 1u}) {
          if (thirds && i % 3) continue;
          uint32_t v = reductions[n].identity;
          for (uint32_t k = i / cluster * cluster; k < i / cluster * cluster + cluster; k++)
            if (!thirds || k % 3 == 0) v = reductions[n].apply(v, in[k]);
          expected[i * 15 + 2 * n + thirds] = v;
        }
    }
    for (uint32_t i = 0; i < 64; i++) {
      float sum = 0;   // exact in any order
      for (uint32_t k = i / cluster * cluster; k < i / cluster * cluster + cluster; k++) sum += 0.25f * float(k);
      expected[i * 15 + 14] = std::bit_cast<uint32_t>(sum);
    }
    expect(runCompute(device(), R"(
#extension GL_KHR_shader_subgroup_clustered : require
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { uint a[]; };
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint i = gl_LocalInvocationIndex, o = i * 15;
  for (uint k = 0; k < 15; k++) r[o + k] = 0;
)" + body + "  r[o + 14] = floatBitsToUint(subgroupClusteredAdd(0.25 * float(i), " + std::to_string(cluster) + "u));\n}\n", in, 64 * 15), expected);
  }
}

PUMICE_ON_BOTH_DEVICES(SubgroupFeatures);

}  // namespace
}  // namespace pumice::cts
