#include "tests/support/random_program.h"

#include <algorithm>

#include "spirv_interp/ir/builder.h"

namespace pumice::testing {
namespace {

using ir::AtomicOp, ir::Builder, ir::Op, ir::OperandRule, ir::ReduceOp, ir::ScanKind, ir::Type, ir::Value;

constexpr Type kData[] = {Type::I8, Type::I16, Type::I32, Type::I64, Type::F16, Type::F32, Type::F64};
constexpr Type kFloats[] = {Type::F16, Type::F32, Type::F64};
constexpr Type kInts[] = {Type::I8, Type::I16, Type::I32, Type::I64};
constexpr unsigned kTypes = unsigned(Type::Tuple) + 1;
constexpr uint32_t kMaxOutputs = 28;   // by the way; variables' come on top
constexpr unsigned kMaxDepth = 4;

std::vector<Op> operations(bool high) {
  std::vector<Op> list;
  for (unsigned k = 1; k < unsigned(Op::kCount); k++) {
    const ir::OpInfo& info = ir::opInfo(Op(k));
    if ((info.flags & ir::kPure) && info.operands != OperandRule::Free && bool(info.flags & ir::kHigh) == high) list.push_back(Op(k));
  }
  return list;
}

class Generator {
 public:
  Generator(Choices& r, const ProgramOptions& options) : r_(r), o_(options), b_(p_.function) {}

  Program make() {
    p_.function.name = "random";
    favourite_ = r_.of(kData);
    declare();
    const bool returns = o_.controlFlow && r_.chance(25);
    if (returns) {   // a break out of this block is an early return
      b_.beginBlock();
      uniform_ = false;
      breakable_ = 1;
    }
    const Marks outside = marks();
    body(o_.length, 0);
    keepUnused(outside, 0);
    forget(outside);
    if (returns) b_.endBlock();
    for (Value v : variables_) output(b_.get(v));
    return std::move(p_);
  }

 private:
  using Marks = std::array<size_t, kTypes>;

  // --- what may be emitted

  bool allowed(Type t) const { return t == Type::Mask || t == Type::I32 || t == Type::I64 || (o_.types >> unsigned(t) & 1); }
  bool accepts(Op op, Type t, Type operand) const { return allowed(t) && allowed(operand) && (!o_.accepts || o_.accepts(op, t, operand)); }
  bool accepts(Op op, Type t) const { return accepts(op, t, t); }
  Type dataType() {
    const uint32_t what = r_.below(100);
    const Type t = what < 22 ? Type::F32 : what < 44 ? Type::I32 : what < 72 ? favourite_ : r_.of(kData);
    return allowed(t) ? t : Type::I32;
  }

  // --- values

  //! A value that later instructions may use.
  Value remember(Value v) {
    const Type t = b_.type(v);
    if (v >= seen_.size()) seen_.resize(v + 64, 0), used_.resize(v + 64, 0);
    if (t == Type::None || t == Type::Tuple || seen_[v]) return v;
    seen_[v] = 1;
    pool_[unsigned(t)].push_back(v);
    return v;
  }
  Value emit(Op op, Type t, std::initializer_list<Value> operands, uint64_t imm = 0) { return remember(b_.emit(op, t, operands, imm)); }
  Value constant(Type t) { return b_.constant(t, (r_.chance(50) ? awkwardBits(r_, t) : calmBits(r_, t)) & ir::allOnes(t)); }
  //! Some value of a type, often a young one.
  Value pick(Type t) {
    const std::vector<Value>& pool = pool_[unsigned(t)];
    if (pool.empty() || r_.chance(8)) return constant(t);
    if (r_.chance(12) && uniforms_[unsigned(t)]) return uniforms_[unsigned(t)];
    size_t n = pool.size();
    if (r_.chance(65)) n = std::min<size_t>(n, 6);
    Value v = 0;
    for (int tries = 0; tries < 3; tries++) {   // rather one that nobody has used yet
      v = pool[pool.size() - 1 - r_.below(uint32_t(n))];
      if (!used_[v]) break;
    }
    used_[v] = 1;
    return v;
  }
  Marks marks() const {
    Marks m;
    for (unsigned t = 0; t < kTypes; t++) m[t] = pool_[t].size();
    return m;
  }
  void forget(const Marks& m) {
    for (unsigned t = 0; t < kTypes; t++) {
      for (size_t k = m[t]; k < pool_[t].size(); k++) seen_[pool_[t][k]] = 0;
      pool_[t].resize(m[t]);
    }
  }

