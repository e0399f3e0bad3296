#include "spirv_interp/jit/invariants.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/lower_math.h"
#include "spirv_interp/ir/pass_list.h"

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::OperandRule, ir::Type, ir::Value;

namespace {

bool isZero(const Function& f, Value v) {
  return f.insts[v].op == Op::Const && ir::isFloat(f.type(v)) && ir::floatValue(f.type(v), f.insts[v].imm) == 0;
}

//! By value: whoever takes it multiplies it and adds something else than 0, so that nobody sees whether it is +0 or -0.
std::vector<uint8_t> unseenSigns(const Function& f) {
  std::vector<uint8_t> unseen(f.insts.size(), 1);
  for (Value v = 1; v < f.insts.size(); v++) {
    const auto o = f.operands(v);
    const bool product = f.insts[v].op == Op::Fma && f.insts[o[2]].op == Op::Const && !isZero(f, o[2]);
    for (size_t k = 0; k < o.size(); k++)
      if (!product || k == 2) unseen[o[k]] = 0;
  }
  return unseen;
}

//! By local.alloc: a table of constants that is written anew each time before it is looked into, as `const float w[] = ...` is.
std::vector<uint8_t> constantTables(const Function& f) {
  std::vector<uint8_t> table(f.insts.size(), 0);
  std::vector<Value> last(f.insts.size(), 0), end(f.insts.size(), 0), open{0};   // by local.alloc: its last store, the end of the region
  const std::vector<Value> ends = ir::regionEnds(f);
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    const auto o = f.operands(v);
    if (i.op == Op::EndIf || i.op == Op::EndLoop || i.op == Op::EndBlock) open.pop_back();
    else if (i.op == Op::Else) open.back() = v;
    else if (ends[v]) open.push_back(v);
    if (i.op == Op::LocalAlloc) {
      table[v] = 1;
    } else if (i.op == Op::LocalStore) {
      const Value region = open.back(), regionEnd = region ? ends[region] : Value(f.insts.size());
      table[o[0]] &= f.insts[o[1]].op == Op::Const && f.insts[o[2]].op == Op::Const && (!last[o[0]] || end[o[0]] == regionEnd);
      last[o[0]] = v;
      end[o[0]] = regionEnd;
    }
  }
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    const auto o = f.operands(v);
    for (size_t k = 0; k < o.size(); k++)
      if (f.insts[o[k]].op == Op::LocalAlloc && i.op != Op::LocalStore && (i.op != Op::LocalLoad || k || v < last[o[k]] || v > end[o[k]])) table[o[k]] = 0;
  }
  return table;
}

//! A table so short that comparing is quicker than looking.
struct ShortTable {
  static constexpr size_t kMost = 8;
  bool chosen = false;
  std::vector<std::pair<uint64_t, uint64_t>> entries;   //!< byte offset, bits of the word there
};

//! By local.alloc. Words, looked for at multiples of four.
std::vector<ShortTable> shortTables(const Function& f, const std::vector<uint8_t>& constant) {
  std::vector<ShortTable> tables(f.insts.size());
  for (Value v = 1; v < f.insts.size(); v++) tables[v].chosen = f.insts[v].op == Op::LocalAlloc && constant[v];
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    if (i.op != Op::LocalStore && i.op != Op::LocalLoad) continue;
    const auto o = f.operands(v);
    ShortTable& t = tables[o[0]];
    const Inst& offset = f.insts[o[1]];
    if (i.op == Op::LocalStore) {
      const Inst& value = f.insts[o[2]];
      const uint64_t at = uint32_t(offset.imm) + i.imm;
      t.chosen &= ir::typeBytes(value.type) == 4 && at % 4 == 0 && at + 4 <= f.insts[o[0]].imm && t.entries.size() < ShortTable::kMost;
      t.entries.push_back({at, value.imm});
    } else {
      const bool words = offset.op == Op::Const ? offset.imm % 4 == 0
                                                : offset.op == Op::Shl && f.insts[f.operands(o[1])[1]].op == Op::Const && (f.insts[f.operands(o[1])[1]].imm & 31) >= 2;
      t.chosen &= ir::typeBytes(i.type) == 4 && words && i.imm % 4 == 0;
    }
  }
  return tables;
}

