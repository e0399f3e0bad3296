// Extensions of images, views and samplers, and of what commands do with them, on devices that enable one of them alone.
#include "cts_subset/tests/one_extension.h"
#include "cts_subset/tests/probe.h"

namespace pumice::cts {
namespace {

constexpr VkShaderStageFlags kGraphics = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;
constexpr VkImageUsageFlags kCopies = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;

class ImageExtensionFeatures : public OneExtensionTest {
 protected:
  // Texel (x, y) of a slice, face or layer of floats.
  static float texel(uint32_t x, uint32_t y, uint32_t z) { return float(x + 10 * y + 100 * z + 1); }
  void fill(Workspace& work, const Image& image, uint32_t mip, uint32_t layer, float add) {
    VkExtent3D e{std::max(image.spec.extent.width >> mip, 1u), std::max(image.spec.extent.height >> mip, 1u), std::max(image.spec.extent.depth >> mip, 1u)};
    std::vector<float> v;
    for (uint32_t z = 0; z < e.depth; z++)
      for (uint32_t y = 0; y < e.height; y++)
        for (uint32_t x = 0; x < e.width; x++) v.push_back(texel(x, y, z + layer) + add);
    Piece piece;
    piece.mip = mip, piece.layer = layer, piece.extent = e;
    Bytes bytes(v.size() * 4);
    std::memcpy(bytes.data(), v.data(), bytes.size());
    upload(work, image, piece, bytes);
  }
};

// Slices of a three-dimensional image as images of two dimensions: sampled, read and written.
TEST_P(ImageExtensionFeatures, TwoDimensionalViewOf3D) {
  PUMICE_NEED_FEATURE(available(VK_EXT_IMAGE_2D_VIEW_OF_3D_EXTENSION_NAME));
  auto wanted = features<VkPhysicalDeviceImage2DViewOf3DFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_IMAGE_2D_VIEW_OF_3D_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.image2DViewOf3D && wanted.sampler2DViewOf3D);
  for (VkImageUsageFlags attachment : {0u, uint32_t(VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT)}) {
    Workspace work(open(VK_EXT_IMAGE_2D_VIEW_OF_3D_EXTENSION_NAME, &wanted));
    ImageSpec spec;
    spec.format = VK_FORMAT_R32_SFLOAT;
    spec.type = VK_IMAGE_TYPE_3D;
    spec.extent = {9, 6, 8};
    spec.mips = 2;
    spec.flags = VK_IMAGE_CREATE_2D_VIEW_COMPATIBLE_BIT_EXT;
    spec.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_STORAGE_BIT | kCopies | attachment;
    Image image = work.image(spec);
    toGeneral(work, image);
    for (uint32_t mip = 0; mip < 2; mip++) fill(work, image, mip, 0, 1000.0f * float(mip));
    VkSampler sampler = work.make(samplerInfo(VK_FILTER_LINEAR));
    for (uint32_t mip = 0; mip < 2; mip++)
      for (uint32_t slice : {0u, 1u, 3u}) {
        SCOPED_TRACE("level " + std::to_string(mip) + ", slice " + std::to_string(slice));
        ViewSpec one;
        one.mip = mip, one.mips = 1, one.layer = slice, one.layers = 1;
        VkImageView view = makeView(work, image, one);
        const uint32_t w = 9u >> mip, h = 6u >> mip;
        std::vector<glm::vec4> q;
        for (uint32_t i = 0; i < w * h; i++) q.push_back({i % w, i / w, w, h});
        auto a = probe(work, "layout(binding = 2) uniform sampler2D image; layout(binding = 3, r32f) uniform image2D texels;", R"(
  ivec2 p = ivec2(ask(0).xy);
  answer = vec4(texelFetch(image, p, 0).x, textureLod(image, (vec2(p) + vec2(1, 0.5)) / ask(0).zw, 0).x, imageLoad(texels, p).x, textureSize(image, 0).x * 100 + imageSize(texels).y);
  imageStore(texels, p, vec4(answer.x * 2));)",
                       {sampledBinding(view, sampler), storageBinding(view)}, q);
        for (uint32_t i = 0; i < w * h; i++) {
          const float here = texel(i % w, i / w, slice) + 1000.0f * float(mip), right = i % w + 1 < w ? here + 1 : here;
          EXPECT_EQ(a[i].x, here) << i;
          EXPECT_NEAR(a[i].y, (here + right) / 2, 0.01) << i;
          EXPECT_EQ(a[i].z, here) << i;
          EXPECT_EQ(a[i].w, float(w * 100 + h)) << i;
        }
      }
    // What was written lies in its slices, and nowhere else.
    for (uint32_t mip = 0; mip < 2; mip++) {
      std::vector<float> found = valuesOf<float>(wordsOf(download(work, image, mip, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4)));
      const uint32_t w = 9u >> mip, h = 6u >> mip;
      for (uint32_t z = 0; z < 8u >> mip; z++)
        for (uint32_t i = 0; i < w * h; i++)
          ASSERT_EQ(found[z * w * h + i], (texel(i % w, i / w, z) + 1000.0f * float(mip)) * (z == 0 || z == 1 || z == 3 ? 2 : 1)) << mip << ", slice " << z << ", " << i;
    }
  }
}

