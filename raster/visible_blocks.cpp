// Visibility::block() for lists of blocks, with AVX2: the tests and the bookkeeping of all of a primitive's blocks in one function.
#include <bit>

#include "raster/depth_avx2.h"
#include "raster/visibility.h"

namespace pumice::raster {

#if defined(__x86_64__)
#pragma GCC push_options
#pragma GCC target("avx2,fma,popcnt")

namespace {
//! Of sixteen numbers: `number` where the mask is set.
inline __attribute__((always_inline)) __m256i putWhere(__m256i numbers, uint32_t mask, uint16_t number) {
  const __m256i bits = _mm256_setr_epi16(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, -32768);
  const __m256i chosen = _mm256_cmpeq_epi16(_mm256_and_si256(_mm256_set1_epi16(int16_t(mask)), bits), bits);
  return _mm256_blendv_epi8(numbers, _mm256_set1_epi16(int16_t(number)), chosen);
}

//! Where sixteen numbers are equal to `number`.
inline __attribute__((always_inline)) uint32_t equalTo(__m256i numbers, uint16_t number) {
  const __m256i equal = _mm256_cmpeq_epi16(numbers, _mm256_set1_epi16(int16_t(number)));
  return uint32_t(_mm_movemask_epi8(_mm_packs_epi16(_mm256_castsi256_si128(equal), _mm256_extracti128_si256(equal, 1))));
}
}  // namespace

template <bool one>
uint32_t Visibility::takeMixedAvx2(const Sixteen* winners, uint32_t samples, Item* items, uint16_t* masks) {
  const auto load = [&](uint32_t s) __attribute__((always_inline)) { return _mm256_load_si256(reinterpret_cast<const __m256i*>(winners[s].of)); };
  uint32_t count = 0;
  if (one) {
    const __m256i numbers = load(0);
    for (uint32_t left = 0xffff & ~equalTo(numbers, kNone); left;) {
      const uint16_t winner = winners[0].of[std::countr_zero(left)];
      const uint32_t mask = equalTo(numbers, winner);
      items[count].entry = uint16_t(winner - 1);
      masks[count++] = uint16_t(mask);
      left &= ~mask;
    }
    return count;
  }
  uint32_t left[16];
  for (uint32_t s = 0; s < samples; s++) left[s] = 0xffff & ~equalTo(load(s), kNone);
  for (uint32_t s = 0; s < samples; s++)
    while (left[s]) {
      const uint16_t winner = winners[s].of[std::countr_zero(left[s])];
      items[count++].entry = uint16_t(winner - 1);
      for (uint32_t t = 0; t < s; t++) masks[t] = 0;
      for (uint32_t t = s; t < samples; t++) {
        const uint32_t mask = equalTo(load(t), winner);   // never taken before
        left[t] &= ~mask;
        masks[t] = uint16_t(mask);
      }
      masks += samples;
    }
  return count;
}

template <DepthKind kind, bool one>
void Visibility::takeBlocks(Visibility& v, const BlockList& list) {
  const uint32_t samples = one ? 1 : v.samples_;
  const VkCompareOp compare = v.test_.compare;
  const bool write = v.test_.write, hiZ = v.hiZ_;
  const KeyBounds own = v.own_;
  BlockSamples at{samples, v.placeX_, v.placeY_, 0, 0, nullptr, v.memory_.samplePitch};
  uint64_t fragments = 0, tested = 0, rejected = 0, won = 0;
  uint32_t stale = 0;
  const auto number = [&]() __attribute__((always_inline)) { return v.number_ ? v.number_ : v.number(); };
  for (uint32_t i = 0; i < list.count; i++) {
    const uint32_t n = list.numbers[i];
    const uint16_t* masks = list.masks + i * samples;
    uint32_t any = masks[0], every = masks[0], count = uint32_t(__builtin_popcount(masks[0]));
    for (uint32_t s = 1; s < samples; s++) {
      any |= masks[s];
      every &= masks[s];
      count += uint32_t(__builtin_popcount(masks[s]));
    }
    fragments += uint32_t(__builtin_popcount(any));
    tested += count;
    v.spread(n >> 4);
    const KeyBounds stored{v.low_[n], v.high_[n]};
    if (every == 0xffff) {
      if (hiZ && v.tame_) {
        const KeyBounds mine = depth_avx2::bounds(v.equation_, kind, v.placesOf(blockX(n), blockY(n), 4));
        const Outcome outcome = compareBounds(compare, mine, stored);
        if (outcome == Outcome::Fails) {
          rejected += count;
          continue;
        }
        if (outcome == Outcome::Passes) {
          won += count;
          if (v.shaded_) {
            v.owner_[n] = number();
            v.pending_[n >> 6] |= uint64_t(1) << (n & 63);
          }
          if (!write) continue;
          v.source_[n] = number();
          v.virtual_[n >> 6] |= uint64_t(1) << (n & 63);
          v.low_[n] = mine.low;
          v.high_[n] = mine.high;
          stale |= 1u << (n >> 4);
          continue;
        }
      }
    } else if (hiZ && compareBounds(compare, own, stored) == Outcome::Fails) {
      rejected += count;
      continue;
    }
    if (v.source_[n] == kClear) {
      // In whole vectors: what follows reads them, and would wait for smaller stores to reach the cache.
      v.source_[n] = kMemory;
      v.virtual_[n >> 6] &= ~(uint64_t(1) << (n & 63));
      const __m256i cleared = kind == DepthKind::Unorm16 ? _mm256_set1_epi16(int16_t(v.clearStored_)) : _mm256_set1_epi32(int32_t(v.clearStored_));
      for (uint32_t s = 0; s < samples; s++) {
        __m256i* to = reinterpret_cast<__m256i*>(v.depthOf(n, s));
        _mm256_storeu_si256(to, cleared);
        if (kind != DepthKind::Unorm16) _mm256_storeu_si256(to + 1, cleared);
      }
    } else if (v.source_[n] != kMemory) {
      v.makeReal(n);
    }
    at.blockX = float(int(blockX(n)));
    at.blockY = float(int(blockY(n)));
    at.memory = v.depthOf(n, 0);
    uint16_t passed[16];
    KeyBounds after;
    depth_avx2::testKind<kind, one>(v.equation_, compare, write, at, masks, passed, after);
    v.low_[n] = after.low;
    v.high_[n] = after.high;
    stale |= 1u << (n >> 4);

    uint32_t passes = uint32_t(__builtin_popcount(passed[0]));
    every = passed[0];
    for (uint32_t s = 1; s < samples; s++) {
      passes += uint32_t(__builtin_popcount(passed[s]));
      every &= passed[s];
    }
    if (!passes) continue;
    won += passes;
    if (!v.shaded_) continue;
    if (every == 0xffff) {
      v.owner_[n] = number();
      v.pending_[n >> 6] |= uint64_t(1) << (n & 63);
      continue;
    }
    __m256i* winners = reinterpret_cast<__m256i*>(v.winnersOf(n, 0));
    if (const uint16_t owner = v.owner_[n]; owner != kMixed) {
      for (uint32_t s = 0; s < samples; s++) _mm256_store_si256(winners + s, putWhere(_mm256_set1_epi16(int16_t(owner)), passed[s], number()));
      v.owner_[n] = kMixed;
      v.pending_[n >> 6] |= uint64_t(1) << (n & 63);
      continue;
    }
    for (uint32_t s = 0; s < samples; s++) _mm256_store_si256(winners + s, putWhere(_mm256_load_si256(winners + s), passed[s], number()));
  }
  if (stale) {
    v.staleSquares_ |= stale;
    v.tileKnown_ = false;
  }
  v.counters.fragments += fragments;
  v.counters.tested += tested;
  v.counters.rejected += rejected;
  v.counters.passed += won;
  v.drawPassed += won;
  if (v.shaded_) v.runPassed_ += won;
}

#pragma GCC pop_options
#endif

namespace {
bool fits() {
#if defined(__x86_64__)
  static const bool does = &depthKernels() != &plainDepthKernels() && __builtin_cpu_supports("popcnt");
  return does;
#else
  return false;
#endif
}
}  // namespace

Visibility::TakeMixed Visibility::takeMixedFor([[maybe_unused]] uint32_t samples) {
#if defined(__x86_64__)
  if (fits()) return samples == 1 ? takeMixedAvx2<true> : takeMixedAvx2<false>;
#endif
  return takeMixed;
}

Visibility::TakeBlocks Visibility::takeBlocksFor([[maybe_unused]] DepthKind kind, [[maybe_unused]] uint32_t samples) {
#if defined(__x86_64__)
  if (!fits()) return nullptr;
  switch (kind) {
    case DepthKind::Float32: return samples == 1 ? takeBlocks<DepthKind::Float32, true> : takeBlocks<DepthKind::Float32, false>;
    case DepthKind::Unorm16: return samples == 1 ? takeBlocks<DepthKind::Unorm16, true> : takeBlocks<DepthKind::Unorm16, false>;
    case DepthKind::Unorm24: return samples == 1 ? takeBlocks<DepthKind::Unorm24, true> : takeBlocks<DepthKind::Unorm24, false>;
  }
#endif
  return nullptr;
}

}  // namespace pumice::raster
