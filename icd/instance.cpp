#include "icd/instance.h"

#include <cstring>

#include "base/log.h"
#include "entrypoints.h"
#include "texture/pixel_routine.h"

namespace pumice::icd {
namespace {

constexpr ExtensionInfo kExtensions[] = {
#define PUMICE_EXTENSION(name, revision, level) {#name, revision, ExtensionLevel::level},
#include "icd/extensions.inc"
#undef PUMICE_EXTENSION
};

VkResult enumerateExtensions(ExtensionLevel level, uint32_t* count, VkExtensionProperties* out) {
  uint32_t indices[std::size(kExtensions)], available = 0;
  for (uint32_t i = 0; i < std::size(kExtensions); i++)
    if (kExtensions[i].level == level) indices[available++] = i;
  return enumerate(available, count, out, [&](uint32_t i, VkExtensionProperties& p) {
    p = {};
    std::strncpy(p.extensionName, kExtensions[indices[i]].name, sizeof p.extensionName - 1);
    p.specVersion = kExtensions[indices[i]].revision;
  });
}

}  // namespace

const ExtensionInfo& extensionInfo(size_t index) { return kExtensions[index]; }

size_t findExtension(std::string_view name) {
  for (size_t i = 0; i < std::size(kExtensions); i++)
    if (name == kExtensions[i].name) return i;
  return size_t(Extension::kCount);
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumerateInstanceVersion(uint32_t* pApiVersion) {
  // The interface's version, not the device's: what vkCreateInstance accepts.
  *pApiVersion = VK_MAKE_API_VERSION(0, 1, 3, 239);
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumerateInstanceExtensionProperties(const char* layer, uint32_t* count, VkExtensionProperties* out) {
  if (layer) return VK_ERROR_LAYER_NOT_PRESENT;
  return enumerateExtensions(ExtensionLevel::Instance, count, out);
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumerateInstanceLayerProperties(uint32_t* count, VkLayerProperties*) {
  *count = 0;
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumerateDeviceExtensionProperties(VkPhysicalDevice, const char* layer, uint32_t* count, VkExtensionProperties* out) {
  if (layer) {
    *count = 0;
    return VK_ERROR_LAYER_NOT_PRESENT;
  }
  return enumerateExtensions(ExtensionLevel::Device, count, out);
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumerateDeviceLayerProperties(VkPhysicalDevice, uint32_t* count, VkLayerProperties*) {
  *count = 0;
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateInstance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* callbacks, VkInstance* out) {
  base::logEnabled(base::LogLevel::Error);   // reads PUMICE_LOG: a wrong value is named even if nothing else is said
  ExtensionSet enabled;
  for (uint32_t i = 0; i < info->enabledExtensionCount; i++) {
    size_t e = findExtension(info->ppEnabledExtensionNames[i]);
    if (e == size_t(Extension::kCount) || kExtensions[e].level != ExtensionLevel::Instance) {
      base::logError("vkCreateInstance: extension %s is not supported", info->ppEnabledExtensionNames[i]);
      return VK_ERROR_EXTENSION_NOT_PRESENT;
    }
    enabled.set(e);
  }
  HostAllocator allocator(callbacks);
  auto* instance = makeObject<Instance>(allocator, VK_SYSTEM_ALLOCATION_SCOPE_INSTANCE, allocator);
  if (!instance) return VK_ERROR_OUT_OF_HOST_MEMORY;
  instance->extensions = enabled;
  if (info->pApplicationInfo && info->pApplicationInfo->apiVersion) instance->apiVersion = info->pApplicationInfo->apiVersion;
  instance->physicalDevice.instance = instance;
  try {
    initPhysicalDevice(instance->physicalDevice);
  } catch (const std::bad_alloc&) {
    destroyObject(allocator, instance);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkInstance>(instance);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyInstance(VkInstance handle, const VkAllocationCallbacks* callbacks) {
  if (auto* instance = from(handle)) {
    HostAllocator allocator = instance->allocator.orElse(callbacks);
    destroyObject(allocator, instance);
    texture::forgetPixelRoutines();
  }
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumeratePhysicalDevices(VkInstance handle, uint32_t* count, VkPhysicalDevice* out) {
  return enumerate(1, count, out, [&](uint32_t, VkPhysicalDevice& p) { p = to<VkPhysicalDevice>(&from(handle)->physicalDevice); });
}

VKAPI_ATTR VkResult VKAPI_CALL vkEnumeratePhysicalDeviceGroups(VkInstance handle, uint32_t* count, VkPhysicalDeviceGroupProperties* out) {
  return enumerate(1, count, out, [&](uint32_t, VkPhysicalDeviceGroupProperties& p) {
    p.physicalDeviceCount = 1;
    for (auto& d : p.physicalDevices) d = VK_NULL_HANDLE;
    p.physicalDevices[0] = to<VkPhysicalDevice>(&from(handle)->physicalDevice);
    p.subsetAllocation = VK_FALSE;
  });
}

}  // namespace pumice::icd
