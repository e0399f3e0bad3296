// Filtering (Vulkan spec, "Texel Filtering"): nearest and linear in any number of dimensions, mip levels, borders,
// depth comparison, gather. Weights have full f32 precision.
#include "texture/sample.h"

#include <cstddef>

#include "texture/block.h"

namespace pumice::texture {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

namespace {

// One axis of a footprint: one or two texel indices inside the image.
struct Axis {
  Value index[2] = {};
  Value inside[2] = {};  // masks, only for ClampToBorder
  Value weight = 0;      // of index[1]; none: nearest
};

// How one level is read.
struct LevelView {
  Value level = 0;       // i32; none: the first
  Value extent[3] = {};  // i32
};

// The sampled point, after projection to a cube face.
struct Point {
  Value coordinate[3] = {};
  Value layer = 0;   // i32
  Value face = 0;    // i32, cubes
  Value base = 0;    // layer of the cube's first face
};

class Filter {
 public:
  Filter(ImageBuild& s, bool linear, Value linearMask) : s_(s), b_(s.b), linear_(linear), linearMask_(linearMask) {
    const SamplerKey& k = s.sampler.key;
    mode_[0] = k.addressU;
    mode_[1] = k.addressV;
    mode_[2] = k.addressW;
    if (s.isCube()) mode_[0] = mode_[1] = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    for (unsigned i = 0; i < s.dimensions; ++i) border_ |= mode_[i] == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
    compare_ = s.in.dref && s.sampler.key.compareEnable;
    // Filtering is linear: Unorm texels are divided by 2^n - 1 once, afterwards.
    unscaled_ = linear_ && !border_ && !compare_ && !s.integer() && !s.format.isCompressed();
  }

  Texel sample(const Point& p, const LevelView& level) {
    Axis axis[3];
    for (unsigned i = 0; i < s_.dimensions; ++i) axis[i] = makeAxis(i, p.coordinate[i], level.extent[i], s_.in.offset[i]);
    Texel t = s_.isCube() && linear_ ? reduceCube(p, level, axis) : reduce(p, level, axis, s_.dimensions, 0);
    return unscaled_ ? scaleTexel(b_, s_.format, t) : t;
  }

  //! Two partial results, `weight` being the second's share: their average, or their minimum or maximum.
  Value combine(Value low, Value high, Value weight) {
    switch (s_.sampler.key.reduction) {
      // Only texels that have a share count.
      case VK_SAMPLER_REDUCTION_MODE_MIN: return b_.select(b_.flt(b_.f32(0.0f), weight), b_.fmin(low, high), low);
      case VK_SAMPLER_REDUCTION_MODE_MAX: return b_.select(b_.flt(b_.f32(0.0f), weight), b_.fmax(low, high), low);
      default: return lerp(low, high, weight);
    }
  }

