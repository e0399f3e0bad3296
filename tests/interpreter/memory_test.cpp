#include <thread>

#include "fixture.h"

namespace pumice::interp {
namespace {

uint64_t bitsOf(const void* p) { return reinterpret_cast<uint64_t>(p); }

//! Operands base, size come as rows or from the draw constants (8 and 16).
std::string bufferProgram(bool uniform, const char* body) {
  const char* source = uniform ? "%base = uniform i64 0\n%size = uniform i64 8\n" : "%base = input i64 2\n%size = input i64 3\n";
  return std::string("%off = input i32 0\n%v = input i32 1\n") + source + body;
}

struct BufferRun : RowRun {
  uint64_t uniforms[2];
  BufferRun(const void* base, uint64_t size) : RowRun(4, 1), uniforms{bitsOf(base), size} {
    tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), sizeof uniforms};
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      inputs[2].set(Type::I64, lane, bitsOf(base));
      inputs[3].set(Type::I64, lane, size);
    }
  }
};

TEST(Memory, loadsOutOfBoundsGiveZero) {
  alignas(8) uint32_t data[40];
  for (uint32_t i = 0; i < 40; i++) data[i] = 1000 + i;
  for (bool uniform : {false, true})
    for (const Target& target : availableTargets()) {
      BufferRun run(data, 36 * 4 + 2);   // the 37th element is cut in two
      for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::I32, lane, lane == 100 ? 0xfffffffcu : lane * 4);
      run(parsed(bufferProgram(uniform, "%r = load i32 +8 %base, %off, %size\noutput 0 %r\n")), target);
      for (unsigned lane = 0; lane < kMaxLanes; lane++)
        EXPECT_EQ(run.outputs[0].get(Type::I32, lane), lane < 34 ? 1002 + lane : 0u) << uniform << " lane " << lane;
    }
}

TEST(Memory, offsetsOf64BitsDoNotWrap) {
  uint32_t data[4] = {1, 2, 3, 4};
  BufferRun run(data, 16);
  for (unsigned lane = 0; lane < kMaxLanes; lane++)
    run.inputs[1].set(Type::I64, lane, lane == 0 ? 0 : lane == 1 ? ~uint64_t(0) - 3 : lane == 2 ? uint64_t(1) << 32 : 12);
  run(parsed(R"(
    %off = input i64 1
    %base = uniform i64 0
    %size = uniform i64 8
    %r = load i32 +4 %base, %off, %size
    output 0 %r
  )"));
  EXPECT_EQ(run.outputs[0].get(Type::I32, 0), 2u);
  for (unsigned lane = 1; lane < 4; lane++) EXPECT_EQ(run.outputs[0].get(Type::I32, lane), 0u) << lane;
}

TEST(Memory, storesTouchActiveLanesWithinBoundsOnly) {
  for (bool uniform : {false, true})
    for (const Target& target : availableTargets()) {
      uint32_t data[kMaxLanes] = {};
      BufferRun run(data, 100 * 4);
      run.active[0] = 0xaaaaaaaaaaaaaaaau;
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        run.inputs[0].set(Type::I32, lane, lane * 4);
        run.inputs[1].set(Type::I32, lane, lane + 1);
      }
      run(parsed(bufferProgram(uniform, "store %base, %off, %size, %v\n")), target);
      for (unsigned i = 0; i < kMaxLanes; i++) EXPECT_EQ(data[i], i < 100 && (i >= 64 || i % 2) ? i + 1 : 0u) << i;
    }
}

TEST(Memory, nullBuffersReadZeroAndIgnoreWrites) {
  BufferRun run(nullptr, 1000);
  run.outputs[0].set(Type::I32, 0, 7);
  run(parsed(bufferProgram(true, "store %base, %off, %size, %v\n%r = load i32 %base, %off, %size\noutput 0 %r\n")));
  EXPECT_EQ(run.outputs[0].get(Type::I32, 0), 0u);
}

