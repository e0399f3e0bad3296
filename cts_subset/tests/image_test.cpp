// Images of every kind: views of parts, linear memory, several samples, very large ones.
#include "cts_subset/tests/probe.h"

#include <algorithm>
#include <cmath>

namespace pumice::cts {
namespace {

constexpr VkImageUsageFlags kCopies = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
constexpr VkImageUsageFlags kSampled = VK_IMAGE_USAGE_SAMPLED_BIT, kStored = VK_IMAGE_USAGE_STORAGE_BIT, kColour = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;

class Images : public OnDevice {
 protected:
  bool supports(const ImageSpec& s) {
    VkImageFormatProperties p{};
    return vkGetPhysicalDeviceImageFormatProperties(device().physical, s.format, s.type, s.tiling, s.usage, s.flags, &p) == VK_SUCCESS &&
           (p.sampleCounts & s.samples) && s.extent.width <= p.maxExtent.width && s.mips <= p.maxMipLevels && s.layers <= p.maxArrayLayers;
  }
  // The tested driver must; a peer may not.
  bool need(const ImageSpec& s) {
    if (supports(s)) return true;
    EXPECT_NE(GetParam(), Role::kTested) << "an image of format " << s.format << " is not supported";
    return false;
  }
};

void clear(Workspace& work, const Image& image) {
  work.device.run([&](VkCommandBuffer commands) {
    VkClearColorValue value{};
    VkImageSubresourceRange all{VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
    vkCmdClearColorImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &all);
    fullBarrier(commands);
  });
}

const char* const kPixelFragment =
    "#version 450\nlayout(location = 0) out vec4 c;\nvoid main() { c = vec4(floor(gl_FragCoord.xy) / 255.0, 0.2, 1.0); }";

TEST_P(Images, SlicesOf3DAreDrawnTo) {
  Workspace work(device());
  ImageSpec spec;
  spec.type = VK_IMAGE_TYPE_3D;
  spec.extent = {24, 20, 12};
  spec.mips = 3;
  spec.usage = kCopies | kColour | kSampled;
  spec.flags = VK_IMAGE_CREATE_2D_ARRAY_COMPATIBLE_BIT;
  if (!need(spec)) return;
  Image image = work.image(spec);
  toGeneral(work, image);
  clear(work, image);
  ViewSpec view{VK_IMAGE_VIEW_TYPE_2D_ARRAY};
  view.mip = 1, view.mips = 1, view.layer = 3, view.layers = 2;
  Painting p;
  p.extent = {12, 10};
  p.layers = 2;
  p.fragment = kPixelFragment;
  paint(work, makeView(work, image, view), spec.format, p);  // layer 0: slice 3
  for (uint32_t mip = 0; mip < 3; ++mip) {
    Bytes found = download(work, image, mip, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4);
    const uint32_t w = 24 >> mip, h = 20 >> mip;
    for (uint32_t i = 0; i < found.size() / 4; ++i) {
      uint32_t x = i % w, y = i / w % h, z = i / w / h;
      const bool drawn = mip == 1 && z == 3;
      const Bytes want = drawn ? Bytes{uint8_t(x), uint8_t(y), 51, 255} : Bytes{0, 0, 0, 0};
      ASSERT_EQ(Bytes(found.begin() + i * 4, found.begin() + i * 4 + 4), want) << "mip " << mip << " at " << x << ", " << y << ", " << z;
    }
  }
}

TEST_P(Images, LinesAreDrawnToAndSampled) {
  Workspace work(device());
  ImageSpec spec;
  spec.type = VK_IMAGE_TYPE_1D;
  spec.extent = {37, 1, 1};
  spec.layers = 3;
  spec.usage = kCopies | kColour | kSampled;
  if (!need(spec)) return;
  Image image = work.image(spec);
  toGeneral(work, image);
  clear(work, image);
  ViewSpec view{VK_IMAGE_VIEW_TYPE_1D};
  view.layer = 2, view.layers = 1;
  Painting p;
  p.extent = {37, 1};
  p.fragment = kPixelFragment;
  paint(work, makeView(work, image, view), spec.format, p);
  std::vector<glm::vec4> q;
  for (int i = 0; i < 111; ++i) q.push_back({i % 37, i / 37, 0, 0});
  auto a = probe(work, "layout(binding = 2) uniform sampler1DArray image;", "answer = texelFetch(image, ivec2(ask(0).xy), 0) * 255;",
                 {sampledBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_1D_ARRAY}), work.make(samplerInfo()))}, q);
  for (size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i].x, q[i].y == 2 ? q[i].x : 0, 1e-3) << i;
}

