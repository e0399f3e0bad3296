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
  e.a = int32_t(from.y - to.y);
  e.b = int32_t(to.x - from.x);
  e.c = -(e.a * from.x + e.b * from.y);
  const bool owns = e.a > 0 || (e.a == 0 && e.b > 0);
  if (!owns) e.c -= 1;
  return e;
}

//! Twice the signed area; exact within the guard band.
inline int64_t area2(const SnappedPoint& a, const SnappedPoint& b, const SnappedPoint& c) {
  return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
}

//! Samples of a snapped polygon lie at most so many pixels outside of the exact one.
constexpr double kReachPixels = 1.0 / 128;

//! Whether this processor sets up triangles in fours (setup_batch.cpp), and PUMICE_ISA allows it.
bool fourAtOnce();

//! Everything that is computed once per call of setupPrimitives.
class SetupContext {
 public:
  SetupContext(const SetupState& state, const VertexOutputs& vertices, base::Arena& arena, std::vector<Primitive>& out,
               SetupCounters& counters);

  void triangle(const uint32_t (&slots)[3], uint32_t provoking, uint32_t primitiveId);
  //! Up to four triangles in a row: slots by corner and triangle; which corner is the provoking one, and its slot.
  struct Four {
    uint32_t slots[3][4];
    uint8_t provokingCorner[4];
    uint32_t provoking[4];
    bool consecutive = false;   //!< the slots are twelve numbers in a row
    void set(uint32_t triangle, const uint32_t (&s)[3], uint32_t corner) {
      for (int k = 0; k < 3; k++) slots[k][triangle] = s[k];
      provokingCorner[triangle] = uint8_t(corner);
      provoking[triangle] = s[corner];
    }
    void findConsecutive() {
      consecutive = true;
      for (uint32_t i = 1; i < 12; i++) consecutive &= slots[i % 3][i / 3] == slots[0][0] + i;
    }
  };
  //! Whether four() may be called in this draw, with these slots.
  bool takesFour(std::span<const uint32_t> slots) const { return fourAtOnce() && !state_.singly && plain() && allSlotsExist(slots); }
  //! Does what triangle() would do with each of the first `count`, in order, to the bit. firstId: of the first. The others must have slots, too.
  void four(const Four& four, uint32_t count, uint32_t firstId);
  void line(const uint32_t (&slots)[2], uint32_t provoking, uint32_t primitiveId);
  void point(uint32_t slot, uint32_t primitiveId);

 private:
  struct Box {
    int64_t minX, minY, maxX, maxY;  // 1/256 pixels
  };
  //! What follows from one viewport and its bounds.
  struct Limits {
    Limits(const SetupState& state, const View& view);
    ViewTransform transform;
    VkRect2D bounds;          // the view's bounds with sane extents
    VkRect2D visible;         // bounds and the viewport: triangles end there
    ClipVolume guard;         // planes triangles are cut by
    ClipVolume reject;        // sides of `visible` with a margin: what is wholly outside of one is dropped
    ClipVolume viewVolume;    // the view volume of the specification, for lines and points
    DepthRange depth;
  };
  //! What a whole primitive has, however it is drawn.
  struct Origin {
    uint32_t provokingSlot, primitiveId;
    bool frontFacing = true;
    double depthOffset = 0;   // from the depth bias
    bool ofPolygon = false;   // cull distances are already decided
  };

  //! Nothing but the corners' positions makes one triangle special.
  bool plain() const;
  bool allSlotsExist(std::span<const uint32_t> slots) const;
  //! Takes the viewport and layer of the provoking vertex; false when there is no such layer.
  bool select(uint32_t provokingSlot);
  bool load(uint32_t slot, uint32_t weight, SetupVertex& vertex) const;
  //! Clip distances of the vertices into a volume.
  void userPlanes(const SetupVertex* own, uint32_t count, ClipVolume& volume) const;
  //! A cull distance drops the primitive.
  bool culled(const SetupVertex* own, uint32_t count) const;
  //! outcode(guard_, v) == 0, for the many.
  bool insideGuard(const ClipVertex& v) const;
  static SnappedPoint snapVertex(const ClipVertex& v);
  void clippedTriangle(const SetupVertex (&own)[3], const ClipVolume& volume, uint32_t cutting, uint32_t provokingSlot, uint32_t primitiveId);
  //! A triangle as its edges or corners (polygon modes LINE and POINT).
  void outline(const SetupVertex (&own)[3], const ClipVolume& volume, uint32_t cutting, uint32_t provokingSlot, uint32_t primitiveId);
  void segment(const SetupVertex (&own)[2], const Origin& origin);
  void square(const SetupVertex& own, const Origin& origin);
  void emit(Primitive& primitive, const PlaneSet& set);
  //! The same for one that lies in one cell of the grid; the set is not needed any longer.
  void emitRecord(Primitive& primitive, const PlaneSet& set);
  //! False, and counted, when the face is culled.
  bool facing(int64_t area, bool& front);
  //! Pixels with a sample in the box, limited to `limits`. False, and counted, when there are none.
  bool pixels(const Box& box, const VkRect2D& limits, Primitive& primitive);
  bool coversSample(const Primitive& primitive) const;
  bool thin(const SnappedPoint& a, const SnappedPoint& b, const SnappedPoint& c) const;

  const SetupState& state_;
  const VertexOutputs& vertices_;
  base::Arena& arena_;
  std::vector<Primitive>& out_;
  SetupCounters& counters_;
  std::vector<Limits> views_;
  const Limits* view_;      // of the primitive at hand
  uint16_t layer_ = 0;
  bool choosesView_, userClips_;
  PlaneBuilder planes_;
  Primitive four_[4];       // four() fills these
  int sampleLowX_, sampleLowY_, sampleHighX_, sampleHighY_;  // range of sample positions in a pixel, 1/256
};

}  // namespace pumice::raster
