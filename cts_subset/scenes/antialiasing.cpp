// Antialiasing with 1, 2, 4, 8 and 16 samples a pixel, beside the same drawn eight times as large and averaged.
#include <algorithm>
#include <cmath>
#include <set>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kPanel = 96;
constexpr int kPanels = 6;  // three in a row
constexpr VkSampleCountFlagBits kCounts[] = {VK_SAMPLE_COUNT_1_BIT, VK_SAMPLE_COUNT_2_BIT, VK_SAMPLE_COUNT_4_BIT, VK_SAMPLE_COUNT_8_BIT, VK_SAMPLE_COUNT_16_BIT};

// White rays that become thinner than a pixel towards the middle.
std::vector<Vertex> rays(const glm::uvec2& size, double scale) {
  std::vector<Vertex> out;
  for (int i = 0; i < 36; ++i) {
    double angle = 6.283185307179586 * (i + 0.2) / 36;
    auto at = [&](double radius, double a) {
      auto snap = [&](double v) { return scale * std::round(v * 32) / 32; };
      return atPixel(size, snap(48.25 + radius * std::cos(a)), snap(47.625 + radius * std::sin(a)));
    };
    for (glm::vec4 p : {at(4, angle + 0.04), at(46, angle), at(46, angle + 0.08)}) out.push_back({p, glm::vec4(1)});
  }
  return out;
}

Picture drawRays(Device& device, uint32_t scale, VkSampleCountFlagBits samples) {
  Canvas canvas(device, kPanel * scale, kPanel * scale, VK_FORMAT_UNDEFINED, samples);
  Pipeline pipeline = canvas.pipeline({});
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer c) { canvas.drawVertices(c, pipeline, rays(canvas.size(), scale)); });
}

Picture renderAntialiasing(Device& device, Variant variant) {
  Picture whole(3 * kPanel, 2 * kPanel);
  auto place = [&](int panel, auto&& pixel) {
    for (uint32_t y = 0; y < kPanel; ++y)
      for (uint32_t x = 0; x < kPanel; ++x) {
        uint8_t* to = whole.at(x + uint32_t(panel % 3) * kPanel, y + uint32_t(panel / 3) * kPanel);
        for (int c = 0; c < 4; ++c) to[c] = pixel(x, y, c);
      }
  };
  for (int k = 0; k < 5; ++k) {
    // The error: eight samples in the place of sixteen.
    Picture panel = drawRays(device, 1, kCounts[variant == Variant::kBroken ? std::min(k, 3) : k]);
    place(k, [&](uint32_t x, uint32_t y, int c) { return panel.at(x, y)[c]; });
  }
  constexpr uint32_t kFactor = 8;
  Picture large = drawRays(device, kFactor, VK_SAMPLE_COUNT_1_BIT);
  place(5, [&](uint32_t x, uint32_t y, int c) {
    uint32_t sum = 0;
    for (uint32_t k = 0; k < kFactor * kFactor; ++k) sum += large.at(x * kFactor + k % kFactor, y * kFactor + k / kFactor)[c];
    return uint8_t((sum + kFactor * kFactor / 2) / (kFactor * kFactor));
  });
  return whole;
}

// n samples give n + 1 shades, all of which occur here; and with each doubling the picture comes nearer to the truth.
std::string verifyAntialiasing(const Picture& picture) {
  double before = 1e9;
  for (int k = 0; k < 5; ++k) {
    uint32_t left = uint32_t(k % 3) * kPanel, top = uint32_t(k / 3) * kPanel, samples = 1u << k;
    std::set<int> shades;
    double squares = 0;
    for (uint32_t y = 0; y < kPanel; ++y)
      for (uint32_t x = 0; x < kPanel; ++x) {
        int shade = picture.at(left + x, top + y)[0], truth = picture.at(2 * kPanel + x, kPanel + y)[0];
        shades.insert(shade);
        squares += double(shade - truth) * (shade - truth);
      }
    std::string what = std::to_string(samples) + " samples: ";
    if (shades.size() != samples + 1) return what + std::to_string(shades.size()) + " shades instead of " + std::to_string(samples + 1);
    double error = std::sqrt(squares / (kPanel * kPanel));
    if (!(error < 0.85 * before)) return what + "error " + std::to_string(error) + " after " + std::to_string(before);
    before = error;
  }
  return {};
}

}  // namespace

void addAntialiasingScenes(SceneList& scenes) {
  Scene scene;
  scene.name = "antialiasing";
  scene.broken = "eight samples instead of sixteen";
  scene.render = renderAntialiasing;
  scene.verify = verifyAntialiasing;
  scene.supported = [](const Device& d) {
    VkSampleCountFlags all = 1 | 2 | 4 | 8 | 16;
    return (d.properties.limits.framebufferColorSampleCounts & all) == all;
  };
  scenes.push_back(scene);
}

}  // namespace pumice::cts
