#include "spirv_interp/jit/jit.h"

#include <alloca.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>

#include "base/env.h"
#include "base/log.h"
#include "spirv_interp/interpreter/scratch.h"
#include "spirv_interp/jit/code_memory.h"
#include "spirv_interp/jit/emitter.h"
#include "spirv_interp/jit/halves.h"
#include "spirv_interp/jit/invariants.h"
#include "spirv_interp/jit/order.h"
#include "spirv_interp/jit/quads.h"
#include "spirv_interp/jit/unroll.h"

namespace pumice::jit {
namespace {

using interp::ExecContext, interp::Executable, interp::Progress, interp::Result, interp::RowState, interp::Scratch, interp::UniformBank;

constexpr size_t kAlign = Scratch::kAlign;
constexpr size_t kMaxStackBytes = 96 * 1024;
constexpr uint32_t kLongestRow = 4096;   // of whole blocks
constexpr uint32_t kMaxChunks = interp::kMaxLanes / kVectorLanes;

std::byte* aligned(void* p) { return reinterpret_cast<std::byte*>((reinterpret_cast<uintptr_t>(p) + kAlign - 1) & ~uintptr_t(kAlign - 1)); }

thread_local Scratch scratch;   // for frames

std::atomic<uint64_t> emittedCount, refusedCount, operationCount, callOutCount, nanosecondCount;

uint64_t threadNanoseconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return uint64_t(t.tv_sec) * 1'000'000'000 + uint64_t(t.tv_nsec);
}

class Native final : public Executable {
 public:
  Native(Emitted e, CodeMemory code, uint64_t body, uint64_t preamble)
      : e_(std::move(e)),
        code_(std::move(code)),
        body_(reinterpret_cast<Entry>(reinterpret_cast<uintptr_t>(code_.data()) + body)),
        preamble_(reinterpret_cast<Entry>(reinterpret_cast<uintptr_t>(code_.data()) + preamble)),
        frameBytes_(frameStride(e_)) {
    static_assert(kAlign == 64);
    // Memory operands of the pool are whole vectors.
    poolMemory_ = std::make_unique<std::byte[]>(e_.pool.size() + kAlign);
    pool_ = aligned(poolMemory_.get());
    std::memcpy(pool_, e_.pool.data(), e_.pool.size());
    e_.pool = {};
  }

  UniformBank preamble(const interp::Table* tables, base::Arena* arena) const override {
    UniformBank bank = UniformBank::make((e_.bankKept + kAlign) / 8, arena);
    if (!e_.bankKept) return bank;
    alignas(kAlign) std::byte frame[kFrameSlots];
    const ExecContext none;
    ChunkCall call{};
    call.tables = tables;
    call.context = &none;
    // What only the preamble reads is not kept.
    std::byte* slots;
    if (e_.bankBytes <= kMaxStackBytes) slots = aligned(alloca(e_.bankBytes + kAlign));
    else if (!(slots = scratch.get(e_.bankBytes))) return base::logError("out of memory: values of a draw are zero"), std::move(bank);
    std::memset(slots, 0, e_.bankBytes);
    call.bank = slots;
    preamble_(frame, slots, &call, pool_);
    std::memcpy(aligned(bank.slots.get()), slots, e_.bankKept);
    return bank;
  }

  void run(const UniformBank& bank, const ExecContext& context) const override {
    if (e_.suspends) {
      Row row;
      row.memory = scratch.get(frameBytes_ * chunkCount(context));
      if (!row.memory) return base::logError("out of memory: %u lanes were not run", context.lanes);
      for (Progress p = start(bank, context, row); p != Progress::Finished; p = resume(row)) {}
      return;
    }
    std::byte* frame;
    if (frameBytes_ <= kMaxStackBytes) frame = aligned(alloca(frameBytes_ + kAlign));
    else if (!(frame = scratch.get(frameBytes_))) return base::logError("out of memory: %u lanes were not run", context.lanes);
    Records records;
    ChunkCall call;
    prepare(call, bank, context);
    if (e_.wholeBlocks) {
      call.lane0 = 0;
      call.active = uint32_t((uint64_t(1) << e_.chunkLanes) - 1);
      call.lanes = context.lanes;
      call.turns = kTurns;
      call.quadRecords = context.quadRecords;
      body_(frame, const_cast<std::byte*>(call.bank), &call, pool_);
      return;
    }
    for (uint32_t first = 0; first < context.lanes; first += e_.chunkLanes) runChunk(call, context, first, frame, records);
  }

  // The code counts lanes by itself; what it calls knows usual rows only.
  uint32_t longestRow() const override {
    return e_.wholeBlocks && e_.callOuts.empty() && e_.localAccesses.empty() ? kLongestRow : interp::kMaxLanes;
  }

