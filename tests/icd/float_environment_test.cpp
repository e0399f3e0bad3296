// A host that has set flush-to-zero, another rounding, or unmasked nothing: pictures and buffers are the same
// bits, and the host's own environment is as it was after every call.
#include <gtest/gtest.h>

#include <cstring>

#include "base/fpenv.h"
#include "tests/icd/dispatch.h"
#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

constexpr uint32_t kDenormal = 0x00012345;  // as a float

// Compiled before the environment changes: the compiler folds constants, too.
struct Shaders {
  std::vector<uint32_t> vertex = vertexShader(R"(#version 450
layout(push_constant) uniform P { vec4 v; } p;
layout(location = 0) flat out vec4 o;
void main() {
  o = vec4(p.v.x + p.v.x, p.v.x * 0.5, p.v.x, uintBitsToFloat(0x00700000u) * 0.25);
  gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 1.0 : -1.0, 0.5, 1.0);
}
)");
  std::vector<uint32_t> fragment = fragmentShader(R"(#version 450
layout(push_constant) uniform P { vec4 v; } p;
layout(location = 0) flat in vec4 i;
layout(location = 0) out vec4 c;
void main() { c = vec4(i.x + p.v.x, i.y - p.v.x, i.z * p.v.y + 1e-3 / 3.0, i.w); }
)");
  std::vector<uint32_t> kernel = computeShader(R"(#version 450
layout(local_size_x = 16) in;
layout(constant_id = 0) const float tiny = 1e-39;
layout(set = 0, binding = 0) buffer B { float v[]; };
void main() {
  uint i = gl_GlobalInvocationID.x;
  float x = v[i], t = 1e-39;
  t = (t + t) * 0.3;   // for the driver to fold
  v[i] = i % 4u == 0u ? x + x : i % 4u == 1u ? x * 0.5 : i % 4u == 2u ? tiny + x + t : 1.0 / 3.0 * x + sqrt(abs(x));
}
)");
};

// Everything that computes: constants folded at creation, clears, all three stages, on the application's
// thread and on the driver's. Returns what came out.
std::vector<uint32_t> compute(const Shaders& shaders) {
  std::vector<uint32_t> out;
  TestDevice device;
  constexpr VkExtent2D kSize{8, 8};
  Target target(device, VK_FORMAT_R32G32B32A32_SFLOAT, kSize);
  TestDevice::Buffer pixels = device.buffer(8 * 8 * 16);
  float denormal;
  std::memcpy(&denormal, &kDenormal, 4);
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipelineLayout layout = target.layout(16);
  VkPipeline pipeline = target.pipeline(shaders.vertex, shaders.fragment, layout, pass);
  VkCommandBuffer commands = device.begin();
  VkClearValue clear;
  for (float& f : clear.color.float32) f = denormal;
  VkRenderPassBeginInfo begin{
      VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, kSize}, 1, &clear};
  VK(vkCmdBeginRenderPass)(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
  float push[4] = {denormal, 0.7f, 0, 0};
  VK(vkCmdPushConstants)
  (commands, layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, 16, push);
  VK(vkCmdDraw)(commands, 3, 1, 0, 0);
  VK(vkCmdEndRenderPass)(commands);
  target.read(commands, pixels.handle);
  device.run(commands);
  out.insert(out.end(), pixels.words, pixels.words + 8 * 8 * 4);
  VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
  VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
  VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);

  uint32_t* words = nullptr;
  dispatch(
      device, shaders.kernel, 64,
      [&](TestDevice&, VkCommandBuffer dispatched) {
        for (uint32_t i = 0; i < 1024; i++) words[i] = i * 40503u & 0x00ffffff;  // denormals and the smallest normals
        device.run(dispatched);
        out.insert(out.end(), words, words + 1024);
      },
      4096, &words);
  device.release(pixels);
  return out;
}

TEST(FloatEnvironment, OfTheHostChangesNothingAndIsKept) {
#if defined(__x86_64__)
  constexpr uint32_t kFlags = 0x3f;  // what the host's own arithmetic sets
  const Shaders shaders;
  const std::vector<uint32_t> reference = compute(shaders);
  ASSERT_EQ(base::readFpEnv() & ~kFlags, base::kDefaultFpEnv);
  // Denormals survive: the clear's in a corner that the triangle leaves, and the sum in the vertex shader.
  EXPECT_EQ(reference[4 * 63], kDenormal) << "the clear value";
  EXPECT_EQ(reference[0], 3 * kDenormal) << "a sum of denormals";
  struct Case {
    const char* name;
    uint32_t bits;
  };
  for (Case c : {Case{"flush to zero and denormals are zero", 0x8040}, Case{"round down", 0x2000},
                 Case{"round up", 0x4000}, Case{"truncate, flush to zero", 0xe000}}) {
    SCOPED_TRACE(c.name);
    base::writeFpEnv(base::kDefaultFpEnv | c.bits);
    std::vector<uint32_t> got = compute(shaders);
    uint32_t after = base::readFpEnv();
    base::writeFpEnv(base::kDefaultFpEnv);
    EXPECT_EQ(after & ~kFlags, base::kDefaultFpEnv | c.bits);
    EXPECT_EQ(got, reference);
  }
#else
  GTEST_SKIP() << "only for x86";
#endif
}

}  // namespace
}  // namespace pumice::icd::test
