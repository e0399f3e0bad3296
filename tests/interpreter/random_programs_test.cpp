// Random programs (tests/support/random_program.h): every instruction set, row length and number of threads gives the bits of
// the reference, before and after the passes.
#include <gtest/gtest.h>

#include <algorithm>

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/passes.h"
#include "tests/support/world.h"

namespace pumice::testing {
namespace {

using ir::Op;

constexpr uint64_t kFirstSeed = 1, kSeeds = 1200;   // what an ordinary run of the tests takes

Program program(uint64_t seed, const ProgramOptions& options = {}) {
  Choices choices(seed);
  return makeProgram(choices, options);
}

std::unique_ptr<interp::Executable> compiled(const ir::Function& f, const interp::Target& target, ir::Numerics numerics = ir::Numerics::F32) {
  auto e = interp::compileInterpreterFor(f, {numerics, {}}, target);
  EXPECT_TRUE(e) << e.error().message << "\n" << ir::print(f);
  return e ? std::move(e).value() : nullptr;
}

void agrees(uint64_t seed, bool optimise, const WorldShape& shape, unsigned threads = 1) {
  const Program p = program(seed);
  ASSERT_EQ(ir::verify(p.function), "") << "seed " << seed << "\n" << ir::print(p.function);
  ir::Function f = p.function;
  if (optimise) {
    ir::optimise(f);
    ASSERT_EQ(ir::verify(f), "") << "optimised, seed " << seed << "\n" << ir::print(p.function);
  }
  World world(p, seed, shape);
  const Results want = world.evaluate(p.function);
  for (const interp::Target& target : interp::availableTargets()) {
    const auto e = compiled(f, target);
    if (!e) return;
    ASSERT_EQ(world.difference(want, world.run(*e, threads)), "")
        << target.name << ", seed " << seed << (optimise ? ", optimised" : "") << ", rows of " << shape.rowLanes << "\n" << ir::print(f);
  }
}
void agree(uint64_t first, uint64_t count) {
  for (uint64_t seed = first; seed < first + count && !::testing::Test::HasFailure(); seed++) agrees(seed, seed % 3 == 0, randomShape(seed));
}

TEST(RandomPrograms, holdEveryOperationAndAboutSixty) {
  uint64_t count[unsigned(Op::kCount)] = {};
  std::vector<unsigned> lengths;
  for (uint64_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; seed++) {
    const Program p = program(seed);
    ASSERT_EQ(ir::verify(p.function), "") << "seed " << seed << "\n" << ir::print(p.function);
    for (size_t v = 1; v < p.function.insts.size(); v++) count[unsigned(p.function.insts[v].op)]++;
    lengths.push_back(operationCount(p.function));
  }
  for (unsigned op = 1; op < unsigned(Op::kCount); op++)
    if (isAbstract(Op(op))) EXPECT_EQ(count[op], 0u) << ir::opInfo(Op(op)).text;
    else EXPECT_GE(count[op], 5u) << ir::opInfo(Op(op)).text;
  std::nth_element(lengths.begin(), lengths.begin() + lengths.size() / 2, lengths.end());
  const unsigned median = lengths[lengths.size() / 2];
  RecordProperty("median", int(median));
  EXPECT_GE(median, 55u);
  EXPECT_LE(median, 75u);
}

TEST(RandomPrograms, dependOnTheirInputs) {
  unsigned outputs = 0, dependent = 0, divergent = 0, insensitive = 0;
  constexpr unsigned kCount = 300;
  for (uint64_t seed = 1; seed <= kCount; seed++) {
    const Program p = program(seed);
    const WorldShape shape{.rowLanes = 32, .awkward = false};
    World a(p, 1, shape), b(p, 2, shape);
    const Results ra = a.evaluate(p.function), rb = b.evaluate(p.function);
    ASSERT_EQ(ra.error + rb.error, "") << "seed " << seed;
    unsigned differ = 0, vary = 0;
    for (uint32_t slot = 0; slot < p.outputs.size(); slot++) {
      bool differs = false, varies = false;
      for (uint32_t lane = 0; lane < a.lanes(); lane++) {
        differs |= a.output(ra, slot, lane) != b.output(rb, slot, lane);
        varies |= a.output(ra, slot, lane) != a.output(ra, slot, 0);
      }
      differ += differs;
      vary += varies;
    }
    outputs += unsigned(p.outputs.size());
    dependent += differ;
    divergent += vary;
    insensitive += differ * 2 < p.outputs.size();
  }
  // Most outputs see the inputs, and few programs are blind.
  EXPECT_GE(dependent, outputs * 3 / 4) << outputs;
  EXPECT_GE(divergent, outputs * 2 / 3) << outputs;
  EXPECT_LE(insensitive, kCount / 10);
}

TEST(RandomPrograms, giveTheBitsOfTheReferenceOnEveryInstructionSet) { agree(kFirstSeed, kSeeds); }

// The run of issue-sized length: --gtest_also_run_disabled_tests.
TEST(RandomPrograms, DISABLED_tenThousandGiveTheBitsOfTheReference) { agree(100'000, 10'000); }

TEST(RandomPrograms, giveTheSameBitsInRowsOfAnyLengthAndOnAnyNumberOfThreads) {
  for (uint64_t seed = 1; seed <= 60 && !HasFailure(); seed++)
    for (uint32_t lanes : {3u, 32u, 128u})
      for (unsigned threads : {1u, 2u, 5u}) agrees(seed, false, {.rowLanes = lanes, .groupRows = 1 + uint32_t(seed % 2), .groups = lanes == 128 ? 4u : 8u}, threads);
}

TEST(RandomPrograms, giveTheOraclesBitsOnEveryInstructionSet) {
  for (uint64_t seed = 20'001; seed <= 20'300 && !HasFailure(); seed++) {
    const Program p = program(seed);
    World world(p, seed, randomShape(seed));
    const Results want = world.evaluate(p.function, ir::Numerics::Oracle);
    for (const interp::Target& target : interp::availableTargets()) {
      const auto e = compiled(p.function, target, ir::Numerics::Oracle);
      if (!e) return;
      ASSERT_EQ(world.difference(want, world.run(*e)), "") << target.name << ", oracle, seed " << seed << "\n" << ir::print(p.function);
    }
  }
}

}  // namespace
}  // namespace pumice::testing
