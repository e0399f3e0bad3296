// Variables and access chains: which variables live in registers, and where a pointer points.
#include <algorithm>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

// A variable that is only ever indexed by constants becomes one register per scalar; others become memory.
// A function's parameter that is indexed dynamically makes its arguments dynamic.
void Translator::findDynamicVariables() {
  std::unordered_map<uint32_t, std::vector<uint32_t>> bases;  // pointer -> pointers it was made from
  std::vector<uint32_t> work;
  auto isGlobalConstant = [&](uint32_t id) {
    const Instruction* inst = module.definition(id);
    if (!inst) return false;
    return uint32_t(inst - module.instructions.data()) < module.globalsEnd;
  };
  for (const Instruction& inst : module.instructions) {
    switch (inst.op) {
      case spv::Op::OpAccessChain:
      case spv::Op::OpInBoundsAccessChain: {
        if (inst.count() < 1) break;
        bases[inst.result].push_back(inst.operand(0));
        for (uint32_t index : inst.operands.subspan(1)) {
          if (!isGlobalConstant(index)) {
            work.push_back(inst.operand(0));
            break;
          }
        }
        break;
      }
      case spv::Op::OpCopyObject:
        bases[inst.result].push_back(inst.operand(0));
        break;
      case spv::Op::OpFunctionCall: {
        auto callee = module.functionOfId.find(inst.operand(0));
        if (callee == module.functionOfId.end()) break;
        const auto& parameters = module.functions[callee->second].parameters;
        for (size_t i = 0; i < parameters.size() && i + 1 < inst.count(); i++)
          bases[parameters[i]].push_back(inst.operand(i + 1));
        break;
      }
      default: break;
    }
  }
  while (!work.empty()) {
    uint32_t id = work.back();
    work.pop_back();
    if (!dynamicPointers_.insert(id).second) continue;
    auto at = bases.find(id);
    if (at != bases.end()) work.insert(work.end(), at->second.begin(), at->second.end());
  }
}

void Translator::declareLocal(Variable& variable) {
  const TypeInfo& t = type(variable.type);
  localBytes_ += t.naturalSize;
  if (!t.hasValue() || t.naturalSize > kMaxLocalBytes || localBytes_ > kMaxLocalBytes)
    fail("the shader's private arrays are too large");
  variable.home = Home::Local;
  variable.alloc = b.emit(Op::LocalAlloc, Type::I32, {}, t.naturalSize);
}

Pointer Translator::pointerTo(Variable& variable) {
  Pointer p;
  p.variable = &variable;
  p.home = variable.home;
  p.type = variable.type;
  p.isVolatile = variable.isVolatile;
  if (variable.home == Home::Shared) p.offset = variable.offset;
  TypeInfo::Kind kind = type(variable.type).kind;
  p.resourceArray = (p.home == Home::Buffer || p.home == Home::Opaque) &&
                    (kind == TypeInfo::Array || kind == TypeInfo::RuntimeArray);
  return p;
}

uint8_t Translator::checkIndices(const Pointer& p) {
  uint8_t flags = p.isVolatile ? ir::kInstVolatile : 0;
  if (p.indices.empty()) return flags;
  Value lanes = watchedLanes();
  for (const Pointer::Index& i : p.indices) {
    const bool wide = ir::typeBytes(b.type(i.value)) > 4;
    const Value index = resize(i.value, wide ? Type::I64 : Type::I32, i.isSigned);
    const Value count = b.constant(b.type(index), i.count);
    const auto kind = i.of == TypeInfo::Array ? ir::IndexedKind::Array : i.of == TypeInfo::Vector ? ir::IndexedKind::Vector : ir::IndexedKind::Matrix;
    b.emit(Op::Check, Type::None, {lanes, index, count}, ir::checkImm({ir::CheckKind::Index, Op::Nop, Type::None, uint32_t(kind)}));
    lanes = b.maskAnd(lanes, b.ult(index, count));   // what is wrong once is not looked at again
  }
  return flags | ir::kInstIndexed;
}

