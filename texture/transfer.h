// Copies, clears, blits and resolves between buffers and images, on plain memory. Regions are valid (the
// application's duty); sizes are clamped so that nothing is touched outside the given memory.
#pragma once

#include <cstddef>
#include <span>

#include "base/threads.h"
#include "texture/layout.h"

namespace pumice::texture {

struct ClearedTiles;
struct ImageMemory {
  const ImageLayout* layout = nullptr;
  std::byte* base = nullptr;
  ClearedTiles* cleared = nullptr;   //!< of images that may have such (cleared.h). Transfers write them first
};
struct BufferMemory {
  std::byte* base = nullptr;
  uint64_t size = 0;
};

//! A multiple of four bytes.
void fillBuffer(base::ThreadPool& pool, const BufferMemory& buffer, uint32_t word);
//! Of `size` bytes those that are in both; they do not overlap.
void copyBuffer(base::ThreadPool& pool, const BufferMemory& src, const BufferMemory& dst, uint64_t size);
void copyBufferToImage(base::ThreadPool& pool, const BufferMemory& src, const ImageMemory& dst, const VkBufferImageCopy& region);
void copyImageToBuffer(base::ThreadPool& pool, const ImageMemory& src, const BufferMemory& dst, const VkBufferImageCopy& region);
void copyImage(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const VkImageCopy& region);
//! Colour clear: the value is packed by the IR builder for the format (view format = image format).
void clearColor(base::ThreadPool& pool, const ImageMemory& image, const VkClearColorValue& value, const VkImageSubresourceRange& range);
void clearDepthStencil(base::ThreadPool& pool, const ImageMemory& image, const VkClearDepthStencilValue& value, const VkImageSubresourceRange& range);
//! One element's bits of a clear value in format f (elementBytes of f are written; depth or stencil plane by aspect).
void packClearValue(const FormatInfo& f, VkImageAspectFlags aspect, const VkClearValue& value, std::byte out[32]);
//! Fills a rectangle of one level, layer and plane, the first `samples` samples, with one element's bits (x, y, w, h in elements).
void fillRect(const ImageMemory& image, VkImageAspectFlags aspect, uint32_t level, uint32_t layer, uint32_t z, VkRect2D rect, const std::byte* element,
              uint32_t samples = ~0u);
//! Scaling and format-converting blit through lane IR (unpack, filter, pack); routines are cached by format pair and filter.
void blitImage(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const VkImageBlit& region, VkFilter filter);
//! Multisample colour resolve: average, integer formats sample 0.
void resolveImage(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const VkImageResolve& region);
//! The same block by block, for a pass that knows of which blocks the samples agree. The region's offsets are equal.
class BlockResolve {
 public:
  BlockResolve(const ImageMemory& src, const ImageMemory& dst, const VkImageResolve& region);
  struct Block { uint16_t x, y; };   //!< its first pixel: multiples of 4
  //! Those pixels of 4x4 blocks that the region has. `layer` from its first on. `agreeing`: only the first sample is looked at, which
  //! the others equal; the bits are those of the average. Safe from several threads for different blocks.
  void blocks(uint32_t layer, std::span<const Block> blocks, bool agreeing) const;

 private:
  ImageMemory src_, dst_;
  VkImageResolve region_;
  VkRect2D target_{};
  bool copies_ = false;   //!< blocks of equal samples may be copied
};
//! The same for one aspect of a depth/stencil image, by any mode of the spec.
void resolveDepthStencil(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, VkImageAspectFlagBits aspect, VkResolveModeFlagBits mode,
                         const VkImageResolve& region);
//! Converts tiled pixels of level 0, layer 0 to rows of `pitch` bytes of B8G8R8A8 for presentation.
void presentRows(base::ThreadPool& pool, const ImageMemory& src, std::byte* rows, uint64_t pitch, VkExtent2D extent);

}  // namespace pumice::texture
