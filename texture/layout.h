// Where every texel of an image lies in memory. A pure function of VkImageCreateInfo, never of history.
//
// Optimally tiled images that may be attachments are stored in blocks of 4x4x1 *elements* (texels or compressed blocks), an
// element's place inside its block being quad-major:
//     index = (y>>1 & 1) * 8 + (x>>1 & 1) * 4 + (y & 1) * 2 + (x & 1)
// so that 16 pixels of a 32-bit format are one 64-byte line and a quad's four pixels are adjacent. Blocks run in
// rows over the whole level. All other images, optimally tiled or linear, are plain rows: addresses cost less, copies are moves of
// memory, and neighbours in a row are written at once. Depth, stencil and each sample are separate planes, and so are those of multi-planar formats. The order is plane, layer, level: all levels of one layer and plane are together.
#pragma once

#include <cstdint>
#include <vector>

#include "texture/format.h"

namespace pumice::texture {

constexpr uint32_t kMaxLevels = 15;      //!< 16384
constexpr uint32_t kBlockEdge = 4;       //!< elements

//! Place of one element inside its 4x4 block.
constexpr uint32_t blockIndex(uint32_t x, uint32_t y) {
  return (y >> 1 & 1) * 8 + (x >> 1 & 1) * 4 + (y & 1) * 2 + (x & 1);
}

//! One mip level of one plane. All sizes in elements (compressed: blocks) or bytes. Read by generated code too
//! (texture/descriptor.h), so the layout is fixed.
struct LevelLayout {
  uint64_t offset = 0;       //!< bytes from the start of the plane's layer
  uint64_t slicePitch = 0;   //!< bytes from one depth slice to the next
  uint64_t rowPitch = 0;     //!< bytes from one row of blocks (tiled: 4 rows of elements) or row (linear) to the next
  uint32_t width = 0, height = 0, depth = 0;   //!< in texels
  uint32_t elementsX = 0, elementsY = 0;       //!< in elements
  uint32_t padding = 0;
};
static_assert(sizeof(LevelLayout) == 48);

struct PlaneLayout {
  uint64_t offset = 0;        //!< bytes from the start of the image (of a disjoint image: from its first plane's memory, modulo 2^64)
  uint64_t samplePitch = 0;   //!< bytes from one sample to the next (the plane repeats per sample)
  uint64_t layerPitch = 0;    //!< bytes from one array layer to the next
  uint32_t elementBytes = 0;
  VkImageAspectFlags aspect = 0;
  LevelLayout levels[kMaxLevels];
};

struct ImageLayout {
  const FormatInfo* format = nullptr;
  VkImageType type = VK_IMAGE_TYPE_2D;
  bool tiled = true;          //!< 4x4 blocks; else rows
  VkExtent3D extent{};
  uint32_t mipLevels = 1, arrayLayers = 1, samples = 1;
  uint32_t planeCount = 1;    //!< 1 (colour, depth only, stencil only), 2 (depth, stencil), 2 or 3 (multi-planar)
  PlaneLayout planes[3];
  uint64_t size = 0;
  uint64_t alignment = 64;

  const PlaneLayout& plane(VkImageAspectFlags aspect) const {
    if (format && format->isMultiPlanar()) return planes[aspect & VK_IMAGE_ASPECT_PLANE_2_BIT && planeCount > 2 ? 2 : aspect & VK_IMAGE_ASPECT_PLANE_1_BIT ? 1 : 0];
    return planes[planeCount == 2 && (aspect & VK_IMAGE_ASPECT_STENCIL_BIT) && !(aspect & VK_IMAGE_ASPECT_DEPTH_BIT) ? 1 : 0];
  }
  //! Byte offset of element (x, y, z) of a plane. Coordinates in elements, in range.
  uint64_t elementOffset(const PlaneLayout& p, uint32_t level, uint32_t layer, uint32_t sample, uint32_t x, uint32_t y, uint32_t z) const {
    const LevelLayout& l = p.levels[level];
    uint64_t base = p.offset + sample * p.samplePitch + layer * p.layerPitch + l.offset + z * l.slicePitch;
    if (!tiled) return base + y * l.rowPitch + uint64_t(x) * p.elementBytes;
    return base + (y >> 2) * l.rowPitch + (uint64_t(x >> 2) * 16 + blockIndex(x, y)) * p.elementBytes;
  }
};

//! Fails (size 0) where the size overflows 2^62; the caller checks limits of extent and counts.
ImageLayout imageLayout(const VkImageCreateInfo& info);
//! vkGetImageSubresourceLayout (linear tiling).
VkSubresourceLayout subresourceLayout(const ImageLayout& layout, const VkImageSubresource& subresource);

}  // namespace pumice::texture
