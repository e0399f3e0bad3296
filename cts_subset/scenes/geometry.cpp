// Geometry that a compute shader makes or chooses: a smooth surface diced into polygons of about a pixel (Cook,
// Carpenter and Catmull, "The Reyes image rendering architecture", 1987), and meshes with levels of detail.
#include <glm/gtc/matrix_transform.hpp>

#include <cmath>
#include <map>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

glm::mat4 camera(glm::vec3 eye, glm::vec3 target, float angle) {
  glm::mat4 flip(1);
  flip[1][1] = -1;
  return flip * glm::perspective(angle, 1.0f, 0.5f, 60.0f) * glm::lookAt(eye, target, glm::vec3(0, 1, 0));
}

// ---- micropolygons ---------------------------------------------------------------------------------------

constexpr int kPatchesU = 10, kPatchesV = 6;  // a bicubic B-spline surface, closed in both directions

// The control net: a ring with bumps.
std::vector<glm::vec4> controlNet() {
  std::vector<glm::vec4> net;
  for (int j = 0; j < kPatchesV; ++j)
    for (int i = 0; i < kPatchesU; ++i) {
      float a = 6.2831853f * float(i) / kPatchesU, b = 6.2831853f * float(j) / kPatchesV;
      float tube = i % 2 ? 1.05f : 0.45f;
      float ring = 1.6f + tube * std::cos(b);
      net.push_back({ring * std::cos(a), tube * std::sin(b), ring * std::sin(a), 1});
    }
  return net;
}

// One invocation for each vertex: position and colour, as a Reyes renderer shades the corners of micropolygons.
std::string diceShader(int rate) {
  return "#version 450\n#define RATE " + std::to_string(rate) + "\n#define NU " + std::to_string(kPatchesU) + "\n#define NV " + std::to_string(kPatchesV) + R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Net { mat4 toClip; vec4 net[]; };
struct Corner { vec4 position, colour; };
layout(set = 0, binding = 1) writeonly buffer Corners { Corner corner[]; };
vec4 weights(float t) {
  float s = 1.0 - t;
  return vec4(s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0, t * t * t) / 6.0;
}
vec4 slopes(float t) {
  float s = 1.0 - t;
  return vec4(-s * s, 3.0 * t * t - 4.0 * t, -3.0 * s * s + 4.0 * s, t * t) / 2.0;
}
void main() {
  uint id = gl_GlobalInvocationID.x, side = RATE + 1u, patches = NU * NV;
  if (id >= patches * side * side) return;
  uint which = id / (side * side), i = id % side, j = id / side % side;
  float u = float(i) / float(RATE), v = float(j) / float(RATE);
  vec4 wu = weights(u), wv = weights(v), du = slopes(u), dv = slopes(v);
  vec3 p = vec3(0), pu = vec3(0), pv = vec3(0);
  for (uint b = 0u; b < 4u; ++b)
    for (uint a = 0u; a < 4u; ++a) {
      vec3 c = net[(which / NU + b) % NV * NU + (which % NU + a) % NU].xyz;
      p += c * wu[a] * wv[b];
      pu += c * du[a] * wv[b];
      pv += c * wu[a] * dv[b];
    }
  vec3 n = normalize(cross(pv, pu));
  vec3 light = normalize(vec3(0.5, 1.0, 0.6));
  float lit = max(dot(n, light), 0.0), gleam = max(dot(n, normalize(light + vec3(0.0, 0.6, 0.8))), 0.0);
  gleam *= gleam; gleam *= gleam; gleam *= gleam;
  vec3 tint = mix(vec3(0.85, 0.35, 0.2), vec3(0.25, 0.5, 0.8), clamp(p.y * 0.7 + 0.5, 0.0, 1.0));
  corner[id].position = toClip * vec4(p, 1);
  corner[id].colour = vec4(tint * (0.2 + 0.7 * lit) + 0.35 * gleam * gleam, 1);
}
)";
}

