#include "tests/frontend/run_compute.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include <spirv/unified1/spirv.hpp11>

#include "base/fpenv.h"
#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/passes.h"
#include "tests/frontend/compile.h"

namespace pumice::frontend::test {

namespace {

struct ComputeExpander : ir::Expander {
  const Shader& shader;
  Buffers& buffers;
  std::string error;

  ComputeExpander(const Shader& s, Buffers& b) : shader(s), buffers(b) {}

  ir::Value shaderInput(ir::Builder& b, ir::Type type, uint32_t, uint32_t, std::span<const ir::Value>) override { return b.zero(type); }
  void shaderOutput(ir::Builder&, uint32_t, uint32_t, ir::Value, std::span<const ir::Value>) override {}
  ir::Value builtin(ir::Builder& b, ir::Type, uint32_t number, uint32_t component) override {
    ir::Value local = b.input(ir::Type::I32, 0), group = b.input(ir::Type::I32, 1);
    if (component) return b.i32(0);
    switch (spv::BuiltIn(number)) {
      case spv::BuiltIn::LocalInvocationIndex:
      case spv::BuiltIn::LocalInvocationId: return local;
      case spv::BuiltIn::WorkgroupId: return group;
      case spv::BuiltIn::GlobalInvocationId: return b.iadd(b.imul(group, b.i32(shader.localSize[0])), local);
      default: error = "built-in " + std::to_string(number); return local;
    }
  }
  Buffer descriptor(ir::Builder& b, uint32_t resource, ir::Value element) override {
    const Resource& r = shader.resources[resource];
    Buffer out{b.i64(0), b.i64(0)};
    for (uint32_t i = 0; i < std::max(r.arraySize, 1u) && r.binding + i < buffers.size(); i++) {
      ir::Value here = b.ieq(element, b.i32(i));
      std::vector<uint32_t>& memory = buffers[r.binding + i];
      out.base = b.select(here, b.i64(reinterpret_cast<uint64_t>(memory.data())), out.base);
      out.size = b.select(here, b.i64(memory.size() * 4), out.size);
    }
    return out;
  }
  std::vector<ir::Value> image(ir::Builder&, const ir::ImageOpInfo&, std::span<const ir::Value>) override { return {}; }
  void demote(ir::Builder&) override {}
  ir::Value helperMask(ir::Builder& b) override { return b.mask(false); }
};

}  // namespace

std::shared_ptr<const Shader> translatedCompute(std::span<const uint32_t> words) {
  auto module = parseModule(words);
  EXPECT_TRUE(module.hasValue()) << (module ? "" : module.error().message);
  if (!module) return nullptr;
  auto shader = translate(**module, Stage::Compute, "main", {});
  EXPECT_TRUE(shader.hasValue()) << (shader ? "" : shader.error().message);
  if (!shader) return nullptr;
  return *shader;
}

std::string runCompute(const Shader& shader, uint32_t groups, Buffers& buffers) {
  const base::ScopedFpEnv environment;
  ir::Function f;
  ir::Builder b(f);
  ComputeExpander expander(shader, buffers);
  ir::inlineShader(b, shader.function, expander);
  if (!expander.error.empty()) return expander.error;
  ir::optimise(f);
  std::string problem = ir::verify(f);
  if (!problem.empty()) return problem;
  auto code = interp::compileInterpreter(f, {});
  if (!code) return code.error().message;
  uint32_t lanes = shader.localSize[0];
  if (lanes > interp::kMaxLanes || shader.localSize[1] * shader.localSize[2] != 1) return "the work group is too large";

  interp::Tables tables;
  interp::UniformBank bank = (*code)->preamble(tables);
  alignas(64) uint32_t ids[2][interp::kMaxLanes];
  const void* inputs[] = {ids[0], ids[1]};
  for (uint32_t group = 0; group < groups; group++) {
    std::vector<std::byte> shared(shader.function.sharedBytes + 64);
    interp::ExecContext context;
    context.lanes = lanes;
    for (uint32_t l = 0; l < interp::kMaxLanes; l++) {
      ids[0][l] = l;
      ids[1][l] = group;
      if (l < lanes) context.active[l / 64] |= uint64_t(1) << l % 64;
    }
    context.inputs = inputs;
    context.tables = tables;
    context.shared = shared.data();
    context.sharedBytes = shader.function.sharedBytes;
    (*code)->run(bank, context);
  }
  return "";
}

void runGlsl(const std::string& glsl, uint32_t groups, Buffers& buffers, bool optimise) {
  std::string log;
  auto words = compileGlsl(GlslStage::Compute, "#version 450\n" + glsl, &log);
  ASSERT_FALSE(words.empty()) << log;
  if (optimise) words = optimised(words);
  auto shader = translatedCompute(words);
  ASSERT_TRUE(shader);
  ASSERT_EQ(runCompute(*shader, groups, buffers), "");
}

void runAssembly(const std::string& text, uint32_t groups, Buffers& buffers, const char* version) {
  std::string log;
  auto words = assemble(text, &log, version);
  ASSERT_FALSE(words.empty()) << log;
  auto shader = translatedCompute(words);
  ASSERT_TRUE(shader);
  ASSERT_EQ(runCompute(*shader, groups, buffers), "");
}

}  // namespace pumice::frontend::test
