// Frames in a window: cleared and presented.
#include <xcb/xcb.h>

#include <algorithm>
#include <array>

#include "bench/scenes/resources.h"

#include <vulkan/vulkan_xcb.h>  // after vulkan.h

namespace pumice::bench {
namespace {

using cts::check;

struct Present : Scene {
  VkExtent2D extent;
  xcb_connection_t* connection = nullptr;
  VkInstance instance = VK_NULL_HANDLE;
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  VkSwapchainKHR swapchain = VK_NULL_HANDLE;
  VkRenderPass pass = VK_NULL_HANDLE;
  std::vector<VkImageView> views;
  std::vector<VkFramebuffer> targets;
  std::array<VkSemaphore, 2> semaphores{};  // an image is there; it is drawn
  uint32_t turn = 0;

  Present(Device& d, const Options& options) : Scene(d), extent{options.width, options.height}, instance(options.instance) {
    openWindow();
    VkXcbSurfaceCreateInfoKHR surfaceInfo{};
    surfaceInfo.sType = VK_STRUCTURE_TYPE_XCB_SURFACE_CREATE_INFO_KHR;
    surfaceInfo.connection = connection;
    surfaceInfo.window = window;
    check(vkCreateXcbSurfaceKHR(instance, &surfaceInfo, nullptr, &surface), "vkCreateXcbSurfaceKHR");
    VkBool32 presents = VK_FALSE;
    check(vkGetPhysicalDeviceSurfaceSupportKHR(device.physical, device.family, surface, &presents), "vkGetPhysicalDeviceSurfaceSupportKHR");
    if (!presents) throw std::runtime_error("the queue does not present to this window");
    makeSwapchain();
    makeTargets();
    for (VkSemaphore& semaphore : semaphores) {
      VkSemaphoreCreateInfo info{};
      info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO;
      check(vkCreateSemaphore(device.handle, &info, nullptr, &semaphore), "vkCreateSemaphore");
    }
  }

  ~Present() override {
    vkDeviceWaitIdle(device.handle);
    for (VkSemaphore semaphore : semaphores) vkDestroySemaphore(device.handle, semaphore, nullptr);
    for (VkFramebuffer target : targets) vkDestroyFramebuffer(device.handle, target, nullptr);
    for (VkImageView view : views) vkDestroyImageView(device.handle, view, nullptr);
    vkDestroyRenderPass(device.handle, pass, nullptr);
    vkDestroySwapchainKHR(device.handle, swapchain, nullptr);
    vkDestroySurfaceKHR(instance, surface, nullptr);
    xcb_disconnect(connection);
  }

  void frame() override {
    uint32_t index = 0;
    check(vkAcquireNextImageKHR(device.handle, swapchain, UINT64_MAX, semaphores[0], VK_NULL_HANDLE, &index), "vkAcquireNextImageKHR");
    check(vkResetCommandPool(device.handle, pool, 0), "vkResetCommandPool");
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
    beginPass(commands, pass, targets[index], extent.width, extent.height, {clearColour(float(++turn % 100) * 0.01f, 0.3f, 0.6f, 1)});
    vkCmdEndRenderPass(commands);
    check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
    VkSubmitInfo submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.waitSemaphoreCount = submit.commandBufferCount = submit.signalSemaphoreCount = 1;
    submit.pWaitSemaphores = &semaphores[0];
    submit.pWaitDstStageMask = &stage;
    submit.pCommandBuffers = &commands;
    submit.pSignalSemaphores = &semaphores[1];
    check(vkQueueSubmit(device.queue, 1, &submit, fence), "vkQueueSubmit");
    VkPresentInfoKHR present{};
    present.sType = VK_STRUCTURE_TYPE_PRESENT_INFO_KHR;
    present.waitSemaphoreCount = present.swapchainCount = 1;
    present.pWaitSemaphores = &semaphores[1];
    present.pSwapchains = &swapchain;
    present.pImageIndices = &index;
    check(vkQueuePresentKHR(device.queue, &present), "vkQueuePresentKHR");
    check(vkWaitForFences(device.handle, 1, &fence, VK_TRUE, UINT64_MAX), "vkWaitForFences");
    check(vkResetFences(device.handle, 1, &fence), "vkResetFences");
  }

