// Shaders as bytes: what is written comes back, and no bytes lead anybody astray.
#include <gtest/gtest.h>

#include "spirv_interp/frontend/shader_bytes.h"
#include "tests/frontend/compile.h"

namespace pumice::frontend {
namespace {

using test::compileGlsl;
using test::GlslStage;

std::shared_ptr<const Shader> make(GlslStage stage, const char* source) {
  std::string log;
  const auto words = compileGlsl(stage, source, &log);
  EXPECT_FALSE(words.empty()) << log;
  auto module = parseModule(words);
  if (!module) return nullptr;
  auto shader = translate(**module, stage == GlslStage::Vertex ? Stage::Vertex : stage == GlslStage::Fragment ? Stage::Fragment : Stage::Compute, "main", {});
  EXPECT_TRUE(shader.hasValue()) << (shader ? "" : shader.error().message);
  return shader ? *shader : nullptr;
}

std::vector<std::shared_ptr<const Shader>> examples() {
  return {make(GlslStage::Vertex, R"(#version 450
layout(location = 0) in vec3 position; layout(location = 3) in mat2 m; layout(location = 0) out vec4 a; layout(location = 1) flat out ivec2 b;
layout(push_constant) uniform P { mat4 transform; } p;
out gl_PerVertex { vec4 gl_Position; float gl_ClipDistance[3]; };
void main() { gl_Position = p.transform * vec4(position, 1); a = vec4(m[0], m[1]); b = ivec2(gl_VertexIndex, gl_InstanceIndex); gl_ClipDistance[2] = a.x; })"),
          make(GlslStage::Fragment, R"(#version 450
layout(set = 0, binding = 1) uniform sampler2D t[3]; layout(set = 1, binding = 0, r32ui) uniform uimage2D image;
layout(location = 0) in vec4 a; layout(location = 1) sample in vec2 b; layout(location = 0) out vec4 c;
void main() { float sum = 0; for (int i = 0; i < int(a.x); i++) { if (b.y > float(i)) discard; sum += sin(sum + float(i)); }
  c = texture(t[2], b) + textureLod(t[int(a.y) % 3], b, 1.5) + sum + dFdx(a); imageAtomicAdd(image, ivec2(b), 3u); })"),
          make(GlslStage::Compute, R"(#version 450
layout(local_size_x = 8, local_size_y = 4) in; shared float s[32]; layout(binding = 0) buffer B { float v[]; };
void main() { float l[4]; for (int i = 0; i < 4; i++) l[i] = v[i] + float(i); s[gl_LocalInvocationIndex] = l[int(v[9]) & 3]; barrier(); v[gl_GlobalInvocationID.x] = s[31u - gl_LocalInvocationIndex]; })")};
}

TEST(ShaderBytes, WhatIsWrittenComesBack) {
  for (const auto& shader : examples()) {
    ASSERT_TRUE(shader);
    const auto bytes = toBytes(*shader);
    const auto again = fromBytes(bytes);
    ASSERT_TRUE(again) << ir::print(shader->function);
    EXPECT_EQ(ir::print(again->function), ir::print(shader->function));
    EXPECT_EQ(toBytes(*again), bytes);
    EXPECT_EQ(again->stage, shader->stage);
    EXPECT_EQ(again->inputs.size(), shader->inputs.size());
    EXPECT_EQ(again->outputs.size(), shader->outputs.size());
    EXPECT_EQ(again->resources.size(), shader->resources.size());
    EXPECT_EQ(again->localSize, shader->localSize);
    EXPECT_EQ(again->usesBarrier, shader->usesBarrier);
    EXPECT_EQ(again->mayDiscard, shader->mayDiscard);
  }
}

TEST(ShaderBytes, WhatIsCutOffIsRefused) {
  for (const auto& shader : examples()) {
    ASSERT_TRUE(shader);
    auto bytes = toBytes(*shader);
    for (size_t n = 0; n < bytes.size(); n++) ASSERT_FALSE(fromBytes({bytes.data(), n})) << n << " of " << bytes.size() << " bytes";
    bytes.push_back(std::byte(0));
    EXPECT_FALSE(fromBytes(bytes)) << "more than there should be";
  }
}

// Whatever stands in the bytes: refused, or a shader that the verifier has nothing against.
TEST(ShaderBytes, AnyOtherBytesAreRefusedOrHarmless) {
  size_t refused = 0, taken = 0;
  uint32_t random = 1;
  for (const auto& shader : examples()) {
    ASSERT_TRUE(shader);
    const auto bytes = toBytes(*shader);
    for (size_t at = 0; at < bytes.size(); at++)
      for (int k = 0; k < 3; k++) {
        auto changed = bytes;
        random = random * 1664525u + 1013904223u;
        changed[at] = k == 0 ? ~bytes[at] : k == 1 ? bytes[at] ^ std::byte(1) : std::byte(random >> 24);
        if (auto read = fromBytes(changed)) {
          taken++;
          ASSERT_EQ(ir::verify(read->function), "");
          ASSERT_TRUE(fromBytes(toBytes(*read)));
        } else {
          refused++;
        }
      }
  }
  EXPECT_GT(refused, taken / 4) << "of " << taken + refused;
}

}  // namespace
}  // namespace pumice::frontend
