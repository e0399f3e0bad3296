// Techniques of the field's teaching: shadow maps, stencil shadow volumes, supersampling beside
// multisampling, a ray caster that must match the rasterized picture.
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

bool depthFormat(const Device& device, VkFormat format) { return device.supports(format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT); }

// A floor and three blocks; the second argument of `face` is the normal.
struct Scenery {
  std::vector<Vertex> vertices;   // position in the world, attribute = normal and shade
  void face(glm::vec3 a, glm::vec3 b, glm::vec3 c, glm::vec3 d, glm::vec3 n, float shade) {
    for (glm::vec3 p : {a, b, c, a, c, d}) vertices.push_back({glm::vec4(p, 1), glm::vec4(n, shade)});
  }
  void box(glm::vec3 low, glm::vec3 high, float shade) {
    auto p = [&](int i) { return glm::vec3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z); };
    face(p(0), p(2), p(6), p(4), {-1, 0, 0}, shade);
    face(p(1), p(5), p(7), p(3), {1, 0, 0}, shade);
    face(p(0), p(4), p(5), p(1), {0, -1, 0}, shade);
    face(p(2), p(3), p(7), p(6), {0, 1, 0}, shade);
    face(p(0), p(1), p(3), p(2), {0, 0, -1}, shade);
    face(p(4), p(6), p(7), p(5), {0, 0, 1}, shade);
  }
  Scenery() {
    face({-4, 0, -4}, {4, 0, -4}, {4, 0, 4}, {-4, 0, 4}, {0, 1, 0}, 0.9f);
    box({-1.5f, 0, -1}, {-0.5f, 1.5f, 0}, 0.7f);
    box({0.5f, 0, 0.5f}, {1.25f, 0.75f, 1.5f}, 1);
    box({0.75f, 1, -1.5f}, {1.5f, 1.5f, -0.5f}, 0.5f);
  }
};

glm::mat4 camera() {
  glm::mat4 flip(1);
  flip[1][1] = -1;
  return flip * glm::perspective(0.9f, 1.0f, 0.5f, 20.0f) * glm::lookAt(glm::vec3(2.5f, 3.5f, 5), glm::vec3(0, 0.4f, 0), glm::vec3(0, 1, 0));
}

const glm::vec3 kSun = glm::normalize(glm::vec3(-0.6f, -1.3f, -0.45f));   // the way it shines

glm::mat4 sunView() {
  return glm::ortho(-5.0f, 5.0f, -5.0f, 5.0f, 0.0f, 16.0f) * glm::lookAt(-kSun * 8.0f, glm::vec3(0), glm::vec3(0, 1, 0));
}

struct Matrices { glm::mat4 toClip, toSun; };

const char* const kWorldVertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(push_constant) uniform Matrices { mat4 toClip, toSun; };
layout(location = 0) out vec4 passed;
layout(location = 1) out vec4 sun;
void main() { gl_Position = toClip * position; passed = given; sun = toSun * position; }
)";

