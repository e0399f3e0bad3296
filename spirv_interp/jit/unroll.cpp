#include "spirv_interp/jit/unroll.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>
#include <vector>

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

namespace {

constexpr uint32_t kMostTurns = 16, kMostInstructions = 320;

//! loop; n = var.get; condition on n; mask.not; if; break 0; endif; body with one var.set var, n + step; endloop
struct Counted {
  Value begin = 0, body = 0, end = 0;
  Value counter = 0;   //!< the var.get
  uint32_t first = 0, step = 0, turns = 0;
};

class Unroller {
 public:
  explicit Unroller(const Function& f) : f_(f) {}

  bool run(Function& out) {
    std::vector<Counted> loops;
    for (Value v = 1; v < f_.insts.size(); v++)
      if (Counted c; f_.insts[v].op == Op::Loop && counted(v, c)) loops.push_back(c);
    if (loops.empty()) return false;
    out.insts.reserve(f_.insts.size() + 256);
    renamed_.assign(f_.insts.size(), 0);
    auto loop = loops.begin();
    for (Value v = 1; v < f_.insts.size(); v++) {
      if (loop == loops.end() || loop->begin != v) {
        copy(out, v);
        continue;
      }
      for (uint32_t turn = 0; turn < loop->turns; turn++) {
        renamed_[loop->counter] = append(out, {.op = Op::Const, .type = Type::I32, .imm = loop->first + turn * loop->step}, {});
        for (Value w = loop->body; w < loop->end; w++) copy(out, w);
      }
      v = loop->end;
      ++loop;
    }
    return true;
  }

 private:
  const Inst& inst(Value v) const { return f_.insts[v]; }
  bool isConst(Value v) const { return inst(v).op == Op::Const && inst(v).type == Type::I32; }

  bool counted(Value begin, Counted& c) const {
    const Value n = Value(f_.insts.size());
    if (begin + 7 >= n) return false;
    c.begin = begin;
    c.counter = begin + 1;
    const Value compare = begin + 2, negated = begin + 3;
    if (inst(c.counter).op != Op::VarGet || inst(c.counter).type != Type::I32 || inst(negated).op != Op::MaskNot || f_.operands(negated)[0] != compare ||
        inst(begin + 4).op != Op::If || f_.operands(begin + 4)[0] != negated || inst(begin + 5).op != Op::Break || inst(begin + 5).imm || inst(begin + 6).op != Op::EndIf)
      return false;
    const Op op = inst(compare).op;
    if (op != Op::ULt && op != Op::ULe && op != Op::SLt && op != Op::SLe) return false;
    const auto o = f_.operands(compare);
    if (o[0] != c.counter || !isConst(o[1])) return false;
    const uint32_t bound = uint32_t(inst(o[1]).imm);
    const Value var = f_.operands(c.counter)[0];
    c.body = begin + 7;
    Value set = 0;
    for (c.end = c.body; c.end < n && inst(c.end).op != Op::EndLoop; c.end++) {
      const Inst& i = inst(c.end);
      if ((ir::opInfo(i.op).flags & ir::kControl) || i.op == Op::Var || i.op == Op::LocalAlloc) return false;
      for (Value used : f_.operands(c.end))
        if (used == compare || used == negated) return false;
      if (i.op == Op::VarGet && f_.operands(c.end)[0] == var && set) return false;
      if (i.op != Op::VarSet || f_.operands(c.end)[0] != var) continue;
      if (set) return false;
      set = c.end;
    }
    if (!set || c.end == n) return false;
    const Value next = f_.operands(set)[1];
    const auto sum = f_.operands(next);
    if (inst(next).op != Op::IAdd || next < c.body) return false;
    const Value step = sum[0] == c.counter ? sum[1] : sum[1] == c.counter ? sum[0] : 0;
    if (!step || !isConst(step)) return false;
    c.step = uint32_t(inst(step).imm);
    // Set just before, in the same region.
    Value before = begin - 1;
    while (before && inst(before).op != Op::VarSet && !(ir::opInfo(inst(before).op).flags & ir::kControl)) before--;
    while (before && inst(before).op == Op::VarSet && f_.operands(before)[0] != var) before--;
    if (!before || inst(before).op != Op::VarSet || !isConst(f_.operands(before)[1])) return false;
    c.first = uint32_t(inst(f_.operands(before)[1]).imm);
    const auto goesOn = [&](uint32_t x) {
      switch (op) {
        case Op::ULt: return x < bound;
        case Op::ULe: return x <= bound;
        case Op::SLt: return int32_t(x) < int32_t(bound);
        default: return int32_t(x) <= int32_t(bound);
      }
    };
    for (uint32_t x = c.first; goesOn(x); x += c.step)
      if (++c.turns > kMostTurns) return false;
    return c.turns * (c.end - c.body) <= kMostInstructions;
  }

  static Value append(Function& out, Inst i, std::span<const Value> operands) {
    i.firstOperand = uint32_t(out.operandPool.size());
    i.operandCount = uint32_t(operands.size());
    out.operandPool.insert(out.operandPool.end(), operands.begin(), operands.end());
    out.insts.push_back(i);
    return Value(out.insts.size() - 1);
  }
  void copy(Function& out, Value v) {
    const Inst& i = inst(v);
    operands_.clear();
    for (Value o : f_.operands(v)) operands_.push_back(renamed_[o]);
    if (i.type == Type::I32 && operands_.size() == 2 && (i.op == Op::IAdd || i.op == Op::ISub || i.op == Op::IMul || i.op == Op::Shl)) {
      const Inst &a = out.insts[operands_[0]], &b = out.insts[operands_[1]];
      if (a.op == Op::Const && b.op == Op::Const) {
        const uint32_t x = uint32_t(a.imm), y = uint32_t(b.imm);
        const uint32_t result = i.op == Op::IAdd ? x + y : i.op == Op::ISub ? x - y : i.op == Op::IMul ? x * y : x << (y & 31);
        renamed_[v] = append(out, {.op = Op::Const, .type = Type::I32, .line = i.line, .imm = result}, {});
        return;
      }
    }
    renamed_[v] = append(out, i, operands_);
  }

  const Function& f_;
  std::vector<Value> renamed_, operands_;
};

}  // namespace

bool unrollLoops(Function& f) {
  if (std::none_of(f.insts.begin(), f.insts.end(), [](const Inst& i) { return i.op == Op::Loop; })) return false;
  Function out;
  out.name = f.name;
  out.imageOps = f.imageOps;
  out.sharedBytes = f.sharedBytes;
  std::copy(std::begin(f.groupSize), std::end(f.groupSize), out.groupSize);
  if (!Unroller(f).run(out)) return false;
  f = std::move(out);
  return true;
}

}  // namespace pumice::jit