  // The four texels of the linear footprint, in the order gather returns them.
  void gather(const Point& p, const LevelView& level, Texel (&out)[4]) {
    static constexpr uint8_t kCorner[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    unscaled_ = false;
    Axis axis[3];
    const bool four = s_.op.operands & ir::kImageOffsets;
    for (int n = 0; n < 4; ++n) {
      if (n == 0 || four)
        for (unsigned i = 0; i < 2; ++i) axis[i] = makeAxis(i, p.coordinate[i], level.extent[i], four ? s_.in.offsets[n][i] : s_.in.offset[i]);
      // Each of the four offsets names the footprint whose (0, 0) texel is taken.
      unsigned pick = four ? 0u : kCorner[n][0] | kCorner[n][1] << 1;
      out[n] = corner(p, level, axis, pick);
    }
  }

 private:
  // Brings texel indices into the image. Unless texel offsets were added (`anyInteger`) a periodic index is at most one
  // step outside its period: makeAxis() removes the rest from the normalised coordinate.
  Value wrapIndex(uint8_t mode, Value i, Value extent, bool anyInteger) {
    Value zero = b_.i32(0), last = b_.isub(extent, b_.i32(1));
    switch (mode) {
      case VK_SAMPLER_ADDRESS_MODE_REPEAT: {
        if (anyInteger) {
          Value r = b_.srem(i, extent);
          return b_.select(b_.slt(r, zero), b_.iadd(r, extent), r);
        }
        i = b_.select(b_.slt(i, zero), last, i);
        return b_.select(b_.slt(last, i), zero, i);
      }
      case VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT: {
        Value twice = b_.shl(extent, b_.i32(1));
        if (anyInteger) {
          i = b_.srem(i, twice);
          i = b_.select(b_.slt(i, zero), b_.iadd(i, twice), i);
        }
        // -1 and twice the size are both next to texel 0.
        return b_.smax(b_.select(b_.slt(last, i), b_.isub(b_.isub(twice, b_.i32(1)), i), i), zero);
      }
      case VK_SAMPLER_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE: return b_.smin(b_.xor_(i, b_.ashr(i, b_.i32(31))), last);
      default: return b_.smin(b_.smax(i, zero), last);
    }
  }

  // REPEAT of an index that can leave the image on one side only: the coordinate was brought to [0, 1], so the first of two texels may
  // be -1, the second or a nearest one the size.
  Value wrapOnce(Value i, Value extent, bool below) {
    Value last = b_.isub(extent, b_.i32(1)), zero = b_.i32(0);
    return below ? b_.select(b_.slt(i, zero), last, i) : b_.select(b_.slt(last, i), zero, i);
  }

  Axis makeAxis(unsigned n, Value u, Value extent, Value offset) {
    const uint8_t mode = mode_[n];
    const bool anyInteger = offset != 0;
    Value size = b_.convert(Op::UToF, Type::F32, extent);
    Value x = u;
    if (!s_.sampler.key.unnormalized) {
      // The periodic part is removed while the coordinate is normalised: fractions are exact and no division is needed.
      if (mode == VK_SAMPLER_ADDRESS_MODE_REPEAT) x = b_.fsub(u, b_.ffloor(u));
      if (mode == VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT) {
        Value h = b_.fmul(u, b_.f32(0.5f));
        x = b_.fmul(b_.fsub(h, b_.ffloor(h)), b_.f32(2.0f));
      }
      x = b_.fmul(x, size);
    }
    Axis a;
    Value floor;
    if (linear_) {
      // Where only some lanes filter linearly the others take one texel with weight 0.
      Value shift = linearMask_ ? b_.select(linearMask_, b_.f32(0.5f), b_.f32(0.0f)) : b_.f32(0.5f);
      x = b_.fsub(x, shift);
      floor = b_.ffloor(x);
      a.weight = b_.fsub(x, floor);
      if (linearMask_) a.weight = b_.select(linearMask_, a.weight, b_.f32(0.0f));
    } else {
      floor = b_.ffloor(x);
    }
    Value i0 = b_.convert(Op::FToS, Type::I32, floor);
    if (offset) i0 = b_.iadd(i0, offset);
    for (int k = 0; k < (linear_ ? 2 : 1); ++k) {
      Value i = k ? b_.iadd(i0, b_.i32(1)) : i0;
      if (s_.isCube() && linear_) {
        a.index[k] = i;  // beyond the edge lies another face
        continue;
      }
      if (mode == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER) a.inside[k] = b_.ult(i, extent);
      a.index[k] = mode == VK_SAMPLER_ADDRESS_MODE_REPEAT && !anyInteger && !s_.sampler.key.unnormalized && !linearMask_ ? wrapOnce(i, extent, k == 0 && linear_)
                                                                                                                     : wrapIndex(mode, i, extent, anyInteger);
    }
    return a;
  }

  Value lerp(Value a, Value c, Value w) {
    // Float texels may be infinite: a difference of two infinities would be NaN.
    if (s_.format.rgba[0].numeric == Numeric::Sfloat || s_.format.rgba[0].numeric == Numeric::Ufloat)
      return b_.fma(c, w, b_.fmul(a, b_.fsub(b_.f32(1.0f), w)));
    return b_.fma(w, b_.fsub(c, a), a);
  }

  // Weighted sum over the corners of axes [0, axes), the higher ones fixed in `chosen`.
  Texel reduce(const Point& p, const LevelView& level, const Axis* axis, unsigned axes, unsigned chosen) {
    if (axes == 0) return corner(p, level, axis, chosen);
    unsigned n = axes - 1;
    Texel low = reduce(p, level, axis, n, chosen);
    if (!axis[n].weight) return low;
    Texel high = reduce(p, level, axis, n, chosen | 1u << n);
    for (int c = 0; c < 4; ++c)
      if (low[c] != high[c]) low[c] = combine(low[c], high[c], axis[n].weight);
    return low;
  }

  // A footprint of 2x2 texels over the edges of a cube. Where three faces meet there is no fourth texel: it is the average of the
  // other three (spec, "Cube Map Corner Filtering"). Few footprints leave their face: both cases are branches.
  Texel reduceCube(const Point& p, const LevelView& level, const Axis* axis) {
    Value outside[2][2];
    for (unsigned i = 0; i < 2; ++i)
      for (unsigned k = 0; k < 2; ++k) outside[i][k] = b_.maskNot(b_.ult(axis[i].index[k], level.extent[i]));
    Value place[4][3];  // variables: x, y, face
    for (unsigned n = 0; n < 4; ++n) {
      const Value inside[3] = {axis[0].index[n & 1], axis[1].index[n >> 1], p.face};
      for (int i = 0; i < 3; ++i) {
        place[n][i] = b_.var(Type::I32);
        b_.set(place[n][i], inside[i]);
      }
    }
    b_.beginIf(b_.maskOr(b_.maskOr(outside[0][0], outside[0][1]), b_.maskOr(outside[1][0], outside[1][1])));
    for (unsigned n = 0; n < 4; ++n) {
      Value x = axis[0].index[n & 1], y = axis[1].index[n >> 1], face = p.face;
      acrossEdge(p, level.extent[0], x, y, face);
      b_.set(place[n][0], x);
      b_.set(place[n][1], y);
      b_.set(place[n][2], face);
    }
    b_.endIf();
    Texel t[4];
    for (unsigned n = 0; n < 4; ++n) {
      Value at[3] = {b_.get(place[n][0]), b_.get(place[n][1]), 0};
      t[n] = texel(level, at, cubeLayer(p, b_.get(place[n][2])));
    }
    Texel out;
    auto constant = [&](int c) { return b_.isConstant(t[0][c]) && t[0][c] == t[1][c] && t[0][c] == t[2][c] && t[0][c] == t[3][c]; };
    auto filtered = [&](int c, Value t0, Value t1, Value t2, Value t3) {
      return constant(c) ? t0 : combine(combine(t0, t1, axis[0].weight), combine(t2, t3, axis[0].weight), axis[1].weight);
    };
    Value missing[4], any = 0;
    for (unsigned n = 0; n < 4; ++n) {
      missing[n] = b_.maskAnd(outside[0][n & 1], outside[1][n >> 1]);
      any = any ? b_.maskOr(any, missing[n]) : missing[n];
    }
    for (int c = 0; c < 4; ++c) {
      out[c] = filtered(c, t[0][c], t[1][c], t[2][c], t[3][c]);
      if (constant(c)) continue;
      Value v = b_.var(Type::F32);
      b_.set(v, out[c]);
      b_.beginIf(any);
      Value whole[4];
      for (unsigned n = 0; n < 4; ++n) {
        Value third = b_.fmul(b_.fadd(b_.fadd(t[n ^ 1][c], t[n ^ 2][c]), t[n ^ 3][c]), b_.f32(1.0f / 3.0f));
        whole[n] = b_.select(missing[n], third, t[n][c]);
      }
      b_.set(v, filtered(c, whole[0], whole[1], whole[2], whole[3]));
      b_.endIf();
      out[c] = b_.get(v);
    }
    return out;
  }

  // A cube texel beyond its face's edge: the direction through its centre names face and texel.
  void acrossEdge(const Point& p, Value extent, Value& x, Value& y, Value& face) {
    Value outside = b_.maskOr(b_.maskNot(b_.ult(x, extent)), b_.maskNot(b_.ult(y, extent)));
    Value scale = b_.fdiv(b_.f32(2.0f), b_.convert(Op::UToF, Type::F32, extent));
    auto centre = [&](Value i) { return b_.fsub(b_.fmul(b_.fadd(b_.convert(Op::SToF, Type::F32, i), b_.f32(0.5f)), scale), b_.f32(1.0f)); };
    Value s = centre(x), t = centre(y), one = b_.f32(1.0f);
    Value ns = b_.fneg(s), nt = b_.fneg(t), minus = b_.f32(-1.0f);
    Value axis = b_.lshr(p.face, b_.i32(1));
    Value negative = b_.ine(b_.and_(p.face, b_.i32(1)), b_.i32(0));
    Value isX = b_.ieq(axis, b_.i32(0)), isY = b_.ieq(axis, b_.i32(1));
    Value major = b_.select(negative, minus, one);
    auto pick = [&](Value vx, Value vy, Value vz) { return b_.select(isX, vx, b_.select(isY, vy, vz)); };
    Value direction[3] = {pick(major, s, b_.select(negative, ns, s)), pick(nt, major, nt),
                          pick(b_.select(negative, s, ns), b_.select(negative, nt, t), major)};
    CubeFace other = cubeFace(b_, direction, nullptr, nullptr);
    Value size = b_.convert(Op::UToF, Type::F32, extent);
    Value last = b_.isub(extent, b_.i32(1)), zero = b_.i32(0);
    auto index = [&](Value c) { return b_.smin(b_.smax(b_.convert(Op::FToS, Type::I32, b_.ffloor(b_.fmul(c, size))), zero), last); };
    face = b_.select(outside, other.face, p.face);
    x = b_.select(outside, index(other.s), x);
    y = b_.select(outside, index(other.t), y);
  }

  Texel corner(const Point& p, const LevelView& level, const Axis* axis, unsigned chosen) {
    Value at[3] = {};
    Value inside = 0;
    for (unsigned i = 0; i < s_.dimensions; ++i) {
      unsigned k = chosen >> i & 1;
      at[i] = axis[i].index[k];
      if (axis[i].inside[k]) inside = inside ? b_.maskAnd(inside, axis[i].inside[k]) : axis[i].inside[k];
    }
    Value layer = p.layer;
    if (s_.isCube()) {
      Value face = p.face;
      if (linear_) acrossEdge(p, level.extent[0], at[0], at[1], face);
      layer = cubeLayer(p, face);
    }
    Texel t = loadTexel(level, at, layer);
    if (inside) {
      for (unsigned c = 0; c < 4; ++c) t[c] = b_.select(inside, t[c], borderComponent(c));
    }
    return compare_ ? compared(t) : t;
  }

  Value cubeLayer(const Point& p, Value face) { return p.base ? b_.iadd(p.base, face) : face; }

  Texel texel(const LevelView& level, const Value (&at)[3], Value layer) {
    Texel t = loadTexel(level, at, layer);
    return compare_ ? compared(t) : t;
  }

  Texel loadTexel(const LevelView& level, const Value (&at)[3], Value layer) {
    return texelAt(sliceAddress(s_.fields, level.level, layer, s_.dimensions > 2 ? at[2] : 0, 0), at);
  }

  Texel texelAt(const SliceAddress& slice, const Value (&at)[3]) {
    if (s_.format.isCompressed()) return loadTexelAt(s_, slice, at, true);
    RawElement raw = loadRaw(b_, s_.format, slice.base, texelOffset(s_, slice, at), slice.size, true);
    return unscaled_ ? unpackUnscaled(b_, s_.format, raw) : unpack(b_, s_.format, raw);
  }

  Value borderComponent(unsigned c) {
    const SamplerRef& r = s_.sampler;
    // A border has the components of the image's format only; absent ones are 0 and alpha 1.
    if (!s_.format.rgba[c].bits) return s_.integer() ? b_.i32(c == 3) : b_.f32(c == 3 ? 1.0f : 0.0f);
    return b_.tableLoad(s_.integer() ? Type::I32 : Type::F32, r.table, r.constOffset + uint32_t(offsetof(SamplerDescriptor, border) + 4 * c), r.dynamicOffset);
  }

  Texel compared(const Texel& t) {
    Value d = t[0], ref = s_.in.dref;
    if (b_.type(ref) == Type::F16) ref = b_.convert(Op::FToF, Type::F32, ref);
    if (s_.format.rgba[0].numeric == Numeric::Unorm) ref = b_.fmin(b_.fmax(ref, b_.f32(0.0f)), b_.f32(1.0f));
    Value m;
    switch (s_.sampler.key.compareOp) {
      case VK_COMPARE_OP_NEVER: m = b_.mask(false); break;
      case VK_COMPARE_OP_LESS: m = b_.flt(ref, d); break;
      case VK_COMPARE_OP_EQUAL: m = b_.feq(ref, d); break;
      case VK_COMPARE_OP_LESS_OR_EQUAL: m = b_.fle(ref, d); break;
      case VK_COMPARE_OP_GREATER: m = b_.flt(d, ref); break;
      case VK_COMPARE_OP_NOT_EQUAL: m = b_.fne(ref, d); break;
      case VK_COMPARE_OP_GREATER_OR_EQUAL: m = b_.fle(d, ref); break;
      default: m = b_.mask(true); break;
    }
    return {b_.select(m, b_.f32(1.0f), b_.f32(0.0f)), b_.f32(0.0f), b_.f32(0.0f), b_.f32(1.0f)};
  }

  ImageBuild& s_;
  Builder& b_;
  bool linear_;
  Value linearMask_;
  uint8_t mode_[3] = {};
  bool border_ = false, compare_ = false, unscaled_ = false;
};

Value asF32(Builder& b, Value v) { return b.type(v) == Type::F16 ? b.convert(Op::FToF, Type::F32, v) : v; }

// The point and the derivatives in the coordinates of the addressed texels.
Point makePoint(ImageBuild& s, bool derivatives, Value (&ddx)[3], Value (&ddy)[3]) {
  Builder& b = s.b;
  const unsigned given = imageDimensions(s.op.dim);
  for (Value* list : {s.in.coordinate, s.in.ddx, s.in.ddy})
    for (unsigned i = 0; i < given; ++i)
      if (list[i]) list[i] = asF32(b, list[i]);
  Point p;
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
    p.base = layer ? b.imul(layer, b.i32(6)) : 0;
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

LevelView levelView(ImageBuild& s, Value level) {
  LevelView v;
  v.level = level;
  for (unsigned i = 0; i < s.dimensions; ++i) v.extent[i] = s.extent(i, level);
  return v;
}

Value lastLevel(ImageBuild& s) { return s.b.isub(s.fields.i32(offsetof(ImageDescriptor, levelCount)), s.b.i32(1)); }

// ceil(x + 1/2) - 1, at least 0: halves go to the finer level.
Value nearestLevel(Builder& b, Value lambda, Value last) {
  Value l = b.isub(b.convert(Op::FToS, Type::I32, b.unary(Op::FCeil, b.fadd(lambda, b.f32(0.5f)))), b.i32(1));
  return b.smax(b.smin(l, last), b.i32(0));
}

}  // namespace

namespace {

// Everything of one sample but its place: filters and levels.
class Sampling {
 public:
  Sampling(ImageBuild& s, bool oneLevel, bool mag, bool min, const LevelOfDetail* lod)
      : s_(s), b_(s.b), lod_(lod), oneLevel_(oneLevel), filter_(s, lod ? mag || min : mag, lod ? linearMask(mag, min) : 0) {}

