// What the rarer instructions compute, against the same computed in C++.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/frontend/compile.h"
#include "tests/frontend/run_compute.h"
#include "tests/support/compute_module.h"

namespace pumice::frontend {
namespace {

using test::Buffers;

float f(uint32_t bits) { return std::bit_cast<float>(bits); }
uint32_t bits(float x) { return std::bit_cast<uint32_t>(x); }

constexpr uint32_t kLanes = 128;

//! Random words with the corners of integers among them.
std::vector<uint32_t> integers(uint32_t seed) {
  static const uint32_t corners[] = {0, 1, 2, 0x7fffffff, 0x80000000, 0x80000001, 0xffffffff, 0xfffffffe, 0x0000ffff, 0xffff0000, 31, 32};
  std::mt19937 random(seed);
  std::vector<uint32_t> out;
  for (uint32_t i = 0; i < kLanes; i++) out.push_back(random() % 3 ? random() : corners[random() % std::size(corners)]);
  return out;
}
std::vector<uint32_t> floats(uint32_t seed, float low, float high) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> d(low, high);
  std::vector<uint32_t> out;
  for (uint32_t i = 0; i < kLanes; i++) out.push_back(bits(d(random)));
  return out;
}

//! Runs a GLSL body over lanes with words x, y, z; it sets r(0) .. r(7).
std::vector<uint32_t> glsl(const std::string& body, std::vector<std::vector<uint32_t>> inputs) {
  Buffers b(2);
  inputs.resize(3, std::vector<uint32_t>(kLanes));
  for (const auto& v : inputs) b[0].insert(b[0].end(), v.begin(), v.end());
  b[1].resize(kLanes * 16);
  test::runGlsl(R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
layout(local_size_x=128) in;
layout(std430, binding=0) readonly buffer A { uint a[]; };
layout(std430, binding=1) buffer R { uint data[]; };
#define r(k) data[i * 16 + (k)]
#define F uintBitsToFloat
#define U floatBitsToUint
void main() {
  uint i = gl_LocalInvocationIndex, x = a[i], y = a[128 + i], z = a[256 + i];
)" + body + "}\n", 1, b);
  return b[1];
}

//! The same of assembly: %x, %y and %z are uints; `body` makes words and stores them with $0 %value, $1 %value ...
std::vector<uint32_t> assembly(const std::string& capabilities, const std::string& types, std::string body,
                               std::vector<std::vector<uint32_t>> inputs, const char* version = "1.3", const std::string& decorations = "") {
  Buffers b(2);
  inputs.resize(3, std::vector<uint32_t>(kLanes));
  for (const auto& v : inputs) b[0].insert(b[0].end(), v.begin(), v.end());
  b[1].resize(kLanes * 16);
  for (size_t at; (at = body.find('$')) != std::string::npos;) {
    std::string n(1, body[at + 1]), id = std::to_string(at);
    size_t end = body.find('\n', at);
    std::string value = body.substr(at + 3, end - at - 3);
    body.replace(at, end - at, "%ix" + id + " = OpIAdd %uint %i16 %n" + n + "\n%rp" + id + " = OpAccessChain %ptr %r %n0 %ix" + id +
                                   "\nOpStore %rp" + id + " " + value);
  }
  pumice::test::ComputeModule m{.lanes = kLanes, .head = capabilities, .buffers = {"%a", "%r"}, .decorations = decorations};
  m.namesBuffers = std::string(version) == "1.6";
  m.types = R"(
%float = OpTypeFloat 32
%uint2 = OpTypeVector %uint 2
%n16 = OpConstant %uint 16
%n128 = OpConstant %uint 128
%n256 = OpConstant %uint 256
)" + types;
  m.body = pumice::test::kInvocation + std::string(R"(
%i16 = OpIMul %uint %i %n16
%iy = OpIAdd %uint %i %n128
%iz = OpIAdd %uint %i %n256
%px = OpAccessChain %ptr %a %n0 %i
%py = OpAccessChain %ptr %a %n0 %iy
%pz = OpAccessChain %ptr %a %n0 %iz
%x = OpLoad %uint %px
%y = OpLoad %uint %py
%z = OpLoad %uint %pz
)") + body;
  test::runAssembly(textOf(m), 1, b, version);
  return b[1];
}

