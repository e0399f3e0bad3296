// Pointers that vary from lane to lane, pointers in variables and results, work-group memory, atomics.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "tests/frontend/compile.h"
#include "tests/frontend/run_compute.h"
#include "tests/support/compute_module.h"

namespace pumice::frontend {
namespace {

using pumice::test::ComputeModule, pumice::test::kInvocation, pumice::test::textOf;
using test::Buffers;
using test::runAssembly;
using test::runGlsl;

// Eight result words a lane, from %r0 on, by OpPtrAccessChain.
std::string store(int word, const std::string& value) {
  std::string n = std::to_string(word);
  return "%rp" + n + " = OpPtrAccessChain %ptr %r0 %n" + n + "\nOpStore %rp" + n + " " + value + "\n";
}

//! Of 32 lanes: pointers %pa and %pb to a lane's word of two buffers, %r0 to its results, arrays %wg1 and %wg2 in work-group
//! memory, the variable %keep for a pointer.
void runPointers(const std::string& body, const std::string& functions, Buffers& buffers) {
  ComputeModule m{.lanes = 32, .buffers = {"%a", "%b", "%r"}, .functions = functions};
  m.head = "OpCapability VariablePointers\nOpExtension \"SPV_KHR_variable_pointers\"\n";
  m.interface = "%wg1 %wg2";
  m.decorations = "OpDecorate %ptr ArrayStride 4\n";
  m.types = R"(
%n100 = OpConstant %uint 100
%minus2 = OpConstant %int -2
%null = OpConstantNull %ptr
%shared_array = OpTypeArray %uint %n100
%pshared = OpTypePointer Workgroup %shared_array
%pwg = OpTypePointer Workgroup %uint
%wg1 = OpVariable %pshared Workgroup
%wg2 = OpVariable %pshared Workgroup
%null_wg = OpConstantNull %pwg
%pvar = OpTypePointer Function %ptr
%pickfn = OpTypeFunction %ptr %bool %ptr %ptr
)";
  m.body = "%keep = OpVariable %pvar Function\n" + std::string(kInvocation) + R"(
%odd_bit = OpBitwiseAnd %uint %i %n1
%odd = OpINotEqual %bool %odd_bit %n0
%i8 = OpIMul %uint %i %n8
%r0 = OpAccessChain %ptr %r %n0 %i8
%pa = OpAccessChain %ptr %a %n0 %i
%pb = OpAccessChain %ptr %b %n0 %i
)" + body;
  runAssembly(textOf(m), 1, buffers, "1.6");
}

Buffers someBuffers() {
  Buffers b(3);
  b[0].resize(64);
  b[1].resize(64);
  b[2].resize(32 * 8);
  std::iota(b[0].begin(), b[0].end(), 1000);
  std::iota(b[1].begin(), b[1].end(), 2000);
  return b;
}

TEST(VariablePointers, SelectedPerLane) {
  Buffers b = someBuffers();
  runPointers("%p = OpSelect %ptr %odd %pa %pb\n%v = OpLoad %uint %p\n" + store(0, "%v") +
                  // Through a variable, and written to.
                  "OpStore %keep %p\n%q = OpLoad %ptr %keep\n%q2 = OpPtrAccessChain %ptr %q %n5\n%v2 = OpLoad %uint %q2\n" +
                  store(1, "%v2") +
                  // Null reads zero; comparisons and differences.
                  "%n = OpSelect %ptr %odd %null %p\n%v3 = OpLoad %uint %n\n" + store(2, "%v3") +
                  "%e = OpPtrEqual %bool %p %pa\n%ev = OpSelect %uint %e %n1 %n0\n" + store(3, "%ev") +
                  "%ne = OpPtrNotEqual %bool %q2 %q\n%nev = OpSelect %uint %ne %n1 %n0\n" + store(4, "%nev") +
                  "%d = OpPtrDiff %uint %q2 %q\n" + store(5, "%d") + "%d2 = OpPtrDiff %uint %q %q2\n" + store(6, "%d2") +
                  // A step back by a constant and by a number that varies.
                  "%s = OpBitcast %int %odd_bit\n%s2 = OpISub %int %s %n2\n%q3 = OpPtrAccessChain %ptr %q2 %s2\n"
                  "%q4 = OpPtrAccessChain %ptr %q3 %minus2\n%v4 = OpLoad %uint %q4\n" +
                  store(7, "%v4") + "OpStore %q %n100\n",
              "", b);
  if (HasFailure()) return;
  for (uint32_t i = 0; i < 32; i++) {
    const uint32_t* r = &b[2][i * 8];
    uint32_t base = i & 1 ? 1000 : 2000;
    EXPECT_EQ(r[0], base + i);
    EXPECT_EQ(r[1], base + i + 5);
    EXPECT_EQ(b[i & 1 ? 0 : 1][i], 100u);
    EXPECT_EQ(b[i & 1 ? 1 : 0][i], (i & 1 ? 2000 : 1000) + i);
    EXPECT_EQ(r[2], i & 1 ? 0 : base + i);
    EXPECT_EQ(r[3], i & 1);
    EXPECT_EQ(r[4], 1u);
    EXPECT_EQ(r[5], 5u);
    EXPECT_EQ(r[6], uint32_t(-5));
    EXPECT_EQ(r[7], base + i + 5 - 2 + (i & 1) - 2) << i;
  }
}

