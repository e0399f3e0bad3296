#include "raster/visibility.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace pumice::raster {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr uint32_t kTileMask = kTileSize - 1;

// Sixteen numbers: `number` where the mask is set.
inline void setWhere(uint16_t* winners, uint32_t mask, uint16_t number) {
#if defined(__SSE2__)
  const __m128i bits = _mm_setr_epi16(1, 2, 4, 8, 16, 32, 64, 128), value = _mm_set1_epi16(int16_t(number));
  for (int half = 0; half < 2; half++) {
    const __m128i chosen = _mm_cmpeq_epi16(_mm_and_si128(_mm_set1_epi16(int16_t(mask >> (8 * half) & 0xff)), bits), bits);
    __m128i* at = reinterpret_cast<__m128i*>(winners + 8 * half);
    _mm_storeu_si128(at, _mm_or_si128(_mm_and_si128(chosen, value), _mm_andnot_si128(chosen, _mm_loadu_si128(at))));
  }
#else
  for (int i = 0; i < 16; i++)
    if (mask >> i & 1) winners[i] = number;
#endif
}

inline void setSixteen(uint16_t* to, uint16_t number) {
  const uint64_t four = number * uint64_t(0x0001000100010001);
  for (int i = 0; i < 16; i += 4) std::memcpy(to + i, &four, sizeof four);
}

// Where the numbers are equal to `number`.
inline uint32_t equalTo(const uint16_t* winners, uint16_t number) {
#if defined(__SSE2__)
  const __m128i value = _mm_set1_epi16(int16_t(number));
  const __m128i a = _mm_cmpeq_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(winners)), value);
  const __m128i b = _mm_cmpeq_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(winners + 8)), value);
  return uint32_t(_mm_movemask_epi8(_mm_packs_epi16(a, b)));
#else
  uint32_t mask = 0;
  for (int i = 0; i < 16; i++) mask |= uint32_t(winners[i] == number) << i;
  return mask;
#endif
}

inline bool equalEight(const uint16_t* numbers, uint16_t number) {
  const uint64_t four = number * uint64_t(0x0001000100010001);
  uint64_t have[2];
  std::memcpy(have, numbers, sizeof have);
  return ((have[0] ^ four) | (have[1] ^ four)) == 0;
}

// Set bits of up to four masks, in a few operations that every processor has.
inline uint32_t countBits(const uint16_t* masks, uint32_t count) {
  uint32_t total = 0;
  for (uint32_t i = 0; i < count; i += 4) {
    uint64_t v = masks[i];
    for (uint32_t k = 1; k < 4 && i + k < count; k++) v |= uint64_t(masks[i + k]) << (16 * k);
    v -= v >> 1 & 0x5555555555555555u;
    v = (v & 0x3333333333333333u) + (v >> 2 & 0x3333333333333333u);
    v = (v + (v >> 4)) & 0x0f0f0f0f0f0f0f0fu;
    total += uint32_t(v * 0x0101010101010101u >> 56);
  }
  return total;
}

inline void setBit(uint64_t* words, uint32_t i) { words[i >> 6] |= uint64_t(1) << (i & 63); }

template <typename F>
inline void takeBits(uint64_t (&words)[4], F&& f) {
  for (uint32_t w = 0; w < 4; w++)
    for (uint64_t set = std::exchange(words[w], 0); set; set &= set - 1) f(w * 64 + uint32_t(std::countr_zero(set)));
}

}  // namespace

VisibilityCounters& VisibilityCounters::operator+=(const VisibilityCounters& o) {
  fragments += o.fragments;
  tested += o.tested;
  passed += o.passed;
  rejected += o.rejected;
  hidden += o.hidden;
  return *this;
}

