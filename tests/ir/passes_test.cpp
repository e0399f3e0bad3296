#include "spirv_interp/ir/passes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "spirv_interp/ir/pass_list.h"
#include "tests/ir/evaluate.h"
#include "tests/support/processor_time.h"

namespace pumice::ir {
namespace {

Function parsed(std::string_view text) {
  Function f;
  std::string error;
  EXPECT_TRUE(parse(text, f, error)) << error;
  EXPECT_EQ(verify(f), "") << text;
  return f;
}

Function optimised(std::string_view text) {
  Function f = parsed(text);
  optimise(f);
  EXPECT_EQ(verify(f), "") << print(f);
  return f;
}

size_t count(const Function& f, Op op) { return size_t(std::ranges::count(f.insts, op, &Inst::op)); }

TEST(Optimise, aVarReadBehindItsStoreIsTheStoredValue) {
  const Function f = optimised(R"(
    %a = input f32 0
    %v = var f32
    var.set %v, %a
    %b = var.get f32 %v
    %c = fadd f32 %b, %b
    output 0 %c)");
  EXPECT_EQ(count(f, Op::Var) + count(f, Op::VarGet) + count(f, Op::VarSet), 0u) << print(f);
}

TEST(Optimise, nestedRegionsKnowTheOuterValue) {
  const Function f = optimised(R"(
    %a = input f32 0
    %m = input mask 1
    %v = var f32
    var.set %v, %a
    if %m
      loop
        %b = var.get f32 %v
        output 0 %b
        break 0
      endloop
    endif
    %c = var.get f32 %v
    output 1 %c)");
  EXPECT_EQ(count(f, Op::VarGet), 0u) << print(f);
}

TEST(Optimise, aVarSetInALoopIsUnknownAtTheLoopsStartAndBehindIt) {
  const Function f = optimised(R"(
    %one = const i32 1
    %ten = const i32 10
    %v = var i32
    loop
      %i = var.get i32 %v
      %n = iadd i32 %i, %one
      var.set %v, %n
      %m = sle mask %ten, %n
      if %m
        break 0
      endif
    endloop
    %c = var.get i32 %v
    output 0 %c)");
  EXPECT_EQ(count(f, Op::VarGet), 2u) << print(f);
  Evaluation e;
  evaluate(f, e);
  EXPECT_EQ(e.outputs[0][0], 10u);
}

TEST(Optimise, anUnsetVarIsZero) {
  const Function f = optimised("%v = var f32\n%a = var.get f32 %v\noutput 0 %a");
  EXPECT_EQ(count(f, Op::VarGet), 0u);
  Evaluation e;
  evaluate(f, e);
  EXPECT_EQ(e.outputs[0][0], 0u);
}

TEST(Optimise, smallIfsBecomeSelects) {
  const Function f = optimised(R"(
    %a = input f32 0
    %b = input f32 1
    %m = flt mask %a, %b
    %v = var f32
    var.set %v, %a
    if %m
      %c = fadd f32 %a, %b
      var.set %v, %c
    else
      %d = fmul f32 %a, %b
      var.set %v, %d
    endif
    %e = var.get f32 %v
    output 0 %e)");
  EXPECT_EQ(count(f, Op::If) + count(f, Op::Var), 0u) << print(f);
  EXPECT_EQ(count(f, Op::Select), 1u);
}

TEST(Optimise, ifsWithEffectsOrDearOperationsStay) {
  EXPECT_EQ(count(optimised("%m = input mask 0\n%a = input f32 1\nif %m\noutput 0 %a\nendif"), Op::If), 1u);
  EXPECT_EQ(count(optimised("%m = input mask 0\n%a = input f32 1\n%v = var f32\nif %m\n%b = fdiv f32 %a, %a\n"
                            "var.set %v, %b\nendif\n%c = var.get f32 %v\noutput 0 %c"),
                  Op::If),
            1u);
}

TEST(Optimise, aReturnAtTheEndLeavesNoBlock) {
  const Function f = optimised(R"(
    %m = input mask 0
    %a = input f32 1
    block
      if %m
        output 0 %a
        break 0
      else
        output 1 %a
        break 0
      endif
    endblock)");
  EXPECT_EQ(count(f, Op::Block) + count(f, Op::Break), 0u) << print(f);
}

TEST(Optimise, anEarlyReturnKeepsItsBlockAndWhatLaneKnowsIt) {
  const Function f = optimised(R"(
    %m = input mask 0
    %a = input f32 1
    %v = var f32
    block
      if %m
        var.set %v, %a
        break 0
      endif
      %x = var.get f32 %v
      output 0 %x
    endblock
    %y = var.get f32 %v
    output 1 %y)");
  EXPECT_EQ(count(f, Op::Block), 1u);
  EXPECT_EQ(count(f, Op::VarGet), 1u) << "inside the block the value is still the old one\n" << print(f);
}

TEST(Optimise, branchesOnConstantsVanish) {
  const Function f = optimised(R"(
    %t = const mask 1
    %a = input f32 1
    loop
      if %t
        output 0 %a
        break 0
      else
        output 1 %a
      endif
      output 2 %a
    endloop)");
  EXPECT_EQ(count(f, Op::If), 0u);
  EXPECT_EQ(count(f, Op::Output), 1u) << print(f);
}

TEST(Optimise, deadImagesGoAndWritesStay) {
  const Function f = optimised(R"(
    %i = const i32 0
    %x = input f32 1
    %a = image tuple {sample 2d operands=0 image=0 sampler=0 texel=f32} %i, %i, %x, %x
    %b = image tuple {write 2d operands=0 image=0 sampler=0 texel=f32} %i, %i, %i, %i, %x, %x, %x, %x
    %c = tuple.get f32 1 %a)");
  EXPECT_EQ(count(f, Op::ImageOp), 1u);
}

TEST(Optimise, overwrittenStoresGo) {
  Function f = parsed(R"(
    %a = input f32 0
    %b = input f32 1
    %m = input mask 2
    %v = var f32
    var.set %v, %a
    var.set %v, %b
    if %m
      var.set %v, %a
    endif
    %c = var.get f32 %v
    output 0 %c)");
  removeDeadCode(f);
  EXPECT_EQ(count(f, Op::VarSet), 2u);
}

TEST(Rates, whatDoesNotDependOnTheLaneIsDrawRate) {
  Function f = parsed(R"(
    %zero = const i32 0
    %u = uniform f32 4
    %t = table.load i64 set0+16 %zero
    %l = load.const f32 +4 %t, %zero, %t
    %d = fadd f32 %u, %l
    %i = input f32 0
    %s = fadd f32 %d, %i
    %w = load.const f32 %t, %zero, %t !volatile
    %r = load f32 %t, %zero, %t
    %id = lane.id i32
    %k = load.const f32 %t, %id, %t
    %c = fsqrt f32 %l
    %desc = descriptor tuple 3 %zero
    %base = tuple.get i64 0 %desc
    %v = var f32
    %g = var.get f32 %v)");
  computeRates(f);
  std::string rates;
  for (Value v = 1; v < f.insts.size(); ++v) rates += "CDWSL"[static_cast<size_t>(f.insts[v].rate)];
  EXPECT_EQ(rates, "CDDDDLLLLLLDDDLL");
}

TEST(Inline, theExpanderStandsForTheAbstractOperations) {
  const Function shader = parsed(R"(
    %z = const i32 0
    %p = shader.input f32 2:1
    %b = builtin f32 15:0
    %d = descriptor tuple 7 %z
    %base = tuple.get i64 0 %d
    %size = tuple.get i64 1 %d
    %x = load.const f32 +8 %base, %z, %size
    %t = image tuple {sample 2d implicit operands=0 image=1 sampler=2 texel=f32} %z, %z, %p, %b
    %g = tuple.get f32 1 %t
    block
      %h = helper.mask mask
      if %h
        demote
        break 0
      endif
      shader.output 4:3 %g
      shader.output 4:2 %x
    endblock)");
  struct Recorder : Expander {
    std::string log;
    Value shaderInput(Builder& b, Type t, uint32_t v, uint32_t c, std::span<const Value>) override {
      log += "in" + std::to_string(v) + "." + std::to_string(c) + " ";
      return b.input(t, v);
    }
    void shaderOutput(Builder& b, uint32_t v, uint32_t c, Value value, std::span<const Value> rest) override {
      log += "out" + std::to_string(v) + "." + std::to_string(c) + " ";
      EXPECT_TRUE(rest.empty());
      b.output(c, value);
    }
    Value builtin(Builder& b, Type t, uint32_t id, uint32_t) override {
      log += "builtin" + std::to_string(id) + " ";
      return b.zero(t);
    }
    Buffer descriptor(Builder& b, uint32_t resource, Value) override {
      log += "buffer" + std::to_string(resource) + " ";
      return {b.uniform(Type::I64, 0), b.uniform(Type::I64, 8)};
    }
    std::vector<Value> image(Builder& b, const ImageOpInfo& info, std::span<const Value> operands) override {
      log += "image" + std::to_string(info.imageResource) + "(" + std::to_string(operands.size()) + ") ";
      return {b.f32(1), operands[2], b.f32(3), b.f32(4)};
    }
    void demote(Builder&) override { log += "demote "; }
    Value helperMask(Builder& b) override {
      log += "helper ";
      return b.input(Type::Mask, 9);
    }
  } recorder;
  Function routine;
  Builder b(routine);
  b.input(Type::F64, 5);
  inlineShader(b, shader, recorder);
  EXPECT_EQ(recorder.log, "in2.1 builtin15 buffer7 image1(4) helper demote out4.3 out4.2 ");
  EXPECT_EQ(verify(routine), "") << print(routine);
  for (const Inst& i : routine.insts) EXPECT_FALSE(opInfo(i.op).flags & kHigh);
}

// Random structured programs over a few vars: what optimise() makes of them must compute the same.
class Program {
 public:
  explicit Program(uint32_t seed) : random_(seed) {}

