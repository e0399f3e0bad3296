#include "texture/moves.h"

#include <cstring>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace pumice::texture {
namespace {

#if defined(__x86_64__)

bool hasAvx2() { return __builtin_cpu_supports("avx2"); }

// Whole lines of 64 bytes to an address that is a multiple of 16. Far enough ahead the next page is fetched, too, which the
// processor's own prefetcher does not do.
void streamLines(std::byte* out, const std::byte* in, uint64_t lines) {
  constexpr uint64_t kAhead = 1024;
  for (; lines; --lines, out += 64, in += 64) {
    _mm_prefetch(reinterpret_cast<const char*>(in + kAhead), _MM_HINT_T0);
    __m128i v[4];
    for (int i = 0; i < 4; ++i) v[i] = _mm_loadu_si128(reinterpret_cast<const __m128i*>(in) + i);
    for (int i = 0; i < 4; ++i) _mm_stream_si128(reinterpret_cast<__m128i*>(out) + i, v[i]);
  }
  _mm_sfence();
}

uint64_t fillLines(std::byte* out, uint64_t lines, const std::byte* pattern, bool stream) {
  const __m128i a = _mm_loadu_si128(reinterpret_cast<const __m128i*>(pattern)), b = _mm_loadu_si128(reinterpret_cast<const __m128i*>(pattern) + 1);
  auto* to = reinterpret_cast<__m128i*>(out);
  if (stream) {
    for (uint64_t i = 0; i < lines; ++i, to += 4) _mm_stream_si128(to, a), _mm_stream_si128(to + 1, b), _mm_stream_si128(to + 2, a), _mm_stream_si128(to + 3, b);
    _mm_sfence();
  } else {
    for (uint64_t i = 0; i < lines; ++i, to += 4) _mm_storeu_si128(to, a), _mm_storeu_si128(to + 1, b), _mm_storeu_si128(to + 2, a), _mm_storeu_si128(to + 3, b);
  }
  return lines * 64;
}

__attribute__((target("avx2"))) uint64_t fillLinesAvx2(std::byte* out, uint64_t lines, const std::byte* pattern) {
  const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(pattern));
  auto* to = reinterpret_cast<__m256i*>(out);
  for (uint64_t i = 0; i < lines; ++i, to += 2) _mm256_storeu_si256(to, all), _mm256_storeu_si256(to + 1, all);
  return lines * 64;
}

#endif

}  // namespace

void copyBytes(std::byte* out, const std::byte* in, uint64_t bytes, Store store) {
#if defined(__x86_64__)
  if (store == Store::kStream && bytes >= 256) {
    if (const uint64_t head = -reinterpret_cast<uintptr_t>(out) & 15) {
      std::memcpy(out, in, head);
      out += head, in += head, bytes -= head;
    }
    streamLines(out, in, bytes / 64);
    out += bytes & ~uint64_t(63), in += bytes & ~uint64_t(63), bytes &= 63;
  }
#else
  (void)store;
#endif
  if (bytes) std::memcpy(out, in, bytes);
}

void fillBytes(std::byte* out, uint64_t bytes, const std::byte* pattern, Store store) {
#if defined(__x86_64__)
  if (bytes >= 64) {
    const bool stream = store == Store::kStream && reinterpret_cast<uintptr_t>(out) % 16 == 0;
    const uint64_t done = !stream && hasAvx2() ? fillLinesAvx2(out, bytes / 64, pattern) : fillLines(out, bytes / 64, pattern, stream);
    out += done, bytes -= done;
  }
#else
  (void)store;
#endif
  for (; bytes >= 32; bytes -= 32, out += 32) std::memcpy(out, pattern, 32);
  if (bytes) std::memcpy(out, pattern, bytes);
}

}  // namespace pumice::texture
