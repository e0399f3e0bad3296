// Arithmetic, logic, comparisons, conversions, derivatives.
//
// Contraction: an addition or subtraction with a product (OpFMul, OpVectorTimesScalar) for an operand becomes a
// fused multiply-add, the first operand that is one; a function of the expression alone. NoContraction on
// either instruction prevents it. Dot products and everything made of them (matrix products) are one product
// and then fused multiply-adds by rising component.
#include <algorithm>
#include <limits>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

Value Translator::dot(std::span<const Value> a, std::span<const Value> c, bool noContraction) {
  if (a.size() != c.size() || a.empty()) fail("a dot product of different sizes");
  Value sum = b.fmul(a[0], c[0]);
  for (size_t i = 1; i < a.size(); i++)
    sum = noContraction ? b.fadd(sum, b.fmul(a[i], c[i])) : b.fma(a[i], c[i], sum);
  return sum;
}

Value Translator::resize(Value v, Type to, bool isSigned) {
  Type from = b.type(v);
  if (from == to) return v;
  if (!ir::isInt(from) || !ir::isInt(to)) fail("an integer was expected");
  if (ir::typeBytes(from) > ir::typeBytes(to)) return b.convert(Op::Trunc, to, v);
  return b.convert(isSigned ? Op::SExt : Op::ZExt, to, v);
}

Value Translator::toI32(Value v, bool isSigned) { return resize(v, Type::I32, isSigned); }

namespace {

using Values = std::vector<Value>;

const Values& sameSize(Translator& t, uint32_t id, const Values& as) {
  const Values& v = t.data(id);
  if (v.size() != as.size()) fail("operands of different sizes");
  return v;
}

//! Lane IR requires equal types; SPIR-V after validation has them, up to mistakes of ours.
void checkSame(Translator& t, Value a, Value c) {
  if (t.b.type(a) != t.b.type(c)) fail("operands of different types");
}

void onUnary(Translator& t, const Instruction& inst, uint32_t aux) {
  Values out;
  for (Value v : t.data(inst.operand(0))) out.push_back(t.b.unary(Op(aux), v));
  t.define(inst, std::move(out));
}

void onBinary(Translator& t, const Instruction& inst, uint32_t aux) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    checkSame(t, x[i], y[i]);
    out.push_back(t.b.binary(Op(aux), x[i], y[i]));
  }
  t.define(inst, std::move(out));
}

void onCompare(Translator& t, const Instruction& inst, uint32_t aux) {
  bool swapped = aux & 0x100, inverted = aux & 0x200;
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    checkSame(t, x[i], y[i]);
    Value m = swapped ? t.b.compare(Op(aux & 0xff), y[i], x[i]) : t.b.compare(Op(aux & 0xff), x[i], y[i]);
    out.push_back(inverted ? t.b.maskNot(m) : m);
  }
  t.define(inst, std::move(out));
}
constexpr uint32_t kSwap = 0x100, kNot = 0x200;

//! Ordered or unordered (in)equality, which take two comparisons.
void onOrderedNotEqual(Translator& t, const Instruction& inst, uint32_t inverted) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    Value m = t.b.maskOr(t.b.flt(x[i], y[i]), t.b.flt(y[i], x[i]));
    out.push_back(inverted ? t.b.maskNot(m) : m);
  }
  t.define(inst, std::move(out));
}

//! The factors of an operand that is a product which may be contracted; false if it is none.
bool product(Translator& t, uint32_t id, Values& x, Values& y) {
  const Instruction* inst = t.module.definition(id);
  if (!inst || (inst->op != spv::Op::OpFMul && inst->op != spv::Op::OpVectorTimesScalar)) return false;
  if (t.module.find(id, spv::Decoration::NoContraction)) return false;
  x = t.data(inst->operand(0));
  y = t.data(inst->operand(1));
  if (inst->op == spv::Op::OpVectorTimesScalar && y.size() == 1) y.assign(x.size(), y[0]);
  return x.size() == y.size();
}

