// A second decoder of BC1 to BC7, written from the specification's text with plain loops and double, for comparison.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "texture/builders.h"
#include "texture/constants.h"

namespace pumice::texture::reference {

struct Block {
  std::array<uint8_t, 16> bytes{};
  uint32_t bit(unsigned i) const { return i < 128 ? bytes[i / 8] >> (i % 8) & 1u : 0; }
  uint32_t bits(unsigned at, unsigned count) const {
    uint32_t v = 0;
    for (unsigned i = 0; i < count; ++i) v |= bit(at + i) << i;
    return v;
  }
  void set(unsigned at, unsigned count, uint32_t v) {
    for (unsigned i = 0; i < count; ++i) {
      uint8_t m = uint8_t(1u << ((at + i) % 8));
      bytes[(at + i) / 8] = uint8_t((bytes[(at + i) / 8] & ~m) | (v >> i & 1 ? m : 0));
    }
  }
};

using Rgba = std::array<double, 4>;

inline double srgbToLinear(double s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); }

inline Rgba decodeColour(const Block& block, unsigned at, unsigned t, bool always4, bool alpha) {
  uint32_t c[2] = {block.bits(at, 16), block.bits(at + 16, 16)};
  double e[2][3];
  for (int i = 0; i < 2; ++i) {
    e[i][0] = (c[i] >> 11) / 31.0;
    e[i][1] = (c[i] >> 5 & 63) / 63.0;
    e[i][2] = (c[i] & 31) / 31.0;
  }
  unsigned code = block.bits(at + 32 + 2 * t, 2);
  bool four = always4 || c[0] > c[1];
  Rgba out{0, 0, 0, 1};
  for (int k = 0; k < 3; ++k) {
    double a = e[0][k], b = e[1][k];
    const double values4[4] = {a, b, (2 * a + b) / 3, (a + 2 * b) / 3}, values3[4] = {a, b, (a + b) / 2, 0};
    out[k] = four ? values4[code] : values3[code];
  }
  if (!four && code == 3 && alpha) out[3] = 0;
  return out;
}

inline double decodeRamp(const Block& block, unsigned at, unsigned t, bool isSigned) {
  int raw[2];
  double e[2];
  for (int i = 0; i < 2; ++i) {
    raw[i] = isSigned ? int8_t(block.bits(at + 8 * i, 8)) : int(block.bits(at + 8 * i, 8));
    e[i] = isSigned ? std::max(raw[i] / 127.0, -1.0) : raw[i] / 255.0;
  }
  int code = int(block.bits(at + 16 + 3 * t, 3));
  if (code < 2) return e[code];
  if (raw[0] > raw[1]) return ((8 - code) * e[0] + (code - 1) * e[1]) / 7;
  if (code == 6) return isSigned ? -1 : 0;
  if (code == 7) return 1;
  return ((6 - code) * e[0] + (code - 1) * e[1]) / 5;
}

// The partition tables are data, the same for both decoders; another driver's pictures check them (cts_subset).
inline unsigned subsetOf(unsigned subsets, unsigned partition, unsigned t) {
  auto& tables = *reinterpret_cast<const ConstantTables*>(constantTable().data);
  unsigned first = subsets == 2 ? kPartitionsOfTwo : kPartitionsOfThree;
  return subsets == 1 ? 0 : tables.blocks.partition[first + partition].shape >> (2 * t) & 3;
}
inline bool isAnchor(unsigned subsets, unsigned partition, unsigned t) {
  if (t == 0) return true;
  if (subsets == 1) return false;
  auto& tables = *reinterpret_cast<const ConstantTables*>(constantTable().data);
  uint32_t a = tables.blocks.partition[(subsets == 2 ? kPartitionsOfTwo : kPartitionsOfThree) + partition].anchors;
  return t == (a & 31) || (subsets == 3 && t == a >> 8);
}

inline int weight(unsigned bits, unsigned index) {
  static const int w2[] = {0, 21, 43, 64}, w3[] = {0, 9, 18, 27, 37, 46, 55, 64};
  static const int w4[] = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};
  return bits == 2 ? w2[index] : bits == 3 ? w3[index] : w4[index];
}

