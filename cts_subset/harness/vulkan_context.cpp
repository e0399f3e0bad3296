#include "cts_subset/harness/vulkan_context.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <utility>

namespace pumice::cts {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr uint64_t kFenceTimeoutNs = 120ull * 1000 * 1000 * 1000;

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

VKAPI_ATTR VkBool32 VKAPI_CALL onMessage(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                         VkDebugUtilsMessageTypeFlagsEXT,
                                         const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
  static_cast<VulkanInstance*>(user)->addMessage(data->pMessage ? data->pMessage : "(no text)");
  return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messengerInfo(VulkanInstance* user) {
  VkDebugUtilsMessengerCreateInfoEXT info{};
  info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
  info.messageSeverity =
      VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  // Not GENERAL: those are the loader's own remarks about manifests.
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
  info.pfnUserCallback = onMessage;
  info.pUserData = user;
  return info;
}

}  // namespace

VulkanError::VulkanError(VkResult r, const std::string& what)
    : std::runtime_error(what + ": " + resultName(r)), result(r) {}

const char* resultName(VkResult result) {
  static constexpr struct {
    VkResult value;
    const char* name;
  } kNames[] = {
      {VK_SUCCESS, "VK_SUCCESS"},
      {VK_NOT_READY, "VK_NOT_READY"},
      {VK_TIMEOUT, "VK_TIMEOUT"},
      {VK_ERROR_OUT_OF_HOST_MEMORY, "VK_ERROR_OUT_OF_HOST_MEMORY"},
      {VK_ERROR_OUT_OF_DEVICE_MEMORY, "VK_ERROR_OUT_OF_DEVICE_MEMORY"},
      {VK_ERROR_INITIALIZATION_FAILED, "VK_ERROR_INITIALIZATION_FAILED"},
      {VK_ERROR_DEVICE_LOST, "VK_ERROR_DEVICE_LOST"},
      {VK_ERROR_MEMORY_MAP_FAILED, "VK_ERROR_MEMORY_MAP_FAILED"},
      {VK_ERROR_LAYER_NOT_PRESENT, "VK_ERROR_LAYER_NOT_PRESENT"},
      {VK_ERROR_EXTENSION_NOT_PRESENT, "VK_ERROR_EXTENSION_NOT_PRESENT"},
      {VK_ERROR_FEATURE_NOT_PRESENT, "VK_ERROR_FEATURE_NOT_PRESENT"},
      {VK_ERROR_INCOMPATIBLE_DRIVER, "VK_ERROR_INCOMPATIBLE_DRIVER"},
      {VK_ERROR_FORMAT_NOT_SUPPORTED, "VK_ERROR_FORMAT_NOT_SUPPORTED"},
      {VK_ERROR_INVALID_SHADER_NV, "VK_ERROR_INVALID_SHADER_NV"},
      {VK_ERROR_UNKNOWN, "VK_ERROR_UNKNOWN"},
  };
  for (const auto& entry : kNames)
    if (entry.value == result) return entry.name;
  return "an unlisted VkResult";
}

void check(VkResult result, const char* what) {
  if (result != VK_SUCCESS) throw VulkanError(result, what);
}

std::string pumiceManifest() {
  std::string chosen = environment("PUMICE_TEST_ICD");
  return chosen.empty() ? PUMICE_BUILD_TREE_MANIFEST : chosen;
}

std::string lavapipeManifest() {
  for (const char* folder : {"/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"}) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      std::string name = entry.path().filename().string();
      if (name.starts_with("lvp_icd") && name.ends_with(".json")) return entry.path().string();
    }
  }
  return {};
}

void selectDrivers() {
  std::string list = pumiceManifest();
  std::string peer = lavapipeManifest();
  if (!peer.empty() && peer != list) list += ":" + peer;
  unsetenv("VK_DRIVER_FILES");  // it would win over VK_ICD_FILENAMES
  setenv("VK_ICD_FILENAMES", list.c_str(), 1);
}

std::string testedDeviceName() {
  std::string chosen = environment("PUMICE_TEST_DEVICE");
  return chosen.empty() ? "Pumice" : chosen;
}

bool peersRequired() {
  std::string value = environment("PUMICE_REQUIRE_PEERS");
  return !value.empty() && value != "0";
}

bool validationRequested() {
  std::string value = environment("PUMICE_VALIDATE");
  return !value.empty() && value != "0";
}

