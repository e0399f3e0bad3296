// Copies among buffers and images: every byte must arrive.
#include "cts_subset/tests/devices.h"

#include <algorithm>
#include <cstring>

namespace pumice::cts {
namespace {

class Copy : public OnDevice {};
constexpr VkBufferUsageFlags kBoth = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

TEST_P(Copy, FillBufferWritesWholeWords) {
  Workspace work(device());
  Bytes expected = noise(1003, 1);
  Buffer buffer = work.buffer(expected.size(), kBoth, expected.data());
  device().run([&](VkCommandBuffer commands) {
    vkCmdFillBuffer(commands, buffer.handle, 16, 400, 0x01020304);
    vkCmdFillBuffer(commands, buffer.handle, 420, 4, 0xdeadbeef);
    vkCmdFillBuffer(commands, buffer.handle, 800, VK_WHOLE_SIZE, 0xa1b2c3d4);
    fullBarrier(commands);
  });
  auto fill = [&](size_t at, size_t size, uint32_t word) {
    for (size_t i = 0; i < size; i += 4) std::memcpy(&expected[at + i], &word, 4);
  };
  fill(16, 400, 0x01020304);
  fill(420, 4, 0xdeadbeef);
  fill(800, 200, 0xa1b2c3d4);  // VK_WHOLE_SIZE is rounded down to a multiple of 4
  EXPECT_EQ(firstDifference(bytesOf(buffer), expected), "");
}

TEST_P(Copy, UpdateBufferTakesDataAtRecording) {
  Workspace work(device());
  Bytes expected = noise(70000, 2), data = noise(65536, 3);
  Buffer buffer = work.buffer(expected.size(), kBoth, expected.data());
  device().run([&](VkCommandBuffer commands) {
    Bytes passing = data;
    vkCmdUpdateBuffer(commands, buffer.handle, 1024, 65536, passing.data());
    fullBarrier(commands);
    vkCmdUpdateBuffer(commands, buffer.handle, 4, 12, passing.data() + 100);
    std::fill(passing.begin(), passing.end(), uint8_t(0));  // must not matter any more
    fullBarrier(commands);
  });
  std::copy(data.begin(), data.end(), expected.begin() + 1024);
  std::copy_n(data.begin() + 100, 12, expected.begin() + 4);
  EXPECT_EQ(firstDifference(bytesOf(buffer), expected), "");
}

TEST_P(Copy, BufferRegions) {
  Workspace work(device());
  Bytes source = noise(5000, 4), expected = noise(6000, 5);
  Buffer from = work.buffer(source.size(), kBoth, source.data());
  Buffer to = work.buffer(expected.size(), kBoth, expected.data());
  const VkBufferCopy kRegions[] = {{0, 1, 1}, {13, 101, 1777}, {4999, 5999, 1}, {100, 3000, 2048}};
  device().run([&](VkCommandBuffer commands) {
    vkCmdCopyBuffer(commands, from.handle, to.handle, 4, kRegions);
    fullBarrier(commands);
    VkBufferCopy inside{0, 2500, 400};  // within one buffer, without overlap
    vkCmdCopyBuffer(commands, to.handle, to.handle, 1, &inside);
    fullBarrier(commands);
  });
  for (const VkBufferCopy& r : kRegions)
    std::copy_n(source.begin() + long(r.srcOffset), r.size, expected.begin() + long(r.dstOffset));
  std::copy_n(expected.begin(), 400, expected.begin() + 2500);
  EXPECT_EQ(firstDifference(bytesOf(to), expected), "");
}

constexpr VkImageAspectFlags kDepth = VK_IMAGE_ASPECT_DEPTH_BIT;
constexpr VkImageAspectFlags kStencil = VK_IMAGE_ASPECT_STENCIL_BIT;

#define PUMICE_FORMAT(name, bytes) \
  TexelFormat { VK_FORMAT_##name, #name, bytes }
const TexelFormat kFormats[] = {
    PUMICE_FORMAT(R8_UNORM, 1),
    PUMICE_FORMAT(R8_UINT, 1),
    PUMICE_FORMAT(R8_SINT, 1),
    PUMICE_FORMAT(R8G8_UNORM, 2),
    PUMICE_FORMAT(R8G8_SNORM, 2),
    PUMICE_FORMAT(R8G8B8A8_UNORM, 4),
    PUMICE_FORMAT(R8G8B8A8_SNORM, 4),
    PUMICE_FORMAT(R8G8B8A8_SRGB, 4),
    PUMICE_FORMAT(R8G8B8A8_UINT, 4),
    PUMICE_FORMAT(B8G8R8A8_UNORM, 4),
    PUMICE_FORMAT(B8G8R8A8_SRGB, 4),
    PUMICE_FORMAT(R5G6B5_UNORM_PACK16, 2),
    PUMICE_FORMAT(A1R5G5B5_UNORM_PACK16, 2),
    PUMICE_FORMAT(A2B10G10R10_UNORM_PACK32, 4),
    PUMICE_FORMAT(B10G11R11_UFLOAT_PACK32, 4),
    PUMICE_FORMAT(E5B9G9R9_UFLOAT_PACK32, 4),
    PUMICE_FORMAT(R16_UNORM, 2),
    PUMICE_FORMAT(R16_SFLOAT, 2),
    PUMICE_FORMAT(R16G16_SFLOAT, 4),
    PUMICE_FORMAT(R16G16B16A16_UNORM, 8),
    PUMICE_FORMAT(R16G16B16A16_SFLOAT, 8),
    PUMICE_FORMAT(R16G16B16A16_UINT, 8),
    PUMICE_FORMAT(R32_SFLOAT, 4),
    PUMICE_FORMAT(R32_UINT, 4),
    PUMICE_FORMAT(R32G32_SFLOAT, 8),
    PUMICE_FORMAT(R32G32B32A32_SFLOAT, 16),
    PUMICE_FORMAT(R32G32B32A32_UINT, 16),
    {VK_FORMAT_BC1_RGB_UNORM_BLOCK, "BC1", 8, 4},
    {VK_FORMAT_BC3_UNORM_BLOCK, "BC3", 16, 4},
    {VK_FORMAT_BC7_UNORM_BLOCK, "BC7", 16, 4},
    {VK_FORMAT_D16_UNORM, "D16", 2, 1, kDepth},
    {VK_FORMAT_D32_SFLOAT, "D32", 4, 1, kDepth},
    {VK_FORMAT_S8_UINT, "S8", 1, 1, kStencil},
    {VK_FORMAT_D32_SFLOAT_S8_UINT, "D32S8_depth", 4, 1, kDepth},
    {VK_FORMAT_D32_SFLOAT_S8_UINT, "D32S8_stencil", 1, 1, kStencil},
    {VK_FORMAT_D24_UNORM_S8_UINT, "D24S8_stencil", 1, 1, kStencil},
};

bool usable(const Device& device, VkFormat format) {
  VkFormatProperties properties{};
  vkGetPhysicalDeviceFormatProperties(device.physical, format, &properties);
  return properties.optimalTilingFeatures != 0;
}

// Bytes that are valid texels of the format: a depth of NaN may not be kept.
Bytes texels(const TexelFormat& format, size_t count, uint32_t seed) {
  Bytes out = noise(count * format.bytes, seed);
  if (format.aspect == kDepth && format.bytes == 4)
    for (size_t i = 0; i < count; ++i) {
      float value = float(out[i * 4] * 256 + out[i * 4 + 1]) / 65536.0f;
      std::memcpy(&out[i * 4], &value, 4);
    }
  return out;
}

TEST_P(Copy, BufferToImageAndBackForEveryFormat) {
  int covered = 0;
  for (const TexelFormat& format : kFormats) {
    if (!usable(device(), format.format)) continue;
    SCOPED_TRACE(format.name);
    ++covered;
    Workspace work(device());
    ImageSpec spec;
    spec.format = format.format;
    spec.extent = {44, 28, 1};
    spec.mips = 3;
    spec.layers = 3;
    Image image = work.image(spec);
    toGeneral(work, image);
    // A different picture for every subresource, with padded rows.
    for (uint32_t mip = 0; mip < spec.mips; ++mip)
      for (uint32_t layer = 0; layer < spec.layers; ++layer) {
        Piece piece;
        piece.mip = mip, piece.layer = layer;
        piece.extent = {44u >> mip, 28u >> mip, 1};
        piece.rowLength = 64, piece.imageHeight = 32, piece.bufferOffset = 32;
        size_t blocks = (64 / format.block) * (32 / format.block);
        Bytes data = texels(format, blocks + 32, mip * 8 + layer);
        upload(work, image, piece, data, format.aspect);
      }
    for (uint32_t mip = 0; mip < spec.mips; ++mip)
      for (uint32_t layer = 0; layer < spec.layers; ++layer) {
        size_t blocks = (64 / format.block) * (32 / format.block);
        Bytes data = texels(format, blocks + 32, mip * 8 + layer);
        uint32_t width = ((44u >> mip) + format.block - 1) / format.block;
        uint32_t height = ((28u >> mip) + format.block - 1) / format.block;
        Bytes expected;
        for (uint32_t y = 0; y < height; ++y) {
          auto row = data.begin() + 32 + long(y * (64 / format.block) * format.bytes);
          expected.insert(expected.end(), row, row + long(width * format.bytes));
        }
        Bytes found = download(work, image, mip, layer, format.aspect, format.bytes, format.block);
        ASSERT_EQ(firstDifference(found, expected), "") << "mip " << mip << " layer " << layer;
      }
  }
  EXPECT_GT(covered, 5) << "hardly a format is reported as supported";
}

TEST_P(Copy, SubRectanglesKeepTheirSurroundings) {
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {37, 29, 1};
  spec.layers = 4;
  Image image = work.image(spec);
  toGeneral(work, image);
  Bytes model = noise(37 * 29 * 4 * 4, 7);
  Piece all;
  all.layers = 4, all.extent = spec.extent;
  upload(work, image, all, model);
  uint32_t seed = 20;
  for (VkRect2D r : {VkRect2D{{0, 0}, {1, 1}},
                     {{36, 28}, {1, 1}},
                     {{5, 3}, {9, 11}},
                     {{13, 0}, {24, 2}},
                     {{0, 20}, {3, 9}},
                     {{7, 8}, {4, 4}}}) {
    Piece piece;
    piece.layer = 1, piece.layers = 2;  // two layers in one region
    piece.offset = {r.offset.x, r.offset.y, 0};
    piece.extent = {r.extent.width, r.extent.height, 1};
    piece.rowLength = 40, piece.imageHeight = 31;
    Bytes data = noise(40 * 31 * 2 * 4, ++seed);
    upload(work, image, piece, data);
    for (uint32_t l = 0; l < 2; ++l)
      for (uint32_t y = 0; y < r.extent.height; ++y)
        std::copy_n(
            data.begin() + ((l * 31 + y) * 40) * 4, r.extent.width * 4,
            model.begin() + (((l + 1) * 29 + uint32_t(r.offset.y) + y) * 37 + uint32_t(r.offset.x)) * 4);
  }
  for (uint32_t layer = 0; layer < 4; ++layer) {
    Bytes expected(model.begin() + layer * 37 * 29 * 4, model.begin() + (layer + 1) * 37 * 29 * 4);
    EXPECT_EQ(firstDifference(download(work, image, 0, layer, VK_IMAGE_ASPECT_COLOR_BIT, 4), expected), "")
        << "layer " << layer;
  }
}

TEST_P(Copy, ThreeDimensionalImages) {
  for (VkFormat format : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R8_UNORM}) {
    uint32_t texel = format == VK_FORMAT_R8_UNORM ? 1 : 4;
    Workspace work(device());
    ImageSpec spec;
    spec.format = format;
    spec.type = VK_IMAGE_TYPE_3D;
    spec.extent = {13, 11, 7};
    spec.mips = 2;
    Image image = work.image(spec);
    toGeneral(work, image);
    Bytes model = noise(13 * 11 * 7 * texel, 9);
    Piece all;
    all.extent = spec.extent;
    upload(work, image, all, model);
    Piece mip;
    mip.mip = 1, mip.extent = {6, 5, 3};
    Bytes small = noise(6 * 5 * 3 * texel, 10);
    upload(work, image, mip, small);
    Piece box;
    box.offset = {3, 2, 4}, box.extent = {5, 7, 3}, box.rowLength = 8, box.imageHeight = 9;
    Bytes data = noise(8 * 9 * 3 * texel, 11);
    upload(work, image, box, data);
    for (uint32_t z = 0; z < 3; ++z)
      for (uint32_t y = 0; y < 7; ++y)
        std::copy_n(data.begin() + ((z * 9 + y) * 8) * texel, 5 * texel,
                    model.begin() + (((z + 4) * 11 + y + 2) * 13 + 3) * texel);
    EXPECT_EQ(firstDifference(download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, texel), model), "");
    EXPECT_EQ(firstDifference(download(work, image, 1, 0, VK_IMAGE_ASPECT_COLOR_BIT, texel), small), "");
  }
}

TEST_P(Copy, OneDimensionalImages) {
  Workspace work(device());
  ImageSpec spec;
  spec.type = VK_IMAGE_TYPE_1D;
  spec.extent = {67, 1, 1};
  spec.layers = 5;
  spec.mips = 2;
  Image image = work.image(spec);
  toGeneral(work, image);
  for (uint32_t layer = 0; layer < 5; ++layer)
    for (uint32_t mip = 0; mip < 2; ++mip) {
      Piece piece;
      piece.layer = layer, piece.mip = mip, piece.extent = {67u >> mip, 1, 1};
      upload(work, image, piece, noise((67u >> mip) * 4, layer * 2 + mip));
    }
  for (uint32_t layer = 0; layer < 5; ++layer)
    for (uint32_t mip = 0; mip < 2; ++mip)
      EXPECT_EQ(firstDifference(download(work, image, mip, layer, VK_IMAGE_ASPECT_COLOR_BIT, 4),
                                noise((67u >> mip) * 4, layer * 2 + mip)),
                "");
}

TEST_P(Copy, ImageToImageAcrossMipsLayersAndFormatsOfEqualSize) {
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {40, 36, 1};
  spec.mips = 2;
  spec.layers = 3;
  Image from = work.image(spec);
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {33, 50, 1};
  spec.mips = 1;
  Image to = work.image(spec);
  toGeneral(work, from);
  toGeneral(work, to);
  Bytes source[3], target[3];
  for (uint32_t layer = 0; layer < 3; ++layer) {
    source[layer] = noise(20 * 18 * 4, 30 + layer);
    target[layer] = noise(33 * 50 * 4, 40 + layer);
    Piece piece;
    piece.layer = layer, piece.mip = 1, piece.extent = {20, 18, 1};
    upload(work, from, piece, source[layer]);
    piece.mip = 0, piece.extent = {33, 50, 1};
    upload(work, to, piece, target[layer]);
  }
  VkImageCopy region{};
  region.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 1, 1, 2};
  region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 2};
  region.srcOffset = {3, 5, 0};
  region.dstOffset = {14, 31, 0};
  region.extent = {17, 13, 1};
  device().run([&](VkCommandBuffer commands) {
    vkCmdCopyImage(commands, from.handle, VK_IMAGE_LAYOUT_GENERAL, to.handle, VK_IMAGE_LAYOUT_GENERAL, 1,
                   &region);
    fullBarrier(commands);
  });
  for (uint32_t l = 0; l < 2; ++l)
    for (uint32_t y = 0; y < 13; ++y)
      std::copy_n(source[l + 1].begin() + ((y + 5) * 20 + 3) * 4, 17 * 4,
                  target[l].begin() + ((y + 31) * 33 + 14) * 4);
  for (uint32_t layer = 0; layer < 3; ++layer)
    EXPECT_EQ(firstDifference(download(work, to, 0, layer, VK_IMAGE_ASPECT_COLOR_BIT, 4), target[layer]), "")
        << "layer " << layer;
}

