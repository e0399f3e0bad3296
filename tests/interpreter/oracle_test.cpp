// Numerics::Oracle: what is computed is computed in double; where bits count they are those of the declared type.
#include "fixture.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::interp {
namespace {

const CompileOptions kOracle{ir::Numerics::Oracle, {}};

float floatOf(uint64_t bits) { return std::bit_cast<float>(uint32_t(bits)); }

//! Straight-line arithmetic on positive numbers, which loses little: f32 stays near the oracle, and the oracle
//! has the bits of the same computation in C++ doubles, rounded once.
TEST(Oracle, arithmeticIsThatOfDoublesAndF32IsNear) {
  Random r(11);
  for (int round = 0; round < 200; round++) {
    Function f;
    std::vector<Value> values;
    std::vector<std::vector<double>> numbers;   // by value, then lane
    RowRun start(4, 4);
    for (unsigned k = 0; k < 4; k++) {
      const Type t = k == 3 ? Type::F16 : Type::F32;
      values.push_back(append(f, Op::Input, t, {}, k));
      std::vector<double> n;
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const uint64_t bits = ir::floatBits(t, 0.5 + double(r.below(1u << 24)) / (1u << 22));
        start.inputs[k].set(t, lane, bits);
        n.push_back(ir::floatValue(t, bits));
      }
      numbers.push_back(n);
    }
    values[3] = append(f, Op::FToF, Type::F32, {values[3]});   // exact
    const Value var = append(f, Op::Var, Type::F32, {});
    for (int n = 0; n < 12; n++) {
      static constexpr Op kOps[] = {Op::FAdd, Op::FDiv, Op::Fma, Op::FSqrt, Op::FMin, Op::FMax, Op::FMul, Op::Select};
      const Op op = kOps[r.below(std::size(kOps))];
      const uint32_t a = r.below(uint32_t(values.size())), b = r.below(uint32_t(values.size())), c = r.below(4);
      Value v;
      if (op == Op::FSqrt) v = append(f, op, Type::F32, {values[a]});
      else if (op == Op::Fma) v = append(f, op, Type::F32, {values[a], values[b], values[c]});
      else if (op == Op::Select) v = append(f, op, Type::F32, {append(f, Op::FLt, Type::Mask, {values[c], values[(c + 1) % 3]}), values[a], values[b]});
      else v = append(f, op, Type::F32, {values[a], values[b]});
      if (r.chance(30)) {
        append(f, Op::VarSet, Type::None, {var, v});
        v = append(f, Op::VarGet, Type::F32, {var});
      }
      std::vector<double> n2;
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const double x = numbers[a][lane], y = numbers[b][lane], z = numbers[c][lane];
        n2.push_back(op == Op::FAdd ? x + y : op == Op::FDiv ? x / y : op == Op::Fma ? std::fma(x, y, z) : op == Op::FSqrt ? std::sqrt(x)
                     : op == Op::FMin ? std::min(x, y) : op == Op::FMax ? std::max(x, y) : op == Op::FMul ? x * y
                     : z < numbers[(c + 1) % 3][lane] ? x : y);
      }
      values.push_back(v);
      numbers.push_back(n2);
    }
    for (unsigned k = 0; k < 4; k++) append(f, Op::Output, Type::None, {values[values.size() - 1 - k]}, k);
    ASSERT_EQ(ir::verify(f), "");
    RowRun plain = start, oracle = start;
    plain(f);
    oracle(f, defaultTarget(), kOracle);
    for (unsigned k = 0; k < 4; k++)
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const double want = numbers[numbers.size() - 1 - k][lane];
        const float got = floatOf(oracle.outputs[k].get(Type::F32, lane)), near = floatOf(plain.outputs[k].get(Type::F32, lane));
        if (std::abs(want) > 3e38) continue;
        ASSERT_EQ(got, float(want)) << ir::print(f);
        ASSERT_NEAR(near / want, 1.0, 1e-5) << ir::print(f);
      }
  }
}

TEST(Oracle, privateArraysAndWorkGroupMemoryKeepDoublesUntilSomebodyWritesOtherBits) {
  Function f = parsed(R"(
    %x = input f32 0
    %big = const f32 1e8
    %sum = fadd f32 %x, %big
    %at = const i32 4
    %a = local.alloc i32 16
    local.store +4 %a, %at, %sum
    %l = local.load f32 +4 %a, %at
    %fromLocal = fsub f32 %l, %big
    output 0 %fromLocal
    %lane = lane.id i32
    %four = const i32 4
    %own = imul i32 %lane, %four
    shared.store %own, %sum
    %s = shared.load f32 %own
    %fromShared = fsub f32 %s, %big
    output 1 %fromShared
    %bits = const i32 1065353216
    shared.store %own, %bits
    %one = shared.load f32 %own
    output 2 %one
    local.store +8 %a, %at, %x
    %never = local.load f32 %a, %at
    output 3 %never
  )");
  f.sharedBytes = 4 * kMaxLanes;
  for (const Target& target : availableTargets()) {
    RowRun run(1, 4);
    run.shared.resize(ir::oracleSharedBytes(f.sharedBytes) + 64);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::F32, lane, ir::floatBits(Type::F32, 0.25 * (lane + 1)));
    run(f, target, kOracle);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      EXPECT_EQ(floatOf(run.outputs[0].get(Type::F32, lane)), 0.25f * float(lane + 1)) << target.name;
      EXPECT_EQ(floatOf(run.outputs[1].get(Type::F32, lane)), 0.25f * float(lane + 1)) << target.name;
      EXPECT_EQ(floatOf(run.outputs[2].get(Type::F32, lane)), 1.0f) << target.name;
      EXPECT_EQ(floatOf(run.outputs[3].get(Type::F32, lane)), 0.0f) << target.name;
    }
  }
}

