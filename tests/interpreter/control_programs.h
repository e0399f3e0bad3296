// Programs of control flow written by hand, and the rows that they run over: each is run by the interpreter (against the
// reference and against what is said here) and by the JIT (against the interpreter).
#pragma once

#include <ostream>

#include "tests/interpreter/fixture.h"

namespace pumice::interp {

struct ControlProgram {
  std::string name;
  std::string body;                                 //!< follows what parsed() begins with
  uint32_t (*expected)(uint32_t lane) = nullptr;    //!< output 0 of a lane that takes part, where it is simple to say
};
inline void PrintTo(const ControlProgram& p, std::ostream* s) { *s << p.name; }

constexpr uint32_t kControlInputs = 3, kControlOutputs = 4, kControlUntouched = 0xdead;

inline Function parsed(const ControlProgram& p) {
  return parsed(R"(
    %lane = input i32 0
    %x = input f32 1
    %small = input i32 2      ; 0 .. 7
    %n = uniform i32 0        ; 5
    %none = uniform i32 4     ; 0
    %u = uniform f32 8        ; 1.25
    %0 = const i32 0
    %1 = const i32 1
    %2 = const i32 2
    %3 = const i32 3
  )" + p.body);
}

//! Calls `use` with rows of several lengths of which all or some lanes take part. Outputs begin as kControlUntouched.
template <class F>
void forControlRows(F use) {
  struct { int32_t n = 5, none = 0; float u = 1.25f; } constants;
  for (uint32_t lanes : {1u, 3u, 5u, 7u, 32u, 40u, 64u, 65u, 127u, 128u})
    for (uint64_t active : {~uint64_t(0), uint64_t(0x8142'2418'1824'4281)}) {
      RowRun row(kControlInputs, kControlOutputs);
      row.lanes = lanes;
      row.active[0] = active;
      row.shared.resize(4096);
      Random random(lanes);
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        row.inputs[0].set(Type::I32, lane, lane);
        row.inputs[1].set(Type::F32, lane, std::bit_cast<uint32_t>(float(random.below(1000)) / 64 - 5));
        row.inputs[2].set(Type::I32, lane, random.below(8));
        for (Row& output : row.outputs) output.set(Type::I32, lane, kControlUntouched);
      }
      row.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&constants), sizeof constants};
      use(std::as_const(row));
      if (::testing::Test::HasFatalFailure()) return;
    }
}

