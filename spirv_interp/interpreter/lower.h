// From a lane IR function to the interpreter's code.
#pragma once

#include <vector>

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/interpreter/check.h"

namespace pumice::interp {

struct Program {
  struct Constant {
    uint32_t slot;
    uint64_t bits;
  };
  std::vector<Constant> constants;   //!< slots of the bank known at once
  std::vector<Code> preamble;        //!< fills the other slots; run with one lane
  std::vector<Code> body;
  uint32_t slots = 0;
  size_t preambleRegisters = 0, bodyRegisters = 0;   //!< bytes
  bool mayWait = false;                              //!< a row must give way in its loops
  std::vector<std::unique_ptr<CheckSite>> checks;    //!< of PUMICE_CHECK
  size_t localBytes = 0;                             //!< LocalAlloc memory of a row
};

//! The function is final: no high-level operations, rates computed.
Result<Program> lower(const ir::Function& f, const KernelTable& kernels, const CheckedShader& checked = {});

}  // namespace pumice::interp
