// Samplers and view types: answers of compute shaders against lavapipe and, where that is approximate, against the specification's
// formulas in double precision.
#include "cts_subset/tests/probe.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace pumice::cts {
namespace {

constexpr VkImageUsageFlags kSampledUsage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;

class Sampling : public OnDevice {};

// Level, layer and slice sizes of an image with random bytes (floats in [0, 1] for 32-bit float formats).
Image randomImage(Workspace& work, ImageSpec spec, uint32_t texelBytes, bool floats = false) {
  spec.usage |= kSampledUsage;
  Image image = work.image(spec);
  toGeneral(work, image);
  for (uint32_t mip = 0; mip < spec.mips; ++mip) {
    auto size = [&](uint32_t whole) { return std::max(whole >> mip, 1u); };
    Piece piece;
    piece.mip = mip;
    piece.layers = spec.layers;
    piece.extent = {size(spec.extent.width), size(spec.extent.height), size(spec.extent.depth)};
    size_t texels = size_t(piece.extent.width) * piece.extent.height * piece.extent.depth * spec.layers;
    Bytes bytes = noise(texels * texelBytes, 77 + mip);
    if (floats)
      for (size_t i = 0; i + 4 <= bytes.size(); i += 4) {
        float v = float(bytes[i]) / 255.0f;
        std::memcpy(&bytes[i], &v, 4);
      }
    upload(work, image, piece, bytes, image.aspects);
  }
  return image;
}

struct Shape {
  const char* name;
  VkImageViewType type;
  VkImageType imageType;
  VkExtent3D extent;
  uint32_t layers;
  const char* sampler;  // GLSL
  const char* place;    // coordinate from the vec4 p
  const char* size;     // textureSize as vec4
};
const Shape kShapes[] = {
    {"1D", VK_IMAGE_VIEW_TYPE_1D, VK_IMAGE_TYPE_1D, {32, 1, 1}, 1, "sampler1D", "p.x", "vec4(textureSize(image, 1), 0, 0, 0)"},
    {"1DArray", VK_IMAGE_VIEW_TYPE_1D_ARRAY, VK_IMAGE_TYPE_1D, {32, 1, 1}, 5, "sampler1DArray", "vec2(p.x, p.z * 3)", "vec4(textureSize(image, 1), 0, 0)"},
    {"2D", VK_IMAGE_VIEW_TYPE_2D, VK_IMAGE_TYPE_2D, {32, 16, 1}, 1, "sampler2D", "p.xy", "vec4(textureSize(image, 1), 0, 0)"},
    {"2DArray", VK_IMAGE_VIEW_TYPE_2D_ARRAY, VK_IMAGE_TYPE_2D, {32, 16, 1}, 5, "sampler2DArray", "vec3(p.xy, p.z * 3)",
     "vec4(textureSize(image, 1), 0)"},
    {"3D", VK_IMAGE_VIEW_TYPE_3D, VK_IMAGE_TYPE_3D, {16, 8, 8}, 1, "sampler3D", "p.xyz", "vec4(textureSize(image, 1), 0)"},
    {"Cube", VK_IMAGE_VIEW_TYPE_CUBE, VK_IMAGE_TYPE_2D, {16, 16, 1}, 6, "samplerCube", "(p.xyz - 0.25)", "vec4(textureSize(image, 1), 0, 0)"},
    {"CubeArray", VK_IMAGE_VIEW_TYPE_CUBE_ARRAY, VK_IMAGE_TYPE_2D, {16, 16, 1}, 18, "samplerCubeArray",
     "vec4(p.xyz - 0.25, abs(p.w) * 1.1)", "vec4(textureSize(image, 1), 0)"},
};

std::vector<glm::vec4> places(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<glm::vec4> out;
  for (size_t i = 0; i < count; ++i) {
    glm::vec4 v;
    // Odd multiples of 1/2048: clear of texel borders and of cube edges.
    for (int c = 0; c < 4; ++c) v[c] = float(int(random() % 6144) - 2048) / 1536.0f + 1.0f / 8192;
    out.push_back(v);
  }
  return out;
}

// Share of answers that differ by more than `tolerance`, and the first of them.
std::string differences(const std::vector<glm::vec4>& q, const std::vector<glm::vec4>& a, const std::vector<glm::vec4>& b, double tolerance, double share) {
  size_t wrong = 0, first = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    bool bad = false;
    for (int c = 0; c < 4; ++c) bad |= !(std::abs(double(a[i][c]) - b[i][c]) <= tolerance);
    if (bad && wrong++ == 0) first = i;
  }
  if (double(wrong) <= share * double(a.size())) return {};
  auto text = [](glm::vec4 v) {
    return "(" + std::to_string(v.x) + ", " + std::to_string(v.y) + ", " + std::to_string(v.z) + ", " + std::to_string(v.w) + ")";
  };
  return std::to_string(wrong) + " of " + std::to_string(a.size()) + " differ; at " + text(q[first * (q.size() / a.size())]) + ": " + text(a[first]) +
         " against " + text(b[first]);
}