//! 0 / x = 0 for an x above 0, and 0 * x + y = y; words of short tables are chosen.
void simplify(Function& f) {
  // Most have neither: they are not made anew.
  if (std::none_of(f.insts.begin(), f.insts.end(), [&](const Inst& i) {
        const auto o = f.operands(i);
        return i.op == Op::LocalAlloc || (i.op == Op::FDiv && isZero(f, o[0])) || (i.op == Op::Fma && (isZero(f, o[0]) || isZero(f, o[1])));
      }))
    return;
  const std::vector<uint8_t> unseen = unseenSigns(f);
  const std::vector<ShortTable> tables = shortTables(f, constantTables(f));
  Function out = ir::withoutInstructions(f);
  ir::Builder b(out);
  std::vector<Value> map(f.insts.size()), operands;
  const auto isFinite = [&](Value v) {
    const ir::Limits l = ir::limitsOf(out, v);
    return l.number && l.low > -HUGE_VAL && l.high < HUGE_VAL;
  };
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    operands.clear();
    for (Value o : f.operands(v)) operands.push_back(map[o]);
    b.setLine(i.line);
    b.setInstFlags(i.flags);
    if (tables[v].chosen || (i.op == Op::LocalStore && tables[f.operands(v)[0]].chosen)) continue;
    if (i.op == Op::LocalLoad && tables[f.operands(v)[0]].chosen) {
      b.setInstFlags(0);
      Value word = b.zero(i.type);
      for (const auto& [at, bits] : tables[f.operands(v)[0]].entries)
        if (at >= i.imm) word = b.select(b.ieq(operands[1], b.i32(uint32_t(at - i.imm))), b.constant(i.type, bits), word);
      map[v] = word;
      continue;
    }
    if (i.op == Op::FDiv && isZero(out, operands[0]) && !out.insts[operands[0]].imm) {
      const ir::Limits l = ir::limitsOf(out, operands[1]);
      if (l.number && l.low > 0) {
        map[v] = operands[0];
        continue;
      }
    }
    // An addend that is the result of arithmetic: its NaN is whatever a NaN of the sum would be.
    if (i.op == Op::Fma && unseen[v] && ir::opInfo(out.insts[operands[2]].op).operands == OperandRule::Float &&
        ((isZero(out, operands[0]) && isFinite(operands[1])) || (isZero(out, operands[1]) && isFinite(operands[0])))) {
      map[v] = operands[2];
      continue;
    }
    map[v] = b.emit(i.op, i.type, operands, i.imm);
  }
  f = std::move(out);
}

bool isArithmetic(const Inst& i) {
  const ir::OpInfo& info = ir::opInfo(i.op);
  return i.op == Op::Const || ((info.flags & ir::kPure) && info.operands != OperandRule::Free);
}

}  // namespace

bool hoistInvariants(Function& f) {
  if (std::none_of(f.insts.begin(), f.insts.end(), [](const Inst& i) { return i.op == Op::Loop || i.op == Op::LocalAlloc; })) return false;
  simplify(f);

  const Value count = Value(f.insts.size());
  const std::vector<uint8_t> table = constantTables(f);
  struct Open {
    Value marker = 0, loop = 0;   // the innermost loop from here on, 0: none
  };
  std::vector<Open> open{{}};
  std::vector<Value> home(count, 0);     // by value: the innermost loop in which it is computed now
  std::vector<Value> outer(count, 0);    // by loop: the loop around it
  std::vector<uint8_t> direct(count, 0); // by loop: nothing but that loop is between them
  std::vector<std::vector<Value>> before(count);   // by loop
  std::vector<uint8_t> moved(count, 0);
  const auto isWithin = [&](Value inner, Value loop) {
    while (inner && inner != loop) inner = outer[inner];
    return inner == loop;
  };
  bool any = false;
  for (Value v = 1; v < count; v++) {
    const Inst& i = f.insts[v];
    switch (i.op) {
      case Op::Loop:
        outer[v] = open.back().loop;
        direct[v] = open.back().marker == open.back().loop;
        open.push_back({v, v});
        continue;
      case Op::If:
      case Op::Block:
        open.push_back({v, open.back().loop});
        continue;
      case Op::Else:
        open.back().marker = v;
        continue;
      case Op::EndIf:
      case Op::EndBlock:
      case Op::EndLoop:
        open.pop_back();
        continue;
      default: break;
    }
    home[v] = open.back().loop;
    if (!home[v] || open.back().marker != home[v]) continue;
    if (!isArithmetic(i) && !(i.op == Op::LocalStore && table[f.operands(v)[0]])) continue;
    Value target = 0;
    while (home[v]) {
      const auto o = f.operands(v);
      if (!std::all_of(o.begin(), o.end(), [&](Value x) { return f.insts[x].op != Op::Var && !isWithin(home[x], home[v]); })) break;
      target = home[v];
      home[v] = outer[target];
      if (!direct[target]) break;
    }
    if (!target) continue;
    before[target].push_back(v);
    moved[v] = any = true;
  }
  if (!any) return true;

  std::vector<Value> renamed(count, 0);
  std::vector<Inst> insts{f.insts[0]};
  insts.reserve(count);
  const auto place = [&](Value v) {
    renamed[v] = Value(insts.size());
    insts.push_back(f.insts[v]);
  };
  for (Value v = 1; v < count; v++) {
    for (Value w : before[v]) place(w);
    if (!moved[v]) place(v);
  }
  f.insts = std::move(insts);
  for (Value& o : f.operandPool) o = renamed[o];
  return true;
}

}  // namespace pumice::jit
