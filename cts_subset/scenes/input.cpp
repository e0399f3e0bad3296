// Input assembly: indexed lists, strips, fans, restart, instances, vertex formats.
#include "cts_subset/harness/scene.h"

#include <cmath>

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

// Vertices on a wavy band, upper and lower by turns.
std::vector<Vertex> band(const glm::uvec2& canvas, int count, double top) {
  std::vector<Vertex> out;
  for (int i = 0; i < count; ++i) {
    double x = 8 + std::round(240.0 * i / (count - 1) * 256) / 256;
    double wave = std::round(10 * std::sin(i * 0.9) * 256) / 256;
    double y = top + (i % 2 ? 34 : 0) + wave;
    out.push_back(
        {atPixel(canvas, x, y), {0.2f + 0.8f * float(i % 3) / 2, 0.9f - 0.05f * float(i), 0.6f, 1}});
  }
  return out;
}

template <class Index>
void bindIndices(Canvas& canvas, VkCommandBuffer commands, const std::vector<Index>& indices) {
  Buffer made = canvas.bufferOf(indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  vkCmdBindIndexBuffer(commands, made.handle, 0,
                       sizeof(Index) == 2 ? VK_INDEX_TYPE_UINT16 : VK_INDEX_TYPE_UINT32);
}

Picture renderTopologies(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  auto make = [&](VkPrimitiveTopology topology, bool restart) {
    PipelineSpec spec;
    spec.topology = topology;
    spec.primitiveRestart = restart;
    // Culling shows whether every second triangle of a strip is turned round.
    spec.cull = VK_CULL_MODE_BACK_BIT;
    spec.frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;
    return canvas.pipeline(spec);
  };
  Pipeline list = make(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, false);
  Pipeline strip = make(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP, false);
  Pipeline restart = make(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP, true);
  Pipeline fan = make(VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN, false);
  bool broken = variant == Variant::kBroken;
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    auto bind = [&](const Pipeline& p) {
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, p.handle);
    };
    // A strip, plain.
    bind(strip);
    canvas.bindVertices(commands, band(canvas.size(), 14, 16));
    vkCmdDraw(commands, broken ? 13 : 14, 1, 0, 0);
    // An indexed list, 16 bits, with firstIndex and vertexOffset.
    bind(list);
    canvas.bindVertices(commands, band(canvas.size(), 14, 66));
    std::vector<uint16_t> listIndices = {9, 9, 9, 9};
    for (uint16_t i = 0; i < 6; ++i)
      for (uint16_t k : {2 * i, 2 * i + 1, 2 * i + 2}) listIndices.push_back(uint16_t(k + 5));
    bindIndices(canvas, commands, listIndices);
    vkCmdDrawIndexed(commands, 18, 1, 4, -5, 0);
    // An indexed strip with restart, 32 bits.
    bind(restart);
    canvas.bindVertices(commands, band(canvas.size(), 14, 116));
    bindIndices<uint32_t>(
        canvas, commands,
        {0, 1, 2, 3, 4, 0xffffffffu, 5, 6, 7, 0xffffffffu, 0xffffffffu, 9, 10, 0xffffffffu, 10, 11, 12, 13});
    vkCmdDrawIndexed(commands, 18, 1, 0, 0, 0);
    // An indexed strip with restart, 16 bits.
    canvas.bindVertices(commands, band(canvas.size(), 14, 166));
    bindIndices<uint16_t>(canvas, commands, {1, 0, 3, 2, 0xffff, 4, 5, 6, 6, 8, 8, 9, 10});
    vkCmdDrawIndexed(commands, 13, 1, 0, 0, 0);
    // A fan.
    bind(fan);
    std::vector<Vertex> petals;
    petals.push_back({atPixel(canvas.size(), 128, 232), {1, 1, 1, 1}});
    for (int i = 0; i < 9; ++i)
      petals.push_back(
          {atPixel(canvas.size(), 200 - i * 18, i % 2 ? 212 : 206), {0.1f * float(i), 0.6f, 1, 1}});
    canvas.bindVertices(commands, petals);
    vkCmdDraw(commands, 10, 1, 0, 0);
  });
}

// Two bindings, one stepping per instance, with packed vertex formats and an offset.
Picture renderInstances(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  struct Corner {
    float x, y;
    uint8_t shade[4];
  };
  struct Instance {
    float padding;
    float x, y;
    uint16_t tint[4];
  };
  std::vector<Corner> corners = {
      {-8, -8, {255, 200, 100, 255}}, {12.5f, -6, {100, 255, 200, 255}}, {2, 13.25f, {200, 100, 255, 255}}};
  std::vector<Instance> instances;
  for (int i = 0; i < 49; ++i)
    instances.push_back({0,
                         float(20 + i % 7 * 36),
                         float(20 + i / 7 * 36),
                         {uint16_t(65535 - i * 900), uint16_t(i * 1300), 40000, 65535}});
  PipelineSpec spec;
  spec.vertex = R"(#version 450
layout(location = 0) in vec2 corner;
layout(location = 1) in vec4 shade;
layout(location = 2) in vec2 offset;
layout(location = 3) in vec4 tint;
layout(location = 0) out vec4 passed;
void main() {
    gl_Position = vec4((corner + offset) / 128.0 - 1.0, 0.0, 1.0);
    passed = shade * tint;
}
)";
  spec.bindings = {{0, sizeof(Corner), VK_VERTEX_INPUT_RATE_VERTEX},
                   {1, sizeof(Instance), VK_VERTEX_INPUT_RATE_INSTANCE}};
  spec.attributes = {{0, 0, VK_FORMAT_R32G32_SFLOAT, offsetof(Corner, x)},
                     {1, 0, VK_FORMAT_R8G8B8A8_UNORM, offsetof(Corner, shade)},
                     {2, 1, VK_FORMAT_R32G32_SFLOAT, offsetof(Instance, x)},
                     {3, 1, VK_FORMAT_R16G16B16A16_UNORM, offsetof(Instance, tint)}};
  Pipeline pipeline = canvas.pipeline(spec);
  Buffer first = canvas.bufferOf(corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  Buffer second = canvas.bufferOf(instances, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    VkBuffer buffers[] = {first.handle, second.handle};
    VkDeviceSize offsets[] = {0, 2 * sizeof(Instance)};
    vkCmdBindVertexBuffers(commands, 0, 2, buffers, offsets);
    vkCmdDraw(commands, 3, 20, 0, 0);
    vkCmdDraw(commands, 3, variant == Variant::kBroken ? 24 : 25, 0, 22);
  });
}

