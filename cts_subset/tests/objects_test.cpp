// Command buffers, synchronisation, queries and host allocation, as the specification has them.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/tests/devices.h"

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <thread>

namespace pumice::cts {
namespace {

class Objects : public OnDevice {
 protected:
  void SetUp() override {
    OnDevice::SetUp();
    if (HasFatalFailure() || IsSkipped()) return;
    work = std::make_unique<Workspace>(device());
  }
  void TearDown() override { work.reset(); }

  VkDevice handle() { return device().handle; }

  VkCommandPool commandPool(VkCommandPoolCreateFlags flags) {
    VkCommandPoolCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    info.flags = flags;
    info.queueFamilyIndex = device().family;
    return work->make(info);
  }
  VkCommandBuffer commandBuffer(VkCommandPool pool,
                                VkCommandBufferLevel level = VK_COMMAND_BUFFER_LEVEL_PRIMARY) {
    VkCommandBufferAllocateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    info.commandPool = pool;
    info.level = level;
    info.commandBufferCount = 1;
    VkCommandBuffer made = VK_NULL_HANDLE;
    check(vkAllocateCommandBuffers(handle(), &info, &made), "vkAllocateCommandBuffers");
    return made;
  }
  VkFence fence(bool signalled = false) {
    VkFenceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    info.flags = signalled ? VK_FENCE_CREATE_SIGNALED_BIT : 0;
    return work->make(info);
  }
  VkSemaphore semaphore() {
    VkSemaphoreCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO;
    return work->make(info);
  }
  VkEvent event() {
    VkEventCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_EVENT_CREATE_INFO;
    return work->make(info);
  }
  VkQueryPool queries(VkQueryType type, uint32_t count) {
    VkQueryPoolCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
    info.queryType = type;
    info.queryCount = count;
    return work->make(info);
  }
  void begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags = 0) {
    VkCommandBufferBeginInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    info.flags = flags;
    check(vkBeginCommandBuffer(commands, &info), "vkBeginCommandBuffer");
  }
  void submit(VkCommandBuffer commands, VkFence done, VkSemaphore wait = VK_NULL_HANDLE,
              VkSemaphore signal = VK_NULL_HANDLE) {
    VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    VkSubmitInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    info.waitSemaphoreCount = wait ? 1 : 0;
    info.pWaitSemaphores = &wait;
    info.pWaitDstStageMask = &stage;
    info.commandBufferCount = commands ? 1 : 0;
    info.pCommandBuffers = &commands;
    info.signalSemaphoreCount = signal ? 1 : 0;
    info.pSignalSemaphores = &signal;
    check(vkQueueSubmit(device().queue, 1, &info, done), "vkQueueSubmit");
  }
  void await(VkFence done) {
    check(vkWaitForFences(handle(), 1, &done, VK_TRUE, 30'000'000'000ull), "vkWaitForFences");
  }
  uint32_t wordOf(const Buffer& buffer, size_t index = 0) {
    uint32_t word;
    std::memcpy(&word, buffer.mapped + index * 4, 4);
    return word;
  }
  Buffer words(size_t count) {
    Bytes zero(count * 4);
    return work->buffer(zero.size(), VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                        zero.data());
  }

  std::unique_ptr<Workspace> work;
};

TEST_P(Objects, CommandBuffersCanBeSubmittedAgainAndReset) {
  Buffer buffer = words(1);
  VkCommandPool pool = commandPool(VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT);
  VkCommandBuffer commands = commandBuffer(pool);
  VkFence done = fence();
  begin(commands);
  vkCmdFillBuffer(commands, buffer.handle, 0, 4, 11);
  fullBarrier(commands);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  for (int i = 0; i < 3; ++i) {
    std::memset(buffer.mapped, 0, 4);
    submit(commands, done);
    await(done);
    EXPECT_EQ(wordOf(buffer), 11u);
    check(vkResetFences(handle(), 1, &done), "vkResetFences");
  }
  begin(commands);  // resets by itself
  vkCmdFillBuffer(commands, buffer.handle, 0, 4, 12);
  fullBarrier(commands);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  submit(commands, done);
  await(done);
  EXPECT_EQ(wordOf(buffer), 12u);
  check(vkResetCommandPool(handle(), pool, VK_COMMAND_POOL_RESET_RELEASE_RESOURCES_BIT),
        "vkResetCommandPool");
  check(vkResetFences(handle(), 1, &done), "vkResetFences");
  begin(commands);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  submit(commands, done);  // an empty one
  await(done);
  vkFreeCommandBuffers(handle(), pool, 1, &commands);
}

TEST_P(Objects, SecondaryCommandBuffersDrawInsideARenderPass) {
  Canvas canvas(device(), 64, 64);
  Pipeline pipeline = canvas.pipeline({});
  VkCommandPool pool = commandPool(0);
  VkCommandBuffer primary = commandBuffer(pool);
  VkCommandBuffer secondary[2] = {commandBuffer(pool, VK_COMMAND_BUFFER_LEVEL_SECONDARY),
                                  commandBuffer(pool, VK_COMMAND_BUFFER_LEVEL_SECONDARY)};
  Buffer target = work->buffer(64 * 64 * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  VkCommandBufferInheritanceInfo inheritance{};
  inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
  inheritance.renderPass = canvas.pass();
  for (int i = 0; i < 2; ++i) {
    VkCommandBufferBeginInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    info.flags = VK_COMMAND_BUFFER_USAGE_RENDER_PASS_CONTINUE_BIT;
    info.pInheritanceInfo = &inheritance;
    check(vkBeginCommandBuffer(secondary[i], &info), "vkBeginCommandBuffer");
    setViewport(secondary[i], 0, 0, 64, 64);
    setScissor(secondary[i], i * 32, 0, 32, 64);
    glm::vec4 colour = i ? glm::vec4(0, 0, 1, 1) : glm::vec4(0, 1, 0, 1);
    canvas.drawVertices(secondary[i], pipeline,
                        {{{-1, -1, 0, 1}, colour}, {{3, -1, 0, 1}, colour}, {{-1, 3, 0, 1}, colour}});
    check(vkEndCommandBuffer(secondary[i]), "vkEndCommandBuffer");
  }
  begin(primary);
  VkClearValue clear{{{1, 0, 0, 1}}};
  VkRenderPassBeginInfo pass{};
  pass.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  pass.renderPass = canvas.pass();
  pass.framebuffer = canvas.target();
  pass.renderArea = {{0, 0}, {64, 64}};
  pass.clearValueCount = 1;
  pass.pClearValues = &clear;
  vkCmdBeginRenderPass(primary, &pass, VK_SUBPASS_CONTENTS_SECONDARY_COMMAND_BUFFERS);
  vkCmdExecuteCommands(primary, 2, secondary);
  vkCmdEndRenderPass(primary);
  VkBufferImageCopy region{};
  region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  region.imageExtent = {64, 64, 1};
  vkCmdCopyImageToBuffer(primary, canvas.colourImage().handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         target.handle, 1, &region);
  fullBarrier(primary);
  check(vkEndCommandBuffer(primary), "vkEndCommandBuffer");
  VkFence done = fence();
  submit(primary, done);
  await(done);
  for (size_t y = 0; y < 64; ++y)
    for (size_t x = 0; x < 64; ++x)
      ASSERT_EQ(wordOf(target, y * 64 + x), x < 32 ? 0xff00ff00u : 0xffff0000u) << x << "," << y;
}

// Outside the render area everything is kept, whatever the load operation; LOAD keeps what is inside.
TEST_P(Objects, RenderAreaAndLoadOperations) {
  Canvas canvas(device(), 70, 50);
  canvas.draw({0, 0, 1, 1}, [](VkCommandBuffer) {});
  Buffer target = work->buffer(70 * 50 * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  auto renderPass = [&](VkAttachmentLoadOp load) {
    VkAttachmentDescription attachment{};
    attachment.format = Canvas::kColourFormat;
    attachment.samples = VK_SAMPLE_COUNT_1_BIT;
    attachment.loadOp = load;
    attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    attachment.initialLayout = attachment.finalLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
    VkSubpassDescription subpass{};
    subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    subpass.colorAttachmentCount = 1;
    subpass.pColorAttachments = &reference;
    VkRenderPassCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
    info.attachmentCount = 1;
    info.pAttachments = &attachment;
    info.subpassCount = 1;
    info.pSubpasses = &subpass;
    return work->make(info);
  };
  VkRenderPass clearing = renderPass(VK_ATTACHMENT_LOAD_OP_CLEAR);
  VkRenderPass loading = renderPass(VK_ATTACHMENT_LOAD_OP_LOAD);
  VkImageView view = canvas.view(canvas.colourImage());
  VkFramebuffer framebuffer = canvas.framebufferOf(clearing, {view}, {70, 50});
  device().run([&](VkCommandBuffer commands) {
    VkClearValue clear{{{0, 1, 0, 1}}};
    VkRenderPassBeginInfo pass{};
    pass.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
    pass.renderPass = clearing;
    pass.framebuffer = framebuffer;
    pass.renderArea = {{13, 7}, {41, 30}};
    pass.clearValueCount = 1;
    pass.pClearValues = &clear;
    vkCmdBeginRenderPass(commands, &pass, VK_SUBPASS_CONTENTS_INLINE);
    vkCmdEndRenderPass(commands);
    fullBarrier(commands);
    pass.renderPass = loading;
    pass.renderArea = {{0, 0}, {70, 50}};
    vkCmdBeginRenderPass(commands, &pass, VK_SUBPASS_CONTENTS_INLINE);
    VkClearAttachment attachment{VK_IMAGE_ASPECT_COLOR_BIT, 0, {{{1, 0, 0, 1}}}};
    VkClearRect rectangle{{{20, 10}, {3, 2}}, 0, 1};
    vkCmdClearAttachments(commands, 1, &attachment, 1, &rectangle);
    vkCmdEndRenderPass(commands);
    fullBarrier(commands);
    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {70, 50, 1};
    vkCmdCopyImageToBuffer(commands, canvas.colourImage().handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                           target.handle, 1, &region);
    fullBarrier(commands);
  });
  for (size_t y = 0; y < 50; ++y)
    for (size_t x = 0; x < 70; ++x) {
      bool inside = x >= 13 && x < 54 && y >= 7 && y < 37;
      bool red = x >= 20 && x < 23 && y >= 10 && y < 12;
      ASSERT_EQ(wordOf(target, y * 70 + x), red      ? 0xff0000ffu
                                            : inside ? 0xff00ff00u
                                                     : 0xffff0000u)
          << x << "," << y;
    }
}

TEST_P(Objects, FencesTellTheTruth) {
  VkFence signalled = fence(true), done = fence();
  EXPECT_EQ(vkGetFenceStatus(handle(), signalled), VK_SUCCESS);
  EXPECT_EQ(vkGetFenceStatus(handle(), done), VK_NOT_READY);
  EXPECT_EQ(vkWaitForFences(handle(), 1, &done, VK_TRUE, 1'000'000), VK_TIMEOUT);
  EXPECT_EQ(vkWaitForFences(handle(), 1, &done, VK_TRUE, 0), VK_TIMEOUT);
  VkFence both[] = {done, signalled};
  EXPECT_EQ(vkWaitForFences(handle(), 2, both, VK_FALSE, 1'000'000), VK_SUCCESS);
  EXPECT_EQ(vkWaitForFences(handle(), 2, both, VK_TRUE, 1'000'000), VK_TIMEOUT);
  submit(VK_NULL_HANDLE, done);  // no work at all
  await(done);
  EXPECT_EQ(vkGetFenceStatus(handle(), done), VK_SUCCESS);
  check(vkResetFences(handle(), 2, both), "vkResetFences");
  EXPECT_EQ(vkGetFenceStatus(handle(), signalled), VK_NOT_READY);
}

TEST_P(Objects, SemaphoresOrderSubmissions) {
  Buffer buffer = words(1);
  VkCommandPool pool = commandPool(0);
  VkSemaphore first = semaphore(), second = semaphore();
  VkCommandBuffer commands[3];
  for (uint32_t i = 0; i < 3; ++i) {
    commands[i] = commandBuffer(pool);
    begin(commands[i]);
    vkCmdFillBuffer(commands[i], buffer.handle, 0, 4, 100 + i);
    fullBarrier(commands[i]);
    check(vkEndCommandBuffer(commands[i]), "vkEndCommandBuffer");
  }
  VkFence done = fence();
  submit(commands[0], VK_NULL_HANDLE, VK_NULL_HANDLE, first);
  submit(commands[1], VK_NULL_HANDLE, first, second);
  submit(commands[2], done, second);
  await(done);
  EXPECT_EQ(wordOf(buffer), 102u);
  check(vkQueueWaitIdle(device().queue), "vkQueueWaitIdle");
}

TEST_P(Objects, EventsWaitForHostAndDevice) {
  VkEvent fromHost = event(), fromDevice = event();
  EXPECT_EQ(vkGetEventStatus(handle(), fromHost), VK_EVENT_RESET);
  Buffer buffer = words(1);
  VkCommandPool pool = commandPool(0);
  VkCommandBuffer commands = commandBuffer(pool);
  begin(commands);
  vkCmdSetEvent(commands, fromDevice, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT);
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_HOST_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  vkCmdWaitEvents(commands, 1, &fromHost, VK_PIPELINE_STAGE_HOST_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 1,
                  &barrier, 0, nullptr, 0, nullptr);
  vkCmdFillBuffer(commands, buffer.handle, 0, 4, 77);
  fullBarrier(commands);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  VkFence done = fence();
  submit(commands, done);
  for (int i = 0; i < 3000 && vkGetEventStatus(handle(), fromDevice) != VK_EVENT_SET; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(vkGetEventStatus(handle(), fromDevice), VK_EVENT_SET);
  EXPECT_EQ(vkWaitForFences(handle(), 1, &done, VK_TRUE, 20'000'000), VK_TIMEOUT)
      << "the queue did not wait for the event";
  EXPECT_EQ(wordOf(buffer), 0u);
  check(vkSetEvent(handle(), fromHost), "vkSetEvent");
  await(done);
  EXPECT_EQ(wordOf(buffer), 77u);
  check(vkResetEvent(handle(), fromHost), "vkResetEvent");
  EXPECT_EQ(vkGetEventStatus(handle(), fromHost), VK_EVENT_RESET);
}

TEST_P(Objects, OcclusionQueriesCountOrSaySo) {
  Canvas canvas(device(), 64, 64);
  Pipeline pipeline = canvas.pipeline({});
  VkQueryPool pool = queries(VK_QUERY_TYPE_OCCLUSION, 3);
  device().run([&](VkCommandBuffer commands) { vkCmdResetQueryPool(commands, pool, 0, 3); });
  uint64_t values[6] = {};
  EXPECT_EQ(vkGetQueryPoolResults(handle(), pool, 0, 1, sizeof values, values, 16,
                                  VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT),
            VK_NOT_READY);
  EXPECT_EQ(values[1], 0u);
  canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    auto square = [&](double side) {
      Vertex a{atPixel({64, 64}, 0, 0), {}}, b{atPixel({64, 64}, side, 0), {}},
          c{atPixel({64, 64}, side, side), {}}, d{atPixel({64, 64}, 0, side), {}};
      return std::vector<Vertex>{a, b, c, a, c, d};
    };
    vkCmdBeginQuery(commands, pool, 0, 0);
    canvas.drawVertices(commands, pipeline, square(20));
    vkCmdEndQuery(commands, pool, 0);
    vkCmdBeginQuery(commands, pool, 1, 0);
    vkCmdEndQuery(commands, pool, 1);
    vkCmdBeginQuery(commands, pool, 2, 0);
    setScissor(commands, 10, 0, 64, 64);
    canvas.drawVertices(commands, pipeline, square(64));
    vkCmdEndQuery(commands, pool, 2);
  });
  check(vkGetQueryPoolResults(
            handle(), pool, 0, 3, sizeof values, values, 16,
            VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults");
  EXPECT_EQ(values[1], 1u);
  EXPECT_EQ(values[3], 1u);
  EXPECT_EQ(values[5], 1u);
  EXPECT_EQ(values[2], 0u) << "nothing was drawn";
  // Without occlusionQueryPrecise a driver may answer with any number above zero.
  if (device().features.occlusionQueryPrecise) {
    EXPECT_EQ(values[0], 400u);
    EXPECT_EQ(values[4], 54u * 64u);
  } else {
    EXPECT_GT(values[0], 0u);
    EXPECT_GT(values[4], 0u);
  }
}

TEST_P(Objects, TimestampsRiseWhereTheyAreSupported) {
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(device().physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(device().physical, &count, families.data());
  if (families[device().family].timestampValidBits == 0) GTEST_SKIP() << "no timestamps reported";
  VkQueryPool pool = queries(VK_QUERY_TYPE_TIMESTAMP, 2);
  Buffer buffer = words(1 << 20);
  device().run([&](VkCommandBuffer commands) {
    vkCmdResetQueryPool(commands, pool, 0, 2);
    vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, pool, 0);
    vkCmdFillBuffer(commands, buffer.handle, 0, VK_WHOLE_SIZE, 5);
    fullBarrier(commands);
    vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool, 1);
  });
  uint64_t times[2] = {};
  check(vkGetQueryPoolResults(handle(), pool, 0, 2, sizeof times, times, 8,
                              VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults");
  EXPECT_GT(times[1], times[0]);
  double elapsed = double(times[1] - times[0]) * device().properties.limits.timestampPeriod;
  EXPECT_LT(elapsed, 60e9);
}

// Counts what a driver asks of the application's allocator; everything must come back.
struct Counter {
  std::atomic<long> live{0}, total{0};
  static void* VKAPI_CALL allocate(void* user, size_t size, size_t alignment, VkSystemAllocationScope) {
    auto* self = static_cast<Counter*>(user);
    alignment = std::max(alignment, sizeof(void*));
    size_t room = (size + alignment - 1) / alignment * alignment;
    void* memory = std::aligned_alloc(alignment, std::max(room, alignment));
    if (memory) ++self->live, ++self->total;
    return memory;
  }
  static void* VKAPI_CALL reallocate(void* user, void* old, size_t size, size_t alignment,
                                     VkSystemAllocationScope scope) {
    if (!old) return allocate(user, size, alignment, scope);
    if (size == 0) return release(user, old), nullptr;
    auto* self = static_cast<Counter*>(user);
    void* memory = std::realloc(old, size);  // alignments beyond malloc's are not asked for here
    ++self->total;
    return memory;
  }
  static void VKAPI_CALL release(void* user, void* memory) {
    if (!memory) return;
    --static_cast<Counter*>(user)->live;
    std::free(memory);
  }
  VkAllocationCallbacks callbacks() { return {this, allocate, reallocate, release, nullptr, nullptr}; }
};

TEST_P(Objects, AllocationCallbacksAreHonoured) {
  Counter counter;
  VkAllocationCallbacks callbacks = counter.callbacks();
  VkFenceCreateInfo fenceInfo{};
  fenceInfo.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence made = VK_NULL_HANDLE;
  check(vkCreateFence(handle(), &fenceInfo, &callbacks, &made), "vkCreateFence");
  EXPECT_GT(counter.total, 0) << "vkCreateFence did not ask the callbacks";
  vkDestroyFence(handle(), made, &callbacks);
  EXPECT_EQ(counter.live, 0);
  VkBufferCreateInfo bufferInfo{};
  bufferInfo.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  bufferInfo.size = 64;
  bufferInfo.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  VkBuffer buffer = VK_NULL_HANDLE;
  long before = counter.total;
  check(vkCreateBuffer(handle(), &bufferInfo, &callbacks, &buffer), "vkCreateBuffer");
  EXPECT_GT(counter.total, before) << "vkCreateBuffer did not ask the callbacks";
  vkDestroyBuffer(handle(), buffer, &callbacks);
  EXPECT_EQ(counter.live, 0);
}

TEST_P(Objects, FailingCallbacksGiveOutOfHostMemory) {
  VkAllocationCallbacks failing{};
  failing.pfnAllocation = [](void*, size_t, size_t, VkSystemAllocationScope) -> void* { return nullptr; };
  failing.pfnReallocation = [](void*, void*, size_t, size_t, VkSystemAllocationScope) -> void* {
    return nullptr;
  };
  failing.pfnFree = [](void*, void*) {};
  VkFenceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence made = VK_NULL_HANDLE;
  EXPECT_EQ(vkCreateFence(handle(), &info, &failing, &made), VK_ERROR_OUT_OF_HOST_MEMORY);
}

TEST_P(Objects, PipelineCacheHasTheStandardHeader) {
  VkPipelineCacheCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO;
  VkPipelineCache cache = VK_NULL_HANDLE;
  check(vkCreatePipelineCache(handle(), &info, nullptr, &cache), "vkCreatePipelineCache");
  size_t size = 0;
  check(vkGetPipelineCacheData(handle(), cache, &size, nullptr), "vkGetPipelineCacheData");
  ASSERT_GE(size, 32u);
  Bytes data(size);
  check(vkGetPipelineCacheData(handle(), cache, &size, data.data()), "vkGetPipelineCacheData");
  uint32_t header[4];
  std::memcpy(header, data.data(), 16);
  EXPECT_EQ(header[0], 32u);
  EXPECT_EQ(header[1], uint32_t(VK_PIPELINE_CACHE_HEADER_VERSION_ONE));
  EXPECT_EQ(header[2], device().properties.vendorID);
  EXPECT_EQ(header[3], device().properties.deviceID);
  EXPECT_EQ(std::memcmp(&data[16], device().properties.pipelineCacheUUID, VK_UUID_SIZE), 0);
  // Data from elsewhere is not an error.
  Bytes foreign = noise(200, 3);
  info.initialDataSize = foreign.size();
  info.pInitialData = foreign.data();
  VkPipelineCache other = VK_NULL_HANDLE;
  EXPECT_EQ(vkCreatePipelineCache(handle(), &info, nullptr, &other), VK_SUCCESS);
  vkDestroyPipelineCache(handle(), other, nullptr);
  vkDestroyPipelineCache(handle(), cache, nullptr);
}

PUMICE_ON_BOTH_DEVICES(Objects);

}  // namespace
}  // namespace pumice::cts
