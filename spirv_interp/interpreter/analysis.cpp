#include "spirv_interp/interpreter/analysis.h"

#include <algorithm>
#include <array>

namespace pumice::interp {
namespace {

using ir::Function, ir::Inst, ir::Op, ir::Value;

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
  kRoot = 8,         //!< has an effect whoever takes its result; VarSet only if somebody reads the variable
  kStructure = 16,   //!< Analysis::structure
  kIsPure = 32,
};
constexpr auto kTraits = [] {
  std::array<uint8_t, size_t(Op::kCount)> table{};
  for (size_t op = 0; op < table.size(); op++) {
    const Op o = Op(op);
    if (isArithmetic(o)) table[op] |= kArithmetic;
    if (o == Op::FToS || o == Op::FToU || ir::opInfo(o).operands == ir::OperandRule::CmpF) table[op] |= kBlind;
    if (o == Op::Select || o == Op::VarGet || movesLanes(o) || isSign(o)) table[op] |= kPasses;
    const uint8_t flags = ir::opInfo(o).flags;
    if ((flags & ir::kEffect) && o != Op::Var && o != Op::LocalAlloc) table[op] |= kRoot;
    if ((flags & ir::kControl) || o == Op::Var || o == Op::VarGet || o == Op::VarSet) table[op] |= kStructure;
    if (flags & ir::kPure) table[op] |= kIsPure;
  }
  return table;
}();

NanBits join(NanBits a, NanBits b) { return std::max(a, b); }

bool isNan(ir::Type t, uint64_t bits) {
  switch (ir::typeBytes(t)) {
    case 2: return (bits & 0x7fff) > 0x7c00;
    case 4: return (bits & 0x7fffffff) > 0x7f800000;
    default: return (bits & 0x7fffffffffffffff) > 0x7ff0000000000000;
  }
}

//! What is known of the operands, in order: uniform, nan.
class Forward {
 public:
  Forward(const Function& f, Analysis& a) : f_(f), a_(a), read_(f.insts.size(), 0) {}

  void run() {
    const Value n = Value(f_.insts.size());
    a_.uniform.assign(n, 0);
    a_.nan.assign(n, NanBits::Settled);
    a_.structure.reserve(16);
    bool again = false;
    for (Value v = 1; v < n; v++) {
      const Inst& i = f_.insts[v];
      const uint8_t traits = kTraits[size_t(i.op)];
      a_.present[size_t(i.op)] = true;
      if (traits & kStructure) a_.structure.push_back(v);
      if (i.rate <= ir::Rate::Draw && (traits & kIsPure) && i.type != ir::Type::None) {
        uint8_t uniform = 1;
        for (Value o : f_.operands(i)) uniform &= a_.uniform[o];
        a_.uniform[v] = uniform;
      }
      again |= nan(v, i, traits);
    }
    // Variables feed back through loops: repeat until none rises that was looked at before.
    while (again) {
      again = false;
      for (Value v = 1; v < n; v++) again |= nan(v, f_.insts[v], kTraits[size_t(f_.insts[v].op)]);
    }
  }

 private:
  //! True: what was looked at before has changed.
  bool nan(Value v, const Inst& i, uint8_t traits) {
    if (i.op == Op::VarSet) {
      const auto o = f_.operands(i);
      const NanBits set = join(a_.nan[o[0]], a_.nan[o[1]]);
      const bool rises = set != a_.nan[o[0]];
      a_.nan[o[0]] = set;
      return rises && read_[o[0]];
    }
    if (!ir::isFloat(i.type) || i.op == Op::Var) return false;
    NanBits r = NanBits::Kept;
    if (traits & kArithmetic) r = NanBits::Arithmetic;
    else if (i.op == Op::Const) r = isNan(i.type, i.imm) ? NanBits::Kept : NanBits::Settled;
    else if (i.op == Op::SToF || i.op == Op::UToF) r = NanBits::Settled;
    else if (i.op == Op::Select) r = join(a_.nan[f_.operands(i)[1]], a_.nan[f_.operands(i)[2]]);
    else if (i.op == Op::VarGet || movesLanes(i.op)) {
      r = a_.nan[f_.operands(i)[0]];
      read_[f_.operands(i)[0]] = 1;
    }
    a_.nan[v] = r;
    return false;
  }

