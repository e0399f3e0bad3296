#include "icd/queue.h"

#include "base/fpenv.h"
#include "base/env.h"
#include "base/log.h"
#include "entrypoints.h"
#include "pipeline/ideas.h"

namespace pumice::icd {

QueueWorker::QueueWorker(Device& device)
    : device_(device), runsItself_(!(pipeline::disabledIdeas() & pipeline::bit(pipeline::Idea::RunsItself))) {
  if (const auto seconds = base::envInteger(base::EnvVar::Watchdog, 1, 86400))
    watchdog_ = std::make_unique<Watchdog>(std::chrono::seconds(*seconds), [this, s = *seconds] {
      base::logError("a submission ran for more than %lld s: the device is lost (PUMICE_WATCHDOG_SECONDS)", (long long)s);
      hub_.lose();
      device_.pool.cancel();
    });
}

QueueWorker::~QueueWorker() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

// Of shared payloads it is not known.
bool QueueWorker::ready(const Submission& s) const {
  for (const SemaphoreValue& w : s.waits)
    if (!w.semaphore->payload() && w.semaphore->value < w.value) return false;
  return true;
}

// With the hub's lock held.
void QueueWorker::finish(const Submission& s) {
  for (const SemaphoreValue& v : s.signals) v.semaphore->signal(v.value);
  if (s.fence) s.fence->signaled = true;
}

void QueueWorker::run(Submission& s) {
  // A binary semaphore is unsignalled by the wait.
  bool lost = hub_.waitOrLost(~0ull, [&] { return ready(s); }) < 0;
  // Others signal a shared payload: nobody wakes us, so a lost device is looked for now and then.
  for (const SemaphoreValue& w : s.waits)
    if (auto* shared = w.semaphore->payload()) {
      while (!lost && !shared->consume(50)) lost = hub_.lost();
      if (shared == &w.semaphore->temporary) hub_.update([&] { w.semaphore->temporary.fd.reset(); });
    }
  // Nobody waits for a semaphore to become unsignalled: no reason to wake those who wait for this submission.
  if (!s.waits.empty())
    hub_.read([&] {
      for (const SemaphoreValue& w : s.waits)
        if (!w.semaphore->timeline) w.semaphore->value = 0;
    });
  if (!s.commandBuffers.empty() && !lost) {
    if (!execution_) execution_ = std::make_unique<Execution>(device_, hub_);
    const Watchdog::Guard guard(watchdog_.get());
    for (CommandBuffer* buffer : s.commandBuffers) buffer->execute(*execution_);
    execution_->states.forget();
  }
  // What was submitted to a lost device counts as done: whoever waits comes back, and is told.
  if (s.work) s.work();
  if (!s.signals.empty() || s.fence) hub_.update([&] { finish(s); });
}

bool QueueWorker::submit(Submission&& submission) {
  std::unique_lock lock(mutex_);
  const uint64_t now = clockNanoseconds(), number = rhythm_.submits(now);
  submitter_ = std::this_thread::get_id();
  if (submission.fence) submission.fence->submission = number;
  for (const SemaphoreValue& v : submission.signals) v.semaphore->submission = number;
  const bool next = pending_.empty() && !busy_;
  // Nothing before it and nothing in it: done on the spot.
  if (next && submission.empty() && submission.waits.empty()) {
    hub_.update([&] { finish(submission); });
    rhythm_.submitted(now);
    return true;
  }
  const bool itself = next && rhythm_.waitsAtOnce() && runsItself_ && !submission.sleeps && hub_.read([&] { return ready(submission); }) && base::stackHolds(kStack);
  if (itself) {
    base::ScopedFpEnv environment;
    pending_.push_back(std::move(submission));
    runNext(lock);
    if (!pending_.empty()) wake_.notify_one();
  } else {
    if (!thread_.running()) {
      auto thread = base::Thread::start("pumice-queue", [this] { main(); });
      if (!thread) {
        base::logError("the queue's thread cannot be started: %s", thread.error().message.c_str());
        return false;
      }
      thread_ = std::move(*thread);
    }
    pending_.push_back(std::move(submission));
    wake_.notify_one();
  }
  rhythm_.submitted(clockNanoseconds(), itself);
  return true;
}

// With the lock held, and nothing running.
void QueueWorker::runNext(std::unique_lock<std::mutex>& lock) {
  Submission s = std::move(pending_.front());
  pending_.pop_front();
  busy_ = true;
  lock.unlock();
  try {
    run(s);
  } catch (const std::bad_alloc&) {
    base::logError("out of host memory while executing commands");
    hub_.update([&] { finish(s); });
  }
  lock.lock();
  busy_ = false;
  if (pending_.empty()) idle_.notify_all();
}

void QueueWorker::main() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [&] { return !busy_ && (stop_ || !pending_.empty()); });
    if (pending_.empty()) return;
    runNext(lock);
  }
}