TEST(Memory, everyTypeLoadsAndStoresItsWidth) {
  for (const char* type : {"i8", "i16", "i32", "i64", "f16", "f32", "f64"}) {
    uint8_t data[32];
    for (unsigned i = 0; i < 32; i++) data[i] = uint8_t(i * 7);
    BufferRun run(data, sizeof data);
    run.lanes = 1;
    const std::string t = type;
    run(parsed("%z = const i32 0\n%base = uniform i64 0\n%size = uniform i64 8\n%r = load " + t + " +3 %base, %z, %size\nstore +16 %base, %z, %size, %r\n"));
    const unsigned bytes = t == "i8" ? 1 : t[1] == '1' ? 2 : t[1] == '3' ? 4 : 8;
    for (unsigned i = 0; i < 16; i++) EXPECT_EQ(data[16 + i], uint8_t((i < bytes ? 3 + i : 16 + i) * 7)) << type << " byte " << i;
  }
}

TEST(Memory, atomicsRunInLaneOrderAndGiveOldValues) {
  struct Case {
    const char* name;
    uint32_t start;
    uint32_t (*f)(uint32_t, uint32_t);
  };
  const Case cases[] = {
      {"add", 5, [](uint32_t o, uint32_t v) { return o + v; }},
      {"smin", 3, [](uint32_t o, uint32_t v) { return int32_t(o) < int32_t(v) ? o : v; }},
      {"smax", 3, [](uint32_t o, uint32_t v) { return int32_t(o) < int32_t(v) ? v : o; }},
      {"umin", 6, [](uint32_t o, uint32_t v) { return o < v ? o : v; }},
      {"umax", 6, [](uint32_t o, uint32_t v) { return o < v ? v : o; }},
      {"and", ~0u, [](uint32_t o, uint32_t v) { return o & v; }},
      {"or", 1, [](uint32_t o, uint32_t v) { return o | v; }},
      {"xor", 1, [](uint32_t o, uint32_t v) { return o ^ v; }},
      {"xchg", 1, [](uint32_t, uint32_t v) { return v; }},
  };
  for (const Case& c : cases)
    for (bool shared : {false, true}) {
      uint32_t data[2] = {c.start, 9};
      BufferRun run(data, 8);
      run.lanes = 10;
      run.shared.resize(8);
      std::memcpy(run.shared.data(), data, 8);
      for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[1].set(Type::I32, lane, lane * 0x40000001u + 2);
      const std::string name = c.name;
      run(parsed(bufferProgram(true, (shared ? "%r = shared.atomic i32 " + name + " %off, %v\noutput 0 %r\n"
                                             : "%r = atomic i32 " + name + " %base, %off, %size, %v\noutput 0 %r\n").c_str())));
      uint32_t now = c.start;
      for (uint32_t lane = 0; lane < 10; lane++) {
        EXPECT_EQ(run.outputs[0].get(Type::I32, lane), now) << name;
        now = c.f(now, lane * 0x40000001u + 2);
      }
      if (shared) std::memcpy(data, run.shared.data(), 8);
      EXPECT_EQ(data[0], now) << name;
      EXPECT_EQ(data[1], 9u);
    }
}

TEST(Memory, compareAndSwapTakesTheFirstLaneThatMatches) {
  uint32_t data[1] = {4};
  BufferRun run(data, 4);
  run.lanes = 8;
  for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[1].set(Type::I32, lane, 100 + lane);
  run(parsed(bufferProgram(true, "%four = const i32 4\n%r = atomic.cas i32 %base, %off, %size, %v, %four\noutput 0 %r\n")));
  EXPECT_EQ(data[0], 100u);
  for (unsigned lane = 0; lane < 8; lane++) EXPECT_EQ(run.outputs[0].get(Type::I32, lane), lane ? 100u : 4u);
}

