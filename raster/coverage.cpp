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
// 32 bits. An edge that neither accepts nor rejects the whole tile is zero somewhere in it, so its value at
// the corner is at most 64*(|a| + |b|); every value formed inside the tile is at most twice that. With |a| + |b|
// <= 2^23 (edges up to 32768 pixels) this is at most 2^30 and int32 is exact; longer edges take int64.
#include <algorithm>
#include <bit>
#include <cstring>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "raster/tiles.h"

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

// Inclusive rectangle of pixels within the tile.
struct Rect {
  int x0, y0, x1, y1;
};

// The places of a 4x4 arrangement of cells of 2^shift pixels, at (x, y), that the rectangle touches.
inline uint32_t placesInside(const Rect& r, int x, int y, int shift) {
  auto set = [shift](int low, int high, int start) {
    const int first = std::max((low - start) >> shift, 0), last = std::min((high - start) >> shift, 3);
    return first > last ? 0u : (0xfu >> (3 - last)) & (0xfu << first) & 0xfu;
  };
  return kLineMasks.columns[set(r.x0, r.x1, x)] & kLineMasks.rows[set(r.y0, r.y1, y)];
}

// One edge that cuts the tile. Values are at the tile's pixel (0, 0).
template <typename T>
struct TileEdge {
  alignas(16) T places[16];  // stepX * placeX + stepY * placeY
  T stepX, stepY;
  T low, high;               // over the samples of a pixel
  T inward, outward;         // change per pixel towards the corner deepest inside (>= 0) and outside (<= 0)
  T sample[kMaxSamples];

  T step(int x, int y) const { return stepX * T(x) + stepY * T(y); }
};

// Bit i: base + places[i] << shift is negative.
template <typename T>
inline uint32_t negativePlaces(T base, const T* places, int shift) {
#if defined(__SSE2__)
  if constexpr (sizeof(T) == 4) {
    const __m128i b = _mm_set1_epi32(base);
    const __m128i s = _mm_cvtsi32_si128(shift);
    auto quad = [&](int q) {
      const __m128i p = _mm_load_si128(reinterpret_cast<const __m128i*>(places) + q);
      return _mm_add_epi32(b, _mm_sll_epi32(p, s));
    };
    const __m128i low = _mm_packs_epi32(quad(0), quad(1)), high = _mm_packs_epi32(quad(2), quad(3));
    return uint32_t(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
  }
#endif
  uint32_t mask = 0;
  for (int i = 0; i < 16; i++) mask |= uint32_t(base + places[i] * (T(1) << shift) < 0) << i;
  return mask;
}

template <typename T>
class TileRasterizer {
 public:
  TileRasterizer(const Rect& rect, int originX, int originY, uint32_t samples, BlockSink& sink)
      : rect_(rect), originX_(originX), originY_(originY), samples_(samples), sink_(sink) {}

  void addEdge(const Edge& edge, const int64_t* values, int64_t low, int64_t high) {
    TileEdge<T>& e = edges_[count_++];
    e.stepX = T(edge.a);
    e.stepY = T(edge.b);
    e.low = T(low);
    e.high = T(high);
    e.inward = std::max(e.stepX, T(0)) + std::max(e.stepY, T(0));
    e.outward = std::min(e.stepX, T(0)) + std::min(e.stepY, T(0));
    for (int i = 0; i < 16; i++) e.places[i] = e.step(placeX(i), placeY(i));
    for (uint32_t s = 0; s < samples_; s++) e.sample[s] = T(values[s]);
  }

  void run() {
    const uint32_t all = (1u << count_) - 1;
    const int bx0 = rect_.x0 & ~3, bx1 = rect_.x1 & ~3, by0 = rect_.y0 & ~3, by1 = rect_.y1 & ~3;
    if (((bx1 - bx0) / 4 + 1) * ((by1 - by0) / 4 + 1) <= 4) {
      for (int y = by0; y <= by1; y += 4)
        for (int x = bx0; x <= bx1; x += 4) block(x, y, all);
      return;
    }
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
      alive &= ~negativePlaces<T>(e.high + here + e.inward * kLast, e.places, shift);
      partial[k] = negativePlaces<T>(e.low + here + e.outward * kLast, e.places, shift);
    }
    for (; alive; alive &= alive - 1) {
      const int i = std::countr_zero(alive);
      uint32_t cutting = 0;
      for (uint32_t k = 0; k < count_; k++) cutting |= (partial[k] >> i & 1) << k;
      const int cellX = x + (placeX(i) << shift), cellY = y + (placeY(i) << shift);
      if constexpr (shift == 4)
        split<2>(cellX, cellY, cutting);
      else
        block(cellX, cellY, cutting);
    }
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
    for (uint32_t s = 0; s < samples_; s++) {
      uint32_t mask = allowed;
      for (uint32_t set = active; set; set &= set - 1) {
        const TileEdge<T>& e = edges_[std::countr_zero(set)];
        mask &= ~negativePlaces<T>(e.sample[s] + e.step(x, y), e.places, 0);
      }
      masks[s] = uint16_t(mask);
      any |= mask;
    }
    if (any) emit(x, y, masks);
  }

  void emit(int x, int y, const uint16_t* masks) { sink_.block(uint32_t(originX_ + x), uint32_t(originY_ + y), masks); }

  TileEdge<T> edges_[4];
  uint32_t count_ = 0;
  Rect rect_;
  int originX_, originY_;
  uint32_t samples_;
  BlockSink& sink_;
};

}  // namespace

