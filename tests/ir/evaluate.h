// A plain evaluator of lane IR for tests: one operation at a time through foldConstant, any number of lanes,
// structured control flow with masks exactly as stated in ir.h. Slow and simple; it is what executors and
// passes are compared against. Abstract and high-level operations are not evaluated (lower them first).
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

using Row = std::vector<uint64_t>;  //!< bits of each lane

struct Evaluation {
  size_t lanes = 1;
  std::vector<bool> active;                         //!< empty: all
  std::map<uint32_t, Row> inputs;                   //!< by slot
  std::map<uint32_t, Row> outputs;                  //!< by slot; what the routine wrote
  std::map<uint32_t, std::vector<uint8_t>> tables;  //!< by Table
  std::vector<uint8_t> shared;                      //!< work-group memory
  uint64_t maxSteps = 10'000'000;                   //!< guard against loops that never end
  std::string error;                                //!< first thing that could not be done
};

class Evaluator {
 public:
  Evaluator(const Function& f, Evaluation& e) : f_(f), e_(e) {}

  void run() {
    const size_t n = e_.lanes;
    values_.assign(f_.insts.size(), Row(n, 0));
    vars_.assign(f_.insts.size(), Row(n, 0));
    mask_ = e_.active.empty() ? std::vector<bool>(n, true) : e_.active;
    for (Value pc = 1; pc < f_.insts.size() && e_.error.empty();) {
      if (e_.maxSteps-- == 0) e_.error = "too many steps";
      pc = step(pc);
    }
  }
  const Row& value(Value v) const { return values_[v]; }

 private:
  using Mask = std::vector<bool>;
  struct Construct {
    Op op;
    Value start;
    Mask other;    // If: lanes of the else side; Loop/Block: lanes that have left and wait at the end
    Mask outside;  // If: lanes that finished the then side
  };

  static void unite(Mask& a, const Mask& b) {
    for (size_t l = 0; l < a.size(); ++l) a[l] = a[l] || b[l];
  }
  static bool any(const Mask& m) {
    for (bool x : m)
      if (x) return true;
    return false;
  }

  Value step(Value v) {
    const Inst& i = f_.insts[v];
    const auto o = f_.operands(i);
    const size_t n = e_.lanes;
    switch (i.op) {
      case Op::If: {
        Construct c{Op::If, v, Mask(n), Mask(n)};
        for (size_t l = 0; l < n; ++l) {
          const bool m = values_[o[0]][l] & 1;
          c.other[l] = mask_[l] && !m;
          mask_[l] = mask_[l] && m;
        }
        stack_.push_back(c);
        return v + 1;
      }
      case Op::Else:
        stack_.back().outside = mask_;
        mask_ = stack_.back().other;
        stack_.back().other = Mask(n);
        return v + 1;
      case Op::EndIf:
        unite(mask_, stack_.back().other);
        unite(mask_, stack_.back().outside);
        stack_.pop_back();
        return v + 1;
      case Op::Loop:
      case Op::Block:
        stack_.push_back({i.op, v, Mask(n), Mask(n)});
        return v + 1;
      case Op::EndLoop:
        if (any(mask_)) return stack_.back().start + 1;
        [[fallthrough]];
      case Op::EndBlock:
        unite(mask_, stack_.back().other);
        stack_.pop_back();
        return v + 1;
      case Op::Break: {
        uint64_t left = i.imm;
        for (size_t k = stack_.size(); k-- > 0;) {
          if (stack_[k].op == Op::If) continue;
          if (left-- == 0) {
            unite(stack_[k].other, mask_);
            break;
          }
        }
        mask_ = Mask(n);
        return v + 1;
      }
      default:
        break;
    }
    for (size_t l = 0; l < n; ++l)
      if (mask_[l]) lane(v, i, o, l);
    return v + 1;
  }

