// Textured scenes: a cube with nearest and with bilinear filtering, address modes, formats.
#include "cts_subset/harness/scene.h"

#include <glm/gtc/matrix_transform.hpp>

#include <cmath>

namespace pumice::cts {

void addFilteringScenes(SceneList& scenes);  // filtering.cpp

namespace {

constexpr uint32_t kSize = 256;

const char* const kTextureFragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
layout(set = 0, binding = 0) uniform sampler2D image;
void main() { colour = texture(image, passed.xy); }
)";

// Bold squares for nearest filtering.
std::vector<uint8_t> boldTexture(uint32_t side) {
  std::vector<uint8_t> rgba;
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      bool ring = std::abs(std::hypot(x - side * 0.5, y - side * 0.5) - side * 0.3) < side * 0.06;
      uint8_t base = (x / 2 + y / 2) % 2 ? 230 : 40;
      rgba.insert(rgba.end(), {uint8_t(ring ? 255 : base), uint8_t(ring ? 120 : 255 - x * 3),
                               uint8_t(ring ? 20 : y * 3 + 30), 255});
    }
  return rgba;
}

// Gentle steps for bilinear filtering: the weights may be rounded to 8 bits, which must stay
// within one unit.
std::vector<uint8_t> gentleTexture(uint32_t side) {
  std::vector<uint8_t> rgba;
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x)
      rgba.insert(rgba.end(), {uint8_t(128 + 90 * std::sin(x * 0.7)), uint8_t(128 + 90 * std::cos(y * 0.6)),
                               uint8_t(128 + 60 * std::sin((x + y) * 0.5)), 255});
  return rgba;
}

std::vector<Vertex> cube(float zoom) {
  glm::mat4 projection = glm::perspective(glm::radians(50.0f), 1.0f, 0.5f, 20.0f);
  projection[1][1] = -projection[1][1];
  glm::mat4 view = glm::lookAt(glm::vec3(2.1f, 1.7f, 2.9f) * zoom, glm::vec3(0), glm::vec3(0, 1, 0));
  glm::mat4 matrix = projection * view;
  std::vector<Vertex> out;
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) {
      auto corner = [&](float u, float v) {
        glm::vec3 p;
        p[axis] = side;
        p[(axis + 1) % 3] = u * side;  // counter-clockwise seen from outside
        p[(axis + 2) % 3] = v;
        return Vertex{matrix * glm::vec4(p, 1), {(u + 1) / 2, (v + 1) / 2, 0, 0}};
      };
      Vertex a = corner(-1, -1), b = corner(1, -1), c = corner(1, 1), d = corner(-1, 1);
      for (const Vertex& v : {a, b, c, a, c, d}) out.push_back(v);
    }
  return out;
}

struct CubeStyle {
  VkFilter filter;
  bool depth;  // depth test instead of culling
};

Picture renderCube(Device& device, Variant variant, CubeStyle style) {
  constexpr uint32_t kSide = 32;
  Canvas canvas(device, kSize, kSize, style.depth ? VK_FORMAT_D32_SFLOAT : VK_FORMAT_UNDEFINED);
  Image image = canvas.texture(kSide, kSide,
                               style.filter == VK_FILTER_NEAREST ? boldTexture(kSide) : gentleTexture(kSide));
  Binding binding{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  binding.image = {canvas.sampler(style.filter, VK_SAMPLER_ADDRESS_MODE_REPEAT), canvas.view(image),
                   VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  DescriptorSet set = canvas.descriptors({binding});
  PipelineSpec spec;
  spec.fragment = kTextureFragment;
  spec.sets = {set.layout};
  spec.depthTest = spec.depthWrite = style.depth;
  if (!style.depth) spec.cull = VK_CULL_MODE_BACK_BIT;
  Pipeline pipeline = canvas.pipeline(spec);
  auto vertices = cube(1);
  if (variant == Variant::kBroken)  // a texel centre half a texel off
    for (Vertex& v : vertices) v.attribute += 0.5f / kSide;
  return canvas.draw({0.2f, 0.2f, 0.25f, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0,
                            nullptr);
    canvas.drawVertices(commands, pipeline, vertices);
  });
}

// One quad per address mode, coordinates from -1.25 to 2.25, on the sub-pixel grid.
Picture renderAddressModes(Device& device, Variant variant, VkFilter filter) {
  constexpr uint32_t kSide = 8;
  Canvas canvas(device, kSize, kSize);
  Image image =
      canvas.texture(kSide, kSide, filter == VK_FILTER_NEAREST ? boldTexture(kSide) : gentleTexture(kSide));
  VkImageView view = canvas.view(image);
  const VkSamplerAddressMode kModes[] = {
      VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT,
      VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER};
  std::vector<DescriptorSet> sets;
  for (VkSamplerAddressMode mode : kModes) {
    Binding binding{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
    binding.image = {canvas.sampler(filter, mode), view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
    sets.push_back(canvas.descriptors({binding}));
  }
  PipelineSpec spec;
  spec.fragment = kTextureFragment;
  spec.sets = {sets[0].layout};
  Pipeline pipeline = canvas.pipeline(spec);
  if (variant == Variant::kBroken) std::swap(sets[0], sets[1]);
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    for (int i = 0; i < 4; ++i) {
      double x = i % 2 * 128 + 2, y = i / 2 * 128 + 2;
      // 124 px show 3.5 repetitions; no texel border falls on a pixel centre.
      auto corner = [&](double u, double v) {
        return Vertex{atPixel(canvas.size(), x + u * 124, y + v * 124),
                      {-1.251f + 3.5f * float(u), -1.251f + 3.5f * float(v), 0, 0}};
      };
      Vertex a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
      vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1,
                              &sets[i].handle, 0, nullptr);
      canvas.drawVertices(commands, pipeline, {a, b, c, a, c, d});
    }
  });
}

