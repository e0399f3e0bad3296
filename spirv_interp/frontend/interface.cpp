// Inputs, outputs, built-ins and resources of the entry point (Vulkan specification, chapter "Shader
// Interfaces").
#include <algorithm>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

struct Translator::IoCursor {
  uint32_t location = ~0u;
  uint32_t component = 0;
  uint32_t index = 0;
  uint32_t builtIn = ~0u;
  Interpolation interpolation = Interpolation::Perspective;
  SampleLocation sampling = SampleLocation::Center;

  void apply(std::span<const Decoration> decorations) {
    for (const Decoration& d : decorations) {
      switch (d.kind) {
        case spv::Decoration::Location: location = d.literal(); break;
        case spv::Decoration::Component: component = d.literal() & 3; break;
        case spv::Decoration::Index: index = d.literal(); break;
        case spv::Decoration::BuiltIn: builtIn = d.literal(); break;
        case spv::Decoration::Flat: interpolation = Interpolation::Flat; break;
        case spv::Decoration::NoPerspective: interpolation = Interpolation::Linear; break;
        case spv::Decoration::Centroid: sampling = SampleLocation::Centroid; break;
        case spv::Decoration::Sample: sampling = SampleLocation::Sample; break;
        default: break;
      }
    }
  }
};

namespace {

constexpr uint32_t kMaxVariableLocations = 16;  // what a 64-bit mask of used components covers
constexpr uint32_t kMaxLocations = 4096;

}  // namespace

uint32_t Translator::locationsOf(uint32_t typeId) const {
  const TypeInfo& t = type(typeId);
  switch (t.kind) {
    case TypeInfo::Vector: return t.count * ir::typeBytes(t.scalar) > 16 ? 2 : 1;
    case TypeInfo::Matrix:
    case TypeInfo::Array: return std::min<uint64_t>(uint64_t(t.count) * locationsOf(t.element), kMaxLocations + 1);
    case TypeInfo::Struct: {
      uint32_t sum = 0;
      for (uint32_t member : t.members) sum = std::min(sum + locationsOf(member), kMaxLocations + 1);
      return sum;
    }
    default: return 1;
  }
}

void Translator::assignIo(uint32_t typeId, IoCursor cursor, std::vector<IoLeaf>& leaves, bool output) {
  const TypeInfo& t = type(typeId);
  if (t.scalars == 0 || t.scalars > 4 * kMaxLocations) fail("an interface variable has the unsupported type %u", typeId);
  if (t.kind == TypeInfo::Struct) {
    uint32_t next = cursor.location;
    for (uint32_t i = 0; i < t.members.size(); i++) {
      IoCursor member = cursor;
      member.location = next;
      member.component = 0;
      member.apply(module.memberDecorations(typeId, i));
      assignIo(t.members[i], member, leaves, output);
      if (member.location != ~0u) next = member.location + locationsOf(t.members[i]);
    }
    return;
  }
  bool nested = t.kind == TypeInfo::Array && scalarInfo(t.element).kind == TypeInfo::Struct;
  bool large = t.kind == TypeInfo::Array && cursor.builtIn == ~0u && locationsOf(typeId) > kMaxVariableLocations;
  if (nested || large) {
    for (uint32_t i = 0; i < t.count; i++) {
      IoCursor element = cursor;
      if (cursor.location != ~0u) element.location += i * locationsOf(t.element);
      assignIo(t.element, element, leaves, output);
    }
    return;
  }
  appendIo(typeId, cursor, leaves, output);
}

