// PUMICE_CHECK: instructions that watch a shader run. They are `check` operations, put in before the first pass, where what
// the shader wrote is still there line by line; executors report what they find, once per place. Without them nothing is slower.
#pragma once

#include <cstdint>
#include <span>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

enum Checks : unsigned {
  kCheckBounds = 1,   //!< accesses outside of buffers, images, work-group memory and private arrays, and by addresses of nothing
  kCheckNan = 2,      //!< operations that make NaN or infinity of finite operands
  kCheckUninit = 4,   //!< reads of variables that nobody has written
  kCheckPrintf = 8,   //!< what the shader prints (debug_print.h)
};
constexpr unsigned kAllChecks = kCheckBounds | kCheckNan | kCheckUninit | kCheckPrintf;

//! What PUMICE_CHECK asks for; what it does not know it names in the log.
unsigned wantedChecks();

//! What one `check` looks at. Its first operand is a mask of the lanes that count (helper invocations do not).
enum class CheckKind : uint8_t {
  Buffer,    //!< base, offset, size
  Local,     //!< offset, size: private arrays, work-group memory
  Finite,    //!< result, operands
  Written,   //!< mask: has been written
  Texel,     //!< coordinate, how many there are; `constant`: ImageKind | TexelAxis << 8
  Vertex,    //!< offset, bytes, size of the vertex buffer; `constant`: location
  Address,   //!< base, offset: buffer device addresses (base/address_ranges.h)
  Index,     //!< index, how many there are; `constant`: IndexedKind. Put in by the frontend before an access that has kInstIndexed
  Print,     //!< the values of a printf's arguments, scalar by scalar; `constant`: printCall(). Put in by the frontend
};
enum class IndexedKind : uint8_t { Array, Vector, Matrix };
enum class TexelAxis : uint8_t { X, Y, Z, Layer, Level, Sample };
struct CheckPlace {
  CheckKind kind = CheckKind::Buffer;
  Op op = Op::Nop;            //!< what is watched
  Type type = Type::None;     //!< of what is accessed or computed
  uint32_t constant = 0;      //!< added to the offset
};
constexpr uint64_t checkImm(const CheckPlace& p) {
  return uint64_t(p.kind) | uint64_t(p.op) << 8 | uint64_t(p.type) << 16 | uint64_t(p.constant) << 32;
}
constexpr CheckPlace checkPlace(uint64_t imm) {
  return {CheckKind(imm & 0xff), Op(imm >> 8 & 0xff), Type(imm >> 16 & 0xff), uint32_t(imm >> 32)};
}

//! Puts `checks` into shader IR that no pass has touched. `helpers`: there may be helper invocations. `zeroed`: what of work-group
//! memory has a value from the start.
struct ByteRange { uint32_t begin = 0, end = 0; };
void insertChecks(Function& f, unsigned checks, bool helpers, std::span<const ByteRange> zeroed = {});

}  // namespace pumice::ir
