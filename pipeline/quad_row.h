// Rows of fragments: quads of one draw, gathered from as many primitives as it takes, run by the draw's fragment routine. Internal
// to pipeline/; one per thread.
#pragma once

#include "pipeline/one_color.h"

namespace pumice::pipeline {

class QuadRow {
 public:
  static constexpr uint32_t kQuads = interp::kMaxLanes / 4;
  static constexpr uint32_t kMaxPitches = kMaxColorAttachments + 3;
  static constexpr uint32_t kBlocks = kQuads / 4;   //!< of a row of whole blocks

  //! `colors`: of the tile at hand.
  QuadRow(PassExecutor::Impl& pass, OneColor& colors) : pass_(pass), colors_(colors) {}
  //! Once per flush of the pass: where the attachments lie.
  void begin() { setPlanes(0); }
  //! The tile that quads come from now. The row is empty.
  void setTile(uint32_t tileX, uint32_t tileY, uint32_t layer) {
    tileX_ = tileX, tileY_ = tileY;
    wholePlanesReady_ = false;
    if (layer != planesLayer_) setPlanes(layer);
  }
  //! Quads come from this draw now.
  void setDraw(DrawRecord* draw);
  DrawRecord* draw() const { return draw_; }
  //! Adds the covered quads of a block (pixels of the framebuffer, one quad-major mask per sample). Each pixel sees its fragments in
  //! order: a row runs before a quad comes again. `apart`: no pixel ever comes twice, so that need not be looked at.
  void add(uint32_t x, uint32_t y, const uint16_t* masks, const std::byte* record, bool apart);
  //! The same for what a settled draw won of a block of the tile at hand: no pixel ever comes twice.
  void addSettled(uint32_t block, const uint16_t* masks, const std::byte* record);
  void flush();
  //! The same for blocks [first, first + count) of the tile, multiples of kBlocks, all covered: they are rows of their own and run at
  //! once. False: nothing was done, the draw has no routine for such rows (yet).
  bool addWholeRows(uint32_t first, uint32_t count, const std::byte* record, bool apart);
  //! Whether it may ever do so for the draw at hand.
  bool takesWholeRows() const { return whole_; }

  //! A primitive's record in this tile. `generation` says which records are still there. Null: out of memory.
  const std::byte* makeRecord(const raster::Primitive& primitive, const DrawRecord& draw);
  uint32_t generation() const { return generation_; }
  void dropRecords();

  uint64_t quads = 0, fragments = 0, shaded = 0, tested = 0, passed = 0;

 private:
  void setPlanes(uint32_t layer);
  void setWholePlanes();
  bool inUnit(uint32_t first, uint32_t count, const std::byte* record) const;
  void addQuad(uint32_t quad, uint32_t lanes, uint32_t block, float x, float y, const uint16_t* masks, const std::byte* record);
  void addWhole(uint32_t block, float x, float y, bool oneColor, const std::byte* record);
  void run(interp::ExecContext& context);
  void runPerSample(const interp::ExecContext& row);

  PassExecutor::Impl& pass_;
  OneColor& colors_;
  uint32_t tileX_ = 0, tileY_ = 0;
  uint32_t planesLayer_ = 0;               //!< that planes_ point to
  DrawRecord* draw_ = nullptr;
  uint32_t samples_ = 1;
  bool helpers_ = false, counts_ = false;
  base::Arena records_{64 * 1024};
  size_t recordBytes_ = 0;                 //!< in use since the last reset
  uint32_t generation_ = 1;
  uint64_t occluded_ = 0;                  //!< samples passed, not yet added to the draw's counter
  uint64_t invocations_ = 0;               //!< the same for its statistics query

  uint32_t count_ = 0;                     //!< quads pending
  bool oneRecord_ = true;                  //!< of all of them
  uint8_t pending_[raster::kBlocksPerTile] = {};   //!< bit per quad of the block: is in the row
  uint32_t oneColorQuads_ = 0;             //!< bit each: their first sample stands for all (one_color.h)
  uint8_t blocks_[kQuads] = {};            //!< that the row's quads lie in
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
  interp::TilePlane planes_[kRowPlanes];
  // Rows of whole blocks: quads' elements relative to the tile's first, planes from there on.
  struct UsedPlane { uint32_t plane, pitch, elementBytes; };
  bool whole_ = false, unit_ = false, wholePlanesReady_ = false;
  std::vector<uint32_t> tileElements_[kMaxPitches];
  uint32_t tileElementsPitch_[kMaxPitches] = {};
  UsedPlane usedPlanes_[kRowPlanes];
  uint32_t usedPlaneCount_ = 0;
  interp::TilePlane wholePlanes_[kRowPlanes];
  const std::byte* wholeRecords_[kQuads] = {};
  alignas(64) uint32_t wholeCoverage_[interp::kMaxLanes] = {};
  // For shading per sample
  alignas(64) float sampleX_[interp::kMaxLanes] = {};
  alignas(64) float sampleY_[interp::kMaxLanes] = {};
  alignas(64) uint32_t sampleNumber_[interp::kMaxLanes] = {};
};

}  // namespace pumice::pipeline
