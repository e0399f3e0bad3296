// Render passes and framebuffers. Both forms of vkCreateRenderPass become one list of plain values.
#pragma once

#include <span>
#include "icd/host_containers.h"
#include "icd/resources.h"
#include "pipeline/execute.h"

namespace pumice::icd {

struct AttachmentInfo {
  VkFormat format = VK_FORMAT_UNDEFINED;
  uint32_t samples = 1;
  VkAttachmentLoadOp loadOp, stencilLoadOp;
  VkAttachmentStoreOp storeOp, stencilStoreOp;
};

struct Subpass {
  explicit Subpass(const HostAllocator& a) : colors(HostStl<uint32_t>(a)), resolves(HostStl<uint32_t>(a)), inputs(HostStl<uint32_t>(a)) {}
  HostVector<uint32_t> colors, resolves, inputs;   //!< VK_ATTACHMENT_UNUSED where absent; resolves is empty or as long as colors
  uint32_t depthStencil = VK_ATTACHMENT_UNUSED, depthStencilResolve = VK_ATTACHMENT_UNUSED;
  VkResolveModeFlagBits depthResolve = VK_RESOLVE_MODE_NONE, stencilResolve = VK_RESOLVE_MODE_NONE;
  uint32_t viewMask = 0;
  bool uses(uint32_t attachment) const;
};

struct RenderPass {
  explicit RenderPass(const HostAllocator& a) : attachments(HostStl<AttachmentInfo>(a)), subpasses(HostStl<Subpass>(a)) {}
  HostVector<AttachmentInfo> attachments;
  HostVector<Subpass> subpasses;
  //! Load ops happen in the first subpass that uses an attachment (and, in multiview, has the view).
  bool firstUse(uint32_t attachment, uint32_t subpass, uint32_t view) const;
  //! The same of store ops: what a later subpass uses is stored until then.
  bool lastUse(uint32_t attachment, uint32_t subpass, uint32_t view) const;
};

struct Framebuffer {
  explicit Framebuffer(const HostAllocator& a) : views(HostStl<ImageView*>(a)) {}
  HostVector<ImageView*> views;    //!< empty when imageless
  uint32_t width = 0, height = 0, layers = 1;
};

//! What one subpass needs of its attachments. `views` and `clears` by attachment number; `view` of multiview, else 0.
pipeline::PassBegin subpassBegin(const RenderPass& pass, uint32_t subpass, const Framebuffer& framebuffer,
                                 std::span<ImageView* const> views, const VkRect2D& area, std::span<const VkClearValue> clears, uint32_t view);
//! Leaves of each attachment the layer that belongs to the view.
void selectView(pipeline::PassBegin& begin, uint32_t view);
//! An attachment made of a view (load and store, no clear).
pipeline::Attachment attachmentOf(const ImageView& view);

PUMICE_HANDLE(RenderPass, VkRenderPass)
PUMICE_HANDLE(Framebuffer, VkFramebuffer)

}  // namespace pumice::icd
