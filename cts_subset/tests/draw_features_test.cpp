// What 1.1 to 1.3 and extensions brought to draws: dynamic state, parameters, indices, attributes; shaders of the graphics stages.
#include "cts_subset/tests/graphics.h"

namespace pumice::cts {
namespace {

class DrawFeatures : public DrawTest {};

const char* const kPassedFragment = R"(#version 460
layout(location = 0) flat in uvec4 passed;
layout(location = 0) out uvec4 color;
void main() { color = passed; }
)";

TEST_P(DrawFeatures, ExtendedDynamicState) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  Image image = target(kUint), depthImage = target(VK_FORMAT_D32_SFLOAT);
  VkImageView view = work->view(image), depthView = work->view(depthImage);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.vertex = R"(#version 460
layout(location = 0) in vec2 position;
layout(push_constant) uniform P { vec4 given; };
void main() { gl_Position = vec4(position, given.w, 1); }
)";
  spec.fragment = kGivenFragment;
  spec.colors = {kUint};
  spec.depth = VK_FORMAT_D32_SFLOAT;
  spec.bindings = {{0, 0, VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32G32_SFLOAT, 0}};
  spec.dynamic = {VK_DYNAMIC_STATE_CULL_MODE, VK_DYNAMIC_STATE_FRONT_FACE, VK_DYNAMIC_STATE_PRIMITIVE_TOPOLOGY, VK_DYNAMIC_STATE_VERTEX_INPUT_BINDING_STRIDE,
                  VK_DYNAMIC_STATE_DEPTH_TEST_ENABLE, VK_DYNAMIC_STATE_DEPTH_WRITE_ENABLE, VK_DYNAMIC_STATE_DEPTH_COMPARE_OP, VK_DYNAMIC_STATE_DEPTH_BOUNDS_TEST_ENABLE,
                  VK_DYNAMIC_STATE_STENCIL_TEST_ENABLE, VK_DYNAMIC_STATE_STENCIL_OP, VK_DYNAMIC_STATE_RASTERIZER_DISCARD_ENABLE, VK_DYNAMIC_STATE_DEPTH_BIAS_ENABLE,
                  VK_DYNAMIC_STATE_PRIMITIVE_RESTART_ENABLE, VK_DYNAMIC_STATE_VIEWPORT_WITH_COUNT, VK_DYNAMIC_STATE_SCISSOR_WITH_COUNT};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  // Each vertex is followed by one that a wrong stride would take.
  const float corners[] = {-1, -1, 9, 9, 3, -1, 9, 9, -1, 3, 9, 9};
  Buffer vertices = work->buffer(sizeof corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT, corners);
  device().run([&](VkCommandBuffer c) {
    VkClearValue clear{}, far{};
    far.depthStencil.depth = 1;
    std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    VkRenderingAttachmentInfo depth = rendered(depthView, VK_ATTACHMENT_LOAD_OP_CLEAR, far);
    VkRenderingInfo info = renderingInfo(kSize, colors);
    info.pDepthAttachment = &depth;
    vkCmdBeginRendering(c, &info);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    VkViewport viewport{0, 0, 8, 8, 0, 1};
    vkCmdSetViewportWithCount(c, 1, &viewport);
    VkDeviceSize offset = 0, size = sizeof corners, stride = 16;
    vkCmdBindVertexBuffers2(c, 0, 1, &vertices.handle, &offset, &size, &stride);
    vkCmdSetCullMode(c, VK_CULL_MODE_NONE);
    vkCmdSetFrontFace(c, VK_FRONT_FACE_CLOCKWISE);
    vkCmdSetPrimitiveTopology(c, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST);
    vkCmdSetDepthTestEnable(c, VK_TRUE);
    vkCmdSetDepthWriteEnable(c, VK_TRUE);
    vkCmdSetDepthCompareOp(c, VK_COMPARE_OP_LESS);
    vkCmdSetDepthBoundsTestEnable(c, VK_FALSE);
    vkCmdSetStencilTestEnable(c, VK_FALSE);
    vkCmdSetStencilOp(c, VK_STENCIL_FACE_FRONT_AND_BACK, VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_STENCIL_OP_KEEP, VK_COMPARE_OP_ALWAYS);
    vkCmdSetRasterizerDiscardEnable(c, VK_FALSE);
    vkCmdSetDepthBiasEnable(c, VK_FALSE);
    vkCmdSetPrimitiveRestartEnable(c, VK_FALSE);
    // Column n is drawn by step n.
    uint32_t column = 0;
    auto step = [&](float value, float z, const std::function<void()>& change) {
      VkRect2D scissor{{int32_t(column++), 0}, {1, 8}};
      vkCmdSetScissorWithCount(c, 1, &scissor);
      drawWhole(c, layout, 1);
      change();
      drawWhole(c, layout, value, z);
    };
    step(2, 0.4f, [] {});                                                                // nearer: 2
    step(3, 0.6f, [] {});                                                                // farther: 1
    step(4, 0.6f, [&] { vkCmdSetDepthTestEnable(c, VK_FALSE); });                        // no test: 4
    vkCmdSetDepthTestEnable(c, VK_TRUE);
    step(5, 0.6f, [&] { vkCmdSetDepthCompareOp(c, VK_COMPARE_OP_GREATER); });            // 5
    vkCmdSetDepthCompareOp(c, VK_COMPARE_OP_LESS);
    step(6, 0.4f, [&] { vkCmdSetCullMode(c, VK_CULL_MODE_FRONT_BIT); });                 // clockwise is front: culled, 1
    step(7, 0.4f, [&] { vkCmdSetFrontFace(c, VK_FRONT_FACE_COUNTER_CLOCKWISE); });       // no longer: 7 (the first draw too)
    vkCmdSetCullMode(c, VK_CULL_MODE_NONE);
    step(8, 0.4f, [&] { vkCmdSetRasterizerDiscardEnable(c, VK_TRUE); });                 // 1
    vkCmdSetRasterizerDiscardEnable(c, VK_FALSE);
    step(9, 0.4f, [&] { vkCmdSetPrimitiveTopology(c, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP); });   // 9
    vkCmdEndRendering(c);
    fullBarrier(c);
  });
  Words p = pixels(image);
  const uint32_t expected[8] = {2, 1, 4, 5, 1, 7, 1, 9};
  for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(at(p, x, 3, 0), expected[x]) << "column " << x;
}