void Visibility::begin(uint32_t tileX, uint32_t tileY, uint32_t samples, const DepthMemory& depth, bool exact) {
  tileX_ = tileX;
  tileY_ = tileY;
  memory_ = depth;
  exact_ = exact;
  const auto locations = sampleLocations(samples);
  samples_ = uint32_t(locations.size());
  sampleLowX_ = sampleLowY_ = 1;
  sampleHighX_ = sampleHighY_ = 0;
  for (uint32_t s = 0; s < samples_; s++) {
    placeX_[s] = float(locations[s][0]) / 16;
    placeY_[s] = float(locations[s][1]) / 16;
    sampleLowX_ = std::min(sampleLowX_, placeX_[s]);
    sampleLowY_ = std::min(sampleLowY_, placeY_[s]);
    sampleHighX_ = std::max(sampleHighX_, placeX_[s]);
    sampleHighY_ = std::max(sampleHighY_, placeY_[s]);
  }
  winners_.resize(std::max(winners_.size(), size_t(kBlocksPerTile) * samples_));
  takeBlocks_ = vectors_ && depth.base ? takeBlocksFor(depth.kind, samples_) : nullptr;
  takeMixed_ = vectors_ ? takeMixedFor(samples_) : takeMixed;
  lazyOwner_ = 0xffff;
  std::fill(std::begin(squareOwner_), std::end(squareOwner_), kNone);
  std::fill(std::begin(virtual_), std::end(virtual_), 0);
  std::fill(std::begin(pending_), std::end(pending_), 0);
  entries_.clear();
  groups_ = 0;
  user_ = nullptr;
  runPassed_ = 0;
  forgetDepth();
}

void Visibility::forgetDepth() {
  lazyDepth_ = 0xffff;
  staleSquares_ = 0;
  tileKnown_ = false;
  std::fill(std::begin(squareSource_), std::end(squareSource_), kMemory);
  std::fill(std::begin(squareLow_), std::end(squareLow_), -kInfinity);
  std::fill(std::begin(squareHigh_), std::end(squareHigh_), kInfinity);
  if (!squares_) spreadAll();
}

void Visibility::fetchDepth() const {
  const size_t bytes = depthBytes(memory_.kind);
  for (uint32_t s = 0; s < samples_; s++)
    for (uint32_t row = 0; row < kTileSize / 4; row++) {
      const std::byte* first = memory_.base + s * memory_.samplePitch + size_t(row) * memory_.rowElements * bytes;
      for (size_t at = 0; at < kTileSize * 4 * bytes; at += 64) __builtin_prefetch(first + at);
    }
}

void Visibility::clearDepth(const VkRect2D& r, uint32_t stored) {
  clearStored_ = stored;
  const float key = depthKey(memory_.kind, stored);
  const KeyBounds b = key == key ? KeyBounds{key, key} : KeyBounds{-kInfinity, kInfinity};
  if (squares_ && r.extent.width == kTileSize && r.extent.height == kTileSize) {
    lazyDepth_ = 0xffff;
    staleSquares_ = 0;
    tileKnown_ = false;
    std::fill(std::begin(squareSource_), std::end(squareSource_), kClear);
    std::fill(std::begin(squareLow_), std::end(squareLow_), b.low);
    std::fill(std::begin(squareHigh_), std::end(squareHigh_), b.high);
    std::fill(std::begin(virtual_), std::end(virtual_), ~uint64_t(0));
    return;
  }
  spreadAll();
  for (uint32_t y = uint32_t(r.offset.y); y < uint32_t(r.offset.y) + r.extent.height; y += 4)
    for (uint32_t x = uint32_t(r.offset.x); x < uint32_t(r.offset.x) + r.extent.width; x += 4) {
      const uint32_t n = blockNumber(x, y);
      source_[n] = kClear;
      setBit(virtual_, n);
      low_[n] = b.low;
      high_[n] = b.high;
    }
  staleSquares_ = 0xffff;
  tileKnown_ = false;
}

void Visibility::makeReal(uint32_t block) {
  virtual_[block >> 6] &= ~(uint64_t(1) << (block & 63));
  writeDepth(block, std::exchange(source_[block], kMemory));
}