// Borders go through the view's mapping as texels do.
TEST_P(ImageExtensionFeatures, BorderColorSwizzle) {
  PUMICE_NEED_FEATURE(available(VK_EXT_BORDER_COLOR_SWIZZLE_EXTENSION_NAME) && available(VK_EXT_CUSTOM_BORDER_COLOR_EXTENSION_NAME));
  auto wanted = features<VkPhysicalDeviceBorderColorSwizzleFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BORDER_COLOR_SWIZZLE_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.borderColorSwizzle);
  auto custom = features<VkPhysicalDeviceCustomBorderColorFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_CUSTOM_BORDER_COLOR_FEATURES_EXT);
  PUMICE_NEED_FEATURE(custom.customBorderColors);
  custom.customBorderColorWithoutFormat = VK_FALSE;
  wanted.pNext = &custom;
  own = std::make_unique<Device>(device().physical, VkPhysicalDeviceFeatures{},
                                 std::vector<const char*>{VK_EXT_CUSTOM_BORDER_COLOR_EXTENSION_NAME, VK_EXT_BORDER_COLOR_SWIZZLE_EXTENSION_NAME}, &wanted);
  Workspace work(*own);
  ImageSpec spec;
  spec.format = VK_FORMAT_R8G8B8A8_UNORM;
  spec.extent = {2, 2, 1};
  spec.usage = VK_IMAGE_USAGE_SAMPLED_BIT | kCopies;
  Image image = work.image(spec);
  toGeneral(work, image);
  Piece piece;
  piece.extent = spec.extent;
  upload(work, image, piece, Bytes(16, 51));
  const VkComponentSwizzle R = VK_COMPONENT_SWIZZLE_R, G = VK_COMPONENT_SWIZZLE_G, B = VK_COMPONENT_SWIZZLE_B, A = VK_COMPONENT_SWIZZLE_A;
  const VkComponentMapping mappings[] = {{R, G, B, A}, {A, R, G, B}, {B, G, R, VK_COMPONENT_SWIZZLE_ONE}, {VK_COMPONENT_SWIZZLE_ZERO, A, A, R}};
  for (const VkComponentMapping& mapping : mappings)
    for (VkBorderColor border : {VK_BORDER_COLOR_FLOAT_TRANSPARENT_BLACK, VK_BORDER_COLOR_FLOAT_OPAQUE_BLACK, VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE, VK_BORDER_COLOR_FLOAT_CUSTOM_EXT}) {
      SCOPED_TRACE("mapping " + std::to_string(mapping.r) + std::to_string(mapping.g) + std::to_string(mapping.b) + std::to_string(mapping.a) + ", border " + std::to_string(border));
      VkImageViewCreateInfo info{};
      info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
      info.image = image.handle;
      info.viewType = VK_IMAGE_VIEW_TYPE_2D;
      info.format = spec.format;
      info.components = mapping;
      info.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
      VkImageView view = work.make(info);
      VkSamplerCreateInfo s = samplerInfo(VK_FILTER_NEAREST, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER);
      s.borderColor = border;
      VkSamplerBorderColorComponentMappingCreateInfoEXT told{VK_STRUCTURE_TYPE_SAMPLER_BORDER_COLOR_COMPONENT_MAPPING_CREATE_INFO_EXT, nullptr, mapping, VK_FALSE};
      VkSamplerCustomBorderColorCreateInfoEXT own4{VK_STRUCTURE_TYPE_SAMPLER_CUSTOM_BORDER_COLOR_CREATE_INFO_EXT, &told, {{0.2f, 0.4f, 0.6f, 0.8f}}, spec.format};
      s.pNext = border == VK_BORDER_COLOR_FLOAT_CUSTOM_EXT ? static_cast<const void*>(&own4) : &told;
      const glm::vec4 colors[] = {{0, 0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1, 1}, {0.2f, 0.4f, 0.6f, 0.8f}};
      const glm::vec4 color = colors[border == VK_BORDER_COLOR_FLOAT_CUSTOM_EXT ? 3 : border == VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE ? 2 : border == VK_BORDER_COLOR_FLOAT_OPAQUE_BLACK];
      auto pick = [&](VkComponentSwizzle c) {
        return c == VK_COMPONENT_SWIZZLE_ZERO ? 0.0f : c == VK_COMPONENT_SWIZZLE_ONE ? 1.0f : color[int(c) - int(R)];
      };
      auto a = probe(work, "layout(binding = 2) uniform sampler2D image;",
                     "answer = ask(0).z < 1 ? textureLod(image, ask(0).xy, 0) : vec4(textureGather(image, ask(0).xy, 0).x, textureGather(image, ask(0).xy, 1).x, "
                     "textureGather(image, ask(0).xy, 2).x, textureGather(image, ask(0).xy, 3).x);",
                     {sampledBinding(view, work.make(s))}, {{-1, 0.5f, 0, 0}, {-1, 0.5f, 1, 0}, {0.25f, 0.25f, 0, 0}});
      const glm::vec4 want(pick(mapping.r), pick(mapping.g), pick(mapping.b), pick(mapping.a));
      for (int c = 0; c < 4; c++) {
        EXPECT_NEAR(a[0][c], want[c], 1e-6) << "component " << c;
        EXPECT_NEAR(a[1][c], want[c], 1e-6) << "component " << c << " gathered";
      }
    }
}

