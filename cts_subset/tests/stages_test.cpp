// What vertex and fragment shaders hand to each other beside 32-bit numbers, and what they may ask of their subgroups.
#include "cts_subset/tests/graphics.h"

#include <bit>

namespace pumice::cts {
namespace {

constexpr VkExtent2D kSize{8, 1};
constexpr VkFormat kUint = VK_FORMAT_R32G32B32A32_UINT;
constexpr VkShaderStageFlags kGraphics = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

// A vertex for each pixel of a row; shaders write `words` words of a storage buffer.
class Stages : public OnDevice {
 protected:
  Words draw(GraphicsSpec spec, const Bytes& vertices, size_t words, uint32_t points = kSize.width) {
    Workspace work(device());
    ImageSpec imageSpec;
    imageSpec.format = kUint;
    imageSpec.extent = {kSize.width, kSize.height, 1};
    imageSpec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    Image image = work.image(imageSpec);
    Buffer target = work.bufferOf(Words(words, 0xcdcdcdcd), kStorage);
    Buffer source = work.bufferOf(vertices.empty() ? Bytes(16) : vertices, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    DescriptorSet set = work.descriptors({bufferBinding(target)});
    VkPipelineLayout layout = makePipelineLayout(work, {set.layout});
    spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
    spec.colors = {kUint};
    VkPipeline pipeline = makeGraphics(work, layout, spec);
    VkImageView view = work.view(image);
    device().run([&](VkCommandBuffer c) {
      transition(c, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
      std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR)};
      VkRenderingInfo rendering = renderingInfo(kSize, colors);
      vkCmdBeginRendering(c, &rendering);
      wholeTarget(c, kSize);
      vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
      vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set.handle, 0, nullptr);
      VkDeviceSize zero = 0;
      vkCmdBindVertexBuffers(c, 0, 1, &source.handle, &zero);
      vkCmdDraw(c, points, 1, 0, 0);
      vkCmdEndRendering(c);
      fullBarrier(c);
    });
    Words out(words);
    std::memcpy(out.data(), target.mapped, words * 4);
    return out;
  }
};

const std::string kHead = R"(#version 460
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_KHR_shader_subgroup_quad : require
#extension GL_KHR_shader_subgroup_shuffle : require
)";
const std::string kPoint = "gl_PointSize = 1.0; gl_Position = vec4((float(gl_VertexIndex) + 0.5) / 4.0 - 1.0, 0.0, 0.5, 1);\n";

TEST_P(Stages, SixtyFourBitAttributesAndVaryings) {
  PUMICE_NEED_FEATURE(device().features.shaderFloat64 && device().features.shaderInt64 && device().features.fragmentStoresAndAtomics &&
                      device().vulkan13.dynamicRendering);
  struct Vertex {
    double vector[4];
    uint64_t number;
    double pairs[2][2];
  };
  constexpr std::pair<VkFormat, uint32_t> kAttributes[] = {{VK_FORMAT_R64G64B64A64_SFLOAT, 0}, {VK_FORMAT_R64_UINT, 32},
                                                           {VK_FORMAT_R64G64_SFLOAT, 40}, {VK_FORMAT_R64G64_SFLOAT, 56}};
  constexpr uint32_t kLocations[] = {1, 3, 4, 5};
  GraphicsSpec spec;
  spec.bindings = {{0, sizeof(Vertex), VK_VERTEX_INPUT_RATE_VERTEX}};
  for (uint32_t i = 0; i < 4; i++) {
    VkFormatProperties p{};
    vkGetPhysicalDeviceFormatProperties(device().physical, kAttributes[i].first, &p);
    PUMICE_NEED_FEATURE(p.bufferFeatures & VK_FORMAT_FEATURE_VERTEX_BUFFER_BIT);
    spec.attributes.push_back({kLocations[i], 0, kAttributes[i].first, kAttributes[i].second});
  }
  Bytes bytes(8 * sizeof(Vertex));
  for (uint32_t i = 0; i < 8; i++) {
    Vertex v{{1.0 / (i + 3), -1e300 * i, 4e-320 * i, 0.1 + i}, 0x123456789abcdef0ull * (i + 1), {{i + 1e-15, -0.0}, {1e17 + 16 * i, 1.0 / 3}}};
    std::memcpy(&bytes[i * sizeof v], &v, sizeof v);
  }
  spec.vertex = kHead + R"(
layout(location = 1) in dvec4 vector;
layout(location = 3) in uint64_t number;
layout(location = 4) in dvec2 pairs[2];
layout(location = 0) flat out uint64_t a;
layout(location = 2) flat out dvec4 b;
layout(location = 5) flat out dvec2 c[2];
layout(location = 9, component = 2) flat out double d;
layout(location = 9) flat out uint e;
void main() { a = number; b = vector; c = pairs; d = vector.z; e = uint(number >> 7);
)" + kPoint + "}\n";
  spec.fragment = kHead + R"(
