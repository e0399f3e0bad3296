// A render pass: draws are collected (draw.cpp), then tiles are finished (tile.cpp).
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <mutex>

#include "base/arena_slices.h"
#include "base/env.h"
#include "base/fpenv.h"
#include "base/log.h"
#include "pipeline/front.h"
#include "pipeline/tile.h"
#include "spirv_interp/jit/jit.h"
#include "texture/cleared.h"

namespace pumice::pipeline {

VkRect2D intersect(const VkRect2D& a, const VkRect2D& b) {
  const int64_t x0 = std::max<int64_t>(a.offset.x, b.offset.x), y0 = std::max<int64_t>(a.offset.y, b.offset.y);
  const int64_t x1 = std::min(int64_t(a.offset.x) + a.extent.width, int64_t(b.offset.x) + b.extent.width);
  const int64_t y1 = std::min(int64_t(a.offset.y) + a.extent.height, int64_t(b.offset.y) + b.extent.height);
  if (x0 >= x1 || y0 >= y1) return {};
  return {{int32_t(x0), int32_t(y0)}, {uint32_t(x1 - x0), uint32_t(y1 - y0)}};
}

namespace {

AttachmentPlane planeOf(const Attachment& a, VkImageAspectFlags aspect) {
  AttachmentPlane p;
  const texture::ImageLayout* layout = a.memory.layout;
  const texture::FormatInfo* format = layout ? texture::formatInfo(a.format) : nullptr;
  if (!format || !(format->aspects() & aspect) || !layout->tiled || a.level >= texture::kMaxLevels) return p;
  const texture::PlaneLayout& plane = layout->plane(aspect);
  const texture::LevelLayout& level = plane.levels[a.level];
  const bool slices = layout->type == VK_IMAGE_TYPE_3D;
  p.layerPitch = slices ? level.slicePitch : plane.layerPitch;
  p.base = a.memory.base + plane.offset + level.offset + p.layerPitch * a.baseLayer;
  p.samplePitch = plane.samplePitch;
  p.rowElements = uint32_t(level.rowPitch / plane.elementBytes);
  p.elementBytes = plane.elementBytes;
  return p;
}

}  // namespace

void fillAttachment(const Attachment& a, VkImageAspectFlags aspect, uint32_t baseLayer, uint32_t layerCount, const VkRect2D& rect,
                    const VkClearValue& value) {
  const texture::FormatInfo* format = a.memory.layout ? texture::formatInfo(a.format) : nullptr;
  if (!format || !(format->aspects() & aspect)) return;
  std::byte element[32];
  texture::packClearValue(*format, aspect, value, element);
  fillAttachment(a, aspect, baseLayer, layerCount, rect, element);
}

void fillAttachment(const Attachment& a, VkImageAspectFlags aspect, uint32_t baseLayer, uint32_t layerCount, const VkRect2D& rect,
                    const std::byte* element, uint32_t samples) {
  if (!a.memory.layout || baseLayer >= a.layerCount) return;
  const bool slices = a.memory.layout->type == VK_IMAGE_TYPE_3D;   // a view's layers are the image's depth slices
  for (uint32_t l = baseLayer; l < baseLayer + std::min(layerCount, a.layerCount - baseLayer); ++l)
    texture::fillRect(a.memory, aspect, a.level, slices ? 0 : a.baseLayer + l, slices ? a.baseLayer + l : 0, rect, element, samples);
}

namespace {

std::optional<raster::DepthKind> kindOf(VkFormat format) {
  const texture::FormatInfo* f = texture::formatInfo(format);
  if (!f) return std::nullopt;
  const texture::Component& c = f->rgba[0];
  if (c.numeric == texture::Numeric::Sfloat && c.bits == 32) return raster::DepthKind::Float32;
  if (c.numeric != texture::Numeric::Unorm) return std::nullopt;
  if (c.bits == 16) return raster::DepthKind::Unorm16;
  if (c.bits == 24) return raster::DepthKind::Unorm24;
  return std::nullopt;
}

}  // namespace

PassExecutor::Impl::Impl(base::ThreadPool& threads) : pool(threads), stats(base::envFlag(base::EnvVar::Stats, false)) {
  waiting = std::make_unique<FrontQueue>();
  for (unsigned i = 0; i < pool.workerCount(); ++i) front.push_back(std::make_unique<FrontWorker>());
  disable(disabledIdeas());
}
PassExecutor::Impl::~Impl() {
  front.clear();
  clearArena.release();
  base::trimArenaSlices();
}

void PassExecutor::Impl::disable(Ideas ideas) {
  disabled = ideas;
  tileWorkers.clear();
  for (unsigned i = 0; i < pool.workerCount(); ++i) tileWorkers.push_back(std::make_unique<TileWorker>(*this, ideas));
}

void PassExecutor::Impl::begin(const PassBegin& given) {
  pass = given;
  pass.renderArea = intersect(pass.renderArea, {{0, 0}, {pass.width, pass.height}});
  open = true;
  loaded = false;
  occlusion = nullptr;
  query = nullptr;
  counters = {};
  statistics = collect || stats;
  samples = 1;
  for (uint32_t a = 0; a < kMaxColorAttachments; ++a) {
    if (a >= pass.colorCount) pass.color[a] = pass.resolve[a] = {};
    colorPlanes[a] = planeOf(pass.color[a], VK_IMAGE_ASPECT_COLOR_BIT);
    if (pass.color[a].memory.layout) samples = pass.color[a].memory.layout->samples;
    const texture::FormatInfo* format = pass.color[a].memory.layout ? texture::formatInfo(pass.color[a].format) : nullptr;
    if (format && pass.color[a].loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR)
      texture::packClearValue(*format, VK_IMAGE_ASPECT_COLOR_BIT, pass.color[a].clear, clearElements[a]);
  }
  depth = planeOf(pass.depthStencil, VK_IMAGE_ASPECT_DEPTH_BIT);
  depthKind = depth.base ? kindOf(pass.depthStencil.format) : std::nullopt;
  if (depthKind && pass.depthStencil.memory.layout->plane(VK_IMAGE_ASPECT_DEPTH_BIT).elementBytes != raster::depthBytes(*depthKind)) depthKind.reset();
  if (depthKind && pass.depthStencil.loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR) {
    std::byte element[32] = {};
    texture::packClearValue(*texture::formatInfo(pass.depthStencil.format), VK_IMAGE_ASPECT_DEPTH_BIT, pass.depthStencil.clear, element);
    clearDepth = 0;
    std::memcpy(&clearDepth, element, raster::depthBytes(*depthKind));
  }
  stencil = planeOf(pass.depthStencil, VK_IMAGE_ASPECT_STENCIL_BIT);
  if (pass.depthStencil.memory.layout) samples = pass.depthStencil.memory.layout->samples;
  pass.layers = std::max(pass.layers, 1u);
  for (uint32_t a = 0; a < pass.colorCount; ++a)
    if (pass.color[a].memory.layout) pass.layers = std::min(pass.layers, pass.color[a].layerCount);
  if (pass.depthStencil.memory.layout) pass.layers = std::min(pass.layers, pass.depthStencil.layerCount);
  decisions = {};
  decisionRecord = {};
  beginCleared();
  const raster::TileGrid grid(pass.width, pass.height, pass.layers);
  if (!bins || bins->grid() != grid) bins.emplace(grid);
  beginOneColor();
  draws.clear();
  waiting->clear(false);
  forgetPrimitives();
}

// Where the whole image is cleared, tiles without draws need no more than a mark. All other passes find everything in memory.
void PassExecutor::Impl::beginCleared() {
  static_assert(texture::ClearedTiles::kEdge == raster::kTileSize);
  marked = 0;
  for (uint32_t a = 0; a < pass.colorCount; ++a) {
    if (pass.resolve[a].memory.layout) texture::writeCleared(pass.resolve[a].memory);
    const Attachment& c = pass.color[a];
    texture::ClearedTiles* cleared = c.memory.layout ? c.memory.cleared : nullptr;
    if (!cleared) continue;
    const texture::LevelLayout& level = c.memory.layout->planes[0].levels[0];
    const VkRect2D& area = pass.renderArea;
    const bool whole = !area.offset.x && !area.offset.y && area.extent.width == level.width && area.extent.height == level.height;
    if (c.loadOp != VK_ATTACHMENT_LOAD_OP_CLEAR || !whole || statistics || (disabled & bit(Idea::LazyClear))) {
      texture::writeCleared(c.memory);
      continue;
    }
    std::fill(cleared->marks.begin(), cleared->marks.end(), 0);
    std::memcpy(cleared->element, clearElements[a], sizeof cleared->element);
    marked |= 1u << a;
  }
}

void PassExecutor::Impl::clear(const VkClearAttachment& attachment, const VkClearRect& rect) {
  if (!open) return;
  if ((attachment.aspectMask & VK_IMAGE_ASPECT_COLOR_BIT) && attachment.colorAttachment >= pass.colorCount) return;
  const VkRect2D area = intersect(rect.rect, pass.renderArea);
  if (isEmpty(area)) return;
  runFront();
  DrawRecord& record = draws.add();
  record.isClear = true;
  record.clear = attachment;
  record.rect = area;
  // A primitive without edges that reaches every tile of the rectangle puts the clear in its place among the draws.
  raster::Primitive p;
  p.edgeCount = 0;
  p.minX = area.offset.x;
  p.minY = area.offset.y;
  p.maxX = p.minX + int32_t(area.extent.width) - 1;
  p.maxY = p.minY + int32_t(area.extent.height) - 1;
  p.minZ = p.maxZ = 0;
  collected += sizeof(DrawRecord);
  for (uint32_t l = 0; l < rect.layerCount && rect.baseArrayLayer + l < pass.layers; ++l) {
    p.layer = uint16_t(rect.baseArrayLayer + l);
    const raster::Primitive* kept = clearArena.copy(std::span<const raster::Primitive>(&p, 1)).data();
    if (!kept) {
      base::logError("clear left out: memory is exhausted");
      return;
    }
    bins->add(uint32_t(draws.size() - 1), *kept);
    collected += sizeof p;
  }
}

void PassExecutor::Impl::forgetPrimitives() {
  if (bins) bins->clear();
  const auto empty = [](base::Arena& a) {
    if (a.footprint() > kArenaKept) a.release();
    else a.reset();
  };
  for (auto& w : front) empty(w->arena);
  empty(clearArena);
  collected = 0;
}

//! The load operations of `count` tiles side by side.
void PassExecutor::Impl::clearTiles(uint32_t first, uint32_t count) {
  const raster::TileGrid& grid = bins->grid();
  const uint32_t x = first % grid.tilesX, y = first / grid.tilesX % grid.tilesY, layer = first / (grid.tilesX * grid.tilesY);
  const VkRect2D rect = intersect(pass.renderArea, {{int32_t(x * raster::kTileSize), int32_t(y * raster::kTileSize)},
                                                    {count * raster::kTileSize, raster::kTileSize}});
  for (uint32_t a = 0; a < pass.colorCount; ++a) {
    if (!pass.color[a].memory.layout || pass.color[a].loadOp != VK_ATTACHMENT_LOAD_OP_CLEAR) continue;
    if (!(marked >> a & 1)) clearColor(a, layer, rect, clearElements[a]);
    else std::fill_n(&pass.color[a].memory.cleared->mark(x, y), count, 1);
  }
  const Attachment& d = pass.depthStencil;
  if (depth.base && d.loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR && keepsDepth()) fillAttachment(d, VK_IMAGE_ASPECT_DEPTH_BIT, layer, 1, rect, d.clear);
  if (stencil.base && d.stencilLoadOp == VK_ATTACHMENT_LOAD_OP_CLEAR) fillAttachment(d, VK_IMAGE_ASPECT_STENCIL_BIT, layer, 1, rect, d.clear);
}

//! At most so many bytes are written by the load operations.
uint64_t PassExecutor::Impl::clearedBytes() const {
  const uint64_t elements = uint64_t(pass.renderArea.extent.width) * pass.renderArea.extent.height * samples * pass.layers;
  uint64_t bytes = 0;
  const auto count = [&](const Attachment& a) {
    for (uint32_t p = 0; a.memory.layout && p < a.memory.layout->planeCount; ++p) bytes += elements * a.memory.layout->planes[p].elementBytes;
  };
  for (uint32_t a = 0; a < pass.colorCount; ++a) count(pass.color[a]);
  count(pass.depthStencil);
  return bytes;
}

void PassExecutor::Impl::flush(bool isLast) {
  runFront();
  last = isLast;
  bool clears = false;
  if (!loaded) {
    for (uint32_t a = 0; a < pass.colorCount; ++a)
      clears |= pass.color[a].memory.layout && pass.color[a].loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR;
    const Attachment& d = pass.depthStencil;
    clears |= depth.base && d.loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR;
    clears |= stencil.base && d.stencilLoadOp == VK_ATTACHMENT_LOAD_OP_CLEAR;
  }
  // Tiles; and runs of tiles side by side that are only cleared, as one.
  enum class Kind { Tile, OnlyClears, OnlyFinish };
  struct Work {
    uint32_t tile, count;
    Kind kind;
  };
  std::vector<Work> work;
  uint64_t tiles = 0;
  const bool merge = clears && !statistics && !(disabled & bit(Idea::LazyClear));
  const bool finish = last && oneColor;   // at the end: resolves and stores
  const raster::TileGrid grid = bins->grid();
  const VkRect2D& area = pass.renderArea;
  if (!isEmpty(area)) {
    const uint32_t x0 = uint32_t(area.offset.x) / raster::kTileSize, x1 = (uint32_t(area.offset.x) + area.extent.width - 1) / raster::kTileSize;
    const uint32_t y0 = uint32_t(area.offset.y) / raster::kTileSize, y1 = (uint32_t(area.offset.y) + area.extent.height - 1) / raster::kTileSize;
    for (uint32_t l = 0; l < grid.layers; ++l)
      for (uint32_t y = y0; y <= y1 && y < grid.tilesY; ++y)
        for (uint32_t x = x0; x <= x1 && x < grid.tilesX; ++x) {
          const uint32_t tile = (l * grid.tilesY + y) * grid.tilesX + x;
          const bool empty = bins->tile(tile).empty();
          if (empty && !clears && !finish) continue;
          if (!empty || clears) ++tiles;
          const Kind kind = !empty ? Kind::Tile : !clears ? Kind::OnlyFinish : merge ? Kind::OnlyClears : Kind::Tile;
          if (kind != Kind::Tile && x > x0 && work.back().kind == kind) ++work.back().count;
          else work.push_back({tile, 1, kind});
        }
  }
  const auto run = [&](uint32_t i, unsigned worker) {
    const Work& w = work[i];
    if (w.kind == Kind::OnlyClears) clearTiles(w.tile, w.count);
    if (w.kind == Kind::Tile) tileWorkers[worker]->tile(w.tile);
    for (uint32_t t = w.tile; finish && t < w.tile + w.count; ++t) tileWorkers[worker]->finish(t);
  };
  // To wake another thread for a clear of a few megabytes costs more than it saves.
  constexpr uint64_t kAloneBytes = 4 * 1024 * 1024;
  if (!work.empty() && std::all_of(work.begin(), work.end(), [](const Work& w) { return w.kind == Kind::OnlyClears; }) && clearedBytes() <= kAloneBytes) {
    for (uint32_t i = 0; i < work.size(); ++i) run(i, 0);
  } else if (!work.empty()) {
    for (auto& w : tileWorkers) w->begin();
    pool.parallelFor(uint32_t(work.size()), run);
  }
  counters.tilesTouched += tiles;
  loaded = true;
  draws.keepLast();
  forgetPrimitives();
}

VkImageResolve PassExecutor::Impl::resolveRegion(const Attachment& src, const Attachment& dst) const {
  VkImageResolve r{};
  r.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, src.level, src.baseLayer, pass.layers};
  r.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, dst.level, dst.baseLayer, pass.layers};
  r.srcOffset = r.dstOffset = {pass.renderArea.offset.x, pass.renderArea.offset.y, 0};
  r.extent = {pass.renderArea.extent.width, pass.renderArea.extent.height, 1};
  return r;
}

