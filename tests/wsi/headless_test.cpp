// Surfaces that nobody sees.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace pumice::test
