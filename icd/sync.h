// Fences, semaphores, events, query pools. Waiting is on one condition variable per device: nothing spins.
#pragma once

#include <chrono>
#include <condition_variable>
#include <ctime>
#include <mutex>

#include "icd/device.h"
#include "icd/external.h"
#include "icd/host_containers.h"
#include "pipeline/execute.h"

namespace pumice::icd {

//! Guards the state of a device's synchronisation objects. Everybody who waits, waits here.
class SyncHub {
 public:
  //! Changes state and wakes whoever waits for it.
  template <typename Change>
  void update(Change&& change) {
    {
      std::lock_guard lock(mutex_);
      change();
      if (!waiters_) return;
    }
    changed_.notify_all();
  }
  template <typename Read>
  auto read(Read&& read) {
    std::lock_guard lock(mutex_);
    return read();
  }
  //! Waits until ready() (called with the lock held). Timeout in nanoseconds, ~0 = for ever. False on timeout.
  template <typename Ready>
  bool wait(uint64_t timeout, Ready&& ready) {
    std::unique_lock lock(mutex_);
    if (ready()) return true;
    if (!timeout) return false;
    waiters_++;
    bool result = true;
    // Beyond a century the clock would overflow.
    if (timeout > uint64_t(100) * 365 * 86400 * 1'000'000'000)
      changed_.wait(lock, ready);
    else
      result = changed_.wait_until(lock, std::chrono::steady_clock::now() + std::chrono::nanoseconds(timeout), ready);
    waiters_--;
    return result;
  }
  //! The same, for what a lost device may never do: VK_SUCCESS, VK_TIMEOUT or VK_ERROR_DEVICE_LOST.
  template <typename Ready>
  VkResult waitOrLost(uint64_t timeout, Ready&& ready) {
    bool lost = false;
    const bool done = wait(timeout, [&] { return (lost = lost_) || ready(); });
    return lost ? VK_ERROR_DEVICE_LOST : done ? VK_SUCCESS : VK_TIMEOUT;
  }
  void lose() {
    update([&] { lost_ = true; });
  }
  bool lost() {
    return read([&] { return lost_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  uint32_t waiters_ = 0;
  bool lost_ = false;
};

struct Fence {
  bool signaled = false;
  uint64_t submission = 0;   //!< the last one it was given to (Rhythm)
};

//! A binary semaphore's state outside of the device: an eventfd that counts to one.
struct SharedPayload {
  OwnedFd fd;
  bool make();
  void signal() const;
  //! Takes the signal. Waits for it that long at most.
  bool consume(int milliseconds) const;
};

struct Semaphore {
  bool timeline = false;
  uint64_t value = 0;                   //!< binary: 1 = signalled; of no meaning while there is a shared payload
  uint64_t submission = 0;              //!< the last one that signals it (Rhythm)
  SharedPayload permanent, temporary;   //!< the temporary one goes with the next wait
  const SharedPayload* payload() const { return temporary.fd ? &temporary : permanent.fd ? &permanent : nullptr; }
  void signal(uint64_t to) {
    if (auto* p = payload())
      p->signal();
    else
      value = to;
  }
};

struct Event {
  bool set = false;
};

//! Nanoseconds of a clock of the host. The device's own time, which timestamps tell, is the monotonic one.
uint64_t clockNanoseconds(clockid_t clock = CLOCK_MONOTONIC);

struct Query {
  uint64_t value = 0;
  bool available = false;
  pipeline::PipelineStatistics statistics;   //!< of VK_QUERY_TYPE_PIPELINE_STATISTICS
};

struct QueryPool {
  explicit QueryPool(const HostAllocator& a) : queries(HostStl<Query>(a)) {}
  VkQueryType type = VK_QUERY_TYPE_OCCLUSION;
  VkQueryPipelineStatisticFlags statistics = 0;
  HostVector<Query> queries;
};

PUMICE_HANDLE(Fence, VkFence)
PUMICE_HANDLE(Semaphore, VkSemaphore)
PUMICE_HANDLE(Event, VkEvent)
PUMICE_HANDLE(QueryPool, VkQueryPool)

//! Writes one query's result as vkGetQueryPoolResults and vkCmdCopyQueryPoolResults lay it out. False if it is not
//! available and nothing but availability could be written.
bool writeQueryResult(const QueryPool& pool, const Query& query, VkQueryResultFlags flags, std::byte* out, uint64_t bytes);

}  // namespace pumice::icd