TEST_P(DrawFeatures, DrawParametersAndIndirectCount) {
  PUMICE_NEED_FEATURE(device().vulkan11.shaderDrawParameters && device().vulkan12.drawIndirectCount && device().features.multiDrawIndirect &&
                      device().features.drawIndirectFirstInstance && device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
  spec.vertex = R"(#version 460
layout(location = 0) flat out uvec4 passed;
void main() {
  passed = uvec4(gl_BaseVertex, gl_BaseInstance, gl_DrawID, gl_VertexIndex * 100 + gl_InstanceIndex);
  gl_Position = vec4((gl_DrawID + 0.5) / 4.0 - 1.0, 0.125, 0.5, 1);
  gl_PointSize = 1.0;
}
)";
  spec.fragment = kPassedFragment;
  spec.colors = {kUint};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  std::vector<VkDrawIndirectCommand> draws;
  for (uint32_t i = 0; i < 8; i++) draws.push_back({1, 1, 10 + i, 3 * i});
  Buffer commandsBuffer = work->bufferOf(draws, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  Buffer count = work->bufferOf(Words{0, 5}, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  drawInto(view, pipeline, [&](VkCommandBuffer c) {
    vkCmdDrawIndirectCount(c, commandsBuffer.handle, 0, count.handle, 4, 8, sizeof(VkDrawIndirectCommand));
  });
  Words p = pixels(image);
  for (uint32_t i = 0; i < 8; i++) {
    SCOPED_TRACE(testing::Message() << "draw " << i);
    bool drawn = i < 5;
    EXPECT_EQ(at(p, i, 4, 0), drawn ? 10 + i : 0);
    EXPECT_EQ(at(p, i, 4, 1), drawn ? 3 * i : 0);
    EXPECT_EQ(at(p, i, 4, 2), drawn ? i : 0);
    EXPECT_EQ(at(p, i, 4, 3), drawn ? (10 + i) * 100 + 3 * i : 0);
  }
}

// Indices of one byte with restarts in a list, several draws of one command, attributes that advance every third instance,
// and an attribute that lies beyond the buffer in part.
TEST_P(DrawFeatures, IndicesDrawsAndAttributesOfExtensions) {
  PUMICE_NEED_FEATURE(device().indexTypeUint8.indexTypeUint8 && device().listRestart.primitiveTopologyListRestart && device().multiDraw.multiDraw &&
                      device().divisor.vertexAttributeInstanceRateDivisor && device().divisor.vertexAttributeInstanceRateZeroDivisor &&
                      device().robustness2.robustBufferAccess2 && device().vulkan13.dynamicRendering);
  auto drawMulti = reinterpret_cast<PFN_vkCmdDrawMultiEXT>(vkGetDeviceProcAddr(handle(), "vkCmdDrawMultiEXT"));
  auto drawMultiIndexed = reinterpret_cast<PFN_vkCmdDrawMultiIndexedEXT>(vkGetDeviceProcAddr(handle(), "vkCmdDrawMultiIndexedEXT"));
  ASSERT_TRUE(drawMulti && drawMultiIndexed);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
  // A point at column VertexIndex, row InstanceIndex.
  spec.vertex = R"(#version 460
layout(location = 0) in uint slow;
layout(location = 1) in uint never;
layout(location = 2) in uvec3 beyond;
layout(location = 0) flat out uvec4 passed;
void main() {
  passed = uvec4(slow, never, gl_DrawID, beyond.x + beyond.y + beyond.z + 1);
  gl_Position = vec4((gl_VertexIndex + 0.5) / 4.0 - 1.0, (gl_InstanceIndex + 0.5) / 4.0 - 1.0, 0.5, 1);
  gl_PointSize = 1.0;
}
)";
  spec.fragment = kPassedFragment;
  spec.colors = {kUint};
  spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_INSTANCE}, {1, 4, VK_VERTEX_INPUT_RATE_INSTANCE}, {2, 12, VK_VERTEX_INPUT_RATE_VERTEX}};
  spec.attributes = {{0, 0, VK_FORMAT_R32_UINT, 0}, {1, 1, VK_FORMAT_R32_UINT, 0}, {2, 2, VK_FORMAT_R32G32B32_UINT, 0}};
  const VkVertexInputBindingDivisorDescriptionEXT divisors[2] = {{0, 3}, {1, 0}};
  VkPipelineVertexInputDivisorStateCreateInfoEXT divisorInfo{VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_DIVISOR_STATE_CREATE_INFO_EXT, nullptr, 2, divisors};
  spec.inputNext = &divisorInfo;
  spec.primitiveRestart = true;
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  Buffer slow = work->bufferOf(Words{10, 20, 30, 40, 50, 60, 70, 80}, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  // Two whole vertices, then two of the third one's three words.
  Buffer beyond = work->bufferOf(Words{1, 2, 3, 4, 5, 6, 7, 8}, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  const uint8_t bytes[8] = {0, 0xff, 2, 1, 3, 0xff, 4, 0};
  Buffer indices = work->buffer(sizeof bytes, VK_BUFFER_USAGE_INDEX_BUFFER_BIT, bytes);
  drawInto(view, pipeline, [&](VkCommandBuffer c) {
    VkBuffer buffers[3] = {slow.handle, slow.handle, beyond.handle};
    VkDeviceSize offsets[3]{};
    vkCmdBindVertexBuffers(c, 0, 3, buffers, offsets);
    vkCmdBindIndexBuffer(c, indices.handle, 0, VK_INDEX_TYPE_UINT8_EXT);
    // Rows 1 to 5: vertices 0 and 2 by the first draw, 3 and 4 by the second (with the restarts between them).
    const VkMultiDrawIndexedInfoEXT indexed[2] = {{0, 3, 0}, {4, 3, 0}};
    drawMultiIndexed(c, 2, indexed, 5, 1, sizeof(VkMultiDrawIndexedInfoEXT), nullptr);
    // Row 7: vertices 0 and 5.
    const VkMultiDrawInfoEXT plain[2] = {{0, 1}, {5, 1}};
    drawMulti(c, 2, plain, 1, 7, sizeof(VkMultiDrawInfoEXT));
  });
  Words p = pixels(image);
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << " " << y);
      bool first = y >= 1 && y <= 5 && (x == 0 || x == 2 || x == 3 || x == 4), last = y == 7 && (x == 0 || x == 5);
      EXPECT_EQ(at(p, x, y, 0), first ? 20 + (y - 1) / 3 * 10 : last ? 80u : 0u);
      EXPECT_EQ(at(p, x, y, 1), first ? 20u : last ? 80u : 0u);
      if (GetParam() == Role::kTested || !first) {   // lavapipe 22.3 forgets the draw's number where indices restart
        EXPECT_EQ(at(p, x, y, 2), (first && x >= 3) || (last && x == 5) ? 1u : 0u);
      }
      EXPECT_EQ(at(p, x, y, 3), first || last ? (x == 0 ? 7u : 1u) : 0u);
    }
}

