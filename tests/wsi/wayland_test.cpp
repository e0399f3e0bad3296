// Wayland surfaces against a compositor that sees every buffer.
#include <gtest/gtest.h>
#include <wayland-client.h>

#include <chrono>
#include <cstring>
#include <memory>
#include <thread>

#define VK_USE_PLATFORM_WAYLAND_KHR
#include "tests/wsi/client.h"
#include "tests/wsi/compositor.h"

namespace pumice::test {
namespace {

using Clock = std::chrono::steady_clock;

//! A program's own side: its display, its surface, and Vulkan's surface on it.
struct WaylandProgram {
  explicit WaylandProgram(Compositor& compositor)
      : display(wl_display_connect_to_fd(compositor.clientFile())) {
    registry = wl_display_get_registry(display);
    static const wl_registry_listener kListener = {
        [](void* data, wl_registry* r, uint32_t name, const char* interface, uint32_t) {
          if (!std::strcmp(interface, "wl_compositor"))
            static_cast<WaylandProgram*>(data)->compositor =
                static_cast<wl_compositor*>(wl_registry_bind(r, name, &wl_compositor_interface, 4));
        },
        [](void*, wl_registry*, uint32_t) {}};
    wl_registry_add_listener(registry, &kListener, this);
    wl_display_roundtrip(display);
    surface = wl_compositor_create_surface(this->compositor);
    VkWaylandSurfaceCreateInfoKHR info{VK_STRUCTURE_TYPE_WAYLAND_SURFACE_CREATE_INFO_KHR};
    info.display = display;
    info.surface = surface;
    EXPECT_EQ(client.function<PFN_vkCreateWaylandSurfaceKHR>("vkCreateWaylandSurfaceKHR")(
                  client.instance, &info, nullptr, &vulkan),
              VK_SUCCESS);
  }
  ~WaylandProgram() {
    vkDestroySurfaceKHR(client.instance, vulkan, nullptr);
    wl_surface_destroy(surface);
    wl_compositor_destroy(compositor);
    wl_registry_destroy(registry);
    wl_display_disconnect(display);
  }
  Client client{{VK_KHR_WAYLAND_SURFACE_EXTENSION_NAME}};
  wl_display* display;
  wl_registry* registry = nullptr;
  wl_compositor* compositor = nullptr;
  wl_surface* surface = nullptr;
  VkSurfaceKHR vulkan = VK_NULL_HANDLE;
};

int wrongPixels(const Commit& commit, VkExtent2D extent, uint32_t seed) {
  if (commit.width != extent.width || commit.height != extent.height) return -1;
  int wrong = 0;
  for (uint32_t y = 0; y < extent.height; y++)
    for (uint32_t x = 0; x < extent.width; x++)
      wrong += (commit.pixels[size_t(y) * extent.width + x] & 0xffffff) != patternColor(x, y, seed);
  return wrong;
}

TEST(WaylandSurface, CompositorGetsExactlyWhatWasPresented) {
  Compositor compositor({});
  WaylandProgram program(compositor);
  EXPECT_EQ(program.client.capabilities(program.vulkan).currentExtent.width, ~0u);
  size_t commits = 0;
  uint32_t seed = 0;
  std::unique_ptr<Chain> chain;
  for (VkFormat format : {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_SRGB})
    for (VkPresentModeKHR mode :
         {VK_PRESENT_MODE_FIFO_KHR, VK_PRESENT_MODE_MAILBOX_KHR, VK_PRESENT_MODE_IMMEDIATE_KHR})
      for (VkExtent2D extent : {VkExtent2D{1, 1}, {123, 77}, {300, 200}}) {
        SCOPED_TRACE(testing::Message() << "format " << format << " mode " << mode << " " << extent.width
                                        << "x" << extent.height);
        ChainOptions options;
        options.format = format;
        options.mode = mode;
        options.extent = extent;
        // Sizes change by a new swapchain for the old one.
        chain = std::make_unique<Chain>(program.client, program.vulkan, options,
                                        chain ? chain->handle : VK_NULL_HANDLE);
        ASSERT_EQ(chain->created, VK_SUCCESS);
        for (int frame = 0; frame < 6; frame++) {
          ASSERT_EQ(chain->show(++seed), VK_SUCCESS);
          EXPECT_EQ(wrongPixels(compositor.waitFor(++commits), extent, seed), 0);
        }
      }
}

TEST(WaylandSurface, AlphaIsShownOnlyIfAskedFor) {
  Compositor compositor({});
  WaylandProgram program(compositor);
  EXPECT_TRUE(program.client.capabilities(program.vulkan).supportedCompositeAlpha &
              VK_COMPOSITE_ALPHA_PRE_MULTIPLIED_BIT_KHR);
  ChainOptions options;
  options.alphaByte = 0x40;
  {
    Chain chain(program.client, program.vulkan, options);
    ASSERT_EQ(chain.show(1), VK_SUCCESS);
    EXPECT_EQ(compositor.waitFor(1).format, uint32_t(WL_SHM_FORMAT_XRGB8888));
  }
  options.alpha = VK_COMPOSITE_ALPHA_PRE_MULTIPLIED_BIT_KHR;
  Chain chain(program.client, program.vulkan, options);
  ASSERT_EQ(chain.show(2), VK_SUCCESS);
  Commit commit = compositor.waitFor(2);
  EXPECT_EQ(commit.format, uint32_t(WL_SHM_FORMAT_ARGB8888));
  ASSERT_FALSE(commit.pixels.empty());
  for (uint32_t pixel : commit.pixels) ASSERT_EQ(pixel >> 24, 0x40u);
}

TEST(WaylandSurface, FifoKeepsTheCompositorsPace) {
  Compositor compositor({.answerFrames = false});
  WaylandProgram program(compositor);
  ChainOptions options;
  options.images = 4;
  Chain chain(program.client, program.vulkan, options);
  ASSERT_EQ(chain.show(0), VK_SUCCESS);
  compositor.waitFor(1);
  for (uint32_t frame = 1; frame < 6; frame++) {
    auto begin = Clock::now();
    ASSERT_EQ(chain.show(frame), VK_SUCCESS);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    size_t commits = compositor.commits();
    // A quarter of a second without an answer counts as hidden: on a machine that stalls so long nothing is
    // proved.
    if (Clock::now() - begin < std::chrono::milliseconds(200)) {
      EXPECT_EQ(commits, frame) << "a frame came that was not asked for";
    }
    compositor.answerFrame();
    EXPECT_EQ(wrongPixels(compositor.waitFor(frame + 1), {64, 48}, frame), 0);
  }
}

TEST(WaylandSurface, HiddenWindowDoesNotStopTheQueue) {
  Compositor compositor({.answerFrames = false});
  WaylandProgram program(compositor);
  auto begin = Clock::now();
  {
    Chain chain(program.client, program.vulkan, {});
    for (uint32_t frame = 0; frame < 5; frame++) ASSERT_EQ(chain.show(frame), VK_SUCCESS);
    vkDeviceWaitIdle(program.client.device);
  }
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(10));
  compositor.waitFor(5);
  EXPECT_EQ(compositor.commits(), 5u);
}

TEST(WaylandSurface, BuffersAreLeftAloneUntilTheyAreReleased) {
  Compositor compositor({.releaseBuffers = false});
  WaylandProgram program(compositor);
  ChainOptions options;
  options.mode = VK_PRESENT_MODE_MAILBOX_KHR;
  Chain chain(program.client, program.vulkan, options);
  for (uint32_t frame = 0; frame < 40; frame++) ASSERT_EQ(chain.show(frame), VK_SUCCESS);
  EXPECT_EQ(wrongPixels(compositor.waitFor(40), {64, 48}, 39), 0);
  EXPECT_FALSE(compositor.torn());
}

TEST(WaylandSurface, DeadCompositorIsALostSurface) {
  Compositor compositor({});
  WaylandProgram program(compositor);
  Chain chain(program.client, program.vulkan, {});
  for (uint32_t frame = 0; frame < 3; frame++) ASSERT_EQ(chain.show(frame), VK_SUCCESS);
  compositor.stop();
  VkResult result = VK_SUCCESS;
  int frames = 0;
  for (; frames < 10 && result == VK_SUCCESS; frames++) {
    result = chain.show(9);
    vkDeviceWaitIdle(program.client.device);
  }
  EXPECT_EQ(result, VK_ERROR_SURFACE_LOST_KHR);
  EXPECT_LE(frames, 4);
  EXPECT_EQ(Chain(program.client, program.vulkan, {}).created, VK_ERROR_SURFACE_LOST_KHR);
}

}  // namespace
}  // namespace pumice::test
