#include "icd/device.h"

#include "base/cpu.h"
#include "base/log.h"
#include "entrypoints.h"
#include "icd/queue.h"
#include "spirv_interp/ir/debug_print.h"

namespace pumice::icd {

Device::Device(PhysicalDevice& p, HostAllocator a) : physical(p), allocator(a), pool(base::usableCpus()) {
  queue.device = this;
  queue.worker = std::make_unique<QueueWorker>(*this);
}

Device::~Device() = default;

VKAPI_ATTR VkResult VKAPI_CALL vkCreateDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo* info, const VkAllocationCallbacks* callbacks, VkDevice* out) {
  PhysicalDevice& physical = *from(handle);
  ExtensionSet enabled;
  for (uint32_t i = 0; i < info->enabledExtensionCount; i++) {
    size_t e = findExtension(info->ppEnabledExtensionNames[i]);
    if (e == size_t(Extension::kCount) || extensionInfo(e).level != ExtensionLevel::Device) {
      base::logError("vkCreateDevice: extension %s is not supported", info->ppEnabledExtensionNames[i]);
      return VK_ERROR_EXTENSION_NOT_PRESENT;
    }
    enabled.set(e);
  }
  FeatureSet wanted = requestedFeatures(info->pEnabledFeatures, info->pNext);
  if (FeatureSet missing = wanted & ~physical.features; missing.any()) {
    base::logError("vkCreateDevice: feature %s is not supported", featureName(missing._Find_first()));
    return VK_ERROR_FEATURE_NOT_PRESENT;
  }
  for (uint32_t i = 0; i < info->queueCreateInfoCount; i++) {
    auto* priority = findInChain<VkDeviceQueueGlobalPriorityCreateInfoKHR>(info->pQueueCreateInfos[i].pNext, VK_STRUCTURE_TYPE_DEVICE_QUEUE_GLOBAL_PRIORITY_CREATE_INFO_KHR);
    if (priority && priority->globalPriority > VK_QUEUE_GLOBAL_PRIORITY_MEDIUM_KHR) return VK_ERROR_NOT_PERMITTED_KHR;
  }
  HostAllocator allocator = physical.instance->allocator.orElse(callbacks);
  auto* device = makeObject<Device>(allocator, VK_SYSTEM_ALLOCATION_SCOPE_DEVICE, physical, allocator);
  if (!device) return VK_ERROR_OUT_OF_HOST_MEMORY;
  device->extensions = enabled;
  ir::restartPrinting();
  device->features = wanted;
  *out = to<VkDevice>(device);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyDevice(VkDevice handle, const VkAllocationCallbacks* callbacks) {
  if (auto* device = from(handle)) {
    HostAllocator allocator = device->allocatorFor(callbacks);
    destroyObject(allocator, device);
  }
}

VKAPI_ATTR void VKAPI_CALL vkGetDeviceQueue(VkDevice device, uint32_t, uint32_t, VkQueue* out) { *out = to<VkQueue>(&from(device)->queue); }
VKAPI_ATTR void VKAPI_CALL vkGetDeviceQueue2(VkDevice device, const VkDeviceQueueInfo2*, VkQueue* out) { *out = to<VkQueue>(&from(device)->queue); }

VKAPI_ATTR void VKAPI_CALL vkGetDeviceGroupPeerMemoryFeatures(VkDevice, uint32_t, uint32_t, uint32_t, VkPeerMemoryFeatureFlags* out) {
  *out = VK_PEER_MEMORY_FEATURE_COPY_SRC_BIT | VK_PEER_MEMORY_FEATURE_COPY_DST_BIT | VK_PEER_MEMORY_FEATURE_GENERIC_SRC_BIT | VK_PEER_MEMORY_FEATURE_GENERIC_DST_BIT;
}

}  // namespace pumice::icd
