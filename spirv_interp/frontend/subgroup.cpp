// Subgroups (runs of ir::kSubgroupLanes consecutive lanes) and quads: the operations of GroupNonUniform*, and the older
// ones of SPV_KHR_shader_ballot and SPV_KHR_subgroup_vote. A ballot fits into the first of its four words.
#include <bit>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

using Values = std::vector<Value>;
using ir::ReduceOp;
using ir::ScanKind;

constexpr uint32_t kAllLanesLog2 = std::countr_zero(ir::kSubgroupLanes);
static_assert(ir::kSubgroupLanes == 32, "a ballot is one word");

//! Operand i behind the execution scope, which the operations of the extensions do not have.
constexpr uint32_t kNoScope = 0x100;
uint32_t operandAt(Translator& t, const Instruction& inst, uint32_t aux, size_t i) {
  if (aux & kNoScope) return inst.operand(i);
  auto scope = spv::Scope(t.requireConstant(inst.operand(0), "scope"));
  if (scope != spv::Scope::Subgroup) fail("%s of scope %u is not supported", opcodeName(inst.op).c_str(), uint32_t(scope));
  return inst.operand(i + 1);
}

Value ballot(Translator& t, Value m) { return t.b.emit(Op::SubgroupBallot, Type::I32, {m}); }
Value activeLanes(Translator& t) { return ballot(t, t.b.mask(true)); }
Value firstLane(Translator& t) { return t.b.unary(Op::FindLsb, activeLanes(t)); }

Value toNumber(Translator& t, Value m) { return t.b.select(m, t.b.i32(1), t.b.i32(0)); }
Value toMask(Translator& t, Value v) { return t.b.ine(v, t.b.i32(0)); }

//! The value that lane `lane` of the subgroup has.
Value shuffle(Translator& t, Value v, Value lane) {
  if (t.b.type(v) == Type::Mask) return toMask(t, shuffle(t, toNumber(t, v), lane));
  return t.b.emit(Op::SubgroupShuffle, t.b.type(v), {v, lane});
}
Value swizzle(Translator& t, Value v, uint64_t lanes) {
  if (t.b.type(v) == Type::Mask) return toMask(t, swizzle(t, toNumber(t, v), lanes));
  return t.b.emit(Op::QuadSwizzle, t.b.type(v), {v}, lanes);
}

template <typename Formula>
void each(Translator& t, const Instruction& inst, uint32_t id, Formula&& f) {
  Values out;
  for (Value v : t.data(id)) out.push_back(f(v));
  t.define(inst, std::move(out));
}

void onElect(Translator& t, const Instruction& inst, uint32_t aux) {
  operandAt(t, inst, aux, 0);
  t.define(inst, {t.b.ieq(firstLane(t), t.subgroupLane())});
}

void onVote(Translator& t, const Instruction& inst, uint32_t aux) {
  Value m = t.scalar(operandAt(t, inst, aux, 0));
  if (t.b.type(m) != Type::Mask) fail("%s of something other than a bool", opcodeName(inst.op).c_str());
  t.define(inst, {t.b.emit(Op(aux & 0xff), Type::Mask, {m})});
}

void onAllEqual(Translator& t, const Instruction& inst, uint32_t aux) {
  Value first = firstLane(t), same = 0;
  for (Value v : t.data(operandAt(t, inst, aux, 0))) {
    Type type = t.b.type(v);
    if (type == Type::Mask) v = toNumber(t, v);
    Value other = shuffle(t, v, first);
    Value equal = ir::isFloat(type) ? t.b.feq(v, other) : t.b.ieq(v, other);
    same = same ? t.b.maskAnd(same, equal) : equal;
  }
  if (!same) fail("%s of nothing", opcodeName(inst.op).c_str());
  t.define(inst, {t.b.emit(Op::SubgroupAll, Type::Mask, {same})});
}

void onBallot(Translator& t, const Instruction& inst, uint32_t aux) {
  Value m = t.scalar(operandAt(t, inst, aux, 0));
  if (t.b.type(m) != Type::Mask) fail("%s of something other than a bool", opcodeName(inst.op).c_str());
  Value zero = t.b.i32(0);
  t.define(inst, {ballot(t, m), zero, zero, zero});
}

//! The word of a ballot that counts.
Value ballotWord(Translator& t, uint32_t id) {
  const Values& v = t.data(id);
  if (v.size() != 4 || t.b.type(v[0]) != Type::I32) fail("id %u is not a ballot", id);
  return v[0];
}

