// Structured control flow to markers.
//
// A chain of blocks is translated one after the other up to its `fallthrough`: the label where control gets to
// when the region that is being written simply ends. Branches to the label of an enclosing construct (merge
// block, continue target, later case of a switch) are breaks. Each construct gets a block marker for them;
// those that nothing breaks out of are taken away in the end (tidy.cpp).
//
//   selection   block { if c { .. } else { .. } }                   break = branch to the merge block
//   loop        loop { block { body } block { continue part } }     break of the first block = continue
//   switch      block { if m0 { block { case 0 } } if m1 { .. } }   fall-through = set m1, break of the block of case 0
//   function    block { .. }                                        break = return
//   shader      block { block { .. } outputs }                      break of the outer block = terminated
//
// Phi values go through variables that are set on each edge.
#include <algorithm>
#include <queue>

#include "spirv_interp/frontend/translator.h"
#include "spirv_interp/ir/checks.h"
#include "spirv_interp/ir/debug_print.h"

namespace pumice::frontend {

namespace {

constexpr uint32_t kFunctionEnd = 0;  // the "label" that a function's chain falls through to; never a label

}  // namespace

const BasicBlock& Translator::block(uint32_t label) {
  const FunctionBody& function = *frame().function;
  auto at = function.blockOfLabel.find(label);
  if (at == function.blockOfLabel.end()) fail("a branch to %u, which is not a block of the function", label);
  return function.blocks[at->second];
}

std::vector<Value>& Translator::phiVars(const Instruction& phi) {
  auto [at, isNew] = frame().phis.try_emplace(phi.result);
  if (isNew) {
    std::vector<Type> types;
    flatten(phi.resultType, types);
    for (Type t : types) at->second.push_back(b.var(t));
  }
  return at->second;
}

bool Translator::hasPhis(uint32_t label) {
  if (label == kFunctionEnd) return false;
  const BasicBlock& target = block(label);
  return target.first < target.end && module.instructions[target.first].op == spv::Op::OpPhi;
}

void Translator::edge(uint32_t from, uint32_t to) {
  if (!hasPhis(to)) return;
  const BasicBlock& target = block(to);
  // All sources are read before any variable is set.
  std::vector<std::pair<Value, Value>> sets;
  for (uint32_t i = target.first; i < target.end; i++) {
    const Instruction& phi = module.instructions[i];
    if (phi.op != spv::Op::OpPhi) break;
    std::vector<Value>& vars = phiVars(phi);
    for (size_t pair = 0; pair + 1 < phi.count(); pair += 2) {
      if (phi.operand(pair + 1) != from) continue;
      const std::vector<Value>& values = data(phi.operand(pair));
      if (values.size() != vars.size()) fail("OpPhi with operands of different sizes");
      for (size_t k = 0; k < vars.size(); k++) {
        if (b.type(vars[k]) != b.type(values[k])) fail("OpPhi with operands of different types");
        sets.emplace_back(vars[k], values[k]);
      }
      break;
    }
  }
  for (auto [var, value] : sets) b.set(var, value);
}

const Translator::Target* Translator::findTarget(uint32_t label) const {
  for (size_t i = targets_.size(); i > frames_.back().targetBase; i--)
    if (targets_[i - 1].label == label) return &targets_[i - 1];
  return nullptr;
}

void Translator::leave(const Target& target) {
  if (target.enter) b.set(target.enter, b.mask(true));
  b.breakOut(b.breakDepth() - 1 - target.depth);
}

void Translator::terminate() { b.breakOut(b.breakDepth() - 1 - exitDepth_); }

void Translator::branch(uint32_t from, uint32_t to, uint32_t fallthrough) {
  edge(from, to);
  if (to == fallthrough) return;
  if (const Target* target = findTarget(to))
    leave(*target);
  else
    chain(to, fallthrough);
}

void Translator::conditional(Value condition, uint32_t from, uint32_t whenTrue, uint32_t whenFalse,
                             uint32_t fallthrough) {
  bool trueCode = whenTrue != fallthrough || hasPhis(whenTrue);
  bool falseCode = whenFalse != fallthrough || hasPhis(whenFalse);
  if (!trueCode && !falseCode) return;
  b.beginIf(trueCode ? condition : b.maskNot(condition));
  if (trueCode) branch(from, whenTrue, fallthrough);
  if (falseCode) {
    if (trueCode) b.beginElse();
    branch(from, whenFalse, fallthrough);
  }
  b.endIf();
}

void Translator::chain(uint32_t label, uint32_t fallthrough, bool insideLoop) {
  if (++nesting_ > kMaxNesting) fail("control flow is nested too deeply");
  for (;;) {
    const BasicBlock& current = block(label);
    uint32_t next = 0;
    if (current.continueTarget && !insideLoop) {
      loopConstruct(current);
      next = current.merge;
    } else {
      insideLoop = false;
      if (!frame().visited.insert(label).second) fail("control flow is not structured at block %u", label);
      blockInstructions(current);
      const Instruction& end = module.instructions[current.end - 1];
      b.setLine(end.line);
      bool selection = current.merge && !current.continueTarget;
      switch (end.op) {
        case spv::Op::OpBranch:
          next = end.operand(0);
          edge(label, next);
          break;
        case spv::Op::OpBranchConditional: {
          Value condition = scalar(end.operand(0));
          uint32_t whenTrue = end.operand(1), whenFalse = end.operand(2);
          if (whenTrue == whenFalse) {
            edge(label, whenTrue);
            next = selection && whenTrue == current.merge ? current.merge : whenTrue;
            break;
          }
          if (selection) {
            targets_.push_back({current.merge, b.breakDepth()});
            b.beginBlock();
            conditional(condition, label, whenTrue, whenFalse, current.merge);
            b.endBlock();
            targets_.pop_back();
            next = current.merge;
            break;
          }
          const Target* trueTarget = whenTrue == fallthrough ? nullptr : findTarget(whenTrue);
          const Target* falseTarget = whenFalse == fallthrough ? nullptr : findTarget(whenFalse);
          if (!trueTarget && !falseTarget) {
            conditional(condition, label, whenTrue, whenFalse, fallthrough);
            nesting_--;
            return;
          }
          b.beginIf(trueTarget ? condition : b.maskNot(condition));
          edge(label, trueTarget ? whenTrue : whenFalse);
          leave(trueTarget ? *trueTarget : *falseTarget);
          b.endIf();
          next = trueTarget ? whenFalse : whenTrue;
          edge(label, next);
          break;
        }
        case spv::Op::OpSwitch:
          switchConstruct(current, end);
          next = current.merge;
          break;
        case spv::Op::OpReturnValue: {
          const std::vector<Value>& values = data(end.operand(0));
          if (values.size() != frame().returnVars.size()) fail("a return value of the wrong size");
          for (size_t i = 0; i < values.size(); i++) {
            if (b.type(values[i]) != b.type(frame().returnVars[i])) fail("a return value of the wrong type");
            b.set(frame().returnVars[i], values[i]);
          }
          [[fallthrough]];
        }
        case spv::Op::OpReturn:
          b.breakOut(b.breakDepth() - 1 - frame().returnDepth);
          nesting_--;
          return;
        case spv::Op::OpKill:
        case spv::Op::OpTerminateInvocation:
          b.emit(Op::Demote, Type::None, {});
          terminate();
          nesting_--;
          return;
        case spv::Op::OpUnreachable:
          terminate();
          nesting_--;
          return;
        default: fail("block %u ends with %s", label, opcodeName(end.op).c_str());
      }
    }
    if (next == fallthrough) break;
    if (const Target* target = findTarget(next)) {
      leave(*target);
      break;
    }
    label = next;
  }
  nesting_--;
}

void Translator::loopConstruct(const BasicBlock& header) {
  targets_.push_back({header.merge, b.breakDepth()});
  b.beginLoop();
  targets_.push_back({header.continueTarget, b.breakDepth()});
  b.beginBlock();
  chain(header.label, header.continueTarget, true);
  b.endBlock();
  targets_.pop_back();
  if (header.continueTarget != header.label) {
    targets_.push_back({header.label, b.breakDepth()});
    b.beginBlock();
    chain(header.continueTarget, header.label);
    b.endBlock();
    targets_.pop_back();
  }
  b.endLoop();
  targets_.pop_back();
}

std::vector<uint32_t> Translator::successors(const BasicBlock& from) const {
  const Instruction& end = module.instructions[from.end - 1];
  switch (end.op) {
    case spv::Op::OpBranch: return {end.operand(0)};
    case spv::Op::OpBranchConditional: return {end.operand(1), end.operand(2)};
    case spv::Op::OpSwitch: {
      std::vector<uint32_t> labels{end.operand(1)};
      // Literals have as many words as the selector's type. The selector itself may not be translated yet.
      const Instruction* selector = module.definition(end.operand(0));
      size_t words = selector && selector->resultType && type(selector->resultType).scalar == Type::I64 ? 2 : 1;
      for (size_t i = 2 + words; i < end.count(); i += words + 1) labels.push_back(end.operand(i));
      return labels;
    }
    default: return {};
  }
}

// The cases in an order in which each comes before those it falls through to; `entered` gets the latter.
std::vector<uint32_t> Translator::switchOrder(const std::vector<uint32_t>& targets, uint32_t merge,
                                              std::set<uint32_t>& entered) {
  std::unordered_map<uint32_t, size_t> number;
  for (size_t i = 0; i < targets.size(); i++) number[targets[i]] = i;
  std::vector<std::vector<size_t>> follow(targets.size());
  std::vector<size_t> incoming(targets.size());
  uint64_t steps = 0;
  for (size_t i = 0; i < targets.size(); i++) {
    std::unordered_set<uint32_t> seen{targets[i]};
    std::vector<uint32_t> work{targets[i]};
    while (!work.empty()) {
      uint32_t label = work.back();
      work.pop_back();
      if (++steps > kMaxInstructions) fail("the cases of a switch are too entangled");
      const BasicBlock& current = block(label);
      // What is declared counts as well as what is branched to: the code behind a loop that never ends is
      // translated, so what that falls through to must still be to come.
      std::vector<uint32_t> next = successors(current);
      next.insert(next.end(), {current.merge, current.continueTarget});
      for (uint32_t to : next) {
        if (to == merge || to == 0 || findTarget(to) || !frame().function->blockOfLabel.count(to)) continue;
        if (!seen.insert(to).second) continue;
        auto other = number.find(to);
        if (other == number.end()) {
          work.push_back(to);
        } else {
          follow[i].push_back(other->second);
          incoming[other->second]++;
          entered.insert(to);
        }
      }
    }
  }
  std::priority_queue<size_t, std::vector<size_t>, std::greater<>> ready;
  for (size_t i = 0; i < targets.size(); i++)
    if (incoming[i] == 0) ready.push(i);
  std::vector<uint32_t> order;
  while (!ready.empty()) {
    size_t i = ready.top();
    ready.pop();
    order.push_back(targets[i]);
    for (size_t to : follow[i])
      if (--incoming[to] == 0) ready.push(to);
  }
  if (order.size() != targets.size()) fail("the cases of a switch fall through in a circle");
  return order;
}

void Translator::switchConstruct(const BasicBlock& header, const Instruction& end) {
  if (!header.merge || header.continueTarget) fail("OpSwitch without OpSelectionMerge");
  Value selector = scalar(end.operand(0));
  Type type = b.type(selector);
  if (!ir::isInt(type)) fail("OpSwitch on something other than an integer");
  size_t words = type == Type::I64 ? 2 : 1;
  uint64_t typeMask = type == Type::I64 ? ~uint64_t(0) : (uint64_t(1) << 8 * ir::typeBytes(type)) - 1;

  // Lanes that go to each label.
  uint32_t fallback = end.operand(1);
  std::vector<uint32_t> labels;
  std::unordered_map<uint32_t, Value> goes;
  Value any = 0;
  for (size_t i = 2; i + words < end.count(); i += words + 1) {
    uint64_t literal = end.operand(i);
    if (words == 2) literal |= uint64_t(end.operand(i + 1)) << 32;
    Value equal = b.ieq(selector, b.constant(type, literal & typeMask));
    any = any ? b.maskOr(any, equal) : equal;
    uint32_t label = end.operand(i + words);
    auto [at, isNew] = goes.try_emplace(label, equal);
    if (isNew)
      labels.push_back(label);
    else
      at->second = b.maskOr(at->second, equal);
  }
  Value none = any ? b.maskNot(any) : b.mask(true);
  auto [at, isNew] = goes.try_emplace(fallback, none);
  if (isNew)
    labels.push_back(fallback);
  else
    at->second = b.maskOr(at->second, none);

  targets_.push_back({header.merge, b.breakDepth()});
  b.beginBlock();

  // Edges, and labels that are outside.
  std::vector<uint32_t> cases;
  std::vector<uint32_t> outside;
  for (uint32_t label : labels) {
    if (label == header.merge) {
      if (hasPhis(label)) {
        b.beginIf(goes[label]);
        edge(header.label, label);
        b.endIf();
      }
    } else if (findTarget(label)) {
      outside.push_back(label);
    } else {
      cases.push_back(label);
      if (hasPhis(label)) {
        b.beginIf(goes[label]);
        edge(header.label, label);
        b.endIf();
      }
    }
  }
  std::set<uint32_t> entered;
  std::vector<uint32_t> order = switchOrder(cases, header.merge, entered);
  std::unordered_map<uint32_t, Value> enter;
  for (uint32_t label : entered) {
    enter[label] = b.var(Type::Mask);
    b.set(enter[label], goes[label]);
  }
  for (uint32_t label : outside) {
    b.beginIf(goes[label]);
    edge(header.label, label);
    leave(*findTarget(label));
    b.endIf();
  }
  // The cases to come are targets; the next one lies on top.
  for (size_t i = order.size(); i > 0; i--)
    if (enter.count(order[i - 1])) targets_.push_back({order[i - 1], b.breakDepth(), enter[order[i - 1]]});
  for (uint32_t label : order) {
    bool isEntered = enter.count(label) != 0;
    if (isEntered) targets_.pop_back();
    b.beginIf(isEntered ? b.get(enter[label]) : goes[label]);
    b.beginBlock();
    chain(label, header.merge);
    b.endBlock();
    b.endIf();
  }
  b.endBlock();
  targets_.pop_back();
}

void Translator::blockInstructions(const BasicBlock& current) {
  if (current.end <= current.first) fail("block %u has no end", current.label);
  for (uint32_t i = current.first; i + 1 < current.end; i++) {
    const Instruction& inst = module.instructions[i];
    b.setLine(inst.line);
    switch (inst.op) {
      case spv::Op::OpPhi: {
        std::vector<Value> values;
        for (Value var : phiVars(inst)) values.push_back(b.get(var));
        define(inst, std::move(values));
        if (type(inst.resultType).kind == TypeInfo::Pointer)
          for (size_t pair = 0; pair + 1 < inst.count(); pair += 2) inheritLayout(inst.result, inst.operand(pair));
        break;
      }
      case spv::Op::OpVariable: declareVariable(inst); break;
      case spv::Op::OpFunctionCall: translateFunctionCall(inst); break;
      default: translateInstruction(inst); break;
    }
    if (shader.function.insts.size() > kMaxInstructions) fail("the shader is too large");
  }
}

void Translator::translateBody(const FunctionBody& function) {
  if (function.blocks.empty()) fail("function %u has no body", function.id);
  Frame& f = frame();
  f.function = &function;
  f.targetBase = targets_.size();
  f.returnDepth = b.breakDepth();
  const TypeInfo& returned = type(function.returnType);
  if (returned.kind != TypeInfo::Void) {
    std::vector<Type> types;
    flatten(function.returnType, types);
    for (Type t : types) f.returnVars.push_back(b.var(t));
  }
  b.beginBlock();
  chain(function.blocks.front().label, kFunctionEnd);
  b.endBlock();
}

void Translator::translateFunctionCall(const Instruction& inst) {
  auto callee = module.functionOfId.find(inst.operand(0));
  if (callee == module.functionOfId.end()) fail("a call of %u, which is not a function", inst.operand(0));
  const FunctionBody& function = module.functions[callee->second];
  for (const Frame& f : frames_)
    if (f.function == &function) fail("function %u is recursive", function.id);
  if (frames_.size() > kMaxNesting) fail("calls are nested too deeply");
  if (function.parameters.size() + 1 != inst.count()) fail("a call with the wrong number of arguments");
  std::vector<Val> arguments;
  for (uint32_t id : inst.operands.subspan(1)) arguments.push_back(val(id));
  for (size_t i = 0; i < arguments.size(); i++) {
    const Instruction* parameter = module.definition(function.parameters[i]);
    if (!parameter) fail("parameter %u has no type", function.parameters[i]);
    const TypeInfo& wanted = type(parameter->resultType);
    if ((arguments[i].kind == Val::Data || arguments[i].scalars.size()) && arguments[i].scalars.size() != wanted.scalars)
      fail("a call with an argument of the wrong type");
    arguments[i].type = parameter->resultType;
    setVal(function.parameters[i], std::move(arguments[i]));
  }
  frames_.emplace_back();
  translateBody(function);
  std::vector<Value> results;
  for (Value var : frame().returnVars) results.push_back(b.get(var));
  frames_.pop_back();
  if (type(function.returnType).kind != TypeInfo::Void) define(inst, std::move(results));
}

namespace {

void onNothing(Translator&, const Instruction&, uint32_t) {}

void onDemote(Translator& t, const Instruction&, uint32_t) { t.b.emit(Op::Demote, Type::None, {}); }

void onIsHelper(Translator& t, const Instruction& inst, uint32_t) {
  t.define(inst, {t.b.emit(Op::HelperMask, Type::Mask, {})});
}

void onControlBarrier(Translator& t, const Instruction& inst, uint32_t) {
  auto scope = spv::Scope(t.requireConstant(inst.operand(0), "scope"));
  if (scope == spv::Scope::Workgroup)
    t.b.emit(Op::Barrier, Type::None, {});
  else if (scope != spv::Scope::Subgroup && scope != spv::Scope::Invocation)
    fail("OpControlBarrier of scope %u is not supported", uint32_t(scope));
}

//! Two words, or one of 64 bits. One clock serves all scopes.
void onReadClock(Translator& t, const Instruction& inst, uint32_t) {
  auto scope = spv::Scope(t.requireConstant(inst.operand(0), "scope"));
  if (scope != spv::Scope::Subgroup && scope != spv::Scope::Device) fail("OpReadClockKHR of scope %u is not supported", uint32_t(scope));
  Value time = t.b.emit(Op::Clock, Type::I64, {});
  if (t.type(inst.resultType).scalars == 1) return t.define(inst, {time});
  t.define(inst, {t.b.convert(Op::Trunc, Type::I32, time), t.b.convert(Op::Trunc, Type::I32, t.b.lshr(time, t.b.i64(32)))});
}

// Nothing of it may break a shader: what is no value prints as "?".
void debugPrintf(Translator& t, const Instruction& inst) {
  constexpr size_t kMostScalars = 64;
  const auto string = [&](uint32_t id) {
    const auto at = t.module.strings.find(id);
    return at == t.module.strings.end() ? nullptr : &at->second;
  };
  const std::string* format = string(inst.operand(2));
  if (!(t.checks & ir::kCheckPrintf) || inst.operand(1) != 1 || !format) return;
  ir::PrintCall call{*format, {}};
  std::vector<Value> values{t.watchedLanes()};
  for (uint32_t id : inst.operands.subspan(3)) {
    ir::PrintCall::Argument& argument = call.arguments.emplace_back();
    if (const std::string* text = string(id)) {
      argument.text = *text;
      continue;
    }
    const Val& v = t.val(id);
    if (v.scalars.size() > kMostScalars + 1 - values.size()) continue;
    argument.scalars = uint32_t(v.scalars.size());
    values.insert(values.end(), v.scalars.begin(), v.scalars.end());
  }
  const uint32_t number = ir::keepPrintCall(std::move(call));
  t.b.emit(Op::Check, Type::None, values, ir::checkImm({ir::CheckKind::Print, Op::Nop, Type::None, number}));
}

void onExtInst(Translator& t, const Instruction& inst, uint32_t) {
  auto set = t.module.extendedSets.find(inst.operand(0));
  if (set == t.module.extendedSets.end()) fail("OpExtInst of an unknown instruction set");
  if (set->second == "GLSL.std.450")
    translateGlsl450(t, inst);
  else if (set->second == "NonSemantic.DebugPrintf")
    debugPrintf(t, inst);
  else if (set->second.rfind("NonSemantic.", 0) != 0)
    fail("the extended instruction set %s is not supported", set->second.c_str());
}

constexpr HandlerEntry kHandlers[] = {
    {spv::Op::OpNop, onNothing},
    {spv::Op::OpSelectionMerge, onNothing},
    {spv::Op::OpLoopMerge, onNothing},
    {spv::Op::OpMemoryBarrier, onNothing},
    {spv::Op::OpAssumeTrueKHR, onNothing},
    {spv::Op::OpControlBarrier, onControlBarrier},
    {spv::Op::OpDemoteToHelperInvocation, onDemote},
    {spv::Op::OpIsHelperInvocationEXT, onIsHelper},
    {spv::Op::OpReadClockKHR, onReadClock},
    {spv::Op::OpExtInst, onExtInst},
};

}  // namespace

std::span<const HandlerEntry> controlHandlers() { return kHandlers; }

}  // namespace pumice::frontend
