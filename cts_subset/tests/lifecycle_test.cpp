// A thousand lives: instance, device, one triangle, and gone again. Nothing may stay behind.
//
// Run in a process of its own (ctest group "lifecycle"): the shared devices of the other tests
// would keep the driver loaded.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/tests/world.h"

#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <thread>

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

// What a program's thread may still be doing while main() has returned: making pipelines, copying between formats.
std::atomic<bool> failedAtExit{false};

[[noreturn]] void exitAtWork() {
  // Registered before the driver is loaded, so called after everything that the driver may have registered.
  std::atexit([] {
    usleep(300'000);
    _exit(failedAtExit ? 3 : 0);
  });
  setenv("VK_ICD_FILENAMES", pumiceManifest().c_str(), 1);
  auto* instance = new VulkanInstance(false);
  auto* device = new Device(instance->find(testedDeviceName()));
  auto* work = new Workspace(*device);
  VkShaderModule module = work->shader(VK_SHADER_STAGE_COMPUTE_BIT, "#version 450\nlayout(local_size_x = 4) in;\nlayout(set = 0, binding = 0) buffer B { vec4 v[]; };\n"
                                                                    "void main() { v[gl_GlobalInvocationID.x] = sin(v[gl_LocalInvocationIndex] * 2.0); }\n");
  Buffer buffer = work->buffer(1024, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  Binding binding{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER};
  binding.buffer = {buffer.handle, 0, VK_WHOLE_SIZE};
  DescriptorSet set = work->descriptors({binding});
  VkPipelineLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &set.layout, 0, nullptr};
  VkPipelineLayout layout = VK_NULL_HANDLE;
  check(vkCreatePipelineLayout(device->handle, &layoutInfo, nullptr, &layout), "vkCreatePipelineLayout");
  ImageSpec spec;
  spec.extent = {8, 8, 1};
  Image from = work->image(spec);
  spec.format = VK_FORMAT_R16G16B16A16_SFLOAT;
  Image to = work->image(spec);
  std::atomic<int> rounds{0};
  std::thread worker([&] {
    for (;; ++rounds) {
      VkComputePipelineCreateInfo info{};
      info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
      info.stage = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, nullptr, 0, VK_SHADER_STAGE_COMPUTE_BIT, module, "main", nullptr};
      info.layout = layout;
      VkPipeline made = VK_NULL_HANDLE;
      if (vkCreateComputePipelines(device->handle, VK_NULL_HANDLE, 1, &info, nullptr, &made) != VK_SUCCESS) failedAtExit = true;
      try {
        device->run([&](VkCommandBuffer commands) {
          transition(commands, from, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
          transition(commands, to, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
          VkImageSubresourceLayers layers{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
          VkImageBlit blit{layers, {{0, 0, 0}, {8, 8, 1}}, layers, {{0, 0, 0}, {8, 8, 1}}};
          vkCmdBlitImage(commands, from.handle, VK_IMAGE_LAYOUT_GENERAL, to.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_NEAREST);
          vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, made);
          vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set.handle, 0, nullptr);
          vkCmdDispatch(commands, 1, 1, 1);
        });
      } catch (const std::exception&) {
        failedAtExit = true;
      }
      vkDestroyPipeline(device->handle, made, nullptr);
    }
  });
  while (rounds < 3) usleep(1000);
  std::exit(0);  // `worker` and all it uses stay: this frame is never left
}

TEST(Lifecycle, ThreadsMayWorkWhileTheProcessExits) {
  EXPECT_EXIT(exitAtWork(), testing::ExitedWithCode(0), "");
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
  std::thread([] {}).join();  // with the first thread ThreadSanitizer starts one of its own, and keeps it
  usleep(50'000);  // a thread that was joined stands in the list for a moment
  const size_t threads = threadCount();
  size_t resident = 0, files = 0;
  for (int cycle = 0; cycle < kCycles; ++cycle) {
    ASSERT_NO_FATAL_FAILURE(liveOnce(name)) << "cycle " << cycle;
    if (cycle == 0) files = openFiles();
    ASSERT_EQ(threadCount(), threads) << "threads after cycle " << cycle;
    if (cycle == kWarmUp) resident = residentKib();
  }
  size_t last = residentKib();
  std::cout << kCycles << " cycles: " << threads << " threads, resident " << resident << " KiB after "
            << kWarmUp << ", " << last << " KiB at the end\n";
  EXPECT_EQ(openFiles(), files);
#ifndef PUMICE_SANITIZER_RUNTIME  // there memory is kept on purpose, and libraries stay loaded
  EXPECT_LT(last, resident + 4096) << "resident memory grew";
  EXPECT_FALSE(driverIsMapped()) << "the driver is still loaded after the last vkDestroyInstance";
#endif
}

}  // namespace
}  // namespace pumice::cts
