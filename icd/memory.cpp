// Device memory, buffers, buffer views and their requirements.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "base/address_ranges.h"
#include "base/log.h"
#include "base/pages.h"
#include "entrypoints.h"
#include "icd/resources.h"

namespace pumice::icd {

void fillDedicated(void* chain) {
  for (auto* s = static_cast<VkBaseOutStructure*>(chain); s; s = s->pNext)
    if (s->sType == VK_STRUCTURE_TYPE_MEMORY_DEDICATED_REQUIREMENTS) {
      auto& d = *reinterpret_cast<VkMemoryDedicatedRequirements*>(s);
      d.prefersDedicatedAllocation = d.requiresDedicatedAllocation = VK_FALSE;
    }
}

namespace {

void bindBuffer(VkBuffer handle, VkDeviceMemory memory, VkDeviceSize offset) {
  Buffer& buffer = *from(handle);
  buffer.data = from(memory)->data + offset;
  if (buffer.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) base::addressRanges().add(reinterpret_cast<uint64_t>(buffer.data), buffer.size);
}

// Seals keep the others who have the file from cutting pages off under us.
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW;

VkResult makeSharedFile(uint64_t size, OwnedFd& out) {
  OwnedFd file(::memfd_create("pumice-memory", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!file) return VK_ERROR_OUT_OF_HOST_MEMORY;
  if (::ftruncate(file.get(), off_t(size)) || ::fcntl(file.get(), F_ADD_SEALS, kSeals)) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  out = std::move(file);
  return VK_SUCCESS;
}

// Only what an export has made: a sealed file that is large enough.
bool importable(int fd, uint64_t size) {
  struct stat status;
  const int seals = ::fcntl(fd, F_GET_SEALS);
  return seals >= 0 && (seals & F_SEAL_SHRINK) && !::fstat(fd, &status) && status.st_size >= 0 && uint64_t(status.st_size) >= size;
}

//! Gives the memory its pages. On success a file descriptor that was imported is ours.
VkResult mapPages(DeviceMemory& memory, const void* chain) {
  if (auto* host = findInChain<VkImportMemoryHostPointerInfoEXT>(chain, VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT); host && host->handleType) {
    if (!host->pHostPointer || reinterpret_cast<uintptr_t>(host->pHostPointer) % kHostPointerAlignment) return VK_ERROR_INVALID_EXTERNAL_HANDLE;
    memory.data = static_cast<std::byte*>(host->pHostPointer);
    memory.ours = false;
    return VK_SUCCESS;
  }
  auto* imported = findInChain<VkImportMemoryFdInfoKHR>(chain, VK_STRUCTURE_TYPE_IMPORT_MEMORY_FD_INFO_KHR);
  auto* exported = findInChain<VkExportMemoryAllocateInfo>(chain, VK_STRUCTURE_TYPE_EXPORT_MEMORY_ALLOCATE_INFO);
  OwnedFd file;
  int fd = -1;
  if (imported && imported->handleType) {
    if (imported->handleType != VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT || !importable(imported->fd, memory.size)) return VK_ERROR_INVALID_EXTERNAL_HANDLE;
    fd = imported->fd;
  } else if (exported && exported->handleTypes) {
    if (VkResult result = makeSharedFile(memory.size, file)) return result;
    fd = file.get();
  }
  void* pages = fd < 0 ? base::mapPages(memory.size) : ::mmap(nullptr, memory.size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE, fd, 0);
  if (!pages || pages == MAP_FAILED) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  memory.data = static_cast<std::byte*>(pages);
  if (fd >= 0) memory.shared = file ? std::move(file) : OwnedFd(fd);
  return VK_SUCCESS;
}

VkMemoryRequirements bufferRequirements(uint64_t size) { return {(size + 63) & ~uint64_t(63), 64, kMemoryTypeBits}; }

}  // namespace

VKAPI_ATTR VkResult VKAPI_CALL vkAllocateMemory(VkDevice handle, const VkMemoryAllocateInfo* info, const VkAllocationCallbacks* callbacks, VkDeviceMemory* out) {
  Device& device = *from(handle);
  uint64_t size = info->allocationSize;
  if (!device.reserve(size)) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  auto* memory = device.make<DeviceMemory>(callbacks);
  if (!memory) {
    device.release(size);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  memory->size = size;
  if (VkResult result = mapPages(*memory, info->pNext)) {
    device.destroy(callbacks, memory);
    device.release(size);
    return result;
  }
  if (!memory->ours) device.release(size);   // the host program's: not of the heap
  *out = to<VkDeviceMemory>(memory);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkFreeMemory(VkDevice handle, VkDeviceMemory memoryHandle, const VkAllocationCallbacks* callbacks) {
  if (auto* memory = from(memoryHandle)) {
    if (memory->ours) {
      munmap(memory->data, memory->size);
      from(handle)->release(memory->size);
    }
    from(handle)->destroy(callbacks, memory);
  }
}

VKAPI_ATTR VkResult VKAPI_CALL vkMapMemory(VkDevice, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize, VkMemoryMapFlags, void** out) {
  *out = from(memory)->data + offset;
  return VK_SUCCESS;
}

// Mapped memory is the memory itself: nothing to undo, nothing to flush.
VKAPI_ATTR void VKAPI_CALL vkUnmapMemory(VkDevice, VkDeviceMemory) {}

VKAPI_ATTR VkResult VKAPI_CALL vkMapMemory2KHR(VkDevice device, const VkMemoryMapInfoKHR* info, void** out) {
  return vkMapMemory(device, info->memory, info->offset, info->size, info->flags, out);
}

VKAPI_ATTR VkResult VKAPI_CALL vkUnmapMemory2KHR(VkDevice, const VkMemoryUnmapInfoKHR*) { return VK_SUCCESS; }
VKAPI_ATTR VkResult VKAPI_CALL vkFlushMappedMemoryRanges(VkDevice, uint32_t, const VkMappedMemoryRange*) { return VK_SUCCESS; }
VKAPI_ATTR VkResult VKAPI_CALL vkInvalidateMappedMemoryRanges(VkDevice, uint32_t, const VkMappedMemoryRange*) { return VK_SUCCESS; }

VKAPI_ATTR void VKAPI_CALL vkGetDeviceMemoryCommitment(VkDevice, VkDeviceMemory memory, VkDeviceSize* out) { *out = from(memory)->size; }

VKAPI_ATTR VkResult VKAPI_CALL vkCreateBuffer(VkDevice handle, const VkBufferCreateInfo* info, const VkAllocationCallbacks* callbacks, VkBuffer* out) {
  auto* buffer = from(handle)->make<Buffer>(callbacks);
  if (!buffer) return VK_ERROR_OUT_OF_HOST_MEMORY;
  // No address space holds more: the sum of requirements must not wrap.
  if (info->size > (uint64_t(1) << 47)) {
    from(handle)->destroy(callbacks, buffer);
    return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  }
  buffer->size = info->size;
  buffer->usage = info->usage;
  *out = to<VkBuffer>(buffer);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyBuffer(VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks* callbacks) {
  if (const Buffer* b = from(buffer); b && b->data && (b->usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT))
    base::addressRanges().remove(reinterpret_cast<uint64_t>(b->data), b->size);
  from(handle)->destroy(callbacks, from(buffer));
}

VKAPI_ATTR void VKAPI_CALL vkGetBufferMemoryRequirements(VkDevice, VkBuffer buffer, VkMemoryRequirements* out) {
  *out = bufferRequirements(from(buffer)->size);
}

VKAPI_ATTR void VKAPI_CALL vkGetBufferMemoryRequirements2(VkDevice, const VkBufferMemoryRequirementsInfo2* info, VkMemoryRequirements2* out) {
  out->memoryRequirements = bufferRequirements(from(info->buffer)->size);
  fillDedicated(out->pNext);
}

VKAPI_ATTR void VKAPI_CALL vkGetDeviceBufferMemoryRequirements(VkDevice, const VkDeviceBufferMemoryRequirements* info, VkMemoryRequirements2* out) {
  out->memoryRequirements = bufferRequirements(info->pCreateInfo->size);
  fillDedicated(out->pNext);
}

VKAPI_ATTR VkResult VKAPI_CALL vkBindBufferMemory(VkDevice, VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset) {
  bindBuffer(buffer, memory, offset);
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkBindBufferMemory2(VkDevice, uint32_t count, const VkBindBufferMemoryInfo* infos) {
  for (uint32_t i = 0; i < count; i++) bindBuffer(infos[i].buffer, infos[i].memory, infos[i].memoryOffset);
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateBufferView(VkDevice handle, const VkBufferViewCreateInfo* info, const VkAllocationCallbacks* callbacks, VkBufferView* out) {
  auto* view = from(handle)->make<BufferView>(callbacks);
  if (!view) return VK_ERROR_OUT_OF_HOST_MEMORY;
  texture::BufferMemory range = from(info->buffer)->range(info->offset, info->range);
  const auto* format = texture::formatInfo(info->format);
  view->descriptor.base = reinterpret_cast<uint64_t>(range.base);
  view->descriptor.format = info->format;
  view->descriptor.elements = format ? uint32_t(range.size / format->elementBytes) : 0;
  view->descriptor.size = format ? uint64_t(view->descriptor.elements) * format->elementBytes : 0;
  *out = to<VkBufferView>(view);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyBufferView(VkDevice handle, VkBufferView view, const VkAllocationCallbacks* callbacks) {
  from(handle)->destroy(callbacks, from(view));
}

// An address is the memory's own.
VKAPI_ATTR VkDeviceAddress VKAPI_CALL vkGetBufferDeviceAddress(VkDevice, const VkBufferDeviceAddressInfo* info) {
  return reinterpret_cast<VkDeviceAddress>(from(info->buffer)->data);
}
// Capture and replay of addresses is not offered: 0, as the spec says for what cannot be replayed.
VKAPI_ATTR uint64_t VKAPI_CALL vkGetBufferOpaqueCaptureAddress(VkDevice, const VkBufferDeviceAddressInfo*) { return 0; }
VKAPI_ATTR uint64_t VKAPI_CALL vkGetDeviceMemoryOpaqueCaptureAddress(VkDevice, const VkDeviceMemoryOpaqueCaptureAddressInfo*) { return 0; }

}  // namespace pumice::icd
