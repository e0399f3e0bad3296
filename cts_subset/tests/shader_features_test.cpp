// Features of shaders, each through a compute shader whose results are computed here too: types, memory, descriptors.
#include "cts_subset/tests/compute.h"
#include "tests/support/compute_module.h"

#include <bit>
#include <cmath>
#include <numeric>

namespace pumice::cts {
namespace {

class ShaderFeatures : public ComputeTest {};

constexpr size_t kLanes = 64;

std::vector<uint64_t> wideNumbers() {
  std::vector<uint64_t> v;
  uint64_t state = 88172645463325252ull;
  for (size_t i = 0; i < 2 * kLanes; i++) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    v.push_back(i % 5 == 0 ? state >> 40 : i % 7 == 0 ? ~(state >> 50) : state);
  }
  v[0] = v[1] = ~0ull;
  v[2] = 0, v[3] = 1ull << 63;
  return v;
}

TEST_P(ShaderFeatures, Int64) {
  PUMICE_NEED_FEATURE(device().features.shaderInt64);
  const std::vector<uint64_t> in = wideNumbers();
  std::vector<uint64_t> expected;
  for (size_t i = 0; i < kLanes; i++) {
    uint64_t x = in[2 * i], y = in[2 * i + 1] | 1;
    int64_t sx = int64_t(x), sy = int64_t(y) == -1 ? 3 : int64_t(y);
    expected.insert(expected.end(), {x + y, x * y, x / y, uint64_t(sx / sy), x >> (y & 63), uint64_t(sx >> (y & 63)), uint64_t(x < y) | uint64_t(sx < sy) << 1,
                                     x % y, uint64_t(double(float(uint32_t(x))) > 0), uint64_t(uint32_t(x ^ y))});
  }
  expect(valuesOf<uint64_t>(runCompute(device(), R"(
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { uint64_t a[]; };
layout(binding = 1) buffer Out { uint64_t r[]; };
void main() {
  uint i = gl_GlobalInvocationID.x, o = i * 10;
  uint64_t x = a[2 * i], y = a[2 * i + 1] | 1ul;
  int64_t sx = int64_t(x), sy = int64_t(y) == -1l ? 3l : int64_t(y);
  r[o] = x + y; r[o + 1] = x * y; r[o + 2] = x / y; r[o + 3] = uint64_t(sx / sy);
  r[o + 4] = x >> (y & 63ul); r[o + 5] = uint64_t(sx >> (y & 63ul));
  r[o + 6] = (x < y ? 1ul : 0ul) | (sx < sy ? 2ul : 0ul); r[o + 7] = x % y;
  r[o + 8] = float(uint(x)) > 0 ? 1ul : 0ul; r[o + 9] = uint64_t(uint(x ^ y));
})", wordsOf(in), kLanes * 20)), expected);
}

TEST_P(ShaderFeatures, Int16AndInt8) {
  PUMICE_NEED_FEATURE(device().features.shaderInt16 && device().vulkan12.shaderInt8 && device().vulkan12.storageBuffer8BitAccess &&
                      device().vulkan11.storageBuffer16BitAccess);
  std::vector<uint16_t> in;
  for (uint32_t i = 0; i < 2 * kLanes; i++) in.push_back(uint16_t(i * 40503u + 77));
  std::vector<uint16_t> expected;
  for (size_t i = 0; i < kLanes; i++) {
    uint16_t x = in[2 * i], y = uint16_t(in[2 * i + 1] | 1);
    int16_t sx = int16_t(x), sy = int16_t(y) == -1 ? int16_t(3) : int16_t(y);
    uint8_t b = uint8_t(x), c = uint8_t(y);
    int8_t sb = int8_t(b), sc = int8_t(c);
    expected.insert(expected.end(), {uint16_t(x + y), uint16_t(x * y), uint16_t(x / y), uint16_t(sx / sy), uint16_t(sx >> (y & 15)),
                                     uint16_t(sx < sy), uint16_t(uint8_t(b + c) | uint8_t(b * c) << 8), uint16_t(uint8_t(sb >> (c & 7)) | (sb < sc ? 256 : 0))});
  }
  expect(valuesOf<uint16_t>(runCompute(device(), R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_8bit_storage : require
#extension GL_EXT_shader_16bit_storage : require
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { uint16_t a[]; };
layout(binding = 0) readonly buffer InBytes { uint8_t bytes[]; };
layout(binding = 1) buffer Out { uint16_t r[]; };
void main() {
  uint i = gl_GlobalInvocationID.x, o = i * 8;
  uint16_t x = a[2 * i], y = a[2 * i + 1] | 1us;
  int16_t sx = int16_t(x), sy = int16_t(y) == -1s ? 3s : int16_t(y);
  uint8_t b = bytes[4 * i], c = uint8_t(y);
  int8_t sb = int8_t(b), sc = int8_t(c);
  r[o] = x + y; r[o + 1] = x * y; r[o + 2] = x / y; r[o + 3] = uint16_t(sx / sy); r[o + 4] = uint16_t(sx >> (y & 15us));
  r[o + 5] = sx < sy ? 1us : 0us;
  r[o + 6] = uint16_t(uint8_t(b + c)) | (uint16_t(uint8_t(b * c)) << 8us);
  r[o + 7] = uint16_t(uint8_t(sb >> (c & uint8_t(7)))) | (sb < sc ? 256us : 0us);
})", wordsOf(in), kLanes * 4)), expected);
}

TEST_P(ShaderFeatures, Float16) {
  PUMICE_NEED_FEATURE(device().vulkan12.shaderFloat16 && device().vulkan11.storageBuffer16BitAccess);
  std::vector<_Float16> in;
  for (uint32_t i = 0; i < 2 * kLanes; i++) in.push_back(_Float16(float(int(i * 7919 % 4001) - 2000) / 64.0f));
  std::vector<uint16_t> expected;
  for (size_t i = 0; i < kLanes; i++) {
    _Float16 x = in[2 * i], y = in[2 * i + 1];
    auto bits = [](_Float16 v) { return std::bit_cast<uint16_t>(v); };
    expected.insert(expected.end(), {bits(x + y), bits(x - y), bits(x * y), uint16_t(x < y), bits(_Float16(float(x) * 1.25f)), uint16_t(int16_t(int(x)))});
  }
  expect(valuesOf<uint16_t>(runCompute(device(), R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_16bit_storage : require
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { float16_t a[]; };
layout(binding = 1) buffer Out { uint16_t r[]; };
void main() {
  uint i = gl_GlobalInvocationID.x, o = i * 6;
  float16_t x = a[2 * i], y = a[2 * i + 1];
  r[o] = float16BitsToUint16(x + y); r[o + 1] = float16BitsToUint16(x - y); r[o + 2] = float16BitsToUint16(x * y);
  r[o + 3] = x < y ? 1us : 0us; r[o + 4] = float16BitsToUint16(float16_t(float(x) * 1.25)); r[o + 5] = uint16_t(int16_t(x));
})", wordsOf(in), kLanes * 3)), expected);
}

TEST_P(ShaderFeatures, Float64) {
  PUMICE_NEED_FEATURE(device().features.shaderFloat64);
  std::vector<double> in;
  for (uint32_t i = 0; i < 2 * kLanes; i++) in.push_back((double(i * 2654435761u % 100003) + 0.1) / 777.0);
  std::vector<double> expected;
  for (size_t i = 0; i < kLanes; i++) {
    double x = in[2 * i], y = -in[2 * i + 1];
    expected.insert(expected.end(), {x + y, x * y, x / y, std::sqrt(x), double(float(x)), double(int32_t(y)), x < -y ? std::floor(x) : std::fabs(y)});
  }
  expect(valuesOf<double>(runCompute(device(), R"(
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { double a[]; };
layout(binding = 1) buffer Out { double r[]; };
void main() {
  uint i = gl_GlobalInvocationID.x, o = i * 7;
  double x = a[2 * i], y = -a[2 * i + 1];
  r[o] = x + y; r[o + 1] = x * y; r[o + 2] = x / y; r[o + 3] = sqrt(x); r[o + 4] = double(float(x)); r[o + 5] = double(int(y));
  r[o + 6] = x < -y ? floor(x) : abs(y);
})", wordsOf(in), kLanes * 14)), expected);
}

TEST_P(ShaderFeatures, SmallTypesInUniformBuffersAndPushConstants) {
  PUMICE_NEED_FEATURE(device().vulkan12.uniformAndStorageBuffer8BitAccess && device().vulkan11.uniformAndStorageBuffer16BitAccess &&
                      device().vulkan12.storagePushConstant8 && device().vulkan11.storagePushConstant16);
  ComputeSpec spec;
  spec.uniform = {0x04030201, 0xfffe8081, 0x3c00c000};
  spec.push = {1, 0xff, 0x34, 0x12, 0x00, 0x3e, 0, 0};   // 1, -1, 0x1234, 1.5
  expect(runCompute(device(), R"(
#extension GL_EXT_shader_8bit_storage : require
#extension GL_EXT_shader_16bit_storage : require
layout(local_size_x = 1) in;
layout(binding = 1) buffer Out { uint r[]; };
layout(binding = 2) uniform U { uint8_t a, b, c, d; int8_t e, f; uint16_t g; float16_t h, k; };
layout(push_constant) uniform P { uint8_t p; int8_t q; uint16_t s; float16_t t; };
void main() {
  r[0] = uint(a) + uint(b) * 10 + uint(c) * 100 + uint(d) * 1000;
  r[1] = uint(int(e)); r[2] = uint(int(f)); r[3] = uint(g); r[4] = floatBitsToUint(float(h)); r[5] = floatBitsToUint(float(k));
  r[6] = uint(p); r[7] = uint(int(q)); r[8] = uint(s); r[9] = floatBitsToUint(float(t));
})", Words(1), 10, spec), Words{4321, 0xffffff81, 0xffffff80, 0xfffe, 0xc0000000, 0x3f800000, 1, 0xffffffff, 0x1234, 0x3fc00000});
}

TEST_P(ShaderFeatures, Int64Atomics) {
  PUMICE_NEED_FEATURE(device().features.shaderInt64 && device().vulkan12.shaderBufferInt64Atomics && device().vulkan12.shaderSharedInt64Atomics);
  std::vector<uint64_t> r = valuesOf<uint64_t>(runCompute(device(), R"(
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
layout(local_size_x = 64) in;
layout(binding = 0) buffer In { uint64_t sum, largest, bits; int64_t smallest; };
layout(binding = 1) buffer Out { uint64_t r[]; };
shared uint64_t total;
void main() {
  uint i = gl_LocalInvocationIndex;
  if (i == 0) total = 0ul;
  barrier();
  uint64_t v = (uint64_t(i) << 33) + 5ul;
  atomicAdd(sum, v); atomicMax(largest, v); atomicOr(bits, 1ul << i); atomicMin(smallest, int64_t(i) - 40l);
  atomicAdd(total, v);
  barrier();
  memoryBarrierBuffer();
  if (i == 0) {
    r[0] = sum; r[1] = largest; r[2] = bits; r[3] = uint64_t(smallest); r[4] = total;
    r[5] = atomicCompSwap(sum, sum, 7ul); r[6] = atomicExchange(sum, 9ul); r[7] = sum;
  }
})", Words(8), 16));
  uint64_t sum = (uint64_t(63 * 64 / 2) << 33) + 5 * 64;
  expect(r, std::vector<uint64_t>{sum, (uint64_t(63) << 33) + 5, ~0ull, uint64_t(-40), sum, sum, 7, 9});
}

TEST_P(ShaderFeatures, ScalarAndStandardBlockLayouts) {
  PUMICE_NEED_FEATURE(device().vulkan12.scalarBlockLayout && device().vulkan12.uniformBufferStandardLayout);
  ComputeSpec spec;
  spec.uniform.resize(16);
  std::iota(spec.uniform.begin(), spec.uniform.end(), 100u);
  Words in(16);
  std::iota(in.begin(), in.end(), 0u);
  expect(runCompute(device(), R"(
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 1) in;
struct S { uint a; uvec3 b; };
layout(binding = 0, scalar) readonly buffer In { S s[2]; uvec3 tail[]; };
layout(binding = 1) buffer Out { uint r[]; };
layout(binding = 2, std430) uniform U { uint dense[4]; uint after; };
void main() {
  r[0] = s[0].b.z; r[1] = s[1].a; r[2] = s[1].b.x; r[3] = tail[1].y; r[4] = dense[3]; r[5] = after;
})", in, 6, spec), Words{3, 4, 5, 12, 103, 104});
  expect(runCompute(device(), R"(
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 1) in;
layout(binding = 1) buffer Out { uint r[]; };
layout(binding = 2, scalar) uniform U { uvec3 v[3]; uint after; };
void main() { r[0] = v[1].x; r[1] = v[2].z; r[2] = after; }
)", in, 3, spec), Words{103, 108, 109});
}

TEST_P(ShaderFeatures, BufferDeviceAddress) {
  PUMICE_NEED_FEATURE(device().vulkan12.bufferDeviceAddress && device().features.shaderInt64);
  Workspace work(device());
  const auto [address, mapped] = addressedBuffer(work, 4096);
  ASSERT_NE(address, 0u);
  // A chain of nodes in strange order: value, padding, address of the next.
  struct Node {
    uint32_t value, pad;
    uint64_t next;
  };
  auto* nodes = static_cast<Node*>(mapped);
  uint32_t at = 0, sum = 0;
  for (uint32_t i = 0; i < 40; i++) {
    uint32_t next = (at + 37) % 97;
    nodes[at] = {i * i, 0, i == 39 ? 0 : address + next * sizeof(Node)};
    sum += i * i;
    at = next;
  }
  expect(runCompute(device(), R"(
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 1) in;
layout(buffer_reference) buffer Node;
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Node { uint value, pad; uint64_t next; };
layout(binding = 0) readonly buffer In { uint64_t first; };
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint sum = 0, count = 0;
  for (uint64_t p = first; p != 0ul; p = Node(p).next) { sum += Node(p).value; count++; }
  Node(first).pad = count;
  r[0] = sum; r[1] = count;
})", wordsOf(std::vector<uint64_t>{address}), 2), Words{sum, 40});
  EXPECT_EQ(nodes[0].pad, 40u) << "written through an address";
}

TEST_P(ShaderFeatures, VulkanMemoryModel) {
  PUMICE_NEED_FEATURE(device().vulkan12.vulkanMemoryModel && device().vulkan12.vulkanMemoryModelDeviceScope);
  // Each invocation publishes a value and then the flag of it; the next one waits for the flag in turn.
  ComputeSpec spec;
  spec.groups = 1;
  expect(runCompute(device(), R"(
#pragma use_vulkan_memory_model
#extension GL_KHR_memory_scope_semantics : require
layout(local_size_x = 64) in;
layout(binding = 0) workgroupcoherent buffer In { uint value[64]; uint flag[64]; };
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint i = gl_LocalInvocationIndex;
  value[i] = i * 3 + 1;
  atomicStore(flag[i], 1u, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsRelease);
  controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsAcquireRelease);
  uint other = (i + 17) % 64;
  uint seen = atomicLoad(flag[other], gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsAcquire);
  r[i] = seen * value[other];
})", Words(128), 64, spec), [] {
    Words e;
    for (uint32_t i = 0; i < 64; i++) e.push_back((i + 17) % 64 * 3 + 1);
    return e;
  }());
}

// A value passes from one invocation to another of its group, which passes it on to the other group: made available by the
// first and visible by the last, with the one in the middle doing nothing about it but handing on the flag.
TEST_P(ShaderFeatures, AvailabilityAndVisibilityChains) {
  PUMICE_NEED_FEATURE(device().vulkan12.vulkanMemoryModelAvailabilityVisibilityChains && device().vulkan12.vulkanMemoryModelDeviceScope);
  ComputeSpec spec;
  spec.groups = 128;
  Words r = runCompute(device(), R"(
#pragma use_vulkan_memory_model
#extension GL_KHR_memory_scope_semantics : require
layout(local_size_x = 2) in;
layout(binding = 0) nonprivate buffer In { uint value[64]; uint near[64]; uint far[64]; };
layout(binding = 1) buffer Out { uint r[]; };
void main() {
  uint pair = gl_WorkGroupID.x / 2, i = gl_LocalInvocationIndex;
  if ((gl_WorkGroupID.x & 1) == 0) {
    if (i == 0) {
      value[pair] = 7000 + pair;
      atomicStore(near[pair], 1u, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsRelease | gl_SemanticsMakeAvailable);
    } else {
      uint seen = 0;
      for (uint turns = 0; turns < 100000 && seen == 0; turns++) seen = atomicLoad(near[pair], gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsAcquire);
      if (seen != 0) atomicStore(far[pair], 1u, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelease | gl_SemanticsMakeAvailable);
    }
  } else if (i == 0) {
    // The other group need not have run: then nothing is said.
    uint seen = 0;
    for (uint turns = 0; turns < 1000 && seen == 0; turns++)
      seen = atomicLoad(far[pair], gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsAcquire | gl_SemanticsMakeVisible);
    r[pair] = seen != 0 ? value[pair] : 0;
  }
})", Words(192), 64, spec);
  uint32_t told = 0;
  for (uint32_t i = 0; i < 64; i++) {
    EXPECT_TRUE(r[i] == 0 || r[i] == 7000 + i) << i << ": " << r[i];
    told += r[i] != 0;
  }
  if (GetParam() == Role::kTested) {
    EXPECT_GT(told, 0u) << "no chain was ever complete";
  }
}

TEST_P(ShaderFeatures, ZeroInitializedWorkgroupMemory) {
  PUMICE_NEED_FEATURE(device().vulkan13.shaderZeroInitializeWorkgroupMemory);
  ComputeSpec spec;
  spec.groups = 32;   // later groups find what earlier ones left
  expect(runCompute(device(), R"(
#extension GL_EXT_null_initializer : require
layout(local_size_x = 64) in;
layout(binding = 1) buffer Out { uint r[]; };
shared uint a[256] = {};
void main() {
  uint bits = 0;
  for (uint k = gl_LocalInvocationIndex; k < 256; k += 64) { bits |= a[k]; a[k] = 0xdeadbeefu; }
  r[gl_GlobalInvocationID.x] = bits;
})", Words(1), 64 * 32, spec), Words(64 * 32, 0));
}

TEST_P(ShaderFeatures, FloatAtomicsOfLeastAndGreatest) {
  const auto& f = device().atomicFloat2;
  PUMICE_NEED_FEATURE(f.shaderBufferFloat32AtomicMinMax && f.shaderSharedFloat32AtomicMinMax && f.shaderBufferFloat64AtomicMinMax &&
                      f.shaderSharedFloat64AtomicMinMax && device().features.shaderFloat64);
  Words in = wordsOf(std::vector<double>{0, 1e9, -1e9});
  std::memcpy(&in[0], (const float[2]){1e9f, -1e9f}, 8);
  std::vector<double> r = valuesOf<double>(runCompute(device(), R"(
#extension GL_EXT_shader_atomic_float2 : require
layout(local_size_x = 64) in;
layout(binding = 0) buffer In { float least, greatest; double wideLeast, wideGreatest; };
layout(binding = 1) buffer Out { double r[]; };
shared float a, c;
shared double b, e;
void main() {
  if (gl_LocalInvocationIndex == 0) { a = c = 0.25; b = e = 0.25LF; }
  barrier();
  float x = float(int(gl_LocalInvocationIndex * 37 % 64) - 20) * 0.5;
  double y = double(x) * 1.000000000001LF;
  atomicMin(least, x); atomicMax(greatest, x); atomicMin(wideLeast, y); atomicMax(wideGreatest, y);
  atomicMin(a, x); atomicMax(c, x); atomicMin(b, y); atomicMax(e, y);
  barrier();
  memoryBarrierBuffer();
  if (gl_LocalInvocationIndex == 0) {
    r[0] = double(least); r[1] = double(greatest); r[2] = wideLeast; r[3] = wideGreatest;
    r[4] = double(a); r[5] = double(c); r[6] = b; r[7] = e;
  }
})", in, 16));
  const double low = -10 * 1.000000000001, high = 21.5 * 1.000000000001;
  expect(r, std::vector<double>{-10, 21.5, low, high, -10, 21.5, low, high});
}

TEST_P(ShaderFeatures, FloatAtomics) {
  const auto& f = device().atomicFloat;
  PUMICE_NEED_FEATURE(f.shaderBufferFloat32AtomicAdd && f.shaderSharedFloat32AtomicAdd && f.shaderBufferFloat64AtomicAdd && f.shaderSharedFloat64AtomicAdd &&
                      f.shaderBufferFloat32Atomics && f.shaderBufferFloat64Atomics && f.shaderSharedFloat32Atomics && f.shaderSharedFloat64Atomics);
  Words in = wordsOf(std::vector<double>{0, 2.5, 0});
  std::vector<double> r = valuesOf<double>(runCompute(device(), R"(
#pragma use_vulkan_memory_model
#extension GL_KHR_memory_scope_semantics : require
#extension GL_EXT_shader_atomic_float : require
layout(local_size_x = 64) in;
layout(binding = 0) buffer In { float sum, last; double wide, lastWide; };
layout(binding = 1) buffer Out { double r[]; };
shared float a, c;
shared double b, e;
void main() {
  if (gl_LocalInvocationIndex == 0) { a = 1.0; b = 3.0LF; }
  barrier();
  atomicAdd(sum, 0.5); atomicAdd(wide, 0.25LF); atomicAdd(a, float(gl_LocalInvocationIndex)); atomicAdd(b, 0.125LF);
  atomicExchange(last, 7.0); atomicExchange(lastWide, 8.0LF); atomicExchange(c, 9.0); atomicExchange(e, 10.0LF);
  barrier();
  memoryBarrierBuffer();
  if (gl_LocalInvocationIndex == 0) {
    r[0] = double(sum); r[1] = wide; r[2] = double(a); r[3] = b; r[4] = double(last); r[5] = lastWide; r[6] = double(c); r[7] = e;
    atomicStore(c, 11.5, gl_ScopeWorkgroup, 0, 0); atomicStore(e, 12.5LF, gl_ScopeWorkgroup, 0, 0);
    atomicStore(sum, 13.5, gl_ScopeWorkgroup, 0, 0); atomicStore(wide, 14.5LF, gl_ScopeWorkgroup, 0, 0);
    r[8] = double(atomicLoad(c, gl_ScopeWorkgroup, 0, 0)); r[9] = atomicLoad(e, gl_ScopeWorkgroup, 0, 0);
    r[10] = double(atomicLoad(sum, gl_ScopeWorkgroup, 0, 0)); r[11] = atomicLoad(wide, gl_ScopeWorkgroup, 0, 0);
  }
})", in, 24));
  expect(r, std::vector<double>{32, 18.5, 2017, 11, 7, 8, 9, 10, 11.5, 12.5, 13.5, 14.5});
}

// What GLSL cannot say: pointers that differ from lane to lane, into two buffers and into work-group memory.
TEST_P(ShaderFeatures, VariablePointers) {
  PUMICE_NEED_FEATURE(device().vulkan11.variablePointers);
  Words in(128);
  std::iota(in.begin(), in.end(), 1000u);
  test::ComputeModule m{.head = "OpCapability VariablePointers\n", .buffers = {"%in", "%out"}, .interface = "%shared"};
  m.decorations = "OpDecorate %ptr ArrayStride 4\n";
  m.types = R"(
%n63 = OpConstant %uint 63
%n64 = OpConstant %uint 64
%n264 = OpConstant %uint 264
%sarray = OpTypeArray %uint %n64
%sarrayp = OpTypePointer Workgroup %sarray
%selement = OpTypePointer Workgroup %uint
%shared = OpVariable %sarrayp Workgroup
)";
  m.body = test::kInvocation + std::string(R"(
%mine = OpAccessChain %selement %shared %i
%tripled = OpIMul %uint %i %n3
OpStore %mine %tripled
OpControlBarrier %n2 %n2 %n264
%back = OpISub %uint %n63 %i
%a = OpAccessChain %ptr %in %n0 %back
%b = OpAccessChain %ptr %out %n0 %i
%bit = OpBitwiseAnd %uint %i %n1
%odd = OpIEqual %bool %bit %n1
%p = OpSelect %ptr %odd %a %b
%q = OpPtrAccessChain %ptr %p %n0
%v = OpLoad %uint %q
%sa = OpAccessChain %selement %shared %back
%sb = OpAccessChain %selement %shared %n0
%sp = OpSelect %selement %odd %sa %sb
%sv = OpLoad %uint %sp
%sum = OpIAdd %uint %v %sv
%place = OpIAdd %uint %i %n64
%target = OpAccessChain %ptr %out %n0 %place
OpStore %target %sum
)");
  Words r = runCompute(device(), assemble(textOf(m)), in, 128);
  Words expected;
  for (uint32_t i = 0; i < 64; i++) expected.push_back(i % 2 ? 1000 + 63 - i + 3 * (63 - i) : 0xcdcdcdcd);
  expect(Words(r.begin() + 64, r.end()), expected);
}

TEST_P(ShaderFeatures, IntegerDotProduct) {
  PUMICE_NEED_FEATURE(device().vulkan13.shaderIntegerDotProduct && device().vulkan12.shaderInt8);
  Words in = {0x80ff7f01, 0x02037ffe, 0x7fffffff, 0xffffffff};
  test::ComputeModule m{.lanes = 1, .buffers = {"%in", "%out"}};
  m.head = R"(
OpCapability Int8
OpCapability DotProduct
OpCapability DotProductInput4x8Bit
OpCapability DotProductInput4x8BitPacked
OpExtension "SPV_KHR_integer_dot_product"
)";
  m.types = "%char = OpTypeInt 8 1\n%c4 = OpTypeVector %char 4\n";
  m.body = R"(
%pa = OpAccessChain %ptr %in %n0 %n0
%a = OpLoad %uint %pa
%pb = OpAccessChain %ptr %in %n0 %n1
%b = OpLoad %uint %pb
%pc = OpAccessChain %ptr %in %n0 %n2
%c = OpLoad %uint %pc
%pd = OpAccessChain %ptr %in %n0 %n3
%d = OpLoad %uint %pd
%s = OpSDot %int %a %b PackedVectorFormat4x8Bit
%su = OpBitcast %uint %s
%o0 = OpAccessChain %ptr %out %n0 %n0
OpStore %o0 %su
%u = OpUDot %uint %a %b PackedVectorFormat4x8Bit
%o1 = OpAccessChain %ptr %out %n0 %n1
OpStore %o1 %u
%va = OpBitcast %c4 %a
%vb = OpBitcast %c4 %b
%m = OpSUDot %int %va %vb
%mu = OpBitcast %uint %m
%o2 = OpAccessChain %ptr %out %n0 %n2
OpStore %o2 %mu
%big = OpBitcast %int %c
%t = OpSDotAccSat %int %a %a %big PackedVectorFormat4x8Bit
%tu = OpBitcast %uint %t
%o3 = OpAccessChain %ptr %out %n0 %n3
OpStore %o3 %tu
%us = OpUDotAccSat %uint %a %b %d PackedVectorFormat4x8Bit
%o4 = OpAccessChain %ptr %out %n0 %n4
OpStore %o4 %us
)";
  Words r = runCompute(device(), assemble(textOf(m)), in, 5);
  int32_t sdot = 0, sudot = 0;
  uint32_t udot = 0;
  for (int i = 0; i < 4; i++) {
    uint8_t a = uint8_t(in[0] >> 8 * i), b = uint8_t(in[1] >> 8 * i);
    sdot += int8_t(a) * int8_t(b), udot += a * b, sudot += int8_t(a) * b;
  }
  expect(r, Words{uint32_t(sdot), udot, uint32_t(sudot), 0x7fffffff, 0xffffffff});
}

// Arrays indexed differently by neighbours, with descriptors of different formats, holes, a variable count, written after
// the set was bound.
TEST_P(ShaderFeatures, DescriptorIndexing) {
  const auto& f = device().vulkan12;
  PUMICE_NEED_FEATURE(f.descriptorIndexing && f.descriptorBindingVariableDescriptorCount && f.descriptorBindingPartiallyBound && f.runtimeDescriptorArray &&
                      f.shaderStorageBufferArrayNonUniformIndexing && f.shaderUniformTexelBufferArrayNonUniformIndexing &&
                      f.shaderSampledImageArrayNonUniformIndexing && f.descriptorBindingSampledImageUpdateAfterBind);
  constexpr uint32_t kBuffers = 40, kImages = 150, kMost = 400;
  Workspace work(device());
  std::vector<VkDescriptorSetLayoutBinding> bindings = {
      computeBinding(0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, kBuffers),
      computeBinding(2, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, kBuffers), computeBinding(3, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, kMost)};
  constexpr VkDescriptorBindingFlags kFlags = VK_DESCRIPTOR_BINDING_UPDATE_AFTER_BIND_BIT | VK_DESCRIPTOR_BINDING_PARTIALLY_BOUND_BIT;
  const VkDescriptorBindingFlags flags[4] = {kFlags, kFlags, kFlags, kFlags | VK_DESCRIPTOR_BINDING_VARIABLE_DESCRIPTOR_COUNT_BIT};
  VkDescriptorSetLayoutBindingFlagsCreateInfo flagsInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO, nullptr, 4, flags};
  VkDescriptorSetLayout setLayout = makeSetLayout(work, bindings, VK_DESCRIPTOR_SET_LAYOUT_CREATE_UPDATE_AFTER_BIND_POOL_BIT, &flagsInfo);
  VkPipelineLayout layout = makePipelineLayout(work, {setLayout});
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 460
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_EXT_samplerless_texture_functions : require
layout(local_size_x = 64) in;
layout(binding = 0) buffer Out { uint r[]; };
layout(binding = 1) readonly buffer B { uint v; } buffers[];
layout(binding = 2) uniform utextureBuffer texels[40];
layout(binding = 3) uniform utexture2D images[];
void main() {
  uint i = gl_LocalInvocationIndex, k = (i * 7) % 150;
  if (k % 5 == 0) k++;
  r[i] = buffers[nonuniformEXT((i * 7) % 40)].v + texelFetch(texels[nonuniformEXT(i % 40)], 1).x * 1000 +
         texelFetch(images[nonuniformEXT(k)], ivec2(1, 2), 0).x * 1000000;
}
)", ShaderTarget::kVulkan13), layout);
  VkDescriptorPool pool = makePool(work, {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1 + kBuffers}, {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, kBuffers}, {VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, kImages}},
                                   1, VK_DESCRIPTOR_POOL_CREATE_UPDATE_AFTER_BIND_BIT);
  VkDescriptorSetVariableDescriptorCountAllocateInfo count{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_VARIABLE_DESCRIPTOR_COUNT_ALLOCATE_INFO, nullptr, 1, &kImages};
  VkDescriptorSet set = makeSet(work, pool, setLayout, &count);

  Buffer out = work.bufferOf(Words(64, 0), kStorage);
  std::vector<VkDescriptorBufferInfo> bufferInfos;
  std::vector<VkBufferView> views;
  for (uint32_t k = 0; k < kBuffers; k++) {
    bufferInfos.push_back({work.bufferOf(Words{k}, kStorage).handle, 0, VK_WHOLE_SIZE});
    // Two formats: 32 bits, and 16 bits with the second texel in the high half.
    Buffer texels = work.bufferOf(k % 2 ? Words{k << 16, 9} : Words{77, k}, VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT);
    VkBufferViewCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO, nullptr, 0, texels.handle, k % 2 ? VK_FORMAT_R16_UINT : VK_FORMAT_R32_UINT, 0, VK_WHOLE_SIZE};
    VkBufferView view = work.make(info);
    views.push_back(view);
  }
  std::vector<Image> images;
  std::vector<VkDescriptorImageInfo> imageInfos;
  for (uint32_t k = 0; k < kImages; k++) {
    ImageSpec spec;
    spec.format = k % 2 ? VK_FORMAT_R8_UINT : VK_FORMAT_R32_UINT;
    spec.extent = {4, 4, 1};
    spec.usage |= VK_IMAGE_USAGE_SAMPLED_BIT;
    images.push_back(work.image(spec));
    imageInfos.push_back({VK_NULL_HANDLE, work.view(images.back()), VK_IMAGE_LAYOUT_GENERAL});
  }
  VkDescriptorBufferInfo outInfo{out.handle, 0, VK_WHOLE_SIZE};
  device().run([&](VkCommandBuffer commands) {
    for (uint32_t k = 0; k < kImages; k++) {
      transition(commands, images[k], VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
      VkClearColorValue value{};
      value.uint32[0] = k;
      VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      vkCmdClearColorImage(commands, images[k].handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &range);
    }
    fullBarrier(commands);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
    vkCmdDispatch(commands, 1, 1, 1);
    fullBarrier(commands);
    std::vector<VkWriteDescriptorSet> writes = {writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &outInfo),
                                                writeBuffer(set, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, bufferInfos.data(), 0, kBuffers),
                                                writeBuffer(set, 2, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, nullptr, 0, kBuffers)};
    writes[2].pTexelBufferView = views.data();
    for (uint32_t k = 0; k < kImages; k++) {
      if (k % 5 == 0) continue;
      writes.push_back(writeBuffer(set, 3, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, nullptr, k));
      writes.back().pImageInfo = &imageInfos[k];
    }
    vkUpdateDescriptorSets(device().handle, uint32_t(writes.size()), writes.data(), 0, nullptr);
  });
  Words expected;
  for (uint32_t i = 0; i < 64; i++) {
    uint32_t k = i * 7 % 150;
    if (k % 5 == 0) k++;
    expected.push_back(i * 7 % 40 + i % 40 * 1000 + k * 1000000);
  }
  expect(valuesOf<uint32_t>(wordsOf(bytesOf(out))), expected);
}

PUMICE_ON_BOTH_DEVICES(ShaderFeatures);

}  // namespace
}  // namespace pumice::cts