TEST_P(Images, SamplesAreStoredAndFetchedOneByOne) {
  if (!device().features.shaderStorageImageMultisample) {
    ASSERT_NE(GetParam(), Role::kTested);
    GTEST_SKIP();
  }
  for (VkFormat format : {VK_FORMAT_R32_UINT, VK_FORMAT_R32G32B32A32_UINT}) {
    Workspace work(device());
    ImageSpec spec;
    spec.format = format;
    spec.extent = {21, 13, 1};
    spec.layers = 2;
    spec.samples = VK_SAMPLE_COUNT_4_BIT;
    spec.usage = kStored | kSampled;
    if (!need(spec)) return;
    Image image = work.image(spec);
    toGeneral(work, image);
    std::vector<glm::vec4> q;
    for (int layer = 0; layer < 2; ++layer)
      for (int sample = 0; sample < 4; ++sample)
        for (int y = 0; y < 13; ++y)
          for (int x = 0; x < 21; ++x) q.push_back({x, y, layer, sample});
    VkImageView view = makeView(work, image, {VK_IMAGE_VIEW_TYPE_2D_ARRAY});
    const std::string declared = std::string("layout(binding = 2, ") + (format == VK_FORMAT_R32_UINT ? "r32ui" : "rgba32ui") + ") uniform uimage2DMSArray image;";
    probe(work, declared, "ivec4 p = ivec4(ask(0)); imageStore(image, p.xyz, p.w, uvec4(p.x + p.y * 100 + p.z * 10000 + p.w * 100000));", {storageBinding(view)}, q);
    auto loaded = probe(work, declared, "ivec4 p = ivec4(ask(0)); answer = vec4(imageLoad(image, p.xyz, p.w).x, imageSamples(image), imageSize(image).xz);",
                        {storageBinding(view)}, q);
    auto fetched = probe(work, "layout(binding = 2) uniform usampler2DMSArray image;",
                         "ivec4 p = ivec4(ask(0)); answer = vec4(texelFetch(image, p.xyz, p.w).x, textureSamples(image), textureSize(image).xz);",
                         {sampledBinding(view, work.make(samplerInfo()))}, q);
    for (size_t i = 0; i < q.size(); ++i) {
      glm::vec4 want(q[i].x + q[i].y * 100 + q[i].z * 10000 + q[i].w * 100000, 4, 21, 2);
      ASSERT_EQ(loaded[i], want) << i;
      ASSERT_EQ(fetched[i], want) << i;
    }
  }
}

TEST_P(Images, LinearMemoryIsRowsThatTheHostSees) {
  Workspace work(device());
  for (VkFormat format : {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R8_UNORM, VK_FORMAT_R16G16B16A16_UNORM}) {
    const uint32_t bytes = format == VK_FORMAT_R8_UNORM ? 1 : format == VK_FORMAT_R8G8B8A8_UNORM ? 4 : 8;
    ImageSpec spec;
    spec.format = format;
    spec.extent = {19, 9, 1};
    spec.tiling = VK_IMAGE_TILING_LINEAR;
    spec.usage = kSampled | kCopies;
    if (!supports(spec)) {
      EXPECT_NE(GetParam(), Role::kTested);
      continue;
    }
    Image image = work.image(spec);
    toGeneral(work, image);
    VkImageSubresource sub{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0};
    VkSubresourceLayout layout{};
    vkGetImageSubresourceLayout(device().handle, image.handle, &sub, &layout);
    Bytes texels = noise(19 * 9 * bytes, 3);
    Piece piece;
    piece.extent = spec.extent;
    upload(work, image, piece, texels);
    std::byte* mapped = nullptr;
    if (vkMapMemory(device().handle, image.memory, 0, VK_WHOLE_SIZE, 0, reinterpret_cast<void**>(&mapped)) != VK_SUCCESS) continue;
    for (uint32_t y = 0; y < 9; ++y)
      ASSERT_EQ(std::memcmp(mapped + layout.offset + y * layout.rowPitch, &texels[y * 19 * bytes], 19 * bytes), 0) << format << " row " << y;
    // And the other way: what the host writes is sampled.
    std::memset(mapped + layout.offset + 4 * layout.rowPitch + 7 * bytes, 0xff, bytes);
    auto a = probe(work, "layout(binding = 2) uniform sampler2D image;", "answer = texelFetch(image, ivec2(ask(0).xy), 0);",
                   {sampledBinding(makeView(work, image, {}), work.make(samplerInfo()))}, {{7, 4, 0, 0}, {6, 4, 0, 0}});
    EXPECT_EQ(a[0].x, 1.0f) << format;
    EXPECT_NE(a[1], a[0]) << format;
    vkUnmapMemory(device().handle, image.memory);
  }
}

