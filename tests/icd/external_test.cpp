// Memory and semaphores that two devices share by file descriptors, and memory of the host program.
#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "tests/icd/driver.h"

namespace pumice::icd::test {
namespace {

constexpr auto kOpaque = VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT;
constexpr auto kHost = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
constexpr auto kSemaphoreFd = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;

VkResult allocate(TestDevice& d, const void* chain, VkDeviceSize size, VkDeviceMemory& out) {
  VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, chain, size, 0};
  return VK(vkAllocateMemory)(d.handle, &info, nullptr, &out);
}

VkResult importFd(TestDevice& d, int fd, VkDeviceSize size, VkDeviceMemory& out) {
  VkImportMemoryFdInfoKHR import{VK_STRUCTURE_TYPE_IMPORT_MEMORY_FD_INFO_KHR, nullptr, kOpaque, fd};
  return allocate(d, &import, size, out);
}

int exportFd(TestDevice& d, VkDeviceMemory memory) {
  VkMemoryGetFdInfoKHR info{VK_STRUCTURE_TYPE_MEMORY_GET_FD_INFO_KHR, nullptr, memory, kOpaque};
  int fd = -1;
  EXPECT_EQ(VK(vkGetMemoryFdKHR)(d.handle, &info, &fd), VK_SUCCESS);
  return fd;
}

VkBuffer bufferOn(TestDevice& d, VkDeviceMemory memory, VkDeviceSize size) {
  VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, nullptr, 0, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, VK_SHARING_MODE_EXCLUSIVE, 0, nullptr};
  VkBuffer buffer = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreateBuffer)(d.handle, &info, nullptr, &buffer), VK_SUCCESS);
  EXPECT_EQ(VK(vkBindBufferMemory)(d.handle, buffer, memory, 0), VK_SUCCESS);
  return buffer;
}

void fill(TestDevice& d, VkBuffer buffer, VkDeviceSize offset, uint32_t value) {
  VkCommandBuffer commands = d.begin();
  VK(vkCmdFillBuffer)(commands, buffer, offset, 4, value);
  d.run(commands);
}

TEST(ExternalMemory, WhatMayBeSharedIsReported) {
  const auto properties = [](VkExternalMemoryHandleTypeFlagBits type) {
    VkPhysicalDeviceExternalBufferInfo info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO, nullptr, 0, VK_BUFFER_USAGE_TRANSFER_DST_BIT, type};
    VkExternalBufferProperties out{VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES, nullptr, {}};
    VK(vkGetPhysicalDeviceExternalBufferProperties)(physicalDevice(commonInstance()), &info, &out);
    return out.externalMemoryProperties;
  };
  EXPECT_EQ(properties(kOpaque).externalMemoryFeatures, VkExternalMemoryFeatureFlags(VK_EXTERNAL_MEMORY_FEATURE_EXPORTABLE_BIT | VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT));
  EXPECT_EQ(properties(kHost).externalMemoryFeatures, VkExternalMemoryFeatureFlags(VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT));
  EXPECT_EQ(properties(VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT).externalMemoryFeatures, 0u);
  for (auto [type, result] : {std::pair{kOpaque, VK_SUCCESS}, {VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT, VK_ERROR_FORMAT_NOT_SUPPORTED}}) {
    VkPhysicalDeviceExternalImageFormatInfo external{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_IMAGE_FORMAT_INFO, nullptr, type};
    VkPhysicalDeviceImageFormatInfo2 info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_IMAGE_FORMAT_INFO_2, &external, VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D,
                                          VK_IMAGE_TILING_OPTIMAL, VK_IMAGE_USAGE_SAMPLED_BIT, 0};
    VkExternalImageFormatProperties sharing{VK_STRUCTURE_TYPE_EXTERNAL_IMAGE_FORMAT_PROPERTIES, nullptr, {}};
    VkImageFormatProperties2 out{VK_STRUCTURE_TYPE_IMAGE_FORMAT_PROPERTIES_2, &sharing, {}};
    EXPECT_EQ(VK(vkGetPhysicalDeviceImageFormatProperties2)(physicalDevice(commonInstance()), &info, &out), result);
    EXPECT_EQ(sharing.externalMemoryProperties.externalMemoryFeatures != 0, result == VK_SUCCESS);
  }
}

