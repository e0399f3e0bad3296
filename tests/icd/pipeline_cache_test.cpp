// Pipeline caches: a second device does no frontend work with what a first one has written, and foreign or damaged
// data does no harm.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

constexpr VkExtent2D kSize{8, 8};
constexpr auto kHit = VK_PIPELINE_CREATION_FEEDBACK_APPLICATION_PIPELINE_CACHE_HIT_BIT;
constexpr auto kValid = VK_PIPELINE_CREATION_FEEDBACK_VALID_BIT;
constexpr const char* kPurple = "#version 450\nlayout(constant_id = 3) const float r = 1.0; layout(location = 0) out vec4 c; void main() { c = vec4(r, 0, 1, 1); }\n";

VkPipelineCache makeCache(TestDevice& d, const std::vector<std::byte>& data = {}) {
  VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO, nullptr, 0, data.size(), data.data()};
  VkPipelineCache cache = VK_NULL_HANDLE;
  EXPECT_EQ(VK(vkCreatePipelineCache)(d.handle, &info, nullptr, &cache), VK_SUCCESS);
  return cache;
}

std::vector<std::byte> dataOf(TestDevice& d, VkPipelineCache cache) {
  size_t size = 0;
  EXPECT_EQ(VK(vkGetPipelineCacheData)(d.handle, cache, &size, nullptr), VK_SUCCESS);
  std::vector<std::byte> data(size);
  EXPECT_EQ(VK(vkGetPipelineCacheData)(d.handle, cache, &size, data.data()), VK_SUCCESS);
  EXPECT_EQ(size, data.size());
  return data;
}

struct Made {
  VkResult result = VK_ERROR_UNKNOWN;
  VkPipelineCreationFeedback whole{}, stages[2]{};
  uint32_t pixel = 0;
};