// Faces of a cube that end at their edges, by the sampler's address modes.
TEST_P(ImageExtensionFeatures, NonSeamlessCube) {
  PUMICE_NEED_FEATURE(available(VK_EXT_NON_SEAMLESS_CUBE_MAP_EXTENSION_NAME));
  auto wanted = features<VkPhysicalDeviceNonSeamlessCubeMapFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_NON_SEAMLESS_CUBE_MAP_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.nonSeamlessCubeMap);
  Workspace work(open(VK_EXT_NON_SEAMLESS_CUBE_MAP_EXTENSION_NAME, &wanted));
  constexpr uint32_t kEdge = 4;
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_SFLOAT;
  spec.extent = {kEdge, kEdge, 1};
  spec.layers = 6;
  spec.flags = VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
  spec.usage = VK_IMAGE_USAGE_SAMPLED_BIT | kCopies;
  Image image = work.image(spec);
  toGeneral(work, image);
  for (uint32_t face = 0; face < 6; face++) fill(work, image, 0, face, 0);
  VkImageView cube = makeView(work, image, {VK_IMAGE_VIEW_TYPE_CUBE});
  // On face +Z: s runs with x, t against y.
  std::vector<glm::vec4> q;
  for (float s : {0.03f, 0.3f, 0.5f, 0.97f})
    for (float t : {0.02f, 0.4f, 0.99f}) q.push_back({s * 2 - 1, 1 - t * 2, 1, 0});
  for (VkSamplerAddressMode mode : {VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT}) {
    SCOPED_TRACE("address mode " + std::to_string(mode));
    // lavapipe 22 clamps, whatever the mode.
    if (GetParam() == Role::kPeer && mode != VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE) continue;
    VkSamplerCreateInfo info = samplerInfo(VK_FILTER_LINEAR, mode);
    info.borderColor = VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
    info.flags = VK_SAMPLER_CREATE_NON_SEAMLESS_CUBE_MAP_BIT_EXT;
    auto apart = probe(work, "layout(binding = 2) uniform samplerCube image;", "answer = vec4(textureLod(image, ask(0).xyz, 0).x, textureGather(image, ask(0).xyz).xyz);",
                       {sampledBinding(cube, work.make(info))}, q);
    info.flags = 0;
    auto together = probe(work, "layout(binding = 2) uniform samplerCube image;", "answer = vec4(textureLod(image, ask(0).xyz, 0).x, textureGather(image, ask(0).xyz).xyz);",
                          {sampledBinding(cube, work.make(info))}, q);
    auto at = [&](int x, int y) {
      auto wrap = [&](int i) {
        const int n = int(kEdge);
        if (mode == VK_SAMPLER_ADDRESS_MODE_REPEAT) return (i + n) % n;
        return std::clamp(i, 0, n - 1);   // one beyond the edge, mirrored, is the last
      };
      const bool outside = x < 0 || y < 0 || x >= int(kEdge) || y >= int(kEdge);
      return outside && mode == VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER ? 1.0f : texel(uint32_t(wrap(x)), uint32_t(wrap(y)), 4);
    };
    for (size_t i = 0; i < q.size(); i++) {
      const float u = (q[i].x + 1) / 2 * kEdge - 0.5f, v = (1 - q[i].y) / 2 * kEdge - 0.5f;
      const int x = int(std::floor(u)), y = int(std::floor(v));
      const float fx = u - float(x), fy = v - float(y);
      const float want = (at(x, y) * (1 - fx) + at(x + 1, y) * fx) * (1 - fy) + (at(x, y + 1) * (1 - fx) + at(x + 1, y + 1) * fx) * fy;
      EXPECT_NEAR(apart[i].x, want, 0.5) << i;   // weights may have 8 bits
      EXPECT_EQ(apart[i].y, at(x, y + 1)) << i;
      EXPECT_EQ(apart[i].z, at(x + 1, y + 1)) << i;
      EXPECT_EQ(apart[i].w, at(x + 1, y)) << i;
      const bool inner = x >= 0 && y >= 0 && x + 1 < int(kEdge) && y + 1 < int(kEdge);
      EXPECT_EQ(together[i] == apart[i], inner) << i;
    }
  }
}

