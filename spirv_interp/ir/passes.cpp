#include "spirv_interp/ir/passes.h"

#include <algorithm>

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

void computeRates(Function& f) {
  for (Inst& i : f.insts) {
    i.rate = Rate::Lane;
    if (!(opInfo(i.op).flags & kPure) || (i.flags & kInstVolatile)) continue;
    Rate rate = Rate::Constant;
    switch (i.op) {
      case Op::Input:
      case Op::LaneId:
      case Op::QuadLoad:
        continue;
      case Op::UniformInput:
      case Op::TableLoad:
      case Op::LoadConst:
      case Op::Descriptor:
        rate = Rate::Draw;
        break;
      default:
        break;
    }
    for (Value v : f.operands(i)) rate = std::max(rate, f.insts[v].rate);
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
