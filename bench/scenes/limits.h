// What this machine can do at most, measured: the ends that scenes are held against.
#pragma once

#include <string>

namespace pumice::bench {

// The loop of the scene `alu`.
inline constexpr int kAluTurns = 256;
// Two squares and a difference (3), a product doubled (2), half of each plus c (4); w: four products or sums, and c / 4
// stands outside the loop (4).
inline constexpr int kAluFlopsPerTurn = 13;

struct Limits {
  unsigned threads = 1;
  double fillBytesPerSecond = 0;  // memset, all threads, buffers of a frame's size
  double largeFillBytesPerSecond = 0;  // likewise, of a buffer too large for the caches
  double copyBytesPerSecond = 0;  // memcpy, bytes read plus bytes written
  double aluFlopsPerSecond = 0;   // the loop of `alu`, AVX2 and FMA, written by hand; 0 without them
};

Limits measureLimits(unsigned threads, double secondsEach);
std::string describe(const Limits& limits);  // JSON

}  // namespace pumice::bench
