// Memory and semaphores that other devices and processes share: file descriptors (a memfd, an eventfd) and memory of the
// host program. What may be done with which handle type is said here alone.
#pragma once

#include <unistd.h>

#include <utility>

#include "icd/vulkan.h"

namespace pumice::icd {

//! A file descriptor that is closed with its owner.
class OwnedFd {
 public:
  OwnedFd() = default;
  explicit OwnedFd(int fd) : fd_(fd) {}
  ~OwnedFd() { reset(); }
  OwnedFd(OwnedFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  OwnedFd& operator=(OwnedFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  void reset(int fd = -1) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
  }

 private:
  int fd_ = -1;
};

constexpr uint64_t kHostPointerAlignment = 4096;   //!< minImportedHostPointerAlignment

constexpr VkExternalMemoryProperties externalMemory(VkExternalMemoryHandleTypeFlagBits type) {
  switch (type) {
    case VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT:
      return {VK_EXTERNAL_MEMORY_FEATURE_EXPORTABLE_BIT | VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT, VkExternalMemoryHandleTypeFlags(type),
              VkExternalMemoryHandleTypeFlags(type)};
    case VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT:
    case VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_MAPPED_FOREIGN_MEMORY_BIT_EXT:
      return {VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT, 0, VkExternalMemoryHandleTypeFlags(type)};
    default: return {};
  }
}

//! Timeline semaphores are not shared.
constexpr bool externalSemaphore(VkExternalSemaphoreHandleTypeFlagBits type, bool timeline) {
  return type == VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT && !timeline;
}

//! A duplicate for the application; VK_ERROR_TOO_MANY_OBJECTS when there are no more descriptors.
VkResult duplicateFd(int fd, int* out);

}  // namespace pumice::icd
