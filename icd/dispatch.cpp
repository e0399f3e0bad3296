#include <algorithm>
#include <cstring>

#include "entrypoints.h"
#include "icd/device.h"
#include "icd/instance.h"

namespace pumice::icd {
namespace {

enum class Level : uint8_t { Global, Instance, PhysicalDevice, Device };

struct Command {
  const char* name;
  PFN_vkVoidFunction function;
  Level level;
  uint8_t version;         //!< 10, 11, ... or 0 when an extension provides it
  const char* extension;
};

// Sorted by name; several rows where several extensions or versions provide a command.
const Command kCommands[] = {
#define PUMICE_COMMAND(name, function, level, version, extension) \
  {#name, reinterpret_cast<PFN_vkVoidFunction>(&function), Level::level, version, extension},
#include "commands.inc"
#undef PUMICE_COMMAND
};

template <typename Accept>
PFN_vkVoidFunction find(const char* name, Accept&& accept) {
  if (!name) return nullptr;
  auto less = [](const Command& c, const char* n) { return std::strcmp(c.name, n) < 0; };
  for (auto* c = std::lower_bound(std::begin(kCommands), std::end(kCommands), name, less);
       c != std::end(kCommands) && !std::strcmp(c->name, name); c++)
    if (c->function && accept(*c)) return c->function;
  return nullptr;
}

bool enabled(const ExtensionSet& extensions, const char* name) {
  size_t index = findExtension(name);
  return index < extensions.size() && extensions[index];
}

bool isDeviceExtension(const char* name) {
  size_t index = findExtension(name);
  return index < size_t(Extension::kCount) && extensionInfo(index).level == ExtensionLevel::Device;
}

}  // namespace

PFN_vkVoidFunction findGlobalCommand(const char* name) {
  return find(name, [](const Command& c) { return c.level == Level::Global; });
}

// Device commands are found too; whether their extension is enabled is not known yet, so those of all advertised
// device extensions resolve (spec, vkGetInstanceProcAddr: "available device extension").
PFN_vkVoidFunction findInstanceCommand(const Instance& instance, const char* name) {
  return find(name, [&](const Command& c) {
    return !c.extension || enabled(instance.extensions, c.extension) || isDeviceExtension(c.extension);
  });
}

PFN_vkVoidFunction findPhysicalDeviceCommand(const char* name) {
  return find(name, [](const Command& c) { return c.level == Level::PhysicalDevice; });
}

PFN_vkVoidFunction findDeviceCommand(const ExtensionSet& extensions, const char* name) {
  return find(name, [&](const Command& c) {
    return c.level == Level::Device && (!c.extension || enabled(extensions, c.extension));
  });
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL vkGetInstanceProcAddr(VkInstance instance, const char* pName) {
  return instance ? findInstanceCommand(*from(instance), pName) : findGlobalCommand(pName);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL vkGetDeviceProcAddr(VkDevice device, const char* pName) {
  return findDeviceCommand(from(device)->extensions, pName);
}

}  // namespace pumice::icd

// The three symbols the loader looks for (Vulkan-Loader, "LoaderDriverInterface").
#define PUMICE_EXPORT extern "C" __attribute__((visibility("default")))

PUMICE_EXPORT VKAPI_ATTR VkResult VKAPI_CALL vk_icdNegotiateLoaderICDInterfaceVersion(uint32_t* version) {
  // The loader may ask several times. Below 3 it makes surfaces of its own, whose layout is the same as ours.
  constexpr uint32_t kNewest = 7;
  if (*version > kNewest) *version = kNewest;
  return VK_SUCCESS;
}

PUMICE_EXPORT VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL vk_icdGetInstanceProcAddr(VkInstance instance, const char* name) {
  return pumice::icd::vkGetInstanceProcAddr(instance, name);
}

PUMICE_EXPORT VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL vk_icdGetPhysicalDeviceProcAddr(VkInstance, const char* name) {
  return pumice::icd::findPhysicalDeviceCommand(name);
}
