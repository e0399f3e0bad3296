// A SPIR-V module cut into instructions, with the tables that translation asks again and again: definitions,
// decorations, functions and their blocks. Everything here is bounds checked while it is made; ids that
// instructions mention may still be wild, so look them up through `definition`, which gives null for those.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <spirv/unified1/spirv.hpp11>

#include "base/result.h"
#include "base/threads.h"

namespace pumice::frontend {

struct Instruction {
  spv::Op op = spv::Op::OpNop;
  uint32_t resultType = 0;             //!< 0 = none
  uint32_t result = 0;                 //!< 0 = none
  std::span<const uint32_t> operands;  //!< the words after result type and result
  uint32_t line = 0;                   //!< source line, 0 = unknown

  //! Operand i, 0 if there are fewer (0 is never a valid id).
  uint32_t operand(size_t i) const { return i < operands.size() ? operands[i] : 0; }
  size_t count() const { return operands.size(); }
};

struct Decoration {
  spv::Decoration kind{};
  std::span<const uint32_t> literals;
  uint32_t literal(size_t i = 0) const { return i < literals.size() ? literals[i] : 0; }
};

struct BasicBlock {
  uint32_t label = 0;
  uint32_t first = 0, end = 0;  //!< indices in Module::instructions, the terminator is end-1
  uint32_t merge = 0;           //!< label of the merge block of OpLoopMerge/OpSelectionMerge, 0 = none
  uint32_t continueTarget = 0;  //!< not 0: loop header
};

struct FunctionBody {
  uint32_t id = 0;
  uint32_t returnType = 0;
  std::vector<uint32_t> parameters;
  std::vector<BasicBlock> blocks;
  std::unordered_map<uint32_t, uint32_t> blockOfLabel;
};

struct EntryPoint {
  spv::ExecutionModel model{};
  uint32_t function = 0;
  std::string name;
  std::span<const uint32_t> interface;
};

struct OpcodeInfo {
  uint16_t opcode = 0;
  const char* name = nullptr;
  bool hasResultType = false, hasResult = false;
};
//! Null for numbers that the grammar does not know.
const OpcodeInfo* opcodeInfo(uint32_t opcode);
std::string opcodeName(spv::Op op);
//! Every opcode of the grammar.
std::span<const OpcodeInfo> allOpcodes();

//! A nul-terminated literal string; `wordCount` (if asked for) is how many words it takes.
std::string literalString(std::span<const uint32_t> words, size_t* wordCount = nullptr);

class Module {
 public:
  std::vector<uint32_t> words;  //!< in host order
  uint32_t version = 0;         //!< as in the header: 0x00010300 is 1.3
  uint32_t bound = 0;
  std::vector<Instruction> instructions;
  uint32_t globalsEnd = 0;      //!< index of the first OpFunction
  std::vector<uint32_t> capabilities;
  std::vector<EntryPoint> entryPoints;
  std::vector<const Instruction*> executionModes;  //!< OpExecutionMode and OpExecutionModeId
  std::vector<FunctionBody> functions;
  std::unordered_map<uint32_t, uint32_t> functionOfId;
  std::unordered_map<uint32_t, std::string> extendedSets;  //!< OpExtInstImport
  std::unordered_map<uint32_t, std::string> strings;       //!< OpString
  std::vector<std::string> sources;

  Module() = default;
  ~Module();
  Module(const Module&) = delete;
  Module& operator=(const Module&) = delete;

  //! Has `words` validated by some worker, or (with none) by who asks first.
  void validateBeside(base::ThreadPool* workers);
  //! The verdict, if that was asked for.
  base::Status validity(base::ThreadPool* workers) const;

  //! The instruction with this result, null if there is none.
  const Instruction* definition(uint32_t id) const {
    return id < definitions_.size() && definitions_[id] ? &instructions[definitions_[id] - 1] : nullptr;
  }
  std::span<const Decoration> decorations(uint32_t id) const;
  std::span<const Decoration> memberDecorations(uint32_t structType, uint32_t member) const;
  const Decoration* find(uint32_t id, spv::Decoration kind) const { return findIn(decorations(id), kind); }
  const Decoration* findMember(uint32_t type, uint32_t member, spv::Decoration kind) const {
    return findIn(memberDecorations(type, member), kind);
  }

  //! Cuts `words` up. The words must stay as they are from then on.
  base::Status cut();

 private:
  static const Decoration* findIn(std::span<const Decoration> list, spv::Decoration kind);
  void decorate(const Instruction& inst);

  struct Validation {
    explicit Validation(const std::vector<uint32_t>& words);
    base::Status verdict;
    base::Task task;   //!< reads `words`
  };
  std::shared_ptr<Validation> validation_;

  uint64_t groupDecorations_ = 0;
  std::vector<uint32_t> definitions_;  //!< index of the defining instruction + 1
  std::unordered_map<uint32_t, std::vector<Decoration>> decorations_;
  std::unordered_map<uint64_t, std::vector<Decoration>> memberDecorations_;
};

}  // namespace pumice::frontend
