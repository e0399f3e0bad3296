#include "raster/coverage_box.h"

#include <algorithm>
#include <bit>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "base/cpu.h"

namespace pumice::raster {

#if defined(__x86_64__)
namespace {

#pragma GCC push_options
#pragma GCC target("avx2")
#define PUMICE_INLINE inline __attribute__((always_inline))

// Within a box of 32 pixels an edge's value changes by at most 32 * (|a| + |b|) <= 2^28, so whatever is beyond +-2^30 at one of its
// pixels has the same sign at all of them: values are clamped there and int32 is exact for all that follows.
constexpr int kLongestEdge = 1 << 23;        // |a| + |b|
constexpr int64_t kFar = int64_t(1) << 38;   // before the eight bits of a sample's place are shifted out

// What a first or last column (row) of pixels leaves of a block, by its place in the block.
constexpr uint16_t kFromColumn[4] = {0xffff, 0xfafa, 0xf0f0, 0xa0a0}, kToColumn[4] = {0x0505, 0x0f0f, 0x5f5f, 0xffff};
constexpr uint16_t kFromRow[4] = {0xffff, 0xffcc, 0xff00, 0xcc00}, kToRow[4] = {0x0033, 0x00ff, 0x33ff, 0xffff};

// Four values of 64 bits, of edges 0, 2, 1, 3: clamped, without their fraction, in the edges' order.
PUMICE_INLINE __m128i narrowed(__m256i v) {
  const __m256i most = _mm256_set1_epi64x(kFar), least = _mm256_set1_epi64x(-kFar);
  v = _mm256_blendv_epi8(v, most, _mm256_cmpgt_epi64(v, most));
  v = _mm256_blendv_epi8(v, least, _mm256_cmpgt_epi64(least, v));
  v = _mm256_srli_epi64(v, kSubpixelBits);   // the low words are those of an arithmetic shift
  return _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(v, _mm256_setr_epi32(0, 4, 2, 6, 0, 4, 2, 6)));
}

PUMICE_INLINE __m256i every(__m128i values, int edge) {
  return _mm256_permutevar8x32_epi32(_mm256_castsi128_si256(values), _mm256_set1_epi32(edge));
}

template <int edges, bool one>
PUMICE_INLINE bool cover(const Primitive& p, int originX, int originY, const TileBox& box, std::span<const std::array<uint8_t, 2>> locations,
                         BlockList& list) {
  const int bx0 = box.x0 >> 2, bx1 = box.x1 >> 2, by0 = box.y0 >> 2, by1 = box.y1 >> 2;
  const uint32_t samples = one ? 1 : uint32_t(locations.size());
  static_assert(sizeof(Edge) == 16 && offsetof(Edge, b) == 4 && offsetof(Edge, c) == 8);
  const __m256i e01 = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p.edges)), e23 = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p.edges + 2));
  const __m256i ab = _mm256_unpacklo_epi64(e01, e23), c = _mm256_unpackhi_epi64(e01, e23);   // of edges 0, 2, 1, 3
  const __m256i length = _mm256_abs_epi32(ab), b64 = _mm256_srli_epi64(ab, 32);
  const __m256i tooLong = _mm256_cmpgt_epi32(_mm256_add_epi32(length, _mm256_srli_epi64(length, 32)), _mm256_set1_epi32(kLongestEdge));
  if (_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_slli_epi64(tooLong, 32))) & (edges == 4 ? 15 : 7)) return false;

  // At the first block's first pixel, for each sample: lane k is edge k's value.
  const int x0 = (originX + bx0 * 4) * kSubpixelOne, y0 = (originY + by0 * 4) * kSubpixelOne;
  __m128i values[one ? 1 : 16];
  for (uint32_t s = 0; s < samples; s++) {
    const __m256i x = _mm256_set1_epi64x(x0 + locations[s][0] * 16), y = _mm256_set1_epi64x(y0 + locations[s][1] * 16);
    values[s] = narrowed(_mm256_add_epi64(_mm256_add_epi64(_mm256_mul_epi32(ab, x), _mm256_mul_epi32(b64, y)), c));
  }
  const __m128i a = _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(ab, _mm256_setr_epi32(0, 4, 2, 6, 0, 4, 2, 6)));
  const __m128i b = _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(ab, _mm256_setr_epi32(1, 5, 3, 7, 1, 5, 3, 7)));
  const __m128i right = _mm_slli_epi32(a, 2), down = _mm_slli_epi32(b, 2);   // to the next block

  // From a block's first pixel to its upper eight, and from there to the lower ones.
  __m256i pixels[edges], lower[edges];
