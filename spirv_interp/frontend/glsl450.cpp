// The extended instruction set GLSL.std.450. Transcendental functions are single operations of lane IR; the
// others are formulas, each in one fixed order of operations.
#include <algorithm>
#include <array>
#include <limits>

#include <spirv/unified1/GLSL.std.450.h>

#include "spirv_interp/frontend/support.h"
#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

using Values = std::vector<Value>;

//! The operands of the extended instruction, and the builder.
struct Ext {
  Translator& t;
  ir::Builder& b;
  const Instruction& inst;
  uint32_t aux;

  uint32_t id(size_t i) const { return inst.operand(2 + i); }
  const Values& data(size_t i) const { return t.data(id(i)); }
  Value scalar(size_t i) const { return t.scalar(id(i)); }
  void define(Values v) const { t.define(inst, std::move(v)); }
  Value number(Value like, double x) const { return b.floatConstant(b.type(like), x); }
  //! Operand i of an instruction whose operands all have the size of the first.
  const Values& same(size_t i) const {
    const Values& v = data(i);
    if (v.size() != data(0).size()) fail("operands of different sizes");
    return v;
  }
  template <typename Formula>
  void each1(Formula&& f) const {
    Values out;
    for (Value x : data(0)) out.push_back(f(x));
    define(std::move(out));
  }
  template <typename Formula>
  void each2(Formula&& f) const {
    const Values &x = data(0), &y = same(1);
    Values out;
    for (size_t i = 0; i < x.size(); i++) out.push_back(f(x[i], y[i]));
    define(std::move(out));
  }
  template <typename Formula>
  void each3(Formula&& f) const {
    const Values &x = data(0), &y = same(1), &z = same(2);
    Values out;
    for (size_t i = 0; i < x.size(); i++) out.push_back(f(x[i], y[i], z[i]));
    define(std::move(out));
  }
  Value clampF(Value x, Value low, Value high) const { return b.fmin(b.fmax(x, low), high); }
  Value length(const Values& v) const {
    if (v.size() == 1) return b.fabs(v[0]);
    return b.fsqrt(t.dot(v, v, false));
  }
};

void onUnary(const Ext& e) {
  e.each1([&](Value x) { return e.b.unary(Op(e.aux), x); });
}
void onBinary(const Ext& e) {
  e.each2([&](Value x, Value y) { return e.b.binary(Op(e.aux), x, y); });
}

void onSAbs(const Ext& e) {
  e.each1([&](Value x) { return e.b.smax(x, e.b.isub(e.b.zero(e.b.type(x)), x)); });
}

// NaN gives 0, and so do both zeros.
void onFSign(const Ext& e) {
  e.each1([&](Value x) {
    Value zero = e.number(x, 0);
    Value negative = e.b.select(e.b.flt(x, zero), e.number(x, -1), zero);
    return e.b.select(e.b.flt(zero, x), e.number(x, 1), negative);
  });
}
void onSSign(const Ext& e) {
  e.each1([&](Value x) {
    Type type = e.b.type(x);
    Value one = e.b.constant(type, 1);
    return e.b.smax(e.b.smin(x, one), e.b.isub(e.b.zero(type), one));
  });
}

void onFract(const Ext& e) {
  e.each1([&](Value x) { return e.b.fsub(x, e.b.ffloor(x)); });
}
//! x * factor, the factor in two parts: the oracle computes in double, but its f32 constants are those of f32.
Value timesExact(const Ext& e, Value x, double factor) {
  const Type type = e.b.type(x);
  if (type == Type::F64) return e.b.fmul(x, e.number(x, factor));
  const Value wide = type == Type::F32 ? x : convertKept(e.b, Type::F32, x);
  const float high = float(factor);
  const Value product = e.b.fma(wide, e.b.f32(high), e.b.fmul(wide, e.b.f32(float(factor - double(high)))));
  return type == Type::F32 ? product : convertKept(e.b, type, product);
}
void onRadians(const Ext& e) {
  e.each1([&](Value x) { return timesExact(e, x, 0.017453292519943295); });
}
void onDegrees(const Ext& e) {
  e.each1([&](Value x) { return timesExact(e, x, 57.29577951308232); });
}
void onInverseSqrt(const Ext& e) {
  e.each1([&](Value x) {
    if (e.b.type(x) == Type::F64) return e.b.fdiv(e.number(x, 1), e.b.fsqrt(x));
    return e.b.unary(Op::FRsqrt, x);
  });
}