void onAddSub(Translator& t, const Instruction& inst, uint32_t subtract) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values p, q, out;
  bool contract = !t.module.find(inst.result, spv::Decoration::NoContraction);
  bool first = contract && product(t, inst.operand(0), p, q);
  bool second = contract && !first && product(t, inst.operand(1), p, q);
  if ((first || second) && p.size() != x.size()) fail("a product of the wrong size");
  for (size_t i = 0; i < x.size(); i++) {
    checkSame(t, x[i], y[i]);
    if (first)
      out.push_back(t.b.fma(p[i], q[i], subtract ? t.b.fneg(y[i]) : y[i]));
    else if (second)
      out.push_back(t.b.fma(subtract ? t.b.fneg(p[i]) : p[i], q[i], x[i]));
    else
      out.push_back(subtract ? t.b.fsub(x[i], y[i]) : t.b.fadd(x[i], y[i]));
  }
  t.define(inst, std::move(out));
}

// x - y * floor(x/y) or x - y * trunc(x/y)
void onFloatRemainder(Translator& t, const Instruction& inst, uint32_t rounding) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    Value quotient = t.b.unary(Op(rounding), t.b.fdiv(x[i], y[i]));
    out.push_back(t.b.fma(t.b.fneg(quotient), y[i], x[i]));
  }
  t.define(inst, std::move(out));
}

// The remainder with the sign of the divisor.
void onSMod(Translator& t, const Instruction& inst, uint32_t) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  ir::Builder& b = t.b;
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    Value zero = b.zero(b.type(x[i]));
    Value r = b.srem(x[i], y[i]);
    Value wrong = b.maskAnd(b.ine(r, zero), b.slt(b.xor_(r, y[i]), zero));
    out.push_back(b.select(wrong, b.iadd(r, y[i]), r));
  }
  t.define(inst, std::move(out));
}

void onShift(Translator& t, const Instruction& inst, uint32_t aux) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values out;
  for (size_t i = 0; i < x.size(); i++)
    out.push_back(t.b.binary(Op(aux), x[i], t.resize(y[i], t.b.type(x[i]), false)));
  t.define(inst, std::move(out));
}

void onINegate(Translator& t, const Instruction& inst, uint32_t) {
  Values out;
  for (Value v : t.data(inst.operand(0))) out.push_back(t.b.isub(t.b.zero(t.b.type(v)), v));
  t.define(inst, std::move(out));
}

void onLogicalNot(Translator& t, const Instruction& inst, uint32_t) {
  Values out;
  for (Value v : t.data(inst.operand(0))) out.push_back(t.b.maskNot(v));
  t.define(inst, std::move(out));
}

void onLogicalEqual(Translator& t, const Instruction& inst, uint32_t inverted) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    Value m = t.b.maskXor(x[i], y[i]);
    out.push_back(inverted ? t.b.maskNot(m) : m);
  }
  t.define(inst, std::move(out));
}

void onAnyAll(Translator& t, const Instruction& inst, uint32_t all) {
  const Values& x = t.data(inst.operand(0));
  if (x.empty()) fail("OpAny of nothing");
  Value m = x[0];
  for (size_t i = 1; i < x.size(); i++) m = all ? t.b.maskAnd(m, x[i]) : t.b.maskOr(m, x[i]);
  t.define(inst, {m});
}

void onSelect(Translator& t, const Instruction& inst, uint32_t) {
  const Values& m = t.data(inst.operand(0));
  if (t.type(inst.resultType).scalars == 0) fail("OpSelect of something that is not a value");
  const Values& x = t.data(inst.operand(1));
  const Values& y = sameSize(t, inst.operand(2), x);
  if (m.size() != 1 && m.size() != x.size()) fail("OpSelect with a condition of the wrong size");
  Values out;
  for (size_t i = 0; i < x.size(); i++) {
    checkSame(t, x[i], y[i]);
    out.push_back(t.b.select(m.size() == 1 ? m[0] : m[i], x[i], y[i]));
  }
  t.define(inst, std::move(out));
  if (t.type(inst.resultType).kind == TypeInfo::Pointer) t.inheritLayout(inst.result, inst.operand(1));
}

