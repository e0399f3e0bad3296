// Scenes of lit meshes: a PBR-like material, and a shadow map.
#include <glm/gtc/matrix_transform.hpp>

#include <cmath>

#include "bench/scenes/passes.h"
#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

struct MeshVertex {
  glm::vec3 position, normal, tangent;
  glm::vec2 uv;
};

void useMeshVertices(PipelineSpec& spec) {
  spec.bindings = {{0, sizeof(MeshVertex), VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32G32B32_SFLOAT, offsetof(MeshVertex, position)},
                     {1, 0, VK_FORMAT_R32G32B32_SFLOAT, offsetof(MeshVertex, normal)},
                     {2, 0, VK_FORMAT_R32G32B32_SFLOAT, offsetof(MeshVertex, tangent)},
                     {3, 0, VK_FORMAT_R32G32_SFLOAT, offsetof(MeshVertex, uv)}};
}

struct Mesh {
  std::vector<MeshVertex> vertices;
  std::vector<uint32_t> indices;

  // 2 * rings * segments triangles.
  void addSphere(glm::vec3 centre, float radius, uint32_t rings, uint32_t segments) {
    auto first = uint32_t(vertices.size());
    for (uint32_t j = 0; j <= rings; ++j)
      for (uint32_t i = 0; i <= segments; ++i) {
        float u = float(i) / float(segments), v = float(j) / float(rings), a = u * 6.2831853f, b = v * 3.1415927f;
        glm::vec3 n(std::sin(b) * std::cos(a), std::cos(b), std::sin(b) * std::sin(a));
        vertices.push_back({centre + n * radius, n, {-std::sin(a), 0, std::cos(a)}, {u * 4, v * 2}});
      }
    for (uint32_t j = 0; j < rings; ++j)
      for (uint32_t i = 0; i < segments; ++i) {
        uint32_t a = first + j * (segments + 1) + i, b = a + 1, c = a + segments + 1, d = c + 1;
        indices.insert(indices.end(), {a, b, c, b, d, c});
      }
  }
  void addGround(float y, float half) {
    auto first = uint32_t(vertices.size());
    for (auto [x, z] : {std::pair{-1.0f, -1.0f}, {1, -1}, {-1, 1}, {1, 1}})
      vertices.push_back({{x * half, y, z * half}, {0, 1, 0}, {1, 0, 0}, {x * 4, z * 4}});
    indices.insert(indices.end(), {first, first + 2, first + 1, first + 1, first + 2, first + 3});
  }
};

// Vulkan's clip space: y downwards.
glm::mat4 camera(const Options& options, glm::vec3 eye, glm::vec3 at) {
  glm::mat4 projection = glm::perspective(glm::radians(45.0f), float(options.width) / float(options.height), 0.1f, 50.0f);
  projection[1][1] = -projection[1][1];
  return projection * glm::lookAt(eye, at, glm::vec3(0, 1, 0));
}

