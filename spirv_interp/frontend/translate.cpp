#include "spirv_interp/frontend/translator.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdarg>
#include <iterator>
#include <new>
#include <type_traits>

#include "spirv_interp/frontend/support.h"
#include "spirv_interp/ir/checks.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::frontend {

void fail(const char* format, ...) {
  char text[512];
  va_list args;
  va_start(args, format);
  std::vsnprintf(text, sizeof text, format, args);
  va_end(args);
  throw TranslateError{text};
}

namespace {

std::optional<Stage> stageOf(spv::ExecutionModel model) {
  switch (model) {
    case spv::ExecutionModel::Vertex: return Stage::Vertex;
    case spv::ExecutionModel::TessellationControl: return Stage::TessControl;
    case spv::ExecutionModel::TessellationEvaluation: return Stage::TessEval;
    case spv::ExecutionModel::Geometry: return Stage::Geometry;
    case spv::ExecutionModel::Fragment: return Stage::Fragment;
    case spv::ExecutionModel::GLCompute: return Stage::Compute;
    default: return std::nullopt;
  }
}

// Sorted by opcode. Nothing to destroy: threads of the application may compile while the process already exits.
struct Handlers {
  std::array<const HandlerEntry*, 1024> entries{};
  size_t count = 0;
};
static_assert(std::is_trivially_destructible_v<Handlers>);

Handlers joinHandlers() {
  Handlers all;
  for (auto table : {arithmeticHandlers(), compositeHandlers(), memoryHandlers(), imageHandlers(), controlHandlers(),
                     subgroupHandlers()})
    for (const HandlerEntry& entry : table) all.entries.at(all.count++) = &entry;
  std::stable_sort(all.entries.begin(), all.entries.begin() + all.count, [](auto* a, auto* b) { return a->op < b->op; });
  return all;
}

bool isConstantOp(spv::Op op) {
  return (op >= spv::Op::OpConstantTrue && op <= spv::Op::OpSpecConstantOp) || op == spv::Op::OpUndef;
}

bool isTypeOp(spv::Op op) {
  return (op >= spv::Op::OpTypeVoid && op <= spv::Op::OpTypeForwardPointer);
}

}  // namespace

const HandlerEntry* findHandler(spv::Op op) {
  static const Handlers all = joinHandlers();
  const auto end = all.entries.begin() + all.count;
  const auto at = std::lower_bound(all.entries.begin(), end, op, [](auto* entry, spv::Op wanted) { return entry->op < wanted; });
  return at == end || (*at)->op != op ? nullptr : *at;
}

bool handledElsewhere(spv::Op op) {
  using O = spv::Op;
  static constexpr O kOps[] = {
      O::OpSource, O::OpSourceContinued, O::OpSourceExtension, O::OpName, O::OpMemberName, O::OpString, O::OpLine,
      O::OpNoLine, O::OpModuleProcessed, O::OpExtension, O::OpExtInstImport, O::OpMemoryModel, O::OpEntryPoint,
      O::OpExecutionMode, O::OpExecutionModeId, O::OpCapability, O::OpDecorate, O::OpDecorateId, O::OpMemberDecorate,
      O::OpDecorationGroup, O::OpGroupDecorate, O::OpGroupMemberDecorate, O::OpDecorateString, O::OpMemberDecorateString,
      O::OpFunction, O::OpFunctionParameter, O::OpFunctionEnd, O::OpFunctionCall, O::OpVariable, O::OpPhi, O::OpLabel,
      O::OpBranch, O::OpBranchConditional, O::OpSwitch, O::OpKill, O::OpReturn, O::OpReturnValue, O::OpUnreachable,
      O::OpTerminateInvocation, O::OpConstantTrue, O::OpConstantFalse, O::OpConstant, O::OpConstantComposite,
      O::OpConstantNull, O::OpSpecConstantTrue, O::OpSpecConstantFalse, O::OpSpecConstant, O::OpSpecConstantComposite,
      O::OpSpecConstantOp, O::OpTypeVoid, O::OpTypeBool, O::OpTypeInt, O::OpTypeFloat, O::OpTypeVector, O::OpTypeMatrix,
      O::OpTypeImage, O::OpTypeSampler, O::OpTypeSampledImage, O::OpTypeArray, O::OpTypeRuntimeArray, O::OpTypeStruct,
      O::OpTypePointer, O::OpTypeFunction, O::OpTypeForwardPointer};
  return std::find(std::begin(kOps), std::end(kOps), op) != std::end(kOps);
}

