#include <algorithm>
#include <array>
#include <utility>

#include "spirv_interp/ir/one_record.h"
#include "spirv_interp/ir/waits.h"
#include "spirv_interp/jit/plan_steps.h"
#include "spirv_interp/jit/quads.h"

namespace pumice::jit {
namespace {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

bool closes(Op op) { return op == Op::Else || op == Op::EndIf || op == Op::EndLoop || op == Op::EndBlock; }

//! Lanes of a subgroup must run together: they look at each other, or may pass data to each other through memory.
bool needsSubgroups(const Plan& p) {
  for (const Op op : {Op::LaneId, Op::SubgroupAny, Op::SubgroupAll, Op::SubgroupBallot, Op::SubgroupShuffle, Op::SubgroupReduce, Op::SharedStore,
                      Op::SharedAtomic, Op::SharedAtomicCas})
    if (p.has(op)) return true;
  return false;
}

class Planner {
 public:
  Planner(const Function& f, Plan& p) : f_(f), p_(p) {}

  //! What is known without places.
  void look() {
    const size_t n = f_.insts.size();
    p_.f = &f_;
    p_.a = interp::analyse(f_);
    if (p_.has(Op::Atomic) || p_.has(Op::AtomicCas) || p_.has(Op::SharedAtomic) || p_.has(Op::SharedAtomicCas)) p_.taken = ir::takenValues(f_);
    for (Value v = 1; v < n && (!p_.taken.empty() || p_.has(Op::Load) || p_.has(Op::SharedLoad)); v++)
      p_.mayWait |= ir::looksAtOthers(f_.insts[v]) && (!ir::isAtomic(f_.insts[v].op) || p_.taken[v]);
    p_.suspends = p_.mayWait || p_.has(Op::Barrier);
    p_.wholeBlocks &= !p_.suspends && !p_.has(Op::LocalAlloc);
    p_.regionOf.assign(n, kNone);
    home_.assign(n, kNone);
    p_.flat.assign(n, 0);
    findRegions();
    findFlat();
  }
  void run() {
    const size_t n = f_.insts.size();
    look();
    p_.vregOf.assign(n, kNone);
    p_.masked.assign(n, 1);
    p_.vregs.reserve(n + 8);
    lastRead_.reserve(n + 8);
    shared_.reserve(n + 8);
    if (p_.has(Op::QuadDdx) || p_.has(Op::QuadDdy)) p_.shared = findShared(f_, p_.a.uniform);
    else p_.shared.assign(n, 0);
    settleBounded(p_);
    findFolded(p_);
    findPairs(p_);
    findCrossed(p_);
    findWords(p_);
    findFootprints(p_);
    findUses();
    walk();
    if (p_.wholeBlocks) findAhead();
    std::stable_sort(p_.hot.begin(), p_.hot.end(), [](const Hot& a, const Hot& b) { return a.region < b.region; });
  }

 private:
  void findRegions() {
    p_.regions.push_back({});
    p_.regions[0].end = Value(f_.insts.size());
    std::vector<uint32_t> open{0};
    if (p_.has(Op::Loop)) loopOf_.assign(f_.insts.size(), 0);
    uint32_t loop = 0;
    Value before = 0;
    for (Value v : p_.a.structure) {
      const Inst& i = f_.insts[v];
      if (loop) std::fill(loopOf_.begin() + before + 1, loopOf_.begin() + v + 1, loop);   // of a loop's own markers: the loop around it
      before = v;
      if (i.op == Op::Loop) loop = uint32_t(p_.regions.size());
      if (i.op == Op::EndLoop) loop = loopOf_[v] = loopOf_[p_.regions[loop].begin];
      if (closes(i.op)) {
        const uint32_t r = open.back();
        open.pop_back();
        p_.regions[r].end = v;
        p_.regionOf[v] = r;
        if (i.op == Op::Else) {
          Region e{.op = i.op, .begin = v, .parent = open.back()};
          then_.resize(p_.regions.size() + 1, kNone);
          then_[p_.regions.size()] = r;
          p_.regionOf[v] = uint32_t(p_.regions.size());   // an else opens and closes; the closed one is then_
          open.push_back(uint32_t(p_.regions.size()));
          p_.regions.push_back(e);
          continue;
        }
      }
      if (i.op == Op::If || i.op == Op::Loop || i.op == Op::Block) {
        Region r{.op = i.op, .begin = v, .parent = open.back()};
        p_.regionOf[v] = uint32_t(p_.regions.size());
        open.push_back(uint32_t(p_.regions.size()));
        p_.regions.push_back(r);
      }
      if (i.op == Op::Break) breaks_.push_back({v, open.back()});
      if (i.op == Op::VarSet && p_.a.needed[v]) {
        const Value var = f_.operands(v)[0];
        if (home_[var] == kNone) home_[var] = p_.a.setFirst[var] ? open.back() : 0;
        sets_.push_back({v, open.back()});
      }
    }
    then_.resize(p_.regions.size(), kNone);
  }

