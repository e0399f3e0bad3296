// Ten million triangles through one render pass: the picture is right and memory stays bounded.
#include <cstdio>
#include <fstream>
#include <string>

#include "cts_subset/harness/canvas.h"
#include "cts_subset/tests/world.h"

namespace pumice::cts {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(NDEBUG)
constexpr uint32_t kRounds = 5;  // slow builds: the path, not the amount
constexpr bool kMeasured = false;
#else
constexpr uint32_t kRounds = 153;
constexpr bool kMeasured = true;
#endif
constexpr uint32_t kSize = 256, kTriangles = kRounds * kSize * kSize;  // 10,027,008

// A line of /proc/self/status, in bytes.
uint64_t memoryOf(const char* name) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);)
    if (line.rfind(name, 0) == 0) return std::stoull(line.substr(line.find(':') + 1)) * 1024;
  return 0;
}

// Round after round a triangle in each pixel, which adds one step of the format. There is no vertex buffer.
struct Stream {
  Canvas canvas;
  Pipeline pipeline;

  explicit Stream(Device& device) : canvas(device, kSize, kSize) {
    PipelineSpec spec;
    spec.vertex = R"(#version 450
void main() {
  uint t = gl_VertexIndex / 3u % 65536u;
  vec2 corner = vec2(gl_VertexIndex % 3 == 1 ? 0.875 : 0.25, gl_VertexIndex % 3 == 2 ? 0.875 : 0.25);
  gl_Position = vec4((vec2(t % 256u, t / 256u) + corner) / 128.0 - 1.0, 0, 1);
}
)";
    spec.fragment = "#version 450\nlayout(location = 0) out vec4 colour;\nvoid main() { colour = vec4(1.0 / 255.0); }\n";
    VkPipelineColorBlendAttachmentState add{};
    add.blendEnable = VK_TRUE;
    add.srcColorBlendFactor = add.dstColorBlendFactor = add.srcAlphaBlendFactor = add.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
    spec.blend = add;
    spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};  // read by nothing
    pipeline = canvas.pipeline(spec);
  }

  // `draws` draws, of which the last is given what remains.
  Picture draw(uint32_t draws) {
    Buffer unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    return canvas.draw({0, 0, 0, 0}, [&](VkCommandBuffer commands) {
      VkDeviceSize offset = 0;
      vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
      uint32_t each = kTriangles / draws;
      for (uint32_t k = 0; k < draws; ++k) vkCmdDraw(commands, 3 * (k + 1 == draws ? kTriangles - k * each : each), 1, 3 * k * each, 0);
    });
  }
};

void expectAllRounds(const Picture& picture) {
  uint32_t wrong = 0, x = 0, y = 0;
  for (uint32_t i = 0; i < kSize * kSize; ++i)
    for (int c = 0; c < 4; ++c)
      if (picture.rgba[i * 4 + c] != kRounds && !wrong++) x = i % kSize, y = i / kSize;
  EXPECT_EQ(wrong, 0u) << "first at x=" << x << " y=" << y << ": " << int(picture.at(x, y)[0]) << " instead of " << kRounds;
}

void expectBounded(Device& device, uint32_t draws) {
  Stream stream(device);
  std::ofstream reset("/proc/self/clear_refs");
  reset << "5" << std::flush;  // the peak starts from here
  bool fresh = bool(reset);
  uint64_t before = memoryOf("VmRSS");
  expectAllRounds(stream.draw(draws));
  uint64_t grown = memoryOf("VmHWM") - before;
  std::printf("%u triangles in %u draws: %.1f MiB at the peak beyond %.1f MiB before\n", kTriangles, draws, double(grown) / (1 << 20), double(before) / (1 << 20));
  // All primitives at once would be more than a gigabyte; a pass may collect 256 MiB of them.
  if (kMeasured && fresh) EXPECT_LT(grown, uint64_t(512) << 20);
}

TEST(Streaming, TenMillionTrianglesInOneDrawStayBounded) {
  PUMICE_NEED_TESTED();
  expectBounded(*world().tested, 1);
}

TEST(Streaming, TenMillionTrianglesInManyDrawsStayBounded) {
  PUMICE_NEED_TESTED();
  expectBounded(*world().tested, 5000);
}

}  // namespace
}  // namespace pumice::cts