TEST(Memory, atomicsOfManyThreadsLoseNothing) {
  uint32_t counter[1] = {0};
  auto compiled = compileInterpreter(parsed(bufferProgram(true, "%one = const i32 1\n%r = atomic i32 add %base, %off, %size, %one\n")), {});
  ASSERT_TRUE(compiled);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; t++)
    threads.emplace_back([&] {
      for (int i = 0; i < 50; i++) {
        BufferRun run(counter, 4);
        run.execute(**compiled);
      }
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(counter[0], 4u * 50 * kMaxLanes);
}

TEST(Memory, tablesAreBoundedByTheirSize) {
  const uint32_t data[4] = {10, 11, 12, 13};
  RowRun run(1, 2);
  run.tables[ir::kTablePush] = {reinterpret_cast<const std::byte*>(data), sizeof data};
  for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::I32, lane, lane * 4);
  run(parsed("%o = input i32 0\n%r = table.load i32 push+4 %o\noutput 0 %r\n%z = const i32 14\n%u = table.load i32 push+0 %z\noutput 1 %u\n"));
  for (unsigned lane = 0; lane < kMaxLanes; lane++) {
    EXPECT_EQ(run.outputs[0].get(Type::I32, lane), lane < 3 ? 11 + lane : 0u);
    EXPECT_EQ(run.outputs[1].get(Type::I32, lane), 0u);
  }
}

TEST(Memory, localMemoryIsEachLanesOwnAndStartsAtZero) {
  const Function f = parsed(R"(
    %o = input i32 0
    %v = input i32 1
    %a = local.alloc i32 64
    %b = local.alloc i32 8
    %z = const i32 0
    %r0 = local.load i32 +4 %a, %o
    output 0 %r0
    local.store +4 %a, %o, %v
    local.store %b, %z, %v
    %r1 = local.load i32 +4 %a, %o
    output 1 %r1
    %r2 = local.load i8 +1 %b, %z
    %r3 = zext i32 %r2
    output 2 %r3
    %w = local.load i64 %b, %z
    output 3 %w
  )");
  for (int round = 0; round < 2; round++) {
    RowRun run(2, 4);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      run.inputs[0].set(Type::I32, lane, lane % 32 * 4);
      run.inputs[1].set(Type::I32, lane, 0x01010101u * lane);
    }
    run(f);
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      EXPECT_EQ(run.outputs[0].get(Type::I32, lane), 0u);
      EXPECT_EQ(run.outputs[1].get(Type::I32, lane), lane % 32 < 15 ? 0x01010101u * lane : 0u) << lane;
      EXPECT_EQ(run.outputs[2].get(Type::I32, lane), lane);
      EXPECT_EQ(run.outputs[3].get(Type::I64, lane), 0x01010101u * lane);
    }
  }
}

TEST(Memory, quadRecordsReachTheirFourLanes) {
  struct Record { float x, y; } records[3] = {{1, 2}, {3, 4}, {5, 6}};
  RowRun run(0, 1);
  run.lanes = 12;
  for (const Record& r : records) run.quads.push_back(reinterpret_cast<const std::byte*>(&r));
  run(parsed("%1 = quad.load f32 4\noutput 0 %1\n"));
  for (unsigned lane = 0; lane < 12; lane++)
    EXPECT_EQ(run.outputs[0].get(Type::F32, lane), std::bit_cast<uint32_t>(records[lane / 4].y));
}

