// The front end: from a draw command to bins. Work is cut into chunks of primitives, each with its own vertices; chunks
// run in parallel and are binned in order, so the picture does not depend on the number of threads.
#include <algorithm>
#include <bit>

#include "base/fpenv.h"
#include "base/log.h"
#include "pipeline/front.h"
#include "pipeline/one_color.h"

namespace pumice::pipeline {

namespace {

// What is worked on at a time, by all threads: so many chunks if they are large, and more if they are small. Then comes a look at the
// memory budget.
constexpr uint32_t kWaveChunks = 64, kMostWaveChunks = 1024;
constexpr uint64_t kWavePrimitives = 4096;

//! Primitives of a run of `vertices` consecutive vertices.
uint32_t primitiveCount(VkPrimitiveTopology t, uint32_t vertices) {
  switch (t) {
    case VK_PRIMITIVE_TOPOLOGY_POINT_LIST: return vertices;
    case VK_PRIMITIVE_TOPOLOGY_LINE_LIST: return vertices / 2;
    case VK_PRIMITIVE_TOPOLOGY_LINE_STRIP: return vertices < 2 ? 0 : vertices - 1;
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST: return vertices / 3;
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP:
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN: return vertices < 3 ? 0 : vertices - 2;
    default: return 0;
  }
}

uint32_t indexBytes(VkIndexType t) {
  return t == VK_INDEX_TYPE_UINT32 ? 4 : t == VK_INDEX_TYPE_UINT16 ? 2 : t == VK_INDEX_TYPE_UINT8_EXT ? 1 : 0;
}

std::vector<Run> findRuns(const GraphicsState& state, const Indices& indices, uint32_t count) {
  std::vector<Run> runs;
  uint32_t id = 0;
  const auto add = [&](uint32_t start, uint32_t end) {
    const uint32_t n = primitiveCount(state.topology, end - start);
    if (n) runs.push_back({start, n, id});
    id += n;
  };
  if (!indices.bytes || !state.primitiveRestart) {
    add(0, count);
    return runs;
  }
  uint32_t start = 0;
  for (uint32_t i = 0; i < count; ++i)
    if (indices.raw(i) == indices.restart()) {
      add(start, i);
      start = i + 1;
    }
  add(start, count);
  return runs;
}

//! Hands out the draw's chunks in order.
class ChunkSource {
 public:
  ChunkSource(const std::vector<Run>& runs, uint32_t instances) : runs_(runs), instances_(runs.empty() ? 0 : instances) {}
  bool done() const { return instance_ >= instances_; }
  Chunk next() {
    Chunk c;
    uint32_t room = kChunkPrimitives;
    while (room && !done()) {
      const Run& r = runs_[run_];
      uint32_t n = std::min(room, r.primitives - taken_);
      if (n < r.primitives - taken_) n &= ~1u;   // the rest of a strip must start with the first one's winding
      if (!n) break;
      c.segments.push_back({instance_, r.start, taken_, n, r.primitiveId + taken_});
      room -= n;
      taken_ += n;
      if (taken_ < r.primitives) continue;
      taken_ = 0;
      if (++run_ < runs_.size()) continue;
      run_ = 0;
      ++instance_;
    }
    return c;
  }

