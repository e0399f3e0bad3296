// Scenes of compute shaders.
#include <cmath>

#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

using cts::check;

// One or more kernels over buffers; each frame runs them all.
struct ComputeScene : Scene {
  struct Kernel {
    Pipeline pipeline;
    VkDescriptorSet set = VK_NULL_HANDLE;
    uint32_t groups[3] = {1, 1, 1};
  };
  cts::Workspace space;
  std::vector<Kernel> kernels;
  Buffer result;  // what picture() shows

  explicit ComputeScene(Device& d) : Scene(d), space(d) {}

  Buffer storage(VkDeviceSize bytes) {
    return space.buffer(bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  }
  static uint64_t amountOr(const Options& options, uint64_t usual) { return options.amount ? options.amount : usual; }

  // `buffers` are bindings 0, 1, ... of set 0.
  void addKernel(const std::string& glsl, const std::vector<Buffer>& buffers, uint32_t x, uint32_t y = 1, uint32_t z = 1) {
    VkDevice v = device.handle;
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    for (uint32_t i = 0; i < buffers.size(); ++i)
      bindings.push_back({i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
    VkDescriptorSetLayoutCreateInfo layoutInfo{};
    layoutInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
    layoutInfo.bindingCount = uint32_t(bindings.size());
    layoutInfo.pBindings = bindings.data();
    VkDescriptorSetLayout layout = space.make(layoutInfo);
    VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, uint32_t(buffers.size())};
    VkDescriptorPoolCreateInfo poolInfo{};
    poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    poolInfo.maxSets = poolInfo.poolSizeCount = 1;
    poolInfo.pPoolSizes = &size;
    VkDescriptorPool descriptors = space.make(poolInfo);
    VkDescriptorSetAllocateInfo allocate{};
    allocate.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    allocate.descriptorPool = descriptors;
    allocate.descriptorSetCount = 1;
    allocate.pSetLayouts = &layout;
    Kernel kernel;
    check(vkAllocateDescriptorSets(v, &allocate, &kernel.set), "vkAllocateDescriptorSets");
    for (uint32_t i = 0; i < buffers.size(); ++i) {
      VkDescriptorBufferInfo info{buffers[i].handle, 0, VK_WHOLE_SIZE};
      VkWriteDescriptorSet write{};
      write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
      write.dstSet = kernel.set;
      write.dstBinding = i;
      write.descriptorCount = 1;
      write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      write.pBufferInfo = &info;
      vkUpdateDescriptorSets(v, 1, &write, 0, nullptr);
    }
    VkPipelineLayoutCreateInfo pipelineLayout{};
    pipelineLayout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    pipelineLayout.setLayoutCount = 1;
    pipelineLayout.pSetLayouts = &layout;
    kernel.pipeline.layout = space.make(pipelineLayout);
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = cachedShader(space, VK_SHADER_STAGE_COMPUTE_BIT, glsl);
    info.stage.pName = "main";
    info.layout = kernel.pipeline.layout;
    kernel.pipeline.handle = space.make(info);
    kernel.groups[0] = x, kernel.groups[1] = y, kernel.groups[2] = z;
    kernels.push_back(kernel);
  }

  void record(VkCommandBuffer commands) override {
    for (const Kernel& kernel : kernels) {
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline.handle);
      vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline.layout, 0, 1, &kernel.set, 0,
                              nullptr);
      vkCmdDispatch(commands, kernel.groups[0], kernel.groups[1], kernel.groups[2]);
      cts::fullBarrier(commands);
    }
  }
  Picture picture() override {
    frame();
    Picture bytes(uint32_t(result.size / 4), 1);
    std::memcpy(bytes.rgba.data(), result.mapped, bytes.rgba.size());
    return bytes;
  }
  static void fillWithUnits(const Buffer& buffer, uint32_t seed) {
    Random random(seed);
    auto* values = reinterpret_cast<float*>(buffer.mapped);
    for (size_t i = 0; i < buffer.size / 4; ++i) values[i] = random.unit();
  }
};

struct Saxpy : ComputeScene {
  uint64_t count;
  Saxpy(Device& device, const Options& options) : ComputeScene(device), count(amountOr(options, 8u << 20)) {
    Buffer x = storage(count * 4), y = storage(count * 4);
    fillWithUnits(x, 1);
    fillWithUnits(y, 2);
    addKernel(R"(#version 450
layout(local_size_x = 256) in;
layout(set = 0, binding = 0) readonly buffer X { float x[]; };
layout(set = 0, binding = 1) buffer Y { float y[]; };
void main() { uint i = gl_GlobalInvocationID.x; y[i] = 0.5 * x[i] + 0.5 * y[i]; }
)", {x, y}, uint32_t(count / 256));
    result = y;
  }
  Work work() const override { return {double(count) * 12, double(count) * 3}; }
};