void Translator::addScaled(Pointer& p, uint32_t indexId, uint64_t stride, bool fromStart) {
  const TypeInfo& indexType = type(typeOf(indexId));
  Value index = scalar(indexId);
  uint64_t bits = 0;
  if (b.isConstant(index, &bits)) {
    unsigned width = 8 * ir::typeBytes(indexType.scalar);
    int64_t number = width < 64 ? int64_t(bits << (64 - width)) >> (64 - width) : int64_t(bits);
    if (!indexType.isSigned && width < 64) number = int64_t(bits);
    if (number >= 0 && uint64_t(number) <= UINT32_MAX && p.offset + uint64_t(number) * stride <= UINT32_MAX) {
      p.offset += uint64_t(number) * stride;
      return;
    }
    if (number < 0 && number >= INT32_MIN && stride <= UINT32_MAX && uint64_t(-number) * stride <= p.offset) {
      p.offset -= uint64_t(-number) * stride;
      return;
    }
  }
  if (p.home == Home::Physical) {
    Value wide = resize(index, Type::I64, indexType.isSigned);
    p.base = b.iadd(p.base, b.imul(wide, b.i64(stride)));
    return;
  }
  // What is beyond 4 GiB, or before the beginning, must not wrap back into the buffer: it stays at the end of the 32 bits.
  const bool bounded = fromStart && p.home == Home::Buffer && stride > 0;
  if (bounded && ir::typeBytes(indexType.scalar) > 4) index = b.umin(index, b.constant(indexType.scalar, UINT32_MAX));
  index = resize(index, Type::I32, indexType.isSigned);
  if (bounded && stride > 1) index = b.umin(index, b.i32(uint32_t(UINT32_MAX / stride)));
  Value bytes = b.imul(index, b.i32(uint32_t(stride)));
  if (p.dynamic) {
    bytes = b.iadd(p.dynamic, bytes);
    if (bounded) bytes = b.select(b.ult(bytes, p.dynamic), b.i32(UINT32_MAX), bytes);
  }
  p.dynamic = bytes;
}

