// Blocks of multisampled colour attachments whose samples all have the same colours (docs/architecture.md, "One colour"). Internal to
// pipeline/.
#pragma once

#include <bit>

#include "pipeline/pass_impl.h"

namespace pumice::pipeline {

//! The 4x4 blocks (raster::blockNumber) of one tile, for each attachment of Impl::oneColor: a set bit says that the first sample's plane
//! holds the colours of all samples, and that the other planes are out of date. The bits are the pass's (Impl::oneColorBits), so
//! that they live from flush to flush; at the pass's end finish() leaves memory as everybody else expects it.
class OneColor {
 public:
  explicit OneColor(PassExecutor::Impl& pass) : pass_(pass) {}
  void setTile(uint32_t tile);

  // `colors`: attachments, bit each, of Impl::oneColor. Blocks [first, first + count) lie in one word of 64.

  //! Whether fragments that cover all of the blocks may write the first sample alone, for all the rest. `replaced`: attachments of which
  //! nothing is left that was there before.
  bool takes(uint32_t first, uint32_t count, uint32_t colors, uint32_t replaced) const {
    bool all = true;
    for (uint32_t left = colors & ~replaced; left; left &= left - 1) {
      const uint64_t m = mask(first, count);
      all &= (word(left, first) & m) == m;
    }
    return all;
  }
  //! They will have done so when next anybody looks.
  void take(uint32_t first, uint32_t count, uint32_t colors) {
    for (; colors; colors &= colors - 1) word(colors, first) |= mask(first, count);
  }
  bool any(uint32_t first, uint32_t count, uint32_t colors) const {
    uint64_t found = 0;
    for (; colors; colors &= colors - 1) found |= word(colors, first) & mask(first, count);
    return found != 0;
  }
  //! Samples are about to differ: gives all planes what they mean.
  void split(uint32_t first, uint32_t count, uint32_t colors) {
    if (any(first, count, colors)) splitBlocks(first, count, colors);
  }
  //! Somebody is about to read samples.
  void splitAll();
  //! The end of the pass: resolves the tile and completes the planes that are stored.
  void finish();

  uint64_t splits = 0, kept = 0, stored = 0;   //!< PassCounters::blocksSplit, ...OneColor, ...Stored

 private:
  static uint64_t mask(uint32_t first, uint32_t count) { return (count == 64 ? ~uint64_t(0) : (uint64_t(1) << count) - 1) << (first & 63); }
  //! Of the lowest attachment of a set.
  uint64_t& word(uint32_t colors, uint32_t block) const { return bits_[uint32_t(std::countr_zero(colors)) * 4 + (block >> 6)]; }
  void splitBlocks(uint32_t first, uint32_t count, uint32_t colors);
  void complete(uint32_t attachment, uint32_t block) const;

  PassExecutor::Impl& pass_;
  uint64_t* bits_ = nullptr;
  uint32_t tileX_ = 0, tileY_ = 0, layer_ = 0;
};

}  // namespace pumice::pipeline
