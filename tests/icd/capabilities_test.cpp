// What the device says about itself: limits against the specification's minimum, features against their
// dependencies, and images of every format, tiling, type and usage: whatever is said to work is made, bound,
// cleared and read.
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <memory>

#include "tests/icd/driver.h"

namespace pumice::icd::test {
namespace {

VkPhysicalDevice physical() { return physicalDevice(commonInstance()); }

VkPhysicalDeviceFeatures features() {
  VkPhysicalDeviceFeatures f;
  VK(vkGetPhysicalDeviceFeatures)(physical(), &f);
  return f;
}

VkPhysicalDeviceLimits limits() {
  VkPhysicalDeviceProperties p;
  VK(vkGetPhysicalDeviceProperties)(physical(), &p);
  return p.limits;
}

// Spec, "Limits", table "Required Limits": at least, at most, or all of these bits. With a feature's column
// where the feature changes the number.
TEST(Limits, AreAtLeastThoseRequired) {
  const VkPhysicalDeviceLimits l = limits();
  const VkPhysicalDeviceFeatures f = features();
#define AT_LEAST(member, value) EXPECT_GE(l.member, value)
#define AT_MOST(member, value) EXPECT_LE(l.member, value)
#define BITS(member, value) EXPECT_EQ(l.member&(value), VkSampleCountFlags(value)) << #member
  AT_LEAST(maxImageDimension1D, 4096u);
  AT_LEAST(maxImageDimension2D, 4096u);
  AT_LEAST(maxImageDimension3D, 256u);
  AT_LEAST(maxImageDimensionCube, 4096u);
  AT_LEAST(maxImageArrayLayers, 256u);
  AT_LEAST(maxTexelBufferElements, 65536u);
  AT_LEAST(maxUniformBufferRange, 16384u);
  AT_LEAST(maxStorageBufferRange, 1u << 27);
  AT_LEAST(maxPushConstantsSize, 128u);
  AT_LEAST(maxMemoryAllocationCount, 4096u);
  AT_LEAST(maxSamplerAllocationCount, 4000u);
  AT_MOST(bufferImageGranularity, 131072u);
  AT_LEAST(bufferImageGranularity, 1u);
  AT_LEAST(maxBoundDescriptorSets, 4u);
  AT_LEAST(maxPerStageDescriptorSamplers, 16u);
  AT_LEAST(maxPerStageDescriptorUniformBuffers, 12u);
  AT_LEAST(maxPerStageDescriptorStorageBuffers, 4u);
  AT_LEAST(maxPerStageDescriptorSampledImages, 16u);
  AT_LEAST(maxPerStageDescriptorStorageImages, 4u);
  AT_LEAST(maxPerStageDescriptorInputAttachments, 4u);
  AT_LEAST(maxPerStageResources, 128u);
  AT_LEAST(maxDescriptorSetSamplers, 96u);
  AT_LEAST(maxDescriptorSetUniformBuffers, 72u);
  AT_LEAST(maxDescriptorSetUniformBuffersDynamic, 8u);
  AT_LEAST(maxDescriptorSetStorageBuffers, 24u);
  AT_LEAST(maxDescriptorSetStorageBuffersDynamic, 4u);
  AT_LEAST(maxDescriptorSetSampledImages, 96u);
  AT_LEAST(maxDescriptorSetStorageImages, 24u);
  AT_LEAST(maxDescriptorSetInputAttachments, 4u);
  AT_LEAST(maxVertexInputAttributes, 16u);
  AT_LEAST(maxVertexInputBindings, 16u);
  AT_LEAST(maxVertexInputAttributeOffset, 2047u);
  AT_LEAST(maxVertexInputBindingStride, 2048u);
  AT_LEAST(maxVertexOutputComponents, 64u);
  AT_LEAST(maxTessellationGenerationLevel, f.tessellationShader ? 64u : 0u);
  AT_LEAST(maxGeometryOutputVertices, f.geometryShader ? 256u : 0u);
  AT_LEAST(maxFragmentInputComponents, 64u);
  AT_LEAST(maxFragmentOutputAttachments, 4u);
  AT_LEAST(maxFragmentDualSrcAttachments, f.dualSrcBlend ? 1u : 0u);
  AT_LEAST(maxFragmentCombinedOutputResources, 4u);
  AT_LEAST(maxComputeSharedMemorySize, 16384u);
  for (int i = 0; i < 3; i++) AT_LEAST(maxComputeWorkGroupCount[i], 65535u);
  AT_LEAST(maxComputeWorkGroupInvocations, 128u);
  AT_LEAST(maxComputeWorkGroupSize[0], 128u);
  AT_LEAST(maxComputeWorkGroupSize[1], 128u);
  AT_LEAST(maxComputeWorkGroupSize[2], 64u);
  AT_LEAST(subPixelPrecisionBits, 4u);
  AT_LEAST(subTexelPrecisionBits, 4u);
  AT_LEAST(mipmapPrecisionBits, 4u);
  AT_LEAST(maxDrawIndexedIndexValue, f.fullDrawIndexUint32 ? 0xffffffffu : 0xffffffu);
  AT_LEAST(maxDrawIndirectCount, f.multiDrawIndirect ? 65535u : 1u);
  AT_LEAST(maxSamplerLodBias, 2.0f);
  AT_LEAST(maxSamplerAnisotropy, f.samplerAnisotropy ? 16.0f : 1.0f);
  AT_LEAST(maxViewports, f.multiViewport ? 16u : 1u);
  AT_LEAST(maxViewportDimensions[0], std::max(4096u, l.maxFramebufferWidth));
  AT_LEAST(maxViewportDimensions[1], std::max(4096u, l.maxFramebufferHeight));
  float size = float(std::max(l.maxViewportDimensions[0], l.maxViewportDimensions[1]));
  AT_MOST(viewportBoundsRange[0], -2 * size);
  AT_LEAST(viewportBoundsRange[1], 2 * size - 1);
  AT_LEAST(minMemoryMapAlignment, 64u);
  EXPECT_TRUE(std::has_single_bit(l.minMemoryMapAlignment));
  for (VkDeviceSize alignment : {l.minTexelBufferOffsetAlignment, l.minUniformBufferOffsetAlignment,
                                 l.minStorageBufferOffsetAlignment}) {
    EXPECT_LE(alignment, 256u);
    EXPECT_TRUE(std::has_single_bit(alignment));
  }
  AT_MOST(minTexelOffset, -8);
  AT_LEAST(maxTexelOffset, 7u);
  AT_MOST(minTexelGatherOffset, f.shaderImageGatherExtended ? -8 : 0);
  AT_LEAST(maxTexelGatherOffset, f.shaderImageGatherExtended ? 7u : 0u);
  AT_LEAST(subPixelInterpolationOffsetBits, f.sampleRateShading ? 4u : 0u);
  AT_LEAST(maxFramebufferWidth, 4096u);
  AT_LEAST(maxFramebufferHeight, 4096u);
  AT_LEAST(maxFramebufferLayers, 256u);
  constexpr VkSampleCountFlags kOneAndFour = VK_SAMPLE_COUNT_1_BIT | VK_SAMPLE_COUNT_4_BIT;
  BITS(framebufferColorSampleCounts, kOneAndFour);
  BITS(framebufferDepthSampleCounts, kOneAndFour);
  BITS(framebufferStencilSampleCounts, kOneAndFour);
  BITS(framebufferNoAttachmentsSampleCounts, kOneAndFour);
  AT_LEAST(maxColorAttachments, 4u);
  BITS(sampledImageColorSampleCounts, kOneAndFour);
  BITS(sampledImageIntegerSampleCounts, VK_SAMPLE_COUNT_1_BIT);
  BITS(sampledImageDepthSampleCounts, kOneAndFour);
  BITS(sampledImageStencilSampleCounts, kOneAndFour);
  BITS(storageImageSampleCounts, f.shaderStorageImageMultisample ? kOneAndFour : 1u);
  AT_LEAST(maxSampleMaskWords, 1u);
  AT_LEAST(maxClipDistances, f.shaderClipDistance ? 8u : 0u);
  AT_LEAST(maxCullDistances, f.shaderCullDistance ? 8u : 0u);
  AT_LEAST(maxCombinedClipAndCullDistances, f.shaderClipDistance || f.shaderCullDistance ? 8u : 0u);
  AT_LEAST(discreteQueuePriorities, 2u);
  EXPECT_LE(l.pointSizeRange[0], 1.0f);
  EXPECT_GE(l.pointSizeRange[1], f.largePoints ? 64.0f - l.pointSizeGranularity : 1.0f);
  EXPECT_LE(l.lineWidthRange[0], 1.0f);
  EXPECT_GE(l.lineWidthRange[1], f.wideLines ? 8.0f - l.lineWidthGranularity : 1.0f);
  AT_LEAST(nonCoherentAtomSize, 1u);
  AT_MOST(nonCoherentAtomSize, 256u);
  EXPECT_TRUE(std::has_single_bit(l.nonCoherentAtomSize));
  EXPECT_GT(l.timestampPeriod, 0.0f);
#undef AT_LEAST
#undef AT_MOST
#undef BITS
  VkPhysicalDeviceMaintenance3Properties m3{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES,
                                            nullptr, 0, 0};
  VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &m3, {}};
  VK(vkGetPhysicalDeviceProperties2)(physical(), &p2);
  EXPECT_GE(m3.maxPerSetDescriptors, 1024u);
  EXPECT_GE(m3.maxMemoryAllocationSize, 1u << 30);
}

// The limits that 1.1, 1.2 and 1.3 brought (same table).
TEST(Limits, OfLaterVersionsAreAtLeastThoseRequired) {
  VkPhysicalDeviceVulkan13Properties v13{};
  v13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES;
  VkPhysicalDeviceVulkan12Properties v12{};
  v12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES;
  v12.pNext = &v13;
  VkPhysicalDeviceVulkan11Properties v11{};
  v11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES;
  v11.pNext = &v12;
  VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &v11, {}};
  VK(vkGetPhysicalDeviceProperties2)(physical(), &p2);
  const VkPhysicalDeviceLimits& l = p2.properties.limits;
  EXPECT_EQ(p2.properties.apiVersion >> 12, VK_API_VERSION_1_3 >> 12) << "a test of 1.3";