void onIsNan(Translator& t, const Instruction& inst, uint32_t) {
  Values out;
  for (Value v : t.data(inst.operand(0))) out.push_back(t.b.fne(v, v));
  t.define(inst, std::move(out));
}

void onIsInf(Translator& t, const Instruction& inst, uint32_t) {
  Values out;
  for (Value v : t.data(inst.operand(0)))
    out.push_back(t.b.feq(t.b.fabs(v), t.b.floatConstant(t.b.type(v), std::numeric_limits<double>::infinity())));
  t.define(inst, std::move(out));
}

// --- conversions

// The nearest half, or the one before it where that is farther from zero than v (infinity is farther than all).
Value toHalfTowardsZero(ir::Builder& b, Value v) {
  Value nearest = b.convert(Op::FToF, Type::F16, v);
  Value beyond = b.flt(b.fabs(v), b.fabs(b.convert(Op::FToF, b.type(v), nearest)));
  Value before = b.bitcast(Type::F16, b.isub(b.bitcast(Type::I16, nearest), b.constant(Type::I16, 1)));
  return b.select(beyond, before, nearest);
}

void onConvert(Translator& t, const Instruction& inst, uint32_t aux) {
  Type to = t.scalarInfo(inst.resultType).scalar;
  const Decoration* rounding = t.module.find(inst.result, spv::Decoration::FPRoundingMode);
  bool towardsZero = rounding && spv::FPRoundingMode(rounding->literal()) == spv::FPRoundingMode::RTZ;
  Values out;
  for (Value v : t.data(inst.operand(0))) {
    // FToF, SExt and ZExt between equal widths change nothing.
    if (t.b.type(v) == to)
      out.push_back(v);
    else if (Op(aux) == Op::SExt || Op(aux) == Op::ZExt)
      out.push_back(t.resize(v, to, Op(aux) == Op::SExt));
    else if (towardsZero && Op(aux) == Op::FToF && to == Type::F16)
      out.push_back(toHalfTowardsZero(t.b, v));
    else if (Op(aux) == Op::FToF)
      out.push_back(convertKept(t.b, to, v));
    else
      out.push_back(t.b.convert(Op(aux), to, v));
  }
  t.define(inst, std::move(out));
}

// Halfs too small to be normal become zeros of the same sign.
void onQuantizeToF16(Translator& t, const Instruction& inst, uint32_t) {
  ir::Builder& b = t.b;
  Values out;
  for (Value v : t.data(inst.operand(0))) {
    Value q = b.convert(Op::FToF, Type::F32, b.convert(Op::FToF, Type::F16, v));
    Value zero = b.bitcast(Type::F32, b.and_(b.bitcast(Type::I32, q), b.i32(0x80000000)));
    out.push_back(b.select(b.flt(b.fabs(q), b.f32(0x1p-14f)), zero, q));
  }
  t.define(inst, std::move(out));
}

void onBitcast(Translator& t, const Instruction& inst, uint32_t) {
  ir::Builder& b = t.b;
  const Values& from = t.data(inst.operand(0));
  const TypeInfo& type = t.type(inst.resultType);
  Type to = t.scalarInfo(inst.resultType).scalar;
  if (from.empty() || type.scalars == 0 || !ir::typeBytes(to)) fail("OpBitcast to an unsupported type");
  unsigned fromBytes = ir::typeBytes(b.type(from[0])), toBytes = ir::typeBytes(to);
  if (!fromBytes || fromBytes * from.size() != uint64_t(toBytes) * type.scalars) fail("OpBitcast between different sizes");
  Values out;
  if (fromBytes == toBytes) {
    for (Value v : from) out.push_back(b.bitcast(to, v));
  } else if (fromBytes > toBytes) {
    for (Value v : from) {
      Value bits = b.bitcast(ir::intOf(b.type(v)), v);
      for (unsigned part = 0; part < fromBytes / toBytes; part++) {
        Value shifted = part ? b.lshr(bits, b.constant(b.type(bits), part * toBytes * 8)) : bits;
        out.push_back(b.bitcast(to, b.convert(Op::Trunc, ir::intOf(to), shifted)));
      }
    }
  } else {
    unsigned parts = toBytes / fromBytes;
    Type wide = ir::intOf(to);
    for (size_t i = 0; i + parts <= from.size(); i += parts) {
      Value bits = 0;
      for (unsigned part = 0; part < parts; part++) {
        Value v = from[i + part];
        Value extended = b.convert(Op::ZExt, wide, b.bitcast(ir::intOf(b.type(v)), v));
        if (part) extended = b.shl(extended, b.constant(wide, part * fromBytes * 8));
        bits = bits ? b.or_(bits, extended) : extended;
      }
      out.push_back(b.bitcast(to, bits));
    }
  }
  t.define(inst, std::move(out));
}