// 4 MiB of pixels; rows, then columns, each work group with a line in shared memory.
struct Blur : ComputeScene {
  Blur(Device& device, const Options& options) : ComputeScene(device) {
    const uint32_t width = options.width / 128 * 128, height = options.height;
    const VkDeviceSize bytes = VkDeviceSize(width) * height * 16;
    Buffer from = storage(bytes), between = storage(bytes), to = storage(bytes);
    fillWithUnits(from, 5);
    auto kernel = [&](bool rows) {
      std::string sizes = "const int kWidth = " + std::to_string(width) + ", kHeight = " + std::to_string(height) + ";\n";
      std::string place = rows ? "ivec2(clamp(at, 0, kWidth - 1), int(gl_WorkGroupID.y))"
                               : "ivec2(int(gl_WorkGroupID.y), clamp(at, 0, kHeight - 1))";
      std::string last = rows ? "" : "  if (first + self >= kHeight) return;\n";
      return "#version 450\nlayout(local_size_x = 128) in;\n"
             "layout(set = 0, binding = 0) readonly buffer From { vec4 source[]; };\n"
             "layout(set = 0, binding = 1) writeonly buffer To { vec4 target[]; };\n" + sizes + R"(
const int kRadius = 16;
shared vec4 line[128 + 2 * kRadius];
vec4 fetch(int at) { ivec2 p = )" + place + R"(; return source[p.y * kWidth + p.x]; }
void main() {
  int first = int(gl_WorkGroupID.x) * 128, self = int(gl_LocalInvocationID.x);
  line[self + kRadius] = fetch(first + self);
  if (self < kRadius) {
    line[self] = fetch(first + self - kRadius);
    line[self + 128 + kRadius] = fetch(first + self + 128);
  }
  barrier();
)" + last + R"(
  vec4 sum = vec4(0.0);
  for (int i = -kRadius; i <= kRadius; ++i) sum += line[self + kRadius + i] * exp(-float(i * i) * 0.01);
  int at = first + self;
  ivec2 p = )" + place + R"(;
  target[p.y * kWidth + p.x] = sum * 0.057;
}
)";
    };
    addKernel(kernel(true), {from, between}, width / 128, height);
    addKernel(kernel(false), {between, to}, (height + 127) / 128, width);
    result = to;
  }
};

struct Nbody : ComputeScene {
  uint32_t count;
  Nbody(Device& device, const Options& options) : ComputeScene(device), count(uint32_t(amountOr(options, 4096))) {
    Buffer bodies = storage(count * 16), forces = storage(count * 16);
    fillWithUnits(bodies, 9);
    addKernel(R"(#version 450
layout(local_size_x = 128) in;
layout(set = 0, binding = 0) readonly buffer Bodies { vec4 bodies[]; };
layout(set = 0, binding = 1) writeonly buffer Forces { vec4 forces[]; };
shared vec4 some[128];
void main() {
  vec3 self = bodies[gl_GlobalInvocationID.x].xyz, sum = vec3(0.0);
  for (uint tile = 0; tile < )" + std::to_string(count / 128) + R"(; ++tile) {
    some[gl_LocalInvocationID.x] = bodies[tile * 128 + gl_LocalInvocationID.x];
    barrier();
    for (int i = 0; i < 128; ++i) {
      vec4 other = some[i];
      vec3 d = other.xyz - self;
      float inverse = inversesqrt(dot(d, d) + 0.001);
      sum += d * (other.w * inverse * inverse * inverse);
    }
    barrier();
  }
  forces[gl_GlobalInvocationID.x] = vec4(sum, 0.0);
}
)", {bodies, forces}, count / 128);
    result = forces;
  }
};

