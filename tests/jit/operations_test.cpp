// Every operation of the table, for every type it is allowed and operands from rows, draw constants and constants, as
// machine code: the bits of the executable form of the table (ir/fold.h).
#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {
namespace {

bool isPureArithmetic(Op op) {
  const ir::OpInfo& info = ir::opInfo(op);
  return (info.flags & ir::kPure) && !(info.flags & ir::kHigh) && info.operands != ir::OperandRule::Free && op != Op::Nop;
}

struct Case {
  Op op;
  Type type, operand, first;   // of the result, of the last operand, of operand 0
};

Value appendAll(Function& f, Op op, Type type, const std::vector<Value>& operands) {
  const uint32_t first = uint32_t(f.operandPool.size());
  f.operandPool.insert(f.operandPool.end(), operands.begin(), operands.end());
  const Value v = append(f, op, type, {});
  f.insts[v].firstOperand = first;
  f.insts[v].operandCount = uint32_t(operands.size());
  return v;
}

std::vector<Case> allCases() {
  std::vector<Case> cases;
  constexpr Type kTypes[] = {Type::Mask, Type::I8, Type::I16, Type::I32, Type::I64, Type::F16, Type::F32, Type::F64};
  for (unsigned o = 1; o < kOpCount; o++) {
    const Op op = Op(o);
    if (!isPureArithmetic(op)) continue;
    for (Type type : kTypes)
      for (Type operand : kTypes) {
        const Type first = op == Op::Select ? Type::Mask : operand;
        Function f;
        std::vector<Value> in;
        for (unsigned k = 0; k < ir::opInfo(op).operandCount; k++) in.push_back(append(f, Op::Input, k == 0 ? first : operand, {}, k));
        appendAll(f, op, type, in);
        if (ir::verify(f).empty()) cases.push_back({op, type, operand, first});
      }
  }
  return cases;
}

enum class From : uint8_t { Row, Draw, Constant };

std::string nameOf(const Case& c, const From* from) {
  static constexpr const char* kNames[] = {"none", "mask", "i8", "i16", "i32", "i64", "f16", "f32", "f64", "tuple"};
  std::string s = std::string(ir::opInfo(c.op).text) + " " + kNames[unsigned(c.operand)] + " -> " + kNames[unsigned(c.type)] + " of";
  for (unsigned k = 0; k < ir::opInfo(c.op).operandCount; k++) s += from[k] == From::Row ? " row" : from[k] == From::Draw ? " draw" : " constant";
  return s;
}

void check(const Case& c, const From* from, uint32_t lanes, Random& random) {
  const unsigned count = ir::opInfo(c.op).operandCount;
  uint64_t fixed[8] = {};
  Function f;
  std::vector<Value> in;
  for (unsigned k = 0; k < count; k++) {
    const Type t = k == 0 ? c.first : c.operand;
    fixed[k] = randomBits(random, t);
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
  auto compiled = jit::compile(f, {}, {.chunkLanes = lanes, .listing = &listing});
  ASSERT_TRUE(compiled) << compiled.error().message;
  for (unsigned round = 0; round < 3; round++) {
    RowRun run(count, 1);
    for (unsigned k = 0; k < count; k++) {
      const Type t = k == 0 ? c.first : c.operand;
      for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[k].set(t, lane, randomBits(random, t));
      if (k && c.first == c.operand)
        for (unsigned lane = 0; lane < kMaxLanes; lane += 5) run.inputs[k].set(t, lane, run.inputs[0].get(t, lane));
    }
    run.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(fixed), sizeof fixed};
    run.execute(**compiled);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      uint64_t args[3] = {}, want = 0;
      for (unsigned k = 0; k < count; k++) args[k] = from[k] == From::Row ? run.inputs[k].get(k == 0 ? c.first : c.operand, lane) : fixed[k];
      ASSERT_TRUE(ir::foldConstant(c.op, c.type, c.operand, {args, count}, want));
      ASSERT_EQ(run.outputs[0].get(c.type, lane), want) << nameOf(c, from) << ", lane " << lane << std::hex << ": " << args[0] << " " << args[1] << " "
                                                        << args[2] << "\n" << listing;
    }
  }
}

TEST(JitOperations, giveTheBitsOfTheOperationTable) {
  if (!jit::available()) GTEST_SKIP();
  Random random(7);
  for (const Case& c : allCases()) {
    const unsigned count = ir::opInfo(c.op).operandCount;
    unsigned forms = 1;
    for (unsigned k = 0; k < count; k++) forms *= 3;
    for (unsigned form = 0; form < forms && !HasFailure(); form++) {
      const From from[3] = {From(form % 3), From(form / 3 % 3), From(form / 9 % 3)};
      check(c, from, 8u << random.below(3), random);
    }
  }
}

}  // namespace
}  // namespace pumice::interp