// A pointer to one of two arrays of descriptors, which then is indexed; the distance of elements whose pointer type does
// not say how far they lie apart.
TEST(VariablePointers, ToArraysOfDescriptors) {
  Buffers b(5);
  for (uint32_t i = 0; i < 4; i++) b[i] = {100 * i, 100 * i + 1, 100 * i + 2, 100 * i + 3, 100 * i + 4, 100 * i + 5};
  b[4].resize(2 * 32);
  ComputeModule m{.lanes = 32, .interface = "%x %y %r"};
  m.head = "OpCapability VariablePointers\n";
  m.decorations = R"(
OpDecorate %pair ArrayStride 4
OpDecorate %pairs ArrayStride 8
OpDecorate %list ArrayStride 4
OpDecorate %block Block
OpMemberDecorate %block 0 Offset 0
OpDecorate %out Block
OpMemberDecorate %out 0 Offset 0
OpDecorate %x DescriptorSet 0
OpDecorate %x Binding 0
OpDecorate %y DescriptorSet 0
OpDecorate %y Binding 2
OpDecorate %r DescriptorSet 0
OpDecorate %r Binding 4
)";
  m.types = R"(
%pair = OpTypeArray %uint %n2
%pairs = OpTypeArray %pair %n3
%block = OpTypeStruct %pairs
%blocks = OpTypeArray %block %n2
%list = OpTypeRuntimeArray %int
%out = OpTypeStruct %list
%pblocks = OpTypePointer StorageBuffer %blocks
%ppair = OpTypePointer StorageBuffer %pair
%pint = OpTypePointer StorageBuffer %int
%pout = OpTypePointer StorageBuffer %out
%x = OpVariable %pblocks StorageBuffer
%y = OpVariable %pblocks StorageBuffer
%r = OpVariable %pout StorageBuffer
)";
  m.body = std::string(kInvocation) + R"(
%bit = OpBitwiseAnd %uint %i %n1
%odd = OpINotEqual %bool %bit %n0
%half = OpShiftRightLogical %uint %i %n1
%which = OpBitwiseAnd %uint %half %n1
%p = OpSelect %pblocks %odd %x %y
%e = OpAccessChain %ptr %p %which %n0 %n2 %n1
%v = OpLoad %uint %e
%vi = OpBitcast %int %v
%i2 = OpIMul %uint %i %n2
%r0 = OpAccessChain %pint %r %n0 %i2
OpStore %r0 %vi
%last = OpAccessChain %ppair %x %n1 %n0 %n2
%first = OpAccessChain %ppair %x %n1 %n0 %which
%d = OpPtrDiff %int %last %first
%i3 = OpIAdd %uint %i2 %n1
%r1 = OpAccessChain %pint %r %n0 %i3
OpStore %r1 %d
)";
  runAssembly(textOf(m), 1, b, "1.6");
  if (HasFailure()) return;
  for (uint32_t i = 0; i < 32; i++) {
    uint32_t which = i >> 1 & 1;
    EXPECT_EQ(b[4][2 * i], 100 * ((i & 1 ? 0 : 2) + which) + 5) << i;
    EXPECT_EQ(b[4][2 * i + 1], 2 - which) << i;
  }
}

