// Copies, clears, blits and resolves. The first form of each command and its second (VkCopyBufferInfo2, ...) share one
// recording; regions are copied into the command buffer.
#include <algorithm>
#include <cstring>

#include "entrypoints.h"
#include "icd/command_buffer.h"

namespace pumice::icd {
namespace {

// The second forms' regions are the first forms' behind sType and pNext.
template <typename Region, typename Region2>
std::span<const Region> firstForm(VkCommandBuffer buffer, const Region2* regions, uint32_t count) {
  CommandBuffer& cb = *from(buffer);
  auto* out = static_cast<Region*>(cb.arena.allocBytes(count * sizeof(Region), alignof(Region)));
  if (!out) {
    cb.outOfMemory = true;
    return {};
  }
  for (uint32_t i = 0; i < count; i++) {
    constexpr size_t kHead = sizeof(VkBaseInStructure);
    std::memcpy(static_cast<void*>(&out[i]), reinterpret_cast<const std::byte*>(&regions[i]) + kHead, sizeof(Region));
  }
  return {out, count};
}
static_assert(offsetof(VkBufferCopy2, srcOffset) == 16 && offsetof(VkBufferCopy2, size) - 16 == offsetof(VkBufferCopy, size));
static_assert(offsetof(VkImageCopy2, srcSubresource) == 16 && offsetof(VkImageCopy2, extent) - 16 == offsetof(VkImageCopy, extent));
static_assert(offsetof(VkBufferImageCopy2, bufferOffset) == 16 && offsetof(VkBufferImageCopy2, imageExtent) - 16 == offsetof(VkBufferImageCopy, imageExtent));
static_assert(offsetof(VkImageBlit2, srcSubresource) == 16 && offsetof(VkImageBlit2, dstOffsets) - 16 == offsetof(VkImageBlit, dstOffsets));
static_assert(offsetof(VkImageResolve2, srcSubresource) == 16 && offsetof(VkImageResolve2, extent) - 16 == offsetof(VkImageResolve, extent));

//! Records body(pool, region) for each region.
template <typename Region, typename Body>
void forRegions(VkCommandBuffer buffer, const Region* regions, uint32_t count, Body&& body) {
  CommandBuffer& cb = *from(buffer);
  auto kept = cb.keep(regions, count);
  cb.record([kept, body = std::forward<Body>(body)](Execution& e) {
    for (const Region& region : kept) body(e.pool, region);
  });
}

bool bound(const texture::ImageMemory& a) { return a.layout; }

}  // namespace

VKAPI_ATTR void VKAPI_CALL vkCmdCopyBuffer(VkCommandBuffer b, VkBuffer src, VkBuffer dst, uint32_t count, const VkBufferCopy* regions) {
  forRegions(b, regions, count, [s = from(src), d = from(dst)](base::ThreadPool& pool, const VkBufferCopy& r) {
    texture::copyBuffer(pool, s->range(r.srcOffset), d->range(r.dstOffset), r.size);
  });
}
VKAPI_ATTR void VKAPI_CALL vkCmdCopyBuffer2(VkCommandBuffer b, const VkCopyBufferInfo2* i) {
  auto regions = firstForm<VkBufferCopy>(b, i->pRegions, i->regionCount);
  vkCmdCopyBuffer(b, i->srcBuffer, i->dstBuffer, uint32_t(regions.size()), regions.data());
}

VKAPI_ATTR void VKAPI_CALL vkCmdCopyImage(VkCommandBuffer b, VkImage src, VkImageLayout, VkImage dst, VkImageLayout, uint32_t count, const VkImageCopy* regions) {
  forRegions(b, regions, count, [s = from(src), d = from(dst)](base::ThreadPool& pool, const VkImageCopy& r) {
    if (bound(s->memory()) && bound(d->memory())) texture::copyImage(pool, s->memory(), d->memory(), r);
  });
}
VKAPI_ATTR void VKAPI_CALL vkCmdCopyImage2(VkCommandBuffer b, const VkCopyImageInfo2* i) {
  auto regions = firstForm<VkImageCopy>(b, i->pRegions, i->regionCount);
  vkCmdCopyImage(b, i->srcImage, i->srcImageLayout, i->dstImage, i->dstImageLayout, uint32_t(regions.size()), regions.data());
}

VKAPI_ATTR void VKAPI_CALL vkCmdCopyBufferToImage(VkCommandBuffer b, VkBuffer src, VkImage dst, VkImageLayout, uint32_t count, const VkBufferImageCopy* regions) {
  forRegions(b, regions, count, [s = from(src), d = from(dst)](base::ThreadPool& pool, const VkBufferImageCopy& r) {
    if (bound(d->memory())) texture::copyBufferToImage(pool, s->range(0), d->memory(), r);
  });
}
VKAPI_ATTR void VKAPI_CALL vkCmdCopyBufferToImage2(VkCommandBuffer b, const VkCopyBufferToImageInfo2* i) {
  auto regions = firstForm<VkBufferImageCopy>(b, i->pRegions, i->regionCount);
  vkCmdCopyBufferToImage(b, i->srcBuffer, i->dstImage, i->dstImageLayout, uint32_t(regions.size()), regions.data());
}

VKAPI_ATTR void VKAPI_CALL vkCmdCopyImageToBuffer(VkCommandBuffer b, VkImage src, VkImageLayout, VkBuffer dst, uint32_t count, const VkBufferImageCopy* regions) {
  forRegions(b, regions, count, [s = from(src), d = from(dst)](base::ThreadPool& pool, const VkBufferImageCopy& r) {
    if (bound(s->memory())) texture::copyImageToBuffer(pool, s->memory(), d->range(0), r);
  });
}
VKAPI_ATTR void VKAPI_CALL vkCmdCopyImageToBuffer2(VkCommandBuffer b, const VkCopyImageToBufferInfo2* i) {
  auto regions = firstForm<VkBufferImageCopy>(b, i->pRegions, i->regionCount);
  vkCmdCopyImageToBuffer(b, i->srcImage, i->srcImageLayout, i->dstBuffer, uint32_t(regions.size()), regions.data());
}

VKAPI_ATTR void VKAPI_CALL vkCmdBlitImage(VkCommandBuffer b, VkImage src, VkImageLayout, VkImage dst, VkImageLayout, uint32_t count, const VkImageBlit* regions, VkFilter filter) {
  forRegions(b, regions, count, [s = from(src), d = from(dst), filter](base::ThreadPool& pool, const VkImageBlit& r) {
    if (bound(s->memory()) && bound(d->memory())) texture::blitImage(pool, s->memory(), d->memory(), r, filter);
  });
}
VKAPI_ATTR void VKAPI_CALL vkCmdBlitImage2(VkCommandBuffer b, const VkBlitImageInfo2* i) {
  auto regions = firstForm<VkImageBlit>(b, i->pRegions, i->regionCount);
  vkCmdBlitImage(b, i->srcImage, i->srcImageLayout, i->dstImage, i->dstImageLayout, uint32_t(regions.size()), regions.data(), i->filter);
}

VKAPI_ATTR void VKAPI_CALL vkCmdResolveImage(VkCommandBuffer b, VkImage src, VkImageLayout, VkImage dst, VkImageLayout, uint32_t count, const VkImageResolve* regions) {
  forRegions(b, regions, count, [s = from(src), d = from(dst)](base::ThreadPool& pool, const VkImageResolve& r) {
    if (bound(s->memory()) && bound(d->memory())) texture::resolveImage(pool, s->memory(), d->memory(), r);
  });
}
VKAPI_ATTR void VKAPI_CALL vkCmdResolveImage2(VkCommandBuffer b, const VkResolveImageInfo2* i) {
  auto regions = firstForm<VkImageResolve>(b, i->pRegions, i->regionCount);
  vkCmdResolveImage(b, i->srcImage, i->srcImageLayout, i->dstImage, i->dstImageLayout, uint32_t(regions.size()), regions.data());
}

VKAPI_ATTR void VKAPI_CALL vkCmdUpdateBuffer(VkCommandBuffer buffer, VkBuffer dst, VkDeviceSize offset, VkDeviceSize size, const void* data) {
  CommandBuffer& cb = *from(buffer);
  auto kept = cb.keep(static_cast<const std::byte*>(data), uint32_t(size));
  cb.record([kept, out = from(dst)->range(offset, size)](Execution&) {
    if (out.size) std::memcpy(out.base, kept.data(), std::min<uint64_t>(kept.size(), out.size));
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdFillBuffer(VkCommandBuffer buffer, VkBuffer dst, VkDeviceSize offset, VkDeviceSize size, uint32_t value) {
  from(buffer)->record([out = from(dst)->range(offset, size), value](Execution& e) { texture::fillBuffer(e.pool, out, value); });
}

VKAPI_ATTR void VKAPI_CALL vkCmdClearColorImage(VkCommandBuffer b, VkImage image, VkImageLayout, const VkClearColorValue* value, uint32_t count, const VkImageSubresourceRange* ranges) {
  forRegions(b, ranges, count, [i = from(image), v = *value](base::ThreadPool& pool, const VkImageSubresourceRange& r) {
    if (bound(i->memory())) texture::clearColor(pool, i->memory(), v, r);
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdClearDepthStencilImage(VkCommandBuffer b, VkImage image, VkImageLayout, const VkClearDepthStencilValue* value, uint32_t count,
                                                       const VkImageSubresourceRange* ranges) {
  forRegions(b, ranges, count, [i = from(image), v = *value](base::ThreadPool& pool, const VkImageSubresourceRange& r) {
    if (bound(i->memory())) texture::clearDepthStencil(pool, i->memory(), v, r);
  });
}

}  // namespace pumice::icd
