// Random programs (tests/support/random_program.h) as machine code, in chunks of every width: the bits of the interpreter,
// which the interpreter's own tests compare with the reference.
#include <gtest/gtest.h>

#include "spirv_interp/ir/one_record.h"
#include "spirv_interp/ir/passes.h"
#include "spirv_interp/jit/jit.h"
#include "tests/support/world.h"

namespace pumice::testing {
namespace {

void agrees(uint64_t seed, bool optimise, ir::Numerics numerics = ir::Numerics::F32) {
  Choices choices(seed);
  const Program p = makeProgram(choices, {});
  ASSERT_EQ(ir::verify(p.function), "") << "seed " << seed;
  ir::Function f = p.function;
  if (optimise) ir::optimise(f);
  World world(p, seed, randomShape(seed));
  auto interpreted = interp::compileInterpreter(f, {.numerics = numerics, .checked = {}});
  ASSERT_TRUE(interpreted) << interpreted.error().message;
  const Results want = world.run(**interpreted);
  constexpr jit::Isa kAvx512 = jit::Isa::Avx512;
  for (const jit::JitOptions& options : {jit::JitOptions{.chunkLanes = 8}, {.chunkLanes = 16}, {.chunkLanes = 32}, {}, {.chunkLanes = 16, .isa = kAvx512},
                                         {.chunkLanes = 8, .isa = kAvx512, .upperFirst = true}, {.isa = kAvx512, .upperFirst = true}}) {
    auto native = jit::compile(f, {.numerics = numerics, .checked = {}}, options);
    ASSERT_TRUE(native) << native.error().message << "\nseed " << seed << "\n" << ir::print(f);
    if (!jit::runs(options.isa)) continue;   // at least it can be encoded
    ASSERT_EQ(world.difference(want, world.run(**native)), "")
        << "chunks of " << options.chunkLanes << (options.isa == kAvx512 ? ", AVX-512" : "") << (options.upperFirst ? ", upper registers first" : "")
        << ", seed " << seed << (optimise ? ", optimised" : "") << ", rows of " << randomShape(seed).rowLanes << "\n" << ir::print(f);
  }
}
void agree(uint64_t first, uint64_t count, ir::Numerics numerics = ir::Numerics::F32) {
  if (!jit::available()) GTEST_SKIP();
  for (uint64_t seed = first; seed < first + count && !::testing::Test::HasFailure(); seed++) agrees(seed, seed % 3 == 0, numerics);
}

TEST(JitRandomPrograms, giveTheSameBitsInRowsOfWholeBlocks) {
  if (!jit::available()) GTEST_SKIP();
  for (uint64_t seed = 50'001; seed < 50'300 && !::testing::Test::HasFailure(); seed++) {
    Choices choices(seed);
    Program p = makeProgram(choices, {});
    if (seed % 3) ir::optimise(p.function);
    for (ir::Inst& i : p.function.insts)
      if (i.op == ir::Op::QuadLoad) i.imm |= ir::kOneRecord;
    const WorldShape shape{.rowLanes = seed % 2 ? 128u : 32u, .groups = 2, .awkward = seed % 4 < 2, .wholeBlocks = true};
    World world(p, seed, shape);
    auto interpreted = interp::compileInterpreter(p.function, {});
    ASSERT_TRUE(interpreted) << interpreted.error().message;
    const Results want = world.run(**interpreted);
    for (const jit::JitOptions& options : {jit::JitOptions{.chunkLanes = 8, .wholeBlocks = true}, {.chunkLanes = 16, .wholeBlocks = true},
                                           {.chunkLanes = 32, .wholeBlocks = true}, {.wholeBlocks = true},
                                           {.isa = jit::Isa::Avx512, .upperFirst = true, .wholeBlocks = true}}) {
      auto native = jit::compile(p.function, {}, options);
      ASSERT_TRUE(native) << native.error().message << "\nseed " << seed << "\n" << ir::print(p.function);
      if (!jit::runs(options.isa)) continue;   // at least it can be encoded
      ASSERT_EQ(world.difference(want, world.run(**native)), "") << "chunks of " << options.chunkLanes << ", seed " << seed << "\n" << ir::print(p.function);
    }
  }
}
TEST(JitRandomPrograms, giveTheBitsOfTheInterpreter) { agree(1, 700); }
TEST(JitRandomPrograms, giveTheOraclesBits) { agree(20'001, 120, ir::Numerics::Oracle); }
// The run of issue-sized length: --gtest_also_run_disabled_tests.
TEST(JitRandomPrograms, DISABLED_tenThousandGiveTheBitsOfTheInterpreter) { agree(100'000, 10'000); }

}  // namespace
}  // namespace pumice::testing