TEST(VariablePointers, AroundALoopAndOutOfAFunction) {
  Buffers b = someBuffers();
  runPointers(R"(
%odd_plus = OpIAdd %uint %odd_bit %n2
%start = OpFunctionCall %ptr %pick %odd %pa %pb
OpBranch %head
%head = OpLabel
%p = OpPhi %ptr %start %entry %next %more
%sum = OpPhi %uint %n0 %entry %sum2 %more
%k = OpPhi %uint %n0 %entry %k2 %more
OpLoopMerge %done %more None
OpBranch %body
%body = OpLabel
%c = OpULessThan %bool %k %odd_plus
OpBranchConditional %c %more %done
%more = OpLabel
%v = OpLoad %uint %p
%sum2 = OpIAdd %uint %sum %v
%k2 = OpIAdd %uint %k %n1
%next = OpPtrAccessChain %ptr %p %n2
OpBranch %head
%done = OpLabel
)" + store(0, "%sum") + "%last = OpLoad %uint %p\n" + store(1, "%last"),
              R"(
%pick = OpFunction %ptr None %pickfn
%which = OpFunctionParameter %bool
%x = OpFunctionParameter %ptr
%y = OpFunctionParameter %ptr
%pe = OpLabel
OpSelectionMerge %pm None
OpBranchConditional %which %pt %pf
%pt = OpLabel
OpReturnValue %x
%pf = OpLabel
%y1 = OpPtrAccessChain %ptr %y %n1
OpReturnValue %y1
%pm = OpLabel
OpUnreachable
OpFunctionEnd
)",
              b);
  if (HasFailure()) return;
  for (uint32_t i = 0; i < 32; i++) {
    uint32_t first = i & 1 ? 1000 + i : 2000 + i + 1, steps = (i & 1) + 2, sum = 0;
    for (uint32_t k = 0; k < steps; k++) sum += first + 2 * k;
    EXPECT_EQ(b[2][i * 8], sum) << i;
    EXPECT_EQ(b[2][i * 8 + 1], first + 2 * steps) << i;
  }
}

TEST(VariablePointers, ToWorkGroupMemory) {
  Buffers b = someBuffers();
  runPointers(R"(
%pw1 = OpAccessChain %pwg %wg1 %i
%pw2 = OpAccessChain %pwg %wg2 %i
%pw = OpSelect %pwg %odd %pw1 %pw2
%old = OpAtomicIAdd %uint %pw %n2 %n0 %n5
%four = OpPtrAccessChain %pwg %pw %n4
OpStore %four %n100
OpCopyMemory %pb %four
%v = OpLoad %uint %pw
%v1 = OpLoad %uint %pw1
%length = OpArrayLength %uint %r 0
%d = OpPtrDiff %int %four %pw
%du = OpBitcast %uint %d
%wg0 = OpAccessChain %pwg %wg1 %n0
%is_null = OpPtrEqual %bool %wg0 %null_wg
%null_v = OpLoad %uint %null_wg
%null_r = OpSelect %uint %is_null %n100 %null_v
)" + store(0, "%old") + store(1, "%v") + store(2, "%v1") + store(3, "%length") + store(4, "%du") + store(5, "%null_r"), "", b);
  if (HasFailure()) return;
  for (uint32_t i = 0; i < 32; i++) {
    const uint32_t* r = &b[2][i * 8];
    EXPECT_EQ(r[0], 0u);
    // The lane four to the left stored 100 there in the meantime.
    EXPECT_EQ(r[1], i < 4 ? 5u : 100u) << i;
    EXPECT_EQ(r[2], i & 1 ? (i < 4 ? 5u : 100u) : 0u) << i;
    EXPECT_EQ(r[3], 256u);
    EXPECT_EQ(r[4], 4u);
    EXPECT_EQ(r[5], 0u);
    EXPECT_EQ(b[1][i], 100u);
  }
}

