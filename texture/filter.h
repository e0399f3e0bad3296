// Filters of one level (Vulkan spec, "Texel Filtering"): nearest and linear in any number of dimensions, address modes, borders,
// depth comparison, seamless cubes, gather. Weights have full f32 precision.
#pragma once

#include <optional>

#include "texture/sample.h"

namespace pumice::texture {

//! A level as filters read it. Everything here is the same for all samples on the level, so loops build it outside.
struct MipLevel {
  SliceAddress slice;          //!< first face, first depth slice
  ir::Value extent[3] = {};    //!< i32
};
//! `level`, `layer`: i32; 0 = none, the first.
MipLevel mipLevel(ImageBuild& s, ir::Value level, ir::Value layer);

//! The sampled point, after projection to a cube face.
struct SamplePoint {
  ir::Value coordinate[3] = {};
  ir::Value layer = 0;   //!< i32; of cubes their first face; 0 = none
  ir::Value face = 0;    //!< i32, cubes
};

class Filter {
 public:
  //! Linear in the lanes of `linearMask` (none: all).
  Filter(ImageBuild& s, bool linear, ir::Value linearMask);

  //! Before finish().
  Texel sample(const SamplePoint& p, const MipLevel& level);
  //! Where footprints with their addresses are one operation: the same, of two levels if there is a `weight` of the coarse one.
  bool takesLevels() const;
  Texel sampleLevels(const SamplePoint& p, const MipLevel& level, const MipLevel& coarse, ir::Value weight);
  //! Sums, averages and minima of samples become components.
  Texel finish(const Texel& t);
  //! Two partial results, `weight` being the second's share: their average, or their minimum or maximum.
  ir::Value combine(ir::Value low, ir::Value high, ir::Value weight);
  //! The four texels of the linear footprint, in the order gather returns them; finished.
  void gather(const SamplePoint& p, const MipLevel& level, Texel (&out)[4]);

 private:
  // One axis of a footprint: one or two texel indices.
  struct Axis {
    ir::Value index[2] = {};   // inside the image, or, of borders and cubes, perhaps not
    ir::Value inside[2] = {};  // masks, only for ClampToBorder
    ir::Value weight = 0;      // of index[1]; none: nearest
  };
  // A texel that is loaded but not taken apart.
  struct Corner {
    RawElement raw;
    Texel decoded;             // of compressed formats, instead
    ir::Value inside = 0;      // mask, with borders
  };

  Axis makeAxis(unsigned n, ir::Value u, ir::Value extent, ir::Value offset);
  ir::Value wrapIndex(uint8_t mode, ir::Value i, ir::Value extent, bool anyInteger);
  //! A normalised coordinate whose periodic part is removed.
  ir::Value withinPeriod(uint8_t mode, ir::Value u);
  ir::Value lerp(ir::Value a, ir::Value c, ir::Value w);
  //! Two-dimensional footprints of four halves or four bytes a texel: one operation takes all of it.
  std::optional<ir::Op> wholeFootprint() const;
  Texel reduceWhole(ir::Op op, const MipLevel& level, ir::Value face, const Axis* axis);
  Texel reduce(const SamplePoint& p, const MipLevel& level, const Axis* axis);
  Texel reduceCube(const SamplePoint& p, const MipLevel& level, const Axis* axis);
  void acrossEdge(ir::Value extent, ir::Value& x, ir::Value& y, ir::Value& face, ir::Value from);
  Corner load(const MipLevel& level, const ir::Value (&at)[3], ir::Value face, ir::Value inside);
  Corner corner(const SamplePoint& p, const MipLevel& level, const Axis* axis, unsigned chosen);
  ir::Value component(const Corner& k, unsigned c);
  Texel texel(const Corner& k);
  ir::Value borderComponent(unsigned c);
  ir::Value compared(ir::Value depth);

  ImageBuild& s_;
  ir::Builder& b_;
  bool linear_, acrossFaces_ = false;
  ir::Value linearMask_;
  uint8_t mode_[3] = {};
  bool compare_ = false, unscaled_ = false;
};

}  // namespace pumice::texture
