// What moves elements without looking at them (select, splat, masked sets, quad operations), by element
// width, and the derivatives. Masks are bits: their operations touch two words.
#include <cstring>

#include "spirv_interp/interpreter/bytecode.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "spirv_interp/interpreter/kernels_move.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace pumice::interp::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

//! dst[i] = bit i of mask ? a[i] : b[i]
template <class T, bool kUA, bool kUB>
HWY_INLINE void blend(uint32_t rounded, const uint64_t* mask, T* dst, const T* a, const T* b) {
  if constexpr (sizeof(T) >= 4) {
    const hn::CappedTag<T, 16> d;
    const size_t n = hn::Lanes(d);
    const auto ua = hn::Set(d, *a), ub = hn::Set(d, *b);
    for (size_t i = 0; i < rounded; i += n) {
      uint64_t bits = mask[i >> 6] >> (i & 63);
      if constexpr (hn::MaxLanes(d) < 8) bits &= (uint64_t(1) << n) - 1;
      const auto m = hn::LoadMaskBits(d, reinterpret_cast<const uint8_t*>(&bits));
      hn::Store(hn::IfThenElse(m, kUA ? ua : hn::Load(d, a + i), kUB ? ub : hn::Load(d, b + i)), d, dst + i);
    }
  } else {
    for (size_t i = 0; i < rounded; i++) {
      const T keep = T(0) - T(mask[i >> 6] >> (i & 63) & 1);
      dst[i] = T((a[kUA ? 0 : i] & keep) | (b[kUB ? 0 : i] & T(~keep)));
    }
  }
}

template <class T, bool kUA, bool kUB>
const Code* select(RunState& s, const Code* c) {
  const T* a = kUA ? &s.uniform<T>(c->src[1]) : s.row<T>(c->src[1]);
  const T* b = kUB ? &s.uniform<T>(c->src[2]) : s.row<T>(c->src[2]);
  blend<T, kUA, kUB>(s.rounded, s.mask(c->src[0]), s.row<T>(c->dst), a, b);
  return c + 1;
}

template <class T>
const Code* splat(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T v = s.uniform<T>(c->src[0]);
  const size_t n = s.rounded & ~size_t(15);
  for (size_t i = 0; i < n; i++) dst[i] = v;
  return c + 1;
}

template <class T>
const Code* copy(RunState& s, const Code* c) {
  std::memcpy(s.row<T>(c->dst), s.row<T>(c->src[0]), s.rounded * sizeof(T));
  return c + 1;
}

template <class T>
const Code* zero(RunState& s, const Code* c) {
  std::memset(s.row<T>(c->dst), 0, s.rounded * sizeof(T));
  return c + 1;
}

template <class T>
const Code* setMasked(RunState& s, const Code* c) {
  if (s.full()) return copy<T>(s, c);
  T* dst = s.row<T>(c->dst);
  blend<T, false, false>(s.rounded, s.exec, dst, s.row<T>(c->src[0]), dst);
  return c + 1;
}
template <class T>
const Code* setMaskedUniform(RunState& s, const Code* c) {
  if (s.full()) return splat<T>(s, c);
  T* dst = s.row<T>(c->dst);
  blend<T, true, false>(s.rounded, s.exec, dst, &s.uniform<T>(c->src[0]), dst);
  return c + 1;
}

// The caller's rows are as long as vectors may reach (executor.h).
template <class T>
const Code* input(RunState& s, const Code* c) {
  std::memcpy(s.row<T>(c->dst), s.context->inputs[c->imm], s.lanes * sizeof(T));
  return c + 1;
}
template <class T>
const Code* output(RunState& s, const Code* c) {
  T* dst = static_cast<T*>(s.context->outputs[c->imm]);
  const T* a = s.row<T>(c->src[0]);
  if (s.full()) {
    std::memcpy(dst, a, s.lanes * sizeof(T));
    return c + 1;
  }
  for (unsigned w = 0; w < kMaskWords; w++)
    for (uint64_t bits = s.exec[w]; bits; bits &= bits - 1) {
      const unsigned i = w * 64 + unsigned(__builtin_ctzll(bits));
      dst[i] = a[i];
    }
  return c + 1;
}