TEST(Numeric, BitFields) {
  auto x = integers(1), y = integers(2), z = integers(3);
  auto r = glsl(R"(
int offset = int(z & 31u), count = int(z >> 5 & 63u); count = min(count, 32 - offset);
r(0) = bitfieldExtract(x, offset, count); r(1) = uint(bitfieldExtract(int(x), offset, count));
r(2) = bitfieldInsert(x, y, offset, count); r(3) = bitfieldReverse(x); r(4) = uint(bitCount(x));
r(5) = uint(findLSB(x)); r(6) = uint(findMSB(x)); r(7) = uint(findMSB(int(x)));
)", {x, y, z});
  for (uint32_t i = 0; i < kLanes; i++) {
    uint32_t offset = z[i] & 31, count = std::min(z[i] >> 5 & 63, 32 - offset);
    uint64_t mask = (uint64_t(1) << count) - 1;
    const uint32_t* w = &r[i * 16];
    uint32_t field = uint32_t(x[i] >> offset & mask);
    EXPECT_EQ(w[0], field);
    EXPECT_EQ(w[1], count ? uint32_t(int32_t(field << (32 - count)) >> (32 - count)) : 0) << x[i] << " " << offset << " " << count;
    EXPECT_EQ(w[2], uint32_t((x[i] & ~(mask << offset)) | (y[i] & mask) << offset));
    uint32_t reversed = 0;
    for (int k = 0; k < 32; k++) reversed |= (x[i] >> k & 1) << (31 - k);
    EXPECT_EQ(w[3], reversed);
    EXPECT_EQ(w[4], uint32_t(std::popcount(x[i])));
    EXPECT_EQ(int(w[5]), x[i] ? std::countr_zero(x[i]) : -1);
    EXPECT_EQ(int(w[6]), 31 - std::countl_zero(x[i]));
    uint32_t significant = int(x[i]) < 0 ? ~x[i] : x[i];
    EXPECT_EQ(int(w[7]), 31 - std::countl_zero(significant));
  }
}

TEST(Numeric, CarriesBorrowsAndWideProducts) {
  auto x = integers(4), y = integers(5);
  auto r = glsl(R"(
uint carry, borrow, high, low; int shigh, slow;
r(0) = uaddCarry(x, y, carry); r(1) = carry; r(2) = usubBorrow(x, y, borrow); r(3) = borrow;
umulExtended(x, y, high, low); r(4) = high; r(5) = low; imulExtended(int(x), int(y), shigh, slow); r(6) = uint(shigh); r(7) = uint(slow);
)", {x, y});
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    uint64_t sum = uint64_t(x[i]) + y[i], product = uint64_t(x[i]) * y[i];
    auto signedProduct = uint64_t(int64_t(int32_t(x[i])) * int32_t(y[i]));
    EXPECT_EQ(w[0], uint32_t(sum));
    EXPECT_EQ(w[1], uint32_t(sum >> 32));
    EXPECT_EQ(w[2], x[i] - y[i]);
    EXPECT_EQ(w[3], uint32_t(x[i] < y[i]));
    EXPECT_EQ(w[4], uint32_t(product >> 32));
    EXPECT_EQ(w[5], uint32_t(product));
    EXPECT_EQ(w[6], uint32_t(signedProduct >> 32));
    EXPECT_EQ(w[7], uint32_t(signedProduct));
  }
}

