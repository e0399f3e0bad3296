// Operations across the lanes of a subgroup. Reductions follow one fixed tree (ir.h) in plain scalar arithmetic, so
// that they give the same bits everywhere.
#include <bit>
#include <cstring>
#include <type_traits>

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/fold.h"

namespace pumice::interp {
namespace {

using ir::Op, ir::Type, ir::ReduceOp, ir::ScanKind;

//! Gives every lane of a subgroup the verdict test(bits of its subgroup).
template <class F>
inline const Code* perSubgroup(RunState& s, const Code* c, F test) {
  static_assert(kSubgroupLanes <= 64 && 64 % kSubgroupLanes == 0);
  constexpr uint64_t kOne = ~uint64_t(0) >> (64 - kSubgroupLanes);
  uint64_t* dst = s.mask(c->dst);
  const uint64_t* a = s.mask(c->src[0]);
  for (unsigned w = 0; w < kMaskWords; w++) {
    const uint64_t v = test(a[w], s.exec[w]);
    uint64_t out = 0;
    for (unsigned i = 0; i < 64; i += kSubgroupLanes)
      if (v & kOne << i) out |= kOne << i;
    dst[w] = out;
  }
  return c + 1;
}
const Code* subgroupAny(RunState& s, const Code* c) {
  return perSubgroup(s, c, [](uint64_t a, uint64_t e) { return a & e; });
}
const Code* subgroupAll(RunState& s, const Code* c) {
  const Code* next = perSubgroup(s, c, [](uint64_t a, uint64_t e) { return ~a & e; });
  uint64_t* dst = s.mask(c->dst);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = ~dst[w];
  return next;
}

//! Bits of the subgroup that starts at `lane`.
inline uint64_t subgroupBits(const uint64_t* mask, uint32_t lane) {
  constexpr uint64_t kOne = ~uint64_t(0) >> (64 - kSubgroupLanes);
  return mask[lane >> 6] >> (lane & 63) & kOne;
}

const Code* ballot(RunState& s, const Code* c) {
  uint32_t* dst = s.row<uint32_t>(c->dst);
  const uint64_t* a = s.mask(c->src[0]);
  for (uint32_t first = 0; first < s.lanes; first += kSubgroupLanes) {
    const uint32_t bits = uint32_t(subgroupBits(a, first) & subgroupBits(s.exec, first));
    for (uint32_t i = 0; i < kSubgroupLanes; i++) dst[first + i] = bits;
  }
  return c + 1;
}

template <class T>
const Code* shuffle(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  const uint32_t* lane = s.row<uint32_t>(c->src[1]);
  for (uint32_t first = 0; first < s.lanes; first += kSubgroupLanes) {
    T moved[kSubgroupLanes];   // dst may lie where an operand is
    for (uint32_t i = 0; i < kSubgroupLanes; i++) {
      const uint32_t from = lane[first + i] & (kSubgroupLanes - 1);
      moved[i] = first + from < s.lanes ? a[first + from] : T(0);
    }
    std::memcpy(dst + first, moved, sizeof moved);
  }
  return c + 1;
}
//! One lane for all: operand 1 is uniform.
template <class T>
const Code* broadcast(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  const uint32_t lane = s.uniform<uint32_t>(c->src[1]) & (kSubgroupLanes - 1);
  for (uint32_t first = 0; first < s.lanes; first += kSubgroupLanes) {
    const T v = first + lane < s.lanes ? a[first + lane] : T(0);
    for (uint32_t i = 0; i < kSubgroupLanes; i++) dst[first + i] = v;
  }
  return c + 1;
}

//! A half is computed in f32, each step rounded.
struct Half {
  uint16_t bits;
  Half() = default;
  Half(float x) : bits(ir::halfFromDouble(x)) {}
  operator float() const { return float(ir::halfToDouble(bits)); }
};

template <class T, class F>
void tree(T* v, ScanKind kind, uint32_t cluster, T identity, F f) {
  T old[kSubgroupLanes];
  for (uint32_t d = 1; d < cluster; d *= 2) {
    std::memcpy(old, v, sizeof old);
    for (uint32_t i = 0; i < kSubgroupLanes; i++) {
      if (kind == ScanKind::Reduce) v[i] = f(old[i & ~d], old[i | d]);
      else if ((i & (cluster - 1)) >= d) v[i] = f(old[i - d], old[i]);
    }
  }
  if (kind != ScanKind::Exclusive) return;
  for (uint32_t i = kSubgroupLanes; i-- > 0;) v[i] = i & (cluster - 1) ? v[i - 1] : identity;
}

template <class T, class F>
void reduceInts(T* v, ReduceOp op, F run) {
  using S = std::make_signed_t<T>;
  using W = std::conditional_t<sizeof(T) < 4, uint32_t, T>;
  switch (op) {
    case ReduceOp::IAdd: return run(v, [](T a, T b) { return T(a + b); });
    case ReduceOp::IMul: return run(v, [](T a, T b) { return T(W(a) * W(b)); });
    case ReduceOp::SMin: return run(v, [](T a, T b) { return S(a) < S(b) ? a : b; });
    case ReduceOp::SMax: return run(v, [](T a, T b) { return S(a) < S(b) ? b : a; });
    case ReduceOp::UMin: return run(v, [](T a, T b) { return a < b ? a : b; });
    case ReduceOp::UMax: return run(v, [](T a, T b) { return a < b ? b : a; });
    case ReduceOp::And: return run(v, [](T a, T b) { return T(a & b); });
    case ReduceOp::Or: return run(v, [](T a, T b) { return T(a | b); });
    case ReduceOp::Xor: return run(v, [](T a, T b) { return T(a ^ b); });
    default: return;
  }
}
template <class T, class F>
void reduceFloats(T* v, ReduceOp op, F run) {
  using A = std::conditional_t<std::is_same_v<T, Half>, float, T>;
  using U = std::conditional_t<sizeof(A) == 8, uint64_t, uint32_t>;
  // The smaller; of equals (zeros) the union of the signs; of a NaN and a number the number.
  constexpr auto smaller = [](A a, A b) { return b != b ? a : a == b ? std::bit_cast<A>(U(std::bit_cast<U>(a) | std::bit_cast<U>(b))) : a < b ? a : b; };
  constexpr auto larger = [](A a, A b) { return b != b ? a : a == b ? std::bit_cast<A>(U(std::bit_cast<U>(a) & std::bit_cast<U>(b))) : b < a ? a : b; };
  switch (op) {
    case ReduceOp::FAdd: return run(v, [](T a, T b) { return T(A(a) + A(b)); });
    case ReduceOp::FMul: return run(v, [](T a, T b) { return T(A(a) * A(b)); });
    case ReduceOp::FMin: return run(v, [=](T a, T b) { return T(smaller(a, b)); });
    case ReduceOp::FMax: return run(v, [=](T a, T b) { return T(larger(a, b)); });
    default: return;
  }
}

//! imm as in ops.inc
template <class T, Type kType>
const Code* reduce(RunState& s, const Code* c) {
  const ReduceOp op = ReduceOp(c->imm & 0xff);
  const ScanKind kind = ScanKind(c->imm >> 8 & 0xff);
  const uint32_t cluster = 1u << (c->imm >> 16);
  const uint64_t identityBits = ir::reduceIdentity(op, kType);
  T identity;
  std::memcpy(&identity, &identityBits, sizeof(T));
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  for (uint32_t first = 0; first < s.lanes; first += kSubgroupLanes) {
    const uint64_t active = subgroupBits(s.exec, first);
    if (!active) continue;
    T v[kSubgroupLanes];
    for (uint32_t i = 0; i < kSubgroupLanes; i++) v[i] = active >> i & 1 ? a[first + i] : identity;
    const auto run = [&](T* values, auto f) { tree(values, kind, cluster, identity, f); };
    if constexpr (std::is_integral_v<T>) reduceInts(v, op, run);
    else reduceFloats(v, op, run);
    std::memcpy(dst + first, v, sizeof v);
  }
  return c + 1;
}

template <class T>
void addShuffle(KernelTable& t, Type type) {
  t.at(Op::SubgroupShuffle, type, 0) = shuffle<T>;
  t.at(Op::SubgroupShuffle, type, 2) = broadcast<T>;
}

}  // namespace

void addSubgroupKernels(KernelTable& t) {
  t.at(Op::SubgroupAny, Type::Mask) = subgroupAny;
  t.at(Op::SubgroupAll, Type::Mask) = subgroupAll;
  t.at(Op::SubgroupBallot, Type::I32) = ballot;
  addShuffle<uint8_t>(t, Type::I8);
  addShuffle<uint16_t>(t, Type::I16);
  addShuffle<uint32_t>(t, Type::I32);
  addShuffle<uint64_t>(t, Type::I64);
  addShuffle<uint16_t>(t, Type::F16);
  addShuffle<uint32_t>(t, Type::F32);
  addShuffle<uint64_t>(t, Type::F64);
  t.at(Op::SubgroupReduce, Type::I8) = reduce<uint8_t, Type::I8>;
  t.at(Op::SubgroupReduce, Type::I16) = reduce<uint16_t, Type::I16>;
  t.at(Op::SubgroupReduce, Type::I32) = reduce<uint32_t, Type::I32>;
  t.at(Op::SubgroupReduce, Type::I64) = reduce<uint64_t, Type::I64>;
  t.at(Op::SubgroupReduce, Type::F16) = reduce<Half, Type::F16>;
  t.at(Op::SubgroupReduce, Type::F32) = reduce<float, Type::F32>;
  t.at(Op::SubgroupReduce, Type::F64) = reduce<double, Type::F64>;
}

}  // namespace pumice::interp
