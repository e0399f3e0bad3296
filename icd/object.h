// Handles and host memory of Vulkan objects. A dispatchable handle points at an object whose first word is the
// loader's; a non-dispatchable one is the object's address. VkAllocationCallbacks are honoured for every object, its
// arrays (host_containers.h) and recorded commands (Vulkan spec, "Memory Allocation"): the create call's, else the
// device's or the instance's, else malloc. What may outlive the object that it was made for (layouts, pipelines that
// command buffers hold) and the compiler's own work come from malloc.
#pragma once

#include <cstdlib>
#include <new>
#include <utility>

#include "icd/vulkan.h"

namespace pumice::icd {

//! The loader writes its dispatch table over the magic.
struct Dispatchable {
  uintptr_t loaderData = 0x01CDC0DE;
};

//! Callbacks as given by the application, or malloc.
class HostAllocator {
 public:
  HostAllocator() = default;
  explicit HostAllocator(const VkAllocationCallbacks* callbacks) {
    if (callbacks) callbacks_ = *callbacks, own_ = true;
  }
  //! `preferred` of a create or destroy call, else this.
  HostAllocator orElse(const VkAllocationCallbacks* preferred) const { return preferred ? HostAllocator(preferred) : *this; }

  void* allocate(size_t size, size_t alignment, VkSystemAllocationScope scope) const {
    if (own_) return callbacks_.pfnAllocation(callbacks_.pUserData, size, alignment, scope);
    void* memory = nullptr;
    return posix_memalign(&memory, alignment < sizeof(void*) ? sizeof(void*) : alignment, size ? size : 1) ? nullptr : memory;
  }
  bool operator==(const HostAllocator& other) const {
    return own_ == other.own_ && (!own_ || (callbacks_.pUserData == other.callbacks_.pUserData && callbacks_.pfnAllocation == other.callbacks_.pfnAllocation &&
                                            callbacks_.pfnFree == other.callbacks_.pfnFree));
  }
  void free(void* memory) const {
    if (!memory) return;
    if (own_)
      callbacks_.pfnFree(callbacks_.pUserData, memory);
    else
      std::free(memory);
  }

 private:
  VkAllocationCallbacks callbacks_{};
  bool own_ = false;
};

//! Makes an object; null when memory runs out (in the callbacks or inside the constructor).
template <typename T, typename... Args>
T* makeObject(const HostAllocator& allocator, VkSystemAllocationScope scope, Args&&... args) {
  void* memory = allocator.allocate(sizeof(T), alignof(T), scope);
  if (!memory) return nullptr;
  try {
    return new (memory) T(std::forward<Args>(args)...);
  } catch (const std::bad_alloc&) {
    allocator.free(memory);
    return nullptr;
  }
}

template <typename T>
void destroyObject(const HostAllocator& allocator, T* object) {
  if (!object) return;
  object->~T();
  allocator.free(object);
}

//! Handle of an object and back. One line per object type: PUMICE_HANDLE(Buffer, VkBuffer).
template <typename Handle>
struct ObjectOf;
template <typename Handle>
auto* from(Handle handle) {
  return reinterpret_cast<typename ObjectOf<Handle>::Type*>(handle);
}
template <typename Handle, typename T>
Handle to(T* object) {
  static_assert(std::is_same_v<typename ObjectOf<Handle>::Type, T>);
  return reinterpret_cast<Handle>(object);
}
#define PUMICE_HANDLE(type, VkType) \
  template <>                       \
  struct ObjectOf<VkType> {         \
    using Type = type;              \
  };

//! The structure of a given type in a pNext chain, or null.
template <typename T>
const T* findInChain(const void* chain, VkStructureType type) {
  for (auto* s = static_cast<const VkBaseInStructure*>(chain); s; s = s->pNext)
    if (s->sType == type) return reinterpret_cast<const T*>(s);
  return nullptr;
}

//! The two-call idiom of vkEnumerate* and vkGet*: how many fit, and VK_INCOMPLETE when not all do.
template <typename T, typename Fill>
VkResult enumerate(uint32_t available, uint32_t* count, T* out, Fill&& fill) {
  if (!out) {
    *count = available;
    return VK_SUCCESS;
  }
  uint32_t n = *count < available ? *count : available;
  for (uint32_t i = 0; i < n; i++) fill(i, out[i]);
  *count = n;
  return n < available ? VK_INCOMPLETE : VK_SUCCESS;
}

}  // namespace pumice::icd