  //! Last uses with those that loops repeat, and the next set of each variable.
  void findUses() {
    if (!p_.has(Op::VarSet)) return;
    nextSet_.assign(f_.insts.size(), 0);
    std::vector<Value> set(f_.insts.size(), 0);
    bool twice = false;
    for (size_t k = p_.a.structure.size(); k-- > 0;) {
      const Value v = p_.a.structure[k];
      if (f_.insts[v].op != Op::VarSet || !p_.a.needed[v]) continue;
      nextSet_[v] = std::exchange(set[f_.operands(v)[0]], v);
      twice |= nextSet_[v] != 0;
    }
    if (!twice) return;   // nobody asks
    lastUse_.assign(f_.insts.size(), 0);
    const bool loops = p_.has(Op::Loop);
    const auto extended = [&](Value def, Value at) {
      Value until = at;
      for (uint32_t l = loopOf_[at]; l && p_.regions[l].begin > def; l = loopOf_[p_.regions[l].begin]) until = p_.regions[l].end;
      return until;
    };
    for (Value v = Value(f_.insts.size()); v-- > 1;) {
      if (!p_.a.needed[v]) continue;
      const Inst& i = f_.insts[v];
      Value at = v;
      if (i.op == Op::BitCast || i.op == Op::FNeg || i.op == Op::LShr || i.op == Op::Trunc) at = std::max(v, lastUse_[v]);   // may stand for its operand
      if (i.op == Op::If) at = p_.regions[p_.regionOf[v]].end;                      // the else looks again
      if (p_.pairSecond[v]) at = p_.pairSecond[v];
      if (p_.wordsOf[v]) at = std::max(at, p_.words[p_.wordsOf[v] - 1].at);
      for (Value o : f_.operands(v)) {
        if (!loops) lastUse_[o] = std::max(lastUse_[o], at);
        else lastUse_[o] = std::max({lastUse_[o], extended(o, v), at});
      }
    }
  }

  struct Place {
    Value v;
    uint32_t region;
  };

  //! Calls f(region) for the regions that a break leaves, innermost first.
  template <class F>
  void eachLeft(const Place& b, F f) const {
    uint64_t left = f_.insts[b.v].imm + 1;
    for (uint32_t r = b.region; r; r = p_.regions[r].parent) {
      const Op op = p_.regions[r].op;
      const bool last = (op == Op::Loop || op == Op::Block) && --left == 0;
      f(r, last);
      if (last) return;
    }
  }