  std::string text() {
    for (int k = 0; k < 4; ++k)
      line("%in" + std::to_string(k) + " = input i32 " + std::to_string(k)),
          values_.push_back("in" + std::to_string(k));
    for (int k = 0; k < 3; ++k) line("%v" + std::to_string(k) + " = var i32");
    // Fuel makes every loop end.
    line("%fuel = var i32\n%full = const i32 40\n%one = const i32 1\nvar.set %fuel, %full");
    region(0, 0);
    for (int k = 0; k < 3; ++k) {
      line("%end" + std::to_string(k) + " = var.get i32 %v" + std::to_string(k));
      line("output " + std::to_string(k) + " %end" + std::to_string(k));
    }
    return out_;
  }

 private:
  void line(const std::string& s) { out_ += s + "\n"; }
  unsigned pick(unsigned n) { return unsigned(random_() % n); }
  std::string fresh() { return "t" + std::to_string(++next_); }
  std::string value() {
    if (pick(6) == 0) {
      const std::string n = fresh();
      static const char* const kConstants[] = {"0", "1", "-1", "2", "7", "31"};
      line("%" + n + " = const i32 " + kConstants[pick(6)]);
      return n;
    }
    return values_[pick(unsigned(values_.size()))];
  }
  std::string condition() {
    const std::string n = fresh(), a = value(), b = value();
    static const char* const kCompare[] = {"slt", "ult", "ieq", "ine", "sle"};
    line("%" + n + " = " + kCompare[pick(5)] + " mask %" + a + ", %" + b);
    return n;
  }

