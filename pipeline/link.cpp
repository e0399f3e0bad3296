#include "pipeline/link.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <set>

#include "texture/addressing.h"

namespace pumice::pipeline {

using frontend::ResourceKind;
using frontend::Shader;

namespace {

template <typename F>
void forEach(const Shader& shader, ir::Op op, F&& f) {
  for (const ir::Inst& i : shader.function.insts)
    if (i.op == op) f(i);
}

bool hasImage(VkDescriptorType t) {
  return t == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER || t == VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE ||
         t == VK_DESCRIPTOR_TYPE_STORAGE_IMAGE || t == VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT;
}
bool hasSampler(VkDescriptorType t) {
  return t == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER || t == VK_DESCRIPTOR_TYPE_SAMPLER;
}
bool isTexelBuffer(VkDescriptorType t) {
  return t == VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER || t == VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER;
}
uint32_t samplerOffset(VkDescriptorType t) {
  return t == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER ? offsetof(texture::CombinedDescriptor, sampler) : 0;
}

uint16_t formatNumber(VkFormat format) {
  const texture::FormatInfo* f = texture::formatInfo(format);
  return f ? uint16_t(f - texture::allFormats().data() + 1) : 0;
}

uint32_t bit(VkDescriptorType t) { return uint32_t(t) < 32 ? 1u << t : 0; }

//! Descriptor types that may serve each kind of resource (Vulkan spec, "Shader Resource and Descriptor Type Correspondence").
uint32_t fittingTypes(ResourceKind kind) {
  switch (kind) {
    case ResourceKind::UniformBuffer: return bit(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER) | bit(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC);
    case ResourceKind::StorageBuffer: return bit(VK_DESCRIPTOR_TYPE_STORAGE_BUFFER) | bit(VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC);
    case ResourceKind::SampledImage: return bit(VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE) | bit(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER);
    case ResourceKind::Sampler: return bit(VK_DESCRIPTOR_TYPE_SAMPLER) | bit(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER);
    case ResourceKind::CombinedImageSampler: return bit(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER);
    case ResourceKind::StorageImage: return bit(VK_DESCRIPTOR_TYPE_STORAGE_IMAGE);
    case ResourceKind::UniformTexelBuffer: return bit(VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER);
    case ResourceKind::StorageTexelBuffer: return bit(VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER);
    case ResourceKind::InputAttachment: return bit(VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT);
  }
  return 0;
}

}  // namespace

std::vector<uint64_t> writtenOutputs(const Shader& shader) {
  std::set<uint64_t> seen;
  forEach(shader, ir::Op::ShaderOutput, [&](const ir::Inst& i) { seen.insert(i.imm); });
  return {seen.begin(), seen.end()};
}

base::Result<StageLink> linkStages(const GraphicsState& state, const Shader& vertex, const Shader* fragment) {
  StageLink link;
  std::set<Place> written;
  for (uint64_t imm : writtenOutputs(vertex)) {
    const frontend::InterfaceVariable& v = vertex.outputs[imm >> 32];
    if (!v.builtIn) {
      if (is64Bit(v.type))
        written.insert({wordPlace(v, uint32_t(imm), 0), wordPlace(v, uint32_t(imm), 1)});
      else
        written.insert(place(v, uint32_t(imm)));
      continue;
    }
    const uint32_t component = uint32_t(imm);
    const bool points = state.topology == VK_PRIMITIVE_TOPOLOGY_POINT_LIST || state.polygonMode == VK_POLYGON_MODE_POINT;
    if (v.location == kPointSize && points && link.pointSizeRow < 0) link.pointSizeRow = int32_t(link.rowCount++);
    if (v.location == kViewportIndex && link.viewportRow < 0) link.viewportRow = int32_t(link.rowCount++);
    if (v.location == kLayer && link.layerRow < 0) link.layerRow = int32_t(link.rowCount++);
    if (v.location == kClipDistance) link.clipDistances = std::max(link.clipDistances, component + 1);
    if (v.location == kCullDistance) link.cullDistances = std::max(link.cullDistances, component + 1);
  }
  if (link.clipDistances + link.cullDistances > raster::kMaxClipDistances)
    return base::errorf("vertex stage: %u clip and cull distances, at most %u are possible", link.clipDistances + link.cullDistances,
                        raster::kMaxClipDistances);
  if (link.clipDistances) link.clipDistanceRow = int32_t(link.rowCount);
  if (link.cullDistances) link.cullDistanceRow = int32_t(link.rowCount + link.clipDistances);
  link.rowCount += link.clipDistances + link.cullDistances;
  link.unread = uint32_t(written.size());
  if (!fragment) return link;

  std::map<std::pair<Place, raster::VaryingMode>, uint32_t> known;
  std::set<uint64_t> reads;
  forEach(*fragment, ir::Op::ShaderInput, [&](const ir::Inst& i) { reads.insert(i.imm); });
  for (uint64_t imm : reads) {
    const frontend::InterfaceVariable& v = fragment->inputs[imm >> 32];
    raster::VaryingMode mode = raster::VaryingMode::Perspective;
    if (v.interpolation == frontend::Interpolation::Linear) mode = raster::VaryingMode::Linear;
    if (v.interpolation == frontend::Interpolation::Flat || ir::isInt(v.type) || is64Bit(v.type)) mode = raster::VaryingMode::Flat;
    const auto take = [&](const Place& p, std::map<uint64_t, uint32_t>& varyingOf) {
      if (!written.count(p)) return;
      auto [row, fresh] = link.rows.try_emplace(p, link.rowCount);
      if (fresh) ++link.rowCount;
      auto [varying, added] = known.try_emplace({p, mode}, uint32_t(link.varyings.size()));
      if (added) link.varyings.push_back({uint16_t(row->second), mode});
      varyingOf[imm] = varying->second;
    };
    if (is64Bit(v.type)) {
      take(wordPlace(v, uint32_t(imm), 0), link.varyingOf);
      take(wordPlace(v, uint32_t(imm), 1), link.highWordOf);
    } else {
      take(place(v, uint32_t(imm)), link.varyingOf);
    }
  }
  link.unread = uint32_t(written.size() - link.rows.size());
  forEach(*fragment, ir::Op::Builtin, [&](const ir::Inst& i) {
    const uint32_t builtIn = uint32_t(i.imm >> 32), component = uint32_t(i.imm);
    std::optional<raster::Varying> varying;
    if (builtIn == kPointCoord && component < 2) varying = {0, component ? raster::VaryingMode::PointY : raster::VaryingMode::PointX};
    if (builtIn == kClipDistance && component < link.clipDistances)
      varying = {uint16_t(link.clipDistanceRow + int32_t(component)), raster::VaryingMode::Perspective};
    if (builtIn == kCullDistance && component < link.cullDistances)
      varying = {uint16_t(link.cullDistanceRow + int32_t(component)), raster::VaryingMode::Perspective};
    if (!varying || !link.builtInOf.try_emplace(i.imm, uint32_t(link.varyings.size())).second) return;
    link.varyings.push_back(*varying);
  });
  if (link.varyings.size() > raster::kMaxVaryings)
    return base::errorf("%zu components between the stages, at most %u are possible", link.varyings.size(), raster::kMaxVaryings);
  return link;
}

base::Status checkResources(const Shader& shader, const Layout& layout) {
  for (const frontend::Resource& r : shader.resources) {
    const Binding* binding = layout.find(r.set, r.binding);
    if (!binding) return base::errorf("the shader uses set %u binding %u, which the pipeline layout does not have", r.set, r.binding);
    if (r.set >= ir::kMaxDescriptorSets) return base::errorf("descriptor set %u: at most %u sets are possible", r.set, unsigned(ir::kMaxDescriptorSets));
    if (!(fittingTypes(r.kind) & bit(binding->type)))
      return base::errorf("set %u binding %u: descriptor type %d does not fit the shader's resource", r.set, r.binding, int(binding->type));
  }
  return {};
}

void ImageUses::add(uint32_t resource, uint32_t element) {
  if (!find(resource, element)) uses_.push_back({resource, element});
}

std::optional<uint32_t> ImageUses::find(uint32_t resource, uint32_t element) const {
  for (uint32_t i = 0; i < uses_.size(); ++i)
    if (uses_[i].resource == resource && uses_[i].element == element) return i;
  return std::nullopt;
}

base::Result<ImageUses> ImageUses::collect(const Shader& shader, const Layout& layout) {
  ImageUses result;
  const ir::Function& f = shader.function;
  for (const ir::Inst& i : f.insts) {
    if (i.op != ir::Op::ImageOp) continue;
    const ir::ImageOpInfo& op = f.imageOps[i.imm];
    const auto operands = f.operands(i);
    const bool sampled = op.kind == ir::ImageKind::Sample || op.kind == ir::ImageKind::Gather || op.kind == ir::ImageKind::QueryLod;
    for (int part = 0; part < (sampled ? 2 : 1); ++part) {
      const uint32_t resource = part ? op.samplerResource : op.imageResource;
      const frontend::Resource& r = shader.resources[resource];
      const Binding* binding = layout.find(r.set, r.binding);
      if (!binding) return base::errorf("set %u binding %u is not in the pipeline layout", r.set, r.binding);
      const ir::Inst& index = f.insts[operands[part]];
      result.add(resource, index.op == ir::Op::Const ? uint32_t(index.imm) : kIndexed);
    }
  }
  return result;
}

namespace {

//! State of one element; `bytes` is its descriptor or null.
ImageState stateOf(const Binding& binding, uint32_t element, const std::byte* bytes) {
  ImageState state;
  if (bytes && hasImage(binding.type)) std::memcpy(&state.view, bytes + offsetof(texture::ImageDescriptor, key), sizeof state.view);
  if (bytes && isTexelBuffer(binding.type)) {
    uint32_t format;
    std::memcpy(&format, bytes + offsetof(texture::BufferDescriptor, format), sizeof format);
    state.view.format = formatNumber(VkFormat(format));
  }
  if (!hasSampler(binding.type)) return state;
  if (element < binding.immutableSamplers.size())
    state.sampler = binding.immutableSamplers[element].key;
  else if (bytes)
    std::memcpy(&state.sampler, bytes + samplerOffset(binding.type) + offsetof(texture::SamplerDescriptor, key), sizeof state.sampler);
  return state;
}

//! States of the first `count` elements of an array, each once; `memory` is that of its set.
std::vector<ImageState> statesOfArray(const Binding& binding, const std::byte* memory, uint64_t count) {
  std::vector<ImageState> states;
  for (uint32_t e = 0; e < count; ++e) {
    const ImageState state = stateOf(binding, e, memory + binding.offset + uint64_t(e) * binding.stride);
    // Neighbours are mostly alike: the latest first.
    if (std::find(states.rbegin(), states.rend(), state) == states.rend()) states.push_back(state);
  }
  return states;
}

//! The same, remembered until the set is written. Draws that index an array of thousands would look at all of them each time.
class ArrayStates {
 public:
  std::vector<ImageState> find(const Binding& binding, const std::byte* memory, uint64_t count) {
    auto* header = const_cast<SetHeader*>(reinterpret_cast<const SetHeader*>(memory) - 1);
    // Read first: what is written meanwhile gets another one afterwards.
    const uint64_t generation = std::atomic_ref(header->generation).load(std::memory_order_acquire);
    const std::pair key(generation, binding.offset);
    std::lock_guard lock(mutex_);
    if (const auto it = known_.find(key); it != known_.end()) return it->second;
    if (known_.size() >= kMost) known_.clear();
    return known_[key] = statesOfArray(binding, memory, count);
  }