TEST(Numeric, WideProductsOfOtherWidths) {
  auto x = integers(6), y = integers(7);
  auto r = assembly("OpCapability Int64\nOpCapability Int16", R"(
%ulong = OpTypeInt 64 0
%ushort = OpTypeInt 16 0
%pairl = OpTypeStruct %ulong %ulong
%pairs = OpTypeStruct %ushort %ushort
)", R"(
%xy = OpCompositeConstruct %uint2 %x %y
%yx = OpCompositeConstruct %uint2 %y %x
%xl = OpBitcast %ulong %xy
%yl = OpBitcast %ulong %yx
%um = OpUMulExtended %pairl %xl %yl
%sm = OpSMulExtended %pairl %xl %yl
%uh = OpCompositeExtract %ulong %um 1
%sh = OpCompositeExtract %ulong %sm 1
%u2 = OpBitcast %uint2 %uh
%s2 = OpBitcast %uint2 %sh
%u20 = OpCompositeExtract %uint %u2 0
%u21 = OpCompositeExtract %uint %u2 1
%s20 = OpCompositeExtract %uint %s2 0
%s21 = OpCompositeExtract %uint %s2 1
$0 %u20
$1 %u21
$2 %s20
$3 %s21
%xs = OpUConvert %ushort %x
%ys = OpUConvert %ushort %y
%us = OpUMulExtended %pairs %xs %ys
%ss = OpSMulExtended %pairs %xs %ys
%us1 = OpCompositeExtract %ushort %us 1
%ss1 = OpCompositeExtract %ushort %ss 1
%us32 = OpUConvert %uint %us1
%ss32 = OpUConvert %uint %ss1
$4 %us32
$5 %ss32
%carry = OpIAddCarry %pairl %xl %yl
%c1 = OpCompositeExtract %ulong %carry 1
%c32 = OpUConvert %uint %c1
$6 %c32
)", {x, y});
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    uint64_t a = x[i] | uint64_t(y[i]) << 32, b = y[i] | uint64_t(x[i]) << 32;
    auto u = uint64_t((unsigned __int128)a * b >> 64), s = uint64_t((__int128)int64_t(a) * int64_t(b) >> 64);
    EXPECT_EQ(w[0] | uint64_t(w[1]) << 32, u);
    EXPECT_EQ(w[2] | uint64_t(w[3]) << 32, s);
    EXPECT_EQ(w[4], (x[i] & 0xffff) * (y[i] & 0xffff) >> 16);
    EXPECT_EQ(w[5], uint32_t(int16_t(x[i]) * int16_t(y[i])) >> 16);
    EXPECT_EQ(w[6], uint32_t(a + b < a));
  }
}

TEST(Numeric, Remainders) {
  auto x = integers(8), y = integers(9);
  for (uint32_t& v : y) v = v ? v : 3;
  for (size_t i = 0; i < y.size(); i += 2) y[i] = y[i] % 19 - 9 ? y[i] % 19 - 9 : 4;
  auto fx = floats(10, -20, 20), fy = floats(11, -5, 5);
  auto r = assembly("", "", R"(
%sx = OpBitcast %int %x
%sy = OpBitcast %int %y
%srem = OpSRem %int %sx %sy
%smod = OpSMod %int %sx %sy
%umod = OpUMod %uint %x %y
%sdiv = OpSDiv %int %sx %sy
%srem_u = OpBitcast %uint %srem
%smod_u = OpBitcast %uint %smod
%sdiv_u = OpBitcast %uint %sdiv
$0 %srem_u
$1 %smod_u
$2 %umod
$3 %sdiv_u
)", {x, y});
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    int64_t a = int32_t(x[i]), b = int32_t(y[i]);
    EXPECT_EQ(int32_t(w[0]), int32_t(a % b));
    EXPECT_EQ(int32_t(w[1]), int32_t((a % b + b) % b)) << a << " mod " << b;
    EXPECT_EQ(w[2], x[i] % y[i]);
    EXPECT_EQ(int32_t(w[3]), int32_t(a / b));
  }
  r = assembly("", "", R"(
%fx = OpBitcast %float %x
%fy = OpBitcast %float %y
%frem = OpFRem %float %fx %fy
%fmod = OpFMod %float %fx %fy
%frem_u = OpBitcast %uint %frem
%fmod_u = OpBitcast %uint %fmod
$0 %frem_u
$1 %fmod_u
)", {fx, fy});
  for (uint32_t i = 0; i < kLanes; i++) {
    double a = f(fx[i]), b = f(fy[i]), rem = std::fmod(a, b), mod = rem != 0 && (rem < 0) != (b < 0) ? rem + b : rem;
    EXPECT_NEAR(f(r[i * 16]), rem, 4e-6) << a << " rem " << b;
    EXPECT_NEAR(f(r[i * 16 + 1]), mod, 4e-6) << a << " mod " << b;
  }
}