  void region(int depth, int breakable) {
    const size_t visible = values_.size();
    for (unsigned k = 0, n = 3 + pick(6); k < n; ++k) statement(depth, breakable);
    values_.resize(visible);
  }

  void statement(int depth, int breakable) {
    const unsigned what = pick(depth < 4 ? 16 : 11);
    if (what < 4) {
      static const char* const kOps[] = {"iadd", "isub", "imul", "xor",  "and",  "or",
                                         "shl",  "ashr", "smin", "umax", "udiv", "srem"};
      const std::string a = value(), b = value(), n = fresh();
      line("%" + n + " = " + kOps[pick(12)] + " i32 %" + a + ", %" + b);
      values_.push_back(n);
    } else if (what < 6) {
      const std::string n = fresh();
      line("%" + n + " = var.get i32 %v" + std::to_string(pick(3)));
      values_.push_back(n);
    } else if (what < 10) {
      const std::string a = value();
      line("var.set %v" + std::to_string(pick(3)) + ", %" + a);
    } else if (what == 10) {
      if (breakable && pick(3) == 0)
        line("break " + std::to_string(pick(unsigned(breakable))));
      else
        line("output " + std::to_string(3 + pick(3)) + " %" + value());
    } else if (what < 14) {
      const std::string m = condition();
      line("if %" + m);
      region(depth + 1, breakable);
      if (pick(2)) line("else"), region(depth + 1, breakable);
      line("endif");
    } else if (what == 14) {
      line("block");
      region(depth + 1, breakable + 1);
      line("endblock");
    } else {
      line("loop");
      const std::string f = fresh(), g = fresh(), m = fresh(), z = fresh();
      line("%" + f + " = var.get i32 %fuel\n%" + g + " = isub i32 %" + f + ", %one\nvar.set %fuel, %" + g);
      line("%" + z + " = const i32 0\n%" + m + " = slt mask %" + g + ", %" + z + "\nif %" + m +
           "\nbreak 0\nendif");
      region(depth + 1, breakable + 1);
      line("endloop");
    }
  }

