// Visibility of squares of 16x16 pixels that a primitive covers as a whole: what is the same for all of their blocks is kept once.
#include <algorithm>
#include <bit>
#include <cstring>

#include "raster/visibility.h"

namespace pumice::raster {
namespace {
constexpr uint32_t kTileMask = kTileSize - 1;

// Set bits of sixteen, in a few operations that every processor has.
inline uint32_t countSquares(uint32_t v) {
  v -= v >> 1 & 0x5555;
  v = (v & 0x3333) + (v >> 2 & 0x3333);
  v = (v + (v >> 4)) & 0x0f0f;
  return (v + (v >> 8)) & 0x1f;
}
}  // namespace

void Visibility::spreadSquare(uint32_t square) {
  const uint32_t first = square * 16, bit = 1u << square;
  if (lazyOwner_ & bit) {
    std::fill_n(owner_ + first, 16, squareOwner_[square]);
    lazyOwner_ &= ~bit;
  }
  if (!(lazyDepth_ & bit)) return;
  lazyDepth_ &= ~bit;
  const uint16_t source = squareSource_[square];
  std::fill_n(source_ + first, 16, source);
  if (source != kMemory && source != kClear) {
    kernels_.boundsOfBlocks(entries_[source - 1].depth, memory_.kind, placesOf(blockX(first), blockY(first), 4), low_ + first, high_ + first);
    return;
  }
  std::fill_n(low_ + first, 16, squareLow_[square]);
  std::fill_n(high_ + first, 16, squareHigh_[square]);
}

void Visibility::spreadAll() {
  for (uint32_t left = lazyDepth_ | lazyOwner_; left; left &= left - 1) spreadSquare(uint32_t(std::countr_zero(left)));
}

//! The primitive takes all of them.
void Visibility::ownSquares(uint32_t squares) {
  const uint64_t samples = uint64_t(256) * samples_ * countSquares(squares);
  counters.passed += samples;
  drawPassed += samples;
  if (!shaded_) return;
  runPassed_ += samples;
  const uint16_t n = number();
  lazyOwner_ |= squares;
  if (squares == 0xffff) {
    std::fill(std::begin(squareOwner_), std::end(squareOwner_), n);
    std::fill(std::begin(pending_), std::end(pending_), ~uint64_t(0));
    return;
  }
  for (uint32_t left = squares; left; left &= left - 1) {
    const uint32_t square = uint32_t(std::countr_zero(left));
    squareOwner_[square] = n;
    pending_[square >> 2] |= uint64_t(0xffff) << ((square & 3) * 16);
  }
}

uint32_t Visibility::squares(uint32_t whole) {
  if (maskedOut_) return 0;
  const uint32_t count = countSquares(whole), samples = 256 * samples_;
  counters.fragments += 256 * count;
  counters.tested += uint64_t(samples) * count;
  if (!test_.test) {
    ownSquares(whole);
  } else {
    alignas(64) float low[16], high[16];
    SquareOutcomes outcomes{};
    if (hiZ_ && tame_) {
      for (uint32_t stale = staleSquares_ & whole; stale; stale &= stale - 1) squareBounds(uint32_t(std::countr_zero(stale)));
      outcomes = kernels_.testSquares(equation_, memory_.kind, test_.compare, placesOf(0, 0, 16), squareLow_, squareHigh_, low, high);
    }
    counters.rejected += uint64_t(samples) * countSquares(outcomes.fails & whole);
    if (const uint32_t passes = outcomes.passes & whole) {
      ownSquares(passes);
      if (test_.write) {
        const uint16_t n = number();
        lazyDepth_ |= passes;
        tileKnown_ = false;
        staleSquares_ &= ~passes;
        if (passes == 0xffff) {
          std::fill(std::begin(squareSource_), std::end(squareSource_), n);
          std::fill(std::begin(virtual_), std::end(virtual_), ~uint64_t(0));
          std::memcpy(squareLow_, low, sizeof low);
          std::memcpy(squareHigh_, high, sizeof high);
        }
        for (uint32_t left = passes == 0xffff ? 0 : passes; left; left &= left - 1) {
          const uint32_t square = uint32_t(std::countr_zero(left));
          squareSource_[square] = n;
          squareLow_[square] = low[square];
          squareHigh_[square] = high[square];
          virtual_[square >> 2] |= uint64_t(0xffff) << ((square & 3) * 16);
        }
      }
    }
    for (uint32_t open = whole & ~(outcomes.fails | outcomes.passes); open; open &= open - 1) {
      const uint32_t square = uint32_t(std::countr_zero(open)), first = square * 16;
      spread(square);
      if (hiZ_ && tame_) kernels_.boundsOfBlocks(equation_, memory_.kind, placesOf(blockX(first), blockY(first), 4), low, high);
      else std::fill_n(low, 16, own_.low), std::fill_n(high, 16, own_.high);
      for (uint32_t i = 0; i < 16; i++) full(first + i, {low[i], high[i]});
    }
  }
  if (!squares_) spreadAll();
  return whole;
}

bool Visibility::square(uint32_t x, uint32_t y, uint32_t size, bool whole) {
  const uint32_t square = blockNumber(x & kTileMask, y & kTileMask) >> 4;
  if (whole && !maskedOut_) return squares(size > 16 ? 0xffff : 1u << square) != 0;
  if (!hiZ_ || exact_ || !test_.test || size > 16) return false;
  const KeyBounds mine = tame_ ? kernels_.bounds(equation_, memory_.kind, placesOf(x & kTileMask, y & kTileMask, size)) : own_;
  return compareBounds(test_.compare, mine, squareBounds(square)) == Outcome::Fails;
}

}  // namespace pumice::raster
