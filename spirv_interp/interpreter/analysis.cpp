#include "spirv_interp/interpreter/analysis.h"

#include <algorithm>
#include <array>

namespace pumice::interp {
namespace {

using ir::Function, ir::Inst, ir::Op, ir::Value;

constexpr bool isPure(Op op) { return ir::opInfo(op).flags & ir::kPure; }
constexpr bool isSign(Op op) { return op == Op::FNeg || op == Op::FAbs; }
constexpr bool movesLanes(Op op) { return op == Op::QuadSwizzle || op == Op::SubgroupShuffle; }
//! Makes a NaN of its own.
constexpr bool isArithmetic(Op op) {
  return (ir::opInfo(op).operands == ir::OperandRule::Float && !isSign(op)) || op == Op::FToF || op == Op::SubgroupReduce || ir::isFilter(op);
}

//! What these passes ask of an operation, once for all.
enum Trait : uint8_t {
  kArithmetic = 1,   //!< isArithmetic
  kBlind = 2,        //!< gives no float, and does not look at the bits of a NaN
  kPasses = 4,       //!< gives bits of an operand
};
constexpr auto kTraits = [] {
  std::array<uint8_t, size_t(Op::kCount)> table{};
  for (size_t op = 0; op < table.size(); op++) {
    const Op o = Op(op);
    if (isArithmetic(o)) table[op] |= kArithmetic;
    if (o == Op::FToS || o == Op::FToU || ir::opInfo(o).operands == ir::OperandRule::CmpF) table[op] |= kBlind;
    if (o == Op::Select || o == Op::VarGet || movesLanes(o) || isSign(o)) table[op] |= kPasses;
  }
  return table;
}();

NanBits join(NanBits a, NanBits b) { return std::max(a, b); }

void findNeeded(const Function& f, Analysis& a) {
  const size_t n = f.insts.size();
  a.needed.assign(n, 0);
  std::vector<uint8_t> read(n, 0);   // vars that somebody reads
  for (Value v = 1; v < n; v++)
    if (f.insts[v].op == Op::VarGet) read[f.operands(v)[0]] = 1;
  for (Value v = Value(n); v-- > 1;) {
    const Inst& i = f.insts[v];
    const bool root = (ir::opInfo(i.op).flags & ir::kEffect) && i.op != Op::Var && i.op != Op::LocalAlloc &&
                      (i.op != Op::VarSet || read[f.operands(v)[0]]);
    if (root) a.needed[v] = 1;
    if (!a.needed[v]) continue;
    for (Value o : f.operands(v)) a.needed[o] = 1;
  }
}

void findUniform(const Function& f, Analysis& a) {
  a.uniform.assign(f.insts.size(), 0);
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    if (i.rate > ir::Rate::Draw || !isPure(i.op) || i.type == ir::Type::None) continue;
    const auto operands = f.operands(v);
    a.uniform[v] = std::all_of(operands.begin(), operands.end(), [&](Value o) { return a.uniform[o] != 0; });
  }
}

bool isNan(ir::Type t, uint64_t bits) {
  switch (ir::typeBytes(t)) {
    case 2: return (bits & 0x7fff) > 0x7c00;
    case 4: return (bits & 0x7fffffff) > 0x7f800000;
    default: return (bits & 0x7fffffffffffffff) > 0x7ff0000000000000;
  }
}

void findNan(const Function& f, Analysis& a) {
  const size_t n = f.insts.size();
  a.nan.assign(n, NanBits::Settled);
  std::vector<uint8_t> read(n, 0);   // variables whose value was looked at
  // Variables feed back through loops: repeat until none rises that was looked at before.
  for (bool again = true; again;) {
    again = false;
    for (Value v = 1; v < n; v++) {
      const Inst& i = f.insts[v];
      if (i.op == Op::VarSet) {
        const auto o = f.operands(i);
        const NanBits set = join(a.nan[o[0]], a.nan[o[1]]);
        if (set != a.nan[o[0]]) {
          a.nan[o[0]] = set;
          again |= read[o[0]] != 0;
        }
        continue;
      }
      if (!ir::isFloat(i.type) || i.op == Op::Var) continue;
      NanBits r = NanBits::Kept;
      if (kTraits[size_t(i.op)] & kArithmetic) r = NanBits::Arithmetic;
      else if (i.op == Op::Const) r = isNan(i.type, i.imm) ? NanBits::Kept : NanBits::Settled;
      else if (i.op == Op::SToF || i.op == Op::UToF) r = NanBits::Settled;
      else if (i.op == Op::Select) r = join(a.nan[f.operands(i)[1]], a.nan[f.operands(i)[2]]);
      else if (i.op == Op::VarGet || movesLanes(i.op)) {
        r = a.nan[f.operands(i)[0]];
        read[f.operands(i)[0]] = 1;
      }
      a.nan[v] = r;
    }
  }
}

void findExposed(const Function& f, Analysis& a) {
  const size_t n = f.insts.size();
  a.exposed.assign(n, 0);
  std::vector<uint8_t> set(n, 0);   // variables with a VarSet behind
  for (bool again = true; again;) {
    again = false;
    for (Value v = Value(n); v-- > 1;) {
      const Inst& i = f.insts[v];
      // Arithmetic makes NaNs of its own.
      const uint8_t traits = kTraits[size_t(i.op)];
      if (traits & (kArithmetic | kBlind)) continue;
      const auto o = f.operands(i);
      if (i.op == Op::VarSet) {
        set[o[0]] = 1;
        if (!a.exposed[o[0]]) continue;
      } else if ((traits & kPasses) && !a.exposed[v]) {
        continue;
      }
      for (Value x : o) {
        if (!ir::isFloat(f.type(x)) || a.exposed[x]) continue;
        a.exposed[x] = 1;
        again |= set[x] != 0;
      }
    }
  }
}

//! For every instruction its innermost loop; loops by their first instruction.
struct Loops {
  std::vector<uint32_t> of;                               //!< index in `list` + 1, 0 = none
  struct Loop { Value begin, end; uint32_t parent; };
  std::vector<Loop> list;

