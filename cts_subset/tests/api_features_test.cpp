// What the API of 1.1 to 1.3 brought besides drawing, end to end: descriptors, synchronisation, objects.
#include "cts_subset/tests/graphics.h"

#include <chrono>

namespace pumice::cts {
namespace {

class ApiFeatures : public DrawTest {};

TEST_P(ApiFeatures, BudgetPrioritiesAndCalibratedTimestamps) {
  PUMICE_NEED_FEATURE(device().has(VK_EXT_MEMORY_BUDGET_EXTENSION_NAME) && device().has(VK_EXT_CALIBRATED_TIMESTAMPS_EXTENSION_NAME));
  auto usage = [&] {
    VkPhysicalDeviceMemoryBudgetPropertiesEXT budget{};
    budget.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_BUDGET_PROPERTIES_EXT;
    VkPhysicalDeviceMemoryProperties2 m{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_PROPERTIES_2, &budget, {}};
    vkGetPhysicalDeviceMemoryProperties2(device().physical, &m);
    EXPECT_GT(budget.heapBudget[0], 0u);
    EXPECT_LE(budget.heapBudget[0], m.memoryProperties.memoryHeaps[0].size);
    return budget.heapUsage[0];
  };
  uint64_t before = usage();
  work->buffer(64 << 20, kStorage);
  if (GetParam() == Role::kTested) {
    EXPECT_GE(usage(), before + (64 << 20));
  }
  auto domains = reinterpret_cast<PFN_vkGetPhysicalDeviceCalibrateableTimeDomainsEXT>(
      vkGetInstanceProcAddr(world().instance->handle(), "vkGetPhysicalDeviceCalibrateableTimeDomainsEXT"));
  auto calibrated = reinterpret_cast<PFN_vkGetCalibratedTimestampsEXT>(vkGetDeviceProcAddr(handle(), "vkGetCalibratedTimestampsEXT"));
  ASSERT_TRUE(domains && calibrated);
  uint32_t count = 0;
  check(domains(device().physical, &count, nullptr), "vkGetPhysicalDeviceCalibrateableTimeDomainsEXT");
  std::vector<VkTimeDomainEXT> all(count);
  check(domains(device().physical, &count, all.data()), "vkGetPhysicalDeviceCalibrateableTimeDomainsEXT");
  EXPECT_NE(std::find(all.begin(), all.end(), VK_TIME_DOMAIN_DEVICE_EXT), all.end());
  std::vector<VkCalibratedTimestampInfoEXT> infos;
  for (VkTimeDomainEXT d : all) infos.push_back({VK_STRUCTURE_TYPE_CALIBRATED_TIMESTAMP_INFO_EXT, nullptr, d});
  std::vector<uint64_t> first(count), second(count);
  uint64_t deviation = 0;
  check(calibrated(handle(), count, infos.data(), first.data(), &deviation), "vkGetCalibratedTimestampsEXT");
  check(calibrated(handle(), count, infos.data(), second.data(), &deviation), "vkGetCalibratedTimestampsEXT");
  for (uint32_t i = 0; i < count; i++) EXPECT_GE(second[i], first[i]) << all[i];
  // A timestamp of the queue lies between two of the device's domain.
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_TIMESTAMP, 1, 0};
  VkQueryPool queries = work->make(queryInfo);
  device().run([&](VkCommandBuffer c) {
    vkCmdResetQueryPool(c, queries, 0, 1);
    vkCmdWriteTimestamp(c, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries, 0);
  });
  uint64_t stamp = 0, third = 0;
  check(vkGetQueryPoolResults(handle(), queries, 0, 1, 8, &stamp, 8, VK_QUERY_RESULT_64_BIT), "vkGetQueryPoolResults");
  VkCalibratedTimestampInfoEXT own{VK_STRUCTURE_TYPE_CALIBRATED_TIMESTAMP_INFO_EXT, nullptr, VK_TIME_DOMAIN_DEVICE_EXT};
  check(calibrated(handle(), 1, &own, &third, &deviation), "vkGetCalibratedTimestampsEXT");
  uint64_t device0 = second[std::find(all.begin(), all.end(), VK_TIME_DOMAIN_DEVICE_EXT) - all.begin()];
  EXPECT_LE(device0, stamp);
  EXPECT_LE(stamp, third);
  if (device().has(VK_KHR_GLOBAL_PRIORITY_EXTENSION_NAME)) {
    VkQueueFamilyGlobalPriorityPropertiesKHR priorities{};
    priorities.sType = VK_STRUCTURE_TYPE_QUEUE_FAMILY_GLOBAL_PRIORITY_PROPERTIES_KHR;
    VkQueueFamilyProperties2 family{VK_STRUCTURE_TYPE_QUEUE_FAMILY_PROPERTIES_2, &priorities, {}};
    uint32_t one = 1;
    vkGetPhysicalDeviceQueueFamilyProperties2(device().physical, &one, &family);
    EXPECT_GE(priorities.priorityCount, 1u);
    // Devices are made with those priorities that are reported and with no others.
    const auto end = priorities.priorities + priorities.priorityCount;
    for (VkQueueGlobalPriorityKHR p : {VK_QUEUE_GLOBAL_PRIORITY_LOW_KHR, VK_QUEUE_GLOBAL_PRIORITY_MEDIUM_KHR, VK_QUEUE_GLOBAL_PRIORITY_HIGH_KHR}) {
      VkDeviceQueueGlobalPriorityCreateInfoKHR wanted{VK_STRUCTURE_TYPE_DEVICE_QUEUE_GLOBAL_PRIORITY_CREATE_INFO_KHR, nullptr, p};
      const float priority = 1;
      VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, &wanted, 0, device().family, 1, &priority};
      const char* extension = VK_KHR_GLOBAL_PRIORITY_EXTENSION_NAME;
      VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, nullptr, 0, 1, &queue, 0, nullptr, 1, &extension, nullptr};
      VkDevice made = VK_NULL_HANDLE;
      VkResult result = vkCreateDevice(device().physical, &info, nullptr, &made);
      EXPECT_EQ(result == VK_SUCCESS, std::find(priorities.priorities, end, p) != end) << "priority " << p << " gives " << result;
      if (made) vkDestroyDevice(made, nullptr);
    }
  }
}

