// A target of its own with its pass, to be sampled afterwards.
#pragma once

#include "bench/scenes/scene.h"

namespace pumice::bench {

struct Target {
  Image image;
  VkImageView view = VK_NULL_HANDLE;
  VkRenderPass pass = VK_NULL_HANDLE;  // clears (colour: does not care), stores, and leaves it ready for sampling
  VkFramebuffer framebuffer = VK_NULL_HANDLE;
};

// Colour or depth, by the format.
Target makeTarget(cts::Workspace& workspace, uint32_t width, uint32_t height, VkFormat format);

}  // namespace pumice::bench
