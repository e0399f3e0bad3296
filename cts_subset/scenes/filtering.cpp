// The look of filters: a ground plane to the horizon, an environment cube, block-compressed pictures, mip chains made by blits.
#include "cts_subset/harness/scene.h"

#include <glm/gtc/matrix_transform.hpp>

#include <algorithm>
#include <cmath>

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

// An image with a whole mip chain, each level blitted from the one above.
Image mippedTexture(Workspace& work, uint32_t side, const std::vector<uint8_t>& rgba, uint32_t layers = 1, bool cube = false) {
  ImageSpec spec;
  spec.extent = {side, side, 1};
  spec.layers = layers;
  spec.mips = uint32_t(std::log2(side)) + 1;
  spec.usage |= VK_IMAGE_USAGE_SAMPLED_BIT;
  if (cube) spec.flags = VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
  Image image = work.image(spec);
  Buffer pixels = work.bufferOf(rgba, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
  work.device.run([&](VkCommandBuffer commands) {
    transition(commands, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, layers};
    copy.imageExtent = spec.extent;
    vkCmdCopyBufferToImage(commands, pixels.handle, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &copy);
    for (uint32_t mip = 1; mip < spec.mips; ++mip) {
      fullBarrier(commands);
      VkImageBlit blit{};
      blit.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, mip - 1, 0, layers};
      blit.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, mip, 0, layers};
      blit.srcOffsets[1] = {int32_t(side >> (mip - 1)), int32_t(side >> (mip - 1)), 1};
      blit.dstOffsets[1] = {int32_t(side >> mip), int32_t(side >> mip), 1};
      vkCmdBlitImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_LINEAR);
    }
    transition(commands, image, VK_IMAGE_LAYOUT_GENERAL, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  });
  return image;
}

VkSampler samplerOf(Workspace& work, VkFilter filter, VkSamplerMipmapMode mode, float maxLod, float bias, float anisotropy) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = filter;
  info.mipmapMode = mode;
  info.maxLod = maxLod;
  info.mipLodBias = bias;
  info.anisotropyEnable = anisotropy > 1;
  info.maxAnisotropy = anisotropy;
  return work.make(info);
}

VkImageView viewAs(Workspace& work, const Image& image, VkImageViewType type) {
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  info.image = image.handle;
  info.viewType = type;
  info.format = image.spec.format;
  info.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
  return work.make(info);
}

