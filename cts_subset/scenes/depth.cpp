// Depth: quads through each other, every compare operation, a pre-pass with EQUAL.
#include "cts_subset/harness/scene.h"

#include <cmath>

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

bool depthSupported(const Device& device, VkFormat format) {
  return device.supports(format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
}

// Three quads that lean into each other. Their corners lie on the sub-pixel grid, so only the
// lines where they meet can differ: there the depths tie within the format's rounding.
struct Quad {
  float zLeft, zRight, zTop;
  glm::vec4 colour;
  double x0, y0, x1, y1;
};
const Quad kQuads[] = {
    {0.1f, 0.9f, 0.0f, {0.9f, 0.2f, 0.2f, 1}, 20, 20, 230, 200},
    {0.8f, 0.2f, 0.0f, {0.2f, 0.8f, 0.3f, 1}, 40.25, 40.75, 240.5, 240.5},
    {0.3f, 0.3f, 0.4f, {0.2f, 0.4f, 0.9f, 1}, 10.5, 90.5, 250.5, 170.5},
};

// Depth at pixel coordinates; linear in x and y.
double depthOf(const Quad& q, double x, double y) {
  double u = (x - q.x0) / (q.x1 - q.x0), v = (y - q.y0) / (q.y1 - q.y0);
  return q.zLeft + (double(q.zRight) - q.zLeft) * u + q.zTop * v;
}

// The line on which two quads have equal depth, across the whole picture, with the room in which
// rounding to steps of `quantum` may decide either way.
Edge meetingLine(const Quad& a, const Quad& b, double quantum) {
  auto gap = [&](double x, double y) { return depthOf(a, x, y) - depthOf(b, x, y); };
  double g0 = gap(0, 0), gx = gap(1, 0) - g0, gy = gap(0, 1) - g0;
  double length = std::hypot(gx, gy);
  glm::dvec2 normal(gx / length, gy / length);
  glm::dvec2 onLine = -normal * (g0 / length), along(-normal.y, normal.x);
  return {onLine - along * 1000.0, onLine + along * 1000.0, 1.0 / 128 + 2 * quantum / length};
}

Picture renderQuads(Device& device, Variant variant, VkFormat format) {
  Canvas canvas(device, kSize, kSize, format);
  PipelineSpec spec;
  spec.depthTest = true;
  spec.depthWrite = true;
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<Vertex> vertices;
  for (const Quad& q : kQuads) {
    auto corner = [&](double x, double y) {
      float z = float(depthOf(q, x, y));
      // The broken variant is half a pixel wrong in depth alone: a shifted sample.
      if (variant == Variant::kBroken) z = float(depthOf(q, x + 0.5, y + 0.5));
      return Vertex{atPixel(canvas.size(), x, y, z), q.colour};
    };
    Vertex a = corner(q.x0, q.y0), b = corner(q.x1, q.y0), c = corner(q.x1, q.y1), d = corner(q.x0, q.y1);
    for (const Vertex& v : {a, b, c, a, c, d}) vertices.push_back(v);
  }
  return canvas.draw(
      {0.1f, 0.1f, 0.1f, 1},
      [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); }, true);
}

struct DepthFormat {
  VkFormat format;
  const char* name;
  double quantum;  // largest step between neighbouring values in [0, 1]
};
// In D32 the depths themselves are computed in single precision: a few units in the last place.
const DepthFormat kFormats[] = {{VK_FORMAT_D32_SFLOAT, "d32", 4.0 / (1 << 23)},
                                {VK_FORMAT_D16_UNORM, "d16", 1.0 / 65535},
                                {VK_FORMAT_D24_UNORM_S8_UINT, "d24s8", 8.0 / (1 << 24)},
                                {VK_FORMAT_D32_SFLOAT_S8_UINT, "d32s8", 4.0 / (1 << 23)}};

// Eight columns, one for each compare operation; in each, squares nearer, equal and farther than
// what is there.
Picture renderCompare(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 128, VK_FORMAT_D32_SFLOAT);
  auto square = [&](double x, double y, double side, float z, glm::vec4 colour) {
    Vertex a{atPixel(canvas.size(), x, y, z), colour};
    Vertex b{atPixel(canvas.size(), x + side, y, z), colour};
    Vertex c{atPixel(canvas.size(), x + side, y + side, z), colour};
    Vertex d{atPixel(canvas.size(), x, y + side, z), colour};
    return std::vector<Vertex>{a, b, c, a, c, d};
  };
  PipelineSpec lay;
  lay.depthTest = lay.depthWrite = true;
  lay.compare = VK_COMPARE_OP_ALWAYS;
  Pipeline layPipeline = canvas.pipeline(lay);
  std::vector<Pipeline> tests;
  for (int op = 0; op < 8; ++op) {
    PipelineSpec spec = lay;
    spec.compare = VkCompareOp(op);
    if (variant == Variant::kBroken && op == VK_COMPARE_OP_LESS) spec.compare = VK_COMPARE_OP_LESS_OR_EQUAL;
    tests.push_back(canvas.pipeline(spec));
  }
  return canvas.draw(
      {0, 0, 0, 1},
      [&](VkCommandBuffer commands) {
        for (int op = 0; op < 8; ++op)
          for (int row = 0; row < 3; ++row) {
            double x = op * 32 + 4, y = row * 40 + 4;
            const float kDepths[] = {0.25f, 0.5f, 0.75f};
            canvas.drawVertices(commands, layPipeline, square(x, y, 24, 0.5f, {0.2f, 0.3f, 0.5f, 1}));
            canvas.drawVertices(commands, tests[op],
                                square(x + 6, y + 6, 24, kDepths[row], {1, 0.8f, 0.2f, 1}));
          }
      },
      true);
}