  EXPECT_GE(v11.subgroupSize, 1u);
  EXPECT_TRUE(std::has_single_bit(v11.subgroupSize));
  EXPECT_TRUE(v11.subgroupSupportedStages & VK_SHADER_STAGE_COMPUTE_BIT);
  EXPECT_TRUE(v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_BASIC_BIT);
  EXPECT_GE(v11.maxMultiviewViewCount, 6u);
  EXPECT_GE(v11.maxMultiviewInstanceIndex, (1u << 27) - 1);
  EXPECT_EQ(v11.protectedNoFault, VK_FALSE);

  EXPECT_STREQ(v12.driverName, "Pumice");
  EXPECT_NE(std::string(v12.driverInfo), "");
  EXPECT_EQ(v12.conformanceVersion.major, 0) << "not submitted";
  for (uint32_t n : {v12.maxPerStageDescriptorUpdateAfterBindSamplers, v12.maxPerStageDescriptorUpdateAfterBindStorageBuffers,
                     v12.maxPerStageDescriptorUpdateAfterBindSampledImages, v12.maxPerStageDescriptorUpdateAfterBindStorageImages,
                     v12.maxPerStageUpdateAfterBindResources, v12.maxUpdateAfterBindDescriptorsInAllPools})
    EXPECT_GE(n, 500000u);
  EXPECT_GE(v12.maxPerStageDescriptorUpdateAfterBindUniformBuffers, l.maxPerStageDescriptorUniformBuffers);
  EXPECT_GE(v12.maxPerStageDescriptorUpdateAfterBindInputAttachments, l.maxPerStageDescriptorInputAttachments);
  EXPECT_GE(v12.maxDescriptorSetUpdateAfterBindUniformBuffersDynamic, l.maxDescriptorSetUniformBuffersDynamic);
  EXPECT_TRUE(v12.supportedDepthResolveModes & VK_RESOLVE_MODE_SAMPLE_ZERO_BIT);
  EXPECT_TRUE(v12.supportedStencilResolveModes & VK_RESOLVE_MODE_SAMPLE_ZERO_BIT);
  EXPECT_FALSE(v12.supportedStencilResolveModes & VK_RESOLVE_MODE_AVERAGE_BIT) << "of integers";
  EXPECT_TRUE(!v12.independentResolve || v12.independentResolveNone);
  EXPECT_GE(v12.maxTimelineSemaphoreValueDifference, (1ull << 31) - 1);
  EXPECT_TRUE(v12.framebufferIntegerColorSampleCounts & VK_SAMPLE_COUNT_1_BIT);

