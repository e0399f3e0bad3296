#include "base/cpu.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/log.h"

namespace pumice::base {
namespace {

namespace fs = std::filesystem;

// A directory that looks like / as far as control groups go.
class FakeRoot : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "pumice_cpu_test_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    root_ = pattern;
  }
  void TearDown() override { fs::remove_all(root_); }

  void write(const std::string& path, const std::string& text) {
    fs::create_directories((root_ + path).substr(0, (root_ + path).rfind('/')));
    std::ofstream(root_ + path) << text;
  }

  std::string root_;
};

TEST_F(FakeRoot, NoControlGroupsMeansNoLimits) {
  CgroupLimits limits = cgroupLimits(root_);
  EXPECT_FALSE(limits.cpus);
  EXPECT_FALSE(limits.memoryBytes);
}

TEST_F(FakeRoot, Version2TakesTheTightestOfAllLevels) {
  write("/proc/self/cgroup", "0::/outer/inner\n");
  write("/proc/self/mountinfo",
        "30 23 0:26 / /sys/fs/cgroup rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate\n");
  write("/sys/fs/cgroup/outer/inner/cpu.max", "max 100000\n");
  write("/sys/fs/cgroup/outer/inner/memory.max", "3000000\n");
  write("/sys/fs/cgroup/outer/inner/memory.high", "max\n");
  write("/sys/fs/cgroup/outer/cpu.max", "250000 100000\n");
  write("/sys/fs/cgroup/outer/memory.max", "9000000\n");
  CgroupLimits limits = cgroupLimits(root_);
  ASSERT_TRUE(limits.cpus && limits.memoryBytes);
  EXPECT_DOUBLE_EQ(*limits.cpus, 2.5);
  EXPECT_EQ(*limits.memoryBytes, 3000000u);
}

TEST_F(FakeRoot, Version1ReadsEachControllersOwnHierarchy) {
  write("/proc/self/cgroup", "4:memory:/box\n3:cpu,cpuacct:/box/part\n1:name=systemd:/x\n0::/unified\n");
  write("/proc/self/mountinfo",
        "31 23 0:27 / /cg/memory rw - cgroup cgroup rw,memory\n"
        "32 23 0:28 / /cg/cpu,cpuacct rw - cgroup cgroup rw,cpu,cpuacct\n");
  write("/cg/memory/box/memory.limit_in_bytes", "5000000\n");
  write("/cg/memory/memory.limit_in_bytes", "9223372036854771712\n");
  write("/cg/cpu,cpuacct/box/part/cpu.cfs_quota_us", "-1\n");
  write("/cg/cpu,cpuacct/box/part/cpu.cfs_period_us", "100000\n");
  write("/cg/cpu,cpuacct/box/cpu.cfs_quota_us", "50000\n");
  write("/cg/cpu,cpuacct/box/cpu.cfs_period_us", "100000\n");
  CgroupLimits limits = cgroupLimits(root_);
  ASSERT_TRUE(limits.cpus && limits.memoryBytes);
  EXPECT_DOUBLE_EQ(*limits.cpus, 0.5);
  EXPECT_EQ(*limits.memoryBytes, 5000000u);
}

// Docker without a cgroup namespace: the group's own directory is what is mounted.
TEST_F(FakeRoot, AMountOfTheGroupItselfIsTheGroup) {
  write("/proc/self/cgroup", "3:cpu:/docker/abc\n");
  write("/proc/self/mountinfo", "32 23 0:28 /docker/abc /cg/cpu ro - cgroup cgroup rw,cpu\n");
  write("/cg/cpu/cpu.cfs_quota_us", "300000\n");
  write("/cg/cpu/cpu.cfs_period_us", "100000\n");
  CgroupLimits limits = cgroupLimits(root_);
  ASSERT_TRUE(limits.cpus);
  EXPECT_DOUBLE_EQ(*limits.cpus, 3);
}

TEST(Cpu, TheVariableOverridesEverything) {
  ::setenv("PUMICE_THREADS", "37", 1);
  EXPECT_EQ(usableCpus(), 37u);
  std::string said;
  ScopedLogSink sink([&](LogLevel, std::string_view text) { said = text; });
  ::setenv("PUMICE_THREADS", "0", 1);
  EXPECT_LT(usableCpus(), 37u);
  EXPECT_GE(usableCpus(), 1u);
  EXPECT_NE(said, "");
  ::unsetenv("PUMICE_THREADS");
}

TEST(Cpu, TheAffinityMaskIsALimit) {
  ::unsetenv("PUMICE_THREADS");
  cpu_set_t before, one;
  ASSERT_EQ(::sched_getaffinity(0, sizeof(before), &before), 0);
  CPU_ZERO(&one);
  for (int cpu = 0; cpu < CPU_SETSIZE; cpu++) {
    if (CPU_ISSET(cpu, &before)) {
      CPU_SET(cpu, &one);
      break;
    }
  }
  ASSERT_EQ(::sched_setaffinity(0, sizeof(one), &one), 0);
  EXPECT_EQ(usableCpus(), 1u);
  ASSERT_EQ(::sched_setaffinity(0, sizeof(before), &before), 0);
  EXPECT_LE(usableCpus(), unsigned(CPU_COUNT(&before)));
}

// The shadow memory of these sanitizers does not fit any limit.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(Cpu, MemoryIsLimitedByTheAddressSpace) {
  EXPECT_GT(usableMemoryBytes(), uint64_t(16) << 20);
  pid_t child = ::fork();
  if (child == 0) {
    struct rlimit limit = {uint64_t(3) << 40, RLIM_INFINITY};
    bool ok = ::setrlimit(RLIMIT_AS, &limit) == 0 && usableMemoryBytes() <= limit.rlim_cur;
    limit.rlim_cur = 12345678;
    // From here on nothing can be allocated; reading the limit does not need to.
    ok = ok && ::setrlimit(RLIMIT_AS, &limit) == 0 && usableMemoryBytes() <= 12345678;
    ::_exit(ok ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}
#endif

}  // namespace
}  // namespace pumice::base
