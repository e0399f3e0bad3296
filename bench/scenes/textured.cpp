// Scenes of texture sampling.
#include <glm/gtc/matrix_transform.hpp>

#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

enum class Sampling { kNearest, kBilinear };

// A quad over the screen, two texels to three pixels, turned a little.
template <Sampling sampling>
struct Quad : DrawScene {
  Pipeline shaded;
  cts::DescriptorSet set;
  Quad(Device& device, const Options& options) : DrawScene(device, options) {
    SamplerSpec sampler;
    sampler.filter = sampling == Sampling::kNearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    sampler.mipmaps = VK_SAMPLER_MIPMAP_MODE_NEAREST;
    Image texture = mippedTexture(canvas, 1024, patternTexel, false);
    set = canvas.descriptors({sampledImage(canvas.view(texture), makeSampler(canvas, sampler))});
    PipelineSpec spec;
    spec.vertex = kFullScreenVertex;
    spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};
    spec.sets = {set.layout};
    spec.fragment = R"(#version 450
layout(set = 0, binding = 0) uniform sampler2D image;
layout(location = 0) in vec2 place;
layout(location = 0) out vec4 colour;
void main() { colour = texture(image, mat2(0.8, 0.1, -0.06, 0.47) * place); }
)";
    shaded = pipeline(spec);
    unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdDraw(commands, 3, 1, 0, 0);
  }
  Buffer unused;
};

// A plane to the horizon.
template <int anisotropy>
struct Ground : DrawScene {
  Pipeline shaded;
  cts::DescriptorSet set;
  Buffer vertices;
  Ground(Device& device, const Options& options) : DrawScene(device, options) {
    SamplerSpec sampler;
    sampler.anisotropy = float(anisotropy);
    Image texture = mippedTexture(canvas, 1024, patternTexel);
    set = canvas.descriptors({sampledImage(canvas.view(texture), makeSampler(canvas, sampler))});
    PipelineSpec spec;
    spec.sets = {set.layout};
    spec.fragment = R"(#version 450
layout(set = 0, binding = 0) uniform sampler2D image;
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { colour = texture(image, passed.xy); }
)";
    shaded = pipeline(spec);
    glm::mat4 projection = glm::perspective(glm::radians(60.0f), float(options.width) / float(options.height), 0.1f, 200.0f);
    projection[1][1] = -projection[1][1];
    glm::mat4 view = glm::lookAt(glm::vec3(0, 1.5f, 0), glm::vec3(0.4f, 0.6f, -3), glm::vec3(0, 1, 0));
    std::vector<cts::Vertex> corners;
    for (auto [x, z] : {std::pair{-1, 1}, {1, 1}, {-1, -1}, {-1, -1}, {1, 1}, {1, -1}}) {
      glm::vec4 at(float(x) * 150, 0, float(z) * 150, 1);
      corners.push_back({projection * view * at, {at.x * 0.4f, at.z * 0.4f, 0, 0}});
    }
    vertices = canvas.bufferOf(corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdDraw(commands, 6, 1, 0, 0);
  }
};

}  // namespace

void addTexturedScenes(SceneTable& table) {
  table.push_back({"textured_nearest", "a textured quad, nearest", makeScene<Quad<Sampling::kNearest>>});
  table.push_back({"textured_bilinear", "a textured quad, bilinear", makeScene<Quad<Sampling::kBilinear>>});
  table.push_back({"ground_trilinear", "a ground plane, trilinear", makeScene<Ground<0>>});
  table.push_back({"ground_anisotropic", "a ground plane, 16x anisotropic", makeScene<Ground<16>>});
}

}  // namespace pumice::bench
