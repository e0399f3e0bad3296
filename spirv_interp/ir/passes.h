// Passes over lane IR. The order is one list, in passes.cpp (`kOptimise`). No pass changes a value's bits:
// no x+0, no x*0, no reassociation. Contraction (fma) is the frontend's alone.
#pragma once

#include <functional>

#include "spirv_interp/ir/builder.h"

namespace pumice::ir {

//! Constant folding, forwarding of variables within regions, common subexpressions, dead code, rates.
//! Leaves high-level and abstract operations as they are.
void optimise(Function& f);

//! Sets Inst::rate of every instruction. Constant and Draw values do not depend on the lane: the executors
//! compute them once per draw in the preamble (only pure operations at the top level or speculatively safe
//! ones: TableLoad and LoadConst are bounded, so hoisting them is safe).
void computeRates(Function& f);

//! Oracle: the declared types stay, but rows of f16 and f32 hold doubles and every float operation is evaluated
//! in double. What makes bits visible rounds to the declared type first: stores, bit casts, packing, and
//! `ftof` as the shader wrote it. An `ftof` with the flag kInstKeep does not round (nor does the builder fold
//! it): lowerMath puts it around its f64 sequences, f32 -> f64 -> ... -> f64 -> f32.
enum class Numerics : uint8_t { F32, Oracle };

//! Numerics::Oracle in terms of plain f64 operations, after lowerMath: what is computed becomes f64, and f16 and f32
//! remain where their bits count (memory, interface rows, casts, and values that are only moved from and to them).
//! What crosses an interface (outputs of a stage, buffers) is rounded to its type. Private arrays and work-group memory keep
//! the doubles in memory of their own: a work group then needs oracleSharedBytes().
void widenFloats(Function& f);
constexpr uint32_t oracleSharedBytes(uint32_t sharedBytes) { return sharedBytes * 9; }

//! The last pass but widenFloats: replaces the high-level float operations (fexp2, fsin, frsqrt, ...) by sequences of plain ones,
//! one lowering per number type; in oracle mode the f64 one for all types. Rare ranges (huge angles) stand in
//! an `if` that no lane enters as a rule; for draw-uniform operands everything is pure, so that it can be hoisted.
//! Filters of footprints go too, but with `keepFilters` where all lanes read one image.
void lowerMath(Function& f, Numerics numerics, bool keepFilters = false);

//! Gives values for the abstract operations of shader IR (ShaderInput, ShaderOutput, Builtin, Descriptor,
//! ImageOp, Demote, HelperMask) while a shader is copied into a routine.
class Expander {
 public:
  virtual ~Expander() = default;
  virtual Value shaderInput(Builder&, Type, uint32_t variable, uint32_t component, std::span<const Value> operands) = 0;
  virtual void shaderOutput(Builder&, uint32_t variable, uint32_t component, Value value, std::span<const Value> operands) = 0;
  virtual Value builtin(Builder&, Type, uint32_t spvBuiltIn, uint32_t component) = 0;
  struct Buffer { Value base, size; };
  virtual Buffer descriptor(Builder&, uint32_t resource, Value arrayElement) = 0;
  //! Component values of the result (empty for writes). They replace `tuple.get` of the operation.
  virtual std::vector<Value> image(Builder&, const ImageOpInfo&, std::span<const Value> operands) = 0;
  virtual void demote(Builder&) = 0;
  virtual Value helperMask(Builder&) = 0;
};

//! Copies the body of `shader` to the end of the builder's function, calling the expander for abstract operations.
void inlineShader(Builder& into, const Function& shader, Expander& expander);

}  // namespace pumice::ir
