#include "spirv_interp/interpreter/lower.h"

#include <algorithm>
#include <array>
#include <bit>

#include "spirv_interp/interpreter/analysis.h"
#include "spirv_interp/interpreter/code_list.h"
#include "spirv_interp/ir/waits.h"

namespace pumice::interp {
namespace {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

constexpr size_t kMaxOperands = 5;
constexpr size_t kMaxLocalBytes = 64 << 20;   //!< of a row of kMaxLanes

class Lowering {
 public:
  Lowering(const Function& f, const KernelTable& kernels, const CheckedShader& checked)
      : f_(f), k_(kernels), a_(analyse(f)), slot_(f.insts.size(), 0), checked_(checked) {}

  Result<Program> run() {
    list_ = &body_;
    rows_.assign(f_.insts.size(), {});
    for (at_ = 1; at_ < f_.insts.size() && error_.empty(); at_++)
      if (a_.needed[at_]) storage(at_);
    for (at_ = 1; at_ < f_.insts.size() && error_.empty(); at_++)
      if (a_.needed[at_] && !a_.uniform[at_]) instruction(at_);
    const size_t end = body_.add(control(Control::End), {}, {});
    resolve(pending_, end);
    pending_.clear();

    program_.mayWait = mayWait();
    makePreamble();
    if (!error_.empty()) return base::Error{error_};
    if (!body_.finish(program_.body, program_.bodyRegisters) || !pre_.finish(program_.preamble, program_.preambleRegisters))
      return base::errorf("%s: too many values live at once for the interpreter", f_.name.c_str());
    return std::move(program_);
  }

 private:
  using Operands = std::array<Operand, kMaxOperands>;

  // --- operands

  Operand operand(Value v) {
    if (a_.uniform[v]) {
      // In the preamble only constants come from the bank.
      if (list_ == &pre_ && f_.insts[v].op != Op::Const) return row(v);
      return {Operand::Uniform, f_.type(v), slotOf(v) * 8};
    }
    return row(v);
  }
  Operand row(Value v) {
    if (rows_[v].kind == Operand::None) fail(v, "has no row");
    return rows_[v];
  }
  //! The row that instruction v writes.
  Operand define(Value v) { return rows_[v] = list_->newRow(f_.type(v)); }

  uint32_t slotOf(Value v) {
    if (!slot_[v]) slot_[v] = ++program_.slots;
    return slot_[v] - 1;
  }

  //! A uniform's copy in a row.
  Operand materialise(Operand o) {
    if (!o.isUniform()) return o;
    const Operand r = list_->newRow(o.type);
    list_->add(k(Internal::Splat, o.type), r, {o});
    return r;
  }
  //! v as an operand whose bits may be looked at.
  Operand settled(Value v) {
    const Operand o = operand(v);
    if (o.isUniform() || !ir::isFloat(o.type) || a_.nan[v] != NanBits::Arithmetic) return o;
    const Operand r = list_->newRow(o.type);
    list_->add(k(Internal::Canon, o.type), r, {o});
    return r;
  }

  // --- kernels

  const Kernel& control(Control c) const { return k_.control[unsigned(c)]; }
  Kernel k(Internal o, Type t, unsigned form = 0) const { return k_.internal[unsigned(o)][unsigned(t)][form]; }

  void fail(Value v, const char* what) {
    if (!error_.empty()) return;
    const Inst& i = f_.insts[v];
    error_ = base::errorf("%s: line %u: %%%u (%s): %s", f_.name.c_str(), i.line, v, ir::opInfo(i.op).text, what).message;
  }

  //! Adds a call of `op` for `type`, in the form that leaves most uniform operands as they are.
  void call(Op op, Type type, Operand dst, Operands src, size_t count, uint64_t imm = 0) {
    const Kernel* forms = k_.op[unsigned(op)][unsigned(type)];
    auto formOf = [&] {
      unsigned form = 0;
      for (size_t i = 0; i < 3 && i < count; i++)
        if (src[i].isUniform() && src[i].type != Type::Mask) form |= 1u << i;
      return form;
    };
    if (op == Op::Fma && src[0].isUniform() && !src[1].isUniform()) std::swap(src[0], src[1]);
    const unsigned wanted = formOf();
    unsigned best = 0;
    for (unsigned form = 1; form < kOperandForms; form++)
      if ((form & ~wanted) == 0 && forms[form] && std::popcount(form) > std::popcount(best)) best = form;
    if (!forms[best]) return fail(at_, "the interpreter has no kernel for this type");
    for (size_t i = 0; i < count; i++)
      if (i >= 3 || !(best >> i & 1)) src[i] = materialise(src[i]);
    list_->add(forms[best], dst, std::span<const Operand>(src.data(), std::max<size_t>(count, 0)), imm);
  }

