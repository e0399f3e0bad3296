#include <utility>

#include "spirv_interp/ir/pass_list.h"

namespace pumice::ir {

namespace {

bool isRoot(const Function& f, const Inst& i) {
  switch (i.op) {
    case Op::Var:
    case Op::VarSet:
    case Op::LocalAlloc:
    case Op::LocalStore:
      return false;
    case Op::Break:
      return true;
    case Op::ImageOp: {
      const ImageKind kind = f.imageOps[i.imm].kind;
      return kind == ImageKind::Write || kind == ImageKind::Atomic;
    }
    default:
      return (opInfo(i.op).flags & (kEffect | kControl)) == kEffect || (i.flags & kInstVolatile);
  }
}

// Stores to vars that the next store in the same region overwrites: nothing between may read the var or move
// lanes.
std::vector<bool> overwrittenStores(const Function& f) {
  std::vector<bool> dead(f.insts.size());
  struct Pending {
    Value store = 0;
    uint32_t epoch = 0;
  };
  std::vector<Pending> pending(f.insts.size());   // by var
  uint32_t epoch = 0;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    if (opInfo(i.op).flags & kControl) ++epoch;
    if (i.op == Op::VarGet) pending[f.operands(i)[0]] = {};
    if (i.op != Op::VarSet) continue;
    Pending& p = pending[f.operands(i)[0]];
    if (p.store && p.epoch == epoch) dead[p.store] = true;
    p = {v, epoch};
  }
  return dead;
}

class Marker {
 public:
  explicit Marker(const Function& f)
      : f_(f),
        ends_(regionEnds(f)),
        live(f.insts.size()),
        parent_(f.insts.size()),
        lastWriter_(f.insts.size()),
        writerBefore_(f.insts.size()) {}

  void run() {
    const std::vector<bool> overwritten = overwrittenStores(f_);
    std::vector<Value> open{0};
    for (Value v = 1; v < f_.insts.size(); ++v) {
      const Inst& i = f_.insts[v];
      const bool closes =
          i.op == Op::Else || i.op == Op::EndIf || i.op == Op::EndLoop || i.op == Op::EndBlock;
      // An else hangs on its if: where it lives, so does the if.
      const Value before = open.back();
      if (closes) open.pop_back();
      parent_[v] = i.op == Op::Else ? before : open.back();
      if (ends_[v]) open.push_back(v);
      if ((i.op == Op::VarSet || i.op == Op::LocalStore) && !overwritten[v])
        writerBefore_[v] = std::exchange(lastWriter_[f_.operands(i)[0]], v);
    }
    for (Value v = 1; v < f_.insts.size(); ++v)
      if (isRoot(f_, f_.insts[v])) mark(v);
    while (!work_.empty()) {
      const Value v = work_.back();
      work_.pop_back();
      const Inst& i = f_.insts[v];
      for (Value o : f_.operands(i)) mark(o);
      mark(parent_[v]);
      if (ends_[v] && f_.insts[ends_[v]].op != Op::Else) mark(ends_[v]);
      // An if that lives without its else still needs its end.
      if (i.op == Op::If && f_.insts[ends_[v]].op == Op::Else) mark(ends_[ends_[v]]);
      if (i.op == Op::VarGet || i.op == Op::LocalLoad)
        for (Value w = lastWriter_[f_.operands(i)[0]]; w; w = writerBefore_[w]) mark(w);
    }
  }

 private:
  void mark(Value v) {
    if (v == 0 || live[v]) return;
    live[v] = true;
    work_.push_back(v);
  }
  const Function& f_;
  std::vector<Value> ends_;

 public:
  std::vector<bool> live;

 private:
  std::vector<Value> parent_;                // marker of the region an instruction stands in
  std::vector<Value> lastWriter_;            // by var or local allocation
  std::vector<Value> writerBefore_;          // by writer: the one before it
  std::vector<Value> work_;
};

}  // namespace

bool removeDeadCode(Function& f) {
  Marker marker(f);
  marker.run();
  Function out = withoutInstructions(f);
  std::vector<Value> renamed(f.insts.size());
  for (Value v = 1; v < f.insts.size(); ++v) {
    if (!marker.live[v]) continue;
    Inst i = f.insts[v];
    const auto first = uint32_t(out.operandPool.size());
    for (Value o : f.operands(i)) out.operandPool.push_back(renamed[o]);
    i.firstOperand = first;
    renamed[v] = Value(out.insts.size());
    out.insts.push_back(i);
  }
  const bool changed = out.insts.size() != f.insts.size();
  f = std::move(out);
  return changed;
}

}  // namespace pumice::ir
