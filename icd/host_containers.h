// Containers of objects whose memory comes from the application's callbacks.
#pragma once

#include <vector>

#include "icd/object.h"

namespace pumice::icd {

//! HostAllocator as the standard library wants it. Throws std::bad_alloc when the callbacks give nothing.
template <typename T>
struct HostStl {
  using value_type = T;
  explicit HostStl(const HostAllocator& a) : allocator(a) {}
  template <typename U>
  HostStl(const HostStl<U>& other) : allocator(other.allocator) {}
  T* allocate(size_t count) {
    if (void* memory = allocator.allocate(count * sizeof(T), alignof(T), VK_SYSTEM_ALLOCATION_SCOPE_OBJECT)) return static_cast<T*>(memory);
    throw std::bad_alloc();
  }
  void deallocate(T* memory, size_t) { allocator.free(memory); }
  template <typename U>
  bool operator==(const HostStl<U>& other) const { return allocator == other.allocator; }
  HostAllocator allocator;
};

template <typename T>
using HostVector = std::vector<T, HostStl<T>>;

//! What a pool has given out: a list through its members, which have `previous` and `next`. Never allocates.
template <typename T>
class PoolList {
 public:
  void insert(T* item) {
    item->previous = nullptr;
    item->next = first_;
    if (first_) first_->previous = item;
    first_ = item;
    size_++;
  }
  void erase(T* item) {
    (item->previous ? item->previous->next : first_) = item->next;
    if (item->next) item->next->previous = item->previous;
    size_--;
  }
  T* first() const { return first_; }
  size_t size() const { return size_; }

 private:
  T* first_ = nullptr;
  size_t size_ = 0;
};

}  // namespace pumice::icd
