// Compute: addresses that count through memory along the lanes of a work group, whatever loop they stand in.
//
// With a promise about work groups (ir::Function::groupSize) the local id of a chunk's lane is that of its first lane plus a number that
// is known here. So is every sum, difference or multiple of it with what all lanes have alike: the *pattern*. An access whose
// offset has one takes the first lane's alone, as one number for all lanes; which bytes the others want, and that all of them lie within
// bounds, follows from it.
#pragma once

#include <cstdint>
#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

//! Offsets of lanes: (first + delta[lane]) << shift, what is shifted being at most 0xffffffff >> shift if it is `clamped`.
struct LanePattern {
  int32_t delta[ir::kSubgroupLanes] = {};   //!< none is negative
  uint8_t shift = 0;       //!< 0 if not clamped
  bool clamped = false;

  //! Bytes from the first lane's element to `lane`'s.
  int32_t bytes(uint32_t lane) const { return delta[lane] << shift; }
};

//! What all lanes of a chunk have alike, in the imm of an input beside the slot: its first lane's.
constexpr uint64_t kFirstOfChunk = uint64_t(1) << 32;

//! Whether all lanes of a chunk have the same in this input.
bool isGroupUniform(const ir::Function& f, const ir::Inst& input);

//! The index + 1 of an access's pattern, 0: it has none. (Atomics have another meaning there.)
inline uint32_t patternOf(const ir::Inst& i) {
  return i.op == ir::Op::Load || i.op == ir::Op::LoadConst || i.op == ir::Op::Store || i.op == ir::Op::SharedLoad || i.op == ir::Op::SharedStore ? uint32_t(i.imm >> 32) : 0;
}
//! Which operand of such an access is its offset.
inline uint32_t offsetOperand(ir::Op op) { return op == ir::Op::SharedLoad || op == ir::Op::SharedStore ? 0 : 1; }

//! Gives accesses of 32 bits patterns, and the first lane's offset for theirs. Rates must be known.
//! `constants`: numbers that are added become part of the pattern, so that many offsets share one first lane's (measured: without many of
//! them code is worse for it).
std::vector<LanePattern> findPatterns(ir::Function& f, bool constants);

}  // namespace pumice::jit