  explicit Loops(const Function& f) : of(f.insts.size(), 0) {
    uint32_t current = 0;
    for (Value v = 1; v < f.insts.size(); v++) {
      if (f.insts[v].op == Op::Loop) {
        list.push_back({v, v, current});
        current = uint32_t(list.size());
      }
      of[v] = current;
      if (f.insts[v].op == Op::EndLoop) {
        list[current - 1].end = v;
        current = list[current - 1].parent;
      }
    }
  }
  //! Until when a value defined at `def` must live for a use at `at`.
  Value extend(Value def, Value at) const {
    Value until = at;
    for (uint32_t l = of[at]; l && list[l - 1].begin > def; l = list[l - 1].parent) until = list[l - 1].end;
    return until;
  }
};

void findVariables(const Function& f, Analysis& a) {
  const size_t n = f.insts.size();
  a.aliasesVar.assign(n, 0);
  a.setFirst.assign(n, 0);
  if (std::ranges::none_of(f.insts, [](const Inst& i) { return i.op == Op::VarGet || i.op == Op::VarSet; })) return;
  const Loops loops(f);
  std::vector<Value> lastUse(n, 0);
  for (Value v = Value(n); v-- > 1;) {
    if (!a.needed[v]) continue;
    // A bit cast may itself stand for its operand's row.
    const Value at = f.insts[v].op == Op::BitCast ? std::max(v, lastUse[v]) : v;
    for (Value o : f.operands(v)) {
      if (loops.list.empty()) lastUse[o] = std::max(lastUse[o], at);
      else lastUse[o] = std::max({lastUse[o], loops.extend(o, v), loops.extend(o, at)});
    }
  }
  // Regions number from 1; `parent` of the function's is 0.
  std::vector<uint32_t> parent{0, 0}, stack{1}, home(n, 0);
  for (Value v = 1; v < n; v++) {
    const Inst& i = f.insts[v];
    if (i.op == Op::Else || i.op == Op::EndIf || i.op == Op::EndLoop || i.op == Op::EndBlock) stack.pop_back();
    if (a.needed[v] && (i.op == Op::VarSet || i.op == Op::VarGet)) {
      const Value var = f.operands(v)[0];
      if (!home[var]) {
        home[var] = stack.back();
        a.setFirst[var] = i.op == Op::VarSet;
      } else if (a.setFirst[var]) {
        // Lanes that are active later in the region of the first set are active there.
        uint32_t r = stack.back();
        while (r && r != home[var]) r = parent[r];
        a.setFirst[var] = r != 0;
      }
    }
    if (i.op == Op::If || i.op == Op::Else || i.op == Op::Loop || i.op == Op::Block) {
      parent.push_back(stack.back());
      stack.push_back(uint32_t(parent.size() - 1));
    }
  }
  std::vector<Value> nextSet(n, 0);   // by var: behind v
  for (Value v = Value(n); v-- > 1;) {
    const Op op = f.insts[v].op;
    if ((op != Op::VarGet && op != Op::VarSet) || !a.needed[v]) continue;
    const Value var = f.operands(v)[0];
    if (op == Op::VarSet) nextSet[var] = v;
    else a.aliasesVar[v] = !nextSet[var] || nextSet[var] >= lastUse[v];
  }
}

}  // namespace

Analysis analyse(const Function& f) {
  Analysis a;
  findNeeded(f, a);
  findUniform(f, a);
  findNan(f, a);
  findExposed(f, a);
  findVariables(f, a);
  return a;
}

}  // namespace pumice::interp
