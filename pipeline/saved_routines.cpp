#include "pipeline/saved_routines.h"

#include <algorithm>
#include <atomic>

#include "base/hash.h"
#include "pipeline/builders.h"
#include "pipeline/ideas.h"
#include "spirv_interp/ir/bytes.h"
#include "spirv_interp/ir/one_record.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::pipeline {

using ir::Op;
using ir::Type;

namespace {

constexpr uint64_t kMostLocalBytes = 1 << 20;   //!< of a lane
enum class Kind : uint8_t { Vertex, Fragment, Compute };

std::atomic<uint64_t> linkedCount, restoredCount;

//! What only shader IR has: linking gives values for it.
bool isAbstract(Op op) {
  const ir::OpInfo& info = ir::opInfo(op);
  return (info.flags & ir::kHigh) && info.operands == ir::OperandRule::Free;
}

//! The parts of routine keys, for both directions.
template <typename A>
void fields(A& a, std::vector<ImageState>& images) {
  ir::list(a, images, sizeof(uint32_t) + sizeof(texture::ViewKey) + sizeof(texture::SamplerKey), [&](ImageState& i) {
    a.value(i.use);
    a.value(i.view);
    a.value(i.sampler);
  });
}
template <typename A>
void fields(A& a, VertexKey& k) {
  a.value(k.numerics);
  fields(a, k.images);
}
template <typename A>
void fields(A& a, FragmentKey& k) {
  a.value(k.numerics), a.value(k.countSamples), a.value(k.statistics), a.value(k.settled), a.value(k.rows), a.value(k.depthTiled);
  fields(a, k.images);
}
template <typename A>
void fields(A& a, ComputeKey& k) {
  a.value(k.numerics);
  fields(a, k.images);
}

template <typename Key>
std::string keyBytes(Kind kind, const Key& key) {
  ir::ByteWriter w;
  w.value(kind);
  fields(w, const_cast<Key&>(key));   // a writer only reads it
  return {reinterpret_cast<const char*>(w.bytes.data()), w.bytes.size()};
}

//! What the hash of a pipeline's key is made of.
class KeyBytes {
 public:
  template <typename T>
  void add(const T& v) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>, "padding would be hashed");
    w_.value(v);
  }
  template <typename T, typename... Fields>
  void each(const std::vector<T>& items, Fields... fields) {
    add(uint32_t(items.size()));
    for (const T& item : items) (add(item.*fields), ...);
  }
  void add(const VkStencilOpState& s) { add(s.failOp), add(s.passOp), add(s.depthFailOp), add(s.compareOp); }
  void add(const ShaderIdentity& s) { add(s[0]), add(s[1]); }
  template <typename T>
  void bytesOf(const T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    w_.value(v);
  }
  void add(const Layout& layout) {
    add(uint32_t(layout.sets.size()));
    for (const SetLayout& set : layout.sets) {
      add(uint32_t(set.bindings.size()));
      for (const auto& [number, b] : set.bindings) {
        add(number), add(b.type), add(b.count), add(b.offset), add(b.stride), add(b.inlineBytes), add(b.variable), add(b.dynamicIndex);
        add(uint32_t(b.immutableSamplers.size()));
        for (const texture::SamplerDescriptor& s : b.immutableSamplers) bytesOf(s.key);
      }
    }
    add(uint32_t(layout.dynamicBase.size()));
    for (uint32_t base : layout.dynamicBase) add(base);
    add(layout.pushBytes);
  }
  SavedPipelineKey key() const {
    return {base::hashBytes(w_.bytes.data(), w_.bytes.size(), 1), base::hashBytes(w_.bytes.data(), w_.bytes.size(), 2)};
  }

 private:
  ir::ByteWriter w_;
};

}  // namespace