const char* const kSumShader = R"(#version 460
layout(local_size_x = 1) in;
layout(binding = 0) uniform U { uvec4 u; };
layout(binding = 1) readonly buffer A { uint a[]; };
layout(binding = 2) buffer Out { uint r[]; };
layout(push_constant) uniform P { uint index; };
void main() { r[index] = u.x * 1000 + u.y * 100 + a[0] * 10 + a[1]; }
)";

struct SumBuffers {
  explicit SumBuffers(Workspace& work)
      : u{work.bufferOf(Words{1, 2, 0, 0}, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT), work.bufferOf(Words{3, 4, 0, 0}, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT)},
        a{work.bufferOf(Words{5, 6}, kStorage), work.bufferOf(Words{7, 8}, kStorage)},
        out(work.bufferOf(Words(8, 0), kStorage)) {}
  Buffer u[2], a[2], out;
  uint32_t result(uint32_t i) const {
    uint32_t v;
    std::memcpy(&v, out.mapped + 4 * i, 4);
    return v;
  }
};

TEST_P(ApiFeatures, PushDescriptors) {
  PUMICE_NEED_FEATURE(device().has(VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME));
  auto pushSet = reinterpret_cast<PFN_vkCmdPushDescriptorSetKHR>(vkGetDeviceProcAddr(handle(), "vkCmdPushDescriptorSetKHR"));
  auto pushTemplate = reinterpret_cast<PFN_vkCmdPushDescriptorSetWithTemplateKHR>(vkGetDeviceProcAddr(handle(), "vkCmdPushDescriptorSetWithTemplateKHR"));
  ASSERT_TRUE(pushSet && pushTemplate);
  SumBuffers b(*work);
  VkDescriptorSetLayout setLayout = makeSetLayout(*work,
                                                  {computeBinding(0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER),
                                                   computeBinding(2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)},
                                                  VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR);
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 4);
  VkPipeline pipeline = makeCompute(*work, work->shader(VK_SHADER_STAGE_COMPUTE_BIT, kSumShader), layout);
  VkDescriptorUpdateTemplateEntry entry{1, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 8, 0};
  VkDescriptorUpdateTemplateCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO, nullptr, 0, 1, &entry,
                                            VK_DESCRIPTOR_UPDATE_TEMPLATE_TYPE_PUSH_DESCRIPTORS_KHR, setLayout, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0};
  VkDescriptorUpdateTemplate update = work->make(info);
  device().run([&](VkCommandBuffer c) {
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    VkDescriptorBufferInfo infos[4] = {{b.u[0].handle, 0, VK_WHOLE_SIZE}, {b.a[0].handle, 0, VK_WHOLE_SIZE}, {b.out.handle, 0, VK_WHOLE_SIZE}, {b.u[1].handle, 0, VK_WHOLE_SIZE}};
    VkWriteDescriptorSet writes[3] = {writeBuffer(VK_NULL_HANDLE, 0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, &infos[0]),
                                      writeBuffer(VK_NULL_HANDLE, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[1]),
                                      writeBuffer(VK_NULL_HANDLE, 2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[2])};
    auto dispatch = [&](uint32_t index) {
      vkCmdPushConstants(c, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &index);
      vkCmdDispatch(c, 1, 1, 1);
    };
    pushSet(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 3, writes);
    dispatch(0);
    // One binding changes, the others stay.
    VkWriteDescriptorSet other = writeBuffer(VK_NULL_HANDLE, 0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, &infos[3]);
    pushSet(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &other);
    dispatch(1);
    struct {
      uint64_t before;
      VkDescriptorBufferInfo info;
    } data{0, {b.a[1].handle, 0, VK_WHOLE_SIZE}};
    pushTemplate(c, update, layout, 0, &data);
    dispatch(2);
    fullBarrier(c);
  });
  EXPECT_EQ(b.result(0), 1256u);
  EXPECT_EQ(b.result(1), 3456u);
  EXPECT_EQ(b.result(2), 3478u);
}

