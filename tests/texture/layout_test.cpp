#include "texture/layout.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/texture/test_image.h"
#include "texture/descriptor.h"

namespace pumice::texture {
namespace {

// Every element has bytes of its own inside the image's size.
void expectBijection(const VkImageCreateInfo& create) {
  ImageLayout image = imageLayout(create);
  ASSERT_GT(image.size, 0u);
  ASSERT_LT(image.size, 1u << 24);
  std::vector<uint8_t> used(image.size);
  for (uint32_t p = 0; p < image.planeCount; ++p) {
    const PlaneLayout& plane = image.planes[p];
    EXPECT_EQ(plane.offset % 64, 0u);
    for (uint32_t s = 0; s < image.samples; ++s)
      for (uint32_t layer = 0; layer < image.arrayLayers; ++layer)
        for (uint32_t l = 0; l < image.mipLevels; ++l) {
          const LevelLayout& level = plane.levels[l];
          EXPECT_EQ(level.offset % 64, 0u);
          for (uint32_t z = 0; z < level.depth; ++z)
            for (uint32_t y = 0; y < level.elementsY; ++y)
              for (uint32_t x = 0; x < level.elementsX; ++x) {
                uint64_t at = image.elementOffset(plane, l, layer, s, x, y, z);
                ASSERT_LE(at + plane.elementBytes, image.size);
                for (uint32_t b = 0; b < plane.elementBytes; ++b) ASSERT_EQ(used[at + b]++, 0) << x << ' ' << y << ' ' << z;
              }
        }
  }
}

TEST(ImageLayout, EveryElementHasBytesOfItsOwn) {
  expectBijection(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {37, 21, 1}, 6, 3));
  expectBijection(imageInfo(VK_FORMAT_R8_UNORM, VK_IMAGE_TYPE_2D, {1, 1, 1}));
  expectBijection(imageInfo(VK_FORMAT_R32G32B32_SFLOAT, VK_IMAGE_TYPE_2D, {9, 6, 1}, 4, 2));
  expectBijection(imageInfo(VK_FORMAT_R16G16B16A16_SFLOAT, VK_IMAGE_TYPE_3D, {10, 7, 5}, 4));
  expectBijection(imageInfo(VK_FORMAT_R8G8B8_UNORM, VK_IMAGE_TYPE_1D, {77, 1, 1}, 7, 4));
  expectBijection(imageInfo(VK_FORMAT_D24_UNORM_S8_UINT, VK_IMAGE_TYPE_2D, {19, 18, 1}, 5, 2));
  expectBijection(imageInfo(VK_FORMAT_D32_SFLOAT_S8_UINT, VK_IMAGE_TYPE_2D, {13, 9, 1}, 1, 2, VK_SAMPLE_COUNT_4_BIT));
  expectBijection(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {13, 9, 1}, 1, 1, VK_SAMPLE_COUNT_8_BIT));
  expectBijection(imageInfo(VK_FORMAT_BC3_UNORM_BLOCK, VK_IMAGE_TYPE_2D, {30, 18, 1}, 5, 6));
  for (VkFormat f : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R8G8B8_UNORM, VK_FORMAT_BC3_UNORM_BLOCK, VK_FORMAT_D24_UNORM_S8_UINT})
    expectBijection(imageInfo(f, VK_IMAGE_TYPE_2D, {520, 66, 1}, 10, 2, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_TILING_OPTIMAL, VK_IMAGE_USAGE_SAMPLED_BIT));
  expectBijection(imageInfo(VK_FORMAT_R32_UINT, VK_IMAGE_TYPE_3D, {37, 21, 5}, 5, 1, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_TILING_OPTIMAL, VK_IMAGE_USAGE_STORAGE_BIT));
  expectBijection(imageInfo(VK_FORMAT_R5G6B5_UNORM_PACK16, VK_IMAGE_TYPE_2D, {5, 3, 1}, 1, 1, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_TILING_LINEAR));
}

