// Assembly, and setup of triangles.
#include "raster/setup.h"

#include <algorithm>
#include <bit>

#include "base/log.h"

namespace pumice::raster {
namespace {

VkRect2D intersect(const VkRect2D& r, int64_t left, int64_t top, int64_t right, int64_t bottom) {
  const int64_t x0 = std::max<int64_t>(r.offset.x, left), y0 = std::max<int64_t>(r.offset.y, top);
  const int64_t x1 = std::min<int64_t>(int64_t(r.offset.x) + r.extent.width, right);
  const int64_t y1 = std::min<int64_t>(int64_t(r.offset.y) + r.extent.height, bottom);
  VkRect2D result;
  result.offset = {int32_t(x0), int32_t(y0)};
  result.extent = {uint32_t(std::max<int64_t>(x1 - x0, 0)), uint32_t(std::max<int64_t>(y1 - y0, 0))};
  return result;
}

// Andrew's monotone chain; positive area2. Returns the number of corners left.
uint32_t convexHull(SnappedPoint* corners, ClipVertex* polygon, uint32_t count) {
  uint32_t order[kMaxClipVertices];
  for (uint32_t i = 0; i < count; i++) order[i] = i;
  std::sort(order, order + count, [&](uint32_t a, uint32_t b) {
    return corners[a].x != corners[b].x ? corners[a].x < corners[b].x : corners[a].y < corners[b].y;
  });
  uint32_t hull[2 * kMaxClipVertices], n = 0, base = 0;
  auto push = [&](uint32_t i) {
    while (n >= base + 2 && area2(corners[hull[n - 2]], corners[hull[n - 1]], corners[i]) <= 0) n--;
    hull[n++] = i;
  };
  for (uint32_t i = 0; i < count; i++) push(order[i]);
  base = n - 1;
  for (uint32_t i = count - 1; i-- > 0;) push(order[i]);
  n--;  // the first again
  SnappedPoint newCorners[kMaxClipVertices];
  ClipVertex newPolygon[kMaxClipVertices];
  n = std::min(n, kMaxClipVertices);
  for (uint32_t i = 0; i < n; i++) {
    newCorners[i] = corners[hull[i]];
    newPolygon[i] = polygon[hull[i]];
  }
  std::copy(newCorners, newCorners + n, corners);
  std::copy(newPolygon, newPolygon + n, polygon);
  return n;
}

}  // namespace

SetupContext::Limits::Limits(const SetupState& state, const View& view) : transform(view.viewport) {
  const VkViewport& v = view.viewport;
  const double left = std::min<double>(v.x, double(v.x) + v.width), right = std::max<double>(v.x, double(v.x) + v.width);
  const double top = std::min<double>(v.y, double(v.y) + v.height), bottom = std::max<double>(v.y, double(v.y) + v.height);
  // Clipping to the sides of the view volume leaves the pixels whose centres are in the viewport: the same as a limit on
  // pixels, without cutting anything. (Samples of a pixel that a fractional viewport cuts go with its centre.)
  constexpr int64_t kLimit = kGuardBand;
  auto firstCentre = [](double side) {
    return std::isnan(side) ? 0 : int64_t(std::ceil(std::clamp(side, -double(kLimit), double(kLimit)) - 0.5));
  };
  bounds = intersect(view.bounds, 0, 0, kLimit / 2, kLimit / 2);
  visible = intersect(bounds, firstCentre(left), firstCentre(top), firstCentre(right), firstCentre(bottom));

  const uint32_t depthPlanes = state.depthClipEnable ? kDepthPlanes : 0u;
  guard.planes |= depthPlanes;
  guard.left = guard.top = -double(kGuardBand);
  guard.right = guard.bottom = double(kGuardBand);
  reject.planes = kSidePlanes;
  reject.left = double(visible.offset.x) - 1;
  reject.top = double(visible.offset.y) - 1;
  reject.right = double(visible.offset.x) + visible.extent.width + 1;
  reject.bottom = double(visible.offset.y) + visible.extent.height + 1;
  viewVolume.planes |= depthPlanes;
  viewVolume.left = left;
  viewVolume.right = right;
  viewVolume.top = top;
  viewVolume.bottom = bottom;
  depth = {v.minDepth, v.maxDepth};
}

SetupContext::SetupContext(const SetupState& state, const VertexOutputs& vertices, base::Arena& arena, std::vector<Primitive>& out,
                           SetupCounters& counters)
    : state_(state), vertices_(vertices), arena_(arena), out_(out), counters_(counters), choosesView_(vertices.viewportRow >= 0 || vertices.layerRow >= 0),
      userClips_(vertices.clipDistances || vertices.cullDistances), planes_(state, vertices, arena) {
  views_.reserve(vertices.viewportRow >= 0 ? 1 + state.furtherViews.size() : 1);
  views_.emplace_back(state, View{state.viewport, state.bounds});
  if (vertices.viewportRow >= 0)
    for (const View& v : state.furtherViews) views_.emplace_back(state, v);
  view_ = &views_[0];
  planes_.setView(view_->transform);

  sampleLowX_ = sampleLowY_ = 255;
  sampleHighX_ = sampleHighY_ = 0;
  for (const auto& location : sampleLocations(state.samples)) {
    sampleLowX_ = std::min(sampleLowX_, location[0] * 16);
    sampleLowY_ = std::min(sampleLowY_, location[1] * 16);
    sampleHighX_ = std::max(sampleHighX_, location[0] * 16);
    sampleHighY_ = std::max(sampleHighY_, location[1] * 16);
  }
}

bool SetupContext::select(uint32_t provokingSlot) {
  const auto word = [&](int32_t row) { return vertices_.word(uint32_t(row), provokingSlot); };
  if (provokingSlot >= vertices_.vertexCount) return true;
  if (vertices_.layerRow >= 0) {
    const uint32_t layer = word(vertices_.layerRow);
    if (layer >= state_.layers) return false;
    layer_ = uint16_t(layer);
  }
  if (vertices_.viewportRow >= 0) {
    const uint32_t viewport = word(vertices_.viewportRow);
    view_ = &views_[viewport < views_.size() ? viewport : 0];   // out of range is undefined, but not out of bounds
    planes_.setView(view_->transform);
  }
  return true;
}

bool SetupContext::culled(const SetupVertex* own, uint32_t count) const {
  for (uint32_t d = 0; d < vertices_.cullDistances; d++) {
    bool all = true;
    for (uint32_t i = 0; i < count; i++) all &= vertices_.number(uint32_t(vertices_.cullDistanceRow) + d, own[i].slot) < 0;
    if (all) return true;
  }
  return false;
}

void SetupContext::userPlanes(const SetupVertex* own, uint32_t count, ClipVolume& volume) const {
  for (uint32_t d = 0; d < vertices_.clipDistances; d++) {
    bool any = false;
    for (uint32_t i = 0; i < count; i++) {
      const double v = vertices_.number(uint32_t(vertices_.clipDistanceRow) + d, own[i].slot);
      volume.user[d][i] = std::isnan(v) ? -1 : std::clamp(v, -0x1p100, 0x1p100);
      any |= volume.user[d][i] < 0;
    }
    if (any) volume.planes |= 1u << (kClipUser + d);
  }
}

void SetupContext::emit(Primitive& p, const PlaneSet& set) {
  p.layer = layer_;
  p.viewport = uint16_t(view_ - views_.data());
  p.planes = set.planes;
  p.flat = set.flat;
  p.minZ = set.minZ;
  p.maxZ = set.maxZ;
  out_.push_back(p);
}

void SetupContext::emitRecord(Primitive& p, const PlaneSet& set) {
  std::byte* record = static_cast<std::byte*>(arena_.allocBytes(recordBytes(uint32_t(state_.varyings.size())), 16));
  if (!record) {
    base::logError("raster: out of memory in primitive setup, a primitive is lost");
    return;
  }
  p.layer = layer_;
  p.viewport = uint16_t(view_ - views_.data());
  p.planes = set.planes;
  p.flat = set.flat;
  fillRecord(p, state_.varyings, uint32_t(p.minX) / kGridCell * kGridCell, uint32_t(p.minY) / kGridCell * kGridCell, record, view_->depth);
  PlaneSet none;
  none.minZ = set.minZ;
  none.maxZ = set.maxZ;
  p.record = record;
  emit(p, none);
}

bool SetupContext::load(uint32_t slot, uint32_t weight, SetupVertex& vertex) const {
  if (slot >= vertices_.vertexCount) return false;
  const double x = vertices_.number(0, slot), y = vertices_.number(1, slot), z = vertices_.number(2, slot), w = vertices_.number(3, slot);
  vertex.slot = slot;
  vertex.clip.x = x * view_->transform.scaleX + w * view_->transform.offsetX;
  vertex.clip.y = y * view_->transform.scaleY + w * view_->transform.offsetY;
  // Zero times anything finite is zero; NaN and infinity give NaN. (Floats cannot overflow these doubles, and doubles that might count
  // as infinite.)
  constexpr double kEndless = 0x1p200;
  if (vertices_.wideRows && !(std::fabs(x) < kEndless && std::fabs(y) < kEndless && std::fabs(z) < kEndless && std::fabs(w) < kEndless)) return false;
  if (!(vertex.clip.x * 0 + vertex.clip.y * 0 + z * 0 + w * 0 == 0)) return false;
  vertex.clip.z = state_.depthFromMinusOne ? (z + w) / 2 : z;
  vertex.clip.w = w;
  vertex.clip.weight[0] = vertex.clip.weight[1] = vertex.clip.weight[2] = 0;
  vertex.clip.weight[weight] = 1;
  return true;
}

bool SetupContext::insideGuard(const ClipVertex& v) const {
  const double side = double(kGuardBand) * v.w;  // exact: a power of two
  return bool((v.w >= kSmallestW) & (std::fabs(v.x) <= side) & (std::fabs(v.y) <= side) &
              (((view_->guard.planes & kDepthPlanes) == 0) | ((v.z >= 0) & (v.z <= v.w))));
}

SnappedPoint SetupContext::snapVertex(const ClipVertex& v) {
  // Clipped vertices may miss the guard band by a rounding.
  auto limited = [](double pixels) { return std::clamp(pixels, -double(kGuardBand) - 1, double(kGuardBand) + 1); };
  return {snap(limited(v.screenX())), snap(limited(v.screenY()))};
}

bool SetupContext::facing(int64_t area, bool& front) {
  // The specification's area, -1/2 sum(x[i] * y[i+1] - x[i+1] * y[i]), is positive for counter-clockwise: the opposite sign of ours.
  front = (area < 0) == (state_.frontFace == VK_FRONT_FACE_COUNTER_CLOCKWISE);
  const bool culled = (state_.cullMode & (front ? VK_CULL_MODE_FRONT_BIT : VK_CULL_MODE_BACK_BIT)) != 0;
  counters_.culledFace += culled;
  return !culled;
}

bool SetupContext::pixels(const Box& box, const VkRect2D& limits, Primitive& p) {
  // Pixel n has samples at 256 * n + [low, high].
  const int64_t x0 = (box.minX - sampleHighX_ + 255) >> kSubpixelBits, x1 = (box.maxX - sampleLowX_) >> kSubpixelBits;
  const int64_t y0 = (box.minY - sampleHighY_ + 255) >> kSubpixelBits, y1 = (box.maxY - sampleLowY_) >> kSubpixelBits;
  if (x0 > x1 || y0 > y1) {
    counters_.culledNoSample++;
    return false;
  }
  p.minX = int32_t(std::max<int64_t>(x0, limits.offset.x));
  p.minY = int32_t(std::max<int64_t>(y0, limits.offset.y));
  p.maxX = int32_t(std::min<int64_t>(x1, int64_t(limits.offset.x) + limits.extent.width - 1));
  p.maxY = int32_t(std::min<int64_t>(y1, int64_t(limits.offset.y) + limits.extent.height - 1));
  if (p.minX > p.maxX || p.minY > p.maxY) {
    counters_.culledOutside++;
    return false;
  }
  return true;
}

bool SetupContext::coversSample(const Primitive& p) const {
  // Worth asking only where it is cheaper than setting up planes.
  if (state_.samples > 1 || (p.maxX - p.minX) > 1 || (p.maxY - p.minY) > 1) return true;
  for (int64_t y = p.minY; y <= p.maxY; y++)
    for (int64_t x = p.minX; x <= p.maxX; x++) {
      bool inside = true;
      for (uint32_t k = 0; k < p.edgeCount; k++)
        inside &= p.edges[k].a * (x * kSubpixelOne + kSubpixelOne / 2) + p.edges[k].b * (y * kSubpixelOne + kSubpixelOne / 2) +
                      p.edges[k].c >= 0;
      if (inside) return true;
    }
  return false;
}

bool SetupContext::thin(const SnappedPoint& a, const SnappedPoint& b, const SnappedPoint& c) const {
  auto square = [](const SnappedPoint& from, const SnappedPoint& to) {
    const double x = double(to.x - from.x), y = double(to.y - from.y);
    return x * x + y * y;
  };
  // Height over the longest edge: area2 / length.
  const double longest = std::max({square(a, b), square(b, c), square(c, a)});
  const double area = double(area2(a, b, c));
  constexpr double kThin = kThinPixels * kSubpixelOne;
  return area * area < kThin * kThin * longest;
}

void SetupContext::triangle(const uint32_t (&slots)[3], uint32_t provoking, uint32_t primitiveId) {
  counters_.input++;
  if (choosesView_ && !select(slots[provoking])) {
    counters_.culledOutside++;
    return;
  }
  SetupVertex own[3];
  for (uint32_t i = 0; i < 3; i++)
    if (!load(slots[i], i, own[i])) {
      counters_.clippedAway++;
      return;
    }
  const bool inside = insideGuard(own[0].clip) & insideGuard(own[1].clip) & insideGuard(own[2].clip);
  if (!inside || userClips_ || state_.polygonMode != VK_POLYGON_MODE_FILL) {
    ClipVolume volume = view_->guard;
    if (userClips_) {
      if (culled(own, 3)) {
        counters_.clippedAway++;
        return;
      }
      userPlanes(own, 3, volume);
    }
    uint32_t anyOut = 0, allOut = ~0u, allRejected = ~0u;
    for (const SetupVertex& v : own) {
      const uint32_t code = outcode(volume, v.clip);
      anyOut |= code;
      allOut &= code;
      allRejected &= outcode(view_->reject, v.clip);
    }
    if (allOut) {
      counters_.clippedAway++;
      return;
    }
    // Wide lines and points reach further than their triangle.
    if (state_.polygonMode != VK_POLYGON_MODE_FILL) {
      outline(own, volume, anyOut, slots[provoking], primitiveId);
      return;
    }
    if (!inside && allRejected) {
      counters_.culledOutside++;
      return;
    }
    if (anyOut) {
      clippedTriangle(own, volume, anyOut, slots[provoking], primitiveId);
      return;
    }
  }

  SnappedPoint corners[3];
  for (int i = 0; i < 3; i++) corners[i] = snapVertex(own[i].clip);
  const int64_t area = area2(corners[0], corners[1], corners[2]);
  if (area == 0) {
    counters_.culledZeroArea++;
    return;
  }
  Primitive p;
  if (!facing(area, p.frontFacing)) return;
  const auto [minX, maxX] = std::minmax({corners[0].x, corners[1].x, corners[2].x});
  const auto [minY, maxY] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
  if (!pixels({minX, minY, maxX, maxY}, view_->visible, p)) return;
  p.primitiveId = primitiveId;
  for (int i = 0; i < 3; i++) {
    const SnappedPoint &from = corners[i], &to = corners[(i + 1) % 3];
    p.edges[i] = area > 0 ? makeEdge(from, to) : makeEdge(to, from);
  }
  if (!coversSample(p)) {
    counters_.culledNoSample++;
    return;
  }

  double x[3], y[3];
  const bool useSnapped = thin(corners[0], corners[1], corners[2]);
  for (int i = 0; i < 3; i++) {
    x[i] = useSnapped ? double(corners[i].x) / kSubpixelOne : own[i].clip.screenX();
    y[i] = useSnapped ? double(corners[i].y) / kSubpixelOne : own[i].clip.screenY();
  }
  PlaneSet set;
  const bool oneCell = state_.cellRecords && !((uint32_t(p.minX) ^ uint32_t(p.maxX)) / kGridCell | (uint32_t(p.minY) ^ uint32_t(p.maxY)) / kGridCell);
  planes_.setTemporary(oneCell);
  const bool done = planes_.fromOwnCorners(own, slots[provoking], x, y, set);
  planes_.setTemporary(false);
  if (!done) {
    counters_.clippedAway++;
    return;
  }
  const ClipVertex polygon[3] = {own[0].clip, own[1].clip, own[2].clip};
  planes_.finishDepth(polygon, 3, kReachPixels, planes_.depthOffset(polygon, 3, set.planes[0]), set);
  if (oneCell) emitRecord(p, set);
  else emit(p, set);
  counters_.output++;
}

void SetupContext::clippedTriangle(const SetupVertex (&own)[3], const ClipVolume& volume, uint32_t cutting, uint32_t provokingSlot,
                                   uint32_t primitiveId) {
  ClipVertex polygon[kMaxClipVertices] = {own[0].clip, own[1].clip, own[2].clip};
  uint32_t count = clipPolygon(volume, cutting, polygon, 3);
  if (count < 3) {
    counters_.clippedAway++;
    return;
  }
  // Snapping may let neighbours fall together.
  SnappedPoint corners[kMaxClipVertices];
  uint32_t kept = 0;
  for (uint32_t i = 0; i < count; i++) {
    const SnappedPoint corner = snapVertex(polygon[i]);
    if (kept && corner == corners[kept - 1]) continue;
    corners[kept] = corner;
    polygon[kept++] = polygon[i];
  }
  while (kept > 1 && corners[kept - 1] == corners[0]) kept--;
  count = kept;

  // The facing is that of the whole, so that all parts agree.
  int64_t total = 0;
  for (uint32_t i = 2; i < count; i++) total += area2(corners[0], corners[i - 1], corners[i]);
  if (total == 0) {
    counters_.culledZeroArea++;
    return;
  }
  bool front;
  if (!facing(total, front)) return;
  if (total < 0) {
    std::reverse(corners, corners + count);
    std::reverse(polygon, polygon + count);
  }

  // Snapping may also dent a flat corner: then only some corners see the whole polygon, and the fan starts at one of these. If
  // none does (a sliver that crosses itself by less than a snap), the hull stands for it: parts never overlap.
  auto part = [&](uint32_t apex, uint32_t i, uint32_t k) { return (apex + i + k) % count; };
  uint32_t apex = ~0u;
  for (uint32_t candidate = 0; candidate < count && apex == ~0u; candidate++) {
    bool sees = true;
    for (uint32_t i = 1; i + 1 < count; i++)
      sees &= area2(corners[candidate], corners[part(candidate, i, 0)], corners[part(candidate, i, 1)]) >= 0;
    if (sees) apex = candidate;
  }
  if (apex == ~0u) {
    count = convexHull(corners, polygon, count);
    apex = 0;
  }

  PlaneSet set;
  uint32_t emitted = 0;
  for (uint32_t i = 1; i + 1 < count; i++) {
    const SnappedPoint triangle[3] = {corners[apex], corners[part(apex, i, 0)], corners[part(apex, i, 1)]};
    if (area2(triangle[0], triangle[1], triangle[2]) <= 0) continue;
    Primitive p;
    p.frontFacing = front;
    p.primitiveId = primitiveId;
    const auto [minX, maxX] = std::minmax({triangle[0].x, triangle[1].x, triangle[2].x});
    const auto [minY, maxY] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
    SetupCounters parts;  // a part that is dropped is not a dropped primitive
    std::swap(parts, counters_);
    const bool covers = pixels({minX, minY, maxX, maxY}, view_->visible, p);
    std::swap(parts, counters_);
    if (!covers) continue;
    for (int k = 0; k < 3; k++) p.edges[k] = makeEdge(triangle[k], triangle[(k + 1) % 3]);
    if (!coversSample(p)) continue;

    if (!set.planes) {
      // One set for all parts: clipping does not change what is interpolated. The largest part tells whether the whole is thin.
      int64_t largest = 0;
      uint32_t at = 1;
      for (uint32_t k = 1; k + 1 < count; k++) {
        const int64_t area = area2(corners[apex], corners[part(apex, k, 0)], corners[part(apex, k, 1)]);
        if (area > largest) {
          largest = area;
          at = k;
        }
      }
      const uint32_t a = apex, b = part(apex, at, 0), c = part(apex, at, 1);
      bool done = false;
      if (!thin(corners[a], corners[b], corners[c]))
        done = planes_.fromHomogeneous(own, provokingSlot, (double(p.minX) + p.maxX) / 2, (double(p.minY) + p.maxY) / 2, set);
      if (!done) {
        auto corner = [&](uint32_t k) {
          return ScreenVertex{double(corners[k].x) / kSubpixelOne, double(corners[k].y) / kSubpixelOne, polygon[k]};
        };
        const ScreenVertex three[3] = {corner(a), corner(b), corner(c)};
        done = planes_.fromCorners(own, provokingSlot, three, set);
      }
      if (!done) break;
      planes_.finishDepth(polygon, count, kReachPixels, planes_.depthOffset(polygon, count, set.planes[0]), set);
    }
    emit(p, set);
    emitted++;
  }
  if (emitted)
    counters_.output += emitted;
  else
    counters_.culledOutside++;
}

void setupPrimitives(const SetupState& state, const VertexOutputs& vertices, std::span<const uint32_t> slots,
                     uint32_t firstPrimitiveId, base::Arena& arena, std::vector<Primitive>& out, SetupCounters& counters) {
  SetupContext context(state, vertices, arena, out, counters);
  const size_t n = slots.size();
  const bool last = state.provokingLast;
  uint32_t id = firstPrimitiveId;
  // corners(i, take) calls take(slots, provoking corner) with those of triangle i.
  const auto triangles = [&](size_t count, const auto& corners) {
    size_t i = 0;
    if (count >= 2 && context.takesFour(slots)) {
      SetupContext::Four four;
      for (; i + 2 <= count; i += 4, id += 4) {
        for (uint32_t k = 0; k < 4; k++)
          corners(std::min(i + k, count - 1), [&](const uint32_t(&s)[3], uint32_t provoking) { four.set(k, s, provoking); });
        four.findConsecutive();
        context.four(four, uint32_t(std::min<size_t>(count - i, 4)), id);
      }
    }
    for (; i < count; i++) corners(i, [&](const uint32_t(&s)[3], uint32_t provoking) { context.triangle(s, provoking, id++); });
  };
  // Vulkan specification, "Primitive topologies"; adjacent vertices are only for geometry shaders.
  switch (state.topology) {
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST:
      triangles(n / 3, [&](size_t i, auto&& take) { take({slots[3 * i], slots[3 * i + 1], slots[3 * i + 2]}, last ? 2 : 0); });
      break;
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP:
      triangles(n < 3 ? 0 : n - 2, [&](size_t i, auto&& take) {
        if (i & 1) take({slots[i], slots[i + 2], slots[i + 1]}, last ? 1 : 0);
        else take({slots[i], slots[i + 1], slots[i + 2]}, last ? 2 : 0);
      });
      break;
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN:
      triangles(n < 3 ? 0 : n - 2, [&](size_t i, auto&& take) { take({slots[i + 1], slots[i + 2], slots[0]}, last ? 1 : 0); });
      break;
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST_WITH_ADJACENCY:
      triangles(n / 6, [&](size_t i, auto&& take) { take({slots[6 * i], slots[6 * i + 2], slots[6 * i + 4]}, last ? 2 : 0); });
      break;
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP_WITH_ADJACENCY:
      triangles(n < 6 ? 0 : (n - 4) / 2, [&](size_t i, auto&& take) {
        if (i & 1) take({slots[2 * i], slots[2 * i + 4], slots[2 * i + 2]}, last ? 1 : 0);
        else take({slots[2 * i], slots[2 * i + 2], slots[2 * i + 4]}, last ? 2 : 0);
      });
      break;
    case VK_PRIMITIVE_TOPOLOGY_LINE_LIST:
      for (size_t i = 0; i + 2 <= n; i += 2) context.line({slots[i], slots[i + 1]}, last ? 1 : 0, id++);
      break;
    case VK_PRIMITIVE_TOPOLOGY_LINE_STRIP:
      for (size_t i = 0; i + 2 <= n; i++) context.line({slots[i], slots[i + 1]}, last ? 1 : 0, id++);
      break;
    case VK_PRIMITIVE_TOPOLOGY_LINE_LIST_WITH_ADJACENCY:
      for (size_t i = 0; i + 4 <= n; i += 4) context.line({slots[i + 1], slots[i + 2]}, last ? 1 : 0, id++);
      break;
    case VK_PRIMITIVE_TOPOLOGY_LINE_STRIP_WITH_ADJACENCY:
      for (size_t i = 0; i + 4 <= n; i++) context.line({slots[i + 1], slots[i + 2]}, last ? 1 : 0, id++);
      break;
    case VK_PRIMITIVE_TOPOLOGY_POINT_LIST:
      for (size_t i = 0; i < n; i++) context.point(slots[i], id++);
      break;
    default:  // patches are tessellated before they come here
      break;
  }
}

}  // namespace pumice::raster
