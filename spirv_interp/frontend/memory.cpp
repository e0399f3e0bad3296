// Loads, stores, copies and atomics through pointers.
#include <algorithm>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

// Calls visit(scalar type, byte offset) for each scalar of a value of `typeId`, in flat order.
template <typename Visit>
void Translator::visitScalars(uint32_t typeId, uint64_t offset, const MatrixLayout& layout, bool explicitLayout,
                              Visit&& visit) {
  const TypeInfo& t = type(typeId);
  if (t.isEmpty) return;
  if (t.scalars == 0) fail("type %u cannot be loaded or stored", typeId);
  switch (t.kind) {
    case TypeInfo::Bool:
    case TypeInfo::Int:
    case TypeInfo::Float: visit(t.scalar, offset); break;
    case TypeInfo::Pointer:
      if (t.scalars == 3) {
        visit(Type::I64, offset);
        visit(Type::I64, offset + 8);
        visit(Type::I32, offset + 16);
      } else {
        visit(t.scalar, offset);
      }
      break;
    case TypeInfo::Vector: {
      uint64_t stride = explicitLayout && layout.vectorStride ? layout.vectorStride : type(t.element).naturalSize;
      for (uint32_t i = 0; i < t.count; i++) visit(t.scalar, offset + i * stride);
      break;
    }
    case TypeInfo::Matrix:
      for (uint32_t c = 0; c < t.count; c++) {
        MatrixLayout column;
        uint64_t stride = type(t.element).naturalSize;
        if (explicitLayout) {
          stride = layout.rowMajor ? ir::typeBytes(t.scalar) : layout.stride;
          column.vectorStride = layout.rowMajor ? layout.stride : 0;
        }
        visitScalars(t.element, offset + c * stride, column, explicitLayout, visit);
      }
      break;
    case TypeInfo::Array: {
      uint64_t stride = type(t.element).naturalSize;
      if (explicitLayout) {
        const Decoration* d = module.find(typeId, spv::Decoration::ArrayStride);
        if (!d) fail("array type %u has no ArrayStride", typeId);
        stride = d->literal();
      }
      for (uint32_t i = 0; i < t.count; i++) visitScalars(t.element, offset + i * stride, layout, explicitLayout, visit);
      break;
    }
    case TypeInfo::Struct: {
      for (uint32_t i = 0; i < t.members.size(); i++) {
        MatrixLayout member;
        uint64_t memberOffset = t.memberOffset[i];
        if (explicitLayout) {
          const Decoration* d = module.findMember(typeId, i, spv::Decoration::Offset);
          if (!d) fail("member %u of type %u has no Offset", i, typeId);
          memberOffset = d->literal();
          if (const Decoration* stride = module.findMember(typeId, i, spv::Decoration::MatrixStride))
            member.stride = stride->literal();
          member.rowMajor = module.findMember(typeId, i, spv::Decoration::RowMajor) != nullptr;
        }
        visitScalars(t.members[i], offset + memberOffset, member, explicitLayout, visit);
      }
      break;
    }
    default: fail("type %u cannot be loaded or stored", typeId);
  }
  if (shader.function.insts.size() > kMaxInstructions) fail("the shader is too large");
}

Translator::BufferAddress Translator::address(const Pointer& p) {
  BufferAddress at;
  at.offset = p.dynamic ? p.dynamic : b.i32(0);
  if (p.home == Home::Physical) {
    at.base = p.base;
    at.size = b.i64(~uint64_t(0));
  } else if (p.home == Home::Buffer && !p.variable) {
    at.base = p.base;
    at.size = p.size;
  } else if (p.home == Home::Buffer) {
    if (p.resourceArray) fail("an array of descriptors is used as if it were memory");
    uint32_t resource = resourceOf(*p.variable);
    useElement(resource, p.element);
    if (p.nonUniform) b.setInstFlags(ir::kInstNonUniform);
    Value tuple = b.emit(Op::Descriptor, Type::Tuple, {p.element ? p.element : b.i32(0)}, resource);
    at.base = b.emit(Op::TupleGet, Type::I64, {tuple}, 0);
    at.size = b.emit(Op::TupleGet, Type::I64, {tuple}, 1);
    b.setInstFlags(0);
  }
  return at;
}

