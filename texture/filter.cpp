#include "texture/filter.h"

#include <cstddef>
#include <span>

#include "texture/block.h"

namespace pumice::texture {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

MipLevel mipLevel(ImageBuild& s, Value level, Value layer) {
  MipLevel v;
  v.slice = sliceAddress(s.fields, level, layer, 0, 0);
  for (unsigned i = 0; i < s.dimensions; ++i) v.extent[i] = s.extent(i, level);
  return v;
}

Filter::Filter(ImageBuild& s, bool linear, Value linearMask) : s_(s), b_(s.b), linear_(linear), linearMask_(linearMask) {
  const SamplerKey& k = s.sampler.key;
  mode_[0] = k.addressU;
  mode_[1] = k.addressV;
  mode_[2] = k.addressW;
  if (s.isCube() && !k.nonSeamless) mode_[0] = mode_[1] = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  bool border = false;
  for (unsigned i = 0; i < s.dimensions; ++i) border |= mode_[i] == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
  acrossFaces_ = s.isCube() && linear_ && !k.nonSeamless;
  compare_ = s.in.dref && s.sampler.key.compareEnable;
  // Filtering is linear: Unorm texels are divided by 2^n - 1 once, afterwards.
  unscaled_ = linear_ && !border && !compare_ && !s.integer();
}

Texel Filter::sample(const SamplePoint& p, const MipLevel& level) {
  Axis axis[3];
  for (unsigned i = 0; i < s_.dimensions; ++i) axis[i] = makeAxis(i, p.coordinate[i], level.extent[i], s_.in.offset[i]);
  return acrossFaces_ ? reduceCube(p, level, axis) : reduce(p, level, axis);
}

Value Filter::combine(Value low, Value high, Value weight) {
  switch (s_.sampler.key.reduction) {
    // Only texels that have a share count.
    case VK_SAMPLER_REDUCTION_MODE_MIN: return b_.select(b_.flt(b_.f32(0.0f), weight), b_.fmin(low, high), low);
    case VK_SAMPLER_REDUCTION_MODE_MAX: return b_.select(b_.flt(b_.f32(0.0f), weight), b_.fmax(low, high), low);
    default: return lerp(low, high, weight);
  }
}

void Filter::gather(const SamplePoint& p, const MipLevel& level, Texel (&out)[4]) {
  static constexpr uint8_t kCorner[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  unscaled_ = false;
  Axis axis[3];
  const bool four = s_.op.operands & ir::kImageOffsets;
  for (int n = 0; n < 4; ++n) {
    if (n == 0 || four)
      for (unsigned i = 0; i < 2; ++i) axis[i] = makeAxis(i, p.coordinate[i], level.extent[i], four ? s_.in.offsets[n][i] : s_.in.offset[i]);
    // Each of the four offsets names the footprint whose (0, 0) texel is taken.
    unsigned pick = four ? 0u : kCorner[n][0] | kCorner[n][1] << 1;
    out[n] = texel(corner(p, level, axis, pick));
  }
}

// Brings texel indices into the image. Unless texel offsets were added (`anyInteger`) a periodic index is at most one
// step outside its period: makeAxis() removes the rest from the normalised coordinate.
Value Filter::wrapIndex(uint8_t mode, Value i, Value extent, bool anyInteger) {
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

// The periodic part is removed while the coordinate is normalised: fractions are exact and no division is needed.
Value Filter::withinPeriod(uint8_t mode, Value u) {
  // At most 1 already, but for infinite coordinates.
  if (mode == VK_SAMPLER_ADDRESS_MODE_REPEAT) return b_.fmin(b_.fsub(u, b_.ffloor(u)), b_.f32(1.0f));
  if (mode == VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT) {
    Value h = b_.fmul(u, b_.f32(0.5f));
    return b_.fmul(b_.fsub(h, b_.ffloor(h)), b_.f32(2.0f));
  }
  return u;
}

Filter::Axis Filter::makeAxis(unsigned n, Value u, Value extent, Value offset) {
  const uint8_t mode = mode_[n];
  const bool anyInteger = offset != 0, normalized = !s_.sampler.key.unnormalized;
  Value x = u, scale = 0;
  if (normalized) {
    x = withinPeriod(mode, u);
    scale = b_.convert(Op::SToF, Type::F32, extent);
  }
  // x * scale + shift
  auto toTexels = [&](Value shift) {
    if (!scale) return shift ? b_.fadd(x, shift) : x;
    return shift ? b_.fma(x, scale, shift) : b_.fmul(x, scale);
  };
  Axis a;
  Value floor;
  if (linear_) {
    // Where only some lanes filter linearly the others take one texel with weight 0.
    x = toTexels(linearMask_ ? b_.select(linearMask_, b_.f32(-0.5f), b_.f32(0.0f)) : b_.f32(n < 2 ? s_.offset[n] - 0.5f : -0.5f));
    floor = b_.ffloor(x);
    a.weight = b_.fsub(x, floor);
    if (linearMask_) a.weight = b_.select(linearMask_, a.weight, b_.f32(0.0f));
  } else {
    floor = b_.ffloor(toTexels(0));
  }
  const Value one = b_.i32(1), last = b_.isub(extent, one);
  const bool clamped = linear_ && normalized && !offset && mode == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE && !acrossFaces_;
  // Clamped before they are integers, numbers convert without more ado.
  if (clamped) floor = b_.fmin(b_.fmax(floor, b_.f32(-1.0f)), b_.fsub(scale, b_.f32(1.0f)));
  Value i0 = b_.convert(Op::FToS, Type::I32, floor);
  if (offset) i0 = b_.iadd(i0, offset);
  auto next = [&](Value i) { return b_.iadd(i, one); };
  if (acrossFaces_) {
    // Beyond the edge lies another face.
    a.index[0] = i0;
    a.index[1] = next(i0);
  } else if (mode == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER) {
    // What is read outside is not used (nor is it outside the view's memory: loads are bounded).
    for (int k = 0; k < (linear_ ? 2 : 1); ++k) {
      a.index[k] = k ? next(i0) : i0;
      a.inside[k] = b_.ult(a.index[k], extent);
    }
  } else if (mode == VK_SAMPLER_ADDRESS_MODE_REPEAT && !anyInteger && normalized && !linearMask_) {
    // The coordinate was brought to [0, 1]: the first of two texels may be -1, the second or a nearest one the size.
    auto beyond = [&](Value i) { return b_.umin(i, b_.isub(i, extent)); };
    a.index[0] = linear_ ? b_.umin(i0, last) : beyond(i0);
    if (linear_) a.index[1] = beyond(next(i0));
  } else if (mode == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE && linear_) {
    // Clamped first, so that the next one cannot overflow.
    if (!clamped) i0 = b_.smin(b_.smax(i0, b_.i32(~0u)), last);
    a.index[0] = b_.smax(i0, b_.i32(0));
    a.index[1] = b_.smin(next(i0), last);
  } else {
    for (int k = 0; k < (linear_ ? 2 : 1); ++k) a.index[k] = wrapIndex(mode, k ? next(i0) : i0, extent, anyInteger);
  }
  return a;
}

Value Filter::lerp(Value a, Value c, Value w) {
  // Float texels may be infinite: a difference of two infinities would be NaN.
  if (s_.format.rgba[0].numeric == Numeric::Sfloat || s_.format.rgba[0].numeric == Numeric::Ufloat)
    return b_.fma(c, w, b_.fmul(a, b_.fsub(b_.f32(1.0f), w)));
  return b_.fma(w, b_.fsub(c, a), a);
}

std::optional<Op> Filter::wholeFootprint() const {
  if (s_.dimensions != 2 || compare_ || s_.sampler.key.reduction != VK_SAMPLER_REDUCTION_MODE_WEIGHTED_AVERAGE) return {};
  bool halves = s_.format.elementBytes == 8, bytes = s_.format.elementBytes == 4 && unscaled_ && !s_.format.isCompressed();
  for (unsigned c = 0; c < 4; ++c) {
    const Component& k = s_.format.rgba[c];
    halves &= k.numeric == Numeric::Sfloat && k.bits == 16 && k.shift == 16 * c;
    bytes &= !k.bits || (k.numeric == Numeric::Unorm && k.bits == 8 && k.shift % 8 == 0);
  }
  if (halves) return Op::FilterHalves;
  return bytes ? std::optional(Op::FilterBytes) : std::nullopt;
}

bool Filter::takesLevels() const {
  if (!linear_ || linearMask_ || acrossFaces_ || isTiled(s_.image.key) || !isCompact(s_.image.key) || s_.sampler.key.unnormalized || wholeFootprint() != Op::FilterBytes) return false;
  for (unsigned i = 0; i < 2; ++i)
    if (s_.in.offset[i] || s_.offset[i] != 0 || (mode_[i] != VK_SAMPLER_ADDRESS_MODE_REPEAT && mode_[i] != VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE)) return false;
  return true;
}

Texel Filter::sampleLevels(const SamplePoint& p, const MipLevel& level, const MipLevel& coarse, Value weight) {
  std::vector<Value> operands{level.slice.base, level.slice.size};
  uint32_t clamps = 0;
  for (unsigned i = 0; i < 2; ++i) {
    operands.push_back(withinPeriod(mode_[i], p.coordinate[i]));
    if (mode_[i] == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE) clamps |= i ? ir::kFilterClampY : ir::kFilterClampX;
  }
  const MipLevel* const levels[] = {&level, &coarse};
  for (const MipLevel* l : std::span(levels, weight ? 2 : 1)) {
    const SliceAddress slice = p.face ? withinSlice(s_.fields, l->slice, p.face, 0) : l->slice;
    operands.insert(operands.end(), {l->extent[0], l->extent[1], slice.rowPitch, slice.offset ? slice.offset : b_.i32(0)});
  }
  if (weight) operands.push_back(weight);
  Texel out;
  for (unsigned c = 0; c < 4; ++c) {
    const Component& k = s_.format.rgba[c];
    out[c] = k.bits ? b_.emit(weight ? Op::FilterLevels : Op::FilterLevel, Type::F32, operands, k.shift / 8 | clamps) : b_.f32(c == 3 ? 1.0f : 0.0f);
  }
  return out;
}

Texel Filter::reduceWhole(Op op, const MipLevel& level, Value face, const Axis* axis) {
  const SliceAddress slice = face ? withinSlice(s_.fields, level.slice, face, 0) : level.slice;
  const bool tiled = isTiled(s_.image.key);
  Value row[2], column[2];
  for (unsigned k = 0; k < 2; ++k) {
    row[k] = rowOffset(b_, tiled, s_.format.elementBytes, slice.rowPitch, axis[1].index[k]);
    if (slice.offset) row[k] = b_.iadd(row[k], slice.offset);
    column[k] = columnOffset(b_, tiled, s_.format.elementBytes, axis[0].index[k]);
  }
  Texel out;
  for (unsigned c = 0; c < 4; ++c) {
    const Component& k = s_.format.rgba[c];
    if (!k.bits) out[c] = b_.f32(c == 3 ? 1.0f : 0.0f);
    else out[c] = b_.emit(op, Type::F32, {slice.base, slice.size, row[0], row[1], column[0], column[1], axis[0].weight, axis[1].weight}, op == Op::FilterBytes ? k.shift / 8 : c);
  }
  return out;
}

// Weighted sum over the corners. All are loaded first and then taken apart component by component, so that few values live at once.
Texel Filter::reduce(const SamplePoint& p, const MipLevel& level, const Axis* axis) {
  unsigned axes = s_.dimensions;
  if (!linear_) return texel(corner(p, level, axis, 0));
  if (const auto op = wholeFootprint(); op && !axis[0].inside[0] && !axis[1].inside[0]) return reduceWhole(*op, level, p.face, axis);
  Corner corners[8];
  for (unsigned i = 0; i < 1u << axes; ++i) corners[i] = corner(p, level, axis, i);
  Texel out;
  for (unsigned c = 0; c < 4; ++c) {
    Value v[8];
    for (unsigned i = 0; i < 1u << axes; ++i) v[i] = component(corners[i], c);
    for (unsigned n = 0; n < axes; ++n)
      for (unsigned i = 0; i < 1u << (axes - n - 1); ++i) v[i] = v[2 * i] == v[2 * i + 1] ? v[2 * i] : combine(v[2 * i], v[2 * i + 1], axis[n].weight);
    out[c] = v[0];
  }
  return out;
}

// A footprint of 2x2 texels over the edges of a cube. Where three faces meet there is no fourth texel: it is the average of the
// other three (spec, "Cube Map Corner Filtering"). Few footprints leave their face: both cases are branches.
Texel Filter::reduceCube(const SamplePoint& p, const MipLevel& level, const Axis* axis) {
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
    acrossEdge(level.extent[0], x, y, face, p.face);
    b_.set(place[n][0], x);
    b_.set(place[n][1], y);
    b_.set(place[n][2], face);
  }
  b_.endIf();
  Texel t[4];
  for (unsigned n = 0; n < 4; ++n) {
    const Value at[3] = {b_.get(place[n][0]), b_.get(place[n][1]), 0};
    t[n] = texel(load(level, at, b_.get(place[n][2]), 0));
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
void Filter::acrossEdge(Value extent, Value& x, Value& y, Value& face, Value from) {
  Value outside = b_.maskOr(b_.maskNot(b_.ult(x, extent)), b_.maskNot(b_.ult(y, extent)));
  Value scale = b_.fdiv(b_.f32(2.0f), b_.convert(Op::UToF, Type::F32, extent));
  auto centre = [&](Value i) { return b_.fsub(b_.fmul(b_.fadd(b_.convert(Op::SToF, Type::F32, i), b_.f32(0.5f)), scale), b_.f32(1.0f)); };
  Value s = centre(x), t = centre(y), one = b_.f32(1.0f);
  Value ns = b_.fneg(s), nt = b_.fneg(t), minus = b_.f32(-1.0f);
  Value axis = b_.lshr(from, b_.i32(1));
  Value negative = b_.ine(b_.and_(from, b_.i32(1)), b_.i32(0));
  Value isX = b_.ieq(axis, b_.i32(0)), isY = b_.ieq(axis, b_.i32(1));
  Value major = b_.select(negative, minus, one);
  auto pick = [&](Value vx, Value vy, Value vz) { return b_.select(isX, vx, b_.select(isY, vy, vz)); };
  Value direction[3] = {pick(major, s, b_.select(negative, ns, s)), pick(nt, major, nt),
                        pick(b_.select(negative, s, ns), b_.select(negative, nt, t), major)};
  CubeFace other = cubeFace(b_, direction, nullptr, nullptr);
  Value size = b_.convert(Op::UToF, Type::F32, extent);
  Value last = b_.isub(extent, b_.i32(1)), zero = b_.i32(0);
  auto index = [&](Value c) { return b_.smin(b_.smax(b_.convert(Op::FToS, Type::I32, b_.ffloor(b_.fmul(c, size))), zero), last); };
  face = b_.select(outside, other.face, from);
  x = b_.select(outside, index(other.s), x);
  y = b_.select(outside, index(other.t), y);
}

Texel Filter::finish(const Texel& t) {
  if (!unscaled_) return t;
  return s_.format.isCompressed() ? scaleBlockTexel(b_, s_.format, t) : scaleTexel(b_, s_.format, t);
}

Filter::Corner Filter::load(const MipLevel& level, const Value (&at)[3], Value face, Value inside) {
  SliceAddress slice = level.slice;
  if (Value z = s_.dimensions > 2 ? at[2] : 0; z || face) slice = withinSlice(s_.fields, slice, face, z);
  Corner k;
  k.inside = inside;
  if (s_.format.isCompressed()) k.decoded = loadTexelAt(s_, slice, at, true, !unscaled_);
  else k.raw = loadRaw(b_, s_.format, slice.base, texelOffset(s_, slice, at), slice.size, true);
  return k;
}

Filter::Corner Filter::corner(const SamplePoint& p, const MipLevel& level, const Axis* axis, unsigned chosen) {
  Value at[3] = {};
  Value inside = 0;
  for (unsigned i = 0; i < s_.dimensions; ++i) {
    unsigned k = chosen >> i & 1;
    at[i] = axis[i].index[k];
    if (axis[i].inside[k]) inside = inside ? b_.maskAnd(inside, axis[i].inside[k]) : axis[i].inside[k];
  }
  Value face = p.face;
  if (acrossFaces_) acrossEdge(level.extent[0], at[0], at[1], face, p.face);
  return load(level, at, face, inside);
}

Value Filter::component(const Corner& k, unsigned c) {
  if (compare_ && c) return b_.f32(c == 3 ? 1.0f : 0.0f);
  Value v = s_.format.isCompressed() ? k.decoded[c] : unpackComponent(b_, s_.format, k.raw, int(c), !unscaled_);
  if (k.inside) v = b_.select(k.inside, v, borderComponent(c));
  return compare_ ? compared(v) : v;
}

Texel Filter::texel(const Corner& k) {
  Texel t;
  for (unsigned c = 0; c < 4; ++c) t[c] = component(k, c);
  return t;
}

Value Filter::borderComponent(unsigned c) {
  const SamplerRef& r = s_.sampler;
  // A border has the components of the image's format only; absent ones are 0 and alpha 1.
  if (!s_.format.rgba[c].bits) return s_.integer() ? b_.i32(c == 3) : b_.f32(c == 3 ? 1.0f : 0.0f);
  return b_.tableLoad(s_.integer() ? Type::I32 : Type::F32, r.table, r.constOffset + uint32_t(offsetof(SamplerDescriptor, border) + 4 * c), r.dynamicOffset);
}

Value Filter::compared(Value d) {
  Value ref = s_.in.dref;
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
  return b_.select(m, b_.f32(1.0f), b_.f32(0.0f));
}

}  // namespace pumice::texture