// Every vertex format of the list that the device reports, each with one small triangle whose
// colour is the attribute.
struct VertexFormat {
  VkFormat format;
  uint32_t size;
};
const VertexFormat kVertexFormats[] = {
    {VK_FORMAT_R8_UNORM, 1},
    {VK_FORMAT_R8G8_UNORM, 2},
    {VK_FORMAT_R8G8B8A8_UNORM, 4},
    {VK_FORMAT_R8G8B8A8_SNORM, 4},
    {VK_FORMAT_B8G8R8A8_UNORM, 4},
    {VK_FORMAT_A8B8G8R8_UNORM_PACK32, 4},
    {VK_FORMAT_A2B10G10R10_UNORM_PACK32, 4},
    {VK_FORMAT_R16_UNORM, 2},
    {VK_FORMAT_R16G16_UNORM, 4},
    {VK_FORMAT_R16G16B16A16_UNORM, 8},
    {VK_FORMAT_R16G16B16A16_SNORM, 8},
    {VK_FORMAT_R16_SFLOAT, 2},
    {VK_FORMAT_R16G16_SFLOAT, 4},
    {VK_FORMAT_R16G16B16A16_SFLOAT, 8},
    {VK_FORMAT_R32_SFLOAT, 4},
    {VK_FORMAT_R32G32_SFLOAT, 8},
    {VK_FORMAT_R32G32B32_SFLOAT, 12},
    {VK_FORMAT_R32G32B32A32_SFLOAT, 16},
};

Picture renderVertexFormats(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 64);
  std::vector<Pipeline> pipelines;
  std::vector<Buffer> buffers;
  for (const VertexFormat& entry : kVertexFormats) {
    PipelineSpec spec;
    spec.vertex = R"(#version 450
layout(location = 0) in vec4 value;
layout(location = 0) out vec4 passed;
const vec2 corners[3] = vec2[](vec2(-0.875, -0.875), vec2(0.875, -0.875), vec2(0.0, 0.875));
void main() { gl_Position = vec4(corners[gl_VertexIndex], 0.0, 1.0); passed = abs(value); }
)";
    spec.bindings = {{0, 16, VK_VERTEX_INPUT_RATE_VERTEX}};
    spec.attributes = {{0, 0, entry.format, 0}};
    pipelines.push_back(canvas.pipeline(spec));
    std::vector<uint8_t> bytes(48);
    for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = uint8_t(i * 53 + 17);
    // Floats and halves in [0, 1): a random exponent would say nothing about the colour.
    auto putFloat = [&](size_t at, float value) { std::memcpy(&bytes[at], &value, 4); };
    bool single = entry.format >= VK_FORMAT_R32_SFLOAT;
    bool half = entry.format == VK_FORMAT_R16_SFLOAT || entry.format == VK_FORMAT_R16G16_SFLOAT ||
                entry.format == VK_FORMAT_R16G16B16A16_SFLOAT;
    for (size_t i = 0; i < 12; ++i)
      if (single) putFloat(i * 4, 0.08f * float(i) + 0.05f);
    for (size_t i = 0; i < 24; ++i)
      if (half) {
        uint16_t value = uint16_t(0x3000 + i * 0x70);  // 0.125 to 0.8
        std::memcpy(&bytes[i * 2], &value, 2);
      }
    if (variant == Variant::kBroken) bytes[1] ^= 0x60;
    buffers.push_back(canvas.bufferOf(bytes, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT));
  }
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (size_t i = 0; i < pipelines.size(); ++i) {
      setViewport(commands, float(i % 9 * 28), float(i / 9 * 32), 32, 32);
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipelines[i].handle);
      VkDeviceSize offset = 0;
      vkCmdBindVertexBuffers(commands, 0, 1, &buffers[i].handle, &offset);
      vkCmdDraw(commands, 3, 1, 0, 0);
    }
  });
}

}  // namespace

void addInputScenes(SceneList& scenes) {
  Scene topologies;
  topologies.name = "strips_lists_fans";
  topologies.broken = "the last vertex of a strip is lost";
  topologies.render = renderTopologies;
  scenes.push_back(topologies);

  Scene instances;
  instances.name = "instances";
  instances.broken = "the last instance is lost";
  instances.render = renderInstances;
  scenes.push_back(instances);

  Scene formats;
  formats.name = "vertex_formats";
  formats.broken = "one byte of an attribute is wrong";
  formats.render = renderVertexFormats;
  formats.supported = [](const Device& device) {
    for (const VertexFormat& entry : kVertexFormats) {
      VkFormatProperties properties{};
      vkGetPhysicalDeviceFormatProperties(device.physical, entry.format, &properties);
      if (!(properties.bufferFeatures & VK_FORMAT_FEATURE_VERTEX_BUFFER_BIT)) return false;
    }
    return true;
  };
  scenes.push_back(formats);
}

}  // namespace pumice::cts