layout(location = 0) flat in uint64_t a;
layout(location = 2) flat in dvec4 b;
layout(location = 5) flat in dvec2 c[2];
layout(location = 9, component = 2) flat in double d;
layout(location = 9) flat in uint e;
layout(binding = 0) buffer Out { uint64_t r[]; };
layout(location = 0) out uvec4 color;
uint64_t bits(double x) { return packUint2x32(unpackDouble2x32(x)); }
void main() {
  uint i = uint(gl_FragCoord.x) * 11;
  for (int k = 0; k < 4; k++) r[i + k] = bits(b[k]);
  r[i + 4] = a; r[i + 5] = bits(c[0].x); r[i + 6] = bits(c[0].y); r[i + 7] = bits(c[1].x); r[i + 8] = bits(c[1].y);
  r[i + 9] = bits(d); r[i + 10] = e;
  color = uvec4(1);
}
)";
  Words r = draw(spec, bytes, 8 * 11 * 2);
  auto wide = [&](uint32_t i) { return r[2 * i] | uint64_t(r[2 * i + 1]) << 32; };
  for (uint32_t i = 0; i < 8; i++) {
    uint64_t expected[11];
    std::memcpy(expected, &bytes[i * sizeof(Vertex)], sizeof(Vertex));
    expected[9] = expected[2];
    expected[10] = uint32_t(expected[4] >> 7);
    for (uint32_t k = 0; k < 11; k++) EXPECT_EQ(wide(i * 11 + k), expected[k]) << "pixel " << i << ", scalar " << k;
  }
}

TEST_P(Stages, SixteenBitInputsAndOutputs) {
  PUMICE_NEED_FEATURE(device().vulkan11.storageInputOutput16 && device().features.shaderInt16 && device().vulkan12.shaderFloat16 &&
                      device().features.fragmentStoresAndAtomics && device().vulkan13.dynamicRendering);
  GraphicsSpec spec;
  spec.bindings = {{0, 12, VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R16G16_SFLOAT, 0}, {1, 0, VK_FORMAT_R16G16_SINT, 4}, {2, 0, VK_FORMAT_R16G16_UINT, 8}};
  Bytes bytes;
  for (uint16_t i = 0; i < 8; i++)
    for (uint16_t v : {uint16_t(0x3c00 + i), uint16_t(0x0001 + i), uint16_t(-3000 - i), uint16_t(7 + i), uint16_t(65535 - i), uint16_t(i)})
      bytes.insert(bytes.end(), {uint8_t(v), uint8_t(v >> 8)});
  spec.vertex = kHead + R"(
layout(location = 0) in f16vec2 f;
layout(location = 1) in i16vec2 s;
layout(location = 2) in u16vec2 u;
layout(location = 0) out f16vec2 smooth_;
layout(location = 1) flat out i16vec2 si;
layout(location = 2) flat out u16vec2 ui;
layout(location = 3) flat out f16vec2 fi;
void main() { smooth_ = f16vec2(f.x * float16_t(2), 0.25); si = s; ui = u; fi = f;
)" + kPoint + "}\n";
  spec.fragment = kHead + R"(
