#include "icd/command_arena.h"

#include <algorithm>
#include <limits>

namespace pumice::icd {
namespace {
// Most command buffers are short. Later chunks are as large as all before them.
constexpr size_t kFirstChunk = 8 * 1024, kLargestChunk = 1024 * 1024;
}  // namespace

void CommandArena::enter(Chunk* chunk) {
  current_ = chunk;
  next_ = reinterpret_cast<uintptr_t>(chunk) + sizeof(Chunk);
  end_ = reinterpret_cast<uintptr_t>(chunk) + chunk->size;
}

void* CommandArena::allocSlow(size_t size, size_t alignment) {
  if (size > std::numeric_limits<size_t>::max() / 2) return nullptr;
  const size_t need = sizeof(Chunk) + size + alignment;
  Chunk** link = current_ ? &current_->following : &first_;
  // A free chunk that is large enough is moved up.
  for (Chunk** candidate = link; *candidate; candidate = &(*candidate)->following) {
    Chunk* chunk = *candidate;
    if (chunk->size < need) continue;
    *candidate = chunk->following;
    chunk->following = *link;
    *link = chunk;
    enter(chunk);
    return allocBytes(size, alignment);
  }
  const size_t bytes = std::max(need, std::clamp(taken_, kFirstChunk, kLargestChunk));
  void* memory = allocator_.allocate(bytes, alignof(Chunk), VK_SYSTEM_ALLOCATION_SCOPE_OBJECT);
  if (!memory) return nullptr;
  Chunk* chunk = new (memory) Chunk{*link, bytes};
  *link = chunk;
  taken_ += bytes;
  enter(chunk);
  return allocBytes(size, alignment);
}

void CommandArena::reset() {
  if (first_) enter(first_);
}

void CommandArena::release() {
  for (Chunk* chunk = first_; chunk;) {
    Chunk* following = chunk->following;
    allocator_.free(chunk);
    chunk = following;
  }
  first_ = current_ = nullptr;
  next_ = end_ = 0;
  taken_ = 0;
}

}  // namespace pumice::icd
