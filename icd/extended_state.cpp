#include "icd/extended_state.h"

#include <cstddef>
#include <cstring>

#include "base/fpenv.h"
#include "base/log.h"
#include "entrypoints.h"
#include "icd/command_buffer.h"

namespace pumice::icd {
namespace {

struct StateBit {
  VkDynamicState state;
  uint32_t bit;
};
constexpr StateBit kBits[] = {
    {VK_DYNAMIC_STATE_CULL_MODE, kDynamicCullMode},
    {VK_DYNAMIC_STATE_FRONT_FACE, kDynamicFrontFace},
    {VK_DYNAMIC_STATE_PRIMITIVE_TOPOLOGY, kDynamicTopology},
    {VK_DYNAMIC_STATE_VERTEX_INPUT_BINDING_STRIDE, kDynamicStride},
    {VK_DYNAMIC_STATE_DEPTH_TEST_ENABLE, kDynamicDepthTest},
    {VK_DYNAMIC_STATE_DEPTH_WRITE_ENABLE, kDynamicDepthWrite},
    {VK_DYNAMIC_STATE_DEPTH_COMPARE_OP, kDynamicDepthCompare},
    {VK_DYNAMIC_STATE_DEPTH_BOUNDS_TEST_ENABLE, kDynamicDepthBoundsTest},
    {VK_DYNAMIC_STATE_STENCIL_TEST_ENABLE, kDynamicStencilTest},
    {VK_DYNAMIC_STATE_STENCIL_OP, kDynamicStencilOp},
    {VK_DYNAMIC_STATE_RASTERIZER_DISCARD_ENABLE, kDynamicRasterizerDiscard},
    {VK_DYNAMIC_STATE_DEPTH_BIAS_ENABLE, kDynamicDepthBias},
    {VK_DYNAMIC_STATE_PRIMITIVE_RESTART_ENABLE, kDynamicPrimitiveRestart},
    {VK_DYNAMIC_STATE_VERTEX_INPUT_EXT, kDynamicVertexInput},
    {VK_DYNAMIC_STATE_COLOR_WRITE_ENABLE_EXT, kDynamicColorWrite},
    {VK_DYNAMIC_STATE_LOGIC_OP_EXT, kDynamicLogicOp},
};

void setOps(VkStencilOpState& to, const VkStencilOpState& from) {
  to.failOp = from.failOp;
  to.passOp = from.passOp;
  to.depthFailOp = from.depthFailOp;
  to.compareOp = from.compareOp;
}

void applyVertexInput(pipeline::GraphicsState& s, const ExtendedState& v) {
  const auto& input = v.vertexInput;
  s.vertexBindings.clear();
  s.divisors.clear();
  for (uint32_t i = 0; i < input.bindingCount; i++) {
    const auto& b = input.bindings[i];
    s.vertexBindings.push_back({b.binding, v.strides[b.binding], VkVertexInputRate(b.inputRate)});
    if (b.inputRate == VK_VERTEX_INPUT_RATE_INSTANCE && b.divisor != 1) s.divisors.push_back({b.binding, b.divisor});
  }
  s.vertexAttributes.assign(input.attributes, input.attributes + input.attributeCount);
}

void apply(pipeline::GraphicsState& s, uint32_t mask, const ExtendedState& v) {
  if (mask & kDynamicVertexInput) applyVertexInput(s, v);
  if (mask & kDynamicCullMode) s.cullMode = v.cullMode;
  if (mask & kDynamicFrontFace) s.frontFace = VkFrontFace(v.frontFace);
  if (mask & kDynamicTopology) s.topology = VkPrimitiveTopology(v.topology);
  if (mask & kDynamicStride)
    for (auto& b : s.vertexBindings)
      if (b.binding < pipeline::kMaxVertexBindings) b.stride = v.strides[b.binding];
  if (mask & kDynamicDepthTest) s.depthTest = v.depthTest;
  if (mask & kDynamicDepthWrite) s.depthWrite = v.depthWrite;
  if (mask & kDynamicDepthCompare) s.depthCompare = VkCompareOp(v.depthCompare);
  if (mask & kDynamicDepthBoundsTest) s.depthBoundsTest = v.depthBoundsTest;
  if (mask & kDynamicStencilTest) s.stencilTest = v.stencilTest;
  if (mask & kDynamicStencilOp) setOps(s.stencilFront, v.stencil[0]), setOps(s.stencilBack, v.stencil[1]);
  if (mask & kDynamicRasterizerDiscard) s.rasterizerDiscard = v.rasterizerDiscard;
  if (mask & kDynamicDepthBias) s.depthBias = v.depthBias;
  if (mask & kDynamicPrimitiveRestart) s.primitiveRestart = v.primitiveRestart;
  if (mask & kDynamicColorWrite) leaveOutColorWrites(s, v.colorWrites);
  if (mask & kDynamicLogicOp) s.logicOp = VkLogicOp(v.logicOp);
  leaveOutMissingAspects(s);
}

}  // namespace

void leaveOutMissingAspects(pipeline::GraphicsState& s) {
  bool any = s.depthStencilFormat != VK_FORMAT_UNDEFINED;
  if (!any || !s.depthAttached) s.depthTest = s.depthBoundsTest = false;
  if (!any || !s.stencilAttached) s.stencilTest = false;
  s.depthWrite = s.depthWrite && s.depthTest;
}

void leaveOutColorWrites(pipeline::GraphicsState& s, uint32_t enabled) {
  for (size_t i = 0; i < s.blend.size(); i++)
    if (!(enabled >> i & 1)) s.blend[i].colorWriteMask = 0;
}

uint32_t extendedBit(VkDynamicState state) {
  for (const StateBit& b : kBits)
    if (b.state == state) return b.bit;
  return 0;
}

// What differs: the values that this pipeline leaves dynamic.
std::string PipelineFamily::keyOf(const ExtendedState& values) const {
  ExtendedState relevant;
  auto take = [&](uint32_t bit, uint32_t& to, uint32_t from) { to = mask_ & bit ? from : 0; };
  take(kDynamicCullMode, relevant.cullMode, values.cullMode);
  take(kDynamicFrontFace, relevant.frontFace, values.frontFace);
  take(kDynamicTopology, relevant.topology, values.topology);
  take(kDynamicDepthTest, relevant.depthTest, values.depthTest);
  take(kDynamicDepthWrite, relevant.depthWrite, values.depthWrite);
  take(kDynamicDepthCompare, relevant.depthCompare, values.depthCompare);
  take(kDynamicDepthBoundsTest, relevant.depthBoundsTest, values.depthBoundsTest);
  take(kDynamicStencilTest, relevant.stencilTest, values.stencilTest);
  take(kDynamicRasterizerDiscard, relevant.rasterizerDiscard, values.rasterizerDiscard);
  take(kDynamicDepthBias, relevant.depthBias, values.depthBias);
  take(kDynamicPrimitiveRestart, relevant.primitiveRestart, values.primitiveRestart);
  take(kDynamicColorWrite, relevant.colorWrites, values.colorWrites);
  take(kDynamicLogicOp, relevant.logicOp, values.logicOp);
  if (mask_ & kDynamicStencilOp) std::memcpy(relevant.stencil, values.stencil, sizeof relevant.stencil);
  const auto& input = values.vertexInput;
  if (mask_ & kDynamicVertexInput)
    for (uint32_t i = 0; i < input.bindingCount; i++) relevant.strides[input.bindings[i].binding] = values.strides[input.bindings[i].binding];
  else if (mask_ & kDynamicStride)
    for (auto& b : state_.vertexBindings)
      if (b.binding < pipeline::kMaxVertexBindings) relevant.strides[b.binding] = values.strides[b.binding];
  std::string key(reinterpret_cast<const char*>(&relevant), offsetof(ExtendedState, vertexInput));
  if (mask_ & kDynamicVertexInput) {
    key.append(reinterpret_cast<const char*>(input.bindings), input.bindingCount * sizeof *input.bindings);
    key.append(1, '|');
    key.append(reinterpret_cast<const char*>(input.attributes), input.attributeCount * sizeof *input.attributes);
  }
  return key;
}

std::shared_ptr<pipeline::GraphicsPipeline> PipelineFamily::member(const ExtendedState& values) {
  const std::string key = keyOf(values);
  std::lock_guard lock(mutex_);
  auto& slot = members_[key];
  if (!slot) {
    const base::ScopedFpEnv environment;
    pipeline::GraphicsState state = state_;
    apply(state, mask_, values);
    auto made = pipeline::createGraphicsPipeline(std::move(state), layout_, vertex_, state.rasterizerDiscard ? nullptr : fragment_, keeping_);
    if (!made) {
      base::logError("a draw with dynamic state: %s", made.error().message.c_str());
      return nullptr;
    }
    slot = *made;
  }
  return slot;
}

// --- the commands

#define PUMICE_SETTER(command, type, member)                                  \
  VKAPI_ATTR void VKAPI_CALL command(VkCommandBuffer buffer, type value) {    \
    from(buffer)->extended.member = uint32_t(value);                          \
    from(buffer)->stateChanged();                                          \
  }
PUMICE_SETTER(vkCmdSetCullMode, VkCullModeFlags, cullMode)
PUMICE_SETTER(vkCmdSetFrontFace, VkFrontFace, frontFace)
PUMICE_SETTER(vkCmdSetPrimitiveTopology, VkPrimitiveTopology, topology)
PUMICE_SETTER(vkCmdSetDepthTestEnable, VkBool32, depthTest)
PUMICE_SETTER(vkCmdSetDepthWriteEnable, VkBool32, depthWrite)
PUMICE_SETTER(vkCmdSetDepthCompareOp, VkCompareOp, depthCompare)
PUMICE_SETTER(vkCmdSetDepthBoundsTestEnable, VkBool32, depthBoundsTest)
PUMICE_SETTER(vkCmdSetStencilTestEnable, VkBool32, stencilTest)
PUMICE_SETTER(vkCmdSetRasterizerDiscardEnable, VkBool32, rasterizerDiscard)
PUMICE_SETTER(vkCmdSetDepthBiasEnable, VkBool32, depthBias)
PUMICE_SETTER(vkCmdSetPrimitiveRestartEnable, VkBool32, primitiveRestart)
PUMICE_SETTER(vkCmdSetLogicOpEXT, VkLogicOp, logicOp)
#undef PUMICE_SETTER

VKAPI_ATTR void VKAPI_CALL vkCmdSetStencilOp(VkCommandBuffer buffer, VkStencilFaceFlags faces, VkStencilOp fail, VkStencilOp pass, VkStencilOp depthFail, VkCompareOp compare) {
  VkStencilOpState ops{fail, pass, depthFail, compare, 0, 0, 0};
  for (uint32_t i = 0; i < 2; i++)
    if (faces >> i & 1) setOps(from(buffer)->extended.stencil[i], ops);
  from(buffer)->stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetColorWriteEnableEXT(VkCommandBuffer buffer, uint32_t count, const VkBool32* enables) {
  uint32_t& writes = from(buffer)->extended.colorWrites;
  for (uint32_t i = 0; i < count && i < pipeline::kMaxColorAttachments; i++) writes = (writes & ~(1u << i)) | (enables[i] ? 1u << i : 0);
  from(buffer)->stateChanged();
}

// Of a feature that is not there.
VKAPI_ATTR void VKAPI_CALL vkCmdSetPatchControlPointsEXT(VkCommandBuffer, uint32_t) {}

VKAPI_ATTR void VKAPI_CALL vkCmdSetViewportWithCount(VkCommandBuffer b, uint32_t count, const VkViewport* viewports) { vkCmdSetViewport(b, 0, count, viewports); }
VKAPI_ATTR void VKAPI_CALL vkCmdSetScissorWithCount(VkCommandBuffer b, uint32_t count, const VkRect2D* scissors) { vkCmdSetScissor(b, 0, count, scissors); }

VKAPI_ATTR void VKAPI_CALL vkCmdBindVertexBuffers2(VkCommandBuffer buffer, uint32_t first, uint32_t count, const VkBuffer* buffers, const VkDeviceSize* offsets,
                                                   const VkDeviceSize* sizes, const VkDeviceSize* strides) {
  CommandBuffer& cb = *from(buffer);
  vkCmdBindVertexBuffers(buffer, first, count, buffers, offsets);
  for (uint32_t i = 0; i < count && first + i < pipeline::kMaxVertexBindings; i++) {
    if (sizes && buffers[i]) cb.draw.vertexBuffers[first + i].size = from(buffers[i])->range(offsets[i], sizes[i]).size;
    if (strides) cb.extended.strides[first + i] = uint32_t(strides[i]);
  }
  if (strides) cb.stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetVertexInputEXT(VkCommandBuffer buffer, uint32_t bindingCount, const VkVertexInputBindingDescription2EXT* bindings, uint32_t attributeCount,
                                                  const VkVertexInputAttributeDescription2EXT* attributes) {
  ExtendedState& e = from(buffer)->extended;
  e.vertexInput = {};
  for (uint32_t i = 0; i < bindingCount && i < pipeline::kMaxVertexBindings; i++) {
    const auto& b = bindings[i];
    if (b.binding >= pipeline::kMaxVertexBindings) continue;
    e.strides[b.binding] = b.stride;
    e.vertexInput.bindings[e.vertexInput.bindingCount++] = {b.binding, uint32_t(b.inputRate), b.divisor};
  }
  for (uint32_t i = 0; i < attributeCount && i < pipeline::kMaxVertexAttributes; i++)
    e.vertexInput.attributes[e.vertexInput.attributeCount++] = {attributes[i].location, attributes[i].binding, attributes[i].format, attributes[i].offset};
  from(buffer)->stateChanged();
}

// Stippled lines are not supported, so nothing reads the pattern; the command belongs to the extension all the same.
VKAPI_ATTR void VKAPI_CALL vkCmdSetLineStippleEXT(VkCommandBuffer, uint32_t, uint16_t) {}

}  // namespace pumice::icd
