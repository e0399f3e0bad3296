// Ends what runs for too long (PUMICE_WATCHDOG_SECONDS).
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>

#include "base/threads.h"

namespace pumice::icd {

class Watchdog {
 public:
  //! `expired` is called once, on the watchdog's own thread.
  Watchdog(std::chrono::seconds limit, std::function<void()> expired) : limit_(limit), expired_(std::move(expired)) {}
  ~Watchdog();

  //! Something runs for as long as this lives. Null: unwatched.
  class Guard {
   public:
    explicit Guard(Watchdog* w) : watchdog_(w) {
      if (w) w->set(true);
    }
    ~Guard() {
      if (watchdog_) watchdog_->set(false);
    }
    Guard(const Guard&) = delete;

   private:
    Watchdog* const watchdog_;
  };

 private:
  void set(bool running);
  void main();

  const std::chrono::seconds limit_;
  const std::function<void()> expired_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<std::chrono::steady_clock::time_point> deadline_;
  bool stop_ = false;
  base::Thread thread_;   // starts with the first thing to watch
};

}  // namespace pumice::icd