template <class T>
const Code* quadSwizzle(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  const unsigned l0 = c->imm & 3, l1 = c->imm >> 2 & 3, l2 = c->imm >> 4 & 3, l3 = c->imm >> 6 & 3;
  for (size_t i = 0, end = s.rounded; i < end; i += 4) {
    const T v0 = a[i + l0], v1 = a[i + l1], v2 = a[i + l2], v3 = a[i + l3];
    dst[i] = v0;
    dst[i + 1] = v1;
    dst[i + 2] = v2;
    dst[i + 3] = v3;
  }
  return c + 1;
}

//! Step: 1 along x, 2 along y. Coarse: the quad's first row (column) serves all four.
template <class T, unsigned kStep>
const Code* derivative(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  const bool fine = c->imm != 0;
  constexpr unsigned kOther = 3 - kStep;
  for (size_t i = 0, end = s.rounded; i < end; i += 4) {
    const T first = a[i + kStep] - a[i];
    const T second = fine ? a[i + 3] - a[i + kOther] : first;
    dst[i] = dst[i + kStep] = first;
    dst[i + kOther] = dst[i + 3] = second;
  }
  return c + 1;
}

const Code* laneId(RunState& s, const Code* c) {
  uint32_t* dst = s.row<uint32_t>(c->dst);
  const size_t n = s.rounded & ~size_t(15);
  for (size_t i = 0; i < n; i++) dst[i] = uint32_t(i);
  return c + 1;
}

template <class T>
void addWidth(KernelTable& t, ir::Type type) {
  using ir::Op;
  // operand 0 is the mask, always a row
  t.at(Op::Select, type, 0) = select<T, false, false>;
  t.at(Op::Select, type, 2) = select<T, true, false>;
  t.at(Op::Select, type, 4) = select<T, false, true>;
  t.at(Op::Select, type, 6) = select<T, true, true>;
  t.at(Internal::Splat, type) = splat<T>;
  t.at(Internal::Copy, type) = copy<T>;
  t.at(Internal::Zero, type) = zero<T>;
  t.at(Internal::SetMasked, type, 0) = setMasked<T>;
  t.at(Internal::SetMasked, type, 1) = setMaskedUniform<T>;
  t.at(Internal::OutputRow, type) = output<T>;
  t.at(Op::Input, type) = input<T>;
  t.at(Op::QuadSwizzle, type) = quadSwizzle<T>;
}

}  // namespace

void moveKernels(KernelTable& t) {
  using ir::Op, ir::Type;
  addWidth<uint8_t>(t, Type::I8);
  addWidth<uint16_t>(t, Type::I16);
  addWidth<uint32_t>(t, Type::I32);
  addWidth<uint64_t>(t, Type::I64);
  addWidth<uint16_t>(t, Type::F16);
  addWidth<uint32_t>(t, Type::F32);
  addWidth<uint64_t>(t, Type::F64);
  t.at(Op::QuadDdx, Type::F32) = derivative<float, 1>;
  t.at(Op::QuadDdy, Type::F32) = derivative<float, 2>;
  t.at(Op::QuadDdx, Type::F64) = derivative<double, 1>;
  t.at(Op::QuadDdy, Type::F64) = derivative<double, 2>;
  t.at(Op::LaneId, Type::I32) = laneId;
}
}  // namespace pumice::interp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "spirv_interp/interpreter/targets-inl.h"
namespace pumice::interp {
void addMoveKernels(int64_t targetBit, KernelTable& table) { PUMICE_CALL_TARGET(targetBit, moveKernels, table) }
}
#endif
