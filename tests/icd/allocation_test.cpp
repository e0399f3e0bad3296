// VkAllocationCallbacks for every object type: used, given everything back, and every failure of theirs is
// VK_ERROR_OUT_OF_HOST_MEMORY with nothing left behind. The same for the C++ allocations inside the driver.
// And the device's heap, when it is asked for too much.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <new>
#include <set>
#include <utility>

#include "tests/icd/graphics.h"

#ifndef PUMICE_SANITIZER_RUNTIME
extern thread_local long allocationsLeft;  // failing_new.cpp
#else
static thread_local long allocationsLeft;
#endif

namespace pumice::icd::test {
namespace {

// The callbacks' own bookkeeping does not fail.
struct Unlimited {
  long before = std::exchange(allocationsLeft, -1);
  ~Unlimited() { allocationsLeft = before; }
};

struct CountingAllocator {
  std::map<void*, VkSystemAllocationScope> live;
  std::set<VkSystemAllocationScope> scopes;
  long total = 0, left = -1;
  VkAllocationCallbacks callbacks{this, allocate, reallocate, release, nullptr, nullptr};

  static void* VKAPI_PTR allocate(void* user, size_t size, size_t alignment, VkSystemAllocationScope scope) {
    Unlimited unlimited;
    auto& self = *static_cast<CountingAllocator*>(user);
    EXPECT_GT(size, 0u);
    EXPECT_TRUE(alignment && !(alignment & (alignment - 1))) << alignment;
    if (self.left == 0) return nullptr;
    if (self.left > 0) self.left--;
    void* memory = std::aligned_alloc(std::max(alignment, sizeof(void*)),
                                      (size + alignment + 63) & ~std::max<size_t>(alignment - 1, 63));
    std::memset(memory, 0xcd, size);
    self.live[memory] = scope;
    self.scopes.insert(scope);
    self.total++;
    return memory;
  }
  static void* VKAPI_PTR reallocate(void*, void*, size_t, size_t, VkSystemAllocationScope) {
    ADD_FAILURE() << "nothing needs reallocation";
    return nullptr;
  }
  static void VKAPI_PTR release(void* user, void* memory) {
    Unlimited unlimited;
    if (!memory) return;
    EXPECT_EQ(static_cast<CountingAllocator*>(user)->live.erase(memory), 1u)
        << "freed what was not allocated here";
    std::free(memory);
  }
};

using Create = std::function<VkResult(const VkAllocationCallbacks*)>;
using Destroy = std::function<void(const VkAllocationCallbacks*)>;

void expectHonoured(const char* what, VkSystemAllocationScope scope, const Create& create,
                    const Destroy& destroy) {
  SCOPED_TRACE(what);
  for (long n = 0;; n++) {
    ASSERT_LT(n, 1000) << "never succeeds";
    CountingAllocator allocator;
    allocator.left = n;
    VkResult result = create(&allocator.callbacks);
    if (result == VK_SUCCESS) {
      EXPECT_GT(n, 0) << "made without the callbacks";
      EXPECT_TRUE(allocator.scopes.count(scope)) << "not in its scope";
      destroy(&allocator.callbacks);
      EXPECT_TRUE(allocator.live.empty()) << allocator.live.size() << " allocations are not freed";
      break;
    }
    EXPECT_EQ(result, VK_ERROR_OUT_OF_HOST_MEMORY) << "allocation " << n << " failed";
    EXPECT_TRUE(allocator.live.empty()) << "left behind when allocation " << n << " failed";
  }
#ifndef PUMICE_SANITIZER_RUNTIME
  for (long n = 0;; n++) {
    ASSERT_LT(n, 5000) << "never succeeds";
    CountingAllocator allocator;
    allocationsLeft = n;
    VkResult result = create(&allocator.callbacks);  // an exception that gets out ends the process
    allocationsLeft = -1;
    if (result == VK_SUCCESS) {
      destroy(&allocator.callbacks);
      break;
    }
    EXPECT_EQ(result, VK_ERROR_OUT_OF_HOST_MEMORY) << "C++ allocation " << n << " failed";
    EXPECT_TRUE(allocator.live.empty()) << "left behind when C++ allocation " << n << " failed";
  }
#endif
}

constexpr auto kObject = VK_SYSTEM_ALLOCATION_SCOPE_OBJECT;

TEST(AllocationCallbacks, InstanceAndDevice) {
  VkInstance instance = VK_NULL_HANDLE;
  auto create = reinterpret_cast<PFN_vkCreateInstance>(driver().find(VK_NULL_HANDLE, "vkCreateInstance"));
  expectHonoured(
      "instance", VK_SYSTEM_ALLOCATION_SCOPE_INSTANCE,
      [&](auto* callbacks) {
        VkInstanceCreateInfo info{
            VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, nullptr, 0, nullptr, 0, nullptr, 0, nullptr};
        return create(&info, callbacks, &instance);
      },
      [&](auto* callbacks) {
        VK(vkDestroyInstance)
        (instance, callbacks);
      });
  VkDevice device = VK_NULL_HANDLE;
  float priority = 1;
  VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
  VkDeviceCreateInfo info{
      VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, nullptr, 0, 1, &queue, 0, nullptr, 0, nullptr, nullptr};
  expectHonoured(
      "device", VK_SYSTEM_ALLOCATION_SCOPE_DEVICE,
      [&](auto* callbacks) {
        return VK(vkCreateDevice)(physicalDevice(commonInstance()), &info, callbacks, &device);
      },
      [&](auto* callbacks) {
        VK(vkDestroyDevice)
        (device, callbacks);
      });
}

// Objects without callbacks of their own take the device's.
TEST(AllocationCallbacks, OfTheDeviceServeItsObjects) {
  CountingAllocator allocator;
  {
    VkDevice device = VK_NULL_HANDLE;
    float priority = 1;
    VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, 0, 1, &priority};
    VkDeviceCreateInfo info{
        VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, nullptr, 0, 1, &queue, 0, nullptr, 0, nullptr, nullptr};
    ASSERT_EQ(VK(vkCreateDevice)(physicalDevice(commonInstance()), &info, &allocator.callbacks, &device),
              VK_SUCCESS);
    long before = allocator.total;
    VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
    VkFence fence = VK_NULL_HANDLE;
    ASSERT_EQ(VK(vkCreateFence)(device, &fenceInfo, nullptr, &fence), VK_SUCCESS);
    EXPECT_GT(allocator.total, before);
    VK(vkDestroyFence)(device, fence, nullptr);
    VK(vkDestroyDevice)(device, &allocator.callbacks);
  }
  EXPECT_TRUE(allocator.live.empty());
}

#define HONOURED(Type, info)                                                                         \
  {                                                                                                  \
    Vk##Type made = VK_NULL_HANDLE;                                                                  \
    expectHonoured(                                                                                  \
        #Type, kObject,                                                                              \
        [&](auto* callbacks) { return VK(vkCreate##Type)(device.handle, &info, callbacks, &made); }, \
        [&](auto* callbacks) {                                                                       \
          VK(vkDestroy##Type)                                                                        \
          (device.handle, made, callbacks);                                                          \
        });                                                                                          \
  }

TEST(AllocationCallbacks, EveryOtherObject) {
  TestDevice device;
  TestDevice::Buffer buffer = device.buffer(256, VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT);
  Target target(device, VK_FORMAT_R8G8B8A8_UNORM, {8, 8});

  VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
                                nullptr,
                                0,
                                64,
                                VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                                VK_SHARING_MODE_EXCLUSIVE,
                                0,
                                nullptr};
  HONOURED(Buffer, bufferInfo)
  VkBufferViewCreateInfo bufferView{VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO,
                                    nullptr,
                                    0,
                                    buffer.handle,
                                    VK_FORMAT_R8G8B8A8_UNORM,
                                    0,
                                    VK_WHOLE_SIZE};
  HONOURED(BufferView, bufferView)
  VkImageCreateInfo imageInfo{};
  imageInfo.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  imageInfo.imageType = VK_IMAGE_TYPE_2D;
  imageInfo.format = VK_FORMAT_R8G8B8A8_UNORM;
  imageInfo.extent = {16, 16, 1};
  imageInfo.mipLevels = imageInfo.arrayLayers = 1;
  imageInfo.samples = VK_SAMPLE_COUNT_1_BIT;
  imageInfo.usage = VK_IMAGE_USAGE_SAMPLED_BIT;
  HONOURED(Image, imageInfo)
  VkImageViewCreateInfo imageView{};
  imageView.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  imageView.image = target.image;
  imageView.viewType = VK_IMAGE_VIEW_TYPE_2D;
  imageView.format = VK_FORMAT_R8G8B8A8_UNORM;
  imageView.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0,
                                VK_REMAINING_ARRAY_LAYERS};
  HONOURED(ImageView, imageView)
  VkSamplerCreateInfo samplerInfo{};
  samplerInfo.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  HONOURED(Sampler, samplerInfo)
  std::vector<uint32_t> words = vertexShader(kCoverAll);
  VkShaderModuleCreateInfo moduleInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0,
                                      words.size() * 4, words.data()};
  HONOURED(ShaderModule, moduleInfo)
  VkPipelineCacheCreateInfo cacheInfo{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO, nullptr, 0, 0, nullptr};
  HONOURED(PipelineCache, cacheInfo)
  VkDescriptorSetLayoutBinding bindings[2] = {
      {0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2, VK_SHADER_STAGE_ALL, nullptr},
      {5, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 3, VK_SHADER_STAGE_ALL, nullptr}};
  VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 2,
                                          bindings};
  HONOURED(DescriptorSetLayout, setInfo)
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateDescriptorSetLayout)(device.handle, &setInfo, nullptr, &setLayout), VK_SUCCESS);
  VkPipelineLayoutCreateInfo layoutInfo{
      VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout, 0, nullptr};
  HONOURED(PipelineLayout, layoutInfo)
  VkDescriptorUpdateTemplateEntry entry{
      0, 0, 2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 0, sizeof(VkDescriptorBufferInfo)};
  VkDescriptorUpdateTemplateCreateInfo templateInfo{};
  templateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO;
  templateInfo.descriptorUpdateEntryCount = 1;
  templateInfo.pDescriptorUpdateEntries = &entry;
  templateInfo.descriptorSetLayout = setLayout;
  HONOURED(DescriptorUpdateTemplate, templateInfo)
  VkDescriptorPoolSize sizes[2] = {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 20},
                                   {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 30}};
  VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
                                      nullptr,
                                      VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT,
                                      10,
                                      2,
                                      sizes};
  HONOURED(DescriptorPool, poolInfo)
  VkCommandPoolCreateInfo commandPoolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, 0};
  HONOURED(CommandPool, commandPoolInfo)
  VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
  HONOURED(Fence, fenceInfo)
  VkSemaphoreCreateInfo semaphoreInfo{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, nullptr, 0};
  HONOURED(Semaphore, semaphoreInfo)
  VkEventCreateInfo eventInfo{VK_STRUCTURE_TYPE_EVENT_CREATE_INFO, nullptr, 0};
  HONOURED(Event, eventInfo)
  VkQueryPoolCreateInfo queryInfo{
      VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_OCCLUSION, 8, 0};
  HONOURED(QueryPool, queryInfo)

  VkAttachmentDescription attachment{0,
                                     VK_FORMAT_R8G8B8A8_UNORM,
                                     VK_SAMPLE_COUNT_1_BIT,
                                     VK_ATTACHMENT_LOAD_OP_CLEAR,
                                     VK_ATTACHMENT_STORE_OP_STORE,
                                     VK_ATTACHMENT_LOAD_OP_CLEAR,
                                     VK_ATTACHMENT_STORE_OP_STORE,
                                     VK_IMAGE_LAYOUT_UNDEFINED,
                                     VK_IMAGE_LAYOUT_GENERAL};
  VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_GENERAL};
  VkSubpassDescription subpass{};
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  VkRenderPassCreateInfo passInfo{
      VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO, nullptr, 0, 1, &attachment, 1, &subpass, 0, nullptr};
  HONOURED(RenderPass, passInfo)
  VkRenderPass pass = target.pass();
  VkFramebufferCreateInfo framebufferInfo{
      VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, pass, 1, &target.view, 8, 8, 1};
  HONOURED(Framebuffer, framebufferInfo)

  VkMemoryAllocateInfo memoryInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, 4096, 0};
  VkDeviceMemory memory = VK_NULL_HANDLE;
  expectHonoured(
      "memory", kObject,
      [&](auto* callbacks) { return VK(vkAllocateMemory)(device.handle, &memoryInfo, callbacks, &memory); },
      [&](auto* callbacks) {
        VK(vkFreeMemory)
        (device.handle, memory, callbacks);
      });

  VkHeadlessSurfaceCreateInfoEXT surfaceInfo{VK_STRUCTURE_TYPE_HEADLESS_SURFACE_CREATE_INFO_EXT, nullptr, 0};
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  expectHonoured(
      "surface", kObject,
      [&](auto* callbacks) {
        return VK(vkCreateHeadlessSurfaceEXT)(commonInstance(), &surfaceInfo, callbacks, &surface);
      },
      [&](auto* callbacks) {
        VK(vkDestroySurfaceKHR)
        (commonInstance(), surface, callbacks);
      });
  ASSERT_EQ(VK(vkCreateHeadlessSurfaceEXT)(commonInstance(), &surfaceInfo, nullptr, &surface), VK_SUCCESS);
  VkSwapchainCreateInfoKHR swapchainInfo{};
  swapchainInfo.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR;
  swapchainInfo.surface = surface;
  swapchainInfo.minImageCount = 3;
  swapchainInfo.imageFormat = VK_FORMAT_B8G8R8A8_UNORM;
  swapchainInfo.imageExtent = {64, 64};
  swapchainInfo.imageArrayLayers = 1;
  swapchainInfo.imageUsage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  swapchainInfo.preTransform = VK_SURFACE_TRANSFORM_IDENTITY_BIT_KHR;
  swapchainInfo.compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
  swapchainInfo.presentMode = VK_PRESENT_MODE_FIFO_KHR;
  HONOURED(SwapchainKHR, swapchainInfo)
  VK(vkDestroySurfaceKHR)(commonInstance(), surface, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
  VK(vkDestroyDescriptorSetLayout)(device.handle, setLayout, nullptr);
  device.release(buffer);
}

