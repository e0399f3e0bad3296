// The driver as the loader sees it: opened with dlopen, commands found by name. Between these tests and the
// driver stands nothing that could allocate, filter or repair.
#pragma once

#define VK_NO_PROTOTYPES
#include <dlfcn.h>
#include <newer_vulkan.h>
#include <vulkan/vulkan.h>

#include <cstdint>
#include <string>
#include <vector>

namespace pumice::icd::test {

class Driver {
 public:
  Driver();
  PFN_vkVoidFunction find(VkInstance instance, const char* name) const {
    return getInstanceProcAddr_(instance, name);
  }
  PFN_vkVoidFunction findPhysical(VkInstance instance, const char* name) const {
    return getPhysicalDeviceProcAddr_(instance, name);
  }
  VkResult negotiate(uint32_t* version) const { return negotiate_(version); }

 private:
  VkResult (*negotiate_)(uint32_t*);
  PFN_vkGetInstanceProcAddr getInstanceProcAddr_;
  PFN_vkVoidFunction (*getPhysicalDeviceProcAddr_)(VkInstance, const char*);
};
//! Loaded once and never unloaded.
const Driver& driver();

//! The instance that commands are looked up with. Made on first use, with every instance extension, and kept.
VkInstance commonInstance();

//! A core or extension command by its own name: VK(vkCreateBuffer)(device, ...).
#define VK(name) \
  (reinterpret_cast<PFN_##name>(pumice::icd::test::driver().find(pumice::icd::test::commonInstance(), #name)))

VkInstance makeInstance(const std::vector<const char*>& extensions,
                        const VkAllocationCallbacks* callbacks = nullptr);
VkPhysicalDevice physicalDevice(VkInstance instance);
std::vector<std::string> instanceExtensions();
std::vector<std::string> deviceExtensions();

//! A device with all features and the extensions named (all of them by default).
struct TestDevice {
  TestDevice();
  explicit TestDevice(const std::vector<std::string>& extensions,
                      const VkAllocationCallbacks* callbacks = nullptr);
  ~TestDevice();
  TestDevice(const TestDevice&) = delete;
  TestDevice& operator=(const TestDevice&) = delete;

  VkDevice handle = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  VkCommandPool pool = VK_NULL_HANDLE;

  //! A buffer with memory of its own, mapped.
  struct Buffer {
    VkBuffer handle = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    uint32_t* words = nullptr;
  };
  Buffer buffer(VkDeviceSize bytes, VkBufferUsageFlags usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                                                               VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                                                               VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                               VK_BUFFER_USAGE_VERTEX_BUFFER_BIT |
                                                               VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  void release(const Buffer& b);
  VkShaderModule module(const std::vector<uint32_t>& words);
  VkDeviceMemory allocate(VkDeviceSize bytes);

  VkCommandBuffer begin(VkCommandBufferLevel level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                        VkCommandBufferUsageFlags flags = 0);
  void end(VkCommandBuffer commands);
  VkResult submit(VkCommandBuffer commands, VkFence fence = VK_NULL_HANDLE, VkSemaphore wait = VK_NULL_HANDLE,
                  VkSemaphore signal = VK_NULL_HANDLE);
  //! Ends, submits, waits, frees.
  void run(VkCommandBuffer commands);
  VkFence fence(VkFenceCreateFlags flags = 0);
  VkSemaphore semaphore();
};

}  // namespace pumice::icd::test
