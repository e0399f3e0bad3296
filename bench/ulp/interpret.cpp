#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/fpenv.h"
#include "bench/ulp/runners.h"
#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/fold.h"

namespace pumice::ulp {

using interp::kMaxLanes;
using ir::Builder, ir::Type, ir::Value;

namespace {

class Lanes {
 public:
  //! f null: a copy.
  Lanes(const Function* f, Type type) : bytes_(typeBytes(type)) {
    ir::Function code;
    Builder b(code);
    const Value in[] = {b.input(type, 0), b.input(type, 1)};
    b.output(0, f ? b.emit(f->op, type, std::span<const Value>(in, f->arguments)) : in[0]);
    auto compiled = interp::compileInterpreter(code, {});
    if (!compiled) return;
    executable_ = std::move(compiled).value();
    bank_ = executable_->preamble(tables_);
    context_.lanes = kMaxLanes;
    context_.active[0] = context_.active[1] = ~uint64_t(0);
    context_.inputs = inputs_;
    context_.outputs = outputs_;
    context_.tables = tables_;
  }
  bool valid() const { return executable_ != nullptr; }
  void set(unsigned input, unsigned lane, uint64_t bits) {
    std::memcpy(rows_[input] + lane * bytes_, &bits, bytes_);
  }
  uint64_t get(unsigned lane) const {
    uint64_t bits = 0;
    std::memcpy(&bits, out_ + lane * bytes_, bytes_);
    return bits;
  }
  void run() { executable_->run(bank_, context_); }

 private:
  size_t bytes_;
  alignas(64) std::byte rows_[2][kMaxLanes * 8] = {};
  alignas(64) std::byte out_[kMaxLanes * 8] = {};
  const void* inputs_[2] = {rows_[0], rows_[1]};
  void* outputs_[1] = {out_};
  interp::Tables tables_ = {};
  interp::ExecContext context_;
  interp::UniformBank bank_;
  std::unique_ptr<interp::Executable> executable_;
};

double nanosecondsOf(Lanes& lanes) {
  constexpr unsigned kRuns = 400;
  double least = INFINITY;
  for (unsigned batch = 0; batch < 120; ++batch) {
    const double start = processorTime();
    for (unsigned n = 0; n < kRuns; ++n) lanes.run();
    least = std::min(least, processorTime() - start);
  }
  return least / kRuns / kMaxLanes;
}

}  // namespace

std::vector<double> interpret(const Function& f, Type type, const Inputs& inputs) {
  const auto lanes = std::make_unique<Lanes>(&f, type);
  if (!lanes->valid()) return {};
  base::ScopedFpEnv environment;
  std::vector<double> results(inputs.x.size());
  for (size_t first = 0; first < results.size(); first += kMaxLanes) {
    const size_t count = std::min<size_t>(kMaxLanes, results.size() - first);
    for (unsigned k = 0; k < count; ++k) {
      lanes->set(0, k, ir::floatBits(type, inputs.x[first + k]));
      if (!inputs.y.empty()) lanes->set(1, k, ir::floatBits(type, inputs.y[first + k]));
    }
    lanes->run();
    for (unsigned k = 0; k < count; ++k) results[first + k] = ir::floatValue(type, lanes->get(k));
  }
  return results;
}

double interpreterNanoseconds(const Function& f, Type type) {
  base::ScopedFpEnv environment;
  const auto call = std::make_unique<Lanes>(&f, type), copy = std::make_unique<Lanes>(nullptr, type);
  if (!call->valid() || !copy->valid()) return 0;
  for (auto* lanes : {call.get(), copy.get()})
    for (unsigned k = 0; k < kMaxLanes; ++k)
      for (unsigned input : {0u, 1u})
        lanes->set(input, k, ir::floatBits(type, (f.op == ir::Op::FAcosh ? 1.1 : 0.1) + 0.8 * k / kMaxLanes));
  return std::max(0.0, nanosecondsOf(*call) - nanosecondsOf(*copy));
}

}  // namespace pumice::ulp
