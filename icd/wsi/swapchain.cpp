#include "icd/wsi/swapchain.h"

#include <sys/mman.h>

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/pages.h"
#include "entrypoints.h"
#include "icd/host_containers.h"
#include "icd/queue.h"
#include "icd/wsi/window_system.h"

namespace pumice::icd {

struct SwapchainImage {
  Image image;
  bool busy = false;  //!< acquired by the application, or waiting to be shown
};

//! Flags and counters are guarded by the device's SyncHub.
struct Swapchain {
  Swapchain(Device& d, const HostAllocator& a) : device(&d), images(HostStl<SwapchainImage>(a)) {}
  Device* device;
  const VkIcdSurfaceBase* surface = nullptr;
  VkExtent2D extent{};
  bool fifo = true;                //!< of the next present
  std::unique_ptr<Window> window;  //!< null: headless
  HostVector<SwapchainImage> images;
  std::byte* memory = nullptr;
  uint64_t memoryBytes = 0, imageBytes = 0;
  uint32_t pending = 0;  //!< presents on their way
  uint32_t watchers = 0; //!< threads that wait for a present to be over
  bool retired = false, resized = false, lost = false;
  // Of the list of claimed windows, and guarded by its mutex
  Swapchain *previous = nullptr, *next = nullptr;
  std::pair<const void*, uint64_t> claimed;
  bool claims = false;

  //! False when another swapchain that is not retired has the window.
  bool claim();
  void disclaim();