void onInverseBallot(Translator& t, const Instruction& inst, uint32_t aux) {
  Value word = ballotWord(t, operandAt(t, inst, aux, 0));
  t.define(inst, {toMask(t, t.b.and_(t.b.lshr(word, t.subgroupLane()), t.b.i32(1)))});
}

void onBallotBitExtract(Translator& t, const Instruction& inst, uint32_t aux) {
  Value word = ballotWord(t, operandAt(t, inst, aux, 0));
  Value index = t.toI32(t.scalar(operandAt(t, inst, aux, 1)), false);
  Value bit = t.b.and_(t.b.lshr(word, index), t.b.i32(1));
  t.define(inst, {t.b.maskAnd(toMask(t, bit), t.b.ult(index, t.b.i32(ir::kSubgroupLanes)))});
}

void onBallotBitCount(Translator& t, const Instruction& inst, uint32_t aux) {
  Value word = ballotWord(t, operandAt(t, inst, aux, 1));
  ir::Builder& b = t.b;
  switch (spv::GroupOperation(operandAt(t, inst, aux, 0))) {
    case spv::GroupOperation::Reduce: break;
    case spv::GroupOperation::InclusiveScan: word = b.and_(word, t.laneMask(spv::BuiltIn::SubgroupLeMask)); break;
    case spv::GroupOperation::ExclusiveScan: word = b.and_(word, t.laneMask(spv::BuiltIn::SubgroupLtMask)); break;
    default: fail("OpGroupNonUniformBallotBitCount of an unknown kind");
  }
  t.define(inst, {t.resize(b.unary(Op::PopCount, word), t.type(inst.resultType).scalar, false)});
}

void onBallotFind(Translator& t, const Instruction& inst, uint32_t aux) {
  Value word = ballotWord(t, operandAt(t, inst, aux, 0));
  t.define(inst, {t.resize(t.b.unary(Op(aux & 0xff), word), t.type(inst.resultType).scalar, false)});
}

void onBroadcast(Translator& t, const Instruction& inst, uint32_t aux) {
  Value lane = t.toI32(t.scalar(operandAt(t, inst, aux, 1)), false);
  each(t, inst, operandAt(t, inst, aux, 0), [&](Value v) { return shuffle(t, v, lane); });
}

void onBroadcastFirst(Translator& t, const Instruction& inst, uint32_t aux) {
  Value lane = firstLane(t);
  each(t, inst, operandAt(t, inst, aux, 0), [&](Value v) { return shuffle(t, v, lane); });
}

//! The other lane is this lane's number combined with the operand.
void onShuffleRelative(Translator& t, const Instruction& inst, uint32_t aux) {
  Value by = t.toI32(t.scalar(operandAt(t, inst, aux, 1)), false);
  Value lane = t.b.binary(Op(aux & 0xff), t.subgroupLane(), by);
  each(t, inst, operandAt(t, inst, aux, 0), [&](Value v) { return shuffle(t, v, lane); });
}

//! Lanes per cluster, as their logarithm. More than the subgroup has may be named in code that is never reached.
uint32_t clusterLog2(Translator& t, uint32_t id) {
  uint64_t size = t.requireConstant(id, "cluster size");
  if (!std::has_single_bit(size)) fail("a cluster of %llu lanes", (unsigned long long)size);
  return uint32_t(std::countr_zero(std::min<uint64_t>(size, ir::kSubgroupLanes)));
}

//! The other lane is this one's number plus the operand, around its cluster.
void onRotate(Translator& t, const Instruction& inst, uint32_t aux) {
  Value by = t.toI32(t.scalar(operandAt(t, inst, aux, 1)), false);
  uint32_t log2 = inst.count() > 3 ? clusterLog2(t, operandAt(t, inst, aux, 2)) : kAllLanesLog2;
  Value within = t.b.i32((1u << log2) - 1), own = t.subgroupLane();
  Value lane = t.b.or_(t.b.and_(own, t.b.unary(Op::Not, within)), t.b.and_(t.b.iadd(own, by), within));
  each(t, inst, operandAt(t, inst, aux, 0), [&](Value v) { return shuffle(t, v, lane); });
}