template <typename Ask>
std::string compareWithPeer(const std::vector<glm::vec4>& q, double tolerance, double share, Ask&& ask) {
  std::vector<glm::vec4> answers[2];
  Device* devices[2] = {world().tested.get(), world().peer.get()};
  for (int i = 0; i < 2; ++i) {
    Workspace work(*devices[i]);
    answers[i] = ask(work);
  }
  return differences(q, answers[0], answers[1], tolerance, share);
}

class SamplingWithPeer : public testing::Test {
 protected:
  void SetUp() override {
    PUMICE_NEED_TESTED();
    PUMICE_NEED_PEER();
  }
};

// lavapipe's weights have 8 bits, and its level weights too: a few units of 1/256, and other texels at a few places.
constexpr double kWeights = 4.0 / 256, kOtherTexels = 0.002;

TEST_F(SamplingWithPeer, EveryViewTypeFilterAndAddressMode) {
  const VkSamplerAddressMode kModes[] = {VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
                                         VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER, VK_SAMPLER_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE};
  auto q = places(1500, 3);
  for (const Shape& s : kShapes)
    for (int kind = 0; kind < 3; ++kind) {
      const bool cube = s.type == VK_IMAGE_VIEW_TYPE_CUBE || s.type == VK_IMAGE_VIEW_TYPE_CUBE_ARRAY;
      for (VkSamplerAddressMode mode : kModes) {
        if (cube && mode != VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE) continue;
        SCOPED_TRACE(std::string(s.name) + " filter " + std::to_string(kind) + " mode " + std::to_string(mode));
        auto ask = [&](Workspace& work) {
          ImageSpec spec;
          spec.type = s.imageType;
          spec.extent = s.extent;
          spec.layers = s.layers;
          spec.mips = 4;
          if (cube) spec.flags = VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
          Image image = randomImage(work, spec, 4);
          auto info = samplerInfo(kind == 0 ? VK_FILTER_NEAREST : VK_FILTER_LINEAR, mode,
                                  kind == 2 ? VK_SAMPLER_MIPMAP_MODE_LINEAR : VK_SAMPLER_MIPMAP_MODE_NEAREST);
          info.borderColor = VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
          info.minLod = 0.2f;
          info.maxLod = 2.6f;
          return probe(work, std::string("layout(binding = 2) uniform ") + s.sampler + " image;",
                       std::string("vec4 p = ask(0); answer = textureLod(image, ") + s.place + ", p.w * 2);",
                       {sampledBinding(makeView(work, image, {s.type}), work.make(info))}, q);
        };
        EXPECT_EQ(compareWithPeer(q, kind ? kWeights * 1.5 : 1e-5, kOtherTexels, ask), "");
      }
    }
}