// Reads the list of indices from `at` up to texel t.
inline unsigned readIndex(const Block& block, unsigned& at, unsigned bits, unsigned subsets, unsigned partition, unsigned t) {
  unsigned value = 0;
  for (unsigned i = 0; i < 16; ++i) {
    unsigned n = bits - isAnchor(subsets, partition, i);
    if (i == t) value = block.bits(at, n);
    at += n;
  }
  return value;
}

inline Rgba decodeBc7(const Block& block, unsigned t) {
  struct Mode {
    int ns, pb, rb, isb, cb, ab, epb, spb, ib, ib2;
  };
  static const Mode modes[8] = {{3, 4, 0, 0, 4, 0, 1, 0, 3, 0}, {2, 6, 0, 0, 6, 0, 0, 1, 3, 0}, {3, 6, 0, 0, 5, 0, 0, 0, 2, 0},
                                {2, 6, 0, 0, 7, 0, 1, 0, 2, 0}, {1, 0, 2, 1, 5, 6, 0, 0, 2, 3}, {1, 0, 2, 0, 7, 8, 0, 0, 2, 2},
                                {1, 0, 0, 0, 7, 7, 1, 0, 4, 0}, {2, 6, 0, 0, 5, 5, 1, 0, 2, 0}};
  unsigned m = 0;
  while (m < 8 && !block.bit(m)) ++m;
  if (m == 8) return {0, 0, 0, 0};
  const Mode& k = modes[m];
  unsigned at = m + 1;
  auto take = [&](unsigned n) {
    uint32_t v = block.bits(at, n);
    at += n;
    return v;
  };
  unsigned partition = take(k.pb), rotation = take(k.rb), selection = take(k.isb);
  unsigned e[6][4];
  for (int c = 0; c < 4; ++c)
    for (int i = 0; i < 2 * k.ns; ++i) e[i][c] = take(c < 3 ? k.cb : k.ab);
  unsigned p[6] = {};
  for (int i = 0; i < 2 * k.ns; ++i)
    if (k.epb) p[i] = take(1);
  for (int i = 0; i < k.ns; ++i)
    if (k.spb) p[2 * i] = p[2 * i + 1] = take(1);
  for (int i = 0; i < 2 * k.ns; ++i) {
    for (int c = 0; c < 4; ++c) {
      int n = c < 3 ? k.cb : k.ab;
      if (n == 0) {
        e[i][c] = 255;
        continue;
      }
      unsigned v = e[i][c];
      if (k.epb || k.spb) v = v << 1 | p[i], ++n;
      v <<= 8 - n;
      e[i][c] = v | v >> n;
    }
  }
  unsigned first = readIndex(block, at, k.ib, k.ns, partition, t);
  int w1 = weight(k.ib, first), w2 = w1;
  if (k.ib2) w2 = weight(k.ib2, readIndex(block, at, k.ib2, k.ns, partition, t));
  if (selection) std::swap(w1, w2);
  unsigned s = subsetOf(k.ns, partition, t);
  unsigned out[4];
  for (int c = 0; c < 4; ++c) {
    int w = c < 3 ? w1 : w2;
    out[c] = ((64 - w) * e[2 * s][c] + w * e[2 * s + 1][c] + 32) >> 6;
  }
  if (rotation) std::swap(out[3], out[rotation - 1]);
  return {out[0] / 255.0, out[1] / 255.0, out[2] / 255.0, out[3] / 255.0};
}

