#include <algorithm>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/pass_list.h"

namespace pumice::ir {

namespace {

// What the breaks of a function do, known before it is rewritten.
struct Breaks {
  std::vector<bool> idle;  // by instruction: a break behind which nothing runs before its target's end anyway
  std::vector<bool> targeted;  // by loop/block marker: some break that is not idle leaves it
};

Breaks analyseBreaks(const Function& f, const std::vector<Value>& ends) {
  Breaks b{std::vector<bool>(f.insts.size()), std::vector<bool>(f.insts.size())};
  std::vector<Value> open;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    if (i.op == Op::Loop || i.op == Op::Block) open.push_back(v);
    if (i.op == Op::EndLoop || i.op == Op::EndBlock) open.pop_back();
    if (i.op != Op::Break) continue;
    uint64_t left = i.imm + 1;
    for (Value w = v + 1; left; ++w) {
      const Op op = f.insts[w].op;
      if (op == Op::Else)
        w = ends[w];
      else if (op == Op::EndBlock)
        --left;
      else if (op != Op::EndIf)
        break;
    }
    if (left == 0)
      b.idle[v] = true;
    else
      b.targeted[open[open.size() - 1 - i.imm]] = true;
  }
  return b;
}

class Forwarder {
 public:
  explicit Forwarder(const Function& f)
      : in_(f),
        out_(withoutInstructions(f)),
        b_(out_),
        ends_(regionEnds(f)),
        breaks_(analyseBreaks(f, ends_)),
        map_(f.insts.size()),
        varIndex_(f.insts.size()) {}

  Function run() {
    hoistDeclarations();
    Value v = 1;
    while (v < in_.insts.size()) v = step(v);
    return std::move(out_);
  }

 private:
  // A var changed or its value found; `old` is what was known before. Kept so that regions can be undone.
  struct Change {
    uint32_t var;
    Value old;
    bool stored;
  };
  struct Outcome {
    uint32_t var;
    Value value;
    bool stored;
  };
  struct Scope {
    Op op;             // If, Else, Loop, Block; Nop for a construct that vanished
    Value marker = 0;  // in the output: values from here on are not visible behind the construct
    size_t changes = 0;
    bool thenDead = false;
    std::vector<Outcome> thenOutcome;
  };

  void hoistDeclarations() {
    for (Value v = 1; v < in_.insts.size(); ++v) {
      const Inst& i = in_.insts[v];
      if (i.op == Op::Const) map_[v] = b_.constant(i.type, i.imm);
    }
    for (Value v = 1; v < in_.insts.size(); ++v) {
      const Inst& i = in_.insts[v];
      if (i.op != Op::Var && i.op != Op::LocalAlloc) continue;
      if (i.op == Op::Var) {
        varIndex_[v] = uint32_t(current_.size());
        current_.push_back(b_.zero(i.type));
      }
      b_.setLine(i.line);
      b_.setInstFlags(i.flags);
      map_[v] = b_.emit(i.op, i.type, {}, i.imm);
    }
  }

  // Handles instruction v and returns the next one to look at.
  Value step(Value v) {
    const Inst& i = in_.insts[v];
    if (dead_ && !(opInfo(i.op).flags & kControl)) return v + 1;
    if (dead_ && i.op == Op::Break) return v + 1;
    if (dead_ && ends_[v] && i.op != Op::Else) return behind(v);
    b_.setLine(i.line);
    b_.setInstFlags(i.flags);
    switch (i.op) {
      case Op::Const:
      case Op::Var:
      case Op::LocalAlloc:
        return v + 1;
      case Op::VarGet:
        get(v);
        return v + 1;
      case Op::VarSet:
        set(v);
        return v + 1;
      case Op::If:
        return openIf(v);
      case Op::Else:
        return openElse(v);
      case Op::EndIf:
        closeIf();
        return v + 1;
      case Op::Loop:
        openLoop(v);
        return v + 1;
      case Op::Block:
        openBlock(v);
        return v + 1;
      case Op::EndLoop:
      case Op::EndBlock:
        closeConstruct(i.op);
        return v + 1;
      case Op::Break:
        breakOut(v);
        return v + 1;
      default:
        break;
    }
    operands_.clear();
    for (Value o : in_.operands(i)) operands_.push_back(map_[o]);
    map_[v] = b_.emit(i.op, i.type, operands_, i.imm);
    return v + 1;
  }

  // The instruction behind the whole construct that starts at v.
  Value behind(Value v) const {
    Value end = ends_[v];
    if (in_.insts[end].op == Op::Else) end = ends_[end];
    return end + 1;
  }

  void know(uint32_t var, Value value, bool stored) {
    changes_.push_back({var, current_[var], stored});
    current_[var] = value;
  }

  void get(Value v) {
    const Value var = in_.operands(v)[0];
    const uint32_t index = varIndex_[var];
    if (!current_[index]) know(index, b_.get(map_[var]), false);
    map_[v] = current_[index];
  }

  void set(Value v) {
    const Value var = in_.operands(v)[0], value = map_[in_.operands(v)[1]];
    const uint32_t index = varIndex_[var];
    if (current_[index] == value) return;
    b_.set(map_[var], value);
    know(index, value, true);
  }