  //! f16 arithmetic is done in f32 (fma: in f64), which rounds to the same half.
  Operand widen(Operand o, Type to) {
    const Operand r = list_->newRow(to);
    list_->add(k_.convert[unsigned(Op::FToF)][unsigned(Type::F16)][unsigned(to)], r, {materialise(o)});
    return r;
  }

  //! A loop may wait for what other invocations write.
  bool mayWait() const { return std::any_of(f_.insts.begin(), f_.insts.end(), ir::looksAtOthers); }

  // --- instructions

  //! Variables and local memory are zero at the start of the routine, wherever they stand.
  void storage(Value v) {
    const Inst& i = f_.insts[v];
    if (i.op == Op::Var) {
      const Operand r = define(v);
      if (!a_.setFirst[v]) list_->add(k(Internal::Zero, i.type), r, {});
    } else if (i.op == Op::LocalAlloc) {
      local_.resize(f_.insts.size(), 0);
      local_[v] = uint32_t(program_.localBytes);
      list_->add(k_.op[unsigned(i.op)][unsigned(Type::I32)][0], {}, {Operand{}, Operand{}, Operand{}, raw(local_[v])}, i.imm);
      program_.localBytes += (i.imm + 3) / 4 * 4 * kMaxLanes;
      if (program_.localBytes > kMaxLocalBytes) fail(v, "too much local memory");
    }
  }

  void instruction(Value v) {
    const Inst& i = f_.insts[v];
    const auto values = f_.operands(v);
    switch (i.op) {
      case Op::Nop: return;
      case Op::Var:
      case Op::LocalAlloc: return;   // done at the start
      case Op::VarGet:
        if (a_.aliasesVar[v]) rows_[v] = row(values[0]);
        else list_->add(k(Internal::Copy, i.type), define(v), {row(values[0])});
        return;
      case Op::VarSet: {
        const Operand var = row(values[0]);
        const Operand o = a_.nan[values[0]] == NanBits::Kept ? settled(values[1]) : operand(values[1]);
        if (o.isUniform() && k(Internal::SetMasked, o.type, 1)) list_->add(k(Internal::SetMasked, o.type, 1), var, {o});
        else list_->add(k(Internal::SetMasked, o.type), var, {materialise(o)});
        return;
      }
      case Op::Output: {
        const Operand o = materialise(settled(values[0]));
        list_->add(k(Internal::OutputRow, o.type), {}, {o}, i.imm);
        return;
      }
      case Op::BitCast: {
        Operand o = settled(values[0]);   // the same bits under another name
        o = materialise(o);
        o.type = i.type;
        rows_[v] = o;
        return;
      }
      case Op::Select: {
        const bool keep = a_.nan[v] == NanBits::Kept;
        const Operands src{operand(values[0]), keep ? settled(values[1]) : operand(values[1]), keep ? settled(values[2]) : operand(values[2])};
        return call(i.op, i.type, define(v), src, 3);
      }
      case Op::LocalLoad:
        return localAccess(i.op, i.type, values[0], define(v), {materialise(operand(values[1]))}, i.imm);
      case Op::LocalStore:
        return localAccess(i.op, f_.type(values[2]), values[0], {}, {materialise(operand(values[1])), materialise(settled(values[2]))}, i.imm);
      case Op::If:
      case Op::Else:
      case Op::EndIf:
      case Op::Loop:
      case Op::EndLoop:
      case Op::Block:
      case Op::EndBlock:
      case Op::Break: return structure(v);
      case Op::Check: return check(i);
      case Op::Barrier: list_->add(control(Control::Barrier), {}, {}); return;
      default: break;
    }

    const ir::OpInfo& info = ir::opInfo(i.op);
    if (values.size() > kMaxOperands || (values.empty() && i.type == Type::None)) return fail(v, "the interpreter cannot run this");
    if (info.operands == ir::OperandRule::Cvt) {
      const Kernel kernel = k_.convert[unsigned(i.op)][unsigned(f_.type(values[0]))][unsigned(i.type)];
      if (!kernel) return fail(v, "the interpreter has no kernel for these types");
      const Operand source = materialise(operand(values[0]));
      list_->add(kernel, define(v), {source});
      return;
    }
    // Bits become visible in stores, atomics and sign operations.
    const bool looks = (info.flags & ir::kEffect) || ((i.op == Op::FNeg || i.op == Op::FAbs) && a_.exposed[v]);
    Operands src{};
    for (size_t n = 0; n < values.size(); n++) src[n] = looks ? settled(values[n]) : operand(values[n]);

    const bool compares = info.operands == ir::OperandRule::CmpF || info.operands == ir::OperandRule::CmpI;
    const Type type = compares ? f_.type(values[0]) : i.type != Type::None ? i.type : f_.type(values.back());
    if (type == Type::F16 && !k_.op[unsigned(i.op)][unsigned(type)][0] && (info.operands == ir::OperandRule::Float || compares)) {
      const Type wide = i.op == Op::Fma ? Type::F64 : Type::F32;
      for (size_t n = 0; n < values.size(); n++) src[n] = widen(src[n], wide);
      if (compares) return call(i.op, wide, define(v), src, values.size(), i.imm);
      const Operand result = list_->newRow(wide);
      call(i.op, wide, result, src, values.size(), i.imm);
      list_->add(k_.convert[unsigned(Op::FToF)][unsigned(wide)][unsigned(Type::F16)], define(v), {result});
      return;
    }
    uint64_t imm = i.imm;
    if (info.operandCount >= 3 && isBufferAccess(i.op) && f_.type(values[1]) == Type::I64) imm |= kImmOffset64;
    call(i.op, type, i.type == Type::None ? Operand{} : define(v), src, values.size(), imm);
  }

