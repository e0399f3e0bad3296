#include "base/threads.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <memory>

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
  if (problem) return errorf("cannot start thread %s: %s", info->name.c_str(), std::strerror(problem));
  info.release();
  thread.started_ = true;
  thread.process_ = ::getpid();
  return thread;
}

void Thread::join() {
  if (!std::exchange(started_, false)) return;
  if (process_ == ::getpid()) ::pthread_join(handle_, nullptr);
}

void ThreadPool::Loop::work(unsigned worker) {
  // The counter may pass count by one per worker; a loop of nearly 2^32 items would wrap it.
  for (uint32_t index = next.fetch_add(1, std::memory_order_relaxed); index < count;
       index = next.fetch_add(1, std::memory_order_relaxed)) {
    call(context, index, worker);
  }
}

ThreadPool::ThreadPool(unsigned threads) : threads_(std::max(1u, threads)) {}

ThreadPool::~ThreadPool() {
  if (process_ != 0 && process_ != ::getpid()) return;  // forked: the workers are the parent's
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  workers_.clear();
}

// The first loop that has items and room for one more worker. mutex_ is held.
ThreadPool::Loop* ThreadPool::openLoop() {
  for (Loop* loop = loops_; loop; loop = loop->following)
    if (loop->joined < threads_ && !loop->exhausted()) return loop;
  return nullptr;
}

// Takes the loop off the list, if it is still there. mutex_ is held.
void ThreadPool::close(Loop* loop) {
  for (Loop** link = &loops_; *link; link = &(*link)->following) {
    if (*link == loop) {
      *link = loop->following;
      return;
    }
  }
}

void ThreadPool::workerMain() {
  std::unique_lock lock(mutex_);
  while (true) {
    Loop* loop = openLoop();
    if (!loop) {
      if (stop_) return;
      sleeping_++;
      wake_.wait(lock);
      sleeping_--;
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

// mutex_ is held.
void ThreadPool::startWorkers(unsigned wanted) {
  if (process_ == 0) process_ = ::getpid();
  while (workers_.size() < wanted && !startFailed_) {
    auto thread = Thread::start("pumice-" + std::to_string(workers_.size() + 1), [this] { workerMain(); });
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
    for (uint32_t index = 0; index < count; index++) call(context, index, 0);
    return;
  }

  Loop loop;
  loop.count = count;
  loop.context = context;
  loop.call = call;
  unsigned wanted = std::min(threads_, count) - 1;
  unsigned toWake;
  {
    std::lock_guard lock(mutex_);
    // At the end of the list: earlier loops are served first.
    Loop** link = &loops_;
    while (*link) link = &(*link)->following;
    *link = &loop;
    toWake = std::min(wanted, sleeping_);
    if (workers_.size() < wanted) startWorkers(wanted);
  }
  // Workers that are awake look at the list by themselves before they sleep.
  for (unsigned i = 0; i < toWake; i++) wake_.notify_one();

  loop.work(0);

  std::unique_lock lock(mutex_);
  close(&loop);
  loop.empty.wait(lock, [&] { return loop.inside == 0; });
}

}  // namespace pumice::base
