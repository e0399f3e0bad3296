// Shaders of every kind translate to what they say: images, compute, specialization, interfaces, contraction.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <set>

#include "spirv_interp/frontend/module.h"
#include "spirv_interp/frontend/shader.h"
#include "tests/frontend/compile.h"
#include "tests/frontend/run.h"

namespace pumice::frontend {
namespace {

using test::GlslStage;

std::shared_ptr<const Shader> translated(GlslStage stage, const std::string& glsl,
                                         std::span<const SpecializationConstant> constants = {},
                                         bool oldSpirv = false) {
  std::string log;
  auto words = test::compileGlsl(stage, "#version 450\n" + glsl, &log, oldSpirv);
  EXPECT_FALSE(words.empty()) << log;
  if (words.empty()) return nullptr;
  auto module = parseModule(words);
  EXPECT_TRUE(module.hasValue()) << (module ? "" : module.error().message);
  if (!module) return nullptr;
  Stage wanted = stage == GlslStage::Vertex     ? Stage::Vertex
                 : stage == GlslStage::Fragment ? Stage::Fragment
                                                : Stage::Compute;
  auto shader = translate(**module, wanted, "main", constants);
  EXPECT_TRUE(shader.hasValue()) << (shader ? "" : shader.error().message);
  if (!shader) return nullptr;
  return *shader;
}

size_t countOps(const Shader& shader, ir::Op op) {
  size_t n = 0;
  for (const ir::Inst& inst : shader.function.insts) n += inst.op == op;
  return n;
}

std::vector<ir::ImageOpInfo> imageOps(const Shader& shader) {
  std::vector<ir::ImageOpInfo> out;
  for (const ir::Inst& inst : shader.function.insts)
    if (inst.op == ir::Op::ImageOp) out.push_back(shader.function.imageOps[inst.imm]);
  return out;
}

TEST(Coverage, EveryOpcodeIsInOneTableAtMost) {
  std::set<uint32_t> numbers;
  for (const OpcodeInfo& info : allOpcodes()) {
    EXPECT_TRUE(numbers.insert(info.opcode).second) << info.name;
    EXPECT_EQ(opcodeInfo(info.opcode), &info);
  }
  EXPECT_EQ(opcodeInfo(0xffff), nullptr);
}

TEST(Coverage, ContractionIsAFunctionOfTheExpression) {
  auto shader = translated(GlslStage::Vertex, R"(
layout(location=0) in vec4 a;
layout(location=0) out vec4 r;
void main() { r = vec4(a.x * a.y + a.z, a.x - a.y * a.z, a.x * a.y - a.z, a.x * a.y + a.z * a.w); })");
  ASSERT_TRUE(shader);
  EXPECT_EQ(countOps(*shader, ir::Op::Fma), 4u);
  EXPECT_EQ(countOps(*shader, ir::Op::FAdd) + countOps(*shader, ir::Op::FSub), 0u);
  auto precise = translated(GlslStage::Vertex, R"(
layout(location=0) in vec4 a;
layout(location=0) out vec4 r;
void main() { precise vec4 p = vec4(a.x * a.y + a.z, a.x - a.y * a.z, a.x * a.y - a.z, a.x * a.y + a.z * a.w); r = p; })");
  ASSERT_TRUE(precise);
  EXPECT_EQ(countOps(*precise, ir::Op::Fma), 0u);
}

TEST(Coverage, ImageInstructionsOfFragmentShaders) {
  auto shader = translated(GlslStage::Fragment, R"(
layout(binding=0) uniform sampler2D s2;
layout(binding=1) uniform samplerCubeArray sca;
layout(binding=2) uniform sampler2DArrayShadow shadow;
layout(binding=3) uniform texture3D t3;
layout(binding=4) uniform sampler smp;
layout(binding=5) uniform usampler2DMS ms;
layout(binding=6) uniform isamplerBuffer tb;
layout(binding=7, rgba8) uniform image2D img;
layout(binding=8) uniform sampler2D many[8];
layout(input_attachment_index=2, binding=9) uniform subpassInput sub;
layout(binding=10, r32ui) uniform uimage2D counters;
layout(location=0) in vec4 c;
layout(location=1) flat in int k;
layout(location=0) out vec4 r;
void main() {
  r = texture(s2, c.xy, 0.5) + textureLod(s2, c.xy, 2.0) + textureGrad(s2, c.xy, c.zw, c.wz);
  r += texture(sca, c) + vec4(texture(shadow, c)) + texture(sampler3D(t3, smp), c.xyz);
  r += textureProj(s2, c.xyz) + textureOffset(s2, c.xy, ivec2(1, -2)) + textureGather(s2, c.xy, 1);
  r += vec4(texelFetch(ms, ivec2(c.xy), 3)) + vec4(texelFetch(tb, k)) + texelFetch(s2, ivec2(c.xy), 1);
  r += imageLoad(img, ivec2(c.xy)) + texture(many[k], c.xy) + texture(many[3], c.xy) + subpassLoad(sub);
  imageStore(img, ivec2(k), r);
  r.x += float(imageAtomicAdd(counters, ivec2(k), 3u)) + float(textureSize(s2, 0).x) + textureQueryLod(s2, c.xy).y;
  r.y += float(textureQueryLevels(s2) + imageSize(img).y + textureSamples(ms));
})");
  ASSERT_TRUE(shader);
  auto ops = imageOps(*shader);
  std::set<ir::ImageKind> kinds;
  for (const auto& op : ops) kinds.insert(op.kind);
  EXPECT_EQ(kinds.size(), 10u) << "every kind of image operation occurs";
  EXPECT_TRUE(shader->usesDerivatives);
  EXPECT_TRUE(shader->writesMemory);
  auto find = [&](uint32_t binding) -> const Resource& {
    for (const Resource& r : shader->resources)
      if (r.binding == binding) return r;
    static const Resource none;
    ADD_FAILURE() << "no binding " << binding;
    return none;
  };
  EXPECT_EQ(find(3).kind, ResourceKind::SampledImage);
  EXPECT_EQ(find(4).kind, ResourceKind::Sampler);
  EXPECT_EQ(find(6).kind, ResourceKind::UniformTexelBuffer);
  EXPECT_EQ(find(7).kind, ResourceKind::StorageImage);
  EXPECT_FALSE(find(7).readOnly);
  EXPECT_EQ(find(8).arraySize, 8u);
  EXPECT_TRUE(find(8).dynamicIndex);
  EXPECT_EQ(find(8).usedConstantElements, 8u);
  EXPECT_EQ(find(9).kind, ResourceKind::InputAttachment);
  EXPECT_EQ(find(9).inputAttachmentIndex, 2u);
  // c is read in full, k once.
  ASSERT_EQ(shader->inputs.size(), 2u);
  for (const auto& input : shader->inputs)
    EXPECT_EQ(input.interpolation, input.location == 1 ? Interpolation::Flat : Interpolation::Perspective);
}

TEST(Coverage, ComputeWithSharedMemoryAndSpecialization) {
  const char* source = R"(
layout(local_size_x_id=0, local_size_y=2) in;
layout(constant_id=1) const int N = 3;
layout(constant_id=2) const bool flag = false;
layout(constant_id=4) const float scale = 2.0;
shared uint tmp[N * 4 + 1];
shared struct { vec3 a; bool b; } both[2];
layout(std430, binding=0) buffer B { uint n; float v[]; } b;
void main() {
  uint i = gl_LocalInvocationIndex;
  tmp[i % (N * 4 + 1)] = i * gl_WorkGroupSize.x;
  both[i & 1].a = vec3(i); both[i & 1].b = flag;
  barrier();
  if (flag) atomicMax(tmp[0], i);
  atomicCompSwap(b.n, 1u, tmp[(i + 1) % N]);
  b.v[gl_GlobalInvocationID.x] = float(tmp[0]) * scale + both[0].a.y + float(both[1].b);
})";
  uint32_t sizeX = 16;
  int32_t n = 7;
  float scale = 0.5f;
  auto bytes = [](const void* p) {
    std::vector<std::byte> v(4);
    std::memcpy(v.data(), p, 4);
    return v;
  };
  uint32_t yes = 1;
  std::vector<SpecializationConstant> constants{{0, bytes(&sizeX)}, {1, bytes(&n)}, {2, bytes(&yes)}, {4, bytes(&scale)}};
  for (bool oldSpirv : {false, true}) {
    auto plain = translated(GlslStage::Compute, source, {}, oldSpirv);
    auto special = translated(GlslStage::Compute, source, constants, oldSpirv);
    ASSERT_TRUE(plain && special);
    EXPECT_EQ(plain->localSize, (std::array<uint32_t, 3>{1, 2, 1}));
    EXPECT_EQ(special->localSize, (std::array<uint32_t, 3>{16, 2, 1}));
    EXPECT_EQ(countOps(*plain, ir::Op::SharedAtomic), 0u);
    EXPECT_EQ(countOps(*special, ir::Op::SharedAtomic), 1u);
    EXPECT_EQ(countOps(*special, ir::Op::AtomicCas), 1u);
    EXPECT_GE(special->function.sharedBytes, (7 * 4 + 1) * 4 + 2 * 16u);
    EXPECT_TRUE(special->usesBarrier);
    EXPECT_TRUE(special->writesMemory);
  }
}

TEST(Coverage, InterfaceShapes) {
  auto shader = translated(GlslStage::Vertex, R"(
layout(location=1) in mat3 m;
layout(location=5) in float arr[3];
layout(location=9, component=2) in vec2 hv;
layout(location=2) out Block { vec3 p; flat uvec2 q[2]; noperspective centroid float s; } o;
layout(location=7) out mat2 om;
out gl_PerVertex { vec4 gl_Position; float gl_PointSize; float gl_ClipDistance[2]; };
void main() {
  o.p = m[gl_InstanceIndex] * arr[2]; o.q[1] = uvec2(hv); o.s = hv.y; om[1] = hv;
  gl_Position = vec4(arr[0]); gl_PointSize = 2.0; gl_ClipDistance[1] = 1.0;
})");
  ASSERT_TRUE(shader);
  auto input = [&](uint32_t location) {
    for (const auto& v : shader->inputs)
      if (v.location == location) return v;
    return InterfaceVariable{};
  };
  auto output = [&](uint32_t location, bool builtIn = false) {
    for (const auto& v : shader->outputs)
      if (v.location == location && v.builtIn == builtIn) return v;
    return InterfaceVariable{};
  };
  EXPECT_EQ(input(1).locations, 3u);
  EXPECT_EQ(input(1).components, 3u);
  EXPECT_EQ(input(1).usedComponents, 0x777u);
  EXPECT_EQ(input(5).usedComponents, 0x101u);
  EXPECT_EQ(input(9).component, 2u);
  EXPECT_EQ(output(2).usedComponents, 7u);
  EXPECT_EQ(output(3).usedComponents, 0x30u);
  EXPECT_EQ(output(3).interpolation, Interpolation::Flat);
  EXPECT_EQ(output(3).type, ir::Type::I32);
  EXPECT_EQ(output(5).interpolation, Interpolation::Linear);
  EXPECT_EQ(output(5).sampling, SampleLocation::Centroid);
  EXPECT_EQ(output(7).usedComponents, 0x30u);
  EXPECT_EQ(output(uint32_t(spv::BuiltIn::Position), true).usedComponents, 15u);
  EXPECT_EQ(output(uint32_t(spv::BuiltIn::PointSize), true).usedComponents, 1u);
  EXPECT_EQ(output(uint32_t(spv::BuiltIn::ClipDistance), true).usedComponents, 2u);
  EXPECT_EQ(output(uint32_t(spv::BuiltIn::CullDistance), true).usedComponents, 0u);
}

TEST(Coverage, FragmentBuiltinsAndInterpolation) {
  auto shader = translated(GlslStage::Fragment, R"(
#extension GL_EXT_demote_to_helper_invocation : require
layout(early_fragment_tests) in;
layout(location=0) in vec2 c;
layout(location=0, index=0) out vec4 r;
layout(location=0, index=1) out vec4 r1;
void main() {
  r = vec4(interpolateAtCentroid(c), interpolateAtSample(c, 2)) + vec4(interpolateAtOffset(c, vec2(0.25)), c);
  if (!gl_FrontFacing) demote;
  r1 = vec4(gl_FragCoord.xyz, helperInvocationEXT() ? 1 : 0) + vec4(gl_PointCoord, gl_SampleID, gl_SamplePosition.x);
  gl_FragDepth = r.x; gl_SampleMask[0] = gl_SampleMaskIn[0] & 3;
})");
  ASSERT_TRUE(shader);
  EXPECT_TRUE(shader->earlyFragmentTests);
  EXPECT_TRUE(shader->writesDepth);
  EXPECT_TRUE(shader->usesSampleRate);
  EXPECT_TRUE(shader->mayDiscard);
  EXPECT_EQ(shader->inputs.size(), 2u) << "the centroid form is a variable of its own";
  std::set<uint32_t> indices;
  for (const auto& output : shader->outputs)
    if (!output.builtIn) indices.insert(output.index);
  EXPECT_EQ(indices.size(), 2u);
}

// Vulkan specification, "Sample Shading": what the interface holds decides, not what is left of the code.
TEST(Coverage, UnusedSampleNumberStillAsksForSampleShading) {
  auto shader = translated(GlslStage::Fragment, R"(
layout(location=0) out vec4 r;
void main() {
  int unused = gl_SampleID;
  r = vec4(1);
})");
  ASSERT_TRUE(shader);
  EXPECT_TRUE(shader->usesSampleRate);
}

TEST(Coverage, InterpolationOfADynamicallyIndexedInput) {
  auto shader = translated(GlslStage::Fragment, R"(
layout(location=0) in vec2 c[3];
layout(location=4) flat in int which;
layout(location=0) out vec4 r;
void main() { r = vec4(interpolateAtOffset(c[which], vec2(0.25)), interpolateAtCentroid(c[which])); })");
  ASSERT_TRUE(shader);
  size_t atOffset = 0, centroid = 0;
  for (ir::Value v = 1; v < shader->function.insts.size(); v++) {
    if (shader->function.insts[v].op != ir::Op::ShaderInput) continue;
    atOffset += shader->function.operands(v).size() == 2;
    centroid += shader->inputs[shader->function.insts[v].imm >> 32].sampling == SampleLocation::Centroid;
  }
  EXPECT_EQ(atOffset, 6u) << "every element";
  EXPECT_EQ(centroid, 6u);
}

TEST(Coverage, ReadOnlyBuffersAreConstantOnlyWithoutWrites) {
  auto reads = translated(GlslStage::Vertex, R"(
layout(std430, binding=0) readonly buffer A { vec4 v[]; } a;
void main() { gl_Position = a.v[gl_VertexIndex]; })");
  ASSERT_TRUE(reads);
  EXPECT_EQ(countOps(*reads, ir::Op::LoadConst), 4u);
  EXPECT_TRUE(reads->resources[0].readOnly);
  auto writes = translated(GlslStage::Vertex, R"(
layout(std430, binding=0) readonly buffer A { vec4 v[]; } a;
layout(std430, binding=1) buffer B { vec4 v[]; } b;
void main() { b.v[0] = vec4(1); gl_Position = a.v[gl_VertexIndex]; })");
  ASSERT_TRUE(writes);
  EXPECT_EQ(countOps(*writes, ir::Op::LoadConst), 0u);
  EXPECT_EQ(countOps(*writes, ir::Op::Load), 4u);
}

TEST(Coverage, SixtyFourBitAndSmallTypes) {
  auto shader = translated(GlslStage::Compute, R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_8bit_storage : require
layout(local_size_x=4) in;
layout(std430, binding=0) buffer B { double d; int64_t l; float16_t h[4]; uint8_t b[4]; i16vec2 s; u32vec2 w; } b;
void main() {
  b.d = sqrt(b.d) * 2.0lf + double(b.l);
  b.l = b.l * 3l + int64_t(b.b[2]);
  b.h[1] = b.h[0] * float16_t(2) + float16_t(b.s.x);
  b.b[3] = uint8_t(b.s.y);
  b.w = unpack32(uint64_t(b.l));
})");
  ASSERT_TRUE(shader);
}

TEST(Coverage, BufferDeviceAddresses) {
  auto shader = translated(GlslStage::Vertex, R"(
#extension GL_EXT_buffer_reference : require
layout(buffer_reference) buffer Node;
layout(buffer_reference, std430) buffer Node { vec4 v; Node next; ivec2 list[]; };
layout(push_constant) uniform P { Node first; } p;
void main() { Node n = p.first.next; n.list[gl_VertexIndex].y = 3; gl_Position = n.next.v; })");
  ASSERT_TRUE(shader);
  EXPECT_EQ(countOps(*shader, ir::Op::TableLoad), 1u);
  EXPECT_EQ(countOps(*shader, ir::Op::Store), 1u);
}

TEST(Coverage, SourceLinesReachTheInstructions) {
  // Line 1 is the version.
  auto shader = translated(GlslStage::Vertex, "layout(location=0) in vec4 a;\nlayout(location=0) out vec4 r;\nvoid main() {\n"
                                              "  vec4 b = sin(a);\n\n  r = b / a;\n}\n");
  ASSERT_TRUE(shader);
  for (const ir::Inst& inst : shader->function.insts) {
    if (inst.op == ir::Op::FSin || inst.op == ir::Op::FDiv) {
      EXPECT_EQ(inst.line, inst.op == ir::Op::FSin ? 5u : 7u);
    }
  }
  EXPECT_EQ(countOps(*shader, ir::Op::FSin), 4u);
}

TEST(Coverage, DebugPrintfIsIgnored) {
  auto shader = translated(GlslStage::Vertex, R"(#extension GL_EXT_debug_printf : require
layout(location=0) in vec4 a;
void main() { debugPrintfEXT("%v4f and %d", a, gl_VertexIndex); gl_Position = a; })");
  ASSERT_TRUE(shader);
  EXPECT_EQ(countOps(*shader, ir::Op::ShaderOutput), 4u);
}

TEST(Coverage, NonSemanticDebugLines) {
  std::string log;
  auto words = test::assemble(R"(
OpCapability Shader
OpExtension "SPV_KHR_non_semantic_info"
%debug = OpExtInstImport "NonSemantic.Shader.DebugInfo.100"
OpMemoryModel Logical GLSL450
OpEntryPoint Vertex %main "main" %in %out
%name = OpString "file.vert"
OpDecorate %in Location 0
OpDecorate %out Location 0
%void = OpTypeVoid
%fn = OpTypeFunction %void
%float = OpTypeFloat 32
%uint = OpTypeInt 32 0
%u1 = OpConstant %uint 1
%u77 = OpConstant %uint 77
%pin = OpTypePointer Input %float
%pout = OpTypePointer Output %float
%in = OpVariable %pin Input
%out = OpVariable %pout Output
%source = OpExtInst %void %debug DebugSource %name
%main = OpFunction %void None %fn
%entry = OpLabel
%v = OpLoad %float %in
%line = OpExtInst %void %debug DebugLine %source %u77 %u77 %u1 %u1
%d = OpFDiv %float %v %v
%noline = OpExtInst %void %debug DebugNoLine
%m = OpFMul %float %d %d
OpStore %out %m
OpReturn
OpFunctionEnd
)", &log);
  ASSERT_FALSE(words.empty()) << log;
  auto module = parseModule(words);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  auto shader = translate(**module, Stage::Vertex, "main", {});
  ASSERT_TRUE(shader.hasValue()) << shader.error().message;
  size_t found = 0;
  for (const ir::Inst& inst : (*shader)->function.insts) {
    if (inst.op == ir::Op::FDiv) found += inst.line == 77;
    if (inst.op == ir::Op::FMul) found += inst.line == 0;
  }
  EXPECT_EQ(found, 2u);
}

TEST(Coverage, VulkanMemoryModel) {
  auto shader = translated(GlslStage::Compute, R"(#pragma use_vulkan_memory_model
#extension GL_KHR_memory_scope_semantics : require
layout(local_size_x=4) in;
layout(binding=0) workgroupcoherent buffer B { uint n; uint m[4]; } b;
shared uint s;
void main() {
  atomicStore(s, 3u, gl_ScopeWorkgroup, gl_StorageSemanticsShared, gl_SemanticsRelease | gl_SemanticsMakeAvailable);
  controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsShared, gl_SemanticsAcquireRelease);
  b.m[gl_LocalInvocationIndex] = b.n + s;
})");
  ASSERT_TRUE(shader);
  EXPECT_TRUE(shader->usesBarrier);
  EXPECT_EQ(countOps(*shader, ir::Op::Load), 1u);
}

