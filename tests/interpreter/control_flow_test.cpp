#include "tests/interpreter/control_programs.h"
#include "tests/support/reference.h"

namespace pumice::interp {
namespace {

class ControlPrograms : public ::testing::TestWithParam<ControlProgram> {};

TEST_P(ControlPrograms, giveTheBitsOfTheReferenceOnEveryTarget) {
  const ControlProgram& program = GetParam();
  const Function f = parsed(program);
  forControlRows([&](const RowRun& start) {
    RowRun want = start;
    want.withContext([&](const ExecContext& c) { ASSERT_EQ(pumice::testing::runReference(f, {&c, 1}), ""); });
    for (const Target& target : availableTargets()) {
      RowRun run = start;
      run(f, target);
      const std::string at = std::string(target.name) + ", " + std::to_string(start.lanes) + " lanes, lane ";
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        for (unsigned k = 0; k < kControlOutputs; k++)
          ASSERT_EQ(run.outputs[k].get(Type::I32, lane), want.outputs[k].get(Type::I32, lane)) << at << lane << ", output " << k;
        const bool active = lane < start.lanes && start.active[lane / 64] >> lane % 64 & 1;
        if (active && !program.expected) continue;
        ASSERT_EQ(run.outputs[0].get(Type::I32, lane), active ? program.expected(lane) : kControlUntouched) << at << lane;
      }
      ASSERT_TRUE(run.shared == want.shared) << at << "any: work-group memory";
    }
  });
}
INSTANTIATE_TEST_SUITE_P(All, ControlPrograms, ::testing::ValuesIn(controlPrograms()), nameOfControlProgram);

TEST(ControlFlow, lanesInactiveAtTheStartAreNeverTouched) {
  const Function f = parsed("%1 = input i32 0\noutput 0 %1\n");
  for (const Target& target : availableTargets()) {
    RowRun run(1, 1);
    run.lanes = 77;
    run.active[0] = 0x8000000000000005u;
    run.active[1] = ~uint64_t(0);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::I32, lane, lane + 1);
    run(f, target);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      const bool active = lane < 77 && (run.active[lane / 64] >> (lane % 64) & 1);
      EXPECT_EQ(run.outputs[0].get(Type::I32, lane), active ? lane + 1 : 0u) << lane;
    }
  }
}

TEST(ControlFlow, execMaskAndSubgroupVotesSeeActiveLanesOnly) {
  const Function f = parsed(R"(
    %1 = input i32 0
    %c = const i32 40
    %low = ult mask %1, %c
    %seven = const i32 7
    %is7 = ieq mask %1, %seven
    %not7 = mask.not mask %is7
    if %low
      %e = exec.mask mask
      %any = subgroup.any mask %is7
      %all = subgroup.all mask %not7
      output 0 %e
      output 1 %any
      output 2 %all
    endif
  )");
  RowRun run(1, 3);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::I32, lane, lane);
  run(f);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    EXPECT_EQ(run.outputs[0].get(Type::Mask, lane), lane < 40);
    EXPECT_EQ(run.outputs[1].get(Type::Mask, lane), lane < kSubgroupLanes);
    EXPECT_EQ(run.outputs[2].get(Type::Mask, lane), lane >= kSubgroupLanes && lane < 40);
  }
}

TEST(ControlFlow, uniformWorkGoesToThePreamble) {
  const Function f = parsed(R"(
    %1 = uniform f32 0
    %2 = uniform f32 4
    %3 = fmul f32 %1, %2
    %4 = fsqrt f32 %3
    %5 = input f32 0
    %6 = fadd f32 %5, %4
    output 0 %6
  )");
  auto compiled = compileInterpreter(f, {});
  ASSERT_TRUE(compiled) << compiled.error().message;
  EXPECT_LE((*compiled)->instructionCount(), 5u);          // input, fadd, canonical NaN, output, end
  EXPECT_GE((*compiled)->preambleInstructionCount(), 5u);
  const float uniforms[] = {8, 2};
  RowRun run(1, 1);
  run.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), sizeof uniforms};
  run.inputs[0].set(Type::F32, 3, std::bit_cast<uint32_t>(1.5f));
  run.execute(**compiled);
  EXPECT_EQ(run.outputs[0].get(Type::F32, 3), std::bit_cast<uint32_t>(5.5f));
}

//! One row of a work group: its number in input 0, LaneId for the rest.
struct GroupRow {
  Row number, out;
  const void* in[1] = {number.bytes};
  void* outputs[1] = {out.bytes};
  ExecContext context;
  std::unique_ptr<RowState> state;
  GroupRow(uint32_t n, std::vector<std::byte>& shared, const Table* tables) {
    for (unsigned lane = 0; lane < kMaxLanes; lane++) number.set(Type::I32, lane, n);
    context.lanes = kMaxLanes;
    context.active[0] = context.active[1] = ~uint64_t(0);
    context.inputs = in;
    context.outputs = outputs;
    context.tables = tables;
    context.shared = shared.data();
    context.sharedBytes = shared.size();
  }
};

