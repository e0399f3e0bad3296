#include "spirv_interp/ir/passes.h"

#include <algorithm>
#include <array>

#include "spirv_interp/ir/pass_list.h"

namespace pumice::ir {

namespace {

struct Pass {
  const char* name;
  bool (*run)(Function&);
  bool lastIfUnchanged;  // what follows only tidies up behind this pass
};

constexpr Pass kOptimise[] = {
    {"forward variables", forwardVariables, false},
    {"dead code", removeDeadCode, false},
    {"if conversion", convertIfs, true},
    {"forward variables", forwardVariables, false},
    {"dead code", removeDeadCode, false},
    {"if conversion", convertIfs, true},
    {"forward variables", forwardVariables, false},
    {"dead code", removeDeadCode, false},
};

}  // namespace

void optimise(Function& f) {
  for (const Pass& pass : kOptimise)
    if (!pass.run(f) && pass.lastIfUnchanged) break;
  computeRates(f);
}

namespace {
//! By operation: the rarest that it may be.
constexpr auto kLeastRate = [] {
  std::array<Rate, size_t(Op::kCount)> table{};
  for (size_t op = 0; op < table.size(); op++) table[op] = kOps[op].flags & kPure ? Rate::Constant : Rate::Lane;
  for (const Op op : {Op::Input, Op::LaneId, Op::QuadLoad}) table[size_t(op)] = Rate::Lane;
  for (const Op op : {Op::UniformInput, Op::TableLoad, Op::LoadConst, Op::Descriptor}) table[size_t(op)] = Rate::Draw;
  return table;
}();
}  // namespace

void computeRates(Function& f) {
  const Value* const pool = f.operandPool.data();
  Inst* const insts = f.insts.data();
  for (Inst& i : f.insts) {
    Rate rate = i.flags & kInstVolatile ? Rate::Lane : kLeastRate[size_t(i.op)];
    if (rate != Rate::Lane)
      for (const Value *o = pool + i.firstOperand, *end = o + i.operandCount; o != end; ++o) rate = std::max(rate, insts[*o].rate);
    i.rate = rate;
  }
}

std::vector<Value> regionEnds(const Function& f) {
  std::vector<Value> ends(f.insts.size(), 0), open;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Op op = f.insts[v].op;
    if (op == Op::Else || op == Op::EndIf || op == Op::EndLoop || op == Op::EndBlock) {
      ends[open.back()] = v;
      open.pop_back();
    }
    if (op == Op::If || op == Op::Else || op == Op::Loop || op == Op::Block) open.push_back(v);
  }
  return ends;
}

Function withoutInstructions(const Function& f) {
  Function g;
  g.name = f.name;
  g.imageOps = f.imageOps;
  g.sharedBytes = f.sharedBytes;
  std::copy(std::begin(f.groupSize), std::end(f.groupSize), g.groupSize);
  g.insts.reserve(f.insts.size());
  g.operandPool.reserve(f.operandPool.size());
  return g;
}

}  // namespace pumice::ir
