#include "spirv_interp/jit/engine.h"

#include <algorithm>
#include <cstdio>

#include "base/env.h"
#include "base/log.h"
#include "spirv_interp/jit/jit.h"

namespace pumice::jit {
namespace {

bool wantsNative() {
  const std::string wanted = base::envString(base::EnvVar::Engine).value_or("auto");
  if (wanted == "interp") return false;
  if (wanted != "auto" && wanted != "jit") base::logError("PUMICE_ENGINE=%s is none of auto, interp, jit", wanted.c_str());
  if (wanted == "jit" && !available()) base::logError("PUMICE_ENGINE=jit: this processor has no AVX2, FMA and F16C, or PUMICE_ISA forbids them");
  return available();
}

struct Settings {
  bool native = wantsNative(), dumpIr = false, dumpCode = false;
  const bool asked = base::envString(base::EnvVar::Engine).value_or("") == "jit";
  Settings() {
    const std::string dump = base::envString(base::EnvVar::Dump).value_or("");
    dumpIr = dump == "ir" || dump == "ir,asm" || dump == "asm,ir";
    dumpCode = dump == "asm" || dump == "ir,asm" || dump == "asm,ir";
    if (!dump.empty() && !dumpIr && !dumpCode) base::logError("PUMICE_DUMP=%s is none of ir, asm and ir,asm", dump.c_str());
  }
};

const Settings& settings() {
  static const Settings once;
  return once;
}

}  // namespace

bool emitsCode() { return settings().native; }

interp::Result<std::unique_ptr<interp::Executable>> makeExecutable(const ir::Function& f, const interp::CompileOptions& options,
                                                                   bool wholeBlocks, uint32_t chunkLanes) {
  const Settings& settings = jit::settings();
  if (settings.dumpIr) std::fputs(ir::print(f).c_str(), stderr);
  // Checks (PUMICE_CHECK) are the interpreter's.
  const bool checks = std::any_of(f.insts.begin(), f.insts.end(), [](const ir::Inst& i) { return i.op == ir::Op::Check; });
  if (settings.native && !checks) {
    std::string listing;
    JitOptions jit;
    jit.wholeBlocks = wholeBlocks;
    jit.chunkLanes = chunkLanes;
    if (settings.dumpCode) jit.listing = &listing;
    auto native = compile(f, options, jit);
    if (!listing.empty()) std::fprintf(stderr, "; %s\n%s", f.name.c_str(), listing.c_str());
    if (native) return native;
    (settings.asked ? base::logError : base::logInfo)("left to the interpreter: %s", native.error().message.c_str());
  }
  return interp::compileInterpreter(f, options);
}

}  // namespace pumice::jit