TEST(AllocationCallbacks, Pipelines) {
  TestDevice device;
  Target target(device, VK_FORMAT_R8G8B8A8_UNORM, {8, 8});
  VkRenderPass pass = target.pass();
  VkPipelineLayout layout = target.layout();
  VkShaderModule vertex = device.module(vertexShader(kCoverAll));
  VkShaderModule fragment = device.module(
      fragmentShader("#version 450\nlayout(location = 0) out vec4 c; void main() { c = vec4(1); }\n"));
  VkShaderModule compute =
      device.module(computeShader("#version 450\nlayout(local_size_x = 4) in; void main() {}\n"));
  GraphicsPipelineInfo graphics(vertex, fragment, layout, pass, 0, {8, 8});
  VkComputePipelineCreateInfo computeInfo{};
  computeInfo.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  computeInfo.stage = graphics.stages[0];
  computeInfo.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  computeInfo.stage.module = compute;
  computeInfo.layout = layout;
  // Two at once: when one fails, the other is either made or null, and can be destroyed either way.
  VkGraphicsPipelineCreateInfo two[2] = {graphics.info, graphics.info};
  for (long n = 0; n < 3; n++) {
    CountingAllocator allocator;
    allocator.left = n;
    VkPipeline made[2] = {VkPipeline(8), VkPipeline(8)};
    VkResult result =
        VK(vkCreateGraphicsPipelines)(device.handle, VK_NULL_HANDLE, 2, two, &allocator.callbacks, made);
    EXPECT_EQ(result, n < 2 ? VK_ERROR_OUT_OF_HOST_MEMORY : VK_SUCCESS);
    EXPECT_EQ(made[0] != VK_NULL_HANDLE, n > 0);
    EXPECT_EQ(made[1] != VK_NULL_HANDLE, n > 1);
    for (VkPipeline p : made) VK(vkDestroyPipeline)(device.handle, p, &allocator.callbacks);
    EXPECT_TRUE(allocator.live.empty());
    allocator.left = n;
    VkComputePipelineCreateInfo twoCompute[2] = {computeInfo, computeInfo};
    result = VK(vkCreateComputePipelines)(device.handle, VK_NULL_HANDLE, 2, twoCompute, &allocator.callbacks,
                                          made);
    EXPECT_EQ(result, n < 2 ? VK_ERROR_OUT_OF_HOST_MEMORY : VK_SUCCESS);
    for (VkPipeline p : made) VK(vkDestroyPipeline)(device.handle, p, &allocator.callbacks);
    EXPECT_TRUE(allocator.live.empty());
  }
  for (VkShaderModule m : {vertex, fragment, compute}) VK(vkDestroyShaderModule)(device.handle, m, nullptr);
  VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
}

