#include <gtest/gtest.h>

#include <cstdlib>

#include "spirv_interp/frontend/module.h"
#include "spirv_interp/frontend/shader.h"
#include "tests/frontend/compile.h"

namespace pumice::frontend {
namespace {

using test::compileGlsl;
using test::GlslStage;

Stage stageOf(GlslStage s) {
  return s == GlslStage::Vertex ? Stage::Vertex : s == GlslStage::Fragment ? Stage::Fragment : Stage::Compute;
}

Result<std::shared_ptr<const Shader>> tryTranslate(GlslStage stage, const std::string& source,
                                                   std::span<const SpecializationConstant> constants = {},
                                                   bool oldSpirv = false) {
  std::string log;
  auto words = compileGlsl(stage, source, &log, oldSpirv);
  if (words.empty()) return base::errorf("glslang: %s", log.c_str());
  auto module = parseModule(words);
  if (!module) return std::move(module).error();
  return translate(**module, stageOf(stage), "main", constants);
}

std::shared_ptr<const Shader> translateOk(GlslStage stage, const std::string& source,
                                          std::span<const SpecializationConstant> constants = {}) {
  // Old modules declare their interfaces and buffers in another way: both must do.
  auto old = tryTranslate(stage, source, constants, true);
  auto shader = tryTranslate(stage, source, constants);
  EXPECT_TRUE(shader.hasValue()) << (shader ? "" : shader.error().message);
  if (!shader) return nullptr;
  EXPECT_EQ(ir::verify((*shader)->function), "");
  return *shader;
}

size_t countOps(const Shader& shader, ir::Op op) {
  size_t n = 0;
  for (const ir::Inst& inst : shader.function.insts) n += inst.op == op;
  return n;
}

TEST(Translate, CubeVertexShader) {
  auto shader = translateOk(GlslStage::Vertex, R"(#version 400
#extension GL_ARB_separate_shader_objects : enable
#extension GL_ARB_shading_language_420pack : enable
layout(std140, binding = 0) uniform buf {
  mat4 MVP;
  vec4 position[12 * 3];
  vec4 attr[12 * 3];
} ubuf;
layout(location = 0) out vec4 texcoord;
layout(location = 1) out vec3 frag_pos;
void main() {
  texcoord = ubuf.attr[gl_VertexIndex];
  gl_Position = ubuf.MVP * ubuf.position[gl_VertexIndex];
  frag_pos = gl_Position.xyz;
})");
  ASSERT_TRUE(shader);
  ASSERT_EQ(shader->resources.size(), 1u);
  EXPECT_EQ(shader->resources[0].kind, ResourceKind::UniformBuffer);
  EXPECT_TRUE(shader->resources[0].readOnly);
  EXPECT_EQ(shader->inputBuiltIns, std::vector<uint32_t>{uint32_t(spv::BuiltIn::VertexIndex)});
  EXPECT_EQ(countOps(*shader, ir::Op::LoadConst), 4u + 16u + 4u);
  EXPECT_EQ(countOps(*shader, ir::Op::FMul), 4u);
  EXPECT_EQ(countOps(*shader, ir::Op::Fma), 12u);
  EXPECT_EQ(countOps(*shader, ir::Op::ShaderOutput), 4u + 4u + 3u);
  EXPECT_EQ(countOps(*shader, ir::Op::Var), 0u);
}

TEST(Translate, CubeFragmentShader) {
  auto shader = translateOk(GlslStage::Fragment, R"(#version 400
#extension GL_ARB_separate_shader_objects : enable
#extension GL_ARB_shading_language_420pack : enable
layout(binding = 1) uniform sampler2D tex;
layout(location = 0) in vec4 texcoord;
layout(location = 1) in vec3 frag_pos;
layout(location = 0) out vec4 uFragColor;
const vec3 lightDir = vec3(0.424, 0.566, 0.707);
void main() {
  vec3 dX = dFdx(frag_pos);
  vec3 dY = dFdy(frag_pos);
  vec3 normal = normalize(cross(dX, dY));
  float light = max(0.0, dot(lightDir, normal));
  uFragColor = light * texture(tex, texcoord.xy);
})");
  ASSERT_TRUE(shader);
  ASSERT_EQ(shader->resources.size(), 1u);
  EXPECT_EQ(shader->resources[0].kind, ResourceKind::CombinedImageSampler);
  EXPECT_EQ(shader->resources[0].binding, 1u);
  EXPECT_EQ(countOps(*shader, ir::Op::QuadDdx), 3u);
  EXPECT_EQ(countOps(*shader, ir::Op::QuadDdy), 3u);
  EXPECT_EQ(countOps(*shader, ir::Op::ImageOp), 1u);
  EXPECT_EQ(countOps(*shader, ir::Op::ShaderOutput), 4u);
  EXPECT_TRUE(shader->usesDerivatives);
  EXPECT_FALSE(shader->mayDiscard);
  ASSERT_EQ(shader->inputs.size(), 2u);
  for (const InterfaceVariable& input : shader->inputs)
    EXPECT_EQ(input.usedComponents, input.location == 0 ? 3u : 7u) << "location " << input.location;
}

}  // namespace
}  // namespace pumice::frontend
