// Accesses outside of images and buffers, and through descriptors of nothing: defined results, nothing else touched.
#include "cts_subset/tests/compute.h"
#include "cts_subset/tests/probe.h"

namespace pumice::cts {
namespace {

class RobustnessFeatures : public ComputeTest {};

TEST_P(RobustnessFeatures, StorageImages) {
  PUMICE_NEED_FEATURE(device().vulkan13.robustImageAccess);
  Workspace work(device());
  ImageSpec imageSpec;
  imageSpec.format = VK_FORMAT_R32_UINT;
  imageSpec.extent = {5, 5, 1};
  imageSpec.usage |= VK_IMAGE_USAGE_STORAGE_BIT;
  Image image = work.image(imageSpec);
  VkImageView view = work.view(image);
  Buffer out = work.bufferOf(Words(64, 77), kStorage);
  VkDescriptorSetLayout setLayout =
      makeSetLayout(work, {computeBinding(0, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)});
  VkPipelineLayout layout = makePipelineLayout(work, {setLayout});
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32ui) uniform uimage2D image;
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  ivec2 at = ivec2(gl_LocalInvocationID.xy) - 2;
  imageStore(image, at, uvec4(100 + gl_LocalInvocationIndex));
  memoryBarrierImage(); barrier();
  r[gl_LocalInvocationIndex] = imageLoad(image, at).x;
}
)"), layout);
  VkDescriptorPool pool = makePool(work, {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1}, {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, 1}});
  VkDescriptorSet set = makeSet(work, pool, setLayout);
  VkDescriptorBufferInfo bufferInfo{out.handle, 0, VK_WHOLE_SIZE};
  VkDescriptorImageInfo imageInfo{VK_NULL_HANDLE, view, VK_IMAGE_LAYOUT_GENERAL};
  VkWriteDescriptorSet writes[2] = {writeBuffer(set, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &bufferInfo), writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, nullptr)};
  writes[1].pImageInfo = &imageInfo;
  vkUpdateDescriptorSets(device().handle, 2, writes, 0, nullptr);
  toGeneral(work, image);
  device().run([&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
    vkCmdDispatch(commands, 1, 1, 1);
    fullBarrier(commands);
  });
  Words expected;
  for (uint32_t i = 0; i < 64; i++) {
    uint32_t x = i % 8, y = i / 8;
    expected.push_back(x >= 2 && x < 7 && y >= 2 && y < 7 ? 100 + i : 0);
  }
  expect(valuesOf<uint32_t>(wordsOf(bytesOf(out))), expected);
}

// Descriptors that point nowhere: reads give zero, writes vanish.
TEST_P(RobustnessFeatures, NullDescriptors) {
  PUMICE_NEED_FEATURE(device().robustness2.nullDescriptor && device().robustness2.robustBufferAccess2);
  Workspace work(device());
  VkDescriptorSetLayout setLayout = makeSetLayout(
      work, {computeBinding(0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(2, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER),
             computeBinding(3, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER), computeBinding(4, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE), computeBinding(5, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE)});
  VkPipelineLayout layout = makePipelineLayout(work, {setLayout});
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 460
#extension GL_EXT_samplerless_texture_functions : require
layout(local_size_x = 1) in;
layout(binding = 0) buffer Out { uint r[8]; };
layout(binding = 1) buffer S { uint pad; uint s[]; };
layout(binding = 2) uniform U { uvec4 u; };
layout(binding = 3) uniform utextureBuffer t;
layout(binding = 4) uniform utexture2D i;
layout(binding = 5, r32ui) uniform uimage2D w;
void main() {
  s[3] = 5;
  imageStore(w, ivec2(0), uvec4(9));
  r[0] = s[2]; r[1] = u.y; r[2] = texelFetch(t, 0).x; r[3] = texelFetch(i, ivec2(0), 0).x; r[4] = imageLoad(w, ivec2(0)).x;
  r[5] = s.length(); r[6] = textureSize(i, 0).x + imageSize(w).y + textureSize(t); r[7] = 77;
}
)", ShaderTarget::kVulkan13), layout);
  VkDescriptorPool pool = makePool(work, {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2}, {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1}, {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, 1},
                                          {VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, 1}, {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, 1}});
  VkDescriptorSet set = makeSet(work, pool, setLayout);
  Buffer out = work.bufferOf(Words(8, 1), kStorage);
  VkDescriptorBufferInfo outInfo{out.handle, 0, VK_WHOLE_SIZE}, none{VK_NULL_HANDLE, 0, VK_WHOLE_SIZE};
  VkDescriptorImageInfo noImage{VK_NULL_HANDLE, VK_NULL_HANDLE, VK_IMAGE_LAYOUT_GENERAL};
  VkBufferView noView = VK_NULL_HANDLE;
  std::vector<VkWriteDescriptorSet> writes = {
      writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &outInfo), writeBuffer(set, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &none),
      writeBuffer(set, 2, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, &none), writeBuffer(set, 3, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, nullptr),
      writeBuffer(set, 4, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, nullptr), writeBuffer(set, 5, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, nullptr)};
  writes[3].pTexelBufferView = &noView;
  writes[4].pImageInfo = writes[5].pImageInfo = &noImage;
  vkUpdateDescriptorSets(device().handle, uint32_t(writes.size()), writes.data(), 0, nullptr);
  device().run([&](VkCommandBuffer commands) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
    vkCmdDispatch(commands, 1, 1, 1);
    fullBarrier(commands);
  });
  expect(valuesOf<uint32_t>(wordsOf(bytesOf(out))), Words{0, 0, 0, 0, 0, 0, 0, 77});
}

