#include "texture/format.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

namespace pumice::texture {
namespace {

void expectComponents(VkFormat format, unsigned bytes, std::initializer_list<Component> rgba) {
  const FormatInfo* f = formatInfo(format);
  ASSERT_NE(f, nullptr);
  SCOPED_TRACE(f->name);
  EXPECT_EQ(f->format, format);
  EXPECT_EQ(f->elementBytes, bytes);
  size_t i = 0;
  for (Component c : rgba) {
    EXPECT_EQ(f->rgba[i].bits, c.bits) << i;
    if (c.bits) {
      EXPECT_EQ(f->rgba[i].shift, c.shift) << i;
      EXPECT_EQ(f->rgba[i].numeric, c.numeric) << i;
    }
    ++i;
  }
}

TEST(FormatTable, BitsFollowFromTheNames) {
  using enum Numeric;
  expectComponents(VK_FORMAT_R8G8B8A8_UNORM, 4, {{8, 0, Unorm}, {8, 8, Unorm}, {8, 16, Unorm}, {8, 24, Unorm}});
  expectComponents(VK_FORMAT_B8G8R8A8_SRGB, 4, {{8, 16, Srgb}, {8, 8, Srgb}, {8, 0, Srgb}, {8, 24, Unorm}});
  expectComponents(VK_FORMAT_A8B8G8R8_SINT_PACK32, 4, {{8, 0, Sint}, {8, 8, Sint}, {8, 16, Sint}, {8, 24, Sint}});
  expectComponents(VK_FORMAT_R5G6B5_UNORM_PACK16, 2, {{5, 11, Unorm}, {6, 5, Unorm}, {5, 0, Unorm}, {}});
  expectComponents(VK_FORMAT_A1R5G5B5_UNORM_PACK16, 2, {{5, 10, Unorm}, {5, 5, Unorm}, {5, 0, Unorm}, {1, 15, Unorm}});
  expectComponents(VK_FORMAT_A2B10G10R10_UINT_PACK32, 4, {{10, 0, Uint}, {10, 10, Uint}, {10, 20, Uint}, {2, 30, Uint}});
  expectComponents(VK_FORMAT_B10G11R11_UFLOAT_PACK32, 4, {{11, 0, Ufloat}, {11, 11, Ufloat}, {10, 22, Ufloat}, {}});
  expectComponents(VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, 4, {{9, 0, Ufloat}, {9, 9, Ufloat}, {9, 18, Ufloat}, {}});
  expectComponents(VK_FORMAT_R16G16B16_SFLOAT, 6, {{16, 0, Sfloat}, {16, 16, Sfloat}, {16, 32, Sfloat}, {}});
  expectComponents(VK_FORMAT_R64G64B64A64_UINT, 32, {{64, 0, Uint}, {64, 64, Uint}, {64, 128, Uint}, {64, 192, Uint}});
  expectComponents(VK_FORMAT_D16_UNORM, 2, {{16, 0, Unorm}, {}, {}, {}});
  expectComponents(VK_FORMAT_X8_D24_UNORM_PACK32, 4, {{24, 0, Unorm}, {}, {}, {}});
  expectComponents(VK_FORMAT_D24_UNORM_S8_UINT, 4, {{24, 0, Unorm}, {8, 0, Uint}, {}, {}});
  expectComponents(VK_FORMAT_D32_SFLOAT_S8_UINT, 4, {{32, 0, Sfloat}, {8, 0, Uint}, {}, {}});
  expectComponents(VK_FORMAT_S8_UINT, 1, {{8, 0, Uint}, {}, {}, {}});
  expectComponents(VK_FORMAT_R10X6_UNORM_PACK16, 2, {{10, 6, Unorm}, {}, {}, {}});
  expectComponents(VK_FORMAT_R12X4G12X4_UNORM_2PACK16, 4, {{12, 4, Unorm}, {12, 20, Unorm}, {}, {}});
  expectComponents(VK_FORMAT_BC1_RGB_SRGB_BLOCK, 8, {{8, 0, Srgb}, {8, 0, Srgb}, {8, 0, Srgb}, {}});
  expectComponents(VK_FORMAT_BC3_UNORM_BLOCK, 16, {{8, 0, Unorm}, {8, 0, Unorm}, {8, 0, Unorm}, {8, 0, Unorm}});
  expectComponents(VK_FORMAT_BC4_SNORM_BLOCK, 8, {{8, 0, Snorm}, {}, {}, {}});
  expectComponents(VK_FORMAT_BC6H_SFLOAT_BLOCK, 16, {{16, 0, Sfloat}, {16, 0, Sfloat}, {16, 0, Sfloat}, {}});
}

TEST(FormatTable, PlanesFollowFromTheNames) {
  struct Case {
    VkFormat format;
    uint8_t shift[2];
    std::vector<VkFormat> planes;
    uint8_t place[3][2];   // of R, G and B: plane and component
  };
  const Case cases[] = {
      {VK_FORMAT_G8_B8_R8_3PLANE_420_UNORM, {1, 1}, {VK_FORMAT_R8_UNORM, VK_FORMAT_R8_UNORM, VK_FORMAT_R8_UNORM}, {{2, 0}, {0, 0}, {1, 0}}},
      {VK_FORMAT_G8_B8R8_2PLANE_420_UNORM, {1, 1}, {VK_FORMAT_R8_UNORM, VK_FORMAT_R8G8_UNORM}, {{1, 1}, {0, 0}, {1, 0}}},
      {VK_FORMAT_G8_B8R8_2PLANE_422_UNORM, {1, 0}, {VK_FORMAT_R8_UNORM, VK_FORMAT_R8G8_UNORM}, {{1, 1}, {0, 0}, {1, 0}}},
      {VK_FORMAT_G8_B8_R8_3PLANE_444_UNORM, {0, 0}, {VK_FORMAT_R8_UNORM, VK_FORMAT_R8_UNORM, VK_FORMAT_R8_UNORM}, {{2, 0}, {0, 0}, {1, 0}}},
      {VK_FORMAT_G10X6_B10X6R10X6_2PLANE_420_UNORM_3PACK16, {1, 1}, {VK_FORMAT_R10X6_UNORM_PACK16, VK_FORMAT_R10X6G10X6_UNORM_2PACK16}, {{1, 1}, {0, 0}, {1, 0}}},
      {VK_FORMAT_G12X4_B12X4_R12X4_3PLANE_422_UNORM_3PACK16, {1, 0}, {VK_FORMAT_R12X4_UNORM_PACK16, VK_FORMAT_R12X4_UNORM_PACK16, VK_FORMAT_R12X4_UNORM_PACK16},
       {{2, 0}, {0, 0}, {1, 0}}},
      {VK_FORMAT_G16_B16R16_2PLANE_444_UNORM, {0, 0}, {VK_FORMAT_R16_UNORM, VK_FORMAT_R16G16_UNORM}, {{1, 1}, {0, 0}, {1, 0}}},
  };
  for (const Case& c : cases) {
    const FormatInfo& f = *formatInfo(c.format);
    SCOPED_TRACE(f.name);
    ASSERT_EQ(f.planeCount, c.planes.size());
    for (int i = 0; i < 2; ++i) EXPECT_EQ(f.chromaShift[i], c.shift[i]);
    for (size_t p = 0; p < c.planes.size(); ++p) EXPECT_EQ(f.planeFormats[p], c.planes[p]) << p;
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(f.componentPlane[k], c.place[k][0]) << k;
      EXPECT_EQ(f.componentInPlane[k], c.place[k][1]) << k;
      EXPECT_EQ(f.rgba[k].bits, formatInfo(c.planes[0])->rgba[0].bits) << k;
    }
  }
}

TEST(FormatTable, EveryFormatIsConsistent) {
  EXPECT_EQ(allFormats().size(), 176u);
  EXPECT_EQ(formatKey(*formatInfo(VK_FORMAT_A4R4G4B4_UNORM_PACK16)), 147u);
  EXPECT_EQ(formatInfo(VK_FORMAT_UNDEFINED), nullptr);
  EXPECT_EQ(formatInfo(VK_FORMAT_ETC2_R8G8B8_UNORM_BLOCK), nullptr);
  EXPECT_EQ(formatInfo(VkFormat(1000156000)), nullptr);
  EXPECT_EQ(formatInfo(VkFormat(147)), nullptr);
  for (const FormatInfo& f : allFormats()) {
    SCOPED_TRACE(f.name);
    EXPECT_EQ(formatInfo(f.format), &f);
    EXPECT_GT(f.elementBytes, 0);
    unsigned used = 0;
    for (const Component& c : f.rgba) {
      if (!c.bits) continue;
      EXPECT_NE(c.numeric, Numeric::None);
      if (!f.isCompressed()) { EXPECT_LE(unsigned(c.shift) + c.bits, unsigned(f.elementBytes) * 8); }
      used += c.bits;
    }
    if (!f.isCompressed() && !f.isDepthStencil() && !(f.flags & (kSharedExponent | kPadded16))) { EXPECT_EQ(used, unsigned(f.elementBytes) * 8); }
    EXPECT_TRUE(compatible(f, f));
  }
  EXPECT_TRUE(compatible(*formatInfo(VK_FORMAT_R8G8B8A8_UNORM), *formatInfo(VK_FORMAT_R32_UINT)));
  EXPECT_FALSE(compatible(*formatInfo(VK_FORMAT_R8G8B8A8_UNORM), *formatInfo(VK_FORMAT_D32_SFLOAT)));
  EXPECT_FALSE(compatible(*formatInfo(VK_FORMAT_R32G32_UINT), *formatInfo(VK_FORMAT_BC1_RGB_UNORM_BLOCK)));
}

// Vulkan spec, "Required Format Support". Letters: s sampled and blit source, l linear filter, i storage image, a its
// atomics, c colour attachment and blit destination, b blend, v vertex buffer, u uniform and t storage texel
// buffer, x its atomics, d depth/stencil attachment.
struct Required {
  VkFormat format;
  const char* features;
};
constexpr Required kRequired[] = {
    {VK_FORMAT_B4G4R4A4_UNORM_PACK16, "sl"},
    {VK_FORMAT_R5G6B5_UNORM_PACK16, "slcb"},
    {VK_FORMAT_A1R5G5B5_UNORM_PACK16, "slcb"},
    {VK_FORMAT_R8_UNORM, "slcbvu"},
    {VK_FORMAT_R8_SNORM, "slvu"},
    {VK_FORMAT_R8_UINT, "scvu"},
    {VK_FORMAT_R8_SINT, "scvu"},
    {VK_FORMAT_R8G8_UNORM, "slcbvu"},
    {VK_FORMAT_R8G8_SNORM, "slvu"},
    {VK_FORMAT_R8G8_UINT, "scvu"},
    {VK_FORMAT_R8G8_SINT, "scvu"},
    {VK_FORMAT_R8G8B8A8_UNORM, "slicbvut"},
    {VK_FORMAT_R8G8B8A8_SNORM, "slivut"},
    {VK_FORMAT_R8G8B8A8_UINT, "sicvut"},
    {VK_FORMAT_R8G8B8A8_SINT, "sicvut"},
    {VK_FORMAT_R8G8B8A8_SRGB, "slcb"},
    {VK_FORMAT_B8G8R8A8_UNORM, "slcbvu"},
    {VK_FORMAT_B8G8R8A8_SRGB, "slcb"},
    {VK_FORMAT_A8B8G8R8_UNORM_PACK32, "slcbvut"},
    {VK_FORMAT_A8B8G8R8_SNORM_PACK32, "slvut"},
    {VK_FORMAT_A8B8G8R8_UINT_PACK32, "scvut"},
    {VK_FORMAT_A8B8G8R8_SINT_PACK32, "scvut"},
    {VK_FORMAT_A8B8G8R8_SRGB_PACK32, "slcb"},
    {VK_FORMAT_A2B10G10R10_UNORM_PACK32, "slcbvu"},
    {VK_FORMAT_A2B10G10R10_UINT_PACK32, "scu"},
    {VK_FORMAT_R16_UNORM, "v"},
    {VK_FORMAT_R16_SNORM, "v"},
    {VK_FORMAT_R16_UINT, "scvu"},
    {VK_FORMAT_R16_SINT, "scvu"},
    {VK_FORMAT_R16_SFLOAT, "slcbvu"},
    {VK_FORMAT_R16G16_UNORM, "v"},
    {VK_FORMAT_R16G16_SNORM, "v"},
    {VK_FORMAT_R16G16_UINT, "scvu"},
    {VK_FORMAT_R16G16_SINT, "scvu"},
    {VK_FORMAT_R16G16_SFLOAT, "slcbvu"},
    {VK_FORMAT_R16G16B16A16_UNORM, "v"},
    {VK_FORMAT_R16G16B16A16_SNORM, "v"},
    {VK_FORMAT_R16G16B16A16_UINT, "sicvut"},
    {VK_FORMAT_R16G16B16A16_SINT, "sicvut"},
    {VK_FORMAT_R16G16B16A16_SFLOAT, "slicbvut"},
    {VK_FORMAT_R32_UINT, "siacvutx"},
    {VK_FORMAT_R32_SINT, "siacvutx"},
    {VK_FORMAT_R32_SFLOAT, "sicvut"},
    {VK_FORMAT_R32G32_UINT, "sicvut"},
    {VK_FORMAT_R32G32_SINT, "sicvut"},
    {VK_FORMAT_R32G32_SFLOAT, "sicvut"},
    {VK_FORMAT_R32G32B32_UINT, "v"},
    {VK_FORMAT_R32G32B32_SINT, "v"},
    {VK_FORMAT_R32G32B32_SFLOAT, "v"},
    {VK_FORMAT_R32G32B32A32_UINT, "sicvut"},
    {VK_FORMAT_R32G32B32A32_SINT, "sicvut"},
    {VK_FORMAT_R32G32B32A32_SFLOAT, "sicvut"},
    {VK_FORMAT_B10G11R11_UFLOAT_PACK32, "slu"},
    {VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, "sl"},
    {VK_FORMAT_D16_UNORM, "sd"},
    {VK_FORMAT_X8_D24_UNORM_PACK32, "d"},
    {VK_FORMAT_D32_SFLOAT, "sd"},
    {VK_FORMAT_D24_UNORM_S8_UINT, "d"},
};

TEST(FormatFeatures, CoverTheRequiredFormatSupport) {
  for (const Required& r : kRequired) {
    const FormatInfo& f = *formatInfo(r.format);
    SCOPED_TRACE(f.name);
    VkFormatFeatureFlags2 image = VK_FORMAT_FEATURE_2_TRANSFER_SRC_BIT | VK_FORMAT_FEATURE_2_TRANSFER_DST_BIT, buffer = 0;
    for (const char* c = r.features; *c; ++c) {
      switch (*c) {
        case 's': image |= VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_2_BLIT_SRC_BIT; break;
        case 'l': image |= VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_FILTER_LINEAR_BIT; break;
        case 'i': image |= VK_FORMAT_FEATURE_2_STORAGE_IMAGE_BIT; break;
        case 'a': image |= VK_FORMAT_FEATURE_2_STORAGE_IMAGE_ATOMIC_BIT; break;
        case 'c': image |= VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BIT | VK_FORMAT_FEATURE_2_BLIT_DST_BIT; break;
        case 'b': image |= VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BLEND_BIT; break;
        case 'd': image |= VK_FORMAT_FEATURE_2_DEPTH_STENCIL_ATTACHMENT_BIT; break;
        case 'v': buffer |= VK_FORMAT_FEATURE_2_VERTEX_BUFFER_BIT; break;
        case 'u': buffer |= VK_FORMAT_FEATURE_2_UNIFORM_TEXEL_BUFFER_BIT; break;
        case 't': buffer |= VK_FORMAT_FEATURE_2_STORAGE_TEXEL_BUFFER_BIT; break;
        case 'x': buffer |= VK_FORMAT_FEATURE_2_STORAGE_TEXEL_BUFFER_ATOMIC_BIT; break;
        default: FAIL();
      }
    }
    EXPECT_EQ(optimalFeatures(f) & image, image);
    EXPECT_EQ(bufferFeatures(f) & buffer, buffer);
  }
}

TEST(FormatFeatures, ImpliedFeaturesComeTogether) {
  for (const FormatInfo& f : allFormats()) {
    SCOPED_TRACE(f.name);
    for (VkFormatFeatureFlags2 features : {optimalFeatures(f), linearFeatures(f)}) {
      auto implies = [&](VkFormatFeatureFlags2 a, VkFormatFeatureFlags2 b) {
        if (features & a) { EXPECT_EQ(features & b, b); }
      };
      implies(VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_FILTER_LINEAR_BIT, VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_BIT);
      implies(VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BLEND_BIT, VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BIT);
      implies(VK_FORMAT_FEATURE_2_STORAGE_IMAGE_ATOMIC_BIT, VK_FORMAT_FEATURE_2_STORAGE_IMAGE_BIT);
      implies(VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BIT, VK_FORMAT_FEATURE_2_BLIT_DST_BIT);
      implies(~VkFormatFeatureFlags2(0), VK_FORMAT_FEATURE_2_TRANSFER_SRC_BIT | VK_FORMAT_FEATURE_2_TRANSFER_DST_BIT);
      constexpr VkFormatFeatureFlags2 kFiltered = VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_FILTER_LINEAR_BIT | VK_FORMAT_FEATURE_2_COLOR_ATTACHMENT_BLEND_BIT;
      if (f.isInteger()) { EXPECT_FALSE(features & kFiltered); }
    }
    EXPECT_TRUE(sampleCounts(f) & VK_SAMPLE_COUNT_1_BIT);
  }
}

}  // namespace
}  // namespace pumice::texture
