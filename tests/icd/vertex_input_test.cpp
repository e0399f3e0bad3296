// Vertex input as dynamic state, and robustness as a pipeline's own choice.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

constexpr VkExtent2D kSize{8, 8};
constexpr const char* kVertex = R"(#version 450
layout(location = 0) in vec2 position; layout(location = 1) in vec4 colour; layout(location = 0) out vec4 passed;
void main() { gl_Position = vec4(position, 0.5, 1.0); passed = colour; }
)";
constexpr const char* kFragment = R"(#version 450
layout(location = 0) in vec4 passed; layout(location = 0) out vec4 c; void main() { c = passed; }
)";

struct Drawing {
  TestDevice device;
  Target target{device, VK_FORMAT_R8G8B8A8_UNORM, kSize};
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipelineLayout layout = target.layout();
  VkShaderModule vertex = device.module(vertexShader(kVertex)), fragment = device.module(fragmentShader(kFragment));
  TestDevice::Buffer readback = device.buffer(8 * 8 * 4), vertices = device.buffer(1024);
  VkPipeline pipeline = VK_NULL_HANDLE;

  ~Drawing() {
    VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
    for (VkShaderModule m : {vertex, fragment}) VK(vkDestroyShaderModule)(device.handle, m, nullptr);
    VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
    VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
    VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
    device.release(readback);
    device.release(vertices);
  }
  template <typename Record>
  uint32_t draw(Record&& record) {
    VkClearValue clear{};
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, kSize}, 1, &clear};
    VkCommandBuffer commands = device.begin();
    VK(vkCmdBeginRenderPass)(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    record(commands);
    VK(vkCmdEndRenderPass)(commands);
    target.read(commands, readback.handle);
    device.run(commands);
    return readback.words[8 * 4 + 4];
  }
};

TEST(DynamicVertexInput, OnePipelineReadsVerticesOfManyShapes) {
  Drawing d;
  const VkDynamicState dynamic = VK_DYNAMIC_STATE_VERTEX_INPUT_EXT;
  VkPipelineDynamicStateCreateInfo dynamicInfo{VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO, nullptr, 0, 1, &dynamic};
  GraphicsPipelineInfo info(d.vertex, d.fragment, d.layout, d.pass, 0, kSize);
  info.info.pDynamicState = &dynamicInfo;
  info.info.pVertexInputState = nullptr;   // ignored
  ASSERT_EQ(VK(vkCreateGraphicsPipelines)(d.device.handle, VK_NULL_HANDLE, 1, &info.info, nullptr, &d.pipeline), VK_SUCCESS);

  // Shape one: positions as floats, colours as bytes, interleaved, 12 bytes each.
  const float positions[3][2] = {{-1, -1}, {3, -1}, {-1, 3}};
  auto* bytes = reinterpret_cast<std::byte*>(d.vertices.words);
  const uint32_t red = 0xff0000ff;
  for (int i = 0; i < 3; i++) {
    std::memcpy(bytes + i * 12, positions[i], 8);
    std::memcpy(bytes + i * 12 + 8, &red, 4);
  }
  // Shape two: 16-bit positions in one binding, one colour for each second instance in another.
  const int16_t shorts[3][2] = {{-32767, -32767}, {32767, -32767}, {-32767, 32767}};
  std::memcpy(bytes + 512, shorts, sizeof shorts);
  const float colours[2][4] = {{0, 1, 0, 1}, {0, 0, 1, 1}};
  std::memcpy(bytes + 768, colours, sizeof colours);

  const auto binding = [](uint32_t number, uint32_t stride, VkVertexInputRate rate, uint32_t divisor) {
    return VkVertexInputBindingDescription2EXT{VK_STRUCTURE_TYPE_VERTEX_INPUT_BINDING_DESCRIPTION_2_EXT, nullptr, number, stride, rate, divisor};
  };
  const auto attribute = [](uint32_t location, uint32_t number, VkFormat format, uint32_t offset) {
    return VkVertexInputAttributeDescription2EXT{VK_STRUCTURE_TYPE_VERTEX_INPUT_ATTRIBUTE_DESCRIPTION_2_EXT, nullptr, location, number, format, offset};
  };
  const VkVertexInputBindingDescription2EXT one[] = {binding(0, 12, VK_VERTEX_INPUT_RATE_VERTEX, 1)};
  const VkVertexInputAttributeDescription2EXT oneAttributes[] = {attribute(0, 0, VK_FORMAT_R32G32_SFLOAT, 0), attribute(1, 0, VK_FORMAT_R8G8B8A8_UNORM, 8)};
  const VkVertexInputBindingDescription2EXT two[] = {binding(3, 4, VK_VERTEX_INPUT_RATE_VERTEX, 1), binding(1, 16, VK_VERTEX_INPUT_RATE_INSTANCE, 2)};
  const VkVertexInputAttributeDescription2EXT twoAttributes[] = {attribute(1, 1, VK_FORMAT_R32G32B32A32_SFLOAT, 0), attribute(0, 3, VK_FORMAT_R16G16_SNORM, 0)};
  const auto shapeOne = [&](VkCommandBuffer c) {
    VkDeviceSize offset = 0;
    VK(vkCmdSetVertexInputEXT)(c, 1, one, 2, oneAttributes);
    VK(vkCmdBindVertexBuffers)(c, 0, 1, &d.vertices.handle, &offset);
    VK(vkCmdDraw)(c, 3, 1, 0, 0);
  };
  const auto shapeTwo = [&](VkCommandBuffer c, uint32_t instances) {
    VkDeviceSize colour = 768, position = 512;
    VK(vkCmdSetVertexInputEXT)(c, 2, two, 2, twoAttributes);
    VK(vkCmdBindVertexBuffers)(c, 1, 1, &d.vertices.handle, &colour);
    VK(vkCmdBindVertexBuffers)(c, 3, 1, &d.vertices.handle, &position);
    VK(vkCmdDraw)(c, 3, instances, 0, 0);
  };
  // The triangle of shape two covers half of the square: the pixel that is read is on its edge's other side.
  EXPECT_EQ(d.draw(shapeOne), 0xff0000ffu);
  EXPECT_EQ(d.draw([&](VkCommandBuffer c) { shapeTwo(c, 2); }) , 0u);
  EXPECT_EQ(d.readback.words[0], 0xff00ff00u) << "both instances take the first colour";
  d.draw([&](VkCommandBuffer c) { shapeTwo(c, 3); });
  EXPECT_EQ(d.readback.words[0], 0xffff0000u) << "the third takes the second";
  EXPECT_EQ(d.draw([&](VkCommandBuffer c) {
    shapeTwo(c, 1);
    shapeOne(c);
  }), 0xff0000ffu) << "both shapes in one pass";
}