VkResult QueueWorker::waitIdle() {
  {
    std::unique_lock lock(mutex_);
    waits(~0ull);
    idle_.wait(lock, [&] { return pending_.empty() && !busy_; });
  }
  return hub_.lost() ? VK_ERROR_DEVICE_LOST : VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkQueueSubmit(VkQueue handle, uint32_t count, const VkSubmitInfo* infos, VkFence fence) {
  QueueWorker& worker = *from(handle)->worker;
  if (worker.hub().lost()) return VK_ERROR_DEVICE_LOST;
  try {
    for (uint32_t i = 0; i < count; i++) {
      const VkSubmitInfo& info = infos[i];
      auto* values = findInChain<VkTimelineSemaphoreSubmitInfo>(info.pNext, VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
      Submission s;
      for (uint32_t k = 0; k < info.waitSemaphoreCount; k++) {
        Semaphore* semaphore = from(info.pWaitSemaphores[k]);
        s.add({semaphore, semaphore->timeline && values && k < values->waitSemaphoreValueCount ? values->pWaitSemaphoreValues[k] : 1});
      }
      for (uint32_t k = 0; k < info.commandBufferCount; k++) s.add(*from(info.pCommandBuffers[k]));
      for (uint32_t k = 0; k < info.signalSemaphoreCount; k++) {
        Semaphore* semaphore = from(info.pSignalSemaphores[k]);
        s.signals.push_back({semaphore, semaphore->timeline && values && k < values->signalSemaphoreValueCount ? values->pSignalSemaphoreValues[k] : 1});
      }
      if (i + 1 == count) s.fence = from(fence);
      if (!worker.submit(std::move(s))) return VK_ERROR_OUT_OF_HOST_MEMORY;
    }
    if (!count && fence) {
      Submission s;
      s.fence = from(fence);
      if (!worker.submit(std::move(s))) return VK_ERROR_OUT_OF_HOST_MEMORY;
    }
  } catch (const std::bad_alloc&) {
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkQueueSubmit2(VkQueue handle, uint32_t count, const VkSubmitInfo2* infos, VkFence fence) {
  QueueWorker& worker = *from(handle)->worker;
  if (worker.hub().lost()) return VK_ERROR_DEVICE_LOST;
  auto value = [](const VkSemaphoreSubmitInfo& i) { return SemaphoreValue{from(i.semaphore), from(i.semaphore)->timeline ? i.value : 1}; };
  try {
    for (uint32_t i = 0; i < count + (count == 0); i++) {
      Submission s;
      if (i < count) {
        const VkSubmitInfo2& info = infos[i];
        for (uint32_t k = 0; k < info.waitSemaphoreInfoCount; k++) s.add(value(info.pWaitSemaphoreInfos[k]));
        for (uint32_t k = 0; k < info.commandBufferInfoCount; k++) s.add(*from(info.pCommandBufferInfos[k].commandBuffer));
        for (uint32_t k = 0; k < info.signalSemaphoreInfoCount; k++) s.signals.push_back(value(info.pSignalSemaphoreInfos[k]));
      }
      if (i + 1 >= count) s.fence = from(fence);
      if (!worker.submit(std::move(s))) return VK_ERROR_OUT_OF_HOST_MEMORY;
    }
  } catch (const std::bad_alloc&) {
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkQueueWaitIdle(VkQueue queue) {
  return from(queue)->worker->waitIdle();
}

VKAPI_ATTR VkResult VKAPI_CALL vkDeviceWaitIdle(VkDevice device) {
  return from(device)->queue.worker->waitIdle();
}

VKAPI_ATTR VkResult VKAPI_CALL vkQueueBindSparse(VkQueue, uint32_t, const VkBindSparseInfo*, VkFence) {
  return VK_ERROR_FEATURE_NOT_PRESENT;
}

}  // namespace pumice::icd
