// Memory and what is bound to it: buffers, images, their views; samplers.
#pragma once

#include <memory>

#include "icd/device.h"
#include "icd/external.h"
#include "texture/cleared.h"
#include "texture/descriptor.h"
#include "texture/transfer.h"

namespace pumice::icd {

struct DeviceMemory {
  std::byte* data = nullptr;
  uint64_t size = 0;
  bool ours = true;              //!< false: the host program's own memory
  OwnedFd shared;                //!< the memfd that data maps, of what may be exported or was imported
};

struct Buffer {
  uint64_t size = 0;
  VkBufferUsageFlags usage = 0;
  std::byte* data = nullptr;     //!< null until bound
  //! Clamped part of the buffer; VK_WHOLE_SIZE reaches to its end.
  texture::BufferMemory range(uint64_t offset, uint64_t length = VK_WHOLE_SIZE) const {
    if (!data || offset >= size) return {};
    uint64_t rest = size - offset;
    return {data + offset, length < rest ? length : rest};
  }
};

struct BufferView {
  texture::BufferDescriptor descriptor;
};

struct Image {
  texture::ImageLayout layout;
  VkImageCreateFlags flags = 0;
  VkImageUsageFlags usage = 0;
  VkFormat format = VK_FORMAT_UNDEFINED;
  std::byte* data = nullptr;     //!< null until bound
  std::byte* planeData[3] = {};  //!< of a disjoint image, as far as they are bound; then layout's planes lie relative to the first
  std::unique_ptr<texture::ClearedTiles> ownCleared;
  texture::ClearedTiles* cleared = nullptr;   //!< its own, or, bound to a swapchain's image, of that
  texture::ImageMemory memory() const { return {data ? &layout : nullptr, data, cleared}; }
};

//! Makes `ownCleared`, where clears of this image may be marks instead of stores: no shader can look at it, and nothing else at its memory.
void allowMarkedClears(Image& image);

struct ImageView {
  Image* image = nullptr;
  VkImageViewType viewType = VK_IMAGE_VIEW_TYPE_2D;
  VkFormat format = VK_FORMAT_UNDEFINED;
  VkImageSubresourceRange range{};           //!< VK_REMAINING_* resolved
  texture::ImageDescriptor descriptor;       //!< as written into descriptor sets
  texture::LevelLayout levels[texture::kMaxLevels];
};

struct Sampler {
  texture::SamplerDescriptor descriptor;
};

struct SamplerYcbcrConversion {
  texture::Conversion conversion;
  VkComponentMapping components{};
};

PUMICE_HANDLE(DeviceMemory, VkDeviceMemory)
PUMICE_HANDLE(Buffer, VkBuffer)
PUMICE_HANDLE(BufferView, VkBufferView)
PUMICE_HANDLE(Image, VkImage)
PUMICE_HANDLE(ImageView, VkImageView)
PUMICE_HANDLE(Sampler, VkSampler)
PUMICE_HANDLE(SamplerYcbcrConversion, VkSamplerYcbcrConversion)

//! Memory requirements of every buffer and image: one memory type.
constexpr uint32_t kMemoryTypeBits = 1;
//! VkMemoryDedicatedRequirements in a chain, if it is there: nothing needs an allocation of its own.
void fillDedicated(void* chain);

}  // namespace pumice::icd
