// Loads and stores of one range of memory, by the shape that the lanes' offsets turn out to have: neighbours are a
// copy, one place is a splat, and what lies inside as a whole needs no check per lane. The rest goes lane by lane.
#include "spirv_interp/interpreter/memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "spirv_interp/interpreter/kernels_gather.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace pumice::interp::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;
using DU = hn::CappedTag<uint32_t, 16>;

enum class Shape : uint8_t {
  Mixed,    //!< some lane may be out of bounds
  Same,     //!< all active lanes at `low`
  Linear,   //!< lane i at low + i * size of an element; all lanes active
  Inside,   //!< all active lanes between low and high
};
struct Offsets {
  Shape shape;
  uint32_t low, high;
};

//! eachActive for loops that are made for this instruction set.
template <class F>
HWY_INLINE void eachLane(const RunState& s, F f) {
  if (s.full()) {
    for (uint32_t i = 0, end = s.lanes; i < end; i++) f(i);
    return;
  }
  for (unsigned w = 0; w < kMaskWords; w++)
    for (uint64_t bits = s.exec[w]; bits; bits &= bits - 1) f(w * 64 + unsigned(__builtin_ctzll(bits)));
}

HWY_INLINE bool whole(const RunState& s) { return s.full() && s.lanes == s.rounded; }

//! The offsets of vector i, those of inactive lanes replaced.
template <bool kWhole>
HWY_INLINE hn::Vec<DU> offsetsAt(const RunState& s, const uint32_t* offset, size_t i, hn::Vec<DU> other) {
  const DU d;
  const auto v = hn::Load(d, offset + i);
  if constexpr (kWhole) return v;
  uint64_t bits = s.exec[i >> 6] >> (i & 63);
  if constexpr (hn::MaxLanes(d) < 8) bits &= (uint64_t(1) << hn::Lanes(d)) - 1;
  return hn::IfThenElse(hn::LoadMaskBits(d, reinterpret_cast<const uint8_t*>(&bits)), v, other);
}

HWY_INLINE uint32_t firstActive(const RunState& s) {
  for (unsigned w = 0; w < kMaskWords; w++)
    if (s.exec[w]) return w * 64 + unsigned(__builtin_ctzll(s.exec[w]));
  return 0;
}

template <bool kWhole>
HWY_INLINE Offsets range(const RunState& s, const uint32_t* offset) {
  const DU d;
  const auto first = hn::Set(d, offset[firstActive(s)]);
  auto low = first, high = first;
  for (size_t i = 0, end = s.rounded; i < end; i += hn::Lanes(d)) {
    const auto v = offsetsAt<kWhole>(s, offset, i, first);
    low = hn::Min(low, v);
    high = hn::Max(high, v);
  }
  return {Shape::Inside, hn::GetLane(hn::MinOfLanes(d, low)), hn::GetLane(hn::MaxOfLanes(d, high))};
}

HWY_INLINE bool linear(const RunState& s, const uint32_t* offset, uint32_t step) {
  const DU d;
  if (offset[1] - offset[0] != step) return false;
  auto want = hn::Add(hn::Set(d, offset[0]), hn::Mul(hn::Iota(d, 0), hn::Set(d, step)));
  const auto stride = hn::Set(d, uint32_t(step * hn::Lanes(d)));
  auto different = hn::Zero(d);
  for (size_t i = 0, end = s.rounded; i < end; i += hn::Lanes(d)) {
    different = hn::Or(different, hn::Xor(hn::Load(d, offset + i), want));
    want = hn::Add(want, stride);
  }
  return hn::AllTrue(d, hn::Eq(different, hn::Zero(d)));
}

