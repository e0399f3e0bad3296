// Sampling through expandImage() against the specification's formulas in double precision.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "tests/texture/bound_image.h"

namespace pumice::texture {
namespace {

using ir::ImageDim;
using ir::ImageKind;
using ir::Type;

// Texel index by the address mode; -1: border (spec, "Texel Addressing" / wrapping operation).
int wrap(VkSamplerAddressMode mode, int64_t i, int size) {
  auto mod = [](int64_t a, int64_t n) { return (a % n + n) % n; };
  auto mirror = [](int64_t n) { return n >= 0 ? n : -(1 + n); };
  switch (mode) {
    case VK_SAMPLER_ADDRESS_MODE_REPEAT: return int(mod(i, size));
    case VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT: return int(size - 1 - mirror(mod(i, 2 * size) - size));
    case VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE: return int(std::clamp<int64_t>(i, 0, size - 1));
    case VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER: return i < 0 || i >= size ? -1 : int(i);
    default: return int(std::clamp<int64_t>(mirror(i), 0, size - 1));
  }
}

// One component of an RGBA8 texel.
double texel(Bound& t, uint32_t level, uint32_t layer, const int (&at)[3], int c) {
  const LevelLayout& l = t.image.layout.planes[0].levels[level];
  const uint32_t size[3] = {l.width, l.height, l.depth};
  const uint8_t modes[3] = {t.sampler.addressU, t.sampler.addressV, t.sampler.addressW};
  uint32_t wrapped[3];
  for (int i = 0; i < 3; ++i) {
    int w = wrap(VkSamplerAddressMode(modes[i]), at[i], int(size[i]));
    if (i == 2 && size[2] == 1) w = 0;
    if (w < 0) return t.descriptor.sampler.border[c];
    wrapped[i] = uint32_t(w);
  }
  return double(uint8_t(t.image.element(kColor, level, layer, wrapped[0], wrapped[1], wrapped[2])[c])) / 255;
}

double filtered(Bound& t, VkFilter filter, uint32_t level, uint32_t layer, const double (&uvw)[3], int dimensions, int c, const int (&offset)[3]) {
  const LevelLayout& l = t.image.layout.planes[0].levels[level];
  const uint32_t size[3] = {l.width, l.height, l.depth};
  double sum = 0;
  for (int corner = 0; corner < (filter == VK_FILTER_LINEAR ? 1 << dimensions : 1); ++corner) {
    int at[3] = {};
    double weight = 1;
    for (int i = 0; i < dimensions; ++i) {
      double x = uvw[i] * size[i] - (filter == VK_FILTER_LINEAR ? 0.5 : 0.0);
      double f = std::floor(x), a = x - f;
      at[i] = int(f) + (corner >> i & 1) + offset[i];
      if (filter == VK_FILTER_LINEAR) weight *= corner >> i & 1 ? a : 1 - a;
    }
    sum += weight * texel(t, level, layer, at, c);
  }
  return sum;
}

// Coordinates that keep away from where f32 and double may choose different texels.
std::vector<double> coordinates(size_t count, uint32_t seed, double low, double high, uint32_t size) {
  std::mt19937 random(seed);
  std::vector<double> v;
  while (v.size() < count) {
    float x = float(low + (high - low) * (random() / 4294967296.0));
    double texelPosition = double(x) * size, f = texelPosition - std::floor(texelPosition);
    if (f > 0.01 && f < 0.99) v.push_back(x);
  }
  return v;
}

constexpr VkSamplerAddressMode kModes[] = {VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
                                           VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER, VK_SAMPLER_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE};

void expectSamples(Bound& t, ImageDim dim, bool arrayed, bool withOffset = false) {
  const int dimensions = int(imageDimensions(dim));
  ir::ImageOpInfo op;
  op.dim = dim;
  op.arrayed = arrayed;
  op.operands = ir::kImageLod | (withOffset ? ir::kImageOffset : 0);
  const size_t count = 600;
  std::vector<std::vector<uint32_t>> in;
  std::vector<Type> types;
  std::vector<double> uvw[3];
  const uint32_t size[3] = {t.descriptor.image.width, t.descriptor.image.height, t.descriptor.image.depth};
  for (int i = 0; i < dimensions; ++i) {
    uvw[i] = coordinates(count, 40 + uint32_t(i), -2.6, 3.1, size[i]);
    in.emplace_back();
    for (double x : uvw[i]) in.back().push_back(word(float(x)));
    types.push_back(Type::F32);
  }
  std::mt19937 random(8);
  std::vector<float> layers(count), lods(count);
  if (arrayed) {
    in.emplace_back();
    types.push_back(Type::F32);
    for (float& l : layers) in.back().push_back(word(l = float(random() % 60) / 10 - 1));
  }
  in.emplace_back();
  types.push_back(Type::F32);
  for (float& l : lods) in.back().push_back(word(l = float(random() % 500) / 100 - 1 + 0.003f));
  std::vector<std::array<int, 3>> offsets(count);
  if (withOffset)
    for (int i = 0; i < dimensions; ++i) {
      in.emplace_back();
      types.push_back(Type::I32);
      for (auto& o : offsets) in.back().push_back(uint32_t(o[size_t(i)] = int(random() % 16) - 8));
    }
  auto out = t.run(op, types, in);
  ASSERT_EQ(out.size(), 4u);

  const int last = int(t.descriptor.image.levelCount) - 1;
  for (size_t n = 0; n < count; ++n) {
    double uvwn[3] = {uvw[0][n], dimensions > 1 ? uvw[1][n] : 0, dimensions > 2 ? uvw[2][n] : 0};
    int offset[3] = {offsets[n][0], offsets[n][1], offsets[n][2]};
    double lambda = std::clamp(double(lods[n]) + t.descriptor.sampler.lodBias, double(t.descriptor.sampler.minLod), double(t.descriptor.sampler.maxLod));
    VkFilter filter = VkFilter(lambda <= 0 ? t.sampler.magFilter : t.sampler.minFilter);
    uint32_t layer = arrayed ? uint32_t(std::clamp(int(std::nearbyint(layers[n])), 0, int(t.descriptor.image.layerCount) - 1)) : 0;
    double d = std::clamp(lambda, 0.0, double(last));
    for (int c = 0; c < 4; ++c) {
      double want;
      if (t.sampler.mipmapMode == VK_SAMPLER_MIPMAP_MODE_NEAREST) {
        want = filtered(t, filter, uint32_t(std::max(0.0, std::ceil(d + 0.5) - 1)), layer, uvwn, dimensions, c, offset);
      } else {
        double a = d - std::floor(d);
        uint32_t high = uint32_t(std::floor(d)), low = std::min(high + 1, uint32_t(last));
        want = (1 - a) * filtered(t, filter, high, layer, uvwn, dimensions, c, offset) + a * filtered(t, filter, low, layer, uvwn, dimensions, c, offset);
      }
      ASSERT_NEAR(real(out[size_t(c)][n]), want, 2e-5) << "component " << c << " at " << uvwn[0] << ' ' << uvwn[1] << ' ' << uvwn[2] << " lod " << lods[n] << " layer " << layer;
    }
  }
}

TEST(Sample, FiltersAndAddressModesIn2D) {
  for (VkSamplerAddressMode mode : kModes)
    for (VkFilter f : {VK_FILTER_NEAREST, VK_FILTER_LINEAR}) {
      SCOPED_TRACE(int(mode) * 10 + int(f));
      Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {13, 7, 1}));
      t.address(mode);
      t.filter(f, f);
      t.descriptor.sampler.border[1] = 0.75f;
      t.descriptor.sampler.border[3] = 1.0f;
      expectSamples(t, ImageDim::D2, false);
    }
}

