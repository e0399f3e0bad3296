// Nanoseconds for each lane and operation of the interpreter and of machine code, beside the same programs in C++ compiled for the
// same instruction set; prints docs/throughput.md. Processor time of one thread, the least of many batches.
#include <ctime>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <vector>

#include "base/fpenv.h"
#include "bench/throughput/native.h"
#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/builder.h"
#include "spirv_interp/jit/jit.h"

namespace pumice::bench {
namespace {

using interp::kMaxLanes;
using ir::Builder, ir::Function, ir::Op, ir::Type, ir::Value;

// What a program is made of: rows 0 to 2 are floats, 3 and 4 words; uniforms a, c and the table's address and size.
struct Frame {
  Function f;
  Builder b{f};
  Value x(unsigned k) { return b.input(Type::F32, k); }
  Value n(unsigned k) { return b.input(Type::I32, 3 + k); }
  Value a() { return b.uniform(Type::F32, 0); }
  Value c() { return b.uniform(Type::F32, 4); }
  Value var(Value start) {
    const Value v = b.var(b.type(start));
    b.set(v, start);
    return v;
  }
  void times(uint32_t count, const std::function<void(Value)>& body) {
    const Value i = var(b.i32(0));
    b.beginLoop();
    const Value turn = b.get(i);
    b.beginIf(b.ule(b.i32(count), turn));
    b.breakOut(0);
    b.endIf();
    body(turn);
    b.set(i, b.iadd(turn, b.i32(1)));
    b.endLoop();
  }
};

Function floatAlu() {
  Frame p;
  Builder& b = p.b;
  const Value a = p.a(), c = p.c(), vx = p.var(p.x(0)), vy = p.var(p.x(1)), vz = p.var(p.x(2));
  p.times(64, [&](Value) {
    const Value x = b.get(vx), y = b.get(vy), z = b.get(vz);
    const Value x2 = b.fadd(b.fmul(x, a), b.fmul(y, z)), y2 = b.fma(y, c, b.fmin(x2, b.f32(1))), xc = b.fmul(x2, c);
    b.set(vx, xc);
    b.set(vy, y2);
    b.set(vz, b.fadd(b.fmul(b.fsub(z, y2), b.fmax(xc, a)), x));
  });
  b.output(0, b.fadd(b.fadd(b.get(vx), b.get(vy)), b.get(vz)));
  return p.f;
}

Function intAlu() {
  Frame p;
  Builder& b = p.b;
  const Value vh = p.var(p.n(0)), vk = p.var(p.n(1));
  p.times(64, [&](Value) {
    Value h = b.get(vh);
    h = b.iadd(b.imul(b.xor_(h, b.lshr(h, b.i32(16))), b.i32(0x85ebca6bu)), b.get(vk));
    const Value k = b.isub(b.shl(b.get(vk), b.i32(3)), h);
    b.set(vk, k);
    b.set(vh, b.xor_(h, k));
  });
  b.output(0, b.get(vh));
  return p.f;
}

Function transcendental() {
  Frame p;
  Builder& b = p.b;
  const Value v = p.var(p.x(0)), a = p.a();
  p.times(16, [&](Value) {
    const Value e = b.unary(Op::FExp2, b.fmul(b.get(v), b.f32(0.25f)));
    b.set(v, b.unary(Op::FSin, b.unary(Op::FLog2, b.fadd(e, a))));
  });
  b.output(0, b.get(v));
  return p.f;
}

Function unsignedDivision() {
  Frame p;
  Builder& b = p.b;
  const Value vh = p.var(p.n(0)), k = p.n(1);
  p.times(32, [&](Value) {
    const Value h = b.get(vh), one = b.i32(1);
    b.set(vh, b.iadd(b.iadd(b.udiv(h, b.or_(b.lshr(k, b.i32(7)), one)), b.urem(h, b.or_(b.lshr(k, b.i32(20)), one))), k));
  });
  b.output(0, b.get(vh));
  return p.f;
}

Function signedDivision() {
  Frame p;
  Builder& b = p.b;
  const Value vh = p.var(p.n(0)), k = p.n(1);
  p.times(32, [&](Value) {
    const Value h = b.get(vh), three = b.i32(3);
    const Value d = b.iadd(b.and_(b.ashr(k, b.i32(7)), b.i32(0xffff)), three), m = b.iadd(b.and_(b.ashr(k, b.i32(20)), b.i32(0xff)), three);
    b.set(vh, b.iadd(b.iadd(b.binary(Op::SDiv, h, d), b.binary(Op::SRem, h, m)), k));
  });
  b.output(0, b.get(vh));
  return p.f;
}

Function gather() {
  Frame p;
  Builder& b = p.b;
  const Value base = b.uniform(Type::I64, 8), size = b.uniform(Type::I64, 16), v = p.var(p.n(0));
  p.times(32, [&](Value i) { b.set(v, b.iadd(b.load(Type::I32, base, b.shl(b.and_(b.get(v), b.i32(4095)), b.i32(2)), size), i)); });
  b.output(0, b.get(v));
  return p.f;
}

Function divergent() {
  Frame p;
  Builder& b = p.b;
  const Value v = p.var(b.iadd(b.and_(p.n(0), b.i32(255)), b.i32(1))), steps = p.var(b.i32(0));
  b.beginLoop();
  b.beginIf(b.maskOr(b.ieq(b.get(v), b.i32(1)), b.ule(b.i32(64), b.get(steps))));
  b.breakOut(0);
  b.endIf();
  const Value x = b.get(v);
  b.beginIf(b.ieq(b.and_(x, b.i32(1)), b.i32(1)));
  b.set(v, b.iadd(b.imul(x, b.i32(3)), b.i32(1)));
  b.beginElse();
  b.set(v, b.lshr(x, b.i32(1)));
  b.endIf();
  b.set(steps, b.iadd(b.get(steps), b.i32(1)));
  b.endLoop();
  b.output(0, b.iadd(b.get(steps), b.get(v)));
  return p.f;
}

Function shared() {
  Frame p;
  Builder& b = p.b;
  p.f.sharedBytes = kMaxLanes * 4;
  const Value lane = b.laneId(), own = b.shl(lane, b.i32(2)), v = p.var(p.n(0));
  p.times(32, [&](Value i) {
    b.emit(Op::SharedStore, Type::None, {own, b.get(v)});
    b.emit(Op::Barrier, Type::None, {});
    const Value other = b.shl(b.and_(b.iadd(b.iadd(lane, i), b.i32(1)), b.i32(127)), b.i32(2));
    b.set(v, b.iadd(b.get(v), b.emit(Op::SharedLoad, Type::I32, {other})));
    b.emit(Op::Barrier, Type::None, {});
  });
  b.output(0, b.get(v));
  return p.f;
}

struct Program {
  const char *name, *what;
  Function (*make)();
  void (*o2)(const NativeInput&, uint32_t*);
  void (*o3)(const NativeInput&, uint32_t*);
  double operations;   //!< of a lane
  bool exact;          //!< the same bits in C++
  const char* limit = nullptr;   //!< what keeps the interpreter from 40 % of C++
};
const Program kPrograms[] = {
    {"f32 arithmetic", "a chain of 11 multiplications, additions, minima and a fused one, 64 times", floatAlu, o2::floatAlu, o3::floatAlu, 64 * 11, true},
    {"i32 arithmetic", "a hash of 8 shifts, products and sums, 64 times", intAlu, o2::intAlu, o3::intAlu, 64 * 8, true},
    {"transcendental", "exp2, log2, sin, 16 times (in C++ those of the C library)", transcendental, o2::transcendental, o3::transcendental, 16 * 3, false},
    {"unsigned division", "a quotient and a remainder, 32 times", unsignedDivision, o2::unsignedDivision, o3::unsignedDivision, 32 * 2, true},
    {"signed division", "a quotient and a remainder, 32 times", signedDivision, o2::signedDivision, o3::signedDivision, 32 * 2, true},
    {"gather", "a load of a word that the one before it names, 32 times, bounded (in C++ unbounded)", gather, o2::gather, o3::gather, 32, true},
    {"divergent", "the steps of 3n + 1, for each lane another number, at most 64; C++ stops with each lane, a row with its last one, after both branches in most turns", divergent, o2::divergent, o3::divergent, 64, true,
     "of the 64 turns of a row 34 are a lane's own, on average; two thirds of these take one side of the branch, but nearly every turn of a row takes both. "
     "A turn is some twenty kernels over 128 lanes, each near what loads and stores allow. Packing the lanes that are left together could save 1.9 times "
     "at most, less the moving of all that lives in the loop; skipping parts of a row where no lane is left saves less, since lanes end at random"},
    {"shared memory", "a store, a barrier and a load from another lane's place, 32 times", shared, o2::shared, o3::shared, 64, true},
};

double now() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) * 1e9 + double(t.tv_nsec);
}

