// Points, lines, polygon modes, clip and cull distances, viewports chosen by vertices, provoking vertices.
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

double toGrid(double pixels) { return std::round(pixels * 256) / 256; }

// attribute.x is the size.
const char* const kPointVertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
void main() { gl_Position = position; gl_PointSize = given.x; passed = given; }
)";

// Points of many sizes, each coloured by gl_PointCoord. Centres and sizes are such that sides never meet pixel centres.
Picture renderPoints(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
  spec.vertex = kPointVertex;
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = vec4(gl_PointCoord, passed.y, 1); }
)";
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<Vertex> points;
  for (int i = 0; i < 49; ++i) {
    float size = float(1 + i % 7 * 5 + (variant == Variant::kBroken && i == 20 ? 1 : 0));
    points.push_back({atPixel(canvas.size(), 20.25 + i % 7 * 35, 18.25 + i / 7 * 36), {size, float(i) / 49, 0, 0}});
  }
  points.push_back({atPixel(canvas.size(), 252.25, 128.25), {64, 0.5f, 0, 0}});   // reaches outside
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, points); });
}

// Spokes in all directions, with colours along them.
std::vector<Vertex> spokes(const glm::uvec2& canvas, double shift) {
  std::vector<Vertex> out;
  for (int i = 0; i < 28; ++i) {
    double angle = 6.283185307179586 * (i + 0.37) / 28;
    double s = std::sin(angle), c = std::cos(angle);
    out.push_back({atPixel(canvas, toGrid(128.3 + 20 * c) + shift, toGrid(127.6 + 20 * s)), {1, 0.2f, 0.1f * float(i % 10), 1}});
    out.push_back({atPixel(canvas, toGrid(128.3 + 118 * c) + shift, toGrid(127.6 + 118 * s)), {0.1f, 1, 0.5f, 1}});
  }
  return out;
}

std::vector<Edge> outlines(const std::vector<Vertex>& lines, const glm::uvec2& canvas, double width, double tolerance) {
  std::vector<Edge> edges;
  auto pixel = [&](const Vertex& v) {
    return glm::dvec2((v.position.x / v.position.w + 1.0) / 2 * canvas.x, (v.position.y / v.position.w + 1.0) / 2 * canvas.y);
  };
  for (size_t i = 0; i + 1 < lines.size(); i += 2) {
    glm::dvec2 a = pixel(lines[i]), b = pixel(lines[i + 1]), along = glm::normalize(b - a) * (width / 2), side(-along.y, along.x);
    glm::dvec2 corners[4] = {a + side, b + side, b - side, a - side};
    for (int k = 0; k < 4; ++k) edges.push_back({corners[k], corners[(k + 1) % 4], tolerance});
  }
  return edges;
}