Translator::Translator(const Module& m, Shader& s, std::span<const SpecializationConstant> specialization)
    : module(m), shader(s), b(s.function), checks(ir::wantedChecks()), slots_(m.bound) {
  for (const SpecializationConstant& constant : specialization) specialization_[constant.id] = constant.data;
}

// --- values

void Translator::setVal(uint32_t id, Val v) {
  if (id == 0 || id >= slots_.size()) fail("id %u is out of bounds", id);
  if (!slots_[id]) {
    values_.emplace_back();
    slots_[id] = uint32_t(values_.size());
  }
  // Copies of large values cost no instructions, so they are counted here.
  valueScalars_ += v.scalars.size();
  if (valueScalars_ > kMaxCopiedScalars) fail("the values of the shader are too large");
  values_[slots_[id] - 1] = std::move(v);
}

const Val& Translator::val(uint32_t id) const {
  if (id >= slots_.size() || !slots_[id]) fail("id %u is used before it has a value", id);
  return values_[slots_[id] - 1];
}

const std::vector<Value>& Translator::data(uint32_t id) const {
  const Val& v = val(id);
  if (v.kind != Val::Data && v.scalars.empty()) fail("id %u is not a value", id);
  return v.scalars;
}

Value Translator::scalar(uint32_t id) const {
  const std::vector<Value>& v = data(id);
  if (v.size() != 1) fail("id %u is not a scalar", id);
  return v[0];
}

const Opaque& Translator::opaque(uint32_t id) const {
  const Val& v = val(id);
  if (v.kind != Val::Opq) fail("id %u is not an image or sampler", id);
  return *v.opaque;
}

void Translator::define(const Instruction& inst, std::vector<Value> scalars) {
  const TypeInfo& t = type(inst.resultType);
  if (!t.hasValue() || scalars.size() != t.scalars)
    fail("%s gives %zu scalars where its type has %u", opcodeName(inst.op).c_str(), scalars.size(), t.scalars);
  Val v;
  v.kind = Val::Data;
  v.type = inst.resultType;
  v.scalars = std::move(scalars);
  setVal(inst.result, std::move(v));
}

void Translator::defineOpaque(const Instruction& inst, Opaque opaque) {
  Val v;
  v.kind = Val::Opq;
  v.type = inst.resultType;
  v.opaque = std::make_shared<Opaque>(opaque);
  setVal(inst.result, std::move(v));
}

std::vector<Value> Translator::zeros(uint32_t typeId) {
  std::vector<Type> types;
  flatten(typeId, types);
  std::vector<Value> out;
  for (Type t : types) out.push_back(b.zero(t));
  return out;
}

std::optional<uint64_t> Translator::constantOf(uint32_t id) const {
  const Val& v = val(id);
  uint64_t bits = 0;
  if (v.kind != Val::Data || v.scalars.size() != 1 || !b.isConstant(v.scalars[0], &bits)) return std::nullopt;
  return bits;
}

uint64_t Translator::requireConstant(uint32_t id, const char* what) const {
  auto bits = constantOf(id);
  if (!bits) fail("%s %u is not constant", what, id);
  return *bits;
}

Value Translator::watchedLanes() {
  return stage == Stage::Fragment ? b.maskNot(b.emit(Op::HelperMask, Type::Mask, {})) : b.mask(true);
}

void Translator::translateInstruction(const Instruction& inst) {
  const HandlerEntry* entry = findHandler(inst.op);
  if (!entry) {
    const char* why = whyNotOpcode(inst.op);
    fail("%s %s", opcodeName(inst.op).c_str(), why ? why : "is not supported");
  }
  entry->handler(*this, inst, entry->aux);
}