// Depth images of one and of three dimensions, where there are any: copied, cleared, compared.
TEST_P(ImageExtensionFeatures, DepthOfOtherDimensions) {
  for (VkImageType type : {VK_IMAGE_TYPE_1D, VK_IMAGE_TYPE_3D}) {
    SCOPED_TRACE(type == VK_IMAGE_TYPE_1D ? "1D" : "3D");
    const VkExtent3D extent = type == VK_IMAGE_TYPE_1D ? VkExtent3D{9, 1, 1} : VkExtent3D{9, 5, 3};
    Workspace work(device());
    ImageSpec spec;
    spec.format = VK_FORMAT_D32_SFLOAT;
    spec.type = type;
    spec.extent = extent;
    spec.mips = 2;
    spec.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | kCopies;
    VkImageFormatProperties p{};
    if (vkGetPhysicalDeviceImageFormatProperties(device().physical, spec.format, type, spec.tiling, spec.usage, 0, &p) != VK_SUCCESS) {
      EXPECT_NE(GetParam(), Role::kTested);
      continue;
    }
    Image image = work.image(spec);
    toGeneral(work, image);
    work.device.run([&](VkCommandBuffer c) {
      VkClearDepthStencilValue value{0.25f, 0};
      VkImageSubresourceRange second{VK_IMAGE_ASPECT_DEPTH_BIT, 1, 1, 0, 1};
      vkCmdClearDepthStencilImage(c, image.handle, VK_IMAGE_LAYOUT_GENERAL, &value, 1, &second);
    });
    std::vector<float> values;
    const uint32_t count = extent.width * extent.height * extent.depth;
    for (uint32_t i = 0; i < count; i++) values.push_back(float(i) / float(count));
    Bytes bytes(count * 4);
    std::memcpy(bytes.data(), values.data(), bytes.size());
    Piece piece;
    piece.extent = extent;
    upload(work, image, piece, bytes, VK_IMAGE_ASPECT_DEPTH_BIT);
    EXPECT_EQ(firstDifference(download(work, image, 0, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4), bytes), "");
    for (float v : valuesOf<float>(wordsOf(download(work, image, 1, 0, VK_IMAGE_ASPECT_DEPTH_BIT, 4)))) EXPECT_EQ(v, 0.25f);
    std::vector<glm::vec4> q;
    for (uint32_t i = 0; i < count; i++) q.push_back({i % 9, i / 9 % 5, i / 45, 0});
    VkSamplerCreateInfo info = samplerInfo();
    info.compareEnable = type == VK_IMAGE_TYPE_1D;
    info.compareOp = VK_COMPARE_OP_LESS;
    auto a = probe(work, type == VK_IMAGE_TYPE_1D ? "layout(binding = 2) uniform sampler1DShadow image;" : "layout(binding = 2) uniform sampler3D image;",
                   type == VK_IMAGE_TYPE_1D ? "answer.x = textureLod(image, vec3((ask(0).x + 0.5) / 9, 0, 0.5), 0);" : "answer.x = texelFetch(image, ivec3(ask(0).xyz), 0).x;",
                   {sampledBinding(makeView(work, image, {type == VK_IMAGE_TYPE_1D ? VK_IMAGE_VIEW_TYPE_1D : VK_IMAGE_VIEW_TYPE_3D}), work.make(info))}, q);
    for (uint32_t i = 0; i < count; i++) EXPECT_EQ(a[i].x, type == VK_IMAGE_TYPE_1D ? float(0.5f < values[i]) : values[i]) << i;
  }
}

class CommandExtensionFeatures : public ImageExtensionFeatures {
 protected:
  static constexpr VkExtent2D kSize{8, 8};
};

