// Memory operations: buffers, tables, per-lane local memory, work-group memory, quad records, attachment
// tiles. Lanes go one by one in lane order; a lane out of bounds reads 0 and writes nothing. The common shapes of
// plain loads and stores have faster kernels in kernels_gather.cpp.
#include <bit>
#include <cstring>

#include "spirv_interp/interpreter/memory.h"

namespace pumice::interp {
namespace {

using ir::Op, ir::Type;

//! Operands base, offset and size as rows.
template <class Offset>
struct Buffer {
  const uint64_t* base;
  const Offset* offset;
  const uint64_t* size;
  uint64_t constant;
  Buffer(const RunState& s, const Code* c)
      : base(s.row<uint64_t>(c->src[0])),
        offset(s.row<Offset>(c->src[1])),
        size(s.row<uint64_t>(c->src[2])),
        constant(uint32_t(c->imm)) {}
  //! Where lane i may access `bytes` bytes, or null.
  std::byte* at(uint32_t i, uint64_t bytes) const {
    const uint64_t b = base[i];
    uint64_t where;
    if (!b || !inside(offset[i], constant, bytes, size[i], where)) return nullptr;
    return reinterpret_cast<std::byte*>(b + where);
  }
};
//! Calls f(buffer) for the width of offsets that the instruction has.
template <class F>
inline void withBuffer(const RunState& s, const Code* c, F f) {
  if (c->imm & kImmOffset64) f(Buffer<uint64_t>(s, c));
  else f(Buffer<uint32_t>(s, c));
}

template <class T>
const Code* load(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  withBuffer(s, c, [&](const auto& buffer) {
    eachActive(s, [&](uint32_t i) {
      const std::byte* p = buffer.at(i, sizeof(T));
      dst[i] = p ? read<T>(p) : T(0);
    });
  });
  return c + 1;
}

//! Base, offset and size uniform: one access for the row.
template <class T>
const Code* loadUniform(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  T v = 0;
  const uint64_t base = s.uniform<uint64_t>(c->src[0]);
  const uint64_t offset = c->imm & kImmOffset64 ? s.uniform<uint64_t>(c->src[1]) : s.uniform<uint32_t>(c->src[1]);
  uint64_t where;
  if (base && !s.none() && inside(offset, uint32_t(c->imm), sizeof(T), s.uniform<uint64_t>(c->src[2]), where))
    v = read<T>(reinterpret_cast<const void*>(base + where));
  for (uint32_t i = 0, end = s.rounded; i < end; i++) dst[i] = v;
  return c + 1;
}

template <class T>
const Code* store(RunState& s, const Code* c) {
  const T* value = s.row<T>(c->src[3]);
  withBuffer(s, c, [&](const auto& buffer) {
    eachActive(s, [&](uint32_t i) {
      if (std::byte* p = buffer.at(i, sizeof(T))) write<T>(p, value[i]);
    });
  });
  return c + 1;
}

template <class T, class F>
inline T updateLoop(T* p, F f) {
  T old = __atomic_load_n(p, __ATOMIC_RELAXED);
  while (!__atomic_compare_exchange_n(p, &old, f(old), true, __ATOMIC_SEQ_CST, __ATOMIC_RELAXED)) {}
  return old;
}

template <class T>
inline T addFloats(T a, T b) {
  using F = std::conditional_t<sizeof(T) == 4, float, double>;
  const F sum = std::bit_cast<F>(a) + std::bit_cast<F>(b);
  if (sum != sum) return T(sizeof(T) == 4 ? 0x7fc00000u : 0x7ff8000000000000u);
  return std::bit_cast<T>(sum);
}

template <class T>
inline T atomicUpdate(T* p, ir::AtomicOp op, T v) {
  using S = std::make_signed_t<T>;
  using ir::AtomicOp;
  switch (op) {
    case AtomicOp::Add: return __atomic_fetch_add(p, v, __ATOMIC_SEQ_CST);
    case AtomicOp::SMin: return updateLoop(p, [v](T o) { return S(o) < S(v) ? o : v; });
    case AtomicOp::SMax: return updateLoop(p, [v](T o) { return S(o) < S(v) ? v : o; });
    case AtomicOp::UMin: return updateLoop(p, [v](T o) { return o < v ? o : v; });
    case AtomicOp::UMax: return updateLoop(p, [v](T o) { return o < v ? v : o; });
    case AtomicOp::And: return __atomic_fetch_and(p, v, __ATOMIC_SEQ_CST);
    case AtomicOp::Or: return __atomic_fetch_or(p, v, __ATOMIC_SEQ_CST);
    case AtomicOp::Xor: return __atomic_fetch_xor(p, v, __ATOMIC_SEQ_CST);
    case AtomicOp::Exchange: return __atomic_exchange_n(p, v, __ATOMIC_SEQ_CST);
    case AtomicOp::FAdd: return updateLoop(p, [v](T o) { return addFloats(o, v); });
    case AtomicOp::Load: return __atomic_load_n(p, __ATOMIC_SEQ_CST);
    case AtomicOp::Store: __atomic_store_n(p, v, __ATOMIC_SEQ_CST); return 0;
  }
  return 0;
}
template <class T>
inline T atomicCas(T* p, T v, T comparator) {
  __atomic_compare_exchange_n(p, &comparator, v, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);
  return comparator;
}
inline ir::AtomicOp atomicOpOf(const Code* c) { return ir::AtomicOp(c->imm >> 32 & 0xff); }

template <class T>
const Code* atomic(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* value = s.row<T>(c->src[3]);
  withBuffer(s, c, [&](const auto& buffer) {
    eachActive(s, [&](uint32_t i) {
      std::byte* p = buffer.at(i, sizeof(T));
      dst[i] = p ? atomicUpdate(reinterpret_cast<T*>(p), atomicOpOf(c), value[i]) : T(0);
    });
  });
  return c + 1;
}
template <class T>
const Code* atomicCompareExchange(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* value = s.row<T>(c->src[3]);
  const T* comparator = s.row<T>(c->src[4]);
  withBuffer(s, c, [&](const auto& buffer) {
    eachActive(s, [&](uint32_t i) {
      std::byte* p = buffer.at(i, sizeof(T));
      dst[i] = p ? atomicCas(reinterpret_cast<T*>(p), value[i], comparator[i]) : T(0);
    });
  });
  return c + 1;
}

template <class T>
inline T readTable(const RunState& s, const Code* c, uint32_t offset) {
  const Table& table = s.tables[c->imm >> 32];
  uint64_t where;
  return inside(offset, uint32_t(c->imm), sizeof(T), table.size, where) ? read<T>(table.data + where) : T(0);
}
template <class T>
const Code* tableLoadUniform(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T v = readTable<T>(s, c, s.uniform<uint32_t>(c->src[0]));
  for (uint32_t i = 0, end = s.rounded; i < end; i++) dst[i] = v;
  return c + 1;
}
//! imm = offset in the draw constants; no operand.
template <class T>
const Code* uniformInput(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const Table& table = s.tables[ir::kTableDraw];
  uint64_t where;
  const T v = inside(0, uint32_t(c->imm), sizeof(T), table.size, where) ? read<T>(table.data + where) : T(0);
  for (uint32_t i = 0, end = s.rounded; i < end; i++) dst[i] = v;
  return c + 1;
}

//! src[3] = area's start in local memory, imm = its size in bytes a lane
const Code* localAlloc(RunState& s, const Code* c) {
  std::memset(s.local + c->src[3], 0, (c->imm + 3) / 4 * 4 * kMaxLanes);
  return c + 1;
}
template <class T>
const Code* localLoad(RunState& s, const Code* c) {
  localLoadLanes<T>(s, c);
  return c + 1;
}
template <class T>
const Code* localStore(RunState& s, const Code* c) {
  localStoreLanes<T>(s, c);
  return c + 1;
}

//! Where lane i may access work-group memory, or null.
template <class T>
inline T* sharedAt(const RunState& s, const Code* c, uint32_t i) {
  uint64_t at;
  const uint32_t* offset = s.row<uint32_t>(c->src[0]);
  return inside(offset[i], uint32_t(c->imm), sizeof(T), s.context->sharedBytes, at) ? reinterpret_cast<T*>(s.context->shared + at) : nullptr;
}
template <class T>
const Code* sharedAtomic(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* value = s.row<T>(c->src[1]);
  eachActive(s, [&](uint32_t i) {
    T* p = sharedAt<T>(s, c, i);
    dst[i] = p ? atomicUpdate(p, atomicOpOf(c), value[i]) : T(0);
  });
  return c + 1;
}
template <class T>
const Code* sharedCas(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* value = s.row<T>(c->src[1]);
  const T* comparator = s.row<T>(c->src[2]);
  eachActive(s, [&](uint32_t i) {
    T* p = sharedAt<T>(s, c, i);
    dst[i] = p ? atomicCas(p, value[i], comparator[i]) : T(0);
  });
  return c + 1;
}

inline unsigned quadBits(const RunState& s, uint32_t quad) { return s.exec[quad >> 4] >> ((quad & 15) * 4) & 15; }

template <class T>
const Code* quadLoad(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const std::byte* const* records = s.context->quadRecords;
  for (uint32_t q = 0, lanes = s.lanes; q * 4 < lanes; q++) {
    const T v = read<T>(records[q] + uint32_t(c->imm));   // above: ir::kOneRecord
    for (unsigned i = 0; i < 4; i++) dst[q * 4 + i] = v;
  }
  return c + 1;
}

template <class T>
const Code* tileLoad(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const TilePlane& plane = s.context->tilePlanes[c->imm >> 32];
  const uint64_t element = c->imm >> 16 & 0xffff, byteOffset = c->imm & 0xffff;
  for (uint32_t q = 0, lanes = s.lanes; q * 4 < lanes; q++) {
    if (!quadBits(s, q)) continue;
    const std::byte* p = plane.base + plane.quadElement[q] * element + byteOffset;
    if (element == sizeof(T)) std::memcpy(dst + q * 4, p, 4 * sizeof(T));
    else
      for (unsigned i = 0; i < 4; i++) dst[q * 4 + i] = read<T>(p + i * element);
  }
  return c + 1;
}
template <class T>
const Code* tileStore(RunState& s, const Code* c) {
  const T* value = s.row<T>(c->src[0]);
  const TilePlane& plane = s.context->tilePlanes[c->imm >> 32];
  const uint64_t element = c->imm >> 16 & 0xffff, byteOffset = c->imm & 0xffff;
  for (uint32_t q = 0, lanes = s.lanes; q * 4 < lanes; q++) {
    const unsigned bits = quadBits(s, q);
    if (!bits) continue;
    std::byte* p = plane.base + plane.quadElement[q] * element + byteOffset;
    if (bits == 15 && element == sizeof(T)) std::memcpy(p, value + q * 4, 4 * sizeof(T));
    else
      for (unsigned i = 0; i < 4; i++)
        if (bits >> i & 1) write<T>(p + i * element, value[q * 4 + i]);
  }
  return c + 1;
}

template <class T>
const Code* toBank(RunState& s, const Code* c) {
  s.bankOut[c->imm] = *s.row<T>(c->src[0]);
  return c + 1;
}

template <class T>
void addWidth(KernelTable& t, Type type) {
  for (Op op : {Op::Load, Op::LoadConst}) {
    t.at(op, type, 0) = load<T>;
    t.at(op, type, 7) = loadUniform<T>;
  }
  t.at(Op::Store, type, 0) = store<T>;
  t.at(Op::TableLoad, type, 1) = tableLoadUniform<T>;
  t.at(Op::UniformInput, type) = uniformInput<T>;
  t.at(Op::LocalLoad, type) = localLoad<T>;
  t.at(Op::LocalStore, type) = localStore<T>;
  t.at(Op::QuadLoad, type) = quadLoad<T>;
  t.at(Op::TileLoad, type) = tileLoad<T>;
  t.at(Op::TileStore, type) = tileStore<T>;
  t.at(Internal::ToBank, type) = toBank<T>;
}
template <class T>
void addAtomics(KernelTable& t, Type type) {
  t.at(Op::Atomic, type) = atomic<T>;
  t.at(Op::AtomicCas, type) = atomicCompareExchange<T>;
  t.at(Op::SharedAtomic, type) = sharedAtomic<T>;
  t.at(Op::SharedAtomicCas, type) = sharedCas<T>;
}

}  // namespace

void addMemoryKernels(KernelTable& t) {
  addWidth<uint8_t>(t, Type::I8);
  addWidth<uint16_t>(t, Type::I16);
  addWidth<uint32_t>(t, Type::I32);
  addWidth<uint64_t>(t, Type::I64);
  addWidth<uint16_t>(t, Type::F16);
  addWidth<uint32_t>(t, Type::F32);
  addWidth<uint64_t>(t, Type::F64);
  addAtomics<uint32_t>(t, Type::I32);
  addAtomics<uint64_t>(t, Type::I64);
  addAtomics<uint32_t>(t, Type::F32);
  addAtomics<uint64_t>(t, Type::F64);
  t.at(Op::LocalAlloc, Type::I32) = localAlloc;
}

}  // namespace pumice::interp