TEST(Memory, tilesAreReadAndWrittenPixelByPixel) {
  // Plane 0: 4-byte elements; plane 1: 8-byte elements of which bytes 2 and 3 are stored.
  for (const Target& target : availableTargets()) {
    uint32_t colours[64];
    uint16_t fat[64][4] = {};
    for (uint32_t i = 0; i < 64; i++) colours[i] = i;
    const uint32_t quadElement[4] = {8, 0, 60, 16};
    RowRun run(0, 1);
    run.lanes = 16;
    run.active[0] = 0xf35f;   // whole, partial and whole quads
    run.planes = {{reinterpret_cast<std::byte*>(colours), quadElement}, {reinterpret_cast<std::byte*>(fat), quadElement}};
    Function f;
    const Value c = append(f, Op::TileLoad, Type::I32, {}, uint64_t(0) << 32 | 4 << 16);
    append(f, Op::Output, Type::None, {c}, 0);
    const Value k = append(f, Op::Const, Type::I32, {}, 1000);
    const Value sum = append(f, Op::IAdd, Type::I32, {c, k});
    append(f, Op::TileStore, Type::None, {sum}, uint64_t(0) << 32 | 4 << 16);
    const Value half = append(f, Op::Trunc, Type::I16, {sum});
    append(f, Op::TileStore, Type::None, {half}, uint64_t(1) << 32 | 8 << 16 | 2);
    ASSERT_EQ(ir::verify(f), "");
    run(f, target);
    std::vector<bool> written(64);
    for (unsigned lane = 0; lane < 16; lane++) {
      if (!(run.active[0] >> lane & 1)) continue;
      const uint32_t e = quadElement[lane / 4] + lane % 4;
      EXPECT_EQ(run.outputs[0].get(Type::I32, lane), e);
      written[e] = true;
    }
    for (uint32_t e = 0; e < 64; e++) {
      EXPECT_EQ(colours[e], written[e] ? e + 1000 : e) << e;
      EXPECT_EQ(fat[e][1], written[e] ? e + 1000 : 0u) << e;
      EXPECT_EQ(fat[e][0] | fat[e][2] | fat[e][3], 0u);
    }
  }
}