  void check(const Inst& i) {
    const auto values = f_.operands(i);
    const bool prints = ir::checkPlace(i.imm).kind == ir::CheckKind::Print;
    if (values.empty() || (values.size() > kMaxOperands && !prints)) return fail(at_, "the interpreter cannot run this");
    auto site = std::make_unique<CheckSite>();
    site->place = ir::checkPlace(i.imm);
    site->line = i.line;
    site->count = uint32_t(values.size());
    if (!checkedShader_) checkedShader_ = std::make_shared<WatchedShader>(checked_);
    site->shader = checkedShader_;
    std::vector<Operand> src;
    for (Value v : values) {
      src.push_back(materialise(operand(v)));
      site->types.push_back(f_.type(v));
    }
    static_assert(kCheckOperands == kMaxOperands);
    for (size_t n = 0; n < src.size(); n += kMaxOperands)
      list_->add(prints ? printKernel : checkKernel, {}, std::span<const Operand>(src).subspan(n, std::min(kMaxOperands, src.size() - n)), reinterpret_cast<uintptr_t>(site.get()));
    program_.checks.push_back(std::move(site));
  }

  static bool isBufferAccess(Op op) {
    return op == Op::Load || op == Op::LoadConst || op == Op::Store || op == Op::Atomic || op == Op::AtomicCas;
  }
  //! A number in an operand's place.
  static Operand raw(uint32_t number) { return {Operand::Uniform, Type::I32, number}; }

  void localAccess(Op op, Type type, Value alloc, Operand dst, std::initializer_list<Operand> operands, uint64_t imm) {
    Operands src{};
    std::copy(operands.begin(), operands.end(), src.begin());
    src[3] = raw(local_[alloc]);
    src[4] = raw(uint32_t(f_.insts[alloc].imm));
    const Kernel kernel = k_.op[unsigned(op)][unsigned(type)][0];
    if (!kernel) return fail(at_, "the interpreter has no kernel for this type");
    list_->add(kernel, dst, std::span<const Operand>(src), imm);
  }

  // --- control flow

  struct Jump {
    size_t from;
    bool inSource;   //!< the distance is src[1], not imm
  };
  struct Construct {
    Op op;
    Operand saved, other;
    std::vector<Jump> pending;   //!< jumps to the end of the region that is open
    size_t start;
  };

  std::vector<Jump>& pendingHere() { return constructs_.empty() ? pending_ : constructs_.back().pending; }
  void resolve(std::vector<Jump>& jumps, size_t to) {
    for (const Jump& j : jumps) {
      const int64_t distance = int64_t(to) - int64_t(j.from);
      if (j.inSource) list_->at(j.from).src[1] = uint32_t(int32_t(distance));
      else list_->at(j.from).imm = uint64_t(distance);
    }
    jumps.clear();
  }