TEST(ControlFlow, aRowStopsAtABarrierAndGoesOnWithItsValues) {
  // Each turn a row writes what it knows, waits, and takes what the other row wrote.
  const Function f = parsed(R"(function "exchange" shared=8
    %n = input i32 0
    %lane = lane.id i32
    %c1 = const i32 1
    %c2 = const i32 2
    %c3 = const i32 3
    %c4 = const i32 4
    %v = var i32
    %k = var i32
    %start = iadd i32 %n, %lane
    var.set %v, %start
    %mine = imul i32 %n, %c4
    %other = xor i32 %mine, %c4
    loop
      %now = var.get i32 %k
      %done = ule mask %c3, %now
      if %done
        break 0
      endif
      %x = var.get i32 %v
      %first = ult mask %lane, %c1
      if %first
        shared.store %mine, %x
      endif
      barrier
      %y = shared.load i32 %other
      barrier
      %twice = imul i32 %x, %c2
      %sum = iadd i32 %twice, %y
      var.set %v, %sum
      %next = iadd i32 %now, %c1
      var.set %k, %next
    endloop
    %r = var.get i32 %v
    output 0 %r
  )");
  base::ScopedFpEnv environment;
  for (const Target& target : availableTargets()) {
    auto compiled = compileInterpreterFor(f, {}, target);
    ASSERT_TRUE(compiled) << compiled.error().message;
    Tables tables{};
    std::vector<std::byte> shared(8);
    const UniformBank bank = (*compiled)->preamble(tables);
    GroupRow rows[] = {{0, shared, tables}, {1, shared, tables}};
    unsigned stops = 0;
    for (GroupRow& r : rows) {
      r.state = (*compiled)->newRowState();
      ASSERT_EQ((*compiled)->start(bank, r.context, *r.state), Progress::Barrier);
    }
    for (Progress p = Progress::Barrier; p != Progress::Finished; stops++)
      for (GroupRow& r : rows) p = (*compiled)->resume(*r.state);
    EXPECT_EQ(stops, 6u);
    uint32_t v[2][kMaxLanes];
    for (unsigned n = 0; n < 2; n++)
      for (unsigned l = 0; l < kMaxLanes; l++) v[n][l] = n + l;
    for (int k = 0; k < 3; k++) {
      const uint32_t first[] = {v[0][0], v[1][0]};
      for (unsigned n = 0; n < 2; n++)
        for (unsigned l = 0; l < kMaxLanes; l++) v[n][l] = v[n][l] * 2 + first[1 - n];
    }
    for (unsigned n = 0; n < 2; n++)
      for (unsigned l = 0; l < kMaxLanes; l++) ASSERT_EQ(rows[n].out.get(Type::I32, l), v[n][l]) << n << ", " << l;
  }
}

TEST(ControlFlow, barriersDoNothingInAGroupOfOneRow) {
  const Function f = parsed(R"(
    %1 = input i32 0
    barrier
    output 0 %1
  )");
  RowRun run(1, 1);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::I32, lane, lane * 3);
  run(f);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) EXPECT_EQ(run.outputs[0].get(Type::I32, lane), lane * 3);
}

TEST(ControlFlow, onlyLoopsThatMayWaitForOthersGiveWay) {
  const char* text = R"(function "long loop" shared=4
    %zero = const i32 0
    %one = const i32 1
    %limit = const i32 5000
    %k = var i32
    loop
      %now = var.get i32 %k
      %done = ule mask %limit, %now
      if %done
        break 0
      endif
      %next = iadd i32 %now, %one
      var.set %k, %next
    endloop
    %old = LOAD
    %sum = var.get i32 %k
    output 0 %sum
  )";
  for (const bool atomic : {false, true}) {
    std::string t = text;
    t.replace(t.find("LOAD"), 4, atomic ? "shared.atomic i32 add+0 %zero, %one" : "shared.load i32 %zero");
    auto compiled = compileInterpreter(parsed(t), {});
    ASSERT_TRUE(compiled) << compiled.error().message;
    Tables tables{};
    std::vector<std::byte> shared(4);
    const UniformBank bank = (*compiled)->preamble(tables);
    GroupRow row(0, shared, tables);
    row.state = (*compiled)->newRowState();
    Progress p = (*compiled)->start(bank, row.context, *row.state);
    unsigned yields = 0;
    for (; p == Progress::Yielded; p = (*compiled)->resume(*row.state)) yields++;
    EXPECT_EQ(p, Progress::Finished);
    EXPECT_EQ(yields > 0, atomic);
    EXPECT_EQ(row.out.get(Type::I32, 77), 5000u);
  }
}

}  // namespace
}  // namespace pumice::interp
