// Formats: what Vulkan 1.3 requires of each, and every feature that a driver claims put to use.
#include "cts_subset/tests/probe.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

namespace pumice::cts {
namespace {

class Formats : public OnDevice {};

// Letters of features, for the table of requirements below.
const std::map<char, VkFormatFeatureFlags> kImageFeatures = {
    {'S', VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT},       {'L', VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT},
    {'B', VK_FORMAT_FEATURE_BLIT_SRC_BIT},            {'b', VK_FORMAT_FEATURE_BLIT_DST_BIT},
    {'C', VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT},    {'c', VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT},
    {'I', VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT},       {'i', VK_FORMAT_FEATURE_STORAGE_IMAGE_ATOMIC_BIT},
    {'D', VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT}};
const std::map<char, VkFormatFeatureFlags> kBufferFeatures = {{'V', VK_FORMAT_FEATURE_VERTEX_BUFFER_BIT},
                                                              {'U', VK_FORMAT_FEATURE_UNIFORM_TEXEL_BUFFER_BIT},
                                                              {'T', VK_FORMAT_FEATURE_STORAGE_TEXEL_BUFFER_BIT},
                                                              {'t', VK_FORMAT_FEATURE_STORAGE_TEXEL_BUFFER_ATOMIC_BIT}};

// Vulkan 1.3, "Required Format Support", tables "Mandatory format support". X: storage images with shaderStorageImageExtendedFormats.
struct Requirement {
  VkFormat format;
  const char* features;
};
const Requirement kRequired[] = {
    {VK_FORMAT_B4G4R4A4_UNORM_PACK16, "SLB"},       {VK_FORMAT_R5G6B5_UNORM_PACK16, "SLBbCc"},     {VK_FORMAT_A1R5G5B5_UNORM_PACK16, "SLBbCc"},
    {VK_FORMAT_A4R4G4B4_UNORM_PACK16, "SLB"},       {VK_FORMAT_A4B4G4R4_UNORM_PACK16, "SLB"},
    {VK_FORMAT_R8_UNORM, "SLBbCcVUX"},              {VK_FORMAT_R8_SNORM, "SLBVUX"},                {VK_FORMAT_R8_UINT, "SBbCVUX"},
    {VK_FORMAT_R8_SINT, "SBbCVUX"},                 {VK_FORMAT_R8G8_UNORM, "SLBbCcVUX"},           {VK_FORMAT_R8G8_SNORM, "SLBVUX"},
    {VK_FORMAT_R8G8_UINT, "SBbCVUX"},               {VK_FORMAT_R8G8_SINT, "SBbCVUX"},              {VK_FORMAT_R8G8B8A8_UNORM, "SLBbCcIVUT"},
    {VK_FORMAT_R8G8B8A8_SNORM, "SLBIVUT"},          {VK_FORMAT_R8G8B8A8_UINT, "SBbCIVUT"},         {VK_FORMAT_R8G8B8A8_SINT, "SBbCIVUT"},
    {VK_FORMAT_R8G8B8A8_SRGB, "SLBbCc"},            {VK_FORMAT_B8G8R8A8_UNORM, "SLBbCcVU"},        {VK_FORMAT_B8G8R8A8_SRGB, "SLBbCc"},
    {VK_FORMAT_A8B8G8R8_UNORM_PACK32, "SLBbCcVUT"}, {VK_FORMAT_A8B8G8R8_SNORM_PACK32, "SLBVUT"},   {VK_FORMAT_A8B8G8R8_UINT_PACK32, "SBbCVUT"},
    {VK_FORMAT_A8B8G8R8_SINT_PACK32, "SBbCVUT"},    {VK_FORMAT_A8B8G8R8_SRGB_PACK32, "SLBbCc"},    {VK_FORMAT_A2B10G10R10_UNORM_PACK32, "SLBbCcVUX"},
    {VK_FORMAT_A2B10G10R10_UINT_PACK32, "SBbCUX"},  {VK_FORMAT_R16_UNORM, "VX"},                   {VK_FORMAT_R16_SNORM, "VX"},
    {VK_FORMAT_R16_UINT, "SBbCVUX"},                {VK_FORMAT_R16_SINT, "SBbCVUX"},               {VK_FORMAT_R16_SFLOAT, "SLBbCcVUX"},
    {VK_FORMAT_R16G16_UNORM, "VX"},                 {VK_FORMAT_R16G16_SNORM, "VX"},                {VK_FORMAT_R16G16_UINT, "SBbCVUX"},
    {VK_FORMAT_R16G16_SINT, "SBbCVUX"},             {VK_FORMAT_R16G16_SFLOAT, "SLBbCcVUX"},        {VK_FORMAT_R16G16B16A16_UNORM, "VX"},
    {VK_FORMAT_R16G16B16A16_SNORM, "VX"},           {VK_FORMAT_R16G16B16A16_UINT, "SBbCIVUT"},     {VK_FORMAT_R16G16B16A16_SINT, "SBbCIVUT"},
    {VK_FORMAT_R16G16B16A16_SFLOAT, "SLBbCcIVUT"},  {VK_FORMAT_R32_UINT, "SBbCIiVUTt"},            {VK_FORMAT_R32_SINT, "SBbCIiVUTt"},
    {VK_FORMAT_R32_SFLOAT, "SBbCIVUT"},             {VK_FORMAT_R32G32_UINT, "SBbCIVUT"},           {VK_FORMAT_R32G32_SINT, "SBbCIVUT"},
    {VK_FORMAT_R32G32_SFLOAT, "SBbCIVUT"},          {VK_FORMAT_R32G32B32_UINT, "V"},               {VK_FORMAT_R32G32B32_SINT, "V"},
    {VK_FORMAT_R32G32B32_SFLOAT, "V"},              {VK_FORMAT_R32G32B32A32_UINT, "SBbCIVUT"},     {VK_FORMAT_R32G32B32A32_SINT, "SBbCIVUT"},
    {VK_FORMAT_R32G32B32A32_SFLOAT, "SBbCIVUT"},    {VK_FORMAT_B10G11R11_UFLOAT_PACK32, "SLBUX"},  {VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, "SLB"},
    {VK_FORMAT_D16_UNORM, "SBD"},                   {VK_FORMAT_D32_SFLOAT, "SB"},
};

TEST_P(Formats, WhatTheSpecificationRequires) {
  for (const Requirement& r : kRequired) {
    if (r.format >= VK_FORMAT_A4R4G4B4_UNORM_PACK16 && !device().has(VK_EXT_4444_FORMATS_EXTENSION_NAME)) continue;
    VkFormatProperties p{};
    vkGetPhysicalDeviceFormatProperties(device().physical, r.format, &p);
    for (const char* c = r.features; *c; ++c) {
      VkFormatFeatureFlags image = 0, buffer = 0;
      if (auto f = kImageFeatures.find(*c); f != kImageFeatures.end()) image = f->second;
      if (auto f = kBufferFeatures.find(*c); f != kBufferFeatures.end()) buffer = f->second;
      if (*c == 'X' && device().features.shaderStorageImageExtendedFormats) image = VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT;
      EXPECT_EQ(p.optimalTilingFeatures & image, image) << "format " << r.format << " feature " << *c;
      EXPECT_EQ(p.bufferFeatures & buffer, buffer) << "format " << r.format << " feature " << *c;
    }
    // Vulkan 1.1: what can be used at all can be copied.
    if (p.optimalTilingFeatures && device().properties.apiVersion >= VK_API_VERSION_1_1) {
      EXPECT_TRUE(p.optimalTilingFeatures & VK_FORMAT_FEATURE_TRANSFER_SRC_BIT) << r.format;
      EXPECT_TRUE(p.optimalTilingFeatures & VK_FORMAT_FEATURE_TRANSFER_DST_BIT) << r.format;
    }
  }
  auto attachment = [&](VkFormat f) { return device().supports(f, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT); };
  EXPECT_TRUE(attachment(VK_FORMAT_X8_D24_UNORM_PACK32) || attachment(VK_FORMAT_D32_SFLOAT));
  EXPECT_TRUE(attachment(VK_FORMAT_D24_UNORM_S8_UINT) || attachment(VK_FORMAT_D32_SFLOAT_S8_UINT));
  if (GetParam() == Role::kTested) {
    const VkPhysicalDeviceFeatures& f = device().features;
    EXPECT_TRUE(f.shaderStorageImageExtendedFormats && f.shaderStorageImageReadWithoutFormat && f.shaderStorageImageWriteWithoutFormat);
    EXPECT_TRUE(device().has(VK_EXT_4444_FORMATS_EXTENSION_NAME));
  }
}

enum class Kind { kFloat, kUint, kSint };

struct ColourFormat {
  VkFormat format = VK_FORMAT_UNDEFINED;
  uint32_t bytes = 0;
  Kind kind = Kind::kFloat;
  bool scaled = false, real = false;  // integers read as floats; floating point
  glm::vec4 unit{0};                  // a step of each component; relative for floating point
  const char* prefix() const { return kind == Kind::kUint ? "u" : kind == Kind::kSint ? "i" : ""; }
};

// All formats of plain texels, by the order of their values.
std::vector<ColourFormat> allFormats() {
  std::vector<ColourFormat> out;
  auto add = [&](int value, uint32_t bytes, Kind kind, glm::vec4 unit, bool scaled = false, bool real = false) {
    ColourFormat f;
    f.format = VkFormat(value);
    f.bytes = bytes;
    f.kind = kind;
    f.unit = unit;
    f.scaled = scaled;
    f.real = real;
    out.push_back(f);
  };
  add(VK_FORMAT_R4G4_UNORM_PACK8, 1, Kind::kFloat, glm::vec4(1 / 15.0f));
  for (int f : {VK_FORMAT_R4G4B4A4_UNORM_PACK16, VK_FORMAT_B4G4R4A4_UNORM_PACK16, VK_FORMAT_A4R4G4B4_UNORM_PACK16, VK_FORMAT_A4B4G4R4_UNORM_PACK16})
    add(f, 2, Kind::kFloat, glm::vec4(1 / 15.0f));
  for (int f : {VK_FORMAT_R5G6B5_UNORM_PACK16, VK_FORMAT_B5G6R5_UNORM_PACK16, VK_FORMAT_R5G5B5A1_UNORM_PACK16, VK_FORMAT_B5G5R5A1_UNORM_PACK16,
                VK_FORMAT_A1R5G5B5_UNORM_PACK16})
    add(f, 2, Kind::kFloat, {1 / 31.0f, 1 / 31.0f, 1 / 31.0f, 1});
  // Groups of UNORM, SNORM, USCALED, SSCALED, UINT, SINT and a seventh.
  auto group = [&](int first, uint32_t bytes, double bits, int count, bool tenTen = false) {
    for (int i = 0; i < count; ++i) {
      float signedUnit = float(1 / (std::exp2(bits - 1) - 1)), unit = float(1 / (std::exp2(bits) - 1));
      glm::vec4 u(i == 1 ? signedUnit : unit);
      if (tenTen) u.w = i == 1 ? 1 : 1 / 3.0f;
      bool half = i == 6 && bits == 16;
      if (half) u = glm::vec4(1 / 1024.0f);
      if (i == 6 && bits == 8) u = glm::vec4(glm::vec3(2.5f / 255), 1 / 255.0f);  // linear size of a step of sRGB at its steepest
      add(first + i, bytes, i == 4 ? Kind::kUint : i == 5 ? Kind::kSint : Kind::kFloat, u, i == 2 || i == 3, half);
    }
  };
  group(VK_FORMAT_R8_UNORM, 1, 8, 7);
  group(VK_FORMAT_R8G8_UNORM, 2, 8, 7);
  group(VK_FORMAT_R8G8B8_UNORM, 3, 8, 7);
  group(VK_FORMAT_B8G8R8_UNORM, 3, 8, 7);
  group(VK_FORMAT_R8G8B8A8_UNORM, 4, 8, 7);
  group(VK_FORMAT_B8G8R8A8_UNORM, 4, 8, 7);
  group(VK_FORMAT_A8B8G8R8_UNORM_PACK32, 4, 8, 7);
  group(VK_FORMAT_A2R10G10B10_UNORM_PACK32, 4, 10, 6, true);
  group(VK_FORMAT_A2B10G10R10_UNORM_PACK32, 4, 10, 6, true);
  group(VK_FORMAT_R16_UNORM, 2, 16, 7);
  group(VK_FORMAT_R16G16_UNORM, 4, 16, 7);
  group(VK_FORMAT_R16G16B16_UNORM, 6, 16, 7);
  group(VK_FORMAT_R16G16B16A16_UNORM, 8, 16, 7);
  for (int n = 0; n < 4; ++n) {
    add(VK_FORMAT_R32_UINT + 3 * n, 4 * uint32_t(n + 1), Kind::kUint, glm::vec4(0));
    add(VK_FORMAT_R32_SINT + 3 * n, 4 * uint32_t(n + 1), Kind::kSint, glm::vec4(0));
    add(VK_FORMAT_R32_SFLOAT + 3 * n, 4 * uint32_t(n + 1), Kind::kFloat, glm::vec4(1e-6f), false, true);
  }
  add(VK_FORMAT_B10G11R11_UFLOAT_PACK32, 4, Kind::kFloat, {1 / 64.0f, 1 / 64.0f, 1 / 32.0f, 0}, false, true);
  add(VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, 4, Kind::kFloat, {1 / 256.0f, 1 / 256.0f, 1 / 256.0f, 0}, false, true);
  return out;
}

constexpr uint32_t kWidth = 16, kHeight = 8;
constexpr VkImageUsageFlags kCopies = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;

// Texels as a client may upload them: any bits, but no infinities and NaNs, whose payload and sums are nobody's promise.
Bytes texels(const ColourFormat& f, size_t count) {
  Bytes out = noise(count * f.bytes, uint32_t(f.format));
  if (!f.real) return out;
  for (size_t i = 0; i + 1 < out.size(); ++i) {
    bool high16 = i % 2 == 1;
    if (f.format >= VK_FORMAT_R32_UINT && f.format <= VK_FORMAT_R32G32B32A32_SFLOAT) {
      if (i % 4 == 3) out[i] = uint8_t((out[i] & 0x80) | 0x3e);  // about 1
    } else if (f.format == VK_FORMAT_B10G11R11_UFLOAT_PACK32) {
      if (i % 4 == 0) {
        uint32_t w;
        std::memcpy(&w, &out[i], 4);
        // Exponents of 12 to 15.
        w = (w & ~0xe0000000u & ~(7u << 19) & ~(7u << 8)) | (3u << 29) | (3u << 19) | (3u << 8);
        std::memcpy(&out[i], &w, 4);
      }
    } else if (f.format == VK_FORMAT_E5B9G9R9_UFLOAT_PACK32) {
      if (i % 4 == 3) out[i] = uint8_t((out[i] & 0x7) | 0x78);
    } else if (high16) {
      out[i] = uint8_t((out[i] & 0x83) | 0x38);
    }
  }
  return out;
}

Image makeImage(Workspace& work, VkFormat format, VkImageUsageFlags usage) {
  ImageSpec spec;
  spec.format = format;
  spec.extent = {kWidth, kHeight, 1};
  spec.usage = usage | kCopies;
  Image image = work.image(spec);
  toGeneral(work, image);
  return image;
}

std::vector<glm::vec4> grid() {
  std::vector<glm::vec4> q;
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x) q.push_back({x, y, 0, 0});
  return q;
}

std::string floatOf(const ColourFormat& f, const std::string& value) {
  return f.kind == Kind::kUint ? "uintBitsToFloat(" + value + ")" : f.kind == Kind::kSint ? "intBitsToFloat(" + value + ")" : value;
}

std::vector<glm::vec4> fetchAll(Workspace& work, const Image& image, const ColourFormat& f) {
  return probe(work, std::string("layout(binding = 2) uniform ") + f.prefix() + "sampler2D image;",
               "answer = " + floatOf(f, "texelFetch(image, ivec2(ask(0).xy), 0)") + ";",
               {sampledBinding(makeView(work, image, {}), work.make(samplerInfo()))}, grid());
}

void fill(Workspace& work, const Image& image, const ColourFormat& f) {
  Piece piece;
  piece.extent = image.spec.extent;
  upload(work, image, piece, texels(f, kWidth * kHeight));
}

// A value that is different for each pixel, in GLSL: `i` is 0, 1, 2, ...; exact in f32, never half way between two steps of a format,
// in range of every format of the kind.
std::string patternOf(const ColourFormat& f) {
  const char* t = "((vec4((i * 37 + 11) % 127, (i * 53 + 5) % 127, (i * 71 + 90) % 127, (i * 29 + 63) % 127) + 0.25) / 128.0)";
  if (f.kind == Kind::kFloat) return t;
  return std::string(f.prefix()) + "vec4(" + t + (f.kind == Kind::kUint ? " * 3.0)" : " * 3.0 - 1.5)");
}
std::string vectorOf(const ColourFormat& f) { return std::string(f.prefix()) + "vec4"; }

using Ask = std::function<std::vector<glm::vec4>(Workspace&, const ColourFormat&)>;

// Asks both drivers about every format that both claim.
void everyFormat(VkFormatFeatureFlags image, VkFormatFeatureFlags buffer, double units, const Ask& ask, const std::function<bool(const ColourFormat&)>& wanted = {}) {
  PUMICE_NEED_TESTED();
  PUMICE_NEED_PEER();
  int asked = 0, alone = 0;
  for (const ColourFormat& f : allFormats()) {
    if (wanted && !wanted(f)) continue;
    if (f.format >= VK_FORMAT_A4R4G4B4_UNORM_PACK16 && !world().peer->has(VK_EXT_4444_FORMATS_EXTENSION_NAME)) continue;
    auto claims = [&](const Device& d) {
      VkFormatProperties p{};
      vkGetPhysicalDeviceFormatProperties(d.physical, f.format, &p);
      return (p.optimalTilingFeatures & image) == image && (p.bufferFeatures & buffer) == buffer;
    };
    if (!claims(*world().tested)) continue;
    SCOPED_TRACE("format " + std::to_string(f.format));
    std::vector<glm::vec4> tested, peer;
    {
      Workspace work(*world().tested);
      tested = ask(work, f);
    }
    // Something different must have come out.
    EXPECT_TRUE(std::any_of(tested.begin(), tested.end(), [&](glm::vec4 v) { return std::memcmp(&v, &tested[0], 16) != 0; }));
    if (!claims(*world().peer)) {
      ++alone;
      continue;
    }
    ++asked;
    {
      Workspace work(*world().peer);
      peer = ask(work, f);
    }
    ASSERT_EQ(tested.size(), peer.size());
    int shown = 0;
    for (size_t i = 0; i < tested.size() && shown < 3; ++i)
      for (int c = 0; c < 4; ++c) {
        float a = tested[i][c], b = peer[i][c];
        bool same = std::memcmp(&a, &b, 4) == 0;
        double room = f.unit[c] * units * (f.real ? std::max(1.0, double(std::abs(b))) : 1.0) + (f.scaled ? 0 : 2e-6);
        if (!same && f.kind == Kind::kFloat) same = std::abs(double(a) - b) <= room;
        if (same) continue;
        ADD_FAILURE() << "texel " << i << " component " << c << ": " << a << " against " << b;
        ++shown;
      }
  }
  std::printf("    %d formats compared, %d used that lavapipe does not have\n", asked, alone);
  EXPECT_GT(asked, 3);
}

class FormatsWithPeer : public testing::Test {};

TEST_F(FormatsWithPeer, Sampled) {
  // lavapipe's transfer function of sRGB is approximate: half a step.
  everyFormat(VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT, 0, 0.5, [](Workspace& work, const ColourFormat& f) {
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT);
    fill(work, image, f);
    return fetchAll(work, image, f);
  });
}

