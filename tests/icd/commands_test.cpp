// Commands at the edges of what is allowed: null handles, counts of zero, VK_WHOLE_SIZE, arrays that run over
// several bindings, secondary buffers, simultaneous use, subpasses, framebuffers without images, queries
// across passes.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

TEST(NullHandles, AreIgnoredWhenDestroyed) {
  TestDevice device;
#define NOTHING(name) VK(name)(device.handle, VK_NULL_HANDLE, nullptr)
  NOTHING(vkDestroyBuffer);
  NOTHING(vkDestroyBufferView);
  NOTHING(vkDestroyImage);
  NOTHING(vkDestroyImageView);
  NOTHING(vkDestroySampler);
  NOTHING(vkDestroyShaderModule);
  NOTHING(vkDestroyPipeline);
  NOTHING(vkDestroyPipelineCache);
  NOTHING(vkDestroyPipelineLayout);
  NOTHING(vkDestroyRenderPass);
  NOTHING(vkDestroyFramebuffer);
  NOTHING(vkDestroyDescriptorPool);
  NOTHING(vkDestroyDescriptorSetLayout);
  NOTHING(vkDestroyDescriptorUpdateTemplate);
  NOTHING(vkDestroyCommandPool);
  NOTHING(vkDestroyFence);
  NOTHING(vkDestroySemaphore);
  NOTHING(vkDestroyEvent);
  NOTHING(vkDestroyQueryPool);
  NOTHING(vkDestroySwapchainKHR);
  NOTHING(vkFreeMemory);
#undef NOTHING
  VK(vkDestroyDevice)(VK_NULL_HANDLE, nullptr);
  VK(vkDestroyInstance)(VK_NULL_HANDLE, nullptr);
  VK(vkDestroySurfaceKHR)(commonInstance(), VK_NULL_HANDLE, nullptr);
  VkCommandBuffer none[3] = {};
  VK(vkFreeCommandBuffers)(device.handle, device.pool, 3, none);
  VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_SAMPLER, 1};
  VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
                                  nullptr,
                                  VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT,
                                  1,
                                  1,
                                  &size};
  VkDescriptorPool pool = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateDescriptorPool)(device.handle, &info, nullptr, &pool), VK_SUCCESS);
  VkDescriptorSet noSets[2] = {};
  EXPECT_EQ(VK(vkFreeDescriptorSets)(device.handle, pool, 2, noSets), VK_SUCCESS);
  VK(vkDestroyDescriptorPool)(device.handle, pool, nullptr);
}

TEST(Commands, FillsTakeTheRestOfTheBuffer) {
  TestDevice device;
  TestDevice::Buffer buffer = device.buffer(27);  // 24 whole bytes and three more
  std::memset(buffer.words, 0x11, 64);
  VkCommandBuffer commands = device.begin();
  VK(vkCmdFillBuffer)(commands, buffer.handle, 8, VK_WHOLE_SIZE, 0xabcdef01);
  device.run(commands);
  EXPECT_EQ(buffer.words[1], 0x11111111u);
  EXPECT_EQ(buffer.words[2], 0xabcdef01u);
  EXPECT_EQ(buffer.words[5], 0xabcdef01u);
  EXPECT_EQ(buffer.words[6], 0x11111111u) << "the size is rounded down to a multiple of 4";
  device.release(buffer);
}

