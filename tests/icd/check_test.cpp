// PUMICE_CHECK: what shaders do wrong is in the log, with shader, line, invocation and values, once per place; what is right is not.
// And what they print.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cstdio>
#include <algorithm>

#include "tests/frontend/compile.h"
#include "tests/icd/graphics.h"
#include "tests/icd/dispatch.h"

namespace pumice::icd::test {
namespace {

//! What the process writes to stderr while this lives.
class Stderr {
 public:
  Stderr() : file_(std::tmpfile()), before_(::dup(2)) {
    std::fflush(stderr);
    ::dup2(::fileno(file_), 2);
  }
  ~Stderr() {
    if (before_ >= 0) text();
    std::fclose(file_);
  }
  std::string text() {
    std::fflush(stderr);
    ::dup2(before_, 2);
    ::close(before_);
    before_ = -1;
    std::rewind(file_);
    std::string all;
    char part[4096];
    for (size_t n; (n = std::fread(part, 1, sizeof part, file_)) > 0;) all.append(part, n);
    return all;
  }

 private:
  std::FILE* file_;
  int before_;
};

//! SPIR-V of the oldest version, or of 1.6.
std::string reports(const char* checks, const char* glsl, uint32_t groups = 1, bool newest = false) {
  ::setenv("PUMICE_CHECK", checks, 1);
  Stderr log;
  {
    TestDevice device;
    dispatch(device, newest ? frontend::test::compileGlsl(frontend::test::GlslStage::Compute, glsl) : computeShader(glsl), groups,
             [](TestDevice& d, VkCommandBuffer commands) { d.run(commands); });
  }
  ::unsetenv("PUMICE_CHECK");
  return log.text();
}

constexpr const char* kWrong = R"(#version 450
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { float v[]; } b;   // 4096 bytes
void main() {
  uint i = gl_GlobalInvocationID.x;
  float u;
  b.v[i + (i == 5u ? 5000u : 0u)] = 1.0;
  float zero = b.v[200 + i];
  if (i > 6u) b.v[i] = zero / zero;
  if (i == 100u) u = 1.0;
  b.v[100 + i] = u;
  float a[4];
  a[i & 1u] = 2.0;
  b.v[300 + i] = a[(i >> 1) & 1u];
}
)";

TEST(Check, namesAnAccessOutOfBounds) {
  EXPECT_EQ(reports("bounds", kWrong),
            "pumice: error: PUMICE_CHECK bounds: store of 4 bytes at byte 20020 of a buffer of 4096 bytes; compute shader \"main\", line 7, "
            "invocation (5, 0, 0) of work group (0, 0, 0)\n");
}

TEST(Check, namesWhatFirstMakesANan) {
  EXPECT_EQ(reports("nan", kWrong),
            "pumice: error: PUMICE_CHECK nan: fdiv(0, 0) = NaN; compute shader \"main\", line 9, invocation (7, 0, 0) of work group (0, 0, 0)\n");
}

TEST(Check, namesReadsOfWhatNobodyHasWritten) {
  const std::string text = reports("uninit", kWrong);
  EXPECT_NE(text.find("PUMICE_CHECK uninit: read of a variable that has not been written; compute shader \"main\", line 11, invocation (0, 0, 0)"), std::string::npos) << text;
  EXPECT_NE(text.find("line 14, invocation (1, 0, 0)"), std::string::npos) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2) << text;
}

TEST(Check, namesEachPlaceOnce) {
  const std::string text = reports("bounds,nan,uninit", kWrong, 8);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4) << text;
}

