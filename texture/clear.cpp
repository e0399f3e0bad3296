// Clears (Vulkan spec, "Clear Commands"): a clear value becomes one element's bits, which fill memory.
#include <algorithm>
#include <bit>

#include "base/fpenv.h"
#include "texture/builders.h"
#include "texture/cleared.h"
#include "texture/pixel_routine.h"
#include "texture/rows.h"

namespace pumice::texture {
namespace {

// Packs one texel given as 32-bit words.
void packTexel(const FormatInfo& f, const uint32_t (&words)[4], std::byte out[32]) {
  std::memset(out, 0, 32);
  RoutineKey key;
  key.kind = RoutineKey::Pack;
  key.targetFormat = formatKey(f);
  const RawLoads loads = rawLoads(f);
  auto routine = pixelRoutine(key, [&](ir::Builder& b) {
    Texel t{};
    ir::Type type = f.isInteger() ? ir::Type::I32 : ir::Type::F32;
    for (uint32_t i = 0; i < 4; ++i) t[i] = b.input(type, i);
    RawElement raw = pack(b, f, t);
    for (uint32_t i = 0; i < loads.count; ++i) b.output(i, raw[i]);
  });
  if (!routine) return;

  base::ScopedFpEnv environment;
  alignas(64) uint32_t rows[12][interp::kMaxLanes] = {};
  const void* inputs[4];
  void* outputs[8];
  for (int i = 0; i < 4; ++i) {
    rows[i][0] = words[i];
    inputs[i] = rows[i];
  }
  for (int i = 0; i < 8; ++i) outputs[i] = rows[4 + i];
  interp::Tables tables{};
  const ConstantTable constants = constantTable();
  tables[ir::kTableConstants] = {constants.data, constants.size};
  interp::ExecContext context;
  context.lanes = 1;
  context.active[0] = 1;
  context.inputs = inputs;
  context.outputs = outputs;
  context.tables = tables;
  routine->run(routine->preamble(tables), context);
  const uint32_t unit = typeBytes(loads.type);
  for (uint32_t i = 0; i < loads.count; ++i) std::memcpy(out + i * unit, &rows[4 + i][0], unit);
}

void fillLevel(base::ThreadPool& pool, const ImageMemory& image, const PlaneLayout& plane, uint32_t level, uint32_t layer, const std::byte* element) {
  const LevelLayout& l = plane.levels[level];
  // Padding is filled with the rest. Rows of blocks hold whole elements; rows of linear images may end in padding.
  const bool tiled = image.layout->tiled;
  const uint32_t rows = (tiled ? (l.elementsY + 3) / 4 : l.elementsY) * l.depth;
  const Store store = storeFor(l.slicePitch * l.depth);
  const uint64_t perRow = tiled ? l.rowPitch / plane.elementBytes : l.elementsX;
  for (uint32_t sample = 0; sample < image.layout->samples; ++sample) {
    std::byte* base = sliceOf(image, plane, level, layer, sample, 0).base;
    parallelRanges(pool, rows, l.rowPitch, [&](uint32_t begin, uint32_t end) {
      for (uint32_t i = begin; i < end; ++i) fillElements(base + i * l.rowPitch, perRow, element, plane.elementBytes, store);
    });
  }
}

void clearRange(base::ThreadPool& pool, const ImageMemory& image, const VkClearValue& value, const VkImageSubresourceRange& range) {
  writeCleared(image);
  const ImageLayout& layout = *image.layout;
  if (layout.format->isCompressed()) return;
  const uint32_t levels = range.levelCount == VK_REMAINING_MIP_LEVELS ? layout.mipLevels : std::min(range.baseMipLevel + range.levelCount, layout.mipLevels);
  const uint32_t layers =
      range.layerCount == VK_REMAINING_ARRAY_LAYERS ? layout.arrayLayers : std::min(range.baseArrayLayer + range.layerCount, layout.arrayLayers);
  for (uint32_t p = 0; p < layout.planeCount; ++p) {
    const PlaneLayout& plane = layout.planes[p];
    if (!(range.aspectMask & plane.aspect)) continue;
    std::byte element[32];
    packClearValue(*layout.format, plane.aspect, value, element);
    for (uint32_t layer = range.baseArrayLayer; layer < layers; ++layer)
      for (uint32_t level = range.baseMipLevel; level < levels; ++level) fillLevel(pool, image, plane, level, layer, element);
  }
}

}  // namespace

void packClearValue(const FormatInfo& f, VkImageAspectFlags aspect, const VkClearValue& value, std::byte out[32]) {
  uint32_t words[4] = {};
  if (!f.isDepthStencil()) {
    std::memcpy(words, value.color.uint32, sizeof(words));
  } else {
    words[0] = aspect & VK_IMAGE_ASPECT_DEPTH_BIT ? std::bit_cast<uint32_t>(value.depthStencil.depth) : value.depthStencil.stencil & 0xff;
  }
  packTexel(planeFormat(f, aspect), words, out);
}

void clearColor(base::ThreadPool& pool, const ImageMemory& image, const VkClearColorValue& value, const VkImageSubresourceRange& range) {
  VkClearValue v{};
  v.color = value;
  clearRange(pool, image, v, range);
}

void clearDepthStencil(base::ThreadPool& pool, const ImageMemory& image, const VkClearDepthStencilValue& value, const VkImageSubresourceRange& range) {
  VkClearValue v{};
  v.depthStencil = value;
  clearRange(pool, image, v, range);
}

void fillRect(const ImageMemory& image, VkImageAspectFlags aspect, uint32_t level, uint32_t layer, uint32_t z, VkRect2D rect, const std::byte* element,
              uint32_t samples) {
  const ImageLayout& layout = *image.layout;
  if (level >= layout.mipLevels || layer >= layout.arrayLayers) return;
  const PlaneLayout& plane = layout.plane(aspect);
  const LevelLayout& l = plane.levels[level];
  if (z >= l.depth) return;
  const int64_t x0 = std::clamp<int64_t>(rect.offset.x, 0, l.elementsX), y0 = std::clamp<int64_t>(rect.offset.y, 0, l.elementsY);
  const int64_t x1 = std::clamp<int64_t>(int64_t(rect.offset.x) + rect.extent.width, x0, l.elementsX);
  const int64_t y1 = std::clamp<int64_t>(int64_t(rect.offset.y) + rect.extent.height, y0, l.elementsY);
  if (x0 == x1 || y0 == y1) return;
  const uint32_t width = uint32_t(x1 - x0), bytes = plane.elementBytes;
  // Whole blocks lie one behind the other; those at the edges of the level may be filled with their padding.
  const bool wholeColumns = layout.tiled && x0 % 4 == 0 && (x1 % 4 == 0 || x1 == l.elementsX);
  const uint64_t across = x0 == 0 && x1 == l.elementsX ? l.rowPitch / bytes : uint64_t(width + 3) / 4 * 16;
  // One packed row of copies serves every row.
  std::byte row[64 * 32];
  const uint32_t chunk = std::min<uint32_t>(width, sizeof(row) / bytes) & ~(width > 4 ? 3u : 0u);
  bool packed = false;
  // Whole rows of blocks lie one behind the other, too.
  const bool wholeRows = wholeColumns && across * bytes == l.rowPitch;
  for (uint32_t sample = 0; sample < std::min(samples, layout.samples); ++sample) {
    Slice s = sliceOf(image, plane, level, layer, sample, z);
    for (int64_t y = y0; y < y1;) {
      if (wholeColumns && y % 4 == 0 && (y + 4 <= y1 || y1 == l.elementsY)) {
        const int64_t groups = !wholeRows ? 1 : y1 == l.elementsY ? (y1 - y + 3) / 4 : (y1 - y) / 4;
        fillElements(s.row(uint32_t(y)) + uint64_t(x0) * 4 * bytes, across * uint64_t(groups), element, bytes);
        y += 4 * groups;
        continue;
      }
      if (!packed) fillElements(row, chunk, element, bytes);
      packed = true;
      for (uint32_t x = 0; x < width; x += chunk) writeRow(s, uint32_t(x0) + x, uint32_t(y), std::min(chunk, width - x), row);
      ++y;
    }
  }
}

}  // namespace pumice::texture
