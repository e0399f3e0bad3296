#include "spirv_interp/frontend/module.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <system_error>

#include <spirv-tools/libspirv.h>

#include "spirv_interp/frontend/shader.h"

namespace pumice::frontend {

namespace {

constexpr OpcodeInfo kOpcodes[] = {
#define PUMICE_SPIRV_OP(number, name, hasType, hasResult) {number, #name, hasType, hasResult},
#include "spirv_interp/frontend/grammar.inc"
#undef PUMICE_SPIRV_OP
};

constexpr uint32_t kHeaderWords = 5;
// The universal limit of the specification (section 2.17).
constexpr uint32_t kMaxBound = 0x3fffff;
constexpr uint64_t kMaxGroupDecorations = 1'000'000;  // they multiply: decorations times targets
constexpr uint32_t kVersion1_6 = 0x00010600;

bool isTerminator(spv::Op op) {
  switch (op) {
    case spv::Op::OpBranch:
    case spv::Op::OpBranchConditional:
    case spv::Op::OpSwitch:
    case spv::Op::OpReturn:
    case spv::Op::OpReturnValue:
    case spv::Op::OpKill:
    case spv::Op::OpTerminateInvocation:
    case spv::Op::OpUnreachable:
      return true;
    default:
      return false;
  }
}

}  // namespace

const OpcodeInfo* opcodeInfo(uint32_t opcode) {
  auto at = std::lower_bound(std::begin(kOpcodes), std::end(kOpcodes), opcode,
                             [](const OpcodeInfo& info, uint32_t number) { return info.opcode < number; });
  return at != std::end(kOpcodes) && at->opcode == opcode ? at : nullptr;
}

std::span<const OpcodeInfo> allOpcodes() { return kOpcodes; }

std::string opcodeName(spv::Op op) {
  const OpcodeInfo* info = opcodeInfo(uint32_t(op));
  return info ? info->name : "opcode " + std::to_string(uint32_t(op));
}

std::string literalString(std::span<const uint32_t> words, size_t* wordCount) {
  std::string text;
  for (size_t i = 0; i < words.size(); i++) {
    for (unsigned byte = 0; byte < 4; byte++) {
      char c = char(words[i] >> (8 * byte) & 0xff);
      if (!c) {
        if (wordCount) *wordCount = i + 1;
        return text;
      }
      text.push_back(c);
    }
  }
  if (wordCount) *wordCount = words.size();
  return text;
}

std::span<const Decoration> Module::decorations(uint32_t id) const {
  auto at = decorations_.find(id);
  return at == decorations_.end() ? std::span<const Decoration>() : at->second;
}

std::span<const Decoration> Module::memberDecorations(uint32_t structType, uint32_t member) const {
  auto at = memberDecorations_.find(uint64_t(structType) << 32 | member);
  return at == memberDecorations_.end() ? std::span<const Decoration>() : at->second;
}

const Decoration* Module::findIn(std::span<const Decoration> list, spv::Decoration kind) {
  for (const Decoration& decoration : list)
    if (decoration.kind == kind) return &decoration;
  return nullptr;
}

void Module::decorate(const Instruction& inst) {
  auto copyGroup = [&](uint32_t group) {
    auto list = decorations(group);
    return std::vector<Decoration>(list.begin(), list.end());
  };
  switch (inst.op) {
    case spv::Op::OpDecorate:
    case spv::Op::OpDecorateId:
      if (inst.count() >= 2)
        decorations_[inst.operand(0)].push_back({spv::Decoration(inst.operand(1)), inst.operands.subspan(2)});
      break;
    case spv::Op::OpMemberDecorate:
      if (inst.count() >= 3)
        memberDecorations_[uint64_t(inst.operand(0)) << 32 | inst.operand(1)].push_back(
            {spv::Decoration(inst.operand(2)), inst.operands.subspan(3)});
      break;
    case spv::Op::OpGroupDecorate:
      for (size_t i = 1; i < inst.count() && groupDecorations_ <= kMaxGroupDecorations; i++)
        for (const Decoration& decoration : copyGroup(inst.operand(0)))
          if (++groupDecorations_ <= kMaxGroupDecorations) decorations_[inst.operand(i)].push_back(decoration);
      break;
    case spv::Op::OpGroupMemberDecorate:
      for (size_t i = 1; i + 1 < inst.count() && groupDecorations_ <= kMaxGroupDecorations; i += 2)
        for (const Decoration& decoration : copyGroup(inst.operand(0)))
          if (++groupDecorations_ <= kMaxGroupDecorations)
            memberDecorations_[uint64_t(inst.operand(i)) << 32 | inst.operand(i + 1)].push_back(decoration);
      break;
    default:
      break;
  }
}

base::Status Module::cut() {
  if (words.size() < kHeaderWords) return base::errorf("SPIR-V: %zu words are too few for a header", words.size());
  if (words[0] == __builtin_bswap32(spv::MagicNumber))
    for (uint32_t& word : words) word = __builtin_bswap32(word);
  if (words[0] != spv::MagicNumber) return base::errorf("SPIR-V: wrong magic number 0x%08x", words[0]);
  version = words[1];
  if (version < 0x00010000 || version > kVersion1_6)
    return base::errorf("SPIR-V: version 0x%08x is not supported", version);
  bound = words[3];
  if (bound == 0 || bound > kMaxBound) return base::errorf("SPIR-V: id bound %u is out of range", bound);

  definitions_.assign(bound, 0);
  instructions.reserve((words.size() - kHeaderWords) / 4 + 1);
  uint32_t line = 0;
  std::unordered_map<uint32_t, uint32_t> smallConstants;  // for DebugLine
  uint32_t debugSet = 0;
  for (size_t at = kHeaderWords; at < words.size();) {
    uint32_t length = words[at] >> 16;
    uint32_t opcode = words[at] & 0xffff;
    if (length == 0 || length > words.size() - at)
      return base::errorf("SPIR-V: instruction at word %zu has the impossible length %u", at, length);
    const OpcodeInfo* info = opcodeInfo(opcode);
    if (!info) return base::errorf("SPIR-V: unknown opcode %u at word %zu", opcode, at);
    if (length < 1u + info->hasResultType + info->hasResult)
      return base::errorf("SPIR-V: %s at word %zu is too short", info->name, at);
    Instruction inst;
    inst.op = spv::Op(opcode);
    size_t next = at + 1;
    if (info->hasResultType) inst.resultType = words[next++];
    if (info->hasResult) inst.result = words[next++];
    inst.operands = std::span<const uint32_t>(words).subspan(next, at + length - next);
    at += length;

    if (inst.op == spv::Op::OpLine) {
      line = inst.operand(1);
      continue;
    }
    if (inst.op == spv::Op::OpNoLine || inst.op == spv::Op::OpFunctionEnd) line = 0;
    if (inst.op == spv::Op::OpNoLine) continue;
    if (inst.op == spv::Op::OpExtInst && debugSet && inst.operand(0) == debugSet) {
      // NonSemantic.Shader.DebugInfo.100: DebugLine source, first line, ...; DebugNoLine.
      if (inst.operand(1) == 103) {
        auto constant = smallConstants.find(inst.operand(3));
        if (constant != smallConstants.end()) line = constant->second;
      } else if (inst.operand(1) == 104) {
        line = 0;
      }
      continue;
    }
    inst.line = line;

    if (info->hasResult) {
      if (inst.result == 0 || inst.result >= bound)
        return base::errorf("SPIR-V: %s has the result id %u beyond the bound %u", info->name, inst.result, bound);
      if (definitions_[inst.result])
        return base::errorf("SPIR-V: id %u is defined twice", inst.result);
      definitions_[inst.result] = uint32_t(instructions.size()) + 1;
    }
    if (inst.op == spv::Op::OpConstant && inst.count() == 1) smallConstants[inst.result] = inst.operand(0);
    if (inst.op == spv::Op::OpExtInstImport) {
      extendedSets[inst.result] = literalString(inst.operands);
      if (extendedSets[inst.result] == "NonSemantic.Shader.DebugInfo.100") debugSet = inst.result;
    }
    instructions.push_back(inst);
  }

  // Pointers into `instructions` are taken only now that it does not grow any more.
  FunctionBody* function = nullptr;
  BasicBlock* block = nullptr;
  globalsEnd = uint32_t(instructions.size());
  for (uint32_t i = 0; i < instructions.size(); i++) {
    const Instruction& inst = instructions[i];
    switch (inst.op) {
      case spv::Op::OpCapability:
        capabilities.push_back(inst.operand(0));
        break;
      case spv::Op::OpEntryPoint: {
        if (inst.count() < 3) return base::errorf("SPIR-V: OpEntryPoint is too short");
        EntryPoint entry;
        entry.model = spv::ExecutionModel(inst.operand(0));
        entry.function = inst.operand(1);
        size_t nameWords = 0;
        entry.name = literalString(inst.operands.subspan(2), &nameWords);
        entry.interface = inst.operands.subspan(2 + nameWords);
        entryPoints.push_back(std::move(entry));
        break;
      }
      case spv::Op::OpExecutionMode:
      case spv::Op::OpExecutionModeId:
        executionModes.push_back(&inst);
        break;
      case spv::Op::OpString:
        strings[inst.result] = literalString(inst.operands);
        break;
      case spv::Op::OpSource:
        if (inst.count() >= 3) {
          auto name = strings.find(inst.operand(2));
          if (name != strings.end()) sources.push_back(name->second);
        }
        break;
      case spv::Op::OpFunction:
        if (globalsEnd == instructions.size()) globalsEnd = i;
        if (function) return base::errorf("SPIR-V: function %u begins within another", inst.result);
        functionOfId[inst.result] = uint32_t(functions.size());
        function = &functions.emplace_back();
        function->id = inst.result;
        function->returnType = inst.resultType;
        block = nullptr;
        break;
      case spv::Op::OpFunctionEnd:
        if (!function || block) return base::errorf("SPIR-V: OpFunctionEnd in the wrong place");
        function = nullptr;
        break;
      case spv::Op::OpFunctionParameter:
        if (!function || !function->blocks.empty()) return base::errorf("SPIR-V: misplaced OpFunctionParameter");
        function->parameters.push_back(inst.result);
        break;
      case spv::Op::OpLabel:
        if (!function || block) return base::errorf("SPIR-V: misplaced OpLabel %u", inst.result);
        function->blockOfLabel[inst.result] = uint32_t(function->blocks.size());
        block = &function->blocks.emplace_back();
        block->label = inst.result;
        block->first = i + 1;
        break;
      default:
        if (function && !block && function->blocks.empty()) break;  // debug instructions between parameters
        if (function && !block) return base::errorf("SPIR-V: %s outside of a block", opcodeName(inst.op).c_str());
        decorate(inst);
        if (groupDecorations_ > kMaxGroupDecorations) return base::errorf("SPIR-V: too many group decorations");
        if (!block) break;
        if (inst.op == spv::Op::OpSelectionMerge) block->merge = inst.operand(0);
        if (inst.op == spv::Op::OpLoopMerge) {
          block->merge = inst.operand(0);
          block->continueTarget = inst.operand(1);
        }
        if (isTerminator(inst.op)) {
          block->end = i + 1;
          block = nullptr;
        }
        break;
    }
  }
  if (function) return base::errorf("SPIR-V: the last function does not end");
  return {};
}

namespace {

// The validator takes quadratic or cubic time, or recurses, over some absurd modules: structures of structures of thousands
// of members, hundreds of nested constructs. Those are left to the translator, which has limits of its own.
constexpr size_t kMaxValidatedInstructions = 500'000;
constexpr size_t kMaxValidatedConstructs = 3'000;  // of one function
constexpr uint32_t kMaxValidatedNesting = 64;    // of constructs, whose cube the validator takes
constexpr size_t kMaxValidatedFunctions = 1'000;
constexpr uint64_t kMaxValidatedMembers = 1u << 18;  // of all structures, with those of nested ones
constexpr uint32_t kMaxValidatedDepth = 100;

// How deep constructs are nested: what a header leads to is within its construct, except its merge block.
uint32_t nestingOf(const Module& module, const FunctionBody& function) {
  if (function.blocks.empty()) return 0;
  std::unordered_map<uint32_t, uint32_t> depths{{function.blocks.front().label, 0}};
  std::vector<uint32_t> open{function.blocks.front().label};
  uint32_t deepest = 0;
  while (!open.empty()) {
    const uint32_t label = open.back();
    open.pop_back();
    auto at = function.blockOfLabel.find(label);
    if (at == function.blockOfLabel.end()) continue;
    const BasicBlock& block = function.blocks[at->second];
    const uint32_t depth = depths[label], inside = depth + (block.merge != 0);
    deepest = std::max(deepest, inside);
    auto enter = [&](uint32_t to, uint32_t there) {
      if (depths.emplace(to, there).second) open.push_back(to);
    };
    if (block.merge) enter(block.merge, depth);
    if (block.end == block.first) continue;
    const Instruction& last = module.instructions[block.end - 1];
    // Every operand: those that are no labels lead nowhere.
    if (last.op == spv::Op::OpBranch || last.op == spv::Op::OpBranchConditional || last.op == spv::Op::OpSwitch)
      for (size_t k = 0; k < last.count(); k++)
        if (function.blockOfLabel.count(last.operand(k))) enter(last.operand(k), inside);
  }
  return deepest;
}

bool canBeValidated(const Module& module) {
  if (module.instructions.size() > kMaxValidatedInstructions || module.functions.size() > kMaxValidatedFunctions)
    return false;
  for (const FunctionBody& function : module.functions) {
    size_t constructs = 0;
    for (const BasicBlock& block : function.blocks) constructs += block.merge != 0;
    if (constructs > kMaxValidatedConstructs) return false;
    if (constructs > kMaxValidatedNesting && nestingOf(module, function) > kMaxValidatedNesting) return false;
  }
  struct Weight {
    uint64_t members = 1;
    uint32_t depth = 0;
  };
  std::unordered_map<uint32_t, Weight> types;
  uint64_t total = 0;
  for (uint32_t i = 0; i < module.globalsEnd; i++) {
    const Instruction& inst = module.instructions[i];
    bool isStruct = inst.op == spv::Op::OpTypeStruct;
    bool isVariable = inst.op == spv::Op::OpVariable;
    if (!isStruct && !isVariable && inst.op != spv::Op::OpTypeArray && inst.op != spv::Op::OpTypeRuntimeArray &&
        inst.op != spv::Op::OpTypePointer)
      continue;
    Weight weight;
    auto add = [&](uint32_t id) {
      auto at = types.find(id);
      weight.members += at == types.end() ? 1 : at->second.members;
      weight.depth = std::max(weight.depth, at == types.end() ? 1 : at->second.depth + 1);
    };
    if (isVariable) {
      add(inst.resultType);  // layouts are checked for each variable
      total += weight.members;
    } else if (inst.op == spv::Op::OpTypePointer) {
      add(inst.operand(1));
      weight.depth = 0;  // pointers may be cyclic
    } else {
      for (size_t k = 0; k < (isStruct ? inst.count() : 1); k++) {
        add(inst.operand(k));
        if (weight.members > kMaxValidatedMembers) return false;
      }
      total += weight.members;
    }
    if (total > 4 * kMaxValidatedMembers || weight.depth > kMaxValidatedDepth) return false;
    if (!isVariable) types[inst.result] = weight;
  }
  return true;
}

base::Status validate(const std::vector<uint32_t>& words) {
  // Vulkan 1.3 takes every SPIR-V version from 1.0 to 1.6.
  spv_context context = spvContextCreate(SPV_ENV_VULKAN_1_3);
  spv_validator_options options = spvValidatorOptionsCreate();
  if (!context || !options) return base::errorf("SPIR-V: out of memory");
  spvValidatorOptionsSetRelaxBlockLayout(options, true);
  spvValidatorOptionsSetUniformBufferStandardLayout(options, true);
  spvValidatorOptionsSetScalarBlockLayout(options, true);
  spvValidatorOptionsSetAllowLocalSizeId(options, true);
  spvValidatorOptionsSetUniversalLimit(options, spv_validator_limit_max_id_bound, kMaxBound);
  spv_const_binary_t binary{words.data(), words.size()};
  spv_diagnostic diagnostic = nullptr;
  // Names of ids, which only messages need, are a third of the work.
  spvValidatorOptionsSetFriendlyNames(options, false);
  spv_result_t result = spvValidateWithOptions(context, options, &binary, nullptr);
  if (result != SPV_SUCCESS) {
    spvValidatorOptionsSetFriendlyNames(options, true);
    result = spvValidateWithOptions(context, options, &binary, &diagnostic);
  }
  base::Status status;
  if (result != SPV_SUCCESS)
    status = base::errorf("SPIR-V is invalid: %s", diagnostic && diagnostic->error ? diagnostic->error : "no reason given");
  spvDiagnosticDestroy(diagnostic);
  spvValidatorOptionsDestroy(options);
  spvContextDestroy(context);
  return status;
}

}  // namespace

Module::~Module() {
  if (validation_) validation_->task.abandon();
}

void Module::validateBeside(base::ThreadPool* workers) {
  validation_ = std::make_shared<Validation>(words);
  if (workers) workers->post({validation_, &validation_->task}, true);
}

Module::Validation::Validation(const std::vector<uint32_t>& w)
    : task([this, &w] {
        try {
          verdict = validate(w);
        } catch (const std::bad_alloc&) {
          verdict = base::errorf("SPIR-V: out of memory");
        }
      }) {}

base::Status Module::validity(base::ThreadPool* workers) const {
  if (!validation_) return {};
  workers ? workers->finish(validation_->task) : validation_->task.finish();
  return validation_->verdict;
}

base::Status validity(const Module& module, base::ThreadPool* workers) { return module.validity(workers); }

Result<std::shared_ptr<const Module>> parseModule(std::span<const uint32_t> words, Validate when, base::ThreadPool* workers) {
  try {
    auto module = std::make_shared<Module>();
    module->words.assign(words.begin(), words.end());
    PUMICE_TRY(module->cut());
    if (canBeValidated(*module)) {
      if (when == Validate::First) PUMICE_TRY(validate(module->words));
      else module->validateBeside(workers);
    }
    return std::shared_ptr<const Module>(std::move(module));
  } catch (const std::bad_alloc&) {
    return base::errorf("SPIR-V: out of memory while parsing %zu words", words.size());
  }
}

}  // namespace pumice::frontend
