// Pipeline statistics queries, held against what the draws and dispatches are known to do.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/tests/compute.h"

namespace pumice::cts {
namespace {

class Statistics : public OnDevice {};

TEST_P(Statistics, CountWhatDrawsDo) {
  if (HasFatalFailure() || IsSkipped()) return;
  if (!device().features.pipelineStatisticsQuery) GTEST_SKIP() << "no pipeline statistics";
  Canvas canvas(device(), 64, 64, VK_FORMAT_D32_SFLOAT);
  VkQueryPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  info.queryType = VK_QUERY_TYPE_PIPELINE_STATISTICS;
  info.queryCount = 2;
  info.pipelineStatistics = VK_QUERY_PIPELINE_STATISTIC_INPUT_ASSEMBLY_VERTICES_BIT | VK_QUERY_PIPELINE_STATISTIC_INPUT_ASSEMBLY_PRIMITIVES_BIT |
                            VK_QUERY_PIPELINE_STATISTIC_VERTEX_SHADER_INVOCATIONS_BIT | VK_QUERY_PIPELINE_STATISTIC_CLIPPING_INVOCATIONS_BIT |
                            VK_QUERY_PIPELINE_STATISTIC_FRAGMENT_SHADER_INVOCATIONS_BIT;
  VkQueryPool pool = canvas.make(info);

  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  Pipeline pipeline = canvas.pipeline(spec);
  auto rectangle = [&](double x0, double y0, double x1, double y1, float z) {
    glm::vec4 c(1);
    Vertex a{atPixel(canvas.size(), x0, y0, z), c}, b{atPixel(canvas.size(), x1, y0, z), c}, d{atPixel(canvas.size(), x1, y1, z), c},
        e{atPixel(canvas.size(), x0, y1, z), c};
    return std::vector<Vertex>{a, b, d, a, d, e};
  };
  device().run([&](VkCommandBuffer commands) { vkCmdResetQueryPool(commands, pool, 0, 2); });
  canvas.draw({0, 0, 0, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, pipeline, rectangle(0, 0, 64, 64, 0.5f));   // not counted
    vkCmdBeginQuery(commands, pool, 0, 0);
    canvas.drawVertices(commands, pipeline, rectangle(8, 8, 24, 24, 0.25f));
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    vkCmdDraw(commands, 3, 2, 0, 0);   // the same triangle twice more, at equal depth: hidden
    vkCmdEndQuery(commands, pool, 0);
    vkCmdBeginQuery(commands, pool, 1, 0);
    canvas.drawVertices(commands, pipeline, rectangle(4, 4, 60, 60, 0.75f));   // hidden
    vkCmdEndQuery(commands, pool, 1);
  });
  uint64_t results[2][6] = {};
  check(vkGetQueryPoolResults(device().handle, pool, 0, 2, sizeof results, results, sizeof results[0],
                              VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults");
  for (auto& r : results) EXPECT_EQ(r[5], 1u) << "availability";
  EXPECT_EQ(results[0][0], 12u) << "vertices";
  EXPECT_EQ(results[0][1], 4u) << "primitives";
  EXPECT_GE(results[0][2], 6u) << "vertex shader invocations";
  EXPECT_LE(results[0][2], 12u) << "vertex shader invocations";
  EXPECT_EQ(results[0][3], 4u) << "clipping invocations";
  EXPECT_EQ(results[1][1], 2u) << "primitives of the second";
  EXPECT_GE(results[0][4], 16u * 16) << "fragment shader invocations";
  if (GetParam() == Role::kPeer) return;
  // Early depth: what is hidden is not shaded.
  EXPECT_EQ(results[0][4], 16u * 16) << "fragment shader invocations";
  EXPECT_EQ(results[1][4], 0u) << "fragment shader invocations of what is hidden";
}

VkQueryPool statisticsPool(Workspace& work, VkQueryPipelineStatisticFlags counted, uint32_t queries = 1) {
  VkQueryPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  info.queryType = VK_QUERY_TYPE_PIPELINE_STATISTICS;
  info.queryCount = queries;
  info.pipelineStatistics = counted;
  return work.make(info);
}

// What compute shaders do, read back by a copy, in words of 32 bits with availability behind them.
TEST_P(Statistics, CountInvocationsOfDispatchesAndCopyTheCounts) {
  if (HasFatalFailure() || IsSkipped()) return;
  if (!device().features.pipelineStatisticsQuery) GTEST_SKIP() << "no pipeline statistics";
  Workspace work(device());
  VkQueryPool pool = statisticsPool(work, VK_QUERY_PIPELINE_STATISTIC_COMPUTE_SHADER_INVOCATIONS_BIT, 2);
  VkPipelineLayout layout = makePipelineLayout(work, {});
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, "#version 450\nlayout(local_size_x = 5, local_size_y = 3) in;\nvoid main() {}"), layout);
  const uint32_t groups[3] = {2, 3, 4};
  Buffer indirect = work.buffer(sizeof groups, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, groups);
  const std::vector<uint32_t> before(5, 0xcdcdcdcd);
  Buffer copied = work.bufferOf(before, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  device().run([&](VkCommandBuffer commands) {
    vkCmdResetQueryPool(commands, pool, 0, 2);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdDispatch(commands, 9, 1, 1);   // not counted
    vkCmdBeginQuery(commands, pool, 0, 0);
    vkCmdDispatch(commands, 7, 1, 1);
    vkCmdDispatchIndirect(commands, indirect.handle, 0);
    vkCmdEndQuery(commands, pool, 0);
    vkCmdBeginQuery(commands, pool, 1, 0);
    vkCmdEndQuery(commands, pool, 1);
    fullBarrier(commands);
    vkCmdCopyQueryPoolResults(commands, pool, 0, 2, copied.handle, 0, 8, VK_QUERY_RESULT_WAIT_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
    fullBarrier(commands);
  });
  const auto* words = reinterpret_cast<const uint32_t*>(copied.mapped);
  EXPECT_EQ(words[0], (7u + 2 * 3 * 4) * 15) << "invocations of the first query";
  EXPECT_EQ(words[1], 1u) << "availability";
  EXPECT_EQ(words[2], 0u) << "invocations of the second query";
  EXPECT_EQ(words[3], 1u) << "availability";
  EXPECT_EQ(words[4], 0xcdcdcdcdu) << "behind the results";
}

// A query of the primary counts what its secondaries draw; primitives are counted before and behind clipping.
TEST_P(Statistics, CountSecondaryCommandBuffersAndClippedPrimitives) {
  if (HasFatalFailure() || IsSkipped()) return;
  if (!device().features.pipelineStatisticsQuery || !device().features.inheritedQueries) GTEST_SKIP() << "no inherited pipeline statistics";
  Canvas canvas(device(), 64, 64);
  const VkQueryPipelineStatisticFlags counted = VK_QUERY_PIPELINE_STATISTIC_INPUT_ASSEMBLY_PRIMITIVES_BIT | VK_QUERY_PIPELINE_STATISTIC_CLIPPING_INVOCATIONS_BIT |
                                                VK_QUERY_PIPELINE_STATISTIC_CLIPPING_PRIMITIVES_BIT | VK_QUERY_PIPELINE_STATISTIC_FRAGMENT_SHADER_INVOCATIONS_BIT;
  VkQueryPool pool = statisticsPool(canvas, counted);
  PipelineSpec spec;
  spec.cull = VK_CULL_MODE_BACK_BIT;
  Pipeline pipeline = canvas.pipeline(spec);
  VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, 0};
  VkDevice d = device().handle;
  VkCommandPool commandPool = canvas.make(poolInfo);
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, commandPool, VK_COMMAND_BUFFER_LEVEL_SECONDARY, 1};
  VkCommandBuffer secondary = VK_NULL_HANDLE;
  check(vkAllocateCommandBuffers(d, &allocate, &secondary), "vkAllocateCommandBuffers");
  VkCommandBufferInheritanceInfo inheritance{};
  inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
  inheritance.renderPass = canvas.pass();
  inheritance.pipelineStatistics = counted;
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, VK_COMMAND_BUFFER_USAGE_RENDER_PASS_CONTINUE_BIT, &inheritance};
  check(vkBeginCommandBuffer(secondary, &begin), "vkBeginCommandBuffer");
  setViewport(secondary, 0, 0, 64, 64);
  setScissor(secondary, 0, 0, 64, 64);
  const glm::vec4 c(1);
  const auto at = [&](double x, double y, float z = 0.5f) { return Vertex{atPixel(canvas.size(), x, y, z), c}; };
  // One in front, one facing away, one behind the far plane.
  canvas.drawVertices(secondary, pipeline,
                      {at(8, 8), at(8, 24), at(24, 8),   at(8, 8), at(24, 8), at(8, 24),   at(8, 8, 2), at(8, 24, 2), at(24, 8, 2)});
  check(vkEndCommandBuffer(secondary), "vkEndCommandBuffer");
  device().run([&](VkCommandBuffer commands) {
    vkCmdResetQueryPool(commands, pool, 0, 1);
    VkClearValue clear{{{0, 0, 0, 1}}};
    VkRenderPassBeginInfo pass{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, canvas.pass(), canvas.target(), {{0, 0}, {64, 64}}, 1, &clear};
    vkCmdBeginQuery(commands, pool, 0, 0);
    vkCmdBeginRenderPass(commands, &pass, VK_SUBPASS_CONTENTS_SECONDARY_COMMAND_BUFFERS);
    vkCmdExecuteCommands(commands, 1, &secondary);
    vkCmdEndRenderPass(commands);
    vkCmdEndQuery(commands, pool, 0);
  });
  uint64_t results[4] = {};
  check(vkGetQueryPoolResults(d, pool, 0, 1, sizeof results, results, sizeof results, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT), "vkGetQueryPoolResults");
  EXPECT_EQ(results[0], 3u) << "primitives";
  EXPECT_EQ(results[1], 3u) << "primitives that clipping looked at";
  EXPECT_GE(results[3], 120u) << "fragment shader invocations";
  if (GetParam() == Role::kPeer) return;
  EXPECT_EQ(results[2], 2u) << "primitives that clipping left, whichever way they face";
  EXPECT_EQ(results[3], 120u) << "fragment shader invocations: 16 * 15 / 2 pixels (the diagonal's belong to the other side)";
}

PUMICE_ON_BOTH_DEVICES(Statistics);

}  // namespace
}  // namespace pumice::cts
