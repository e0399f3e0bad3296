// Swapchains: images of ours, handed to a window system when presented.
#pragma once

#include "icd/resources.h"

namespace pumice::icd {

struct Swapchain;
PUMICE_HANDLE(Swapchain, VkSwapchainKHR)

//! Memory of a swapchain's image (vkBindImageMemory2 with VkBindImageMemorySwapchainInfoKHR).
std::byte* swapchainImageData(VkSwapchainKHR swapchain, uint32_t index);

}  // namespace pumice::icd
