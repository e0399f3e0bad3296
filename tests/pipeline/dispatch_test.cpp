// Compute: ids, groups that share rows, shared memory, barriers.
#include <gtest/gtest.h>

#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

struct Compute {
  std::vector<uint32_t> data;
  std::array<std::byte, 32> set{};
  std::shared_ptr<Layout> layout = std::make_shared<Layout>();
  DispatchState state;
  std::string error;

  Compute(const std::string& glsl, size_t words, ir::Numerics numerics = ir::Numerics::F32) : data(words) {
    layout->sets.resize(1);
    Binding b;
    b.type = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    b.count = 1;
    b.stride = texture::descriptorStride(b.type);
    layout->sets[0].bindings.set(0, b);
    layout->sets[0].size = 32;
    layout->dynamicBase = {0};
    auto p = createComputePipeline(layout, compile(frontend::Stage::Compute, glsl), numerics);
    if (!p) {
      error = p.error().message;
      return;
    }
    state.pipeline = *p;
    texture::BufferDescriptor d;
    d.base = uint64_t(data.data());
    d.size = words * 4;
    std::memcpy(set.data(), &d, sizeof d);
    state.setMemory[0] = set.data();
    state.setSize[0] = set.size();
  }
  void run(unsigned threads, std::array<uint32_t, 3> groups, std::array<uint32_t, 3> base = {0, 0, 0}) {
    base::ThreadPool pool(threads);
    dispatch(pool, state, base.data(), groups.data());
  }
};

TEST(Dispatch, EveryInvocationRunsOnceWithItsIds) {
  Compute c(R"(#version 450
layout(local_size_x = 5, local_size_y = 3, local_size_z = 2) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
void main() {
  uvec3 size = gl_NumWorkGroups * gl_WorkGroupSize;
  uint i = (gl_GlobalInvocationID.z * size.y + gl_GlobalInvocationID.y) * size.x + gl_GlobalInvocationID.x;
  atomicAdd(data[i], 1u + gl_LocalInvocationIndex);
})",
            5 * 7 * 3 * 4 * 2 * 3);
  ASSERT_EQ(c.error, "");
  c.run(2, {7, 4, 3});
  for (uint32_t z = 0; z < 6; ++z)
    for (uint32_t y = 0; y < 12; ++y)
      for (uint32_t x = 0; x < 35; ++x) ASSERT_EQ(c.data[(z * 12 + y) * 35 + x], 1 + (z % 2 * 3 + y % 3) * 5 + x % 5) << x << ", " << y << ", " << z;
}

TEST(Dispatch, SharedMemoryWithBarriersInOneRow) {
  Compute c(R"(#version 450
layout(local_size_x = 100) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
shared uint values[100];
void main() {
  values[gl_LocalInvocationID.x] = gl_GlobalInvocationID.x;
  barrier();
  data[gl_GlobalInvocationID.x] = values[99u - gl_LocalInvocationID.x];
})",
            1000);
  ASSERT_EQ(c.error, "");
  c.run(2, {10, 1, 1});
  for (uint32_t i = 0; i < 1000; ++i) ASSERT_EQ(c.data[i], i / 100 * 100 + 99 - i % 100);
}

TEST(Dispatch, WritesOutsideTheBufferVanish) {
  Compute c(R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
void main() { data[gl_GlobalInvocationID.x * 3u] = 1u; })",
            10);
  ASSERT_EQ(c.error, "");
  c.run(1, {100, 1, 1});
  EXPECT_EQ(c.data, (std::vector<uint32_t>{1, 0, 0, 1, 0, 0, 1, 0, 0, 1}));
}

TEST(Dispatch, BarriersInAUniformLoopHoldBackEveryRow) {
  for (uint32_t size : {100u, 128u, 129u, 256u, 1000u, 1024u}) {
    const std::string n = std::to_string(size);
    // A running sum over the whole group: two barriers a turn, a different number of turns in each group size.
    Compute c("#version 450\n#define N " + n + "u\nlayout(local_size_x = " + n + R"() in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
shared uint sums[N];
void main() {
  uint i = gl_LocalInvocationID.x, own = gl_GlobalInvocationID.x * 7u + 3u;
  sums[i] = own;
  barrier();
  uint turns = 0u;
  for (uint d = 1u; d < N; d *= 2u) {
    uint add = i >= d ? sums[i - d] : 0u;
    barrier();
    sums[i] += add;
    turns++;
    barrier();
  }
  data[gl_GlobalInvocationID.x] = sums[i] * 16u + turns + (own << 28);
})",
              size * 5);
    ASSERT_EQ(c.error, "");
    c.run(2, {5, 1, 1});
    uint32_t turns = 0;
    for (uint32_t d = 1; d < size; d *= 2) turns++;
    for (uint32_t g = 0; g < 5; ++g)
      for (uint32_t i = 0, sum = 0; i < size; ++i) {
        const uint32_t own = (g * size + i) * 7 + 3;
        sum += own;
        ASSERT_EQ(c.data[g * size + i], sum * 16 + turns + (own << 28)) << size << " group " << g << " lane " << i;
      }
  }
}

