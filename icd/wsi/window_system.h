// What a window system has to do for a swapchain: say how large the window is and show rows of pixels.
#pragma once

#include <memory>
#include <vector>

#include "icd/object.h"
#include <vulkan/vk_icd.h>

namespace pumice::icd {

struct WindowState {
  bool alive = true;              //!< false: the surface is lost
  VkExtent2D extent{~0u, ~0u};    //!< ~0: the swapchain decides (Wayland, headless)
};

//! Rows of B8G8R8A8 (x8 for opaque windows) that the window system can show. `pitch` in bytes.
struct PresentBuffer {
  std::byte* rows = nullptr;
  uint32_t pitch = 0;
};

//! One window's connection, made per swapchain. Used by the queue's thread for acquire() and show(), by the
//! application's for state().
class Window {
 public:
  virtual ~Window() = default;
  virtual WindowState state() = 0;
  //! A buffer to fill, waiting while all are still being read by the window system. Null rows: lost.
  virtual PresentBuffer acquire(VkExtent2D extent) = 0;
  //! Shows the buffer last acquired. False when the surface is lost.
  virtual bool show(VkExtent2D extent) = 0;
  //! FIFO: returns when the frame before has been taken, where the window system tells.
  virtual void throttle() {}
};

//! Current extent of a surface (any thread, short round trip).
WindowState queryWindow(const VkIcdSurfaceBase& surface);
//! Null when the window system cannot be reached.
std::unique_ptr<Window> openWindow(const VkIcdSurfaceBase& surface, bool fifo);

std::unique_ptr<Window> openXcbWindow(xcb_connection_t* connection, xcb_window_t window);
WindowState queryXcbWindow(xcb_connection_t* connection, xcb_window_t window);
std::unique_ptr<Window> openWaylandWindow(wl_display* display, wl_surface* surface, bool fifo);

}  // namespace pumice::icd
