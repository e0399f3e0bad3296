// Homogeneous clipping in double, in framebuffer coordinates: a vertex is (X, Y, z, w) where X / w and Y / w are
// framebuffer pixels and z / w is the normalised device depth.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "raster/primitive.h"

namespace pumice::raster {

//! Coordinates that reach setup are within +-kGuardBand pixels. Far beyond any framebuffer (16384), so that few triangles are cut and
//! those that are keep their direction: a snap of 1/512 pixel out there turns an edge by 2^-29. Proof that edges fit: coverage.cpp.
constexpr int64_t kGuardBand = int64_t(1) << 20;

//! From clip space to framebuffer, in double: products of two floats are exact there.
struct ViewTransform {
  double scaleX, scaleY, scaleZ, offsetX, offsetY, offsetZ;
  double lowZ, highZ;   //!< depth range, ordered
  explicit ViewTransform(const VkViewport& v)
      : scaleX(double(v.width) / 2), scaleY(double(v.height) / 2), scaleZ(double(v.maxDepth) - double(v.minDepth)),
        offsetX(double(v.x) + double(v.width) / 2), offsetY(double(v.y) + double(v.height) / 2), offsetZ(double(v.minDepth)),
        lowZ(double(v.minDepth < v.maxDepth ? v.minDepth : v.maxDepth)), highZ(double(v.minDepth < v.maxDepth ? v.maxDepth : v.minDepth)) {}
};

struct ClipVertex {
  double x, y, z, w;
  double weight[3];  //!< how it is made of the primitive's own vertices (their clip-space positions)

  double screenX() const { return x / w; }
  double screenY() const { return y / w; }
};

//! Planes that cut, in this order. From kClipUser on: the clip distances.
enum ClipPlane : uint32_t { kClipW, kClipNear, kClipFar, kClipLeft, kClipRight, kClipTop, kClipBottom, kClipUser, kClipPlanes = kClipUser + kMaxClipDistances };
constexpr uint32_t kDepthPlanes = 1u << kClipNear | 1u << kClipFar;
constexpr uint32_t kSidePlanes = 1u << kClipLeft | 1u << kClipRight | 1u << kClipTop | 1u << kClipBottom;
constexpr uint32_t kMaxClipVertices = 3 + kClipPlanes;

//! A convex region to clip against: sides in pixels.
struct ClipVolume {
  uint32_t planes = 1u << kClipW | kSidePlanes;  //!< bit per ClipPlane
  double left, top, right, bottom;
  double user[kMaxClipDistances][3] = {};   //!< clip distances at the primitive's own vertices
};

//! w must be positive; the bound is below every positive float, so that no vertex of the application is lost.
constexpr double kSmallestW = 0x1p-150;

//! Signed distance: inside where >= 0. Linear in the vertex.
inline double clipDistance(const ClipVolume& volume, uint32_t plane, const ClipVertex& v) {
  switch (plane) {
    case kClipW: return v.w - kSmallestW;
    case kClipNear: return v.z;
    case kClipFar: return v.w - v.z;
    case kClipLeft: return v.x - volume.left * v.w;
    case kClipRight: return volume.right * v.w - v.x;
    case kClipTop: return v.y - volume.top * v.w;
    case kClipBottom: return volume.bottom * v.w - v.y;
    default: {
      const double(&d)[3] = volume.user[plane - kClipUser];
      return v.weight[0] * d[0] + v.weight[1] * d[1] + v.weight[2] * d[2];
    }
  }
}

//! Bits of the volume's planes that the vertex is outside of.
inline uint32_t outcode(const ClipVolume& volume, const ClipVertex& v) {
  uint32_t code = 0;
  for (uint32_t set = volume.planes; set; set &= set - 1) {
    const uint32_t plane = uint32_t(std::countr_zero(set));
    code |= uint32_t(clipDistance(volume, plane, v) < 0) << plane;
  }
  return code;
}

//! Where the edge from an inside to an outside vertex meets the plane. Always walked from inside to outside, so that both primitives
//! at an edge compute the same bits.
ClipVertex clipEdge(const ClipVolume& volume, uint32_t plane, const ClipVertex& inside, const ClipVertex& outside);

//! Clips a convex polygon (count vertices in `polygon`, room for kMaxClipVertices) by the planes of `cutting`. Returns the new count,
//! below 3 when nothing is left.
uint32_t clipPolygon(const ClipVolume& volume, uint32_t cutting, ClipVertex* polygon, uint32_t count);

//! Clips a segment; false when nothing is left.
bool clipSegment(const ClipVolume& volume, uint32_t cutting, ClipVertex& from, ClipVertex& to);

//! Pixels to 1/256 pixels, ties to even. |pixels| < 2^40.
inline int64_t snap(double pixels) {
  // Adding 1.5 * 2^52 leaves no fraction bits: the addition itself rounds to nearest even.
  constexpr double kMagic = 6755399441055744.0;
  return std::bit_cast<int64_t>(pixels * kSubpixelOne + kMagic) - std::bit_cast<int64_t>(kMagic);
}

}  // namespace pumice::raster
