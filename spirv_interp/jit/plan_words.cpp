// Neighbouring words that one access takes together: the components of a vector, the fields of a record.
#include "spirv_interp/jit/plan_steps.h"

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

namespace {

bool isStore(Op op) { return op == Op::Store || op == Op::SharedStore; }
bool isShared(Op op) { return op == Op::SharedLoad || op == Op::SharedStore; }

//! Records follow one another; words that follow one another along the lanes are vectors already.
bool holdsRecords(const Plan& p, const Inst& i, Value offset) {
  const Function& f = *p.f;
  if (const uint32_t k = patternOf(i)) {
    const LanePattern& q = p.patterns[k - 1];
    const int32_t step = q.bytes(1) - q.bytes(0);
    return step >= 12 || step <= -12;
  }
  const auto o = f.operands(offset);
  const auto constant = [&](Value v) { return f.insts[v].op == Op::Const ? f.insts[v].imm : 0; };
  if (f.insts[offset].op == Op::Shl) return constant(o[1]) >= 4;
  if (f.insts[offset].op == Op::IMul) return constant(o[0]) >= 12 || constant(o[1]) >= 12;
  return false;
}

bool mayLead(const Plan& p, Value v) {
  const Function& f = *p.f;
  const Inst& i = f.insts[v];
  if (i.op != Op::Load && i.op != Op::LoadConst && !isStore(i.op) && i.op != Op::SharedLoad) return false;
  if (!p.a.needed[v] || p.a.uniform[v] || p.flat[v] || p.shared[v] || (i.flags & ir::kInstVolatile) || p.pairFirst[v] || p.pairSecond[v]) return false;
  const auto o = f.operands(v);
  if (!isShared(i.op) && (!p.a.uniform[o[0]] || !p.a.uniform[o[2]] || (f.insts[o[2]].op == Op::Const && f.insts[o[2]].imm >> 62))) return false;
  const Value offset = o[offsetOperand(i.op)];
  if (f.type(offset) != Type::I32 || (!patternOf(i) && (p.a.uniform[offset] || p.flat[offset]))) return false;
  return holdsRecords(p, i, offset);
}

uint32_t bytesOf(const Function& f, Value v) {
  const Inst& i = f.insts[v];
  return ir::typeBytes(isStore(i.op) ? f.type(f.operands(v).back()) : i.type);
}

}  // namespace

void findWords(Plan& p) {
  constexpr Value kFar = 32;
  const Function& f = *p.f;
  p.wordsOf.assign(f.insts.size(), 0);
  if (!p.has(Op::Load) && !p.has(Op::LoadConst) && !p.has(Op::SharedLoad) && !p.has(Op::Store) && !p.has(Op::SharedStore)) return;
  for (Value v = 1; v < f.insts.size(); v++) {
    if (p.wordsOf[v] || !mayLead(p, v) || bytesOf(f, v) != 4) continue;
    const Inst& first = f.insts[v];
    const auto o = f.operands(v);
    Words w;
    w.member[0] = v;
    w.count = 1;
    for (Value next = v + 1; next < f.insts.size() && next < v + kFar && w.count < 4; next++) {
      const Inst& i = f.insts[next];
      const auto operands = f.operands(next);
      const size_t alike = isStore(i.op) ? operands.size() - 1 : operands.size();
      if (i.op == first.op && i.imm == first.imm + 4 * w.count && uint32_t(i.imm) >= uint32_t(first.imm) && i.flags == first.flags && p.a.needed[next] &&
          bytesOf(f, next) == 4 && std::equal(operands.begin(), operands.begin() + ptrdiff_t(alike), o.begin())) {
        w.member[w.count++] = next;
        continue;
      }
      const uint8_t flags = ir::opInfo(i.op).flags;
      if ((flags & (ir::kEffect | ir::kControl)) || (isStore(first.op) && (flags & ir::kRead))) break;
    }
    if (w.count < (isStore(first.op) ? 4u : 3u)) continue;
    w.at = isStore(first.op) ? w.member[w.count - 1] : v;
    p.words.push_back(w);
    for (uint32_t k = 0; k < w.count; k++) p.wordsOf[w.member[k]] = uint32_t(p.words.size());
  }
}

}  // namespace pumice::jit