// Spheres with albedo, normal map, roughness and metalness, occlusion; three lights, GGX.
struct Pbr : DrawScene {
  struct Uniform {
    glm::mat4 transform;
    glm::vec4 eye;
    glm::vec4 lights[3];
  };
  Pipeline shaded;
  cts::DescriptorSet set;
  Buffer uniform, vertices, indices;
  uint32_t count;
  Pbr(Device& device, const Options& options) : DrawScene(device, options, VK_FORMAT_D32_SFLOAT) {
    Mesh mesh;
    for (float x : {-1.15f, 1.15f})
      for (float y : {-0.55f, 0.55f}) mesh.addSphere({x, y * 1.3f, 0}, 1.05f, 87, 87);
    count = uint32_t(mesh.indices.size());
    vertices = canvas.bufferOf(mesh.vertices, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    indices = canvas.bufferOf(mesh.indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    Uniform values{camera(options, {0, 0.3f, 3.6f}, {0, 0, 0}), {0, 0.3f, 3.6f, 1}, {{2, 3, 3, 9}, {-3, 1, 2, 6}, {0, -2, 3, 5}}};
    uniform = canvas.buffer(sizeof values, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, &values);
    VkSampler sampler = makeSampler(canvas, {});
    auto texture = [&](uint32_t size, const std::function<uint32_t(uint32_t, uint32_t)>& texel) {
      return sampledImage(canvas.view(mippedTexture(canvas, size, texel)), sampler);
    };
    set = canvas.descriptors(
        {bufferBinding(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, uniform), texture(1024, patternTexel),
         texture(1024,
                 [](uint32_t x, uint32_t y) {
                   auto bump = [](uint32_t v) { return uint32_t(127.5f + 40.0f * std::sin(float(v) * 0.15f)); };
                   return bump(x) | bump(y) << 8 | 240u << 16 | 0xff000000u;
                 }),
         texture(512, [](uint32_t x, uint32_t y) { return (60 + (x * 7 & 127)) << 8 | ((y >> 6 & 1) * 200) << 16 | 0xff000000u; }),
         texture(512, [](uint32_t x, uint32_t y) { return (180 + ((x ^ y) & 63)) | 0xff000000u; })});
    PipelineSpec spec;
    useMeshVertices(spec);
    spec.depthTest = spec.depthWrite = true;
    spec.sets = {set.layout};
    const std::string uniforms = R"(
layout(set = 0, binding = 0) uniform Uniform { mat4 transform; vec4 eye; vec4 lights[3]; };
)";
    spec.vertex = "#version 450\n" + uniforms + R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tangent;
layout(location = 3) in vec2 uv;
layout(location = 0) out vec3 outPosition;
layout(location = 1) out vec3 outNormal;
layout(location = 2) out vec3 outTangent;
layout(location = 3) out vec2 outUv;
void main() {
  gl_Position = transform * vec4(position, 1.0);
  outPosition = position; outNormal = normal; outTangent = tangent; outUv = uv;
}
)";
    spec.fragment = "#version 450\n" + uniforms + R"(
layout(set = 0, binding = 1) uniform sampler2D albedoMap;
layout(set = 0, binding = 2) uniform sampler2D normalMap;
layout(set = 0, binding = 3) uniform sampler2D surfaceMap;
layout(set = 0, binding = 4) uniform sampler2D occlusionMap;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tangent;
layout(location = 3) in vec2 uv;
layout(location = 0) out vec4 colour;
void main() {
  vec3 albedo = pow(texture(albedoMap, uv).rgb, vec3(2.2));
  vec3 bump = texture(normalMap, uv).xyz * 2.0 - 1.0;
  vec3 surface = texture(surfaceMap, uv).rgb;
  float occlusion = texture(occlusionMap, uv).r;
  float roughness = max(surface.g, 0.05), metal = surface.b;
  vec3 n = normalize(normal), t = normalize(tangent - n * dot(n, tangent)), b = cross(n, t);
  n = normalize(mat3(t, b, n) * bump);
  vec3 v = normalize(eye.xyz - position);
  vec3 f0 = mix(vec3(0.04), albedo, metal);
  float a = roughness * roughness, a2 = a * a, k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
  float nv = max(dot(n, v), 0.0);
  vec3 sum = vec3(0.03) * albedo * occlusion;
  for (int i = 0; i < 3; ++i) {
    vec3 towards = lights[i].xyz - position;
    float distance2 = dot(towards, towards);
    vec3 l = towards * inversesqrt(distance2), h = normalize(v + l);
    float nl = max(dot(n, l), 0.0), nh = max(dot(n, h), 0.0), vh = max(dot(v, h), 0.0);
    float d = nh * nh * (a2 - 1.0) + 1.0;
    float distribution = a2 / (3.14159265 * d * d);
    float geometry = nl / (nl * (1.0 - k) + k) * nv / (nv * (1.0 - k) + k);
    vec3 fresnel = f0 + (1.0 - f0) * pow(1.0 - vh, 5.0);
    vec3 specular = distribution * geometry * fresnel / max(4.0 * nv * nl, 0.001);
    vec3 diffuse = (1.0 - fresnel) * (1.0 - metal) * albedo / 3.14159265;
    sum += (diffuse + specular) * nl * lights[i].w / distance2;
  }
  sum = sum / (sum + 1.0);
  colour = vec4(pow(sum, vec3(1.0 / 2.2)), 1.0);
}
)";
    shaded = pipeline(spec);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    vkCmdBindIndexBuffer(commands, indices.handle, 0, VK_INDEX_TYPE_UINT32);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdDrawIndexed(commands, count, 1, 0, 0, 0);
  }
};