// What comes out of pools uses the pool's callbacks; a failure gives back the whole batch and nulls its
// handles.
TEST(AllocationCallbacks, PoolsServeWhatComesOutOfThem) {
  TestDevice device;
  VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2, VK_SHADER_STAGE_ALL, nullptr};
  VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1,
                                          &binding};
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateDescriptorSetLayout)(device.handle, &setInfo, nullptr, &setLayout), VK_SUCCESS);
  const VkDescriptorSetLayout layouts[3] = {setLayout, setLayout, setLayout};
  for (const VkDescriptorPoolCreateFlags poolFlags : {0, int(VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT)}) {
    bool commandsDone = false, setsDone = false;
    for (long n = 0; n < 50 && !(commandsDone && setsDone); n++) {
      CountingAllocator allocator;
      VkCommandPoolCreateInfo commandPoolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, 0};
      VkCommandPool commandPool = VK_NULL_HANDLE;
      ASSERT_EQ(VK(vkCreateCommandPool)(device.handle, &commandPoolInfo, &allocator.callbacks, &commandPool),
                VK_SUCCESS);
      VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 6};
      VkDescriptorPoolCreateInfo poolInfo{
          VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, poolFlags, 3, 1, &size};
      VkDescriptorPool pool = VK_NULL_HANDLE;
      ASSERT_EQ(VK(vkCreateDescriptorPool)(device.handle, &poolInfo, &allocator.callbacks, &pool), VK_SUCCESS);
      size_t before = allocator.live.size();
      allocator.left = n;
      VkCommandBuffer commands[3];
      VkCommandBufferAllocateInfo commandInfo{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr,
                                              commandPool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 3};
      VkResult result = VK(vkAllocateCommandBuffers)(device.handle, &commandInfo, commands);
      commandsDone = result == VK_SUCCESS;
      if (!commandsDone) {
        EXPECT_EQ(result, VK_ERROR_OUT_OF_HOST_MEMORY);
        for (VkCommandBuffer c : commands) EXPECT_EQ(c, VkCommandBuffer(VK_NULL_HANDLE));
        EXPECT_EQ(allocator.live.size(), before);
      }
      allocator.left = n;
      before = allocator.live.size();
      VkDescriptorSet sets[3];
      VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 3,
                                           layouts};
      result = VK(vkAllocateDescriptorSets)(device.handle, &allocate, sets);
      setsDone = result == VK_SUCCESS;
      if (!setsDone) {
        EXPECT_EQ(result, VK_ERROR_OUT_OF_HOST_MEMORY);
        for (VkDescriptorSet s : sets) EXPECT_EQ(s, VkDescriptorSet(VK_NULL_HANDLE));
        EXPECT_EQ(allocator.live.size(), before);
        // The pool is whole again.
        allocator.left = -1;
        EXPECT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &allocate, sets), VK_SUCCESS);
      }
      allocator.left = -1;
      VkDescriptorSet more = VK_NULL_HANDLE;
      allocate.descriptorSetCount = 1;
      EXPECT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &allocate, &more), VK_ERROR_OUT_OF_POOL_MEMORY);
      EXPECT_EQ(VK(vkResetDescriptorPool)(device.handle, pool, 0), VK_SUCCESS);
      const VkDescriptorSetLayout four[4] = {setLayout, setLayout, setLayout, setLayout};
      VkDescriptorSetAllocateInfo tooMany{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 4, four};
      VkDescriptorSet none[4];
      EXPECT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &tooMany, none), VK_ERROR_OUT_OF_POOL_MEMORY);
      allocate.descriptorSetCount = 3;   // nothing was taken by what failed
      EXPECT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &allocate, sets), VK_SUCCESS);
      VK(vkDestroyDescriptorPool)(device.handle, pool, &allocator.callbacks);
      VK(vkDestroyCommandPool)(device.handle, commandPool, &allocator.callbacks);
      EXPECT_TRUE(allocator.live.empty()) << allocator.live.size();
    }
    EXPECT_TRUE(commandsDone && setsDone);
  }
  VK(vkDestroyDescriptorSetLayout)(device.handle, setLayout, nullptr);
}