// Depth from the sun, then the scene with a comparison sampler.
Picture renderShadowMap(Device& device, Variant variant) {
  constexpr uint32_t kMap = 512;
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  ImageSpec spec;
  spec.format = VK_FORMAT_D32_SFLOAT;
  spec.extent = {kMap, kMap, 1};
  spec.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT;
  Image map = canvas.image(spec);
  VkImageView view = canvas.view(map);
  VkSamplerCreateInfo samplerInfo{};
  samplerInfo.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  samplerInfo.magFilter = samplerInfo.minFilter = VK_FILTER_NEAREST;
  samplerInfo.addressModeU = samplerInfo.addressModeV = samplerInfo.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  samplerInfo.compareEnable = VK_TRUE;
  samplerInfo.compareOp = VK_COMPARE_OP_LESS_OR_EQUAL;
  VkSampler sampler = canvas.make(samplerInfo);
  Binding binding{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  binding.image = {sampler, view, VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL};
  DescriptorSet set = canvas.descriptors({binding});

  VkAttachmentDescription attachment{};
  attachment.format = spec.format;
  attachment.samples = VK_SAMPLE_COUNT_1_BIT;
  attachment.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  attachment.finalLayout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL;
  VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pDepthStencilAttachment = &reference;
  VkSubpassDependency after{0, VK_SUBPASS_EXTERNAL, VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT,
                            VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT, VK_ACCESS_SHADER_READ_BIT, 0};
  VkRenderPassCreateInfo passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  passInfo.attachmentCount = passInfo.subpassCount = passInfo.dependencyCount = 1;
  passInfo.pAttachments = &attachment;
  passInfo.pSubpasses = &subpass;
  passInfo.pDependencies = &after;
  VkRenderPass pass = canvas.make(passInfo);
  VkFramebuffer target = canvas.framebufferOf(pass, {view}, {kMap, kMap});

  PipelineSpec depth;
  depth.vertex = kWorldVertex;
  depth.fragment = "#version 450\nvoid main() {}\n";
  depth.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof(Matrices)}};
  depth.depthTest = depth.depthWrite = true;
  depth.depthBias = glm::vec2(4, 1.5f);
  depth.adjust = [&](PipelineStates& s) {
    s.renderPass = pass;
    s.blend.attachmentCount = 0;
  };
  Pipeline lay = canvas.pipeline(depth);
  PipelineSpec lit;
  lit.vertex = kWorldVertex;
  lit.sets = {set.layout};
  lit.pushConstants = depth.pushConstants;
  lit.depthTest = lit.depthWrite = true;
  lit.fragment = std::string(R"(#version 450
layout(set = 0, binding = 0) uniform sampler2DShadow map;
layout(location = 0) in vec4 passed;
layout(location = 1) in vec4 sun;
layout(location = 0) out vec4 colour;
void main() {
  vec3 p = sun.xyz / sun.w;
  float visible = texture(map, vec3(p.xy * 0.5 + 0.5, p.z)))") + (variant == Variant::kBroken ? " * 0.5 + 0.5" : "") + R"(;
  float cosine = max(dot(normalize(passed.xyz), normalize(vec3(0.6, 1.3, 0.45))), 0.0);
  colour = vec4(passed.w * (0.2 + 0.8 * cosine * visible) * vec3(1, 0.9, 0.7), 1);
}
)";
  Pipeline show = canvas.pipeline(lit);
  Scenery scenery;
  Matrices matrices{sunView(), sunView()};
  device.run([&](VkCommandBuffer commands) {
    VkClearValue clear{};
    clear.depthStencil = {1, 0};
    VkRenderPassBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
    begin.renderPass = pass;
    begin.framebuffer = target;
    begin.renderArea = {{0, 0}, {kMap, kMap}};
    begin.clearValueCount = 1;
    begin.pClearValues = &clear;
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    setViewport(commands, 0, 0, kMap, kMap);
    setScissor(commands, 0, 0, kMap, kMap);
    vkCmdPushConstants(commands, lay.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof matrices, &matrices);
    canvas.drawVertices(commands, lay, scenery.vertices);
    vkCmdEndRenderPass(commands);
  });
  matrices.toClip = camera();
  return canvas.draw({0.3f, 0.4f, 0.6f, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, show.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdPushConstants(commands, show.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof matrices, &matrices);
    canvas.drawVertices(commands, show, scenery.vertices);
  });
}

// The sides of each block's faces stretched away from the sun; two-sided stencil counts what is inside (Heidmann; "Carmack's reverse",
// counted where the depth test fails).
std::vector<Vertex> shadowVolumes(const Scenery& scenery) {
  std::vector<Vertex> out;
  const std::vector<Vertex>& v = scenery.vertices;
  auto add = [&](glm::vec3 a, glm::vec3 b, glm::vec3 c) {
    for (glm::vec3 p : {a, b, c}) out.push_back({glm::vec4(p, 1), {}});
  };
  for (size_t i = 6; i < v.size(); i += 3) {   // all but the floor
    glm::vec3 p[3] = {v[i].position, v[i + 1].position, v[i + 2].position}, q[3];
    if (glm::dot(glm::vec3(v[i].attribute), kSun) >= 0) continue;   // lit ones only
    for (int k = 0; k < 3; ++k) {
      p[k] += kSun * 0.01f;
      q[k] = p[k] + kSun * 6.0f;
    }
    if (glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), kSun) > 0) std::swap(p[1], p[2]), std::swap(q[1], q[2]);
    add(p[0], p[1], p[2]);
    add(q[0], q[2], q[1]);
    for (int k = 0; k < 3; ++k) {
      int n = (k + 1) % 3;
      add(p[k], q[k], q[n]);
      add(p[k], q[n], p[n]);
    }
  }
  return out;
}

