// What machine code costs to make (per IR operation, up to 50,000), and what a loop of arithmetic gains by it: against
// the interpreter and against the same loop in C++ for the same instruction set.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstring>

#include "base/fpenv.h"
#include "spirv_interp/ir/builder.h"
#include "spirv_interp/jit/jit.h"

namespace pumice::jit {
namespace {

using interp::kMaxLanes;
using ir::Builder, ir::Function, ir::Op, ir::Type, ir::Value;

struct Bench {
  alignas(64) std::byte rows[8][kMaxLanes * 4];
  alignas(64) std::byte out[kMaxLanes * 4];
  const void* inputs[8];
  void* outputs[1] = {out};
  interp::Table tables[ir::kTableCount] = {};
  float uniforms[16];
  interp::ExecContext context;

  Bench() {
    for (unsigned k = 0; k < 8; k++) {
      inputs[k] = rows[k];
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const float x = 1.0f + float(lane * 3 + k) * 0x1p-7f;
        std::memcpy(rows[k] + 4 * lane, &x, 4);
      }
    }
    for (unsigned k = 0; k < 16; k++) uniforms[k] = 0.5f + 0.01f * float(k);
    tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), sizeof uniforms};
    context.lanes = kMaxLanes;
    context.active[0] = context.active[1] = ~uint64_t(0);
    context.inputs = inputs;
    context.outputs = outputs;
    context.tables = tables;
  }
};

constexpr unsigned kIterations = 64;
constexpr double kLoopOperations = kIterations * 12;

