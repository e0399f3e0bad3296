// Several samples per pixel: coverage per sample, depth at sample positions, resolve at the end of the pass.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

TEST(Multisample, ResolvedEdgeShowsTheShareOfCoveredSamples) {
  Scene s(32, 32);
  Image many(VK_FORMAT_R8G8B8A8_UNORM, 32, 32, 1, 4), depth(VK_FORMAT_D32_SFLOAT, 32, 32, 1, 4);
  GraphicsState state = s.state();
  state.samples = 4;
  state.depthStencilFormat = VK_FORMAT_D32_SFLOAT;
  state.depthTest = state.depthWrite = true;
  state.depthCompare = VK_COMPARE_OP_LESS;
  auto d = s.drawState(s.pipeline(state));
  s.begin(0, 0, 0, 1);
  s.pass.resolve[0] = s.pass.color[0];
  s.pass.color[0].memory = many.memory();
  s.pass.depthStencil.memory = depth.memory();
  s.pass.depthStencil.format = VK_FORMAT_D32_SFLOAT;
  s.pass.depthStencil.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  s.pass.depthStencil.clear.depthStencil.depth = 1;
  s.executor.begin(s.pass);
  // Two planes that cut each other where x = 16 + a quarter: the near one changes from sample to sample there.
  auto tilted = rectangle(s, 0, 0, 32, 32, 0, {1, 1, 1, 1});
  for (auto& v : tilted) v.position[2] = 0.5f + (v.position[0] * 16 - 0.25f) / 64;
  s.draw(d, tilted);
  s.draw(d, rectangle(s, 0, 0, 32, 32, 0.5f, {0, 0, 0, 1}));
  // x = 8.5 cuts samples at 2/16, 6/16 from those at 10/16, 14/16.
  s.draw(d, rectangle(s, 4, 4, 8.5f, 8, 0.1f, {0, 1, 0, 1}));
  s.end();
  EXPECT_EQ(s.color.rgba(15, 20)[0], 255);
  EXPECT_EQ(s.color.rgba(16, 20)[0], 64);   // one sample (2/16) is left of the cut
  EXPECT_EQ(s.color.rgba(17, 20)[0], 0);
  EXPECT_EQ(s.color.rgba(7, 5), (std::array<uint8_t, 4>{0, 255, 0, 255}));
  EXPECT_EQ(s.color.rgba(8, 5), (std::array<uint8_t, 4>{128, 255, 128, 255}));
}

}  // namespace
}  // namespace pumice::pipeline::test