TEST(Commands, CommandBuffersHaveLives) {
  TestDevice device;
  TestDevice::Buffer buffer = device.buffer(64);
  // Simultaneous use: submitted several times while still pending.
  VkCommandBuffer commands =
      device.begin(VK_COMMAND_BUFFER_LEVEL_PRIMARY, VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
  for (uint32_t i = 0; i < 8; i++) {
    VkBufferCopy shift{i * 4, i * 4 + 4, 4};
    VK(vkCmdCopyBuffer)(commands, buffer.handle, buffer.handle, 1, &shift);
  }
  device.end(commands);
  buffer.words[0] = 42;
  for (int i = 0; i < 5; i++) ASSERT_EQ(device.submit(commands), VK_SUCCESS);
  VK(vkQueueWaitIdle)(device.queue);
  EXPECT_EQ(buffer.words[8], 42u);
  // Reset by its pool, recorded anew; begin alone resets, too.
  ASSERT_EQ(VK(vkResetCommandPool)(device.handle, device.pool, VK_COMMAND_POOL_RESET_RELEASE_RESOURCES_BIT),
            VK_SUCCESS);
  VK(vkTrimCommandPoolKHR)(device.handle, device.pool, 0);
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
  for (uint32_t round = 0; round < 3; round++) {
    ASSERT_EQ(VK(vkBeginCommandBuffer)(commands, &begin), VK_SUCCESS);
    VK(vkCmdFillBuffer)(commands, buffer.handle, 4 * round, 4, round);
    device.end(commands);
    buffer.words[0] = 99;
    ASSERT_EQ(device.submit(commands), VK_SUCCESS);
    VK(vkQueueWaitIdle)(device.queue);
    EXPECT_EQ(buffer.words[round], round);
    EXPECT_EQ(buffer.words[0], round ? 99u : 0u) << "an old recording ran again";
  }
  EXPECT_EQ(VK(vkResetCommandBuffer)(commands, VK_COMMAND_BUFFER_RESET_RELEASE_RESOURCES_BIT), VK_SUCCESS);
  // Secondaries, executed several times and from two primaries, and freed after the primary.
  VkCommandBuffer secondary =
      device.begin(VK_COMMAND_BUFFER_LEVEL_SECONDARY, VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
  VkBufferCopy grow{0, 8, 8};
  VK(vkCmdCopyBuffer)(secondary, buffer.handle, buffer.handle, 1, &grow);
  device.end(secondary);
  VkCommandBuffer twice[2] = {secondary, secondary};
  commands = device.begin();
  VK(vkCmdFillBuffer)(commands, buffer.handle, 0, 8, 5);
  VK(vkCmdExecuteCommands)(commands, 2, twice);
  device.run(commands);
  EXPECT_EQ(buffer.words[3], 5u);
  device.release(buffer);
}

// Shader that adds up an array of buffers, so that the result says which descriptors were written.
struct Descriptors : testing::Test {
  TestDevice device;
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkDescriptorPool pool = VK_NULL_HANDLE;
  VkPipeline pipeline = VK_NULL_HANDLE;
  TestDevice::Buffer inputs[5], output;

  void SetUp() override {
    // Binding 1 is two buffers, 2 is empty, 4 is three; 7 is the output.
    VkDescriptorSetLayoutBinding bindings[] = {
        {7, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr},
        {1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2, VK_SHADER_STAGE_COMPUTE_BIT, nullptr},
        {2, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 0, VK_SHADER_STAGE_COMPUTE_BIT, nullptr},
        {4, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 3, VK_SHADER_STAGE_COMPUTE_BIT, nullptr}};
    VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0,
                                            4, bindings};
    ASSERT_EQ(VK(vkCreateDescriptorSetLayout)(device.handle, &setInfo, nullptr, &setLayout), VK_SUCCESS);
    VkPipelineLayoutCreateInfo layoutInfo{
        VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout, 0, nullptr};
    ASSERT_EQ(VK(vkCreatePipelineLayout)(device.handle, &layoutInfo, nullptr, &layout), VK_SUCCESS);
    VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 64};
    VkDescriptorPoolCreateInfo poolInfo{
        VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 8, 1, &size};
    ASSERT_EQ(VK(vkCreateDescriptorPool)(device.handle, &poolInfo, nullptr, &pool), VK_SUCCESS);
    VkShaderModule module = device.module(computeShader(R"(#version 450
layout(local_size_x = 1) in;
layout(set = 0, binding = 1) readonly buffer A { uint v; } a[2];
layout(set = 0, binding = 4) readonly buffer B { uint v; } b[3];
layout(set = 0, binding = 7) buffer C { uint v[8]; } c;
void main() {
  c.v[0] = a[0].v; c.v[1] = a[1].v; c.v[2] = b[0].v; c.v[3] = b[1].v; c.v[4] = b[2].v;
  c.v[5] += 1u;
}
)"));
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.layout = layout;
    ASSERT_EQ(VK(vkCreateComputePipelines)(device.handle, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline),
              VK_SUCCESS);
    VK(vkDestroyShaderModule)(device.handle, module, nullptr);
    for (uint32_t i = 0; i < 5; i++) {
      inputs[i] = device.buffer(256);
      inputs[i].words[0] = 100 + i;
      inputs[i].words[16] = 200 + i;
    }
    output = device.buffer(256);
  }
  void TearDown() override {
    VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
    VK(vkDestroyDescriptorPool)(device.handle, pool, nullptr);
    VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
    VK(vkDestroyDescriptorSetLayout)(device.handle, setLayout, nullptr);
    for (auto& b : inputs) device.release(b);
    device.release(output);
  }
  VkDescriptorSet allocate() {
    VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool, 1,
                                     &setLayout};
    VkDescriptorSet set = VK_NULL_HANDLE;
    EXPECT_EQ(VK(vkAllocateDescriptorSets)(device.handle, &info, &set), VK_SUCCESS);
    return set;
  }
  void write(VkDescriptorSet set, uint32_t binding, uint32_t element,
             const std::vector<VkDescriptorBufferInfo>& infos) {
    VkWriteDescriptorSet w{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
                           nullptr,
                           set,
                           binding,
                           element,
                           uint32_t(infos.size()),
                           VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                           nullptr,
                           infos.data(),
                           nullptr};
    VK(vkUpdateDescriptorSets)(device.handle, 1, &w, 0, nullptr);
  }
  void expect(VkDescriptorSet set, std::vector<uint32_t> values, uint32_t groups = 1) {
    std::memset(output.words, 0, 256);
    VkCommandBuffer commands = device.begin();
    VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    VK(vkCmdBindDescriptorSets)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
    VK(vkCmdDispatch)(commands, groups, 1, 1);
    device.run(commands);
    EXPECT_EQ(std::vector<uint32_t>(output.words, output.words + 5), values);
  }
  VkDescriptorBufferInfo whole(const TestDevice::Buffer& b, VkDeviceSize offset = 0) {
    return {b.handle, offset, VK_WHOLE_SIZE};
  }
};

