#include "tests/support/reference.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "spirv_interp/ir/fold.h"

namespace pumice::testing {
namespace {

using ir::AtomicOp, ir::Function, ir::Inst, ir::Op, ir::ReduceOp, ir::ScanKind, ir::Type, ir::Value, ir::kSubgroupLanes;
using interp::ExecContext;

uint64_t arithmetic(Op op, Type t, uint64_t a, uint64_t b) {
  const uint64_t args[] = {a, b};
  uint64_t r = 0;
  ir::foldConstant(op, t, t, args, r);
  return r;
}
uint64_t canonical(Type t, uint64_t bits) {
  if (!ir::isFloat(t)) return bits;
  const double x = ir::floatValue(t, bits);
  return x != x ? ir::floatBits(t, x) : bits;
}

class Reference {
 public:
  Reference(const Function& f, std::span<const ExecContext> rows) : f_(f), rows_(rows) {
    for (uint32_t r = 0; r < rows.size(); r++)
      for (uint32_t l = 0; l < rows[r].lanes; l++) {
        place_.push_back({r, l, uint32_t(place_.size() - l)});
        mask_.push_back(rows[r].active[l / 64] >> (l % 64) & 1);
      }
    n_ = place_.size();
    values_.assign(f.insts.size() * n_, 0);
    local_.resize(f.insts.size());
    for (Value v = 1; v < f.insts.size(); v++)
      if (f.insts[v].op == Op::LocalAlloc) local_[v].assign(n_ * f.insts[v].imm, std::byte(0));
  }

  std::string run(uint64_t maxSteps) {
    for (Value v = 1; v < f_.insts.size() && error_.empty();) {
      if (maxSteps-- == 0) return "the program does not end";
      v = step(v);
    }
    return error_;
  }

 private:
  using Mask = std::vector<uint8_t>;
  struct Place {
    uint32_t row, lane;
    uint32_t rowStart;   // index of the row's lane 0
  };
  struct Construct {
    Op op;
    Value start;
    Mask waiting;   // lanes that have left and wait at the end; of an `if`: those that have finished the then side
    Mask other;     // of an `if`: lanes of the else side
  };

  static void unite(Mask& a, const Mask& b) {
    for (size_t i = 0; i < a.size(); i++) a[i] |= b[i];
  }
  uint64_t& value(Value v, size_t i) { return values_[v * n_ + i]; }

  Value step(Value v) {
    const Inst& i = f_.insts[v];
    const auto o = f_.operands(i);
    switch (i.op) {
      case Op::If: {
        Construct c{Op::If, v, Mask(n_), Mask(n_)};
        for (size_t l = 0; l < n_; l++) {
          c.other[l] = mask_[l] && !value(o[0], l);
          mask_[l] = mask_[l] && value(o[0], l);
        }
        stack_.push_back(std::move(c));
        return v + 1;
      }
      case Op::Else:
        stack_.back().waiting = mask_;
        mask_ = std::exchange(stack_.back().other, Mask(n_));
        return v + 1;
      case Op::EndIf:
        unite(mask_, stack_.back().other);
        unite(mask_, stack_.back().waiting);
        stack_.pop_back();
        return v + 1;
      case Op::Loop:
      case Op::Block: stack_.push_back({i.op, v, Mask(n_), Mask(n_)}); return v + 1;
      case Op::EndLoop:
        if (std::find(mask_.begin(), mask_.end(), 1) != mask_.end()) return stack_.back().start + 1;
        [[fallthrough]];
      case Op::EndBlock:
        unite(mask_, stack_.back().waiting);
        stack_.pop_back();
        return v + 1;
      case Op::Break: {
        size_t k = stack_.size();
        for (uint64_t left = i.imm + 1; left;)
          if (stack_[--k].op != Op::If) left--;
        unite(stack_[k].waiting, mask_);
        std::fill(mask_.begin(), mask_.end(), 0);
        return v + 1;
      }
      case Op::Var:
      case Op::LocalAlloc:
      case Op::Barrier: return v + 1;
      default: break;
    }
    // A variable's value stands with its declaration.
    for (size_t l = 0; l < n_; l++)
      if (mask_[l]) lane(v, i, o, l);
    return v + 1;
  }

