#include "tests/wsi/client.h"

#include <gtest/gtest.h>

#include <cstring>
#include <iterator>
#include <stdexcept>

namespace pumice::test {
namespace {

constexpr uint64_t kPatience = 20'000'000'000;  // ns: nothing here takes so long

}  // namespace

Client::Client(const std::vector<const char*>& surfaceExtensions, const std::vector<const char*>& moreOfTheDevice) {
  std::vector<const char*> extensions = surfaceExtensions;
  extensions.push_back(VK_KHR_SURFACE_EXTENSION_NAME);
  VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
  info.enabledExtensionCount = uint32_t(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  if (vkCreateInstance(&info, nullptr, &instance) != VK_SUCCESS) throw std::runtime_error("no instance");
  uint32_t count = 1;
  vkEnumeratePhysicalDevices(instance, &count, &physical);
  if (!physical) throw std::runtime_error("no physical device");
  VkPhysicalDeviceProperties properties;
  vkGetPhysicalDeviceProperties(physical, &properties);
  if (!std::strstr(properties.deviceName, "Pumice")) throw std::runtime_error("not this driver");
  float priority = 1;
  VkDeviceQueueCreateInfo queueInfo{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
  queueInfo.queueCount = 1;
  queueInfo.pQueuePriorities = &priority;
  std::vector<const char*> deviceExtensions = {
      VK_KHR_SWAPCHAIN_EXTENSION_NAME, VK_KHR_SWAPCHAIN_MUTABLE_FORMAT_EXTENSION_NAME,
      VK_KHR_IMAGE_FORMAT_LIST_EXTENSION_NAME, VK_KHR_MAINTENANCE_2_EXTENSION_NAME};
  deviceExtensions.insert(deviceExtensions.end(), moreOfTheDevice.begin(), moreOfTheDevice.end());
  VkDeviceCreateInfo deviceInfo{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
  deviceInfo.queueCreateInfoCount = 1;
  deviceInfo.pQueueCreateInfos = &queueInfo;
  deviceInfo.enabledExtensionCount = uint32_t(deviceExtensions.size());
  deviceInfo.ppEnabledExtensionNames = deviceExtensions.data();
  if (vkCreateDevice(physical, &deviceInfo, nullptr, &device) != VK_SUCCESS)
    throw std::runtime_error("no device");
  vkGetDeviceQueue(device, 0, 0, &queue);
  VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  poolInfo.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  if (vkCreateCommandPool(device, &poolInfo, nullptr, &pool) != VK_SUCCESS)
    throw std::runtime_error("no command pool");
}

Client::~Client() {
  if (device) {
    vkDeviceWaitIdle(device);
    vkDestroyCommandPool(device, pool, nullptr);
    vkDestroyDevice(device, nullptr);
  }
  if (instance) vkDestroyInstance(instance, nullptr);
}

VkResult Client::colorPass(VkFormat format, VkAttachmentLoadOp loadOp, VkImageLayout before, VkRenderPass* pass) const {
  VkAttachmentDescription attachment{};
  attachment.format = format;
  attachment.samples = VK_SAMPLE_COUNT_1_BIT;
  attachment.loadOp = loadOp;
  attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  attachment.initialLayout = before;
  attachment.finalLayout = VK_IMAGE_LAYOUT_PRESENT_SRC_KHR;
  VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  VkRenderPassCreateInfo info{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO};
  info.attachmentCount = 1;
  info.pAttachments = &attachment;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  return vkCreateRenderPass(device, &info, nullptr, pass);
}

VkSurfaceCapabilitiesKHR Client::capabilities(VkSurfaceKHR surface) const {
  VkSurfaceCapabilitiesKHR c{};
  EXPECT_EQ(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(physical, surface, &c), VK_SUCCESS);
  return c;
}

Chain::Chain(Client& c, VkSurfaceKHR surface, const ChainOptions& o, VkSwapchainKHR old)
    : client(c), options(o) {
  VkSwapchainCreateInfoKHR info{VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR};
  info.surface = surface;
  info.minImageCount = o.images;
  info.imageFormat = o.format;
  info.imageColorSpace = VK_COLOR_SPACE_SRGB_NONLINEAR_KHR;
  info.imageExtent = o.extent;
  info.imageArrayLayers = 1;
  info.imageUsage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  info.preTransform = VK_SURFACE_TRANSFORM_IDENTITY_BIT_KHR;
  info.compositeAlpha = o.alpha;
  info.presentMode = o.mode;
  info.clipped = VK_TRUE;
  info.oldSwapchain = old;
  const VkFormat formats[] = {o.format, o.viewFormat};
  VkImageFormatListCreateInfo list{VK_STRUCTURE_TYPE_IMAGE_FORMAT_LIST_CREATE_INFO};
  list.viewFormatCount = 2;
  list.pViewFormats = formats;
  if (o.viewFormat) {
    info.flags = VK_SWAPCHAIN_CREATE_MUTABLE_FORMAT_BIT_KHR;
    info.pNext = &list;
  }
  created = vkCreateSwapchainKHR(c.device, &info, nullptr, &handle);
  if (created != VK_SUCCESS) return;
  uint32_t count = 0;
  vkGetSwapchainImagesKHR(c.device, handle, &count, nullptr);
  images.resize(count);
  vkGetSwapchainImagesKHR(c.device, handle, &count, images.data());

  VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  vkCreateFence(c.device, &fenceInfo, nullptr, &acquired_);
  fenceInfo.flags = VK_FENCE_CREATE_SIGNALED_BIT;
  slots_.resize(count);
  for (Slot& slot : slots_) {
    VkCommandBufferAllocateInfo commandInfo{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    commandInfo.commandPool = c.pool;
    commandInfo.commandBufferCount = 1;
    vkAllocateCommandBuffers(c.device, &commandInfo, &slot.commands);
    VkSemaphoreCreateInfo semaphoreInfo{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO};
    vkCreateSemaphore(c.device, &semaphoreInfo, nullptr, &slot.drawn);
    vkCreateFence(c.device, &fenceInfo, nullptr, &slot.done);
    VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    bufferInfo.size = VkDeviceSize(o.extent.width) * o.extent.height * 4;
    bufferInfo.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    vkCreateBuffer(c.device, &bufferInfo, nullptr, &slot.buffer);
    VkMemoryRequirements requirements;
    vkGetBufferMemoryRequirements(c.device, slot.buffer, &requirements);
    VkMemoryAllocateInfo memoryInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    memoryInfo.allocationSize = requirements.size;
    vkAllocateMemory(c.device, &memoryInfo, nullptr, &slot.memory);
    vkBindBufferMemory(c.device, slot.buffer, slot.memory, 0);
    vkMapMemory(c.device, slot.memory, 0, VK_WHOLE_SIZE, 0, reinterpret_cast<void**>(&slot.pixels));
  }
}

Chain::~Chain() {
  vkDeviceWaitIdle(client.device);
  for (Slot& slot : slots_) {
    vkFreeCommandBuffers(client.device, client.pool, 1, &slot.commands);
    vkDestroySemaphore(client.device, slot.drawn, nullptr);
    vkDestroyFence(client.device, slot.done, nullptr);
    vkDestroyBuffer(client.device, slot.buffer, nullptr);
    vkFreeMemory(client.device, slot.memory, nullptr);
  }
  vkDestroyFence(client.device, acquired_, nullptr);
  vkDestroySwapchainKHR(client.device, handle, nullptr);
}

VkResult Chain::acquire(uint64_t timeout, uint32_t& index) {
  VkResult result = vkAcquireNextImageKHR(client.device, handle, timeout, VK_NULL_HANDLE, acquired_, &index);
  if (result != VK_SUCCESS && result != VK_SUBOPTIMAL_KHR) return result;
  EXPECT_EQ(vkWaitForFences(client.device, 1, &acquired_, VK_TRUE, kPatience), VK_SUCCESS);
  vkResetFences(client.device, 1, &acquired_);
  return result;
}

VkResult Chain::draw(uint32_t seed, uint32_t& index, VkSemaphore& drawn) {
  VkResult result = acquire(kPatience, index);
  if (result < 0 || result == VK_TIMEOUT) return result;
  Slot& slot = slots_.at(index);
  vkWaitForFences(client.device, 1, &slot.done, VK_TRUE, kPatience);
  vkResetFences(client.device, 1, &slot.done);
  const bool redFirst =
      options.format == VK_FORMAT_R8G8B8A8_UNORM || options.format == VK_FORMAT_R8G8B8A8_SRGB;
  uint8_t* p = slot.pixels;
  for (uint32_t y = 0; y < options.extent.height; y++)
    for (uint32_t x = 0; x < options.extent.width; x++, p += 4) {
      uint32_t color = patternColor(x, y, seed);
      p[redFirst ? 0 : 2] = uint8_t(color >> 16);
      p[1] = uint8_t(color >> 8);
      p[redFirst ? 2 : 0] = uint8_t(color);
      p[3] = options.alphaByte;
    }

  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  vkBeginCommandBuffer(slot.commands, &begin);
  VkImageMemoryBarrier barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
  barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  barrier.image = images[index];
  barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  vkCmdPipelineBarrier(slot.commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0,
                       nullptr, 0, nullptr, 1, &barrier);
  VkBufferImageCopy copy{};
  copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  copy.imageExtent = {options.extent.width, options.extent.height, 1};
  vkCmdCopyBufferToImage(slot.commands, slot.buffer, images[index], VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1,
                         &copy);
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = 0;
  barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  barrier.newLayout = VK_IMAGE_LAYOUT_PRESENT_SRC_KHR;
  vkCmdPipelineBarrier(slot.commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0,
                       0, nullptr, 0, nullptr, 1, &barrier);
  vkEndCommandBuffer(slot.commands);
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &slot.commands;
  submit.signalSemaphoreCount = 1;
  submit.pSignalSemaphores = &slot.drawn;
  EXPECT_EQ(vkQueueSubmit(client.queue, 1, &submit, slot.done), VK_SUCCESS);
  drawn = slot.drawn;
  return result;
}

VkResult Chain::show(uint32_t seed) {
  uint32_t index = ~0u;
  VkSemaphore drawn = VK_NULL_HANDLE;
  VkResult result = draw(seed, index, drawn);
  if (result < 0 || result == VK_TIMEOUT) return result;
  VkResult presented = present(index, drawn);
  return presented == VK_SUCCESS ? result : presented;
}

VkResult Chain::present(uint32_t index, VkSemaphore drawn) {
  VkPresentInfoKHR present{VK_STRUCTURE_TYPE_PRESENT_INFO_KHR};
  present.waitSemaphoreCount = drawn ? 1 : 0;
  present.pWaitSemaphores = &drawn;
  present.swapchainCount = 1;
  present.pSwapchains = &handle;
  present.pImageIndices = &index;
  return vkQueuePresentKHR(client.queue, &present);
}

}  // namespace pumice::test
