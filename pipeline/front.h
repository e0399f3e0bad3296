// Scratch memory of one thread of the front end. Internal to pipeline/.
#pragma once

#include "pipeline/pass_impl.h"

namespace pumice::pipeline {

constexpr uint32_t kChunkPrimitives = 512;                //!< of one piece of work of the front end; even, so strips keep their winding
constexpr uint32_t kChunkVertices = kChunkPrimitives * 3;

//! From indices of a chunk to vertex slots. Cleared by counting generations.
class IndexTable {
 public:
  IndexTable() : entries_(kSize) {}
  void clear() { ++generation_; }
  //! The slot of (instance, index); `fresh` when it was not known and now has the slot `next`.
  uint32_t find(uint32_t instance, uint32_t index, uint32_t next, bool& fresh) {
    uint32_t at = (index * 0x9e3779b1u + instance * 0x85ebca6bu) >> (32 - kBits);
    for (;; at = (at + 1) & (kSize - 1)) {
      Entry& e = entries_[at];
      if (e.generation != generation_) {
        e = {generation_, instance, index, next};
        fresh = true;
        return next;
      }
      if (e.index == index && e.instance == instance) {
        fresh = false;
        return e.slot;
      }
    }
  }

 private:
  static constexpr uint32_t kBits = 12, kSize = 1u << kBits;
  static_assert(kSize >= 2 * kChunkVertices, "the table must stay half empty");
  struct Entry { uint64_t generation = 0; uint32_t instance = 0, index = 0, slot = 0; };
  std::vector<Entry> entries_;
  uint64_t generation_ = 0;
};

struct FrontWorker {
  base::Arena arena{256 * 1024};      //!< primitives and planes: lives until the tiles are finished
  base::Arena scratch{256 * 1024};    //!< rows of one chunk
  std::vector<raster::Primitive> primitives;
  std::vector<uint32_t> slots, vertexIndex, vertexInstance;
  IndexTable table;
  raster::SetupCounters setup;
  uint64_t shaded = 0, reused = 0;
};

}  // namespace pumice::pipeline
