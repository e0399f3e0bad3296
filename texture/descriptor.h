// Descriptors as they lie in a descriptor set's memory: read by generated code (ir::kTableSet0 + n), written by
// vkUpdateDescriptorSets. All-zero bytes are a null descriptor: reads give zero, writes vanish.
#pragma once

#include <cstddef>
#include <cstdint>

#include "texture/keys.h"
#include "texture/layout.h"

namespace pumice::texture {

//! Uniform and storage buffers, texel buffers (then `format` and `elements` are set).
struct BufferDescriptor {
  uint64_t base = 0;        //!< address of the range's first byte
  uint64_t size = 0;        //!< bytes that may be accessed
  uint32_t format = 0;      //!< VkFormat of a texel buffer view
  uint32_t elements = 0;    //!< texels of a texel buffer view
  uint32_t padding[2] = {};
};
static_assert(sizeof(BufferDescriptor) == 32);

//! An image view (sampled, storage, input attachment). Levels and layers count from the view's base.
struct ImageDescriptor {
  uint64_t base = 0;          //!< address of the plane (multi-planar: of the first), first layer of the view, sample 0
  uint64_t levels = 0;        //!< address of LevelLayout[levelCount] of the view's first level; multi-planar: of the only level of each plane
  uint64_t layerPitch = 0;    //!< bytes
  uint64_t samplePitch = 0;   //!< bytes
  uint64_t size = 0;          //!< bytes from base that may be accessed
  uint32_t width = 0, height = 0, depth = 0;   //!< texels of the view's first level
  uint32_t layerCount = 0;
  uint32_t levelCount = 0;
  uint32_t samples = 0;
  float minLod = 0;
  ViewKey key;                //!< selects code: read by the draw, not by routines
  //! The further planes of a multi-planar view.
  struct {
    uint64_t base = 0, size = 0;
  } planes[2];
};
static_assert(sizeof(ImageDescriptor) == 112);

struct SamplerDescriptor {
  float border[4] = {};       //!< colour, already in the numeric type of the sampler's border (bits for integer ones)
  float minLod = 0, maxLod = 0, lodBias = 0, maxAnisotropy = 1;
  SamplerKey key;             //!< selects code: read by the draw, not by routines
  uint32_t padding[4] = {};
};
static_assert(sizeof(SamplerDescriptor) == 64);

//! One element of a binding: stride is fixed by the descriptor type.
struct CombinedDescriptor {
  ImageDescriptor image;
  uint32_t padding[4] = {};
  SamplerDescriptor sampler;
};
static_assert(sizeof(CombinedDescriptor) == 192 && offsetof(CombinedDescriptor, sampler) == 128);

//! Bytes of one array element of a binding of this type in set memory (inline uniform blocks: 1).
uint32_t descriptorStride(VkDescriptorType type);

}  // namespace pumice::texture
