// unpack() and pack() against a reference in extended precision that reads the bits by itself.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "tests/texture/run_ir.h"

namespace pumice::texture {
namespace {

using ir::Type;

bool convertible(const FormatInfo& f) { return !f.isCompressed() && !f.isMultiPlanar() && !(f.hasDepth() && f.hasStencil()); }

// The element as bytes, from the loads' words.
std::array<uint8_t, 32> elementBytes(const FormatInfo& f, const std::vector<std::vector<uint32_t>>& words, size_t n) {
  std::array<uint8_t, 32> bytes{};
  RawLoads loads = rawLoads(f);
  unsigned unit = typeBytes(loads.type);
  for (uint32_t i = 0; i < loads.count; ++i) std::memcpy(bytes.data() + i * unit, &words[i][n], unit);
  return bytes;
}

uint64_t bitsAt(const std::array<uint8_t, 32>& bytes, unsigned shift, unsigned count) {
  uint64_t v = 0;
  for (unsigned i = 0; i < count; ++i) v |= uint64_t(bytes[(shift + i) / 8] >> ((shift + i) % 8) & 1) << i;
  return v;
}

int64_t signExtend(uint64_t v, unsigned bits) { return bits == 64 ? int64_t(v) : int64_t(v << (64 - bits)) >> (64 - bits); }

long double smallFloat(uint64_t v, unsigned exponentBits, unsigned mantissaBits) {
  int bias = (1 << (exponentBits - 1)) - 1;
  uint64_t mantissa = v & ((1u << mantissaBits) - 1);
  int exponent = int(v >> mantissaBits & ((1u << exponentBits) - 1));
  bool negative = v >> (mantissaBits + exponentBits) & 1;
  long double x;
  if (exponent == (1 << exponentBits) - 1) {
    x = mantissa ? NAN : INFINITY;
  } else if (exponent == 0) {
    x = std::ldexp((long double)mantissa, 1 - bias - int(mantissaBits));
  } else {
    x = std::ldexp((long double)(mantissa | 1u << mantissaBits), exponent - bias - int(mantissaBits));
  }
  return negative ? -x : x;
}

long double decodeReference(const Component& c, uint64_t v) {
  long double largest = std::ldexp(1.0L, int(c.bits)) - 1;
  switch (c.numeric) {
    case Numeric::Unorm: return v / largest;
    case Numeric::Snorm: return std::max(-1.0L, signExtend(v, c.bits) / (std::ldexp(1.0L, int(c.bits) - 1) - 1));
    case Numeric::Uscaled: return v;
    case Numeric::Sscaled: return signExtend(v, c.bits);
    case Numeric::Srgb: {
      long double s = v / 255.0L;
      return s <= 0.04045L ? s / 12.92L : std::pow((s + 0.055L) / 1.055L, 2.4L);
    }
    case Numeric::Ufloat: return smallFloat(v, 5, c.bits - 5);
    case Numeric::Sfloat:
      if (c.bits == 16) return smallFloat(v, 5, 10);
      if (c.bits == 32) return std::bit_cast<float>(uint32_t(v));
      return std::bit_cast<double>(v);
    default: return 0;
  }
}

long double sharedReference(const std::array<uint8_t, 32>& bytes, int i) {
  return std::ldexp((long double)bitsAt(bytes, 9 * unsigned(i), 9), int(bitsAt(bytes, 27, 5)) - 15 - 9);
}

// Exhaustive for elements up to 16 bits; else random, every component also with its extremes.
std::vector<std::vector<uint32_t>> rawSamples(const FormatInfo& f) {
  RawLoads loads = rawLoads(f);
  std::vector<std::vector<uint32_t>> words(loads.count);
  if (f.elementBytes <= 2) {
    for (uint32_t v = 0; v < 1u << (8 * f.elementBytes); ++v) words[0].push_back(v);
    return words;
  }
  std::mt19937_64 random(f.format);
  uint32_t unitMask = typeBytes(loads.type) == 4 ? ~0u : (1u << 8 * typeBytes(loads.type)) - 1;
  for (int n = 0; n < 40000; ++n)
    for (auto& w : words) {
      uint32_t v = uint32_t(random());
      if (n % 8 == 0) v = 0;
      if (n % 8 == 1) v = ~0u;
      if (n % 8 == 2) v = 0x80808080;
      if (n % 16 == 3) v &= 0xff80ff80;  // exponents' extremes
      w.push_back(v & unitMask);
    }
  return words;
}

bool sameFloat(uint32_t bits, long double expected) {
  float got = std::bit_cast<float>(bits), want = float(expected);
  return std::isnan(want) ? std::isnan(got) : bits == std::bit_cast<uint32_t>(want) || (got == 0 && want == 0);
}

TEST(Unpack, EveryFormatIsExact) {
  for (const FormatInfo& f : allFormats()) {
    if (!convertible(f)) continue;
    SCOPED_TRACE(f.name);
    RawLoads loads = rawLoads(f);
    IrProgram program(loads.count, 4, [&](ir::Builder& b) {
      RawElement raw{};
      for (uint32_t i = 0; i < loads.count; ++i) raw[i] = b.input(Type::I32, i);
      Texel t = unpack(b, f, raw);
      for (uint32_t i = 0; i < 4; ++i) b.output(i, t[i]);
    });
    ASSERT_TRUE(program);
    auto words = rawSamples(f);
    auto out = program.run(words);
    for (size_t n = 0; n < words[0].size(); ++n) {
      auto bytes = elementBytes(f, words, n);
      for (int i = 0; i < 4; ++i) {
        const Component& c = f.rgba[i];
        uint32_t got = out[i][n];
        if (!c.bits) {
          ASSERT_EQ(got, i < 3 ? 0u : f.isInteger() ? 1u : std::bit_cast<uint32_t>(1.0f));
        } else if (f.flags & kSharedExponent) {
          ASSERT_TRUE(sameFloat(got, sharedReference(bytes, i))) << n << ' ' << i;
        } else if (f.isInteger()) {
          uint64_t v = bitsAt(bytes, c.shift, c.bits);
          ASSERT_EQ(got, c.numeric == Numeric::Sint ? uint32_t(signExtend(v, c.bits)) : uint32_t(v)) << n << ' ' << i;
        } else {
          long double want = decodeReference(c, bitsAt(bytes, c.shift, c.bits));
          ASSERT_TRUE(sameFloat(got, want)) << "element " << n << " component " << i << ": " << std::bit_cast<float>(got) << " for " << double(want);
        }
      }
    }
  }
}

// The code that encoding c should give (finite c).
uint64_t encodeReference(const Component& c, float value) {
  long double x = std::isnan(value) ? 0.0L : value;
  uint64_t mask = c.bits == 64 ? ~uint64_t(0) : (uint64_t(1) << c.bits) - 1;
  auto even = [](long double v) { return int64_t(std::nearbyint(v)); };
  switch (c.numeric) {
    case Numeric::Unorm: return uint64_t(even(std::clamp(x, 0.0L, 1.0L) * mask)) & mask;
    case Numeric::Snorm: return uint64_t(even(std::clamp(x, -1.0L, 1.0L) * (mask >> 1))) & mask;
    case Numeric::Uscaled: return uint64_t(even(std::clamp(x, 0.0L, (long double)mask)));
    case Numeric::Sscaled: return uint64_t(even(std::clamp(x, -(long double)(mask >> 1) - 1, (long double)(mask >> 1)))) & mask;
    case Numeric::Srgb: {
      x = std::clamp(x, 0.0L, 1.0L);
      long double s = x <= 0.0031308L ? 12.92L * x : 1.055L * std::pow(x, 1 / 2.4L) - 0.055L;
      return uint64_t(even(s * 255));
    }
    case Numeric::Sfloat:
      if (c.bits == 32) return std::bit_cast<uint32_t>(value);
      if (c.bits == 64) return std::bit_cast<uint64_t>(double(value));
      break;
    default: break;
  }
  return 0;
}

// Nearest value of a small float format by search; ties to even codes. `largest` is the code of the largest finite value.
uint64_t nearestSmall(long double x, unsigned mantissaBits, uint64_t largest) {
  uint64_t low = 0, high = largest + 1;
  while (high - low > 1) {
    uint64_t middle = (low + high) / 2;
    (smallFloat(middle, 5, mantissaBits) <= x ? low : high) = middle;
  }
  if (low == largest) return low;
  long double below = x - smallFloat(low, 5, mantissaBits), above = smallFloat(low + 1, 5, mantissaBits) - x;
  return below < above || (below == above && low % 2 == 0) ? low : low + 1;
}

std::vector<float> floatSamples(const FormatInfo& f) {
  std::vector<float> v = {0.0f, -0.0f, 1.0f, -1.0f, 0.5f, 2.0f, -3.0f, 1e-8f, 1e-30f, 1e-42f, 65504.0f, 65520.0f, 1e9f, -1e9f, 3e38f,
                          INFINITY, -INFINITY, NAN, 0.0031308f, std::nextafter(0.0031308f, 1.0f)};
  std::mt19937 random(f.format);
  std::uniform_real_distribution<float> unit(-1.1f, 1.1f);
  for (int i = 0; i < 10000; ++i) v.push_back(unit(random));
  for (int i = 0; i < 10000; ++i) v.push_back(std::bit_cast<float>(uint32_t(random())));
  // Around every rounding boundary of the narrow components.
  for (const Component& c : f.rgba) {
    if (c.numeric != Numeric::Unorm && c.numeric != Numeric::Snorm && c.numeric != Numeric::Srgb) continue;
    uint32_t largest = uint32_t((uint64_t(1) << (c.numeric == Numeric::Snorm ? c.bits - 1 : c.bits)) - 1);
    for (uint32_t k = 0; k < largest; k += largest > 4096 ? 97 : 1) {
      double edge = (k + 0.5) / largest;
      if (c.numeric == Numeric::Srgb) edge = edge <= 0.04045 ? edge / 12.92 : std::pow((edge + 0.055) / 1.055, 2.4);
      float e = float(edge);
      for (float x : {e, std::nextafter(e, 0.0f), std::nextafter(e, 1.0f), float(double(k) / largest)}) {
        v.push_back(x);
        if (c.numeric == Numeric::Snorm) v.push_back(-x);
      }
    }
  }
  return v;
}

TEST(Pack, EveryFloatFormatRoundsCorrectly) {
  for (const FormatInfo& f : allFormats()) {
    if (!convertible(f) || f.isInteger() || (f.flags & kSharedExponent)) continue;
    SCOPED_TRACE(f.name);
    RawLoads loads = rawLoads(f);
    IrProgram program(4, loads.count, [&](ir::Builder& b) {
      Texel t;
      for (uint32_t i = 0; i < 4; ++i) t[i] = b.input(Type::F32, i);
      RawElement raw = pack(b, f, t);
      for (uint32_t i = 0; i < loads.count; ++i) b.output(i, raw[i]);
    });
    ASSERT_TRUE(program);
    auto samples = floatSamples(f);
    std::vector<std::vector<uint32_t>> in(4);
    for (size_t n = 0; n < samples.size(); ++n)
      for (size_t i = 0; i < 4; ++i) in[i].push_back(std::bit_cast<uint32_t>(samples[(n + i * 7) % samples.size()]));
    auto out = program.run(in);
    for (size_t n = 0; n < samples.size(); ++n) {
      auto bytes = elementBytes(f, out, n);
      for (int i = 0; i < 4; ++i) {
        const Component& c = f.rgba[i];
        if (!c.bits) continue;
        float value = std::bit_cast<float>(in[i][n]);
        uint64_t got = bitsAt(bytes, c.shift, c.bits);
        if (c.numeric == Numeric::Sfloat && c.bits == 16) {
          uint64_t code = std::abs(value) >= 65520.0f ? 31u << 10 : nearestSmall(std::abs((long double)value), 10, (31u << 10) - 1);
          if (std::isnan(value)) {
            ASSERT_TRUE((got & 0x7c00) == 0x7c00 && (got & 0x3ff));
          } else {
            ASSERT_EQ(got, code | (std::signbit(value) ? 0x8000u : 0u)) << value;
          }
        } else if (c.numeric == Numeric::Ufloat) {
          unsigned mantissa = c.bits - 5u;
          uint64_t infinity = 31u << mantissa;
          if (std::isnan(value)) {
            ASSERT_GT(got, infinity);
          } else {
            uint64_t want = value == INFINITY ? infinity : value <= 0 ? 0 : nearestSmall(value, mantissa, infinity - 1);
            ASSERT_EQ(got, want) << value;
          }
        } else if (c.numeric == Numeric::Sfloat && std::isnan(value)) {
          ASSERT_TRUE(std::isnan(decodeReference(c, got)));
        } else if (std::isnan(value) && (c.numeric == Numeric::Uscaled || c.numeric == Numeric::Sscaled)) {
          ASSERT_EQ(got, 0u);
        } else {
          ASSERT_EQ(got, encodeReference(c, value)) << "component " << i << " of value " << value << " (" << std::hexfloat << value << ")";
        }
      }
    }
  }
}

TEST(Pack, IntegersAreClamped) {
  for (const FormatInfo& f : allFormats()) {
    if (!convertible(f) || !f.isInteger()) continue;
    SCOPED_TRACE(f.name);
    RawLoads loads = rawLoads(f);
    IrProgram program(4, loads.count, [&](ir::Builder& b) {
      Texel t;
      for (uint32_t i = 0; i < 4; ++i) t[i] = b.input(Type::I32, i);
      RawElement raw = pack(b, f, t);
      for (uint32_t i = 0; i < loads.count; ++i) b.output(i, raw[i]);
    });
    ASSERT_TRUE(program);
    std::mt19937 random(f.format);
    std::vector<std::vector<uint32_t>> in(4);
    for (int n = 0; n < 4000; ++n)
      for (auto& row : in) row.push_back(n % 2 ? uint32_t(random()) : uint32_t(int32_t(random()) >> (random() % 32)));
    auto out = program.run(in);
    for (size_t n = 0; n < in[0].size(); ++n) {
      auto bytes = elementBytes(f, out, n);
      for (int i = 0; i < 4; ++i) {
        const Component& c = f.rgba[i];
        if (!c.bits) continue;
        bool isSigned = c.numeric == Numeric::Sint;
        int64_t v = isSigned ? int64_t(int32_t(in[i][n])) : int64_t(in[i][n]);
        if (c.bits < 64) {
          int64_t highest = isSigned ? (int64_t(1) << (c.bits - 1)) - 1 : (int64_t(1) << c.bits) - 1;
          v = std::clamp(v, isSigned ? -highest - 1 : 0, highest);
        }
        uint64_t want = c.bits == 64 ? uint64_t(v) : uint64_t(v) & ((uint64_t(1) << c.bits) - 1);
        ASSERT_EQ(bitsAt(bytes, c.shift, c.bits), want);
      }
    }
  }
}

TEST(Pack, SharedExponentFollowsTheSpecification) {
  const FormatInfo& f = *formatInfo(VK_FORMAT_E5B9G9R9_UFLOAT_PACK32);
  IrProgram program(3, 1, [&](ir::Builder& b) {
    Texel t{};
    for (uint32_t i = 0; i < 3; ++i) t[i] = b.input(Type::F32, i);
    b.output(0, pack(b, f, t)[0]);
  });
  ASSERT_TRUE(program);
  std::mt19937 random(5);
  std::vector<std::vector<uint32_t>> in(3);
  auto push = [&](float x, float y, float z) {
    in[0].push_back(std::bit_cast<uint32_t>(x));
    in[1].push_back(std::bit_cast<uint32_t>(y));
    in[2].push_back(std::bit_cast<uint32_t>(z));
  };
  push(0, 0, 0), push(1, 0.5f, 0.25f), push(65408, 1, 0), push(1e9f, -1, NAN), push(511.99f, 255.9999f, 0.9990234f), push(1e-30f, 1e-40f, 0), push(INFINITY, 0, 1);
  for (int n = 0; n < 50000; ++n) {
    auto value = [&] { return std::ldexp(float(random() % (1 << 24)) / (1 << 24), int(random() % 40) - 22); };
    push(value(), value(), value());
  }
  auto out = program.run(in);
  for (size_t n = 0; n < in[0].size(); ++n) {
    long double c[3];
    for (int i = 0; i < 3; ++i) {
      float x = std::bit_cast<float>(in[i][n]);
      c[i] = std::isnan(x) ? 0.0L : std::clamp((long double)x, 0.0L, 65408.0L);
    }
    long double largest = std::max({c[0], c[1], c[2]});
    int exponent = std::max(-16, largest > 0 ? std::ilogb(largest) : -16) + 16;
    if (std::floor(largest / std::ldexp(1.0L, exponent - 24) + 0.5L) == 512) ++exponent;
    uint32_t want = uint32_t(exponent) << 27;
    for (int i = 0; i < 3; ++i) want |= uint32_t(std::floor(c[i] / std::ldexp(1.0L, exponent - 24) + 0.5L)) << (9 * i);
    ASSERT_EQ(out[0][n], want) << n;
  }
}

TEST(Depth, RoundTripsAndRoundsToNearest) {
  for (VkFormat format : {VK_FORMAT_D16_UNORM, VK_FORMAT_X8_D24_UNORM_PACK32, VK_FORMAT_D24_UNORM_S8_UINT, VK_FORMAT_D32_SFLOAT, VK_FORMAT_D32_SFLOAT_S8_UINT}) {
    const FormatInfo& f = *formatInfo(format);
    SCOPED_TRACE(f.name);
    IrProgram program(1, 2, [&](ir::Builder& b) {
      ir::Value packed = packDepth(b, f, b.input(Type::F32, 0));
      b.output(0, b.bitcast(Type::I32, packed));
      b.output(1, unpackDepth(b, f, packed));
    });
    ASSERT_TRUE(program);
    std::mt19937 random(3);
    std::vector<std::vector<uint32_t>> in(1);
    for (int n = 0; n < 200000; ++n) in[0].push_back(std::bit_cast<uint32_t>(float(random()) / 4294967296.0f));
    for (float x : {0.0f, 1.0f, 0.5f, 0.25f}) in[0].push_back(std::bit_cast<uint32_t>(x));
    auto out = program.run(in);
    for (size_t n = 0; n < in[0].size(); ++n) {
      float x = std::bit_cast<float>(in[0][n]);
      if (f.rgba[0].numeric == Numeric::Sfloat) {
        ASSERT_EQ(out[0][n], in[0][n]);
        ASSERT_EQ(out[1][n], in[0][n]);
      } else {
        uint32_t largest = (1u << f.rgba[0].bits) - 1;
        ASSERT_EQ(out[0][n], uint32_t(std::nearbyint((long double)x * largest))) << x;
        ASSERT_EQ(std::bit_cast<float>(out[1][n]), float((long double)out[0][n] / largest));
      }
    }
  }
}

// The two-part reciprocal gives the correctly rounded quotient for every code of every width.
TEST(Depth, All24BitCodesUnpackExactly) {
  const FormatInfo& f = *formatInfo(VK_FORMAT_X8_D24_UNORM_PACK32);
  IrProgram program(1, 1, [&](ir::Builder& b) { b.output(0, unpackDepth(b, f, b.input(Type::I32, 0))); });
  ASSERT_TRUE(program);
  for (uint32_t at = 0; at < 1u << 24; at += 1u << 20) {
    std::vector<std::vector<uint32_t>> in(1);
    for (uint32_t i = 0; i < 1u << 20; ++i) in[0].push_back(at + i);
    auto out = program.run(in);
    for (uint32_t i = 0; i < 1u << 20; ++i) ASSERT_EQ(std::bit_cast<float>(out[0][i]), float(double(at + i) / 16777215.0)) << at + i;
  }
}

}  // namespace
}  // namespace pumice::texture