void Translator::appendIo(uint32_t typeId, const IoCursor& cursor, std::vector<IoLeaf>& leaves, bool output) {
  const TypeInfo* leaf = &type(typeId);
  uint32_t elements = 1;
  while (leaf->kind == TypeInfo::Array || leaf->kind == TypeInfo::Matrix) {
    elements *= leaf->count;
    leaf = &type(leaf->element);
  }
  uint32_t components = leaf->kind == TypeInfo::Vector ? leaf->count : 1;
  bool wide = ir::typeBytes(leaf->scalar) == 8;
  uint32_t perLocation = wide ? 2 : 4;
  uint32_t locationsPerElement = (components + perLocation - 1) / perLocation;
  bool builtIn = cursor.builtIn != ~0u;
  if (!builtIn && cursor.location == ~0u) fail("an interface variable has no Location");
  if (!builtIn && cursor.location > kMaxLocations) fail("Location %u is out of range", cursor.location);

  InterfaceVariable variable;
  variable.location = builtIn ? cursor.builtIn : cursor.location;
  variable.component = cursor.component;
  variable.index = cursor.index;
  variable.locations = builtIn ? 1 : elements * locationsPerElement;
  variable.components = builtIn ? elements * components : std::min(components, perLocation);
  variable.type = leaf->scalar;
  variable.isSigned = leaf->isSigned;
  variable.builtIn = builtIn;
  variable.interpolation = cursor.interpolation;
  variable.sampling = cursor.sampling;
  // Being in the interface is enough, read or not (Vulkan specification, "Sample Shading").
  const auto is = [&](spv::BuiltIn which) { return builtIn && variable.location == uint32_t(which); };
  if (!output && (variable.sampling == SampleLocation::Sample || is(spv::BuiltIn::SampleId) || is(spv::BuiltIn::SamplePosition)))
    shader.usesSampleRate = true;

  // Built-in inputs are not listed among the inputs: Builtin operations name them.
  uint32_t number = ~0u;
  if (output || !builtIn) {
    auto& list = output ? shader.outputs : shader.inputs;
    number = uint32_t(list.size());
    list.push_back(variable);
  }
  for (uint32_t e = 0; e < elements; e++) {
    for (uint32_t k = 0; k < components; k++) {
      uint32_t component = builtIn ? e * components + k
                                   : (e * locationsPerElement + k / perLocation) * 4 + k % perLocation;
      leaves.push_back({number, component, cursor.builtIn});
    }
  }
}

Value Translator::readInput(const IoLeaf& leaf, Type type) {
  if (leaf.builtIn == ~0u)
    return b.emit(Op::ShaderInput, type, {}, uint64_t(leaf.variable) << 32 | leaf.component);
  if (Value v = subgroupBuiltIn(spv::BuiltIn(leaf.builtIn), leaf.component)) return resize(v, type, false);
  switch (spv::BuiltIn(leaf.builtIn)) {
    case spv::BuiltIn::HelperInvocation: return 0;  // changes while the shader runs: read at each load
    case spv::BuiltIn::DeviceIndex: return b.i32(0);
    default: return b.emit(Op::Builtin, type, {}, uint64_t(leaf.builtIn) << 32 | leaf.component);
  }
}

void Translator::declareInput(Variable& variable) {
  std::vector<IoLeaf> leaves;
  IoCursor cursor;
  cursor.apply(module.decorations(variable.id));
  assignIo(variable.type, cursor, leaves, false);
  flatten(variable.type, variable.types);
  if (leaves.size() != variable.types.size()) fail("input %u has an unsupported shape", variable.id);
  std::vector<Value> values;
  for (size_t i = 0; i < leaves.size(); i++) values.push_back(readInput(leaves[i], variable.types[i]));
  io_[&variable] = std::move(leaves);
  if (isDynamic(variable.id)) {
    declareLocal(variable);
    for (Value& value : values)
      if (!value) value = b.emit(Op::HelperMask, Type::Mask, {});
    store(pointerTo(variable), values);
  } else {
    variable.home = Home::Values;
    variable.scalars = std::move(values);
  }
}

void Translator::declareOutput(Variable& variable) {
  std::vector<IoLeaf> leaves;
  IoCursor cursor;
  cursor.apply(module.decorations(variable.id));
  assignIo(variable.type, cursor, leaves, true);
  flatten(variable.type, variable.types);
  if (leaves.size() != variable.types.size()) fail("output %u has an unsupported shape", variable.id);
  variable.written.assign(leaves.size(), 0);
  io_[&variable] = std::move(leaves);
  if (isDynamic(variable.id)) {
    declareLocal(variable);
  } else {
    variable.home = Home::Registers;
    for (Type type : variable.types) variable.scalars.push_back(b.var(type));
  }
}

void Translator::flushOutputs() {
  for (Variable& variable : variables) {
    if (variable.storage != spv::StorageClass::Output) continue;
    const std::vector<IoLeaf>& leaves = io_[&variable];
    bool any = std::any_of(variable.written.begin(), variable.written.end(), [](uint8_t w) { return w != 0; });
    if (!any) continue;
    std::vector<Value> values = load(pointerTo(variable));
    for (size_t i = 0; i < leaves.size(); i++)
      if (variable.written[i])
        b.emit(Op::ShaderOutput, Type::None, {values[i]}, uint64_t(leaves[i].variable) << 32 | leaves[i].component);
  }
}

