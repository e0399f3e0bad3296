#include "tests/icd/driver.h"

#include <cstdio>
#include <cstdlib>

namespace pumice::icd::test {
namespace {

void must(bool ok, const char* what) {
  if (ok) return;
  std::fprintf(stderr, "the test cannot go on: %s failed\n", what);
  std::abort();
}

template <typename T, typename Get>
std::vector<std::string> names(Get&& get) {
  uint32_t count = 0;
  must(get(&count, static_cast<T*>(nullptr)) == VK_SUCCESS, "enumeration");
  std::vector<T> all(count);
  must(get(&count, all.data()) == VK_SUCCESS, "enumeration");
  std::vector<std::string> out;
  for (const T& p : all) out.push_back(p.extensionName);
  return out;
}

std::vector<const char*> pointers(const std::vector<std::string>& strings) {
  std::vector<const char*> out;
  for (const std::string& s : strings) out.push_back(s.c_str());
  return out;
}

}  // namespace

Driver::Driver() {
  void* library = dlopen(PUMICE_DRIVER, RTLD_NOW | RTLD_LOCAL);
  if (!library) std::fprintf(stderr, "%s\n", dlerror());
  must(library, "dlopen of " PUMICE_DRIVER);
  negotiate_ =
      reinterpret_cast<decltype(negotiate_)>(dlsym(library, "vk_icdNegotiateLoaderICDInterfaceVersion"));
  getInstanceProcAddr_ =
      reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library, "vk_icdGetInstanceProcAddr"));
  getPhysicalDeviceProcAddr_ = reinterpret_cast<decltype(getPhysicalDeviceProcAddr_)>(
      dlsym(library, "vk_icdGetPhysicalDeviceProcAddr"));
  must(negotiate_ && getInstanceProcAddr_ && getPhysicalDeviceProcAddr_, "dlsym");
}

const Driver& driver() {
  static const Driver it;
  return it;
}

VkInstance makeInstance(const std::vector<const char*>& extensions, const VkAllocationCallbacks* callbacks) {
  VkApplicationInfo application{
      VK_STRUCTURE_TYPE_APPLICATION_INFO, nullptr, "test", 1, "test", 1, VK_API_VERSION_1_3};
  VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                            nullptr,
                            0,
                            &application,
                            0,
                            nullptr,
                            uint32_t(extensions.size()),
                            extensions.data()};
  VkInstance instance = VK_NULL_HANDLE;
  auto create = reinterpret_cast<PFN_vkCreateInstance>(driver().find(VK_NULL_HANDLE, "vkCreateInstance"));
  if (create(&info, callbacks, &instance) != VK_SUCCESS) return VK_NULL_HANDLE;
  return instance;
}

VkInstance commonInstance() {
  static const std::vector<std::string> extensions = instanceExtensions();
  static const VkInstance instance = makeInstance(pointers(extensions));
  must(instance, "vkCreateInstance");
  return instance;
}

VkPhysicalDevice physicalDevice(VkInstance instance) {
  uint32_t count = 1;
  VkPhysicalDevice device = VK_NULL_HANDLE;
  auto enumerate =
      reinterpret_cast<PFN_vkEnumeratePhysicalDevices>(driver().find(instance, "vkEnumeratePhysicalDevices"));
  must(enumerate(instance, &count, &device) == VK_SUCCESS && count == 1, "vkEnumeratePhysicalDevices");
  return device;
}

std::vector<std::string> instanceExtensions() {
  auto enumerate = reinterpret_cast<PFN_vkEnumerateInstanceExtensionProperties>(
      driver().find(VK_NULL_HANDLE, "vkEnumerateInstanceExtensionProperties"));
  return names<VkExtensionProperties>(
      [&](uint32_t* n, VkExtensionProperties* p) { return enumerate(nullptr, n, p); });
}

std::vector<std::string> deviceExtensions() {
  VkPhysicalDevice device = physicalDevice(commonInstance());
  return names<VkExtensionProperties>([&](uint32_t* n, VkExtensionProperties* p) {
    return VK(vkEnumerateDeviceExtensionProperties)(device, nullptr, n, p);
  });
}

TestDevice::TestDevice() : TestDevice(deviceExtensions()) {}

TestDevice::TestDevice(const std::vector<std::string>& extensions, const VkAllocationCallbacks* callbacks) {
  VkPhysicalDevice physical = physicalDevice(commonInstance());
  VkPhysicalDeviceFeatures features{};
  VK(vkGetPhysicalDeviceFeatures)(physical, &features);
  float priority = 1;
  VkDeviceQueueCreateInfo queueInfo{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
  std::vector<const char*> names = pointers(extensions);
  VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                          nullptr,
                          0,
                          1,
                          &queueInfo,
                          0,
                          nullptr,
                          uint32_t(names.size()),
                          names.data(),
                          &features};
  must(VK(vkCreateDevice)(physical, &info, callbacks, &handle) == VK_SUCCESS, "vkCreateDevice");
  VK(vkGetDeviceQueue)(handle, 0, 0, &queue);
  VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr,
                                   VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, 0};
  must(VK(vkCreateCommandPool)(handle, &poolInfo, nullptr, &pool) == VK_SUCCESS, "vkCreateCommandPool");
}