struct Reduction : ComputeScene {
  uint64_t count;
  Reduction(Device& device, const Options& options) : ComputeScene(device), count(amountOr(options, 16u << 20)) {
    Buffer values = storage(count * 4), sums = storage(count / 1024 * 4), total = storage(4);
    fillWithUnits(values, 4);
    auto kernel = [](const std::string& each) {
      return "#version 450\nlayout(local_size_x = 256) in;\n"
             "layout(set = 0, binding = 0) readonly buffer Values { float values[]; };\n"
             "layout(set = 0, binding = 1) writeonly buffer Sums { float sums[]; };\n"
             "shared float part[256];\nvoid main() {\n  uint self = gl_LocalInvocationID.x;\n  float sum = 0.0;\n"
             "  for (uint i = 0; i < " + each + "; ++i) sum += values[(gl_WorkGroupID.x * " + each + R"( + i) * 256 + self];
  part[self] = sum;
  barrier();
  for (uint half_ = 128; half_ > 0; half_ >>= 1) {
    if (self < half_) part[self] += part[self + half_];
    barrier();
  }
  if (self == 0) sums[gl_WorkGroupID.x] = part[0];
}
)";
    };
    addKernel(kernel("4"), {values, sums}, uint32_t(count / 1024));
    addKernel(kernel(std::to_string(count / 1024 / 256)), {sums, total}, 1);
    result = total;
  }
};

struct Matmul : ComputeScene {
  uint32_t side;
  Matmul(Device& device, const Options& options) : ComputeScene(device), side(uint32_t(amountOr(options, 512))) {
    const VkDeviceSize bytes = VkDeviceSize(side) * side * 4;
    Buffer a = storage(bytes), b = storage(bytes), c = storage(bytes);
    fillWithUnits(a, 6);
    fillWithUnits(b, 7);
    addKernel("#version 450\nconst uint kSide = " + std::to_string(side) + R"(;
layout(local_size_x = 16, local_size_y = 16) in;
layout(set = 0, binding = 0) readonly buffer A { float a[]; };
layout(set = 0, binding = 1) readonly buffer B { float b[]; };
layout(set = 0, binding = 2) writeonly buffer C { float c[]; };
shared float tileA[16][16], tileB[16][16];
void main() {
  uint x = gl_LocalInvocationID.x, y = gl_LocalInvocationID.y;
  uint row = gl_GlobalInvocationID.y, column = gl_GlobalInvocationID.x;
  float sum = 0.0;
  for (uint t = 0; t < kSide; t += 16) {
    tileA[y][x] = a[row * kSide + t + x];
    tileB[y][x] = b[(t + y) * kSide + column];
    barrier();
    for (uint k = 0; k < 16; ++k) sum += tileA[y][k] * tileB[k][x];
    barrier();
  }
  c[row * kSide + column] = sum;
}
)", {a, b, c}, side / 16, side / 16);
    result = c;
  }
};

struct Histogram : ComputeScene {
  uint64_t count;
  Histogram(Device& device, const Options& options) : ComputeScene(device), count(amountOr(options, 8u << 20)) {
    Buffer values = storage(count * 4), bins = storage(256 * 4);
    Random random(8);
    auto* words = reinterpret_cast<uint32_t*>(values.mapped);
    for (uint64_t i = 0; i < count; ++i) words[i] = random.word();
    addKernel(R"(#version 450
layout(local_size_x = 256) in;
layout(set = 0, binding = 0) writeonly buffer Bins { uint bins[]; };
void main() { bins[gl_LocalInvocationID.x] = 0; }
)", {bins}, 1);
    addKernel(R"(#version 450
layout(local_size_x = 256) in;
layout(set = 0, binding = 0) readonly buffer Values { uint values[]; };
layout(set = 0, binding = 1) buffer Bins { uint bins[]; };
shared uint some[256];
void main() {
  uint self = gl_LocalInvocationID.x;
  some[self] = 0;
  barrier();
  for (uint i = 0; i < 16; ++i) {
    uint value = values[(gl_WorkGroupID.x * 16 + i) * 256 + self];
    atomicAdd(some[value & 255], 1);
  }
  barrier();
  atomicAdd(bins[self], some[self]);
}
)", {values, bins}, uint32_t(count / 4096));
    result = bins;
  }
};

}  // namespace

void addComputeScenes(SceneTable& table) {
  table.push_back({"compute_saxpy", "8 M elements", makeScene<Saxpy>, Limit::kCopy});
  table.push_back({"compute_blur", "rows and columns in shared memory, radius 16", makeScene<Blur>});
  table.push_back({"compute_nbody", "4096 bodies", makeScene<Nbody>});
  table.push_back({"compute_reduction", "the sum of 16 M floats", makeScene<Reduction>});
  table.push_back({"compute_matmul", "512 x 512 matrices in tiles", makeScene<Matmul>});
  table.push_back({"compute_histogram", "8 M values into 256 bins by atomics", makeScene<Histogram>});
}

}  // namespace pumice::bench
