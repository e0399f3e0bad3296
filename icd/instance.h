// Instance and its one physical device.
#pragma once

#include <atomic>
#include <bitset>
#include <string>
#include <string_view>

#include "icd/features.h"
#include "icd/object.h"
#include "icd/properties.h"

namespace pumice::icd {

enum class Extension : uint8_t {
#define PUMICE_EXTENSION(name, revision, level) k##name,   // pasted: the names themselves are macros of vulkan.h
#include "icd/extensions.inc"
#undef PUMICE_EXTENSION
  kCount
};
using ExtensionSet = std::bitset<size_t(Extension::kCount)>;

enum class ExtensionLevel : uint8_t { Instance, Device };
struct ExtensionInfo {
  const char* name;
  uint32_t revision;
  ExtensionLevel level;
};
const ExtensionInfo& extensionInfo(size_t index);
//! kCount when it is not one of ours.
size_t findExtension(std::string_view name);

//! What vkGetPhysicalDeviceProperties says, and the manifest (icd/CMakeLists.txt).
constexpr uint32_t kApiVersion = VK_MAKE_API_VERSION(0, PUMICE_API_MAJOR, PUMICE_API_MINOR, 239);

struct Instance;

struct PhysicalDevice : Dispatchable {
  Instance* instance = nullptr;
  VkPhysicalDeviceProperties properties{};
  ExtendedProperties extendedProperties;
  FeatureSet features;
  VkPhysicalDeviceMemoryProperties memory{};
  std::atomic<uint64_t> allocatedBytes{0};   //!< of all its devices
};

struct Instance : Dispatchable {
  explicit Instance(HostAllocator a) : allocator(a) {}
  HostAllocator allocator;
  ExtensionSet extensions;
  uint32_t apiVersion = VK_API_VERSION_1_0;
  PhysicalDevice physicalDevice;
};

//! Fills properties, features and memory from the tables the implementation uses.
void initPhysicalDevice(PhysicalDevice& device);

PUMICE_HANDLE(Instance, VkInstance)
PUMICE_HANDLE(PhysicalDevice, VkPhysicalDevice)

struct Device;
//! Looks a command up by name. Null when it is unknown or its extension is not enabled.
PFN_vkVoidFunction findGlobalCommand(const char* name);
PFN_vkVoidFunction findInstanceCommand(const Instance& instance, const char* name);
PFN_vkVoidFunction findPhysicalDeviceCommand(const char* name);
PFN_vkVoidFunction findDeviceCommand(const ExtensionSet& enabled, const char* name);

}  // namespace pumice::icd