  // --- interface

  void declare() {
    p_.inputs = {Type::I32, Type::I32};
    global_ = b_.input(Type::I32, kGlobalIndex);
    local_ = b_.input(Type::I32, kLocalIndex);
    remember(global_);
    for (Type t : {Type::F32, Type::I32, Type::F32, Type::I32, Type::Mask, Type::I8, Type::I16, Type::I64, Type::F16, Type::F64, Type::F32, Type::Mask}) {
      if (!accepts(Op::Input, t)) continue;
      p_.inputs.push_back(t);
      remember(b_.input(t, uint32_t(p_.inputs.size() - 1)));
    }
    for (Type t : kData)
      if (accepts(Op::UniformInput, t)) uniforms_[unsigned(t)] = b_.uniform(t, kDrawData + 8 * r_.below(kDrawDataBytes / 8));
    for (Type t : {Type::I32, Type::F32, Type::Mask, Type::I64, Type::F64, Type::F16, Type::I8, Type::I16})
      if (accepts(Op::Var, t) && r_.chance(t == favourite_ ? 90 : 50)) variables_.push_back(b_.var(t));
    variables_.push_back(b_.var(Type::I32));
    for (Value v : variables_)   // those that stay zero tell little
      if (r_.chance(80) && accepts(Op::VarSet, b_.type(v))) b_.set(v, pick(b_.type(v)));
    if (o_.memory)
      for (unsigned k = 0; k < 2; k++)
        if (accepts(Op::LocalAlloc, Type::I32)) {
          localBytes_[k] = 20 + r_.below(24);
          locals_[k] = b_.emit(Op::LocalAlloc, Type::I32, {}, localBytes_[k]);
        }
  }
  void output(Value v) {
    if (!accepts(Op::Output, b_.type(v))) return;
    b_.output(uint32_t(p_.outputs.size()), v);
    p_.outputs.push_back(b_.type(v));
  }
  //! The value shall be seen in the results.
  void keep(Value v, unsigned depth) {
    if ((depth == 0 || r_.chance(30)) && p_.outputs.size() < kMaxOutputs) return output(v);
    for (Value var : variables_)
      if (b_.type(var) == b_.type(v) && r_.chance(70)) return b_.set(var, v);
  }
  void keepUnused(const Marks& from, unsigned depth) {
    for (unsigned t = 0; t < kTypes; t++)
      for (size_t k = from[t]; k < pool_[t].size(); k++)
        if (!used_[pool_[t][k]]) keep(pool_[t][k], depth);
  }

  // --- arithmetic

  void arithmetic(const std::vector<Op>& list) {
    for (int tries = 0; tries < 20; tries++) {
      const Op op = list[r_.below(uint32_t(list.size()))];
      const ir::OpInfo& info = ir::opInfo(op);
      Type t = dataType(), operand = t;
      switch (info.operands) {
        case OperandRule::Float:
          if (!ir::isFloat(t)) t = r_.of(kFloats);
          operand = t;
          break;
        case OperandRule::Int:
          if (!ir::isInt(t)) t = r_.of(kInts);
          if (op == Op::SMulHi || op == Op::UMulHi) t = Type::I32;
          operand = t;
          break;
        case OperandRule::CmpF:
          operand = ir::isFloat(t) ? t : r_.of(kFloats);
          t = Type::Mask;
          break;
        case OperandRule::CmpI:
          operand = ir::isInt(t) ? t : r_.of(kInts);
          t = Type::Mask;
          break;
        case OperandRule::Mask: t = operand = Type::Mask; break;
        case OperandRule::Sel:
          if (r_.chance(15)) t = operand = Type::Mask;
          break;
        case OperandRule::Cvt:
          operand = r_.chance(50) ? dataType() : r_.of(kData);
          t = r_.of(kData);
          if (!converts(op, operand, t)) continue;
          break;
        default: continue;
      }
      if (!accepts(op, t, operand)) continue;
      Value v[3] = {};
      for (unsigned k = 0; k < info.operandCount; k++) v[k] = pick(info.operands == OperandRule::Sel && k == 0 ? Type::Mask : operand);
      remember(b_.emit(op, t, std::span<const Value>(v, info.operandCount)));
      return;
    }
  }
  static bool converts(Op op, Type from, Type to) {
    using ir::isFloat, ir::isInt, ir::typeBytes;
    switch (op) {
      case Op::FToF: return isFloat(from) && isFloat(to) && from != to;
      case Op::FToS:
      case Op::FToU: return isFloat(from) && isInt(to);
      case Op::SToF:
      case Op::UToF: return isInt(from) && isFloat(to);
      case Op::SExt:
      case Op::ZExt: return isInt(from) && isInt(to) && typeBytes(from) < typeBytes(to);
      case Op::Trunc: return isInt(from) && isInt(to) && typeBytes(from) > typeBytes(to);
      case Op::BitCast: return from != to && typeBytes(from) == typeBytes(to);
      default: return false;
    }
  }