TEST(ExternalMemory, TwoDevicesSeeTheSameBytes) {
  TestDevice a, b;
  constexpr VkDeviceSize kSize = 65536;
  VkExportMemoryAllocateInfo exported{VK_STRUCTURE_TYPE_EXPORT_MEMORY_ALLOCATE_INFO, nullptr, kOpaque};
  VkDeviceMemory one = VK_NULL_HANDLE, two = VK_NULL_HANDLE, three = VK_NULL_HANDLE;
  ASSERT_EQ(allocate(a, &exported, kSize, one), VK_SUCCESS);
  int fd = exportFd(a, one);
  ASSERT_EQ(importFd(b, fd, kSize * 2, two), VK_ERROR_INVALID_EXTERNAL_HANDLE) << "larger than what was exported";
  ASSERT_EQ(importFd(b, fd, kSize, two), VK_SUCCESS);   // the descriptor is the driver's now
  ASSERT_EQ(importFd(b, exportFd(b, two), kSize, three), VK_SUCCESS) << "exported from what was imported";
  VkBuffer bufferA = bufferOn(a, one, kSize), bufferB = bufferOn(b, two, kSize);
  fill(a, bufferA, 0, 0x11111111);
  fill(b, bufferB, 4, 0x22222222);
  VK(vkDestroyBuffer)(a.handle, bufferA, nullptr);
  VK(vkFreeMemory)(a.handle, one, nullptr);   // what others have stays
  void* data = nullptr;
  ASSERT_EQ(VK(vkMapMemory)(b.handle, three, 0, VK_WHOLE_SIZE, 0, &data), VK_SUCCESS);
  EXPECT_EQ(static_cast<uint32_t*>(data)[0], 0x11111111u);
  EXPECT_EQ(static_cast<uint32_t*>(data)[1], 0x22222222u);
  EXPECT_EQ(static_cast<uint32_t*>(data)[2], 0u) << "fresh memory is zero";
  VK(vkDestroyBuffer)(b.handle, bufferB, nullptr);
  VK(vkFreeMemory)(b.handle, two, nullptr);
  VK(vkFreeMemory)(b.handle, three, nullptr);
}

TEST(ExternalMemory, OnlyWhatAnExportMadeIsTaken) {
  TestDevice d;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  int pipes[2];
  ASSERT_EQ(::pipe(pipes), 0);
  EXPECT_EQ(importFd(d, pipes[0], 4096, memory), VK_ERROR_INVALID_EXTERNAL_HANDLE);
  EXPECT_EQ(importFd(d, -1, 4096, memory), VK_ERROR_INVALID_EXTERNAL_HANDLE);
  int shrinkable = ::memfd_create("test", MFD_CLOEXEC);
  ASSERT_EQ(::ftruncate(shrinkable, 4096), 0);
  EXPECT_EQ(importFd(d, shrinkable, 4096, memory), VK_ERROR_INVALID_EXTERNAL_HANDLE) << "its owner could cut it off";
  EXPECT_EQ(::fcntl(shrinkable, F_GETFD) >= 0, true) << "a refused descriptor stays the application's";
  for (int fd : {pipes[0], pipes[1], shrinkable}) ::close(fd);
  VkMemoryFdPropertiesKHR properties{VK_STRUCTURE_TYPE_MEMORY_FD_PROPERTIES_KHR, nullptr, 7};
  EXPECT_EQ(VK(vkGetMemoryFdPropertiesKHR)(d.handle, VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT, 0, &properties), VK_ERROR_INVALID_EXTERNAL_HANDLE);
}

