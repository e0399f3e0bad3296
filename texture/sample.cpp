// Samples and gathers (Vulkan spec, "Texel Filtering"): points, levels, anisotropic footprints. What happens within a level is in
// filter.cpp.
#include <cstddef>

#include "texture/filter.h"

namespace pumice::texture {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

namespace {

Value asF32(Builder& b, Value v) { return b.type(v) == Type::F16 ? b.convert(Op::FToF, Type::F32, v) : v; }

// The point and the derivatives in the coordinates of the addressed texels.
SamplePoint makePoint(ImageBuild& s, bool derivatives, Value (&ddx)[3], Value (&ddy)[3]) {
  Builder& b = s.b;
  const unsigned given = imageDimensions(s.op.dim);
  for (Value* list : {s.in.coordinate, s.in.ddx, s.in.ddy})
    for (unsigned i = 0; i < given; ++i)
      if (list[i]) list[i] = asF32(b, list[i]);
  SamplePoint p;
  if (derivatives) {
    for (unsigned i = 0; i < given; ++i) {
      ddx[i] = s.in.ddx[0] ? s.in.ddx[i] : b.unary(Op::QuadDdx, s.in.coordinate[i]);
      ddy[i] = s.in.ddx[0] ? s.in.ddy[i] : b.unary(Op::QuadDdy, s.in.coordinate[i]);
    }
  }
  Value layer = 0;
  if (s.in.layer) {
    Value rounded = b.convert(Op::FToS, Type::I32, b.unary(Op::FRoundEven, asF32(b, s.in.layer)));
    Value count = s.fields.i32(offsetof(ImageDescriptor, layerCount));
    if (s.isCube()) count = b.udiv(count, b.i32(6));
    layer = b.smin(b.smax(rounded, b.i32(0)), b.isub(count, b.i32(1)));
    // A null descriptor has no layers at all.
    layer = b.smax(layer, b.i32(0));
  }
  if (s.isCube()) {
    CubeFace face = cubeFace(b, s.in.coordinate, derivatives ? ddx : nullptr, derivatives ? ddy : nullptr);
    p.coordinate[0] = face.s;
    p.coordinate[1] = face.t;
    p.face = face.face;
    p.layer = layer ? b.imul(layer, b.i32(6)) : 0;
    for (int i = 0; i < 2 && derivatives; ++i) {
      ddx[i] = face.ddx[i];
      ddy[i] = face.ddy[i];
    }
  } else {
    for (unsigned i = 0; i < given; ++i) p.coordinate[i] = s.in.coordinate[i];
    p.layer = layer;
  }
  return p;
}

Value lastLevel(ImageBuild& s) { return s.b.isub(s.fields.i32(offsetof(ImageDescriptor, levelCount)), s.b.i32(1)); }

// ceil(x + 1/2) - 1, at least 0: halves go to the finer level.
Value nearestLevel(Builder& b, Value lambda, Value last) {
  Value l = b.isub(b.convert(Op::FToS, Type::I32, b.unary(Op::FCeil, b.fadd(lambda, b.f32(0.5f)))), b.i32(1));
  return b.smax(b.smin(l, last), b.i32(0));
}

// Everything of one sample but its coordinate: filters and levels. Made once, also where several samples along an axis are taken.
class Sampling {
 public:
  Sampling(ImageBuild& s, const SamplePoint& p, bool oneLevel, bool mag, bool min, const LevelOfDetail* lod)
      : s_(s), b_(s.b), filter_(s, lod ? mag || min : mag, lod ? linearMask(lod, mag, min) : 0) {
    if (!lod || oneLevel) {
      fine_ = mipLevel(s, 0, p.layer);
      return;
    }
    Value last = lastLevel(s);
    if (s.sampler.key.mipmapMode == VK_SAMPLER_MIPMAP_MODE_NEAREST || s.integer()) {
      fine_ = mipLevel(s, nearestLevel(b_, lod->clamped, last), p.layer);
      return;
    }
    const Value coarsest = b_.fmin(b_.convert(Op::SToF, Type::F32, last), b_.f32(float(kMaxLevels)));
    Value lambda = b_.fmax(b_.fmin(lod->clamped, coarsest), b_.f32(0.0f));
    Value floor = b_.ffloor(lambda);
    weight_ = b_.fsub(lambda, floor);
    Value level = b_.convert(Op::FToS, Type::I32, floor);
    fine_ = mipLevel(s, level, p.layer);
    coarse_ = mipLevel(s, b_.smin(b_.iadd(level, b_.i32(1)), last), p.layer);
    between_ = b_.flt(b_.f32(0.0f), weight_);
  }