// --- bit fields: the shift of a count of 0 would be the whole width, which the table takes modulo the width

Value lowBits(ir::Builder& b, Type type, Value count) {
  unsigned width = 8 * ir::typeBytes(type);
  Value ones = b.not_(b.zero(type));
  Value mask = b.lshr(ones, b.isub(b.constant(type, width), count));
  return b.select(b.ieq(count, b.zero(type)), b.zero(type), mask);
}

void onBitFieldInsert(Translator& t, const Instruction& inst, uint32_t) {
  ir::Builder& b = t.b;
  const Values& base = t.data(inst.operand(0));
  const Values& insert = sameSize(t, inst.operand(1), base);
  Values out;
  for (size_t i = 0; i < base.size(); i++) {
    Type type = b.type(base[i]);
    Value offset = t.resize(t.scalar(inst.operand(2)), type, false);
    Value mask = lowBits(b, type, t.resize(t.scalar(inst.operand(3)), type, false));
    Value kept = b.and_(base[i], b.not_(b.shl(mask, offset)));
    out.push_back(b.or_(kept, b.shl(b.and_(insert[i], mask), offset)));
  }
  t.define(inst, std::move(out));
}

void onBitFieldExtract(Translator& t, const Instruction& inst, uint32_t isSigned) {
  ir::Builder& b = t.b;
  Values out;
  for (Value v : t.data(inst.operand(0))) {
    Type type = b.type(v);
    Value offset = t.resize(t.scalar(inst.operand(1)), type, false);
    Value count = t.resize(t.scalar(inst.operand(2)), type, false);
    if (isSigned) {
      Value unused = b.isub(b.constant(type, 8 * ir::typeBytes(type)), count);
      Value field = b.ashr(b.shl(v, b.isub(unused, offset)), unused);
      out.push_back(b.select(b.ieq(count, b.zero(type)), b.zero(type), field));
    } else {
      out.push_back(b.and_(b.lshr(v, offset), lowBits(b, type, count)));
    }
  }
  t.define(inst, std::move(out));
}

void onBitCount(Translator& t, const Instruction& inst, uint32_t) {
  Type to = t.scalarInfo(inst.resultType).scalar;
  Values out;
  for (Value v : t.data(inst.operand(0))) out.push_back(t.resize(t.b.unary(Op::PopCount, v), to, false));
  t.define(inst, std::move(out));
}

// --- results of two parts: a structure of two members

void onCarry(Translator& t, const Instruction& inst, uint32_t subtract) {
  ir::Builder& b = t.b;
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values low, high;
  for (size_t i = 0; i < x.size(); i++) {
    Type type = b.type(x[i]);
    Value r = subtract ? b.isub(x[i], y[i]) : b.iadd(x[i], y[i]);
    Value carry = subtract ? b.ult(x[i], y[i]) : b.ult(r, x[i]);
    low.push_back(r);
    high.push_back(b.select(carry, b.constant(type, 1), b.zero(type)));
  }
  low.insert(low.end(), high.begin(), high.end());
  t.define(inst, std::move(low));
}

