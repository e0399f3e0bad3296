// Creation of pipelines: what cannot work must fail here, not at a draw. Lookup of routines at draws.
#include "pipeline/pipeline.h"

#include "base/env.h"
#include "base/fpenv.h"
#include "base/log.h"
#include "pipeline/builders.h"
#include "pipeline/ideas.h"
#include "texture/builders.h"

namespace pumice::pipeline {

namespace {

constexpr bool samplesSupported(uint32_t samples) { return samples >= 1 && samples <= 16 && !(samples & (samples - 1)); }

base::Status checkState(const GraphicsState& s) {
  switch (s.topology) {
    case VK_PRIMITIVE_TOPOLOGY_POINT_LIST: case VK_PRIMITIVE_TOPOLOGY_LINE_LIST: case VK_PRIMITIVE_TOPOLOGY_LINE_STRIP:
    case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST: case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP: case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN: break;
    default: return base::errorf("primitive topology %d is not supported", int(s.topology));
  }
  if (s.rasterizerDiscard) return {};
  if (s.polygonMode > VK_POLYGON_MODE_POINT) return base::errorf("polygon mode %d is not supported", int(s.polygonMode));
  if (s.viewportCount > raster::kMaxViewports) return base::errorf("%u viewports, at most %u are possible", s.viewportCount, raster::kMaxViewports);
  if (!samplesSupported(s.samples)) return base::errorf("%u samples are not supported", s.samples);
  if (s.colorCount > kMaxColorAttachments) return base::errorf("%u colour attachments, at most %u are possible", s.colorCount, kMaxColorAttachments);
  for (uint32_t a = 0; a < s.colorCount; ++a)
    if (const VkFormat format = s.colorFormats[a]; format != VK_FORMAT_UNDEFINED) {
      const texture::FormatInfo* f = texture::formatInfo(format);
      if (!f || f->isCompressed() || f->isDepthStencil()) return base::errorf("colour attachment %u: format %d cannot be rendered to", a, int(format));
    }
  if (s.depthStencilFormat != VK_FORMAT_UNDEFINED) {
    const texture::FormatInfo* f = texture::formatInfo(s.depthStencilFormat);
    if (!f || !f->isDepthStencil()) return base::errorf("depth/stencil format %d is not supported", int(s.depthStencilFormat));
  }
  return {};
}

base::Status checkVertexInput(const GraphicsState& s, const frontend::Shader& vertex) {
  for (const auto& binding : s.vertexBindings)
    if (binding.binding >= kMaxVertexBindings) return base::errorf("vertex binding %u: at most %u are possible", binding.binding, kMaxVertexBindings);
  for (const ir::Inst& i : vertex.function.insts) {
    if (i.op != ir::Op::ShaderInput) continue;
    const frontend::InterfaceVariable& v = vertex.inputs[i.imm >> 32];
    const Place p = place(v, uint32_t(i.imm));
    const VkVertexInputAttributeDescription* attribute = nullptr;
    for (const auto& a : s.vertexAttributes)
      // Of 64-bit attributes the third and fourth component lie in the next location.
      if (a.location == p.location || (!attribute && is64Bit(v.type) && p.location > v.location && a.location == p.location - 1)) attribute = &a;
    if (!attribute) return base::errorf("the vertex shader reads location %u, for which there is no attribute", p.location);
    const texture::FormatInfo* f = texture::formatInfo(attribute->format);
    if (!f || f->isCompressed() || f->isDepthStencil())
      return base::errorf("vertex attribute at location %u: format %d is not supported", p.location, int(attribute->format));
    bool bound = false;
    for (const auto& binding : s.vertexBindings) bound |= binding.binding == attribute->binding;
    if (!bound) return base::errorf("vertex attribute at location %u: binding %u is not described", p.location, attribute->binding);
  }
  return {};
}

template <typename T>
base::Error in(const char* stage, base::Result<T>&& r) {
  return base::errorf("%s stage: %s", stage, r.error().message.c_str());
}

}  // namespace

ir::Numerics defaultNumerics() {
  const auto wanted = base::envString(base::EnvVar::Numerics);
  if (wanted && *wanted != "f32" && *wanted != "reference" && base::firstComplaint(base::EnvVar::Numerics, *wanted))
    base::logError("PUMICE_NUMERICS=%s: f32 or reference expected", wanted->c_str());
  return wanted && *wanted == "reference" ? ir::Numerics::Oracle : ir::Numerics::F32;
}

const GraphicsState& graphicsState(const GraphicsPipeline& pipeline) { return pipeline.state; }

base::Result<std::shared_ptr<GraphicsPipeline>> createGraphicsPipeline(GraphicsState state, std::shared_ptr<const Layout> layout,
                                                                       std::shared_ptr<const frontend::Shader> vertex,
                                                                       std::shared_ptr<const frontend::Shader> fragment, const Keeping& keeping) {
  if (!vertex) return base::errorf("there is no vertex stage");
  const base::ScopedFpEnv environment;   // constants are folded as routines would compute them
  auto p = std::make_shared<GraphicsPipeline>();
  p->state = std::move(state);
  p->layout = std::move(layout);
  p->workers = keeping.workers;
  p->vertex = std::move(vertex);
  if (!p->state.rasterizerDiscard && fragment && hasEffect(p->state, *fragment)) p->fragment = std::move(fragment);

  PUMICE_TRY(checkState(p->state));
  PUMICE_TRY(checkVertexInput(p->state, *p->vertex));
  if (auto r = checkResources(*p->vertex, *p->layout); !r) return in("vertex", std::move(r));
  auto link = linkStages(p->state, *p->vertex, p->fragment.get());
  if (!link) return std::move(link).error();
  p->link = std::move(link).value();
  bool attachments = p->state.depthStencilFormat != VK_FORMAT_UNDEFINED;
  for (uint32_t a = 0; a < p->state.colorCount; ++a) attachments |= p->state.colorFormats[a] != VK_FORMAT_UNDEFINED;
  p->state.decisions = p->state.decisions && attachments && !p->state.rasterizerDiscard && p->link.varyings.size() < raster::kMaxVaryings;
  if (p->state.decisions) {
    p->link.decisionRow = int32_t(p->link.rowCount++);
    p->link.decisionVarying = uint32_t(p->link.varyings.size());
    p->link.varyings.push_back({uint16_t(p->link.decisionRow), raster::VaryingMode::Flat});
  }
  auto vertexImages = ImageUses::collect(*p->vertex, *p->layout);
  if (!vertexImages) return in("vertex", std::move(vertexImages));
  p->vertexImages = std::move(vertexImages).value();
  if (p->fragment) {
    if (auto r = checkResources(*p->fragment, *p->layout); !r) return in("fragment", std::move(r));
    auto images = ImageUses::collect(*p->fragment, *p->layout);
    if (!images) return in("fragment", std::move(images));
    p->fragmentImages = std::move(images).value();
  }

  if (!p->state.rasterizerDiscard) p->visibility = visibilityTraits(*p);
  const SavedPipelineKey savedAs = keeping.store ? savedPipelineKey(p->state, *p->layout, keeping.vertex, p->fragment ? keeping.fragment : ShaderIdentity{}) : SavedPipelineKey{};
  if (keeping.store && (p->saved = keeping.store->find(savedAs))) {
    // One like it has been made before, so it works. Its routines are made at once, those for rows of a kind as well.
    const SavedKeys known = p->saved->keys();
    for (const VertexKey& key : known.vertex)
      if (auto routine = restoreVertexRoutine(*p, key, keeping.workers)) p->vertexVariants.insert(key, std::move(routine));
    for (const FragmentKey& key : known.fragment) {
      if (p->state.rasterizerDiscard) break;
      bool there = false;
      FragmentKey any = key;
      any.rows = Rows::Any;
      if (key.rows == Rows::Any) {
        if (auto routine = restoreFragmentRoutine(*p, key, keeping.workers)) p->fragmentVariants.insert(key, std::move(routine));
      } else if (auto routine = p->fragmentVariants.find(any, there); routine && routine->hasRows(key.rows)) {
        routine->restore(key.rows, restoreFragmentRoutine(*p, key, keeping.workers));
      }
    }
    return p;
  }
  // One routine per stage is made now, so that what is not supported is found. Without images it is the very one draws use.
  if (keeping.store) p->saved = std::make_shared<SavedPipeline>();
  VertexKey vertexKey;
  vertexKey.numerics = p->state.numerics;
  vertexKey.images = p->vertexImages.plausible(*p->vertex, *p->layout);
  auto v = buildVertexRoutine(*p, vertexKey, keeping.workers);
  if (!v) return in("vertex", std::move(v));
  p->vertexVariants.insert(vertexKey, std::move(v).value());
  if (!p->state.rasterizerDiscard) {
    FragmentKey key;
    key.numerics = p->state.numerics;
    key.settled = p->visibility.opaque && !(disabledIdeas() & bit(Idea::VisibleFirst));
    if (p->fragment) key.images = p->fragmentImages.plausible(*p->fragment, *p->layout);
    auto f = buildFragmentRoutine(*p, key, keeping.workers);
    if (!f) return in("fragment", std::move(f));
    p->fragmentVariants.insert(key, std::move(f).value());
  }
  if (p->saved) p->saved = keeping.store->insert(savedAs, p->saved);
  return p;
}

base::Result<std::shared_ptr<ComputePipeline>> createComputePipeline(std::shared_ptr<const Layout> layout, std::shared_ptr<const frontend::Shader> shader,
                                                                     ir::Numerics numerics, const Keeping& keeping) {
  if (!shader) return base::errorf("there is no compute stage");
  const base::ScopedFpEnv environment;
  auto p = std::make_shared<ComputePipeline>();
  p->layout = std::move(layout);
  p->workers = keeping.workers;
  p->shader = std::move(shader);
  p->numerics = numerics;
  if (auto r = checkResources(*p->shader, *p->layout); !r) return in("compute", std::move(r));
  auto images = ImageUses::collect(*p->shader, *p->layout);
  if (!images) return in("compute", std::move(images));
  p->images = std::move(images).value();
  const SavedPipelineKey savedAs = keeping.store ? savedPipelineKey(numerics, *p->layout, keeping.vertex) : SavedPipelineKey{};
  if (keeping.store && (p->saved = keeping.store->find(savedAs))) {
    for (const ComputeKey& key : p->saved->keys().compute)
      if (auto routine = restoreComputeRoutine(*p, key, keeping.workers)) p->variants.insert(key, std::move(routine));
    return p;
  }
  if (keeping.store) p->saved = std::make_shared<SavedPipeline>();
  ComputeKey key{p->numerics, p->images.plausible(*p->shader, *p->layout)};
  auto r = buildComputeRoutine(*p, key, keeping.workers);
  if (!r) return in("compute", std::move(r));
  p->variants.insert(key, std::move(r).value());
  if (p->saved) p->saved = keeping.store->insert(savedAs, p->saved);
  return p;
}

namespace {

//! Made outside the lock; who loses a race discards. A failure is kept as null and so logged once. One whose code is still in the
//! making is waited for.
template <typename Key, typename Routine, typename Make>
std::shared_ptr<const Routine> findOrMake(Variants<Key, Routine>& variants, const Key& key, const char* stage, base::ThreadPool* workers, Make&& make) {
  bool known = false;
  if (auto found = variants.find(key, known); known) return found && found->code.ready(workers) ? found : nullptr;
  if (const std::optional<Key> wide = variants.tableKey(key)) {
    // One that cannot be made is not missed: the key's own routine is.
    if (auto table = make(*wide); table) {
      std::shared_ptr<const Routine> kept = std::move(table).value();
      variants.insertTable(*wide, kept);
      return kept->code.ready(workers) ? kept : nullptr;
    }
  }
  auto made = make(key);
  if (!made) base::logError("%s routine: %s", stage, made.error().message.c_str());
  auto kept = variants.insert(key, made ? std::shared_ptr<const Routine>(std::move(made).value()) : nullptr);
  return kept && kept->code.ready(workers) ? kept : nullptr;
}

}  // namespace

std::shared_ptr<const VertexRoutine> vertexRoutine(GraphicsPipeline& p, const DrawState& draw) {
  VertexKey key;
  key.numerics = p.state.numerics;
  key.images = p.vertexImages.read(*p.vertex, *p.layout, draw.setMemory, draw.setSize);
  return findOrMake(p.vertexVariants, key, "vertex", p.workers, [&](const VertexKey& k) { return buildVertexRoutine(p, k); });
}

std::shared_ptr<const FragmentRoutine> fragmentRoutine(GraphicsPipeline& p, const DrawState& draw, bool countSamples, bool statistics, bool settled) {
  FragmentKey key;
  key.numerics = p.state.numerics;
  key.settled = settled;
  key.countSamples = (countSamples || statistics) && !settled;
  key.statistics = statistics;
  if (p.fragment) key.images = p.fragmentImages.read(*p.fragment, *p.layout, draw.setMemory, draw.setSize);
  return findOrMake(p.fragmentVariants, key, "fragment", p.workers, [&](const FragmentKey& k) { return buildFragmentRoutine(p, k); });
}

const FragmentRoutine* FragmentRoutine::forRows(Rows kind) const {
  constexpr uint32_t kRows = 256;   // of 128 lanes: some 30,000 pixels, which cost more than to compile
  Sibling* sibling = siblings[size_t(kind)].get();
  if (!sibling) return nullptr;
  if (const FragmentRoutine* ready = sibling->ready.load(std::memory_order_acquire)) return ready->code.ready() ? ready : nullptr;
  if (sibling->rows.load(std::memory_order_relaxed) > kRows || sibling->rows.fetch_add(1, std::memory_order_relaxed) < kRows) return nullptr;
  std::call_once(sibling->once, [&] {
    sibling->routine = sibling->make();
    sibling->ready.store(sibling->routine.get(), std::memory_order_release);
  });
  return sibling->ready.load(std::memory_order_acquire);
}

void FragmentRoutine::restore(Rows kind, std::shared_ptr<FragmentRoutine> routine) const {
  Sibling* sibling = siblings[size_t(kind)].get();
  if (!sibling || !routine) return;
  std::call_once(sibling->once, [&] {
    sibling->routine = std::make_unique<FragmentRoutine>(std::move(*routine));
    sibling->ready.store(sibling->routine.get(), std::memory_order_release);
  });
}

std::shared_ptr<const ComputeRoutine> computeRoutine(ComputePipeline& p, const DispatchState& dispatch) {
  ComputeKey key{p.numerics, p.images.read(*p.shader, *p.layout, dispatch.setMemory, dispatch.setSize)};
  return findOrMake(p.variants, key, "compute", p.workers, [&](const ComputeKey& k) { return buildComputeRoutine(p, k); });
}

void fillConstants(const DrawState& draw, DrawConstants& c) {
  c.minDepth = draw.viewport.minDepth;
  c.maxDepth = draw.viewport.maxDepth;
  for (int i = 0; i < 4; ++i) c.blendConstants[i] = draw.blendConstants[i];
  for (int i = 0; i < 2; ++i) {
    c.stencilReference[i] = draw.stencilReference[i];
    c.stencilCompareMask[i] = draw.stencilCompareMask[i];
    c.stencilWriteMask[i] = draw.stencilWriteMask[i];
    c.depthBounds[i] = draw.depthBounds[i];
  }
  std::memcpy(c.dynamicOffsets, draw.dynamicOffsets, sizeof c.dynamicOffsets);
}

void fillTables(std::span<const std::byte> push, const std::byte* const* setMemory, const uint64_t* setSize, size_t sets,
                std::span<const std::byte> constants, interp::Table* tables) {
  tables[ir::kTablePush] = {push.data(), push.size()};
  tables[ir::kTableDraw] = {constants.data(), constants.size()};
  for (size_t i = 0; i < std::min<size_t>(sets, ir::kMaxDescriptorSets); ++i)
    tables[ir::kTableSet0 + i] = {setMemory[i], setMemory[i] ? setSize[i] : 0};
  const texture::ConstantTable constantsOfFormats = texture::constantTable();
  tables[ir::kTableConstants] = {constantsOfFormats.data, constantsOfFormats.size};
}

}  // namespace pumice::pipeline
