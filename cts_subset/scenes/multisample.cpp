// Four samples a pixel: coverage of each sample, depth of each sample, and the resolve.
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;
constexpr VkSampleCountFlagBits kSamples = VK_SAMPLE_COUNT_4_BIT;

double toGrid(double pixels) { return std::round(pixels * 256) / 256; }

// Thin spokes about a centre, on the sub-pixel grid. The standard sample positions lie on 1/16 of a pixel, so
// that the axis-parallel edges at 3/8 and 7/8 pass exactly through samples.
std::vector<Vertex> spokes(const glm::uvec2& canvas, double shift) {
  std::vector<Vertex> out;
  for (int i = 0; i < 36; ++i) {
    double angle = 6.283185307179586 * i / 36, half = 0.04;
    auto rim = [&](double a) {
      return atPixel(canvas, toGrid(128.375 + 120 * std::cos(a)) + shift,
                     toGrid(128.875 + 120 * std::sin(a)) + shift);
    };
    glm::vec4 colour = glm::vec4(80 + i * 4, 255 - i * 5, 120, 255) / 255.0f;
    out.push_back({atPixel(canvas, 128.375 + shift, 128.875 + shift), colour});
    out.push_back({rim(angle), colour});
    out.push_back({rim(angle + 2 * half), colour});
  }
  return out;
}

Picture renderSpokes(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_UNDEFINED, kSamples);
  Pipeline pipeline = canvas.pipeline({});
  auto vertices = spokes(canvas.size(), variant == Variant::kBroken ? 1.0 / 256 : 0);
  return canvas.draw({0, 0, 0, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

// Two slanted quads through each other: each sample has its own depth.
Picture renderDepthSamples(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT,
                variant == Variant::kBroken ? VK_SAMPLE_COUNT_1_BIT : kSamples);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<Vertex> vertices;
  auto quad = [&](float z0, float z1, glm::vec4 colour) {
    Vertex a{atPixel(canvas.size(), 20.25, 20, z0), colour}, b{atPixel(canvas.size(), 240, 30.5, z1), colour};
    Vertex c{atPixel(canvas.size(), 230.5, 240.25, z1), colour},
        d{atPixel(canvas.size(), 10, 220, z0), colour};
    for (const Vertex& v : {a, b, c, a, c, d}) vertices.push_back(v);
  };
  quad(0.1f, 0.9f, {1, 0, 0, 1});
  quad(0.8f, 0.35f, {0, 0, 1, 1});
  return canvas.draw({0, 0, 0, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

}  // namespace

void addMultisampleScenes(SceneList& scenes) {
  auto supported = [](const Device& device) {
    VkSampleCountFlags counts = device.properties.limits.framebufferColorSampleCounts &
                                device.properties.limits.framebufferDepthSampleCounts;
    return (counts & kSamples) && device.properties.limits.standardSampleLocations;
  };
  Scene rays;
  rays.name = "samples_4_coverage";
  rays.broken = "vertices 1/256 px off";
  rays.render = renderSpokes;
  rays.supported = supported;
  scenes.push_back(rays);

  Scene depth;
  depth.name = "samples_4_depth";
  depth.broken = "one sample instead of four";
  depth.render = renderDepthSamples;
  depth.supported = supported;
  // Depths of two planes can tie at a sample on the line where they meet: that sample, a quarter of the
  // pixel, may go either way.
  depth.expectation = [] {
    Expectation e;
    e.stepFunctions = true;
    e.stepShare = 0.0005;
    return e;
  };
  scenes.push_back(depth);
}

}  // namespace pumice::cts