TEST_F(FormatsWithPeer, FilteredLinearly) {
  everyFormat(
      VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT, 0, 1,
      [](Workspace& work, const ColourFormat& original) {
        Image image = makeImage(work, original.format, VK_IMAGE_USAGE_SAMPLED_BIT);
        fill(work, image, original);
        std::vector<glm::vec4> q = grid();
        for (glm::vec4& v : q) v = {v.x / 13 + 0.031f, v.y / 7 + 0.047f, 0, 0};
        // lavapipe's weights have 8 bits: eighths of texels keep them exact.
        for (glm::vec4& v : q) v = {(std::floor(v.x * 8 * kWidth) + 0.0f) / (8 * kWidth), (std::floor(v.y * 8 * kHeight)) / (8 * kHeight), 0, 0};
        return probe(work, "layout(binding = 2) uniform sampler2D image;", "answer = textureLod(image, ask(0).xy, 0.0);",
                     {sampledBinding(makeView(work, image, {}), work.make(samplerInfo(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT)))}, q);
      });
}

TEST_F(FormatsWithPeer, Cleared) {
  everyFormat(VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_TRANSFER_DST_BIT, 0, 1, [](Workspace& work, const ColourFormat& f) {
    std::vector<glm::vec4> out;
    for (int n = 0; n < 4; ++n) {
      Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT);
      work.device.run([&](VkCommandBuffer commands) {
        VkClearColorValue value{};
        for (int c = 0; c < 4; ++c) {
          if (f.kind == Kind::kFloat) value.float32[c] = 0.13f * float(n) + 0.17f * float(c);
          else value.int32[c] = f.kind == Kind::kUint ? n + c % 2 : n - c % 2;
        }
        VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
        vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &range);
        fullBarrier(commands);
      });
      auto all = fetchAll(work, image, f);
      out.insert(out.end(), all.begin(), all.end());
    }
    return out;
  });
}

