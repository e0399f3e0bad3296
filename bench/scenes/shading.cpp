// Scenes of long shaders, and of many of them.
#include "bench/scenes/limits.h"
#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

// Iterated complex polynomials: multiplications and additions only, so that limits.cpp can do the same by hand.
struct Alu : DrawScene {
  Pipeline shaded;
  Alu(Device& device, const Options& options) : DrawScene(device, options) {
    PipelineSpec spec;
    spec.vertex = kFullScreenVertex;
    spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};
    spec.fragment = R"(#version 450
layout(location = 0) in vec2 place;
layout(location = 0) out vec4 colour;
void main() {
  vec2 c = place * 0.9 - 0.45, z = c;
  vec2 w = vec2(0.1, 0.2);
  for (int i = 0; i < )" + std::to_string(kAluTurns) + R"(; ++i) {
    z = vec2(z.x * z.x - z.y * z.y, 2.0 * z.x * z.y) * 0.5 + c;
    w = w * z + c * 0.25;
  }
  colour = vec4(z * 0.5 + 0.5, w * 0.5 + 0.5);
}
)";
    shaded = pipeline(spec);
    unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
    vkCmdDraw(commands, 3, 1, 0, 0);
  }
  Work work() const override { return {0, double(canvas.size().x) * canvas.size().y * kAluTurns * kAluFlopsPerTurn}; }
  Buffer unused;
};

// Every pipeline has code of its own: another mixture of lights, noise and patterns.
struct Pipelines : DrawScene {
  uint32_t count;
  Buffer vertices;
  VkShaderModule vertex = VK_NULL_HANDLE;  // of all pipelines
  std::vector<std::string> fragments;
  PipelineSpec spec;
  Pipelines(Device& device, const Options& options)
      : DrawScene(device, options, VK_FORMAT_D32_SFLOAT), count(options.amount ? uint32_t(options.amount) : 200) {
    spec.depthTest = spec.depthWrite = true;
    spec.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT, 0, 64}};
    spec.vertex = R"(#version 450
