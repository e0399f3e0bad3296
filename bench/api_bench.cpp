// What calls cost through the real API: submissions, small passes, descriptors, recording, many small draws, devices.
// An ordinary client: VK_ICD_FILENAMES chooses another driver (default: the one of the build tree).
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <memory>

#include "cts_subset/harness/canvas.h"

namespace {

using namespace pumice::cts;

struct Opened {
  VulkanInstance instance{false};
  std::unique_ptr<Device> device;
  Opened() {
    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    vkEnumeratePhysicalDevices(instance.handle(), &count, &physical);
    device = std::make_unique<Device>(physical);
  }
};

void chooseDriver() { setenv("VK_ICD_FILENAMES", pumiceManifest().c_str(), 0); }

Device& device() {
  static Opened* opened = (chooseDriver(), new Opened);   // never closed: the drivers' own exit handlers come first
  return *opened->device;
}

struct Commands {
  VkCommandPool pool = VK_NULL_HANDLE;
  VkCommandBuffer buffer = VK_NULL_HANDLE;
  VkFence fence = VK_NULL_HANDLE;
  Commands() {
    VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, device().family};
    check(vkCreateCommandPool(device().handle, &poolInfo, nullptr, &pool), "vkCreateCommandPool");
    VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
    check(vkAllocateCommandBuffers(device().handle, &info, &buffer), "vkAllocateCommandBuffers");
    VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
    check(vkCreateFence(device().handle, &fenceInfo, nullptr, &fence), "vkCreateFence");
  }
  ~Commands() {
    vkDestroyFence(device().handle, fence, nullptr);
    vkDestroyCommandPool(device().handle, pool, nullptr);
  }
  void begin() {
    VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
    check(vkBeginCommandBuffer(buffer, &info), "vkBeginCommandBuffer");
  }
  void end() { check(vkEndCommandBuffer(buffer), "vkEndCommandBuffer"); }
  void submit(bool withCommands = true) {
    VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO, nullptr, 0, nullptr, nullptr, withCommands ? 1u : 0u, &buffer, 0, nullptr};
    check(vkQueueSubmit(device().queue, 1, &info, fence), "vkQueueSubmit");
    check(vkWaitForFences(device().handle, 1, &fence, VK_TRUE, ~0ull), "vkWaitForFences");
    check(vkResetFences(device().handle, 1, &fence), "vkResetFences");
  }
};

void emptySubmit(benchmark::State& state) {
  Commands c;
  for (auto _ : state) c.submit(false);
}
BENCHMARK(emptySubmit)->UseRealTime();

void emptyCommandBuffer(benchmark::State& state) {
  Commands c;
  c.begin();
  c.end();
  for (auto _ : state) c.submit();
}
BENCHMARK(emptyCommandBuffer)->UseRealTime();