std::vector<Value> Translator::interpolateAt(const Pointer& p, SampleLocation sampling,
                                            std::span<const Value> operands) {
  if (!p.variable || p.variable->storage != spv::StorageClass::Input ||
      (p.home != Home::Values && p.home != Home::Local))
    fail("InterpolateAt of something other than an input");
  const std::vector<IoLeaf>& leaves = io_[p.variable];
  auto at = [&](size_t scalar) {
    const IoLeaf& leaf = leaves.at(scalar);
    if (leaf.builtIn != ~0u) fail("InterpolateAt of a built-in");
    // The interpolant at another place is another input with the same location.
    uint32_t number = leaf.variable;
    if (sampling != shader.inputs[number].sampling) {
      uint64_t key = uint64_t(number) << 8 | uint64_t(sampling);
      auto [known, isNew] = interpolatedInputs_.try_emplace(key, uint32_t(shader.inputs.size()));
      number = known->second;
      if (isNew) {
        InterfaceVariable copy = shader.inputs[leaf.variable];
        copy.sampling = sampling;
        shader.inputs.push_back(copy);
      }
    }
    return b.emit(Op::ShaderInput, p.variable->types.at(scalar), operands, uint64_t(number) << 32 | leaf.component);
  };
  std::vector<Value> values;
  if (p.home == Home::Values) {
    for (uint32_t i = 0; i < type(p.type).scalars; i++) values.push_back(at(p.offset + i));
    return values;
  }
  // Indexed dynamically: all of the variable at that place, in memory of its own.
  for (size_t i = 0; i < leaves.size(); i++) values.push_back(at(i));
  Variable& moved = variables.emplace_back();
  moved.type = p.variable->type;
  moved.storage = spv::StorageClass::Function;
  moved.types = p.variable->types;
  declareLocal(moved);
  store(pointerTo(moved), values);
  Pointer element = p;
  element.variable = &moved;
  return load(element);
}

std::pair<bool, bool> Translator::onMembers(uint32_t structType, spv::Decoration kind) {
  auto [at, isNew] = memberDecorations_.try_emplace(uint64_t(structType) << 32 | uint32_t(kind), false, false);
  if (!isNew) return at->second;
  const TypeInfo& t = type(structType);
  size_t found = 0;
  for (uint32_t i = 0; i < t.members.size(); i++) found += module.findMember(structType, i, kind) != nullptr;
  return at->second = {found != 0, found && found == t.members.size()};
}

uint32_t Translator::resourceOf(Variable& variable) {
  if (variable.resource != ~0u) return variable.resource;
  Resource resource;
  const Decoration* set = module.find(variable.id, spv::Decoration::DescriptorSet);
  const Decoration* binding = module.find(variable.id, spv::Decoration::Binding);
  if (!set || !binding) fail("resource %u has no DescriptorSet and Binding", variable.id);
  resource.set = set->literal();
  resource.binding = binding->literal();
  if (resource.set >= ir::kMaxDescriptorSets) fail("descriptor set %u is out of range", resource.set);
  if (const Decoration* d = module.find(variable.id, spv::Decoration::InputAttachmentIndex))
    resource.inputAttachmentIndex = d->literal();

  uint64_t count = 1;
  uint32_t typeId = variable.type;
  while (type(typeId).kind == TypeInfo::Array || type(typeId).kind == TypeInfo::RuntimeArray) {
    count = type(typeId).kind == TypeInfo::Array ? count * type(typeId).count : 0;
    typeId = type(typeId).element;
    if (count > UINT32_MAX) fail("resource %u is too large an array", variable.id);
  }
  resource.arraySize = uint32_t(count);
  const TypeInfo& t = type(typeId);
  bool nonWritable = module.find(variable.id, spv::Decoration::NonWritable) != nullptr;
  auto imageKind = [](const Instruction& image) {
    bool storage = image.operand(5) == 2;  // "Sampled" operand: used without a sampler
    switch (spv::Dim(image.operand(1))) {
      case spv::Dim::Buffer: return storage ? ResourceKind::StorageTexelBuffer : ResourceKind::UniformTexelBuffer;
      case spv::Dim::SubpassData: return ResourceKind::InputAttachment;
      default: return storage ? ResourceKind::StorageImage : ResourceKind::SampledImage;
    }
  };
  switch (t.kind) {
    case TypeInfo::Struct: {
      bool storage = variable.storage == spv::StorageClass::StorageBuffer ||
                     module.find(typeId, spv::Decoration::BufferBlock) != nullptr;
      resource.kind = storage ? ResourceKind::StorageBuffer : ResourceKind::UniformBuffer;
      nonWritable |= onMembers(typeId, spv::Decoration::NonWritable).second || !storage;
      break;
    }
    case TypeInfo::Image: resource.kind = imageKind(*t.image); break;
    case TypeInfo::Sampler: resource.kind = ResourceKind::Sampler; break;
    case TypeInfo::SampledImage:
      resource.kind = ResourceKind::CombinedImageSampler;
      if (imageKind(*type(t.element).image) == ResourceKind::UniformTexelBuffer)
        resource.kind = ResourceKind::UniformTexelBuffer;
      break;
    default: fail("resource %u has an unsupported type", variable.id);
  }
  resource.readOnly = nonWritable;
  variable.resource = uint32_t(shader.resources.size());
  shader.resources.push_back(resource);
  return variable.resource;
}

