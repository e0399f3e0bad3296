// Loads and atomics in every form that has code of its own, over memory that ends where the process's does: the
// interpreter's bits, and not a byte read beyond.
#include <sys/mman.h>

#include "tests/jit/every_width.h"

namespace pumice::interp {
namespace {

//! Bytes with inaccessible memory behind them.
class Fenced {
 public:
  static constexpr size_t kPage = 4096;
  explicit Fenced(size_t size) : size_(size) {
    pages_ = static_cast<std::byte*>(mmap(nullptr, 2 * kPage, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    mprotect(pages_ + kPage, kPage, PROT_NONE);
    fill();
  }
  ~Fenced() { munmap(pages_, 2 * kPage); }
  Fenced(const Fenced&) = delete;
  Fenced& operator=(const Fenced&) = delete;
  void fill() {
    Random random(size_);
    for (size_t k = 0; k < size_; k++) data()[k] = std::byte(random.below(256));
  }
  std::byte* data() const { return pages_ + kPage - size_; }
  std::vector<std::byte> contents() const { return {data(), data() + size_}; }

 private:
  size_t size_;
  std::byte* pages_;
};

//! Inputs: 0 i64 bases (some null), 1 i32 offsets, 2 i64 sizes, 3 i64 offsets, 4 i32 data; draw constants: i64 base, i64 size.
void agrees(const std::string& text, size_t bytes) {
  if (!jit::available()) GTEST_SKIP();
  const Function f = parsed(R"(
    %base = input i64 0
    %off = input i32 1
    %size = input i64 2
    %off64 = input i64 3
    %data = input i32 4
    %ubase = uniform i64 0
    %usize = uniform i64 8
    %zero = const i32 0
    %some = slt mask %data, %zero
  )" + text);
  Fenced memory(bytes);
  struct { uint64_t base, size; } constants{reinterpret_cast<uintptr_t>(memory.data()), bytes};
  for (uint32_t lanes : {3u, 40u, 128u})
    for (uint32_t far : {0u, 20u}) {
      RowRun start(5, 4);
      start.lanes = lanes;
      start.active[0] = 0xfff7'ffff'ffff'ffdf;
      Random random(lanes + far);
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const bool inactive = lane < 64 && !(start.active[0] >> lane & 1);
        const uint64_t skip = random.below(uint32_t(bytes) + 1);
        start.inputs[0].set(Type::I64, lane, inactive ? 0xdead'beef'0000'0000 : random.chance(10) ? 0 : constants.base + skip);
        start.inputs[1].set(Type::I32, lane, random.chance(far) ? 0xffff'fff0u + random.below(16) : random.below(uint32_t(bytes) + 2));
        start.inputs[2].set(Type::I64, lane, inactive ? ~uint64_t(0) : random.chance(10) ? 0 : bytes - skip);
        start.inputs[3].set(Type::I64, lane, random.chance(far) ? 0 - uint64_t(random.below(20)) : random.below(uint32_t(bytes) + 2));
        start.inputs[4].set(Type::I32, lane, uint32_t(random.next()));
      }
      start.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&constants), sizeof constants};
      memory.fill();
      RowRun want = start;
      want(f);
      const std::vector<std::byte> written = memory.contents();
      inEveryWidth(f, start, [&] { memory.fill(); }, [&](const RowRun& run, uint32_t width, const std::string& listing) {
        for (unsigned k = 0; k < 4; k++)
          ASSERT_EQ(std::memcmp(run.outputs[k].bytes, want.outputs[k].bytes, kMaxLanes * 8), 0)
              << "output " << k << ", " << bytes << " bytes, " << lanes << " lanes in chunks of " << width << "\n" << text << listing;
        ASSERT_TRUE(memory.contents() == written) << bytes << " bytes, " << lanes << " lanes in chunks of " << width << "\n" << text << listing;
      });
      if (::testing::Test::HasFatalFailure()) return;
    }
}

TEST(JitMemory, loadsOfEveryWidthFromEverySortOfAddress) {
  for (const char* t : {"i8", "i16", "i32", "f32", "i64", "f64"})
    for (const char* constant : {"", "+3", "+40"})
      for (size_t bytes : {1u, 7u, 8u, 100u, 4096u}) {
        const std::string load = "load " + std::string(t) + " " + constant;
        agrees("%a = " + load + " %base, %off, %size\noutput 0 %a\n%b = " + load + " %base, %off64, %size\noutput 1 %b\n" +
                   "%c = " + load + " %ubase, %off, %usize\noutput 2 %c\n%d = " + load + " %ubase, %off64, %usize\noutput 3 %d\n",
               bytes);
        if (HasFailure()) return;
      }
}

// As texels of 8 bytes are read where a picture is drawn at its own size; then the same with one lane elsewhere, and beyond the end. Once
// nobody looks at a loaded value but at its words.
TEST(JitMemory, quadsThatReadNeighboursInTwoRows) {
  for (const auto& [stray, whole] : {std::pair("0", "output 1 %b"), std::pair("8", "output 1 %b"), std::pair("128", "output 1 %b"), std::pair("0", ""), std::pair("8", ""), std::pair("128", "")})
    for (size_t bytes : {8u, 24u, 90u, 400u, 700u, 4096u})
      agrees(R"(
        %id = lane.id i32
        %one = const i32 1
        %two = const i32 2
        %three = const i32 3
        %six = const i32 6
        %pitch = const i32 100
        %right = and i32 %id, %one
        %id1 = lshr i32 %id, %one
        %down = and i32 %id1, %one
        %id2 = lshr i32 %id, %two
        %far = and i32 %id2, %one
        %far2 = shl i32 %far, %one
        %x = or i32 %right, %far2
        %column = shl i32 %x, %three
        %row = imul i32 %down, %pitch
        %group = lshr i32 %id, %three
        %at = shl i32 %group, %six
        %here = iadd i32 %row, %at
        %there = iadd i32 %column, %here
        %strayed = const i32 )" + std::string(stray) + R"(
        %seventeen = const i32 17
        %is = ieq mask %id, %seventeen
        %moved = iadd i32 %here, %strayed
        %from = select i32 %is, %moved, %here
        %place = iadd i32 %from, %column
        %a = load i64 %ubase, %place, %usize
        output 0 %a
        %b = load.const i64 +4 %ubase, %there, %usize
        )" + std::string(whole) + R"(
        %up = const i64 32
        %c = lshr i64 %b, %up
        %d = trunc i32 %c
        %half = const i32 16
        %e = lshr i32 %d, %half
        %f = trunc i16 %e
        %g = bitcast f16 %f
        %h = ftof f32 %g
        output 2 %h
        %i = trunc i16 %d
        %j = bitcast f16 %i
        %k = ftof f32 %j
        %l = trunc i32 %b
        %m = trunc i16 %l
        %n = bitcast f16 %m
        %o = ftof f32 %n
        %p = fadd f32 %k, %o
        output 3 %p
      )", bytes);
}

// As the columns of a bilinear footprint: x and x + 1, which the last column clamps.
TEST(JitMemory, pairsOfNeighbours) {
  for (const auto& [type, shift] : {std::pair("i32", "2"), std::pair("i64", "3"), std::pair("f32", "2")})
    for (const char* last : {"10", "40", "1000"})
      for (size_t bytes : {4u, 8u, 100u, 300u, 4096u})
        agrees(R"(
          %one = const i32 1
          %mask = const i32 63
          %pitch = const i32 48
          %shift = const i32 )" + std::string(shift) + R"(
          %last = const i32 )" + std::string(last) + R"(
          %x0 = and i32 %off, %mask
          %next = iadd i32 %x0, %one
          %x1 = umin i32 %next, %last
          %y = lshr i32 %off, %one
          %y0 = and i32 %y, %one
          %row = imul i32 %y0, %pitch
          %c0 = shl i32 %x0, %shift
          %c1 = shl i32 %x1, %shift
          %at0 = iadd i32 %row, %c0
          %at1 = iadd i32 %c1, %row
          %a = load.const )" + type + R"( %ubase, %at0, %usize
          %b = load.const )" + type + R"( %ubase, %at1, %usize
          output 0 %a
          output 1 %b
        )", bytes);
}

// Texels of which only the words are looked at, neighbours and others.
TEST(JitMemory, wordsOfScatteredTexels) {
  for (const char* second : {"%column", "%elsewhere"})
    for (const char* whole : {"", "output 3 %b"})
      for (size_t bytes : {8u, 100u, 300u, 4096u})
        agrees(R"(
          %one = const i32 1
          %three = const i32 3
          %up = const i64 32
          %mask = const i32 63
          %x = and i32 %off, %mask
          %next = umin i32 %x, %off
          %elsewhere = and i32 %data, %mask
          %column = shl i32 %x, %three
          %row = lshr i32 %off, %one
          %at0 = iadd i32 %row, %column
          %at1 = iadd i32 %row, )" + std::string(second) + R"(
          %a = load.const i64 %ubase, %at0, %usize
          %b = load.const i64 +8 %ubase, %at1, %usize
          %a0 = trunc i32 %a
          %ahigh = lshr i64 %a, %up
          %a1 = trunc i32 %ahigh
          %bhigh = lshr i64 %b, %up
          %b1 = trunc i32 %bhigh
          output 0 %a0
          output 1 %a1
          output 2 %b1
          )" + std::string(whole) + "\n", bytes);
}

// Bilinear footprints of half-float texels: of a picture that is drawn at its own size; with one lane elsewhere; anywhere.
TEST(JitMemory, footprintsOfHalves) {
  for (const char* rows : {"%here", "%strayed", "%anywhere"})
    for (const char* columns : {"%column", "%any"})
      for (size_t bytes : {7u, 8u, 100u, 400u, 4096u})
        agrees(R"(
          %id = lane.id i32
          %one = const i32 1
          %two = const i32 2
          %three = const i32 3
          %six = const i32 6
          %eight = const i32 8
          %mask = const i32 511
          %pitch = const i32 72
          %right = and i32 %id, %one
          %id1 = lshr i32 %id, %one
          %down = and i32 %id1, %one
          %id2 = lshr i32 %id, %two
          %far = and i32 %id2, %one
          %far2 = shl i32 %far, %one
          %x = or i32 %right, %far2
          %column = shl i32 %x, %three
          %any = and i32 %data, %mask
          %row = imul i32 %down, %pitch
          %group = lshr i32 %id, %three
          %at = shl i32 %group, %six
          %here = iadd i32 %row, %at
          %seventeen = const i32 17
          %is = ieq mask %id, %seventeen
          %moved = iadd i32 %here, %pitch
          %strayed = select i32 %is, %moved, %here
          %half = lshr i32 %off, %one
          %anywhere = iadd i32 %half, %row
          %next = iadd i32 )" + std::string(rows) + R"(, %pitch
          %beside = iadd i32 )" + std::string(columns) + R"(, %eight
          %byte = const i32 255
          %scale = const f32 0x3b808081
          %w0 = and i32 %data, %byte
          %w1 = stof f32 %w0
          %wx = fmul f32 %w1, %scale
          %v0 = and i32 %off, %byte
          %v1 = stof f32 %v0
          %wy = fmul f32 %v1, %scale
          %a = filter.halves f32 0 %ubase, %usize, )" + std::string(rows) + ", %next, " + columns + R"(, %beside, %wx, %wy
          output 0 %a
          if %some
            %b = filter.halves f32 1 %ubase, %usize, )" + std::string(rows) + ", %next, " + columns + R"(, %beside, %wx, %wy
            output 1 %b
            %c = filter.halves f32 2 %ubase, %usize, %next, )" + std::string(rows) + ", %beside, " + columns + R"(, %wy, %wx
            output 2 %c
          else
            %d = filter.halves f32 3 %ubase, %usize, %next, )" + std::string(rows) + ", %beside, " + columns + R"(, %wy, %wx
            output 3 %d
          endif
        )", bytes);
}

// Bilinear footprints of four bytes: columns side by side in all lanes, in all but one, of blocks, or anywhere; the components of one
// footprint together, alone, and as what variables hold.
TEST(JitMemory, footprintsOfBytes) {
  for (const char* second : {"%beside", "%strayed", "%any"})
    for (const char* column : {"%column", "%block"})
      for (size_t bytes : {3u, 4u, 100u, 400u, 4096u})
        agrees(R"(
          %id = lane.id i32
          %one = const i32 1
          %two = const i32 2
          %three = const i32 3
          %mask = const i32 511
          %pitch = const i32 72
          %x0 = and i32 %data, %three
          %sum = iadd i32 %x0, %id
          %column = shl i32 %id, %two
          %block = shl i32 %sum, %two
          %any = and i32 %data, %mask
          %row = lshr i32 %off, %three
          %next = iadd i32 %row, %pitch
          %four = const i32 4
          %beside = iadd i32 )" + std::string(column) + R"(, %four
          %seventeen = const i32 17
          %is = ieq mask %id, %seventeen
          %strayed = select i32 %is, %row, %beside
          %byte = const i32 255
          %scale = const f32 0x3b808081
          %w0 = and i32 %data, %byte
          %w1 = stof f32 %w0
          %wx = fmul f32 %w1, %scale
          %v0 = and i32 %off, %byte
          %v1 = stof f32 %v0
          %wy = fmul f32 %v1, %scale
          %kept = fadd f32 %wx, %wy
          %held = var f32
          %a = filter.bytes f32 0 %ubase, %usize, %row, %next, )" + column + ", " + second + R"(, %wx, %wy
          %b = filter.bytes f32 3 %ubase, %usize, %row, %next, )" + column + ", " + second + R"(, %wx, %wy
          %c = filter.bytes f32 1 %ubase, %usize, %row, %next, )" + column + ", " + second + R"(, %wx, %wy
          %d = filter.bytes f32 1 %ubase, %usize, %row, %next, )" + column + ", " + second + R"(, %wx, %wy
          var.set %held, %c
          %ab = fadd f32 %a, %b
          output 0 %ab
          if %some
            %e = filter.bytes f32 2 %ubase, %usize, %next, %row, )" + column + ", " + second + R"(, %wy, %kept
            %f = filter.bytes f32 0 %ubase, %usize, %next, %row, )" + column + ", " + second + R"(, %wy, %kept
            var.set %held, %f
            output 1 %e
          endif
          %got = var.get f32 %held
          output 2 %got
          %dk = fadd f32 %d, %kept
          output 3 %dk
        )", bytes);
}

// Levels of one to sixteen texels a side that are the same for all, for a quad, or for a lane; places inside, across the border, and no numbers at
// all; one level or two, of which the second may have no share anywhere.
TEST(JitMemory, footprintsThatFindTheirAddresses) {
  const char* const places[] = {"%inside", "%across", "%any"};
  const char* const sizes[] = {"%eight", "%byquad", "%bylane"};
  for (size_t bytes : {3u, 7u, 100u, 400u, 4096u})
    for (const char* place : places)
      for (const char* size : sizes)
        for (const char* weight : {"%w", "%nothing"})
          for (unsigned clamps : {0u, 4u, 8u, 12u}) {
            const auto byte = [&](unsigned c) { return std::to_string(c + clamps); };
            const std::string level = std::string("%ubase, %usize, ") + place + ", %across, " + size + ", %height, %pitch, %start";
            const std::string levels = level + ", %half, %one, %pitch, %later, " + weight;
            agrees(R"(
              %one = const i32 1
              %two = const i32 2
              %eight = const i32 8
              %fifteen = const i32 15
              %sixty = const i32 60
              %low = const i32 255
              %nothing = const f32 0x0
              %scale = const f32 0x3b808081
              %little = const f32 0x3e4ccccd
              %most = const f32 0x3f19999a
              %b0 = and i32 %data, %low
              %b1 = stof f32 %b0
              %across = fmul f32 %b1, %scale
              %inside = fma f32 %across, %most, %little
              %any = bitcast f32 %data
              %c0 = and i32 %off, %low
              %c1 = stof f32 %c0
              %w = fmul f32 %c1, %scale
              %q0 = quad.ddx f32 0 %c1
              %q1 = ftos i32 %q0
              %q2 = and i32 %q1, %fifteen
              %byquad = iadd i32 %q2, %one
              %l0 = and i32 %off, %fifteen
              %bylane = iadd i32 %l0, %one
              %half0 = lshr i32 )" + std::string(size) + R"(, %one
              %half = umax i32 %half0, %one
              %height = iadd i32 %q2, %two
              %pitch = const i32 36
              %start = and i32 %q1, %sixty
              %later = iadd i32 %start, %sixty
              %held = var f32
              %a = filter.levels f32 )" + byte(0) + " " + levels + R"(
              %b = filter.levels f32 )" + byte(3) + " " + levels + R"(
              %c = filter.levels f32 )" + byte(1) + " " + levels + R"(
              %d = filter.level f32 )" + byte(2) + " " + level + R"(
              %e = filter.level f32 )" + byte(0) + " " + level + R"(
              var.set %held, %a
              output 0 %b
              if %some
                %f = filter.levels f32 )" + byte(2) + " " + levels + R"(
                var.set %held, %f
                output 1 %c
              endif
              %got = var.get f32 %held
              %sum = fadd f32 %got, %d
              output 2 %sum
              %other = fadd f32 %e, %w
              output 3 %other
            )", bytes);
            if (HasFailure()) return;
          }
}

// What quads share (of three lanes, all that coarse derivatives look at): arithmetic on derivatives, records that it chooses, conditions and variables that lanes look at.
TEST(JitMemory, valuesOfQuads) {
  for (size_t bytes : {7u, 100u, 4096u})
    agrees(R"(
      %fortyeight = const i32 48
      %three = const i32 3
      %byte = const i32 255
      %one = const f32 0x3f800000
      %scale = const f32 0x3b808081
      %none = const f32 0x0
      %held = var f32
      %w0 = and i32 %data, %byte
      %w1 = stof f32 %w0
      %x = fmul f32 %w1, %scale
      %v0 = and i32 %off, %byte
      %y = stof f32 %v0
      %dx = quad.ddx f32 0 %x
      %dy = quad.ddy f32 0 %y
      %xx = fmul f32 %dx, %dx
      %sum = fma f32 %dy, %dy, %xx
      %length = fsqrt f32 %sum
      %log = flog2 f32 %length
      %low = fmax f32 %log, %none
      %level = ftos i32 %low
      %some3 = and i32 %level, %three
      %record = imul i32 %some3, %fortyeight
      %field = load.const i32 +4 %ubase, %record, %usize
      %both = iadd i32 %field, %level
      %lane = iadd i32 %both, %data
      output 0 %lane
      %floor = ffloor f32 %low
      %rest = fsub f32 %low, %floor
      var.set %held, %rest
      %far = flt mask %one, %rest
      %near = flt mask %rest, %one
      %picked = select f32 %near, %sum, %dx
      %mixed = fadd f32 %picked, %x
      output 1 %mixed
      %between = flt mask %none, %rest
      if %between
        %deep = fmul f32 %length, %x
        var.set %held, %deep
        if %far
          output 2 %field
        endif
      endif
      %got = var.get f32 %held
      output 3 %got
    )", bytes);
}

TEST(JitMemory, loadsOfSomeLanesOnly) {
  agrees(R"(
    if %some
      %a = load i32 +4 %base, %off, %size
      output 0 %a
      %b = load.const f32 %base, %off, %size
      output 1 %b
    else
      %c = load i16 %base, %off64, %size
      output 2 %c
      %d = load.const i64 %base, %off64, %size
      output 3 %d
    endif
  )", 100);
}

// One atomic a program: a chunk of lanes runs all of a routine before the next chunk starts.
TEST(JitMemory, atomicsInLaneOrder) {
  for (const char* operation : {"add", "smin", "smax", "umin", "umax", "and", "or", "xor", "xchg", "ld", "st"})
    for (size_t bytes : {3u, 4u, 11u, 64u}) {
      agrees("%word = const i32 60\n%at = and i32 %off, %word\n%r = atomic i32 " + std::string(operation) + " %ubase, %at, %usize, %data\noutput 0 %r\n", bytes);
      agrees("if %some\n%q = atomic i32 " + std::string(operation) + "+8 %ubase, %zero, %usize, %data\noutput 1 %q\nendif\n", bytes);
      if (HasFailure()) return;
    }
  agrees("%f = utof f32 %data\n%r = atomic f32 fadd %ubase, %zero, %usize, %f\noutput 0 %r\n", 8);
}

// Of one place for all lanes, in every width.
TEST(JitMemory, workGroupMemoryAtOnePlace) {
  if (!jit::available()) GTEST_SKIP();
  const Function f = parsed(R"(
    %zero = const i32 0
    %one = const i32 1
    %fzero = const f64 0x0
    %a = shared.load f16 %zero
    %a1 = ftof f32 %a !keep
    %a2 = bitcast i32 %a1
    %a3 = ieq mask %a2, %zero
    %a4 = select i32 %a3, %zero, %one
    output 0 %a4
    %b = shared.load i8 +8 %zero
    %b1 = sext i32 %b
    output 1 %b1
    %c = shared.load i64 +16 %zero
    %c1 = trunc i32 %c
    output 2 %c1
    %d = shared.load f64 +24 %zero
    %d1 = feq mask %d, %fzero
    %d2 = select i32 %d1, %zero, %one
    output 3 %d2
  )");
  RowRun start(0, 4);
  start.lanes = 128;
  start.shared.resize(64);
  for (size_t k = 0; k < start.shared.size(); k++) start.shared[k] = std::byte(37 * k + 5);
  RowRun want = start;
  want(f);
  inEveryWidth(f, start, [] {}, [&](const RowRun& run, uint32_t width, const std::string& listing) {
    for (unsigned k = 0; k < 4; k++) ASSERT_EQ(std::memcmp(run.outputs[k].bytes, want.outputs[k].bytes, kMaxLanes * 4), 0) << k << ", " << width << listing;
  });
}

}  // namespace
}  // namespace pumice::interp
