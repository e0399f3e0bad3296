// Clears, blits and resolves against values computed here in double precision.
#include "cts_subset/tests/devices.h"

#include <glm/glm.hpp>
#include <glm/gtc/packing.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace pumice::cts {
namespace {

class Clear : public OnDevice {};
class Blit : public OnDevice {};

double toSrgb(double v) { return v <= 0.0031308 ? v * 12.92 : 1.055 * std::pow(v, 1 / 2.4) - 0.055; }
double fromSrgb(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

// A colour format with what it takes to read and write it.
struct Codec {
  VkFormat format;
  const char* name;
  uint32_t bytes;
  glm::dvec4 (*decode)(const uint8_t*);
  double unit;  // the step in which results may differ
  bool normalised;
  int channels = 4;
  bool srgb = false;
};

glm::dvec4 unorm(const uint8_t* p, int r, int g, int b, int a) {
  return glm::dvec4(p[r], p[g], p[b], p[a]) / 255.0;
}
const Codec kCodecs[] = {
    {VK_FORMAT_R8G8B8A8_UNORM, "RGBA8", 4, [](const uint8_t* p) { return unorm(p, 0, 1, 2, 3); }, 1 / 255.0,
     true},
    {VK_FORMAT_B8G8R8A8_UNORM, "BGRA8", 4, [](const uint8_t* p) { return unorm(p, 2, 1, 0, 3); }, 1 / 255.0,
     true},
    {VK_FORMAT_R8G8B8A8_SRGB, "RGBA8_SRGB", 4,
     [](const uint8_t* p) {  // kept encoded: the unit is a step of the encoding
       return unorm(p, 0, 1, 2, 3);
     },
     1 / 255.0, true, 4, true},
    {VK_FORMAT_R8_UNORM, "R8", 1, [](const uint8_t* p) { return glm::dvec4(p[0] / 255.0, 0, 0, 1); },
     1 / 255.0, true, 1},
    {VK_FORMAT_A2B10G10R10_UNORM_PACK32, "A2B10G10R10", 4,
     [](const uint8_t* p) {
       uint32_t w;
       std::memcpy(&w, p, 4);
       return glm::dvec4((w & 1023) / 1023.0, (w >> 10 & 1023) / 1023.0, (w >> 20 & 1023) / 1023.0,
                         (w >> 30) / 3.0);
     },
     1 / 1023.0, true},
    {VK_FORMAT_R16G16B16A16_UNORM, "RGBA16", 8,
     [](const uint8_t* p) {
       uint16_t v[4];
       std::memcpy(v, p, 8);
       return glm::dvec4(v[0], v[1], v[2], v[3]) / 65535.0;
     },
     1 / 65535.0, true},
    {VK_FORMAT_R16G16B16A16_SFLOAT, "RGBA16F", 8,
     [](const uint8_t* p) {
       uint16_t v[4];
       std::memcpy(v, p, 8);
       return glm::dvec4(glm::unpackHalf1x16(v[0]), glm::unpackHalf1x16(v[1]), glm::unpackHalf1x16(v[2]),
                         glm::unpackHalf1x16(v[3]));
     },
     1 / 1024.0, false},
    {VK_FORMAT_R32G32B32A32_SFLOAT, "RGBA32F", 16,
     [](const uint8_t* p) {
       glm::vec4 v;
       std::memcpy(&v, p, 16);
       return glm::dvec4(v);
     },
     1e-6, false},
};

glm::dvec4 colourOf(const Codec& codec, const uint8_t* p) {
  glm::dvec4 c = codec.decode(p);
  if (codec.srgb)
    for (int i = 0; i < 3; ++i) c[i] = fromSrgb(c[i]);
  return c;
}

bool supports(const Device& device, VkFormat format, VkFormatFeatureFlags wanted) {
  return device.supports(format, wanted);
}

// Source texels: every bit pattern of normalised formats, values in [0, 1] of the float formats.
Bytes sourceTexels(const Codec& codec, uint32_t count, uint32_t seed) {
  Bytes out = noise(size_t(count) * codec.bytes, seed);
  if (codec.normalised) return out;
  Bytes random = noise(size_t(count) * 4, seed + 1);
  for (size_t i = 0; i < random.size(); ++i) {
    float value = float(random[i]) / 255.0f;
    if (codec.bytes == 16) std::memcpy(&out[i * 4], &value, 4);
    uint16_t half = glm::packHalf1x16(value);
    if (codec.bytes == 8) std::memcpy(&out[i * 2], &half, 2);
  }
  return out;
}

// Is `found` what `wanted` (linear colour) becomes in the format, within `units` steps?
std::string mismatch(const Codec& codec, const uint8_t* found, glm::dvec4 wanted, double units) {
  if (codec.normalised) wanted = glm::clamp(wanted, 0.0, 1.0);
  if (codec.srgb)
    for (int i = 0; i < 3; ++i) wanted[i] = toSrgb(wanted[i]);
  glm::dvec4 got = codec.decode(found);
  for (int i = 0; i < codec.channels; ++i) {
    bool twoBits = codec.format == VK_FORMAT_A2B10G10R10_UNORM_PACK32 && i == 3;
    double step = twoBits ? 1 / 3.0 : codec.unit;
    // Normalised values may round either way within half a step, and be `units` steps off.
    double room = step * units * (codec.normalised ? 1.0 : std::max(1.0, std::abs(wanted[i])));
    if (std::abs(got[i] - wanted[i]) > room * 1.0001 + 1e-9)
      return "channel " + std::to_string(i) + " is " + std::to_string(got[i]) + ", expected " +
             std::to_string(wanted[i]);
  }
  return {};
}

TEST_P(Clear, ColourRangesOfEveryFormat) {
  for (const Codec& codec : kCodecs) {
    if (!supports(device(), codec.format, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT)) continue;
    SCOPED_TRACE(codec.name);
    Workspace work(device());
    ImageSpec spec;
    spec.format = codec.format;
    spec.extent = {23, 14, 1};
    spec.mips = 3;
    spec.layers = 3;
    Image image = work.image(spec);
    toGeneral(work, image);
    const glm::vec4 kFirst(0.25f, 0.5f, 0.75f, 1.0f), kSecond(-0.5f, 0.1f, 2.0f, 0.4f);
    device().run([&](VkCommandBuffer commands) {
      VkClearColorValue value{{kFirst.r, kFirst.g, kFirst.b, kFirst.a}};
      VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0,
                                  VK_REMAINING_ARRAY_LAYERS};
      vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &all);
      fullBarrier(commands);
      value = {{kSecond.r, kSecond.g, kSecond.b, kSecond.a}};
      VkImageSubresourceRange some[2] = {{VK_IMAGE_ASPECT_COLOR_BIT, 1, 1, 1, 2},
                                         {VK_IMAGE_ASPECT_COLOR_BIT, 2, 1, 0, 1}};
      vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 2, some);
      fullBarrier(commands);
    });
    for (uint32_t mip = 0; mip < 3; ++mip)
      for (uint32_t layer = 0; layer < 3; ++layer) {
        bool second = (mip == 1 && layer >= 1) || (mip == 2 && layer == 0);
        Bytes found = download(work, image, mip, layer, VK_IMAGE_ASPECT_COLOR_BIT, codec.bytes);
        for (size_t i = 0; i < found.size(); i += codec.bytes)
          ASSERT_EQ(mismatch(codec, &found[i], second ? kSecond : kFirst, 0.51), "")
              << "mip " << mip << " layer " << layer << " texel " << i / codec.bytes;
      }
  }
}