void Visibility::writeDepth(uint32_t block, uint16_t source) const {
  for (uint32_t s = 0; s < samples_; s++) {
    std::byte* at = depthOf(block, s);
    if (source != kClear) {
      kernels_.write(entries_[source - 1].depth, memory_.kind, float(blockX(block)) + placeX_[s], float(blockY(block)) + placeY_[s], at);
    } else if (memory_.kind == DepthKind::Unorm16) {
      std::fill_n(reinterpret_cast<uint16_t*>(at), 16, uint16_t(clearStored_));
    } else {
      std::fill_n(reinterpret_cast<uint32_t*>(at), 16, clearStored_);
    }
  }
}

void Visibility::materialise() {
  spreadAll();
  uint64_t work[kWords];
  std::copy(std::begin(virtual_), std::end(virtual_), work);
  takeBits(work, [&](uint32_t block) { makeReal(block); });
}

void Visibility::storeDepth() {
  takeBits(virtual_, [&](uint32_t block) { writeDepth(block, lazyDepth_ >> (block >> 4) & 1 ? squareSource_[block >> 4] : source_[block]); });
}

// ---- bounds

void Visibility::setBounds(uint32_t block, const KeyBounds& b) {
  low_[block] = b.low;
  high_[block] = b.high;
  staleSquares_ |= 1u << (block >> 4);
  tileKnown_ = false;
}

KeyBounds Visibility::squareBounds(uint32_t square) {
  if (staleSquares_ >> square & 1) {
    staleSquares_ &= ~(1u << square);
    const float *low = low_ + square * 16, *high = high_ + square * 16;
#if defined(__SSE2__)
    __m128 l = _mm_load_ps(low), h = _mm_load_ps(high);
    for (int i = 4; i < 16; i += 4) l = _mm_min_ps(l, _mm_load_ps(low + i)), h = _mm_max_ps(h, _mm_load_ps(high + i));
    l = _mm_min_ps(l, _mm_movehl_ps(l, l));
    h = _mm_max_ps(h, _mm_movehl_ps(h, h));
    squareLow_[square] = _mm_cvtss_f32(_mm_min_ss(l, _mm_shuffle_ps(l, l, 1)));
    squareHigh_[square] = _mm_cvtss_f32(_mm_max_ss(h, _mm_shuffle_ps(h, h, 1)));
#else
    squareLow_[square] = *std::min_element(low, low + 16);
    squareHigh_[square] = *std::max_element(high, high + 16);
#endif
  }
  return {squareLow_[square], squareHigh_[square]};
}

KeyBounds Visibility::tileBounds() {
  if (tileKnown_) return tile_;
  for (uint32_t stale = staleSquares_; stale; stale &= stale - 1) squareBounds(uint32_t(std::countr_zero(stale)));
  tile_ = {squareLow_[0], squareHigh_[0]};
  for (uint32_t square = 1; square < 16; square++) {
    tile_.low = std::min(tile_.low, squareLow_[square]);
    tile_.high = std::max(tile_.high, squareHigh_[square]);
  }
  tileKnown_ = true;
  return tile_;
}

inline DepthEquation Visibility::equation(const Primitive& p, const DepthRange& clamp) const {
  // As fillRecord() does.
  DepthEquation d;
  if (p.record) {
    float words[3];
    std::memcpy(words, p.record + kRecordPlanes, sizeof words);
    d.origin = words[0];
    d.dx = words[1];
    d.dy = words[2];
  } else {
    const Plane& plane = p.planes[0];
    d.origin = float(plane.origin + plane.dx * double(tileX_ * kGridCell) + plane.dy * double(tileY_ * kGridCell));
    d.dx = float(plane.dx);
    d.dy = float(plane.dy);
  }
  d.low = clamp.low;
  d.high = clamp.high;
  d.inside = p.minZ > d.low && p.maxZ < d.high && d.low >= 0 && d.high <= 1 && d.tame();
  return d;
}

