// BC6H and BC7 (Khronos Data Format Specification, "BPTC Compressed Texture Image Formats"). One piece of code serves every mode: a
// table says where a mode's fields begin, so that neighbours in blocks of different modes take the same way.
#include <cstddef>

#include "texture/block.h"
#include "texture/constants.h"

namespace pumice::texture {
namespace {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

constexpr uint32_t kBlocks = offsetof(ConstantTables, blocks);

Value tableWord(Builder& b, size_t table, size_t field, Value at) {
  return b.tableLoad(Type::I32, ir::kTableConstants, kBlocks + uint32_t(table + field), at);
}
Value byteOf(Builder& b, Value word, unsigned i) {
  Value v = i ? b.lshr(word, b.i32(8 * i)) : word;
  return i < 3 ? b.and_(v, b.i32(255)) : v;
}
Value lowOnes(Builder& b, Value count) { return b.isub(b.shl(b.i32(1), count), b.i32(1)); }
Value toBit(Builder& b, Value mask) { return b.select(mask, b.i32(1), b.i32(0)); }

struct Partition {
  Value subset;    // of the texel
  Value skipped;   // index bits that the anchors before the texel save
  Value isAnchor;  // mask
};
Partition partitionOf(const BlockBits& s, Value entry) {
  Builder& b = s.b;
  constexpr size_t kTable = offsetof(BlockTables, partition);
  Value at = b.shl(entry, b.i32(3));
  Value shape = tableWord(b, kTable, offsetof(BlockPartition, shape), at);
  Value anchors = tableWord(b, kTable, offsetof(BlockPartition, anchors), at);
  Value second = b.and_(anchors, b.i32(31)), third = b.lshr(anchors, b.i32(8));
  Partition p;
  p.subset = b.and_(b.lshr(shape, b.shl(s.texel, b.i32(1))), b.i32(3));
  Value first = b.ult(b.i32(0), s.texel);
  p.skipped = b.iadd(b.iadd(toBit(b, first), toBit(b, b.ult(second, s.texel))), toBit(b, b.ult(third, s.texel)));
  p.isAnchor = b.maskOr(b.maskNot(first), b.maskOr(b.ieq(second, s.texel), b.ieq(third, s.texel)));
  return p;
}

// The texel's index from the list that begins at `position`, `bits` each.
Value indexOf(const BlockBits& s, const Partition& p, Value position, Value bits) {
  Builder& b = s.b;
  Value at = b.isub(b.iadd(position, b.imul(s.texel, bits)), p.skipped);
  Value mask = lowOnes(b, bits);
  return s.fieldAt(at, b.select(p.isAnchor, b.lshr(mask, b.i32(1)), mask));
}

// 64 * index / (2^bits - 1), rounded: 16 fractional bits of the quotient suffice.
Value weightOf(Builder& b, Value index, Value bits) {
  auto factor = [&](uint32_t n) { return b.i32(((64u << 16) + (n >> 1)) / n); };
  Value scale = b.select(b.ieq(bits, b.i32(4)), factor(15), b.select(b.ieq(bits, b.i32(3)), factor(7), factor(3)));
  return b.lshr(b.iadd(b.imul(index, scale), b.i32(1u << 15)), b.i32(16));
}

Value interpolate(Builder& b, Value e0, Value e1, Value weight) {
  Value sum = b.iadd(b.iadd(b.shl(e0, b.i32(6)), b.imul(weight, b.isub(e1, e0))), b.i32(32));
  return b.ashr(sum, b.i32(6));
}

Value signExtend(Builder& b, Value v, Value bits) {
  Value up = b.isub(b.i32(32), bits);
  return b.ashr(b.shl(v, up), up);
}

}  // namespace

void decodeBc7(const BlockBits& s, Value (&rgba)[4]) {
  Builder& b = s.b;
  constexpr size_t kTable = offsetof(BlockTables, bc7);
  Value mode = b.unary(Op::FindLsb, b.or_(b.and_(s.word[0], b.i32(255)), b.i32(256)));  // 8: reserved
  Value at = b.shl(mode, b.i32(4));
  Value header = tableWord(b, kTable, offsetof(Bc7Mode, header), at);
  Value colour = tableWord(b, kTable, offsetof(Bc7Mode, colour), at);
  Value alpha = tableWord(b, kTable, offsetof(Bc7Mode, alpha), at);
  Value rest = tableWord(b, kTable, offsetof(Bc7Mode, rest), at);

  Value afterMode = b.lshr(b.lshr(s.word[0], mode), b.i32(1));
  Partition p = partitionOf(s, b.iadd(byteOf(b, header, 1), b.and_(afterMode, byteOf(b, header, 0))));
  Value rotation = b.and_(afterMode, byteOf(b, header, 2));
  // Only mode 4 has it, in bit 7.
  Value swapIndices = b.ine(b.and_(b.lshr(s.word[0], b.i32(7)), byteOf(b, header, 3)), b.i32(0));

  Value pCount = byteOf(b, rest, 2), perEndpoint = byteOf(b, rest, 3);
  Value pBits = s.fieldAt(b.iadd(byteOf(b, alpha, 1), b.shl(p.subset, perEndpoint)), b.i32(3));
  Value p0 = b.and_(pBits, pCount), p1 = b.and_(b.lshr(pBits, perEndpoint), pCount);

  Value indexBits = byteOf(b, rest, 0), indexBits2 = byteOf(b, rest, 1);
  Value weight = weightOf(b, indexOf(s, p, byteOf(b, alpha, 2), indexBits), indexBits);
  Value weight2 = b.select(b.ieq(indexBits2, b.i32(0)), weight, weightOf(b, indexOf(s, p, byteOf(b, alpha, 3), indexBits2), indexBits2));
  Value colourWeight = b.select(swapIndices, weight2, weight), alphaWeight = b.select(swapIndices, weight, weight2);

  // A pair of neighbouring endpoints, grown to bytes: the p-bit below, then the upper bits repeated.
  auto channel = [&](Value position, Value bits, Value w) {
    Value mask = lowOnes(b, bits);
    Value both = s.fieldAt(b.iadd(position, b.imul(b.shl(p.subset, b.i32(1)), bits)), lowOnes(b, b.shl(bits, b.i32(1))));
    Value total = b.iadd(bits, pCount);
    Value up = b.isub(b.i32(8), total);
    auto grow = [&](Value e, Value pBit) {
      Value v = b.shl(b.or_(b.shl(e, pCount), pBit), up);
      return b.or_(v, b.lshr(v, total));
    };
    return interpolate(b, grow(b.and_(both, mask), p0), grow(b.lshr(both, bits), p1), w);
  };
  Value position = byteOf(b, colour, 0), colourBits = byteOf(b, colour, 1), stride = byteOf(b, colour, 2);
  for (int c = 0; c < 3; ++c) {
    rgba[c] = channel(position, colourBits, colourWeight);
    position = b.iadd(position, stride);
  }
  Value alphaBits = byteOf(b, alpha, 0);
  rgba[3] = b.select(b.ieq(alphaBits, b.i32(0)), b.i32(255), channel(byteOf(b, colour, 3), alphaBits, alphaWeight));

  Value a = rgba[3];
  for (uint32_t c = 0; c < 3; ++c) {
    Value swapped = b.ieq(rotation, b.i32(c + 1));
    Value v = rgba[c];
    rgba[c] = b.select(swapped, a, v);
    rgba[3] = b.select(swapped, v, rgba[3]);
  }
  Value valid = b.ult(mode, b.i32(8));
  for (Value& v : rgba) v = b.select(valid, v, b.i32(0));
}

void decodeBc6h(const BlockBits& s, bool isSigned, Value (&rgb)[3]) {
  Builder& b = s.b;
  constexpr size_t kTable = offsetof(BlockTables, bc6h);
  Value at = b.shl(b.and_(s.word[0], b.i32(31)), b.i32(4));
  Value header = tableWord(b, kTable, offsetof(Bc6hMode, header), at);
  auto part = [&](unsigned shift, unsigned bits) { return b.and_(b.lshr(header, b.i32(shift)), b.i32((1u << bits) - 1)); };
  Value epb = part(0, 5), two = part(5, 1);
  Value transformed = b.ine(part(6, 1), b.i32(0)), valid = b.ine(part(7, 1), b.i32(0));
  Value isTwo = b.ine(two, b.i32(0));

  Partition p = partitionOf(s, b.select(isTwo, b.iadd(s.field(77, 5), b.i32(kPartitionsOfTwo)), b.i32(0)));
  Value indexBits = b.isub(b.i32(4), two);
  Value weight = weightOf(b, indexOf(s, p, b.select(isTwo, b.i32(82), b.i32(65)), indexBits), indexBits);
  Value second = b.ine(p.subset, b.i32(0));

  // The bits of the third and fourth endpoint that lie scattered through the block, collected in one word.
  Value collected = b.or_(b.or_(b.and_(s.word[0], b.i32(0x81e0781c)), b.shl(b.and_(s.word[1], b.i32(7)), b.i32(5))),
                          b.or_(b.and_(s.word[1], b.i32(0x10040100)), b.shl(b.and_(s.word[2], b.i32(0x1860)), b.i32(4))));
  Value places[2] = {tableWord(b, kTable, offsetof(Bc6hMode, scattered), at), tableWord(b, kTable, offsetof(Bc6hMode, scattered) + 4, at)};
  auto scattered = [&](unsigned i, unsigned target) {
    Value place = i % 6 ? b.lshr(places[i / 6], b.i32(5 * (i % 6))) : places[i / 6];
    Value bit = b.and_(b.lshr(collected, place), b.i32(1));
    return target ? b.shl(bit, b.i32(target)) : bit;
  };
  auto upperBits = [&](Value low, unsigned i) { return b.or_(low, b.or_(scattered(i, 4), scattered(i + 1, 5))); };
  Value e2[3] = {s.field(65, 6), upperBits(s.field(41, 4), 0), upperBits(s.field(61, 4), 2)};
  Value e3[3] = {s.field(71, 6), upperBits(s.field(51, 4), 4), 0};
  for (unsigned i = 0; i < 6; ++i) {
    Value bit = scattered(6 + i, i);
    e3[2] = e3[2] ? b.or_(e3[2], bit) : bit;
  }

  Value all = lowOnes(b, epb);
  Value lowMask = b.and_(all, b.i32(1023)), highMask = lowOnes(b, b.lshr(header, b.i32(29)));
  for (unsigned c = 0; c < 3; ++c) {
    Value reversed = b.lshr(b.unary(Op::BitReverse, s.field(39 + 10 * c, 6)), b.i32(26));
    Value high = b.and_(b.lshr(reversed, part(20 + 3 * c, 3)), highMask);
    Value base = b.or_(b.and_(s.field(5 + 10 * c, 10), lowMask), b.shl(high, b.i32(10)));
    Value delta = part(8 + 4 * c, 4);
    Value deltaMask = lowOnes(b, delta);
    Value first = b.and_(e2[c], deltaMask);
    Value last = b.and_(b.select(second, e3[c], s.field(35 + 10 * c, 10)), deltaMask);
    auto resolve = [&](Value e) { return b.select(transformed, b.and_(b.iadd(base, signExtend(b, e, delta)), all), e); };
    Value e[2] = {b.select(second, resolve(first), base), resolve(last)};

    for (Value& v : e) {
      if (isSigned) {
        Value x = signExtend(b, v, epb);
        Value negative = b.slt(x, b.i32(0));
        Value m = b.select(negative, b.isub(b.i32(0), x), x);
        Value half = b.isub(epb, b.i32(1));
        Value grown = b.lshr(b.iadd(b.shl(m, b.i32(15)), b.i32(0x4000)), half);
        Value q = b.select(b.ieq(m, b.i32(0)), m, b.select(b.ule(lowOnes(b, half), m), b.i32(0x7fff), grown));
        q = b.select(negative, b.isub(b.i32(0), q), q);
        v = b.select(b.ule(b.i32(16), epb), x, q);
      } else {
        Value grown = b.lshr(b.iadd(b.shl(v, b.i32(15)), b.i32(0x4000)), b.isub(epb, b.i32(1)));
        Value q = b.select(b.ieq(v, b.i32(0)), v, b.select(b.ieq(v, all), b.i32(0xffff), grown));
        v = b.select(b.ule(b.i32(15), epb), v, q);
      }
    }
    Value i = interpolate(b, e[0], e[1], weight);
    if (isSigned) {
      Value negative = b.slt(i, b.i32(0));
      Value m = b.lshr(b.imul(b.select(negative, b.isub(b.i32(0), i), i), b.i32(31)), b.i32(5));
      i = b.select(negative, b.or_(m, b.i32(0x8000)), m);
    } else {
      i = b.lshr(b.imul(i, b.i32(31)), b.i32(6));
    }
    rgb[c] = b.select(valid, i, b.i32(0));
  }
}

}  // namespace pumice::texture
