// What several scenes are made of: shaders, textures, meshes.
#pragma once

#include "bench/scenes/scene.h"

#include <functional>

namespace pumice::bench {

// SPIR-V of a GLSL text. It is kept in a folder between processes, so that the compiler's time and memory do not count
// as the driver's; shadersCompiled() says how often that was not so.
const std::vector<uint32_t>& cachedSpirv(VkShaderStageFlagBits stage, const std::string& glsl);
VkShaderModule cachedShader(cts::Workspace& workspace, VkShaderStageFlagBits stage, const std::string& glsl);
unsigned shadersCompiled();
// Seconds of this process spent in it.
double shaderCompilerSeconds();

// The same numbers on every machine.
class Random {
 public:
  explicit Random(uint32_t seed) : state(seed) {}
  uint32_t word() {
    state ^= state << 13;
    state ^= state >> 17;
    return state ^= state << 5;
  }
  float unit() { return float(word() >> 8) * (1.0f / 16777216.0f); }
  float in(float low, float high) { return low + (high - low) * unit(); }

 private:
  uint32_t state;
};

// A vertex of 16 bytes: a position in clip space with w = 1, and a colour.
struct SmallVertex {
  float x, y, z;
  uint32_t rgba;
};
// The vertex input of SmallVertex, and a vertex shader that passes the colour on to location 0.
void useSmallVertices(PipelineSpec& spec);
extern const char* const kFullScreenVertex;  // three vertices without a buffer; passes 0..1 on as a vec2

// An RGBA8 texture with all its levels, each the average of four texels of the one above.
Image mippedTexture(cts::Workspace& workspace, uint32_t size, const std::function<uint32_t(uint32_t x, uint32_t y)>& texel,
                    bool mips = true);
// Something with detail at every scale.
uint32_t patternTexel(uint32_t x, uint32_t y);

struct SamplerSpec {
  VkFilter filter = VK_FILTER_LINEAR;
  VkSamplerMipmapMode mipmaps = VK_SAMPLER_MIPMAP_MODE_LINEAR;
  float anisotropy = 0;
  VkSamplerAddressMode address = VK_SAMPLER_ADDRESS_MODE_REPEAT;
  bool compare = false;  // LESS_OR_EQUAL
};
VkSampler makeSampler(cts::Workspace& workspace, const SamplerSpec& spec);

cts::Binding sampledImage(VkImageView view, VkSampler sampler);
cts::Binding bufferBinding(VkDescriptorType type, const Buffer& buffer);

// An image in TRANSFER_SRC_OPTIMAL, four bytes a texel.
Picture readImage(cts::Workspace& workspace, const Image& image);

}  // namespace pumice::bench