  //! Which values are the same in all lanes, which regions do all active lanes run alike: assumed of all that may be, until
  //! nothing speaks against it.
  void findFlat() {
    constexpr unsigned kRounds = 12;   // hardly ever more than three
    std::vector<uint8_t>& flat = p_.flat;
    std::vector<uint8_t> flatVar(f_.insts.size(), 1);
    for (unsigned round = 0;; round++) {
      // With fewer variables there are not more values.
      for (Value v = 1; v < f_.insts.size(); v++)
        if (!round || flat[v]) flat[v] = isFlat(v, flatVar);
      for (uint32_t r = 1; r < p_.regions.size(); r++) {
        Region& region = p_.regions[r];
        const Value begin = p_.regions[then_[r] != kNone ? then_[r] : r].begin;
        if (region.op == Op::If || region.op == Op::Else) {
          const Value condition = f_.operands(begin)[0];
          region.uniform = p_.a.uniform[condition] || flat[condition];
          region.own = !region.uniform;
        } else {
          region.own = false;
        }
      }
      for (bool changed = true; changed;) {
        changed = false;
        for (const Place& b : breaks_) {
          bool any = false, all = true;
          eachLeft(b, [&](uint32_t r, bool) {
            any |= p_.regions[r].own;
            all &= p_.regions[r].own;
          });
          flat[b.v] = !any;
          if (!any || all) continue;
          eachLeft(b, [&](uint32_t r, bool) { p_.regions[r].own = true; });
          changed = true;
        }
      }
      bool again = false;
      for (const Place& set : sets_) {
        const Value var = f_.operands(set.v)[0], value = f_.operands(set.v)[1];
        if (!flatVar[var]) continue;
        bool same = p_.a.uniform[value] || flat[value];
        for (uint32_t r = set.region; same && r != home_[var] && r != kNone; r = p_.regions[r].parent) same = !p_.regions[r].own;
        if (same) continue;
        flatVar[var] = 0;
        again = true;
      }
      if (!again) break;
      if (round == kRounds) std::fill(flatVar.begin(), flatVar.end(), uint8_t(0));
    }
    for (const Place& set : sets_) flat[set.v] = flat[f_.operands(set.v)[0]];
    for (const Place& b : breaks_)
      if (!flat[b.v]) eachLeft(b, [&](uint32_t r, bool last) { p_.regions[r].parentLeft |= !last; });
    for (uint32_t r = 1; r < p_.regions.size(); r++)
      if (then_[r] != kNone) p_.regions[r].parentLeft |= p_.regions[then_[r]].parentLeft;   // tested once, behind the else
    std::fill(home_.begin(), home_.end(), kNone);
  }
  bool isFlat(Value v, const std::vector<uint8_t>& flatVar) const {
    if (!p_.a.needed[v] || p_.a.uniform[v]) return false;
    const Inst& i = f_.insts[v];
    const auto o = f_.operands(i);
    // Most are pure, and vary with their last operand.
    if (!o.empty() && !p_.a.uniform[o.back()] && !p_.flat[o.back()] && (ir::opInfo(i.op).flags & ir::kPure)) return false;
    if (i.op == Op::Var) return flatVar[v];
    if (i.op == Op::VarGet) return flatVar[o[0]];
    const auto same = [&](Value x) { return p_.a.uniform[x] || p_.flat[x]; };
    if (i.op == Op::Input) return isGroupUniform(f_, i);
    if (patternOf(i)) return false;   // all lanes have the first one's offset alike, and look elsewhere
    if (i.op == Op::SharedLoad) return !(i.flags & ir::kInstVolatile) && same(o[0]);
    if (i.op == Op::QuadLoad) return (i.imm & ir::kOneRecord) && ir::typeBytes(i.type) == 4;
    if (i.op == Op::TableLoad) return same(o[0]);
    if (i.op == Op::LoadConst || (i.op == Op::Load && !(i.flags & ir::kInstVolatile)))
      return p_.a.uniform[o[0]] && p_.a.uniform[o[2]] && same(o[1]) && f_.type(o[1]) == Type::I32 && !(f_.insts[o[2]].op == Op::Const && f_.insts[o[2]].imm >> 62);
    const ir::OpInfo& info = ir::opInfo(i.op);
    if (!(info.flags & ir::kPure) || info.operands == ir::OperandRule::Free || o.empty()) return false;
    return std::all_of(o.begin(), o.end(), same);
  }

