// X11 windows: what the server shows is exactly what was presented, and whatever happens to a window, the
// program that owns the connection is not harmed.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#define VK_USE_PLATFORM_XCB_KHR
#define VK_USE_PLATFORM_XLIB_KHR
#include "tests/wsi/client.h"
#include "tests/wsi/x_server.h"

namespace pumice::test {
namespace {

using Library = XWindow::Library;
using Clock = std::chrono::steady_clock;

constexpr VkPresentModeKHR kModes[] = {VK_PRESENT_MODE_FIFO_KHR, VK_PRESENT_MODE_MAILBOX_KHR,
                                       VK_PRESENT_MODE_IMMEDIATE_KHR};

std::vector<const char*> xExtensions() {
  return {VK_KHR_XCB_SURFACE_EXTENSION_NAME, VK_KHR_XLIB_SURFACE_EXTENSION_NAME};
}

struct XSurface {
  XSurface(Client& c, const XWindow& window) : client(c) {
    if (window.xlib) {
      VkXlibSurfaceCreateInfoKHR info{VK_STRUCTURE_TYPE_XLIB_SURFACE_CREATE_INFO_KHR};
      info.dpy = window.xlib;
      info.window = window.window;
      EXPECT_EQ(c.function<PFN_vkCreateXlibSurfaceKHR>("vkCreateXlibSurfaceKHR")(c.instance, &info, nullptr,
                                                                                 &handle),
                VK_SUCCESS);
    } else {
      VkXcbSurfaceCreateInfoKHR info{VK_STRUCTURE_TYPE_XCB_SURFACE_CREATE_INFO_KHR};
      info.connection = window.connection;
      info.window = window.window;
      EXPECT_EQ(
          c.function<PFN_vkCreateXcbSurfaceKHR>("vkCreateXcbSurfaceKHR")(c.instance, &info, nullptr, &handle),
          VK_SUCCESS);
    }
  }
  ~XSurface() { vkDestroySurfaceKHR(client.instance, handle, nullptr); }
  VkBool32 supported() const {
    VkBool32 yes = VK_FALSE;
    EXPECT_EQ(vkGetPhysicalDeviceSurfaceSupportKHR(client.physical, 0, handle, &yes), VK_SUCCESS);
    return yes;
  }
  Client& client;
  VkSurfaceKHR handle = VK_NULL_HANDLE;
};

//! How many pixels of the window are not picture number `seed`.
int wrongPixels(const std::vector<uint32_t>& pixels, uint32_t width, uint32_t height, uint32_t seed) {
  if (pixels.size() != size_t(width) * height) return -1;
  int wrong = 0;
  for (uint32_t y = 0; y < height; y++)
    for (uint32_t x = 0; x < width; x++)
      wrong += (pixels[size_t(y) * width + x] & 0xffffff) != patternColor(x, y, seed);
  return wrong;
}

//! Presents picture `seed` and waits until the server has it.
VkResult showNow(Chain& chain, XWindow& window, uint32_t seed) {
  VkResult result = chain.show(seed);
  vkDeviceWaitIdle(chain.client.device);
  EXPECT_TRUE(window.noErrors());
  return result;
}

struct Way {
  Library library;
  bool sharedMemory;
};

class X11 : public testing::TestWithParam<Way> {
 protected:
  void SetUp() override {
    if (!GetParam().sharedMemory) arguments_ = {"-extension", "MIT-SHM"};
    server_ = std::make_unique<XServer>("24", arguments_);
    ASSERT_TRUE(server_->running()) << "Xvfb cannot be started (Debian package xvfb)";
  }
  Library library() const { return GetParam().library; }
  std::vector<std::string> arguments_;
  std::unique_ptr<XServer> server_;
};

TEST_P(X11, WindowShowsExactlyWhatWasPresented) {
  Client client(xExtensions());
  XObserver observer(*server_);
  uint32_t seed = 0;
  for (VkFormat format :
       {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_B8G8R8A8_SRGB, VK_FORMAT_R8G8B8A8_SRGB})
    for (VkPresentModeKHR mode : kModes)
      for (VkExtent2D extent : {VkExtent2D{1, 1}, {123, 77}, {256, 300}}) {
        SCOPED_TRACE(testing::Message() << "format " << format << " mode " << mode << " " << extent.width
                                        << "x" << extent.height);
        XWindow window(*server_, library(), extent.width, extent.height);
        XSurface surface(client, window);
        EXPECT_TRUE(surface.supported());
        VkSurfaceCapabilitiesKHR c = client.capabilities(surface.handle);
        EXPECT_EQ(c.currentExtent.width, extent.width);
        EXPECT_EQ(c.currentExtent.height, extent.height);
        Chain chain(client, surface.handle, {.mode = mode, .format = format, .extent = extent});
        ASSERT_EQ(chain.created, VK_SUCCESS);
        EXPECT_GE(chain.images.size(), mode == VK_PRESENT_MODE_MAILBOX_KHR ? 3u : 2u);
        for (int frame = 0; frame < 3; frame++) {
          ASSERT_EQ(showNow(chain, window, ++seed), VK_SUCCESS);
          EXPECT_EQ(wrongPixels(observer.read(window.window, extent.width, extent.height), extent.width,
                                extent.height, seed),
                    0);
        }
      }
}

TEST_P(X11, MemoryIsSharedWithTheServerWhereItCanBe) {
  Client client(xExtensions());
  XWindow window(*server_, library(), 64, 48);
  XSurface surface(client, window);
  auto frames = [](const std::string& process) {
    std::ifstream maps("/proc/" + process + "/maps");
    int count = 0;
    for (std::string line; std::getline(maps, line);)
      count += line.find("memfd:pumice-frame") != std::string::npos;
    return count;
  };
  const std::string server = std::to_string(server_->process());
  {
    Chain chain(client, surface.handle, {});
    for (uint32_t seed = 0; seed < 4; seed++) ASSERT_EQ(showNow(chain, window, seed), VK_SUCCESS);
    EXPECT_EQ(frames("self"), GetParam().sharedMemory ? 2 : 0);
    EXPECT_EQ(frames(server), GetParam().sharedMemory ? 2 : 0);
  }
  EXPECT_TRUE(window.noErrors());
  EXPECT_EQ(frames("self"), 0);
  EXPECT_EQ(frames(server), 0);
}

TEST_P(X11, PicturesLargerThanARequestArriveWhole) {
  // 1600x1200 is 7.7 MB; a request without shared memory holds 4 MB here at most.
  Client client(xExtensions());
  XServer large("24", [&] {
    auto a = arguments_;
    a.insert(a.end(), {"-screen", "0", "1600x1200x24", "-maxbigreqsize", "4"});
    return a;
  }());
  ASSERT_TRUE(large.running());
  XObserver observer(large);
  XWindow window(large, library(), 1600, 1200);
  XSurface surface(client, window);
  Chain chain(client, surface.handle, {.extent = {1600, 1200}});
  for (uint32_t seed = 1; seed < 4; seed++) {
    ASSERT_EQ(showNow(chain, window, seed), VK_SUCCESS);
    EXPECT_EQ(wrongPixels(observer.read(window.window, 1600, 1200), 1600, 1200, seed), 0);
  }
}

TEST_P(X11, ResizedWindowIsSuboptimalUntilTheSwapchainIsMadeAnew) {
  Client client(xExtensions());
  XObserver observer(*server_);
  XWindow window(*server_, library(), 100, 80);
  XSurface surface(client, window);
  ChainOptions options;
  options.extent = {100, 80};
  auto chain = std::make_unique<Chain>(client, surface.handle, options);
  ASSERT_EQ(showNow(*chain, window, 1), VK_SUCCESS);
  ASSERT_EQ(showNow(*chain, window, 2), VK_SUCCESS);
  uint32_t seed = 2;
  for (VkExtent2D extent : {VkExtent2D{150, 120}, {60, 50}, {61, 50}}) {
    observer.resize(window.window, extent.width, extent.height);
    // Whoever has been told of the new size, and draws once only, must learn that the picture does not fit.
    EXPECT_TRUE(window.noErrors());
    EXPECT_EQ(showNow(*chain, window, ++seed), VK_SUBOPTIMAL_KHR);
    // Still shown, as far as it goes.
    VkExtent2D both = {std::min(extent.width, options.extent.width),
                       std::min(extent.height, options.extent.height)};
    EXPECT_EQ(
        wrongPixels(observer.read(window.window, both.width, both.height), both.width, both.height, seed), 0);
    EXPECT_EQ(client.capabilities(surface.handle).currentExtent.width, extent.width);
    options.extent = extent;
    auto next = std::make_unique<Chain>(client, surface.handle, options, chain->handle);
    ASSERT_EQ(next->created, VK_SUCCESS);
    uint32_t index;
    EXPECT_EQ(chain->acquire(0, index), VK_ERROR_OUT_OF_DATE_KHR);  // retired
    chain = std::move(next);
    for (int frame = 0; frame < 3; frame++) {
      EXPECT_EQ(showNow(*chain, window, ++seed), VK_SUCCESS);
      EXPECT_EQ(wrongPixels(observer.read(window.window, extent.width, extent.height), extent.width,
                            extent.height, seed),
                0);
    }
  }
}

TEST_P(X11, ResizeIsNoticedByAProgramThatReadsNoEvents) {
  Client client(xExtensions());
  XObserver observer(*server_);
  XWindow window(*server_, library(), 100, 80);
  XSurface surface(client, window);
  Chain chain(client, surface.handle, {.extent = {100, 80}});
  ASSERT_EQ(chain.show(1), VK_SUCCESS);
  observer.resize(window.window, 90, 80);
  VkResult result = VK_SUCCESS;
  int frames = 0;
  for (; frames < 10 && result == VK_SUCCESS; frames++) result = chain.show(2);
  EXPECT_EQ(result, VK_SUBOPTIMAL_KHR);
  EXPECT_LE(frames, 4);
}

TEST_P(X11, DestroyedWindowIsALostSurfaceAndNothingWorse) {
  Client client(xExtensions());
  XObserver observer(*server_);
  XWindow window(*server_, library(), 100, 80);
  {
    XSurface surface(client, window);
    ChainOptions options;
    options.extent = {100, 80};
    Chain chain(client, surface.handle, options);
    for (uint32_t seed = 0; seed < 3; seed++) ASSERT_EQ(chain.show(seed), VK_SUCCESS);
    observer.destroy(window.window);
    VkResult result = VK_SUCCESS;
    int frames = 0;
    for (; frames < 10 && result == VK_SUCCESS; frames++) result = chain.show(7);
    EXPECT_EQ(result, VK_ERROR_SURFACE_LOST_KHR);
    // The answer to the first frame is read with the third, and the application is ahead of what is shown by
    // as many frames as there are images.
    EXPECT_LE(frames, 3 + int(chain.images.size()));
    uint32_t index;
    EXPECT_EQ(chain.acquire(0, index), VK_ERROR_SURFACE_LOST_KHR);
    VkSurfaceCapabilitiesKHR c;
    EXPECT_EQ(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(client.physical, surface.handle, &c),
              VK_ERROR_SURFACE_LOST_KHR);
    EXPECT_EQ(Chain(client, surface.handle, options).created, VK_ERROR_SURFACE_LOST_KHR);
    EXPECT_TRUE(window.noErrors());
  }
  EXPECT_TRUE(window.noErrors());
  // The connection is as good as before.
  XWindow other(*server_, library(), 20, 20);
  XSurface surface(client, other);
  Chain chain(client, surface.handle, {.extent = {20, 20}});
  EXPECT_EQ(showNow(chain, other, 9), VK_SUCCESS);
  EXPECT_EQ(wrongPixels(observer.read(other.window, 20, 20), 20, 20, 9), 0);
}

TEST_P(X11, FifoWithoutAVerticalBlankIsNotHeldBack) {
  Client client(xExtensions());
  XWindow window(*server_, library(), 64, 48);
  XSurface surface(client, window);
  for (VkPresentModeKHR mode : kModes) {
    Chain chain(client, surface.handle, {.mode = mode});
    auto begin = Clock::now();
    for (uint32_t seed = 0; seed < 300; seed++) ASSERT_EQ(chain.show(seed), VK_SUCCESS);
    vkDeviceWaitIdle(client.device);
    // At 60 Hz it would be 5 s.
    EXPECT_LT(Clock::now() - begin, std::chrono::milliseconds(3500)) << "mode " << mode;
  }
}

TEST_P(X11, SwapchainsComeAndGoWithoutLeavingAnything) {
  Client client(xExtensions());
  XWindow window(*server_, library(), 64, 48);
  XSurface surface(client, window);
  auto files = [] { return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}); };
  auto cycle = [&] {
    Chain chain(client, surface.handle, ChainOptions{});
    uint32_t index;
    for (uint32_t seed = 0; seed < 3; seed++) EXPECT_EQ(chain.show(seed), VK_SUCCESS);
    EXPECT_EQ(chain.acquire(1'000'000'000, index), VK_SUCCESS);  // never presented
  };
  cycle();
  auto before = files();
  for (int i = 0; i < 50; i++) cycle();
  EXPECT_EQ(files(), before);
  EXPECT_TRUE(window.noErrors());
}

INSTANTIATE_TEST_SUITE_P(Ways, X11,
                         testing::Values(Way{Library::Xcb, true}, Way{Library::Xcb, false},
                                         Way{Library::Xlib, true}, Way{Library::Xlib, false}),
                         [](const auto& info) {
                           return std::string(info.param.library == Library::Xcb ? "Xcb" : "Xlib") +
                                  (info.param.sharedMemory ? "Shm" : "Put");
                         });

TEST(X11Swapchain, AcquiringBeyondWhatIsFreeWaitsAsLongAsAsked) {
  XServer server;
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XWindow window(server, Library::Xcb, 64, 48);
  XSurface surface(client, window);
  Chain chain(client, surface.handle, {.images = 4});
  ASSERT_GE(chain.images.size(), 4u);
  std::vector<bool> seen(chain.images.size());
  for (size_t i = 0; i < chain.images.size(); i++) {
    uint32_t index = ~0u;
    ASSERT_EQ(chain.acquire(0, index), VK_SUCCESS);
    EXPECT_FALSE(seen.at(index));
    seen.at(index) = true;
  }
  uint32_t index;
  EXPECT_EQ(chain.acquire(0, index), VK_NOT_READY);
  auto begin = Clock::now();
  EXPECT_EQ(chain.acquire(50'000'000, index), VK_TIMEOUT);
  EXPECT_GE(Clock::now() - begin, std::chrono::milliseconds(49));
}

TEST(X11Swapchain, OnePresentShowsSeveralWindowsAndSaysHowEachFared) {
  XServer server;
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XObserver observer(server);
  XWindow a(server, Library::Xcb, 64, 48), b(server, Library::Xlib, 40, 30, 0, 100);
  XSurface surfaceA(client, a), surfaceB(client, b);
  ChainOptions optionsB;
  optionsB.extent = {40, 30};
  Chain chainA(client, surfaceA.handle, {}), chainB(client, surfaceB.handle, optionsB);
  auto present = [&](uint32_t seed, VkResult results[2]) {
    uint32_t indices[2];
    VkSemaphore drawn[2];
    for (int i = 0; i < 2; i++) {
      VkResult r = (i ? chainB : chainA).draw(seed + i, indices[i], drawn[i]);
      if (r < 0) return r;
    }
    VkSwapchainKHR chains[2] = {chainA.handle, chainB.handle};
    VkPresentInfoKHR info{VK_STRUCTURE_TYPE_PRESENT_INFO_KHR};
    info.waitSemaphoreCount = 2;
    info.pWaitSemaphores = drawn;
    info.swapchainCount = 2;
    info.pSwapchains = chains;
    info.pImageIndices = indices;
    info.pResults = results;
    VkResult r = vkQueuePresentKHR(client.queue, &info);
    vkDeviceWaitIdle(client.device);
    a.noErrors();
    b.noErrors();
    return r;
  };
  VkResult results[2];
  ASSERT_EQ(present(5, results), VK_SUCCESS);
  EXPECT_EQ(results[0], VK_SUCCESS);
  EXPECT_EQ(results[1], VK_SUCCESS);
  EXPECT_EQ(wrongPixels(observer.read(a.window, 64, 48), 64, 48, 5), 0);
  EXPECT_EQ(wrongPixels(observer.read(b.window, 40, 30), 40, 30, 6), 0);
  observer.resize(a.window, 65, 48);
  a.noErrors();
  ASSERT_EQ(present(8, results), VK_SUBOPTIMAL_KHR);
  EXPECT_EQ(results[0], VK_SUBOPTIMAL_KHR);
  EXPECT_EQ(results[1], VK_SUCCESS);
}

TEST(X11Visual, SixteenBitsPerPixelAreConverted) {
  XServer server("16");
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XObserver observer(server);
  XWindow window(server, Library::Xcb, 63, 48);  // rows are padded
  XSurface surface(client, window);
  EXPECT_TRUE(surface.supported());
  Chain chain(client, surface.handle, {.extent = {63, 48}});
  ASSERT_EQ(showNow(chain, window, 3), VK_SUCCESS);
  auto pixels = observer.read(window.window, 63, 48);
  ASSERT_EQ(pixels.size(), 63u * 48);
  auto nearest = [](uint32_t c, uint32_t largest) { return uint32_t(c * largest / 255.0 + 0.5); };
  for (uint32_t y = 0; y < 48; y++)
    for (uint32_t x = 0; x < 63; x++) {
      uint32_t c = patternColor(x, y, 3);
      ASSERT_EQ(pixels[y * 63 + x],
                nearest(c >> 16, 31) << 11 | nearest(c >> 8 & 255, 63) << 5 | nearest(c & 255, 31))
          << x << " " << y;
    }
}

TEST(X11Visual, ThirtyBitsPerPixelAreConverted) {
  XServer server("30");
  if (!server.running()) GTEST_SKIP() << "this Xvfb has no screens of depth 30";
  Client client(xExtensions());
  XObserver observer(server);
  XWindow window(server, Library::Xlib, 63, 48);
  XSurface surface(client, window);
  EXPECT_TRUE(surface.supported());
  Chain chain(client, surface.handle, {.extent = {63, 48}});
  ASSERT_EQ(showNow(chain, window, 3), VK_SUCCESS);
  auto pixels = observer.read(window.window, 63, 48);
  ASSERT_EQ(pixels.size(), 63u * 48);
  // Either order of red and blue: the visual says which.
  xcb_visualtype_t visual{};
  xcb_screen_t* screen = xcb_setup_roots_iterator(xcb_get_setup(window.connection)).data;
  for (auto d = xcb_screen_allowed_depths_iterator(screen); d.rem; xcb_depth_next(&d))
    for (int i = 0; i < xcb_depth_visuals_length(d.data); i++)
      if (xcb_depth_visuals(d.data)[i].visual_id == window.visual) visual = xcb_depth_visuals(d.data)[i];
  const bool redHigh = visual.red_mask > visual.blue_mask;
  auto ten = [](uint32_t c) { return uint32_t((c & 255) * 1023 / 255.0 + 0.5); };
  for (uint32_t y = 0; y < 48; y++)
    for (uint32_t x = 0; x < 63; x++) {
      uint32_t c = patternColor(x, y, 3), high = redHigh ? c >> 16 : c, low = redHigh ? c : c >> 16;
      ASSERT_EQ(pixels[y * 63 + x] & 0x3fffffff, ten(high) << 20 | ten(c >> 8) << 10 | ten(low))
          << x << " " << y;
    }
}

TEST(X11Visual, PalettesAreNotSupportedAndSaidSo) {
  XServer server("8");
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XWindow window(server, Library::Xcb, 64, 48);
  auto supports = client.function<PFN_vkGetPhysicalDeviceXcbPresentationSupportKHR>(
      "vkGetPhysicalDeviceXcbPresentationSupportKHR");
  EXPECT_FALSE(supports(client.physical, 0, window.connection, window.visual));
  XSurface surface(client, window);
  EXPECT_FALSE(surface.supported());
}

TEST(X11Visual, AlphaOfATranslucentWindowIsKeptOnlyIfAskedFor) {
  XServer server;
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XObserver observer(server);
  XWindow window(server, Library::Xcb, 64, 48, 32);
  ASSERT_TRUE(window.window) << "no visual of depth 32";
  XSurface surface(client, window);
  EXPECT_TRUE(client.capabilities(surface.handle).supportedCompositeAlpha &
              VK_COMPOSITE_ALPHA_PRE_MULTIPLIED_BIT_KHR);
  for (auto alpha : {VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR, VK_COMPOSITE_ALPHA_PRE_MULTIPLIED_BIT_KHR}) {
    Chain chain(client, surface.handle, {.alpha = alpha, .alphaByte = 0x40});
    ASSERT_EQ(showNow(chain, window, 3), VK_SUCCESS);
    auto pixels = observer.read(window.window, 64, 48);
    EXPECT_EQ(wrongPixels(pixels, 64, 48, 3), 0);
    for (uint32_t pixel : pixels)
      ASSERT_EQ(pixel >> 24, alpha == VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR ? 0xffu : 0x40u);
  }
}

TEST(X11Swapchain, ImagesMayBeDrawnThroughViewsOfAnotherFormat) {
  XServer server;
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XObserver observer(server);
  XWindow window(server, Library::Xcb, 64, 48);
  XSurface surface(client, window);
  ChainOptions options;
  options.viewFormat = VK_FORMAT_B8G8R8A8_SRGB;
  Chain chain(client, surface.handle, options);
  ASSERT_EQ(chain.created, VK_SUCCESS);
  uint32_t index;
  ASSERT_EQ(chain.acquire(1'000'000'000, index), VK_SUCCESS);

  VkImageViewCreateInfo viewInfo{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
  viewInfo.image = chain.images[index];
  viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D;
  viewInfo.format = options.viewFormat;
  viewInfo.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  VkImageView view;
  ASSERT_EQ(vkCreateImageView(client.device, &viewInfo, nullptr, &view), VK_SUCCESS);
  VkRenderPass pass;
  ASSERT_EQ(client.colorPass(options.viewFormat, VK_ATTACHMENT_LOAD_OP_CLEAR, VK_IMAGE_LAYOUT_UNDEFINED, &pass), VK_SUCCESS);
  VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO};
  framebufferInfo.renderPass = pass;
  framebufferInfo.attachmentCount = 1;
  framebufferInfo.pAttachments = &view;
  framebufferInfo.width = options.extent.width;
  framebufferInfo.height = options.extent.height;
  framebufferInfo.layers = 1;
  VkFramebuffer framebuffer;
  ASSERT_EQ(vkCreateFramebuffer(client.device, &framebufferInfo, nullptr, &framebuffer), VK_SUCCESS);
  VkCommandBufferAllocateInfo commandInfo{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  commandInfo.commandPool = client.pool;
  commandInfo.commandBufferCount = 1;
  VkCommandBuffer commands;
  ASSERT_EQ(vkAllocateCommandBuffers(client.device, &commandInfo, &commands), VK_SUCCESS);
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  vkBeginCommandBuffer(commands, &begin);
  VkClearValue clear{};
  clear.color = {{0.5f, 0.0f, 1.0f, 1.0f}};
  VkRenderPassBeginInfo passBegin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO};
  passBegin.renderPass = pass;
  passBegin.framebuffer = framebuffer;
  passBegin.renderArea.extent = options.extent;
  passBegin.clearValueCount = 1;
  passBegin.pClearValues = &clear;
  vkCmdBeginRenderPass(commands, &passBegin, VK_SUBPASS_CONTENTS_INLINE);
  vkCmdEndRenderPass(commands);
  vkEndCommandBuffer(commands);
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands;
  ASSERT_EQ(vkQueueSubmit(client.queue, 1, &submit, VK_NULL_HANDLE), VK_SUCCESS);
  ASSERT_EQ(chain.present(index), VK_SUCCESS);
  vkDeviceWaitIdle(client.device);
  EXPECT_TRUE(window.noErrors());
  auto pixels = observer.read(window.window, 64, 48);
  ASSERT_EQ(pixels.size(), 64u * 48);
  for (uint32_t pixel : pixels) ASSERT_EQ(pixel & 0xffffff, 0xbc00ffu);  // a half in sRGB is 188
  vkDestroyFramebuffer(client.device, framebuffer, nullptr);
  vkDestroyRenderPass(client.device, pass, nullptr);
  vkDestroyImageView(client.device, view, nullptr);
}

TEST(X11Swapchain, PresentsWhileTheProgramTalksToTheServer) {
  XServer server;
  ASSERT_TRUE(server.running());
  for (Library library : {Library::Xcb, Library::Xlib}) {
    Client client(xExtensions());
    XObserver observer(server);
    XWindow window(server, library, 64, 48);
    XSurface surface(client, window);
    Chain chain(client, surface.handle, {});
    std::atomic<bool> stop = false;
    bool good = true;
    std::thread talker([&] {
      while (!stop) good &= window.noErrors();
    });
    for (uint32_t seed = 0; seed < 300; seed++) EXPECT_EQ(chain.show(seed), VK_SUCCESS);
    vkDeviceWaitIdle(client.device);
    stop = true;
    talker.join();
    EXPECT_TRUE(good && window.noErrors());
    EXPECT_EQ(wrongPixels(observer.read(window.window, 64, 48), 64, 48, 299), 0);
  }
}

TEST(X11Swapchain, SurvivesAForkOfTheProgram) {
  XServer server;
  ASSERT_TRUE(server.running());
  Client client(xExtensions());
  XObserver observer(server);
  XWindow window(server, Library::Xcb, 64, 48);
  XSurface surface(client, window);
  Chain chain(client, surface.handle, {});
  ASSERT_EQ(showNow(chain, window, 1), VK_SUCCESS);
  pid_t child = fork();
  if (child == 0) _exit(0);
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  for (uint32_t seed = 2; seed < 6; seed++) {
    ASSERT_EQ(showNow(chain, window, seed), VK_SUCCESS);
    EXPECT_EQ(wrongPixels(observer.read(window.window, 64, 48), 64, 48, seed), 0);
  }
}

}  // namespace
}  // namespace pumice::test