std::string check(const ir::Function& f, const Surroundings& s) {
  if (std::string why = ir::verify(f); !why.empty()) return why;
  const auto wrong = [&](const ir::Inst& i, const char* what) {
    return "%" + std::to_string(&i - f.insts.data()) + " (" + ir::opInfo(i.op).text + "): " + what;
  };
  const auto slot = [](const std::vector<Type>& slots, uint64_t n, Type type) { return n < slots.size() && slots[n] == type && type != Type::None; };
  uint64_t local = 0;
  for (size_t v = 1; v < f.insts.size(); ++v) {
    const ir::Inst& i = f.insts[v];
    if (i.type == Type::Tuple || i.op == Op::Check || isAbstract(i.op)) return wrong(i, "has no place in a routine");
    switch (i.op) {
      case Op::Input:
        if (!slot(s.inputs, i.imm, i.type)) return wrong(i, "there is no such row");
        break;
      case Op::Output:
        if (!slot(s.outputs, i.imm, f.type(f.operands(i)[0]))) return wrong(i, "there is no such row");
        break;
      case Op::UniformInput:
        if (!ir::typeBytes(i.type) || i.imm + ir::typeBytes(i.type) > s.drawBytes) return wrong(i, "outside of the draw's constants");
        break;
      case Op::TableLoad:
        if (i.imm >> 32 >= ir::kTableSet0 + s.sets) return wrong(i, "there is no such set");
        break;
      case Op::QuadLoad:
        if ((i.imm & ~(ir::kOneRecord | ir::kPlaneInUnit)) + ir::typeBytes(i.type) > s.recordBytes) return wrong(i, "outside of the record");
        if (bool(i.imm & ir::kOneRecord) != s.oneRecord) return wrong(i, "of one record, or of several");
        if ((i.imm & ir::kPlaneInUnit) && std::find(s.inUnit.begin(), s.inUnit.end(), uint32_t(i.imm)) == s.inUnit.end()) return wrong(i, "no such plane is known to lie between 0 and 1");
        break;
      case Op::TileLoad:
      case Op::TileStore: {
        const uint64_t plane = i.imm >> 32, element = i.imm >> 16 & 0xffff;
        if (plane >= s.planes.size() || !element || s.planes[plane] != element) return wrong(i, "there is no such plane");
        break;
      }
      case Op::Barrier:
      case Op::SharedLoad:
      case Op::SharedStore:
      case Op::SharedAtomic:
      case Op::SharedAtomicCas:
        if (!s.workGroup) return wrong(i, "there is no work group");
        break;
      case Op::LocalAlloc:
        if ((local += i.imm) > kMostLocalBytes) return wrong(i, "too much local memory");
        break;
      default: break;
    }
  }
  return {};
}

std::string savedKey(const VertexKey& key) { return keyBytes(Kind::Vertex, key); }
std::string savedKey(const FragmentKey& key) { return keyBytes(Kind::Fragment, key); }
std::string savedKey(const ComputeKey& key) { return keyBytes(Kind::Compute, key); }

SavedKeys SavedPipeline::keys() const {
  SavedKeys found;
  std::lock_guard lock(mutex_);
  for (const auto& [text, bytes] : routines_) {
    ir::ByteReader r({reinterpret_cast<const std::byte*>(text.data()), text.size()});
    Kind kind{};
    r.value(kind);
    const auto read = [&](auto& keys) {
      auto& key = keys.emplace_back();
      fields(r, key);
      bool ok = r.ok && r.rest.empty() && key.numerics <= ir::Numerics::Oracle;
      if constexpr (std::is_same_v<std::decay_t<decltype(key)>, FragmentKey>) ok = ok && uint32_t(key.rows) < kRowKinds;
      if (!ok) keys.pop_back();
    };
    if (kind == Kind::Vertex) read(found.vertex);
    else if (kind == Kind::Fragment) read(found.fragment);
    else if (kind == Kind::Compute) read(found.compute);
  }
  std::stable_partition(found.fragment.begin(), found.fragment.end(), [](const FragmentKey& k) { return k.rows == Rows::Any; });
  return found;
}

