// Pipelines as the executors of draws see them, made from Vulkan create-info structs but owning everything they need.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>

#include "base/result.h"
#include "pipeline/decisions.h"
#include "pipeline/layout.h"
#include "raster/primitive.h"
#include "spirv_interp/frontend/shader.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::pipeline {

//! Which state comes from the command buffer. Bit n = VkDynamicState n for the core ones (0..8).
using DynamicStates = uint32_t;

//! What PUMICE_NUMERICS asks for.
ir::Numerics defaultNumerics();

//! Fixed-function state of a graphics pipeline; plain values, no pointers into the application's memory.
struct GraphicsState {
  std::vector<VkVertexInputBindingDescription> vertexBindings;
  std::vector<VkVertexInputAttributeDescription> vertexAttributes;
  std::vector<VkVertexInputBindingDivisorDescriptionEXT> divisors;   //!< of instanced bindings whose divisor is not 1
  bool wholeAttributes = false;        //!< robustBufferAccess2: an attribute that is out of bounds in part is zero as a whole
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  bool primitiveRestart = false;
  bool rasterizerDiscard = false, depthClamp = false, depthClip = true, depthBias = false;
  bool depthFromMinusOne = false;      //!< clip-space depth goes from -w to w (VK_EXT_depth_clip_control)
  bool unrestrictedDepth = false;      //!< float depths outside [0, 1] are kept (VK_EXT_depth_range_unrestricted)
  bool provokingLast = false;
  raster::LineMode lineMode = raster::LineMode::Rectangular;
  VkPolygonMode polygonMode = VK_POLYGON_MODE_FILL;
  VkCullModeFlags cullMode = 0;
  VkFrontFace frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;
  float depthBiasConstant = 0, depthBiasClamp = 0, depthBiasSlope = 0, lineWidth = 1;
  VkViewport viewport{};               //!< static ones
  VkRect2D scissor{};
  std::vector<VkViewport> furtherViewports;   //!< 1 and up
  std::vector<VkRect2D> furtherScissors;
  uint32_t viewportCount = 1;          //!< when the count is dynamic: the most there may be
  uint32_t samples = 1;
  uint32_t sampleMask = ~0u;
  bool sampleShading = false, alphaToCoverage = false, alphaToOne = false;
  float minSampleShading = 0;
  bool feedbackLoop = false;           //!< shaders may read attachments as images (VK_EXT_attachment_feedback_loop_layout)
  bool depthTest = false, depthWrite = false, depthBoundsTest = false, stencilTest = false;
  VkCompareOp depthCompare = VK_COMPARE_OP_ALWAYS;
  VkStencilOpState stencilFront{}, stencilBack{};
  float minDepthBounds = 0, maxDepthBounds = 1;
  bool logicOpEnable = false;
  VkLogicOp logicOp = VK_LOGIC_OP_COPY;
  std::vector<VkPipelineColorBlendAttachmentState> blend;
  float blendConstants[4] = {};
  VkFormat colorFormats[kMaxColorAttachments] = {};   //!< UNDEFINED where the subpass has no attachment
  uint32_t colorCount = 0;
  VkFormat depthStencilFormat = VK_FORMAT_UNDEFINED;
  bool depthAttached = true, stencilAttached = true;  //!< false: dynamic rendering without this aspect of the format
  DynamicStates dynamic = 0;
  ir::Numerics numerics = defaultNumerics();
  bool decisions = wantedDecisions();  //!< record what fragments decide
};

//! 128 bits that tell shaders (and what else decides how a pipeline's routines look) apart.
using ShaderIdentity = std::array<uint64_t, 2>;
using SavedPipelineKey = std::array<uint64_t, 2>;
class PipelineStore;
//! Where a pipeline leaves its routines for pipelines to come (saved_routines.h), and what its shaders are called there; who emits them.
struct Keeping {
  std::shared_ptr<PipelineStore> store;   //!< null: nowhere
  ShaderIdentity vertex{}, fragment{};    //!< vertex: or compute
  base::ThreadPool* workers = nullptr;    //!< emit what is made with the pipeline while the application goes on; null: nobody does
};

//! Variants by routine key live inside; safe to use from several threads. Kept alive by command buffers in flight.
class GraphicsPipeline;
base::Result<std::shared_ptr<GraphicsPipeline>> createGraphicsPipeline(GraphicsState state, std::shared_ptr<const Layout> layout,
                                                                 std::shared_ptr<const frontend::Shader> vertex,
                                                                 std::shared_ptr<const frontend::Shader> fragment, const Keeping& keeping = {});
const GraphicsState& graphicsState(const GraphicsPipeline& pipeline);

class ComputePipeline;
base::Result<std::shared_ptr<ComputePipeline>> createComputePipeline(std::shared_ptr<const Layout> layout, std::shared_ptr<const frontend::Shader> shader,
                                                                     ir::Numerics numerics = defaultNumerics(), const Keeping& keeping = {});

}  // namespace pumice::pipeline