// Draws, clears and dispatches depend on a word in a buffer; copies do not.
TEST_P(CommandExtensionFeatures, ConditionalRendering) {
  PUMICE_NEED_FEATURE(available(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME) && device().vulkan13.dynamicRendering);
  auto wanted = features<VkPhysicalDeviceConditionalRenderingFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_CONDITIONAL_RENDERING_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.conditionalRendering && wanted.inheritedConditionalRendering);
  VkPhysicalDeviceVulkan13Features core{};
  core.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
  core.dynamicRendering = VK_TRUE;
  core.pNext = &wanted;
  Workspace work(open(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME, &core));
  VkDevice d = work.device.handle;
  auto begin = reinterpret_cast<PFN_vkCmdBeginConditionalRenderingEXT>(vkGetDeviceProcAddr(d, "vkCmdBeginConditionalRenderingEXT"));
  auto end = reinterpret_cast<PFN_vkCmdEndConditionalRenderingEXT>(vkGetDeviceProcAddr(d, "vkCmdEndConditionalRenderingEXT"));
  ASSERT_TRUE(begin && end);
  // Words: 0, 1 and one that only its upper half makes true; the fourth is written by the device, from 0 to 5.
  Buffer predicates = work.bufferOf(Words{0, 1, 0x40000000, 0}, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  Buffer counters = work.bufferOf(Words(16, 0), kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  Buffer indirect = work.bufferOf(Words{3, 1, 0, 0, 1, 1, 1}, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  VkPipelineLayout layout = makePipelineLayout(work, {}, 16, kGraphics);
  GraphicsSpec spec;
  spec.fragment = kGivenFragment;
  spec.colors = {VK_FORMAT_R32_UINT};
  VkPipeline pipeline = makeGraphics(work, layout, spec);
  DescriptorSet set = work.descriptors({bufferBinding(counters)});
  VkPipelineLayout computeLayout = makePipelineLayout(work, {set.layout}, 4);
  VkPipeline compute = makeCompute(work, work.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 450
layout(push_constant) uniform P { uint slot; };
layout(binding = 0) buffer B { uint r[]; };
void main() { atomicAdd(r[slot], 1); })"), computeLayout);
  ImageSpec imageSpec;
  imageSpec.format = VK_FORMAT_R32_UINT;
  imageSpec.extent = {kSize.width, kSize.height, 1};
  imageSpec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | kCopies;
  Image image = work.image(imageSpec);
  toGeneral(work, image);
  VkImageView view = work.view(image);

  struct Condition {
    uint32_t word;
    bool inverted;
    bool value;
  };
  const Condition conditions[8] = {{0, false, false}, {1, false, true}, {2, false, true}, {3, false, true},
                                   {0, true, true},   {1, true, false}, {2, true, false}, {3, true, false}};
  auto beginInfo = [&](const Condition& c) {
    return VkConditionalRenderingBeginInfoEXT{VK_STRUCTURE_TYPE_CONDITIONAL_RENDERING_BEGIN_INFO_EXT, nullptr, predicates.handle, c.word * 4,
                                              c.inverted ? VkConditionalRenderingFlagsEXT(VK_CONDITIONAL_RENDERING_INVERTED_BIT_EXT) : 0u};
  };
  // A secondary command buffer that draws into the last row; whether it does is the primary's condition.
  VkCommandPool pool = work.make(VkCommandPoolCreateInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, work.device.family});
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, VK_COMMAND_BUFFER_LEVEL_SECONDARY, 1};
  VkCommandBuffer secondary;
  check(vkAllocateCommandBuffers(d, &allocate, &secondary), "vkAllocateCommandBuffers");
  VkCommandBufferInheritanceConditionalRenderingInfoEXT inherits{VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_CONDITIONAL_RENDERING_INFO_EXT, nullptr, VK_TRUE};
  VkCommandBufferInheritanceInfo inheritance{};
  inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
  inheritance.pNext = &inherits;
  VkCommandBufferBeginInfo beginSecondary{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT, &inheritance};
  check(vkBeginCommandBuffer(secondary, &beginSecondary), "vkBeginCommandBuffer");
  vkCmdBindPipeline(secondary, VK_PIPELINE_BIND_POINT_COMPUTE, compute);
  vkCmdBindDescriptorSets(secondary, VK_PIPELINE_BIND_POINT_COMPUTE, computeLayout, 0, 1, &set.handle, 0, nullptr);
  const uint32_t last = 15;
  vkCmdPushConstants(secondary, computeLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &last);
  vkCmdDispatch(secondary, 1, 1, 1);
  check(vkEndCommandBuffer(secondary), "vkEndCommandBuffer");

  work.device.run([&](VkCommandBuffer c) {
    vkCmdFillBuffer(c, predicates.handle, 12, 4, 5);
    fullBarrier(c);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, compute);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, computeLayout, 0, 1, &set.handle, 0, nullptr);
    for (uint32_t i = 0; i < 8; i++) {
      auto info = beginInfo(conditions[i]);
      begin(c, &info);
      vkCmdPushConstants(c, computeLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &i);
      vkCmdDispatch(c, 1, 1, 1);
      vkCmdDispatchIndirect(c, indirect.handle, 16);
      vkCmdExecuteCommands(c, 1, &secondary);
      vkCmdFillBuffer(c, counters.handle, 32 + 4 * (i % 4), 4, 77);   // not a matter of the condition
      end(c);
      vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, compute);
      vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, computeLayout, 0, 1, &set.handle, 0, nullptr);
      fullBarrier(c);
    }
    VkClearValue clear{};
    std::vector<VkRenderingAttachmentInfo> attachments = {rendered(view, VK_ATTACHMENT_LOAD_OP_CLEAR, clear)};
    VkRenderingInfo info = renderingInfo(kSize, attachments);
    vkCmdBeginRendering(c, &info);
    wholeTarget(c, kSize);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    float given[4] = {9, 0, 0, 0.5f};
    vkCmdPushConstants(c, layout, kGraphics, 0, sizeof given, given);
    for (uint32_t i = 0; i < 8; i++) {
      auto condition = beginInfo(conditions[i]);
      begin(c, &condition);
      VkRect2D left{{int32_t(i), 0}, {1, 2}}, right{{int32_t(i), 2}, {1, 2}};
      vkCmdSetScissor(c, 0, 1, &left);
      vkCmdDraw(c, 3, 1, 0, 0);
      vkCmdSetScissor(c, 0, 1, &right);
      vkCmdDrawIndirect(c, indirect.handle, 0, 1, 16);
      VkClearAttachment six{VK_IMAGE_ASPECT_COLOR_BIT, 0, {}};
      six.clearValue.color.uint32[0] = 6;
      VkClearRect rect{{{int32_t(i), 4}, {1, 2}}, 0, 1};
      vkCmdClearAttachments(c, 1, &six, 1, &rect);
      end(c);
      VkRect2D always{{int32_t(i), 7}, {1, 1}};
      vkCmdSetScissor(c, 0, 1, &always);
      vkCmdDraw(c, 3, 1, 0, 0);
    }
    vkCmdEndRendering(c);
    fullBarrier(c);
  });
  Words counted(16);
  std::memcpy(counted.data(), counters.mapped, 64);
  Words found = wordsOf(download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4));
  for (uint32_t i = 0; i < 8; i++) {
    const bool value = conditions[i].value;
    EXPECT_EQ(counted[i], value ? 2u : 0u) << "dispatches of condition " << i;
    EXPECT_EQ(found[0 * 8 + i], value ? 9u : 0u) << "draw of condition " << i;
    EXPECT_EQ(found[3 * 8 + i], value ? 9u : 0u) << "indirect draw of condition " << i;
    EXPECT_EQ(found[5 * 8 + i], value ? 6u : 0u) << "clear of condition " << i;
    EXPECT_EQ(found[7 * 8 + i], 9u) << "draw behind condition " << i;
  }
  EXPECT_EQ(counted[15], 4u) << "dispatches of the secondary command buffer";
  for (uint32_t i = 8; i < 12; i++) EXPECT_EQ(counted[i], 77u);
}

