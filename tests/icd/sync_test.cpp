// Fences, semaphores, events, queries and idling: states and timeouts, what waits for what, many threads at
// once.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <mutex>
#include <thread>

#include "icd/rhythm.h"
#include "tests/icd/driver.h"

namespace pumice::icd::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
constexpr uint64_t kForever = ~0ull, kMillisecond = 1'000'000;

struct Sync : testing::Test {
  TestDevice device;
  VkEvent event = VK_NULL_HANDLE;

  void SetUp() override {
    VkEventCreateInfo info{VK_STRUCTURE_TYPE_EVENT_CREATE_INFO, nullptr, 0};
    ASSERT_EQ(VK(vkCreateEvent)(device.handle, &info, nullptr, &event), VK_SUCCESS);
  }
  void TearDown() override {
    VK(vkDeviceWaitIdle)(device.handle);
    VK(vkDestroyEvent)(device.handle, event, nullptr);
  }
  VkResult status(VkFence f) { return VK(vkGetFenceStatus)(device.handle, f); }
  VkResult wait(VkFence f, uint64_t timeout) {
    return VK(vkWaitForFences)(device.handle, 1, &f, VK_TRUE, timeout);
  }
  void destroy(VkFence f) { VK(vkDestroyFence)(device.handle, f, nullptr); }
  void destroy(VkSemaphore s) { VK(vkDestroySemaphore)(device.handle, s, nullptr); }
  //! Submits and waits at once, for long enough to be known for it.
  void waitAtOnce(VkFence fence, VkCommandBuffer commands) {
    for (int i = 0; i < 20; i++) {
      ASSERT_EQ(device.submit(commands, fence), VK_SUCCESS);
      ASSERT_EQ(wait(fence, kForever), VK_SUCCESS);
      ASSERT_EQ(VK(vkResetFences)(device.handle, 1, &fence), VK_SUCCESS);
    }
  }
  //! Commands that the host's event lets pass.
  VkCommandBuffer gate() {
    VkCommandBuffer commands = device.begin();
    VK(vkCmdWaitEvents)
    (commands, 1, &event, VK_PIPELINE_STAGE_HOST_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, nullptr, 0,
     nullptr, 0, nullptr);
    device.end(commands);
    return commands;
  }
  void open() { ASSERT_EQ(VK(vkSetEvent)(device.handle, event), VK_SUCCESS); }
  VkSemaphore timeline(uint64_t initial) {
    VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO, nullptr,
                                   VK_SEMAPHORE_TYPE_TIMELINE, initial};
    VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type, 0};
    VkSemaphore s = VK_NULL_HANDLE;
    EXPECT_EQ(VK(vkCreateSemaphore)(device.handle, &info, nullptr, &s), VK_SUCCESS);
    return s;
  }
  uint64_t value(VkSemaphore s) {
    uint64_t v = 0;
    EXPECT_EQ(VK(vkGetSemaphoreCounterValueKHR)(device.handle, s, &v), VK_SUCCESS);
    return v;
  }
};

TEST_F(Sync, FencesWaitAsLongAsTheyAreTold) {
  VkFence fence = device.fence(), signaled = device.fence(VK_FENCE_CREATE_SIGNALED_BIT);
  EXPECT_EQ(status(fence), VK_NOT_READY);
  EXPECT_EQ(status(signaled), VK_SUCCESS);
  EXPECT_EQ(wait(fence, 0), VK_TIMEOUT);
  auto before = Clock::now();
  EXPECT_EQ(wait(fence, 20 * kMillisecond), VK_TIMEOUT);
  EXPECT_GE(Clock::now() - before, 20ms);
  EXPECT_EQ(wait(signaled, 0), VK_SUCCESS);
  EXPECT_EQ(wait(signaled, kForever), VK_SUCCESS);
  VkFence both[2] = {fence, signaled};
  EXPECT_EQ(VK(vkWaitForFences)(device.handle, 2, both, VK_FALSE, kForever), VK_SUCCESS) << "any of the two";
  EXPECT_EQ(VK(vkWaitForFences)(device.handle, 2, both, VK_TRUE, kMillisecond), VK_TIMEOUT) << "both of them";
  EXPECT_EQ(VK(vkResetFences)(device.handle, 2, both), VK_SUCCESS);
  EXPECT_EQ(status(signaled), VK_NOT_READY);
  EXPECT_EQ(VK(vkWaitForFences)(device.handle, 2, both, VK_FALSE, 0), VK_TIMEOUT);

  // Nothing submitted, nothing before it: the fence alone.
  EXPECT_EQ(VK(vkQueueSubmit)(device.queue, 0, nullptr, fence), VK_SUCCESS);
  EXPECT_EQ(wait(fence, kForever), VK_SUCCESS);
  // Timeouts that end beyond the clock's range.
  ASSERT_EQ(VK(vkResetFences)(device.handle, 1, &fence), VK_SUCCESS);
  for (uint64_t timeout : {kForever, kForever - 1, kForever / 2, kForever / 2 + 1, kForever / 4}) {
    ASSERT_EQ(VK(vkResetFences)(device.handle, 1, &fence), VK_SUCCESS);
    std::thread later([&] {
      std::this_thread::sleep_for(5ms);
      VK(vkQueueSubmit)(device.queue, 0, nullptr, fence);
    });
    EXPECT_EQ(wait(fence, timeout), VK_SUCCESS) << timeout;
    later.join();
  }
  destroy(fence);
  destroy(signaled);
}

