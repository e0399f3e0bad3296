// Clear, one triangle, and the checkerboard that shows perspective-correct varyings.
#include "cts_subset/harness/scene.h"

#include <glm/gtc/matrix_transform.hpp>

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;
constexpr double kTick = 1.0 / 256;  // the sub-pixel grid

Picture renderClear(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  float green = variant == Variant::kBroken ? 0.41f : 0.4f;
  return canvas.draw({0.2f, green, 0.6f, 1.0f}, [](VkCommandBuffer) {});
}

// The left edge and the bottom edge run exactly through pixel centres: the first is drawn, the
// second is not.
Picture renderTriangle(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  Pipeline pipeline = canvas.pipeline({});
  double dx = variant == Variant::kBroken ? kTick : 0;
  std::vector<Vertex> vertices = {
      {atPixel(canvas.size(), 40.5 + dx, 20.25), {1, 0, 0, 1}},
      {atPixel(canvas.size(), 230.75 + dx, 216.5), {0, 1, 0, 1}},
      {atPixel(canvas.size(), 40.5 + dx, 216.5), {0, 0, 1, 1}},
  };
  return canvas.draw({0.1f, 0.1f, 0.1f, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

const char* const kCheckerFragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() {
    vec2 cell = floor(passed.xy);
    float odd = mod(cell.x + cell.y, 2.0);
    colour = mix(vec4(0.95, 0.9, 0.8, 1.0), vec4(0.15, 0.2, 0.35, 1.0), odd);
    colour.b += passed.z;
}
)";
std::string affineChecker() {
  std::string text = kCheckerFragment;
  return text.replace(text.find("in vec4"), 7, "noperspective in vec4");
}

std::vector<Vertex> steepPlane(float halfWidth = 3, float nearest = 2.5f) {
  glm::mat4 projection = glm::perspective(glm::radians(60.0f), 1.0f, 0.5f, 50.0f);
  projection[1][1] = -projection[1][1];
  glm::mat4 view = glm::lookAt(glm::vec3(0, 1.2f, 4.0f), glm::vec3(0, 0.6f, 0), glm::vec3(0, 1, 0));
  glm::mat4 matrix = projection * view;
  auto corner = [&](float x, float z) {
    return Vertex{matrix * glm::vec4(x, 0, z, 1), {(x + 3) * 1.5f, (z + 8) * 1.0f, 0.02f * (x + z), 0}};
  };
  Vertex a = corner(-halfWidth, nearest), b = corner(halfWidth, nearest), c = corner(halfWidth, -8), d = corner(-halfWidth, -8);
  return {a, b, c, a, c, d};
}

Picture renderChecker(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  spec.fragment = kCheckerFragment;
  if (variant == Variant::kBroken) {
    spec.vertex = kPassVertexAffine;
    spec.fragment = affineChecker();
  }
  Pipeline pipeline = canvas.pipeline(spec);
  return canvas.draw({0.5f, 0.7f, 0.9f, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, pipeline, steepPlane());
  });
}

std::vector<Edge> outlineOf(const std::vector<Vertex>& vertices) {
  std::vector<glm::vec4> positions;
  for (const Vertex& vertex : vertices) positions.push_back(vertex.position);
  return edgesOfTriangles(positions, {0, 0, kSize, kSize});
}

// Perspective with the colour itself as varying: no step function hides an error.
std::vector<Vertex> tiltedTriangle() {
  return {{glm::vec4(-0.9f, 0.8f, 0.5f, 1) * 1.0f, {1, 0.1f, 0.1f, 1}},
          {glm::vec4(0.9f, 0.7f, 0.5f, 1) * 6.0f, {0.1f, 1, 0.2f, 1}},
          {glm::vec4(0.1f, -0.9f, 0.5f, 1) * 2.5f, {0.2f, 0.1f, 1, 1}}};
}

Picture renderTilted(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  if (variant == Variant::kBroken) {
    spec.vertex = kPassVertexAffine;
    spec.fragment =
        "#version 450\n"
        "layout(location = 0) noperspective in vec4 passed;\n"
        "layout(location = 0) out vec4 colour;\n"
        "void main() { colour = passed; }\n";
  }
  Pipeline pipeline = canvas.pipeline(spec);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, pipeline, tiltedTriangle());
  });
}

