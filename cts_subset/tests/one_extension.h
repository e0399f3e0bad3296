// Tests on a device of their own that enables one extension and what belongs to it, as a program does that needs it.
#pragma once

#include "cts_subset/tests/compute.h"

#include <algorithm>
#include <memory>

namespace pumice::cts {

class OneExtensionTest : public ComputeTest {
 protected:
  bool available(const char* extension) {
    uint32_t count = 0;
    vkEnumerateDeviceExtensionProperties(device().physical, nullptr, &count, nullptr);
    std::vector<VkExtensionProperties> all(count);
    vkEnumerateDeviceExtensionProperties(device().physical, nullptr, &count, all.data());
    return std::any_of(all.begin(), all.end(), [&](const VkExtensionProperties& e) { return std::string(e.extensionName) == extension; });
  }
  template <class Features>
  Features features(VkStructureType type) {
    Features found{};
    found.sType = type;
    VkPhysicalDeviceFeatures2 f2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &found, {}};
    vkGetPhysicalDeviceFeatures2(device().physical, &f2);
    return found;
  }
  Device& open(const char* extension, const void* chain = nullptr, const VkPhysicalDeviceFeatures& core = {}) {
    own = std::make_unique<Device>(device().physical, core, std::vector<const char*>{extension}, chain);
    return *own;
  }
  std::unique_ptr<Device> own;
};

}  // namespace pumice::cts