bool VulkanInstance::validationAvailable() {
  uint32_t count = 0;
  vkEnumerateInstanceLayerProperties(&count, nullptr);
  std::vector<VkLayerProperties> layers(count);
  vkEnumerateInstanceLayerProperties(&count, layers.data());
  for (const auto& layer : layers)
    if (std::strcmp(layer.layerName, kValidationLayer) == 0) return true;
  return false;
}

VulkanInstance::VulkanInstance(bool validation, const std::vector<const char*>& extensions) {
  VkApplicationInfo app{};
  app.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
  app.pApplicationName = "pumice cts_subset";
  app.apiVersion = VK_API_VERSION_1_3;

  VkDebugUtilsMessengerCreateInfoEXT debug = messengerInfo(this);
  VkInstanceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
  info.pApplicationInfo = &app;
  std::vector<const char*> enabled = extensions;
  if (validation) {
    enabled.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    info.pNext = &debug;
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
  }
  info.enabledExtensionCount = uint32_t(enabled.size());
  info.ppEnabledExtensionNames = enabled.data();
  check(vkCreateInstance(&info, nullptr, &instance), "vkCreateInstance");
  if (validation) {
    auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance, "vkCreateDebugUtilsMessengerEXT"));
    check(create(instance, &debug, nullptr, &messenger), "vkCreateDebugUtilsMessengerEXT");
  }
}

VulkanInstance::~VulkanInstance() {
  if (messenger) {
    auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance, "vkDestroyDebugUtilsMessengerEXT"));
    destroy(instance, messenger, nullptr);
  }
  vkDestroyInstance(instance, nullptr);
}

namespace {
std::vector<VkPhysicalDevice> physicalDevices(VkInstance instance) {
  uint32_t count = 0;
  vkEnumeratePhysicalDevices(instance, &count, nullptr);
  std::vector<VkPhysicalDevice> devices(count);
  vkEnumeratePhysicalDevices(instance, &count, devices.data());
  devices.resize(count);
  return devices;
}
}  // namespace

VkPhysicalDevice VulkanInstance::find(const std::string& prefix) const {
  for (VkPhysicalDevice device : physicalDevices(instance)) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    if (std::string(properties.deviceName).starts_with(prefix)) return device;
  }
  return VK_NULL_HANDLE;
}

std::vector<std::string> VulkanInstance::deviceNames() const {
  std::vector<std::string> names;
  for (VkPhysicalDevice device : physicalDevices(instance)) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    names.emplace_back(properties.deviceName);
  }
  return names;
}

std::vector<std::string> VulkanInstance::takeMessages() {
  std::lock_guard guard(messageLock);
  return std::exchange(messages, {});
}

void VulkanInstance::addMessage(std::string text) {
  std::lock_guard guard(messageLock);
  messages.push_back(std::move(text));
}

namespace {
constexpr const char* kDeviceExtensions[] = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME,
                                             VK_EXT_ROBUSTNESS_2_EXTENSION_NAME,
                                             VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME,
                                             VK_EXT_PRIMITIVE_TOPOLOGY_LIST_RESTART_EXTENSION_NAME,
                                             VK_EXT_MULTI_DRAW_EXTENSION_NAME,
                                             VK_EXT_VERTEX_ATTRIBUTE_DIVISOR_EXTENSION_NAME,
                                             VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME,
                                             VK_EXT_SHADER_ATOMIC_FLOAT_2_EXTENSION_NAME,
                                             VK_KHR_SHADER_SUBGROUP_UNIFORM_CONTROL_FLOW_EXTENSION_NAME,
                                             VK_EXT_SHADER_SUBGROUP_BALLOT_EXTENSION_NAME,
                                             VK_EXT_SHADER_SUBGROUP_VOTE_EXTENSION_NAME,
                                             VK_EXT_LOAD_STORE_OP_NONE_EXTENSION_NAME,
                                             VK_EXT_MEMORY_BUDGET_EXTENSION_NAME,
                                             VK_EXT_CALIBRATED_TIMESTAMPS_EXTENSION_NAME,
                                             VK_KHR_GLOBAL_PRIORITY_EXTENSION_NAME,
                                             VK_EXT_SAMPLER_FILTER_MINMAX_EXTENSION_NAME,
                                             VK_KHR_SAMPLER_MIRROR_CLAMP_TO_EDGE_EXTENSION_NAME,
                                             VK_EXT_CUSTOM_BORDER_COLOR_EXTENSION_NAME,
                                             VK_EXT_4444_FORMATS_EXTENSION_NAME,
                                             VK_KHR_SHADER_DRAW_PARAMETERS_EXTENSION_NAME,
                                             VK_KHR_DRAW_INDIRECT_COUNT_EXTENSION_NAME,
                                             VK_EXT_SHADER_VIEWPORT_INDEX_LAYER_EXTENSION_NAME,
                                             VK_EXT_PROVOKING_VERTEX_EXTENSION_NAME,
                                             VK_EXT_DEPTH_CLIP_ENABLE_EXTENSION_NAME,
                                             VK_EXT_LINE_RASTERIZATION_EXTENSION_NAME};