Pointer Translator::accessChain(Pointer p, std::span<const uint32_t> indices) {
  for (uint32_t indexId : indices) {
    const TypeInfo& t = type(p.type);
    if (p.resourceArray) {
      // Arrays of arrays of descriptors are numbered through.
      Value index = toI32(scalar(indexId), type(typeOf(indexId)).isSigned);
      if (module.find(indexId, spv::Decoration::NonUniform)) p.nonUniform = true;
      uint64_t inner = 1;
      const TypeInfo* element = &type(t.element);
      while (element->kind == TypeInfo::Array) {
        inner *= element->count;
        element = &type(element->element);
      }
      Value scaled = inner > 1 ? b.imul(index, b.i32(uint32_t(inner))) : index;
      p.element = p.element ? b.iadd(p.element, scaled) : scaled;
      p.type = t.element;
      TypeInfo::Kind kind = type(p.type).kind;
      p.resourceArray = kind == TypeInfo::Array || kind == TypeInfo::RuntimeArray;
      if (!p.resourceArray && !p.variable) chooseDescriptor(p);
      continue;
    }
    p.arrayStride = 0;
    auto constant = constantOf(indexId);
    if (p.home == Home::Registers || p.home == Home::Values) {
      if (!constant) fail("a variable in registers is indexed dynamically");
      // Out of bounds is undefined: the last element.
      uint64_t count = t.kind == TypeInfo::Struct ? t.members.size() : t.count;
      if (count == 0) fail("a type without elements is indexed");
      uint32_t index = uint32_t(std::min<uint64_t>(*constant, count - 1));
      p.offset += flatOffset(t, index);
      p.type = elementType(t, index);
      continue;
    }
    bool natural = p.home == Home::Local || p.home == Home::Shared;
    bool sized = t.kind == TypeInfo::Array || t.kind == TypeInfo::Vector || t.kind == TypeInfo::Matrix;
    if ((checks & (ir::kCheckBounds | ir::kCheckUninit)) && sized && !(constant && *constant < t.count))
      p.indices.push_back({scalar(indexId), t.count, t.kind, type(typeOf(indexId)).isSigned});
    switch (t.kind) {
      case TypeInfo::Struct: {
        if (!constant || *constant >= t.members.size()) fail("struct member index out of range");
        uint32_t member = uint32_t(*constant);
        if (natural) {
          p.offset += naturalOffset(t, member);
        } else {
          const Decoration* offset = module.findMember(p.type, member, spv::Decoration::Offset);
          if (!offset) fail("member %u of type %u has no Offset", member, p.type);
          p.offset += offset->literal();
          p.layout = {};
          if (const Decoration* d = module.findMember(p.type, member, spv::Decoration::MatrixStride))
            p.layout.stride = d->literal();
          p.layout.rowMajor = module.findMember(p.type, member, spv::Decoration::RowMajor) != nullptr;
          if (module.findMember(p.type, member, spv::Decoration::Volatile)) p.isVolatile = true;
        }
        p.type = t.members[member];
        break;
      }
      case TypeInfo::Array:
      case TypeInfo::RuntimeArray: {
        uint64_t stride = type(t.element).naturalSize;
        if (!natural) {
          const Decoration* d = module.find(p.type, spv::Decoration::ArrayStride);
          if (!d) fail("array type %u has no ArrayStride", p.type);
          stride = d->literal();
        }
        addScaled(p, indexId, stride, true);
        p.arrayStride = stride;
        p.type = t.element;
        break;
      }
      case TypeInfo::Matrix: {
        uint64_t scalarBytes = ir::typeBytes(t.scalar);
        if (natural) {
          addScaled(p, indexId, type(t.element).naturalSize);
        } else if (p.layout.rowMajor) {
          addScaled(p, indexId, scalarBytes);
          p.layout.vectorStride = p.layout.stride;
        } else {
          addScaled(p, indexId, p.layout.stride);
        }
        p.type = t.element;
        break;
      }
      case TypeInfo::Vector: {
        uint64_t stride = natural ? type(t.element).naturalSize : ir::typeBytes(t.scalar);
        if (!natural && p.layout.vectorStride) stride = p.layout.vectorStride;
        addScaled(p, indexId, stride);
        p.type = t.element;
        break;
      }
      default: fail("a type without elements is indexed");
    }
    if (p.offset > UINT32_MAX) fail("an access chain leads beyond 4 GiB");
  }
  return p;
}

// Pointers as values, so that they can be selected, kept in variables and returned. A buffer device address is one i64.
// With variable pointers (SPV_KHR_variable_pointers) a pointer to work-group memory is the i32 offset, a pointer to a
// storage buffer the descriptor's base and size and an i32 offset: its buffer may then differ from lane to lane, and
// accesses stay bounded. They are made where the pointer is made, since that dominates all uses. A pointer to an array of
// descriptors is the number of the resource and of the element.
std::vector<Value> Translator::pointerScalars(const Pointer& p) {
  if (p.texelImage) return {};
  if (p.home == Home::Physical) return {p.offset ? b.iadd(p.base, b.i64(p.offset)) : p.base};
  bool shared = p.home == Home::Shared;
  bool buffer = p.home == Home::Buffer && (!p.variable || p.variable->storage == spv::StorageClass::StorageBuffer);
  if (!variablePointers || (!shared && !buffer)) return {};
  if (p.resourceArray) {
    Value element = p.element ? b.convert(Op::ZExt, Type::I64, p.element) : b.i64(0);
    return {p.variable ? b.i64(resourceOf(*p.variable)) : p.base, element, b.i32(0)};
  }
  Value offset = b.i32(uint32_t(p.offset));
  if (p.dynamic) offset = p.offset ? b.iadd(p.dynamic, offset) : p.dynamic;
  if (shared) return {offset};
  BufferAddress at = address(p);
  return {at.base, at.size, offset};
}

