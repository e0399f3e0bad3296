// pumice_scenes: renders one scene on one driver and prints what it took, as JSON.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <thread>

#include "bench/scenes/limits.h"
#include "bench/scenes/resources.h"
#include "bench/scenes/scene.h"

using namespace pumice;
using namespace pumice::bench;

namespace {

int usage(int status) {
  (status ? std::cerr : std::cout)
      << "usage: pumice_scenes --scene NAME [options]\n"
         "  --driver FILE     manifest of the driver (default: the one of the build tree)\n"
         "  --frames N        frames to measure (default: as many as fit in --seconds, at least 3)\n"
         "  --warm N          frames before those that are measured (default: 2)\n"
         "  --seconds S       see --frames (default: 1)\n"
         "  --size WxH        of the target (default: 1280x720)\n"
         "  --amount N        how much of what the scene counts (triangles, layers, draws)\n"
         "  --started NS      CLOCK_MONOTONIC at the start of the process (default: the start of main)\n"
         "  --png FILE        also write the picture\n"
         "  --hash            also print the hash of the picture\n"
         "  --list            the names of the scenes\n"
         "  --limits          instead: what memory and arithmetic of this machine reach\n"
         "  --threads N       with so many threads (default: all processors)\n";
  return status;
}

double seconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return double(time.tv_sec) + double(time.tv_nsec) * 1e-9;
}

