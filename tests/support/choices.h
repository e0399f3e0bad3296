// Decisions of a generator: from a seed (the same numbers everywhere), or from a fuzzer's bytes as long as they last.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/ir.h"

namespace pumice::testing {

class Choices {
 public:
  explicit Choices(uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u + 1) {}
  explicit Choices(std::span<const uint8_t> bytes) : Choices(1) { bytes_ = bytes; }

  //! 64 random bits.
  uint64_t next() {
    if (bytes_.empty()) return generate();
    uint64_t v = 0;
    for (int i = 0; i < 8 && !bytes_.empty(); i++) v = v << 8 | take();
    return v;
  }
  //! A number less than n (at least 1).
  uint32_t below(uint32_t n) {
    if (bytes_.empty()) return uint32_t((generate() >> 32) * n >> 32);
    uint32_t v = take();
    if (n > 256 && !bytes_.empty()) v = v << 8 | take();
    return v % n;
  }
  bool chance(uint32_t percent) { return below(100) < percent; }
  template <class T, size_t N>
  const T& of(const T (&list)[N]) {
    return list[below(uint32_t(N))];
  }

 private:
  uint8_t take() {
    const uint8_t b = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return b;
  }
  uint64_t generate() {   // xorshift
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    return state_ * 0x2545f4914f6cdd1du;
  }
  uint64_t state_;
  std::span<const uint8_t> bytes_;
};

//! Bits of a type, the awkward ones often.
inline uint64_t awkwardBits(Choices& r, ir::Type t) {
  static constexpr float kFloats[] = {
      0.0f,         -0.0f,         1.0f,           -1.0f,         0.5f,          -0.5f,          1.5f,          2.5f,
      -2.5f,        3.0f,          0.99999994f,    1e-40f,        -1e-45f,       1.17549435e-38f, 3.4028235e38f, -3.4028235e38f,
      2147483648.0f, -2147483648.0f, 2147483520.0f, 4294967296.0f, 4294967040.0f, 8388608.5f,     16777216.0f,   65504.0f,
      65519.9f,     65520.0f,      6e-8f,          2.9802322e-8f, 9.2233720e18f, 1.8446744e19f,  -9.2233720e18f, 255.5f,
      -128.9f,      127.5f,        32767.9f};
  const uint64_t raw = r.next() & ir::allOnes(t);
  if (t == ir::Type::Mask) return raw & 1;
  if (ir::isFloat(t)) {
    switch (r.below(8)) {
      case 0: return ir::floatBits(t, r.of(kFloats));
      case 1: return ir::floatBits(t, r.chance(50) ? INFINITY : -INFINITY);
      case 2: return r.chance(30) ? ir::floatBits(t, NAN) | (r.next() & 0xff) : raw;
      case 3:
      case 4: return ir::floatBits(t, double(int64_t(raw & 0xffff) - 32768) / 256);
      case 5: return ir::floatBits(t, double(int32_t(raw)));
      default: return raw;
    }
  }
  switch (r.below(6)) {
    case 0: return r.below(4) & ir::allOnes(t);
    case 1: return uint64_t(-int64_t(r.below(4))) & ir::allOnes(t);
    case 2: return (uint64_t(1) << r.below(ir::typeBytes(t) * 8)) & ir::allOnes(t);
    case 3: return ((ir::allOnes(t) >> 1) + r.below(3)) & ir::allOnes(t);
    case 4: return r.below(256) & ir::allOnes(t);
    default: return raw;
  }
}

//! Numbers of ordinary size, so that long computations stay finite and depend on what they are given.
inline uint64_t calmBits(Choices& r, ir::Type t) {
  const uint64_t raw = r.next();
  if (t == ir::Type::Mask) return raw & 1;
  if (ir::isFloat(t)) return ir::floatBits(t, double(int64_t(raw & 0xffffff) - 0x800000) / 0x200000);   // -4 to 4
  return (r.chance(50) ? raw & 0xff : raw) & ir::allOnes(t);
}

}  // namespace pumice::testing
