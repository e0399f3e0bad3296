// Pipeline statistics queries, held against what the draws and dispatches are known to do.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/tests/devices.h"

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
  VkQueryPool pool = VK_NULL_HANDLE;
  check(vkCreateQueryPool(device().handle, &info, nullptr, &pool), "vkCreateQueryPool");
  canvas.onDestroy([d = device().handle, pool] { vkDestroyQueryPool(d, pool, nullptr); });

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

PUMICE_ON_BOTH_DEVICES(Statistics);

}  // namespace
}  // namespace pumice::cts
