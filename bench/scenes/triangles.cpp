// Scenes of many triangles, and of many draws.
#include <cmath>

#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

// Triangles of about `pixels` pixels, anywhere, at any depth, turned anyhow, unconnected.
std::vector<SmallVertex> scattered(const Options& options, uint64_t count, float pixels) {
  std::vector<SmallVertex> vertices;
  vertices.reserve(count * 3);
  Random random(11);
  const float radius = std::sqrt(pixels / 1.299f);  // an equilateral triangle's area is 1.299 r^2
  for (uint64_t i = 0; i < count; ++i) {
    float x = random.unit() * float(options.width), y = random.unit() * float(options.height);
    float z = random.unit(), angle = random.unit() * 6.2831853f;
    for (int corner = 0; corner < 3; ++corner) {
      float turned = angle + float(corner) * 2.0943951f;
      vertices.push_back({(x + radius * std::cos(turned)) / float(options.width) * 2 - 1,
                          (y + radius * std::sin(turned)) / float(options.height) * 2 - 1, z,
                          random.word() | 0xff000000u});
    }
  }
  return vertices;
}

template <uint64_t usual, int pixels, VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT>
struct Triangles : DrawScene {
  Pipeline shaded;
  Buffer vertices;
  uint64_t count, repeats = 1;
  Triangles(Device& device, const Options& options)
      : DrawScene(device, options, VK_FORMAT_D32_SFLOAT, samples), count(options.amount ? options.amount : usual) {
    PipelineSpec spec;
    useSmallVertices(spec);
    spec.depthTest = spec.depthWrite = true;
    shaded = pipeline(spec);
    // More than 4 million are drawn from the same buffer again and again, so that the client's memory stays small.
    while (count / repeats > 4'000'000) repeats *= 2;
    count = count / repeats * repeats;
    vertices = canvas.bufferOf(scattered(options, count / repeats, float(pixels)), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    for (uint64_t i = 0; i < repeats; ++i) vkCmdDraw(commands, uint32_t(count / repeats * 3), 1, 0, 0);
  }
};

// Many draws of few pixels, each with its own part of a uniform buffer.
struct SmallDraws : DrawScene {
  struct Uniform {
    glm::vec4 place;  // centre and half size
    glm::vec4 colour;
    char unused[256 - 32];  // the largest minUniformBufferOffsetAlignment there is
  };
  Pipeline shaded;
  Buffer uniforms;
  cts::DescriptorSet set;
  uint32_t count, turn = 0;
  SmallDraws(Device& device, const Options& options)
      : DrawScene(device, options, VK_FORMAT_D32_SFLOAT), count(options.amount ? uint32_t(options.amount) : 10'000) {
    uniforms = canvas.buffer(count * sizeof(Uniform), VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT);
    cts::Binding binding = bufferBinding(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC, uniforms);
    binding.buffer.range = sizeof(Uniform);
    set = canvas.descriptors({binding});
    PipelineSpec spec;
    spec.depthTest = spec.depthWrite = true;
    spec.sets = {set.layout};
    spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};
    spec.adjust = nullptr;
    spec.vertex = R"(#version 450
layout(set = 0, binding = 0) uniform Uniform { vec4 place; vec4 colour; };
void main() {
  vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 2.0 - 1.0;
  gl_Position = vec4(place.xy + corner * place.w, place.z, 1.0);
}
)";
    spec.fragment = R"(#version 450
layout(set = 0, binding = 0) uniform Uniform { vec4 place; vec4 colour; };
layout(location = 0) out vec4 result;
void main() { result = colour; }
)";
    spec.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP;
    shaded = pipeline(spec);
    unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    auto* all = reinterpret_cast<Uniform*>(uniforms.mapped);
    Random random(3);
    for (uint32_t i = 0; i < count; ++i) {  // the application's share: every uniform is new in every frame
      all[i].place = {random.in(-1, 1), random.in(-1, 1), random.unit(), 0.008f};
      all[i].colour = {random.unit(), random.unit(), random.unit(), 1};
    }
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
    for (uint32_t i = 0; i < count; ++i) {
      uint32_t begin = i * uint32_t(sizeof(Uniform));
      vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.layout, 0, 1, &set.handle, 1, &begin);
      vkCmdDraw(commands, 4, 1, 0, 0);
    }
  }
  Buffer unused;
};

}  // namespace

void addTriangleScenes(SceneTable& table) {
  table.push_back({"triangles_million", "1,000,000 triangles of 2 pixels", makeScene<Triangles<1'000'000, 2>>});
  table.push_back({"triangles_100k", "100,000 triangles of 55 pixels", makeScene<Triangles<100'000, 55>>});
  table.push_back({"triangles_100k_msaa4", "the same at 4 samples", makeScene<Triangles<100'000, 55, VK_SAMPLE_COUNT_4_BIT>>});
  table.push_back({"triangles_large_msaa4", "2,000 triangles of 5,000 pixels at 4 samples", makeScene<Triangles<2'000, 5'000, VK_SAMPLE_COUNT_4_BIT>>});
  table.push_back({"small_draws_10000", "10,000 draws, each with its own uniforms", makeScene<SmallDraws>});
}

}  // namespace pumice::bench
