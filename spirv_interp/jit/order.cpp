// Code is written in the order in which its author thought of it: all inputs are interpolated, then all of them are clamped. Registers
// last longer if each value is computed where it is first needed.
#include "spirv_interp/jit/order.h"

#include <utility>
#include <vector>

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::Value;

namespace {

//! Takes one value apart, or makes another type of it.
bool changesOne(const Function& f, Value v) {
  const Inst& i = f.insts[v];
  const auto o = f.operands(v);
  return ir::opInfo(i.op).operands == ir::OperandRule::Cvt ||
         ((i.op == Op::LShr || i.op == Op::AShr || i.op == Op::And) && f.insts[o[1]].op == Op::Const);
}

bool mayWait(const Inst& i) {
  // Loads start early: they take long.
  return (ir::opInfo(i.op).flags & ir::kPure) && i.op != Op::Const && i.op != Op::LoadConst && !ir::isFilter(i.op) && i.op != Op::TableLoad && i.op != Op::UniformInput;
}

//! x - floor(x): of two values that live, one.
bool isFraction(const Function& f, Value v) {
  if (f.insts[v].op != Op::FSub) return false;
  const auto o = f.operands(v);
  return f.insts[o[1]].op == Op::FFloor && f.operands(o[1])[0] == o[0];
}

}  // namespace

void computeWhenNeeded(Function& f) {
  const Value count = Value(f.insts.size());
  std::vector<Value> order;
  order.reserve(count);
  std::vector<uint8_t> waits(count, 0);
  std::vector<Value> waiting;
  std::vector<std::pair<Value, uint32_t>> stack;   // a value, and how many of its operands have been seen to
  // v, after what it needs and is still waiting.
  const auto place = [&](Value v) {
    stack.push_back({v, 0});
    while (!stack.empty()) {
      auto& [at, done] = stack.back();
      const auto operands = f.operands(at);
      if (done < operands.size()) {
        const Value o = operands[done++];
        if (waits[o]) {
          waits[o] = 0;
          stack.push_back({o, 0});
        }
        continue;
      }
      order.push_back(at);
      stack.pop_back();
    }
  };
  uint32_t loops = 0;
  for (Value v = 1; v < count; v++) {
    const Inst& i = f.insts[v];
    // The order of arithmetic in loops is the author's: chains that take turns keep the processor busy.
    if (mayWait(i) && (!loops || changesOne(f, v)) && !isFraction(f, v)) {
      waits[v] = 1;
      waiting.push_back(v);
      continue;
    }
    if (ir::opInfo(i.op).flags & ir::kControl) {
      for (Value w : waiting)
        if (std::exchange(waits[w], uint8_t(0))) place(w);
      waiting.clear();
      if (i.op == Op::Loop) loops++;
      if (i.op == Op::EndLoop) loops--;
    }
    place(v);
  }
  for (Value w : waiting)
    if (std::exchange(waits[w], uint8_t(0))) place(w);

  std::vector<Value> renamed(count, 0);
  std::vector<Inst> insts{f.insts[0]};
  insts.reserve(count);
  for (Value v : order) {
    renamed[v] = Value(insts.size());
    insts.push_back(f.insts[v]);
  }
  f.insts = std::move(insts);
  for (Value& o : f.operandPool) o = renamed[o];
}

}  // namespace pumice::jit
