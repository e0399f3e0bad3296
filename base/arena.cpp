#include "base/arena.h"
#include "base/arena_slices.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <mutex>
#include <vector>
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace pumice::base {

namespace {
constexpr size_t kLargestRegularChunk = 1024 * 1024;
// Arenas that have grown large take slices of whole huge pages: a tenth of the page faults, and no TLB misses to speak of when what they
// hold is read in another order. Slices go back when an arena is reset: threads that share work in other parts each time need no more than
// what all of them use at once.
constexpr size_t kHugePage = 2 * 1024 * 1024, kSlice = 256 * 1024;
constexpr size_t kBlocksKept = 24;   //!< that nobody uses

void* hugePages(size_t bytes) {
  void* memory = std::aligned_alloc(kHugePage, bytes);
#if defined(__linux__)
  if (memory) ::madvise(memory, bytes, MADV_HUGEPAGE);   // a hint
#endif
  return memory;
}

class Slices {
 public:
  constexpr Slices() = default;
  ~Slices() { trimTo(0); }
  //! Null if memory is exhausted.
  void* take() {
    std::lock_guard lock(mutex_);
    for (size_t i = blocks_.size(); i-- > 0;)   // the latest ones: the others may come to be unused
      if (blocks_[i].used != kAll) return take(blocks_[i]);
    try {
      blocks_.reserve(blocks_.size() + 1);
    } catch (const std::bad_alloc&) {
      return nullptr;
    }
    auto* memory = static_cast<std::byte*>(hugePages(kHugePage));
    if (!memory) return nullptr;
    blocks_.push_back({memory, 0});
    return take(blocks_.back());
  }
  //! False: it is not a slice.
  bool give(void* memory) {
    const uintptr_t address = reinterpret_cast<uintptr_t>(memory);
    if (address % kSlice) return false;
    std::lock_guard lock(mutex_);
    for (Block& b : blocks_) {
      const uintptr_t at = address - reinterpret_cast<uintptr_t>(b.memory);
      if (at >= kHugePage) continue;
      b.used &= uint8_t(~(1u << at / kSlice));
      if (!b.used) trimTo(kBlocksKept);
      return true;
    }
    return false;
  }
  void trim() {
    std::lock_guard lock(mutex_);
    trimTo(0);
  }
  size_t footprint() {
    std::lock_guard lock(mutex_);
    return blocks_.size() * kHugePage;
  }

 private:
  static constexpr uint8_t kAll = 0xff;
  static_assert(kHugePage / kSlice == 8);
  struct Block {
    std::byte* memory;
    uint8_t used;   //!< bit per slice
  };
  void* take(Block& b) {
    const unsigned slice = unsigned(std::countr_one(b.used));
    b.used |= uint8_t(1u << slice);
    return b.memory + slice * kSlice;
  }
  void trimTo(size_t kept) {
    size_t unused = size_t(std::count_if(blocks_.begin(), blocks_.end(), [](const Block& b) { return !b.used; }));
    if (unused <= kept) return;
    std::erase_if(blocks_, [&](const Block& b) {
      if (b.used || unused <= kept) return false;
      --unused;
      std::free(b.memory);
      return true;
    });
  }
  std::mutex mutex_;
  std::vector<Block> blocks_;
};
constinit Slices slices;
}

void trimArenaSlices() { slices.trim(); }
size_t arenaSlicesFootprint() { return slices.footprint(); }

void Arena::enter(Chunk* chunk) {
  current_ = chunk;
  next_ = reinterpret_cast<uintptr_t>(chunk) + sizeof(Chunk);
  end_ = reinterpret_cast<uintptr_t>(chunk) + chunk->size;
}

void* Arena::allocSlow(size_t size, size_t alignment) {
  if (size > std::numeric_limits<size_t>::max() / 2) return nullptr;
  const size_t need = sizeof(Chunk) + size + alignment;

  // A chunk kept by reset() that is large enough is moved up to be the next one.
  Chunk** link = current_ ? &current_->following : &first_;
  for (Chunk** candidate = link; *candidate; candidate = &(*candidate)->following) {
    if ((*candidate)->size < need) continue;
    Chunk* chunk = *candidate;
    *candidate = chunk->following;
    chunk->following = *link;
    *link = chunk;
    enter(chunk);
    return allocBytes(size, alignment);
  }

  size_t regular = std::min(std::max(chunkSize_, footprint_), std::max(chunkSize_, kLargestRegularChunk));
  size_t bytes = std::max(need, regular);
  void* memory;
  if (footprint_ < kHugePage / 2 || need > kHugePage) memory = std::malloc(bytes);
  else if (need <= kSlice) memory = slices.take(), bytes = kSlice;
  else memory = hugePages(bytes = kHugePage);
  auto* chunk = static_cast<Chunk*>(memory);
  if (!chunk) return nullptr;
  chunk->size = bytes;
  chunk->following = *link;
  *link = chunk;
  footprint_ += bytes;
  enter(chunk);
  return allocBytes(size, alignment);
}

std::string_view Arena::copyString(std::string_view text) {
  auto* characters = static_cast<char*>(allocBytes(text.size() + 1, 1));
  if (!characters) return {};
  std::memcpy(characters, text.data(), text.size());
  characters[text.size()] = 0;
  return {characters, text.size()};
}

void Arena::reset() {
  for (Chunk** link = &first_; footprint_ > kHugePage / 2 && *link;) {
    Chunk* chunk = *link;
    Chunk* following = chunk->following;
    const size_t size = chunk->size;
    if (size == kSlice && slices.give(chunk)) {
      *link = following;
      footprint_ -= size;
    } else {
      link = &chunk->following;
    }
  }
  current_ = nullptr;
  next_ = end_ = 0;
  if (first_) enter(first_);
}

void Arena::release() {
  for (Chunk* chunk = first_; chunk;) {
    Chunk* following = chunk->following;
    if (chunk->size != kSlice || !slices.give(chunk)) std::free(chunk);
    chunk = following;
  }
  first_ = current_ = nullptr;
  next_ = end_ = 0;
  footprint_ = 0;
}

void Arena::swap(Arena& other) noexcept {
  std::swap(first_, other.first_);
  std::swap(current_, other.current_);
  std::swap(next_, other.next_);
  std::swap(end_, other.end_);
  std::swap(chunkSize_, other.chunkSize_);
  std::swap(footprint_, other.footprint_);
}

}  // namespace pumice::base
