// Blits, resolves and presentation against references in double precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tests/texture/test_image.h"
#include "texture/cleared.h"

namespace pumice::texture {
namespace {

constexpr VkImageAspectFlags kColor = VK_IMAGE_ASPECT_COLOR_BIT;

double channel(uint32_t pixel, int c) { return pixel >> (8 * c) & 0xff; }

// RGBA8 to RGBA8, in codes before rounding.
double referenceBlit(TestImage& src, const VkImageBlit& r, VkFilter filter, int dx, int dy, int c) {
  auto map = [](int i, int s0, int s1, int d0, int d1) { return (i + 0.5 - d0) * (s1 - s0) / double(d1 - d0) + s0; };
  double u = map(dx, r.srcOffsets[0].x, r.srcOffsets[1].x, r.dstOffsets[0].x, r.dstOffsets[1].x);
  double v = map(dy, r.srcOffsets[0].y, r.srcOffsets[1].y, r.dstOffsets[0].y, r.dstOffsets[1].y);
  int w = int(src.layout.extent.width), h = int(src.layout.extent.height);
  auto texel = [&](double x, double y) {
    return channel(src.pixel(uint32_t(std::clamp(int(x), 0, w - 1)), uint32_t(std::clamp(int(y), 0, h - 1))), c);
  };
  if (filter == VK_FILTER_NEAREST) return texel(std::floor(u), std::floor(v));
  double x = std::floor(u - 0.5), y = std::floor(v - 0.5), a = u - 0.5 - x, b = v - 0.5 - y;
  return (1 - b) * ((1 - a) * texel(x, y) + a * texel(x + 1, y)) + b * ((1 - a) * texel(x, y + 1) + a * texel(x + 1, y + 1));
}

void expectBlit(VkExtent3D sourceSize, VkExtent3D targetSize, VkOffset3D s0, VkOffset3D s1, VkOffset3D d0, VkOffset3D d1, VkFilter filter) {
  base::ThreadPool pool(2);
  TestImage src(VK_FORMAT_R8G8B8A8_UNORM, sourceSize), dst(VK_FORMAT_R8G8B8A8_UNORM, targetSize);
  src.randomise(1);
  dst.randomise(2);
  TestImage before = dst;
  VkImageBlit r{{kColor, 0, 0, 1}, {s0, s1}, {kColor, 0, 0, 1}, {d0, d1}};
  blitImage(pool, src.memory(), dst.memory(), r, filter);
  for (int y = 0; y < int(targetSize.height); ++y)
    for (int x = 0; x < int(targetSize.width); ++x) {
      bool inside = x >= std::min(d0.x, d1.x) && x < std::max(d0.x, d1.x) && y >= std::min(d0.y, d1.y) && y < std::max(d0.y, d1.y);
      if (!inside) {
        ASSERT_EQ(dst.pixel(uint32_t(x), uint32_t(y)), before.pixel(uint32_t(x), uint32_t(y))) << x << ' ' << y;
        continue;
      }
      for (int c = 0; c < 4; ++c)
        ASSERT_NEAR(channel(dst.pixel(uint32_t(x), uint32_t(y)), c), referenceBlit(src, r, filter, x, y, c), filter == VK_FILTER_NEAREST ? 0.0 : 0.5005) << x << ' ' << y;
    }
}

TEST(Blit, FollowsTheScalingFormula) {
  for (VkFilter f : {VK_FILTER_NEAREST, VK_FILTER_LINEAR}) {
    expectBlit({16, 16, 1}, {16, 16, 1}, {0, 0, 0}, {16, 16, 1}, {0, 0, 0}, {16, 16, 1}, f);
    expectBlit({16, 16, 1}, {8, 8, 1}, {0, 0, 0}, {16, 16, 1}, {0, 0, 0}, {8, 8, 1}, f);
    expectBlit({16, 16, 1}, {61, 47, 1}, {0, 0, 0}, {16, 16, 1}, {0, 0, 0}, {61, 47, 1}, f);
    expectBlit({40, 30, 1}, {33, 35, 1}, {3, 5, 0}, {30, 22, 1}, {2, 4, 0}, {31, 33, 1}, f);
    expectBlit({40, 30, 1}, {33, 35, 1}, {30, 5, 0}, {3, 22, 1}, {2, 4, 0}, {31, 33, 1}, f);
    expectBlit({40, 30, 1}, {33, 35, 1}, {3, 5, 0}, {30, 22, 1}, {2, 33, 0}, {31, 4, 1}, f);
    expectBlit({40, 30, 1}, {500, 400, 1}, {0, 0, 0}, {40, 30, 1}, {10, 10, 0}, {490, 390, 1}, f);
  }
}

TEST(Blit, ConvertsFormats) {
  base::ThreadPool pool(1);
  TestImage src(VK_FORMAT_R8G8B8A8_UNORM, {9, 5, 1});
  src.randomise(4);
  VkImageBlit r{{kColor, 0, 0, 1}, {{0, 0, 0}, {9, 5, 1}}, {kColor, 0, 0, 1}, {{0, 0, 0}, {9, 5, 1}}};
  TestImage swapped(VK_FORMAT_B8G8R8A8_UNORM, {9, 5, 1}), srgb(VK_FORMAT_R8G8B8A8_SRGB, {9, 5, 1}), half(VK_FORMAT_R32G32B32A32_SFLOAT, {9, 5, 1}), back = src;
  blitImage(pool, src.memory(), swapped.memory(), r, VK_FILTER_NEAREST);
  blitImage(pool, src.memory(), srgb.memory(), r, VK_FILTER_NEAREST);
  blitImage(pool, src.memory(), half.memory(), r, VK_FILTER_NEAREST);
  back.randomise(5);
  blitImage(pool, half.memory(), back.memory(), r, VK_FILTER_NEAREST);
  for (uint32_t y = 0; y < 5; ++y)
    for (uint32_t x = 0; x < 9; ++x) {
      uint32_t p = src.pixel(x, y);
      EXPECT_EQ(swapped.pixel(x, y), (p & 0xff00ff00u) | (p >> 16 & 0xff) | (p & 0xff) << 16);
      EXPECT_EQ(back.pixel(x, y), p);
      float f[4];
      std::memcpy(f, half.element(kColor, 0, 0, x, y), 16);
      for (int c = 0; c < 4; ++c) {
        double u = channel(p, c) / 255;
        EXPECT_EQ(f[c], float(u));
        double s = c == 3 ? u : u <= 0.0031308 ? 12.92 * u : 1.055 * std::pow(u, 1 / 2.4) - 0.055;
        EXPECT_EQ(channel(srgb.pixel(x, y), c), std::nearbyint(s * 255));
      }
    }
}

TEST(Blit, LevelsLayersAndSlices) {
  base::ThreadPool pool(1);
  TestImage chain(VK_FORMAT_R8G8B8A8_UNORM, {8, 8, 1}, 4, 3);
  for (uint32_t layer = 0; layer < 3; ++layer)
    for (uint32_t y = 0; y < 8; ++y)
      for (uint32_t x = 0; x < 8; ++x) chain.setPixel(x, y, 10 * layer + (x / 2 + y / 2) * 4 + (x & 1) * 2, 0, layer);
  VkImageBlit r{{kColor, 0, 1, 2}, {{0, 0, 0}, {8, 8, 1}}, {kColor, 1, 1, 2}, {{0, 0, 0}, {4, 4, 1}}};
  blitImage(pool, chain.memory(), chain.memory(), r, VK_FILTER_LINEAR);
  for (uint32_t layer = 1; layer < 3; ++layer)
    for (uint32_t y = 0; y < 4; ++y)
      for (uint32_t x = 0; x < 4; ++x) EXPECT_EQ(chain.pixel(x, y, 1, layer), 10 * layer + (x + y) * 4 + 1);
  EXPECT_EQ(chain.pixel(1, 1, 1, 0), 0u);

  TestImage volume(VK_FORMAT_R8_UNORM, {4, 4, 4}, 1, 1, VK_IMAGE_TYPE_3D), smaller(VK_FORMAT_R8_UNORM, {4, 4, 2}, 1, 1, VK_IMAGE_TYPE_3D);
  for (uint32_t z = 0; z < 4; ++z)
    for (uint32_t y = 0; y < 4; ++y)
      for (uint32_t x = 0; x < 4; ++x) *volume.element(kColor, 0, 0, x, y, z) = std::byte(z * 40 + x);
  VkImageBlit v{{kColor, 0, 0, 1}, {{0, 0, 0}, {4, 4, 4}}, {kColor, 0, 0, 1}, {{0, 0, 2}, {4, 4, 0}}};
  blitImage(pool, volume.memory(), smaller.memory(), v, VK_FILTER_LINEAR);
  for (uint32_t x = 0; x < 4; ++x) {
    EXPECT_EQ(int(*smaller.element(kColor, 0, 0, x, 2, 1)), int(20 + x));  // mirrored in z
    EXPECT_EQ(int(*smaller.element(kColor, 0, 0, x, 2, 0)), int(100 + x));
  }
}

TEST(Blit, DepthAndStencilKeepTheirBits) {
  base::ThreadPool pool(1);
  constexpr VkImageAspectFlags kBoth = VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT;
  for (VkFormat f : {VK_FORMAT_D24_UNORM_S8_UINT, VK_FORMAT_D32_SFLOAT_S8_UINT}) {
    TestImage src(f, {8, 8, 1}), dst(f, {16, 16, 1});
    src.randomise(1);
    VkImageBlit r{{kBoth, 0, 0, 1}, {{0, 0, 0}, {8, 8, 1}}, {kBoth, 0, 0, 1}, {{0, 0, 0}, {16, 16, 1}}};
    blitImage(pool, src.memory(), dst.memory(), r, VK_FILTER_NEAREST);
    for (uint32_t y = 0; y < 16; ++y)
      for (uint32_t x = 0; x < 16; ++x) {
        EXPECT_EQ(std::memcmp(dst.element(VK_IMAGE_ASPECT_DEPTH_BIT, 0, 0, x, y), src.element(VK_IMAGE_ASPECT_DEPTH_BIT, 0, 0, x / 2, y / 2), 4), 0);
        EXPECT_EQ(*dst.element(VK_IMAGE_ASPECT_STENCIL_BIT, 0, 0, x, y), *src.element(VK_IMAGE_ASPECT_STENCIL_BIT, 0, 0, x / 2, y / 2));
      }
  }
}

TEST(Resolve, AveragesSamples) {
  base::ThreadPool pool(1);
  TestImage src(VK_FORMAT_R8G8B8A8_UNORM, {21, 13, 1}, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL, VK_SAMPLE_COUNT_4_BIT), dst(VK_FORMAT_R8G8B8A8_UNORM, {30, 20, 1});
  src.randomise(1);
  resolveImage(pool, src.memory(), dst.memory(), {{kColor, 0, 0, 1}, {2, 1, 0}, {kColor, 0, 0, 1}, {5, 6, 0}, {17, 11, 1}});
  for (uint32_t y = 0; y < 20; ++y)
    for (uint32_t x = 0; x < 30; ++x) {
      bool inside = x >= 5 && x < 22 && y >= 6 && y < 17;
      for (int c = 0; c < 4; ++c) {
        double sum = 0;
        for (uint32_t s = 0; inside && s < 4; ++s) {
          uint32_t v;
          std::memcpy(&v, src.element(kColor, 0, 0, x - 3, y - 5, 0, s), 4);
          sum += channel(v, c) / 4;
        }
        ASSERT_NEAR(channel(dst.pixel(x, y), c), sum, inside ? 0.5001 : 0.0);
      }
    }
  TestImage ints(VK_FORMAT_R32_UINT, {8, 8, 1}, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL, VK_SAMPLE_COUNT_4_BIT), one(VK_FORMAT_R32_UINT, {8, 8, 1});
  ints.randomise(3);
  resolveImage(pool, ints.memory(), one.memory(), {{kColor, 0, 0, 1}, {}, {kColor, 0, 0, 1}, {}, {8, 8, 1}});
  EXPECT_EQ(one.pixel(5, 6), ints.pixel(5, 6));
}

// Blocks whose samples agree: every value of small components, all kinds of floats.
TEST(Resolve, BlocksOfEqualSamplesHaveTheBitsOfTheAverage) {
  base::ThreadPool pool(1);
  uint32_t formats = 0;
  for (const FormatInfo& f : allFormats()) {
    if (!(optimalFeatures(f) & VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BIT) || f.isDepthStencil()) continue;
    ++formats;
    SCOPED_TRACE(f.name);
    for (uint32_t samples : {2u, 4u, 16u}) {
      const uint32_t side = samples == 2 ? 258 : 35;
      TestImage src(f.format, {side, side, 1}, 1, 2, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL, VkSampleCountFlagBits(samples));
      TestImage average(f.format, {side + 3, side, 1}, 1, 2), blocks(f.format, {side + 3, side, 1}, 1, 2);
      src.randomise(samples);
      const uint32_t bytes = src.layout.planes[0].elementBytes;
      uint32_t count = 0;
      for (uint32_t y = 0; y < side; ++y)
        for (uint32_t x = 0; x < side; ++x, ++count) {
          std::byte* first = src.element(kColor, 0, 1, x, y);
          const uint32_t number = count * 0x10001u;   // all 16-bit words
          std::memcpy(first, &number, std::min(bytes, 4u));
          for (uint32_t s = 1; s < samples; ++s) std::memcpy(src.element(kColor, 0, 1, x, y, 0, s), first, bytes);
        }
      const VkImageResolve region{{kColor, 0, 1, 1}, {2, 1, 0}, {kColor, 0, 1, 1}, {2, 1, 0}, {side - 3, side - 1, 1}};
      resolveImage(pool, src.memory(), average.memory(), region);
      std::vector<BlockResolve::Block> all;
      for (uint32_t y = 0; y < side; y += 4)
        for (uint32_t x = 0; x < side; x += 4) all.push_back({uint16_t(x), uint16_t(y)});
      const BlockResolve resolve(src.memory(), blocks.memory(), region);
      resolve.blocks(0, all, false);
      ASSERT_TRUE(blocks.storage == average.storage) << samples << " samples, block by block";
      std::fill(blocks.storage.begin(), blocks.storage.end(), 0);
      for (uint32_t y = 0; y < side; ++y)
        for (uint32_t x = 0; x < side; ++x)
          for (uint32_t s = 1; s < samples; ++s) std::memset(src.element(kColor, 0, 1, x, y, 0, s), 0x55, bytes);   // nobody looks at them
      resolve.blocks(0, all, true);
      ASSERT_TRUE(blocks.storage == average.storage) << samples << " samples, of the first alone";
    }
  }
  EXPECT_GT(formats, 40u);
}

// Marked tiles and others, on one thread and on several: the same rows as from memory.
TEST(Present, FindsTilesThatAreOnlyMarked) {
  base::ThreadPool pool(2);
  for (VkFormat f : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_B8G8R8A8_SRGB})
    for (uint32_t every : {1u, 2u, 5u, 1000u}) {
      const uint32_t width = 1301, height = 403, pitch = 5216;
      TestImage image(f, {width, height, 1});
      image.randomise(1);
      ClearedTiles cleared(width, height);
      const uint8_t element[4] = {1, 20, 200, 77};
      std::memcpy(cleared.element, element, 4);
      for (size_t i = 0; i < cleared.marks.size(); ++i) cleared.marks[i] = i % every == 0;
      ImageMemory memory = image.memory();
      memory.cleared = &cleared;
      std::vector<std::byte> marked(pitch * height, std::byte(0x77)), written = marked;
      presentRows(pool, memory, marked.data(), pitch, {width, height});
      writeCleared(memory);
      EXPECT_EQ(std::count(cleared.marks.begin(), cleared.marks.end(), 1), 0);
      EXPECT_EQ(std::memcmp(image.element(kColor, 0, 0, 0, 0), element, 4), 0);
      presentRows(pool, image.memory(), written.data(), pitch, {width, height});
      EXPECT_TRUE(marked == written) << formatInfo(f)->name << ", every " << every;
    }
}

TEST(Present, GivesRowsOfBgra) {
  base::ThreadPool pool(2);
  for (VkFormat f : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_B8G8R8A8_SRGB, VK_FORMAT_R8G8B8A8_SRGB, VK_FORMAT_R5G6B5_UNORM_PACK16, VK_FORMAT_A2B10G10R10_UNORM_PACK32}) {
    SCOPED_TRACE(formatInfo(f)->name);
    TestImage image(f, {301, 203, 1});
    image.randomise(1);
    // Rows on whole vectors, and not.
    const uint32_t pitch = f == VK_FORMAT_R8G8B8A8_UNORM || f == VK_FORMAT_B8G8R8A8_SRGB ? 1312 : 1300;
    std::vector<std::byte> rows(pitch * 203, std::byte(0x77));
    presentRows(pool, image.memory(), rows.data(), pitch, {301, 203});
    for (uint32_t y = 0; y < 203; ++y) {
      for (uint32_t x = 0; x < 301; ++x) {
        uint32_t got, v = 0;
        std::memcpy(&got, &rows[y * pitch + 4 * x], 4);
        std::memcpy(&v, image.element(kColor, 0, 0, x, y), image.layout.planes[0].elementBytes);
        uint32_t want;
        if (f == VK_FORMAT_B8G8R8A8_SRGB) {
          want = v;
        } else if (f == VK_FORMAT_R5G6B5_UNORM_PACK16) {
          auto scale = [](uint32_t c, double most) { return uint32_t(std::nearbyint(c * 255 / most)); };
          want = 0xff000000u | scale(v >> 11, 31) << 16 | scale(v >> 5 & 63, 63) << 8 | scale(v & 31, 31);
        } else if (f == VK_FORMAT_A2B10G10R10_UNORM_PACK32) {
          auto scale = [](uint32_t c, double most) { return uint32_t(std::nearbyint(c * 255 / most)); };
          want = scale(v >> 30, 3) << 24 | scale(v & 1023, 1023) << 16 | scale(v >> 10 & 1023, 1023) << 8 | scale(v >> 20 & 1023, 1023);
        } else {
          want = (v & 0xff00ff00u) | (v >> 16 & 0xff) | (v & 0xff) << 16;
        }
        ASSERT_EQ(got, want) << x << ' ' << y;
      }
      for (uint32_t i = 301 * 4; i < pitch; ++i) ASSERT_EQ(rows[y * pitch + i], std::byte(0x77));
    }
  }
}

}  // namespace
}  // namespace pumice::texture
