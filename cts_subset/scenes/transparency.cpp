// Transparency that does not depend on the order of drawing: each pixel keeps a list of its fragments in storage
// memory, made with atomics, and a second pass sorts and blends it.
#include <glm/gtc/matrix_transform.hpp>

#include <algorithm>
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;
constexpr int kPanes = 7;
constexpr uint32_t kNodes = kSize * kSize * kPanes;

// Panes of glass that stand through each other about one axis: no order of whole panes is right.
std::vector<std::vector<Vertex>> panes() {
  glm::mat4 flip(1);
  flip[1][1] = -1;
  glm::mat4 toClip = flip * glm::perspective(0.8f, 1.0f, 0.5f, 20.0f) * glm::lookAt(glm::vec3(0.8f, 1.9f, 4), glm::vec3(0, 0, 0), glm::vec3(0, 1, 0));
  std::vector<std::vector<Vertex>> out;
  for (int i = 0; i < kPanes; ++i) {
    float angle = 3.14159265f * (float(i) + 0.3f) / kPanes;
    glm::vec3 side = 1.5f * glm::vec3(std::cos(angle), 0, std::sin(angle)), up(0, 1.1f, 0);
    float t = float(i) / kPanes * 6.2831853f;
    glm::vec4 colour(0.55f + 0.45f * std::cos(t), 0.55f + 0.45f * std::cos(t - 2.1f), 0.55f + 0.45f * std::cos(t + 2.1f), 0.45f);
    auto at = [&](float u, float v) { return Vertex{toClip * glm::vec4(side * u + up * v, 1), colour}; };
    out.push_back({at(-1, -1), at(1, -1), at(1, 1), at(-1, -1), at(1, 1), at(-1, 1)});
  }
  return out;
}

const char* const kCollect = R"(#version 450
layout(set = 0, binding = 0, r32ui) uniform uimage2D heads;
struct Node { vec4 colour; uint depth, pane, next, unused; };
layout(set = 0, binding = 1) buffer Nodes { uint count; uint unused[3]; Node node[]; };
layout(push_constant) uniform Push { uint pane; };
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() {
  uint mine = atomicAdd(count, 1u);
  if (mine < node.length()) {
    node[mine].colour = passed;
    node[mine].depth = floatBitsToUint(gl_FragCoord.z);
    node[mine].pane = pane;
    node[mine].next = imageAtomicExchange(heads, ivec2(gl_FragCoord.xy), mine + 1u);
  }
  colour = vec4(0);
}
)";

// The list is sorted from far to near, equal depths by the number of the pane.
std::string sortAndBlend(bool byDepth) {
  return std::string(R"(#version 450
layout(set = 0, binding = 0, r32ui) uniform readonly uimage2D heads;
struct Node { vec4 colour; uint depth, pane, next, unused; };
layout(set = 0, binding = 1) readonly buffer Nodes { uint count; uint unused[3]; Node node[]; };
layout(location = 0) out vec4 colour;
bool behind(uint a, uint b) { return )") +
         (byDepth ? "node[a].depth != node[b].depth ? node[a].depth > node[b].depth : node[a].pane < node[b].pane" : "node[a].pane > node[b].pane") + R"(; }
void main() {
  uint list[16];
  int length = 0;
  for (uint next = imageLoad(heads, ivec2(gl_FragCoord.xy)).x; next != 0u && length < 16; next = node[next - 1u].next) {
    int place = length++;
    for (; place > 0 && behind(next - 1u, list[place - 1]); --place) list[place] = list[place - 1];
    list[place] = next - 1u;
  }
  vec3 sum = vec3(0.93, 0.93, 0.96) * (0.75 + 0.25 * gl_FragCoord.y / 256.0);
  for (int i = 0; i < length; ++i) {
    vec4 c = node[list[i]].colour;
    sum = mix(sum, c.rgb, c.a);
  }
  colour = vec4(sum, 1);
}
)";
}

