// Exact coverage of one primitive in one tile.
//
// Ranges. Snapped coordinates stay within +-(2^20 + 1) pixels (clip.h: guard band), so within 2^28 + 2^8 of
// 1/256 pixels; |a|, |b| <= 2^29 + 2^9, |c| < 2^59; sample positions are below 2^23 (framebuffers up to 16384
// pixels are 2^22). a*x + b*y + c therefore stays below 2^60: int64 never overflows.
//
// Reduction to pixels. For one sample position (sx, sy) within its pixel, a*(256*px + sx) + b*(256*py + sy) + c
// >= 0 exactly when a*px + b*py + floor((a*sx + b*sy + c) / 256) >= 0, because the first two terms are whole
// multiples. So an edge becomes, per sample, one integer at the tile's corner and two steps per pixel.
//
// 32 bits. An edge that neither accepts nor rejects the rectangle asked for changes its sign somewhere in the tile, so its value at
// the corner is at most 64*(|a| + |b|); every value formed inside the tile is at most twice that. With |a| + |b|
// <= 2^23 (edges up to 32768 pixels) this is at most 2^30 and int32 is exact; longer edges take int64.
#include <algorithm>
#include <bit>
#include <cstdlib>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "raster/coverage_box.h"

namespace pumice::raster {
namespace {

constexpr int64_t kNarrowLimit = int64_t(1) << 23;
constexpr uint32_t kMaxSamples = 16;

// Place i of a 4x4 arrangement in quad-major order (texture::blockIndex).
constexpr int placeX(int i) { return (i & 1) | (i >> 1 & 2); }
constexpr int placeY(int i) { return (i >> 1 & 1) | (i >> 2 & 2); }

// From a set of columns (or rows) of a 4x4 arrangement to the mask of its places.
struct LineMasks {
  uint16_t columns[16] = {}, rows[16] = {};
};
constexpr LineMasks kLineMasks = [] {
  LineMasks m;
  for (int set = 0; set < 16; set++)
    for (int i = 0; i < 16; i++) {
      if (set >> placeX(i) & 1) m.columns[set] |= uint16_t(1 << i);
      if (set >> placeY(i) & 1) m.rows[set] |= uint16_t(1 << i);
    }
  return m;
}();

// The places of a 4x4 arrangement of cells of 2^shift pixels, at (x, y), that the rectangle touches.
inline uint32_t placesInside(const TileBox& r, int x, int y, int shift) {
  auto set = [shift](int low, int high, int start) {
    const int first = std::max((low - start) >> shift, 0), last = std::min((high - start) >> shift, 3);
    return first > last ? 0u : (0xfu >> (3 - last)) & (0xfu << first) & 0xfu;
  };
  return kLineMasks.columns[set(r.x0, r.x1, x)] & kLineMasks.rows[set(r.y0, r.y1, y)];
}

// The squares of 16 pixels that the rectangle contains, in the same order.
inline uint32_t squaresWithin(const TileBox& r) {
  const auto set = [](int low, int high) {
    const int first = (low + 15) >> 4, end = (high + 1) >> 4;
    return first >= end ? 0u : (0xfu >> (4 - end)) & (0xfu << first);
  };
  return kLineMasks.columns[set(r.x0, r.x1)] & kLineMasks.rows[set(r.y0, r.y1)];
}

// From quad-major order to row by row, and back.
inline uint32_t rowByRow(uint32_t mask) { return (mask & 0xc3c3) | (mask & 0x0c0c) << 2 | (mask & 0x3030) >> 2; }

// One edge that cuts the rectangle. Values are at the tile's pixel (0, 0).
template <typename T>
struct TileEdge {
  alignas(16) T quad[4];     // change from pixel (0, 0) to (0, 0), (1, 0), (0, 1), (1, 1)
  T stepX, stepY;
  T low, high;               // over the samples of a pixel
  T sample[kMaxSamples];

