// Surfaces that nobody sees.
#include <gtest/gtest.h>

#include <utility>

#include "tests/wsi/client.h"

namespace pumice::test {
namespace {

TEST(HeadlessSurface, TakesFramesOfAnySizeInEveryMode) {
  Client client({VK_EXT_HEADLESS_SURFACE_EXTENSION_NAME});
  VkHeadlessSurfaceCreateInfoEXT info{VK_STRUCTURE_TYPE_HEADLESS_SURFACE_CREATE_INFO_EXT};
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  ASSERT_EQ(client.function<PFN_vkCreateHeadlessSurfaceEXT>("vkCreateHeadlessSurfaceEXT")(
                client.instance, &info, nullptr, &surface),
            VK_SUCCESS);
  VkSurfaceCapabilitiesKHR c = client.capabilities(surface);
  EXPECT_EQ(c.currentExtent.width, ~0u);
  EXPECT_EQ(c.currentExtent.height, ~0u);
  EXPECT_EQ(c.minImageExtent.width, 1u);
  uint32_t count = 0;
  ASSERT_EQ(vkGetPhysicalDeviceSurfacePresentModesKHR(client.physical, surface, &count, nullptr), VK_SUCCESS);
  std::vector<VkPresentModeKHR> modes(count);
  vkGetPhysicalDeviceSurfacePresentModesKHR(client.physical, surface, &count, modes.data());
  EXPECT_EQ(count, 3u);
  for (VkPresentModeKHR mode : modes)
    for (VkExtent2D extent : {VkExtent2D{64, 48}, {1, 1}, {333, 17}}) {
      ChainOptions options;
      options.mode = mode;
      options.extent = extent;
      Chain chain(client, surface, options);
      ASSERT_EQ(chain.created, VK_SUCCESS);
      for (uint32_t seed = 0; seed < 100; seed++) ASSERT_EQ(chain.show(seed), VK_SUCCESS);
    }
  vkDestroySurfaceKHR(client.instance, surface, nullptr);
}

TEST(HeadlessSurface, ImagesOfASwapchainCountAgainstTheHeap) {
  Client client({VK_EXT_HEADLESS_SURFACE_EXTENSION_NAME});
  VkHeadlessSurfaceCreateInfoEXT info{VK_STRUCTURE_TYPE_HEADLESS_SURFACE_CREATE_INFO_EXT, nullptr, 0};
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  auto create = reinterpret_cast<PFN_vkCreateHeadlessSurfaceEXT>(vkGetInstanceProcAddr(client.instance, "vkCreateHeadlessSurfaceEXT"));
  ASSERT_EQ(create(client.instance, &info, nullptr, &surface), VK_SUCCESS);
  ChainOptions options;
  options.extent = {16384, 16384};
  options.images = 100'000;
  EXPECT_EQ(Chain(client, surface, options).created, VK_ERROR_OUT_OF_DEVICE_MEMORY);
  vkDestroySurfaceKHR(client.instance, surface, nullptr);
}

// A window has one swapchain that is not retired; a surface stands for its window.
TEST(HeadlessSurface, HasOneSwapchainAtATime) {
  Client client({VK_EXT_HEADLESS_SURFACE_EXTENSION_NAME});
  VkHeadlessSurfaceCreateInfoEXT info{VK_STRUCTURE_TYPE_HEADLESS_SURFACE_CREATE_INFO_EXT};
  auto create = client.function<PFN_vkCreateHeadlessSurfaceEXT>("vkCreateHeadlessSurfaceEXT");
  VkSurfaceKHR surface = VK_NULL_HANDLE, other = VK_NULL_HANDLE;
  ASSERT_EQ(create(client.instance, &info, nullptr, &surface), VK_SUCCESS);
  ASSERT_EQ(create(client.instance, &info, nullptr, &other), VK_SUCCESS);
  VkSwapchainCreateInfoKHR chain{VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR};
  chain.surface = surface;
  chain.minImageCount = 2;
  chain.imageFormat = VK_FORMAT_B8G8R8A8_UNORM;
  chain.imageExtent = {16, 16};
  chain.imageArrayLayers = 1;
  chain.imageUsage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  chain.preTransform = VK_SURFACE_TRANSFORM_IDENTITY_BIT_KHR;
  chain.compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
  chain.presentMode = VK_PRESENT_MODE_FIFO_KHR;
  VkSwapchainKHR first = VK_NULL_HANDLE, second = VK_NULL_HANDLE, third = VK_NULL_HANDLE;
  ASSERT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &first), VK_SUCCESS);
  EXPECT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &second), VK_ERROR_NATIVE_WINDOW_IN_USE_KHR);
  chain.surface = other;
  ASSERT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &second), VK_SUCCESS) << "another window";
  vkDestroySwapchainKHR(client.device, second, nullptr);
  chain.surface = surface;
  chain.oldSwapchain = first;
  ASSERT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &second), VK_SUCCESS);
  chain.oldSwapchain = VK_NULL_HANDLE;
  EXPECT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &third), VK_ERROR_NATIVE_WINDOW_IN_USE_KHR);
  vkDestroySwapchainKHR(client.device, first, nullptr);   // retired: it no longer has the window
  EXPECT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &third), VK_ERROR_NATIVE_WINDOW_IN_USE_KHR);
  vkDestroySwapchainKHR(client.device, second, nullptr);
  ASSERT_EQ(vkCreateSwapchainKHR(client.device, &chain, nullptr, &third), VK_SUCCESS);
  vkDestroySwapchainKHR(client.device, third, nullptr);
  vkDestroySurfaceKHR(client.instance, surface, nullptr);
  vkDestroySurfaceKHR(client.instance, other, nullptr);
}