TEST_F(Descriptors, WritesAndCopiesRunIntoTheNextBinding) {
  VkDescriptorSet set = allocate(), other = allocate();
  write(set, 7, 0, {whole(output)});
  write(set, 1, 0,
        {whole(inputs[0]), whole(inputs[1], 64), whole(inputs[2]), whole(inputs[3]), whole(inputs[4], 64)});
  expect(set, {100, 201, 102, 103, 204});
  // An update after that, from the middle.
  write(set, 1, 1, {whole(inputs[4]), whole(inputs[0])});
  expect(set, {100, 104, 100, 103, 204});
  VkCopyDescriptorSet copies[2] = {
      {VK_STRUCTURE_TYPE_COPY_DESCRIPTOR_SET, nullptr, set, 1, 0, other, 1, 1, 3},
      {VK_STRUCTURE_TYPE_COPY_DESCRIPTOR_SET, nullptr, set, 7, 0, other, 7, 0, 1}};
  write(other, 1, 0,
        {whole(inputs[3], 64), whole(inputs[3]), whole(inputs[3]), whole(inputs[3]), whole(inputs[3])});
  VK(vkUpdateDescriptorSets)(device.handle, 0, nullptr, 2, copies);
  expect(other, {203, 100, 104, 100, 103});
  // Nothing at all.
  VK(vkUpdateDescriptorSets)(device.handle, 0, nullptr, 0, nullptr);
}

