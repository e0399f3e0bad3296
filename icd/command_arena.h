// Memory of recorded commands: taken in small pieces from chunks of the pool's allocator, given back all at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "icd/object.h"

namespace pumice::icd {

class CommandArena {
 public:
  explicit CommandArena(const HostAllocator& allocator) : allocator_(allocator) {}
  ~CommandArena() { release(); }
  CommandArena(const CommandArena&) = delete;
  CommandArena& operator=(const CommandArena&) = delete;

  //! Uninitialised; alignment is a power of two up to 64. Null if memory is exhausted.
  void* allocBytes(size_t size, size_t alignment = alignof(std::max_align_t)) {
    const uintptr_t start = (next_ + alignment - 1) & ~uintptr_t(alignment - 1);
    if (start && start <= end_ && size <= end_ - start) [[likely]] {
      next_ = start + size;
      return reinterpret_cast<void*>(start);
    }
    return allocSlow(size, alignment);
  }
  //! A copy that lives as long as the contents. data() is null if memory is exhausted.
  template <typename T>
  std::span<T> copy(std::span<const T> source) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (source.empty()) return {};
    auto* array = static_cast<T*>(allocBytes(source.size_bytes(), alignof(T)));
    if (!array) return {};
    std::memcpy(static_cast<void*>(array), source.data(), source.size_bytes());
    return {array, source.size()};
  }
  //! Forgets the contents; the chunks stay for what comes next.
  void reset();
  //! Gives the chunks back.
  void release();

 private:
  struct alignas(64) Chunk {
    Chunk* following;
    size_t size;   //!< with this header
  };
  void* allocSlow(size_t size, size_t alignment);
  void enter(Chunk* chunk);

  HostAllocator allocator_;
  Chunk* first_ = nullptr;
  Chunk* current_ = nullptr;   //!< those that follow it are free
  uintptr_t next_ = 0, end_ = 0;
  size_t taken_ = 0;           //!< bytes of all chunks
};

}  // namespace pumice::icd
