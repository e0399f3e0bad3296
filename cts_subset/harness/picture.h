// A rendered picture in host memory, and PNG files of it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace pumice::cts {

struct Picture {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<uint8_t> rgba;  // rows from the top, four bytes a pixel
  std::vector<float> depth;   // one value a pixel, or empty when the scene has no depth to show

  Picture() = default;
  Picture(uint32_t w, uint32_t h) : width(w), height(h), rgba(size_t(w) * h * 4) {}

  const uint8_t* at(uint32_t x, uint32_t y) const { return &rgba[(size_t(y) * width + x) * 4]; }
  uint8_t* at(uint32_t x, uint32_t y) { return &rgba[(size_t(y) * width + x) * 4]; }
  std::array<int, 4> pixel(uint32_t x, uint32_t y) const {
    const uint8_t* p = at(x, y);
    return {p[0], p[1], p[2], p[3]};
  }
};

// Alpha is written as opaque, so that a picture looks the same in every viewer.
// Throws std::runtime_error when the file cannot be written.
void writePng(const std::string& path, const Picture& picture);

// All pictures with their names (small letters, digits and _) on one sheet, in cells of `cell` pixels, row by row.
Picture contactSheet(const std::vector<Picture>& pictures, const std::vector<std::string>& names, uint32_t columns,
                     uint32_t cell);

}  // namespace pumice::cts