TEST_P(Copy, ImageToItselfBetweenLayers) {
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {21, 19, 1};
  spec.layers = 2;
  Image image = work.image(spec);
  toGeneral(work, image);
  Bytes first = noise(21 * 19 * 4, 50), second = noise(21 * 19 * 4, 51);
  Piece piece;
  piece.extent = spec.extent;
  upload(work, image, piece, first);
  piece.layer = 1;
  upload(work, image, piece, second);
  VkImageCopy region{};
  region.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 1};
  region.srcOffset = {1, 2, 0};
  region.dstOffset = {6, 4, 0};
  region.extent = {15, 15, 1};
  device().run([&](VkCommandBuffer commands) {
    vkCmdCopyImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1,
                   &region);
    fullBarrier(commands);
  });
  for (uint32_t y = 0; y < 15; ++y)
    std::copy_n(first.begin() + ((y + 2) * 21 + 1) * 4, 15 * 4, second.begin() + ((y + 4) * 21 + 6) * 4);
  EXPECT_EQ(firstDifference(download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4), first), "");
  EXPECT_EQ(firstDifference(download(work, image, 0, 1, VK_IMAGE_ASPECT_COLOR_BIT, 4), second), "");
}

TEST_P(Copy, DepthAndStencilAspectsAreSeparate) {
  for (VkFormat format : {VK_FORMAT_D32_SFLOAT_S8_UINT, VK_FORMAT_D24_UNORM_S8_UINT}) {
    if (!usable(device(), format)) continue;
    SCOPED_TRACE(format);
    Workspace work(device());
    ImageSpec spec;
    spec.format = format;
    spec.extent = {19, 17, 1};
    Image image = work.image(spec), copy = work.image(spec);
    toGeneral(work, image);
    toGeneral(work, copy);
    Piece piece;
    piece.extent = spec.extent;
    Bytes depth = texels({format, "", 4, 1, kDepth}, 19 * 17, 60);
    if (format == VK_FORMAT_D24_UNORM_S8_UINT)
      for (size_t i = 3; i < depth.size(); i += 4) depth[i] = 0;  // undefined bits
    Bytes stencil = noise(19 * 17, 61);
    upload(work, image, piece, depth, kDepth);
    upload(work, image, piece, stencil, kStencil);
    VkImageCopy region{};
    region.srcSubresource = region.dstSubresource = {kDepth | kStencil, 0, 0, 1};
    region.extent = spec.extent;
    device().run([&](VkCommandBuffer commands) {
      vkCmdCopyImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, copy.handle, VK_IMAGE_LAYOUT_GENERAL, 1,
                     &region);
      fullBarrier(commands);
    });
    for (const Image& i : {image, copy}) {
      Bytes found = download(work, i, 0, 0, kDepth, 4);
      if (format == VK_FORMAT_D24_UNORM_S8_UINT)
        for (size_t k = 3; k < found.size(); k += 4) found[k] = 0;
      EXPECT_EQ(firstDifference(found, depth), "") << "depth";
      EXPECT_EQ(firstDifference(download(work, i, 0, 0, kStencil, 1), stencil), "") << "stencil";
    }
  }
}