  // --- memory

  struct Buffer {
    Value base, size;
  };
  Buffer buffer(BufferId id) { return {b_.uniform(Type::I64, bufferConstant(id)), b_.uniform(Type::I64, bufferConstant(id) + 8)}; }
  //! A byte offset of one of many shapes, mostly below `size` (a power of two).
  Value offset(uint32_t size, unsigned bytes) {
    switch (r_.below(8)) {
      case 0: return b_.i32(r_.below(size));
      case 1:
      case 2: return b_.iadd(b_.imul(b_.laneId(), b_.i32(bytes)), b_.i32(r_.below(16)));
      case 3: return b_.and_(b_.uniform(Type::I32, kDrawData + 4 * r_.below(8)), b_.i32(size - 1));
      case 4: return r_.chance(40) ? pick(Type::I32) : b_.and_(pick(Type::I32), b_.i32(2 * size - 1));   // may be out of bounds
      default: return b_.and_(pick(Type::I32), b_.i32(size - 1));
    }
  }
  Value widened(Value offset) { return r_.chance(30) && accepts(Op::ZExt, Type::I64, Type::I32) ? b_.convert(Op::ZExt, Type::I64, offset) : offset; }

  //! Some components of a footprint on one or two levels, whose addresses are found by the operation.
  void filterLevels() {
    const Buffer a = buffer(r_.chance(70) ? BufferId::Data : BufferId::MoreData);
    const auto size = [&] { return b_.umax(b_.and_(r_.chance(50) ? b_.i32(8) : pick(Type::I32), b_.i32(15)), b_.i32(1)); };
    const auto unit = [&] { return b_.fmin(b_.fmax(pick(Type::F32), b_.f32(0)), b_.f32(1)); };
    std::vector<Value> o{a.base, a.size, unit(), unit(), size(), size(), b_.i32(4 * r_.below(20)), offset(kDataBytes / 2, 4)};
    const bool two = r_.chance(60);
    if (two) {
      for (uint32_t k = 4; k < 6; ++k) o.push_back(b_.umax(b_.lshr(o[k], b_.i32(1)), b_.i32(1)));
      o.insert(o.end(), {o[6], offset(kDataBytes / 2, 4), r_.chance(20) ? b_.f32(0) : unit()});
    }
    const uint32_t clamps = r_.below(4) << 2;
    for (uint32_t c = 0; c < 4; ++c)
      if (r_.chance(70)) remember(b_.emit(two ? Op::FilterLevels : Op::FilterLevel, Type::F32, o, c | clamps));
  }
  //! Some components of one to two footprints: in a picture of quads, or anywhere.
  void filterTexels() {
    if (r_.chance(30) && accepts(Op::FFloor, Type::F32) && accepts(Op::FToS, Type::I32, Type::F32)) return filterLevels();
    const Buffer a = buffer(r_.chance(70) ? BufferId::Data : BufferId::MoreData);
    for (uint32_t n = 1 + r_.below(2); n--;) {
      const bool picture = r_.chance(60), halves = r_.chance(50);
      const uint32_t bytes = halves ? 8 : 4;
      const auto bits = [&](uint32_t from, uint32_t to) { return b_.shl(b_.and_(b_.lshr(b_.laneId(), b_.i32(from)), b_.i32(1)), b_.i32(to)); };
      Value o[8] = {a.base, a.size};
      const Value words = b_.shl(b_.and_(b_.laneId(), b_.i32(7)), b_.i32(2));   // side by side
      for (uint32_t k = 0; k < 2; ++k) {
        o[2 + k] = picture ? b_.iadd(bits(1, 5), b_.i32(32 * (k + r_.below(16)))) : offset(kDataBytes / 2, bytes);
        if (!picture) o[4 + k] = offset(kDataBytes / 2, bytes);
        else if (halves) o[4 + k] = b_.iadd(b_.iadd(bits(0, 3), bits(2, 4)), b_.i32(8 * k + r_.below(40)));
        else o[4 + k] = k ? b_.iadd(words, b_.i32(4)) : words;
        o[6 + k] = pick(Type::F32);
      }
      for (uint32_t c = 0; c < 4; ++c)
        if (r_.chance(70)) emit(halves ? Op::FilterHalves : Op::FilterBytes, Type::F32, {o[0], o[1], o[2], o[3], o[4], o[5], o[6], o[7]}, c);
    }
  }
  void loadData() {
    if (r_.chance(15) && accepts(Op::LoadConst, Type::I64) && accepts(Op::Fma, Type::F32)) return filterTexels();
    const Type t = dataType();
    const Op op = r_.chance(50) ? Op::Load : Op::LoadConst;
    if (!accepts(op, t)) return;
    Buffer a = buffer(BufferId::Data);
    if (r_.chance(25)) {   // the buffer varies with the lane
      const Buffer other = buffer(BufferId::MoreData);
      const Value m = pick(Type::Mask);
      a = {b_.select(m, a.base, other.base), b_.select(m, a.size, other.size)};
    } else if (r_.chance(30)) {
      a = buffer(BufferId::MoreData);
    } else if (r_.chance(5)) {
      a.base = b_.i64(0);   // nothing is bound
    }
    Value at = offset(kDataBytes, ir::typeBytes(t));
    if (r_.chance(5)) at = pick(Type::I64);
    else at = widened(at);
    if (op == Op::Load && r_.chance(10)) b_.setInstFlags(ir::kInstVolatile);
    emit(op, t, {a.base, at, a.size}, r_.chance(5) ? 0xfffffff0u : r_.below(12));
    b_.setInstFlags(0);
  }
  //! Where this invocation's own element of a width lies.
  Value ownOffset(unsigned bytes) { return b_.imul(global_, b_.i32(bytes)); }
  void own() {
    const Type t = dataType();
    const unsigned bytes = ir::typeBytes(t);
    Buffer a = buffer(BufferId::Own);
    if (r_.chance(15)) a.size = b_.select(pick(Type::Mask), a.size, b_.i64(0));   // some lanes have nothing there
    const uint32_t column = ownColumn(bytes, kMaxInvocations);
    if (r_.chance(60)) {
      if (!accepts(Op::Store, t)) return;
      Value at = ownOffset(bytes);
      if (r_.chance(8)) at = b_.or_(at, b_.i32(0x80000000u));   // out of bounds: vanishes
      b_.emit(Op::Store, Type::None, {a.base, widened(at), a.size, pick(t)}, column);
    } else if (accepts(Op::Load, t)) {
      emit(Op::Load, t, {a.base, widened(ownOffset(bytes)), a.size}, column);
    }
  }
  void table() {
    const Type t = dataType();
    if (r_.chance(35)) {
      if (accepts(Op::UniformInput, t)) emit(Op::UniformInput, t, {}, kDrawData + 8 * r_.below(kDrawDataBytes / 8));
      return;
    }
    if (!accepts(Op::TableLoad, t)) return;
    static constexpr uint32_t kTables[] = {ir::kTablePush, ir::kTableSet0, ir::kTableSet0 + 3, ir::kTableConstants};
    emit(Op::TableLoad, t, {offset(64, ir::typeBytes(t))}, uint64_t(r_.of(kTables)) << 32 | r_.below(24));
  }
  void localMemory() {
    const unsigned k = r_.below(2);
    const Type t = dataType();
    if (!locals_[k]) return;
    Value at = r_.chance(40) ? b_.i32(r_.below(localBytes_[k])) : b_.and_(pick(Type::I32), b_.i32(31));
    if (r_.chance(50)) at = b_.and_(at, b_.i32(~3u));
    const uint32_t constant = r_.below(3) * 4;
    if (r_.chance(50)) {
      if (accepts(Op::LocalStore, t)) b_.emit(Op::LocalStore, Type::None, {locals_[k], at, pick(t)}, constant);
    } else if (accepts(Op::LocalLoad, t)) {
      emit(Op::LocalLoad, t, {locals_[k], at}, constant);
    }
  }