Value Translator::loadScalar(const Pointer& p, Type type, uint64_t offset, const BufferAddress& at) {
  if (offset > UINT32_MAX) fail("a load lies beyond 4 GiB");
  uint32_t constant = uint32_t(offset);
  switch (p.home) {
    case Home::Push: return b.tableLoad(type, ir::kTablePush, constant, p.dynamic);
    case Home::Local: return b.emit(Op::LocalLoad, type, {p.variable->alloc, at.offset}, constant);
    case Home::Shared: return b.emit(Op::SharedLoad, type, {at.offset}, constant);
    case Home::Buffer:
      if (p.variable && p.variable->constant && !p.isVolatile) return b.loadConst(type, at.base, at.offset, at.size, constant);
      return b.load(type, at.base, at.offset, at.size, constant);
    default: return b.load(type, at.base, at.offset, at.size, constant);
  }
}

void Translator::storeScalar(const Pointer& p, Value value, uint64_t offset, const BufferAddress& at) {
  if (offset > UINT32_MAX) fail("a store lies beyond 4 GiB");
  switch (p.home) {
    case Home::Local: b.emit(Op::LocalStore, Type::None, {p.variable->alloc, at.offset, value}, offset); break;
    case Home::Shared: b.emit(Op::SharedStore, Type::None, {at.offset, value}, offset); break;
    default: b.store(at.base, at.offset, at.size, value, uint32_t(offset)); break;
  }
}

std::vector<Value> Translator::load(const Pointer& p) {
  std::vector<Value> scalars;
  const TypeInfo& t = type(p.type);
  if (p.home == Home::Opaque || p.texelImage) fail("an image or sampler is loaded as data");
  if (!t.hasValue() || t.scalars > kMaxValueScalars) fail("type %u cannot be loaded", p.type);
  if (p.home == Home::Registers || p.home == Home::Values) {
    if (p.offset + t.scalars > p.variable->scalars.size()) fail("a load lies outside of its variable");
    for (uint32_t i = 0; i < t.scalars; i++) {
      Value v = p.variable->scalars[p.offset + i];
      if (p.home == Home::Registers)
        v = b.get(v);
      else if (!v)
        v = b.emit(Op::HelperMask, Type::Mask, {});
      scalars.push_back(v);
    }
    return scalars;
  }
  bool natural = p.home == Home::Local || p.home == Home::Shared;
  BufferAddress at = address(p);
  b.setInstFlags(checkIndices(p));
  visitScalars(p.type, p.offset, p.layout, !natural, [&](Type scalarType, uint64_t offset) {
    if (scalarType == Type::Mask)
      scalars.push_back(b.compare(Op::INe, loadScalar(p, Type::I32, offset, at), b.i32(0)));
    else
      scalars.push_back(loadScalar(p, scalarType, offset, at));
  });
  b.setInstFlags(0);
  return scalars;
}

void Translator::store(const Pointer& p, const std::vector<Value>& scalars) {
  const TypeInfo& t = type(p.type);
  if (scalars.size() != t.scalars || !t.hasValue()) fail("a store of %zu scalars to %u", scalars.size(), t.scalars);
  switch (p.home) {
    case Home::Registers:
      if (p.offset + t.scalars > p.variable->scalars.size()) fail("a store lies outside of its variable");
      for (uint32_t i = 0; i < t.scalars; i++) {
        Value var = p.variable->scalars[p.offset + i];
        if (b.type(var) != b.type(scalars[i])) fail("a store of the wrong type");
        b.set(var, scalars[i]);
      }
      return;
    case Home::Values:
    case Home::Push:
    case Home::Opaque: fail("a store to read-only memory");
    default: break;
  }
  bool natural = p.home == Home::Local || p.home == Home::Shared;
  BufferAddress at = address(p);
  b.setInstFlags(checkIndices(p));
  size_t next = 0;
  visitScalars(p.type, p.offset, p.layout, !natural, [&](Type scalarType, uint64_t offset) {
    Value v = scalars[next++];
    if (b.type(v) != scalarType) fail("a store of the wrong type");
    if (scalarType == Type::Mask) v = b.select(v, b.i32(1), b.i32(0));
    storeScalar(p, v, offset, at);
  });
  b.setInstFlags(0);
}