TEST_P(ApiFeatures, InlineUniformBlocksAndUpdateTemplates) {
  PUMICE_NEED_FEATURE(device().vulkan13.inlineUniformBlock);
  SumBuffers b(*work);
  VkDescriptorSetLayout setLayout = makeSetLayout(*work, {computeBinding(0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, 16),
                                                          computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER)});
  VkPipelineLayout layout = makePipelineLayout(*work, {setLayout}, 4);
  VkPipeline pipeline = makeCompute(*work, work->shader(VK_SHADER_STAGE_COMPUTE_BIT, kSumShader), layout);
  VkDescriptorPoolInlineUniformBlockCreateInfo blocks{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_INLINE_UNIFORM_BLOCK_CREATE_INFO, nullptr, 3};
  VkDescriptorPool pool = makePool(*work, {{VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, 48}, {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 6}}, 3, 0, &blocks);
  VkDescriptorSet sets[3];
  for (auto& s : sets) s = makeSet(*work, pool, setLayout);
  // The first is written, the second copied and changed in part, the third comes by a template.
  VkDescriptorBufferInfo infos[2] = {{b.a[0].handle, 0, VK_WHOLE_SIZE}, {b.out.handle, 0, VK_WHOLE_SIZE}};
  const uint32_t data[4] = {1, 2, 0, 0}, four = 4;
  VkWriteDescriptorSetInlineUniformBlock block{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_INLINE_UNIFORM_BLOCK, nullptr, 16, data}, part = block;
  part.dataSize = 4, part.pData = &four;
  VkWriteDescriptorSet writes[3] = {writeBuffer(sets[0], 0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, nullptr, 0, 16),
                                    writeBuffer(sets[0], 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[0]), writeBuffer(sets[0], 2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &infos[1])};
  writes[0].pNext = &block;
  vkUpdateDescriptorSets(handle(), 3, writes, 0, nullptr);
  VkCopyDescriptorSet copies[3]{};
  for (uint32_t i = 0; i < 3; i++) copies[i] = {VK_STRUCTURE_TYPE_COPY_DESCRIPTOR_SET, nullptr, sets[0], i, 0, sets[1], i, 0, i ? 1u : 16u};
  vkUpdateDescriptorSets(handle(), 0, nullptr, 3, copies);
  VkWriteDescriptorSet change = writeBuffer(sets[1], 0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, nullptr, 4, 4);
  change.pNext = &part;
  vkUpdateDescriptorSets(handle(), 1, &change, 0, nullptr);
  struct Data {
    uint32_t words[4];
    VkDescriptorBufferInfo a, out;
  } source{{7, 8, 0, 0}, {b.a[1].handle, 0, VK_WHOLE_SIZE}, {b.out.handle, 0, VK_WHOLE_SIZE}};
  VkDescriptorUpdateTemplateEntry entries[3] = {{0, 0, 16, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, offsetof(Data, words), 0},
                                                {1, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, offsetof(Data, a), 0},
                                                {2, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, offsetof(Data, out), 0}};
  VkDescriptorUpdateTemplateCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO, nullptr, 0, 3, entries,
                                            VK_DESCRIPTOR_UPDATE_TEMPLATE_TYPE_DESCRIPTOR_SET, setLayout, VK_PIPELINE_BIND_POINT_COMPUTE, VK_NULL_HANDLE, 0};
  VkDescriptorUpdateTemplate update = work->make(info);
  vkUpdateDescriptorSetWithTemplate(handle(), sets[2], update, &source);
  device().run([&](VkCommandBuffer c) {
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    for (uint32_t i = 0; i < 3; i++) {
      vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &sets[i], 0, nullptr);
      vkCmdPushConstants(c, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &i);
      vkCmdDispatch(c, 1, 1, 1);
    }
    fullBarrier(c);
  });
  EXPECT_EQ(b.result(0), 1256u);
  EXPECT_EQ(b.result(1), 1456u);
  EXPECT_EQ(b.result(2), 7878u);
}