  // Work-group memory is written by its owners, then, behind a barrier, read by everybody.
  void sharedMemory() {
    const Type t = dataType();
    const unsigned bytes = ir::typeBytes(t);
    if (uniform_ && r_.chance(35) && accepts(Op::Barrier, Type::I32)) return barrier();
    if (readable_) {
      if (!accepts(Op::SharedLoad, t)) return;
      useShared();
      if (r_.chance(40)) {
        emit(Op::SharedLoad, t, {offset(4096, bytes)}, r_.chance(50) ? kSharedTotals : r_.below(64));
      } else {   // another invocation's
        const Value other = r_.chance(50) ? b_.xor_(local_, b_.i32(1u << r_.below(7))) : pick(Type::I32);
        emit(Op::SharedLoad, t, {b_.imul(b_.and_(other, b_.i32(63)), b_.i32(bytes))}, ownColumn(bytes, kMaxGroupLanes));
      }
      return;
    }
    const Value at = b_.imul(local_, b_.i32(bytes));
    const uint32_t column = ownColumn(bytes, kMaxGroupLanes);
    if (r_.chance(70)) {
      if (accepts(Op::SharedStore, t)) useShared(), b_.emit(Op::SharedStore, Type::None, {at, pick(t)}, column);
    } else if (accepts(Op::SharedLoad, t)) {
      useShared(), emit(Op::SharedLoad, t, {at}, column);
    }
  }
  void useShared() { p_.function.sharedBytes = kSharedBytes; }
  void barrier() {
    b_.emit(Op::Barrier, Type::None, {});
    readable_ = !readable_;
  }

