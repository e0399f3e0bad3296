// Compute: invocations in rows, parallel over work groups.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <utility>

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

  //! The same, for rows that do not reach into another group, in a row that has held the same invocations of another one before:
  //! `group` is its number, or ~0.
  void refill(Row& row, uint64_t first, uint32_t lanes, uint64_t& group) const {
    const uint64_t before = std::exchange(group, first / invocations);
    if (before == ~uint64_t(0)) return fill(row, first, lanes);
    const uint32_t id[3] = {uint32_t(group % groupCount[0]), uint32_t(group / groupCount[0] % groupCount[1]), uint32_t(group / groupCount[0] / groupCount[1])};
    for (int i = 0; i < 3; ++i)
      if (row.ids[3 + i][0] != baseGroup[i] + id[i]) std::fill_n(row.ids[3 + i], lanes, baseGroup[i] + id[i]);
  }

  //! Small work groups in common rows, one row after the other.
  void stream(uint64_t first, uint64_t count) const {
    const uint32_t rowCount = invocations / interp::kMaxLanes;
    if (invocations % interp::kMaxLanes == 0 && rowCount <= 2) {
      // Each row of a group in its own place.
      Row rows[2];
      uint64_t groups[2] = {~uint64_t(0), ~uint64_t(0)};
      for (uint64_t end = first + count; first < end && !stop->load(std::memory_order_relaxed); first += interp::kMaxLanes) {
        const uint32_t r = uint32_t(first / interp::kMaxLanes % rowCount);
        refill(rows[r], first, interp::kMaxLanes, groups[r]);
        routine.code->run(bank, rows[r].context);
      }
      return;
    }
    Row row;
    for (uint64_t end = first + count; first < end && !stop->load(std::memory_order_relaxed);) {
      const uint32_t lanes = uint32_t(std::min<uint64_t>(end - first, interp::kMaxLanes));
      fill(row, first, lanes);
      routine.code->run(bank, row.context);
      first += lanes;
    }
  }
};

//! Work groups that do not share rows, one after the other in the same memory. Rows wait for each other at barriers and
//! give way in loops.
class Group {
 public:
  //! Begins work group `index`.
  void begin(const DispatchRun& run, uint64_t index) {
    run_ = &run;
    const uint32_t invocations = run.invocations, rowCount = (invocations + interp::kMaxLanes - 1) / interp::kMaxLanes;
    if (!rows_) {
      rows_ = std::make_unique_for_overwrite<Row[]>(rowCount);
      held_.assign(rowCount, ~uint64_t(0));
    }
    shared_.assign(run.routine.sharedBytes + 64, std::byte(0));
    for (uint32_t r = 0; r < rowCount; ++r) {
      Row& row = rows_[r];
      run.refill(row, index * invocations + r * interp::kMaxLanes, std::min(invocations - r * interp::kMaxLanes, interp::kMaxLanes), held_[r]);
      row.context.shared = shared_.data();
      row.context.sharedBytes = run.routine.sharedBytes;
    }
    count_ = 0;
    if (rowCount == 1 && !run.routine.waits) return run.routine.code->run(run.bank, rows_[0].context);
    for (uint32_t r = 0; r < rowCount; ++r) {
      if (states_.size() == count_) states_.push_back(run.routine.code->newRowState());
      interp::RowState* state = states_[count_].get();
      if (!state) {
        states_.pop_back();
        return base::logError("out of memory: a work group was not run");
      }
      // A row that finishes at once leaves its state to the next.
      const Progress p = run.routine.code->start(run.bank, rows_[r].context, *state);
      if (p != Progress::Finished) waiting_[count_++] = {state, p};
    }
  }
  bool finished() const { return !count_; }
  //! Each row that can go on does, until it gives way.
  void proceed() {
    const bool allAtBarrier = std::all_of(waiting_, waiting_ + count_, [](const Waiting& w) { return w.why == Progress::Barrier; });
    uint32_t left = 0;
    for (uint32_t r = 0; r < count_; ++r) {
      Waiting w = waiting_[r];
      if (allAtBarrier || w.why == Progress::Yielded) w.why = run_->routine.code->resume(*w.state);
      if (w.why != Progress::Finished) waiting_[left++] = w;
    }
    count_ = left;
  }

 private:
  using Progress = interp::Progress;
  struct Waiting {
    interp::RowState* state;
    Progress why;
  };
  const DispatchRun* run_ = nullptr;
  std::vector<std::byte> shared_;
  std::unique_ptr<Row[]> rows_;
  std::vector<uint64_t> held_;   // by row: the group that its ids are of
  std::vector<std::unique_ptr<interp::RowState>> states_;   // as many as rows had to wait at once
  Waiting waiting_[kMaxGroupRows];
  uint32_t count_ = 0;
};

//! Whole work groups in one call each, where the routine can.
class WholeGroups {
 public:
  //! Work groups [first, first + count).
  void run(const DispatchRun& run, uint64_t first, uint64_t count) {
    prepare(run);
    uint64_t x = first % run.groupCount[0], y = first / run.groupCount[0] % run.groupCount[1], z = first / run.groupCount[0] / run.groupCount[1];
    for (uint64_t k = 0; k < count && !run.stop->load(std::memory_order_relaxed); ++k) {
      setId(run, 0, uint32_t(x));
      setId(run, 1, uint32_t(y));
      setId(run, 2, uint32_t(z));
      if (!shared_.empty()) std::memset(shared_.data(), 0, shared_.size());
      run.routine.code->runGroup(run.bank, context_);
      if (++x < run.groupCount[0]) continue;
      x = 0;
      if (++y < run.groupCount[1]) continue;
      y = 0;
      ++z;
    }
  }

