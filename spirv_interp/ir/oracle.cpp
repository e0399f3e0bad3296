#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/pass_list.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::ir {

namespace {

constexpr uint64_t kMostRemembered = 16 * 1024;   //!< bytes of a private array whose doubles are kept

bool isSmall(Type t) { return t == Type::F16 || t == Type::F32; }

//! Each value of a small float type has a natural form: *narrow* (the declared type; its bits count: loads, casts) or
//! *wide* (a double: arithmetic). The other form is made beside it where some use asks for it.
class Widener {
 public:
  explicit Widener(const Function& f)
      : in_(f), out_(withoutInstructions(f)), b_(out_), wide_(f.insts.size()), other_(f.insts.size()), form_(f.insts.size()), doubles_(f.insts.size()) {}

  Function run() {
    findNatural();
    for (Value v = 1; v < in_.insts.size(); ++v) {
      const auto o = in_.operands(v);
      for (size_t k = 0; k < o.size(); ++k)
        if (isSmall(in_.type(o[k])) && in_.insts[o[k]].op != Op::Var && wants(v, k) != wide_[o[k]]) other_[o[k]] = true;
    }
    for (Value v = 1; v < in_.insts.size(); ++v) copy(v);
    return std::move(out_);
  }

 private:
  struct Forms {
    Value narrow = 0, wide = 0;   // values that are not small floats: narrow
  };

  bool keeps(const Inst& i) const { return i.op == Op::FToF && (i.flags & kInstKeep); }
  static bool moves(Op op) { return op == Op::Select || op == Op::FNeg || op == Op::FAbs || op == Op::QuadSwizzle || op == Op::SubgroupShuffle; }
  //! Private arrays and work-group memory keep the double beside the declared value.
  static bool remembers(Op op) { return op == Op::LocalLoad || op == Op::SharedLoad; }
  static bool computes(Op op) { return (opInfo(op).operands == OperandRule::Float && !moves(op)) || op == Op::SubgroupReduce; }

  bool natural(Value v) const {
    const Inst& i = in_.insts[v];
    const auto o = in_.operands(i);
    if (computes(i.op) || i.op == Op::SToF || i.op == Op::UToF || remembers(i.op)) return true;
    if (i.op == Op::FToF) return keeps(i) && (!isSmall(in_.type(o[0])) || wide_[o[0]]);
    if (i.op == Op::VarGet) return wide_[o[0]];
    if (i.op == Op::Select) return wide_[o[1]] || wide_[o[2]];
    return moves(i.op) && wide_[o[0]];
  }
  void findNatural() {
    // Variables feed back through loops: repeat until nothing changes.
    for (bool changed = true; changed;) {
      changed = false;
      for (Value v = 1; v < in_.insts.size(); ++v) {
        const Inst& i = in_.insts[v];
        const bool set = i.op == Op::VarSet;
        const Value target = set ? in_.operands(i)[0] : v;
        if (!isSmall(in_.type(target)) || wide_[target]) continue;
        if (set ? bool(wide_[in_.operands(i)[1]]) : i.op != Op::Var && natural(v)) wide_[target] = changed = true;
      }
    }
  }

  //! Whether instruction v takes its operand k, a small float, as a double.
  bool wants(Value v, size_t k) const {
    const Inst& i = in_.insts[v];
    const auto o = in_.operands(i);
    if (computes(i.op)) return true;
    if (moves(i.op)) return wide_[v];
    if (i.op == Op::VarSet) return wide_[o[0]];
    if (i.op == Op::FToS || i.op == Op::FToU) return wide_[o[k]];
    if (i.op == Op::FToF) return keeps(i) && (!isSmall(i.type) || wide_[v]);
    if (opInfo(i.op).operands == OperandRule::CmpF) return !(i.flags & kInstDeclared) && (wide_[o[0]] || wide_[o[1]]);
    return false;
  }

  void define(Value v, Value made) {
    const Type declared = in_.type(v);
    if (!isSmall(declared)) {
      form_[v].narrow = made;
      return;
    }
    (wide_[v] ? form_[v].wide : form_[v].narrow) = made;
    if (!other_[v]) return;
    b_.setInstFlags(0);
    if (wide_[v]) form_[v].narrow = b_.convert(Op::FToF, declared, made);
    else form_[v].wide = b_.convert(Op::FToF, Type::F64, made);
  }

