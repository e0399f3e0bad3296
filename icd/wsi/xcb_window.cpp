// X11 windows through libxcb: memory shared with the server (MIT-SHM 1.2) where it is on this machine,
// PutImage elsewhere.
//
// The connection may be Xlib's, and Xlib's default handler ends the process at an error that nobody asked
// for. So every request here has a reply or is `_checked`, and what comes back is looked at or discarded.
#include <sys/mman.h>
#include <unistd.h>
#include <xcb/present.h>
#include <xcb/shm.h>
#include <xcb/xcb.h>
#include <xcb/xcbext.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>

#include "base/log.h"
#include "icd/vulkan.h"
#include "icd/wsi/window_system.h"
#include "icd/wsi/x11_pixels.h"

namespace pumice::icd {
namespace {

template <typename T>
struct Freed {
  explicit Freed(T* p) : pointer(p) {}
  ~Freed() { std::free(pointer); }
  Freed(const Freed&) = delete;
  T* operator->() const { return pointer; }
  explicit operator bool() const { return pointer; }
  T* pointer;
};

//! A request to an extension that the server does not have closes the connection: ask first.
bool hasExtension(xcb_connection_t* connection, xcb_extension_t* extension) {
  const auto* data = xcb_get_extension_data(connection, extension);
  return data && data->present;
}

struct Description {
  WindowState state;
  std::optional<X11Visual> visual;
};

Description describe(xcb_connection_t* connection, xcb_window_t window) {
  auto attributesCookie = xcb_get_window_attributes(connection, window);
  auto geometryCookie = xcb_get_geometry(connection, window);
  Freed attributes(xcb_get_window_attributes_reply(connection, attributesCookie, nullptr));
  Freed geometry(xcb_get_geometry_reply(connection, geometryCookie, nullptr));
  Description d;
  d.state.alive = attributes && geometry;
  if (!d.state.alive) return d;
  d.state.extent = {geometry->width, geometry->height};
  if (attributes->_class == XCB_WINDOW_CLASS_INPUT_OUTPUT)
    d.visual = x11Visual(xcb_get_setup(connection), attributes->visual);
  d.state.presentable = d.visual.has_value();
  d.state.translucent = d.visual && d.visual->isBgra() && d.visual->depth == 32;
  return d;
}

class XcbWindow final : public Window {
 public:
  XcbWindow(xcb_connection_t* connection, xcb_window_t window, const Description& d, bool opaque)
      : connection_(connection),
        window_(window),
        visual_(*d.visual),
        packer_(visual_),
        fillAlpha_(opaque && visual_.depth == 32),
        extent_(pack(d.state.extent)) {
    gc_ = xcb_generate_id(connection_);
    const uint32_t noExposures = 0;
    discard(xcb_create_gc_checked(connection_, gc_, window_, XCB_GC_GRAPHICS_EXPOSURES, &noExposures));
    if (hasExtension(connection_, &xcb_shm_id)) {
      Freed shm(xcb_shm_query_version_reply(connection_, xcb_shm_query_version(connection_), nullptr));
      shared_ = shm && (shm->major_version > 1 || shm->minor_version >= 2);
    }
    // The server tells of a new size as it happens, on a queue beside the application's: no round trip per
    // frame.
    if (hasExtension(connection_, &xcb_present_id)) {
      Freed version(xcb_present_query_version_reply(connection_, xcb_present_query_version(connection_, 1, 0),
                                                    nullptr));
      if (version) {
        eventId_ = xcb_generate_id(connection_);
        events_ = xcb_register_for_special_xge(connection_, &xcb_present_id, eventId_, nullptr);
        discard(xcb_present_select_input_checked(connection_, eventId_, window_,
                                                 XCB_PRESENT_EVENT_MASK_CONFIGURE_NOTIFY));
      }
    }
  }