  void atomic() {
    const bool shared = o_.workGroups && r_.chance(50);
    if (shared && readable_) return;
    if (shared) useShared();
    const Buffer a = shared ? Buffer{} : buffer(BufferId::Own);
    if (r_.chance(40)) {   // totals: only operations of which the order does not matter, and nobody sees the old value
      const Type t = r_.chance(70) ? Type::I32 : Type::I64;
      const uint32_t op = r_.below(8);
      const Value at = b_.imul(b_.and_(pick(Type::I32), b_.i32(15)), b_.i32(8));
      const uint32_t place = op * 128 + (t == Type::I64) * 1024;
      const uint64_t imm = uint64_t(op) << 32 | place;
      if (!accepts(shared ? Op::SharedAtomic : Op::Atomic, t)) return;
      const Buffer totals = buffer(BufferId::Totals);
      if (shared) b_.emit(Op::SharedAtomic, t, {at, pick(t)}, imm + kSharedTotals);
      else b_.emit(Op::Atomic, t, {totals.base, widened(at), totals.size, pick(t)}, imm);
      return;
    }
    static constexpr Type kAtomic[] = {Type::I32, Type::I32, Type::I64, Type::F32, Type::F64};
    const Type t = r_.of(kAtomic);
    const unsigned bytes = ir::typeBytes(t);
    const Value at = shared ? b_.imul(local_, b_.i32(bytes)) : widened(ownOffset(bytes));
    const uint64_t column = ownColumn(bytes, shared ? kMaxGroupLanes : kMaxInvocations);
    if (ir::isInt(t) && r_.chance(25)) {
      if (!accepts(shared ? Op::SharedAtomicCas : Op::AtomicCas, t)) return;
      Value comparator = pick(t);
      if (r_.chance(60)) {   // what is there
        const uint64_t load = uint64_t(AtomicOp::Load) << 32 | column;
        comparator = shared ? b_.emit(Op::SharedAtomic, t, {at, pick(t)}, load) : b_.emit(Op::Atomic, t, {a.base, at, a.size, pick(t)}, load);
      }
      if (shared) emit(Op::SharedAtomicCas, t, {at, pick(t), comparator}, column);
      else emit(Op::AtomicCas, t, {a.base, at, a.size, pick(t), comparator}, column);
      return;
    }
    static constexpr AtomicOp kOfFloats[] = {AtomicOp::FAdd, AtomicOp::FAdd, AtomicOp::Exchange, AtomicOp::Load, AtomicOp::Store};
    static constexpr AtomicOp kOfInts[] = {AtomicOp::Add, AtomicOp::SMin, AtomicOp::SMax, AtomicOp::UMin, AtomicOp::UMax, AtomicOp::And,
                                           AtomicOp::Or, AtomicOp::Xor, AtomicOp::Exchange, AtomicOp::Load, AtomicOp::Store};
    const AtomicOp op = ir::isFloat(t) ? r_.of(kOfFloats) : r_.of(kOfInts);
    const uint64_t imm = uint64_t(op) << 32 | column;
    if (!accepts(shared ? Op::SharedAtomic : Op::Atomic, t)) return;
    if (shared) emit(Op::SharedAtomic, t, {at, pick(t)}, imm);
    else emit(Op::Atomic, t, {a.base, at, a.size, pick(t)}, imm);
  }