//! Of accesses of `bytes` bytes at offset + constant in a range of `size` bytes.
HWY_INLINE Offsets shapeOf(const RunState& s, const uint32_t* offset, uint64_t constant, uint32_t bytes, uint64_t size) {
  if (size < constant + bytes) return {Shape::Mixed, 0, 0};
  const uint64_t last = size - constant - bytes;   // the highest offset possible
  const bool all = whole(s);
  if (all && linear(s, offset, bytes)) {
    const uint64_t high = offset[0] + uint64_t(s.lanes - 1) * bytes;
    if (high <= last && high <= ~uint32_t(0)) return {Shape::Linear, offset[0], uint32_t(high)};
  }
  Offsets o = all ? range<true>(s, offset) : range<false>(s, offset);
  o.shape = o.high > last ? Shape::Mixed : o.low == o.high ? Shape::Same : Shape::Inside;
  return o;
}

template <class T>
HWY_INLINE void splatTo(const RunState& s, T* dst, T v) {
  for (size_t i = 0, n = s.rounded & ~size_t(15); i < n; i++) dst[i] = v;
}

template <class T>
HWY_INLINE void loadRange(const RunState& s, T* dst, const uint32_t* offset, uint64_t constant, const std::byte* base, uint64_t size) {
  if (!base) size = 0;
  const Offsets o = shapeOf(s, offset, constant, sizeof(T), size);
  const std::byte* start = o.shape == Shape::Mixed ? nullptr : base + constant;
  switch (o.shape) {
    case Shape::Mixed: return loadLanes<T>(s, dst, offset, constant, base, size);
    case Shape::Same: return splatTo(s, dst, read<T>(start + o.low));
    case Shape::Linear: std::memcpy(dst, start + o.low, s.lanes * sizeof(T)); return;
    case Shape::Inside: break;
  }
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  if constexpr (sizeof(T) == 4) {
    if (o.high < 0x80000000u) {
      const DU d;
      const hn::RebindToSigned<DU> di;
      const auto low = hn::Set(d, o.low);
      const bool all = whole(s);
      for (size_t i = 0, end = s.rounded; i < end; i += hn::Lanes(d)) {
        const auto at = all ? hn::Load(d, offset + i) : offsetsAt<false>(s, offset, i, low);
        hn::Store(hn::GatherOffset(d, reinterpret_cast<const uint32_t*>(start), hn::BitCast(di, at)), d, reinterpret_cast<uint32_t*>(dst) + i);
      }
      return;
    }
  }
#endif
  eachLane(s, [&](uint32_t i) HWY_ATTR { dst[i] = read<T>(start + offset[i]); });
}

template <class T>
HWY_INLINE void storeRange(const RunState& s, const T* value, const uint32_t* offset, uint64_t constant, std::byte* base, uint64_t size) {
  if (!base) size = 0;
  const Offsets o = shapeOf(s, offset, constant, sizeof(T), size);
  std::byte* start = o.shape == Shape::Mixed ? nullptr : base + constant;
  switch (o.shape) {
    case Shape::Mixed: return storeLanes<T>(s, value, offset, constant, base, size);
    case Shape::Linear: std::memcpy(start + o.low, value, s.lanes * sizeof(T)); return;
    default: return eachLane(s, [&](uint32_t i) HWY_ATTR { write<T>(start + offset[i], value[i]); });
  }
}

