// Setup of four triangles at once, for the many that nothing special happens to: filled, not clipped, without a choice of viewports.
//
// Every number is made by the same operations in the same order as in SetupContext::triangle, PlaneBuilder and fillRecord, so that all
// bits are the same whoever makes it; a triangle for which that is not certain is left to triangle(). Coordinates here stay within
// kReach pixels, which leaves room for edges in 64 bits and for areas in the 53 bits of a double.
#include "raster/setup.h"

#include <bit>
#include <cstring>
#include <limits>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "base/cpu.h"
#include "base/log.h"

namespace pumice::raster {

bool fourAtOnce() { return base::mayUseAvx2(); }

bool SetupContext::plain() const {
  bool plain = state_.polygonMode == VK_POLYGON_MODE_FILL && !choosesView_ && !userClips_ && !vertices_.wideRows;
  for (const Varying& v : state_.varyings) plain &= v.mode != VaryingMode::Flat || int32_t(v.vertexRow) != vertices_.decisionRow;
  return plain;
}

#if defined(__x86_64__)
#pragma GCC push_options
#pragma GCC target("avx2")
#define PUMICE_INLINE inline __attribute__((always_inline))

namespace {

constexpr double kReach = 0x1p14;    // pixels; framebuffers end there
constexpr double kMostDepth = 0x1p100;

//! The values of a row at the corners of four triangles: [corner].
struct Corners {
  __m128 v[3];
};

PUMICE_INLINE __m128 gather(const float* row, const uint32_t (&slots)[4]) {
  return _mm_setr_ps(row[slots[0]], row[slots[1]], row[slots[2]], row[slots[3]]);
}

PUMICE_INLINE Corners loadCorners(const float* row, const SetupContext::Four& four, bool consecutive) {
  if (!consecutive) return {{gather(row, four.slots[0]), gather(row, four.slots[1]), gather(row, four.slots[2])}};
  const float* at = row + four.slots[0][0];
  const __m128 a = _mm_loadu_ps(at), b = _mm_loadu_ps(at + 4), c = _mm_loadu_ps(at + 8);   // 0 1 2 0, 1 2 0 1, 2 0 1 2
  const __m128 first = _mm_blend_ps(_mm_blend_ps(a, b, 4), c, 2), second = _mm_blend_ps(_mm_blend_ps(a, b, 9), c, 4),
               third = _mm_blend_ps(_mm_blend_ps(a, b, 2), c, 9);
  return {{_mm_shuffle_ps(first, first, _MM_SHUFFLE(1, 2, 3, 0)), _mm_shuffle_ps(second, second, _MM_SHUFFLE(2, 3, 0, 1)),
           _mm_shuffle_ps(third, third, _MM_SHUFFLE(3, 0, 1, 2))}};
}

PUMICE_INLINE uint32_t bits(__m256d mask) { return uint32_t(_mm256_movemask_pd(mask)); }
PUMICE_INLINE uint32_t bits(__m128i mask) { return uint32_t(_mm_movemask_ps(_mm_castsi128_ps(mask))); }
PUMICE_INLINE __m256d absolute(__m256d v) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), v); }
//! Not NaN and not infinite: all of them.
PUMICE_INLINE __m256d finite(__m256d a, __m256d b) {
  const __m256d zero = _mm256_setzero_pd();
  return _mm256_cmp_pd(_mm256_add_pd(_mm256_mul_pd(a, zero), _mm256_mul_pd(b, zero)), zero, _CMP_EQ_OQ);
}
//! Exact where the integers are below 2^51.
PUMICE_INLINE __m256d toDouble(__m256i v) {
  const __m256d magic = _mm256_set1_pd(6755399441055744.0);
  return _mm256_sub_pd(_mm256_castsi256_pd(_mm256_add_epi64(v, _mm256_castpd_si256(magic))), magic);
}
PUMICE_INLINE __m256i wide(__m128i v) { return _mm256_cvtepi32_epi64(v); }
//! std::nextafter towards minus (towards -1) or plus infinity (1), of finite numbers.
PUMICE_INLINE __m128 next(__m128 v, int direction) {
  const __m128i word = _mm_castps_si128(v), sign = _mm_srai_epi32(word, 31);
  const __m128i step = _mm_sub_epi32(_mm_xor_si128(_mm_set1_epi32(direction), sign), sign);
  const __m128 moved = _mm_castsi128_ps(_mm_add_epi32(word, step));
  const __m128 smallest = _mm_castsi128_ps(_mm_set1_epi32(direction < 0 ? int(0x80000001) : 1));
  return _mm_blendv_ps(moved, smallest, _mm_cmpeq_ps(v, _mm_setzero_ps()));
}

