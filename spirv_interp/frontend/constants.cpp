#include <cstring>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

uint64_t maskTo(Type type, uint64_t bits) {
  unsigned width = 8 * ir::typeBytes(type);
  return width < 64 ? bits & ((uint64_t(1) << width) - 1) : bits;
}

}  // namespace

void Translator::translateConstant(const Instruction& inst) {
  const TypeInfo& t = type(inst.resultType);
  auto specialized = [&]() -> std::optional<uint64_t> {
    const Decoration* id = module.find(inst.result, spv::Decoration::SpecId);
    if (!id) return std::nullopt;
    auto at = specialization_.find(id->literal());
    if (at == specialization_.end()) return std::nullopt;
    uint64_t bits = 0;
    std::memcpy(&bits, at->second.data(), std::min<size_t>(at->second.size(), 8));
    return bits;
  };
  constantScalars_ += t.scalars;
  if (constantScalars_ > kMaxInstructions) fail("the constants are too large");
  switch (inst.op) {
    case spv::Op::OpConstantTrue:
    case spv::Op::OpConstantFalse:
      define(inst, {b.mask(inst.op == spv::Op::OpConstantTrue)});
      return;
    case spv::Op::OpSpecConstantTrue:
    case spv::Op::OpSpecConstantFalse: {
      // Given as VkBool32.
      auto bits = specialized();
      define(inst, {b.mask(bits ? uint32_t(*bits) != 0 : inst.op == spv::Op::OpSpecConstantTrue)});
      return;
    }
    case spv::Op::OpConstant:
    case spv::Op::OpSpecConstant: {
      if (t.kind != TypeInfo::Int && t.kind != TypeInfo::Float) fail("constant %u has a wrong type", inst.result);
      uint64_t bits = inst.operand(0) | uint64_t(inst.operand(1)) << 32;
      if (inst.op == spv::Op::OpSpecConstant) bits = specialized().value_or(bits);
      define(inst, {b.constant(t.scalar, maskTo(t.scalar, bits))});
      return;
    }
    case spv::Op::OpConstantComposite:
    case spv::Op::OpSpecConstantComposite: {
      if (t.scalars > kMaxValueScalars) fail("constant %u is too large", inst.result);
      std::vector<Value> scalars;
      for (uint32_t id : inst.operands) {
        const std::vector<Value>& part = data(id);
        scalars.insert(scalars.end(), part.begin(), part.end());
        if (scalars.size() > t.scalars) break;
      }
      define(inst, std::move(scalars));
      if (module.find(inst.result, spv::Decoration::BuiltIn) &&
          module.find(inst.result, spv::Decoration::BuiltIn)->literal() == uint32_t(spv::BuiltIn::WorkgroupSize))
        workgroupSizeConstant_ = inst.result;
      return;
    }
    case spv::Op::OpConstantNull:
    case spv::Op::OpUndef:
      // Of pointers and images they may be named, but nothing can be done with them: the id gets no value.
      if (!t.hasValue()) return;
      // Offset 0 of work-group memory is a place like any other; this one is outside.
      if (t.kind == TypeInfo::Pointer && t.storage == spv::StorageClass::Workgroup) {
        define(inst, {b.i32(~0u)});
        return;
      }
      define(inst, zeros(inst.resultType));
      return;
    case spv::Op::OpSpecConstantOp: {
      // The same handlers as for instructions: the builder folds what is constant.
      Instruction inner = inst;
      inner.op = spv::Op(inst.operand(0));
      inner.operands = inst.operands.subspan(std::min<size_t>(1, inst.count()));
      const HandlerEntry* entry = findHandler(inner.op);
      if (!entry) fail("OpSpecConstantOp %s is not supported", opcodeName(inner.op).c_str());
      entry->handler(*this, inner, entry->aux);
      return;
    }
    default:
      fail("%s is not supported", opcodeName(inst.op).c_str());
  }
}

}  // namespace pumice::frontend