TEST(Dispatch, BarriersInUniformBranchesAndFunctionsKeepWhatIsLive) {
  Compute c(R"(#version 450
layout(local_size_x = 8, local_size_y = 8, local_size_z = 9) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
shared uint box[576];
uint swap(uint v, uint by) {
  box[gl_LocalInvocationIndex] = v;
  barrier();
  uint r = box[(gl_LocalInvocationIndex + by) % 576u];
  barrier();
  return r;
}
void main() {
  uint i = gl_LocalInvocationIndex;
  uint local[4] = uint[](i, i + 1u, i + 2u, i + 3u);
  uint v = i;
  if (gl_WorkGroupID.x % 2u == 1u) v = swap(v, 200u) + local[i % 4u];
  else if (i % 3u == 0u) v += 1000u;
  for (uint k = 0u; k < gl_WorkGroupID.x; k++) {
    if (k == 2u) v = swap(v, 1u);
    else local[k & 3u] += v;
  }
  data[gl_WorkGroupID.x * 576u + i] = v + local[0] * 65536u;
})",
            576 * 6);
  ASSERT_EQ(c.error, "");
  c.run(3, {6, 1, 1});
  for (uint32_t g = 0; g < 6; ++g) {
    std::vector<uint32_t> v(576);
    std::vector<std::array<uint32_t, 4>> local(576);
    const auto swap = [&](uint32_t by) {
      const std::vector<uint32_t> old = v;
      for (uint32_t i = 0; i < 576; ++i) v[i] = old[(i + by) % 576];
    };
    for (uint32_t i = 0; i < 576; ++i) v[i] = i, local[i] = {i, i + 1, i + 2, i + 3};
    if (g % 2) swap(200);
    for (uint32_t i = 0; i < 576; ++i) {
      if (g % 2) v[i] += local[i][i % 4];
      else if (i % 3 == 0) v[i] += 1000;
    }
    for (uint32_t k = 0; k < g; ++k) {
      if (k == 2) swap(1);
      else
        for (uint32_t i = 0; i < 576; ++i) local[i][k & 3] += v[i];
    }
    for (uint32_t i = 0; i < 576; ++i) ASSERT_EQ(c.data[g * 576 + i], v[i] + local[i][0] * 65536) << g << ", " << i;
  }
}

TEST(Dispatch, RowsThatSpinLetTheOthersOfTheirGroupRun) {
  // The first row waits for the last one, in shared memory and in a buffer.
  for (const char* flag : {"flag", "data[gl_WorkGroupID.x]"}) {
    Compute c(R"(#version 450
layout(local_size_x = 512) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
shared uint flag;
#define FLAG )" + std::string(flag) + R"(
void main() {
  uint i = gl_LocalInvocationID.x;
  if (i < 128u) while (atomicAdd(FLAG, 0u) != 384u) { }
  else atomicAdd(FLAG, 1u);
  data[4u + gl_GlobalInvocationID.x] = i + 1u;
})",
              4 + 512 * 4);
    ASSERT_EQ(c.error, "");
    c.run(2, {4, 1, 1});
    for (uint32_t i = 0; i < 2048; ++i) ASSERT_EQ(c.data[4 + i], i % 512 + 1) << flag;
  }
}

TEST(Dispatch, WorkGroupsThatWaitForOthersLetThemBegin) {
  // Each for the next one; and all in turn, backwards and three times, for a token.
  for (const char* code : {"if (g + 1u < n) while (atomicAdd(data[g + 1u], 0u) == 0u) { } atomicExchange(data[g], 1u);",
                           "if (g + 1u < n) while (waited[g + 1u] == 0u) { } waited[g] = 1u;",
                           "for (uint k = 0u; k < 3u; k++) { while (atomicAdd(data[0], 0u) != k * n + n - 1u - g) { } atomicAdd(data[0], 1u); }"})
    for (uint32_t size : {1u, 64u, 512u}) {
      Compute c(R"(#version 450
layout(local_size_x = )" + std::to_string(size) + R"() in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
layout(set = 0, binding = 0) coherent volatile buffer C { uint waited[]; };
void main() {
  uint g = gl_WorkGroupID.x, n = gl_NumWorkGroups.x;
  if (gl_LocalInvocationIndex == 0u) { )" + std::string(code) + R"( }
  data[64u + gl_GlobalInvocationID.x] = g + 1u;
})",
                64 + 40 * size);
      ASSERT_EQ(c.error, "");
      c.run(2, {40, 1, 1});
      for (uint32_t i = 0; i < 40 * size; ++i) ASSERT_EQ(c.data[64 + i], i / size + 1) << code;
    }
}

