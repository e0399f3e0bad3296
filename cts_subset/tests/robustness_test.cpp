// What bad input, forks and threads may not do to a host process.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/harness/shader.h"
#include "cts_subset/tests/world.h"

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <thread>

namespace pumice::cts {
namespace {

std::vector<Vertex> greenTriangle() {
  return {{{-0.9f, -0.9f, 0, 1}, {0, 1, 0, 1}},
          {{0.9f, -0.9f, 0, 1}, {0, 1, 0, 1}},
          {{0, 0.9f, 0, 1}, {0, 1, 0, 1}}};
}

// Empty when the middle of the picture is green.
std::string drawOnce(Device& device) {
  Canvas canvas(device, 64, 64);
  Pipeline pipeline = canvas.pipeline({});
  Picture picture = canvas.draw({1, 0, 0, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, pipeline, greenTriangle());
  });
  bool right = picture.pixel(32, 24) == std::array<int, 4>{0, 255, 0, 255} &&
               picture.pixel(1, 62) == std::array<int, 4>{255, 0, 0, 255};
  return right ? "" : "the triangle is not where it should be";
}

// Other drivers need not survive invalid modules, and the validation layer stops them.
bool invalidModulesMakeSense() { return testedDeviceName() == "Pumice" && !validationRequested(); }

// Makes a pipeline from possibly invalid words. Any VkResult will do, as long as it returns.
VkResult pipelineFrom(Canvas& canvas, const std::vector<uint32_t>& words) {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = words.size() * 4;
  info.pCode = words.data();
  VkShaderModule module = VK_NULL_HANDLE;
  VkDevice device = canvas.device.handle;
  VkResult result = vkCreateShaderModule(device, &info, nullptr, &module);
  if (result != VK_SUCCESS) return result;
  Pipeline made;
  PipelineSpec spec;
  result = canvas.tryPipeline(spec, canvas.shader(VK_SHADER_STAGE_VERTEX_BIT, kPassVertex), module, made);
  vkDestroyShaderModule(device, module, nullptr);
  return result;
}

std::vector<uint32_t> goodWords() {
  return compileGlsl(VK_SHADER_STAGE_FRAGMENT_BIT, R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() {
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) { if (passed[i] > 0.5) sum[i] += passed.x * 0.5; else sum += 0.1; }
    switch (int(passed.y * 4.0)) { case 0: sum *= 0.5; break; case 1: sum.x = 1.0; default: break; }
    colour = sum;
}
)");
}

TEST(Robustness, TruncatedModuleFailsPipelineCreation) {
  PUMICE_NEED_TESTED();
  if (!invalidModulesMakeSense()) GTEST_SKIP() << "only for Pumice without validation";
  Canvas canvas(*world().tested, 16, 16);
  std::vector<uint32_t> words = goodWords();
  ASSERT_EQ(pipelineFrom(canvas, words), VK_SUCCESS);
  for (size_t length :
       {size_t(1), size_t(4), size_t(5), size_t(6), words.size() / 4, words.size() / 2, words.size() - 1}) {
    std::vector<uint32_t> shorter(words.begin(), words.begin() + long(length));
    EXPECT_NE(pipelineFrom(canvas, shorter), VK_SUCCESS) << length << " words";
  }
  std::vector<uint32_t> wrongMagic = words;
  wrongMagic[0] = 0x12345678;
  EXPECT_NE(pipelineFrom(canvas, wrongMagic), VK_SUCCESS);
  EXPECT_EQ(drawOnce(*world().tested), "") << "after failed pipelines";
}

