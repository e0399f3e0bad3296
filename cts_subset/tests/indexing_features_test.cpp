// Arrays of descriptors of every type, indexed by what all invocations share and by what differs between neighbours; where the
// device has it, the descriptors are written after the set was bound.
#include "cts_subset/tests/graphics.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kCount = 12, kTexels = 80, kLanes = 64;

enum class Made { kBuffer, kTexelBuffer, kImage };

// How a shader sees element `e` of descriptor `k`, which holds 1000 * k + e until somebody writes.
struct Kind {
  const char* name;
  VkDescriptorType type;
  Made made;
  const char *declaration, *read, *write;   // no `write`: read only
  VkBool32 (*dynamic)(const Device&);
  VkBool32 (*nonUniform)(const Device&);
  VkBool32 (*afterBind)(const Device&);
};
#define PUMICE_BIT(structure, member) [](const Device& d) { return d.structure.member; }
const Kind kKinds[] = {
    {"UniformBuffers", VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, Made::kBuffer, "uniform U { uvec4 v[20]; } d[12]", "d[K].v[(E) / 4u][(E) % 4u]", nullptr,
     PUMICE_BIT(features, shaderUniformBufferArrayDynamicIndexing), PUMICE_BIT(vulkan12, shaderUniformBufferArrayNonUniformIndexing),
     PUMICE_BIT(vulkan12, descriptorBindingUniformBufferUpdateAfterBind)},
    {"StorageBuffers", VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, Made::kBuffer, "coherent buffer B { uint v[]; } d[12]", "d[K].v[E]", "d[K].v[E] = V",
     PUMICE_BIT(features, shaderStorageBufferArrayDynamicIndexing), PUMICE_BIT(vulkan12, shaderStorageBufferArrayNonUniformIndexing),
     PUMICE_BIT(vulkan12, descriptorBindingStorageBufferUpdateAfterBind)},
    {"UniformTexelBuffers", VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, Made::kTexelBuffer, "uniform utextureBuffer d[12]", "texelFetch(d[K], int(E)).x", nullptr,
     PUMICE_BIT(vulkan12, shaderUniformTexelBufferArrayDynamicIndexing), PUMICE_BIT(vulkan12, shaderUniformTexelBufferArrayNonUniformIndexing),
     PUMICE_BIT(vulkan12, descriptorBindingUniformTexelBufferUpdateAfterBind)},
    {"StorageTexelBuffers", VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER, Made::kTexelBuffer, "coherent uniform uimageBuffer d[12]", "imageLoad(d[K], int(E)).x",
     "imageStore(d[K], int(E), uvec4(V))", PUMICE_BIT(vulkan12, shaderStorageTexelBufferArrayDynamicIndexing),
     PUMICE_BIT(vulkan12, shaderStorageTexelBufferArrayNonUniformIndexing), PUMICE_BIT(vulkan12, descriptorBindingStorageTexelBufferUpdateAfterBind)},
    {"SampledImages", VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, Made::kImage, "uniform utexture2D d[12]", "texelFetch(d[K], ivec2(E, 0), 0).x", nullptr,
     PUMICE_BIT(features, shaderSampledImageArrayDynamicIndexing), PUMICE_BIT(vulkan12, shaderSampledImageArrayNonUniformIndexing),
     PUMICE_BIT(vulkan12, descriptorBindingSampledImageUpdateAfterBind)},
    {"StorageImages", VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, Made::kImage, "coherent uniform uimage2D d[12]", "imageLoad(d[K], ivec2(E, 0)).x",
     "imageStore(d[K], ivec2(E, 0), uvec4(V))", PUMICE_BIT(features, shaderStorageImageArrayDynamicIndexing),
     PUMICE_BIT(vulkan12, shaderStorageImageArrayNonUniformIndexing), PUMICE_BIT(vulkan12, descriptorBindingStorageImageUpdateAfterBind)},
};

struct Case {
  Role role;
  const Kind* kind;
  bool nonUniform;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.kind->name; }

class IndexingFeatures : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (GetParam().role == Role::kPeer)
      PUMICE_NEED_PEER();
    else
      PUMICE_NEED_TESTED();
  }
  Device& device() { return GetParam().role == Role::kPeer ? *world().peer : *world().tested; }
};