TEST_F(FormatsWithPeer, StoredByShaders) {
  everyFormat(VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT, 0, 1, [](Workspace& work, const ColourFormat& f) {
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT);
    VkImageView view = makeView(work, image, {});
    probe(work, std::string("layout(binding = 2) writeonly uniform ") + f.prefix() + "image2D image;",
          "int i = int(gl_GlobalInvocationID.x); imageStore(image, ivec2(ask(0).xy), " + patternOf(f) + ");", {storageBinding(view)}, grid());
    return fetchAll(work, image, f);
  });
}

TEST_F(FormatsWithPeer, LoadedByShaders) {
  everyFormat(VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT, 0, 0.5, [](Workspace& work, const ColourFormat& f) {
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_STORAGE_BIT);
    fill(work, image, f);
    return probe(work, std::string("layout(binding = 2) readonly uniform ") + f.prefix() + "image2D image;",
                 "answer = " + floatOf(f, "imageLoad(image, ivec2(ask(0).xy))") + ";", {storageBinding(makeView(work, image, {}))}, grid());
  });
}

std::string fragmentFor(const ColourFormat& f) {
  return "#version 450\nlayout(location = 0) out " + vectorOf(f) + " colour;\nvoid main() { int i = int(gl_FragCoord.x) + int(gl_FragCoord.y) * " +
         std::to_string(kWidth) + "; colour = " + patternOf(f) + "; }";
}