TEST(Sample, MipLevelsAndDifferentFilters) {
  for (VkSamplerMipmapMode mip : {VK_SAMPLER_MIPMAP_MODE_NEAREST, VK_SAMPLER_MIPMAP_MODE_LINEAR})
    for (int filters = 0; filters < 4; ++filters) {
      SCOPED_TRACE(int(mip) * 10 + filters);
      // Powers of two, so that texel positions on all levels keep clear of borders.
      Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {16, 8, 1}, 4, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL,
                          filters & 1 ? VK_IMAGE_USAGE_SAMPLED_BIT : VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT));
      if (filters == 3) t.view.tiled &= ~kCompact;  // as if it were one of many gigabytes
      t.address(VK_SAMPLER_ADDRESS_MODE_REPEAT);
      t.filter(VkFilter(filters & 1), VkFilter(filters >> 1), mip);
      t.descriptor.sampler.lodBias = 0.37f;
      t.descriptor.sampler.minLod = -1.0f;
      t.descriptor.sampler.maxLod = 2.71f;
      expectSamples(t, ImageDim::D2, false);
    }
}

TEST(Sample, OneDimensionThreeDimensionsAndArrays) {
  for (VkFilter f : {VK_FILTER_NEAREST, VK_FILTER_LINEAR}) {
    Bound line(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {19, 1, 1}, 1, 1, VK_IMAGE_TYPE_1D), VK_IMAGE_VIEW_TYPE_1D);
    Bound lines(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {19, 1, 1}, 1, 3, VK_IMAGE_TYPE_1D), VK_IMAGE_VIEW_TYPE_1D_ARRAY);
    Bound volume(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {7, 9, 5}, 1, 1, VK_IMAGE_TYPE_3D), VK_IMAGE_VIEW_TYPE_3D);
    Bound array(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {8, 8, 1}, 3, 4), VK_IMAGE_VIEW_TYPE_2D_ARRAY);
    Bound rows(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {11, 6, 1}, 1, 1, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_LINEAR));
    Bound sampledVolume(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {7, 9, 5}, 1, 1, VK_IMAGE_TYPE_3D, VK_IMAGE_TILING_OPTIMAL, VK_IMAGE_USAGE_SAMPLED_BIT),
                        VK_IMAGE_VIEW_TYPE_3D);
    Bound vast(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {8, 8, 1}, 3, 4), VK_IMAGE_VIEW_TYPE_2D_ARRAY);
    vast.view.tiled &= ~kCompact;
    for (Bound* t : {&line, &lines, &volume, &array, &rows, &sampledVolume, &vast}) {
      t->address(VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT);
      t->sampler.addressV = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
      t->filter(f, f);
    }
    expectSamples(line, ImageDim::D1, false);
    expectSamples(lines, ImageDim::D1, true);
    expectSamples(volume, ImageDim::D3, false);
    expectSamples(array, ImageDim::D2, true);
    expectSamples(vast, ImageDim::D2, true);
    expectSamples(sampledVolume, ImageDim::D3, false);
    expectSamples(rows, ImageDim::D2, false);
  }
}