#pragma GCC unroll 4
  for (int k = 0; k < edges; k++) {
    const __m256i ak = every(a, k), bk = every(b, k);
    pixels[k] = _mm256_add_epi32(_mm256_mullo_epi32(ak, _mm256_setr_epi32(0, 1, 0, 1, 2, 3, 2, 3)),
                                 _mm256_and_si256(bk, _mm256_setr_epi32(0, 0, -1, -1, 0, 0, -1, -1)));
    lower[k] = _mm256_slli_epi32(bk, 1);
  }
  const auto block = [&](int bx, int by, __m128i offset, uint32_t allowed) __attribute__((always_inline)) {
    uint16_t* masks = list.masks + list.count * samples;
    uint32_t any = 0;
    for (uint32_t s = 0; s < samples; s++) {
      const __m128i at = _mm_add_epi32(values[s], offset);
      __m256i upperOut = _mm256_setzero_si256(), lowerOut = upperOut;
#pragma GCC unroll 4
      for (int k = 0; k < edges; k++) {
        const __m256i v = _mm256_add_epi32(every(at, k), pixels[k]);
        upperOut = _mm256_or_si256(upperOut, v);
        lowerOut = _mm256_or_si256(lowerOut, _mm256_add_epi32(v, lower[k]));
      }
      const uint32_t out = uint32_t(_mm256_movemask_ps(_mm256_castsi256_ps(upperOut))) | uint32_t(_mm256_movemask_ps(_mm256_castsi256_ps(lowerOut))) << 8;
      const uint32_t mask = allowed & ~out;
      masks[s] = uint16_t(mask);
      any |= mask;
    }
    list.numbers[list.count] = uint8_t(blockNumber(uint32_t(bx) * 4, uint32_t(by) * 4));
    list.count += any != 0;
  };

  uint16_t columns[kMostBoxBlocks];
  const int width = bx1 - bx0 + 1;
  std::fill_n(columns, kMostBoxBlocks, uint16_t(0xffff));
  columns[0] = kFromColumn[box.x0 & 3];
  columns[width - 1] = uint16_t(columns[width - 1] & kToColumn[box.x1 & 3]);
  const auto rowMask = [&](int by) {
    return (by == by0 ? kFromRow[box.y0 & 3] : 0xffffu) & (by == by1 ? kToRow[box.y1 & 3] : 0xffffu);
  };

  if (width * (by1 - by0 + 1) <= 4) {
    __m128i row = _mm_setzero_si128();
    for (int by = by0; by <= by1; by++, row = _mm_add_epi32(row, down)) {
      const uint32_t allowed = rowMask(by);
      __m128i at = row;
      for (int bx = bx0; bx <= bx1; bx++, at = _mm_add_epi32(at, right)) block(bx, by, at, allowed & columns[bx - bx0]);
    }
    return true;
  }

  // A row of blocks at once: those that an edge leaves out, and those that some edge cuts.
  __m128i low = values[0], high = values[0];
  for (uint32_t s = 1; s < samples; s++) {
    low = _mm_min_epi32(low, values[s]);
    high = _mm_max_epi32(high, values[s]);
  }
  const __m128i none = _mm_setzero_si128(), three = _mm_set1_epi32(3);
  low = _mm_add_epi32(low, _mm_mullo_epi32(_mm_add_epi32(_mm_min_epi32(a, none), _mm_min_epi32(b, none)), three));
  high = _mm_add_epi32(high, _mm_mullo_epi32(_mm_add_epi32(_mm_max_epi32(a, none), _mm_max_epi32(b, none)), three));
  __m256i lows[edges], highs[edges], downs[edges];
#pragma GCC unroll 4
  for (int k = 0; k < edges; k++) {
    const __m256i across = _mm256_mullo_epi32(every(right, k), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    lows[k] = _mm256_add_epi32(every(low, k), across);
    highs[k] = _mm256_add_epi32(every(high, k), across);
    downs[k] = every(down, k);
  }
  __m128i row = _mm_setzero_si128();
  for (int by = by0; by <= by1; by++, row = _mm_add_epi32(row, down)) {
    __m256i out = highs[0], cut = lows[0];
#pragma GCC unroll 4
    for (int k = 1; k < edges; k++) {
      out = _mm256_or_si256(out, highs[k]);
      cut = _mm256_or_si256(cut, lows[k]);
    }
#pragma GCC unroll 4
    for (int k = 0; k < edges; k++) {
      highs[k] = _mm256_add_epi32(highs[k], downs[k]);
      lows[k] = _mm256_add_epi32(lows[k], downs[k]);
    }
    const uint32_t cuts = uint32_t(_mm256_movemask_ps(_mm256_castsi256_ps(cut))), allowed = rowMask(by);
    for (uint32_t alive = ~uint32_t(_mm256_movemask_ps(_mm256_castsi256_ps(out))) & ((1u << width) - 1); alive; alive &= alive - 1) {
      const int i = std::countr_zero(alive);
      if (cuts >> i & 1) {
        block(bx0 + i, by, _mm_add_epi32(row, _mm_mullo_epi32(right, _mm_set1_epi32(i))), allowed & columns[i]);
        continue;
      }
      for (uint32_t s = 0; s < samples; s++) list.masks[list.count * samples + s] = uint16_t(allowed & columns[i]);
      list.numbers[list.count++] = uint8_t(blockNumber(uint32_t(bx0 + i) * 4, uint32_t(by) * 4));
    }
  }
  return true;
}

bool coverAvx2(const Primitive& p, int originX, int originY, const TileBox& box, std::span<const std::array<uint8_t, 2>> locations, BlockList& list) {
  if (p.edgeCount == 3) {
    return locations.size() == 1 ? cover<3, true>(p, originX, originY, box, locations, list) : cover<3, false>(p, originX, originY, box, locations, list);
  }
  return p.edgeCount == 4 && cover<4, false>(p, originX, originY, box, locations, list);
}

#undef PUMICE_INLINE
#pragma GCC pop_options

}  // namespace
#endif

CoverBox coverBox() {
#if defined(__x86_64__)
  if (base::mayUseAvx2()) return coverAvx2;
#endif
  return nullptr;
}

}  // namespace pumice::raster