// Row-major matrices: a column's components are a row apart, which a selected pointer must remember.
TEST(VariablePointers, AMatrixColumnKeepsItsLayout) {
  ComputeModule m{.lanes = 8, .buffers = {"%r"}, .namesBuffers = false, .element = "%float", .elementType = "%float = OpTypeFloat 32\n"};
  m.head = "OpCapability VariablePointersStorageBuffer\nOpExtension \"SPV_KHR_variable_pointers\"\n";
  m.decorations = R"(
OpDecorate %block Block
OpMemberDecorate %block 0 Offset 0
OpMemberDecorate %block 0 MatrixStride 16
OpMemberDecorate %block 0 RowMajor
OpMemberDecorate %block 1 Offset 64
OpDecorate %a DescriptorSet 0
OpDecorate %a Binding 1
)";
  m.types = R"(
%vec4 = OpTypeVector %float 4
%mat = OpTypeMatrix %vec4 4
%block = OpTypeStruct %mat %float
%pblock = OpTypePointer StorageBuffer %block
%pvec = OpTypePointer StorageBuffer %vec4
%a = OpVariable %pblock StorageBuffer
)";
  m.body = std::string(kInvocation) + R"(
%odd_bit = OpBitwiseAnd %uint %i %n1
%odd = OpINotEqual %bool %odd_bit %n0
%c1 = OpAccessChain %pvec %a %n0 %n1
%c2 = OpAccessChain %pvec %a %n0 %n2
%c = OpSelect %pvec %odd %c1 %c2
%v = OpLoad %vec4 %c
%p3 = OpAccessChain %ptr %c %n3
%v3 = OpLoad %float %p3
%v2 = OpCompositeExtract %float %v 2
%sum = OpFAdd %float %v2 %v3
%rp = OpAccessChain %ptr %r %n0 %i
OpStore %rp %sum
)";
  Buffers b(2);
  b[0].resize(8);
  for (uint32_t k = 0; k < 17; k++) b[1].push_back(std::bit_cast<uint32_t>(float(k)));
  runAssembly(textOf(m), 1, b);
  if (HasFailure()) return;
  for (uint32_t i = 0; i < 8; i++) {
    float column = i & 1 ? 1 : 2;  // element (row, column) is 4 * row + column
    EXPECT_EQ(std::bit_cast<float>(b[0][i]), 8 + column + 12 + column) << i;
  }
}

TEST(Memory, WorkGroupMemoryStartsAsZero) {
  // glslang writes the null initializer with GL_EXT_null_initializer.
  Buffers b{std::vector<uint32_t>(64, 7)};
  runGlsl(R"(
#extension GL_EXT_null_initializer : require
layout(local_size_x=32) in;
layout(std430, binding=0) buffer R { uint r[]; };
struct S { vec3 v; uint n[4]; bool b; };
shared S s = {};
void main() {
  uint i = gl_LocalInvocationIndex;
  r[gl_GlobalInvocationID.x] = s.n[i & 3] + (s.b ? 1 : 0) + uint(s.v.y);
  s.n[i & 3] = 5;
  s.b = true;
})", 2, b);
  EXPECT_EQ(b[0], std::vector<uint32_t>(64, 0));
}