// Keys of depths between low and high: a plane without slope takes them through clamping and packing.
inline KeyBounds Visibility::keyRange(const DepthEquation& d, float low, float high) const {
  if (memory_.kind == DepthKind::Float32) return {std::min(std::max(low, d.low), d.high), std::min(std::max(high, d.low), d.high)};
  DepthEquation flat = d;
  flat.dx = flat.dy = 0;
  flat.origin = low;
  const float least = kernels_.bounds(flat, memory_.kind, {0, 0, 0, 0}).low;
  flat.origin = high;
  return {least, kernels_.bounds(flat, memory_.kind, {0, 0, 0, 0}).high};
}

// ---- opaque runs

void Visibility::beginDraw(void* user, const DepthTest& test, bool shaded) {
  user_ = user;
  test_ = test;
  shaded_ = shaded;
  groups_++;
}

void Visibility::draw(const Primitive& p, const DepthRange& clamp, uint32_t sampleMask, const VkRect2D& bounds, bool whole) {
  primitive_ = &p;
  maskedOut_ = ~sampleMask & ((1u << samples_) - 1);
  number_ = 0;
  if (test_.test) {
    const bool large = hiZ_ && !exact_ && (whole || std::max(p.maxX - p.minX, p.maxY - p.minY) >= 16);
    equation_ = equation(p, clamp);
    tame_ = equation_.tame();
    own_ = tame_ ? keyRange(equation_, p.minZ, p.maxZ) : KeyBounds{-kInfinity, kInfinity};
    if (large && compareBounds(test_.compare, own_, tileBounds()) == Outcome::Fails) return;
  }
  if (whole && !maskedOut_) squares(0xffff);
  else rasterize(p, tileX_, tileY_, bounds, samples_, *this);
}

uint16_t Visibility::number() {
  if (!number_) {
    entries_.push_back({primitive_, user_, groups_ - 1, 0, primitive_->record != nullptr, primitive_->record, equation_});
    number_ = uint16_t(entries_.size());
  }
  return number_;
}

void Visibility::own(uint32_t block) {
  const uint64_t samples = 16 * samples_;
  counters.passed += samples;
  drawPassed += samples;
  if (!shaded_) return;
  runPassed_ += samples;
  owner_[block] = number();
  setBit(pending_, block);
}

//! The primitive covers all of the block; `own`: its keys there.
void Visibility::full(uint32_t block, const KeyBounds& mine) {
  if (!test_.test) {
    own(block);
    return;
  }
  const Outcome outcome = hiZ_ && tame_ ? compareBounds(test_.compare, mine, {low_[block], high_[block]}) : Outcome::Open;
  if (outcome == Outcome::Fails) {
    counters.rejected += 16 * samples_;
    return;
  }
  if (outcome == Outcome::Open) {
    uint16_t masks[16];
    std::fill_n(masks, samples_, uint16_t(0xffff));
    testBlock(block, masks);
    return;
  }
  own(block);
  if (!test_.write) return;
  source_[block] = number();
  setBit(virtual_, block);
  setBounds(block, mine);
}

void Visibility::testBlock(uint32_t block, const uint16_t* masks) {
  if (source_[block] != kMemory) makeReal(block);
  KeyBounds all;
  uint16_t passed[16];
  const BlockSamples samples{samples_, placeX_, placeY_, float(blockX(block)), float(blockY(block)), depthOf(block, 0), memory_.samplePitch};
  kernels_.test(equation_, memory_.kind, test_.compare, test_.write, samples, masks, passed, all);
  uint32_t any = 0;
  for (uint32_t s = 0; s < samples_; s++) any |= passed[s];
  setBounds(block, all);
  if (any) mark(block, passed);
}

void Visibility::splitBlock(uint32_t block) {
  for (uint32_t s = 0; s < samples_; s++) setSixteen(winnersOf(block, s), owner_[block]);
  owner_[block] = kMixed;
  setBit(pending_, block);
}

void Visibility::mark(uint32_t block, const uint16_t* passed) {
  const uint32_t count = countBits(passed, samples_);
  uint32_t every = 0xffff;
  for (uint32_t s = 0; s < samples_; s++) every &= passed[s];
  counters.passed += count;
  drawPassed += count;
  if (!shaded_) return;
  runPassed_ += count;
  const uint16_t n = number();
  if (every == 0xffff) {
    owner_[block] = n;
    setBit(pending_, block);
    return;
  }
  if (owner_[block] != kMixed) splitBlock(block);
  for (uint32_t s = 0; s < samples_; s++)
    if (passed[s]) setWhere(winnersOf(block, s), passed[s], n);
}

