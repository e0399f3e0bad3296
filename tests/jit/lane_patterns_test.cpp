// Addresses that count along the lanes of a work group: the interpreter's bits, and not a byte read or written beyond, whatever the size
// of the group, the form of the offset, and wherever the buffers end.
#include <sys/mman.h>

#include <array>

#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {
namespace {

//! Bytes with inaccessible memory behind them.
class Fenced {
 public:
  static constexpr size_t kBytes = 64 * 1024;
  Fenced() {
    pages_ = static_cast<std::byte*>(mmap(nullptr, 2 * kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    mprotect(pages_ + kBytes, kBytes, PROT_NONE);
  }
  ~Fenced() { munmap(pages_, 2 * kBytes); }
  Fenced(const Fenced&) = delete;
  Fenced& operator=(const Fenced&) = delete;
  std::byte* last(size_t bytes) const { return pages_ + kBytes - bytes; }

 private:
  std::byte* pages_;
};

using Size = std::array<uint32_t, 3>;
constexpr Size kSizes[] = {{256, 1, 1}, {128, 1, 1}, {64, 1, 1}, {32, 1, 1}, {16, 16, 1}, {8, 8, 1}, {32, 4, 2}, {4, 4, 4}, {2, 16, 1}, {1, 64, 1}, {1, 1, 32}, {96, 1, 1}, {24, 4, 1}, {12, 8, 1}, {40, 2, 2}};

struct Constants {
  uint64_t source, sourceBytes, target, targetBytes;
};

//! Runs `text` for all rows of three work groups. %x %y %z: local id, %gx %gy: the group's, %source, %target and their sizes; table.load
//! 32: a number that is the same for the draw.
void agrees(const std::string& text, const Size& size, size_t sourceBytes, size_t targetBytes, uint32_t number = 0) {
  if (!jit::available()) GTEST_SKIP();
  const std::string header = "function \"f\" shared=8192 group=" + std::to_string(size[0]) + "x" + std::to_string(size[1]) + "x" + std::to_string(size[2]);
  const Function f = parsed(header + R"(
    %x = input i32 0
    %y = input i32 1
    %z = input i32 2
    %gx = input i32 3
    %gy = input i32 4
    %source = uniform i64 0
    %sourceBytes = uniform i64 8
    %target = uniform i64 16
    %targetBytes = uniform i64 24
    %number = uniform i32 32
    %two = const i32 2
    %three = const i32 3
    %four = const i32 4
    %five = const i32 5
    %most = const i32 0x3fffffff
    %mostFours = const i32 0x0fffffff
    %sx = const i32 )" + std::to_string(size[0]) + "\n%sy = const i32 " + std::to_string(size[1]) + R"(
    %yz = imul i32 %z, %sy
    %row = iadd i32 %yz, %y
    %before = imul i32 %row, %sx
    %index = iadd i32 %before, %x
    %total = const i32 )" + std::to_string(size[0] * size[1] * size[2]) + R"(
    %own = imul i32 %gx, %total
    %at = iadd i32 %own, %index
  )" + text);
  ASSERT_EQ(f.groupSize[0], size[0]);
  Fenced source, target;
  for (size_t k = 0; k < Fenced::kBytes; k++) source.last(Fenced::kBytes)[k] = std::byte(k * 37 + k / 256);
  struct {
    Constants c;
    uint32_t number;
  } draw{{reinterpret_cast<uintptr_t>(source.last(sourceBytes)), sourceBytes, reinterpret_cast<uintptr_t>(target.last(targetBytes)), targetBytes}, number};
  const uint32_t invocations = size[0] * size[1] * size[2];
  // Row by row, or a whole work group at once.
  const auto run = [&](const Executable& e, bool whole = false) {
    std::memset(target.last(targetBytes), 0x55, targetBytes);
    std::vector<std::byte> seen;
    for (uint32_t group = 0; group < 3; group++) {
      std::vector<std::byte> shared(8192);
      if (whole) {
        std::vector<uint32_t> ids[6];
        for (uint32_t i = 0; i < invocations; i++) {
          const uint32_t id[6] = {i % size[0], i / size[0] % size[1], i / size[0] / size[1], i % 8 ? 0xdeadu : group, i % 8 ? 0xbeefu : 2 * group, i % 8 ? 0 : 7u};
          for (unsigned k = 0; k < 6; k++) ids[k].push_back(id[k]);
        }
        std::vector<uint32_t> results[4];
        const void* in[6];
        void* out[4];
        for (unsigned k = 0; k < 6; k++) in[k] = ids[k].data();
        for (unsigned k = 0; k < 4; k++) results[k].resize(invocations), out[k] = results[k].data();
        Table tables[ir::kTableCount] = {};
        tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&draw), sizeof draw};
        ExecContext c;
        c.lanes = invocations;
        c.inputs = in;
        c.outputs = out;
        c.tables = tables;
        c.shared = shared.data();
        c.sharedBytes = shared.size();
        base::ScopedFpEnv environment;
        e.runGroup(e.preamble(tables), c);
        for (uint32_t first = 0; first < invocations; first += kMaxLanes)
          for (const auto& r : results) {
            const auto* bytes = reinterpret_cast<const std::byte*>(r.data() + first);
            seen.insert(seen.end(), bytes, bytes + std::min(invocations - first, kMaxLanes) * 4);
          }
        continue;
      }
      for (uint32_t first = 0; first < invocations; first += kMaxLanes) {
        RowRun row(6, 4);
        row.lanes = std::min(invocations - first, kMaxLanes);
        for (uint32_t l = 0; l < row.lanes; l++) {
          const uint32_t i = first + l;
          const uint32_t ids[6] = {i % size[0], i / size[0] % size[1], i / size[0] / size[1], group, 2 * group, 7};
          for (unsigned k = 0; k < 6; k++) row.inputs[k].set(Type::I32, l, ids[k]);
        }
        row.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&draw), sizeof draw};
        row.shared = shared;
        row.execute(e);
        shared = row.shared;
        for (const Row& out : row.outputs) seen.insert(seen.end(), out.bytes, out.bytes + row.lanes * 4);
      }
    }
    seen.insert(seen.end(), target.last(targetBytes), target.last(0));
    return seen;
  };
  auto interpreted = compileInterpreter(f, {});
  ASSERT_TRUE(interpreted) << interpreted.error().message;
  const std::vector<std::byte> want = run(**interpreted);
  for (const jit::JitOptions& o : {jit::JitOptions{.chunkLanes = 8}, {.chunkLanes = 16}, {.chunkLanes = 32}, {}, {.chunkLanes = 16, .isa = jit::Isa::Avx512, .upperFirst = true}}) {
    std::string listing;
    jit::JitOptions options = o;
    options.listing = &listing;
    auto e = jit::compile(f, {}, options);
    ASSERT_TRUE(e) << e.error().message;
    if (!jit::runs(o.isa)) continue;   // at least it can be encoded
    ASSERT_TRUE(run(**e) == want) << "chunks of " << o.chunkLanes << ", " << sourceBytes << " and " << targetBytes << " bytes, number " << number << "\n"
                                  << ir::print(f) << listing;
    ASSERT_TRUE((*e)->runsGroups());
    ASSERT_TRUE(run(**e, true) == want) << "whole groups, chunks of " << o.chunkLanes << ", " << sourceBytes << " and " << targetBytes << " bytes, number "
                                        << number << "\n" << ir::print(f) << listing;
  }
}