TEST_F(FormatsWithPeer, DrawnTo) {
  everyFormat(VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT, 0, 1, [](Workspace& work, const ColourFormat& f) {
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT);
    Painting p;
    p.extent = {kWidth, kHeight};
    p.fragment = fragmentFor(f);
    paint(work, makeView(work, image, {}), f.format, p);
    return fetchAll(work, image, f);
  });
}

TEST_F(FormatsWithPeer, Blended) {
  // Source, destination and result are each rounded by lavapipe in some formats.
  everyFormat(VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT, 0, 2, [](Workspace& work, const ColourFormat& f) {
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT);
    fill(work, image, f);
    Painting p;
    p.extent = {kWidth, kHeight};
    p.blend = true;
    p.fragment = fragmentFor(f);
    paint(work, makeView(work, image, {}), f.format, p);
    return fetchAll(work, image, f);
  });
}

VkImageBlit wholeBlit() {
  VkImageBlit b{};
  b.srcSubresource = b.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  b.srcOffsets[1] = b.dstOffsets[1] = {int32_t(kWidth), int32_t(kHeight), 1};
  return b;
}
VkFormat wideFormat(const ColourFormat& f) {
  return f.kind == Kind::kUint ? VK_FORMAT_R32G32B32A32_UINT : f.kind == Kind::kSint ? VK_FORMAT_R32G32B32A32_SINT : VK_FORMAT_R32G32B32A32_SFLOAT;
}