std::string shaderOf(const Kind& kind, bool nonUniform) {
  std::string s = R"(#version 460
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_EXT_samplerless_texture_functions : require
#extension GL_EXT_shader_image_load_formatted : require
layout(local_size_x = 64) in;
layout(binding = 0) buffer Out { uint r[]; };
layout(binding = 1) )" + std::string(kind.declaration) + R"(;
layout(push_constant) uniform P { uint turns; };
uint get(uint k, uint e) { return GET; }
void put(uint k, uint e, uint v) { PUT; }
void main() {
  uint i = gl_LocalInvocationIndex, other = (i + 5) % 64, sum = 0;
)";
  // Each invocation writes an element of its own, of one descriptor or of all, and reads what a neighbour has written.
  s += nonUniform ? R"(  put(i * 7 % 12, 1 + i, 50000 + i);
  memoryBarrier();
  barrier();
  r[i] = get(other * 7 % 12, 1 + other) + get(i * 5 % 12, 0) * 100000;
}
)"
                  : R"(  for (uint k = 0; k < turns; k++) put(k, 1 + i, 50000 + 100 * k + i);
  memoryBarrier();
  barrier();
  for (uint k = 0; k < turns; k++) sum = sum * 3 + get(k, 1 + other);
  r[i] = sum + get(turns / 2, 0);
}
)";
  auto expand = [&](std::string text, const char* call) {
    for (auto [from, to] : {std::pair{"[K]", nonUniform ? "[nonuniformEXT(k)]" : "[k]"}, {"(E)", "(e)"}, {"[E]", "[e]"}, {"ivec2(E, 0)", "ivec2(e, 0)"}, {"V", "v"}})
      for (size_t at; (at = text.find(from)) != std::string::npos;) text.replace(at, std::string_view(from).size(), to);
    s.replace(s.find(call), 3, text);
  };
  expand(kind.read, "GET");
  expand(kind.write ? kind.write : "", "PUT");
  return s;
}