Picture renderShadowVolumes(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT_S8_UINT);
  PipelineSpec ambient;
  ambient.vertex = kWorldVertex;
  ambient.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof(Matrices)}};
  ambient.depthTest = ambient.depthWrite = true;
  ambient.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = vec4(passed.w * 0.25 * vec3(1, 0.9, 0.7), 1); }
)";
  Pipeline base = canvas.pipeline(ambient);
  PipelineSpec volume = ambient;
  volume.depthWrite = false;
  volume.compare = VK_COMPARE_OP_LESS;
  volume.writeMask = 0;
  VkStencilOpState count{};
  count.compareOp = VK_COMPARE_OP_ALWAYS;
  count.compareMask = count.writeMask = 255;
  volume.stencil = count;
  volume.adjust = [&](PipelineStates& s) {
    // The volume's faces look outward: counter-clockwise in a picture whose y is flipped.
    s.raster.frontFace = VK_FRONT_FACE_CLOCKWISE;
    s.raster.depthClampEnable = VK_TRUE;   // volumes reach beyond the far plane
    s.depth.front.depthFailOp = VK_STENCIL_OP_DECREMENT_AND_WRAP;
    s.depth.back.depthFailOp = variant == Variant::kBroken ? VK_STENCIL_OP_KEEP : VK_STENCIL_OP_INCREMENT_AND_WRAP;
  };
  Pipeline volumes = canvas.pipeline(volume);
  PipelineSpec light = ambient;
  light.depthWrite = false;
  light.compare = VK_COMPARE_OP_EQUAL;
  VkStencilOpState lit{};
  lit.compareOp = VK_COMPARE_OP_EQUAL;
  lit.compareMask = 255;
  light.stencil = lit;
  VkPipelineColorBlendAttachmentState add{};
  add.blendEnable = VK_TRUE;
  add.srcColorBlendFactor = add.dstColorBlendFactor = add.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  light.blend = add;
  light.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() {
  float cosine = max(dot(normalize(passed.xyz), normalize(vec3(0.6, 1.3, 0.45))), 0.0);
  colour = vec4(passed.w * 0.75 * cosine * vec3(1, 0.9, 0.7), 1);
}
)";
  Pipeline bright = canvas.pipeline(light);
  Scenery scenery;
  auto shadows = shadowVolumes(scenery);
  Matrices matrices{camera(), camera()};
  return canvas.draw({0.3f, 0.4f, 0.6f, 1}, [&](VkCommandBuffer commands) {
    vkCmdPushConstants(commands, base.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof matrices, &matrices);
    canvas.drawVertices(commands, base, scenery.vertices);
    canvas.drawVertices(commands, volumes, shadows);
    canvas.drawVertices(commands, bright, scenery.vertices);
  });
}

