// Planes of depth, 1/w and varyings, in double.
//
// From which positions? From the exact ones, not the snapped: those are what the specification's formulas name, and the error
// against the exact picture is then that of the final float evaluation only. A sample may lie inside the snapped triangle and up
// to 1/256 pixel outside of the exact one; in a triangle that is thinner than kThinPixels such extrapolation is no longer small
// against the triangle's own range of values, so there the planes come from the snapped positions: every covered sample then
// interpolates between the vertices' values.
#pragma once

#include <optional>

#include "raster/clip.h"

namespace pumice::raster {

constexpr double kThinPixels = 0.25;

//! One of a primitive's own vertices, and its slot in VertexOutputs.
struct SetupVertex {
  ClipVertex clip;
  uint32_t slot;
};

struct PlaneSet {
  Plane* planes = nullptr;
  uint32_t* flat = nullptr;
  float minZ = 0, maxZ = 0;
};

//! A corner of the primitive on the screen, from which planes are made: pixels, and what it is made of.
struct ScreenVertex {
  double x, y;
  ClipVertex clip;
};

class PlaneBuilder {
 public:
  PlaneBuilder(const SetupState& state, const VertexOutputs& vertices, base::Arena& arena)
      : state_(state), vertices_(vertices), arena_(arena) {}
  void setView(const ViewTransform& view) { view_ = &view; }
  //! Sets that are made from now on last until the next one (or for good).
  void setTemporary(bool temporary) { temporary_ = temporary; }
  //! Memory for a set; false (and logged) when there is none.
  bool allocate(PlaneSet& set);

  //! Planes through three corners with positive w (exact or snapped positions). The corners are the own vertices, in their order.
  bool fromOwnCorners(const SetupVertex* own, uint32_t provokingSlot, const double* x, const double* y, PlaneSet& set);
  //! The same for any three corners made of the own vertices. False: out of memory or no finite plane.
  bool fromCorners(const SetupVertex* own, uint32_t provokingSlot, const ScreenVertex (&corners)[3], PlaneSet& set);
  //! Planes of a clipped triangle from its own three vertices, some with w <= 0: the homogeneous plane equations (Olano and Greer,
  //! "Triangle scan conversion using 2D homogeneous coordinates", 1997). (referenceX, referenceY): a pixel of the visible part.
  bool fromHomogeneous(const SetupVertex* own, uint32_t provokingSlot, double referenceX, double referenceY, PlaneSet& set);
  //! Values that change along the segment only (lines).
  bool fromSegment(const SetupVertex* own, uint32_t provokingSlot, const ScreenVertex& from, const ScreenVertex& to, PlaneSet& set);
  //! Values that are the same everywhere, but for PointCoord: a point of `size` pixels about (x, y).
  bool fromPoint(const SetupVertex& own, uint32_t provokingSlot, double x, double y, double size, PlaneSet& set);

  //! The unit of the constant depth bias; 0: that of the largest depth as a float. None: nothing is biased.
  std::optional<double> biasUnit() const;
  //! What the depth bias adds to a polygon with these corners and this plane of depth.
  double depthOffset(const ClipVertex* polygon, uint32_t count, const Plane& depth) const;
  //! Adds an offset to depths and finds bounds of depth that hold for every value the fragment routine may compute, from the visible
  //! polygon's corners. Samples lie at most `reach` pixels outside of that polygon.
  void finishDepth(const ClipVertex* polygon, uint32_t count, double reach, double offset, PlaneSet& set) const;

 private:
  template <typename Solve>
  bool fill(uint32_t ownCount, const SetupVertex* own, uint32_t provokingSlot, PlaneSet& set, Solve&& solve);
  void depthRange(const ClipVertex* polygon, uint32_t count, double& low, double& high) const;

  const SetupState& state_;
  const VertexOutputs& vertices_;
  const ViewTransform* view_ = nullptr;
  base::Arena& arena_;
  Plane pointX_, pointY_;
  bool temporary_ = false;
  PlaneSet scratch_;
};

}  // namespace pumice::raster
