#include "pipeline/quad_row.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace pumice::pipeline {

namespace {

constexpr uint32_t kTileMask = raster::kTileSize - 1;
constexpr size_t kRecordBudget = 512 * 1024;
static_assert(raster::kTileSize == raster::kGridCell, "a record serves a whole tile");

//! Places of a block's pixels, quad-major, relative to its corner.
alignas(64) constexpr float kPlaceX[16] = {.5f, 1.5f, .5f, 1.5f, 2.5f, 3.5f, 2.5f, 3.5f, .5f, 1.5f, .5f, 1.5f, 2.5f, 3.5f, 2.5f, 3.5f};
alignas(64) constexpr float kPlaceY[16] = {.5f, .5f, 1.5f, 1.5f, .5f, .5f, 1.5f, 1.5f, 2.5f, 2.5f, 3.5f, 3.5f, 2.5f, 2.5f, 3.5f, 3.5f};

//! Four lanes of ones and zeros from their bits.
struct LaneWords {
  alignas(64) uint32_t words[16][4] = {};
};
constexpr LaneWords kLaneWords = [] {
  LaneWords t;
  for (uint32_t bits = 0; bits < 16; ++bits)
    for (uint32_t l = 0; l < 4; ++l) t.words[bits][l] = bits >> l & 1;
  return t;
}();

//! Places of a tile's pixels block by block (raster::blockNumber), for one column or row of 16x16 squares.
struct SquarePlaces {
  alignas(64) float x[4][256] = {}, y[4][256] = {};
};
constexpr SquarePlaces kSquarePlaces = [] {
  SquarePlaces p;
  for (uint32_t square = 0; square < 4; ++square)
    for (uint32_t lane = 0; lane < 256; ++lane) {
      p.x[square][lane] = float(square * 16 + (lane >> 4 & 3) * 4) + kPlaceX[lane & 15];
      p.y[square][lane] = float(square * 16 + (lane >> 6) * 4) + kPlaceY[lane & 15];
    }
  return p;
}();

//! Masks of a block that the first sample stands for.
constexpr uint16_t kFirstSample[16] = {0xffff};

// Four lanes at once, on any processor (GCC and Clang know vectors).
typedef float Float4 __attribute__((vector_size(16)));
typedef uint32_t Word4 __attribute__((vector_size(16)));
template <typename V>
inline V load4(const void* from) {
  V v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <typename V>
inline void store4(void* to, V v) {
  std::memcpy(to, &v, sizeof v);
}
inline Float4 all4(float v) { return Float4{v, v, v, v}; }

}  // namespace

void QuadRow::setPlanes(uint32_t layer) {
  planesLayer_ = layer;
  pitchCount_ = 0;
  std::fill(std::begin(planes_), std::end(planes_), interp::TilePlane{});
  const auto pitchIndex = [&](uint32_t rowElements) {
    for (uint32_t i = 0; i < pitchCount_; ++i)
      if (pitches_[i] == rowElements) return i;
    pitches_[pitchCount_] = rowElements;
    return pitchCount_++;
  };
  usedPlaneCount_ = 0;
  wholePlanesReady_ = false;
  const auto put = [&](const AttachmentPlane& p, uint32_t first) {
    if (!p.base) return;
    const uint32_t pitch = pitchIndex(p.rowElements);
    const uint32_t* elements = elements_[pitch];
    for (uint32_t s = 0; s < pass_.samples; ++s) {
      planes_[first + s] = {p.base + layer * p.layerPitch + s * p.samplePitch, elements};
      usedPlanes_[usedPlaneCount_++] = {first + s, pitch, p.elementBytes};
    }
  };
  for (uint32_t a = 0; a < kMaxColorAttachments; ++a) put(pass_.colorPlanes[a], colorPlane(a, 0, pass_.samples));
  put(pass_.depth, depthPlane(0, pass_.samples));
  put(pass_.stencil, stencilPlane(0, pass_.samples));
  put(pass_.decisions, decisionPlane(0, pass_.samples));
}

void QuadRow::setWholePlanes() {
  wholePlanesReady_ = true;
  for (uint32_t i = 0; i < pitchCount_; ++i) {
    if (!tileElements_[i].empty() && tileElementsPitch_[i] == pitches_[i]) continue;
    tileElementsPitch_[i] = pitches_[i];
    tileElements_[i].resize(raster::kBlocksPerTile * 4);
    for (uint32_t quad = 0; quad < raster::kBlocksPerTile * 4; ++quad)
      tileElements_[i][quad] = (raster::blockY(quad / 4) >> 2) * pitches_[i] + (raster::blockX(quad / 4) >> 2) * 16 + quad % 4 * 4;
  }
  for (uint32_t i = 0; i < usedPlaneCount_; ++i) {
    const UsedPlane& u = usedPlanes_[i];
    const uint64_t first = uint64_t(tileY_) * (raster::kTileSize / 4) * pitches_[u.pitch] + uint64_t(tileX_) * (raster::kTileSize * 4);
    wholePlanes_[u.plane].base = planes_[u.plane].base + first * u.elementBytes;
  }
}

void QuadRow::setDraw(DrawRecord* draw) {
  if (draw == draw_) return;
  flush();
  if (draw_ && draw_->occlusion && occluded_) {
    std::atomic_ref<uint64_t>(*draw_->occlusion).fetch_add(occluded_, std::memory_order_relaxed);
    occluded_ = 0;
  }
  if (draw_ && draw_->query && invocations_)
    std::atomic_ref<uint64_t>(draw_->query->values[PipelineStatistics::FragmentInvocations]).fetch_add(invocations_, std::memory_order_relaxed);
  invocations_ = 0;
  draw_ = draw;
  if (!draw) return;
  samples_ = draw->samples;
  helpers_ = draw->fragment->needsHelpers;
  counts_ = (draw->occlusion || pass_.statistics) && !draw->settled;
  whole_ = draw->fragment->hasRows(Rows::Whole) && !counts_ && !pass_.statistics && !draw->query && !(pass_.disabled & bit(Idea::WholeBlocks));
  unit_ = whole_ && draw->fragment->hasRows(Rows::WholeUnit) && !(pass_.disabled & bit(Idea::InUnit));
  if (const uint32_t all = (1u << samples_) - 1; whole_ && wholeCoverage_[0] != all) std::fill(std::begin(wholeCoverage_), std::end(wholeCoverage_), all);
}

const std::byte* QuadRow::makeRecord(const raster::Primitive& primitive, const DrawRecord& draw) {
  if (primitive.record) return primitive.record;
  const auto& varyings = draw.fragment->varyings;
  const bool wide = draw.fragment->wide;
  const size_t bytes = (wide ? raster::wideRecordBytes : raster::recordBytes)(uint32_t(varyings.size()));
  if (recordBytes_ + bytes > kRecordBudget) {
    flush();
    dropRecords();
  }
  std::byte* fresh = static_cast<std::byte*>(records_.allocBytes(bytes, 16));
  if (!fresh) return nullptr;
  recordBytes_ += bytes;
  (wide ? raster::fillWideRecord : raster::fillRecord)(primitive, varyings, tileX_ * raster::kGridCell, tileY_ * raster::kGridCell, fresh, draw.depthRanges[primitive.viewport]);
  return fresh;
}

void QuadRow::dropRecords() {
  records_.reset();
  recordBytes_ = 0;
  ++generation_;
}

void QuadRow::addWhole(uint32_t block, float x, float y, bool oneColor, const std::byte* record) {
  const uint32_t n = count_, lane = n * 4;
  count_ += 4;
  const uint32_t all = oneColor ? 1 : (1u << samples_) - 1;
  if (oneColor) oneColorQuads_ |= 15u << n;
  const Float4 x4 = all4(x), y4 = all4(y);
  const Word4 all4 = {all, all, all, all};
  for (uint32_t q = 0; q < 4; ++q) {
    store4(x_ + lane + 4 * q, x4 + load4<Float4>(kPlaceX + 4 * q));
    store4(y_ + lane + 4 * q, y4 + load4<Float4>(kPlaceY + 4 * q));
    store4(coverage_ + lane + 4 * q, all4);
    blocks_[n + q] = uint8_t(block);
    quadRecords_[n + q] = record;
  }
  // Sixteen lanes from a multiple of four may reach into the next word.
  active_[lane >> 6] |= uint64_t(0xffff) << (lane & 63);
  if ((lane & 63) > 48) active_[(lane >> 6) + 1] |= uint64_t(0xffff) >> (64 - (lane & 63));
}

inline void QuadRow::addQuad(uint32_t q, uint32_t lanes, uint32_t block, float x, float y, const uint16_t* masks, const std::byte* record) {
  const uint32_t n = count_++, lane = n * 4;
  blocks_[n] = uint8_t(block);
  quadRecords_[n] = record;
  active_[n >> 4] |= uint64_t(helpers_ ? 15 : lanes) << (lane & 63);
  store4(x_ + lane, all4(x) + load4<Float4>(kPlaceX + 4 * q));
  store4(y_ + lane, all4(y) + load4<Float4>(kPlaceY + 4 * q));
  Word4 c = load4<Word4>(kLaneWords.words[masks[0] >> (4 * q) & 15]);
  for (uint32_t s = 1; s < samples_; ++s) c |= load4<Word4>(kLaneWords.words[masks[s] >> (4 * q) & 15]) << s;
  store4(coverage_ + lane, c);
}

void QuadRow::add(uint32_t x, uint32_t y, const uint16_t* masks, const std::byte* record, bool apart) {
  uint32_t any = masks[0], every = masks[0];
  for (uint32_t s = 1; s < samples_; ++s) any |= masks[s], every &= masks[s];
  const uint32_t block = raster::blockNumber(x & kTileMask, y & kTileMask);
  // Order per pixel: within a row nothing runs before anything else, so a quad may be there only once.
  uint32_t here = any | any >> 1;   // a bit per quad, from one per four pixels
  here = (here | here >> 2) & 0x1111;
  here = (here | here >> 3 | here >> 6 | here >> 9) & 15;
  if (!apart && (pending_[block] & here)) flush();
  bool oneColor = false;
  if (const uint32_t colors = draw_->oneColors) {
    oneColor = draw_->takesOneColor && every == 0xffff && colors_.takes(block, 1, colors, draw_->visibility->replaced);
    if (oneColor) {
      colors_.take(block, 1, colors);
    } else {
      // Other quads of the block may wait in the row, and write the sample that stands for all.
      if (pending_[block] && colors_.any(block, 1, colors)) flush();
      colors_.split(block, 1, colors);
    }
  }
  const float fx = float(x & kTileMask), fy = float(y & kTileMask);
  oneRecord_ = count_ == 0 || (oneRecord_ && record == quadRecords_[0]);
  uint32_t elements[kMaxPitches];   // of the block's first pixel
  for (uint32_t p = 0; p < pitchCount_; ++p) elements[p] = (y >> 2) * pitches_[p] + (x >> 2) * 16;
  if (every == 0xffff && count_ + 4 <= kQuads) {
    for (uint32_t p = 0; p < pitchCount_; ++p) {
      const uint32_t e = elements[p];
      store4(elements_[p] + count_, Word4{e, e + 4, e + 8, e + 12});
    }
    addWhole(block, fx, fy, oneColor, record);
  } else {
    for (; here; here &= here - 1) {
      const uint32_t q = uint32_t(std::countr_zero(here));
      if (count_ == kQuads) {
        flush();
        oneRecord_ = true;
      }
      for (uint32_t p = 0; p < pitchCount_; ++p) elements_[p][count_] = elements[p] + q * 4;
      if (oneColor) oneColorQuads_ |= 1u << count_;
      addQuad(q, any >> (4 * q) & 15, block, fx, fy, oneColor ? kFirstSample : masks, record);
      if (!apart) pending_[block] |= uint8_t(1u << q);
    }
    return;
  }
  if (!apart) pending_[block] = 15;
}

// The usual of settled draws, without what only others need.
void QuadRow::addSettled(uint32_t block, const uint16_t* masks, const std::byte* record) {
  const uint32_t x = raster::blockX(block), y = raster::blockY(block), mask = masks[0];
  if (samples_ != 1) return add(tileX_ * raster::kTileSize + x, tileY_ * raster::kTileSize + y, masks, record, true);
  const uint32_t column = tileX_ * (raster::kTileSize / 4) + x / 4, row = tileY_ * (raster::kTileSize / 4) + y / 4;
  const Float4 x4 = all4(float(int(x))), y4 = all4(float(int(y)));
  uint32_t n = count_;
  oneRecord_ = n == 0 || (oneRecord_ && record == quadRecords_[0]);
  uint32_t here = mask | mask >> 1;
  here = (here | here >> 2) & 0x1111;
  for (; here; here &= here - 1) {
    if (n == kQuads) {
      count_ = n;
      flush();
      n = 0;
      oneRecord_ = true;
    }
    const uint32_t first = uint32_t(std::countr_zero(here)), lanes = mask >> first & 15;   // of the quad in its block
    blocks_[n] = uint8_t(block);
    quadRecords_[n] = record;
    active_[n >> 4] |= uint64_t(helpers_ ? 15 : lanes) << (n * 4 & 63);
    store4(x_ + n * 4, x4 + load4<Float4>(kPlaceX + first));
    store4(y_ + n * 4, y4 + load4<Float4>(kPlaceY + first));
    store4(coverage_ + n * 4, load4<Word4>(kLaneWords.words[lanes]));
    elements_[0][n] = row * pitches_[0] + column * 16 + first;
    for (uint32_t p = 1; p < pitchCount_; ++p) elements_[p][n] = row * pitches_[p] + column * 16 + first;
    ++n;
  }
  count_ = n;
}

void QuadRow::flush() {
  if (!count_) return;
  interp::ExecContext context;
  context.lanes = count_ * 4;
  std::copy(std::begin(active_), std::end(active_), context.active);
  context.tables = draw_->tables;
  for (uint32_t n = count_; n < kQuads; ++n) quadRecords_[n] = quadRecords_[0];
  context.quadRecords = quadRecords_;
  context.tilePlanes = planes_;
  context.stop = &pass_.pool.cancelled();
  quads += count_;
  if (counts_ && pass_.statistics)
    for (uint32_t l = 0; l < context.lanes; ++l) tested += oneColorQuads_ >> (l / 4) & 1 ? samples_ : uint64_t(std::popcount(coverage_[l]));
  if (draw_->fragment->perSample) {
    runPerSample(context);
  } else {
    const void* inputs[3] = {x_, y_, coverage_};
    context.inputs = inputs;
    run(context);
  }
  for (uint32_t n = 0; n < count_; ++n) pending_[blocks_[n]] = 0;
  std::fill(std::begin(active_), std::end(active_), 0);
  oneColorQuads_ = 0;
  count_ = 0;
}

//! Whether all varyings that are not flat lie between +0 and 1 in blocks of the tile at hand: planes are monotone in each coordinate,
//! roundings included, so corners say it.
bool QuadRow::inUnit(uint32_t first, uint32_t count, const std::byte* record) const {
  const bool oneSquare = (first & 15) + count <= 16;
  const uint32_t last = first + count - 1;
  const float left = oneSquare ? float((first >> 4 & 3) * 16) : 0, right = oneSquare ? left + 15 : 63;
  const raster::Places places{left + 0.5f, float((first >> 6) * 16) + 0.5f, right + 0.5f, float((last >> 6) * 16) + 15.5f};
  const std::byte* plane = record + raster::kRecordPlanes + 24;
  for (const raster::Varying& v : draw_->fragment->varyings) {
    float words[3];   // origin, dx, dy
    std::memcpy(words, plane, sizeof words);
    plane += 12;
    if (v.mode == raster::VaryingMode::Flat) continue;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const raster::DepthEquation d{words[0], words[1], words[2], -kInfinity, kInfinity};
    if (!d.tame()) return false;
    const raster::KeyBounds b = raster::depthKernels().bounds(d, raster::DepthKind::Float32, places);
    const bool constant = words[1] == 0 && words[2] == 0;   // then sums are +0, if the origin is
    if (!(b.high <= 1 && (b.low > 0 || (b.low == 0 && constant && !std::signbit(words[0]))))) return false;
  }
  return true;
}

bool QuadRow::addWholeRows(uint32_t first, uint32_t count, const std::byte* record, bool apart) {
  if (!whole_) return false;
  float inverseW[3];   // origin, dx, dy
  std::memcpy(inverseW, record + raster::kRecordPlanes + 12, sizeof inverseW);
  const bool flat = inverseW[0] == 1 && inverseW[1] == 0 && inverseW[2] == 0;
  struct Kind {
    Rows rows;
    const FragmentRoutine* routine = nullptr;
    bool asked = false;
    const interp::UniformBank* bank = nullptr;
    uint32_t longestRow = 0;
  };
  const bool unit = flat && unit_ && inUnit(first, count, record);
  Kind all{unit ? Rows::WholeUnit : flat && draw_->fragment->hasRows(Rows::WholeFlat) ? Rows::WholeFlat : Rows::Whole};
  Kind one{unit ? Rows::WholeOneUnit : flat && draw_->fragment->hasRows(Rows::WholeOneFlat) ? Rows::WholeOneFlat : Rows::WholeOne};
  const auto routineOf = [&](Kind& k) {
    if (!std::exchange(k.asked, true) && (k.routine = draw_->fragment->forRows(k.rows))) {
      k.bank = &draw_->rowBanks[size_t(k.rows)].get(k.routine->code, draw_->tables);
      k.longestRow = k.routine->code->longestRow();
    }
    return k.routine;
  };
  const uint32_t colors = draw_->oneColors;
  if (!colors && !routineOf(all)) return false;
  if (!apart && count_)
    for (uint32_t n = first; n < first + count; ++n)
      if (pending_[n]) {
        flush();
        break;
      }
  if (!wholePlanesReady_) setWholePlanes();
  std::fill(std::begin(wholeRecords_), std::end(wholeRecords_), record);
  interp::ExecContext context;
  std::fill(std::begin(context.active), std::end(context.active), ~uint64_t(0));
  context.tables = draw_->tables;
  context.quadRecords = wholeRecords_;
  context.tilePlanes = wholePlanes_;
  context.stop = &pass_.pool.cancelled();
  void* outputs[2] = {passedRow_, shadedRow_};
  context.outputs = outputs;
  uint32_t length;   // blocks at once: where places are in one piece, if the routine can
  for (uint32_t n = first; n < first + count; n += length) {
    Kind* kind = &all;
    length = n % 16 == 0 && n + 16 <= first + count ? 16 : kBlocks;
    if (colors && draw_->takesOneColor) {
      if (length > kBlocks && colors_.any(n, length, colors) && !colors_.takes(n, length, colors, 0)) length = kBlocks;
      if (colors_.takes(n, length, colors, draw_->visibility->replaced)) kind = &one;
      else if (colors_.any(n, length, colors)) kind = nullptr;   // some of the blocks do, others do not
    }
    if (!kind || !routineOf(*kind)) {
      uint16_t masks[16];
      std::fill_n(masks, samples_, uint16_t(0xffff));
      for (uint32_t k = n; k < n + length; ++k)
        add(tileX_ * raster::kTileSize + raster::blockX(k), tileY_ * raster::kTileSize + raster::blockY(k), masks, record, apart);
      continue;
    }
    if (length * 16 > kind->longestRow) length = kBlocks;
    if (kind == &one) colors_.take(n, length, colors);
    else if (colors) colors_.split(n, length, colors);
    context.lanes = length * 16;
    const uint32_t lane = (n & 15) * 16;
    const void* inputs[3] = {kSquarePlaces.x[n >> 4 & 3] + lane, kSquarePlaces.y[n >> 6] + lane, wholeCoverage_};
    context.inputs = inputs;
    for (uint32_t i = 0; i < usedPlaneCount_; ++i)
      wholePlanes_[usedPlanes_[i].plane].quadElement = tileElements_[usedPlanes_[i].pitch].data() + n * 4;
    kind->routine->code->run(*kind->bank, context);
    quads += length * 4;
    if (!draw_->settled) fragments += length * 16;
  }
  return true;
}

void QuadRow::run(interp::ExecContext& context) {
  void* outputs[2] = {passedRow_, shadedRow_};
  context.outputs = outputs;
  if (const FragmentRoutine* one = oneRecord_ ? draw_->fragment->forRows(Rows::OneRecord) : nullptr) {
    one->code->run(draw_->rowBanks[size_t(Rows::OneRecord)].get(one->code, draw_->tables), context);
  } else {
    draw_->fragment->code->run(draw_->bank, context);
  }
  if (!draw_->settled)
    for (uint64_t a : context.active) fragments += uint64_t(std::popcount(a));   // once a row
  const bool countShaded = pass_.statistics || draw_->query;
  if (!counts_ && !countShaded) return;
  uint64_t count = 0, ran = 0;
  for (uint32_t l = 0; l < context.lanes; ++l) {
    if (!(context.active[l >> 6] >> (l & 63) & 1)) continue;
    if (counts_) count += oneColorQuads_ >> (l / 4) & 1 ? passedRow_[l] * samples_ : uint64_t(std::popcount(passedRow_[l]));
    if (countShaded) ran += shadedRow_[l];
  }
  shaded += ran;
  if (draw_->query) invocations_ += ran;
  if (draw_->occlusion) occluded_ += count;
  passed += count;
}

// The row once for each sample, with the lanes (or quads) that the sample is covered in.
void QuadRow::runPerSample(const interp::ExecContext& row) {
  interp::ExecContext context = row;
  const auto locations = raster::sampleLocations(samples_);
  interp::TilePlane planes[kRowPlanes];
  context.tilePlanes = planes;
  const void* inputs[6] = {sampleX_, sampleY_, coverage_, sampleNumber_, x_, y_};
  context.inputs = inputs;
  for (uint32_t s = 0; s < samples_; ++s) {
    uint64_t any = 0;
    std::fill(std::begin(context.active), std::end(context.active), 0);
    for (uint32_t l = 0; l < context.lanes; ++l) {
      const uint64_t covered = coverage_[l] >> s & 1;
      context.active[l >> 6] |= covered << (l & 63);
      any |= covered;
    }
    if (!any) continue;
    if (helpers_)
      for (uint64_t& a : context.active) {
        a |= a >> 1;
        a |= a >> 2;
        a = (a & 0x1111111111111111u) * 15;
      }
    for (uint32_t plane = 0; plane <= decisionPlane(0, samples_); plane += samples_) planes[plane] = planes_[plane + s];
    for (uint32_t l = 0; l < context.lanes; ++l) {
      sampleX_[l] = x_[l] + (float(locations[s][0]) / 16.f - 0.5f);
      sampleY_[l] = y_[l] + (float(locations[s][1]) / 16.f - 0.5f);
      sampleNumber_[l] = s;
    }
    run(context);
  }
}

}  // namespace pumice::pipeline
