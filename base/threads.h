// Threads of ours inside somebody else's process: all signals blocked (the host's handlers stay on the
// host's threads), a name, and the default floating-point environment.
#pragma once

#include <pthread.h>
#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
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

  // In a child made by fork() the thread does not exist: nothing is waited for.
  void join();

 private:
  pthread_t handle_ = {};
  pid_t process_ = 0;
  bool started_ = false;
};

// Whether the calling thread has that many bytes of stack left. False, too, on stacks that are not the thread's own (fibers) and where
// the system does not say.
bool stackHolds(size_t bytes);

// A piece of work that is done once: by a worker of a pool, or by whoever needs it first. Held by shared pointers;
// needs no other task to be done. The floating-point environment is the default one within.
class Task {
 public:
  // `body` must not throw. It is destroyed when it has been run, or with the task.
  explicit Task(std::function<void()> body) : body_(std::move(body)) {}

  // True: what it has written is visible.
  bool done() const { return state_.load(std::memory_order_acquire) == kDone; }
  // Does it, unless somebody has begun it; false then.
  bool tryRun();
  // Does it, or waits for who has begun it.
  void finish();
  // It will not be begun any more. Waits for who has begun it.
  void abandon();

 private:
  friend class ThreadPool;
  enum : uint32_t { kPending, kBegun, kDone };
  std::atomic<uint32_t> state_{kPending};
  std::atomic<int64_t> posted_{0}, begun_{0};  // when, by the steady clock's ticks; 0: not yet
  std::function<void()> body_;
};

// Workers that share the items of loops, and do tasks when there is no loop. They are started by the first loop or task
// that has use for them and sleep when there is none. Any number of threads may call parallelFor at once, also from inside
// a loop, and any may post tasks.
class ThreadPool {
 public:
  // `threads` counts the calling thread: with 1 no thread is ever started.
  explicit ThreadPool(unsigned threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  // Worker indices given to loops are below this.
  unsigned workerCount() const { return threads_; }

  // Some worker does it when there is no loop to help with, oldest first and those that are urgent before others; a task that
  // nobody else holds any more is left out. With one thread it is done here and now.
  void post(std::shared_ptr<Task> task, bool urgent = false);

  // Like task.finish(), but does other tasks while somebody else is busy with this one, unless that will probably be over soon.
  void finish(Task& task);

  // For good: items that nobody has begun are left out from now on. Those that have been begun may look at cancelled().
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  const std::atomic<bool>& cancelled() const { return cancelled_; }

  // Calls fn(uint32_t index, unsigned worker) once for each index below count, in any order and on several
  // threads, and returns when all are done; what they wrote is then visible. The caller takes part, as
  // worker 0. Within one loop no two threads have the same worker index; in loops that run at the same time
  // they may. fn must not throw. The floating-point environment is the default one within.
  template <typename Function>
  void parallelFor(uint32_t count, Function&& fn) {
    using Plain = std::remove_reference_t<Function>;
    run(count, const_cast<void*>(static_cast<const void*>(&fn)),
        [](void* context, uint32_t index, unsigned worker) {
          (*static_cast<Plain*>(context))(index, worker);
        });
  }

 private:
  using Call = void (*)(void* context, uint32_t index, unsigned worker);

  struct Loop;
  struct Shared;

  void run(uint32_t count, void* context, Call call);

  const unsigned threads_;
  std::unique_ptr<Shared> shared_;  // what callers and workers look at
  std::vector<Thread> workers_;     // guarded by the mutex in shared_
  bool startFailed_ = false;        // so is this
  std::atomic<bool> cancelled_{false};
  std::atomic<pid_t> process_{0};   // the one the workers were started in

  void startWorkers(unsigned wanted);
  bool runPosted();
};

}  // namespace pumice::base