TEST(Sample, TexelOffsets) {
  for (VkSamplerAddressMode mode : kModes) {
    Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {5, 3, 1}));
    t.address(mode);
    t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR);
    expectSamples(t, ImageDim::D2, false, true);
  }
}

TEST(Sample, ImplicitLevelFollowsTheDerivatives) {
  Bound t(TestImage(VK_FORMAT_R8G8B8A8_UNORM, {64, 64, 1}, 7));
  for (uint32_t level = 0; level < 7; ++level)
    for (uint32_t y = 0; y < 64u >> level; ++y)
      for (uint32_t x = 0; x < 64u >> level; ++x) t.image.setPixel(x, y, 30 * level, level);
  t.address(VK_SAMPLER_ADDRESS_MODE_REPEAT);
  t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR);
  ir::ImageOpInfo op;
  op.implicitLod = true;
  std::vector<std::vector<uint32_t>> in(2);
  std::vector<double> expected;
  for (int quad = 0; quad < 32; ++quad) {
    // du/dx = a, dv/dx = b, du/dy = c: in texels of the base level.
    double a = 0.5 + quad * 0.7, b = quad * 0.3, c = quad % 5;
    for (int lane = 0; lane < 4; ++lane) {
      in[0].push_back(word(float((lane & 1 ? a : 0) / 64 + (lane & 2 ? c : 0) / 64)));
      in[1].push_back(word(float((lane & 1 ? b : 0) / 64)));
      expected.push_back(std::clamp(std::log2(std::max(std::hypot(a, b), c)), 0.0, 6.0));
    }
  }
  auto out = t.run(op, {Type::F32, Type::F32}, in);
  for (size_t n = 0; n < expected.size(); ++n) EXPECT_NEAR(real(out[0][n]) * 255 / 30, expected[n], 1e-3) << n;

  op.kind = ImageKind::QueryLod;
  auto lod = t.run(op, {Type::F32, Type::F32}, in);
  for (size_t n = 0; n < expected.size(); ++n) EXPECT_NEAR(real(lod[0][n]), expected[n], 1e-4);

  // Gradients that are given name the same level.
  op.kind = ImageKind::Sample;
  op.implicitLod = false;
  op.operands = ir::kImageGrad;
  std::vector<std::vector<uint32_t>> gradient(6, std::vector<uint32_t>(1));
  gradient[2][0] = word(8.0f / 64);
  out = t.run(op, std::vector<Type>(6, Type::F32), gradient);
  EXPECT_NEAR(real(out[0][0]) * 255 / 30, 3.0, 1e-3);
}

