// Coverage of small boxes, all edges and sixteen pixels at a time. Internal to raster/.
#pragma once

#include "raster/tiles.h"

namespace pumice::raster {

//! Inclusive rectangle of pixels within a tile.
struct TileBox {
  int x0, y0, x1, y1;
};

constexpr int kMostBoxBlocks = 8;   //!< in each direction
static_assert(kMostBoxBlocks * kMostBoxBlocks <= BlockList::kCapacity);

//! The covered blocks of a box of at most 8x8 blocks in the tile whose corner is (originX, originY), as rasterize() gives them: `list` is
//! empty before. `locations`: one for each sample. False: nothing was done, the edges are too long.
using CoverBox = bool (*)(const Primitive& primitive, int originX, int originY, const TileBox& box,
                          std::span<const std::array<uint8_t, 2>> locations, BlockList& list);

//! For this processor, no better than PUMICE_ISA allows. Null: there is none.
CoverBox coverBox();

}  // namespace pumice::raster