TEST_P(Images, ViewsOfOtherFormatsShareBits) {
  Workspace work(device());
  ImageSpec spec;
  spec.extent = {16, 8, 1};
  spec.mips = 2;
  spec.layers = 2;
  spec.usage = kSampled | kCopies;
  spec.flags = VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT;
  Image image = work.image(spec);
  toGeneral(work, image);
  Bytes texels = noise(8 * 4 * 4, 8);
  Piece piece;
  piece.mip = 1, piece.layer = 1;
  piece.extent = {8, 4, 1};
  upload(work, image, piece, texels);
  std::vector<glm::vec4> q;
  for (int i = 0; i < 32; ++i) q.push_back({i % 8, i / 8, 0, 0});
  ViewSpec view;
  view.mip = 1, view.mips = 1, view.layer = 1, view.layers = 1;
  view.format = VK_FORMAT_R32_UINT;
  VkImageView words = makeView(work, image, view);
  view.format = VK_FORMAT_A2B10G10R10_UNORM_PACK32;
  VkImageView tens = makeView(work, image, view);
  VkSampler sampler = work.make(samplerInfo());
  auto a = probe(work, "layout(binding = 2) uniform usampler2D words; layout(binding = 3) uniform sampler2D tens;",
                 "ivec2 p = ivec2(ask(0).xy); answer = vec4(uintBitsToFloat(texelFetch(words, p, 0).x), texelFetch(tens, p, 0).xy, 0);",
                 {sampledBinding(words, sampler), sampledBinding(tens, sampler)}, q);
  for (size_t i = 0; i < a.size(); ++i) {
    uint32_t want, got;
    std::memcpy(&want, &texels[i * 4], 4);
    std::memcpy(&got, &a[i].x, 4);
    ASSERT_EQ(got, want);
    ASSERT_NEAR(a[i].y, (want & 1023) / 1023.0, 1e-6);
    ASSERT_NEAR(a[i].z, (want >> 10 & 1023) / 1023.0, 1e-6);
  }
}

// 4 GiB in one slice: offsets beyond 2 and just below 4 GiB, and a second layer beyond that. Untouched pages cost nothing.
TEST_P(Images, BeyondTwoGibibytes) {
  if (GetParam() != Role::kTested) GTEST_SKIP() << "lavapipe commits the memory";
  ImageSpec spec;
  spec.format = VK_FORMAT_R32G32B32A32_UINT;
  spec.extent = {16384, 16384, 1};
  spec.layers = 2;
  spec.usage = kSampled | kStored | kCopies;
  if (device().memory.memoryHeaps[0].size < (10ull << 30)) GTEST_SKIP() << "the heap is smaller than 10 GiB";
  Workspace work(device());
  ASSERT_TRUE(supports(spec));
  Image image;
  try {
    image = work.image(spec);
  } catch (const VulkanError& e) {
    GTEST_SKIP() << e.what();
  }
  toGeneral(work, image);
  std::vector<glm::vec4> q;
  for (int layer = 0; layer < 2; ++layer)
    for (glm::vec2 at : {glm::vec2(0, 0), glm::vec2(16383, 8191), glm::vec2(0, 8192), glm::vec2(5, 8200), glm::vec2(16380, 16383), glm::vec2(16383, 16383)})
      q.push_back({at.x, at.y, layer, 0});
  const char* kValue = "uvec4(p.x, p.y, p.z, 77)";
  probe(work, "layout(binding = 2, rgba32ui) uniform uimage2DArray image;", std::string("ivec4 p = ivec4(ask(0)); imageStore(image, p.xyz, ") + kValue + ");",
        {storageBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_2D_ARRAY}))}, q);
  VkSampler sampler = work.make(samplerInfo());
  auto a = probe(work, "layout(binding = 2) uniform usampler2DArray image;",
                 "ivec4 p = ivec4(ask(0)); uvec4 t = texelFetch(image, p.xyz, 0), u = texture(image, vec3((vec2(p.xy) + 0.5) / 16384.0, p.z));\n"
                 "answer = vec4(t == uvec4(p.x, p.y, p.z, 77), u == t, 0, 0);",
                 {sampledBinding(makeView(work, image, {VK_IMAGE_VIEW_TYPE_2D_ARRAY}), sampler)}, q);
  for (size_t i = 0; i < q.size(); ++i) EXPECT_EQ(a[i], glm::vec4(1, 1, 0, 0)) << q[i].x << ", " << q[i].y << " layer " << q[i].z;
  // Copies reach there too.
  Piece piece;
  piece.layer = 1;
  piece.offset = {16382, 16382, 0};
  piece.extent = {2, 2, 1};
  Buffer out = work.buffer(64, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  VkBufferImageCopy region = regionOf(piece, VK_IMAGE_ASPECT_COLOR_BIT);
  device().run([&](VkCommandBuffer commands) {
    vkCmdCopyImageToBuffer(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, out.handle, 1, &region);
    fullBarrier(commands);
  });
  uint32_t last[4];
  std::memcpy(last, out.mapped + 48, 16);
  EXPECT_EQ(last[0], 16383u);
  EXPECT_EQ(last[1], 16383u);
  EXPECT_EQ(last[2], 1u);
}

