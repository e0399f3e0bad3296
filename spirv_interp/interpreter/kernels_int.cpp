// Integer arithmetic and comparisons. Each operation is its formula, once, over an unsigned element type;
// the compiler makes vectors of the loops for each instruction set (integers have one meaning only, so nothing
// can differ). Comparisons of 32 and 64 bits are written over Highway tags: they end in mask bits.
#include <bit>
#include <limits>
#include <type_traits>

#include "spirv_interp/interpreter/bytecode.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "spirv_interp/interpreter/kernels_int.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace pumice::interp::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

template <class T>
using Signed = std::make_signed_t<T>;
// Small types are promoted to int, whose products may overflow: compute in at least 32 unsigned bits.
template <class T>
using Wide = std::conditional_t<sizeof(T) < 4, uint32_t, T>;

template <class T>
HWY_INLINE T reverseBits(T x) {
  uint64_t v = x;
  v = (v >> 1 & 0x5555555555555555u) | (v & 0x5555555555555555u) << 1;
  v = (v >> 2 & 0x3333333333333333u) | (v & 0x3333333333333333u) << 2;
  v = (v >> 4 & 0x0f0f0f0f0f0f0f0fu) | (v & 0x0f0f0f0f0f0f0f0fu) << 4;
  return T(__builtin_bswap64(v) >> (64 - 8 * sizeof(T)));
}
template <class T>
HWY_INLINE T findMsb(T x) {
  return x ? T(63 - __builtin_clzll(x)) : T(-1);
}
template <class T>
HWY_INLINE T findLsb(T x) {
  return x ? T(__builtin_ctzll(x)) : T(-1);
}
template <class T>
HWY_INLINE T sdiv(T a, T b) {
  if (b == 0) return T(-1);
  if (b == T(-1)) return T(0 - Wide<T>(a));
  return T(Signed<T>(a) / Signed<T>(b));
}
template <class T>
HWY_INLINE T srem(T a, T b) {
  if (b == 0) return a;
  if (b == T(-1)) return 0;
  return T(Signed<T>(a) % Signed<T>(b));
}
#if HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
// Vectors have no integer division, but of 32 bits a double knows the quotient: correctly rounded it never reaches the next
// integer, which is at least 1/b away, more than an ulp of any a/b. (2^52 puts an integer into the low bits of a double and back,
// rounded to nearest, hence the correction. No branches and no calls, so that the loops become vectors.)
HWY_INLINE double ofWord(uint32_t x) { return std::bit_cast<double>(uint64_t(x) | 0x4330000000000000u) - 0x1p52; }
HWY_INLINE uint32_t quotient(uint32_t a, uint32_t b) {
  const double x = ofWord(a) / ofWord(b), near = x + 0x1p52;
  return uint32_t(std::bit_cast<uint64_t>(near) - (near - 0x1p52 > x ? 1u : 0u));
}
HWY_INLINE uint32_t onesIfZero(uint32_t b) { return 0u - uint32_t(b == 0); }   // quotient(a, 0) is 0
HWY_INLINE uint32_t sdiv(uint32_t a, uint32_t b) {
  const uint32_t sa = uint32_t(int32_t(a) >> 31), sb = uint32_t(int32_t(b) >> 31), s = sa ^ sb;
  return ((quotient((a ^ sa) - sa, (b ^ sb) - sb) ^ s) - s) | onesIfZero(b);
}
HWY_INLINE uint32_t srem(uint32_t a, uint32_t b) { return a - sdiv(a, b) * b; }
HWY_INLINE uint32_t udiv(uint32_t a, uint32_t b) { return quotient(a, b) | onesIfZero(b); }
HWY_INLINE uint32_t urem(uint32_t a, uint32_t b) { return a - quotient(a, b) * b; }
#endif
template <class T>
HWY_INLINE T udiv(T a, T b) {
  return b ? T(a / b) : T(-1);
}
template <class T>
HWY_INLINE T urem(T a, T b) {
  return b ? T(a % b) : a;
}
#define FORMULA1(Name, expr)      \
  struct Name {                   \
    template <class T>            \
    static HWY_INLINE T of(T a) { return T(expr); } \
  };
