// Scenes about which pixels a triangle owns: watertight fans, tiny triangles, clipping.
#include "cts_subset/harness/scene.h"

#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <cmath>

namespace pumice::cts {
namespace {

constexpr double kTick = 1.0 / 256;

double toGrid(double pixels) { return std::round(pixels * 256) / 256; }

// Small repeatable pseudo-random numbers in [0, 1).
struct Random {
  uint32_t state = 0x2545f491u;
  double next() {
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state / 4294967296.0;
  }
};

// Triangles around a centre that lies on a pixel centre, so that the axis-parallel spokes run
// through pixel centres and only the tie rule says who owns them.
constexpr int kSpokes = 24;
std::vector<std::vector<Vertex>> fan(const glm::uvec2& canvas, double cx, double cy, double radius,
                                     const std::function<glm::vec4(int)>& colour, double shift = 0) {
  auto rim = [&](int i) {
    double angle = glm::two_pi<double>() * (i % kSpokes) / kSpokes;
    return atPixel(canvas, cx + toGrid(radius * std::cos(angle)), cy + toGrid(radius * std::sin(angle)));
  };
  std::vector<std::vector<Vertex>> triangles;
  for (int i = 0; i < kSpokes; ++i) {
    // The broken variant moves the shared vertex of every triangle.
    glm::vec4 centre = atPixel(canvas, cx + shift, cy + shift);
    triangles.push_back({{centre, colour(i)}, {rim(i), colour(i)}, {rim(i + 1), colour(i)}});
  }
  return triangles;
}

constexpr uint32_t kHalf = 256;

Picture renderFan(Device& device, Variant variant) {
  Canvas canvas(device, 2 * kHalf, kHalf);
  Pipeline pipeline = canvas.pipeline({});
  auto colour = [](int i) {
    return glm::vec4(0.3f + 0.03f * float(i % 23), 0.9f - 0.03f * float(i * 7 % 23),
                     0.3f + 0.03f * float(i * 11 % 23), 1);
  };
  double shift = variant == Variant::kBroken ? kTick : 0;
  auto left = fan(canvas.size(), 128.5, 128.5, 120, colour, shift);
  auto right = fan(canvas.size(), 128.5 + kHalf, 128.5, 120, colour, shift);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    // Drawn in order on the left and in reverse on the right: if a pixel belonged to two
    // triangles, the halves would differ.
    for (size_t i = 0; i < left.size(); ++i) {
      canvas.drawVertices(commands, pipeline, left[i]);
      canvas.drawVertices(commands, pipeline, right[right.size() - 1 - i]);
    }
  });
}

bool insideFan(uint32_t x, uint32_t y, double cx) {
  // A circle within the polygon, whose sides come as near as radius * cos(half a step).
  return std::hypot(x + 0.5 - cx, y + 0.5 - 128.5) < 118;
}

std::string verifyFan(const Picture& picture) {
  for (uint32_t y = 0; y < kHalf; ++y)
    for (uint32_t x = 0; x < kHalf; ++x) {
      std::string where = std::to_string(x) + "," + std::to_string(y);
      if (picture.pixel(x, y) != picture.pixel(x + kHalf, y))
        return "pixel " + where + " depends on the order of the triangles";
      if (insideFan(x, y, 128.5) && picture.pixel(x, y) == std::array<int, 4>{0, 0, 0, 255})
        return "pixel " + where + " is a hole";
    }
  return {};
}

Picture renderFanBlended(Device& device, Variant variant) {
  Canvas canvas(device, kHalf, kHalf);
  PipelineSpec spec;
  VkPipelineColorBlendAttachmentState add{};
  add.blendEnable = VK_TRUE;
  add.srcColorBlendFactor = add.dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
  add.srcAlphaBlendFactor = add.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  add.colorBlendOp = add.alphaBlendOp = VK_BLEND_OP_ADD;
  spec.blend = add;
  Pipeline pipeline = canvas.pipeline(spec);
  // One draw adds 64/255: a pixel drawn twice shows 128.
  auto colour = [](int) { return glm::vec4(64.0f / 255, 64.0f / 255, 64.0f / 255, 0); };
  auto triangles = fan(canvas.size(), 128.5, 128.5, 120, colour);
  if (variant == Variant::kBroken)
    for (Vertex& vertex : triangles[5])  // one triangle overlaps its neighbour
      vertex.position.x += float(1.5 / 128);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (const auto& triangle : triangles) canvas.drawVertices(commands, pipeline, triangle);
  });
}

