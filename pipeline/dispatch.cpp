// Compute: invocations in rows, parallel over work groups.
#include <algorithm>
#include <array>

#include "base/fpenv.h"
#include "pipeline/builders.h"
#include "pipeline/execute.h"

namespace pumice::pipeline {

namespace {

constexpr uint32_t kItemRows = 16;   //!< rows of one piece of parallel work, where groups share rows

struct DispatchRun {
  const ComputeRoutine& routine;
  const interp::UniformBank& bank;
  const interp::Tables& tables;
  std::array<uint32_t, 3> baseGroup, groupCount;
  uint32_t invocations;   // of one work group

  //! Runs invocations [first, first + count) of the stream of all work groups' invocations, in rows.
  void rows(uint64_t first, uint64_t count, std::byte* shared) const {
    alignas(64) uint32_t ids[6][interp::kMaxLanes];
    const void* inputs[6];
    for (int i = 0; i < 6; ++i) inputs[i] = ids[i];
    interp::ExecContext context;
    context.inputs = inputs;
    context.tables = tables;
    context.shared = shared;
    context.sharedBytes = routine.sharedBytes;
    const auto& size = routine.localSize;
    uint64_t group = first / invocations;
    uint32_t local = uint32_t(first % invocations);
    while (count) {
      const uint32_t lanes = uint32_t(std::min<uint64_t>(count, interp::kMaxLanes));
      for (uint32_t l = 0; l < lanes; ++l) {
        ids[0][l] = local % size[0];
        ids[1][l] = local / size[0] % size[1];
        ids[2][l] = local / size[0] / size[1];
        ids[3][l] = baseGroup[0] + uint32_t(group % groupCount[0]);
        ids[4][l] = baseGroup[1] + uint32_t(group / groupCount[0] % groupCount[1]);
        ids[5][l] = baseGroup[2] + uint32_t(group / groupCount[0] / groupCount[1]);
        if (++local == invocations) local = 0, ++group;
      }
      context.lanes = lanes;
      for (uint32_t i = 0; i < interp::kMaxLanes / 64; ++i) {
        const int64_t n = std::clamp<int64_t>(int64_t(lanes) - 64 * int64_t(i), 0, 64);
        context.active[i] = n == 64 ? ~uint64_t(0) : (uint64_t(1) << n) - 1;
      }
      routine.code->run(bank, context);
      count -= lanes;
    }
  }
};

}  // namespace

void dispatch(base::ThreadPool& pool, const DispatchState& state, const uint32_t baseGroup[3], const uint32_t groupCount[3]) {
  if (!state.pipeline || !groupCount[0] || !groupCount[1] || !groupCount[2]) return;
  const base::ScopedFpEnv environment;
  const auto routine = computeRoutine(*state.pipeline, state);
  if (!routine) return;
  DrawConstants constants;
  for (int i = 0; i < 3; ++i) {
    constants.groupCount[i] = groupCount[i];
    constants.baseGroup[i] = baseGroup[i];
  }
  std::copy(std::begin(state.dynamicOffsets), std::end(state.dynamicOffsets), constants.dynamicOffsets);
  interp::Tables tables;
  fillTables(state.push, state.setMemory, state.setSize, constants, tables);
  const interp::UniformBank bank = routine->code->preamble(tables);

  const uint32_t invocations = routine->localSize[0] * routine->localSize[1] * routine->localSize[2];
  const DispatchRun run{*routine, bank, tables, {baseGroup[0], baseGroup[1], baseGroup[2]}, {groupCount[0], groupCount[1], groupCount[2]}, invocations};
  const uint64_t groups = uint64_t(groupCount[0]) * groupCount[1] * groupCount[2];

  // Small work groups share rows unless they could notice: by shared memory, barriers or subgroup operations.
  const bool apart = routine->groupsApart;
  const uint64_t unit = apart ? invocations : uint64_t(kItemRows) * interp::kMaxLanes;
  const uint64_t total = groups * invocations, items = (total + unit - 1) / unit;
  std::vector<std::vector<std::byte>> shared(apart ? pool.workerCount() : 0);
  constexpr uint64_t kWave = 1u << 30;
  for (uint64_t done = 0; done < items; done += kWave) {
    pool.parallelFor(uint32_t(std::min(kWave, items - done)), [&](uint32_t i, unsigned worker) {
      const uint64_t first = (done + i) * unit;
      std::byte* memory = nullptr;
      if (apart) {
        shared[worker].assign(routine->sharedBytes + 64, std::byte(0));
        memory = shared[worker].data();
      }
      run.rows(first, std::min(unit, total - first), memory);
    });
  }
}

}  // namespace pumice::pipeline