// An attribute that is out of bounds in part: what is inside is read, unless the whole is to be out.
TEST(PipelineRobustness, ChoosesHowVerticesOutOfBoundsAreRead) {
  Drawing d;
  VkVertexInputBindingDescription binding{0, 24, VK_VERTEX_INPUT_RATE_VERTEX};
  VkVertexInputAttributeDescription attributes[2] = {{0, 0, VK_FORMAT_R32G32_SFLOAT, 0}, {1, 0, VK_FORMAT_R32G32B32A32_SFLOAT, 8}};
  GraphicsPipelineInfo info(d.vertex, d.fragment, d.layout, d.pass, 0, kSize);
  info.input.vertexBindingDescriptionCount = 1;
  info.input.pVertexBindingDescriptions = &binding;
  info.input.vertexAttributeDescriptionCount = 2;
  info.input.pVertexAttributeDescriptions = attributes;
  VkPipelineRobustnessCreateInfoEXT robustness{VK_STRUCTURE_TYPE_PIPELINE_ROBUSTNESS_CREATE_INFO_EXT, nullptr,
                                               VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_DEVICE_DEFAULT_EXT, VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_DEVICE_DEFAULT_EXT,
                                               VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_DEVICE_DEFAULT_EXT, VK_PIPELINE_ROBUSTNESS_IMAGE_BEHAVIOR_DEVICE_DEFAULT_EXT};
  info.info.pNext = &robustness;
  float data[3][6];
  const float positions[3][2] = {{-1, -1}, {3, -1}, {-1, 3}};
  for (int i = 0; i < 3; i++) {
    std::memcpy(data[i], positions[i], 8);
    for (int k = 0; k < 4; k++) data[i][2 + k] = 1;
  }
  std::memcpy(d.vertices.words, data, sizeof data);
  // The last vertex's blue and alpha lie behind the end of the buffer.
  const VkDeviceSize start = 0, size = sizeof data - 8;
  uint32_t pixels[2];
  for (int whole = 0; whole < 2; whole++) {
    robustness.vertexInputs = whole ? VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_2_EXT : VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_EXT;
    VK(vkDestroyPipeline)(d.device.handle, d.pipeline, nullptr);
    ASSERT_EQ(VK(vkCreateGraphicsPipelines)(d.device.handle, VK_NULL_HANDLE, 1, &info.info, nullptr, &d.pipeline), VK_SUCCESS);
    d.draw([&](VkCommandBuffer c) {
      VK(vkCmdBindVertexBuffers2)(c, 0, 1, &d.vertices.handle, &start, &size, nullptr);
      VK(vkCmdDraw)(c, 3, 1, 0, 0);
    });
    pixels[whole] = d.readback.words[7 * 8];   // near the last vertex
  }
  EXPECT_EQ(pixels[0] & 0xffff, 0xffffu) << "red and green of the last vertex are there";
  EXPECT_LT(pixels[1] & 0xff, 0xffu) << "red of the last vertex is out with the rest";
}

}  // namespace
}  // namespace pumice::icd::test
