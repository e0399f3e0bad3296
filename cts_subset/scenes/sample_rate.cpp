// Sample counts, shading per sample, interpolation at samples, masks and alpha in and out.
#include <algorithm>
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 64;

struct Point { int64_t x, y; };   // 1/256 pixels

// A ring of triangles that share edges without overlap.
std::vector<std::array<Point, 3>> ring() {
  std::vector<std::array<Point, 3>> out;
  auto at = [](double radius, double angle) {
    return Point{int64_t(std::round(256 * (32.25 + radius * std::cos(angle)))), int64_t(std::round(256 * (31.5 + radius * std::sin(angle))))};
  };
  for (int i = 0; i < 9; ++i) {
    double a = 6.283185307179586 * i / 9, b = 6.283185307179586 * (i + 1) / 9;
    if (i % 3 != 2) out.push_back({Point{int64_t(32.25 * 256), int64_t(31.5 * 256)}, at(29, a), at(29, b)});
  }
  return out;
}

std::vector<Vertex> ringVertices(const glm::uvec2& canvas, double shift = 0) {
  std::vector<Vertex> out;
  for (const auto& triangle : ring())
    for (const Point& p : triangle) out.push_back({atPixel(canvas, double(p.x) / 256 + shift, double(p.y) / 256), {1, 1, 1, 1}});
  return out;
}

// Vulkan specification, "Standard sample locations", in 1/16 pixel.
std::vector<Point> standardLocations(uint32_t samples) {
  switch (samples) {
    case 2: return {{12, 12}, {4, 4}};
    case 4: return {{6, 2}, {14, 6}, {2, 10}, {10, 14}};
    case 8: return {{9, 5}, {7, 11}, {13, 9}, {5, 3}, {3, 13}, {1, 7}, {11, 15}, {15, 1}};
    default:
      return {{9, 9}, {7, 5}, {5, 10}, {12, 7}, {3, 6}, {10, 13}, {13, 11}, {11, 3}, {6, 14}, {8, 1}, {4, 2}, {2, 12}, {0, 8}, {15, 4}, {14, 15}, {1, 0}};
  }
}

Picture renderCoverage(Device& device, Variant variant, uint32_t samples) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_UNDEFINED, VkSampleCountFlagBits(samples));
  Pipeline pipeline = canvas.pipeline({});
  auto vertices = ringVertices(canvas.size(), variant == Variant::kBroken ? 1.0 / 32 : 0);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

// How many samples of every pixel are inside, by the exact rule.
std::string verifyCoverage(const Picture& picture, uint32_t samples) {
  auto locations = standardLocations(samples);
  auto triangles = ring();
  for (uint32_t y = 0; y < kSize; ++y)
    for (uint32_t x = 0; x < kSize; ++x) {
      uint32_t inside = 0;
      for (const Point& l : locations) {
        int64_t px = int64_t(x) * 256 + l.x * 16, py = int64_t(y) * 256 + l.y * 16;
        bool any = false;
        for (const auto& t : triangles) {   // corners go clockwise on the screen
          bool in = true;
          for (int k = 0; k < 3; ++k) {
            const Point &a = t[k], &b = t[(k + 1) % 3];
            int64_t e = (b.x - a.x) * (py - a.y) - (b.y - a.y) * (px - a.x);
            bool owns = b.y < a.y || (b.y == a.y && b.x > a.x);
            in &= e > 0 || (e == 0 && owns);
          }
          any |= in;
        }
        inside += any;
      }
      int expected = int(std::lround(255.0 * inside / samples));
      if (std::abs(picture.pixel(x, y)[0] - expected) > 1)
        return "pixel " + std::to_string(x) + "," + std::to_string(y) + " is " + std::to_string(picture.pixel(x, y)[0]) + ", but " +
               std::to_string(inside) + " of " + std::to_string(samples) + " samples are covered";
    }
  return {};
}

