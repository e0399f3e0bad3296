// Setup of lines and points, as polygons of four edges. Limits: kPointSize..., kLineWidth... in primitive.h.
#include <algorithm>

#include "raster/setup.h"

namespace pumice::raster {

void SetupContext::line(const uint32_t (&slots)[2], uint32_t provoking, uint32_t primitiveId) {
  counters_.input++;
  SetupVertex own[2];
  for (uint32_t i = 0; i < 2; i++)
    if (!load(slots[i], i, own[i])) {
      counters_.clippedAway++;
      return;
    }
  // Lines are clipped to the view volume before they get their width.
  ClipVertex ends[2] = {own[0].clip, own[1].clip};
  const uint32_t out0 = outcode(viewVolume_, ends[0]), out1 = outcode(viewVolume_, ends[1]);
  if ((out0 & out1) || !clipSegment(viewVolume_, out0 | out1, ends[0], ends[1])) {
    counters_.clippedAway++;
    return;
  }
  const SnappedPoint from = snapVertex(ends[0]), to = snapVertex(ends[1]);
  const int64_t x = to.x - from.x, y = to.y - from.y;
  if (x == 0 && y == 0) {
    counters_.culledZeroArea++;
    return;
  }

  // Non-strict lines (Vulkan specification, "Bresenham line segment rasterization" and what may differ from it): a parallelogram whose
  // ends run along the minor axis. With a width of 1 every column (or row) gets one pixel. The start is in, the end is not, so that a
  // strip draws its inner vertices once.
  const bool alongX = std::abs(x) >= std::abs(y);
  const int64_t half = std::clamp<int64_t>(snap(double(state_.lineWidth) / 2), kSubpixelOne / 2, snap(kMaxLineWidth / 2));
  const int64_t sideX = alongX ? 0 : half, sideY = alongX ? half : 0;
  Primitive p;
  p.primitiveId = primitiveId;
  p.frontFacing = true;
  p.edgeCount = 4;
  const SnappedPoint low[2] = {{from.x - sideX, from.y - sideY}, {to.x - sideX, to.y - sideY}};
  const SnappedPoint high[2] = {{from.x + sideX, from.y + sideY}, {to.x + sideX, to.y + sideY}};
  // The inside of an edge is where y grows when going to the right: which of the sides runs forward depends on the direction.
  const bool forward = alongX ? x > 0 : y < 0;
  p.edges[0] = forward ? makeEdge(low[0], low[1]) : makeEdge(low[1], low[0]);
  p.edges[1] = forward ? makeEdge(high[1], high[0]) : makeEdge(high[0], high[1]);
  const int64_t direction = alongX ? (x > 0 ? 1 : -1) : (y > 0 ? 1 : -1);
  const int64_t start = alongX ? from.x : from.y, end = alongX ? to.x : to.y;
  p.edges[2] = {alongX ? direction : 0, alongX ? 0 : direction, -direction * start};
  p.edges[3] = {alongX ? -direction : 0, alongX ? 0 : -direction, direction * end - 1};
  if (!pixels({std::min(low[0].x, low[1].x), std::min(low[0].y, low[1].y), std::max(high[0].x, high[1].x), std::max(high[0].y, high[1].y)},
              bounds_, p))
    return;

  const ScreenVertex a{ends[0].screenX(), ends[0].screenY(), ends[0]}, b{ends[1].screenX(), ends[1].screenY(), ends[1]};
  PlaneSet set;
  if (!planes_.fromSegment(own, provoking, a, b, set)) {
    counters_.clippedAway++;
    return;
  }
  planes_.finishDepth(ends, 2, double(half) / kSubpixelOne + 1.0 / 128, false, set);
  p.planes = set.planes;
  p.flat = set.flat;
  p.minZ = set.minZ;
  p.maxZ = set.maxZ;
  out_.push_back(p);
  counters_.output++;
}

void SetupContext::point(uint32_t slot, uint32_t primitiveId) {
  counters_.input++;
  SetupVertex own;
  // A point is drawn whole or, when its centre is outside of the view volume, not at all.
  if (!load(slot, 0, own) || outcode(viewVolume_, own.clip)) {
    counters_.clippedAway++;
    return;
  }
  float size = vertices_.pointSizeRow >= 0 ? vertices_.rows[vertices_.pointSizeRow][slot] : 1.0f;
  size = size >= kMinPointSize ? std::min(size, kMaxPointSize) : kMinPointSize;  // NaN too becomes the smallest
  const double x = own.clip.screenX(), y = own.clip.screenY(), half = double(size) / 2;
  const int64_t left = snap(x - half), right = snap(x + half), top = snap(y - half), bottom = snap(y + half);
  Primitive p;
  p.primitiveId = primitiveId;
  p.frontFacing = true;
  p.edgeCount = 4;
  p.edges[0] = {1, 0, -left};
  p.edges[1] = {-1, 0, right - 1};
  p.edges[2] = {0, 1, -top};
  p.edges[3] = {0, -1, bottom - 1};
  if (!pixels({left, top, right, bottom}, bounds_, p)) return;
  PlaneSet set;
  if (!planes_.fromPoint(own, set)) {
    counters_.clippedAway++;
    return;
  }
  planes_.finishDepth(&own.clip, 1, 0, false, set);
  p.planes = set.planes;
  p.flat = set.flat;
  p.minZ = set.minZ;
  p.maxZ = set.maxZ;
  out_.push_back(p);
  counters_.output++;
}

}  // namespace pumice::raster