TEST_F(Descriptors, TemplatesReadWhereTheyAreTold) {
  struct Data {
    uint32_t ahead[3];
    VkDescriptorBufferInfo out;
    struct {
      VkDescriptorBufferInfo info;
      uint64_t gap;
    } in[5];
  } data{};
  data.out = whole(output);
  for (uint32_t i = 0; i < 5; i++) data.in[i].info = whole(inputs[4 - i]);
  VkDescriptorUpdateTemplateEntry entries[] = {
      {7, 0, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, offsetof(Data, out), 0},
      {1, 0, 5, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, offsetof(Data, in), sizeof data.in[0]}};
  VkDescriptorUpdateTemplateCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO;
  info.descriptorUpdateEntryCount = 2;
  info.pDescriptorUpdateEntries = entries;
  info.descriptorSetLayout = setLayout;
  VkDescriptorUpdateTemplate t = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateDescriptorUpdateTemplateKHR)(device.handle, &info, nullptr, &t), VK_SUCCESS);
  VkDescriptorSet set = allocate();
  VK(vkUpdateDescriptorSetWithTemplateKHR)(device.handle, set, t, &data);
  expect(set, {104, 103, 102, 101, 100});
  VK(vkDestroyDescriptorUpdateTemplateKHR)(device.handle, t, nullptr);
}

TEST_F(Descriptors, LayoutsMayGoBeforeWhatUsesThem) {
  VkDescriptorSet set = allocate();
  write(set, 7, 0, {whole(output)});
  write(set, 1, 0,
        {whole(inputs[0]), whole(inputs[1]), whole(inputs[2]), whole(inputs[3]), whole(inputs[4])});
  VK(vkDestroyDescriptorSetLayout)(device.handle, setLayout, nullptr);
  setLayout = VK_NULL_HANDLE;
  expect(set, {100, 101, 102, 103, 104});
  // Writing to a set whose layout is gone is allowed by maintenance rules of later versions; it must not
  // crash.
  write(set, 4, 2, {whole(inputs[0])});
  expect(set, {100, 101, 102, 103, 100});
}

TEST_F(Descriptors, NoGroupsRunNothing) {
  VkDescriptorSet set = allocate();
  write(set, 7, 0, {whole(output)});
  write(set, 1, 0,
        {whole(inputs[0]), whole(inputs[1]), whole(inputs[2]), whole(inputs[3]), whole(inputs[4])});
  expect(set, {0, 0, 0, 0, 0}, 0);
  VkCommandBuffer commands = device.begin();
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  VK(vkCmdBindDescriptorSets)(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
  VK(vkCmdDispatch)(commands, 1, 0, 1);
  VK(vkCmdDispatch)(commands, 1, 1, 0);
  VK(vkCmdDispatchIndirect)(commands, inputs[0].handle, 128);  // zeros
  device.run(commands);
  EXPECT_EQ(output.words[5], 0u);
}

struct Draws : testing::Test {
  TestDevice device;
  Target target{device, VK_FORMAT_R8G8B8A8_UNORM, {16, 16}};
  TestDevice::Buffer pixels = device.buffer(16 * 16 * 4);
  VkPipelineLayout layout = target.layout(16);
  const char* fragment = R"(#version 450
layout(push_constant) uniform P { vec4 color; } p;
layout(location = 0) out vec4 c;
void main() { c = p.color; }
)";
  void TearDown() override {
    VK(vkDestroyPipelineLayout)(device.handle, layout, nullptr);
    device.release(pixels);
  }
  void color(VkCommandBuffer c, float r, float g, float b) {
    float v[4] = {r, g, b, 1};
    VK(vkCmdPushConstants)(c, layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, 16, v);
  }
  void begin(VkCommandBuffer c, VkRenderPass pass, VkFramebuffer framebuffer, VkSubpassContents contents,
             const void* next = nullptr) {
    VkClearValue clear{{{0, 0, 1, 1}}};
    VkRenderPassBeginInfo info{
        VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, next, pass, framebuffer, {{0, 0}, target.size}, 1, &clear};
    VK(vkCmdBeginRenderPass)(c, &info, contents);
    clear = {};  // has been read
  }
  VkRect2D half(bool right) { return {{right ? 8 : 0, 0}, {8, 16}}; }
};

