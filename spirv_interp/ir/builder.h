// Builds lane IR. Everything that runs per vertex or per pixel is written against this class, so that code
// reads like the formula it emits. The builder folds constants and merges equal pure instructions within a
// region as it goes (bit-exactly: see ops.inc), so callers need not avoid trivial operations.
#pragma once

#include <bit>
#include <initializer_list>
#include <vector>

#include "spirv_interp/ir/ir.h"
#include "spirv_interp/ir/value_table.h"

namespace pumice::ir {

class Builder {
 public:
  explicit Builder(Function& f);

  Function& function() { return f_; }
  Type type(Value v) const { return f_.type(v); }
  void setLine(uint32_t line) { line_ = line; }
  void setInstFlags(uint8_t flags) { instFlags_ = flags; }   //!< for the instructions that follow

  //! Makes room for about so many more instructions.
  void reserve(size_t more);

  //! Appends (or folds, or finds) an instruction. The typed helpers below are thin wrappers over it.
  Value emit(Op op, Type type, std::span<const Value> operands, uint64_t imm = 0);
  Value emit(Op op, Type type, std::initializer_list<Value> operands, uint64_t imm = 0) {
    return emit(op, type, std::span<const Value>(operands.begin(), operands.size()), imm);
  }
  //! Appends an instruction that is no marker as it is, and does not remember it. The operands are not in the pool.
  Value append(Op op, Type type, std::span<const Value> operands, uint64_t imm);

  // Constants
  Value constant(Type t, uint64_t bits);
  Value f32(float x) { return constant(Type::F32, std::bit_cast<uint32_t>(x)); }
  Value f64(double x) { return constant(Type::F64, std::bit_cast<uint64_t>(x)); }
  Value i32(uint32_t x) { return constant(Type::I32, x); }
  Value i64(uint64_t x) { return constant(Type::I64, x); }
  Value mask(bool x) { return constant(Type::Mask, x ? 1 : 0); }
  Value zero(Type t) { return constant(t, 0); }
  //! A float constant of type t (f16, f32, f64), rounded to it.
  Value floatConstant(Type t, double x);
  //! True and the bits when v is a Const.
  bool isConstant(Value v, uint64_t* bits = nullptr) const;

  // Arithmetic with the type of the first operand
  Value unary(Op op, Value a) { return emit(op, type(a), {a}); }
  Value binary(Op op, Value a, Value b) { return emit(op, type(a), {a, b}); }
  Value compare(Op op, Value a, Value b) { return emit(op, Type::Mask, {a, b}); }
#define PUMICE_B2(fn, op) Value fn(Value a, Value b) { return binary(Op::op, a, b); }
  PUMICE_B2(fadd, FAdd) PUMICE_B2(fsub, FSub) PUMICE_B2(fmul, FMul) PUMICE_B2(fdiv, FDiv)
  PUMICE_B2(fmin, FMin) PUMICE_B2(fmax, FMax)
  PUMICE_B2(iadd, IAdd) PUMICE_B2(isub, ISub) PUMICE_B2(imul, IMul)
  PUMICE_B2(sdiv, SDiv) PUMICE_B2(udiv, UDiv) PUMICE_B2(srem, SRem) PUMICE_B2(urem, URem)
  PUMICE_B2(and_, And) PUMICE_B2(or_, Or) PUMICE_B2(xor_, Xor) PUMICE_B2(shl, Shl) PUMICE_B2(lshr, LShr) PUMICE_B2(ashr, AShr)
  PUMICE_B2(smin, SMin) PUMICE_B2(smax, SMax) PUMICE_B2(umin, UMin) PUMICE_B2(umax, UMax)
#undef PUMICE_B2
#define PUMICE_CMP(fn, op) Value fn(Value a, Value b) { return compare(Op::op, a, b); }
  PUMICE_CMP(feq, FEq) PUMICE_CMP(fne, FNe) PUMICE_CMP(flt, FLt) PUMICE_CMP(fle, FLe)
  PUMICE_CMP(ieq, IEq) PUMICE_CMP(ine, INe) PUMICE_CMP(slt, SLt) PUMICE_CMP(sle, SLe) PUMICE_CMP(ult, ULt) PUMICE_CMP(ule, ULe)
  PUMICE_CMP(maskAnd, MaskAnd) PUMICE_CMP(maskOr, MaskOr) PUMICE_CMP(maskXor, MaskXor)
#undef PUMICE_CMP
  Value maskNot(Value a) { return emit(Op::MaskNot, Type::Mask, {a}); }
  Value fma(Value a, Value b, Value c) { return emit(Op::Fma, type(a), {a, b, c}); }
  Value fneg(Value a) { return unary(Op::FNeg, a); }
  Value fabs(Value a) { return unary(Op::FAbs, a); }
  Value fsqrt(Value a) { return unary(Op::FSqrt, a); }
  Value ffloor(Value a) { return unary(Op::FFloor, a); }
  Value not_(Value a) { return unary(Op::Not, a); }
  Value select(Value m, Value a, Value b) { return emit(Op::Select, type(a), {m, a, b}); }
  Value convert(Op op, Type to, Value a) { return emit(op, to, {a}); }
  Value bitcast(Type to, Value a) { return type(a) == to ? a : emit(Op::BitCast, to, {a}); }