Binding sampled(VkSampler sampler, VkImageView view) {
  Binding binding{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  binding.image = {sampler, view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  return binding;
}

// Tiles with a frame and a diagonal: fine detail that aliases, in mild colours.
std::vector<uint8_t> tiles(uint32_t side) {
  std::vector<uint8_t> rgba;
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      const uint32_t tile = side / 4, tx = x % tile, ty = y % tile;
      const bool dark = (x / tile + y / tile) % 2, frame = tx < 2 || ty < 2, diagonal = std::abs(int(tx) - int(ty)) < 2;
      glm::vec3 c = dark ? glm::vec3(96, 70, 60) : glm::vec3(196, 184, 150);
      if (diagonal) c = dark ? glm::vec3(130, 110, 60) : glm::vec3(150, 90, 70);
      if (frame) c = glm::vec3(50, 54, 66);
      rgba.insert(rgba.end(), {uint8_t(c.r), uint8_t(c.g), uint8_t(c.b), 255});
    }
  return rgba;
}

struct GroundStyle {
  const char* name;
  VkFilter filter;
  VkSamplerMipmapMode mode;
  bool mipmaps;
  float anisotropy;
};

std::vector<glm::vec4> groundCorners() {
  glm::mat4 matrix = glm::perspective(glm::radians(60.0f), 1.0f, 0.1f, 100.0f) * glm::lookAt(glm::vec3(0, 1, 0), glm::vec3(1.2f, 0.35f, -3), glm::vec3(0, -1, 0));
  std::vector<glm::vec4> out;
  for (glm::vec2 at : {glm::vec2(-60, 2), glm::vec2(60, 2), glm::vec2(60, -60), glm::vec2(-60, -60)}) out.push_back(matrix * glm::vec4(at.x, 0, at.y, 1));
  return out;
}
std::vector<Edge> groundEdges() {
  auto p = groundCorners();
  return edgesOfTriangles({p[0], p[1], p[2], p[0], p[2], p[3]}, {0, 0, kSize, kSize});
}

// A plane under a camera that looks a little down and to the side, so that footprints are long and slanted.
Picture renderGround(Device& device, Variant variant, const GroundStyle& style) {
  Canvas canvas(device, kSize, kSize);
  Image image = mippedTexture(canvas, 128, tiles(128));
  VkSampler sampler = samplerOf(canvas, style.filter, style.mode, style.mipmaps ? VK_LOD_CLAMP_NONE : 0,
                                variant == Variant::kBroken && style.mipmaps ? 2.0f : 0.0f, style.anisotropy);
  DescriptorSet set = canvas.descriptors({sampled(sampler, canvas.view(image))});
  PipelineSpec spec;
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
layout(set = 0, binding = 0) uniform sampler2D image;
void main() {
  colour = texture(image, passed.xy);
  colour.rgb = mix(colour.rgb, vec3(0.55, 0.65, 0.8), smoothstep(12.0, 40.0, passed.z));  // haze
}
)";
  spec.sets = {set.layout};
  Pipeline pipeline = canvas.pipeline(spec);
  const std::vector<glm::vec4> corners = groundCorners();
  auto corner = [&](float x, float z) {
    const glm::vec4 p = corners[z > 0 ? (x < 0 ? 0 : 1) : (x < 0 ? 3 : 2)];
    // The texture repeats 0.7 times a unit; broken without mip levels: half a texel off.
    float off = variant == Variant::kBroken && !style.mipmaps ? 0.5f / 128 : 0.0f;
    return Vertex{p, {x * 0.7f + off, z * 0.7f + off, p.w, 0}};
  };
  Vertex a = corner(-60, 2), b = corner(60, 2), c = corner(60, -60), d = corner(-60, -60);
  return canvas.draw({0.55f, 0.65f, 0.8f, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, pipeline, {a, b, c, a, c, d});
  });
}

// A sky over sea in the six faces of a cube, seen in a mirror ball.
Picture renderEnvironment(Device& device, Variant variant) {
  constexpr uint32_t kSide = 64;
  Canvas canvas(device, kSize, kSize);
  std::vector<uint8_t> faces;
  for (int face = 0; face < 6; ++face)
    for (uint32_t y = 0; y < kSide; ++y)
      for (uint32_t x = 0; x < kSide; ++x) {
        float s = 2 * (float(x) + 0.5f) / kSide - 1, t = 2 * (float(y) + 0.5f) / kSide - 1;
        const glm::vec3 table[6] = {{1, -t, -s}, {-1, -t, s}, {s, 1, t}, {s, -1, -t}, {s, -t, 1}, {-s, -t, -1}};
        glm::vec3 d = glm::normalize(table[face]);
        glm::vec3 sky = glm::mix(glm::vec3(0.8f, 0.75f, 0.65f), glm::vec3(0.2f, 0.4f, 0.75f), std::sqrt(std::max(d.y, 0.0f)));
        glm::vec3 sea = glm::mix(glm::vec3(0.35f, 0.45f, 0.5f), glm::vec3(0.05f, 0.15f, 0.25f), std::sqrt(std::max(-d.y, 0.0f)));
        glm::vec3 c = d.y > 0 ? sky : sea * (0.9f + 0.1f * std::sin(40 * d.x / (0.1f - d.y)));
        float sun = std::max(glm::dot(d, glm::normalize(glm::vec3(0.5f, 0.45f, -0.7f))), 0.0f);
        c += glm::vec3(1.0f, 0.8f, 0.5f) * std::pow(sun, 60.0f);
        c = glm::clamp(c, 0.0f, 1.0f) * 255.0f;
        faces.insert(faces.end(), {uint8_t(c.r), uint8_t(c.g), uint8_t(c.b), 255});
      }
  if (variant == Variant::kBroken) std::swap_ranges(faces.begin(), faces.begin() + kSide * kSide * 4, faces.begin() + kSide * kSide * 4);
  Image image = mippedTexture(canvas, kSide, faces, 6, true);
  VkSampler sampler = samplerOf(canvas, VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR, VK_LOD_CLAMP_NONE, 0, 1);
  DescriptorSet set = canvas.descriptors({sampled(sampler, viewAs(canvas, image, VK_IMAGE_VIEW_TYPE_CUBE))});
  PipelineSpec spec;
  // The background is the environment itself; the ball mirrors it, rougher (a coarser level) from left to right.
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
layout(set = 0, binding = 0) uniform samplerCube environment;
void main() {
  vec3 eye = normalize(vec3(passed.xy * 0.8, -1.0));
  float r = length(passed.xy) / 0.75;
  if (r < 1.0) {
    vec3 normal = vec3(passed.xy / 0.75, sqrt(1.0 - r * r));
    colour = textureLod(environment, reflect(eye, normal), clamp((passed.x + 0.5) * 3.0, 0.0, 4.0));
    colour.rgb *= 0.9;
  } else {
    colour = textureLod(environment, eye, 0.0);
  }
}
)";
  spec.sets = {set.layout};
  Pipeline pipeline = canvas.pipeline(spec);
  std::vector<Vertex> vertices = {{{-1, -1, 0, 1}, {-1, 1, 0, 0}}, {{3, -1, 0, 1}, {3, 1, 0, 0}}, {{-1, 3, 0, 1}, {-1, -3, 0, 0}}};
  return canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, pipeline, vertices);
  });
}

