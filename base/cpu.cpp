#include "base/cpu.h"

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>

#include "base/env.h"

namespace pumice::base {

namespace {

constexpr unsigned kMostThreads = 1024;

// Nothing if the file cannot be read. For the small files of /proc and /sys only.
std::optional<std::string> readSmallFile(const std::string& path) {
  FILE* file = std::fopen(path.c_str(), "re");
  if (!file) return std::nullopt;
  std::string text;
  char buffer[4096];
  while (size_t got = std::fread(buffer, 1, sizeof(buffer), file)) text.append(buffer, got);
  std::fclose(file);
  return text;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (true) {
    size_t end = text.find(separator);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

bool contains(const std::vector<std::string_view>& list, std::string_view word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

// A mounted cgroup hierarchy: the directory `mountPoint` shows the group `mountedGroup` and those below.
struct Hierarchy {
  bool version2 = false;
  std::string mountPoint;
  std::string mountedGroup;
  std::string options;  // version 1: the controllers, among other words
};

std::vector<Hierarchy> mountedHierarchies(const std::string& root) {
  std::vector<Hierarchy> found;
  auto text = readSmallFile(root + "/proc/self/mountinfo");
  if (!text) return found;
  for (std::string_view line : split(*text, '\n')) {
    // 30 23 0:26 <root> <mount point> <options> <tags...> - <type> <source> <super options>
    size_t dash = line.find(" - ");
    if (dash == std::string_view::npos) continue;
    auto before = split(line.substr(0, dash), ' ');
    auto after = split(line.substr(dash + 3), ' ');
    if (before.size() < 5 || after.size() < 3) continue;
    if (after[0] != "cgroup" && after[0] != "cgroup2") continue;
    found.push_back(
        {after[0] == "cgroup2", std::string(before[4]), std::string(before[3]), std::string(after[2])});
  }
  return found;
}

// The directories of a group and of all groups above it that can be seen.
std::vector<std::string> groupDirectories(const std::string& root, const Hierarchy& hierarchy,
                                          std::string_view group) {
  // Within a cgroup namespace, or a bind mount of the group itself, the path may not lie below the mount:
  // the mount point is then the best that is known.
  std::string_view mounted = hierarchy.mountedGroup;
  if (mounted != "/" && group.substr(0, mounted.size()) == mounted)
    group.remove_prefix(mounted.size());
  else if (mounted != "/")
    group = "";
  const std::string top = root + hierarchy.mountPoint;
  std::vector<std::string> directories;
  std::string path(group);
  while (!path.empty() && path != "/") {
    if (path.find("/..") == std::string::npos) directories.push_back(top + path);
    size_t slash = path.rfind('/');
    path.resize(slash == std::string::npos ? 0 : slash);
  }
  directories.push_back(top);
  return directories;
}

template <typename T>
void tighten(std::optional<T>& limit, T candidate) {
  limit = limit ? std::min(*limit, candidate) : candidate;
}

void readCpuV2(const std::string& directory, CgroupLimits& limits) {
  auto text = readSmallFile(directory + "/cpu.max");  // "<quota or max> <period>"
  double quota, period;
  if (text && std::sscanf(text->c_str(), "%lf %lf", &quota, &period) == 2 && quota > 0 && period > 0)
    tighten(limits.cpus, quota / period);
}

void readCpuV1(const std::string& directory, CgroupLimits& limits) {
  auto quotaText = readSmallFile(directory + "/cpu.cfs_quota_us");  // -1: no limit
  auto periodText = readSmallFile(directory + "/cpu.cfs_period_us");
  if (!quotaText || !periodText) return;
  double quota = std::strtod(quotaText->c_str(), nullptr);
  double period = std::strtod(periodText->c_str(), nullptr);
  if (quota > 0 && period > 0) tighten(limits.cpus, quota / period);
}

void readMemory(const std::string& file, CgroupLimits& limits) {
  auto text = readSmallFile(file);  // a number, or "max" in version 2
  unsigned long long bytes;
  if (text && std::sscanf(text->c_str(), "%llu", &bytes) == 1 && bytes > 0)
    tighten(limits.memoryBytes, uint64_t(bytes));
}

unsigned affinityCpus() {
  // The mask of a very large machine does not fit cpu_set_t: ask with a larger one.
  for (size_t cpus = 1024; cpus <= 65536; cpus *= 4) {
    cpu_set_t* set = CPU_ALLOC(cpus);
    if (!set) break;
    size_t size = CPU_ALLOC_SIZE(cpus);
    int failed = ::sched_getaffinity(0, size, set);
    int count = failed ? 0 : CPU_COUNT_S(size, set);
    CPU_FREE(set);
    if (count > 0) return unsigned(count);
  }
  long online = ::sysconf(_SC_NPROCESSORS_ONLN);
  return online > 0 ? unsigned(online) : 1;
}

}  // namespace

CgroupLimits cgroupLimits(const std::string& root) {
  CgroupLimits limits;
  auto text = readSmallFile(root + "/proc/self/cgroup");
  if (!text) return limits;
  auto hierarchies = mountedHierarchies(root);
  for (std::string_view line : split(*text, '\n')) {
    // <id>:<controllers, empty for version 2>:<group>; the group may contain colons.
    size_t first = line.find(':');
    size_t second = first == std::string_view::npos ? first : line.find(':', first + 1);
    if (second == std::string_view::npos) continue;
    auto controllers = split(line.substr(first + 1, second - first - 1), ',');
    std::string_view group = line.substr(second + 1);
    bool version2 = first + 1 == second;
    for (const Hierarchy& hierarchy : hierarchies) {
      if (hierarchy.version2 != version2) continue;
      auto options = split(hierarchy.options, ',');
      auto governs = [&](std::string_view controller) {
        return version2 || (contains(controllers, controller) && contains(options, controller));
      };
      for (const std::string& directory : groupDirectories(root, hierarchy, group)) {
        if (governs("cpu")) {
          if (version2)
            readCpuV2(directory, limits);
          else
            readCpuV1(directory, limits);
        }
        if (governs("memory")) {
          readMemory(directory + (version2 ? "/memory.max" : "/memory.limit_in_bytes"), limits);
          if (version2) readMemory(directory + "/memory.high", limits);
        }
      }
    }
  }
  return limits;
}

unsigned usableCpus() {
  if (auto wanted = envInteger(EnvVar::Threads, 1, kMostThreads)) return unsigned(*wanted);
  unsigned cpus = affinityCpus();
  if (auto quota = cgroupLimits().cpus) {
    double rounded = std::ceil(*quota - 1e-6);
    if (rounded < double(cpus)) cpus = unsigned(std::max(1.0, rounded));
  }
  return std::clamp(cpus, 1u, kMostThreads);
}

uint64_t usableMemoryBytes() {
  long pages = ::sysconf(_SC_PHYS_PAGES);
  long pageSize = ::sysconf(_SC_PAGESIZE);
  uint64_t bytes = pages > 0 && pageSize > 0 ? uint64_t(pages) * uint64_t(pageSize) : uint64_t(1) << 30;
  // Version 1 says "no limit" with a number near 2^63, which the minimum takes care of.
  if (auto limit = cgroupLimits().memoryBytes) bytes = std::min(bytes, *limit);
  struct rlimit space;
  if (::getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY)
    bytes = std::min(bytes, uint64_t(space.rlim_cur));
  return std::max<uint64_t>(bytes, 1);
}

bool mayUseAvx2() {
#if defined(__x86_64__)
  static const bool may = [] {
    const auto isa = envString(EnvVar::Isa);
    return __builtin_cpu_supports("avx2") && !(isa && (*isa == "sse4" || *isa == "scalar"));
  }();
  return may;
#else
  return false;
#endif
}

}  // namespace pumice::base
