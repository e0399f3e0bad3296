// Processors without an emitter: the interpreter serves.
#include "spirv_interp/jit/jit.h"

namespace pumice::jit {

bool available() { return false; }
bool runs(Isa) { return false; }
interp::Result<std::unique_ptr<interp::Executable>> compile(const ir::Function&, const interp::CompileOptions&, const JitOptions&) {
  return base::errorf("there is no emitter for this processor");
}
Statistics statistics() { return {}; }

}  // namespace pumice::jit