TEST_P(Copy, LinearImagesAreLaidOutAsReported) {
  VkFormatProperties properties{};
  vkGetPhysicalDeviceFormatProperties(device().physical, VK_FORMAT_R8G8B8A8_UNORM, &properties);
  if (properties.linearTilingFeatures == 0) GTEST_SKIP() << "no linear RGBA8 images reported";
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {29, 17, 1};
  spec.tiling = VK_IMAGE_TILING_LINEAR;
  Image image = work.image(spec);
  toGeneral(work, image);
  Bytes data = noise(29 * 17 * 4, 70);
  Piece piece;
  piece.extent = spec.extent;
  upload(work, image, piece, data);
  VkImageSubresource which{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0};
  VkSubresourceLayout layout{};
  vkGetImageSubresourceLayout(device().handle, image.handle, &which, &layout);
  EXPECT_GE(layout.rowPitch, 29u * 4);
  // Read through a buffer bound to the same memory would alias; mapping is simpler.
  void* mapped = nullptr;
  if (vkMapMemory(device().handle, image.memory, 0, VK_WHOLE_SIZE, 0, &mapped) != VK_SUCCESS)
    GTEST_SKIP() << "linear images are not in host-visible memory";
  Bytes found;
  for (uint32_t y = 0; y < 17; ++y) {
    auto row = static_cast<const uint8_t*>(mapped) + layout.offset + y * layout.rowPitch;
    found.insert(found.end(), row, row + 29 * 4);
  }
  vkUnmapMemory(device().handle, image.memory);
  EXPECT_EQ(firstDifference(found, data), "");
}

PUMICE_ON_BOTH_DEVICES(Copy);

}  // namespace
}  // namespace pumice::cts
