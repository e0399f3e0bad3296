#include "raster/planes.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "base/log.h"

namespace pumice::raster {
namespace {

// What a plane interpolates, as values at the primitive's own vertices.
enum class Quantity { Depth, InverseW, Perspective, Linear };

struct DepthUnit {
  VkFormat format;
  double unit;  // of a fixed-point format; 0: floating point
};
// Vulkan specification, "Depth bias": the minimum resolvable difference r.
constexpr DepthUnit kDepthUnits[] = {
    {VK_FORMAT_D16_UNORM, 0x1p-16},         {VK_FORMAT_D16_UNORM_S8_UINT, 0x1p-16}, {VK_FORMAT_X8_D24_UNORM_PACK32, 0x1p-24},
    {VK_FORMAT_D24_UNORM_S8_UINT, 0x1p-24}, {VK_FORMAT_D32_SFLOAT, 0},              {VK_FORMAT_D32_SFLOAT_S8_UINT, 0},
};

const DepthUnit* depthUnit(VkFormat format) {
  for (const DepthUnit& u : kDepthUnits)
    if (u.format == format) return &u;
  return nullptr;
}

}  // namespace

bool PlaneBuilder::allocate(PlaneSet& set) {
  if (temporary_) {
    if (!scratch_.planes) {
      temporary_ = false;
      const bool done = allocate(scratch_);
      temporary_ = true;
      if (!done) return false;
    }
    set.planes = scratch_.planes;
    set.flat = scratch_.flat;
    return true;
  }
  const size_t varyings = state_.varyings.size();
  set.planes = arena_.alloc<Plane>(2 + varyings);
  set.flat = nullptr;
  bool anyFlat = false;
  for (const Varying& v : state_.varyings) anyFlat |= v.mode == VaryingMode::Flat;
  if (anyFlat && set.planes) {
    const size_t words = vertices_.wideRows ? 2 * varyings : varyings;
    set.flat = arena_.alloc<uint32_t>(words);
    if (set.flat) std::fill_n(set.flat, words, 0u);
  }
  if (set.planes && (!anyFlat || set.flat)) return true;
  base::logError("raster: out of memory in primitive setup, a primitive is lost");
  return false;
}

// solve(quantity, values) gives the plane of a quantity from its values at the own vertices.
template <typename Solve>
bool PlaneBuilder::fill(uint32_t ownCount, const SetupVertex* own, uint32_t provokingSlot, PlaneSet& set, Solve&& solve) {
  if (!allocate(set)) return false;
  double values[3];
  for (uint32_t i = 0; i < ownCount; i++) values[i] = own[i].clip.z;
  Plane depth = solve(Quantity::Depth, values);
  depth.dx *= view_->scaleZ;
  depth.dy *= view_->scaleZ;
  depth.origin = depth.origin * view_->scaleZ + view_->offsetZ;
  set.planes[0] = depth;
  for (uint32_t i = 0; i < ownCount; i++) values[i] = 1;
  set.planes[1] = solve(Quantity::InverseW, values);
  if (!(std::isfinite(depth.dx) && std::isfinite(depth.dy) && std::isfinite(depth.origin))) return false;
  for (size_t v = 0; v < state_.varyings.size(); v++) {
    const Varying& varying = state_.varyings[v];
    if (varying.mode == VaryingMode::PointX || varying.mode == VaryingMode::PointY) {
      set.planes[2 + v] = varying.mode == VaryingMode::PointX ? pointX_ : pointY_;
      continue;
    }
    const uint32_t row = varying.vertexRow;
    if (varying.mode == VaryingMode::Flat) {
      if (int32_t(row) == vertices_.decisionRow) {
        uint32_t* sum = &set.flat[vertices_.wideRows ? 2 * v : v];
        for (uint32_t i = 0; i < ownCount; i++) *sum = (i ? *sum : 0) + vertices_.word(row, own[i].slot);
      } else if (vertices_.wideRows) {
        std::memcpy(&set.flat[2 * v], &vertices_.wideRows[row][provokingSlot], 8);
      } else {
        set.flat[v] = vertices_.word(row, provokingSlot);
      }
      continue;
    }
    for (uint32_t i = 0; i < ownCount; i++) values[i] = vertices_.number(row, own[i].slot);
    set.planes[2 + v] = solve(varying.mode == VaryingMode::Perspective ? Quantity::Perspective : Quantity::Linear, values);
  }
  return true;
}

namespace {

// The value at a corner: quantities over w are linear in clip space and then divided; linear ones are linear on the screen, where
// own vertex i has the weight weight[i] * w[i] / w.
double cornerValue(Quantity quantity, const double* values, const SetupVertex* own, uint32_t ownCount, const ClipVertex& corner) {
  double sum = 0;
  for (uint32_t i = 0; i < ownCount; i++)
    if (corner.weight[i] != 0) sum += corner.weight[i] * (quantity == Quantity::Linear ? own[i].clip.w * values[i] : values[i]);
  // A corner that is an own vertex has one weight, of 1: keep its value exact.
  if (quantity == Quantity::Linear)
    for (uint32_t i = 0; i < ownCount; i++)
      if (corner.weight[i] == 1) return values[i];
  return sum / corner.w;
}

}  // namespace

bool PlaneBuilder::fromOwnCorners(const SetupVertex* own, uint32_t provokingSlot, const double* x, const double* y, PlaneSet& set) {
  const double x1 = x[1] - x[0], y1 = y[1] - y[0], x2 = x[2] - x[0], y2 = y[2] - y[0];
  const double area = x1 * y2 - x2 * y1;
  if (area == 0) return false;
  // Gradients as weights of the values: shared by all quantities.
  const double inverse = 1 / area;
  const double ax = y2 * inverse, bx = -y1 * inverse, ay = -x2 * inverse, by = x1 * inverse;
  const double inverseW[3] = {1 / own[0].clip.w, 1 / own[1].clip.w, 1 / own[2].clip.w};
  return fill(3, own, provokingSlot, set, [&](Quantity quantity, const double* values) {
    double f[3] = {values[0], values[1], values[2]};
    if (quantity != Quantity::Linear)
      for (int i = 0; i < 3; i++) f[i] *= inverseW[i];
    const double f1 = f[1] - f[0], f2 = f[2] - f[0];
    Plane plane;
    plane.dx = f1 * ax + f2 * bx;
    plane.dy = f1 * ay + f2 * by;
    plane.origin = f[0] - plane.dx * x[0] - plane.dy * y[0];
    return plane;
  });
}

bool PlaneBuilder::fromCorners(const SetupVertex* own, uint32_t provokingSlot, const ScreenVertex (&c)[3], PlaneSet& set) {
  const double x1 = c[1].x - c[0].x, y1 = c[1].y - c[0].y, x2 = c[2].x - c[0].x, y2 = c[2].y - c[0].y;
  const double area = x1 * y2 - x2 * y1;
  if (area == 0) return false;
  return fill(3, own, provokingSlot, set, [&](Quantity quantity, const double* values) {
    const double f0 = cornerValue(quantity, values, own, 3, c[0].clip);
    const double f1 = cornerValue(quantity, values, own, 3, c[1].clip) - f0;
    const double f2 = cornerValue(quantity, values, own, 3, c[2].clip) - f0;
    Plane plane;
    plane.dx = (f1 * y2 - f2 * y1) / area;
    plane.dy = (f2 * x1 - f1 * x2) / area;
    plane.origin = f0 - plane.dx * c[0].x - plane.dy * c[0].y;
    return plane;
  });
}

bool PlaneBuilder::fromHomogeneous(const SetupVertex* own, uint32_t provokingSlot, double referenceX, double referenceY, PlaneSet& set) {
  // Rows relative to the reference: the products then do not cancel for small triangles far from the framebuffer's origin.
  double x[3], y[3], w[3];
  for (int i = 0; i < 3; i++) {
    const ClipVertex& v = own[i].clip;
    x[i] = v.x - referenceX * v.w;
    y[i] = v.y - referenceY * v.w;
    w[i] = v.w;
  }
  // Cofactors of the matrix whose rows are (x, y, w).
  double cx[3], cy[3], cw[3];
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    cx[i] = y[j] * w[k] - y[k] * w[j];
    cy[i] = w[j] * x[k] - w[k] * x[j];
    cw[i] = x[j] * y[k] - x[k] * y[j];
  }
  const double determinant = w[0] * cw[0] + w[1] * cw[1] + w[2] * cw[2];
  if (determinant == 0 || !std::isfinite(determinant)) return false;
  return fill(3, own, provokingSlot, set, [&](Quantity quantity, const double* values) {
    Plane plane;
    double here = 0;
    for (int i = 0; i < 3; i++) {
      const double value = quantity == Quantity::Linear ? values[i] * w[i] : values[i];
      plane.dx += value * cx[i];
      plane.dy += value * cy[i];
      here += value * cw[i];
    }
    plane.dx /= determinant;
    plane.dy /= determinant;
    plane.origin = here / determinant - plane.dx * referenceX - plane.dy * referenceY;
    return plane;
  });
}

