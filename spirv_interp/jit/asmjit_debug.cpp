// Stands in for asmjit's globals.cpp, the one part of Debian's static library that is not position independent (it names
// stderr). So asmjit also never writes to the host's streams.
#include <asmjit/core.h>

#include <cstdlib>

#include "base/log.h"

ASMJIT_BEGIN_NAMESPACE
namespace DebugUtils {

const char* errorAsString(Error error) noexcept {
  switch (error) {
    case kErrorOutOfMemory: return "the assembler: out of memory";
    case kErrorInvalidInstruction: return "the assembler: no such form of an instruction";
    case kErrorInvalidOperandSize: return "the assembler: an operand's size";
    case kErrorInvalidDisplacement: return "the assembler: a jump or an address too far away";
    default: return "the assembler: an error";
  }
}
void debugOutput(const char* text) noexcept { pumice::base::logDebug("asmjit: %s", text); }
//! Only what headers check in debug builds comes here.
void assertionFailed(const char* file, int line, const char* message) noexcept {
  pumice::base::logError("asmjit: %s:%d: %s", file, line, message);
  std::abort();
}

}  // namespace DebugUtils
ASMJIT_END_NAMESPACE
