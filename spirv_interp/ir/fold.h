// The value of plain operations on constants: the executable form of the meanings stated in ops.inc.
// Bits are held in a uint64_t, the unused upper bits zero; a mask is 0 or 1. The floating-point environment
// must be the default one (round to nearest, denormals kept).
#pragma once

#include <cstdint>
#include <span>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

//! `type` is the result's type, `operandType` that of the last operand (comparisons and conversions depend on
//! it). Returns false if the operation is not arithmetic on its operands alone (loads, high-level operations,
//! ...). A NaN made by arithmetic is canonical.
bool foldConstant(Op op, Type type, Type operandType, std::span<const uint64_t> args, uint64_t& result);

//! All bits of an integer or float type set; 1 for masks.
constexpr uint64_t allOnes(Type t) {
  const unsigned bytes = typeBytes(t);
  return bytes == 0 ? 1 : bytes == 8 ? ~uint64_t(0) : (uint64_t(1) << (bytes * 8)) - 1;
}

//! IEEE binary16, round to nearest even; a NaN gives the canonical one.
uint16_t halfFromDouble(double x);
double halfToDouble(uint16_t bits);

//! Bits of x rounded to the float type t (one rounding).
uint64_t floatBits(Type t, double x);
//! The number that the bits of float type t stand for.
double floatValue(Type t, uint64_t bits);

//! The operation that a reduction repeats, and SPIR-V's identity of it (0, 1, infinities, limits, all ones).
Op reduceOperation(ReduceOp op);
uint64_t reduceIdentity(ReduceOp op, Type t);

class Builder;
//! An existing or simpler value equal bit by bit to the operation, or 0. Only exact integer, mask and select
//! identities; none that would change a float's bits.
Value simplify(Builder& b, Op op, Type type, std::span<const Value> operands);

}  // namespace pumice::ir
