// Modules that the validator refuses make no pipeline, although they are translated and linked before it has said so.
#include <gtest/gtest.h>

#include "spirv_interp/frontend/shader.h"
#include "tests/icd/graphics.h"

namespace pumice::icd::test {
namespace {

constexpr VkExtent2D kSize{8, 8};
constexpr const char* kFragment = R"(#version 450
layout(location = 0) out vec4 c;
layout(push_constant) uniform P { vec4 a[2]; int n; } p;
void main() {
  vec4 sum = vec4(gl_FragCoord.xy, 0, 1);
  for (int i = 0; i < p.n; ++i) sum = fract(sum * p.a[i & 1] + sin(sum));
  c = sum.x > 0.5 ? sum : vec4(1) - sum;
})";

struct InvalidShaders : ::testing::Test {
  TestDevice d;
  Target target{d, VK_FORMAT_R8G8B8A8_UNORM, kSize};
  VkRenderPass pass = target.pass();
  VkPushConstantRange range{VK_SHADER_STAGE_FRAGMENT_BIT, 0, 36};
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkShaderModule vertex = d.module(vertexShader(kCoverAll));

  void SetUp() override {
    VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 0, nullptr, 1, &range};
    ASSERT_EQ(VK(vkCreatePipelineLayout)(d.handle, &info, nullptr, &layout), VK_SUCCESS);
  }
  void TearDown() override {
    VK(vkDestroyPipelineLayout)(d.handle, layout, nullptr);
    VK(vkDestroyShaderModule)(d.handle, vertex, nullptr);
    VK(vkDestroyRenderPass)(d.handle, pass, nullptr);
  }
  //! Twice: what the first creation has left must not make the second succeed.
  VkResult make(const std::vector<uint32_t>& words, VkPipelineCache cache) {
    VkShaderModuleCreateInfo moduleInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, words.size() * 4, words.data()};
    VkShaderModule fragment = VK_NULL_HANDLE;
    EXPECT_EQ(VK(vkCreateShaderModule)(d.handle, &moduleInfo, nullptr, &fragment), VK_SUCCESS);
    VkResult results[2];
    for (VkResult& result : results) {
      GraphicsPipelineInfo info(vertex, fragment, layout, pass, 0, kSize);
      VkPipeline pipeline = VK_NULL_HANDLE;
      result = VK(vkCreateGraphicsPipelines)(d.handle, cache, 1, &info.info, nullptr, &pipeline);
      EXPECT_EQ(pipeline != VK_NULL_HANDLE, result == VK_SUCCESS);
      VK(vkDestroyPipeline)(d.handle, pipeline, nullptr);
    }
    VK(vkDestroyShaderModule)(d.handle, fragment, nullptr);
    EXPECT_EQ(results[0], results[1]);
    return results[0];
  }
};

TEST_F(InvalidShaders, MakeNoPipelineAndDoNoHarm) {
  const std::vector<uint32_t> words = fragmentShader(kFragment);
  VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO, nullptr, 0, 0, nullptr};
  VkPipelineCache cache = VK_NULL_HANDLE;
  ASSERT_EQ(VK(vkCreatePipelineCache)(d.handle, &info, nullptr, &cache), VK_SUCCESS);
  EXPECT_EQ(make(words, VK_NULL_HANDLE), VK_SUCCESS);
  int translated = 0;
  for (size_t at = 5; at < words.size(); ++at)
    for (const uint32_t change : {1u, 0x10000u}) {
      std::vector<uint32_t> changed = words;
      changed[at] += change;
      const auto valid = frontend::parseModule(changed);
      const VkResult made = make(changed, at & 1 ? cache : VK_NULL_HANDLE);
      if (valid) continue;   // another shader, which may work
      EXPECT_LT(made, VK_SUCCESS) << "word " << at << ": " << valid.error().message;
      const auto parsed = frontend::parseModule(changed, frontend::Validate::Beside);
      translated += parsed && frontend::translate(**parsed, frontend::Stage::Fragment, "main", {});
    }
  EXPECT_GT(translated, 10) << "of which only the validator knows that they are invalid";
  EXPECT_EQ(make(words, cache), VK_SUCCESS);
  VK(vkDestroyPipelineCache)(d.handle, cache, nullptr);
}

}  // namespace
}  // namespace pumice::icd::test