// Where each endpoint's bits lie, lowest first ("Interpretation of lower/upper bits for BC6H block modes").
struct Bc6hText {
  unsigned mode;
  std::string_view places;
};
inline constexpr Bc6hText kBc6hText[] = {
    {0, "r0=5-14 g0=15-24 b0=25-34 r1=35-39 g1=45-49 b1=55-59 r2=65-69 g2=41-44+2 b2=61-64+3 r3=71-75 g3=51-54+40 b3=50+60+70+76+4"},
    {1, "r0=5-11 g0=15-21 b0=25-31 r1=35-40 g1=45-50 b1=55-60 r2=65-70 g2=41-44+24+2 b2=61-64+14+22 r3=71-76 g3=51-54+3-4 b3=12-13+23+32+34+33"},
    {2, "r0=5-14+40 g0=15-24+49 b0=25-34+59 r1=35-39 g1=45-48 b1=55-58 r2=65-69 g2=41-44 b2=61-64 r3=71-75 g3=51-54 b3=50+60+70+76"},
    {6, "r0=5-14+39 g0=15-24+50 b0=25-34+59 r1=35-38 g1=45-49 b1=55-58 r2=65-68 g2=41-44+75 b2=61-64 r3=71-74 g3=51-54+40 b3=69+60+70+76"},
    {10, "r0=5-14+39 g0=15-24+49 b0=25-34+60 r1=35-38 g1=45-48 b1=55-59 r2=65-68 g2=41-44 b2=61-64+40 r3=71-74 g3=51-54 b3=50+69-70+76+75"},
    {14, "r0=5-13 g0=15-23 b0=25-33 r1=35-39 g1=45-49 b1=55-59 r2=65-69 g2=41-44+24 b2=61-64+14 r3=71-75 g3=51-54+40 b3=50+60+70+76+34"},
    {18, "r0=5-12 g0=15-22 b0=25-32 r1=35-40 g1=45-49 b1=55-59 r2=65-70 g2=41-44+24 b2=61-64+14 r3=71-76 g3=51-54+13 b3=50+60+23+33-34"},
    {22, "r0=5-12 g0=15-22 b0=25-32 r1=35-39 g1=45-50 b1=55-59 r2=65-69 g2=41-44+24+23 b2=61-64+14 r3=71-75 g3=51-54+40+33 b3=13+60+70+76+34"},
    {26, "r0=5-12 g0=15-22 b0=25-32 r1=35-39 g1=45-49 b1=55-60 r2=65-69 g2=41-44+24 b2=61-64+14+23 r3=71-75 g3=51-54+40 b3=50+13+70+76+34+33"},
    {30, "r0=5-10 g0=15-20 b0=25-30 r1=35-40 g1=45-50 b1=55-60 r2=65-70 g2=41-44+24+21 b2=61-64+14+22 r3=71-76 g3=51-54+11+31 b3=12-13+23+32+34+33"},
    {3, "r0=5-14 g0=15-24 b0=25-34 r1=35-44 g1=45-54 b1=55-64"},
    {7, "r0=5-14+44 g0=15-24+54 b0=25-34+64 r1=35-43 g1=45-53 b1=55-63"},
    {11, "r0=5-14+44+43 g0=15-24+54+53 b0=25-34+64+63 r1=35-42 g1=45-52 b1=55-62"},
    {15, "r0=5-14+44+43+42+41+40+39 g0=15-24+54+53+52+51+50+49 b0=25-34+64+63+62+61+60+59 r1=35-38 g1=45-48 b1=55-58"},
};

