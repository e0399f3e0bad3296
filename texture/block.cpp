// BC1 to BC5, and the way from the decoders' integers to components.
#include "texture/block.h"

#include "texture/constants.h"
#include "texture/pack.h"

namespace pumice::texture {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

Value BlockBits::field(unsigned position, unsigned width) const {
  const unsigned i = position / 32, shift = position % 32;
  Value v = shift ? b.lshr(word[i], b.i32(shift)) : word[i];
  if (shift + width > 32) v = b.or_(v, b.shl(word[i + 1], b.i32(32 - shift)));
  return b.and_(v, b.i32(width == 32 ? ~0u : (1u << width) - 1));
}

Value BlockBits::fieldAt(Value position, Value mask) const {
  Value i = b.lshr(position, b.i32(5));
  Value is0 = b.ieq(i, b.i32(0)), is1 = b.ieq(i, b.i32(1)), is2 = b.ieq(i, b.i32(2));
  Value low = b.select(is0, word[0], b.select(is1, word[1], b.select(is2, word[2], word[3])));
  Value high = b.select(is0, word[1], b.select(is1, word[2], word[3]));
  // Shift counts are taken modulo 32: the upper word moves up by 32 - position % 32, in two steps.
  Value v = b.or_(b.lshr(low, position), b.shl(b.shl(high, b.i32(1)), b.not_(position)));
  return b.and_(v, mask);
}

namespace {

constexpr uint32_t kBlocks = offsetof(ConstantTables, blocks);

// What a component's integer from the decoder is divided by; 1: it is the component.
uint32_t divisorOf(const FormatInfo& f, unsigned c) {
  const bool plain = c == 3 || f.rgba[0].numeric != Numeric::Srgb;
  const uint32_t ramp = 35 * (f.rgba[0].numeric == Numeric::Snorm ? 127u : 255u);
  if (!f.rgba[c].bits || !plain) return 1;
  switch (f.compression) {
    case Compression::Bc1: return c == 3 ? 1 : c == 1 ? kColour6Steps - 1 : kColour5Steps - 1;
    case Compression::Bc2: return c == 3 ? 15 : c == 1 ? kColour6Steps - 1 : kColour5Steps - 1;
    case Compression::Bc3: return c == 3 ? ramp : c == 1 ? kColour6Steps - 1 : kColour5Steps - 1;
    case Compression::Bc4:
    case Compression::Bc5: return ramp;
    case Compression::Bc7: return 255;
    default: return 1;
  }
}

Value toFloat(Builder& b, Value v) { return b.convert(Op::SToF, Type::F32, v); }

// The colour part of BC1 to BC3: two 5:6:5 endpoints and two bits a texel. Weights are in sixths, so that components are integers
// over 186 and 378. Without `transparent` the four-colour code is meant always.
struct Colour {
  Value rgb[3];
  Value black = 0;  // mask: the code that BC1 with alpha gives alpha 0
};
Colour decodeColour(const BlockBits& s, Value endpoints, Value codes, bool punchThrough) {
  Builder& b = s.b;
  Value code = b.and_(b.lshr(codes, b.shl(s.texel, b.i32(1))), b.i32(3));
  // Nibbles by code: weights of the first endpoint, in the upper half of the second.
  constexpr uint32_t kFour = 0x42602406, kThree = 0x03600306;
  Value weights = b.i32(kFour);
  Colour out;
  if (punchThrough) {
    Value four = b.ult(b.lshr(endpoints, b.i32(16)), b.and_(endpoints, b.i32(0xffff)));
    weights = b.select(four, weights, b.i32(kThree));
    out.black = b.maskAnd(b.maskNot(four), b.ieq(code, b.i32(3)));
  }
  Value nibble = b.lshr(weights, b.shl(code, b.i32(2)));
  Value w0 = b.and_(nibble, b.i32(15)), w1 = b.and_(b.lshr(nibble, b.i32(16)), b.i32(15));
  constexpr unsigned kShift[3] = {11, 5, 0}, kBits[3] = {5, 6, 5};
  for (int c = 0; c < 3; ++c) {
    const uint32_t mask = (1u << kBits[c]) - 1;
    Value e0 = b.and_(b.lshr(endpoints, b.i32(kShift[c])), b.i32(mask));
    Value e1 = b.and_(b.lshr(endpoints, b.i32(16 + kShift[c])), b.i32(mask));
    out.rgb[c] = b.iadd(b.imul(e0, w0), b.imul(e1, w1));
  }
  return out;
}

// One component of BC3 (alpha), BC4 and BC5: two 8-bit endpoints and three bits a texel, from words `first` and `first + 1`. In 35ths
// (common to sevenths and fifths) of 1/255 or 1/127.
Value decodeRamp(const BlockBits& s, unsigned first, bool isSigned) {
  Builder& b = s.b;
  Value w0 = s.word[first], w1 = s.word[first + 1];
  Value e0 = isSigned ? b.ashr(b.shl(w0, b.i32(24)), b.i32(24)) : b.and_(w0, b.i32(255));
  Value e1 = isSigned ? b.ashr(b.shl(w0, b.i32(16)), b.i32(24)) : b.and_(b.lshr(w0, b.i32(8)), b.i32(255));
  Value position = b.iadd(b.imul(s.texel, b.i32(3)), b.i32(16));
  Value joined = b.or_(b.lshr(w0, position), b.shl(b.shl(w1, b.i32(1)), b.not_(position)));
  Value code = b.and_(b.select(b.ult(position, b.i32(32)), joined, b.lshr(w1, position)), b.i32(7));

  Value seven = b.slt(e1, e0);
  const uint32_t full = isSigned ? 127 : 255;
  if (isSigned) {
    e0 = b.smax(e0, b.i32(uint32_t(-127)));
    e1 = b.smax(e1, b.i32(uint32_t(-127)));
  }
  Value step = b.imul(b.isub(code, b.i32(1)), b.select(seven, b.i32(5), b.i32(7)));
  Value weight = b.select(b.ult(code, b.i32(2)), b.select(b.ieq(code, b.i32(0)), b.i32(0), b.i32(35)), step);
  Value v = b.iadd(b.imul(e0, b.i32(35)), b.imul(weight, b.isub(e1, e0)));
  Value limit = b.select(b.ieq(code, b.i32(6)), b.i32(isSigned ? uint32_t(-127 * 35) : 0u), b.i32(full * 35));
  v = b.select(b.maskAnd(b.maskNot(seven), b.ule(b.i32(6), code)), limit, v);
  return toFloat(b, v);
}

Value srgb(Builder& b, uint32_t table, Value index) { return b.tableLoad(Type::F32, ir::kTableConstants, table, b.shl(index, b.i32(2))); }

}  // namespace

Texel loadBlockTexel(Builder& b, const FormatInfo& f, Value base, Value offset, Value size, bool constant, Value x, Value y, bool scale) {
  BlockBits s{b};
  for (uint32_t i = 0; i < f.elementBytes / 4u; ++i)
    s.word[i] = constant ? b.loadConst(Type::I32, base, offset, size, 4 * i) : b.load(Type::I32, base, offset, size, 4 * i);
  s.texel = b.or_(b.shl(y, b.i32(2)), x);
  const bool isSrgb = f.rgba[0].numeric == Numeric::Srgb;
  const bool isSigned = f.rgba[0].numeric == Numeric::Snorm || f.rgba[0].numeric == Numeric::Sfloat;
  Texel t = {b.f32(0.0f), b.f32(0.0f), b.f32(0.0f), b.f32(1.0f)};

  switch (f.compression) {
    case Compression::Bc1:
    case Compression::Bc2:
    case Compression::Bc3: {
      const bool bc1 = f.compression == Compression::Bc1;
      Colour c = bc1 ? decodeColour(s, s.word[0], s.word[1], true) : decodeColour(s, s.word[2], s.word[3], false);
      for (int i = 0; i < 3; ++i) {
        const bool six = i == 1;
        t[i] = isSrgb ? srgb(b, kBlocks + uint32_t(six ? offsetof(BlockTables, srgb6) : offsetof(BlockTables, srgb5)), c.rgb[i])
                      : toFloat(b, c.rgb[i]);
      }
      if (bc1 && f.rgba[3].bits) t[3] = b.select(c.black, b.f32(0.0f), b.f32(1.0f));
      if (f.compression == Compression::Bc2) {
        Value half = b.select(b.ult(s.texel, b.i32(8)), s.word[0], s.word[1]);
        t[3] = toFloat(b, b.and_(b.lshr(half, b.shl(s.texel, b.i32(2))), b.i32(15)));
      }
      if (f.compression == Compression::Bc3) t[3] = decodeRamp(s, 0, false);
      break;
    }
    case Compression::Bc5: t[1] = decodeRamp(s, 2, isSigned); [[fallthrough]];
    case Compression::Bc4: t[0] = decodeRamp(s, 0, isSigned); break;
    case Compression::Bc6h: {
      Value rgb[3];
      decodeBc6h(s, isSigned, rgb);
      for (int i = 0; i < 3; ++i)
        t[i] = b.convert(Op::FToF, Type::F32, b.bitcast(Type::F16, b.convert(Op::Trunc, Type::I16, rgb[i])));
      break;
    }
    case Compression::Bc7: {
      Value rgba[4];
      decodeBc7(s, rgba);
      for (int i = 0; i < 4; ++i)
        t[i] = isSrgb && i < 3 ? srgb(b, offsetof(ConstantTables, srgb) + offsetof(SrgbTables, decode), rgba[i]) : toFloat(b, rgba[i]);
      break;
    }
    case Compression::None: break;
  }
  return scale ? scaleBlockTexel(b, f, t) : t;
}

Texel scaleBlockTexel(Builder& b, const FormatInfo& f, const Texel& unscaled) {
  Texel t = unscaled;
  for (unsigned c = 0; c < 4; ++c)
    if (uint32_t divisor = divisorOf(f, c); divisor > 1) t[c] = divideExact(b, t[c], divisor);
  return t;
}

}  // namespace pumice::texture
