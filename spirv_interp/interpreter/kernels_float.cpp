// Float arithmetic and comparisons. Each operation is its formula, once, over a Highway tag.
#include <bit>
#include <cmath>

#include "spirv_interp/interpreter/bytecode.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "spirv_interp/interpreter/kernels_float.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace pumice::interp::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

//! RunState::rounded is a multiple of it; the compiler unrolls the vectors of a block.
constexpr size_t kBlock = 16;
template <class T>
using Tag = hn::CappedTag<T, kBlock>;

//! Correctly rounded a*b+c without hardware: the product is exact in double, the sum is rounded to odd, and
//! so the last rounding sees which side of a tie it is on.
inline float fmaExact(float a, float b, float c) {
  double p = double(a) * double(b), addend = c;
  double s = p + addend;
  double bb = s - p;
  double error = (p - (s - bb)) + (addend - bb);
  if (error != 0 && std::isfinite(s)) {
    uint64_t bits = std::bit_cast<uint64_t>(s);
    if (!(bits & 1)) s = std::bit_cast<double>((error > 0) == (s > 0) ? bits + 1 : bits - 1);
  }
  return float(s);
}
inline double fmaExact(double a, double b, double c) { return std::fma(a, b, c); }

constexpr uint32_t canonicalNan(float) { return 0x7fc00000u; }
constexpr uint64_t canonicalNan(double) { return 0x7ff8000000000000u; }

#define FORMULA1(Name, expr)                                \
  struct Name {                                             \
    template <class D, class V = hn::Vec<D>>                \
    static HWY_INLINE V of(D d, V a) { (void)d; return expr; } \
  };
#define FORMULA2(Name, expr)                                     \
  struct Name {                                                  \
    template <class D, class V = hn::Vec<D>>                     \
    static HWY_INLINE auto of(D d, V a, V b) { (void)d; return expr; } \
  };

FORMULA2(FAdd, hn::Add(a, b))
FORMULA2(FSub, hn::Sub(a, b))
FORMULA2(FMul, hn::Mul(a, b))
FORMULA2(FDiv, hn::Div(a, b))
// The smaller; of equals (zeros) the union of the signs; of a NaN and a number the number.
FORMULA2(FMin, hn::IfThenElse(hn::Not(hn::Eq(b, b)), a, hn::IfThenElse(hn::Eq(a, b), hn::Or(a, b), hn::IfThenElse(hn::Lt(a, b), a, b))))
FORMULA2(FMax, hn::IfThenElse(hn::Not(hn::Eq(b, b)), a, hn::IfThenElse(hn::Eq(a, b), hn::And(a, b), hn::IfThenElse(hn::Lt(b, a), a, b))))
FORMULA2(FEq, hn::Eq(a, b))
FORMULA2(FNe, hn::Not(hn::Eq(a, b)))
FORMULA2(FLt, hn::Lt(a, b))
FORMULA2(FLe, hn::Le(a, b))
FORMULA1(FNeg, hn::Xor(a, hn::SignBit(d)))
FORMULA1(FAbs, hn::AndNot(hn::SignBit(d), a))
FORMULA1(FSqrt, hn::Sqrt(a))

#if HWY_TARGET == HWY_EMU128 || HWY_TARGET == HWY_SCALAR
// Highway's emulation is not careful with signed zeros; the C library is.
template <class D, class F>
HWY_INLINE hn::Vec<D> lanewise(D d, hn::Vec<D> a, F f) {
  alignas(64) hn::TFromD<D> x[hn::MaxLanes(d)];
  hn::Store(a, d, x);
  for (size_t i = 0; i < hn::Lanes(d); i++) x[i] = f(x[i]);
  return hn::Load(d, x);
}
FORMULA1(FFloor, lanewise(d, a, [](auto x) { return std::floor(x); }))
FORMULA1(FCeil, lanewise(d, a, [](auto x) { return std::ceil(x); }))
FORMULA1(FTrunc, lanewise(d, a, [](auto x) { return std::trunc(x); }))
FORMULA1(FRoundEven, lanewise(d, a, [](auto x) { return std::nearbyint(x); }))
#else
FORMULA1(FFloor, hn::Floor(a))
FORMULA1(FCeil, hn::Ceil(a))
FORMULA1(FTrunc, hn::Trunc(a))
FORMULA1(FRoundEven, hn::Round(a))
#endif
FORMULA1(Canon, hn::IfThenElse(hn::Not(hn::Eq(a, a)), hn::BitCast(d, hn::Set(hn::RebindToUnsigned<D>(), canonicalNan(hn::TFromD<D>()))), a))

template <class F, class T>
const Code* unary(RunState& s, const Code* c) {
  const Tag<T> d;
  constexpr size_t n = hn::MaxLanes(d);
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  for (size_t block = 0, end = s.rounded; block < end; block += kBlock)
    for (size_t i = block; i < block + kBlock; i += n) hn::Store(F::of(d, hn::Load(d, a + i)), d, dst + i);
  return c + 1;
}

//! Row or uniform: one way to load both.
template <class T, bool kUniform>
struct Source {
  static constexpr Tag<T> d{};
  const T* p;
  hn::Vec<Tag<T>> v;
  Source(const RunState& s, uint32_t offset)
      : p(s.row<T>(kUniform ? 0 : offset)), v(hn::Set(Tag<T>(), kUniform ? s.uniform<T>(kUniform ? offset : 0) : T(0))) {}
  HWY_INLINE hn::Vec<Tag<T>> operator[](size_t i) const {
    if constexpr (kUniform) return v;
    else return hn::Load(Tag<T>(), p + i);
  }
};