void agreesEverywhere(const std::string& text) {
  for (const Size& size : kSizes)
    for (const auto& [from, to] : {std::pair<size_t, size_t>{32768, 32768}, {1000, 32768}, {32768, 1004}, {3, 8}, {0, 0}, {16 * 96, 4 * 96}}) {
      agrees(text, size, from, to, 3);
      if (::testing::Test::HasFailure()) return;
    }
}

TEST(JitLanePatterns, neighbours) {
  agreesEverywhere(R"(
    %clamped = umin i32 %at, %most
    %off = shl i32 %clamped, %two
    %a = load i32 %source, %off, %sourceBytes
    %b = load i32 +8 %source, %off, %sourceBytes
    %c = iadd i32 %a, %b
    store %target, %off, %targetBytes, %c
  )");
}

TEST(JitLanePatterns, indicesThatWrapAndAreClamped) {
  for (uint32_t number : {0xfffffff0u, 0x3ffffff8u, 0x40000000u, 0x3fffffffu - 40, 0x7ffffffcu})
    for (const Size& size : kSizes) {
      agrees(R"(
        %far = iadd i32 %at, %number
        %clamped = umin i32 %most, %far
        %off = shl i32 %clamped, %two
        %a = load i32 %source, %off, %sourceBytes
        output 0 %a
        %plain = shl i32 %far, %two
        %b = load i32 %source, %plain, %sourceBytes
        output 1 %b
        %less = isub i32 %plain, %number
        %c = load i32 %source, %less, %sourceBytes
        output 2 %c
        store %target, %plain, %targetBytes, %a
      )", size, 20000, 600, number);
      if (HasFailure()) return;
    }
}

