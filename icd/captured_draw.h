// States of draws as a command buffer keeps them: whole, or as what differs from a whole one before. Most draws change little (a dynamic
// offset, a few push constants) of two kilobytes.
#pragma once

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

#include "icd/vulkan.h"
#include "pipeline/execute.h"

namespace pumice::icd {

constexpr size_t kStateChunk = 64;   //!< bytes
constexpr size_t kStateChunks = (sizeof(pipeline::DrawValues) + kStateChunk - 1) / kStateChunk;
using StateChunks = uint64_t;        //!< bit per chunk of DrawValues
static_assert(kStateChunks <= 64 && std::is_trivially_copyable_v<pipeline::DrawValues>);

//! Bytes of chunk `i`; the last one may be shorter.
constexpr size_t stateChunkBytes(size_t i) { return std::min(kStateChunk, sizeof(pipeline::DrawValues) - i * kStateChunk); }

inline std::byte* stateChunk(pipeline::DrawValues& v, size_t i) { return reinterpret_cast<std::byte*>(&v) + i * kStateChunk; }
inline const std::byte* stateChunk(const pipeline::DrawValues& v, size_t i) { return reinterpret_cast<const std::byte*>(&v) + i * kStateChunk; }

struct CapturedDraw {
  const pipeline::DrawState* whole = nullptr;
  StateChunks changed = 0;
  const std::byte* chunks = nullptr;   //!< those that changed, kStateChunk bytes apart
};

constexpr StateChunks kAllStateChunks = ~StateChunks(0) >> (64 - kStateChunks);
//! The lowest of them.
inline size_t lowestChunk(StateChunks chunks) { return size_t(std::countr_zero(chunks)); }

//! Those that hold the bytes from `offset` to `offset + size` (not 0).
constexpr StateChunks chunksOf(size_t offset, size_t size) {
  return ~StateChunks(0) << offset / kStateChunk & ~StateChunks(0) >> (63 - (offset + size - 1) / kStateChunk);
}

//! Those of `among` in which two states differ.
inline StateChunks differingChunks(const pipeline::DrawValues& a, const pipeline::DrawValues& b, StateChunks among) {
  StateChunks differ = 0;
  for (StateChunks left = among; left; left &= left - 1) {
    const size_t i = lowestChunk(left);
    differ |= StateChunks(std::memcmp(stateChunk(a, i), stateChunk(b, i), stateChunkBytes(i)) != 0) << i;
  }
  return differ;
}

//! Puts captured states together again, on the queue's thread.
class StateReader {
 public:
  //! Valid until the next call.
  const pipeline::DrawState& read(const CapturedDraw& c) {
    if (!c.changed) return *c.whole;
    if (whole_ != c.whole) {
      state_ = *c.whole;
      whole_ = c.whole;
    } else {
      for (StateChunks left = changed_ & ~c.changed; left; left &= left - 1) put(lowestChunk(left), stateChunk(*whole_, lowestChunk(left)));
    }
    changed_ = c.changed;
    const std::byte* from = c.chunks;
    for (StateChunks left = changed_; left; left &= left - 1, from += kStateChunk) put(lowestChunk(left), from);
    return state_;
  }
  //! Before a captured state may end.
  void forget() {
    state_ = {};
    whole_ = nullptr;
  }

 private:
  void put(size_t i, const std::byte* from) { std::memcpy(stateChunk(state_, i), from, stateChunkBytes(i)); }
  pipeline::DrawState state_;
  const pipeline::DrawState* whole_ = nullptr;   //!< what state_ is made from, with
  StateChunks changed_ = 0;
};

}  // namespace pumice::icd
