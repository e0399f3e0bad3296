// PUMICE_CHECK: what shaders do wrong is in the log, with shader, line, invocation and values, once per place; what is right is not.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cstdio>
#include <algorithm>

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

std::string reports(const char* checks, const char* glsl, uint32_t groups = 1) {
  ::setenv("PUMICE_CHECK", checks, 1);
  Stderr log;
  {
    TestDevice device;
    dispatch(device, computeShader(glsl), groups,
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

TEST(Check, namesWhatItDoesNotKnow) {
  EXPECT_NE(reports("bonds", "#version 450\nvoid main() {}").find("PUMICE_CHECK: there is no \"bonds\""), std::string::npos);
}

}  // namespace
}  // namespace pumice::icd::test
