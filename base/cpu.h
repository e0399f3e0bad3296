// What this process may really use of the machine. In a container the machine's own numbers are wrong by
// an order of magnitude: thirty threads on two processors are slower than two.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace pumice::base {

// PUMICE_THREADS if set; else the processors of the affinity mask, limited by the cgroup's quota (rounded
// up). At least 1. Reads the system on every call.
unsigned usableCpus();

// Physical memory, limited by the cgroup and by RLIMIT_AS. Never 0.
uint64_t usableMemoryBytes();

// The tightest limits of the process's cgroup and of all groups above it, versions 1 and 2.
struct CgroupLimits {
  std::optional<double> cpus;
  std::optional<uint64_t> memoryBytes;
};

// `root` is put before every path (/proc/self/cgroup, /proc/self/mountinfo and the mounts named there).
CgroupLimits cgroupLimits(const std::string& root = "");

//! The processor has AVX2 and PUMICE_ISA does not ask for less. Asked once.
bool mayUseAvx2();

}  // namespace pumice::base
