// The vector instructions that make up most of a routine, written without asmjit's general encoder: it takes some 200
// instructions for each, these forms take 40. The bytes are the same (tests/jit/vex_test.cpp compares them, row by row).
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

//! rax + 0, but for the size of what is there: such addresses are written here.
inline bool isPlain(const asmjit::Operand_& o) {
  const uint32_t simple = asmjit::x86::ptr(asmjit::x86::rax, 0).signature().bits();
  return ((o.signature().bits() ^ simple) & ~asmjit::OperandSignature::kSizeMask) == 0;
}
inline bool isLowVector(const asmjit::Operand_& o) {
  const uint32_t bits = o.signature().bits();
  return (bits == asmjit::x86::Ymm::kSignature || bits == asmjit::x86::Xmm::kSignature) && o.id() < 16;
}
inline bool isYmm(const asmjit::Operand_& o) { return o.signature().bits() == asmjit::x86::Ymm::kSignature; }

}  // namespace vex

//! One instruction, written to `at`, where kVexBytes are free; gives its end. `r`: ModRM.reg; `v`: VEX.vvvv; `wide`: 256 bits;
//! m is a register if `memory` is not set, else `base` + `offset`; behind it `tailBytes` (0, 1) of `tail`.
inline uint8_t* encodeVex(uint8_t* at, const VexRow& row, uint32_t opcode, uint32_t r, uint32_t v, bool wide, bool memory, uint32_t base,
                          int32_t offset, uint32_t tail, uint32_t tailBytes) {
  // What follows the opcode, from its lowest byte on.
  uint64_t rest = (r & 7) << 3 | (base & 7);
  uint32_t restBits = 8;
  if (memory) {
    if ((base & 7) == 4) {   // rsp and r12 need the byte that could name an index
      rest |= 0x2400;
      restBits = 16;
    }
    if (offset != int8_t(offset)) {
      rest |= 0x80 | uint64_t(uint32_t(offset)) << restBits;
      restBits += 32;
    } else if (offset || (base & 7) == 5) {
      rest |= 0x40 | uint64_t(uint8_t(offset)) << restBits;
      restBits += 8;
    }
  } else {
    rest |= 0xc0;
  }
  if (tailBytes) rest |= uint64_t(tail) << restBits;
  // The long form: c4, R X B (inverted) and map, W vvvv (inverted) L and prefix, opcode.
  uint32_t head = (row.head ^ (r & 8) << 12 ^ (base & 8) << 10 ^ v << 19) | uint32_t(wide) << 18 | opcode << 24;
  uint32_t headBytes = 4;
  if ((head & 0x803f00) == 0x2100) {   // neither W nor B, and map 0f: c5, R vvvv L and prefix, opcode
    head = 0xc5 | (head & 0x8000) | (head >> 8 & 0xff7f00);
    headBytes = 3;
  }
  std::memcpy(at, &head, sizeof head);
  at += headBytes;
  std::memcpy(at, &rest, sizeof rest);
  return at + restBits / 8 + tailBytes;
}

//! The same from asmjit's operands. Null: it is none of these.
inline uint8_t* writeVex(uint8_t* at, asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2,
                         const asmjit::Operand_& o3) {
  using asmjit::Operand_;
  const VexRow& row = kVexRows[id];
  const Operand_ *reg = &o0, *rm = &o1;
  uint32_t opcode = row.opcode, v = 0;
  uint32_t tail = 0, tailBytes = 0;   // a constant behind all
  switch (row.form) {
    case VexForm::None: return nullptr;
    case VexForm::Rvm:
    case VexForm::RvmImm:
    case VexForm::RvmReg:
      rm = &o2;
      v = o1.id();
      if (!vex::isLowVector(o1)) return nullptr;
      if (row.form == VexForm::Rvm) {
        if (!o3.isNone()) return nullptr;
        break;
      }
      if (row.form == VexForm::RvmImm ? !o3.isImm() : !vex::isLowVector(o3)) return nullptr;
      tail = row.form == VexForm::RvmImm ? o3.as<asmjit::Imm>().valueAs<uint8_t>() : o3.id() << 4;
      tailBytes = 1;
      break;
    case VexForm::Move:
      if (o0.isMem()) {
        reg = &o1, rm = &o0;
        opcode = row.store;
      }
      [[fallthrough]];
    case VexForm::Rm:
      if (!o2.isNone()) return nullptr;
      break;
    case VexForm::Shift:
    case VexForm::RmImm:
      if (!o2.isImm() || !o3.isNone()) return nullptr;
      tail = o2.as<asmjit::Imm>().valueAs<uint8_t>();
      tailBytes = 1;
      break;
  }
  if (!vex::isLowVector(*reg)) return nullptr;
  uint32_t r = reg->id(), base, offset = 0;
  bool wide = vex::isYmm(*reg);
  if (row.form == VexForm::Shift) {
    v = r;
    r = row.store;
  }
  if (rm->isMem()) {
    if (!vex::isPlain(*rm)) return nullptr;
    base = rm->as<asmjit::x86::Mem>().baseId();
    offset = uint32_t(rm->as<asmjit::x86::Mem>().offsetLo32());
  } else {
    if (!vex::isLowVector(*rm)) return nullptr;
    base = rm->id();
    wide |= rm == &o1 && vex::isYmm(*rm);   // of conversions the larger side counts
  }
  return encodeVex(at, row, opcode, r, v, wide, rm->isMem(), base, int32_t(offset), tail, tailBytes);
}

}  // namespace pumice::jit
