#include "spirv_interp/ir/lower_math.h"

#include <algorithm>
#include <utility>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/one_record.h"
#include "spirv_interp/ir/pass_list.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::ir {

namespace {

Value lowerOne(Builder& b, Op op, Type type, std::span<const Value> v, bool uniform, Numerics numerics,
               AngleCache& cache) {
  if (type == Type::F64) return lowerF64(b, op, v, uniform, cache);
  const bool oracle = numerics == Numerics::Oracle;
  if (type == Type::F32 && !oracle) return lowerF32(b, op, v, uniform, cache);
  // The oracle computes in f64 and rounds nowhere. Half precision is computed in f32, whose error is far
  // below a half's unit, and rounded once.
  const Type wide = oracle ? Type::F64 : Type::F32;
  auto convert = [&](Type to, Value x) {
    if (oracle) b.setInstFlags(kInstKeep);
    const Value r = b.convert(Op::FToF, to, x);
    b.setInstFlags(0);
    return r;
  };
  Value arguments[2] = {};
  for (size_t k = 0; k < v.size(); ++k) arguments[k] = convert(wide, v[k]);
  const Value r = (oracle ? lowerF64 : lowerF32)(b, op, {arguments, v.size()}, uniform, cache);
  return r ? convert(type, r) : 0;
}

bool isHighMath(const Inst& i) {
  const OpInfo& info = opInfo(i.op);
  return (info.flags & kHigh) && info.operands == OperandRule::Float;
}

}  // namespace

namespace {

// One axis of a footprint as texture/filter.cpp has it: the texels' numbers, and the second one's weight.
struct Axis {
  Value index[2], weight;
};
Axis axisOf(Builder& b, Value place, Value extent, bool clamp) {
  const Value scale = b.convert(Op::SToF, Type::F32, extent), x = b.fma(place, scale, b.f32(-0.5f));
  Value floor = b.ffloor(x);
  const Value weight = b.fsub(x, floor), last = b.isub(extent, b.i32(1));
  // Clamped before they are integers, numbers convert without more ado.
  if (clamp) floor = b.fmin(b.fmax(floor, b.f32(-1.0f)), b.fsub(scale, b.f32(1.0f)));
  const Value first = b.convert(Op::FToS, Type::I32, floor), next = b.iadd(first, b.i32(1));
  if (clamp) return {{b.smax(first, b.i32(0)), b.smin(next, last)}, weight};
  // The first may be -1, the second the extent.
  return {{b.umin(first, last), b.umin(next, b.isub(next, extent))}, weight};
}

// level: width, height, row pitch, offset.
Value lowerLevel(Builder& b, std::span<const Value> o, std::span<const Value> level, uint32_t imm) {
  const Axis x = axisOf(b, o[2], level[0], imm & kFilterClampX), y = axisOf(b, o[3], level[1], imm & kFilterClampY);
  Value row[2], column[2];
  for (int k = 0; k < 2; ++k) {
    row[k] = b.iadd(b.imul(y.index[k], level[2]), level[3]);
    column[k] = b.shl(x.index[k], b.i32(2));
  }
  const Value footprint[] = {o[0], o[1], row[0], row[1], column[0], column[1], x.weight, y.weight};
  return lowerFilter(b, Op::FilterBytes, footprint, imm & 3);
}

}  // namespace

Value lowerFilter(Builder& b, Op op, std::span<const Value> o, uint32_t component) {
  if (filtersLevels(op)) {
    const Value first = lowerLevel(b, o, o.subspan(kLevelOperand, 4), component);
    if (op == Op::FilterLevel) return first;
    return b.fma(o[12], b.fsub(lowerLevel(b, o, o.subspan(kLevelOperand + 4, 4), component), first), first);
  }
  const Value base = o[0], size = o[1], one = b.f32(1.0f);
  const bool halves = op == Op::FilterHalves;
  const auto texel = [&](Value row, Value column) {
    const Value element = b.loadConst(halves ? Type::I64 : Type::I32, base, b.iadd(column, row), size);
    if (!halves) return b.convert(Op::SToF, Type::F32, component == 3 ? b.lshr(element, b.i32(24)) : b.and_(element, b.i32(0xffu << 8 * component)));
    const Value word = b.convert(Op::Trunc, Type::I32, component > 1 ? b.lshr(element, b.i64(32)) : element);
    const Value half = b.convert(Op::Trunc, Type::I16, component & 1 ? b.lshr(word, b.i32(16)) : word);
    return b.convert(Op::FToF, Type::F32, b.bitcast(Type::F16, half));
  };
  const auto lerp = [&](Value a, Value c, Value w) { return halves ? b.fma(c, w, b.fmul(a, b.fsub(one, w))) : b.fma(w, b.fsub(c, a), a); };
  Value rows[2];
  for (int r = 0; r < 2; ++r) {
    const Value left = texel(o[2 + r], o[4]);
    rows[r] = lerp(left, texel(o[2 + r], o[5]), o[6]);
  }
  return lerp(rows[0], rows[1], o[7]);
}

