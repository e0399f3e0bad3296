// The queue: its thread runs submissions in order and sleeps when there are none. Where the application waits at once for what it submits, its own
// thread runs them.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <span>
#include <thread>
#include <vector>

#include "icd/command_buffer.h"
#include "icd/rhythm.h"
#include "icd/sync.h"
#include "icd/watchdog.h"

namespace pumice::icd {

struct SemaphoreValue {
  Semaphore* semaphore;
  uint64_t value;
};

struct Submission {
  std::vector<SemaphoreValue> waits;
  std::vector<CommandBuffer*> commandBuffers;
  std::vector<SemaphoreValue> signals;
  Fence* fence = nullptr;
  std::function<void()> work;          //!< presentation; runs after the command buffers
  bool sleeps = false;                 //!< waits for the host or for the time

  void add(CommandBuffer& buffer) {
    commandBuffers.push_back(&buffer);
    sleeps |= buffer.waitsForEvents;
  }
  void add(SemaphoreValue wait) {
    waits.push_back(wait);
    sleeps |= wait.semaphore->payload() != nullptr;   // others signal it: when, is not known
  }
  bool empty() const { return commandBuffers.empty() && !work; }
};

class QueueWorker {
 public:
  explicit QueueWorker(Device& device);
  ~QueueWorker();
  SyncHub& hub() { return hub_; }
  //! False when memory or threads run out.
  bool submit(Submission&& submission);
  //! VK_ERROR_DEVICE_LOST once the watchdog has ended a submission.
  VkResult waitIdle();
  //! A wait for fences or timeline semaphores begins.
  template <typename Handle>
  void waits(uint64_t timeout, std::span<const Handle> handles) {
    std::lock_guard lock(mutex_);
    uint64_t last = 0;
    for (Handle h : handles) last = std::max(last, from(h)->submission);
    waits(timeout >= kPatience ? last : 0);
  }

 private:
  static constexpr uint64_t kPatience = 10'000'000'000;   //!< ns: who waits for less wants to be back before a long submission ends
  static constexpr size_t kStack = 256 * 1024;            //!< bytes; frames of routines are most of it

  void main();
  void waits(uint64_t submission) { rhythm_.waits(clockNanoseconds(), std::this_thread::get_id() == submitter_ ? submission : 0); }
  void runNext(std::unique_lock<std::mutex>& lock);
  bool ready(const Submission& s) const;
  void finish(const Submission& s);
  void run(Submission& s);

  Device& device_;
  SyncHub hub_;
  std::mutex mutex_;
  std::condition_variable wake_, idle_;
  std::deque<Submission> pending_;
  bool busy_ = false, stop_ = false;
  Rhythm rhythm_;
  std::thread::id submitter_;            //!< whose rhythm it is
  const bool runsItself_;
  std::unique_ptr<Execution> execution_;
  std::unique_ptr<Watchdog> watchdog_;   // null: no limit
  base::Thread thread_;
};

}  // namespace pumice::icd
