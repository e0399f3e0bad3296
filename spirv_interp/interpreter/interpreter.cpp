#include <alloca.h>

#include <cstring>
#include <memory>

#include "base/log.h"
#include "spirv_interp/interpreter/lower.h"
#include "spirv_interp/interpreter/scratch.h"

namespace pumice::interp {
namespace {

constexpr size_t kAlign = Scratch::kAlign;
constexpr size_t kMaxStackBytes = 96 * 1024;

//! For register files and local memory.
thread_local Scratch scratch;

inline bool stopped(const RunState& s) { return s.context->stop && s.context->stop->load(std::memory_order_relaxed); }

constexpr uint32_t kTurns = 256;   //!< of a loop, before a row gives way

//! Until the end, a barrier, or a loop's turns are used up.
void execute(RunState& s) {
  s.turns = kTurns;
  s.atBarrier = false;
  const Code* c = s.next;
  while (c) c = c->run(s, c);
}

void activate(RunState& s, uint32_t lanes, const uint64_t* active) {
  s.lanes = lanes;
  s.rounded = (lanes + 15) & ~15u;
  for (unsigned w = 0; w < kMaskWords; w++) {
    const uint32_t before = w * 64;
    s.all[w] = lanes <= before ? 0 : lanes - before >= 64 ? ~uint64_t(0) : (uint64_t(1) << (lanes - before)) - 1;
    s.exec[w] = active[w] & s.all[w];
  }
}

class Interpreted final : public Executable {
 public:
  explicit Interpreted(Program p) : p_(std::move(p)) {}

  UniformBank preamble(const Table* tables, base::Arena* arena) const override {
    UniformBank bank = UniformBank::make(p_.slots + 1, arena);
    for (const Program::Constant& c : p_.constants) bank.slots[c.slot] = c.bits;
    if (p_.preamble.size() <= 1) return bank;
    const uint64_t active[kMaskWords] = {1};
    const ExecContext none;
    RunState s;
    activate(s, 1, active);
    s.registers = scratch.get(p_.preambleRegisters + kAlign);
    if (!s.registers) return bank;
    s.uniforms = reinterpret_cast<const std::byte*>(bank.slots.get());
    s.local = nullptr;
    s.bankOut = bank.slots.get();
    s.tables = tables;
    s.context = &none;
    s.next = p_.preamble.data();
    execute(s);   // no loops
    return bank;
  }

  void run(const UniformBank& bank, const ExecContext& context) const override {
    RunState s;
    activate(s, context.lanes, context.active);
    if (s.none()) return;
    const size_t bytes = p_.bodyRegisters + p_.localBytes + kAlign;
    if (bytes <= kMaxStackBytes) {
      void* memory = alloca(bytes);
      s.registers = reinterpret_cast<std::byte*>((reinterpret_cast<uintptr_t>(memory) + kAlign - 1) & ~uintptr_t(kAlign - 1));
    } else {
      s.registers = scratch.get(bytes);
      if (!s.registers) return base::logError("out of memory: %u lanes were not run", context.lanes);
    }
    begin(s, bank, context);
    do execute(s);
    while (s.next && !stopped(s));
  }

  std::unique_ptr<RowState> newRowState() const override {
    auto row = std::make_unique<Row>();
    row->state.registers = row->memory.get(p_.bodyRegisters + p_.localBytes + kAlign);
    return row->state.registers ? std::move(row) : nullptr;
  }
  Progress start(const UniformBank& bank, const ExecContext& context, RowState& row) const override {
    RunState& s = static_cast<Row&>(row).state;
    activate(s, context.lanes, context.active);
    if (s.none()) return Progress::Finished;
    begin(s, bank, context);
    return advance(s);
  }
  Progress resume(RowState& row) const override { return advance(static_cast<Row&>(row).state); }

  size_t instructionCount() const override { return p_.body.size(); }
  size_t preambleInstructionCount() const override { return p_.preamble.size(); }
  size_t registerBytes() const override { return p_.bodyRegisters; }

 private:
  struct Row final : RowState {
    Scratch memory;
    RunState state;
  };

  void begin(RunState& s, const UniformBank& bank, const ExecContext& context) const {
    s.uniforms = reinterpret_cast<const std::byte*>(bank.slots.get());
    s.local = s.registers + p_.bodyRegisters;
    s.bankOut = nullptr;
    s.tables = context.tables;
    s.context = &context;
    s.next = p_.body.data();
  }
  Progress advance(RunState& s) const {
    do execute(s);
    while (s.next && !s.atBarrier && !p_.mayWait && !stopped(s));
    if (stopped(s)) s.next = nullptr;
    return !s.next ? Progress::Finished : s.atBarrier ? Progress::Barrier : Progress::Yielded;
  }

  Program p_;
};

}  // namespace

Result<std::unique_ptr<Executable>> compileInterpreterWith(const ir::Function& source, const CompileOptions& options, const KernelTable& kernels) {
  ir::Function f = source;
  ir::lowerMath(f, options.numerics);
  if (options.numerics == ir::Numerics::Oracle) ir::widenFloats(f);
  ir::computeRates(f);
  Result<Program> program = lower(f, kernels, options.checked);
  if (!program) return std::move(program).error();
  return std::unique_ptr<Executable>(std::make_unique<Interpreted>(std::move(program).value()));
}

Result<std::unique_ptr<Executable>> compileInterpreterFor(const ir::Function& f, const CompileOptions& options, const Target& target) {
  return compileInterpreterWith(f, options, kernelTable(target));
}

Result<std::unique_ptr<Executable>> compileInterpreter(const ir::Function& f, const CompileOptions& options) {
  return compileInterpreterFor(f, options, defaultTarget());
}

}  // namespace pumice::interp