TEST_F(Draws, SubpassesSecondariesAndImagelessFramebuffers) {
  VkRenderPass pass = target.pass(3);
  VkPipeline pipelines[3];
  for (uint32_t s = 0; s < 3; s++)
    pipelines[s] = target.pipeline(vertexShader(kCoverAll), fragmentShader(fragment), layout, pass, s);
  for (bool imageless : {false, true}) {
    SCOPED_TRACE(imageless);
    VkFramebuffer framebuffer = target.framebuffer(pass, imageless);
    VkRenderPassAttachmentBeginInfo attachments{VK_STRUCTURE_TYPE_RENDER_PASS_ATTACHMENT_BEGIN_INFO, nullptr,
                                                1, &target.view};
    // Subpass 0 draws nothing, 1 draws red by a secondary, 2 draws green over the lower rows by a clear of
    // rectangles.
    VkCommandBuffer secondary;
    {
      VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr,
                                           device.pool, VK_COMMAND_BUFFER_LEVEL_SECONDARY, 1};
      ASSERT_EQ(VK(vkAllocateCommandBuffers)(device.handle, &allocate, &secondary), VK_SUCCESS);
      VkCommandBufferInheritanceInfo inheritance{VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO,
                                                 nullptr,
                                                 pass,
                                                 1,
                                                 VK_NULL_HANDLE,
                                                 VK_FALSE,
                                                 0,
                                                 0};
      VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr,
                                    VK_COMMAND_BUFFER_USAGE_RENDER_PASS_CONTINUE_BIT, &inheritance};
      ASSERT_EQ(VK(vkBeginCommandBuffer)(secondary, &info), VK_SUCCESS);
      VK(vkCmdBindPipeline)(secondary, VK_PIPELINE_BIND_POINT_GRAPHICS, pipelines[1]);
      color(secondary, 1, 0, 0);
      VK(vkCmdDraw)(secondary, 3, 1, 0, 0);
      device.end(secondary);
    }
    VkCommandBuffer commands = device.begin();
    begin(commands, pass, framebuffer, VK_SUBPASS_CONTENTS_INLINE, imageless ? &attachments : nullptr);
    VK(vkCmdNextSubpass)(commands, VK_SUBPASS_CONTENTS_SECONDARY_COMMAND_BUFFERS);
    VK(vkCmdExecuteCommands)(commands, 1, &secondary);
    VK(vkCmdNextSubpass)(commands, VK_SUBPASS_CONTENTS_INLINE);
    VkClearAttachment clear{VK_IMAGE_ASPECT_COLOR_BIT, 0, {{{0, 1, 0, 1}}}};
    VkClearRect rect{{{0, 8}, {16, 8}}, 0, 1};
    VK(vkCmdClearAttachments)(commands, 1, &clear, 1, &rect);
    VK(vkCmdEndRenderPass)(commands);
    target.read(commands, pixels.handle);
    device.run(commands);
    for (uint32_t i = 0; i < 256; i++) ASSERT_EQ(pixels.words[i], i < 128 ? 0xff0000ffu : 0xff00ff00u) << i;
    VK(vkFreeCommandBuffers)(device.handle, device.pool, 1, &secondary);
    VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  }
  for (VkPipeline p : pipelines) VK(vkDestroyPipeline)(device.handle, p, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
}

