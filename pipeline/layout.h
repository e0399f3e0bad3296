// Where descriptors and draw constants lie in memory: the border between icd/ (which writes them) and routines.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "spirv_interp/ir/ir.h"
#include "texture/descriptor.h"

namespace pumice::pipeline {

constexpr uint32_t kMaxDynamicOffsets = 32;   //!< maxDescriptorSet{Uniform,Storage}BuffersDynamic together

struct Binding {
  VkDescriptorType type = VK_DESCRIPTOR_TYPE_MAX_ENUM;
  uint32_t count = 0;
  uint32_t offset = 0;          //!< bytes in set memory
  uint32_t stride = 0;          //!< texture::descriptorStride(type)
  uint32_t inlineBytes = 0;     //!< of an inline uniform block: then type is UNIFORM_BUFFER, count 1, and the descriptor points to the bytes 64 behind it
  bool variable = false;        //!< the last binding of the set: a set may have fewer than count elements
  uint32_t dynamicIndex = 0;    //!< first dynamic offset of this binding within its set (dynamic buffer types)
  VkShaderStageFlags stages = 0;
  std::vector<texture::SamplerDescriptor> immutableSamplers;
};

//! Bindings by number, in the order of their numbers.
class BindingTable {
 public:
  using Entry = std::pair<uint32_t, Binding>;
  using const_iterator = std::vector<Entry>::const_iterator;
  //! Adds a binding, in place of one of this number.
  void set(uint32_t number, Binding binding) {
    auto at = entries_.begin() + (lowerBound(number) - entries_.cbegin());
    if (at != entries_.end() && at->first == number) at->second = std::move(binding);
    else entries_.emplace(at, number, std::move(binding));
  }
  const_iterator find(uint32_t number) const {
    if (number < entries_.size() && entries_[number].first == number) [[likely]] return begin() + number;   // numbers without holes
    const auto at = lowerBound(number);
    return at != end() && at->first == number ? at : end();
  }
  const_iterator begin() const { return entries_.begin(); }
  const_iterator end() const { return entries_.end(); }
  auto begin() { return entries_.begin(); }
  auto end() { return entries_.end(); }
  const Entry& back() const { return entries_.back(); }
  size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }

 private:
  const_iterator lowerBound(uint32_t number) const {
    return std::lower_bound(begin(), end(), number, [](const Entry& e, uint32_t n) { return e.first < n; });
  }
  std::vector<Entry> entries_;
};

//! Lies before the memory of sets whose layout is `headed`.
struct alignas(64) SetHeader {
  uint64_t generation = 0;      //!< another one after each write, and never that of another set (atomic)
};

struct SetLayout {
  BindingTable bindings;
  uint32_t size = 0;            //!< bytes of set memory
  bool headed = false;          //!< has arrays of images or samplers: what is in them is remembered as long as nobody writes
  uint32_t dynamicCount = 0;
};

struct Layout {
  std::vector<SetLayout> sets;               //!< copies: layouts may be destroyed before pipelines
  std::vector<uint32_t> dynamicBase;         //!< per set: index of its first dynamic offset in DrawConstants
  uint32_t pushBytes = 0;
  //! Of all sets: those of DrawConstants that are used.
  uint32_t dynamicOffsets() const {
    uint32_t end = 0;
    for (size_t i = 0; i < sets.size(); ++i)
      if (sets[i].dynamicCount) end = std::max(end, (i < dynamicBase.size() ? dynamicBase[i] : 0) + sets[i].dynamicCount);
    return std::min(end, kMaxDynamicOffsets);
  }
  const Binding* find(uint32_t set, uint32_t binding) const {
    if (set >= sets.size()) return nullptr;
    auto it = sets[set].bindings.find(binding);
    return it == sets[set].bindings.end() ? nullptr : &it->second;
  }
};

constexpr uint32_t kMaxPushBytes = 256;
constexpr uint32_t kMaxGroupInvocations = 1024;   //!< of a work group, in any shape
constexpr uint32_t kMaxVertexBindings = 32;
constexpr uint32_t kMaxVertexAttributes = 32;
constexpr uint32_t kMaxColorAttachments = 8;

struct VertexBufferRef { uint64_t base = 0, size = 0; };

//! The memory behind ir::kTableDraw. Routines read it with UniformInput.
struct DrawConstants {
  int32_t vertexOffset = 0;          //!< BaseVertex
  uint32_t firstVertex = 0;
  uint32_t firstInstance = 0;
  uint32_t drawIndex = 0;
  uint32_t viewIndex = 0;
  uint32_t groupCount[3] = {};       //!< dispatch: NumWorkgroups
  uint32_t baseGroup[3] = {};
  uint32_t samples = 1;
  uint32_t passDraw = 0;             //!< number of the draw in its pass
  float blendConstants[4] = {};
  float minDepth = 0, maxDepth = 1;  //!< viewport
  uint32_t stencilReference[2] = {}, stencilCompareMask[2] = {}, stencilWriteMask[2] = {};   //!< front, back
  float depthBounds[2] = {0, 1};
  uint32_t dynamicOffsets[kMaxDynamicOffsets] = {};
};

//! What vertex routines find there.
struct VertexConstants {
  DrawConstants draw;
  VertexBufferRef vertexBuffers[kMaxVertexBindings];
};

}  // namespace pumice::pipeline
