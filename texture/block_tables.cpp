#include "texture/block_tables.h"

namespace pumice::texture {
namespace {

// Bit t: the subset of texel t.
constexpr uint16_t kShapes2[64] = {
    0xcccc, 0x8888, 0xeeee, 0xecc8, 0xc880, 0xfeec, 0xfec8, 0xec80, 0xc800, 0xffec, 0xfe80, 0xe800,
    0xffe8, 0xff00, 0xfff0, 0xf000, 0xf710, 0x008e, 0x7100, 0x08ce, 0x008c, 0x7310, 0x3100, 0x8cce,
    0x088c, 0x3110, 0x6666, 0x366c, 0x17e8, 0x0ff0, 0x718e, 0x399c, 0xaaaa, 0xf0f0, 0x5a5a, 0x33cc,
    0x3c3c, 0x55aa, 0x9696, 0xa55a, 0x73ce, 0x13c8, 0x324c, 0x3bdc, 0x6996, 0xc33c, 0x9966, 0x0660,
    0x0272, 0x04e4, 0x4e40, 0x2720, 0xc936, 0x936c, 0x39c6, 0x639c, 0x9336, 0x9cc6, 0x817e, 0xe718,
    0xccf0, 0x0fcc, 0x7744, 0xee22,
};
// Bits 2t, 2t+1: the subset of texel t.
constexpr uint32_t kShapes3[64] = {
    0xaa685050, 0x6a5a5040, 0x5a5a4200, 0x5450a0a8, 0xa5a50000, 0xa0a05050, 0x5555a0a0, 0x5a5a5050, 0xaa550000,
    0xaa555500, 0xaaaa5500, 0x90909090, 0x94949494, 0xa4a4a4a4, 0xa9a59450, 0x2a0a4250, 0xa5945040, 0x0a425054,
    0xa5a5a500, 0x55a0a0a0, 0xa8a85454, 0x6a6a4040, 0xa4a45000, 0x1a1a0500, 0x0050a4a4, 0xaaa59090, 0x14696914,
    0x69691400, 0xa08585a0, 0xaa821414, 0x50a4a450, 0x6a5a0200, 0xa9a58000, 0x5090a0a8, 0xa8a09050, 0x24242424,
    0x00aa5500, 0x24924924, 0x24499224, 0x50a50a50, 0x500aa550, 0xaaaa4444, 0x66660000, 0xa5a0a5a0, 0x50a050a0,
    0x69286928, 0x44aaaa44, 0x66666600, 0xaa444444, 0x54a854a8, 0x95809580, 0x96969600, 0xa85454a8, 0x80959580,
    0xaa141414, 0x96960000, 0xaaaa1414, 0xa05050a0, 0xa0a5a5a0, 0x96000000, 0x40804080, 0xa9a8a9a8, 0xaaaaaa44,
    0x2a4a5254,
};
// One hexadecimal digit a partition.
constexpr char kAnchors2[] = "fffffffffffffffff282288f28228822ff6828ff28222ff66268ff22fffff22f";
constexpr char kAnchors3Second[] = "33ff83ff88666533338f336a588685ff8f356a8ff3f5ffff3f55585a5a8dfc33";
constexpr char kAnchors3Third[] = "f883ff38fffffff8f8f3f8f83f6affa8f3faa89a6f8f3668f3ffffffffff3ff8";
constexpr uint32_t digit(char c) { return uint32_t(c <= '9' ? c - '0' : c - 'a' + 10); }

// "Mode-dependent BPTC parameters": subsets, and the bits of each field.
struct Bc7Parameters {
  uint8_t subsets, partition, rotation, selection, colour, alpha, endpointP, sharedP, index, index2;
};
constexpr Bc7Parameters kBc7[8] = {
    {3, 4, 0, 0, 4, 0, 1, 0, 3, 0}, {2, 6, 0, 0, 6, 0, 0, 1, 3, 0}, {3, 6, 0, 0, 5, 0, 0, 0, 2, 0}, {2, 6, 0, 0, 7, 0, 1, 0, 2, 0},
    {1, 0, 2, 1, 5, 6, 0, 0, 2, 3}, {1, 0, 2, 0, 7, 8, 0, 0, 2, 2}, {1, 0, 0, 0, 7, 7, 1, 0, 4, 0}, {2, 6, 0, 0, 5, 5, 1, 0, 2, 0},
};

constexpr uint32_t bytes(uint32_t a, uint32_t b, uint32_t c, uint32_t d) { return a | b << 8 | c << 16 | d << 24; }

Bc7Mode bc7Mode(uint32_t m) {
  const Bc7Parameters& p = kBc7[m];
  const uint32_t n = p.subsets;
  const uint32_t colour = m + 1 + p.partition + p.rotation + p.selection;
  const uint32_t alpha = colour + 6 * n * p.colour;
  const uint32_t pBits = alpha + 2 * n * p.alpha;
  const uint32_t index = pBits + 2 * n * p.endpointP + n * p.sharedP;
  const uint32_t index2 = index + 16 * p.index - n;
  const uint32_t first = n == 3 ? kPartitionsOfThree : n == 2 ? kPartitionsOfTwo : 0;
  Bc7Mode out;
  out.header = bytes((1u << p.partition) - 1, first, (1u << p.rotation) - 1, p.selection);
  out.colour = bytes(colour, p.colour, 2 * n * p.colour, alpha);
  out.alpha = bytes(p.alpha, pBits, index, p.index2 ? index2 : 0);
  out.rest = bytes(p.index, p.index2, p.endpointP | p.sharedP, p.endpointP);
  return out;
}

// "Endpoint and partition parameters for BPTC block modes" with the rows of "Interpretation of lower/upper bits for BC6H block modes"
// that no run of bits covers: where the block keeps bits 4 and 5 of g2, b2, g3 and the bits of b3 (0: nowhere).
struct Bc6hParameters {
  uint8_t mode;
  bool transformed;
  uint8_t endpoint, delta[3];
  uint8_t highShift[3], highCount;  // bits 10.. of the first endpoint, in the reversed fields 39..44, 49..54, 59..64
  uint8_t scattered[12];
};
constexpr Bc6hParameters kBc6h[] = {
    {0, true, 10, {5, 5, 5}, {}, 0, {2, 0, 3, 0, 40, 0, 50, 60, 70, 76, 4, 0}},
    {1, true, 7, {6, 6, 6}, {}, 0, {24, 2, 14, 22, 3, 4, 12, 13, 23, 32, 34, 33}},
    {2, true, 11, {5, 4, 4}, {4, 5, 5}, 1, {0, 0, 0, 0, 0, 0, 50, 60, 70, 76, 0, 0}},
    {6, true, 11, {4, 5, 4}, {5, 4, 5}, 1, {75, 0, 0, 0, 40, 0, 69, 60, 70, 76, 0, 0}},
    {10, true, 11, {4, 4, 5}, {5, 5, 4}, 1, {0, 0, 40, 0, 0, 0, 50, 69, 70, 76, 75, 0}},
    {14, true, 9, {5, 5, 5}, {}, 0, {24, 0, 14, 0, 40, 0, 50, 60, 70, 76, 34, 0}},
    {18, true, 8, {6, 5, 5}, {}, 0, {24, 0, 14, 0, 13, 0, 50, 60, 23, 33, 34, 0}},
    {22, true, 8, {5, 6, 5}, {}, 0, {24, 23, 14, 0, 40, 33, 13, 60, 70, 76, 34, 0}},
    {26, true, 8, {5, 5, 6}, {}, 0, {24, 0, 14, 23, 40, 0, 50, 13, 70, 76, 34, 33}},
    {30, false, 6, {6, 6, 6}, {}, 0, {24, 21, 14, 22, 11, 31, 12, 13, 23, 32, 34, 33}},
    {3, false, 10, {10, 10, 10}, {}, 0, {}},
    {7, true, 11, {9, 9, 9}, {}, 1, {}},
    {11, true, 12, {8, 8, 8}, {}, 2, {}},
    {15, true, 16, {4, 4, 4}, {}, 6, {}},
};

// Where decodeBc6h() puts bit `p` of the block; bit 0 of its word is always zero.
constexpr uint32_t collectedPlace(uint32_t p) {
  if (p < 32) return p;
  if (p < 35) return p - 32 + 5;
  if (p < 64) return p - 32;
  return p - 64 + 4;
}

Bc6hMode bc6hMode(const Bc6hParameters& p) {
  const bool two = (p.mode & 3) != 3;
  Bc6hMode out{};
  out.header = p.endpoint | uint32_t(two) << 5 | uint32_t(p.transformed) << 6 | 1u << 7;
  for (int c = 0; c < 3; ++c) out.header |= uint32_t(p.delta[c]) << (8 + 4 * c) | uint32_t(p.highShift[c]) << (20 + 3 * c);
  out.header |= uint32_t(p.highCount) << 29;
  for (int i = 0; i < 12; ++i) out.scattered[i / 6] |= collectedPlace(p.scattered[i]) << (5 * (i % 6));
  return out;
}

}  // namespace

BlockTables makeBlockTables(long double (*decodeSrgb)(long double)) {
  constexpr uint32_t kNoAnchor = 16;
  BlockTables t{};
  t.partition[0] = {0, kNoAnchor | kNoAnchor << 8};
  for (uint32_t i = 0; i < 64; ++i) {
    uint32_t shape = 0;
    for (uint32_t k = 0; k < 16; ++k) shape |= (kShapes2[i] >> k & 1u) << (2 * k);
    t.partition[kPartitionsOfTwo + i] = {shape, digit(kAnchors2[i]) | kNoAnchor << 8};
    t.partition[kPartitionsOfThree + i] = {kShapes3[i], digit(kAnchors3Second[i]) | digit(kAnchors3Third[i]) << 8};
  }
  for (uint32_t m = 0; m < 8; ++m) t.bc7[m] = bc7Mode(m);
  for (const Bc6hParameters& p : kBc6h) {
    // Modes 0 and 1 are named by two bits alone.
    const uint32_t step = p.mode < 2 ? 4 : 32;
    for (uint32_t i = p.mode; i < kBc6hModes; i += step) t.bc6h[i] = bc6hMode(p);
  }
  for (uint32_t k = 0; k < kColour5Steps; ++k) t.srgb5[k] = float(decodeSrgb(k / (kColour5Steps - 1.0L)));
  for (uint32_t k = 0; k < kColour6Steps; ++k) t.srgb6[k] = float(decodeSrgb(k / (kColour6Steps - 1.0L)));
  return t;
}

}  // namespace pumice::texture
