// Parts of unpack() and pack() that sampling and blending use on their own.
#pragma once

#include "texture/builders.h"

namespace pumice::texture {

//! One component as unpack() gives it. Without `scale` the division of Unorm components by 2^n - 1 is left out, and a power of two
//! is left in where that saves a shift: filtering is linear, so one division after it does.
ir::Value unpackComponent(ir::Builder& b, const FormatInfo& f, const RawElement& raw, int component, bool scale);
//! What unpackComponent() without `scale` left out.
Texel scaleTexel(ir::Builder& b, const FormatInfo& f, const Texel& unscaled);

//! pack(). `inUnit`, bit per component: it is no NaN and in [0, 1] but for a few roundings, so that clamping could change nothing.
RawElement packBounded(ir::Builder& b, const FormatInfo& f, const Texel& texel, unsigned inUnit);

//! v / (divisor * 2^exponent) of integers v / 2^exponent in f32, |v| <= divisor: correctly rounded for every divisor that formats have
//! (tested for each).
ir::Value divideExact(ir::Builder& b, ir::Value v, uint32_t divisor, unsigned exponent = 0);

//! Loads an element's raw words; outside `size` they are zero.
RawElement loadRaw(ir::Builder& b, const FormatInfo& f, ir::Value base, ir::Value offset, ir::Value size, bool constant);

}  // namespace pumice::texture
