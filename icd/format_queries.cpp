// Capability queries for formats and images, derived from the one format table.
#include <algorithm>
#include <bit>

#include "entrypoints.h"
#include "icd/external.h"
#include "icd/instance.h"
#include "texture/format.h"
#include "texture/layout.h"

namespace pumice::icd {
namespace {

struct FormatFeatures {
  VkFormatFeatureFlags2 linear = 0, optimal = 0, buffer = 0;
};
FormatFeatures formatFeatures(VkFormat format) {
  const auto* f = texture::formatInfo(format);
  if (!f) return {};
  return {texture::linearFeatures(*f), texture::optimalFeatures(*f), texture::bufferFeatures(*f)};
}

// The 64-bit flags' low word is the old type; its top bit was never given a meaning.
VkFormatFeatureFlags oldFlags(VkFormatFeatureFlags2 flags) { return VkFormatFeatureFlags(flags & 0x7fffffff); }
VkFormatProperties formatProperties(VkFormat format) {
  FormatFeatures f = formatFeatures(format);
  return {oldFlags(f.linear), oldFlags(f.optimal), oldFlags(f.buffer)};
}

// What a usage needs of a format.
struct UsageRule {
  VkImageUsageFlags usage;
  VkFormatFeatureFlags feature;
};
constexpr UsageRule kUsageRules[] = {
    {VK_IMAGE_USAGE_TRANSFER_SRC_BIT, VK_FORMAT_FEATURE_TRANSFER_SRC_BIT},
    {VK_IMAGE_USAGE_TRANSFER_DST_BIT, VK_FORMAT_FEATURE_TRANSFER_DST_BIT},
    {VK_IMAGE_USAGE_SAMPLED_BIT, VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT},
    {VK_IMAGE_USAGE_STORAGE_BIT, VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT},
    {VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT},
    {VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT},
    {VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT | VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT},
};

VkResult imageFormatProperties(const PhysicalDevice& device, VkFormat format, VkImageType type, VkImageTiling tiling,
                               VkImageUsageFlags usage, VkImageCreateFlags flags, VkImageFormatProperties& out) {
  out = {};
  const auto* f = texture::formatInfo(format);
  VkFormatProperties p = formatProperties(format);
  VkFormatFeatureFlags features = tiling == VK_IMAGE_TILING_OPTIMAL  ? p.optimalTilingFeatures
                                  : tiling == VK_IMAGE_TILING_LINEAR ? p.linearTilingFeatures
                                                                     : 0;
  if (!f || !features) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  // With extended usage a view's format may bring the features.
  if (!(flags & VK_IMAGE_CREATE_EXTENDED_USAGE_BIT))
    for (const UsageRule& rule : kUsageRules)
      if ((usage & rule.usage) && !(features & rule.feature)) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  constexpr VkImageCreateFlags kSparse = VK_IMAGE_CREATE_SPARSE_BINDING_BIT | VK_IMAGE_CREATE_SPARSE_RESIDENCY_BIT | VK_IMAGE_CREATE_SPARSE_ALIASED_BIT;
  constexpr VkImageCreateFlags kUnsupported = kSparse | VK_IMAGE_CREATE_PROTECTED_BIT |
                                              VK_IMAGE_CREATE_SAMPLE_LOCATIONS_COMPATIBLE_DEPTH_BIT_EXT | VK_IMAGE_CREATE_SUBSAMPLED_BIT_EXT |
                                              VK_IMAGE_CREATE_SPLIT_INSTANCE_BIND_REGIONS_BIT;
  if (flags & kUnsupported) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  if ((flags & VK_IMAGE_CREATE_DISJOINT_BIT) && !(features & VK_FORMAT_FEATURE_DISJOINT_BIT)) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  if (f->isMultiPlanar() && (type != VK_IMAGE_TYPE_2D || (flags & VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT))) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  if ((flags & VK_IMAGE_CREATE_BLOCK_TEXEL_VIEW_COMPATIBLE_BIT) && !f->isCompressed()) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  if ((flags & VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT) && type != VK_IMAGE_TYPE_2D) return VK_ERROR_FORMAT_NOT_SUPPORTED;
  if (type == VK_IMAGE_TYPE_1D && f->isCompressed()) return VK_ERROR_FORMAT_NOT_SUPPORTED;

  const VkPhysicalDeviceLimits& l = device.properties.limits;
  bool linear = tiling == VK_IMAGE_TILING_LINEAR;
  uint32_t edge = type == VK_IMAGE_TYPE_3D ? l.maxImageDimension3D : type == VK_IMAGE_TYPE_1D ? l.maxImageDimension1D : l.maxImageDimension2D;
  out.maxExtent = {edge, type == VK_IMAGE_TYPE_1D ? 1 : edge, type == VK_IMAGE_TYPE_3D ? edge : 1};
  // One level and layer: what a view of all planes can have (ycbcr.cpp; no ycbcrImageArrays).
  const bool single = linear || f->isMultiPlanar();
  out.maxMipLevels = single ? 1 : uint32_t(std::bit_width(edge));
  out.maxArrayLayers = type == VK_IMAGE_TYPE_3D || single ? 1 : l.maxImageArrayLayers;
  bool multisampled = !single && type == VK_IMAGE_TYPE_2D && !(flags & VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT) &&
                      (features & (VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT | VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT));
  out.sampleCounts = multisampled ? texture::sampleCounts(*f) : VkSampleCountFlags(VK_SAMPLE_COUNT_1_BIT);
  out.maxResourceSize = std::min<uint64_t>(device.memory.memoryHeaps[0].size, uint64_t(1) << 40);
  return VK_SUCCESS;
}

}  // namespace

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceFormatProperties(VkPhysicalDevice, VkFormat format, VkFormatProperties* out) {
  *out = formatProperties(format);
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceFormatProperties2(VkPhysicalDevice, VkFormat format, VkFormatProperties2* out) {
  out->formatProperties = formatProperties(format);
  for (auto* s = static_cast<VkBaseOutStructure*>(out->pNext); s; s = s->pNext)
    if (s->sType == VK_STRUCTURE_TYPE_FORMAT_PROPERTIES_3) {
      FormatFeatures f = formatFeatures(format);
      auto& p = *reinterpret_cast<VkFormatProperties3*>(s);
      p.linearTilingFeatures = f.linear;
      p.optimalTilingFeatures = f.optimal;
      p.bufferFeatures = f.buffer;
    }
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceImageFormatProperties(VkPhysicalDevice handle, VkFormat format, VkImageType type, VkImageTiling tiling,
                                                                        VkImageUsageFlags usage, VkImageCreateFlags flags, VkImageFormatProperties* out) {
  return imageFormatProperties(*from(handle), format, type, tiling, usage, flags, *out);
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceImageFormatProperties2(VkPhysicalDevice handle, const VkPhysicalDeviceImageFormatInfo2* info, VkImageFormatProperties2* out) {
  auto* external = findInChain<VkPhysicalDeviceExternalImageFormatInfo>(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_IMAGE_FORMAT_INFO);
  const VkExternalMemoryProperties sharing = external ? externalMemory(external->handleType) : VkExternalMemoryProperties{};
  for (auto* s = static_cast<VkBaseOutStructure*>(out->pNext); s; s = s->pNext) switch (s->sType) {
      case VK_STRUCTURE_TYPE_EXTERNAL_IMAGE_FORMAT_PROPERTIES: reinterpret_cast<VkExternalImageFormatProperties*>(s)->externalMemoryProperties = sharing; break;
      case VK_STRUCTURE_TYPE_SAMPLER_YCBCR_CONVERSION_IMAGE_FORMAT_PROPERTIES:
        reinterpret_cast<VkSamplerYcbcrConversionImageFormatProperties*>(s)->combinedImageSamplerDescriptorCount = 1;
        break;
      default: break;
    }
  // The stencil aspect may have a usage of its own: both must be possible.
  auto* stencil = findInChain<VkImageStencilUsageCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_IMAGE_STENCIL_USAGE_CREATE_INFO);
  VkImageUsageFlags usage = info->usage | (stencil ? stencil->stencilUsage : VkImageUsageFlags(0));
  if (external && external->handleType && !sharing.externalMemoryFeatures) {
    out->imageFormatProperties = {};
    return VK_ERROR_FORMAT_NOT_SUPPORTED;
  }
  return imageFormatProperties(*from(handle), info->format, info->type, info->tiling, usage, info->flags, out->imageFormatProperties);
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceSparseImageFormatProperties(VkPhysicalDevice, VkFormat, VkImageType, VkSampleCountFlagBits, VkImageUsageFlags,
                                                                          VkImageTiling, uint32_t* count, VkSparseImageFormatProperties*) {
  *count = 0;
}

VKAPI_ATTR void VKAPI_CALL vkGetPhysicalDeviceSparseImageFormatProperties2(VkPhysicalDevice, const VkPhysicalDeviceSparseImageFormatInfo2*, uint32_t* count,
                                                                           VkSparseImageFormatProperties2*) {
  *count = 0;
}

}  // namespace pumice::icd