 private:
  void openWindow() {
    connection = xcb_connect(nullptr, nullptr);
    if (!connection || xcb_connection_has_error(connection)) throw std::runtime_error("no X server");
    const xcb_screen_t* screen = xcb_setup_roots_iterator(xcb_get_setup(connection)).data;
    window = xcb_generate_id(connection);
    xcb_create_window(connection, XCB_COPY_FROM_PARENT, window, screen->root, 0, 0, uint16_t(extent.width), uint16_t(extent.height), 0,
                      XCB_WINDOW_CLASS_INPUT_OUTPUT, screen->root_visual, 0, nullptr);
    xcb_map_window(connection, window);
    xcb_flush(connection);
  }

  void makeSwapchain() {
    VkSurfaceCapabilitiesKHR can{};
    check(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(device.physical, surface, &can), "vkGetPhysicalDeviceSurfaceCapabilitiesKHR");
    uint32_t count = 1;
    VkSurfaceFormatKHR format{};
    vkGetPhysicalDeviceSurfaceFormatsKHR(device.physical, surface, &count, &format);
    colour = format.format;
    vkGetPhysicalDeviceSurfacePresentModesKHR(device.physical, surface, &count, nullptr);
    std::vector<VkPresentModeKHR> modes(count);
    vkGetPhysicalDeviceSurfacePresentModesKHR(device.physical, surface, &count, modes.data());
    VkPresentModeKHR mode = VK_PRESENT_MODE_FIFO_KHR;
    for (VkPresentModeKHR each : modes)
      if (each == VK_PRESENT_MODE_IMMEDIATE_KHR) mode = each;
    VkSwapchainCreateInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR;
    info.surface = surface;
    info.minImageCount = std::max(can.minImageCount, 3u);
    if (can.maxImageCount) info.minImageCount = std::min(info.minImageCount, can.maxImageCount);
    info.imageFormat = colour;
    info.imageColorSpace = format.colorSpace;
    info.imageExtent = extent;
    info.imageArrayLayers = 1;
    info.imageUsage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
    info.preTransform = can.currentTransform;
    info.compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
    info.presentMode = mode;
    check(vkCreateSwapchainKHR(device.handle, &info, nullptr, &swapchain), "vkCreateSwapchainKHR");
  }

  void makeTargets() {
    VkAttachmentDescription attachment{};
    attachment.format = colour;
    attachment.samples = VK_SAMPLE_COUNT_1_BIT;
    attachment.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    attachment.finalLayout = VK_IMAGE_LAYOUT_PRESENT_SRC_KHR;
    VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
    VkSubpassDescription subpass{};
    subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    subpass.colorAttachmentCount = 1;
    subpass.pColorAttachments = &reference;
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
    VkSubpassDependency dependency{VK_SUBPASS_EXTERNAL, 0, stage, stage, 0, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT, 0};
    VkRenderPassCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
    info.attachmentCount = info.subpassCount = info.dependencyCount = 1;
    info.pAttachments = &attachment;
    info.pSubpasses = &subpass;
    info.pDependencies = &dependency;
    check(vkCreateRenderPass(device.handle, &info, nullptr, &pass), "vkCreateRenderPass");
    uint32_t count = 0;
    vkGetSwapchainImagesKHR(device.handle, swapchain, &count, nullptr);
    std::vector<VkImage> images(count);
    vkGetSwapchainImagesKHR(device.handle, swapchain, &count, images.data());
    for (VkImage image : images) {
      VkImageViewCreateInfo viewInfo{};
      viewInfo.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
      viewInfo.image = image;
      viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D;
      viewInfo.format = colour;
      viewInfo.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      check(vkCreateImageView(device.handle, &viewInfo, nullptr, &views.emplace_back()), "vkCreateImageView");
      VkFramebufferCreateInfo frameInfo{};
      frameInfo.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
      frameInfo.renderPass = pass;
      frameInfo.attachmentCount = frameInfo.layers = 1;
      frameInfo.pAttachments = &views.back();
      frameInfo.width = extent.width;
      frameInfo.height = extent.height;
      check(vkCreateFramebuffer(device.handle, &frameInfo, nullptr, &targets.emplace_back()), "vkCreateFramebuffer");
    }
  }

  xcb_window_t window = 0;
  VkFormat colour = VK_FORMAT_UNDEFINED;
};

}  // namespace

void addPresentScenes(SceneTable& table) {
  SceneEntry entry{"present", "frames of 1280x720, cleared and shown in a window", makeScene<Present>};
  entry.window = true;
  table.push_back(entry);
}

}  // namespace pumice::bench
