// Copies among buffers and images (Vulkan spec, "Copying Data Between Buffers and Images", "Copying Data Between Images").
#include <algorithm>
#include <array>
#include <vector>

#include "texture/cleared.h"
#include "texture/rows.h"

namespace pumice::texture {
namespace {

uint32_t divideUp(uint32_t x, uint32_t d) { return x / d + (x % d != 0); }

// A box of elements in one level and plane.
struct Box {
  uint32_t x = 0, y = 0, z = 0;
  uint32_t width = 0, height = 0, depth = 0;

  bool empty() const { return !width || !height || !depth; }
};

// Texels to elements, cut to the level.
Box boxOf(const ImageLayout& layout, const LevelLayout& level, VkOffset3D offset, VkExtent3D extent) {
  const FormatInfo& f = *layout.format;
  if (offset.x < 0 || offset.y < 0 || offset.z < 0) return {};
  Box b;
  b.x = uint32_t(offset.x) / f.blockWidth;
  b.y = uint32_t(offset.y) / f.blockHeight;
  b.z = uint32_t(offset.z);
  if (b.x >= level.elementsX || b.y >= level.elementsY || b.z >= level.depth) return {};
  b.width = std::min(divideUp(extent.width, f.blockWidth), level.elementsX - b.x);
  b.height = std::min(divideUp(extent.height, f.blockHeight), level.elementsY - b.y);
  b.depth = std::min(extent.depth, level.depth - b.z);
  return b;
}

struct Layers {
  uint32_t first = 0, count = 0;
};
Layers layersOf(const ImageLayout& layout, const VkImageSubresourceLayers& s) {
  if (s.baseArrayLayer >= layout.arrayLayers) return {};
  return {s.baseArrayLayer, std::min(s.layerCount, layout.arrayLayers - s.baseArrayLayer)};
}

bool isD24(const FormatInfo& f, VkImageAspectFlags aspect) { return (aspect & VK_IMAGE_ASPECT_DEPTH_BIT) && f.hasDepth() && f.rgba[0].bits == 24; }

// The upper byte of a 24-bit depth is undefined in buffers and zero in images.
void maskDepth24(std::byte* row, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i) row[i * 4 + 3] = std::byte(0);
}

// Both directions between buffers and images.
template <bool kToImage>
void copyBuffer(base::ThreadPool& pool, const BufferMemory& buffer, const ImageMemory& image, const VkBufferImageCopy& region) {
  const ImageLayout& layout = *image.layout;
  const FormatInfo& f = *layout.format;
  const VkImageSubresourceLayers& sub = region.imageSubresource;
  if (sub.mipLevel >= layout.mipLevels) return;
  const PlaneLayout& plane = layout.plane(sub.aspectMask);
  const LevelLayout& level = plane.levels[sub.mipLevel];
  const Box box = boxOf(layout, level, region.imageOffset, region.imageExtent);
  const Layers layers = layersOf(layout, sub);
  if (box.empty() || !layers.count) return;

  const uint64_t bytes = plane.elementBytes;
  const uint64_t pitch = divideUp(region.bufferRowLength ? region.bufferRowLength : region.imageExtent.width, f.blockWidth) * bytes;
  const uint64_t slicePitch = pitch * divideUp(region.bufferImageHeight ? region.bufferImageHeight : region.imageExtent.height, f.blockHeight);
  const bool mask = isD24(f, plane.aspect);
  const uint32_t slices = layers.count * box.depth;

  // In groups of up to four rows, those of a row of blocks, so that a block is touched once and by one thread.
  const uint32_t firstGroup = box.y / 4, groups = (box.y + box.height + 3) / 4 - firstGroup;
  const Store store = storeFor(uint64_t(slices) * box.height * box.width * bytes);
  parallelRanges(pool, slices * groups, box.width * bytes * 4, [&](uint32_t begin, uint32_t end) {
    std::vector<std::byte> masked;
    for (uint32_t i = begin; i < end; ++i) {
      const uint32_t slice = i / groups, group = firstGroup + i % groups;
      const uint32_t layer = slice / box.depth, z = slice % box.depth;
      const uint32_t y0 = std::max(box.y, 4 * group), y1 = std::min(box.y + box.height, 4 * group + 4);
      const Slice s = sliceOf(image, plane, sub.mipLevel, layers.first + layer, 0, box.z + z);
      const uint64_t at = region.bufferOffset + (uint64_t(layer) * region.imageExtent.depth + z) * slicePitch + (y0 - box.y) * pitch;
      if (y1 - y0 == 4 && !mask && at + 3 * pitch + box.width * bytes <= buffer.size) {
        if constexpr (kToImage) writeFourRows(s, box.x, y0, box.width, buffer.base + at, pitch, store);
        else readFourRows(s, box.x, y0, box.width, buffer.base + at, pitch, store);
        continue;
      }
      for (uint32_t y = y0; y < y1; ++y) {
        const uint64_t from = at + (y - y0) * pitch;
        if (from >= buffer.size) break;
        const uint32_t count = uint32_t(std::min<uint64_t>(box.width, (buffer.size - from) / bytes));
        std::byte* packed = buffer.base + from;
        if constexpr (!kToImage) {
          readRow(s, box.x, y, count, packed);
        } else if (mask) {
          masked.assign(packed, packed + count * bytes);
          maskDepth24(masked.data(), count);
          writeRow(s, box.x, y, count, masked.data());
        } else {
          writeRow(s, box.x, y, count, packed);
        }
      }
    }
  });
}

// Whole blocks on both sides: the part of the box that is no whole block is cut off by the level's edge on both sides, where
// the padding of the last blocks may be copied with the rest.
bool wholeBlocks(const Slice& s, const Box& from, const Slice& d, const Box& to) {
  auto fits = [](uint32_t begin, uint32_t size, uint32_t limit) { return begin % 4 == 0 && (size % 4 == 0 || begin + size == limit); };
  return s.tiled && d.tiled && fits(from.x, from.width, s.level->elementsX) && fits(to.x, to.width, d.level->elementsX) &&
         fits(from.y, from.height, s.level->elementsY) && fits(to.y, to.height, d.level->elementsY);
}

void copySlice(base::ThreadPool& pool, const Slice& s, const Box& from, const Slice& d, const Box& to) {
  const uint64_t bytes = s.elementBytes;
  const Store store = storeFor(bytes * from.width * from.height);
  if (wholeBlocks(s, from, d, to)) {
    const uint64_t run = uint64_t(divideUp(from.width, 4)) * 16 * bytes;
    parallelRanges(pool, divideUp(from.height, 4), run, [&](uint32_t begin, uint32_t end) {
      for (uint32_t i = begin; i < end; ++i)
        copyBytes(d.row(to.y + 4 * i) + uint64_t(to.x) * 4 * bytes, s.row(from.y + 4 * i) + uint64_t(from.x) * 4 * bytes, run, store);
    });
    return;
  }
  const uint64_t width = from.width * bytes;
  auto place = [bytes](const Slice& slice, const Box& box, uint32_t y) { return slice.row(box.y + y) + box.x * bytes; };
  if (!s.tiled && !d.tiled) {
    parallelRanges(pool, from.height, width, [&](uint32_t begin, uint32_t end) {
      for (uint32_t y = begin; y < end; ++y) copyBytes(place(d, to, y), place(s, from, y), width, store);
    });
    return;
  }
  // Ranges of whole groups of four rows, so that no two threads write to one line.
  parallelRanges(pool, divideUp(from.height, 4), from.width * bytes * 4, [&](uint32_t begin, uint32_t end) {
    std::vector<std::byte> row(s.tiled && d.tiled ? width : 0);
    for (uint32_t y = 4 * begin; y < std::min(4 * end, from.height);) {
      const bool four = y + 4 <= from.height;
      if (!d.tiled && four && (from.y + y) % 4 == 0) {
        readFourRows(s, from.x, from.y + y, from.width, place(d, to, y), d.level->rowPitch);
        y += 4;
      } else if (!s.tiled && four && (to.y + y) % 4 == 0) {
        writeFourRows(d, to.x, to.y + y, from.width, place(s, from, y), s.level->rowPitch);
        y += 4;
      } else if (!d.tiled) {
        readRow(s, from.x, from.y + y, from.width, place(d, to, y));
        ++y;
      } else if (!s.tiled) {
        writeRow(d, to.x, to.y + y, from.width, place(s, from, y));
        ++y;
      } else {
        readRow(s, from.x, from.y + y, from.width, row.data());
        writeRow(d, to.x, to.y + y, from.width, row.data());
        ++y;
      }
    }
  });
}

}  // namespace

