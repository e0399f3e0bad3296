#include "raster/depth_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "base/env.h"

namespace pumice::raster {

bool DepthEquation::tame() const {
  // Three terms, coordinates below 64: no sum comes near to overflow. False for NaN.
  constexpr float kMost = 0x1p110f;
  return std::fabs(origin) < kMost && std::fabs(dx) < kMost && std::fabs(dy) < kMost;
}

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kTwo23 = 8388608.0f;

float scaleOf(DepthKind kind) { return kind == DepthKind::Unorm16 ? 65535.0f : 16777215.0f; }

// ---- any processor

// The IR's minimum and maximum (ops.inc): a NaN gives way, and of zeros the maximum is +0 and the minimum -0.
float maximum(float a, float b) {
  if (b != b) return a;
  if (a == b) return std::bit_cast<float>(std::bit_cast<uint32_t>(a) & std::bit_cast<uint32_t>(b));
  return b < a ? a : b;
}
float minimum(float a, float b) {
  if (b != b) return a;
  if (a == b) return std::bit_cast<float>(std::bit_cast<uint32_t>(a) | std::bit_cast<uint32_t>(b));
  return a < b ? a : b;
}

float keyAt(const DepthEquation& d, DepthKind kind, float x, float y) {
  const float z = minimum(maximum(std::fma(d.dx, x, std::fma(d.dy, y, d.origin)), d.low), d.high);
  if (kind == DepthKind::Float32) return z;
  const float c = minimum(maximum(z, 0.0f), 1.0f), scale = scaleOf(kind);
  if (kind == DepthKind::Unorm24 && c * scale >= kTwo23) return c * scale;   // rounded to an integer already
  return std::fma(c, scale, kTwo23) - kTwo23;
}

float loadKey(DepthKind kind, const std::byte* memory, uint32_t i) {
  if (kind == DepthKind::Unorm16) {
    uint16_t v;
    std::memcpy(&v, memory + i * 2, 2);
    return float(v);
  }
  uint32_t v;
  std::memcpy(&v, memory + i * 4, 4);
  return depthKey(kind, v);
}

void storeKey(DepthKind kind, std::byte* memory, uint32_t i, float key) {
  if (kind == DepthKind::Float32) {
    std::memcpy(memory + i * 4, &key, 4);
  } else if (kind == DepthKind::Unorm16) {
    const uint16_t v = uint16_t(key);
    std::memcpy(memory + i * 2, &v, 2);
  } else {
    const uint32_t v = uint32_t(key);
    std::memcpy(memory + i * 4, &v, 4);
  }
}

bool passes(VkCompareOp op, float own, float stored) {
  switch (op) {
    case VK_COMPARE_OP_NEVER: return false;
    case VK_COMPARE_OP_LESS: return own < stored;
    case VK_COMPARE_OP_EQUAL: return own == stored;
    case VK_COMPARE_OP_LESS_OR_EQUAL: return own <= stored;
    case VK_COMPARE_OP_GREATER: return own > stored;
    case VK_COMPARE_OP_NOT_EQUAL: return own != stored;
    case VK_COMPARE_OP_GREATER_OR_EQUAL: return own >= stored;
    default: return true;
  }
}

// Place i of a block in quad-major order.
constexpr int placeX(int i) { return (i & 1) | (i >> 1 & 2); }
constexpr int placeY(int i) { return (i >> 1 & 1) | (i >> 2 & 2); }

namespace plain {

KeyBounds bounds(const DepthEquation& d, DepthKind kind, const Places& p) {
  return {keyAt(d, kind, d.dx >= 0 ? p.x0 : p.x1, d.dy >= 0 ? p.y0 : p.y1), keyAt(d, kind, d.dx >= 0 ? p.x1 : p.x0, d.dy >= 0 ? p.y1 : p.y0)};
}

void boundsOfBlocks(const DepthEquation& d, DepthKind kind, const Places& first, float* low, float* high) {
  for (int i = 0; i < 16; i++) {
    const float x = float(i & 3) * 4, y = float(i >> 2) * 4;
    const KeyBounds b = bounds(d, kind, {first.x0 + x, first.y0 + y, first.x1 + x, first.y1 + y});
    low[i] = b.low;
    high[i] = b.high;
  }
}

void write(const DepthEquation& d, DepthKind kind, float x, float y, std::byte* memory) {
  for (int i = 0; i < 16; i++) storeKey(kind, memory, uint32_t(i), keyAt(d, kind, x + float(placeX(i)), y + float(placeY(i))));
}

void test(const DepthEquation& d, DepthKind kind, VkCompareOp compare, bool write, const BlockSamples& samples, const uint16_t* masks,
          uint16_t* passed, KeyBounds& bounds) {
  bounds = {kInfinity, -kInfinity};
  bool ordered = true;
  for (uint32_t s = 0; s < samples.count; s++) {
    const float x = samples.blockX + samples.x[s], y = samples.blockY + samples.y[s];
    std::byte* memory = samples.memory + s * samples.pitch;
    uint32_t pass = 0;
    for (int i = 0; i < 16; i++) {
      const float own = keyAt(d, kind, x + float(placeX(i)), y + float(placeY(i)));
      float stored = loadKey(kind, memory, uint32_t(i));
      if ((masks[s] >> i & 1) && passes(compare, own, stored)) {
        pass |= 1u << i;
        if (write) {
          storeKey(kind, memory, uint32_t(i), own);
          stored = own;
        }
      }
      ordered &= stored == stored;
      bounds.low = std::min(bounds.low, stored);
      bounds.high = std::max(bounds.high, stored);
    }
    passed[s] = uint16_t(pass);
  }
  if (!ordered) bounds = {-kInfinity, kInfinity};
}

}  // namespace plain

constexpr DepthKernels kPlain = {plain::bounds, plain::boundsOfBlocks, plain::write, plain::test};

#if defined(__x86_64__)
// ---- AVX2 and FMA: the same formulas on two vectors of eight
#pragma GCC push_options
#pragma GCC target("avx2,fma")
namespace avx2 {

#define PUMICE_INLINE inline __attribute__((always_inline))

PUMICE_INLINE __m256 maximum(__m256 a, __m256 b) {   // b is no NaN
  const __m256 r = _mm256_blendv_ps(b, a, _mm256_cmp_ps(b, a, _CMP_LT_OQ));
  return _mm256_blendv_ps(r, _mm256_and_ps(a, b), _mm256_cmp_ps(a, b, _CMP_EQ_OQ));
}
PUMICE_INLINE __m256 minimum(__m256 a, __m256 b) {
  const __m256 r = _mm256_blendv_ps(b, a, _mm256_cmp_ps(a, b, _CMP_LT_OQ));
  return _mm256_blendv_ps(r, _mm256_or_ps(a, b), _mm256_cmp_ps(a, b, _CMP_EQ_OQ));
}

PUMICE_INLINE __m256 keys(const DepthEquation& d, DepthKind kind, __m256 x, __m256 y) {
  __m256 z = _mm256_fmadd_ps(_mm256_set1_ps(d.dx), x, _mm256_fmadd_ps(_mm256_set1_ps(d.dy), y, _mm256_set1_ps(d.origin)));
  z = minimum(maximum(z, _mm256_set1_ps(d.low)), _mm256_set1_ps(d.high));
  if (kind == DepthKind::Float32) return z;
  const __m256 c = minimum(maximum(z, _mm256_setzero_ps()), _mm256_set1_ps(1.0f)), scale = _mm256_set1_ps(scaleOf(kind)),
               two23 = _mm256_set1_ps(kTwo23);
  const __m256 small = _mm256_sub_ps(_mm256_fmadd_ps(c, scale, two23), two23);
  if (kind == DepthKind::Unorm16) return small;
  const __m256 product = _mm256_mul_ps(c, scale);
  return _mm256_blendv_ps(product, small, _mm256_cmp_ps(product, two23, _CMP_LT_OQ));
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

PUMICE_INLINE float least(__m256 v) {
  __m128 m = _mm_min_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  m = _mm_min_ps(m, _mm_movehl_ps(m, m));
  return _mm_cvtss_f32(_mm_min_ss(m, _mm_movehdup_ps(m)));
}
PUMICE_INLINE float greatest(__m256 v) {
  __m128 m = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  m = _mm_max_ps(m, _mm_movehl_ps(m, m));
  return _mm_cvtss_f32(_mm_max_ss(m, _mm_movehdup_ps(m)));
}

PUMICE_INLINE __m256 placesX(float x) { return _mm256_add_ps(_mm256_set1_ps(x), _mm256_setr_ps(0, 1, 0, 1, 2, 3, 2, 3)); }
PUMICE_INLINE __m256 placesY(float y) { return _mm256_add_ps(_mm256_set1_ps(y), _mm256_setr_ps(0, 0, 1, 1, 0, 0, 1, 1)); }

KeyBounds bounds(const DepthEquation& d, DepthKind kind, const Places& p) {
  const float xl = d.dx >= 0 ? p.x0 : p.x1, xh = d.dx >= 0 ? p.x1 : p.x0, yl = d.dy >= 0 ? p.y0 : p.y1, yh = d.dy >= 0 ? p.y1 : p.y0;
  const __m256 k = keys(d, kind, _mm256_setr_ps(xl, xh, xl, xl, xl, xl, xl, xl), _mm256_setr_ps(yl, yh, yl, yl, yl, yl, yl, yl));
  return {_mm256_cvtss_f32(k), _mm_cvtss_f32(_mm_movehdup_ps(_mm256_castps256_ps128(k)))};
}

void boundsOfBlocks(const DepthEquation& d, DepthKind kind, const Places& p, float* low, float* high) {
  const float xl = d.dx >= 0 ? p.x0 : p.x1, xh = d.dx >= 0 ? p.x1 : p.x0, yl = d.dy >= 0 ? p.y0 : p.y1, yh = d.dy >= 0 ? p.y1 : p.y0;
  const __m256 across = _mm256_setr_ps(0, 4, 8, 12, 0, 4, 8, 12), down = _mm256_setr_ps(0, 0, 0, 0, 4, 4, 4, 4);
  for (int half = 0; half < 2; half++) {
    const float y = float(half * 8);
    _mm256_storeu_ps(low + half * 8, keys(d, kind, _mm256_add_ps(_mm256_set1_ps(xl), across), _mm256_add_ps(_mm256_set1_ps(yl + y), down)));
    _mm256_storeu_ps(high + half * 8, keys(d, kind, _mm256_add_ps(_mm256_set1_ps(xh), across), _mm256_add_ps(_mm256_set1_ps(yh + y), down)));
  }
}

void write(const DepthEquation& d, DepthKind kind, float x, float y, std::byte* memory) {
  const __m256 px = placesX(x);
  storeKeys(kind, memory, keys(d, kind, px, placesY(y)));
  storeKeys(kind, memory + 8 * depthBytes(kind), keys(d, kind, px, placesY(y + 2)));
}

template <DepthKind kind, bool one>
PUMICE_INLINE void testKind(const DepthEquation& given, VkCompareOp compare, bool write, const BlockSamples& givenSamples, const uint16_t* masks, uint16_t* passed,
                            KeyBounds& bounds) {
  const DepthEquation d = given;   // nothing that is stored changes these
  const BlockSamples samples = givenSamples;
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
      const __m256 own0 = keys(d, kind, px, placesY(y)), own1 = keys(d, kind, px, placesY(y + 2));
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
  bounds = {least(lowest), greatest(highest)};
  if (kind == DepthKind::Float32 && _mm256_movemask_ps(unordered)) bounds = {-kInfinity, kInfinity};
}

void test(const DepthEquation& d, DepthKind kind, VkCompareOp compare, bool write, const BlockSamples& samples, const uint16_t* masks, uint16_t* passed,
          KeyBounds& bounds) {
  const auto run = [&]<bool one>(std::bool_constant<one>) __attribute__((always_inline)) {
    switch (kind) {
      case DepthKind::Unorm16: return testKind<DepthKind::Unorm16, one>(d, compare, write, samples, masks, passed, bounds);
      case DepthKind::Unorm24: return testKind<DepthKind::Unorm24, one>(d, compare, write, samples, masks, passed, bounds);
      default: return testKind<DepthKind::Float32, one>(d, compare, write, samples, masks, passed, bounds);
    }
  };
  samples.count == 1 ? run(std::true_type()) : run(std::false_type());
}

#undef PUMICE_INLINE

}  // namespace avx2
#pragma GCC pop_options

constexpr DepthKernels kAvx2 = {avx2::bounds, avx2::boundsOfBlocks, avx2::write, avx2::test};
#endif

}  // namespace

float depthKey(DepthKind kind, uint32_t stored) {
  return kind == DepthKind::Float32 ? std::bit_cast<float>(stored) : float(kind == DepthKind::Unorm16 ? stored & 0xffff : stored & 0xffffff);
}

size_t availableDepthKernels(NamedDepthKernels (&out)[2]) {
  out[0] = {"plain", &kPlain};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    out[1] = {"avx2", &kAvx2};
    return 2;
  }
#endif
  return 1;
}

const DepthKernels& depthKernels() {
  static const DepthKernels& chosen = []() -> const DepthKernels& {
    NamedDepthKernels all[2];
    size_t count = availableDepthKernels(all);
    const auto isa = base::envString(base::EnvVar::Isa);
    if (isa && (*isa == "sse4" || *isa == "scalar")) count = 1;
    return *all[count - 1].kernels;
  }();
  return chosen;
}

}  // namespace pumice::raster
