// A clear of an attachment that no shader can read may be remembered instead of stored: whoever looks at it finds the same as in an image
// that shaders can read, where it was stored.
#include "cts_subset/tests/graphics.h"

namespace pumice::cts {
namespace {

class MarkedClears : public DrawTest {};

TEST_P(MarkedClears, AreSeenByEveryCommandThatLooks) {
  PUMICE_NEED_FEATURE(device().vulkan13.dynamicRendering);
  constexpr VkExtent2D kWhole{150, 100};   // 3x2 tiles
  struct Kind {
    VkFormat format;
    uint32_t bytes;
    bool isUint;
  };
  for (const Kind& kind : {Kind{VK_FORMAT_R8_UNORM, 1, false}, Kind{VK_FORMAT_R8G8B8A8_UNORM, 4, false}, Kind{VK_FORMAT_R16G16B16A16_SFLOAT, 8, false},
                           Kind{VK_FORMAT_R32G32B32A32_UINT, 16, true}}) {
    const auto value = [&](uint32_t shade) {
      VkClearValue v{};
      for (uint32_t i = 0; i < 4; ++i) {
        if (kind.isUint) v.color.uint32[i] = 7 * shade + i;
        else v.color.float32[i] = float(5 * shade + i) / 32;
      }
      return v;
    };
    ImageSpec spec;
    spec.format = kind.format;
    spec.extent = {kWhole.width, kWhole.height, 1};
    spec.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    Image other = work->image(spec);
    spec.usage |= VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
    Image remembered = work->image(spec);
    spec.usage |= VK_IMAGE_USAGE_SAMPLED_BIT;
    Image stored = work->image(spec);
    for (const Image* i : {&other, &remembered, &stored}) toGeneral(*work, *i);
    const VkImageSubresourceLayers layers{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    const VkImageCopy part{layers, {60, 60, 0}, layers, {10, 20, 0}, {30, 30, 1}};

    using Commands = const std::function<void(VkCommandBuffer, const Image&, VkImageView)>;
    const auto renders = [&](VkCommandBuffer c, VkImageView view, VkAttachmentLoadOp load, uint32_t shade, VkRect2D area, const VkClearRect* rect = nullptr) {
      std::vector<VkRenderingAttachmentInfo> colors = {rendered(view, load, value(shade))};
      VkRenderingInfo info = renderingInfo(kWhole, colors);
      info.renderArea = area;
      vkCmdBeginRendering(c, &info);
      VkClearAttachment attachment{VK_IMAGE_ASPECT_COLOR_BIT, 0, value(shade + 1)};
      if (rect) vkCmdClearAttachments(c, 1, &attachment, 1, rect);
      vkCmdEndRendering(c);
      fullBarrier(c);
    };
    const VkClearRect rect{{{50, 10}, {40, 70}}, 0, 1};
    const VkRect2D all{{0, 0}, kWhole};
    const struct {
      const char* name;
      Commands record;
    } kLooks[] = {
        {"nothing", [](VkCommandBuffer, const Image&, VkImageView) {}},
        {"a second clear", [&](VkCommandBuffer c, const Image&, VkImageView v) { renders(c, v, VK_ATTACHMENT_LOAD_OP_CLEAR, 3, all); }},
        {"a clear of a part", [&](VkCommandBuffer c, const Image&, VkImageView v) { renders(c, v, VK_ATTACHMENT_LOAD_OP_CLEAR, 3, {{30, 70}, {60, 30}}); }},
        {"a pass that loads", [&](VkCommandBuffer c, const Image&, VkImageView v) { renders(c, v, VK_ATTACHMENT_LOAD_OP_LOAD, 4, all, &rect); }},
        {"a pass that clears and clears again", [&](VkCommandBuffer c, const Image&, VkImageView v) { renders(c, v, VK_ATTACHMENT_LOAD_OP_CLEAR, 4, all, &rect); }},
        {"a copy to it", [&](VkCommandBuffer c, const Image& i, VkImageView) { vkCmdCopyImage(c, other.handle, VK_IMAGE_LAYOUT_GENERAL, i.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &part); }},
        {"a copy within it", [&](VkCommandBuffer c, const Image& i, VkImageView) { vkCmdCopyImage(c, i.handle, VK_IMAGE_LAYOUT_GENERAL, i.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &part); }},
        {"a clear of the image", [&](VkCommandBuffer c, const Image& i, VkImageView) {
           const VkClearColorValue color = value(9).color;
           const VkImageSubresourceRange whole{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
           vkCmdClearColorImage(c, i.handle, VK_IMAGE_LAYOUT_GENERAL, &color, 1, &whole);
         }},
        {"a blit to it", [&](VkCommandBuffer c, const Image& i, VkImageView) {
           const VkImageBlit blit{layers, {{0, 0, 0}, {20, 20, 1}}, layers, {{33, 35, 0}, {93, 95, 1}}};
           vkCmdBlitImage(c, other.handle, VK_IMAGE_LAYOUT_GENERAL, i.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_NEAREST);
         }},
        {"a blit and a copy from it", [&](VkCommandBuffer c, const Image& i, VkImageView) {
           const VkImageBlit blit{layers, {{40, 40, 0}, {100, 80, 1}}, layers, {{0, 0, 0}, {30, 80, 1}}};
           vkCmdBlitImage(c, i.handle, VK_IMAGE_LAYOUT_GENERAL, other.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &blit, VK_FILTER_NEAREST);
           fullBarrier(c);
           vkCmdCopyImage(c, i.handle, VK_IMAGE_LAYOUT_GENERAL, other.handle, VK_IMAGE_LAYOUT_GENERAL, 1, &part);
         }},
    };
    uint32_t shade = 0;
    for (const auto& look : kLooks) {
      Bytes pictures[2][2];
      ++shade;
      for (const Image* image : {&stored, &remembered}) {
        upload(*work, other, {.extent = spec.extent}, noise(size_t(kWhole.width) * kWhole.height * kind.bytes, 5));
        VkImageView view = work->view(*image);
        device().run([&](VkCommandBuffer c) {
          renders(c, view, VK_ATTACHMENT_LOAD_OP_CLEAR, shade % 5, all);
          look.record(c, *image, view);
          fullBarrier(c);
        });
        pictures[image == &remembered][0] = download(*work, *image, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, kind.bytes);
        pictures[image == &remembered][1] = download(*work, other, 0, 0, VK_IMAGE_ASPECT_COLOR_BIT, kind.bytes);
      }
      EXPECT_EQ(firstDifference(pictures[1][0], pictures[0][0]), "") << look.name << ", format " << kind.format;
      EXPECT_EQ(firstDifference(pictures[1][1], pictures[0][1]), "") << look.name << ", format " << kind.format << ", the other image";
    }
  }
}

PUMICE_ON_BOTH_DEVICES(MarkedClears);

}  // namespace
}  // namespace pumice::cts
