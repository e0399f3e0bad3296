// Images through descriptors: the states in set memory select the routine; arrays may be indexed dynamically.
#include <gtest/gtest.h>

#include "pipeline/saved_routines.h"
#include "pipeline/variants.h"
#include "tests/pipeline/scene.h"

namespace pumice::pipeline::test {
namespace {

using Rgba = std::array<uint8_t, 4>;

texture::CombinedDescriptor describe(Image& image, VkFilter filter) {
  texture::CombinedDescriptor d;
  const texture::ImageLayout& l = image.layout;
  const texture::PlaneLayout& p = l.planes[0];
  d.image.base = uint64_t(image.memory().base) + p.offset;
  d.image.levels = uint64_t(&p.levels[0]);
  d.image.layerPitch = p.layerPitch;
  d.image.samplePitch = p.samplePitch;
  d.image.size = l.size - p.offset;
  d.image.width = l.extent.width;
  d.image.height = l.extent.height;
  d.image.depth = d.image.layerCount = d.image.levelCount = d.image.samples = 1;
  texture::ViewKey& v = d.image.key;
  v.format = uint16_t(l.format - texture::allFormats().data() + 1);
  v.viewType = VK_IMAGE_VIEW_TYPE_2D;
  v.tiled = 1;
  v.aspect = VK_IMAGE_ASPECT_COLOR_BIT;
  for (uint8_t c = 0; c < 4; ++c) v.swizzle[c] = uint8_t(VK_COMPONENT_SWIZZLE_R + c);
  v.samples = v.singleLevel = 1;
  texture::SamplerKey& k = d.sampler.key;
  k.magFilter = k.minFilter = uint8_t(filter);
  k.addressU = k.addressV = k.addressW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  k.present = 1;
  return d;
}

void fill(Image& image, Rgba (*color)(uint32_t x, uint32_t y)) {
  for (uint32_t y = 0; y < image.layout.extent.height; ++y)
    for (uint32_t x = 0; x < image.layout.extent.width; ++x) {
      const Rgba c = color(x, y);
      std::memcpy(image.memory().base + image.layout.elementOffset(image.layout.planes[0], 0, 0, 0, x, y, 0), c.data(), 4);
    }
}

struct Textured {
  Scene scene{32, 32};
  Image first{VK_FORMAT_R8G8B8A8_UNORM, 8, 8}, second{VK_FORMAT_B8G8R8A8_UNORM, 8, 8};
  std::array<texture::CombinedDescriptor, 2> set;
  std::shared_ptr<Layout> layout = std::make_shared<Layout>();

  Textured() {
    fill(first, [](uint32_t x, uint32_t y) { return Rgba{uint8_t(x * 30), uint8_t(y * 30), 1, 255}; });
    fill(second, [](uint32_t x, uint32_t y) { return Rgba{2, uint8_t(y * 20), uint8_t(x * 20), 255}; });   // stored as B, G, R, A
    set = {describe(first, VK_FILTER_NEAREST), describe(second, VK_FILTER_NEAREST)};
    layout->sets.resize(1);
    Binding b;
    b.type = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
    b.count = 2;
    b.stride = texture::descriptorStride(b.type);
    layout->sets[0].bindings.set(0, b);
    layout->sets[0].size = sizeof set;
    layout->dynamicBase = {0};
  }
  void draw(const char* fragment) { draw(pipeline(fragment)); }
  std::shared_ptr<GraphicsPipeline> pipeline(const char* fragment) { return scene.pipeline(scene.state(), kColorVertex, fragment, layout); }
  void draw(std::shared_ptr<GraphicsPipeline> pipeline) {
    auto d = scene.drawState(std::move(pipeline));
    d.setMemory[0] = reinterpret_cast<const std::byte*>(set.data());
    d.setSize[0] = sizeof set;
    scene.begin();
    scene.draw(d, rectangle(scene, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1}));
    scene.end();
  }
};

const char* const kOne = R"(#version 450
layout(set = 0, binding = 0) uniform sampler2D images[2];
layout(location = 0) out vec4 target;
void main() { target = texture(images[0], gl_FragCoord.xy / 32.0); })";

TEST(Descriptors, SampledImageCoversTheRectangle) {
  Textured t;
  t.draw(kOne);
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) ASSERT_EQ(t.scene.color.rgba(x, y), (Rgba{uint8_t(x / 4 * 30), uint8_t(y / 4 * 30), 1, 255})) << x << ", " << y;
}

TEST(Descriptors, NullDescriptorReadsZero) {
  Textured t;
  t.set[0] = {};
  t.draw(kOne);
  EXPECT_EQ(t.scene.color.rgba(9, 9), (Rgba{0, 0, 0, 0}));
}

TEST(Descriptors, ArrayOfImagesOfDifferentFormatsIsIndexedPerPixel) {
  Textured t;
  t.draw(R"(#version 450
layout(set = 0, binding = 0) uniform sampler2D images[2];
layout(location = 0) out vec4 target;
void main() { target = textureLod(images[int(gl_FragCoord.y) / 16], gl_FragCoord.xy / 32.0, 0.0); })");
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) {
      const Rgba expected = y < 16 ? Rgba{uint8_t(x / 4 * 30), uint8_t(y / 4 * 30), 1, 255} : Rgba{uint8_t(x / 4 * 20), uint8_t(y / 4 * 20), 2, 255};
      ASSERT_EQ(t.scene.color.rgba(x, y), expected) << x << ", " << y;
    }
}