void PassExecutor::Impl::resolve() {
  for (uint32_t a = 0; a < pass.colorCount; ++a) {
    const Attachment &src = pass.color[a], &dst = pass.resolve[a];
    if (!src.memory.layout || !dst.memory.layout || isEmpty(pass.renderArea) || blockResolves[a]) continue;   // those are done tile by tile
    texture::resolveImage(pool, src.memory, dst.memory, resolveRegion(src, dst));
  }
  const Attachment &src = pass.depthStencil, &dst = pass.depthStencilResolve;
  if (!src.memory.layout || !dst.memory.layout || isEmpty(pass.renderArea)) return;
  const VkImageResolve r = resolveRegion(src, dst);
  // A resolve overwrites all that a clear before it would have written; an aspect that is not resolved is only cleared.
  const auto finish = [&](VkImageAspectFlagBits aspect, VkResolveModeFlagBits mode, VkAttachmentLoadOp loadOp) {
    if (mode != VK_RESOLVE_MODE_NONE) texture::resolveDepthStencil(pool, src.memory, dst.memory, aspect, mode, r);
    else if (loadOp == VK_ATTACHMENT_LOAD_OP_CLEAR) fillAttachment(dst, aspect, 0, pass.layers, pass.renderArea, dst.clear);
  };
  finish(VK_IMAGE_ASPECT_DEPTH_BIT, pass.depthResolve, dst.loadOp);
  finish(VK_IMAGE_ASPECT_STENCIL_BIT, pass.stencilResolve, dst.stencilLoadOp);
}

