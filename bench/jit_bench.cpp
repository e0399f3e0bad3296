// What machine code costs to make (per IR operation, up to 50,000), and what a loop of arithmetic gains by it: against
// the interpreter and against the same loop in C++ for the same instruction set.
#include <cmath>

#include "bench/lane_row.h"
#include "spirv_interp/jit/jit.h"

namespace pumice::jit {
namespace {

using interp::kLoopIterations, interp::kLoopOperations, interp::kMaxLanes, interp::LaneRow, interp::loopFunction;
using ir::Builder, ir::Function, ir::Op, ir::Type, ir::Value;

void loop(benchmark::State& state) {
  auto e = compile(loopFunction(), {}, {.chunkLanes = uint32_t(state.range(0))});
  if (!e) return state.SkipWithError(e.error().message.c_str());
  LaneRow().measure(state, **e, kLoopOperations);
}
void loopInterpreted(benchmark::State& state) {
  auto e = interp::compileInterpreter(loopFunction(), {});
  if (!e) return state.SkipWithError(e.error().message.c_str());
  LaneRow().measure(state, **e, kLoopOperations);
}

//! The same in C++: what -O3 makes of it with 8 lanes, and one lane at a time as -O2 does.
#define LOOP_BODY                                                                             \
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {                                         \
    float x = in0[lane], y = in1[lane], z = in2[lane];                                        \
    for (unsigned i = 0; i < kLoopIterations; i++) {                                          \
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
    for (unsigned i = 0; i < kLoopIterations; i++)
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
  LaneRow row;
  for (auto _ : state) {
    f(row.floats(0), row.floats(1), row.floats(2), row.result(), row.uniforms[1], row.uniforms[2]);
    benchmark::ClobberMemory();
  }
  row.count(state, kLoopOperations);
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
BENCHMARK_CAPTURE(emission, straight, straight, true)->ArgsProduct({{500, 5000, 50000}, {8, 32}})->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(emission, shaderLike, shaderLike, true)->ArgsProduct({{500, 5000, 50000}, {8, 32}})->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(emission, interpreter, shaderLike, false)->Args({2000, 0})->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace pumice::jit