TEST_P(Clear, IntegerFormatsKeepTheirBits) {
  Workspace work(device());
  ImageSpec spec;
  spec.format = VK_FORMAT_R32G32B32A32_UINT;
  spec.extent = {9, 5, 1};
  Image image = work.image(spec);
  spec.format = VK_FORMAT_R8G8B8A8_SINT;
  Image small = work.image(spec);
  toGeneral(work, image);
  toGeneral(work, small);
  VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  device().run([&](VkCommandBuffer commands) {
    VkClearColorValue value{};
    for (uint32_t i = 0; i < 4; ++i) value.uint32[i] = 0xfffffff0u + i;
    vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &range);
    const int32_t kSigned[] = {-128, -1, 127, 5};
    for (int i = 0; i < 4; ++i) value.int32[i] = kSigned[i];
    vkCmdClearColorImage(commands, small.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &range);
    fullBarrier(commands);
  });
  Bytes found = download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 16);
  for (size_t i = 0; i < found.size(); i += 16) {
    uint32_t words[4];
    std::memcpy(words, &found[i], 16);
    for (uint32_t k = 0; k < 4; ++k) ASSERT_EQ(words[k], 0xfffffff0u + k);
  }
  found = download(work, small, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
  const Bytes kExpected = {0x80, 0xff, 0x7f, 0x05};
  for (size_t i = 0; i < found.size(); ++i) ASSERT_EQ(found[i], kExpected[i % 4]);
}

