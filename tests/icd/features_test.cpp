// Features and properties by structure: every structure that the registry has for a version or an extension the device
// reports is filled, all structures with a member agree, and each feature can be requested exactly when it is reported.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <sstream>
#include <set>

#include "tests/icd/driver.h"

namespace pumice::icd::test {
namespace {

struct Member {
  const char* name;
  size_t offset, size;
};
struct Structure {
  const char* name;
  VkStructureType type;
  std::string providers;
  size_t size;
  std::vector<Member> members;
};
const std::vector<Structure> kFeatures = {
#define FEATURES(name, type, provider) {#name, type, provider, sizeof(name), {
#define MEMBER(structure, member) {#member, offsetof(structure, member), sizeof(structure::member)},
#define END }},
#define PROPERTIES(name, type, provider) {"", type, "", sizeof(name), {
#include "registry_structs.inc"
#undef FEATURES
#undef PROPERTIES
};
const std::vector<Structure> kProperties = {
#define FEATURES(name, type, provider) {"", type, "", sizeof(name), {
#define PROPERTIES(name, type, provider) {#name, type, provider, sizeof(name), {
#include "registry_structs.inc"
#undef FEATURES
#undef PROPERTIES
#undef MEMBER
#undef END
};

VkPhysicalDevice physical() { return physicalDevice(commonInstance()); }

uint32_t apiVersion() {
  VkPhysicalDeviceProperties p;
  VK(vkGetPhysicalDeviceProperties)(physical(), &p);
  return p.apiVersion;
}

// Must the device fill this structure?
bool provided(const Structure& s) {
  static const std::vector<std::string> extensions = deviceExtensions();
  static const uint32_t version = apiVersion();
  std::istringstream words(s.providers);
  for (std::string word; words >> word;) {
    if (!word.starts_with("VK_VERSION_")) {
      if (std::find(extensions.begin(), extensions.end(), word) != extensions.end()) return true;
    } else if (version >= VK_MAKE_API_VERSION(0, uint32_t(word[11] - '0'), uint32_t(word[13] - '0'), 0)) {
      return true;
    }
  }
  return false;
}

// A structure with every byte of its members set to a pattern.
struct Filled {
  Filled(const Structure& s, uint8_t pattern) : words(s.size / 8 + 1) {
    std::memset(words.data(), pattern, s.size);
    auto* base = reinterpret_cast<VkBaseOutStructure*>(words.data());
    base->sType = s.type;
    base->pNext = nullptr;
  }
  std::vector<uint64_t> words;
  void* chain() { return words.data(); }
  const uint8_t* bytes() const { return reinterpret_cast<const uint8_t*>(words.data()); }
  VkBool32 boolean(const Member& m) const {
    VkBool32 v;
    std::memcpy(&v, bytes() + m.offset, sizeof v);
    return v;
  }
};

Filled features(const Structure& s) {
  Filled f(s, 0x4d);
  VkPhysicalDeviceFeatures2 f2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, f.chain(), {}};
  VK(vkGetPhysicalDeviceFeatures2)(physical(), &f2);
  return f;
}

TEST(FeatureStructures, AreFilledAndAgree) {
  std::map<std::string, std::pair<VkBool32, const char*>> known;
  size_t seen = 0;
  for (const Structure& s : kFeatures) {
    if (!*s.name || !provided(s)) continue;
    seen++;
    Filled f = features(s);
    for (const Member& m : s.members) {
      EXPECT_LE(f.boolean(m), 1u) << s.name << "::" << m.name << " is not filled";
      auto [at, fresh] = known.try_emplace(m.name, f.boolean(m), s.name);
      EXPECT_EQ(at->second.first, f.boolean(m)) << m.name << " of " << s.name << " and of " << at->second.second;
    }
  }
  EXPECT_GT(seen, 2u);
}

TEST(FeatureStructures, UnknownOnesAreSkipped) {
  // A structure of nobody in front of one that is known: neither touched nor an end to the chain.
  VkPhysicalDeviceTimelineSemaphoreFeatures timeline{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES, nullptr, 77};
  uint32_t strange[16];
  std::memset(strange, 0x4d, sizeof strange);
  auto* base = reinterpret_cast<VkBaseOutStructure*>(strange);
  base->sType = VkStructureType(0x7ffffff0);
  base->pNext = reinterpret_cast<VkBaseOutStructure*>(&timeline);
  VkPhysicalDeviceFeatures2 f2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, strange, {}};
  VK(vkGetPhysicalDeviceFeatures2)(physical(), &f2);
  EXPECT_LE(timeline.timelineSemaphore, 1u);
  for (size_t i = sizeof(VkBaseOutStructure) / 4; i < 16; i++) EXPECT_EQ(strange[i], 0x4d4d4d4du);
}

VkResult create(void* chain) {
  float priority = 1;
  VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
  VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, chain, 0, 1, &queue, 0, nullptr, 0, nullptr, nullptr};
  VkDevice device = VK_NULL_HANDLE;
  VkResult result = VK(vkCreateDevice)(physical(), &info, nullptr, &device);
  if (result == VK_SUCCESS) VK(vkDestroyDevice)(device, nullptr);
  return result;
}

