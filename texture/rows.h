// Rows of elements in image memory: the common part of copies, clears and presentation.
#pragma once

#include <cstddef>
#include <cstring>

#include "texture/moves.h"
#include "texture/transfer.h"

namespace pumice::texture {

//! Work below this many bytes is done by the calling thread: waking another one costs as much as some hundred kilobytes moved.
constexpr uint64_t kParallelBytes = 1024 * 1024;
//! At least so many bytes are handed to a thread at a time.
constexpr uint64_t kPieceBytes = 64 * 1024;

//! One depth slice of one level, layer, plane and sample.
struct Slice {
  std::byte* base = nullptr;
  const LevelLayout* level = nullptr;
  uint32_t elementBytes = 0;
  bool tiled = false;

  //! Start of the row of blocks (tiled) or row (linear) that holds row y; tiled: at the first element of row y.
  std::byte* row(uint32_t y) const {
    if (!tiled) return base + y * level->rowPitch;
    return base + (y >> 2) * level->rowPitch + uint64_t(blockIndex(0, y)) * elementBytes;
  }
};

inline Slice sliceOf(const ImageMemory& image, const PlaneLayout& plane, uint32_t level, uint32_t layer, uint32_t sample, uint32_t z) {
  const LevelLayout& l = plane.levels[level];
  // Planes of a disjoint image may lie before the first one.
  const uint64_t offset = plane.offset + sample * plane.samplePitch + layer * plane.layerPitch + l.offset + z * l.slicePitch;
  return {image.base + int64_t(offset), &l, plane.elementBytes, image.layout->tiled};
}

//! Copies `count` elements between a row of an image and packed memory. Element 0 is column x.
void readRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* out);
void writeRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, const std::byte* in);
//! The same for rows y to y + 3, y a multiple of 4; packed rows are `pitch` bytes apart. Blocks are touched once. Only rows of
//! linear images know another way to store.
void readFourRows(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* out, uint64_t pitch, Store store = Store::kCached);
void writeFourRows(const Slice& s, uint32_t x, uint32_t y, uint32_t count, const std::byte* in, uint64_t pitch, Store store = Store::kCached);

//! Fills memory with copies of an element.
void fillElements(std::byte* out, uint64_t count, const std::byte* element, uint32_t elementBytes, Store store = Store::kCached);

//! fn(begin, end) over ranges of [0, count), on several threads if there are many bytes.
template <typename Function>
void parallelRanges(base::ThreadPool& pool, uint32_t count, uint64_t bytesEach, Function&& fn) {
  if (uint64_t(count) * bytesEach < kParallelBytes || pool.workerCount() == 1) {
    if (count) fn(0u, count);
    return;
  }
  uint32_t step = uint32_t(kPieceBytes / (bytesEach ? bytesEach : 1));
  step = step ? step : 1;
  uint32_t tasks = count / step + (count % step != 0);
  pool.parallelFor(tasks, [&](uint32_t i, unsigned) {
    uint32_t begin = i * step;
    fn(begin, count - begin < step ? count : begin + step);
  });
}

}  // namespace pumice::texture
