// Wayland surfaces: wl_shm buffers on an event queue of our own, so that the application's events stay its
// own.
#include <poll.h>
#include <sys/mman.h>
#include <unistd.h>
#include <wayland-client.h>

#include <cerrno>
#include <chrono>
#include <cstring>

#include "base/log.h"
#include "icd/vulkan.h"
#include "icd/wsi/window_system.h"

namespace pumice::icd {
namespace {

using Clock = std::chrono::steady_clock;

// A window that is hidden is never asked for a frame, but whoever waits for the queue must not wait for ever.
constexpr std::chrono::milliseconds kLongestFrame{250};

class WaylandWindow final : public Window {
 public:
  WaylandWindow(wl_display* display, wl_surface* surface, bool fifo, bool opaque)
      : display_(display), fifo_(fifo), format_(opaque ? WL_SHM_FORMAT_XRGB8888 : WL_SHM_FORMAT_ARGB8888) {
    queue_ = wl_display_create_queue(display_);
    // Wrappers send to the same objects but deliver new objects' events to our queue.
    auto* displayWrapper = static_cast<wl_display*>(wl_proxy_create_wrapper(display_));
    surface_ = static_cast<wl_surface*>(wl_proxy_create_wrapper(surface));
    if (queue_ && displayWrapper && surface_) {
      wl_proxy_set_queue(reinterpret_cast<wl_proxy*>(displayWrapper), queue_);
      wl_proxy_set_queue(reinterpret_cast<wl_proxy*>(surface_), queue_);
      registry_ = wl_display_get_registry(displayWrapper);
    }
    if (displayWrapper) wl_proxy_wrapper_destroy(displayWrapper);
    if (!registry_) return;
    static const wl_registry_listener kListener = {
        [](void* data, wl_registry* registry, uint32_t name, const char* interface, uint32_t) {
          auto* self = static_cast<WaylandWindow*>(data);
          if (!self->shm_ && !std::strcmp(interface, wl_shm_interface.name))
            self->shm_ = static_cast<wl_shm*>(wl_registry_bind(registry, name, &wl_shm_interface, 1));
        },
        [](void*, wl_registry*, uint32_t) {}};
    wl_registry_add_listener(registry_, &kListener, this);
    wl_display_roundtrip_queue(display_, queue_);
  }

  ~WaylandWindow() override {
    for (Buffer& b : buffers_) release(b);
    if (frame_) wl_callback_destroy(frame_);
    if (shm_) wl_shm_destroy(shm_);
    if (registry_) wl_registry_destroy(registry_);
    if (surface_) wl_proxy_wrapper_destroy(surface_);
    if (queue_) wl_event_queue_destroy(queue_);
    wl_display_flush(display_);
  }

  bool usable() const { return shm_; }
  WindowState state() override { return queryWaylandWindow(display_); }

  PresentBuffer acquire(VkExtent2D extent) override {
    Buffer* free = nullptr;
    while (!(free = freeBuffer()))
      if (!dispatch(Clock::time_point::max())) return {};
    current_ = free;
    if (free->extent.width != extent.width || free->extent.height != extent.height) {
      release(*free);
      if (!allocate(*free, extent)) throw std::bad_alloc();
    }
    return {free->rows, extent.width * 4};
  }

  // The compositor asks for a frame when it shows one: FIFO waits for that.
  void throttle() override {
    const auto end = Clock::now() + kLongestFrame;
    while (frame_ && Clock::now() < end)
      if (!dispatch(end)) break;
    if (!frame_) return;
    wl_callback_destroy(frame_);
    frame_ = nullptr;
  }

  bool show(VkExtent2D extent) override {
    if (fifo_ && (frame_ = wl_surface_frame(surface_))) {
      static const wl_callback_listener kListener = {[](void* data, wl_callback* callback, uint32_t) {
        wl_callback_destroy(callback);
        static_cast<WaylandWindow*>(data)->frame_ = nullptr;
      }};
      wl_callback_add_listener(frame_, &kListener, this);
    }
    wl_surface_attach(surface_, current_->buffer, 0, 0);
    wl_surface_damage(surface_, 0, 0, int32_t(extent.width), int32_t(extent.height));
    wl_surface_commit(surface_);
    current_->busy = true;
    return wl_display_flush(display_) >= 0 || errno == EAGAIN;
  }

