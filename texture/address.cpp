#include "texture/address.h"

#include <bit>
#include <cstddef>

namespace pumice::texture {

using ir::Builder;
using ir::Op;
using ir::Type;
using ir::Value;

namespace {

Value widen(Builder& b, Value v) { return b.convert(Op::ZExt, Type::I64, v); }

Value scaleBy(Builder& b, Value v, uint32_t factor) {
  if (factor == 1) return v;
  return std::has_single_bit(factor) ? b.shl(v, b.i32(uint32_t(std::countr_zero(factor)))) : b.imul(v, b.i32(factor));
}

struct LevelFields {
  Value offset, slicePitch, rowPitch;  // i64, i64, i32
};

LevelFields loadLevel(Builder& b, Value levels, Value level, Value bytes) {
  Value at = level ? scaleBy(b, level, sizeof(LevelLayout)) : b.i32(0);
  return {b.loadConst(Type::I64, levels, at, bytes, offsetof(LevelLayout, offset)),
          b.loadConst(Type::I64, levels, at, bytes, offsetof(LevelLayout, slicePitch)),
          b.loadConst(Type::I32, levels, at, bytes, offsetof(LevelLayout, rowPitch))};
}

}  // namespace

SliceAddress sliceAddress(const ImageFields& f, Value level, Value layer, Value z, Value sample) {
  Builder& b = f.b;
  // A null descriptor has no levels, so that nothing is read through its address.
  Value levelBytes = widen(b, b.imul(f.i32(offsetof(ImageDescriptor, levelCount)), b.i32(sizeof(LevelLayout))));
  LevelFields l = loadLevel(b, f.i64(offsetof(ImageDescriptor, levels)), level, levelBytes);
  Value skip = l.offset;
  if (layer) skip = b.iadd(skip, b.imul(widen(b, layer), f.i64(offsetof(ImageDescriptor, layerPitch))));
  if (sample) skip = b.iadd(skip, b.imul(widen(b, sample), f.i64(offsetof(ImageDescriptor, samplePitch))));
  if (z) skip = b.iadd(skip, b.imul(widen(b, z), l.slicePitch));
  Value size = f.i64(offsetof(ImageDescriptor, size));
  SliceAddress s;
  s.base = b.iadd(f.i64(offsetof(ImageDescriptor, base)), skip);
  s.size = b.select(b.ult(skip, size), b.isub(size, skip), b.i64(0));
  s.rowPitch = l.rowPitch;
  return s;
}

Value columnOffset(Builder& b, bool tiled, uint32_t elementBytes, Value x) {
  if (!tiled) return scaleBy(b, x, elementBytes);
  // Element index: 16 a block, 4 a quad, 1 a column: (x>>2)*16 + (x>>1 & 1)*4 + (x & 1).
  Value index = b.iadd(b.iadd(x, b.and_(x, b.i32(~1u))), b.shl(b.and_(x, b.i32(~3u)), b.i32(1)));
  return scaleBy(b, index, elementBytes);
}

Value rowOffset(Builder& b, bool tiled, uint32_t elementBytes, Value rowPitch, Value y) {
  if (!tiled) return b.imul(y, rowPitch);
  // (y>>1 & 1)*8 + (y & 1)*2, halved.
  Value inside = b.iadd(b.and_(y, b.i32(3)), b.and_(y, b.i32(2)));
  return b.iadd(b.imul(b.lshr(y, b.i32(2)), rowPitch), scaleBy(b, inside, 2 * elementBytes));
}

Value elementOffset(Builder& b, const ViewKey& key, Value levelsAddress, Value level, Value layer, Value layerPitch, Value x, Value y, Value z) {
  const FormatInfo& f = planeFormat(allFormats()[key.format - 1], key.aspect);
  LevelFields l = loadLevel(b, levelsAddress, level, b.i64(kMaxLevels * sizeof(LevelLayout)));
  Value at = l.offset;
  if (layer) at = b.iadd(at, b.imul(widen(b, layer), layerPitch));
  if (z) at = b.iadd(at, b.imul(widen(b, z), l.slicePitch));
  Value within = columnOffset(b, key.tiled, f.elementBytes, x);
  if (y) within = b.iadd(within, rowOffset(b, key.tiled, f.elementBytes, l.rowPitch, y));
  return b.iadd(at, widen(b, within));
}

}  // namespace pumice::texture
