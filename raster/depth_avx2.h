// Depths of a block with AVX2 and FMA: the same formulas as depth_block.cpp's for any processor, on two vectors of eight. Internal to
// raster/; for functions of their own target.
#pragma once

#include <cstddef>
#include <limits>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "raster/depth_block.h"

namespace pumice::raster {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline constexpr float kTwo23 = 8388608.0f;

inline float scaleOf(DepthKind kind) { return kind == DepthKind::Unorm16 ? 65535.0f : 16777215.0f; }

#if defined(__x86_64__)
#pragma GCC push_options
#pragma GCC target("avx2,fma")
namespace depth_avx2 {

#define PUMICE_INLINE inline __attribute__((always_inline))

PUMICE_INLINE __m256 maximum(__m256 a, __m256 b) {   // b is no NaN
  const __m256 r = _mm256_blendv_ps(b, a, _mm256_cmp_ps(b, a, _CMP_LT_OQ));
  return _mm256_blendv_ps(r, _mm256_and_ps(a, b), _mm256_cmp_ps(a, b, _CMP_EQ_OQ));
}
PUMICE_INLINE __m256 minimum(__m256 a, __m256 b) {
  const __m256 r = _mm256_blendv_ps(b, a, _mm256_cmp_ps(a, b, _CMP_LT_OQ));
  return _mm256_blendv_ps(r, _mm256_or_ps(a, b), _mm256_cmp_ps(a, b, _CMP_EQ_OQ));
}

//! `inside`: all places that matter are such as DepthEquation::inside speaks of.
PUMICE_INLINE __m256 keys(const DepthEquation& d, DepthKind kind, __m256 x, __m256 y, bool inside = false) {
  __m256 c = _mm256_fmadd_ps(_mm256_set1_ps(d.dx), x, _mm256_fmadd_ps(_mm256_set1_ps(d.dy), y, _mm256_set1_ps(d.origin)));
  if (!inside) c = minimum(maximum(c, _mm256_set1_ps(d.low)), _mm256_set1_ps(d.high));
  if (kind == DepthKind::Float32) return c;
  if (!inside) c = minimum(maximum(c, _mm256_setzero_ps()), _mm256_set1_ps(1.0f));
  const __m256 scale = _mm256_set1_ps(scaleOf(kind)), two23 = _mm256_set1_ps(kTwo23);
  const __m256 small = _mm256_sub_ps(_mm256_fmadd_ps(c, scale, two23), two23);
  if (kind == DepthKind::Unorm16) return small;
  const __m256 product = _mm256_mul_ps(c, scale);
  return _mm256_blendv_ps(product, small, _mm256_cmp_ps(product, two23, _CMP_LT_OQ));
}

//! DepthKernels::bounds().
PUMICE_INLINE KeyBounds bounds(const DepthEquation& d, DepthKind kind, const Places& p) {
  const float xl = d.dx >= 0 ? p.x0 : p.x1, xh = d.dx >= 0 ? p.x1 : p.x0, yl = d.dy >= 0 ? p.y0 : p.y1, yh = d.dy >= 0 ? p.y1 : p.y0;
  const __m256 k = keys(d, kind, _mm256_castps128_ps256(_mm_unpacklo_ps(_mm_set_ss(xl), _mm_set_ss(xh))),
                        _mm256_castps128_ps256(_mm_unpacklo_ps(_mm_set_ss(yl), _mm_set_ss(yh))));
  return {_mm256_cvtss_f32(k), _mm_cvtss_f32(_mm_movehdup_ps(_mm256_castps256_ps128(k)))};
}

PUMICE_INLINE __m256 compareKeys(VkCompareOp op, __m256 own, __m256 stored) {
  switch (op) {
    case VK_COMPARE_OP_NEVER: return _mm256_setzero_ps();
    case VK_COMPARE_OP_LESS: return _mm256_cmp_ps(own, stored, _CMP_LT_OQ);
    case VK_COMPARE_OP_EQUAL: return _mm256_cmp_ps(own, stored, _CMP_EQ_OQ);
    case VK_COMPARE_OP_LESS_OR_EQUAL: return _mm256_cmp_ps(own, stored, _CMP_LE_OQ);
    case VK_COMPARE_OP_GREATER: return _mm256_cmp_ps(own, stored, _CMP_GT_OQ);
    case VK_COMPARE_OP_NOT_EQUAL: return _mm256_cmp_ps(own, stored, _CMP_NEQ_UQ);
    case VK_COMPARE_OP_GREATER_OR_EQUAL: return _mm256_cmp_ps(own, stored, _CMP_GE_OQ);
    default: return _mm256_castsi256_ps(_mm256_set1_epi32(-1));
  }
}

PUMICE_INLINE __m256 loadKeys(DepthKind kind, const std::byte* memory) {
  if (kind == DepthKind::Float32) return _mm256_loadu_ps(reinterpret_cast<const float*>(memory));
  if (kind == DepthKind::Unorm16)
    return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(memory))));
  const __m256i words = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(memory));
  return _mm256_cvtepi32_ps(_mm256_and_si256(words, _mm256_set1_epi32(0xffffff)));
}

PUMICE_INLINE void storeKeys(DepthKind kind, std::byte* memory, __m256 keys) {
  if (kind == DepthKind::Float32) {
    _mm256_storeu_ps(reinterpret_cast<float*>(memory), keys);
    return;
  }
  const __m256i words = _mm256_cvttps_epi32(keys);
  if (kind == DepthKind::Unorm24) {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(memory), words);
    return;
  }
  const __m256i packed = _mm256_permute4x64_epi64(_mm256_packus_epi32(words, words), 0x08);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(memory), _mm256_castsi256_si128(packed));
}