//! Nanoseconds of one call: the least of 60 batches of about a millisecond.
double measure(const std::function<void()>& run) {
  unsigned calls = 1;
  for (;; calls *= 2) {
    const double start = now();
    for (unsigned i = 0; i < calls; i++) run();
    if (now() - start > 1e6) break;
  }
  double best = 1e300;
  for (unsigned batch = 0; batch < 60; batch++) {
    const double start = now();
    for (unsigned i = 0; i < calls; i++) run();
    best = std::min(best, (now() - start) / calls);
  }
  return best;
}

int report() {
  alignas(64) static float floats[3][kMaxLanes];
  alignas(64) static uint32_t words[2][kMaxLanes], table[4096], out[kMaxLanes], native[kMaxLanes];
  alignas(64) static std::byte sharedMemory[kMaxLanes * 4];
  uint32_t state = 12345;
  auto random = [&] { return state = state * 1664525u + 1013904223u, state ^ state >> 15; };
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    for (auto& row : floats) row[lane] = 0.5f + float(random() % 1000) / 1000;
    for (auto& row : words) row[lane] = random();
  }
  for (uint32_t& w : table) w = random();
  struct {
    float a = 0.51f, c = 0.52f;
    uint64_t base = 0, size = sizeof table;
  } uniforms;
  uniforms.base = reinterpret_cast<uint64_t>(table);
  const void* inputs[] = {floats[0], floats[1], floats[2], words[0], words[1]};
  void* outputs[] = {out};
  interp::Table tables[ir::kTableCount] = {};
  tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&uniforms), sizeof uniforms};
  interp::ExecContext context;
  context.lanes = kMaxLanes;
  context.active[0] = context.active[1] = ~uint64_t(0);
  context.inputs = inputs;
  context.outputs = outputs;
  context.tables = tables;
  context.shared = sharedMemory;
  context.sharedBytes = sizeof sharedMemory;
  const NativeInput in{{floats[0], floats[1], floats[2]}, {words[0], words[1]}, table, uniforms.a, uniforms.c, kMaxLanes};
  base::ScopedFpEnv environment;

  std::printf("# Throughput of the executors\n\n"
              "Nanoseconds for each lane and operation, one thread, rows of %u lanes; the last columns: how fast the interpreter (%s) and\n"
              "machine code are, measured by the same program in C++ at -O2 for AVX2 and FMA, one lane after the other (at -O3, where gcc may make\n"
              "vectors of it, in its own column). Written by `./dev report`; the programs are in `bench/throughput/`.\n\n"
              "| program | C++ -O2 | C++ -O3 | interpreter | machine code | interpreter / -O2 | machine code / -O2 |\n|---|---|---|---|---|---|---|\n",
              kMaxLanes, interp::interpreterTarget());
  std::vector<const Program*> slow;
  int status = 0;
  for (const Program& p : kPrograms) {
    const Function f = p.make();
    auto interpreted = interp::compileInterpreter(f, {});
    if (!interpreted) return std::fprintf(stderr, "%s: %s\n", p.name, interpreted.error().message.c_str()), 1;
    auto compiled = jit::available() ? jit::compile(f, {}) : interp::compileInterpreter(f, {});
    if (!compiled) return std::fprintf(stderr, "%s: %s\n", p.name, compiled.error().message.c_str()), 1;
    const double each = p.operations * kMaxLanes;
    p.o2(in, native);
    auto time = [&](const interp::Executable& e, const char* which) {
      const interp::UniformBank bank = e.preamble(tables);
      e.run(bank, context);
      if (p.exact && std::memcmp(out, native, sizeof out)) std::fprintf(stderr, "%s: %s has other results than C++\n", p.name, which), status = 1;
      return measure([&] { e.run(bank, context); }) / each;
    };
    const double interpreter = time(**interpreted, "the interpreter"), machine = jit::available() ? time(**compiled, "machine code") : NAN;
    const double o2 = measure([&] { p.o2(in, native); }) / each, o3 = measure([&] { p.o3(in, native); }) / each;
    std::printf("| %s | %.3f | %.3f | %.3f | %.3f | %.0f %% | %.0f %% |\n", p.name, o2, o3, interpreter, machine, 100 * o2 / interpreter, 100 * o2 / machine);
    if (o2 / interpreter < 0.4) slow.push_back(&p);
  }
  std::printf("\nWhat the programs do:\n\n");
  for (const Program& p : kPrograms) std::printf("- %s: %s\n", p.name, p.what);
  std::printf("\nThe interpreter is to reach 40 %% of C++ at -O2. ");
  if (slow.empty()) std::printf("Nothing here is slower.\n");
  if (!slow.empty()) {
    std::printf("It is slower in:");
    for (size_t i = 0; i < slow.size(); i++) std::printf("%s %s", i ? "," : "", slow[i]->name);
    std::printf(".\n");
    for (const Program* p : slow)
      if (p->limit) std::printf("\n%s: %s.\n", p->name, p->limit);
  }
  return status;
}

}  // namespace
}  // namespace pumice::bench

int main() { return pumice::bench::report(); }