TEST(Check, saysNothingAboutWhatIsRight) {
  EXPECT_EQ(reports("bounds,nan,uninit", R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { float v[]; } b;
shared float s[64];
float twice(float x) { float r; if (x > 3.0) { r = x; } else { r = -x; } return r * 2.0; }
void main() {
  uint i = gl_LocalInvocationIndex;
  float a[4] = float[](1.0, 2.0, 3.0, 4.0);
  vec4 c;
  c.x = b.v[i]; c.yzw = vec3(a[i & 3u]);
  s[i] = twice(c.x + c.w);
  barrier();
  for (uint k = 0u; k < 4u; k++) a[k] = s[(i + k) & 63u];
  float inf = uintBitsToFloat(0x7f800000u);
  b.v[i] = a[i & 3u] + min(inf, c.y) + exp(c.z);
}
)"), "");
}

// Each access is reported once: by its index, or by where it leads.
TEST(Check, namesIndicesThatLeadToNeighbours) {
  const std::string text = reports("bounds", R"(#version 450
layout(local_size_x = 8) in;
struct S { float a[4]; float b[4]; };
layout(set = 0, binding = 0) buffer B { float v[64]; S s; float w[]; } b;   // 4096 bytes
shared float s0[4];
shared float s1[16];
void main() {
  uint i = gl_LocalInvocationIndex;
  s0[i & 3u] = 1.0; s1[i] = 2.0; s1[i + 8u] = 3.0; barrier();
  b.v[i] = s0[i];
  float m[2][4] = float[2][4](float[4](1, 2, 3, 4), float[4](5, 6, 7, 8));
  b.v[i] = m[0][i];
  S p; for (int k = 0; k < 4; k++) { p.a[k] = 1; p.b[k] = 2; }
  b.v[i] = p.a[i];
  b.s.a[i] = 1.0;
  vec3 c = vec3(i); c[i] = 1.0;
  mat2x3 t = mat2x3(i);
  b.v[8 + i] = t[i & 3u][0] + c[0];
  b.v[int(i) - 1] = 1.0;
  b.v[(i == 5u ? 5000u : i)] = 1.0;
  b.v[i + 8] = c[i & 1u] + s1[15 - i] + m[i & 1u][3 - (i & 3u)] + t[1][i & 1u] + b.w[i];
}
)");
  const char* const found[] = {
      "bounds: index 4 of an array of 4; compute shader \"main\", line 10, invocation (4, 0, 0)", "index 4 of an array of 4; compute shader \"main\", line 12,",
      "index 4 of an array of 4; compute shader \"main\", line 14,", "index 4 of an array of 4; compute shader \"main\", line 15,",
      "index 3 of a vector of 3; compute shader \"main\", line 16, invocation (3, 0, 0)", "index 2 of a matrix of 2; compute shader \"main\", line 18, invocation (2, 0, 0)",
      "index -1 of an array of 64; compute shader \"main\", line 19, invocation (0, 0, 0)", "index 5000 of an array of 64; compute shader \"main\", line 20, invocation (5, 0, 0)"};
  for (const char* line : found) EXPECT_NE(text.find(line), std::string::npos) << "there is no " << line << " in\n" << text;
  EXPECT_EQ(size_t(std::count(text.begin(), text.end(), '\n')), std::size(found)) << text;
}

TEST(Check, namesIndicesBehindPushConstants) {
  EXPECT_EQ(reports("bounds", R"(#version 450
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { uint v[]; } b;
layout(push_constant) uniform P { uint v[4]; } p;
void main() {
  uint i = gl_LocalInvocationIndex;
  b.v[i] = p.v[i & 3u];
  b.v[i] = p.v[i];
}
)"), "pumice: error: PUMICE_CHECK bounds: index 4 of an array of 4; compute shader \"main\", line 8, invocation (4, 0, 0) of work group (0, 0, 0)\n");
}

TEST(Check, namesALineOnceHoweverOftenItIsInlined) {
  const std::string text = reports("nan", R"(#version 450
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { float v[]; } b;
float f(float x) { return sqrt(x); }
void main() {
  uint i = gl_GlobalInvocationID.x;
  float x = -1.0 - float(i);
  b.v[i] = f(x);
  b.v[i] += f(x - 1.0);
  for (int k = 0; k < 4; k++) b.v[8 + i] = f(x * float(k + 1));
  b.v[16 + i] = sqrt(x);
}
)");
  EXPECT_NE(text.find("line 4,"), std::string::npos) << text;
  EXPECT_NE(text.find("line 11,"), std::string::npos) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2) << text;
}

// What lies outside is not what nobody has written.
TEST(Check, doesNotCallWhatIsOutsideUnwritten) {
  constexpr const char* kOutside = R"(#version 450
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { float v[]; } b;
void main() {
  uint i = gl_LocalInvocationIndex;
  float a[4];
  for (int k = 0; k < 4; k++) a[k] = float(k);
  b.v[i] = a[i];
}
)";
  EXPECT_EQ(reports("uninit", kOutside), "");
  const std::string both = reports("bounds,uninit", kOutside);
  EXPECT_NE(both.find("bounds: index 4 of an array of 4;"), std::string::npos) << both;
  EXPECT_EQ(std::count(both.begin(), both.end(), '\n'), 1) << both;
}

TEST(Check, namesWorkGroupMemoryThatNobodyHasWritten) {
  const std::string text = reports("uninit", R"(#version 450
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { uint v[]; } b;
shared uint never[8];
shared uint some[8];
shared uint counter;
shared uint all[8];
void main() {
  uint i = gl_LocalInvocationIndex;
  b.v[gl_GlobalInvocationID.x] = never[i];
  if (i != 5u) some[i] = i;
  all[i] = i;
  barrier();
  b.v[gl_GlobalInvocationID.x] = some[i];
  b.v[gl_GlobalInvocationID.x] = all[7 - i];
  atomicAdd(all[0], 1u);
  atomicExchange(some[5], 1u);
  barrier();
  b.v[gl_GlobalInvocationID.x] = some[i];
  b.v[gl_GlobalInvocationID.x] = atomicAdd(counter, 1u);
}
)", 4);
  for (const char* line : {"line 10, invocation (0, 0, 0)", "line 14, invocation (5, 0, 0)", "line 20, invocation (0, 0, 0)"})
    EXPECT_NE(text.find(line), std::string::npos) << line << " in\n" << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3) << text;
}

