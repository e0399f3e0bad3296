// Random float programs without decisions, and what their steps may make of rounding errors.
#include "tests/support/near_oracle.h"

#include <cmath>
#include <cstdio>
#include <vector>

#include "base/fpenv.h"
#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/builder.h"

namespace pumice::testing {

using ir::Op, ir::Type, ir::Value;

namespace {

constexpr unsigned kInputs = 8, kOperations = 32, kLanes = interp::kMaxLanes;
constexpr double kUnit = 0x1p-24, kTiny = 0x1p-148;

struct Step {
  Op op;
  unsigned a, b, c;   // numbers of earlier values, inputs first
};

//! Bound of |f32 - exact| for a result r of operands x with bounds e. Not finite: nothing can be said.
double bound(Op op, double r, const double* x, const double* e) {
  const double rounding = std::fabs(r) * kUnit * 1.01 + kTiny;
  // Functions are good to a few units in the last place (docs/ulp.md), relative to the larger of result and 2^-20 for those that cross zero.
  const double function = std::fabs(r) * kUnit * 10 + 0x1p-40;
  switch (op) {
    case Op::FAdd:
    case Op::FSub: return e[0] + e[1] + rounding;
    case Op::FMul: return std::fabs(x[0]) * e[1] + std::fabs(x[1]) * e[0] + e[0] * e[1] + rounding;
    case Op::Fma: return std::fabs(x[0]) * e[1] + std::fabs(x[1]) * e[0] + e[0] * e[1] + e[2] + rounding;
    case Op::FDiv: return std::fabs(x[1]) > e[1] ? (e[0] + std::fabs(r) * e[1]) / (std::fabs(x[1]) - e[1]) * 1.01 + rounding : INFINITY;
    case Op::FNeg:
    case Op::FAbs: return e[0];
    case Op::FMin:
    case Op::FMax: return std::max(e[0], e[1]);
    case Op::FSqrt: return x[0] > e[0] ? e[0] / (2 * std::sqrt(x[0] - e[0])) + rounding : INFINITY;
    case Op::FExp2: return e[0] < 1 ? std::fabs(r) * e[0] * 1.5 + function : INFINITY;
    case Op::FLog2: return x[0] > 2 * e[0] ? e[0] / (x[0] - e[0]) * 1.5 + function + 0x1p-23 : INFINITY;
    case Op::FSin:
    case Op::FCos: return std::fabs(x[0]) < 1000 ? e[0] + function + 0x1p-22 : INFINITY;
    case Op::FTanh:
    case Op::FAtan: return e[0] + function + 0x1p-23;
    default: return INFINITY;
  }
}

constexpr Op kOps[] = {Op::FAdd, Op::FSub, Op::FMul, Op::Fma, Op::FDiv, Op::FNeg, Op::FAbs, Op::FMin, Op::FMax, Op::FSqrt,
                       Op::FExp2, Op::FLog2, Op::FSin, Op::FCos, Op::FTanh, Op::FAtan, Op::FAdd, Op::FMul, Op::Fma};

struct Rows {
  alignas(64) uint32_t words[kOperations][kLanes] = {};
};

std::string run(const ir::Function& f, ir::Numerics numerics, const uint32_t (&inputs)[kInputs][kLanes], Rows& rows) {
  const auto compiled = interp::compileInterpreterFor(f, {numerics, {}}, interp::defaultTarget());
  if (!compiled) return compiled.error().message;
  base::ScopedFpEnv environment;
  const void* in[kInputs];
  void* out[kOperations];
  for (unsigned k = 0; k < kInputs; k++) in[k] = inputs[k];
  for (unsigned k = 0; k < kOperations; k++) out[k] = rows.words[k];
  const interp::Table tables[ir::kTableCount] = {};
  interp::ExecContext c;
  c.lanes = kLanes;
  for (uint64_t& a : c.active) a = ~uint64_t(0);
  c.inputs = in;
  c.outputs = out;
  c.tables = tables;
  const interp::UniformBank bank = (*compiled)->preamble(tables);
  (*compiled)->run(bank, c);
  return {};
}

}  // namespace

std::string nearOracleProblem(Choices& r, NearOracleCounts& counts) {
  ir::Function f;
  ir::Builder b(f);
  std::vector<Value> list;
  for (unsigned k = 0; k < kInputs; k++) list.push_back(b.input(Type::F32, k));
  std::vector<Step> steps;
  for (unsigned k = 0; k < kOperations; k++) {
    auto one = [&] { return r.chance(60) ? uint32_t(list.size()) - 1 - r.below(std::min<uint32_t>(6, uint32_t(list.size()))) : r.below(uint32_t(list.size())); };
    Step s{r.of(kOps), 0, 0, 0};
    s.a = one(), s.b = one(), s.c = one();
    const unsigned count = ir::opInfo(s.op).operandCount;
    const Value v[] = {list[s.a], list[s.b], list[s.c]};
    list.push_back(b.emit(s.op, Type::F32, std::span<const Value>(v, count)));
    steps.push_back(s);
    b.output(k, list.back());
  }
  if (std::string problem = ir::verify(f); !problem.empty()) return problem;
  alignas(64) uint32_t inputs[kInputs][kLanes];
  for (auto& row : inputs)
    for (uint32_t& word : row) word = uint32_t(calmBits(r, Type::F32));
  Rows plain, oracle;
  if (std::string problem = run(f, ir::Numerics::F32, inputs, plain); !problem.empty()) return problem;
  if (std::string problem = run(f, ir::Numerics::Oracle, inputs, oracle); !problem.empty()) return problem;
  for (unsigned lane = 0; lane < kLanes; lane++) {
    std::vector<double> x, e;
    for (unsigned k = 0; k < kInputs; k++) {
      x.push_back(ir::floatValue(Type::F32, inputs[k][lane]));
      e.push_back(0);
    }
    for (unsigned k = 0; k < kOperations; k++) {
      const Step& s = steps[k];
      const double got = ir::floatValue(Type::F32, plain.words[k][lane]), exact = ir::floatValue(Type::F32, oracle.words[k][lane]);
      const double operands[] = {x[s.a], x[s.b], x[s.c]}, errors[] = {e[s.a], e[s.b], e[s.c]};
      const double most = bound(s.op, got, operands, errors);
      x.push_back(got);
      e.push_back(std::isfinite(got) && most < 1e30 ? most : INFINITY);
      counts.values++;
      if (!std::isfinite(e.back())) continue;
      counts.checked++;
      counts.sharp += most <= std::fabs(got) * 1e-4;
      counts.differ += got != exact;
      // The oracle's output is itself rounded to f32.
      if (std::fabs(got - exact) <= most + std::fabs(exact) * kUnit) continue;
      char text[160];
      std::snprintf(text, sizeof text, "lane %u, value %u (%s): %.9g, not %.9g (at most %.3g away)\n", lane, k, ir::opInfo(s.op).text, got, exact, most);
      return text + ir::print(f);
    }
  }
  return {};
}

}  // namespace pumice::testing