// A draw that reads what earlier draws of the same pass wrote, anywhere, and writes elsewhere.
TEST_P(CommandExtensionFeatures, FeedbackLoop) {
  PUMICE_NEED_FEATURE(available(VK_EXT_ATTACHMENT_FEEDBACK_LOOP_LAYOUT_EXTENSION_NAME));
  auto wanted = features<VkPhysicalDeviceAttachmentFeedbackLoopLayoutFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ATTACHMENT_FEEDBACK_LOOP_LAYOUT_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.attachmentFeedbackLoopLayout);
  Workspace work(open(VK_EXT_ATTACHMENT_FEEDBACK_LOOP_LAYOUT_EXTENSION_NAME, &wanted));
  constexpr uint32_t kWide = 200;   // several tiles
  const VkExtent2D extent{kWide, 8};
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {extent.width, extent.height, 1};
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_ATTACHMENT_FEEDBACK_LOOP_BIT_EXT | kCopies;
  Image image = work.image(spec);
  work.device.run([&](VkCommandBuffer c) { transition(c, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT); });
  VkImageView view = work.view(image);
  VkAttachmentDescription2 kept = attachmentOf(spec.format);
  kept.initialLayout = kept.finalLayout = VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT;
  VkAttachmentReference2 reference{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2, nullptr, 0, VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT, VK_IMAGE_ASPECT_COLOR_BIT};
  VkSubpassDependency2 itself{};
  itself.sType = VK_STRUCTURE_TYPE_SUBPASS_DEPENDENCY_2;
  itself.srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  itself.dstStageMask = VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT;
  itself.srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  itself.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  itself.dependencyFlags = VK_DEPENDENCY_BY_REGION_BIT | VK_DEPENDENCY_FEEDBACK_LOOP_BIT_EXT;
  GraphicsSpec graphics;
  graphics.pass = makePass(work, {kept}, {subpass(&reference)}, {itself});
  graphics.colorCount = 1;
  DescriptorSet set = work.descriptors({sampledBinding(view, work.make(samplerInfo()), VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT)});
  VkPipelineLayout layout = makePipelineLayout(work, {set.layout}, 16, kGraphics);
  graphics.fragment = R"(#version 460
