// What the emitter sees in values beside their operation: that they cannot be NaN, that a user takes them from where their operand
// is, that two loads look at neighbours.
#include <algorithm>
#include <cmath>
#include <memory>

#include "spirv_interp/ir/one_record.h"
#include "spirv_interp/ir/fold.h"
#include "spirv_interp/jit/plan_steps.h"

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

namespace {

//! The column's part of an offset row + (x << shift), 0: it is something else.
Value columnOf(const Function& f, Value offset, Value row, uint64_t shift) {
  const Inst& i = f.insts[offset];
  if (i.op != Op::IAdd || i.type != Type::I32) return 0;
  const auto o = f.operands(offset);
  const Value column = o[0] == row ? o[1] : o[1] == row ? o[0] : 0;
  if (!column || f.insts[column].op != Op::Shl) return 0;
  const Value x = f.operands(column)[0], count = f.operands(column)[1];
  // In blocks the numbers of neighbours differ by more than one: sums there, minima and maxima here.
  return f.insts[count].op == Op::Const && f.insts[count].imm == shift && f.insts[x].op != Op::IAdd ? column : 0;
}
//! A load of neighbours in memory, mostly, from a range that is the same for all lanes.
bool isScattered(const Plan& p, Value v) {
  const Function& f = *p.f;
  const Inst& i = f.insts[v];
  if (i.op != Op::LoadConst || !p.a.needed[v] || p.a.uniform[v] || p.flat[v] || ir::typeBytes(i.type) < 4) return false;
  const auto o = f.operands(v);
  return p.a.uniform[o[0]] && p.a.uniform[o[2]] && !p.a.uniform[o[1]] && !p.flat[o[1]] && !p.shared[o[1]] && f.insts[o[1]].op == Op::IAdd &&
         !(f.insts[o[2]].op == Op::Const && f.insts[o[2]].imm >> 62);
}

}  // namespace

namespace {

//! Zeros whose sign nobody sees: what is made an integer, compared, or clamped to more.
void findSignless(Plan& p) {
  const Function& f = *p.f;
  for (Value v = Value(f.insts.size()); v-- > 1;) {
    if (!p.a.needed[v]) continue;
    const Inst& i = f.insts[v];
    if (i.op == Op::FToS || i.op == Op::FToU || ir::opInfo(i.op).operands == ir::OperandRule::CmpF || (i.op == Op::QuadSwizzle && p.signless[v])) continue;
    const auto o = f.operands(i);
    if (i.op != Op::FMin && i.op != Op::FMax) {
      for (Value x : o) p.signless[x] = 0;
      continue;
    }
    for (size_t k = 0; k < o.size(); k++) {
      const Inst& other = f.insts[o[1 - k]];
      const bool negative = other.imm >> (8 * ir::typeBytes(i.type) - 1) & 1;
      const bool blind = p.signless[v] || (other.op == Op::Const && negative == (i.op == Op::FMin));
      if (!blind) p.signless[o[k]] = 0;
    }
  }
}

}  // namespace