TEST(Dispatch, LanesThatAreNotThereHoldZeroForTheOthers) {
  for (const char* type : {"uint", "uint64_t", "uint16_t"}) {
    Compute c(R"(#version 450
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_subgroup_extended_types_int64 : require
#extension GL_EXT_shader_subgroup_extended_types_int16 : require
#define T )" + std::string(type) + R"(
layout(local_size_x = 40) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
void main() {
  T mine = T(gl_LocalInvocationIndex + 100u);
  data[gl_GlobalInvocationID.x * 2u] = uint(subgroupShuffleXor(mine, 16u));
  data[gl_GlobalInvocationID.x * 2u + 1u] = uint(subgroupBroadcast(mine, 20u));
})",
              800);
    ASSERT_EQ(c.error, "");
    c.run(2, {10, 1, 1});
    for (uint32_t i = 0; i < 400; ++i) {
      ASSERT_EQ(c.data[i * 2], i % 40 < 32 ? 100 + (i % 40 ^ 16) : 0) << type << " " << i;
      ASSERT_EQ(c.data[i * 2 + 1], i % 40 < 32 ? 120 : 0) << type << " " << i;
    }
  }
}

TEST(Dispatch, TheOracleKeepsTheDoubleInConversionsAndAngles) {
  // Residuals in units of 2^-40: below one in double, thousands in f32.
  for (const auto numerics : {ir::Numerics::F32, ir::Numerics::Oracle}) {
    Compute c(R"(#version 450
#extension GL_EXT_shader_explicit_arithmetic_types : require
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { float data[]; };
void main() {
  float n = float(gl_LocalInvocationIndex * 3u + 1u), third = n / 3.0;
  float16_t halfThird = float16_t(n) / float16_t(3.0);
  vec4 r = vec4(float(double(third) * 3.0lf - double(n)), float(halfThird) * 3.0 - n, float(float16_t(third)) * 3.0 - n, degrees(radians(third)) - third);
  for (uint k = 0u; k < 4u; k++) data[gl_LocalInvocationIndex * 4u + k] = abs(r[k]) / n * 1099511627776.0;
})",
              256, numerics);
    ASSERT_EQ(c.error, "");
    c.run(1, {1, 1, 1});
    float worst[4] = {};
    for (uint32_t i = 0; i < 256; ++i) worst[i % 4] = std::max(worst[i % 4], std::bit_cast<float>(c.data[i]));
    for (float w : worst) {
      if (numerics == ir::Numerics::Oracle) EXPECT_LT(w, 1);
      else EXPECT_GT(w, 1000);
    }
  }
}

TEST(Dispatch, TheOracleComputesInDouble) {
  for (const auto numerics : {ir::Numerics::F32, ir::Numerics::Oracle}) {
    Compute c(R"(#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer B { float data[]; };
void main() {
  float x = float(gl_GlobalInvocationID.x);
  float a[2] = float[](x + 1.0e8, x);
  data[gl_GlobalInvocationID.x] = a[0] - 1.0e8;
})",
              64, numerics);
    ASSERT_EQ(c.error, "");
    c.run(1, {1, 1, 1});
    for (uint32_t i = 0; i < 64; ++i)
      ASSERT_EQ(std::bit_cast<float>(c.data[i]), numerics == ir::Numerics::F32 ? float(i) + 1.0e8f - 1.0e8f : float(i)) << i;
  }
}

TEST(Dispatch, SubgroupsNumberTheInvocationsOfAGroupInOrder) {
  Compute c(R"(#version 450
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 40, local_size_y = 5) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
void main() {
  uint i = gl_LocalInvocationIndex;
  data[gl_WorkGroupID.x * 200u + i] = gl_SubgroupID << 24 | gl_SubgroupInvocationID << 16 | subgroupAdd(i);
})",
            400);
  ASSERT_EQ(c.error, "");
  c.run(2, {2, 1, 1});
  for (uint32_t i = 0; i < 400; ++i) {
    const uint32_t l = i % 200, first = l / 32 * 32, end = std::min(first + 32, 200u);
    uint32_t sum = 0;
    for (uint32_t k = first; k < end; ++k) sum += k;
    ASSERT_EQ(c.data[i], (l / 32) << 24 | (l % 32) << 16 | sum) << i;
  }
}

}  // namespace
}  // namespace pumice::pipeline::test
