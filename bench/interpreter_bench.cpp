// What an operation of the interpreter costs: nanoseconds per lane and operation, for rows of several
// lengths; and a loop of arithmetic against the same program in C++.
#include <benchmark/benchmark.h>

#include <bit>
#include <cstring>
#include <string>

#include "base/fpenv.h"
#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/builder.h"

namespace pumice::interp {
namespace {

using ir::Builder, ir::Function, ir::Op, ir::Type, ir::Value;

struct Bench {
  alignas(64) std::byte rows[8][kMaxLanes * 8];
  alignas(64) std::byte out[kMaxLanes * 8];
  const void* inputs[8];
  void* outputs[1] = {out};
  Table tables[ir::kTableCount] = {};
  float uniforms[16];
  ExecContext context;

  Bench() {
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

  //! `operations`: how many of the interesting kind a lane executes in a run.
  void measure(benchmark::State& state, const Function& f, double operations) {
    auto compiled = compileInterpreter(f, {});
    if (!compiled) return state.SkipWithError(compiled.error().message.c_str());
    base::ScopedFpEnv environment;
    const UniformBank bank = (*compiled)->preamble(tables);
    for (auto _ : state) {
      (*compiled)->run(bank, context);
      benchmark::ClobberMemory();
    }
    state.counters["per_lane_op"] = benchmark::Counter(operations * context.lanes,
        benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
    state.counters["code"] = double((*compiled)->instructionCount());
    state.counters["registers"] = double((*compiled)->registerBytes());
    state.SetLabel(interpreterTarget());
  }
};

//! 64 operations, eight chains side by side, results combined at the end by the operation itself.
void operation(benchmark::State& state, Op op, Type type, unsigned operands, bool uniform) {
  Function f;
  Builder b(f);
  Value v[8];
  for (unsigned k = 0; k < 8; k++) v[k] = b.input(type, k);
  const Value u = uniform ? b.uniform(type, 8) : v[7];
  Value last = v[0];
  for (unsigned n = 0; n < 64; n++) {
    Value& x = v[n % 8];
    const Value y = uniform ? u : v[(n + 1) % 8];
    x = operands == 1 ? b.emit(op, type, {x}) : operands == 2 ? b.emit(op, type, {x, y}) : b.emit(op, type, {x, y, v[(n + 2) % 8]});
    last = x;
  }
  for (unsigned k = 0; k < 8; k++) b.output(0, v[k]);
  (void)last;
  Bench bench;
  bench.measure(state, f, 64);
}

void mask(benchmark::State& state) {
  Function f;
  Builder b(f);
  Value v[8];
  for (unsigned k = 0; k < 8; k++) v[k] = b.input(Type::F32, k);
  for (unsigned n = 0; n < 32; n++) v[n % 8] = b.select(b.flt(v[n % 8], v[(n + 3) % 8]), v[(n + 1) % 8], v[n % 8]);
  for (unsigned k = 0; k < 8; k++) b.output(0, v[k]);
  Bench bench;
  bench.measure(state, f, 64);
}

//! One load per lane from one (0), neighbouring (1) or scattered (97) elements of a buffer.
void load(benchmark::State& state) {
  static float data[4096 + 32];
  Function f;
  Builder b(f);
  const Value base = b.uniform(Type::I64, 48), size = b.uniform(Type::I64, 56);
  Value v = b.and_(b.imul(b.laneId(), b.i32(uint32_t(state.range(0)) * 4)), b.i32(16383 & ~3u));
  Value sum = b.f32(0);
  for (unsigned n = 0; n < 32; n++) sum = b.fadd(sum, b.load(Type::F32, base, v, size, n * 4));
  b.output(0, sum);
  Bench bench;
  const uint64_t pair[2] = {reinterpret_cast<uint64_t>(data), sizeof data};
  std::memcpy(&bench.uniforms[12], pair, 16);
  bench.measure(state, f, 32);
}

//! The same for stores.
void store(benchmark::State& state) {
  static float data[4096 + 32];
  Function f;
  Builder b(f);
  const Value base = b.uniform(Type::I64, 48), size = b.uniform(Type::I64, 56);
  const Value at = b.and_(b.imul(b.laneId(), b.i32(uint32_t(state.range(0)) * 4)), b.i32(16383 & ~3u)), v = b.input(Type::F32, 0);
  for (unsigned n = 0; n < 32; n++) b.store(base, at, size, v, n * 4);
  Bench bench;
  const uint64_t pair[2] = {reinterpret_cast<uint64_t>(data), sizeof data};
  std::memcpy(&bench.uniforms[12], pair, 16);
  bench.measure(state, f, 32);
}

//! An array of each lane's own, indexed alike (0) or differently (1) by the lanes: 16 stores and 16 loads.
void local(benchmark::State& state) {
  Function f;
  Builder b(f);
  const Value array = b.emit(Op::LocalAlloc, Type::I32, {}, 256), v = b.input(Type::F32, 0);
  const Value at = b.shl(b.and_(state.range(0) ? b.laneId() : b.and_(b.laneId(), b.uniform(Type::I32, 60)), b.i32(31)), b.i32(2));
  Value sum = v;
  for (unsigned n = 0; n < 16; n++) {
    b.emit(Op::LocalStore, Type::None, {array, at, sum}, n * 8);
    sum = b.fadd(sum, b.emit(Op::LocalLoad, Type::F32, {array, at}, n * 4));
  }
  b.output(0, sum);
  Bench bench;
  bench.uniforms[15] = 0;
  bench.measure(state, f, 32);
}

// x, y, z of a map iterated 64 times: 12 operations an iteration.
constexpr unsigned kIterations = 64;
constexpr double kLoopOperations = kIterations * 12;

void loop(benchmark::State& state) {
  Function f;
  Builder b(f);
  const Value a = b.uniform(Type::F32, 4), c = b.uniform(Type::F32, 8);
  const Value i = b.var(Type::I32);
  Value v[3];
  for (unsigned k = 0; k < 3; k++) {
    v[k] = b.var(Type::F32);
    b.set(v[k], b.input(Type::F32, k));
  }
  b.beginLoop();
  const Value n = b.get(i);
  b.beginIf(b.ule(b.i32(kIterations), n));
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
  for (Value r : v) b.output(0, b.get(r));
  Bench bench;
  bench.context.lanes = uint32_t(state.range(0));
  bench.measure(state, f, kLoopOperations);
}

//! The same, a lane at a time, as a C++ compiler makes it at -O2.
[[gnu::noinline]] void loopInCpp(const float* in0, const float* in1, const float* in2, float* out, float a, float c, unsigned lanes) {
  for (unsigned lane = 0; lane < lanes; lane++) {
    float x = in0[lane], y = in1[lane], z = in2[lane];
    for (unsigned i = 0; i < kIterations; i++) {
      const float x2 = x * a + y * z;
      const float y2 = y * c + (x2 < 1.0f ? x2 : 1.0f);
      const float xc = x2 * c;
      const float z2 = (z - y2) * (xc < a ? a : xc);
      const float old = x;
      x = xc;
      y = y2;
      z = z2 + old;
    }
    out[lane] = x + y + z;
  }
}
void loopCpp(benchmark::State& state) {
  Bench bench;
  auto row = [&](unsigned k) { return reinterpret_cast<const float*>(bench.rows[k]); };
  for (auto _ : state) {
    loopInCpp(row(0), row(1), row(2), reinterpret_cast<float*>(bench.out), bench.uniforms[1], bench.uniforms[2], kMaxLanes);
    benchmark::ClobberMemory();
  }
  state.counters["per_lane_op"] = benchmark::Counter(kLoopOperations * kMaxLanes, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void compile(benchmark::State& state) {
  Function f;
  Builder b(f);
  Value v[8];
  for (unsigned k = 0; k < 8; k++) v[k] = b.input(Type::F32, k);
  for (unsigned n = 0; n < 2000; n++) v[n % 8] = b.fadd(b.fmul(v[n % 8], v[(n + 1) % 8]), v[(n + 5) % 8]);
  for (unsigned k = 0; k < 8; k++) b.output(0, v[k]);
  for (auto _ : state) {
    auto compiled = compileInterpreter(f, {});
    benchmark::DoNotOptimize(compiled);
  }
}

#define OPERATION(Name, type, operands) \
  BENCHMARK_CAPTURE(operation, Name##_##type, Op::Name, Type::type, operands, false); \
  BENCHMARK_CAPTURE(operation, Name##_##type##_uniform, Op::Name, Type::type, operands, operands > 1)
OPERATION(FAdd, F32, 2);
OPERATION(FMul, F32, 2);
OPERATION(Fma, F32, 3);
OPERATION(FMin, F32, 2);
OPERATION(FDiv, F32, 2);
OPERATION(FSqrt, F32, 1);
OPERATION(FFloor, F32, 1);
OPERATION(FAdd, F64, 2);
OPERATION(IAdd, I32, 2);
OPERATION(IMul, I32, 2);
OPERATION(Shl, I32, 2);
OPERATION(UDiv, I32, 2);
OPERATION(SDiv, I32, 2);
OPERATION(IMul, I64, 2);
OPERATION(FExp2, F32, 1);
OPERATION(FLog2, F32, 1);
OPERATION(FSin, F32, 1);
BENCHMARK(mask);
BENCHMARK(load)->Arg(0)->Arg(1)->Arg(97);
BENCHMARK(store)->Arg(1)->Arg(97);
BENCHMARK(local)->Arg(0)->Arg(1);
BENCHMARK(loop)->Arg(4)->Arg(16)->Arg(64)->Arg(128);
BENCHMARK(loopCpp);
BENCHMARK(compile)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace pumice::interp
