#include "spirv_interp/ir/builder.h"

#include <gtest/gtest.h>

#include "tests/support/processor_time.h"

namespace pumice::ir {
namespace {

TEST(Builder, equalPureInstructionsAreMergedWithinOpenRegions) {
  Function f;
  Builder b(f);
  const Value x = b.input(Type::F32, 0), y = b.input(Type::F32, 1), m = b.flt(x, y);
  const Value sum = b.fadd(x, y);
  EXPECT_EQ(b.fadd(y, x), sum) << "addition commutes";
  EXPECT_NE(b.fsub(x, y), b.fsub(y, x));
  b.beginIf(m);
  EXPECT_EQ(b.fadd(x, y), sum);
  const Value inner = b.fmul(x, y);
  b.beginElse();
  EXPECT_NE(b.fmul(x, y), inner) << "a closed region's values are not visible";
  b.endIf();
  const Value outer = b.fmul(x, y);
  EXPECT_NE(outer, inner);
  EXPECT_EQ(b.fmul(x, y), outer);
  EXPECT_EQ(verify(f), "");
}

TEST(Builder, readsAndEffectsAreNeverMerged) {
  Function f;
  Builder b(f);
  const Value v = b.var(Type::F32), base = b.uniform(Type::I64, 0), o = b.i32(0);
  EXPECT_NE(b.get(v), b.get(v));
  EXPECT_NE(b.load(Type::F32, base, o, base), b.load(Type::F32, base, o, base));
  EXPECT_EQ(b.loadConst(Type::F32, base, o, base), b.loadConst(Type::F32, base, o, base));
  b.setInstFlags(kInstVolatile);
  EXPECT_NE(b.loadConst(Type::F32, base, o, base), b.loadConst(Type::F32, base, o, base));
}

TEST(Builder, exactIdentitiesVanishAndFloatOnesStay) {
  Function f;
  Builder b(f);
  const Value x = b.input(Type::I32, 0), y = b.input(Type::F32, 1), m = b.input(Type::Mask, 2);
  EXPECT_EQ(b.iadd(x, b.i32(0)), x);
  EXPECT_EQ(b.imul(b.i32(1), x), x);
  EXPECT_EQ(b.and_(x, b.i32(~0u)), x);
  EXPECT_EQ(b.iadd(b.iadd(x, b.i32(3)), b.i32(4)), b.iadd(x, b.i32(7)));
  EXPECT_EQ(b.imul(x, b.i32(8)), b.shl(x, b.i32(3)));
  EXPECT_EQ(b.shl(x, b.i32(32)), x) << "shift counts are modulo the width";
  EXPECT_EQ(b.select(b.mask(true), x, b.i32(5)), x);
  EXPECT_EQ(b.select(b.maskNot(m), x, b.i32(5)), b.select(m, b.i32(5), x));
  EXPECT_EQ(b.maskAnd(m, b.mask(true)), m);
  EXPECT_EQ(b.maskNot(b.maskNot(m)), m);
  EXPECT_NE(b.fadd(y, b.f32(0)), y);
  EXPECT_NE(b.fmul(y, b.f32(1)), y);
  EXPECT_FALSE(b.isConstant(b.fsub(y, y)));
  EXPECT_FALSE(b.isConstant(b.feq(y, y)));
}

TEST(Builder, fiftyThousandInstructionsTakeLittleTime) {
  Function f;
  Builder b(f);
  const double start = test::processorSeconds();
  Value x = b.input(Type::I32, 0), y = b.input(Type::I32, 1);
  const Value m = b.slt(x, y);
  for (uint32_t i = 0; i < 50000; ++i) {
    const Value t = b.xor_(x, b.imul(y, b.i32(i * 2 + 3)));
    x = y, y = t;
    if (i % 100 == 50) b.beginIf(m);
    if (i % 100 == 99) b.endIf(), x = b.input(Type::I32, 0), y = b.input(Type::I32, 1);
  }
  const double took = test::processorSeconds() - start;
  EXPECT_EQ(verify(f), "");
  EXPECT_LT(took, 1.0);
}

}  // namespace
}  // namespace pumice::ir