TEST(ImageLayout, WhatIsNoAttachmentIsRowsThatDoNotFallOnPowersOfTwo) {
  constexpr auto kOptimal = VK_IMAGE_TILING_OPTIMAL;
  auto sampled = imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {1024, 8, 1}, 1, 1, VK_SAMPLE_COUNT_1_BIT, kOptimal, VK_IMAGE_USAGE_SAMPLED_BIT));
  EXPECT_FALSE(sampled.tiled);
  EXPECT_EQ(sampled.planes[0].levels[0].rowPitch, 4096u + 64u);
  auto small = imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {32, 8, 1}, 1, 1, VK_SAMPLE_COUNT_1_BIT, kOptimal, VK_IMAGE_USAGE_SAMPLED_BIT));
  EXPECT_EQ(small.planes[0].levels[0].rowPitch, 128u);
  auto target = imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {1024, 8, 1}, 1, 1, VK_SAMPLE_COUNT_1_BIT, kOptimal,
                                 VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT));
  EXPECT_TRUE(target.tiled);
}

TEST(ImageLayout, BlocksAreQuadMajorAndLevelsHoldWholeBlocks) {
  ImageLayout image = imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {6, 6, 1}));
  const PlaneLayout& p = image.planes[0];
  EXPECT_EQ(image.elementOffset(p, 0, 0, 0, 1, 0, 0), 4u);
  EXPECT_EQ(image.elementOffset(p, 0, 0, 0, 0, 1, 0), 8u);
  EXPECT_EQ(image.elementOffset(p, 0, 0, 0, 2, 0, 0), 16u);
  EXPECT_EQ(image.elementOffset(p, 0, 0, 0, 0, 2, 0), 32u);
  EXPECT_EQ(image.elementOffset(p, 0, 0, 0, 4, 0, 0), 64u);
  EXPECT_EQ(image.elementOffset(p, 0, 0, 0, 0, 4, 0), 128u);
  EXPECT_EQ(image.size, 256u);
}

TEST(ImageLayout, LinearImagesAreTightRows) {
  ImageLayout image = imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {5, 3, 1}, 1, 1, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_TILING_LINEAR));
  VkSubresourceLayout s = subresourceLayout(image, {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0});
  EXPECT_EQ(s.offset, 0u);
  EXPECT_EQ(s.rowPitch, 20u);
  EXPECT_EQ(s.size, 60u);
  EXPECT_EQ(image.elementOffset(image.planes[0], 0, 0, 0, 2, 1, 0), 28u);
}

TEST(ImageLayout, SizesThatOverflowAreRefused) {
  EXPECT_EQ(imageLayout(imageInfo(VK_FORMAT_R64G64B64A64_SFLOAT, VK_IMAGE_TYPE_3D, {~0u, ~0u, ~0u}, 15)).size, 0u);
  EXPECT_EQ(imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {1u << 31, 1u << 31, 1}, 1, 64)).size, 0u);
  EXPECT_EQ(imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {4, 4, 1}, 16)).size, 0u);
  EXPECT_EQ(imageLayout(imageInfo(VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_TYPE_2D, {0, 4, 1})).size, 0u);
  EXPECT_EQ(imageLayout(imageInfo(VK_FORMAT_ASTC_4x4_UNORM_BLOCK, VK_IMAGE_TYPE_2D, {4, 4, 1})).size, 0u);
  EXPECT_GT(imageLayout(imageInfo(VK_FORMAT_R8_UNORM, VK_IMAGE_TYPE_2D, {16384, 16384, 1}, 15, 2048)).size, uint64_t(1) << 39);
}

TEST(Descriptors, StridesAreThoseOfTheStructures) {
  EXPECT_EQ(descriptorStride(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER), sizeof(CombinedDescriptor));
  EXPECT_EQ(descriptorStride(VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE), 128u);
  EXPECT_EQ(descriptorStride(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER), sizeof(BufferDescriptor));
  EXPECT_EQ(descriptorStride(VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK), 1u);
}

}  // namespace
}  // namespace pumice::texture