layout(location = 0) in f16vec2 smooth_;
layout(location = 1) flat in i16vec2 si;
layout(location = 2) flat in u16vec2 ui;
layout(location = 3) flat in f16vec2 fi;
layout(binding = 0) buffer Out { uint r[]; };
layout(location = 0) out u16vec4 color;
void main() {
  uint i = uint(gl_FragCoord.x) * 6;
  r[i] = packFloat2x16(fi); r[i + 1] = uint(int(si.x)); r[i + 2] = uint(int(si.y)); r[i + 3] = uint(ui.x); r[i + 4] = uint(ui.y);
  r[i + 5] = packFloat2x16(smooth_);
  color = u16vec4(ui, 3, 4);
}
)";
  Words r = draw(spec, bytes, 8 * 6);
  for (uint32_t i = 0; i < 8; i++) {
    const uint32_t* w = &r[i * 6];
    EXPECT_EQ(w[0], 0x00013c00u + i * 0x10001u);
    EXPECT_EQ(int(w[1]), -3000 - int(i));
    EXPECT_EQ(w[2], 7 + i);
    EXPECT_EQ(w[3], 65535 - i);
    EXPECT_EQ(w[4], i);
    EXPECT_EQ(w[5], 0x34004000u + i);
  }
}

TEST_P(Stages, QuadsOfVertices) {
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  PUMICE_NEED_FEATURE(v11.subgroupQuadOperationsInAllStages && (v11.subgroupSupportedStages & VK_SHADER_STAGE_VERTEX_BIT) &&
                      (v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_SHUFFLE_BIT) && device().features.vertexPipelineStoresAndAtomics &&
                      device().vulkan13.dynamicRendering);
  GraphicsSpec spec;
  spec.vertex = kHead + R"(
layout(binding = 0) buffer Out { uint r[]; };
void main() {
  uint i = gl_VertexIndex, v = i * i + 5, lane = gl_SubgroupInvocationID;
  uint wrong = 0;
  if (subgroupQuadSwapHorizontal(v) != subgroupShuffle(v, lane ^ 1)) wrong |= 1;
  if (subgroupQuadSwapVertical(v) != subgroupShuffle(v, lane ^ 2)) wrong |= 2;
  if (subgroupQuadSwapDiagonal(v) != subgroupShuffle(v, lane ^ 3)) wrong |= 4;
  if (subgroupQuadBroadcast(v, 2) != subgroupShuffle(v, (lane & ~3u) | 2)) wrong |= 8;
  if (subgroupQuadBroadcast(v, 2) == 0) wrong |= 16;
  r[i] = wrong;
)" + kPoint + "}\n";
  spec.fragment = "#version 460\nlayout(location = 0) out uvec4 color;\nvoid main() { color = uvec4(1); }\n";
  EXPECT_EQ(draw(spec, {}, 64, 64), Words(64, 0));
}

TEST_P(Stages, RequiredSubgroupSize) {
  const auto v13 = properties<VkPhysicalDeviceVulkan13Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES);
  PUMICE_NEED_FEATURE(device().vulkan13.subgroupSizeControl && (v13.requiredSubgroupSizeStages & kGraphics) == kGraphics &&
                      device().features.vertexPipelineStoresAndAtomics && device().features.fragmentStoresAndAtomics &&
                      device().vulkan13.dynamicRendering);
  VkPipelineShaderStageRequiredSubgroupSizeCreateInfo required{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO, nullptr, v13.maxSubgroupSize};
  GraphicsSpec spec;
  spec.stageNext = &required;
  spec.vertex = kHead + "layout(binding = 0) buffer Out { uint r[]; };\nvoid main() { r[gl_VertexIndex] = gl_SubgroupSize;\n" + kPoint + "}\n";
  spec.fragment = kHead + "layout(binding = 0) buffer Out { uint r[]; };\nlayout(location = 0) out uvec4 color;\n"
                          "void main() { r[8 + int(gl_FragCoord.x)] = gl_SubgroupSize; color = uvec4(1); }\n";
  EXPECT_EQ(draw(spec, {}, 16), Words(16, v13.maxSubgroupSize));
}

