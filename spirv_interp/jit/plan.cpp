#include "spirv_interp/jit/plan.h"

#include <algorithm>

namespace pumice::jit {
namespace {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

bool closes(Op op) { return op == Op::Else || op == Op::EndIf || op == Op::EndLoop || op == Op::EndBlock; }

//! Lanes of a subgroup must run together: they look at each other, or may pass data to each other through memory.
bool needsSubgroups(const Function& f) {
  for (const Inst& i : f.insts) switch (i.op) {
      case Op::LaneId:
      case Op::SubgroupAny:
      case Op::SubgroupAll:
      case Op::SubgroupBallot:
      case Op::SubgroupShuffle:
      case Op::SubgroupReduce:
      case Op::SharedStore:
      case Op::SharedAtomic:
      case Op::SharedAtomicCas: return true;
      default: break;
    }
  return false;
}

class Planner {
 public:
  Planner(const Function& f, Plan& p) : f_(f), p_(p) {}

  void run() {
    const size_t n = f_.insts.size();
    p_.f = &f_;
    p_.a = interp::analyse(f_);
    p_.vregOf.assign(n, kNone);
    p_.regionOf.assign(n, kNone);
    p_.masked.assign(n, 1);
    p_.vregs.reserve(n + 8);
    home_.assign(n, kNone);
    findRegions();
    for (const Inst& i : f_.insts) {
      p_.mayWait |= i.op == Op::Atomic || i.op == Op::AtomicCas || i.op == Op::SharedAtomic || i.op == Op::SharedAtomicCas ||
                    ((i.op == Op::Load || i.op == Op::SharedLoad) && (i.flags & ir::kInstVolatile));
      p_.suspends |= i.op == Op::Barrier;
    }
    p_.suspends |= p_.mayWait;
    walk();
  }

