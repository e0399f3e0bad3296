// The back end for one tile. Internal to pipeline/.
#pragma once

#include "pipeline/one_color.h"
#include "pipeline/quad_row.h"
#include "raster/visibility.h"

namespace pumice::pipeline {

//! Takes a tile's bin in order: opaque runs through raster::Visibility, whose winners are then shaded; other draws fragment by fragment.
//! One per thread.
struct TileWorker final : raster::BlockSink {
  TileWorker(PassExecutor::Impl& pass, Ideas disabled);
  //! Once per flush.
  void begin() { row_.begin(); }
  void tile(uint32_t index);
  //! At the end of the pass, where Impl::oneColor has attachments.
  void finish(uint32_t index) { colors_.setTile(index), colors_.finish(); }
  void block(uint32_t x, uint32_t y, const uint16_t* masks) override;
  bool square(uint32_t x, uint32_t y, uint32_t size, bool whole) override;
  //! Adds to the pass's counters, and starts from zero.
  void takeCounters(PassCounters& c);

 private:
  void loadOps(const VkRect2D& rect);
  void loadDepth(const VkRect2D& rect);
  void countBytes(const VkRect2D& rect);
  void clear(const DrawRecord& draw, const VkRect2D& rect);
  //! Load operations that were put off, but for blocks (bit each) that `colors` are about to be written to as a whole.
  void finishClears(const uint64_t* written = nullptr, uint32_t colors = 0);
  void opaque(DrawRecord& draw, const raster::Primitive& primitive, bool whole);
  void other(DrawRecord& draw, const raster::Primitive& primitive);
  void setOpaqueDraw(DrawRecord* draw);
  //! Shades what is pending.
  void settle();

  PassExecutor::Impl& pass_;
  const bool hiZ_, lazyClear_;
  uint32_t lateClears_ = 0;                  //!< colour attachments, bit each, whose load operation is still to be done
  VkRect2D tileRect_{};                      //!< of the tile, inside of the render area
  uint32_t tileX_ = 0, tileY_ = 0, layer_ = 0;
  OneColor colors_;
  QuadRow row_;
  raster::Visibility visibility_;
  bool depthKnown_ = false;                  //!< the visibility has the tile's depth attachment

  DrawRecord* run_ = nullptr;                //!< the opaque draw that primitives came from last
  // The primitive of another draw
  const raster::Primitive* primitive_ = nullptr;
  const std::byte* record_ = nullptr;        //!< null: not made yet
  DrawRecord* draw_ = nullptr;
  bool rejects_ = false, writes_ = false;    //!< Hi-Z may drop blocks; depth bounds change

  uint64_t rejected_ = 0;                    //!< samples
  uint64_t cleared_ = 0, loaded_ = 0, stored_ = 0;   //!< bytes
};

}  // namespace pumice::pipeline