TEST_F(FormatsWithPeer, BlittedFrom) {
  everyFormat(VK_FORMAT_FEATURE_BLIT_SRC_BIT, 0, 0.5, [](Workspace& work, const ColourFormat& f) {
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT);
    fill(work, image, f);
    Image target = makeImage(work, wideFormat(f), VK_IMAGE_USAGE_SAMPLED_BIT);
    work.device.run([&](VkCommandBuffer commands) {
      VkImageBlit b = wholeBlit();
      vkCmdBlitImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, target.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &b, VK_FILTER_NEAREST);
      fullBarrier(commands);
    });
    return fetchAll(work, target, f);
  });
}

TEST_F(FormatsWithPeer, BlittedTo) {
  everyFormat(VK_FORMAT_FEATURE_BLIT_DST_BIT | VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT, 0, 1, [](Workspace& work, const ColourFormat& f) {
    Image source = makeImage(work, wideFormat(f), VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT);
    probe(work, std::string("layout(binding = 2) writeonly uniform ") + f.prefix() + "image2D image;",
          "int i = int(gl_GlobalInvocationID.x); imageStore(image, ivec2(ask(0).xy), " + patternOf(f) + ");", {storageBinding(makeView(work, source, {}))},
          grid());
    Image image = makeImage(work, f.format, VK_IMAGE_USAGE_SAMPLED_BIT);
    work.device.run([&](VkCommandBuffer commands) {
      VkImageBlit b = wholeBlit();
      vkCmdBlitImage(commands, source.handle, VK_IMAGE_LAYOUT_GENERAL, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &b, VK_FILTER_NEAREST);
      fullBarrier(commands);
    });
    return fetchAll(work, image, f);
  });
}

