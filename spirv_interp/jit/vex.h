// The vector instructions that make up most of a routine, written without asmjit's general encoder: it takes some 200
// instructions for each, these forms take 40 to 80. The bytes are the same (tests/jit/vex_test.cpp compares them, row by row).
//
// Source: Intel SDM, volume 2, 2.3 (VEX prefix) and the instructions' pages.
#pragma once

#include <asmjit/x86.h>

#include <array>
#include <cstring>

namespace pumice::jit {

//! How operands stand in an instruction: d in ModRM.reg, m in ModRM.r/m (a vector register or memory), a in VEX.vvvv.
enum class VexForm : uint8_t {
  None,
  Rvm,    //!< d, a, m
  RvmImm, //!< and a constant
  RvmReg, //!< and a register, in the constant's upper half
  Rm,     //!< d, m
  RmImm,
  Move,   //!< Rm; `store` is the opcode from d to m
  RmReg,  //!< Rm, not from memory, whose size would have to be looked at
  MrImm,  //!< m, d, a constant
  RvmGpImm,  //!< RvmImm, m a scalar register or memory
  MrGpImm,   //!< MrImm, m a scalar register
  GpRm,   //!< d a scalar register
  Carry,  //!< between a vector and a scalar register or memory; `store` is the opcode from a vector
  GpVm,   //!< d and m scalar registers, d in vvvv; `store` is the digit in ModRM.reg
  Shift,  //!< d in vvvv, m, a constant; `store` is the digit in ModRM.reg
};
struct VexRow {
  VexForm form = VexForm::None;
  uint8_t opcode = 0, store = 0;
  uint32_t head = 0;   //!< the bytes before the opcode for registers 0, 128 bits wide
};
//! By instruction; those that are not here are asmjit's.
extern const std::array<VexRow, asmjit::x86::Inst::_kIdCount> kVexRows;

constexpr size_t kVexBytes = 16;   //!< no instruction is longer

namespace vex {

//! As rax + 0 or rax + (rcx << 2) + 0, whatever the size of what is there: such addresses are written here.
inline bool isAddress(const asmjit::Operand_& o) {
  constexpr uint32_t kBeside = uint32_t(asmjit::OperandSignature::kSizeMask) | uint32_t(asmjit::x86::Mem::kSignatureMemShiftValueMask);
  const uint32_t simple = asmjit::x86::ptr(asmjit::x86::rax, 0).signature().bits() & ~kBeside;
  const uint32_t indexed = asmjit::x86::ptr(asmjit::x86::rax, asmjit::x86::rcx).signature().bits() & ~kBeside;
  const uint32_t bits = o.signature().bits() & ~kBeside;
  return bits == simple || bits == indexed;
}
inline bool isGpd(const asmjit::Operand_& o) { return o.signature().bits() == asmjit::x86::Gpd::kSignature; }
inline bool isGpq(const asmjit::Operand_& o) { return o.signature().bits() == asmjit::x86::Gpq::kSignature; }
inline bool isLowVector(const asmjit::Operand_& o) {
  const uint32_t bits = o.signature().bits();
  return (bits == asmjit::x86::Ymm::kSignature || bits == asmjit::x86::Xmm::kSignature) && o.id() < 16;
}
inline bool isYmm(const asmjit::Operand_& o) { return o.signature().bits() == asmjit::x86::Ymm::kSignature; }

}  // namespace vex

constexpr uint32_t kNoIndex = 4;   //!< rsp cannot be one

//! What follows the opcode for memory, ModRM.reg being in `rest` already; gives its bits.
inline uint32_t addressBytes(uint64_t& rest, uint32_t base, uint32_t index, uint32_t shift, int32_t offset) {
  uint32_t bits = 8;
  if (index != kNoIndex || (base & 7) == 4) {   // rsp and r12 need the byte that names an index
    rest |= 4 | ((base & 7) | (index & 7) << 3 | shift << 6) << 8;
    bits = 16;
  } else {
    rest |= base & 7;
  }
  if (offset != int8_t(offset)) {
    rest |= 0x80 | uint64_t(uint32_t(offset)) << bits;
    bits += 32;
  } else if (offset || (base & 7) == 5) {
    rest |= 0x40 | uint64_t(uint8_t(offset)) << bits;
    bits += 8;
  }
  return bits;
}

//! One instruction, written to `at`, where kVexBytes are free; gives its end. `r`: ModRM.reg; `v`: VEX.vvvv; `wide`: 256 bits;
//! m is a register if `memory` is not set, else `base` + `offset`; behind it `tailBytes` (0, 1) of `tail`.
inline uint8_t* encodeVex(uint8_t* at, const VexRow& row, uint32_t opcode, uint32_t r, uint32_t v, bool wide, bool memory, uint32_t base,
                          int32_t offset, uint32_t tail, uint32_t tailBytes, uint32_t index = kNoIndex, uint32_t shift = 0) {
  // What follows the opcode, from its lowest byte on.
  uint64_t rest = (r & 7) << 3;
  uint32_t restBits = 8;
  if (memory) restBits = addressBytes(rest, base, index, shift, offset);
  else rest |= 0xc0 | (base & 7);
  if (tailBytes) rest |= uint64_t(tail) << restBits;
  // The long form: c4, R X B (inverted) and map, W vvvv (inverted) L and prefix, opcode.
  uint32_t head = (row.head ^ (r & 8) << 12 ^ (index & 8) << 11 ^ (base & 8) << 10 ^ v << 19) | uint32_t(wide) << 18 | opcode << 24;
  uint32_t headBytes = 4;
  if ((head & 0x807f00) == 0x6100) {   // neither W nor X nor B, and map 0f: c5, R vvvv L and prefix, opcode
    head = 0xc5 | (head & 0x8000) | (head >> 8 & 0xff7f00);
    headBytes = 3;
  }
  std::memcpy(at, &head, sizeof head);
  at += headBytes;
  std::memcpy(at, &rest, sizeof rest);
  return at + restBits / 8 + tailBytes;
}

//! d = a op m of 256 bits, and vmovaps between a vector register and a vector in memory.
inline uint8_t* encodeRvm(uint8_t* at, asmjit::InstId id, uint32_t d, uint32_t a, bool memory, uint32_t m, int32_t offset) {
  const VexRow& row = kVexRows[id];
  return encodeVex(at, row, row.opcode, d, a, true, memory, m, offset, 0, 0);
}
inline uint8_t* encodeLoad(uint8_t* at, uint32_t d, uint32_t base, int32_t offset) {
  return encodeRvm(at, asmjit::x86::Inst::kIdVmovaps, d, 0, true, base, offset);
}
inline uint8_t* encodeStore(uint8_t* at, uint32_t d, uint32_t base, int32_t offset) {
  const VexRow& row = kVexRows[asmjit::x86::Inst::kIdVmovaps];
  return encodeVex(at, row, row.store, d, 0, true, true, base, offset, 0, 0);
}

//! Any of these from asmjit's operands. Null: it is none of these.
uint8_t* writeVex(uint8_t* at, const VexRow& row, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2,
                  const asmjit::Operand_& o3);

}  // namespace pumice::jit