//! The upper half of the product.
Value mulHigh(ir::Builder& b, Value x, Value y, bool isSigned) {
  Type type = b.type(x);
  if (type == Type::I32) return b.binary(isSigned ? Op::SMulHi : Op::UMulHi, x, y);
  if (type != Type::I64) {
    unsigned width = 8 * ir::typeBytes(type);
    Op extend = isSigned ? Op::SExt : Op::ZExt;
    Value p = b.imul(b.convert(extend, Type::I32, x), b.convert(extend, Type::I32, y));
    return b.convert(Op::Trunc, type, b.lshr(p, b.i32(width)));
  }
  // By halves of 32 bits (Hacker's Delight, 8-2).
  Value mask = b.i64(0xffffffff), k32 = b.i64(32);
  Value xl = b.and_(x, mask), xh = b.lshr(x, k32), yl = b.and_(y, mask), yh = b.lshr(y, k32);
  Value ll = b.imul(xl, yl), lh = b.imul(xl, yh), hl = b.imul(xh, yl), hh = b.imul(xh, yh);
  Value middle = b.iadd(b.iadd(b.lshr(ll, k32), b.and_(lh, mask)), b.and_(hl, mask));
  Value high = b.iadd(b.iadd(hh, b.lshr(lh, k32)), b.iadd(b.lshr(hl, k32), b.lshr(middle, k32)));
  if (!isSigned) return high;
  Value zero = b.i64(0);
  high = b.isub(high, b.select(b.slt(x, zero), y, zero));
  return b.isub(high, b.select(b.slt(y, zero), x, zero));
}

void onMulExtended(Translator& t, const Instruction& inst, uint32_t isSigned) {
  const Values& x = t.data(inst.operand(0));
  const Values& y = sameSize(t, inst.operand(1), x);
  Values low, high;
  for (size_t i = 0; i < x.size(); i++) {
    low.push_back(t.b.imul(x[i], y[i]));
    high.push_back(mulHigh(t.b, x[i], y[i], isSigned));
  }
  low.insert(low.end(), high.begin(), high.end());
  t.define(inst, std::move(low));
}

// --- integer dot products: aux bits: 1 first operand signed, 2 second signed, 4 accumulating with saturation

Values integerVector(Translator& t, uint32_t id, Type to, bool isSigned) {
  ir::Builder& b = t.b;
  Values v = t.data(id), out;
  if (v.size() == 1) {  // four 8-bit numbers packed
    if (b.type(v[0]) != Type::I32) fail("a packed dot product of something other than 32 bits");
    for (unsigned i = 0; i < 4; i++)
      out.push_back(t.resize(b.convert(Op::Trunc, Type::I8, b.lshr(v[0], b.i32(8 * i))), to, isSigned));
  } else {
    for (Value x : v) out.push_back(t.resize(x, to, isSigned));
  }
  return out;
}

void onIntegerDot(Translator& t, const Instruction& inst, uint32_t aux) {
  ir::Builder& b = t.b;
  Type type = t.type(inst.resultType).scalar;
  Values x = integerVector(t, inst.operand(0), type, aux & 1), y = integerVector(t, inst.operand(1), type, aux & 2);
  if (x.size() != y.size() || x.empty()) fail("a dot product of different sizes");
  Value sum = b.imul(x[0], y[0]);
  for (size_t i = 1; i < x.size(); i++) sum = b.iadd(sum, b.imul(x[i], y[i]));
  if (aux & 4) {
    Value accumulator = t.scalar(inst.operand(2));
    if (b.type(accumulator) != type) fail("an accumulator of the wrong type");
    Value s = b.iadd(sum, accumulator), zero = b.zero(type), ones = b.not_(zero);
    if (aux & 1) {
      Value least = b.shl(b.constant(type, 1), b.constant(type, 8 * ir::typeBytes(type) - 1));
      Value overflow = b.slt(b.and_(b.xor_(sum, s), b.xor_(accumulator, s)), zero);
      s = b.select(overflow, b.select(b.slt(accumulator, zero), least, b.not_(least)), s);
    } else {
      s = b.select(b.ult(s, sum), ones, s);
    }
    sum = s;
  }
  t.define(inst, {sum});
}

// --- linear algebra