  void copy(Value v) {
    const Inst& i = in_.insts[v];
    const auto o = in_.operands(i);
    b_.setLine(i.line);
    b_.setInstFlags(i.flags);
    if (keeps(i) && (!isSmall(i.type) || wide_[v])) return define(v, isSmall(in_.type(o[0])) ? form_[o[0]].wide : form_[o[0]].narrow);
    operands_.clear();
    for (size_t k = 0; k < o.size(); ++k) {
      const bool small = isSmall(in_.type(o[k]));
      const bool wide = small && (in_.insts[o[k]].op == Op::Var ? bool(wide_[o[k]]) : wants(v, k));
      operands_.push_back(wide ? form_[o[k]].wide : form_[o[k]].narrow);
    }
    if (i.op == Op::LocalAlloc) {
      define(v, b_.emit(i.op, i.type, operands_, i.imm));
      if (i.imm && i.imm < kMostRemembered) doubles_[v] = b_.emit(Op::LocalAlloc, Type::I32, {}, i.imm * 8);
      return;
    }
    if ((i.op == Op::LocalLoad || i.op == Op::SharedLoad) && isSmall(i.type)) return recall(v, i, o);
    define(v, b_.emit(i.op, isSmall(i.type) && wide_[v] ? Type::F64 : i.type, operands_, i.imm));
    if ((i.op == Op::LocalStore || i.op == Op::SharedStore) && isSmall(in_.type(o.back()))) remember(i, o);
  }

  // A double has its place at eight times the byte offset in memory beside the declared one. It counts if it still rounds
  // to what lies there: whoever stores something else (other types over the same bytes) makes it void.
  bool hasDouble(const Inst& i, std::span<const Value> o) const { return i.op == Op::SharedLoad || i.op == Op::SharedStore || doubles_[o[0]]; }
  Value doublePlace(const Inst& i, Value offset) { return b_.imul(b_.iadd(offset, b_.i32(uint32_t(i.imm))), b_.i32(8)); }
  uint64_t doubleArea(const Inst& i) const { return i.op == Op::SharedLoad || i.op == Op::SharedStore ? in_.sharedBytes : 0; }

  void recall(Value v, const Inst& i, std::span<const Value> o) {
    const bool local = i.op == Op::LocalLoad;
    const Value declared = b_.emit(i.op, i.type, operands_, i.imm);
    b_.setInstFlags(0);
    const Value given = b_.convert(Op::FToF, Type::F64, declared);
    form_[v] = {declared, given};
    if (!hasDouble(i, o)) return;
    const Value place = doublePlace(i, operands_[local ? 1 : 0]);
    const Value kept = local ? b_.emit(Op::LocalLoad, Type::F64, {doubles_[o[0]], place}) : b_.emit(Op::SharedLoad, Type::F64, {place}, doubleArea(i));
    const Type bits = intOf(i.type);
    const Value same = b_.ieq(b_.bitcast(bits, b_.convert(Op::FToF, i.type, kept)), b_.bitcast(bits, declared));
    form_[v].wide = b_.select(same, kept, given);
  }
  void remember(const Inst& i, std::span<const Value> o) {
    if (!hasDouble(i, o)) return;
    const Value v = o.back();
    b_.setInstFlags(0);
    const Value value = form_[v].wide ? form_[v].wide : b_.convert(Op::FToF, Type::F64, form_[v].narrow);
    if (i.op == Op::LocalStore) b_.emit(Op::LocalStore, Type::None, {doubles_[o[0]], doublePlace(i, operands_[1]), value});
    else b_.emit(Op::SharedStore, Type::None, {doublePlace(i, operands_[0]), value}, doubleArea(i));
  }

  const Function& in_;
  Function out_;
  Builder b_;
  std::vector<uint8_t> wide_, other_;   // by value: the natural form; some use wants the other one
  std::vector<Forms> form_;
  std::vector<Value> doubles_;          // by LocalAlloc: where its doubles are
  std::vector<Value> operands_;
};

}  // namespace

void widenFloats(Function& f) {
  f = Widener(f).run();
  f.sharedBytes = oracleSharedBytes(f.sharedBytes);
  computeRates(f);
}

}  // namespace pumice::ir
