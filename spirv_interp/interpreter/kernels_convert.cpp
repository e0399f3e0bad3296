// Conversions between types. Out-of-range floats saturate, NaN gives 0; integers round to nearest even.
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

#include "spirv_interp/interpreter/bytecode.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "spirv_interp/interpreter/kernels_convert.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace pumice::interp::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

struct Half {
  uint16_t bits;
};

HWY_INLINE float floatOf(Half h) {
  const uint32_t sign = uint32_t(h.bits & 0x8000u) << 16, rest = h.bits & 0x7fffu;
  if (rest >= 0x7c00u) return std::bit_cast<float>(sign | 0x7f800000u | (rest & 0x3ffu) << 13);
  if (rest < 0x400u) return std::bit_cast<float>(sign | std::bit_cast<uint32_t>(float(rest) * 0x1p-24f));
  return std::bit_cast<float>(sign | ((rest << 13) + (112u << 23)));
}

//! One rounding, from double.
HWY_INLINE Half halfOf(double x) {
  const uint64_t all = std::bit_cast<uint64_t>(x), bits = all & 0x7fffffffffffffffu;
  const uint16_t sign = uint16_t(all >> 48 & 0x8000u);
  const double magnitude = std::bit_cast<double>(bits);
  if (bits > 0x7ff0000000000000u) return {uint16_t(sign | 0x7e00u)};
  if (magnitude >= 65520.0) return {uint16_t(sign | 0x7c00u)};
  // Below the normal range the sum's last place is 2^-24, the smallest half.
  if (magnitude < 0x1p-14) return {uint16_t(sign | uint16_t(std::bit_cast<uint64_t>(magnitude + 0x1p28) - std::bit_cast<uint64_t>(0x1p28)))};
  const uint64_t rounded = bits + 0x1ffffffffffu + (bits >> 42 & 1);
  return {uint16_t(sign | uint16_t((rounded >> 42) - (uint64_t(1023 - 15) << 10)))};
}

template <class To, class From>
HWY_INLINE To convertFloat(From x) {
  if constexpr (std::is_same_v<From, Half> && std::is_same_v<To, Half>) return x;
  else if constexpr (std::is_same_v<From, Half>) return To(floatOf(x));
  else if constexpr (std::is_same_v<To, Half>) return halfOf(double(x));
  else return To(x);
}

template <class To, class From>
HWY_INLINE To saturate(From from) {
  using F = std::conditional_t<std::is_same_v<From, Half>, float, From>;
  const F x = convertFloat<F>(from);
  if (x != x) return 0;
  // The limits as powers of two are exact in every float type.
  constexpr int kBits = std::numeric_limits<To>::digits;
  const F over = F(2) * F(uint64_t(1) << (kBits - 1));
  if (x >= over) return std::numeric_limits<To>::max();
  if constexpr (std::is_signed_v<To>) {
    if (x < -over) return std::numeric_limits<To>::min();
  } else {
    if (x <= 0) return 0;
  }
  return To(x);
}

template <class To, class From>
struct Float {
  static HWY_INLINE To of(From x) { return convertFloat<To>(x); }
};
template <class To, class From>
struct ToInt {
  static HWY_INLINE To of(From x) { return saturate<To>(x); }
};
template <class To, class From>
struct FromInt {
  static HWY_INLINE To of(From x) {
    // Integers too big for an exact double overflow a half anyway.
    if constexpr (std::is_same_v<To, Half>) return halfOf(double(x));
    else return To(x);
  }
};
template <class To, class From>
struct Int {
  static HWY_INLINE To of(From x) { return To(x); }
};

template <template <class, class> class F, class To, class From>
const Code* convert(RunState& s, const Code* c) {
  To* dst = s.row<To>(c->dst);
  const From* a = s.row<From>(c->src[0]);
  const size_t n = s.rounded & ~size_t(15);
#pragma GCC ivdep
  for (size_t i = 0; i < n; i++) dst[i] = F<To, From>::of(a[i]);
  return c + 1;
}

// The 32-bit pairs, which every shader uses, over vectors.
using DF = hn::CappedTag<float, 16>;
using DI = hn::RebindToSigned<DF>;
using DU = hn::RebindToUnsigned<DF>;
using VF = hn::Vec<DF>;
using VI = hn::Vec<DI>;
using VU = hn::Vec<DU>;

