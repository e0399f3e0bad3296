// X11 windows through libxcb: MIT-SHM where the server shares memory with us, PutImage elsewhere (remote displays).
#include <sys/ipc.h>
#include <sys/shm.h>
#include <xcb/shm.h>
#include <xcb/xcb.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "base/log.h"
#include "icd/vulkan.h"
#include "icd/wsi/window_system.h"

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

class XcbWindow final : public Window {
 public:
  XcbWindow(xcb_connection_t* connection, xcb_window_t window) : connection_(connection), window_(window) {
    auto shmCookie = xcb_shm_query_version(connection_);
    auto geometryCookie = xcb_get_geometry(connection_, window_);
    Freed shm(xcb_shm_query_version_reply(connection_, shmCookie, nullptr));
    Freed geometry(xcb_get_geometry_reply(connection_, geometryCookie, nullptr));
    shared_ = bool(shm);
    if (geometry) depth_ = geometry->depth;
    gc_ = xcb_generate_id(connection_);
    const uint32_t noExposures = 0;
    xcb_create_gc(connection_, gc_, window_, XCB_GC_GRAPHICS_EXPOSURES, &noExposures);
  }

  ~XcbWindow() override {
    for (Buffer& b : buffers_) release(b);
    xcb_free_gc(connection_, gc_);
    xcb_flush(connection_);
  }

  WindowState state() override { return queryXcbWindow(connection_, window_); }

  PresentBuffer acquire(VkExtent2D extent) override {
    current_ ^= 1;
    Buffer& b = buffers_[current_];
    // The server has read what it was sent two frames ago once it answers what was asked behind it.
    if (b.pending) {
      std::free(xcb_get_input_focus_reply(connection_, b.read, nullptr));
      b.pending = false;
    }
    size_t bytes = size_t(extent.width) * extent.height * 4;
    if (b.bytes < bytes) {
      release(b);
      if (!allocate(b, bytes)) return {};
    }
    return {b.rows, extent.width * 4};
  }

  bool show(VkExtent2D extent) override {
    Buffer& b = buffers_[current_];
    auto width = uint16_t(extent.width), height = uint16_t(extent.height);
    if (b.segment) {
      xcb_shm_put_image(connection_, window_, gc_, width, height, 0, 0, width, height, 0, 0, depth_, XCB_IMAGE_FORMAT_Z_PIXMAP, 0, b.segment, 0);
    } else {
      // A request has a largest size: send bands of rows.
      uint32_t rowBytes = extent.width * 4;
      uint64_t largest = uint64_t(xcb_get_maximum_request_length(connection_)) * 4 - 64;
      uint32_t rows = std::max<uint32_t>(1, uint32_t(largest / std::max(1u, rowBytes)));
      for (uint32_t y = 0; y < extent.height; y += rows) {
        uint32_t n = std::min(rows, extent.height - y);
        xcb_put_image(connection_, XCB_IMAGE_FORMAT_Z_PIXMAP, window_, gc_, width, uint16_t(n), 0, int16_t(y), 0, depth_, n * rowBytes,
                      reinterpret_cast<const uint8_t*>(b.rows) + size_t(y) * rowBytes);
      }
    }
    b.read = xcb_get_input_focus(connection_);
    b.pending = true;
    xcb_flush(connection_);
    return !xcb_connection_has_error(connection_);
  }

 private:
  struct Buffer {
    std::byte* rows = nullptr;
    size_t bytes = 0;
    xcb_shm_seg_t segment = 0;
    xcb_get_input_focus_cookie_t read{};
    bool pending = false;   //!< `read` has no answer yet
  };

  bool allocate(Buffer& b, size_t bytes) {
    if (shared_ && allocateShared(b, bytes)) return true;
    b.rows = static_cast<std::byte*>(std::malloc(bytes));
    b.bytes = b.rows ? bytes : 0;
    return b.rows;
  }

  bool allocateShared(Buffer& b, size_t bytes) {
    int id = shmget(IPC_PRIVATE, bytes, IPC_CREAT | 0600);
    if (id < 0) return shared_ = false;
    void* address = shmat(id, nullptr, 0);
    bool attached = address != reinterpret_cast<void*>(-1);
    xcb_shm_seg_t segment = xcb_generate_id(connection_);
    if (attached) {
      Freed error(xcb_request_check(connection_, xcb_shm_attach_checked(connection_, segment, uint32_t(id), 1)));
      if (error) {
        shmdt(address);
        attached = false;
      }
    }
    // Gone with the last process that has it attached.
    shmctl(id, IPC_RMID, nullptr);
    if (!attached) {
      base::logDebug("the X server does not share memory with us: pixels are sent");
      return shared_ = false;
    }
    b.rows = static_cast<std::byte*>(address);
    b.bytes = bytes;
    b.segment = segment;
    return true;
  }

  void release(Buffer& b) {
    if (b.pending) std::free(xcb_get_input_focus_reply(connection_, b.read, nullptr));
    if (b.segment) {
      xcb_shm_detach(connection_, b.segment);
      shmdt(b.rows);
    } else {
      std::free(b.rows);
    }
    b = {};
  }

  xcb_connection_t* connection_;
  xcb_window_t window_;
  xcb_gcontext_t gc_ = 0;
  uint8_t depth_ = 24;
  bool shared_ = false;
  Buffer buffers_[2];
  int current_ = 0;
};

}  // namespace

WindowState queryXcbWindow(xcb_connection_t* connection, xcb_window_t window) {
  Freed geometry(xcb_get_geometry_reply(connection, xcb_get_geometry(connection, window), nullptr));
  if (!geometry) return {false, {0, 0}};
  return {true, {geometry->width, geometry->height}};
}

std::unique_ptr<Window> openXcbWindow(xcb_connection_t* connection, xcb_window_t window) {
  if (!connection || xcb_connection_has_error(connection)) return nullptr;
  return std::make_unique<XcbWindow>(connection, window);
}

}  // namespace pumice::icd