#define FORMULA2(Name, expr)      \
  struct Name {                   \
    template <class T>            \
    static HWY_INLINE T of(T a, T b) { return T(expr); } \
  };
#define BITS T(8 * sizeof(T) - 1)
FORMULA2(IAdd, a + b)
FORMULA2(ISub, a - b)
FORMULA2(IMul, Wide<T>(a) * Wide<T>(b))
FORMULA2(SMulHi, int64_t(Signed<T>(a)) * int64_t(Signed<T>(b)) >> 32)
FORMULA2(UMulHi, uint64_t(a) * b >> 32)
FORMULA2(SDiv, sdiv(a, b))
FORMULA2(UDiv, udiv(a, b))
FORMULA2(SRem, srem(a, b))
FORMULA2(URem, urem(a, b))
FORMULA2(And, a & b)
FORMULA2(Or, a | b)
FORMULA2(Xor, a ^ b)
FORMULA1(Not, ~a)
FORMULA2(Shl, Wide<T>(a) << (b & BITS))
FORMULA2(LShr, a >> (b & BITS))
FORMULA2(AShr, Signed<T>(a) >> (b & BITS))
FORMULA2(SMin, Signed<T>(a) < Signed<T>(b) ? a : b)
FORMULA2(SMax, Signed<T>(a) < Signed<T>(b) ? b : a)
FORMULA2(UMin, a < b ? a : b)
FORMULA2(UMax, a < b ? b : a)
FORMULA1(PopCount, __builtin_popcountll(a))
FORMULA1(BitReverse, reverseBits(a))
FORMULA1(FindMsb, findMsb(a))
FORMULA1(FindLsb, findLsb(a))

template <class F, class T>
const Code* unary(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const T* a = s.row<T>(c->src[0]);
  const size_t n = s.rounded & ~size_t(15);
#pragma GCC ivdep
  for (size_t i = 0; i < n; i++) dst[i] = F::of(a[i]);
  return c + 1;
}

template <class F, class T, bool kUA, bool kUB>
const Code* binary(RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const size_t n = s.rounded & ~size_t(15);
  if constexpr (kUA) {
    const T a = s.uniform<T>(c->src[0]);
    const T* b = s.row<T>(c->src[1]);
#pragma GCC ivdep
    for (size_t i = 0; i < n; i++) dst[i] = F::of(a, b[i]);
  } else if constexpr (kUB) {
    const T* a = s.row<T>(c->src[0]);
    const T b = s.uniform<T>(c->src[1]);
#pragma GCC ivdep
    for (size_t i = 0; i < n; i++) dst[i] = F::of(a[i], b);
  } else {
    const T* a = s.row<T>(c->src[0]);
    const T* b = s.row<T>(c->src[1]);
#pragma GCC ivdep
    for (size_t i = 0; i < n; i++) dst[i] = F::of(a[i], b[i]);
  }
  return c + 1;
}

// Comparisons: T carries the signedness. SCALAR has no vectors to speak of.
#define COMPARE(Name, vector, scalar)                          \
  struct Name {                                                \
    template <class V>                                         \
    static HWY_INLINE auto vec(V a, V b) { return vector; }    \
    template <class T>                                         \
    static HWY_INLINE bool one(T a, T b) { return scalar; }    \
  };
COMPARE(Equal, hn::Eq(a, b), a == b)
COMPARE(NotEqual, hn::Ne(a, b), a != b)
COMPARE(Less, hn::Lt(a, b), a < b)
COMPARE(LessEqual, hn::Not(hn::Lt(b, a)), a <= b)

