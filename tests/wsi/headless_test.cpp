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

}  // namespace
}  // namespace pumice::test
