#include "icd/descriptors.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "entrypoints.h"

namespace pumice::icd {
namespace {

constexpr bool isDynamic(VkDescriptorType type) {
  return type == VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC || type == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC;
}

constexpr bool isBuffer(VkDescriptorType type) {
  return isDynamic(type) || type == VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER || type == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
}

//! What is known of the set's arrays is so no longer.
void written(const SetMemory& set) {
  static std::atomic<uint64_t> generations{0};
  if (!set.layout->headed || !set.memory) return;
  std::atomic_ref(reinterpret_cast<pipeline::SetHeader*>(set.memory)[-1].generation).store(++generations, std::memory_order_release);
}

// An inline uniform block's bytes follow its descriptor.
constexpr uint32_t kInlineData = 64;
static_assert(sizeof(texture::BufferDescriptor) <= kInlineData);

bool hasSampler(VkDescriptorType type) { return type == VK_DESCRIPTOR_TYPE_SAMPLER || type == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER; }

// Where the sampler part of an element lies.
texture::SamplerDescriptor* samplerPart(VkDescriptorType type, std::byte* element) {
  return reinterpret_cast<texture::SamplerDescriptor*>(
      element + (type == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER ? offsetof(texture::CombinedDescriptor, sampler) : 0));
}

pipeline::SetLayout makeSetLayout(const VkDescriptorSetLayoutCreateInfo& info) {
  pipeline::SetLayout layout;
  auto* flags = findInChain<VkDescriptorSetLayoutBindingFlagsCreateInfo>(info.pNext, VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO);
  for (uint32_t i = 0; i < info.bindingCount; i++) {
    const VkDescriptorSetLayoutBinding& b = info.pBindings[i];
    pipeline::Binding binding;
    binding.type = b.descriptorType;
    binding.count = b.descriptorCount;
    binding.stride = texture::descriptorStride(b.descriptorType);
    binding.stages = b.stageFlags;
    binding.variable = flags && i < flags->bindingCount && (flags->pBindingFlags[i] & VK_DESCRIPTOR_BINDING_VARIABLE_DESCRIPTOR_COUNT_BIT);
    if (b.descriptorType == VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK) {
      binding.type = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
      binding.inlineBytes = b.descriptorCount;
      binding.count = b.descriptorCount != 0;
      binding.stride = kInlineData + b.descriptorCount;
    }
    if (b.pImmutableSamplers && hasSampler(b.descriptorType))
      for (uint32_t k = 0; k < b.descriptorCount; k++) binding.immutableSamplers.push_back(from(b.pImmutableSamplers[k])->descriptor);
    layout.bindings.set(b.binding, std::move(binding));
  }
  // Offsets and dynamic offsets run in the order of binding numbers (spec, vkCmdBindDescriptorSets).
  for (auto& [number, binding] : layout.bindings) {
    binding.offset = layout.size;
    layout.size += (binding.stride * binding.count + 63) & ~63u;
    layout.headed |= binding.count > 1 && !isBuffer(binding.type);
    if (isDynamic(binding.type)) {
      binding.dynamicIndex = layout.dynamicCount;
      layout.dynamicCount += binding.count;
    }
  }
  return layout;
}

// Elements of a binding in this set, and what they take from the pool.
uint32_t elementsOf(const pipeline::Binding& b, uint32_t variableCount) { return b.variable && !b.inlineBytes ? std::min(b.count, variableCount) : b.count; }
std::pair<uint32_t, uint32_t> poolUse(const pipeline::Binding& b, uint32_t variableCount) {
  if (b.inlineBytes) return {kInlineBytes, b.inlineBytes};
  return {uint32_t(b.type), elementsOf(b, variableCount)};
}

// Arrays run on into the following bindings (spec, "consecutive binding updates").
class ElementWalk {
 public:
  ElementWalk(const SetMemory& set, uint32_t binding, uint32_t element) : set_(set), it_(set.layout->bindings.find(binding)), element_(element) { skipFull(); }
  bool valid() const { return it_ != set_.layout->bindings.end() && element_ < elementsOf(it_->second, set_.variableCount); }
  const pipeline::Binding& binding() const { return it_->second; }
  std::byte* address() const { return set_.at(it_->second, element_); }
  uint32_t element() const { return element_; }
  void next() {
    element_++;
    skipFull();
  }

