// Blending, logic operations, write masks and packing of one colour attachment (Vulkan spec, "The Framebuffer").
#include <algorithm>

#include "pipeline/builders.h"
#include "texture/pack.h"

namespace pumice::pipeline {

using ir::Op;
using ir::Type;
using ir::Value;
using texture::FormatInfo;
using texture::Numeric;
using texture::RawElement;
using texture::Texel;

namespace {

bool isFixedPoint(Numeric n) { return n == Numeric::Unorm || n == Numeric::Snorm || n == Numeric::Srgb; }

bool blends(const GraphicsState& s, const FormatInfo& f, uint32_t attachment) {
  return attachment < s.blend.size() && s.blend[attachment].blendEnable && !s.logicOpEnable && !f.isInteger();
}

bool appliesLogic(const GraphicsState& s, const FormatInfo& f) {
  if (!s.logicOpEnable || s.logicOp == VK_LOGIC_OP_COPY) return false;
  const Numeric n = f.rgba[0].numeric;
  return n == Numeric::Unorm || n == Numeric::Snorm || n == Numeric::Uint || n == Numeric::Sint;
}

VkColorComponentFlags writeMask(const GraphicsState& s, uint32_t attachment) {
  return attachment < s.blend.size() ? s.blend[attachment].colorWriteMask : 0;
}

//! Which bits of the element's words a write mask lets through.
std::array<uint32_t, 8> maskWords(const FormatInfo& f, VkColorComponentFlags mask) {
  std::array<uint32_t, 8> words{};
  for (uint32_t c = 0; c < 4; ++c)
    if (mask & (1u << c))
      for (uint32_t bit = f.rgba[c].shift; bit < uint32_t(f.rgba[c].shift) + f.rgba[c].bits; ++bit) words[bit / 32] |= 1u << (bit % 32);
  return words;
}

bool coversAll(const FormatInfo& f, VkColorComponentFlags mask) { return maskWords(f, mask) == maskWords(f, 15); }

RawElement loadRaw(ir::Builder& b, const FormatInfo& f, uint32_t plane) {
  RawElement raw{};
  const texture::RawLoads loads = texture::rawLoads(f);
  for (uint32_t i = 0; i < loads.count; ++i) {
    const Value v = b.tileLoad(loads.type, plane, f.elementBytes, i * ir::typeBytes(loads.type));
    raw[i] = loads.type == Type::I32 ? v : b.convert(Op::ZExt, Type::I32, v);
  }
  return raw;
}

void storeRaw(ir::Builder& b, const FormatInfo& f, uint32_t plane, const RawElement& raw) {
  const texture::RawLoads loads = texture::rawLoads(f);
  if (loads.type == Type::I32 && loads.count % 2 == 0) {
    // Pairs of words: an element of 8 bytes is written at once, with its neighbours.
    for (uint32_t i = 0; i < loads.count; i += 2)
      b.tileStore(plane, f.elementBytes, i * 4,
                  b.or_(b.convert(Op::ZExt, Type::I64, raw[i]), b.shl(b.convert(Op::ZExt, Type::I64, raw[i + 1]), b.i64(32))));
    return;
  }
  for (uint32_t i = 0; i < loads.count; ++i) {
    const Value v = loads.type == Type::I32 ? raw[i] : b.convert(Op::Trunc, loads.type, raw[i]);
    b.tileStore(plane, f.elementBytes, i * ir::typeBytes(loads.type), v);
  }
}

struct Sources { const Texel &source, &source1, &destination, &constant; };

//! The blend factor of component c; 0 for ZERO, and `one` set for ONE.
Value factor(ir::Builder& b, VkBlendFactor f, const Sources& s, uint32_t c, bool& one) {
  const auto complement = [&](Value v) { return b.fsub(b.f32(1), v); };
  one = false;
  switch (f) {
    case VK_BLEND_FACTOR_ZERO: return 0;
    case VK_BLEND_FACTOR_SRC_COLOR: return s.source[c];
    case VK_BLEND_FACTOR_ONE_MINUS_SRC_COLOR: return complement(s.source[c]);
    case VK_BLEND_FACTOR_DST_COLOR: return s.destination[c];
    case VK_BLEND_FACTOR_ONE_MINUS_DST_COLOR: return complement(s.destination[c]);
    case VK_BLEND_FACTOR_SRC_ALPHA: return s.source[3];
    case VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA: return complement(s.source[3]);
    case VK_BLEND_FACTOR_DST_ALPHA: return s.destination[3];
    case VK_BLEND_FACTOR_ONE_MINUS_DST_ALPHA: return complement(s.destination[3]);
    case VK_BLEND_FACTOR_CONSTANT_COLOR: return s.constant[c];
    case VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_COLOR: return complement(s.constant[c]);
    case VK_BLEND_FACTOR_CONSTANT_ALPHA: return s.constant[3];
    case VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_ALPHA: return complement(s.constant[3]);
    case VK_BLEND_FACTOR_SRC_ALPHA_SATURATE:
      if (c < 3) return b.fmin(s.source[3], complement(s.destination[3]));
      break;
    case VK_BLEND_FACTOR_SRC1_COLOR: return s.source1[c];
    case VK_BLEND_FACTOR_ONE_MINUS_SRC1_COLOR: return complement(s.source1[c]);
    case VK_BLEND_FACTOR_SRC1_ALPHA: return s.source1[3];
    case VK_BLEND_FACTOR_ONE_MINUS_SRC1_ALPHA: return complement(s.source1[3]);
    default: break;
  }
  one = true;
  return b.f32(1);
}

Value blendComponent(ir::Builder& b, VkBlendOp op, VkBlendFactor sourceFactor, VkBlendFactor destinationFactor, const Sources& s, uint32_t c) {
  if (op == VK_BLEND_OP_MIN) return b.fmin(s.source[c], s.destination[c]);
  if (op == VK_BLEND_OP_MAX) return b.fmax(s.source[c], s.destination[c]);
  const auto product = [&](Value v, VkBlendFactor f) -> Value {
    bool one;
    const Value w = factor(b, f, s, c, one);
    return !w ? w : one ? v : b.fmul(v, w);
  };
  const Value x = product(s.source[c], sourceFactor), y = product(s.destination[c], destinationFactor);
  if (!x && !y) return b.f32(0);
  switch (op) {
    case VK_BLEND_OP_SUBTRACT: return !y ? x : b.fsub(x ? x : b.f32(0), y);
    case VK_BLEND_OP_REVERSE_SUBTRACT: return !x ? y : b.fsub(y ? y : b.f32(0), x);
    default: return !x ? y : !y ? x : b.fadd(x, y);
  }
}

//! One is the other's complement.
bool addToOne(VkBlendFactor f, VkBlendFactor g) {
  static constexpr VkBlendFactor kPairs[][2] = {
      {VK_BLEND_FACTOR_ZERO, VK_BLEND_FACTOR_ONE},
      {VK_BLEND_FACTOR_SRC_COLOR, VK_BLEND_FACTOR_ONE_MINUS_SRC_COLOR},
      {VK_BLEND_FACTOR_DST_COLOR, VK_BLEND_FACTOR_ONE_MINUS_DST_COLOR},
      {VK_BLEND_FACTOR_SRC_ALPHA, VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA},
      {VK_BLEND_FACTOR_DST_ALPHA, VK_BLEND_FACTOR_ONE_MINUS_DST_ALPHA},
      {VK_BLEND_FACTOR_CONSTANT_COLOR, VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_COLOR},
      {VK_BLEND_FACTOR_CONSTANT_ALPHA, VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_ALPHA},
      {VK_BLEND_FACTOR_SRC1_COLOR, VK_BLEND_FACTOR_ONE_MINUS_SRC1_COLOR},
      {VK_BLEND_FACTOR_SRC1_ALPHA, VK_BLEND_FACTOR_ONE_MINUS_SRC1_ALPHA},
  };
  return std::any_of(std::begin(kPairs), std::end(kPairs), [&](const auto& p) { return (p[0] == f && p[1] == g) || (p[0] == g && p[1] == f); });
}

//! With everything that comes in between 0 and 1, so is the result, but for roundings.
bool staysInUnit(VkBlendOp op, VkBlendFactor source, VkBlendFactor destination, uint32_t c) {
  if (op == VK_BLEND_OP_MIN || op == VK_BLEND_OP_MAX) return true;
  if (op != VK_BLEND_OP_ADD) return false;
  if (source == VK_BLEND_FACTOR_ZERO || destination == VK_BLEND_FACTOR_ZERO || addToOne(source, destination)) return true;
  // s + d (1 - s) and s (1 - d) + d.
  const bool alpha = c == 3;
  if (source == VK_BLEND_FACTOR_ONE)
    return destination == VK_BLEND_FACTOR_ONE_MINUS_SRC_COLOR || (alpha && destination == VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA);
  if (destination == VK_BLEND_FACTOR_ONE)
    return source == VK_BLEND_FACTOR_ONE_MINUS_DST_COLOR || (alpha && source == VK_BLEND_FACTOR_ONE_MINUS_DST_ALPHA);
  return false;
}

Value logicWord(ir::Builder& b, VkLogicOp op, Value s, Value d) {
  switch (op) {
    case VK_LOGIC_OP_CLEAR: return b.i32(0);
    case VK_LOGIC_OP_AND: return b.and_(s, d);
    case VK_LOGIC_OP_AND_REVERSE: return b.and_(s, b.not_(d));
    case VK_LOGIC_OP_AND_INVERTED: return b.and_(b.not_(s), d);
    case VK_LOGIC_OP_NO_OP: return d;
    case VK_LOGIC_OP_XOR: return b.xor_(s, d);
    case VK_LOGIC_OP_OR: return b.or_(s, d);
    case VK_LOGIC_OP_NOR: return b.not_(b.or_(s, d));
    case VK_LOGIC_OP_EQUIVALENT: return b.not_(b.xor_(s, d));
    case VK_LOGIC_OP_INVERT: return b.not_(d);
    case VK_LOGIC_OP_OR_REVERSE: return b.or_(s, b.not_(d));
    case VK_LOGIC_OP_COPY_INVERTED: return b.not_(s);
    case VK_LOGIC_OP_OR_INVERTED: return b.or_(b.not_(s), d);
    case VK_LOGIC_OP_NAND: return b.not_(b.and_(s, d));
    case VK_LOGIC_OP_SET: return b.i32(~0u);
    default: return s;
  }
}

}  // namespace

bool writesColor(const GraphicsState& s, uint32_t attachment) {
  const FormatInfo* f = texture::formatInfo(s.colorFormats[attachment]);
  if (!f || (s.logicOpEnable && s.logicOp == VK_LOGIC_OP_NO_OP && appliesLogic(s, *f))) return false;
  const auto words = maskWords(*f, writeMask(s, attachment));
  return std::any_of(words.begin(), words.end(), [](uint32_t w) { return w != 0; });
}

bool replacesColor(const GraphicsState& s, uint32_t attachment) {
  if (!writesColor(s, attachment)) return false;
  const FormatInfo& f = *texture::formatInfo(s.colorFormats[attachment]);
  return !blends(s, f, attachment) && !appliesLogic(s, f) && coversAll(f, writeMask(s, attachment));
}

void writeColor(ir::Builder& b, const GraphicsState& s, uint32_t attachment, uint32_t sample, const Texel& given, const Texel& given1) {
  if (!writesColor(s, attachment)) return;
  const FormatInfo& f = *texture::formatInfo(s.colorFormats[attachment]);
  const uint32_t plane = colorPlane(attachment, sample, s.samples);
  const VkColorComponentFlags mask = writeMask(s, attachment);
  const bool blend = blends(s, f, attachment), logic = appliesLogic(s, f), partial = !coversAll(f, mask);

  RawElement old{};
  if (blend || logic || partial) old = loadRaw(b, f, plane);
  Texel color = given;
  unsigned inUnit = 0;
  if (blend) {
    const VkPipelineColorBlendAttachmentState& e = s.blend[attachment];
    Texel constant, source1 = given1;
    for (uint32_t c = 0; c < 4; ++c) constant[c] = drawField(b, Type::F32, offsetof(DrawConstants, blendConstants), c);
    // Fixed-point attachments: sources and constants are clamped to what the format can hold before they are used.
    if (isFixedPoint(f.rgba[0].numeric)) {
      const Value low = b.f32(f.rgba[0].numeric == Numeric::Snorm ? -1.f : 0.f), high = b.f32(1);
      for (Texel* t : {&color, &source1, &constant})
        for (Value& v : *t) v = b.fmin(b.fmax(v, low), high);
    }
    const Texel destination = texture::unpack(b, f, old);
    const Sources sources{color, source1, destination, constant};
    Texel result;
    for (uint32_t c = 0; c < 3; ++c) result[c] = blendComponent(b, e.colorBlendOp, e.srcColorBlendFactor, e.dstColorBlendFactor, sources, c);
    result[3] = blendComponent(b, e.alphaBlendOp, e.srcAlphaBlendFactor, e.dstAlphaBlendFactor, sources, 3);
    color = result;
    if (f.rgba[0].numeric == Numeric::Unorm)
      for (uint32_t c = 0; c < 4; ++c)
        if (c < 3 ? staysInUnit(e.colorBlendOp, e.srcColorBlendFactor, e.dstColorBlendFactor, c)
                  : staysInUnit(e.alphaBlendOp, e.srcAlphaBlendFactor, e.dstAlphaBlendFactor, c))
          inUnit |= 1u << c;
  }
  RawElement raw = texture::packBounded(b, f, color, inUnit);
  const uint32_t words = texture::rawLoads(f).count;
  if (logic)
    for (uint32_t i = 0; i < words; ++i) raw[i] = logicWord(b, s.logicOp, raw[i], old[i]);
  if (partial) {
    const auto bits = maskWords(f, mask);
    for (uint32_t i = 0; i < words; ++i) raw[i] = b.or_(b.and_(raw[i], b.i32(bits[i])), b.and_(old[i], b.i32(~bits[i])));
  }
  storeRaw(b, f, plane, raw);
}

}  // namespace pumice::pipeline