layout(location = 0) out uint color;
void main() { color = uint(gl_FragCoord.x) + 1000; })";
  VkPipeline plain = makeGraphics(work, layout, graphics);
  // Reads its own pixel, and one far away that this draw does not write.
  graphics.fragment = R"(#version 460
layout(binding = 0) uniform usampler2D image;
layout(push_constant) uniform P { vec4 given; };
layout(location = 0) out uint color;
void main() {
  ivec2 p = ivec2(gl_FragCoord.xy);
  color = texelFetch(image, p, 0).x * 100000 + texelFetch(image, ivec2(199 - p.x, p.y), 0).x + uint(given.x);
})";
  graphics.flags = VK_PIPELINE_CREATE_COLOR_ATTACHMENT_FEEDBACK_LOOP_BIT_EXT;
  VkPipeline loop = makeGraphics(work, layout, graphics);
  VkFramebuffer target = work.framebufferOf(graphics.pass, {view}, extent);
  work.device.run([&](VkCommandBuffer c) {
    VkClearValue clear{};
    clear.color.uint32[0] = 3;
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, graphics.pass, target, {{0, 0}, extent}, 1, &clear};
    vkCmdBeginRenderPass(c, &begin, VK_SUBPASS_CONTENTS_INLINE);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set.handle, 0, nullptr);
    auto draw = [&](VkPipeline pipeline, uint32_t x, uint32_t width, float add) {
      vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
      wholeTarget(c, extent);
      VkRect2D scissor{{int32_t(x), 0}, {width, 8}};
      vkCmdSetScissor(c, 0, 1, &scissor);
      float given[4] = {add, 0, 0, 0.5f};
      vkCmdPushConstants(c, layout, kGraphics, 0, sizeof given, given);
      vkCmdDraw(c, 3, 1, 0, 0);
      VkImageMemoryBarrier barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER, nullptr, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT, VK_ACCESS_SHADER_READ_BIT,
                                   VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT, VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT,
                                   VK_QUEUE_FAMILY_IGNORED, VK_QUEUE_FAMILY_IGNORED, image.handle, {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1}};
      vkCmdPipelineBarrier(c, VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, itself.dependencyFlags, 0, nullptr, 0, nullptr, 1, &barrier);
    };
    draw(plain, 150, 50, 0);
    draw(loop, 0, 20, 1);      // what is far away was drawn, its own is the clear value
    draw(loop, 60, 20, 2);     // both are clear values
    draw(loop, 185, 15, 3);    // what is far away has been written by a loop
    vkCmdEndRenderPass(c);
  });
  work.device.run([&](VkCommandBuffer c) { transition(c, image, VK_IMAGE_LAYOUT_ATTACHMENT_FEEDBACK_LOOP_OPTIMAL_EXT, VK_IMAGE_LAYOUT_GENERAL); });
  Words found = wordsOf(download(work, image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4));
  std::vector<uint32_t> want(kWide, 3);
  for (uint32_t x = 150; x < 200; x++) want[x] = x + 1000;
  auto loopOver = [&](uint32_t first, uint32_t count, uint32_t add) {
    for (uint32_t x = first; x < first + count; x++) want[x] = want[x] * 100000 + want[199 - x] + add;
  };
  loopOver(0, 20, 1), loopOver(60, 20, 2), loopOver(185, 15, 3);
  for (uint32_t x = 0; x < kWide; x++) EXPECT_EQ(found[3 * kWide + x], want[x]) << "column " << x;
}

