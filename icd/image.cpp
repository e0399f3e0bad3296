// Images, image views, samplers and their conversions of Y'CbCr.
#include <algorithm>
#include <cstring>

#include "base/log.h"
#include "entrypoints.h"
#include "icd/resources.h"
#include "icd/wsi/swapchain.h"
#include "texture/addressing.h"

namespace pumice::icd {
namespace {

uint64_t planeBytes(const texture::ImageLayout& layout, const texture::PlaneLayout& plane) { return plane.samplePitch * layout.samples; }

//! `plane`: the aspect of one plane, or 0: the whole image.
VkMemoryRequirements imageRequirements(const texture::ImageLayout& layout, VkImageAspectFlags plane = 0) {
  uint64_t size = plane ? planeBytes(layout, layout.plane(plane)) : layout.size;
  return {(size + 63) & ~uint64_t(63), std::max<uint64_t>(layout.alignment, 64), kMemoryTypeBits};
}

uint8_t resolveSwizzle(VkComponentSwizzle s, VkComponentSwizzle identity) {
  return uint8_t(s == VK_COMPONENT_SWIZZLE_IDENTITY ? identity : s);
}

// Address and shape of the view, as routines read them.
void fillDescriptor(ImageView& view, const VkComponentMapping& components) {
  const Image& image = *view.image;
  const texture::PlaneLayout& plane = image.layout.plane(view.range.aspectMask);
  const auto* format = texture::formatInfo(view.format);
  texture::ImageDescriptor& d = view.descriptor;
  std::copy_n(plane.levels + view.range.baseMipLevel, view.range.levelCount, view.levels);
  // A block-compressed image seen through an uncompressed view (block texel views): texels are blocks.
  if (image.layout.format->isCompressed() && format && !format->isCompressed())
    for (auto& level : view.levels) level.width = level.elementsX, level.height = level.elementsY;
  bool slices3D = image.layout.type == VK_IMAGE_TYPE_3D && view.viewType != VK_IMAGE_VIEW_TYPE_3D;
  uint64_t first = plane.offset;
  if (slices3D) {
    // 2D (array) views of a 3D image: layers are slices.
    first += view.range.baseArrayLayer * view.levels[0].slicePitch;
    d.layerPitch = view.levels[0].slicePitch;
  } else {
    first += view.range.baseArrayLayer * plane.layerPitch;
    d.layerPitch = plane.layerPitch;
  }
  const bool multiPlanar = image.layout.format->isMultiPlanar();
  d.base = reinterpret_cast<uint64_t>(image.data) + first;
  d.levels = reinterpret_cast<uint64_t>(view.levels);
  d.samplePitch = plane.samplePitch;
  d.size = !image.data ? 0 : multiPlanar ? planeBytes(image.layout, plane) - (first - plane.offset) : image.layout.size - first;
  d.width = view.levels[0].width;
  d.height = view.levels[0].height;
  d.depth = slices3D ? 1 : view.levels[0].depth;
  d.layerCount = view.range.layerCount;
  d.levelCount = view.range.levelCount;
  d.samples = image.layout.samples;

  texture::ViewKey& k = d.key;
  k.format = format ? texture::formatKey(*format) : 0;
  if (format && format->isMultiPlanar())
    for (uint32_t p = 1; p < image.layout.planeCount; p++) {
      const texture::PlaneLayout& other = image.layout.planes[p];
      view.levels[p] = other.levels[view.range.baseMipLevel];
      const uint64_t layers = view.range.baseArrayLayer * other.layerPitch;
      d.planes[p - 1] = {reinterpret_cast<uint64_t>(image.data) + other.offset + layers, image.data ? planeBytes(image.layout, other) - layers : 0};
    }
  k.viewType = uint8_t(view.viewType);
  k.tiled = texture::addressing(image.layout.tiled, d.size);
  VkImageAspectFlags aspect = view.range.aspectMask;
  if (aspect & VK_IMAGE_ASPECT_DEPTH_BIT) aspect = VK_IMAGE_ASPECT_DEPTH_BIT;   // attachments may name both
  if (multiPlanar) aspect = VK_IMAGE_ASPECT_COLOR_BIT;   // the view's format is that of the plane, or of all
  k.aspect = uint8_t(aspect);
  k.swizzle[0] = resolveSwizzle(components.r, VK_COMPONENT_SWIZZLE_R);
  k.swizzle[1] = resolveSwizzle(components.g, VK_COMPONENT_SWIZZLE_G);
  k.swizzle[2] = resolveSwizzle(components.b, VK_COMPONENT_SWIZZLE_B);
  k.swizzle[3] = resolveSwizzle(components.a, VK_COMPONENT_SWIZZLE_A);
  k.samples = uint8_t(image.layout.samples);
  k.singleLevel = view.range.levelCount == 1;
}

// The image has memory when all planes have.
void bindPlane(Image& image, VkImageAspectFlags aspect, std::byte* data) {
  image.planeData[&image.layout.plane(aspect) - image.layout.planes] = data;
  for (uint32_t p = 0; p < image.layout.planeCount; p++)
    if (!image.planeData[p]) return;
  image.data = image.planeData[0];
  for (uint32_t p = 0; p < image.layout.planeCount; p++)
    image.layout.planes[p].offset = reinterpret_cast<uint64_t>(image.planeData[p]) - reinterpret_cast<uint64_t>(image.data);
}

void bindImage(VkImage handle, VkDeviceMemory memory, VkDeviceSize offset, const void* chain) {
  Image& image = *from(handle);
  if (auto* swapchain = findInChain<VkBindImageMemorySwapchainInfoKHR>(chain, VK_STRUCTURE_TYPE_BIND_IMAGE_MEMORY_SWAPCHAIN_INFO_KHR);
      swapchain && swapchain->swapchain)
    bindSwapchainImage(image, swapchain->swapchain, swapchain->imageIndex);
  else if (auto* plane = findInChain<VkBindImagePlaneMemoryInfo>(chain, VK_STRUCTURE_TYPE_BIND_IMAGE_PLANE_MEMORY_INFO);
           plane && (image.flags & VK_IMAGE_CREATE_DISJOINT_BIT))
    bindPlane(image, plane->planeAspect, from(memory)->data + offset);
  else
    image.data = from(memory)->data + offset;
}

}  // namespace

void allowMarkedClears(Image& image) {
  // Attachments and transfers know of tiles that are only marked.
  constexpr VkImageUsageFlags kKnowing = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  constexpr VkImageCreateFlags kShared = VK_IMAGE_CREATE_ALIAS_BIT | VK_IMAGE_CREATE_DISJOINT_BIT;
  const texture::ImageLayout& layout = image.layout;
  const texture::PlaneLayout& plane = layout.planes[0];
  if (!(image.usage & VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT) || image.usage & ~kKnowing || image.flags & kShared) return;
  if (!layout.tiled || layout.type != VK_IMAGE_TYPE_2D || layout.arrayLayers != 1 || layout.mipLevels != 1 || layout.samples != 1) return;
  if (plane.elementBytes > sizeof texture::ClearedTiles::element) return;
  try {
    image.ownCleared = std::make_unique<texture::ClearedTiles>(plane.levels[0].width, plane.levels[0].height);
  } catch (const std::bad_alloc&) {
    return;   // clears store, then
  }
  image.cleared = image.ownCleared.get();
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateImage(VkDevice handle, const VkImageCreateInfo* info, const VkAllocationCallbacks* callbacks, VkImage* out) {
  auto* image = from(handle)->make<Image>(callbacks);
  if (!image) return VK_ERROR_OUT_OF_HOST_MEMORY;
  image->flags = info->flags;
  image->usage = info->usage;
  image->format = info->format;
  image->layout = texture::imageLayout(*info);
  // Larger than the heap: it could never be bound (VkImageFormatProperties::maxResourceSize).
  if (!image->layout.format || !image->layout.size || image->layout.size > from(handle)->physical.memory.memoryHeaps[0].size) {
    from(handle)->destroy(callbacks, image);
    base::logError("vkCreateImage: format %d or its size is not supported", info->format);
    return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  }
  if (info->tiling == VK_IMAGE_TILING_OPTIMAL && !findInChain<VkExternalMemoryImageCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_IMAGE_CREATE_INFO))
    allowMarkedClears(*image);
  *out = to<VkImage>(image);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyImage(VkDevice handle, VkImage image, const VkAllocationCallbacks* callbacks) {
  from(handle)->destroy(callbacks, from(image));
}

VKAPI_ATTR void VKAPI_CALL vkGetImageMemoryRequirements(VkDevice, VkImage image, VkMemoryRequirements* out) { *out = imageRequirements(from(image)->layout); }

VKAPI_ATTR void VKAPI_CALL vkGetImageMemoryRequirements2(VkDevice, const VkImageMemoryRequirementsInfo2* info, VkMemoryRequirements2* out) {
  const Image& image = *from(info->image);
  auto* plane = findInChain<VkImagePlaneMemoryRequirementsInfo>(info->pNext, VK_STRUCTURE_TYPE_IMAGE_PLANE_MEMORY_REQUIREMENTS_INFO);
  out->memoryRequirements = imageRequirements(image.layout, plane && (image.flags & VK_IMAGE_CREATE_DISJOINT_BIT) ? VkImageAspectFlags(plane->planeAspect) : 0);
  fillDedicated(out->pNext);
}

VKAPI_ATTR void VKAPI_CALL vkGetDeviceImageMemoryRequirements(VkDevice, const VkDeviceImageMemoryRequirements* info, VkMemoryRequirements2* out) {
  const bool disjoint = info->pCreateInfo->flags & VK_IMAGE_CREATE_DISJOINT_BIT;
  out->memoryRequirements = imageRequirements(texture::imageLayout(*info->pCreateInfo), disjoint ? VkImageAspectFlags(info->planeAspect) : 0);
  fillDedicated(out->pNext);
}

VKAPI_ATTR void VKAPI_CALL vkGetImageSparseMemoryRequirements(VkDevice, VkImage, uint32_t* count, VkSparseImageMemoryRequirements*) { *count = 0; }
VKAPI_ATTR void VKAPI_CALL vkGetImageSparseMemoryRequirements2(VkDevice, const VkImageSparseMemoryRequirementsInfo2*, uint32_t* count, VkSparseImageMemoryRequirements2*) { *count = 0; }
VKAPI_ATTR void VKAPI_CALL vkGetDeviceImageSparseMemoryRequirements(VkDevice, const VkDeviceImageMemoryRequirements*, uint32_t* count, VkSparseImageMemoryRequirements2*) { *count = 0; }

VKAPI_ATTR VkResult VKAPI_CALL vkBindImageMemory(VkDevice, VkImage image, VkDeviceMemory memory, VkDeviceSize offset) {
  bindImage(image, memory, offset, nullptr);
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkBindImageMemory2(VkDevice, uint32_t count, const VkBindImageMemoryInfo* infos) {
  for (uint32_t i = 0; i < count; i++) bindImage(infos[i].image, infos[i].memory, infos[i].memoryOffset, infos[i].pNext);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkGetImageSubresourceLayout(VkDevice, VkImage image, const VkImageSubresource* subresource, VkSubresourceLayout* out) {
  *out = texture::subresourceLayout(from(image)->layout, *subresource);
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateImageView(VkDevice handle, const VkImageViewCreateInfo* info, const VkAllocationCallbacks* callbacks, VkImageView* out) {
  auto* view = from(handle)->make<ImageView>(callbacks);
  if (!view) return VK_ERROR_OUT_OF_HOST_MEMORY;
  view->image = from(info->image);
  view->viewType = info->viewType;
  view->format = info->format;
  view->range = info->subresourceRange;
  const texture::ImageLayout& layout = view->image->layout;
  if (view->range.levelCount == VK_REMAINING_MIP_LEVELS) view->range.levelCount = layout.mipLevels - view->range.baseMipLevel;
  view->range.levelCount = std::min(view->range.levelCount, texture::kMaxLevels - std::min(view->range.baseMipLevel, texture::kMaxLevels));
  bool slices = layout.type == VK_IMAGE_TYPE_3D && info->viewType != VK_IMAGE_VIEW_TYPE_3D;
  uint32_t layers = slices ? std::max(1u, layout.extent.depth >> view->range.baseMipLevel) : layout.arrayLayers;
  if (view->range.layerCount == VK_REMAINING_ARRAY_LAYERS) view->range.layerCount = layers - view->range.baseArrayLayer;
  // With a conversion the view's own mapping is the identity.
  auto* conversion = findInChain<VkSamplerYcbcrConversionInfo>(info->pNext, VK_STRUCTURE_TYPE_SAMPLER_YCBCR_CONVERSION_INFO);
  fillDescriptor(*view, conversion ? from(conversion->conversion)->components : info->components);
  *out = to<VkImageView>(view);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyImageView(VkDevice handle, VkImageView view, const VkAllocationCallbacks* callbacks) {
  from(handle)->destroy(callbacks, from(view));
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateSampler(VkDevice handle, const VkSamplerCreateInfo* info, const VkAllocationCallbacks* callbacks, VkSampler* out) {
  auto* sampler = from(handle)->make<Sampler>(callbacks);
  if (!sampler) return VK_ERROR_OUT_OF_HOST_MEMORY;
  texture::SamplerDescriptor& d = sampler->descriptor;
  bool white = info->borderColor == VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE || info->borderColor == VK_BORDER_COLOR_INT_OPAQUE_WHITE;
  bool opaque = white || info->borderColor == VK_BORDER_COLOR_FLOAT_OPAQUE_BLACK || info->borderColor == VK_BORDER_COLOR_INT_OPAQUE_BLACK;
  bool integer = info->borderColor == VK_BORDER_COLOR_INT_TRANSPARENT_BLACK || info->borderColor == VK_BORDER_COLOR_INT_OPAQUE_BLACK ||
                 info->borderColor == VK_BORDER_COLOR_INT_OPAQUE_WHITE || info->borderColor == VK_BORDER_COLOR_INT_CUSTOM_EXT;
  uint32_t one = 1;
  float unit = 1;
  if (integer) std::memcpy(&unit, &one, sizeof unit);
  for (int i = 0; i < 4; i++) d.border[i] = (i < 3 ? white : opaque) ? unit : 0.0f;
  if (info->borderColor == VK_BORDER_COLOR_FLOAT_CUSTOM_EXT || info->borderColor == VK_BORDER_COLOR_INT_CUSTOM_EXT)
    if (auto* custom = findInChain<VkSamplerCustomBorderColorCreateInfoEXT>(info->pNext, VK_STRUCTURE_TYPE_SAMPLER_CUSTOM_BORDER_COLOR_CREATE_INFO_EXT))
      std::memcpy(d.border, &custom->customBorderColor, sizeof d.border);
  d.minLod = info->minLod;
  d.maxLod = info->maxLod;
  d.lodBias = info->mipLodBias;
  d.maxAnisotropy = info->anisotropyEnable ? info->maxAnisotropy : 1;
  texture::SamplerKey& k = d.key;
  k.magFilter = uint8_t(info->magFilter);
  k.minFilter = uint8_t(info->minFilter);
  k.mipmapMode = uint8_t(info->mipmapMode);
  k.addressU = uint8_t(info->addressModeU);
  k.addressV = uint8_t(info->addressModeV);
  k.addressW = uint8_t(info->addressModeW);
  k.compareEnable = info->compareEnable != 0;
  k.compareOp = info->compareEnable ? uint8_t(info->compareOp) : 0;
  k.anisotropy = d.maxAnisotropy > 1;
  k.unnormalized = info->unnormalizedCoordinates != 0;
  if (auto* reduction = findInChain<VkSamplerReductionModeCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_SAMPLER_REDUCTION_MODE_CREATE_INFO))
    k.reduction = uint8_t(reduction->reductionMode);
  if (auto* conversion = findInChain<VkSamplerYcbcrConversionInfo>(info->pNext, VK_STRUCTURE_TYPE_SAMPLER_YCBCR_CONVERSION_INFO))
    k.conversion = texture::conversionBits(from(conversion->conversion)->conversion);
  k.integerBorder = integer;
  k.zeroLod = info->maxLod == 0 && info->minLod == 0;
  k.nonSeamless = (info->flags & VK_SAMPLER_CREATE_NON_SEAMLESS_CUBE_MAP_BIT_EXT) != 0;
  k.present = 1;
  *out = to<VkSampler>(sampler);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroySampler(VkDevice handle, VkSampler sampler, const VkAllocationCallbacks* callbacks) {
  from(handle)->destroy(callbacks, from(sampler));
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateSamplerYcbcrConversion(VkDevice handle, const VkSamplerYcbcrConversionCreateInfo* info, const VkAllocationCallbacks* callbacks,
                                                              VkSamplerYcbcrConversion* out) {
  auto* made = from(handle)->make<SamplerYcbcrConversion>(callbacks);
  if (!made) return VK_ERROR_OUT_OF_HOST_MEMORY;
  made->conversion.model = uint8_t(info->ycbcrModel);
  made->conversion.narrow = info->ycbcrRange == VK_SAMPLER_YCBCR_RANGE_ITU_NARROW;
  made->conversion.cosited[0] = info->xChromaOffset == VK_CHROMA_LOCATION_COSITED_EVEN;
  made->conversion.cosited[1] = info->yChromaOffset == VK_CHROMA_LOCATION_COSITED_EVEN;
  made->conversion.linear = info->chromaFilter == VK_FILTER_LINEAR;
  made->components = info->components;
  *out = to<VkSamplerYcbcrConversion>(made);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroySamplerYcbcrConversion(VkDevice device, VkSamplerYcbcrConversion conversion, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(conversion));
}

}  // namespace pumice::icd