TEST_F(Sync, NothingOvertakesWorkThatWaits) {
  VkCommandBuffer commands = gate();
  VkFence first = device.fence(), empty = device.fence(), emptyInfo = device.fence();
  ASSERT_EQ(device.submit(commands, first), VK_SUCCESS);
  ASSERT_EQ(VK(vkQueueSubmit)(device.queue, 0, nullptr, empty), VK_SUCCESS);
  ASSERT_EQ(device.submit(VK_NULL_HANDLE, emptyInfo), VK_SUCCESS);
  EXPECT_EQ(wait(first, 10 * kMillisecond), VK_TIMEOUT);
  EXPECT_EQ(status(empty), VK_NOT_READY) << "a submission without work must wait for those before it";
  EXPECT_EQ(status(emptyInfo), VK_NOT_READY);
  std::atomic<bool> idle{false};
  std::thread waiter([&] {
    VK(vkDeviceWaitIdle)(device.handle);
    idle = true;
  });
  std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(idle) << "idle with work pending";
  open();
  waiter.join();
  for (VkFence f : {first, empty, emptyInfo}) {
    EXPECT_EQ(status(f), VK_SUCCESS) << "idle, but a fence is not signaled";
    destroy(f);
  }
}

TEST_F(Sync, BinarySemaphoresOrderSubmissions) {
  TestDevice::Buffer buffer = device.buffer(64);
  constexpr int kSteps = 50;
  std::vector<VkSemaphore> semaphores;
  VkFence last = device.fence();
  VkCommandBuffer blocked = gate();
  for (int i = 0; i < kSteps; i++) semaphores.push_back(device.semaphore());
  ASSERT_EQ(device.submit(blocked, VK_NULL_HANDLE, VK_NULL_HANDLE, semaphores[0]), VK_SUCCESS);
  for (int i = 1; i < kSteps; i++) {
    VkCommandBuffer commands = device.begin();
    VK(vkCmdFillBuffer)(commands, buffer.handle, 0, 4, uint32_t(i));
    device.end(commands);
    ASSERT_EQ(device.submit(commands, i == kSteps - 1 ? last : VK_NULL_HANDLE, semaphores[i - 1],
                            i == kSteps - 1 ? VK_NULL_HANDLE : semaphores[i]),
              VK_SUCCESS);
  }
  EXPECT_EQ(wait(last, 10 * kMillisecond), VK_TIMEOUT);
  EXPECT_EQ(buffer.words[0], 0u);
  open();
  EXPECT_EQ(wait(last, kForever), VK_SUCCESS);
  EXPECT_EQ(buffer.words[0], uint32_t(kSteps - 1));
  // Waiting has unsignaled them: each can be signaled and waited for again.
  for (int round = 0; round < 2; round++) {
    ASSERT_EQ(device.submit(VK_NULL_HANDLE, VK_NULL_HANDLE, VK_NULL_HANDLE, semaphores[0]), VK_SUCCESS);
    ASSERT_EQ(VK(vkResetFences)(device.handle, 1, &last), VK_SUCCESS);
    ASSERT_EQ(device.submit(VK_NULL_HANDLE, last, semaphores[0]), VK_SUCCESS);
    EXPECT_EQ(wait(last, kForever), VK_SUCCESS);
  }
  for (VkSemaphore s : semaphores) destroy(s);
  destroy(last);
  device.release(buffer);
}

