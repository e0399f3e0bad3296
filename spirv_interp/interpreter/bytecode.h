// The interpreter's own form of a routine: an array of kernel calls over a register file of rows.
//
// A row of the register file holds kMaxLanes elements of its type; a mask row holds kMaxLanes bits. Operands
// are byte offsets into the register file, or (in kernel variants with a uniform operand) slots of the
// uniform bank. A kernel computes whole vectors, active or not: inactive lanes hold rubbish.
#pragma once

#include <cstdint>

#include "spirv_interp/interpreter/executor.h"

namespace pumice::interp {

struct Code;
struct RunState;
//! Executes one instruction and gives the next (null: back to the caller, RunState::next says where to go on).
using Kernel = const Code* (*)(RunState&, const Code*);

struct Code {
  Kernel run;
  uint32_t dst;
  uint32_t src[5];   //!< byte offset in the register file, or byte offset in the uniform bank
  uint64_t imm;      //!< the operation's immediate; the target's distance in instructions for control flow
};

//! In a buffer access's imm: its offset operand is an i64 (else i32).
constexpr uint64_t kImmOffset64 = uint64_t(1) << 63;

constexpr uint32_t kMaskWords = kMaxLanes / 64;
constexpr uint32_t kMaskBytes = kMaxLanes / 8;

//! Everything that changes while a row runs, in one place.
struct RunState {
  uint64_t exec[kMaskWords];        //!< E: lanes active here
  uint64_t all[kMaskWords];         //!< bit per lane of the row
  uint32_t lanes;
  uint32_t rounded;                 //!< lanes, rounded up to whole vectors of any element type
  std::byte* registers;
  const std::byte* uniforms;
  std::byte* local;                 //!< LocalAlloc memory
  uint64_t* bankOut;                //!< preamble only: the bank being filled
  const Table* tables;
  const ExecContext* context;
  const Code* next;                 //!< where to go on; null: the row has finished
  uint32_t turns;                   //!< loop turns until the row comes back to its caller
  bool atBarrier;

  template <class T>
  T* row(uint32_t offset) const { return reinterpret_cast<T*>(registers + offset); }
  uint64_t* mask(uint32_t offset) const { return reinterpret_cast<uint64_t*>(registers + offset); }
  template <class T>
  const T& uniform(uint32_t offset) const { return *reinterpret_cast<const T*>(uniforms + offset); }
  bool none() const { return (exec[0] | exec[1]) == 0; }
  bool full() const { return exec[0] == all[0] && exec[1] == all[1]; }
  bool active(uint32_t lane) const { return exec[lane >> 6] >> (lane & 63) & 1; }
};

constexpr unsigned kTypeCount = unsigned(ir::Type::Tuple) + 1;
constexpr unsigned kOpCount = unsigned(ir::Op::kCount);
constexpr unsigned kOperandForms = 8;   //!< bit i: operand i is uniform

//! Operations that only the interpreter has.
enum class Internal : uint8_t {
  Splat,        //!< a uniform's row
  Copy,         //!< a row's copy
  SetMasked,    //!< active lanes of dst become src (form 1: a uniform)
  Zero,         //!< a row of zeros
  Canon,        //!< NaNs become canonical
  ToBank,       //!< lane 0 goes to the bank's slot imm
  OutputRow,    //!< active lanes of the caller's row imm become src
  kCount
};
enum class Control : uint8_t { If, Else, EndIf, Loop, EndLoop, Block, EndBlock, Leave, Break, Barrier, End, kCount };

//! The kernels of one instruction set.
struct KernelTable {
  Kernel op[kOpCount][kTypeCount][kOperandForms] = {};        //!< by type of the result, or of the operands for comparisons and stores
  Kernel convert[kOpCount][kTypeCount][kTypeCount] = {};      //!< [op][from][to]
  Kernel internal[unsigned(Internal::kCount)][kTypeCount][2] = {};
  Kernel control[unsigned(Control::kCount)] = {};

  Kernel& at(ir::Op o, ir::Type t, unsigned form = 0) { return op[unsigned(o)][unsigned(t)][form]; }
  Kernel& at(Internal o, ir::Type t, unsigned form = 0) { return internal[unsigned(o)][unsigned(t)][form]; }
  Kernel& at(Control o) { return control[unsigned(o)]; }
  Kernel& cvt(ir::Op o, ir::Type from, ir::Type to) { return convert[unsigned(o)][unsigned(from)][unsigned(to)]; }
};

//! An instruction set that kernels were compiled for.
struct Target {
  int64_t bit;             //!< Highway's HWY_AVX2 etc.
  const char* name;
};
//! Those that this machine can run, best first.
std::span<const Target> availableTargets();
//! The best one, or the one PUMICE_ISA asks for.
const Target& defaultTarget();
//! Made at first use, then kept.
const KernelTable& kernelTable(const Target& target);

// One function per family and instruction set; they fill their part of the table.
void addFloatKernels(int64_t targetBit, KernelTable& table);
void addIntKernels(int64_t targetBit, KernelTable& table);
void addMoveKernels(int64_t targetBit, KernelTable& table);
void addConvertKernels(int64_t targetBit, KernelTable& table);
void addGatherKernels(int64_t targetBit, KernelTable& table);
void addMemoryKernels(KernelTable& table);
void addControlKernels(KernelTable& table);
void addSubgroupKernels(KernelTable& table);

//! For tests: compiles for one instruction set.
Result<std::unique_ptr<Executable>> compileInterpreterFor(const ir::Function& f, const CompileOptions& options, const Target& target);
//! For tests: with kernels of one's own choice.
Result<std::unique_ptr<Executable>> compileInterpreterWith(const ir::Function& f, const CompileOptions& options, const KernelTable& kernels);

}  // namespace pumice::interp
