// Tiles of an image that a pass has cleared and not drawn to: they are known by their one element, and memory is written only when somebody
// else than presentation looks at it. For images that no shader reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "texture/transfer.h"

namespace pumice::texture {

//! Of level 0, layer 0 of an image with elements of at most 16 bytes. Different tiles may be changed by different threads at once.
struct ClearedTiles {
  static constexpr uint32_t kEdge = 64;   //!< pixels
  ClearedTiles(uint32_t width, uint32_t height) : across((width + kEdge - 1) / kEdge), down((height + kEdge - 1) / kEdge), marks(size_t(across) * down) {}

  uint32_t across, down;
  std::vector<uint8_t> marks;             //!< by tile: 1: it holds `element` alone, and its memory something else
  std::byte element[16] = {};

  uint8_t& mark(uint32_t x, uint32_t y) { return marks[size_t(y) * across + x]; }
  //! How many pixels from column x (a multiple of 64) on, in the row of tiles y, have the same mark; up to `width`.
  uint32_t run(uint32_t x, uint32_t y, uint32_t width) {
    uint32_t end = x / kEdge;
    const uint8_t first = mark(end, y);
    while (end < across && mark(end, y) == first) ++end;
    return (end * kEdge < width ? end * kEdge : width) - x;
  }
};

//! Writes what is only marked; nothing is marked afterwards. `cleared` may be null.
void writeCleared(const ImageMemory& image);
void writeClearedTile(const ImageMemory& image, uint32_t tileX, uint32_t tileY);

}  // namespace pumice::texture