 private:
  void skipFull() {
    while (it_ != set_.layout->bindings.end() && element_ >= it_->second.count) element_ -= it_->second.count, ++it_;
  }
  const SetMemory& set_;
  pipeline::BindingTable::const_iterator it_;
  uint32_t element_;
};

void writeBuffer(std::byte* out, const VkDescriptorBufferInfo& info) {
  texture::BufferDescriptor d;
  if (const Buffer* buffer = from(info.buffer)) {
    texture::BufferMemory range = buffer->range(info.offset, info.range);
    d.base = reinterpret_cast<uint64_t>(range.base);
    d.size = range.size;
  }
  std::memcpy(out, &d, sizeof d);
}

constexpr texture::ImageDescriptor kNullImage;

void writeImage(std::byte* out, const VkDescriptorImageInfo& info) {
  const ImageView* view = from(info.imageView);
  std::memcpy(static_cast<void*>(out), view ? &view->descriptor : &kNullImage, sizeof kNullImage);
}

// One element from the application's structure of its type.
void writeElement(const ElementWalk& at, VkDescriptorType type, const void* source) {
  std::byte* out = at.address();
  switch (type) {
    case VK_DESCRIPTOR_TYPE_SAMPLER:
    case VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER: {
      auto& info = *static_cast<const VkDescriptorImageInfo*>(source);
      if (type == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER) writeImage(out, info);
      if (at.binding().immutableSamplers.empty() && info.sampler) *samplerPart(type, out) = from(info.sampler)->descriptor;
      break;
    }
    case VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE:
    case VK_DESCRIPTOR_TYPE_STORAGE_IMAGE:
    case VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT:
      writeImage(out, *static_cast<const VkDescriptorImageInfo*>(source));
      break;
    case VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER:
    case VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER: {
      const BufferView* view = from(*static_cast<const VkBufferView*>(source));
      texture::BufferDescriptor d;
      if (view) d = view->descriptor;
      std::memcpy(out, &d, sizeof d);
      break;
    }
    default: writeBuffer(out, *static_cast<const VkDescriptorBufferInfo*>(source)); break;
  }
}

// The array of a VkWriteDescriptorSet that its type uses, and its stride.
std::pair<const void*, size_t> sourceOf(const VkWriteDescriptorSet& w) {
  switch (w.descriptorType) {
    case VK_DESCRIPTOR_TYPE_SAMPLER:
    case VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER:
    case VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE:
    case VK_DESCRIPTOR_TYPE_STORAGE_IMAGE:
    case VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT: return {w.pImageInfo, sizeof(VkDescriptorImageInfo)};
    case VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER:
    case VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER: return {w.pTexelBufferView, sizeof(VkBufferView)};
    default: return {w.pBufferInfo, sizeof(VkDescriptorBufferInfo)};
  }
}

// Bytes of an inline uniform block; elements count bytes there.
std::byte* inlineBytes(const SetMemory& set, uint32_t binding, uint32_t offset, uint32_t& count) {
  auto it = set.layout->bindings.find(binding);
  if (it == set.layout->bindings.end() || offset >= it->second.inlineBytes) return nullptr;
  count = std::min(count, it->second.inlineBytes - offset);
  return set.at(it->second, 0) + kInlineData + offset;
}

void writeInline(const SetMemory& set, uint32_t binding, uint32_t offset, uint32_t count, const void* data) {
  if (std::byte* out = inlineBytes(set, binding, offset, count)) std::memcpy(out, data, count);
}

void writeElements(const SetMemory& set, uint32_t binding, uint32_t element, uint32_t count, VkDescriptorType type, const void* source, size_t stride) {
  ElementWalk at(set, binding, element);
  for (uint32_t k = 0; k < count; k++) {
    if (k) at.next();
    if (!at.valid()) break;
    writeElement(at, type, static_cast<const std::byte*>(source) + k * stride);
  }
}

void copyDescriptors(const VkCopyDescriptorSet& c) {
  const SetMemory &from_ = *from(c.srcSet), &to_ = *from(c.dstSet);
  if (auto it = from_.layout->bindings.find(c.srcBinding); it != from_.layout->bindings.end() && it->second.inlineBytes) {
    uint32_t count = c.descriptorCount;
    if (const std::byte* bytes = inlineBytes(from_, c.srcBinding, c.srcArrayElement, count)) writeInline(to_, c.dstBinding, c.dstArrayElement, count, bytes);
    return;
  }
  ElementWalk src(from_, c.srcBinding, c.srcArrayElement), dst(to_, c.dstBinding, c.dstArrayElement);
  for (uint32_t k = 0; k < c.descriptorCount && src.valid() && dst.valid(); k++, src.next(), dst.next()) {
    std::memmove(dst.address(), src.address(), std::min(src.binding().stride, dst.binding().stride));
    if (const auto& fixed = dst.binding().immutableSamplers; !fixed.empty()) *samplerPart(dst.binding().type, dst.address()) = fixed[dst.element()];
  }
  written(to_);
}

}  // namespace

void initSetMemory(const SetMemory& set) {
  std::memset(set.memory, 0, set.size);
  for (auto& [number, b] : set.layout->bindings) {
    uint32_t samplers = std::min(uint32_t(b.immutableSamplers.size()), elementsOf(b, set.variableCount));
    for (uint32_t i = 0; i < samplers; i++) *samplerPart(b.type, set.at(b, i)) = b.immutableSamplers[i];
    if (b.inlineBytes) {
      texture::BufferDescriptor d;
      d.base = reinterpret_cast<uint64_t>(set.at(b, 0) + kInlineData);
      d.size = b.inlineBytes;
      std::memcpy(set.at(b, 0), &d, sizeof d);
    }
  }
  written(set);
}

void writeDescriptors(const SetMemory& set, const VkWriteDescriptorSet& w) {
  if (w.descriptorType == VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK) {
    if (auto* block = findInChain<VkWriteDescriptorSetInlineUniformBlock>(w.pNext, VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_INLINE_UNIFORM_BLOCK))
      writeInline(set, w.dstBinding, w.dstArrayElement, block->dataSize, block->pData);
    return;
  }
  auto [source, stride] = sourceOf(w);
  writeElements(set, w.dstBinding, w.dstArrayElement, w.descriptorCount, w.descriptorType, source, stride);
  written(set);
}

void writeDescriptors(const SetMemory& set, const DescriptorUpdateTemplate& update, const void* data) {
  for (const VkDescriptorUpdateTemplateEntry& e : update.entries) {
    const std::byte* source = static_cast<const std::byte*>(data) + e.offset;
    if (e.descriptorType == VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK)
      writeInline(set, e.dstBinding, e.dstArrayElement, e.descriptorCount, source);
    else
      writeElements(set, e.dstBinding, e.dstArrayElement, e.descriptorCount, e.descriptorType, source, e.stride);
  }
  written(set);
}

bool DescriptorPool::take(const pipeline::SetLayout& layout, uint32_t variableCount) {
  for (auto& [number, b] : layout.bindings) {
    auto [type, count] = poolUse(b, variableCount);
    if (type >= available.size()) continue;
    if (available[type] < count) return false;
    available[type] -= count;
  }
  return true;
}

DescriptorSet* DescriptorPool::make(const DescriptorSetLayout& handle, uint32_t variableCount) {
  const pipeline::SetLayout& layout = *handle.layout;
  uint32_t size = layout.size;
  if (!layout.bindings.empty()) {
    const pipeline::Binding& last = layout.bindings.back().second;
    if (last.variable && !last.inlineBytes) size = last.offset + ((last.stride * elementsOf(last, variableCount) + 63) & ~63u);
  }
  // The header and the descriptors first, then the object.
  const size_t header = headerBytes(layout), whole = header + size + sizeof(DescriptorSet);
  auto* memory = static_cast<std::byte*>(freesSets ? allocator.allocate(whole, 64, VK_SYSTEM_ALLOCATION_SCOPE_OBJECT) : arena.allocBytes(whole, 64));
  if (!memory) return nullptr;
  memory += header;
  auto* set = new (memory + size) DescriptorSet{{&layout, size ? memory : nullptr, size, variableCount}, handle.layout};
  sets.insert(set);
  if (size) initSetMemory(*set);
  return set;
}

void DescriptorPool::free(DescriptorSet* set) {
  for (auto& [number, b] : set->layout->bindings)
    if (auto [type, count] = poolUse(b, set->variableCount); type < available.size()) available[type] += count;
  destroy(set);
}

void DescriptorPool::destroy(DescriptorSet* set) {
  sets.erase(set);
  std::byte* memory = reinterpret_cast<std::byte*>(set) - set->size - headerBytes(*set->layout);
  set->~DescriptorSet();
  if (freesSets) allocator.free(memory);
}

void DescriptorPool::reset() {
  while (sets.first()) destroy(sets.first());
  arena.reset();
  available = capacity;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateDescriptorSetLayout(VkDevice device, const VkDescriptorSetLayoutCreateInfo* info, const VkAllocationCallbacks* callbacks, VkDescriptorSetLayout* out) {
  auto* layout = from(device)->make<DescriptorSetLayout>(callbacks);
  if (!layout) return VK_ERROR_OUT_OF_HOST_MEMORY;
  try {
    layout->layout = std::make_shared<pipeline::SetLayout>(makeSetLayout(*info));
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, layout);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkDescriptorSetLayout>(layout);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyDescriptorSetLayout(VkDevice device, VkDescriptorSetLayout layout, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(layout));
}

VKAPI_ATTR void VKAPI_CALL vkGetDescriptorSetLayoutSupport(VkDevice, const VkDescriptorSetLayoutCreateInfo* info, VkDescriptorSetLayoutSupport* out) {
  // An inline uniform block is one descriptor; its count is its bytes.
  auto isBlock = [](const VkDescriptorSetLayoutBinding& b) { return b.descriptorType == VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK; };
  auto descriptors = [&](const VkDescriptorSetLayoutBinding& b) { return isBlock(b) ? 1 : b.descriptorCount; };
  uint64_t total = 0;
  bool fit = true;
  for (uint32_t i = 0; i < info->bindingCount; i++) {
    const VkDescriptorSetLayoutBinding& b = info->pBindings[i];
    total += descriptors(b);
    fit &= !isBlock(b) || b.descriptorCount <= kMaxInlineBlockBytes;
  }
  constexpr uint32_t kMost = 1 << 20;
  out->supported = fit && total <= kMost;
  for (auto* s = static_cast<VkBaseOutStructure*>(out->pNext); s; s = s->pNext)
    if (s->sType == VK_STRUCTURE_TYPE_DESCRIPTOR_SET_VARIABLE_DESCRIPTOR_COUNT_LAYOUT_SUPPORT) {
      auto* flags = findInChain<VkDescriptorSetLayoutBindingFlagsCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO);
      uint32_t& most = reinterpret_cast<VkDescriptorSetVariableDescriptorCountLayoutSupport*>(s)->maxVariableDescriptorCount;
      most = 0;
      for (uint32_t i = 0; flags && out->supported && i < flags->bindingCount; i++)
        if (flags->pBindingFlags[i] & VK_DESCRIPTOR_BINDING_VARIABLE_DESCRIPTOR_COUNT_BIT) {
          const VkDescriptorSetLayoutBinding& b = info->pBindings[i];
          most = isBlock(b) ? kMaxInlineBlockBytes : uint32_t(kMost - (total - b.descriptorCount));
        }
    }
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateDescriptorPool(VkDevice handle, const VkDescriptorPoolCreateInfo* info, const VkAllocationCallbacks* callbacks, VkDescriptorPool* out) {
  Device& device = *from(handle);
  auto* pool = device.make<DescriptorPool>(callbacks, device.allocatorFor(callbacks));
  if (!pool) return VK_ERROR_OUT_OF_HOST_MEMORY;
  pool->maxSets = info->maxSets;
  pool->freesSets = info->flags & VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
  for (uint32_t i = 0; i < info->poolSizeCount; i++)
    if (const VkDescriptorPoolSize& size = info->pPoolSizes[i]; size.type == VK_DESCRIPTOR_TYPE_INLINE_UNIFORM_BLOCK)
      pool->capacity[kInlineBytes] += size.descriptorCount;
    else if (size.type < kInlineBytes)
      pool->capacity[size.type] += size.descriptorCount;
  pool->available = pool->capacity;
  *out = to<VkDescriptorPool>(pool);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyDescriptorPool(VkDevice device, VkDescriptorPool pool, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(pool));
}

VKAPI_ATTR VkResult VKAPI_CALL vkResetDescriptorPool(VkDevice, VkDescriptorPool pool, VkDescriptorPoolResetFlags) {
  from(pool)->reset();
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkAllocateDescriptorSets(VkDevice, const VkDescriptorSetAllocateInfo* info, VkDescriptorSet* out) {
  DescriptorPool& pool = *from(info->descriptorPool);
  const uint32_t count = info->descriptorSetCount;
  auto* variable = findInChain<VkDescriptorSetVariableDescriptorCountAllocateInfo>(info->pNext, VK_STRUCTURE_TYPE_DESCRIPTOR_SET_VARIABLE_DESCRIPTOR_COUNT_ALLOCATE_INFO);
  const auto variableCount = [&](uint32_t i) { return variable && i < variable->descriptorSetCount ? variable->pDescriptorCounts[i] : 0; };
  // All or nothing: only memory can be short once the first set is made.
  const DescriptorCounts before = pool.available;
  VkResult result = count <= pool.maxSets - pool.sets.size() ? VK_SUCCESS : VK_ERROR_OUT_OF_POOL_MEMORY;
  for (uint32_t i = 0; i < count && result == VK_SUCCESS; i++)
    if (!pool.take(*from(info->pSetLayouts[i])->layout, variableCount(i))) result = VK_ERROR_OUT_OF_POOL_MEMORY;
  for (uint32_t i = 0; i < count && result == VK_SUCCESS; i++) {
    DescriptorSet* set = pool.make(*from(info->pSetLayouts[i]), variableCount(i));
    if (set) {
      out[i] = to<VkDescriptorSet>(set);
    } else {
      while (i--) pool.destroy(from(out[i]));
      result = VK_ERROR_OUT_OF_HOST_MEMORY;
      break;
    }
  }
  if (result != VK_SUCCESS) {
    pool.available = before;
    std::fill_n(out, count, VkDescriptorSet(VK_NULL_HANDLE));
  }
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL vkFreeDescriptorSets(VkDevice, VkDescriptorPool pool, uint32_t count, const VkDescriptorSet* sets) {
  for (uint32_t i = 0; i < count; i++)
    if (sets[i]) from(pool)->free(from(sets[i]));
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkUpdateDescriptorSets(VkDevice, uint32_t writes, const VkWriteDescriptorSet* write, uint32_t copies, const VkCopyDescriptorSet* copy) {
  for (uint32_t i = 0; i < writes; i++) writeDescriptors(*from(write[i].dstSet), write[i]);
  for (uint32_t i = 0; i < copies; i++) copyDescriptors(copy[i]);
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateDescriptorUpdateTemplate(VkDevice device, const VkDescriptorUpdateTemplateCreateInfo* info, const VkAllocationCallbacks* callbacks, VkDescriptorUpdateTemplate* out) {
  auto* t = from(device)->make<DescriptorUpdateTemplate>(callbacks, from(device)->allocatorFor(callbacks));
  if (!t) return VK_ERROR_OUT_OF_HOST_MEMORY;
  try {
    t->entries.assign(info->pDescriptorUpdateEntries, info->pDescriptorUpdateEntries + info->descriptorUpdateEntryCount);
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, t);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  t->bindPoint = info->pipelineBindPoint;
  *out = to<VkDescriptorUpdateTemplate>(t);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyDescriptorUpdateTemplate(VkDevice device, VkDescriptorUpdateTemplate t, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(t));
}

VKAPI_ATTR void VKAPI_CALL vkUpdateDescriptorSetWithTemplate(VkDevice, VkDescriptorSet set, VkDescriptorUpdateTemplate t, const void* data) {
  writeDescriptors(*from(set), *from(t), data);
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreatePipelineLayout(VkDevice device, const VkPipelineLayoutCreateInfo* info, const VkAllocationCallbacks* callbacks, VkPipelineLayout* out) {
  auto* object = from(device)->make<PipelineLayout>(callbacks);
  if (!object) return VK_ERROR_OUT_OF_HOST_MEMORY;
  try {
    auto layout = std::make_shared<pipeline::Layout>();
    uint32_t dynamic = 0;
    for (uint32_t i = 0; i < info->setLayoutCount; i++) {
      layout->sets.push_back(info->pSetLayouts[i] ? *from(info->pSetLayouts[i])->layout : pipeline::SetLayout{});
      layout->dynamicBase.push_back(dynamic);
      dynamic += layout->sets.back().dynamicCount;
    }
    for (uint32_t i = 0; i < info->pushConstantRangeCount; i++)
      layout->pushBytes = std::max(layout->pushBytes, info->pPushConstantRanges[i].offset + info->pPushConstantRanges[i].size);
    object->layout = std::move(layout);
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, object);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkPipelineLayout>(object);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyPipelineLayout(VkDevice device, VkPipelineLayout layout, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(layout));
}

}  // namespace pumice::icd
