// Scenes of moving bytes: 64 MiB a frame.
#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

constexpr uint32_t kSide = 4096;
constexpr VkDeviceSize kBytes = VkDeviceSize(kSide) * kSide * 4;

enum class Move { kFill, kBufferToBuffer, kBufferToImage, kImageToBuffer, kImageToImage };

template <Move move>
struct Copy : Scene {
  cts::Workspace space;
  Buffer from, to;
  Image fromImage, toImage;
  bool written = false;

  static constexpr bool kFromBuffer = move == Move::kBufferToBuffer || move == Move::kBufferToImage;
  static constexpr bool kFromImage = move == Move::kImageToBuffer || move == Move::kImageToImage;
  static constexpr bool kToImage = move == Move::kBufferToImage || move == Move::kImageToImage;

  Copy(Device& d, const Options&) : Scene(d), space(d) {
    const VkBufferUsageFlags usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    cts::ImageSpec spec;
    spec.extent = {kSide, kSide, 1};
    if (kFromBuffer) {
      from = space.buffer(kBytes, usage);
      for (VkDeviceSize i = 0; i < kBytes / 4; ++i) reinterpret_cast<uint32_t*>(from.mapped)[i] = uint32_t(i) * 2654435761u;
    }
    if (kFromImage) fromImage = space.image(spec);
    if (kToImage)
      toImage = space.image(spec);
    else
      to = space.buffer(kBytes, usage);
    device.run([&](VkCommandBuffer into) {
      if (kFromImage) {
        cts::transition(into, fromImage, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
        VkClearColorValue colour = clearColour(0.2f, 0.4f, 0.6f, 0.8f).color;
        VkImageSubresourceRange range{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
        vkCmdClearColorImage(into, fromImage.handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &colour, 1, &range);
        cts::transition(into, fromImage, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
      }
      if (kToImage) cts::transition(into, toImage, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    });
  }

  void record(VkCommandBuffer into) override {
    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {kSide, kSide, 1};
    VkImageCopy images{};
    images.srcSubresource = images.dstSubresource = region.imageSubresource;
    images.extent = region.imageExtent;
    VkBufferCopy bytes{0, 0, kBytes};
    if (move == Move::kFill) vkCmdFillBuffer(into, to.handle, 0, kBytes, 0x12345678);
    if (move == Move::kBufferToBuffer) vkCmdCopyBuffer(into, from.handle, to.handle, 1, &bytes);
    if (move == Move::kBufferToImage)
      vkCmdCopyBufferToImage(into, from.handle, toImage.handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
    if (move == Move::kImageToBuffer)
      vkCmdCopyImageToBuffer(into, fromImage.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to.handle, 1, &region);
    if (move == Move::kImageToImage)
      vkCmdCopyImage(into, fromImage.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, toImage.handle,
                     VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &images);
    cts::fullBarrier(into);
  }

  Picture picture() override {
    frame();
    if (kToImage) {
      device.run([&](VkCommandBuffer into) {
        cts::transition(into, toImage, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
      });
      return readImage(space, toImage);
    }
    Picture bytes(kSide, kSide);
    std::memcpy(bytes.rgba.data(), to.mapped, bytes.rgba.size());
    return bytes;
  }
  Work work() const override { return {double(kBytes) * (move == Move::kFill ? 1 : 2), 0}; }
};

}  // namespace

void addCopyScenes(SceneTable& table) {
  table.push_back({"fill_buffer", "64 MiB filled", makeScene<Copy<Move::kFill>>, Limit::kLargeFill});
  table.push_back({"copy_buffer", "64 MiB copied", makeScene<Copy<Move::kBufferToBuffer>>, Limit::kCopy});
  table.push_back({"copy_buffer_to_image", "64 MiB copied", makeScene<Copy<Move::kBufferToImage>>, Limit::kCopy});
  table.push_back({"copy_image_to_buffer", "64 MiB copied", makeScene<Copy<Move::kImageToBuffer>>, Limit::kCopy});
  table.push_back({"copy_image", "64 MiB copied", makeScene<Copy<Move::kImageToImage>>, Limit::kCopy});
}

}  // namespace pumice::bench