// Spheres over a ground: depth from the light into 2048 x 2048, then lit with nine compared taps.
struct Shadow : DrawScene {
  static constexpr uint32_t kMapSide = 2048;
  Pipeline casting, lit;
  Target map;
  cts::DescriptorSet set;
  Buffer uniform, vertices, indices;
  uint32_t count;
  Shadow(Device& device, const Options& options)
      : DrawScene(device, options, VK_FORMAT_D32_SFLOAT), map(makeTarget(canvas, kMapSide, kMapSide, VK_FORMAT_D32_SFLOAT)) {
    Mesh mesh;
    for (int x = -2; x <= 2; ++x)
      for (int z = -2; z <= 2; ++z) mesh.addSphere({float(x) * 1.2f, 0.45f, float(z) * 1.2f}, 0.45f, 24, 32);
    mesh.addGround(0, 6);
    count = uint32_t(mesh.indices.size());
    vertices = canvas.bufferOf(mesh.vertices, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    indices = canvas.bufferOf(mesh.indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    glm::mat4 light = glm::ortho(-5.0f, 5.0f, -5.0f, 5.0f, 0.1f, 20.0f) *
                      glm::lookAt(glm::vec3(4, 8, 3), glm::vec3(0), glm::vec3(0, 1, 0));
    glm::mat4 matrices[2] = {camera(options, {0, 4.5f, 6}, {0, 0, 0}), light};
    uniform = canvas.buffer(sizeof matrices, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, matrices);
    SamplerSpec sampler;
    sampler.compare = true;
    sampler.address = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
    set = canvas.descriptors({bufferBinding(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, uniform),
                              sampledImage(map.view, makeSampler(canvas, sampler))});
    const std::string head = "#version 450\nlayout(set = 0, binding = 0) uniform Uniform { mat4 eye; mat4 light; };\n";
    PipelineSpec spec;
    useMeshVertices(spec);
    spec.depthTest = spec.depthWrite = true;
    spec.compare = VK_COMPARE_OP_LESS_OR_EQUAL;
    spec.sets = {set.layout};
    PipelineSpec caster = spec;
    caster.depthBias = {16.0f, 4.0f};
    caster.vertex = head + R"(
layout(location = 0) in vec3 position;
void main() { gl_Position = light * vec4(position, 1.0); }
)";
    caster.fragment = "#version 450\nvoid main() {}\n";
    caster.adjust = [this](cts::PipelineStates& states) {
      states.renderPass = map.pass;
      states.blend.attachmentCount = 0;
    };
    casting = pipeline(caster);
    spec.vertex = head + R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 0) out vec3 outNormal;
layout(location = 1) out vec3 place;
void main() {
  gl_Position = eye * vec4(position, 1.0);
  vec4 seen = light * vec4(position, 1.0);
  place = vec3(seen.xy * 0.5 + 0.5, seen.z);
  outNormal = normal;
}
)";
    spec.fragment = R"(#version 450
layout(set = 0, binding = 1) uniform sampler2DShadow map;
layout(location = 0) in vec3 normal;
layout(location = 1) in vec3 place;
layout(location = 0) out vec4 colour;
void main() {
  float open = 0.0;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) open += texture(map, vec3(place.xy + vec2(x, y) / 2048.0, place.z));
  float diffuse = max(dot(normalize(normal), normalize(vec3(4, 8, 3))), 0.0) * open / 9.0;
  colour = vec4(vec3(0.15, 0.17, 0.2) + vec3(0.8, 0.75, 0.6) * diffuse, 1.0);
}
)";
    lit = pipeline(spec);
  }
  void drawMesh(VkCommandBuffer commands, const Pipeline& pipeline) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    vkCmdBindIndexBuffer(commands, indices.handle, 0, VK_INDEX_TYPE_UINT32);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdDrawIndexed(commands, count, 1, 0, 0, 0);
  }
  void before(VkCommandBuffer commands) override {
    beginPass(commands, map.pass, map.framebuffer, kMapSide, kMapSide, {clearDepth(1)});
    drawMesh(commands, casting);
    vkCmdEndRenderPass(commands);
  }
  void draw(VkCommandBuffer commands) override { drawMesh(commands, lit); }
};

}  // namespace

void addLightingScenes(SceneTable& table) {
  table.push_back({"pbr", "60,552 triangles, four mapped textures, three lights, GGX", makeScene<Pbr>});
  table.push_back({"shadow", "a 2048 x 2048 shadow map, then nine compared taps", makeScene<Shadow>});
}

}  // namespace pumice::bench
