#include "texture/layout.h"

#include <algorithm>
#include <array>
#include <limits>

#include "texture/descriptor.h"

namespace pumice::texture {
namespace {

constexpr uint64_t kTooLarge = uint64_t(1) << 62;
constexpr uint64_t kAlignment = 64;
// Rows of linear images: no more than a word, so that 32-bit formats are tight (applications expect it).
constexpr uint64_t kLinearRowAlignment = 4;
constexpr uint64_t kRowAlignment = 16;
constexpr uint64_t kAliasing = 1024;
constexpr uint64_t kLargestPadded = 65536;  // a slice of 16384 rows of 16384 texels of 16 bytes must stay within 4 GiB

// Sizes saturate, so that one check at the end finds every overflow.
uint64_t add(uint64_t a, uint64_t b) {
  uint64_t r;
  return __builtin_add_overflow(a, b, &r) ? std::numeric_limits<uint64_t>::max() : r;
}
uint64_t mul(uint64_t a, uint64_t b) {
  uint64_t r;
  return __builtin_mul_overflow(a, b, &r) ? std::numeric_limits<uint64_t>::max() : r;
}
uint64_t alignUp(uint64_t x, uint64_t alignment) { return add(x, alignment - 1) & ~(alignment - 1); }
uint32_t divideUp(uint32_t x, uint32_t d) { return x / d + (x % d != 0); }

// Fills one plane and returns the offset behind it.
uint64_t layPlane(const ImageLayout& image, bool linear, PlaneLayout& plane, uint64_t offset, VkImageAspectFlags aspect, uint32_t elementBytes,
                  std::array<uint8_t, 2> shift = {}) {
  plane.offset = offset;
  plane.aspect = aspect;
  plane.elementBytes = elementBytes;
  uint64_t at = 0;
  for (uint32_t i = 0; i < image.mipLevels; ++i) {
    LevelLayout& level = plane.levels[i];
    // Chroma planes of odd sizes round up.
    level.width = divideUp(std::max(image.extent.width >> i, 1u), 1u << shift[0]);
    level.height = divideUp(std::max(image.extent.height >> i, 1u), 1u << shift[1]);
    level.depth = std::max(image.extent.depth >> i, 1u);
    level.elementsX = divideUp(level.width, image.format->blockWidth);
    level.elementsY = divideUp(level.height, image.format->blockHeight);
    level.offset = at;
    if (image.tiled) {
      level.rowPitch = mul(divideUp(level.elementsX, kBlockEdge), kBlockEdge * kBlockEdge * elementBytes);
      level.slicePitch = mul(level.rowPitch, divideUp(level.elementsY, kBlockEdge));
    } else {
      level.rowPitch = alignUp(mul(level.elementsX, elementBytes), linear ? kLinearRowAlignment : kRowAlignment);
      // Rows at a large power of two would all fall into the same few cache sets.
      if (!linear && level.rowPitch % kAliasing == 0 && level.rowPitch <= kLargestPadded) level.rowPitch = add(level.rowPitch, kAlignment);
      level.slicePitch = mul(level.rowPitch, level.elementsY);
    }
    at = alignUp(add(at, mul(level.slicePitch, level.depth)), kAlignment);
  }
  plane.layerPitch = at;
  plane.samplePitch = mul(at, image.arrayLayers);
  return add(offset, mul(plane.samplePitch, image.samples));
}

}  // namespace

ImageLayout imageLayout(const VkImageCreateInfo& info) {
  ImageLayout image;
  image.format = formatInfo(info.format);
  image.type = info.imageType;
  // Attachments are drawn to in blocks; what is only sampled, copied or stored to is better off in rows (layout.h).
  constexpr VkImageUsageFlags kAttachment = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT;
  image.tiled = info.tiling == VK_IMAGE_TILING_OPTIMAL && (info.usage & kAttachment);
  const bool linear = info.tiling != VK_IMAGE_TILING_OPTIMAL;
  image.extent = info.extent;
  image.mipLevels = info.mipLevels;
  image.arrayLayers = info.arrayLayers;
  image.samples = info.samples;
  if (!image.format || info.mipLevels == 0 || info.mipLevels > kMaxLevels || info.arrayLayers == 0 || info.samples == 0) return image;
  if (info.extent.width == 0 || info.extent.height == 0 || info.extent.depth == 0) return image;

  const FormatInfo& f = *image.format;
  uint64_t end;
  if (f.isDepthStencil()) {
    bool combined = f.hasDepth() && f.hasStencil();
    image.planeCount = combined ? 2 : 1;
    end = layPlane(image, linear, image.planes[0], 0, f.hasDepth() ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_STENCIL_BIT, f.elementBytes);
    if (combined) end = layPlane(image, linear, image.planes[1], end, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
  } else if (f.isMultiPlanar()) {
    image.planeCount = f.planeCount;
    end = 0;
    for (uint32_t p = 0; p < f.planeCount; ++p)
      end = layPlane(image, linear, image.planes[p], end, VK_IMAGE_ASPECT_PLANE_0_BIT << p, formatInfo(f.planeFormats[p])->elementBytes,
                     p ? std::array{f.chromaShift[0], f.chromaShift[1]} : std::array<uint8_t, 2>{});
  } else {
    end = layPlane(image, linear, image.planes[0], 0, VK_IMAGE_ASPECT_COLOR_BIT, f.elementBytes);
  }
  image.size = end <= kTooLarge ? end : 0;
  return image;
}

VkSubresourceLayout subresourceLayout(const ImageLayout& layout, const VkImageSubresource& subresource) {
  const PlaneLayout& plane = layout.plane(subresource.aspectMask);
  const LevelLayout& level = plane.levels[std::min(subresource.mipLevel, kMaxLevels - 1)];
  VkSubresourceLayout out{};
  out.offset = plane.offset + subresource.arrayLayer * plane.layerPitch + level.offset;
  out.rowPitch = level.rowPitch;
  out.arrayPitch = plane.layerPitch;
  out.depthPitch = level.slicePitch;
  out.size = level.slicePitch * level.depth;
  return out;
}

uint32_t descriptorStride(VkDescriptorType type) {
  // Image descriptors are rounded up to whole cache lines, like the first half of a combined one.
  constexpr uint32_t kImage = offsetof(CombinedDescriptor, sampler);
  switch (type) {
    case VK_DESCRIPTOR_TYPE_SAMPLER: return sizeof(SamplerDescriptor);
    case VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER: return sizeof(CombinedDescriptor);
    case VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE:
    case VK_DESCRIPTOR_TYPE_STORAGE_IMAGE:
    case VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT: return kImage;
    case VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER:
    case VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER:
    case VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER:
    case VK_DESCRIPTOR_TYPE_STORAGE_BUFFER:
    case VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC:
    case VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC: return sizeof(BufferDescriptor);
    case VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK: return 1;
    default: return 0;
  }
}

}  // namespace pumice::texture
