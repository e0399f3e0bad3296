#include "spirv_interp/ir/builder.h"

#include <algorithm>
#include <array>

#include "spirv_interp/ir/fold.h"

namespace pumice::ir {

namespace {

constexpr auto kCommutative = [] {
  std::array<bool, size_t(Op::kCount)> table{};
  for (const Op op : {Op::FAdd, Op::FMul, Op::Fma, Op::FMin, Op::FMax, Op::IAdd, Op::IMul, Op::SMulHi, Op::UMulHi, Op::And, Op::Or, Op::Xor, Op::SMin,
                      Op::SMax, Op::UMin, Op::UMax, Op::FEq, Op::FNe, Op::IEq, Op::INe, Op::MaskAnd, Op::MaskOr, Op::MaskXor})
    table[size_t(op)] = true;
  return table;
}();

uint32_t hashInst(Op op, Type type, uint8_t flags, std::span<const Value> operands, uint64_t imm) {
  uint64_t h = uint64_t(op) | uint64_t(type) << 16 | uint64_t(flags) << 24;
  h = (h ^ imm) * 0x9e3779b97f4a7c15u;
  for (Value v : operands) h = (std::rotl(h, 23) ^ v) * 0x9e3779b97f4a7c15u;
  return uint32_t(h >> 32) ^ uint32_t(h);
}

}  // namespace

Builder::Builder(Function& f) : f_(f) {
  // A pass knows how large its result will be, more or less.
  if (f.insts.capacity() > f.insts.size()) available_.reserve(f.insts.capacity());
  for (const Inst& i : f.insts) {
    if (i.op == Op::Loop || i.op == Op::Block) ++breakDepth_;
    if (i.op == Op::EndLoop || i.op == Op::EndBlock) --breakDepth_;
  }
}

void Builder::reserve(size_t more) {
  const auto room = [](auto& list, size_t wanted) {
    if (list.capacity() < list.size() + wanted) list.reserve(std::max(list.size() + wanted, 2 * list.size()));
  };
  room(f_.insts, more);
  room(f_.operandPool, 2 * more);
  available_.reserve(available_.mark() + more);
}

void Builder::openScope() { scopes_.push_back(available_.mark()); }

void Builder::closeScope() {
  // A builder that was started inside a region may close it: then nothing it knows stays visible for sure.
  available_.rewind(scopes_.empty() ? 0 : scopes_.back());
  if (!scopes_.empty()) scopes_.pop_back();
}

Value Builder::append(Op op, Type type, std::span<const Value> operands, uint64_t imm) {
  Inst i;
  i.op = op;
  i.type = type;
  i.flags = instFlags_;
  i.firstOperand = uint32_t(f_.operandPool.size());
  i.operandCount = uint32_t(operands.size());
  i.line = line_;
  i.imm = imm;
  f_.operandPool.insert(f_.operandPool.end(), operands.begin(), operands.end());
  f_.insts.push_back(i);
  return Value(f_.insts.size() - 1);
}

Value Builder::emit(Op op, Type type, std::span<const Value> given, uint64_t imm) {
  // A copy: the span may point into the operand pool, which moves when it grows.
  Value few[8];
  std::vector<Value> many;
  std::span<Value> operands;
  if (given.size() <= std::size(few)) {
    std::copy(given.begin(), given.end(), few);
    operands = {few, given.size()};
  } else {
    many.assign(given.begin(), given.end());
    operands = many;
  }

  const OpInfo& info = opInfo(op);
  if (info.flags & kControl) {
    if (op == Op::Else || op == Op::EndIf || op == Op::EndLoop || op == Op::EndBlock) closeScope();
    if (op == Op::Else || op == Op::If || op == Op::Loop || op == Op::Block) openScope();
    if (op == Op::Loop || op == Op::Block) ++breakDepth_;
    if (op == Op::EndLoop || op == Op::EndBlock) --breakDepth_;
  }
  if (!(info.flags & kPure) || (instFlags_ & kInstVolatile)) return append(op, type, operands, imm);

  if (kCommutative[size_t(op)]) {
    const bool c0 = isConstant(operands[0]), c1 = isConstant(operands[1]);
    if (c0 != c1 ? c0 : operands[0] > operands[1]) std::swap(operands[0], operands[1]);
  }
  if (op == Op::Const) imm &= allOnes(type);

  uint64_t args[4];
  bool constant = !operands.empty() && operands.size() <= std::size(args);
  for (size_t i = 0; constant && i < operands.size(); ++i) constant = isConstant(operands[i], &args[i]);
  uint64_t folded = 0;
  // A conversion that keeps the double may not be rounded here either.
  if ((instFlags_ & kInstKeep) && typeBytes(type) < typeBytes(this->type(operands.back()))) constant = false;
  if (constant && foldConstant(op, type, this->type(operands.back()), {args, operands.size()}, folded))
    return this->constant(type, folded);
  if (!operands.empty())
    if (Value v = simplify(*this, op, type, operands)) return v;

  const uint8_t flags = op == Op::Const ? 0 : instFlags_;
  const uint32_t hash = hashInst(op, type, flags, operands, imm);
  const Value found = available_.find(hash, [&](Value v) {
    const Inst& i = f_.insts[v];
    return i.op == op && i.type == type && i.flags == flags && i.imm == imm &&
           std::ranges::equal(f_.operands(i), operands);
  });
  if (found) return found;
  const Value v = append(op, type, operands, imm);
  f_.insts[v].flags = flags;
  available_.insert(hash, v);
  return v;
}

Value Builder::constant(Type t, uint64_t bits) {
  const uint8_t flags = instFlags_;
  instFlags_ = 0;  // also a constant made while a volatile access is built is merged
  const Value v = emit(Op::Const, t, {}, bits);
  instFlags_ = flags;
  return v;
}

Value Builder::floatConstant(Type t, double x) { return constant(t, floatBits(t, x)); }

bool Builder::isConstant(Value v, uint64_t* bits) const {
  if (f_.insts[v].op != Op::Const) return false;
  if (bits) *bits = f_.insts[v].imm;
  return true;
}

Value Builder::tableLoad(Type t, uint32_t table, uint32_t constOffset, Value offset) {
  if (!offset) offset = i32(0);
  return emit(Op::TableLoad, t, {offset}, uint64_t(table) << 32 | constOffset);
}

}  // namespace pumice::ir
