#include "pipeline/each_row.h"

namespace pumice::pipeline {
namespace {

using interp::ExecContext, interp::Progress, interp::RowState, interp::UniformBank;

class EachRow final : public interp::Executable {
 public:
  explicit EachRow(std::unique_ptr<interp::Executable> routine) : routine_(std::move(routine)) {}
  UniformBank preamble(const interp::Table*, base::Arena*) const override { return {}; }
  void run(const UniformBank&, const ExecContext& context) const override { routine_->run(routine_->preamble(context.tables), context); }
  std::unique_ptr<RowState> newRowState() const override {
    auto state = std::make_unique<State>();
    state->row = routine_->newRowState();
    if (!state->row) return nullptr;
    return state;
  }
  Progress start(const UniformBank&, const ExecContext& context, RowState& row) const override {
    State& state = static_cast<State&>(row);
    state.bank = routine_->preamble(context.tables);
    return routine_->start(state.bank, context, *state.row);
  }
  Progress resume(RowState& row) const override { return routine_->resume(*static_cast<State&>(row).row); }
  size_t instructionCount() const override { return routine_->instructionCount(); }
  size_t preambleInstructionCount() const override { return routine_->preambleInstructionCount(); }
  size_t registerBytes() const override { return routine_->registerBytes(); }

 private:
  struct State final : RowState {
    std::unique_ptr<RowState> row;
    UniformBank bank;
  };
  std::unique_ptr<interp::Executable> routine_;
};

}  // namespace

std::unique_ptr<interp::Executable> preambleEachRow(std::unique_ptr<interp::Executable> routine) {
  return std::make_unique<EachRow>(std::move(routine));
}

}  // namespace pumice::pipeline
