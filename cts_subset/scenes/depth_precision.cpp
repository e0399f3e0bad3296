// Depth precision: two planes so near each other that the format decides which one is seen, with depths as usual
// (left) and reversed (right).
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;
constexpr int kStripes = 16;

// From stripe to stripe the second plane, green, is nearer to the first, red, by a factor of two: its distance is
// 1 - 2^-k of the other's. Both reach from distance 1 (bottom) to 500 (top); near plane 0.05, far plane 1000.
std::vector<Vertex> fightingPlanes(bool reversed, float x0, float x1) {
  std::vector<Vertex> out;
  const float kNear = 0.05f, kFar = 1000;
  auto vertex = [&](float x, float y, float distance, glm::vec4 colour) {
    float z = kFar / (kFar - kNear) * (distance - kNear);
    if (reversed) z = kNear / (kFar - kNear) * (kFar - distance);
    return Vertex{{x * distance, y * distance, z, distance}, colour};
  };
  for (int stripe = 0; stripe < kStripes; ++stripe) {
    float a = x0 + (x1 - x0) * float(stripe) / kStripes, b = x0 + (x1 - x0) * float(stripe + 1) / kStripes;
    for (int layer = 0; layer < 2; ++layer) {
      float scale = layer ? 1 - std::exp2(-3 - float(stripe)) : 1;
      glm::vec4 near = layer ? glm::vec4(0.2f, 0.9f, 0.35f, 1) : glm::vec4(0.9f, 0.2f, 0.2f, 1), far = near * 0.6f;
      Vertex p = vertex(a, 1, 1 * scale, near), q = vertex(b, 1, 1 * scale, near), r = vertex(b, -1, 500 * scale, far),
             s = vertex(a, -1, 500 * scale, far);
      for (const Vertex& v : {p, q, r, p, r, s}) out.push_back(v);
    }
  }
  return out;
}

Picture renderZFighting(Device& device, Variant variant, VkFormat format) {
  Canvas canvas(device, kSize, kSize, format);
  PipelineSpec spec;
  spec.depthTest = spec.depthWrite = true;
  Pipeline normal = canvas.pipeline(spec);
  spec.compare = VK_COMPARE_OP_GREATER;
  Pipeline reversed = canvas.pipeline(spec);
  return canvas.draw({0.05f, 0.05f, 0.1f, 1}, [&](VkCommandBuffer commands) {
    canvas.drawVertices(commands, normal, fightingPlanes(variant == Variant::kBroken, -0.984375f, -0.015625f));
    VkClearAttachment clear{VK_IMAGE_ASPECT_DEPTH_BIT, 0, {}};
    VkClearRect rect{{{kSize / 2, 0}, {kSize / 2, kSize}}, 0, 1};
    vkCmdClearAttachments(commands, 1, &clear, 1, &rect);
    canvas.drawVertices(commands, reversed, fightingPlanes(true, 0.015625f, 0.984375f));
  });
}

// Pixels of one half that show the plane behind.
uint32_t wronglyRed(const Picture& picture, uint32_t x0, uint32_t x1) {
  uint32_t count = 0;
  for (uint32_t y = 0; y < picture.height; ++y)
    for (uint32_t x = x0; x < x1; ++x) count += picture.at(x, y)[0] > picture.at(x, y)[1];
  return count;
}

// What is taught: with a float format reversed depths end the fight but for the last stripes; with a fixed-point one
// they do not help. More bits, less fight.
std::string verifyZFighting(const Picture& picture, VkFormat format) {
  uint32_t usual = wronglyRed(picture, 0, kSize / 2), reversed = wronglyRed(picture, kSize / 2, kSize), half = kSize * kSize / 2;
  std::string counts = std::to_string(usual) + " pixels show the plane behind, with reversed depths " + std::to_string(reversed) +
                       ", of " + std::to_string(half);
  auto share = [&](uint32_t count) { return double(count) / half; };
  if (format == VK_FORMAT_D32_SFLOAT && !(share(reversed) < 0.001 && share(usual) > 0.01)) return counts;
  if (format == VK_FORMAT_D24_UNORM_S8_UINT && !(share(usual) > 0.01 && share(usual) < 0.05 && share(reversed) > 0.01 && share(reversed) < 0.05)) return counts;
  if (format == VK_FORMAT_D16_UNORM && !(share(usual) > 0.3 && share(reversed) > 0.3)) return counts;
  return {};
}

}  // namespace

void addDepthPrecisionScenes(SceneList& scenes) {
  for (auto [format, name] : {std::pair{VK_FORMAT_D16_UNORM, "z_fighting_16"}, std::pair{VK_FORMAT_D24_UNORM_S8_UINT, "z_fighting_24"},
                              std::pair{VK_FORMAT_D32_SFLOAT, "z_fighting_32"}}) {
    Scene scene;
    scene.name = name;
    scene.broken = "reversed depths with the compare operation of usual ones";
    scene.render = [format = format](Device& d, Variant v) { return renderZFighting(d, v, format); };
    scene.supported = [format = format](const Device& d) { return d.supports(format, VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT); };
    scene.verify = [format = format](const Picture& p) { return verifyZFighting(p, format); };
    if (format != VK_FORMAT_D16_UNORM) scene.oracle = {1, format == VK_FORMAT_D32_SFLOAT ? 0.01 : 0.007, "where planes fight, the last bit of a depth decides"};
    scene.expectation = [] {
      // Where planes fight, the last bit of a depth decides: such pixels show the one or the other plane.
      Expectation e;
      e.either = [](const uint8_t* tested, const uint8_t* peer) {
        // Both planes are equally bright at a pixel: 0.9 in red here is 0.9 in green there.
        bool red = tested[0] > tested[1];
        int first = tested[red ? 0 : 1], second = peer[red ? 1 : 0];
        return red == (peer[1] > peer[0]) && std::abs(first - second) <= 2;
      };
      e.stepShare = 0.02;
      return e;
    };
    scenes.push_back(scene);
  }
}

}  // namespace pumice::cts
