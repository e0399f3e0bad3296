// What the lowering must know about values before it emits code.
#pragma once

#include <array>
#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::interp {

//! What the bits of a float value's NaNs are worth. Arithmetic leaves whatever NaN the processor makes; the
//! rule (ops.inc) is that it is canonical wherever its bits can be seen. So arithmetic results are made
//! canonical where they are stored, cast, negated, or mixed (select, variable) with bits that must be kept.
enum class NanBits : uint8_t {
  Settled,    //!< no NaN, or a canonical one
  Arithmetic, //!< any NaN stands for the canonical one
  Kept,       //!< the bits count
};

struct Analysis {
  std::array<bool, size_t(ir::Op::kCount)> present{};   //!< by operation: the function has some
  std::vector<ir::Value> structure;  //!< in order: control flow, variables, what reads and sets them
  std::vector<uint8_t> needed;       //!< has an effect or a needed user
  std::vector<uint8_t> uniform;      //!< computed in the preamble (or constant)
  std::vector<NanBits> nan;          //!< of the value; of a var: of all that is stored in it
  std::vector<uint8_t> exposed;      //!< somebody looks at the bits of this float value
  std::vector<uint8_t> aliasesVar;   //!< a var.get that may stand for the variable's row itself
  std::vector<uint8_t> setFirst;     //!< a var that lives within one region and is set there before it is read: needs no zero
};

Analysis analyse(const ir::Function& f);

}  // namespace pumice::interp
