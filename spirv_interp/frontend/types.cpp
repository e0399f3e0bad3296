#include <algorithm>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

constexpr uint64_t kHuge = uint64_t(1) << 40;  // sizes saturate here

uint32_t saturatedScalars(uint64_t n) { return uint32_t(std::min<uint64_t>(n, UINT32_MAX)); }
uint64_t alignUp(uint64_t n, uint64_t to) { return (n + to - 1) / to * to; }

Type intType(uint32_t width) {
  switch (width) {
    case 8: return Type::I8;
    case 16: return Type::I16;
    case 32: return Type::I32;
    case 64: return Type::I64;
    default: fail("integers of %u bits are not supported", width);
  }
}

Type floatType(uint32_t width) {
  switch (width) {
    case 16: return Type::F16;
    case 32: return Type::F32;
    case 64: return Type::F64;
    default: fail("floating point of %u bits is not supported", width);
  }
}

}  // namespace

const TypeInfo& Translator::type(uint32_t id) const {
  auto at = types_.find(id);
  if (at == types_.end()) fail("id %u is not a type", id);
  return at->second;
}

const TypeInfo& Translator::scalarInfo(uint32_t typeId) const {
  const TypeInfo* t = &type(typeId);
  while (t->kind == TypeInfo::Vector || t->kind == TypeInfo::Matrix || t->kind == TypeInfo::Array) t = &type(t->element);
  return *t;
}

void Translator::translateType(const Instruction& inst) {
  TypeInfo t;
  auto takeElement = [&](uint32_t id) -> const TypeInfo& {
    const TypeInfo& element = type(id);
    t.element = id;
    t.depth = element.depth + 1;
    t.scalar = element.scalar;
    t.isSigned = element.isSigned;
    t.isEmpty = element.isEmpty;
    return element;
  };
  auto setScalar = [&](Type scalar) {
    t.scalar = scalar;
    t.scalars = 1;
    // Masks are kept as 32-bit numbers in memory of our own.
    t.naturalSize = t.naturalAlign = scalar == Type::Mask ? 4 : ir::typeBytes(scalar);
  };
  auto repeat = [&](const TypeInfo& element, uint64_t count) {
    t.count = saturatedScalars(count);
    t.scalars = saturatedScalars(uint64_t(element.scalars) * t.count);
    t.naturalAlign = element.naturalAlign;
    t.naturalSize = element.naturalSize > kHuge / std::max<uint64_t>(count, 1) ? kHuge : element.naturalSize * count;
  };
  // A buffer device address is a number like any other; other pointers are values if they may be variable.
  auto setPointer = [&] {
    if (t.storage == spv::StorageClass::PhysicalStorageBuffer) {
      setScalar(Type::I64);
    } else if (variablePointers && t.storage == spv::StorageClass::Workgroup) {
      setScalar(Type::I32);
    } else if (variablePointers && t.storage == spv::StorageClass::StorageBuffer) {
      t.scalars = 3;  // base i64, size i64, offset i32
      t.naturalAlign = 8;
      t.naturalSize = 24;
    }
  };
  if (types_.size() >= kMaxTypes) fail("there are too many types");
  switch (inst.op) {
    case spv::Op::OpTypeVoid: t.kind = TypeInfo::Void; break;
    case spv::Op::OpTypeBool:
      t.kind = TypeInfo::Bool;
      setScalar(Type::Mask);
      break;
    case spv::Op::OpTypeInt:
      t.kind = TypeInfo::Int;
      t.isSigned = inst.operand(1) != 0;
      setScalar(intType(inst.operand(0)));
      break;
    case spv::Op::OpTypeFloat:
      t.kind = TypeInfo::Float;
      t.isSigned = true;
      setScalar(floatType(inst.operand(0)));
      break;
    case spv::Op::OpTypeVector:
    case spv::Op::OpTypeMatrix: {
      t.kind = inst.op == spv::Op::OpTypeVector ? TypeInfo::Vector : TypeInfo::Matrix;
      if (inst.operand(1) < 2 || inst.operand(1) > 4) fail("%s of %u", opcodeName(inst.op).c_str(), inst.operand(1));
      const TypeInfo& element = takeElement(inst.operand(0));
      if (t.kind == TypeInfo::Vector ? element.scalars != 1 : element.kind != TypeInfo::Vector)
        fail("type %u has wrong elements", inst.result);
      repeat(element, inst.operand(1));
      break;
    }
    case spv::Op::OpTypeArray: {
      t.kind = TypeInfo::Array;
      const TypeInfo& element = takeElement(inst.operand(0));
      uint64_t count = requireConstant(inst.operand(1), "array length");
      if (count == 0 || count > (1u << 30)) fail("array type %u has the length %llu", inst.result, (unsigned long long)count);
      repeat(element, count);
      break;
    }
    case spv::Op::OpTypeRuntimeArray:
      t.kind = TypeInfo::RuntimeArray;
      takeElement(inst.operand(0));
      break;
    case spv::Op::OpTypeStruct: {
      t.kind = TypeInfo::Struct;
      t.members.assign(inst.operands.begin(), inst.operands.end());
      memberCount_ += t.members.size();
      if (memberCount_ > kMaxMembers) fail("the structures have too many members");
      t.isEmpty = true;
      uint64_t scalars = 0;
      for (uint32_t member : t.members) {
        const TypeInfo& info = type(member);
        t.depth = std::max(t.depth, info.depth + 1);
        t.naturalAlign = std::max(t.naturalAlign, info.naturalAlign);
        t.memberScalar.push_back(saturatedScalars(scalars));
        t.memberOffset.push_back(alignUp(t.naturalSize, info.naturalAlign));
        t.naturalSize = std::min(t.memberOffset.back() + info.naturalSize, kHuge);
        scalars += info.scalars;
        t.isEmpty &= info.isEmpty;
      }
      t.naturalSize = alignUp(t.naturalSize, t.naturalAlign);
      t.scalars = saturatedScalars(scalars);
      break;
    }
    case spv::Op::OpTypePointer:
      t.kind = TypeInfo::Pointer;
      t.storage = spv::StorageClass(inst.operand(0));
      t.element = inst.operand(1);  // may be declared later (OpTypeForwardPointer)
      setPointer();
      break;
    case spv::Op::OpTypeForwardPointer:
      if (types_.count(inst.operand(0))) return;
      t.kind = TypeInfo::Pointer;
      t.storage = spv::StorageClass(inst.operand(1));
      setPointer();
      types_[inst.operand(0)] = t;
      return;
    case spv::Op::OpTypeImage:
      t.kind = TypeInfo::Image;
      if (inst.count() < 7) fail("OpTypeImage %u is too short", inst.result);
      t.image = &inst;
      t.element = inst.operand(0);
      break;
    case spv::Op::OpTypeSampler: t.kind = TypeInfo::Sampler; break;
    case spv::Op::OpTypeSampledImage:
      t.kind = TypeInfo::SampledImage;
      if (type(inst.operand(0)).kind != TypeInfo::Image) fail("OpTypeSampledImage %u of no image", inst.result);
      t.element = inst.operand(0);
      break;
    case spv::Op::OpTypeFunction: t.kind = TypeInfo::Function; break;
    default: fail("%s is not supported", opcodeName(inst.op).c_str());
  }
  if (t.depth > kMaxTypeDepth) fail("type %u is nested too deeply", inst.result);
  types_[inst.result] = std::move(t);
}

