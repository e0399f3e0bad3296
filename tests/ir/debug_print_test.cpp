// What shaders print: formats that come from anywhere, and values of every type.
#include "spirv_interp/ir/debug_print.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

namespace pumice::ir {
namespace {

using Values = std::vector<PrintedScalar>;

PrintedScalar f32(float x) { return {Type::F32, std::bit_cast<uint32_t>(x)}; }
PrintedScalar i32(int32_t x) { return {Type::I32, uint32_t(x)}; }
PrintedScalar i64(uint64_t x) { return {Type::I64, x}; }

//! Each argument has so many of the values; 0: it is the text "text".
std::string text(const char* format, const Values& values, const std::vector<uint32_t>& sizes) {
  PrintCall call{format, {}};
  for (uint32_t n : sizes) call.arguments.push_back({n, n ? "" : "text"});
  return printedText(call, values);
}
std::string text(const char* format, const Values& values = {}) { return text(format, values, std::vector<uint32_t>(values.size(), 1)); }

TEST(DebugPrint, formatsNumbersAsCDoes) {
  EXPECT_EQ(text("%d|%i|%u|%x|%X|%o", {i32(-5), i32(7), i32(-1), i32(0xabc), i32(0xabc), i32(8)}), "-5|7|4294967295|abc|ABC|10");
  EXPECT_EQ(text("%5d|%-5d|%05d|%+d|%#x|% d", {i32(42), i32(42), i32(42), i32(42), i32(255), i32(3)}), "   42|42   |00042|+42|0xff| 3");
  EXPECT_EQ(text("%f|%.2f|%8.3f|%e|%g|%a", {f32(1.5f), f32(1.0f / 3), f32(-2), f32(1e10f), f32(0.1f), f32(1)}), "1.500000|0.33|  -2.000|1.000000e+10|0.1|0x1p+0");
  EXPECT_EQ(text("%f %f", {{Type::F64, std::bit_cast<uint64_t>(0.25)}, {Type::F16, 0x3c00}}), "0.250000 1.000000");
  EXPECT_EQ(text("%f %g %d", {f32(HUGE_VALF), f32(-HUGE_VALF), {Type::Mask, 1}}), "inf -inf 1");
}

TEST(DebugPrint, takesTheSizeFromTheValue) {
  EXPECT_EQ(text("%lu %lx %ld %lld %ul.", {i64(~0ull), i64(1ull << 40), i64(~0ull), i64(5), i64(9)}), "18446744073709551615 10000000000 -1 5 9.");
  EXPECT_EQ(text("%ul", {i32(9)}), "9l") << "of 32 bits it is %u and a letter";
  EXPECT_EQ(text("%d %u %hd", {{Type::I8, 0xff}, {Type::I8, 0xff}, {Type::I16, 0x8000}}), "-1 255 -32768");
}

TEST(DebugPrint, formatsVectors) {
  const Values v = {f32(1), f32(2), f32(3), i32(-1), i32(4)};
  EXPECT_EQ(text("%v3f, %v2d", v, {3, 2}), "1.000000, 2.000000, 3.000000, -1, 4");
  EXPECT_EQ(text("%1.2v3f %v2u", v, {3, 2}), "1.00, 2.00, 3.00 4294967295, 4");
  EXPECT_EQ(text("%f;%x", v, {3, 2}), "1.000000, 2.000000, 3.000000;ffffffff, 4") << "a vector where a scalar is awaited";
  EXPECT_EQ(text("%v2f %d", v, {3, 2}), "1.000000, 2.000000 -1, 4") << "the argument is used up though one component is not printed";
}

TEST(DebugPrint, neverTrustsAFormat) {
  EXPECT_EQ(text("100%% %s", {}, {0}), "100% text");
  EXPECT_EQ(text("%n%p%c%q %", {i32(1)}), "%n%p%c%q %");
  EXPECT_EQ(text("%d %d", {i32(1)}), "1 %d") << "there is no second argument";
  EXPECT_EQ(text("%*d %1$d", {i32(1)}), "%*d %1$d");
  EXPECT_EQ(text("%s", {i32(3)}), "3") << "a number is no string";
  EXPECT_EQ(text("%d", {}, {0}), "text");
  EXPECT_EQ(text("%999999999999d", {i32(1)}).size(), 200u);
  EXPECT_EQ(text("%.999999999f", {{Type::F64, std::bit_cast<uint64_t>(-1e308)}}).size(), 1 + 309 + 1 + 200u);
  EXPECT_EQ(text("%v", {i32(1)}), "%v");
  EXPECT_EQ(text("%v3", {i32(1)}), "%v3");
}

TEST(DebugPrint, keepsEqualCallsOnce) {
  const uint32_t a = keepPrintCall({"one %d", {{1, ""}}}), b = keepPrintCall({"one %d", {{2, ""}}});
  EXPECT_NE(a, b);
  EXPECT_EQ(keepPrintCall({"one %d", {{1, ""}}}), a);
  EXPECT_EQ(printCall(b).arguments[0].scalars, 2u);
}

}  // namespace
}  // namespace pumice::ir