 private:
  void findRegions() {
    p_.regions.push_back({});
    p_.regions[0].end = Value(f_.insts.size());
    std::vector<uint32_t> open{0};
    for (Value v = 1; v < f_.insts.size(); v++) {
      const Inst& i = f_.insts[v];
      if (closes(i.op)) {
        const uint32_t r = open.back();
        open.pop_back();
        p_.regions[r].end = v;
        p_.regionOf[v] = r;
        if (i.op == Op::Else) {
          Region e{.op = i.op, .begin = v, .parent = open.back(), .uniform = p_.regions[r].uniform};
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
        r.uniform = i.op == Op::If && p_.a.uniform[f_.operands(v)[0]];
        p_.regionOf[v] = uint32_t(p_.regions.size());
        open.push_back(uint32_t(p_.regions.size()));
        p_.regions.push_back(r);
      }
      if (i.op == Op::Break) {
        uint64_t left = i.imm + 1;
        for (size_t k = open.size(); k-- > 1;) {
          Region& r = p_.regions[open[k]];
          r.left = true;
          if ((r.op == Op::Loop || r.op == Op::Block) && --left == 0) break;
          r.parentLeft = true;
        }
      }
    }
    then_.resize(p_.regions.size(), kNone);
    for (uint32_t r = 1; r < p_.regions.size(); r++) {
      if (then_[r] == kNone) continue;
      Region& t = p_.regions[then_[r]];
      p_.regions[r].parentLeft |= t.parentLeft;   // tested once, behind the else
      // A break on either side: both have a mask of their own.
      const bool left = t.left || p_.regions[r].left;
      t.left = p_.regions[r].left = left;
    }
    for (Region& r : p_.regions) r.own = !((r.op == Op::Block || r.uniform) && !r.left);
  }

  uint32_t newVreg(uint32_t start, bool wide = false) {
    Vreg r;
    r.start = r.end = start;
    r.wide = wide;
    p_.vregs.push_back(r);
    return uint32_t(p_.vregs.size() - 1);
  }
  void useReg(uint32_t id, Value at) {
    Vreg& r = p_.vregs[id];
    r.weight += weight_;
    Value until = at;
    for (uint32_t l : loops_)   // outermost first
      if (p_.regions[l].begin > r.start) {
        until = p_.regions[l].end;
        break;
      }
    r.end = std::max(r.end, until);
  }
  void use(Value v, Value at) {
    if (!p_.a.uniform[v] && p_.vregOf[v] != kNone) useReg(p_.vregOf[v], at);
  }
  void useMask(Value at) { useReg(p_.regions[current_].mask, at); }
  void define(Value v) {
    p_.vregOf[v] = newVreg(v, ir::typeBytes(f_.type(v)) == 8);
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
    for (Value v = 1; v < f_.insts.size(); v++)
      if (f_.insts[v].op == Op::Var && p_.a.needed[v] && !p_.a.setFirst[v]) {
        p_.vregOf[v] = newVreg(0, ir::typeBytes(f_.type(v)) == 8);
        home_[v] = 0;
        p_.zeroed.push_back(v);
      }
    for (Value v = 1; v < f_.insts.size(); v++)
      if (p_.a.needed[v] && !p_.a.uniform[v]) instruction(v);
  }

  void instruction(Value v) {
    const Inst& i = f_.insts[v];
    const auto o = f_.operands(v);
    switch (i.op) {
      case Op::Nop:
      case Op::Var: return;
      case Op::LocalAlloc: return;
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
        use(o[1], v);
        if (home_[o[0]] == kNone) {
          home_[o[0]] = current_;
          define(o[0]);
          p_.vregs.back().start = p_.vregs.back().end = v;
        }
        p_.masked[v] = !coversAll(home_[o[0]]);
        if (p_.masked[v]) useMask(v);
        use(o[0], v);
        return;
      case Op::BitCast:
        // The same bits under another name, unless NaNs have to be made canonical.
        if (p_.inRegister(o[0]) && !(ir::isFloat(f_.type(o[0])) && p_.a.nan[o[0]] == interp::NanBits::Arithmetic)) {
          p_.vregOf[v] = p_.vregOf[o[0]];
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
          useReg(p_.regions[r].mask, v);
          loops_.pop_back();
          weight_ /= kLoopWeight;
        }
        current_ = p_.regions[r].parent;
        if (p_.regions[r].parentLeft) useMask(v);
        lose(r);
        return;
      }
      case Op::Break:
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
    if ((ir::opInfo(i.op).flags & (ir::kEffect | ir::kRead)) && i.op != Op::Barrier) useMask(v);
    if (i.type != Type::None) define(v);
  }

  void enter(Value v) {
    const uint32_t id = p_.regionOf[v];
    Region& r = p_.regions[id];
    if (r.op == Op::Loop) {
      useMask(v);
      loops_.push_back(id);
      weight_ = std::min(weight_ * kLoopWeight, 1e12f);
    } else if (r.own) {
      useMask(v);
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
  std::vector<uint32_t> home_;    // by var: region beyond which nobody looks
  std::vector<uint8_t> lost_;     // by region: lanes have left it since its start
  std::vector<uint32_t> loops_;
  uint32_t current_ = 0;
  float weight_ = 1;
};

//! The most values (of one register each, at one register per 8 lanes) alive at a position of the innermost loops.
uint32_t pressure(const Plan& p) {
  std::vector<int32_t> change(p.f->insts.size() + 2, 0);
  float heaviest = 0;
  for (const Vreg& r : p.vregs) heaviest = std::max(heaviest, r.weight);
  for (const Vreg& r : p.vregs) {
    // What is hardly used may live in the frame.
    if (r.weight * 16 < float(r.end - r.start)) continue;
    change[r.start] += r.wide ? 2 : 1;
    change[r.end + 1] -= r.wide ? 2 : 1;
  }
  int32_t now = 0, most = 0;
  for (int32_t c : change) most = std::max(most, now += c);
  return uint32_t(most);
}

}  // namespace

Plan makePlan(const Function& f, uint32_t lanes) {
  Plan p;
  Planner(f, p).run();
  if (needsSubgroups(f)) p.unroll = ir::kSubgroupLanes / kVectorLanes;
  else if (lanes) p.unroll = lanes / kVectorLanes;
  else {
    const uint32_t live = pressure(p);
    p.unroll = live <= 5 ? 4 : live <= 24 ? 2 : 1;
  }
  return p;
}

bool crossesParts(const Function& f, Value v) {
  const Inst& i = f.insts[v];
  switch (i.op) {
    case Op::Select:
    case Op::VarSet:
    case Op::QuadSwizzle:
    case Op::QuadDdx:
    case Op::QuadDdy:
    case Op::If:
    case Op::Else:
    case Op::Loop:
    case Op::Block: break;
    default:
      if (!(ir::opInfo(i.op).flags & ir::kPure)) return true;
      if (i.op == Op::Load || i.op == Op::LoadConst || i.op == Op::TableLoad) return true;
  }
  const bool wide = ir::typeBytes(i.type) == 8;
  for (Value o : f.operands(v))
    if (i.type != Type::None && (ir::typeBytes(f.type(o)) == 8) != wide) return true;
  return false;
}

}  // namespace pumice::jit