void Translator::useElement(uint32_t resource, Value element) {
  uint64_t index = 0;
  if (element && !b.isConstant(element, &index))
    shader.resources[resource].dynamicIndex = true;
  else if (index < 64)
    shader.resources[resource].usedConstantElements |= uint64_t(1) << index;
}

void Translator::declareVariable(const Instruction& inst) {
  const TypeInfo& pointerType = type(inst.resultType);
  if (pointerType.kind != TypeInfo::Pointer) fail("variable %u is not of a pointer type", inst.result);
  uint32_t typeId = pointerType.element;
  Variable& variable = variables.emplace_back();
  variable.id = inst.result;
  variable.type = typeId;
  variable.storage = pointerType.storage;
  variable.resource = ~0u;
  variableOfId[inst.result] = &variable;
  auto hasDecoration = [&](spv::Decoration kind) {
    if (module.find(inst.result, kind)) return true;
    const TypeInfo* t = &type(typeId);
    uint32_t id = typeId;
    while (t->kind == TypeInfo::Array || t->kind == TypeInfo::RuntimeArray) {
      id = t->element;
      t = &type(id);
    }
    return onMembers(id, kind).first;
  };
  switch (variable.storage) {
    case spv::StorageClass::Input: declareInput(variable); break;
    case spv::StorageClass::Output:
      declareOutput(variable);
      break;
    case spv::StorageClass::Private:
    case spv::StorageClass::Function:
      b.setInstFlags(ir::kInstDeclaredVariable);
      if (isDynamic(inst.result)) {
        declareLocal(variable);
      } else {
        variable.home = Home::Registers;
        flatten(typeId, variable.types);
        for (Type t : variable.types) variable.scalars.push_back(b.var(t));
      }
      b.setInstFlags(0);
      break;
    case spv::StorageClass::Workgroup: {
      const TypeInfo& t = type(typeId);
      variable.home = Home::Shared;
      uint64_t at = (uint64_t(shader.function.sharedBytes) + 15) / 16 * 16;
      if (!t.hasValue() || t.naturalSize > kMaxSharedBytes - std::min<uint64_t>(at, kMaxSharedBytes))
        fail("work-group memory is too large");
      variable.offset = uint32_t(at);
      shader.function.sharedBytes = uint32_t(at + t.naturalSize);
      break;
    }
    case spv::StorageClass::Uniform:
    case spv::StorageClass::StorageBuffer: {
      variable.home = Home::Buffer;
      bool storage = variable.storage == spv::StorageClass::StorageBuffer;
      const TypeInfo* t = &type(typeId);
      uint32_t id = typeId;
      while (t->kind == TypeInfo::Array || t->kind == TypeInfo::RuntimeArray) {
        id = t->element;
        t = &type(id);
      }
      storage |= module.find(id, spv::Decoration::BufferBlock) != nullptr;
      variable.isVolatile = hasDecoration(spv::Decoration::Volatile) || hasDecoration(spv::Decoration::Coherent);
      variable.constant = !variable.isVolatile && (!storage || !anyMemoryWrites);
      break;
    }
    case spv::StorageClass::PushConstant: variable.home = Home::Push; break;
    case spv::StorageClass::UniformConstant: variable.home = Home::Opaque; break;
    default: fail("storage class %u is not supported", uint32_t(variable.storage));
  }
  Pointer p = pointerTo(variable);
  if (inst.count() >= 2) {
    if (variable.home != Home::Registers && variable.home != Home::Local && variable.home != Home::Shared)
      fail("variable %u may not have an initializer", inst.result);
    if (variable.home == Home::Shared) {
      zeroedShared.push_back({variable.offset, shader.function.sharedBytes});
      // Work-group memory is zero when the group starts (shader.h), which is all that Vulkan allows here.
      for (Value v : data(inst.operand(1))) {
        uint64_t bits = 0;
        if (!b.isConstant(v, &bits) || bits) fail("work-group variable %u has an initializer other than zero", inst.result);
      }
    } else {
      store(p, data(inst.operand(1)));
      markWritten(p);
    }
  }
  Val v;
  v.kind = Val::Ptr;
  v.type = inst.resultType;
  if (variablePointers) v.scalars = pointerScalars(p);
  v.pointer = std::make_shared<Pointer>(p);
  setVal(inst.result, std::move(v));
}

