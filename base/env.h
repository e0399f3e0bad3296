// Every environment variable that Pumice reads, in one table; nothing else in the tree calls getenv().
// A test compares the table in README.md with this one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace pumice::base {

// X(id, name, values, default, description)
#define PUMICE_ENV_LIST(X)                                                                        \
  X(Log, "PUMICE_LOG", "off, error, warn, info, debug", "error", "how much is written to stderr") \
  X(Threads, "PUMICE_THREADS", "1 to 1024", "what the process may use",                           \
    "number of threads that draw, the one that asks included")                                    \
  X(Isa, "PUMICE_ISA", "scalar, sse4, avx2, avx512", "the best of this processor",                \
    "instruction set of the interpreter's kernels and of the JIT (off below avx2)")                                               \
  X(Numerics, "PUMICE_NUMERICS", "f32, reference", "f32",                                         \
    "reference: shaders and blending compute in double precision")                                \
  X(Decisions, "PUMICE_DECISIONS", "write:FILE, compare:FILE", "nothing",                         \
    "keep what each pixel's fragments decided (primitives, branches, texels, levels), or count the pixels that differ from a kept run") \
  X(Engine, "PUMICE_ENGINE", "auto, interp, jit", "auto",                                         \
    "what runs routines: the interpreter, or machine code made for them (where that is possible)") \
  X(PerfMap, "PUMICE_PERF_MAP", "1 or 0", "0", "write /tmp/perf-PID.map, so that perf names the routines in its reports") \
  X(Dump, "PUMICE_DUMP", "ir, asm or ir,asm", "nothing", "print routines as they are compiled")      \
  X(Stats, "PUMICE_STATS", "1 or 0", "0", "print what each render pass did") \
  X(Disable, "PUMICE_DISABLE", "names of ideas; commas between", "nothing",                  \
    "turn off ideas that save work; pictures stay the same to the bit")                           \
  X(Check, "PUMICE_CHECK", "bounds, nan, uninit, printf; commas between", "nothing",              \
    "report what shaders do wrong, with line and invocation; print what they print (slow)")                              \
  X(Watchdog, "PUMICE_WATCHDOG_SECONDS", "1 to 86400", "no limit",                                \
    "a submission that runs longer is stopped and the device is lost")

enum class EnvVar : int {
#define PUMICE_ENV_ID(id, name, values, fallback, description) id,
  PUMICE_ENV_LIST(PUMICE_ENV_ID)
#undef PUMICE_ENV_ID
};

struct EnvInfo {
  const char* name;
  const char* values;    // what it may be set to, for people
  const char* fallback;  // what holds when it is not set, for people
  const char* description;
};

// In the order of EnvVar.
std::span<const EnvInfo> envTable();
const EnvInfo& envInfo(EnvVar variable);

// The variable's text; nothing if it is unset or empty (or the process runs with raised privileges).
std::optional<std::string> envString(EnvVar variable);

// Whether `text`, which cannot be used, is to be complained about: false if it was before. What is read in several places is said once.
bool firstComplaint(EnvVar variable, const std::string& text);

// A decimal number in [lowest, highest]; anything else is logged as an error and counts as unset.
std::optional<int64_t> envInteger(EnvVar variable, int64_t lowest, int64_t highest);

// 1/on/true/yes or 0/off/false/no; anything else is logged as an error and counts as unset.
bool envFlag(EnvVar variable, bool fallback);

}  // namespace pumice::base
