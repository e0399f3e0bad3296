// An offscreen RGBA8 target, optionally with depth and with several samples a pixel, and the one render pass
// that draws on it.
#pragma once

#include "cts_subset/harness/picture.h"
#include "cts_subset/harness/workspace.h"

#include <glm/glm.hpp>

#include <functional>
#include <optional>

namespace pumice::cts {

// The vertex that most scenes use: location 0 and 1.
struct Vertex {
  glm::vec4 position;   // clip space
  glm::vec4 attribute;  // a colour, or texture coordinates
};

// Passes position and attribute on.
extern const char* const kPassVertex;
// Writes the attribute as colour.
extern const char* const kColourFragment;
// The attribute with affine (noperspective) interpolation: the pair for broken variants.
extern const char* const kPassVertexAffine;

// The structures a pipeline is made from, for scenes that need more than PipelineSpec names.
struct PipelineStates {
  VkPipelineViewportStateCreateInfo viewport{};
  VkPipelineRasterizationStateCreateInfo raster{};
  VkPipelineMultisampleStateCreateInfo multisample{};
  VkPipelineDepthStencilStateCreateInfo depth{};
  VkPipelineColorBlendStateCreateInfo blend{};
  VkRenderPass renderPass = VK_NULL_HANDLE;  // the canvas's own, unless changed
  uint32_t subpass = 0;
};

struct PipelineSpec {
  std::string vertex = kPassVertex;
  std::string fragment = kColourFragment;
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  bool primitiveRestart = false;
  VkCullModeFlags cull = VK_CULL_MODE_NONE;
  VkFrontFace frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;
  bool depthTest = false;
  bool depthWrite = false;
  VkCompareOp compare = VK_COMPARE_OP_LESS;
  std::optional<VkStencilOpState> stencil;  // for both faces
  std::optional<glm::vec2> depthBias;       // constant factor, slope factor
  std::optional<VkPipelineColorBlendAttachmentState> blend;
  VkColorComponentFlags writeMask = 0xf;
  std::vector<VkDescriptorSetLayout> sets;
  std::vector<VkPushConstantRange> pushConstants;
  // Empty: one binding of Vertex.
  std::vector<VkVertexInputBindingDescription> bindings;
  std::vector<VkVertexInputAttributeDescription> attributes;
  const VkSpecializationInfo* fragmentSpecialization = nullptr;
  // Called last, for changes.
  std::function<void(PipelineStates&)> adjust;
};

class Canvas : public Workspace {
 public:
  static constexpr VkFormat kColourFormat = VK_FORMAT_R8G8B8A8_UNORM;

  Canvas(Device& device, uint32_t width, uint32_t height, VkFormat depthFormat = VK_FORMAT_UNDEFINED,
         VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT, VkAttachmentStoreOp storeDepth = VK_ATTACHMENT_STORE_OP_STORE);

  Pipeline pipeline(const PipelineSpec& spec);
  // The VkResult instead of an exception; for pipelines that ought to fail.
  VkResult tryPipeline(const PipelineSpec& spec, VkShaderModule vertex, VkShaderModule fragment,
                       Pipeline& made);

  // Clears, sets viewport and scissor to the whole canvas, and calls `record` inside the pass.
  // `showDepth` reads the depth attachment back too.
  Picture draw(const glm::vec4& clearColour, const std::function<void(VkCommandBuffer)>& record,
               bool showDepth = false, float clearDepth = 1.0f);

  // One draw call with its own vertex buffer.
  void drawVertices(VkCommandBuffer commands, const Pipeline& pipeline, const std::vector<Vertex>& vertices);
  void bindVertices(VkCommandBuffer commands, const std::vector<Vertex>& vertices);

  glm::uvec2 size() const { return {width, height}; }
  VkRenderPass pass() const { return renderPass; }
  VkFramebuffer target() const { return framebuffer; }
  const Image& colourImage() const { return colour; }

 private:
  std::vector<float> unpackDepth(const Buffer& bytes) const;

  uint32_t width, height;
  VkFormat depthFormat;
  VkSampleCountFlagBits samples;
  Image colour, depth;  // `colour` has one sample: where several are resolved to, if there are
  VkRenderPass renderPass = VK_NULL_HANDLE;
  VkFramebuffer framebuffer = VK_NULL_HANDLE;
  Buffer readback, depthReadback;
};

void setViewport(VkCommandBuffer commands, float x, float y, float width, float height, float minDepth = 0,
                 float maxDepth = 1);
void setScissor(VkCommandBuffer commands, int32_t x, int32_t y, uint32_t width, uint32_t height);

// A clip-space position whose pixel coordinates on a canvas of power-of-two size are exactly
// (x, y), as long as those are multiples of 1/256.
glm::vec4 atPixel(const glm::uvec2& canvas, double x, double y, float z = 0.0f);

}  // namespace pumice::cts