  ~XcbWindow() override {
    for (Buffer& b : buffers_) release(b);
    std::free(staging_);
    if (events_) {
      discard(
          xcb_present_select_input_checked(connection_, eventId_, window_, XCB_PRESENT_EVENT_MASK_NO_EVENT));
      xcb_unregister_for_special_event(connection_, events_);
    }
    discard(xcb_free_gc_checked(connection_, gc_));
    xcb_flush(connection_);
  }

  WindowState state() override {
    if (events_)
      while (auto* event = reinterpret_cast<xcb_present_generic_event_t*>(
                 xcb_poll_for_special_event(connection_, events_))) {
        if (event->evtype == XCB_PRESENT_EVENT_CONFIGURE_NOTIFY) {
          auto* configured = reinterpret_cast<xcb_present_configure_notify_event_t*>(event);
          extent_ = pack({configured->width, configured->height});
        }
        std::free(event);
      }
    uint32_t extent = extent_;
    return {alive_ && !xcb_connection_has_error(connection_), {extent & 0xffff, extent >> 16}};
  }

  PresentBuffer acquire(VkExtent2D extent) override {
    current_ ^= 1;
    Buffer& b = buffers_[current_];
    // The server has read what it was sent two frames ago once it answers what was asked behind it.
    settle(b, true);
    if (!alive_) return {};
    size_t bytes = size_t(visual_.pitch(extent.width)) * extent.height;
    if (b.bytes < bytes) {
      release(b);
      if (!allocate(b, bytes)) throw std::bad_alloc();
    }
    if (visual_.isBgra()) return {b.rows, visual_.pitch(extent.width)};
    size_t staged = size_t(extent.width) * extent.height * 4;
    if (stagingBytes_ < staged) {
      std::free(staging_);
      staging_ = static_cast<std::byte*>(std::malloc(staged));
      stagingBytes_ = staging_ ? staged : 0;
      if (!staging_) throw std::bad_alloc();
    }
    return {staging_, extent.width * 4};
  }

  bool show(VkExtent2D extent) override {
    Buffer& b = buffers_[current_];
    auto width = uint16_t(extent.width), height = uint16_t(extent.height);
    const uint32_t rowBytes = visual_.pitch(extent.width);
    if (!visual_.isBgra())
      packer_.pack(staging_, extent.width * 4, b.rows, extent.width, extent.height);
    else if (fillAlpha_)
      for (auto *p = reinterpret_cast<uint32_t*>(b.rows), *end = p + size_t(rowBytes / 4) * extent.height;
           p < end; p++)
        *p |= visual_.rest();
    if (b.segment) {
      discard(xcb_shm_put_image_checked(connection_, window_, gc_, width, height, 0, 0, width, height, 0, 0,
                                        visual_.depth, XCB_IMAGE_FORMAT_Z_PIXMAP, 0, b.segment, 0));
    } else {
      // A request has a largest size: send bands of rows.
      uint64_t largest = uint64_t(xcb_get_maximum_request_length(connection_)) * 4 - 64;
      auto rows = uint32_t(std::clamp<uint64_t>(largest / std::max(1u, rowBytes), 1, extent.height));
      for (uint32_t y = 0; y < extent.height; y += rows) {
        uint32_t n = std::min(rows, extent.height - y);
        discard(xcb_put_image_checked(connection_, XCB_IMAGE_FORMAT_Z_PIXMAP, window_, gc_, width,
                                      uint16_t(n), 0, int16_t(y), 0, visual_.depth, n * rowBytes,
                                      reinterpret_cast<const uint8_t*>(b.rows) + size_t(y) * rowBytes));
      }
    }
    b.geometry = xcb_get_geometry(connection_, window_);
    b.pending = true;
    xcb_flush(connection_);
    settle(buffers_[current_ ^ 1], false);
    return alive_ && !xcb_connection_has_error(connection_);
  }

 private:
  struct Buffer {
    std::byte* rows = nullptr;
    size_t bytes = 0;
    xcb_shm_seg_t segment = 0;
    xcb_get_geometry_cookie_t geometry{};
    bool pending = false;  //!< `geometry` has no answer yet
  };

