// Fuzzes the interpreter: the bytes choose a random valid program (tests/support/random_program.h), which must give the bits of
// the reference on every instruction set, before and after the passes; or a float program, which must be near the oracle.
#include <cstdio>
#include <cstdlib>

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/passes.h"
#include "tests/support/near_oracle.h"
#include "tests/support/world.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

using namespace pumice;

namespace {

void require(const std::string& problem, const char* where, const ir::Function& f) {
  if (problem.empty()) return;
  std::fprintf(stderr, "%s: %s\n%s", where, problem.c_str(), ir::print(f).c_str());
  std::abort();
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 3) return 0;
  const uint8_t shape = data[0], seed = data[1];
  testing::Choices choices(std::span(data + 2, size - 2));
  if (seed >> 5 == 3) {
    testing::NearOracleCounts counts;
    if (const std::string problem = testing::nearOracleProblem(choices, counts); !problem.empty()) {
      std::fprintf(stderr, "%s\n", problem.c_str());
      std::abort();
    }
    return 0;
  }
  const testing::Program program = testing::makeProgram(choices, {.length = 16 + (shape & 0x7fu)});
  require(ir::verify(program.function), "the generator", program.function);
  ir::Function f = program.function;
  if (seed & 1) {
    ir::optimise(f);
    require(ir::verify(f), "the passes", f);
  }
  static constexpr uint32_t kLanes[] = {3, 32, 64, 128};
  testing::World world(program, seed, {.rowLanes = kLanes[seed >> 1 & 3], .groupRows = 1u + (shape >> 7), .partial = (seed & 8) != 0, .awkward = (seed & 16) != 0});
  const testing::Results want = world.evaluate(program.function);
  for (const interp::Target& target : interp::availableTargets()) {
    const auto executable = interp::compileInterpreterFor(f, {}, target);
    if (!executable) require(executable.error().message, target.name, f);
    require(world.difference(want, world.run(**executable)), target.name, f);
  }
  return 0;
}
