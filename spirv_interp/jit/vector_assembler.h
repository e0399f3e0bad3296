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
  VectorAssembler(asmjit::CodeHolder* code, bool evex) : Assembler(code), evex_(evex) {}
  bool evex() const { return evex_; }

  asmjit::Error _emit(asmjit::InstId id, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2,
                      const asmjit::Operand_* more) override;

 private:
  bool evex_;
};

}  // namespace pumice::jit
