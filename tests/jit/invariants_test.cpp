// What loops compute anew in each turn although it stays: it moves, and the bits are the interpreter's.
#include "spirv_interp/jit/invariants.h"

#include "spirv_interp/ir/passes.h"
#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {
namespace {

//! %x (any float), %n (turns), %k (any integer), %wide (above 0, from an integer), %any (may be 0), %turn in the body, %sum to add up.
std::string program(const std::string& body, const std::string& before = "") {
  return R"(function "f"
    %zero = const f32 0
    %none = const i32 0
    %one = const i32 1
    %two = const i32 2
    %three = const i32 3
    %most = const i32 65535
    %half = const f32 -0.5
    %a = const f32 0.25
    %b = const f32 -3
    %sum = var f32
    %other = var f32
    %index = var i32
    %input = input f32 0
    %n = input i32 1
    %k = input i32 2
    %x = fmul f32 %input, %a
    %low = umin i32 %k, %most
    %positive = umax i32 %low, %one
    %wide = stof f32 %positive
    %any = stof f32 %low
)" + before + R"(
    loop
      %turn = var.get i32 %index
      %more = slt mask %turn, %n
      %done = mask.not mask %more
      if %done
        break 0
      endif
      %number = stof f32 %turn
      %old = var.get f32 %sum
)" + body + R"(
      %next = iadd i32 %turn, %one
      var.set %index, %next
    endloop
    %result = var.get f32 %sum
    output 0, %result
    %second = var.get f32 %other
    output 1, %second
)";
}

struct Case {
  const char* name;
  std::string text;
  int moved;   //!< by how many instructions the loop is shorter
};

