// What is known of numbers (no NaN, within the range of integers, a zero's sign that nobody sees) changes the code, not the bits.
#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {
namespace {

struct Draw {
  float low, high;
  uint32_t extent;
};

void agrees(const std::string& text, const Draw& draw) {
  if (!jit::available()) GTEST_SKIP();
  const Function f = parsed(R"(
    %x = input f32 0
    %i = input i32 1
    %low = uniform f32 0
    %high = uniform f32 4
    %extent = uniform i32 8
    %zero = const f32 0x0
    %one = const f32 0x3f800000
    %onei = const i32 1
    %minusHalf = const f32 0xbf000000
    %minusOne = const f32 0xbf800000
    %far = const f32 0x45800000
    %minusFar = const f32 0xc5800000
    %cap = const i32 65535
  )" + text);
  Random random(draw.extent);
  RowRun start(2, 4);
  start.lanes = kMaxLanes;
  for (uint64_t& active : start.active) active = ~uint64_t(0);
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    start.inputs[0].set(Type::F32, lane, lane % 2 ? awkwardBits(random, Type::F32) : calmBits(random, Type::F32));
    start.inputs[1].set(Type::I32, lane, random.below(40));
  }
  start.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&draw), sizeof draw};
  RowRun want = start;
  want(f);
  std::string listing;
  auto e = jit::compile(f, {}, {.listing = &listing});
  ASSERT_TRUE(e) << e.error().message;
  start.execute(**e);
  for (unsigned k = 0; k < 4; k++)
    for (unsigned lane = 0; lane < kMaxLanes; lane++)
      ASSERT_EQ(start.outputs[k].get(Type::I32, lane), want.outputs[k].get(Type::I32, lane))
          << "output " << k << ", lane " << lane << " of " << std::hex << start.inputs[0].get(Type::I32, lane) << std::dec << ", " << draw.low << " to "
          << draw.high << ", " << draw.extent << "\n" << text << listing;
}

TEST(JitBounds, changeNoBit) {
  const std::string texels = R"(
    %whole = ffloor f32 %x
    %rest = fsub f32 %x, %whole
    %fraction = fmin f32 %rest, %one
    %some = umin i32 %extent, %cap
    %level = lshr i32 %some, %i
    %size = umax i32 %level, %onei
    %scale = stof f32 %size
    %t = fma f32 %fraction, %scale, %minusHalf
    %tf = ffloor f32 %t
    %ti = ftos i32 %tf
    output 0 %ti
    %clamped = fmax f32 %whole, %minusOne
    %wide = stof f32 %some
    %last = fsub f32 %wide, %one
    %edge = fmin f32 %clamped, %last
    %ei = ftos i32 %edge
    output 1 %ei
  )";
  const std::string levels = R"(
    %lowest = fmax f32 %low, %minusFar
    %highest = fmin f32 %high, %far
    %a = fmax f32 %x, %lowest
    %b = fmin f32 %highest, %a
    %c = fmax f32 %b, %zero
    %cf = ffloor f32 %c
    %ci = ftos i32 %cf
    output 2 %ci
  )";
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  for (const std::string& text : {texels, levels, levels + "output 3 %a\n", levels + "output 3 %b\n", levels + "output 3 %c\n"})
    for (const Draw& draw : {Draw{0, 0, 0}, Draw{-0.0f, 0, 1}, Draw{0, -0.0f, 300}, Draw{-1, 5, 65535}, Draw{nan, nan, 0xffffffff}, Draw{-infinity, infinity, 0x80000000},
                             Draw{1000, -1000, 16384}}) {
      agrees(text, draw);
      if (HasFailure()) return;
    }
}

}  // namespace
}  // namespace pumice::interp
