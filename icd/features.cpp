#include "icd/features.h"

#include <cstring>
#include <span>

namespace pumice::icd {
namespace {

struct Member {
  size_t offset;
  Feature feature;
};

// The first rows of the table are the core structure's members in their order.
constexpr size_t kCoreCount = sizeof(VkPhysicalDeviceFeatures) / sizeof(VkBool32);
static_assert(offsetof(VkPhysicalDeviceFeatures, inheritedQueries) == 4 * size_t(Feature::inheritedQueries) &&
              offsetof(VkPhysicalDeviceFeatures, samplerAnisotropy) == 4 * size_t(Feature::samplerAnisotropy) &&
              size_t(Feature::inheritedQueries) + 1 == kCoreCount);

#define PUMICE_FEATURE_MEMBER(type, member) {offsetof(type, member), Feature::member},
#define PUMICE_FEATURE_STRUCT(sType, type, members) constexpr Member k##type[] = {members};
#include "feature_structs.inc"
#undef PUMICE_FEATURE_STRUCT

struct Structure {
  VkStructureType sType;
  std::span<const Member> members;
};
constexpr Structure kStructures[] = {
#define PUMICE_FEATURE_STRUCT(sType, type, members) {sType, k##type},
#include "feature_structs.inc"
#undef PUMICE_FEATURE_STRUCT
};
#undef PUMICE_FEATURE_MEMBER

constexpr const char* kNames[] = {
#define PUMICE_FEATURE(member, supported) #member,
#include "icd/features.inc"
#undef PUMICE_FEATURE
};

std::span<const Member> membersOf(VkStructureType type) {
  for (const Structure& s : kStructures)
    if (s.sType == type) return s.members;
  return {};
}

void write(std::span<const Member> members, const FeatureSet& set, void* out) {
  for (const Member& m : members) {
    VkBool32 value = set[size_t(m.feature)];
    std::memcpy(static_cast<std::byte*>(out) + m.offset, &value, sizeof value);
  }
}

void read(std::span<const Member> members, const void* in, FeatureSet& set) {
  for (const Member& m : members) {
    VkBool32 value;
    std::memcpy(&value, static_cast<const std::byte*>(in) + m.offset, sizeof value);
    if (value) set.set(size_t(m.feature));
  }
}

void readCore(const VkPhysicalDeviceFeatures& in, FeatureSet& set) {
  VkBool32 bits[kCoreCount];
  std::memcpy(bits, &in, sizeof bits);
  for (size_t i = 0; i < kCoreCount; i++)
    if (bits[i]) set.set(i);
}

}  // namespace

FeatureSet supportedFeatures() {
  FeatureSet set;
#define PUMICE_FEATURE(member, supported) set[size_t(Feature::member)] = supported;
#include "icd/features.inc"
#undef PUMICE_FEATURE
  return set;
}

VkPhysicalDeviceFeatures coreFeatures(const FeatureSet& set) {
  VkBool32 bits[kCoreCount];
  for (size_t i = 0; i < kCoreCount; i++) bits[i] = set[i];
  VkPhysicalDeviceFeatures f;
  std::memcpy(&f, bits, sizeof f);
  return f;
}

void fillFeatures(const FeatureSet& set, void* chain) {
  for (auto* s = static_cast<VkBaseOutStructure*>(chain); s; s = s->pNext) write(membersOf(s->sType), set, s);
}

FeatureSet requestedFeatures(const VkPhysicalDeviceFeatures* core, const void* chain) {
  FeatureSet set;
  if (core) readCore(*core, set);
  for (auto* s = static_cast<const VkBaseInStructure*>(chain); s; s = s->pNext) {
    if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2)
      readCore(reinterpret_cast<const VkPhysicalDeviceFeatures2*>(s)->features, set);
    else
      read(membersOf(s->sType), s, set);
  }
  return set;
}

const char* featureName(size_t feature) { return kNames[feature]; }

}  // namespace pumice::icd