// Thin spokes: left with four samples a pixel, right the same drawn four times as large and averaged by hand.
Picture renderSupersampling(Device& device, Variant variant) {
  constexpr uint32_t kHalf = 128;
  auto spokes = [](const glm::uvec2& size, double scale) {
    std::vector<Vertex> out;
    for (int i = 0; i < 40; ++i) {
      double angle = 6.283185307179586 * i / 40;
      auto at = [&](double radius, double a) {
        return atPixel(size, scale * std::round((64.25 + radius * std::cos(a)) * 64) / 64, scale * std::round((63.5 + radius * std::sin(a)) * 64) / 64);
      };
      glm::vec4 colour(1, 0.5f + 0.01f * float(i), 0.2f, 1);
      for (glm::vec4 p : {at(0, 0), at(60, angle), at(60, angle + 0.06)}) out.push_back({p, colour});
    }
    return out;
  };
  Canvas many(device, kHalf, kHalf, VK_FORMAT_UNDEFINED, VK_SAMPLE_COUNT_4_BIT);
  Pipeline p = many.pipeline({});
  Picture left = many.draw({0, 0, 0.1f, 1}, [&](VkCommandBuffer c) { many.drawVertices(c, p, spokes(many.size(), 1)); });
  const uint32_t kFactor = variant == Variant::kBroken ? 2 : 4;
  Canvas large(device, kHalf * kFactor, kHalf * kFactor);
  Pipeline q = large.pipeline({});
  Picture big = large.draw({0, 0, 0.1f, 1}, [&](VkCommandBuffer c) { large.drawVertices(c, q, spokes(large.size(), kFactor)); });
  Picture whole(2 * kHalf, kHalf);
  for (uint32_t y = 0; y < kHalf; ++y)
    for (uint32_t x = 0; x < kHalf; ++x) {
      std::memcpy(whole.at(x, y), left.at(x, y), 4);
      for (int c = 0; c < 4; ++c) {
        uint32_t sum = 0;
        for (uint32_t k = 0; k < kFactor * kFactor; ++k) sum += big.at(x * kFactor + k % kFactor, y * kFactor + k / kFactor)[c];
        whole.at(x + kHalf, y)[c] = uint8_t((sum + kFactor * kFactor / 2) / (kFactor * kFactor));
      }
    }
  return whole;
}

std::string verifySupersampling(const Picture& picture) {
  // Both approximate the same areas; inside and outside they are equal.
  uint64_t difference = 0;
  for (uint32_t y = 0; y < 128; ++y)
    for (uint32_t x = 0; x < 128; ++x) difference += uint64_t(std::abs(int(picture.at(x, y)[0]) - int(picture.at(x + 128, y)[0])));
  double mean = double(difference) / (128 * 128);
  if (mean > 8) return "multisampling and supersampling differ by " + std::to_string(mean) + " of 255 on average";
  return {};
}

// Left: triangles rasterized with depth. Right: the same triangles met by a ray for each pixel, in the fragment shader.
constexpr int kTriangles = 12;
std::vector<Vertex> crossingTriangles() {
  std::vector<Vertex> out;
  uint32_t state = 12345;
  auto next = [&] {
    state = state * 1664525u + 1013904223u;
    return double(state >> 8) / double(1 << 24);
  };
  for (int i = 0; i < kTriangles; ++i) {
    glm::vec4 colour(0.2 + 0.8 * next(), 0.2 + 0.8 * next(), 0.2 + 0.8 * next(), 1);
    for (int k = 0; k < 3; ++k) {
      double w = 1 + next() * 3;
      double x = std::round(next() * 128 * 4) / 4 / 64 - 1, y = std::round(next() * 256 * 4) / 4 / 128 - 1;
      out.push_back({{float(x * w), float(y * w), float((w - 0.9) / 3.2 * w), float(w)}, colour * (1 - 0.2f * float(k))});
    }
  }
  return out;
}