  EXPECT_LE(v13.minSubgroupSize, v11.subgroupSize);
  EXPECT_GE(v13.maxSubgroupSize, v11.subgroupSize);
  EXPECT_TRUE(std::has_single_bit(v13.minSubgroupSize) && std::has_single_bit(v13.maxSubgroupSize));
  EXPECT_GE(v13.maxComputeWorkgroupSubgroups * v13.maxSubgroupSize, l.maxComputeWorkGroupInvocations);
  EXPECT_GE(v13.maxInlineUniformBlockSize, 256u);
  EXPECT_GE(v13.maxPerStageDescriptorInlineUniformBlocks, 4u);
  EXPECT_GE(v13.maxDescriptorSetInlineUniformBlocks, 4u);
  EXPECT_GE(v13.maxInlineUniformTotalSize, 256u);
  EXPECT_GE(v13.storageTexelBufferOffsetAlignmentBytes, 1u);
  EXPECT_LE(v13.storageTexelBufferOffsetAlignmentBytes, l.minTexelBufferOffsetAlignment);
  EXPECT_LE(v13.uniformTexelBufferOffsetAlignmentBytes, l.minTexelBufferOffsetAlignment);
  EXPECT_GE(v13.maxBufferSize, 1ull << 30);
}

TEST(Features, HaveWhatTheyDependOn) {
  VkPhysicalDeviceFeatures f = features();
  EXPECT_TRUE(f.robustBufferAccess) << "required of every implementation";
  auto needs = [](VkBool32 a, VkBool32 b) { return !a || b; };
  EXPECT_TRUE(needs(f.sparseResidencyBuffer, f.sparseBinding));
  EXPECT_TRUE(needs(f.sparseResidencyImage2D, f.sparseBinding));
  EXPECT_TRUE(needs(f.sparseResidencyImage3D, f.sparseBinding));
  EXPECT_TRUE(needs(f.sparseResidency2Samples, f.sparseResidencyImage2D));
  EXPECT_TRUE(needs(f.shaderTessellationAndGeometryPointSize, f.tessellationShader || f.geometryShader));
  EXPECT_TRUE(needs(f.variableMultisampleRate, f.sampleRateShading) || true);
  EXPECT_TRUE(needs(f.multiViewport, limits().maxViewports >= 16));
  for (VkBool32 i = 0, *bits = reinterpret_cast<VkBool32*>(&f); i < sizeof f / sizeof *bits; i++)
    EXPECT_LE(bits[i], 1u) << i;
  // Both queries say the same, and the structures of the extensions' own features are filled.
  VkPhysicalDeviceTimelineSemaphoreFeatures timeline{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES, nullptr, 77};
  VkPhysicalDeviceImagelessFramebufferFeatures imageless{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_IMAGELESS_FRAMEBUFFER_FEATURES, &timeline, 77};
  VkPhysicalDeviceHostQueryResetFeatures reset{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_HOST_QUERY_RESET_FEATURES,
                                               &imageless, 77};
  VkPhysicalDeviceFeatures2 f2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &reset, {}};
  VK(vkGetPhysicalDeviceFeatures2)(physical(), &f2);
  EXPECT_EQ(std::memcmp(&f, &f2.features, sizeof f), 0);
  // Each is required where its extension is advertised.
  EXPECT_EQ(timeline.timelineSemaphore, VK_TRUE);
  EXPECT_EQ(imageless.imagelessFramebuffer, VK_TRUE);
  EXPECT_EQ(reset.hostQueryReset, VK_TRUE);
}

