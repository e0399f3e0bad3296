#include <gtest/gtest.h>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/ir.h"

namespace pumice::ir {
namespace {

Function parsed(std::string_view text) {
  Function f;
  std::string error;
  EXPECT_TRUE(parse(text, f, error)) << error;
  return f;
}

std::string verdict(std::string_view text) { return verify(parsed(text)); }

TEST(Text, printedTextParsesBackToTheSameText) {
  const char* text = R"(function "all kinds" shared=64
  %1 = const f32 0x3fc00000 ; 1.5
  %2 = const i32 -3
  %3 = const mask 1
  %4 = table.load i32 push+16 %2 ~draw
  %5 = table.load i64 set3+8 %4
  %6 = load f32 +8 %5, %4, %5 !volatile !nonuniform @12
  %7 = var f32
  if %3
    loop
      block
        var.set %7, %6
        break 1
      endblock
    endloop
  else
    tile.store 1:16+4 %6
  endif
  %18 = atomic i32 smax+4 %5, %4, %5, %2
  %19 = image tuple {gather 2d arrayed implicit signed operands=257 image=3 sampler=4 texel=i32 format=7} %2, %2, %6, %6, %6, %6, %2
  %20 = tuple.get i32 2 %19
  %21 = shader.input f32 5:2 %6, %6
  shader.output 0:3 %21
  %23 = image tuple {atomic buffer cas atomic=xchg operands=0 image=1 sampler=0 texel=i32} %2, %2, %2, %2, %2
  %24 = quad.swizzle f32 27 %6
  %25 = subgroup.ballot i32 %3
  %26 = subgroup.shuffle f32 %6, %25
  %27 = subgroup.reduce f32 fmin:exclusive:8 %26
  %28 = subgroup.reduce i32 iadd:reduce:32 %25
)";
  const Function f = parsed(text);
  EXPECT_EQ(print(f), text);
  EXPECT_EQ(verify(f), "");
}

TEST(Text, constantsAreReadAsNumbersToo) {
  const Function f = parsed(
      "%a = const f32 1.5\n%b = const f64 -0x1p-3\n%c = const f16 65504\n%d = const i8 -1\n%e = const i64 "
      "-2");
  EXPECT_EQ(f.insts[1].imm, 0x3fc00000u);
  EXPECT_EQ(f.insts[2].imm, 0xbfc0000000000000u);
  EXPECT_EQ(f.insts[3].imm, 0x7bffu);
  EXPECT_EQ(f.insts[4].imm, 0xffu);
  EXPECT_EQ(f.insts[5].imm, ~uint64_t(1));
}

TEST(Text, errorsNameTheLine) {
  Function f;
  std::string error;
  for (const char* text : {"%1 = const f32 1\n%2 = bogus f32 %1", "%1 = const f32 1\n%2 = fneg f32 %9",
                           "%1 = const f32 1\n%1 = fneg f32 %1", "\nfneg f32", "\n%2 = fneg f33",
                           "\n%2 = const i8 256", "\n%2 = table.load i32 pull+3 %1", "\nbreak x", "\nendif 3",
                           "\n%2 = table.load i32 set8+3 %1", "\n%2 = image tuple {sample 2d frobnicated}"}) {
    EXPECT_FALSE(parse(text, f, error)) << text;
    EXPECT_EQ(error.substr(0, 7), "line 2:") << error;
  }
}

TEST(Verify, structureMustBalance) {
  EXPECT_NE(verdict("%1 = const mask 1\nif %1"), "");
  EXPECT_NE(verdict("endif"), "");
  EXPECT_NE(verdict("else"), "");
  EXPECT_NE(verdict("%1 = const mask 1\nif %1\nelse\nelse\nendif"), "");
  EXPECT_NE(verdict("loop\nendblock"), "");
  EXPECT_NE(verdict("block\nbreak 1\nendblock"), "");
  EXPECT_EQ(verdict("block\nloop\nbreak 1\nendloop\nendblock"), "");
}

TEST(Verify, valuesDoNotLeaveTheirRegion) {
  EXPECT_NE(verdict("%m = const mask 1\nif %m\n%a = const i32 1\nendif\n%b = not i32 %a")
                .find("outside its region"),
            std::string::npos);
  EXPECT_NE(verdict("%m = const mask 1\nif %m\n%a = const i32 1\nelse\n%b = not i32 %a\nendif"), "");
  EXPECT_EQ(verdict("%m = const mask 1\nif %m\n%a = const i32 1\nif %m\n%b = not i32 %a\nendif\nendif"), "");
}

TEST(Verify, typesMustFit) {
  const std::string head =
      "%f = const f32 1\n%i = const i32 1\n%l = const i64 1\n%m = const mask 1\n%v = var f32\n";
  for (const char* bad :
       {"%x = fadd f32 %f, %i",
        "%x = fadd i32 %i, %i",
        "%x = iadd f32 %f, %f",
        "%x = fadd f32 %f",
        "%x = feq i32 %f, %f",
        "%x = feq mask %f, %i",
        "%x = select f32 %m, %f, %i",
        "%x = select f32 %i, %f, %f",
        "%x = ftos f32 %f",
        "%x = trunc i64 %i",
        "%x = sext i32 %l",
        "%x = bitcast i64 %f",
        "%x = var.get f32 %f",
        "%x = var.get i32 %v",
        "var.set %v, %i",
        "if %i\nendif",
        "%x = load f32 %i, %i, %l",
        "%x = load mask %l, %i, %l",
        "store %l, %i, %l, %m",
        "%x = umulhi i64 %l, %l",
        "%x = quad.ddx f32 2 %f",
        "%x = tuple.get f32 0 %f",
        "%x = descriptor tuple 0 %i\n%y = tuple.get i64 2 %x",
        "tile.store 0:4+1 %f",
        "%x = tile.load f64 0:4 ",
        "%x = local.load f32 %i, %i",
        "%x = image tuple {sample 3d arrayed operands=4 image=0 sampler=0 texel=f32} %i, %i, %f, %f, %f, %f"})
    EXPECT_NE(verdict(head + bad), "") << bad;
  for (const char* good :
       {"%x = fadd f32 %f, %f", "%x = feq mask %f, %f", "%x = select mask %m, %m, %m", "%x = ftos i8 %f",
        "%x = trunc i8 %l", "%x = bitcast f32 %i", "%x = var.get f32 %v", "var.set %v, %f",
        "tile.store 0:8+4 %f", "%x = tile.load f32 0:4", "%x = table.load f32 constants+4 %i",
        "%x = load f32 %l, %l, %l", "store %l, %i, %l, %f",
        "%x = descriptor tuple 0 %i\n%y = tuple.get i64 1 %x",
        "%x = local.alloc i32 64\n%y = local.load f32 %x, %i\nlocal.store +4 %x, %i, %y"})
    EXPECT_EQ(verdict(head + good), "") << good;
}

TEST(Verify, theMessageNamesTheInstructionAndItsLine) {
  const std::string message = verdict("%1 = const f32 1\n%2 = iadd f32 %1, %1 @77");
  EXPECT_NE(message.find("%2 (iadd)"), std::string::npos);
  EXPECT_NE(message.find("@77"), std::string::npos);
}

}  // namespace
}  // namespace pumice::ir
