// Block-compressed images: what shaders and blits read of them, on both drivers.
#include "cts_subset/tests/probe.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>

namespace pumice::cts {
namespace {

struct BlockFormat {
  VkFormat format;
  const char* name;
  uint32_t bytes;
  double tolerance;  // between two drivers: interpolation may be rounded to 8 bits; BC6H and BC7 are exact by definition
  bool bc6 = false, bc7 = false;
};
// Decoders may interpolate endpoints that were rounded to 8 bits, and round again: one unit each.
constexpr double kEight = 2.01 / 255, kSigned = 2.01 / 127;
const BlockFormat kFormats[] = {
    {VK_FORMAT_BC1_RGB_UNORM_BLOCK, "BC1_RGB", 8, kEight},
    {VK_FORMAT_BC1_RGB_SRGB_BLOCK, "BC1_RGB_SRGB", 8, 2.5 * kEight},  // the curve is steeper than 2 at its end
    {VK_FORMAT_BC1_RGBA_UNORM_BLOCK, "BC1_RGBA", 8, kEight},
    {VK_FORMAT_BC1_RGBA_SRGB_BLOCK, "BC1_RGBA_SRGB", 8, 2.5 * kEight},
    {VK_FORMAT_BC2_UNORM_BLOCK, "BC2", 16, kEight},
    {VK_FORMAT_BC2_SRGB_BLOCK, "BC2_SRGB", 16, 2.5 * kEight},
    {VK_FORMAT_BC3_UNORM_BLOCK, "BC3", 16, kEight},
    {VK_FORMAT_BC3_SRGB_BLOCK, "BC3_SRGB", 16, 2.5 * kEight},
    {VK_FORMAT_BC4_UNORM_BLOCK, "BC4", 8, kEight},
    {VK_FORMAT_BC4_SNORM_BLOCK, "BC4_SNORM", 8, kSigned},
    {VK_FORMAT_BC5_UNORM_BLOCK, "BC5", 16, kEight},
    {VK_FORMAT_BC5_SNORM_BLOCK, "BC5_SNORM", 16, kSigned},
    {VK_FORMAT_BC6H_UFLOAT_BLOCK, "BC6H_UFLOAT", 16, 0, true},
    {VK_FORMAT_BC6H_SFLOAT_BLOCK, "BC6H_SFLOAT", 16, 0, true},
    {VK_FORMAT_BC7_UNORM_BLOCK, "BC7", 16, 1e-6, false, true},
    {VK_FORMAT_BC7_SRGB_BLOCK, "BC7_SRGB", 16, 1e-4, false, true},
};

// Random blocks; every mode of BC6H and BC7 in turn, the reserved ones left out.
Bytes blocks(const BlockFormat& f, size_t count, uint32_t seed) {
  Bytes out = noise(count * f.bytes, seed);
  static const uint8_t kModes6[] = {0, 1, 2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15};
  for (size_t i = 0; i < count; ++i) {
    uint8_t& low = out[i * f.bytes];
    if (f.bc7) low = uint8_t((low | 1) << (i % 8));
    if (f.bc6) {
      uint8_t m = kModes6[i % 14];
      low = uint8_t(m < 2 ? (low & ~3) | m : (low & ~31) | m);
    }
  }
  return out;
}

bool bothSupport(VkFormat format) {
  constexpr VkFormatFeatureFlags kWanted = VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_BLIT_SRC_BIT;
  return world().peer->supports(format, kWanted);
}

void fill(Workspace& work, const Image& image, const BlockFormat& f, uint32_t seed) {
  toGeneral(work, image);
  for (uint32_t mip = 0; mip < image.spec.mips; ++mip) {
    auto size = [&](uint32_t whole) { return std::max(whole >> mip, 1u); };
    Piece piece;
    piece.mip = mip;
    piece.layers = image.spec.layers;
    piece.extent = {size(image.spec.extent.width), size(image.spec.extent.height), size(image.spec.extent.depth)};
    size_t count = size_t((piece.extent.width + 3) / 4) * ((piece.extent.height + 3) / 4) * piece.extent.depth * image.spec.layers;
    upload(work, image, piece, blocks(f, count, seed + mip));
  }
}

// The largest difference of two lists of answers, with what it was; infinities must agree.
struct Difference {
  double largest = 0;
  size_t at = 0;
};
Difference compare(const std::vector<glm::vec4>& a, const std::vector<glm::vec4>& b) {
  Difference d;
  for (size_t i = 0; i < a.size(); ++i)
    for (int c = 0; c < 4; ++c) {
      double x = a[i][c], y = b[i][c];
      double delta = x == y || (std::isnan(x) && std::isnan(y)) ? 0 : std::abs(x - y);
      if (!(delta <= d.largest)) d = {delta, i};
    }
  return d;
}

template <typename Ask>
void askBoth(const BlockFormat& f, double tolerance, const std::vector<glm::vec4>& questions, Ask&& ask) {
  std::vector<glm::vec4> answers[2];
  Device* devices[2] = {world().tested.get(), world().peer.get()};
  for (int i = 0; i < 2; ++i) {
    Workspace work(*devices[i]);
    answers[i] = ask(work, questions);
  }
  Difference d = compare(answers[0], answers[1]);
  const glm::vec4 q = questions[d.at], a = answers[0][d.at], b = answers[1][d.at];
  EXPECT_LE(d.largest, tolerance) << f.name << " at (" << q.x << ", " << q.y << ", " << q.z << ", " << q.w << "): (" << a.x << ", " << a.y << ", " << a.z
                                  << ", " << a.w << ") against (" << b.x << ", " << b.y << ", " << b.z << ", " << b.w << ")";
  // Something must have been there.
  EXPECT_TRUE(std::any_of(answers[0].begin(), answers[0].end(), [&](glm::vec4 v) { return v != answers[0][0]; })) << f.name;
}

constexpr VkImageUsageFlags kUsage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;

class OnFormat : public testing::TestWithParam<BlockFormat> {
 protected:
  void SetUp() override {
    PUMICE_NEED_TESTED();
    PUMICE_NEED_PEER();
    ASSERT_TRUE(world().tested->features.textureCompressionBC);
    ASSERT_TRUE(world().tested->supports(GetParam().format, VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_BLIT_SRC_BIT |
                                                                VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT));
    if (!bothSupport(GetParam().format)) GTEST_SKIP() << "lavapipe does not have the format";
  }
};
using CompressedFormat = OnFormat;

// Every texel of an array with odd sizes and mip levels smaller than a block.
TEST_P(CompressedFormat, EveryTexelOfLevelsAndLayers) {
  const BlockFormat& f = GetParam();
  std::vector<glm::vec4> questions;
  for (int layer = 0; layer < 3; ++layer)
    for (int mip = 0; mip < 6; ++mip)
      for (int y = 0; y < std::max(29 >> mip, 1); ++y)
        for (int x = 0; x < std::max(37 >> mip, 1); ++x) questions.push_back({x, y, layer, mip});
  askBoth(f, f.tolerance, questions, [&](Workspace& work, const std::vector<glm::vec4>& q) {
    ImageSpec spec;
    spec.format = f.format;
    spec.extent = {37, 29, 1};
    spec.mips = 6;
    spec.layers = 3;
    spec.usage = kUsage;
    Image image = work.image(spec);
    fill(work, image, f, 5);
    return probe(work, "layout(binding = 2) uniform sampler2DArray image;", "answer = texelFetch(image, ivec3(ask(0).xyz), int(ask(0).w));",
                 {sampledBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_2D_ARRAY}), work.make(samplerInfo()))}, q);
  });
}