// The alpha of location 0 decides about coverage although there is no attachment for it.
TEST_P(Stages, AlphaToCoverageWithoutAttachment) {
  PUMICE_NEED_FEATURE(device().features.occlusionQueryPrecise && device().vulkan13.dynamicRendering);
  for (VkFormat format : {VK_FORMAT_UNDEFINED, VK_FORMAT_R8G8B8A8_UNORM})
    for (uint32_t alpha : {0u, 1u}) {
      SCOPED_TRACE(testing::Message() << "format " << format << " alpha " << alpha);
      Workspace work(device());
      GraphicsSpec spec;
      spec.colors = {format};
      spec.samples = VK_SAMPLE_COUNT_4_BIT;
      spec.alphaToCoverage = true;
      spec.fragment = "#version 460\nlayout(push_constant) uniform P { vec4 given; };\nlayout(location = 0) out vec4 color;\n"
                      "void main() { color = vec4(1, 1, 1, given.x); }\n";
      VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
      VkPipeline pipeline = makeGraphics(work, layout, spec);
      VkQueryPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_OCCLUSION, 1, 0};
      VkQueryPool queries = work.make(poolInfo);
      ImageSpec imageSpec;
      imageSpec.extent = {kSize.width, kSize.height, 1};
      imageSpec.samples = VK_SAMPLE_COUNT_4_BIT;
      imageSpec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
      Image image = work.image(imageSpec);
      VkImageView view = format ? work.view(image) : VkImageView(VK_NULL_HANDLE);
      device().run([&](VkCommandBuffer c) {
        vkCmdResetQueryPool(c, queries, 0, 1);
        transition(c, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
        std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR)};
        VkRenderingInfo rendering = renderingInfo(kSize, colors);
        vkCmdBeginRendering(c, &rendering);
        wholeTarget(c, kSize);
        vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        float given[4] = {float(alpha), 0, 0, 0.5f};
        vkCmdPushConstants(c, layout, kGraphics, 0, sizeof given, given);
        vkCmdBeginQuery(c, queries, 0, VK_QUERY_CONTROL_PRECISE_BIT);
        vkCmdDraw(c, 3, 1, 0, 0);
        vkCmdEndQuery(c, queries, 0);
        vkCmdEndRendering(c);
      });
      uint64_t samples = 77;
      check(vkGetQueryPoolResults(device().handle, queries, 0, 1, 8, &samples, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
            "vkGetQueryPoolResults");
      EXPECT_EQ(samples, alpha * 4 * kSize.width * kSize.height);
    }
}

// Lanes that went different ways are together again behind the branch, as often as the subgroup entered it together.
TEST_P(Stages, SubgroupUniformControlFlow) {
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  PUMICE_NEED_FEATURE(device().subgroupUniformFlow.shaderSubgroupUniformControlFlow &&
                      (v11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_ARITHMETIC_BIT));
  Words r = runCompute(device(), R"(
#extension GL_EXT_subgroup_uniform_control_flow : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { uint a[]; };
layout(binding = 1) buffer Out { uint r[]; };
void main() [[subgroup_uniform_control_flow]] {
  uint i = gl_LocalInvocationIndex, lane = gl_SubgroupInvocationID, sum = 0;
  for (uint turn = 0; turn < 3 + gl_SubgroupID; turn++) {
    if ((lane & 1) == 0) {
      for (uint k = 0; k < lane; k++) if (a[k] == i) { sum += 1000000; break; }
    } else {
      switch (lane & 6) { case 2: sum += 100; case 4: sum += 50; break; default: if (a[lane] == 0) continue; }
    }
    sum += subgroupAdd(1u) == gl_SubgroupSize ? 1u : 0u;
  }
  r[i] = sum % 10; r[64 + i] = 3 + gl_SubgroupID;
})", Words(64, 1234), 128);
  for (uint32_t i = 0; i < 64; i++) EXPECT_EQ(r[i], r[64 + i]) << "lane " << i;
}

PUMICE_ON_BOTH_DEVICES(Stages);

}  // namespace
}  // namespace pumice::cts
