// Rows whose quads all read the same record.
#pragma once

#include <cstdint>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

//! In the imm of quad.load, beside the byte offset in the low 32 bits: the caller promises that all quads of a row have the same
//! record. So the value is the same in all lanes, though it changes from row to row.
constexpr uint64_t kOneRecord = uint64_t(1) << 32;

//! Beside it, in the load of a plane's origin (dx and dy stand behind it): the caller promises that at all lanes the plane lies between
//! +0 and 1, at the places of inputs 0 and 1.
constexpr uint64_t kPlaneInUnit = uint64_t(1) << 33;

//! Whether v is the value of such a plane.
inline bool isPlaneInUnit(const Function& f, Value v) {
  const auto isField = [&](Value x, uint64_t at) { return f.insts[x].op == Op::QuadLoad && uint32_t(f.insts[x].imm) == at; };
  const auto isInput = [&](Value x, uint64_t slot) { return f.insts[x].op == Op::Input && f.insts[x].imm == slot; };
  const auto isProduct = [&](Value x, Value y, uint64_t at, uint64_t slot) {
    return (isField(x, at) && isInput(y, slot)) || (isField(y, at) && isInput(x, slot));
  };
  if (f.insts[v].op != Op::Fma || f.insts[v].type != Type::F32) return false;
  const auto outer = f.operands(v);
  if (f.insts[outer[2]].op != Op::Fma) return false;
  const auto inner = f.operands(outer[2]);
  const Inst& origin = f.insts[inner[2]];
  if (origin.op != Op::QuadLoad || !(origin.imm & kPlaneInUnit)) return false;
  const uint32_t at = uint32_t(origin.imm);
  return isProduct(inner[0], inner[1], uint64_t(at) + 8, 1) && isProduct(outer[0], outer[1], uint64_t(at) + 4, 0);
}

}  // namespace pumice::ir