// What is in an array is looked at once for each generation of its set.
TEST(Descriptors, ArraysOfHeadedSetsAreReadAgainWhenTheyAreWritten) {
  Textured t;
  struct {
    SetHeader header;
    std::array<texture::CombinedDescriptor, 2> set;
  } memory{{1ull << 40}, t.set};
  t.layout->sets[0].headed = true;
  auto d = t.scene.drawState(t.pipeline(R"(#version 450
layout(set = 0, binding = 0) uniform sampler2D images[2];
layout(location = 0) out vec4 target;
void main() { target = textureLod(images[int(gl_FragCoord.y) / 16], gl_FragCoord.xy / 32.0, 0.0); })"));
  d.setMemory[0] = reinterpret_cast<const std::byte*>(memory.set.data());
  d.setSize[0] = sizeof memory.set;
  const auto pixel = [&] {
    t.scene.begin();
    t.scene.draw(d, rectangle(t.scene, 0, 0, 32, 32, 0.5f, {1, 1, 1, 1}));
    t.scene.end();
    return t.scene.color.rgba(13, 29);
  };
  EXPECT_EQ(pixel(), (Rgba{60, 140, 2, 255}));
  uint8_t* swizzle = memory.set[1].image.key.swizzle;
  std::swap(swizzle[0], swizzle[2]);
  const uint64_t linked = routineCounts().linked;
  EXPECT_EQ(pixel(), (Rgba{0, 0, 0, 0})) << "of a state that nobody has heard of";
  EXPECT_EQ(routineCounts().linked, linked);
  memory.header.generation++;
  EXPECT_EQ(pixel(), (Rgba{2, 140, 60, 255}));
}

// More states than routines are kept for, again and again: from the second time on table routines serve them.
TEST(Descriptors, StatesBeyondTheVariantsThatAreKeptShareRoutines) {
  Textured t;
  const char* const fragment = R"(#version 450
layout(set = 0, binding = 0) uniform sampler2D images[2];
layout(location = 0) out vec4 target;
void main() { vec2 p = gl_FragCoord.xy / 13.0 - 0.7; target = texture(images[0], p) * 0.5 + texture(images[1], p.yx) * 0.5; })";
  constexpr VkSamplerAddressMode kAddresses[] = {VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT,
                                                 VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER};
  constexpr uint32_t kStates = 2 * kMaxVariants;
  const auto set = [&](uint32_t n) {
    texture::SamplerKey& k = t.set[0].sampler.key;
    k.addressU = uint8_t(kAddresses[n % 4]);
    k.addressV = uint8_t(kAddresses[n / 4 % 4]);
    k.magFilter = n / 16 & 1;
    k.minFilter = n / 32 & 1;
    t.set[1].sampler.key.addressU = uint8_t(kAddresses[n / 64 & 1]);
  };
  const auto picture = [&] {
    std::vector<Rgba> pixels;
    for (uint32_t y = 0; y < 32; ++y)
      for (uint32_t x = 0; x < 32; ++x) pixels.push_back(t.scene.color.rgba(x, y));
    return pixels;
  };
  const auto shared = t.pipeline(fragment);
  std::vector<std::vector<Rgba>> expected(kStates);
  uint64_t linked = 0;
  for (uint32_t round = 0; round < 3; ++round) {
    const uint64_t before = routineCounts().linked;
    for (uint32_t n = 0; n < kStates; ++n) {
      set(n);
      t.draw(shared);
      if (!round) expected[n] = picture();
      ASSERT_EQ(picture(), expected[n]) << "state " << n << ", round " << round;
    }
    linked = routineCounts().linked - before;
    if (round == 0) EXPECT_GE(linked, kStates);
    if (round == 1) EXPECT_LE(linked, 4u);
  }
  EXPECT_EQ(linked, 0u);
}

TEST(Descriptors, DiscardedPixelsStoreNothing) {
  Scene s(32, 32);
  auto layout = std::make_shared<Layout>();
  layout->sets.resize(1);
  Binding b;
  b.type = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  b.count = 1;
  b.stride = texture::descriptorStride(b.type);
  layout->sets[0].bindings.set(0, b);
  layout->sets[0].size = 32;
  layout->dynamicBase = {0};
  std::vector<uint32_t> counts(32 * 32);
  texture::BufferDescriptor descriptor;
  descriptor.base = uint64_t(counts.data());
  descriptor.size = counts.size() * 4;
  auto d = s.drawState(s.pipeline(s.state(), kColorVertex, R"(#version 450
layout(set = 0, binding = 0) buffer B { uint counts[]; };
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() {
  if (gl_FragCoord.x < 10.0) discard;
  atomicAdd(counts[uint(gl_FragCoord.y) * 32u + uint(gl_FragCoord.x)], 1u);
  target = color + vec4(dFdx(gl_FragCoord.x));
})",
                                  layout));
  d.setMemory[0] = reinterpret_cast<const std::byte*>(&descriptor);
  d.setSize[0] = sizeof descriptor;
  s.begin();
  s.draw(d, triangle(s, {3, 3, 29, 3, 3, 29}, 0.5f, {0, 0, 0, 0}));
  s.end();
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) ASSERT_EQ(counts[y * 32 + x], s.color.rgba(x, y)[0] == 255 ? 1u : 0u) << x << ", " << y;
}

}  // namespace
}  // namespace pumice::pipeline::test