//! A pixel's samples lie at [low, high] / 256 in it.
PUMICE_INLINE __m128i firstPixel(__m128i lowest, int high) {
  return _mm_srai_epi32(_mm_add_epi32(lowest, _mm_set1_epi32(kSubpixelOne - 1 - high)), kSubpixelBits);
}
PUMICE_INLINE __m128i lastPixel(__m128i highest, int low) { return _mm_srai_epi32(_mm_sub_epi32(highest, _mm_set1_epi32(low)), kSubpixelBits); }
PUMICE_INLINE __m256i centre(__m128i pixel) {
  return wide(_mm_add_epi32(_mm_slli_epi32(pixel, kSubpixelBits), _mm_set1_epi32(kSubpixelOne / 2)));
}
PUMICE_INLINE __m256d squaredLength(__m128i dx, __m128i dy) {
  const __m256d h = _mm256_cvtepi32_pd(dx), v = _mm256_cvtepi32_pd(dy);
  return _mm256_add_pd(_mm256_mul_pd(h, h), _mm256_mul_pd(v, v));
}

//! Four planes: v(x, y) = origin + dx * x + dy * y.
struct Planes {
  __m256d dx, dy, origin;
};

//! PlaneBuilder::depthOffset of planes, and of polygons between these depths.
PUMICE_INLINE __m256d depthOffsets(const SetupState& state, double unit, __m256d low, __m256d high, const Planes& depth) {
  __m256d r = _mm256_set1_pd(unit);
  if (unit == 0) {   // 2 to the power of (the exponent of the largest depth, at least -126) - 23
    const __m256d largest = _mm256_max_pd(absolute(high), absolute(low));
    const __m256i exponent = _mm256_max_epi32(_mm256_srli_epi64(_mm256_castpd_si256(largest), 52), _mm256_set1_epi64x(1023 - 126));
    const __m256d power = _mm256_castsi256_pd(_mm256_slli_epi64(_mm256_sub_epi64(exponent, _mm256_set1_epi64x(23)), 52));
    r = _mm256_and_pd(power, _mm256_and_pd(_mm256_cmp_pd(largest, _mm256_setzero_pd(), _CMP_GT_OQ), finite(largest, largest)));
  }
  const __m256d slope = _mm256_max_pd(absolute(depth.dy), absolute(depth.dx));
  __m256d offset = _mm256_add_pd(_mm256_mul_pd(_mm256_set1_pd(double(state.depthBiasSlope)), slope),
                                 _mm256_mul_pd(_mm256_set1_pd(double(state.depthBiasConstant)), r));
  const __m256d clamp = _mm256_set1_pd(double(state.depthBiasClamp));
  if (state.depthBiasClamp > 0) offset = _mm256_min_pd(clamp, offset);
  if (state.depthBiasClamp < 0) offset = _mm256_max_pd(clamp, offset);
  return _mm256_and_pd(offset, finite(offset, offset));
}

//! What the values at three corners are multiplied with.
struct Gradients {
  __m256d ax, bx, ay, by, x0, y0;
  PUMICE_INLINE Planes solve(__m256d f0, __m256d f1, __m256d f2) const {
    f1 = _mm256_sub_pd(f1, f0);
    f2 = _mm256_sub_pd(f2, f0);
    Planes p;
    p.dx = _mm256_add_pd(_mm256_mul_pd(f1, ax), _mm256_mul_pd(f2, bx));
    p.dy = _mm256_add_pd(_mm256_mul_pd(f1, ay), _mm256_mul_pd(f2, by));
    p.origin = _mm256_sub_pd(_mm256_sub_pd(f0, _mm256_mul_pd(p.dx, x0)), _mm256_mul_pd(p.dy, y0));
    return p;
  }
};

