// Decision mismatches between a run in f32 and one in double: scenes with a known number of them, and with none.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

#include "base/log.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

constexpr uint32_t kSize = 64;
const std::string kHead = "#version 450\nlayout(location = 0) in vec4 color;\nlayout(location = 0) out vec4 target;\n";

//! A triangle that covers the picture from column `from` on.
struct Shaders {
  std::string vertex = kColorVertex, fragment = kColorFragment;
  float from = 0;
};

DecisionRecord record(const Shaders& run, ir::Numerics numerics, unsigned threads = 1) {
  Scene s(kSize, kSize, VK_FORMAT_D32_SFLOAT, threads);
  GraphicsState state = s.state();
  state.numerics = numerics;
  state.decisions = true;
  auto d = s.drawState(s.pipeline(state, run.vertex, run.fragment));
  s.begin();
  s.draw(d, triangle(s, {run.from, -100, 1000, 32, run.from, 164}, 0.5f, {0.25f, 0.5f, 0.75f, 1}));
  s.end();
  EXPECT_FALSE(s.executor.decisions().words.empty());
  return s.executor.decisions();
}

uint64_t mismatches(const Shaders& run) {
  const DecisionRecord usual = record(run, ir::Numerics::F32);
  EXPECT_EQ(decisionMismatches(usual, record(run, ir::Numerics::F32, 2)), 0u) << "threads change what is decided";
  return decisionMismatches(usual, record(run, ir::Numerics::Oracle));
}

// In f32 2^24 + x loses the last bit of x: in odd columns.
const std::string kRounded = "float x = gl_FragCoord.x - 0.5; float there = x + 16777216.0; float back = there - 16777216.0;\n";

TEST(Decisions, NoneWhereOnlyColoursDiffer) {
  EXPECT_EQ(mismatches({}), 0u);
  // Errors of rounding in every pixel, but no decision.
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { " + kRounded + "target = vec4(back * 0.01, sqrt(color.yz), 1); }"}), 0u);
  // Decisions that do not hang by a rounding.
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { float v = 0; for (int i = 0; i < int(gl_FragCoord.x); ++i) v += sin(float(i)); if (v > 0.777) discard; target = vec4(floor(v), v, 0, 1); }"}), 0u);
}

TEST(Decisions, BranchesCount) {
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { " + kRounded + "if (back == x) target = color; else target = color.bgra; }"}), kSize * kSize / 2);
  // The turns of a loop: 3 becomes 4, which needs one more; 1 becomes 0, which does not.
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { " + kRounded + "float v = 0; while (v < back * 0.25 + 0.2) v += 1; target = vec4(v, 0, 0, 1); }"}), kSize * kSize / 4);
}

TEST(Decisions, WholeNumbersCount) {
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { " + kRounded + "target = vec4(float(int(back)), 0, 0, 1); }"}), kSize * kSize / 2);
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { " + kRounded + "target = vec4(floor(back), 0, 0, 1); }"}), kSize * kSize / 2);
  EXPECT_EQ(mismatches({.fragment = kHead + "void main() { " + kRounded + "target = vec4(floor(back * 0.5 + 0.1), 0, 0, 1); }"}), kSize * kSize / 4)
      << "3 becomes 4, with a half of 2; the half of 1 is 0 as that of 0";
}

// A triangle that starts at column 42 in double and, by rounding to halves in clip space, at column 48 in f32.
TEST(Decisions, CoverageCounts) {
  Shaders run{.vertex = R"(#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 outColor;
void main() { float there = position.x + 4194304.0; gl_Position = vec4(there - 4194304.0, position.yzw); outColor = color; })",
          .from = 42};
  EXPECT_EQ(mismatches(run), 6 * kSize);
}

// What is painted over no longer counts; what is blended over does.
TEST(Decisions, PaintedOver) {
  const std::string decides = kHead + "void main() { " + kRounded + "if (back == x) target = color; else target = color.bgra; }";
  for (bool blended : {false, true}) {
    DecisionRecord records[2];
    for (int i = 0; i < 2; ++i) {
      Scene s(kSize, kSize);
      GraphicsState state = s.state();
      state.numerics = i ? ir::Numerics::Oracle : ir::Numerics::F32;
      state.decisions = true;
      const auto below = s.drawState(s.pipeline(state, kColorVertex, decides));
      if (blended) {
        state.blend[0].blendEnable = true;
        state.blend[0].srcColorBlendFactor = state.blend[0].dstColorBlendFactor = VK_BLEND_FACTOR_ONE;
      }
      const auto above = s.drawState(s.pipeline(state));
      s.begin();
      s.draw(below, rectangle(s, 0, 0, kSize, kSize, 0.5f, {1, 0, 0, 1}));
      s.draw(above, rectangle(s, 0, 0, kSize, kSize / 2, 0.5f, {0, 1, 0, 1}));
      s.end();
      records[i] = s.executor.decisions();
    }
    EXPECT_EQ(decisionMismatches(records[0], records[1]), blended ? kSize * kSize / 2 : kSize * kSize / 4);
  }
}

TEST(Decisions, SamplesCountAsTheirPixel) {
  Shaders run{.fragment = kHead + "void main() { " + kRounded + "if (back == x) target = color; else target = color.bgra; }"};
  DecisionRecord records[2];
  for (int i = 0; i < 2; ++i) {
    Scene s(kSize, kSize);
    s.color = Image(VK_FORMAT_R8G8B8A8_UNORM, kSize, kSize, 1, 16);
    GraphicsState state = s.state();
    state.numerics = i ? ir::Numerics::Oracle : ir::Numerics::F32;
    state.decisions = true;
    state.samples = 16;
    auto d = s.drawState(s.pipeline(state, run.vertex, run.fragment));
    s.begin();
    s.draw(d, rectangle(s, 0, 0, kSize, kSize, 0.5f, {1, 0, 0, 1}));
    s.end();
    records[i] = s.executor.decisions();
  }
  EXPECT_EQ(records[0].words.size(), size_t(kSize) * kSize * 16);
  EXPECT_EQ(decisionMismatches(records[0], records[1]), kSize * kSize / 2);
}

// The file of one run, and the count of another against it.
TEST(Decisions, AreKeptInAFileAndCompared) {
  const std::string path = testing::TempDir() + "/pumice_decisions_test";
  const Shaders run{.fragment = kHead + "void main() { " + kRounded + "if (back == x) target = color; else target = color.bgra; }"};
  setenv("PUMICE_DECISIONS", ("write:" + path).c_str(), 1);
  record(run, ir::Numerics::F32);
  setenv("PUMICE_DECISIONS", ("compare:" + path).c_str(), 1);
  testing::internal::CaptureStderr();
  record(run, ir::Numerics::Oracle);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "pumice: decisions: pass 64x64: 2048 of 4096 pixels decided otherwise\n");
  std::string said;
  {
    base::ScopedLogSink sink([&](base::LogLevel, std::string_view text) { said += text; });
    record(run, ir::Numerics::Oracle);   // the file has one pass only
  }
  EXPECT_NE(said.find("the file's next pass is not this one"), std::string::npos) << said;
  unsetenv("PUMICE_DECISIONS");
  std::remove(path.c_str());
}

}  // namespace
}  // namespace pumice::pipeline::test
