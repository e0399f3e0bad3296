// The scalar instructions of addresses, masks and ranges, written without asmjit's general encoder as those of vex.h are. The
// bytes are the same (tests/jit/vex_test.cpp). What is not here (jumps, locked instructions, bytes and words) is asmjit's.
//
// Source: Intel SDM, volume 2, 2.1.5 (ModRM and SIB), 2.2.1 (REX) and the instructions' pages.
#pragma once

#include "spirv_interp/jit/vex.h"

namespace pumice::jit {

//! r, m: registers of 32 or 64 bits (or memory), i: a constant.
enum class ScalarForm : uint8_t {
  None,
  Alu,       //!< r, r / m / i and m, r / i; `opcode` that of m, r; `digit` that of constants
  Mov,       //!< as Alu
  Shift,     //!< r, i; `digit`
  Test,      //!< r, r
  Stack,     //!< r; `opcode` that of rax
  Load,      //!< r, m; `opcode` behind 0f
  Address,   //!< r, m in memory
  Multiply,  //!< r, r, i, or Load
};
struct ScalarRow {
  ScalarForm form = ScalarForm::None;
  uint8_t opcode = 0, digit = 0, prefix = 0;
};
//! By instruction.
extern const std::array<ScalarRow, asmjit::x86::Inst::_kIdCount> kScalarRows;

//! Gives the instruction's end, or null: it is none of these. kVexBytes are free.
uint8_t* writeScalar(uint8_t* at, const ScalarRow& row, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2);

}  // namespace pumice::jit