TEST(Memory, derivativesAndSwizzlesStayInTheirQuad) {
  for (const Target& target : availableTargets()) {
    RowRun run(1, 6);
    auto x = [](unsigned lane) { return float((lane * 7919u) % 1013u) * 0.25f; };
    for (unsigned lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::F32, lane, std::bit_cast<uint32_t>(x(lane)));
    run.lanes = 124;
    Function f;
    const Value in = append(f, Op::Input, Type::F32, {}, 0);
    for (uint64_t i = 0; i < 4; i++) {
      const Value d = append(f, i < 2 ? Op::QuadDdx : Op::QuadDdy, Type::F32, {in}, i & 1);
      append(f, Op::Output, Type::None, {d}, i);
    }
    const Value s = append(f, Op::QuadSwizzle, Type::F32, {in}, 0b00'11'10'01);
    append(f, Op::Output, Type::None, {s}, 4);
    const Value h = append(f, Op::FToF, Type::F16, {in});
    const Value dh = append(f, Op::QuadDdx, Type::F16, {h}, 0);
    const Value wide = append(f, Op::FToF, Type::F32, {dh});
    append(f, Op::Output, Type::None, {wide}, 5);
    ASSERT_EQ(ir::verify(f), "");
    run(f, target);
    for (unsigned lane = 0; lane < 124; lane++) {
      const unsigned q = lane & ~3u;
      auto out = [&](unsigned k) { return std::bit_cast<float>(uint32_t(run.outputs[k].get(Type::F32, lane))); };
      EXPECT_EQ(out(0), x(q + 1) - x(q));
      EXPECT_EQ(out(1), lane & 2 ? x(q + 3) - x(q + 2) : x(q + 1) - x(q));
      EXPECT_EQ(out(2), x(q + 2) - x(q));
      EXPECT_EQ(out(3), lane & 1 ? x(q + 3) - x(q + 1) : x(q + 2) - x(q));
      EXPECT_EQ(out(4), x(q + (lane + 1) % 4));
      EXPECT_EQ(out(5), x(q + 1) - x(q));
    }
  }
}

//! Offsets of neighbours, of one place, scattered, at the end of the range and beyond it: whatever way a kernel takes,
//! every lane must see the same.
TEST(Memory, everyShapeOfOffsetsMeansTheSame) {
  Random r(21);
  for (int round = 0; round < 400; round++) {
    const Type t = kDataTypes[r.below(std::size(kDataTypes))];
    const uint32_t bytes = ir::typeBytes(t), constant = r.chance(50) ? 0 : r.below(40);
    std::vector<std::byte> memory(64 + r.below(2000));
    for (std::byte& b : memory) b = std::byte(r.next());
    RowRun start(3, 4);
    start.lanes = r.chance(50) ? kMaxLanes : 1 + r.below(kMaxLanes);
    if (r.chance(40)) start.active[0] = r.next(), start.active[1] = r.next();
    const uint32_t shape = r.below(5), first = r.chance(20) ? uint32_t(-int32_t(r.below(600))) : r.below(uint32_t(memory.size()));
    uint32_t offsets[kMaxLanes];
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      offsets[lane] = shape == 0 ? first : shape == 1 ? first + lane * bytes : shape == 2 ? r.below(uint32_t(memory.size()) - 48) : shape == 3 ? lane * bytes : uint32_t(r.next());
      if (shape == 1 && r.chance(1)) offsets[lane] += 4;
      start.inputs[0].set(Type::I32, lane, offsets[lane]);
      start.inputs[1].set(t, lane, r.next() & ir::allOnes(t));
      start.inputs[2].set(Type::I32, lane, shape == 0 ? first % 64 : offsets[lane] % 70);
    }
    const uint64_t uniforms[2] = {uint64_t(memory.data()), memory.size()};
    start.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), 16};
    start.tables[ir::kTableSet0] = {memory.data(), memory.size()};

    Function f;
    const Value base = append(f, Op::UniformInput, Type::I64, {}, 0), size = append(f, Op::UniformInput, Type::I64, {}, 8);
    const Value offset = append(f, Op::Input, Type::I32, {}, 0), value = append(f, Op::Input, t, {}, 1), near = append(f, Op::Input, Type::I32, {}, 2);
    append(f, Op::Output, Type::None, {append(f, Op::Load, t, {base, offset, size}, constant)}, 0);
    append(f, Op::Output, Type::None, {append(f, Op::TableLoad, t, {offset}, uint64_t(ir::kTableSet0) << 32 | constant)}, 1);
    append(f, Op::Output, Type::None, {append(f, Op::SharedLoad, t, {offset}, constant)}, 2);
    const Value array = append(f, Op::LocalAlloc, Type::I32, {}, 60);
    append(f, Op::LocalStore, Type::None, {array, near, value}, constant);
    append(f, Op::Output, Type::None, {append(f, Op::LocalLoad, t, {array, near}, constant)}, 3);
    append(f, Op::Store, Type::None, {base, offset, size, value}, constant);
    append(f, Op::SharedStore, Type::None, {offset, value}, constant);
    ASSERT_EQ(ir::verify(f), "");

    const std::vector<std::byte> before = memory;
    std::vector<std::byte> after = before;
    for (const Target& target : availableTargets()) {
      memory = before;
      RowRun run = start;
      run.shared = before;
      run(f, target);
      after = before;
      for (uint32_t lane = 0; lane < run.lanes; lane++) {
        if (!(run.active[lane / 64] >> (lane % 64) & 1)) continue;
        const uint64_t at = uint64_t(offsets[lane]) + constant;
        uint64_t want = 0;
        if (at + bytes <= before.size()) {
          std::memcpy(&want, &before[at], bytes);
          const uint64_t v = run.inputs[1].get(t, lane);
          std::memcpy(&after[at], &v, bytes);
        }
        for (unsigned k = 0; k < 3; k++) ASSERT_EQ(run.outputs[k].get(t, lane), want) << target.name << " round " << round << " lane " << lane << " output " << k;
        const uint64_t in = run.inputs[2].get(Type::I32, lane) + constant;
        ASSERT_EQ(run.outputs[3].get(t, lane), in + bytes <= 60 ? run.inputs[1].get(t, lane) : 0) << target.name << " round " << round << " lane " << lane;
      }
      ASSERT_TRUE(memory == after) << target.name << " round " << round;
      ASSERT_TRUE(run.shared == after) << target.name << " round " << round;
    }
  }
}

}  // namespace
}  // namespace pumice::interp
