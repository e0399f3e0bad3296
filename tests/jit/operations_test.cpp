// Every operation of the table, for every type it is allowed and operands from rows, draw constants and constants, as
// machine code: the bits of the executable form of the table (ir/fold.h).
#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/operation_cases.h"

namespace pumice::interp {
namespace {

enum class From : uint8_t { Row, Draw, Constant };

std::string nameOf(const OperationCase& c, const From* from) {
  std::string s = nameOf(c) + " of";
  for (unsigned k = 0; k < c.count(); k++) s += from[k] == From::Row ? " row" : from[k] == From::Draw ? " draw" : " constant";
  return s;
}

void check(const OperationCase& c, const From* from, jit::JitOptions options, Random& random) {
  const unsigned count = c.count();
  uint64_t fixed[8] = {};
  Function f;
  std::vector<Value> in;
  for (unsigned k = 0; k < count; k++) {
    const Type t = c.of(k);
    fixed[k] = awkwardBits(random, t);
    if (from[k] == From::Row) in.push_back(append(f, Op::Input, t, {}, k));
    else if (from[k] == From::Constant) in.push_back(append(f, Op::Const, t, {}, fixed[k]));
    else if (t != Type::Mask) in.push_back(append(f, Op::UniformInput, t, {}, 8 * k));
    else {
      const Value bits = append(f, Op::UniformInput, Type::I32, {}, 8 * k);
      in.push_back(append(f, Op::INe, Type::Mask, {bits, append(f, Op::Const, Type::I32, {}, 0)}));
    }
  }
  append(f, Op::Output, Type::None, {appendAll(f, c.op, c.type, in)}, 0);
  ASSERT_EQ(ir::verify(f), "") << nameOf(c, from);
  std::string listing;
  options.listing = &listing;
  auto compiled = jit::compile(f, {}, options);
  ASSERT_TRUE(compiled) << compiled.error().message << "\n" << listing;
  if (!jit::runs(options.isa)) return;   // at least it can be encoded
  for (unsigned round = 0; round < 3; round++) {
    RowRun run = operandRow(c, random);
    run.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(fixed), sizeof fixed};
    run.execute(**compiled);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      uint64_t args[3] = {}, want = 0;
      for (unsigned k = 0; k < count; k++) args[k] = from[k] == From::Row ? run.inputs[k].get(c.of(k), lane) : fixed[k];
      ASSERT_TRUE(ir::foldConstant(c.op, c.type, c.operand, {args, count}, want));
      ASSERT_EQ(run.outputs[0].get(c.type, lane), want) << nameOf(c, from) << ", lane " << lane << std::hex << ": " << args[0] << " " << args[1] << " "
                                                        << args[2] << "\n" << listing;
    }
  }
}

TEST(JitOperations, giveTheBitsOfTheOperationTable) {
  if (!jit::available()) GTEST_SKIP();
  Random random(7);
  for (const OperationCase& c : operationCases()) {
    unsigned forms = 1;
    for (unsigned k = 0; k < c.count(); k++) forms *= 3;
    for (unsigned form = 0; form < forms && !HasFailure(); form++) {
      const From from[3] = {From(form % 3), From(form / 3 % 3), From(form / 9 % 3)};
      const uint32_t lanes = 8u << random.below(3);
      check(c, from, {.chunkLanes = lanes}, random);
      check(c, from, {.chunkLanes = lanes, .isa = jit::Isa::Avx512, .upperFirst = true}, random);
    }
  }
}

}  // namespace
}  // namespace pumice::interp