Picture renderMicropolygons(Device& device, Variant variant) {
  const uint32_t rate = variant == Variant::kBroken ? 2 : 28, side = rate + 1;
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  std::vector<glm::vec4> given = controlNet();
  glm::mat4 toClip = camera({0, 3.4f, 4.4f}, {0, -0.1f, 0}, 0.75f);
  given.insert(given.begin(), {toClip[0], toClip[1], toClip[2], toClip[3]});
  Buffer net = canvas.bufferOf(given, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  const uint32_t patches = kPatchesU * kPatchesV, corners = patches * side * side;
  Buffer diced = canvas.buffer(corners * sizeof(Vertex), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  std::vector<uint32_t> indices;
  for (uint32_t p = 0; p < patches; ++p)
    for (uint32_t j = 0; j < rate; ++j)
      for (uint32_t i = 0; i < rate; ++i) {
        uint32_t a = p * side * side + j * side + i, b = a + 1, c = a + side, d = c + 1;
        for (uint32_t k : {a, b, c, b, d, c}) indices.push_back(k);
      }
  Buffer order = canvas.bufferOf(indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  Binding in{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER}, out = in;
  in.buffer = {net.handle, 0, VK_WHOLE_SIZE};
  out.buffer = {diced.handle, 0, VK_WHOLE_SIZE};
  DescriptorSet set = canvas.descriptors({in, out});
  Pipeline dice = canvas.compute(diceShader(int(rate)), {set.layout});
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  Pipeline draw = canvas.pipeline(spec);
  device.run([&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, dice.handle);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, dice.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdDispatch(commands, (corners + 63) / 64, 1, 1);
    fullBarrier(commands);
  });
  return canvas.draw({0.07f, 0.08f, 0.12f, 1}, [&](VkCommandBuffer commands) {
    VkDeviceSize offset = 0;
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw.handle);
    vkCmdBindVertexBuffers(commands, 0, 1, &diced.handle, &offset);
    vkCmdBindIndexBuffer(commands, order.handle, 0, VK_INDEX_TYPE_UINT32);
    vkCmdDrawIndexed(commands, uint32_t(indices.size()), 1, 0, 0, 0);
  });
}

// ---- levels of detail ------------------------------------------------------------------------------------

constexpr int kLevels = 5, kRows = 9, kColumns = 7, kObjects = kRows * kColumns;

// Balls of 8, 32, 128, 512 and 2048 triangles in one buffer.
struct Balls {
  std::vector<glm::vec4> corners;
  std::vector<uint32_t> indices;
  uint32_t first[kLevels], count[kLevels];
  Balls() {
    for (glm::vec3 p : {glm::vec3(1, 0, 0), {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) corners.push_back(glm::vec4(p, 1));
    std::vector<uint32_t> level = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> halves;
    auto half = [&](uint32_t a, uint32_t b) {
      auto [found, made] = halves.try_emplace(std::minmax(a, b), uint32_t(corners.size()));
      if (made) corners.push_back(glm::vec4(glm::normalize(glm::vec3(corners[a]) + glm::vec3(corners[b])), 1));
      return found->second;
    };
    for (int l = 0; l < kLevels; ++l) {
      first[l] = uint32_t(indices.size());
      count[l] = uint32_t(level.size());
      indices.insert(indices.end(), level.begin(), level.end());
      std::vector<uint32_t> finer;
      for (size_t i = 0; i < level.size(); i += 3) {
        uint32_t a = level[i], b = level[i + 1], c = level[i + 2], ab = half(a, b), bc = half(b, c), ca = half(c, a);
        for (uint32_t k : {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca}) finer.push_back(k);
      }
      level = finer;
    }
  }
};

const glm::vec3 kEye(0, 2.4f, 4);

// Chooses the level of each object by its distance and writes the draw.
std::string chooseShader(const Balls& balls, float scale) {
  std::string firsts, counts;
  for (int l = 0; l < kLevels; ++l) {
    firsts += (l ? ", " : "") + std::to_string(balls.first[l]) + "u";
    counts += (l ? ", " : "") + std::to_string(balls.count[l]) + "u";
  }
  return "#version 450\nconst uint first[5] = uint[](" + firsts + "), count[5] = uint[](" + counts + ");\nconst float scale = " + std::to_string(scale) + R"(;
layout(local_size_x = 64) in;
struct Object { vec4 place; uint level, a, b, c; };
struct Draw { uint indices, instances, firstIndex; int vertexOffset; uint firstInstance; };
layout(set = 0, binding = 0) buffer Objects { mat4 toClip; vec4 eye; Object object[]; };
layout(set = 0, binding = 1) writeonly buffer Draws { Draw draw[]; };
void main() {
  uint id = gl_GlobalInvocationID.x;
  if (id >= uint(object.length())) return;
  float away = distance(object[id].place.xyz, eye.xyz) * scale;
  uint level = away < 5.1 ? 4u : away < 7.3 ? 3u : away < 10.7 ? 2u : away < 15.9 ? 1u : 0u;
  object[id].level = level;
  draw[id] = Draw(count[level], 1u, first[level], 0, id);
}
)";
}

Picture renderLevels(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize, VK_FORMAT_D32_SFLOAT);
  Balls balls;
  struct Object {
    glm::vec4 place;
    uint32_t level[4];
  };
  std::vector<uint8_t> bytes;
  auto append = [&](const auto& value) {
    auto* p = reinterpret_cast<const uint8_t*>(&value);
    bytes.insert(bytes.end(), p, p + sizeof value);
  };
  append(camera(kEye, {0, 0.2f, -1.5f}, 0.85f));
  append(glm::vec4(kEye, 1));
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c) append(Object{{(float(c) - 3) * 1.25f + 0.3f * float(r % 2), 0, 2 - 2.3f * float(r), 0.55f}, {}});
  Buffer objects = canvas.bufferOf(bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  Buffer draws = canvas.buffer(kObjects * sizeof(VkDrawIndexedIndirectCommand), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  Buffer corners = canvas.bufferOf(balls.corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  Buffer indices = canvas.bufferOf(balls.indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  Binding first{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER}, second = first;
  first.buffer = {objects.handle, 0, VK_WHOLE_SIZE};
  second.buffer = {draws.handle, 0, VK_WHOLE_SIZE};
  DescriptorSet set = canvas.descriptors({first, second});
  Pipeline choose = canvas.compute(chooseShader(balls, variant == Variant::kBroken ? 1.6f : 1.0f), {set.layout});
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  spec.sets = {set.layout};
  spec.bindings = {{0, sizeof(glm::vec4), VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32G32B32A32_SFLOAT, 0}};
  spec.vertex = R"(#version 450
layout(location = 0) in vec4 position;
struct Object { vec4 place; uint level, a, b, c; };
layout(set = 0, binding = 0) readonly buffer Objects { mat4 toClip; vec4 eye; Object object[]; };
const vec3 tints[5] = vec3[](vec3(0.95, 0.35, 0.3), vec3(0.95, 0.7, 0.25), vec3(0.6, 0.85, 0.3), vec3(0.3, 0.75, 0.85), vec3(0.55, 0.5, 0.95));
layout(location = 0) out vec4 passed;
void main() {
  Object o = object[gl_InstanceIndex];
  gl_Position = toClip * vec4(o.place.xyz + position.xyz * o.place.w, 1);
  float lit = max(dot(position.xyz, normalize(vec3(0.5, 0.9, 0.6))), 0.0);
  passed = vec4(tints[o.level] * (0.25 + 0.75 * lit), 1);
}
)";
  Pipeline draw = canvas.pipeline(spec);
  device.run([&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, choose.handle);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, choose.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdDispatch(commands, 1, 1, 1);
    fullBarrier(commands);
  });
  return canvas.draw({0.16f, 0.18f, 0.22f, 1}, [&](VkCommandBuffer commands) {
    VkDeviceSize offset = 0;
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw.handle);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdBindVertexBuffers(commands, 0, 1, &corners.handle, &offset);
    vkCmdBindIndexBuffer(commands, indices.handle, 0, VK_INDEX_TYPE_UINT32);
    vkCmdDrawIndexedIndirect(commands, draws.handle, 0, kObjects, sizeof(VkDrawIndexedIndirectCommand));
  });
}

}  // namespace

void addGeometryScenes(SceneList& scenes) {
  Scene micro;
  micro.name = "micropolygons";
  micro.broken = "patches diced into four instead of 784";
  micro.render = renderMicropolygons;
  micro.expectation = [] {
    // Corners come from a shader, off the grid: an outline may be a pixel of its neighbour's colour.
    Expectation e;
    e.stepFunctions = true;
    e.stepShare = 0.002;
    e.colourTolerance = 3;
    return e;
  };
  micro.supported = [](const Device& d) { return d.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT); };
  scenes.push_back(micro);

  Scene levels = micro;
  levels.name = "levels_of_detail";
  levels.broken = "levels chosen for 1.6 times the distance";
  levels.render = renderLevels;
  levels.supported = [](const Device& d) {
    return d.features.multiDrawIndirect && d.features.drawIndirectFirstInstance && d.properties.limits.maxDrawIndirectCount >= kObjects &&
           d.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT);
  };
  scenes.push_back(levels);
}

}  // namespace pumice::cts
