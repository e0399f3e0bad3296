// Reports of PUMICE_CHECK (spirv_interp/ir/checks.h): what `check` operations become.
#pragma once

#include <atomic>
#include <memory>

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/checks.h"

namespace pumice::interp {

//! One `check` of a routine; the kernel finds it through its imm.
struct CheckSite {
  ir::CheckPlace place;
  uint32_t line = 0;
  ir::Type types[5] = {};   //!< of the operands
  uint32_t count = 0;
  std::shared_ptr<const CheckedShader> shader;
  std::atomic<bool> reported{false};
};

//! src: rows of the operands; imm: the CheckSite. Logs the first lane that it finds wanting.
const Code* checkKernel(RunState& s, const Code* c);

}  // namespace pumice::interp