// Filtering leaves the division (and shifts) of Unorm texels to the end: the same value for every layout of components.
TEST(Sample, LinearFilterOfEveryUnormFormat) {
  for (const FormatInfo& f : allFormats()) {
    if (f.isCompressed() || f.isDepthStencil() || f.isMultiPlanar() || f.rgba[0].numeric != Numeric::Unorm) continue;
    SCOPED_TRACE(f.name);
    Bound t(randomImage(f.format, {16, 16, 1}));
    t.view.format = formatKey(f);
    t.address(VK_SAMPLER_ADDRESS_MODE_REPEAT);
    t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR);
    ir::ImageOpInfo fetch;
    fetch.kind = ImageKind::Fetch;
    std::vector<std::vector<uint32_t>> places(2);
    for (uint32_t i = 0; i < 256; ++i) {
      places[0].push_back(i % 16);
      places[1].push_back(i / 16);
    }
    auto texels = t.run(fetch, {Type::I32, Type::I32}, places);
    ir::ImageOpInfo op;
    op.operands = ir::kImageLod;
    std::mt19937 random(uint32_t(f.format));
    std::vector<std::vector<uint32_t>> in(3);
    for (int n = 0; n < 512; ++n) {
      // -1e-9 comes out as exactly 1 when its periodic part is removed.
      for (size_t i = 0; i < 2; ++i) in[i].push_back(word(n == int(i) ? -1e-9f : float(random() % 8192) / 2048.0f - 2.0f));
      in[2].push_back(0);
    }
    auto out = t.run(op, std::vector<Type>(3, Type::F32), in);
    for (size_t n = 0; n < 512; ++n) {
      double x = real(in[0][n]) * 16.0 - 0.5, y = real(in[1][n]) * 16.0 - 0.5;
      int x0 = int(std::floor(x)), y0 = int(std::floor(y));
      double a = x - x0, b = y - y0;
      for (size_t c = 0; c < 4; ++c) {
        auto texel = [&](int tx, int ty) { return double(real(texels[c][size_t((ty & 15) * 16 + (tx & 15))])); };
        double want = (1 - b) * ((1 - a) * texel(x0, y0) + a * texel(x0 + 1, y0)) + b * ((1 - a) * texel(x0, y0 + 1) + a * texel(x0 + 1, y0 + 1));
        ASSERT_NEAR(real(out[c][n]), want, 4e-7) << "component " << c << " at " << real(in[0][n]) << ", " << real(in[1][n]);
      }
    }
  }
}

TEST(Sample, CubeFacesAreChosenByTheMajorAxisAndEdgesAreSeamless) {
  Bound t(TestImage(VK_FORMAT_R8G8B8A8_UNORM, {8, 8, 1}, 1, 6), VK_IMAGE_VIEW_TYPE_CUBE);
  // Colours are a smooth function of direction: (d + 1) / 2 per component.
  auto direction = [](uint32_t face, double s, double tt, double (&d)[3]) {
    double x = 2 * s - 1, y = 2 * tt - 1;
    const double table[6][3] = {{1, -y, -x}, {-1, -y, x}, {x, 1, y}, {x, -1, -y}, {x, -y, 1}, {-x, -y, -1}};
    for (int i = 0; i < 3; ++i) d[i] = table[face][i];
  };
  for (uint32_t face = 0; face < 6; ++face)
    for (uint32_t y = 0; y < 8; ++y)
      for (uint32_t x = 0; x < 8; ++x) {
        double d[3];
        direction(face, (x + 0.5) / 8, (y + 0.5) / 8, d);
        uint32_t p = 0;
        for (int c = 0; c < 3; ++c) p |= uint32_t(std::lround((d[c] + 1) / 2 * 255)) << (8 * c);
        t.image.setPixel(x, y, p, 0, face);
      }
  ir::ImageOpInfo op;
  op.dim = ImageDim::Cube;
  op.operands = ir::kImageLod;
  std::mt19937 random(2);
  for (VkFilter f : {VK_FILTER_NEAREST, VK_FILTER_LINEAR}) {
    t.filter(f, f);
    std::vector<std::vector<uint32_t>> in(4);
    for (int n = 0; n < 3000; ++n) {
      for (int i = 0; i < 3; ++i) in[size_t(i)].push_back(word(float(int(random() % 2001) - 1000) / 700));
      in[3].push_back(word(0.0f));
    }
    auto out = t.run(op, std::vector<Type>(4, Type::F32), in);
    for (size_t n = 0; n < in[0].size(); ++n) {
      double d[3], largest = 0;
      for (size_t i = 0; i < 3; ++i) largest = std::max(largest, std::abs(double(real(in[i][n]))));
      if (largest == 0) continue;
      for (size_t i = 0; i < 3; ++i) d[i] = real(in[i][n]) / largest;
      // Nearest: half a texel (1/8 of [-1, 1]); linear: the function is linear within a face, and bent by less across an edge.
      for (size_t c = 0; c < 3; ++c) ASSERT_NEAR(real(out[c][n]) * 2 - 1, d[c], 0.126 + 0.01) << n;
    }
  }
}

