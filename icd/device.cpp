#include "icd/device.h"

#include <cstring>

#include "base/cpu.h"
#include "base/log.h"
#include "entrypoints.h"
#include "icd/queue.h"

namespace pumice::icd {

Device::Device(PhysicalDevice& p, HostAllocator a) : physical(p), allocator(a), pool(base::usableCpus()) {
  queue.device = this;
  queue.worker = std::make_unique<QueueWorker>(*this);
}

Device::~Device() = default;

namespace {

// A requested feature must be one we have.
bool featuresSupported(const VkPhysicalDeviceFeatures& wanted, const VkPhysicalDeviceFeatures& have) {
  constexpr size_t kCount = sizeof(VkPhysicalDeviceFeatures) / sizeof(VkBool32);
  VkBool32 w[kCount], h[kCount];
  std::memcpy(w, &wanted, sizeof w);
  std::memcpy(h, &have, sizeof h);
  for (size_t i = 0; i < kCount; i++)
    if (w[i] && !h[i]) return false;
  return true;
}

}  // namespace

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
  const VkPhysicalDeviceFeatures* wanted = info->pEnabledFeatures;
  if (auto* chained = findInChain<VkPhysicalDeviceFeatures2>(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2)) wanted = &chained->features;
  if (wanted && !featuresSupported(*wanted, physical.features)) {
    base::logError("vkCreateDevice: a requested feature is not supported");
    return VK_ERROR_FEATURE_NOT_PRESENT;
  }
  HostAllocator allocator = physical.instance->allocator.orElse(callbacks);
  auto* device = makeObject<Device>(allocator, VK_SYSTEM_ALLOCATION_SCOPE_DEVICE, physical, allocator);
  if (!device) return VK_ERROR_OUT_OF_HOST_MEMORY;
  device->extensions = enabled;
  if (wanted) device->features = *wanted;
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