// --- the whole

void Translator::checkCapabilities() {
  for (uint32_t capability : module.capabilities) {
    if (supportsCapability(capability)) continue;
    const char* why = whyNotCapability(capability);
    fail("the capability %s %s", capabilityName(capability).c_str(), why ? why : "is not supported");
  }
}

// Whether any function that the entry point reaches may write memory that others see.
void Translator::findMemoryWrites(const EntryPoint& entry) {
  std::vector<uint32_t> work{entry.function};
  std::unordered_set<uint32_t> seen;
  auto isShared = [&](uint32_t pointerId) {
    const Instruction* def = module.definition(pointerId);
    const Instruction* pointerType = def ? module.definition(def->resultType) : nullptr;
    if (!pointerType || pointerType->op != spv::Op::OpTypePointer) return true;
    switch (spv::StorageClass(pointerType->operand(0))) {
      case spv::StorageClass::Function:
      case spv::StorageClass::Private:
      case spv::StorageClass::Input:
      case spv::StorageClass::Output:
      case spv::StorageClass::Workgroup: return false;
      default: return true;
    }
  };
  while (!work.empty()) {
    uint32_t id = work.back();
    work.pop_back();
    auto at = module.functionOfId.find(id);
    if (at == module.functionOfId.end() || !seen.insert(id).second) continue;
    for (const BasicBlock& block : module.functions[at->second].blocks) {
      for (uint32_t i = block.first; i < block.end; i++) {
        const Instruction& inst = module.instructions[i];
        if (inst.op == spv::Op::OpFunctionCall) work.push_back(inst.operand(0));
        bool atomic = inst.op >= spv::Op::OpAtomicLoad && inst.op <= spv::Op::OpAtomicXor;
        if (atomic || inst.op == spv::Op::OpStore || inst.op == spv::Op::OpCopyMemory ||
            inst.op == spv::Op::OpAtomicFAddEXT || inst.op == spv::Op::OpAtomicFMinEXT ||
            inst.op == spv::Op::OpAtomicFMaxEXT)
          anyMemoryWrites |= isShared(inst.operand(0));
        if (inst.op == spv::Op::OpImageWrite) anyMemoryWrites = true;
      }
    }
  }
}

void Translator::applyExecutionModes(const EntryPoint& entry) {
  for (const Instruction* inst : module.executionModes) {
    if (inst->operand(0) != entry.function) continue;
    if (const char* why = whyNotExecutionMode(inst->operand(1), inst->operand(2)))
      fail("the execution mode %s %s", executionModeName(inst->operand(1)).c_str(), why);
    switch (spv::ExecutionMode(inst->operand(1))) {
      case spv::ExecutionMode::LocalSize:
        for (unsigned i = 0; i < 3; i++) shader.localSize[i] = inst->operand(2 + i);
        break;
      case spv::ExecutionMode::LocalSizeId:
        for (unsigned i = 0; i < 3; i++)
          shader.localSize[i] = uint32_t(requireConstant(inst->operand(2 + i), "work-group size"));
        break;
      case spv::ExecutionMode::EarlyFragmentTests: shader.earlyFragmentTests = true; break;
      default: break;  // the origin is the only one Vulkan has; the others say what may be assumed
    }
  }
  if (workgroupSizeConstant_) {
    const std::vector<Value>& size = data(workgroupSizeConstant_);
    uint64_t bits = 0;
    for (unsigned i = 0; i < 3 && i < size.size(); i++) {
      if (!b.isConstant(size[i], &bits)) fail("the work-group size is not constant");
      shader.localSize[i] = uint32_t(bits);
    }
  }
  if (stage == Stage::Compute)
    for (uint32_t n : shader.localSize)
      if (n == 0 || n > 65536) fail("a work-group dimension of %u", n);
}

