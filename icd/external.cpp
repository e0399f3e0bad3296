#include "icd/external.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>

#include "entrypoints.h"
#include "icd/queue.h"
#include "icd/resources.h"
#include "icd/sync.h"

namespace pumice::icd {

VkResult duplicateFd(int fd, int* out) {
  *out = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);
  return *out < 0 ? VK_ERROR_TOO_MANY_OBJECTS : VK_SUCCESS;
}

// --- memory

VKAPI_ATTR VkResult VKAPI_CALL vkGetMemoryFdKHR(VkDevice, const VkMemoryGetFdInfoKHR* info, int* out) { return duplicateFd(from(info->memory)->shared.get(), out); }

// Of handles that others have made, which are not taken; an opaque one is not to be asked about.
VKAPI_ATTR VkResult VKAPI_CALL vkGetMemoryFdPropertiesKHR(VkDevice, VkExternalMemoryHandleTypeFlagBits, int, VkMemoryFdPropertiesKHR* out) {
  out->memoryTypeBits = 0;
  return VK_ERROR_INVALID_EXTERNAL_HANDLE;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetMemoryHostPointerPropertiesEXT(VkDevice, VkExternalMemoryHandleTypeFlagBits type, const void* pointer, VkMemoryHostPointerPropertiesEXT* out) {
  const bool usable = type != VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT && externalMemory(type).externalMemoryFeatures && pointer &&
                      reinterpret_cast<uintptr_t>(pointer) % kHostPointerAlignment == 0;
  out->memoryTypeBits = usable ? kMemoryTypeBits : 0;
  return usable ? VK_SUCCESS : VK_ERROR_INVALID_EXTERNAL_HANDLE;
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceExternalBufferProperties(VkPhysicalDevice, const VkPhysicalDeviceExternalBufferInfo* info, VkExternalBufferProperties* out) {
  out->externalMemoryProperties = externalMemory(info->handleType);
}

// --- semaphores

bool SharedPayload::make() {
  fd.reset(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK | EFD_SEMAPHORE));
  return bool(fd);
}

void SharedPayload::signal() const {
  const uint64_t one = 1;
  // A signalled semaphore may not be signalled again, so the count cannot overflow.
  [[maybe_unused]] auto written = ::write(fd.get(), &one, sizeof one);
}

bool SharedPayload::consume(int milliseconds) const {
  uint64_t value = 0;
  if (::read(fd.get(), &value, sizeof value) == sizeof value) return true;
  pollfd p{fd.get(), POLLIN, 0};
  ::poll(&p, 1, milliseconds);
  return ::read(fd.get(), &value, sizeof value) == sizeof value;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetSemaphoreFdKHR(VkDevice, const VkSemaphoreGetFdInfoKHR* info, int* out) {
  const SharedPayload* payload = from(info->semaphore)->payload();
  *out = -1;
  return payload ? duplicateFd(payload->fd.get(), out) : VK_ERROR_INVALID_EXTERNAL_HANDLE;
}

VKAPI_ATTR VkResult VKAPI_CALL vkImportSemaphoreFdKHR(VkDevice device, const VkImportSemaphoreFdInfoKHR* info) {
  Semaphore& semaphore = *from(info->semaphore);
  if (!externalSemaphore(info->handleType, semaphore.timeline) || ::fcntl(info->fd, F_GETFD) < 0) return VK_ERROR_INVALID_EXTERNAL_HANDLE;
  from(device)->queue.worker->hub().update([&] {
    (info->flags & VK_SEMAPHORE_IMPORT_TEMPORARY_BIT ? semaphore.temporary : semaphore.permanent).fd.reset(info->fd);
  });
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceExternalSemaphoreProperties(VkPhysicalDevice, const VkPhysicalDeviceExternalSemaphoreInfo* info, VkExternalSemaphoreProperties* out) {
  auto* type = findInChain<VkSemaphoreTypeCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO);
  const bool can = externalSemaphore(info->handleType, type && type->semaphoreType == VK_SEMAPHORE_TYPE_TIMELINE);
  out->exportFromImportedHandleTypes = out->compatibleHandleTypes = can ? VkExternalSemaphoreHandleTypeFlags(info->handleType) : 0;
  out->externalSemaphoreFeatures = can ? VK_EXTERNAL_SEMAPHORE_FEATURE_EXPORTABLE_BIT | VK_EXTERNAL_SEMAPHORE_FEATURE_IMPORTABLE_BIT : 0;
}

}  // namespace pumice::icd