void settleBounded(Plan& p) {
  const Function& f = *p.f;
  p.number.assign(f.insts.size(), 0);
  p.fitsInt.assign(f.insts.size(), 0);
  p.signless.assign(f.insts.size(), 1);
  // All bounds come from these.
  const auto inUnit = [](const Inst& i) { return i.op == Op::QuadLoad && (i.imm & ir::kPlaneInUnit); };
  if (!p.has(Op::FMin) && !p.has(Op::FMax) && !(p.has(Op::QuadLoad) && std::any_of(f.insts.begin(), f.insts.end(), inUnit))) return;
  struct Bounds {
    double low = -HUGE_VAL, high = HUGE_VAL;
    bool number = false;   // no NaN
    bool finite() const { return number && low > -1e30 && high < 1e30; }
  };
  // Most values have none: then `bounded` says so, and nobody looks at `bounds`.
  const std::unique_ptr<Bounds[]> bounds = std::make_unique_for_overwrite<Bounds[]>(f.insts.size());
  std::vector<uint8_t> bounded(f.insts.size(), 0);
  std::vector<Value> choices;   // minima, maxima
  std::vector<uint32_t> most(f.insts.size(), ~0u);   // of unsigned numbers
  static constexpr Bounds kNone;
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    const auto o = f.operands(v);
    if (i.type == Type::I32) {
      switch (i.op) {
        case Op::Const: most[v] = uint32_t(i.imm); break;
        case Op::UMin: most[v] = std::min(most[o[0]], most[o[1]]); break;
        case Op::UMax: most[v] = std::max(most[o[0]], most[o[1]]); break;
        case Op::And: most[v] = std::min(most[o[0]], most[o[1]]); break;
        case Op::LShr: most[v] = f.insts[o[1]].op == Op::Const ? most[o[0]] >> (f.insts[o[1]].imm & 31) : most[o[0]]; break;
        case Op::QuadSwizzle: most[v] = most[o[0]]; break;
        case Op::FToS: {
          constexpr double kRange = 2147483000;
          const Bounds& x = bounded[o[0]] ? bounds[o[0]] : kNone;
          p.fitsInt[v] = f.type(o[0]) == Type::F32 && x.number && x.low > -kRange && x.high < kRange;
          break;
        }
        default: break;
      }
    }
    if (i.op == Op::FMin || i.op == Op::FMax) choices.push_back(v);
    if (i.type != Type::F32) continue;
    switch (i.op) {
      case Op::FAdd:
      case Op::FMul:
        if (!(bounded[o[0]] & bounded[o[1]])) continue;
        break;
      case Op::Select:
        if (!(bounded[o[1]] & bounded[o[2]])) continue;
        break;
      case Op::FMin:
      case Op::FMax:
        if (!(bounded[o[0]] | bounded[o[1]])) continue;
        break;
      case Op::QuadSwizzle:
      case Op::FFloor:
      case Op::FCeil:
      case Op::FTrunc:
      case Op::FRoundEven:
      case Op::FNeg:
        if (!bounded[o[0]]) continue;
        break;
      case Op::Const:
      case Op::SToF:
      case Op::UToF:
      case Op::FSub:
      case Op::Fma:
      case Op::FilterBytes: break;
      default: continue;
    }
    Bounds r;
    const auto b = [&](size_t k) -> const Bounds& { return bounded[o[k]] ? bounds[o[k]] : kNone; };
    const auto sum = [](const Bounds& x, const Bounds& y) { return Bounds{x.low + y.low, x.high + y.high, true}; };
    const auto product = [](const Bounds& x, const Bounds& y) {
      const double p[] = {x.low * y.low, x.low * y.high, x.high * y.low, x.high * y.high};
      return Bounds{*std::min_element(p, p + 4), *std::max_element(p, p + 4), true};
    };
    switch (i.op) {
      case Op::Const:
        if (const double x = ir::floatValue(i.type, i.imm); x == x) r = {x, x, true};
        break;
      // A NaN gives the other operand.
      case Op::FMin:
      case Op::FMax: {
        const Bounds &x = b(0), &y = b(1);
        r.number = x.number || y.number;
        if (i.op == Op::FMin) {
          r.high = x.number && y.number ? std::min(x.high, y.high) : x.number ? x.high : y.high;
          r.low = std::min(x.low, y.low);
        } else {
          r.low = x.number && y.number ? std::max(x.low, y.low) : x.number ? x.low : y.low;
          r.high = std::max(x.high, y.high);
        }
        if (!r.number) r = {};
        break;
      }
      case Op::QuadSwizzle: r = b(0); break;
      case Op::Select: r = {std::min(b(1).low, b(2).low), std::max(b(1).high, b(2).high), b(1).number && b(2).number}; break;
      case Op::FAdd:
        if (b(0).finite() && b(1).finite()) r = sum(b(0), b(1));
        break;
      case Op::SToF:
      case Op::UToF:
        if (f.type(o[0]) == Type::I32 && most[o[0]] <= 0x7fffffff) r = {0, double(most[o[0]]), true};
        break;
      case Op::FSub:
        // A fraction, unless its number is infinite.
        if (f.insts[o[1]].op == Op::FFloor && f.operands(o[1])[0] == o[0]) r = {0, 1, false};
        else if (b(0).finite() && b(1).finite()) r = {b(0).low - b(1).high, b(0).high - b(1).low, true};
        break;
      case Op::FMul:
        if (b(0).finite() && b(1).finite()) r = product(b(0), b(1));
        break;
      case Op::Fma:
        if (ir::isPlaneInUnit(f, v)) r = {0, 1, true};
        else if (b(0).finite() && b(1).finite() && b(2).finite()) r = sum(product(b(0), b(1)), b(2));
        break;
      case Op::FilterBytes: {
        const double most = i.imm == 1 ? 0xff00 : i.imm == 2 ? 0xff0000 : 0xff;
        if (!b(6).finite() || !b(7).finite()) break;
        const Bounds texels{0, most, true}, change{-most, most, true};
        const Bounds row = sum(product(b(6), change), texels);
        r = sum(product(b(7), {row.low - row.high, row.high - row.low, true}), row);
        break;
      }
      case Op::FilterLevel:
      case Op::FilterLevels: {
        // Averages: weights lie in [0, 1] and no sum passes the greater texel, be it rounded.
        const bool inside = b(2).finite() && b(3).finite() && (i.op == Op::FilterLevel || (b(12).number && b(12).low >= 0 && b(12).high <= 1));
        const uint32_t byte = i.imm & 3;
        if (inside) r = {0, byte == 1 ? 65280.0 : byte == 2 ? 16711680.0 : 255.0, true};
        break;
      }
      case Op::FFloor:
      case Op::FCeil:
      case Op::FTrunc:
      case Op::FRoundEven:
        if (b(0).finite()) r = {b(0).low - 1, b(0).high + 1, true};
        break;
      case Op::FNeg:
        if (b(0).finite()) r = {-b(0).high, -b(0).low, true};
        break;
      default: break;
    }
    if (!(r.low > -1e30 && r.high < 1e30)) {
      // Products of such would leave the range; the number alone is still worth knowing.
      if (r.number && i.op != Op::FMin && i.op != Op::FMax && i.op != Op::Const && i.op != Op::QuadSwizzle) r = {};
    } else if (i.op != Op::Const && i.op != Op::FMin && i.op != Op::FMax && i.op != Op::QuadSwizzle) {
      // Roundings.
      r.low -= std::abs(r.low) * 1e-6 + 1e-30;
      r.high += std::abs(r.high) * 1e-6 + 1e-30;
    }
    bounds[v] = r;
    bounded[v] = r.number || r.low > kNone.low || r.high < kNone.high;
    p.number[v] = r.number;
    if (r.number && p.a.nan[v] == interp::NanBits::Arithmetic) p.a.nan[v] = interp::NanBits::Settled;
  }
  // Most are of a constant that wins among zeros anyway, or of what may be NaN: then signs of zeros make no difference.
  const auto dependsOnSign = [&](Value v) {
    const auto o = f.operands(v);
    const Inst &a = f.insts[o[0]], &b = f.insts[o[1]];
    if (a.op != Op::Const && b.op != Op::Const) return p.number[o[0]] || p.number[o[1]];
    const uint64_t bits = (b.op == Op::Const ? b : a).imm;
    const bool negative = bits >> (8 * ir::typeBytes(f.type(v)) - 1) & 1;
    return ir::floatValue(f.type(v), bits) == 0 && negative != (f.insts[v].op == Op::FMin);
  };
  if (std::any_of(choices.begin(), choices.end(), dependsOnSign)) findSignless(p);
}