TEST_F(FormatsWithPeer, FetchedAsVertices) {
  // lavapipe 22.3.6 reads these three as something else than it samples them.
  auto wanted = [](const ColourFormat& f) {
    return f.format != VK_FORMAT_B4G4R4A4_UNORM_PACK16 && f.format != VK_FORMAT_R5G5B5A1_UNORM_PACK16 && f.format != VK_FORMAT_B5G5R5A1_UNORM_PACK16;
  };
  auto ask = [](Workspace& work, const ColourFormat& f) {
    constexpr uint32_t kCount = kWidth * kHeight;
    const uint32_t stride = (f.bytes + 3) & ~3u;  // attributes are aligned to their components
    Bytes packed = texels(f, kCount), spread(kCount * stride);
    for (uint32_t i = 0; i < kCount; ++i) std::memcpy(&spread[i * stride], &packed[i * f.bytes], f.bytes);
    Buffer vertices = work.bufferOf(spread, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    Image image = makeImage(work, wideFormat(f), VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT);
    Painting p;
    p.extent = {kWidth, kHeight};
    p.points = kCount;
    p.attribute = f.format;
    p.stride = stride;
    p.vertices = vertices.handle;
    p.vertex = "#version 450\nlayout(location = 0) in " + vectorOf(f) + " given;\nlayout(location = 0) flat out " + vectorOf(f) +
               " passed;\nvoid main() { passed = given; gl_PointSize = 1.0; gl_Position = vec4((float(gl_VertexIndex % 16) + 0.5) / 8.0 - 1.0, "
               "(float(gl_VertexIndex / 16) + 0.5) / 4.0 - 1.0, 0.5, 1); }";
    p.fragment = "#version 450\nlayout(location = 0) flat in " + vectorOf(f) + " passed;\nlayout(location = 0) out " + vectorOf(f) +
                 " colour;\nvoid main() { colour = passed; }";
    paint(work, makeView(work, image, {}), image.spec.format, p);
    return fetchAll(work, image, f);
  };
  everyFormat(0, VK_FORMAT_FEATURE_VERTEX_BUFFER_BIT, 0.5, ask, wanted);
}

VkBufferView bufferView(Workspace& work, const Buffer& buffer, VkFormat format) {
  return work.make(VkBufferViewCreateInfo{VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO, nullptr, 0, buffer.handle, format, 0, VK_WHOLE_SIZE});
}
std::vector<glm::vec4> fetchBuffer(Workspace& work, const Buffer& buffer, const ColourFormat& f) {
  Binding b{VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER};
  b.texels = bufferView(work, buffer, f.format);
  return probe(work, std::string("layout(binding = 2) uniform ") + f.prefix() + "samplerBuffer image;",
               "answer = " + floatOf(f, "texelFetch(image, int(gl_GlobalInvocationID.x))") + ";", {b}, grid());
}

TEST_F(FormatsWithPeer, FetchedFromBuffers) {
  everyFormat(0, VK_FORMAT_FEATURE_UNIFORM_TEXEL_BUFFER_BIT, 0.5, [](Workspace& work, const ColourFormat& f) {
    Buffer buffer = work.bufferOf(texels(f, kWidth * kHeight), VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT);
    return fetchBuffer(work, buffer, f);
  });
}

TEST_F(FormatsWithPeer, StoredToBuffers) {
  everyFormat(0, VK_FORMAT_FEATURE_STORAGE_TEXEL_BUFFER_BIT, 1, [](Workspace& work, const ColourFormat& f) {
    Buffer buffer = work.buffer(kWidth * kHeight * f.bytes, VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_TEXEL_BUFFER_BIT);
    Binding b{VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER};
    b.texels = bufferView(work, buffer, f.format);
    probe(work, std::string("layout(binding = 2) writeonly uniform ") + f.prefix() + "imageBuffer image;",
          "int i = int(gl_GlobalInvocationID.x); imageStore(image, i, " + patternOf(f) + ");", {b}, grid());
    auto loaded = probe(work, std::string("layout(binding = 2) readonly uniform ") + f.prefix() + "imageBuffer image;",
                        "answer = " + floatOf(f, "imageLoad(image, int(gl_GlobalInvocationID.x))") + ";", {b}, grid());
    return loaded;
  });
}

// The numeric type of scaled formats is floating point (specification, "Interpretation of Numeric Format"), so float32 holds their
// clear values.
TEST_P(Formats, ScaledFormatsAreClearedWithFloats) {
  struct Case {
    VkFormat format;
    VkClearColorValue value;
    uint32_t there;
  };
  for (const Case& c : {Case{VK_FORMAT_A2B10G10R10_SSCALED_PACK32, {{51, -2, 511, 1}}, 51u | 0x3feu << 10 | 0x1ffu << 20 | 1u << 30},
                        Case{VK_FORMAT_A2B10G10R10_USCALED_PACK32, {{51, 0, 1023, 3}}, 51u | 0x3ffu << 20 | 3u << 30},
                        Case{VK_FORMAT_R8G8B8A8_SSCALED, {{-1, 2, -128, 127}}, 0x7f8002ffu}}) {
    if (!device().supports(c.format, VK_FORMAT_FEATURE_TRANSFER_SRC_BIT | VK_FORMAT_FEATURE_TRANSFER_DST_BIT)) continue;
    Workspace work(device());
    Image image = makeImage(work, c.format, 0);
    work.device.run([&](VkCommandBuffer commands) {
      VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &c.value, 1, &range);
      fullBarrier(commands);
    });
    Bytes found = download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    uint32_t word;
    std::memcpy(&word, &found[(kWidth + 1) * 4], 4);
    EXPECT_EQ(word, c.there) << "format " << c.format;
  }
}