TEST(Numeric, LdexpFrexpModf) {
  std::vector<uint32_t> x = floats(12, -100, 100), n;
  const float corners[] = {0, -0.0f, 1, 0.5f, 3e38f, 1e-40f, -1e-45f, INFINITY, -INFINITY, 1e-38f, 16777216.5f, -0.75f};
  for (size_t i = 0; i < std::size(corners); i++) x[i] = bits(corners[i]);
  std::mt19937 random(13);
  for (uint32_t i = 0; i < kLanes; i++) n.push_back(uint32_t(int(random() % 560) - 280));
  n[0] = n[1] = INT32_MAX;
  n[2] = uint32_t(INT32_MIN);
  auto r = glsl(R"(
int e; float whole;
r(0) = U(ldexp(F(x), int(y))); r(1) = U(frexp(F(x), e)); r(2) = uint(e); r(3) = U(modf(F(x), whole)); r(4) = U(whole);
int e2; double d = frexp(double(F(x)) * 1e300lf, e2); r(5) = U(float(d)); r(6) = uint(e2); r(7) = U(float(ldexp(double(F(x)), int(y) / 4)));
uvec2 small = unpackDouble2x32(ldexp(double(F(x)), abs(int(y)) < 1000 ? int(y) * 4 : 0)); r(8) = small.x; r(9) = small.y;
)", {x, n});
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    float v = f(x[i]);
    int k = int(n[i]), e = 0, e2 = 0;
    float exact = std::ldexp(v, std::clamp(k, -1000, 1000));
    EXPECT_EQ(w[0], bits(exact)) << v << " * 2^" << k;
    double small = std::ldexp(double(v), k > -1000 && k < 1000 ? k * 4 : 0);
    EXPECT_EQ(w[8] | uint64_t(w[9]) << 32, std::bit_cast<uint64_t>(small)) << v << " * 2^" << k * 4;
    float significand = std::frexp(v, &e);
    if (std::isfinite(v)) {
      EXPECT_EQ(w[1], bits(significand)) << v;
      EXPECT_EQ(int(w[2]), e) << v;
      double ds = std::frexp(double(v) * 1e300, &e2);
      EXPECT_EQ(w[5], bits(float(ds))) << v;
      EXPECT_EQ(int(w[6]), e2) << v;
      float dl = float(std::ldexp(double(v), k / 4));
      if (k > -600 && k < 600) {
        EXPECT_EQ(w[7], bits(dl)) << v << " " << k;
      }
    }
    float whole = 0, fraction = std::modf(v, &whole);
    EXPECT_EQ(w[3], bits(fraction)) << v;
    EXPECT_EQ(w[4], bits(whole)) << v;
  }
}