double peakMebibytes() {
  std::ifstream status("/proc/self/status");  // unlike ru_maxrss without what the parent had
  std::string word;
  while (status >> word)
    if (word == "VmHWM:") {
      double kibibytes = 0;
      status >> kibibytes;
      return kibibytes / 1024;
    }
  return 0;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  size_t middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

uint64_t hashOf(const std::vector<uint8_t>& bytes) {
  uint64_t hash = 14695981039346656037ull;
  for (uint8_t byte : bytes) hash = (hash ^ byte) * 1099511628211ull;
  return hash;
}

const char* limitName(Limit limit) {
  static constexpr const char* kNames[] = {"none", "fill", "large_fill", "copy", "arithmetic"};
  return kNames[int(limit)];
}

int run(int argc, char** argv) {
  double started = seconds(CLOCK_MONOTONIC);
  std::string name, driver = cts::pumiceManifest(), png;
  Options options;
  long frames = 0, warm = 2;
  double budget = 1;
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  bool wantHash = false, wantLimits = false;
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    if (word == "--help" || word == "-h") return usage(0);
    if (word == "--list") {
      for (const SceneEntry& entry : allScenes())
        std::printf("%-24s %-12s %s%s\n", entry.name, limitName(entry.limit), entry.what, entry.once ? " (once)" : "");
      return 0;
    }
    if (word == "--limits") {
      wantLimits = true;
      continue;
    }
    if (word == "--hash") {
      wantHash = true;
      continue;
    }
    if (i + 1 >= argc) return usage(2);
    std::string value = argv[++i];
    if (word == "--scene") name = value;
    else if (word == "--driver") driver = value;
    else if (word == "--frames") frames = std::atol(value.c_str());
    else if (word == "--warm") warm = std::atol(value.c_str());
    else if (word == "--seconds") budget = std::atof(value.c_str());
    else if (word == "--threads") threads = unsigned(std::max(1, std::atoi(value.c_str())));
    else if (word == "--amount") options.amount = std::strtoull(value.c_str(), nullptr, 10);
    else if (word == "--started") started = double(std::strtoull(value.c_str(), nullptr, 10)) * 1e-9;
    else if (word == "--png") png = value;
    else if (word == "--size") {
      if (std::sscanf(value.c_str(), "%ux%u", &options.width, &options.height) != 2) return usage(2);
    } else return usage(2);
  }
  if (wantLimits) {
    std::cout << describe(measureLimits(threads, budget)) << "\n";
    return 0;
  }
  const SceneEntry* entry = nullptr;
  for (const SceneEntry& each : allScenes())
    if (each.name == name) entry = &each;
  if (!entry) {
    std::cerr << "pumice_scenes: there is no scene '" << name << "' (see --list)\n";
    return 2;
  }

  unsetenv("VK_DRIVER_FILES");  // it would win over VK_ICD_FILENAMES
  setenv("VK_ICD_FILENAMES", driver.c_str(), 1);
  std::vector<const char*> instanceExtensions, deviceExtensions;
  if (entry->window) {
    instanceExtensions = {VK_KHR_SURFACE_EXTENSION_NAME, "VK_KHR_xcb_surface"};
    deviceExtensions = {VK_KHR_SWAPCHAIN_EXTENSION_NAME};
  }
  cts::VulkanInstance instance(cts::validationRequested(), instanceExtensions);
  options.instance = instance.handle();
  VkPhysicalDevice physical = instance.find("");
  if (!physical) {
    std::cerr << "pumice_scenes: no device from " << driver << "\n";
    return 1;
  }
  VkPhysicalDeviceFeatures has{}, wanted{};
  vkGetPhysicalDeviceFeatures(physical, &has);
  wanted.samplerAnisotropy = has.samplerAnisotropy;
  Device device(physical, wanted, deviceExtensions);
  const double deviceMade = seconds(CLOCK_MONOTONIC);
  std::unique_ptr<Scene> scene = entry->make(device, options);
  const double ready = seconds(CLOCK_MONOTONIC);

  // The first frame compiles; the second touches what the first has made.
  std::vector<double> wall, processor;
  double firstFrame = 0, firstProcessor = 0, begun = 0;
  for (long i = 0;; ++i) {
    double wallBefore = seconds(CLOCK_MONOTONIC), processorBefore = seconds(CLOCK_PROCESS_CPUTIME_ID);
    scene->frame();
    double wallAfter = seconds(CLOCK_MONOTONIC), processorAfter = seconds(CLOCK_PROCESS_CPUTIME_ID);
    if (i == 0) firstFrame = wallAfter, firstProcessor = processorAfter;
    if (i >= warm || entry->once) {
      if (wall.empty()) begun = wallBefore;
      wall.push_back(wallAfter - wallBefore);
      processor.push_back(processorAfter - processorBefore);
    }
    if (entry->once) break;
    long measured = long(wall.size());
    // Ten thousand are enough for any median, and what is kept of more would count as the driver's memory.
    if (frames ? measured >= frames : measured >= 3 && (wallAfter - begun >= budget || measured >= 10'000)) break;
  }
  double peak = peakMebibytes();

  double processorSum = 0;
  for (double each : processor) processorSum += each;
  const Work work = scene->work();
  std::printf(
      "{\"scene\": \"%s\", \"device\": \"%s\", \"driver_version\": %u, \"frames\": %zu, "
      "\"wall_ms\": %.5g, \"wall_min_ms\": %.5g, \"cpu_ms\": %.5g, \"cpu_min_ms\": %.5g, \"cpu_mean_ms\": %.5g, "
      "\"device_ms\": %.5g, \"setup_ms\": %.5g, \"first_frame_ms\": %.5g, \"first_frame_cpu_ms\": %.5g, \"peak_mib\": %.5g, \"shaders_compiled\": %u, "
      "\"limit\": \"%s\", \"bytes\": %.6g, \"flops\": %.6g",
      entry->name, device.name().c_str(), device.properties.driverVersion, wall.size(), median(wall) * 1e3,
      *std::min_element(wall.begin(), wall.end()) * 1e3, median(processor) * 1e3,
      *std::min_element(processor.begin(), processor.end()) * 1e3, processorSum / double(processor.size()) * 1e3,
      (deviceMade - started) * 1e3, (ready - deviceMade) * 1e3, (firstFrame - started) * 1e3, firstProcessor * 1e3, peak, shadersCompiled(),
      limitName(entry->limit), work.bytes, work.flops);
  if (wantHash || !png.empty()) {
    Picture picture = scene->picture();
    if (wantHash) std::printf(", \"hash\": \"%016llx\"", static_cast<unsigned long long>(hashOf(picture.rgba)));
    if (!png.empty()) writePng(png, picture);
  }
  std::printf("}\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) try {
  return run(argc, argv);
} catch (const std::exception& error) {
  std::cerr << "pumice_scenes: " << error.what() << "\n";
  return 1;
}
