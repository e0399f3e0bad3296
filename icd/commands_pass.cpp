// Render passes, queries, events and barriers in command buffers.
#include <algorithm>
#include <bit>
#include <cstring>

#include "entrypoints.h"
#include "icd/command_buffer.h"

namespace pumice::icd {

void Execution::beginPass(const pipeline::PassBegin& begin) {
  pass.begin(begin);
  insidePass = true;
  if (occlusion) pass.beginOcclusion(&occlusion->value);
  if (statistics) pass.beginStatistics(&statistics->statistics);
}

// Counters are complete when the pass is: only then are its queries available.
void Execution::endPass() {
  if (occlusion) pass.endOcclusion();
  if (statistics) pass.endStatistics();
  pass.end();
  insidePass = false;
  if (finishing.empty() && timestamps.empty()) return;
  const uint64_t now = clockNanoseconds();
  hub.update([&] {
    for (Query* q : finishing) q->available = true;
    for (Query* q : timestamps) *q = {now, true};
  });
  finishing.clear();
  timestamps.clear();
}

void Execution::beginScope(uint32_t mask) {
  viewMask = mask;
  viewOrdinal = 0;
  scopeStart = current->next;
  beginView();
}

void Execution::beginView() {
  uint32_t view = viewMask ? uint32_t(std::countr_zero(viewMask)) : 0;
  pipeline::PassBegin begin = renderPass ? subpassBegin(*renderPass, subpass, *framebuffer, views, area, clears, view) : rendering;
  if (viewMask) selectView(begin, view);
  beginPass(begin);
}

bool Execution::endView() {
  endPass();
  viewMask &= viewMask - 1;
  viewOrdinal++;
  if (!viewMask) return false;
  beginView();
  jump = scopeStart;
  return true;
}

namespace {

VkRect2D renderAreaOf(const VkRenderPassBeginInfo& info) {
  auto* group = findInChain<VkDeviceGroupRenderPassBeginInfo>(info.pNext, VK_STRUCTURE_TYPE_DEVICE_GROUP_RENDER_PASS_BEGIN_INFO);
  return group && group->deviceRenderAreaCount ? group->pDeviceRenderAreas[0] : info.renderArea;
}

void begin(CommandBuffer& cb, const VkRenderPassBeginInfo& info) {
  const Framebuffer* framebuffer = from(info.framebuffer);
  auto* imageless = findInChain<VkRenderPassAttachmentBeginInfo>(info.pNext, VK_STRUCTURE_TYPE_RENDER_PASS_ATTACHMENT_BEGIN_INFO);
  // The chain's handles are the objects' addresses; the structure may be there, empty, for an ordinary framebuffer.
  std::span<ImageView* const> views = imageless && imageless->attachmentCount ? cb.keep(reinterpret_cast<ImageView* const*>(imageless->pAttachments), imageless->attachmentCount)
                                                                              : cb.keep(framebuffer->views.data(), uint32_t(framebuffer->views.size()));
  std::span<const VkClearValue> clears = cb.keep(info.pClearValues, info.clearValueCount);
  cb.record([pass = from(info.renderPass), framebuffer, area = renderAreaOf(info), views, clears](Execution& e) {
    e.renderPass = pass;
    e.framebuffer = framebuffer;
    e.views = views;
    e.clears = clears;
    e.area = area;
    e.subpass = 0;
    e.beginScope(pass->subpasses[0].viewMask);
  });
}

void next(CommandBuffer& cb) {
  cb.record([](Execution& e) {
    if (e.endView()) return;
    e.subpass++;
    e.beginScope(e.renderPass->subpasses[e.subpass].viewMask);
  });
}

void end(CommandBuffer& cb) {
  cb.record([](Execution& e) { e.endView(); });
}

}  // namespace

VKAPI_ATTR void VKAPI_CALL vkCmdBeginRenderPass(VkCommandBuffer b, const VkRenderPassBeginInfo* info, VkSubpassContents) { begin(*from(b), *info); }
VKAPI_ATTR void VKAPI_CALL vkCmdBeginRenderPass2(VkCommandBuffer b, const VkRenderPassBeginInfo* info, const VkSubpassBeginInfo*) { begin(*from(b), *info); }
VKAPI_ATTR void VKAPI_CALL vkCmdNextSubpass(VkCommandBuffer b, VkSubpassContents) { next(*from(b)); }
VKAPI_ATTR void VKAPI_CALL vkCmdNextSubpass2(VkCommandBuffer b, const VkSubpassBeginInfo*, const VkSubpassEndInfo*) { next(*from(b)); }
VKAPI_ATTR void VKAPI_CALL vkCmdEndRenderPass(VkCommandBuffer b) { end(*from(b)); }
VKAPI_ATTR void VKAPI_CALL vkCmdEndRenderPass2(VkCommandBuffer b, const VkSubpassEndInfo*) { end(*from(b)); }

// --- dynamic rendering

static pipeline::Attachment renderingAttachment(const VkRenderingAttachmentInfo* info) {
  pipeline::Attachment a;
  const ImageView* view = info ? from(info->imageView) : nullptr;
  if (!view) return a;
  a = attachmentOf(*view);
  a.loadOp = a.stencilLoadOp = info->loadOp;
  a.storeOp = a.stencilStoreOp = info->storeOp;
  a.clear = info->clearValue;
  return a;
}

VKAPI_ATTR void VKAPI_CALL vkCmdBeginRendering(VkCommandBuffer buffer, const VkRenderingInfo* info) {
  pipeline::PassBegin begin;
  begin.renderArea = info->renderArea;
  begin.width = uint32_t(info->renderArea.offset.x) + info->renderArea.extent.width;
  begin.height = uint32_t(info->renderArea.offset.y) + info->renderArea.extent.height;
  begin.layers = std::max(1u, info->layerCount);
  begin.colorCount = std::min(info->colorAttachmentCount, pipeline::kMaxColorAttachments);
  for (uint32_t i = 0; i < begin.colorCount; i++) {
    begin.color[i] = renderingAttachment(&info->pColorAttachments[i]);
    if (const ImageView* resolve = from(info->pColorAttachments[i].resolveImageView); resolve && info->pColorAttachments[i].resolveMode) begin.resolve[i] = attachmentOf(*resolve);
  }
  begin.depthStencil = renderingAttachment(info->pDepthAttachment);
  pipeline::Attachment stencil = renderingAttachment(info->pStencilAttachment);
  // Both are the same view; an aspect that is not given stays as it is.
  if (!begin.depthStencil.memory.layout) {
    begin.depthStencil = stencil;
    begin.depthStencil.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    begin.depthStencil.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  } else if (stencil.memory.layout) {
    begin.depthStencil.stencilLoadOp = stencil.loadOp;
    begin.depthStencil.stencilStoreOp = stencil.storeOp;
    begin.depthStencil.clear.depthStencil.stencil = stencil.clear.depthStencil.stencil;
  } else {
    begin.depthStencil.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    begin.depthStencil.stencilStoreOp = VK_ATTACHMENT_STORE_OP_STORE;
  }
  for (auto [info_, mode] : {std::pair{info->pDepthAttachment, &begin.depthResolve}, std::pair{info->pStencilAttachment, &begin.stencilResolve}})
    if (const ImageView* resolve = info_ && info_->imageView && info_->resolveMode ? from(info_->resolveImageView) : nullptr) {
      begin.depthStencilResolve = attachmentOf(*resolve);
      *mode = info_->resolveMode;
    }
  // A resumed scope continues what the suspended one stored.
  if (info->flags & VK_RENDERING_RESUMING_BIT) {
    for (auto& c : begin.color) c.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    begin.depthStencil.loadOp = begin.depthStencil.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  }
  // What is suspended is stored for it.
  if (info->flags & VK_RENDERING_SUSPENDING_BIT) {
    for (auto& c : begin.color) c.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    begin.depthStencil.storeOp = begin.depthStencil.stencilStoreOp = VK_ATTACHMENT_STORE_OP_STORE;
  }
  from(buffer)->record([begin, mask = info->viewMask](Execution& e) {
    e.renderPass = nullptr;
    e.rendering = begin;
    e.beginScope(mask);
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdEndRendering(VkCommandBuffer b) { end(*from(b)); }

VKAPI_ATTR void VKAPI_CALL vkCmdClearAttachments(VkCommandBuffer buffer, uint32_t attachmentCount, const VkClearAttachment* attachments, uint32_t rectCount, const VkClearRect* rects) {
  CommandBuffer& cb = *from(buffer);
  auto a = cb.keep(attachments, attachmentCount);
  auto r = cb.keep(rects, rectCount);
  cb.record([a, r](Execution& e) {
    if (e.skips) return;
    for (const VkClearAttachment& attachment : a)
      for (const VkClearRect& rect : r) e.pass.clear(attachment, rect);
  });
}

// --- queries

VKAPI_ATTR void VKAPI_CALL vkCmdResetQueryPool(VkCommandBuffer b, VkQueryPool pool, uint32_t first, uint32_t count) {
  from(b)->record([pool = from(pool), first, count](Execution& e) {
    e.hub.update([&] { std::fill_n(pool->queries.begin() + first, count, Query{}); });
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdBeginQuery(VkCommandBuffer b, VkQueryPool pool, uint32_t index, VkQueryControlFlags) {
  from(b)->record([first = &from(pool)->queries[index], counts = from(pool)->type == VK_QUERY_TYPE_PIPELINE_STATISTICS](Execution& e) {
    Query* query = first + e.queryOffset();
    query->value = 0;
    query->statistics = {};
    if (counts) {
      e.statistics = query;
      if (e.insidePass) e.pass.beginStatistics(&query->statistics);
    } else {
      e.occlusion = query;
      if (e.insidePass) e.pass.beginOcclusion(&query->value);
    }
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdEndQuery(VkCommandBuffer b, VkQueryPool pool, uint32_t index) {
  from(b)->record([first = &from(pool)->queries[index], counts = from(pool)->type == VK_QUERY_TYPE_PIPELINE_STATISTICS](Execution& e) {
    Query* query = first + e.queryOffset();
    (counts ? e.statistics : e.occlusion) = nullptr;
    if (e.insidePass) {
      counts ? e.pass.endStatistics() : e.pass.endOcclusion();
      e.finishing.push_back(query);
    } else {
      e.hub.update([&] { query->available = true; });
    }
  });
}

static void recordTimestamp(VkCommandBuffer b, VkQueryPool pool, uint32_t index, bool top) {
  from(b)->record([first = &from(pool)->queries[index], top](Execution& e) {
    Query* query = first + e.queryOffset();
    if (e.insidePass && !top)
      e.timestamps.push_back(query);
    else
      e.hub.update([&] { *query = {clockNanoseconds(), true}; });
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdWriteTimestamp(VkCommandBuffer b, VkPipelineStageFlagBits stage, VkQueryPool pool, uint32_t index) {
  recordTimestamp(b, pool, index, stage == VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT);
}
VKAPI_ATTR void VKAPI_CALL vkCmdWriteTimestamp2(VkCommandBuffer b, VkPipelineStageFlags2 stage, VkQueryPool pool, uint32_t index) {
  recordTimestamp(b, pool, index, stage == VK_PIPELINE_STAGE_2_NONE || stage == VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT);
}

VKAPI_ATTR void VKAPI_CALL vkCmdCopyQueryPoolResults(VkCommandBuffer b, VkQueryPool pool, uint32_t first, uint32_t count, VkBuffer dst, VkDeviceSize offset, VkDeviceSize stride,
                                                     VkQueryResultFlags flags) {
  from(b)->record([pool = from(pool), first, count, out = from(dst)->range(offset), stride, flags](Execution& e) {
    for (uint32_t i = 0; i < count; i++) {
      const Query& query = pool->queries[first + i];
      uint64_t at = i * stride;
      if (at < out.size) e.hub.read([&] { return writeQueryResult(*pool, query, flags, out.base + at, out.size - at); });
    }
  });
}

// --- events and barriers. Commands of the one queue run one after another, each complete before the next, and
// the draws of a pass in their order, so a barrier has nothing left to order; only events that the host sets must be waited for.

static void recordSetEvent(VkCommandBuffer b, VkEvent event, bool value) {
  from(b)->record([event = from(event), value](Execution& e) { e.hub.update([&] { event->set = value; }); });
}

static void recordWaitEvents(VkCommandBuffer b, uint32_t count, const VkEvent* events) {
  CommandBuffer& cb = *from(b);
  auto kept = cb.keep(events, count);
  cb.waitsForEvents = true;
  cb.record([kept](Execution& e) {
    e.hub.waitOrLost(~0ull, [&] { return std::all_of(kept.begin(), kept.end(), [](VkEvent h) { return from(h)->set; }); });
  });
}

VKAPI_ATTR void VKAPI_CALL vkCmdSetEvent(VkCommandBuffer b, VkEvent event, VkPipelineStageFlags) { recordSetEvent(b, event, true); }
VKAPI_ATTR void VKAPI_CALL vkCmdSetEvent2(VkCommandBuffer b, VkEvent event, const VkDependencyInfo*) { recordSetEvent(b, event, true); }
VKAPI_ATTR void VKAPI_CALL vkCmdResetEvent(VkCommandBuffer b, VkEvent event, VkPipelineStageFlags) { recordSetEvent(b, event, false); }
VKAPI_ATTR void VKAPI_CALL vkCmdResetEvent2(VkCommandBuffer b, VkEvent event, VkPipelineStageFlags2) { recordSetEvent(b, event, false); }
VKAPI_ATTR void VKAPI_CALL vkCmdWaitEvents2(VkCommandBuffer b, uint32_t count, const VkEvent* events, const VkDependencyInfo*) { recordWaitEvents(b, count, events); }
VKAPI_ATTR void VKAPI_CALL vkCmdWaitEvents(VkCommandBuffer b, uint32_t count, const VkEvent* events, VkPipelineStageFlags, VkPipelineStageFlags, uint32_t,
                                           const VkMemoryBarrier*, uint32_t, const VkBufferMemoryBarrier*, uint32_t, const VkImageMemoryBarrier*) {
  recordWaitEvents(b, count, events);
}
VKAPI_ATTR void VKAPI_CALL vkCmdPipelineBarrier(VkCommandBuffer, VkPipelineStageFlags, VkPipelineStageFlags, VkDependencyFlags, uint32_t, const VkMemoryBarrier*, uint32_t,
                                                const VkBufferMemoryBarrier*, uint32_t, const VkImageMemoryBarrier*) {}
VKAPI_ATTR void VKAPI_CALL vkCmdPipelineBarrier2(VkCommandBuffer, const VkDependencyInfo*) {}

}  // namespace pumice::icd