namespace {

//! Takes away the variables that are not used; gives the new number of each.
std::vector<uint32_t> compact(std::vector<InterfaceVariable>& variables) {
  std::vector<uint32_t> number(variables.size());
  std::vector<InterfaceVariable> kept;
  for (size_t i = 0; i < variables.size(); i++) {
    number[i] = uint32_t(kept.size());
    if (variables[i].usedComponents) kept.push_back(variables[i]);
  }
  variables = std::move(kept);
  return number;
}

}  // namespace

void Translator::finishInterface() {
  ir::Function& f = shader.function;
  std::set<uint32_t> builtIns;
  for (const ir::Inst& inst : f.insts) {
    uint32_t high = uint32_t(inst.imm >> 32), low = uint32_t(inst.imm);
    switch (inst.op) {
      case Op::ShaderInput:
        if (low < 64) shader.inputs[high].usedComponents |= uint64_t(1) << low;
        break;
      case Op::ShaderOutput:
        if (low < 64) shader.outputs[high].usedComponents |= uint64_t(1) << low;
        break;
      case Op::Builtin: builtIns.insert(high); break;
      case Op::QuadDdx:
      case Op::QuadDdy:
      case Op::QuadSwizzle: shader.usesDerivatives = true; break;
      case Op::ImageOp: {
        const ir::ImageOpInfo& info = f.imageOps[low];
        if (info.implicitLod || info.kind == ir::ImageKind::QueryLod) shader.usesDerivatives = true;
        if (info.kind == ir::ImageKind::Write || info.kind == ir::ImageKind::Atomic) shader.writesMemory = true;
        break;
      }
      case Op::Demote: shader.mayDiscard = true; break;
      case Op::Store:
      case Op::Atomic:
      case Op::AtomicCas: shader.writesMemory = true; break;
      case Op::Barrier: shader.usesBarrier = true; break;
      default: break;
    }
  }
  if (storesThroughVariablePointers)
    for (Resource& resource : shader.resources)
      if (resource.kind == ResourceKind::StorageBuffer) resource.readOnly = false;
  std::vector<uint32_t> inputNumber = compact(shader.inputs), outputNumber = compact(shader.outputs);
  for (ir::Inst& inst : f.insts) {
    if (inst.op != Op::ShaderInput && inst.op != Op::ShaderOutput) continue;
    uint64_t number = (inst.op == Op::ShaderInput ? inputNumber : outputNumber)[inst.imm >> 32];
    inst.imm = number << 32 | uint32_t(inst.imm);
  }
  shader.inputBuiltIns.assign(builtIns.begin(), builtIns.end());
  for (const InterfaceVariable& output : shader.outputs)
    if (output.builtIn && output.location == uint32_t(spv::BuiltIn::FragDepth) && output.usedComponents)
      shader.writesDepth = true;
}

}  // namespace pumice::frontend