void SavedPipeline::insert(const std::string& key, const ir::Function& f, uint32_t traits) {
  ir::ByteWriter w;
  w.number(traits);
  ir::fields(w, f);
  std::lock_guard lock(mutex_);
  routines_.try_emplace(key, std::move(w.bytes));
}

std::optional<SavedRoutine> SavedPipeline::find(const std::string& key, const Surroundings& surroundings) {
  std::vector<std::byte> bytes;
  {
    std::lock_guard lock(mutex_);
    const auto it = routines_.find(key);
    if (it == routines_.end()) return std::nullopt;
    bytes = it->second;
  }
  ir::ByteReader r(bytes);
  SavedRoutine saved;
  saved.traits = uint32_t(r.number());
  ir::fields(r, saved.function);
  if (r.ok && r.rest.empty() && check(saved.function, surroundings).empty()) {
    ir::computeRates(saved.function);
    return saved;
  }
  std::lock_guard lock(mutex_);
  routines_.erase(key);
  return std::nullopt;
}

void SavedPipeline::merge(const SavedPipeline& other) {
  if (&other == this) return;
  std::scoped_lock lock(mutex_, other.mutex_);
  for (const auto& [key, bytes] : other.routines_) routines_.try_emplace(key, bytes);
}

std::vector<std::byte> SavedPipeline::toBytes() const {
  ir::ByteWriter w;
  std::lock_guard lock(mutex_);
  w.number(routines_.size());
  for (const auto& [key, bytes] : routines_) {
    ir::text(w, const_cast<std::string&>(key));
    w.number(bytes.size());
    w.bytes.insert(w.bytes.end(), bytes.begin(), bytes.end());
  }
  return std::move(w.bytes);
}

std::shared_ptr<SavedPipeline> SavedPipeline::fromBytes(std::span<const std::byte> bytes) {
  ir::ByteReader r(bytes);
  auto pipeline = std::make_shared<SavedPipeline>();
  size_t count = 0;
  r.size(count, 2);
  for (size_t n = 0; n < count && r.ok; ++n) {
    std::string key;
    ir::text(r, key);
    size_t size = 0;
    r.size(size, 1);
    if (!r.ok) return nullptr;
    pipeline->routines_[key].assign(r.rest.begin(), r.rest.begin() + ptrdiff_t(size));
    r.rest = r.rest.subspan(size);
  }
  return r.ok && r.rest.empty() ? pipeline : nullptr;
}

static void addVertexInput(KeyBytes& k, const GraphicsState& s) {
  using B = VkVertexInputBindingDescription;
  using A = VkVertexInputAttributeDescription;
  using D = VkVertexInputBindingDivisorDescriptionEXT;
  k.each(s.vertexBindings, &B::binding, &B::stride, &B::inputRate);
  k.each(s.vertexAttributes, &A::location, &A::binding, &A::format, &A::offset);
  k.each(s.divisors, &D::binding, &D::divisor);
}