//! Where `chosen`; other elements keep all their bits.
PUMICE_INLINE void storeSome(DepthKind kind, std::byte* memory, __m256 keys, __m256 chosen) {
  if (kind == DepthKind::Unorm16) {
    const __m128i old = _mm_loadu_si128(reinterpret_cast<const __m128i*>(memory));
    const __m256i m = _mm256_castps_si256(chosen), words = _mm256_cvttps_epi32(keys);
    const __m128i narrow = _mm256_castsi256_si128(_mm256_permute4x64_epi64(_mm256_packs_epi32(m, m), 0x08));
    const __m128i fresh = _mm256_castsi256_si128(_mm256_permute4x64_epi64(_mm256_packus_epi32(words, words), 0x08));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(memory), _mm_blendv_epi8(old, fresh, narrow));
    return;
  }
  const __m256 old = _mm256_loadu_ps(reinterpret_cast<const float*>(memory));
  const __m256 fresh = kind == DepthKind::Float32 ? keys : _mm256_castsi256_ps(_mm256_cvttps_epi32(keys));
  _mm256_storeu_ps(reinterpret_cast<float*>(memory), _mm256_blendv_ps(old, fresh, chosen));
}

//! The least of one vector's and the greatest of another's numbers.
PUMICE_INLINE KeyBounds reduced(__m256 lowest, __m256 highest) {
  const __m128 sign = _mm_set1_ps(-0.0f);
  const __m128 low = _mm_min_ps(_mm256_castps256_ps128(lowest), _mm256_extractf128_ps(lowest, 1));
  const __m128 high = _mm_xor_ps(_mm_max_ps(_mm256_castps256_ps128(highest), _mm256_extractf128_ps(highest, 1)), sign);
  const __m128 both = _mm_min_ps(_mm_unpacklo_ps(low, high), _mm_unpackhi_ps(low, high));   // low, -high, low, -high
  const __m128 least = _mm_min_ps(both, _mm_movehl_ps(both, both));
  return {_mm_cvtss_f32(least), _mm_cvtss_f32(_mm_xor_ps(_mm_movehdup_ps(least), sign))};
}

PUMICE_INLINE __m256 placesX(float x) { return _mm256_add_ps(_mm256_set1_ps(x), _mm256_setr_ps(0, 1, 0, 1, 2, 3, 2, 3)); }
PUMICE_INLINE __m256 placesY(float y) { return _mm256_add_ps(_mm256_set1_ps(y), _mm256_setr_ps(0, 0, 1, 1, 0, 0, 1, 1)); }

//! DepthKernels::test() for one kind of memory, and for one sample.
template <DepthKind kind, bool one>
PUMICE_INLINE void testKind(const DepthEquation& given, VkCompareOp compare, bool write, const BlockSamples& givenSamples, const uint16_t* masks, uint16_t* passed,
                            KeyBounds& bounds) {
  const DepthEquation d = given;   // nothing that is stored changes these
  const BlockSamples samples = givenSamples;
  const bool inside = d.inside;
  const __m256i bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128), high = _mm256_slli_epi32(bits, 8);
  __m256 lowest = _mm256_set1_ps(kInfinity), highest = _mm256_set1_ps(-kInfinity), unordered = _mm256_setzero_ps();
  for (uint32_t s = 0; s < (one ? 1 : samples.count); s++) {
    std::byte* memory = samples.memory + s * samples.pitch;
    std::byte* second = memory + 8 * depthBytes(kind);
    __m256 stored0 = loadKeys(kind, memory), stored1 = loadKeys(kind, second);
    uint32_t pass = 0;
    if (one || masks[s]) {
      const float y = samples.blockY + samples.y[s];
      const __m256 px = placesX(samples.blockX + samples.x[s]);
      const __m256 own0 = keys(d, kind, px, placesY(y), inside), own1 = keys(d, kind, px, placesY(y + 2), inside);
      const __m256i all = _mm256_set1_epi32(int(masks[s]));
      const __m256 covered0 = _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(all, bits), bits));
      const __m256 covered1 = _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(all, high), high));
      const __m256 pass0 = _mm256_and_ps(compareKeys(compare, own0, stored0), covered0);
      const __m256 pass1 = _mm256_and_ps(compareKeys(compare, own1, stored1), covered1);
      pass = uint32_t(_mm256_movemask_ps(pass0)) | uint32_t(_mm256_movemask_ps(pass1)) << 8;
      if (write && pass) {
        storeSome(kind, memory, own0, pass0);
        storeSome(kind, second, own1, pass1);
        stored0 = _mm256_blendv_ps(stored0, own0, pass0);
        stored1 = _mm256_blendv_ps(stored1, own1, pass1);
      }
    }
    passed[s] = uint16_t(pass);
    if (kind == DepthKind::Float32) unordered = _mm256_or_ps(unordered, _mm256_cmp_ps(stored0, stored1, _CMP_UNORD_Q));
    lowest = _mm256_min_ps(lowest, _mm256_min_ps(stored0, stored1));
    highest = _mm256_max_ps(highest, _mm256_max_ps(stored0, stored1));
  }
  bounds = reduced(lowest, highest);
  if (kind == DepthKind::Float32 && _mm256_movemask_ps(unordered)) bounds = {-kInfinity, kInfinity};
}

#undef PUMICE_INLINE

}  // namespace depth_avx2
#pragma GCC pop_options
#endif

}  // namespace pumice::raster