void onClamp(const Ext& e) {
  Op max = Op(e.aux & 0xff), min = Op(e.aux >> 8);
  e.each3([&](Value x, Value low, Value high) { return e.b.binary(min, e.b.binary(max, x, low), high); });
}

// x * (1 - a) + y * a
void onFMix(const Ext& e) {
  e.each3([&](Value x, Value y, Value a) {
    return e.b.fma(y, a, e.b.fmul(x, e.b.fsub(e.number(x, 1), a)));
  });
}
void onStep(const Ext& e) {
  e.each2([&](Value edge, Value x) { return e.b.select(e.b.flt(x, edge), e.number(x, 0), e.number(x, 1)); });
}
void onSmoothStep(const Ext& e) {
  e.each3([&](Value low, Value high, Value x) {
    Value s = e.clampF(e.b.fdiv(e.b.fsub(x, low), e.b.fsub(high, low)), e.number(x, 0), e.number(x, 1));
    return e.b.fmul(e.b.fmul(s, s), e.b.fma(s, e.number(x, -2), e.number(x, 3)));
  });
}
void onFma(const Ext& e) {
  e.each3([&](Value x, Value y, Value z) { return e.b.fma(x, y, z); });
}

// --- exponents

struct FloatShape {
  Type bits;
  unsigned mantissa, exponentBits;
  int bias;
};
FloatShape shapeOf(Type type) {
  switch (type) {
    case Type::F16: return {Type::I16, 10, 5, 15};
    case Type::F32: return {Type::I32, 23, 8, 127};
    case Type::F64: return {Type::I64, 52, 11, 1023};
    default: fail("a floating-point operand was expected");
  }
}

//! 2^n for n in the range of normal numbers; n is an integer of the type's own width.
Value powerOfTwo(const Ext& e, Type type, Value n) {
  FloatShape s = shapeOf(type);
  Value biased = e.b.iadd(n, e.b.constant(s.bits, uint64_t(s.bias)));
  return e.b.bitcast(type, e.b.shl(biased, e.b.constant(s.bits, s.mantissa)));
}

uint64_t asBits(Type type, int64_t n) {
  unsigned width = 8 * ir::typeBytes(type);
  return width < 64 ? uint64_t(n) & ((uint64_t(1) << width) - 1) : uint64_t(n);
}

// In three steps, each by a normal power of two, so that results beyond the range and denormals come out right and rounded
// once: downwards the first steps leave the last one so much to do that what they may have rounded ends as zero (as in musl's
// scalbn). Of halves in one step of f32, which holds every product.
void onLdexp(const Ext& e) {
  const Values &x = e.data(0), &n = e.same(1);
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    Type type = e.b.type(x[i]);
    FloatShape s = shapeOf(type);
    auto k = [&](int64_t v) { return e.b.constant(s.bits, asBits(s.bits, v)); };
    int64_t most = s.bias;
    // Clamp in the exponent's own type first: it may be wider.
    Type nType = e.b.type(n[i]);
    int64_t reach = 3 * most;
    Value clamped = e.b.smin(e.b.smax(n[i], e.b.constant(nType, asBits(nType, -reach))),
                             e.b.constant(nType, asBits(nType, reach)));
    Value left = e.t.resize(clamped, s.bits, true);
    Value result = x[i];
    if (type == Type::F16) {
      const Value scale = powerOfTwo(e, Type::F32, e.t.resize(left, Type::I32, true));
      out.push_back(convertKept(e.b, type, e.b.fmul(convertKept(e.b, Type::F32, result), scale)));
      continue;
    }
    for (int step = 0; step < 3; step++) {
      Value part = e.b.smin(e.b.smax(left, k(1 - most)), k(most));
      if (step < 2) part = e.b.select(e.b.slt(left, k(1 - most)), k(2 - most + s.mantissa), part);
      left = e.b.isub(left, part);
      result = e.b.fmul(result, powerOfTwo(e, type, part));
    }
    out.push_back(result);
  }
  e.define(std::move(out));
}