void Translator::chooseDescriptor(Pointer& p) {
  Value resourceNumber = p.base, element = p.element, zero = b.i32(0);
  p.base = p.size = p.element = 0;
  for (Variable& variable : variables) {
    if (variable.storage != spv::StorageClass::StorageBuffer || !pointerTo(variable).resourceArray) continue;
    uint32_t typeId = variable.type;
    while (type(typeId).kind == TypeInfo::Array || type(typeId).kind == TypeInfo::RuntimeArray) typeId = type(typeId).element;
    if (typeId != p.type) continue;
    Pointer candidate = p;
    candidate.variable = &variable;
    Value chosen = b.ieq(resourceNumber, b.i64(resourceOf(variable)));
    candidate.element = b.select(chosen, element, zero);
    BufferAddress at = address(candidate);
    p.base = p.base ? b.select(chosen, at.base, p.base) : at.base;
    p.size = p.size ? b.select(chosen, at.size, p.size) : at.size;
  }
  if (!p.base) fail("a pointer to an array of descriptors leads nowhere");
}

const Pointer& Translator::pointer(uint32_t id) {
  const Val& v = val(id);
  if (v.kind == Val::Ptr) return *v.pointer;
  const TypeInfo& t = type(v.type);
  if (v.kind != Val::Data || t.kind != TypeInfo::Pointer || v.scalars.empty() || v.scalars.size() != t.scalars)
    fail("id %u is not a pointer", id);
  // A pointer that came as a value.
  Pointer p;
  p.type = t.element;
  if (v.pointer) p.layout = v.pointer->layout;
  if (v.pointer) p.arrayStride = v.pointer->arrayStride;
  if (t.storage == spv::StorageClass::Workgroup) {
    p.home = Home::Shared;
    p.dynamic = v.scalars[0];
  } else if (t.storage == spv::StorageClass::StorageBuffer) {
    p.home = Home::Buffer;
    p.base = v.scalars[0];
    p.size = v.scalars[1];
    p.dynamic = v.scalars[2];
    uint32_t inner = t.element;
    while (type(inner).kind == TypeInfo::Array || type(inner).kind == TypeInfo::RuntimeArray) inner = type(inner).element;
    if (inner != t.element && module.find(inner, spv::Decoration::Block)) {
      p.resourceArray = true;
      p.element = b.convert(Op::Trunc, Type::I32, p.size);
      p.size = p.dynamic = 0;
    }
  } else {
    p.home = Home::Physical;
    p.base = v.scalars[0];
  }
  Val copy = v;
  copy.kind = Val::Ptr;
  copy.pointer = std::make_shared<Pointer>(p);
  setVal(id, std::move(copy));
  return *val(id).pointer;
}

void Translator::definePointer(const Instruction& inst, Pointer p) {
  Val v;
  v.kind = Val::Ptr;
  v.type = inst.resultType;
  if (module.find(inst.result, spv::Decoration::NonUniform)) p.nonUniform = true;
  v.scalars = pointerScalars(p);
  v.pointer = std::make_shared<Pointer>(std::move(p));
  setVal(inst.result, std::move(v));
}

void Translator::inheritLayout(uint32_t pointerId, uint32_t fromId) {
  if (fromId >= slots_.size() || !slots_[fromId]) return;  // around a loop: not known yet
  Val to = val(pointerId);
  if (to.kind != Val::Data || !val(fromId).pointer) return;
  to.pointer = val(fromId).pointer;
  setVal(pointerId, std::move(to));
}

void Translator::markWritten(const Pointer& p) {
  if (!p.variable) {
    storesThroughVariablePointers |= p.home == Home::Buffer;
    return;
  }
  if (p.variable->storage == spv::StorageClass::Output) {
    auto& written = p.variable->written;
    uint64_t first = p.home == Home::Registers ? p.offset : 0;
    uint64_t count = p.home == Home::Registers ? type(p.type).scalars : written.size();
    for (uint64_t i = first; i < first + count && i < written.size(); i++) written[i] = 1;
  }
  if (p.home == Home::Buffer) shader.resources[resourceOf(*p.variable)].readOnly = false;
}

}  // namespace pumice::frontend