namespace {

constexpr uint32_t kVolatileAccess = uint32_t(spv::MemoryAccessMask::Volatile);

Pointer withAccess(Pointer p, uint32_t access) {
  if (access & kVolatileAccess) p.isVolatile = true;
  return p;
}

void onLoad(Translator& t, const Instruction& inst, uint32_t) {
  Pointer p = withAccess(t.pointer(inst.operand(0)), inst.operand(1));
  if (p.home != Home::Opaque) {
    t.define(inst, t.load(p));
    return;
  }
  if (p.resourceArray) fail("an array of images or samplers is loaded whole");
  Opaque opaque;
  uint32_t resource = t.resourceOf(*p.variable);
  t.useElement(resource, p.element);
  const TypeInfo& type = t.type(p.type);
  opaque.nonUniform = p.nonUniform || t.module.find(inst.result, spv::Decoration::NonUniform);
  Value element = p.element ? p.element : t.b.i32(0);
  if (type.kind != TypeInfo::Sampler) {
    opaque.imageType = type.kind == TypeInfo::SampledImage ? type.element : p.type;
    opaque.image = resource;
    opaque.imageElement = element;
  }
  if (type.kind != TypeInfo::Image) {
    opaque.sampler = resource;
    opaque.samplerElement = element;
  }
  t.defineOpaque(inst, opaque);
}

void onStore(Translator& t, const Instruction& inst, uint32_t) {
  Pointer p = withAccess(t.pointer(inst.operand(0)), inst.operand(2));
  t.store(p, t.data(inst.operand(1)));
  t.markWritten(p);
}

void onCopyMemory(Translator& t, const Instruction& inst, uint32_t) {
  // The second set of memory operands, if there is one, is the source's.
  using A = spv::MemoryAccessMask;
  uint32_t access = inst.operand(2);
  size_t second = 3;
  for (A operand : {A::Aligned, A::MakePointerAvailable, A::MakePointerVisible}) second += (access & uint32_t(operand)) != 0;
  Pointer to = withAccess(t.pointer(inst.operand(0)), access);
  Pointer from = withAccess(t.pointer(inst.operand(1)), inst.operand(inst.count() > second ? second : 2));
  t.store(to, t.load(from));
  t.markWritten(to);
}

void onAccessChain(Translator& t, const Instruction& inst, uint32_t) {
  if (inst.count() < 1) fail("OpAccessChain is too short");
  t.definePointer(inst, t.accessChain(t.pointer(inst.operand(0)), inst.operands.subspan(1)));
}

void onPtrAccessChain(Translator& t, const Instruction& inst, uint32_t) {
  if (inst.count() < 2) fail("OpPtrAccessChain is too short");
  Pointer p = t.pointer(inst.operand(0));
  bool natural = p.home == Home::Local || p.home == Home::Shared;
  if (p.home == Home::Registers || p.home == Home::Values || p.home == Home::Opaque)
    fail("OpPtrAccessChain into a variable that is not in memory");
  uint64_t stride = t.type(p.type).naturalSize;
  if (!natural) {
    const Decoration* d = t.module.find(t.typeOf(inst.operand(0)), spv::Decoration::ArrayStride);
    if (!d) fail("OpPtrAccessChain: the pointer type has no ArrayStride");
    stride = d->literal();
  }
  // The element may be a negative one. Offsets are unsigned and bounds are checked on the sum of both parts, so the
  // constant part joins the other unless all of it is constant.
  if (!t.constantOf(inst.operand(1)) && p.offset && p.home != Home::Physical) {
    Value offset = t.b.i32(uint32_t(p.offset));
    p.dynamic = p.dynamic ? t.b.iadd(p.dynamic, offset) : offset;
    p.offset = 0;
  }
  t.addScaled(p, inst.operand(1), stride);
  p.arrayStride = stride;
  t.definePointer(inst, t.accessChain(p, inst.operands.subspan(2)));
}

// Null is all zeros (of work-group memory all ones); of two pointers into one buffer the sizes are the same.
void onPointerEqual(Translator& t, const Instruction& inst, uint32_t inverted) {
  const std::vector<Value>&x = t.data(inst.operand(0)), &y = t.data(inst.operand(1));
  if (x.empty() || x.size() != y.size()) fail("%s of different kinds of pointers", opcodeName(inst.op).c_str());
  Value equal = t.b.mask(true);
  for (size_t i = 0; i < x.size(); i++)
    if (t.b.type(x[i]) != t.b.type(y[i])) fail("%s of different kinds of pointers", opcodeName(inst.op).c_str());
    else equal = t.b.maskAnd(equal, t.b.ieq(x[i], y[i]));
  t.define(inst, {inverted ? t.b.maskNot(equal) : equal});
}

// In elements; both pointers are into one array.
void onPointerDifference(Translator& t, const Instruction& inst, uint32_t) {
  const std::vector<Value>&x = t.data(inst.operand(0)), &y = t.data(inst.operand(1));
  const TypeInfo& pointerType = t.type(t.typeOf(inst.operand(0)));
  if (x.empty() || x.size() != y.size() || pointerType.kind != TypeInfo::Pointer || t.b.type(x.back()) != t.b.type(y.back()))
    fail("OpPtrDiff of different kinds of pointers");
  uint64_t stride = t.type(pointerType.element).naturalSize;
  if (pointerType.storage != spv::StorageClass::Workgroup) {
    // The pointer type need not say it: what the pointers were made from does.
    if (const Decoration* d = t.module.find(t.typeOf(inst.operand(0)), spv::Decoration::ArrayStride))
      stride = d->literal();
    else if (uint64_t known = std::max(t.pointer(inst.operand(0)).arrayStride, t.pointer(inst.operand(1)).arrayStride))
      stride = known;
    else if (t.type(pointerType.element).scalars != 1)
      fail("OpPtrDiff: how far the elements lie apart is not known");
  }
  if (stride == 0 || stride > INT32_MAX) fail("OpPtrDiff: an impossible stride");
  Value bytes = t.b.isub(x.back(), y.back());
  Value elements = t.b.sdiv(bytes, t.b.constant(t.b.type(bytes), stride));
  t.define(inst, {t.resize(elements, t.type(inst.resultType).scalar, true)});
}

void onArrayLength(Translator& t, const Instruction& inst, uint32_t) {
  Pointer p = t.pointer(inst.operand(0));
  const TypeInfo& type = t.type(p.type);
  uint32_t member = inst.operand(1);
  if (p.home != Home::Buffer || type.kind != TypeInfo::Struct || member >= type.members.size())
    fail("OpArrayLength of something other than a buffer block");
  const Decoration* offset = t.module.findMember(p.type, member, spv::Decoration::Offset);
  const Decoration* stride = t.module.find(type.members[member], spv::Decoration::ArrayStride);
  if (!offset || !stride || stride->literal() == 0) fail("OpArrayLength: no Offset or ArrayStride");
  ir::Builder& b = t.b;
  Value size = t.address(p).size;
  Value start = b.i64(offset->literal());
  Value bytes = b.isub(b.umax(size, start), start);
  t.define(inst, {b.convert(Op::Trunc, Type::I32, b.udiv(bytes, b.i64(stride->literal())))});
}

void onConvertPointer(Translator& t, const Instruction& inst, uint32_t) {
  Value v = t.scalar(inst.operand(0));
  const TypeInfo& type = t.type(inst.resultType);
  if (type.scalars != 1) fail("%s: not a buffer device address", opcodeName(inst.op).c_str());
  t.define(inst, {t.resize(v, type.scalar, false)});
}

// --- atomics: pointer, scope, semantics, then the values

Value atomic(Translator& t, const Pointer& p, Type type, ir::AtomicOp op, Value value, Value comparator) {
  ir::Builder& b = t.b;
  if (b.type(value) != type) fail("an atomic operation with a value of the wrong type");
  if (p.offset > UINT32_MAX) fail("an atomic operation beyond 4 GiB");
  uint64_t imm = uint64_t(op) << 32 | p.offset;
  auto at = t.address(p);
  if (p.home != Home::Shared && p.home != Home::Buffer && p.home != Home::Physical) fail("an atomic operation on memory that is not shared");
  b.setInstFlags(t.checkIndices(p) & ir::kInstIndexed);
  Value old;
  if (p.home == Home::Shared)
    old = comparator ? b.emit(Op::SharedAtomicCas, type, {at.offset, value, comparator}, p.offset) : b.emit(Op::SharedAtomic, type, {at.offset, value}, imm);
  else
    old = comparator ? b.emit(Op::AtomicCas, type, {at.base, at.offset, at.size, value, comparator}, p.offset)
                     : b.emit(Op::Atomic, type, {at.base, at.offset, at.size, value}, imm);
  b.setInstFlags(0);
  return old;
}

}  // namespace

