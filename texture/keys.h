// What of a view and of a sampler selects code. Zero-initialised, compared and hashed as bytes.
#pragma once

#include <cstdint>
#include <cstring>

#include "texture/format.h"

namespace pumice::texture {

//! State of an image view that selects code.
struct ViewKey {
  uint16_t format = 0;        //!< index in allFormats() + 1; 0 = null view
  uint8_t viewType = 0;       //!< VkImageViewType
  uint8_t tiled = 0;          //!< Addressing flags (addressing.h)
  uint8_t aspect = 0;         //!< VK_IMAGE_ASPECT_{COLOR,DEPTH,STENCIL}_BIT
  uint8_t swizzle[4] = {};    //!< VkComponentSwizzle, identity resolved to R, G, B, A
  uint8_t samples = 0;
  uint8_t singleLevel = 0;    //!< only one level: no level of detail needed
  uint8_t padding[1] = {};
  bool operator==(const ViewKey& o) const { return !std::memcmp(this, &o, sizeof *this); }
};
static_assert(sizeof(ViewKey) == 12);

//! SamplerKey::conversion. The conversion's component mapping stands in ViewKey::swizzle, where the view's own must be the identity.
struct Conversion {
  uint8_t model = 0;              //!< VkSamplerYcbcrModelConversion
  bool narrow = false;            //!< ITU_NARROW range
  bool cosited[2] = {};           //!< chroma samples lie on even luma samples, else between them; x, y
  bool linear = false;            //!< chromaFilter
};
constexpr uint8_t conversionBits(const Conversion& c) {
  return uint8_t((c.model + 1) | c.narrow << 3 | c.cosited[0] << 4 | c.cosited[1] << 5 | c.linear << 6);
}
constexpr Conversion conversionOf(uint8_t bits) {
  return {uint8_t((bits & 7) - 1), bool(bits >> 3 & 1), {bool(bits >> 4 & 1), bool(bits >> 5 & 1)}, bool(bits >> 6 & 1)};
}

//! State of a sampler that selects code.
struct SamplerKey {
  uint8_t magFilter = 0, minFilter = 0, mipmapMode = 0;         //!< VkFilter, VkSamplerMipmapMode
  uint8_t addressU = 0, addressV = 0, addressW = 0;             //!< VkSamplerAddressMode
  uint8_t compareEnable = 0, compareOp = 0;
  uint8_t anisotropy = 0;          //!< enabled and maxAnisotropy > 1
  uint8_t unnormalized = 0;
  uint8_t reduction = 0;           //!< VkSamplerReductionMode
  uint8_t integerBorder = 0;
  uint8_t zeroLod = 0;             //!< maxLod == 0 and minLod == 0: base level only, but min/mag still chosen by level of detail
  uint8_t present = 0;             //!< 1 for a real sampler (a null key is all zero)
  uint8_t conversion = 0;          //!< of Y'CbCr (conversionBits), 0: none
  uint8_t nonSeamless = 0;         //!< faces of a cube are images of their own, with the address modes above
  bool operator==(const SamplerKey& o) const { return !std::memcmp(this, &o, sizeof *this); }
};
static_assert(sizeof(SamplerKey) == 16);

}  // namespace pumice::texture
