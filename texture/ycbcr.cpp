// Multi-planar images and sampler Y'CbCr conversion (Vulkan spec, "Sampler Y'CbCr Conversion").
//
// Chroma is reconstructed implicitly: each plane is sampled by itself, luma with the sampler's filters, chroma with the
// conversion's, at coordinates that say where chroma samples lie. With nearest luma and linear chroma filters that is the
// explicit reconstruction, too.
#include "texture/sample.h"

namespace pumice::texture {

using ir::Builder;
using ir::Value;

namespace {

// Weights of red and blue in luma (ITU-R BT.709, BT.601 and BT.2020; Khronos Data Format Specification, "Color conversions").
struct Weights {
  double red = 0, blue = 0;
};
Weights weightsOf(uint8_t model) {
  switch (model) {
    case VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_709: return {0.2126, 0.0722};
    case VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_601: return {0.299, 0.114};
    default: return {0.2627, 0.0593};
  }
}

}  // namespace

Texel samplePlanes(ImageBuild& s, const char** error) {
  Builder& b = s.b;
  const FormatInfo& f = s.format;
  const Conversion conversion = conversionOf(s.sampler.key.conversion);
  Texel out = {s.zero(), s.zero(), s.zero(), b.f32(1.0f)};
  for (unsigned p = 0; p < f.planeCount; ++p) {
    SamplerRef sampler = s.sampler;
    sampler.key.conversion = 0;
    sampler.key.anisotropy = 0;
    if (p) sampler.key.magFilter = sampler.key.minFilter = conversion.linear ? VK_FILTER_LINEAR : VK_FILTER_NEAREST;
    ImageBuild plane{b, s.op, s.image, sampler, {b, s.image, p}, *formatInfo(f.planeFormats[p]), s.dimensions, s.in};
    for (unsigned i = 0; p && i < 2; ++i) {
      plane.shift[i] = f.chromaShift[i];
      // Of two luma samples at 1/2 and 3/2 the first, not the middle, is where the chroma sample at 1/2 (half as wide) lies.
      plane.offset[i] = f.chromaShift[i] && conversion.cosited[i] ? 0.25f : 0.0f;
    }
    const Texel t = sampleImage(plane, error);
    if (*error) return {};
    for (unsigned c = 0; c < 3; ++c)
      if (f.componentPlane[c] == p) out[c] = t[f.componentInPlane[c]];
  }
  return out;
}

Texel convertYcbcr(Builder& b, const FormatInfo& f, const Conversion& conversion, const Texel& t) {
  if (conversion.model == VK_SAMPLER_YCBCR_MODEL_CONVERSION_RGB_IDENTITY) return t;
  // Range expansion: from codes of n bits.
  const unsigned bits = f.rgba[1].bits;
  const double most = double((uint64_t(1) << bits) - 1), unit = bits > 8 ? double(uint64_t(1) << (bits - 8)) : 1;
  auto expand = [&](Value v, double range, double zero) {
    return b.fma(v, b.f32(float(most / (range * unit))), b.f32(float(-zero / range)));
  };
  const double half = double(uint64_t(1) << (bits - 1)) / most;
  const Value y = conversion.narrow ? expand(t[1], 219, 16) : t[1];
  const Value cb = conversion.narrow ? expand(t[2], 224, 128) : b.fsub(t[2], b.f32(float(half)));
  const Value cr = conversion.narrow ? expand(t[0], 224, 128) : b.fsub(t[0], b.f32(float(half)));
  if (conversion.model == VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_IDENTITY) return {cr, y, cb, t[3]};

  const Weights w = weightsOf(conversion.model);
  const double green = 1 - w.red - w.blue;
  auto times = [&](double factor, Value v, Value plus) { return b.fma(v, b.f32(float(factor)), plus); };
  return {times(2 * (1 - w.red), cr, y),
          times(-2 * w.blue * (1 - w.blue) / green, cb, times(-2 * w.red * (1 - w.red) / green, cr, y)),
          times(2 * (1 - w.blue), cb, y), t[3]};
}

}  // namespace pumice::texture
