// Multi-planar images and sampler Y'CbCr conversion, against the specification's formulas in double precision
// ("Sampler Y'CbCr Conversion", "Chroma Reconstruction").
#include "cts_subset/tests/compute.h"

#include <cmath>

namespace pumice::cts {
namespace {

struct PlanarFormat {
  VkFormat format;
  const char* name;
  uint32_t planes, bits, shiftX, shiftY;
  uint32_t componentBytes() const { return bits > 8 ? 2 : 1; }
  uint32_t components(uint32_t plane) const { return plane && planes == 2 ? 2 : 1; }
};
#define PUMICE_420(bits, name3, name2) {VK_FORMAT_##name3, #name3, 3, bits, 1, 1}, {VK_FORMAT_##name2, #name2, 2, bits, 1, 1}
#define PUMICE_422(bits, name3, name2) {VK_FORMAT_##name3, #name3, 3, bits, 1, 0}, {VK_FORMAT_##name2, #name2, 2, bits, 1, 0}
#define PUMICE_444(bits, name3, name2) {VK_FORMAT_##name3, #name3, 3, bits, 0, 0}, {VK_FORMAT_##name2, #name2, 2, bits, 0, 0}
const PlanarFormat kFormats[] = {
    PUMICE_420(8, G8_B8_R8_3PLANE_420_UNORM, G8_B8R8_2PLANE_420_UNORM),
    PUMICE_422(8, G8_B8_R8_3PLANE_422_UNORM, G8_B8R8_2PLANE_422_UNORM),
    PUMICE_444(8, G8_B8_R8_3PLANE_444_UNORM, G8_B8R8_2PLANE_444_UNORM),
    PUMICE_420(10, G10X6_B10X6_R10X6_3PLANE_420_UNORM_3PACK16, G10X6_B10X6R10X6_2PLANE_420_UNORM_3PACK16),
    PUMICE_422(10, G10X6_B10X6_R10X6_3PLANE_422_UNORM_3PACK16, G10X6_B10X6R10X6_2PLANE_422_UNORM_3PACK16),
    PUMICE_444(10, G10X6_B10X6_R10X6_3PLANE_444_UNORM_3PACK16, G10X6_B10X6R10X6_2PLANE_444_UNORM_3PACK16),
    PUMICE_420(12, G12X4_B12X4_R12X4_3PLANE_420_UNORM_3PACK16, G12X4_B12X4R12X4_2PLANE_420_UNORM_3PACK16),
    PUMICE_422(12, G12X4_B12X4_R12X4_3PLANE_422_UNORM_3PACK16, G12X4_B12X4R12X4_2PLANE_422_UNORM_3PACK16),
    PUMICE_444(12, G12X4_B12X4_R12X4_3PLANE_444_UNORM_3PACK16, G12X4_B12X4R12X4_2PLANE_444_UNORM_3PACK16),
    PUMICE_420(16, G16_B16_R16_3PLANE_420_UNORM, G16_B16R16_2PLANE_420_UNORM),
    PUMICE_422(16, G16_B16_R16_3PLANE_422_UNORM, G16_B16R16_2PLANE_422_UNORM),
    PUMICE_444(16, G16_B16_R16_3PLANE_444_UNORM, G16_B16R16_2PLANE_444_UNORM),
};

constexpr VkExtent3D kExtent{24, 16, 1};
VkExtent3D planeExtent(const PlanarFormat& f, uint32_t plane) {
  return plane ? VkExtent3D{kExtent.width >> f.shiftX, kExtent.height >> f.shiftY, 1} : kExtent;
}
VkImageAspectFlags planeAspect(uint32_t plane) { return VK_IMAGE_ASPECT_PLANE_0_BIT << plane; }

// What the planes hold, tightly packed; the bits below 10- and 12-bit components are noise that must not matter.
std::vector<Bytes> planesOf(const PlanarFormat& f) {
  std::vector<Bytes> out;
  for (uint32_t p = 0; p < f.planes; p++) {
    VkExtent3D e = planeExtent(f, p);
    out.push_back(noise(size_t(e.width) * e.height * f.components(p) * f.componentBytes(), 7 * p + f.bits));
  }
  return out;
}

struct Conversion {
  VkSamplerYcbcrModelConversion model = VK_SAMPLER_YCBCR_MODEL_CONVERSION_RGB_IDENTITY;
  VkSamplerYcbcrRange range = VK_SAMPLER_YCBCR_RANGE_ITU_FULL;
  VkChromaLocation x = VK_CHROMA_LOCATION_MIDPOINT, y = VK_CHROMA_LOCATION_MIDPOINT;
  VkFilter luma = VK_FILTER_NEAREST, chroma = VK_FILTER_NEAREST;
  bool swapped = false;   // R and B
};

// --- the specification in double

double texel(const PlanarFormat& f, const std::vector<Bytes>& planes, uint32_t plane, uint32_t component, int x, int y) {
  VkExtent3D e = planeExtent(f, plane);
  x = std::clamp(x, 0, int(e.width) - 1);
  y = std::clamp(y, 0, int(e.height) - 1);
  size_t at = (size_t(y) * e.width + size_t(x)) * f.components(plane) + component;
  uint32_t code = planes[plane][at * f.componentBytes()];
  if (f.bits > 8) code = (code | uint32_t(planes[plane][at * 2 + 1]) << 8) >> (16 - f.bits);
  return double(code) / (std::exp2(f.bits) - 1);
}

double samplePlane(const PlanarFormat& f, const std::vector<Bytes>& planes, uint32_t plane, uint32_t component, const Conversion& c, double s, double t) {
  VkExtent3D e = planeExtent(f, plane);
  double u = s * e.width, v = t * e.height;
  if ((plane ? c.chroma : c.luma) == VK_FILTER_NEAREST) return texel(f, planes, plane, component, int(std::floor(u)), int(std::floor(v)));
  // Cosited: u = 0.5 * (u of luma + 0.5).
  if (plane && f.shiftX && c.x == VK_CHROMA_LOCATION_COSITED_EVEN) u += 0.25;
  if (plane && f.shiftY && c.y == VK_CHROMA_LOCATION_COSITED_EVEN) v += 0.25;
  int i = int(std::floor(u - 0.5)), j = int(std::floor(v - 0.5));
  double a = u - 0.5 - i, b = v - 0.5 - j;
  auto at = [&](int dx, int dy) { return texel(f, planes, plane, component, i + dx, j + dy); };
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

std::array<double, 3> reference(const PlanarFormat& f, const std::vector<Bytes>& planes, const Conversion& c, double s, double t) {
  double g = samplePlane(f, planes, 0, 0, c, s, t), b = samplePlane(f, planes, 1, 0, c, s, t);
  double r = f.planes == 3 ? samplePlane(f, planes, 2, 0, c, s, t) : samplePlane(f, planes, 1, 1, c, s, t);
  if (c.swapped) std::swap(r, b);
  if (c.model == VK_SAMPLER_YCBCR_MODEL_CONVERSION_RGB_IDENTITY) return {r, g, b};
  const double most = std::exp2(f.bits) - 1, unit = std::exp2(f.bits - 8.0);
  double y, cb, cr;
  if (c.range == VK_SAMPLER_YCBCR_RANGE_ITU_NARROW) {
    y = (g * most - 16 * unit) / (219 * unit);
    cb = (b * most - 128 * unit) / (224 * unit);
    cr = (r * most - 128 * unit) / (224 * unit);
  } else {
    y = g;
    cb = b - std::exp2(f.bits - 1.0) / most;
    cr = r - std::exp2(f.bits - 1.0) / most;
  }
  switch (c.model) {
    case VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_709: return {y + 1.5748 * cr, y - 0.13397432 / 0.7152 * cb - 0.33480248 / 0.7152 * cr, y + 1.8556 * cb};
    case VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_601: return {y + 1.402 * cr, y - 0.202008 / 0.587 * cb - 0.419198 / 0.587 * cr, y + 1.772 * cb};
    case VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_2020: return {y + 1.4746 * cr, y - 0.11156702 / 0.6780 * cb - 0.38737742 / 0.6780 * cr, y + 1.8814 * cb};
    default: return {cr, y, cb};
  }
}

enum class Memory { kOptimal, kLinear, kDisjoint };

class YcbcrFeatures : public OnDevice {
 protected:
  void SetUp() override {
    OnDevice::SetUp();
    if (HasFatalFailure() || IsSkipped()) return;
    if (!device().vulkan11.samplerYcbcrConversion) GTEST_SKIP() << device().name() << " has no conversions";
    work = std::make_unique<Workspace>(device());
  }
  void TearDown() override { work.reset(); }

  VkFormatFeatureFlags formatFeatures(VkFormat format, Memory memory) {
    VkFormatProperties p{};
    vkGetPhysicalDeviceFormatProperties(device().physical, format, &p);
    VkFormatFeatureFlags f = memory == Memory::kLinear ? p.linearTilingFeatures : p.optimalTilingFeatures;
    return memory == Memory::kDisjoint && !(f & VK_FORMAT_FEATURE_DISJOINT_BIT) ? 0 : f;
  }

  // An image with memory of its own, of all planes together or of each.
  struct Planar {
    VkImage handle = VK_NULL_HANDLE;
    uint8_t* mapped = nullptr;
  };
  Planar make(const PlanarFormat& f, Memory memory) {
    VkDevice d = device().handle;
    VkImageCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    info.flags = VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT | (memory == Memory::kDisjoint ? VK_IMAGE_CREATE_DISJOINT_BIT : 0);
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = f.format;
    info.extent = kExtent;
    info.mipLevels = info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.tiling = memory == Memory::kLinear ? VK_IMAGE_TILING_LINEAR : VK_IMAGE_TILING_OPTIMAL;
    info.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    info.initialLayout = memory == Memory::kLinear ? VK_IMAGE_LAYOUT_PREINITIALIZED : VK_IMAGE_LAYOUT_UNDEFINED;
    VkImageFormatProperties limits{};
    EXPECT_EQ(vkGetPhysicalDeviceImageFormatProperties(device().physical, f.format, info.imageType, info.tiling, info.usage, info.flags, &limits), VK_SUCCESS);
    Planar out;
    check(vkCreateImage(d, &info, nullptr, &out.handle), "vkCreateImage");
    work->onDestroy([d, i = out.handle] { vkDestroyImage(d, i, nullptr); });
    // The last plane first: planes may lie anywhere.
    std::vector<VkBindImagePlaneMemoryInfo> planes(f.planes);
    std::vector<VkBindImageMemoryInfo> binds;
    for (uint32_t n = memory == Memory::kDisjoint ? f.planes : 1; n--;) {
      VkImagePlaneMemoryRequirementsInfo which{VK_STRUCTURE_TYPE_IMAGE_PLANE_MEMORY_REQUIREMENTS_INFO, nullptr, VkImageAspectFlagBits(planeAspect(n))};
      VkImageMemoryRequirementsInfo2 ask{VK_STRUCTURE_TYPE_IMAGE_MEMORY_REQUIREMENTS_INFO_2, memory == Memory::kDisjoint ? &which : nullptr, out.handle};
      VkMemoryRequirements2 needs{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2, nullptr, {}};
      vkGetImageMemoryRequirements2(d, &ask, &needs);
      const VkDeviceSize offset = memory == Memory::kDisjoint ? needs.memoryRequirements.alignment * 4 : 0;
      VkMemoryAllocateInfo allocate{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, needs.memoryRequirements.size + offset,
                                    device().memoryType(needs.memoryRequirements.memoryTypeBits, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT)};
      VkDeviceMemory bytes = VK_NULL_HANDLE;
      check(vkAllocateMemory(d, &allocate, nullptr, &bytes), "vkAllocateMemory");
      work->onDestroy([d, bytes] { vkFreeMemory(d, bytes, nullptr); });
      if (memory == Memory::kLinear) check(vkMapMemory(d, bytes, 0, VK_WHOLE_SIZE, 0, reinterpret_cast<void**>(&out.mapped)), "vkMapMemory");
      planes[n] = {VK_STRUCTURE_TYPE_BIND_IMAGE_PLANE_MEMORY_INFO, nullptr, VkImageAspectFlagBits(planeAspect(n))};
      binds.push_back({VK_STRUCTURE_TYPE_BIND_IMAGE_MEMORY_INFO, memory == Memory::kDisjoint ? &planes[n] : nullptr, out.handle, bytes, offset});
    }
    check(vkBindImageMemory2(d, uint32_t(binds.size()), binds.data()), "vkBindImageMemory2");
    if (memory == Memory::kLinear) return out;
    return toGeneral(out, VK_IMAGE_LAYOUT_UNDEFINED);
  }
  Planar toGeneral(const Planar& image, VkImageLayout from) {
    VkImageMemoryBarrier barrier{};
    barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
    barrier.srcAccessMask = VK_ACCESS_HOST_WRITE_BIT;
    barrier.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
    barrier.oldLayout = from;
    barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image.handle;
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    device().run([&](VkCommandBuffer c) {
      vkCmdPipelineBarrier(c, VK_PIPELINE_STAGE_HOST_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0, nullptr, 0, nullptr, 1, &barrier);
    });
    return image;
  }

  void fill(const PlanarFormat& f, Planar& image, const std::vector<Bytes>& planes, Memory memory) {
    for (uint32_t p = 0; p < f.planes; p++) {
      VkExtent3D e = planeExtent(f, p);
      const uint32_t row = e.width * f.components(p) * f.componentBytes();
      if (memory == Memory::kLinear) {
        VkImageSubresource sub{planeAspect(p), 0, 0};
        VkSubresourceLayout at{};
        vkGetImageSubresourceLayout(device().handle, image.handle, &sub, &at);
        for (uint32_t y = 0; y < e.height; y++) std::memcpy(image.mapped + at.offset + y * at.rowPitch, &planes[p][y * row], row);
        continue;
      }
      Buffer source = work->buffer(planes[p].size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, planes[p].data());
      Piece whole;
      whole.extent = e;
      VkBufferImageCopy region = regionOf(whole, planeAspect(p));
      device().run([&](VkCommandBuffer c) {
        vkCmdCopyBufferToImage(c, source.handle, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &region);
        fullBarrier(c);
      });
    }
    if (memory == Memory::kLinear) toGeneral(image, VK_IMAGE_LAYOUT_PREINITIALIZED);
  }

  Bytes readPlane(const PlanarFormat& f, const Planar& image, uint32_t plane) {
    VkExtent3D e = planeExtent(f, plane);
    Buffer target = work->buffer(size_t(e.width) * e.height * f.components(plane) * f.componentBytes(), VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    Piece whole;
    whole.extent = e;
    VkBufferImageCopy region = regionOf(whole, planeAspect(plane));
    device().run([&](VkCommandBuffer c) {
      vkCmdCopyImageToBuffer(c, image.handle, VK_IMAGE_LAYOUT_GENERAL, target.handle, 1, &region);
      fullBarrier(c);
    });
    return bytesOf(target);
  }

  VkImageView view(VkImage image, VkFormat format, VkImageAspectFlags aspect, const void* next = nullptr) {
    VkImageViewCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    info.pNext = next;
    info.image = image;
    info.viewType = VK_IMAGE_VIEW_TYPE_2D;
    info.format = format;
    info.subresourceRange = {aspect, 0, 1, 0, 1};
    VkImageView made = VK_NULL_HANDLE;
    VkDevice d = device().handle;
    check(vkCreateImageView(d, &info, nullptr, &made), "vkCreateImageView");
    work->onDestroy([d, made] { vkDestroyImageView(d, made, nullptr); });
    return made;
  }
  VkSampler sampler(VkFilter filter, const void* next = nullptr) {
    VkSamplerCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
    info.pNext = next;
    info.magFilter = info.minFilter = filter;
    info.addressModeU = info.addressModeV = info.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    info.maxLod = 0.25f;
    VkSampler made = VK_NULL_HANDLE;
    VkDevice d = device().handle;
    check(vkCreateSampler(d, &info, nullptr, &made), "vkCreateSampler");
    work->onDestroy([d, made] { vkDestroySampler(d, made, nullptr); });
    return made;
  }

  // The image at `points` through one combined descriptor with an immutable sampler.
  std::vector<float> sampleAt(VkImageView image, VkSampler sampler, const std::vector<float>& points) {
    Workspace inner(device());
    const uint32_t count = uint32_t(points.size() / 2);
    VkDescriptorSetLayoutBinding texture{2, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1, VK_SHADER_STAGE_COMPUTE_BIT, &sampler};
    VkDescriptorSetLayout setLayout = makeSetLayout(inner, {computeBinding(0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), computeBinding(1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER), texture});
    VkPipelineLayout layout = makePipelineLayout(inner, {setLayout});
    VkPipeline pipeline = makeCompute(inner, inner.shader(VK_SHADER_STAGE_COMPUTE_BIT, R"(#version 460
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer In { vec2 at[]; };
layout(binding = 1) buffer Out { vec4 r[]; };
layout(binding = 2) uniform sampler2D t;
void main() { r[gl_GlobalInvocationID.x] = textureLod(t, at[gl_GlobalInvocationID.x], 0); })"), layout);
    Buffer in = inner.bufferOf(points, kStorage), out = inner.bufferOf(std::vector<float>(count * 4), kStorage);
    VkDescriptorPool pool = makePool(inner, {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2}, {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4}});
    VkDescriptorSet set = makeSet(inner, pool, setLayout);
    VkDescriptorBufferInfo buffers[2] = {{in.handle, 0, VK_WHOLE_SIZE}, {out.handle, 0, VK_WHOLE_SIZE}};
    VkDescriptorImageInfo imageInfo{VK_NULL_HANDLE, image, VK_IMAGE_LAYOUT_GENERAL};
    VkWriteDescriptorSet writes[3] = {writeBuffer(set, 0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &buffers[0]),
                                      writeBuffer(set, 1, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, &buffers[1]),
                                      writeBuffer(set, 2, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, nullptr)};
    writes[2].pImageInfo = &imageInfo;
    vkUpdateDescriptorSets(device().handle, 3, writes, 0, nullptr);
    device().run([&](VkCommandBuffer c) {
      vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
      vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
      vkCmdDispatch(c, count / 64, 1, 1);
      fullBarrier(c);
    });
    std::vector<float> found(count * 4);
    std::memcpy(found.data(), out.mapped, found.size() * 4);
    return found;
  }

  // Places all over the image and a little outside, none where a nearest filter of any plane has two answers.
  std::vector<float> points(uint32_t count) {
    std::vector<float> out;
    uint32_t state = 99;
    auto random = [&] { return double((state = state * 1664525u + 1013904223u) >> 8) / (1 << 24); };
    while (out.size() < 2 * count) {
      double u = random() * (kExtent.width + 2) - 1, v = random() * (kExtent.height + 2) - 1;
      auto clear = [](double x) { return std::abs(x - std::round(x)) > 0.02; };
      if (clear(u) && clear(v)) out.insert(out.end(), {float(u / kExtent.width), float(v / kExtent.height)});
    }
    return out;
  }

  void checkConversion(const PlanarFormat& f, const Planar& image, const std::vector<Bytes>& planes, const Conversion& c, const std::vector<float>& at) {
    SCOPED_TRACE(std::string(f.name) + " model " + std::to_string(c.model) + " range " + std::to_string(c.range) + " offsets " + std::to_string(c.x) + std::to_string(c.y) +
                 " filters " + std::to_string(c.luma) + std::to_string(c.chroma));
    VkSamplerYcbcrConversionCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SAMPLER_YCBCR_CONVERSION_CREATE_INFO;
    info.format = f.format;
    info.ycbcrModel = c.model;
    info.ycbcrRange = c.range;
    if (c.swapped) info.components = {VK_COMPONENT_SWIZZLE_B, VK_COMPONENT_SWIZZLE_IDENTITY, VK_COMPONENT_SWIZZLE_R, VK_COMPONENT_SWIZZLE_IDENTITY};
    info.xChromaOffset = c.x;
    info.yChromaOffset = c.y;
    info.chromaFilter = c.chroma;
    VkSamplerYcbcrConversion conversion = VK_NULL_HANDLE;
    VkDevice d = device().handle;
    check(vkCreateSamplerYcbcrConversion(d, &info, nullptr, &conversion), "vkCreateSamplerYcbcrConversion");
    work->onDestroy([d, conversion] { vkDestroySamplerYcbcrConversion(d, conversion, nullptr); });
    VkSamplerYcbcrConversionInfo use{VK_STRUCTURE_TYPE_SAMPLER_YCBCR_CONVERSION_INFO, nullptr, conversion};
    std::vector<float> found = sampleAt(view(image.handle, f.format, VK_IMAGE_ASPECT_COLOR_BIT, &use), sampler(c.luma, &use), at);
    // Weights of filters have at least 8 bits by the specification, and ours those of float.
    const double tolerance = GetParam() == Role::kTested ? 4e-6 : 0.02;
    double worst = 0;
    int wrong = 0;
    for (size_t i = 0; i < at.size() / 2; i++) {
      std::array<double, 3> want = reference(f, planes, c, at[2 * i], at[2 * i + 1]);
      for (int k = 0; k < 3; k++) {
        double error = std::abs(found[4 * i + k] - want[k]);
        worst = std::max(worst, error);
        if (!(error <= tolerance) && wrong++ < 3)
          ADD_FAILURE() << "component " << k << " at texel " << at[2 * i] * kExtent.width << ", " << at[2 * i + 1] * kExtent.height << " is " << found[4 * i + k] << ", expected " << want[k];
      }
      EXPECT_EQ(found[4 * i + 3], 1.0f);
    }
    EXPECT_EQ(wrong, 0) << "worst error " << worst;
  }
  std::unique_ptr<Workspace> work;
};

bool samplable(VkFormatFeatureFlags f) {
  return (f & VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT) && (f & (VK_FORMAT_FEATURE_MIDPOINT_CHROMA_SAMPLES_BIT | VK_FORMAT_FEATURE_COSITED_CHROMA_SAMPLES_BIT));
}

// Every format and way of memory; models and ranges in turn.
TEST_P(YcbcrFeatures, EveryFormat) {
  const std::vector<float> at = points(256);
  int n = 0;
  for (const PlanarFormat& f : kFormats)
    for (Memory memory : {Memory::kOptimal, Memory::kLinear, Memory::kDisjoint}) {
      VkFormatFeatureFlags features = formatFeatures(f.format, memory);
      if (GetParam() == Role::kTested) {
        EXPECT_TRUE(samplable(features)) << f.name;
      }
      if (!samplable(features)) continue;
      const std::vector<Bytes> planes = planesOf(f);
      Planar image = make(f, memory);
      fill(f, image, planes, memory);
      for (uint32_t p = 0; p < f.planes; p++) EXPECT_EQ(firstDifference(readPlane(f, image, p), planes[p]), "") << f.name << " plane " << p;
      Conversion c;
      c.model = VkSamplerYcbcrModelConversion(n % 5);
      c.range = VkSamplerYcbcrRange(n / 5 % 2);
      n++;
      const bool linear = features & VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT && features & VK_FORMAT_FEATURE_SAMPLED_IMAGE_YCBCR_CONVERSION_LINEAR_FILTER_BIT;
      c.luma = c.chroma = linear ? VK_FILTER_LINEAR : VK_FILTER_NEAREST;
      c.x = c.y = features & VK_FORMAT_FEATURE_MIDPOINT_CHROMA_SAMPLES_BIT ? VK_CHROMA_LOCATION_MIDPOINT : VK_CHROMA_LOCATION_COSITED_EVEN;
      checkConversion(f, image, planes, c, at);
    }
}

// Every model, range, place of chroma and pair of filters, and the mapping of components.
TEST_P(YcbcrFeatures, EveryConversion) {
  const std::vector<float> at = points(128);
  for (const PlanarFormat& f : {kFormats[0], kFormats[1]}) {
    VkFormatFeatureFlags features = formatFeatures(f.format, Memory::kOptimal);
    ASSERT_TRUE(samplable(features)) << f.name << " is required";
    const std::vector<Bytes> planes = planesOf(f);
    Planar image = make(f, Memory::kOptimal);
    fill(f, image, planes, Memory::kOptimal);
    auto has = [&](VkFormatFeatureFlags bit) { return (features & bit) != 0; };
    auto possible = [&](VkChromaLocation l) { return has(l == VK_CHROMA_LOCATION_MIDPOINT ? VK_FORMAT_FEATURE_MIDPOINT_CHROMA_SAMPLES_BIT : VK_FORMAT_FEATURE_COSITED_CHROMA_SAMPLES_BIT); };
    for (int model = 0; model < 5; model++)
      for (VkSamplerYcbcrRange range : {VK_SAMPLER_YCBCR_RANGE_ITU_FULL, VK_SAMPLER_YCBCR_RANGE_ITU_NARROW}) {
        Conversion c;
        c.model = VkSamplerYcbcrModelConversion(model);
        c.range = range;
        if (!possible(c.x)) c.x = c.y = VK_CHROMA_LOCATION_COSITED_EVEN;
        c.swapped = (model + range) & 1;
        checkConversion(f, image, planes, c, at);
      }
    for (VkChromaLocation x : {VK_CHROMA_LOCATION_MIDPOINT, VK_CHROMA_LOCATION_COSITED_EVEN})
      for (VkChromaLocation y : {VK_CHROMA_LOCATION_MIDPOINT, VK_CHROMA_LOCATION_COSITED_EVEN})
        for (VkFilter luma : {VK_FILTER_NEAREST, VK_FILTER_LINEAR})
          for (VkFilter chroma : {VK_FILTER_NEAREST, VK_FILTER_LINEAR}) {
            if (!possible(x) || !possible(y)) continue;
            if (luma != chroma && !has(VK_FORMAT_FEATURE_SAMPLED_IMAGE_YCBCR_CONVERSION_SEPARATE_RECONSTRUCTION_FILTER_BIT)) continue;
            if (chroma == VK_FILTER_LINEAR && !has(VK_FORMAT_FEATURE_SAMPLED_IMAGE_YCBCR_CONVERSION_LINEAR_FILTER_BIT)) continue;
            // A nearest filter may take chroma as lying in the middle, or not: only the former is asked for.
            if (chroma == VK_FILTER_NEAREST && GetParam() == Role::kPeer && (x == VK_CHROMA_LOCATION_COSITED_EVEN || y == VK_CHROMA_LOCATION_COSITED_EVEN)) continue;
            Conversion c;
            c.model = VK_SAMPLER_YCBCR_MODEL_CONVERSION_YCBCR_709;
            c.range = VK_SAMPLER_YCBCR_RANGE_ITU_NARROW;
            c.x = x, c.y = y, c.luma = luma, c.chroma = chroma;
            checkConversion(f, image, planes, c, at);
          }
  }
}

// Views of one plane, and copies between a plane and an image of the plane's format.
TEST_P(YcbcrFeatures, PlanesByThemselves) {
  const std::vector<float> at = points(128);
  for (Memory memory : {Memory::kOptimal, Memory::kDisjoint}) {
    const PlanarFormat& f = kFormats[1];
    if (!samplable(formatFeatures(f.format, memory))) continue;
    const std::vector<Bytes> planes = planesOf(f);
    Planar image = make(f, memory), other = make(f, memory);
    fill(f, image, planes, memory);
    const VkFormat planeFormats[2] = {VK_FORMAT_R8_UNORM, VK_FORMAT_R8G8_UNORM};
    for (uint32_t p = 0; p < 2; p++) {
      SCOPED_TRACE(p);
      std::vector<float> found = sampleAt(view(image.handle, planeFormats[p], planeAspect(p)), sampler(VK_FILTER_NEAREST), at);
      Conversion nearest;
      for (size_t i = 0; i < at.size() / 2; i++)
        for (uint32_t k = 0; k < f.components(p); k++)
          EXPECT_NEAR(found[4 * i + k], samplePlane(f, planes, p, k, nearest, at[2 * i], at[2 * i + 1]), 1e-6);
      // To a plain image and on to another planar one.
      ImageSpec spec;
      spec.format = planeFormats[p];
      spec.extent = planeExtent(f, p);
      spec.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
      Image plain = work->image(spec);
      pumice::cts::toGeneral(*work, plain);
      VkImageCopy there{};
      there.srcSubresource = {planeAspect(p), 0, 0, 1};
      there.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
      there.extent = spec.extent;
      VkImageCopy back = there;
      std::swap(back.srcSubresource, back.dstSubresource);
      device().run([&](VkCommandBuffer c) {
        vkCmdCopyImage(c, image.handle, VK_IMAGE_LAYOUT_GENERAL, plain.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &there);
        fullBarrier(c);
        vkCmdCopyImage(c, plain.handle, VK_IMAGE_LAYOUT_GENERAL, other.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &back);
        fullBarrier(c);
      });
      EXPECT_EQ(firstDifference(download(*work, plain, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, f.components(p)), planes[p]), "");
      EXPECT_EQ(firstDifference(readPlane(f, other, p), planes[p]), "");
    }
  }
}

PUMICE_ON_BOTH_DEVICES(YcbcrFeatures);

}  // namespace
}  // namespace pumice::cts
