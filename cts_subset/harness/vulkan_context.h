// Opening Pumice and a peer driver in one process, through the ordinary loader.
//
// The harness is a plain Vulkan client: it knows nothing of Pumice's insides. Failed calls throw
// VulkanError, which the tests report; nothing here is linked into the driver.
#pragma once

#include <vulkan/vulkan.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

namespace pumice::cts {

struct VulkanError : std::runtime_error {
  VulkanError(VkResult r, const std::string& what);
  VkResult result;
};

const char* resultName(VkResult result);
void check(VkResult result, const char* what);

// Points the loader at the driver under test and at lavapipe. Call it before the first Vulkan call.
// The driver's manifest is $PUMICE_TEST_ICD, else the one of the build tree.
void selectDrivers();
std::string pumiceManifest();
std::string lavapipeManifest();  // empty when lavapipe is not installed

// Start of VkPhysicalDeviceProperties::deviceName of the driver under test ("Pumice", or
// $PUMICE_TEST_DEVICE, with which the harness can be tried on lavapipe against itself).
std::string testedDeviceName();
inline constexpr const char* kLavapipeName = "llvmpipe";

bool peersRequired();        // $PUMICE_REQUIRE_PEERS
bool validationRequested();  // $PUMICE_VALIDATE

class VulkanInstance {
 public:
  explicit VulkanInstance(bool validation, const std::vector<const char*>& extensions = {});
  ~VulkanInstance();
  VulkanInstance(const VulkanInstance&) = delete;
  VulkanInstance& operator=(const VulkanInstance&) = delete;

  VkInstance handle() const { return instance; }
  // The device whose name starts with `prefix`, or null.
  VkPhysicalDevice find(const std::string& prefix) const;
  std::vector<std::string> deviceNames() const;

  // Warnings and errors of the validation layer since the last call. Zero without the layer.
  std::vector<std::string> takeMessages();
  void addMessage(std::string text);
  static bool validationAvailable();

 private:
  VkInstance instance = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
  std::mutex messageLock;
  std::vector<std::string> messages;
};

// A logical device with its one graphics queue, all features that the physical device has, and those extensions that
// tests use (deviceExtensions in the .cpp file), if it has them.
class Device {
 public:
  explicit Device(VkPhysicalDevice physical);
  // Only these features and extensions, as an application that knows what it needs: for measuring.
  Device(VkPhysicalDevice physical, const VkPhysicalDeviceFeatures& wanted, const std::vector<const char*>& wantedExtensions,
         const void* chain = nullptr);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  VkDevice handle = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  uint32_t family = 0;
  VkPhysicalDeviceProperties properties{};
  VkPhysicalDeviceFeatures features{};
  // All false below version 1.2 or 1.3.
  VkPhysicalDeviceVulkan11Features vulkan11{};
  VkPhysicalDeviceVulkan12Features vulkan12{};
  VkPhysicalDeviceVulkan13Features vulkan13{};
  // Of extensions: all false where the extension is missing.
  VkPhysicalDevice4444FormatsFeaturesEXT smallFormats{};
  VkPhysicalDeviceCustomBorderColorFeaturesEXT borders{};
  VkPhysicalDeviceRobustness2FeaturesEXT robustness2{};
  VkPhysicalDeviceIndexTypeUint8FeaturesEXT indexTypeUint8{};
  VkPhysicalDevicePrimitiveTopologyListRestartFeaturesEXT listRestart{};
  VkPhysicalDeviceMultiDrawFeaturesEXT multiDraw{};
  VkPhysicalDeviceVertexAttributeDivisorFeaturesEXT divisor{};
  VkPhysicalDeviceShaderAtomicFloatFeaturesEXT atomicFloat{};
  VkPhysicalDeviceShaderAtomicFloat2FeaturesEXT atomicFloat2{};
  VkPhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR subgroupUniformFlow{};
  std::vector<std::string> extensions;  // enabled
  // All false without the extension.
  VkPhysicalDeviceProvokingVertexFeaturesEXT provokingVertex{};
  VkPhysicalDeviceDepthClipEnableFeaturesEXT depthClip{};
  VkPhysicalDeviceLineRasterizationFeaturesEXT lines{};
  VkPhysicalDeviceMemoryProperties memory{};

  VkPipelineCache pipelineCache = VK_NULL_HANDLE;  // what Canvas and Workspace make pipelines with; whoever sets it destroys it

  std::string name() const { return properties.deviceName; }
  bool has(const char* extension) const;
  bool supports(VkFormat format, VkFormatFeatureFlags optimalFeatures) const;
  uint32_t memoryType(uint32_t allowed, VkMemoryPropertyFlags wanted) const;

  // Records one command buffer, submits it and waits until it is done. Several threads may call
  // this: each call has its own pool, and the queue is locked.
  void run(const std::function<void(VkCommandBuffer)>& record);
  void waitIdle();

 private:
  void readProperties();  // and the queue family with graphics
  void create(const void* chain, const VkPhysicalDeviceFeatures* enabled);

  std::mutex queueLock;
};

}  // namespace pumice::cts