 private:
  static constexpr size_t kMost = 4096;
  std::mutex mutex_;
  std::map<std::pair<uint64_t, uint32_t>, std::vector<ImageState>> known_;   //!< by generation and offset of the binding
};
ArrayStates& arrayStates() {
  static ArrayStates states;
  return states;
}

}  // namespace

std::vector<ImageState> ImageUses::read(const Shader& shader, const Layout& layout, const std::byte* const* setMemory,
                                        const uint64_t* setSize) const {
  std::vector<ImageState> states;
  states.reserve(uses_.size());
  for (uint32_t i = 0; i < uses_.size(); ++i) {
    const frontend::Resource& r = shader.resources[uses_[i].resource];
    const Binding* binding = layout.find(r.set, r.binding);
    const size_t first = states.size();
    const std::byte* memory = setMemory[r.set];
    // A set may have fewer elements than its layout.
    const uint64_t room = binding && memory && setSize[r.set] > binding->offset ? (setSize[r.set] - binding->offset) / binding->stride : 0;
    if (const uint32_t element = uses_[i].element; element != kIndexed) {
      if (binding && element < binding->count)
        states.push_back(stateOf(*binding, element, element < room ? memory + binding->offset + uint64_t(element) * binding->stride : nullptr));
    } else if (const uint64_t count = binding ? std::min<uint64_t>(binding->count, room) : 0) {
      const std::vector<ImageState> found = layout.sets[r.set].headed ? arrayStates().find(*binding, memory, count) : statesOfArray(*binding, memory, count);
      states.insert(states.end(), found.begin(), found.end());
    }
    if (states.size() == first) states.emplace_back();
    for (size_t k = first; k < states.size(); ++k) states[k].use = i;
  }
  return states;
}

std::vector<ImageState> ImageUses::plausible(const Shader& shader, const Layout& layout) const {
  std::vector<ImageState> states(uses_.size());
  for (uint32_t i = 0; i < uses_.size(); ++i) {
    states[i].use = i;
    const frontend::Resource& r = shader.resources[uses_[i].resource];
    const Binding* binding = layout.find(r.set, r.binding);
    if (!binding) continue;
    const ir::ImageOpInfo* op = nullptr;
    for (const ir::ImageOpInfo& o : shader.function.imageOps)
      if (o.imageResource == uses_[i].resource) op = &o;
    texture::ViewKey& view = states[i].view;
    if (op && (hasImage(binding->type) || isTexelBuffer(binding->type))) {
      const bool integer = ir::isInt(op->texelType);
      view.format = formatNumber(!integer ? VK_FORMAT_R8G8B8A8_UNORM : op->texelSigned ? VK_FORMAT_R8G8B8A8_SINT : VK_FORMAT_R8G8B8A8_UINT);
      constexpr VkImageViewType kPlain[] = {VK_IMAGE_VIEW_TYPE_1D, VK_IMAGE_VIEW_TYPE_2D, VK_IMAGE_VIEW_TYPE_3D, VK_IMAGE_VIEW_TYPE_CUBE,
                                            VK_IMAGE_VIEW_TYPE_2D, VK_IMAGE_VIEW_TYPE_1D, VK_IMAGE_VIEW_TYPE_2D};
      constexpr VkImageViewType kArrayed[] = {VK_IMAGE_VIEW_TYPE_1D_ARRAY, VK_IMAGE_VIEW_TYPE_2D_ARRAY, VK_IMAGE_VIEW_TYPE_3D,
                                              VK_IMAGE_VIEW_TYPE_CUBE_ARRAY, VK_IMAGE_VIEW_TYPE_2D_ARRAY, VK_IMAGE_VIEW_TYPE_1D_ARRAY,
                                              VK_IMAGE_VIEW_TYPE_2D_ARRAY};
      if (hasImage(binding->type)) {
        view.viewType = uint8_t((op->arrayed ? kArrayed : kPlain)[unsigned(op->dim)]);
        view.tiled = texture::kCompact;
        view.aspect = VK_IMAGE_ASPECT_COLOR_BIT;
        view.samples = op->multisampled ? 4 : 1;
      }
      for (uint8_t c = 0; c < 4; ++c) view.swizzle[c] = uint8_t(VK_COMPONENT_SWIZZLE_R + c);
    }
    if (!hasSampler(binding->type)) continue;
    if (uses_[i].element < binding->immutableSamplers.size()) {
      states[i].sampler = binding->immutableSamplers[uses_[i].element].key;
    } else {
      states[i].sampler.magFilter = states[i].sampler.minFilter = VK_FILTER_LINEAR;
      states[i].sampler.present = 1;
    }
  }
  return states;
}

}  // namespace pumice::pipeline
