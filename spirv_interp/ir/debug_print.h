// NonSemantic.DebugPrintf (SPIR-V registry; Vulkan-ValidationLayers' debug_printf.md has the formats): what a shader prints with
// PUMICE_CHECK=printf. Formats come from anywhere, so they are cut up here; printf gets nothing of them but checked numbers.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

//! A call in a shader.
struct PrintCall {
  struct Argument {
    uint32_t scalars = 0;   //!< of the value; none: text
    std::string text;
    bool operator==(const Argument&) const = default;
  };
  std::string format;
  std::vector<Argument> arguments;
  bool operator==(const PrintCall&) const = default;
};

//! Calls are kept for the rest of the process, equal ones once: a `check` names one by its number.
uint32_t keepPrintCall(PrintCall call);
const PrintCall& printCall(uint32_t number);

//! After so many lines nothing is printed any more until the next device is made: a loop may not flood a log.
constexpr uint32_t kMostPrintedLines = 10000;
//! False: it is enough, which is said once.
bool countPrintedLine();
void restartPrinting();

struct PrintedScalar {
  Type type = Type::None;
  uint64_t bits = 0;
};
//! What one invocation prints. `%d %i %u %x %X %o %f %F %e %E %g %G %a %A`, each also of 64 bits (`%lu`, `%ul`) and of vectors (`%v3f`:
//! components with commas between; other values of several scalars likewise), with flags, width and precision as in C; `%s` of strings;
//! `%%`. The value's own type says its size. What is none of these, or has no argument, stays as it is.
std::string printedText(const PrintCall& call, std::span<const PrintedScalar> values);

}  // namespace pumice::ir
