// Instructions in which an invocation may see what others write while it runs: a loop that holds one may be waiting for them.
#pragma once

#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

//! Of memory that all work groups see.
inline bool looksAtDeviceMemory(const Inst& i) {
  return i.op == Op::Atomic || i.op == Op::AtomicCas || (i.op == Op::Load && (i.flags & kInstVolatile));
}
//! Of that, or of the work group's own.
inline bool looksAtOthers(const Inst& i) {
  return looksAtDeviceMemory(i) || i.op == Op::SharedAtomic || i.op == Op::SharedAtomicCas || (i.op == Op::SharedLoad && (i.flags & kInstVolatile));
}

//! By value: somebody takes it. An atomic operation whose result nobody takes looks at nothing.
inline std::vector<uint8_t> takenValues(const Function& f) {
  std::vector<uint8_t> taken(f.insts.size(), 0);
  for (const Inst& i : f.insts)
    for (Value o : f.operands(i)) taken[o] = 1;
  return taken;
}
inline bool isAtomic(Op op) { return op == Op::Atomic || op == Op::AtomicCas || op == Op::SharedAtomic || op == Op::SharedAtomicCas; }

}  // namespace pumice::ir