void Visibility::block(uint32_t x, uint32_t y, const uint16_t* given) {
  const uint16_t* masks = given;
  uint16_t some[16] = {};
  if (maskedOut_) {
    for (uint32_t s = 0; s < samples_; s++) some[s] = maskedOut_ >> s & 1 ? 0 : given[s];
    masks = some;
  }
  const uint32_t n = blockNumber(x & kTileMask, y & kTileMask);
  spread(n >> 4);
  uint32_t any = masks[0], every = masks[0];
  for (uint32_t s = 1; s < samples_; s++) {
    any |= masks[s];
    every &= masks[s];
  }
  const uint16_t pixels = uint16_t(any);
  const uint32_t count = every == 0xffff ? 16 * samples_ : countBits(masks, samples_);
  counters.fragments += countBits(&pixels, 1);
  counters.tested += count;
  if (every == 0xffff) {
    const Places places = placesOf(x & kTileMask, y & kTileMask, 4);
    full(n, test_.test && hiZ_ ? tame_ ? kernels_.bounds(equation_, memory_.kind, places) : own_ : KeyBounds{});
    return;
  }
  if (!any) return;
  if (!test_.test) {
    mark(n, masks);
    return;
  }
  if (hiZ_ && compareBounds(test_.compare, own_, {low_[n], high_[n]}) == Outcome::Fails) {
    counters.rejected += count;
    return;
  }
  testBlock(n, masks);
}

void Visibility::blocks(uint32_t tileX, uint32_t tileY, const BlockList& list) {
  if (takeBlocks_ && test_.test && !maskedOut_) takeBlocks_(*this, list);
  else BlockSink::blocks(tileX, tileY, list);
}

void Visibility::ownedBlocks(uint64_t (&out)[kWords]) const {
  for (uint32_t w = 0; w < kWords; w++) {
    uint64_t mixed = 0;
    for (uint32_t k = 0; k < 64 && pending_[w]; k += 16)
      if (!(lazyOwner_ >> (w * 4 + k / 16) & 1)) mixed |= uint64_t(equalTo(owner_ + w * 64 + k, kMixed)) << k;
    out[w] = pending_[w] & ~mixed;
  }
}

// Winners of a block that several have parts of: items, and `samples` masks for each.
uint32_t Visibility::takeMixed(const Sixteen* winners, uint32_t samples, Item* items, uint16_t* masks) {
  uint32_t left[16], count = 0;
  for (uint32_t s = 0; s < samples; s++) left[s] = 0xffffu & ~equalTo(winners[s].of, kNone);
  for (uint32_t s = 0; s < samples; s++)
    while (left[s]) {
      const uint16_t winner = winners[s].of[std::countr_zero(left[s])];
      items[count++].entry = uint16_t(winner - 1);
      for (uint32_t t = 0; t < samples; t++) {
        const uint32_t mask = left[t] & equalTo(winners[t].of, winner);   // nothing of the samples that are done with
        left[t] &= ~mask;
        *masks++ = uint16_t(mask);
      }
    }
  return count;
}