// The ring drawn by a fragment shader of the scene's, at `samples` samples. passed.xy is the position in pixels.
Picture renderShaded(Device& device, uint32_t samples, const std::string& inputs, const std::string& body, float minShading = 0,
                     const std::function<void(PipelineStates&)>& adjust = {}, bool centroid = false) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_UNDEFINED, VkSampleCountFlagBits(samples));
  PipelineSpec spec;
  spec.vertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) )" + std::string(centroid ? "centroid " : "") + R"(out vec4 passed;
void main() { gl_Position = position; passed = vec4((position.xy + 1) * 32, 0, 1); }
)";
  spec.fragment = "#version 450\n" + inputs + "layout(location = 0) out vec4 colour;\nvoid main() {\n" + body + "\n}\n";
  spec.adjust = [&](PipelineStates& s) {
    s.multisample.sampleShadingEnable = minShading > 0;
    s.multisample.minSampleShading = minShading;
    if (adjust) adjust(s);
  };
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = ringVertices(canvas.size());
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

constexpr const char* kPlainInput = "layout(location = 0) in vec4 passed;\n";

Picture renderSampleId(Device& device, Variant variant) {
  // Each sample its own channel: the resolved picture shows the coverage of samples 0, 1 and 2 apart.
  return renderShaded(device, 4, "",
                      variant == Variant::kBroken ? "colour = vec4(gl_SampleID == 1, gl_SampleID == 0, gl_SampleID == 2, 1);"
                                                  : "colour = vec4(gl_SampleID == 0, gl_SampleID == 1, gl_SampleID == 2, 1);");
}

Picture renderSamplePosition(Device& device, Variant variant) {
  return renderShaded(device, 4, variant == Variant::kBroken ? kPlainInput : "layout(location = 0) sample in vec4 passed;\n",
                      variant == Variant::kBroken ? "colour = vec4(fract(passed.xy), gl_SamplePosition.x, 1);"
                                                  : "colour = vec4(fract(passed.xy), gl_SamplePosition.x * fract(gl_FragCoord.y), 1);");
}

Picture renderSampleShading(Device& device, Variant variant) {
  // A checkerboard finer than a pixel: with one shading per pixel it would be one flat colour.
  return renderShaded(device, 4, kPlainInput, "vec2 c = step(0.5, fract(gl_FragCoord.xy)); colour = vec4(abs(c.x - c.y), c, 1);",
                      variant == Variant::kBroken ? 0.0f : 1.0f);
}

Picture renderInterpolateAt(Device& device, Variant variant) {
  return renderShaded(device, 4, kPlainInput,
                      std::string("vec2 a = interpolateAtOffset(passed, vec2(0.25, ") + (variant == Variant::kBroken ? "0.25" : "-0.375") +
                          ")).xy - passed.xy;\n"
                          "vec2 s = interpolateAtSample(passed, 2).xy - passed.xy;\n"
                          "colour = vec4(a + 0.5, s.x + s.y * 0.5 + 0.5, 1);");
}

std::string verifyInterpolateAt(const Picture& picture) {
  for (uint32_t x : {10u, 20u}) {   // covered whole
    auto p = picture.pixel(x, 36);
    const int expected[3] = {191, 32, 48};
    for (int c = 0; c < 3; ++c)
      if (std::abs(p[c] - expected[c]) > 1) return "channel " + std::to_string(c) + " is " + std::to_string(p[c]) + ", expected " + std::to_string(expected[c]);
  }
  return {};
}

Picture renderMaskIn(Device& device, Variant variant) {
  return renderShaded(device, 4, "", std::string("colour = vec4(float(bitCount(gl_SampleMaskIn[0]") + (variant == Variant::kBroken ? " | 1" : "") +
                                         "))) / vec4(4, 8, 16, 4);");
}

Picture renderMaskOut(Device& device, Variant variant) {
  return renderShaded(device, 4, "", std::string("gl_SampleMask[0] = int(gl_FragCoord.x) & ") + (variant == Variant::kBroken ? "7" : "15") +
                                         "; colour = vec4(1);");
}

Picture renderStaticMask(Device& device, Variant variant) {
  static const VkSampleMask kMasks[2] = {0x5, 0x4};
  return renderShaded(device, 4, "", "colour = vec4(1, 0.5, 0.25, 1);", 0,
                      [&](PipelineStates& s) { s.multisample.pSampleMask = &kMasks[variant == Variant::kBroken]; });
}

Picture renderAlphaToOne(Device& device, Variant variant) {
  return renderShaded(device, 4, "", "colour = vec4(1, 0.5, 0.25, 0.25);", 0,
                      [&](PipelineStates& s) { s.multisample.alphaToOneEnable = variant == Variant::kGood; });
}

