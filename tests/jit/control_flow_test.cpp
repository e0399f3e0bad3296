// Control flow by hand, above all loops that all lanes run alike (whose counters are one number for all lanes and whose
// regions have no mask), mixed with lanes that part: the bits of the interpreter.
#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {
namespace {

//! Inputs: 0 i32 lane's number, 1 f32 data, 2 i32 0 .. 7; draw constants: 0 i32 5, 4 i32 0, 8 f32 1.25.
void agrees(const std::string& text) {
  if (!jit::available()) GTEST_SKIP();
  const Function f = parsed(R"(
    %lane = input i32 0
    %x = input f32 1
    %small = input i32 2
    %n = uniform i32 0
    %none = uniform i32 4
    %u = uniform f32 8
    %0 = const i32 0
    %1 = const i32 1
    %2 = const i32 2
    %3 = const i32 3
  )" + text);
  struct { int32_t n = 5, none = 0; float u = 1.25f; } constants;
  for (uint32_t lanes : {1u, 7u, 32u, 40u, 128u})
    for (uint64_t active : {~uint64_t(0), uint64_t(0x8142'2418'1824'4281)}) {
      RowRun start(3, 4);
      start.lanes = lanes;
      start.active[0] = active;
      start.shared.resize(4096);
      Random random(lanes);
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        start.inputs[0].set(Type::I32, lane, lane);
        start.inputs[1].set(Type::F32, lane, std::bit_cast<uint32_t>(float(random.below(1000)) / 64 - 5));
        start.inputs[2].set(Type::I32, lane, random.below(8));
      }
      start.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&constants), sizeof constants};
      RowRun want = start;
      want(f);
      for (uint32_t width : {8u, 16u, 32u}) {
        std::string listing;
        auto e = jit::compile(f, {}, {.chunkLanes = width, .listing = &listing});
        ASSERT_TRUE(e) << e.error().message;
        RowRun run = start;
        run.execute(**e);
        for (unsigned k = 0; k < 4; k++)
          ASSERT_EQ(std::memcmp(run.outputs[k].bytes, want.outputs[k].bytes, kMaxLanes * 4), 0)
              << "output " << k << ", " << lanes << " lanes in chunks of " << width << "\n" << listing;
        ASSERT_TRUE(run.shared == want.shared) << listing;
      }
    }
}

TEST(JitControlFlow, countedLoopWithoutMasks) {
  agrees(R"(
    %i = var i32
    %sum = var f32
    var.set %sum, %x
    loop
      %at = var.get i32 %i
      %done = ule mask %n, %at
      if %done
        break 0
      endif
      %s = var.get f32 %sum
      %f = utof f32 %at
      %t = fma f32 %s, %u, %f
      var.set %sum, %t
      %next = iadd i32 %at, %1
      var.set %i, %next
    endloop
    %r = var.get f32 %sum
    output 0 %r
    %last = var.get i32 %i
    output 1 %last
  )");
}

TEST(JitControlFlow, loopThatLanesLeaveOneByOneWithinOneThatAllLeaveTogether) {
  agrees(R"(
    %i = var i32
    %total = var i32
    loop
      %at = var.get i32 %i
      %done = ieq mask %at, %n
      if %done
        break 0
      endif
      %next = iadd i32 %at, %1
      var.set %i, %next
      %j = var i32
      var.set %j, %0
      loop
        %jj = var.get i32 %j
        %over = ult mask %small, %jj
        if %over
          break 0
        endif
        %old = var.get i32 %total
        %prod = imul i32 %jj, %at
        %more = iadd i32 %old, %prod
        var.set %total, %more
        %jn = iadd i32 %jj, %1
        var.set %j, %jn
      endloop
    endloop
    %r = var.get i32 %total
    output 0 %r
  )");
}

TEST(JitControlFlow, aBreakOfSomeLanesGivesALoopItsMask) {
  agrees(R"(
    %i = var i32
    %seen = var i32
    loop
      %at = var.get i32 %i
      %done = ieq mask %at, %n
      if %done
        break 0
      endif
      %mine = ieq mask %at, %small
      if %mine
        break 0
      endif
      %next = iadd i32 %at, %1
      var.set %i, %next
      var.set %seen, %next
    endloop
    %r = var.get i32 %seen
    output 0 %r
    %last = var.get i32 %i
    output 1 %last
  )");
}

