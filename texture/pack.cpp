// Bits to components and back, driven by the component descriptors of the format table.
#include "texture/pack.h"

#include <cmath>

#include "texture/constants.h"

namespace pumice::texture {
namespace {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

constexpr float kTwo23 = 8388608.0f;  // from here on f32 has no fraction bits: adding it rounds to an integer, to nearest even

constexpr uint32_t lowMask(unsigned bits) { return bits >= 32 ? ~0u : (1u << bits) - 1; }

struct Place {
  uint32_t word;
  uint32_t shift;
};
Place placeOf(const FormatInfo& f, const Component& c) {
  unsigned unit = typeBytes(rawLoads(f).type) * 8;
  return {c.shift / unit, c.shift % unit};
}

Value bitField(Builder& b, const FormatInfo& f, const RawElement& raw, const Component& c) {
  Place p = placeOf(f, c);
  unsigned unit = typeBytes(rawLoads(f).type) * 8;
  Value v = raw[p.word];
  if (p.shift) v = b.lshr(v, b.i32(p.shift));
  if (p.shift + c.bits < unit) v = b.and_(v, b.i32(lowMask(c.bits)));
  return v;
}

// A field's bits where they stand, if nothing has to be shifted out below it anyway: its value times 2^unshifted().
unsigned unshifted(const FormatInfo& f, const Component& c) {
  Place p = placeOf(f, c);
  return p.shift + c.bits < typeBytes(rawLoads(f).type) * 8 ? p.shift : 0;
}
Value unshiftedBitField(Builder& b, const FormatInfo& f, const RawElement& raw, const Component& c) {
  Place p = placeOf(f, c);
  if (!unshifted(f, c)) return bitField(b, f, raw, c);
  return b.and_(raw[p.word], b.i32(lowMask(c.bits) << p.shift));
}

Value signedBitField(Builder& b, const FormatInfo& f, const RawElement& raw, const Component& c) {
  Place p = placeOf(f, c);
  Value v = raw[p.word];
  unsigned up = 32 - p.shift - c.bits;
  if (up) v = b.shl(v, b.i32(up));
  if (c.bits < 32) v = b.ashr(v, b.i32(32 - c.bits));
  return v;
}

// A small unsigned float with a five-bit exponent is a half without its sign and lowest mantissa bits.
Value decodeSmallFloat(Builder& b, Value bits, unsigned width) {
  if (width < 15) bits = b.shl(bits, b.i32(15 - width));
  Value half = b.bitcast(Type::F16, b.convert(Op::Trunc, Type::I16, bits));
  return b.convert(Op::FToF, Type::F32, half);
}

Value joinWords(Builder& b, Value low, Value high) {
  return b.or_(b.convert(Op::ZExt, Type::I64, low), b.shl(b.convert(Op::ZExt, Type::I64, high), b.i64(32)));
}

bool isUnscaled(const Component& c) { return c.numeric == Numeric::Unorm; }

Value decode(Builder& b, const FormatInfo& f, const RawElement& raw, const Component& c, bool scale) {
  if (c.bits == 64) {
    Place p = placeOf(f, c);
    if (c.numeric != Numeric::Sfloat) return raw[p.word];  // the low word
    return b.convert(Op::FToF, Type::F32, b.bitcast(Type::F64, joinWords(b, raw[p.word], raw[p.word + 1])));
  }
  switch (c.numeric) {
    // Fewer than 32 bits: signed conversion is the same, and a single instruction where the unsigned one is six.
    case Numeric::Unorm: {
      if (!scale) return b.convert(Op::SToF, Type::F32, unshiftedBitField(b, f, raw, c));
      return divideExact(b, b.convert(Op::SToF, Type::F32, bitField(b, f, raw, c)), lowMask(c.bits));
    }
    case Numeric::Snorm: {
      Value v = b.convert(Op::SToF, Type::F32, signedBitField(b, f, raw, c));
      return b.fmax(divideExact(b, v, lowMask(c.bits - 1)), b.f32(-1.0f));
    }
    case Numeric::Uscaled: return b.convert(Op::SToF, Type::F32, bitField(b, f, raw, c));
    case Numeric::Sscaled: return b.convert(Op::SToF, Type::F32, signedBitField(b, f, raw, c));
    case Numeric::Uint: return bitField(b, f, raw, c);
    case Numeric::Sint: return signedBitField(b, f, raw, c);
    case Numeric::Srgb: return b.tableLoad(Type::F32, ir::kTableConstants, offsetof(SrgbTables, decode), b.shl(bitField(b, f, raw, c), b.i32(2)));
    case Numeric::Ufloat: return decodeSmallFloat(b, bitField(b, f, raw, c), c.bits);
    case Numeric::Sfloat:
      if (c.bits == 32) return b.bitcast(Type::F32, raw[placeOf(f, c).word]);
    {
      const Place p = placeOf(f, c);
      return b.convert(Op::FToF, Type::F32, b.bitcast(Type::F16, b.convert(Op::Trunc, Type::I16, p.shift ? b.lshr(raw[p.word], b.i32(p.shift)) : raw[p.word])));
    }
    case Numeric::None: break;
  }
  return b.f32(0.0f);
}

// Round to nearest even of c * scale, one rounding; 0 <= c <= 1, scale = 2^n - 1, n <= 24.
Value roundScaled(Builder& b, Value c, uint32_t scale) {
  Value small = b.isub(b.bitcast(Type::I32, b.fma(c, b.f32(float(scale)), b.f32(kTwo23))), b.i32(std::bit_cast<uint32_t>(kTwo23)));
  if (scale < (1u << 22)) return small;
  // From 2^23 on the product itself is rounded to an integer.
  Value product = b.fmul(c, b.f32(float(scale)));
  return b.select(b.flt(product, b.f32(kTwo23)), small, b.convert(Op::FToU, Type::I32, product));
}

Value clampUnit(Builder& b, Value c) { return b.fmin(b.fmax(c, b.f32(0.0f)), b.f32(1.0f)); }

// Nearest code by the sRGB table: a bucket of the value's upper bits holds at most one threshold.
Value encodeSrgb(Builder& b, Value c) {
  c = b.fmin(b.fmax(c, b.f32(std::bit_cast<float>(kSrgbFirstBits))), b.f32(1.0f));
  Value bucket = b.lshr(b.isub(b.bitcast(Type::I32, c), b.i32(kSrgbFirstBits)), b.i32(kSrgbShift));
  Value offset = b.shl(bucket, b.i32(3));
  constexpr uint32_t kTable = offsetof(SrgbTables, encode);
  Value code = b.tableLoad(Type::I32, ir::kTableConstants, kTable + offsetof(SrgbBucket, code), offset);
  Value threshold = b.tableLoad(Type::F32, ir::kTableConstants, kTable + offsetof(SrgbBucket, threshold), offset);
  return b.select(b.fle(threshold, c), b.iadd(code, b.i32(1)), code);
}

// To five exponent bits and `width - 5` of mantissa, no sign: negative gives 0, finite values stay finite.
Value encodeSmallFloat(Builder& b, Value c, unsigned width) {
  const unsigned mantissa = width - 5;
  const float largest = std::ldexp(2.0f - std::ldexp(1.0f, -int(mantissa)), 15);
  Value x = b.fmin(b.fmax(c, b.f32(0.0f)), b.f32(largest));
  Value bits = b.bitcast(Type::I32, x);
  const unsigned drop = 23 - mantissa;
  Value odd = b.and_(b.lshr(bits, b.i32(drop)), b.i32(1));
  Value rounded = b.lshr(b.iadd(b.iadd(bits, b.i32(lowMask(drop - 1))), odd), b.i32(drop));
  Value normal = b.isub(rounded, b.i32((127 - 15) << mantissa));
  // Below 2^-14 the spacing is constant: adding a number of that spacing rounds.
  const float magic = std::ldexp(1.0f, 23 - 14 - int(mantissa));
  Value denormal = b.isub(b.bitcast(Type::I32, b.fadd(x, b.f32(magic))), b.i32(std::bit_cast<uint32_t>(magic)));
  Value v = b.select(b.flt(x, b.f32(std::ldexp(1.0f, -14))), denormal, normal);
  v = b.select(b.feq(c, b.f32(INFINITY)), b.i32(31u << mantissa), v);
  return b.select(b.fne(c, c), b.i32(31u << mantissa | 1), v);
}

Value clampSigned(Builder& b, Value v, unsigned bits) {
  if (bits >= 32) return v;
  return b.smin(b.smax(v, b.i32(0u - (1u << (bits - 1)))), b.i32(lowMask(bits - 1)));
}

// Component bits in the low bits of an i32; bits above the width may be set for signed ones.
Value encode(Builder& b, const Component& c, Value v, bool inUnit = false) {
  switch (c.numeric) {
    case Numeric::Unorm: return roundScaled(b, inUnit && c.bits <= 16 ? v : clampUnit(b, v), lowMask(c.bits));
    case Numeric::Snorm: {
      constexpr float kMagic = 1.5f * kTwo23;
      Value x = b.fmin(b.fmax(b.select(b.feq(v, v), v, b.f32(0.0f)), b.f32(-1.0f)), b.f32(1.0f));
      return b.isub(b.bitcast(Type::I32, b.fma(x, b.f32(float(lowMask(c.bits - 1))), b.f32(kMagic))), b.i32(std::bit_cast<uint32_t>(kMagic)));
    }
    case Numeric::Uscaled: {
      Value x = b.convert(Op::FToU, Type::I32, b.unary(Op::FRoundEven, v));
      return c.bits < 32 ? b.umin(x, b.i32(lowMask(c.bits))) : x;
    }
    case Numeric::Sscaled: return clampSigned(b, b.convert(Op::FToS, Type::I32, b.unary(Op::FRoundEven, v)), c.bits);
    case Numeric::Uint: return c.bits < 32 ? b.umin(v, b.i32(lowMask(c.bits))) : v;
    case Numeric::Sint: return clampSigned(b, v, c.bits);
    case Numeric::Srgb: return encodeSrgb(b, v);
    case Numeric::Ufloat: return encodeSmallFloat(b, v, c.bits);
    case Numeric::Sfloat:
      if (c.bits == 32) return b.bitcast(Type::I32, v);
      return b.convert(Op::ZExt, Type::I32, b.bitcast(Type::I16, b.convert(Op::FToF, Type::F16, v)));
    case Numeric::None: break;
  }
  return b.i32(0);
}

// E5B9G9R9 (spec, "Shared Exponent to RGB").
constexpr int kSharedBias = 15, kSharedMantissa = 9;

Texel unpackShared(Builder& b, const FormatInfo& f, const RawElement& raw) {
  Value exponent = b.lshr(raw[0], b.i32(27));
  Value scale = b.bitcast(Type::F32, b.shl(b.iadd(exponent, b.i32(127 - kSharedBias - kSharedMantissa)), b.i32(23)));
  Texel t{};
  for (int i = 0; i < 3; ++i) t[i] = b.fmul(b.convert(Op::SToF, Type::F32, bitField(b, f, raw, f.rgba[i])), scale);
  t[3] = b.f32(1.0f);
  return t;
}

RawElement packShared(Builder& b, const FormatInfo& f, const Texel& texel) {
  constexpr float kLargest = 65408.0f;  // 511/512 * 2^16
  Value c[3];
  for (int i = 0; i < 3; ++i) c[i] = b.fmin(b.fmax(texel[i], b.f32(0.0f)), b.f32(kLargest));
  Value largest = b.fmax(b.fmax(c[0], c[1]), c[2]);
  Value log2 = b.isub(b.lshr(b.bitcast(Type::I32, largest), b.i32(23)), b.i32(127));  // floor, far below -16 for denormals
  Value exponent = b.iadd(b.smax(log2, b.i32(uint32_t(-kSharedBias - 1))), b.i32(1 + kSharedBias));
  // Half up, without the sum v + 1/2, which itself would round.
  auto quantise = [&](Value v, Value e) {
    Value scale = b.bitcast(Type::F32, b.shl(b.isub(b.i32(127 + kSharedBias + kSharedMantissa), e), b.i32(23)));
    Value y = b.fmul(v, scale);
    Value floor = b.ffloor(y);
    Value up = b.fle(b.f32(0.5f), b.fsub(y, floor));
    Value n = b.convert(Op::FToU, Type::I32, floor);
    return b.select(up, b.iadd(n, b.i32(1)), n);
  };
  exponent = b.select(b.ieq(quantise(largest, exponent), b.i32(1u << kSharedMantissa)), b.iadd(exponent, b.i32(1)), exponent);
  Value word = b.shl(exponent, b.i32(27));
  for (int i = 0; i < 3; ++i) {
    Value v = quantise(c[i], exponent);
    word = b.or_(word, f.rgba[i].shift ? b.shl(v, b.i32(f.rgba[i].shift)) : v);
  }
  RawElement raw{};
  raw[0] = word;
  return raw;
}

}  // namespace

// The reciprocal in two parts.
Value divideExact(Builder& b, Value v, uint32_t divisor, unsigned exponent) {
  if (divisor == 1) return exponent ? b.fmul(v, b.f32(std::ldexp(1.0f, -int(exponent)))) : v;
  float high = float(1.0 / divisor);
  float low = float(1.0 / divisor - double(high));
  high = std::ldexp(high, -int(exponent));
  low = std::ldexp(low, -int(exponent));
  return b.fma(v, b.f32(high), b.fmul(v, b.f32(low)));
}

RawLoads rawLoads(const FormatInfo& f) {
  if (f.isCompressed()) return {Type::I32, 0};
  unsigned bytes = f.elementBytes;
  Type unit = bytes % 4 == 0 ? Type::I32 : bytes % 2 == 0 ? Type::I16 : Type::I8;
  return {unit, bytes / typeBytes(unit)};
}

const FormatInfo& planeFormat(const FormatInfo& f, VkImageAspectFlags aspect) {
  if (f.isMultiPlanar()) {
    if (aspect & VK_IMAGE_ASPECT_PLANE_0_BIT) return *formatInfo(f.planeFormats[0]);
    if (aspect & VK_IMAGE_ASPECT_PLANE_1_BIT) return *formatInfo(f.planeFormats[1]);
    if (aspect & VK_IMAGE_ASPECT_PLANE_2_BIT && f.planeCount > 2) return *formatInfo(f.planeFormats[2]);
    return f;
  }
  if (!f.hasDepth() || !f.hasStencil()) return f;
  if (aspect & VK_IMAGE_ASPECT_DEPTH_BIT) {
    switch (f.rgba[0].bits) {
      case 16: return *formatInfo(VK_FORMAT_D16_UNORM);
      case 24: return *formatInfo(VK_FORMAT_X8_D24_UNORM_PACK32);
      default: return *formatInfo(VK_FORMAT_D32_SFLOAT);
    }
  }
  return *formatInfo(VK_FORMAT_S8_UINT);
}

Texel unpack(Builder& b, const FormatInfo& f, const RawElement& raw) {
  Texel t;
  for (int c = 0; c < 4; ++c) t[size_t(c)] = unpackComponent(b, f, raw, c, true);
  return t;
}

Value unpackComponent(Builder& b, const FormatInfo& f, const RawElement& raw, int component, bool scale) {
  const Component& c = f.rgba[component];
  if (f.flags & kSharedExponent) return unpackShared(b, f, raw)[size_t(component)];
  if (c.bits) return decode(b, f, raw, c, scale);
  return f.isInteger() ? b.i32(component == 3) : b.f32(component == 3 ? 1.0f : 0.0f);
}

Texel scaleTexel(Builder& b, const FormatInfo& f, const Texel& unscaled) {
  Texel t = unscaled;
  for (int i = 0; i < 4; ++i)
    if (f.rgba[i].bits && isUnscaled(f.rgba[i])) t[i] = divideExact(b, t[i], lowMask(f.rgba[i].bits), unshifted(f, f.rgba[i]));
  return t;
}

RawElement pack(Builder& b, const FormatInfo& f, const Texel& texel) { return packBounded(b, f, texel, 0); }

RawElement packBounded(Builder& b, const FormatInfo& f, const Texel& texel, unsigned inUnit) {
  if (f.flags & kSharedExponent) return packShared(b, f, texel);
  RawLoads loads = rawLoads(f);
  const unsigned unit = typeBytes(loads.type) * 8;
  RawElement raw{};
  for (int i = 0; i < 4; ++i) {
    const Component& c = f.rgba[i];
    if (!c.bits) continue;
    Place p = placeOf(f, c);
    if (c.bits == 64) {
      Value wide;
      if (c.numeric == Numeric::Sfloat) {
        wide = b.bitcast(Type::I64, b.convert(Op::FToF, Type::F64, texel[i]));
      } else {
        wide = b.convert(c.numeric == Numeric::Sint ? Op::SExt : Op::ZExt, Type::I64, texel[i]);
      }
      raw[p.word] = b.convert(Op::Trunc, Type::I32, wide);
      raw[p.word + 1] = b.convert(Op::Trunc, Type::I32, b.lshr(wide, b.i64(32)));
      continue;
    }
    Value v = encode(b, c, texel[i], inUnit >> i & 1);
    bool isSigned = c.numeric == Numeric::Snorm || c.numeric == Numeric::Sscaled || c.numeric == Numeric::Sint;
    // Sign bits may stay where nothing lies above them.
    if (isSigned && c.bits < 32 && !(unit == 32 && p.shift + c.bits == 32)) v = b.and_(v, b.i32(lowMask(c.bits)));
    if (p.shift) v = b.shl(v, b.i32(p.shift));
    raw[p.word] = raw[p.word] ? b.or_(raw[p.word], v) : v;
  }
  for (uint32_t i = 0; i < loads.count; ++i)
    if (!raw[i]) raw[i] = b.i32(0);
  return raw;
}

Value unpackDepth(Builder& b, const FormatInfo& f, Value raw) {
  const FormatInfo& plane = planeFormat(f, VK_IMAGE_ASPECT_DEPTH_BIT);
  RawElement element{};
  switch (b.type(raw)) {
    case Type::I16: element[0] = b.convert(Op::ZExt, Type::I32, raw); break;
    case Type::F32: element[0] = b.bitcast(Type::I32, raw); break;
    default: element[0] = raw; break;
  }
  return decode(b, plane, element, plane.rgba[0], true);
}

Value packDepth(Builder& b, const FormatInfo& f, Value depth) {
  const FormatInfo& plane = planeFormat(f, VK_IMAGE_ASPECT_DEPTH_BIT);
  return plane.rgba[0].numeric == Numeric::Sfloat ? depth : encode(b, plane.rgba[0], depth);
}

RawElement loadRaw(Builder& b, const FormatInfo& f, Value base, Value offset, Value size, bool constant) {
  RawLoads loads = rawLoads(f);
  RawElement raw{};
  if (constant && loads.type == Type::I32 && loads.count % 2 == 0) {
    // Two words at once.
    for (uint32_t i = 0; i < loads.count; i += 2) {
      Value v = b.loadConst(Type::I64, base, offset, size, i * 4);
      raw[i] = b.convert(Op::Trunc, Type::I32, v);
      raw[i + 1] = b.convert(Op::Trunc, Type::I32, b.lshr(v, b.i64(32)));
    }
    return raw;
  }
  for (uint32_t i = 0; i < loads.count; ++i) {
    uint32_t at = i * typeBytes(loads.type);
    Value v = constant ? b.loadConst(loads.type, base, offset, size, at) : b.load(loads.type, base, offset, size, at);
    raw[i] = loads.type == Type::I32 ? v : b.convert(Op::ZExt, Type::I32, v);
  }
  return raw;
}

Texel loadTexel(Builder& b, const FormatInfo& f, Value base, Value offset, Value size, bool constant) {
  return unpack(b, f, loadRaw(b, f, base, offset, size, constant));
}

void storeTexel(Builder& b, const FormatInfo& f, Value base, Value offset, Value size, const Texel& texel) {
  RawLoads loads = rawLoads(f);
  RawElement raw = pack(b, f, texel);
  for (uint32_t i = 0; i < loads.count; ++i) {
    Value v = loads.type == Type::I32 ? raw[i] : b.convert(Op::Trunc, loads.type, raw[i]);
    b.store(base, offset, size, v, i * typeBytes(loads.type));
  }
}

}  // namespace pumice::texture
