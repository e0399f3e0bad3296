#include <algorithm>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/pass_list.h"

namespace pumice::ir {

namespace {

constexpr unsigned kMaxOperations = 4, kMaxStores = 4;

// Cheap enough to run for all lanes. Loads from tables are bounded and so could run too, but are not cheap.
bool isCheap(const Inst& i) {
  const uint8_t flags = opInfo(i.op).flags;
  if (!(flags & kPure) || (flags & kHigh) || (i.flags & kInstVolatile)) return false;
  switch (i.op) {
    case Op::FDiv:
    case Op::FSqrt:
    case Op::SDiv:
    case Op::UDiv:
    case Op::SRem:
    case Op::URem:
    case Op::TableLoad:
    case Op::LoadConst:
    case Op::FilterHalves:
    case Op::FilterBytes:
    case Op::FilterLevel:
    case Op::FilterLevels:
    case Op::QuadLoad:
      return false;
    default:
      return true;
  }
}
bool isFree(Op op) { return op == Op::Const || op == Op::Input || op == Op::UniformInput; }

struct Store {
  Value var = 0;
  Value side[2] = {};  // 0 = keeps the old value
};

// Whether the `if` at `start` may be converted, and what it stores.
bool convertible(const Function& f, Value start, std::vector<Store>& stores) {
  stores.clear();
  unsigned operations = 0;
  int side = 0;
  for (Value v = start + 1;; ++v) {
    const Inst& i = f.insts[v];
    if (i.op == Op::EndIf) return true;
    if (i.op == Op::Else) {
      side = 1;
    } else if (i.op == Op::VarGet) {
      // All reads move before all stores.
      for (const Store& s : stores)
        if (s.var == f.operands(i)[0] && s.side[side]) return false;
    } else if (i.op == Op::VarSet) {
      const Value var = f.operands(i)[0];
      auto s = std::ranges::find(stores, var, &Store::var);
      if (s == stores.end()) {
        if (stores.size() == kMaxStores) return false;
        s = stores.insert(stores.end(), Store{var, {}});
      }
      s->side[side] = f.operands(i)[1];
    } else if (!isCheap(i) || (!isFree(i.op) && ++operations > kMaxOperations)) {
      return false;
    }
  }
}

class Converter {
 public:
  explicit Converter(const Function& f)
      : in_(f), out_(withoutInstructions(f)), b_(out_), ends_(regionEnds(f)), map_(f.insts.size()) {}

  Function run() {
    for (Value v = 1; v < in_.insts.size(); ++v) {
      if (in_.insts[v].op == Op::If && convertible(in_, v, stores_)) v = convert(v);
      else copy(v);
    }
    return std::move(out_);
  }

 private:
  Value convert(Value start) {
    const Value mask = map_[in_.operands(start)[0]];
    Value v = start + 1;
    for (; in_.insts[v].op != Op::EndIf; ++v)
      if (in_.insts[v].op != Op::Else && in_.insts[v].op != Op::VarSet) copy(v);
    b_.setLine(in_.insts[start].line);
    b_.setInstFlags(0);
    for (const Store& s : stores_) {
      const Value var = map_[s.var];
      const Value old = s.side[0] && s.side[1] ? 0 : b_.get(var);
      b_.set(var, b_.select(mask, s.side[0] ? map_[s.side[0]] : old, s.side[1] ? map_[s.side[1]] : old));
    }
    return v;
  }

  void copy(Value v) {
    const Inst& i = in_.insts[v];
    operands_.clear();
    for (Value o : in_.operands(i)) operands_.push_back(map_[o]);
    b_.setLine(i.line);
    b_.setInstFlags(i.flags);
    map_[v] = b_.emit(i.op, i.type, operands_, i.imm);
  }

  const Function& in_;
  Function out_;
  Builder b_;
  std::vector<Value> ends_, map_, operands_;
  std::vector<Store> stores_;
};

}  // namespace

bool convertIfs(Function& f) {
  std::vector<Store> stores;
  Value v = 1;
  while (v < f.insts.size() && !(f.insts[v].op == Op::If && convertible(f, v, stores))) ++v;
  if (v == f.insts.size()) return false;
  f = Converter(f).run();
  return true;
}

}  // namespace pumice::ir