  uint32_t newVreg(uint32_t start, bool wide = false) {
    Vreg r;
    r.start = r.end = start;
    r.wide = wide;
    p_.vregs.push_back(r);
    lastRead_.push_back(start);
    shared_.push_back(0);
    return uint32_t(p_.vregs.size() - 1);
  }
  void useReg(uint32_t id, Value at) {
    Vreg& r = p_.vregs[id];
    r.weight += weight_;
    lastRead_[id] = at;
    Value until = at;
    for (uint32_t l : loops_)   // outermost first
      if (p_.regions[l].begin > r.start) {
        until = p_.regions[l].end;
        break;
      }
    r.end = std::max(r.end, until);
  }
  void use(Value v, Value at) {
    while (p_.folded[v]) v = f_.operands(v)[0];
    if (p_.a.uniform[v]) useUniform(v, at);
    else if (p_.vregOf[v] != kNone) useReg(p_.vregOf[v], at);
  }
  void useUniform(Value v, Value at) {
    const Op op = f_.insts[at].op;
    if (loops_.empty() || (ir::opInfo(op).operands == ir::OperandRule::Free && op != Op::VarSet)) return;
    if ((op == Op::Shl || op == Op::LShr || op == Op::AShr) && f_.insts[v].op == Op::Const) return;   // part of the instruction
    const uint32_t loop = loops_.back();
    if (hotOf_.empty()) hotOf_.assign(f_.insts.size(), kNone);
    if (hotOf_[v] == kNone || p_.hot[hotOf_[v]].region != loop) {
      hotOf_[v] = uint32_t(p_.hot.size());
      const uint32_t id = newVreg(p_.regions[loop].begin);
      Vreg& r = p_.vregs[id];
      r.end = p_.regions[loop].end;
      r.flat = r.uniform = true;
      p_.hot.push_back({v, loop, id});
    }
    p_.vregs[p_.hot[hotOf_[v]].vreg].weight += weight_;
  }

  //! Whether what a VarSet sets can be computed in the variable's place: nobody looks at the old value between, and nobody sets
  //! the variable while the value is still used as such.
  bool joins(Value v) const {
    const Value var = f_.operands(v)[0], x = f_.operands(v)[1];
    if (p_.a.uniform[x] || p_.vregOf[x] == kNone || x <= lastControl_ || p_.flat[x] != p_.flat[var]) return false;
    const uint32_t id = p_.vregOf[x];
    const Value made = p_.madeAt(x);
    if (p_.vregs[id].start != made || (shared_[id] & kHoldsVar)) return false;
    if (ir::isFloat(f_.type(x)) && p_.a.nan[var] == interp::NanBits::Kept && p_.a.nan[x] == interp::NanBits::Arithmetic) return false;
    if (nextSet_[v] && lastUse_[x] > nextSet_[v]) return false;
    if (home_[var] == kNone) return true;
    if ((shared_[id] & kHasAlias) || !coversAll(home_[var])) return false;
    const uint32_t read = lastRead_[p_.vregOf[var]];
    return read < made || (read == made && !crossesParts(f_, x));
  }
  void join(Value v) {
    const Value var = f_.operands(v)[0], x = f_.operands(v)[1];
    const uint32_t id = p_.vregOf[x];
    p_.masked[v] = 0;
    if (home_[var] == kNone) {
      home_[var] = current_;
      p_.vregOf[var] = id;
      shared_[id] |= kHoldsVar;
      useReg(id, v);
      return;
    }
    Vreg& from = p_.vregs[id];
    from.unused = true;
    p_.vregOf[x] = p_.vregOf[var];
    Vreg& to = p_.vregs[p_.vregOf[x]];
    to.weight += from.weight;
    useReg(p_.vregOf[x], std::max(lastRead_[id], v));
    to.end = std::max(to.end, from.end);
  }
  void useMask(Value at) { useReg(p_.regions[current_].mask, at); }
  void define(Value v) {
    p_.vregOf[v] = newVreg(p_.madeAt(v), ir::typeBytes(f_.type(v)) == 8);
    p_.vregs.back().flat = p_.flat[v] || p_.shared[v];
    p_.vregs.back().weight = weight_;
  }