//! x = significand * 2^exponent with |significand| in [0.5, 1); zeros, infinities and NaN stay, with exponent 0.
void frexp(const Ext& e, Value x, Value& significand, Value& exponent) {
  ir::Builder& b = e.b;
  Type type = b.type(x);
  FloatShape s = shapeOf(type);
  auto k = [&](int64_t v) { return b.constant(s.bits, asBits(s.bits, v)); };
  int64_t exponentMask = (int64_t(1) << s.exponentBits) - 1;
  auto biasedOf = [&](Value v) { return b.and_(b.lshr(b.bitcast(s.bits, v), k(s.mantissa)), k(exponentMask)); };
  // Denormals are scaled up first.
  int64_t up = s.mantissa + 1;
  Value denormal = b.ieq(biasedOf(x), k(0));
  Value scaled = b.select(denormal, b.fmul(x, b.floatConstant(type, double(uint64_t(1) << up))), x);
  Value biased = biasedOf(scaled);
  Value special = b.maskOr(b.feq(x, b.zero(type)), b.ieq(biased, k(exponentMask)));
  Value bits = b.and_(b.bitcast(s.bits, scaled), k(~(exponentMask << s.mantissa)));
  Value half = b.bitcast(type, b.or_(bits, k(int64_t(s.bias - 1) << s.mantissa)));
  significand = b.select(special, x, half);
  Value e0 = b.isub(b.isub(biased, k(s.bias - 1)), b.select(denormal, k(up), k(0)));
  exponent = b.select(special, k(0), e0);
}

void onFrexp(const Ext& e) {
  Values significands, exponents;
  bool structure = e.aux != 0;
  Type to = Type::I32;
  if (!structure) to = e.t.scalarInfo(e.t.pointer(e.id(1)).type).scalar;
  for (Value x : e.data(0)) {
    Value significand = 0, exponent = 0;
    frexp(e, x, significand, exponent);
    significands.push_back(significand);
    exponents.push_back(e.t.resize(exponent, to, true));
  }
  if (structure) {
    significands.insert(significands.end(), exponents.begin(), exponents.end());
  } else {
    Pointer p = e.t.pointer(e.id(1));
    e.t.store(p, exponents);
    e.t.markWritten(p);
  }
  e.define(std::move(significands));
}

// The fraction has the sign of the operand; of an infinity it is a zero.
void onModf(const Ext& e) {
  Values fractions, wholes;
  for (Value x : e.data(0)) {
    Value whole = e.b.unary(Op::FTrunc, x);
    FloatShape s = shapeOf(e.b.type(x));
    Value sign = e.b.shl(e.b.constant(s.bits, 1), e.b.constant(s.bits, 8 * ir::typeBytes(s.bits) - 1));
    Value signedZero = e.b.bitcast(e.b.type(x), e.b.and_(e.b.bitcast(s.bits, x), sign));
    fractions.push_back(e.b.select(e.b.feq(x, whole), signedZero, e.b.fsub(x, whole)));
    wholes.push_back(whole);
  }
  if (e.aux) {
    fractions.insert(fractions.end(), wholes.begin(), wholes.end());
  } else {
    Pointer p = e.t.pointer(e.id(1));
    e.t.store(p, wholes);
    e.t.markWritten(p);
  }
  e.define(std::move(fractions));
}

// --- packing: aux = bits per component | signed << 8

void onPackNorm(const Ext& e) {
  ir::Builder& b = e.b;
  unsigned bits = e.aux & 0xff;
  bool isSigned = e.aux >> 8;
  double scale = isSigned ? double((1u << (bits - 1)) - 1) : double((1u << bits) - 1);
  Value word = 0;
  const Values& v = e.data(0);
  for (size_t i = 0; i < v.size() && i * bits < 32; i++) {
    Value clamped = e.clampF(v[i], b.f32(isSigned ? -1.0f : 0.0f), b.f32(1.0f));
    Value rounded = b.unary(Op::FRoundEven, b.fmul(clamped, b.f32(float(scale))));
    Value integer = b.convert(isSigned ? Op::FToS : Op::FToU, Type::I32, rounded);
    if (isSigned) integer = b.and_(integer, b.i32((1u << bits) - 1));
    if (i) integer = b.shl(integer, b.i32(uint32_t(i * bits)));
    word = word ? b.or_(word, integer) : integer;
  }
  e.define({word});
}

