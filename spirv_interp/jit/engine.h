// Which executor runs a routine.
#pragma once

#include "spirv_interp/interpreter/executor.h"

namespace pumice::jit {

//! Whether routines become machine code at all, as far as that is possible.
bool emitsCode();

//! Machine code or the interpreter, as PUMICE_ENGINE says; what cannot be emitted goes to the interpreter. `wholeBlocks`: a promise about
//! rows (JitOptions); `chunkLanes` too.
interp::Result<std::unique_ptr<interp::Executable>> makeExecutable(const ir::Function& f, const interp::CompileOptions& options,
                                                                   bool wholeBlocks = false, uint32_t chunkLanes = 0);

}  // namespace pumice::jit