void onQuadBroadcast(Translator& t, const Instruction& inst, uint32_t aux) {
  uint32_t indexId = operandAt(t, inst, aux, 1), valueId = operandAt(t, inst, aux, 0);
  Value index = t.toI32(t.scalar(indexId), false);
  uint64_t constant = 0;
  if (t.b.isConstant(index, &constant)) {
    each(t, inst, valueId, [&](Value v) { return swizzle(t, v, (constant & 3) * 0x55); });
    return;
  }
  Value lane = t.b.or_(t.b.and_(t.subgroupLane(), t.b.i32(~3u)), t.b.and_(index, t.b.i32(3)));
  each(t, inst, valueId, [&](Value v) { return shuffle(t, v, lane); });
}

void onQuadSwap(Translator& t, const Instruction& inst, uint32_t aux) {
  constexpr uint64_t kLanes[] = {0b10110001, 0b01001110, 0b00011011};  // horizontal, vertical, diagonal
  uint64_t direction = t.requireConstant(operandAt(t, inst, aux, 1), "direction");
  if (direction > 2) fail("OpGroupNonUniformQuadSwap in direction %llu", (unsigned long long)direction);
  each(t, inst, operandAt(t, inst, aux, 0), [&](Value v) { return swizzle(t, v, kLanes[direction]); });
}

void onReduce(Translator& t, const Instruction& inst, uint32_t aux) {
  ScanKind kind = ScanKind::Reduce;
  uint32_t log2 = kAllLanesLog2;
  switch (spv::GroupOperation(operandAt(t, inst, aux, 0))) {
    case spv::GroupOperation::Reduce: break;
    case spv::GroupOperation::InclusiveScan: kind = ScanKind::Inclusive; break;
    case spv::GroupOperation::ExclusiveScan: kind = ScanKind::Exclusive; break;
    case spv::GroupOperation::ClusteredReduce: log2 = clusterLog2(t, operandAt(t, inst, aux, 2)); break;
    default: fail("%s of an unknown kind", opcodeName(inst.op).c_str());
  }
  uint64_t imm = uint64_t(aux & 0xff) | uint64_t(kind) << 8 | uint64_t(log2) << 16;
  each(t, inst, operandAt(t, inst, aux, 1), [&](Value v) {
    bool isMask = t.b.type(v) == Type::Mask;
    if (isMask) v = toNumber(t, v);
    Value r = t.b.emit(Op::SubgroupReduce, t.b.type(v), {v}, imm);
    return isMask ? toMask(t, r) : r;
  });
}

constexpr uint32_t a(Op op) { return uint32_t(op); }
constexpr uint32_t a(ReduceOp op) { return uint32_t(op); }