void onUnpackNorm(const Ext& e) {
  ir::Builder& b = e.b;
  unsigned bits = e.aux & 0xff;
  bool isSigned = e.aux >> 8;
  double scale = isSigned ? double((1u << (bits - 1)) - 1) : double((1u << bits) - 1);
  Value word = e.scalar(0);
  Values out;
  for (unsigned i = 0; i * bits < 32; i++) {
    if (isSigned) {
      Value field = b.ashr(b.shl(word, b.i32(32 - bits - i * bits)), b.i32(32 - bits));
      Value v = b.fdiv(b.convert(Op::SToF, Type::F32, field), b.f32(float(scale)));
      out.push_back(e.clampF(v, b.f32(-1), b.f32(1)));
    } else {
      Value field = b.and_(b.lshr(word, b.i32(i * bits)), b.i32((1u << bits) - 1));
      out.push_back(b.fdiv(b.convert(Op::UToF, Type::F32, field), b.f32(float(scale))));
    }
  }
  e.define(std::move(out));
}

void onPackHalf(const Ext& e) {
  ir::Builder& b = e.b;
  const Values& v = e.data(0);
  if (v.size() != 2) fail("PackHalf2x16 of %zu components", v.size());
  Value half[2];
  for (int i = 0; i < 2; i++)
    half[i] = b.convert(Op::ZExt, Type::I32, b.bitcast(Type::I16, b.convert(Op::FToF, Type::F16, v[size_t(i)])));
  e.define({b.or_(half[0], b.shl(half[1], b.i32(16)))});
}

void onUnpackHalf(const Ext& e) {
  ir::Builder& b = e.b;
  Value word = e.scalar(0);
  Values out;
  for (unsigned i = 0; i < 2; i++) {
    Value bits = b.convert(Op::Trunc, Type::I16, i ? b.lshr(word, b.i32(16)) : word);
    out.push_back(b.convert(Op::FToF, Type::F32, b.bitcast(Type::F16, bits)));
  }
  e.define(std::move(out));
}

void onPackDouble(const Ext& e) {
  ir::Builder& b = e.b;
  const Values& v = e.data(0);
  if (v.size() != 2) fail("PackDouble2x32 of %zu components", v.size());
  Value low = b.convert(Op::ZExt, Type::I64, v[0]), high = b.convert(Op::ZExt, Type::I64, v[1]);
  e.define({b.bitcast(Type::F64, b.or_(low, b.shl(high, b.i64(32))))});
}

void onUnpackDouble(const Ext& e) {
  ir::Builder& b = e.b;
  Value bits = b.bitcast(Type::I64, e.scalar(0));
  e.define({b.convert(Op::Trunc, Type::I32, bits), b.convert(Op::Trunc, Type::I32, b.lshr(bits, b.i64(32)))});
}

// --- geometry

void onLength(const Ext& e) { e.define({e.length(e.data(0))}); }

void onDistance(const Ext& e) {
  const Values &x = e.data(0), &y = e.same(1);
  Values d;
  for (size_t i = 0; i < x.size(); i++) d.push_back(e.b.fsub(x[i], y[i]));
  e.define({e.length(d)});
}

void onCross(const Ext& e) {
  const Values &x = e.data(0), &y = e.same(1);
  if (x.size() != 3) fail("Cross of %zu components", x.size());
  Values out;
  for (size_t i = 0; i < 3; i++) {
    size_t j = (i + 1) % 3, k = (i + 2) % 3;
    out.push_back(e.b.fma(x[j], y[k], e.b.fneg(e.b.fmul(y[j], x[k]))));
  }
  e.define(std::move(out));
}

void onNormalize(const Ext& e) {
  const Values& v = e.data(0);
  Value length = e.b.fsqrt(e.t.dot(v, v, false));
  Value scale = e.b.fdiv(e.number(length, 1), length);
  Values out;
  for (Value x : v) out.push_back(e.b.fmul(x, scale));
  e.define(std::move(out));
}

void onFaceForward(const Ext& e) {
  const Values &n = e.data(0), &i = e.same(1), &reference = e.same(2);
  Value d = e.t.dot(reference, i, false);
  Value keep = e.b.flt(d, e.number(d, 0));
  Values out;
  for (Value x : n) out.push_back(e.b.select(keep, x, e.b.fneg(x)));
  e.define(std::move(out));
}

