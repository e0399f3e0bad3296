// Every family of instructions in compute shaders, on random and extreme inputs: the driver under test against lavapipe,
// bit by bit for integers, within twice what the specification's table of precision allows one device for floats.
#include "cts_subset/tests/families.h"

#include "cts_subset/tests/compute.h"
#include "cts_subset/tests/probe.h"

#include <bit>
#include <iomanip>

namespace pumice::cts {
namespace {

constexpr uint32_t kGroups = 16, kLanes = 64 * kGroups, kLaneBytes = 64;

std::vector<Lane> inputs() {
  std::vector<Lane> lanes(kLanes);
  uint64_t state = 0x9e3779b97f4a7c15ull;
  auto random = [&] { return state ^= state << 13, state ^= state >> 7, state ^= state << 17, uint32_t(state >> 16); };
  const uint32_t extremes[] = {0, 1, 2, 0x7fffffff, 0x80000000, 0x80000001, 0xffffffff, 0xfffffffe, 31, 32, 255, 0x8000, 0xffff, 0x55555555};
  const float floats[] = {0.0f, -0.0f, 1.0f, -1.0f, 0.5f, 2.0f, 3.4028235e38f, -3.4028235e38f, 1.17549435e-38f, INFINITY, -INFINITY, 16777216.0f, 3.14159274f, 1.5f};
  auto word = [&] { return random() % 4 == 0 ? extremes[random() % std::size(extremes)] : random() % 3 == 0 ? random() >> random() % 31 : random(); };
  auto number = [&] {
    if (random() % 8 == 0) return floats[random() % std::size(floats)];
    const float f = std::ldexp(1.0f + float(random() & 0x7fffff) / 8388608.0f, int(random() % 24) - 12);
    return random() % 2 ? -f : f;
  };
  for (Lane& l : lanes) l = {word(), word(), word(), word(), number(), number(), number(), number()};
  return lanes;
}

std::string shaderOf(const InstructionFamily& family) {
  std::string extensions, rest;   // extensions come first in a shader
  for (size_t at = 0; at < family.declarations.size();) {
    size_t end = family.declarations.find('\n', at);
    if (end == std::string::npos) end = family.declarations.size() - 1;
    const std::string line = family.declarations.substr(at, end + 1 - at);
    (line.starts_with("#extension") ? extensions : rest) += line;
    at = end + 1;
  }
  const bool addresses = extensions.find("buffer_reference") != std::string::npos;
  std::string s = "#version 460\n" + extensions + R"(
layout(local_size_x = 64) in;
struct Lane { uint a, b, c, d; float x, y, z, w; };
layout(binding = 0, std430) readonly buffer In { Lane lanes[]; };
layout(binding = 1, std430) writeonly buffer Out { uint results[]; };
layout(binding = 2, std430) buffer Scratch { uint scratch[]; };
layout(binding = 3, r32ui) coherent uniform uimage2D img;
layout(binding = 4) uniform sampler2D tex;
)" + std::string(addresses ? "layout(push_constant) uniform Push { uint64_t address; };\n" : "") + rest + R"(
void main() {
  const uint n = gl_GlobalInvocationID.x;
  const Lane l = lanes[n];
  const uint a = l.a, b = l.b, c = l.c, d = l.d;
  const float x = l.x, y = l.y, z = l.z, w = l.w;
  const int i = int(a), j = int(b);
)";
  const std::string rows = std::to_string(family.rows.size());
  for (size_t r = 0; r < family.rows.size(); r++) {
    const std::string value = family.rows[r].expression;
    s += "  results[n * " + rows + "u + " + std::to_string(r) + "u] = " + (family.rows[r].isFloat ? "floatBitsToUint(" + value + ")" : value) + ";\n";
  }
  return s + "}\n";
}

Words runFamily(Device& device, const InstructionFamily& family, const std::vector<Lane>& lanes) {
  Workspace work(device);
  Buffer in = work.bufferOf(lanes, kStorage), out = work.bufferOf(Words(kLanes * family.rows.size(), 0xcdcdcdcd), kStorage);
  Buffer scratch = work.bufferOf(Words(kLanes * kLaneBytes / 4, 0), kStorage);
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {64, kGroups, 1};
  spec.usage |= VK_IMAGE_USAGE_STORAGE_BIT;
  Image image = work.image(spec);
  toGeneral(work, image);
  std::vector<uint8_t> texels(16 * 16 * 4);
  for (size_t i = 0; i < texels.size(); i++) texels[i] = uint8_t(i * 37 + i / 64 * 11);
  Image texture = work.texture(16, 16, texels);
  VkSampler sampler = work.sampler(VK_FILTER_LINEAR, VK_SAMPLER_ADDRESS_MODE_REPEAT);

  // Memory that is read and written by its address.
  const uint64_t address = device.vulkan12.bufferDeviceAddress ? addressedBuffer(work, kLanes * kLaneBytes).address : 0;
  DescriptorSet set = work.descriptors({bufferBinding(in), bufferBinding(out), bufferBinding(scratch), storageBinding(work.view(image)),
                                        sampledBinding(work.view(texture), sampler, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL)});
  VkPipelineLayout layout = makePipelineLayout(work, {set.layout}, 8);
  VkPipeline pipeline = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, shaderOf(family), ShaderTarget::kVulkan13), layout);
  device.run([&](VkCommandBuffer c) {
    fullBarrier(c);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set.handle, 0, nullptr);
    vkCmdPushConstants(c, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 8, &address);
    vkCmdDispatch(c, kGroups, 1, 1);
    fullBarrier(c);
  });
  return valuesOf<uint32_t>(wordsOf(bytesOf(out)));
}