TEST(FeatureStructures, EachFeatureCanBeRequestedExactlyWhenReported) {
  for (const Structure& s : kFeatures) {
    if (!*s.name || !provided(s)) continue;
    Filled have = features(s);
    for (const Member& m : s.members) {
      Filled wanted(s, 0);
      VkBool32 yes = VK_TRUE;
      std::memcpy(reinterpret_cast<uint8_t*>(wanted.words.data()) + m.offset, &yes, sizeof yes);
      // Behind another structure: anywhere in the chain.
      VkPhysicalDeviceFeatures2 front{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, wanted.chain(), {}};
      EXPECT_EQ(create(&front), have.boolean(m) ? VK_SUCCESS : VK_ERROR_FEATURE_NOT_PRESENT) << s.name << "::" << m.name;
    }
  }
}

TEST(PropertyStructures, AreFilledAndAgree) {
  struct Value {
    std::vector<uint8_t> bytes;
    const char* structure;
  };
  std::map<std::string, Value> known;
  size_t seen = 0;
  for (const Structure& s : kProperties) {
    if (!*s.name || !provided(s)) continue;
    seen++;
    // Twice with different bytes before: what is the same afterwards was written.
    Filled a(s, 0xaa), b(s, 0x55);
    for (Filled* f : {&a, &b}) {
      VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, f->chain(), {}};
      VK(vkGetPhysicalDeviceProperties2)(physical(), &p2);
    }
    for (const Member& m : s.members) {
      ASSERT_EQ(std::memcmp(a.bytes() + m.offset, b.bytes() + m.offset, m.size), 0) << s.name << "::" << m.name << " is not filled";
      std::vector<uint8_t> bytes(a.bytes() + m.offset, a.bytes() + m.offset + m.size);
      auto [at, fresh] = known.try_emplace(m.name, bytes, s.name);
      EXPECT_EQ(at->second.bytes, bytes) << m.name << " of " << s.name << " and of " << at->second.structure;
    }
  }
  EXPECT_GT(seen, 2u);
}

// Spec, "Feature Requirements": what a version makes mandatory.
TEST(FeatureStructures, MandatoryFeaturesOfTheVersionAreThere) {
  struct Mandatory {
    uint32_t version;
    std::vector<const char*> features;
  };
  const Mandatory kMandatory[] = {
      {VK_API_VERSION_1_1, {"multiview"}},
      {VK_API_VERSION_1_2,
       {"imagelessFramebuffer", "uniformBufferStandardLayout", "shaderSubgroupExtendedTypes", "separateDepthStencilLayouts",
        "hostQueryReset", "timelineSemaphore", "subgroupBroadcastDynamicId"}},
      {VK_API_VERSION_1_3,
       {"vulkanMemoryModel", "vulkanMemoryModelDeviceScope", "bufferDeviceAddress", "robustImageAccess", "inlineUniformBlock",
        "pipelineCreationCacheControl", "privateData", "shaderDemoteToHelperInvocation", "shaderTerminateInvocation",
        "subgroupSizeControl", "computeFullSubgroups", "synchronization2", "shaderZeroInitializeWorkgroupMemory",
        "dynamicRendering", "shaderIntegerDotProduct", "maintenance4"}},
  };
  std::map<std::string, VkBool32> have;
  for (const Structure& s : kFeatures) {
    if (!*s.name || !provided(s)) continue;
    Filled f = features(s);
    for (const Member& m : s.members) have[m.name] = f.boolean(m);
  }
  for (const Mandatory& m : kMandatory) {
    if (apiVersion() < m.version) continue;
    for (const char* feature : m.features) EXPECT_TRUE(have[feature]) << feature;
  }
  // What a feature drags along.
  auto needs = [&](const char* a, const char* b) { EXPECT_TRUE(!have[a] || have[b]) << a << " without " << b; };
  needs("multiviewGeometryShader", "multiview");
  needs("multiviewTessellationShader", "multiview");
  needs("variablePointers", "variablePointersStorageBuffer");
  needs("storagePushConstant16", "storageBuffer16BitAccess");
  needs("vulkanMemoryModelAvailabilityVisibilityChains", "vulkanMemoryModel");
  needs("vulkanMemoryModelDeviceScope", "vulkanMemoryModel");
  needs("bufferDeviceAddressCaptureReplay", "bufferDeviceAddress");
  needs("shaderSharedInt64Atomics", "shaderBufferInt64Atomics");
  needs("descriptorBindingInlineUniformBlockUpdateAfterBind", "inlineUniformBlock");
  needs("computeFullSubgroups", "subgroupSizeControl");
  if (have["descriptorIndexing"]) {
    for (const char* f : {"shaderSampledImageArrayNonUniformIndexing", "shaderStorageBufferArrayNonUniformIndexing",
                          "shaderUniformTexelBufferArrayDynamicIndexing", "shaderStorageTexelBufferArrayDynamicIndexing",
                          "shaderUniformTexelBufferArrayNonUniformIndexing", "descriptorBindingSampledImageUpdateAfterBind",
                          "descriptorBindingStorageImageUpdateAfterBind", "descriptorBindingStorageBufferUpdateAfterBind",
                          "descriptorBindingUniformTexelBufferUpdateAfterBind", "descriptorBindingStorageTexelBufferUpdateAfterBind",
                          "descriptorBindingUpdateUnusedWhilePending", "descriptorBindingPartiallyBound", "runtimeDescriptorArray"})
      EXPECT_TRUE(have[f]) << f;
  }
}

}  // namespace
}  // namespace pumice::icd::test
