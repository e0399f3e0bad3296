// asmjit's Assembler for two targets. The emitter writes AVX2; on AVX-512 the same instructions reach ymm16 .. ymm31, in
// their EVEX forms. Those that have none, or another one there, are rewritten by one table (vector_assembler.cpp).
//
// Vectors stay 256 bits wide: lanes, chunks and results are the same on both targets, and processors whose clock or ports
// suffer from 512-bit vectors do not mind.
#pragma once

#include <asmjit/x86.h>

#include <algorithm>

#include "spirv_interp/jit/vex.h"

namespace pumice::jit {

//! A vector operand: a register, or a whole vector in the frame, the bank or the pool.
struct Source {
  bool isReg = false;
  uint8_t id = 0;       //!< of the vector register, or of the general one that `offset` counts from
  int32_t offset = 0;
  asmjit::x86::Ymm reg() const { return asmjit::x86::Ymm(id); }
  asmjit::x86::Mem mem() const { return asmjit::x86::ptr(asmjit::x86::gpq(id), offset); }
  asmjit::Operand op() const { return isReg ? asmjit::Operand(reg()) : asmjit::Operand(mem()); }
  bool is(const asmjit::x86::Ymm& r) const { return isReg && id == r.id(); }
};

class VectorAssembler final : public asmjit::x86::Assembler {
  using Ymm = asmjit::x86::Ymm;

 public:
  VectorAssembler(asmjit::CodeHolder* code, bool evex) : Assembler(code), evex_(evex), direct_(!evex && !code->logger()) {}
  bool evex() const { return evex_; }

  //! Hides those of the base, which come to _emit() by several calls.
  asmjit::Error emit(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2 = kNone,
                     const asmjit::Operand_& o3 = kNone) {
    return direct(id, o0, o1, o2, o3) ? asmjit::kErrorOk : _emitI(id, o0, o1, o2, o3);
  }
  //! The same for operands whose kinds are known.
  asmjit::Error emit(asmjit::InstId id, const Ymm& d, const Ymm& a, Source m) {
    return put<VexForm::Rvm>(id, d.id(), a.id(), m) ? asmjit::kErrorOk : _emitI(id, d, a, m.op());
  }
  asmjit::Error emit(asmjit::InstId id, const Ymm& d, const Ymm& a, Source m, const asmjit::Imm& constant) {
    return put<VexForm::RvmImm>(id, d.id(), a.id(), m, constant.valueAs<uint8_t>()) ? asmjit::kErrorOk : _emitI(id, d, a, m.op(), constant);
  }
  asmjit::Error emit(asmjit::InstId id, const Ymm& d, const Ymm& a, Source m, const Ymm& mask) {
    return put<VexForm::RvmReg>(id, d.id(), a.id(), m, mask.id() << 4) ? asmjit::kErrorOk : _emitI(id, d, a, m.op(), mask);
  }
  asmjit::Error emit(asmjit::InstId id, const Ymm& d, Source m) {
    return put<VexForm::Rm>(id, d.id(), 0, m) ? asmjit::kErrorOk : _emitI(id, d, m.op());
  }
  asmjit::Error emit(asmjit::InstId id, const Ymm& d, Source m, const asmjit::Imm& constant) {
    return put<VexForm::RmImm>(id, d.id(), 0, m, constant.valueAs<uint8_t>()) ? asmjit::kErrorOk : _emitI(id, d, m.op(), constant);
  }
  asmjit::Error move(const Ymm& to, Source from) {
    return put<VexForm::Move>(asmjit::x86::Inst::kIdVmovaps, to.id(), 0, from) ? asmjit::kErrorOk : vmovaps(to, from.op());
  }
  //! `to` is in memory.
  asmjit::Error store(Source to, const Ymm& from) {
    return put<VexForm::Move, true>(asmjit::x86::Inst::kIdVmovaps, from.id(), 0, to) ? asmjit::kErrorOk : vmovaps(to.op(), from);
  }
  asmjit::Error vmovaps(const asmjit::Operand_& to, const asmjit::Operand_& from) { return emit(asmjit::x86::Inst::kIdVmovaps, to, from); }

  asmjit::Error _emit(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2,
                      const asmjit::Operand_* more) override;

  //! For who writes several instructions at once (encodeVex): their place, or null if they have to come one by one. Then wrote().
  uint8_t* room(uint32_t instructions) { return direct_ && remainingSpace() >= instructions * kVexBytes ? _bufferPtr : nullptr; }
  void wrote(uint8_t* end) {
    _bufferPtr = end;
    size_t& size = _section->_buffer._size;
    size = std::max(size, offset());
  }

 private:
  //! AVX2's usual instructions, into the buffer past asmjit (vex.h). Not if somebody wants a listing.
  template <VexForm kForm, bool kStore = false>
  bool put(asmjit::InstId id, uint32_t r, uint32_t v, Source m, uint32_t tail = 0) {
    constexpr bool kTail = kForm == VexForm::RvmImm || kForm == VexForm::RvmReg || kForm == VexForm::RmImm;
    const VexRow& row = kVexRows[id];
    if (!direct_ || row.form != kForm || remainingSpace() < kVexBytes) return false;
    wrote(encodeVex(_bufferPtr, row, kStore ? row.store : row.opcode, r, v, true, !m.isReg, m.id, m.offset, tail, kTail));
    return true;
  }
  static constexpr asmjit::Operand kNone{};
  bool write(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2, const asmjit::Operand_& o3);
  bool direct(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2, const asmjit::Operand_& o3);

  bool evex_, direct_;
};

}  // namespace pumice::jit
