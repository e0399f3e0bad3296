// Every operation, for every type it is allowed, on every instruction set, against the executable form of the
// operation table (ir/fold.h).
#include <cmath>

#include "tests/interpreter/operation_cases.h"

namespace pumice::interp {
namespace {

//! Bit i of form: operand i comes from the draw constants.
Function functionOf(const OperationCase& c, unsigned form) {
  Function f;
  std::vector<Value> in;
  for (unsigned k = 0; k < c.count(); k++)
    in.push_back(form >> k & 1 ? append(f, Op::UniformInput, c.of(k), {}, 8 * k) : append(f, Op::Input, c.of(k), {}, k));
  append(f, Op::Output, Type::None, {appendAll(f, c.op, c.type, in)}, 0);
  return f;
}

TEST(Operations, theTableNamesAFewHundredCombinations) { EXPECT_GT(operationCases().size(), 250u); }

TEST(Operations, giveTheBitsOfTheOperationTableOnEveryTarget) {
  for (const Target& target : availableTargets()) {
    Random random(7);
    for (const OperationCase& c : operationCases()) {
      const unsigned count = c.count();
      for (unsigned form = 0; form < (1u << count); form++) {
        if ((form & 1) && c.first == Type::Mask) continue;   // masks come as rows only (and constants)
        if (form && c.operand == Type::Mask) continue;
        const Function f = functionOf(c, form);
        ASSERT_EQ(ir::verify(f), "") << nameOf(c);
        auto compiled = compileInterpreterFor(f, {}, target);
        ASSERT_TRUE(compiled) << compiled.error().message;
        for (unsigned round = 0; round < (form ? 3u : 12u); round++) {
          RowRun run = operandRow(c, random);
          uint64_t uniforms[8] = {};
          for (unsigned k = 0; k < count; k++) uniforms[k] = awkwardBits(random, c.of(k));
          run.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), sizeof uniforms};
          run.execute(**compiled);
          for (unsigned lane = 0; lane < kMaxLanes; lane++) {
            uint64_t args[3], want = 0;
            for (unsigned k = 0; k < count; k++) args[k] = form >> k & 1 ? uniforms[k] : run.inputs[k].get(c.of(k), lane);
            ASSERT_TRUE(ir::foldConstant(c.op, c.type, c.operand, {args, count}, want)) << nameOf(c);
            ASSERT_EQ(run.outputs[0].get(c.type, lane), want)
                << target.name << ": " << nameOf(c) << " form " << form << " lane " << lane << std::hex << " of " << args[0]
                << (count > 1 ? ", " : "") << (count > 1 ? args[1] : 0) << (count > 2 ? ", " : "") << (count > 2 ? args[2] : 0);
          }
        }
      }
    }
  }
}

TEST(Operations, fusedMultiplyAddRoundsOnceInDirectedCases) {
  Function f = parsed("%1 = input f32 0\n%2 = input f32 1\n%3 = input f32 2\n%4 = fma f32 %1, %2, %3\noutput 0 %4");
  Random random(3);
  for (const Target& target : availableTargets()) {
    for (unsigned round = 0; round < 200; round++) {
      RowRun run(3, 1);
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        // The product is near a tie of the sum: a tiny addend decides.
        const float a = 1.0f + float(random.below(1 << 12)) * 0x1p-23f, b = 1.0f + float(random.below(1 << 12)) * 0x1p-12f;
        const float c = std::ldexp(random.chance(50) ? 1.0f : -1.0f, -int(random.below(90)));
        const float scale = std::ldexp(1.0f, int(random.below(250)) - 149);
        run.inputs[0].set(Type::F32, lane, std::bit_cast<uint32_t>(a * scale));
        run.inputs[1].set(Type::F32, lane, std::bit_cast<uint32_t>(b));
        run.inputs[2].set(Type::F32, lane, std::bit_cast<uint32_t>(c * scale));
      }
      run(f, target);
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        auto in = [&](unsigned k) { return std::bit_cast<float>(uint32_t(run.inputs[k].get(Type::F32, lane))); };
        const float want = std::fmaf(in(0), in(1), in(2));
        ASSERT_EQ(run.outputs[0].get(Type::F32, lane), std::bit_cast<uint32_t>(want)) << target.name << " " << in(0) << " " << in(1) << " " << in(2);
      }
    }
  }
}

TEST(Operations, nanBitsAreKeptByMovesAndCanonicalAfterArithmetic) {
  for (const Target& target : availableTargets()) {
    RowRun run(2, 7);
    const uint32_t nan = 0xffc12345u;
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      run.inputs[0].set(Type::F32, lane, nan);
      run.inputs[1].set(Type::F32, lane, std::bit_cast<uint32_t>(1.0f));
    }
    run(parsed(R"(
      %1 = input f32 0
      %2 = input f32 1
      %3 = fadd f32 %1, %2
      output 0 %1            ; a move
      output 1 %3            ; arithmetic
      %4 = fneg f32 %3
      output 2 %4            ; the sign of the canonical one
      %5 = fneg f32 %1
      output 3 %5
      %6 = lane.id i32
      %7 = const i32 2
      %8 = ult mask %6, %7
      %9 = select f32 %8, %3, %1
      output 4 %9            ; canonical in the lanes that took the sum, kept in the others
      %10 = var f32
      var.set %10, %1
      if %8
        var.set %10, %3
      endif
      %11 = var.get f32 %10
      output 5 %11
      %12 = bitcast i32 %3
      output 6 %12
    )"), target);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      EXPECT_EQ(run.outputs[0].get(Type::F32, lane), nan);
      EXPECT_EQ(run.outputs[1].get(Type::F32, lane), 0x7fc00000u);
      EXPECT_EQ(run.outputs[2].get(Type::F32, lane), 0xffc00000u);
      EXPECT_EQ(run.outputs[3].get(Type::F32, lane), nan ^ 0x80000000u);
      EXPECT_EQ(run.outputs[4].get(Type::F32, lane), lane < 2 ? 0x7fc00000u : nan);
      EXPECT_EQ(run.outputs[5].get(Type::F32, lane), lane < 2 ? 0x7fc00000u : nan);
      EXPECT_EQ(run.outputs[6].get(Type::I32, lane), 0x7fc00000u);
    }
  }
}

}  // namespace
}  // namespace pumice::interp