void Translator::flatten(uint32_t typeId, std::vector<Type>& out) const {
  const TypeInfo& t = type(typeId);
  if (t.isEmpty) return;
  if (t.scalars == 0 || t.scalars > kMaxValueScalars || out.size() > kMaxValueScalars)
    fail("values of type %u (%u scalars) are not supported", typeId, t.scalars);
  switch (t.kind) {
    case TypeInfo::Vector:
    case TypeInfo::Matrix:
    case TypeInfo::Array:
      for (uint32_t i = 0; i < t.count; i++) flatten(t.element, out);
      break;
    case TypeInfo::Struct:
      for (uint32_t member : t.members)
        flatten(member, out);
      break;
    case TypeInfo::Pointer:
      if (t.scalars == 3)
        out.insert(out.end(), {Type::I64, Type::I64, Type::I32});
      else
        out.push_back(t.scalar);
      break;
    default:
      out.push_back(t.scalar);
      break;
  }
}

uint32_t Translator::elementType(const TypeInfo& aggregate, uint32_t index) const {
  switch (aggregate.kind) {
    case TypeInfo::Struct:
      if (index >= aggregate.members.size()) fail("struct member %u does not exist", index);
      return aggregate.members[index];
    case TypeInfo::Vector:
    case TypeInfo::Matrix:
    case TypeInfo::Array:
      if (index >= aggregate.count) fail("element %u of %u does not exist", index, aggregate.count);
      return aggregate.element;
    case TypeInfo::RuntimeArray:
      return aggregate.element;
    default:
      fail("a type without elements is indexed");
  }
}

uint32_t Translator::flatOffset(const TypeInfo& aggregate, uint32_t index) const {
  if (aggregate.kind != TypeInfo::Struct) return type(aggregate.element).scalars * index;
  return index < aggregate.memberScalar.size() ? aggregate.memberScalar[index] : aggregate.scalars;
}

uint64_t Translator::naturalOffset(const TypeInfo& structType, uint32_t member) const {
  if (member >= structType.memberOffset.size()) fail("struct member %u does not exist", member);
  return structType.memberOffset[member];
}

}  // namespace pumice::frontend