  Texel sample(const Point& p) {
    if (!lod_ || oneLevel_) return filter_.sample(p, levelView(s_, 0));
    Value last = lastLevel(s_);
    if (s_.sampler.key.mipmapMode == VK_SAMPLER_MIPMAP_MODE_NEAREST || s_.integer())
      return filter_.sample(p, levelView(s_, nearestLevel(b_, lod_->clamped, last)));
    return sampleTwo(p, last);
  }

  Value combine(Value low, Value high, Value weight) { return filter_.combine(low, high, weight); }

 private:
  Value linearMask(bool mag, bool min) {
    if (mag == min) return 0;
    Value magnified = b_.fle(lod_->clamped, b_.f32(0.0f));
    return mag ? magnified : b_.maskNot(magnified);
  }

  Texel sampleTwo(const Point& p, Value last) {
    Value lambda = b_.fmax(b_.fmin(lod_->clamped, b_.convert(Op::SToF, Type::F32, last)), b_.f32(0.0f));
    Value floor = b_.ffloor(lambda);
    Value weight = b_.fsub(lambda, floor);
    Value fine = b_.convert(Op::FToS, Type::I32, floor);
    Texel t = filter_.sample(p, levelView(s_, fine));
    // The coarser level only where it has a share.
    Value result[4];
    for (int c = 0; c < 4; ++c) {
      if (b_.isConstant(t[c])) continue;
      result[c] = b_.var(Type::F32);
      b_.set(result[c], t[c]);
    }
    b_.beginIf(b_.flt(b_.f32(0.0f), weight));
    Texel coarse = filter_.sample(p, levelView(s_, b_.smin(b_.iadd(fine, b_.i32(1)), last)));
    for (int c = 0; c < 4; ++c)
      if (!b_.isConstant(t[c])) b_.set(result[c], combine(t[c], coarse[c], weight));
    b_.endIf();
    for (int c = 0; c < 4; ++c)
      if (!b_.isConstant(t[c])) t[c] = b_.get(result[c]);
    return t;
  }