//! Base and size uniform.
template <class T>
const Code* load(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const auto* base = reinterpret_cast<const std::byte*>(s.uniform<uint64_t>(c->src[0]));
  const uint64_t size = s.uniform<uint64_t>(c->src[2]), constant = uint32_t(c->imm);
  if (c->imm & kImmOffset64) loadLanes<T>(s, dst, s.row<uint64_t>(c->src[1]), constant, base, size);
  else loadRange<T>(s, dst, s.row<uint32_t>(c->src[1]), constant, base, size);
  return c + 1;
}
template <class T>
const Code* store(RunState& s, const Code* c) {
  const T* value = s.row<T>(c->src[3]);
  auto* base = reinterpret_cast<std::byte*>(s.uniform<uint64_t>(c->src[0]));
  const uint64_t size = s.uniform<uint64_t>(c->src[2]), constant = uint32_t(c->imm);
  if (c->imm & kImmOffset64) storeLanes<T>(s, value, s.row<uint64_t>(c->src[1]), constant, base, size);
  else storeRange<T>(s, value, s.row<uint32_t>(c->src[1]), constant, base, size);
  return c + 1;
}
template <class T>
const Code* tableLoad(RunState& s, const Code* c) {
  const Table& table = s.tables[c->imm >> 32];
  loadRange<T>(s, s.row<T>(c->dst), s.row<uint32_t>(c->src[0]), uint32_t(c->imm), table.data, table.size);
  return c + 1;
}
template <class T>
const Code* sharedLoad(RunState& s, const Code* c) {
  loadRange<T>(s, s.row<T>(c->dst), s.row<uint32_t>(c->src[0]), uint32_t(c->imm), s.context->shared, s.context->sharedBytes);
  return c + 1;
}
template <class T>
const Code* sharedStore(RunState& s, const Code* c) {
  storeRange<T>(s, s.row<T>(c->src[1]), s.row<uint32_t>(c->src[0]), uint32_t(c->imm), s.context->shared, s.context->sharedBytes);
  return c + 1;
}

//! Local memory of words: lanes with one offset are neighbours. Null: they have several, or it is no word inside the area.
HWY_INLINE std::byte* localRow(const RunState& s, const Code* c) {
  const uint32_t* offset = s.row<uint32_t>(c->src[0]);
  const Offsets o = whole(s) ? range<true>(s, offset) : range<false>(s, offset);
  uint64_t at;
  if (o.low != o.high || !inside(o.low, uint32_t(c->imm), 4, c->src[4], at) || at % 4) return nullptr;
  return s.local + c->src[3] + at * kMaxLanes;
}
const Code* localLoad(RunState& s, const Code* c) {
  uint32_t* dst = s.row<uint32_t>(c->dst);
  if (const std::byte* row = localRow(s, c)) std::memcpy(dst, row, s.rounded * 4);
  else localLoadLanes<uint32_t>(s, c);
  return c + 1;
}
const Code* localStore(RunState& s, const Code* c) {
  const uint32_t* value = s.row<uint32_t>(c->src[1]);
  if (std::byte* row = localRow(s, c)) {
    if (s.full()) std::memcpy(row, value, s.lanes * 4);
    else eachLane(s, [&](uint32_t i) HWY_ATTR { write<uint32_t>(row + i * 4, value[i]); });
  } else {
    localStoreLanes<uint32_t>(s, c);
  }
  return c + 1;
}

template <class T>
void addWidth(KernelTable& t, ir::Type type) {
  using ir::Op;
  t.at(Op::Load, type, 5) = t.at(Op::LoadConst, type, 5) = load<T>;
  t.at(Op::Store, type, 5) = store<T>;
  t.at(Op::TableLoad, type, 0) = tableLoad<T>;
  t.at(Op::SharedLoad, type) = sharedLoad<T>;
  t.at(Op::SharedStore, type) = sharedStore<T>;
}

}  // namespace

void gatherKernels(KernelTable& t) {
  using ir::Op, ir::Type;
  addWidth<uint8_t>(t, Type::I8);
  addWidth<uint16_t>(t, Type::I16);
  addWidth<uint32_t>(t, Type::I32);
  addWidth<uint64_t>(t, Type::I64);
  addWidth<uint16_t>(t, Type::F16);
  addWidth<uint32_t>(t, Type::F32);
  addWidth<uint64_t>(t, Type::F64);
  for (Type type : {Type::I32, Type::F32}) {
    t.at(Op::LocalLoad, type) = localLoad;
    t.at(Op::LocalStore, type) = localStore;
  }
}
}  // namespace pumice::interp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "spirv_interp/interpreter/targets-inl.h"
namespace pumice::interp {
void addGatherKernels(int64_t targetBit, KernelTable& table) { PUMICE_CALL_TARGET(targetBit, gatherKernels, table) }
}
#endif