// Triangles in parallel planes, so that none meets another.
std::vector<Vertex> preparedTriangles() {
  std::vector<Vertex> vertices;
  for (int i = 0; i < 40; ++i) {
    float angle = float(i) * 0.7f, reach = 0.3f + 0.015f * float(i);
    for (int k = 0; k < 3; ++k) {
      float a = angle + 2.1f * float(k);
      float x = reach * std::cos(a), y = reach * std::sin(a);
      float z = 0.3f * x + 0.2f * y + 0.01f * float(i * 17 % 40) - 0.2f;
      vertices.push_back({{x, y, z, 1}, {std::cos(a), std::sin(a), float(i) / 40, 1}});
    }
  }
  return vertices;
}

glm::mat4 preparedMatrix() {
  glm::mat4 m(1.0f);
  m[2][2] = 0.5f, m[3][2] = 1.1f, m[2][3] = 0.6f, m[3][3] = 1.6f, m[0][1] = 0.13f;
  return m;
}

// First the depth alone, then colours with EQUAL: a driver whose positions or depths depend on
// the rest of the pipeline loses pixels here.
Picture renderPrePass(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  PipelineSpec depthOnly;
  depthOnly.depthTest = depthOnly.depthWrite = true;
  depthOnly.writeMask = 0;
  depthOnly.vertex =
      "#version 450\n"
      "layout(location = 0) in vec4 position;\n"
      "layout(push_constant) uniform Push { mat4 m; } push;\n"
      "void main() { gl_Position = push.m * position; }\n";
  depthOnly.fragment = "#version 450\nvoid main() {}\n";
  depthOnly.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT, 0, 64}};
  PipelineSpec colour = depthOnly;
  colour.depthWrite = false;
  colour.compare = VK_COMPARE_OP_EQUAL;
  colour.writeMask = 0xf;
  colour.vertex =
      "#version 450\n"
      "layout(location = 0) in vec4 position;\n"
      "layout(location = 1) in vec4 given;\n"
      "layout(location = 0) out vec4 passed;\n"
      "layout(push_constant) uniform Push { mat4 m; } push;\n"
      "void main() { passed = given * 0.5 + 0.25;\n"
      "  gl_Position = push.m * position; }\n";
  colour.fragment = kColourFragment;
  Pipeline first = canvas.pipeline(depthOnly), second = canvas.pipeline(colour);

  std::vector<Vertex> vertices = preparedTriangles();
  glm::mat4 m = preparedMatrix();
  glm::mat4 n = m;
  if (variant == Variant::kBroken) n[3][2] += 1e-6f;
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdPushConstants(commands, first.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, 64, &m);
    canvas.drawVertices(commands, first, vertices);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, second.handle);
    vkCmdPushConstants(commands, second.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, 64, &n);
    canvas.drawVertices(commands, second, vertices);
  });
}

}  // namespace

void addDepthScenes(SceneList& scenes) {
  for (const DepthFormat& format : kFormats) {
    Scene quads;
    quads.name = std::string("interpenetrating_") + format.name;
    quads.broken = "depth sampled half a pixel off";
    quads.render = [format](Device& device, Variant variant) {
      return renderQuads(device, variant, format.format);
    };
    quads.expectation = [format] {
      Expectation e;
      e.onGrid = false;  // only the lines where quads meet are left free
      for (int i = 0; i < 3; ++i)
        for (int j = i + 1; j < 3; ++j) e.edges.push_back(meetingLine(kQuads[i], kQuads[j], format.quantum));
      e.depthTolerance = format.quantum * 1.01;
      return e;
    };
    quads.supported = [format](const Device& device) { return depthSupported(device, format.format); };
    scenes.push_back(quads);
  }

  Scene compare;
  compare.name = "depth_compare_ops";
  compare.broken = "LESS lets equal depths pass";
  compare.render = renderCompare;
  compare.supported = [](const Device& d) { return depthSupported(d, VK_FORMAT_D32_SFLOAT); };
  scenes.push_back(compare);

  Scene prePass;
  prePass.name = "depth_prepass_equal";
  prePass.broken = "the second pass has slightly other depths";
  prePass.render = renderPrePass;
  prePass.expectation = [] {
    Expectation e;
    e.onGrid = false;
    std::vector<glm::vec4> positions;
    for (const Vertex& v : preparedTriangles()) positions.push_back(preparedMatrix() * v.position);
    e.edges = edgesOfTriangles(positions, {0, 0, kSize, kSize});
    return e;
  };
  prePass.supported = compare.supported;
  scenes.push_back(prePass);
}

}  // namespace pumice::cts