  void lane(Value v, const Inst& i, std::span<const Value> o, size_t l) {
    const Place at = place_[l];
    const ExecContext& row = rows_[at.row];
    uint64_t args[5] = {};
    for (size_t k = 0; k < std::min<size_t>(o.size(), 5); k++) args[k] = value(o[k], l);
    const Type last = o.empty() ? Type::None : f_.type(o.back());
    const uint32_t high = uint32_t(i.imm >> 32), low = uint32_t(i.imm);
    const unsigned bytes = ir::typeBytes(i.type != Type::None ? i.type : last);
    uint64_t& r = value(v, l);
    switch (i.op) {
      case Op::Const: r = i.imm; return;
      case Op::VarGet: r = args[0]; return;
      case Op::VarSet: value(o[0], l) = args[1]; return;
      case Op::Input: r = rowElement(row.inputs[low], i.type, at.lane); return;
      case Op::Output: setRowElement(row.outputs[low], last, at.lane, args[0]); return;
      case Op::ExecMask: r = 1; return;
      case Op::LaneId: r = at.lane; return;
      case Op::UniformInput: r = fromTable(row, ir::kTableDraw, low, bytes); return;
      case Op::TableLoad: r = fromTable(row, high, uint64_t(low) + args[0], bytes); return;
      case Op::Load:
      case Op::LoadConst: r = read(buffer(i, args, bytes), bytes); return;
      case Op::Store: write(buffer(i, args, bytes), bytes, args[3]); return;
      case Op::Atomic: r = atomic(buffer(i, args, bytes), AtomicOp(high), i.type, args[3]); return;
      case Op::AtomicCas: r = compareExchange(buffer(i, args, bytes), bytes, args[3], args[4]); return;
      case Op::LocalLoad: r = read(localPlace(o[0], l, args[1] + low, bytes), bytes); return;
      case Op::LocalStore: write(localPlace(o[0], l, args[1] + low, bytes), bytes, args[2]); return;
      case Op::SharedLoad: r = read(shared(row, args[0] + low, bytes), bytes); return;
      case Op::SharedStore: write(shared(row, args[0] + low, bytes), bytes, args[1]); return;
      case Op::SharedAtomic: r = atomic(shared(row, args[0] + low, bytes), AtomicOp(high), i.type, args[1]); return;
      case Op::SharedAtomicCas: r = compareExchange(shared(row, args[0] + low, bytes), bytes, args[1], args[2]); return;
      case Op::QuadLoad: r = read(const_cast<std::byte*>(row.quadRecords[at.lane / 4]) + i.imm, bytes); return;
      case Op::TileLoad: r = read(tile(row, i.imm, at.lane), bytes); return;
      case Op::TileStore: write(tile(row, i.imm, at.lane), bytes, args[0]); return;
      case Op::QuadSwizzle: r = value(o[0], l - at.lane % 4 + (i.imm >> (at.lane & 3) * 2 & 3)); return;
      case Op::QuadDdx: r = derivative(i, o[0], l, 1); return;
      case Op::QuadDdy: r = derivative(i, o[0], l, 2); return;
      case Op::SubgroupAny:
      case Op::SubgroupAll:
      case Op::SubgroupBallot: {
        const auto [first, end] = subgroup(l);
        uint64_t active = 0, set = 0;
        for (size_t k = first; k < end; k++) {
          active |= uint64_t(mask_[k]) << (k - first);
          set |= (value(o[0], k) & mask_[k]) << (k - first);
        }
        r = i.op == Op::SubgroupAny ? set != 0 : i.op == Op::SubgroupAll ? set == active : set;
        return;
      }
      case Op::SubgroupShuffle: {
        const auto [first, end] = subgroup(l);
        const size_t from = first + args[1] % kSubgroupLanes;
        r = from < end ? value(o[0], from) : 0;
        return;
      }
      case Op::SubgroupReduce: r = reduce(i, o[0], l); return;
      default:
        if (!ir::foldConstant(i.op, i.type, last, {args, o.size()}, r) && error_.empty())
          error_ = std::string("the reference does not know ") + ir::opInfo(i.op).text;
    }
  }

  // --- memory: places are null where an access is out of bounds