// A smooth picture in four compressed formats: endpoints fitted to each block's extremes, indices to the nearest step.
struct Blocks {
  std::vector<uint8_t> bc1, bc3, bc4, bc7;
};
Blocks compress(uint32_t side, const std::vector<glm::vec4>& picture) {
  Blocks out;
  auto put = [](std::vector<uint8_t>& v, uint64_t bits, int bytes) {
    for (int i = 0; i < bytes; ++i) v.push_back(uint8_t(bits >> (8 * i)));
  };
  for (uint32_t by = 0; by < side; by += 4)
    for (uint32_t bx = 0; bx < side; bx += 4) {
      auto texel = [&](int i) { return picture[(by + uint32_t(i) / 4) * side + bx + uint32_t(i) % 4]; };
      auto brightness = [](glm::vec4 c) { return c.r + c.g + c.b; };
      glm::vec4 low = texel(0), high = texel(0);
      float lowA = 1, highA = 0;
      for (int i = 0; i < 16; ++i) {
        glm::vec4 c = texel(i);
        if (brightness(c) < brightness(low)) low = c;
        if (brightness(c) > brightness(high)) high = c;
        lowA = std::min(lowA, c.a), highA = std::max(highA, c.a);
      }
      auto share = [&](int i) {
        glm::vec3 d = glm::vec3(high) - glm::vec3(low);
        float n = glm::dot(d, d);
        return n > 0 ? glm::clamp(glm::dot(glm::vec3(texel(i)) - glm::vec3(low), d) / n, 0.0f, 1.0f) : 0.0f;
      };
      auto pack565 = [](glm::vec4 c) { return uint32_t(std::lround(c.r * 31)) << 11 | uint32_t(std::lround(c.g * 63)) << 5 | uint32_t(std::lround(c.b * 31)); };
      uint32_t c0 = pack565(high), c1 = pack565(low), codes = 0;
      for (int i = 0; i < 16; ++i) {
        static const uint32_t kCodes[4] = {1, 3, 2, 0};  // from low to high
        codes |= (c0 > c1 ? kCodes[std::lround(share(i) * 3)] : 0u) << (2 * i);
      }
      uint64_t colour = c0 | uint64_t(c1) << 16 | uint64_t(codes) << 32;
      put(out.bc1, colour, 8);
      auto ramp = [&](float from, float to, auto value) {
        uint64_t a0 = uint64_t(std::lround(to * 255)), a1 = uint64_t(std::lround(from * 255)), bits = a0 | a1 << 8;
        for (int i = 0; i < 16; ++i) {
          long step = to > from ? std::lround((value(i) - from) / (to - from) * 7) : 7;
          uint64_t code = step == 7 ? 0 : step == 0 ? 1 : uint64_t(8 - step);
          bits |= (a0 > a1 ? code : 0) << (16 + 3 * i);
        }
        return bits;
      };
      put(out.bc3, ramp(lowA, highA, [&](int i) { return texel(i).a; }), 8);
      put(out.bc3, colour, 8);
      float lowR = 1, highR = 0;
      for (int i = 0; i < 16; ++i) lowR = std::min(lowR, texel(i).r), highR = std::max(highR, texel(i).r);
      put(out.bc4, ramp(lowR, highR, [&](int i) { return texel(i).r; }), 8);
      // Mode 6: one subset, 7 bits and a p-bit, four-bit indices.
      uint64_t words[2] = {1 << 6, 0};
      auto set = [&](unsigned at, unsigned count, uint64_t v) {
        for (unsigned i = 0; i < count; ++i) words[(at + i) / 64] |= (v >> i & 1) << ((at + i) % 64);
      };
      glm::vec4 e0 = low, e1 = high;
      e0.a = lowA, e1.a = highA;
      const bool swap = std::lround(share(0) * 15) > 7;  // the first index has three bits
      if (swap) std::swap(e0, e1);
      for (int c = 0; c < 4; ++c) {
        set(7 + 14 * unsigned(c), 7, uint64_t(std::lround(e0[c] * 127)));
        set(14 + 14 * unsigned(c), 7, uint64_t(std::lround(e1[c] * 127)));
      }
      set(63, 1, 1), set(64, 1, 1);
      for (int i = 0; i < 16; ++i) {
        uint64_t index = uint64_t(std::lround((swap ? 1 - share(i) : share(i)) * 15));
        set(i ? 64 + 4 * unsigned(i) : 65, i ? 4 : 3, index);
      }
      put(out.bc7, words[0], 8);
      put(out.bc7, words[1], 8);
    }
  return out;
}

