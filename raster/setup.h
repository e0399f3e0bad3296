// What primitive setup shares between triangles, lines and points. The room's own header.
#pragma once

#include "raster/planes.h"
#include "raster/tiles.h"

namespace pumice::raster {

//! A snapped position in 1/256 pixels.
struct SnappedPoint {
  int64_t x, y;
  bool operator==(const SnappedPoint&) const = default;
};

//! The edge from one snapped point to another, inside on the side where y grows when going to the right (framebuffer coordinates, y
//! down: the corners of a polygon with positive area2() go clockwise on the screen). Top and left edges own the samples on them.
inline Edge makeEdge(const SnappedPoint& from, const SnappedPoint& to) {
  Edge e;
  e.a = from.y - to.y;
  e.b = to.x - from.x;
  e.c = -(e.a * from.x + e.b * from.y);
  const bool owns = e.a > 0 || (e.a == 0 && e.b > 0);
  if (!owns) e.c -= 1;
  return e;
}

//! Twice the signed area; exact within the guard band.
inline int64_t area2(const SnappedPoint& a, const SnappedPoint& b, const SnappedPoint& c) {
  return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
}

//! Everything that is computed once per call of setupPrimitives.
class SetupContext {
 public:
  SetupContext(const SetupState& state, const VertexOutputs& vertices, base::Arena& arena, std::vector<Primitive>& out,
               SetupCounters& counters);

  void triangle(const uint32_t (&slots)[3], uint32_t provoking, uint32_t primitiveId);
  void line(const uint32_t (&slots)[2], uint32_t provoking, uint32_t primitiveId);
  void point(uint32_t slot, uint32_t primitiveId);

 private:
  struct Box {
    int64_t minX, minY, maxX, maxY;  // 1/256 pixels
  };

  bool load(uint32_t slot, uint32_t weight, SetupVertex& vertex) const;
  //! outcode(guard_, v) == 0, for the many.
  bool insideGuard(const ClipVertex& v) const;
  static SnappedPoint snapVertex(const ClipVertex& v);
  void clippedTriangle(const SetupVertex (&own)[3], uint32_t cutting, uint32_t provoking, uint32_t primitiveId);
  //! False, and counted, when the face is culled.
  bool facing(int64_t area, bool& front);
  //! Pixels with a sample in the box, limited to `limits`. False, and counted, when there are none.
  bool pixels(const Box& box, const VkRect2D& limits, Primitive& primitive);
  bool coversSample(const Primitive& primitive) const;
  bool thin(const SnappedPoint& a, const SnappedPoint& b, const SnappedPoint& c) const;

  const SetupState& state_;
  const VertexOutputs& vertices_;
  std::vector<Primitive>& out_;
  SetupCounters& counters_;
  ViewTransform view_;
  PlaneBuilder planes_;
  VkRect2D bounds_;         // the state's bounds with sane extents
  VkRect2D visible_;        // bounds_ and the viewport: triangles end there
  ClipVolume guard_;        // planes triangles are cut by
  ClipVolume reject_;       // sides of `visible_` with a margin: what is wholly outside of one is dropped
  ClipVolume viewVolume_;   // the view volume of the specification, for lines and points
  int sampleLowX_, sampleLowY_, sampleHighX_, sampleHighY_;  // range of sample positions in a pixel, 1/256
};

}  // namespace pumice::raster
