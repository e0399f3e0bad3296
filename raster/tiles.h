// Binning and coverage: which tiles a primitive touches, and inside a tile which 4x4 blocks, as masks.
#pragma once

#include <array>

#include "raster/primitive.h"

namespace pumice::raster {

constexpr uint32_t kTileSize = 64;   //!< pixels; a multiple of the 4x4 block, divides or equals kGridCell

struct TileGrid {
  uint32_t tilesX = 0, tilesY = 0;
  TileGrid() = default;
  uint32_t layers = 1;
  TileGrid(uint32_t width, uint32_t height, uint32_t layerCount = 1)
      : tilesX((width + kTileSize - 1) / kTileSize), tilesY((height + kTileSize - 1) / kTileSize), layers(layerCount) {}
  uint32_t count() const { return tilesX * tilesY * layers; }
  bool operator==(const TileGrid&) const = default;
  static constexpr uint32_t kNotOne = ~0u;
  //! The number of the tile that a primitive lies in as a whole, or kNotOne.
  uint32_t onlyTile(const Primitive& p) const {
    if ((p.minX | p.minY) < 0 || p.minX > p.maxX || p.minY > p.maxY || p.layer >= layers) return kNotOne;
    const uint32_t x = uint32_t(p.minX) / kTileSize, y = uint32_t(p.minY) / kTileSize;
    if (x != uint32_t(p.maxX) / kTileSize || y != uint32_t(p.maxY) / kTileSize || x >= tilesX || y >= tilesY) return kNotOne;
    return (p.layer * tilesY + y) * tilesX + x;
  }
};

//! One entry of a tile's bin: draw and primitive, in API order.
struct BinEntry {
  uint32_t draw;
  bool whole;                      //!< the primitive covers all of the tile
  const Primitive* primitive;
};

//! Bins of one render pass. Filled by one thread per chunk; chunks keep API order, so that parallel filling never changes a tile's order.
class Bins {
 public:
  explicit Bins(TileGrid grid) : grid_(grid), tiles_(grid.count()) {}
  const TileGrid& grid() const { return grid_; }
  //! Bins a primitive into every tile its edges may touch (exact reject of tiles outside an edge).
  void add(uint32_t draw, const Primitive& primitive) { add(draw, primitive, grid_.onlyTile(primitive)); }
  //! The same for one whose onlyTile() is known: then nothing is read of the primitive if it lies in one tile.
  void add(uint32_t draw, const Primitive& primitive, uint32_t onlyTile) {
    if (onlyTile != TileGrid::kNotOne) tiles_[onlyTile].push_back({draw, false, &primitive});
    else addToSome(draw, primitive);
  }
  std::span<const BinEntry> tile(uint32_t index) const { return tiles_[index]; }
  bool empty() const;
  void clear();
 private:
  void addToSome(uint32_t draw, const Primitive& primitive);
  TileGrid grid_;
  std::vector<std::vector<BinEntry>> tiles_;
};

constexpr uint32_t kBlocksPerTile = 256;

//! Number of the 4x4 block at a pixel of the tile: 16x16 squares row by row, blocks within them row by row.
constexpr uint32_t blockNumber(uint32_t x, uint32_t y) { return (y >> 4) << 6 | (x >> 4) << 4 | (y >> 2 & 3) << 2 | (x >> 2 & 3); }
constexpr uint32_t blockX(uint32_t block) { return (block >> 4 & 3) << 4 | (block & 3) << 2; }
constexpr uint32_t blockY(uint32_t block) { return (block >> 6) << 4 | (block >> 2 & 3) << 2; }

//! Blocks of a tile in which a primitive covers something, each at most once, and what it covers there: masks as BlockSink::block() has
//! them, `samples` for each block.
struct BlockList {
  static constexpr uint32_t kCapacity = 64;
  uint32_t count = 0, samples = 1;
  uint8_t numbers[kCapacity + 1];              //!< room for one more that is written and not counted
  uint16_t masks[(kCapacity + 1) * 16];
};

//! Called per 4x4 block with some coverage: block coordinates in pixels (multiples of 4, framebuffer), and per sample a
//! 16-bit mask in quad-major order (texture::blockIndex). `masks` has `samples` entries.
class BlockSink {
 public:
  virtual ~BlockSink() = default;
  virtual void block(uint32_t x, uint32_t y, const uint16_t* masks) = 0;
  //! Before the blocks of a square of 64 or 16 pixels at (x, y): all samples of it are covered (whole), or some may be. True: its
  //! blocks are not wanted. Small primitives come as blocks only.
  virtual bool square(uint32_t, uint32_t, uint32_t, bool) { return false; }
  //! Before that, all squares of 16 pixels in the tile that are covered as a whole, row by row, bit each. Gives those that square() need
  //! not be asked about any more, as their blocks are not wanted.
  virtual uint32_t squares(uint32_t /*whole*/) { return 0; }
  //! Some blocks at once, of the tile whose corner is (tileX, tileY) pixels.
  virtual void blocks(uint32_t tileX, uint32_t tileY, const BlockList& list) {
    for (uint32_t i = 0; i < list.count; i++)
      block(tileX + blockX(list.numbers[i]), tileY + blockY(list.numbers[i]), list.masks + i * list.samples);
  }
};

//! Rasterizes one primitive within tile (tileX, tileY), counted in tiles (64 -> 16 -> 4 descent) at 1, 2, 4, 8 or 16 standard sample locations,
//! limited to `bounds` (scissor and render area).
void rasterize(const Primitive& primitive, uint32_t tileX, uint32_t tileY, const VkRect2D& bounds, uint32_t samples, BlockSink& sink);

//! Standard sample locations in 1/16 pixel (Vulkan spec, "Standard sample locations"); samples = 1 is the centre.
std::span<const std::array<uint8_t, 2>> sampleLocations(uint32_t samples);

//! The record that a fragment routine reads through QuadLoad for one primitive in one grid cell.
//! Bytes: RecordHeader, then per plane {float origin, dx, dy} at kRecordPlanes + 12 * plane, in the order of Primitive::planes;
//! flat varyings: the word at the plane's place (origin), dx = dy = 0. Coordinates are pixel centres relative to the cell's corner.
struct RecordHeader {
  uint32_t frontFacing = 0;   //!< all ones or zero
  uint32_t primitiveId = 0;
  float cellX = 0, cellY = 0; //!< framebuffer coordinates of the cell's corner
  uint32_t layer = 0, viewport = 0;
  float minDepth = 0, maxDepth = 1;   //!< of that viewport
};
constexpr uint32_t kRecordPlanes = sizeof(RecordHeader);
constexpr uint32_t recordBytes(uint32_t varyings) { return kRecordPlanes + 12 * (2 + varyings); }
//! Minimum and maximum depth of a viewport.
struct DepthRange { float low = 0, high = 1; };
//! Fills a record for the grid cell at (cellX, cellY) pixels. Sums are formed in double and rounded once.
void fillRecord(const Primitive& primitive, std::span<const Varying> varyings, uint32_t cellX, uint32_t cellY, std::byte* record,
                const DepthRange& depth = {});

//! The record of the oracle's fragment routines: the same header, but planes of three doubles (flat varyings: 64 bits), not rounded.
//! For primitives of wide rows.
constexpr uint32_t wideRecordBytes(uint32_t varyings) { return kRecordPlanes + 24 * (2 + varyings); }
void fillWideRecord(const Primitive& primitive, std::span<const Varying> varyings, uint32_t cellX, uint32_t cellY, std::byte* record,
                    const DepthRange& depth = {});

}  // namespace pumice::raster
