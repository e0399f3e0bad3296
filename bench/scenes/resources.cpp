#include "bench/scenes/resources.h"

#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>

namespace pumice::bench {

using cts::check;

namespace {

unsigned compiled = 0;
double compilerSeconds = 0;

uint64_t hashOf(const std::string& text, uint64_t seed) {
  uint64_t hash = 14695981039346656037ull ^ seed;
  for (unsigned char c : text) hash = (hash ^ c) * 1099511628211ull;
  return hash;
}

}  // namespace

const std::vector<uint32_t>& cachedSpirv(VkShaderStageFlagBits stage, const std::string& glsl) {
  static std::map<uint64_t, std::vector<uint32_t>> known;
  const uint64_t key = hashOf(glsl, stage);
  auto [entry, isNew] = known.try_emplace(key);
  std::vector<uint32_t>& words = entry->second;
  if (!isNew) return words;
  const std::filesystem::path folder = PUMICE_SPIRV_CACHE;
  const std::filesystem::path path = folder / (std::to_string(key) + ".spv");
  if (std::ifstream file(path, std::ios::binary); file) {
    words.resize(std::filesystem::file_size(path) / 4);
    file.read(reinterpret_cast<char*>(words.data()), std::streamsize(words.size() * 4));
    if (file && !words.empty()) return words;
  }
  auto start = std::chrono::steady_clock::now();
  words = cts::compileGlsl(stage, glsl);
  ++compiled;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  std::filesystem::path temporary = path;
  temporary += "." + std::to_string(getpid());
  std::ofstream(temporary, std::ios::binary)
      .write(reinterpret_cast<const char*>(words.data()), std::streamsize(words.size() * 4));
  std::filesystem::rename(temporary, path, error);
  compilerSeconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return words;
}

VkShaderModule cachedShader(cts::Workspace& workspace, VkShaderStageFlagBits stage, const std::string& glsl) {
  return workspace.shader(cachedSpirv(stage, glsl));
}

unsigned shadersCompiled() { return compiled; }
double shaderCompilerSeconds() { return compilerSeconds; }

void useSmallVertices(PipelineSpec& spec) {
  spec.bindings = {{0, sizeof(SmallVertex), VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32G32B32_SFLOAT, 0}, {1, 0, VK_FORMAT_R8G8B8A8_UNORM, 12}};
  spec.vertex = R"(#version 450
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
void main() { gl_Position = vec4(position, 1.0); passed = given; }
)";
}

const char* const kFullScreenVertex = R"(#version 450
layout(location = 0) out vec2 place;
void main() {
  place = vec2(gl_VertexIndex == 1 ? 2.0 : 0.0, gl_VertexIndex == 2 ? 2.0 : 0.0);
  gl_Position = vec4(place * 2.0 - 1.0, 0.5, 1.0);
}
)";

uint32_t patternTexel(uint32_t x, uint32_t y) {
  uint32_t noise = (x * 73856093u ^ y * 19349663u) * 2654435761u;
  uint32_t checker = ((x >> 5) + (y >> 5)) & 1 ? 0xb0 : 0x40;
  uint32_t r = checker + (noise >> 26), g = ((x ^ y) & 0xff) / 2 + (noise >> 20 & 63), b = (x / 4 + y / 4) & 0xff;
  return r | g << 8 | b << 16 | 0xff000000u;
}

Image mippedTexture(cts::Workspace& workspace, uint32_t size, const std::function<uint32_t(uint32_t, uint32_t)>& texel,
                    bool mips) {
  cts::ImageSpec spec;
  spec.extent = {size, size, 1};
  spec.usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_SAMPLED_BIT;
  spec.mips = 1;
  if (mips)
    while (size >> spec.mips) ++spec.mips;
  Image made = workspace.image(spec);
  std::vector<uint32_t> texels(size_t(size) * size);
  for (uint32_t y = 0; y < size; ++y)
    for (uint32_t x = 0; x < size; ++x) texels[size_t(y) * size + x] = texel(x, y);
  std::vector<VkBufferImageCopy> regions;
  size_t above = 0;
  for (uint32_t level = 0; level < spec.mips; ++level) {
    const uint32_t side = size >> level;
    if (level > 0) {
      const size_t begin = texels.size();
      texels.resize(begin + size_t(side) * side);
      for (uint32_t y = 0; y < side; ++y)
        for (uint32_t x = 0; x < side; ++x) {
          const uint32_t* from = &texels[above + size_t(y) * 2 * side * 2 + x * 2];
          uint32_t sum = 0;
          for (uint32_t shift = 0; shift < 32; shift += 8) {
            uint32_t four = (from[0] >> shift & 255) + (from[1] >> shift & 255) + (from[side * 2] >> shift & 255) +
                            (from[side * 2 + 1] >> shift & 255);
            sum |= (four + 2) / 4 << shift;
          }
          texels[begin + size_t(y) * side + x] = sum;
        }
      above = begin;
    }
    VkBufferImageCopy region{};
    region.bufferOffset = above * 4;
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, 1};
    region.imageExtent = {side, side, 1};
    regions.push_back(region);
  }
  Buffer staging = workspace.bufferOf(texels, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
  workspace.device.run([&](VkCommandBuffer commands) {
    cts::transition(commands, made, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    vkCmdCopyBufferToImage(commands, staging.handle, made.handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                           uint32_t(regions.size()), regions.data());
    cts::transition(commands, made, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  });
  return made;
}

VkSampler makeSampler(cts::Workspace& workspace, const SamplerSpec& spec) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = spec.filter;
  info.mipmapMode = spec.mipmaps;
  info.addressModeU = info.addressModeV = info.addressModeW = spec.address;
  info.anisotropyEnable = spec.anisotropy > 0;
  info.maxAnisotropy = spec.anisotropy > 0 ? spec.anisotropy : 1;
  info.compareEnable = spec.compare;
  info.compareOp = VK_COMPARE_OP_LESS_OR_EQUAL;
  info.maxLod = VK_LOD_CLAMP_NONE;
  info.borderColor = VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
  return workspace.make(info);
}

cts::Binding sampledImage(VkImageView view, VkSampler sampler) {
  cts::Binding binding{};
  binding.type = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  binding.image = {sampler, view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  return binding;
}

cts::Binding bufferBinding(VkDescriptorType type, const Buffer& buffer) {
  cts::Binding binding{};
  binding.type = type;
  binding.buffer = {buffer.handle, 0, VK_WHOLE_SIZE};
  return binding;
}

Picture readImage(cts::Workspace& workspace, const Image& image) {
  const VkExtent3D extent = image.spec.extent;
  Picture picture(extent.width, extent.height);
  Buffer buffer = workspace.buffer(picture.rgba.size(), VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  workspace.device.run([&](VkCommandBuffer commands) {
    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = extent;
    vkCmdCopyImageToBuffer(commands, image.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, buffer.handle, 1, &region);
    cts::fullBarrier(commands);
  });
  std::memcpy(picture.rgba.data(), buffer.mapped, picture.rgba.size());
  return picture;
}

}  // namespace pumice::bench
