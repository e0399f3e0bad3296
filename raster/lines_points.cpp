// Setup of lines and points, as polygons of four edges. Limits: kPointSize..., kLineWidth... in primitive.h.
#include <algorithm>
#include <cmath>

#include "raster/setup.h"

namespace pumice::raster {
namespace {

//! The pixel of a point and its diamond, |x - xf| + |y - yf| < 1/2 about the pixel's middle. Points on boundaries count as moved a little
//! to the left, and much less up. ("Bresenham Line Segment Rasterization", Vulkan specification)
struct Diamond {
  explicit Diamond(const SnappedPoint& p)
      : middleX((((p.x - 1) >> kSubpixelBits) << kSubpixelBits) + kSubpixelOne / 2), middleY((((p.y - 1) >> kSubpixelBits) << kSubpixelBits) + kSubpixelOne / 2) {
    const int64_t distance = std::abs(p.x - middleX) + std::abs(p.y - middleY);
    inside = distance < kSubpixelOne / 2 || (distance == kSubpixelOne / 2 && p.x > middleX);
  }
  int64_t middleX, middleY;
  bool inside;
};

}  // namespace

void SetupContext::line(const uint32_t (&slots)[2], uint32_t provoking, uint32_t primitiveId) {
  counters_.input++;
  if (choosesView_ && !select(slots[provoking])) {
    counters_.culledOutside++;
    return;
  }
  SetupVertex own[2];
  for (uint32_t i = 0; i < 2; i++)
    if (!load(slots[i], i, own[i])) {
      counters_.clippedAway++;
      return;
    }
  segment(own, {slots[provoking], primitiveId});
}

void SetupContext::segment(const SetupVertex (&own)[2], const Origin& origin) {
  // Lines are clipped to the view volume before they get their width.
  ClipVolume clipped;
  const ClipVolume* volume = &view_->viewVolume;
  if (userClips_) {
    clipped = *volume;
    volume = &clipped;
    if (!origin.ofPolygon && culled(own, 2)) {
      counters_.clippedAway++;
      return;
    }
    userPlanes(own, 2, clipped);
  }
  ClipVertex ends[2] = {own[0].clip, own[1].clip};
  const uint32_t out0 = outcode(*volume, ends[0]), out1 = outcode(*volume, ends[1]);
  if ((out0 & out1) || !clipSegment(*volume, out0 | out1, ends[0], ends[1])) {
    counters_.clippedAway++;
    return;
  }
  const SnappedPoint from = snapVertex(ends[0]), to = snapVertex(ends[1]);
  const int64_t x = to.x - from.x, y = to.y - from.y;
  if (x == 0 && y == 0) {
    counters_.culledZeroArea++;
    return;
  }

  const int64_t half = std::clamp<int64_t>(snap(double(state_.lineWidth) / 2), kSubpixelOne / 2, snap(kMaxLineWidth / 2));
  Primitive p;
  p.primitiveId = origin.primitiveId;
  p.frontFacing = origin.frontFacing;
  p.edgeCount = 4;
  SnappedPoint low[2], high[2];   // the corners at both ends
  if (state_.lineMode == LineMode::Bresenham) {
    // What "Bresenham line segment rasterization" (Vulkan specification) allows: a parallelogram whose ends run along the minor axis.
    // With a width of 1 every column (or row) gets one pixel. The start is in, the end is not, so that a strip draws its inner vertices
    // once. Of multisampled pixels all samples are covered.
    p.wholePixels = true;
    const bool alongX = std::abs(x) >= std::abs(y);
    const int64_t sideX = alongX ? 0 : half, sideY = alongX ? half : 0;
    low[0] = {from.x - sideX, from.y - sideY}, low[1] = {to.x - sideX, to.y - sideY};
    high[0] = {from.x + sideX, from.y + sideY}, high[1] = {to.x + sideX, to.y + sideY};
    // The inside of an edge is where y grows when going to the right: which of the sides runs forward depends on the direction.
    const bool forward = alongX ? x > 0 : y < 0;
    p.edges[0] = forward ? makeEdge(low[0], low[1]) : makeEdge(low[1], low[0]);
    p.edges[1] = forward ? makeEdge(high[1], high[0]) : makeEdge(high[0], high[1]);
    const int32_t direction = alongX ? (x > 0 ? 1 : -1) : (y > 0 ? 1 : -1);
    int64_t start = alongX ? from.x : from.y, end = alongX ? to.x : to.y;
    // The middles of columns decide, but at an end (not: where the line is clipped) the pixel's diamond: one that the line starts in and
    // leaves is drawn, though its middle lies behind; one that the line ends in is not, though its middle has been passed.
    const auto passed = [&](const SnappedPoint& at, int64_t& middle) {
      const Diamond d(at);
      middle = alongX ? d.middleX : d.middleY;
      return d.inside && direction * ((alongX ? at.x : at.y) - middle) > 0;
    };
    int64_t middle = 0;
    if (!out0 && passed(from, middle)) {
      (alongX ? low[0].x : low[0].y) = middle;   // for the box
      start = middle;
    }
    if (!out1 && passed(to, middle)) end = middle;
    p.edges[2] = {alongX ? direction : 0, alongX ? 0 : direction, -direction * start};
    p.edges[3] = {alongX ? -direction : 0, alongX ? 0 : -direction, direction * end - 1};
  } else {
    // A rectangle about the segment, its corners snapped: from low[0] along the segment and back, clockwise on the screen.
    const double alongX = ends[1].screenX() - ends[0].screenX(), alongY = ends[1].screenY() - ends[0].screenY();
    const double scale = double(half) / kSubpixelOne / std::hypot(alongX, alongY);
    const double sideX = -alongY * scale, sideY = alongX * scale;
    for (int i = 0; i < 2; i++) {
      low[i] = {snap(ends[i].screenX() - sideX), snap(ends[i].screenY() - sideY)};
      high[i] = {snap(ends[i].screenX() + sideX), snap(ends[i].screenY() + sideY)};
    }
    const SnappedPoint around[4] = {low[0], low[1], high[1], high[0]};
    if (area2(around[0], around[1], around[2]) <= 0 || area2(around[0], around[2], around[3]) <= 0) {
      counters_.culledZeroArea++;
      return;
    }
    for (int i = 0; i < 4; i++) p.edges[i] = makeEdge(around[i], around[(i + 1) % 4]);
  }
  const auto [minX, maxX] = std::minmax({low[0].x, low[1].x, high[0].x, high[1].x});
  const auto [minY, maxY] = std::minmax({low[0].y, low[1].y, high[0].y, high[1].y});
  // The sides run on to the middle of a pixel before the start, at most half a pixel up or down; the edges say what is inside.
  const int64_t beside = p.wholePixels ? kSubpixelOne / 2 : 0;
  if (!pixels({minX - beside, minY - beside, maxX + beside, maxY + beside}, view_->bounds, p))
    return;

  const ScreenVertex a{ends[0].screenX(), ends[0].screenY(), ends[0]}, b{ends[1].screenX(), ends[1].screenY(), ends[1]};
  PlaneSet set;
  if (!planes_.fromSegment(own, origin.provokingSlot, a, b, set)) {
    counters_.clippedAway++;
    return;
  }
  // Samples lie up to half a pixel beside the centres.
  planes_.finishDepth(ends, 2, double(half) / kSubpixelOne + 1.0 / 128 + (p.wholePixels ? 1 : 0), origin.depthOffset, set);
  emit(p, set);
  counters_.output++;
}

void SetupContext::point(uint32_t slot, uint32_t primitiveId) {
  counters_.input++;
  if (choosesView_ && !select(slot)) {
    counters_.culledOutside++;
    return;
  }
  SetupVertex own;
  if (!load(slot, 0, own)) {
    counters_.clippedAway++;
    return;
  }
  square(own, {slot, primitiveId});
}

void SetupContext::square(const SetupVertex& own, const Origin& origin) {
  // A point is drawn whole or, when its centre is outside of the view volume, not at all.
  ClipVolume volume = view_->viewVolume;
  if (userClips_) userPlanes(&own, 1, volume);
  if ((!origin.ofPolygon && culled(&own, 1)) || outcode(volume, own.clip)) {
    counters_.clippedAway++;
    return;
  }
  double size = vertices_.pointSizeRow >= 0 ? vertices_.number(uint32_t(vertices_.pointSizeRow), own.slot) : 1;
  size = size >= double(kMinPointSize) ? std::min(size, double(kMaxPointSize)) : double(kMinPointSize);  // NaN too becomes the smallest
  const double x = own.clip.screenX(), y = own.clip.screenY(), half = size / 2;
  const int64_t left = snap(x - half), right = snap(x + half), top = snap(y - half), bottom = snap(y + half);
  Primitive p;
  p.primitiveId = origin.primitiveId;
  p.frontFacing = origin.frontFacing;
  p.edgeCount = 4;
  p.edges[0] = {1, 0, -left};
  p.edges[1] = {-1, 0, right - 1};
  p.edges[2] = {0, 1, -top};
  p.edges[3] = {0, -1, bottom - 1};
  if (!pixels({left, top, right, bottom}, view_->bounds, p)) return;
  PlaneSet set;
  if (!planes_.fromPoint(own, origin.provokingSlot, x, y, size, set)) {
    counters_.clippedAway++;
    return;
  }
  planes_.finishDepth(&own.clip, 1, 0, origin.depthOffset, set);
  emit(p, set);
  counters_.output++;
}

void SetupContext::outline(const SetupVertex (&own)[3], const ClipVolume& volume, uint32_t cutting, uint32_t provokingSlot,
                           uint32_t primitiveId) {
  ClipVertex polygon[kMaxClipVertices] = {own[0].clip, own[1].clip, own[2].clip};
  const uint32_t count = cutting ? clipPolygon(volume, cutting, polygon, 3) : 3;
  if (count < 3) {
    counters_.clippedAway++;
    return;
  }
  int64_t total = 0;
  for (uint32_t i = 2; i < count; i++) total += area2(snapVertex(polygon[0]), snapVertex(polygon[i - 1]), snapVertex(polygon[i]));
  Origin origin{provokingSlot, primitiveId};
  origin.ofPolygon = true;
  if (!facing(total, origin.frontFacing)) return;
  // The bias is that of the polygon. A triangle seen edge-on has no slope to speak of.
  PlaneSet whole;
  if (state_.depthBiasEnable && total != 0 && planes_.fromHomogeneous(own, provokingSlot, polygon[0].screenX(), polygon[0].screenY(), whole))
    origin.depthOffset = planes_.depthOffset(polygon, count, whole.planes[0]);
  SetupCounters parts;   // the triangle counts, not its edges
  std::swap(parts, counters_);
  for (uint32_t i = 0; i < 3; i++) {
    if (state_.polygonMode == VK_POLYGON_MODE_POINT) {
      SetupVertex corner = own[i];
      corner.clip.weight[i] = 0;
      corner.clip.weight[0] = 1;
      square(corner, origin);
    } else {
      SetupVertex ends[2] = {own[i], own[(i + 1) % 3]};
      for (uint32_t k = 0; k < 2; k++)
        for (uint32_t w = 0; w < 3; w++) ends[k].clip.weight[w] = w == k;
      segment(ends, origin);
    }
  }
  std::swap(parts, counters_);
  counters_.output += parts.output;
  counters_.clippedAway += !parts.output;
}

}  // namespace pumice::raster