bool agree(const Row& row, const Lane& lane, uint32_t found, uint32_t other) {
  if (found == other) return true;
  if (!row.isFloat) return false;
  const float f = std::bit_cast<float>(found), g = std::bit_cast<float>(other);
  if (f == g) return true;   // zeros
  if (!std::isfinite(f) || !std::isfinite(g)) {
    if (std::isnan(f) && std::isnan(g)) return true;
    // On the way something may overflow in one order and not in another; the largest numbers may round to infinity.
    return row.allowed && (std::isinf(row.allowed(lane, 0)) || (std::fabs(f) > 3e38f && std::fabs(g) > 3e38f && std::signbit(f) == std::signbit(g)));
  }
  if (std::fabs(f) < 0x1p-126f && std::fabs(g) < 0x1p-126f) return true;   // denormals may be flushed
  if (!row.allowed) return false;
  const double allowed = 2 * std::max(row.allowed(lane, f), row.allowed(lane, g));
  return std::isinf(allowed) || std::fabs(double(f) - g) <= allowed;
}

class Families : public testing::TestWithParam<size_t> {};

TEST_P(Families, AgreeWithLavapipe) {
  PUMICE_NEED_TESTED();
  PUMICE_NEED_PEER();
  const InstructionFamily& family = instructionFamilies()[GetParam()];
  if (!family.present(*world().peer)) GTEST_SKIP() << "lavapipe does not have it";
  ASSERT_TRUE(family.present(*world().tested));
  const std::vector<Lane> lanes = inputs();
  const Words found = runFamily(*world().tested, family, lanes), other = runFamily(*world().peer, family, lanes);
  for (size_t r = 0; r < family.rows.size(); r++) {
    const Row& row = family.rows[r];
    uint32_t wrong = 0;
    std::ostringstream first;
    for (size_t n = 0; n < kLanes; n++) {
      const uint32_t f = found[n * family.rows.size() + r], g = other[n * family.rows.size() + r];
      if (agree(row, lanes[n], f, g) || ++wrong > 3) continue;
      const Lane& l = lanes[n];
      first << std::setprecision(9) << "\n  invocation " << n << std::hex << ": " << f << " and " << g << std::dec;
      if (row.isFloat) first << " (" << std::bit_cast<float>(f) << " and " << std::bit_cast<float>(g) << ")";
      first << std::hex << " of a " << l.a << " b " << l.b << " c " << l.c << " d " << l.d << std::dec << " x " << l.x << " y " << l.y << " z " << l.z << " w " << l.w;
    }
    EXPECT_EQ(wrong, 0u) << row.expression << first.str();
    EXPECT_NE(found[r], 0xcdcdcdcdu) << row.expression << " has written nothing";
  }
}

std::vector<size_t> numbers() {
  std::vector<size_t> n(instructionFamilies().size());
  for (size_t i = 0; i < n.size(); i++) n[i] = i;
  return n;
}
INSTANTIATE_TEST_SUITE_P(All, Families, testing::ValuesIn(numbers()), [](const auto& info) { return std::string(instructionFamilies()[info.param].name); });

}  // namespace
}  // namespace pumice::cts
