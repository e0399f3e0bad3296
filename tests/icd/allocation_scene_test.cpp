// A whole scene with one set of allocation callbacks, from the device to the drawn picture. Whichever of the
// allocations fails, the call that needed it says so, nothing is left behind, and nothing crashes.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>

#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

struct Budget {
  std::map<void*, size_t> live;
  long left = -1, total = 0;   // left: -1 = no end
  bool refused = false;
  VkAllocationCallbacks callbacks{this, allocate, reallocate, release, nullptr, nullptr};

  static void* VKAPI_PTR allocate(void* user, size_t size, size_t alignment, VkSystemAllocationScope) {
    auto& self = *static_cast<Budget*>(user);
    if (self.left == 0) {
      self.refused = true;
      return nullptr;
    }
    if (self.left > 0) self.left--;
    void* memory = nullptr;
    if (posix_memalign(&memory, std::max(alignment, sizeof(void*)), size)) return nullptr;
    std::memset(memory, 0xcd, size);
    self.live[memory] = size;
    self.total++;
    return memory;
  }
  static void* VKAPI_PTR reallocate(void*, void*, size_t, size_t, VkSystemAllocationScope) { return nullptr; }
  static void VKAPI_PTR release(void* user, void* memory) {
    if (!memory) return;
    EXPECT_EQ(static_cast<Budget*>(user)->live.erase(memory), 1u) << "freed what was not allocated here";
    std::free(memory);
  }
};

struct Undo {
  std::vector<std::function<void()>> list;
  ~Undo() {
    while (!list.empty()) {
      list.back()();
      list.pop_back();
    }
  }
};