  ~Swapchain() {
    disclaim();
    if (memory) munmap(memory, memoryBytes);
    device->release(memoryBytes);
  }
  //! What the window is now, as far as it is known without asking.
  void observe(SyncHub& hub);
  bool isResized(const WindowState& state) const {
    return state.extent.width != ~0u && (state.extent.width != extent.width || state.extent.height != extent.height);
  }
  void note(const WindowState& state) {
    lost |= !state.alive;
    resized |= isResized(state);
  }
  bool changes(const WindowState& state) const { return (!state.alive && !lost) || (isResized(state) && !resized); }
  void present(SyncHub& hub, uint32_t index, bool inTurn);
};

namespace {
//! What tells one window from another. The same window through two connections counts as two.
std::pair<const void*, uint64_t> windowOf(const VkIcdSurfaceBase& surface) {
  switch (surface.platform) {
    case VK_ICD_WSI_PLATFORM_XCB: {
      auto& s = reinterpret_cast<const VkIcdSurfaceXcb&>(surface);
      return {s.connection, s.window};
    }
    case VK_ICD_WSI_PLATFORM_XLIB: {
      auto& s = reinterpret_cast<const VkIcdSurfaceXlib&>(surface);
      return {s.dpy, s.window};
    }
    case VK_ICD_WSI_PLATFORM_WAYLAND: return {reinterpret_cast<const VkIcdSurfaceWayland&>(surface).surface, 0};
    default: return {&surface, 0};
  }
}

//! The swapchains that are not retired: a window has at most one in the process.
struct Shown {
  std::mutex mutex;
  PoolList<Swapchain> list;
};
constinit Shown shown;
}  // namespace

bool Swapchain::claim() {
  std::lock_guard lock(shown.mutex);
  claimed = windowOf(*surface);
  for (Swapchain* other = shown.list.first(); other; other = other->next)
    if (other->claimed == claimed) return false;
  shown.list.insert(this);
  return claims = true;
}

void Swapchain::disclaim() {
  std::lock_guard lock(shown.mutex);
  if (std::exchange(claims, false)) shown.list.erase(this);
}

void bindSwapchainImage(Image& image, VkSwapchainKHR handle, uint32_t index) {
  const Image& own = from(handle)->images[index].image;
  image.data = own.data;
  image.cleared = own.cleared;
}

void Swapchain::observe(SyncHub& hub) {
  if (!window) return;
  WindowState state = window->state();
  if (hub.read([&] { return changes(state); })) hub.update([&] { note(state); });
}

// As part of a submission. inTurn: FIFO.
void Swapchain::present(SyncHub& hub, uint32_t index, bool inTurn) {
  WindowState state;
  if (window) try {
      if (inTurn) window->throttle();
      PresentBuffer buffer = window->acquire(extent);
      bool shown = false;
      if (buffer.rows) {
        texture::presentRows(device->pool, images[index].image.memory(), buffer.rows, buffer.pitch, extent);
        shown = window->show(extent);
      }
      state = window->state();
      state.alive &= shown;
    } catch (const std::bad_alloc&) {
      base::logError("out of memory: a frame is not shown");
    }
  const bool watched = hub.read([&] {
    images[index].busy = false;
    pending--;
    note(state);
    return watchers > 0;
  });
  // Whoever waits for something else, a fence mostly, sleeps on.
  if (watched) hub.update([] {});
}

namespace {

SyncHub& hub(const Swapchain& s) { return s.device->queue.worker->hub(); }

VkImageCreateInfo imageInfo(const VkSwapchainCreateInfoKHR& info) {
  VkImageCreateInfo image{};
  image.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  image.imageType = VK_IMAGE_TYPE_2D;
  image.format = info.imageFormat;
  image.extent = {info.imageExtent.width, info.imageExtent.height, 1};
  image.mipLevels = 1;
  image.arrayLayers = info.imageArrayLayers;
  image.samples = VK_SAMPLE_COUNT_1_BIT;
  image.tiling = VK_IMAGE_TILING_OPTIMAL;
  image.usage = info.imageUsage;
  return image;
}

VkResult build(Swapchain& s, const VkSwapchainCreateInfoKHR& info) {
  s.surface = reinterpret_cast<const VkIcdSurfaceBase*>(info.surface);
  s.extent = info.imageExtent;
  s.fifo =
      info.presentMode == VK_PRESENT_MODE_FIFO_KHR || info.presentMode == VK_PRESENT_MODE_FIFO_RELAXED_KHR;
  texture::ImageLayout layout = texture::imageLayout(imageInfo(info));
  if (!layout.format || !layout.size) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  // MAILBOX wants one image to be shown, one queued and one to draw.
  auto* modes = findInChain<VkSwapchainPresentModesCreateInfoEXT>(info.pNext, VK_STRUCTURE_TYPE_SWAPCHAIN_PRESENT_MODES_CREATE_INFO_EXT);
  bool mailbox = info.presentMode == VK_PRESENT_MODE_MAILBOX_KHR;
  for (uint32_t i = 0; modes && i < modes->presentModeCount; i++) mailbox |= modes->pPresentModes[i] == VK_PRESENT_MODE_MAILBOX_KHR;
  uint32_t count = std::max(info.minImageCount, mailbox ? 3u : 2u);
  s.imageBytes = (layout.size + 4095) & ~uint64_t(4095);
  uint64_t bytes = 0;
  if (__builtin_mul_overflow(s.imageBytes, uint64_t(count), &bytes) || !s.device->reserve(bytes)) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  s.memoryBytes = bytes;
  s.memory = static_cast<std::byte*>(base::mapPages(s.memoryBytes));
  if (!s.memory) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  s.images.resize(count);
  for (uint32_t i = 0; i < count; i++) {
    Image& image = s.images[i].image;
    image.layout = layout;
    if (info.flags & VK_SWAPCHAIN_CREATE_MUTABLE_FORMAT_BIT_KHR)
      image.flags = VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT | VK_IMAGE_CREATE_EXTENDED_USAGE_BIT;
    image.usage = info.imageUsage;
    image.format = info.imageFormat;
    image.data = s.memory + i * s.imageBytes;
    allowMarkedClears(image);
  }
  if (s.surface->platform != VK_ICD_WSI_PLATFORM_HEADLESS) {
    s.window = openWindow(*s.surface, info);
    if (!s.window) return VK_ERROR_SURFACE_LOST_KHR;
    s.note(s.window->state());
  }
  return s.claim() ? VK_SUCCESS : VK_ERROR_NATIVE_WINDOW_IN_USE_KHR;   // that the window is gone says more
}

VkResult acquire(VkSwapchainKHR handle, uint64_t timeout, VkSemaphore semaphore, VkFence fence,
                 uint32_t* index) {
  Swapchain& s = *from(handle);
  s.observe(hub(s));
  VkResult result = VK_SUCCESS;
  auto ready = [&] {
    if (s.lost || s.retired) {
      result = s.lost ? VK_ERROR_SURFACE_LOST_KHR : VK_ERROR_OUT_OF_DATE_KHR;
      return true;
    }
    // The first that is free, not the next in turn: a recently used image is still in the caches.
    for (uint32_t i = 0; i < s.images.size(); i++)
      if (!s.images[i].busy) {
        s.images[i].busy = true;
        *index = i;
        // Whoever read the image has finished: it is ours at once.
        if (semaphore) from(semaphore)->signal(1);
        if (fence) from(fence)->signaled = true;
        // As Mesa's drivers do on X11: a window of another size still shows what fits.
        result = s.resized ? VK_SUBOPTIMAL_KHR : VK_SUCCESS;
        return true;
      }
    return false;
  };
  hub(s).read([&] { s.watchers++; });
  const VkResult waited = hub(s).waitOrLost(timeout, ready);
  hub(s).read([&] { s.watchers--; });
  if (waited) return waited == VK_TIMEOUT && !timeout ? VK_NOT_READY : waited;
  if (result >= 0 && (semaphore || fence)) hub(s).update([] {});
  return result;
}

}  // namespace

VKAPI_ATTR VkResult VKAPI_CALL vkCreateSwapchainKHR(VkDevice handle, const VkSwapchainCreateInfoKHR* info,
                                                    const VkAllocationCallbacks* callbacks,
                                                    VkSwapchainKHR* out) {
  Device& device = *from(handle);
  if (Swapchain* old = from(info->oldSwapchain)) {
    hub(*old).update([&] { old->retired = true; });
    old->disclaim();
  }
  auto* swapchain = device.make<Swapchain>(callbacks, device, device.allocatorFor(callbacks));
  if (!swapchain) return VK_ERROR_OUT_OF_HOST_MEMORY;
  VkResult result;
  try {
    result = build(*swapchain, *info);
  } catch (const std::bad_alloc&) {
    result = VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  if (result != VK_SUCCESS) {
    device.destroy(callbacks, swapchain);
    return result;
  }
  *out = to<VkSwapchainKHR>(swapchain);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroySwapchainKHR(VkDevice device, VkSwapchainKHR handle,
                                                 const VkAllocationCallbacks* callbacks) {
  if (Swapchain* s = from(handle)) {
    hub(*s).read([&] { s->watchers++; });   // for as long as it lives
    hub(*s).wait(~0ull, [&] { return !s->pending; });
    from(device)->destroy(callbacks, s);
  }
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetSwapchainImagesKHR(VkDevice, VkSwapchainKHR handle, uint32_t* count,
                                                       VkImage* out) {
  Swapchain& s = *from(handle);
  return enumerate(uint32_t(s.images.size()), count, out,
                   [&](uint32_t i, VkImage& image) { image = to<VkImage>(&s.images[i].image); });
}

VKAPI_ATTR VkResult VKAPI_CALL vkAcquireNextImageKHR(VkDevice, VkSwapchainKHR swapchain, uint64_t timeout,
                                                     VkSemaphore semaphore, VkFence fence, uint32_t* index) {
  return acquire(swapchain, timeout, semaphore, fence, index);
}

VKAPI_ATTR VkResult VKAPI_CALL vkAcquireNextImage2KHR(VkDevice, const VkAcquireNextImageInfoKHR* info,
                                                      uint32_t* index) {
  return acquire(info->swapchain, info->timeout, info->semaphore, info->fence, index);
}

// Acquired, but not to be shown.
VKAPI_ATTR VkResult VKAPI_CALL vkReleaseSwapchainImagesEXT(VkDevice, const VkReleaseSwapchainImagesInfoEXT* info) {
  Swapchain& s = *from(info->swapchain);
  hub(s).update([&] {
    for (uint32_t i = 0; i < info->imageIndexCount; i++) s.images[info->pImageIndices[i]].busy = false;
  });
  return s.lost ? VK_ERROR_SURFACE_LOST_KHR : VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkQueuePresentKHR(VkQueue queue, const VkPresentInfoKHR* info) {
  QueueWorker& worker = *from(queue)->worker;
  struct Item {
    Swapchain* swapchain;
    uint32_t index;
    Fence* shown = nullptr;   //!< signalled when the image has been handed over
    bool fifo = true;
  };
  auto* fences = findInChain<VkSwapchainPresentFenceInfoEXT>(info->pNext, VK_STRUCTURE_TYPE_SWAPCHAIN_PRESENT_FENCE_INFO_EXT);
  auto* modes = findInChain<VkSwapchainPresentModeInfoEXT>(info->pNext, VK_STRUCTURE_TYPE_SWAPCHAIN_PRESENT_MODE_INFO_EXT);
  std::vector<Item> items;
  VkResult result = VK_SUCCESS;
  try {
    Submission submission;
    for (uint32_t i = 0; i < info->waitSemaphoreCount; i++)
      submission.add({from(info->pWaitSemaphores[i]), 1});
    for (uint32_t i = 0; i < info->swapchainCount; i++) {
      Swapchain* s = from(info->pSwapchains[i]);
      items.push_back({s, info->pImageIndices[i]});
      if (fences && i < fences->swapchainCount) items.back().shown = from(fences->pFences[i]);
      if (modes && i < modes->swapchainCount) s->fifo = modes->pPresentModes[i] == VK_PRESENT_MODE_FIFO_KHR;
      items.back().fifo = s->fifo;
      submission.sleeps |= s->fifo;
      s->observe(worker.hub());
      // Shown all the same: a window of another size shows what fits.
      VkResult one = worker.hub().read([&] {
        s->pending++;
        return s->lost                    ? VK_ERROR_SURFACE_LOST_KHR
               : s->retired || s->resized ? VK_SUBOPTIMAL_KHR
                                          : VK_SUCCESS;
      });
      if (info->pResults) info->pResults[i] = one;
      // An error counts more than being suboptimal.
      if (one < 0 || result == VK_SUCCESS) result = one;
    }
    submission.work = [items, &worker] {
      for (const Item& item : items) {
        item.swapchain->present(worker.hub(), item.index, item.fifo);
        if (item.shown) worker.hub().update([&] { item.shown->signaled = true; });
      }
    };
    if (!worker.submit(std::move(submission))) throw std::bad_alloc();
    if (worker.hub().lost()) result = VK_ERROR_DEVICE_LOST;
  } catch (const std::bad_alloc&) {
    worker.hub().update([&] {
      for (const Item& item : items) item.swapchain->pending--;
    });
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  return result;
}

}  // namespace pumice::icd