inline std::vector<ControlProgram> controlPrograms() {
  // The start of a loop over %at = 0, 1, ... (variable %i), which a lane leaves when the comparison holds.
  const auto loopUntil = [](const std::string& comparison, const char* leave = "break 0") {
    return "loop\n%at = var.get i32 %i\n%done = " + comparison + "\nif %done\n" + leave + "\nendif\n";
  };
  const std::string countOn = "%next = iadd i32 %at, %1\nvar.set %i, %next\n";

  return {
      {"ifAndElseRunTheirLanesOnly", R"(
        %ten = const i32 10
        %twenty = const i32 20
        %low = and i32 %lane, %1
        %even = ieq mask %low, %0
        %v = var i32
        if %even
          %a = iadd i32 %lane, %ten
          var.set %v, %a
        else
          %b = iadd i32 %lane, %twenty
          var.set %v, %b
        endif
        %r = var.get i32 %v
        output 0 %r
      )", [](uint32_t l) { return l + (l % 2 ? 20 : 10); }},

      {"loopsRunUntilEachLaneHasLeft", R"(  ; sum of 0..lane, one iteration a number
        %i = var i32
        %sum = var i32
        )" + loopUntil("ult mask %lane, %at") + R"(
          %old = var.get i32 %sum
          %new = iadd i32 %old, %at
          var.set %sum, %new
        )" + countOn + R"(
        endloop
        %r = var.get i32 %sum
        output 0 %r
      )", [](uint32_t l) { return l * (l + 1) / 2; }},

      {"continueIsABreakOutOfTheBodysBlock", R"(  ; sum of the odd numbers below lane
        %i = var i32
        %sum = var i32
        )" + loopUntil("ule mask %lane, %at") + R"(
          block
            %low = and i32 %at, %1
            %even = ieq mask %low, %0
            if %even
              break 0
            endif
            %old = var.get i32 %sum
            %new = iadd i32 %old, %at
            var.set %sum, %new
          endblock
        )" + countOn + R"(
        endloop
        %r = var.get i32 %sum
        output 0 %r
      )", [](uint32_t l) { uint32_t s = 0; for (uint32_t i = 0; i < l; i++) s += i % 2 ? i : 0; return s; }},

      // Lanes leave an inner loop, the outer loop, or the whole function from three places.
      {"breaksOutOfSeveralConstructsKeepTheOtherLanes", R"(
        %five = const i32 5
        %hundred = const i32 100
        %i = var i32
        %j = var i32
        %r = var i32
        block
          loop
            var.set %j, %0
            loop
              %jj = var.get i32 %j
              %ii = var.get i32 %i
              %rr = var.get i32 %r
              %r2 = iadd i32 %rr, %1
              var.set %r, %r2
              %prod = imul i32 %ii, %jj
              %big = ult mask %lane, %prod
              if %big
                %m = urem i32 %lane, %3
                %c = ieq mask %m, %0
                if %c
                  break 2
                else
                  break 1
                endif
              endif
              %j2 = iadd i32 %jj, %1
              var.set %j, %j2
              %done = ule mask %five, %j2
              if %done
                break 0
              endif
            endloop
            %i3 = var.get i32 %i
            %i4 = iadd i32 %i3, %1
            var.set %i, %i4
          endloop
          %q = var.get i32 %r
          %q2 = iadd i32 %q, %hundred
          var.set %r, %q2
        endblock
        %out = var.get i32 %r
        output 0 %out
      )", [](uint32_t l) {
        uint32_t r = 0;
        for (uint32_t i = 0;; i++)
          for (uint32_t j = 0; j < 5; j++) {
            r++;
            if (i * j > l) return l % 3 == 0 ? r : r + 100;
          }
      }},

      // %k is used in the loop only, and its row must not be reused there.
      {"valuesFromBeforeALoopSurviveIt", R"(
        %four = const i32 4
        %k = imul i32 %lane, %lane
        %i = var i32
        %s = var i32
        loop
          %s1 = var.get i32 %s
          %s2 = iadd i32 %s1, %k
          var.set %s, %s2
          %a = xor i32 %lane, %four
          %b = imul i32 %a, %a
          %c = iadd i32 %b, %a
          %s3 = xor i32 %s2, %c
          var.set %s, %s3
          %i1 = var.get i32 %i
          %i2 = iadd i32 %i1, %1
          var.set %i, %i2
          %d = ule mask %four, %i2
          if %d
            break 0
          endif
        endloop
        %r = var.get i32 %s
        output 0 %r
      )", [](uint32_t l) {
        uint32_t s = 0;
        for (int i = 0; i < 4; i++) {
          const uint32_t a = l ^ 4;
          s = (s + l * l) ^ (a * a + a);
        }
        return s;
      }},

      // Above all loops that all lanes run alike, whose counters are one number for all lanes and whose regions have no
      // mask, mixed with lanes that part.
      {"countedLoopWithoutMasks", R"(
        %i = var i32
        %sum = var f32
        var.set %sum, %x
        )" + loopUntil("ule mask %n, %at") + R"(
          %s = var.get f32 %sum
          %f = utof f32 %at
          %t = fma f32 %s, %u, %f
          var.set %sum, %t
        )" + countOn + R"(
        endloop
        %r = var.get f32 %sum
        output 0 %r
        %last = var.get i32 %i
        output 1 %last
      )"},

      {"loopThatLanesLeaveOneByOneWithinOneThatAllLeaveTogether", R"(
        %i = var i32
        %total = var i32
        )" + loopUntil("ieq mask %at, %n") + countOn + R"(
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
      )"},

      {"aBreakOfSomeLanesGivesALoopItsMask", R"(
        %i = var i32
        %seen = var i32
        )" + loopUntil("ieq mask %at, %n") + R"(
          %mine = ieq mask %at, %small
          if %mine
            break 0
          endif
        )" + countOn + R"(
          var.set %seen, %next
        endloop
        %r = var.get i32 %seen
        output 0 %r
        %last = var.get i32 %i
        output 1 %last
      )"},

      {"uniformLoopInsideADivergentBranch", R"(
        %sum = var f32
        %count = var i32
        %odd = and i32 %small, %1
        %m = ine mask %odd, %0
        if %m
          %i = var i32
          var.set %i, %0
          )" + loopUntil("ule mask %3, %at") + R"(
            %s = var.get f32 %sum
            %t = fadd f32 %s, %x
            var.set %sum, %t
          )" + countOn + R"(
            var.set %count, %next
          endloop
        else
          var.set %sum, %u
        endif
        %r = var.get f32 %sum
        output 0 %r
        %c = var.get i32 %count
        output 1 %c
      )"},

      {"branchesOnCountersAndContinue", R"(
        %i = var i32
        %a = var i32
        %b = var i32
        )" + loopUntil("ieq mask %at, %n") + countOn + R"(
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
      )"},

      {"returnsFromWithinUniformLoops", R"(
        %i = var i32
        %out = var i32
        block
          )" + loopUntil("ieq mask %at, %n", "break 1") + R"(
            %hit = ieq mask %at, %small
            if %hit
              var.set %out, %at
              break 1
            endif
          )" + countOn + R"(
            output 1 %next
          endloop
          output 2 %lane
        endblock
        %r = var.get i32 %out
        output 0 %r
      )"},

      {"aConditionOutlivesTheVariableItCameFrom", R"(
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
      )"},

      {"sharedMemoryInLoopsWithBarriers", R"(
        %i = var i32
        %sum = var i32
        %four = const i32 4
        %mine = imul i32 %lane, %four
        )" + loopUntil("ieq mask %at, %n") + R"(
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
        )" + countOn + R"(
        endloop
        %r = var.get i32 %sum
        output 0 %r
      )"},

      {"conditionsOfTheDrawAreBranches", R"(
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
      )"},
  };
}

//! The name of a program's test.
inline std::string nameOfControlProgram(const ::testing::TestParamInfo<ControlProgram>& info) { return info.param.name; }

}  // namespace pumice::interp