template <class F, class T, bool kUA, bool kUB>
const Code* binary(RunState& s, const Code* c) {
  const Tag<T> d;
  constexpr size_t n = hn::MaxLanes(d);
  T* dst = s.row<T>(c->dst);
  const Source<T, kUA> a(s, c->src[0]);
  const Source<T, kUB> b(s, c->src[1]);
  for (size_t block = 0, end = s.rounded; block < end; block += kBlock)
    for (size_t i = block; i < block + kBlock; i += n) hn::Store(F::of(d, a[i], b[i]), d, dst + i);
  return c + 1;
}

template <class D>
HWY_INLINE uint64_t bitsOf(D d, hn::Mask<D> m) {
  uint64_t bits = 0;
  hn::StoreMaskBits(d, m, reinterpret_cast<uint8_t*>(&bits));
  return bits;
}

template <class F, class T, bool kUA, bool kUB>
const Code* compare(RunState& s, const Code* c) {
  const Tag<T> d;
  const size_t n = hn::Lanes(d);
  uint64_t* dst = s.mask(c->dst);
  const Source<T, kUA> a(s, c->src[0]);
  const Source<T, kUB> b(s, c->src[1]);
  for (size_t w = 0, rounded = s.rounded; w * 64 < rounded; w++) {
    uint64_t bits = 0;
    const size_t end = rounded - w * 64 < 64 ? rounded - w * 64 : 64;
    for (size_t i = 0; i < end; i += n) bits |= bitsOf(d, F::of(d, a[w * 64 + i], b[w * 64 + i])) << i;
    dst[w] = bits;
  }
  return c + 1;
}

template <class T, bool kUA, bool kUB, bool kUC>
const Code* fma(RunState& s, const Code* c) {
  const Tag<T> d;
  constexpr size_t n = hn::MaxLanes(d);
  T* dst = s.row<T>(c->dst);
#if HWY_NATIVE_FMA
  const Source<T, kUA> x(s, c->src[0]);
  const Source<T, kUB> y(s, c->src[1]);
  const Source<T, kUC> z(s, c->src[2]);
  for (size_t block = 0, end = s.rounded; block < end; block += kBlock)
    for (size_t i = block; i < block + kBlock; i += n) hn::Store(hn::MulAdd(x[i], y[i], z[i]), d, dst + i);
#else
  (void)n;
  const T* x = kUA ? &s.uniform<T>(c->src[0]) : s.row<T>(c->src[0]);
  const T* y = kUB ? &s.uniform<T>(c->src[1]) : s.row<T>(c->src[1]);
  const T* z = kUC ? &s.uniform<T>(c->src[2]) : s.row<T>(c->src[2]);
  for (size_t i = 0, end = s.rounded; i < end; i++) dst[i] = fmaExact(x[kUA ? 0 : i], y[kUB ? 0 : i], z[kUC ? 0 : i]);
#endif
  return c + 1;
}

template <class F, class T>
void addBinary(KernelTable& t, ir::Op op, ir::Type type) {
  t.at(op, type, 0) = binary<F, T, false, false>;
  t.at(op, type, 1) = binary<F, T, true, false>;
  t.at(op, type, 2) = binary<F, T, false, true>;
}
template <class F, class T>
void addCompare(KernelTable& t, ir::Op op, ir::Type type) {
  t.at(op, type, 0) = compare<F, T, false, false>;
  t.at(op, type, 1) = compare<F, T, true, false>;
  t.at(op, type, 2) = compare<F, T, false, true>;
}

template <class T>
void addType(KernelTable& t, ir::Type type) {
  using ir::Op;
#define B(Name) addBinary<Name, T>(t, Op::Name, type);
  B(FAdd) B(FSub) B(FMul) B(FDiv) B(FMin) B(FMax)
#undef B
#define C(Name) addCompare<Name, T>(t, Op::Name, type);
  C(FEq) C(FNe) C(FLt) C(FLe)
#undef C
#define U(Name) t.at(Op::Name, type) = unary<Name, T>;
  U(FNeg) U(FAbs) U(FSqrt) U(FFloor) U(FCeil) U(FTrunc) U(FRoundEven)
#undef U
  t.at(Internal::Canon, type) = unary<Canon, T>;
  t.at(Op::Fma, type, 0) = fma<T, false, false, false>;
  t.at(Op::Fma, type, 2) = fma<T, false, true, false>;   // a uniform first factor is exchanged with the second
  t.at(Op::Fma, type, 4) = fma<T, false, false, true>;
  t.at(Op::Fma, type, 6) = fma<T, false, true, true>;
}

}  // namespace

void floatKernels(KernelTable& t) {
  addType<float>(t, ir::Type::F32);
  addType<double>(t, ir::Type::F64);
}
}  // namespace pumice::interp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "spirv_interp/interpreter/targets-inl.h"
namespace pumice::interp {
void addFloatKernels(int64_t targetBit, KernelTable& table) { PUMICE_CALL_TARGET(targetBit, floatKernels, table) }
}
#endif