Picture renderCompressed(Device& device, Variant variant) {
  constexpr uint32_t kSide = 64;
  Canvas canvas(device, kSize, kSize);
  std::vector<glm::vec4> picture;
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x) {
      float u = (float(x) + 0.5f) / kSide, v = (float(y) + 0.5f) / kSide, r = std::hypot(u - 0.5f, v - 0.5f);
      float petal = 0.3f + 0.1f * std::cos(6 * std::atan2(v - 0.5f, u - 0.5f));
      glm::vec4 c = r < petal ? glm::vec4(0.95f - r, 0.25f + r, 0.3f + v * 0.3f, 1.0f) : glm::vec4(0.2f + 0.2f * u, 0.45f + 0.3f * v, 0.3f, 1.3f - 1.4f * r);
      picture.push_back(glm::clamp(c, 0.0f, 1.0f));
    }
  Blocks blocks = compress(kSide, picture);
  const struct {
    VkFormat format;
    const std::vector<uint8_t>& data;
  } kParts[4] = {{VK_FORMAT_BC1_RGBA_UNORM_BLOCK, blocks.bc1}, {VK_FORMAT_BC3_UNORM_BLOCK, blocks.bc3}, {VK_FORMAT_BC4_UNORM_BLOCK, blocks.bc4},
                 {VK_FORMAT_BC7_UNORM_BLOCK, blocks.bc7}};
  std::vector<DescriptorSet> sets;
  VkSampler sampler = samplerOf(canvas, VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_NEAREST, 0, 0, 1);
  for (const auto& part : kParts) {
    ImageSpec spec;
    spec.format = part.format;
    spec.extent = {kSide, kSide, 1};
    spec.usage |= VK_IMAGE_USAGE_SAMPLED_BIT;
    Image image = canvas.image(spec);
    std::vector<uint8_t> data = part.data;
    if (variant == Variant::kBroken) data[data.size() / 2 + 5] ^= 0x3c;
    Buffer bytes = canvas.bufferOf(data, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    device.run([&](VkCommandBuffer commands) {
      transition(commands, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
      VkBufferImageCopy copy{};
      copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
      copy.imageExtent = spec.extent;
      vkCmdCopyBufferToImage(commands, bytes.handle, image.handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
      transition(commands, image, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
    });
    sets.push_back(canvas.descriptors({sampled(sampler, canvas.view(image))}));
  }
  PipelineSpec spec;
  spec.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
layout(set = 0, binding = 0) uniform sampler2D image;
void main() {
  vec4 c = texture(image, passed.xy);
  ivec2 p = ivec2(gl_FragCoord.xy) >> 3;
  colour = vec4(mix(vec3((p.x + p.y) % 2 == 0 ? 0.5 : 0.6), c.rgb, c.a), 1.0);
}
)";
  spec.sets = {sets[0].layout};
  Pipeline pipeline = canvas.pipeline(spec);
  return canvas.draw({0.1f, 0.1f, 0.1f, 1}, [&](VkCommandBuffer commands) {
    for (int i = 0; i < 4; ++i) {
      double x = i % 2 * 128 + 2, y = i / 2 * 128 + 2;
      auto corner = [&](double u, double v) { return Vertex{atPixel(canvas.size(), x + u * 124, y + v * 124), {float(u), float(v), 0, 0}}; };
      Vertex a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
      vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &sets[size_t(i)].handle, 0, nullptr);
      canvas.drawVertices(commands, pipeline, {a, b, c, a, c, d});
    }
  });
}

// What lavapipe's approximate level of detail leaves comparable.
Expectation groundExpectation(const GroundStyle& style) {
  Expectation e;
  e.onGrid = false;
  e.edges = groundEdges();
  e.stepFunctions = style.filter == VK_FILTER_NEAREST;
  e.stepShare = 0.05;
  e.colourTolerance = style.mipmaps ? 40 : 4;
  return e;
}

// How much detail is left near the horizon: the mean difference of neighbours in the rows under it.
double farContrast(const Picture& p) {
  double sum = 0;
  int count = 0;
  for (uint32_t y = 95; y < 106; ++y)
    for (uint32_t x = 1; x < kSize; ++x, ++count) sum += std::abs(int(p.rgba[(y * kSize + x) * 4]) - int(p.rgba[(y * kSize + x - 1) * 4]));
  return sum / count;
}

}  // namespace