 private:
  static constexpr uint32_t kStep = 8;   // of ids' elements that are looked at

  void prepare(const DispatchRun& run) {
    if (context_.inputs) return;
    if (run.routine.sharedBytes) shared_.resize(run.routine.sharedBytes + 64);
    for (int i = 0; i < 3; ++i) {
      inputs_[i] = run.locals.ids[i].data();
      ids_[i].assign(run.invocations, run.baseGroup[i]);
      inputs_[3 + i] = ids_[i].data();
    }
    context_.inputs = inputs_;
    context_.tables = run.tables;
    context_.stop = run.stop;
    context_.lanes = run.invocations;
    context_.shared = shared_.empty() ? nullptr : shared_.data();
    context_.sharedBytes = run.routine.sharedBytes;
  }
  void setId(const DispatchRun& run, int i, uint32_t relative) {
    const uint32_t id = run.baseGroup[i] + relative;
    if (ids_[i][0] == id) return;
    for (uint32_t l = 0; l < run.invocations; l += kStep) ids_[i][l] = id;
  }

  interp::ExecContext context_;
  const void* inputs_[6] = {};
  std::vector<uint32_t> ids_[3];
  std::vector<std::byte> shared_;
};

//! Work groups that may wait for other work groups, whichever: one that keeps giving way lets another begin.
void runWaiting(const DispatchRun& run, std::atomic<uint64_t>& next, uint64_t groups) {
  constexpr size_t kMost = 4096;        // begun and not finished, of one worker
  constexpr uint32_t kPatience = 64;    // rounds of all groups without one that finishes; less with more groups
  std::vector<std::unique_ptr<Group>> begun, spare;
  for (uint32_t rounds = 0;; ++rounds) {
    if (begun.empty() || (begun.size() < kMost && rounds >= kPatience >> std::min<size_t>(begun.size(), 6))) {
      const uint64_t index = run.stop->load(std::memory_order_relaxed) ? groups : next.fetch_add(1, std::memory_order_relaxed);
      if (index < groups) {
        if (spare.empty()) spare.push_back(std::make_unique<Group>());
        begun.push_back(std::move(spare.back()));
        spare.pop_back();
        begun.back()->begin(run, index);
        rounds = 0;
      } else if (begun.empty()) {
        return;
      }
    }
    for (size_t i = 0; i < begun.size();) {
      if (!begun[i]->finished()) begun[i]->proceed();
      if (!begun[i]->finished()) {
        ++i;
        continue;
      }
      spare.push_back(std::move(begun[i]));
      begun[i] = std::move(begun.back());
      begun.pop_back();
      rounds = 0;
    }
  }
}

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
  fillTables(state.push, state.setMemory, state.setSize, state.pipeline->layout->sets.size(), std::as_bytes(std::span(&constants, 1)), tables);
  const interp::UniformBank bank = routine->code->preamble(tables);

  const uint32_t invocations = routine->localSize[0] * routine->localSize[1] * routine->localSize[2];
  const LocalIds locals(routine->localSize, invocations);
  const DispatchRun run{*routine, bank, tables, {baseGroup[0], baseGroup[1], baseGroup[2]}, {groupCount[0], groupCount[1], groupCount[2]}, invocations, &pool.cancelled(), locals};
  const uint64_t groups = uint64_t(groupCount[0]) * groupCount[1] * groupCount[2];

  // Small work groups share rows unless they could notice: by shared memory, barriers, subgroup operations or waiting.
  const bool apart = routine->groupsApart;
  const uint64_t unit = apart ? invocations : uint64_t(kItemRows) * interp::kMaxLanes;
  const uint64_t total = groups * invocations, items = (total + unit - 1) / unit;
  if (routine->waits) {
    std::atomic<uint64_t> next = 0;
    return pool.parallelFor(uint32_t(std::min<uint64_t>(groups, pool.workerCount())), [&](uint32_t, unsigned) { runWaiting(run, next, groups); });
  }
  if (routine->code->runsGroups()) {
    // Neighbours go to one worker, as long as there is enough for all of them.
    constexpr uint64_t kMostInvocations = 1 << 16, kPieces = 16;
    const uint64_t most = std::max<uint64_t>(1, kMostInvocations / invocations);
    const uint64_t piece = std::clamp<uint64_t>(groups / (kPieces * pool.workerCount()), 1, most), pieces = (groups + piece - 1) / piece;
    std::vector<WholeGroups> workers(pool.workerCount());
    constexpr uint64_t kWave = 1u << 30;
    for (uint64_t done = 0; done < pieces; done += kWave)
      pool.parallelFor(uint32_t(std::min(kWave, pieces - done)), [&](uint32_t i, unsigned worker) {
        const uint64_t first = (done + i) * piece;
        workers[worker].run(run, first, std::min(piece, groups - first));
      });
    return;
  }
  std::vector<Group> memory(apart ? pool.workerCount() : 0);
  constexpr uint64_t kWave = 1u << 30;
  for (uint64_t done = 0; done < items; done += kWave) {
    pool.parallelFor(uint32_t(std::min(kWave, items - done)), [&](uint32_t i, unsigned worker) {
      if (apart) {
        Group& group = memory[worker];
        for (group.begin(run, done + i); !group.finished();) group.proceed();
        return;
      }
      const uint64_t first = (done + i) * unit;
      run.stream(first, std::min(unit, total - first));
    });
  }
}

}  // namespace pumice::pipeline