TEST_P(IndexingFeatures, Compute) {
  const Case& c = GetParam();
  const Kind& kind = *c.kind;
  PUMICE_NEED_FEATURE(c.nonUniform ? kind.nonUniform(device()) : kind.dynamic(device()));
  const bool afterBind = device().vulkan12.descriptorIndexing && kind.afterBind(device());
  if (c.role == Role::kTested) {
    EXPECT_TRUE(afterBind);
  }
  Workspace work(device());
  VkDevice d = device().handle;
  const VkDescriptorBindingFlags flags[2] = {0, VkDescriptorBindingFlags(afterBind ? VK_DESCRIPTOR_BINDING_UPDATE_AFTER_BIND_BIT : 0)};
  VkDescriptorSetLayoutBindingFlagsCreateInfo flagsInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO, nullptr, 2, flags};
  VkDescriptorSetLayout setLayout = makeSetLayout(work, {computeBinding(0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(1, kind.type, kCount)},
                                                  afterBind ? VK_DESCRIPTOR_SET_LAYOUT_CREATE_UPDATE_AFTER_BIND_POOL_BIT : 0, &flagsInfo);
  VkPipelineLayout layout = makePipelineLayout(work, {setLayout}, 4);
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, shaderOf(kind, c.nonUniform), ShaderTarget::kVulkan13), layout);
  VkDescriptorPool pool = makePool(work, {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1}, {kind.type, kCount}}, 1,
                                   afterBind ? VK_DESCRIPTOR_POOL_CREATE_UPDATE_AFTER_BIND_BIT : 0);
  VkDescriptorSet set = makeSet(work, pool, setLayout);
  Buffer out = work.bufferOf(Words(kLanes, 0), kStorage);
  VkDescriptorBufferInfo outInfo{out.handle, 0, VK_WHOLE_SIZE};
  VkWriteDescriptorSet outWrite = writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &outInfo);
  vkUpdateDescriptorSets(d, 1, &outWrite, 0, nullptr);

  std::vector<VkDescriptorBufferInfo> buffers(kCount);
  std::vector<VkDescriptorImageInfo> images(kCount);
  std::vector<VkBufferView> texels(kCount);
  const bool storage = kind.write;
  for (uint32_t k = 0; k < kCount; k++) {
    Words data(kTexels);
    for (uint32_t e = 0; e < kTexels; e++) data[e] = 1000 * k + e;
    // Two formats, so that descriptors differ in more than their address.
    const VkFormat format = k % 2 && kind.made != Made::kBuffer && !storage ? VK_FORMAT_R16_UINT : VK_FORMAT_R32_UINT;
    Bytes bytes;
    for (uint32_t word : data)
      for (uint32_t b = 0; b < (format == VK_FORMAT_R16_UINT ? 2u : 4u); b++) bytes.push_back(uint8_t(word >> 8 * b));
    if (kind.made == Made::kImage) {
      ImageSpec spec;
      spec.format = format;
      spec.extent = {kTexels, 1, 1};
      spec.usage |= storage ? VK_IMAGE_USAGE_STORAGE_BIT : VK_IMAGE_USAGE_SAMPLED_BIT;
      Image image = work.image(spec);
      toGeneral(work, image);
      Piece whole;
      whole.extent = spec.extent;
      upload(work, image, whole, bytes);
      images[k] = {VK_NULL_HANDLE, work.view(image), VK_IMAGE_LAYOUT_GENERAL};
      continue;
    }
    constexpr VkBufferUsageFlags kUsage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT |
                                          VK_BUFFER_USAGE_STORAGE_TEXEL_BUFFER_BIT;
    Buffer buffer = work.buffer(bytes.size(), kUsage, bytes.data());
    buffers[k] = {buffer.handle, 0, VK_WHOLE_SIZE};
    if (kind.made == Made::kTexelBuffer) {
      VkBufferViewCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO, nullptr, 0, buffer.handle, format, 0, VK_WHOLE_SIZE};
      texels[k] = work.make(info);
    }
  }
  auto writeAll = [&] {
    VkWriteDescriptorSet write = writeBuffer(set, 1, kind.type, buffers.data(), 0, kCount);
    write.pImageInfo = images.data();
    write.pTexelBufferView = texels.data();
    vkUpdateDescriptorSets(d, 1, &write, 0, nullptr);
  };
  if (!afterBind) writeAll();
  device().run([&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
    const uint32_t turns = kCount - 1;
    vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &turns);
    vkCmdDispatch(commands, 1, 1, 1);
    fullBarrier(commands);
    if (afterBind) writeAll();
  });
  Words found = valuesOf<uint32_t>(wordsOf(bytesOf(out)));
  uint32_t wrong = 0;
  for (uint32_t i = 0; i < kLanes; i++) {
    uint32_t other = (i + 5) % 64, expected = 0;
    auto value = [&](uint32_t k, uint32_t writer, uint32_t written) { return storage ? written : 1000 * k + 1 + writer; };
    if (c.nonUniform) {
      expected = value(other * 7 % 12, other, 50000 + other) + i * 5 % 12 * 1000 * 100000;
    } else {
      for (uint32_t k = 0; k < kCount - 1; k++) expected = expected * 3 + value(k, other, 50000 + 100 * k + other);
      expected += (kCount - 1) / 2 * 1000;
    }
    if (found[i] != expected && ++wrong <= 4) ADD_FAILURE() << "invocation " << i << " has " << found[i] << ", expected " << expected;
  }
}

