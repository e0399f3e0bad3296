// Descriptor set layouts, pools, sets, update templates, pipeline layouts.
#pragma once

#include <array>
#include <memory>

#include "icd/command_arena.h"
#include "icd/host_containers.h"
#include "icd/resources.h"
#include "pipeline/layout.h"

namespace pumice::icd {

struct DescriptorSetLayout {
  //! Shared: sets, pipeline layouts and pools may outlive the handle.
  std::shared_ptr<const pipeline::SetLayout> layout;
};

struct DescriptorUpdateTemplate;

//! Where descriptors are written, and by what layout they lie there.
struct SetMemory {
  const pipeline::SetLayout* layout = nullptr;
  std::byte* memory = nullptr;   //!< `size` bytes, 64-byte aligned, zero = null descriptors
  uint32_t size = 0;             //!< layout->size, or less where a variable count was given
  uint32_t variableCount = 0;    //!< elements of the variable binding, if there is one
  std::byte* at(const pipeline::Binding& b, uint32_t element) const { return memory + b.offset + size_t(b.stride) * element; }
};

struct DescriptorSet : SetMemory {
  std::shared_ptr<const pipeline::SetLayout> owner;     //!< of `layout`
  DescriptorSet *previous = nullptr, *next = nullptr;   //!< of the pool
};

//! Before the memory of a set.
inline size_t headerBytes(const pipeline::SetLayout& layout) { return layout.headed ? sizeof(pipeline::SetHeader) : 0; }

//! What is in new set memory: null descriptors, immutable samplers, inline uniform blocks.
void initSetMemory(const SetMemory& set);
void writeDescriptors(const SetMemory& set, const VkWriteDescriptorSet& write);
void writeDescriptors(const SetMemory& set, const DescriptorUpdateTemplate& update, const void* data);

//! Index of the bytes of inline uniform blocks, behind the counts of the core types (0..10).
constexpr uint32_t kInlineBytes = 11;
//! Most bytes of one inline uniform block.
constexpr uint32_t kMaxInlineBlockBytes = 64 << 10;

using DescriptorCounts = std::array<uint32_t, kInlineBytes + 1>;   //!< by type

//! Sets that can be freed one by one are allocations of their own; others lie behind each other until the pool is reset.
struct DescriptorPool {
  explicit DescriptorPool(const HostAllocator& a) : allocator(a), arena(a) {}
  ~DescriptorPool() { reset(); }
  HostAllocator allocator;
  uint32_t maxSets = 0;
  bool freesSets = false;
  DescriptorCounts capacity{}, available{};
  PoolList<DescriptorSet> sets;
  CommandArena arena;
  //! Takes a set's descriptors from what is available; false (and some may be taken): there are too few.
  bool take(const pipeline::SetLayout& layout, uint32_t variableCount);
  //! Null if memory is exhausted.
  DescriptorSet* make(const DescriptorSetLayout& layout, uint32_t variableCount);
  void destroy(DescriptorSet* set);
  //! Destroys it and gives back what it took.
  void free(DescriptorSet* set);
  void reset();
};

struct DescriptorUpdateTemplate {
  explicit DescriptorUpdateTemplate(const HostAllocator& a) : entries(HostStl<VkDescriptorUpdateTemplateEntry>(a)) {}
  HostVector<VkDescriptorUpdateTemplateEntry> entries;
  VkPipelineBindPoint bindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;   //!< of push descriptors
};

struct PipelineLayout {
  std::shared_ptr<const pipeline::Layout> layout;
};

PUMICE_HANDLE(DescriptorSetLayout, VkDescriptorSetLayout)
PUMICE_HANDLE(DescriptorPool, VkDescriptorPool)
PUMICE_HANDLE(DescriptorSet, VkDescriptorSet)
PUMICE_HANDLE(DescriptorUpdateTemplate, VkDescriptorUpdateTemplate)
PUMICE_HANDLE(PipelineLayout, VkPipelineLayout)

}  // namespace pumice::icd