// VK_EXT_swapchain_maintenance1: fences of presents, images given back unseen, another mode for each present.
TEST(HeadlessSurface, PresentsHaveFencesAndModesAndImagesAreGivenBack) {
  Client client({VK_EXT_HEADLESS_SURFACE_EXTENSION_NAME, VK_KHR_GET_SURFACE_CAPABILITIES_2_EXTENSION_NAME, VK_EXT_SURFACE_MAINTENANCE_1_EXTENSION_NAME},
                {VK_EXT_SWAPCHAIN_MAINTENANCE_1_EXTENSION_NAME});
  VkHeadlessSurfaceCreateInfoEXT info{VK_STRUCTURE_TYPE_HEADLESS_SURFACE_CREATE_INFO_EXT};
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  ASSERT_EQ(client.function<PFN_vkCreateHeadlessSurfaceEXT>("vkCreateHeadlessSurfaceEXT")(client.instance, &info, nullptr, &surface), VK_SUCCESS);
  VkPresentModeKHR modes[8];
  VkSurfacePresentModeEXT asked{VK_STRUCTURE_TYPE_SURFACE_PRESENT_MODE_EXT, nullptr, VK_PRESENT_MODE_FIFO_KHR};
  VkPhysicalDeviceSurfaceInfo2KHR surfaceInfo{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SURFACE_INFO_2_KHR, &asked, surface};
  VkSurfacePresentScalingCapabilitiesEXT scaling{VK_STRUCTURE_TYPE_SURFACE_PRESENT_SCALING_CAPABILITIES_EXT};
  scaling.supportedPresentScaling = ~0u;
  VkSurfacePresentModeCompatibilityEXT compatible{VK_STRUCTURE_TYPE_SURFACE_PRESENT_MODE_COMPATIBILITY_EXT, &scaling, 8, modes};
  VkSurfaceCapabilities2KHR capabilities{VK_STRUCTURE_TYPE_SURFACE_CAPABILITIES_2_KHR, &compatible};
  ASSERT_EQ(client.function<PFN_vkGetPhysicalDeviceSurfaceCapabilities2KHR>("vkGetPhysicalDeviceSurfaceCapabilities2KHR")(client.physical, &surfaceInfo, &capabilities),
            VK_SUCCESS);
  EXPECT_EQ(compatible.presentModeCount, 3u);
  EXPECT_EQ(scaling.supportedPresentScaling, 0u);
  EXPECT_EQ(scaling.maxScaledImageExtent.width, capabilities.surfaceCapabilities.maxImageExtent.width);

  Chain chain(client, surface, {});
  ASSERT_EQ(chain.created, VK_SUCCESS);
  // Both images are taken; what is given back can be taken again.
  uint32_t first = 0, second = 0, third = 0;
  ASSERT_EQ(chain.acquire(0, first), VK_SUCCESS);
  ASSERT_EQ(chain.acquire(0, second), VK_SUCCESS);
  EXPECT_EQ(chain.acquire(0, third), VK_NOT_READY);
  VkReleaseSwapchainImagesInfoEXT release{VK_STRUCTURE_TYPE_RELEASE_SWAPCHAIN_IMAGES_INFO_EXT, nullptr, chain.handle, 1, &second};
  auto releaseImages = reinterpret_cast<PFN_vkReleaseSwapchainImagesEXT>(vkGetDeviceProcAddr(client.device, "vkReleaseSwapchainImagesEXT"));
  ASSERT_TRUE(releaseImages);
  EXPECT_EQ(releaseImages(client.device, &release), VK_SUCCESS);
  ASSERT_EQ(chain.acquire(0, third), VK_SUCCESS);
  EXPECT_EQ(third, second);

  VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  VkFence shown = VK_NULL_HANDLE;
  ASSERT_EQ(vkCreateFence(client.device, &fenceInfo, nullptr, &shown), VK_SUCCESS);
  for (VkPresentModeKHR mode : {VK_PRESENT_MODE_IMMEDIATE_KHR, VK_PRESENT_MODE_FIFO_KHR}) {
    VkSwapchainPresentModeInfoEXT modeInfo{VK_STRUCTURE_TYPE_SWAPCHAIN_PRESENT_MODE_INFO_EXT, nullptr, 1, &mode};
    VkSwapchainPresentFenceInfoEXT fences{VK_STRUCTURE_TYPE_SWAPCHAIN_PRESENT_FENCE_INFO_EXT, &modeInfo, 1, &shown};
    VkPresentInfoKHR present{VK_STRUCTURE_TYPE_PRESENT_INFO_KHR, &fences};
    present.swapchainCount = 1;
    present.pSwapchains = &chain.handle;
    present.pImageIndices = &first;
    EXPECT_EQ(vkQueuePresentKHR(client.queue, &present), VK_SUCCESS);
    EXPECT_EQ(vkWaitForFences(client.device, 1, &shown, VK_TRUE, 20'000'000'000), VK_SUCCESS);
    EXPECT_EQ(chain.acquire(0, first), VK_SUCCESS) << "shown: free again";
    vkResetFences(client.device, 1, &shown);
  }
  vkDestroyFence(client.device, shown, nullptr);
  vkDestroySwapchainKHR(client.device, std::exchange(chain.handle, VkSwapchainKHR(VK_NULL_HANDLE)), nullptr);
  vkDestroySurfaceKHR(client.instance, surface, nullptr);
}

}  // namespace
}  // namespace pumice::test
