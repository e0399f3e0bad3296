// Execution of render passes, draws and dispatches: called by the queue's thread, uses the pool.
#pragma once

#include "base/threads.h"
#include "pipeline/pipeline.h"
#include "raster/primitive.h"
#include "texture/transfer.h"

namespace pumice::pipeline {

//! State of the command buffer at a draw, but for the pipeline: captured values, no Vulkan objects. Pointers stay valid until the pass ends.
struct DrawValues {
  VkViewport viewport{};                       //!< resolved: static or dynamic
  VkRect2D scissor{};
  VkViewport furtherViewports[raster::kMaxViewports - 1] = {};   //!< 1 and up; those of the pipeline's viewportCount
  VkRect2D furtherScissors[raster::kMaxViewports - 1] = {};
  float lineWidth = 1;
  float depthBiasConstant = 0, depthBiasClamp = 0, depthBiasSlope = 0;
  float blendConstants[4] = {};
  float depthBounds[2] = {0, 1};
  uint32_t stencilReference[2] = {}, stencilCompareMask[2] = {}, stencilWriteMask[2] = {};
  VertexBufferRef vertexBuffers[kMaxVertexBindings];
  uint64_t indexBase = 0, indexSize = 0;       //!< address, bytes
  VkIndexType indexType = VK_INDEX_TYPE_UINT16;
  const std::byte* setMemory[ir::kMaxDescriptorSets] = {};
  uint64_t setSize[ir::kMaxDescriptorSets] = {};
  uint32_t dynamicOffsets[kMaxDynamicOffsets] = {};
  std::byte push[kMaxPushBytes] = {};
};

//! What a draw takes of it, it copies.
struct DrawState : DrawValues {
  std::shared_ptr<GraphicsPipeline> pipeline;
};

struct DrawParams {
  bool indexed = false;
  uint32_t count = 0;              //!< vertices or indices
  uint32_t instanceCount = 1;
  uint32_t first = 0;              //!< firstVertex or firstIndex
  int32_t vertexOffset = 0;
  uint32_t firstInstance = 0;
  uint32_t drawIndex = 0;
};

//! An attachment of a pass: one level and a run of layers of an image (a view's format may differ from the image's).
struct Attachment {
  texture::ImageMemory memory;     //!< layout null: unused
  VkFormat format = VK_FORMAT_UNDEFINED;
  uint32_t level = 0, baseLayer = 0, layerCount = 1;
  VkAttachmentLoadOp loadOp = VK_ATTACHMENT_LOAD_OP_LOAD, stencilLoadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  VkAttachmentStoreOp storeOp = VK_ATTACHMENT_STORE_OP_STORE, stencilStoreOp = VK_ATTACHMENT_STORE_OP_STORE;
  VkClearValue clear{};
};

//! One subpass (or dynamic rendering scope).
struct PassBegin {
  VkRect2D renderArea{};
  uint32_t width = 0, height = 0, layers = 1;   //!< framebuffer
  uint32_t viewIndex = 0;                       //!< of multiview: this pass draws one view
  Attachment color[kMaxColorAttachments];
  Attachment resolve[kMaxColorAttachments];     //!< same index as color
  uint32_t colorCount = 0;
  Attachment depthStencil;
  Attachment depthStencilResolve;
  VkResolveModeFlagBits depthResolve = VK_RESOLVE_MODE_NONE, stencilResolve = VK_RESOLVE_MODE_NONE;
};

//! Counters of a pass. Those marked * are counted only when statistics are asked for; without them fragments that Hi-Z rejects in bulk
//! are not counted as covered.
struct PassCounters {
  uint64_t draws = 0, verticesShaded = 0, verticesReused = 0, primitives = 0, quads = 0, tilesTouched = 0;
  uint64_t fragmentsCovered = 0;                                   //!< pixels (or samples, where these are shaded) with coverage
  uint64_t fragmentsShaded = 0;                                    //!< * fragment shader invocations without helpers
  uint64_t samplesTested = 0, samplesPassed = 0;                   //!< * samples of fragments; written ones
  uint64_t samplesRejected = 0;                                    //!< * failed by Hi-Z alone
  uint64_t samplesHidden = 0;                                      //!< * passed, but hidden by a later one before they were shaded
  uint64_t varyingsInterpolated = 0, varyingsDropped = 0;          //!< scalars: read by fragment shaders of the draws; written but not read
  uint64_t bytesCleared = 0, bytesLoaded = 0, bytesStored = 0;     //!< of attachments, by load and store operations, in tiles that were worked on
  //! 4x4 blocks of multisampled colour attachments: at the end of the pass all samples had one colour and one plane; they came to differ
  //! (or to be read) before; of the former, all planes were written then.
  uint64_t blocksOneColor = 0, blocksSplit = 0, blocksStored = 0;
  raster::SetupCounters setup;
};

//! What a pipeline statistics query counts, in the order of VkQueryPipelineStatisticFlagBits.
struct PipelineStatistics {
  enum Number {
    InputVertices, InputPrimitives, VertexInvocations,
    ClippingInvocations = 5, ClippingPrimitives, FragmentInvocations,
    ComputeInvocations = 10, Count
  };
  uint64_t values[Count] = {};
};

//! Collects draws until end(), then finishes them tile by tile. One per queue; re-used from pass to pass.
class PassExecutor {
 public:
  explicit PassExecutor(base::ThreadPool& pool);
  ~PassExecutor();
  void begin(const PassBegin& pass);
  void draw(const DrawState& state, const DrawParams& params);
  //! vkCmdClearAttachments
  void clear(const VkClearAttachment& attachment, const VkClearRect& rect);
  //! Adds the samples that pass depth and stencil tests from here to the matching endOcclusion() to *counter (at end()).
  void beginOcclusion(uint64_t* counter);
  void endOcclusion();
  //! Adds what draws do from here to the matching endStatistics() (complete at end()).
  void beginStatistics(PipelineStatistics* to);
  void endStatistics();
  void end();
  //! From the next pass on: count everything, at some cost (routines are variants that count). PUMICE_STATS=1 does, and prints.
  void collectStatistics(bool on);
  //! Turns ideas (pipeline/ideas.h) off and the others on; between passes. At the start: as PUMICE_DISABLE says.
  void disable(uint32_t ideas);
  const PassCounters& counters() const;   //!< of the last finished pass
  const DecisionRecord& decisions() const;   //!< of the last finished pass, if its pipelines record them
  struct Impl;   //!< pass_impl.h
 private:
  std::unique_ptr<Impl> impl_;
};

struct DispatchState {
  std::shared_ptr<ComputePipeline> pipeline;
  const std::byte* setMemory[ir::kMaxDescriptorSets] = {};
  uint64_t setSize[ir::kMaxDescriptorSets] = {};
  uint32_t dynamicOffsets[kMaxDynamicOffsets] = {};
  std::byte push[kMaxPushBytes] = {};
};
//! Invocations of one work group.
uint64_t groupInvocations(const ComputePipeline& pipeline);
void dispatch(base::ThreadPool& pool, const DispatchState& state, const uint32_t baseGroup[3], const uint32_t groupCount[3]);

}  // namespace pumice::pipeline
