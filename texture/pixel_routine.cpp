#include "texture/pixel_routine.h"

#include <algorithm>
#include <cstddef>
#include <mutex>
#include <new>
#include <unordered_map>

#include "base/fpenv.h"
#include "base/hash.h"
#include "base/log.h"
#include "spirv_interp/jit/engine.h"

namespace pumice::texture {
namespace {

constexpr size_t kMaxRoutines = 512;

struct KeyHash {
  size_t operator()(const RoutineKey& k) const { return base::hashObject(k); }
};

struct Registry {
  std::mutex mutex;
  std::unordered_map<RoutineKey, std::shared_ptr<const interp::Executable>, KeyHash> routines;
};
// Never destroyed, since threads may copy while the process already exits; what it holds goes with forgetPixelRoutines().
Registry& registry() {
  alignas(Registry) static std::byte memory[sizeof(Registry)];
  static Registry* const r = new (memory) Registry;
  return *r;
}

}  // namespace

std::shared_ptr<const interp::Executable> pixelRoutine(const RoutineKey& key, const std::function<void(ir::Builder&)>& build) {
  Registry& r = registry();
  {
    std::lock_guard lock(r.mutex);
    if (auto found = r.routines.find(key); found != r.routines.end()) return found->second;
  }
  // Compiled outside the lock; if another thread was faster its routine is used.
  ir::Function f;
  ir::Builder b(f);
  build(b);
  ir::optimise(f);
  auto compiled = jit::makeExecutable(f, {});
  if (!compiled) {
    base::logError("texture: conversion routine (formats %u to %u): %s", key.sourceFormat, key.targetFormat, compiled.error().message.c_str());
    return nullptr;
  }
  std::shared_ptr<const interp::Executable> routine = std::move(compiled).value();
  std::lock_guard lock(r.mutex);
  if (r.routines.size() >= kMaxRoutines) r.routines.clear();  // those in use live on with their users
  return r.routines.emplace(key, std::move(routine)).first->second;
}

void forgetPixelRoutines() {
  Registry& r = registry();
  decltype(r.routines) gone;
  std::lock_guard lock(r.mutex);
  gone.swap(r.routines);
}

void runPixels(base::ThreadPool& pool, const interp::Executable& routine, const interp::Table* tables, const PixelBox& box) {
  base::ScopedFpEnv environment;
  const uint64_t total = uint64_t(box.width) * box.height * box.depth;
  if (total == 0) return;
  const interp::UniformBank bank = routine.preamble(tables);
  constexpr uint32_t kLanes = interp::kMaxLanes;
  auto batch = [&](uint64_t first) {
    alignas(64) uint32_t rows[3][kLanes];
    const uint32_t lanes = uint32_t(std::min<uint64_t>(kLanes, total - first));
    uint32_t x = uint32_t(first % box.width), y = uint32_t(first / box.width % box.height), z = uint32_t(first / box.width / box.height);
    for (uint32_t l = 0; l < kLanes; ++l) {
      rows[0][l] = box.x + x;
      rows[1][l] = box.y + y;
      rows[2][l] = box.z + z;
      if (++x == box.width) {
        x = 0;
        if (++y == box.height) y = 0, ++z;
      }
    }
    const void* inputs[] = {rows[0], rows[1], rows[2]};
    interp::ExecContext context;
    context.lanes = lanes;
    for (uint32_t w = 0; w < std::size(context.active); ++w)
      context.active[w] = lanes >= 64 * (w + 1) ? ~uint64_t(0) : lanes > 64 * w ? (uint64_t(1) << (lanes - 64 * w)) - 1 : 0;
    context.inputs = inputs;
    context.tables = tables;
    routine.run(bank, context);
  };
  constexpr uint64_t kBatchesPerTask = 16;
  const uint64_t batches = (total + kLanes - 1) / kLanes;
  const uint64_t tasks = (batches + kBatchesPerTask - 1) / kBatchesPerTask;
  auto task = [&](uint64_t t) {
    for (uint64_t i = t * kBatchesPerTask; i < std::min(batches, (t + 1) * kBatchesPerTask); ++i) batch(i * kLanes);
  };
  if (tasks < 2 || pool.workerCount() == 1 || tasks > ~0u) {
    for (uint64_t t = 0; t < tasks; ++t) task(t);
  } else {
    pool.parallelFor(uint32_t(tasks), [&](uint32_t t, unsigned) { task(t); });
  }
}

}  // namespace pumice::texture
