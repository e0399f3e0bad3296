// Anisotropic footprints, cube corners and reductions against formulas in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/texture/bound_image.h"

namespace pumice::texture {
namespace {

using ir::ImageDim;
using ir::ImageKind;
using ir::Type;

struct Vec2 {
  double x, y;
};

// The footprint's ellipse from the singular value decomposition of the derivatives.
struct Ellipse {
  double major, minor;
  Vec2 axis;  // unit vector
};
Ellipse ellipse(Vec2 dx, Vec2 dy) {
  double best = 0, bestAngle = 0;
  // The major axis is the longest image of a unit vector: found by angle, independently of any formula.
  auto length2 = [&](double t) {
    double x = dx.x * std::cos(t) + dy.x * std::sin(t), y = dx.y * std::cos(t) + dy.y * std::sin(t);
    return x * x + y * y;
  };
  for (int i = 0; i < 720; ++i) {
    double t = i * M_PI / 720;
    if (length2(t) > best) best = length2(t), bestAngle = t;
  }
  for (double step = M_PI / 720; step > 1e-12; step /= 2)
    for (double t : {bestAngle - step, bestAngle + step})
      if (length2(t) > best) best = length2(t), bestAngle = t;
  double major = std::sqrt(best);
  Vec2 axis{(dx.x * std::cos(bestAngle) + dy.x * std::sin(bestAngle)) / major, (dx.y * std::cos(bestAngle) + dy.y * std::sin(bestAngle)) / major};
  return {major, std::abs(dx.x * dy.y - dx.y * dy.x) / major, axis};
}

double wrapTexel(Bound& t, uint32_t level, int x, int y, int c) {
  const int size = 64 >> level;
  auto mod = [&](int v) { return uint32_t(((v % size) + size) % size); };
  return (t.image.pixel(mod(x), mod(y), level) >> (8 * c) & 255) / 255.0;
}
double bilinear(Bound& t, uint32_t level, double u, double v, int c) {
  double x = u * (64 >> level) - 0.5, y = v * (64 >> level) - 0.5;
  int x0 = int(std::floor(x)), y0 = int(std::floor(y));
  double a = x - x0, b = y - y0;
  return (1 - b) * ((1 - a) * wrapTexel(t, level, x0, y0, c) + a * wrapTexel(t, level, x0 + 1, y0, c)) +
         b * ((1 - a) * wrapTexel(t, level, x0, y0 + 1, c) + a * wrapTexel(t, level, x0 + 1, y0 + 1, c));
}

TEST(Anisotropy, AveragesAlongTheMajorAxisOfTheEllipse) {
  for (double limit : {2.0, 5.0, 16.0}) {
    Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {64, 64, 1}, 7));
    t.address(VK_SAMPLER_ADDRESS_MODE_REPEAT);
    t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR);
    t.sampler.anisotropy = 1;
    t.descriptor.sampler.maxAnisotropy = float(limit);
    ir::ImageOpInfo op;
    op.operands = ir::kImageGrad;
    std::mt19937 random(3);
    auto uniform = [&](double a, double b) { return a + (b - a) * (random() / 4294967296.0); };
    std::vector<std::vector<uint32_t>> in(6);
    std::vector<std::array<float, 6>> q;
    for (int n = 0; n < 2000; ++n) {
      // Any orientation: an ellipse of axes m and m / ratio, sheared in screen space.
      double m = std::exp2(uniform(-2, 5)), ratio = std::exp2(uniform(0, 5)), angle = uniform(0, 2 * M_PI), screen = uniform(0, 2 * M_PI);
      double ax = m * std::cos(angle), ay = m * std::sin(angle), bx = -m / ratio * std::sin(angle), by = m / ratio * std::cos(angle);
      std::array<float, 6> v = {float(uniform(-1, 2)), float(uniform(-1, 2)), float((ax * std::cos(screen) + bx * std::sin(screen)) / 64),
                                float((ay * std::cos(screen) + by * std::sin(screen)) / 64), float((-ax * std::sin(screen) + bx * std::cos(screen)) / 64),
                                float((-ay * std::sin(screen) + by * std::cos(screen)) / 64)};
      q.push_back(v);
      for (size_t i = 0; i < 6; ++i) in[i].push_back(word(v[i]));
    }
    auto out = t.run(op, std::vector<Type>(6, Type::F32), in);
    ASSERT_EQ(out.size(), 4u);
    int checked = 0;
    for (size_t n = 0; n < q.size(); ++n) {
      Ellipse e = ellipse({q[n][2] * 64.0, q[n][3] * 64.0}, {q[n][4] * 64.0, q[n][5] * 64.0});
      double count = std::min({e.major / e.minor, limit, std::max(e.major, 1.0)}) - 1.0 / 64;
      // Where f32 may choose another count, and where a circle has no axis, nothing is said.
      if (std::abs(count - std::nearbyint(count)) < 1e-3 || e.major / e.minor < 1.02) continue;
      ++checked;
      int samples = std::max(1, int(std::ceil(count)));
      double lambda = std::clamp(std::log2(std::max(e.minor, e.major / limit)), 0.0, 6.0);
      uint32_t level = uint32_t(std::min(std::floor(lambda), 5.0));
      double f = lambda - level;
      for (int c = 0; c < 4; ++c) {
        double sum = 0;
        for (int i = 0; i < samples; ++i) {
          double along = ((i + 0.5) / samples - 0.5) * e.major / 64;
          double u = q[n][0] + along * e.axis.x, v = q[n][1] + along * e.axis.y;
          sum += (1 - f) * bilinear(t, level, u, v, c) + f * bilinear(t, level + 1, u, v, c);
        }
        ASSERT_NEAR(real(out[size_t(c)][n]), sum / samples, 2e-4) << n << ": axes " << e.major << ", " << e.minor << " samples " << samples;
      }
    }
    EXPECT_GT(checked, 1000);
  }
}

