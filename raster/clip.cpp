#include "raster/clip.h"

#include <algorithm>

namespace pumice::raster {

ClipVertex clipEdge(const ClipVolume& volume, uint32_t plane, const ClipVertex& inside, const ClipVertex& outside) {
  const double in = clipDistance(volume, plane, inside), out = clipDistance(volume, plane, outside);
  const double t = in / (in - out);
  auto mix = [t](double from, double to) { return from + (to - from) * t; };
  ClipVertex v;
  v.x = mix(inside.x, outside.x);
  v.y = mix(inside.y, outside.y);
  v.z = mix(inside.z, outside.z);
  v.w = mix(inside.w, outside.w);
  for (int i = 0; i < 3; i++) v.weight[i] = mix(inside.weight[i], outside.weight[i]);
  // The point lies on the plane; the sums above may miss it by a rounding, and w must not become negative.
  switch (plane) {
    case kClipW: v.w = kSmallestW; break;
    case kClipNear: v.z = 0; break;
    case kClipFar: v.z = v.w; break;
    case kClipLeft: v.x = volume.left * v.w; break;
    case kClipRight: v.x = volume.right * v.w; break;
    case kClipTop: v.y = volume.top * v.w; break;
    case kClipBottom: v.y = volume.bottom * v.w; break;
    default: break;
  }
  v.w = std::max(v.w, kSmallestW);
  return v;
}

uint32_t clipPolygon(const ClipVolume& volume, uint32_t cutting, ClipVertex* polygon, uint32_t count) {
  ClipVertex result[kMaxClipVertices + 1];
  for (uint32_t plane = 0; plane < kClipPlanes; plane++) {
    if (!(cutting >> plane & 1)) continue;
    uint32_t kept = 0;
    auto keep = [&](const ClipVertex& v) {
      if (kept < kMaxClipVertices) result[kept++] = v;
    };
    double distance = clipDistance(volume, plane, polygon[0]);
    for (uint32_t i = 0; i < count; i++) {
      const ClipVertex &from = polygon[i], &to = polygon[i + 1 < count ? i + 1 : 0];
      const double next = clipDistance(volume, plane, to);
      if (distance >= 0) keep(from);
      // A vertex exactly on the plane is its own intersection.
      if (distance > 0 && next < 0) keep(clipEdge(volume, plane, from, to));
      if (distance < 0 && next > 0) keep(clipEdge(volume, plane, to, from));
      distance = next;
    }
    if (kept < 3) return 0;
    count = kept;
    std::copy(result, result + kept, polygon);
  }
  return count;
}

bool clipSegment(const ClipVolume& volume, uint32_t cutting, ClipVertex& from, ClipVertex& to) {
  for (uint32_t plane = 0; plane < kClipPlanes; plane++) {
    if (!(cutting >> plane & 1)) continue;
    const bool fromOutside = clipDistance(volume, plane, from) < 0, toOutside = clipDistance(volume, plane, to) < 0;
    if (fromOutside && toOutside) return false;
    if (fromOutside) from = clipEdge(volume, plane, to, from);
    if (toOutside) to = clipEdge(volume, plane, from, to);
  }
  return true;
}

}  // namespace pumice::raster
