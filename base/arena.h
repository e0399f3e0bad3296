// Memory that is taken in small pieces and given back all at once: recorded commands, IR, bins.
//
// An Arena is used by one thread at a time. Destructors of what it holds are never run, so it takes only
// trivially destructible types. Out of memory is a null pointer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

namespace pumice::base {

class Arena {
 public:
  static constexpr size_t kDefaultChunkSize = 64 * 1024;
  static constexpr size_t kMaxAlignment = 4096;

  // The size, in bytes, of the first chunk; later ones grow with what has been used, up to 1 MiB.
  explicit Arena(size_t chunkSize = kDefaultChunkSize) : chunkSize_(chunkSize) {}
  ~Arena() { release(); }
  Arena(Arena&& other) noexcept { swap(other); }
  Arena& operator=(Arena&& other) noexcept {
    Arena(std::move(other)).swap(*this);
    return *this;
  }
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  // Uninitialised bytes; alignment is a power of two up to kMaxAlignment. Null if memory is exhausted.
  void* allocBytes(size_t size, size_t alignment = alignof(std::max_align_t)) {
    uintptr_t start = (next_ + alignment - 1) & ~uintptr_t(alignment - 1);
    if (start <= end_ && size <= end_ - start && start != 0) [[likely]] {
      next_ = start + size;
      return reinterpret_cast<void*>(start);
    }
    return allocSlow(size, alignment);
  }

  // An array of count default-initialised elements (plain numbers are uninitialised).
  template <typename T>
  T* alloc(size_t count = 1, size_t alignment = alignof(T)) {
    static_assert(std::is_trivially_destructible_v<T>, "an Arena never runs destructors");
    if (count > std::numeric_limits<size_t>::max() / sizeof(T)) return nullptr;
    T* array = static_cast<T*>(allocBytes(count * sizeof(T), alignment));
    if constexpr (!std::is_trivially_default_constructible_v<T>) {
      if (array)
        for (size_t i = 0; i < count; i++) new (array + i) T;
    }
    return array;
  }

  // One object made from the arguments.
  template <typename T, typename... Args>
  T* make(Args&&... args) {
    static_assert(std::is_trivially_destructible_v<T>, "an Arena never runs destructors");
    void* place = allocBytes(sizeof(T), alignof(T));
    return place ? new (place) T{std::forward<Args>(args)...} : nullptr;
  }

  // A copy that lives as long as the arena's contents. data() is null if memory is exhausted.
  template <typename T>
  std::span<T> copy(std::span<const T> source) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (source.empty()) return {};
    T* array = static_cast<T*>(allocBytes(source.size_bytes(), alignof(T)));
    if (!array) return {};
    std::memcpy(static_cast<void*>(array), source.data(), source.size_bytes());
    return {array, source.size()};
  }
  std::string_view copyString(std::string_view text);

  // Forgets the contents and keeps the chunks for what comes next.
  void reset();

  // Forgets the contents and gives all memory back.
  void release();

  // Bytes taken from the system.
  size_t footprint() const { return footprint_; }

  void swap(Arena& other) noexcept;

 private:
  struct Chunk {
    Chunk* following;
    size_t size;  // with this header
  };

  void* allocSlow(size_t size, size_t alignment);
  void enter(Chunk* chunk);

  Chunk* first_ = nullptr;
  Chunk* current_ = nullptr;  // chunks behind it are unused
  uintptr_t next_ = 0;
  uintptr_t end_ = 0;
  size_t chunkSize_ = kDefaultChunkSize;
  size_t footprint_ = 0;
};

}  // namespace pumice::base
