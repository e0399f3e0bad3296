#include "spirv_interp/ir/fold.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <vector>

namespace pumice::ir {
namespace {

uint64_t fold(Op op, Type t, std::vector<uint64_t> args, Type operandType = Type::None) {
  uint64_t r = 0;
  EXPECT_TRUE(foldConstant(op, t, operandType == Type::None ? t : operandType, args, r)) << opInfo(op).text;
  return r;
}

uint64_t bits(float x) { return std::bit_cast<uint32_t>(x); }
constexpr uint32_t kNan = 0x7fc00000;

TEST(Fold, everyPlainPureOperationOnOperandsIsFolded) {
  for (size_t k = 1; k < static_cast<size_t>(Op::kCount); ++k) {
    const OpInfo& info = opInfo(Op(k));
    if (!(info.flags & kPure) || (info.flags & kHigh) || info.operands == OperandRule::Free) continue;
    const bool isF = info.operands == OperandRule::Float || info.operands == OperandRule::CmpF;
    Type operand = isF                                  ? Type::F32
                   : info.operands == OperandRule::Mask ? Type::Mask
                                                        : Type::I32,
         result = operand;
    if (info.result == ResultRule::Mask) result = Type::Mask;
    if (Op(k) == Op::FToF || Op(k) == Op::FToS || Op(k) == Op::FToU) operand = Type::F32;
    const uint64_t args[] = {1, 1, 1};
    uint64_t r = 0;
    EXPECT_TRUE(foldConstant(Op(k), result, operand, {args, info.operandCount}, r)) << info.text;
  }
}

TEST(Fold, nanOfArithmeticIsCanonical) {
  EXPECT_EQ(fold(Op::FSub, Type::F32, {bits(INFINITY), bits(INFINITY)}), kNan);
  EXPECT_EQ(fold(Op::FAdd, Type::F32, {0xffc12345, bits(1)}), kNan);
  EXPECT_EQ(fold(Op::FSqrt, Type::F32, {bits(-1)}), kNan);
  EXPECT_EQ(fold(Op::FNeg, Type::F32, {kNan}), 0xffc00000u);
  EXPECT_EQ(fold(Op::FMin, Type::F32, {kNan, bits(2)}), bits(2));
  EXPECT_EQ(fold(Op::FMax, Type::F32, {bits(2), 0xffc00001}), bits(2));
  EXPECT_EQ(fold(Op::FMin, Type::F32, {bits(0.0f), bits(-0.0f)}), bits(-0.0f));
  EXPECT_EQ(fold(Op::FMax, Type::F32, {bits(-0.0f), bits(0.0f)}), bits(0.0f));
}

TEST(Fold, fmaRoundsOnce) {
  const float a = 1 + 0x1p-23f, c = -(1 + 0x1p-22f);
  EXPECT_EQ(fold(Op::Fma, Type::F32, {bits(a), bits(a), bits(c)}), bits(0x1p-46f));
  const uint64_t h = halfFromDouble(1 + 0x1p-10);
  EXPECT_EQ(fold(Op::Fma, Type::F16, {h, h, halfFromDouble(-(1 + 0x1p-9))}), halfFromDouble(0x1p-20));
}

TEST(Fold, divisionByZeroAndOverflowAreDefined) {
  EXPECT_EQ(fold(Op::UDiv, Type::I32, {7, 0}), 0xffffffffu);
  EXPECT_EQ(fold(Op::SDiv, Type::I32, {7, 0}), 0xffffffffu);
  EXPECT_EQ(fold(Op::URem, Type::I32, {7, 0}), 7u);
  EXPECT_EQ(fold(Op::SRem, Type::I32, {0xfffffff9, 0}), 0xfffffff9u);
  EXPECT_EQ(fold(Op::SDiv, Type::I32, {0x80000000, 0xffffffff}), 0x80000000u);
  EXPECT_EQ(fold(Op::SRem, Type::I32, {0x80000000, 0xffffffff}), 0u);
  EXPECT_EQ(fold(Op::SDiv, Type::I64, {uint64_t(1) << 63, ~uint64_t(0)}), uint64_t(1) << 63);
  EXPECT_EQ(fold(Op::SRem, Type::I8, {0xf9, 4}), 0xfdu);
}

TEST(Fold, integers) {
  EXPECT_EQ(fold(Op::AShr, Type::I8, {0x80, 9}), 0xc0u);
  EXPECT_EQ(fold(Op::SMulHi, Type::I32, {0xffffffff, 2}), 0xffffffffu);
  EXPECT_EQ(fold(Op::UMulHi, Type::I32, {0xffffffff, 2}), 1u);
  EXPECT_EQ(fold(Op::FindMsb, Type::I32, {0}), 0xffffffffu);
  EXPECT_EQ(fold(Op::FindMsb, Type::I16, {0x0100}), 8u);
  EXPECT_EQ(fold(Op::BitReverse, Type::I8, {1}), 0x80u);
  EXPECT_EQ(fold(Op::SMin, Type::I16, {0xffff, 1}), 0xffffu);
  EXPECT_EQ(fold(Op::SLt, Type::Mask, {0xff, 0}, Type::I8), 1u);
  EXPECT_EQ(fold(Op::ULt, Type::Mask, {0xff, 0}, Type::I8), 0u);
}

TEST(Fold, conversionsSaturateAndRoundOnce) {
  EXPECT_EQ(fold(Op::FToS, Type::I32, {bits(3e9f)}, Type::F32), 0x7fffffffu);
  EXPECT_EQ(fold(Op::FToS, Type::I32, {bits(-3e9f)}, Type::F32), 0x80000000u);
  EXPECT_EQ(fold(Op::FToS, Type::I32, {bits(-1.9f)}, Type::F32), 0xffffffffu);
  EXPECT_EQ(fold(Op::FToU, Type::I8, {bits(300.f)}, Type::F32), 0xffu);
  EXPECT_EQ(fold(Op::FToU, Type::I32, {bits(-1.f)}, Type::F32), 0u);
  EXPECT_EQ(fold(Op::FToU, Type::I32, {kNan}, Type::F32), 0u);
  EXPECT_EQ(fold(Op::UToF, Type::F32, {0x8000008000000001u}, Type::I64), bits(0x1.000002p63f))
      << "through double this would round down to even";
  EXPECT_EQ(fold(Op::SToF, Type::F16, {0x7fffffff}, Type::I32), 0x7c00u);
}

TEST(Fold, everyHalfSurvivesTheWayThroughDouble) {
  for (uint32_t h = 0; h < 0x10000; ++h) {
    const bool nan = (h & 0x7c00) == 0x7c00 && (h & 0x3ff);
    ASSERT_EQ(halfFromDouble(halfToDouble(uint16_t(h))), nan ? 0x7e00 : h);
  }
}

TEST(Fold, halvesRoundToNearestEven) {
  for (uint32_t h = 0; h < 0x7bff; ++h) {
    const double a = halfToDouble(uint16_t(h)), b = halfToDouble(uint16_t(h + 1)), mid = (a + b) / 2;
    ASSERT_EQ(halfFromDouble(mid), h & 1 ? h + 1 : h);
    ASSERT_EQ(halfFromDouble(std::nextafter(mid, 0.0)), h);
    ASSERT_EQ(halfFromDouble(std::nextafter(mid, 1e9)), h + 1);
  }
  EXPECT_EQ(halfFromDouble(65519.99), 0x7bff);
  EXPECT_EQ(halfFromDouble(65520), 0x7c00);
}

}  // namespace
}  // namespace pumice::ir