SavedPipelineKey savedPipelineKey(const GraphicsState& s, const Layout& layout, const ShaderIdentity& vertex, const ShaderIdentity& fragment) {
  // A new field belongs here, unless it is a number that a draw looks at and no code is made from: viewports, scissors, line width,
  // constants of blending, depth bias and depth bounds, stencil masks and references.
  static_assert(sizeof(GraphicsState) == 408);
  KeyBytes k;
  k.add(vertex);
  k.add(fragment);
  k.add(disabledIdeas());
  using C = VkPipelineColorBlendAttachmentState;
  addVertexInput(k, s);
  k.each(s.blend, &C::blendEnable, &C::srcColorBlendFactor, &C::dstColorBlendFactor, &C::colorBlendOp, &C::srcAlphaBlendFactor, &C::dstAlphaBlendFactor,
         &C::alphaBlendOp, &C::colorWriteMask);
  k.add(s.wholeAttributes), k.add(s.topology), k.add(s.primitiveRestart), k.add(s.rasterizerDiscard), k.add(s.depthClamp), k.add(s.depthClip);
  k.add(s.depthBias), k.add(s.unrestrictedDepth), k.add(s.feedbackLoop), k.add(s.provokingLast), k.add(s.lineMode), k.add(s.polygonMode), k.add(s.cullMode), k.add(s.frontFace);
  k.add(s.viewportCount), k.add(s.samples), k.add(s.sampleMask), k.add(s.sampleShading), k.add(s.alphaToCoverage), k.add(s.alphaToOne);
  k.add(s.minSampleShading), k.add(s.depthTest), k.add(s.depthWrite), k.add(s.depthBoundsTest), k.add(s.stencilTest), k.add(s.depthCompare);
  k.add(s.stencilFront), k.add(s.stencilBack), k.add(s.logicOpEnable), k.add(s.logicOp);
  for (VkFormat format : s.colorFormats) k.add(format);
  k.add(s.colorCount), k.add(s.depthStencilFormat), k.add(s.depthAttached), k.add(s.stencilAttached), k.add(s.dynamic), k.add(s.numerics), k.add(s.decisions);
  k.add(layout);
  return k.key();
}

SavedPipelineKey vertexPartKey(const GraphicsPipeline& pipeline, const VertexKey& key) {
  // A new field of these that the vertex routine's maker reads belongs here.
  static_assert(sizeof(GraphicsState) == 408 && sizeof(StageLink) == 264);
  const GraphicsState& s = pipeline.state;
  const StageLink& link = pipeline.link;
  KeyBytes k;
  k.add(uint64_t(reinterpret_cast<uintptr_t>(pipeline.vertex.get())));
  addVertexInput(k, s);
  k.add(s.wholeAttributes), k.add(s.decisions);
  k.add(uint32_t(link.rows.size()));
  for (const auto& [place, row] : link.rows) k.add(place.location), k.add(place.component), k.add(place.index), k.add(row);
  k.add(link.rowCount), k.add(link.pointSizeRow), k.add(link.viewportRow), k.add(link.layerRow);
  k.add(link.clipDistanceRow), k.add(link.cullDistanceRow), k.add(link.clipDistances), k.add(link.cullDistances), k.add(link.decisionRow);
  k.add(*pipeline.layout);
  for (const char c : savedKey(key)) k.add(c);
  return k.key();
}

SavedPipelineKey savedPipelineKey(ir::Numerics numerics, const Layout& layout, const ShaderIdentity& compute) {
  KeyBytes k;
  k.add(compute);
  k.add(disabledIdeas());
  k.add(numerics);
  k.add(layout);
  return k.key();
}

std::shared_ptr<SavedPipeline> PipelineStore::find(const SavedPipelineKey& key) const {
  std::lock_guard lock(mutex_);
  const auto it = pipelines_.find(key);
  return it == pipelines_.end() ? nullptr : it->second;
}

std::shared_ptr<SavedPipeline> PipelineStore::insert(const SavedPipelineKey& key, std::shared_ptr<SavedPipeline> pipeline) {
  std::lock_guard lock(mutex_);
  return pipelines_.try_emplace(key, std::move(pipeline)).first->second;
}

void PipelineStore::merge(const PipelineStore& other) {
  if (&other == this) return;
  for (const auto& [key, pipeline] : other.pipelines()) {
    // A copy: what the other cache's pipelines will still make is not meant for this one.
    const auto mine = find(key);
    if (mine) mine->merge(*pipeline);
    else insert(key, std::make_shared<SavedPipeline>(*pipeline));
  }
}

std::map<SavedPipelineKey, std::shared_ptr<SavedPipeline>> PipelineStore::pipelines() const {
  std::lock_guard lock(mutex_);
  return pipelines_;
}

RoutineCounts routineCounts() { return {linkedCount, restoredCount}; }
void countLinked() { ++linkedCount; }
void countRestored() { ++restoredCount; }

}  // namespace pumice::pipeline
