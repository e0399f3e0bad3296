// Every operation of the table with every choice of types that the verifier takes: what the tests of each executor run
// through, against the executable form of the table (ir/fold.h).
#pragma once

#include "tests/interpreter/fixture.h"

namespace pumice::interp {

struct OperationCase {
  Op op;
  Type type;       //!< of the result
  Type operand;    //!< of the last operand
  Type first;      //!< of operand 0

  unsigned count() const { return ir::opInfo(op).operandCount; }
  Type of(unsigned k) const { return k == 0 ? first : operand; }
};

//! Appends the operation as it is, without folding.
inline Value appendAll(Function& f, Op op, Type type, const std::vector<Value>& operands) {
  const Value v = append(f, op, type, {});
  f.insts[v].operandCount = uint32_t(operands.size());
  f.operandPool.insert(f.operandPool.end(), operands.begin(), operands.end());
  return v;
}

inline std::vector<OperationCase> operationCases() {
  std::vector<OperationCase> cases;
  constexpr Type kTypes[] = {Type::Mask, Type::I8, Type::I16, Type::I32, Type::I64, Type::F16, Type::F32, Type::F64};
  for (unsigned o = 1; o < kOpCount; o++) {
    const Op op = Op(o);
    const ir::OpInfo& info = ir::opInfo(op);
    if (!(info.flags & ir::kPure) || info.flags & ir::kHigh || info.operands == ir::OperandRule::Free || op == Op::Nop) continue;
    for (Type type : kTypes)
      for (Type operand : kTypes) {
        const OperationCase c{op, type, operand, op == Op::Select ? Type::Mask : operand};
        Function f;
        std::vector<Value> in;
        for (unsigned k = 0; k < c.count(); k++) in.push_back(append(f, Op::Input, c.of(k), {}, k));
        appendAll(f, op, type, in);
        if (ir::verify(f).empty()) cases.push_back(c);
      }
  }
  return cases;
}

inline std::string nameOf(const OperationCase& c) {
  static constexpr const char* kNames[] = {"none", "mask", "i8", "i16", "i32", "i64", "f16", "f32", "f64", "tuple"};
  return std::string(ir::opInfo(c.op).text) + " " + kNames[unsigned(c.operand)] + " -> " + kNames[unsigned(c.type)];
}

//! A row of operands, now and then equal ones.
inline RowRun operandRow(const OperationCase& c, Random& random) {
  RowRun run(c.count(), 1);
  for (unsigned k = 0; k < c.count(); k++) {
    for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[k].set(c.of(k), lane, awkwardBits(random, c.of(k)));
    if (k && c.first == c.operand)
      for (unsigned lane = 0; lane < kMaxLanes; lane += 5) run.inputs[k].set(c.operand, lane, run.inputs[0].get(c.operand, lane));
  }
  return run;
}

}  // namespace pumice::interp