TEST_P(Sampling, SizesAndLevels) {
  for (const Shape& s : kShapes) {
    Workspace work(device());
    ImageSpec spec;
    spec.type = s.imageType;
    spec.extent = s.extent;
    spec.layers = s.layers;
    spec.mips = 4;
    const bool cube = s.layers == 6 || s.layers == 18;
    if (cube) spec.flags = VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
    Image image = randomImage(work, spec, 4);
    auto a = probe(work, std::string("layout(binding = 2) uniform ") + s.sampler + " image;",
                   std::string("answer = ") + s.size + "; answer.w = textureQueryLevels(image);",
                   {sampledBinding(makeView(work, image, {s.type}), work.make(samplerInfo()))}, {{0, 0, 0, 0}});
    glm::vec4 want(s.extent.width / 2, 0, 0, 4);
    int at = 1;
    if (s.imageType != VK_IMAGE_TYPE_1D) want[at++] = float(s.extent.height / 2);
    if (s.imageType == VK_IMAGE_TYPE_3D) want[at++] = float(s.extent.depth / 2);
    if (s.type == VK_IMAGE_VIEW_TYPE_1D_ARRAY || s.type == VK_IMAGE_VIEW_TYPE_2D_ARRAY) want[at++] = float(s.layers);
    if (s.type == VK_IMAGE_VIEW_TYPE_CUBE_ARRAY) want[at++] = 3;
    EXPECT_EQ(a[0], want) << s.name;
  }
}

TEST_F(SamplingWithPeer, DepthComparison) {
  auto q = places(2000, 5);
  for (VkFilter filter : {VK_FILTER_NEAREST, VK_FILTER_LINEAR})
    for (VkFormat format : {VK_FORMAT_D16_UNORM, VK_FORMAT_D32_SFLOAT})
      for (VkCompareOp op : {VK_COMPARE_OP_LESS, VK_COMPARE_OP_GREATER_OR_EQUAL, VK_COMPARE_OP_NOT_EQUAL, VK_COMPARE_OP_NEVER}) {
        SCOPED_TRACE(std::to_string(filter) + " " + std::to_string(format) + " " + std::to_string(op));
        auto ask = [&](Workspace& work) {
          ImageSpec spec;
          spec.format = format;
          spec.extent = {16, 16, 1};
          spec.layers = 6;
          spec.flags = VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
          Image image = randomImage(work, spec, format == VK_FORMAT_D16_UNORM ? 2 : 4, format == VK_FORMAT_D32_SFLOAT);
          auto info = samplerInfo(filter, VK_SAMPLER_ADDRESS_MODE_REPEAT);
          info.compareEnable = VK_TRUE;
          info.compareOp = op;
          VkSampler sampler = work.make(info);
          ViewSpec view{VK_IMAGE_VIEW_TYPE_2D_ARRAY};
          return probe(work, "layout(binding = 2) uniform sampler2DArrayShadow image; layout(binding = 3) uniform samplerCubeShadow cube;",
                       "vec4 p = ask(0);\n"
                       "answer = textureGather(image, vec3(p.xy, p.z), fract(p.w));\n"
                       "answer.x = texture(image, vec4(p.xy, p.z * 3, fract(p.w)));\n"
                       "answer.y = texture(cube, vec4(p.xyz - 0.25, fract(p.w)));",
                       {sampledBinding(makeView(work, image, view), sampler), sampledBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_CUBE}), sampler)}, q);
        };
        EXPECT_EQ(compareWithPeer(q, kWeights, kOtherTexels * 3, ask), "");
      }
}