void findFolded(Plan& p) {
  const Function& f = *p.f;
  p.folded.assign(f.insts.size(), 0);
  if (!p.has(Op::FNeg) && !p.has(Op::LShr) && !(p.has(Op::BitCast) && p.has(Op::Trunc))) return;
  std::vector<uint8_t>& folded = p.folded;
  // Upper words, and halves of words that are made floats: shuffles take them from where they are.
  const auto varies = [&](Value v) { return p.a.needed[v] && !p.a.uniform[v] && !p.flat[v]; };
  const auto stays = [&](Value v) { return varies(v) && f.insts[v].op != Op::VarGet && f.insts[v].op != Op::BitCast; };
  const auto shiftsBy = [&](Value v, uint64_t bits) {
    if (f.insts[v].op != Op::LShr) return false;
    const Inst& count = f.insts[f.operands(v)[1]];
    return count.op == Op::Const && count.imm == bits && varies(v) && stays(f.operands(v)[0]);
  };
  bool any = false;
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    if (i.op == Op::FNeg) {
      if (!p.a.needed[v] || p.a.uniform[v] || i.type == Type::F16) continue;
      const Op of = f.insts[f.operands(v)[0]].op;   // what stands for a variable may change before the fma
      any |= folded[v] = of != Op::VarGet && of != Op::BitCast;
    }
    if (i.op == Op::LShr && i.type == Type::I64) any |= folded[v] = shiftsBy(v, 32);
    if (i.op != Op::BitCast || i.type != Type::F16 || !varies(v)) continue;
    const Value trunc = f.operands(v)[0];
    if (f.insts[trunc].op != Op::Trunc || !varies(trunc)) continue;
    const Value word = f.operands(trunc)[0];
    if (f.type(word) != Type::I32 || !stays(word)) continue;
    any = folded[v] = folded[trunc] = 1;
    folded[word] |= shiftsBy(word, 16);
  }
  if (!any) return;
  const auto takes = [&](Value v, Value o) {
    const Inst& i = f.insts[v];
    if (p.a.uniform[v]) return false;
    switch (f.insts[o].op) {
      case Op::FNeg: return i.op == Op::Fma;
      case Op::BitCast: return i.op == Op::FToF && i.type == Type::F32;
      case Op::Trunc: return i.op == Op::BitCast && folded[v] != 0;
      default: return i.op == Op::Trunc && (f.type(o) == Type::I64 ? i.type == Type::I32 : folded[v] != 0);
    }
  };
  // Users stand behind: whether they are folded is known.
  for (Value v = Value(f.insts.size()); v-- > 1;) {
    if (!p.a.needed[v]) continue;
    for (Value o : f.operands(v))
      if (folded[o] && !takes(v, o)) folded[o] = 0;
  }
}

