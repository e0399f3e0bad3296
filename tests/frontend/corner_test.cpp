// What modules may say although it does nothing: structures without members, values that are never used.
#include <gtest/gtest.h>

#include "tests/frontend/run_compute.h"
#include "tests/support/compute_module.h"

namespace pumice::frontend {
namespace {

using test::Buffers;

//! A shader of one invocation that has written 7 and 8 around what `body` does.
void runsThrough(const std::string& types, const std::string& body, const std::string& interface = "", const std::string& functions = "") {
  pumice::test::ComputeModule m{.lanes = 1, .interface = "%buffer" + interface, .functions = functions};
  m.decorations = R"(
OpDecorate %block Block
OpMemberDecorate %block 0 Offset 0
OpMemberDecorate %block 1 Offset 4
OpMemberDecorate %block 2 Offset 8
OpMemberDecorate %block 3 Offset 8
OpDecorate %buffer DescriptorSet 0
OpDecorate %buffer Binding 0
)";
  m.types = R"(
%float = OpTypeFloat 32
%empty = OpTypeStruct
%nested = OpTypeStruct %empty %empty
%empties = OpTypeArray %nested %n3
%block = OpTypeStruct %uint %uint %empty %uint
%ptr_block = OpTypePointer StorageBuffer %block
%ptr_empty = OpTypePointer StorageBuffer %empty
%buffer = OpVariable %ptr_block StorageBuffer
)" + types;
  m.body = body + R"(
%first = OpAccessChain %ptr %buffer %n0
%last = OpAccessChain %ptr %buffer %n3
OpStore %first %n7
OpStore %last %n8
)";
  Buffers b{{1, 2, 3, 4}};
  test::runAssembly(textOf(m), 1, b, "1.6");
  EXPECT_EQ(b[0], (std::vector<uint32_t>{7, 2, 8, 4}));
}

TEST(Corner, VariablesOfEmptyStructures) {
  for (const char* storage : {"Private", "Workgroup"}) {
    SCOPED_TRACE(storage);
    runsThrough("%ptr_empties = OpTypePointer " + std::string(storage) + " %empties\n%ptr_nested = OpTypePointer " + storage + " %nested\n" +
                    "%variable = OpVariable %ptr_empties " + storage + "\n",
                R"(
%in = OpLoad %empties %variable
OpStore %variable %in
%n = OpAccessChain %ptr_nested %variable %n2
%e = OpLoad %nested %n
OpStore %n %e
)", " %variable");
  }
  runsThrough("%ptr_empties = OpTypePointer Function %empties", R"(
%variable = OpVariable %ptr_empties Function
%in = OpLoad %empties %variable
OpStore %variable %in
)");
}

TEST(Corner, EmptyStructuresAreValuesArgumentsAndResults) {
  runsThrough(R"(
%ptr_in = OpTypePointer Function %empty
%null = OpConstantNull %empty
%undefined = OpUndef %empty
%made = OpConstantComposite %nested %null %undefined
%pass = OpTypeFunction %empty %ptr_in %empty
)", R"(
%variable = OpVariable %ptr_in Function %null
%place = OpAccessChain %ptr_empty %buffer %n2
%read = OpLoad %empty %place
OpStore %variable %read
%result = OpFunctionCall %empty %passed %variable %read
%part = OpCompositeExtract %empty %made 1
%both = OpCompositeConstruct %nested %result %part
%back = OpCompositeExtract %empty %both 0
OpStore %place %back
)", "", R"(
%passed = OpFunction %empty None %pass
%parameter = OpFunctionParameter %ptr_in
%value = OpFunctionParameter %empty
%start = OpLabel
%loaded = OpLoad %empty %parameter
OpReturnValue %loaded
OpFunctionEnd
)");
}

// Pointers, images and samplers may be undefined or null as long as nobody uses them.
TEST(Corner, UndefinedValuesThatNobodyUses) {
  runsThrough(R"(
%ptr_private = OpTypePointer Private %float
%image = OpTypeImage %float 2D 0 0 0 1 Unknown
%sampler = OpTypeSampler
%sampled = OpTypeSampledImage %image
%runtime = OpTypeRuntimeArray %float
%null = OpConstantNull %ptr_private
%global = OpUndef %image
)", R"(
%u0 = OpUndef %ptr_private
%u1 = OpUndef %image
%u2 = OpUndef %sampler
%u3 = OpUndef %sampled
%u4 = OpUndef %runtime
%u5 = OpUndef %empties
)");
}

}  // namespace
}  // namespace pumice::frontend
