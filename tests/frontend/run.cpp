#include "tests/frontend/run.h"

#include "spirv_interp/ir/passes.h"

namespace pumice::frontend::test {

namespace {

constexpr uint32_t kDiscarded = 1000, kBuiltins = 2000;

struct TestExpander : ir::Expander {
  const Shader& shader;
  std::vector<uint32_t>* buffer;
  ir::Value discarded = 0;

  TestExpander(const Shader& s, std::vector<uint32_t>* b) : shader(s), buffer(b) {}

  ir::Value shaderInput(ir::Builder& b, ir::Type type, uint32_t variable, uint32_t component,
                        std::span<const ir::Value>) override {
    return b.input(type, shader.inputs[variable].location * 4 + shader.inputs[variable].component + component);
  }
  void shaderOutput(ir::Builder& b, uint32_t variable, uint32_t component, ir::Value value,
                    std::span<const ir::Value>) override {
    const InterfaceVariable& v = shader.outputs[variable];
    b.output((v.builtIn ? kBuiltins + v.location * 16 : v.location * 4 + v.component) + component, value);
  }
  ir::Value builtin(ir::Builder& b, ir::Type type, uint32_t number, uint32_t component) override {
    return b.input(type, kBuiltins + number * 16 + component);
  }
  Buffer descriptor(ir::Builder& b, uint32_t, ir::Value) override {
    if (!buffer) return {b.i64(0), b.i64(0)};
    return {b.i64(reinterpret_cast<uint64_t>(buffer->data())), b.i64(buffer->size() * 4)};
  }
  std::vector<ir::Value> image(ir::Builder& b, const ir::ImageOpInfo& info, std::span<const ir::Value> operands) override {
    // A texture whose texels are their own coordinates.
    std::vector<ir::Value> texel;
    for (size_t i = 0; i < 4; i++) {
      ir::Value v = 2 + i < operands.size() ? operands[2 + i] : b.zero(info.texelType);
      texel.push_back(b.type(v) == info.texelType ? v : b.bitcast(info.texelType, v));
    }
    return texel;
  }
  void demote(ir::Builder& b) override { b.output(kDiscarded, b.i32(1)); }
  ir::Value helperMask(ir::Builder& b) override { return b.mask(false); }
};

}  // namespace

RunResult run(const Shader& shader, const std::vector<std::vector<uint32_t>>& inputs, std::vector<uint32_t>* buffer,
              const std::vector<uint32_t>& push) {
  RunResult result;
  ir::Function f;
  ir::Builder b(f);
  TestExpander expander(shader, buffer);
  ir::inlineShader(b, shader.function, expander);
  ir::optimise(f);
  ir::lowerMath(f, ir::Numerics::F32);
  result.error = ir::verify(f);
  if (!result.error.empty()) return result;

  ir::Evaluation e;
  e.lanes = inputs.size();
  for (size_t lane = 0; lane < inputs.size(); lane++) {
    for (size_t i = 0; i < inputs[lane].size(); i++) {
      e.inputs[uint32_t(i)].resize(e.lanes);
      e.inputs[uint32_t(i)][lane] = inputs[lane][i];
    }
  }
  ir::Row lanes(e.lanes);
  for (size_t lane = 0; lane < e.lanes; lane++) lanes[lane] = lane;
  e.inputs[kBuiltins + 42 * 16] = lanes;  // VertexIndex
  auto& table = e.tables[ir::kTablePush];
  table.resize(push.size() * 4);
  if (!push.empty()) std::memcpy(table.data(), push.data(), table.size());
  ir::evaluate(f, e);
  result.error = e.error;
  result.outputs.resize(e.lanes);
  result.discarded.resize(e.lanes);
  for (size_t lane = 0; lane < e.lanes; lane++) {
    for (uint32_t c = 0; c < 16; c++) {
      auto row = e.outputs.find(c);
      result.outputs[lane].push_back(row == e.outputs.end() ? 0 : uint32_t(row->second[lane]));
    }
    auto row = e.outputs.find(kDiscarded);
    result.discarded[lane] = row != e.outputs.end() && row->second[lane];
  }
  return result;
}

}  // namespace pumice::frontend::test