Picture renderLines(Device& device, Variant variant, float width, VkLineRasterizationModeEXT mode) {
  Canvas canvas(device, kSize, kSize);
  VkPipelineRasterizationLineStateCreateInfoEXT line{};
  line.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_LINE_STATE_CREATE_INFO_EXT;
  line.lineRasterizationMode = mode;
  PipelineSpec spec;
  spec.topology = VK_PRIMITIVE_TOPOLOGY_LINE_LIST;
  spec.adjust = [&](PipelineStates& s) {
    if (mode != VK_LINE_RASTERIZATION_MODE_DEFAULT_EXT) s.raster.pNext = &line;
    s.raster.lineWidth = width;
  };
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = spokes(canvas.size(), variant == Variant::kBroken ? 0.5 : 0);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

Expectation lineExpectation(double width) {
  Expectation e;
  e.onGrid = false;
  e.edges = outlines(spokes({kSize, kSize}, 0), {kSize, kSize}, width, 1.0 / 64);   // corners snap in both drivers
  e.edgeShare = 0.001;
  e.colourTolerance = 2;
  return e;
}

// Every column (or row) of a one-pixel Bresenham line has one pixel.
Picture renderBresenham(Device& device, Variant variant) {
  return renderLines(device, variant, 1, VK_LINE_RASTERIZATION_MODE_BRESENHAM_EXT);
}

std::string verifyBresenham(const Picture& picture) {
  auto lit = [&](uint32_t x, uint32_t y) { return picture.pixel(x, y) != std::array<int, 4>{0, 0, 0, 255}; };
  // The flattest spokes: 6 and 7 go down, 13 and 14 left...; count along the ring at 100 pixels from the centre.
  for (double offset : {60.0, 90.0}) {
    uint32_t x = uint32_t(128.3 + offset), found = 0;
    for (uint32_t y = 100; y < 155; ++y) found += lit(x, y);
    // Two spokes lie so flat to the right that they cross this column between those rows.
    uint32_t expected = 0;
    for (int i = 0; i < 28; ++i) {
      double angle = 6.283185307179586 * (i + 0.37) / 28, y = 127.6 + std::tan(angle) * (x + 0.5 - 128.3);
      if (std::cos(angle) > 0.8 && y > 101 && y < 154) ++expected;
    }
    if (found != expected)
      return "column " + std::to_string(x) + ": " + std::to_string(found) + " pixels for " + std::to_string(expected) + " lines";
  }
  return {};
}

// Triangles as outlines or corners; one is culled, one crosses the near plane, one reaches outside.
Picture renderPolygonMode(Device& device, Variant variant, VkPolygonMode mode) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.vertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
void main() { gl_Position = position; gl_PointSize = 7; passed = given; }
)";
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = gl_FrontFacing ? passed : passed.bgra; }
)";
  spec.cull = variant == Variant::kBroken ? VK_CULL_MODE_NONE : VK_CULL_MODE_BACK_BIT;
  spec.depthTest = spec.depthWrite = true;
  spec.adjust = [&](PipelineStates& s) { s.raster.polygonMode = mode, s.raster.lineWidth = 3; };
  Pipeline front = canvas.pipeline(spec);
  spec.cull = VK_CULL_MODE_NONE;
  Pipeline both = canvas.pipeline(spec);
  auto corner = [&](double x, double y, float z, glm::vec4 colour) { return Vertex{atPixel(canvas.size(), x, y, z), colour}; };
  glm::vec4 a(1, 0.5f, 0, 1), b(0.25f, 1, 0, 1);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, front, {corner(20.25, 20.125, 0.5f, a), corner(100.25, 40.125, 0.5f, a), corner(40.25, 110.125, 0.5f, a),
                                          corner(140.25, 20.125, 0.5f, a), corner(160.25, 110.125, 0.5f, a), corner(230.25, 40.125, 0.5f, a)});
    canvas.drawVertices(commands, both, {corner(30.25, 140.125, 0.25f, b), corner(60.25, 240.125, 0.25f, b), corner(110.25, 150.125, 0.75f, b),
                                         corner(190.25, 140.125, 0.25f, b), corner(290.25, 200.125, 0.25f, b), corner(150.25, 230.125, 0.75f, b)});
  });
}

// Clip distances cut a picture of triangles into a star-like shape; one cull distance drops whole triangles.
Picture renderClipDistances(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  PipelineSpec spec;
  spec.vertex = std::string(R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
out float gl_ClipDistance[3];
out float gl_CullDistance[1];
void main() {
  gl_Position = position;
  passed = given;
  vec2 p = position.xy / position.w;
  gl_ClipDistance[0] = dot(p, vec2(0.8, 0.6)) + 0.5)") + (variant == Variant::kBroken ? "1" : "") + R"(;
  gl_ClipDistance[1] = 0.7 - p.x - 0.25 * p.y;
  gl_ClipDistance[2] = 0.6 + p.y - 0.4 * p.x;
  gl_CullDistance[0] = given.a - 0.5;
}
)";
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
in float gl_ClipDistance[3];
void main() { colour = vec4(passed.rg, clamp(gl_ClipDistance[0], 0, 1), 1); }
)";
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<Vertex> vertices;
  for (int i = 0; i < 9; ++i) {
    double x = 10.25 + i % 3 * 80, y = 10.125 + i / 3 * 80;
    glm::vec4 colour(0.2f + 0.1f * float(i % 3), 1 - 0.1f * float(i / 3), 0, i == 4 ? 0.25f : 1);
    auto at = [&](double px, double py) {
      glm::vec4 p = atPixel(canvas.size(), px, py, 0.5f);
      return Vertex{p, colour};
    };
    for (const Vertex& v : {at(x, y), at(x + 78, y + 4), at(x + 3, y + 76), at(x + 78, y + 4), at(x + 76, y + 78), at(x + 3, y + 76)})
      vertices.push_back(v);
  }
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) { canvas.drawVertices(commands, pipeline, vertices); });
}

Expectation clipExpectation() {
  Expectation e;
  e.onGrid = false;
  auto line = [&](double a, double b, double c) {   // a x + b y + c = 0 in normalised coordinates
    glm::dvec2 normal(a, b), foot = normal * (-c / glm::dot(normal, normal)), along(-b, a);
    auto pixel = [](glm::dvec2 p) { return (p + 1.0) * 0.5 * double(kSize); };
    e.edges.push_back({pixel(foot - along * 4.0), pixel(foot + along * 4.0), 1.0 / 64});
  };
  line(0.8, 0.6, 0.5);
  line(-1, -0.25, 0.7);
  line(-0.4, 1, 0.6);
  e.colourTolerance = 1;
  return e;
}