// The queue waits for a value that the host signals later; the host waits for what the queue signals.
// What a set may hold does not depend on the size asked for; many blocks are many descriptors, not many bytes.
TEST_P(ApiFeatures, LayoutSupportOfInlineUniformBlocks) {
  PUMICE_NEED_FEATURE(device().vulkan13.inlineUniformBlock);
  if (GetParam() == Role::kPeer) GTEST_SKIP() << "the figures are those of one driver";
  const auto v13 = properties<VkPhysicalDeviceVulkan13Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES);
  for (uint32_t bytes : {0u, 4u, v13.maxInlineUniformBlockSize}) {
    VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, bytes, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    VkDescriptorBindingFlags flag = VK_DESCRIPTOR_BINDING_VARIABLE_DESCRIPTOR_COUNT_BIT;
    VkDescriptorSetLayoutBindingFlagsCreateInfo flags{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO, nullptr, 1, &flag};
    VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, &flags, 0, 1, &binding};
    VkDescriptorSetVariableDescriptorCountLayoutSupport variable{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_VARIABLE_DESCRIPTOR_COUNT_LAYOUT_SUPPORT, nullptr, 0};
    VkDescriptorSetLayoutSupport support{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_SUPPORT, &variable, VK_FALSE};
    vkGetDescriptorSetLayoutSupport(handle(), &info, &support);
    EXPECT_TRUE(support.supported) << bytes;
    EXPECT_EQ(variable.maxVariableDescriptorCount, v13.maxInlineUniformBlockSize) << bytes;
  }
  std::vector<VkDescriptorSetLayoutBinding> many(v13.maxDescriptorSetInlineUniformBlocks);
  for (uint32_t i = 0; i < many.size(); ++i) many[i] = {i, VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK, 4, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, uint32_t(many.size()), many.data()};
  VkDescriptorSetLayoutSupport support{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_SUPPORT, nullptr, VK_FALSE};
  vkGetDescriptorSetLayoutSupport(handle(), &info, &support);
  EXPECT_TRUE(support.supported);
}

