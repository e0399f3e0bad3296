// Logical device: its queue, its thread pool, what its objects allocate from.
#pragma once

#include <atomic>
#include <memory>

#include "base/threads.h"
#include "icd/instance.h"

namespace pumice::icd {

struct Device;
class QueueWorker;

struct Queue : Dispatchable {
  Device* device = nullptr;
  std::unique_ptr<QueueWorker> worker;
};

struct Device : Dispatchable {
  Device(PhysicalDevice& p, HostAllocator a);
  ~Device();
  PhysicalDevice& physical;
  HostAllocator allocator;
  ExtensionSet extensions;   //!< of the device
  FeatureSet features;       //!< enabled
  base::ThreadPool pool;
  Queue queue;
  //! Counts bytes against the heap; false when it has not as many left. Given back by release().
  bool reserve(uint64_t size) {
    const uint64_t heap = physical.memory.memoryHeaps[0].size;
    if (size > heap) return false;   // and the sum below cannot wrap
    if (physical.allocatedBytes.fetch_add(size) <= heap - size) return true;
    release(size);
    return false;
  }
  void release(uint64_t size) { physical.allocatedBytes -= size; }

  HostAllocator allocatorFor(const VkAllocationCallbacks* callbacks) const { return allocator.orElse(callbacks); }
  //! New object in object scope; null when out of host memory.
  template <typename T, typename... Args>
  T* make(const VkAllocationCallbacks* callbacks, Args&&... args) const {
    return makeObject<T>(allocatorFor(callbacks), VK_SYSTEM_ALLOCATION_SCOPE_OBJECT, std::forward<Args>(args)...);
  }
  template <typename T>
  void destroy(const VkAllocationCallbacks* callbacks, T* object) const {
    destroyObject(allocatorFor(callbacks), object);
  }
};

PUMICE_HANDLE(Device, VkDevice)
PUMICE_HANDLE(Queue, VkQueue)

}  // namespace pumice::icd