 private:
  struct Buffer {
    wl_buffer* buffer = nullptr;
    std::byte* rows = nullptr;
    size_t bytes = 0;
    VkExtent2D extent{};
    bool busy = false;
  };

  // Waits for events until some came or the time is over. False when the connection is broken.
  bool dispatch(Clock::time_point end) {
    if (wl_display_prepare_read_queue(display_, queue_))
      return wl_display_dispatch_queue_pending(display_, queue_) >= 0;
    short wanted = POLLIN;
    if (wl_display_flush(display_) < 0 && errno == EAGAIN) wanted |= POLLOUT;
    int wait = -1;
    if (end != Clock::time_point::max())
      wait =
          int(std::max<int64_t>(0, std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count()));
    pollfd file{wl_display_get_fd(display_), wanted, 0};
    int ready = poll(&file, 1, wait);
    if (ready <= 0 || file.revents == POLLOUT) {
      int error = errno;
      wl_display_cancel_read(display_);
      return ready >= 0 || error == EINTR;
    }
    return wl_display_read_events(display_) >= 0 && wl_display_dispatch_queue_pending(display_, queue_) >= 0;
  }

  Buffer* freeBuffer() {
    wl_display_dispatch_queue_pending(display_, queue_);
    for (Buffer& b : buffers_)
      if (!b.busy) return &b;
    return nullptr;
  }

  bool allocate(Buffer& b, VkExtent2D extent) {
    size_t bytes = size_t(extent.width) * extent.height * 4;
    if (bytes > INT32_MAX) return false;  // the protocol's numbers end there
    int file = memfd_create("pumice-frame", MFD_CLOEXEC);
    if (file < 0) return false;
    void* rows = ftruncate(file, off_t(bytes))
                     ? MAP_FAILED
                     : mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (rows == MAP_FAILED) {
      close(file);
      return false;
    }
    wl_shm_pool* pool = wl_shm_create_pool(shm_, file, int32_t(bytes));
    close(file);
    if (pool) {
      b.buffer = wl_shm_pool_create_buffer(pool, 0, int32_t(extent.width), int32_t(extent.height),
                                           int32_t(extent.width * 4), format_);
      wl_shm_pool_destroy(pool);
    }
    if (!b.buffer) {
      munmap(rows, bytes);
      return false;
    }
    b.rows = static_cast<std::byte*>(rows);
    b.bytes = bytes;
    b.extent = extent;
    static const wl_buffer_listener kListener = {
        [](void* data, wl_buffer*) { static_cast<Buffer*>(data)->busy = false; }};
    wl_buffer_add_listener(b.buffer, &kListener, &b);
    return true;
  }

  void release(Buffer& b) {
    if (b.buffer) wl_buffer_destroy(b.buffer);
    if (b.rows) munmap(b.rows, b.bytes);
    b = {};
  }

  wl_display* display_;
  wl_surface* surface_ = nullptr;
  wl_event_queue* queue_ = nullptr;
  wl_registry* registry_ = nullptr;
  wl_shm* shm_ = nullptr;
  wl_callback* frame_ = nullptr;
  bool fifo_;
  uint32_t format_;
  Buffer buffers_[4];  //!< one shown, one about to be, two for a compositor that is late to release
  Buffer* current_ = nullptr;
};

}  // namespace

WindowState queryWaylandWindow(wl_display* display) {
  WindowState state;
  state.alive = !wl_display_get_error(display);
  state.translucent = true;
  return state;
}

std::unique_ptr<Window> openWaylandWindow(wl_display* display, wl_surface* surface, VkPresentModeKHR mode,
                                          VkCompositeAlphaFlagBitsKHR alpha) {
  auto window = std::make_unique<WaylandWindow>(display, surface, mode == VK_PRESENT_MODE_FIFO_KHR,
                                                alpha == VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR);
  if (!window->usable()) {
    base::logError("the Wayland compositor offers no wl_shm, or is gone");
    return nullptr;
  }
  return window;
}

}  // namespace pumice::icd
