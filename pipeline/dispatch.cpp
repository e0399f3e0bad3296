// Compute: invocations in rows, parallel over work groups.
#include <algorithm>
#include <array>

#include "base/fpenv.h"
#include "base/log.h"
#include "pipeline/builders.h"
#include "pipeline/execute.h"

namespace pumice::pipeline {

namespace {

constexpr uint32_t kItemRows = 16;   //!< rows of one piece of parallel work, where groups share rows

constexpr uint32_t kMaxGroupRows = kMaxGroupInvocations / interp::kMaxLanes;

//! A row of invocations: what the routine is given.
struct Row {
  alignas(64) uint32_t ids[6][interp::kMaxLanes];
  const void* inputs[6];
  interp::ExecContext context;
};

//! A worker's memory for groups that do not share rows; made at its first group.
struct GroupMemory {
  std::vector<std::byte> shared;
  std::unique_ptr<Row[]> rows;
  std::vector<std::unique_ptr<interp::RowState>> states;   // as many as rows had to wait at once
};

//! LocalInvocationId of all invocations of a work group, and once more of a row's worth: rows start anywhere.
struct LocalIds {
  std::vector<uint32_t> ids[3];
  LocalIds(const std::array<uint32_t, 3>& size, uint32_t invocations) {
    for (auto& row : ids) row.resize(invocations + interp::kMaxLanes);
    for (uint32_t l = 0; l < invocations; ++l) {
      ids[0][l] = l % size[0];
      ids[1][l] = l / size[0] % size[1];
      ids[2][l] = l / size[0] / size[1];
    }
    for (auto& row : ids)
      for (uint32_t l = invocations; l < row.size(); ++l) row[l] = row[l - invocations];
  }
};

struct DispatchRun {
  const ComputeRoutine& routine;
  const interp::UniformBank& bank;
  const interp::Tables& tables;
  std::array<uint32_t, 3> baseGroup, groupCount;
  uint32_t invocations;   // of one work group
  const std::atomic<bool>* stop;
  const LocalIds& locals;

  //! Invocations [first, first + lanes) of the stream of all work groups' invocations.
  void fill(Row& row, uint64_t first, uint32_t lanes) const {
    uint64_t group = first / invocations;
    uint32_t local = uint32_t(first % invocations);
    for (int i = 0; i < 3; ++i) std::copy_n(locals.ids[i].data() + local, lanes, row.ids[i]);
    for (uint32_t l = 0; l < lanes; ++group, local = 0) {
      const uint32_t end = std::min(lanes, l + invocations - local);
      const uint32_t id[3] = {baseGroup[0] + uint32_t(group % groupCount[0]), baseGroup[1] + uint32_t(group / groupCount[0] % groupCount[1]),
                              baseGroup[2] + uint32_t(group / groupCount[0] / groupCount[1])};
      for (int i = 0; i < 3; ++i) std::fill(row.ids[3 + i] + l, row.ids[3 + i] + end, id[i]);
      l = end;
    }
    for (int i = 0; i < 6; ++i) row.inputs[i] = row.ids[i];
    row.context = {};
    row.context.inputs = row.inputs;
    row.context.tables = tables;
    row.context.stop = stop;
    row.context.lanes = lanes;
    for (uint32_t i = 0; i < interp::kMaxLanes / 64; ++i) {
      const int64_t n = std::clamp<int64_t>(int64_t(lanes) - 64 * int64_t(i), 0, 64);
      row.context.active[i] = n == 64 ? ~uint64_t(0) : (uint64_t(1) << n) - 1;
    }
  }

  //! Small work groups in common rows, one row after the other.
  void stream(uint64_t first, uint64_t count) const {
    Row row;
    for (uint64_t end = first + count; first < end && !stop->load(std::memory_order_relaxed);) {
      const uint32_t lanes = uint32_t(std::min<uint64_t>(end - first, interp::kMaxLanes));
      fill(row, first, lanes);
      routine.code->run(bank, row.context);
      first += lanes;
    }
  }