std::vector<Case> cases() {
  return {
      {"coordinate", program(R"(
      %d = fdiv f32 %zero, %wide
      %place = fma f32 %d, %number, %x
      %scaled = fma f32 %place, %wide, %half
      %down = ffloor f32 %scaled
      %minus = fneg f32 %d
      %back = fma f32 %number, %minus, %x
      %scaledBack = fma f32 %wide, %back, %half
      %both = fadd f32 %down, %scaledBack
      %new = fadd f32 %old, %both
      var.set %sum, %new)"), 8},
      // The sign of what comes out as 0 can be seen; 0 / 0 is no 0; a factor may be infinite.
      {"seenZero", program(R"(
      %d = fdiv f32 %zero, %wide
      %place = fma f32 %d, %number, %x
      var.set %sum, %place)"), 1},
      {"zeroByZero", program(R"(
      %d = fdiv f32 %zero, %any
      %place = fma f32 %d, %number, %x
      %scaled = fma f32 %place, %wide, %half
      var.set %sum, %scaled)"), 1},
      {"timesInfinity", program(R"(
      %place = fma f32 %input, %zero, %x
      %scaled = fma f32 %place, %wide, %half
      %new = fadd f32 %scaled, %old
      var.set %sum, %new)"), 2},
      {"table", program(R"(
      local.store %table, %none, %a
      local.store +4 %table, %none, %b
      local.store +8 %table, %none, %half
      %at = shl i32 %turn, %two
      %entry = local.load f32 %table, %at
      %new = fadd f32 %old, %entry
      var.set %sum, %new)", "%table = local.alloc i32 16\n"), -2},
      {"shortTableOfIntegers", program(R"(
      local.store +4 %table, %none, %most
      local.store +8 %table, %none, %three
      local.store +12 %table, %none, %one
      local.store +4 %table, %none, %three
      %at = shl i32 %k, %two
      %entry = local.load i32 +4 %table, %at
      %float = stof f32 %entry
      %new = fadd f32 %old, %float
      var.set %sum, %new)", "%table = local.alloc i32 16\n"), 7},
      {"longTable", program(R"(
      local.store %table, %none, %a
      local.store +4 %table, %none, %b
      local.store +8 %table, %none, %half
      local.store +12 %table, %none, %a
      local.store +16 %table, %none, %b
      local.store +20 %table, %none, %half
      local.store +24 %table, %none, %a
      local.store +28 %table, %none, %b
      local.store +32 %table, %none, %half
      %at = shl i32 %turn, %two
      %entry = local.load f32 +16 %table, %at
      %new = fadd f32 %old, %entry
      var.set %sum, %new)", "%table = local.alloc i32 40\n"), 9},
      {"tableLookedIntoAnywhere", program(R"(
      local.store %table, %none, %a
      local.store +4 %table, %none, %b
      %entry = local.load f32 %table, %k
      %new = fadd f32 %old, %entry
      var.set %sum, %new)", "%table = local.alloc i32 16\n"), 2},
      {"tableSeenBefore", program(R"(
      %entry = local.load f32 %table, %none
      local.store %table, %none, %a
      %new = fadd f32 %old, %entry
      var.set %sum, %new)", "%table = local.alloc i32 16\n"), 0},
      {"tableChanged", program(R"(
      local.store %table, %none, %a
      local.store +4 %table, %none, %x
      %entry = local.load f32 %table, %none
      %new = fadd f32 %old, %entry
      var.set %sum, %new)", "%table = local.alloc i32 16\n"), 0},
      {"tableOfSome", program(R"(
      %odd = flt mask %number, %wide
      if %odd
        local.store %table, %none, %a
      endif
      %entry = local.load f32 %table, %none
      %new = fadd f32 %old, %entry
      var.set %sum, %new)", "%table = local.alloc i32 16\n"), 0},
      {"nested", program(R"(
      %inner = var i32
      var.set %inner, %none
      loop
        %t = var.get i32 %inner
        %on = slt mask %t, %three
        %off = mask.not mask %on
        if %off
          break 0
        endif
        %square = fmul f32 %x, %x
        %product = fmul f32 %number, %square
        %so = var.get f32 %other
        %added = fadd f32 %so, %product
        var.set %other, %added
        %nextInner = iadd i32 %t, %one
        var.set %inner, %nextInner
      endloop
      %large = flt mask %number, %b
      if %large
        %hidden = fdiv f32 %x, %b
        var.set %sum, %hidden
      endif)"), 1},
  };
}

size_t inLoops(const Function& f) {
  size_t count = 0, depth = 0;
  for (const Inst& i : f.insts) {
    if (i.op == Op::EndLoop) depth--;
    if (depth && i.op != Op::Const) count++;
    if (i.op == Op::Loop) depth++;
  }
  return count;
}

TEST(JitInvariants, moveOutOfLoops) {
  for (const Case& c : cases()) {
    Function f = parsed(c.text);
    const size_t before = inLoops(f);
    EXPECT_TRUE(jit::hoistInvariants(f));
    EXPECT_EQ(ir::verify(f), "") << c.name;
    EXPECT_EQ(int(before) - int(inLoops(f)), c.moved) << c.name << "\n" << ir::print(f);
  }
}

TEST(JitInvariants, keepTheInterpretersBits) {
  if (!jit::available()) GTEST_SKIP();
  constexpr float kNumbers[] = {0.f, -0.f, 1.f, -2.5f, INFINITY, -INFINITY, NAN, 0x1p-149f, -0x1p-140f, 3e38f, 0.99999994f, 1000.25f};
  for (const Case& c : cases()) {
    const Function f = parsed(c.text);
    for (uint32_t lanes : {128u, 37u, 1u}) {
      RowRun start(3, 2);
      start.lanes = lanes;
      for (unsigned l = 0; l < kMaxLanes; l++) {
        start.inputs[0].set(Type::F32, l, std::bit_cast<uint32_t>(kNumbers[l % std::size(kNumbers)]));
        start.inputs[1].set(Type::I32, l, l * 7 % 5);
        start.inputs[2].set(Type::I32, l, l % 11 ? l * l * 50 : 0);
      }
      RowRun want = start;
      want(f);
      for (uint32_t width : {8u, 16u, 32u}) {
        std::string listing;
        auto e = jit::compile(f, {}, {.chunkLanes = width, .listing = &listing});
        ASSERT_TRUE(e) << e.error().message;
        RowRun run = start;
        run.execute(**e);
        for (unsigned k = 0; k < 2; k++)
          ASSERT_EQ(std::memcmp(run.outputs[k].bytes, want.outputs[k].bytes, lanes * 4), 0) << c.name << ", " << lanes << " lanes in chunks of " << width << "\n" << listing;
      }
    }
  }
}

}  // namespace
}  // namespace pumice::interp