TEST(ExternalMemory, OfTheHostProgramIsUsedInPlace) {
  TestDevice d;
  constexpr size_t kSize = 8192;
  auto* own = static_cast<uint32_t*>(std::aligned_alloc(4096, kSize));
  std::memset(own, 0xab, kSize);
  VkMemoryHostPointerPropertiesEXT properties{VK_STRUCTURE_TYPE_MEMORY_HOST_POINTER_PROPERTIES_EXT, nullptr, 0};
  ASSERT_EQ(VK(vkGetMemoryHostPointerPropertiesEXT)(d.handle, kHost, own, &properties), VK_SUCCESS);
  EXPECT_EQ(properties.memoryTypeBits, 1u);
  EXPECT_EQ(VK(vkGetMemoryHostPointerPropertiesEXT)(d.handle, kHost, own + 1, &properties), VK_ERROR_INVALID_EXTERNAL_HANDLE) << "not aligned";
  VkImportMemoryHostPointerInfoEXT import{VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT, nullptr, kHost, own};
  VkDeviceMemory memory = VK_NULL_HANDLE;
  ASSERT_EQ(allocate(d, &import, kSize, memory), VK_SUCCESS);
  VkBuffer buffer = bufferOn(d, memory, kSize);
  fill(d, buffer, 8, 0x33333333);
  EXPECT_EQ(own[2], 0x33333333u);
  EXPECT_EQ(own[3], 0xababababu);
  VK(vkDestroyBuffer)(d.handle, buffer, nullptr);
  VK(vkFreeMemory)(d.handle, memory, nullptr);
  EXPECT_EQ(own[2], 0x33333333u) << "freeing the import leaves the memory alone";
  std::free(own);
}

VkSemaphore exportable(TestDevice& d) {
  VkExportSemaphoreCreateInfo exported{VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO, nullptr, kSemaphoreFd};
  VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &exported, 0};
  VkSemaphore semaphore = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreateSemaphore)(d.handle, &info, nullptr, &semaphore), VK_SUCCESS);
  return semaphore;
}

int semaphoreFd(TestDevice& d, VkSemaphore semaphore) {
  VkSemaphoreGetFdInfoKHR info{VK_STRUCTURE_TYPE_SEMAPHORE_GET_FD_INFO_KHR, nullptr, semaphore, kSemaphoreFd};
  int fd = -1;
  EXPECT_EQ(VK(vkGetSemaphoreFdKHR)(d.handle, &info, &fd), VK_SUCCESS);
  return fd;
}

VkResult importSemaphore(TestDevice& d, VkSemaphore semaphore, int fd, VkSemaphoreImportFlags flags) {
  VkImportSemaphoreFdInfoKHR info{VK_STRUCTURE_TYPE_IMPORT_SEMAPHORE_FD_INFO_KHR, nullptr, semaphore, flags, kSemaphoreFd, fd};
  return VK(vkImportSemaphoreFdKHR)(d.handle, &info);
}

// Submits a fill that waits or signals; the fence says when it has run.
VkFence submitFill(TestDevice& d, const TestDevice::Buffer& buffer, uint32_t value, VkSemaphore wait, VkSemaphore signal) {
  VkCommandBuffer commands = d.begin();
  VK(vkCmdFillBuffer)(commands, buffer.handle, 0, 4, value);
  d.end(commands);
  VkFence fence = d.fence();
  EXPECT_EQ(d.submit(commands, fence, wait, signal), VK_SUCCESS);
  return fence;
}

VkResult waitFor(TestDevice& d, VkFence fence, uint64_t nanoseconds) { return VK(vkWaitForFences)(d.handle, 1, &fence, VK_TRUE, nanoseconds); }

