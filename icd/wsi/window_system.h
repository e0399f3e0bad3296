// What a window system has to do for a swapchain: say how large the window is and show rows of pixels.
#pragma once

#include <vulkan/vk_icd.h>

#include <memory>

#include "icd/object.h"

namespace pumice::icd {

struct WindowState {
  bool alive = true;            //!< false: the surface is lost
  VkExtent2D extent{~0u, ~0u};  //!< ~0: the swapchain decides (Wayland, headless)
  bool presentable = true;      //!< false: pixels of a kind that we cannot make (palettes)
  bool translucent = false;     //!< pixels may have an alpha for a compositor
};

//! Rows of B8G8R8A8 (x8 for opaque windows) that the window system can show. `pitch` in bytes.
struct PresentBuffer {
  std::byte* rows = nullptr;
  uint32_t pitch = 0;
};

//! One window's connection, made per swapchain. acquire(), show() and throttle() are the queue thread's.
class Window {
 public:
  virtual ~Window() = default;
  //! What is known by now (any thread; never waits for the window system).
  virtual WindowState state() = 0;
  //! A buffer to fill, waiting while all are still being read by the window system. Null rows: lost.
  virtual PresentBuffer acquire(VkExtent2D extent) = 0;
  //! Shows the buffer last acquired. False when the surface is lost.
  virtual bool show(VkExtent2D extent) = 0;
  //! FIFO: returns when the frame before has been taken, where the window system tells.
  virtual void throttle() {}
};

//! Whether a swapchain made for one present mode may show in another (VK_EXT_swapchain_maintenance1). A Wayland window
//! asks for frame callbacks from its start, or not.
inline bool modesCompatible(const VkIcdSurfaceBase& surface, VkPresentModeKHR a, VkPresentModeKHR b) {
  return a == b || surface.platform != VK_ICD_WSI_PLATFORM_WAYLAND;
}
//! Present state of a surface (any thread, a short round trip).
WindowState queryWindow(const VkIcdSurfaceBase& surface);
//! Null when the window is gone or cannot be reached. Only the present mode and composite alpha are read.
std::unique_ptr<Window> openWindow(const VkIcdSurfaceBase& surface, const VkSwapchainCreateInfoKHR& info);

std::unique_ptr<Window> openXcbWindow(xcb_connection_t* connection, xcb_window_t window,
                                      VkCompositeAlphaFlagBitsKHR alpha);
WindowState queryXcbWindow(xcb_connection_t* connection, xcb_window_t window);
bool xcbVisualPresentable(xcb_connection_t* connection, xcb_visualid_t visual);
WindowState queryWaylandWindow(wl_display* display);
std::unique_ptr<Window> openWaylandWindow(wl_display* display, wl_surface* surface, VkPresentModeKHR mode,
                                          VkCompositeAlphaFlagBitsKHR alpha);

}  // namespace pumice::icd