TEST(Memory, AtomicsOfEveryForm) {
  Buffers b(2);
  b[0].resize(64);
  b[1].resize(32 * 4);
  b[0][1] = 1000;
  b[0][2] = b[0][6] = 0xffffffff;
  b[0][4] = 0xffff;
  b[0][12] = std::bit_cast<uint32_t>(1.5f);
  b[0][13] = std::bit_cast<uint32_t>(8.0f);
  runGlsl(R"(
#extension GL_EXT_shader_atomic_float : require
#extension GL_EXT_shader_atomic_float2 : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_memory_scope_semantics : require
layout(local_size_x=32) in;
layout(std430, binding=0) buffer A { uint u[8]; int s[4]; float f[4]; uint64_t l[4]; double d[2]; };
layout(std430, binding=1) buffer R { uint r[]; };
shared uint w;
void main() {
  uint i = gl_LocalInvocationIndex;
  r[i * 4] = atomicAdd(u[0], 3u);
  atomicAdd(u[1], uint(-2));
  atomicAnd(u[2], ~(1u << i));
  atomicOr(u[3], 1u << i);
  atomicXor(u[4], 1u << (i & 15u));
  atomicMax(u[5], i * 10u);
  atomicMin(u[6], i + 20u);
  r[i * 4 + 1] = atomicExchange(u[7], i + 1u);
  atomicMin(s[0], 3 - int(i));
  atomicMax(s[1], -int(i) + 2);
  uint before = atomicCompSwap(u[7], 32u, 77u);
  atomicAdd(f[0], 0.5);
  atomicMin(f[1], float(i) - 4.0);
  atomicMax(f[2], -float(i));
  f[3] = atomicLoad(f[0], gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
  atomicAdd(l[0], uint64_t(1) << 40);
  atomicMax(l[1], uint64_t(i) << 33);
  atomicAdd(d[0], 0.25lf);
  r[i * 4 + 2] = atomicAdd(w, 2u);
  r[i * 4 + 3] = atomicCompSwap(w, 64u, 5u);
})", 1, b);
  if (HasFailure()) return;
  uint32_t sum = 0, shared = 0, exchanged = 0;
  for (uint32_t i = 0; i < 32; i++) {
    sum += b[1][i * 4];
    exchanged += b[1][i * 4 + 1];
    shared += b[1][i * 4 + 2];
  }
  EXPECT_EQ(sum, 3u * (31 * 32 / 2));
  EXPECT_EQ(shared, 2u * (31 * 32 / 2));
  EXPECT_EQ(exchanged, 31u * 32 / 2) << "each value but the last is seen by the one after it";
  EXPECT_EQ(b[0][0], 96u);
  EXPECT_EQ(b[0][1], 1000u - 64);
  EXPECT_EQ(b[0][2], 0u);
  EXPECT_EQ(b[0][3], 0xffffffff);
  EXPECT_EQ(b[0][4], 0xffffu);
  EXPECT_EQ(b[0][5], 310u);
  EXPECT_EQ(b[0][6], 20u);
  EXPECT_EQ(b[0][7], 77u);
  EXPECT_EQ(int(b[0][8]), -28);
  EXPECT_EQ(int(b[0][9]), 2);
  EXPECT_EQ(std::bit_cast<float>(b[0][12]), 1.5f + 16);
  EXPECT_EQ(std::bit_cast<float>(b[0][13]), -4.0f);
  EXPECT_EQ(std::bit_cast<float>(b[0][14]), 0.0f);
  EXPECT_EQ(std::bit_cast<float>(b[0][15]), 17.5f);
  EXPECT_EQ(b[0][16], 0u);
  EXPECT_EQ(b[0][17], 32u << 8);
  EXPECT_EQ(b[0][19], 31u << 1);
  uint64_t d = b[0][24] | uint64_t(b[0][25]) << 32;
  EXPECT_EQ(std::bit_cast<double>(d), 8.0);
}

// 8- and 16-bit numbers in every kind of memory, their arithmetic and conversions.
TEST(Memory, SmallTypes) {
  Buffers b(2);
  for (uint32_t i = 0; i < 64; i++) b[0].push_back(i * 0x9e3779b9u);
  b[1].resize(64 * 12);
  runGlsl(R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_8bit_storage : require
#extension GL_EXT_shader_16bit_storage : require
layout(local_size_x=64) in;
layout(std430, binding=0) buffer A { u8vec4 a[]; };
layout(std430, binding=0) buffer B { i16vec2 s[]; };
struct R { uint8_t u8; int8_t s8; uint16_t u16; int16_t s16; float16_t f16; u8vec3 v; uint w[9]; };
layout(std430, binding=1) buffer O { R r[]; };
shared int8_t sh[64];
void main() {
  uint i = gl_LocalInvocationIndex;
  u8vec4 x = a[i];
  i16vec2 y = s[i];
  int8_t sx = int8_t(x.x), sy = int8_t(x.y);
  int8_t table[3] = int8_t[](sx, sy, int8_t(i));
  sh[i] = table[i % 3];
  r[i].u8 = x.x + x.y * x.z;
  r[i].s8 = sh[i] / (sy == int8_t(0) ? int8_t(1) : sy);
  r[i].u16 = uint16_t(y.x) * uint16_t(y.y) >> uint16_t(3);
  r[i].s16 = y.x % (y.y | int16_t(1));
  r[i].f16 = float16_t(y.x) * float16_t(0.25) + float16_t(1);
  r[i].v = x.zyx;
  r[i].w[0] = uint(x.x < x.y) | uint(sx < sy) << 1 | uint(y.x <= y.y) << 2;
  r[i].w[1] = uint(int(sx) * int(sy));
  r[i].w[2] = uint(max(sx, sy)) ^ uint(min(x.x, x.y));
  r[i].w[3] = uint(y.x << 3) + uint(y.y >> 2);
  r[i].w[4] = floatBitsToUint(float(r[i].f16));
  r[i].w[5] = uint(uint8_t(float16_t(x.x) * float16_t(0.5)));
  r[i].w[6] = uint(int8_t(-float(x.x) * 0.4));
  r[i].w[7] = uint(abs(y.x)) + uint(sign(y.y));
  r[i].w[8] = uint(~x.x) + (uint(x.y ^ x.z) << 8);
})", 1, b);
  if (HasFailure()) return;
  for (uint32_t i = 0; i < 64; i++) {
    uint32_t word = b[0][i];
    uint8_t x[4];
    int16_t y[2];
    std::memcpy(x, &word, 4);
    std::memcpy(y, &word, 4);
    auto sx = int8_t(x[0]), sy = int8_t(x[1]);
    int8_t table[3] = {sx, sy, int8_t(i)};
    const auto* r = reinterpret_cast<const uint8_t*>(&b[1][i * 12]);
    auto half = [&](const void* p) {
      uint16_t h;
      std::memcpy(&h, p, 2);
      int exponent = h >> 10 & 31;
      double m = exponent ? 1 + (h & 1023) / 1024.0 : (h & 1023) / 1024.0;
      return (h & 0x8000 ? -1 : 1) * std::ldexp(m, exponent ? exponent - 15 : -14);
    };
    auto load16 = [&](int at) { return uint16_t(r[at] | r[at + 1] << 8); };
    EXPECT_EQ(r[0], uint8_t(x[0] + x[1] * x[2]));
    EXPECT_EQ(int8_t(r[1]), int8_t(table[i % 3] / (sy == 0 ? 1 : sy))) << i;
    EXPECT_EQ(load16(2), uint16_t(uint16_t(uint16_t(y[0]) * uint32_t(uint16_t(y[1]))) >> 3));
    int divisor = y[1] | 1;  // GLSL leaves it open which remainder `%` is; it comes as OpSMod
    EXPECT_EQ(int16_t(load16(4)), int16_t((y[0] % divisor + divisor) % divisor)) << i;
    double rounded = y[0];  // to half precision first: 11 bits
    if (std::abs(rounded) >= 2048) {
      int e = std::ilogb(rounded) - 10;
      rounded = std::ldexp(std::nearbyint(std::ldexp(rounded, -e)), e);
    }
    EXPECT_NEAR(half(r + 6), rounded * 0.25 + 1, std::abs(rounded) / 8000 + 0.0005) << i;
    EXPECT_EQ(r[8], x[2]);
    EXPECT_EQ(r[9], x[1]);
    EXPECT_EQ(r[10], x[0]);
    const uint32_t* w = &b[1][i * 12 + 3];
    EXPECT_EQ(w[0], uint32_t(x[0] < x[1]) | uint32_t(sx < sy) << 1 | uint32_t(y[0] <= y[1]) << 2);
    EXPECT_EQ(w[1], uint32_t(int(sx) * int(sy)));
    EXPECT_EQ(w[2], uint32_t(int(std::max(sx, sy))) ^ uint32_t(std::min(x[0], x[1])));
    EXPECT_EQ(w[3], uint32_t(int(int16_t(uint32_t(y[0]) << 3))) + uint32_t(int(y[1] >> 2))) << i;
    EXPECT_EQ(std::bit_cast<float>(w[4]), float(half(r + 6)));
    EXPECT_EQ(w[5], x[0] / 2u);
    EXPECT_EQ(int(w[6]), std::max(-128, int(-float(x[0]) * 0.4f)));
    EXPECT_EQ(w[7], uint32_t(std::abs(int(y[0]))) + uint32_t((y[1] > 0) - (y[1] < 0)));
    EXPECT_EQ(w[8], uint32_t(uint8_t(~x[0])) + (uint32_t(x[1] ^ x[2]) << 8));
  }
}

}  // namespace
}  // namespace pumice::frontend