TEST_P(CompressedFormat, TrilinearCube) {
  const BlockFormat& f = GetParam();
  if (f.bc6) return;  // random halves: sums of 65504 and 1e-7 compare nothing; their texels are above
  std::vector<glm::vec4> questions;
  Bytes random = noise(4 * 4096, 9);
  for (int i = 0; i < 4096; ++i) {
    glm::vec3 v(random[4 * i] - 127.3f, random[4 * i + 1] - 127.6f, random[4 * i + 2] - 126.9f);
    // Away from edges of the cube, which have a test of their own.
    glm::vec3 a = glm::abs(v);
    float major = std::max({a.x, a.y, a.z});
    for (int c = 0; c < 3; ++c)
      if (a[c] != major) v[c] *= 0.9f;
    questions.push_back(glm::vec4(v, random[4 * i + 3] / 80.0f));
  }
  // Weights may have 8 bits: up to 1/256 of the distance of two texels for each direction and the levels.
  askBoth(f, f.tolerance + 5.0 / 256 * (f.tolerance == kSigned ? 2 : 1), questions, [&](Workspace& work, const std::vector<glm::vec4>& q) {
    ImageSpec spec;
    spec.format = f.format;
    spec.extent = {16, 16, 1};
    spec.mips = 4;
    spec.layers = 6;
    spec.usage = kUsage;
    spec.flags = VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
    Image image = work.image(spec);
    fill(work, image, f, 11);
    auto info = samplerInfo(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, VK_SAMPLER_MIPMAP_MODE_LINEAR);
    return probe(work, "layout(binding = 2) uniform samplerCube image;", "answer = textureLod(image, ask(0).xyz, ask(0).w);",
                 {sampledBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_CUBE}), work.make(info))}, q);
  });
}