  //! Before finish().
  Texel sample(const SamplePoint& p) {
    if (weight_ && filter_.takesLevels()) return filter_.sampleLevels(p, fine_, coarse_, weight_);
    Texel t = filter_.sample(p, fine_);
    if (!weight_) return t;
    // The coarser level only where it has a share.
    Value result[4] = {};
    for (int c = 0; c < 4; ++c) {
      if (b_.isConstant(t[c])) continue;
      result[c] = b_.var(Type::F32);
      b_.set(result[c], t[c]);
    }
    b_.beginIf(between_);
    Texel coarse = filter_.sample(p, coarse_);
    for (int c = 0; c < 4; ++c)
      if (result[c]) b_.set(result[c], filter_.combine(t[c], coarse[c], weight_));
    b_.endIf();
    for (int c = 0; c < 4; ++c)
      if (result[c]) t[c] = b_.get(result[c]);
    return t;
  }

  Filter& filter() { return filter_; }

 private:
  Value linearMask(const LevelOfDetail* lod, bool mag, bool min) {
    if (mag == min) return 0;
    Value magnified = b_.fle(lod->clamped, b_.f32(0.0f));
    return mag ? magnified : b_.maskNot(magnified);
  }

  ImageBuild& s_;
  Builder& b_;
  Filter filter_;
  MipLevel fine_, coarse_;
  Value weight_ = 0;   // of the coarser of two levels; none: there is one
  Value between_ = 0;  // mask: it has a share
};

// The average (or minimum, or maximum) of `count` samples along the footprint's major axis.
Texel sampleAlong(ImageBuild& s, Sampling& sampling, const SamplePoint& p, const Footprint& f) {
  Builder& b = s.b;
  const bool average = s.sampler.key.reduction == VK_SAMPLER_REDUCTION_MODE_WEIGHTED_AVERAGE;
  // The place of a sample: the footprint's centre plus (i + 1/2) / count - 1/2 of its axis.
  Value step = b.fdiv(b.f32(1.0f), b.convert(Op::SToF, Type::F32, f.count));
  auto probe = [&](Value i) {
    Value along = b.fma(b.fadd(b.convert(Op::SToF, Type::F32, i), b.f32(0.5f)), step, b.f32(-0.5f));
    SamplePoint q = p;
    for (int a = 0; a < 2; ++a) q.coordinate[a] = b.fma(along, f.axis[a], p.coordinate[a]);
    return sampling.sample(q);
  };
  Texel t = probe(b.i32(0));
  Value sum[4] = {};
  for (int c = 0; c < 4; ++c) {
    if (b.isConstant(t[c])) continue;
    sum[c] = b.var(Type::F32);
    b.set(sum[c], t[c]);
  }
  Value index = b.var(Type::I32);
  b.set(index, b.i32(1));
  b.beginLoop();
  Value i = b.get(index);
  b.beginIf(b.sle(f.count, i));
  b.breakOut();
  b.endIf();
  Texel more = probe(i);
  for (int c = 0; c < 4; ++c) {
    if (!sum[c]) continue;
    Value before = b.get(sum[c]);
    b.set(sum[c], average ? b.fadd(before, more[c]) : sampling.filter().combine(before, more[c], b.f32(1.0f)));
  }
  b.set(index, b.iadd(i, b.i32(1)));
  b.endLoop();
  for (int c = 0; c < 4; ++c) {
    if (!sum[c]) continue;
    t[c] = b.get(sum[c]);
    if (average) t[c] = b.fdiv(t[c], b.convert(Op::SToF, Type::F32, f.count));
  }
  return t;
}

}  // namespace

Texel sampleImage(ImageBuild& s, const char** error) {
  Builder& b = s.b;
  const SamplerKey& k = s.sampler.key;
  if (!k.present) return {s.zero(), s.zero(), s.zero(), s.zero()};
  if (k.magFilter > VK_FILTER_LINEAR || k.minFilter > VK_FILTER_LINEAR) {
    *error = "cubic filters are not supported";
    return {};
  }
  const bool integer = s.integer();
  // An explicit level of detail has no footprint.
  const bool anisotropic = k.anisotropy && !k.unnormalized && !integer && s.dimensions == 2 && !s.in.lod && (s.in.ddx[0] || s.op.implicitLod);
  // With both limits 0 the level of detail is always 0: magnification of the base level.
  const bool fixedLod = k.zeroLod || k.unnormalized;
  const bool mag = k.magFilter == VK_FILTER_LINEAR && !integer;
  const bool min = k.minFilter == VK_FILTER_LINEAR && !integer;
  const bool oneLevel = s.image.key.singleLevel || fixedLod;
  const bool needLod = !fixedLod && (!oneLevel || mag != min);
  Value ddx[3] = {}, ddy[3] = {};
  if (s.in.lod) s.in.lod = asF32(b, s.in.lod);
  if (s.in.bias) s.in.bias = asF32(b, s.in.bias);
  if (s.in.minLod) s.in.minLod = asF32(b, s.in.minLod);
  // Without an explicit level and without derivatives (outside fragment shaders) the base level is meant.
  if (needLod && !s.in.lod && !s.in.ddx[0] && !s.op.implicitLod) s.in.lod = b.f32(0.0f);
  SamplePoint p = makePoint(s, anisotropic || (needLod && !s.in.lod), ddx, ddy);
  Footprint f;
  if (anisotropic) f = footprint(s, ddx, ddy);
  LevelOfDetail lod;
  if (needLod) lod = levelOfDetail(s, ddx, ddy, f.minor, true);
  Sampling sampling(s, p, oneLevel, mag, min, needLod ? &lod : nullptr);
  return sampling.filter().finish(anisotropic ? sampleAlong(s, sampling, p, f) : sampling.sample(p));
}

Texel gatherImage(ImageBuild& s, const char** error) {
  Builder& b = s.b;
  if (!s.sampler.key.present) return {s.zero(), s.zero(), s.zero(), s.zero()};
  uint64_t component = 0;
  if (s.in.gatherComponent && !b.isConstant(s.in.gatherComponent, &component)) {
    *error = "gather with a component that is not constant";
    return {};
  }
  Value unused[3] = {};
  SamplePoint p = makePoint(s, false, unused, unused);
  Filter filter(s, true, 0);
  Texel texels[4];
  filter.gather(p, mipLevel(s, 0, p.layer), texels);
  Texel out;
  for (int n = 0; n < 4; ++n) out[n] = swizzle(b, s.image.key, s.integer(), texels[n])[component & 3];
  return out;
}

std::vector<Value> queryLod(ImageBuild& s) {
  Builder& b = s.b;
  if (!s.sampler.key.present) return {b.f32(0.0f), b.f32(0.0f)};
  Value ddx[3] = {}, ddy[3] = {};
  makePoint(s, true, ddx, ddy);
  const bool anisotropic = s.sampler.key.anisotropy && s.dimensions == 2;
  LevelOfDetail lod = levelOfDetail(s, ddx, ddy, anisotropic ? footprint(s, ddx, ddy).minor : 0);
  Value last = lastLevel(s);
  Value level = b.fmax(b.fmin(lod.clamped, b.convert(Op::SToF, Type::F32, last)), b.f32(0.0f));
  if (s.sampler.key.mipmapMode == VK_SAMPLER_MIPMAP_MODE_NEAREST) level = b.convert(Op::SToF, Type::F32, nearestLevel(b, level, last));
  return {level, lod.unclamped};
}

}  // namespace pumice::texture
