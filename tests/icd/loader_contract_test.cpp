// What the loader relies on (Vulkan-Loader, "LoaderDriverInterface"; spec, "Command Function Pointers"). The
// list of commands comes from the registry, not from the driver's own tables.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <set>

#include "tests/icd/driver.h"

namespace pumice::icd::test {
namespace {

struct CoreCommand {
  const char* name;
  std::string_view first;  // type of its first parameter
  int version;             // 10, 11, ...
};
const CoreCommand kCore[] = {
#define CORE(name, first, version) {#name, #first, version},
#define EXTENSION(name, first, extension, needs)
#include "registry_commands.inc"
#undef CORE
#undef EXTENSION
};

struct ExtensionCommand {
  const char* name;
  std::string_view first;
  std::string extension;
  std::string needs;  // other extensions or versions, in the registry's words
};
const ExtensionCommand kExtension[] = {
#define CORE(name, first, version)
#define EXTENSION(name, first, extension, needs) {#name, #first, #extension, needs},
#include "registry_commands.inc"
#undef CORE
#undef EXTENSION
};

bool isDeviceLevel(std::string_view first) {
  return first == "VkDevice" || first == "VkQueue" || first == "VkCommandBuffer";
}

std::set<std::string> asSet(const std::vector<std::string>& v) { return {v.begin(), v.end()}; }

bool isCore(const char* name) {
  return std::any_of(std::begin(kCore), std::end(kCore),
                     [&](const CoreCommand& c) { return !std::strcmp(c.name, name); });
}

// Every extension and version named in the registry's condition is there.
bool met(const std::string& needs, std::set<std::string> have) {
  if (needs.empty()) return true;
  VkPhysicalDeviceProperties p;
  VK(vkGetPhysicalDeviceProperties)(physicalDevice(commonInstance()), &p);
  for (uint32_t minor = 0; minor <= VK_API_VERSION_MINOR(p.apiVersion); minor++) have.insert("VK_VERSION_1_" + std::to_string(minor));
  for (size_t at = 0; at < needs.size();) {
    size_t end = needs.find_first_of(",+() ", at);
    if (end == std::string::npos) end = needs.size();
    if (std::string word = needs.substr(at, end - at); word.starts_with("VK_") && !have.count(word))
      return false;
    at = end + 1;
  }
  return true;
}

TEST(LoaderContract, NegotiationIsIdempotent) {
  for (uint32_t offered = 0; offered < 10; offered++) {
    uint32_t first = offered;
    ASSERT_EQ(driver().negotiate(&first), VK_SUCCESS);
    EXPECT_EQ(first, std::min(offered, 7u));
    uint32_t second = first;
    ASSERT_EQ(driver().negotiate(&second), VK_SUCCESS);
    EXPECT_EQ(second, first);
  }
}

TEST(LoaderContract, ThreeSymbolsAreExported) {
  FILE* pipe = popen("nm -D --defined-only --format=posix '" PUMICE_DRIVER "' | cut -d' ' -f1 | sort", "r");
  ASSERT_TRUE(pipe);
  std::string text;
  char line[256];
  while (std::fgets(line, sizeof line, pipe)) text += line;
  ASSERT_EQ(pclose(pipe), 0);
  EXPECT_EQ(text,
            "vk_icdGetInstanceProcAddr\n"
            "vk_icdGetPhysicalDeviceProcAddr\n"
            "vk_icdNegotiateLoaderICDInterfaceVersion\n");
}

TEST(LoaderContract, CommandsBeforeAnInstance) {
  for (const char* name : {"vkCreateInstance", "vkEnumerateInstanceExtensionProperties",
                           "vkEnumerateInstanceLayerProperties", "vkEnumerateInstanceVersion"})
    EXPECT_TRUE(driver().find(VK_NULL_HANDLE, name)) << name;
  for (const char* name : {"vkDestroyInstance", "vkCreateDevice", "vkCreateBuffer", "vkCmdDraw",
                           "vkCreateInstanc", "", "vkCreateInstance2"})
    EXPECT_FALSE(driver().find(VK_NULL_HANDLE, name)) << name;
}

TEST(LoaderContract, EveryCoreCommandResolves) {
  ASSERT_GT(std::size(kCore), 200u);
  TestDevice device(std::vector<std::string>{});
  auto getDevice = VK(vkGetDeviceProcAddr);
  for (const CoreCommand& c : kCore) {
    EXPECT_TRUE(driver().find(commonInstance(), c.name))
        << c.name << " of " << c.version << " through vkGetInstanceProcAddr";
    bool device_level = isDeviceLevel(c.first);
    EXPECT_EQ(getDevice(device.handle, c.name) != nullptr, device_level)
        << c.name << " of " << c.version << " through vkGetDeviceProcAddr";
    EXPECT_EQ(driver().findPhysical(commonInstance(), c.name) != nullptr, c.first == "VkPhysicalDevice")
        << c.name;
  }
}

TEST(LoaderContract, CommandsOfEnabledExtensionsResolve) {
  std::set<std::string> advertised = asSet(instanceExtensions());
  advertised.merge(asSet(deviceExtensions()));
  TestDevice device;
  size_t seen = 0;
  for (const ExtensionCommand& c : kExtension) {
    if (!advertised.count(c.extension) || !met(c.needs, advertised)) continue;
    seen++;
    EXPECT_TRUE(driver().find(commonInstance(), c.name)) << c.name << " of " << c.extension;
    EXPECT_EQ(VK(vkGetDeviceProcAddr)(device.handle, c.name) != nullptr, isDeviceLevel(c.first))
        << c.name << " of " << c.extension;
    EXPECT_EQ(driver().findPhysical(commonInstance(), c.name) != nullptr, c.first == "VkPhysicalDevice")
        << c.name;
  }
  EXPECT_GT(seen, 50u);
}

TEST(LoaderContract, CommandsOfOtherExtensionsDoNot) {
  std::set<std::string> instanceSet = asSet(instanceExtensions()), deviceSet = asSet(deviceExtensions()),
                        advertised = instanceSet;
  advertised.insert(deviceSet.begin(), deviceSet.end());
  VkInstance bare = makeInstance({});
  ASSERT_TRUE(bare);
  TestDevice device(std::vector<std::string>{});
  for (const ExtensionCommand& c : kExtension) {
    if (isCore(c.name)) continue;
    EXPECT_FALSE(VK(vkGetDeviceProcAddr)(device.handle, c.name)) << c.name << ", no extension is enabled";
    // A command may belong to several extensions.
    auto providedBy = [&](const std::set<std::string>& set) {
      return std::any_of(std::begin(kExtension), std::end(kExtension), [&](const ExtensionCommand& o) {
        return !std::strcmp(o.name, c.name) && set.count(o.extension);
      });
    };
    if (!providedBy(advertised)) {
      EXPECT_FALSE(driver().find(commonInstance(), c.name))
          << c.name << " of " << c.extension << ", which is not advertised";
    }
    // Device extensions may be enabled later; those of the instance are not.
    if (!providedBy(deviceSet)) {
      EXPECT_FALSE(driver().find(bare, c.name))
          << c.name << " of " << c.extension << ", which is not enabled";
    }
  }
  reinterpret_cast<PFN_vkDestroyInstance>(driver().find(bare, "vkDestroyInstance"))(bare, nullptr);
}

TEST(LoaderContract, EachExtensionAloneGivesItsOwnCommands) {
  for (const std::string& extension : deviceExtensions()) {
    TestDevice device(std::vector<std::string>{extension});
    for (const ExtensionCommand& c : kExtension) {
      if (isCore(c.name)) continue;
      bool own = false, ownAlways = false;
      for (const ExtensionCommand& o : kExtension)
        if (!std::strcmp(o.name, c.name) && o.extension == extension)
          own = true, ownAlways |= o.needs.empty();
      bool found = VK(vkGetDeviceProcAddr)(device.handle, c.name);
      if (!own) {
        EXPECT_FALSE(found) << c.name << " with only " << extension;
      }
      if (ownAlways && isDeviceLevel(c.first)) {
        EXPECT_TRUE(found) << c.name << " with only " << extension;
      }
    }
  }
}

TEST(LoaderContract, UnknownNamesGiveNull) {
  TestDevice device;
  for (const char* name : {"", "vk", "vkFoo", "vkCmdDrawX", "vkCmdDra", "VkCmdDraw", "vkCmdDraw ", "zzz",
                           "\xff\xff", "vkCreateRayTracingPipelinesKHR"}) {
    EXPECT_FALSE(driver().find(commonInstance(), name)) << name;
    EXPECT_FALSE(driver().findPhysical(commonInstance(), name)) << name;
    EXPECT_FALSE(VK(vkGetDeviceProcAddr)(device.handle, name)) << name;
  }
}

TEST(LoaderContract, UnknownExtensionsAndFeaturesAreRefused) {
  EXPECT_FALSE(makeInstance({"VK_EXT_not_there"}));
  EXPECT_FALSE(makeInstance({"VK_KHR_swapchain"})) << "a device extension";
  VkPhysicalDevice physical = physicalDevice(commonInstance());
  float priority = 1;
  VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
  VkDevice device = VK_NULL_HANDLE;
  for (const char* name : {"VK_EXT_not_there", "VK_KHR_surface"}) {
    VkDeviceCreateInfo info{
        VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, nullptr, 0, 1, &queue, 0, nullptr, 1, &name, nullptr};
    EXPECT_EQ(VK(vkCreateDevice)(physical, &info, nullptr, &device), VK_ERROR_EXTENSION_NOT_PRESENT) << name;
  }
  // Each feature that is not there, one at a time, both ways of asking.
  constexpr size_t kCount = sizeof(VkPhysicalDeviceFeatures) / sizeof(VkBool32);
  VkPhysicalDeviceFeatures have;
  VK(vkGetPhysicalDeviceFeatures)(physical, &have);
  VkBool32 bits[kCount];
  std::memcpy(bits, &have, sizeof bits);
  for (size_t i = 0; i < kCount; i++) {
    VkPhysicalDeviceFeatures2 wanted{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, nullptr, {}};
    reinterpret_cast<VkBool32*>(&wanted.features)[i] = VK_TRUE;
    for (bool chained : {false, true}) {
      VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                              chained ? &wanted : nullptr,
                              0,
                              1,
                              &queue,
                              0,
                              nullptr,
                              0,
                              nullptr,
                              chained ? nullptr : &wanted.features};
      VkResult result = VK(vkCreateDevice)(physical, &info, nullptr, &device);
      EXPECT_EQ(result, bits[i] ? VK_SUCCESS : VK_ERROR_FEATURE_NOT_PRESENT) << "feature " << i;
      if (result == VK_SUCCESS) VK(vkDestroyDevice)(device, nullptr);
    }
  }
}

// The loader's own view: both forms of vulkaninfo, with the validation layer listening.
class Vulkaninfo : public testing::TestWithParam<const char*> {};

TEST_P(Vulkaninfo, RunsAndTheValidationLayerIsSilent) {
#ifdef PUMICE_SANITIZER_RUNTIME
  GTEST_SKIP() << "a program that is not instrumented";
#endif
  if (std::system("command -v vulkaninfo > /dev/null")) GTEST_SKIP() << "vulkaninfo is not installed";
  for (const char* layers : {"", "VK_LAYER_KHRONOS_validation"}) {
    std::string command =
        std::string("env -u VK_DRIVER_FILES VK_ICD_FILENAMES='" PUMICE_MANIFEST "' VK_INSTANCE_LAYERS=") +
        layers + " timeout -k 5 60 vulkaninfo " + GetParam() + " 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    ASSERT_TRUE(pipe);
    std::string text;
    char line[4096];
    while (std::fgets(line, sizeof line, pipe))
      if (!std::strstr(line, "env var 'VK_INSTANCE_LAYERS'"))
        text += line;  // the loader warns that it does what it was told
    EXPECT_EQ(pclose(pipe), 0) << text;
    EXPECT_NE(text.find("Pumice"), std::string::npos) << text;
    for (const char* bad : {"VUID", "Validation Error", "Validation Warning", "Validation Performance",
                            "ERROR:", "WARNING:", "UNASSIGNED"})
      EXPECT_EQ(text.find(bad), std::string::npos) << bad << " in " << command << "\n" << text;
  }
}

INSTANTIATE_TEST_SUITE_P(LoaderContract, Vulkaninfo, testing::Values("", "--summary"),
                         [](const auto& i) { return std::string(i.param[0] ? "Summary" : "Full"); });

}  // namespace
}  // namespace pumice::icd::test