TEST_F(Sync, TimelinesWaitBeforeTheSignal) {
  TestDevice::Buffer buffer = device.buffer(64);
  VkSemaphore host = timeline(2), queue = timeline(0);
  EXPECT_EQ(value(host), 2u);
  VkFence fence = device.fence();
  VkCommandBuffer commands = device.begin();
  VK(vkCmdFillBuffer)(commands, buffer.handle, 0, VK_WHOLE_SIZE, 9);
  device.end(commands);
  uint64_t waitValue = 5, signalValue = 7;
  VkTimelineSemaphoreSubmitInfo values{
      VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO, nullptr, 1, &waitValue, 1, &signalValue};
  VkPipelineStageFlags stage = VK_PIPELINE_STAGE_TRANSFER_BIT;
  VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO, &values, 1, &host, &stage, 1, &commands, 1, &queue};
  ASSERT_EQ(VK(vkQueueSubmit)(device.queue, 1, &info, fence), VK_SUCCESS);
  EXPECT_EQ(wait(fence, 10 * kMillisecond), VK_TIMEOUT);
  auto waitFor = [&](std::vector<VkSemaphore> s, std::vector<uint64_t> v, bool any, uint64_t timeout) {
    VkSemaphoreWaitInfo w{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO,
                          nullptr,
                          any ? VkSemaphoreWaitFlags(VK_SEMAPHORE_WAIT_ANY_BIT) : 0,
                          uint32_t(s.size()),
                          s.data(),
                          v.data()};
    return VK(vkWaitSemaphoresKHR)(device.handle, &w, timeout);
  };
  auto signal = [&](uint64_t v) {
    VkSemaphoreSignalInfo s{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO, nullptr, host, v};
    EXPECT_EQ(VK(vkSignalSemaphoreKHR)(device.handle, &s), VK_SUCCESS);
  };
  EXPECT_EQ(waitFor({host}, {2}, false, 0), VK_SUCCESS);
  EXPECT_EQ(waitFor({queue}, {7}, false, 0), VK_TIMEOUT);
  EXPECT_EQ(waitFor({queue, host}, {7, 2}, false, kMillisecond), VK_TIMEOUT);
  EXPECT_EQ(waitFor({queue, host}, {7, 2}, true, kForever), VK_SUCCESS);
  signal(4);
  EXPECT_EQ(value(host), 4u);
  EXPECT_EQ(wait(fence, 10 * kMillisecond), VK_TIMEOUT) << "4 is less than 5";
  EXPECT_EQ(buffer.words[0], 0u);
  std::thread later([&] {
    std::this_thread::sleep_for(5ms);
    signal(6);
  });
  EXPECT_EQ(waitFor({queue}, {7}, false, kForever), VK_SUCCESS);
  later.join();
  EXPECT_EQ(value(queue), 7u);
  EXPECT_EQ(value(host), 6u) << "a timeline is not reset by a wait";
  EXPECT_EQ(buffer.words[15], 9u);
  EXPECT_EQ(wait(fence, kForever), VK_SUCCESS);
  destroy(host);
  destroy(queue);
  destroy(fence);
  device.release(buffer);
}

TEST_F(Sync, EventsOfHostAndQueue) {
  auto state = [&] { return VK(vkGetEventStatus)(device.handle, event); };
  EXPECT_EQ(state(), VK_EVENT_RESET);
  open();
  EXPECT_EQ(state(), VK_EVENT_SET);
  EXPECT_EQ(VK(vkResetEvent)(device.handle, event), VK_SUCCESS);
  EXPECT_EQ(state(), VK_EVENT_RESET);
  VkCommandBuffer commands = device.begin();
  VK(vkCmdSetEvent)(commands, event, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT);
  VK(vkCmdWaitEvents)
  (commands, 1, &event, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, nullptr, 0,
   nullptr, 0, nullptr);
  device.run(commands);
  EXPECT_EQ(state(), VK_EVENT_SET);
  commands = device.begin();
  VK(vkCmdResetEvent)(commands, event, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT);
  device.run(commands);
  EXPECT_EQ(state(), VK_EVENT_RESET);
}