  std::unique_ptr<RowState> newRowState() const override {
    auto row = std::make_unique<Row>();
    row->memory = row->own.get(frameBytes_ * (interp::kMaxLanes / e_.chunkLanes));
    return row->memory ? std::move(row) : nullptr;
  }
  Progress start(const UniformBank& bank, const ExecContext& context, RowState& state) const override {
    Row& row = static_cast<Row&>(state);
    row.bank = &bank;
    row.context = &context;
    row.count = chunkCount(context);
    for (uint32_t k = 0; k < row.count; k++) {
      std::memset(row.memory + k * frameBytes_ + kFrameResume, 0, 4);
      row.progress[k] = Progress::Yielded;
    }
    row.fresh = true;
    return advance(row);
  }
  Progress resume(RowState& state) const override { return advance(static_cast<Row&>(state)); }

  bool runsGroups() const override { return e_.groups; }
  void runGroup(const UniformBank& bank, const ExecContext& context) const override {
    const uint32_t chunks = context.lanes / e_.chunkLanes;
    const size_t bytes = e_.suspends ? frameBytes_ * chunks : frameBytes_;
    std::byte* frame;
    if (bytes <= kMaxStackBytes) frame = aligned(alloca(bytes + kAlign));
    else if (!(frame = scratch.get(bytes))) return base::logError("out of memory: a work group was not run");
    ChunkCall call;
    prepare(call, bank, context);
    call.lane0 = 0;
    call.active = uint32_t((uint64_t(1) << e_.chunkLanes) - 1);
    call.turns = kTurns;
    call.chunks = call.chunksLeft = chunks;
    call.waiting = 0;
    call.firstFrame = frame;
    call.local = frame + e_.frameBytes;
    for (uint32_t k = 0; k < chunks && e_.suspends; k++) {
      std::memset(frame + k * frameBytes_ + kFrameResume, 0, 4);
      std::memset(frame + k * frameBytes_ + e_.frameBytes, 0, e_.localBytes);
    }
    body_(frame, const_cast<std::byte*>(call.bank), &call, pool_);
  }

  size_t instructionCount() const override { return e_.operations; }
  size_t preambleInstructionCount() const override { return e_.preambleOperations; }
  size_t registerBytes() const override { return e_.frameBytes; }

 private:
  //! A row with one frame and one state for each chunk.
  struct Row final : RowState {
    Scratch own;
    std::byte* memory = nullptr;
    const UniformBank* bank = nullptr;
    const ExecContext* context = nullptr;
    uint32_t count = 0;
    bool fresh = true;
    Progress progress[kMaxChunks];
  };
  //! The last chunk's quads, if the row ends within it.
  struct Records {
    const std::byte* quad[8];
  };

  uint32_t chunkCount(const ExecContext& c) const { return (c.lanes + e_.chunkLanes - 1) / e_.chunkLanes; }

  void prepare(ChunkCall& call, const UniformBank& bank, const ExecContext& context) const {
    call.inputs = context.inputs;
    call.outputs = context.outputs;
    call.tables = context.tables;
    call.tilePlanes = context.tilePlanes;
    call.shared = context.shared;
    call.sharedBytes = context.shared ? context.sharedBytes : 0;
    call.context = &context;
    call.stop = context.stop;
    call.bank = aligned(bank.slots.get());
  }

  Progress runChunk(ChunkCall& call, const ExecContext& context, uint32_t first, std::byte* frame, Records& records, bool fresh = true) const {
    const uint64_t width = (uint64_t(1) << e_.chunkLanes) - 1;
    uint64_t active = context.active[first >> 6] >> (first & 63) & width;
    const uint32_t left = context.lanes - first;
    if (left < e_.chunkLanes) active &= (uint64_t(1) << left) - 1;
    if (!active) return Progress::Finished;
    call.active = uint32_t(active);
    call.lane0 = first;
    call.turns = kTurns;
    call.chunksLeft = 1;
    call.waiting = 0;
    call.firstFrame = nullptr;
    call.local = frame + e_.frameBytes;
    if (context.quadRecords) {
      call.quadRecords = context.quadRecords + first / 4;
      if (left < e_.chunkLanes && left >= 4) {
        for (uint32_t q = 0; q < 8; q++) records.quad[q] = call.quadRecords[std::min(q, left / 4 - 1)];
        call.quadRecords = records.quad;
      }
    }
    if (fresh && e_.localBytes) std::memset(call.local, 0, e_.localBytes);
    return Progress(body_(frame, const_cast<std::byte*>(call.bank), &call, pool_));
  }

  //! Those that gave way go on; if there are none, those at the barrier do.
  Progress advance(Row& row) const {
    Records records;
    ChunkCall call;
    prepare(call, *row.bank, *row.context);
    Progress which = Progress::Barrier;
    for (uint32_t k = 0; k < row.count; k++)
      if (row.progress[k] == Progress::Yielded) which = Progress::Yielded;
    for (uint32_t k = 0; k < row.count; k++)
      if (row.progress[k] == which)
        row.progress[k] = runChunk(call, *row.context, k * e_.chunkLanes, row.memory + k * frameBytes_, records, row.fresh);
    row.fresh = false;
    if (row.context->stop && row.context->stop->load(std::memory_order_relaxed)) return Progress::Finished;
    Progress result = Progress::Finished;
    for (uint32_t k = 0; k < row.count; k++) {
      if (row.progress[k] == Progress::Yielded) return Progress::Yielded;
      if (row.progress[k] == Progress::Barrier) result = Progress::Barrier;
    }
    return result;
  }