  // --- across lanes: inactive ones hold rubbish that must not be seen

  Value activeLanes() { return b_.emit(Op::SubgroupBallot, Type::I32, {b_.mask(true)}); }
  void guarded(Value ok, Value v) {
    const Type t = b_.type(v);
    remember(t == Type::Mask ? b_.maskAnd(ok, v) : b_.select(ok, v, b_.zero(t)));
  }

  void subgroup() {
    if (!accepts(Op::SubgroupBallot, Type::I32, Type::Mask)) return;
    const Type t = dataType();
    switch (r_.below(7)) {
      case 0:
        if (accepts(Op::SubgroupAny, Type::Mask)) emit(Op::SubgroupAny, Type::Mask, {pick(Type::Mask)});
        return;
      case 1:
        if (accepts(Op::SubgroupAll, Type::Mask)) emit(Op::SubgroupAll, Type::Mask, {pick(Type::Mask)});
        return;
      case 2: emit(Op::SubgroupBallot, Type::I32, {pick(Type::Mask)}); return;
      case 3:
      case 4: {
        if (!accepts(Op::SubgroupShuffle, t)) return;
        const Value from = r_.chance(25) ? b_.i32(r_.below(40)) : r_.chance(60) ? b_.xor_(b_.laneId(), b_.i32(r_.below(8))) : pick(Type::I32);
        const Value there = b_.and_(b_.lshr(activeLanes(), b_.and_(from, b_.i32(31))), b_.i32(1));
        const Value moved = b_.emit(Op::SubgroupShuffle, t, {pick(t), from});
        return guarded(b_.ine(there, b_.i32(0)), moved);
      }
      default: {
        if (!accepts(Op::SubgroupReduce, t)) return;
        static constexpr ReduceOp kOfFloats[] = {ReduceOp::FAdd, ReduceOp::FMul, ReduceOp::FMin, ReduceOp::FMax};
        static constexpr ReduceOp kOfInts[] = {ReduceOp::IAdd, ReduceOp::IMul, ReduceOp::SMin, ReduceOp::SMax, ReduceOp::UMin,
                                               ReduceOp::UMax, ReduceOp::And,  ReduceOp::Or,   ReduceOp::Xor};
        const ReduceOp op = ir::isFloat(t) ? r_.of(kOfFloats) : r_.of(kOfInts);
        emit(Op::SubgroupReduce, t, {pick(t)}, uint64_t(op) | uint64_t(r_.below(3)) << 8 | uint64_t(r_.below(6)) << 16);
        return;
      }
    }
  }

