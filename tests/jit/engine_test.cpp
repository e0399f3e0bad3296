// What the JIT promises besides bits: listings, counters, refusals, code that is never writable and executable at once.
#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "spirv_interp/ir/builder.h"
#include "spirv_interp/jit/jit.h"
#include "tests/interpreter/fixture.h"

namespace pumice::interp {
namespace {

constexpr const char* kScale = "%1 = input f32 0\n%2 = uniform f32 0\n%3 = fmul f32 %1, %2\noutput 0 %3";

TEST(JitEngine, listsWhatItEmits) {
  if (!jit::available()) GTEST_SKIP();
  std::string listing;
  ASSERT_TRUE(jit::compile(parsed(kScale), {}, {.chunkLanes = 16, .listing = &listing}));
  EXPECT_NE(listing.find("vmulps"), std::string::npos) << listing;
}

//! AVX-512 code has more registers, and logic of three operands instead of a blend; AVX2 code has neither. (Whether it gives
//! the same bits is a matter of the other tests, on such a machine.)
TEST(JitEngine, writesForTheInstructionSetItIsTold) {
  if (!jit::available()) GTEST_SKIP();
  std::string text;
  for (int k = 1; k <= 20; k++) text += "%" + std::to_string(k) + " = input f32 " + std::to_string(k - 1) + "\n";
  text += "%21 = flt mask %1, %2\n%22 = select f32 %21, %2, %3\n";
  for (int k = 23; k <= 42; k++) text += "%" + std::to_string(k) + " = fma f32 %" + std::to_string(k - 1) + ", %" + std::to_string(k - 22) + ", %1\n";
  const Function f = parsed(text + "output 0 %42");
  std::string avx2, avx512;
  ASSERT_TRUE(jit::compile(f, {}, {.chunkLanes = 8, .isa = jit::Isa::Avx2, .listing = &avx2}));
  ASSERT_TRUE(jit::compile(f, {}, {.chunkLanes = 8, .isa = jit::Isa::Avx512, .listing = &avx512}));
  EXPECT_EQ(avx2.find("ymm16"), std::string::npos) << avx2;
  EXPECT_EQ(avx2.find("k1"), std::string::npos) << avx2;
  EXPECT_NE(avx2.find("vblendvps"), std::string::npos) << avx2;
  EXPECT_NE(avx512.find("ymm16"), std::string::npos) << avx512;
  EXPECT_NE(avx512.find("vpternlogd"), std::string::npos) << avx512;
  EXPECT_NE(avx512.find("{k1}"), std::string::npos) << avx512;
}

TEST(JitEngine, countsRoutinesAndWhatTheInterpretersKernelsDo) {
  if (!jit::available()) GTEST_SKIP();
  const jit::Statistics before = jit::statistics();
  ASSERT_TRUE(jit::compile(parsed(kScale), {}));
  EXPECT_EQ(jit::statistics().emitted, before.emitted + 1);
  EXPECT_EQ(jit::statistics().callOuts, before.callOuts);
  ASSERT_TRUE(jit::compile(parsed("%1 = input i64 0\n%2 = sdiv i64 %1, %1\noutput 0 %2"), {}));
  EXPECT_EQ(jit::statistics().callOuts, before.callOuts + 1);
}

TEST(JitEngine, refusesWhatNobodyHasAKernelFor) {
  if (!jit::available()) GTEST_SKIP();
  Function f;
  append(f, Op::Output, Type::None, {append(f, Op::HelperMask, Type::Mask, {})}, 0);   // abstract: should have been expanded
  const jit::Statistics before = jit::statistics();
  auto e = jit::compile(f, {});
  ASSERT_FALSE(e);
  EXPECT_NE(e.error().message.find("helper.mask"), std::string::npos) << e.error().message;
  EXPECT_EQ(jit::statistics().refused, before.refused + 1);
}

TEST(JitEngine, codeIsNeverWritableAndExecutable) {
  if (!jit::available()) GTEST_SKIP();
  std::vector<std::unique_ptr<Executable>> keep;
  for (int k = 0; k < 10; k++) keep.push_back(std::move(jit::compile(parsed(kScale), {}).value()));
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) EXPECT_EQ(line.find(" rwx"), std::string::npos) << line;
}

TEST(JitEngine, codeGoesWithItsRoutine) {
  if (!jit::available()) GTEST_SKIP();
  const auto executable = [] {
    unsigned count = 0;
    std::ifstream maps("/proc/self/maps");
    for (std::string line; std::getline(maps, line);) count += line.find(" r-xp") != std::string::npos && line.find('/') == std::string::npos;
    return count;
  };
  const unsigned before = executable();
  for (int k = 0; k < 50; k++) ASSERT_TRUE(jit::compile(parsed(kScale), {}));
  EXPECT_LE(executable(), before);
}

//! The watchdog's flag ends loops that never would, those without and those with masks, and rows that wait.
TEST(JitEngine, leavesEndlessLoopsWhenTold) {
  if (!jit::available()) GTEST_SKIP();
  for (const char* text : {"%1 = var i32\nloop\n%2 = const i32 1\nvar.set %1, %2\nendloop",
                           "%1 = input i32 0\n%2 = const i32 9\n%3 = ult mask %1, %2\nif %3\nloop\nif %3\nelse\nbreak 0\nendif\nendloop\nendif",
                           "loop\n%1 = const i32 0\n%2 = const i32 1\n%3 = shared.atomic i32 add %1, %2\nbarrier\nendloop"}) {
    auto e = jit::compile(parsed(text), {});
    ASSERT_TRUE(e) << e.error().message;
    std::atomic<bool> stop = false;
    std::thread later([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      stop = true;
    });
    Row row;
    const void* in[1] = {row.bytes};
    Table tables[ir::kTableCount] = {};
    std::byte shared[64] = {};
    ExecContext c;
    c.lanes = 100;
    c.active[0] = c.active[1] = ~uint64_t(0);
    c.inputs = in;
    c.tables = tables;
    c.shared = shared;
    c.sharedBytes = sizeof shared;
    c.stop = &stop;
    base::ScopedFpEnv environment;
    const UniformBank bank = (*e)->preamble(tables);
    (*e)->run(bank, c);
    later.join();
    EXPECT_TRUE(stop);
  }
}

//! One routine, one bank, many threads; rows of all lengths, each lane's result its own.
TEST(JitEngine, runsOnManyThreadsAtOnce) {
  if (!jit::available()) GTEST_SKIP();
  auto e = jit::compile(parsed(kScale), {});
  ASSERT_TRUE(e);
  std::vector<std::thread> threads;
  std::atomic<unsigned> wrong = 0;
  for (unsigned t = 0; t < 4; t++)
    threads.emplace_back([&, t] {
      for (uint32_t lanes = 1; lanes <= kMaxLanes; lanes++) {
        const float scale = float(t + 1);
        RowRun run(1, 1);
        run.lanes = lanes;
        for (uint32_t lane = 0; lane < kMaxLanes; lane++) run.inputs[0].set(Type::F32, lane, std::bit_cast<uint32_t>(float(lane)));
        run.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(&scale), sizeof scale};
        run.execute(**e);
        for (uint32_t lane = 0; lane < kMaxLanes; lane++)
          wrong += run.outputs[0].get(Type::F32, lane) != (lane < lanes ? std::bit_cast<uint32_t>(float(lane) * scale) : 0);
      }
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(wrong, 0u);
}

}  // namespace
}  // namespace pumice::interp