void smallFill(benchmark::State& state) {
  Workspace work(device());
  Buffer b = work.buffer(256, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  Commands c;
  c.begin();
  vkCmdFillBuffer(c.buffer, b.handle, 0, 256, 1);
  c.end();
  for (auto _ : state) c.submit();
}
BENCHMARK(smallFill)->UseRealTime();

// A canvas, and what draws on it.
struct Scene {
  Canvas canvas;
  Pipeline pipeline;
  Buffer vertices, uniforms;
  DescriptorSet set;
  explicit Scene(uint32_t size) : canvas(device(), size, size) {
    uniforms = canvas.buffer(65536, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT);
    Binding binding{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER};
    binding.buffer = {uniforms.handle, 0, 256};
    set = canvas.descriptors({binding});
    PipelineSpec spec;
    spec.vertex = R"(#version 450
layout(location = 0) in vec4 position; layout(location = 1) in vec4 modulator; layout(location = 0) out vec4 passed;
layout(push_constant) uniform P { vec4 offset, colour; } p;
layout(binding = 0) uniform U { vec4 tint; } u;
void main() { gl_Position = position + p.offset; passed = p.colour * modulator + u.tint; })";
    spec.sets = {set.layout};
    spec.pushConstants = {{VK_SHADER_STAGE_VERTEX_BIT, 0, 32}};
    pipeline = canvas.pipeline(spec);
    const float s = 8.0f / float(size);
    vertices = canvas.bufferOf(std::vector<Vertex>{{{-s, -s, 0, 1}, glm::vec4(1)}, {{s, -s, 0, 1}, glm::vec4(1)}, {{0, s, 0, 1}, glm::vec4(1)}}, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void begin(VkCommandBuffer c) {
    VkClearValue clear{{{0, 0, 0, 1}}};
    VkRenderPassBeginInfo pass{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, canvas.pass(), canvas.target(), {{0, 0}, {canvas.size().x, canvas.size().y}}, 1, &clear};
    vkCmdBeginRenderPass(c, &pass, VK_SUBPASS_CONTENTS_INLINE);
    setViewport(c, 0, 0, float(canvas.size().x), float(canvas.size().y));
    setScissor(c, 0, 0, canvas.size().x, canvas.size().y);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    VkDeviceSize zero = 0;
    vkCmdBindVertexBuffers(c, 0, 1, &vertices.handle, &zero);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0, nullptr);
    push(c, 0);
  }
  void push(VkCommandBuffer c, uint32_t i) {
    const float values[8] = {float(i % 100) / 50 - 1, float(i / 100 % 100) / 50 - 1, 0, 0, float(i & 255) / 255, 1, 0.5f, 1};
    vkCmdPushConstants(c, pipeline.layout, VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof values, values);
  }
};

void smallPass(benchmark::State& state) {
  Scene scene(64);
  Commands c;
  c.begin();
  scene.begin(c.buffer);
  vkCmdDraw(c.buffer, 3, 1, 0, 0);
  vkCmdEndRenderPass(c.buffer);
  c.end();
  for (auto _ : state) c.submit();
}
BENCHMARK(smallPass)->UseRealTime();

// Recorded again for each submission, as most programs do.
void smallPassRecorded(benchmark::State& state) {
  Scene scene(64);
  Commands c;
  for (auto _ : state) {
    c.begin();
    scene.begin(c.buffer);
    vkCmdDraw(c.buffer, 3, 1, 0, 0);
    vkCmdEndRenderPass(c.buffer);
    c.end();
    c.submit();
  }
}
BENCHMARK(smallPassRecorded)->UseRealTime();

enum Change { kNothing, kPush, kSet, kVertexBuffer, kViewport };
constexpr const char* kChanges[] = {"nothing changed", "push constants", "set", "vertex buffer", "viewport"};
void change(Scene& scene, VkCommandBuffer c, int64_t what, uint32_t i) {
  VkDeviceSize zero = 0;
  switch (what) {
    case kPush: scene.push(c, i); break;
    case kSet: vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, scene.pipeline.layout, 0, 1, &scene.set.handle, 0, nullptr); break;
    case kVertexBuffer: vkCmdBindVertexBuffers(c, 0, 1, &scene.vertices.handle, &zero); break;
    case kViewport: setViewport(c, 0, 0, float(scene.canvas.size().x), float(scene.canvas.size().y)); break;
    default: break;
  }
}

// A thousand draws, each after a change of state.
void recordDraws(benchmark::State& state) {
  Scene scene(64);
  Commands c;
  constexpr uint32_t kDraws = 1000;
  for (auto _ : state) {
    c.begin();
    scene.begin(c.buffer);
    for (uint32_t i = 0; i < kDraws; i++) {
      change(scene, c.buffer, state.range(0), i);
      vkCmdDraw(c.buffer, 3, 1, 0, 0);
    }
    vkCmdEndRenderPass(c.buffer);
    c.end();
  }
  state.SetItemsProcessed(state.iterations() * kDraws);
  state.SetLabel(kChanges[state.range(0)]);
}
BENCHMARK(recordDraws)->ArgName("change")->DenseRange(kNothing, kViewport);

// A frame: recorded, submitted, waited for.
void draws10000(benchmark::State& state) {
  Scene scene(1024);
  Commands c;
  for (auto _ : state) {
    c.begin();
    scene.begin(c.buffer);
    for (uint32_t i = 0; i < 10000; i++) {
      change(scene, c.buffer, state.range(0), i);
      vkCmdDraw(c.buffer, 3, 1, 0, 0);
    }
    vkCmdEndRenderPass(c.buffer);
    c.end();
    c.submit();
  }
  state.SetLabel(kChanges[state.range(0)]);
}
BENCHMARK(draws10000)->ArgName("change")->DenseRange(kNothing, kSet)->UseRealTime()->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

// A frame of 1,000 draws, each with another texture of an array of as many.
void drawsFromArray(benchmark::State& state) {
  const uint32_t count = uint32_t(state.range(0));
  Scene scene(64);
  Workspace& work = scene.canvas;
  Image image = work.texture(4, 4, std::vector<uint8_t>(64, 255));
  const VkDescriptorImageInfo info{work.sampler(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT), work.view(image), VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, count, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr};
  VkDescriptorSetLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1, &binding};
  VkDescriptorSetLayout layout = VK_NULL_HANDLE;
  check(vkCreateDescriptorSetLayout(device().handle, &layoutInfo, nullptr, &layout), "vkCreateDescriptorSetLayout");
  VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, count};
  VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 1, &size};
  VkDescriptorPool pool = VK_NULL_HANDLE;
  check(vkCreateDescriptorPool(device().handle, &poolInfo, nullptr, &pool), "vkCreateDescriptorPool");
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1, &layout};
  VkDescriptorSet set = VK_NULL_HANDLE;
  check(vkAllocateDescriptorSets(device().handle, &allocate, &set), "vkAllocateDescriptorSets");
  const std::vector<VkDescriptorImageInfo> infos(count, info);
  VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set, 0, 0, count, binding.descriptorType, infos.data(), nullptr, nullptr};
  vkUpdateDescriptorSets(device().handle, 1, &write, 0, nullptr);
  PipelineSpec spec;
  spec.fragment = "#version 450\nlayout(set = 0, binding = 0) uniform sampler2D t[" + std::to_string(count) + R"(];
