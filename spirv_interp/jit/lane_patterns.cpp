#include "spirv_interp/jit/lane_patterns.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <utility>

#include "spirv_interp/jit/plan.h"

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

namespace {

constexpr uint32_t kLanes = ir::kSubgroupLanes;
using Deltas = std::array<int32_t, kLanes>;
constexpr int32_t kMostDelta = 1 << 24;

//! A component of the local id along a chunk, if it is the same for all chunks of all widths. All zero: the lanes have it alike.
std::optional<Deltas> localIdDeltas(const uint16_t (&size)[3], uint64_t component) {
  uint32_t step = 1;   // lanes to the next
  for (uint64_t c = 0; c < component; c++) step *= size[c];
  const uint32_t count = size[component];
  if (step % kLanes == 0) return Deltas{};
  if (kLanes % step) return {};
  const uint32_t most = kLanes / step;   // in a chunk
  if (count % most && most % count) return {};
  Deltas d;
  for (uint32_t l = 0; l < kLanes; l++) d[l] = int32_t(l / step % count);
  return d;
}

bool isZero(const Deltas& d) {
  return std::all_of(d.begin(), d.end(), [](int32_t x) { return !x; });
}

class Patterns {
 public:
  Patterns(Function& f, bool constants) : f_(f), constants_(constants), flat_(flatValues(f)), form_(f.insts.size(), 0), sameFirst_(f.insts.size(), 0) {}

  std::vector<LanePattern> run() {
    std::vector<LanePattern> patterns;
    for (Value v = 1; v < f_.insts.size(); v++) form_[v] = form(v);
    if (deltas_.empty()) return patterns;
    struct Access {
      Value v, from;   // from: whose first lane's value it takes
      uint32_t pattern;
      int32_t lowest;
    };
    std::vector<Access> accesses;
    for (Value v = 1; v < f_.insts.size(); v++) {
      if (!canHave(v)) continue;
      Value from = f_.operands(v)[offsetOperand(f_.insts[v].op)];
      LanePattern p;
      if (!form_[from]) {
        // Indices of arrays are clamped before they become offsets.
        const Inst& i = f_.insts[from];
        if (i.op != Op::Shl || !isConst(f_.operands(from)[1])) continue;
        const uint64_t shift = f_.insts[f_.operands(from)[1]].imm;
        const Value clamped = f_.operands(from)[0];
        if (f_.insts[clamped].op != Op::UMin || shift > 8) continue;
        const auto o = f_.operands(clamped);
        const bool swapped = isConst(o[0]);
        if (!isConst(o[!swapped]) || f_.insts[o[!swapped]].imm != 0xffffffffu >> shift) continue;
        from = o[swapped];
        if (!form_[from]) continue;
        p.shift = uint8_t(shift);
        p.clamped = true;
      }
      const Deltas& d = deltas_[form_[from] - 1];
      int32_t lowest = *std::min_element(d.begin(), d.end());
      if (constants_) lowest = std::min(0, lowest);
      for (uint32_t l = 0; l < kLanes; l++) p.delta[l] = d[l] - lowest;
      if (*std::max_element(p.delta, p.delta + kLanes) > (kMostDelta >> p.shift)) continue;
      uint32_t index = 0;
      while (index < patterns.size() && !same(patterns[index], p)) index++;
      if (index == patterns.size()) patterns.push_back(p);
      accesses.push_back({v, from, index + 1, lowest});
      want(from);
    }
    if (accesses.empty()) return patterns;

    // Once more, with the first lane's values behind those of all lanes.
    const Function before = std::move(f_);
    f_ = ir::Function{};
    f_.name = before.name;
    f_.imageOps = before.imageOps;
    f_.sharedBytes = before.sharedBytes;
    std::copy(std::begin(before.groupSize), std::end(before.groupSize), f_.groupSize);
    f_.insts.reserve(before.insts.size() + 64);
    f_.operandPool.reserve(before.operandPool.size() + 128);
    std::vector<Value> renamed(before.insts.size(), 0), operands;
    auto access = accesses.begin();
    for (Value v = 1; v < before.insts.size(); v++) {
      Inst i = before.insts[v];
      operands.clear();
      for (Value o : before.operands(v)) operands.push_back(renamed[o]);
      if (access != accesses.end() && access->v == v) {
        Value first = first_[access->from];
        if (access->lowest) first = append({.op = Op::IAdd, .type = Type::I32, .line = i.line}, std::array{first, constant(uint32_t(access->lowest))});
        operands[offsetOperand(i.op)] = first;
        i.imm |= uint64_t(access->pattern) << 32;
        ++access;
      }
      renamed[v] = append(i, operands);
      if (!wanted_[v]) continue;
      first_[v] = renamed[v];
      if (!form_[v]) continue;
      if (sameFirst_[v]) {
        first_[v] = first_[sameFirst_[v]];
        continue;
      }
      operands.clear();
      for (Value o : before.operands(v)) operands.push_back(first_[o]);
      if (i.op == Op::Input) i.imm |= kFirstOfChunk;
      first_[v] = append(i, operands);
    }
    return patterns;
  }

 private:
  static bool same(const LanePattern& a, const LanePattern& b) {
    return a.shift == b.shift && a.clamped == b.clamped && std::equal(a.delta, a.delta + kLanes, b.delta);
  }
  bool isConst(Value v) const { return f_.insts[v].op == Op::Const; }