// Makes a pipeline and, if that worked, draws with it.
Made make(TestDevice& d, VkPipelineCache cache, VkPipelineCreateFlags flags = 0, float red = 1, const char* fragmentSource = kPurple) {
  Target target(d, VK_FORMAT_R8G8B8A8_UNORM, kSize);
  VkRenderPass pass = target.pass();
  VkFramebuffer framebuffer = target.framebuffer(pass);
  VkPipelineLayout layout = target.layout();
  VkShaderModule vertex = d.module(vertexShader(kCoverAll)), fragment = d.module(fragmentShader(fragmentSource));
  GraphicsPipelineInfo info(vertex, fragment, layout, pass, 0, kSize);
  VkSpecializationMapEntry entry{3, 0, 4};
  VkSpecializationInfo specialization{1, &entry, 4, &red};
  info.stages[1].pSpecializationInfo = &specialization;
  Made made;
  VkPipelineCreationFeedbackCreateInfo feedback{VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO, nullptr, &made.whole, 2, made.stages};
  info.info.pNext = &feedback;
  info.info.flags = flags;
  VkPipeline pipeline = VK_NULL_HANDLE;
  made.result = VK(vkCreateGraphicsPipelines)(d.handle, cache, 1, &info.info, nullptr, &pipeline);
  EXPECT_EQ(pipeline != VK_NULL_HANDLE, made.result == VK_SUCCESS);
  if (pipeline) {
    TestDevice::Buffer readback = d.buffer(8 * 8 * 4);
    VkClearValue clear{};
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, pass, framebuffer, {{0, 0}, kSize}, 1, &clear};
    VkCommandBuffer commands = d.begin();
    VK(vkCmdBeginRenderPass)(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    VK(vkCmdBindPipeline)(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    VK(vkCmdDraw)(commands, 3, 1, 0, 0);
    VK(vkCmdEndRenderPass)(commands);
    target.read(commands, readback.handle);
    d.run(commands);
    made.pixel = readback.words[20];
    d.release(readback);
  }
  VK(vkDestroyPipeline)(d.handle, pipeline, nullptr);
  for (VkShaderModule m : {vertex, fragment}) VK(vkDestroyShaderModule)(d.handle, m, nullptr);
  VK(vkDestroyPipelineLayout)(d.handle, layout, nullptr);
  VK(vkDestroyFramebuffer)(d.handle, framebuffer, nullptr);
  VK(vkDestroyRenderPass)(d.handle, pass, nullptr);
  return made;
}

constexpr auto kRefuse = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;

TEST(PipelineCache, ASecondDeviceTranslatesNothing) {
  std::vector<std::byte> data;
  {
    TestDevice d;
    VkPipelineCache cache = makeCache(d);
    EXPECT_EQ(make(d, cache, kRefuse).result, VK_PIPELINE_COMPILE_REQUIRED);
    Made first = make(d, cache);
    ASSERT_EQ(first.result, VK_SUCCESS);
    EXPECT_EQ(first.whole.flags, VkPipelineCreationFeedbackFlags(kValid));
    EXPECT_GT(first.stages[0].duration, 0u);
    Made again = make(d, cache);
    EXPECT_EQ(again.whole.flags, kValid | kHit) << "in the same cache";
    data = dataOf(d, cache);
    VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
  }
  TestDevice d;
  VkPipelineCache cache = makeCache(d, data);
  Made made = make(d, cache, kRefuse);
  ASSERT_EQ(made.result, VK_SUCCESS) << "nothing has to be translated";
  EXPECT_EQ(made.pixel, 0xffff00ffu);
  EXPECT_EQ(made.whole.flags, kValid | kHit);
  for (const auto& s : made.stages) EXPECT_EQ(s.flags, kValid | kHit);
  // Another specialization, another shader: one stage is known, the other is not.
  EXPECT_EQ(make(d, cache, kRefuse, 0.0f).result, VK_PIPELINE_COMPILE_REQUIRED);
  Made other = make(d, cache, 0, 0.0f);
  EXPECT_EQ(other.pixel, 0xffff0000u);
  EXPECT_EQ(other.whole.flags, VkPipelineCreationFeedbackFlags(kValid));
  EXPECT_EQ(other.stages[0].flags, kValid | kHit);
  EXPECT_EQ(other.stages[1].flags, VkPipelineCreationFeedbackFlags(kValid));
  EXPECT_EQ(make(d, VK_NULL_HANDLE, kRefuse).result, VK_PIPELINE_COMPILE_REQUIRED) << "without a cache";
  VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
}

// With PUMICE_CHECK shaders hold instructions that others do not: neither may be found for the other.
TEST(PipelineCache, AWatchedShaderIsAnotherOne) {
  TestDevice d;
  VkPipelineCache cache = makeCache(d);
  EXPECT_FALSE(make(d, cache).whole.flags & kHit);
  EXPECT_TRUE(make(d, cache).whole.flags & kHit);
  ::setenv("PUMICE_CHECK", "bounds", 1);
  EXPECT_FALSE(make(d, cache).whole.flags & kHit);
  EXPECT_TRUE(make(d, cache).whole.flags & kHit);
  ::unsetenv("PUMICE_CHECK");
  EXPECT_TRUE(make(d, cache).whole.flags & kHit);
  VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
}

TEST(PipelineCache, CachesAreMerged) {
  TestDevice d;
  VkPipelineCache one = makeCache(d), two = makeCache(d), all = makeCache(d);
  make(d, one, 0, 1.0f);
  make(d, two, 0, 0.0f);
  VkPipelineCache from[] = {one, two};
  EXPECT_EQ(VK(vkMergePipelineCaches)(d.handle, all, 2, from), VK_SUCCESS);
  for (VkPipelineCache c : from) VK(vkDestroyPipelineCache)(d.handle, c, nullptr);
  EXPECT_EQ(make(d, all, kRefuse, 1.0f).pixel, 0xffff00ffu);
  EXPECT_EQ(make(d, all, kRefuse, 0.0f).pixel, 0xffff0000u);
  VK(vkDestroyPipelineCache)(d.handle, all, nullptr);
}

//! Entries of a blob: where they begin, and whether they are routines.
struct Entry {
  size_t at, size;
  bool routines;
};
std::vector<Entry> entriesOf(const std::vector<std::byte>& data) {
  std::vector<Entry> entries;
  for (size_t at = 32; at + 32 <= data.size();) {
    uint32_t words[2];   // size, content
    std::memcpy(words, data.data() + at + 24, sizeof words);
    entries.push_back({at, 32 + words[0], words[1] != 0});
    at += 32 + words[0];
  }
  return entries;
}

TEST(PipelineCache, RoutinesMadeByDrawsAreThere) {
  TestDevice d;
  VkPipelineCache cache = makeCache(d);
  make(d, cache);
  size_t shaders = 0, routines = 0;
  const auto data = dataOf(d, cache);
  for (const Entry& e : entriesOf(data)) ++(e.routines ? routines : shaders);
  EXPECT_EQ(shaders, 2u);
  EXPECT_EQ(routines, 1u) << "one pipeline";
  // The second pipeline of a cache differs in nothing: no entry of its own.
  make(d, cache);
  EXPECT_EQ(dataOf(d, cache).size(), data.size());
  make(d, cache, 0, 0.5f);
  EXPECT_EQ(entriesOf(dataOf(d, cache)).size(), 5u) << "another specialization is another shader and another pipeline";
  VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
}

TEST(PipelineCache, WhatDoesNotFitIsLeftOutWhole) {
  TestDevice d;
  VkPipelineCache cache = makeCache(d);
  make(d, cache);
  const std::vector<std::byte> data = dataOf(d, cache);
  ASSERT_GT(data.size(), 500u);
  for (size_t room : {size_t(0), size_t(31), size_t(32), size_t(100), data.size() - 1}) {
    std::vector<std::byte> part(data.size(), std::byte(0xcd));
    size_t size = room;
    EXPECT_EQ(VK(vkGetPipelineCacheData)(d.handle, cache, &size, part.data()), VK_INCOMPLETE);
    EXPECT_LE(size, room);
    EXPECT_EQ(size >= 32, room >= 32) << room;
    EXPECT_EQ(part[room], std::byte(0xcd)) << "written behind the end";
    VkPipelineCache again = makeCache(d, {part.begin(), part.begin() + long(size)});
    EXPECT_EQ(make(d, again).pixel, 0xffff00ffu);
    VK(vkDestroyPipelineCache)(d.handle, again, nullptr);
  }
  VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
}

TEST(PipelineCache, ForeignAndDamagedDataIsIgnored) {
  TestDevice d;
  VkPipelineCache cache = makeCache(d);
  make(d, cache);
  const std::vector<std::byte> data = dataOf(d, cache);
  VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
  const auto hits = [&](const std::vector<std::byte>& bytes) {
    VkPipelineCache changed = makeCache(d, bytes);
    Made made = make(d, changed);
    EXPECT_EQ(made.result, VK_SUCCESS);
    EXPECT_EQ(made.pixel, 0xffff00ffu);
    VK(vkDestroyPipelineCache)(d.handle, changed, nullptr);
    return made.whole.flags & kHit;
  };
  EXPECT_TRUE(hits(data));
  auto change = [&](size_t at) {
    auto bytes = data;
    bytes[at] ^= std::byte(0x41);
    return bytes;
  };
  for (size_t at = 0; at < 32; at++) {   // size, version, vendor, device, build
    auto bytes = change(at);
    VkPipelineCache changed = makeCache(d, bytes);
    EXPECT_EQ(dataOf(d, changed).size(), 32u) << "byte " << at << " of the header";
    VK(vkDestroyPipelineCache)(d.handle, changed, nullptr);
  }
  // Routines do not count as hits; without them they are linked anew.
  size_t shaders = 32;
  for (const Entry& e : entriesOf(data))
    if (!e.routines) shaders = e.at + e.size;
  ASSERT_GT(shaders, 200u);
  ASSERT_GT(data.size(), shaders + 100);
  for (size_t at = 32; at < shaders; at += 41) EXPECT_FALSE(hits(change(at))) << "byte " << at;
  for (size_t at = shaders; at < data.size(); at += 41) EXPECT_TRUE(hits(change(at))) << "byte " << at;
  for (size_t length : {size_t(1), size_t(31), size_t(33), size_t(60), shaders / 2, shaders - 1}) EXPECT_FALSE(hits({data.begin(), data.begin() + long(length)})) << length << " bytes";
  for (size_t length : {shaders, shaders + 20, data.size() - 1}) EXPECT_TRUE(hits({data.begin(), data.begin() + long(length)})) << length << " bytes";
  std::vector<std::byte> noise(4096);
  uint32_t random = 7;
  for (auto& b : noise) b = std::byte((random = random * 1664525u + 1013904223u) >> 24);
  std::memcpy(noise.data(), data.data(), 32);
  EXPECT_FALSE(hits(noise));
}

}  // namespace
}  // namespace pumice::icd::test