//! x, y, z of a map iterated 64 times: 12 operations an iteration. `masked`: each lane has an end of its own.
Function loopFunction(bool masked) {
  Function f;
  Builder b(f);
  const Value a = b.uniform(Type::F32, 4), c = b.uniform(Type::F32, 8);
  const Value i = b.var(Type::I32);
  Value v[3];
  for (unsigned k = 0; k < 3; k++) {
    v[k] = b.var(Type::F32);
    b.set(v[k], b.input(Type::F32, k));
  }
  const Value end = masked ? b.iadd(b.and_(b.laneId(), b.i32(0)), b.i32(kIterations)) : b.i32(kIterations);
  b.beginLoop();
  const Value n = b.get(i);
  b.beginIf(b.ule(end, n));
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

void measure(benchmark::State& state, const interp::Executable& e, double operations) {
  Bench bench;
  base::ScopedFpEnv environment;
  const interp::UniformBank bank = e.preamble(bench.tables);
  for (auto _ : state) {
    e.run(bank, bench.context);
    benchmark::ClobberMemory();
  }
  state.counters["per_lane_op"] =
      benchmark::Counter(operations * kMaxLanes, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void loop(benchmark::State& state) {
  auto e = compile(loopFunction(false), {}, {.chunkLanes = uint32_t(state.range(0))});
  if (!e) return state.SkipWithError(e.error().message.c_str());
  measure(state, **e, kLoopOperations);
}
void loopInterpreted(benchmark::State& state) {
  auto e = interp::compileInterpreter(loopFunction(false), {});
  if (!e) return state.SkipWithError(e.error().message.c_str());
  measure(state, **e, kLoopOperations);
}

//! The same in C++: what -O3 makes of it with 8 lanes, and one lane at a time as -O2 does.
#define LOOP_BODY                                                                             \
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {                                         \
    float x = in0[lane], y = in1[lane], z = in2[lane];                                        \
    for (unsigned i = 0; i < kIterations; i++) {                                              \
      const float x2 = x * a + y * z;                                                         \
      const float y2 = __builtin_fmaf(y, c, x2 < 1.0f ? x2 : 1.0f);                           \
      const float xc = x2 * c;                                                                \
      const float z2 = (z - y2) * (xc < a ? a : xc);                                          \
      const float old = x;                                                                    \
      x = xc;                                                                                 \
      y = y2;                                                                                 \
      z = z2 + old;                                                                           \
    }                                                                                         \
    out[lane] = x + y + z;                                                                    \
  }
[[gnu::noinline, gnu::target("avx2,fma")]] void loopScalar(const float* in0, const float* in1, const float* in2, float* out, float a, float c) { LOOP_BODY }

using V = float __attribute__((vector_size(32), may_alias));
//! By hand, 8 lanes, `kUnroll` vectors at a time.
template <unsigned kUnroll>
[[gnu::noinline, gnu::target("avx2,fma"), gnu::optimize("O3", "no-math-errno")]] void loopVectors(const float* in0, const float* in1, const float* in2, float* out,
                                                                                          float a, float c) {
  for (unsigned lane = 0; lane < kMaxLanes; lane += 8 * kUnroll) {
    V x[kUnroll], y[kUnroll], z[kUnroll];
    for (unsigned u = 0; u < kUnroll; u++) {
      std::memcpy(&x[u], in0 + lane + 8 * u, 32);
      std::memcpy(&y[u], in1 + lane + 8 * u, 32);
      std::memcpy(&z[u], in2 + lane + 8 * u, 32);
    }
    for (unsigned i = 0; i < kIterations; i++)
#pragma GCC unroll 4
      for (unsigned u = 0; u < kUnroll; u++) {
        const V x2 = x[u] * a + y[u] * z[u];
        const V least = x2 < 1.0f ? x2 : V{} + 1.0f;
        const V y2 = y[u] * c + least;
        const V xc = x2 * c;
        const V z2 = (z[u] - y2) * (xc < a ? V{} + a : xc);
        const V old = x[u];
        x[u] = xc;
        y[u] = y2;
        z[u] = z2 + old;
      }
    for (unsigned u = 0; u < kUnroll; u++) {
      const V r = x[u] + y[u] + z[u];
      std::memcpy(out + lane + 8 * u, &r, 32);
    }
  }
}

template <class F>
void cpp(benchmark::State& state, F f) {
  Bench bench;
  auto row = [&](unsigned k) { return reinterpret_cast<const float*>(bench.rows[k]); };
  for (auto _ : state) {
    f(row(0), row(1), row(2), reinterpret_cast<float*>(bench.out), bench.uniforms[1], bench.uniforms[2]);
    benchmark::ClobberMemory();
  }
  state.counters["per_lane_op"] =
      benchmark::Counter(kLoopOperations * kMaxLanes, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

//! Arithmetic on eight values in turn.
Function straight(unsigned operations) {
  Function f;
  Builder b(f);
  Value v[8];
  for (unsigned k = 0; k < 8; k++) v[k] = b.input(Type::F32, k);
  for (unsigned n = 0; n < operations / 2; n++) v[n % 8] = b.fadd(b.fmul(v[n % 8], v[(n + 1) % 8]), v[(n + 5) % 8]);
  for (unsigned k = 0; k < 8; k++) b.output(0, v[k]);
  return f;
}
//! Many values alive at once, a loop, conditions, math functions and loads.
Function shaderLike(unsigned operations) {
  Function f;
  Builder b(f);
  Value v[24];
  for (unsigned k = 0; k < 24; k++) v[k] = b.fadd(b.input(Type::F32, k % 8), b.f32(float(k)));
  const Value base = b.uniform(Type::I64, 48), size = b.uniform(Type::I64, 56);
  const Value var = b.var(Type::F32);
  unsigned n = 0;
  while (f.insts.size() < operations) {
    const unsigned k = n++ % 24;
    v[k] = b.fma(v[k], v[(k + 7) % 24], v[(k + 13) % 24]);
    if (n % 16 == 0) v[k] = b.load(Type::F32, base, b.shl(b.convert(Op::FToU, Type::I32, v[k]), b.i32(2)), size, n);
    if (n % 32 == 0) {
      b.beginIf(b.flt(v[k], v[(k + 3) % 24]));
      b.set(var, b.fmul(v[k], v[k]));
      b.endIf();
      v[k] = b.get(var);
    }
    if (n % 64 == 0) v[k] = b.unary(Op::FExp2, v[k]);
  }
  for (unsigned k = 0; k < 24; k++) b.output(0, v[k]);
  return f;
}

template <class F>
void emission(benchmark::State& state, F make, bool native) {
  const Function f = make(unsigned(state.range(0)));
  uint64_t operations = 0;
  for (auto _ : state) {
    auto e = native ? compile(f, {}, {.chunkLanes = uint32_t(state.range(1))}) : interp::compileInterpreter(f, {});
    if (!e) return state.SkipWithError(e.error().message.c_str());
    operations = (*e)->instructionCount();
  }
  state.counters["ops"] = double(operations);
  state.counters["per_op"] =
      benchmark::Counter(double(operations), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

BENCHMARK(loop)->Arg(8)->Arg(16)->Arg(32)->Arg(0);
BENCHMARK(loopInterpreted);
BENCHMARK_CAPTURE(cpp, scalar, loopScalar);
BENCHMARK_CAPTURE(cpp, vectors, loopVectors<1>);
BENCHMARK_CAPTURE(cpp, vectors_x2, loopVectors<2>);
BENCHMARK_CAPTURE(cpp, vectors_x4, loopVectors<4>);
BENCHMARK_CAPTURE(emission, straight, straight, true)->ArgsProduct({{200, 2000, 20000, 50000}, {8, 32}})->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(emission, shaderLike, shaderLike, true)->ArgsProduct({{200, 2000, 20000, 50000}, {8, 32}})->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(emission, interpreter, shaderLike, false)->Args({2000, 0})->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace pumice::jit
