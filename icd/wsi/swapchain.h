// Swapchains: images of ours, handed to a window system when presented.
#pragma once

#include "icd/resources.h"

namespace pumice::icd {

struct Swapchain;
PUMICE_HANDLE(Swapchain, VkSwapchainKHR)

//! Gives an image the memory of a swapchain's (vkBindImageMemory2 with VkBindImageMemorySwapchainInfoKHR).
void bindSwapchainImage(Image& image, VkSwapchainKHR swapchain, uint32_t index);

}  // namespace pumice::icd
