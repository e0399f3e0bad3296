// Command pools and buffers, execution of the list, state and draws. Copies are in commands_transfer.cpp, passes and
// queries in commands_pass.cpp.
#include "icd/command_buffer.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <utility>

#include "entrypoints.h"

namespace pumice::icd {

void CommandBuffer::reset() {
  for (Command* c = head; c;) {
    Command* next = c->next;
    c->destroy(c);
    c = next;
  }
  head = nullptr;
  tail = &head;
  arena.reset();
  outOfMemory = waitsForEvents = false;
  draw = {};
  dispatch = {};
  dynamic = {};
  extended = {};
  std::fill(std::begin(pushedDraw), std::end(pushedDraw), nullptr);
  std::fill(std::begin(pushedDispatch), std::end(pushedDispatch), nullptr);
  family = nullptr;
  isCaptured = isMerged = false;
  touched = 0;
  captured = {};
}

void CommandBuffer::execute(Execution& e) const {
  Command* outer = e.current;
  for (Command* c = head; c && !e.pool.cancelled();) {
    e.current = c;
    if (c->run) c->run(c, e);
    c = e.jump ? std::exchange(e.jump, nullptr) : c->next;
  }
  e.current = outer;
}

// What the pipeline decides or leaves dynamic. Its part of the values ends where the vertex buffers begin.
bool CommandBuffer::mergeState() {
  if (family) try {
      draw.pipeline = family->member(extended);
    } catch (const std::bad_alloc&) {
      outOfMemory = true;
      return false;
    }
  if (!draw.pipeline) return false;
  const pipeline::GraphicsState& s = pipeline::graphicsState(*draw.pipeline);
  auto is = [&](VkDynamicState state) { return s.dynamic >> state & 1; };
  draw.viewport = is(VK_DYNAMIC_STATE_VIEWPORT) ? dynamic.viewports[0] : s.viewport;
  draw.scissor = is(VK_DYNAMIC_STATE_SCISSOR) ? dynamic.scissors[0] : s.scissor;
  if (s.viewportCount > 1) {
    const VkViewport* viewports = is(VK_DYNAMIC_STATE_VIEWPORT) ? dynamic.viewports + 1 : s.furtherViewports.data();
    const VkRect2D* scissors = is(VK_DYNAMIC_STATE_SCISSOR) ? dynamic.scissors + 1 : s.furtherScissors.data();
    std::copy_n(viewports, s.viewportCount - 1, draw.furtherViewports);
    std::copy_n(scissors, s.viewportCount - 1, draw.furtherScissors);
  }
  draw.lineWidth = is(VK_DYNAMIC_STATE_LINE_WIDTH) ? dynamic.lineWidth : s.lineWidth;
  bool bias = is(VK_DYNAMIC_STATE_DEPTH_BIAS);
  draw.depthBiasConstant = bias ? dynamic.depthBias[0] : s.depthBiasConstant;
  draw.depthBiasClamp = bias ? dynamic.depthBias[1] : s.depthBiasClamp;
  draw.depthBiasSlope = bias ? dynamic.depthBias[2] : s.depthBiasSlope;
  std::copy_n(is(VK_DYNAMIC_STATE_BLEND_CONSTANTS) ? dynamic.blendConstants : s.blendConstants, 4, draw.blendConstants);
  bool bounds = is(VK_DYNAMIC_STATE_DEPTH_BOUNDS);
  draw.depthBounds[0] = bounds ? dynamic.depthBounds[0] : s.minDepthBounds;
  draw.depthBounds[1] = bounds ? dynamic.depthBounds[1] : s.maxDepthBounds;
  const VkStencilOpState* faces[2] = {&s.stencilFront, &s.stencilBack};
  for (int i = 0; i < 2; i++) {
    draw.stencilCompareMask[i] = is(VK_DYNAMIC_STATE_STENCIL_COMPARE_MASK) ? dynamic.stencilCompareMask[i] : faces[i]->compareMask;
    draw.stencilWriteMask[i] = is(VK_DYNAMIC_STATE_STENCIL_WRITE_MASK) ? dynamic.stencilWriteMask[i] : faces[i]->writeMask;
    draw.stencilReference[i] = is(VK_DYNAMIC_STATE_STENCIL_REFERENCE) ? dynamic.stencilReference[i] : faces[i]->reference;
  }
  valuesChanged(stateChunk(draw, 0), offsetof(pipeline::DrawValues, vertexBuffers));
  return isMerged = true;
}

// Many draws between two changes of state share one copy.
bool CommandBuffer::captureDraw() {
  if (isCaptured) return true;
  if (!isMerged && !mergeState()) return false;
  if (captured.whole && captured.whole->pipeline == draw.pipeline) {
    assert(!differingChunks(*captured.whole, draw, kAllStateChunks & ~touched));
    const StateChunks changed = differingChunks(*captured.whole, draw, touched);
    const size_t count = size_t(std::popcount(changed));
    if (count <= kStateChunks / 4) {
      auto* chunks = static_cast<std::byte*>(arena.allocBytes(std::max<size_t>(count, 1) * kStateChunk, alignof(uint64_t)));
      if (!chunks) {
        outOfMemory = true;
        return false;
      }
      captured.changed = changed;
      captured.chunks = chunks;
      for (StateChunks left = changed; left; left &= left - 1, chunks += kStateChunk) {
        const size_t i = lowestChunk(left);
        std::memcpy(chunks, stateChunk(draw, i), stateChunkBytes(i));
      }
      return isCaptured = true;
    }
  }
  struct Kept : Command {
    explicit Kept(const pipeline::DrawState& d) : state(d) {}
    pipeline::DrawState state;
  };
  void* memory = arena.allocBytes(sizeof(Kept), alignof(Kept));
  if (!memory) {
    outOfMemory = true;
    return false;
  }
  auto* kept = new (memory) Kept(draw);
  kept->destroy = [](Command* c) { static_cast<Kept*>(c)->~Kept(); };
  *tail = kept;
  tail = &kept->next;
  captured = {&kept->state, 0, nullptr};
  touched = 0;
  return isCaptured = true;
}

CommandPool::~CommandPool() {
  while (CommandBuffer* b = buffers.first()) {
    buffers.erase(b);
    destroyObject(allocator, b);
  }
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateCommandPool(VkDevice handle, const VkCommandPoolCreateInfo*, const VkAllocationCallbacks* callbacks, VkCommandPool* out) {
  Device& device = *from(handle);
  auto* pool = device.make<CommandPool>(callbacks, device.allocatorFor(callbacks));
  if (!pool) return VK_ERROR_OUT_OF_HOST_MEMORY;
  *out = to<VkCommandPool>(pool);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyCommandPool(VkDevice device, VkCommandPool pool, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(pool)); }

VKAPI_ATTR VkResult VKAPI_CALL vkResetCommandPool(VkDevice, VkCommandPool pool, VkCommandPoolResetFlags flags) {
  for (CommandBuffer* b = from(pool)->buffers.first(); b; b = b->next) {
    b->reset();
    if (flags & VK_COMMAND_POOL_RESET_RELEASE_RESOURCES_BIT) b->arena.release();
  }
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkTrimCommandPool(VkDevice, VkCommandPool pool, VkCommandPoolTrimFlags) {
  for (CommandBuffer* b = from(pool)->buffers.first(); b; b = b->next)
    if (!b->head) b->arena.release();
}

VKAPI_ATTR VkResult VKAPI_CALL vkAllocateCommandBuffers(VkDevice device, const VkCommandBufferAllocateInfo* info, VkCommandBuffer* out) {
  CommandPool& pool = *from(info->commandPool);
  for (uint32_t i = 0; i < info->commandBufferCount; i++) {
    auto* buffer = makeObject<CommandBuffer>(pool.allocator, VK_SYSTEM_ALLOCATION_SCOPE_OBJECT, *from(device), pool, pool.allocator, info->level);
    if (!buffer) {
      vkFreeCommandBuffers(device, info->commandPool, i, out);
      std::fill_n(out, info->commandBufferCount, VkCommandBuffer(VK_NULL_HANDLE));
      return VK_ERROR_OUT_OF_HOST_MEMORY;
    }
    pool.buffers.insert(buffer);
    out[i] = to<VkCommandBuffer>(buffer);
  }
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkFreeCommandBuffers(VkDevice, VkCommandPool handle, uint32_t count, const VkCommandBuffer* buffers) {
  CommandPool& pool = *from(handle);
  for (uint32_t i = 0; i < count; i++)
    if (CommandBuffer* b = from(buffers[i])) {
      pool.buffers.erase(b);
      destroyObject(pool.allocator, b);
    }
}

VKAPI_ATTR VkResult VKAPI_CALL vkBeginCommandBuffer(VkCommandBuffer buffer, const VkCommandBufferBeginInfo*) {
  from(buffer)->reset();
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkEndCommandBuffer(VkCommandBuffer buffer) { return from(buffer)->outOfMemory ? VK_ERROR_OUT_OF_HOST_MEMORY : VK_SUCCESS; }

VKAPI_ATTR VkResult VKAPI_CALL vkResetCommandBuffer(VkCommandBuffer buffer, VkCommandBufferResetFlags flags) {
  from(buffer)->reset();
  if (flags & VK_COMMAND_BUFFER_RESET_RELEASE_RESOURCES_BIT) from(buffer)->arena.release();
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkCmdExecuteCommands(VkCommandBuffer primary, uint32_t count, const VkCommandBuffer* buffers) {
  for (uint32_t i = 0; i < count; i++) {
    from(primary)->record([secondary = from(buffers[i])](Execution& e) { secondary->execute(e); });
    from(primary)->waitsForEvents |= from(buffers[i])->waitsForEvents;
  }
}

// --- state

VKAPI_ATTR void VKAPI_CALL vkCmdBindPipeline(VkCommandBuffer buffer, VkPipelineBindPoint point, VkPipeline pipeline) {
  CommandBuffer& cb = *from(buffer);
  if (point == VK_PIPELINE_BIND_POINT_GRAPHICS) {
    cb.draw.pipeline = from(pipeline)->graphics;
    cb.family = from(pipeline)->family.get();
    cb.stateChanged();
  } else {
    cb.dispatch.pipeline = from(pipeline)->compute;
  }
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetViewport(VkCommandBuffer buffer, uint32_t first, uint32_t count, const VkViewport* viewports) {
  for (uint32_t i = 0; i < count && first + i < raster::kMaxViewports; i++) from(buffer)->dynamic.viewports[first + i] = viewports[i];
  from(buffer)->stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetScissor(VkCommandBuffer buffer, uint32_t first, uint32_t count, const VkRect2D* scissors) {
  for (uint32_t i = 0; i < count && first + i < raster::kMaxViewports; i++) from(buffer)->dynamic.scissors[first + i] = scissors[i];
  from(buffer)->stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetLineWidth(VkCommandBuffer buffer, float width) {
  from(buffer)->dynamic.lineWidth = width;
  from(buffer)->stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetDepthBias(VkCommandBuffer buffer, float constant, float clamp, float slope) {
  float values[3] = {constant, clamp, slope};
  std::copy_n(values, 3, from(buffer)->dynamic.depthBias);
  from(buffer)->stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetBlendConstants(VkCommandBuffer buffer, const float constants[4]) {
  std::copy_n(constants, 4, from(buffer)->dynamic.blendConstants);
  from(buffer)->stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetDepthBounds(VkCommandBuffer buffer, float low, float high) {
  from(buffer)->dynamic.depthBounds[0] = low;
  from(buffer)->dynamic.depthBounds[1] = high;
  from(buffer)->stateChanged();
}

static void setFaces(CommandBuffer& cb, uint32_t (&values)[2], VkStencilFaceFlags faces, uint32_t value) {
  if (faces & VK_STENCIL_FACE_FRONT_BIT) values[0] = value;
  if (faces & VK_STENCIL_FACE_BACK_BIT) values[1] = value;
  cb.stateChanged();
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetStencilCompareMask(VkCommandBuffer b, VkStencilFaceFlags f, uint32_t v) { setFaces(*from(b), from(b)->dynamic.stencilCompareMask, f, v); }
VKAPI_ATTR void VKAPI_CALL vkCmdSetStencilWriteMask(VkCommandBuffer b, VkStencilFaceFlags f, uint32_t v) { setFaces(*from(b), from(b)->dynamic.stencilWriteMask, f, v); }
VKAPI_ATTR void VKAPI_CALL vkCmdSetStencilReference(VkCommandBuffer b, VkStencilFaceFlags f, uint32_t v) { setFaces(*from(b), from(b)->dynamic.stencilReference, f, v); }

VKAPI_ATTR void VKAPI_CALL vkCmdBindDescriptorSets(VkCommandBuffer buffer, VkPipelineBindPoint point, VkPipelineLayout layoutHandle, uint32_t firstSet, uint32_t count,
                                                   const VkDescriptorSet* sets, uint32_t offsetCount, const uint32_t* offsets) {
  CommandBuffer& cb = *from(buffer);
  const pipeline::Layout& layout = *from(layoutHandle)->layout;
  auto bind = [&](auto& state) {
    uint32_t next = 0;
    for (uint32_t i = 0; i < count; i++) {
      uint32_t n = firstSet + i;
      const DescriptorSet* set = from(sets[i]);
      if (n >= ir::kMaxDescriptorSets || !set) continue;
      state.setMemory[n] = set->memory;
      state.setSize[n] = set->size;
      for (uint32_t k = 0; k < set->layout->dynamicCount && next < offsetCount; k++, next++)
        if (layout.dynamicBase[n] + k < pipeline::kMaxDynamicOffsets) state.dynamicOffsets[layout.dynamicBase[n] + k] = offsets[next];
    }
  };
  if (point == VK_PIPELINE_BIND_POINT_GRAPHICS) {
    bind(cb.draw);
    const uint32_t bound = firstSet < ir::kMaxDescriptorSets ? std::min<uint32_t>(count, ir::kMaxDescriptorSets - firstSet) : 0;
    cb.valuesChanged(cb.draw.setMemory + firstSet, bound);
    cb.valuesChanged(cb.draw.setSize + firstSet, bound);
    if (offsetCount) cb.valuesChanged(cb.draw.dynamicOffsets, pipeline::kMaxDynamicOffsets);
  } else {
    bind(cb.dispatch);
  }
}

// A pushed set is memory of the command buffer: a new copy for each push, so that earlier draws keep what they saw.
template <typename Write>
static void pushDescriptors(CommandBuffer& cb, VkPipelineBindPoint point, VkPipelineLayout layoutHandle, uint32_t number, Write&& write) {
  const pipeline::Layout& layout = *from(layoutHandle)->layout;
  if (number >= layout.sets.size() || number >= ir::kMaxDescriptorSets) return;
  SetMemory set{&layout.sets[number]};
  set.size = set.layout->size;
  if (!set.size) return;
  auto* memory = static_cast<std::byte*>(cb.arena.allocBytes(headerBytes(*set.layout) + set.size, 64));
  if (!memory) {
    cb.outOfMemory = true;
    return;
  }
  set.memory = memory + headerBytes(*set.layout);
  auto push = [&](auto& state, const std::byte*& pushed) {
    // What was pushed before stays, if it is still what is bound there.
    if (pushed && state.setMemory[number] == pushed && state.setSize[number] == set.size)
      std::memcpy(memory, pushed - headerBytes(*set.layout), headerBytes(*set.layout) + set.size);
    else
      initSetMemory(set);
    write(set);
    state.setMemory[number] = pushed = set.memory;
    state.setSize[number] = set.size;
  };
  if (point == VK_PIPELINE_BIND_POINT_GRAPHICS) {
    push(cb.draw, cb.pushedDraw[number]);
    cb.valuesChanged(cb.draw.setMemory + number, 1);
    cb.valuesChanged(cb.draw.setSize + number, 1);
  } else {
    push(cb.dispatch, cb.pushedDispatch[number]);
  }
}

VKAPI_ATTR void VKAPI_CALL vkCmdPushDescriptorSetKHR(VkCommandBuffer buffer, VkPipelineBindPoint point, VkPipelineLayout layout, uint32_t number, uint32_t count,
                                                     const VkWriteDescriptorSet* writes) {
  pushDescriptors(*from(buffer), point, layout, number, [&](const SetMemory& set) {
    for (uint32_t i = 0; i < count; i++) writeDescriptors(set, writes[i]);
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdPushDescriptorSetWithTemplateKHR(VkCommandBuffer buffer, VkDescriptorUpdateTemplate t, VkPipelineLayout layout, uint32_t number, const void* data) {
  pushDescriptors(*from(buffer), from(t)->bindPoint, layout, number, [&](const SetMemory& set) { writeDescriptors(set, *from(t), data); });
}

VKAPI_ATTR void VKAPI_CALL vkCmdPushConstants(VkCommandBuffer buffer, VkPipelineLayout, VkShaderStageFlags, uint32_t offset, uint32_t size, const void* values) {
  CommandBuffer& cb = *from(buffer);
  if (offset >= pipeline::kMaxPushBytes) return;
  size = std::min(size, pipeline::kMaxPushBytes - offset);
  std::memcpy(cb.draw.push + offset, values, size);
  std::memcpy(cb.dispatch.push + offset, values, size);
  cb.valuesChanged(cb.draw.push + offset, size);
}

VKAPI_ATTR void VKAPI_CALL vkCmdBindVertexBuffers(VkCommandBuffer buffer, uint32_t first, uint32_t count, const VkBuffer* buffers, const VkDeviceSize* offsets) {
  CommandBuffer& cb = *from(buffer);
  for (uint32_t i = 0; i < count && first + i < pipeline::kMaxVertexBindings; i++) {
    texture::BufferMemory range = buffers[i] ? from(buffers[i])->range(offsets[i]) : texture::BufferMemory{};
    cb.draw.vertexBuffers[first + i] = {reinterpret_cast<uint64_t>(range.base), range.size};
  }
  if (first < pipeline::kMaxVertexBindings) cb.valuesChanged(cb.draw.vertexBuffers + first, std::min(count, pipeline::kMaxVertexBindings - first));
}

VKAPI_ATTR void VKAPI_CALL vkCmdBindIndexBuffer(VkCommandBuffer buffer, VkBuffer indices, VkDeviceSize offset, VkIndexType type) {
  CommandBuffer& cb = *from(buffer);
  texture::BufferMemory range = indices ? from(indices)->range(offset) : texture::BufferMemory{};
  cb.draw.indexBase = reinterpret_cast<uint64_t>(range.base);
  cb.draw.indexSize = range.size;
  cb.draw.indexType = type;
  cb.valuesChanged(&cb.draw.indexBase, 1);
  cb.valuesChanged(&cb.draw.indexSize, 1);
  cb.valuesChanged(&cb.draw.indexType, 1);
}

// --- draws and dispatches

static void recordDraw(CommandBuffer& cb, const pipeline::DrawParams& params) {
  if (!cb.captureDraw()) return;
  cb.record([state = cb.captured, params](Execution& e) {
    if (!e.skips) e.pass.draw(e.states.read(state), params);
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdDraw(VkCommandBuffer buffer, uint32_t vertices, uint32_t instances, uint32_t first, uint32_t firstInstance) {
  recordDraw(*from(buffer), {.indexed = false, .count = vertices, .instanceCount = instances, .first = first, .firstInstance = firstInstance});
}

VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndexed(VkCommandBuffer buffer, uint32_t indices, uint32_t instances, uint32_t first, int32_t vertexOffset, uint32_t firstInstance) {
  recordDraw(*from(buffer), {.indexed = true, .count = indices, .instanceCount = instances, .first = first, .vertexOffset = vertexOffset, .firstInstance = firstInstance});
}

static pipeline::DrawParams paramsOf(const VkDrawIndirectCommand& c) {
  return {.indexed = false, .count = c.vertexCount, .instanceCount = c.instanceCount, .first = c.firstVertex, .firstInstance = c.firstInstance};
}
static pipeline::DrawParams paramsOf(const VkDrawIndexedIndirectCommand& c) {
  return {.indexed = true, .count = c.indexCount, .instanceCount = c.instanceCount, .first = c.firstIndex, .vertexOffset = c.vertexOffset, .firstInstance = c.firstInstance};
}

// The parameters are read when the command runs; those beyond the buffer's end draw nothing.
template <typename Indirect>
static void recordIndirect(CommandBuffer& cb, VkBuffer handle, uint64_t offset, uint32_t count, uint32_t stride, VkBuffer countHandle = VK_NULL_HANDLE, uint64_t countOffset = 0) {
  if (!cb.captureDraw()) return;
  const CapturedDraw state = cb.captured;
  texture::BufferMemory range = from(handle)->range(offset), counter = countHandle ? from(countHandle)->range(countOffset) : texture::BufferMemory{};
  bool counted = countHandle;
  cb.record([=](Execution& e) {
    if (e.skips) return;
    uint32_t n = count, limit = 0;
    if (counted) {
      if (counter.size >= 4) std::memcpy(&limit, counter.base, 4);
      n = std::min(n, limit);
    }
    for (uint32_t i = 0; i < n; i++) {
      Indirect command;
      uint64_t at = uint64_t(i) * stride;
      if (range.size < sizeof command || at > range.size - sizeof command) break;
      std::memcpy(&command, range.base + at, sizeof command);
      pipeline::DrawParams params = paramsOf(command);
      params.drawIndex = i;
      e.pass.draw(e.states.read(state), params);
    }
  });
}

// Elements lie `stride` bytes apart. (VK_EXT_multi_draw)
template <typename Info, typename Record>
static void eachDraw(const Info* infos, uint32_t count, uint32_t stride, Record&& record) {
  for (uint32_t i = 0; i < count; i++) record(i, *reinterpret_cast<const Info*>(reinterpret_cast<const std::byte*>(infos) + size_t(i) * stride));
}

VKAPI_ATTR void VKAPI_CALL vkCmdDrawMultiEXT(VkCommandBuffer buffer, uint32_t count, const VkMultiDrawInfoEXT* infos, uint32_t instances, uint32_t firstInstance, uint32_t stride) {
  eachDraw(infos, count, stride, [&](uint32_t i, const VkMultiDrawInfoEXT& d) {
    recordDraw(*from(buffer), {.indexed = false, .count = d.vertexCount, .instanceCount = instances, .first = d.firstVertex, .firstInstance = firstInstance, .drawIndex = i});
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdDrawMultiIndexedEXT(VkCommandBuffer buffer, uint32_t count, const VkMultiDrawIndexedInfoEXT* infos, uint32_t instances, uint32_t firstInstance,
                                                    uint32_t stride, const int32_t* vertexOffset) {
  eachDraw(infos, count, stride, [&](uint32_t i, const VkMultiDrawIndexedInfoEXT& d) {
    recordDraw(*from(buffer), {.indexed = true, .count = d.indexCount, .instanceCount = instances, .first = d.firstIndex,
                               .vertexOffset = vertexOffset ? *vertexOffset : d.vertexOffset, .firstInstance = firstInstance, .drawIndex = i});
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndirect(VkCommandBuffer b, VkBuffer buffer, VkDeviceSize offset, uint32_t count, uint32_t stride) {
  recordIndirect<VkDrawIndirectCommand>(*from(b), buffer, offset, count, stride);
}
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndexedIndirect(VkCommandBuffer b, VkBuffer buffer, VkDeviceSize offset, uint32_t count, uint32_t stride) {
  recordIndirect<VkDrawIndexedIndirectCommand>(*from(b), buffer, offset, count, stride);
}
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndirectCount(VkCommandBuffer b, VkBuffer buffer, VkDeviceSize offset, VkBuffer counter, VkDeviceSize counterOffset, uint32_t count, uint32_t stride) {
  recordIndirect<VkDrawIndirectCommand>(*from(b), buffer, offset, count, stride, counter, counterOffset);
}
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndexedIndirectCount(VkCommandBuffer b, VkBuffer buffer, VkDeviceSize offset, VkBuffer counter, VkDeviceSize counterOffset, uint32_t count, uint32_t stride) {
  recordIndirect<VkDrawIndexedIndirectCommand>(*from(b), buffer, offset, count, stride, counter, counterOffset);
}

static void countInvocations(Execution& e, const pipeline::DispatchState& state, const uint32_t (&count)[3]) {
  if (e.statistics)
    e.statistics->statistics.values[pipeline::PipelineStatistics::ComputeInvocations] +=
        uint64_t(count[0]) * count[1] * count[2] * pipeline::groupInvocations(*state.pipeline);
}

VKAPI_ATTR void VKAPI_CALL vkCmdDispatchBase(VkCommandBuffer buffer, uint32_t bx, uint32_t by, uint32_t bz, uint32_t x, uint32_t y, uint32_t z) {
  CommandBuffer& cb = *from(buffer);
  if (!cb.dispatch.pipeline) return;
  cb.record([state = cb.dispatch, bx, by, bz, x, y, z](Execution& e) {
    if (e.skips) return;
    const uint32_t base[3] = {bx, by, bz}, count[3] = {x, y, z};
    pipeline::dispatch(e.pool, state, base, count);
    countInvocations(e, state, count);
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdDispatch(VkCommandBuffer buffer, uint32_t x, uint32_t y, uint32_t z) { vkCmdDispatchBase(buffer, 0, 0, 0, x, y, z); }

VKAPI_ATTR void VKAPI_CALL vkCmdDispatchIndirect(VkCommandBuffer buffer, VkBuffer handle, VkDeviceSize offset) {
  CommandBuffer& cb = *from(buffer);
  if (!cb.dispatch.pipeline) return;
  cb.record([state = cb.dispatch, range = from(handle)->range(offset)](Execution& e) {
    if (e.skips) return;
    uint32_t base[3] = {}, count[3] = {};
    if (range.size >= sizeof count) std::memcpy(count, range.base, sizeof count);
    pipeline::dispatch(e.pool, state, base, count);
    countInvocations(e, state, count);
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdBeginConditionalRenderingEXT(VkCommandBuffer buffer, const VkConditionalRenderingBeginInfoEXT* info) {
  const bool inverted = info->flags & VK_CONDITIONAL_RENDERING_INVERTED_BIT_EXT;
  from(buffer)->record([range = from(info->buffer)->range(info->offset), inverted](Execution& e) {
    uint32_t predicate = 0;
    if (range.size >= sizeof predicate) std::memcpy(&predicate, range.base, sizeof predicate);
    e.skips = (predicate != 0) == inverted;
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdEndConditionalRenderingEXT(VkCommandBuffer buffer) {
  from(buffer)->record([](Execution& e) { e.skips = false; });
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetDeviceMask(VkCommandBuffer, uint32_t) {}

}  // namespace pumice::icd