void copyBufferToImage(base::ThreadPool& pool, const BufferMemory& src, const ImageMemory& dst, const VkBufferImageCopy& region) {
  writeCleared(dst);
  copyBuffer<true>(pool, src, dst, region);
}

void copyImageToBuffer(base::ThreadPool& pool, const ImageMemory& src, const BufferMemory& dst, const VkBufferImageCopy& region) {
  writeCleared(src);
  copyBuffer<false>(pool, dst, src, region);
}

void copyImage(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const VkImageCopy& region) {
  writeCleared(src);
  writeCleared(dst);
  const ImageLayout &from = *src.layout, &to = *dst.layout;
  const VkImageSubresourceLayers &ss = region.srcSubresource, &ds = region.dstSubresource;
  if (ss.mipLevel >= from.mipLevels || ds.mipLevel >= to.mipLevels) return;
  const Layers sourceLayers = layersOf(from, ss), targetLayers = layersOf(to, ds);

  constexpr VkImageAspectFlags kAspects[] = {VK_IMAGE_ASPECT_COLOR_BIT,   VK_IMAGE_ASPECT_DEPTH_BIT,   VK_IMAGE_ASPECT_STENCIL_BIT,
                                             VK_IMAGE_ASPECT_PLANE_0_BIT, VK_IMAGE_ASPECT_PLANE_1_BIT, VK_IMAGE_ASPECT_PLANE_2_BIT};
  for (VkImageAspectFlags aspect : kAspects) {
    if (!(ss.aspectMask & aspect)) continue;
    const PlaneLayout& sp = from.plane(aspect);
    const PlaneLayout& dp = to.plane(ds.aspectMask & aspect ? aspect : ds.aspectMask);
    if (sp.elementBytes != dp.elementBytes) continue;
    const LevelLayout &sl = sp.levels[ss.mipLevel], &dl = dp.levels[ds.mipLevel];
    // Elements correspond one to one, also between compressed and plain formats: the extent counts the source's texels.
    VkExtent3D extent = region.extent;
    const uint32_t layers = std::max(sourceLayers.count, targetLayers.count);
    // Layers of one side may be depth slices of the other.
    const bool sourceSlices = from.type == VK_IMAGE_TYPE_3D, targetSlices = to.type == VK_IMAGE_TYPE_3D;
    const uint32_t count = sourceSlices || targetSlices ? std::max(extent.depth, layers) : layers;
    VkExtent3D sourceExtent{extent.width, extent.height, 1};
    Box a = boxOf(from, sl, {region.srcOffset.x, region.srcOffset.y, 0}, sourceExtent);
    VkExtent3D targetExtent{a.width * to.format->blockWidth, a.height * to.format->blockHeight, 1};
    Box b = boxOf(to, dl, {region.dstOffset.x, region.dstOffset.y, 0}, targetExtent);
    if (a.empty() || b.empty()) continue;
    a.width = b.width;
    a.height = b.height;
    for (uint32_t i = 0; i < count; ++i) {
      uint32_t sz = sourceSlices ? uint32_t(region.srcOffset.z) + i : 0, dz = targetSlices ? uint32_t(region.dstOffset.z) + i : 0;
      uint32_t sourceLayer = sourceLayers.first + (sourceSlices ? 0 : i), targetLayer = targetLayers.first + (targetSlices ? 0 : i);
      if (sz >= sl.depth || dz >= dl.depth || sourceLayer >= from.arrayLayers || targetLayer >= to.arrayLayers) break;
      for (uint32_t sample = 0; sample < std::min(from.samples, to.samples); ++sample)
        copySlice(pool, sliceOf(src, sp, ss.mipLevel, sourceLayer, sample, sz), a, sliceOf(dst, dp, ds.mipLevel, targetLayer, sample, dz), b);
    }
  }
}

}  // namespace pumice::texture
