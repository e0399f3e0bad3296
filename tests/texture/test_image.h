// An image in plain memory for tests.
#pragma once

#include <cstring>
#include <random>
#include <vector>

#include "texture/transfer.h"

namespace pumice::texture {

inline VkImageCreateInfo imageInfo(VkFormat format, VkImageType type, VkExtent3D extent, uint32_t levels = 1, uint32_t layers = 1,
                                   VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT, VkImageTiling tiling = VK_IMAGE_TILING_OPTIMAL,
                                   VkImageUsageFlags usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT) {
  VkImageCreateInfo i{};
  i.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  i.format = format;
  i.imageType = type;
  i.extent = extent;
  i.mipLevels = levels;
  i.arrayLayers = layers;
  i.samples = samples;
  i.tiling = tiling;
  i.usage = usage;
  return i;
}

struct TestImage {
  ImageLayout layout;
  std::vector<uint64_t> storage;

  TestImage(VkFormat format, VkExtent3D extent, uint32_t levels = 1, uint32_t layers = 1, VkImageType type = VK_IMAGE_TYPE_2D,
            VkImageTiling tiling = VK_IMAGE_TILING_OPTIMAL, VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT,
            VkImageUsageFlags usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT)
      : layout(imageLayout(imageInfo(format, type, extent, levels, layers, samples, tiling, usage))) {
    storage.resize(layout.size / 8 + 8);
  }

  std::byte* base() { return reinterpret_cast<std::byte*>(storage.data()); }
  ImageMemory memory() { return {&layout, base()}; }
  std::byte* element(VkImageAspectFlags aspect, uint32_t level, uint32_t layer, uint32_t x, uint32_t y, uint32_t z = 0, uint32_t sample = 0) {
    return base() + layout.elementOffset(layout.plane(aspect), level, layer, sample, x, y, z);
  }
  uint32_t pixel(uint32_t x, uint32_t y, uint32_t level = 0, uint32_t layer = 0) {
    uint32_t v;
    std::memcpy(&v, element(VK_IMAGE_ASPECT_COLOR_BIT, level, layer, x, y), 4);
    return v;
  }
  void setPixel(uint32_t x, uint32_t y, uint32_t v, uint32_t level = 0, uint32_t layer = 0) {
    std::memcpy(element(VK_IMAGE_ASPECT_COLOR_BIT, level, layer, x, y), &v, 4);
  }
  void randomise(uint32_t seed) {
    std::mt19937_64 random(seed);
    for (uint64_t& w : storage) w = random();
  }
};

}  // namespace pumice::texture