// Atomics on images and texel buffers: sums and orders that do not depend on who comes first.
TEST_P(Formats, Atomics) {
  for (bool isSigned : {false, true}) {
    Workspace work(device());
    const std::string p = isSigned ? "i" : "u", t = isSigned ? "int" : "uint";
    const VkFormat format = isSigned ? VK_FORMAT_R32_SINT : VK_FORMAT_R32_UINT;
    Image image = makeImage(work, format, VK_IMAGE_USAGE_STORAGE_BIT);
    work.device.run([&](VkCommandBuffer commands) {
      VkClearColorValue value{};
      VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &range);
      fullBarrier(commands);
    });
    Buffer buffer = work.buffer(64, VK_BUFFER_USAGE_STORAGE_TEXEL_BUFFER_BIT);
    std::memset(buffer.mapped, 0, 64);
    Binding texelBuffer{VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER};
    texelBuffer.texels = bufferView(work, buffer, format);
    probe(work, std::string("layout(binding = 2, r32") + (isSigned ? "i" : "ui") + ") uniform " + p + "image2D image; layout(binding = 3, r32" + (isSigned ? "i" : "ui") + ") uniform " + p + "imageBuffer buf;",
          t + " v = " + t + "(gl_GlobalInvocationID.x) + " + t + "(1);\n"
          "imageAtomicAdd(image, ivec2(3, 5), v); imageAtomicMax(image, ivec2(4, 5), v); imageAtomicOr(image, ivec2(5, 5), v);\n"
          "imageAtomicAdd(buf, 1, v); imageAtomicMin(buf, 2, -v); imageAtomicXor(buf, 3, v); imageAtomicCompSwap(buf, 4, " + t + "(0), " + t + "(7));",
          {storageBinding(makeView(work, image, {})), texelBuffer}, std::vector<glm::vec4>(200));
    Bytes found = download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    auto word = [](const void* at) {
      uint32_t v;
      std::memcpy(&v, at, 4);
      return v;
    };
    auto pixel = [&](uint32_t x) { return word(&found[(5 * kWidth + x) * 4]); };
    EXPECT_EQ(pixel(3), 20100u);
    EXPECT_EQ(pixel(4), 200u);
    EXPECT_EQ(pixel(5), 255u);
    EXPECT_EQ(word(buffer.mapped + 4), 20100u);
    EXPECT_EQ(word(buffer.mapped + 8), isSigned ? uint32_t(-200) : 0u);
    EXPECT_EQ(word(buffer.mapped + 12), 200u);
    EXPECT_EQ(word(buffer.mapped + 16), 7u);
  }
}

PUMICE_ON_BOTH_DEVICES(Formats);

}  // namespace
}  // namespace pumice::cts