Picture renderRayCaster(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  auto vertices = crossingTriangles();
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  spec.compare = VK_COMPARE_OP_LESS;
  Pipeline raster = canvas.pipeline(spec);
  Buffer data = canvas.bufferOf(vertices, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  Binding binding{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER};
  binding.buffer = {data.handle, 0, VK_WHOLE_SIZE};
  DescriptorSet set = canvas.descriptors({binding});
  PipelineSpec cast;
  cast.sets = {set.layout};
  cast.fragment = std::string(R"(#version 450
struct V { vec4 position, colour; };
layout(set = 0, binding = 0) readonly buffer Data { V v[]; };
layout(location = 0) out vec4 colour;
void main() {
  vec2 p = (gl_FragCoord.xy - vec2(128, 0)) / vec2(64, 128) - 1;
  float nearest = 1.0;
  colour = vec4(0, 0, 0, 1);
  for (int t = 0; t < )") + std::to_string(variant == Variant::kBroken ? kTriangles - 1 : kTriangles) + R"(; ++t) {
    V a = v[3 * t], b = v[3 * t + 1], c = v[3 * t + 2];
    vec2 pa = a.position.xy / a.position.w, pb = b.position.xy / b.position.w, pc = c.position.xy / c.position.w;
    float area = (pb.x - pa.x) * (pc.y - pa.y) - (pb.y - pa.y) * (pc.x - pa.x);
    vec3 e = vec3((pc.x - pb.x) * (p.y - pb.y) - (pc.y - pb.y) * (p.x - pb.x), (pa.x - pc.x) * (p.y - pc.y) - (pa.y - pc.y) * (p.x - pc.x),
                  (pb.x - pa.x) * (p.y - pa.y) - (pb.y - pa.y) * (p.x - pa.x)) / area;
    if (min(e.x, min(e.y, e.z)) < 0) continue;
    float z = dot(e, vec3(a.position.z / a.position.w, b.position.z / b.position.w, c.position.z / c.position.w));
    if (z >= nearest || z < 0) continue;
    nearest = z;
    vec3 w = e / vec3(a.position.w, b.position.w, c.position.w);
    colour = (a.colour * w.x + b.colour * w.y + c.colour * w.z) / (w.x + w.y + w.z);
  }
}
)";
  Pipeline rays = canvas.pipeline(cast);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    setViewport(commands, 0, 0, 128, 256);
    canvas.drawVertices(commands, raster, vertices);
    setViewport(commands, 128, 0, 128, 256);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, rays.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, rays, {{{-1, -1, 0, 1}, {}}, {{3, -1, 0, 1}, {}}, {{-1, 3, 0, 1}, {}}});
  });
}

// The two halves agree, but for pixels on edges.
std::string verifyRayCaster(const Picture& picture) {
  uint32_t different = 0, lit = 0;
  for (uint32_t y = 0; y < 256; ++y)
    for (uint32_t x = 0; x < 128; ++x) {
      auto a = picture.pixel(x, y), b = picture.pixel(x + 128, y);
      bool same = true;
      for (int c = 0; c < 3; ++c) same &= std::abs(a[c] - b[c]) <= 2;
      different += !same;
      lit += a[0] != 0;
    }
  if (lit < 5000) return "almost nothing was drawn";
  if (different > 60) return std::to_string(different) + " pixels differ between the rasterizer and the ray caster";
  return {};
}

}  // namespace

void addTechniqueScenes(SceneList& scenes) {
  auto add = [&](const char* name, const char* broken, Picture (*render)(Device&, Variant)) -> Scene& {
    Scene scene;
    scene.name = name;
    scene.broken = broken;
    scene.render = render;
    scene.expectation = [] {
      Expectation e;
      e.stepFunctions = true;   // outlines of the scenery are not on the grid, nor are those of shadows
      e.stepShare = 0.004;
      e.colourTolerance = 2;
      return e;
    };
    scenes.push_back(scene);
    return scenes.back();
  };
  add("shadow_map", "shadows half as dark", renderShadowMap).supported = [](const Device& d) {
    return d.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT);
  };
  add("stencil_shadow_volumes", "back faces do not count", renderShadowVolumes).supported = [](const Device& d) {
    return d.features.depthClamp && depthFormat(d, VK_FORMAT_D32_SFLOAT_S8_UINT);
  };
  for (Scene& scene : scenes)
    if (scene.name == "shadow_map" || scene.name == "stencil_shadow_volumes")
      scene.expectation = [] {
        Expectation e;
        e.onGrid = false;
        std::vector<glm::vec4> corners;
        for (const Vertex& v : Scenery().vertices) corners.push_back(camera() * v.position);
        e.edges = edgesOfTriangles(corners, {0, 0, kSize, kSize});
        e.stepFunctions = true;   // outlines of shadows
        e.stepShare = 0.004;
        e.colourTolerance = 2;
        return e;
      };
  Scene& super = add("supersampling", "four instead of sixteen", renderSupersampling);
  super.verify = verifySupersampling;
  super.supported = [](const Device& d) { return (d.properties.limits.framebufferColorSampleCounts & VK_SAMPLE_COUNT_4_BIT) != 0; };
  Scene& rays = add("ray_caster", "a triangle is missed", renderRayCaster);
  rays.verify = verifyRayCaster;
  rays.supported = [](const Device& d) { return depthFormat(d, VK_FORMAT_D32_SFLOAT); };
}

}  // namespace pumice::cts