constexpr HandlerEntry kHandlers[] = {
    {spv::Op::OpGroupNonUniformElect, onElect},
    {spv::Op::OpGroupNonUniformAll, onVote, a(Op::SubgroupAll)},
    {spv::Op::OpGroupNonUniformAny, onVote, a(Op::SubgroupAny)},
    {spv::Op::OpGroupNonUniformAllEqual, onAllEqual},
    {spv::Op::OpGroupNonUniformBroadcast, onBroadcast},
    {spv::Op::OpGroupNonUniformBroadcastFirst, onBroadcastFirst},
    {spv::Op::OpGroupNonUniformBallot, onBallot},
    {spv::Op::OpGroupNonUniformInverseBallot, onInverseBallot},
    {spv::Op::OpGroupNonUniformBallotBitExtract, onBallotBitExtract},
    {spv::Op::OpGroupNonUniformBallotBitCount, onBallotBitCount},
    {spv::Op::OpGroupNonUniformBallotFindLSB, onBallotFind, a(Op::FindLsb)},
    {spv::Op::OpGroupNonUniformBallotFindMSB, onBallotFind, a(Op::FindMsb)},
    {spv::Op::OpGroupNonUniformShuffle, onBroadcast},
    {spv::Op::OpGroupNonUniformShuffleXor, onShuffleRelative, a(Op::Xor)},
    {spv::Op::OpGroupNonUniformShuffleUp, onShuffleRelative, a(Op::ISub)},
    {spv::Op::OpGroupNonUniformShuffleDown, onShuffleRelative, a(Op::IAdd)},
    {spv::Op::OpGroupNonUniformRotateKHR, onRotate},
    {spv::Op::OpGroupNonUniformQuadBroadcast, onQuadBroadcast},
    {spv::Op::OpGroupNonUniformQuadSwap, onQuadSwap},
    {spv::Op::OpGroupNonUniformIAdd, onReduce, a(ReduceOp::IAdd)},
    {spv::Op::OpGroupNonUniformFAdd, onReduce, a(ReduceOp::FAdd)},
    {spv::Op::OpGroupNonUniformIMul, onReduce, a(ReduceOp::IMul)},
    {spv::Op::OpGroupNonUniformFMul, onReduce, a(ReduceOp::FMul)},
    {spv::Op::OpGroupNonUniformSMin, onReduce, a(ReduceOp::SMin)},
    {spv::Op::OpGroupNonUniformUMin, onReduce, a(ReduceOp::UMin)},
    {spv::Op::OpGroupNonUniformFMin, onReduce, a(ReduceOp::FMin)},
    {spv::Op::OpGroupNonUniformSMax, onReduce, a(ReduceOp::SMax)},
    {spv::Op::OpGroupNonUniformUMax, onReduce, a(ReduceOp::UMax)},
    {spv::Op::OpGroupNonUniformFMax, onReduce, a(ReduceOp::FMax)},
    {spv::Op::OpGroupNonUniformBitwiseAnd, onReduce, a(ReduceOp::And)},
    {spv::Op::OpGroupNonUniformBitwiseOr, onReduce, a(ReduceOp::Or)},
    {spv::Op::OpGroupNonUniformBitwiseXor, onReduce, a(ReduceOp::Xor)},
    {spv::Op::OpGroupNonUniformLogicalAnd, onReduce, a(ReduceOp::And)},
    {spv::Op::OpGroupNonUniformLogicalOr, onReduce, a(ReduceOp::Or)},
    {spv::Op::OpGroupNonUniformLogicalXor, onReduce, a(ReduceOp::Xor)},
    {spv::Op::OpSubgroupBallotKHR, onBallot, kNoScope},
    {spv::Op::OpSubgroupFirstInvocationKHR, onBroadcastFirst, kNoScope},
    {spv::Op::OpSubgroupReadInvocationKHR, onBroadcast, kNoScope},
    {spv::Op::OpSubgroupAllKHR, onVote, kNoScope | a(Op::SubgroupAll)},
    {spv::Op::OpSubgroupAnyKHR, onVote, kNoScope | a(Op::SubgroupAny)},
    {spv::Op::OpSubgroupAllEqualKHR, onAllEqual, kNoScope},
};

}  // namespace

std::span<const HandlerEntry> subgroupHandlers() { return kHandlers; }

// --- built-ins

Value Translator::subgroupLane() { return b.and_(b.laneId(), b.i32(ir::kSubgroupLanes - 1)); }

// The lanes equal to, from, above, up to or below this one.
Value Translator::laneMask(spv::BuiltIn builtIn) {
  Value lane = subgroupLane(), bit = b.shl(b.i32(1), lane), ones = b.i32(~0u);
  Value below = b.isub(bit, b.i32(1));
  switch (builtIn) {
    case spv::BuiltIn::SubgroupEqMask: return bit;
    case spv::BuiltIn::SubgroupGeMask: return b.shl(ones, lane);
    case spv::BuiltIn::SubgroupGtMask: return b.and_(b.shl(ones, lane), b.not_(bit));
    case spv::BuiltIn::SubgroupLeMask: return b.or_(below, bit);
    case spv::BuiltIn::SubgroupLtMask: return below;
    default: fail("built-in %u is not a mask of lanes", uint32_t(builtIn));
  }
}

Value Translator::subgroupBuiltIn(spv::BuiltIn builtIn, uint32_t component) {
  uint64_t invocations = uint64_t(shader.localSize[0]) * shader.localSize[1] * shader.localSize[2];
  switch (builtIn) {
    case spv::BuiltIn::SubgroupSize: return b.i32(ir::kSubgroupLanes);
    case spv::BuiltIn::SubgroupLocalInvocationId: return subgroupLane();
    case spv::BuiltIn::NumSubgroups: return b.i32(uint32_t((invocations + ir::kSubgroupLanes - 1) / ir::kSubgroupLanes));
    case spv::BuiltIn::SubgroupId: {
      Value index = b.emit(Op::Builtin, Type::I32, {}, uint64_t(spv::BuiltIn::LocalInvocationIndex) << 32);
      return b.lshr(index, b.i32(kAllLanesLog2));
    }
    case spv::BuiltIn::SubgroupEqMask:
    case spv::BuiltIn::SubgroupGeMask:
    case spv::BuiltIn::SubgroupGtMask:
    case spv::BuiltIn::SubgroupLeMask:
    case spv::BuiltIn::SubgroupLtMask: return component ? b.i32(0) : laneMask(builtIn);
    default: return 0;
  }
}

}  // namespace pumice::frontend