TEST(Robustness, RecursionIsRejected) {
  PUMICE_NEED_TESTED();
  if (!invalidModulesMakeSense()) GTEST_SKIP() << "only for Pumice without validation";
  Canvas canvas(*world().tested, 16, 16);
  // With one function that calls itself, and with two that call each other.
  for (const char* callee : {"%f", "%g"}) {
    std::vector<uint32_t> words = assemble(std::string(R"(
OpCapability Shader
OpMemoryModel Logical GLSL450
OpEntryPoint Fragment %main "main"
OpExecutionMode %main OriginUpperLeft
%void = OpTypeVoid
%fn = OpTypeFunction %void
%main = OpFunction %void None %fn
%m = OpLabel
%mc = OpFunctionCall %void %f
OpReturn
OpFunctionEnd
%f = OpFunction %void None %fn
%fl = OpLabel
%fc = OpFunctionCall %void )") + callee + R"(
OpReturn
OpFunctionEnd
%g = OpFunction %void None %fn
%gl = OpLabel
%gc = OpFunctionCall %void %f
OpReturn
OpFunctionEnd
)");
    EXPECT_NE(pipelineFrom(canvas, words), VK_SUCCESS) << callee;
  }
  EXPECT_EQ(drawOnce(*world().tested), "") << "after failed pipelines";
}

// In a process of its own: a crash must not take the other tests along.
TEST(RobustnessDeathTest, DamagedModulesNeverCrash) {
  if (!invalidModulesMakeSense()) GTEST_SKIP() << "only for Pumice without validation";
  auto tryAll = [] {
    VulkanInstance instance(false);
    VkPhysicalDevice physical = instance.find(testedDeviceName());
    if (!physical) std::_Exit(2);
    {
      Device device(physical);
      Canvas canvas(device, 16, 16);
      std::vector<uint32_t> words = goodWords();
      uint32_t state = 1;
      auto random = [&] { return (state = state * 1664525u + 1013904223u) >> 8; };
      for (int i = 0; i < 600; ++i) {
        std::vector<uint32_t> damaged = words;
        for (uint32_t n = 0; n <= random() % 2; ++n) {
          uint32_t& word = damaged[5 + random() % (damaged.size() - 5)];
          switch (random() % 4) {
            case 0:
              word ^= 1u << random() % 32;
              break;
            case 1:
              word = random() % 64;
              break;
            case 2:
              word += 1;
              break;
            default:
              word = 0xffffffffu;
              break;
          }
        }
        pipelineFrom(canvas, damaged);
      }
    }
    std::_Exit(0);
  };
  EXPECT_EXIT(tryAll(), testing::ExitedWithCode(0), "");
}

TEST(Robustness, DrawsAgainAfterEachOfTwentyDevices) {
  PUMICE_NEED_TESTED();
  for (int i = 0; i < 20; ++i) {
    VulkanInstance instance(false);
    Device device(instance.find(testedDeviceName()));
    ASSERT_EQ(drawOnce(device), "") << "cycle " << i;
  }
}

// Waits for a child; kills it when it hangs.
std::string awaitChild(pid_t child) {
  for (int i = 0; i < 1000; ++i) {
    int status = 0;
    if (waitpid(child, &status, WNOHANG) == child) {
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
      return "the child ended with wait status " + std::to_string(status);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  return "the child hung";
}

// In a process that has loaded no other driver: lavapipe's exit handler waits, in a forked child, for threads
// that exist only in the parent.
std::string forkTwice() {
  setenv("VK_ICD_FILENAMES", pumiceManifest().c_str(), 1);
  VulkanInstance instance(false);
  VkPhysicalDevice physical = instance.find(testedDeviceName());
  if (!physical) return "no device";
  Device device(physical);
  if (std::string wrong = drawOnce(device); !wrong.empty()) return wrong;
  std::fflush(nullptr);
  pid_t quick = fork();
  if (quick == 0) {
    std::vector<std::string> work;
    for (int i = 0; i < 1000; ++i) work.push_back(std::to_string(i) + " allocations in the child");
    _exit(work.size() == 1000 ? 0 : 1);
  }
  if (std::string wrong = awaitChild(quick); !wrong.empty()) return "child with _exit: " + wrong;
  if (std::string wrong = drawOnce(device); !wrong.empty()) return "after a fork: " + wrong;
  // A child that ends in the ordinary way, so that destructors of the libraries run in it.
  pid_t orderly = fork();
  if (orderly == 0) std::exit(0);
  if (std::string wrong = awaitChild(orderly); !wrong.empty()) return "child with exit: " + wrong;
  return drawOnce(device);
}

TEST(RobustnessDeathTest, ForkWithoutVulkanInTheChildHarmsNobody) {
  if (testedDeviceName() != "Pumice") GTEST_SKIP() << "only promised for Pumice";
  auto run = [] {
    std::string wrong = forkTwice();
    std::fprintf(stderr, "%s\n", wrong.empty() ? "all is well" : wrong.c_str());
    std::_Exit(wrong.empty() ? 0 : 1);
  };
  EXPECT_EXIT(run(), testing::ExitedWithCode(0), "all is well");
}

TEST(Robustness, ThreadsRecordAndSubmitOnOneDevice) {
  PUMICE_NEED_TESTED();
  constexpr int kThreads = 4, kDraws = 25;
  std::vector<std::string> problems(kThreads);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&, t] {
      try {
        for (int i = 0; i < kDraws && problems[t].empty(); ++i) problems[t] = drawOnce(*world().tested);
      } catch (const std::exception& error) {
        problems[t] = error.what();
      }
    });
  for (std::thread& thread : threads) thread.join();
  for (const std::string& problem : problems) EXPECT_EQ(problem, "");
}

TEST(Robustness, TwoInstancesAtOnce) {
  PUMICE_NEED_TESTED();
  VulkanInstance first(false), second(false);
  Device a(first.find(testedDeviceName())), b(second.find(testedDeviceName()));
  EXPECT_EQ(drawOnce(a), "");
  EXPECT_EQ(drawOnce(b), "");
  EXPECT_EQ(drawOnce(*world().tested), "");
}

TEST(Robustness, HugeAllocationsFailWithAResult) {
  PUMICE_NEED_TESTED();
  if (validationRequested()) GTEST_SKIP() << "asks for more than the layer allows";
  Device& device = *world().tested;
  VkMemoryAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  for (VkDeviceSize size : {VkDeviceSize(1) << 62, VkDeviceSize(1) << 47, ~VkDeviceSize(0) - 4096}) {
    info.allocationSize = size;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkResult result = vkAllocateMemory(device.handle, &info, nullptr, &memory);
    EXPECT_TRUE(result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY)
        << resultName(result) << " for " << size << " bytes";
    if (result == VK_SUCCESS) vkFreeMemory(device.handle, memory, nullptr);
  }
  EXPECT_EQ(drawOnce(device), "");
}

}  // namespace
}  // namespace pumice::cts