// Volumes are slices of blocks; both drivers must have them to be compared.
TEST_P(CompressedFormat, EveryTexelOfAVolume) {
  const BlockFormat& f = GetParam();
  VkImageFormatProperties p{};
  ASSERT_EQ(vkGetPhysicalDeviceImageFormatProperties(world().tested->physical, f.format, VK_IMAGE_TYPE_3D, VK_IMAGE_TILING_OPTIMAL, kUsage, 0, &p), VK_SUCCESS);
  if (vkGetPhysicalDeviceImageFormatProperties(world().peer->physical, f.format, VK_IMAGE_TYPE_3D, VK_IMAGE_TILING_OPTIMAL, kUsage, 0, &p)) return;
  std::vector<glm::vec4> questions;
  for (int z = 0; z < 5; ++z)
    for (int y = 0; y < 10; ++y)
      for (int x = 0; x < 14; ++x) questions.push_back({x, y, z, 0});
  askBoth(f, f.tolerance, questions, [&](Workspace& work, const std::vector<glm::vec4>& q) {
    ImageSpec spec;
    spec.format = f.format;
    spec.type = VK_IMAGE_TYPE_3D;
    spec.extent = {14, 10, 5};
    spec.mips = 2;
    spec.usage = kUsage;
    Image image = work.image(spec);
    fill(work, image, f, 7);
    return probe(work, "layout(binding = 2) uniform sampler3D image;", "answer = texelFetch(image, ivec3(ask(0).xyz), 0);",
                 {sampledBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_3D}), work.make(samplerInfo()))}, q);
  });
}

// Blits read compressed images; the target is a float image, which rounds nothing away.
TEST_P(CompressedFormat, BlitToFloat) {
  const BlockFormat& f = GetParam();
  std::vector<glm::vec4> questions;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 24; ++x) questions.push_back({x, y, 0, 0});
  askBoth(f, f.tolerance, questions, [&](Workspace& work, const std::vector<glm::vec4>& q) {
    ImageSpec spec;
    spec.format = f.format;
    spec.extent = {24, 20, 1};
    spec.usage = kUsage;
    Image image = work.image(spec);
    fill(work, image, f, 23);
    spec.format = VK_FORMAT_R32G32B32A32_SFLOAT;
    Image target = work.image(spec);
    toGeneral(work, target);
    VkImageBlit blit{};
    blit.srcSubresource = blit.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    blit.srcOffsets[1] = blit.dstOffsets[1] = {24, 20, 1};
    std::swap(blit.dstOffsets[0].x, blit.dstOffsets[1].x);  // mirrored
    work.device.run([&](VkCommandBuffer commands) {
      vkCmdBlitImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, target.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_NEAREST);
    });
    return probe(work, "layout(binding = 2) uniform sampler2D image;", "answer = texelFetch(image, ivec2(ask(0).xy), 0);",
                 {sampledBinding(makeView(work, target, {}), work.make(samplerInfo()))}, q);
  });
}

// Blocks written by a shader through an uncompressed view, then sampled: the bits are the truth.
TEST_P(CompressedFormat, BlocksWrittenThroughATexelView) {
  const BlockFormat& f = GetParam();
  const VkFormat words = f.bytes == 8 ? VK_FORMAT_R32G32_UINT : VK_FORMAT_R32G32B32A32_UINT;
  constexpr int kWidth = 28, kHeight = 22;
  const Bytes data = blocks(f, 7 * 6, 31);
  std::vector<glm::vec4> questions;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) questions.push_back({x, y, 0, 0});
  std::vector<glm::vec4> answers[2];
  for (bool shader : {false, true}) {
    Workspace work(*world().tested);
    ImageSpec spec;
    spec.format = f.format;
    spec.extent = {kWidth, kHeight, 1};
    spec.usage = kUsage | VK_IMAGE_USAGE_STORAGE_BIT;
    spec.flags = VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT | VK_IMAGE_CREATE_BLOCK_TEXEL_VIEW_COMPATIBLE_BIT | VK_IMAGE_CREATE_EXTENDED_USAGE_BIT;
    Image image = work.image(spec);
    toGeneral(work, image);
    if (shader) {
      std::vector<glm::vec4> store;  // place, then the block's bits
      for (int i = 0; i < 42; ++i) {
        store.push_back({i % 7, i / 7, 0, 0});
        glm::vec4 bits(0);
        std::memcpy(&bits, &data[size_t(i) * f.bytes], f.bytes);
        store.push_back(bits);
      }
      VkImageView view = makeView(work, image, {VK_IMAGE_VIEW_TYPE_2D, words});
      probe(work, std::string("layout(binding = 2, ") + (f.bytes == 8 ? "rg32ui" : "rgba32ui") + ") uniform uimage2D image;",
            "imageStore(image, ivec2(ask(0).xy), floatBitsToUint(ask(1))); answer = vec4(imageSize(image), 0, 0);", {storageBinding(view)}, store, 2);
    } else {
      Piece piece;
      piece.extent = spec.extent;
      upload(work, image, piece, data);
    }
    VkImageView view = makeView(work, image, {VK_IMAGE_VIEW_TYPE_2D, VK_FORMAT_UNDEFINED, 0, 0, 1, 0, 1, VK_IMAGE_USAGE_SAMPLED_BIT});
    answers[shader] = probe(work, "layout(binding = 2) uniform sampler2D image;", "answer = texelFetch(image, ivec2(ask(0).xy), 0);",
                            {sampledBinding(view, work.make(samplerInfo()))}, questions);
  }
  Difference d = compare(answers[0], answers[1]);
  EXPECT_EQ(d.largest, 0) << f.name << " at " << d.at;
}

INSTANTIATE_TEST_SUITE_P(Compressed, CompressedFormat, testing::ValuesIn(kFormats),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace pumice::cts