template <class F, class T, bool kUA, bool kUB>
const Code* compare(RunState& s, const Code* c) {
  uint64_t* dst = s.mask(c->dst);
  const T* a = kUA ? &s.uniform<T>(c->src[0]) : s.row<T>(c->src[0]);
  const T* b = kUB ? &s.uniform<T>(c->src[1]) : s.row<T>(c->src[1]);
  uint64_t out[kMaskWords] = {};
  if constexpr (sizeof(T) >= 4) {
    const hn::CappedTag<T, 16> d;
    const size_t n = hn::Lanes(d);
    const auto ua = hn::Set(d, *a), ub = hn::Set(d, *b);
    for (size_t w = 0, rounded = s.rounded; w * 64 < rounded; w++) {
      const size_t end = rounded - w * 64 < 64 ? rounded - w * 64 : 64;
      uint64_t bits = 0;
      for (size_t i = 0; i < end; i += n) {
        const auto va = kUA ? ua : hn::Load(d, a + w * 64 + i);
        const auto vb = kUB ? ub : hn::Load(d, b + w * 64 + i);
        uint64_t part = 0;
        hn::StoreMaskBits(d, F::vec(va, vb), reinterpret_cast<uint8_t*>(&part));
        bits |= part << i;
      }
      out[w] = bits;
    }
  } else {
    for (size_t i = 0, end = s.rounded; i < end; i++) out[i >> 6] |= uint64_t(F::one(a[kUA ? 0 : i], b[kUB ? 0 : i])) << (i & 63);
  }
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = out[w];
  return c + 1;
}

template <class F, class T>
void addBinary(KernelTable& t, ir::Op op, ir::Type type) {
  t.at(op, type, 0) = binary<F, T, false, false>;
  if constexpr (sizeof(T) >= 4) {
    t.at(op, type, 1) = binary<F, T, true, false>;
    t.at(op, type, 2) = binary<F, T, false, true>;
  }
}
template <class F, class T>
void addCompare(KernelTable& t, ir::Op op, ir::Type type) {
  t.at(op, type, 0) = compare<F, T, false, false>;
  if constexpr (sizeof(T) >= 4) {
    t.at(op, type, 1) = compare<F, T, true, false>;
    t.at(op, type, 2) = compare<F, T, false, true>;
  }
}

template <class T>
void addType(KernelTable& t, ir::Type type) {
  using ir::Op;
#define B(Name) addBinary<Name, T>(t, Op::Name, type);
  B(IAdd) B(ISub) B(IMul) B(SDiv) B(UDiv) B(SRem) B(URem) B(And) B(Or) B(Xor)
  B(Shl) B(LShr) B(AShr) B(SMin) B(SMax) B(UMin) B(UMax)
  if constexpr (sizeof(T) == 4) {
    B(SMulHi) B(UMulHi)
  }
#undef B
#define U(Name) t.at(Op::Name, type) = unary<Name, T>;
  U(Not) U(PopCount) U(BitReverse) U(FindMsb) U(FindLsb)
#undef U
  addCompare<Equal, T>(t, Op::IEq, type);
  addCompare<NotEqual, T>(t, Op::INe, type);
  addCompare<Less, Signed<T>>(t, Op::SLt, type);
  addCompare<LessEqual, Signed<T>>(t, Op::SLe, type);
  addCompare<Less, T>(t, Op::ULt, type);
  addCompare<LessEqual, T>(t, Op::ULe, type);
}

}  // namespace

void intKernels(KernelTable& t) {
  addType<uint8_t>(t, ir::Type::I8);
  addType<uint16_t>(t, ir::Type::I16);
  addType<uint32_t>(t, ir::Type::I32);
  addType<uint64_t>(t, ir::Type::I64);
}
}  // namespace pumice::interp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "spirv_interp/interpreter/targets-inl.h"
namespace pumice::interp {
void addIntKernels(int64_t targetBit, KernelTable& table) { PUMICE_CALL_TARGET(targetBit, intKernels, table) }
}
#endif
