// What handing a loop to the pool costs, against the work it must carry to be worth it.
#include <benchmark/benchmark.h>

#include "base/cpu.h"
#include "base/threads.h"

namespace pumice::base {
namespace {

// Empty items: the cost of waking, sharing and coming together.
void parallelForEmpty(benchmark::State& state) {
  ThreadPool pool(static_cast<unsigned>(state.range(0)));
  for (auto _ : state) pool.parallelFor(uint32_t(state.range(1)), [](uint32_t, unsigned) {});
}
BENCHMARK(parallelForEmpty)
    ->ArgNames({"threads", "items"})
    ->ArgsProduct({{1, 2, 4}, {1, 2, 16, 1024}})
    ->UseRealTime();

// Items of about 20 microseconds, as many as a picture of 1280 x 1024 has tiles.
void parallelForTiles(benchmark::State& state) {
  ThreadPool pool(state.range(0) ? unsigned(state.range(0)) : usableCpus());
  for (auto _ : state) {
    pool.parallelFor(320, [](uint32_t index, unsigned) {
      float value = float(index);
      for (int i = 0; i < 5000; i++) value = value * 0.999f + 1.0f;
      benchmark::DoNotOptimize(value);
    });
  }
}
BENCHMARK(parallelForTiles)->ArgName("threads")->Arg(1)->Arg(0)->UseRealTime();

}  // namespace
}  // namespace pumice::base
