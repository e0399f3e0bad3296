#include <unordered_map>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

bool opens(Op op) { return op == Op::If || op == Op::Loop || op == Op::Block; }
bool closes(Op op) { return op == Op::EndIf || op == Op::EndLoop || op == Op::EndBlock; }
bool hoisted(Op op) { return op == Op::Const || op == Op::Var || op == Op::LocalAlloc; }

//! A function under construction, from pieces of another with other numbers.
struct Writer {
  ir::Function out;
  std::vector<Value> map;  // old -> new

  Value append(const ir::Inst& inst, std::span<const Value> operands) {
    ir::Inst copy = inst;
    copy.firstOperand = uint32_t(out.operandPool.size());
    copy.operandCount = uint32_t(operands.size());
    out.operandPool.insert(out.operandPool.end(), operands.begin(), operands.end());
    out.insts.push_back(copy);
    return Value(out.insts.size() - 1);
  }
  //! Takes over instruction v of `from`.
  void copy(const ir::Function& from, Value v) {
    ir::Inst inst = from.insts[v];
    inst.firstOperand = uint32_t(out.operandPool.size());
    for (Value operand : from.operands(v)) out.operandPool.push_back(map[operand]);
    out.insts.push_back(inst);
    map[v] = Value(out.insts.size() - 1);
  }
};

Writer begin(ir::Function& f) {
  Writer w;
  w.out.name = f.name;
  w.out.sharedBytes = f.sharedBytes;
  w.out.imageOps = f.imageOps;
  w.map.assign(f.insts.size(), 0);
  w.out.insts.reserve(f.insts.size());
  w.out.operandPool.reserve(f.operandPool.size());
  return w;
}

// Constants and variables to the front, blocks without breaks away, breaks that change nothing away.
ir::Function straighten(ir::Function& f) {
  size_t count = f.insts.size();
  std::vector<uint32_t> end(count), breakTarget(count), elseOf(count);
  std::vector<uint8_t> drop(count);
  std::vector<uint32_t> stack;
  for (uint32_t i = 1; i < count; i++) {
    Op op = f.insts[i].op;
    if (opens(op)) {
      stack.push_back(i);
    } else if (closes(op)) {
      if (stack.empty()) fail("markers do not match");
      end[stack.back()] = i;
      end[i] = stack.back();
      if (elseOf[stack.back()]) end[elseOf[stack.back()]] = i;
      stack.pop_back();
    } else if (op == Op::Else) {
      if (stack.empty()) fail("markers do not match");
      elseOf[stack.back()] = i;
    } else if (op == Op::Break) {
      uint64_t left = f.insts[i].imm + 1;
      for (size_t s = stack.size(); s > 0 && left; s--) {
        if (f.insts[stack[s - 1]].op == Op::If) continue;
        if (--left == 0) breakTarget[i] = stack[s - 1];
      }
      if (!breakTarget[i]) fail("a break out of nothing");
    }
  }
  std::vector<uint8_t> used(count);
  for (uint32_t i = 1; i < count; i++) {
    if (f.insts[i].op != Op::Break) continue;
    // Would control get to the end of the target anyway?
    uint32_t target = breakTarget[i], at = i + 1;
    for (;; at++) {
      Op op = f.insts[at].op;
      if (op == Op::Else) at = end[at];
      else if (op == Op::EndBlock && end[at] == target) break;
      else if (op != Op::EndIf && op != Op::EndBlock && op != Op::Nop) {
        at = 0;
        break;
      }
    }
    if (at)
      drop[i] = 1;
    else
      used[target] = 1;
  }
  for (uint32_t i = 1; i < count; i++)
    if (f.insts[i].op == Op::Block && !used[i]) drop[i] = drop[end[i]] = 1;

  Writer w = begin(f);
  std::unordered_map<uint64_t, Value> constants[uint32_t(Type::Tuple) + 1];
  for (uint32_t i = 1; i < count; i++) {
    const ir::Inst& inst = f.insts[i];
    if (!hoisted(inst.op)) continue;
    drop[i] = 1;
    if (inst.op == Op::Const) {
      auto [at, isNew] = constants[uint32_t(inst.type)].try_emplace(inst.imm, 0);
      if (isNew) at->second = w.append(inst, {});
      w.map[i] = at->second;
    } else {
      w.copy(f, i);
    }
  }
  for (uint32_t i = 1; i < count; i++) {
    if (drop[i]) continue;
    Op op = f.insts[i].op;
    w.copy(f, i);
    if (op == Op::Loop || op == Op::Block) stack.push_back(i);
    if (op == Op::EndLoop || op == Op::EndBlock) stack.pop_back();
    if (op == Op::Break) {
      uint64_t k = 0;
      for (size_t s = stack.size(); s > 0 && stack[s - 1] != breakTarget[i]; s--) k++;
      w.out.insts[w.map[i]].imm = k;
    }
  }
  return std::move(w.out);
}

// SPIR-V lets a value be used wherever its definition dominates; after a loop, for instance. What is used
// outside of its region here goes through a variable.
ir::Function mendScopes(ir::Function& f) {
  size_t count = f.insts.size();
  std::vector<uint32_t> region(count);
  std::vector<uint8_t> open{1};
  std::vector<uint32_t> stack{0};
  std::vector<uint8_t> escapes(count);
  bool any = false;
  auto isOpen = [&](Value v) { return open[region[v]] != 0; };
  auto enter = [&] {
    stack.push_back(uint32_t(open.size()));
    open.push_back(1);
  };
  auto exit = [&] {
    open[stack.back()] = 0;
    stack.pop_back();
  };
  auto walk = [&](auto&& atUse) {
    open.assign(1, 1);
    stack.assign(1, 0);
    for (uint32_t i = 1; i < count; i++) {
      Op op = f.insts[i].op;
      if (closes(op)) exit();
      if (op == Op::Else) exit();
      atUse(i);
      region[i] = stack.back();
      if (opens(op) || op == Op::Else) enter();
    }
  };
  walk([&](uint32_t i) {
    for (Value v : f.operands(i)) {
      if (v && !isOpen(v)) {
        if (f.insts[v].type == Type::Tuple) fail("a tuple is used outside of its region");
        escapes[v] = 1;
        any = true;
      }
    }
  });
  if (!any) return std::move(f);

  Writer w = begin(f);
  std::vector<Value> var(count);
  for (uint32_t i = 1; i < count; i++) {
    if (!escapes[i]) continue;
    ir::Inst inst;
    inst.op = Op::Var;
    inst.type = f.insts[i].type;
    var[i] = w.append(inst, {});
  }
  walk([&](uint32_t i) {
    std::vector<Value> operands;
    for (Value v : f.operands(i)) {
      Value to = w.map[v];
      if (v && !isOpen(v)) {
        ir::Inst get;
        get.op = Op::VarGet;
        get.type = f.insts[v].type;
        get.line = f.insts[i].line;
        Value source = var[v];
        to = w.append(get, {&source, 1});
      }
      operands.push_back(to);
    }
    w.map[i] = w.append(f.insts[i], operands);
    if (escapes[i]) {
      ir::Inst set;
      set.op = Op::VarSet;
      set.line = f.insts[i].line;
      Value pair[2] = {var[i], w.map[i]};
      w.append(set, pair);
    }
  });
  return std::move(w.out);
}

}  // namespace

void tidy(ir::Function& f) {
  ir::Function straight = straighten(f);
  f = mendScopes(straight);
}

}  // namespace pumice::frontend