TEST_P(Clear, DepthAndStencilAspects) {
  const struct {
    VkFormat format;
    uint32_t depthBytes;
    bool stencil;
  } kCases[] = {{VK_FORMAT_D16_UNORM, 2, false},
                {VK_FORMAT_D32_SFLOAT, 4, false},
                {VK_FORMAT_D24_UNORM_S8_UINT, 4, true},
                {VK_FORMAT_D32_SFLOAT_S8_UINT, 4, true}};
  for (const auto& c : kCases) {
    if (!supports(device(), c.format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT)) continue;
    SCOPED_TRACE(c.format);
    Workspace work(device());
    ImageSpec spec;
    spec.format = c.format;
    spec.extent = {11, 7, 1};
    Image image = work.image(spec);
    toGeneral(work, image);
    auto clear = [&](VkImageAspectFlags aspects, float depth, uint32_t stencil) {
      device().run([&](VkCommandBuffer commands) {
        VkClearDepthStencilValue value{depth, stencil};
        VkImageSubresourceRange range{aspects, 0, 1, 0, 1};
        vkCmdClearDepthStencilImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &range);
        fullBarrier(commands);
      });
    };
    auto depthAt = [&](const Bytes& bytes, size_t i) {
      if (c.depthBytes == 2) {
        uint16_t v;
        std::memcpy(&v, &bytes[i * 2], 2);
        return v / 65535.0;
      }
      if (c.format == VK_FORMAT_D24_UNORM_S8_UINT) {
        uint32_t v;
        std::memcpy(&v, &bytes[i * 4], 4);
        return (v & 0xffffff) / 16777215.0;
      }
      float v;
      std::memcpy(&v, &bytes[i * 4], 4);
      return double(v);
    };
    auto expect = [&](double depth, int stencil) {
      Bytes found = download(work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, c.depthBytes);
      for (size_t i = 0; i < 77; ++i) ASSERT_NEAR(depthAt(found, i), depth, 1.01 / 65535);
      if (!c.stencil) return;
      found = download(work, image, 0, 0, VK_IMAGE_ASPECT_STENCIL_BIT, 1);
      for (uint8_t value : found) ASSERT_EQ(value, stencil);
    };
    clear(image.aspects, 0.625f, 200);
    expect(0.625, 200);
    clear(VK_IMAGE_ASPECT_DEPTH_BIT, 0.125f, 7);
    expect(0.125, 200);
    if (c.stencil) {
      clear(VK_IMAGE_ASPECT_STENCIL_BIT, 1.0f, 9);
      expect(0.125, 9);
    }
  }
}

struct BlitRun {
  VkOffset3D from[2], to[2];
  VkFilter filter;
};