// gl_ViewportIndex from the vertex shader: 16 viewports with depth ranges and scissors of their own, one drawn upside down.
Picture renderViewportIndex(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  spec.vertex = R"(#version 450
#extension GL_ARB_shader_viewport_layer_array : require
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
void main() { gl_Position = position; passed = given; gl_ViewportIndex = gl_InstanceIndex; }
)";
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = vec4(passed.rg, float(gl_ViewportIndex) / 15, 1); }
)";
  spec.adjust = [](PipelineStates& s) { s.viewport.viewportCount = s.viewport.scissorCount = 16; };
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<VkViewport> viewports;
  std::vector<VkRect2D> scissors;
  for (int i = 0; i < 16; ++i) {
    float x = float(i % 4 * 64), y = float(i / 4 * 64);
    viewports.push_back({x, y, 64, 64, float(i) / 32, 1 - float(i) / 32});
    scissors.push_back({{i % 4 * 64 + 3, i / 4 * 64 + 2}, {uint32_t(58 - i), 60}});
  }
  viewports[5] = {64, 128, 64, -64, 0.5f, 0.25f};
  if (variant == Variant::kBroken) scissors[7].extent.width += 1;
  std::vector<Vertex> vertices = {{{-0.9375f, -0.875f, 0.25f, 1}, {1, 0.2f, 0.2f, 1}},
                                  {{0.96875f, -0.5f, 0.5f, 1}, {0.2f, 1, 0.2f, 1}},
                                  {{-0.25f, 0.9375f, 0.75f, 1}, {0.2f, 0.2f, 1, 1}}};
  return canvas.draw(
      {0, 0, 0, 1},
      [&](VkCommandBuffer commands) {
        vkCmdSetViewport(commands, 0, 16, viewports.data());
        vkCmdSetScissor(commands, 0, 16, scissors.data());
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
        canvas.bindVertices(commands, vertices);
        vkCmdDraw(commands, 3, 16, 0, 0);
      },
      true);
}

// Flat colours of every topology, with the first or the last vertex as the provoking one.
Picture renderProvoking(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  const char* kFlatVertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) flat out vec4 passed;
void main() { gl_Position = position; passed = given; }
)";
  const char* kFlatFragment = R"(#version 450
layout(location = 0) flat in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = passed; }
)";
  VkPipelineRasterizationProvokingVertexStateCreateInfoEXT last{};
  last.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_PROVOKING_VERTEX_STATE_CREATE_INFO_EXT;
  last.provokingVertexMode = VK_PROVOKING_VERTEX_MODE_LAST_VERTEX_EXT;
  std::vector<Pipeline> pipelines;
  const VkPrimitiveTopology kTopologies[] = {VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN};
  for (int i = 0; i < 6; ++i) {
    PipelineSpec spec;
    spec.vertex = kFlatVertex;
    spec.fragment = kFlatFragment;
    spec.topology = kTopologies[i % 3];
    if (i >= 3 && variant != Variant::kBroken) spec.adjust = [&](PipelineStates& s) { s.raster.pNext = &last; };
    pipelines.push_back(canvas.pipeline(spec));
  }
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (int i = 0; i < 6; ++i) {
      double x = 8 + i % 3 * 80, y = 8 + i / 3 * 120;
      std::vector<Vertex> vertices;
      auto add = [&](double px, double py) {
        float n = float(vertices.size());
        vertices.push_back({atPixel(canvas.size(), x + px, y + py), {0.1f + 0.1f * n, 1 - 0.12f * n, 0.5f, 1}});
      };
      if (i % 3 == 2) {
        add(36, 50);
        for (int k = 0; k < 7; ++k) add(36 + toGrid(34 * std::cos(k)), 50 + toGrid(45 * std::sin(k)));
      } else {
        for (int k = 0; k < 9; ++k) add(k * 8 + 2, k % 2 ? 90 : 10 + k * 3);
      }
      canvas.drawVertices(commands, pipelines[i], vertices);
    }
  });
}

}  // namespace