  void quad() {
    p_.quads = true;
    const Type t = dataType();
    const unsigned bytes = ir::typeBytes(t);
    switch (r_.below(6)) {
      case 0:
        if (accepts(Op::QuadLoad, t)) emit(Op::QuadLoad, t, {}, r_.below(kQuadRecordBytes - bytes + 1));
        return;
      case 1:
      case 2: {
        uint32_t plane = r_.below(kTilePlanes);
        if (kTileElementBytes[plane] < bytes) plane = 1;
        const uint32_t element = kTileElementBytes[plane];
        const uint64_t imm = Builder::tileImm(plane, element, r_.below(element / bytes) * bytes);
        if (r_.chance(50)) {
          if (accepts(Op::TileStore, t)) b_.emit(Op::TileStore, Type::None, {pick(t)}, imm);
        } else if (accepts(Op::TileLoad, t)) {
          emit(Op::TileLoad, t, {}, imm);
        }
        return;
      }
      default: break;
    }
    if (!accepts(Op::SubgroupBallot, Type::I32, Type::Mask)) return;
    const Value lanes = b_.and_(b_.lshr(activeLanes(), b_.and_(b_.laneId(), b_.i32(28))), b_.i32(15));
    const Value whole = b_.ieq(lanes, b_.i32(15));
    if (r_.chance(40)) {
      const Type s = r_.chance(20) ? Type::Mask : t;
      if (accepts(Op::QuadSwizzle, s)) guarded(whole, b_.emit(Op::QuadSwizzle, s, {pick(s)}, r_.below(256)));
    } else {
      const Type f = ir::isFloat(t) ? t : r_.of(kFloats);
      const Op op = r_.chance(50) ? Op::QuadDdx : Op::QuadDdy;
      if (accepts(op, f)) guarded(whole, b_.emit(op, f, {pick(f)}, r_.below(2)));
    }
  }

  // --- control flow

  //! A nested region; `uniform`: all invocations of the work group are in it together.
  void region(unsigned length, unsigned depth, bool uniform) {
    const bool wasUniform = uniform_, wasReadable = readable_;
    uniform_ = uniform_ && uniform;
    const Marks m = marks();
    body(length, depth);
    keepUnused(m, depth);
    if (uniform_ && readable_ != wasReadable) barrier();
    if (!uniform_ && breakable_ && r_.chance(12)) {
      b_.breakOut(r_.below(breakable_));
      if (r_.chance(50)) keep(pick(Type::I32), depth);   // nobody comes here
    }
    forget(m);
    uniform_ = wasUniform;
  }
  //! The breaks within may leave this construct (unless it is uniform), and those around it that are not uniform.
  template <class F>
  void breakable(bool yes, F f) {
    const uint32_t before = breakable_;
    breakable_ = yes ? breakable_ + 1 : 0;
    f();
    breakable_ = before;
  }
  Value uniformCondition() { return b_.ult(b_.uniform(Type::I32, kDrawData + 4 * r_.below(8)), b_.i32(r_.chance(50) ? 0x80000000u : 256)); }

