// PUMICE_CHECK=bounds through the API: texels that are not there, attributes behind the end of their buffer, addresses of nothing;
// and what vertices and pixels print.
// (tests/icd/check_test.cpp has what is wrong with buffers, variables and numbers.)
#include "cts_subset/tests/compute.h"
#include "cts_subset/tests/probe.h"

#include <algorithm>
#include <cstdlib>

namespace pumice::cts {
namespace {

class Checks : public testing::Test {
 protected:
  void SetUp() override {
    PUMICE_NEED_TESTED();
    if (testedDeviceName() != "Pumice") GTEST_SKIP() << "only Pumice has it";
    if (validationRequested()) GTEST_SKIP() << "does what the layer forbids";
    setenv("PUMICE_CHECK", "bounds", 1);
  }
  void TearDown() override { unsetenv("PUMICE_CHECK"); }
  Device& device() { return *world().tested; }
  //! What is logged meanwhile.
  template <class F>
  std::string logged(F&& f) {
    testing::internal::CaptureStderr();
    f();
    return testing::internal::GetCapturedStderr();
  }
  static void expectLines(const std::string& log, const std::vector<std::string>& lines) {
    EXPECT_EQ(size_t(std::count(log.begin(), log.end(), '\n')), lines.size()) << log;
    for (const std::string& line : lines) EXPECT_NE(log.find(line), std::string::npos) << "there is no \"" << line << "\" in\n" << log;
  }
};

TEST_F(Checks, NameTexelsThatAreNotThere) {
  Workspace work(device());
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_SFLOAT;
  spec.extent = {20, 10, 1};
  spec.layers = 3;
  spec.mips = 2;
  spec.usage |= VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT;
  Image image = work.image(spec);
  toGeneral(work, image);
  ViewSpec whole{VK_IMAGE_VIEW_TYPE_2D_ARRAY}, base = whole;
  base.mips = 1;
  Binding sampled = sampledBinding(makeView(work, image, whole), VK_NULL_HANDLE);
  sampled.type = VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE;
  const std::vector<Binding> bindings = {sampled, storageBinding(makeView(work, image, base))};
  const std::string declarations = "#extension GL_EXT_samplerless_texture_functions : require\nlayout(binding = 2) uniform texture2DArray t;\nlayout(binding = 3, r32f) uniform image2DArray s;\n";
  const std::vector<glm::vec4> questions(8, glm::vec4(0));
  const std::string in = "  int i = int(gl_GlobalInvocationID.x);\n";
  auto run = [&](const std::string& body) { return logged([&] { probe(work, declarations, in + body, bindings, questions); }); };
  expectLines(run("  answer.x = texelFetch(t, ivec3(i + 15, 0, 0), 0).x;"),
              {"bounds: fetch of a texel at x 20 of 20; compute shader \"main\", unknown line, invocation (5, 0, 0) of work group (0, 0, 0)"});
  // The second level is half as large.
  expectLines(run("  answer.x = texelFetch(t, ivec3(9, i, i), 1).x;"), {"at y 5 of 5;", "at layer 3 of 3;"});
  expectLines(run("  answer.x = texelFetch(t, ivec3(0), i).x;"), {"at level 2 of 2;"});
  expectLines(run("  answer = imageLoad(s, ivec3(i - 1, 0, 0));"), {"load of a texel at x -1 of 20;"});
  expectLines(run("  imageStore(s, ivec3(0, i + 4, 0), vec4(1));"), {"store of a texel at y 10 of 10;"});
  expectLines(run("  if (i < 3) answer = imageLoad(s, ivec3(0, 0, i)) + texelFetch(t, ivec3(19, 9, i), 0);"), {});
}

TEST_F(Checks, NameAttributesBehindTheEnd) {
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {4, 4, 1};
  spec.usage |= VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  Image image = work.image(spec);
  toGeneral(work, image);
  const std::vector<float> corners(10, 0.0f);   // of five vertices
  Buffer vertices = work.bufferOf(corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  Painting p;
  p.extent = {4, 4};
  p.vertex = "#version 450\nlayout(location = 0) in vec2 position;\nvoid main() { gl_Position = vec4(position, 0, 1); gl_PointSize = 1; }";
  p.fragment = "#version 450\nlayout(location = 0) out vec4 colour;\nvoid main() { colour = vec4(1); }";
  p.attribute = VK_FORMAT_R32G32_SFLOAT;
  p.stride = 8;
  p.vertices = vertices.handle;
  p.points = 5;
  VkImageView view = work.view(image);
  EXPECT_EQ(logged([&] { paint(work, view, spec.format, p); }), "");
  p.points = 6;
  expectLines(logged([&] { paint(work, view, spec.format, p); }),
              {"bounds: fetch of 8 bytes for location 0 at byte 40 of a vertex buffer of 40 bytes; vertex shader \"main\", unknown line, vertex 5 of instance 0"});
}

TEST_F(Checks, NameAddressesOfNothing) {
  PUMICE_NEED_FEATURE(device().vulkan12.bufferDeviceAddress && device().features.shaderInt64);
  Workspace work(device());
  // A small buffer in a large piece of memory: what lies behind it is there, but is not the buffer.
  const uint64_t address = addressedBuffer(work, 256, 64 << 10).address;
  auto run = [&](uint32_t first) {
    return logged([&] {
      runCompute(device(), R"(
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 8) in;
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Word { uint v; };
layout(binding = 0) readonly buffer In { uint64_t start; uint first; };
layout(binding = 1) buffer Out { uint r[]; };
void main() { uint i = gl_LocalInvocationIndex; Word(start)[first + i].v = i; r[i] = i; }
)", Words{uint32_t(address), uint32_t(address >> 32), first, 0}, 8);
    });
  };
  EXPECT_EQ(run(56), "");   // the last eight words
  expectLines(run(60), {"bounds: store of 4 bytes at address 0x"});
  EXPECT_NE(run(60).find("(256 bytes behind the start of a buffer of 256 bytes); compute shader \"main\", unknown line, invocation (4, 0, 0)"), std::string::npos);
}

// A vertex and a pixel print once, helpers not at all.
TEST_F(Checks, PrintFromEveryStage) {
  setenv("PUMICE_CHECK", "printf", 1);
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {3, 2, 1};
  spec.usage |= VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  Image image = work.image(spec);
  toGeneral(work, image);
  Painting p;
  p.extent = {3, 2};
  p.vertex = "#version 450\n#extension GL_EXT_debug_printf : require\nvoid main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1, 0.5, 1);\n"
             "  debugPrintfEXT(\"vertex %d\", gl_VertexIndex); }";
  p.fragment = "#version 450\n#extension GL_EXT_debug_printf : require\nlayout(location = 0) out vec4 colour;\n"
               "void main() { colour = dFdx(gl_FragCoord); debugPrintfEXT(\"pixel %v2f\", gl_FragCoord.xy); }";
  VkImageView view = work.view(image);
  expectLines(logged([&] { paint(work, view, spec.format, p); }),
              {"pumice: printf: vertex 0\n", "vertex 1\n", "vertex 2\n", "pixel 0.500000, 0.500000\n", "pixel 1.500000, 0.500000\n", "pixel 2.500000, 0.500000\n",
               "pixel 0.500000, 1.500000\n", "pixel 1.500000, 1.500000\n", "pixel 2.500000, 1.500000\n"});
}

}  // namespace
}  // namespace pumice::cts