TestDevice::~TestDevice() {
  VK(vkDeviceWaitIdle)(handle);
  VK(vkDestroyCommandPool)(handle, pool, nullptr);
  VK(vkDestroyDevice)(handle, nullptr);
}

VkDeviceMemory TestDevice::allocate(VkDeviceSize bytes) {
  VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, bytes, 0};
  VkDeviceMemory memory = VK_NULL_HANDLE;
  must(VK(vkAllocateMemory)(handle, &info, nullptr, &memory) == VK_SUCCESS, "vkAllocateMemory");
  return memory;
}

TestDevice::Buffer TestDevice::buffer(VkDeviceSize bytes, VkBufferUsageFlags usage) {
  Buffer b;
  VkBufferCreateInfo info{
      VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, nullptr, 0, bytes, usage, VK_SHARING_MODE_EXCLUSIVE, 0, nullptr};
  must(VK(vkCreateBuffer)(handle, &info, nullptr, &b.handle) == VK_SUCCESS, "vkCreateBuffer");
  VkMemoryRequirements needs;
  VK(vkGetBufferMemoryRequirements)(handle, b.handle, &needs);
  b.memory = allocate(needs.size);
  must(VK(vkBindBufferMemory)(handle, b.handle, b.memory, 0) == VK_SUCCESS, "vkBindBufferMemory");
  void* data = nullptr;
  must(VK(vkMapMemory)(handle, b.memory, 0, VK_WHOLE_SIZE, 0, &data) == VK_SUCCESS, "vkMapMemory");
  b.words = static_cast<uint32_t*>(data);
  return b;
}

void TestDevice::release(const Buffer& b) {
  VK(vkDestroyBuffer)(handle, b.handle, nullptr);
  VK(vkFreeMemory)(handle, b.memory, nullptr);
}

VkShaderModule TestDevice::module(const std::vector<uint32_t>& words) {
  VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, words.size() * 4,
                                words.data()};
  VkShaderModule module = VK_NULL_HANDLE;
  must(VK(vkCreateShaderModule)(handle, &info, nullptr, &module) == VK_SUCCESS, "vkCreateShaderModule");
  return module;
}

VkCommandBuffer TestDevice::begin(VkCommandBufferLevel level, VkCommandBufferUsageFlags flags) {
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, level,
                                       1};
  VkCommandBuffer commands = VK_NULL_HANDLE;
  must(VK(vkAllocateCommandBuffers)(handle, &allocate, &commands) == VK_SUCCESS, "vkAllocateCommandBuffers");
  VkCommandBufferInheritanceInfo inheritance{};
  inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
  VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, flags, &inheritance};
  must(VK(vkBeginCommandBuffer)(commands, &info) == VK_SUCCESS, "vkBeginCommandBuffer");
  return commands;
}

void TestDevice::end(VkCommandBuffer commands) {
  must(VK(vkEndCommandBuffer)(commands) == VK_SUCCESS, "vkEndCommandBuffer");
}

VkResult TestDevice::submit(VkCommandBuffer commands, VkFence fence, VkSemaphore wait, VkSemaphore signal) {
  VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
  VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO,
                    nullptr,
                    wait ? 1u : 0u,
                    &wait,
                    &stage,
                    commands ? 1u : 0u,
                    &commands,
                    signal ? 1u : 0u,
                    &signal};
  return VK(vkQueueSubmit)(queue, 1, &info, fence);
}

void TestDevice::run(VkCommandBuffer commands) {
  end(commands);
  must(submit(commands) == VK_SUCCESS, "vkQueueSubmit");
  must(VK(vkQueueWaitIdle)(queue) == VK_SUCCESS, "vkQueueWaitIdle");
  VK(vkFreeCommandBuffers)(handle, pool, 1, &commands);
}

VkFence TestDevice::fence(VkFenceCreateFlags flags) {
  VkFenceCreateInfo info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, flags};
  VkFence fence = VK_NULL_HANDLE;
  must(VK(vkCreateFence)(handle, &info, nullptr, &fence) == VK_SUCCESS, "vkCreateFence");
  return fence;
}

VkSemaphore TestDevice::semaphore() {
  VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, nullptr, 0};
  VkSemaphore semaphore = VK_NULL_HANDLE;
  must(VK(vkCreateSemaphore)(handle, &info, nullptr, &semaphore) == VK_SUCCESS, "vkCreateSemaphore");
  return semaphore;
}

}  // namespace pumice::icd::test