Picture renderAlphaToCoverage(Device& device, Variant variant) {
  return renderShaded(device, 4, "", "colour = vec4(1, 1, 1, floor(gl_FragCoord.x / 8) / 8 + 0.0625);", 0,
                      [&](PipelineStates& s) { s.multisample.alphaToCoverageEnable = variant == Variant::kGood; });
}

// More alpha, more samples; none and all at the ends.
std::string verifyAlphaToCoverage(const Picture& picture) {
  int last = 0;
  for (uint32_t x = 8; x < 28; ++x) {
    int here = picture.pixel(x, 36)[0];
    if (here + 1 < last) return "less coverage for more alpha at " + std::to_string(x);
    if (here > 0) last = here;
  }
  if (picture.pixel(6, 36)[0] > 64) return "much coverage for little alpha";
  return {};
}

Picture renderCentroid(Device& device, Variant variant) {
  return renderShaded(device, 4, variant == Variant::kBroken ? kPlainInput : "layout(location = 0) centroid in vec4 passed;\n",
                      // Inside of the circle everywhere, if it is evaluated inside of the triangle.
                      "vec2 d = passed.xy - vec2(32.25, 31.5); colour = vec4(dot(d, d) > 29.05 * 29.05, 1, 0, 1);", 0, {}, variant == Variant::kGood);
}

std::string verifyCentroid(const Picture& picture) {
  for (uint32_t y = 0; y < kSize; ++y)
    for (uint32_t x = 0; x < kSize; ++x)
      if (picture.pixel(x, y)[0]) return "pixel " + std::to_string(x) + "," + std::to_string(y) + " was interpolated outside of its triangle";
  return {};
}

}  // namespace

void addSampleRateScenes(SceneList& scenes) {
  auto has = [](uint32_t samples) {
    return [samples](const Device& d) { return (d.properties.limits.framebufferColorSampleCounts & samples) && d.properties.limits.standardSampleLocations; };
  };
  for (uint32_t samples : {2u, 8u, 16u}) {
    Scene coverage;
    coverage.name = "samples_" + std::to_string(samples) + "_coverage";
    coverage.broken = "1/32 pixel off";
    coverage.render = [samples](Device& d, Variant v) { return renderCoverage(d, v, samples); };
    coverage.verify = [samples](const Picture& p) { return verifyCoverage(p, samples); };
    coverage.supported = has(samples);
    scenes.push_back(coverage);
  }
  auto add = [&](const char* name, const char* broken, Picture (*render)(Device&, Variant), bool rate) -> Scene& {
    Scene scene;
    scene.name = name;
    scene.broken = broken;
    scene.render = render;
    scene.supported = [four = has(4), rate](const Device& d) { return four(d) && (!rate || d.features.sampleRateShading); };
    scenes.push_back(scene);
    return scenes.back();
  };
  add("sample_id", "samples 0 and 1 exchanged", renderSampleId, true);
  add("sample_position", "one interpolation per pixel", renderSamplePosition, true).expectation = [] {
    Expectation e;
    e.stepFunctions = true;   // fract() on its border
    return e;
  };
  add("sample_shading", "one shading per pixel", renderSampleShading, true);
  Scene& at = add("interpolate_at", "another offset", renderInterpolateAt, true);
  at.verify = verifyInterpolateAt;
  // lavapipe 22.3 interpolates at the pixel's centre whatever the offset.
  at.supported = [four = has(4)](const Device& d) { return four(d) && d.features.sampleRateShading && !d.name().starts_with(kLavapipeName); };
  add("sample_mask_in", "a sample too many", renderMaskIn, false);
  add("sample_mask_out", "a sample too few", renderMaskOut, false);
  add("sample_mask_static", "another mask", renderStaticMask, false);
  add("alpha_to_one", "alpha stays", renderAlphaToOne, false).supported = [four = has(4)](const Device& d) { return four(d) && d.features.alphaToOne; };
  Scene& coverage = add("alpha_to_coverage", "off", renderAlphaToCoverage, false);
  coverage.verify = verifyAlphaToCoverage;
  coverage.expectation = [] {
    Expectation e;
    e.colourTolerance = 64;   // one sample: how alpha becomes a mask is the driver's choice
    return e;
  };
  Scene& centroid = add("centroid", "interpolation at the pixel's centre", renderCentroid, false);
  centroid.verify = verifyCentroid;
  centroid.oracle.share = 0;
}

}  // namespace pumice::cts