std::string verifyFanBlended(const Picture& picture) {
  for (uint32_t y = 0; y < kHalf; ++y)
    for (uint32_t x = 0; x < kHalf; ++x) {
      int count = picture.pixel(x, y)[0];
      std::string where = std::to_string(x) + "," + std::to_string(y);
      if (count != 0 && count != 64)
        return "pixel " + where + " was drawn " + std::to_string(count / 64) + " times";
      if (insideFan(x, y, 128.5) && count == 0) return "pixel " + where + " is a hole";
    }
  return {};
}

// Thousands of triangles of one to three pixels, some of them slivers, on the sub-pixel grid.
std::vector<Vertex> tinyTriangles(const glm::uvec2& canvas, double shift) {
  Random random;
  std::vector<Vertex> vertices;
  for (int i = 0; i < 4000; ++i) {
    double x = 4 + random.next() * 248, y = 4 + random.next() * 248;
    double reach = i % 5 == 0 ? 0.4 : 3.0;
    glm::vec4 colour(random.next(), random.next(), 0.3 + 0.7 * random.next(), 1);
    for (int k = 0; k < 3; ++k) {
      double px = toGrid(x + (random.next() - 0.5) * reach);
      double py = toGrid(y + (random.next() - 0.5) * reach);
      // A quarter of the vertices on pixel centres: many ties.
      if (i % 4 == 0) px = std::floor(px) + 0.5, py = std::floor(py) + 0.5;
      vertices.push_back({atPixel(canvas, px + shift, py), colour});
    }
  }
  return vertices;
}