  //! One work group, whose rows wait for each other at barriers and give way in loops.
  void group(uint64_t index, GroupMemory& memory) const {
    const uint32_t rowCount = (invocations + interp::kMaxLanes - 1) / interp::kMaxLanes;
    if (!memory.rows) memory.rows = std::make_unique_for_overwrite<Row[]>(rowCount);
    memory.shared.assign(routine.sharedBytes + 64, std::byte(0));
    for (uint32_t r = 0; r < rowCount; ++r) {
      Row& row = memory.rows[r];
      fill(row, index * invocations + r * interp::kMaxLanes, std::min(invocations - r * interp::kMaxLanes, interp::kMaxLanes));
      row.context.shared = memory.shared.data();
      row.context.sharedBytes = routine.sharedBytes;
    }
    if (rowCount == 1) return routine.code->run(bank, memory.rows[0].context);

    using interp::Progress;
    struct Waiting {
      interp::RowState* state;
      Progress why;
    };
    Waiting waiting[kMaxGroupRows];
    uint32_t count = 0;
    for (uint32_t r = 0; r < rowCount; ++r) {
      if (memory.states.size() == count) memory.states.push_back(routine.code->newRowState());
      interp::RowState* state = memory.states[count].get();
      if (!state) {
        memory.states.pop_back();
        return base::logError("out of memory: a work group was not run");
      }
      // A row that finishes at once leaves its state to the next.
      const Progress p = routine.code->start(bank, memory.rows[r].context, *state);
      if (p != Progress::Finished) waiting[count++] = {state, p};
    }
    while (count) {
      const bool allAtBarrier = std::all_of(waiting, waiting + count, [](const Waiting& w) { return w.why == Progress::Barrier; });
      uint32_t left = 0;
      for (uint32_t r = 0; r < count; ++r) {
        Waiting w = waiting[r];
        if (allAtBarrier || w.why == Progress::Yielded) w.why = routine.code->resume(*w.state);
        if (w.why != Progress::Finished) waiting[left++] = w;
      }
      count = left;
    }
  }
};

}  // namespace

uint64_t groupInvocations(const ComputePipeline& pipeline) {
  const auto& size = pipeline.shader->localSize;
  return uint64_t(size[0]) * size[1] * size[2];
}

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
  fillTables(state.push, state.setMemory, state.setSize, state.pipeline->layout->sets.size(), constants, tables);
  const interp::UniformBank bank = routine->code->preamble(tables);

  const uint32_t invocations = routine->localSize[0] * routine->localSize[1] * routine->localSize[2];
  const LocalIds locals(routine->localSize, invocations);
  const DispatchRun run{*routine, bank, tables, {baseGroup[0], baseGroup[1], baseGroup[2]}, {groupCount[0], groupCount[1], groupCount[2]}, invocations, &pool.cancelled(), locals};
  const uint64_t groups = uint64_t(groupCount[0]) * groupCount[1] * groupCount[2];

  // Small work groups share rows unless they could notice: by shared memory, barriers, subgroup operations or waiting.
  const bool apart = routine->groupsApart;
  const uint64_t unit = apart ? invocations : uint64_t(kItemRows) * interp::kMaxLanes;
  const uint64_t total = groups * invocations, items = (total + unit - 1) / unit;
  std::vector<GroupMemory> memory(apart ? pool.workerCount() : 0);
  constexpr uint64_t kWave = 1u << 30;
  for (uint64_t done = 0; done < items; done += kWave) {
    pool.parallelFor(uint32_t(std::min(kWave, items - done)), [&](uint32_t i, unsigned worker) {
      if (apart) return run.group(done + i, memory[worker]);
      const uint64_t first = (done + i) * unit;
      run.stream(first, std::min(unit, total - first));
    });
  }
}

}  // namespace pumice::pipeline
