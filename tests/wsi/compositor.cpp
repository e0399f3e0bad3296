#include "tests/wsi/compositor.h"

#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstring>

namespace pumice::test {

struct Compositor::Surface {
  Compositor* compositor = nullptr;
  wl_resource* attached = nullptr;
  std::vector<wl_resource*> frames;
};

//! The requests of the interfaces that are offered.
struct Compositor::Requests {
  static Surface& of(wl_resource* r) { return *static_cast<Surface*>(wl_resource_get_user_data(r)); }
  static void ignore(wl_client*, wl_resource*) {}
  static void destroy(wl_client*, wl_resource* r) { wl_resource_destroy(r); }
  static void rectangle(wl_client*, wl_resource*, int32_t, int32_t, int32_t, int32_t) {}
  static void region(wl_client*, wl_resource*, wl_resource*) {}
  static void number(wl_client*, wl_resource*, int32_t) {}

  static constexpr struct wl_region_interface kRegion = {destroy, rectangle, rectangle};
  static constexpr struct wl_surface_interface kSurface = {
      destroy,
      [](wl_client*, wl_resource* r, wl_resource* buffer, int32_t, int32_t) { of(r).attached = buffer; },
      rectangle,
      [](wl_client* client, wl_resource* r, uint32_t id) {
        of(r).frames.push_back(wl_resource_create(client, &wl_callback_interface, 1, id));
      },
      region,
      region,
      [](wl_client*, wl_resource* r) { of(r).compositor->commit(of(r)); },
      number,
      number,
      rectangle,
      nullptr};
  static constexpr struct wl_compositor_interface kCompositor = {
      [](wl_client* client, wl_resource* r, uint32_t id) {
        auto* surface = new Surface;
        surface->compositor = static_cast<Compositor*>(wl_resource_get_user_data(r));
        wl_resource_set_implementation(wl_resource_create(client, &wl_surface_interface, 4, id), &kSurface,
                                       surface, [](wl_resource* gone) { delete &of(gone); });
      },
      [](wl_client* client, wl_resource*, uint32_t id) {
        wl_resource_set_implementation(wl_resource_create(client, &wl_region_interface, 1, id), &kRegion,
                                       nullptr, nullptr);
      }};

  static void bind(wl_client* client, void* data, uint32_t version, uint32_t id) {
    wl_resource_set_implementation(wl_resource_create(client, &wl_compositor_interface, int(version), id),
                                   &kCompositor, data, nullptr);
  }
};

namespace {

Commit contents(wl_resource* buffer) {
  Commit c;
  wl_shm_buffer* shm = wl_shm_buffer_get(buffer);
  if (!shm) return c;
  c.width = uint32_t(wl_shm_buffer_get_width(shm));
  c.height = uint32_t(wl_shm_buffer_get_height(shm));
  c.format = wl_shm_buffer_get_format(shm);
  c.pixels.resize(size_t(c.width) * c.height);
  wl_shm_buffer_begin_access(shm);
  auto* rows = static_cast<const std::byte*>(wl_shm_buffer_get_data(shm));
  for (uint32_t y = 0; y < c.height; y++)
    std::memcpy(&c.pixels[size_t(y) * c.width], rows + size_t(y) * size_t(wl_shm_buffer_get_stride(shm)),
                size_t(c.width) * 4);
  wl_shm_buffer_end_access(shm);
  return c;
}

void answer(wl_resource* frame) {
  wl_callback_send_done(frame, 0);
  wl_resource_destroy(frame);
}

}  // namespace

Compositor::Compositor(Manners manners) : manners_(manners) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends)) return;
  clientFile_ = ends[0];
  display_ = wl_display_create();
  wl_display_init_shm(display_);
  wl_global_create(display_, &wl_compositor_interface, 4, this, Requests::bind);
  client_ = wl_client_create(display_, ends[1]);
  wake_ = eventfd(0, EFD_CLOEXEC);
  wakeSource_ = wl_event_loop_add_fd(
      wl_display_get_event_loop(display_), wake_, WL_EVENT_READABLE,
      [](int file, uint32_t, void* data) {
        auto* self = static_cast<Compositor*>(data);
        uint64_t times;
        if (read(file, &times, sizeof times) != sizeof times) return 0;
        std::lock_guard lock(self->mutex_);
        while (self->framesToAnswer_ && !self->heldFrames_.empty()) {
          answer(self->heldFrames_.front());
          self->heldFrames_.erase(self->heldFrames_.begin());
          self->framesToAnswer_--;
        }
        if (self->stop_) wl_display_terminate(self->display_);
        return 0;
      },
      this);
  thread_ = std::thread([this] { wl_display_run(display_); });
}

void Compositor::commit(Surface& surface) {
  std::lock_guard lock(mutex_);
  for (wl_resource* frame : surface.frames)
    if (manners_.answerFrames)
      answer(frame);
    else
      heldFrames_.push_back(frame);
  surface.frames.clear();
  if (!surface.attached) return;
  for (auto& [buffer, before] : heldBuffers_) torn_ |= contents(buffer).pixels != before.pixels;
  commits_.push_back(contents(surface.attached));
  if (manners_.releaseBuffers) {
    wl_buffer_send_release(surface.attached);
  } else {
    heldBuffers_.emplace_back(surface.attached, commits_.back());
    if (heldBuffers_.size() > 2) {
      wl_buffer_send_release(heldBuffers_.front().first);
      heldBuffers_.erase(heldBuffers_.begin());
    }
  }
  surface.attached = nullptr;
  changed_.notify_all();
}

Commit Compositor::waitFor(size_t count) {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, std::chrono::seconds(10), [&] { return commits_.size() >= count; })) return {};
  return commits_.back();
}

void Compositor::answerFrame() {
  std::lock_guard lock(mutex_);
  framesToAnswer_++;
  uint64_t one = 1;
  (void)!write(wake_, &one, sizeof one);
}

size_t Compositor::commits() {
  std::lock_guard lock(mutex_);
  return commits_.size();
}

bool Compositor::torn() {
  std::lock_guard lock(mutex_);
  return torn_;
}

void Compositor::stop() {
  if (!thread_.joinable()) return;
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
    uint64_t one = 1;
    (void)!write(wake_, &one, sizeof one);
  }
  thread_.join();
  wl_event_source_remove(wakeSource_);
  wl_display_destroy_clients(display_);
  wl_display_destroy(display_);
  close(wake_);
}

}  // namespace pumice::test