// I - 2 * dot(N, I) * N
void onReflect(const Ext& e) {
  const Values &i = e.data(0), &n = e.same(1);
  Value d = e.t.dot(n, i, false);
  Value twice = e.b.fmul(d, e.number(d, -2));
  Values out;
  for (size_t k = 0; k < i.size(); k++) out.push_back(e.b.fma(twice, n[k], i[k]));
  e.define(std::move(out));
}

// k = 1 - eta^2 * (1 - dot(N, I)^2); k < 0 ? 0 : eta * I - (eta * dot(N, I) + sqrt(k)) * N
void onRefract(const Ext& e) {
  ir::Builder& b = e.b;
  const Values &i = e.data(0), &n = e.same(1);
  Value eta = e.scalar(2);
  Value d = e.t.dot(n, i, false);
  // eta may be of another width than the vectors
  if (b.type(eta) != b.type(d)) eta = b.convert(Op::FToF, b.type(d), eta);
  Value one = e.number(d, 1), zero = e.number(d, 0);
  Value k = b.fma(b.fneg(b.fmul(eta, eta)), b.fma(b.fneg(d), d, one), one);
  Value none = b.flt(k, zero);
  Value factor = b.fneg(b.fma(eta, d, b.fsqrt(b.select(none, zero, k))));   // no root of a negative number: PUMICE_CHECK=nan
  Values out;
  for (size_t c = 0; c < i.size(); c++) out.push_back(b.select(none, zero, b.fma(factor, n[c], b.fmul(eta, i[c]))));
  e.define(std::move(out));
}

// --- matrices, as columns

//! a*d - b*c
Value minor2(const Ext& e, Value a, Value b, Value c, Value d) { return e.b.fma(a, d, e.b.fneg(e.b.fmul(b, c))); }

//! Determinant of the matrix of the given rows and columns of an n x n matrix.
Value determinant(const Ext& e, const Values& m, size_t n, const std::vector<size_t>& columns,
                  const std::vector<size_t>& rows) {
  auto at = [&](size_t c, size_t r) { return m[columns[c] * n + rows[r]]; };
  if (columns.size() == 1) return at(0, 0);
  if (columns.size() == 2) return minor2(e, at(0, 0), at(1, 0), at(0, 1), at(1, 1));
  Value sum = 0;
  std::vector<size_t> restRows(rows.begin() + 1, rows.end());
  for (size_t c = 0; c < columns.size(); c++) {
    std::vector<size_t> restColumns = columns;
    restColumns.erase(restColumns.begin() + ptrdiff_t(c));
    Value inner = determinant(e, m, n, restColumns, restRows);
    Value factor = c % 2 ? e.b.fneg(at(c, 0)) : at(c, 0);
    sum = sum ? e.b.fma(factor, inner, sum) : e.b.fmul(factor, inner);
  }
  return sum;
}

std::vector<size_t> upTo(size_t n) {
  std::vector<size_t> v;
  for (size_t i = 0; i < n; i++) v.push_back(i);
  return v;
}

size_t squareSize(const Ext& e) {
  const TypeInfo& type = e.t.type(e.t.typeOf(e.id(0)));
  if (type.kind != TypeInfo::Matrix || type.scalars != type.count * type.count) fail("a square matrix was expected");
  return type.count;
}

//! Halfs as f32: sums of products that cancel would lose more than the results' type has.
Values widened(const Ext& e, const Values& m) {
  Values out;
  for (Value x : m) out.push_back(e.b.type(x) == Type::F16 ? e.b.convert(Op::FToF, Type::F32, x) : x);
  return out;
}
Value narrowedTo(const Ext& e, Type type, Value x) {
  return e.b.type(x) == type ? x : e.b.convert(Op::FToF, type, x);
}

void onDeterminant(const Ext& e) {
  size_t n = squareSize(e);
  Value det = determinant(e, widened(e, e.data(0)), n, upTo(n), upTo(n));
  e.define({narrowedTo(e, e.b.type(e.data(0)[0]), det)});
}