  // Interface
  Value input(Type t, uint32_t slot) { return emit(Op::Input, t, {}, slot); }
  Value uniform(Type t, uint32_t byteOffset) { return emit(Op::UniformInput, t, {}, byteOffset); }
  void output(uint32_t slot, Value v) { emit(Op::Output, Type::None, {v}, slot); }
  Value execMask() { return emit(Op::ExecMask, Type::Mask, {}); }
  Value laneId() { return emit(Op::LaneId, Type::I32, {}); }

  // Variables
  Value var(Type t) { return emit(Op::Var, t, {}); }
  Value get(Value var) { return emit(Op::VarGet, type(var), {var}); }
  void set(Value var, Value v) { emit(Op::VarSet, Type::None, {var, v}); }

  // Memory
  Value tableLoad(Type t, uint32_t table, uint32_t constOffset, Value offset = 0);
  Value load(Type t, Value base, Value offset, Value size, uint32_t constOffset = 0) { return emit(Op::Load, t, {base, offset, size}, constOffset); }
  Value loadConst(Type t, Value base, Value offset, Value size, uint32_t constOffset = 0) { return emit(Op::LoadConst, t, {base, offset, size}, constOffset); }
  void store(Value base, Value offset, Value size, Value v, uint32_t constOffset = 0) { emit(Op::Store, Type::None, {base, offset, size, v}, constOffset); }
  Value quadLoad(Type t, uint32_t byteOffset) { return emit(Op::QuadLoad, t, {}, byteOffset); }
  //! elementBytes: size of the plane's elements; byteOffset: of the value within its element.
  static constexpr uint64_t tileImm(uint32_t plane, uint32_t elementBytes, uint32_t byteOffset) { return uint64_t(plane) << 32 | elementBytes << 16 | byteOffset; }
  Value tileLoad(Type t, uint32_t plane, uint32_t elementBytes, uint32_t byteOffset) { return emit(Op::TileLoad, t, {}, tileImm(plane, elementBytes, byteOffset)); }
  void tileStore(uint32_t plane, uint32_t elementBytes, uint32_t byteOffset, Value v) { emit(Op::TileStore, Type::None, {v}, tileImm(plane, elementBytes, byteOffset)); }

  // Control flow
  void beginIf(Value m) { emit(Op::If, Type::None, {m}); }
  void beginElse() { emit(Op::Else, Type::None, {}); }
  void endIf() { emit(Op::EndIf, Type::None, {}); }
  void beginLoop() { emit(Op::Loop, Type::None, {}); }
  void endLoop() { emit(Op::EndLoop, Type::None, {}); }
  void beginBlock() { emit(Op::Block, Type::None, {}); }
  void endBlock() { emit(Op::EndBlock, Type::None, {}); }
  void breakOut(uint32_t constructs = 0) { emit(Op::Break, Type::None, {}, constructs); }
  //! Number of loop/block constructs open; break k from depth d leaves to depth d-1-k.
  uint32_t breakDepth() const { return breakDepth_; }

 private:
  Function& f_;
  uint32_t line_ = 0;
  uint8_t instFlags_ = 0;
  uint32_t breakDepth_ = 0;
  std::vector<size_t> scopes_;   //!< marks in available_: values found in closed regions are forgotten
  ValueTable available_;         //!< pure instructions of the open regions
  void openScope();
  void closeScope();
};

}  // namespace pumice::ir