  ImageBuild& s_;
  Builder& b_;
  const LevelOfDetail* lod_;
  bool oneLevel_;
  Filter filter_;
};

// The average (or minimum, or maximum) of `count` samples along the footprint's major axis.
Texel sampleAlong(ImageBuild& s, Sampling& sampling, const Point& p, const Footprint& f) {
  Builder& b = s.b;
  const bool average = s.sampler.key.reduction == VK_SAMPLER_REDUCTION_MODE_WEIGHTED_AVERAGE;
  Value index = b.var(Type::I32);
  b.set(index, b.i32(0));
  Value sum[4];
  for (Value& v : sum) {
    v = b.var(Type::F32);
    b.set(v, b.f32(0.0f));
  }
  Value step = b.fdiv(b.f32(1.0f), b.convert(Op::SToF, Type::F32, f.count));
  b.beginLoop();
  Value i = b.get(index);
  b.beginIf(b.sle(f.count, i));
  b.breakOut();
  b.endIf();
  Value along = b.fsub(b.fmul(b.fadd(b.convert(Op::SToF, Type::F32, i), b.f32(0.5f)), step), b.f32(0.5f));
  Point q = p;
  for (int a = 0; a < 2; ++a) q.coordinate[a] = b.fma(along, f.axis[a], p.coordinate[a]);
  Texel t = sampling.sample(q);
  for (int c = 0; c < 4; ++c) {
    Value before = b.get(sum[c]);
    Value first = b.ieq(i, b.i32(0));
    b.set(sum[c], average ? b.fadd(before, t[c]) : b.select(first, t[c], sampling.combine(before, t[c], b.f32(1.0f))));
  }
  b.set(index, b.iadd(i, b.i32(1)));
  b.endLoop();
  Texel out;
  for (int c = 0; c < 4; ++c) out[c] = average ? b.fdiv(b.get(sum[c]), b.convert(Op::SToF, Type::F32, f.count)) : b.get(sum[c]);
  return out;
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
  Point p = makePoint(s, anisotropic || (needLod && !s.in.lod), ddx, ddy);
  Footprint f;
  if (anisotropic) f = footprint(s, ddx, ddy);
  LevelOfDetail lod;
  if (needLod) lod = levelOfDetail(s, ddx, ddy, f.minor);
  Sampling sampling(s, oneLevel, mag, min, needLod ? &lod : nullptr);
  return anisotropic ? sampleAlong(s, sampling, p, f) : sampling.sample(p);
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
  Point p = makePoint(s, false, unused, unused);
  Filter filter(s, true, 0);
  Texel texels[4];
  filter.gather(p, levelView(s, 0), texels);
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
