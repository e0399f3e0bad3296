#include <algorithm>
#include <cmath>
#include <map>

#include "bench/ulp/runners.h"
#include "cts_subset/harness/shader.h"
#include "cts_subset/harness/workspace.h"

namespace pumice::ulp {

namespace {

using cts::check;

constexpr uint32_t kGroup = 64, kTimedLanes = 1 << 15, kTimedCalls = 16;

//! Halfs come and go as floats, which hold them.
std::string shaderOf(const std::string& expression, bool timed, ir::Type type = ir::Type::F32) {
  const bool half = type == ir::Type::F16, wide = type == ir::Type::F64;
  const std::string prefix = half ? "f16" : wide ? "d" : "", memory = wide ? "double" : "float";
  const std::string head =
      "#version 450\n" +
      std::string(half ? "#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require\n" : "") + "#define T " +
      (half ? "float16_t" : memory) + "\n#define V2 " + prefix + "vec2\n#define M2 " + prefix + "mat2\n"
      "layout(local_size_x = 64) in;\n"
      "layout(push_constant) uniform P { uint count; uint calls; float step; };\n"
      "layout(binding = 0) readonly buffer X { " + memory + " xs[]; };\n"
      "layout(binding = 1) readonly buffer Y { " + memory + " ys[]; };\n"
      "layout(binding = 2) writeonly buffer R { " + memory + " results[]; };\n"
      "void main() {\n"
      "  uint i = gl_GlobalInvocationID.x;\n"
      "  if (i >= count) return;\n"
      "  T x = T(xs[i]), y = T(ys[i]);\n";
  if (!timed) return head + "  results[i] = " + memory + "(" + expression + ");\n}\n";
  return head + "  float sum = 0;\n  for (uint k = 0; k < calls; k++) {\n    sum += " + expression +
         ";\n    x += step;\n  }\n  results[i] = sum;\n}\n";
}

class Driver final : public ComputeDriver {
 public:
  Driver(std::shared_ptr<cts::VulkanInstance> instance, VkPhysicalDevice physical)
      : instance_(std::move(instance)), device_(physical) {}

  std::string name() const override { return device_.name(); }

  std::vector<double> run(const Function& f, ir::Type type, const Inputs& inputs) override {
    if ((type == ir::Type::F64 && !device_.features.shaderFloat64) || (type == ir::Type::F16 && !device_.vulkan12.shaderFloat16)) return {};
    return type == ir::Type::F64 ? run<double>(f, type, inputs) : run<float>(f, type, inputs);
  }

  double nanoseconds(const Function& f) override {
    const bool shifted = f.op == ir::Op::FAcosh;
    if (!baseline_.count(shifted)) baseline_[shifted] = timed("x", shifted);
    return std::max(0.0, timed(f.glsl, shifted) - baseline_[shifted]);
  }

 private:
  template <typename T>
  std::vector<double> run(const Function& f, ir::Type type, const Inputs& inputs) {
    std::vector<T> x(inputs.x.begin(), inputs.x.end()), y(inputs.y.begin(), inputs.y.end()), results;
    y.resize(x.size());
    dispatch(shaderOf(f.glsl, false, type), x, y, 1, 1, &results);
    return {results.begin(), results.end()};
  }

  double timed(const std::string& expression, bool shifted) {
    std::vector<float> x(kTimedLanes), y(kTimedLanes);
    for (uint32_t i = 0; i < kTimedLanes; ++i)
      x[i] = (shifted ? 1.1f : 0.1f) + 0.7f * float(i) / float(kTimedLanes),
      y[i] = 0.9f - 0.8f * float(i % 977) / 977;
    return dispatch<float>(shaderOf(expression, true), x, y, kTimedCalls, 40, nullptr) / kTimedLanes / kTimedCalls;
  }

  //! Runs `repeats` times; nanoseconds of the fastest.
  template <typename T>
  double dispatch(const std::string& glsl, const std::vector<T>& x, const std::vector<T>& y, uint32_t calls, unsigned repeats,
                  std::vector<T>* results) {
    cts::Workspace w(device_);
    const auto usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    const cts::Buffer buffers[] = {w.bufferOf(x, usage), w.bufferOf(y, usage), w.buffer(x.size() * sizeof(T), usage)};

    VkDescriptorSetLayoutBinding bindings[3] = {};
    for (uint32_t k = 0; k < 3; ++k)
      bindings[k] = {k, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0,
                                            3, bindings};
    VkDescriptorSetLayout setLayout = w.make(setInfo);

    struct Push {
      uint32_t count, calls;
      float step;
    } push{uint32_t(x.size()), calls, 0x1p-8f};
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push};
    VkPipelineLayoutCreateInfo layoutInfo{
        VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout, 1, &range};
    VkPipelineLayout layout = w.make(layoutInfo);

    VkComputePipelineCreateInfo pipelineInfo{};
    pipelineInfo.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    pipelineInfo.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    pipelineInfo.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    pipelineInfo.stage.module = w.shader(VK_SHADER_STAGE_COMPUTE_BIT, glsl);
    pipelineInfo.stage.pName = "main";
    pipelineInfo.layout = layout;
    VkPipeline pipeline = w.make(pipelineInfo);

    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 3};
    VkDescriptorPoolCreateInfo poolInfo{
        VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 1, &size};
    VkDescriptorPool pool = w.make(poolInfo);
    VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1,
                                         &setLayout};
    VkDescriptorSet set = VK_NULL_HANDLE;
    check(vkAllocateDescriptorSets(device_.handle, &allocate, &set), "vkAllocateDescriptorSets");
    VkDescriptorBufferInfo infos[3];
    VkWriteDescriptorSet writes[3] = {};
    for (uint32_t k = 0; k < 3; ++k) {
      infos[k] = {buffers[k].handle, 0, VK_WHOLE_SIZE};
      writes[k].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
      writes[k].dstSet = set;
      writes[k].dstBinding = k;
      writes[k].descriptorCount = 1;
      writes[k].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      writes[k].pBufferInfo = &infos[k];
    }
    vkUpdateDescriptorSets(device_.handle, 3, writes, 0, nullptr);

    double least = INFINITY;
    for (unsigned n = 0; n < repeats; ++n) {
      const double start = processorTime();
      device_.run([&](VkCommandBuffer commands) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
        vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
        vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push, &push);
        vkCmdDispatch(commands, (push.count + kGroup - 1) / kGroup, 1, 1);
        cts::fullBarrier(commands);
      });
      least = std::min(least, processorTime() - start);
    }
    if (results) {
      results->resize(x.size());
      std::memcpy(results->data(), buffers[2].mapped, x.size() * sizeof(T));
    }
    return least;
  }

  std::shared_ptr<cts::VulkanInstance> instance_;
  cts::Device device_;
  std::map<bool, double> baseline_;
};

}  // namespace

std::vector<std::unique_ptr<ComputeDriver>> openDrivers() {
  cts::selectDrivers();
  std::vector<std::unique_ptr<ComputeDriver>> drivers;
  const auto instance = std::make_shared<cts::VulkanInstance>(false);
  for (const std::string& prefix : {cts::testedDeviceName(), std::string(cts::kLavapipeName)})
    if (const VkPhysicalDevice physical = instance->find(prefix))
      drivers.push_back(std::make_unique<Driver>(instance, physical));
  return drivers;
}

}  // namespace pumice::ulp
