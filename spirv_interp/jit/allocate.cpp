// The register allocator: a linear scan over intervals. A part that finds no register takes that of a part with less
// weight (uses per length), or lives in the frame, where most instructions can read it in place.
#include <algorithm>
#include <bit>
#include <utility>

#include "spirv_interp/jit/plan.h"

namespace pumice::jit {
namespace {

using ir::Value;

class Allocator {
 public:
  explicit Allocator(Plan& p) : p_(p), free_(p.registers) {}

  void run() {
    const size_t n = p_.f->insts.size() + 1;
    starts_.assign(n, kNone);
    ends_.assign(n, kNone);
    nextStart_.assign(p_.vregs.size(), kNone);
    nextEnd_.assign(p_.vregs.size(), kNone);
    for (uint32_t r = uint32_t(p_.vregs.size()); r-- > 0;) {
      Vreg& v = p_.vregs[r];
      std::fill(std::begin(v.reg), std::end(v.reg), int8_t(-1));
      std::fill(std::begin(v.slot), std::end(v.slot), kNone);
      if (v.unused) continue;
      if (v.uniform) v.weight *= float(p_.unroll);   // each use is a load for each part
      v.weight /= float(v.end - v.start + 1);
      nextStart_[r] = std::exchange(starts_[v.start], r);
      nextEnd_[r] = std::exchange(ends_[v.end], r);
    }
    for (uint32_t at = 0; at < n; at++) {
      for (uint32_t r = starts_[at]; r != kNone; r = nextStart_[r]) place(r, at);
      for (uint32_t r = ends_[at]; r != kNone; r = nextEnd_[r]) release(r);
    }
    giveSlots();
  }

 private:
  struct Holder {
    uint32_t vreg = kNone;
    uint32_t part = 0;
    uint32_t start = 0;
    float weight = 0;
  };

  void place(uint32_t id, uint32_t at) {
    Vreg& v = p_.vregs[id];
    if (v.ahead) return;
    const uint32_t parts = p_.parts(v);
    const bool reuse = at && at < p_.f->insts.size() && !crossesParts(*p_.f, at);
    for (uint32_t part = 0; part < parts; part++) {
      int reg = -1;
      if (reuse)
        for (Value o : p_.f->operands(at)) {
          if (!p_.inRegister(o)) continue;
          const uint32_t from = p_.vregOf[o];
          const Vreg& operand = p_.vregs[from];
          if (from == id || operand.end != at || operand.start == at || operand.wide != v.wide || operand.flat != v.flat) continue;
          const int r = operand.reg[part];
          if (r >= 0 && held_[r].vreg == from && held_[r].part == part) {
            reg = r;
            break;
          }
        }
      if (reg < 0 && free_) reg = p_.upperFirst ? 31 - std::countl_zero(free_) : std::countr_zero(free_);
      if (reg < 0) {
        int lightest = -1;
        float weight = v.weight;
        for (uint32_t left = p_.registers; left; left &= left - 1) {
          const uint32_t r = uint32_t(std::countr_zero(left));
          const Holder& h = held_[r];
          if (h.weight < weight && (h.start != at || at == 0)) {
            weight = h.weight;
            lightest = int(r);
          }
        }
        if (lightest < 0) continue;
        p_.vregs[held_[lightest].vreg].reg[held_[lightest].part] = -1;
        reg = lightest;
      }
      free_ &= ~(1u << reg);
      held_[reg] = {id, part, v.start, v.weight};
      v.reg[part] = int8_t(reg);
    }
  }
  void release(uint32_t id) {
    const Vreg& v = p_.vregs[id];
    for (uint32_t part = 0; part < p_.parts(v); part++) {
      const int r = v.reg[part];
      if (r >= 0 && held_[r].vreg == id && held_[r].part == part) free_ |= 1u << r;
    }
  }

  //! Places in the frame, for what ended up without a register.
  void giveSlots() {
    std::vector<uint32_t> unused;
    for (uint32_t at = 0; at < starts_.size(); at++) {
      for (uint32_t r = starts_[at]; r != kNone; r = nextStart_[r])
        for (uint32_t part = 0; part < p_.parts(p_.vregs[r]); part++) {
          if (p_.vregs[r].reg[part] >= 0) p_.used |= 1u << p_.vregs[r].reg[part];
          if (p_.vregs[r].reg[part] >= 0 || p_.vregs[r].uniform) continue;
          if (unused.empty()) unused.push_back(p_.frameSlots++);
          p_.vregs[r].slot[part] = unused.back();
          unused.pop_back();
        }
      for (uint32_t r = ends_[at]; r != kNone; r = nextEnd_[r])
        for (uint32_t part = 0; part < p_.parts(p_.vregs[r]); part++)
          if (p_.vregs[r].slot[part] != kNone) unused.push_back(p_.vregs[r].slot[part]);
    }
  }

  Plan& p_;
  std::vector<uint32_t> starts_, ends_, nextStart_, nextEnd_;
  Holder held_[kMaxRegisters];
  uint32_t free_;
};

}  // namespace

void allocate(Plan& plan) { Allocator(plan).run(); }

}  // namespace pumice::jit
