#include "icd/watchdog.h"

#include "base/log.h"

namespace pumice::icd {

Watchdog::~Watchdog() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Watchdog::set(bool running) {
  {
    std::lock_guard lock(mutex_);
    deadline_.reset();
    if (running) deadline_ = std::chrono::steady_clock::now() + limit_;
    if (!thread_.running()) {
      auto thread = base::Thread::start("pumice-watchdog", [this] { main(); });
      if (!thread) return base::logError("the watchdog cannot be started: %s", thread.error().message.c_str());
      thread_ = std::move(*thread);
    }
  }
  changed_.notify_all();
}

void Watchdog::main() {
  std::unique_lock lock(mutex_);
  for (;;) {
    if (stop_) return;
    if (!deadline_) {
      changed_.wait(lock);
    } else if (std::chrono::steady_clock::now() < *deadline_) {
      changed_.wait_until(lock, *deadline_);
    } else {
      lock.unlock();
      expired_();
      return;
    }
  }
}

}  // namespace pumice::icd