//! Where planes go: into the records of some triangles, and as they are for others.
struct PlaneWriter {
  float* records[4];          //!< their next plane
  uint32_t inRecords, whole;  //!< bit for each triangle
  Plane* planes[4];
  __m256d cellX, cellY;

  //! Writes four bytes too many, which the next plane (or the end of the record) has room for.
  PUMICE_INLINE void add(const Planes& p, uint32_t index) {
    if (inRecords) {
      const __m256d there = _mm256_add_pd(_mm256_add_pd(p.origin, _mm256_mul_pd(p.dx, cellX)), _mm256_mul_pd(p.dy, cellY));
      write(_mm256_cvtpd_ps(there), _mm256_cvtpd_ps(p.dx), _mm256_cvtpd_ps(p.dy));
    }
    if (whole) keep(p, index);
  }
  PUMICE_INLINE void write(__m128 origin, __m128 dx, __m128 dy) {
    const __m128 od0 = _mm_unpacklo_ps(origin, dx), od1 = _mm_unpackhi_ps(origin, dx);
    const __m128 y0 = _mm_unpacklo_ps(dy, dy), y1 = _mm_unpackhi_ps(dy, dy);
    _mm_storeu_ps(records[0], _mm_movelh_ps(od0, y0));
    _mm_storeu_ps(records[1], _mm_movehl_ps(y0, od0));
    _mm_storeu_ps(records[2], _mm_movelh_ps(od1, y1));
    _mm_storeu_ps(records[3], _mm_movehl_ps(y1, od1));
    for (float*& r : records) r += 3;
  }
  __attribute__((noinline)) void keep(const Planes& p, uint32_t index) const {
    alignas(32) double dx[4], dy[4], origin[4];
    _mm256_store_pd(dx, p.dx);
    _mm256_store_pd(dy, p.dy);
    _mm256_store_pd(origin, p.origin);
    for (uint32_t set = whole; set; set &= set - 1) {
      const int lane = std::countr_zero(set);
      planes[lane][index] = {dx[lane], dy[lane], origin[lane]};
    }
  }
};

}  // namespace