TEST_F(Sync, QueriesSayWhetherTheyAreAvailable) {
  VkQueryPoolCreateInfo info{
      VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_TIMESTAMP, 4, 0};
  VkQueryPool pool = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateQueryPool)(device.handle, &info, nullptr, &pool), VK_SUCCESS);
  TestDevice::Buffer copied = device.buffer(128);
  VkCommandBuffer commands = device.begin();
  VK(vkCmdResetQueryPool)(commands, pool, 0, 4);
  VK(vkCmdWaitEvents)
  (commands, 1, &event, VK_PIPELINE_STAGE_HOST_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, nullptr, 0,
   nullptr, 0, nullptr);
  VK(vkCmdWriteTimestamp)(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool, 0);
  VK(vkCmdWriteTimestamp)(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool, 2);
  VK(vkCmdCopyQueryPoolResults)
  (commands, pool, 0, 3, copied.handle, 0, 32,
   VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
  device.end(commands);
  ASSERT_EQ(device.submit(commands), VK_SUCCESS);
  struct Result {
    uint64_t value, available;
  };
  constexpr VkQueryResultFlags kBoth = VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT;
  auto get = [&](Result(&r)[4], VkQueryResultFlags flags, uint32_t first = 0, uint32_t count = 4) {
    for (Result& x : r) x = {77, 77};
    return VK(vkGetQueryPoolResults)(device.handle, pool, first, count, sizeof(Result) * count, r,
                                     sizeof(Result), flags);
  };
  Result r[4];
  EXPECT_EQ(get(r, kBoth), VK_NOT_READY);
  EXPECT_EQ(r[0].value, 77u) << "a value that is not there must not be written";
  EXPECT_EQ(r[0].available, 0u);
  std::thread later([&] {
    std::this_thread::sleep_for(5ms);
    open();
  });
  EXPECT_EQ(get(r, kBoth | VK_QUERY_RESULT_WAIT_BIT, 2, 1), VK_SUCCESS);
  EXPECT_EQ(r[0].available, 1u);
  later.join();
  VK(vkQueueWaitIdle)(device.queue);
  EXPECT_EQ(get(r, kBoth), VK_NOT_READY) << "1 and 3 were never written";
  EXPECT_EQ(r[0].available, 1u);
  EXPECT_EQ(r[1].available, 0u);
  EXPECT_EQ(r[1].value, 77u);
  EXPECT_LE(r[0].value, r[2].value);
  uint64_t words[12];
  std::memcpy(words, copied.words, sizeof words);
  EXPECT_EQ(words[0], r[0].value);
  EXPECT_EQ(words[1], 1u);
  EXPECT_EQ(words[5], 0u);
  EXPECT_EQ(words[8], r[2].value);
  uint32_t narrow[2] = {77, 77};
  EXPECT_EQ(VK(vkGetQueryPoolResults)(device.handle, pool, 0, 1, sizeof narrow, narrow, 8,
                                      VK_QUERY_RESULT_WITH_AVAILABILITY_BIT),
            VK_SUCCESS);
  EXPECT_EQ(narrow[1], 1u);
  VK(vkResetQueryPoolEXT)(device.handle, pool, 0, 1);
  EXPECT_EQ(get(r, kBoth, 0, 1), VK_NOT_READY);
  EXPECT_EQ(r[0].available, 0u);
  VK(vkDestroyQueryPool)(device.handle, pool, nullptr);
  // What is known so far is a result of a query that is not finished.
  info.queryType = VK_QUERY_TYPE_OCCLUSION;
  ASSERT_EQ(VK(vkCreateQueryPool)(device.handle, &info, nullptr, &pool), VK_SUCCESS);
  VK(vkResetQueryPoolEXT)(device.handle, pool, 0, 4);
  EXPECT_EQ(get(r, kBoth | VK_QUERY_RESULT_PARTIAL_BIT, 0, 2), VK_SUCCESS);
  EXPECT_EQ(r[1].value, 0u);
  EXPECT_EQ(r[1].available, 0u);
  VK(vkDestroyQueryPool)(device.handle, pool, nullptr);
  device.release(copied);
}