bool noContraction(Translator& t, const Instruction& inst) {
  return t.module.find(inst.result, spv::Decoration::NoContraction) != nullptr;
}

void onDot(Translator& t, const Instruction& inst, uint32_t) {
  t.define(inst, {t.dot(t.data(inst.operand(0)), t.data(inst.operand(1)), noContraction(t, inst))});
}

//! Vector or matrix times scalar.
void onTimesScalar(Translator& t, const Instruction& inst, uint32_t) {
  Value s = t.scalar(inst.operand(1));
  Values out;
  for (Value v : t.data(inst.operand(0))) out.push_back(t.b.fmul(v, s));
  t.define(inst, std::move(out));
}

struct MatrixShape {
  uint32_t columns, rows;
};
MatrixShape shapeOf(Translator& t, uint32_t typeId) {
  const TypeInfo& m = t.type(typeId);
  if (m.kind != TypeInfo::Matrix) fail("a matrix was expected");
  return {m.count, t.type(m.element).count};
}

//! Row r of a matrix.
Values row(const Values& m, MatrixShape shape, uint32_t r) {
  Values out;
  for (uint32_t c = 0; c < shape.columns; c++) out.push_back(m[c * shape.rows + r]);
  return out;
}

void onMatrixTimesVector(Translator& t, const Instruction& inst, uint32_t) {
  MatrixShape shape = shapeOf(t, t.typeOf(inst.operand(0)));
  const Values& m = t.data(inst.operand(0));
  Values out;
  for (uint32_t r = 0; r < shape.rows; r++)
    out.push_back(t.dot(row(m, shape, r), t.data(inst.operand(1)), noContraction(t, inst)));
  t.define(inst, std::move(out));
}

void onVectorTimesMatrix(Translator& t, const Instruction& inst, uint32_t) {
  MatrixShape shape = shapeOf(t, t.typeOf(inst.operand(1)));
  const Values& m = t.data(inst.operand(1));
  Values out;
  for (uint32_t c = 0; c < shape.columns; c++)
    out.push_back(t.dot(t.data(inst.operand(0)), std::span(m).subspan(c * shape.rows, shape.rows), noContraction(t, inst)));
  t.define(inst, std::move(out));
}

void onMatrixTimesMatrix(Translator& t, const Instruction& inst, uint32_t) {
  MatrixShape left = shapeOf(t, t.typeOf(inst.operand(0))), right = shapeOf(t, t.typeOf(inst.operand(1)));
  const Values& l = t.data(inst.operand(0));
  const Values& m = t.data(inst.operand(1));
  if (left.columns != right.rows) fail("OpMatrixTimesMatrix of different shapes");
  Values out;
  for (uint32_t c = 0; c < right.columns; c++)
    for (uint32_t r = 0; r < left.rows; r++)
      out.push_back(t.dot(row(l, left, r), std::span(m).subspan(c * right.rows, right.rows), noContraction(t, inst)));
  t.define(inst, std::move(out));
}

void onOuterProduct(Translator& t, const Instruction& inst, uint32_t) {
  Values out;
  for (Value column : t.data(inst.operand(1)))
    for (Value v : t.data(inst.operand(0))) out.push_back(t.b.fmul(v, column));
  t.define(inst, std::move(out));
}

void onTranspose(Translator& t, const Instruction& inst, uint32_t) {
  MatrixShape shape = shapeOf(t, t.typeOf(inst.operand(0)));
  const Values& m = t.data(inst.operand(0));
  Values out;
  for (uint32_t r = 0; r < shape.rows; r++)
    for (Value v : row(m, shape, r)) out.push_back(v);
  t.define(inst, std::move(out));
}

// --- derivatives: aux bit 0 y, bit 1 fine, bit 2 width

void onDerivative(Translator& t, const Instruction& inst, uint32_t aux) {
  uint64_t fine = aux >> 1 & 1;
  auto derivative = [&](Op op, Value v) { return t.b.emit(op, t.b.type(v), {v}, fine); };
  Values out;
  for (Value v : t.data(inst.operand(0))) {
    if (aux & 4)
      out.push_back(t.b.fadd(t.b.fabs(derivative(Op::QuadDdx, v)), t.b.fabs(derivative(Op::QuadDdy, v))));
    else
      out.push_back(derivative(aux & 1 ? Op::QuadDdy : Op::QuadDdx, v));
  }
  t.define(inst, std::move(out));
}

