// Hostile modules give errors: no crash, no hang, no gigabytes.
#include <gtest/gtest.h>

#include <chrono>
#include <random>

#include "spirv_interp/frontend/module.h"
#include "spirv_interp/frontend/shader.h"
#include "tests/frontend/compile.h"

namespace pumice::frontend {
namespace {

const char* kFragment = R"(#version 450
layout(set=0, binding=0) uniform sampler2D tex[4];
layout(std140, set=0, binding=1) uniform U { mat4 m; vec4 a[8]; } u;
layout(std430, set=1, binding=2) buffer B { int n; vec2 v[]; } b;
layout(location=0) in vec4 c;
layout(location=1) flat in int k;
layout(location=0) out vec4 r;
layout(constant_id=3) const int N = 4;
struct S { float f; vec3 v[2]; };
float g(inout S s, int i) {
  switch (i) { case 0: s.f += 1; case 1: s.v[1].y = 3; break; default: return 2.0; }
  if (s.f > 10.0) discard;
  return s.f;
}
void main() {
  S s = S(c.x, vec3[2](c.xyz, vec3(1)));
  float t = 0;
  for (int i = 0; i < N; i++) { if (i == k) continue; t += g(s, i) * c.y; if (t > 5.0) break; }
  int local[5] = int[](1, 2, 3, 4, 5);
  r = texture(tex[k & 3], c.xy * s.v[k & 1].xy) + u.m * u.a[k] * t + dFdx(c) + float(local[k]);
  b.v[k] = normalize(r.xy);
  atomicAdd(b.n, b.v.length());
})";

std::vector<uint32_t> words() {
  std::string log;
  auto w = test::compileGlsl(test::GlslStage::Fragment, kFragment, &log);
  EXPECT_FALSE(w.empty()) << log;
  return w;
}

//! Translates without the validator before it, so that our own checks have to hold.
bool translateUnchecked(std::span<const uint32_t> w) {
  Module module;
  module.words.assign(w.begin(), w.end());
  if (!module.cut()) return false;
  return translate(module, Stage::Fragment, "main", {}).hasValue();
}

TEST(BadInput, TheModuleItselfIsGood) {
  auto w = words();
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  auto shader = translate(**module, Stage::Fragment, "main", {});
  EXPECT_TRUE(shader.hasValue()) << shader.error().message;
  EXPECT_TRUE(translateUnchecked(w));
}

TEST(BadInput, CutShortAtEveryWord) {
  auto w = words();
  for (size_t n = 0; n < w.size(); n++) {
    std::vector<uint32_t> cut(w.begin(), w.begin() + ptrdiff_t(n));
    EXPECT_FALSE(parseModule(cut).hasValue()) << n << " words";
    EXPECT_FALSE(translateUnchecked(cut)) << n << " words";
  }
}

TEST(BadInput, ForeignEndianness) {
  auto w = words();
  for (uint32_t& word : w) word = __builtin_bswap32(word);
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  EXPECT_TRUE(translate(**module, Stage::Fragment, "main", {}).hasValue());
}

TEST(BadInput, AbsurdIdBound) {
  auto w = words();
  w[3] = 0xffffffff;
  EXPECT_FALSE(parseModule(w).hasValue());
  w[3] = 2;
  EXPECT_FALSE(parseModule(w).hasValue());
}

TEST(BadInput, WrongEntryPointAndStageAreNamed) {
  auto w = words();
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue());
  auto missing = translate(**module, Stage::Fragment, "other", {});
  ASSERT_FALSE(missing.hasValue());
  EXPECT_NE(missing.error().message.find("other"), std::string::npos);
  EXPECT_FALSE(translate(**module, Stage::Vertex, "main", {}).hasValue());
}

void mutate(const std::vector<uint32_t>& original) {
  std::random_device seedSource;
  uint32_t seed = seedSource();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  int rounds = 0, accepted = 0;
  for (; rounds < 20000 && std::chrono::steady_clock::now() < end; rounds++) {
    auto w = original;
    for (uint32_t n = 1 + random() % 3; n > 0; n--) {
      size_t at = 5 + random() % (w.size() - 5);
      switch (random() % 5) {
        case 0: w[at] = random(); break;
        case 1: w[at] = random() % w[3]; break;
        case 2: w[at] ^= 1u << random() % 32; break;
        case 3: w[at] = w[5 + random() % (w.size() - 5)]; break;
        case 4: w[at] += random() % 3 - 1; break;
      }
    }
    accepted += translateUnchecked(w);
    if (rounds % 8 == 0) {
      auto module = parseModule(w);
      if (module) (void)translate(**module, Stage::Fragment, "main", {}).hasValue();
    }
  }
  testing::Test::RecordProperty("rounds", rounds);
  testing::Test::RecordProperty("accepted", accepted);
  EXPECT_GT(rounds, 100);
}

TEST(BadInput, MutatedWords) { mutate(words()); }
TEST(BadInput, MutatedWordsOfAnOptimisedModule) { mutate(test::optimised(words())); }

// Calls that double at each level would give 2^40 copies.
TEST(BadInput, ExponentialInliningEndsInAnError) {
  std::string source = "#version 450\nlayout(location=0) out vec4 r;\nlayout(location=0) in vec4 c;\n"
                       "vec4 f0(vec4 x) { return x * c; }\n";
  for (int i = 1; i < 40; i++) {
    std::string n = std::to_string(i), m = std::to_string(i - 1);
    source += "vec4 f" + n + "(vec4 x) { return f" + m + "(x) + f" + m + "(x.yxzw); }\n";
  }
  source += "void main() { r = f39(c); }\n";
  std::string log;
  auto w = test::compileGlsl(test::GlslStage::Fragment, source, &log);
  ASSERT_FALSE(w.empty()) << log;
  auto module = parseModule(w);
  ASSERT_TRUE(module.hasValue()) << module.error().message;
  auto shader = translate(**module, Stage::Fragment, "main", {});
  ASSERT_FALSE(shader.hasValue());
  EXPECT_NE(shader.error().message.find("too large"), std::string::npos) << shader.error().message;
}

}  // namespace
}  // namespace pumice::frontend
