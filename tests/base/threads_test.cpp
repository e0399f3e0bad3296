#include "base/threads.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <ucontext.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "base/fpenv.h"

namespace pumice::base {
namespace {

size_t threadsOfProcess() {
  size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) {
    (void)entry;
    count++;
  }
  return count;
}

// A joined thread may stay in /proc for a moment.
bool threadsBecome(size_t expected) {
  for (int i = 0; i < 2000 && threadsOfProcess() != expected; i++) ::usleep(1000);
  return threadsOfProcess() == expected;
}

// Holds each of `expected` threads until all have come, so that a test sees them all at work.
class Gate {
 public:
  explicit Gate(unsigned expected) : missing_(expected) {}
  void pass() {
    std::unique_lock lock(mutex_);
    if (missing_ > 0) missing_--;
    all_.notify_all();
    all_.wait(lock, [&] { return missing_ == 0; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable all_;
  unsigned missing_;
};

TEST(ThreadPool, EveryIndexIsCalledOnce) {
  ThreadPool pool(4);
  for (uint32_t count : {0u, 1u, 2u, 3u, 7u, 1000u, 20000u}) {
    std::vector<std::atomic<int>> calls(count);
    pool.parallelFor(count, [&](uint32_t index, unsigned worker) {
      calls[index]++;
      EXPECT_LT(worker, pool.workerCount());
    });
    for (auto& call : calls) ASSERT_EQ(call, 1);
  }
}

TEST(ThreadPool, PlainWritesOfAllWorkersAreVisibleAfterwards) {
  ThreadPool pool(4);
  std::vector<uint32_t> values(5000);
  for (uint32_t round = 1; round < 200; round++) {
    pool.parallelFor(uint32_t(values.size()), [&](uint32_t index, unsigned) { values[index] += index; });
    ASSERT_EQ(values[4999], 4999 * round);
    ASSERT_EQ(values[1], round);
  }
}

TEST(ThreadPool, AllThreadsTakePartAndHaveTheirOwnIndex) {
  ThreadPool pool(4);
  Gate gate(4);
  std::mutex mutex;
  std::set<unsigned> workers;
  std::set<std::thread::id> threads;
  pool.parallelFor(4, [&](uint32_t, unsigned worker) {
    gate.pass();
    std::lock_guard lock(mutex);
    workers.insert(worker);
    threads.insert(std::this_thread::get_id());
  });
  EXPECT_EQ(workers, (std::set<unsigned>{0, 1, 2, 3}));
  EXPECT_EQ(threads.size(), 4u);
  EXPECT_TRUE(threads.count(std::this_thread::get_id()));
}

//! Threads before a test: those of earlier tests have vanished, and what a sanitizer starts with the first thread is there.
size_t settledThreads() {
  std::thread([] {}).join();
  ::usleep(20000);
  return threadsOfProcess();
}

TEST(ThreadPool, NoThreadIsStartedWithoutNeed) {
  size_t before = settledThreads();
  ThreadPool single(1);
  std::thread::id other;
  single.parallelFor(100, [&](uint32_t, unsigned) {
    if (std::this_thread::get_id() != other) other = std::this_thread::get_id();
  });
  EXPECT_EQ(other, std::this_thread::get_id());
  ThreadPool pool(8);
  pool.parallelFor(1, [](uint32_t, unsigned) {});
  EXPECT_TRUE(threadsBecome(before));
  pool.parallelFor(2, [](uint32_t, unsigned) {});
  EXPECT_TRUE(threadsBecome(before + 1));
}

TEST(ThreadPool, TheDestructorLeavesNoThread) {
  size_t before = settledThreads();
  for (int round = 0; round < 50; round++) {
    ThreadPool pool(4);
    pool.parallelFor(16, [](uint32_t, unsigned) {});
  }
  EXPECT_TRUE(threadsBecome(before));
}

TEST(ThreadPool, ManyCallersAtOnceAndLoopsWithinLoops) {
  ThreadPool pool(3);
  std::atomic<uint64_t> sum{0};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; caller++) {
    callers.emplace_back([&] {
      for (int round = 0; round < 50; round++) {
        pool.parallelFor(8, [&](uint32_t outer, unsigned) {
          pool.parallelFor(5, [&](uint32_t inner, unsigned) { sum += outer * 5 + inner; });
        });
      }
    });
  }
  for (auto& caller : callers) caller.join();
  EXPECT_EQ(sum, 4u * 50u * (39u * 40u / 2u));
}

TEST(ThreadPool, IdleWorkersSleep) {
  ThreadPool pool(4);
  Gate gate(4);
  pool.parallelFor(4, [&](uint32_t, unsigned) { gate.pass(); });
  ::usleep(20000);
  timespec before, after;
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &before);
  ::usleep(100000);
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &after);
  double used = double(after.tv_sec - before.tv_sec) + 1e-9 * double(after.tv_nsec - before.tv_nsec);
  EXPECT_LT(used, 0.02);
}

TEST(ThreadPool, WorkersBlockSignalsAndAreNamed) {
  ThreadPool pool(2);
  Gate gate(2);
  std::string name;
  bool blocked = false;
  pool.parallelFor(2, [&](uint32_t, unsigned worker) {
    gate.pass();
    if (worker == 0) return;
    char buffer[16] = {};
    ::pthread_getname_np(::pthread_self(), buffer, sizeof(buffer));
    name = buffer;
    sigset_t mask;
    ::pthread_sigmask(SIG_SETMASK, nullptr, &mask);
    blocked = ::sigismember(&mask, SIGTERM) && ::sigismember(&mask, SIGALRM) && ::sigismember(&mask, SIGCHLD);
  });
  EXPECT_EQ(name, "pumice-1");
  EXPECT_TRUE(blocked);
  sigset_t mine;
  ::pthread_sigmask(SIG_SETMASK, nullptr, &mine);
  EXPECT_FALSE(::sigismember(&mine, SIGTERM));
}

// A host that has set flush-to-zero gets it back, and its threads do not hand it on to ours.
TEST(ThreadPool, TheFloatingPointEnvironmentIsTheDefaultInside) {
#if defined(__x86_64__)
  constexpr uint32_t kFlushAndTruncate = 0x1f80 | 0x8040 | 0x6000;
  ThreadPool pool(3);
  writeFpEnv(kFlushAndTruncate);
  Gate gate(3);
  std::atomic<int> right{0};
  pool.parallelFor(3, [&](uint32_t, unsigned) {
    gate.pass();
    volatile float tiny = 1e-38f;
    volatile float quotient = tiny / 4;
    right += (readFpEnv() & ~0x3fu) == kDefaultFpEnv && quotient > 0;
  });
  uint32_t after = readFpEnv();
  writeFpEnv(kDefaultFpEnv);
  EXPECT_EQ(after, kFlushAndTruncate);
  EXPECT_EQ(right, 3);
#else
  GTEST_SKIP() << "written for x86-64";
#endif
}

//! A pool of two whose worker is busy until release().
struct BusyPool {
  ThreadPool pool{2};
  Gate begun{2}, over{2};
  std::shared_ptr<Task> holding = std::make_shared<Task>([this] {
    begun.pass();
    over.pass();
  });
  BusyPool() {
    pool.post(holding);
    begun.pass();
  }
  void release() {
    over.pass();
    holding->finish();
  }
};

TEST(Task, IsDoneOnceByWhoeverIsFirst) {
  ThreadPool pool(4);
  std::vector<int> runs(2000, 0);   // plain: each by one thread, then read
  std::vector<std::shared_ptr<Task>> tasks;
  for (int& each : runs) {
    tasks.push_back(std::make_shared<Task>([&each] { each++; }));
    pool.post(tasks.back());
  }
  pool.parallelFor(uint32_t(tasks.size()), [&](uint32_t i, unsigned) { tasks[i]->finish(); });
  for (auto& task : tasks) {
    EXPECT_TRUE(task->done());
    pool.finish(*task);
  }
  EXPECT_EQ(std::count(runs.begin(), runs.end(), 1), int(runs.size()));
}

TEST(Task, AWorkerDoesItUnasked) {
  ThreadPool pool(2);
  std::atomic<bool> right{false};
  auto task = std::make_shared<Task>([&, here = std::this_thread::get_id()] { right = std::this_thread::get_id() != here && (readFpEnv() & ~0x3fu) == kDefaultFpEnv; });
  pool.post(task);
  for (int i = 0; i < 5000 && !task->done(); i++) ::usleep(1000);
  EXPECT_TRUE(task->done());
  EXPECT_TRUE(right);
}

TEST(Task, OneThreadDoesItAtOnce) {
  ThreadPool pool(1);
  auto task = std::make_shared<Task>([] {});
  pool.post(task);
  EXPECT_TRUE(task->done());
}

TEST(Task, WhoWaitsForOneThatWasBegunLatelyDoesOthers) {
  BusyPool busy;
  Gate begun(2), over(2);
  auto awaited = std::make_shared<Task>([&] {
    begun.pass();
    over.pass();
  });
  busy.pool.post(awaited);
  ::usleep(1000000);   // it waits for a worker longer than what follows takes
  busy.release();
  begun.pass();
  auto last = std::make_shared<Task>([] {});
  busy.pool.post(last);
  busy.pool.post(std::make_shared<Task>([] { ADD_FAILURE() << "nobody holds this one"; }));
  auto urgent = std::make_shared<Task>([&] { EXPECT_FALSE(last->done()); });
  busy.pool.post(urgent, true);
  // The worker cannot: only the waiting thread can do these, and then it waits for the worker.
  std::thread waiting([&] { busy.pool.finish(*awaited); });
  for (int i = 0; i < 5000 && !(urgent->done() && last->done()); i++) ::usleep(1000);
  EXPECT_TRUE(urgent->done());
  EXPECT_TRUE(last->done());
  EXPECT_FALSE(awaited->done());
  over.pass();
  waiting.join();
}

TEST(Task, OneThatIsGivenUpIsNeverBegun) {
  bool ran = false;
  auto task = std::make_shared<Task>([&] { ran = true; });
  {
    BusyPool busy;
    busy.pool.post(task);
    task->abandon();
    busy.release();
  }
  task->finish();
  EXPECT_FALSE(ran);
}

TEST(Task, APoolMayGoBeforeItsTasks) {
  bool ran = false;
  auto task = std::make_shared<Task>([&] { ran = true; });
  {
    BusyPool busy;
    busy.pool.post(task);
    std::thread later([&] { busy.release(); });
    later.join();
  }
  task->finish();
  EXPECT_TRUE(ran);
}

#if !defined(__SANITIZE_THREAD__)
TEST(ThreadPool, AForkedChildCanLetGoOfThePool) {
  auto* pool = new ThreadPool(3);
  pool->parallelFor(10, [](uint32_t, unsigned) {});
  pid_t child = ::fork();
  if (child == 0) {
    ::alarm(20);
    delete pool;
    ::_exit(0);
  }
  int status = 1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  delete pool;
}
#endif

TEST(Thread, RunsItsBodyUnderItsName) {
  std::string name;
  auto thread = Thread::start("a-rather-long-thread-name", [&] {
    char buffer[16] = {};
    ::pthread_getname_np(::pthread_self(), buffer, sizeof(buffer));
    name = buffer;
  });
  ASSERT_TRUE(thread);
  EXPECT_TRUE(thread->running());
  thread->join();
  EXPECT_FALSE(thread->running());
  EXPECT_EQ(name, "a-rather-long-t");
}

TEST(StackHolds, WhatIsLeftOfTheThreadsOwn) {
  EXPECT_TRUE(stackHolds(100 * 1024));
  EXPECT_FALSE(stackHolds(size_t(1) << 46));
  // A small one
  pthread_attr_t attributes;
  ::pthread_attr_init(&attributes);
  ::pthread_attr_setstacksize(&attributes, 128 * 1024);
  bool results[2] = {};
  pthread_t thread;
  ASSERT_EQ(::pthread_create(&thread, &attributes, [](void* out) -> void* {
    static_cast<bool*>(out)[0] = stackHolds(16 * 1024);
    static_cast<bool*>(out)[1] = stackHolds(128 * 1024);
    return nullptr;
  }, results), 0);
  ::pthread_join(thread, nullptr);
  ::pthread_attr_destroy(&attributes);
  EXPECT_TRUE(results[0]);
  EXPECT_FALSE(results[1]);
  // One that is not the thread's
  static ucontext_t outer, inner;
  static bool onFiber = true;
  static std::vector<char> stack(256 * 1024);
  ::getcontext(&inner);
  inner.uc_stack.ss_sp = stack.data();
  inner.uc_stack.ss_size = stack.size();
  inner.uc_link = &outer;
  ::makecontext(&inner, [] { onFiber = stackHolds(1024); }, 0);
  ::swapcontext(&outer, &inner);
  EXPECT_FALSE(onFiber);
}

}  // namespace
}  // namespace pumice::base