// Memory for the record, when the first draw that keeps one comes: 4x4 blocks, whole tiles.
void PassExecutor::Impl::beginDecisions() {
  if (decisions.base) return;
  const raster::TileGrid& grid = bins->grid();
  const size_t words = size_t(grid.tilesX) * grid.tilesY * raster::kTileSize * raster::kTileSize;
  decisionWords.assign(words * pass.layers * samples, 0);
  decisions.base = reinterpret_cast<std::byte*>(decisionWords.data());
  decisions.rowElements = grid.tilesX * raster::kTileSize * 4;
  decisions.elementBytes = 4;
  decisions.samplePitch = words * 4;
  decisions.layerPitch = words * samples * 4;
}

void PassExecutor::Impl::endDecisions() {
  if (!decisions.base) return;
  DecisionRecord r{pass.width, pass.height, pass.layers, samples, {}};
  r.words.reserve(size_t(r.width) * r.height * r.layers * r.samples);
  const size_t planeWords = decisions.samplePitch / 4;
  for (uint32_t plane = 0; plane < r.layers * r.samples; ++plane)
    for (uint32_t y = 0; y < r.height; ++y)
      for (uint32_t x = 0; x < r.width; ++x)
        r.words.push_back(decisionWords[planeWords * plane + size_t(y / 4) * decisions.rowElements + x / 4 * 16 + texture::blockIndex(x & 3, y & 3)]);
  decisions = {};
  decisionWords = {};
  keepDecisions(r);
  decisionRecord = std::move(r);
}

