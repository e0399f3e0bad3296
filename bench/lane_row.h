// A row of lanes for the benchmarks of the executors, and the loop of arithmetic that both measure.
#pragma once

#include <benchmark/benchmark.h>

#include <cstring>

#include "base/fpenv.h"
#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/builder.h"

namespace pumice::interp {

//! Eight inputs of f32 (or 64-bit numbers of some sort), one output, sixteen f32 of the draw.
struct LaneRow {
  alignas(64) std::byte rows[8][kMaxLanes * 8];
  alignas(64) std::byte out[kMaxLanes * 8];
  const void* inputs[8];
  void* outputs[1] = {out};
  Table tables[ir::kTableCount] = {};
  float uniforms[16];
  ExecContext context;

  LaneRow() {
    for (unsigned k = 0; k < 8; k++) {
      inputs[k] = rows[k];
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const float x = 1.0f + float(lane * 3 + k) * 0x1p-7f;
        std::memcpy(rows[k] + 4 * lane, &x, 4);
      }
      std::memcpy(rows[k] + 4 * kMaxLanes, rows[k], 4 * kMaxLanes);
    }
    for (unsigned k = 0; k < 16; k++) uniforms[k] = 0.5f + 0.01f * float(k);
    tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), sizeof uniforms};
    context.lanes = kMaxLanes;
    context.active[0] = context.active[1] = ~uint64_t(0);
    context.inputs = inputs;
    context.outputs = outputs;
    context.tables = tables;
  }
  LaneRow(const LaneRow&) = delete;
  LaneRow& operator=(const LaneRow&) = delete;

  const float* floats(unsigned k) const { return reinterpret_cast<const float*>(rows[k]); }
  float* result() { return reinterpret_cast<float*>(out); }

  //! `operations`: how many of the interesting kind a lane executes in a run.
  void measure(benchmark::State& state, const Executable& e, double operations) {
    base::ScopedFpEnv environment;
    const UniformBank bank = e.preamble(tables);
    for (auto _ : state) {
      e.run(bank, context);
      benchmark::ClobberMemory();
    }
    count(state, operations);
  }
  void count(benchmark::State& state, double operations) const {
    state.counters["per_lane_op"] =
        benchmark::Counter(operations * context.lanes, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  }
};

constexpr unsigned kLoopIterations = 64;
constexpr double kLoopOperations = kLoopIterations * 12;

//! x, y, z of a map iterated 64 times: 12 operations an iteration.
inline ir::Function loopFunction() {
  using ir::Type, ir::Value;
  ir::Function f;
  ir::Builder b(f);
  const Value a = b.uniform(Type::F32, 4), c = b.uniform(Type::F32, 8);
  const Value i = b.var(Type::I32);
  Value v[3];
  for (unsigned k = 0; k < 3; k++) {
    v[k] = b.var(Type::F32);
    b.set(v[k], b.input(Type::F32, k));
  }
  b.beginLoop();
  const Value n = b.get(i);
  b.beginIf(b.ule(b.i32(kLoopIterations), n));
  b.breakOut(0);
  b.endIf();
  const Value x = b.get(v[0]), y = b.get(v[1]), z = b.get(v[2]);
  const Value x2 = b.fadd(b.fmul(x, a), b.fmul(y, z));
  const Value y2 = b.fma(y, c, b.fmin(x2, b.f32(1)));
  const Value z2 = b.fmul(b.fsub(z, y2), b.fmax(b.fmul(x2, c), a));
  b.set(v[0], b.fmul(x2, c));
  b.set(v[1], y2);
  b.set(v[2], b.fadd(z2, x));
  b.set(i, b.iadd(n, b.i32(1)));
  b.endLoop();
  b.output(0, b.fadd(b.fadd(b.get(v[0]), b.get(v[1])), b.get(v[2])));
  return f;
}

}  // namespace pumice::interp
