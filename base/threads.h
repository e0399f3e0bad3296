// Threads of ours inside somebody else's process: all signals blocked (the host's handlers stay on the
// host's threads), a name, and the default floating-point environment.
#pragma once

#include <pthread.h>
#include <sys/types.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <type_traits>
#include <vector>

#include "base/result.h"

namespace pumice::base {

// One thread. Not started by default; the destructor joins.
class Thread {
 public:
  Thread() = default;
  ~Thread() { join(); }
  Thread(Thread&& other) noexcept { *this = std::move(other); }
  Thread& operator=(Thread&& other) noexcept;

  // Names longer than 15 bytes are cut. `body` must not throw.
  static Result<Thread> start(std::string name, std::function<void()> body);

  bool running() const { return started_; }

  // In a child made by fork() the thread does not exist: then nothing is waited for.
  void join();

 private:
  pthread_t handle_ = {};
  pid_t process_ = 0;
  bool started_ = false;
};

// Workers that share the items of loops. They are started by the first loop that has use for them and
// sleep when there is none. Any number of threads may call parallelFor at once, also from inside a loop.
class ThreadPool {
 public:
  // `threads` counts the calling thread: with 1 no thread is ever started.
  explicit ThreadPool(unsigned threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  // Worker indices given to loops are below this.
  unsigned workerCount() const { return threads_; }

  // Calls fn(uint32_t index, unsigned worker) once for each index below count, in any order and on several
  // threads, and returns when all are done; what they wrote is then visible. The caller takes part, as
  // worker 0. Within one loop no two threads have the same worker index; in loops that run at the same time
  // they may. fn must not throw. The floating-point environment is the default one within.
  template <typename Function>
  void parallelFor(uint32_t count, Function&& fn) {
    using Plain = std::remove_reference_t<Function>;
    run(count, const_cast<void*>(static_cast<const void*>(&fn)), [](void* context, uint32_t index, unsigned worker) {
      (*static_cast<Plain*>(context))(index, worker);
    });
  }

 private:
  using Call = void (*)(void* context, uint32_t index, unsigned worker);

  // A running loop; lives on the stack of its caller. Which loops are open, how many workers have joined
  // each and how many are still inside is guarded by mutex_; items are handed out by the counter alone.
  struct Loop {
    alignas(64) std::atomic<uint32_t> next{0};
    alignas(64) uint32_t count;
    void* context;
    Call call;
    unsigned joined = 1;  // worker indices handed out
    unsigned inside = 0;  // workers that may still touch this
    std::condition_variable empty;
    Loop* following = nullptr;

    bool exhausted() const { return next.load(std::memory_order_relaxed) >= count; }
    void work(unsigned worker);
  };

  void run(uint32_t count, void* context, Call call);
  void workerMain();
  Loop* openLoop();
  void close(Loop* loop);
  void startWorkers(unsigned wanted);

  const unsigned threads_;
  std::mutex mutex_;
  std::condition_variable wake_;
  Loop* loops_ = nullptr;      // those that may still have items for more workers
  unsigned sleeping_ = 0;
  bool stop_ = false;
  bool startFailed_ = false;
  pid_t process_ = 0;          // the one the workers were started in
  std::vector<Thread> workers_;
};

}  // namespace pumice::base