// The transposed matrix of cofactors over the determinant.
void onMatrixInverse(const Ext& e) {
  size_t n = squareSize(e);
  Values m = widened(e, e.data(0));
  Type type = e.b.type(e.data(0)[0]);
  Value det = determinant(e, m, n, upTo(n), upTo(n));
  Value scale = e.b.fdiv(e.number(det, 1), det);
  Values out;
  for (size_t c = 0; c < n; c++) {
    for (size_t r = 0; r < n; r++) {
      std::vector<size_t> columns = upTo(n), rows = upTo(n);
      columns.erase(columns.begin() + ptrdiff_t(r));
      rows.erase(rows.begin() + ptrdiff_t(c));
      Value cofactor = determinant(e, m, n, columns, rows);
      if ((c + r) % 2) cofactor = e.b.fneg(cofactor);
      out.push_back(narrowedTo(e, type, e.b.fmul(cofactor, scale)));
    }
  }
  e.define(std::move(out));
}

// --- bits

void onFindSMsb(const Ext& e) {
  e.each1([&](Value x) {
    Value sign = e.b.ashr(x, e.b.constant(e.b.type(x), 8 * ir::typeBytes(e.b.type(x)) - 1));
    return e.b.unary(Op::FindMsb, e.b.xor_(x, sign));
  });
}

// --- interpolation: aux = where

void onInterpolateAt(const Ext& e) {
  Pointer p = e.t.pointer(e.id(0));
  Values operands;
  SampleLocation where = SampleLocation::Center;
  if (e.inst.operand(1) == GLSLstd450InterpolateAtCentroid)
    where = SampleLocation::Centroid;
  else if (e.inst.operand(1) == GLSLstd450InterpolateAtSample)
    operands = {e.t.toI32(e.scalar(1))};
  else
    operands = e.data(1);
  e.define(e.t.interpolateAt(p, where, operands));
}

constexpr uint32_t a(Op op) { return uint32_t(op); }
constexpr uint32_t clampOf(Op max, Op min) { return uint32_t(max) | uint32_t(min) << 8; }
constexpr uint32_t kSigned = 0x100;

struct ExtEntry {
  uint32_t number;
  void (*handler)(const Ext&);
  uint32_t aux;
};

