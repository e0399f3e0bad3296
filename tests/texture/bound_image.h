// An image, view and sampler as a shader sees them, and image instructions run on them.
#pragma once

#include <bit>

#include "tests/texture/run_ir.h"
#include "tests/texture/test_image.h"
#include "texture/addressing.h"

namespace pumice::texture {

constexpr VkImageAspectFlags kColor = VK_IMAGE_ASPECT_COLOR_BIT;

// An image with its descriptor, as a shader sees it in set 0.
struct Bound {
  TestImage image;
  CombinedDescriptor descriptor;
  ViewKey view;
  SamplerKey sampler;

  explicit Bound(TestImage i, VkImageViewType type = VK_IMAGE_VIEW_TYPE_2D, VkImageAspectFlags aspect = kColor) : image(std::move(i)) {
    const PlaneLayout& plane = image.layout.plane(aspect);
    ImageDescriptor& d = descriptor.image;
    d.base = reinterpret_cast<uint64_t>(image.base() + plane.offset);
    d.levels = reinterpret_cast<uint64_t>(plane.levels);
    d.layerPitch = plane.layerPitch;
    d.samplePitch = plane.samplePitch;
    d.size = image.layout.size - plane.offset;
    d.width = image.layout.extent.width;
    d.height = image.layout.extent.height;
    d.depth = image.layout.extent.depth;
    d.layerCount = image.layout.arrayLayers;
    d.levelCount = image.layout.mipLevels;
    d.samples = image.layout.samples;
    view.format = uint16_t(image.layout.format->format);
    view.viewType = uint8_t(type);
    view.tiled = addressing(image.layout.tiled, d.size);
    view.aspect = uint8_t(aspect);
    for (int c = 0; c < 4; ++c) view.swizzle[c] = uint8_t(VK_COMPONENT_SWIZZLE_R + c);
    view.samples = 1;
    view.singleLevel = image.layout.mipLevels == 1;
    sampler.present = 1;
    descriptor.sampler.maxLod = 1000.0f;
  }
  Bound(const Bound&) = delete;

  void address(VkSamplerAddressMode mode) { sampler.addressU = sampler.addressV = sampler.addressW = uint8_t(mode); }
  void filter(VkFilter mag, VkFilter min, VkSamplerMipmapMode mip = VK_SAMPLER_MIPMAP_MODE_NEAREST) {
    sampler.magFilter = uint8_t(mag);
    sampler.minFilter = uint8_t(min);
    sampler.mipmapMode = uint8_t(mip);
  }

  // `operands` are rows of 32-bit words in the order of the instruction, of the given types.
  std::vector<std::vector<uint32_t>> run(const ir::ImageOpInfo& op, const std::vector<ir::Type>& types, const std::vector<std::vector<uint32_t>>& operands,
                                         std::vector<ir::Value> (*constants)(ir::Builder&) = nullptr) {
    uint32_t outputs = op.kind == ir::ImageKind::QueryLod ? 2 : op.kind == ir::ImageKind::Write ? 0 : 4;
    IrProgram program(uint32_t(types.size()), std::max(outputs, 1u), [&](ir::Builder& b) {
      std::vector<ir::Value> values = {b.i32(0), b.i32(0)};
      for (uint32_t i = 0; i < types.size(); ++i) values.push_back(b.input(types[i], i));
      if (constants)
        for (ir::Value v : constants(b)) values.push_back(v);
      ImageRef imageRef{ir::kTableSet0, 0, b.i32(0), view};
      SamplerRef samplerRef{ir::kTableSet0, offsetof(CombinedDescriptor, sampler), b.i32(0), sampler};
      const char* error = nullptr;
      std::vector<ir::Value> result = expandImage(b, op, values, imageRef, samplerRef, &error);
      EXPECT_EQ(error, nullptr) << error;
      for (uint32_t i = 0; i < std::min<size_t>(outputs, result.size()); ++i) b.output(i, result[i]);
    });
    if (!program) return {};
    program.setTable(ir::kTableSet0, &descriptor, sizeof(descriptor));
    return program.run(operands);
  }
};

inline uint32_t word(float f) { return std::bit_cast<uint32_t>(f); }
inline float real(uint32_t w) { return std::bit_cast<float>(w); }

inline TestImage randomImage(VkFormat f, VkExtent3D extent, uint32_t levels = 1, uint32_t layers = 1, VkImageType type = VK_IMAGE_TYPE_2D,
                      VkImageTiling tiling = VK_IMAGE_TILING_OPTIMAL, VkImageUsageFlags usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT) {
  TestImage image(f, extent, levels, layers, type, tiling, VK_SAMPLE_COUNT_1_BIT, usage);
  image.randomise(17);
  return image;
}

}  // namespace pumice::texture