  T step(int x, int y) const { return stepX * T(x) + stepY * T(y); }
  // Change over `pixels` towards the corner deepest inside (>= 0) and outside (<= 0).
  T inward(T pixels) const { return (std::max(stepX, T(0)) + std::max(stepY, T(0))) * pixels; }
  T outward(T pixels) const { return (std::min(stepX, T(0)) + std::min(stepY, T(0))) * pixels; }
};

#if defined(__SSE2__)
// Of sixteen values. Packing saturates, so signs stay.
inline uint32_t signs(__m128i q0, __m128i q1, __m128i q2, __m128i q3) {
  return uint32_t(_mm_movemask_epi8(_mm_packs_epi16(_mm_packs_epi32(q0, q1), _mm_packs_epi32(q2, q3))));
}
#endif

// Bit i: the value of place i is negative, where places are 2^shift pixels apart and `base` belongs to the first.
template <int shift, typename T>
inline uint32_t negativePlaces(T base, const TileEdge<T>& edge) {
#if defined(__SSE2__)
  if constexpr (sizeof(T) == 4) {
    const __m128i offsets = _mm_slli_epi32(_mm_load_si128(reinterpret_cast<const __m128i*>(edge.quad)), shift);
    const __m128i right = _mm_set1_epi32(edge.stepX * (T(2) << shift)), down = _mm_set1_epi32(edge.stepY * (T(2) << shift));
    const __m128i q0 = _mm_add_epi32(_mm_set1_epi32(base), offsets), q1 = _mm_add_epi32(q0, right);
    return signs(q0, q1, _mm_add_epi32(q0, down), _mm_add_epi32(q1, down));
  }
#endif
  uint32_t mask = 0;
  for (int i = 0; i < 16; i++) mask |= uint32_t(base + edge.step(placeX(i), placeY(i)) * (T(1) << shift) < 0) << i;
  return mask;
}

template <typename T>
class TileRasterizer {
 public:
  TileRasterizer(const Primitive& primitive, const TileBox& rect, int64_t originX, int64_t originY, std::span<const std::array<uint8_t, 2>> locations,
                 BlockSink& sink)
      : primitive_(primitive), rect_(rect), originX_(originX), originY_(originY), locations_(locations), samples_(uint32_t(locations.size())), sink_(sink) {}

  //! False when the edge lets in nothing of the rectangle. One that lets in all of it is forgotten.
  bool addEdge(const Edge& edge) {
    const int64_t a = edge.a, b = edge.b;
    const int64_t corner = a * (originX_ * kSubpixelOne) + b * (originY_ * kSubpixelOne) + edge.c;
    int64_t values[kMaxSamples], low, high;
    low = high = values[0] = (corner + a * (locations_[0][0] * 16) + b * (locations_[0][1] * 16)) >> kSubpixelBits;
    for (uint32_t s = 1; s < samples_; s++) {
      values[s] = (corner + a * (locations_[s][0] * 16) + b * (locations_[s][1] * 16)) >> kSubpixelBits;
      low = std::min(low, values[s]);
      high = std::max(high, values[s]);
    }
    const int64_t x0 = a * rect_.x0, x1 = a * rect_.x1, y0 = b * rect_.y0, y1 = b * rect_.y1;
    if (high + std::max(x0, x1) + std::max(y0, y1) < 0) return false;
    if (low + std::min(x0, x1) + std::min(y0, y1) >= 0) return true;
    TileEdge<T>& e = edges_[count_++];
    e.stepX = T(a);
    e.stepY = T(b);
    e.low = T(low);
    e.high = T(high);
    e.quad[0] = 0;
    e.quad[1] = e.stepX;
    e.quad[2] = e.stepY;
    e.quad[3] = e.stepX + e.stepY;
    for (uint32_t s = 0; s < samples_; s++) e.sample[s] = T(values[s]);
    return true;
  }

  void run() {
    const uint32_t all = (1u << count_) - 1;
    const int bx0 = rect_.x0 & ~3, bx1 = rect_.x1 & ~3, by0 = rect_.y0 & ~3, by1 = rect_.y1 & ~3;
    if (((bx1 - bx0) / 4 + 1) * ((by1 - by0) / 4 + 1) <= 4) {
      for (int y = by0; y <= by1; y += 4)
        for (int x = bx0; x <= bx1; x += 4) block(x, y, all);
      return;
    }
    if (!count_ && contains(0, 0, int(kTileSize)) && sink_.square(uint32_t(originX_), uint32_t(originY_), kTileSize, true)) return;
    split<4>(0, 0, all);
  }

