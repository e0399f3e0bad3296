#include "base/threads.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include "base/fpenv.h"
#include "base/log.h"

namespace pumice::base {

namespace {

struct StartInfo {
  std::string name;
  std::function<void()> body;
};

void* threadMain(void* argument) {
  std::unique_ptr<StartInfo> info(static_cast<StartInfo*>(argument));
  // Named by itself: a name given from outside would race with a thread that is already over.
  ::pthread_setname_np(::pthread_self(), info->name.substr(0, 15).c_str());
  writeFpEnv(kDefaultFpEnv);
  info->body();
  return nullptr;
}

}  // namespace

Thread& Thread::operator=(Thread&& other) noexcept {
  join();
  handle_ = other.handle_;
  process_ = other.process_;
  started_ = std::exchange(other.started_, false);
  return *this;
}

Result<Thread> Thread::start(std::string name, std::function<void()> body) {
  auto info = std::make_unique<StartInfo>(StartInfo{std::move(name), std::move(body)});
  Thread thread;
  // A new thread inherits the mask, so there is no moment in which it takes signals.
  sigset_t all, before;
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  int problem = ::pthread_create(&thread.handle_, nullptr, threadMain, info.get());
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  if (problem) return errorf("cannot start thread %s: %s", info->name.c_str(), ::strerrordesc_np(problem));
  (void)info.release();
  thread.started_ = true;
  thread.process_ = ::getpid();
  return thread;
}

void Thread::join() {
  if (!std::exchange(started_, false)) return;
  if (process_ == ::getpid()) ::pthread_join(handle_, nullptr);
}

namespace {
int64_t now() { return std::chrono::steady_clock::now().time_since_epoch().count(); }
}  // namespace

bool Task::tryRun() {
  uint32_t expected = kPending;
  if (!state_.compare_exchange_strong(expected, kBegun, std::memory_order_relaxed)) return false;
  if (posted_.load(std::memory_order_relaxed)) begun_.store(now(), std::memory_order_relaxed);
  {
    ScopedFpEnv environment;
    body_();
  }
  body_ = nullptr;
  state_.store(kDone, std::memory_order_release);
  state_.notify_all();
  return true;
}

void Task::finish() {
  if (!done() && !tryRun()) state_.wait(kBegun, std::memory_order_acquire);
}

void Task::abandon() {
  uint32_t expected = kPending;
  if (!state_.compare_exchange_strong(expected, kDone, std::memory_order_acquire)) state_.wait(kBegun, std::memory_order_acquire);
}

bool stackHolds(size_t bytes) {
  // Asked once a thread: for a process's first thread the system reads its whole map.
  thread_local const std::pair<uintptr_t, uintptr_t> range = []() -> std::pair<uintptr_t, uintptr_t> {
    pthread_attr_t attributes;
    if (::pthread_getattr_np(::pthread_self(), &attributes)) return {};
    void* lowest = nullptr;
    size_t size = 0;
    const bool known = !::pthread_attr_getstack(&attributes, &lowest, &size);
    ::pthread_attr_destroy(&attributes);
    const auto low = reinterpret_cast<uintptr_t>(lowest);
    return known ? std::pair{low, low + size} : std::pair<uintptr_t, uintptr_t>{};
  }();
  const auto here = reinterpret_cast<uintptr_t>(__builtin_frame_address(0));
  return here > range.first && here < range.second && here - range.first > bytes;
}

// A running loop; lives on the stack of its caller. Which loops are open, how many workers have joined each
// and how many are still inside is guarded by Shared::mutex; items are handed out by the counter alone.
struct ThreadPool::Loop {
  alignas(64) std::atomic<uint32_t> next{0};
  alignas(64) uint32_t count;
  void* context;
  Call call;
  unsigned joined = 1;  // worker indices handed out
  unsigned inside = 0;  // workers that may still touch this
  std::condition_variable empty;
  Loop* following = nullptr;
  const std::atomic<bool>* cancelled;

  bool exhausted() const {
    return next.load(std::memory_order_relaxed) >= count || cancelled->load(std::memory_order_relaxed);
  }

  void work(unsigned worker) {
    while (true) {
      // Looking first keeps the counter from wrapping when a loop has nearly 2^32 items.
      if (exhausted()) return;
      uint32_t index = next.fetch_add(1, std::memory_order_relaxed);
      if (index >= count) return;
      call(context, index, worker);
    }
  }
};

struct ThreadPool::Shared {
  explicit Shared(unsigned most) : threads(most) {}

  const unsigned threads;
  std::mutex mutex;
  std::condition_variable wake;
  std::deque<std::shared_ptr<Task>> tasks;
  Loop* loops = nullptr;  // those that may still have items for more workers, oldest first
  unsigned sleeping = 0;
  bool stop = false;

  // The first loop that has items and room for one more worker. mutex is held.
  Loop* openLoop() {
    for (Loop* loop = loops; loop; loop = loop->following)
      if (loop->joined < threads && !loop->exhausted()) return loop;
    return nullptr;
  }

