// Resolves of depth and stencil (Vulkan spec, VkResolveModeFlagBits): one sample, the average, the least or the greatest.
#include <algorithm>
#include <cstring>

#include "texture/rows.h"
#include "texture/transfer.h"

namespace pumice::texture {
namespace {

// The value of an element: `Raw` as it is stored, D24 in the low bits of its word.
template <typename Raw>
struct Reader {
  uint32_t mask;
  Raw read(const std::byte* at) const {
    Raw v;
    std::memcpy(&v, at, sizeof v);
    if constexpr (sizeof(Raw) == 4 && std::is_integral_v<Raw>) v &= mask;
    return v;
  }
};

template <typename Raw>
Raw combine(VkResolveModeFlagBits mode, const Raw* values, uint32_t count) {
  switch (mode) {
    case VK_RESOLVE_MODE_MIN_BIT: return *std::min_element(values, values + count);
    case VK_RESOLVE_MODE_MAX_BIT: return *std::max_element(values, values + count);
    case VK_RESOLVE_MODE_AVERAGE_BIT: {
      // In double nothing is lost before the one rounding.
      double sum = 0;
      for (uint32_t i = 0; i < count; i++) sum += double(values[i]);
      sum /= count;
      return std::is_integral_v<Raw> ? Raw(sum + 0.5) : Raw(sum);
    }
    default: return values[0];
  }
}

template <typename Raw>
void resolvePlane(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, const PlaneLayout& from, const PlaneLayout& to, uint32_t mask,
                  VkResolveModeFlagBits mode, const VkImageResolve& r) {
  const LevelLayout &sl = from.levels[r.srcSubresource.mipLevel], &dl = to.levels[r.dstSubresource.mipLevel];
  const uint32_t samples = std::min(src.layout->samples, 64u);
  const uint32_t sx = uint32_t(r.srcOffset.x), sy = uint32_t(r.srcOffset.y), dx = uint32_t(r.dstOffset.x), dy = uint32_t(r.dstOffset.y);
  if (r.srcOffset.x < 0 || r.srcOffset.y < 0 || r.dstOffset.x < 0 || r.dstOffset.y < 0 || sx >= sl.width || sy >= sl.height || dx >= dl.width || dy >= dl.height) return;
  const uint32_t width = std::min({r.extent.width, sl.width - sx, dl.width - dx}), height = std::min({r.extent.height, sl.height - sy, dl.height - dy});
  const Reader<Raw> reader{mask};
  for (uint32_t layer = 0; layer < std::min(r.srcSubresource.layerCount, r.dstSubresource.layerCount); ++layer) {
    const uint32_t fromLayer = r.srcSubresource.baseArrayLayer + layer, toLayer = r.dstSubresource.baseArrayLayer + layer;
    if (fromLayer >= src.layout->arrayLayers || toLayer >= dst.layout->arrayLayers) break;
    parallelRanges(pool, height, uint64_t(width) * from.elementBytes * samples, [&](uint32_t begin, uint32_t end) {
      Raw values[64];
      for (uint32_t y = begin; y < end; ++y)
        for (uint32_t x = 0; x < width; ++x) {
          for (uint32_t s = 0; s < samples; ++s)
            values[s] = reader.read(src.base + src.layout->elementOffset(from, r.srcSubresource.mipLevel, fromLayer, s, sx + x, sy + y, 0));
          const Raw value = combine(mode, values, samples);
          std::memcpy(dst.base + dst.layout->elementOffset(to, r.dstSubresource.mipLevel, toLayer, 0, dx + x, dy + y, 0), &value, sizeof value);
        }
    });
  }
}

}  // namespace

void resolveDepthStencil(base::ThreadPool& pool, const ImageMemory& src, const ImageMemory& dst, VkImageAspectFlagBits aspect, VkResolveModeFlagBits mode,
                         const VkImageResolve& region) {
  const ImageLayout &from = *src.layout, &to = *dst.layout;
  if (mode == VK_RESOLVE_MODE_NONE || !(from.format->aspects() & to.format->aspects() & aspect)) return;
  if (region.srcSubresource.mipLevel >= from.mipLevels || region.dstSubresource.mipLevel >= to.mipLevels) return;
  const PlaneLayout &a = from.plane(aspect), &b = to.plane(aspect);
  if (a.elementBytes != b.elementBytes) return;
  const auto go = [&](auto raw, uint32_t mask) { resolvePlane<decltype(raw)>(pool, src, dst, a, b, mask, mode, region); };
  if (a.elementBytes == 1) return go(uint8_t(0), 0);
  if (a.elementBytes == 2) return go(uint16_t(0), 0);
  if (from.format->rgba[0].numeric == Numeric::Sfloat) return go(0.0f, 0);
  go(uint32_t(0), (1u << from.format->rgba[0].bits) - 1);
}

}  // namespace pumice::texture