TEST(Numeric, PackAndUnpack) {
  auto x = integers(14), y = floats(15, -1.3f, 1.3f), z = floats(16, -70000, 70000);
  y[0] = bits(-0.0f), y[1] = bits(1.0f), y[2] = bits(-1.0f), y[3] = bits(INFINITY);
  auto r = glsl(R"(
vec2 v2 = vec2(F(y), -F(y)); vec4 v4 = vec4(v2, F(y) * 0.5, 0.25);
r(0) = packUnorm2x16(v2); r(1) = packSnorm2x16(v2); r(2) = packUnorm4x8(v4); r(3) = packSnorm4x8(v4); r(4) = packHalf2x16(vec2(F(y), F(z)));
r(5) = U(unpackUnorm2x16(x).y); r(6) = U(unpackSnorm2x16(x).x); r(7) = U(unpackUnorm4x8(x).z); r(8) = U(unpackSnorm4x8(x).w);
r(9) = packHalf2x16(unpackHalf2x16(x)); r(10) = U(float(packDouble2x32(uvec2(x, z)))); r(11) = unpackDouble2x32(double(F(y))).y;
r(12) = U(unpackHalf2x16(x).x);
)", {x, y, z});
  auto unorm = [](float v, float scale) { return uint32_t(std::nearbyint(std::clamp(v, 0.0f, 1.0f) * scale)); };
  auto snorm = [](float v, float scale) { return uint32_t(int(std::nearbyint(std::clamp(v, -1.0f, 1.0f) * scale))); };
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    float v = f(y[i]);
    EXPECT_EQ(w[0], unorm(v, 65535) | unorm(-v, 65535) << 16);
    EXPECT_EQ(w[1], (snorm(v, 32767) & 0xffff) | snorm(-v, 32767) << 16);
    EXPECT_EQ(w[2], unorm(v, 255) | unorm(-v, 255) << 8 | unorm(v * 0.5f, 255) << 16 | 64u << 24);
    EXPECT_EQ(w[3], (snorm(v, 127) & 255) | (snorm(-v, 127) & 255) << 8 | (snorm(v * 0.5f, 127) & 255) << 16 | 32u << 24);
    EXPECT_EQ(w[5], bits(float(x[i] >> 16) / 65535.0f));
    EXPECT_EQ(w[6], bits(std::max(float(int16_t(x[i])) / 32767.0f, -1.0f)));
    EXPECT_EQ(w[7], bits(float(x[i] >> 16 & 255) / 255.0f));
    EXPECT_EQ(w[8], bits(std::max(float(int8_t(x[i] >> 24)) / 127.0f, -1.0f)));
    uint16_t h = uint16_t(x[i]);
    if ((h & 0x7c00) != 0x7c00 && (x[i] >> 16 & 0x7c00) != 0x7c00) {
      EXPECT_EQ(w[9], x[i]);
    }
    if ((h & 0x7c00) != 0x7c00) {
      double m = h & 0x7c00 ? 1024 + (h & 1023) : h & 1023;
      EXPECT_EQ(f(w[12]), (h & 0x8000 ? -1 : 1) * std::ldexp(m, std::max(h >> 10 & 31, 1) - 25)) << h;
    }
    double d = std::bit_cast<double>(uint64_t(x[i]) | uint64_t(z[i]) << 32);
    EXPECT_EQ(w[10], bits(float(d)));
    EXPECT_EQ(w[11], uint32_t(std::bit_cast<uint64_t>(double(v)) >> 32));
    // Half: the bits that round to nearest even gives for numbers in the normal range.
    auto half = [](float value) -> uint32_t {
      if (std::abs(value) >= 65520) return value < 0 ? 0xfc00 : 0x7c00;
      uint32_t sign = std::signbit(value) ? 0x8000 : 0;
      if (std::abs(value) < 0x1p-14f) return sign | uint32_t(std::nearbyint(std::abs(value) * 0x1p24f));
      int e = std::ilogb(value);
      return sign | (uint32_t(e + 14) * 1024 + uint32_t(std::nearbyint(std::ldexp(std::abs(value), 10 - e))));
    };
    EXPECT_EQ(w[4], half(v) | half(f(z[i])) << 16) << v << " " << f(z[i]);
  }
}

TEST(Numeric, QuantizeToF16) {
  auto x = floats(17, -70000, 70000), y = floats(18, -1e-4f, 1e-4f);
  x[0] = bits(NAN), x[1] = bits(-INFINITY), x[2] = bits(65504), x[3] = bits(65520), x[4] = bits(-0.0f), x[5] = bits(65519.9f);
  auto r = assembly("", "", R"(
%fx = OpBitcast %float %x
%fy = OpBitcast %float %y
%qx = OpQuantizeToF16 %float %fx
%qy = OpQuantizeToF16 %float %fy
%ux = OpBitcast %uint %qx
%uy = OpBitcast %uint %qy
$0 %ux
$1 %uy
)", {x, y});
  for (uint32_t i = 0; i < kLanes; i++) {
    for (int k = 0; k < 2; k++) {
      float v = f(k ? y[i] : x[i]), q = f(r[i * 16 + uint32_t(k)]);
      if (std::isnan(v)) {
        EXPECT_TRUE(std::isnan(q));
        continue;
      }
      float expected = v;
      if (std::abs(v) >= 65520) expected = std::copysign(INFINITY, v);
      else if (v != 0) expected = std::ldexp(float(std::nearbyint(std::ldexp(v, 10 - std::ilogb(v)))), std::ilogb(v) - 10);
      if (std::abs(expected) < 0x1p-14f) expected = std::copysign(0.0f, v);
      EXPECT_EQ(bits(q), bits(expected)) << v;
    }
  }
}