  const Function& f_;
  Analysis& a_;
  std::vector<uint8_t> read_;   // variables whose value was looked at
};

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

//! What is known of the users, from the last one on: needed, exposed; when values are used last.
class Backward {
 public:
  Backward(const Function& f, Analysis& a) : f_(f), a_(a) {}

  void run() {
    const size_t n = f_.insts.size();
    a_.needed.assign(n, 0);
    a_.exposed.assign(n, 0);
    const bool variables = has(Op::VarGet) || has(Op::VarSet);
    if (variables) {
      read_.assign(n, 0);
      set_.assign(n, 0);
      lastUse.assign(n, 0);
      for (Value v : a_.structure)
        if (f_.insts[v].op == Op::VarGet) read_[f_.operands(v)[0]] = 1;
    }
    if (variables && has(Op::Loop)) {
      const Loops loops(f_);
      pass<true>([&](Value def, Value v, Value at) { lastUse[def] = std::max({lastUse[def], loops.extend(def, v), loops.extend(def, at)}); });
    } else if (variables) {
      pass<true>([&](Value def, Value, Value at) { lastUse[def] = std::max(lastUse[def], at); });
    } else {
      pass<false>([](Value, Value, Value) {});
    }
  }

  std::vector<Value> lastUse;   // only if there are variables

 private:
  bool has(Op op) const { return a_.present[size_t(op)]; }

  template <bool kVariables, class Use>
  void pass(Use use) {
    bool again = false;
    for (Value v = Value(f_.insts.size()); v-- > 1;) {
      const Inst& i = f_.insts[v];
      const uint8_t traits = kTraits[size_t(i.op)];
      if ((traits & kRoot) && (i.op != Op::VarSet || read_[f_.operands(i)[0]])) a_.needed[v] = 1;
      if (a_.needed[v]) {
        // A bit cast may itself stand for its operand's row.
        const Value at = kVariables && i.op == Op::BitCast ? std::max(v, lastUse[v]) : v;
        for (Value o : f_.operands(i)) {
          a_.needed[o] = 1;
          use(o, v, at);
        }
      }
      again |= expose<kVariables>(v, i, traits);
    }
    while (again) {
      again = false;
      for (Value v = Value(f_.insts.size()); v-- > 1;) again |= expose<kVariables>(v, f_.insts[v], kTraits[size_t(f_.insts[v].op)]);
    }
  }

  //! True: what was asked for before has changed.
  template <bool kVariables>
  bool expose(Value v, const Inst& i, uint8_t traits) {
    // Arithmetic makes NaNs of its own.
    if (traits & (kArithmetic | kBlind)) return false;
    const auto o = f_.operands(i);
    if (kVariables && i.op == Op::VarSet) {
      set_[o[0]] = 1;
      if (!a_.exposed[o[0]]) return false;
    } else if ((traits & kPasses) && !a_.exposed[v]) {
      return false;
    }
    bool again = false;
    for (Value x : o) {
      if (!ir::isFloat(f_.type(x)) || a_.exposed[x]) continue;
      a_.exposed[x] = 1;
      if (kVariables) again |= set_[x] != 0;
    }
    return again;
  }

  const Function& f_;
  Analysis& a_;
  std::vector<uint8_t> read_;   // vars that somebody reads
  std::vector<uint8_t> set_;    // variables with a VarSet behind
};

void findVariables(const Function& f, Analysis& a, const std::vector<Value>& lastUse) {
  const size_t n = f.insts.size();
  a.aliasesVar.assign(n, 0);
  a.setFirst.assign(n, 0);
  if (lastUse.empty()) return;
  // Regions number from 1; `parent` of the function's is 0.
  std::vector<uint32_t> parent{0, 0}, stack{1}, home(n, 0);
  for (Value v : a.structure) {
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
  for (size_t k = a.structure.size(); k-- > 0;) {
    const Value v = a.structure[k];
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
  Forward(f, a).run();
  Backward backward(f, a);
  backward.run();
  findVariables(f, a, backward.lastUse);
  return a;
}

}  // namespace pumice::interp
