#include "spirv_interp/ir/bytes.h"

namespace pumice::ir {
namespace {

// A new field of these belongs into this file. (One that fits into padding is not noticed.)
static_assert(sizeof(Inst) == 24 && sizeof(ImageOpInfo) == 28 && sizeof(Function) == 120);
static_assert(size_t(Op::kCount) <= 256 && size_t(Type::Tuple) < 16, "an operation is one byte, a type four bits");

// Beside the type: what follows.
enum Follows : uint8_t { kImm = 16, kLine = 32, kFlags = 64 };

template <typename A>
void fields(A& a, ImageOpInfo& o) {
  a.value(o.kind), a.value(o.dim), a.value(o.arrayed), a.value(o.multisampled), a.value(o.implicitLod), a.value(o.atomic), a.value(o.compareExchange);
  a.value(o.operands), a.value(o.imageResource), a.value(o.samplerResource), a.value(o.texelType), a.value(o.texelSigned), a.value(o.storageFormat);
}

template <typename A>
void surroundings(A& a, Function& f) {
  text(a, f.name);
  list(a, f.imageOps, 20, [&](ImageOpInfo& o) { fields(a, o); });
  a.value(f.sharedBytes);
  // Not groupSize: a promise of whoever runs the function is not read from anywhere.
}

}  // namespace

void fields(ByteWriter& a, const Function& f) {
  surroundings(a, const_cast<Function&>(f));   // a writer only reads it
  a.bytes.reserve(a.bytes.size() + 8 * f.insts.size());
  a.number(f.insts.size() - 1);
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    a.value(uint8_t(i.op));
    a.value(uint8_t(uint8_t(i.type) | (i.imm ? kImm : 0) | (i.line ? kLine : 0) | (i.flags ? kFlags : 0)));
    if (opInfo(i.op).operandCount == kVariadic) a.number(i.operandCount);
    for (Value o : f.operands(i)) a.number(v - o);   // mostly near
    if (i.imm) a.number(i.imm);
    if (i.line) a.number(i.line);
    if (i.flags) a.value(i.flags);
  }
}

void fields(ByteReader& a, Function& f) {
  surroundings(a, f);
  size_t count = 0;
  a.size(count, 2);
  f.insts.assign(1, {});
  f.operandPool.clear();
  if (!a.ok) return;
  f.insts.reserve(count + 1);
  f.operandPool.reserve(2 * count);
  for (Value v = 1; v <= count; ++v) {
    uint8_t op = 0, head = 0;
    a.value(op);
    a.value(head);
    if (!a.ok || op == uint8_t(Op::Nop) || op >= uint8_t(Op::kCount) || head & 0x80) {
      a.ok = false;
      return;
    }
    Inst i;
    i.op = Op(op);
    i.type = Type(head & 15);
    size_t operands = opInfo(i.op).operandCount;
    if (operands == kVariadic) a.size(operands, 1);
    i.firstOperand = uint32_t(f.operandPool.size());
    i.operandCount = uint32_t(operands);
    for (size_t k = 0; k < operands; ++k) f.operandPool.push_back(v - Value(a.number()));
    if (head & kImm) i.imm = a.number();
    if (head & kLine) i.line = uint32_t(a.number());
    if (head & kFlags) a.value(i.flags);
    if (!a.ok) return;
    f.insts.push_back(i);
  }
}

}  // namespace pumice::ir
