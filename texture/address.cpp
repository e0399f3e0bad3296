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

// Base and size moved on.
void advance(Builder& b, SliceAddress& s, Value bytes) {
  s.base = b.iadd(s.base, bytes);
  s.size = b.select(b.ult(bytes, s.size), b.isub(s.size, bytes), b.i64(0));
}

void moveBy(const ImageFields& f, SliceAddress& s, Value count, Value pitch) {
  Builder& b = f.b;
  if (!isCompact(f.ref.key)) return advance(b, s, b.imul(widen(b, count), pitch));
  Value bytes = b.imul(count, pitch);
  s.offset = s.offset ? b.iadd(s.offset, bytes) : bytes;
}

// A field of the descriptor that is 64 bits wide: its low word says it all in a compact view.
void move(const ImageFields& f, SliceAddress& s, Value count, size_t pitchField) {
  moveBy(f, s, count, isCompact(f.ref.key) ? f.i32(pitchField) : f.i64(pitchField));
}

}  // namespace

SliceAddress sliceAddress(const ImageFields& f, Value level, Value layer, Value z, Value sample) {
  Builder& b = f.b;
  const Value levels = f.i64(offsetof(ImageDescriptor, levels));
  // A null descriptor has no levels, so that nothing is read through its address.
  const Value levelBytes = widen(b, b.imul(f.i32(offsetof(ImageDescriptor, levelCount)), b.i32(uint32_t(sizeof(LevelLayout)) * (f.plane + 1))));
  // Each plane of a multi-planar view has one level.
  const Value at = f.plane ? b.i32(uint32_t(sizeof(LevelLayout)) * f.plane) : level ? scaleBy(b, level, sizeof(LevelLayout)) : b.i32(0);
  auto levelField = [&](Type type, size_t field) { return b.loadConst(type, levels, at, levelBytes, uint32_t(field)); };

  SliceAddress s;
  const bool compact = isCompact(f.ref.key);
  const Type word = compact ? Type::I32 : Type::I64;
  s.rowPitch = levelField(Type::I32, offsetof(LevelLayout, rowPitch));
  s.slicePitch = levelField(word, offsetof(LevelLayout, slicePitch));
  s.base = f.base();
  s.size = f.size();
  if (compact && level && !b.isConstant(level)) {
    s.offset = levelField(Type::I32, offsetof(LevelLayout, offset));
  } else {
    advance(b, s, levelField(Type::I64, offsetof(LevelLayout, offset)));
  }
  if (layer || z) s = withinSlice(f, s, layer, z);
  if (sample) move(f, s, sample, offsetof(ImageDescriptor, samplePitch));
  return s;
}

SliceAddress withinSlice(const ImageFields& f, const SliceAddress& slice, Value layers, Value z) {
  SliceAddress s = slice;
  if (layers) move(f, s, layers, offsetof(ImageDescriptor, layerPitch));
  if (z) moveBy(f, s, z, s.slicePitch);
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

Value elementOffset(Builder& b, const SliceAddress& slice, bool tiled, uint32_t elementBytes, Value x, Value y) {
  // In this order, so that the corners of a footprint share rows and columns.
  Value row = slice.offset;
  if (y) {
    Value r = rowOffset(b, tiled, elementBytes, slice.rowPitch, y);
    row = row ? b.iadd(r, row) : r;
  }
  Value column = columnOffset(b, tiled, elementBytes, x);
  return row ? b.iadd(column, row) : column;
}

Value elementOffset(Builder& b, const ViewKey& key, Value levelsAddress, Value level, Value layer, Value layerPitch, Value x, Value y, Value z) {
  const FormatInfo& f = planeFormat(allFormats()[key.format - 1], key.aspect);
  auto levelField = [&](Type type, size_t field) {
    return b.loadConst(type, levelsAddress, level ? scaleBy(b, level, sizeof(LevelLayout)) : b.i32(0), b.i64(kMaxLevels * sizeof(LevelLayout)), uint32_t(field));
  };
  Value at = levelField(Type::I64, offsetof(LevelLayout, offset));
  if (layer) at = b.iadd(at, b.imul(widen(b, layer), layerPitch));
  if (z) at = b.iadd(at, b.imul(widen(b, z), levelField(Type::I64, offsetof(LevelLayout, slicePitch))));
  Value within = columnOffset(b, isTiled(key), f.elementBytes, x);
  if (y) within = b.iadd(within, rowOffset(b, isTiled(key), f.elementBytes, levelField(Type::I32, offsetof(LevelLayout, rowPitch)), y));
  return b.iadd(at, widen(b, within));
}

}  // namespace pumice::texture