void addFilteringScenes(SceneList& scenes) {
  static const GroundStyle kGrounds[] = {
      {"ground_nearest", VK_FILTER_NEAREST, VK_SAMPLER_MIPMAP_MODE_NEAREST, false, 1},
      {"ground_bilinear", VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_NEAREST, false, 1},
      {"ground_nearest_mip", VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_NEAREST, true, 1},
      {"ground_trilinear", VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR, true, 1},
      {"ground_anisotropic", VK_FILTER_LINEAR, VK_SAMPLER_MIPMAP_MODE_LINEAR, true, 16},
  };
  for (const GroundStyle& style : kGrounds) {
    Scene scene;
    scene.name = style.name;
    scene.broken = style.mipmaps ? "two levels too coarse" : "half a texel off";
    scene.render = [style](Device& device, Variant variant) { return renderGround(device, variant, style); };
    scene.expectation = [style] { return groundExpectation(style); };
    scene.supported = [style](const Device& device) { return style.anisotropy == 1 || device.features.samplerAnisotropy; };
    scene.verify = [style](const Picture& p) -> std::string {
      double contrast = farContrast(p);
      // Without mip levels there is noise; isotropic filtering blurs everything; anisotropic filtering keeps the lines across the view.
      const double low = !style.mipmaps ? 20 : style.anisotropy > 1 ? 5 : 0, high = !style.mipmaps ? 60 : style.anisotropy > 1 ? 16 : 2;
      if (contrast < low || contrast > high) return "contrast near the horizon is " + std::to_string(contrast);
      return {};
    };
    scenes.push_back(scene);
  }
  Scene environment;
  environment.name = "environment_cube";
  environment.broken = "two faces exchanged";
  environment.render = renderEnvironment;
  environment.expectation = [] {
    Expectation e;
    e.colourTolerance = 3;  // lavapipe's filter and level weights have 8 bits
    return e;
  };
  scenes.push_back(environment);
  Scene compressed;
  compressed.name = "block_compressed";
  compressed.broken = "some bits of one block";
  compressed.render = renderCompressed;
  compressed.oracle.share = 0;
  compressed.expectation = [] {
    Expectation e;
    e.colourTolerance = 3;  // lavapipe interpolates endpoints rounded to bytes, with 8-bit weights of the filter
    return e;
  };
  compressed.supported = [](const Device& device) { return device.features.textureCompressionBC == VK_TRUE; };
  scenes.push_back(compressed);
}

}  // namespace pumice::cts