// Subgroups of the other stages: whatever their lanes are, the operations agree with each other.
TEST_P(DrawFeatures, SubgroupsOfVertexAndFragmentShaders) {
  const auto v11 = properties<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES);
  constexpr VkSubgroupFeatureFlags kNeeded = VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT | VK_SUBGROUP_FEATURE_QUAD_BIT;
  PUMICE_NEED_FEATURE((v11.subgroupSupportedStages & kGraphics) == kGraphics && (v11.subgroupSupportedOperations & kNeeded) == kNeeded &&
                      device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.vertex = R"(#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) flat out uint right;
void main() {
  gl_Position = vec4(vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 2 - 1, given.w, 1);
  uint lanes = subgroupBallotBitCount(subgroupBallot(true));
  right = subgroupAdd(1u) == lanes && lanes >= 1 && subgroupInclusiveAdd(1u) <= lanes && subgroupBroadcastFirst(5u) == 5u ? 1u : 0u;
}
)";
  spec.fragment = R"(#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_quad : require
layout(location = 0) flat in uint right;
layout(location = 0) out uvec4 color;
void main() {
  uint lanes = subgroupBallotBitCount(subgroupBallot(true)), x = uint(gl_FragCoord.x), y = uint(gl_FragCoord.y);
  bool ok = subgroupAdd(1u) == lanes && subgroupMax(gl_SubgroupInvocationID) < gl_SubgroupSize && lanes >= 4;
  color = uvec4(right, ok ? 1 : 0, subgroupQuadSwapHorizontal(x) * 10 + subgroupQuadSwapVertical(y), gl_SubgroupSize);
}
)";
  spec.colors = {kUint};
  VkPipeline pipeline = makeGraphics(*work, layout, spec);
  drawInto(view, pipeline, [&](VkCommandBuffer c) { drawWhole(c, layout); });
  Words p = pixels(image);
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << " " << y);
      EXPECT_EQ(at(p, x, y, 0), 1u);
      EXPECT_EQ(at(p, x, y, 1), 1u);
      EXPECT_EQ(at(p, x, y, 2), (x ^ 1) * 10 + (y ^ 1));
      EXPECT_EQ(at(p, x, y, 3), v11.subgroupSize);
    }
}