TEST(Anisotropy, CountIsOneWithoutAFootprint) {
  Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {64, 64, 1}, 7));
  t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR);
  t.sampler.anisotropy = 1;
  t.descriptor.sampler.maxAnisotropy = 16;
  ir::ImageOpInfo op;
  op.operands = ir::kImageGrad;
  const float nan = NAN, inf = INFINITY;
  std::vector<std::vector<uint32_t>> in(6, std::vector<uint32_t>(3, 0));
  for (auto& row : in) row = {0, word(nan), word(inf)};
  in[0] = in[1] = std::vector<uint32_t>(3, word(0.25f));
  auto out = t.run(op, std::vector<Type>(6, Type::F32), in);  // ends
  for (int c = 0; c < 4; ++c) EXPECT_NEAR(real(out[size_t(c)][0]), bilinear(t, 0, 0.25, 0.25, c), 1e-6);
}

TEST(Reduction, MinimumAndMaximumOfTexelsWithAShare) {
  for (uint8_t mode : {VK_SAMPLER_REDUCTION_MODE_MIN, VK_SAMPLER_REDUCTION_MODE_MAX}) {
    Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {64, 64, 1}, 7));
    t.address(VK_SAMPLER_ADDRESS_MODE_REPEAT);
    t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR);
    t.sampler.reduction = mode;
    ir::ImageOpInfo op;
    op.operands = ir::kImageLod;
    std::mt19937 random(4);
    std::vector<std::vector<uint32_t>> in(3);
    for (int n = 0; n < 1000; ++n) {
      // Sixteenths of texels and of levels: shares of zero occur.
      in[0].push_back(word(float(random() % 2048) / 1024));
      in[1].push_back(word(float(random() % 2048) / 1024));
      in[2].push_back(word(float(random() % 64) / 16));
    }
    auto out = t.run(op, std::vector<Type>(3, Type::F32), in);
    for (size_t n = 0; n < in[0].size(); ++n)
      for (int c = 0; c < 4; ++c) {
        double best = mode == VK_SAMPLER_REDUCTION_MODE_MIN ? 2 : -1, lod = real(in[2][n]);
        for (uint32_t level = uint32_t(lod); level <= uint32_t(std::ceil(lod)); ++level) {
          double x = real(in[0][n]) * (64 >> level) - 0.5, y = real(in[1][n]) * (64 >> level) - 0.5;
          for (int dy = 0; dy < 2; ++dy)
            for (int dx = 0; dx < 2; ++dx) {
              if ((dx && x == std::floor(x)) || (dy && y == std::floor(y))) continue;
              double v = wrapTexel(t, level, int(std::floor(x)) + dx, int(std::floor(y)) + dy, c);
              best = mode == VK_SAMPLER_REDUCTION_MODE_MIN ? std::min(best, v) : std::max(best, v);
            }
        }
        ASSERT_FLOAT_EQ(real(out[size_t(c)][n]), float(best)) << n << " lod " << lod;
      }
  }
}

TEST(Cube, CornersAreTheAverageOfThreeTexels) {
  Bound t(randomImage(VK_FORMAT_R8G8B8A8_UNORM, {4, 4, 1}, 1, 6), VK_IMAGE_VIEW_TYPE_CUBE);
  t.filter(VK_FILTER_LINEAR, VK_FILTER_LINEAR);
  ir::ImageOpInfo op;
  op.dim = ImageDim::Cube;
  op.operands = ir::kImageLod;
  // The eight corners, each approached from each of its faces: exactly the average of the three texels there.
  std::vector<std::vector<uint32_t>> in(4);
  std::vector<std::array<double, 4>> expected;
  for (int corner = 0; corner < 8; ++corner) {
    double s[3] = {corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0};
    std::array<double, 4> average{};
    for (int axis = 0; axis < 3; ++axis) {
      // Spec, "Cube map face and coordinate selection": face, s and t of a direction.
      double sc, tc;
      uint32_t face = uint32_t(2 * axis + (s[axis] < 0));
      if (axis == 0) sc = s[0] > 0 ? -s[2] : s[2], tc = -s[1];
      else if (axis == 1) sc = s[0], tc = s[1] > 0 ? s[2] : -s[2];
      else sc = s[2] > 0 ? s[0] : -s[0], tc = -s[1];
      uint32_t p = t.image.pixel(sc > 0 ? 3 : 0, tc > 0 ? 3 : 0, 0, face);
      for (int c = 0; c < 4; ++c) average[size_t(c)] += (p >> (8 * c) & 255) / 255.0 / 3;
    }
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 3; ++i) in[size_t(i)].push_back(word(float(s[i]) * (i == axis ? 1.0f : 0x1.fffffcp-1f)));
      in[3].push_back(0);
      expected.push_back(average);
    }
  }
  auto out = t.run(op, std::vector<Type>(4, Type::F32), in);
  for (size_t n = 0; n < expected.size(); ++n)
    for (size_t c = 0; c < 4; ++c) ASSERT_NEAR(real(out[c][n]), expected[n][c], 2e-5) << "corner " << n / 3 << " from axis " << n % 3;
}

}  // namespace
}  // namespace pumice::texture
