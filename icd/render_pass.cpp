#include "icd/render_pass.h"

#include <algorithm>

#include "entrypoints.h"

namespace pumice::icd {
namespace {

template <typename Reference>
void addNumbers(HostVector<uint32_t>& out, const Reference* references, uint32_t count) {
  if (!references) return;
  out.reserve(count);
  for (uint32_t i = 0; i < count; i++) out.push_back(references[i].attachment);
}

// The two create-info structures have the same member names.
template <typename Info>
void fill(RenderPass& pass, const Info& info) {
  pass.attachments.reserve(info.attachmentCount);
  pass.subpasses.reserve(info.subpassCount);
  for (uint32_t i = 0; i < info.attachmentCount; i++) {
    const auto& a = info.pAttachments[i];
    pass.attachments.push_back({a.format, uint32_t(a.samples), a.loadOp, a.stencilLoadOp, a.storeOp, a.stencilStoreOp});
  }
  for (uint32_t i = 0; i < info.subpassCount; i++) {
    const auto& s = info.pSubpasses[i];
    Subpass& out = pass.subpasses.emplace_back(pass.subpasses.get_allocator().allocator);
    addNumbers(out.colors, s.pColorAttachments, s.colorAttachmentCount);
    addNumbers(out.resolves, s.pResolveAttachments, s.colorAttachmentCount);
    addNumbers(out.inputs, s.pInputAttachments, s.inputAttachmentCount);
    if (s.pDepthStencilAttachment) out.depthStencil = s.pDepthStencilAttachment->attachment;
    if constexpr (requires { s.viewMask; }) {
      out.viewMask = s.viewMask;
      auto* resolve = findInChain<VkSubpassDescriptionDepthStencilResolve>(s.pNext, VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_DEPTH_STENCIL_RESOLVE);
      if (resolve && resolve->pDepthStencilResolveAttachment) {
        out.depthStencilResolve = resolve->pDepthStencilResolveAttachment->attachment;
        out.depthResolve = resolve->depthResolveMode;
        out.stencilResolve = resolve->stencilResolveMode;
      }
    }
  }
  if (auto* m = findInChain<VkRenderPassMultiviewCreateInfo>(info.pNext, VK_STRUCTURE_TYPE_RENDER_PASS_MULTIVIEW_CREATE_INFO))
    for (uint32_t i = 0; i < m->subpassCount && i < info.subpassCount; i++) pass.subpasses[i].viewMask = m->pViewMasks[i];
}

template <typename Info>
VkResult create(VkDevice device, const Info* info, const VkAllocationCallbacks* callbacks, VkRenderPass* out) {
  auto* pass = from(device)->make<RenderPass>(callbacks, from(device)->allocatorFor(callbacks));
  if (!pass) return VK_ERROR_OUT_OF_HOST_MEMORY;
  try {
    fill(*pass, *info);
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, pass);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkRenderPass>(pass);
  return VK_SUCCESS;
}

}  // namespace

pipeline::Attachment attachmentOf(const ImageView& view) {
  pipeline::Attachment a;
  a.memory = view.image->memory();
  a.format = view.format;
  a.level = view.range.baseMipLevel;
  a.baseLayer = view.range.baseArrayLayer;
  a.layerCount = view.range.layerCount;
  return a;
}

bool Subpass::uses(uint32_t attachment) const {
  auto in = [&](const HostVector<uint32_t>& list) { return std::find(list.begin(), list.end(), attachment) != list.end(); };
  return attachment == depthStencil || attachment == depthStencilResolve || in(colors) || in(resolves) || in(inputs);
}

bool RenderPass::firstUse(uint32_t attachment, uint32_t subpass, uint32_t view) const {
  for (uint32_t i = 0; i < subpass; i++)
    if (subpasses[i].uses(attachment) && (!subpasses[i].viewMask || subpasses[i].viewMask >> view & 1)) return false;
  return true;
}

bool RenderPass::lastUse(uint32_t attachment, uint32_t subpass, uint32_t view) const {
  for (uint32_t i = subpass + 1; i < subpasses.size(); i++)
    if (subpasses[i].uses(attachment) && (!subpasses[i].viewMask || subpasses[i].viewMask >> view & 1)) return false;
  return true;
}

void selectView(pipeline::PassBegin& begin, uint32_t view) {
  auto select = [&](pipeline::Attachment& a) {
    a.baseLayer += view;
    a.layerCount = 1;
  };
  for (uint32_t i = 0; i < begin.colorCount; i++) select(begin.color[i]), select(begin.resolve[i]);
  select(begin.depthStencil);
  select(begin.depthStencilResolve);
  begin.layers = 1;
  begin.viewIndex = view;
}

pipeline::PassBegin subpassBegin(const RenderPass& pass, uint32_t number, const Framebuffer& framebuffer, std::span<ImageView* const> views,
                                 const VkRect2D& area, std::span<const VkClearValue> clears, uint32_t view) {
  const Subpass& subpass = pass.subpasses[number];
  pipeline::PassBegin begin;
  begin.renderArea = area;
  begin.width = framebuffer.width;
  begin.height = framebuffer.height;
  begin.layers = framebuffer.layers;
  auto attachment = [&](uint32_t index) {
    pipeline::Attachment a;
    if (index >= views.size() || !views[index]) return a;
    a = attachmentOf(*views[index]);
    const AttachmentInfo& info = pass.attachments[index];
    if (pass.firstUse(index, number, view)) {
      a.loadOp = info.loadOp;
      a.stencilLoadOp = info.stencilLoadOp;
    }
    if (pass.lastUse(index, number, view)) {
      a.storeOp = info.storeOp;
      a.stencilStoreOp = info.stencilStoreOp;
    }
    if (index < clears.size()) a.clear = clears[index];
    return a;
  };
  begin.colorCount = uint32_t(std::min<size_t>(subpass.colors.size(), pipeline::kMaxColorAttachments));
  for (uint32_t i = 0; i < begin.colorCount; i++) {
    begin.color[i] = attachment(subpass.colors[i]);
    if (i < subpass.resolves.size()) begin.resolve[i] = attachment(subpass.resolves[i]);
  }
  begin.depthStencil = attachment(subpass.depthStencil);
  begin.depthStencilResolve = attachment(subpass.depthStencilResolve);
  begin.depthResolve = subpass.depthResolve;
  begin.stencilResolve = subpass.stencilResolve;
  return begin;
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateRenderPass(VkDevice device, const VkRenderPassCreateInfo* info, const VkAllocationCallbacks* callbacks, VkRenderPass* out) {
  return create(device, info, callbacks, out);
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateRenderPass2(VkDevice device, const VkRenderPassCreateInfo2* info, const VkAllocationCallbacks* callbacks, VkRenderPass* out) {
  return create(device, info, callbacks, out);
}

VKAPI_ATTR void VKAPI_CALL vkDestroyRenderPass(VkDevice device, VkRenderPass pass, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(pass));
}

VKAPI_ATTR void VKAPI_CALL vkGetRenderAreaGranularity(VkDevice, VkRenderPass, VkExtent2D* out) { *out = {1, 1}; }

VKAPI_ATTR VkResult VKAPI_CALL vkCreateFramebuffer(VkDevice device, const VkFramebufferCreateInfo* info, const VkAllocationCallbacks* callbacks, VkFramebuffer* out) {
  auto* framebuffer = from(device)->make<Framebuffer>(callbacks, from(device)->allocatorFor(callbacks));
  if (!framebuffer) return VK_ERROR_OUT_OF_HOST_MEMORY;
  framebuffer->width = info->width;
  framebuffer->height = info->height;
  framebuffer->layers = info->layers;
  try {
    if (!(info->flags & VK_FRAMEBUFFER_CREATE_IMAGELESS_BIT)) {
      framebuffer->views.reserve(info->attachmentCount);
      for (uint32_t i = 0; i < info->attachmentCount; i++) framebuffer->views.push_back(from(info->pAttachments[i]));
    }
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, framebuffer);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkFramebuffer>(framebuffer);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyFramebuffer(VkDevice device, VkFramebuffer framebuffer, const VkAllocationCallbacks* callbacks) {
  from(device)->destroy(callbacks, from(framebuffer));
}

}  // namespace pumice::icd