HWY_INLINE VI toSigned(VF x) {
  const DF df;
  const DI di;
  const auto high = hn::Ge(x, hn::Set(df, 0x1p31f)), low = hn::Lt(x, hn::Set(df, -0x1p31f));
  const auto inside = hn::IfThenZeroElse(hn::Or(hn::Or(high, low), hn::Not(hn::Eq(x, x))), x);
  const VI r = hn::ConvertTo(di, inside);
  return hn::IfThenElse(hn::RebindMask(di, high), hn::Set(di, std::numeric_limits<int32_t>::max()),
                        hn::IfThenElse(hn::RebindMask(di, low), hn::Set(di, std::numeric_limits<int32_t>::min()), r));
}
HWY_INLINE VU toUnsigned(VF x) {
  const DF df;
  const DI di;
  const DU du;
  const auto top = hn::Ge(x, hn::Set(df, 0x1p31f)), over = hn::Ge(x, hn::Set(df, 0x1p32f));
  const auto rest = hn::IfThenElse(top, hn::Sub(x, hn::Set(df, 0x1p31f)), x);
  const auto positive = hn::And(hn::Gt(rest, hn::Zero(df)), hn::Lt(rest, hn::Set(df, 0x1p31f)));
  const VU r = hn::BitCast(du, hn::ConvertTo(di, hn::IfThenElseZero(positive, rest)));
  const VU sum = hn::Add(r, hn::IfThenElseZero(hn::RebindMask(du, top), hn::Set(du, 0x80000000u)));
  return hn::IfThenElse(hn::RebindMask(du, over), hn::Set(du, 0xffffffffu), sum);
}
HWY_INLINE VF fromUnsigned(VU x) {
  const DF df;
  const DI di;
  // Both halves are exact, so only the sum rounds.
  const auto high = hn::ConvertTo(df, hn::BitCast(di, hn::ShiftRight<16>(x)));
  const auto low = hn::ConvertTo(df, hn::BitCast(di, hn::And(x, hn::Set(DU(), 0xffffu))));
  return hn::Add(hn::Mul(high, hn::Set(df, 65536.0f)), low);
}

template <class TFrom, class TTo, class F>
HWY_INLINE const Code* vectors(RunState& s, const Code* c, F f) {
  const hn::CappedTag<TFrom, 16> from;
  const hn::CappedTag<TTo, 16> to;
  TTo* dst = s.row<TTo>(c->dst);
  const TFrom* a = s.row<TFrom>(c->src[0]);
  for (size_t i = 0, end = s.rounded; i < end; i += hn::Lanes(from)) hn::Store(f(hn::Load(from, a + i)), to, dst + i);
  return c + 1;
}
const Code* f32ToS32(RunState& s, const Code* c) { return vectors<float, int32_t>(s, c, [](VF x) HWY_ATTR { return toSigned(x); }); }
const Code* f32ToU32(RunState& s, const Code* c) { return vectors<float, uint32_t>(s, c, [](VF x) HWY_ATTR { return toUnsigned(x); }); }
const Code* s32ToF32(RunState& s, const Code* c) { return vectors<int32_t, float>(s, c, [](VI x) HWY_ATTR { return hn::ConvertTo(DF(), x); }); }
const Code* u32ToF32(RunState& s, const Code* c) { return vectors<uint32_t, float>(s, c, [](VU x) HWY_ATTR { return fromUnsigned(x); }); }