// Blits a 2D image and compares every pixel of the target, the untouched ones too.
void checkBlit(Device& device, const Codec& in, const Codec& out, const BlitRun& run, double units) {
  constexpr int kSide = 32, kOut = 48;
  Workspace work(device);
  ImageSpec spec;
  spec.format = in.format;
  spec.extent = {kSide, kSide, 1};
  Image from = work.image(spec);
  spec.format = out.format;
  spec.extent = {kOut, kOut, 1};
  Image to = work.image(spec);
  toGeneral(work, from);
  toGeneral(work, to);
  Bytes source = sourceTexels(in, kSide * kSide, 80);
  if (run.filter == VK_FILTER_LINEAR && in.bytes == 4 && in.normalised)
    for (size_t i = 0; i < source.size(); ++i) source[i] = uint8_t(96 + source[i] / 4);
  Bytes before = sourceTexels(out, kOut * kOut, 81);
  Piece piece;
  piece.extent = {kSide, kSide, 1};
  upload(work, from, piece, source);
  piece.extent = {kOut, kOut, 1};
  upload(work, to, piece, before);
  VkImageBlit region{};
  region.srcSubresource = region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  for (int i = 0; i < 2; ++i) region.srcOffsets[i] = run.from[i], region.dstOffsets[i] = run.to[i];
  device.run([&](VkCommandBuffer commands) {
    vkCmdBlitImage(commands, from.handle, VK_IMAGE_LAYOUT_GENERAL, to.handle, VK_IMAGE_LAYOUT_GENERAL, 1,
                   &region, run.filter);
    fullBarrier(commands);
  });
  Bytes found = download(work, to, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, out.bytes);

  auto texel = [&](int x, int y) {
    x = std::clamp(x, 0, kSide - 1), y = std::clamp(y, 0, kSide - 1);
    return colourOf(in, &source[size_t(y * kSide + x) * in.bytes]);
  };
  double scaleX = double(run.from[1].x - run.from[0].x) / (run.to[1].x - run.to[0].x);
  double scaleY = double(run.from[1].y - run.from[0].y) / (run.to[1].y - run.to[0].y);
  for (int y = 0; y < kOut; ++y)
    for (int x = 0; x < kOut; ++x) {
      size_t at = size_t(y * kOut + x) * out.bytes;
      bool inside = x >= std::min(run.to[0].x, run.to[1].x) && x < std::max(run.to[0].x, run.to[1].x) &&
                    y >= std::min(run.to[0].y, run.to[1].y) && y < std::max(run.to[0].y, run.to[1].y);
      if (!inside) {
        ASSERT_TRUE(std::memcmp(&found[at], &before[at], out.bytes) == 0)
            << "written outside the region at " << x << "," << y;
        continue;
      }
      double u = (x + 0.5 - run.to[0].x) * scaleX + run.from[0].x;
      double v = (y + 0.5 - run.to[0].y) * scaleY + run.from[0].y;
      glm::dvec4 wanted;
      if (run.filter == VK_FILTER_NEAREST) {
        wanted = texel(int(std::floor(u)), int(std::floor(v)));
      } else {
        double fu = u - 0.5, fv = v - 0.5;
        int iu = int(std::floor(fu)), iv = int(std::floor(fv));
        double au = fu - iu, av = fv - iv;
        wanted = glm::mix(glm::mix(texel(iu, iv), texel(iu + 1, iv), au),
                          glm::mix(texel(iu, iv + 1), texel(iu + 1, iv + 1), au), av);
      }
      ASSERT_EQ(mismatch(out, &found[at], wanted, units), "") << "at " << x << "," << y;
    }
}

const BlitRun kNearest[] = {
    {{{0, 0, 0}, {32, 32, 1}}, {{3, 5, 0}, {35, 37, 1}}, VK_FILTER_NEAREST},   // 1:1
    {{{4, 6, 0}, {20, 22, 1}}, {{0, 0, 0}, {48, 48, 1}}, VK_FILTER_NEAREST},   // up by three
    {{{0, 0, 0}, {30, 30, 1}}, {{10, 8, 0}, {20, 18, 1}}, VK_FILTER_NEAREST},  // down by three
    {{{32, 0, 0}, {0, 32, 1}}, {{1, 1, 0}, {33, 33, 1}}, VK_FILTER_NEAREST},   // mirrored in x
    {{{2, 3, 0}, {18, 31, 1}}, {{40, 44, 0}, {8, 4, 1}}, VK_FILTER_NEAREST},   // turned round
};
const BlitRun kLinear[] = {
    {{{0, 0, 0}, {32, 32, 1}}, {{0, 0, 0}, {48, 48, 1}}, VK_FILTER_LINEAR},
    {{{0, 0, 0}, {32, 32, 1}}, {{4, 4, 0}, {20, 20, 1}}, VK_FILTER_LINEAR},  // a mip level
    {{{32, 32, 0}, {0, 0, 1}}, {{2, 1, 0}, {45, 40, 1}}, VK_FILTER_LINEAR},
};

