// Addresses of elements in image memory as lane IR: the counterpart of ImageLayout::elementOffset.
#pragma once

#include "texture/addressing.h"
#include "texture/builders.h"

namespace pumice::texture {

//! Fields of an image descriptor in set memory, loaded where they are used (equal loads merge, unused ones vanish).
struct ImageFields {
  ir::Builder& b;
  const ImageRef& ref;
  unsigned plane = 0;   //!< of a multi-planar view

  ir::Value i32(size_t offset) const { return b.tableLoad(ir::Type::I32, ref.table, ref.constOffset + uint32_t(offset), ref.dynamicOffset); }
  ir::Value i64(size_t offset) const { return b.tableLoad(ir::Type::I64, ref.table, ref.constOffset + uint32_t(offset), ref.dynamicOffset); }
  //! Of the plane: where it begins, and how much of it may be accessed.
  ir::Value base() const { return i64(plane ? offsetof(ImageDescriptor, planes) + 16 * (plane - 1) : offsetof(ImageDescriptor, base)); }
  ir::Value size() const { return i64(plane ? offsetof(ImageDescriptor, planes) + 16 * (plane - 1) + 8 : offsetof(ImageDescriptor, size)); }
  ir::Value f32(size_t offset) const { return b.tableLoad(ir::Type::F32, ref.table, ref.constOffset + uint32_t(offset), ref.dynamicOffset); }
};

//! Where a slice (one level, layer, depth slice, sample) of a view begins; everything that may vary within it is an i32 offset
//! (a slice has less than 4 GiB: 16384 x 16384 texels of 16 bytes). In compact views what may vary from lane to lane, level,
//! layer, z and sample, is an offset too, so that base and size are the same for all lanes: executors do much better with that.
struct SliceAddress {
  ir::Value base = 0;      //!< i64
  ir::Value size = 0;      //!< i64, bytes from base that may be accessed
  ir::Value offset = 0;    //!< i32, to be added; none: 0
  ir::Value rowPitch = 0;  //!< i32
  ir::Value slicePitch = 0;  //!< i32 in compact views, else i64
};

//! `level` (i32) counts from the view's base; 0 = none: level 0. Absent layer, z, sample are none.
SliceAddress sliceAddress(const ImageFields& f, ir::Value level, ir::Value layer, ir::Value z, ir::Value sample);
//! Moved on by layers and depth slices of the same level (i32; 0 = none).
SliceAddress withinSlice(const ImageFields& f, const SliceAddress& slice, ir::Value layers, ir::Value z);
//! An offset that every access of a compact view finds out of bounds.
constexpr uint32_t kOutside = ~0u;

//! Offset (i32) of element column x, and of row y: their sum is the element's offset in its slice.
ir::Value columnOffset(ir::Builder& b, bool tiled, uint32_t elementBytes, ir::Value x);
ir::Value rowOffset(ir::Builder& b, bool tiled, uint32_t elementBytes, ir::Value rowPitch, ir::Value y);
//! Both of them in a slice; absent y: none.
ir::Value elementOffset(ir::Builder& b, const SliceAddress& slice, bool tiled, uint32_t elementBytes, ir::Value x, ir::Value y);

}  // namespace pumice::texture