#ifndef PUMICE_SANITIZER_RUNTIME
// Recording has no result: the failure comes out at vkEndCommandBuffer.
TEST(HostMemory, RunningOutWhileRecordingIsToldAtTheEnd) {
  TestDevice device;
  Target target(device, VK_FORMAT_R8G8B8A8_UNORM, {8, 8});
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkClearValue clear{};
  VkRenderPassBeginInfo begin{
      VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, {8, 8}}, 1, &clear};
  auto beginPass = VK(vkCmdBeginRenderPass);
  auto endPass = VK(vkCmdEndRenderPass);
  auto end = VK(vkEndCommandBuffer);
  auto copy2 = VK(vkCmdCopyBuffer2KHR);
  TestDevice::Buffer buffer = device.buffer(64);
  VkBufferCopy2 region{VK_STRUCTURE_TYPE_BUFFER_COPY_2, nullptr, 0, 32, 16};
  VkCopyBufferInfo2 copy{
      VK_STRUCTURE_TYPE_COPY_BUFFER_INFO_2, nullptr, buffer.handle, buffer.handle, 1, &region};
  VkResult result = VK_ERROR_UNKNOWN;
  for (long n = 0; n < 100 && result != VK_SUCCESS; n++) {
    VkCommandBuffer commands = device.begin();
    allocationsLeft = n;
    beginPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    endPass(commands);
    copy2(commands, &copy);
    allocationsLeft = -1;
    result = end(commands);
    if (result != VK_SUCCESS) {
      EXPECT_EQ(result, VK_ERROR_OUT_OF_HOST_MEMORY) << n;
    }
    VK(vkFreeCommandBuffers)(device.handle, device.pool, 1, &commands);
  }
  EXPECT_EQ(result, VK_SUCCESS);
  // And submission.
  VkCommandBuffer commands = device.begin();
  device.end(commands);
  auto submit = VK(vkQueueSubmit);
  VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO, nullptr, 0, nullptr, nullptr, 1, &commands, 0, nullptr};
  result = VK_ERROR_UNKNOWN;
  for (long n = 0; n < 100 && result != VK_SUCCESS; n++) {
    allocationsLeft = n;
    result = submit(device.queue, 1, &info, VK_NULL_HANDLE);
    allocationsLeft = -1;
    if (result != VK_SUCCESS) {
      EXPECT_EQ(result, VK_ERROR_OUT_OF_HOST_MEMORY) << n;
    }
  }
  EXPECT_EQ(result, VK_SUCCESS);
  VK(vkQueueWaitIdle)(device.queue);
  VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
  device.release(buffer);
}
#endif