TEST(Numeric, IntegerDotProducts) {
  auto x = integers(19), y = integers(20), z = integers(21);
  std::string ops;
  const char* names[] = {"OpUDot", "OpSDot", "OpSUDot"};
  for (int k = 0; k < 3; k++) {
    std::string n = std::to_string(k), type = k == 0 ? "%uint" : "%int";
    ops += "%d" + n + " = " + names[k] + " " + type + " %x %y PackedVectorFormat4x8Bit\n%du" + n + " = OpBitcast %uint %d" + n +
           "\n$" + n + " %du" + n + "\n";
    ops += "%s" + n + " = " + names[k] + "AccSat " + type + " %x %y " + (k == 0 ? "%z" : "%zi") +
           " PackedVectorFormat4x8Bit\n%su" + n + " = OpBitcast %uint %s" + n + "\n$" + std::to_string(k + 3) + " %su" + n + "\n";
  }
  auto r = assembly("OpCapability DotProduct\nOpCapability DotProductInput4x8BitPacked\nOpCapability DotProductInputAll\n"
                    "OpCapability DotProductInput4x8Bit\nOpCapability Int8\nOpCapability Int16\n",
                    "%byte = OpTypeInt 8 1\n%byte4 = OpTypeVector %byte 4\n%short = OpTypeInt 16 1\n%short2 = OpTypeVector %short 2\n",
                    "%zi = OpBitcast %int %z\n" + ops + R"(
%xb = OpBitcast %byte4 %x
%yb = OpBitcast %byte4 %y
%db = OpSDot %short %xb %yb
%db32 = OpSConvert %int %db
%dbu = OpBitcast %uint %db32
$6 %dbu
%xs = OpBitcast %short2 %x
%ys = OpBitcast %short2 %y
%ds = OpSDot %int %xs %ys
%dsu = OpBitcast %uint %ds
$7 %dsu
%xy = OpCompositeConstruct %uint2 %x %y
%yz = OpCompositeConstruct %uint2 %y %z
%dw = OpUDotAccSat %uint %xy %yz %z
$8 %dw
)", {x, y, z}, "1.6");
  auto s8 = [](uint32_t v, int k) { return int64_t(int8_t(v >> 8 * k)); };
  auto u8 = [](uint32_t v, int k) { return int64_t(uint8_t(v >> 8 * k)); };
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    int64_t u = 0, s = 0, m = 0;
    for (int k = 0; k < 4; k++) {
      u += u8(x[i], k) * u8(y[i], k);
      s += s8(x[i], k) * s8(y[i], k);
      m += s8(x[i], k) * u8(y[i], k);
    }
    auto clampS = [](int64_t v) { return uint32_t(int32_t(std::clamp<int64_t>(v, INT32_MIN, INT32_MAX))); };
    EXPECT_EQ(w[0], uint32_t(u));
    EXPECT_EQ(w[1], uint32_t(s));
    EXPECT_EQ(w[2], uint32_t(m));
    EXPECT_EQ(w[3], uint32_t(std::min<int64_t>(u + z[i], UINT32_MAX)));
    EXPECT_EQ(w[4], clampS(s + int32_t(z[i])));
    EXPECT_EQ(w[5], clampS(m + int32_t(z[i])));
    EXPECT_EQ(int32_t(w[6]), int16_t(s));
    EXPECT_EQ(w[7], uint32_t(int16_t(x[i])) * uint32_t(int16_t(y[i])) + uint32_t(int16_t(x[i] >> 16)) * uint32_t(int16_t(y[i] >> 16)));
    uint32_t dot = x[i] * y[i] + y[i] * z[i];
    EXPECT_EQ(w[8], uint32_t(std::min<uint64_t>(uint64_t(dot) + z[i], UINT32_MAX)));
  }
}

