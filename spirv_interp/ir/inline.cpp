#include <unordered_map>
#include <vector>

#include "spirv_interp/ir/passes.h"

namespace pumice::ir {

void inlineShader(Builder& b, const Function& shader, Expander& expander) {
  std::vector<Value> map(shader.insts.size()), operands;
  std::unordered_map<Value, std::vector<Value>> tuples;
  Function& f = b.function();
  b.reserve(shader.insts.size() + shader.insts.size() / 2);
  f.sharedBytes = std::max(f.sharedBytes, shader.sharedBytes);

  for (Value v = 1; v < shader.insts.size(); ++v) {
    const Inst& i = shader.insts[v];
    const auto high = uint32_t(i.imm >> 32), low = uint32_t(i.imm);
    operands.clear();
    if (i.op != Op::TupleGet)
      for (Value o : shader.operands(i)) operands.push_back(map[o]);
    b.setLine(i.line);
    b.setInstFlags(i.flags);
    const std::span<const Value> all(operands);
    switch (i.op) {
      case Op::ShaderInput:
        map[v] = expander.shaderInput(b, i.type, high, low, all);
        break;
      case Op::ShaderOutput:
        expander.shaderOutput(b, high, low, all[0], all.subspan(1));
        break;
      case Op::Builtin:
        map[v] = expander.builtin(b, i.type, high, low);
        break;
      case Op::Descriptor: {
        const Expander::Buffer buffer = expander.descriptor(b, uint32_t(i.imm), all[0]);
        tuples[v] = {buffer.base, buffer.size};
        break;
      }
      case Op::ImageOp:
        tuples[v] = expander.image(b, shader.imageOps[i.imm], all);
        break;
      case Op::TupleGet: {
        const std::vector<Value>& tuple = tuples[shader.operands(i)[0]];
        // A component the expander does not give (a texel format with fewer) reads as zero.
        const Value given = i.imm < tuple.size() ? tuple[i.imm] : 0;
        map[v] = given ? given : b.zero(i.type);
        break;
      }
      case Op::Demote:
        expander.demote(b);
        break;
      case Op::HelperMask:
        map[v] = expander.helperMask(b);
        break;
      default:
        map[v] = b.emit(i.op, i.type, all, i.imm);
        break;
    }
  }
  b.setLine(0);
  b.setInstFlags(0);
}

}  // namespace pumice::ir