std::vector<Case> allCases() {
  std::vector<Case> cases;
  for (Role role : {Role::kTested, Role::kPeer})
    for (const Kind& kind : kKinds)
      for (bool nonUniform : {false, true}) cases.push_back({role, &kind, nonUniform});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(On, IndexingFeatures, testing::ValuesIn(allCases()), [](const auto& info) {
  return std::string(info.param.role == Role::kTested ? "Tested" : "Lavapipe") + info.param.kind->name + (info.param.nonUniform ? "NonUniform" : "Dynamic");
});

class AttachmentIndexingFeatures : public DrawTest {};

// Three attachments are read by one fragment shader: the one that a push constant names, and the one that the pixel's column names.
TEST_P(AttachmentIndexingFeatures, InputAttachments) {
  PUMICE_NEED_FEATURE(device().vulkan12.shaderInputAttachmentArrayDynamicIndexing && device().vulkan12.shaderInputAttachmentArrayNonUniformIndexing);
  constexpr uint32_t kInputs = 3;
  VkAttachmentDescription attachments[kInputs + 1]{};
  for (auto& a : attachments) {
    a.format = kUint;
    a.samples = VK_SAMPLE_COUNT_1_BIT;
    a.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    a.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    a.initialLayout = a.finalLayout = VK_IMAGE_LAYOUT_GENERAL;
  }
  VkAttachmentReference references[kInputs + 1];
  for (uint32_t i = 0; i <= kInputs; i++) references[i] = {i, VK_IMAGE_LAYOUT_GENERAL};
  VkSubpassDescription subpass{};
  subpass.inputAttachmentCount = kInputs;
  subpass.pInputAttachments = references;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &references[kInputs];
  VkRenderPassCreateInfo passInfo{};
  passInfo.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  passInfo.attachmentCount = kInputs + 1;
  passInfo.pAttachments = attachments;
  passInfo.subpassCount = 1;
  passInfo.pSubpasses = &subpass;
  VkRenderPass renderPass = work->make(passInfo);
  std::vector<Image> images;
  VkImageView views[kInputs + 1];
  for (uint32_t i = 0; i <= kInputs; i++) {
    images.push_back(target(kUint, 1, VK_SAMPLE_COUNT_1_BIT, i < kInputs ? VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT : 0));
    views[i] = work->view(images[i]);
  }
  VkFramebuffer framebuffer = work->framebufferOf(renderPass, {std::begin(views), std::end(views)}, kSize);

  VkDescriptorSetLayout setLayout = makeSetLayout(*work, {{0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, kInputs, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr}});
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 16, kGraphics);
  VkDescriptorSet set = makeSet(*work, makePool(*work, {{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, kInputs}}), setLayout);
  VkDescriptorImageInfo imageInfos[kInputs];
  for (uint32_t i = 0; i < kInputs; i++) imageInfos[i] = {VK_NULL_HANDLE, views[i], VK_IMAGE_LAYOUT_GENERAL};
  VkWriteDescriptorSet write = writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, nullptr, 0, kInputs);
  write.pImageInfo = imageInfos;
  vkUpdateDescriptorSets(handle(), 1, &write, 0, nullptr);
  GraphicsSpec spec;
  spec.pass = renderPass;
  spec.colorCount = 1;
  spec.fragment = R"(#version 460
#extension GL_EXT_nonuniform_qualifier : require
layout(push_constant) uniform P { vec4 given; };
layout(input_attachment_index = 0, binding = 0) uniform usubpassInput inputs[3];
layout(location = 0) out uvec4 color;
void main() {
  color = uvec4(subpassLoad(inputs[uint(given.x)]).x, subpassLoad(inputs[nonuniformEXT(uint(gl_FragCoord.x) % 3)]).x, 1, 2);
}
)";
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  device().run([&](VkCommandBuffer c) {
    for (uint32_t i = 0; i <= kInputs; i++) {
      VkClearColorValue value{};
      value.uint32[0] = 10 + i;
      VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      vkCmdClearColorImage(c, images[i].handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &all);
    }
    fullBarrier(c);
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, renderPass, framebuffer, {{0, 0}, kSize}, 0, nullptr};
    vkCmdBeginRenderPass(c, &begin, VK_SUBPASS_CONTENTS_INLINE);
    wholeTarget(c, kSize);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set, 0, nullptr);
    for (uint32_t i = 0; i < kInputs; i++) {   // rows 2 i and 2 i + 1
      VkRect2D rows{{0, int32_t(2 * i)}, {8, 2}};
      vkCmdSetScissor(c, 0, 1, &rows);
      drawWhole(c, layout, float(i));
    }
    vkCmdEndRenderPass(c);
    fullBarrier(c);
  });
  Words p = pixels(images[kInputs]);
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << " " << y);
      EXPECT_EQ(at(p, x, y, 0), y < 6 ? 10 + y / 2 : 13);
      EXPECT_EQ(at(p, x, y, 1), y < 6 ? 10 + x % 3 : 0);
    }
}

PUMICE_ON_BOTH_DEVICES(AttachmentIndexingFeatures);

}  // namespace
}  // namespace pumice::cts
