// The dynamic state of Vulkan 1.3 that routines are specialised for (cull mode, depth test, topology, strides, ...).
// A pipeline that leaves some of it dynamic is a family: for each combination of values that draws really use, one member
// with these values as its static state, found by the values' bytes.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include "icd/vulkan.h"
#include "pipeline/pipeline.h"

namespace pumice::icd {

enum ExtendedBit : uint32_t {
  kDynamicCullMode = 1 << 0,
  kDynamicFrontFace = 1 << 1,
  kDynamicTopology = 1 << 2,
  kDynamicStride = 1 << 3,
  kDynamicDepthTest = 1 << 4,
  kDynamicDepthWrite = 1 << 5,
  kDynamicDepthCompare = 1 << 6,
  kDynamicDepthBoundsTest = 1 << 7,
  kDynamicStencilTest = 1 << 8,
  kDynamicStencilOp = 1 << 9,
  kDynamicRasterizerDiscard = 1 << 10,
  kDynamicDepthBias = 1 << 11,
  kDynamicPrimitiveRestart = 1 << 12,
  kDynamicVertexInput = 1 << 13,
  kDynamicColorWrite = 1 << 14,
  kDynamicLogicOp = 1 << 15,
};
//! 0 for states of other kinds.
uint32_t extendedBit(VkDynamicState state);

//! Tests whose aspect is not attached are off, and without the test depth is not written.
void leaveOutMissingAspects(pipeline::GraphicsState& s);

//! Colour attachments without their bit are not written.
void leaveOutColorWrites(pipeline::GraphicsState& s, uint32_t enabled);

//! Values set so far in a command buffer. Zero-initialised; compared as bytes.
struct ExtendedState {
  uint32_t cullMode = 0, frontFace = 0, topology = 0;
  uint32_t depthTest = 0, depthWrite = 0, depthCompare = 0, depthBoundsTest = 0, stencilTest = 0;
  uint32_t rasterizerDiscard = 0, depthBias = 0, primitiveRestart = 0;
  uint32_t colorWrites = 0, logicOp = 0;   //!< colorWrites: a bit per attachment
  VkStencilOpState stencil[2] = {};    //!< front, back: operations and compare op only
  uint32_t strides[pipeline::kMaxVertexBindings] = {};
  // Vertex input; of bindings without their strides. Last, because the key takes only what is used of it.
  struct VertexInput {
    uint32_t bindingCount = 0, attributeCount = 0;
    struct Binding {
      uint32_t binding, inputRate, divisor;
    } bindings[pipeline::kMaxVertexBindings] = {};
    VkVertexInputAttributeDescription attributes[pipeline::kMaxVertexAttributes] = {};
  } vertexInput;
};

class PipelineFamily {
 public:
  PipelineFamily(uint32_t mask, pipeline::GraphicsState state, std::shared_ptr<const pipeline::Layout> layout,
                 std::shared_ptr<const frontend::Shader> vertex, std::shared_ptr<const frontend::Shader> fragment, pipeline::Keeping keeping)
      : mask_(mask), state_(std::move(state)), layout_(std::move(layout)), vertex_(std::move(vertex)), fragment_(std::move(fragment)), keeping_(std::move(keeping)) {}
  //! The member for these values; null (and a logged reason) if it cannot be made. Thread-safe.
  std::shared_ptr<pipeline::GraphicsPipeline> member(const ExtendedState& values);

 private:
  std::string keyOf(const ExtendedState& values) const;

  uint32_t mask_;
  pipeline::GraphicsState state_;
  std::shared_ptr<const pipeline::Layout> layout_;
  std::shared_ptr<const frontend::Shader> vertex_, fragment_;
  pipeline::Keeping keeping_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<pipeline::GraphicsPipeline>> members_;
};

}  // namespace pumice::icd