void addPrimitiveScenes(SceneList& scenes) {
  Scene points;
  points.name = "points";
  points.broken = "one point a pixel larger";
  points.render = renderPoints;
  points.supported = [](const Device& d) { return d.features.largePoints; };
  points.expectation = [] {
    Expectation e;
    e.colourTolerance = 2;
    return e;
  };
  scenes.push_back(points);

  auto wide = [](const Device& d) { return d.features.wideLines; };
  Scene lines;
  lines.name = "lines";
  lines.broken = "half a pixel off";
  lines.render = [](Device& d, Variant v) { return renderLines(d, v, 1, VK_LINE_RASTERIZATION_MODE_DEFAULT_EXT); };
  lines.supported = [](const Device& d) { return d.properties.limits.strictLines; };
  lines.expectation = [] { return lineExpectation(1); };
  scenes.push_back(lines);

  Scene wideLines = lines;
  wideLines.name = "lines_wide";
  wideLines.render = [](Device& d, Variant v) { return renderLines(d, v, 7, VK_LINE_RASTERIZATION_MODE_DEFAULT_EXT); };
  wideLines.supported = [wide](const Device& d) { return wide(d) && d.properties.limits.strictLines; };
  wideLines.expectation = [] { return lineExpectation(7); };
  scenes.push_back(wideLines);

  Scene rectangular = wideLines;
  rectangular.name = "lines_rectangular";
  rectangular.render = [](Device& d, Variant v) { return renderLines(d, v, 4, VK_LINE_RASTERIZATION_MODE_RECTANGULAR_EXT); };
  rectangular.supported = [wide](const Device& d) { return wide(d) && d.lines.rectangularLines; };
  rectangular.expectation = [] { return lineExpectation(4); };
  scenes.push_back(rectangular);

  Scene bresenham;
  bresenham.name = "lines_bresenham";
  bresenham.broken = "half a pixel off";
  bresenham.render = renderBresenham;
  bresenham.verify = verifyBresenham;
  bresenham.supported = [](const Device& d) { return d.lines.bresenhamLines; };
  bresenham.expectation = [] {
    // Drivers choose the ends and ties of a Bresenham line by rules of their own.
    Expectation e;
    e.onGrid = false;
    e.edges = outlines(spokes({kSize, kSize}, 0), {kSize, kSize}, 1, 1.0 / 32);
    auto lines = spokes({kSize, kSize}, 0);
    for (const Vertex& v : lines) {
      glm::dvec2 p((v.position.x + 1.0) / 2 * kSize, (v.position.y + 1.0) / 2 * kSize);
      e.edges.push_back({p, p, 1.25});
    }
    e.edgeShare = 0.003;
    e.colourTolerance = 4;
    return e;
  };
  scenes.push_back(bresenham);

  for (auto [mode, name] : {std::pair{VK_POLYGON_MODE_LINE, "polygon_mode_line"}, std::pair{VK_POLYGON_MODE_POINT, "polygon_mode_point"}}) {
    Scene polygon;
    polygon.name = name;
    polygon.broken = "the back face is not culled";
    polygon.render = [mode = mode](Device& d, Variant v) { return renderPolygonMode(d, v, mode); };
    polygon.supported = [](const Device& d) { return d.features.fillModeNonSolid && d.features.wideLines && d.features.largePoints; };
    if (mode == VK_POLYGON_MODE_LINE)
      polygon.expectation = [] {
        Expectation e;
        e.stepFunctions = true;   // sides of the lines, whose corners snap
        e.stepShare = 0.002;
        return e;
      };
    scenes.push_back(polygon);
  }

  Scene clip;
  clip.name = "clip_and_cull_distances";
  clip.broken = "a clip plane 0.01 off";
  clip.render = renderClipDistances;
  clip.supported = [](const Device& d) { return d.features.shaderClipDistance && d.features.shaderCullDistance; };
  clip.expectation = clipExpectation;
  scenes.push_back(clip);

  Scene viewports;
  viewports.name = "viewport_index";
  viewports.broken = "a scissor one pixel wider";
  viewports.render = renderViewportIndex;
  viewports.supported = [](const Device& d) {
    return d.features.multiViewport && d.has(VK_EXT_SHADER_VIEWPORT_INDEX_LAYER_EXTENSION_NAME) &&
           d.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
  };
  viewports.expectation = [] {
    Expectation e;
    e.depthTolerance = 1e-6;
    return e;
  };
  scenes.push_back(viewports);

  Scene provoking;
  provoking.name = "provoking_vertex";
  provoking.broken = "the first vertex instead of the last";
  provoking.render = renderProvoking;
  provoking.supported = [](const Device& d) { return d.provokingVertex.provokingVertexLast; };
  scenes.push_back(provoking);
}

}  // namespace pumice::cts