  Emitted e_;
  CodeMemory code_;
  Entry body_, preamble_;
  size_t frameBytes_;
  std::unique_ptr<std::byte[]> poolMemory_;
  std::byte* pool_;
};

//! perf finds names of code without a file in /tmp/perf-PID.map: address, size, name.
void writePerfMap(const std::byte* code, size_t size, const std::string& name) {
  static const bool wanted = base::envFlag(base::EnvVar::PerfMap, false);
  if (!wanted) return;
  static std::mutex mutex;
  std::lock_guard lock(mutex);
  const std::string path = "/tmp/perf-" + std::to_string(getpid()) + ".map";
  if (std::FILE* file = std::fopen(path.c_str(), "a")) {
    std::fprintf(file, "%llx %zx pumice:%s\n", static_cast<unsigned long long>(reinterpret_cast<uintptr_t>(code)), size, name.c_str());
    std::fclose(file);
  }
}

//! The best that there is, unless PUMICE_ISA forces the kernels, and so the emitter, to less.
bool wantsAvx512(Isa isa) {
  static const bool best = runs(Isa::Avx512) && std::string_view(interp::defaultTarget().name) == "AVX3";
  return isa == Isa::Best ? best : isa == Isa::Avx512;
}

Result<std::unique_ptr<Executable>> emit(const ir::Function& source, const interp::CompileOptions& options, const JitOptions& jit) {
  ir::Function f = source;
  const bool avx512 = wantsAvx512(jit.isa);
  ir::lowerMath(f, options.numerics, options.numerics == ir::Numerics::F32 && !avx512);
  if (options.numerics == ir::Numerics::Oracle) ir::widenFloats(f);
  bool rates = widenHalves(f);   // else lowerMath has
  if (!f.groupSize[0] && options.numerics == ir::Numerics::F32) rates |= hoistInvariants(f);
  if (rates) ir::computeRates(f);
  if (jit.wholeBlocks) computeWhenNeeded(f);
  shareAmongQuads(f);
  const bool unrolled = f.groupSize[0] && unrollLoops(f);
  if (unrolled) ir::computeRates(f);
  std::vector<LanePattern> patterns = findPatterns(f, unrolled);
  Plan plan = makePlan(f, jit.chunkLanes, jit.wholeBlocks, avx512 ? kRegistersAvx512 : kRegistersAvx2, std::move(patterns));
  plan.upperFirst = jit.upperFirst;
  allocate(plan);

  asmjit::CodeHolder holder;
  holder.init(asmjit::Environment::host());
  asmjit::StringLogger logger;
  if (jit.listing) holder.setLogger(&logger);
  Emitter emitter(plan, holder, interp::kernelTable(interp::defaultTarget()));
  Emitted e;
  asmjit::Label body, preamble;
  std::string error = emitter.run(e, body, preamble);
  if (jit.listing) *jit.listing = logger.data();
  if (error.empty() && (holder.flatten() || holder.resolveUnresolvedLinks())) error = "labels out of reach";
  if (!error.empty()) return base::errorf("%s: %s", f.name.c_str(), error.c_str());
  const asmjit::CodeBuffer& buffer = holder.textSection()->buffer();
  Result<CodeMemory> code = CodeMemory::make({reinterpret_cast<const std::byte*>(buffer.data()), buffer.size()});
  if (!code) return std::move(code).error();
  writePerfMap(code->data(), buffer.size(), f.name);
  operationCount += e.operations + e.preambleOperations;
  callOutCount += e.callOuts.size() + e.localAccesses.size();
  return std::unique_ptr<Executable>(
      std::make_unique<Native>(std::move(e), std::move(code).value(), holder.labelOffset(body), holder.labelOffset(preamble)));
}

}  // namespace

bool available() {
  static const bool yes = [] {
    const auto& features = asmjit::CpuInfo::host().features().x86();
    const std::string_view target = interp::defaultTarget().name;
    return features.hasAVX2() && features.hasFMA() && features.hasF16C() && features.hasBMI() && (target == "AVX2" || target == "AVX3");
  }();
  return yes;
}

bool runs(Isa isa) {
  const auto& features = asmjit::CpuInfo::host().features().x86();
  if (isa != Isa::Avx512) return available();
  return available() && features.hasAVX512_F() && features.hasAVX512_VL() && features.hasAVX512_DQ() && features.hasAVX512_BW();
}

Result<std::unique_ptr<Executable>> compile(const ir::Function& f, const interp::CompileOptions& options, const JitOptions& jit) {
  if (!available()) return base::errorf("this processor has no AVX2, FMA and F16C, or PUMICE_ISA forbids them");
  const uint64_t begun = threadNanoseconds();
  auto result = emit(f, options, jit);
  nanosecondCount += threadNanoseconds() - begun;
  ++(result ? emittedCount : refusedCount);
  return result;
}

Statistics statistics() { return {emittedCount, refusedCount, operationCount, callOutCount, nanosecondCount}; }

}  // namespace pumice::jit