// The four texels by exact arithmetic: offsets far outside -8..7, single, four at once, and as a variable.
TEST_P(Sampling, GatherWithOffsets) {
  if (!device().features.shaderImageGatherExtended) {
    ASSERT_NE(GetParam(), Role::kTested);
    GTEST_SKIP();
  }
  const VkPhysicalDeviceLimits& l = device().properties.limits;
  if (GetParam() == Role::kTested) {
    EXPECT_EQ(l.minTexelGatherOffset, -32);
    EXPECT_EQ(l.maxTexelGatherOffset, 31u);
  }
  Workspace work(device());
  constexpr int kSide = 64;
  ImageSpec spec;
  spec.format = VK_FORMAT_R32G32_UINT;
  spec.extent = {kSide, kSide, 1};
  spec.usage |= kSampledUsage;
  Image image = work.image(spec);
  toGeneral(work, image);
  Bytes bytes(kSide * kSide * 8);
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    uint32_t v[2] = {i, 100000 + i};
    std::memcpy(&bytes[i * 8], v, 8);
  }
  Piece piece;
  piece.extent = spec.extent;
  upload(work, image, piece, bytes);
  std::mt19937 random(6);
  std::vector<glm::vec4> q;
  for (int i = 0; i < 500; ++i) {
    int32_t low = std::max(l.minTexelGatherOffset, -32), high = int32_t(std::min(l.maxTexelGatherOffset, 31u));
    auto offset = [&] { return low + int32_t(random() % uint32_t(high - low + 1)); };
    q.push_back({(float(random() % 64) + 0.75f) / kSide, (float(random() % 64) + 0.25f) / kSide, offset(), offset()});
  }
  auto view = sampledBinding(makeView(work, image, {}), work.make(samplerInfo(VK_FILTER_NEAREST, VK_SAMPLER_ADDRESS_MODE_REPEAT)));
  auto variable = probe(work, "layout(binding = 2) uniform usampler2D image;", "answer = vec4(textureGatherOffset(image, ask(0).xy, ivec2(ask(0).zw), 1));", {view}, q);
  auto four = probe(work, "layout(binding = 2) uniform usampler2D image;\nconst ivec2 o[4] = ivec2[](ivec2(-8, 7), ivec2(3, -2), ivec2(0, 0), ivec2(7, -8));",
                    "answer = vec4(textureGatherOffsets(image, ask(0).xy, o, 0));", {view}, q);
  const int kOffsets[4][2] = {{-8, 7}, {3, -2}, {0, 0}, {7, -8}}, kCorner[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  for (size_t n = 0; n < q.size(); ++n) {
    int x = int(std::floor(q[n].x * kSide - 0.5f)), y = int(std::floor(q[n].y * kSide - 0.5f));
    auto texel = [&](int tx, int ty) { return float(((ty % kSide + kSide) % kSide) * kSide + (tx % kSide + kSide) % kSide); };
    for (int i = 0; i < 4; ++i) {
      ASSERT_EQ(variable[n][i], 100000 + texel(x + int(q[n].z) + kCorner[i][0], y + int(q[n].w) + kCorner[i][1])) << n;
      ASSERT_EQ(four[n][i], texel(x + kOffsets[i][0], y + kOffsets[i][1])) << n;
    }
  }
}

TEST_P(Sampling, UnnormalisedCoordinates) {
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {19, 11, 1};
  Image image = randomImage(work, spec, 4);
  auto info = samplerInfo(VK_FILTER_NEAREST, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER);
  info.unnormalizedCoordinates = VK_TRUE;
  info.maxLod = 0;
  info.borderColor = VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
  std::vector<glm::vec4> q;
  for (int y = -2; y < 14; ++y)
    for (int x = -2; x < 22; ++x) q.push_back({x + 0.4f, y + 0.7f, 0, 0});
  auto a = probe(work, "layout(binding = 2) uniform sampler2D image;",
                 "ivec2 i = ivec2(floor(ask(0).xy)); bool inside = all(greaterThanEqual(i, ivec2(0))) && all(lessThan(i, textureSize(image, 0)));\n"
                 "answer = abs(textureLod(image, ask(0).xy, 0.0) - (inside ? texelFetch(image, i, 0) : vec4(1)));",
                 {sampledBinding(makeView(work, image, {}), work.make(info))}, q);
  for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i], glm::vec4(0)) << q[i].x << ", " << q[i].y;
}

