#include "spirv_interp/ir/decisions.h"

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/pass_list.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::ir {

namespace {

//! The decision that v is, as an i32; 0 if it is none.
Value decision(Builder& b, Op op, Value v) {
  if (b.isConstant(v)) return 0;
  switch (op) {
    case Op::FEq:
    case Op::FNe:
    case Op::FLt:
    case Op::FLe:
      return b.select(v, b.i32(0x85ebca6b), b.i32(0xc2b2ae35));
    case Op::FFloor:
    case Op::FCeil:
    case Op::FTrunc:
    case Op::FRoundEven:
      // A whole number has the same bits in every run (rounded to its declared type), but for the sign of zero.
      v = b.bitcast(intOf(b.type(v)), b.fadd(v, b.floatConstant(b.type(v), 0)));
      break;
    case Op::FToS:
    case Op::FToU:
      break;
    default:
      return 0;
  }
  const unsigned bytes = typeBytes(b.type(v));
  if (bytes == 8) v = b.xor_(v, b.lshr(v, b.i64(32)));
  return bytes == 4 ? v : b.convert(bytes > 4 ? Op::Trunc : Op::ZExt, Type::I32, v);
}

}  // namespace

Value mixDecision(Builder& b, Value hash, Value word) { return b.imul(b.xor_(b.iadd(hash, b.lshr(hash, b.i32(15))), word), b.i32(0x9e3779b1)); }

void recordDecisions(Function& f, Value first, Value end, Value variable) {
  Function out = withoutInstructions(f);
  Builder b(out);
  std::vector<Value> map(f.insts.size()), operands;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    operands.clear();
    for (Value o : f.operands(i)) operands.push_back(map[o]);
    b.setLine(i.line);
    b.setInstFlags(i.flags);
    map[v] = b.emit(i.op, i.type, operands, i.imm);
    b.setInstFlags(0);
    if (v < first || v >= end) continue;
    if (const Value word = decision(b, i.op, map[v])) b.set(map[variable], mixDecision(b, b.get(map[variable]), word));
  }
  f = std::move(out);
}

}  // namespace pumice::ir