TEST(JitLanePatterns, steppedBackwardsAndTransposed) {
  agreesEverywhere(R"(
    %back = isub i32 %total, %index
    %b4 = shl i32 %back, %two
    %a = load f32 %source, %b4, %sourceBytes
    %stepped = shl i32 %at, %five
    %b = load f32 +4 %source, %stepped, %sourceBytes
    %xs = imul i32 %x, %sy
    %turned = iadd i32 %xs, %y
    %t4 = shl i32 %turned, %two
    %c = load f32 %source, %t4, %sourceBytes
    %y4 = shl i32 %y, %two
    %d = load f32 %source, %y4, %sourceBytes
    %ab = fadd f32 %a, %b
    %cd = fadd f32 %c, %d
    %abcd = fadd f32 %ab, %cd
    output 0 %a
    output 1 %b
    output 2 %c
    output 3 %d
    store %target, %t4, %targetBytes, %abcd
    store +4 %target, %stepped, %targetBytes, %abcd
  )");
}

TEST(JitLanePatterns, fourWordsOfARecord) {
  agreesEverywhere(R"(
    %clamped = umin i32 %at, %mostFours
    %off = shl i32 %clamped, %four
    %a = load f32 %source, %off, %sourceBytes
    %b = load f32 +4 %source, %off, %sourceBytes
    %c = load f32 +8 %source, %off, %sourceBytes
    %d = load f32 +12 %source, %off, %sourceBytes
    output 0 %a
    output 1 %b
    output 2 %c
    output 3 %d
    %ac = fadd f32 %a, %c
    %local = shl i32 %index, %four
    shared.store %local, %a
    shared.store +4 %local, %ac
    shared.store +8 %local, %c
    shared.store +12 %local, %b
    %p = shared.load f32 %local
    %q = shared.load f32 +4 %local
    %r = shared.load f32 +8 %local
    store %target, %off, %targetBytes, %p
    store +4 %target, %off, %targetBytes, %q
    store +8 %target, %off, %targetBytes, %r
    store +12 %target, %off, %targetBytes, %d
  )");
}