TEST_P(Sampling, MinimumAndMaximum) {
  if (!device().has(VK_EXT_SAMPLER_FILTER_MINMAX_EXTENSION_NAME)) {
    ASSERT_NE(GetParam(), Role::kTested);
    GTEST_SKIP();
  }
  for (VkFormat format : {VK_FORMAT_R8_UNORM, VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R32_SFLOAT, VK_FORMAT_D16_UNORM, VK_FORMAT_D32_SFLOAT}) {
    if (!device().supports(format, VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_MINMAX_BIT)) {
      ASSERT_NE(GetParam(), Role::kTested) << format;
      continue;
    }
    for (VkSamplerReductionMode mode : {VK_SAMPLER_REDUCTION_MODE_MIN, VK_SAMPLER_REDUCTION_MODE_MAX}) {
      Workspace work(device());
      ImageSpec spec;
      spec.format = format;
      spec.extent = {16, 16, 1};
      const bool floats = format == VK_FORMAT_R32_SFLOAT || format == VK_FORMAT_D32_SFLOAT;
      Image image = randomImage(work, spec, format == VK_FORMAT_R8_UNORM ? 1 : format == VK_FORMAT_D16_UNORM ? 2 : 4, floats);
      VkSamplerReductionModeCreateInfo reduction{VK_STRUCTURE_TYPE_SAMPLER_REDUCTION_MODE_CREATE_INFO, nullptr, mode};
      auto info = samplerInfo(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT);
      info.pNext = &reduction;
      // Every texel of the footprint has a share that 8 bits can tell from none.
      auto q = places(1000, 9);
      for (glm::vec4& v : q) v = {(std::floor(v.x * 16) + 0.6f + 0.8f * std::abs(v.z) / 4) / 16, (std::floor(v.y * 16) + 0.6f + 0.8f * std::abs(v.w) / 4) / 16, 0, 0};
      auto a = probe(work, "layout(binding = 2) uniform sampler2D image;",
                     std::string("vec2 x = ask(0).xy * 16 - 0.5; ivec2 i = ivec2(floor(x)); vec4 m = texelFetch(image, i & 15, 0);\n"
                                 "for (int n = 1; n < 4; ++n) m = ") +
                         (mode == VK_SAMPLER_REDUCTION_MODE_MIN ? "min" : "max") +
                         "(m, texelFetch(image, (i + ivec2(n & 1, n >> 1)) & 15, 0));\n"
                         "answer = abs(textureLod(image, ask(0).xy, 0.0) - m);",
                     {sampledBinding(makeView(work, image, {}), work.make(info))}, q);
      for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i].x, 0.0f) << format << " mode " << mode << " at " << q[i].x << ", " << q[i].y;
    }
  }
}

TEST_P(Sampling, CustomBorders) {
  if (!device().has(VK_EXT_CUSTOM_BORDER_COLOR_EXTENSION_NAME)) {
    ASSERT_NE(GetParam(), Role::kTested);
    GTEST_SKIP();
  }
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {4, 4, 1};
  Image image = randomImage(work, spec, 4);
  spec.format = VK_FORMAT_R32G32B32A32_SINT;
  Image integers = randomImage(work, spec, 16);
  VkSamplerCustomBorderColorCreateInfoEXT custom{};
  custom.sType = VK_STRUCTURE_TYPE_SAMPLER_CUSTOM_BORDER_COLOR_CREATE_INFO_EXT;
  custom.customBorderColor.float32[0] = 0.125f;
  custom.customBorderColor.float32[1] = 0.625f;
  custom.customBorderColor.float32[2] = 0.25f;
  custom.customBorderColor.float32[3] = 0.75f;
  custom.format = VK_FORMAT_R8G8B8A8_UNORM;
  auto info = samplerInfo(VK_FILTER_NEAREST, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER);
  info.borderColor = VK_BORDER_COLOR_FLOAT_CUSTOM_EXT;
  info.pNext = &custom;
  VkSampler first = work.make(info);
  const int32_t kValues[4] = {-5, 1 << 30, 77, -1};
  std::memcpy(custom.customBorderColor.int32, kValues, sizeof kValues);
  custom.format = VK_FORMAT_R32G32B32A32_SINT;
  info.borderColor = VK_BORDER_COLOR_INT_CUSTOM_EXT;
  VkSampler second = work.make(info);
  auto a = probe(work, "layout(binding = 2) uniform sampler2D image; layout(binding = 3) uniform isampler2D integers;",
                 "answer = ask(0).z == 0 ? textureLod(image, ask(0).xy, 0.0) : intBitsToFloat(textureLod(integers, ask(0).xy, 0.0));",
                 {sampledBinding(makeView(work, image, {}), first), sampledBinding(makeView(work, integers, {}), second)}, {{-0.5f, 0.5f, 0, 0}, {0.5f, 1.5f, 1, 0}});
  for (int c = 0; c < 4; ++c) {
    EXPECT_NEAR(a[0][c], (glm::vec4(0.125f, 0.625f, 0.25f, 0.75f))[c], 1e-6);
    int32_t v;
    std::memcpy(&v, &a[1][c], 4);
    EXPECT_EQ(v, kValues[c]);
  }
}