TEST(Oracle, sumsThatF32LosesAreKept) {
  const Function f = parsed(R"(
    %x = input f32 0
    %big = const f32 1e8
    %sum = fadd f32 %x, %big
    %r = fsub f32 %sum, %big
    output 0 %r
    %bits = bitcast i32 %sum
    output 1 %bits
    %h = ftof f16 %sum
    output 2 %h
    %int = ftos i32 %r
    output 3 %int
    %same = feq mask %r, %x
    output 4 %same
    %stored = input f32 1
    %declared = feq mask %stored, %sum !declared
    output 5 %declared
    %exact = feq mask %stored, %sum
    output 6 %exact
  )");
  RowRun run(2, 7);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    run.inputs[0].set(Type::F32, lane, std::bit_cast<uint32_t>(float(lane)));
    run.inputs[1].set(Type::F32, lane, std::bit_cast<uint32_t>(float(1e8 + lane)));
  }
  run(f, defaultTarget(), kOracle);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    EXPECT_EQ(floatOf(run.outputs[0].get(Type::F32, lane)), float(lane));
    const float rounded = float(1e8 + lane);
    EXPECT_EQ(floatOf(run.outputs[1].get(Type::I32, lane)), rounded);   // bit casts see the f32
    EXPECT_EQ(run.outputs[2].get(Type::F16, lane), 0x7c00u);
    EXPECT_EQ(run.outputs[3].get(Type::I32, lane), lane);
    EXPECT_EQ(run.outputs[4].get(Type::Mask, lane), 1u);
    EXPECT_EQ(run.outputs[5].get(Type::Mask, lane), 1u);
    EXPECT_EQ(run.outputs[6].get(Type::Mask, lane), rounded == 1e8 + lane);
  }
}

TEST(Oracle, valuesThatAreOnlyMovedKeepTheirBits) {
  const Function f = parsed(R"(
    %x = input f32 0
    %y = input f32 1
    %m = input mask 2
    %v = var f32
    %a = select f32 %m, %x, %y
    var.set %v, %a
    %b = var.get f32 %v
    %c = quad.swizzle f32 27 %b
    %n = fneg f32 %c
    %n2 = fneg f32 %n
    output 0 %b
    output 1 %c
    %bits = bitcast i32 %b
    output 2 %bits
  )");
  Random r(3);
  RowRun run(3, 3);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    run.inputs[0].set(Type::F32, lane, 0x7f800001u + r.below(1 << 22));   // signalling
    run.inputs[1].set(Type::F32, lane, r.next() & 0xffffffffu);
    run.inputs[2].set(Type::Mask, lane, r.below(2));
  }
  run(f, defaultTarget(), kOracle);
  const auto want = [&](unsigned lane) { return run.inputs[run.inputs[2].get(Type::Mask, lane) ? 0 : 1].get(Type::F32, lane); };
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    EXPECT_EQ(run.outputs[0].get(Type::F32, lane), want(lane));
    EXPECT_EQ(run.outputs[1].get(Type::F32, lane), want(lane ^ 3));
    EXPECT_EQ(run.outputs[2].get(Type::I32, lane), want(lane));
  }
}

TEST(Oracle, functionsAreThoseOfDouble) {
  const Function f = parsed(R"(
    %x = input f32 0
    %s = fsin f32 %x
    %q = fmul f32 %s, %s
    %c = fcos f32 %x
    %q2 = fmul f32 %c, %c
    %one = const f32 1
    %sum = fadd f32 %q, %q2
    %zero = fsub f32 %sum, %one
    %e = fexp2 f32 %x
    %l = flog2 f32 %e
    %d = fsub f32 %l, %x
    output 0 %s
    output 1 %zero
    output 2 %d
  )");
  RowRun run(1, 3);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::F32, lane, std::bit_cast<uint32_t>(float(lane) * 0.37f - 20));
  run(f, defaultTarget(), kOracle);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    const double x = float(lane) * 0.37f - 20;
    EXPECT_FLOAT_EQ(floatOf(run.outputs[0].get(Type::F32, lane)), float(std::sin(x)));
    EXPECT_LT(std::abs(floatOf(run.outputs[1].get(Type::F32, lane))), 1e-13);
    EXPECT_LT(std::abs(floatOf(run.outputs[2].get(Type::F32, lane))), 1e-12);
  }
}

}  // namespace
}  // namespace pumice::interp