  //! Index + 1 of what lanes add to the first one's, 0: unknown, or nothing.
  uint32_t form(Value v) {
    const Inst& i = f_.insts[v];
    if (i.type != Type::I32 || flat_[v]) return 0;
    const auto o = f_.operands(v);
    const auto known = [&](Value x) { return form_[x] || flat_[x]; };
    const auto of = [&](Value x) { return form_[x] ? deltas_[form_[x] - 1] : Deltas{}; };
    Deltas d;
    switch (i.op) {
      case Op::Input: {
        if (i.imm > 2) return 0;
        const auto found = localIdDeltas(f_.groupSize, i.imm);
        if (!found) return 0;
        d = *found;
        break;
      }
      case Op::IAdd:
      case Op::ISub:
        if (!known(o[0]) || !known(o[1])) return 0;
        d = of(o[0]);
        if (constants_ && i.op == Op::IAdd)
          for (uint32_t k = 0; k < 2; k++)
            if (form_[o[k]] && isConst(o[1 - k]) && f_.insts[o[1 - k]].imm < kMostDelta / 4) {
              d = of(o[k]);
              for (int32_t& x : d) x += int32_t(f_.insts[o[1 - k]].imm);
              sameFirst_[v] = o[k];
              break;
            }
        if (sameFirst_[v]) break;
        for (uint32_t l = 0; l < kLanes; l++) d[l] += i.op == Op::IAdd ? of(o[1])[l] : -of(o[1])[l];
        break;
      case Op::IMul:
      case Op::Shl: {
        const uint32_t factor = i.op == Op::IMul && isConst(o[0]) ? 0 : 1;
        if (!isConst(o[factor]) || !form_[o[1 - factor]]) return 0;
        const uint64_t by = f_.insts[o[factor]].imm;
        if (i.op == Op::IMul ? by > kMostDelta : by > 24) return 0;
        d = of(o[1 - factor]);
        for (int32_t& x : d) {
          const int64_t product = i.op == Op::IMul ? int64_t(x) * int64_t(by) : int64_t(x) * (int64_t(1) << by);
          if (product > kMostDelta || product < -kMostDelta) return 0;
          x = int32_t(product);
        }
        break;
      }
      default: return 0;
    }
    if (isZero(d)) return 0;
    for (int32_t x : d)
      if (x > kMostDelta || x < -kMostDelta) return 0;
    for (uint32_t k = 0; k < deltas_.size(); k++)
      if (deltas_[k] == d) return k + 1;
    deltas_.push_back(d);
    return uint32_t(deltas_.size());
  }

  bool canHave(Value v) const {
    const Inst& i = f_.insts[v];
    if (i.imm >> 32) return false;
    const auto o = f_.operands(v);
    const auto uniform = [&](Value x) { return f_.insts[x].rate <= ir::Rate::Draw; };
    switch (i.op) {
      case Op::Load:
      case Op::LoadConst:
      case Op::Store:
        if (!uniform(o[0]) || !uniform(o[2]) || (isConst(o[2]) && f_.insts[o[2]].imm >> 62) || f_.type(o[1]) != Type::I32) return false;
        break;
      case Op::SharedLoad:
      case Op::SharedStore: break;
      default: return false;
    }
    return ir::typeBytes(i.type != Type::None ? i.type : f_.type(o[i.op == Op::Store ? 3 : 1])) == 4;
  }

  //! The first lane's value of v, and of what it is made of.
  void want(Value v) {
    if (wanted_.empty()) {
      wanted_.assign(f_.insts.size(), 0);
      first_.assign(f_.insts.size(), 0);
    }
    if (wanted_[v]) return;
    wanted_[v] = 1;
    if (form_[v])
      for (Value o : f_.operands(v))
        if (!sameFirst_[v] || o == sameFirst_[v]) want(o);
  }
  Value append(Inst i, std::span<const Value> operands) {
    i.firstOperand = uint32_t(f_.operandPool.size());
    i.operandCount = uint32_t(operands.size());
    f_.operandPool.insert(f_.operandPool.end(), operands.begin(), operands.end());
    f_.insts.push_back(i);
    return Value(f_.insts.size() - 1);
  }
  Value constant(uint32_t bits) { return append({.op = Op::Const, .type = Type::I32, .rate = ir::Rate::Constant, .imm = bits}, {}); }

  Function& f_;
  bool constants_;
  std::vector<uint8_t> flat_;         // by value: all lanes have it alike, or it is uniform
  std::vector<Deltas> deltas_;
  std::vector<uint32_t> form_;        // by value: index + 1 in deltas_
  std::vector<Value> sameFirst_;      // by value: it differs from this one by a number in its deltas only, and takes the same first lane's value; 0: has its own
  std::vector<uint8_t> wanted_;
  std::vector<Value> first_;
};

}  // namespace

bool isGroupUniform(const Function& f, const Inst& input) {
  if (!f.groupSize[0] || input.type != Type::I32) return false;
  if (input.imm & kFirstOfChunk) return true;
  if (input.imm > 2) return input.imm < 6;
  const auto d = localIdDeltas(f.groupSize, input.imm);
  return d && isZero(*d);
}

std::vector<LanePattern> findPatterns(Function& f, bool constants) {
  if (!f.groupSize[0]) return {};
  return Patterns(f, constants).run();
}

}  // namespace pumice::jit
