// Control flow, functions, arrays: the same text is compiled as C++ and as GLSL, and must give the same numbers
// for every lane, with lanes that go different ways.
#include <gtest/gtest.h>

#include <cstdlib>

#include "spirv_interp/frontend/shader.h"
#include "tests/frontend/compile.h"
#include "tests/frontend/run.h"

namespace pumice::frontend {
namespace {

std::shared_ptr<const Shader> translated(const std::string& glsl, bool oldSpirv,
                                         test::GlslStage stage = test::GlslStage::Vertex, bool optimise = false) {
  std::string log;
  auto words = test::compileGlsl(stage, glsl, &log, oldSpirv);
  EXPECT_FALSE(words.empty()) << log;
  if (!words.empty() && optimise) {
    words = test::optimised(words);
    EXPECT_FALSE(words.empty()) << "spirv-opt failed";
  }
  if (words.empty()) return nullptr;
  auto module = parseModule(words);
  EXPECT_TRUE(module.hasValue()) << (module ? "" : module.error().message);
  if (!module) return nullptr;
  auto shader = translate(**module, stage == test::GlslStage::Vertex ? Stage::Vertex : Stage::Fragment, "main", {});
  EXPECT_TRUE(shader.hasValue()) << (shader ? "" : shader.error().message);
  if (!shader) return nullptr;
  return *shader;
}

void compare(const std::string& code, int (*expected)(int, int)) {
  std::string glsl = "#version 450\nlayout(location=0) in ivec2 a;\nlayout(location=0) flat out int r;\n" + code +
                     "\nvoid main() { r = f(a.x, a.y); gl_Position = vec4(0); }\n";
  for (int variant = 0; variant < 3; variant++) {
    SCOPED_TRACE("variant " + std::to_string(variant));
    auto shader = translated(glsl, variant == 1, test::GlslStage::Vertex, variant == 2);
    if (!shader) return;
    std::vector<std::vector<uint32_t>> inputs;
    for (int x = -3; x < 9; x++)
      for (int y = -2; y < 6; y++) inputs.push_back({uint32_t(x), uint32_t(y)});
    auto result = test::run(*shader, inputs);
    ASSERT_EQ(result.error, "");
    for (size_t i = 0; i < inputs.size(); i++) {
      int x = int(inputs[i][0]), y = int(inputs[i][1]);
      EXPECT_EQ(int(result.outputs[i][0]), expected(x, y)) << "f(" << x << ", " << y << ")";
      if (testing::Test::HasFailure()) break;
    }
  }
}

#define SAME(Name, ...)                                       \
  namespace in_cpp_##Name { __VA_ARGS__ }                     \
  TEST(Execute, Name) { compare(#__VA_ARGS__, in_cpp_##Name::f); }

SAME(Selection, int f(int x, int y) {
  int r = 1;
  if (x > y) r = x * 10;
  if (x < 0) { r += 5; } else if (y < 0) { r -= 3; } else { if (x == y) r = 77; r++; }
  return r;
})

SAME(LoopWithBreaksAndContinues, int f(int x, int y) {
  int sum = 0;
  for (int i = 0; i < 10; i++) {
    if (i == x) continue;
    if (i > y + 4) break;
    for (int j = 0; j < 5; j++) {
      if (j == y) break;
      if ((i + j) % 3 == 0) continue;
      if (sum > 60) break;
      sum += i * j + 1;
    }
    if (sum > 100) break;
    sum += 2;
  }
  return sum;
})

SAME(WhileAndDo, int f(int x, int y) {
  int n = 0;
  int k = x;
  while (k < 6) { k += 2; n++; if (n == y) break; }
  do { n += k; k--; if (k == 3) continue; n++; } while (k > y);
  return n * 100 + k;
})

SAME(EarlyReturn, int g(int x, int y) {
  for (int i = 0; i < 6; i++) {
    if (i * i > x + 5) return i;
    for (int j = 0; j < 6; j++) if (i + j == y + 7) return 100 + j;
  }
  if (x > 3) return -1;
  return -2;
}
int f(int x, int y) { int a = g(x, y); if (a < 0) return a * 3 + g(y, x); return a + g(y, y); })

SAME(SwitchFallThrough, int f(int x, int y) {
  int r = 0;
  switch (x) {
    case 0: r = 1;
    case 1: r += 10; break;
    case 2: case 3: r = 5; if (y > 2) break; r = 6;
    default: r += 1000; break;
    case 4: return 4444;
    case 5: r = 50;
    case 6: r += y;
  }
  return r;
})

SAME(SwitchDefaultFallsIntoCase, int f(int x, int y) {
  int r = y;
  switch (x) {
    case 1: r += 1; break;
    default: r += 10;
    case 3: r += 100; break;
    case 5: break;
  }
  return r;
})

// Nothing but the declared merge block leads from the loop to the case behind it.
SAME(SwitchCaseBehindLoopsWithoutEnd, int f(int x, int y) {
  int r = y;
  switch (x) {
    case 1: for (;;) { r += 2; if (r > 20) return r; }
    case 0: r = r * 3; break;
    case 3: for (;;) { r += 7; if (r > 9) return r + 100; for (;;) { if (r++ > 5) return -r; } }
    default: r += 1000;
  }
  return r;
})

SAME(SwitchInLoop, int f(int x, int y) {
  int r = 0;
  for (int i = 0; i < 8; i++) {
    switch ((i + x) & 3) {
      case 0: continue;
      case 1: r += i; break;
      case 2: if (y == i) return r; r += 2; break;
    }
    r = r * 3 & 1023;
  }
  return r;
})

SAME(ValueUsedAfterLoop, int f(int x, int y) {
  int last = 0;
  int i = 0;
  while (true) {
    int next = last * 3 + y;
    if (next > 50 || i > x + 3) { last = next - i; break; }
    last = next;
    i++;
  }
  return last + i;
})

SAME(DynamicArray, int f(int x, int y) {
  int a[7];
  for (int i = 0; i < 7; i++) a[i] = i * i + x;
  a[(x + 8) % 7] = 1000;
  int s = 0;
  for (int i = 6; i >= 0; i--) s = s * 2 + a[(i + y + 7) % 7];
  return s & 65535;
})

SAME(NestedCallsInLoops, int h(int k) { int s = 0; for (int i = 0; i < k; i++) { if (i == 3) return s; s += i + 1; } return -s; }
int g(int k) { return k > 2 ? h(k) * 2 : h(k + 2); }
int f(int x, int y) { int s = 0; for (int i = 0; i < 4; i++) { s += g(i + y) ^ h(x); if (s > 40) break; } return s; })

SAME(ShortCircuit, int f(int x, int y) {
  int n = 0;
  bool b = x > 2 && (y > 1 || x == 5);
  bool c = x < 0 || (y == 3 && !b);
  if (b && c) n = 1;
  if (b || c) n += 2;
  if (b != c) n += 4;
  return (x == 1 ? n + 100 : y == 2 ? n + 200 : n);
})

SAME(IntegerArithmetic, int f(int x, int y) {
  int d = y == 0 ? 3 : y;
  int m = (x + 20) % (d < 0 ? -d : d);
  int s = (x << 3) ^ (x >> 1) | (y & 5);
  return m * 1000 + s + x / (d < 0 ? -d : d) + ~y;
})

TEST(Execute, InOutParametersAndStructures) {
  auto shader = translated(R"(#version 450
layout(location=0) in ivec2 a;
layout(location=0) flat out ivec4 r;
struct S { int a; ivec3 b[2]; bool c; };
void change(inout S s, in int i, out int q) { s.b[1].y += i; s.a = s.b[0].x; s.c = !s.c; q = i * 2; }
void bump(inout int x) { x += 5; }
void main() {
  S s = S(1, ivec3[2](ivec3(a.x, 2, 3), ivec3(4, a.y, 6)), false);
  int q;
  change(s, a.x, q);
  bump(s.b[1].z);
  r = ivec4(s.b[1].y, s.a, s.c ? q : -1, s.b[1].z);
})", false);
  ASSERT_TRUE(shader);
  auto result = test::run(*shader, {{3, 10}, {5, 20}});
  ASSERT_EQ(result.error, "");
  for (int lane = 0; lane < 2; lane++) {
    uint32_t x = lane ? 5 : 3, y = lane ? 20 : 10;
    std::vector<uint32_t> expected{x + y, x, 2 * x, 11};
    result.outputs[size_t(lane)].resize(4);
    EXPECT_EQ(result.outputs[size_t(lane)], expected);
  }
}

TEST(Execute, UniformBlockLayouts) {
  auto shader = translated(R"(#version 450
layout(location=0) in ivec2 a;
layout(location=0) out vec4 r;
layout(std140, binding=0) uniform U {
  float f;                          // 0
  layout(row_major) mat2x3 m;       // 16: three rows of 16 bytes
  vec3 v[3];                        // 64
  layout(column_major) mat3 n;      // 112
} u;
void main() {
  int i = a.x;
  r = vec4(u.m[i].z, u.v[i].y, u.n[i][a.y], u.f + u.m[1].y);
})", false);
  ASSERT_TRUE(shader);
  std::vector<uint32_t> buffer;
  for (int i = 0; i < 48; i++) buffer.push_back(std::bit_cast<uint32_t>(float(i)));
  auto result = test::run(*shader, {{0, 0}, {1, 2}}, &buffer);
  ASSERT_EQ(result.error, "");
  for (uint32_t i = 0; i < 2; i++) {
    uint32_t y = i ? 2 : 0;
    // m[i].z is row 2, column i; m[1].y row 1, column 1
    std::vector<float> expected{float(4 + 2 * 4 + i), float(16 + i * 4 + 1), float(28 + i * 4 + y), float(4 + 4 + 1)};
    for (int c = 0; c < 4; c++)
      EXPECT_EQ(std::bit_cast<float>(result.outputs[i][size_t(c)]), expected[size_t(c)]) << "lane " << i << " component " << c;
  }
}

TEST(Execute, StorageBufferAndPushConstants) {
  for (bool oldSpirv : {false, true}) {
    auto shader = translated(R"(#version 450
layout(location=0) in ivec2 a;
layout(location=0) flat out ivec2 r;
layout(std430, binding=0) buffer B { int n; int pad; ivec2 v[]; } b;
layout(push_constant) uniform P { ivec4 p[2]; int q; } p;
void main() {
  b.v[a.x].y = p.p[a.y & 1].z + p.q;
  r = ivec2(b.v.length(), b.v[a.x].y + b.n);
})", oldSpirv);
    ASSERT_TRUE(shader);
    EXPECT_TRUE(shader->writesMemory);
    EXPECT_FALSE(shader->resources[0].readOnly);
    std::vector<uint32_t> buffer(2 + 2 * 5, 7), push{0, 1, 2, 3, 4, 5, 6, 7, 100};
    auto result = test::run(*shader, {{0, 0}, {3, 1}, {9, 1}}, &buffer, push);
    ASSERT_EQ(result.error, "");
    EXPECT_EQ(result.outputs[0][0], 5u);
    EXPECT_EQ(result.outputs[0][1], 109u);
    EXPECT_EQ(result.outputs[1][1], 113u);
    EXPECT_EQ(result.outputs[2][1], 7u) << "out of bounds reads zero";
    EXPECT_EQ(buffer[2 + 1], 102u);
    EXPECT_EQ(buffer[2 + 3 * 2 + 1], 106u);
  }
}

TEST(Execute, DiscardEndsTheInvocation) {
  auto shader = translated(R"(#version 450
layout(location=0) flat in ivec2 a;
layout(location=0) out ivec2 r;
int g(int n) { for (int i = 0; ; i++) { if (i == n) discard; if (i > 4) return i; } return 0; }
void main() { r = ivec2(1); if (a.y == 1) return; r.y = g(a.x); }
)", true, test::GlslStage::Fragment);
  ASSERT_TRUE(shader);
  EXPECT_TRUE(shader->mayDiscard);
  auto result = test::run(*shader, {{2, 0}, {9, 0}, {2, 1}});
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.discarded, (std::vector<bool>{true, false, false}));
  EXPECT_EQ(result.outputs[1][1], 5u);
  EXPECT_EQ(result.outputs[2][1], 1u);
}

TEST(Execute, GlslFunctions) {
  auto shader = translated(R"(#version 450
layout(location=0) in vec4 a;
layout(location=0) out vec4 r[4];
void main() {
  int e; float w;
  float m = frexp(a.x, e);
  float fr = modf(a.y, w);
  r[0] = vec4(m, float(e), fr, w);
  uint p = packUnorm4x8(vec4(0.0, 0.5, 1.0, 2.0));
  r[1] = vec4(uintBitsToFloat(p), ldexp(a.x, 3), float(findMSB(int(a.z))), float(findLSB(int(a.z))));
  mat3 q = inverse(mat3(2, 0, 0, 0, 4, 0, 1, 0, 8));
  r[2] = vec4(q[0][0], q[1][1], q[2][0], determinant(mat4(2)));
  r[3] = vec4(smoothstep(0.0, 2.0, a.w), mix(1.0, 3.0, a.w), length(vec3(2, 3, 6)), mod(-1.0, 3.0));
})", false);
  ASSERT_TRUE(shader);
  auto bits = [](float x) { return std::bit_cast<uint32_t>(x); };
  auto result = test::run(*shader, {{bits(-6.5f), bits(-2.75f), bits(40), bits(0.5f)}});
  ASSERT_EQ(result.error, "");
  float expected[16] = {-0.8125f, 3, -0.75f, -2, 0, -52, 5, 3, 0.5f, 0.25f, -0.0625f, 16, 0.15625f, 2, 7, 2};
  for (size_t i = 0; i < 16; i++) {
    if (i == 4)
      EXPECT_EQ(result.outputs[0][i], 0xffff8000u);
    else
      EXPECT_FLOAT_EQ(std::bit_cast<float>(result.outputs[0][i]), expected[i]) << i;
  }
}

}  // namespace
}  // namespace pumice::frontend
