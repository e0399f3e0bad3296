// VK_EXT_private_data (core in 1.3): 64 bits of the application's per object and slot.
#include <mutex>
#include <unordered_map>

#include "entrypoints.h"
#include "icd/device.h"

namespace pumice::icd {

struct PrivateDataSlot {
  std::mutex mutex;
  std::unordered_map<uint64_t, uint64_t> values;
};
PUMICE_HANDLE(PrivateDataSlot, VkPrivateDataSlot)

VKAPI_ATTR VkResult VKAPI_CALL vkCreatePrivateDataSlot(VkDevice device, const VkPrivateDataSlotCreateInfo*, const VkAllocationCallbacks* callbacks, VkPrivateDataSlot* out) {
  auto* slot = from(device)->make<PrivateDataSlot>(callbacks);
  if (!slot) return VK_ERROR_OUT_OF_HOST_MEMORY;
  *out = to<VkPrivateDataSlot>(slot);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyPrivateDataSlot(VkDevice device, VkPrivateDataSlot slot, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(slot)); }

VKAPI_ATTR VkResult VKAPI_CALL vkSetPrivateData(VkDevice, VkObjectType, uint64_t object, VkPrivateDataSlot slot, uint64_t data) {
  std::lock_guard lock(from(slot)->mutex);
  try {
    from(slot)->values[object] = data;
  } catch (const std::bad_alloc&) {
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkGetPrivateData(VkDevice, VkObjectType, uint64_t object, VkPrivateDataSlot slot, uint64_t* data) {
  std::lock_guard lock(from(slot)->mutex);
  auto it = from(slot)->values.find(object);
  *data = it == from(slot)->values.end() ? 0 : it->second;
}

}  // namespace pumice::icd