Picture renderTiny(Device& device, Variant variant) {
  Canvas canvas(device, 256, 256);
  Pipeline pipeline = canvas.pipeline({});
  auto vertices = tinyTriangles(canvas.size(), variant == Variant::kBroken ? kTick : 0);
  return canvas.draw({0, 0, 0, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

// Long slivers that share edges across the whole picture.
Picture renderSlivers(Device& device, Variant variant) {
  Canvas canvas(device, 256, 256);
  Pipeline pipeline = canvas.pipeline({});
  Random random;
  std::vector<Vertex> vertices;
  double x0 = 4, x1 = 4;
  double shift = variant == Variant::kBroken ? kTick : 0;
  for (int i = 0; x0 < 250 && x1 < 250; ++i) {
    double n0 = toGrid(x0 + random.next() * 3), n1 = toGrid(x1 + random.next() * 3);
    glm::vec4 a(random.next(), 0.5, random.next(), 1), b(0.4, random.next(), 0.8, 1);
    glm::uvec2 s = canvas.size();
    for (auto [x, y, c] :
         {std::tuple{x0, 3.5, a}, {n0, 3.5, a}, {x1, 250.5, a}, {n0, 3.5, b}, {n1, 250.5, b}, {x1, 250.5, b}})
      vertices.push_back({atPixel(s, x, y + shift), c});
    x0 = n0, x1 = n1;
  }
  return canvas.draw({0, 0, 0, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

// A corridor seen from within: floor, walls and ceiling pass the near plane and lie behind the
// eye too.
std::vector<Vertex> corridor() {
  glm::mat4 projection = glm::perspective(glm::radians(75.0f), 1.0f, 0.3f, 30.0f);
  glm::mat4 view = glm::lookAt(glm::vec3(0.3f, 0.2f, 0), glm::vec3(0.1f, 0.1f, -4), glm::vec3(0.1f, 1, 0));
  glm::mat4 matrix = projection * view;
  auto put = [&](float x, float y, float z, glm::vec3 colour) {
    return Vertex{matrix * glm::vec4(x, y, z, 1), glm::vec4(colour, 1)};
  };
  std::vector<Vertex> out;
  const glm::vec2 ring[] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  const glm::vec3 colours[] = {
      {0.8f, 0.3f, 0.2f}, {0.2f, 0.7f, 0.3f}, {0.3f, 0.4f, 0.9f}, {0.8f, 0.8f, 0.3f}};
  for (int i = 0; i < 4; ++i) {
    glm::vec2 p = ring[i], q = ring[(i + 1) % 4];
    glm::vec3 c = colours[i];
    Vertex a = put(p.x, p.y, 6, c), b = put(q.x, q.y, 6, c);
    Vertex d = put(p.x, p.y, -15, c * 0.4f), e = put(q.x, q.y, -15, c * 0.4f);
    for (const Vertex& v : {a, b, e, a, e, d}) out.push_back(v);
  }
  return out;
}

Picture renderCorridor(Device& device, Variant variant) {
  Canvas canvas(device, 256, 256);
  Pipeline pipeline = canvas.pipeline({});
  auto vertices = corridor();
  if (variant == Variant::kBroken)  // as if the clipped end were put in the wrong place
    for (Vertex& v : vertices)
      if (v.position.w < 0) v.position.x += 1;
  return canvas.draw({0, 0, 0, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

// Triangles that reach thousands of screens beyond the picture.
std::vector<Vertex> hugeTriangles() {
  auto triangle = [](glm::vec2 a, glm::vec2 b, glm::vec2 c, glm::vec4 colour) {
    return std::vector<Vertex>{
        {glm::vec4(a, 0.5f, 1), colour}, {glm::vec4(b, 0.5f, 1), colour}, {glm::vec4(c, 0.5f, 1), colour}};
  };
  std::vector<Vertex> out;
  auto add = [&](const std::vector<Vertex>& t) { out.insert(out.end(), t.begin(), t.end()); };
  add(triangle({-3000, -2000}, {2500, -4000}, {0.25f, 0.625f}, {0.2f, 0.5f, 0.9f, 1}));
  add(triangle({-40000, 0.5f}, {0.75f, -0.25f}, {90, 800}, {0.9f, 0.5f, 0.1f, 1}));
  add(triangle({-0.5f, -0.5f}, {700, 0.125f}, {5000, -9000}, {0.3f, 0.9f, 0.3f, 1}));
  add(triangle({1.5f, 1.5f}, {300, 1.5f}, {2, 400}, {1, 0, 1, 1}));  // wholly outside
  return out;
}

Picture renderHuge(Device& device, Variant variant) {
  Canvas canvas(device, 256, 256);
  Pipeline pipeline = canvas.pipeline({});
  auto vertices = hugeTriangles();
  if (variant == Variant::kBroken)
    for (Vertex& v : vertices)  // a driver that clamps coordinates instead of clipping
      v.position = glm::vec4(glm::clamp(glm::vec2(v.position), -16.0f, 16.0f), 0.5f, 1);
  return canvas.draw({0, 0, 0, 1},
                     [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

Expectation offGrid(const std::vector<Vertex>& vertices) {
  Expectation e;
  e.onGrid = false;
  std::vector<glm::vec4> positions;
  for (const Vertex& v : vertices) positions.push_back(v.position);
  e.edges = edgesOfTriangles(positions, {0, 0, 256, 256});
  return e;
}

}  // namespace

void addCoverageScenes(SceneList& scenes) {
  Scene once;
  once.name = "fan_shared_edges";
  once.broken = "the shared vertex 1/256 px off, so that the ties on the spokes flip";
  once.render = renderFan;
  once.verify = verifyFan;
  scenes.push_back(once);

  Scene blended;
  blended.name = "fan_blended_count";
  blended.broken = "one triangle 1.5 px off, so that it overlaps its neighbour";
  blended.render = renderFanBlended;
  blended.verify = verifyFanBlended;
  blended.supported = [](const Device& device) {
    return device.supports(Canvas::kColourFormat, VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT);
  };
  scenes.push_back(blended);

  Scene tiny;
  tiny.name = "tiny_triangles";
  tiny.broken = "vertices 1/256 px off";
  tiny.render = renderTiny;
  scenes.push_back(tiny);

  Scene slivers;
  slivers.name = "slivers";
  slivers.broken = "vertices 1/256 px too low";
  slivers.render = renderSlivers;
  scenes.push_back(slivers);

  Scene near;
  near.name = "near_plane";
  near.broken = "vertices behind the eye moved";
  near.render = renderCorridor;
  near.expectation = [] { return offGrid(corridor()); };
  scenes.push_back(near);

  Scene huge;
  huge.name = "guard_band";
  huge.broken = "far coordinates clamped instead of clipped";
  huge.render = renderHuge;
  huge.expectation = [] {
    // Snapping a vertex that was cut at a guard band moves the edge by up to a tick on each
    // driver, and where that band is differs.
    return offGrid(hugeTriangles());
  };
  scenes.push_back(huge);
}

}  // namespace pumice::cts