 private:
  // Sixteen cells of 2^shift pixels from (x, y): leaves out what no edge of `active` lets in, and stops asking
  // edges that let all of a cell in.
  template <int shift>
  void split(int x, int y, uint32_t active) {
    constexpr T kLast = (T(1) << shift) - 1;
    uint32_t alive = placesInside(rect_, x, y, shift);
    uint32_t partial[4] = {};
    for (uint32_t set = active; set; set &= set - 1) {
      const uint32_t k = uint32_t(std::countr_zero(set));
      const TileEdge<T>& e = edges_[k];
      const T here = e.step(x, y);
      alive &= ~negativePlaces<shift>(T(e.high + here + e.inward(kLast)), e);
      partial[k] = negativePlaces<shift>(T(e.low + here + e.outward(kLast)), e);
    }
    if constexpr (shift == 4) {
      const uint32_t whole = alive & ~(partial[0] | partial[1] | partial[2] | partial[3]) & squaresWithin(rect_);
      if (whole) alive &= ~rowByRow(sink_.squares(rowByRow(whole)));
    }
    for (; alive; alive &= alive - 1) {
      const int i = std::countr_zero(alive);
      uint32_t cutting = 0;
      for (uint32_t k = 0; k < count_; k++) cutting |= (partial[k] >> i & 1) << k;
      const int cellX = x + (placeX(i) << shift), cellY = y + (placeY(i) << shift);
      if constexpr (shift == 4) {
        const bool whole = !cutting && contains(cellX, cellY, 16);
        if (!sink_.square(uint32_t(originX_ + cellX), uint32_t(originY_ + cellY), 16, whole)) square(cellX, cellY, cutting);
      } else
        block(cellX, cellY, cutting);
    }
  }

  void square(int x, int y, uint32_t active) {
    if (const CoverBox cover = active ? coverBox() : nullptr) {
      BlockList list;
      list.samples = samples_;
      const TileBox box = {std::max(rect_.x0, x), std::max(rect_.y0, y), std::min(rect_.x1, x + 15), std::min(rect_.y1, y + 15)};
      if (cover(primitive_, int(originX_), int(originY_), box, locations_, list)) {
        if (list.count) sink_.blocks(uint32_t(originX_), uint32_t(originY_), list);
        return;
      }
    }
    split<2>(x, y, active);
  }

  bool contains(int x, int y, int size) const {
    return rect_.x0 <= x && rect_.y0 <= y && rect_.x1 >= x + size - 1 && rect_.y1 >= y + size - 1;
  }

  void block(int x, int y, uint32_t active) {
    const uint32_t allowed = placesInside(rect_, x, y, 0);
    uint16_t masks[kMaxSamples];
    if (!active) {
      std::fill_n(masks, samples_, uint16_t(allowed));
      if (allowed) emit(x, y, masks);
      return;
    }
    uint32_t any = 0;
#if defined(__SSE2__)
    if constexpr (sizeof(T) == 4) {
      // A sample is outside where any edge's value is negative: signs of all edges are gathered before they become bits.
      struct Outside {
        __m128i q0 = _mm_setzero_si128(), q1 = q0, q2 = q0, q3 = q0;
        void add(__m128i quad, __m128i right, __m128i down) {
          q0 = _mm_or_si128(q0, quad);
          q2 = _mm_or_si128(q2, _mm_add_epi32(quad, down));
          const __m128i next = _mm_add_epi32(quad, right);
          q1 = _mm_or_si128(q1, next);
          q3 = _mm_or_si128(q3, _mm_add_epi32(next, down));
        }
        uint32_t mask() const { return signs(q0, q1, q2, q3); }
      };
      const auto quadOf = [](const TileEdge<T>& e, T base) {
        return _mm_add_epi32(_mm_set1_epi32(base), _mm_load_si128(reinterpret_cast<const __m128i*>(e.quad)));
      };
      if (samples_ == 1) {
        Outside outside;
        for (uint32_t set = active; set; set &= set - 1) {
          const TileEdge<T>& e = edges_[std::countr_zero(set)];
          outside.add(quadOf(e, e.sample[0] + e.step(x, y)), _mm_set1_epi32(2 * e.stepX), _mm_set1_epi32(2 * e.stepY));
        }
        masks[0] = uint16_t(allowed & ~outside.mask());
        if (masks[0]) emit(x, y, masks);
        return;
      }
      __m128i quad[4], right[4], down[4];
      const T* sample[4];
      uint32_t edges = 0;
      for (uint32_t set = active; set; set &= set - 1, edges++) {
        const TileEdge<T>& e = edges_[std::countr_zero(set)];
        quad[edges] = quadOf(e, e.step(x, y));
        right[edges] = _mm_set1_epi32(2 * e.stepX);
        down[edges] = _mm_set1_epi32(2 * e.stepY);
        sample[edges] = e.sample;
      }
      for (uint32_t s = 0; s < samples_; s++) {
        Outside outside;
        for (uint32_t k = 0; k < edges; k++) outside.add(_mm_add_epi32(_mm_set1_epi32(sample[k][s]), quad[k]), right[k], down[k]);
        any |= masks[s] = uint16_t(allowed & ~outside.mask());
      }
      if (any) emit(x, y, masks);
      return;
    }
#endif
    for (uint32_t s = 0; s < samples_; s++) {
      uint32_t mask = allowed;
      for (uint32_t set = active; set; set &= set - 1) {
        const TileEdge<T>& e = edges_[std::countr_zero(set)];
        mask &= ~negativePlaces<0>(T(e.sample[s] + e.step(x, y)), e);
      }
      masks[s] = uint16_t(mask);
      any |= mask;
    }
    if (any) emit(x, y, masks);
  }

