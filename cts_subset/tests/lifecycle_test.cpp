// A thousand lives: instance, device, one triangle, and gone again. Nothing may stay behind.
//
// Run in a process of its own (ctest group "lifecycle"): the shared devices of the other tests
// would keep the driver loaded.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/tests/world.h"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>

namespace pumice::cts {
namespace {

size_t threadCount() {
  size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) ++count;
  return count;
}

size_t residentKib() {
  std::ifstream statm("/proc/self/statm");
  size_t total = 0, resident = 0;
  statm >> total >> resident;
  return resident * size_t(sysconf(_SC_PAGESIZE)) / 1024;
}

size_t openFiles() {
  size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

bool driverIsMapped() {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);)
    if (line.find("libvulkan_pumice") != std::string::npos) return true;
  return false;
}

void liveOnce(const std::string& name) {
  VulkanInstance instance(false);
  VkPhysicalDevice physical = instance.find(name);
  ASSERT_TRUE(physical) << "no device " << name;
  Device device(physical);
  Canvas canvas(device, 64, 64);
  Pipeline pipeline = canvas.pipeline({});
  Picture picture = canvas.draw({1, 0, 0, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, pipeline,
                        {{{-0.9f, -0.9f, 0, 1}, {0, 1, 0, 1}},
                         {{0.9f, -0.9f, 0, 1}, {0, 1, 0, 1}},
                         {{0, 0.9f, 0, 1}, {0, 1, 0, 1}}});
  });
  ASSERT_EQ(picture.pixel(32, 24), (std::array<int, 4>{0, 255, 0, 255}));
}

TEST(Lifecycle, AThousandCyclesLeaveNothing) {
#ifdef PUMICE_SANITIZER_RUNTIME
  constexpr int kCycles = 100;
#else
  constexpr int kCycles = 1000;
#endif
  constexpr int kWarmUp = kCycles / 5;
  // Only the driver under test: what a peer leaves behind is not the question.
  setenv("VK_ICD_FILENAMES", pumiceManifest().c_str(), 1);
  std::string name = testedDeviceName();
  size_t threads = 0, resident = 0, files = 0;
  for (int cycle = 0; cycle < kCycles; ++cycle) {
    ASSERT_NO_FATAL_FAILURE(liveOnce(name)) << "cycle " << cycle;
    if (cycle == 0) threads = threadCount(), files = openFiles();
    ASSERT_EQ(threadCount(), threads) << "threads after cycle " << cycle;
    if (cycle == kWarmUp) resident = residentKib();
  }
  size_t last = residentKib();
  std::cout << kCycles << " cycles: " << threads << " threads, resident " << resident << " KiB after "
            << kWarmUp << ", " << last << " KiB at the end\n";
  EXPECT_EQ(threads, 1u) << "threads left after the first cycle";
  EXPECT_EQ(openFiles(), files);
#ifndef PUMICE_SANITIZER_RUNTIME  // there memory is kept on purpose, and libraries stay loaded
  EXPECT_LT(last, resident + 4096) << "resident memory grew";
  EXPECT_FALSE(driverIsMapped()) << "the driver is still loaded after the last vkDestroyInstance";
#endif
}

}  // namespace
}  // namespace pumice::cts