Visibility::Winners Visibility::takeWinners() {
  size_t items = 0, masks = 0;
  uint64_t kept = 0;
  const size_t most = size_t(16) * samples_;   // items of a block
  const auto reserve = [&] {
    if (items + most > items_.size()) items_.resize(2 * items_.size() + most);
    if (masks + most * samples_ > masks_.size()) masks_.resize(2 * masks_.size() + most * samples_);
  };
  const auto put = [&](uint32_t block, uint16_t winner, uint32_t blocks) {
    reserve();
    items_[items++] = {uint16_t(winner - 1), uint8_t(block), uint8_t(blocks), uint32_t(masks)};
    for (uint32_t s = 0; s < samples_; s++) masks_[masks++] = 0xffff;
    kept += uint64_t(blocks) * 16 * samples_;
  };
  for (uint32_t first = 0; first < kBlocksPerTile; first += 8) {
    if (lazyOwner_ >> (first >> 4) & 1) {
      // Squares of one owner behind each other, as one.
      const uint16_t owner = squareOwner_[first >> 4];
      uint32_t end = first;
      do {
        squareOwner_[end >> 4] = kNone;
        if (owner != kNone) pending_[end >> 6] &= ~(uint64_t(0xffff) << (end & 63));
        end += 16;
      } while (end < kBlocksPerTile && end - first < 128 && (lazyOwner_ >> (end >> 4) & 1) && squareOwner_[end >> 4] == owner);
      if (owner != kNone) put(first, owner, end - first);
      first = end - 8;
      continue;
    }
    uint64_t& word = pending_[first >> 6];
    const uint16_t owner = owner_[first];
    if ((word >> (first & 63) & 0xff) != 0xff || owner == kMixed || !equalEight(owner_ + first, owner)) continue;
    word &= ~(uint64_t(0xff) << (first & 63));
    std::fill_n(owner_ + first, 8, kNone);
    put(first, owner, 8);
  }
  takeBits(pending_, [&](uint32_t block) {
    const uint16_t owner = std::exchange(owner_[block], kNone);
    if (owner != kMixed) {
      put(block, owner, 1);
      return;
    }
    reserve();
    const uint32_t count = takeMixed_(&winners_[size_t(block) * samples_], samples_, items_.data() + items, masks_.data() + masks);
    for (uint32_t i = 0; i < count; i++, items++) {
      Item& item = items_[items];
      item.block = uint8_t(block);
      item.blocks = 1;
      item.masks = uint32_t(masks);
      kept += countBits(masks_.data() + masks, samples_);
      masks += samples_;
    }
  });
  counters.hidden += std::exchange(runPassed_, 0) - kept;
  const bool sort = groups_ > 1;
  if (sort) {
    // Stable: blocks stay in their order.
    groupStart_.assign(groups_ + 1, 0);
    for (size_t i = 0; i < items; i++) groupStart_[entries_[items_[i].entry].group + 1]++;
    for (uint32_t g = 0; g < groups_; g++) groupStart_[g + 1] += groupStart_[g];
    if (sorted_.size() < items) sorted_.resize(items_.size());
    for (size_t i = 0; i < items; i++) sorted_[groupStart_[entries_[items_[i].entry].group]++] = items_[i];
  }
  groups_ = user_ ? 1 : 0;
  return {{sort ? sorted_.data() : items_.data(), items}, masks_.data()};
}

// ---- other draws

void Visibility::beginOther(const Primitive& p, const DepthRange& clamp, const DepthTest& test, bool exactDepth) {
  test_ = test;
  otherExact_ = exactDepth;
  equation_ = equation(p, clamp);
  tame_ = equation_.tame();
  own_ = tame_ && exactDepth ? keyRange(equation_, p.minZ, p.maxZ) : KeyBounds{-kInfinity, kInfinity};
}

bool Visibility::othersFail(uint32_t x, uint32_t y, uint32_t size) {
  const KeyBounds stored = size > 16 ? tileBounds() : squareBounds(blockNumber(x & kTileMask, y & kTileMask) >> 4);
  return compareBounds(test_.compare, own_, stored) == Outcome::Fails;
}

void Visibility::otherWrote(uint32_t block) {
  // What was written lies within own_, and passed the comparison with what was there.
  const bool lowers = test_.compare == VK_COMPARE_OP_LESS || test_.compare == VK_COMPARE_OP_LESS_OR_EQUAL;
  const bool raises = test_.compare == VK_COMPARE_OP_GREATER || test_.compare == VK_COMPARE_OP_GREATER_OR_EQUAL;
  setBounds(block, {raises ? low_[block] : std::min(low_[block], own_.low), lowers ? high_[block] : std::max(high_[block], own_.high)});
}

}  // namespace pumice::raster