TEST(Coverage, SubgroupsInOtherStages) {
  for (GlslStage stage : {GlslStage::Vertex, GlslStage::Fragment}) {
    auto shader = translated(stage, R"(#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_quad : require
layout(location=0) in vec4 a;
layout(location=0) out vec4 r;
void main() { r = subgroupAdd(a) + subgroupQuadSwapDiagonal(a) * float(gl_SubgroupInvocationID); })");
    ASSERT_TRUE(shader);
    EXPECT_EQ(countOps(*shader, ir::Op::SubgroupReduce), 4u);
    EXPECT_EQ(countOps(*shader, ir::Op::QuadSwizzle), 4u);
    EXPECT_TRUE(shader->inputBuiltIns.empty());
  }
}

TEST(Coverage, FloatControls) {
  for (auto [mode, good] : {std::pair("DenormPreserve 32", true), {"SignedZeroInfNanPreserve 32", true}, {"RoundingModeRTE 32", true},
                            {"DenormPreserve 16", true},
                            {"SignedZeroInfNanPreserve 64", true}, {"RoundingModeRTZ 32", false}, {"DenormFlushToZero 16", false}}) {
    std::string name = mode, capability = name.substr(0, name.find(' ')), log;
    auto words = test::assemble("OpCapability Shader\nOpCapability " + capability + R"(
OpExtension "SPV_KHR_float_controls"
OpMemoryModel Logical GLSL450
OpEntryPoint Vertex %main "main"
OpExecutionMode %main )" + name + R"(
%void = OpTypeVoid
%fn = OpTypeFunction %void
%main = OpFunction %void None %fn
%entry = OpLabel
OpReturn
OpFunctionEnd
)", &log);
    ASSERT_FALSE(words.empty()) << log;
    auto module = parseModule(words);
    ASSERT_TRUE(module.hasValue()) << module.error().message;
    auto shader = translate(**module, Stage::Vertex, "main", {});
    EXPECT_EQ(shader.hasValue(), good) << mode << (shader ? "" : shader.error().message);
    if (!shader) {
      EXPECT_NE(shader.error().message.find(capability), std::string::npos) << shader.error().message;
    }
  }
}

TEST(Coverage, WhatIsNotSupportedIsNamed) {
  std::string log;
  auto words = test::compileGlsl(GlslStage::Compute, R"(#version 450
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_image_int64 : require
layout(local_size_x=4) in;
layout(binding=0, r64ui) uniform u64image2D image;
void main() { imageStore(image, ivec2(0), u64vec4(1)); })", &log);
  ASSERT_FALSE(words.empty()) << log;
  auto module = parseModule(words);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  auto shader = translate(**module, Stage::Compute, "main", {});
  ASSERT_FALSE(shader.hasValue());
  EXPECT_NE(shader.error().message.find("Int64ImageEXT is an extension"), std::string::npos) << shader.error().message;
}

}  // namespace
}  // namespace pumice::frontend