std::vector<std::string> availableExtensions(VkPhysicalDevice physical) {
  uint32_t count = 0;
  vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> all(count);
  vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, all.data());
  std::vector<std::string> names;
  for (const auto& e : all) names.emplace_back(e.extensionName);
  return names;
}
}  // namespace

void Device::readProperties() {
  vkGetPhysicalDeviceProperties(physical, &properties);
  vkGetPhysicalDeviceFeatures(physical, &features);
  vkGetPhysicalDeviceMemoryProperties(physical, &memory);

  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  family = count;
  for (uint32_t i = 0; i < count && family == count; ++i)
    if (families[i].queueFlags & VK_QUEUE_GRAPHICS_BIT) family = i;
  if (family == count) throw VulkanError(VK_ERROR_INITIALIZATION_FAILED, "no queue family with graphics");
}

void Device::create(const void* chain, const VkPhysicalDeviceFeatures* enabled) {
  float priority = 1.0f;
  VkDeviceQueueCreateInfo queueInfo{};
  queueInfo.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
  queueInfo.queueFamilyIndex = family;
  queueInfo.queueCount = 1;
  queueInfo.pQueuePriorities = &priority;
  std::vector<const char*> names;
  for (const std::string& e : extensions) names.push_back(e.c_str());
  VkDeviceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  info.pNext = chain;
  info.pEnabledFeatures = enabled;
  info.enabledExtensionCount = uint32_t(names.size());
  info.ppEnabledExtensionNames = names.data();
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queueInfo;
  check(vkCreateDevice(physical, &info, nullptr, &handle), "vkCreateDevice");
  vkGetDeviceQueue(handle, family, 0, &queue);
}

Device::Device(VkPhysicalDevice chosen, const VkPhysicalDeviceFeatures& wanted,
               const std::vector<const char*>& wantedExtensions, const void* chain)
    : physical(chosen) {
  readProperties();
  features = wanted;
  extensions.assign(wantedExtensions.begin(), wantedExtensions.end());
  create(chain, &features);
}