TEST_P(ApiFeatures, TimelineSemaphoresWithSubmit2) {
  PUMICE_NEED_FEATURE(device().vulkan12.timelineSemaphore && device().vulkan13.synchronization2);
  VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO, nullptr, VK_SEMAPHORE_TYPE_TIMELINE, 5};
  VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type, 0};
  VkSemaphore timeline = work->make(info);
  uint64_t value = 0;
  check(vkGetSemaphoreCounterValue(handle(), timeline, &value), "vkGetSemaphoreCounterValue");
  EXPECT_EQ(value, 5u);
  Buffer buffer = work->bufferOf(Words{0}, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, device().family};
  VkCommandPool pool = work->make(poolInfo);
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
  VkCommandBuffer commands = VK_NULL_HANDLE;
  check(vkAllocateCommandBuffers(handle(), &allocate, &commands), "vkAllocateCommandBuffers");
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
  check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
  vkCmdFillBuffer(commands, buffer.handle, 0, 4, 123);
  VkMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, nullptr, VK_PIPELINE_STAGE_2_CLEAR_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_HOST_BIT,
                           VK_ACCESS_2_HOST_READ_BIT};
  VkDependencyInfo dependency{};
  dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &barrier;
  vkCmdPipelineBarrier2(commands, &dependency);
  check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
  VkSemaphoreSubmitInfo wait{VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO, nullptr, timeline, 8, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, 0}, signal = wait;
  signal.value = 10;
  VkCommandBufferSubmitInfo one{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO, nullptr, commands, 0};
  VkSubmitInfo2 submit{VK_STRUCTURE_TYPE_SUBMIT_INFO_2, nullptr, 0, 1, &wait, 1, &one, 1, &signal};
  check(vkQueueSubmit2(device().queue, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit2");
  uint64_t ten = 10;
  VkSemaphoreWaitInfo waitInfo{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO, nullptr, 0, 1, &timeline, &ten};
  EXPECT_EQ(vkWaitSemaphores(handle(), &waitInfo, 20'000'000), VK_TIMEOUT) << "nobody has signalled 8";
  VkSemaphoreSignalInfo seven{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO, nullptr, timeline, 7};
  check(vkSignalSemaphore(handle(), &seven), "vkSignalSemaphore");
  EXPECT_EQ(vkWaitSemaphores(handle(), &waitInfo, 20'000'000), VK_TIMEOUT) << "7 is not enough";
  seven.value = 9;
  check(vkSignalSemaphore(handle(), &seven), "vkSignalSemaphore");
  EXPECT_EQ(vkWaitSemaphores(handle(), &waitInfo, 10'000'000'000ull), VK_SUCCESS);
  uint32_t word;
  std::memcpy(&word, buffer.mapped, 4);
  EXPECT_EQ(word, 123u);
  device().waitIdle();
}

TEST_P(ApiFeatures, Synchronization2CommandsAndCopies2) {
  PUMICE_NEED_FEATURE(device().vulkan13.synchronization2);
  VkEventCreateInfo eventInfo{VK_STRUCTURE_TYPE_EVENT_CREATE_INFO, nullptr, 0};
  VkEvent event = work->make(eventInfo);
  VkQueryPoolCreateInfo queryInfo{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_TIMESTAMP, 2, 0};
  VkQueryPool queries = work->make(queryInfo);
  vkResetQueryPool(handle(), queries, 0, 2);
  Words data(64);
  for (uint32_t i = 0; i < 64; i++) data[i] = i * 3;
  constexpr VkBufferUsageFlags kBoth = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  Buffer a = work->bufferOf(data, kBoth), b = work->bufferOf(Words(64, 0), kBoth), c = work->bufferOf(Words(64, 0), kBoth);
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {8, 8, 1};
  Image first = work->image(spec), second = work->image(spec);
  toGeneral(*work, first);
  toGeneral(*work, second);
  device().run([&](VkCommandBuffer commands) {
    VkMemoryBarrier2 all{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, nullptr, VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
                         VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT};
    VkDependencyInfo dependency{};
    dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    dependency.memoryBarrierCount = 1;
    dependency.pMemoryBarriers = &all;
    vkCmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries, 0);
    VkBufferCopy2 whole{VK_STRUCTURE_TYPE_BUFFER_COPY_2, nullptr, 0, 0, 256};
    VkCopyBufferInfo2 buffers{VK_STRUCTURE_TYPE_COPY_BUFFER_INFO_2, nullptr, a.handle, b.handle, 1, &whole};
    vkCmdCopyBuffer2(commands, &buffers);
    vkCmdSetEvent2(commands, event, &dependency);
    vkCmdWaitEvents2(commands, 1, &event, &dependency);
    VkBufferImageCopy2 region{};
    region.sType = VK_STRUCTURE_TYPE_BUFFER_IMAGE_COPY_2;
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {8, 8, 1};
    VkCopyBufferToImageInfo2 upload{VK_STRUCTURE_TYPE_COPY_BUFFER_TO_IMAGE_INFO_2, nullptr, b.handle, first.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &region};
    vkCmdCopyBufferToImage2(commands, &upload);
    vkCmdPipelineBarrier2(commands, &dependency);
    VkImageCopy2 image{};
    image.sType = VK_STRUCTURE_TYPE_IMAGE_COPY_2;
    image.srcSubresource = image.dstSubresource = region.imageSubresource;
    image.srcOffset = {1, 0, 0};
    image.extent = {7, 8, 1};
    VkCopyImageInfo2 images{VK_STRUCTURE_TYPE_COPY_IMAGE_INFO_2, nullptr, first.handle, VK_IMAGE_LAYOUT_GENERAL, second.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &image};
    vkCmdCopyImage2(commands, &images);
    vkCmdPipelineBarrier2(commands, &dependency);
    VkImageBlit2 mirror{};
    mirror.sType = VK_STRUCTURE_TYPE_IMAGE_BLIT_2;
    mirror.srcSubresource = mirror.dstSubresource = region.imageSubresource;
    mirror.srcOffsets[1] = {7, 8, 1};
    mirror.dstOffsets[0] = {7, 0, 0};
    mirror.dstOffsets[1] = {0, 8, 1};
    VkBlitImageInfo2 blit{VK_STRUCTURE_TYPE_BLIT_IMAGE_INFO_2, nullptr, second.handle, VK_IMAGE_LAYOUT_GENERAL, first.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &mirror, VK_FILTER_NEAREST};
    vkCmdBlitImage2(commands, &blit);
    all.srcStageMask |= VK_PIPELINE_STAGE_2_BLIT_BIT;
    vkCmdPipelineBarrier2(commands, &dependency);
    VkCopyImageToBufferInfo2 back{VK_STRUCTURE_TYPE_COPY_IMAGE_TO_BUFFER_INFO_2, nullptr, first.handle, VK_IMAGE_LAYOUT_GENERAL, c.handle, 1, &region};
    vkCmdCopyImageToBuffer2(commands, &back);
    vkCmdResetEvent2(commands, event, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT);
    vkCmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries, 1);
    fullBarrier(commands);
  });
  Words r = valuesOf<uint32_t>(wordsOf(bytesOf(c)));
  for (uint32_t y = 0; y < 8; y++)
    for (uint32_t x = 0; x < 8; x++) EXPECT_EQ(r[y * 8 + x], (x < 7 ? y * 8 + 7 - x : y * 8 + 7) * 3) << x << " " << y;
  uint64_t times[2];
  EXPECT_EQ(vkGetQueryPoolResults(handle(), queries, 0, 2, sizeof times, times, 8, VK_QUERY_RESULT_64_BIT), VK_SUCCESS);
  EXPECT_LE(times[0], times[1]);
  EXPECT_EQ(vkGetEventStatus(handle(), event), VK_EVENT_RESET);
}

TEST_P(ApiFeatures, PipelineCreationCacheControlAndFeedback) {
  PUMICE_NEED_FEATURE(device().vulkan13.pipelineCreationCacheControl && device().vulkan13.dynamicRendering);
  VkPipelineLayout layout = pushLayout();
  VkPipelineCreationFeedback whole{}, stages[2]{};
  VkPipelineCreationFeedbackCreateInfo feedback{VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO, nullptr, &whole, 2, stages};
  GraphicsSpec spec;
  // A shader that no cache can know.
  spec.fragment = "#version 460\nlayout(location = 0) out uvec4 color;\nvoid main() { color = uvec4(" +
                  std::to_string(std::chrono::steady_clock::now().time_since_epoch().count() & 0xffffff) + "); }\n";
  spec.colors = {kUint};
  spec.flags = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;
  VkPipeline pipeline = VkPipeline(0x1);
  VkResult result = tryGraphics(*work, layout, spec, &pipeline);
  EXPECT_TRUE(result == VK_PIPELINE_COMPILE_REQUIRED || result == VK_SUCCESS) << result;
  EXPECT_EQ(pipeline != VK_NULL_HANDLE, result == VK_SUCCESS);
  spec.flags = 0;
  spec.next = &feedback;
  pipeline = VK_NULL_HANDLE;
  EXPECT_EQ(tryGraphics(*work, layout, spec, &pipeline), VK_SUCCESS);
  if (whole.flags & VK_PIPELINE_CREATION_FEEDBACK_VALID_BIT) {
    EXPECT_GT(whole.duration, 0u);
  }
}

TEST_P(ApiFeatures, PrivateDataRequirementsAndFormatFlags) {
  PUMICE_NEED_FEATURE(device().vulkan13.privateData && device().vulkan13.maintenance4);
  VkPrivateDataSlotCreateInfo slotInfo{VK_STRUCTURE_TYPE_PRIVATE_DATA_SLOT_CREATE_INFO, nullptr, 0};
  VkPrivateDataSlot slot = work->make(slotInfo);
  Buffer buffer = work->bufferOf(Words(100), kStorage);
  uint64_t data = 1;
  vkGetPrivateData(handle(), VK_OBJECT_TYPE_BUFFER, uint64_t(buffer.handle), slot, &data);
  EXPECT_EQ(data, 0u);
  EXPECT_EQ(vkSetPrivateData(handle(), VK_OBJECT_TYPE_BUFFER, uint64_t(buffer.handle), slot, 0x123456789abcull), VK_SUCCESS);
  vkGetPrivateData(handle(), VK_OBJECT_TYPE_BUFFER, uint64_t(buffer.handle), slot, &data);
  EXPECT_EQ(data, 0x123456789abcull);

  // Requirements from the create-info alone are those of the object.
  VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, nullptr, 0, 400, kStorage, VK_SHARING_MODE_EXCLUSIVE, 0, nullptr};
  VkDeviceBufferMemoryRequirements ask{VK_STRUCTURE_TYPE_DEVICE_BUFFER_MEMORY_REQUIREMENTS, nullptr, &bufferInfo};
  VkMemoryRequirements2 found{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2, nullptr, {}};
  vkGetDeviceBufferMemoryRequirements(handle(), &ask, &found);
  VkMemoryRequirements own;
  vkGetBufferMemoryRequirements(handle(), buffer.handle, &own);
  EXPECT_EQ(found.memoryRequirements.size, own.size);
  EXPECT_EQ(found.memoryRequirements.alignment, own.alignment);
  EXPECT_EQ(found.memoryRequirements.memoryTypeBits, own.memoryTypeBits);

  for (VkFormat format : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_D32_SFLOAT, VK_FORMAT_R32_UINT}) {
    VkFormatProperties3 three{};
    three.sType = VK_STRUCTURE_TYPE_FORMAT_PROPERTIES_3;
    VkFormatProperties2 two{VK_STRUCTURE_TYPE_FORMAT_PROPERTIES_2, &three, {}};
    vkGetPhysicalDeviceFormatProperties2(device().physical, format, &two);
    EXPECT_EQ(three.optimalTilingFeatures & two.formatProperties.optimalTilingFeatures, two.formatProperties.optimalTilingFeatures) << format;
    EXPECT_EQ(three.bufferFeatures & two.formatProperties.bufferFeatures, two.formatProperties.bufferFeatures) << format;
    if (format == VK_FORMAT_D32_SFLOAT) {
      EXPECT_TRUE(three.optimalTilingFeatures & VK_FORMAT_FEATURE_2_SAMPLED_IMAGE_DEPTH_COMPARISON_BIT);
    }
  }
  uint32_t tools = 77;
  EXPECT_EQ(vkGetPhysicalDeviceToolProperties(device().physical, &tools, nullptr), VK_SUCCESS);
  EXPECT_LT(tools, 77u);
}

PUMICE_ON_BOTH_DEVICES(ApiFeatures);

}  // namespace
}  // namespace pumice::cts