  static uint32_t pack(VkExtent2D e) { return e.width | e.height << 16; }
  void discard(xcb_void_cookie_t cookie) { xcb_discard_reply(connection_, cookie.sequence); }

  // Takes the answer that says that a buffer was read and how large the window was then.
  void settle(Buffer& b, bool wait) {
    if (!b.pending) return;
    void* reply = nullptr;
    xcb_generic_error_t* error = nullptr;
    if (wait)
      reply = xcb_get_geometry_reply(connection_, b.geometry, &error);
    else if (!xcb_poll_for_reply(connection_, b.geometry.sequence, &reply, &error))
      return;
    b.pending = false;
    if (auto* geometry = static_cast<xcb_get_geometry_reply_t*>(reply))
      extent_ = pack({geometry->width, geometry->height});
    else
      alive_ = false;
    std::free(reply);
    std::free(error);
  }

  bool allocate(Buffer& b, size_t bytes) {
    if (shared_ && allocateShared(b, bytes)) return true;
    b.rows = static_cast<std::byte*>(std::malloc(bytes));
    b.bytes = b.rows ? bytes : 0;
    return b.rows;
  }

  // A file handed over the socket, not a System V segment: its number would mean another one, or none, to a
  // server in another container.
  bool allocateShared(Buffer& b, size_t bytes) {
    int file = memfd_create("pumice-frame", MFD_CLOEXEC);
    if (file < 0) return shared_ = false;
    void* address = ftruncate(file, off_t(bytes))
                        ? MAP_FAILED
                        : mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (address == MAP_FAILED) {
      close(file);
      return shared_ = false;
    }
    xcb_shm_seg_t segment = xcb_generate_id(connection_);
    // The file is libxcb's to close.
    Freed error(xcb_request_check(connection_, xcb_shm_attach_fd_checked(connection_, segment, file, 1)));
    if (error) {
      munmap(address, bytes);
      base::logDebug("the X server does not share memory with us: pixels are sent");
      return shared_ = false;
    }
    b.rows = static_cast<std::byte*>(address);
    b.bytes = bytes;
    b.segment = segment;
    return true;
  }

  void release(Buffer& b) {
    if (b.pending) xcb_discard_reply(connection_, b.geometry.sequence);
    if (b.segment) {
      discard(xcb_shm_detach_checked(connection_, b.segment));
      munmap(b.rows, b.bytes);
    } else {
      std::free(b.rows);
    }
    b = {};
  }

  xcb_connection_t* connection_;
  xcb_window_t window_;
  X11Visual visual_;
  X11Packer packer_;
  bool fillAlpha_;
  std::atomic<uint32_t> extent_;
  std::atomic<bool> alive_ = true;
  xcb_gcontext_t gc_ = 0;
  bool shared_ = false;
  uint32_t eventId_ = 0;
  xcb_special_event_t* events_ = nullptr;
  Buffer buffers_[2];
  int current_ = 0;
  std::byte* staging_ = nullptr;
  size_t stagingBytes_ = 0;
};

}  // namespace

WindowState queryXcbWindow(xcb_connection_t* connection, xcb_window_t window) {
  return describe(connection, window).state;
}

bool xcbVisualPresentable(xcb_connection_t* connection, xcb_visualid_t visual) {
  return x11Visual(xcb_get_setup(connection), visual).has_value();
}

std::unique_ptr<Window> openXcbWindow(xcb_connection_t* connection, xcb_window_t window,
                                      VkCompositeAlphaFlagBitsKHR alpha) {
  if (!connection || xcb_connection_has_error(connection)) return nullptr;
  Description d = describe(connection, window);
  if (!d.state.alive) return nullptr;
  if (!d.visual) {
    base::logError("the window's visual is neither true colour nor direct colour of 16 or 32 bits per pixel");
    return nullptr;
  }
  return std::make_unique<XcbWindow>(connection, window, d, alpha == VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR);
}

}  // namespace pumice::icd