TEST_P(DrawFeatures, DemoteAndTerminate) {
  PUMICE_NEED_FEATURE(device().vulkan13.shaderDemoteToHelperInvocation && device().vulkan13.shaderTerminateInvocation && device().vulkan13.dynamicRendering);
  Image image = target(kUint);
  VkImageView view = work->view(image);
  VkPipelineLayout layout = pushLayout();
  GraphicsSpec spec;
  spec.colors = {kUint};
  // A demoted invocation goes on for its neighbours' derivatives.
  const char* fragments[2] = {R"(#version 460
#extension GL_EXT_demote_to_helper_invocation : require
layout(location = 0) out uvec4 color;
void main() {
  uint x = uint(gl_FragCoord.x);
  if ((x & 1) == 1) demote;
  float d = dFdx(gl_FragCoord.x * 3.0);
  color = uvec4(uint(d), helperInvocationEXT() ? 1 : 0, x, 5);
}
)",
                              R"(#version 460
#extension GL_EXT_terminate_invocation : require
layout(location = 0) out uvec4 color;
void main() {
  uint x = uint(gl_FragCoord.x);
  if ((x & 2) == 2) terminateInvocation;
  color = uvec4(8, 0, x, 5);
}
)"};
  for (int i = 0; i < 2; i++) {
    spec.fragment = fragments[i];
    VkPipeline pipeline = makeGraphics(*work, layout, spec);
    drawInto(view, pipeline, [&](VkCommandBuffer c) { drawWhole(c, layout); }, 99);
    Words p = pixels(image);
    for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(at(p, x, 5, 0), (i ? x & 2 : x & 1) ? 99u : i ? 8u : 3u) << x;
    if (!i) {
      EXPECT_EQ(at(p, 2, 5, 1), 0u) << "not a helper";
    }
  }
}

PUMICE_ON_BOTH_DEVICES(DrawFeatures);

}  // namespace
}  // namespace pumice::cts