// FMin, FMax and FClamp are the N forms: SPIR-V leaves open what NaN does in the former.
constexpr ExtEntry kEntries[] = {
    {GLSLstd450Round, onUnary, a(Op::FRoundEven)},
    {GLSLstd450RoundEven, onUnary, a(Op::FRoundEven)},
    {GLSLstd450Trunc, onUnary, a(Op::FTrunc)},
    {GLSLstd450FAbs, onUnary, a(Op::FAbs)},
    {GLSLstd450SAbs, onSAbs, 0},
    {GLSLstd450FSign, onFSign, 0},
    {GLSLstd450SSign, onSSign, 0},
    {GLSLstd450Floor, onUnary, a(Op::FFloor)},
    {GLSLstd450Ceil, onUnary, a(Op::FCeil)},
    {GLSLstd450Fract, onFract, 0},
    {GLSLstd450Radians, onRadians, 0},
    {GLSLstd450Degrees, onDegrees, 0},
    {GLSLstd450Sin, onUnary, a(Op::FSin)},
    {GLSLstd450Cos, onUnary, a(Op::FCos)},
    {GLSLstd450Tan, onUnary, a(Op::FTan)},
    {GLSLstd450Asin, onUnary, a(Op::FAsin)},
    {GLSLstd450Acos, onUnary, a(Op::FAcos)},
    {GLSLstd450Atan, onUnary, a(Op::FAtan)},
    {GLSLstd450Sinh, onUnary, a(Op::FSinh)},
    {GLSLstd450Cosh, onUnary, a(Op::FCosh)},
    {GLSLstd450Tanh, onUnary, a(Op::FTanh)},
    {GLSLstd450Asinh, onUnary, a(Op::FAsinh)},
    {GLSLstd450Acosh, onUnary, a(Op::FAcosh)},
    {GLSLstd450Atanh, onUnary, a(Op::FAtanh)},
    {GLSLstd450Atan2, onBinary, a(Op::FAtan2)},
    {GLSLstd450Pow, onBinary, a(Op::FPow)},
    {GLSLstd450Exp, onUnary, a(Op::FExp)},
    {GLSLstd450Log, onUnary, a(Op::FLog)},
    {GLSLstd450Exp2, onUnary, a(Op::FExp2)},
    {GLSLstd450Log2, onUnary, a(Op::FLog2)},
    {GLSLstd450Sqrt, onUnary, a(Op::FSqrt)},
    {GLSLstd450InverseSqrt, onInverseSqrt, 0},
    {GLSLstd450Determinant, onDeterminant, 0},
    {GLSLstd450MatrixInverse, onMatrixInverse, 0},
    {GLSLstd450Modf, onModf, 0},
    {GLSLstd450ModfStruct, onModf, 1},
    {GLSLstd450FMin, onBinary, a(Op::FMin)},
    {GLSLstd450UMin, onBinary, a(Op::UMin)},
    {GLSLstd450SMin, onBinary, a(Op::SMin)},
    {GLSLstd450FMax, onBinary, a(Op::FMax)},
    {GLSLstd450UMax, onBinary, a(Op::UMax)},
    {GLSLstd450SMax, onBinary, a(Op::SMax)},
    {GLSLstd450FClamp, onClamp, clampOf(Op::FMax, Op::FMin)},
    {GLSLstd450UClamp, onClamp, clampOf(Op::UMax, Op::UMin)},
    {GLSLstd450SClamp, onClamp, clampOf(Op::SMax, Op::SMin)},
    {GLSLstd450FMix, onFMix, 0},
    {GLSLstd450Step, onStep, 0},
    {GLSLstd450SmoothStep, onSmoothStep, 0},
    {GLSLstd450Fma, onFma, 0},
    {GLSLstd450Frexp, onFrexp, 0},
    {GLSLstd450FrexpStruct, onFrexp, 1},
    {GLSLstd450Ldexp, onLdexp, 0},
    {GLSLstd450PackSnorm4x8, onPackNorm, 8 | kSigned},
    {GLSLstd450PackUnorm4x8, onPackNorm, 8},
    {GLSLstd450PackSnorm2x16, onPackNorm, 16 | kSigned},
    {GLSLstd450PackUnorm2x16, onPackNorm, 16},
    {GLSLstd450PackHalf2x16, onPackHalf, 0},
    {GLSLstd450PackDouble2x32, onPackDouble, 0},
    {GLSLstd450UnpackSnorm2x16, onUnpackNorm, 16 | kSigned},
    {GLSLstd450UnpackUnorm2x16, onUnpackNorm, 16},
    {GLSLstd450UnpackHalf2x16, onUnpackHalf, 0},
    {GLSLstd450UnpackSnorm4x8, onUnpackNorm, 8 | kSigned},
    {GLSLstd450UnpackUnorm4x8, onUnpackNorm, 8},
    {GLSLstd450UnpackDouble2x32, onUnpackDouble, 0},
    {GLSLstd450Length, onLength, 0},
    {GLSLstd450Distance, onDistance, 0},
    {GLSLstd450Cross, onCross, 0},
    {GLSLstd450Normalize, onNormalize, 0},
    {GLSLstd450FaceForward, onFaceForward, 0},
    {GLSLstd450Reflect, onReflect, 0},
    {GLSLstd450Refract, onRefract, 0},
    {GLSLstd450FindILsb, onUnary, a(Op::FindLsb)},
    {GLSLstd450FindSMsb, onFindSMsb, 0},
    {GLSLstd450FindUMsb, onUnary, a(Op::FindMsb)},
    {GLSLstd450InterpolateAtCentroid, onInterpolateAt, 0},
    {GLSLstd450InterpolateAtSample, onInterpolateAt, 0},
    {GLSLstd450InterpolateAtOffset, onInterpolateAt, 0},
    {GLSLstd450NMin, onBinary, a(Op::FMin)},
    {GLSLstd450NMax, onBinary, a(Op::FMax)},
    {GLSLstd450NClamp, onClamp, clampOf(Op::FMax, Op::FMin)},
};

}  // namespace

void translateGlsl450(Translator& t, const Instruction& inst) {
  for (const ExtEntry& entry : kEntries) {
    if (entry.number != inst.operand(1)) continue;
    entry.handler(Ext{t, t.b, inst, entry.aux});
    return;
  }
  const char* why = whyNotGlsl450(inst.operand(1));
  fail("GLSL.std.450 instruction %u %s", inst.operand(1), why ? why : "is not supported");
}

bool handlesGlsl450(uint32_t number) {
  return std::any_of(std::begin(kEntries), std::end(kEntries), [&](const ExtEntry& e) { return e.number == number; });
}

}  // namespace pumice::frontend
