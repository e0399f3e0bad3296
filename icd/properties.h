// Properties beyond VkPhysicalDeviceProperties. The aggregates of 1.1 to 1.3 are the one place of each value; structures that
// repeat their members are filled from them through a table made from the registry.
#pragma once

#include "icd/vulkan.h"

namespace pumice::icd {

struct ExtendedProperties {
  VkPhysicalDeviceVulkan11Properties v11{};
  VkPhysicalDeviceVulkan12Properties v12{};
  VkPhysicalDeviceVulkan13Properties v13{};
};

//! From the core limits, so that the two never disagree.
void initProperties(ExtendedProperties& p, const VkPhysicalDeviceLimits& limits, uint64_t heapBytes);
//! Writes every properties structure of the chain that is known; others stay untouched.
void fillProperties(const ExtendedProperties& p, void* chain);
//! Identifies driver and version: also the UUID of pipeline caches.
void driverUuid(uint8_t out[VK_UUID_SIZE]);

}  // namespace pumice::icd