  void ifElse(unsigned length, unsigned depth) {
    const bool uniform = uniform_ && r_.chance(30);
    b_.beginIf(uniform ? uniformCondition() : pick(Type::Mask));
    region(length, depth + 1, uniform);
    if (r_.chance(50)) {
      b_.beginElse();
      region(length, depth + 1, uniform);
    }
    b_.endIf();
  }
  void block(unsigned length, unsigned depth) {
    b_.beginBlock();
    breakable(true, [&] { region(length, depth + 1, false); });
    b_.endBlock();
  }
  void switchCases(unsigned length, unsigned depth) {
    const Value selector = b_.and_(pick(Type::I32), b_.i32(3));
    b_.beginBlock();
    breakable(true, [&] {
      const bool wasUniform = uniform_;
      uniform_ = false;
      Value fallsThrough = 0;
      const uint32_t cases = 2 + r_.below(2);
      for (uint32_t c = 0; c < cases; c++) {
        Value here = b_.ieq(selector, b_.i32(c));
        if (fallsThrough) here = b_.maskOr(here, fallsThrough);
        b_.beginIf(here);
        region(std::max(1u, length / cases), depth + 1, false);
        const bool falls = r_.chance(30);
        if (!falls) b_.breakOut(0);
        b_.endIf();
        fallsThrough = falls ? here : 0;
      }
      region(length / 2, depth + 1, false);
      uniform_ = wasUniform;
    });
    b_.endBlock();
  }
  void loop(unsigned length, unsigned depth) {
    const bool uniform = uniform_ && r_.chance(40);
    const Value limit = uniform ? b_.i32(1 + r_.below(3)) : b_.and_(pick(Type::I32), b_.i32(3));
    const Value counter = b_.var(Type::I32);
    b_.set(counter, b_.i32(0));   // the loop may be entered again
    b_.beginLoop();
    const Marks m = marks();
    const Value now = b_.get(counter);
    b_.beginIf(b_.ule(limit, now));
    b_.breakOut(0);
    b_.endIf();
    b_.set(counter, b_.iadd(now, b_.i32(1)));
    remember(now);
    breakable(!uniform, [&] { region(length, depth + 1, uniform); });
    forget(m);
    b_.endLoop();
  }

  void body(unsigned length, unsigned depth) {
    const size_t end = p_.function.insts.size() + length;
    while (p_.function.insts.size() < end) {
      const uint32_t what = r_.below(100);
      if (what < 50) arithmetic(plain_);
      else if (what < 54) o_.highMath ? arithmetic(high_) : arithmetic(plain_);
      else if (what < 58 && o_.memory) loadData();
      else if (what < 61 && o_.memory) own();
      else if (what < 64 && o_.memory) table();
      else if (what < 68 && o_.memory) localMemory();
      else if (what < 73 && o_.workGroups) sharedMemory();
      else if (what < 76 && o_.atomics) atomic();
      else if (what < 79 && o_.subgroups) subgroup();
      else if (what < 82 && o_.quads) quad();
      else if (what < 85) remember(b_.get(variables_[r_.below(uint32_t(variables_.size()))]));
      else if (what < 88) {
        const Value var = variables_[r_.below(uint32_t(variables_.size()))];
        b_.set(var, pick(b_.type(var)));
      } else if (what < 89) {
        r_.chance(50) ? remember(b_.execMask()) : remember(b_.laneId());
      } else if (o_.controlFlow && depth < kMaxDepth) {
        const unsigned inner = std::min<unsigned>(6 + r_.below(12), unsigned(end - p_.function.insts.size()));
        if (what < 94) ifElse(inner, depth);
        else if (what < 96) block(inner, depth);
        else if (what < 98) switchCases(inner, depth);
        else loop(inner, depth);
      } else {
        arithmetic(plain_);
      }
    }
  }

  Choices& r_;
  const ProgramOptions& o_;
  Program p_;
  Builder b_;
  const std::vector<Op> plain_ = operations(false), high_ = operations(true);
  Type favourite_ = Type::F32;
  Value global_ = 0, local_ = 0, locals_[2] = {};
  uint32_t localBytes_[2] = {};
  std::vector<Value> variables_;
  std::array<std::vector<Value>, kTypes> pool_;
  std::array<Value, kTypes> uniforms_{};   // one of each type, the same for all invocations
  std::vector<uint8_t> seen_, used_;
  bool uniform_ = true;       // every invocation of the work group that takes part is here
  bool readable_ = false;     // work-group memory is read now, not written
  uint32_t breakable_ = 0;    // innermost loops and blocks that a break may leave
};

}  // namespace

Program makeProgram(Choices& choices, const ProgramOptions& options) { return Generator(choices, options).make(); }

bool isAbstract(Op op) {
  const ir::OpInfo& info = ir::opInfo(op);
  return ((info.flags & ir::kHigh) && info.operands == OperandRule::Free) || op == Op::Check || op == Op::Clock;
}

unsigned operationCount(const ir::Function& f) {
  return unsigned(std::count_if(f.insts.begin() + 1, f.insts.end(),
                                [](const ir::Inst& i) { return i.op != Op::Const && i.op != Op::Var && i.op != Op::LocalAlloc && i.op != Op::Output; }));
}

}  // namespace pumice::testing