  //! All lanes that may look at a variable later are active here.
  bool coversAll(uint32_t home) const {
    uint32_t r = current_;
    while (r != home) {
      if (r == kNone) return false;
      const Region& region = p_.regions[r];
      if (region.own || lost_[r]) return false;
      r = region.parent;
    }
    return true;
  }

  void walk() {
    lost_.assign(p_.regions.size(), 0);
    p_.regions[0].mask = newVreg(0);
    useReg(p_.regions[0].mask, 0);
    for (Value v : p_.a.structure)
      if (f_.insts[v].op == Op::Var && p_.a.needed[v] && !p_.a.setFirst[v]) {
        p_.vregOf[v] = newVreg(0, ir::typeBytes(f_.type(v)) == 8);
        p_.vregs.back().flat = p_.flat[v];
        home_[v] = 0;
        shared_.back() = kHoldsVar;
        p_.zeroed.push_back(v);
      }
    for (Value v = 1; v < f_.insts.size(); v++)
      if (p_.a.needed[v] && !p_.a.uniform[v]) instruction(v);
  }

  void words(Value v, const Words& w) {
    if (v != w.at) return;
    for (uint32_t k = 0; k < w.count; k++)
      for (Value operand : f_.operands(w.member[k])) use(operand, v);
    useMask(v);
    for (uint32_t k = 0; k < w.count && f_.insts[v].type != Type::None; k++) {
      p_.vregOf[w.member[k]] = newVreg(v);
      p_.vregs.back().weight = weight_;
    }
  }

  //! Operations that define a value from their operands, and nothing else is to be said of them.
  static constexpr auto kPlain = [] {
    std::array<bool, size_t(Op::kCount)> table{};
    for (size_t op = 0; op < table.size(); op++) {
      const ir::OpInfo& info = ir::kOps[op];
      table[op] = (info.flags & ir::kPure) && !(info.flags & ir::kRead) && info.operands != ir::OperandRule::Free && Op(op) != Op::FNeg &&
                  Op(op) != Op::LShr && Op(op) != Op::Trunc && Op(op) != Op::BitCast;
    }
    return table;
  }();