// Sums of products that cancel must not be rounded to halfs on their way.
TEST(Numeric, DeterminantsAndInversesOfHalfs) {
  auto x = floats(25, -1, 1), y = floats(26, -1, 1), z = floats(27, -1, 1);
  auto r = glsl(R"(
f16mat4 h = f16mat4(mat4(F(x), F(y), 0.3, F(z), F(z), 0.7, F(x) - F(y), 0.1, F(y), 0.2, F(x), -0.9, 0.4, F(z), -0.6, F(x) * F(y)));
mat4 w = mat4(h);
r(0) = U(float(determinant(h)));
r(1) = U(determinant(w));
float far = 0;
for (int c = 0; c < 4; c++) for (int k = 0; k < 4; k++) {
  float want = inverse(w)[c][k];
  if (abs(want) < 1000.0) far = max(far, abs(float(inverse(h)[c][k]) - want) / max(abs(want), 0.001));
}
r(2) = U(far);
)",
                {x, y, z});
  for (uint32_t i = 0; i < kLanes; i++) {
    const uint32_t* w = &r[i * 16];
    EXPECT_NEAR(f(w[0]), f(w[1]), 0x1p-11 * std::max(std::abs(f(w[1])), 0x1p-14f)) << i;
    EXPECT_LE(f(w[2]), 0x1p-11f) << i;
  }
}

TEST(Numeric, DeterminantsAndInverses) {
  auto x = floats(22, -1, 1), y = floats(23, -1, 1), z = floats(24, -1, 1);
  for (int n = 2; n <= 4; n++) {
    std::string N = std::to_string(n);
    std::string body = "mat" + N + " m = mat" + N + "(3.0);\n" + R"(
m[0][1] = F(x); m[1][0] = F(y); m[1][1] += F(z); m[0][0] -= F(x) * F(y);
)";
    if (n > 2) body += "m[2][0] = F(z); m[0][2] = F(x) * 0.5; m[1][2] = -F(y);\n";
    if (n > 3) body += "m[3][1] = F(x) + F(y); m[2][3] = F(z) - F(x); m[0][3] = 0.25;\n";
    body += "r(0) = U(determinant(m)); mat" + N + " p = m * inverse(m); float far = 0;\n" +
            "for (int c = 0; c < " + N + "; c++) for (int k = 0; k < " + N + "; k++) far = max(far, abs(p[c][k] - (c == k ? 1.0 : 0.0)));\n" +
            "r(1) = U(far);\n";
    auto r = glsl(body, {x, y, z});
    for (uint32_t i = 0; i < kLanes; i++) {
      double a = f(x[i]), b = f(y[i]), c = f(z[i]);
      double m[4][4] = {};
      for (int k = 0; k < n; k++) m[k][k] = 3;
      m[0][1] = a, m[1][0] = b, m[1][1] += c, m[0][0] -= a * b;
      if (n > 2) m[2][0] = c, m[0][2] = a * 0.5, m[1][2] = -b;
      if (n > 3) m[3][1] = a + b, m[2][3] = c - a, m[0][3] = 0.25;
      double det = 1;  // by elimination
      for (int k = 0; k < n; k++) {
        int best = k;
        for (int row = k; row < n; row++)
          if (std::abs(m[row][k]) > std::abs(m[best][k])) best = row;
        if (best != k) {
          std::swap(m[best], m[k]);
          det = -det;
        }
        det *= m[k][k];
        for (int row = k + 1; row < n; row++) {
          double factor = m[row][k] / m[k][k];
          for (int col = k; col < n; col++) m[row][col] -= factor * m[k][col];
        }
      }
      EXPECT_NEAR(f(r[i * 16]), det, 2e-4) << n;
      EXPECT_LT(f(r[i * 16 + 1]), 2e-5f) << n;
    }
  }
}

