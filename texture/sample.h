// The parts of expandImage(): operands by name, texel fetches, level of detail, filters.
#pragma once

#include "texture/address.h"
#include "texture/pack.h"

namespace pumice::texture {

//! An image instruction's operands by name (0 = absent).
struct ImageOperandValues {
  ir::Value coordinate[3] = {};
  ir::Value layer = 0;          //!< of arrayed operations; f32 for samples, i32 otherwise
  ir::Value dref = 0, bias = 0, lod = 0, sample = 0, minLod = 0, gatherComponent = 0;
  ir::Value ddx[3] = {}, ddy[3] = {};
  ir::Value offset[3] = {};
  ir::Value offsets[4][2] = {};
  std::span<const ir::Value> data;  //!< texel of writes, value (and comparator) of atomics
};

//! Everything that building one image instruction needs.
struct ImageBuild {
  ir::Builder& b;
  const ir::ImageOpInfo& op;
  const ImageRef& image;
  const SamplerRef& sampler;
  ImageFields fields;
  const FormatInfo& format;      //!< of the view's plane
  unsigned dimensions;           //!< of the addressed texels: 2 for cubes
  ImageOperandValues in;
  uint8_t shift[2] = {};         //!< a chroma plane is smaller by these powers of two
  float offset[2] = {};          //!< added to the coordinates of linear filters, in texels

  bool isCube() const { return op.dim == ir::ImageDim::Cube; }
  bool integer() const { return format.isInteger(); }
  ir::Value zero() const { return integer() ? b.i32(0) : b.f32(0.0f); }
  //! Size of dimension i (0..2) of a level (none: the view's first).
  ir::Value extent(unsigned i, ir::Value level) const;
};

//! Level of detail of the accessed point, lambda before and after clamping; for cubes derivatives are those of the face.
struct LevelOfDetail {
  ir::Value unclamped = 0;
  ir::Value clamped = 0;
};
//! `minor`: of an anisotropic footprint; none: from the derivatives' lengths. `onlyLevels`: nobody sees more of it than the levels it
//! stands for, so that below -47 and above 47 any number will do.
LevelOfDetail levelOfDetail(ImageBuild& s, const ir::Value (&ddx)[3], const ir::Value (&ddy)[3], ir::Value minor = 0, bool onlyLevels = false);

//! The footprint of a pixel as an ellipse (spec, "Scale Factor Operation, Level-of-Detail Operation and Image Level(s) Selection";
//! its axes are the singular vectors of the derivatives, so that the footprint does not depend on how the screen's axes lie).
struct Footprint {
  ir::Value count = 0;     //!< i32: samples along the major axis, 1 to maxAnisotropy
  ir::Value axis[2] = {};  //!< the major axis in normalised coordinates, its whole length
  ir::Value minor = 0;     //!< f32: what the level of detail is the logarithm of: the minor axis, or the major one / maxAnisotropy, in texels
};
Footprint footprint(ImageBuild& s, const ir::Value (&ddx)[3], const ir::Value (&ddy)[3]);

//! Face coordinates of a cube direction (spec, "Cube Map Face Selection and Transformations").
struct CubeFace {
  ir::Value face = 0;            //!< i32 0..5
  ir::Value s = 0, t = 0;        //!< in [0, 1]
  ir::Value ddx[3] = {}, ddy[3] = {};  //!< of s and t, where derivatives were given
};
CubeFace cubeFace(ir::Builder& b, const ir::Value (&direction)[3], const ir::Value* ddx, const ir::Value* ddy);

//! Sample and Gather: four components before the view's swizzle is applied (Gather: after).
Texel sampleImage(ImageBuild& s, const char** error);
Texel gatherImage(ImageBuild& s, const char** error);
//! Sample of a view of all planes of a multi-planar format: Y', Cb and Cr where they are after reconstruction, not converted.
Texel samplePlanes(ImageBuild& s, const char** error);
//! Range expansion and model conversion of what samplePlanes() gave, swizzled.
Texel convertYcbcr(ir::Builder& b, const FormatInfo& f, const Conversion& conversion, const Texel& t);
//! The level of detail query: levels accessed, unclamped level of detail.
std::vector<ir::Value> queryLod(ImageBuild& s);

//! Offset (i32) in a slice of the element that holds texel x, y: the texel itself, or its block.
ir::Value texelOffset(ImageBuild& s, const SliceAddress& slice, const ir::Value (&at)[3]);
//! The texel there; compressed ones are decoded (`scale`: of block.h).
Texel loadTexelAt(ImageBuild& s, const SliceAddress& slice, const ir::Value (&at)[3], bool constant, bool scale = true);

//! Applies a view's component swizzle.
Texel swizzle(ir::Builder& b, const ViewKey& key, bool integer, const Texel& t);

}  // namespace pumice::texture