// Input attachments that later fragments of the same draw read, in order, without a barrier: each adds to what is there.
TEST_P(CommandExtensionFeatures, RasterizationOrderAccess) {
  PUMICE_NEED_FEATURE(available(VK_EXT_RASTERIZATION_ORDER_ATTACHMENT_ACCESS_EXTENSION_NAME));
  using Found = VkPhysicalDeviceRasterizationOrderAttachmentAccessFeaturesEXT;
  auto wanted = features<Found>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RASTERIZATION_ORDER_ATTACHMENT_ACCESS_FEATURES_EXT);
  PUMICE_NEED_FEATURE(wanted.rasterizationOrderColorAttachmentAccess && wanted.rasterizationOrderDepthAttachmentAccess);
  if (GetParam() == Role::kTested) {
    EXPECT_TRUE(wanted.rasterizationOrderStencilAttachmentAccess);
  }
  Workspace work(open(VK_EXT_RASTERIZATION_ORDER_ATTACHMENT_ACCESS_EXTENSION_NAME, &wanted));
  const VkExtent2D extent{70, 9};
  ImageSpec spec;
  spec.format = VK_FORMAT_R32_UINT;
  spec.extent = {extent.width, extent.height, 1};
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT | kCopies;
  Image color = work.image(spec);
  spec.format = VK_FORMAT_D32_SFLOAT;
  spec.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT | kCopies;
  Image depth = work.image(spec);
  toGeneral(work, color);
  toGeneral(work, depth);
  VkImageView colorView = work.view(color), depthView = work.view(depth);
  VkAttachmentReference2 colorReference = referenceTo(0, VK_IMAGE_ASPECT_COLOR_BIT), depthReference = referenceTo(1, VK_IMAGE_ASPECT_DEPTH_BIT);
  const VkAttachmentReference2 inputs[2] = {colorReference, depthReference};
  VkSubpassDescription2 only = subpass(&colorReference, &depthReference);
  only.inputAttachmentCount = 2;
  only.pInputAttachments = inputs;
  only.flags = VK_SUBPASS_DESCRIPTION_RASTERIZATION_ORDER_ATTACHMENT_COLOR_ACCESS_BIT_EXT | VK_SUBPASS_DESCRIPTION_RASTERIZATION_ORDER_ATTACHMENT_DEPTH_ACCESS_BIT_EXT;
  GraphicsSpec graphics;
  graphics.pass = makePass(work, {attachmentOf(VK_FORMAT_R32_UINT), attachmentOf(VK_FORMAT_D32_SFLOAT)}, {only});
  graphics.colorCount = 1;
  graphics.depthTest = true;
  graphics.blendFlags = VK_PIPELINE_COLOR_BLEND_STATE_CREATE_RASTERIZATION_ORDER_ATTACHMENT_ACCESS_BIT_EXT;
  graphics.depthFlags = VK_PIPELINE_DEPTH_STENCIL_STATE_CREATE_RASTERIZATION_ORDER_ATTACHMENT_DEPTH_ACCESS_BIT_EXT;
  // Twelve triangles over everything in one draw, each nearer than the one before.
  graphics.vertex = R"(#version 460
layout(location = 0) flat out uint number;
void main() {
  int v = gl_VertexIndex % 3;
  number = gl_VertexIndex / 3;
  gl_Position = vec4(vec2((v << 1) & 2, v & 2) * 2 - 1, 1 - (number + 1) / 16.0, 1);
})";
  graphics.fragment = R"(#version 460
layout(input_attachment_index = 0, binding = 0) uniform usubpassInput before;
layout(input_attachment_index = 1, binding = 1) uniform subpassInput depthBefore;
layout(location = 0) flat in uint number;
layout(location = 0) out uint color;
void main() {
  color = subpassLoad(before).x * 3 + number + (subpassLoad(depthBefore).x * 16 == (number == 0 ? 16 : 16 - number) ? 0 : 1000000);
})";
  Binding first = inputBinding(colorView), second = inputBinding(depthView);
  VkDescriptorSetLayoutBinding bindings[2] = {{0, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr},
                                              {1, VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr}};
  VkDescriptorSetLayout setLayout = makeSetLayout(work, {bindings[0], bindings[1]});
  VkDescriptorSet set = makeSet(work, makePool(work, {{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT, 2}}), setLayout);
  VkWriteDescriptorSet writes[2]{};
  for (uint32_t i = 0; i < 2; i++) {
    writes[i].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    writes[i].dstSet = set;
    writes[i].dstBinding = i;
    writes[i].descriptorCount = 1;
    writes[i].descriptorType = VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT;
    writes[i].pImageInfo = i ? &second.image : &first.image;
  }
  vkUpdateDescriptorSets(work.device.handle, 2, writes, 0, nullptr);
  VkPipelineLayout layout = makePipelineLayout(work, {setLayout});
  VkPipeline pipeline = makeGraphics(work, layout, graphics);
  VkFramebuffer target = work.framebufferOf(graphics.pass, {colorView, depthView}, extent);
  work.device.run([&](VkCommandBuffer c) {
    VkClearValue clears[2]{};
    clears[0].color.uint32[0] = 1;
    clears[1].depthStencil.depth = 1;
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO, nullptr, graphics.pass, target, {{0, 0}, extent}, 2, clears};
    vkCmdBeginRenderPass(c, &begin, VK_SUBPASS_CONTENTS_INLINE);
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set, 0, nullptr);
    wholeTarget(c, extent);
    vkCmdDraw(c, 36, 1, 0, 0);
    vkCmdEndRenderPass(c);
    fullBarrier(c);
  });
  uint32_t want = 1;
  for (uint32_t i = 0; i < 12; i++) want = want * 3 + i;
  Words found = wordsOf(download(work, color, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, 4));
  size_t wrong = 0;
  for (size_t i = 0; i < found.size(); i++)
    if (found[i] != want && ++wrong <= 5) ADD_FAILURE() << "pixel " << i << " is " << found[i] << ", expected " << want;
}

PUMICE_ON_BOTH_DEVICES(ImageExtensionFeatures);
PUMICE_ON_BOTH_DEVICES(CommandExtensionFeatures);

}  // namespace
}  // namespace pumice::cts
