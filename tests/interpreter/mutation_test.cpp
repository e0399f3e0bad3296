// Breaks the interpreter's kernels one by one, each in one lane by one bit (or by doing nothing, or by losing a lane): the random
// programs must notice each time. What they do not notice they do not test.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "spirv_interp/interpreter/lower.h"
#include "spirv_interp/ir/passes.h"
#include "tests/support/world.h"

namespace pumice::testing {
namespace {

using interp::Code, interp::Control, interp::Internal, interp::Kernel, interp::KernelTable, interp::RunState;
using ir::Op, ir::Type;

// How a kernel is broken.
enum class Way {
  FlipsBit,    //!< of the result's first active lane
  DoesNothing,
  LosesLane,   //!< the first active lane is not active afterwards
  SoilsLocal,  //!< memory that should be zero
};
struct Mutant {
  std::string name;   // of all its places in the table
  Way way;
  Type result = Type::None;
};

Kernel broken = nullptr;   // the one that is broken now, how
Way brokenWay;
Type brokenResult;

// A broken counter must not keep us here: after so many turns loops are left at once.
uint32_t turnsLeft = 0;
Kernel endLoop = nullptr;
const Code* countedEndLoop(RunState& s, const Code* c) {
  if (turnsLeft) turnsLeft--;
  else s.exec[0] = s.exec[1] = 0;
  return endLoop(s, c);
}

uint32_t firstActive(const uint64_t* exec) { return exec[0] ? uint32_t(__builtin_ctzll(exec[0])) : 64 + uint32_t(__builtin_ctzll(exec[1])); }

const Code* brokenKernel(RunState& s, const Code* c) {
  if (s.none()) return broken(s, c);
  switch (brokenWay) {
    case Way::DoesNothing: return c + 1;
    case Way::SoilsLocal: {
      const Code* next = broken(s, c);
      s.local[c->src[3] + firstActive(s.exec) * 4] ^= std::byte(1);
      return next;
    }
    case Way::LosesLane: {
      const Code* next = broken(s, c);
      if (s.none()) return next;
      const uint32_t lane = firstActive(s.exec);
      s.exec[lane / 64] &= ~(uint64_t(1) << lane % 64);
      return next;
    }
    case Way::FlipsBit: break;
  }
  const uint32_t lane = firstActive(s.exec);
  const Code* next = broken(s, c);
  if (brokenResult == Type::Mask) s.mask(c->dst)[lane / 64] ^= uint64_t(1) << lane % 64;
  else s.registers[c->dst + lane * ir::typeBytes(brokenResult)] ^= std::byte(1);
  return next;
}

//! Every kernel of the table, under the names of its places.
std::map<Kernel, Mutant> mutants(const KernelTable& t) {
  std::map<Kernel, Mutant> list;
  auto add = [&](Kernel k, std::string name, Way way, Type result) {
    if (!k) return;
    Mutant& m = list[k];
    m.way = way;
    m.result = result;
    m.name += (m.name.empty() ? "" : ", ") + name;
  };
  constexpr const char* kTypes[] = {"none", "mask", "i8", "i16", "i32", "i64", "f16", "f32", "f64", "tuple"};
  for (unsigned op = 1; op < interp::kOpCount; op++) {
    if (isAbstract(Op(op))) continue;
    const ir::OpInfo& info = ir::opInfo(Op(op));
    for (unsigned type = 0; type < interp::kTypeCount; type++)
      for (unsigned form = 0; form < interp::kOperandForms; form++) {
        const bool compares = info.operands == ir::OperandRule::CmpF || info.operands == ir::OperandRule::CmpI;
        const Way way = Op(op) == Op::LocalAlloc ? Way::SoilsLocal : info.result == ir::ResultRule::None ? Way::DoesNothing : Way::FlipsBit;
        add(t.op[op][type][form], std::string(info.text) + " " + kTypes[type] + " form " + std::to_string(form), way, compares ? Type::Mask : Type(type));
      }
    for (unsigned from = 0; from < interp::kTypeCount; from++)
      for (unsigned to = 0; to < interp::kTypeCount; to++)
        add(t.convert[op][from][to], std::string(info.text) + " from " + kTypes[from] + " to " + kTypes[to], Way::FlipsBit, Type(to));
  }
  constexpr const char* kInternal[] = {"splat", "copy", "set masked", "zero", "canon", "to bank", "output"};
  for (unsigned k = 0; k < unsigned(Internal::kCount); k++)
    for (unsigned type = 0; type < interp::kTypeCount; type++)
      for (unsigned form = 0; form < 2; form++) {
        const bool nowhere = Internal(k) == Internal::ToBank || Internal(k) == Internal::OutputRow;
        add(t.internal[k][type][form], std::string(kInternal[k]) + " " + kTypes[type], nowhere ? Way::DoesNothing : Way::FlipsBit, Type(type));
      }
  // Without `end` there is no program.
  for (Control k : {Control::If, Control::Else, Control::EndIf, Control::Loop, Control::EndLoop, Control::Block, Control::EndBlock})
    add(t.control[unsigned(k)], "control " + std::to_string(unsigned(k)), Way::LosesLane, Type::None);
  for (Control k : {Control::Leave, Control::Break, Control::Barrier}) add(t.control[unsigned(k)], "control " + std::to_string(unsigned(k)), Way::DoesNothing, Type::None);
  return list;
}

KernelTable without(const KernelTable& t, Kernel k) {
  KernelTable copy = t;
  auto* entries = reinterpret_cast<Kernel*>(&copy);
  std::replace(entries, entries + sizeof copy / sizeof(Kernel), k, Kernel(brokenKernel));
  endLoop = std::exchange(copy.control[unsigned(Control::EndLoop)], Kernel(countedEndLoop));
  return copy;
}

struct Case {
  Program program;
  ir::Function lowered;
  std::unique_ptr<World> world;
  Results want;
};

std::vector<Case> makeCases(unsigned count) {
  std::vector<Case> cases(count);
  for (unsigned k = 0; k < count; k++) {
    Choices choices(500'000 + k);
    Case& c = cases[k];
    c.program = makeProgram(choices);
    c.world = std::make_unique<World>(c.program, k, WorldShape{.rowLanes = 32, .groupRows = 2, .awkward = k % 3 == 0});
    c.want = c.world->evaluate(c.program.function);
    c.lowered = c.program.function;
    ir::lowerMath(c.lowered, ir::Numerics::F32);
    ir::computeRates(c.lowered);
  }
  return cases;
}

void noticesEveryKernel(const interp::Target& target, const std::vector<Case>& cases) {
  const KernelTable& table = interp::kernelTable(target);
  std::map<Kernel, std::vector<const Case*>> users;
  for (const Case& c : cases) {
    auto code = interp::lower(c.lowered, table);
    ASSERT_TRUE(code) << code.error().message;
    std::set<Kernel> used;
    for (const auto* list : {&code->body, &code->preamble})
      for (const Code& i : *list) used.insert(i.run);
    for (Kernel kernel : used) users[kernel].push_back(&c);
  }
  size_t noticed = 0, total = 0;
  for (const auto& [kernel, mutant] : mutants(table)) {
    total++;
    const KernelTable mutated = without(table, kernel);
    broken = kernel;
    brokenWay = mutant.way;
    brokenResult = mutant.result;
    bool seen = false;
    for (const Case* c : users[kernel]) {
      const auto e = interp::compileInterpreterWith(c->lowered, {}, mutated);
      turnsLeft = 10'000;
      seen = !c->world->difference(c->want, c->world->run(**e)).empty();
      if (seen) break;
    }
    noticed += seen;
    EXPECT_TRUE(seen) << target.name << ": nobody notices when this is broken: " << mutant.name << " (in " << users[kernel].size() << " programs)";
  }
  std::printf("%s: %zu of %zu kernels\n", target.name, noticed, total);
}

TEST(Mutation, everyBrokenKernelIsNoticed) {
  const std::vector<Case> cases = makeCases(4000);
  for (const interp::Target& target : interp::availableTargets()) noticesEveryKernel(target, cases);
}

}  // namespace
}  // namespace pumice::testing
