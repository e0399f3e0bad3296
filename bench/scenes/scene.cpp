#include "bench/scenes/scene.h"

#include "bench/scenes/resources.h"

namespace pumice::bench {

using cts::check;

const SceneTable& allScenes() {
  static const SceneTable kTable = [] {
    SceneTable table;
    addFillScenes(table);
    addTriangleScenes(table);
    addTexturedScenes(table);
    addShadingScenes(table);
    addLightingScenes(table);
    addPostScenes(table);
    addComputeScenes(table);
    addCopyScenes(table);
    addPresentScenes(table);
    return table;
  }();
  return kTable;
}

Scene::Scene(Device& d) : device(d) {
  VkCommandPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  poolInfo.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
  poolInfo.queueFamilyIndex = device.family;
  check(vkCreateCommandPool(device.handle, &poolInfo, nullptr, &pool), "vkCreateCommandPool");
  VkCommandBufferAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  allocate.commandPool = pool;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 1;
  check(vkAllocateCommandBuffers(device.handle, &allocate, &commands), "vkAllocateCommandBuffers");
  VkFenceCreateInfo fenceInfo{};
  fenceInfo.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  check(vkCreateFence(device.handle, &fenceInfo, nullptr, &fence), "vkCreateFence");
}

Scene::~Scene() {
  vkDeviceWaitIdle(device.handle);
  vkDestroyFence(device.handle, fence, nullptr);
  vkDestroyCommandPool(device.handle, pool, nullptr);
}

void Scene::submit(uint32_t buffers) {
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.commandBufferCount = buffers;
  submit.pCommandBuffers = &commands;
  check(vkQueueSubmit(device.queue, 1, &submit, fence), "vkQueueSubmit");
  check(vkWaitForFences(device.handle, 1, &fence, VK_TRUE, UINT64_MAX), "vkWaitForFences");
  check(vkResetFences(device.handle, 1, &fence), "vkResetFences");
}

void Scene::frame() {
  check(vkResetCommandPool(device.handle, pool, 0), "vkResetCommandPool");
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
  record(commands);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  submit(1);
}

// The target's depth is thrown away, as usual.
DrawScene::DrawScene(Device& d, const Options& options, VkFormat depth, VkSampleCountFlagBits samples)
    : Scene(d),
      canvas(d, options.width, options.height, depth, samples, VK_ATTACHMENT_STORE_OP_DONT_CARE),
      hasDepth(depth != VK_FORMAT_UNDEFINED) {}

Pipeline DrawScene::pipeline(const PipelineSpec& spec) {
  Pipeline made;
  check(canvas.tryPipeline(spec, cachedShader(canvas, VK_SHADER_STAGE_VERTEX_BIT, spec.vertex),
                           cachedShader(canvas, VK_SHADER_STAGE_FRAGMENT_BIT, spec.fragment), made),
        "vkCreateGraphicsPipelines");
  return made;
}

void DrawScene::record(VkCommandBuffer into) {
  before(into);
  std::vector<VkClearValue> clears{clearColour(0.1f, 0.2f, 0.3f, 1)};
  if (hasDepth) clears.push_back(clearDepth(1));
  beginPass(into, canvas.pass(), canvas.target(), canvas.size().x, canvas.size().y, clears);
  draw(into);
  vkCmdEndRenderPass(into);
}

Picture DrawScene::picture() {
  frame();
  return readImage(canvas, canvas.colourImage());
}

void beginPass(VkCommandBuffer commands, VkRenderPass pass, VkFramebuffer target, uint32_t width, uint32_t height,
               const std::vector<VkClearValue>& clears) {
  VkRenderPassBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  begin.renderPass = pass;
  begin.framebuffer = target;
  begin.renderArea = {{0, 0}, {width, height}};
  begin.clearValueCount = uint32_t(clears.size());
  begin.pClearValues = clears.data();
  vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
  cts::setViewport(commands, 0, 0, float(width), float(height));
  cts::setScissor(commands, 0, 0, width, height);
}

VkClearValue clearColour(float r, float g, float b, float a) {
  VkClearValue value{};
  value.color = {{r, g, b, a}};
  return value;
}

VkClearValue clearDepth(float depth) {
  VkClearValue value{};
  value.depthStencil = {depth, 0};
  return value;
}

}  // namespace pumice::bench
