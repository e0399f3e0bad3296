#include "raster/depth_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "base/cpu.h"
#include "raster/depth_avx2.h"

namespace pumice::raster {

namespace {

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

void boundsOfGrid(const DepthEquation& d, DepthKind kind, const Places& first, float step, float* low, float* high) {
  for (int i = 0; i < 16; i++) {
    const float x = float(i & 3) * step, y = float(i >> 2) * step;
    const KeyBounds b = bounds(d, kind, {first.x0 + x, first.y0 + y, first.x1 + x, first.y1 + y});
    low[i] = b.low;
    high[i] = b.high;
  }
}
void boundsOfBlocks(const DepthEquation& d, DepthKind kind, const Places& first, float* low, float* high) {
  boundsOfGrid(d, kind, first, 4, low, high);
}

SquareOutcomes testSquares(const DepthEquation& d, DepthKind kind, VkCompareOp op, const Places& first, const float* storedLow,
                           const float* storedHigh, float* low, float* high) {
  boundsOfGrid(d, kind, first, 16, low, high);
  SquareOutcomes all{};
  for (uint32_t i = 0; i < 16; i++) {
    const Outcome one = compareBounds(op, {low[i], high[i]}, {storedLow[i], storedHigh[i]});
    all.fails |= uint32_t(one == Outcome::Fails) << i;
    all.passes |= uint32_t(one == Outcome::Passes) << i;
  }
  return all;
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

constexpr DepthKernels kPlain = {plain::bounds, plain::boundsOfBlocks, plain::testSquares, plain::write, plain::test};

#if defined(__x86_64__)
// ---- AVX2 and FMA: the same formulas on two vectors of eight
#pragma GCC push_options
#pragma GCC target("avx2,fma")
namespace avx2 {
using namespace depth_avx2;

KeyBounds bounds(const DepthEquation& d, DepthKind kind, const Places& p) { return depth_avx2::bounds(d, kind, p); }

// Of sixteen rectangles, four in a row, `step` apart: eight from row `half * 2` on.
template <int step>
inline __attribute__((always_inline)) void boundsOfHalf(const DepthEquation& d, DepthKind kind, const Places& p, int half, __m256& low, __m256& high) {
  const float xl = d.dx >= 0 ? p.x0 : p.x1, xh = d.dx >= 0 ? p.x1 : p.x0, yl = d.dy >= 0 ? p.y0 : p.y1, yh = d.dy >= 0 ? p.y1 : p.y0;
  const __m256 across = _mm256_setr_ps(0, step, 2 * step, 3 * step, 0, step, 2 * step, 3 * step), down = _mm256_setr_ps(0, 0, 0, 0, step, step, step, step);
  const float y = float(half * 2 * step);
  low = keys(d, kind, _mm256_add_ps(_mm256_set1_ps(xl), across), _mm256_add_ps(_mm256_set1_ps(yl + y), down));
  high = keys(d, kind, _mm256_add_ps(_mm256_set1_ps(xh), across), _mm256_add_ps(_mm256_set1_ps(yh + y), down));
}

void boundsOfBlocks(const DepthEquation& d, DepthKind kind, const Places& p, float* low, float* high) {
  for (int half = 0; half < 2; half++) {
    __m256 l, h;
    boundsOfHalf<4>(d, kind, p, half, l, h);
    _mm256_storeu_ps(low + half * 8, l);
    _mm256_storeu_ps(high + half * 8, h);
  }
}

SquareOutcomes testSquares(const DepthEquation& d, DepthKind kind, VkCompareOp op, const Places& first, const float* storedLow,
                           const float* storedHigh, float* low, float* high) {
  SquareOutcomes all{};
  for (int half = 0; half < 2; half++) {
    __m256 l, h;
    boundsOfHalf<16>(d, kind, first, half, l, h);
    _mm256_storeu_ps(low + half * 8, l);
    _mm256_storeu_ps(high + half * 8, h);
    const __m256 sl = _mm256_loadu_ps(storedLow + half * 8), sh = _mm256_loadu_ps(storedHigh + half * 8);
    const __m256 none = _mm256_setzero_ps(), every = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
    __m256 fails = none, passes = none;
    switch (op) {   // as compareBounds()
      case VK_COMPARE_OP_NEVER: fails = every; break;
      case VK_COMPARE_OP_LESS: fails = _mm256_cmp_ps(l, sh, _CMP_GE_OQ), passes = _mm256_cmp_ps(h, sl, _CMP_LT_OQ); break;
      case VK_COMPARE_OP_EQUAL: fails = _mm256_or_ps(_mm256_cmp_ps(h, sl, _CMP_LT_OQ), _mm256_cmp_ps(l, sh, _CMP_GT_OQ)); break;
      case VK_COMPARE_OP_LESS_OR_EQUAL: fails = _mm256_cmp_ps(l, sh, _CMP_GT_OQ), passes = _mm256_cmp_ps(h, sl, _CMP_LE_OQ); break;
      case VK_COMPARE_OP_GREATER: fails = _mm256_cmp_ps(h, sl, _CMP_LE_OQ), passes = _mm256_cmp_ps(l, sh, _CMP_GT_OQ); break;
      case VK_COMPARE_OP_NOT_EQUAL: passes = _mm256_or_ps(_mm256_cmp_ps(h, sl, _CMP_LT_OQ), _mm256_cmp_ps(l, sh, _CMP_GT_OQ)); break;
      case VK_COMPARE_OP_GREATER_OR_EQUAL: fails = _mm256_cmp_ps(h, sl, _CMP_LT_OQ), passes = _mm256_cmp_ps(l, sh, _CMP_GE_OQ); break;
      default: passes = every; break;
    }
    all.fails |= uint32_t(_mm256_movemask_ps(fails)) << (half * 8);
    all.passes |= uint32_t(_mm256_movemask_ps(_mm256_andnot_ps(fails, passes))) << (half * 8);
  }
  return all;
}

void write(const DepthEquation& d, DepthKind kind, float x, float y, std::byte* memory) {
  const __m256 px = placesX(x);
  storeKeys(kind, memory, keys(d, kind, px, placesY(y), d.inside));
  storeKeys(kind, memory + 8 * depthBytes(kind), keys(d, kind, px, placesY(y + 2), d.inside));
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

}  // namespace avx2
#pragma GCC pop_options

constexpr DepthKernels kAvx2 = {avx2::bounds, avx2::boundsOfBlocks, avx2::testSquares, avx2::write, avx2::test};
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

const DepthKernels& plainDepthKernels() { return kPlain; }

const DepthKernels& depthKernels() {
  static const DepthKernels& chosen = []() -> const DepthKernels& {
    NamedDepthKernels all[2];
    size_t count = availableDepthKernels(all);
    if (!base::mayUseAvx2()) count = 1;
    return *all[count - 1].kernels;
  }();
  return chosen;
}

}  // namespace pumice::raster
