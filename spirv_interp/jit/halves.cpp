#include "spirv_interp/jit/halves.h"

#include <algorithm>

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

namespace {
bool isHalfArithmetic(const Function& f, const Inst& i) {
  const ir::OperandRule rule = ir::opInfo(i.op).operands;
  if ((rule != ir::OperandRule::Float && rule != ir::OperandRule::CmpF) || i.op == Op::FNeg || i.op == Op::FAbs) return false;
  return i.operandCount && f.type(f.operands(i)[0]) == Type::F16;
}
}  // namespace

bool widenHalves(Function& f) {
  if (std::none_of(f.insts.begin(), f.insts.end(), [&](const Inst& i) { return isHalfArithmetic(f, i); })) return false;
  Function g;
  g.name = f.name;
  g.imageOps = f.imageOps;
  g.sharedBytes = f.sharedBytes;
  std::copy(std::begin(f.groupSize), std::end(f.groupSize), g.groupSize);
  std::vector<Value> renamed(f.insts.size(), 0);
  const auto append = [&](Inst i, std::span<const Value> operands) {
    i.firstOperand = uint32_t(g.operandPool.size());
    i.operandCount = uint32_t(operands.size());
    g.operandPool.insert(g.operandPool.end(), operands.begin(), operands.end());
    g.insts.push_back(i);
    return Value(g.insts.size() - 1);
  };
  const auto convert = [&](Value v, Type to, uint32_t line) {
    Inst i;
    i.op = Op::FToF;
    i.type = to;
    i.line = line;
    return append(i, {&v, 1});
  };
  std::vector<Value> operands;
  for (Value v = 1; v < f.insts.size(); v++) {
    Inst i = f.insts[v];
    operands.clear();
    for (Value o : f.operands(v)) operands.push_back(renamed[o]);
    if (!isHalfArithmetic(f, i)) {
      renamed[v] = append(i, operands);
      continue;
    }
    const Type wide = i.op == Op::Fma ? Type::F64 : Type::F32;
    for (Value& o : operands) o = convert(o, wide, i.line);
    if (i.type == Type::Mask) {
      renamed[v] = append(i, operands);
      continue;
    }
    i.type = wide;
    renamed[v] = convert(append(i, operands), Type::F16, i.line);
  }
  f = std::move(g);
  return true;
}

}  // namespace pumice::jit