layout(push_constant) uniform Push { mat4 transform; };
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
layout(location = 1) out vec3 normal;
void main() {
  gl_Position = transform * position;
  passed = given;
  normal = mat3(transform) * vec3(given.xy, 1.0 - given.x);
}
)";
    for (uint32_t i = 0; i < count; ++i) {
      auto number = [&](uint32_t salt) {
        return "0." + std::to_string(100 + (i * 2654435761u + salt * 40503u) % 899);
      };
      std::string lights;
      for (uint32_t light = 0; light < 1 + i % 4; ++light) {
        lights += "  { vec3 l = normalize(vec3(" + number(light) + ", " + number(light + 9) + ", " + number(light + 17) +
                  ") - vec3(passed.xy, 0.0));\n    float d = max(dot(n, l), 0.0);\n    vec3 h = normalize(l + vec3(0, 0, 1));\n"
                  "    sum += vec3(" + number(light + 3) + ", 0.5, " + number(light + 5) +
                  ") * d + vec3(pow(max(dot(n, h), 0.0), " + std::to_string(8 + (i + light) % 50) + ".0)); }\n";
      }
      const char* patterns[] = {
          "  sum *= 0.7 + 0.3 * sin(passed.x * 40.0) * cos(passed.y * 30.0);\n",
          "  float v = fract(sin(dot(floor(passed.xy * 16.0), vec2(12.9898, 78.233))) * 43758.5453);\n  sum = mix(sum, vec3(v), 0.3);\n",
          "  for (int i = 0; i < 4; ++i) sum += exp2(-float(i) - length(passed.xy - vec2(0.2 * float(i), 0.5))) * 0.1;\n",
          "  if (fract(passed.x * 8.0) < 0.5) sum = sqrt(sum); else sum = sum * sum + vec3(0.1, 0.0, 0.05);\n",
          "  sum = clamp(sum * (2.51 * sum + 0.03) / (sum * (2.43 * sum + 0.59) + 0.14), 0.0, 1.0);\n"};
      fragments.push_back(
          "#version 450\nlayout(location = 0) in vec4 passed;\nlayout(location = 1) in vec3 normal;\n"
          "layout(location = 0) out vec4 colour;\nvoid main() {\n  vec3 n = normalize(normal), sum = vec3(" +
          number(31) + ");\n" + lights + patterns[i % 5] + patterns[(i / 5 + i + 1) % 5 == i % 5 ? (i + 2) % 5 : (i / 5 + i + 1) % 5] +
          "  colour = vec4(sum, 1.0);\n}\n");
    }
    vertex = cachedShader(canvas, VK_SHADER_STAGE_VERTEX_BIT, spec.vertex);
    // Compiled before anything is measured.
    for (const std::string& text : fragments) cachedSpirv(VK_SHADER_STAGE_FRAGMENT_BIT, text);
    std::vector<cts::Vertex> corners{{{-1, -1, 0.5f, 1}, {0, 0, 0, 0}}, {{1, -1, 0.5f, 1}, {1, 0, 0, 0}},
                                     {{-1, 1, 0.5f, 1}, {0, 1, 0, 0}},  {{1, 1, 0.5f, 1}, {1, 1, 0, 0}}};
    vertices = canvas.bufferOf(corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    spec.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP;
  }
  void draw(VkCommandBuffer commands) override {
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    for (uint32_t i = 0; i < count; ++i) {
      Pipeline made;
      cts::check(canvas.tryPipeline(spec, vertex, cachedShader(canvas, VK_SHADER_STAGE_FRAGMENT_BIT, fragments[i]), made),
                 "vkCreateGraphicsPipelines");
      float size = 0.06f, x = -0.95f + 0.1f * float(i % 20), y = -0.9f + 0.18f * float(i / 20 % 10);
      const float transform[16] = {size, 0, 0, 0, 0, size, 0, 0, 0, 0, 1, 0, x, y, 0, 1};
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, made.handle);
      vkCmdPushConstants(commands, made.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof transform, transform);
      vkCmdDraw(commands, 4, 1, 0, 0);
    }
  }
};

// The same in a second run of the program: it begins with what the first has left in its pipeline cache.
struct KnownPipelines : Pipelines {
  KnownPipelines(Device& device, const Options& options) : Pipelines(device, options) {
    VkPipelineCache first = device.pipelineCache = makeCache({});
    // Nothing of that run is left but its cache.
    std::make_unique<Pipelines>(device, options)->frame();
    size_t size = 0;
    cts::check(vkGetPipelineCacheData(device.handle, first, &size, nullptr), "vkGetPipelineCacheData");
    std::vector<std::byte> kept(size);
    cts::check(vkGetPipelineCacheData(device.handle, first, &size, kept.data()), "vkGetPipelineCacheData");
    known = std::move(kept);
  }
  void draw(VkCommandBuffer commands) override {
    if (!known.empty()) device.pipelineCache = makeCache(known);   // part of what is measured
    Pipelines::draw(commands);
  }
  VkPipelineCache makeCache(const std::vector<std::byte>& bytes) {
    VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO, nullptr, 0, bytes.size(), bytes.data()};
    VkPipelineCache cache = VK_NULL_HANDLE;
    cts::check(vkCreatePipelineCache(device.handle, &info, nullptr, &cache), "vkCreatePipelineCache");
    canvas.onDestroy([v = device.handle, cache] { vkDestroyPipelineCache(v, cache, nullptr); });
    return cache;
  }
  std::vector<std::byte> known;
};

}  // namespace

void addShadingScenes(SceneTable& table) {
  table.push_back({"alu", "a fragment shader of 4,000 operations", makeScene<Alu>, Limit::kArithmetic});
  table.push_back({"pipelines_200", "200 pipelines made and drawn once", makeScene<Pipelines>, Limit::kNone, false, true});
  table.push_back({"pipelines_200_known", "the same with the pipeline cache of a run before", makeScene<KnownPipelines>, Limit::kNone, false, true});
}

}  // namespace pumice::bench
