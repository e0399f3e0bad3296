// The JIT: lane IR to x86-64 machine code (AVX2, FMA, F16C; AVX-512), behind the same border as the interpreter
// (interpreter/executor.h) and with the same bits.
//
// A row is run in *chunks* of 8, 16 or 32 consecutive lanes: 1, 2 or 4 vector registers per 32-bit value. Each chunk runs
// the whole routine, one after the other; at barriers, and in loops that may wait for others, a chunk stops and the next
// goes on, so a row behaves as the interpreter's. Routines with operations across a subgroup have chunks of 32 lanes, one
// subgroup.
//
// What the emitter has no code of its own for is done by the interpreter's kernel, called from the generated code.
#pragma once

#include <string>

#include "spirv_interp/interpreter/executor.h"

namespace pumice::jit {

enum class Isa : uint8_t {
  Best,     //!< AVX-512 if PUMICE_ISA says so, else AVX2
  Avx2,
  Avx512,   //!< its 256-bit forms (F, VL, DQ, BW): 32 registers, three-operand logic, masked stores
};

struct JitOptions {
  uint32_t chunkLanes = 0;       //!< 8, 16 or 32; 0: by register pressure
  Isa isa = Isa::Best;           //!< one that this machine has not can be emitted, but not run
  bool upperFirst = false;       //!< for tests: values take ymm16 .. ymm31 first, if there are any
  std::string* listing = nullptr;  //!< receives the assembly
  //! A promise of the caller for every row: all lanes are active and their number is a multiple of 32; all quads have one record; quads
  //! come in fours from whole 4x4 blocks, the elements of the others behind those of the first.
  bool wholeBlocks = false;
};

//! Whether this machine can run the code (x86-64 with AVX2, FMA, F16C, BMI, unless PUMICE_ISA asks for less).
bool available();
//! Whether this machine can run what was emitted for `isa`.
bool runs(Isa isa);

//! As interp::compileInterpreter. Errors: not available, an operation that neither the emitter nor a kernel has, no
//! executable memory. The caller then takes the interpreter.
interp::Result<std::unique_ptr<interp::Executable>> compile(const ir::Function& f, const interp::CompileOptions& options,
                                                            const JitOptions& jit = {});

//! Counted since the process started.
struct Statistics {
  uint64_t emitted = 0;      //!< routines
  uint64_t refused = 0;      //!< routines left to the interpreter
  uint64_t operations = 0;   //!< IR operations of emitted routines
  uint64_t callOuts = 0;     //!< of these done by the interpreter's kernels
  uint64_t nanoseconds = 0;  //!< of processor time, that emission took
};
Statistics statistics();

}  // namespace pumice::jit