void PassExecutor::Impl::end() {
  if (!open) return;
  const base::ScopedFpEnv environment;
  flush(true);
  resolve();
  endDecisions();
  open = false;
  draws.clear();
  waiting->shrink();
  for (auto& w : front) {
    const raster::SetupCounters& s = w->setup;
    counters.setup.input += s.input;
    counters.setup.clippedAway += s.clippedAway;
    counters.setup.culledFace += s.culledFace;
    counters.setup.culledZeroArea += s.culledZeroArea;
    counters.setup.culledOutside += s.culledOutside;
    counters.setup.culledNoSample += s.culledNoSample;
    counters.setup.output += s.output;
    counters.verticesShaded += w->shaded;
    counters.verticesReused += w->reused;
    w->setup = {};
    w->shaded = w->reused = 0;
  }
  for (auto& w : tileWorkers) w->takeCounters(counters);
  if (stats) printCounters();
}

namespace {
//! Routines compiled since the last time, all queues together.
void printCompiled() {
  static std::mutex mutex;
  static jit::Statistics before;
  static RoutineCounts routinesBefore;
  static uint64_t shadersBefore = 0;
  std::lock_guard lock(mutex);
  const RoutineCounts routines = routineCounts();
  const uint64_t shaders = frontend::translations();
  const auto n = [](uint64_t v) { return static_cast<unsigned long long>(v); };
  if (const uint64_t translated = shaders - shadersBefore, linked = routines.linked - routinesBefore.linked, restored = routines.restored - routinesBefore.restored;
      translated || linked || restored)
    std::fprintf(stderr, "pumice: stats: %llu shaders translated, %llu routines linked and optimised, %llu taken from a pipeline cache\n", n(translated), n(linked), n(restored));
  shadersBefore = shaders;
  routinesBefore = routines;
  const jit::Statistics now = jit::statistics();
  if (const uint64_t made = now.emitted - before.emitted, left = now.refused - before.refused; made || left)
    std::fprintf(stderr, "pumice: stats: %llu routines emitted (%llu operations, %llu by call, %.2f microseconds of processor time each), %llu left to the interpreter\n", static_cast<unsigned long long>(made),
                 static_cast<unsigned long long>(now.operations - before.operations), static_cast<unsigned long long>(now.callOuts - before.callOuts),
                 double(now.nanoseconds - before.nanoseconds) * 1e-3 / double(std::max<uint64_t>(1, now.operations - before.operations)),
                 static_cast<unsigned long long>(left));
  before = now;
}
}  // namespace