TEST(Sample, DepthComparison) {
  TestImage image(VK_FORMAT_D32_SFLOAT, {4, 4, 1});
  for (uint32_t y = 0; y < 4; ++y)
    for (uint32_t x = 0; x < 4; ++x) {
      float depth = x < 2 ? 0.25f : 0.75f;
      std::memcpy(image.element(VK_IMAGE_ASPECT_DEPTH_BIT, 0, 0, x, y), &depth, 4);
    }
  Bound t(std::move(image), VK_IMAGE_VIEW_TYPE_2D, VK_IMAGE_ASPECT_DEPTH_BIT);
  t.address(VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE);
  t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR);
  t.sampler.compareEnable = 1;
  t.sampler.compareOp = VK_COMPARE_OP_LESS;
  ir::ImageOpInfo op;
  op.operands = ir::kImageDref | ir::kImageLod;
  // Reference 0.5 is less than 0.75 only: halfway between the two, half of it passes.
  auto out = t.run(op, std::vector<Type>(4, Type::F32),
                   {{word(0.5f), word(0.1f), word(0.9f), word(0.5625f)}, std::vector<uint32_t>(4, word(0.5f)), std::vector<uint32_t>(4, word(0.5f)), std::vector<uint32_t>(4, 0)});
  EXPECT_FLOAT_EQ(real(out[0][0]), 0.5f);
  EXPECT_FLOAT_EQ(real(out[0][1]), 0.0f);
  EXPECT_FLOAT_EQ(real(out[0][2]), 1.0f);
  EXPECT_FLOAT_EQ(real(out[0][3]), 0.75f);
}

TEST(Sample, GatherReturnsTheFootprint) {
  Bound t(randomImage(VK_FORMAT_R8G8B8A8_UINT, {8, 8, 1}));
  t.address(VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE);
  ir::ImageOpInfo op;
  op.kind = ImageKind::Gather;
  op.operands = ir::kImageGatherComponent;
  op.texelType = Type::I32;
  auto out = t.run(op, {Type::F32, Type::F32}, {{word(3.0f / 8)}, {word(5.0f / 8)}}, [](ir::Builder& b) { return std::vector<ir::Value>{b.i32(2)}; });
  auto blue = [&](uint32_t x, uint32_t y) { return t.image.pixel(x, y) >> 16 & 0xff; };
  EXPECT_EQ(out[0][0], blue(2, 5));
  EXPECT_EQ(out[1][0], blue(3, 5));
  EXPECT_EQ(out[2][0], blue(3, 4));
  EXPECT_EQ(out[3][0], blue(2, 4));
}

