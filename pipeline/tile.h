// The back end for one tile. Internal to pipeline/.
#pragma once

#include "pipeline/pass_impl.h"

namespace pumice::pipeline {

//! Collects quads of one draw, in order, into rows of up to 32 and runs the fragment routine over them. One per thread.
struct TileWorker final : raster::BlockSink {
  static constexpr uint32_t kQuads = interp::kMaxLanes / 4;
  static constexpr uint32_t kMaxPitches = kMaxColorAttachments + 2;

  explicit TileWorker(PassExecutor::Impl& pass) : pass_(pass) {}
  //! Once per flush: where the attachments lie.
  void begin();
  void tile(uint32_t index);
  void block(uint32_t x, uint32_t y, const uint16_t* masks) override;

  uint64_t quads = 0, fragments = 0, shaded = 0, tested = 0, passed = 0;
  uint64_t cleared = 0, loaded = 0, stored = 0;   //!< bytes

 private:
  void loadOps(const VkRect2D& rect);
  void countBytes(const VkRect2D& rect);
  void setPlanes();
  void run(interp::ExecContext& context);
  void runPerSample(const interp::ExecContext& row);
  void setDraw(DrawRecord* draw);
  void flushQuads();

  PassExecutor::Impl& pass_;
  uint32_t tileX_ = 0, tileY_ = 0, layer_ = 0;
  uint32_t planesLayer_ = 0;               //!< that planes_ point to
  DrawRecord* draw_ = nullptr;
  const raster::Primitive* primitive_ = nullptr;
  const std::byte* record_ = nullptr;      //!< of the primitive in this tile; null: not made yet
  base::Arena records_{64 * 1024};
  size_t recordBytes_ = 0;                 //!< in use since the last reset
  uint64_t occluded_ = 0;                  //!< samples passed, not yet added to the draw's counter
  uint64_t invocations_ = 0;               //!< the same for its statistics query

  uint32_t count_ = 0;                     //!< quads pending
  uint64_t pending_[16] = {};              //!< bit per quad of the tile: is in the row
  uint16_t position_[kQuads] = {};
  const std::byte* quadRecords_[kQuads] = {};
  uint64_t active_[interp::kMaxLanes / 64] = {};

  uint32_t pitches_[kMaxPitches] = {};     //!< distinct rowElements
  uint32_t pitchCount_ = 0;
  alignas(64) float x_[interp::kMaxLanes] = {};
  alignas(64) float y_[interp::kMaxLanes] = {};
  alignas(64) uint32_t coverage_[interp::kMaxLanes] = {};
  alignas(64) uint32_t passedRow_[interp::kMaxLanes] = {};
  alignas(64) uint32_t shadedRow_[interp::kMaxLanes] = {};
  alignas(64) uint32_t elements_[kMaxPitches][kQuads] = {};
  interp::TilePlane planes_[interp::kMaxTilePlanes];
  // For shading per sample
  alignas(64) float sampleX_[interp::kMaxLanes] = {};
  alignas(64) float sampleY_[interp::kMaxLanes] = {};
  alignas(64) uint32_t sampleNumber_[interp::kMaxLanes] = {};
};

}  // namespace pumice::pipeline
