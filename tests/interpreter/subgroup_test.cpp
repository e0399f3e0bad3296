// Operations across the lanes of a subgroup, against the evaluator's plain definitions.
#include "fixture.h"
#include "spirv_interp/ir/text.h"
#include "tests/ir/evaluate.h"

namespace pumice::interp {
namespace {

//! Runs f with random inputs on every target and compares all outputs with the evaluator's.
void compare(const Function& f, Random& r, const std::string& what) {
  ASSERT_EQ(ir::verify(f), "") << what;
  static constexpr uint32_t kLanes[] = {1, 7, 32, 50, 127, 128};
  RowRun start(4, 8);
  start.lanes = kLanes[r.below(std::size(kLanes))];
  if (r.chance(50)) start.active[0] = r.next(), start.active[1] = r.next();
  ir::Evaluation e;
  e.lanes = start.lanes;
  for (uint32_t l = 0; l < start.lanes; l++) e.active.push_back(start.active[l / 64] >> (l % 64) & 1);
  Type outputs[8] = {};
  for (Value v = 1; v < f.insts.size(); v++) {
    const Inst& i = f.insts[v];
    if (i.op == Op::Output) outputs[i.imm] = f.type(f.operands(v)[0]);
    if (i.op != Op::Input) continue;
    ir::Row& row = e.inputs[uint32_t(i.imm)];
    for (uint32_t l = 0; l < start.lanes; l++) {
      row.push_back(awkwardBits(r, i.type));
      start.inputs[i.imm].set(i.type, l, row[l]);
    }
  }
  ir::evaluate(f, e);
  ASSERT_EQ(e.error, "") << what;
  for (const Target& target : availableTargets()) {
    RowRun run = start;
    run(f, target);
    for (unsigned k = 0; k < 8; k++)
      for (uint32_t l = 0; l < start.lanes && outputs[k] != Type::None; l++)
        if (e.active[l] && e.outputs.count(k)) {
          ASSERT_EQ(run.outputs[k].get(outputs[k], l), e.outputs[k][l]) << target.name << ' ' << what << " lane " << l << " of " << start.lanes;
        }
  }
}

TEST(Subgroup, reductionsAndScansFollowTheFixedTree) {
  Random r(5);
  for (Type t : kDataTypes)
    for (unsigned op = 0; op < std::size(ir::kReduceNames); op++) {
      const bool floating = ir::opInfo(ir::reduceOperation(ir::ReduceOp(op))).operands == ir::OperandRule::Float;
      if (floating != ir::isFloat(t)) continue;
      for (unsigned scan = 0; scan < 3; scan++)
        for (unsigned log = 0; log <= 5; log++) {
          Function f;
          const Value in = append(f, Op::Input, t, {}, 0), m = append(f, Op::Input, Type::Mask, {}, 1);
          const uint64_t imm = op | scan << 8 | log << 16;
          const Value all = append(f, Op::SubgroupReduce, t, {in}, imm);
          append(f, Op::Output, Type::None, {all}, 0);
          append(f, Op::If, Type::None, {m});
          const Value some = append(f, Op::SubgroupReduce, t, {in}, imm);
          append(f, Op::Output, Type::None, {some}, 1);
          append(f, Op::EndIf, Type::None, {});
          compare(f, r, std::string(ir::kTypeNames[size_t(t)]) + ' ' + ir::kReduceNames[op] + ' ' + ir::kScanNames[scan] + ' ' + std::to_string(1 << log));
          if (HasFailure()) return;
        }
    }
}

TEST(Subgroup, ballotsVotesAndShufflesStayInTheirSubgroup) {
  Random r(6);
  for (int round = 0; round < 20; round++) {
    for (Type t : kDataTypes) {
      Function f;
      const Value in = append(f, Op::Input, t, {}, 0), m = append(f, Op::Input, Type::Mask, {}, 1), lane = append(f, Op::Input, Type::I32, {}, 2);
      const Value second = append(f, Op::Input, Type::Mask, {}, 3);
      append(f, Op::If, Type::None, {m});
      const Value ballot = append(f, Op::SubgroupBallot, Type::I32, {second});
      append(f, Op::Output, Type::None, {ballot}, 0);
      const Value any = append(f, Op::SubgroupAny, Type::Mask, {second}), every = append(f, Op::SubgroupAll, Type::Mask, {second});
      append(f, Op::Output, Type::None, {any}, 1);
      append(f, Op::Output, Type::None, {every}, 2);
      append(f, Op::EndIf, Type::None, {});
      // Lanes that are not active have no value worth reading.
      const Value active = append(f, Op::SubgroupBallot, Type::I32, {append(f, Op::ExecMask, Type::Mask, {})});
      const Value shift = append(f, Op::LShr, Type::I32, {active, lane}), one = append(f, Op::Const, Type::I32, {}, 1);
      const Value there = append(f, Op::And, Type::I32, {shift, one}), zero = append(f, Op::Const, Type::I32, {}, 0);
      const Value alive = append(f, Op::INe, Type::Mask, {there, zero});
      const Value moved = append(f, Op::SubgroupShuffle, t, {in, lane});
      append(f, Op::If, Type::None, {alive});
      append(f, Op::Output, Type::None, {moved}, 3);
      append(f, Op::EndIf, Type::None, {});
      const Value fixed = append(f, Op::Const, Type::I32, {}, 32 * r.below(3));
      const Value first = append(f, Op::And, Type::I32, {active, one}), firstAlive = append(f, Op::INe, Type::Mask, {first, zero});
      const Value broadcast = append(f, Op::SubgroupShuffle, t, {in, fixed});
      append(f, Op::If, Type::None, {firstAlive});
      append(f, Op::Output, Type::None, {broadcast}, 4);
      append(f, Op::EndIf, Type::None, {});
      compare(f, r, ir::kTypeNames[size_t(t)]);
      if (HasFailure()) return;
    }
  }
}

TEST(Subgroup, badReductionsAreNoValidFunctions) {
  for (const auto& [type, imm] : {std::pair{Type::I32, uint64_t(ir::ReduceOp::FAdd)}, {Type::F32, uint64_t(ir::ReduceOp::IAdd)}, {Type::I32, uint64_t(13)},
                                  {Type::I32, uint64_t(3) << 8}, {Type::I32, uint64_t(6) << 16}, {Type::Mask, uint64_t(ir::ReduceOp::And)}}) {
    Function f;
    append(f, Op::SubgroupReduce, type, {append(f, Op::Input, type, {}, 0)}, imm);
    EXPECT_NE(ir::verify(f), "") << imm;
  }
}

}  // namespace
}  // namespace pumice::interp