  static uint64_t read(const std::byte* p, unsigned bytes) {
    uint64_t v = 0;
    if (p) std::memcpy(&v, p, bytes);
    return v;
  }
  static void write(std::byte* p, unsigned bytes, uint64_t v) {
    if (p) std::memcpy(p, &v, bytes);
  }
  static std::byte* within(std::byte* base, uint64_t size, uint64_t at, unsigned bytes) {
    return base && bytes <= size && at <= size - bytes ? base + at : nullptr;
  }
  static std::byte* buffer(const Inst& i, const uint64_t* args, unsigned bytes) {
    const uint64_t at = args[1] + uint32_t(i.imm);
    if (at < args[1]) return nullptr;
    return within(reinterpret_cast<std::byte*>(args[0]), args[2], at, bytes);
  }
  static std::byte* shared(const ExecContext& row, uint64_t at, unsigned bytes) { return within(row.shared, row.sharedBytes, at, bytes); }
  std::byte* localPlace(Value alloc, size_t l, uint64_t at, unsigned bytes) {
    const uint64_t size = f_.insts[alloc].imm;
    return within(local_[alloc].data() + l * size, size, at, bytes);
  }
  static uint64_t fromTable(const ExecContext& row, uint32_t table, uint64_t at, unsigned bytes) {
    const interp::Table& t = row.tables[table];
    return read(within(const_cast<std::byte*>(t.data), t.size, at, bytes), bytes);
  }
  static std::byte* tile(const ExecContext& row, uint64_t imm, uint32_t lane) {
    const interp::TilePlane& plane = row.tilePlanes[imm >> 32];
    return plane.base + (uint64_t(plane.quadElement[lane / 4]) + lane % 4) * (imm >> 16 & 0xffff) + (imm & 0xffff);
  }
  static uint64_t rowElement(const void* row, Type t, uint32_t lane) {
    const auto* p = static_cast<const std::byte*>(row);
    if (t == Type::Mask) return uint64_t(p[lane / 8]) >> (lane % 8) & 1;
    return read(p + lane * ir::typeBytes(t), ir::typeBytes(t));
  }
  static void setRowElement(void* row, Type t, uint32_t lane, uint64_t v) {
    auto* p = static_cast<std::byte*>(row);
    if (t == Type::Mask) p[lane / 8] = (p[lane / 8] & ~(std::byte(1) << lane % 8)) | std::byte(v & 1) << lane % 8;
    else write(p + lane * ir::typeBytes(t), ir::typeBytes(t), v);
  }

  uint64_t atomic(std::byte* p, AtomicOp op, Type t, uint64_t v) const {
    if (!p) return 0;
    const unsigned bytes = ir::typeBytes(t);
    const uint64_t old = read(p, bytes);
    constexpr Op kOps[] = {Op::IAdd, Op::SMin, Op::SMax, Op::UMin, Op::UMax, Op::And, Op::Or, Op::Xor};
    // Integer operations see the bits of a float as an integer.
    if (size_t(op) < std::size(kOps)) write(p, bytes, arithmetic(kOps[size_t(op)], ir::intOf(t), old, v));
    else if (op == AtomicOp::FAdd) write(p, bytes, arithmetic(Op::FAdd, t, old, v));
    else if (op != AtomicOp::Load) write(p, bytes, v);
    return op == AtomicOp::Store ? 0 : old;
  }
  static uint64_t compareExchange(std::byte* p, unsigned bytes, uint64_t v, uint64_t comparator) {
    if (!p) return 0;
    const uint64_t old = read(p, bytes);
    if (old == comparator) write(p, bytes, v);
    return old;
  }

  // --- across lanes

  uint64_t derivative(const Inst& i, Value of, size_t l, size_t step) {
    const size_t lane = place_[l].lane % 4, quad = l - lane;
    const size_t base = quad + (i.imm ? lane & ~step : 0);
    return arithmetic(Op::FSub, i.type, value(of, base + step), value(of, base));
  }
  std::pair<size_t, size_t> subgroup(size_t l) const {
    const Place& at = place_[l];
    const size_t first = l - at.lane % kSubgroupLanes;
    return {first, std::min<size_t>(first + kSubgroupLanes, at.rowStart + rows_[at.row].lanes)};
  }

  //! The tree of ir.h, seen from its root.
  uint64_t reduce(const Inst& i, Value of, size_t l) {
    const ReduceOp op = ReduceOp(i.imm & 0xff);
    const ScanKind kind = ScanKind(i.imm >> 8 & 0xff);
    const size_t cluster = size_t(1) << (i.imm >> 16);
    const size_t end = subgroup(l).second, first = l - place_[l].lane % cluster;
    const uint64_t identity = ir::reduceIdentity(op, i.type);
    const Op join = ir::reduceOperation(op);
    auto leaf = [&](size_t k) { return k < end && mask_[k] ? value(of, k) : identity; };
    // Of `width` lanes up to and including lane k.
    auto ending = [&](auto& self, size_t k, size_t width) -> uint64_t {
      if (width == 1) return leaf(k);
      const size_t half = width / 2;
      const uint64_t right = self(self, k, half);
      return k - first >= half ? arithmetic(join, i.type, self(self, k - half, half), right) : right;
    };
    uint64_t r;
    if (kind == ScanKind::Reduce) r = ending(ending, first + cluster - 1, cluster);
    else if (kind == ScanKind::Inclusive) r = ending(ending, l, cluster);
    else r = l == first ? identity : ending(ending, l - 1, cluster);
    return canonical(i.type, r);
  }

  const Function& f_;
  const std::span<const ExecContext> rows_;
  size_t n_ = 0;
  std::vector<Place> place_;
  std::vector<uint64_t> values_;
  std::vector<std::vector<std::byte>> local_;
  Mask mask_;
  std::vector<Construct> stack_;
  std::string error_;
};

}  // namespace

std::string runReference(const Function& f, std::span<const ExecContext> rows, uint64_t maxSteps) { return Reference(f, rows).run(maxSteps); }

}  // namespace pumice::testing
