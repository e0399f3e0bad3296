// What an operation of the interpreter costs: nanoseconds per lane and operation, for rows of several
// lengths; and a loop of arithmetic against the same program in C++.
#include <bit>
#include <string>

#include "bench/lane_row.h"

namespace pumice::interp {
namespace {

using ir::Builder, ir::Function, ir::Op, ir::Type, ir::Value;

struct Bench : LaneRow {
  void measure(benchmark::State& state, const Function& f, double operations) {
    auto compiled = compileInterpreter(f, {});
    if (!compiled) return state.SkipWithError(compiled.error().message.c_str());
    LaneRow::measure(state, **compiled, operations);
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

void loop(benchmark::State& state) {
  Bench bench;
  bench.context.lanes = uint32_t(state.range(0));
  bench.measure(state, loopFunction(), kLoopOperations);
}

//! The same, a lane at a time, as a C++ compiler makes it at -O2.
[[gnu::noinline]] void loopInCpp(const float* in0, const float* in1, const float* in2, float* out, float a, float c, unsigned lanes) {
  for (unsigned lane = 0; lane < lanes; lane++) {
    float x = in0[lane], y = in1[lane], z = in2[lane];
    for (unsigned i = 0; i < kLoopIterations; i++) {
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
  for (auto _ : state) {
    loopInCpp(bench.floats(0), bench.floats(1), bench.floats(2), bench.result(), bench.uniforms[1], bench.uniforms[2], kMaxLanes);
    benchmark::ClobberMemory();
  }
  bench.count(state, kLoopOperations);
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
