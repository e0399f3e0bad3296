#include "pipeline/tile.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <utility>

#include "texture/cleared.h"

namespace pumice::pipeline {

TileWorker::TileWorker(PassExecutor::Impl& pass, Ideas disabled)
    : pass_(pass), hiZ_(!(disabled & bit(Idea::HiZ))), lazyClear_(!(disabled & bit(Idea::LazyClear))), colors_(pass), row_(pass, colors_), visibility_(hiZ_, true, !(disabled & bit(Idea::Squares))) {}

void TileWorker::loadOps(const VkRect2D& rect) {
  const PassBegin& p = pass_.pass;
  for (uint32_t a = 0; a < p.colorCount; ++a)
    if (p.color[a].memory.layout && p.color[a].loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR)
      lateClears_ |= 1u << a;
  if (!lazyClear_) finishClears();
  const Attachment& d = p.depthStencil;
  if (!d.memory.layout) return;
  if (pass_.depth.base && d.loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR) loadDepth(rect);
  if (pass_.stencil.base && d.stencilLoadOp == VK_ATTACHMENT_LOAD_OP_CLEAR)
    fillAttachment(d, VK_IMAGE_ASPECT_STENCIL_BIT, layer_, 1, rect, d.clear);
}

void TileWorker::finishClears(const uint64_t* written, uint32_t colors) {
  for (uint32_t left = std::exchange(lateClears_, 0); left; left &= left - 1) {
    const uint32_t a = uint32_t(std::countr_zero(left));
    const auto fill = [&](const VkRect2D& r) {
      pass_.clearColor(a, layer_, r, pass_.clearElements[a]);
    };
    if (!written || !(colors >> a & 1)) {
      fill(tileRect_);
      continue;
    }
    // Runs of blocks that are not written, row by row; where nothing is written, as one.
    if (!(written[0] | written[1] | written[2] | written[3])) {
      fill(tileRect_);
      continue;
    }
    if ((written[0] & written[1] & written[2] & written[3]) == ~uint64_t(0)) continue;
    const int32_t left0 = int32_t(tileX_ * raster::kTileSize), top = int32_t(tileY_ * raster::kTileSize);
    for (uint32_t y = 0; y < raster::kTileSize; y += 4)
      for (uint32_t x = 0; x < raster::kTileSize;) {
        const auto isWritten = [&](uint32_t at) {
          const uint32_t n = raster::blockNumber(at, y);
          return (written[n >> 6] >> (n & 63) & 1) != 0;
        };
        uint32_t end = x;
        while (end < raster::kTileSize && !isWritten(end)) end += 4;
        if (end > x) {
          const VkRect2D r = intersect(tileRect_, {{left0 + int32_t(x), top + int32_t(y)}, {end - x, 4}});
          if (!isEmpty(r)) fill(r);
        }
        x = end + 4;
      }
  }
}

// Blocks that are cleared as a whole need no memory to say so.
void TileWorker::loadDepth(const VkRect2D& rect) {
  const Attachment& d = pass_.pass.depthStencil;
  if (!depthKnown_ || (rect.extent.width | rect.extent.height | uint32_t(rect.offset.x) | uint32_t(rect.offset.y)) & 3) {
    fillAttachment(d, VK_IMAGE_ASPECT_DEPTH_BIT, layer_, 1, rect, d.clear);
    return;
  }
  VkRect2D inTile = rect;
  inTile.offset.x -= int32_t(tileX_ * raster::kTileSize);
  inTile.offset.y -= int32_t(tileY_ * raster::kTileSize);
  visibility_.clearDepth(inTile, pass_.clearDepth);
}

// What the operations of this tile's attachments move: nothing for DONT_CARE and NONE, nor where no draw reaches.
void TileWorker::countBytes(const VkRect2D& rect) {
  const uint32_t grid = pass_.bins->grid().tilesX * pass_.bins->grid().tilesY;
  const bool drawn = !pass_.bins->tile(layer_ * grid + tileY_ * pass_.bins->grid().tilesX + tileX_).empty();
  const auto count = [&](const Attachment& a, VkImageAspectFlagBits aspect, VkAttachmentLoadOp load, VkAttachmentStoreOp store) {
    const texture::FormatInfo* f = a.memory.layout ? texture::formatInfo(a.format) : nullptr;
    if (!f || !(f->aspects() & aspect)) return;
    const uint64_t bytes = uint64_t(rect.extent.width) * rect.extent.height * a.memory.layout->plane(aspect).elementBytes * pass_.samples;
    if (load == VK_ATTACHMENT_LOAD_OP_CLEAR && !pass_.loaded) cleared_ += bytes;
    if ((load == VK_ATTACHMENT_LOAD_OP_LOAD || pass_.loaded) && drawn) loaded_ += bytes;
    if (store == VK_ATTACHMENT_STORE_OP_STORE) stored_ += bytes;
  };
  for (uint32_t a = 0; a < pass_.pass.colorCount; ++a) {
    const Attachment& c = pass_.pass.color[a];
    count(c, VK_IMAGE_ASPECT_COLOR_BIT, c.loadOp, c.storeOp);
  }
  const Attachment& d = pass_.pass.depthStencil;
  count(d, VK_IMAGE_ASPECT_DEPTH_BIT, d.loadOp, d.storeOp);
  count(d, VK_IMAGE_ASPECT_STENCIL_BIT, d.stencilLoadOp, d.stencilStoreOp);
}

void TileWorker::tile(uint32_t index) {
  const raster::TileGrid& grid = pass_.bins->grid();
  tileX_ = index % grid.tilesX;
  tileY_ = index / grid.tilesX % grid.tilesY;
  layer_ = index / (grid.tilesX * grid.tilesY);
  row_.setTile(tileX_, tileY_, layer_);
  colors_.setTile(index);
  raster::DepthMemory depth;
  depthKnown_ = pass_.depthKind && pass_.depth.base;
  if (depthKnown_) {
    depth.kind = *pass_.depthKind;
    depth.rowElements = pass_.depth.rowElements;
    depth.samplePitch = pass_.depth.samplePitch;
    depth.base = pass_.depth.base + layer_ * pass_.depth.layerPitch +
                 (size_t(tileY_) * (raster::kTileSize / 4) * depth.rowElements + size_t(tileX_) * (raster::kTileSize * 4)) * raster::depthBytes(depth.kind);
  }
  visibility_.begin(tileX_, tileY_, pass_.samples, depth, pass_.statistics);
  const VkRect2D tileRect{{int32_t(tileX_ * raster::kTileSize), int32_t(tileY_ * raster::kTileSize)}, {raster::kTileSize, raster::kTileSize}};
  const VkRect2D rect = tileRect_ = intersect(pass_.pass.renderArea, tileRect);
  lateClears_ = 0;
  if (!pass_.loaded && !isEmpty(rect)) loadOps(rect);
  if (pass_.loaded)
    for (uint32_t left = pass_.marked; left; left &= left - 1)
      texture::writeClearedTile(pass_.pass.color[std::countr_zero(left)].memory, tileX_, tileY_);
  if (pass_.statistics) countBytes(rect);

  const std::span<const raster::BinEntry> bin = pass_.bins->tile(index);
  // Many primitives reach most blocks, each for the first time in an order that no processor foresees.
  const bool inMemory = depthKnown_ && (pass_.loaded || pass_.pass.depthStencil.loadOp != VK_ATTACHMENT_LOAD_OP_CLEAR);
  if (inMemory && bin.size() >= 64 * pass_.samples) visibility_.fetchDepth();
  for (size_t i = 0; i < bin.size(); ++i) {
    // Primitives lie all over the arenas of the front end: fetch them before their turn.
    constexpr size_t kFar = 10, kNear = 5;
    if (i + kFar < bin.size()) {
      const char* far = reinterpret_cast<const char*>(bin[i + kFar].primitive);
      for (size_t at = 0; at < sizeof(raster::Primitive); at += 64) __builtin_prefetch(far + at);
    }
    if (i + kNear < bin.size()) {
      const raster::Primitive& near = *bin[i + kNear].primitive;
      __builtin_prefetch(near.record ? static_cast<const void*>(near.record + raster::kRecordPlanes) : near.planes);
    }
    const raster::BinEntry& entry = bin[i];
    DrawRecord* draw = &pass_.draws[entry.draw];
    if (draw->isClear) {
      clear(*draw, rect);
    } else if (draw->settled) {
      opaque(*draw, *entry.primitive, entry.whole);
    } else {
      other(*draw, *entry.primitive);
    }
  }
  settle();
  finishClears();
  if (pass_.keepsDepth()) visibility_.storeDepth();
  row_.setDraw(nullptr);
  draw_ = nullptr;
  row_.dropRecords();
}

void TileWorker::clear(const DrawRecord& draw, const VkRect2D& rect) {
  const VkRect2D r = intersect(rect, draw.rect);
  const VkClearAttachment& c = draw.clear;
  if (isEmpty(r)) return;
  settle();
  finishClears();
  row_.setDraw(nullptr);
  draw_ = nullptr;
  const texture::FormatInfo* format = c.aspectMask & VK_IMAGE_ASPECT_COLOR_BIT ? texture::formatInfo(pass_.pass.color[c.colorAttachment].format) : nullptr;
  if (format && pass_.pass.color[c.colorAttachment].memory.layout) {
    std::byte element[32];
    texture::packClearValue(*format, VK_IMAGE_ASPECT_COLOR_BIT, c.clearValue, element);
    pass_.clearColor(c.colorAttachment, layer_, r, element);
  }
  if (c.aspectMask & VK_IMAGE_ASPECT_DEPTH_BIT) {
    visibility_.materialise();
    visibility_.forgetDepth();
  }
  for (VkImageAspectFlags aspect : {VK_IMAGE_ASPECT_DEPTH_BIT, VK_IMAGE_ASPECT_STENCIL_BIT})
    if (c.aspectMask & aspect)
      fillAttachment(pass_.pass.depthStencil, aspect, layer_, 1, r, c.clearValue);
}

// ---- opaque runs

void TileWorker::setOpaqueDraw(DrawRecord* draw) {
  if (run_ && run_->occlusion && visibility_.drawPassed)
    std::atomic_ref<uint64_t>(*run_->occlusion).fetch_add(visibility_.drawPassed, std::memory_order_relaxed);
  visibility_.drawPassed = 0;
  run_ = draw;
  if (draw) visibility_.beginDraw(draw, draw->visibility->depth, draw->visibility->colors != 0);
}

void TileWorker::opaque(DrawRecord& draw, const raster::Primitive& primitive, bool whole) {
  if (&draw != run_) {
    if (!run_) {
      // What came before may still be in the row.
      row_.setDraw(nullptr);
      draw_ = nullptr;
    } else if (draw.visibility->colors != run_->visibility->colors) {
      settle();
    }
    setOpaqueDraw(&draw);
  }
  if (visibility_.full()) {
    settle();
    visibility_.materialise();
    visibility_.dropEntries();
    setOpaqueDraw(&draw);
  }
  const raster::DepthRange& range = draw.clamp(primitive.viewport);
  visibility_.draw(primitive, range, draw.visibility->sampleMask, pass_.pass.renderArea, whole);
}

void TileWorker::settle() {
  if (!run_) return;
  const uint32_t colors = run_->visibility->colors;
  setOpaqueDraw(nullptr);
  if (!visibility_.pending()) return;
  if (lateClears_) {
    uint64_t written[raster::kBlocksPerTile / 64];
    visibility_.ownedBlocks(written);
    finishClears(written, colors);
  }
  const raster::Visibility::Winners winners = visibility_.takeWinners();
  for (size_t i = 0; i < winners.items.size(); ++i) {
    const raster::Visibility::Item& item = winners.items[i];
    constexpr size_t kFar = 12, kNear = 6;
    if (i + kFar < winners.items.size()) {
      const raster::Visibility::Entry& far = visibility_.entry(winners.items[i + kFar].entry);
      if (!far.record) __builtin_prefetch(far.primitive);
      else for (size_t at = 0; at < 128; at += 64) __builtin_prefetch(far.record + at);
    }
    if (i + kNear < winners.items.size()) {
      const raster::Visibility::Entry& near = visibility_.entry(winners.items[i + kNear].entry);
      if (!near.record)
        for (size_t at = 0; at < 192; at += 64) __builtin_prefetch(reinterpret_cast<const char*>(near.primitive->planes) + at);
    }
    raster::Visibility::Entry& e = visibility_.entry(item.entry);
    DrawRecord* draw = static_cast<DrawRecord*>(e.user);
    row_.setDraw(draw);
    if (!e.own && e.recordGeneration != row_.generation()) {
      e.record = row_.makeRecord(*e.primitive, *draw);
      e.recordGeneration = row_.generation();
    }
    if (!e.record) continue;
    if (item.blocks > 1) {
      uint32_t blocks = item.blocks;
      for (; i + 1 < winners.items.size(); ++i, blocks += winners.items[i].blocks) {
        const raster::Visibility::Item& next = winners.items[i + 1];
        if (next.entry != item.entry || next.blocks == 1 || next.block != item.block + blocks) break;
      }
      if (row_.addWholeRows(item.block, blocks, e.record, true)) continue;
      for (uint32_t n = item.block; n < item.block + blocks; ++n) row_.addSettled(n, winners.masks + item.masks, e.record);
      continue;
    }
    row_.addSettled(item.block, winners.masks + item.masks, e.record);
  }
  row_.setDraw(nullptr);
}

// ---- other draws

void TileWorker::other(DrawRecord& draw, const raster::Primitive& primitive) {
  if (&draw != draw_) {
    settle();
    finishClears();
    if (depthKnown_) visibility_.materialise();
    row_.setDraw(&draw);
    draw_ = &draw;
    if (draw.visibility->readsAttachments) colors_.splitAll();
  }
  primitive_ = &primitive;
  record_ = nullptr;
  const VisibilityTraits& v = *draw.visibility;
  rejects_ = hiZ_ && depthKnown_ && v.hiZ && !draw.query;
  writes_ = depthKnown_ && v.depth.write;
  if (rejects_ || writes_) {
    visibility_.beginOther(primitive, draw.clamp(primitive.viewport), v.depth, v.hiZ);
    const bool large = std::max(primitive.maxX - primitive.minX, primitive.maxY - primitive.minY) >= 16;
    if (rejects_ && large && !pass_.statistics && visibility_.othersFail(0, 0, raster::kTileSize)) return;
  }
  raster::rasterize(primitive, tileX_, tileY_, pass_.pass.renderArea, draw.samples, *this);
}

bool TileWorker::square(uint32_t x, uint32_t y, uint32_t size, bool whole) {
  if (size > 16) {
    if (!whole || !row_.takesWholeRows()) return false;
    if (!rejects_ && !writes_) {
      if (!record_ && !(record_ = row_.makeRecord(*primitive_, *draw_))) return true;
      return row_.addWholeRows(0, raster::kBlocksPerTile, record_, false);
    }
    for (uint32_t sy = 0; sy < size; sy += 16)
      for (uint32_t sx = 0; sx < size; sx += 16) {
        if (square(x + sx, y + sy, 16, true)) continue;
        uint16_t masks[16];
        std::fill(std::begin(masks), std::end(masks), uint16_t(0xffff));
        for (uint32_t n = 0; n < 16; ++n) block(x + sx + raster::blockX(n), y + sy + raster::blockY(n), masks);
      }
    return true;
  }
  if (rejects_ && !pass_.statistics && visibility_.othersFail(x, y, size)) return true;
  if (!whole || !row_.takesWholeRows()) return false;
  const uint32_t first = raster::blockNumber(x & (raster::kTileSize - 1), y & (raster::kTileSize - 1));
  for (uint32_t n = first; rejects_ && n < first + 16; ++n)
    if (visibility_.otherFails(n)) return false;
  if (!record_ && !(record_ = row_.makeRecord(*primitive_, *draw_))) return true;
  if (!row_.addWholeRows(first, 16, record_, false)) return false;
  for (uint32_t n = first; writes_ && n < first + 16; ++n) visibility_.otherWrote(n);
  return true;
}

void TileWorker::block(uint32_t x, uint32_t y, const uint16_t* masks) {
  const uint32_t n = raster::blockNumber(x & (raster::kTileSize - 1), y & (raster::kTileSize - 1));
  if (rejects_ && visibility_.otherFails(n)) {
    for (uint32_t s = 0; s < draw_->samples; ++s) rejected_ += uint32_t(std::popcount(masks[s]));
    return;
  }
  if (writes_) visibility_.otherWrote(n);
  if (!record_ && !(record_ = row_.makeRecord(*primitive_, *draw_))) return;
  row_.add(x, y, masks, record_, false);
}

void TileWorker::takeCounters(PassCounters& c) {
  raster::VisibilityCounters& v = visibility_.counters;
  c.quads += row_.quads;
  c.fragmentsCovered += row_.fragments + v.fragments;
  c.fragmentsShaded += row_.shaded;
  c.samplesTested += row_.tested + v.tested;
  c.samplesPassed += row_.passed + v.passed;
  c.samplesRejected += rejected_ + v.rejected;
  c.samplesHidden += v.hidden;
  c.bytesCleared += cleared_;
  c.bytesLoaded += loaded_;
  c.bytesStored += stored_;
  c.blocksOneColor += colors_.kept;
  c.blocksSplit += colors_.splits;
  c.blocksStored += colors_.stored;
  colors_.kept = colors_.splits = colors_.stored = 0;
  v = {};
  row_.quads = row_.fragments = row_.shaded = row_.tested = row_.passed = 0;
  rejected_ = cleared_ = loaded_ = stored_ = 0;
}

}  // namespace pumice::pipeline
