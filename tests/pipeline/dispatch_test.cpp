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

  Compute(const std::string& glsl, size_t words) : data(words) {
    layout->sets.resize(1);
    Binding b;
    b.type = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    b.count = 1;
    b.stride = texture::descriptorStride(b.type);
    layout->sets[0].bindings[0] = b;
    layout->sets[0].size = 32;
    layout->dynamicBase = {0};
    auto p = createComputePipeline(layout, compile(frontend::Stage::Compute, glsl));
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

TEST(Dispatch, BarriersInGroupsOfSeveralRowsAreRefused) {
  Compute c(R"(#version 450
layout(local_size_x = 256) in;
layout(set = 0, binding = 0) buffer B { uint data[]; };
shared uint values[256];
void main() { values[gl_LocalInvocationID.x] = 1u; barrier(); data[0] = values[3]; })",
            4);
  EXPECT_NE(c.error.find("barrier"), std::string::npos) << c.error;
}

}  // namespace
}  // namespace pumice::pipeline::test
