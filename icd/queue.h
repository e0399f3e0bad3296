// The queue's thread: runs submissions in order, sleeps when there are none.
#pragma once

#include <deque>
#include <functional>
#include <vector>

#include "icd/command_buffer.h"
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

 private:
  void main();
  bool ready(const Submission& s) const;
  void finish(const Submission& s);
  void run(Submission& s);

  Device& device_;
  SyncHub hub_;
  std::mutex mutex_;
  std::condition_variable wake_, idle_;
  std::deque<Submission> pending_;
  bool busy_ = false, stop_ = false;
  std::unique_ptr<Execution> execution_;
  std::unique_ptr<Watchdog> watchdog_;   // null: no limit
  base::Thread thread_;
};

}  // namespace pumice::icd
