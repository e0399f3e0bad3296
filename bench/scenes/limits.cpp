#include "bench/scenes/limits.h"

#include <immintrin.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <thread>
#include <vector>

namespace pumice::bench {
namespace {

constexpr size_t kFrameBytes = 1280 * 720 * 4;
constexpr size_t kCopyBytes = 64u << 20;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// The best of many calls: the number of a machine that does nothing else.
double quickest(double seconds, const std::function<void()>& call) {
  double best = 1e30;
  for (double end = now() + seconds, begin = now(); begin < end; begin = now()) {
    call();
    best = std::min(best, now() - begin);
  }
  return best;
}

// `part(index)` on each of `threads` threads at once, again and again; the sum of what they reach.
double together(unsigned threads, double seconds, double amountEach, const std::function<void(unsigned)>& part) {
  std::vector<double> reached(threads);
  std::vector<std::thread> pool;
  for (unsigned i = 0; i < threads; ++i)
    pool.emplace_back([&, i] { reached[i] = amountEach / quickest(seconds, [&] { part(i); }); });
  for (std::thread& thread : pool) thread.join();
  double sum = 0;
  for (double each : reached) sum += each;
  return sum;
}

// Four vectors of pixels side by side, so that latency is hidden. What main() of the scene does for one pixel.
float aluPixels(const float* cx, const float* cy) {
  constexpr int kVectors = 4;
  __m256 zx[kVectors], zy[kVectors], wx[kVectors], wy[kVectors], x[kVectors], y[kVectors], qx[kVectors], qy[kVectors];
  const __m256 half = _mm256_set1_ps(0.5f), quarter = _mm256_set1_ps(0.25f);
  for (int v = 0; v < kVectors; ++v) {
    x[v] = zx[v] = _mm256_loadu_ps(cx + v * 8);
    y[v] = zy[v] = _mm256_loadu_ps(cy + v * 8);
    wx[v] = _mm256_set1_ps(0.1f);
    wy[v] = _mm256_set1_ps(0.2f);
    qx[v] = _mm256_mul_ps(x[v], quarter);
    qy[v] = _mm256_mul_ps(y[v], quarter);
  }
  for (int i = 0; i < kAluTurns; ++i)
    for (int v = 0; v < kVectors; ++v) {
      __m256 squares = _mm256_fmsub_ps(zx[v], zx[v], _mm256_mul_ps(zy[v], zy[v]));
      __m256 product = _mm256_mul_ps(_mm256_add_ps(zx[v], zx[v]), zy[v]);
      zx[v] = _mm256_fmadd_ps(squares, half, x[v]);
      zy[v] = _mm256_fmadd_ps(product, half, y[v]);
      wx[v] = _mm256_fmadd_ps(wx[v], zx[v], qx[v]);
      wy[v] = _mm256_fmadd_ps(wy[v], zy[v], qy[v]);
    }
  __m256 sum = _mm256_setzero_ps();
  for (int v = 0; v < kVectors; ++v)
    sum = _mm256_add_ps(sum, _mm256_add_ps(_mm256_add_ps(zx[v], zy[v]), _mm256_add_ps(wx[v], wy[v])));
  alignas(32) float out[8];
  _mm256_store_ps(out, sum);
  return out[0] + out[1] + out[2] + out[3] + out[4] + out[5] + out[6] + out[7];
}

}  // namespace

Limits measureLimits(unsigned threads, double seconds) {
  Limits limits;
  limits.threads = threads;
  std::vector<std::vector<char>> from(threads, std::vector<char>(kCopyBytes, 1)), to = from;
  int value = 0;
  // A frame's buffer, shared among the threads as a driver would.
  limits.fillBytesPerSecond = together(threads, seconds, double(kFrameBytes / threads), [&](unsigned i) {
    std::memset(to[i].data(), ++value & 255, kFrameBytes / threads);
    asm volatile("" ::"r"(to[i].data()) : "memory");
  });
  limits.largeFillBytesPerSecond = together(threads, seconds, double(kCopyBytes), [&](unsigned i) {
    std::memset(to[i].data(), 7, kCopyBytes);
    asm volatile("" ::"r"(to[i].data()) : "memory");
  });
  limits.copyBytesPerSecond = together(threads, seconds, 2.0 * double(kCopyBytes), [&](unsigned i) {
    std::memcpy(to[i].data(), from[i].data(), kCopyBytes);
    asm volatile("" ::"r"(to[i].data()) : "memory");
  });
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    constexpr int kGroups = 256;
    std::vector<float> x(32), y(32);
    for (int i = 0; i < 32; ++i) x[size_t(i)] = 0.01f * float(i) - 0.2f, y[size_t(i)] = 0.2f - 0.012f * float(i);
    std::vector<float> sink(threads * 64);
    limits.aluFlopsPerSecond =
        together(threads, seconds, 32.0 * kGroups * kAluTurns * kAluFlopsPerTurn, [&](unsigned i) {
          for (int group = 0; group < kGroups; ++group) sink[i * 64] += aluPixels(x.data(), y.data());
        });
    asm volatile("" ::"r"(sink.data()) : "memory");
  }
  return limits;
}

std::string describe(const Limits& limits) {
  char text[320];
  std::snprintf(text, sizeof text,
                R"({"threads": %u, "fill_bytes_per_second": %.4g, "large_fill_bytes_per_second": %.4g, "copy_bytes_per_second": %.4g, "alu_flops_per_second": %.4g})",
                limits.threads, limits.fillBytesPerSecond, limits.largeFillBytesPerSecond, limits.copyBytesPerSecond, limits.aluFlopsPerSecond);
  return text;
}

}  // namespace pumice::bench