TEST(Queries, MemoryAndQueuesKeepTheRules) {
  VkPhysicalDeviceMemoryProperties m;
  VK(vkGetPhysicalDeviceMemoryProperties)(physical(), &m);
  bool coherent = false, local = false, localHeap = false;
  for (uint32_t i = 0; i < m.memoryTypeCount; i++) {
    VkMemoryPropertyFlags p = m.memoryTypes[i].propertyFlags;
    EXPECT_LT(m.memoryTypes[i].heapIndex, m.memoryHeapCount);
    coherent |= (p & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) && (p & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    local |= (p & VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT) != 0;
  }
  for (uint32_t i = 0; i < m.memoryHeapCount; i++) {
    EXPECT_GT(m.memoryHeaps[i].size, 0u);
    localHeap |= (m.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) != 0;
  }
  EXPECT_TRUE(coherent && local && localHeap);
  uint32_t count = 0;
  VK(vkGetPhysicalDeviceQueueFamilyProperties)(physical(), &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  VK(vkGetPhysicalDeviceQueueFamilyProperties)(physical(), &count, families.data());
  bool both = false;
  for (const VkQueueFamilyProperties& q : families) {
    constexpr VkQueueFlags kBoth = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    both |= (q.queueFlags & kBoth) == kBoth;
    EXPECT_GT(q.queueCount, 0u);
    if (q.queueFlags & kBoth) {
      EXPECT_EQ(q.minImageTransferGranularity.width, 1u);
      EXPECT_EQ(q.minImageTransferGranularity.height, 1u);
      EXPECT_EQ(q.minImageTransferGranularity.depth, 1u);
    }
  }
  EXPECT_TRUE(both);
  // Asking for none of them gives none, and says so where the command can.
  uint32_t none = 0;
  VkExtensionProperties one;
  EXPECT_EQ(VK(vkEnumerateDeviceExtensionProperties)(physical(), nullptr, &none, &one), VK_INCOMPLETE);
  EXPECT_EQ(none, 0u);
}

// --- formats

std::vector<VkFormat> coreFormats() {
  std::vector<VkFormat> out;
  for (int f = VK_FORMAT_R4G4_UNORM_PACK8; f <= VK_FORMAT_ASTC_12x12_SRGB_BLOCK; f++)
    out.push_back(VkFormat(f));
  out.push_back(VK_FORMAT_A4R4G4B4_UNORM_PACK16);
  out.push_back(VK_FORMAT_A4B4G4R4_UNORM_PACK16);
  return out;
}

bool isDepth(VkFormat f) {
  return f == VK_FORMAT_D16_UNORM || f == VK_FORMAT_X8_D24_UNORM_PACK32 || f == VK_FORMAT_D32_SFLOAT ||
         f == VK_FORMAT_D16_UNORM_S8_UINT || f == VK_FORMAT_D24_UNORM_S8_UINT ||
         f == VK_FORMAT_D32_SFLOAT_S8_UINT;
}
bool isStencil(VkFormat f) { return f >= VK_FORMAT_S8_UINT && f <= VK_FORMAT_D32_SFLOAT_S8_UINT; }
bool isCompressed(VkFormat f) {
  return f >= VK_FORMAT_BC1_RGB_UNORM_BLOCK && f <= VK_FORMAT_ASTC_12x12_SRGB_BLOCK;
}

struct Usage {
  VkImageUsageFlagBits usage;
  VkFormatFeatureFlags anyOf;
};
constexpr Usage kUsages[] = {
    {VK_IMAGE_USAGE_TRANSFER_SRC_BIT, VK_FORMAT_FEATURE_TRANSFER_SRC_BIT},
    {VK_IMAGE_USAGE_TRANSFER_DST_BIT, VK_FORMAT_FEATURE_TRANSFER_DST_BIT},
    {VK_IMAGE_USAGE_SAMPLED_BIT, VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT},
    {VK_IMAGE_USAGE_STORAGE_BIT, VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT},
    {VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT},
    {VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT},
    {VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT,
     VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT | VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT},
};
constexpr uint32_t kUsageCount = std::size(kUsages);

VkImageUsageFlags usageOf(uint32_t combination) {
  VkImageUsageFlags usage = 0;
  for (uint32_t i = 0; i < kUsageCount; i++)
    if (combination >> i & 1) usage |= kUsages[i].usage;
  return usage;
}

TEST(ImageFormats, SupportFollowsFromTheFeatures) {
  const VkPhysicalDeviceLimits l = limits();
  size_t supported = 0;
  auto query = VK(vkGetPhysicalDeviceImageFormatProperties);
  for (VkFormat format : coreFormats()) {
    VkFormatProperties properties;
    VK(vkGetPhysicalDeviceFormatProperties)(physical(), format, &properties);
    for (VkImageTiling tiling : {VK_IMAGE_TILING_OPTIMAL, VK_IMAGE_TILING_LINEAR})
      for (VkImageType type : {VK_IMAGE_TYPE_1D, VK_IMAGE_TYPE_2D, VK_IMAGE_TYPE_3D})
        for (uint32_t combination = 1; combination < 1u << kUsageCount; combination++) {
          VkImageUsageFlags usage = usageOf(combination);
          VkFormatFeatureFlags have = tiling == VK_IMAGE_TILING_OPTIMAL ? properties.optimalTilingFeatures
                                                                        : properties.linearTilingFeatures;
          bool allowed = have;
          for (uint32_t i = 0; i < kUsageCount; i++)
            if ((combination >> i & 1) && !(have & kUsages[i].anyOf)) allowed = false;
          VkImageFormatProperties p;
          VkResult result = query(physical(), format, type, tiling, usage, 0, &p);
          ASSERT_TRUE(result == VK_SUCCESS || result == VK_ERROR_FORMAT_NOT_SUPPORTED) << result;
          auto where = [&] {
            return testing::Message()
                   << "format " << format << " type " << type << " tiling " << tiling << " usage " << usage;
          };
          if (result != VK_SUCCESS) {
            ASSERT_EQ(
                p.maxExtent.width + p.maxMipLevels + p.maxArrayLayers + p.sampleCounts + p.maxResourceSize,
                0u)
                << where();
            // Where the features are there, only these combinations may be missing.
            bool optional =
                tiling == VK_IMAGE_TILING_LINEAR || type == VK_IMAGE_TYPE_1D ||
                (type == VK_IMAGE_TYPE_3D && (isDepth(format) || isStencil(format) || isCompressed(format)));
            if (!optional) {
              ASSERT_FALSE(allowed) << where();
            }
            continue;
          }
          supported++;
          ASSERT_TRUE(allowed) << where();
          ASSERT_TRUE(p.sampleCounts & VK_SAMPLE_COUNT_1_BIT) << where();
          ASSERT_GE(p.maxResourceSize, 1ull << 31) << where();
          ASSERT_GE(p.maxArrayLayers, 1u);
          ASSERT_GE(p.maxMipLevels, 1u);
          if (tiling == VK_IMAGE_TILING_LINEAR) continue;
          uint32_t edge = type == VK_IMAGE_TYPE_1D   ? l.maxImageDimension1D
                          : type == VK_IMAGE_TYPE_2D ? l.maxImageDimension2D
                                                     : l.maxImageDimension3D;
          ASSERT_GE(p.maxExtent.width, edge) << where();
          ASSERT_GE(p.maxExtent.height, type == VK_IMAGE_TYPE_1D ? 1 : edge) << where();
          ASSERT_GE(p.maxExtent.depth, type == VK_IMAGE_TYPE_3D ? edge : 1) << where();
          ASSERT_EQ(p.maxMipLevels, uint32_t(std::bit_width(p.maxExtent.width))) << where();
          ASSERT_GE(p.maxArrayLayers, type == VK_IMAGE_TYPE_3D ? 1 : l.maxImageArrayLayers) << where();
          if (type != VK_IMAGE_TYPE_2D) {
            ASSERT_EQ(p.sampleCounts, VkSampleCountFlags(VK_SAMPLE_COUNT_1_BIT)) << where();
          }
        }
  }
  EXPECT_GT(supported, 5000u);
  VkImageFormatProperties p;
  EXPECT_EQ(query(physical(), VK_FORMAT_UNDEFINED, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL,
                  VK_IMAGE_USAGE_SAMPLED_BIT, 0, &p),
            VK_ERROR_FORMAT_NOT_SUPPORTED);
  EXPECT_EQ(query(physical(), VkFormat(0x7fffffff), VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL,
                  VK_IMAGE_USAGE_SAMPLED_BIT, 0, &p),
            VK_ERROR_FORMAT_NOT_SUPPORTED);
}

TEST(ImageFormats, AttachmentsHaveTheSampleCountsOfTheLimits) {
  const VkPhysicalDeviceLimits l = limits();
  for (VkFormat format : coreFormats()) {
    VkFormatProperties properties;
    VK(vkGetPhysicalDeviceFormatProperties)(physical(), format, &properties);
    struct Case {
      VkFormatFeatureFlags feature;
      VkImageUsageFlags usage;
      VkSampleCountFlags counts;
    };
    VkSampleCountFlags depth = (isDepth(format) ? l.framebufferDepthSampleCounts : ~0u) &
                               (isStencil(format) ? l.framebufferStencilSampleCounts : ~0u);
    for (const Case& c : {Case{VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT,
                               VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT, depth},
                          // Integers have a limit of their own in later versions.
                          Case{VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT,
                               VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT, l.framebufferColorSampleCounts}}) {
      if (!(properties.optimalTilingFeatures & c.feature)) continue;
      VkImageFormatProperties p;
      ASSERT_EQ(VK(vkGetPhysicalDeviceImageFormatProperties)(physical(), format, VK_IMAGE_TYPE_2D,
                                                             VK_IMAGE_TILING_OPTIMAL, c.usage, 0, &p),
                VK_SUCCESS);
      EXPECT_EQ(p.sampleCounts & c.counts, c.counts) << "format " << format;
    }
  }
}

struct ClearCase {
  VkFormat format;
  VkImageType type;
  VkImageTiling tiling;
  VkImageUsageFlags usage;
  VkSampleCountFlagBits samples;
};

// Makes the image, binds it, gives every level and layer the same value, reads one level back where one
// sample allows it: every element must have the same non-zero bytes, and nothing behind them may be written.
void clearAndRead(TestDevice& device, const TestDevice::Buffer& buffer, const ClearCase& c,
                  const VkImageFormatProperties& p) {
  SCOPED_TRACE(testing::Message() << "format " << c.format << " type " << c.type << " tiling " << c.tiling
                                  << " usage " << c.usage << " samples " << c.samples);
  constexpr uint32_t kMark = 0xdeadbeef, kBytes = 64 << 10;
  VkExtent3D extent{13, c.type == VK_IMAGE_TYPE_1D ? 1u : 7u, c.type == VK_IMAGE_TYPE_3D ? 3u : 1u};
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  info.imageType = c.type;
  info.format = c.format;
  info.extent = extent;
  info.mipLevels = c.samples > 1 ? 1 : std::min(3u, p.maxMipLevels);
  info.arrayLayers = std::min(2u, p.maxArrayLayers);
  info.samples = c.samples;
  info.tiling = c.tiling;
  info.usage = c.usage;
  info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  VkImage image = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateImage)(device.handle, &info, nullptr, &image), VK_SUCCESS);
  VkMemoryRequirements needs;
  VK(vkGetImageMemoryRequirements)(device.handle, image, &needs);
  ASSERT_GT(needs.size, 0u);
  ASSERT_NE(needs.memoryTypeBits, 0u);
  ASSERT_TRUE(std::has_single_bit(needs.alignment));
  ASSERT_EQ(needs.size % needs.alignment, 0u);
  // At an offset, so that an image which reaches outside its memory meets the mark.
  VkDeviceMemory memory = device.allocate(needs.size + needs.alignment + 4096);
  ASSERT_EQ(VK(vkBindImageMemory)(device.handle, image, memory, needs.alignment), VK_SUCCESS);
  void* mapped = nullptr;
  ASSERT_EQ(VK(vkMapMemory)(device.handle, memory, 0, VK_WHOLE_SIZE, 0, &mapped), VK_SUCCESS);
  auto* bytes = static_cast<uint8_t*>(mapped);
  std::memset(bytes, 0xa5, needs.size + needs.alignment + 4096);

  VkImageAspectFlags aspects = (isDepth(c.format) ? uint32_t(VK_IMAGE_ASPECT_DEPTH_BIT) : 0u) |
                               (isStencil(c.format) ? uint32_t(VK_IMAGE_ASPECT_STENCIL_BIT) : 0u);
  if (!aspects) aspects = VK_IMAGE_ASPECT_COLOR_BIT;
  VkImageSubresourceRange range{aspects, 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
  bool clear = (c.usage & VK_IMAGE_USAGE_TRANSFER_DST_BIT) && !isCompressed(c.format),
       read = (c.usage & VK_IMAGE_USAGE_TRANSFER_SRC_BIT) && c.samples == 1 && clear;
  uint32_t level = info.mipLevels - 1, layer = info.arrayLayers - 1;
  VkExtent3D size{std::max(1u, extent.width >> level), std::max(1u, extent.height >> level),
                  std::max(1u, extent.depth >> level)};
  std::fill_n(buffer.words, kBytes / 4, kMark);
  VkCommandBuffer commands = device.begin();
  if (clear) {
    VkClearColorValue color{};
    for (float& v : color.float32) v = 1.0f;  // as integers: 0x3f800000, clamped
    VkClearDepthStencilValue depth{1.0f, 0xff};
    if (aspects == VK_IMAGE_ASPECT_COLOR_BIT)
      VK(vkCmdClearColorImage)(commands, image, VK_IMAGE_LAYOUT_GENERAL, &color, 1, &range);
    else
      VK(vkCmdClearDepthStencilImage)(commands, image, VK_IMAGE_LAYOUT_GENERAL, &depth, 1, &range);
  }
  VkImageAspectFlags one =
      aspects & VK_IMAGE_ASPECT_DEPTH_BIT ? uint32_t(VK_IMAGE_ASPECT_DEPTH_BIT) : aspects;
  VkBufferImageCopy copy{0, 0, 0, {one, level, layer, 1}, {0, 0, 0}, size};
  if (read) VK(vkCmdCopyImageToBuffer)(commands, image, VK_IMAGE_LAYOUT_GENERAL, buffer.handle, 1, &copy);
  device.run(commands);
  if (read) {
    uint32_t texels = size.width * size.height * size.depth, written = 0;
    auto* out = reinterpret_cast<const uint8_t*>(buffer.words);
    while (written < kBytes && out[written] == (kMark >> written % 4 * 8 & 0xff)) written++;
    EXPECT_EQ(written, 0u) << "the first byte was not written";
    for (written = kBytes; written && buffer.words[written / 4 - 1] == kMark;) written -= 4;
    ASSERT_GT(written, 0u);
    ASSERT_GE(written + 3, texels) << "at least one byte a texel";
    // Element size from what was written, to the byte: the mark's bytes never equal a saturated texel's.
    while (written && out[written - 1] == (kMark >> (written - 1) % 4 * 8 & 0xff)) written--;
    ASSERT_EQ(written % texels, 0u);
    uint32_t element = written / texels;
    for (uint32_t t = 1; t < texels; t++)
      ASSERT_EQ(std::memcmp(out, out + t * element, element), 0) << "texel " << t;
    EXPECT_TRUE(std::any_of(out, out + element, [](uint8_t b) { return b != 0; }));
  }
  for (VkDeviceSize i = 0; i < needs.alignment; i++) ASSERT_EQ(bytes[i], 0xa5) << "before the image";
  for (VkDeviceSize i = 0; i < 4096; i++)
    ASSERT_EQ(bytes[needs.alignment + needs.size + i], 0xa5) << "behind the image";
  VK(vkDestroyImage)(device.handle, image, nullptr);
  VK(vkFreeMemory)(device.handle, memory, nullptr);
}

TEST(ImageFormats, WhatIsSupportedCanBeMadeBoundAndCleared) {
  TestDevice device;
  TestDevice::Buffer buffer = device.buffer(64 << 10);
  size_t made = 0;
  constexpr VkImageUsageFlags kTransfer = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  for (VkFormat format : coreFormats())
    for (VkImageTiling tiling : {VK_IMAGE_TILING_OPTIMAL, VK_IMAGE_TILING_LINEAR})
      for (VkImageType type : {VK_IMAGE_TYPE_1D, VK_IMAGE_TYPE_2D, VK_IMAGE_TYPE_3D}) {
        if (HasFailure() && made > 50) return;
        for (const Usage& u : kUsages) {
          VkImageFormatProperties p;
          VkImageUsageFlags usage = u.usage | kTransfer;
          if (VK(vkGetPhysicalDeviceImageFormatProperties)(physical(), format, type, tiling, usage, 0, &p) !=
              VK_SUCCESS)
            continue;
          for (uint32_t samples = 1; samples <= 64; samples *= 2)
            if (p.sampleCounts & samples) {
              clearAndRead(device, buffer, {format, type, tiling, usage, VkSampleCountFlagBits(samples)}, p);
              made++;
              if (HasFatalFailure()) return;
            }
        }
      }
  EXPECT_GT(made, 500u);
  device.release(buffer);
}

}  // namespace
}  // namespace pumice::icd::test