  void instruction(Value v) {
    if (kPlain[size_t(f_.insts[v].op)]) {
      for (Value operand : f_.operands(v)) use(operand, v);
      return define(v);
    }
    if (p_.pairSecond[v]) return;
    if (p_.wordsOf[v]) return words(v, p_.words[p_.wordsOf[v] - 1]);
    if (const Value first = p_.pairFirst[v]) {
      for (Value operand : f_.operands(first)) use(operand, v);
      p_.vregOf[first] = newVreg(v, ir::typeBytes(f_.type(first)) == 8);
      p_.vregs.back().weight = weight_;
    }
    const Inst& i = f_.insts[v];
    const auto o = f_.operands(v);
    if (ir::opInfo(i.op).flags & ir::kControl || i.op == Op::Barrier) lastControl_ = v;
    switch (i.op) {
      case Op::Nop:
      case Op::Var: return;
      case Op::LocalAlloc: return;
      case Op::FNeg:
      case Op::LShr:
      case Op::Trunc:
        if (p_.folded[v]) return;
        break;
      case Op::VarGet:
        if (p_.a.aliasesVar[v]) {
          p_.vregOf[v] = p_.vregOf[o[0]];
          use(v, v);
        } else {
          use(o[0], v);
          define(v);
        }
        return;
      case Op::VarSet:
        if (joins(v)) return join(v);
        use(o[1], v);
        if (home_[o[0]] == kNone) {
          home_[o[0]] = current_;
          define(o[0]);
          shared_.back() = kHoldsVar;
          p_.vregs.back().start = p_.vregs.back().end = v;
        }
        p_.masked[v] = !coversAll(home_[o[0]]);
        if (p_.masked[v]) useMask(v);
        use(o[0], v);
        return;
      case Op::BitCast:
        if (p_.folded[v]) return;
        // The same bits under another name, unless NaNs have to be made canonical.
        if (p_.inRegister(o[0]) && !(ir::isFloat(f_.type(o[0])) && p_.a.nan[o[0]] == interp::NanBits::Arithmetic)) {
          p_.vregOf[v] = p_.vregOf[o[0]];
          shared_[p_.vregOf[v]] |= kHasAlias;
          use(v, v);
          return;
        }
        break;
      case Op::If: {
        use(o[0], v);
        Region& r = p_.regions[p_.regionOf[v]];
        if (!r.uniform && f_.insts[r.end].op == Op::Else) {
          // The then side may set the variable that a var.get stands for.
          r.condition = f_.insts[o[0]].op == Op::VarGet ? newVreg(v) : p_.vregOf[o[0]];
          useReg(r.condition, v);
        }
        enter(v);
        return;
      }
      case Op::Else: {
        // Behind the then side: what it left is no longer in the outer mask.
        const uint32_t r = p_.regionOf[v];
        current_ = p_.regions[r].parent;
        if (p_.regions[r].own) {
          if (!p_.regions[r].uniform) useReg(p_.regions[then_[r]].condition, v);
          useMask(v);
        }
        lose(then_[r]);
        enter(v);
        return;
      }
      case Op::Loop:
      case Op::Block: enter(v); return;
      case Op::EndIf:
      case Op::EndBlock:
      case Op::EndLoop: {
        const uint32_t r = p_.regionOf[v];
        if (i.op == Op::EndLoop) {
          if (p_.regions[r].own) useReg(p_.regions[r].mask, v);
          loops_.pop_back();
          weight_ /= kLoopWeight;
        }
        current_ = p_.regions[r].parent;
        if (p_.regions[r].parentLeft) useMask(v);
        lose(r);
        return;
      }
      case Op::Break:
        if (p_.flat[v]) return;
        for (uint32_t r = current_, left = uint32_t(i.imm) + 1; r; r = p_.regions[r].parent) {
          useReg(p_.regions[r].mask, v);
          const Op op = p_.regions[r].op;
          if ((op == Op::Loop || op == Op::Block) && --left == 0) break;
        }
        lost_[current_] = 1;
        return;
      default: break;
    }
    for (Value operand : o) use(operand, v);
    const bool whole = p_.wholeBlocks && (i.op == Op::TileLoad || i.op == Op::TileStore) && p_.regions[current_].mask == p_.regions[0].mask;
    if ((!whole && (ir::opInfo(i.op).flags & (ir::kEffect | ir::kRead)) && i.op != Op::Barrier) || i.op == Op::LoadConst) useMask(v);
    if (i.type != Type::None) define(v);
  }

  //! Fields of the row's one record, unless a variable lives in the same place.
  void findAhead() {
    for (Value v = 1; v < f_.insts.size(); v++) {
      if (f_.insts[v].op != Op::QuadLoad || !p_.flat[v] || p_.vregOf[v] == kNone) continue;
      const uint32_t id = p_.vregOf[v];
      Vreg& r = p_.vregs[id];
      if (r.unused || r.start != v || (shared_[id] & kHoldsVar)) continue;
      r.ahead = true;
      r.start = 0;
      r.end = uint32_t(f_.insts.size() - 1);
      p_.ahead.push_back(v);
    }
  }

  void enter(Value v) {
    const uint32_t id = p_.regionOf[v];
    Region& r = p_.regions[id];
    if (r.own) useMask(v);
    if (r.op == Op::Loop) {
      loops_.push_back(id);
      weight_ = std::min(weight_ * kLoopWeight, 1e12f);
    }
    r.mask = r.own ? newVreg(v) : p_.regions[current_].mask;
    if (r.own) useReg(r.mask, v);
    current_ = id;
  }
  //! Lanes have left the parent of r.
  void lose(uint32_t r) {
    if (p_.regions[r].parentLeft) lost_[p_.regions[r].parent] = 1;
  }