TEST_F(Draws, NothingDrawnByCountsOfZero) {
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipeline pipeline = target.pipeline(vertexShader(kCoverAll), fragmentShader(fragment), layout, pass);
  TestDevice::Buffer buffer =
      device.buffer(256, VK_BUFFER_USAGE_INDEX_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  std::memset(buffer.words, 0, 256);
  VkCommandBuffer commands = device.begin();
  begin(commands, pass, framebuffer, VK_SUBPASS_CONTENTS_INLINE);
  VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
  color(commands, 1, 1, 1);
  VK(vkCmdBindIndexBuffer)(commands, buffer.handle, 0, VK_INDEX_TYPE_UINT16);
  VK(vkCmdDraw)(commands, 0, 1, 0, 0);
  VK(vkCmdDraw)(commands, 3, 0, 0, 0);
  VK(vkCmdDraw)(commands, 2, 1, 0, 0);
  VK(vkCmdDrawIndexed)(commands, 0, 1, 0, 0, 0);
  VK(vkCmdDrawIndexed)(commands, 3, 0, 0, 0, 0);
  VK(vkCmdDrawIndirect)(commands, buffer.handle, 0, 0, 0);
  VK(vkCmdDrawIndirect)(commands, buffer.handle, 0, 1, 16);
  VK(vkCmdDrawIndexedIndirect)(commands, buffer.handle, 0, 2, 20);
  VK(vkCmdEndRenderPass)(commands);
  target.read(commands, pixels.handle);
  device.run(commands);
  for (uint32_t i = 0; i < 256; i++) ASSERT_EQ(pixels.words[i], 0xffff0000u) << i;
  VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
  VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
  device.release(buffer);
}

TEST_F(Draws, OcclusionQueriesCountWithinAndAcrossPasses) {
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipeline pipeline = target.pipeline(vertexShader(kCoverAll), fragmentShader(fragment), layout, pass);
  VkQueryPoolCreateInfo info{
      VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO, nullptr, 0, VK_QUERY_TYPE_OCCLUSION, 4, 0};
  VkQueryPool pool = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreateQueryPool)(device.handle, &info, nullptr, &pool), VK_SUCCESS);
  VkCommandBuffer commands = device.begin();
  VK(vkCmdResetQueryPool)(commands, pool, 0, 4);
  auto draw = [&](uint32_t triangles) {
    VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    color(commands, 1, 1, 1);
    for (uint32_t i = 0; i < triangles; i++) VK(vkCmdDraw)(commands, 3, 1, 0, 0);
  };
  // 0 around two passes, 1 within one of them would nest: so one after the other.
  VK(vkCmdBeginQuery)(commands, pool, 0, VK_QUERY_CONTROL_PRECISE_BIT);
  for (uint32_t i = 1; i < 3; i++) {
    begin(commands, pass, framebuffer, VK_SUBPASS_CONTENTS_INLINE);
    draw(i);
    VK(vkCmdEndRenderPass)(commands);
  }
  VK(vkCmdEndQuery)(commands, pool, 0);
  begin(commands, pass, framebuffer, VK_SUBPASS_CONTENTS_INLINE);
  draw(1);
  VK(vkCmdBeginQuery)(commands, pool, 1, VK_QUERY_CONTROL_PRECISE_BIT);
  draw(2);
  VK(vkCmdEndQuery)(commands, pool, 1);
  draw(1);
  VK(vkCmdBeginQuery)(commands, pool, 2, 0);
  VK(vkCmdEndQuery)(commands, pool, 2);
  VK(vkCmdEndRenderPass)(commands);
  VK(vkCmdBeginQuery)(commands, pool, 3, 0);
  VK(vkCmdEndQuery)(commands, pool, 3);
  device.run(commands);
  uint64_t counts[4] = {9, 9, 9, 9};
  ASSERT_EQ(VK(vkGetQueryPoolResults)(device.handle, pool, 0, 4, sizeof counts, counts, 8,
                                      VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
            VK_SUCCESS);
  EXPECT_EQ(counts[0], 3u * 256);
  EXPECT_EQ(counts[1], 2u * 256);
  EXPECT_EQ(counts[2], 0u);
  EXPECT_EQ(counts[3], 0u);
  VK(vkDestroyQueryPool)(device.handle, pool, nullptr);
  VK(vkDestroyPipeline)(device.handle, pipeline, nullptr);
  VK(vkDestroyFramebuffer)(device.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(device.handle, pass, nullptr);
}

}  // namespace
}  // namespace pumice::icd::test
