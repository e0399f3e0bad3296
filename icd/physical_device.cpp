// Properties, limits, features, queue families and memory of the one device.
#include <algorithm>
#include <cstdio>
#include <cstring>

#include "base/cpu.h"
#include "entrypoints.h"
#include "icd/instance.h"
#include "icd/pipeline_cache.h"
#include "pipeline/layout.h"
#include "raster/tiles.h"
#include "spirv_interp/interpreter/executor.h"
#include "texture/format.h"

namespace pumice::icd {
namespace {

// Vulkan spec, "Limits". Where the implementation has no bound of its own the number is a large round one.
VkPhysicalDeviceLimits deviceLimits(uint64_t heapBytes) {
  VkPhysicalDeviceLimits l{};
  constexpr uint32_t kMany = 1 << 20;
  l.maxImageDimension1D = l.maxImageDimension2D = l.maxImageDimensionCube = 16384;
  l.maxImageDimension3D = 2048;
  l.maxImageArrayLayers = 2048;
  l.maxTexelBufferElements = 128u << 20;
  l.maxUniformBufferRange = 1u << 30;
  l.maxStorageBufferRange = uint32_t(std::min<uint64_t>(heapBytes, UINT32_MAX));
  l.maxPushConstantsSize = pipeline::kMaxPushBytes;
  l.maxMemoryAllocationCount = kMany;
  l.maxSamplerAllocationCount = kMany;
  l.bufferImageGranularity = 1;
  l.maxBoundDescriptorSets = ir::kMaxDescriptorSets;
  l.maxPerStageDescriptorSamplers = l.maxPerStageDescriptorUniformBuffers = l.maxPerStageDescriptorStorageBuffers = kMany;
  l.maxPerStageDescriptorSampledImages = l.maxPerStageDescriptorStorageImages = l.maxPerStageDescriptorInputAttachments = kMany;
  l.maxPerStageResources = kMany;
  l.maxDescriptorSetSamplers = l.maxDescriptorSetUniformBuffers = l.maxDescriptorSetStorageBuffers = kMany;
  l.maxDescriptorSetSampledImages = l.maxDescriptorSetStorageImages = l.maxDescriptorSetInputAttachments = kMany;
  l.maxDescriptorSetUniformBuffersDynamic = pipeline::kMaxDynamicOffsets / 2;
  l.maxDescriptorSetStorageBuffersDynamic = pipeline::kMaxDynamicOffsets / 2;
  l.maxVertexInputAttributes = pipeline::kMaxVertexAttributes;
  l.maxVertexInputBindings = pipeline::kMaxVertexBindings;
  l.maxVertexInputAttributeOffset = 2047;
  l.maxVertexInputBindingStride = 2048;
  l.maxVertexOutputComponents = raster::kMaxVaryings;
  l.maxFragmentInputComponents = raster::kMaxVaryings;
  l.maxFragmentOutputAttachments = pipeline::kMaxColorAttachments;
  l.maxFragmentDualSrcAttachments = 1;
  l.maxFragmentCombinedOutputResources = kMany;
  l.maxComputeSharedMemorySize = 64 << 10;
  for (uint32_t& n : l.maxComputeWorkGroupCount) n = 65535;
  l.maxComputeWorkGroupInvocations = pipeline::kMaxGroupInvocations;
  l.maxComputeWorkGroupSize[0] = l.maxComputeWorkGroupSize[1] = pipeline::kMaxGroupInvocations;
  l.maxComputeWorkGroupSize[2] = 64;
  l.subPixelPrecisionBits = raster::kSubpixelBits;
  l.subTexelPrecisionBits = 8;
  l.mipmapPrecisionBits = 8;
  l.maxDrawIndexedIndexValue = 0xffffffffu;
  l.maxDrawIndirectCount = 0xffffffffu;
  l.maxSamplerLodBias = 16;
  l.maxSamplerAnisotropy = 16;
  l.maxViewports = raster::kMaxViewports;
  l.maxViewportDimensions[0] = l.maxViewportDimensions[1] = 16384;
  l.viewportBoundsRange[0] = -32768;
  l.viewportBoundsRange[1] = 32767;
  l.viewportSubPixelBits = 8;
  l.minMemoryMapAlignment = 4096;
  l.minTexelBufferOffsetAlignment = l.minUniformBufferOffsetAlignment = l.minStorageBufferOffsetAlignment = 16;
  l.minTexelOffset = -8;
  l.maxTexelOffset = 7;
  l.minTexelGatherOffset = -32;
  l.maxTexelGatherOffset = 31;
  l.minInterpolationOffset = -0.5f;
  l.maxInterpolationOffset = 0.5f - 1.0f / 16;   // one unit of the bits below less than a half
  l.subPixelInterpolationOffsetBits = 4;
  l.maxFramebufferWidth = l.maxFramebufferHeight = 16384;
  l.maxFramebufferLayers = 2048;
  l.framebufferColorSampleCounts = texture::sampleCounts(*texture::formatInfo(VK_FORMAT_R8G8B8A8_UNORM));
  l.framebufferDepthSampleCounts = texture::sampleCounts(*texture::formatInfo(VK_FORMAT_D32_SFLOAT));
  l.framebufferStencilSampleCounts = texture::sampleCounts(*texture::formatInfo(VK_FORMAT_S8_UINT));
  l.framebufferNoAttachmentsSampleCounts = l.framebufferColorSampleCounts;
  l.maxColorAttachments = pipeline::kMaxColorAttachments;
  l.sampledImageColorSampleCounts = l.framebufferColorSampleCounts;
  l.sampledImageIntegerSampleCounts = l.framebufferColorSampleCounts;
  l.sampledImageDepthSampleCounts = l.framebufferDepthSampleCounts;
  l.sampledImageStencilSampleCounts = l.framebufferStencilSampleCounts;
  l.storageImageSampleCounts = l.framebufferColorSampleCounts;
  l.maxSampleMaskWords = 1;
  l.timestampComputeAndGraphics = VK_TRUE;
  l.timestampPeriod = 1;
  l.maxClipDistances = l.maxCullDistances = l.maxCombinedClipAndCullDistances = raster::kMaxClipDistances;
  l.discreteQueuePriorities = 2;
  l.pointSizeRange[0] = raster::kMinPointSize;
  l.pointSizeRange[1] = raster::kMaxPointSize;
  l.pointSizeGranularity = 1.0f / raster::kSubpixelOne;
  l.lineWidthRange[0] = raster::kMinLineWidth;
  l.lineWidthRange[1] = raster::kMaxLineWidth;
  l.lineWidthGranularity = 1.0f / raster::kSubpixelOne;
  l.strictLines = VK_TRUE;
  l.standardSampleLocations = VK_TRUE;
  l.optimalBufferCopyOffsetAlignment = l.optimalBufferCopyRowPitchAlignment = 64;
  l.nonCoherentAtomSize = 64;
  return l;
}

VkQueueFamilyProperties queueFamily() {
  VkQueueFamilyProperties p{};
  p.queueFlags = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT | VK_QUEUE_TRANSFER_BIT;
  p.queueCount = 1;
  p.timestampValidBits = 64;
  p.minImageTransferGranularity = {1, 1, 1};
  return p;
}

}  // namespace

void initPhysicalDevice(PhysicalDevice& device) {
  // Half a page of slack aside, everything the process may use is the heap.
  uint64_t heap = base::usableMemoryBytes() & ~uint64_t(0xfffff);
  device.features = supportedFeatures();

  VkPhysicalDeviceProperties& p = device.properties;
  p.apiVersion = kApiVersion;
  p.driverVersion = VK_MAKE_VERSION(PUMICE_VERSION_MAJOR, PUMICE_VERSION_MINOR, PUMICE_VERSION_PATCH);
  p.vendorID = 0x10000;   // Khronos: no identifier of our own is registered
  p.deviceID = 1;
  p.deviceType = VK_PHYSICAL_DEVICE_TYPE_CPU;
  std::snprintf(p.deviceName, sizeof p.deviceName, "Pumice (%s, %u threads)", interp::interpreterTarget(), base::usableCpus());
  buildUuid(p.pipelineCacheUUID);
  p.limits = deviceLimits(heap);
  initProperties(device.extendedProperties, p.limits, heap);

  VkPhysicalDeviceMemoryProperties& m = device.memory;
  m.memoryTypeCount = 1;
  m.memoryTypes[0].propertyFlags = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                   VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
  m.memoryTypes[0].heapIndex = 0;
  m.memoryHeapCount = 1;
  m.memoryHeaps[0] = {heap, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT};
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties* out) {
  *out = from(handle)->properties;
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceProperties2(VkPhysicalDevice handle, VkPhysicalDeviceProperties2* out) {
  out->properties = from(handle)->properties;
  fillProperties(from(handle)->extendedProperties, out->pNext);
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures* out) {
  *out = coreFeatures(from(handle)->features);
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceFeatures2(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2* out) {
  out->features = coreFeatures(from(handle)->features);
  fillFeatures(from(handle)->features, out->pNext);
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceQueueFamilyProperties(VkPhysicalDevice, uint32_t* count, VkQueueFamilyProperties* out) {
  enumerate(1, count, out, [](uint32_t, VkQueueFamilyProperties& p) { p = queueFamily(); });
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceQueueFamilyProperties2(VkPhysicalDevice, uint32_t* count, VkQueueFamilyProperties2* out) {
  enumerate(1, count, out, [](uint32_t, VkQueueFamilyProperties2& p) {
    p.queueFamilyProperties = queueFamily();
    for (auto* s = static_cast<VkBaseOutStructure*>(p.pNext); s; s = s->pNext)
      if (s->sType == VK_STRUCTURE_TYPE_QUEUE_FAMILY_GLOBAL_PRIORITY_PROPERTIES_KHR) {
        auto& priority = *reinterpret_cast<VkQueueFamilyGlobalPriorityPropertiesKHR*>(s);
        priority.priorityCount = 2;
        priority.priorities[0] = VK_QUEUE_GLOBAL_PRIORITY_LOW_KHR;
        priority.priorities[1] = VK_QUEUE_GLOBAL_PRIORITY_MEDIUM_KHR;
      }
  });
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceMemoryProperties(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties* out) {
  *out = from(handle)->memory;
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceMemoryProperties2(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties2* out) {
  out->memoryProperties = from(handle)->memory;
  for (auto* s = static_cast<VkBaseOutStructure*>(out->pNext); s; s = s->pNext)
    if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_BUDGET_PROPERTIES_EXT) {
      auto& budget = *reinterpret_cast<VkPhysicalDeviceMemoryBudgetPropertiesEXT*>(s);
      for (uint32_t i = 0; i < VK_MAX_MEMORY_HEAPS; i++) budget.heapBudget[i] = budget.heapUsage[i] = 0;
      budget.heapBudget[0] = from(handle)->memory.memoryHeaps[0].size;
      budget.heapUsage[0] = from(handle)->allocatedBytes;
    }
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceExternalFenceProperties(VkPhysicalDevice, const VkPhysicalDeviceExternalFenceInfo*, VkExternalFenceProperties* out) {
  out->exportFromImportedHandleTypes = out->compatibleHandleTypes = 0;
  out->externalFenceFeatures = 0;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceToolProperties(VkPhysicalDevice, uint32_t* count, VkPhysicalDeviceToolProperties*) {
  *count = 0;
  return VK_SUCCESS;
}

}  // namespace pumice::icd