namespace {

//! Least and greatest of an i32 without a sign.
std::pair<uint32_t, uint32_t> unsignedLimits(const Function& f, Value x, unsigned depth) {
  const Inst& i = f.insts[x];
  if (i.op == Op::Const) return {uint32_t(i.imm), uint32_t(i.imm)};
  if (!depth || (i.op != Op::UMin && i.op != Op::UMax)) return {0, ~0u};
  const auto a = unsignedLimits(f, f.operands(x)[0], depth - 1), b = unsignedLimits(f, f.operands(x)[1], depth - 1);
  if (i.op == Op::UMin) return {std::min(a.first, b.first), std::min(a.second, b.second)};
  return {std::max(a.first, b.first), std::max(a.second, b.second)};
}

}  // namespace

Limits limitsOf(const Function& f, Value x, unsigned depth) {
  const Inst& i = f.insts[x];
  const auto o = f.operands(x);
  const auto of = [&](size_t k) { return depth ? limitsOf(f, o[k], depth - 1) : Limits(); };
  switch (i.op) {
    case Op::Const: {
      const double c = floatValue(i.type, i.imm);
      return c == c ? Limits{c, c, true} : Limits();
    }
    case Op::SToF:
    case Op::UToF: {
      if (f.type(o[0]) != Type::I32 || i.type == Type::F16) return {};
      const auto [least, most] = unsignedLimits(f, o[0], depth);
      if (i.op == Op::UToF || most <= 0x7fffffff) return {double(least) * (1 - 1e-6), double(most) * (1 + 1e-6), true};
      return {-0x1p31, 0x1p31, true};
    }
    case Op::FToF:
      return typeBytes(i.type) > typeBytes(f.type(o[0])) ? of(0) : Limits();
    case Op::FAbs:
      return {0, HUGE_VAL, of(0).number};
    // A NaN gives the other operand.
    case Op::FMin:
    case Op::FMax: {
      const Limits x = of(0), y = of(1);
      if (!x.number && !y.number) return {};
      if (i.op == Op::FMin)
        return {std::min(x.low, y.low), x.number && y.number ? std::min(x.high, y.high) : x.number ? x.high : y.high, true};
      return {x.number && y.number ? std::max(x.low, y.low) : x.number ? x.low : y.low, std::max(x.high, y.high), true};
    }
    default:
      return isPlaneInUnit(f, x) ? Limits{0, 1, true} : Limits();
  }
}

void lowerMath(Function& f, Numerics numerics, bool keepFilters) {
  computeRates(f);
  const auto changes = [](const Inst& i) { return isHighMath(i) || isFilter(i.op); };
  const auto high = std::ranges::count_if(f.insts, changes);
  if (!high) return;
  Function out = withoutInstructions(f);
  out.insts.reserve(f.insts.size() + size_t(high) * 32);
  out.operandPool.reserve(f.operandPool.size() + size_t(high) * 64);
  Builder b(out);
  AngleCache cache;
  std::vector<Value> map(f.insts.size()), operands;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    const uint8_t flags = opInfo(i.op).flags;
    // What others wrote was tidied up before.
    if ((flags & kPure) && !(flags & kHigh) && i.op != Op::Const && !isFilter(i.op)) {
      map[v] = Value(out.insts.size());
      Inst& copy = out.insts.emplace_back(i);
      copy.rate = Rate::Lane;
      copy.firstOperand = uint32_t(out.operandPool.size());
      for (Value o : f.operands(i)) out.operandPool.push_back(map[o]);
      continue;
    }
    operands.clear();
    for (Value o : f.operands(i)) operands.push_back(map[o]);
    if (flags & kControl) cache = {};
    b.setLine(i.line);
    b.setInstFlags(i.flags);
    if (isHighMath(i)) {
      b.setInstFlags(0);
      const bool uniform = i.rate <= Rate::Draw;
      map[v] = lowerOne(b, i.op, i.type, operands, uniform, numerics, cache);
      if (map[v]) continue;
    }
    if (isFilter(i.op)) {
      const auto o = f.operands(i);
      const Inst& size = f.insts[o[1]];
      // Only where all lanes read one image, each a texel of its own.
      const bool kept = keepFilters && i.rate > Rate::Draw && f.insts[o[0]].rate <= Rate::Draw && size.rate <= Rate::Draw &&
                        !(size.op == Op::Const && size.imm >> 62);
      if (!kept) {
        map[v] = lowerFilter(b, i.op, operands, uint32_t(i.imm));
        continue;
      }
    }
    map[v] = flags & kPure && i.op != Op::Const ? b.append(i.op, i.type, operands, i.imm) : b.emit(i.op, i.type, operands, i.imm);
  }
  f = std::move(out);
  computeRates(f);
}

}  // namespace pumice::ir