// Every kind of image, fetched and loaded inside, just outside and absurdly far outside, in coordinates, layers and levels.
TEST_P(RobustnessFeatures, ImageAccess2) {
  PUMICE_NEED_FEATURE(device().robustness2.robustImageAccess2);
  struct Kind {
    const char *name, *sampler, *image, *coordinate;
    int components;
    VkImageType type;
    VkImageViewType view;
    VkExtent3D extent;
    uint32_t layers, mips;
  };
  const Kind kinds[] = {
      {"1D", "texture1D", "image1D", "int(q0.x)", 1, VK_IMAGE_TYPE_1D, VK_IMAGE_VIEW_TYPE_1D, {7, 1, 1}, 1, 2},
      {"1DArray", "texture1DArray", "image1DArray", "q0.xy", 2, VK_IMAGE_TYPE_1D, VK_IMAGE_VIEW_TYPE_1D_ARRAY, {7, 1, 1}, 3, 1},
      {"2D", "texture2D", "image2D", "q0.xy", 2, VK_IMAGE_TYPE_2D, VK_IMAGE_VIEW_TYPE_2D, {5, 3, 1}, 1, 2},
      {"2DArray", "texture2DArray", "image2DArray", "q0.xyz", 3, VK_IMAGE_TYPE_2D, VK_IMAGE_VIEW_TYPE_2D_ARRAY, {5, 3, 1}, 4, 2},
      {"3D", "texture3D", "image3D", "q0.xyz", 3, VK_IMAGE_TYPE_3D, VK_IMAGE_VIEW_TYPE_3D, {5, 3, 4}, 1, 2},
  };
  const int far[] = {-1, 0x7fffffff, int(0x80000000u), 0x10000, 0x40000000, -2};
  for (const Kind& kind : kinds)
    for (VkFormat format : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R32_SFLOAT}) {
      Workspace work(device());
      ImageSpec spec;
      spec.type = kind.type;
      spec.format = format;
      spec.extent = kind.extent;
      spec.layers = kind.layers;
      spec.mips = kind.mips;
      spec.usage |= VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT;
      Image image = work.image(spec);
      toGeneral(work, image);
      device().run([&](VkCommandBuffer c) {
        VkClearColorValue value{{0.2f, 0.4f, 0.6f, 0.8f}};
        VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
        vkCmdClearColorImage(c, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &all);
        fullBarrier(c);
      });
      ViewSpec whole{kind.view}, base{kind.view};
      base.mips = 1;
      VkImageView sampled = makeView(work, image, whole), stored = makeView(work, image, base);
      const int size[3] = {int(kind.extent.width), kind.type == VK_IMAGE_TYPE_1D ? int(kind.layers) : int(kind.extent.height),
                           kind.type == VK_IMAGE_TYPE_3D ? int(kind.extent.depth) : int(kind.layers)};
      std::vector<glm::ivec4> questions;   // coordinate and level
      auto ask = [&](int x, int y, int z, int level) {
        const int c[3] = {x, y, z};
        glm::ivec4 q(0, 0, 0, level);
        for (int i = 0; i < kind.components; i++) q[i] = c[i];
        questions.push_back(q);
      };
      ask(0, 0, 0, 0);
      ask(size[0] - 1, size[1] - 1, size[2] - 1, 0);
      for (int axis = 0; axis < kind.components; axis++) {
        std::vector<int> values(std::begin(far), std::end(far));
        values.push_back(size[axis]);
        for (int v : values) ask(axis == 0 ? v : 1, axis == 1 ? v : 1, axis == 2 ? v : 1, 0);
      }
      if (kind.mips > 1) ask(0, 0, 0, 1);
      for (int level : {int(kind.mips), -1, 0x7fffffff, int(0x80000000u), 40}) ask(0, 0, 0, level);
      std::vector<glm::vec4> bits(questions.size());
      std::memcpy(bits.data(), questions.data(), questions.size() * 16);
      const std::string coordinate = kind.coordinate;
      const bool four = format == VK_FORMAT_R8G8B8A8_UNORM;
      const std::string declarations = "layout(binding = 2) uniform " + std::string(kind.sampler) + " t;\nlayout(binding = 3, " +
                                       (four ? "rgba8" : "r32f") + ") uniform " + kind.image + " s;\n";
      Binding texture = sampledBinding(sampled, VK_NULL_HANDLE);
      texture.type = VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE;
      const std::string take = "  ivec4 q0 = floatBitsToInt(ask(0));\n";
      const std::vector<Binding> bindings = {texture, storageBinding(stored)};
      std::vector<glm::vec4> fetched = probe(work, "#extension GL_EXT_samplerless_texture_functions : require\n" + declarations,
                                             take + "  answer = texelFetch(t, " + coordinate + ", q0.w);", bindings, bits);
      std::vector<glm::vec4> loaded = probe(work, "#extension GL_EXT_samplerless_texture_functions : require\n" + declarations,
                                            take + "  answer = imageLoad(s, " + coordinate + ");", bindings, bits);
      // What is stored outside vanishes.
      probe(work, "#extension GL_EXT_samplerless_texture_functions : require\n" + declarations,
            take + "  if (gl_GlobalInvocationID.x >= 2 && q0.w == 0) imageStore(s, " + coordinate + ", vec4(1));", bindings, bits);
      std::vector<glm::vec4> after = probe(work, "#extension GL_EXT_samplerless_texture_functions : require\n" + declarations,
                                           take + "  answer = imageLoad(s, " + coordinate + ");", bindings, bits);
      const glm::vec4 inside = four ? glm::vec4(0.2f, 0.4f, 0.6f, 0.8f) : glm::vec4(0.2f, 0, 0, 1), outside(0, 0, 0, four ? 0 : 1);
      for (size_t i = 0; i < questions.size(); i++) {
        const glm::ivec4 q = questions[i];
        bool in = true;
        for (int k = 0; k < kind.components; k++) in &= q[k] >= 0 && q[k] < size[k];
        const bool level = q.w >= 0 && q.w < int(kind.mips);
        SCOPED_TRACE(testing::Message() << kind.name << " format " << format << " at " << q.x << " " << q.y << " " << q.z << " level " << q.w);
        auto same = [](glm::vec4 a, glm::vec4 b) { return glm::all(glm::lessThan(glm::abs(a - b), glm::vec4(1e-6f))); };
        const glm::vec4 t = fetched[i], s = loaded[i];
        EXPECT_TRUE(same(t, in && level ? inside : outside)) << "fetched " << t.x << " " << t.y << " " << t.z << " " << t.w;
        EXPECT_TRUE(same(s, in ? inside : outside)) << "loaded " << s.x << " " << s.y << " " << s.z << " " << s.w;
        EXPECT_TRUE(same(after[i], s)) << "a store outside has arrived inside";
      }
    }
}

PUMICE_ON_BOTH_DEVICES(RobustnessFeatures);

}  // namespace
}  // namespace pumice::cts