TEST(JitControlFlow, uniformLoopInsideADivergentBranch) {
  agrees(R"(
    %sum = var f32
    %count = var i32
    %odd = and i32 %small, %1
    %m = ine mask %odd, %0
    if %m
      %i = var i32
      var.set %i, %0
      loop
        %at = var.get i32 %i
        %done = ule mask %3, %at
        if %done
          break 0
        endif
        %s = var.get f32 %sum
        %t = fadd f32 %s, %x
        var.set %sum, %t
        %next = iadd i32 %at, %1
        var.set %i, %next
        var.set %count, %next
      endloop
    else
      var.set %sum, %u
    endif
    %r = var.get f32 %sum
    output 0 %r
    %c = var.get i32 %count
    output 1 %c
  )");
}

TEST(JitControlFlow, branchesOnCountersAndContinue) {
  agrees(R"(
    %i = var i32
    %a = var i32
    %b = var i32
    loop
      %at = var.get i32 %i
      %done = ieq mask %at, %n
      if %done
        break 0
      endif
      %next = iadd i32 %at, %1
      var.set %i, %next
      block
        %even = and i32 %at, %1
        %is = ieq mask %even, %0
        if %is
          %olda = var.get i32 %a
          %newa = iadd i32 %olda, %small
          var.set %a, %newa
          break 0
        else
          %far = ult mask %3, %small
          if %far
            break 0
          endif
          var.set %b, %at
        endif
        %oldb = var.get i32 %b
        %newb = imul i32 %oldb, %3
        var.set %b, %newb
      endblock
    endloop
    %ra = var.get i32 %a
    output 0 %ra
    %rb = var.get i32 %b
    output 1 %rb
  )");
}

TEST(JitControlFlow, returnsFromWithinUniformLoops) {
  agrees(R"(
    %i = var i32
    %out = var i32
    block
      loop
        %at = var.get i32 %i
        %done = ieq mask %at, %n
        if %done
          break 1
        endif
        %hit = ieq mask %at, %small
        if %hit
          var.set %out, %at
          break 1
        endif
        %next = iadd i32 %at, %1
        var.set %i, %next
        output 1 %next
      endloop
      output 2 %lane
    endblock
    %r = var.get i32 %out
    output 0 %r
  )");
}

TEST(JitControlFlow, aConditionOutlivesTheVariableItCameFrom) {
  agrees(R"(
    %v = var mask
    %low = ult mask %small, %3
    var.set %v, %low
    %now = var.get mask %v
    %not = mask.not mask %low
    if %now
      var.set %v, %not
      output 0 %lane
    else
      output 1 %lane
    endif
    %after = var.get mask %v
    if %after
      output 2 %lane
    endif
  )");
}

TEST(JitControlFlow, sharedMemoryInLoopsWithBarriers) {
  agrees(R"(
    %i = var i32
    %sum = var i32
    %four = const i32 4
    %mine = imul i32 %lane, %four
    loop
      %at = var.get i32 %i
      %done = ieq mask %at, %n
      if %done
        break 0
      endif
      %value = iadd i32 %lane, %at
      shared.store %mine, %value
      barrier
      %where = imul i32 %at, %four
      %w = and i32 %where, %where
      %got = shared.load i32 %w
      barrier
      %old = var.get i32 %sum
      %new = iadd i32 %old, %got
      var.set %sum, %new
      %next = iadd i32 %at, %1
      var.set %i, %next
    endloop
    %r = var.get i32 %sum
    output 0 %r
  )");
}

TEST(JitControlFlow, conditionsOfTheDrawAreBranches) {
  agrees(R"(
    %is = ine mask %none, %0
    %v = var f32
    var.set %v, %x
    block
      if %is
        var.set %v, %u
        break 0
      else
        %big = flt mask %u, %x
        if %big
          break 0
        endif
        %d = fmul f32 %x, %u
        var.set %v, %d
      endif
      output 1 %lane
    endblock
    %r = var.get f32 %v
    output 0 %r
  )");
}

}  // namespace
}  // namespace pumice::interp