void findPairs(Plan& p) {
  const Function& f = *p.f;
  p.pairSecond.assign(f.insts.size(), 0);
  p.pairFirst.assign(f.insts.size(), 0);
  if (!p.has(Op::LoadConst)) return;
  Value first = 0;
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    if (first) {
      for (Value o : f.operands(v))
        if (o == first) first = 0;
      if ((ir::opInfo(i.op).flags & (ir::kEffect | ir::kControl)) && i.op != Op::Var) first = 0;
    }
    if (!isScattered(p, v)) continue;
    const auto pairs = [&] {
      const auto a = f.operands(first), b = f.operands(v);
      const Inst& other = f.insts[first];
      if (other.type != i.type || other.imm != i.imm || a[0] != b[0] || a[2] != b[2] || a[1] == b[1]) return false;
      const uint64_t shift = ir::typeBytes(i.type) == 8 ? 3 : 2;
      for (Value row : f.operands(a[1]))
        if (columnOf(f, a[1], row, shift) && columnOf(f, b[1], row, shift)) return true;
      return false;
    };
    if (first && pairs()) {
      p.pairSecond[first] = v;
      p.pairFirst[v] = first;
      first = 0;
    } else {
      first = v;
    }
  }
}

void findCrossed(Plan& p) {
  const Function& f = *p.f;
  p.crossed.assign(f.insts.size(), 0);
  bool any = false;
  for (Value v = 1; v < f.insts.size() && p.has(Op::LoadConst); v++)
    if (f.type(v) == Type::I64 && isScattered(p, v) && f.type(f.operands(v)[1]) == Type::I32) p.crossed[v] = any = true;
  if (!any) return;
  for (Value v = 1; v < f.insts.size(); v++) {
    if (!p.a.needed[v]) continue;
    const bool takesWord = !p.a.uniform[v] && (f.insts[v].op == Op::Trunc || (f.insts[v].op == Op::LShr && p.folded[v]));
    for (Value o : f.operands(v))
      if (!takesWord) p.crossed[o] = 0;
  }
  for (Value v = 1; v < f.insts.size(); v++)
    if (const Value second = p.pairSecond[v]; second && p.crossed[v] != p.crossed[second]) p.crossed[v] = p.crossed[second] = 0;
}

void findFootprints(Plan& p) {
  const Function& f = *p.f;
  if (!p.has(Op::FilterHalves) && !p.has(Op::FilterBytes) && !p.has(Op::FilterLevel) && !p.has(Op::FilterLevels)) return;
  p.footprint.assign(f.insts.size(), 0);
  Value before = 0;
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    if (!p.a.needed[v] || p.a.uniform[v]) continue;
    if (ir::isFilter(i.op)) {
      const auto o = f.operands(v), other = f.operands(before);
      const bool more = before && f.insts[before].op == i.op && f.insts[before].imm >> 2 == i.imm >> 2 && std::equal(o.begin(), o.end(), other.begin());
      p.footprint[v] = more ? p.footprint[before] : v;
    }
    before = ir::isFilter(i.op) ? v : 0;
  }
}

}  // namespace pumice::jit