  static constexpr float kLoopWeight = 8;
  const Function& f_;
  Plan& p_;
  std::vector<uint32_t> then_;    // by region: of an else the if's
  std::vector<Place> breaks_, sets_;
  std::vector<uint32_t> home_;    // by var: region beyond which nobody looks
  std::vector<uint8_t> lost_;     // by region: lanes have left it since its start
  std::vector<uint32_t> loops_;
  enum Shared : uint8_t { kHoldsVar = 1, kHasAlias = 2 };
  std::vector<uint8_t> shared_;      // by Vreg
  std::vector<Value> lastRead_;      // by Vreg: latest use so far
  std::vector<Value> lastUse_;       // by value, in loops their ends
  std::vector<Value> nextSet_;       // by VarSet: the next of its variable, 0: none
  std::vector<uint32_t> loopOf_;     // by instruction: region of the innermost loop around it, 0: none
  std::vector<uint32_t> hotOf_;      // by value: its latest entry
  Value lastControl_ = 0;
  uint32_t current_ = 0;
  float weight_ = 1;
};

//! The most values (of one register each, at one register per 8 lanes) alive at a position of the innermost loops.
uint32_t pressure(const Plan& p) {
  std::vector<int32_t> change(p.f->insts.size() + 2, 0);
  for (const Vreg& r : p.vregs) {
    // What is hardly used may live in the frame.
    if (r.flat || r.unused || r.ahead || r.weight * 16 < float(r.end - r.start)) continue;
    change[r.start] += r.wide ? 2 : 1;
    change[r.end + 1] -= r.wide ? 2 : 1;
  }
  int32_t now = 0, most = 0;
  for (int32_t c : change) most = std::max(most, now += c);
  return uint32_t(most);
}

}  // namespace

Plan makePlan(const Function& f, uint32_t lanes, bool wholeBlocks, uint32_t registers, std::vector<LanePattern> patterns) {
  Plan p;
  p.patterns = std::move(patterns);
  p.wholeBlocks = wholeBlocks;
  p.registers = registers;
  Planner(f, p).run();
  if (needsSubgroups(p)) p.unroll = ir::kSubgroupLanes / kVectorLanes;
  else if (lanes) p.unroll = lanes / kVectorLanes;
  else {
    const uint32_t live = pressure(p);
    p.unroll = live <= 4 ? 4 : 2;   // measured: two interleaved chains are worth some values in the frame
  }
  return p;
}

std::vector<uint8_t> flatValues(const Function& f) {
  Plan p;
  Planner(f, p).look();
  for (Value v = 1; v < f.insts.size(); v++) p.flat[v] |= p.a.uniform[v];
  return std::move(p.flat);
}

bool crossesParts(const Function& f, Value v) {
  static constexpr auto kCrosses = [] {
    std::array<bool, size_t(Op::kCount)> table{};
    for (size_t op = 0; op < table.size(); op++) table[op] = !(ir::kOps[op].flags & ir::kPure);
    for (const Op op : {Op::Select, Op::VarSet, Op::QuadSwizzle, Op::QuadDdx, Op::QuadDdy, Op::If, Op::Else, Op::Loop, Op::Block}) table[size_t(op)] = false;
    for (const Op op : {Op::Load, Op::LoadConst, Op::TableLoad, Op::FilterHalves, Op::FilterBytes, Op::FilterLevel, Op::FilterLevels}) table[size_t(op)] = true;
    return table;
  }();
  const Inst& i = f.insts[v];
  if (kCrosses[size_t(i.op)]) return true;
  if (i.type == Type::None) return false;
  const bool wide = ir::typeBytes(i.type) == 8;
  for (Value o : f.operands(i))
    if ((ir::typeBytes(f.type(o)) == 8) != wide) return true;
  return false;
}

}  // namespace pumice::jit