// The first result that is not success. What was made is destroyed when it returns, whatever happened.
VkResult scene(Budget& budget, const std::vector<uint32_t>& vertexWords, const std::vector<uint32_t>& fragmentWords, uint32_t& pixel) {
  Undo undo;
  VkResult result = VK_SUCCESS;
  VkDevice device = VK_NULL_HANDLE;
  float priority = 1;
  VkDeviceQueueCreateInfo queueInfo{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
  VkDeviceCreateInfo deviceInfo{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, nullptr, 0, 1, &queueInfo, 0, nullptr, 0, nullptr, nullptr};
  if ((result = VK(vkCreateDevice)(physicalDevice(commonInstance()), &deviceInfo, &budget.callbacks, &device))) return result;
  undo.list.push_back([=, c = &budget.callbacks] { VK(vkDestroyDevice)(device, c); });
  VkQueue queue = VK_NULL_HANDLE;
  VK(vkGetDeviceQueue)(device, 0, 0, &queue);

#define MAKE(Type, name, info)                                                            \
  Vk##Type name = VK_NULL_HANDLE;                                                         \
  if ((result = VK(vkCreate##Type)(device, &info, nullptr, &name))) return result;        \
  undo.list.push_back([=] { VK(vkDestroy##Type)(device, name, nullptr); });

  VkImageCreateInfo imageInfo{};
  imageInfo.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  imageInfo.imageType = VK_IMAGE_TYPE_2D;
  imageInfo.format = VK_FORMAT_R8G8B8A8_UNORM;
  imageInfo.extent = {8, 8, 1};
  imageInfo.mipLevels = imageInfo.arrayLayers = 1;
  imageInfo.samples = VK_SAMPLE_COUNT_1_BIT;
  imageInfo.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  MAKE(Image, image, imageInfo)
  VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, nullptr, 0, 256, VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT,
                                VK_SHARING_MODE_EXCLUSIVE, 0, nullptr};
  MAKE(Buffer, buffer, bufferInfo)
  VkMemoryAllocateInfo memoryInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, 65536, 0};
  VkDeviceMemory memory = VK_NULL_HANDLE;
  if ((result = VK(vkAllocateMemory)(device, &memoryInfo, nullptr, &memory))) return result;
  undo.list.push_back([=] { VK(vkFreeMemory)(device, memory, nullptr); });
  VK(vkBindImageMemory)(device, image, memory, 0);
  VK(vkBindBufferMemory)(device, buffer, memory, 32768);
  void* mapped = nullptr;
  VK(vkMapMemory)(device, memory, 32768, 256, 0, &mapped);
  VkImageViewCreateInfo viewInfo{};
  viewInfo.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  viewInfo.image = image;
  viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D;
  viewInfo.format = imageInfo.format;
  viewInfo.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  MAKE(ImageView, view, viewInfo)
  VkAttachmentDescription attachment{0, imageInfo.format, VK_SAMPLE_COUNT_1_BIT, VK_ATTACHMENT_LOAD_OP_CLEAR, VK_ATTACHMENT_STORE_OP_STORE, VK_ATTACHMENT_LOAD_OP_DONT_CARE,
                                     VK_ATTACHMENT_STORE_OP_DONT_CARE, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL};
  VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_GENERAL};
  VkSubpassDescription subpass{};
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  VkRenderPassCreateInfo passInfo{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO, nullptr, 0, 1, &attachment, 1, &subpass, 0, nullptr};
  MAKE(RenderPass, pass, passInfo)
  VkFramebufferCreateInfo framebufferInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, pass, 1, &view, 8, 8, 1};
  MAKE(Framebuffer, framebuffer, framebufferInfo)
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_OCCLUSION, 4, 0};
  MAKE(QueryPool, queries, queryInfo)
  VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr};
  VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1, &binding};
  MAKE(DescriptorSetLayout, setLayout, setInfo)
  VkPipelineLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout, 0, nullptr};
  MAKE(PipelineLayout, layout, layoutInfo)
  VkDescriptorPoolSize poolSize{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 2};
  VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 2, 1, &poolSize};
  MAKE(DescriptorPool, pool, poolInfo)
  VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1, &setLayout};
  VkDescriptorSet set = VK_NULL_HANDLE;
  if ((result = VK(vkAllocateDescriptorSets)(device, &allocate, &set))) return result;
  VkDescriptorBufferInfo range{buffer, 0, 16};
  VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set, 0, 0, 1, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, nullptr, &range, nullptr};
  VK(vkUpdateDescriptorSets)(device, 1, &write, 0, nullptr);
  VkShaderModuleCreateInfo vertexInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, vertexWords.size() * 4, vertexWords.data()};
  MAKE(ShaderModule, vertex, vertexInfo)
  VkShaderModuleCreateInfo fragmentInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, fragmentWords.size() * 4, fragmentWords.data()};
  MAKE(ShaderModule, fragment, fragmentInfo)
  VkPipelineCacheCreateInfo cacheInfo{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO, nullptr, 0, 0, nullptr};
  MAKE(PipelineCache, cache, cacheInfo)
  GraphicsPipelineInfo pipelineInfo(vertex, fragment, layout, pass, 0, {8, 8});
  VkPipeline pipeline = VK_NULL_HANDLE;
  if ((result = VK(vkCreateGraphicsPipelines)(device, cache, 1, &pipelineInfo.info, nullptr, &pipeline))) return result;
  undo.list.push_back([=] { VK(vkDestroyPipeline)(device, pipeline, nullptr); });
  VkCommandPoolCreateInfo commandPoolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, 0};
  MAKE(CommandPool, commandPool, commandPoolInfo)
  VkCommandBufferAllocateInfo commandInfo{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, commandPool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
  VkCommandBuffer commands = VK_NULL_HANDLE;
  if ((result = VK(vkAllocateCommandBuffers)(device, &commandInfo, &commands))) return result;
  VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
  MAKE(Fence, fence, fenceInfo)
#undef MAKE

  const float colour[4] = {1, 0, 1, 1};
  std::memcpy(mapped, colour, sizeof colour);
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
  if ((result = VK(vkBeginCommandBuffer)(commands, &begin))) return result;
  VkClearValue clear{};
  VkRenderPassBeginInfo passBegin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, {8, 8}}, 1, &clear};
  VK(vkCmdResetQueryPool)(commands, queries, 0, 4);
  VK(vkCmdBeginRenderPass)(commands, &passBegin, VK_SUBPASS_CONTENTS_INLINE);
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
  for (uint32_t i = 0; i < 40; i++) {   // more than the first chunk of the command buffer holds
    VK(vkCmdBindDescriptorSets)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set, 0, nullptr);
    VK(vkCmdDraw)(commands, 3, 1, 0, 0);
  }
  VK(vkCmdEndRenderPass)(commands);
  VkBufferImageCopy copy{0, 0, 0, {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1}, {0, 0, 0}, {8, 8, 1}};
  VK(vkCmdCopyImageToBuffer)(commands, image, VK_IMAGE_LAYOUT_GENERAL, buffer, 1, &copy);
  if ((result = VK(vkEndCommandBuffer)(commands))) return result;
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO, nullptr, 0, nullptr, nullptr, 1, &commands, 0, nullptr};
  if ((result = VK(vkQueueSubmit)(queue, 1, &submit, fence))) return result;
  if ((result = VK(vkWaitForFences)(device, 1, &fence, VK_TRUE, ~0ull))) return result;
  std::memcpy(&pixel, static_cast<std::byte*>(mapped) + 4 * 27, 4);
  return VK_SUCCESS;
}

TEST(AllocationCallbacks, EachOfASceneMayFail) {
  const std::vector<uint32_t> vertex = vertexShader(kCoverAll);
  const std::vector<uint32_t> fragment =
      fragmentShader("#version 450\nlayout(binding = 0) uniform U { vec4 u; }; layout(location = 0) out vec4 c; void main() { c = u; }\n");
  long needed = 0;
  {
    Budget budget;
    uint32_t pixel = 0;
    ASSERT_EQ(scene(budget, vertex, fragment, pixel), VK_SUCCESS);
    EXPECT_EQ(pixel, 0xffff00ffu);
    EXPECT_TRUE(budget.live.empty()) << budget.live.size() << " allocations are not freed";
    needed = budget.total;
    // Objects, their arrays, descriptor memory and two chunks of commands at least.
    EXPECT_GE(needed, 25);
  }
  for (long n = 0; n < needed; n++) {
    SCOPED_TRACE("allocation " + std::to_string(n) + " of " + std::to_string(needed));
    Budget budget;
    budget.left = n;
    uint32_t pixel = 0;
    EXPECT_EQ(scene(budget, vertex, fragment, pixel), VK_ERROR_OUT_OF_HOST_MEMORY);
    EXPECT_TRUE(budget.refused);
    EXPECT_TRUE(budget.live.empty()) << budget.live.size() << " allocations are not freed";
  }
}

}  // namespace
}  // namespace pumice::icd::test