// Each thread has its own pool and buffers; the queue is guarded by the application, as it must be.
TEST_F(Sync, ManyThreadsRecordSubmitAndWait) {
  constexpr int kThreads = 6, kRounds = 60;
  std::mutex queueMutex;
  std::atomic<int> wrong{0};
  std::vector<std::thread> threads;
  auto fill = VK(vkCmdFillBuffer);
  auto copy = VK(vkCmdCopyBuffer);
  for (int t = 0; t < kThreads; t++)
    threads.emplace_back([&, t] {
      VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr,
                                       VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, 0};
      VkCommandPool pool = VK_NULL_HANDLE;
      if (VK(vkCreateCommandPool)(device.handle, &poolInfo, nullptr, &pool) != VK_SUCCESS) wrong++;
      TestDevice::Buffer a = device.buffer(4096), b = device.buffer(4096);
      VkFence fence = device.fence();
      VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool,
                                           VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
      VkCommandBuffer commands = VK_NULL_HANDLE;
      if (VK(vkAllocateCommandBuffers)(device.handle, &allocate, &commands) != VK_SUCCESS) wrong++;
      for (int i = 0; i < kRounds; i++) {
        uint32_t value = uint32_t(t * 1000 + i);
        VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
        VK(vkBeginCommandBuffer)(commands, &begin);
        fill(commands, a.handle, 0, VK_WHOLE_SIZE, value);
        VkBufferCopy region{0, 0, 4096};
        copy(commands, a.handle, b.handle, 1, &region);
        VK(vkEndCommandBuffer)(commands);
        {
          std::lock_guard lock(queueMutex);
          if (device.submit(commands, fence) != VK_SUCCESS) wrong++;
        }
        if (VK(vkWaitForFences)(device.handle, 1, &fence, VK_TRUE, kForever) != VK_SUCCESS) wrong++;
        if (b.words[0] != value || b.words[1023] != value) wrong++;
        VK(vkResetFences)(device.handle, 1, &fence);
      }
      VK(vkDestroyFence)(device.handle, fence, nullptr);
      VK(vkDestroyCommandPool)(device.handle, pool, nullptr);
      device.release(a);
      device.release(b);
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(wrong, 0);
}

TEST(Rhythm, IsOfWhoWaitsAtOnceForAllThatHeSubmits) {
  Rhythm rhythm;
  uint64_t now = 1'000'000'000;
  auto turn = [&](uint64_t pause, bool other = false, int submissions = 1) {
    uint64_t number = 0;
    for (int i = 0; i < submissions; i++) {
      number = rhythm.submits(now);
      rhythm.submitted(now += 5000);
      now += 1000;
    }
    rhythm.waits(now += pause, other ? 0 : number);
    rhythm.waits(now += 100, 0);   // there is nothing left to wait for: it says nothing
    now += 10'000'000;             // what he does between waiting and submitting does not matter
  };
  auto settle = [&] {
    for (int i = 0; i < 3; i++) turn(1000);
    return rhythm.waitsAtOnce();
  };
  turn(1000), turn(1000);
  EXPECT_FALSE(rhythm.waitsAtOnce()) << "twice may be chance";
  EXPECT_TRUE(settle());
  turn(1000, false, 5);
  EXPECT_TRUE(rhythm.waitsAtOnce()) << "several submissions one after the other, and then a wait for the last";
  turn(200'000);
  EXPECT_FALSE(rhythm.waitsAtOnce()) << "something else was done first";
  EXPECT_TRUE(settle());
  turn(1000, true);
  EXPECT_FALSE(rhythm.waitsAtOnce()) << "a wait for an earlier submission";
  EXPECT_TRUE(settle());
  rhythm.submitted((rhythm.submits(now), now));
  rhythm.submits(now += 200'000);
  EXPECT_FALSE(rhythm.waitsAtOnce()) << "something else was done between two submissions";
}

// Uploads that are waited for between frames that are not.
TEST(Rhythm, LearnsFromWhatItWasWrongAbout) {
  Rhythm rhythm;
  uint64_t now = 1'000'000'000;
  int wrong = 0;
  auto submit = [&](uint64_t duration) {
    const bool itself = rhythm.waitsAtOnce();
    const uint64_t number = rhythm.submits(now);
    rhythm.submitted(now += itself ? duration : 5000, itself);
    return std::pair(number, itself);
  };
  for (int frame = 0; frame < 1000; frame++) {
    for (int i = 0; i < 4; i++) rhythm.waits(now += 1000, submit(20'000).first);
    const auto [number, itself] = submit(2'000'000);
    wrong += itself;
    rhythm.waits(now += 10'000'000, number);
  }
  EXPECT_LE(wrong, 1);
  for (int i = 0; i < 13; i++) rhythm.waits(now += 1000, submit(20'000).first);
  EXPECT_TRUE(rhythm.waitsAtOnce()) << "who waits at once for long is believed again";
  for (int i = 0; i < 100; i++) rhythm.waits(now += 1000, submit(20'000).first);
  rhythm.waits(now += 1000, submit(5'000'000).first);
  EXPECT_FALSE(rhythm.waitsAtOnce()) << "too much work for one thread of the application";
}

// Otherwise a thread has to wake up, which takes longer than a small frame.
TEST_F(Sync, WhoWaitsAtOnceRunsItsSubmissionsItself) {
  constexpr VkDeviceSize kBytes = 32 << 20;
  TestDevice::Buffer buffer = device.buffer(kBytes);
  VkFence fence = device.fence();
  VkCommandBuffer commands = device.begin();
  VK(vkCmdFillBuffer)(commands, buffer.handle, 0, kBytes, 3);
  device.end(commands);
  // On a machine that does much else a turn may take too long to count.
  bool itself = false;
  for (int i = 0; i < 100 && !itself; i++) {
    waitAtOnce(fence, commands);
    ASSERT_EQ(device.submit(commands, fence), VK_SUCCESS);
    itself = status(fence) == VK_SUCCESS;   // a thread would have several milliseconds to go
    ASSERT_EQ(wait(fence, kForever), VK_SUCCESS);
    ASSERT_EQ(VK(vkResetFences)(device.handle, 1, &fence), VK_SUCCESS);
  }
  EXPECT_TRUE(itself);
  destroy(fence);
  device.release(buffer);
}

TEST_F(Sync, WhoWaitsAtOnceMayStillSubmitWhatOnlyHeLetsPass) {
  TestDevice::Buffer buffer = device.buffer(64);
  VkFence fence = device.fence();
  VkCommandBuffer commands = device.begin(), secondary = device.begin(VK_COMMAND_BUFFER_LEVEL_SECONDARY);
  VK(vkCmdFillBuffer)(commands, buffer.handle, 0, 64, 3);
  device.end(commands);
  auto done = [&] {
    EXPECT_EQ(wait(fence, kForever), VK_SUCCESS);
    EXPECT_EQ(VK(vkResetFences)(device.handle, 1, &fence), VK_SUCCESS);
  };
  // An event, in a command buffer and in one that it executes
  waitAtOnce(fence, commands);
  ASSERT_EQ(device.submit(gate(), fence), VK_SUCCESS);
  open();
  done();
  ASSERT_EQ(VK(vkResetEvent)(device.handle, event), VK_SUCCESS);
  VK(vkCmdWaitEvents)
  (secondary, 1, &event, VK_PIPELINE_STAGE_HOST_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, nullptr, 0, nullptr, 0, nullptr);
  device.end(secondary);
  VkCommandBuffer outer = device.begin();
  VK(vkCmdExecuteCommands)(outer, 1, &secondary);
  device.end(outer);
  waitAtOnce(fence, commands);
  ASSERT_EQ(device.submit(outer, fence), VK_SUCCESS);
  open();
  done();
  // A timeline, and what comes after it
  VkSemaphore host = timeline(0);
  const uint64_t one = 1;
  VkTimelineSemaphoreSubmitInfo values{VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO, nullptr, 1, &one, 0, nullptr};
  const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_TRANSFER_BIT;
  VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO, &values, 1, &host, &stage, 0, nullptr, 0, nullptr};
  waitAtOnce(fence, commands);
  ASSERT_EQ(VK(vkQueueSubmit)(device.queue, 1, &info, VK_NULL_HANDLE), VK_SUCCESS);
  ASSERT_EQ(device.submit(commands, fence), VK_SUCCESS);
  EXPECT_EQ(status(fence), VK_NOT_READY) << "it has overtaken";
  VkSemaphoreSignalInfo signal{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO, nullptr, host, 1};
  ASSERT_EQ(VK(vkSignalSemaphoreKHR)(device.handle, &signal), VK_SUCCESS);
  done();
  destroy(host);
  destroy(fence);
  device.release(buffer);
}

}  // namespace
}  // namespace pumice::icd::test