void Translator::run(Stage wanted, std::string_view name) {
  stage = shader.stage = wanted;
  const EntryPoint* entry = nullptr;
  for (const EntryPoint& candidate : module.entryPoints)
    if (candidate.name == name && stageOf(candidate.model) == wanted) entry = &candidate;
  if (!entry) fail("there is no entry point \"%.*s\" for this stage", int(std::min<size_t>(name.size(), 200)), name.data());
  if (wanted != Stage::Vertex && wanted != Stage::Fragment && wanted != Stage::Compute)
    fail("geometry and tessellation shaders are not supported");
  checkCapabilities();
  auto has = [&](spv::Capability c) {
    return std::find(module.capabilities.begin(), module.capabilities.end(), uint32_t(c)) != module.capabilities.end();
  };
  b.reserve(std::min<size_t>(module.instructions.size(), 1 << 14));
  variablePointers = has(spv::Capability::VariablePointers) || has(spv::Capability::VariablePointersStorageBuffer);
  shader.function.name = entry->name;
  shader.sources = module.sources;
  findMemoryWrites(*entry);
  findDynamicVariables();

  std::unordered_set<uint32_t> interface(entry->interface.begin(), entry->interface.end());
  for (uint32_t i = 0; i < module.globalsEnd; i++) {
    const Instruction& inst = module.instructions[i];
    if (isTypeOp(inst.op)) {
      translateType(inst);
    } else if (isConstantOp(inst.op)) {
      translateConstant(inst);
    }
  }
  // Built-ins depend on the size of the work group.
  applyExecutionModes(*entry);
  for (uint32_t i = 0; i < module.globalsEnd; i++) {
    const Instruction& inst = module.instructions[i];
    if (inst.op == spv::Op::OpVariable) {
      auto storage = spv::StorageClass(inst.operand(0));
      bool io = storage == spv::StorageClass::Input || storage == spv::StorageClass::Output;
      // Other entry points' variables are none of our business.
      if ((io || module.version >= 0x00010400) && !interface.count(inst.result)) continue;
      declareVariable(inst);
      if (shader.function.insts.size() > kMaxInstructions) fail("the shader's variables are too large");
    }
  }

  auto main = module.functionOfId.find(entry->function);
  if (main == module.functionOfId.end()) fail("the entry point's function does not exist");
  exitDepth_ = b.breakDepth();
  b.beginBlock();
  frames_.emplace_back();
  translateBody(module.functions[main->second]);
  frames_.pop_back();
  b.setLine(0);
  flushOutputs();
  b.endBlock();
}

namespace {

base::Status check(const ir::Function& f, const char* when) {
  std::string problem = ir::verify(f);
  if (problem.empty()) return {};
  return base::errorf("internal error in shader \"%s\" %s: %s", f.name.c_str(), when, problem.c_str());
}

std::atomic<uint64_t> translated;

}  // namespace

uint64_t translations() { return translated; }

Result<std::shared_ptr<const Shader>> translate(const Module& module, Stage stage, std::string_view entryPoint,
                                               std::span<const SpecializationConstant> specialization) {
  auto where = [&] { return std::string(entryPoint.substr(0, 200)); };
  ++translated;
  try {
    auto shader = std::make_shared<Shader>();
    Translator translator(module, *shader, specialization);
    translator.run(stage, entryPoint);
    tidy(shader->function);
    PUMICE_TRY(check(shader->function, "after translation"));
    if (translator.checks) {
      ir::insertChecks(shader->function, translator.checks, stage == Stage::Fragment, translator.zeroedShared);
      PUMICE_TRY(check(shader->function, "with checks"));
    }
    ir::optimise(shader->function);
#ifndef NDEBUG
    PUMICE_TRY(check(shader->function, "after optimisation"));   // routines are verified again
#endif
    translator.finishInterface();
    return std::shared_ptr<const Shader>(std::move(shader));
  } catch (const TranslateError& error) {
    return base::errorf("shader \"%s\": %s", where().c_str(), error.message.c_str());
  } catch (const std::bad_alloc&) {
    return base::errorf("shader \"%s\": out of memory", where().c_str());
  } catch (const std::exception& error) {
    return base::errorf("shader \"%s\": %s", where().c_str(), error.what());
  }
}

}  // namespace pumice::frontend