class ImagesWithPeer : public testing::Test {};

// Mip chains made by blits, in two and three dimensions, then mirrored and scaled into another format.
TEST_F(ImagesWithPeer, BlitsScaleVolumesAndArrays) {
  PUMICE_NEED_TESTED();
  PUMICE_NEED_PEER();
  for (bool volume : {false, true}) {
    std::vector<glm::vec4> answers[2];
    Device* devices[2] = {world().tested.get(), world().peer.get()};
    for (int d = 0; d < 2; ++d) {
      Workspace work(*devices[d]);
      ImageSpec spec;
      spec.type = volume ? VK_IMAGE_TYPE_3D : VK_IMAGE_TYPE_2D;
      spec.extent = {32, 16, volume ? 8u : 1u};
      spec.layers = volume ? 1 : 4;
      spec.mips = 4;
      spec.usage = kSampled | kCopies;
      Image image = work.image(spec);
      spec.mips = 1;
      spec.extent = {21, 13, volume ? 5u : 1u};
      spec.format = VK_FORMAT_R32G32B32A32_SFLOAT;
      Image target = work.image(spec);
      toGeneral(work, image);
      toGeneral(work, target);
      Piece piece;
      piece.layers = image.spec.layers;
      piece.extent = image.spec.extent;
      upload(work, image, piece, noise(32 * 16 * 8 * 4, 12));
      work.device.run([&](VkCommandBuffer commands) {
        VkImageBlit blit{};
        blit.srcSubresource = blit.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, image.spec.layers};
        for (uint32_t mip = 1; mip < 4; ++mip) {
          auto size = [&](uint32_t m) { return VkOffset3D{32 >> m, 16 >> m, volume ? 8 >> m : 1}; };
          blit.srcSubresource.mipLevel = mip - 1;
          blit.dstSubresource.mipLevel = mip;
          blit.srcOffsets[1] = size(mip - 1);
          blit.dstOffsets[1] = size(mip);
          vkCmdBlitImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_LINEAR);
          fullBarrier(commands);
        }
        blit.srcSubresource.mipLevel = 1;
        blit.dstSubresource.mipLevel = 0;
        blit.srcOffsets[0] = {16, 1, 0};
        blit.srcOffsets[1] = {2, 8, volume ? 4 : 1};
        blit.dstOffsets[0] = {1, 12, 0};
        blit.dstOffsets[1] = {20, 0, volume ? 5 : 1};
        vkCmdClearColorImage(commands, target.handle, VK_IMAGE_LAYOUT_GENERAL, std::array<VkClearColorValue, 1>{}.data(), 1,
                             std::array<VkImageSubresourceRange, 1>{{{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, target.spec.layers}}}.data());
        fullBarrier(commands);
        vkCmdBlitImage(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, target.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_LINEAR);
        fullBarrier(commands);
      });
      std::vector<glm::vec4> q;
      for (int z = 0; z < (volume ? 5 : 4); ++z)
        for (int y = 0; y < 13; ++y)
          for (int x = 0; x < 21; ++x) q.push_back({x, y, z, 0});
      VkSampler sampler = work.make(samplerInfo());
      VkImageViewType type = volume ? VK_IMAGE_VIEW_TYPE_3D : VK_IMAGE_VIEW_TYPE_2D_ARRAY;
      std::string kind = volume ? "sampler3D" : "sampler2DArray";
      answers[d] = probe(work, "layout(binding = 2) uniform " + kind + " image;", "answer = texelFetch(image, ivec3(ask(0).xyz), 0);",
                         {sampledBinding(makeView(work, target, {type}), sampler)}, q);
      for (glm::vec4& v : q) v = {int(v.x) % 4, int(v.y) % 2, volume ? 0 : int(v.z), 3};
      auto small = probe(work, "layout(binding = 2) uniform " + kind + " image;", "answer = texelFetch(image, ivec3(ask(0).xyz), 3);",
                         {sampledBinding(makeView(work, image, {type}), sampler)}, q);
      answers[d].insert(answers[d].end(), small.begin(), small.end());
    }
    // Three levels rounded to bytes each, and filters with 8-bit weights.
    for (size_t i = 0; i < answers[0].size(); ++i)
      for (int c = 0; c < 4; ++c) ASSERT_NEAR(answers[0][i][c], answers[1][i][c], 6.0 / 255) << (volume ? "volume " : "array ") << i;
  }
}

PUMICE_ON_BOTH_DEVICES(Images);

}  // namespace
}  // namespace pumice::cts