TEST(Check, takesAnInitializerOfWorkGroupMemoryForAWrite) {
  const std::string text = reports("uninit", R"(#version 450
#extension GL_EXT_null_initializer : require
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { uint v[]; } b;
shared uint before[8];
shared uint zero[8] = {};
shared uint after[8];
void main() {
  uint i = gl_LocalInvocationIndex;
  b.v[i] = zero[i];
  b.v[i] = before[i];
  b.v[i] = after[i];
}
)", 1, true);
  for (const char* line : {"line 11,", "line 12,"}) EXPECT_NE(text.find(line), std::string::npos) << line << " in\n" << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2) << text;
}

TEST(Check, namesSumsThatOverflow) {
  const std::string text = reports("nan", R"(#version 450
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_clustered : require
#extension GL_EXT_shader_atomic_float : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer B { float v[]; } b;
void main() {
  uint i = gl_LocalInvocationIndex;
  float big = 2e38 + float(i);
  b.v[i] = subgroupAdd(big);
  b.v[i] = subgroupInclusiveMul(big);
  b.v[i] = subgroupClusteredAdd(big, 4u);
  b.v[40] = 3e38;
  atomicAdd(b.v[40], big);
  b.v[i] = float(float16_t(i + 65515u));
  float inf = uintBitsToFloat(0x7f800000u);
  b.v[i] = subgroupAdd(i == 3u ? inf : 1.0) + subgroupClusteredMul(i == 3u ? inf : 1.0, 4u);
  b.v[i] = subgroupExclusiveMin(float(i)) + subgroupExclusiveAdd(float(i));
}
)", 1, true);
  for (const char* line : {"nan: subgroup.reduce.fadd(1.99999994e+38, ...) = inf; compute shader \"main\", line 11,", "nan: subgroup.reduce.fmul(1.99999994e+38, ...) = inf; compute shader \"main\", line 12,",
                           "line 13,", "line 15,", "nan: utof(65520) = inf; compute shader \"main\", line 16, invocation (5, 0, 0)"})
    EXPECT_NE(text.find(line), std::string::npos) << "there is no " << line << " in\n" << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 5) << text;
}

constexpr const char* kPrints = R"(#version 450
#extension GL_EXT_debug_printf : require
layout(local_size_x = 100) in;
layout(set = 0, binding = 0) buffer B { uint v[]; } b;
void main() {
  uint i = gl_LocalInvocationIndex;
  if (i % 48u == 2u) debugPrintfEXT("lane %03u: %d %.2f %v3f %% %#x %s", i, -int(i), float(i) / 8.0, vec3(i, 0.5, -1), i << 8, i > 50u);
  if (i == 77u) debugPrintfEXT("two\nlines\n");
  b.v[i] = i;
}
)";

TEST(Check, printsWhatShadersPrint) {
  EXPECT_EQ(reports("printf", kPrints),
            "pumice: printf: lane 002: -2 0.25 2.000000, 0.500000, -1.000000 % 0x200 0\n"
            "pumice: printf: lane 050: -50 6.25 50.000000, 0.500000, -1.000000 % 0x3200 0\n"
            "pumice: printf: lane 098: -98 12.25 98.000000, 0.500000, -1.000000 % 0x6200 1\n"
            "pumice: printf: two\npumice: printf: lines\n");
  EXPECT_EQ(reports("bounds,nan,uninit", kPrints), "") << "nobody has asked for it";
}

TEST(Check, printsNoFloods) {
  const char* const loops = R"(#version 450
#extension GL_EXT_debug_printf : require
layout(local_size_x = 4) in;
layout(set = 0, binding = 0) buffer B { uint v[]; } b;
void main() { for (uint k = 0u; k < 4000u + b.v[0]; k++) debugPrintfEXT("turn %u", k); }
)";
  for (int again = 0; again < 2; again++) {   // each device may print as much
    const std::string text = reports("printf", loops);
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 10001);
    EXPECT_NE(text.find("pumice: printf: 10000 lines are enough: shaders print nothing more on this device\n"), std::string::npos);
  }
}

TEST(Check, namesWhatItDoesNotKnow) {
  EXPECT_NE(reports("bonds", "#version 450\nvoid main() {}").find("PUMICE_CHECK: there is no \"bonds\""), std::string::npos);
}

}  // namespace
}  // namespace pumice::icd::test
