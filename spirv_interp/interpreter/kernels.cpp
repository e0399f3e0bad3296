#include <array>
#include <cstring>
#include <mutex>
#include <span>
#include <type_traits>

#include "base/env.h"
#include "base/log.h"
#include "hwy/highway.h"
#include "spirv_interp/interpreter/bytecode.h"

namespace pumice::interp {
namespace {

struct Named {
  Target target;
  const char* isa;   //!< as PUMICE_ISA names it
};
// Best first. Those that were not compiled for this processor drop out below.
constexpr Named kTargets[] = {
    {{HWY_AVX3, "AVX3"}, "avx512"},
    {{HWY_AVX2, "AVX2"}, "avx2"},
    {{HWY_SSE4, "SSE4"}, "sse4"},
    {{HWY_NEON, "NEON"}, "neon"},
    {{HWY_EMU128, "EMU128"}, "scalar"},
    {{HWY_SCALAR, "SCALAR"}, "scalar"},
};
constexpr size_t kTargetCount = std::size(kTargets);

bool available(const Target& t) { return (int64_t(HWY_TARGETS) & hwy::SupportedTargets() & t.bit) != 0; }

// Nothing to destroy: threads may draw while the process already exits.
struct TargetList {
  Target targets[kTargetCount];
  size_t count = 0;
};

TargetList listTargets() {
  TargetList list{};
  for (const Named& n : kTargets)
    // Everything runs on the baseline, whatever Highway's detection says.
    if (available(n.target) || (n.target.bit == HWY_STATIC_TARGET)) list.targets[list.count++] = n.target;
  return list;
}

const Target& chooseTarget() {
  std::span<const Target> all = availableTargets();
  if (const auto wanted = base::envString(base::EnvVar::Isa)) {
    for (const Named& n : kTargets)
      if (*wanted == n.isa)
        for (const Target& t : all)
          if (t.bit == n.target.bit) return t;
    base::logError("PUMICE_ISA=%s: not available here; using %s", wanted->c_str(), all.front().name);
  }
  return all.front();
}

}  // namespace

std::span<const Target> availableTargets() {
  static const TargetList list = listTargets();
  return {list.targets, list.count};
}

const Target& defaultTarget() {
  static const Target& target = chooseTarget();
  return target;
}

const KernelTable& kernelTable(const Target& target) {
  struct Entry {
    std::once_flag once;
    KernelTable table;
  };
  static_assert(std::is_trivially_destructible_v<Entry>);  // as above
  static std::array<Entry, kTargetCount> entries;
  size_t i = 0;
  while (i + 1 < kTargetCount && kTargets[i].target.bit != target.bit) i++;
  Entry& entry = entries[i];
  std::call_once(entry.once, [&] {
    addFloatKernels(target.bit, entry.table);
    addIntKernels(target.bit, entry.table);
    addMoveKernels(target.bit, entry.table);
    addConvertKernels(target.bit, entry.table);
    addMemoryKernels(entry.table);
    addGatherKernels(target.bit, entry.table);
    addControlKernels(entry.table);
    addSubgroupKernels(entry.table);
  });
  return entry.table;
}

const char* interpreterTarget() { return defaultTarget().name; }

}  // namespace pumice::interp