TEST(Sample, SwizzlesAndSrgb) {
  Bound t(randomImage(VK_FORMAT_R8G8B8A8_SRGB, {4, 4, 1}));
  t.view.swizzle[0] = VK_COMPONENT_SWIZZLE_B;
  t.view.swizzle[1] = VK_COMPONENT_SWIZZLE_ONE;
  t.view.swizzle[2] = VK_COMPONENT_SWIZZLE_ZERO;
  t.view.swizzle[3] = VK_COMPONENT_SWIZZLE_R;
  ir::ImageOpInfo op;
  op.operands = ir::kImageLod;
  auto out = t.run(op, std::vector<Type>(3, Type::F32), {{word(0.4f)}, {word(0.9f)}, {0}});
  auto decode = [](uint32_t v) { return v / 255.0 <= 0.04045 ? v / 255.0 / 12.92 : std::pow((v / 255.0 + 0.055) / 1.055, 2.4); };
  uint32_t p = t.image.pixel(1, 3);
  EXPECT_FLOAT_EQ(real(out[0][0]), float(decode(p >> 16 & 0xff)));
  EXPECT_EQ(real(out[1][0]), 1.0f);
  EXPECT_EQ(real(out[2][0]), 0.0f);
  EXPECT_FLOAT_EQ(real(out[3][0]), float(decode(p & 0xff)));
}

TEST(Fetch, OutsideGivesZeroAndInsideTheTexel) {
  Bound t(randomImage(VK_FORMAT_R8G8B8A8_UINT, {13, 9, 1}, 3, 4), VK_IMAGE_VIEW_TYPE_2D_ARRAY);
  ir::ImageOpInfo op;
  op.kind = ImageKind::Fetch;
  op.arrayed = true;
  op.operands = ir::kImageLod;
  op.texelType = Type::I32;
  std::mt19937 random(1);
  std::vector<std::vector<uint32_t>> in(4);
  for (int n = 0; n < 3000; ++n) {
    in[0].push_back(random() % 16 - 2);
    in[1].push_back(random() % 12 - 2);
    in[2].push_back(random() % 6 - 1);
    in[3].push_back(random() % 5 - 1);
  }
  in[0][0] = 0x80000000u;
  in[1][1] = 0x7fffffffu;
  auto out = t.run(op, std::vector<Type>(4, Type::I32), in);
  for (size_t n = 0; n < in[0].size(); ++n) {
    uint32_t x = in[0][n], y = in[1][n], layer = in[2][n], level = in[3][n];
    bool inside = level < 3 && layer < 4 && x < 13u >> level && y < 9u >> level;
    uint32_t p = inside ? t.image.pixel(x, y, level, layer) : 0;
    for (uint32_t c = 0; c < 4; ++c) ASSERT_EQ(out[c][n], p >> (8 * c) & 0xff) << n;
  }
}

TEST(Fetch, NullDescriptorsGiveZero) {
  Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {4, 4, 1}, 2));
  t.descriptor.image = {};
  t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR);
  ir::ImageOpInfo op;
  op.operands = ir::kImageLod;
  auto out = t.run(op, std::vector<Type>(3, Type::F32), {{word(0.4f)}, {word(0.9f)}, {0}});
  for (int c = 0; c < 4; ++c) EXPECT_EQ(out[size_t(c)][0], 0u);
  t.view = {};
  out = t.run(op, std::vector<Type>(3, Type::F32), {{word(0.4f)}, {word(0.9f)}, {0}});
  for (int c = 0; c < 4; ++c) EXPECT_EQ(out[size_t(c)][0], 0u);
}

TEST(Storage, WritesReadBackAndStayInside) {
  Bound t(randomImage(VK_FORMAT_R16G16B16A16_SFLOAT, {9, 7, 1}));
  ir::ImageOpInfo op;
  op.kind = ImageKind::Write;
  auto before = t.image.storage;
  std::vector<Type> types = {Type::I32, Type::I32, Type::F32, Type::F32, Type::F32, Type::F32};
  t.run(op, types, {{8, 9, 3, ~0u}, {6, 1, 7, 2}, std::vector<uint32_t>(4, word(1.0f)), std::vector<uint32_t>(4, word(-2.0f)), std::vector<uint32_t>(4, word(0.5f)), std::vector<uint32_t>(4, word(0.0f))});
  uint64_t got, want = 0x00003800c0003c00u;
  std::memcpy(&got, t.image.element(kColor, 0, 0, 8, 6), 8);
  EXPECT_EQ(got, want);
  std::byte* e = t.image.element(kColor, 0, 0, 8, 6);
  std::memcpy(e, reinterpret_cast<std::byte*>(before.data()) + (e - t.image.base()), 8);
  EXPECT_EQ(t.image.storage, before);

  op.kind = ImageKind::Read;
  auto out = t.run(op, {Type::I32, Type::I32}, {{8}, {6}});
  EXPECT_EQ(out.size(), 4u);
}