Device::Device(VkPhysicalDevice chosen) : physical(chosen) {
  readProperties();
  VkPhysicalDeviceFeatures2 all{};
  all.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  vulkan11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES;
  vulkan12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  vulkan13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
  std::vector<std::string> available = availableExtensions(physical);
  for (const char* wanted : kDeviceExtensions)
    if (std::find(available.begin(), available.end(), wanted) != available.end()) extensions.emplace_back(wanted);
  if (properties.apiVersion >= VK_API_VERSION_1_2) {
    all.pNext = &vulkan11;
    vulkan11.pNext = &vulkan12;
    if (properties.apiVersion >= VK_API_VERSION_1_3) vulkan12.pNext = &vulkan13;
    auto append = [&](auto& features, VkStructureType type, const char* extension) {
      features.sType = type;
      if (!has(extension)) return;
      features.pNext = all.pNext;
      all.pNext = &features;
    };
    append(smallFormats, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_4444_FORMATS_FEATURES_EXT, VK_EXT_4444_FORMATS_EXTENSION_NAME);
    append(borders, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_CUSTOM_BORDER_COLOR_FEATURES_EXT, VK_EXT_CUSTOM_BORDER_COLOR_EXTENSION_NAME);
    append(robustness2, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ROBUSTNESS_2_FEATURES_EXT, VK_EXT_ROBUSTNESS_2_EXTENSION_NAME);
    append(indexTypeUint8, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_INDEX_TYPE_UINT8_FEATURES_EXT, VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME);
    append(listRestart, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PRIMITIVE_TOPOLOGY_LIST_RESTART_FEATURES_EXT,
           VK_EXT_PRIMITIVE_TOPOLOGY_LIST_RESTART_EXTENSION_NAME);
    append(multiDraw, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MULTI_DRAW_FEATURES_EXT, VK_EXT_MULTI_DRAW_EXTENSION_NAME);
    append(divisor, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VERTEX_ATTRIBUTE_DIVISOR_FEATURES_EXT, VK_EXT_VERTEX_ATTRIBUTE_DIVISOR_EXTENSION_NAME);
    append(atomicFloat, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT, VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME);
    append(atomicFloat2, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_2_FEATURES_EXT, VK_EXT_SHADER_ATOMIC_FLOAT_2_EXTENSION_NAME);
    append(subgroupUniformFlow, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_SUBGROUP_UNIFORM_CONTROL_FLOW_FEATURES_KHR,
           VK_KHR_SHADER_SUBGROUP_UNIFORM_CONTROL_FLOW_EXTENSION_NAME);
    append(provokingVertex, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROVOKING_VERTEX_FEATURES_EXT, VK_EXT_PROVOKING_VERTEX_EXTENSION_NAME);
    append(depthClip, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEPTH_CLIP_ENABLE_FEATURES_EXT, VK_EXT_DEPTH_CLIP_ENABLE_EXTENSION_NAME);
    append(lines, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_LINE_RASTERIZATION_FEATURES_EXT, VK_EXT_LINE_RASTERIZATION_EXTENSION_NAME);
    vkGetPhysicalDeviceFeatures2(physical, &all);
  }
  all.features = features;
  if (all.pNext)
    create(&all, nullptr);
  else
    create(nullptr, &features);
  vulkan12.pNext = properties.apiVersion >= VK_API_VERSION_1_3 ? &vulkan13 : nullptr;
  vulkan13.pNext = nullptr;  // what was appended is gone
}

Device::~Device() {
  vkDeviceWaitIdle(handle);
  vkDestroyDevice(handle, nullptr);
}

bool Device::has(const char* extension) const {
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
}

bool Device::supports(VkFormat format, VkFormatFeatureFlags wanted) const {
  VkFormatProperties found{};
  vkGetPhysicalDeviceFormatProperties(physical, format, &found);
  return (found.optimalTilingFeatures & wanted) == wanted;
}

uint32_t Device::memoryType(uint32_t allowed, VkMemoryPropertyFlags wanted) const {
  for (uint32_t i = 0; i < memory.memoryTypeCount; ++i)
    if ((allowed >> i & 1) && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
  throw VulkanError(VK_ERROR_OUT_OF_DEVICE_MEMORY, "no fitting memory type");
}

void Device::waitIdle() {
  std::lock_guard guard(queueLock);
  vkDeviceWaitIdle(handle);
}

void Device::run(const std::function<void(VkCommandBuffer)>& record) {
  VkCommandPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  poolInfo.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
  poolInfo.queueFamilyIndex = family;
  VkCommandPool pool = VK_NULL_HANDLE;
  check(vkCreateCommandPool(handle, &poolInfo, nullptr, &pool), "vkCreateCommandPool");
  // Whatever happens while recording, the pool goes.
  std::unique_ptr<VkCommandPool, std::function<void(VkCommandPool*)>> owner(
      &pool, [this](VkCommandPool* p) { vkDestroyCommandPool(handle, *p, nullptr); });

  VkCommandBufferAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  allocate.commandPool = pool;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 1;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  check(vkAllocateCommandBuffers(handle, &allocate, &commands), "vkAllocateCommandBuffers");

  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
  record(commands);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");

  VkFenceCreateInfo fenceInfo{};
  fenceInfo.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence fence = VK_NULL_HANDLE;
  check(vkCreateFence(handle, &fenceInfo, nullptr, &fence), "vkCreateFence");
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands;
  VkResult result = VK_SUCCESS;
  {
    std::lock_guard guard(queueLock);
    result = vkQueueSubmit(queue, 1, &submit, fence);
  }
  if (result == VK_SUCCESS) result = vkWaitForFences(handle, 1, &fence, VK_TRUE, kFenceTimeoutNs);
  vkDestroyFence(handle, fence, nullptr);
  check(result, "submitting and waiting");
}

}  // namespace pumice::cts