  void lane(Value v, const Inst& i, std::span<const Value> o, size_t l) {
    uint64_t args[8] = {};
    for (size_t k = 0; k < o.size() && k < 8; ++k) args[k] = values_[o[k]][l];
    uint64_t& r = values_[v][l];
    const auto high = uint32_t(i.imm >> 32), low = uint32_t(i.imm);
    const size_t quad = l & ~size_t(3);
    switch (i.op) {
      case Op::Const:
        r = i.imm;
        return;
      case Op::Var:
        return;  // zero at the start of the routine, not of the region
      case Op::VarGet:
        r = vars_[o[0]][l];
        return;
      case Op::VarSet:
        vars_[o[0]][l] = args[1];
        return;
      case Op::Input:
        r = e_.inputs[low].size() > l ? e_.inputs[low][l] : 0;
        return;
      case Op::Output: {
        Row& row = e_.outputs[low];
        row.resize(e_.lanes);
        row[l] = args[0];
        return;
      }
      case Op::ExecMask:
        r = 1;
        return;
      case Op::LaneId:
        r = l;
        return;
      case Op::UniformInput:
        r = fromTable(kTableDraw, low, typeBytes(i.type));
        return;
      case Op::TableLoad:
        r = fromTable(high, uint64_t(low) + uint32_t(args[0]), typeBytes(i.type));
        return;
      case Op::Load:
      case Op::LoadConst: {
        const uint64_t at = args[1] + low, bytes = typeBytes(i.type);
        r = 0;
        if (at <= args[2] && bytes <= args[2] - at)
          std::memcpy(&r, reinterpret_cast<const void*>(args[0] + at), bytes);
        return;
      }
      case Op::Store: {
        const uint64_t at = args[1] + low, bytes = typeBytes(f_.type(o[3]));
        if (at <= args[2] && bytes <= args[2] - at)
          std::memcpy(reinterpret_cast<void*>(args[0] + at), &args[3], bytes);
        return;
      }
      case Op::LocalAlloc:
        return;
      case Op::LocalLoad: {
        const std::vector<uint8_t>& memory = local(o[0], l);
        const uint64_t at = uint64_t(uint32_t(args[1])) + i.imm, bytes = typeBytes(i.type);
        r = 0;
        if (at <= memory.size() && bytes <= memory.size() - at) std::memcpy(&r, memory.data() + at, bytes);
        return;
      }
      case Op::LocalStore: {
        std::vector<uint8_t>& memory = local(o[0], l);
        const uint64_t at = uint64_t(uint32_t(args[1])) + i.imm, bytes = typeBytes(f_.type(o[2]));
        if (at <= memory.size() && bytes <= memory.size() - at)
          std::memcpy(memory.data() + at, &args[2], bytes);
        return;
      }
      case Op::QuadSwizzle:
        r = values_[o[0]][quad + (i.imm >> (l & 3) * 2 & 3)];
        return;
      case Op::QuadDdx:
      case Op::QuadDdy: {
        const bool x = i.op == Op::QuadDdx;
        const size_t base = quad + (i.imm ? (x ? l & 2 : l & 1) : 0), next = base + (x ? 1 : 2);
        const uint64_t d[] = {values_[o[0]][next], values_[o[0]][base]};
        foldConstant(Op::FSub, i.type, i.type, d, r);
        return;
      }
      case Op::SubgroupAny:
      case Op::SubgroupAll: {
        bool some = false, all = true;
        const size_t first = l - l % kSubgroupLanes;
        for (size_t k = first; k < std::min(e_.lanes, first + kSubgroupLanes); ++k)
          if (mask_[k]) (values_[o[0]][k] & 1 ? some = true : all = false);
        r = i.op == Op::SubgroupAny ? some : all;
        return;
      }
      case Op::SubgroupBallot:
        for (size_t k = 0; k < kSubgroupLanes; ++k) {
          const size_t from = l - l % kSubgroupLanes + k;
          if (k == 0) r = 0;
          if (from < e_.lanes && mask_[from]) r |= (values_[o[0]][from] & 1) << k;
        }
        return;
      case Op::SubgroupShuffle: {
        const size_t from = l - l % kSubgroupLanes + args[1] % kSubgroupLanes;
        r = from < e_.lanes ? values_[o[0]][from] : 0;
        return;
      }
      case Op::SubgroupReduce:
        r = reduce(i, values_[o[0]], l);
        return;
      default:
        if (!foldConstant(i.op, i.type, o.empty() ? Type::None : f_.type(o.back()), {args, o.size()}, r) &&
            e_.error.empty())
          e_.error = std::string("not evaluated: ") + opInfo(i.op).text;
    }
  }

  //! By recursion over the tree of ir.h, seen from its root.
  uint64_t reduce(const Inst& i, const Row& row, size_t l) {
    const ReduceOp op = ReduceOp(i.imm & 0xff);
    const ScanKind kind = ScanKind(i.imm >> 8 & 0xff);
    const size_t cluster = size_t(1) << (i.imm >> 16), first = l - l % cluster;
    const auto leaf = [&](size_t k) { return k < e_.lanes && mask_[k] ? row[k] : reduceIdentity(op, i.type); };
    const auto join = [&](uint64_t a, uint64_t b) {
      const uint64_t args[] = {a, b};
      uint64_t r = 0;
      foldConstant(reduceOperation(op), i.type, i.type, args, r);
      return r;
    };
    // Of `width` lanes up to and including lane k.
    std::function<uint64_t(size_t, size_t)> ending = [&](size_t k, size_t width) -> uint64_t {
      if (width == 1) return leaf(k);
      const size_t half = width / 2;
      return k - first >= half ? join(ending(k - half, half), ending(k, half)) : ending(k, half);
    };
    uint64_t r;
    if (kind == ScanKind::Reduce) r = ending(first + cluster - 1, cluster);
    else if (kind == ScanKind::Inclusive) r = ending(l, cluster);
    else r = l == first ? reduceIdentity(op, i.type) : ending(l - 1, cluster);
    if (isFloat(i.type) && floatValue(i.type, r) != floatValue(i.type, r)) r = floatBits(i.type, floatValue(i.type, r));
    return r;
  }

  uint64_t fromTable(uint32_t table, uint64_t at, size_t bytes) {
    const std::vector<uint8_t>& t = e_.tables[table];
    uint64_t r = 0;
    if (at <= t.size() && bytes <= t.size() - at) std::memcpy(&r, t.data() + at, bytes);
    return r;
  }

  std::vector<uint8_t>& local(Value alloc, size_t lane) {
    std::vector<uint8_t>& memory = local_[{alloc, lane}];
    memory.resize(f_.insts[alloc].imm);
    return memory;
  }

  const Function& f_;
  Evaluation& e_;
  std::map<std::pair<Value, size_t>, std::vector<uint8_t>> local_;
  std::vector<Row> values_, vars_;
  Mask mask_;
  std::vector<Construct> stack_;
};

inline void evaluate(const Function& f, Evaluation& e) { Evaluator(f, e).run(); }

}  // namespace pumice::ir