// The bits of three halves.
inline std::array<uint16_t, 3> decodeBc6h(const Block& block, unsigned t, bool isSigned) {
  unsigned name = block.bits(0, 2) < 2 ? block.bits(0, 2) : block.bits(0, 5);
  const Bc6hText* text = nullptr;
  for (const Bc6hText& k : kBc6hText)
    if (k.mode == name) text = &k;
  if (!text) return {0, 0, 0};
  int64_t e[4][3] = {};
  int width[4][3] = {};
  for (size_t i = 0; i < text->places.size();) {
    int c = text->places[i] == 'r' ? 0 : text->places[i] == 'g' ? 1 : 2, n = text->places[i + 1] - '0';
    i += 3;
    auto number = [&] {
      unsigned v = 0;
      while (i < text->places.size() && text->places[i] >= '0' && text->places[i] <= '9') v = v * 10 + unsigned(text->places[i++] - '0');
      return v;
    };
    for (;;) {
      unsigned a = number(), b = a;
      if (i < text->places.size() && text->places[i] == '-') ++i, b = number();
      for (unsigned p = a; p <= b; ++p) e[n][c] |= int64_t(block.bit(p)) << width[n][c]++;
      if (i >= text->places.size() || text->places[i] != '+') break;
      ++i;
    }
    while (i < text->places.size() && text->places[i] == ' ') ++i;
  }
  const bool two = width[2][0] != 0, transformed = name != 30 && name != 3;
  const int epb = width[0][0];
  auto extend = [](int64_t v, int bits) { return v >> (bits - 1) & 1 ? v - (int64_t(1) << bits) : v; };
  for (int n = 1; n < (two ? 4 : 2); ++n)
    for (int c = 0; c < 3; ++c)
      if (transformed) e[n][c] = (e[0][c] + extend(e[n][c], width[n][c])) & ((1 << epb) - 1);
  unsigned partition = two ? block.bits(77, 5) : 0, subsets = two ? 2 : 1, at = two ? 82 : 65;
  unsigned ib = two ? 3 : 4;
  int w = weight(ib, readIndex(block, at, ib, subsets, partition, t));
  unsigned s = subsetOf(subsets, partition, t);
  std::array<uint16_t, 3> out;
  for (int c = 0; c < 3; ++c) {
    int64_t q[2];
    for (int i = 0; i < 2; ++i) {
      int64_t x = e[2 * s + i][c];
      if (!isSigned) {
        q[i] = epb >= 15 ? x : x == 0 ? 0 : x == (1 << epb) - 1 ? 0xffff : ((x << 15) + 0x4000) >> (epb - 1);
      } else {
        x = extend(x, epb);
        int64_t m = std::abs(x);
        if (epb < 16) m = m == 0 ? 0 : m >= (1 << (epb - 1)) - 1 ? 0x7fff : ((m << 15) + 0x4000) >> (epb - 1);
        q[i] = x < 0 ? -m : m;
      }
    }
    int64_t v = ((64 - w) * q[0] + w * q[1] + 32) >> 6;
    out[c] = uint16_t(!isSigned ? v * 31 >> 6 : v < 0 ? ((-v * 31) >> 5) | 0x8000 : (v * 31) >> 5);
  }
  return out;
}

inline double halfToDouble(uint16_t h) {
  int e = h >> 10 & 31, m = h & 1023;
  double v = e == 0 ? std::ldexp(m, -24) : e == 31 ? (m ? NAN : INFINITY) : std::ldexp(1024 + m, e - 25);
  return h & 0x8000 ? -v : v;
}

//! Texel t = y * 4 + x of a block; sRGB formats linear.
inline Rgba decode(const FormatInfo& f, const Block& block, unsigned t) {
  const bool isSigned = f.rgba[0].numeric == Numeric::Snorm || f.rgba[0].numeric == Numeric::Sfloat;
  Rgba c{0, 0, 0, 1};
  switch (f.compression) {
    case Compression::Bc1: c = decodeColour(block, 0, t, false, f.rgba[3].bits != 0); break;
    case Compression::Bc2:
      c = decodeColour(block, 64, t, true, false);
      c[3] = block.bits(4 * t, 4) / 15.0;
      break;
    case Compression::Bc3:
      c = decodeColour(block, 64, t, true, false);
      c[3] = decodeRamp(block, 0, t, false);
      break;
    case Compression::Bc5: c[1] = decodeRamp(block, 64, t, isSigned); [[fallthrough]];
    case Compression::Bc4: c[0] = decodeRamp(block, 0, t, isSigned); break;
    case Compression::Bc6h: {
      auto h = decodeBc6h(block, t, isSigned);
      for (int i = 0; i < 3; ++i) c[i] = halfToDouble(h[i]);
      break;
    }
    case Compression::Bc7: c = decodeBc7(block, t); break;
    case Compression::None: break;
  }
  if (f.rgba[0].numeric == Numeric::Srgb)
    for (int i = 0; i < 3; ++i) c[i] = srgbToLinear(c[i]);
  return c;
}

}  // namespace pumice::texture::reference
