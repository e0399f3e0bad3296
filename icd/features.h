// Feature bits: one table (features.inc) behind every feature structure, asked for or requested.
#pragma once

#include <bitset>

#include "icd/vulkan.h"

namespace pumice::icd {

enum class Feature : uint16_t {
#define PUMICE_FEATURE(member, supported) member,
#include "icd/features.inc"
#undef PUMICE_FEATURE
  kCount
};
using FeatureSet = std::bitset<size_t(Feature::kCount)>;

FeatureSet supportedFeatures();
//! The core structure for a set.
VkPhysicalDeviceFeatures coreFeatures(const FeatureSet& set);
//! Writes every feature structure of the chain that is known; others stay untouched.
void fillFeatures(const FeatureSet& set, void* chain);
//! What vkCreateDevice is asked for: VkDeviceCreateInfo::pEnabledFeatures (or null) and all feature structures of the chain.
FeatureSet requestedFeatures(const VkPhysicalDeviceFeatures* core, const void* chain);
//! Name of a feature, for messages.
const char* featureName(size_t feature);

}  // namespace pumice::icd
