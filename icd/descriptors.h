// Descriptor set layouts, pools, sets, update templates, pipeline layouts.
#pragma once

#include <array>
#include <memory>
#include <unordered_set>
#include <vector>

#include "icd/resources.h"
#include "pipeline/layout.h"

namespace pumice::icd {

struct DescriptorSetLayout {
  //! Shared: sets, pipeline layouts and pools may outlive the handle.
  std::shared_ptr<const pipeline::SetLayout> layout;
};

struct DescriptorPool;

struct DescriptorSet {
  std::shared_ptr<const pipeline::SetLayout> layout;
  DescriptorPool* pool = nullptr;
  std::byte* memory = nullptr;   //!< layout->size bytes, 64-byte aligned, zero = null descriptors
  std::byte* at(const pipeline::Binding& b, uint32_t element) const { return memory + b.offset + size_t(b.stride) * element; }
};

//! Descriptor counts by core type (0..10), and bytes of set memory.
struct DescriptorPool {
  explicit DescriptorPool(HostAllocator a) : allocator(a) {}
  ~DescriptorPool();
  HostAllocator allocator;
  uint32_t maxSets = 0;
  std::array<uint32_t, 11> available{};
  std::unordered_set<DescriptorSet*> sets;
  VkResult allocate(const DescriptorSetLayout& layout, DescriptorSet** out);
  void free(DescriptorSet* set);
  void reset();
};

struct DescriptorUpdateTemplate {
  std::vector<VkDescriptorUpdateTemplateEntry> entries;
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
