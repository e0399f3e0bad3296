// Parts of a swapchain's image that were cleared and not drawn to need not be in memory: whoever looks finds them all the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <vector>

#define VK_USE_PLATFORM_XCB_KHR
#include "tests/wsi/client.h"
#include "tests/wsi/x_server.h"

namespace pumice::test {
namespace {

constexpr uint32_t kWidth = 203, kHeight = 150;   // whole tiles of 64 and parts of such
constexpr VkRect2D kAll{{0, 0}, {kWidth, kHeight}};

struct Colour {
  uint8_t r, g, b;
  VkClearValue value() const {
    VkClearValue v{};
    v.color = {{float(r) / 255, float(g) / 255, float(b) / 255, 1}};
    return v;
  }
};

// A swapchain whose images are changed in many ways; what each of them must hold is known.
class Frames {
 public:
  Frames(Client& c, VkSurfaceKHR surface, VkFormat format) : client(c), chain(c, surface, {.mode = VK_PRESENT_MODE_IMMEDIATE_KHR, .format = format, .extent = kAll.extent}) {
    EXPECT_EQ(chain.created, VK_SUCCESS);
    redFirst_ = format == VK_FORMAT_R8G8B8A8_UNORM;
    expected.assign(chain.images.size(), std::vector<uint32_t>(kWidth * kHeight));
    for (bool load : {false, true})
      EXPECT_EQ(client.colorPass(format, load ? VK_ATTACHMENT_LOAD_OP_LOAD : VK_ATTACHMENT_LOAD_OP_CLEAR, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, &passes_[load]), VK_SUCCESS);
    for (VkImage image : chain.images) {
      VkImageViewCreateInfo viewInfo{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
      viewInfo.image = image;
      viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D;
      viewInfo.format = format;
      viewInfo.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      EXPECT_EQ(vkCreateImageView(client.device, &viewInfo, nullptr, &views_.emplace_back()), VK_SUCCESS);
      VkFramebufferCreateInfo info{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO};
      info.renderPass = passes_[0];
      info.attachmentCount = 1;
      info.pAttachments = &views_.back();
      info.width = kWidth;
      info.height = kHeight;
      info.layers = 1;
      EXPECT_EQ(vkCreateFramebuffer(client.device, &info, nullptr, &framebuffers_.emplace_back()), VK_SUCCESS);
    }
    VkCommandBufferAllocateInfo commandInfo{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    commandInfo.commandPool = client.pool;
    commandInfo.commandBufferCount = 1;
    EXPECT_EQ(vkAllocateCommandBuffers(client.device, &commandInfo, &commands_), VK_SUCCESS);
    VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    bufferInfo.size = kWidth * kHeight * 4;
    bufferInfo.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    vkCreateBuffer(client.device, &bufferInfo, nullptr, &buffer_);
    VkMemoryAllocateInfo memoryInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    memoryInfo.allocationSize = (bufferInfo.size + 63) & ~VkDeviceSize(63);
    vkAllocateMemory(client.device, &memoryInfo, nullptr, &memory_);
    vkBindBufferMemory(client.device, buffer_, memory_, 0);
    vkMapMemory(client.device, memory_, 0, VK_WHOLE_SIZE, 0, reinterpret_cast<void**>(&mapped_));
  }
  ~Frames() {
    vkDeviceWaitIdle(client.device);
    vkDestroyBuffer(client.device, buffer_, nullptr);
    vkFreeMemory(client.device, memory_, nullptr);
    vkFreeCommandBuffers(client.device, client.pool, 1, &commands_);
    for (VkFramebuffer f : framebuffers_) vkDestroyFramebuffer(client.device, f, nullptr);
    for (VkImageView v : views_) vkDestroyImageView(client.device, v, nullptr);
    for (VkRenderPass p : passes_) vkDestroyRenderPass(client.device, p, nullptr);
  }

  //! A pass over `area` that clears it to `ground` (or loads it), and then `painted` to `over`.
  void pass(const Colour* ground, const VkRect2D& area, const VkRect2D* painted = nullptr, Colour over = {}) {
    VkClearValue clear{};
    if (ground) clear = ground->value();
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO};
    begin.renderPass = passes_[!ground];
    begin.framebuffer = framebuffers_[image];
    begin.renderArea = area;
    begin.clearValueCount = 1;
    begin.pClearValues = &clear;
    vkCmdBeginRenderPass(commands_, &begin, VK_SUBPASS_CONTENTS_INLINE);
    if (painted) {
      VkClearAttachment attachment{VK_IMAGE_ASPECT_COLOR_BIT, 0, over.value()};
      VkClearRect rect{*painted, 0, 1};
      vkCmdClearAttachments(commands_, 1, &attachment, 1, &rect);
    }
    vkCmdEndRenderPass(commands_);
    if (ground) expect(area, *ground);
    if (painted) expect(*painted, over);
  }
  void clearImage(Colour c) {
    transition(VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    const VkClearColorValue value = c.value().color;
    vkCmdClearColorImage(commands_, chain.images[image], VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &value, 1, &range);
    transition(VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR);
    expect(kAll, c);
  }
  void upload(const VkRect2D& rect, Colour c) {
    for (uint32_t i = 0; i < rect.extent.width * rect.extent.height; i++) {
      mapped_[4 * i + (redFirst_ ? 0 : 2)] = c.r;
      mapped_[4 * i + 1] = c.g;
      mapped_[4 * i + (redFirst_ ? 2 : 0)] = c.b;
      mapped_[4 * i + 3] = 255;
    }
    transition(VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    const VkBufferImageCopy region = regionOf(rect);
    vkCmdCopyBufferToImage(commands_, buffer_, chain.images[image], VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
    transition(VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR);
    expect(rect, c);
  }
  //! How many pixels of the image in memory are not as expected.
  int wrongInMemory() {
    transition(VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    const VkBufferImageCopy region = regionOf(kAll);
    vkCmdCopyImageToBuffer(commands_, chain.images[image], VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, buffer_, 1, &region);
    transition(VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR);
    run();
    begin();
    std::vector<uint32_t> pixels(kWidth * kHeight);
    for (size_t i = 0; i < pixels.size(); i++)
      pixels[i] = uint32_t(mapped_[4 * i + (redFirst_ ? 0 : 2)]) << 16 | uint32_t(mapped_[4 * i + 1]) << 8 | mapped_[4 * i + (redFirst_ ? 2 : 0)];
    return wrong(pixels);
  }
  int wrong(const std::vector<uint32_t>& pixels) const {
    if (pixels.size() != expected[image].size()) return -1;
    int count = 0;
    for (size_t i = 0; i < pixels.size(); i++) count += (pixels[i] & 0xffffff) != expected[image][i];
    return count;
  }

  void acquire() {
    ASSERT_EQ(chain.acquire(1'000'000'000, image), VK_SUCCESS);
    begin();
  }
  void show() {
    run();
    ASSERT_EQ(chain.present(image), VK_SUCCESS);
    vkDeviceWaitIdle(client.device);
  }

  Client& client;
  Chain chain;
  uint32_t image = 0;
  std::vector<std::vector<uint32_t>> expected;   //!< 0xRRGGBB, by image

 private:
  void begin() {
    VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    vkBeginCommandBuffer(commands_, &info);
  }
  void run() {
    vkEndCommandBuffer(commands_);
    VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands_;
    EXPECT_EQ(vkQueueSubmit(client.queue, 1, &submit, VK_NULL_HANDLE), VK_SUCCESS);
    vkQueueWaitIdle(client.queue);
  }
  void expect(const VkRect2D& rect, Colour c) {
    for (uint32_t y = 0; y < rect.extent.height; y++)
      std::fill_n(&expected[image][(uint32_t(rect.offset.y) + y) * kWidth + uint32_t(rect.offset.x)], rect.extent.width, uint32_t(c.r) << 16 | uint32_t(c.g) << 8 | c.b);
  }
  static VkBufferImageCopy regionOf(const VkRect2D& rect) {
    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageOffset = {rect.offset.x, rect.offset.y, 0};
    region.imageExtent = {rect.extent.width, rect.extent.height, 1};
    return region;
  }
  void transition(VkImageLayout from, VkImageLayout to) {
    VkImageMemoryBarrier barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
    barrier.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
    barrier.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
    barrier.oldLayout = from;
    barrier.newLayout = to;
    barrier.image = chain.images[image];
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdPipelineBarrier(commands_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0, nullptr, 0, nullptr, 1, &barrier);
  }

  bool redFirst_ = false;
  VkRenderPass passes_[2] = {};   // that clears, that loads
  std::vector<VkImageView> views_;
  std::vector<VkFramebuffer> framebuffers_;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  uint8_t* mapped_ = nullptr;
};

class Cleared : public testing::TestWithParam<VkFormat> {};

TEST_P(Cleared, IsWhatEverybodyFindsHoweverTheImageGoesOn) {
  XServer server;
  ASSERT_TRUE(server.running());
  Client client({VK_KHR_XCB_SURFACE_EXTENSION_NAME});
  XObserver observer(server);
  XWindow window(server, XWindow::Library::Xcb, kWidth, kHeight);
  VkXcbSurfaceCreateInfoKHR info{VK_STRUCTURE_TYPE_XCB_SURFACE_CREATE_INFO_KHR};
  info.connection = window.connection;
  info.window = window.window;
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  ASSERT_EQ(client.function<PFN_vkCreateXcbSurfaceKHR>("vkCreateXcbSurfaceKHR")(client.instance, &info, nullptr, &surface), VK_SUCCESS);
  {
    Frames f(client, surface, GetParam());
    const VkRect2D middle{{70, 66}, {30, 20}}, corner{{150, 100}, {53, 50}}, all = kAll;
    const Colour ground{200, 30, 90}, other{1, 128, 254}, third{77, 255, 3};
    const auto frame = [&](const char* what, auto&& draw, bool look = false) {
      SCOPED_TRACE(what);
      ASSERT_NO_FATAL_FAILURE(f.acquire());
      draw();
      if (look) {
        EXPECT_EQ(f.wrongInMemory(), 0);
      }
      ASSERT_NO_FATAL_FAILURE(f.show());
      EXPECT_TRUE(window.noErrors());   // the server has read what it was sent
      EXPECT_EQ(f.wrong(observer.read(window.window, kWidth, kHeight)), 0);
    };
    for (bool look : {false, true}) {
      frame("cleared", [&] { f.pass(&ground, kAll); }, look);
      frame("cleared, something in the middle", [&] { f.pass(&other, kAll, &middle, third); }, look);
      frame("cleared, everything painted over", [&] { f.pass(&ground, kAll, &all, third); }, look);
      frame("cleared, then loaded by a pass of its own", [&] { f.pass(&ground, kAll), f.pass(nullptr, kAll, &corner, other); }, look);
      frame("cleared, then loaded in part", [&] { f.pass(&other, kAll), f.pass(nullptr, corner, &corner, ground); }, look);
      frame("cleared, then a part in another colour", [&] { f.pass(&third, kAll), f.pass(&ground, middle); }, look);
      frame("cleared twice", [&] { f.pass(&ground, kAll, &middle, other), f.pass(&other, kAll, &corner, third); }, look);
      frame("cleared, then uploaded to", [&] { f.pass(&ground, kAll), f.upload(middle, third); }, look);
      frame("cleared, then by a transfer", [&] { f.pass(&ground, kAll), f.clearImage(other); }, look);
      // Frames later the image is still what it was.
      for (size_t i = 0; i <= f.chain.images.size(); i++) frame("cleared", [&] { f.pass(&third, kAll); }, look);
      for (size_t i = 0; i <= f.chain.images.size(); i++) frame("shown again", [] {}, look);
      for (size_t i = 0; i <= f.chain.images.size(); i++) frame("loaded in a later frame", [&] { f.pass(nullptr, kAll, &middle, other); }, look);
    }
  }
  EXPECT_TRUE(window.noErrors());
  vkDestroySurfaceKHR(client.instance, surface, nullptr);
}

INSTANTIATE_TEST_SUITE_P(Formats, Cleared, testing::Values(VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM),
                         [](const auto& param) { return param.param == VK_FORMAT_B8G8R8A8_UNORM ? "Bgra" : "Rgba"; });

}  // namespace
}  // namespace pumice::test
