// Tests against exact expectations, run on the driver under test and, to show that the tests
// themselves are right, on lavapipe.
#pragma once

#include "cts_subset/harness/workspace.h"
#include "cts_subset/tests/world.h"

#include <string>
#include <vector>

namespace pumice::cts {

enum class Role { kTested, kPeer };

class OnDevice : public testing::TestWithParam<Role> {
 protected:
  void SetUp() override {
    if (GetParam() == Role::kTested) {
      PUMICE_NEED_TESTED();
      chosen = world().tested.get();
    } else {
      PUMICE_NEED_PEER();
      chosen = world().peer.get();
    }
  }
  Device& device() { return *chosen; }
  template <class Properties>
  Properties properties(VkStructureType type) {
    Properties found{};
    found.sType = type;
    VkPhysicalDeviceProperties2 p2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &found, {}};
    vkGetPhysicalDeviceProperties2(device().physical, &p2);
    return found;
  }

 private:
  Device* chosen = nullptr;
};

inline std::string roleName(const testing::TestParamInfo<Role>& info) {
  return info.param == Role::kTested ? "Tested" : "Lavapipe";
}

#define PUMICE_ON_BOTH_DEVICES(suite) \
  INSTANTIATE_TEST_SUITE_P(On, suite, testing::Values(Role::kTested, Role::kPeer), roleName)

using Bytes = std::vector<uint8_t>;

// Repeatable bytes without an obvious period.
inline Bytes noise(size_t size, uint32_t seed) {
  Bytes out(size);
  uint32_t state = seed * 2654435761u + 12345u;
  for (uint8_t& byte : out) {
    state = state * 1664525u + 1013904223u;
    byte = uint8_t(state >> 24);
  }
  return out;
}

inline Bytes bytesOf(const Buffer& buffer) {
  auto begin = reinterpret_cast<const uint8_t*>(buffer.mapped);
  return Bytes(begin, begin + buffer.size);
}

struct TexelFormat {
  VkFormat format;
  const char* name;
  uint32_t bytes;                                         // per texel, or per block
  uint32_t block = 1;                                     // texels on a side
  VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT;  // what the bytes describe
};

// Where a copied box lies in a subresource and in a buffer.
struct Piece {
  uint32_t mip = 0, layer = 0, layers = 1;
  VkOffset3D offset{0, 0, 0};
  VkExtent3D extent{1, 1, 1};
  VkDeviceSize bufferOffset = 0;
  uint32_t rowLength = 0, imageHeight = 0;
};

inline VkBufferImageCopy regionOf(const Piece& piece, VkImageAspectFlags aspect) {
  VkBufferImageCopy region{};
  region.bufferOffset = piece.bufferOffset;
  region.bufferRowLength = piece.rowLength;
  region.bufferImageHeight = piece.imageHeight;
  region.imageSubresource = {aspect, piece.mip, piece.layer, piece.layers};
  region.imageOffset = piece.offset;
  region.imageExtent = piece.extent;
  return region;
}

// The whole of one subresource, tightly packed. The image must be in GENERAL.
inline Bytes download(Workspace& work, const Image& image, uint32_t mip, uint32_t layer,
                      VkImageAspectFlags aspect, uint32_t texelBytes, uint32_t block = 1) {
  auto size = [&](uint32_t whole) { return std::max(whole >> mip, 1u); };
  VkExtent3D e{size(image.spec.extent.width), size(image.spec.extent.height), size(image.spec.extent.depth)};
  auto blocks = [&](uint32_t texels) { return VkDeviceSize((texels + block - 1) / block); };
  VkDeviceSize bytes = blocks(e.width) * blocks(e.height) * e.depth * texelBytes;
  Buffer target = work.buffer(bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  Piece piece;
  piece.mip = mip, piece.layer = layer, piece.extent = e;
  VkBufferImageCopy region = regionOf(piece, aspect);
  work.device.run([&](VkCommandBuffer commands) {
    fullBarrier(commands);
    vkCmdCopyImageToBuffer(commands, image.handle, VK_IMAGE_LAYOUT_GENERAL, target.handle, 1, &region);
    fullBarrier(commands);
  });
  return bytesOf(target);
}

inline void upload(Workspace& work, const Image& image, const Piece& piece, const Bytes& bytes,
                   VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT) {
  Buffer source = work.buffer(bytes.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, bytes.data());
  VkBufferImageCopy region = regionOf(piece, aspect);
  work.device.run([&](VkCommandBuffer commands) {
    vkCmdCopyBufferToImage(commands, source.handle, image.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &region);
    fullBarrier(commands);
  });
}

inline void toGeneral(Workspace& work, const Image& image) {
  work.device.run([&](VkCommandBuffer commands) {
    transition(commands, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
  });
}

// "byte 17 is 3, expected 4", or nothing.
inline std::string firstDifference(const Bytes& found, const Bytes& expected) {
  if (found.size() != expected.size()) return "sizes differ";
  for (size_t i = 0; i < found.size(); ++i)
    if (found[i] != expected[i])
      return "byte " + std::to_string(i) + " of " + std::to_string(found.size()) + " is " +
             std::to_string(found[i]) + ", expected " + std::to_string(expected[i]);
  return {};
}

}  // namespace pumice::cts