// A texture drawn texel for pixel: every texel exactly as it was put there.
Picture renderTexelExact(Device& device, Variant variant, VkFormat format) {
  constexpr uint32_t kSide = 64;
  Canvas canvas(device, kSide, kSide);
  std::vector<uint8_t> texels;
  for (uint32_t i = 0; i < kSide * kSide * 4; ++i) texels.push_back(uint8_t(i * 37 + i / 256));
  if (variant == Variant::kBroken) texels[4 * (kSide * 20 + 11)] ^= 4;
  Image image = canvas.texture(kSide, kSide, texels, format);
  Binding binding{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  binding.image = {canvas.sampler(VK_FILTER_NEAREST, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE),
                   canvas.view(image), VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  DescriptorSet set = canvas.descriptors({binding});
  PipelineSpec spec;
  spec.fragment = kTextureFragment;
  spec.sets = {set.layout};
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<Vertex> vertices = {
      {{-1, -1, 0, 1}, {0, 0, 0, 0}}, {{3, -1, 0, 1}, {2, 0, 0, 0}}, {{-1, 3, 0, 1}, {0, 2, 0, 0}}};
  return canvas.draw({0, 0, 0, 0}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0,
                            nullptr);
    canvas.drawVertices(commands, pipeline, vertices);
  });
}

Expectation cubeExpectation(bool nearest) {
  Expectation e;
  e.onGrid = false;
  std::vector<glm::vec4> positions;
  for (const Vertex& v : cube(1)) positions.push_back(v.position);
  e.edges = edgesOfTriangles(positions, {0, 0, kSize, kSize});
  e.stepFunctions = nearest;
  return e;
}

bool sampled(const Device& device, VkFormat format, bool linear) {
  VkFormatFeatureFlags wanted = VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT | VK_FORMAT_FEATURE_TRANSFER_DST_BIT;
  if (linear) wanted |= VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT;
  // A Vulkan 1.0 device need not report the transfer bits.
  if (device.properties.apiVersion < VK_API_VERSION_1_1)
    wanted &= ~VkFormatFeatureFlags(VK_FORMAT_FEATURE_TRANSFER_DST_BIT);
  return device.supports(format, wanted);
}

}  // namespace

void addTextureScenes(SceneList& scenes) {
  for (bool nearest : {true, false})
    for (bool depth : {false, true}) {
      CubeStyle style{nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR, depth};
      Scene scene;
      scene.name = std::string("cube_") + (nearest ? "nearest" : "bilinear") + (depth ? "_depth" : "");
      scene.broken = "texture coordinates half a texel off";
      scene.render = [style](Device& device, Variant variant) { return renderCube(device, variant, style); };
      scene.expectation = [nearest] { return cubeExpectation(nearest); };
      scene.supported = [nearest, depth](const Device& device) {
        return sampled(device, VK_FORMAT_R8G8B8A8_UNORM, !nearest) &&
               (!depth ||
                device.supports(VK_FORMAT_D32_SFLOAT, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT));
      };
      scenes.push_back(scene);
    }
  for (bool nearest : {true, false}) {
    Scene modes;
    modes.name = std::string("address_modes_") + (nearest ? "nearest" : "bilinear");
    modes.broken = "REPEAT and MIRRORED_REPEAT exchanged";
    VkFilter filter = nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    modes.render = [filter](Device& device, Variant variant) {
      return renderAddressModes(device, variant, filter);
    };
    modes.supported = [nearest](const Device& device) {
      return sampled(device, VK_FORMAT_R8G8B8A8_UNORM, !nearest);
    };
    scenes.push_back(modes);
  }
  const struct {
    VkFormat format;
    const char* name;
  } kExact[] = {{VK_FORMAT_R8G8B8A8_UNORM, "rgba8"},
                {VK_FORMAT_B8G8R8A8_UNORM, "bgra8"},
                {VK_FORMAT_R8G8B8A8_SRGB, "rgba8_srgb"}};
  for (const auto& entry : kExact) {
    Scene exact;
    exact.name = std::string("texels_") + entry.name;
    exact.broken = "one bit of one texel";
    exact.oracle.share = 0;
    exact.render = [format = entry.format](Device& device, Variant variant) {
      return renderTexelExact(device, variant, format);
    };
    exact.supported = [format = entry.format](const Device& device) {
      return sampled(device, format, false);
    };
    scenes.push_back(exact);
  }
  addFilteringScenes(scenes);
}

}  // namespace pumice::cts