// Given gradients: anisotropic filtering against the average along the ellipse's major axis, in the shader's own arithmetic.
TEST_P(Sampling, AnisotropicFootprints) {
  if (GetParam() != Role::kTested) GTEST_SKIP() << "lavapipe approximates";
  ASSERT_TRUE(device().features.samplerAnisotropy);
  ASSERT_EQ(device().properties.limits.maxSamplerAnisotropy, 16.0f);
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {64, 64, 1};
  spec.mips = 7;
  Image image = randomImage(work, spec, 4);
  auto info = samplerInfo(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_MIPMAP_MODE_LINEAR);
  VkSampler plain = work.make(info);
  info.anisotropyEnable = VK_TRUE;
  info.maxAnisotropy = 16;
  VkSampler anisotropic = work.make(info);
  std::mt19937 random(12);
  auto uniform = [&](double a, double b) { return a + (b - a) * (random() / 4294967296.0); };
  std::vector<glm::vec4> q;  // place; axes of the ellipse: angle, major, minor in texels
  for (int i = 0; i < 2000; ++i) {
    double major = std::exp2(uniform(0, 5));
    q.push_back({uniform(-1, 2), uniform(-1, 2), uniform(0, 6.28), 0});
    // Half way between two counts of samples.
    double count = std::floor(uniform(1, std::min(16.0, major))) + 0.5;
    q.push_back({major, major / std::min(count, 16.0), uniform(0, 6.28), 0});
  }
  VkImageView view = makeView(work, image, {});
  auto a = probe(work, "layout(binding = 2) uniform sampler2D tested; layout(binding = 3) uniform sampler2D plain;",
                 "vec4 p = ask(0), e = ask(1);\n"
                 "vec2 u = vec2(cos(p.z), sin(p.z)) * e.x / 64, v = vec2(-sin(p.z), cos(p.z)) * e.y / 64;\n"
                 "vec2 dx = u * cos(e.z) + v * sin(e.z), dy = -u * sin(e.z) + v * cos(e.z);\n"
                 "float n = ceil(min(min(e.x / e.y, 16.0), max(e.x, 1.0)) - 1.0 / 64); vec4 sum = vec4(0);\n"
                 "for (float i = 0; i < n; ++i) sum += textureLod(plain, p.xy + ((i + 0.5) / n - 0.5) * u, log2(e.y));\n"
                 "answer = abs(textureGrad(tested, p.xy, dx, dy) - sum / n);",
                 {sampledBinding(view, anisotropic), sampledBinding(view, plain)}, q, 2);
  size_t wrong = 0;
  for (glm::vec4 v : a) wrong += std::max({v.x, v.y, v.z, v.w}) > 2e-3;
  EXPECT_LE(wrong, a.size() / 200);  // counts that round the other way
}

TEST_P(Sampling, MinLodOfTheShader) {
  if (!device().features.shaderResourceMinLod) {
    ASSERT_NE(GetParam(), Role::kTested);
    GTEST_SKIP();
  }
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {32, 32, 1};
  spec.mips = 6;
  Image image = randomImage(work, spec, 4);
  auto info = samplerInfo(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_MIPMAP_MODE_LINEAR);
  auto a = probe(work, "#extension GL_ARB_sparse_texture_clamp : require\nlayout(binding = 2) uniform sampler2D image;",
                 "vec4 p = ask(0); answer = abs(textureGradClampARB(image, p.xy, vec2(exp2(p.z) / 32, 0), vec2(0), p.w + 1) - textureLod(image, p.xy, max(p.z, p.w + 1)));",
                 {sampledBinding(makeView(work, image, {}), work.make(info))}, places(500, 4));
  for (glm::vec4 v : a) ASSERT_LE(std::max({v.x, v.y, v.z, v.w}), 2e-3f);
}

PUMICE_ON_BOTH_DEVICES(Sampling);

}  // namespace
}  // namespace pumice::cts