TEST_P(Blit, NearestScalesAndMirrors) {
  for (size_t i = 0; i < std::size(kNearest); ++i) {
    SCOPED_TRACE(i);
    checkBlit(device(), kCodecs[0], kCodecs[0], kNearest[i], 0.51);
  }
}

TEST_P(Blit, LinearIsBilinear) {
  for (const Codec& codec : kCodecs) {
    if (!supports(device(), codec.format,
                  VK_FORMAT_FEATURE_BLIT_SRC_BIT | VK_FORMAT_FEATURE_BLIT_DST_BIT |
                      VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT))
      continue;
    // The whole range of ten and sixteen bits would need better weights than 8 bits.
    if (codec.format == VK_FORMAT_A2B10G10R10_UNORM_PACK32 || codec.format == VK_FORMAT_R16G16B16A16_UNORM ||
        codec.bytes == 16)
      continue;
    SCOPED_TRACE(codec.name);
    for (size_t i = 0; i < std::size(kLinear); ++i) {
      SCOPED_TRACE(i);
      checkBlit(device(), codec, codec, kLinear[i], codec.normalised ? 1.5 : 4);
    }
  }
}

TEST_P(Blit, ConvertsBetweenFormats) {
  for (const Codec& in : kCodecs)
    for (const Codec& out : kCodecs) {
      if (!supports(device(), in.format, VK_FORMAT_FEATURE_BLIT_SRC_BIT) ||
          !supports(device(), out.format, VK_FORMAT_FEATURE_BLIT_DST_BIT))
        continue;
      SCOPED_TRACE(std::string(in.name) + " to " + out.name);
      // lavapipe decodes sRGB with about nine bits.
      double units = in.srgb && device().name().starts_with(kLavapipeName) ? 0.0025 / out.unit : 1.0;
      checkBlit(device(), in, out, kNearest[1], std::max(units, 1.0));
    }
}

TEST_P(Blit, MipChainByLinearBlits) {
  constexpr uint32_t kSide = 64;
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {kSide, kSide, 1};
  spec.mips = 7;
  Image image = work.image(spec);
  toGeneral(work, image);
  Bytes base;
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x)
      base.insert(base.end(), {uint8_t(x * 4), uint8_t(y * 4), uint8_t(x + y), 255});
  Piece piece;
  piece.extent = spec.extent;
  upload(work, image, piece, base);
  device().run([&](VkCommandBuffer commands) {
    for (uint32_t mip = 1; mip < spec.mips; ++mip) {
      VkImageBlit region{};
      region.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, mip - 1, 0, 1};
      region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, mip, 0, 1};
      region.srcOffsets[1] = {int32_t(kSide >> (mip - 1)), int32_t(kSide >> (mip - 1)), 1};
      region.dstOffsets[1] = {int32_t(kSide >> mip), int32_t(kSide >> mip), 1};
      vkCmdBlitImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, image.handle, VK_IMAGE_LAYOUT_GENERAL,
                     1, &region, VK_FILTER_LINEAR);
      fullBarrier(commands);
    }
  });
  for (uint32_t mip = 1; mip < spec.mips; ++mip) {
    Bytes above = download(work, image, mip - 1, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    Bytes found = download(work, image, mip, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    uint32_t side = kSide >> mip;
    for (uint32_t y = 0; y < side; ++y)
      for (uint32_t x = 0; x < side; ++x)
        for (uint32_t c = 0; c < 4; ++c) {
          int sum = 0;
          for (uint32_t k = 0; k < 4; ++k) sum += above[((y * 2 + k / 2) * side * 2 + x * 2 + k % 2) * 4 + c];
          ASSERT_NEAR(found[(y * side + x) * 4 + c], sum / 4.0, 1.01)
              << "mip " << mip << " at " << x << "," << y;
        }
  }
}

PUMICE_ON_BOTH_DEVICES(Clear);
PUMICE_ON_BOTH_DEVICES(Blit);

}  // namespace
}  // namespace pumice::cts
