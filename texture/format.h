// The one format table. Decode, encode, capability queries, clears, blits, texel buffers and vertex fetch
// are all derived from it (Vulkan spec, "Formats").
#pragma once

#include <cstdint>
#include <span>

#include <vulkan/vulkan_core.h>

namespace pumice::texture {

enum class Numeric : uint8_t { None, Unorm, Snorm, Uscaled, Sscaled, Uint, Sint, Ufloat, Sfloat, Srgb };
enum class Compression : uint8_t { None, Bc1, Bc2, Bc3, Bc4, Bc5, Bc6h, Bc7 };

//! Where one component lies in the element: bits [shift, shift+bits) of the little-endian element
//! (up to 256 bits). bits = 0: absent (0, or 1 for alpha).
struct Component {
  uint8_t bits = 0;
  uint8_t shift = 0;   //!< in bits; component sizes above 32 are whole words
  Numeric numeric = Numeric::None;
};

enum FormatFlags : uint16_t {
  kPacked = 1,          //!< components are bit fields of one word (PACK8/16/32)
  kSharedExponent = 2,  //!< E5B9G9R9
  kDepth = 4,
  kStencil = 8,
  kPadded16 = 16,       //!< components are the upper bits of words of 16, the others are padding
};

struct FormatInfo {
  VkFormat format;
  const char* name;          //!< without VK_FORMAT_
  uint8_t elementBytes;      //!< texel, or compressed block; combined depth/stencil: of the depth plane
  uint8_t blockWidth, blockHeight;
  Compression compression;
  uint16_t flags;
  Component rgba[4];         //!< depth is in rgba[0], stencil in rgba[1] of combined formats
  uint8_t planeCount;        //!< of multi-planar formats 2 or 3, each plane with a format of its own; else 1
  uint8_t chromaShift[2];    //!< planes but the first are smaller by this power of two in x and y
  VkFormat planeFormats[3];  //!< of multi-planar formats
  //! Of multi-planar formats, for R, G and B (Cr, Y', Cb): the plane that has it, and which component it is there.
  uint8_t componentPlane[3], componentInPlane[3];

  bool isDepthStencil() const { return flags & (kDepth | kStencil); }
  bool hasDepth() const { return flags & kDepth; }
  bool hasStencil() const { return flags & kStencil; }
  bool isCompressed() const { return compression != Compression::None; }
  bool isMultiPlanar() const { return planeCount > 1; }
  bool isInteger() const { return rgba[0].numeric == Numeric::Uint || rgba[0].numeric == Numeric::Sint; }
  VkImageAspectFlags aspects() const;
};

//! nullptr for formats that are not in the table (then nothing supports them).
const FormatInfo* formatInfo(VkFormat format);
std::span<const FormatInfo> allFormats();
//! Place in allFormats() + 1: what keys name a format by.
uint16_t formatKey(const FormatInfo& f);

//! True features, derived from the table and from what the builders below implement.
VkFormatFeatureFlags2 optimalFeatures(const FormatInfo& f);
VkFormatFeatureFlags2 linearFeatures(const FormatInfo& f);
VkFormatFeatureFlags2 bufferFeatures(const FormatInfo& f);
//! Sample counts that optimally tiled attachments of this format may have.
VkSampleCountFlags sampleCounts(const FormatInfo& f);
//! Same compatibility class (texel block size and compressed-ness) for views of mutable images and copies.
bool compatible(const FormatInfo& a, const FormatInfo& b);

}  // namespace pumice::texture