  void emit(int x, int y, const uint16_t* masks) { sink_.block(uint32_t(originX_ + x), uint32_t(originY_ + y), masks); }

  TileEdge<T> edges_[4];
  uint32_t count_ = 0;
  const Primitive& primitive_;
  TileBox rect_;
  int64_t originX_, originY_;  // of the tile, pixels
  std::span<const std::array<uint8_t, 2>> locations_;
  uint32_t samples_;
  BlockSink& sink_;
};

}  // namespace

void rasterize(const Primitive& p, uint32_t tileX, uint32_t tileY, const VkRect2D& bounds, uint32_t samples, BlockSink& sink) {
  static constexpr std::array<std::array<uint8_t, 2>, kMaxSamples> kCentres = [] {
    std::array<std::array<uint8_t, 2>, kMaxSamples> centres{};
    centres.fill({8, 8});
    return centres;
  }();
  const auto locations = p.wholePixels ? std::span<const std::array<uint8_t, 2>>(kCentres).first(samples) : sampleLocations(samples);
  constexpr int64_t kTile = kTileSize;
  const int64_t originX = tileX * kTile, originY = tileY * kTile;
  auto first = [](int64_t a, int64_t b, int64_t origin) { return int(std::clamp<int64_t>(std::max(a, b) - origin, 0, kTileSize)); };
  auto last = [](int64_t a, int64_t b, int64_t origin) { return int(std::clamp<int64_t>(std::min(a, b) - origin, -1, kTileSize - 1)); };
  TileBox rect;
  rect.x0 = first(p.minX, bounds.offset.x, originX);
  rect.y0 = first(p.minY, bounds.offset.y, originY);
  rect.x1 = last(p.maxX, int64_t(bounds.offset.x) + bounds.extent.width - 1, originX);
  rect.y1 = last(p.maxY, int64_t(bounds.offset.y) + bounds.extent.height - 1, originY);
  if (rect.x0 > rect.x1 || rect.y0 > rect.y1) return;

  const auto blocks = [](int first, int last) { return (last >> 2) - (first >> 2) + 1; };
  if (blocks(rect.x0, rect.x1) <= kMostBoxBlocks && blocks(rect.y0, rect.y1) <= kMostBoxBlocks) {
    if (const CoverBox cover = coverBox()) {
      BlockList list;
      list.samples = samples;
      if (cover(p, int(originX), int(originY), rect, locations, list)) {
        if (list.count) sink.blocks(uint32_t(originX), uint32_t(originY), list);
        return;
      }
    }
  }
  bool narrow = true;
  for (uint32_t k = 0; k < p.edgeCount; k++) narrow &= std::abs(p.edges[k].a) + std::abs(p.edges[k].b) <= kNarrowLimit;
  auto run = [&](auto rasterizer) {
    for (uint32_t k = 0; k < p.edgeCount; k++)
      if (!rasterizer.addEdge(p.edges[k])) return;
    rasterizer.run();
  };
  if (narrow)
    run(TileRasterizer<int32_t>(p, rect, originX, originY, locations, sink));
  else
    run(TileRasterizer<int64_t>(p, rect, originX, originY, locations, sink));
}

}  // namespace pumice::raster