constexpr uint32_t a(Op op) { return uint32_t(op); }

constexpr HandlerEntry kHandlers[] = {
    {spv::Op::OpFNegate, onUnary, a(Op::FNeg)},
    {spv::Op::OpNot, onUnary, a(Op::Not)},
    {spv::Op::OpBitReverse, onUnary, a(Op::BitReverse)},
    {spv::Op::OpSNegate, onINegate},
    {spv::Op::OpFAdd, onAddSub, 0},
    {spv::Op::OpFSub, onAddSub, 1},
    {spv::Op::OpFMul, onBinary, a(Op::FMul)},
    {spv::Op::OpFDiv, onBinary, a(Op::FDiv)},
    {spv::Op::OpFMod, onFloatRemainder, a(Op::FFloor)},
    {spv::Op::OpFRem, onFloatRemainder, a(Op::FTrunc)},
    {spv::Op::OpIAdd, onBinary, a(Op::IAdd)},
    {spv::Op::OpISub, onBinary, a(Op::ISub)},
    {spv::Op::OpIMul, onBinary, a(Op::IMul)},
    {spv::Op::OpSDiv, onBinary, a(Op::SDiv)},
    {spv::Op::OpUDiv, onBinary, a(Op::UDiv)},
    {spv::Op::OpSRem, onBinary, a(Op::SRem)},
    {spv::Op::OpUMod, onBinary, a(Op::URem)},
    {spv::Op::OpSMod, onSMod},
    {spv::Op::OpBitwiseAnd, onBinary, a(Op::And)},
    {spv::Op::OpBitwiseOr, onBinary, a(Op::Or)},
    {spv::Op::OpBitwiseXor, onBinary, a(Op::Xor)},
    {spv::Op::OpShiftLeftLogical, onShift, a(Op::Shl)},
    {spv::Op::OpShiftRightLogical, onShift, a(Op::LShr)},
    {spv::Op::OpShiftRightArithmetic, onShift, a(Op::AShr)},
    {spv::Op::OpBitFieldInsert, onBitFieldInsert},
    {spv::Op::OpBitFieldSExtract, onBitFieldExtract, 1},
    {spv::Op::OpBitFieldUExtract, onBitFieldExtract, 0},
    {spv::Op::OpBitCount, onBitCount},
    {spv::Op::OpIAddCarry, onCarry, 0},
    {spv::Op::OpISubBorrow, onCarry, 1},
    {spv::Op::OpUMulExtended, onMulExtended, 0},
    {spv::Op::OpSMulExtended, onMulExtended, 1},
    {spv::Op::OpLogicalAnd, onBinary, a(Op::MaskAnd)},
    {spv::Op::OpLogicalOr, onBinary, a(Op::MaskOr)},
    {spv::Op::OpLogicalNot, onLogicalNot},
    {spv::Op::OpLogicalEqual, onLogicalEqual, 1},
    {spv::Op::OpLogicalNotEqual, onLogicalEqual, 0},
    {spv::Op::OpAny, onAnyAll, 0},
    {spv::Op::OpAll, onAnyAll, 1},
    {spv::Op::OpSelect, onSelect},
    {spv::Op::OpIsNan, onIsNan},
    {spv::Op::OpIsInf, onIsInf},
    {spv::Op::OpIEqual, onCompare, a(Op::IEq)},
    {spv::Op::OpINotEqual, onCompare, a(Op::INe)},
    {spv::Op::OpULessThan, onCompare, a(Op::ULt)},
    {spv::Op::OpULessThanEqual, onCompare, a(Op::ULe)},
    {spv::Op::OpUGreaterThan, onCompare, a(Op::ULt) | kSwap},
    {spv::Op::OpUGreaterThanEqual, onCompare, a(Op::ULe) | kSwap},
    {spv::Op::OpSLessThan, onCompare, a(Op::SLt)},
    {spv::Op::OpSLessThanEqual, onCompare, a(Op::SLe)},
    {spv::Op::OpSGreaterThan, onCompare, a(Op::SLt) | kSwap},
    {spv::Op::OpSGreaterThanEqual, onCompare, a(Op::SLe) | kSwap},
    {spv::Op::OpFOrdEqual, onCompare, a(Op::FEq)},
    {spv::Op::OpFUnordNotEqual, onCompare, a(Op::FNe)},
    {spv::Op::OpFOrdNotEqual, onOrderedNotEqual, 0},
    {spv::Op::OpFUnordEqual, onOrderedNotEqual, 1},
    {spv::Op::OpFOrdLessThan, onCompare, a(Op::FLt)},
    {spv::Op::OpFOrdLessThanEqual, onCompare, a(Op::FLe)},
    {spv::Op::OpFOrdGreaterThan, onCompare, a(Op::FLt) | kSwap},
    {spv::Op::OpFOrdGreaterThanEqual, onCompare, a(Op::FLe) | kSwap},
    {spv::Op::OpFUnordLessThan, onCompare, a(Op::FLe) | kSwap | kNot},
    {spv::Op::OpFUnordLessThanEqual, onCompare, a(Op::FLt) | kSwap | kNot},
    {spv::Op::OpFUnordGreaterThan, onCompare, a(Op::FLe) | kNot},
    {spv::Op::OpFUnordGreaterThanEqual, onCompare, a(Op::FLt) | kNot},
    {spv::Op::OpConvertFToU, onConvert, a(Op::FToU)},
    {spv::Op::OpConvertFToS, onConvert, a(Op::FToS)},
    {spv::Op::OpConvertSToF, onConvert, a(Op::SToF)},
    {spv::Op::OpConvertUToF, onConvert, a(Op::UToF)},
    {spv::Op::OpUConvert, onConvert, a(Op::ZExt)},
    {spv::Op::OpSConvert, onConvert, a(Op::SExt)},
    {spv::Op::OpFConvert, onConvert, a(Op::FToF)},
    {spv::Op::OpQuantizeToF16, onQuantizeToF16},
    {spv::Op::OpBitcast, onBitcast},
    {spv::Op::OpDot, onDot},
    {spv::Op::OpSDot, onIntegerDot, 3},
    {spv::Op::OpUDot, onIntegerDot, 0},
    {spv::Op::OpSUDot, onIntegerDot, 1},
    {spv::Op::OpSDotAccSat, onIntegerDot, 4 | 3},
    {spv::Op::OpUDotAccSat, onIntegerDot, 4},
    {spv::Op::OpSUDotAccSat, onIntegerDot, 4 | 1},
    {spv::Op::OpVectorTimesScalar, onTimesScalar},
    {spv::Op::OpMatrixTimesScalar, onTimesScalar},
    {spv::Op::OpMatrixTimesVector, onMatrixTimesVector},
    {spv::Op::OpVectorTimesMatrix, onVectorTimesMatrix},
    {spv::Op::OpMatrixTimesMatrix, onMatrixTimesMatrix},
    {spv::Op::OpOuterProduct, onOuterProduct},
    {spv::Op::OpTranspose, onTranspose},
    {spv::Op::OpDPdx, onDerivative, 0},
    {spv::Op::OpDPdy, onDerivative, 1},
    {spv::Op::OpFwidth, onDerivative, 4},
    {spv::Op::OpDPdxFine, onDerivative, 2},
    {spv::Op::OpDPdyFine, onDerivative, 3},
    {spv::Op::OpFwidthFine, onDerivative, 6},
    {spv::Op::OpDPdxCoarse, onDerivative, 0},
    {spv::Op::OpDPdyCoarse, onDerivative, 1},
    {spv::Op::OpFwidthCoarse, onDerivative, 4},
};

}  // namespace

std::span<const HandlerEntry> arithmeticHandlers() { return kHandlers; }

}  // namespace pumice::frontend
