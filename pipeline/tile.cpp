#include "pipeline/tile.h"

#include <algorithm>
#include <atomic>
#include <bit>

namespace pumice::pipeline {

namespace {

constexpr uint32_t kTileMask = raster::kTileSize - 1;
constexpr size_t kRecordBudget = 512 * 1024;
static_assert(raster::kTileSize == raster::kGridCell && raster::kTileSize == 64, "quads are numbered 32 a row");

//! Place of a quad's lane 0 in the tile's pixels, and of the other lanes relative to it.
constexpr float kLaneX[4] = {0.5f, 1.5f, 0.5f, 1.5f}, kLaneY[4] = {0.5f, 0.5f, 1.5f, 1.5f};

}  // namespace

void TileWorker::begin() {
  layer_ = 0;
  setPlanes();
}

void TileWorker::setPlanes() {
  planesLayer_ = layer_;
  pitchCount_ = 0;
  std::fill(std::begin(planes_), std::end(planes_), interp::TilePlane{});
  const auto pitchIndex = [&](uint32_t rowElements) {
    for (uint32_t i = 0; i < pitchCount_; ++i)
      if (pitches_[i] == rowElements) return i;
    pitches_[pitchCount_] = rowElements;
    return pitchCount_++;
  };
  const auto put = [&](const AttachmentPlane& p, uint32_t first) {
    if (!p.base) return;
    const uint32_t* elements = elements_[pitchIndex(p.rowElements)];
    for (uint32_t s = 0; s < pass_.samples; ++s) planes_[first + s] = {p.base + layer_ * p.layerPitch + s * p.samplePitch, elements};
  };
  for (uint32_t a = 0; a < kMaxColorAttachments; ++a) put(pass_.colorPlanes[a], colorPlane(a, 0, pass_.samples));
  put(pass_.depth, depthPlane(0, pass_.samples));
  put(pass_.stencil, stencilPlane(0, pass_.samples));
}

void TileWorker::loadOps(const VkRect2D& rect) {
  const PassBegin& p = pass_.pass;
  for (uint32_t a = 0; a < p.colorCount; ++a)
    if (p.color[a].memory.layout && p.color[a].loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR)
      fillAttachment(p.color[a], VK_IMAGE_ASPECT_COLOR_BIT, layer_, 1, rect, p.color[a].clear);
  const Attachment& d = p.depthStencil;
  if (!d.memory.layout) return;
  if (pass_.depth.base && d.loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR) fillAttachment(d, VK_IMAGE_ASPECT_DEPTH_BIT, layer_, 1, rect, d.clear);
  if (pass_.stencil.base && d.stencilLoadOp == VK_ATTACHMENT_LOAD_OP_CLEAR)
    fillAttachment(d, VK_IMAGE_ASPECT_STENCIL_BIT, layer_, 1, rect, d.clear);
}

// What the operations of this tile's attachments move: nothing for DONT_CARE and NONE, nor where no draw reaches.
void TileWorker::countBytes(const VkRect2D& rect) {
  const uint32_t grid = pass_.bins->grid().tilesX * pass_.bins->grid().tilesY;
  const bool drawn = !pass_.bins->tile(layer_ * grid + tileY_ * pass_.bins->grid().tilesX + tileX_).empty();
  const auto count = [&](const Attachment& a, VkImageAspectFlagBits aspect, VkAttachmentLoadOp load, VkAttachmentStoreOp store) {
    const texture::FormatInfo* f = a.memory.layout ? texture::formatInfo(a.format) : nullptr;
    if (!f || !(f->aspects() & aspect)) return;
    const uint64_t bytes = uint64_t(rect.extent.width) * rect.extent.height * a.memory.layout->plane(aspect).elementBytes * pass_.samples;
    if (load == VK_ATTACHMENT_LOAD_OP_CLEAR && !pass_.loaded) cleared += bytes;
    if ((load == VK_ATTACHMENT_LOAD_OP_LOAD || pass_.loaded) && drawn) loaded += bytes;
    if (store == VK_ATTACHMENT_STORE_OP_STORE) stored += bytes;
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
  if (layer_ != planesLayer_) setPlanes();
  const VkRect2D tileRect{{int32_t(tileX_ * raster::kTileSize), int32_t(tileY_ * raster::kTileSize)}, {raster::kTileSize, raster::kTileSize}};
  const VkRect2D rect = intersect(pass_.pass.renderArea, tileRect);
  if (!pass_.loaded && !isEmpty(rect)) loadOps(rect);
  if (pass_.statistics) countBytes(rect);

  for (const raster::BinEntry& entry : pass_.bins->tile(index)) {
    DrawRecord* draw = pass_.draws[entry.draw].get();
    if (draw != draw_) setDraw(draw);
    if (draw->isClear) {
      const VkRect2D r = intersect(rect, draw->rect);
      const VkClearAttachment& c = draw->clear;
      if (isEmpty(r)) continue;
      if (c.aspectMask & VK_IMAGE_ASPECT_COLOR_BIT)
        fillAttachment(pass_.pass.color[c.colorAttachment], VK_IMAGE_ASPECT_COLOR_BIT, layer_, 1, r, c.clearValue);
      for (VkImageAspectFlags aspect : {VK_IMAGE_ASPECT_DEPTH_BIT, VK_IMAGE_ASPECT_STENCIL_BIT})
        if (c.aspectMask & aspect)
          fillAttachment(pass_.pass.depthStencil, aspect, layer_, 1, r, c.clearValue);
      continue;
    }
    primitive_ = entry.primitive;
    record_ = nullptr;
    raster::rasterize(*primitive_, tileX_, tileY_, pass_.pass.renderArea, draw->constants.samples, *this);
  }
  setDraw(nullptr);
  records_.reset();
  recordBytes_ = 0;
}

void TileWorker::setDraw(DrawRecord* draw) {
  flushQuads();
  if (draw_ && draw_->occlusion && occluded_) {
    std::atomic_ref<uint64_t>(*draw_->occlusion).fetch_add(occluded_, std::memory_order_relaxed);
    occluded_ = 0;
  }
  if (draw_ && draw_->query && invocations_)
    std::atomic_ref<uint64_t>(draw_->query->values[PipelineStatistics::FragmentInvocations]).fetch_add(invocations_, std::memory_order_relaxed);
  invocations_ = 0;
  draw_ = draw;
  primitive_ = nullptr;
  record_ = nullptr;
}

void TileWorker::block(uint32_t x, uint32_t y, const uint16_t* masks) {
  const uint32_t samples = draw_->constants.samples;
  uint32_t any = masks[0];
  for (uint32_t s = 1; s < samples; ++s) any |= masks[s];
  for (uint32_t q = 0; q < 4; ++q) {
    const uint32_t lanes = any >> (4 * q) & 15;
    if (!lanes) continue;
    const uint32_t qx = x + (q & 1) * 2, qy = y + (q >> 1) * 2;
    const uint32_t position = ((qy & kTileMask) >> 1) * 32 + ((qx & kTileMask) >> 1);
    // Order per pixel: within a row nothing runs before anything else, so a quad may be there only once.
    if (count_ == kQuads || (pending_[position >> 6] >> (position & 63) & 1)) flushQuads();
    if (!record_) {
      const auto& varyings = draw_->fragment->varyings;
      const size_t bytes = raster::recordBytes(uint32_t(varyings.size()));
      if (recordBytes_ + bytes > kRecordBudget) {
        flushQuads();
        records_.reset();
        recordBytes_ = 0;
      }
      std::byte* fresh = static_cast<std::byte*>(records_.allocBytes(bytes, 16));
      if (!fresh) return;
      recordBytes_ += bytes;
      raster::fillRecord(*primitive_, varyings, tileX_ * raster::kGridCell, tileY_ * raster::kGridCell, fresh,
                         draw_->depthRanges[primitive_->viewport]);
      record_ = fresh;
    }
    const uint32_t n = count_++, lane = n * 4;
    pending_[position >> 6] |= uint64_t(1) << (position & 63);
    position_[n] = uint16_t(position);
    quadRecords_[n] = record_;
    active_[n >> 4] |= uint64_t(draw_->fragment->needsHelpers ? 15 : lanes) << (lane & 63);
    const float fx = float(qx & kTileMask), fy = float(qy & kTileMask);
    for (uint32_t l = 0; l < 4; ++l) {
      x_[lane + l] = fx + kLaneX[l];
      y_[lane + l] = fy + kLaneY[l];
      uint32_t c = 0;
      for (uint32_t s = 0; s < samples; ++s) c |= uint32_t(masks[s] >> (4 * q + l) & 1) << s;
      coverage_[lane + l] = c;
    }
    for (uint32_t p = 0; p < pitchCount_; ++p) elements_[p][n] = (y >> 2) * pitches_[p] + (x >> 2) * 16 + q * 4;
  }
}

void TileWorker::flushQuads() {
  if (!count_) return;
  interp::ExecContext context;
  context.lanes = count_ * 4;
  std::copy(std::begin(active_), std::end(active_), context.active);
  context.tables = draw_->tables;
  for (uint32_t n = count_; n < kQuads; ++n) quadRecords_[n] = quadRecords_[0];
  context.quadRecords = quadRecords_;
  context.tilePlanes = planes_;
  context.stop = &pass_.pool.cancelled();
  quads += count_;
  if (pass_.statistics)
    for (uint32_t l = 0; l < context.lanes; ++l) tested += uint64_t(std::popcount(coverage_[l]));
  if (draw_->fragment->perSample) {
    runPerSample(context);
  } else {
    const void* inputs[3] = {x_, y_, coverage_};
    context.inputs = inputs;
    run(context);
  }
  for (uint32_t n = 0; n < count_; ++n) pending_[position_[n] >> 6] &= ~(uint64_t(1) << (position_[n] & 63));
  std::fill(std::begin(active_), std::end(active_), 0);
  count_ = 0;
}

void TileWorker::run(interp::ExecContext& context) {
  void* outputs[2] = {passedRow_, shadedRow_};
  context.outputs = outputs;
  draw_->fragment->code->run(draw_->bank, context);
  for (uint64_t a : context.active) fragments += uint64_t(std::popcount(a));
  const bool countShaded = pass_.statistics || draw_->query;
  if (!draw_->occlusion && !countShaded) return;
  uint64_t count = 0, ran = 0;
  for (uint32_t l = 0; l < context.lanes; ++l) {
    if (!(context.active[l >> 6] >> (l & 63) & 1)) continue;
    count += uint64_t(std::popcount(passedRow_[l]));
    if (countShaded) ran += shadedRow_[l];
  }
  shaded += ran;
  if (draw_->query) invocations_ += ran;
  if (draw_->occlusion) occluded_ += count;
  passed += count;
}

// The row once for each sample, with the lanes (or quads) that the sample is covered in.
void TileWorker::runPerSample(const interp::ExecContext& row) {
  interp::ExecContext context = row;
  const uint32_t samples = draw_->constants.samples;
  const auto locations = raster::sampleLocations(samples);
  interp::TilePlane planes[interp::kMaxTilePlanes];
  context.tilePlanes = planes;
  const void* inputs[6] = {sampleX_, sampleY_, coverage_, sampleNumber_, x_, y_};
  context.inputs = inputs;
  for (uint32_t s = 0; s < samples; ++s) {
    uint64_t any = 0;
    std::fill(std::begin(context.active), std::end(context.active), 0);
    for (uint32_t l = 0; l < context.lanes; ++l) {
      const uint64_t covered = coverage_[l] >> s & 1;
      context.active[l >> 6] |= covered << (l & 63);
      any |= covered;
    }
    if (!any) continue;
    if (draw_->fragment->needsHelpers)
      for (uint64_t& a : context.active) {
        a |= a >> 1;
        a |= a >> 2;
        a = (a & 0x1111111111111111u) * 15;
      }
    for (uint32_t plane = 0; plane <= stencilPlane(0, samples); plane += samples) planes[plane] = planes_[plane + s];
    for (uint32_t l = 0; l < context.lanes; ++l) {
      sampleX_[l] = x_[l] + (float(locations[s][0]) / 16.f - 0.5f);
      sampleY_[l] = y_[l] + (float(locations[s][1]) / 16.f - 0.5f);
      sampleNumber_[l] = s;
    }
    run(context);
  }
}

}  // namespace pumice::pipeline
