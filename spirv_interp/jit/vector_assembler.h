// asmjit's Assembler for two targets. The emitter writes AVX2; on AVX-512 the same instructions reach ymm16 .. ymm31, in
// their EVEX forms. Those that have none, or another one there, are rewritten by one table (vector_assembler.cpp).
//
// Vectors stay 256 bits wide: lanes, chunks and results are the same on both targets, and processors whose clock or ports
// suffer from 512-bit vectors do not mind.
#pragma once

#include <asmjit/x86.h>

namespace pumice::jit {

class VectorAssembler final : public asmjit::x86::Assembler {
 public:
  VectorAssembler(asmjit::CodeHolder* code, bool evex) : Assembler(code), evex_(evex), direct_(!evex && !code->logger()) {}
  bool evex() const { return evex_; }

  //! Hides those of the base, which come to _emit() by several calls.
  asmjit::Error emit(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2 = kNone,
                     const asmjit::Operand_& o3 = kNone) {
    return direct(id, o0, o1, o2, o3) ? asmjit::kErrorOk : _emitI(id, o0, o1, o2, o3);
  }
  asmjit::Error vmovaps(const asmjit::Operand_& to, const asmjit::Operand_& from) { return emit(asmjit::x86::Inst::kIdVmovaps, to, from); }

  asmjit::Error _emit(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2,
                      const asmjit::Operand_* more) override;

 private:
  static constexpr asmjit::Operand kNone{};
  //! AVX2's usual instructions, into the buffer past asmjit (vex.h). Not if somebody wants a listing.
  bool direct(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2, const asmjit::Operand_& o3);

  bool evex_, direct_;
};

}  // namespace pumice::jit
