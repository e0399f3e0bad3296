#include "spirv_interp/jit/quads.h"

#include <algorithm>

namespace pumice::jit {

using ir::Function, ir::Inst, ir::Op, ir::OperandRule, ir::Type, ir::Value;

namespace {

bool isWord(Type t) { return t == Type::F32 || t == Type::I32 || t == Type::Mask; }
bool isCoarse(const Inst& i) { return (i.op == Op::QuadDdx || i.op == Op::QuadDdy) && i.type == Type::F32 && i.imm == 0; }

//! By what its operands are.
bool mayBeShared(const Function& f, Value v, const std::vector<uint8_t>& uniform, const std::vector<uint8_t>& shared) {
  const Inst& i = f.insts[v];
  if (!isWord(i.type) || uniform[v]) return false;
  if (isCoarse(i)) return true;
  const auto o = f.operands(v);
  if (i.op == Op::LoadConst)
    return i.type != Type::Mask && uniform[o[0]] && uniform[o[2]] && shared[o[1]] && !(f.insts[o[2]].op == Op::Const && f.insts[o[2]].imm >> 62);
  const ir::OpInfo& info = ir::opInfo(i.op);
  if (!(info.flags & ir::kPure) || info.operands == OperandRule::Free || i.flags & ir::kInstVolatile) return false;
  bool any = false;
  for (Value x : o) {
    any |= shared[x] != 0;
    if (!isWord(f.type(x)) || !(shared[x] || uniform[x])) return false;
  }
  return any;
}

//! One instruction, hardly dearer for each part than to spread its result.
bool isCheap(Op op) {
  switch (op) {
    case Op::SToF:
    case Op::IAdd:
    case Op::ISub:
    case Op::FAdd:
    case Op::FSub:
    case Op::FMul:
    case Op::FLt:
    case Op::FLe:
    case Op::Shl: return true;
    default: return false;
  }
}

//! Operand k of an operation that itself takes its lanes' quad's.
bool takesShared(Op op, uint32_t k) { return ir::filtersLevels(op) && k >= ir::kLevelOperand; }

}  // namespace

std::vector<uint8_t> findShared(const Function& f, const std::vector<uint8_t>& uniform) {
  std::vector<uint8_t> shared(f.insts.size(), 0);
  for (Value v = 1; v < f.insts.size(); v++) shared[v] = mayBeShared(f, v, uniform, shared);
  for (Value v = 1; v < f.insts.size(); v++) {
    if (shared[v] || f.insts[v].op == Op::QuadSwizzle) continue;
    const auto o = f.operands(v);
    for (uint32_t k = 0; k < o.size(); k++)
      if (shared[o[k]] && !takesShared(f.insts[v].op, k)) return std::vector<uint8_t>(f.insts.size(), 0);
  }
  return shared;
}

void shareAmongQuads(Function& f) {
  if (std::ranges::none_of(f.insts, isCoarse)) return;
  const Value count = Value(f.insts.size());
  std::vector<uint8_t> uniform(count, 0), shared(count, 0);
  for (Value v = 1; v < count; v++) {
    const Inst& i = f.insts[v];
    uniform[v] = i.rate <= ir::Rate::Draw && (ir::opInfo(i.op).flags & ir::kPure);
    shared[v] = mayBeShared(f, v, uniform, shared);
  }
  // Who looks at each, and in which stretch of straight code it stands.
  std::vector<uint8_t> byLane(count, 0), byQuad(count, 0);
  std::vector<uint32_t> stretch(count, 0);
  for (Value v = 1; v < count; v++) {
    stretch[v] = stretch[v - 1] + ((ir::opInfo(f.insts[v].op).flags & ir::kControl) || f.insts[v].op == Op::Barrier);
    const auto o = f.operands(v);
    for (uint32_t k = 0; k < o.size(); k++) (shared[v] || takesShared(f.insts[v].op, k) ? byQuad : byLane)[o[k]] = 1;
  }
  // What is as cheap by lane stays so, if its operands are spread anyway.
  for (Value v = 1; v < count; v++) {
    if (!shared[v] || byQuad[v]) continue;
    const auto o = f.operands(v);
    const bool cheap = isCoarse(f.insts[v]) || (isCheap(f.insts[v].op) && std::ranges::all_of(o, [&](Value x) { return uniform[x] || byLane[x]; }));
    if (!cheap) continue;
    shared[v] = 0;
    for (Value x : o) byLane[x] = 1;
  }
  // Spread before the first who looks by lane, if that is in the same stretch.
  std::vector<Value> renamed(count, 0), spread(count, 0);
  std::vector<Inst> insts{f.insts[0]};
  insts.reserve(count + count / 8);
  f.operandPool.reserve(f.operandPool.size() + count);   // operands are being looked at while further ones come
  const auto spreadNow = [&](Value x) {
    Inst i;
    i.op = Op::QuadSwizzle;
    i.type = f.insts[x].type;
    i.line = f.insts[x].line;
    i.firstOperand = uint32_t(f.operandPool.size());
    i.operandCount = 1;
    f.operandPool.push_back(renamed[x]);
    spread[x] = Value(insts.size());
    insts.push_back(i);
  };
  std::vector<Value> waiting;
  for (Value v = 1; v < count; v++) {
    const Inst& i = f.insts[v];
    if (!shared[v])
      for (uint32_t k = 0; k < i.operandCount; k++)
        if (const Value o = f.operandPool[i.firstOperand + k]; shared[o] && !spread[o] && !takesShared(i.op, k)) spreadNow(o);
    if (stretch[v] != stretch[v - 1]) {
      for (Value x : waiting)
        if (!spread[x]) spreadNow(x);
      waiting.clear();
    }
    for (uint32_t k = 0; k < i.operandCount; k++) {
      Value& o = f.operandPool[i.firstOperand + k];
      o = !shared[v] && shared[o] && !takesShared(i.op, k) ? spread[o] : renamed[o];
    }
    renamed[v] = Value(insts.size());
    insts.push_back(i);
    if (shared[v] && byLane[v]) waiting.push_back(v);   // not all of those who look may come in this stretch
  }
  f.insts = std::move(insts);
}

}  // namespace pumice::jit