  // Does the first task, if there is one. The lock is held before and afterwards, but not in between.
  bool runTask(std::unique_lock<std::mutex>& lock) {
    if (tasks.empty()) return false;
    std::shared_ptr<Task> task = std::move(tasks.front());
    tasks.pop_front();
    lock.unlock();
    if (task.use_count() > 1) task->tryRun();
    task.reset();
    lock.lock();
    return true;
  }

  void append(Loop* loop) {
    Loop** link = &loops;
    while (*link) link = &(*link)->following;
    *link = loop;
  }

  // Takes the loop off the list, if it is still there. mutex is held.
  void close(Loop* loop) {
    for (Loop** link = &loops; *link; link = &(*link)->following) {
      if (*link == loop) {
        *link = loop->following;
        return;
      }
    }
  }

  void workerMain() {
    std::unique_lock lock(mutex);
    while (true) {
      Loop* loop = openLoop();
      if (!loop) {
        if (stop) return;
        if (runTask(lock)) continue;
        sleeping++;
        wake.wait(lock);
        sleeping--;
        continue;
      }
      unsigned worker = loop->joined++;
      loop->inside++;
      lock.unlock();
      loop->work(worker);
      lock.lock();
      close(loop);
      // Told under the lock: the caller cannot leave, and the loop vanish, before this is over.
      if (--loop->inside == 0) loop->empty.notify_one();
    }
  }
};

ThreadPool::ThreadPool(unsigned threads)
    : threads_(std::max(1u, threads)), shared_(std::make_unique<Shared>(threads_)) {}

ThreadPool::~ThreadPool() {
  pid_t started = process_;
  if (started != 0 && started != ::getpid()) {
    // A child made by fork(): the workers stayed with the parent, and a condition variable on which they
    // seem to wait cannot be destroyed.
    (void)shared_.release();
    return;
  }
  {
    std::lock_guard lock(shared_->mutex);
    shared_->stop = true;
  }
  shared_->wake.notify_all();
  workers_.clear();
}

void ThreadPool::post(std::shared_ptr<Task> task, bool urgent) {
  if (threads_ == 1) return task->finish();
  task->posted_.store(now(), std::memory_order_relaxed);
  bool toWake;
  {
    std::lock_guard lock(shared_->mutex);
    if (urgent) shared_->tasks.push_front(std::move(task));
    else shared_->tasks.push_back(std::move(task));
    toWake = shared_->sleeping > 0;
    if (!toWake && workers_.size() + 1 < threads_) startWorkers(unsigned(workers_.size()) + 1);
  }
  if (toWake) shared_->wake.notify_one();
}

bool ThreadPool::runPosted() {
  std::unique_lock lock(shared_->mutex);
  return shared_->runTask(lock);
}

void ThreadPool::finish(Task& task) {
  if (task.tryRun()) return;
  // Whoever posts a task for a thing, and then does what else there is to do for it, takes about as long as the task does.
  const auto lately = [&] {
    const int64_t begun = task.begun_.load(std::memory_order_relaxed), posted = task.posted_.load(std::memory_order_relaxed);
    return !begun || 2 * (now() - begun) < now() - posted;
  };
  while (!task.done() && lately() && runPosted()) {}
  task.finish();
}

// The mutex is held.
void ThreadPool::startWorkers(unsigned wanted) {
  if (process_ == 0) process_ = ::getpid();
  while (workers_.size() < wanted && !startFailed_) {
    auto thread = Thread::start("pumice-" + std::to_string(workers_.size() + 1),
                                [shared = shared_.get()] { shared->workerMain(); });
    if (thread) {
      workers_.push_back(std::move(*thread));
    } else {
      // Fewer hands do the same work. Said once; it will not get better.
      startFailed_ = true;
      logWarn("%s", thread.error().message.c_str());
    }
  }
}

void ThreadPool::run(uint32_t count, void* context, Call call) {
  if (count == 0) return;
  ScopedFpEnv environment;
  if (count == 1 || threads_ == 1) {
    for (uint32_t index = 0; index < count && !cancelled_.load(std::memory_order_relaxed); index++)
      call(context, index, 0);
    return;
  }

  Loop loop;
  loop.count = count;
  loop.context = context;
  loop.call = call;
  loop.cancelled = &cancelled_;
  const unsigned wanted = std::min(threads_, count) - 1;
  unsigned toWake;
  {
    std::lock_guard lock(shared_->mutex);
    shared_->append(&loop);
    toWake = std::min(wanted, shared_->sleeping);
    if (workers_.size() < wanted) startWorkers(wanted);
  }
  // Workers that are awake look at the list by themselves before they sleep.
  for (unsigned i = 0; i < toWake; i++) shared_->wake.notify_one();

  loop.work(0);

  std::unique_lock lock(shared_->mutex);
  shared_->close(&loop);
  loop.empty.wait(lock, [&] { return loop.inside == 0; });
}

}  // namespace pumice::base