TEST(DeviceMemory, MoreThanTheHeapFailsAndTheHeapStaysUsable) {
  TestDevice device;
  VkPhysicalDeviceMemoryProperties m;
  VK(vkGetPhysicalDeviceMemoryProperties)(physicalDevice(commonInstance()), &m);
  VkDeviceSize heap = m.memoryHeaps[0].size;
  auto allocate = [&](VkDeviceSize bytes, VkDeviceMemory& out) {
    VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, bytes, 0};
    return VK(vkAllocateMemory)(device.handle, &info, nullptr, &out);
  };
  VkDeviceMemory memory = VK_NULL_HANDLE, half = VK_NULL_HANDLE, other = VK_NULL_HANDLE;
  for (int round = 0; round < 3; round++) {
    for (VkDeviceSize bytes :
         {heap + 1, heap * 2, VkDeviceSize(1) << 62, ~VkDeviceSize(0), ~VkDeviceSize(0) - heap})
      EXPECT_EQ(allocate(bytes, memory), VK_ERROR_OUT_OF_DEVICE_MEMORY) << bytes;
    ASSERT_EQ(allocate(heap / 2 + 4096, half), VK_SUCCESS);
    EXPECT_EQ(allocate(heap / 2, memory), VK_ERROR_OUT_OF_DEVICE_MEMORY) << "together more than the heap";
    ASSERT_EQ(allocate(heap / 2 - 4096, other), VK_SUCCESS) << "together exactly the heap";
    VK(vkFreeMemory)(device.handle, half, nullptr);
    VK(vkFreeMemory)(device.handle, other, nullptr);
  }
  TestDevice::Buffer buffer = device.buffer(64);
  VkCommandBuffer commands = device.begin();
  VK(vkCmdFillBuffer)(commands, buffer.handle, 0, VK_WHOLE_SIZE, 7);
  device.run(commands);
  EXPECT_EQ(buffer.words[15], 7u);
  device.release(buffer);
}

