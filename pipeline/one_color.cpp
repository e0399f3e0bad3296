#include "pipeline/one_color.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace pumice::pipeline {

namespace {
constexpr uint32_t kWords = raster::kBlocksPerTile / 64;
}

void OneColor::setTile(uint32_t tile) {
  const raster::TileGrid& grid = pass_.bins->grid();
  tileX_ = tile % grid.tilesX;
  tileY_ = tile / grid.tilesX % grid.tilesY;
  layer_ = tile / (grid.tilesX * grid.tilesY);
  bits_ = pass_.oneColor ? pass_.oneColorBits.data() + size_t(tile) * pass_.pass.colorCount * kWords : nullptr;
}

void OneColor::complete(uint32_t attachment, uint32_t block) const {
  const AttachmentPlane& p = pass_.colorPlanes[attachment];
  const uint64_t row = tileY_ * (raster::kTileSize / 4) + raster::blockY(block) / 4, column = tileX_ * (raster::kTileSize / 4) + raster::blockX(block) / 4;
  std::byte* first = p.base + layer_ * p.layerPitch + (row * p.rowElements + column * 16) * p.elementBytes;
  for (uint32_t s = 1; s < pass_.samples; ++s) {
    std::byte* to = first + s * p.samplePitch;
    if (p.elementBytes == 4) std::memcpy(to, first, 64);   // the usual, without a call
    else std::memcpy(to, first, 16 * p.elementBytes);
  }
}

void OneColor::splitBlocks(uint32_t first, uint32_t count, uint32_t colors) {
  for (; colors; colors &= colors - 1) {
    uint64_t& w = word(colors, first);
    uint64_t set = w & mask(first, count);
    w &= ~set;
    splits += uint64_t(std::popcount(set));
    for (; set; set &= set - 1) complete(uint32_t(std::countr_zero(colors)), (first & ~63u) + uint32_t(std::countr_zero(set)));
  }
}

void OneColor::splitAll() {
  for (uint32_t w = 0; w < kWords; ++w) split(w * 64, 64, pass_.oneColor);
}

void OneColor::finish() {
  const int32_t x0 = int32_t(tileX_ * raster::kTileSize), y0 = int32_t(tileY_ * raster::kTileSize);
  const VkRect2D rect = intersect(pass_.pass.renderArea, {{x0, y0}, {raster::kTileSize, raster::kTileSize}});
  if (isEmpty(rect)) return;
  const uint32_t left = uint32_t(rect.offset.x - x0), right = left + rect.extent.width, top = uint32_t(rect.offset.y - y0), bottom = top + rect.extent.height;
  for (uint32_t colors = pass_.oneColor; colors; colors &= colors - 1) {
    const uint32_t a = uint32_t(std::countr_zero(colors));
    uint64_t* bits = bits_ + a * kWords;
    if (const texture::BlockResolve* resolve = pass_.blockResolves[a] ? &*pass_.blockResolves[a] : nullptr) {
      texture::BlockResolve::Block agreeing[raster::kBlocksPerTile], others[raster::kBlocksPerTile];
      size_t agree = 0, differ = 0;
      for (uint32_t n = 0; n < raster::kBlocksPerTile; ++n) {
        const uint32_t x = raster::blockX(n), y = raster::blockY(n);
        if (x + 4 <= left || x >= right || y + 4 <= top || y >= bottom) continue;
        (bits[n >> 6] >> (n & 63) & 1 ? agreeing[agree++] : others[differ++]) = {uint16_t(uint32_t(x0) + x), uint16_t(uint32_t(y0) + y)};
      }
      resolve->blocks(layer_, {agreeing, agree}, true);
      resolve->blocks(layer_, {others, differ}, false);
    }
    const bool store = pass_.pass.color[a].storeOp != VK_ATTACHMENT_STORE_OP_DONT_CARE;
    for (uint32_t w = 0; w < kWords; ++w) {
      uint64_t set = std::exchange(bits[w], 0);
      kept += uint64_t(std::popcount(set));
      if (!store) continue;
      stored += uint64_t(std::popcount(set));
      for (; set; set &= set - 1) complete(a, w * 64 + uint32_t(std::countr_zero(set)));
    }
  }
}

// ---- of the whole pass

void PassExecutor::Impl::beginOneColor() {
  oneColor = 0;
  for (auto& r : blockResolves) r.reset();
  if (samples < 2 || disabled & bit(Idea::OneColor)) return;
  for (uint32_t a = 0; a < pass.colorCount; ++a)
    if (colorPlanes[a].base && pass.color[a].memory.layout->samples == samples) oneColor |= 1u << a;
  if (!oneColor) return;
  oneColorBits.assign(size_t(bins->grid().count()) * pass.colorCount * kWords, 0);
  for (uint32_t a = 0; a < pass.colorCount; ++a) {
    const Attachment &src = pass.color[a], &dst = pass.resolve[a];
    if (!(oneColor >> a & 1) || !dst.memory.layout) continue;
    blockResolves[a].emplace(src.memory, dst.memory, resolveRegion(src, dst));
  }
}

void PassExecutor::Impl::clearColor(uint32_t attachment, uint32_t layer, const VkRect2D& rect, const std::byte* element) {
  const Attachment& color = pass.color[attachment];
  const uint32_t x0 = uint32_t(rect.offset.x), y0 = uint32_t(rect.offset.y), x1 = x0 + rect.extent.width, y1 = y0 + rect.extent.height;
  if (!(oneColor >> attachment & 1) || isEmpty(rect)) return fillAttachment(color, VK_IMAGE_ASPECT_COLOR_BIT, layer, 1, rect, element);
  // What lies in blocks beyond the image is nobody's.
  const texture::LevelLayout& level = color.memory.layout->plane(VK_IMAGE_ASPECT_COLOR_BIT).levels[color.level];
  const bool wholeBlocks = !(x0 % 4 || y0 % 4) && (x1 % 4 == 0 || x1 >= level.width) && (y1 % 4 == 0 || y1 >= level.height);
  const raster::TileGrid& grid = bins->grid();
  OneColor state(*this);
  for (uint32_t ty = y0 / raster::kTileSize; ty <= (y1 - 1) / raster::kTileSize; ++ty)
    for (uint32_t tx = x0 / raster::kTileSize; tx <= (x1 - 1) / raster::kTileSize; ++tx) {
      state.setTile((layer * grid.tilesY + ty) * grid.tilesX + tx);
      const auto inTile = [](uint32_t at, uint32_t tile) { return std::clamp(int32_t(at) - int32_t(tile * raster::kTileSize), 0, int32_t(raster::kTileSize)); };
      const uint32_t left = uint32_t(inTile(x0, tx)), right = uint32_t(inTile(x1, tx)), top = uint32_t(inTile(y0, ty)), bottom = uint32_t(inTile(y1, ty));
      if (wholeBlocks && right - left == raster::kTileSize && bottom - top == raster::kTileSize) {
        for (uint32_t w = 0; w < kWords; ++w) state.take(w * 64, 64, 1u << attachment);
        continue;
      }
      for (uint32_t y = top & ~3u; y < bottom; y += 4)
        for (uint32_t x = left & ~3u; x < right; x += 4) {
          const uint32_t n = raster::blockNumber(x, y);
          if (wholeBlocks) state.take(n, 1, 1u << attachment);
          else state.split(n, 1, 1u << attachment);
        }
    }
  fillAttachment(color, VK_IMAGE_ASPECT_COLOR_BIT, layer, 1, rect, element, wholeBlocks ? 1 : ~0u);
}

}  // namespace pumice::pipeline
