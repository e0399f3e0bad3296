// Copies, clears and fills against element-by-element references.
#include <gtest/gtest.h>

#include "tests/texture/test_image.h"
#include "texture/rows.h"

namespace pumice::texture {
namespace {

constexpr VkImageAspectFlags kColor = VK_IMAGE_ASPECT_COLOR_BIT, kDepthAspect = VK_IMAGE_ASPECT_DEPTH_BIT, kStencilAspect = VK_IMAGE_ASPECT_STENCIL_BIT;

uint32_t blocks(uint32_t texels, uint32_t edge) { return (texels + edge - 1) / edge; }

// The element-by-element form of both buffer copies.
void referenceCopy(TestImage& image, std::vector<std::byte>& buffer, const VkBufferImageCopy& r, bool toImage) {
  const FormatInfo& f = *image.layout.format;
  const uint32_t bytes = image.layout.plane(r.imageSubresource.aspectMask).elementBytes;
  uint64_t pitch = blocks(r.bufferRowLength ? r.bufferRowLength : r.imageExtent.width, f.blockWidth) * uint64_t(bytes);
  uint64_t slice = pitch * blocks(r.bufferImageHeight ? r.bufferImageHeight : r.imageExtent.height, f.blockHeight);
  for (uint32_t layer = 0; layer < r.imageSubresource.layerCount; ++layer)
    for (uint32_t z = 0; z < r.imageExtent.depth; ++z)
      for (uint32_t y = 0; y < blocks(r.imageExtent.height, f.blockHeight); ++y)
        for (uint32_t x = 0; x < blocks(r.imageExtent.width, f.blockWidth); ++x) {
          uint64_t at = r.bufferOffset + (uint64_t(layer) * r.imageExtent.depth + z) * slice + y * pitch + x * bytes;
          std::byte* e = image.element(r.imageSubresource.aspectMask, r.imageSubresource.mipLevel, r.imageSubresource.baseArrayLayer + layer,
                                       uint32_t(r.imageOffset.x) / f.blockWidth + x, uint32_t(r.imageOffset.y) / f.blockHeight + y,
                                       uint32_t(r.imageOffset.z) + z);
          ASSERT_LE(at + bytes, buffer.size());
          std::memcpy(toImage ? e : &buffer[at], toImage ? &buffer[at] : e, bytes);
        }
}

void expectBufferCopies(TestImage image, const VkBufferImageCopy& r) {
  base::ThreadPool pool(3);
  std::vector<std::byte> buffer(1 << 21);
  std::mt19937 random(7);
  for (auto& b : buffer) b = std::byte(random());
  image.randomise(1);
  TestImage expected = image;
  referenceCopy(expected, buffer, r, true);
  copyBufferToImage(pool, {buffer.data(), buffer.size()}, image.memory(), r);
  EXPECT_EQ(image.storage, expected.storage);

  std::vector<std::byte> wanted = buffer;
  image.randomise(2);
  referenceCopy(image, wanted, r, false);
  copyImageToBuffer(pool, image.memory(), {buffer.data(), buffer.size()}, r);
  EXPECT_EQ(buffer, wanted);
}

VkBufferImageCopy region(VkImageAspectFlags aspect, uint32_t level, uint32_t layer, uint32_t layers, VkOffset3D offset, VkExtent3D extent,
                         uint32_t rowLength = 0, uint32_t height = 0) {
  return {12, rowLength, height, {aspect, level, layer, layers}, offset, extent};
}

TEST(BufferCopy, EqualsTheElementwiseCopy) {
  for (VkFormat f : {VK_FORMAT_R8_UNORM, VK_FORMAT_R5G6B5_UNORM_PACK16, VK_FORMAT_R8G8B8_UNORM, VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R16G16B16_SFLOAT,
                     VK_FORMAT_R32G32_UINT, VK_FORMAT_R32G32B32_SFLOAT, VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R64G64B64A64_SFLOAT}) {
    SCOPED_TRACE(formatInfo(f)->name);
    expectBufferCopies(TestImage(f, {37, 23, 1}), region(kColor, 0, 0, 1, {0, 0, 0}, {37, 23, 1}));
    expectBufferCopies(TestImage(f, {37, 23, 1}, 3, 4), region(kColor, 1, 1, 2, {3, 2, 0}, {11, 7, 1}, 16, 9));
    expectBufferCopies(TestImage(f, {9, 10, 7}, 1, 1, VK_IMAGE_TYPE_3D), region(kColor, 0, 0, 1, {1, 1, 2}, {7, 9, 4}));
    expectBufferCopies(TestImage(f, {50, 1, 1}, 1, 3, VK_IMAGE_TYPE_1D), region(kColor, 0, 0, 3, {5, 0, 0}, {41, 1, 1}));
    expectBufferCopies(TestImage(f, {20, 12, 1}, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_LINEAR), region(kColor, 0, 0, 1, {1, 2, 0}, {18, 9, 1}));
  }
}

TEST(BufferCopy, LargeCopiesOnSeveralThreads) { expectBufferCopies(TestImage(VK_FORMAT_R8G8B8A8_UNORM, {641, 479, 1}), region(kColor, 0, 0, 1, {1, 3, 0}, {640, 475, 1})); }

TEST(BufferCopy, CompressedBlocksAndDepthStencilPlanes) {
  expectBufferCopies(TestImage(VK_FORMAT_BC3_UNORM_BLOCK, {30, 18, 1}, 4, 2), region(kColor, 0, 1, 1, {4, 8, 0}, {26, 10, 1}));
  expectBufferCopies(TestImage(VK_FORMAT_BC1_RGB_UNORM_BLOCK, {30, 18, 1}, 4), region(kColor, 3, 0, 1, {0, 0, 0}, {3, 2, 1}));
  expectBufferCopies(TestImage(VK_FORMAT_D16_UNORM, {17, 9, 1}), region(kDepthAspect, 0, 0, 1, {0, 0, 0}, {17, 9, 1}));
  expectBufferCopies(TestImage(VK_FORMAT_D32_SFLOAT_S8_UINT, {17, 9, 1}), region(kDepthAspect, 0, 0, 1, {2, 1, 0}, {13, 5, 1}));
  expectBufferCopies(TestImage(VK_FORMAT_D32_SFLOAT_S8_UINT, {17, 9, 1}), region(kStencilAspect, 0, 0, 1, {2, 1, 0}, {13, 5, 1}));
  expectBufferCopies(TestImage(VK_FORMAT_D24_UNORM_S8_UINT, {17, 9, 1}), region(kStencilAspect, 0, 0, 1, {2, 1, 0}, {13, 5, 1}));
  expectBufferCopies(TestImage(VK_FORMAT_S8_UINT, {17, 9, 1}), region(kStencilAspect, 0, 0, 1, {0, 0, 0}, {17, 9, 1}));
}

TEST(BufferCopy, Depth24KeepsItsUpperByteZero) {
  base::ThreadPool pool(1);
  TestImage image(VK_FORMAT_D24_UNORM_S8_UINT, {5, 5, 1});
  std::vector<uint32_t> buffer(25, 0xab123456u);
  copyBufferToImage(pool, {reinterpret_cast<std::byte*>(buffer.data()), 100}, image.memory(), {0, 0, 0, {kDepthAspect, 0, 0, 1}, {}, {5, 5, 1}});
  uint32_t v;
  std::memcpy(&v, image.element(kDepthAspect, 0, 0, 4, 4), 4);
  EXPECT_EQ(v, 0x123456u);
  EXPECT_EQ(int(*image.element(kStencilAspect, 0, 0, 4, 4)), 0);
}

TEST(BufferCopy, NothingOutsideTheBufferOrImageIsTouched) {
  base::ThreadPool pool(1);
  TestImage image(VK_FORMAT_R8G8B8A8_UNORM, {16, 16, 1});
  image.randomise(1);
  std::vector<std::byte> buffer(1000, std::byte(0x55));
  copyImageToBuffer(pool, image.memory(), {buffer.data(), 500}, {0, 0, 0, {kColor, 0, 0, 1}, {}, {16, 16, 1}});
  for (size_t i = 500; i < 1000; ++i) ASSERT_EQ(buffer[i], std::byte(0x55));
  EXPECT_NE(std::memcmp(buffer.data(), buffer.data() + 500, 500), 0);
  auto before = image.storage;
  copyBufferToImage(pool, {buffer.data(), 0}, image.memory(), {0, 0, 0, {kColor, 0, 0, 1}, {}, {16, 16, 1}});
  copyBufferToImage(pool, {buffer.data(), 1000}, image.memory(), {0, 0, 0, {kColor, 5, 0, 1}, {}, {16, 16, 1}});
  copyBufferToImage(pool, {buffer.data(), 1000}, image.memory(), {0, 0, 0, {kColor, 0, 7, 1}, {}, {16, 16, 1}});
  EXPECT_EQ(image.storage, before);
}

// Copies region a of `src` to `dst` and compares with the elementwise copy.
void expectImageCopy(TestImage src, TestImage dst, const VkImageCopy& r, VkExtent3D elements) {
  base::ThreadPool pool(2);
  src.randomise(1);
  dst.randomise(2);
  TestImage expected = dst;
  const FormatInfo &sf = *src.layout.format, &df = *dst.layout.format;
  for (uint32_t aspect : {kColor, kDepthAspect, kStencilAspect}) {
    if (!(r.srcSubresource.aspectMask & aspect)) continue;
    for (uint32_t i = 0; i < elements.depth; ++i)
      for (uint32_t y = 0; y < elements.height; ++y)
        for (uint32_t x = 0; x < elements.width; ++x) {
          bool s3 = src.layout.type == VK_IMAGE_TYPE_3D, d3 = dst.layout.type == VK_IMAGE_TYPE_3D;
          for (uint32_t sample = 0; sample < src.layout.samples; ++sample)
            std::memcpy(expected.element(aspect, r.dstSubresource.mipLevel, r.dstSubresource.baseArrayLayer + (d3 ? 0 : i),
                                         uint32_t(r.dstOffset.x) / df.blockWidth + x, uint32_t(r.dstOffset.y) / df.blockHeight + y,
                                         uint32_t(r.dstOffset.z) + (d3 ? i : 0), sample),
                        src.element(aspect, r.srcSubresource.mipLevel, r.srcSubresource.baseArrayLayer + (s3 ? 0 : i),
                                    uint32_t(r.srcOffset.x) / sf.blockWidth + x, uint32_t(r.srcOffset.y) / sf.blockHeight + y,
                                    uint32_t(r.srcOffset.z) + (s3 ? i : 0), sample),
                        src.layout.plane(aspect).elementBytes);
        }
  }
  copyImage(pool, src.memory(), dst.memory(), r);
  // The padding of edge blocks is nobody's: compare elements.
  for (uint32_t p = 0; p < dst.layout.planeCount; ++p) {
    const PlaneLayout& plane = dst.layout.planes[p];
    for (uint32_t sample = 0; sample < dst.layout.samples; ++sample)
      for (uint32_t layer = 0; layer < dst.layout.arrayLayers; ++layer)
        for (uint32_t l = 0; l < dst.layout.mipLevels; ++l)
          for (uint32_t z = 0; z < plane.levels[l].depth; ++z)
            for (uint32_t y = 0; y < plane.levels[l].elementsY; ++y)
              for (uint32_t x = 0; x < plane.levels[l].elementsX; ++x)
                ASSERT_EQ(std::memcmp(dst.element(plane.aspect, l, layer, x, y, z, sample), expected.element(plane.aspect, l, layer, x, y, z, sample), plane.elementBytes), 0)
                    << x << ' ' << y << ' ' << z << " level " << l << " layer " << layer;
  }
}

TEST(ImageCopy, EqualsTheElementwiseCopy) {
  const VkFormat f = VK_FORMAT_R8G8B8A8_UNORM, g = VK_FORMAT_R32_UINT;
  auto linear = [&](VkExtent3D e) { return TestImage(f, e, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_LINEAR); };
  expectImageCopy(TestImage(f, {37, 21, 1}), TestImage(g, {37, 21, 1}), {{kColor, 0, 0, 1}, {}, {kColor, 0, 0, 1}, {}, {37, 21, 1}}, {37, 21, 1});
  expectImageCopy(TestImage(f, {37, 21, 1}), TestImage(g, {64, 64, 1}), {{kColor, 0, 0, 1}, {4, 8, 0}, {kColor, 0, 0, 1}, {8, 4, 0}, {16, 12, 1}}, {16, 12, 1});
  expectImageCopy(TestImage(f, {37, 21, 1}), TestImage(f, {40, 30, 1}), {{kColor, 0, 0, 1}, {3, 5, 0}, {kColor, 0, 0, 1}, {6, 1, 0}, {29, 13, 1}}, {29, 13, 1});
  expectImageCopy(TestImage(f, {37, 21, 1}, 3, 4), TestImage(f, {20, 20, 1}, 2, 5), {{kColor, 1, 1, 2}, {1, 0, 0}, {kColor, 1, 3, 2}, {0, 1, 0}, {9, 8, 1}}, {9, 8, 2});
  expectImageCopy(TestImage(f, {37, 21, 1}), linear({40, 30, 1}), {{kColor, 0, 0, 1}, {3, 5, 0}, {kColor, 0, 0, 1}, {6, 1, 0}, {29, 13, 1}}, {29, 13, 1});
  expectImageCopy(linear({37, 21, 1}), TestImage(f, {40, 30, 1}), {{kColor, 0, 0, 1}, {3, 5, 0}, {kColor, 0, 0, 1}, {6, 1, 0}, {29, 13, 1}}, {29, 13, 1});
  expectImageCopy(TestImage(f, {12, 12, 6}, 1, 1, VK_IMAGE_TYPE_3D), TestImage(f, {12, 12, 8}, 1, 1, VK_IMAGE_TYPE_3D),
                  {{kColor, 0, 0, 1}, {1, 2, 1}, {kColor, 0, 0, 1}, {3, 4, 3}, {7, 6, 4}}, {7, 6, 4});
  expectImageCopy(TestImage(f, {12, 12, 6}, 1, 1, VK_IMAGE_TYPE_3D), TestImage(f, {12, 12, 1}, 1, 8),
                  {{kColor, 0, 0, 1}, {0, 0, 1}, {kColor, 0, 2, 4}, {0, 0, 0}, {12, 12, 4}}, {12, 12, 4});
  expectImageCopy(TestImage(VK_FORMAT_D24_UNORM_S8_UINT, {19, 18, 1}), TestImage(VK_FORMAT_D24_UNORM_S8_UINT, {19, 18, 1}),
                  {{kDepthAspect | kStencilAspect, 0, 0, 1}, {}, {kDepthAspect | kStencilAspect, 0, 0, 1}, {}, {19, 18, 1}}, {19, 18, 1});
  expectImageCopy(TestImage(VK_FORMAT_D24_UNORM_S8_UINT, {19, 18, 1}), TestImage(VK_FORMAT_D24_UNORM_S8_UINT, {19, 18, 1}),
                  {{kStencilAspect, 0, 0, 1}, {1, 1, 0}, {kStencilAspect, 0, 0, 1}, {2, 3, 0}, {9, 8, 1}}, {9, 8, 1});
  constexpr auto four = VK_SAMPLE_COUNT_4_BIT;
  expectImageCopy(TestImage(f, {13, 11, 1}, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL, four), TestImage(f, {13, 11, 1}, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL, four),
                  {{kColor, 0, 0, 1}, {}, {kColor, 0, 0, 1}, {}, {13, 11, 1}}, {13, 11, 1});
}

TEST(ImageCopy, BlocksOfCompressedFormatsAreElements) {
  expectImageCopy(TestImage(VK_FORMAT_BC1_RGBA_UNORM_BLOCK, {32, 24, 1}), TestImage(VK_FORMAT_R32G32_UINT, {8, 6, 1}),
                  {{kColor, 0, 0, 1}, {4, 8, 0}, {kColor, 0, 0, 1}, {1, 0, 0}, {16, 12, 1}}, {4, 3, 1});
  expectImageCopy(TestImage(VK_FORMAT_R32G32_UINT, {8, 6, 1}), TestImage(VK_FORMAT_BC1_RGBA_UNORM_BLOCK, {30, 22, 1}),
                  {{kColor, 0, 0, 1}, {0, 1, 0}, {kColor, 0, 0, 1}, {4, 8, 0}, {7, 4, 1}}, {7, 4, 1});
  expectImageCopy(TestImage(VK_FORMAT_BC7_SRGB_BLOCK, {30, 22, 1}), TestImage(VK_FORMAT_BC7_SRGB_BLOCK, {30, 22, 1}),
                  {{kColor, 0, 0, 1}, {8, 8, 0}, {kColor, 0, 0, 1}, {8, 8, 0}, {22, 14, 1}}, {6, 4, 1});
}

TEST(Clear, ValuesArePackedForTheFormat) {
  std::byte out[32];
  auto word = [&] {
    uint32_t v;
    std::memcpy(&v, out, 4);
    return v;
  };
  VkClearValue v{};
  v.color = {{1.0f, 0.5f, 0.0f, 0.25f}};
  packClearValue(*formatInfo(VK_FORMAT_R8G8B8A8_UNORM), kColor, v, out);
  EXPECT_EQ(word(), 0x400080ffu);
  packClearValue(*formatInfo(VK_FORMAT_B8G8R8A8_SRGB), kColor, v, out);
  EXPECT_EQ(word(), 0x40ffbc00u);
  v.color.int32[0] = -5;
  packClearValue(*formatInfo(VK_FORMAT_R32_SINT), kColor, v, out);
  EXPECT_EQ(word(), 0xfffffffbu);
  v.depthStencil = {0.5f, 0x1ab};
  packClearValue(*formatInfo(VK_FORMAT_D24_UNORM_S8_UINT), kDepthAspect, v, out);
  EXPECT_EQ(word(), 0x800000u);
  packClearValue(*formatInfo(VK_FORMAT_D24_UNORM_S8_UINT), kStencilAspect, v, out);
  EXPECT_EQ(word(), 0xabu);
  packClearValue(*formatInfo(VK_FORMAT_D32_SFLOAT), kDepthAspect, v, out);
  EXPECT_EQ(word(), 0x3f000000u);
}

TEST(Clear, FillsExactlyTheRange) {
  base::ThreadPool pool(2);
  TestImage image(VK_FORMAT_R8G8B8A8_UNORM, {300, 200, 1}, 4, 5);
  image.randomise(3);
  TestImage before = image;
  clearColor(pool, image.memory(), {{1.0f, 0.0f, 1.0f, 0.0f}}, {kColor, 1, 2, 2, VK_REMAINING_ARRAY_LAYERS});
  for (uint32_t layer = 0; layer < 5; ++layer)
    for (uint32_t level = 0; level < 4; ++level)
      for (uint32_t y = 0; y < 200u >> level; ++y)
        for (uint32_t x = 0; x < 300u >> level; ++x) {
          bool inside = layer >= 2 && (level == 1 || level == 2);
          ASSERT_EQ(image.pixel(x, y, level, layer), inside ? 0x00ff00ffu : before.pixel(x, y, level, layer));
        }
  TestImage depth(VK_FORMAT_D24_UNORM_S8_UINT, {33, 17, 1});
  clearDepthStencil(pool, depth.memory(), {1.0f, 7}, {kStencilAspect, 0, 1, 0, 1});
  EXPECT_EQ(int(*depth.element(kStencilAspect, 0, 0, 32, 16)), 7);
  EXPECT_EQ(int(*depth.element(kDepthAspect, 0, 0, 32, 16)), 0);
  clearDepthStencil(pool, depth.memory(), {1.0f, 9}, {kDepthAspect, 0, 1, 0, 1});
  EXPECT_EQ(int(*depth.element(kStencilAspect, 0, 0, 32, 16)), 7);
  EXPECT_EQ(int(*depth.element(kDepthAspect, 0, 0, 32, 16)), 0xff);
}

TEST(Clear, RectanglesEqualTheElementwiseFill) {
  std::mt19937 random(9);
  for (VkFormat f : {VK_FORMAT_R8_UINT, VK_FORMAT_R8G8B8_UINT, VK_FORMAT_R8G8B8A8_UINT, VK_FORMAT_R32G32B32_UINT, VK_FORMAT_R32G32B32A32_UINT}) {
    for (int n = 0; n < 60; ++n) {
      TestImage image(f, {70, 33, 1}, 1, 1, VK_IMAGE_TYPE_2D, n % 3 ? VK_IMAGE_TILING_OPTIMAL : VK_IMAGE_TILING_LINEAR);
      image.randomise(uint32_t(n));
      TestImage expected = image;
      VkRect2D rect{{int32_t(random() % 80) - 8, int32_t(random() % 40) - 4}, {uint32_t(random() % 90), uint32_t(random() % 40)}};
      if (n % 4 == 0) rect.offset.x = 0, rect.extent.width = 70;
      std::byte element[32];
      for (auto& b : element) b = std::byte(random());
      const uint32_t bytes = image.layout.planes[0].elementBytes;
      for (int y = 0; y < 33; ++y)
        for (int x = 0; x < 70; ++x)
          if (x >= rect.offset.x && y >= rect.offset.y && x < rect.offset.x + int(rect.extent.width) && y < rect.offset.y + int(rect.extent.height))
            std::memcpy(expected.element(kColor, 0, 0, uint32_t(x), uint32_t(y)), element, bytes);
      fillRect(image.memory(), kColor, 0, 0, 0, rect, element);
      for (uint32_t y = 0; y < 33; ++y)
        for (uint32_t x = 0; x < 70; ++x) ASSERT_EQ(std::memcmp(image.element(kColor, 0, 0, x, y), expected.element(kColor, 0, 0, x, y), bytes), 0) << x << ' ' << y;
    }
  }
}

// Small, of several threads, past the caches; at every alignment that the API allows.
TEST(Buffers, AreFilledAndCopiedExactly) {
  base::ThreadPool pool(2);
  constexpr uint64_t kEdge = 64;
  for (uint64_t size : {uint64_t(4), uint64_t(60), uint64_t(4096 + 12), uint64_t(1 << 20) + 4, kStreamBytes + 20}) {
    for (uint64_t offset : {0u, 4u, 20u}) {
      std::vector<std::byte> memory(size + offset + kEdge, std::byte(0xee)), to = memory;
      fillBuffer(pool, {memory.data() + offset, size}, 0x12345678);
      for (uint64_t i = 0; i < memory.size(); ++i) {
        const bool inside = i >= offset && i < offset + size;
        const uint32_t expected = inside ? 0x12345678u >> ((i - offset) % 4 * 8) & 255 : 0xee;
        ASSERT_EQ(uint32_t(memory[i]), expected) << "byte " << i << " of " << size << " at " << offset;
      }
      for (uint64_t i = 0; i < size; ++i) memory[offset + i] = std::byte(i * 7 >> 3);
      copyBuffer(pool, {memory.data() + offset, size}, {to.data() + offset, size}, size + 100);
      ASSERT_EQ(std::memcmp(to.data() + offset, memory.data() + offset, size), 0) << size;
      ASSERT_EQ(to[offset + size], std::byte(0xee));
    }
  }
}

TEST(Clear, PastTheCachesFillsTheLevel) {
  base::ThreadPool pool(2);
  TestImage image(VK_FORMAT_R8G8B8A8_UNORM, {2048, 1030, 1}, 1, 1);
  ASSERT_GE(image.layout.size, kStreamBytes);
  clearColor(pool, image.memory(), {{1.0f, 0.0f, 1.0f, 0.0f}}, {kColor, 0, 1, 0, 1});
  for (uint32_t y = 0; y < 1030; ++y)
    for (uint32_t x = 0; x < 2048; ++x) ASSERT_EQ(image.pixel(x, y), 0x00ff00ffu) << x << ' ' << y;
}

}  // namespace
}  // namespace pumice::texture
