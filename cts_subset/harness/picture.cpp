#include "cts_subset/harness/picture.h"

#include <png.h>

#include <algorithm>
#include <stdexcept>

namespace pumice::cts {

void writePng(const std::string& path, const Picture& picture) {
  std::vector<uint8_t> rgb;
  rgb.reserve(size_t(picture.width) * picture.height * 3);
  for (size_t i = 0; i < picture.rgba.size(); i += 4)
    rgb.insert(rgb.end(), &picture.rgba[i], &picture.rgba[i] + 3);

  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = picture.width;
  image.height = picture.height;
  image.format = PNG_FORMAT_RGB;
  if (!png_image_write_to_file(&image, path.c_str(), 0, rgb.data(), 0, nullptr))
    throw std::runtime_error("cannot write " + path + ": " + image.message);
}

Picture contactSheet(const std::vector<Picture>& pictures, uint32_t columns, uint32_t cell) {
  constexpr uint32_t kGap = 8;
  uint32_t rows = (uint32_t(pictures.size()) + columns - 1) / columns;
  Picture sheet(columns * (cell + kGap) + kGap, rows * (cell + kGap) + kGap);
  std::fill(sheet.rgba.begin(), sheet.rgba.end(), uint8_t(32));
  for (size_t i = 0; i < pictures.size(); ++i) {
    const Picture& picture = pictures[i];
    uint32_t left = kGap + uint32_t(i) % columns * (cell + kGap);
    uint32_t top = kGap + uint32_t(i) / columns * (cell + kGap);
    uint32_t longest = std::max({picture.width, picture.height, cell});
    uint32_t width = picture.width * cell / longest, height = picture.height * cell / longest;
    // A box filter: pictures larger than the cell shrink without losing thin lines.
    for (uint32_t y = 0; y < height; ++y)
      for (uint32_t x = 0; x < width; ++x) {
        uint32_t x0 = x * picture.width / width, x1 = (x + 1) * picture.width / width;
        uint32_t y0 = y * picture.height / height, y1 = (y + 1) * picture.height / height;
        uint32_t sum[3] = {}, count = 0;
        for (uint32_t v = y0; v < std::max(y1, y0 + 1); ++v)
          for (uint32_t u = x0; u < std::max(x1, x0 + 1); ++u, ++count)
            for (int c = 0; c < 3; ++c) sum[c] += picture.at(u, v)[c];
        for (int c = 0; c < 3; ++c) sheet.at(left + x, top + y)[c] = uint8_t((sum[c] + count / 2) / count);
      }
  }
  return sheet;
}

}  // namespace pumice::cts
