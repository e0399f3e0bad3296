// What of SPIR-V is taken and what is not, and why not: one table for each kind of thing that the grammar lists.
// tests/frontend/support_test.cpp proves that they cover the whole grammar.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <spirv/unified1/spirv.hpp11>

namespace pumice::frontend {

struct NumberName {
  uint32_t number;
  const char* name;
};
//! Everything the grammars list.
std::span<const NumberName> allCapabilities();
std::span<const NumberName> allExecutionModes();
std::span<const NumberName> allGlsl450();
//! The capabilities any of which allows the instruction; none: every module may use it.
std::vector<uint32_t> capabilitiesOf(spv::Op op);

std::string capabilityName(uint32_t capability);
bool supportsCapability(uint32_t capability);
//! Why a capability, an instruction whose capability is supported, or a GLSL.std.450 instruction is refused: the end of a
//! sentence that begins with its name. Null if there is nothing to say.
const char* whyNotCapability(uint32_t capability);
const char* whyNotOpcode(spv::Op op);
const char* whyNotGlsl450(uint32_t instruction);

//! Null if the execution mode holds for shaders as they are run here; else why not. `operand` is the mode's first
//! operand (the width in bits for float controls).
const char* whyNotExecutionMode(uint32_t mode, uint32_t operand);
std::string executionModeName(uint32_t mode);

}  // namespace pumice::frontend