TEST(DeviceMemory, HugeResourcesFailWithAResult) {
  TestDevice device;
  for (VkDeviceSize size : {VkDeviceSize(1) << 40, VkDeviceSize(1) << 62, ~VkDeviceSize(0)}) {
    VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
                            nullptr,
                            0,
                            size,
                            VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                            VK_SHARING_MODE_EXCLUSIVE,
                            0,
                            nullptr};
    VkBuffer buffer = VK_NULL_HANDLE;
    VkResult result = VK(vkCreateBuffer)(device.handle, &info, nullptr, &buffer);
    if (result == VK_SUCCESS) {
      VkMemoryRequirements needs;
      VK(vkGetBufferMemoryRequirements)(device.handle, buffer, &needs);
      EXPECT_GE(needs.size, size);
      VK(vkDestroyBuffer)(device.handle, buffer, nullptr);
    } else {
      EXPECT_EQ(result, VK_ERROR_OUT_OF_DEVICE_MEMORY);
    }
  }
  VkPhysicalDeviceProperties p;
  VK(vkGetPhysicalDeviceProperties)(physicalDevice(commonInstance()), &p);
  uint32_t edge = p.limits.maxImageDimension2D;
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = VK_FORMAT_R32G32B32A32_SFLOAT;
  info.extent = {edge, edge, 1};
  info.mipLevels = 1;
  info.arrayLayers = p.limits.maxImageArrayLayers;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.usage = VK_IMAGE_USAGE_SAMPLED_BIT;
  VkImage image = VK_NULL_HANDLE;
  VkResult result = VK(vkCreateImage)(device.handle, &info, nullptr, &image);
  if (result == VK_SUCCESS) {
    VkMemoryRequirements needs;
    VK(vkGetImageMemoryRequirements)(device.handle, image, &needs);
    EXPECT_GE(needs.size, VkDeviceSize(edge) * edge * 16 * info.arrayLayers);
    VK(vkDestroyImage)(device.handle, image, nullptr);
  } else {
    EXPECT_EQ(result, VK_ERROR_OUT_OF_DEVICE_MEMORY);
  }
}

}  // namespace
}  // namespace pumice::icd::test