// image.cpp
Value imageAtomic(Translator& t, const Pointer& p, Type type, ir::AtomicOp op, Value value, Value comparator);

namespace {

Value anyAtomic(Translator& t, const Pointer& p, Type type, ir::AtomicOp op, Value value, Value comparator = 0) {
  if (op != ir::AtomicOp::Load) t.markWritten(p);
  if (p.texelImage) return imageAtomic(t, p, type, op, value, comparator);
  // Bits only: no arithmetic may touch them.
  bool moves = op == ir::AtomicOp::Load || op == ir::AtomicOp::Store || op == ir::AtomicOp::Exchange;
  if (moves && ir::isFloat(type) && !comparator) {
    Type bits = ir::intOf(type);
    return t.b.bitcast(type, atomic(t, p, bits, op, t.b.bitcast(bits, value), 0));
  }
  return atomic(t, p, type, op, value, comparator);
}

void onAtomic(Translator& t, const Instruction& inst, uint32_t aux) {
  Pointer p = t.pointer(inst.operand(0));
  Type type = t.type(inst.resultType).scalar;
  if (ir::typeBytes(type) < 4) fail("%s of %u bytes is not supported", opcodeName(inst.op).c_str(), ir::typeBytes(type));
  ir::Builder& b = t.b;
  Value value = 0;
  switch (inst.op) {
    case spv::Op::OpAtomicLoad: value = b.zero(type); break;
    case spv::Op::OpAtomicIIncrement: value = b.constant(type, 1); break;
    case spv::Op::OpAtomicIDecrement: value = b.constant(type, type == Type::I64 ? ~uint64_t(0) : uint32_t(~0u)); break;
    case spv::Op::OpAtomicISub: value = b.isub(b.zero(type), t.scalar(inst.operand(3))); break;
    default: value = t.scalar(inst.operand(3)); break;
  }
  t.define(inst, {anyAtomic(t, p, type, ir::AtomicOp(aux), value)});
}

// By compare and exchange until nobody was in between: lane IR has no such atomic operation.
void onAtomicFloatMinMax(Translator& t, const Instruction& inst, uint32_t op) {
  Pointer p = t.pointer(inst.operand(0));
  Type type = t.type(inst.resultType).scalar, bits = ir::intOf(type);
  if (!ir::isFloat(type) || ir::typeBytes(type) < 4) fail("%s of this type is not supported", opcodeName(inst.op).c_str());
  if (p.texelImage) fail("%s of images is not supported", opcodeName(inst.op).c_str());
  ir::Builder& b = t.b;
  Value value = t.scalar(inst.operand(3)), seen = b.var(bits);
  if (b.type(value) != type) fail("an atomic operation with a value of the wrong type");
  b.set(seen, anyAtomic(t, p, bits, ir::AtomicOp::Load, b.zero(bits)));
  b.beginLoop();
  Value expected = b.get(seen);
  Value wanted = b.bitcast(bits, b.binary(Op(op), b.bitcast(type, expected), value));
  Value old = anyAtomic(t, p, bits, ir::AtomicOp::Exchange, wanted, expected);
  b.set(seen, old);
  b.beginIf(b.ieq(old, expected));
  b.breakOut();
  b.endIf();
  b.endLoop();
  t.define(inst, {b.bitcast(type, b.get(seen))});
}

void onAtomicStore(Translator& t, const Instruction& inst, uint32_t) {
  Value value = t.scalar(inst.operand(3));
  if (ir::typeBytes(t.b.type(value)) < 4) fail("OpAtomicStore of fewer than 32 bits is not supported");
  anyAtomic(t, t.pointer(inst.operand(0)), t.b.type(value), ir::AtomicOp::Store, value);
}

void onAtomicCompareExchange(Translator& t, const Instruction& inst, uint32_t) {
  Type type = t.type(inst.resultType).scalar;
  if (!ir::isInt(type) || ir::typeBytes(type) < 4) fail("OpAtomicCompareExchange of this type is not supported");
  Value value = t.scalar(inst.operand(4)), comparator = t.scalar(inst.operand(5));
  t.define(inst, {anyAtomic(t, t.pointer(inst.operand(0)), type, ir::AtomicOp::Exchange, value, comparator)});
}

constexpr uint32_t aux(ir::AtomicOp op) { return uint32_t(op); }

constexpr HandlerEntry kHandlers[] = {
    {spv::Op::OpLoad, onLoad},
    {spv::Op::OpStore, onStore},
    {spv::Op::OpCopyMemory, onCopyMemory},
    {spv::Op::OpAccessChain, onAccessChain},
    {spv::Op::OpInBoundsAccessChain, onAccessChain},
    {spv::Op::OpPtrAccessChain, onPtrAccessChain},
    {spv::Op::OpPtrEqual, onPointerEqual, 0},
    {spv::Op::OpPtrNotEqual, onPointerEqual, 1},
    {spv::Op::OpPtrDiff, onPointerDifference},
    {spv::Op::OpArrayLength, onArrayLength},
    {spv::Op::OpConvertPtrToU, onConvertPointer},
    {spv::Op::OpConvertUToPtr, onConvertPointer},
    {spv::Op::OpAtomicLoad, onAtomic, aux(ir::AtomicOp::Load)},
    {spv::Op::OpAtomicStore, onAtomicStore},
    {spv::Op::OpAtomicExchange, onAtomic, aux(ir::AtomicOp::Exchange)},
    {spv::Op::OpAtomicCompareExchange, onAtomicCompareExchange},
    {spv::Op::OpAtomicIIncrement, onAtomic, aux(ir::AtomicOp::Add)},
    {spv::Op::OpAtomicIDecrement, onAtomic, aux(ir::AtomicOp::Add)},
    {spv::Op::OpAtomicIAdd, onAtomic, aux(ir::AtomicOp::Add)},
    {spv::Op::OpAtomicISub, onAtomic, aux(ir::AtomicOp::Add)},
    {spv::Op::OpAtomicSMin, onAtomic, aux(ir::AtomicOp::SMin)},
    {spv::Op::OpAtomicUMin, onAtomic, aux(ir::AtomicOp::UMin)},
    {spv::Op::OpAtomicSMax, onAtomic, aux(ir::AtomicOp::SMax)},
    {spv::Op::OpAtomicUMax, onAtomic, aux(ir::AtomicOp::UMax)},
    {spv::Op::OpAtomicAnd, onAtomic, aux(ir::AtomicOp::And)},
    {spv::Op::OpAtomicOr, onAtomic, aux(ir::AtomicOp::Or)},
    {spv::Op::OpAtomicXor, onAtomic, aux(ir::AtomicOp::Xor)},
    {spv::Op::OpAtomicFAddEXT, onAtomic, aux(ir::AtomicOp::FAdd)},
    {spv::Op::OpAtomicFMinEXT, onAtomicFloatMinMax, uint32_t(Op::FMin)},
    {spv::Op::OpAtomicFMaxEXT, onAtomicFloatMinMax, uint32_t(Op::FMax)},
};

}  // namespace

std::span<const HandlerEntry> memoryHandlers() { return kHandlers; }

}  // namespace pumice::frontend