  // Undoes the changes since `mark` and returns what had become of each var.
  std::vector<Outcome> undo(size_t mark) {
    std::vector<Outcome> outcome;
    for (size_t k = mark; k < changes_.size(); ++k)
      outcome.push_back({changes_[k].var, current_[changes_[k].var], changes_[k].stored});
    std::ranges::sort(outcome, {},
                      [](const Outcome& o) { return o.var * 2 + !o.stored; });  // stored ones first
    outcome.erase(std::unique(outcome.begin(), outcome.end(),
                              [](const Outcome& a, const Outcome& b) { return a.var == b.var; }),
                  outcome.end());
    while (changes_.size() > mark) {
      current_[changes_.back().var] = changes_.back().old;
      changes_.pop_back();
    }
    return outcome;
  }

  Value openIf(Value v) {
    const Value mask = map_[in_.operands(v)[0]];
    uint64_t constant = 0;
    if (b_.isConstant(mask, &constant)) {
      scopes_.push_back({Op::Nop, 0, 0, false, {}});
      if (constant) return v + 1;
      const Value end = ends_[v];  // to the first instruction of the else side, or the endif itself
      return in_.insts[end].op == Op::Else ? end + 1 : end;
    }
    b_.beginIf(mask);
    scopes_.push_back({Op::If, Value(out_.insts.size() - 1), changes_.size(), false, {}});
    return v + 1;
  }

  Value openElse(Value v) {
    Scope& s = scopes_.back();
    if (s.op == Op::Nop) return ends_[v];  // the condition was true
    s.op = Op::Else;
    s.thenOutcome = undo(s.changes);
    s.thenDead = dead_;
    dead_ = false;
    b_.beginElse();
    return v + 1;
  }

  void closeIf() {
    Scope s = std::move(scopes_.back());
    scopes_.pop_back();
    if (s.op == Op::Nop) return;
    b_.endIf();
    std::vector<Outcome> last = undo(s.changes);
    const bool hasElse = s.op == Op::Else;
    const std::vector<Outcome>& first = hasElse ? s.thenOutcome : last;
    const std::vector<Outcome> kNone;
    merge(s.marker, first, hasElse ? s.thenDead : dead_, hasElse ? last : kNone, hasElse && dead_);
    dead_ = hasElse && s.thenDead && dead_;
  }

  // Lanes of a side that ends dead have left an enclosing construct: what they stored does not matter here.
  void merge(Value marker, const std::vector<Outcome>& a, bool aDead, const std::vector<Outcome>& b,
             bool bDead) {
    size_t i = 0, j = 0;
    while (i < a.size() || j < b.size()) {
      const uint32_t var = std::min(i < a.size() ? a[i].var : ~0u, j < b.size() ? b[j].var : ~0u);
      Outcome oa{var, current_[var], false}, ob = oa;
      if (i < a.size() && a[i].var == var) oa = a[i++];
      if (j < b.size() && b[j].var == var) ob = b[j++];
      if (!oa.stored && !ob.stored) continue;
      // A value only read inside is the one known outside, if any.
      if (!oa.stored) oa.value = current_[var];
      if (!ob.stored) ob.value = current_[var];
      Value merged = aDead ? ob.value : bDead ? oa.value : oa.value == ob.value ? oa.value : 0;
      if (merged >= marker) merged = 0;
      know(var, merged, true);
    }
  }

  void openLoop(Value v) {
    // A later turn may come with another value, and lanes leave from several places.
    for (Value w = v + 1; w < ends_[v]; ++w) {
      if (in_.insts[w].op != Op::VarSet) continue;
      const uint32_t var = varIndex_[in_.operands(w)[0]];
      if (current_[var]) know(var, 0, true);
    }
    b_.beginLoop();
    constructs_.push_back(true);
    scopes_.push_back({Op::Loop, 0, changes_.size(), false, {}});
  }

  void openBlock(Value v) {
    const bool kept = breaks_.targeted[v];
    constructs_.push_back(kept);
    if (kept) b_.beginBlock();
    scopes_.push_back({kept ? Op::Block : Op::Nop, 0, changes_.size(), false, {}});
  }

  void closeConstruct(Op op) {
    const Scope s = std::move(scopes_.back());
    scopes_.pop_back();
    constructs_.pop_back();
    if (s.op == Op::Nop) return;
    b_.emit(op, Type::None, {});
    dead_ = false;
    for (const Outcome& o : undo(s.changes))
      if (o.stored) know(o.var, 0, true);
  }

  void breakOut(Value v) {
    if (breaks_.idle[v]) return;
    const size_t target = constructs_.size() - 1 - in_.insts[v].imm;
    uint32_t depth = 0;
    for (size_t k = target + 1; k < constructs_.size(); ++k) depth += constructs_[k];
    b_.breakOut(depth);
    dead_ = true;
  }

  const Function& in_;
  Function out_;
  Builder b_;
  const std::vector<Value> ends_;
  const Breaks breaks_;
  std::vector<Value> map_, operands_;
  std::vector<uint32_t> varIndex_;
  std::vector<Value> current_;  // by var: its value in all active lanes, 0 = unknown
  std::vector<Change> changes_;
  std::vector<Scope> scopes_;
  std::vector<bool> constructs_;  // open loops and blocks: still there in the output?
  bool dead_ = false;             // no lane is active: behind a break
};

}  // namespace

bool forwardVariables(Function& f) {
  const size_t before = f.insts.size();
  f = Forwarder(f).run();
  return f.insts.size() != before;
}

}  // namespace pumice::ir