void rasterize(const Primitive& p, uint32_t tileX, uint32_t tileY, const VkRect2D& bounds, uint32_t samples, BlockSink& sink) {
  const auto locations = sampleLocations(samples);
  samples = uint32_t(locations.size());
  constexpr int64_t kTile = kTileSize;
  const int64_t originX = tileX * kTile, originY = tileY * kTile;
  auto first = [](int64_t a, int64_t b, int64_t origin) { return int(std::clamp<int64_t>(std::max(a, b) - origin, 0, kTileSize)); };
  auto last = [](int64_t a, int64_t b, int64_t origin) { return int(std::clamp<int64_t>(std::min(a, b) - origin, -1, kTileSize - 1)); };
  Rect rect;
  rect.x0 = first(p.minX, bounds.offset.x, originX);
  rect.y0 = first(p.minY, bounds.offset.y, originY);
  rect.x1 = last(p.maxX, int64_t(bounds.offset.x) + bounds.extent.width - 1, originX);
  rect.y1 = last(p.maxY, int64_t(bounds.offset.y) + bounds.extent.height - 1, originY);
  if (rect.x0 > rect.x1 || rect.y0 > rect.y1) return;

  // Edges that let in the whole tile are forgotten; one that lets in nothing of it ends everything.
  struct Cutting {
    const Edge* edge;
    int64_t values[kMaxSamples], low, high;
  } cutting[4];
  uint32_t count = 0;
  bool narrow = true;
  for (uint32_t k = 0; k < p.edgeCount; k++) {
    const Edge& e = p.edges[k];
    const int64_t corner = e.a * (originX * kSubpixelOne) + e.b * (originY * kSubpixelOne) + e.c;
    Cutting& cut = cutting[count];
    for (uint32_t s = 0; s < samples; s++)
      cut.values[s] = (corner + e.a * (locations[s][0] * 16) + e.b * (locations[s][1] * 16)) >> kSubpixelBits;
    cut.low = *std::min_element(cut.values, cut.values + samples);
    cut.high = *std::max_element(cut.values, cut.values + samples);
    const int64_t inward = std::max<int64_t>(e.a, 0) + std::max<int64_t>(e.b, 0);
    const int64_t outward = std::min<int64_t>(e.a, 0) + std::min<int64_t>(e.b, 0);
    if (cut.high + inward * (kTile - 1) < 0) return;
    if (cut.low + outward * (kTile - 1) >= 0) continue;
    cut.edge = &e;
    narrow &= inward - outward <= kNarrowLimit;
    count++;
  }

  auto run = [&](auto rasterizer) {
    for (uint32_t k = 0; k < count; k++) rasterizer.addEdge(*cutting[k].edge, cutting[k].values, cutting[k].low, cutting[k].high);
    rasterizer.run();
  };
  if (narrow)
    run(TileRasterizer<int32_t>(rect, int(originX), int(originY), samples, sink));
  else
    run(TileRasterizer<int64_t>(rect, int(originX), int(originY), samples, sink));
}

}  // namespace pumice::raster