//! The bits of the half that is nearest of those not farther from zero.
uint32_t halfTowardsZero(double x) {
  uint32_t sign = std::signbit(x) ? 0x8000 : 0;
  double magnitude = std::fabs(x);
  if (std::isinf(magnitude)) return sign | 0x7c00;
  if (magnitude >= 65504) return sign | 0x7bff;
  if (magnitude < 0x1p-14) return sign | uint32_t(magnitude * 0x1p24);
  int e = std::ilogb(magnitude);
  return sign | uint32_t(e + 15) << 10 | (uint32_t(std::ldexp(magnitude, 10 - e)) & 1023);
}

TEST(Numeric, ConversionToHalfWithGivenRounding) {
  std::vector<uint32_t> x = floats(20, -3, 3), y = floats(21, -70000, 70000);
  const float corners[] = {0, -0.0f, 65504, 65519.9f, 65520, -65536, 3e38f, INFINITY, -INFINITY, 0x1p-14f, 0x1.ffcp-15f, -0x1.fffp-15f,
                           0x1p-24f, 0x1.8p-24f, 0x1.8p-25f, -1e-40f, 1.00048828125f, 1.0004883f, 2049, -2051};
  for (size_t i = 0; i < std::size(corners); i++) x[i] = bits(corners[i]);
  // Rounding may be given only where the half goes straight to memory.
  auto r = assembly("OpCapability Float16\nOpCapability Float64\nOpCapability StorageBuffer16BitAccess", R"(
%half = OpTypeFloat 16
%double = OpTypeFloat 64
%half2 = OpTypeVector %half 2
%float2 = OpTypeVector %float 2
%halves = OpTypeRuntimeArray %half2
%block_h = OpTypeStruct %halves
%ptr_block_h = OpTypePointer StorageBuffer %block_h
%ptr_half2 = OpTypePointer StorageBuffer %half2
%ptr_half = OpTypePointer StorageBuffer %half
%rh = OpVariable %ptr_block_h StorageBuffer
%tiny = OpConstant %double 1.0000000000001
)", R"(
%fx = OpBitcast %float %x
%fy = OpBitcast %float %y
%fxy = OpCompositeConstruct %float2 %fx %fy
%i1 = OpIAdd %uint %i16 %n1
%i2 = OpIAdd %uint %i16 %n2
%to0 = OpAccessChain %ptr_half2 %rh %n0 %i16
%to1 = OpAccessChain %ptr_half %rh %n0 %i1 %n0
%to2 = OpAccessChain %ptr_half2 %rh %n0 %i2
%h = OpFConvert %half2 %fxy
OpStore %to0 %h
%dx = OpFConvert %double %fx
%dm = OpFMul %double %dx %tiny
%hd = OpFConvert %half %dm
OpStore %to1 %hd
%near = OpFConvert %half2 %fxy
OpStore %to2 %near
%packed = OpExtInst %uint %glsl PackHalf2x16 %fxy
$3 %packed
)", {x, y}, "1.3", R"(
OpDecorate %h FPRoundingMode RTZ
OpDecorate %hd FPRoundingMode RTZ
OpDecorate %near FPRoundingMode RTE
OpDecorate %halves ArrayStride 4
OpDecorate %block_h Block
OpMemberDecorate %block_h 0 Offset 0
OpDecorate %rh DescriptorSet 0
OpDecorate %rh Binding 1
)");
  for (uint32_t i = 0; i < kLanes; i++) {
    EXPECT_EQ(r[i * 16], halfTowardsZero(f(x[i])) | halfTowardsZero(f(y[i])) << 16) << f(x[i]) << " " << f(y[i]);
    EXPECT_EQ(r[i * 16 + 1], halfTowardsZero(f(x[i]) * 1.0000000000001)) << f(x[i]);
    EXPECT_EQ(r[i * 16 + 2], r[i * 16 + 3]);
  }
}

}  // namespace
}  // namespace pumice::frontend
