// PUMICE_WATCHDOG_SECONDS: shaders that never end cost the device, not the process.
#include <gtest/gtest.h>

#include <chrono>

#include "tests/icd/dispatch.h"
#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

class WatchdogTest : public ::testing::Test {
 protected:
  WatchdogTest() { ::setenv("PUMICE_WATCHDOG_SECONDS", "1", 1); }
  ~WatchdogTest() override { ::unsetenv("PUMICE_WATCHDOG_SECONDS"); }

  //! Whatever waits for the submission comes back and is told; so is whoever submits more.
  static void expectLost(TestDevice& device, VkCommandBuffer commands) {
    VK(vkEndCommandBuffer)(commands);
    VkFence fence = device.fence(), later = device.fence();
    VkSemaphore semaphore = device.semaphore();
    VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO, nullptr, 0, nullptr, nullptr, 1, &commands, 1, &semaphore};
    const auto start = std::chrono::steady_clock::now();
    ASSERT_EQ(VK(vkQueueSubmit)(device.queue, 1, &submit, fence), VK_SUCCESS);
    // Behind it, and never run.
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    VkSubmitInfo behind{VK_STRUCTURE_TYPE_SUBMIT_INFO, nullptr, 1, &semaphore, &stage, 0, nullptr, 0, nullptr};
    ASSERT_EQ(VK(vkQueueSubmit)(device.queue, 1, &behind, later), VK_SUCCESS);
    EXPECT_EQ(VK(vkWaitForFences)(device.handle, 1, &fence, VK_TRUE, ~0ull), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(VK(vkWaitForFences)(device.handle, 1, &later, VK_TRUE, ~0ull), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(VK(vkDeviceWaitIdle)(device.handle), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(VK(vkQueueWaitIdle)(device.queue), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(VK(vkGetFenceStatus)(device.handle, fence), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(VK(vkQueueSubmit)(device.queue, 1, &submit, VK_NULL_HANDLE), VK_ERROR_DEVICE_LOST);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    EXPECT_GE(seconds, 0.9);
    EXPECT_LT(seconds, 20);
    VK(vkDestroyFence)(device.handle, fence, nullptr);
    VK(vkDestroyFence)(device.handle, later, nullptr);
    VK(vkDestroySemaphore)(device.handle, semaphore, nullptr);
  }
};

TEST_F(WatchdogTest, endsAnEndlessComputeLoop) {
  TestDevice device;
  dispatch(device, computeShader(R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { uint v[]; };
void main() {
  uint x = gl_LocalInvocationIndex;
  while (v[0] == 0u) v[1 + x % 16u] = x = x * 3u + 1u;
}
)"), 8, expectLost);
}

TEST_F(WatchdogTest, endsWorkGroupsThatWaitForEachOther) {
  TestDevice device;
  // Several rows; barriers and atomics that nobody answers.
  dispatch(device, computeShader(R"(#version 450
layout(local_size_x = 512) in;
layout(set = 0, binding = 0) buffer B { uint v[]; };
shared uint s;
void main() {
  if (gl_LocalInvocationIndex == 0u) s = 0u;
  barrier();
  while (atomicAdd(v[0], 0u) == 0u) atomicAdd(s, 1u);
  barrier();
  v[1] = s;
}
)"), 2, expectLost);
}

TEST_F(WatchdogTest, endsADispatchOfTooMuchWork) {
  TestDevice device;
  dispatch(device, computeShader(R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { uint v[]; };
void main() {
  uint x = gl_GlobalInvocationID.x;
  for (int i = 0; i < 100000; i++) x = x * 3u + v[i & 7];
  v[gl_LocalInvocationIndex] = x;
}
)"), 65535, expectLost);
}

TEST_F(WatchdogTest, leavesAloneWhatIsQuick) {
  TestDevice device;
  dispatch(device, computeShader(R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { uint v[]; };
void main() { v[gl_GlobalInvocationID.x] = gl_GlobalInvocationID.x; }
)"), 8, [](TestDevice& d, VkCommandBuffer commands) {
    d.run(commands);
    EXPECT_EQ(VK(vkDeviceWaitIdle)(d.handle), VK_SUCCESS);
  });
}

void draw(TestDevice& device, const char* vertex, const char* fragment, void (*check)(TestDevice&, VkCommandBuffer)) {
  constexpr VkExtent2D kSize{64, 64};
  Target target(device, VK_FORMAT_R8G8B8A8_UNORM, kSize);
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipelineLayout layout = target.layout(16);
  VkPipeline pipeline = target.pipeline(vertexShader(vertex), fragmentShader(fragment), layout, pass);
  VkCommandBuffer commands = device.begin();
  VkClearValue clear{};
  VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, kSize}, 1, &clear};
  VK(vkCmdBeginRenderPass)(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
  const float push[4] = {};
  VK(vkCmdPushConstants)(commands, layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, 16, push);
  VK(vkCmdDraw)(commands, 3, 1, 0, 0);
  VK(vkCmdEndRenderPass)(commands);
  check(device, commands);
  VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
  VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
  VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
}

TEST_F(WatchdogTest, endsAnEndlessFragmentLoop) {
  TestDevice device;
  draw(device, kCoverAll, R"(#version 450
layout(push_constant) uniform P { vec4 v; } p;
layout(location = 0) out vec4 c;
void main() {
  float x = gl_FragCoord.x;
  while (p.v.x == 0.0 && x != -1.0) x = abs(x * 0.5 + 1.0);
  c = vec4(x);
}
)", expectLost);
}

TEST_F(WatchdogTest, endsAnEndlessVertexLoop) {
  TestDevice device;
  draw(device, R"(#version 450
layout(push_constant) uniform P { vec4 v; } p;
void main() {
  float x = float(gl_VertexIndex);
  while (p.v.x == 0.0 && x != -1.0) x = abs(x * 0.5 + 1.0);
  gl_Position = vec4(x, x, 0.5, 1.0);
}
)", "#version 450\nlayout(location = 0) out vec4 c; void main() { c = vec4(1); }", expectLost);
}

}  // namespace
}  // namespace pumice::icd::test
