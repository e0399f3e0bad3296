// A Vulkan program in miniature: a device, and swapchains whose images are filled with a pattern and
// presented.
#pragma once

#include <vulkan/vulkan.h>

#include <cstdint>
#include <vector>

namespace pumice::test {

//! The colour of pixel (x, y) of picture number `seed`, 0xRRGGBB.
inline uint32_t patternColor(uint32_t x, uint32_t y, uint32_t seed) {
  return ((x * 3 + seed * 37) & 255) << 16 | ((y * 5 + seed) & 255) << 8 | ((x ^ (y * 7) ^ seed) & 255);
}

class Client {
 public:
  //! Enables the surface extensions given, and VK_KHR_surface and VK_KHR_swapchain.
  explicit Client(const std::vector<const char*>& surfaceExtensions, const std::vector<const char*>& moreOfTheDevice = {});
  ~Client();
  Client(const Client&) = delete;
  template <typename Function>
  Function function(const char* name) const {
    return reinterpret_cast<Function>(vkGetInstanceProcAddr(instance, name));
  }
  VkSurfaceCapabilitiesKHR capabilities(VkSurfaceKHR surface) const;
  //! A render pass of one colour attachment that ends as it is presented.
  VkResult colorPass(VkFormat format, VkAttachmentLoadOp loadOp, VkImageLayout before, VkRenderPass* pass) const;

  VkInstance instance = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  VkCommandPool pool = VK_NULL_HANDLE;
};

struct ChainOptions {
  VkPresentModeKHR mode = VK_PRESENT_MODE_FIFO_KHR;
  VkFormat format = VK_FORMAT_B8G8R8A8_UNORM;
  VkExtent2D extent{64, 48};
  uint32_t images = 2;
  VkCompositeAlphaFlagBitsKHR alpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
  uint8_t alphaByte = 0;                      //!< of every pixel
  VkFormat viewFormat = VK_FORMAT_UNDEFINED;  //!< views may have this one too
};

class Chain {
 public:
  Chain(Client& client, VkSurfaceKHR surface, const ChainOptions& options,
        VkSwapchainKHR old = VK_NULL_HANDLE);
  ~Chain();
  Chain(const Chain&) = delete;

  //! The worst of acquiring and presenting (an error, else VK_SUBOPTIMAL_KHR, else VK_SUCCESS).
  VkResult show(uint32_t seed);
  //! Acquires and fills an image; presented by whoever asked.
  VkResult draw(uint32_t seed, uint32_t& index, VkSemaphore& drawn);
  VkResult present(uint32_t index, VkSemaphore drawn = VK_NULL_HANDLE);
  VkResult acquire(uint64_t timeout, uint32_t& index);

  Client& client;
  ChainOptions options;
  VkResult created = VK_NOT_READY;
  VkSwapchainKHR handle = VK_NULL_HANDLE;
  std::vector<VkImage> images;

 private:
  struct Slot {
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VkSemaphore drawn = VK_NULL_HANDLE;
    VkFence done = VK_NULL_HANDLE;
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    uint8_t* pixels = nullptr;
  };
  std::vector<Slot> slots_;  //!< one per image
  VkFence acquired_ = VK_NULL_HANDLE;
};

}  // namespace pumice::test