bool PlaneBuilder::fromSegment(const SetupVertex* own, uint32_t provokingSlot, const ScreenVertex& from, const ScreenVertex& to, PlaneSet& set) {
  // t = (p - from) . (to - from) / |to - from|^2 (Vulkan specification, "Basic line segment rasterization").
  const double x = to.x - from.x, y = to.y - from.y, square = x * x + y * y;
  if (square == 0) return false;
  return fill(2, own, provokingSlot, set, [&](Quantity quantity, const double* values) {
    const double f0 = cornerValue(quantity, values, own, 2, from.clip);
    const double change = (cornerValue(quantity, values, own, 2, to.clip) - f0) / square;
    Plane plane;
    plane.dx = change * x;
    plane.dy = change * y;
    plane.origin = f0 - plane.dx * from.x - plane.dy * from.y;
    return plane;
  });
}

bool PlaneBuilder::fromPoint(const SetupVertex& own, uint32_t provokingSlot, double x, double y, double size, PlaneSet& set) {
  pointX_ = {1 / size, 0, 0.5 - x / size};
  pointY_ = {0, 1 / size, 0.5 - y / size};
  const bool done = fill(1, &own, provokingSlot, set, [&](Quantity quantity, const double* values) {
    Plane plane;
    plane.origin = quantity == Quantity::Linear ? values[0] : values[0] / own.clip.w;
    return plane;
  });
  pointX_ = pointY_ = {};
  return done;
}

