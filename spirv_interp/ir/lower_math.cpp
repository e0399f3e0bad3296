#include "spirv_interp/ir/lower_math.h"

#include "spirv_interp/ir/pass_list.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::ir {

namespace {

Value lowerOne(Builder& b, Op op, Type type, std::span<const Value> v, Numerics numerics) {
  if (op == Op::FRsqrt) return b.fdiv(b.floatConstant(type, 1.0), b.fsqrt(v[0]));
  if (numerics != Numerics::F32) return 0;
  if (type == Type::F32) return lowerF32(b, op, v);
  if (type != Type::F16) return 0;
  // Half precision: computed in f32, whose error is far below a half's unit, and rounded once.
  Value wide[2] = {};
  for (size_t k = 0; k < v.size(); ++k) wide[k] = b.convert(Op::FToF, Type::F32, v[k]);
  return b.convert(Op::FToF, Type::F16, lowerF32(b, op, {wide, v.size()}));
}

}  // namespace

void lowerMath(Function& f, Numerics numerics) {
  Function out = withoutInstructions(f);
  Builder b(out);
  std::vector<Value> map(f.insts.size()), operands;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    const OpInfo& info = opInfo(i.op);
    operands.clear();
    for (Value o : f.operands(i)) operands.push_back(map[o]);
    b.setLine(i.line);
    b.setInstFlags(i.flags);
    if ((info.flags & kHigh) && info.operands == OperandRule::Float) {
      b.setInstFlags(0);
      map[v] = lowerOne(b, i.op, i.type, operands, numerics);
      if (map[v]) continue;
    }
    map[v] = b.emit(i.op, i.type, operands, i.imm);
  }
  f = std::move(out);
  computeRates(f);
}

}  // namespace pumice::ir
