// What pipeline creation refuses, and that the reason is said.
#include <gtest/gtest.h>

#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

std::string reason(GraphicsState state, const std::string& vertex = kColorVertex, const std::string& fragment = kColorFragment) {
  auto p = createGraphicsPipeline(std::move(state), std::make_shared<Layout>(), compile(frontend::Stage::Vertex, vertex),
                                  compile(frontend::Stage::Fragment, fragment));
  return p ? "" : p.error().message;
}

TEST(Create, UnsupportedStatesNameThemselves) {
  Scene s(8, 8);
  EXPECT_EQ(reason(s.state()), "");
  GraphicsState state = s.state();
  state.polygonMode = VkPolygonMode(7);
  EXPECT_NE(reason(state).find("polygon mode"), std::string::npos);
  state = s.state();
  state.topology = VK_PRIMITIVE_TOPOLOGY_PATCH_LIST;
  EXPECT_NE(reason(state).find("topology"), std::string::npos);
  state = s.state();
  state.vertexAttributes.pop_back();
  EXPECT_NE(reason(state).find("location 1"), std::string::npos);
}

TEST(Create, ResourcesMustBeInTheLayout) {
  Scene s(8, 8);
  const std::string why = reason(s.state(), kColorVertex, R"(#version 450
layout(set = 2, binding = 5) uniform U { vec4 c; } u;
layout(location = 0) out vec4 target;
void main() { target = u.c; })");
  EXPECT_NE(why.find("set 2 binding 5"), std::string::npos) << why;
}

}  // namespace
}  // namespace pumice::pipeline::test