 private:
  const std::vector<Run>& runs_;
  uint32_t instances_, instance_ = 0, taken_ = 0;
  size_t run_ = 0;
};

}  // namespace

void FrontDraw::prepare(base::Arena* arena) {
  prepared = true;
  bank = vertex->code->preamble(tables.data());
  if (record->fragment) record->bank = record->fragment->code->preamble(record->tables, arena);
}

//! Runs the vertex routine over the worker's list of vertices; null if memory is exhausted. T: what its rows hold.
template <typename T>
T* const* FrontDraw::shade(FrontWorker& w) const {
  const uint32_t count = uint32_t(w.vertexIndex.size());
  const uint32_t padded = (count + interp::kMaxLanes - 1) / interp::kMaxLanes * interp::kMaxLanes;
  w.vertexIndex.resize(padded);
  w.vertexInstance.resize(padded);
  T** rows = w.scratch.alloc<T*>(vertex->rowCount);
  void** outputs = w.scratch.alloc<void*>(vertex->rowCount);
  uint32_t* inputs[2] = {w.scratch.alloc<uint32_t>(interp::kMaxLanes, 64), w.scratch.alloc<uint32_t>(interp::kMaxLanes, 64)};
  if (!rows || !outputs || !inputs[0] || !inputs[1]) return nullptr;
  for (uint32_t r = 0; r < vertex->rowCount; ++r)
    if (!(rows[r] = w.scratch.alloc<T>(padded, 64))) return nullptr;

  interp::ExecContext context;
  context.inputs = reinterpret_cast<const void* const*>(inputs);
  context.outputs = outputs;
  context.tables = tables.data();
  context.stop = stop;
  for (uint32_t at = 0; at < count; at += interp::kMaxLanes) {
    context.lanes = std::min(count - at, interp::kMaxLanes);
    for (uint32_t i = 0; i < interp::kMaxLanes / 64; ++i) {
      const uint32_t lanes = std::clamp<int64_t>(int64_t(context.lanes) - 64 * i, 0, 64);
      context.active[i] = lanes == 64 ? ~uint64_t(0) : (uint64_t(1) << lanes) - 1;
    }
    std::memcpy(inputs[0], w.vertexIndex.data() + at, interp::kMaxLanes * 4);
    std::memcpy(inputs[1], w.vertexInstance.data() + at, interp::kMaxLanes * 4);
    for (uint32_t r = 0; r < vertex->rowCount; ++r) outputs[r] = rows[r] + at;
    vertex->code->run(bank, context);
  }
  w.shaded += count;
  return rows;
}

void FrontDraw::run(FrontWorker& w, Chunk& chunk) const {
  w.scratch.reset();
  w.slots.clear();
  w.vertexIndex.clear();
  w.vertexInstance.clear();
  w.primitives.clear();
  w.table.clear();
  std::vector<uint32_t> ends;   // of the segments in slots
  for (const Segment& s : chunk.segments) {
    const Positions p = positions(s);
    if (indices.bytes) {
      const auto take = [&](uint32_t position) {
        const uint32_t index = indices.raw(position);
        bool fresh = false;
        w.slots.push_back(w.table.find(s.instance, index, uint32_t(w.vertexIndex.size()), fresh));
        if (fresh) w.vertexIndex.push_back(index + uint32_t(indices.vertexOffset));
        else ++w.reused;
      };
      if (p.apex) take(s.start);
      for (uint32_t i = 0; i < p.count; ++i) take(p.begin + i);
    } else {
      // Every vertex has its own slot.
      const uint32_t at = uint32_t(w.slots.size()), end = at + p.apex + p.count;
      w.slots.resize(end);
      w.vertexIndex.resize(end);
      for (uint32_t i = at; i < end; ++i) w.slots[i] = i;
      uint32_t* index = w.vertexIndex.data() + at;
      if (p.apex) *index++ = firstVertex + s.start;
      for (uint32_t i = 0; i < p.count; ++i) index[i] = firstVertex + p.begin + i;
    }
    w.vertexInstance.resize(w.vertexIndex.size(), firstInstance + s.instance);
    ends.push_back(uint32_t(w.slots.size()));
  }
  raster::VertexOutputs vertices;
  vertices.vertexCount = uint32_t(w.vertexIndex.size());
  const StageLink& link = record->pipeline->link;
  if (vertex->wide) vertices.wideRows = shade<double>(w);
  else vertices.rows = shade<float>(w);
  if (!vertices.rows && !vertices.wideRows) {
    chunk.outOfMemory = true;
    return;
  }
  vertices.rowCount = vertex->rowCount;
  vertices.pointSizeRow = link.pointSizeRow;
  vertices.viewportRow = link.viewportRow;
  vertices.layerRow = link.layerRow;
  vertices.clipDistanceRow = link.clipDistanceRow;
  vertices.cullDistanceRow = link.cullDistanceRow;
  vertices.clipDistances = link.clipDistances;
  vertices.cullDistances = link.cullDistances;
  vertices.decisionRow = link.decisionRow;
  uint32_t begin = 0;
  for (size_t i = 0; i < chunk.segments.size(); ++i) {
    const std::span<const uint32_t> slots{w.slots.data() + begin, ends[i] - begin};
    raster::setupPrimitives(setup, vertices, slots, chunk.segments[i].primitiveId, w.arena, w.primitives, w.setup);
    begin = ends[i];
  }
  chunk.primitives = w.arena.copy(std::span<const raster::Primitive>(w.primitives));
  // The pass looks for the bins one chunk after the other: it need not fetch primitives for that.
  uint32_t* tiles = w.arena.alloc<uint32_t>(w.primitives.size());
  chunk.outOfMemory = chunk.primitives.size() != w.primitives.size() || !tiles;
  if (chunk.outOfMemory) chunk.primitives = {};
  for (size_t i = 0; i < chunk.primitives.size(); ++i) tiles[i] = grid->onlyTile(w.primitives[i]);
  chunk.tiles = tiles;
}

//! A pipeline that does not match the attachments would write outside of them.
bool PassExecutor::Impl::fits(const GraphicsState& state) const {
  const auto matches = [&](const Attachment& a, VkFormat format) {
    const texture::FormatInfo* f = texture::formatInfo(format);
    const texture::FormatInfo* own = a.memory.layout ? texture::formatInfo(a.format) : nullptr;
    return f && own && f->elementBytes == own->elementBytes && f->isDepthStencil() == own->isDepthStencil() &&
           f->hasStencil() == own->hasStencil() && a.memory.layout->tiled && a.memory.layout->samples == state.samples;
  };
  for (uint32_t a = 0; a < state.colorCount; ++a) {
    if (state.colorFormats[a] == VK_FORMAT_UNDEFINED || !writesColor(state, a)) continue;
    if (a >= pass.colorCount || !matches(pass.color[a], state.colorFormats[a])) {
      base::logError("draw left out: colour attachment %u does not match the pipeline", a);
      return false;
    }
  }
  if (testsSamples(state) && !matches(pass.depthStencil, state.depthStencilFormat)) {
    base::logError("draw left out: the depth/stencil attachment does not match the pipeline");
    return false;
  }
  return true;
}

void PassExecutor::Impl::draw(const DrawState& state, const DrawParams& params) {
  if (!open || !state.pipeline || !params.count || !params.instanceCount) return;
  GraphicsPipeline& pipeline = *state.pipeline;
  const GraphicsState& fixed = pipeline.state;
  ++counters.draws;
  const base::ScopedFpEnv environment;
  // What it reads may be any pixel that was written before, at any sample.
  if (pipeline.state.feedbackLoop) {
    flush();
    OneColor colors(*this);
    const raster::TileGrid& grid = bins->grid();
    for (uint32_t t = 0; oneColor && t < grid.tilesX * grid.tilesY * grid.layers; ++t) colors.setTile(t), colors.splitAll();
  }
  // What is not looked at is not done.
  const bool lookedAt = pipeline.vertex->writesMemory || query;
  if (fixed.rasterizerDiscard && !lookedAt) return;
  if (fixed.decisions && fixed.samples != samples)
    return base::logError("draw left out: %u samples, the attachments have %u (decisions are recorded)", fixed.samples, samples);

  auto vertex = vertexRoutine(pipeline, state);
  if (!vertex) return;
  // Invocations that can be seen: those of one draw after those of another.
  if (lookedAt) runFront();
  DrawRecord& record = draws.add();
  const uint32_t constantBytes = uint32_t(offsetof(DrawConstants, dynamicOffsets) + 4 * pipeline.layout->dynamicOffsets());
  const uint32_t pushBytes = std::min(pipeline.layout->pushBytes, kMaxPushBytes), sets = uint32_t(pipeline.layout->sets.size());
  const DrawList::Values values = draws.makeValues({constantBytes, pushBytes, ir::kTableSet0 + sets, fixed.viewportCount});
  if (!fixed.rasterizerDiscard && !beginFragments(state, record, lookedAt)) return draws.removeLast();
  record.pipeline = state.pipeline;
  record.occlusion = occlusion;
  record.query = query;
  record.samples = fixed.samples;
  DrawConstants c;
  fillConstants(state, c);
  c.vertexOffset = params.indexed ? params.vertexOffset : int32_t(params.first);
  c.firstVertex = params.first;
  c.firstInstance = params.firstInstance;
  c.drawIndex = params.drawIndex;
  c.viewIndex = pass.viewIndex;
  c.samples = fixed.samples;
  c.passDraw = uint32_t(counters.draws);
  if (fixed.decisions) beginDecisions();
  std::memcpy(values.constants, &c, constantBytes);
  std::memcpy(values.push, state.push, pushBytes);
  fillTables({values.push, pushBytes}, state.setMemory, state.setSize, sets, {values.constants, constantBytes}, record.tables);

  counters.varyingsInterpolated += pipeline.link.varyings.size();
  counters.varyingsDropped += pipeline.link.unread;
  collected += sizeof(DrawRecord) + constantBytes + pushBytes + (ir::kTableSet0 + sets) * sizeof(interp::Table);
  if (query) countFrontEnd(*query, false);
  frontEnd(state, params, c, std::move(vertex), record);
  if (lookedAt) runFront();
  if (query) countFrontEnd(*query, true);
}

//! What the back end needs. False: nothing would come of the draw.
bool PassExecutor::Impl::beginFragments(const DrawState& state, DrawRecord& record, bool lookedAt) {
  GraphicsPipeline& pipeline = *state.pipeline;
  const GraphicsState& fixed = pipeline.state;
  const VisibilityTraits& v = pipeline.visibility;
  record.visibility = &v;
  record.leavesViewport = !fixed.depthClamp && (fixed.depthBias || !fixed.depthClip);
  record.freeRange = freeDepths(fixed);
  bool ordered = true;   // no NaN
  for (uint32_t i = 0; i < fixed.viewportCount; ++i) {
    const VkViewport& viewport = i ? state.furtherViewports[i - 1] : state.viewport;
    ordered &= viewport.minDepth == viewport.minDepth && viewport.maxDepth == viewport.maxDepth;
    record.depthRanges[i] = {viewport.minDepth, viewport.maxDepth};
  }
  // A statistics query counts invocations as if nothing were saved.
  record.settled = v.opaque && ordered && (!v.depth.test || depthKind) && fixed.samples == samples && !query &&
                   !(disabled & bit(Idea::VisibleFirst));
  record.oneColors = uint8_t(v.written & oneColor);
  record.takesOneColor = record.oneColors && record.oneColors == v.written && fixed.samples == samples && (record.settled || v.oneColor);
  record.fragment = fragmentRoutine(pipeline, state, occlusion != nullptr, statistics || query, record.settled);
  if (!record.fragment || !fits(fixed)) return false;
  if (!record.fragment->present && !occlusion && !lookedAt) return false;
  return pipeline.link.viewportRow >= 0 || !isEmpty(intersect(state.scissor, pass.renderArea)) || lookedAt;
}

//! Adds or takes away what the workers have counted so far in this pass.
void PassExecutor::Impl::countFrontEnd(PipelineStatistics& statistics, bool add) const {
  const auto count = [&](PipelineStatistics::Number n, uint64_t v) { statistics.values[n] += add ? v : 0 - v; };
  for (const auto& w : front) {
    count(PipelineStatistics::VertexInvocations, w->shaded);
    count(PipelineStatistics::ClippingInvocations, w->setup.input);
    const raster::SetupCounters& s = w->setup;
    count(PipelineStatistics::ClippingPrimitives, s.output + s.culledFace + s.culledZeroArea + s.culledNoSample);
  }
}

void PassExecutor::Impl::frontEnd(const DrawState& state, const DrawParams& params, const DrawConstants& constants,
                                   std::shared_ptr<const VertexRoutine> vertex, DrawRecord& record) {
  const GraphicsState& fixed = record.pipeline->state;
  Indices indices;
  if (params.indexed) {
    indices.base = reinterpret_cast<const std::byte*>(state.indexBase);
    indices.size = state.indexSize;
    indices.bytes = indexBytes(state.indexType);
    indices.first = params.first;
    indices.vertexOffset = params.vertexOffset;
    if (!indices.bytes) return;
  }
  const std::vector<Run> runs = findRuns(fixed, indices, params.count);
  if (query) {
    uint32_t restarts = 0;
    if (indices.bytes && fixed.primitiveRestart)
      for (uint32_t i = 0; i < params.count; ++i) restarts += indices.raw(i) == indices.restart();
    query->values[PipelineStatistics::InputVertices] += uint64_t(params.count - restarts) * params.instanceCount;
    for (const Run& r : runs) query->values[PipelineStatistics::InputPrimitives] += uint64_t(r.primitives) * params.instanceCount;
  }
  if (runs.empty()) return;

  FrontDraw& draw = waiting->add();
  raster::SetupState& setup = draw.setup;
  setup = {};
  setup.topology = fixed.topology;
  setup.viewport = state.viewport;
  setup.bounds = intersect(state.scissor, pass.renderArea);
  draw.further.clear();
  if (record.pipeline->link.viewportRow >= 0 && fixed.viewportCount > 1) {
    for (uint32_t v = 0; v + 1 < fixed.viewportCount; ++v)
      draw.further.push_back({state.furtherViewports[v], intersect(state.furtherScissors[v], pass.renderArea)});
    setup.furtherViews = draw.further;
  }
  setup.layers = pass.layers;
  setup.polygonMode = fixed.polygonMode;
  setup.provokingLast = fixed.provokingLast;
  setup.lineMode = fixed.lineMode;
  setup.cullMode = fixed.cullMode;
  setup.frontFace = fixed.frontFace;
  setup.depthClampEnable = fixed.depthClamp;
  setup.depthClipEnable = fixed.depthClip;
  setup.depthFromMinusOne = fixed.depthFromMinusOne;
  setup.depthBiasEnable = fixed.depthBias;
  setup.depthBiasConstant = state.depthBiasConstant;
  setup.depthBiasClamp = state.depthBiasClamp;
  setup.depthBiasSlope = state.depthBiasSlope;
  setup.depthFormat = fixed.depthStencilFormat;
  setup.lineWidth = state.lineWidth;
  setup.samples = fixed.samples;
  setup.cellRecords = !vertex->wide;
  if (record.fragment) setup.varyings = record.fragment->varyings;

  draw.vertex = std::move(vertex);
  draw.record = &record;
  uint32_t buffers = 0;
  for (const VkVertexInputBindingDescription& b : fixed.vertexBindings) buffers = std::max(buffers, b.binding + 1);
  draw.constants.resize(offsetof(VertexConstants, vertexBuffers) + buffers * sizeof(VertexBufferRef));
  std::memcpy(draw.constants.data(), &constants, sizeof constants);
  if (buffers) std::memcpy(draw.constants.data() + offsetof(VertexConstants, vertexBuffers), state.vertexBuffers, buffers * sizeof(VertexBufferRef));
  draw.tables.assign(record.tables, record.tables + ir::kTableSet0 + record.pipeline->layout->sets.size());
  draw.tables[ir::kTableDraw] = {draw.constants.data(), draw.constants.size()};
  draw.prepared = false;
  draw.grid = &bins->grid();
  draw.indices = indices;
  draw.firstVertex = params.first;
  draw.firstInstance = params.firstInstance;
  draw.stop = &pool.cancelled();

  ChunkSource source(runs, params.instanceCount);
  while (!source.done() && !pool.cancelled()) {
    waiting->items.push_back({&draw, uint32_t(draws.size() - 1), source.next()});
    for (const Segment& s : waiting->items.back().chunk.segments) waiting->primitives += s.primitives;
    // Whoever has the only chunk of a draw prepares it. Primitives of several may be forgotten in between, and arenas with them.
    if (!source.done() && !draw.prepared) draw.prepare(nullptr);
    const size_t chunks = waiting->items.size();
    if (chunks >= kMostWaveChunks || (chunks >= kWaveChunks && waiting->primitives >= kWavePrimitives)) runFront(!source.done());
  }
}

void PassExecutor::Impl::runFront(bool drawGoesOn) {
  std::vector<FrontQueue::Item>& items = waiting->items;
  if (items.empty()) return;
  const uint32_t grain = uint32_t(std::clamp<size_t>(items.size() / (8 * pool.workerCount()), 1, 16));
  const uint32_t count = uint32_t(items.size());
  pool.parallelFor((count + grain - 1) / grain, [&](uint32_t g, unsigned worker) {
    for (uint32_t i = g * grain; i < std::min(count, (g + 1) * grain); ++i) {
      try {
        if (!items[i].draw->prepared) items[i].draw->prepare(&front[worker]->arena);
        items[i].draw->run(*front[worker], items[i].chunk);
      } catch (const std::bad_alloc&) {
        items[i].chunk.primitives = {};
        items[i].chunk.outOfMemory = true;
      }
    }
  });
  for (const FrontQueue::Item& item : items) {
    const Chunk& chunk = item.chunk;
    if (chunk.outOfMemory) base::logError("primitives left out: memory is exhausted");
    const size_t varyings = item.draw->setup.varyings.size();
    collected += chunk.primitives.size() * (sizeof(raster::Primitive) + sizeof(raster::BinEntry) + (2 + varyings) * sizeof(raster::Plane) + varyings * 4);
    if (item.draw->record->pipeline->state.rasterizerDiscard) continue;
    for (size_t i = 0; i < chunk.primitives.size(); ++i) bins->add(item.number, chunk.primitives[i], chunk.tiles[i]);
    counters.primitives += chunk.primitives.size();
  }
  waiting->clear(drawGoesOn);
  if (collected > kBinBudget || draws.size() > kDrawBudget) flush();
}

}  // namespace pumice::pipeline