Picture renderOnce(Device& device, Variant variant, bool backwards) {
  Canvas canvas(device, kSize, kSize);
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {kSize, kSize, 1};
  spec.usage = VK_IMAGE_USAGE_STORAGE_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  Image heads = canvas.image(spec);
  Buffer nodes = canvas.buffer(16 + 32 * VkDeviceSize(kNodes), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  std::memset(nodes.mapped, 0, 16);
  Binding lists{VK_DESCRIPTOR_TYPE_STORAGE_IMAGE}, memory{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER};
  lists.image = {VK_NULL_HANDLE, canvas.view(heads), VK_IMAGE_LAYOUT_GENERAL};
  memory.buffer = {nodes.handle, 0, VK_WHOLE_SIZE};
  DescriptorSet set = canvas.descriptors({lists, memory});
  device.run([&](VkCommandBuffer commands) {
    transition(commands, heads, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
    VkClearColorValue none{};
    VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdClearColorImage(commands, heads.handle, VK_IMAGE_LAYOUT_GENERAL, &none, 1, &all);
    fullBarrier(commands);
  });

  PipelineSpec gather;
  gather.fragment = kCollect;
  gather.sets = {set.layout};
  gather.pushConstants = {{VK_SHADER_STAGE_FRAGMENT_BIT, 0, 4}};
  gather.writeMask = 0;
  Pipeline collect = canvas.pipeline(gather);
  PipelineSpec resolve;
  resolve.fragment = sortAndBlend(variant == Variant::kGood);
  resolve.sets = {set.layout};
  Pipeline show = canvas.pipeline(resolve);
  auto glass = panes();
  canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, collect.layout, 0, 1, &set.handle, 0, nullptr);
    for (int k = 0; k < kPanes; ++k) {
      uint32_t pane = uint32_t(backwards ? kPanes - 1 - k : k);
      vkCmdPushConstants(commands, collect.layout, VK_SHADER_STAGE_FRAGMENT_BIT, 0, 4, &pane);
      canvas.drawVertices(commands, collect, glass[pane]);
    }
  });
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, show.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, show, {{{-1, -1, 0, 1}, {}}, {{3, -1, 0, 1}, {}}, {{-1, 3, 0, 1}, {}}});
  });
}

// Left the panes are drawn in one order, right in the other.
Picture renderTransparency(Device& device, Variant variant) {
  Picture left = renderOnce(device, variant, false), right = renderOnce(device, variant, true), whole(2 * kSize, kSize);
  for (uint32_t y = 0; y < kSize; ++y) {
    std::copy_n(left.at(0, y), kSize * 4, whole.at(0, y));
    std::copy_n(right.at(0, y), kSize * 4, whole.at(kSize, y));
  }
  return whole;
}

std::string verifyTransparency(const Picture& picture) {
  for (uint32_t y = 0; y < kSize; ++y)
    if (!std::equal(picture.at(0, y), picture.at(0, y) + kSize * 4, picture.at(kSize, y)))
      return "the two orders of drawing differ in row " + std::to_string(y);
  return {};
}

}  // namespace

void addTransparencyScenes(SceneList& scenes) {
  Scene scene;
  scene.name = "transparency_lists";
  scene.broken = "fragments sorted by pane instead of depth";
  scene.render = renderTransparency;
  scene.verify = verifyTransparency;
  scene.supported = [](const Device& d) {
    return d.features.fragmentStoresAndAtomics && d.supports(VK_FORMAT_R32_UINT, VK_FORMAT_FEATURE_STORAGE_IMAGE_ATOMIC_BIT);
  };
  scene.expectation = [] {
    Expectation e;
    e.onGrid = false;
    for (const std::vector<Vertex>& pane : panes())
      for (double x : {0.0, double(kSize)}) {
        std::vector<glm::vec4> corners;
        for (const Vertex& v : pane) corners.push_back(v.position);
        for (const Edge& edge : edgesOfTriangles(corners, {x, 0, kSize, kSize})) e.edges.push_back(edge);
      }
    e.stepFunctions = true;  // panes meet along the axis: there their depths tie
    e.stepShare = 0.002;
    return e;
  };
  scenes.push_back(scene);
}

}  // namespace pumice::cts