  void structure(Value v) {
    const Inst& i = f_.insts[v];
    const Operand none;
    switch (i.op) {
      case Op::If: {
        Construct c{i.op, list_->newRow(Type::Mask), list_->newRow(Type::Mask), {}, 0};
        const Operand condition = materialise(operand(f_.operands(v)[0]));
        c.start = list_->add(control(Control::If), none, {condition, c.saved, c.other});
        c.pending.push_back({c.start, false});
        constructs_.push_back(std::move(c));
        return;
      }
      case Op::Else: {
        Construct& c = constructs_.back();
        const size_t here = list_->add(control(Control::Else), none, {c.other});
        resolve(c.pending, here);
        c.pending.push_back({here, false});
        return;
      }
      case Op::Block:
      case Op::Loop: {
        Construct c{i.op, list_->newRow(Type::Mask), {}, {}, 0};
        c.start = list_->add(control(i.op == Op::Loop ? Control::Loop : Control::Block), none, {c.saved});
        constructs_.push_back(std::move(c));
        if (i.op == Op::Loop) list_->beginLoop();
        return;
      }
      case Op::EndIf:
      case Op::EndBlock:
      case Op::EndLoop: {
        Construct c = std::move(constructs_.back());
        constructs_.pop_back();
        const bool loop = i.op == Op::EndLoop;
        const Control what = loop ? Control::EndLoop : i.op == Op::EndIf ? Control::EndIf : Control::EndBlock;
        const size_t here = loop ? list_->add(control(what), none, {c.saved, raw(0)}) : list_->add(control(what), none, {c.saved});
        resolve(c.pending, here);
        if (loop) {
          list_->at(here).imm = uint64_t(int64_t(c.start + 1) - int64_t(here));
          list_->endLoop();
        }
        pendingHere().push_back({here, loop});
        return;
      }
      case Op::Break: {
        uint64_t left = i.imm + 1;
        for (size_t n = constructs_.size(); n-- > 0;) {
          const Construct& c = constructs_[n];
          if (c.op != Op::If && --left == 0) break;
          list_->add(control(Control::Leave), none, {c.saved});
        }
        const size_t here = list_->add(control(Control::Break), none, {});
        pendingHere().push_back({here, false});
        return;
      }
      default: return;
    }
  }

  // --- the preamble: what is uniform and used by lanes, and what that needs

  void makePreamble() {
    std::vector<uint8_t> wanted(f_.insts.size(), 0);
    for (Value v = Value(f_.insts.size()); v-- > 1;) {
      wanted[v] |= slot_[v] != 0;
      if (wanted[v])
        for (Value o : f_.operands(v)) wanted[o] = 1;
    }
    list_ = &pre_;
    rows_.assign(f_.insts.size(), {});
    for (at_ = 1; at_ < f_.insts.size() && error_.empty(); at_++) {
      if (!wanted[at_]) continue;
      const Value v = at_;
      if (f_.insts[v].op == Op::Const) continue;
      instruction(v);
      if (slot_[v] && error_.empty()) {
        Operand o = row(v);
        // What was loaded keeps its bits.
        if (a_.nan[v] == NanBits::Arithmetic) {
          const Operand r = list_->newRow(o.type);
          list_->add(k(Internal::Canon, o.type), r, {o});
          o = r;
        }
        list_->add(k(Internal::ToBank, o.type), {}, {o}, slot_[v] - 1);
      }
    }
    pre_.add(control(Control::End), {}, {});
    for (Value v = 1; v < f_.insts.size(); v++)
      if (slot_[v] && f_.insts[v].op == Op::Const) program_.constants.push_back({slot_[v] - 1, f_.insts[v].imm});
  }

  const Function& f_;
  const KernelTable& k_;
  Analysis a_;
  std::vector<uint32_t> slot_;       // by value: slot in the bank + 1
  std::vector<Operand> rows_;
  std::vector<uint32_t> local_;      // by LocalAlloc: its area's start
  CodeList body_, pre_;
  CodeList* list_ = nullptr;
  std::vector<Construct> constructs_;
  std::vector<Jump> pending_;
  Value at_ = 0;
  Program program_;
  const CheckedShader& checked_;
  std::shared_ptr<WatchedShader> checkedShader_;
  std::string error_;
};

}  // namespace

Result<Program> lower(const Function& f, const KernelTable& kernels, const CheckedShader& checked) { return Lowering(f, kernels, checked).run(); }

}  // namespace pumice::interp
