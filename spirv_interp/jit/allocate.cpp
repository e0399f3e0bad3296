// The register allocator: a linear scan over intervals. A part that finds no register takes that of a part with less
// weight (uses per length), or lives in the frame, where most instructions can read it in place.
#include <emmintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "spirv_interp/jit/plan.h"

namespace pumice::jit {
namespace {

using ir::Value;

class Allocator {
 public:
  explicit Allocator(Plan& p) : p_(p), free_(p.registers), top_(p.registers >> 16 ? 32 : 16) { std::fill(std::begin(weight_), std::end(weight_), kNever); }

  void run() {
    const size_t n = p_.f->insts.size() + 1;
    starts_.assign(n, kNone);
    ends_.assign(n, kNone);
    nextStart_.resize(p_.vregs.size());
    nextEnd_.resize(p_.vregs.size());
    for (uint32_t r = uint32_t(p_.vregs.size()); r-- > 0;) {
      Vreg& v = p_.vregs[r];
      std::memset(v.reg, -1, sizeof v.reg);
      if (v.unused) continue;
      if (v.uniform) v.weight *= float(p_.unroll);   // each use is a load for each part
      v.weight /= float(v.end - v.start + 1);
      nextStart_[r] = std::exchange(starts_[v.start], r);
      nextEnd_[r] = std::exchange(ends_[v.end], r);
    }
    for (uint32_t at = 0; at < n; at++) {
      for (uint32_t r = starts_[at]; r != kNone; r = nextStart_[r]) place(r, at);
      for (; fresh_; fresh_ &= fresh_ - 1) weight_[std::countr_zero(fresh_)] = p_.vregs[holder_[std::countr_zero(fresh_)]].weight;
      for (uint32_t r = ends_[at]; r != kNone; r = nextEnd_[r]) free_ |= std::exchange(p_.vregs[r].held, 0);
    }
    if (inFrame_) giveSlots();
  }

 private:
  static constexpr uint32_t kMaxEnding = 8;
  //! The register whose holder has the least weight, if that is below `limit`, else -1. All registers are taken.
  int lightestBelow(float limit) const {
    __m128 least = _mm_set1_ps(limit);
    for (uint32_t r = 0; r < top_; r += 4) least = _mm_min_ps(least, _mm_load_ps(weight_ + r));
    least = _mm_min_ps(least, _mm_movehl_ps(least, least));
    const float found = std::min(_mm_cvtss_f32(least), _mm_cvtss_f32(_mm_shuffle_ps(least, least, 1)));
    if (!(found < limit)) return -1;
    const __m128 all = _mm_set1_ps(found);
    for (uint32_t r = 0;; r += 4)
      if (const int equal = _mm_movemask_ps(_mm_cmpeq_ps(all, _mm_load_ps(weight_ + r)))) return int(r) + std::countr_zero(uint32_t(equal));
  }

  void place(uint32_t id, uint32_t at) {
    Vreg& v = p_.vregs[id];
    if (v.ahead) {
      inFrame_ = true;
      return;
    }
    const uint32_t parts = p_.parts(v);
    // An operand that ends here leaves its registers to the result.
    Vreg* ending[kMaxEnding];
    uint32_t endings = 0;
    if (at && at < p_.f->insts.size() && ends_[at] != kNone)
      for (Value o : p_.f->operands(at)) {
        if (!p_.inRegister(o) || endings == kMaxEnding) continue;
        Vreg& operand = p_.vregs[p_.vregOf[o]];
        if (&operand == &v || operand.end != at || operand.start == at || operand.wide != v.wide || operand.flat != v.flat) continue;
        ending[endings++] = &operand;
      }
    if (endings && crossesParts(*p_.f, at)) endings = 0;
    // Those of one instruction do not take each other's place. (Parts of one thing have the same weight: they do not either.)
    const bool shared = at && (starts_[at] != id || nextStart_[id] != kNone);
    const float weight = shared ? kNever : v.weight;
    for (uint32_t part = 0; part < parts; part++) {
      int reg = -1;
      for (uint32_t k = 0; k < endings; k++) {
        Vreg& operand = *ending[k];
        const int r = operand.reg[part];
        if (r < 0 || !(operand.held >> r & 1)) continue;
        operand.held &= ~(1u << r);
        reg = r;
        break;
      }
      if (reg < 0 && free_) {
        reg = p_.upperFirst ? 31 - std::countl_zero(free_) : std::countr_zero(free_);
        free_ &= ~(1u << reg);
        p_.used |= 1u << reg;
      }
      if (reg < 0) {
        const int lightest = lightestBelow(v.weight);
        inFrame_ |= !v.uniform;
        if (lightest < 0) continue;
        inFrame_ = true;
        reg = lightest;
        Vreg& out = p_.vregs[holder_[reg]];
        out.held &= ~(1u << reg);
        const __m128i theirs = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(out.reg));
        _mm_storel_epi64(reinterpret_cast<__m128i*>(out.reg), _mm_or_si128(theirs, _mm_cmpeq_epi8(theirs, _mm_set1_epi8(char(reg)))));   // -1
      }
      holder_[reg] = id;
      weight_[reg] = weight;
      if (shared) fresh_ |= 1u << reg;
      v.held |= 1u << reg;
      v.reg[part] = int8_t(reg);
    }
  }

  //! All of its parts.
  bool inRegisters(const Vreg& v) const {
    uint64_t reg;
    static_assert(sizeof reg == sizeof v.reg);
    std::memcpy(&reg, v.reg, sizeof reg);
    return !(reg << (64 - 8 * p_.parts(v)) & 0x8080808080808080u);
  }

  //! Places in the frame, for what ended up without a register.
  void giveSlots() {
    std::vector<uint32_t> unused;
    for (uint32_t at = 0; at < starts_.size(); at++) {
      for (uint32_t r = starts_[at]; r != kNone; r = nextStart_[r]) {
        Vreg& v = p_.vregs[r];
        std::memset(v.slot, -1, sizeof v.slot);
        if (v.uniform || inRegisters(v)) continue;
        for (uint32_t part = 0, parts = p_.parts(v); part < parts; part++) {
          if (v.reg[part] >= 0) continue;
          if (unused.empty()) unused.push_back(p_.frameSlots++);
          v.slot[part] = unused.back();
          unused.pop_back();
        }
      }
      for (uint32_t r = ends_[at]; r != kNone; r = nextEnd_[r]) {
        const Vreg& v = p_.vregs[r];
        if (inRegisters(v)) continue;
        for (uint32_t part = 0, parts = p_.parts(v); part < parts; part++)
          if (v.slot[part] != kNone) unused.push_back(v.slot[part]);
      }
    }
  }

  Plan& p_;
  std::vector<uint32_t> starts_, ends_, nextStart_, nextEnd_;
  uint32_t holder_[kMaxRegisters] = {};   //!< by register that is not free: its Vreg
  //! By register, of its holder. kNever: not to be had (again).
  alignas(16) float weight_[kMaxRegisters];
  static constexpr float kNever = HUGE_VALF;
  uint32_t free_;
  const uint32_t top_;     //!< registers from here on are not to be had
  uint32_t fresh_ = 0;     //!< registers given at this position
  bool inFrame_ = false;   //!< some part has no register
};

}  // namespace

void allocate(Plan& plan) { Allocator(plan).run(); }

}  // namespace pumice::jit