//! Offsets that are not known beforehand, of whole records all the same.
TEST(JitLanePatterns, fourWordsOfRecordsAnywhere) {
  agreesEverywhere(R"(
    %i4 = shl i32 %index, %two
    %random = load i32 %source, %i4, %sourceBytes
    %cap = const i32 1023
    %near = and i32 %random, %cap
    %off = shl i32 %near, %four
    %a = load f32 %source, %off, %sourceBytes
    %b = load f32 +4 %source, %off, %sourceBytes
    %c = load f32 +8 %source, %off, %sourceBytes
    %d = load f32 +12 %source, %off, %sourceBytes
    output 0 %a
    output 1 %b
    output 2 %c
    output 3 %d
    %p = load f32 +16 %source, %off, %sourceBytes
    %q = load f32 +20 %source, %off, %sourceBytes
    %r = load f32 +24 %source, %off, %sourceBytes
    %pq = fadd f32 %p, %q
    %pqr = fadd f32 %pq, %r
    store %target, %i4, %targetBytes, %pqr
  )");
}

TEST(JitLanePatterns, inLoopsAndWithSomeLanesOnly) {
  agreesEverywhere(R"(
    %sum = var i32
    %i = var i32
    loop
      %n = var.get i32 %i
      %end = ult mask %n, %five
      %over = mask.not mask %end
      if %over
        break 0
      endif
      %base = shl i32 %n, %four
      %from = iadd i32 %base, %index
      %from4 = shl i32 %from, %two
      %a = load i32 %source, %from4, %sourceBytes
      %flat4 = shl i32 %n, %two
      %b = load i32 %source, %flat4, %sourceBytes
      %s = var.get i32 %sum
      %ab = imul i32 %a, %b
      %next = iadd i32 %s, %ab
      var.set %sum, %next
      %odd = ult mask %x, %three
      if %odd
        %o4 = shl i32 %at, %two
        store %target, %o4, %targetBytes, %next
        %some = load i32 +4 %source, %o4, %sourceBytes
        %s2 = iadd i32 %some, %next
        var.set %sum, %s2
      endif
      %one = const i32 1
      %n1 = iadd i32 %n, %one
      var.set %i, %n1
    endloop
    %total4 = var.get i32 %sum
    output 0 %total4
    %at4 = shl i32 %at, %two
    shared.store %at4, %total4
    %mine = shared.load i32 %at4
    output 1 %mine
  )");
}

//! Values, variables and loops' counters live on behind barriers; work groups of one row, since a row's barrier knows no other row.
TEST(JitLanePatterns, barriersWithinAndOutsideOfLoops) {
  for (const Size& size : kSizes) {
    if (size[0] * size[1] * size[2] > kMaxLanes) continue;
    agrees(R"(
      %sum = var i32
      %i = var i32
      %last = isub i32 %total, %five
      %local = shl i32 %index, %two
      %at4 = shl i32 %at, %two
      %a = load i32 %source, %at4, %sourceBytes
      shared.store %local, %a
      var.set %sum, %a
      barrier
      loop
        %n = var.get i32 %i
        %in = ult mask %n, %five
        %over = mask.not mask %in
        if %over
          break 0
        endif
        %other = xor i32 %index, %n
        %o4 = shl i32 %other, %two
        %b = shared.load i32 %o4
        %s = var.get i32 %sum
        %more = iadd i32 %s, %b
        var.set %sum, %more
        barrier
        %some = ult mask %index, %last
        if %some
          shared.store %local, %more
        endif
        %onec = const i32 1
        %c1 = const i32 1
        shared.store +4096 %local, %more
        %bin = and i32 %more, %three
        %bin4 = shl i32 %bin, %two
        %old = shared.atomic i32 add+8000 %bin4, %n
        if %some
          %old2 = shared.atomic i32 xor+8032 %bin4, %b
        endif
        barrier
        %n1 = iadd i32 %n, %onec
        var.set %i, %n1
      endloop
      %end = var.get i32 %sum
      output 0 %end
      %z4 = and i32 %local, %three
      %bins = shared.load i32 +8000 %z4
      output 1 %bins
      %back = isub i32 %total, %index
      %b4 = shl i32 %back, %two
      %mine = shared.load i32 +4092 %b4
      output 2 %mine
      %x3 = and i32 %index, %three
      %x34 = shl i32 %x3, %two
      %xors = shared.load i32 +8032 %x34
      output 3 %xors
    )", size, 3000, 100);
    if (HasFailure()) return;
  }
}