TEST(ExternalSemaphore, OneDeviceWaitsForAnother) {
  TestDevice a, b;
  TestDevice::Buffer bufferA = a.buffer(64), bufferB = b.buffer(64);
  VkSemaphore signalled = exportable(a), waited = b.semaphore();
  ASSERT_EQ(importSemaphore(b, waited, -1, 0), VK_ERROR_INVALID_EXTERNAL_HANDLE);
  ASSERT_EQ(importSemaphore(b, waited, semaphoreFd(a, signalled), 0), VK_SUCCESS);
  for (uint32_t round = 1; round < 4; round++) {
    VkFence later = submitFill(b, bufferB, round, waited, VK_NULL_HANDLE);
    EXPECT_EQ(waitFor(b, later, 30'000'000), VK_TIMEOUT);
    EXPECT_EQ(bufferB.words[0], round - 1) << "ran before it was signalled";
    EXPECT_EQ(VK(vkGetFenceStatus)(b.handle, later), VK_NOT_READY);   // ThreadSanitizer, which does not follow eventfds, sees an order by it
    VkFence first = submitFill(a, bufferA, round, VK_NULL_HANDLE, signalled);
    EXPECT_EQ(waitFor(a, first, ~0ull), VK_SUCCESS);
    EXPECT_EQ(waitFor(b, later, ~0ull), VK_SUCCESS);
    EXPECT_EQ(bufferB.words[0], round);
    VK(vkDestroyFence)(a.handle, first, nullptr);
    VK(vkDestroyFence)(b.handle, later, nullptr);
  }
  VK(vkDestroySemaphore)(a.handle, signalled, nullptr);
  VK(vkDestroySemaphore)(b.handle, waited, nullptr);
  a.release(bufferA);
  b.release(bufferB);
}

// A temporary payload lasts for one wait; then the semaphore is what it was.
TEST(ExternalSemaphore, ATemporaryImportIsForOneWait) {
  TestDevice a, b;
  TestDevice::Buffer bufferA = a.buffer(64), bufferB = b.buffer(64);
  VkSemaphore signalled = exportable(a), own = b.semaphore();
  ASSERT_EQ(importSemaphore(b, own, semaphoreFd(a, signalled), VK_SEMAPHORE_IMPORT_TEMPORARY_BIT), VK_SUCCESS);
  VkFence fences[4] = {submitFill(b, bufferB, 1, own, VK_NULL_HANDLE), submitFill(a, bufferA, 1, VK_NULL_HANDLE, signalled)};
  EXPECT_EQ(waitFor(b, fences[0], ~0ull), VK_SUCCESS);
  EXPECT_EQ(waitFor(a, fences[1], ~0ull), VK_SUCCESS);
  fences[2] = submitFill(b, bufferB, 2, VK_NULL_HANDLE, own);
  fences[3] = submitFill(b, bufferB, 3, own, VK_NULL_HANDLE);
  EXPECT_EQ(waitFor(b, fences[3], ~0ull), VK_SUCCESS);
  EXPECT_EQ(bufferB.words[0], 3u);
  for (int i = 0; i < 4; i++) VK(vkDestroyFence)(i == 1 ? a.handle : b.handle, fences[i], nullptr);
  VK(vkDestroySemaphore)(a.handle, signalled, nullptr);
  VK(vkDestroySemaphore)(b.handle, own, nullptr);
  a.release(bufferA);
  b.release(bufferB);
}

TEST(ExternalSemaphore, OnlyBinaryOnesAreShared) {
  for (bool timeline : {false, true}) {
    VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO, nullptr, timeline ? VK_SEMAPHORE_TYPE_TIMELINE : VK_SEMAPHORE_TYPE_BINARY, 0};
    VkPhysicalDeviceExternalSemaphoreInfo info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_SEMAPHORE_INFO, &type, kSemaphoreFd};
    VkExternalSemaphoreProperties out{VK_STRUCTURE_TYPE_EXTERNAL_SEMAPHORE_PROPERTIES, nullptr, 0, 0, 0};
    VK(vkGetPhysicalDeviceExternalSemaphoreProperties)(physicalDevice(commonInstance()), &info, &out);
    EXPECT_EQ(out.externalSemaphoreFeatures != 0, !timeline);
  }
}

}  // namespace
}  // namespace pumice::icd::test
