// Questions to a driver's texture unit: a compute shader asks, storage buffers carry exact answers.
#pragma once

#include "cts_subset/tests/graphics.h"

#include <glm/glm.hpp>

namespace pumice::cts {

struct ViewSpec {
  VkImageViewType type = VK_IMAGE_VIEW_TYPE_2D;
  VkFormat format = VK_FORMAT_UNDEFINED;  // the image's
  VkImageAspectFlags aspect = 0;          // all of the image's
  uint32_t mip = 0, mips = VK_REMAINING_MIP_LEVELS;
  uint32_t layer = 0, layers = VK_REMAINING_ARRAY_LAYERS;
  VkImageUsageFlags usage = 0;            // 0: the image's
};

inline VkImageView makeView(Workspace& work, const Image& image, const ViewSpec& spec) {
  VkImageViewUsageCreateInfo usage{VK_STRUCTURE_TYPE_IMAGE_VIEW_USAGE_CREATE_INFO, nullptr, spec.usage};
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  if (spec.usage) info.pNext = &usage;
  info.image = image.handle;
  info.viewType = spec.type;
  info.format = spec.format ? spec.format : image.spec.format;
  info.subresourceRange = {spec.aspect ? spec.aspect : image.aspects, spec.mip, spec.mips, spec.layer, spec.layers};
  return work.make(info);
}

inline VkSamplerCreateInfo samplerInfo(VkFilter filter = VK_FILTER_NEAREST,
                                       VkSamplerAddressMode mode = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
                                       VkSamplerMipmapMode mipmaps = VK_SAMPLER_MIPMAP_MODE_NEAREST) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = filter;
  info.mipmapMode = mipmaps;
  info.addressModeU = info.addressModeV = info.addressModeW = mode;
  info.maxAnisotropy = 1;
  info.maxLod = VK_LOD_CLAMP_NONE;
  return info;
}

inline Binding sampledBinding(VkImageView view, VkSampler sampler, VkImageLayout layout = VK_IMAGE_LAYOUT_GENERAL) {
  Binding b{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  b.image = {sampler, view, layout};
  return b;
}
inline Binding storageBinding(VkImageView view) {
  Binding b{VK_DESCRIPTOR_TYPE_STORAGE_IMAGE};
  b.image = {VK_NULL_HANDLE, view, VK_IMAGE_LAYOUT_GENERAL};
  return b;
}

// Runs `body` once for each question. In it: `vec4 q[]` are the questions (`perQuestion` vec4 each, `vec4 ask(int k)`),
// and it must set `vec4 answer` (or `uvec4 bits`, where `asBits`). `declarations` come before: bindings 2 and up are `bindings`.
inline std::vector<glm::vec4> probe(Workspace& work, const std::string& declarations, const std::string& body,
                                    const std::vector<Binding>& bindings, const std::vector<glm::vec4>& questions,
                                    uint32_t perQuestion = 1) {
  const uint32_t count = uint32_t(questions.size()) / perQuestion;
  Buffer in = work.bufferOf(questions, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  Buffer out = work.buffer(VkDeviceSize(count) * 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  std::vector<Binding> all = {bufferBinding(in), bufferBinding(out)};
  all.insert(all.end(), bindings.begin(), bindings.end());

  VkShaderModule module = work.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 450
#extension GL_EXT_shader_image_load_formatted : enable
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer In { vec4 q[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Out { vec4 a[]; };
layout(push_constant) uniform Push { uint count; };
)" + declarations + "\nvec4 ask(int k) { return q[gl_GlobalInvocationID.x * " +
                                                                     std::to_string(perQuestion) + R"( + k]; }
void main() {
  if (gl_GlobalInvocationID.x >= count) return;
  vec4 answer = vec4(0);
)" + body + "\n  a[gl_GlobalInvocationID.x] = answer;\n}\n");

  DescriptorSet set = work.descriptors(all);
  VkPipelineLayout pipelineLayout = makePipelineLayout(work, {set.layout}, 4);
  VkPipeline pipeline = makeCompute(work, module, pipelineLayout);
  work.device.run([&](VkCommandBuffer commands) {
    fullBarrier(commands);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelineLayout, 0, 1, &set.handle, 0, nullptr);
    vkCmdPushConstants(commands, pipelineLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &count);
    vkCmdDispatch(commands, (count + 63) / 64, 1, 1);
    fullBarrier(commands);
  });
  std::vector<glm::vec4> answers(count);
  std::memcpy(answers.data(), out.mapped, size_t(count) * 16);
  return answers;
}

// Draws one triangle over the whole of a colour attachment in GENERAL, keeping what is there where nothing is drawn, or `points`
// points by a vertex shader of one's own.
struct Painting {
  VkExtent2D extent{};
  VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT;
  uint32_t layers = 1;
  std::string fragment;
  std::string vertex = "#version 450\nvoid main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1, 0.5, 1); }";
  bool blend = false;
  uint32_t points = 0;
  VkFormat attribute = VK_FORMAT_UNDEFINED;  // at location 0
  uint32_t stride = 0;
  VkBuffer vertices = VK_NULL_HANDLE;
};

inline void paint(Workspace& work, VkImageView view, VkFormat format, const Painting& p) {
  VkAttachmentDescription2 kept = attachmentOf(format, p.samples);
  kept.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  const VkAttachmentReference2 reference = referenceTo(0, VK_IMAGE_ASPECT_COLOR_BIT);
  GraphicsSpec spec;
  spec.shaders = ShaderTarget::kVulkan10;
  spec.vertex = p.vertex;
  spec.fragment = p.fragment;
  spec.pass = makePass(work, {kept}, {subpass(&reference)});
  spec.colorCount = 1;
  spec.samples = p.samples;
  if (p.points) spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
  if (p.blend)
    spec.blends = {{VK_TRUE, VK_BLEND_FACTOR_SRC_ALPHA, VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA, VK_BLEND_OP_ADD, VK_BLEND_FACTOR_SRC_ALPHA,
                    VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA, VK_BLEND_OP_ADD, 0xf}};
  if (p.attribute) {
    spec.bindings = {{0, p.stride, VK_VERTEX_INPUT_RATE_VERTEX}};
    spec.attributes = {{0, 0, p.attribute, 0}};
  }
  VkPipeline pipeline = makeGraphics(work, makePipelineLayout(work, {}), spec);
  VkFramebuffer target = work.framebufferOf(spec.pass, {view}, p.extent, p.layers);
  work.device.run([&](VkCommandBuffer commands) {
    fullBarrier(commands);
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, spec.pass, target, {{0, 0}, p.extent}, 0, nullptr};
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    wholeTarget(commands, p.extent);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    VkDeviceSize zero = 0;
    if (p.vertices) vkCmdBindVertexBuffers(commands, 0, 1, &p.vertices, &zero);
    vkCmdDraw(commands, p.points ? p.points : 3, 1, 0, 0);
    vkCmdEndRenderPass(commands);
    fullBarrier(commands);
  });
}

}  // namespace pumice::cts