//! Loops that become their turns: other first values, steps and comparisons, none at all, and variables that go on behind them.
TEST(JitLanePatterns, loopsOfFewTurns) {
  struct Loop {
    const char *compare, *first, *step, *bound;
  };
  for (const Loop& l : {Loop{"ult", "0", "1", "5"}, {"slt", "-3", "1", "2"}, {"sle", "-16", "4", "16"}, {"ule", "7", "9", "100"}, {"ult", "5", "1", "5"},
                        {"slt", "1", "-1", "0"}, {"ult", "0", "1", "16"}, {"ult", "0", "1", "17"}, {"ult", "0xfffffff0", "5", "0xffffffff"}})
    for (const Size& size : {Size{256, 1, 1}, Size{16, 16, 1}, Size{4, 4, 4}, Size{24, 4, 1}}) {
      agrees(std::string("%first = const i32 ") + l.first + "\n%step = const i32 " + l.step + "\n%bound = const i32 " + l.bound + R"(
        %sum = var i32
        %i = var i32
        %again = var i32
        %x4 = shl i32 %x, %two
        %seven = const i32 7
        loop
          %r = var.get i32 %again
          %inner = ult mask %r, %two
          %enough = mask.not mask %inner
          if %enough
            break 0
          endif
          var.set %i, %first
          loop
            %n = var.get i32 %i
            %in = )" + l.compare + R"( mask %n, %bound
            %over = mask.not mask %in
            if %over
              break 0
            endif
            %n4 = shl i32 %n, %two
            %row4 = imul i32 %n, %seven
            %off = iadd i32 %x4, %n4
            %off2 = iadd i32 %row4, %off
            %a = load i32 %source, %off, %sourceBytes
            %b = load i32 +4 %source, %off2, %sourceBytes
            %same = iadd i32 %n4, %r
            %c = load i32 %source, %same, %sourceBytes
            %s = var.get i32 %sum
            %ab = imul i32 %a, %b
            %abc = iadd i32 %ab, %c
            %next = iadd i32 %s, %abc
            var.set %sum, %next
            %n1 = iadd i32 %n, %step
            var.set %i, %n1
          endloop
          %one = const i32 1
          %r1 = iadd i32 %r, %one
          var.set %again, %r1
        endloop
        %total4 = var.get i32 %sum
        output 0 %total4
        %left = var.get i32 %i
        output 1 %left
      )", size, 2000, 8);
      if (HasFailure()) return;
    }
}

//! They save what they are for: no vector of offsets is made, nor compared.
TEST(JitLanePatterns, makeAccessesPlain) {
  if (!jit::available()) GTEST_SKIP();
  const auto code = [](const char* group) {
    std::string listing;
    auto e = jit::compile(parsed(std::string("function \"f\"") + group + R"(
      %x = input i32 0
      %g = input i32 3
      %eight = const i32 8
      %two = const i32 2
      %first = shl i32 %g, %eight
      %i = iadd i32 %first, %x
      %off = shl i32 %i, %two
      %base = uniform i64 0
      %size = uniform i64 8
      %a = load f32 %base, %off, %size
      %b = fadd f32 %a, %a
      store %base, %off, %size, %b
    )"), {}, {.listing = &listing});
    return e ? listing.substr(0, listing.find("ret")) : std::string();
  };
  const std::string plain = code(" group=256x1x1"), unknown = code("");
  EXPECT_NE(unknown.find("vmovmskps"), std::string::npos) << unknown;
  EXPECT_EQ(plain.find("vmovmskps"), std::string::npos) << plain;
  EXPECT_EQ(plain.find("vptest"), std::string::npos) << plain;
  EXPECT_NE(plain.find("vmovups"), std::string::npos) << plain;
}

}  // namespace
}  // namespace pumice::interp