// A plane twice: affine on the left, perspective-correct on the right. Nothing of it is clipped (lavapipe 22.3 loses what is affine then).
std::vector<Vertex> halfPlane(float centre) {
  std::vector<Vertex> plane = steepPlane(0.9f, 2.2f);
  for (Vertex& v : plane) v.position.x = v.position.x * 0.5f + centre * v.position.w;
  return plane;
}

Picture renderAffineAndPerspective(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec correct;
  correct.fragment = kCheckerFragment;
  PipelineSpec affine;
  affine.vertex = kPassVertexAffine;
  affine.fragment = affineChecker();
  Pipeline left = canvas.pipeline(variant == Variant::kBroken ? correct : affine), right = canvas.pipeline(correct);
  return canvas.draw({0.5f, 0.7f, 0.9f, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, left, halfPlane(-0.5f));
    canvas.drawVertices(commands, right, halfPlane(0.5f));
  });
}

}  // namespace

void addBasicScenes(SceneList& scenes) {
  Scene clear;
  clear.name = "clear";
  clear.broken = "a clear colour off by 2.5 units";
  clear.render = renderClear;
  clear.verify = [](const Picture& picture) {
    for (uint32_t y = 0; y < picture.height; ++y)
      for (uint32_t x = 0; x < picture.width; ++x)
        if (picture.pixel(x, y) != std::array<int, 4>{51, 102, 153, 255})
          return "pixel " + std::to_string(x) + "," + std::to_string(y) + " is not the clear colour";
    return std::string();
  };
  scenes.push_back(clear);

  Scene triangle;
  triangle.name = "triangle";
  triangle.broken = "vertices 1/256 px too far right, so that the tie at the left edge flips";
  triangle.render = renderTriangle;
  triangle.verify = [](const Picture& picture) {
    std::array<int, 4> background{26, 26, 26, 255};
    if (picture.pixel(40, 200) == background) return std::string("left edge not drawn");
    if (picture.pixel(39, 200) != background) return std::string("left of the edge drawn");
    if (picture.pixel(100, 216) != background) return std::string("bottom edge drawn");
    if (picture.pixel(100, 215) == background) return std::string("last row missing");
    return std::string();
  };
  scenes.push_back(triangle);

  Scene tilted;
  tilted.name = "tilted_triangle";
  tilted.broken = "affine interpolation";
  tilted.render = renderTilted;
  tilted.expectation = [] {
    Expectation e;
    e.onGrid = false;
    e.edges = outlineOf(tiltedTriangle());
    return e;
  };
  scenes.push_back(tilted);

  Scene checker;
  checker.name = "checkerboard_steep";
  checker.broken = "affine interpolation";
  checker.render = renderChecker;
  checker.expectation = [] {
    Expectation e;
    e.onGrid = false;
    e.stepFunctions = true;
    e.edges = outlineOf(steepPlane());
    return e;
  };
  scenes.push_back(checker);

  Scene both;
  both.name = "affine_and_perspective";
  both.broken = "perspective-correct on both sides";
  both.render = renderAffineAndPerspective;
  both.expectation = [] {
    Expectation e;
    e.onGrid = false;
    e.stepFunctions = true;
    e.edges = outlineOf(halfPlane(-0.5f));
    const std::vector<Edge> right = outlineOf(halfPlane(0.5f));
    e.edges.insert(e.edges.end(), right.begin(), right.end());
    return e;
  };
  scenes.push_back(both);
}

}  // namespace pumice::cts