#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
// NaN payloads differ from the formula's; they are canonical before anyone can see them.
const Code* f32ToF16(RunState& s, const Code* c) {
  uint16_t* dst = s.row<uint16_t>(c->dst);
  const float* a = s.row<float>(c->src[0]);
  for (size_t i = 0, end = s.rounded; i < end; i += 8)
    _mm_store_si128(reinterpret_cast<__m128i*>(dst + i), _mm256_cvtps_ph(_mm256_load_ps(a + i), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
  return c + 1;
}
const Code* f16ToF32(RunState& s, const Code* c) {
  float* dst = s.row<float>(c->dst);
  const uint16_t* a = s.row<uint16_t>(c->src[0]);
  for (size_t i = 0, end = s.rounded; i < end; i += 8)
    _mm256_store_ps(dst + i, _mm256_cvtph_ps(_mm_load_si128(reinterpret_cast<const __m128i*>(a + i))));
  return c + 1;
}
#else
constexpr Kernel f32ToF16 = convert<Float, Half, float>;
constexpr Kernel f16ToF32 = convert<Float, float, Half>;
#endif

const Code* canonHalf(RunState& s, const Code* c) {
  uint16_t* dst = s.row<uint16_t>(c->dst);
  const uint16_t* a = s.row<uint16_t>(c->src[0]);
  for (size_t i = 0, end = s.rounded; i < end; i++) dst[i] = (a[i] & 0x7fffu) > 0x7c00u ? uint16_t(0x7e00u) : a[i];
  return c + 1;
}
const Code* negateHalf(RunState& s, const Code* c) {
  uint16_t* dst = s.row<uint16_t>(c->dst);
  const uint16_t* a = s.row<uint16_t>(c->src[0]);
  for (size_t i = 0, end = s.rounded; i < end; i++) dst[i] = a[i] ^ 0x8000u;
  return c + 1;
}
const Code* absHalf(RunState& s, const Code* c) {
  uint16_t* dst = s.row<uint16_t>(c->dst);
  const uint16_t* a = s.row<uint16_t>(c->src[0]);
  for (size_t i = 0, end = s.rounded; i < end; i++) dst[i] = a[i] & 0x7fffu;
  return c + 1;
}

using ir::Op, ir::Type;

template <class F>
void addFloatPairs(KernelTable& t, Type from) {
  if constexpr (!std::is_same_v<F, Half>) t.cvt(Op::FToF, from, Type::F16) = convert<Float, Half, F>;
  if constexpr (!std::is_same_v<F, float>) t.cvt(Op::FToF, from, Type::F32) = convert<Float, float, F>;
  if constexpr (!std::is_same_v<F, double>) t.cvt(Op::FToF, from, Type::F64) = convert<Float, double, F>;
  t.cvt(Op::FToS, from, Type::I8) = convert<ToInt, int8_t, F>;
  t.cvt(Op::FToS, from, Type::I16) = convert<ToInt, int16_t, F>;
  t.cvt(Op::FToS, from, Type::I32) = convert<ToInt, int32_t, F>;
  t.cvt(Op::FToS, from, Type::I64) = convert<ToInt, int64_t, F>;
  t.cvt(Op::FToU, from, Type::I8) = convert<ToInt, uint8_t, F>;
  t.cvt(Op::FToU, from, Type::I16) = convert<ToInt, uint16_t, F>;
  t.cvt(Op::FToU, from, Type::I32) = convert<ToInt, uint32_t, F>;
  t.cvt(Op::FToU, from, Type::I64) = convert<ToInt, uint64_t, F>;
}
template <class U>
void addIntPairs(KernelTable& t, Type from) {
  using S = std::make_signed_t<U>;
  t.cvt(Op::SToF, from, Type::F16) = convert<FromInt, Half, S>;
  t.cvt(Op::SToF, from, Type::F32) = convert<FromInt, float, S>;
  t.cvt(Op::SToF, from, Type::F64) = convert<FromInt, double, S>;
  t.cvt(Op::UToF, from, Type::F16) = convert<FromInt, Half, U>;
  t.cvt(Op::UToF, from, Type::F32) = convert<FromInt, float, U>;
  t.cvt(Op::UToF, from, Type::F64) = convert<FromInt, double, U>;
  auto toInt = [&]<class W>(W, Type to) {
    if constexpr (sizeof(W) > sizeof(U)) {
      t.cvt(Op::SExt, from, to) = convert<Int, std::make_signed_t<W>, S>;
      t.cvt(Op::ZExt, from, to) = convert<Int, W, U>;
    } else if constexpr (sizeof(W) < sizeof(U)) {
      t.cvt(Op::Trunc, from, to) = convert<Int, W, U>;
    }
  };
  toInt(uint8_t(), Type::I8);
  toInt(uint16_t(), Type::I16);
  toInt(uint32_t(), Type::I32);
  toInt(uint64_t(), Type::I64);
}

}  // namespace

void convertKernels(KernelTable& t) {
  addFloatPairs<Half>(t, Type::F16);
  addFloatPairs<float>(t, Type::F32);
  addFloatPairs<double>(t, Type::F64);
  addIntPairs<uint8_t>(t, Type::I8);
  addIntPairs<uint16_t>(t, Type::I16);
  addIntPairs<uint32_t>(t, Type::I32);
  addIntPairs<uint64_t>(t, Type::I64);
  t.cvt(Op::FToS, Type::F32, Type::I32) = f32ToS32;
  t.cvt(Op::FToU, Type::F32, Type::I32) = f32ToU32;
  t.cvt(Op::SToF, Type::I32, Type::F32) = s32ToF32;
  t.cvt(Op::UToF, Type::I32, Type::F32) = u32ToF32;
  t.cvt(Op::FToF, Type::F32, Type::F16) = f32ToF16;
  t.cvt(Op::FToF, Type::F16, Type::F32) = f16ToF32;
  t.at(Internal::Canon, Type::F16) = canonHalf;
  t.at(Op::FNeg, Type::F16) = negateHalf;
  t.at(Op::FAbs, Type::F16) = absHalf;
}
}  // namespace pumice::interp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "spirv_interp/interpreter/targets-inl.h"
namespace pumice::interp {
void addConvertKernels(int64_t targetBit, KernelTable& table) { PUMICE_CALL_TARGET(targetBit, convertKernels, table) }
}
#endif