layout(push_constant) uniform P { uint i; } p; layout(location = 0) in vec4 passed; layout(location = 0) out vec4 target;
void main() { target = passed + texture(t[p.i], gl_FragCoord.xy / 64.0); })";
  spec.sets = {layout};
  spec.pushConstants = {{VK_SHADER_STAGE_FRAGMENT_BIT, 0, 4}};
  Pipeline pipeline = scene.canvas.pipeline(spec);
  Commands c;
  c.begin();
  scene.begin(c.buffer);
  vkCmdBindPipeline(c.buffer, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
  vkCmdBindDescriptorSets(c.buffer, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set, 0, nullptr);
  for (uint32_t i = 0; i < 1000; i++) {
    const uint32_t which = i % count;
    vkCmdPushConstants(c.buffer, pipeline.layout, VK_SHADER_STAGE_FRAGMENT_BIT, 0, 4, &which);
    vkCmdDraw(c.buffer, 3, 1, 0, 0);
  }
  vkCmdEndRenderPass(c.buffer);
  c.end();
  for (auto _ : state) c.submit();
  state.SetLabel(std::to_string(count) + " textures");
  vkDestroyDescriptorPool(device().handle, pool, nullptr);
  vkDestroyDescriptorSetLayout(device().handle, layout, nullptr);
}
BENCHMARK(drawsFromArray)->Arg(16)->Arg(4096)->UseRealTime()->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

void updateBufferDescriptor(benchmark::State& state) {
  Scene scene(64);
  VkDescriptorBufferInfo info{scene.uniforms.handle, 0, 256};
  VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, scene.set.handle, 0, 0, 1, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, nullptr, &info, nullptr};
  for (auto _ : state) vkUpdateDescriptorSets(device().handle, 1, &write, 0, nullptr);
}
BENCHMARK(updateBufferDescriptor);

void updateImageDescriptor(benchmark::State& state) {
  Workspace work(device());
  Image image = work.texture(4, 4, std::vector<uint8_t>(64, 255));
  Binding binding{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER};
  binding.image = {work.sampler(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT), work.view(image), VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  DescriptorSet set = work.descriptors({binding});
  VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set.handle, 0, 0, 1, binding.type, &binding.image, nullptr, nullptr};
  for (auto _ : state) vkUpdateDescriptorSets(device().handle, 1, &write, 0, nullptr);
}
BENCHMARK(updateImageDescriptor);

void allocateAndResetSets(benchmark::State& state) {
  Scene scene(64);
  VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 64};
  VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 64, 1, &size};
  VkDescriptorPool pool = VK_NULL_HANDLE;
  check(vkCreateDescriptorPool(device().handle, &info, nullptr, &pool), "vkCreateDescriptorPool");
  std::vector<VkDescriptorSetLayout> layouts(64, scene.set.layout);
  std::vector<VkDescriptorSet> sets(64);
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 64, layouts.data()};
  for (auto _ : state) {
    check(vkAllocateDescriptorSets(device().handle, &allocate, sets.data()), "vkAllocateDescriptorSets");
    vkResetDescriptorPool(device().handle, pool, 0);
  }
  state.SetItemsProcessed(state.iterations() * 64);
  vkDestroyDescriptorPool(device().handle, pool, nullptr);
}
BENCHMARK(allocateAndResetSets);

// Instance and device, made and destroyed, with the loader's part in it.
void instanceAndDevice(benchmark::State& state) {
  chooseDriver();
  for (auto _ : state) {
    VkInstanceCreateInfo instanceInfo{};
    instanceInfo.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    VkInstance instance = VK_NULL_HANDLE;
    check(vkCreateInstance(&instanceInfo, nullptr, &instance), "vkCreateInstance");
    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    vkEnumeratePhysicalDevices(instance, &count, &physical);
    const float priority = 1;
    VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
    VkDeviceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    VkDevice made = VK_NULL_HANDLE;
    check(vkCreateDevice(physical, &info, nullptr, &made), "vkCreateDevice");
    vkDestroyDevice(made, nullptr);
    vkDestroyInstance(instance, nullptr);
  }
}
BENCHMARK(instanceAndDevice)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
