#include "icd/wsi/x11_pixels.h"

#include <bit>
#include <cstring>

namespace pumice::icd {

std::optional<X11Visual> x11Visual(const xcb_setup_t* setup, xcb_visualid_t id) {
  if (!setup || setup->image_byte_order != XCB_IMAGE_ORDER_LSB_FIRST) return {};
  for (auto screen = xcb_setup_roots_iterator(setup); screen.rem; xcb_screen_next(&screen))
    for (auto depth = xcb_screen_allowed_depths_iterator(screen.data); depth.rem; xcb_depth_next(&depth))
      for (auto visual = xcb_depth_visuals_iterator(depth.data); visual.rem; xcb_visualtype_next(&visual)) {
        if (visual.data->visual_id != id) continue;
        if (visual.data->_class != XCB_VISUAL_CLASS_TRUE_COLOR &&
            visual.data->_class != XCB_VISUAL_CLASS_DIRECT_COLOR)
          return {};
        X11Visual v;
        v.depth = depth.data->depth;
        v.masks[0] = visual.data->red_mask;
        v.masks[1] = visual.data->green_mask;
        v.masks[2] = visual.data->blue_mask;
        for (auto format = xcb_setup_pixmap_formats_iterator(setup); format.rem; xcb_format_next(&format))
          if (format.data->depth == v.depth) {
            v.bytes = format.data->bits_per_pixel / 8;
            v.pad = format.data->scanline_pad / 8;
          }
        if ((v.bytes != 2 && v.bytes != 4) || !v.pad) return {};
        return v;
      }
  return {};
}

X11Packer::X11Packer(const X11Visual& visual) : visual_(visual) {
  for (int c = 0; c < 3; c++) {
    uint32_t mask = visual.masks[c];
    int shift = std::countr_zero(mask);
    uint32_t largest = mask ? mask >> shift : 0;
    for (uint64_t i = 0; i < 256; i++) table_[c][i] = mask ? uint32_t((i * largest + 127) / 255) << shift : 0;
  }
}

void X11Packer::pack(const std::byte* bgra, uint32_t bgraPitch, std::byte* out, uint32_t width,
                     uint32_t height) const {
  const uint32_t pitch = visual_.pitch(width), rest = visual_.rest();
  for (uint32_t y = 0; y < height; y++) {
    auto* from = reinterpret_cast<const uint8_t*>(bgra + size_t(y) * bgraPitch);
    std::byte* to = out + size_t(y) * pitch;
    for (uint32_t x = 0; x < width; x++, from += 4, to += visual_.bytes) {
      uint32_t pixel = table_[0][from[2]] | table_[1][from[1]] | table_[2][from[0]] | rest;
      std::memcpy(to, &pixel, visual_.bytes);
    }
  }
}

}  // namespace pumice::icd