bool SetupContext::allSlotsExist(std::span<const uint32_t> slots) const {
  if (!vertices_.vertexCount) return false;
  const uint32_t* at = slots.data();
  size_t n = slots.size();
  __m256i most = _mm256_setzero_si256();
  for (; n >= 8; n -= 8, at += 8) most = _mm256_max_epu32(most, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
  const __m256i last = _mm256_set1_epi32(int(vertices_.vertexCount - 1));
  bool all = uint32_t(_mm256_movemask_epi8(_mm256_cmpeq_epi32(_mm256_max_epu32(most, last), last))) == ~0u;
  for (; n; n--, at++) all &= *at < vertices_.vertexCount;
  return all;
}

void SetupContext::four(const Four& four, uint32_t count, uint32_t firstId) {
  const ViewTransform& transform = view_->transform;
  const bool consecutive = four.consecutive;
  const __m256d zero = _mm256_setzero_pd(), one = _mm256_set1_pd(1);

  // Corners in the framebuffer. What comes near to infinity, leaves the guard or is not in front of the eye is for triangle().
  __m256d x[3], y[3], z[3], w[3], inverseW[3];
  __m128i sx[3], sy[3];
  __m256d good;
  {
    const Corners cx = loadCorners(vertices_.rows[0], four, consecutive), cy = loadCorners(vertices_.rows[1], four, consecutive),
                  cz = loadCorners(vertices_.rows[2], four, consecutive), cw = loadCorners(vertices_.rows[3], four, consecutive);
    const __m256d scaleX = _mm256_set1_pd(transform.scaleX), offsetX = _mm256_set1_pd(transform.offsetX);
    const __m256d scaleY = _mm256_set1_pd(transform.scaleY), offsetY = _mm256_set1_pd(transform.offsetY);
    const bool clipsDepth = (view_->guard.planes & kDepthPlanes) != 0;
    good = _mm256_castsi256_pd(_mm256_set1_epi64x(-1));
    for (int k = 0; k < 3; k++) {
      w[k] = _mm256_cvtps_pd(cw.v[k]);
      z[k] = _mm256_cvtps_pd(cz.v[k]);
      if (state_.depthFromMinusOne) z[k] = _mm256_mul_pd(_mm256_add_pd(z[k], w[k]), _mm256_set1_pd(0.5));
      const __m256d clipX = _mm256_add_pd(_mm256_mul_pd(_mm256_cvtps_pd(cx.v[k]), scaleX), _mm256_mul_pd(w[k], offsetX));
      const __m256d clipY = _mm256_add_pd(_mm256_mul_pd(_mm256_cvtps_pd(cy.v[k]), scaleY), _mm256_mul_pd(w[k], offsetY));
      const __m256d side = _mm256_mul_pd(w[k], _mm256_set1_pd(kReach));
      __m256d in = _mm256_and_pd(finite(z[k], w[k]), _mm256_cmp_pd(w[k], _mm256_set1_pd(kSmallestW), _CMP_GE_OQ));
      in = _mm256_and_pd(in, _mm256_and_pd(_mm256_cmp_pd(absolute(clipX), side, _CMP_LE_OQ), _mm256_cmp_pd(absolute(clipY), side, _CMP_LE_OQ)));
      if (clipsDepth) in = _mm256_and_pd(in, _mm256_and_pd(_mm256_cmp_pd(z[k], zero, _CMP_GE_OQ), _mm256_cmp_pd(z[k], w[k], _CMP_LE_OQ)));
      good = _mm256_and_pd(good, in);
      x[k] = _mm256_div_pd(clipX, w[k]);
      y[k] = _mm256_div_pd(clipY, w[k]);
      const __m256d subpixels = _mm256_set1_pd(kSubpixelOne);
      sx[k] = _mm256_cvtpd_epi32(_mm256_mul_pd(x[k], subpixels));   // ties to even
      sy[k] = _mm256_cvtpd_epi32(_mm256_mul_pd(y[k], subpixels));
    }
  }
  const uint32_t given = (1u << count) - 1;
  uint32_t left = bits(good) & given;
  uint32_t special = left ^ given;   // for triangle()
  counters_.input += uint32_t(std::popcount(left));
  const auto drop = [&](uint32_t which, uint64_t& counter) __attribute__((always_inline)) {
    counter += uint32_t(std::popcount(left & which));
    left &= ~which;
  };

  // Area and face.
  const __m128i dx1 = _mm_sub_epi32(sx[1], sx[0]), dy1 = _mm_sub_epi32(sy[1], sy[0]);
  const __m128i dx2 = _mm_sub_epi32(sx[2], sx[0]), dy2 = _mm_sub_epi32(sy[2], sy[0]);
  const __m256i area = _mm256_sub_epi64(_mm256_mul_epi32(wide(dx1), wide(dy2)), _mm256_mul_epi32(wide(dy1), wide(dx2)));
  const uint32_t negative = bits(_mm256_castsi256_pd(area));
  drop(bits(_mm256_castsi256_pd(_mm256_cmpeq_epi64(area, _mm256_setzero_si256()))), counters_.culledZeroArea);
  const uint32_t front = state_.frontFace == VK_FRONT_FACE_COUNTER_CLOCKWISE ? negative : ~negative;
  drop((state_.cullMode & VK_CULL_MODE_FRONT_BIT ? front : 0) | (state_.cullMode & VK_CULL_MODE_BACK_BIT ? ~front : 0), counters_.culledFace);

  // Pixels.
  __m128i minX = firstPixel(_mm_min_epi32(_mm_min_epi32(sx[0], sx[1]), sx[2]), sampleHighX_);
  __m128i minY = firstPixel(_mm_min_epi32(_mm_min_epi32(sy[0], sy[1]), sy[2]), sampleHighY_);
  __m128i maxX = lastPixel(_mm_max_epi32(_mm_max_epi32(sx[0], sx[1]), sx[2]), sampleLowX_);
  __m128i maxY = lastPixel(_mm_max_epi32(_mm_max_epi32(sy[0], sy[1]), sy[2]), sampleLowY_);
  const auto empty = [&]() __attribute__((always_inline)) { return bits(_mm_or_si128(_mm_cmpgt_epi32(minX, maxX), _mm_cmpgt_epi32(minY, maxY))); };
  drop(empty(), counters_.culledNoSample);
  const VkRect2D& limits = view_->visible;
  minX = _mm_max_epi32(minX, _mm_set1_epi32(limits.offset.x));
  minY = _mm_max_epi32(minY, _mm_set1_epi32(limits.offset.y));
  maxX = _mm_min_epi32(maxX, _mm_set1_epi32(int32_t(int64_t(limits.offset.x) + limits.extent.width - 1)));
  maxY = _mm_min_epi32(maxY, _mm_set1_epi32(int32_t(int64_t(limits.offset.y) + limits.extent.height - 1)));
  drop(empty(), counters_.culledOutside);

  // Edges, in the direction that has the inside on the right: all numbers of the other direction have the other sign.
  __m256i ab[3], a[3], b[3], c[3];
  {
    const __m256i turn = _mm256_cmpgt_epi64(_mm256_setzero_si256(), area);
    const __m256i low = _mm256_set1_epi64x(0xffffffff);
    for (int k = 0; k < 3; k++) {
      const int to = k == 2 ? 0 : k + 1;
      a[k] = wide(_mm_sub_epi32(sy[k], sy[to]));
      b[k] = wide(_mm_sub_epi32(sx[to], sx[k]));
      a[k] = _mm256_sub_epi64(_mm256_xor_si256(a[k], turn), turn);
      b[k] = _mm256_sub_epi64(_mm256_xor_si256(b[k], turn), turn);
      c[k] = _mm256_add_epi64(_mm256_mul_epi32(a[k], wide(sx[k])), _mm256_mul_epi32(b[k], wide(sy[k])));
      // a > 0, or a == 0 and b > 0
      const __m256i owns = _mm256_cmpgt_epi64(_mm256_add_epi64(_mm256_slli_epi64(a[k], 32), b[k]), _mm256_setzero_si256());
      c[k] = _mm256_sub_epi64(_mm256_xor_si256(owns, _mm256_set1_epi64x(-1)), c[k]);
      ab[k] = _mm256_or_si256(_mm256_and_si256(a[k], low), _mm256_slli_epi64(b[k], 32));
    }
  }
  if (state_.samples == 1) {
    // Those of at most two by two pixels: the signs of the edges at four centres.
    const __m128i wideX = _mm_sub_epi32(minX, maxX), wideY = _mm_sub_epi32(minY, maxY);   // 0 or -1
    const uint32_t small = bits(_mm_and_si128(_mm_cmpgt_epi32(wideX, _mm_set1_epi32(-2)), _mm_cmpgt_epi32(wideY, _mm_set1_epi32(-2))));
    if (left & small) {
      const __m256i px = centre(minX), py = centre(minY);
      __m256i out00 = _mm256_setzero_si256(), out10 = wide(_mm_xor_si128(wideX, _mm_set1_epi32(-1))),
              out01 = wide(_mm_xor_si128(wideY, _mm_set1_epi32(-1))), out11 = _mm256_or_si256(out10, out01);
      for (int k = 0; k < 3; k++) {
        const __m256i here = _mm256_add_epi64(_mm256_add_epi64(_mm256_mul_epi32(a[k], px), _mm256_mul_epi32(b[k], py)), c[k]);
        const __m256i right = _mm256_add_epi64(here, _mm256_slli_epi64(a[k], kSubpixelBits)), down = _mm256_slli_epi64(b[k], kSubpixelBits);
        out00 = _mm256_or_si256(out00, here);
        out10 = _mm256_or_si256(out10, right);
        out01 = _mm256_or_si256(out01, _mm256_add_epi64(here, down));
        out11 = _mm256_or_si256(out11, _mm256_add_epi64(right, down));
      }
      const __m256i none = _mm256_and_si256(_mm256_and_si256(out00, out10), _mm256_and_si256(out01, out11));
      drop(small & bits(_mm256_castsi256_pd(none)), counters_.culledNoSample);
    }
  }

  if (left) {
    // thin(): from snapped positions then.
    {
      const __m256d longest = _mm256_max_pd(_mm256_max_pd(squaredLength(dx1, dy1), squaredLength(dx2, dy2)),
                                            squaredLength(_mm_sub_epi32(sx[2], sx[1]), _mm_sub_epi32(sy[2], sy[1])));
      constexpr double kThin = kThinPixels * kSubpixelOne;
      const __m256d twice = toDouble(area);
      const __m256d thin = _mm256_cmp_pd(_mm256_mul_pd(twice, twice), _mm256_mul_pd(_mm256_set1_pd(kThin * kThin), longest), _CMP_LT_OQ);
      if (bits(thin) & left)
        for (int k = 0; k < 3; k++) {
          const __m256d pixel = _mm256_set1_pd(1.0 / kSubpixelOne);
          x[k] = _mm256_blendv_pd(x[k], _mm256_mul_pd(_mm256_cvtepi32_pd(sx[k]), pixel), thin);
          y[k] = _mm256_blendv_pd(y[k], _mm256_mul_pd(_mm256_cvtepi32_pd(sy[k]), pixel), thin);
        }
    }
    for (int k = 0; k < 3; k++) inverseW[k] = _mm256_div_pd(one, w[k]);

    const __m256d x1 = _mm256_sub_pd(x[1], x[0]), y1 = _mm256_sub_pd(y[1], y[0]), x2 = _mm256_sub_pd(x[2], x[0]), y2 = _mm256_sub_pd(y[2], y[0]);
    const __m256d exactArea = _mm256_sub_pd(_mm256_mul_pd(x1, y2), _mm256_mul_pd(x2, y1)), inverse = _mm256_div_pd(one, exactArea);
    const __m256d sign = _mm256_set1_pd(-0.0);
    const Gradients gradients{_mm256_mul_pd(y2, inverse),
                              _mm256_mul_pd(_mm256_xor_pd(y1, sign), inverse),
                              _mm256_mul_pd(_mm256_xor_pd(x2, sign), inverse),
                              _mm256_mul_pd(x1, inverse),
                              x[0],
                              y[0]};
    const __m256d scaleZ = _mm256_set1_pd(transform.scaleZ), offsetZ = _mm256_set1_pd(transform.offsetZ);
    Planes depth = gradients.solve(_mm256_mul_pd(z[0], inverseW[0]), _mm256_mul_pd(z[1], inverseW[1]), _mm256_mul_pd(z[2], inverseW[2]));
    depth.dx = _mm256_mul_pd(depth.dx, scaleZ);
    depth.dy = _mm256_mul_pd(depth.dy, scaleZ);
    depth.origin = _mm256_add_pd(_mm256_mul_pd(depth.origin, scaleZ), offsetZ);
    __m256d usual = _mm256_and_pd(finite(depth.dx, depth.dy), finite(depth.origin, inverse));   // the area is not zero

    // depthOffset() and finishDepth()
    __m256d low = _mm256_set1_pd(std::numeric_limits<double>::infinity()), high = _mm256_set1_pd(-std::numeric_limits<double>::infinity());
    for (int k = 0; k < 3; k++) {
      const __m256d corner = _mm256_add_pd(_mm256_mul_pd(_mm256_div_pd(z[k], w[k]), scaleZ), offsetZ);
      low = _mm256_min_pd(corner, low);
      high = _mm256_max_pd(corner, high);
    }
    const std::optional<double> biasUnit = planes_.biasUnit();
    const __m256d offset = biasUnit ? depthOffsets(state_, *biasUnit, low, high, depth) : zero;
    depth.origin = _mm256_add_pd(depth.origin, offset);
    low = _mm256_add_pd(low, offset);
    high = _mm256_add_pd(high, offset);
    const __m256d gradient = _mm256_add_pd(absolute(depth.dx), absolute(depth.dy));
    const __m256d largest = _mm256_add_pd(_mm256_max_pd(absolute(high), absolute(low)), _mm256_mul_pd(gradient, _mm256_set1_pd(kGridCell + 1)));
    const __m256d margin = _mm256_add_pd(_mm256_mul_pd(gradient, _mm256_set1_pd(kReachPixels)), _mm256_mul_pd(largest, _mm256_set1_pd(0x1p-21)));
    low = _mm256_sub_pd(low, margin);
    high = _mm256_add_pd(high, margin);
    if (state_.depthClampEnable) {
      const __m256d lowest = _mm256_set1_pd(transform.lowZ), highest = _mm256_set1_pd(transform.highZ);
      const auto clamp = [&](__m256d v) __attribute__((always_inline)) {   // std::clamp
        const __m256d raised = _mm256_blendv_pd(v, lowest, _mm256_cmp_pd(v, lowest, _CMP_LT_OQ));
        return _mm256_blendv_pd(raised, highest, _mm256_cmp_pd(highest, v, _CMP_LT_OQ));
      };
      low = clamp(low);
      high = clamp(high);
    }
    const __m256d most = _mm256_set1_pd(kMostDepth);
    usual = _mm256_and_pd(usual, _mm256_and_pd(_mm256_cmp_pd(absolute(low), most, _CMP_LT_OQ), _mm256_cmp_pd(absolute(high), most, _CMP_LT_OQ)));
    const uint32_t odd = left & ~bits(usual);
    special |= odd;
    left ^= odd;
    counters_.input -= uint32_t(std::popcount(odd));   // triangle() counts it
    const __m128 minZ = next(_mm256_cvtpd_ps(low), -1), maxZ = next(_mm256_cvtpd_ps(high), 1);

    // Records of those in one cell, planes of the others.
    static_assert(std::has_single_bit(kGridCell));
    const __m128i cells = _mm_set1_epi32(-int(kGridCell));
    const __m128i many = _mm_and_si128(_mm_or_si128(_mm_xor_si128(minX, maxX), _mm_xor_si128(minY, maxY)), cells);
    PlaneWriter writer;
    writer.inRecords = state_.cellRecords ? left & bits(_mm_cmpeq_epi32(many, _mm_setzero_si128())) : 0;
    writer.whole = left & ~writer.inRecords;
    const __m128i cellX = _mm_and_si128(minX, cells), cellY = _mm_and_si128(minY, cells);
    writer.cellX = _mm256_cvtepi32_pd(cellX);
    writer.cellY = _mm256_cvtepi32_pd(cellY);
    const size_t varyings = state_.varyings.size();
    uint32_t* flat[4] = {};
    alignas(16) std::byte unused[recordBytes(kMaxVaryings) + 4];
    const size_t size = (recordBytes(uint32_t(varyings)) + 4 + 15) & ~size_t(15);
    std::byte* memory = nullptr;
    if (writer.inRecords && !(memory = static_cast<std::byte*>(arena_.allocBytes(size * uint32_t(std::popcount(writer.inRecords)), 16)))) {
      base::logError("raster: out of memory in primitive setup, primitives are lost");
      left &= ~writer.inRecords;
      writer.inRecords = 0;
    }
    for (uint32_t lane = 0; lane < 4; lane++) {
      const bool in = writer.inRecords >> lane & 1;
      writer.records[lane] = reinterpret_cast<float*>(in ? memory : unused);
      four_[lane].record = in ? memory : nullptr;
      four_[lane].planes = nullptr;
      four_[lane].flat = nullptr;
      if (in) memory += size;
    }
    for (uint32_t set = writer.whole; set; set &= set - 1) {
      const int lane = std::countr_zero(set);
      PlaneSet planes;
      if (planes_.allocate(planes)) {
        four_[lane].planes = writer.planes[lane] = planes.planes;
        four_[lane].flat = flat[lane] = planes.flat;
      } else {
        counters_.clippedAway++;
        writer.whole &= ~(1u << lane);
        left &= ~(1u << lane);
      }
    }

    if (writer.inRecords) {
      const __m128i ids = _mm_add_epi32(_mm_set1_epi32(int(firstId)), _mm_setr_epi32(0, 1, 2, 3));
      const __m128i which = _mm_setr_epi32(1, 2, 4, 8);
      __m128 h0 = _mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32(int(front)), which), which)), h1 = _mm_castsi128_ps(ids),
             h2 = _mm_cvtepi32_ps(cellX), h3 = _mm_cvtepi32_ps(cellY);
      _MM_TRANSPOSE4_PS(h0, h1, h2, h3);
      RecordHeader header;
      header.layer = layer_;
      header.viewport = 0;
      header.minDepth = view_->depth.low;
      header.maxDepth = view_->depth.high;
      const __m128 rest = _mm_loadu_ps(reinterpret_cast<const float*>(&header.layer));
      const __m128 head[4] = {h0, h1, h2, h3};
      for (int lane = 0; lane < 4; lane++) {
        _mm_store_ps(writer.records[lane], head[lane]);
        _mm_store_ps(writer.records[lane] + 4, rest);
        writer.records[lane] += kRecordPlanes / 4;
      }
    }
    writer.add(depth, 0);
    writer.add(gradients.solve(inverseW[0], inverseW[1], inverseW[2]), 1);
    for (size_t v = 0; v < varyings; v++) {
      const Varying& varying = state_.varyings[v];
      switch (varying.mode) {
        case VaryingMode::Perspective:
        case VaryingMode::Linear: {
          const Corners corners = loadCorners(vertices_.rows[varying.vertexRow], four, consecutive);
          __m256d f[3];
          for (int k = 0; k < 3; k++) {
            f[k] = _mm256_cvtps_pd(corners.v[k]);
            if (varying.mode == VaryingMode::Perspective) f[k] = _mm256_mul_pd(f[k], inverseW[k]);
          }
          writer.add(gradients.solve(f[0], f[1], f[2]), uint32_t(2 + v));
          break;
        }
        case VaryingMode::Flat: {
          const __m128 words = gather(vertices_.rows[varying.vertexRow], four.provoking);
          if (writer.inRecords) writer.write(words, _mm_setzero_ps(), _mm_setzero_ps());
          alignas(16) uint32_t word[4];
          _mm_store_ps(reinterpret_cast<float*>(word), words);
          for (uint32_t set = writer.whole; set; set &= set - 1) flat[std::countr_zero(set)][v] = word[std::countr_zero(set)];
          break;
        }
        default: writer.add({zero, zero, zero}, uint32_t(2 + v));   // PointCoord
      }
    }

    // The primitives.
    for (int k = 0; k < 3; k++) {
      const __m256i even = _mm256_unpacklo_epi64(ab[k], c[k]), uneven = _mm256_unpackhi_epi64(ab[k], c[k]);
      const auto edge = [&](int lane) __attribute__((always_inline)) { return reinterpret_cast<__m128i*>(&four_[lane].edges[k]); };
      _mm_store_si128(edge(0), _mm256_castsi256_si128(even));
      _mm_store_si128(edge(1), _mm256_castsi256_si128(uneven));
      _mm_store_si128(edge(2), _mm256_extracti128_si256(even, 1));
      _mm_store_si128(edge(3), _mm256_extracti128_si256(uneven, 1));
    }
    __m128 b0 = _mm_castsi128_ps(minX), b1 = _mm_castsi128_ps(minY), b2 = _mm_castsi128_ps(maxX), b3 = _mm_castsi128_ps(maxY);
    _MM_TRANSPOSE4_PS(b0, b1, b2, b3);
    const __m128 boxes[4] = {b0, b1, b2, b3}, z01 = _mm_unpacklo_ps(minZ, maxZ), z23 = _mm_unpackhi_ps(minZ, maxZ);
    const __m128 depths[4] = {z01, _mm_movehl_ps(z01, z01), z23, _mm_movehl_ps(z23, z23)};
    for (uint32_t lane = 0; lane < 4; lane++) {
      Primitive& p = four_[lane];
      static_assert(offsetof(Primitive, maxY) == offsetof(Primitive, minX) + 12 && offsetof(Primitive, maxZ) == offsetof(Primitive, minZ) + 4);
      _mm_storeu_ps(reinterpret_cast<float*>(&p.minX), boxes[lane]);
      _mm_storel_pi(reinterpret_cast<__m64*>(&p.minZ), depths[lane]);
      p.frontFacing = front >> lane & 1;
      p.primitiveId = firstId + lane;
    }
  }

  for (uint32_t set = left | special; set; set &= set - 1) {
    const int lane = std::countr_zero(set);
    if (special >> lane & 1) {
      const uint32_t slots[3] = {four.slots[0][lane], four.slots[1][lane], four.slots[2][lane]};
      triangle(slots, four.provokingCorner[lane], firstId + uint32_t(lane));
    } else {
      out_.push_back(four_[lane]);
    }
  }
  counters_.output += uint32_t(std::popcount(left));
}

#undef PUMICE_INLINE
#pragma GCC pop_options
#else
bool SetupContext::allSlotsExist(std::span<const uint32_t>) const { return false; }
void SetupContext::four(const Four&, uint32_t, uint32_t) {}
#endif

}  // namespace pumice::raster