TEST(Storage, TexelBuffers) {
  uint16_t texels[] = {0x1111, 0x8421, 0xffff, 0xf800};
  BufferDescriptor d;
  d.base = reinterpret_cast<uint64_t>(texels);
  d.size = sizeof(texels);
  d.format = VK_FORMAT_R5G6B5_UNORM_PACK16;
  d.elements = 3;
  IrProgram program(1, 4, [&](ir::Builder& b) {
    ir::ImageOpInfo op;
    op.kind = ImageKind::Fetch;
    op.dim = ImageDim::Buffer;
    ImageRef ref{ir::kTableSet0, 0, b.i32(0), {}};
    ref.key.format = VK_FORMAT_R5G6B5_UNORM_PACK16;
    ir::Value operands[] = {b.i32(0), b.i32(0), b.input(Type::I32, 0)};
    auto t = expandImage(b, op, operands, ref, {}, nullptr);
    ASSERT_EQ(t.size(), 4u);
    for (uint32_t i = 0; i < 4; ++i) b.output(i, t[i]);
  });
  ASSERT_TRUE(program);
  program.setTable(ir::kTableSet0, &d, sizeof(d));
  auto out = program.run({{1, 2, 3, ~0u}});
  EXPECT_EQ(real(out[0][0]), 16 / 31.0f);
  EXPECT_EQ(real(out[1][0]), 33 / 63.0f);
  EXPECT_EQ(real(out[2][0]), 1 / 31.0f);
  EXPECT_EQ(real(out[0][1]), 1.0f);
  EXPECT_EQ(real(out[0][2]), 0.0f);  // beyond the view
  EXPECT_EQ(real(out[0][3]), 0.0f);
}

TEST(Storage, AtomicsGiveTheOldValue) {
  Bound t(TestImage(VK_FORMAT_R32_UINT, {4, 4, 1}));
  ir::ImageOpInfo op;
  op.kind = ImageKind::Atomic;
  op.texelType = Type::I32;
  op.atomic = ir::AtomicOp::Add;
  IrProgram program(3, 1, [&](ir::Builder& b) {
    ir::Value operands[] = {b.i32(0), b.i32(0), b.input(Type::I32, 0), b.input(Type::I32, 1), b.input(Type::I32, 2)};
    auto r = expandImage(b, op, operands, {ir::kTableSet0, 0, b.i32(0), t.view}, {}, nullptr);
    ASSERT_EQ(r.size(), 1u);
    b.output(0, r[0]);
  });
  ASSERT_TRUE(program);
  program.setTable(ir::kTableSet0, &t.descriptor, sizeof(t.descriptor));
  program.run({{3, 3, 4, 3}, {2, 2, 2, 2}, {5, 6, 100, 7}});
  EXPECT_EQ(t.image.pixel(3, 2), 18u);
}

TEST(Query, SizesOfLevelsAndArrays) {
  Bound t(TestImage(VK_FORMAT_R8G8B8A8_UNORM, {40, 20, 1}, 4, 12), VK_IMAGE_VIEW_TYPE_2D_ARRAY);
  auto query = [&](ImageDim dim, bool arrayed, ImageKind kind, uint16_t operands) {
    ir::ImageOpInfo op;
    op.kind = kind;
    op.dim = dim;
    op.arrayed = arrayed;
    op.operands = operands;
    op.texelType = Type::I32;
    return t.run(op, operands ? std::vector<Type>{Type::I32} : std::vector<Type>{}, {{2}});
  };
  auto size = query(ImageDim::D2, true, ImageKind::QuerySize, ir::kImageLod);
  EXPECT_EQ(size[0][0], 10u);
  EXPECT_EQ(size[1][0], 5u);
  EXPECT_EQ(size[2][0], 12u);
  auto cube = query(ImageDim::Cube, true, ImageKind::QuerySize, ir::kImageLod);
  EXPECT_EQ(cube[2][0], 2u);
  EXPECT_EQ(query(ImageDim::D2, true, ImageKind::QueryLevels, 0)[0][0], 4u);
}

}  // namespace
}  // namespace pumice::texture