void PlaneBuilder::depthRange(const ClipVertex* polygon, uint32_t count, double& low, double& high) const {
  low = std::numeric_limits<double>::infinity(), high = -low;
  for (uint32_t i = 0; i < count; i++) {
    const double z = polygon[i].z / polygon[i].w * view_->scaleZ + view_->offsetZ;
    low = std::min(low, z);
    high = std::max(high, z);
  }
}

std::optional<double> PlaneBuilder::biasUnit() const {
  const DepthUnit* unit = state_.depthBiasEnable ? depthUnit(state_.depthFormat) : nullptr;
  return unit ? std::optional(unit->unit) : std::nullopt;
}

double PlaneBuilder::depthOffset(const ClipVertex* polygon, uint32_t count, const Plane& depth) const {
  const std::optional<double> unit = biasUnit();
  if (!unit) return 0;
  double low, high;
  depthRange(polygon, count, low, high);
  const double largest = std::max(std::fabs(low), std::fabs(high));
  double r = *unit;
  if (r == 0 && largest > 0 && std::isfinite(largest)) r = std::ldexp(1.0, std::max(std::ilogb(largest), -126) - 23);
  // The specification allows max() for the slope's length, and it is what others use.
  const double slope = std::max(std::fabs(depth.dx), std::fabs(depth.dy));
  double offset = double(state_.depthBiasSlope) * slope + double(state_.depthBiasConstant) * r;
  if (state_.depthBiasClamp > 0) offset = std::min(offset, double(state_.depthBiasClamp));
  if (state_.depthBiasClamp < 0) offset = std::max(offset, double(state_.depthBiasClamp));
  return std::isfinite(offset) ? offset : 0;
}

void PlaneBuilder::finishDepth(const ClipVertex* polygon, uint32_t count, double reach, double offset, PlaneSet& set) const {
  Plane& depth = set.planes[0];
  double low, high;
  depthRange(polygon, count, low, high);
  depth.origin += offset;
  low += offset;
  high += offset;
  // The record's three floats and their sum (within a cell of kGridCell pixels, starting from a value at its corner) are each rounded.
  const double gradient = std::fabs(depth.dx) + std::fabs(depth.dy);
  const double largest = std::max(std::fabs(low), std::fabs(high)) + gradient * (kGridCell + 1);
  const double margin = gradient * reach + largest * 0x1p-21;
  low -= margin;
  high += margin;
  if (state_.depthClampEnable) {
    low = std::clamp(low, view_->lowZ, view_->highZ);
    high = std::clamp(high, view_->lowZ, view_->highZ);
  }
  set.minZ = std::nextafter(float(low), -std::numeric_limits<float>::infinity());
  set.maxZ = std::nextafter(float(high), std::numeric_limits<float>::infinity());
}

}  // namespace pumice::raster
