// Level of detail and cube faces (Vulkan spec, "Texel Coordinate Systems", "Image Level(s) Selection").
#include <cstddef>

#include "texture/sample.h"

namespace pumice::texture {

using ir::Builder;
using ir::Op;
using ir::Value;

CubeFace cubeFace(Builder& b, const Value (&r)[3], const Value* ddx, const Value* ddy) {
  Value ax = b.fabs(r[0]), ay = b.fabs(r[1]), az = b.fabs(r[2]);
  // The largest magnitude; ties go to z, then y.
  Value isZ = b.maskAnd(b.fle(ax, az), b.fle(ay, az));
  Value isY = b.maskAnd(b.maskNot(isZ), b.fle(ax, ay));
  auto pick = [&](Value x, Value y, Value z) { return b.select(isZ, z, b.select(isY, y, x)); };
  Value major = pick(r[0], r[1], r[2]);
  Value negative = b.flt(major, b.f32(0.0f));

  // s, t and the major axis of a vector in the chosen face's frame; the major component comes out as a growth of |major|.
  auto transform = [&](const Value* v, Value& sc, Value& tc, Value& ma) {
    Value nx = b.fneg(v[0]), ny = b.fneg(v[1]), nz = b.fneg(v[2]);
    sc = pick(b.select(negative, v[2], nz), v[0], b.select(negative, nx, v[0]));
    tc = pick(ny, b.select(negative, nz, v[2]), ny);
    Value m = pick(v[0], v[1], v[2]);
    ma = b.select(negative, b.fneg(m), m);
  };

  CubeFace out;
  Value sc, tc, ma;
  transform(r, sc, tc, ma);
  out.face = b.iadd(pick(b.i32(0), b.i32(2), b.i32(4)), b.select(negative, b.i32(1), b.i32(0)));
  Value half = b.f32(0.5f);
  Value sn = b.fdiv(sc, ma), tn = b.fdiv(tc, ma);
  out.s = b.fma(sn, half, half);
  out.t = b.fma(tn, half, half);
  auto derive = [&](const Value* d, Value* result) {
    Value ds, dt, dm;
    transform(d, ds, dt, dm);
    // (sc/|rc|)' / 2 = (sc' - sc/|rc| * |rc|') / (2 |rc|)
    Value scale = b.fdiv(half, ma);
    result[0] = b.fmul(b.fsub(ds, b.fmul(sn, dm)), scale);
    result[1] = b.fmul(b.fsub(dt, b.fmul(tn, dm)), scale);
  };
  if (ddx) derive(ddx, out.ddx);
  if (ddy) derive(ddy, out.ddy);
  return out;
}

Footprint footprint(ImageBuild& s, const Value (&ddx)[3], const Value (&ddy)[3]) {
  Builder& b = s.b;
  Value size[2];
  for (unsigned i = 0; i < 2; ++i) size[i] = b.convert(Op::UToF, ir::Type::F32, s.extent(i, 0));
  Value ux = b.fmul(ddx[0], size[0]), vx = b.fmul(ddx[1], size[1]), uy = b.fmul(ddy[0], size[0]), vy = b.fmul(ddy[1], size[1]);
  // The larger eigenvalue of [a c; c d] = J J^T is the squared major axis; the determinant gives the minor one without cancellation.
  Value a = b.fma(ux, ux, b.fmul(uy, uy)), d = b.fma(vx, vx, b.fmul(vy, vy)), c = b.fma(ux, vx, b.fmul(uy, vy));
  Value half = b.f32(0.5f);
  Value mean = b.fmul(b.fadd(a, d), half), difference = b.fmul(b.fsub(a, d), half);
  Value square = b.fadd(mean, b.fsqrt(b.fma(difference, difference, b.fmul(c, c))));
  Value major = b.fsqrt(square);
  Value least = b.fdiv(b.fabs(b.fsub(b.fmul(ux, vy), b.fmul(uy, vx))), major);
  Value limit = b.tableLoad(ir::Type::F32, s.sampler.table, s.sampler.constOffset + uint32_t(offsetof(SamplerDescriptor, maxAnisotropy)), s.sampler.dynamicOffset);
  Footprint out;
  out.minor = b.fmax(least, b.fdiv(major, limit));
  // More than one sample a texel would find nothing new.
  Value count = b.fmin(b.fmin(b.fdiv(major, least), limit), b.fmax(major, b.f32(1.0f)));
  out.count = b.smax(b.convert(Op::FToS, ir::Type::I32, b.unary(Op::FCeil, b.fsub(count, b.f32(1.0f / 64)))), b.i32(1));
  // The eigenvector, from the row that is longer.
  Value wide = b.fle(d, a);
  Value x = b.select(wide, b.fsub(square, d), c), y = b.select(wide, c, b.fsub(square, a));
  Value length = b.fsqrt(b.fma(x, x, b.fmul(y, y)));
  Value scale = b.select(b.flt(b.f32(0.0f), length), b.fdiv(major, length), b.f32(0.0f));
  out.axis[0] = b.fdiv(b.fmul(x, scale), size[0]);
  out.axis[1] = b.fdiv(b.fmul(y, scale), size[1]);
  return out;
}

LevelOfDetail levelOfDetail(ImageBuild& s, const Value (&ddx)[3], const Value (&ddy)[3], Value minor, bool onlyLevels) {
  Builder& b = s.b;
  SamplerRef ref = s.sampler;
  auto samplerField = [&](size_t offset) { return b.tableLoad(ir::Type::F32, ref.table, ref.constOffset + uint32_t(offset), ref.dynamicOffset); };

  Value lambda;
  if (s.in.lod) {
    lambda = s.in.lod;
  } else if (minor) {
    lambda = b.unary(Op::FLog2, minor);
  } else {
    auto squaredLength = [&](const Value (&d)[3]) {
      Value sum = 0;
      for (unsigned i = 0; i < s.dimensions; ++i) {
        Value m = b.fmul(d[i], b.convert(Op::UToF, ir::Type::F32, s.extent(i, 0)));
        sum = sum ? b.fma(m, m, sum) : b.fmul(m, m);
      }
      return sum;
    };
    // log2 of the longer side of the footprint: half the logarithm of its square.
    Value x = squaredLength(ddx), y = squaredLength(ddy);
    // Beyond these all is magnified, or the coarsest level: the logarithm of a normal number has no special cases.
    constexpr float kLeast = 0x1p-126f, kMost = 0x1p127f;
    Value square = onlyLevels ? b.fmin(b.fmax(b.fmax(x, b.f32(kLeast)), y), b.f32(kMost)) : b.fmax(x, y);
    lambda = b.fmul(b.f32(0.5f), b.unary(Op::FLog2, square));
  }
  Value bias = samplerField(offsetof(SamplerDescriptor, lodBias));
  if (s.in.bias) {
    constexpr float kMaxLodBias = 16.0f;  // VkPhysicalDeviceLimits::maxSamplerLodBias
    bias = b.fmin(b.fmax(b.fadd(bias, s.in.bias), b.f32(-kMaxLodBias)), b.f32(kMaxLodBias));
  }
  LevelOfDetail lod;
  lod.unclamped = b.fadd(lambda, bias);
  // Levels lie far within; that these are numbers saves work.
  constexpr float kFar = 4096.0f;
  Value lowest = b.fmax(samplerField(offsetof(SamplerDescriptor, minLod)), b.f32(-kFar));
  if (s.in.minLod) lowest = b.fmax(lowest, s.in.minLod);
  lod.clamped = b.fmin(b.fmax(lod.unclamped, lowest), b.fmin(samplerField(offsetof(SamplerDescriptor, maxLod)), b.f32(kFar)));
  return lod;
}

}  // namespace pumice::texture