  std::mt19937 random_;
  std::string out_;
  std::vector<std::string> values_;
  unsigned next_ = 0;
};

std::map<uint32_t, Row> outputsOf(const Function& f, uint32_t seed) {
  Evaluation e;
  e.lanes = 16;
  std::mt19937 random(seed);
  for (uint32_t slot = 0; slot < 4; ++slot)
    for (size_t l = 0; l < e.lanes; ++l)
      e.inputs[slot].push_back(random() % 3 ? random() % 8 : uint32_t(random()));
  evaluate(f, e);
  EXPECT_EQ(e.error, "");
  for (uint32_t slot = 0; slot < 6; ++slot) e.outputs[slot].resize(e.lanes);
  return e.outputs;
}

TEST(Optimise, randomProgramsComputeTheSame) {
  size_t before = 0, after = 0;
  for (uint32_t seed = 0; seed < 300; ++seed) {
    const std::string text = Program(seed).text();
    Function f = parsed(text);
    before += f.insts.size();
    const auto want = outputsOf(f, seed);
    for (auto pass : {forwardVariables, removeDeadCode, convertIfs}) {
      Function g = f;
      pass(g);
      ASSERT_EQ(verify(g), "") << seed << "\n" << print(f) << print(g);
      ASSERT_EQ(outputsOf(g, seed), want) << seed << "\n" << print(f) << print(g);
    }
    optimise(f);
    after += f.insts.size();
    ASSERT_EQ(verify(f), "") << seed;
    ASSERT_EQ(outputsOf(f, seed), want) << seed << "\n" << text << print(f);
    Function again;
    std::string error;
    ASSERT_TRUE(parse(print(f), again, error)) << error;
    ASSERT_EQ(print(again), print(f));
  }
  EXPECT_LT(after * 3, before * 2) << "at least a third of the instructions should vanish";
}

// A function may come from a cache file that anybody wrote: the verifier must stand anything, and what it
// lets through must not harm the passes.
TEST(Verify, corruptedFunctionsAreRefusedOrHarmless) {
  std::mt19937 random(11);
  size_t accepted = 0;
  for (uint32_t seed = 0; seed < 3000; ++seed) {
    Function f = parsed(Program(seed % 50).text());
    for (unsigned k = 0, n = 1 + random() % 3; k < n; ++k) {
      Inst& i = f.insts[random() % f.insts.size()];
      switch (random() % 7) {
        case 0:
          i.op = Op(random() % (unsigned(Op::kCount) + 3));
          break;
        case 1:
          i.type = Type(random() % 12);
          break;
        case 2:
          i.firstOperand = random() % 4 ? random() % 200 : uint32_t(random());
          break;
        case 3:
          i.operandCount = random() % 4 ? random() % 5 : uint32_t(random());
          break;
        case 4:
          i.imm = random() % 2 ? random() % 5 : uint64_t(random()) << 32;
          break;
        case 5:
          f.operandPool[random() % f.operandPool.size()] = uint32_t(random() % (f.insts.size() + 9));
          break;
        case 6:
          std::swap(i, f.insts[random() % f.insts.size()]);
          break;
      }
    }
    if (!verify(f).empty()) continue;
    ++accepted;
    optimise(f);
    ASSERT_EQ(verify(f), "");
    lowerMath(f, Numerics::F32);
    ASSERT_EQ(verify(f), "");
    Function again;
    std::string error;
    ASSERT_TRUE(parse(print(f), again, error)) << error;
  }
  EXPECT_GT(accepted, 100u);
}

TEST(Optimise, fiftyThousandInstructionsTakeLittleTime) {
  Function f;
  Builder b(f);
  std::vector<Value> vars;
  for (int k = 0; k < 200; ++k) vars.push_back(b.var(Type::I32));
  std::mt19937 random(1);
  const Value m = b.input(Type::Mask, 0);
  while (f.insts.size() < 50000) {
    const bool nested = random() % 8 == 0;
    if (nested) b.beginIf(m);
    for (unsigned k = 0; k < 10; ++k) {
      const Value x = b.get(vars[random() % vars.size()]), y = b.get(vars[random() % vars.size()]);
      b.set(vars[random() % vars.size()], b.iadd(b.xor_(x, b.i32(uint32_t(random()))), y));
    }
    if (nested) b.endIf();
  }
  for (size_t k = 0; k < vars.size(); ++k) b.output(uint32_t(k), b.get(vars[k]));
  const double start = test::processorSeconds();
  optimise(f);
  const double took = test::processorSeconds() - start;
  std::printf("    %.1f ms\n", took * 1e3);
  EXPECT_EQ(verify(f), "");
  EXPECT_LT(took, 2.0);
}

}  // namespace
}  // namespace pumice::ir