void PassExecutor::Impl::printCounters() const {
  printCompiled();
  const PassCounters& c = counters;
  const auto n = [](uint64_t v) { return static_cast<unsigned long long>(v); };
  std::fprintf(stderr,
               "pumice: stats: pass %ux%u: %llu draws, %llu vertices (%llu reused), %llu primitives of %llu (clipped %llu, facing away %llu, "
               "no area %llu, outside %llu, no sample %llu), %llu tiles, %llu quads, %llu fragments, %llu shaded, %llu samples (%llu failed, %llu of them by Hi-Z, %llu hidden before they were shaded), "
               "%llu varyings (%llu dropped), bytes cleared %llu, loaded %llu, stored %llu",
               pass.width, pass.height, n(c.draws), n(c.verticesShaded), n(c.verticesReused), n(c.primitives), n(c.setup.input),
               n(c.setup.clippedAway), n(c.setup.culledFace), n(c.setup.culledZeroArea), n(c.setup.culledOutside), n(c.setup.culledNoSample),
               n(c.tilesTouched), n(c.quads), n(c.fragmentsCovered), n(c.fragmentsShaded), n(c.samplesTested),
               n(c.samplesTested - c.samplesPassed), n(c.samplesRejected), n(c.samplesHidden), n(c.varyingsInterpolated), n(c.varyingsDropped), n(c.bytesCleared), n(c.bytesLoaded),
               n(c.bytesStored));
  if (oneColor)
    std::fprintf(stderr, "; %u samples: %llu blocks of one colour (%llu of them written to all samples at the end), %llu split", samples, n(c.blocksOneColor),
                 n(c.blocksStored), n(c.blocksSplit));
  std::fputc('\n', stderr);
}

PassExecutor::PassExecutor(base::ThreadPool& pool) : impl_(std::make_unique<Impl>(pool)) {}
PassExecutor::~PassExecutor() = default;
void PassExecutor::begin(const PassBegin& pass) { impl_->begin(pass); }
void PassExecutor::draw(const DrawState& state, const DrawParams& params) { impl_->draw(state, params); }
void PassExecutor::clear(const VkClearAttachment& attachment, const VkClearRect& rect) { impl_->clear(attachment, rect); }
void PassExecutor::beginOcclusion(uint64_t* counter) { impl_->occlusion = counter; }
void PassExecutor::endOcclusion() { impl_->occlusion = nullptr; }
void PassExecutor::beginStatistics(PipelineStatistics* to) { impl_->query = to; }
void PassExecutor::endStatistics() { impl_->query = nullptr; }
void PassExecutor::end() { impl_->end(); }
void PassExecutor::collectStatistics(bool on) { impl_->collect = on; }
void PassExecutor::disable(uint32_t ideas) { impl_->disable(ideas); }
const DecisionRecord& PassExecutor::decisions() const { return impl_->decisionRecord; }
const PassCounters& PassExecutor::counters() const { return impl_->counters; }

}  // namespace pumice::pipeline
