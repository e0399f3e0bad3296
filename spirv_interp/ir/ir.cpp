#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

namespace {
constexpr OpInfo kOps[] = {
    {"nop", 0, ResultRule::None, OperandRule::Free, 0},
#define PUMICE_OP(name, text, count, result, operands, flags) \
  {text, count, ResultRule::result, OperandRule::operands, flags},
#include "spirv_interp/ir/ops.inc"
#undef PUMICE_OP
};
static_assert(std::size(kOps) == static_cast<size_t>(Op::kCount));
}  // namespace

const OpInfo& opInfo(Op op) { return kOps[static_cast<size_t>(op)]; }

}  // namespace pumice::ir
