#include "texture/rows.h"

#include <algorithm>

namespace pumice::texture {
namespace {

// In a row of blocks the two neighbours of a quad are adjacent, the next pair is a quad (4 elements) further and the next block
// 16 elements. The element size is a constant in the common cases, so that the copies are single moves.
template <uint32_t kBytes>
struct FixedSize {
  static constexpr uint64_t bytes(uint32_t) { return kBytes; }
};
struct AnySize {
  static uint64_t bytes(uint32_t elementBytes) { return elementBytes; }
};

uint64_t columnIndex(uint32_t x) { return uint64_t(x >> 2) * 16 + (x >> 1 & 1) * 4 + (x & 1); }

template <typename Size, bool kRead>
void tiledRow(std::byte* row, uint32_t x, uint32_t count, std::byte* packed, uint32_t elementBytes) {
  const uint64_t size = Size::bytes(elementBytes);
  auto move = [&](std::byte* image, std::byte* flat, uint64_t bytes) {
    if constexpr (kRead) {
      std::memcpy(flat, image, bytes);
    } else {
      std::memcpy(image, flat, bytes);
    }
  };
  auto single = [&] {
    move(row + columnIndex(x) * size, packed, size);
    ++x, --count, packed += size;
  };
  if ((x & 1) && count) single();
  if ((x & 2) && count >= 2) {
    move(row + columnIndex(x) * size, packed, 2 * size);
    x += 2, count -= 2, packed += 2 * size;
  }
  if ((x & 3) == 0) {
    std::byte* block = row + columnIndex(x) * size;
    for (; count >= 4; count -= 4, x += 4, packed += 4 * size, block += 16 * size) {
      move(block, packed, 2 * size);
      move(block + 4 * size, packed + 2 * size, 2 * size);
    }
  }
  while (count) single();
}

template <bool kRead>
void moveRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* packed) {
  std::byte* row = s.row(y);
  if (!s.tiled) {
    std::byte* at = row + uint64_t(x) * s.elementBytes;
    std::memcpy(kRead ? packed : at, kRead ? at : packed, uint64_t(count) * s.elementBytes);
    return;
  }
  switch (s.elementBytes) {
    case 1: return tiledRow<FixedSize<1>, kRead>(row, x, count, packed, 1);
    case 2: return tiledRow<FixedSize<2>, kRead>(row, x, count, packed, 2);
    case 4: return tiledRow<FixedSize<4>, kRead>(row, x, count, packed, 4);
    case 8: return tiledRow<FixedSize<8>, kRead>(row, x, count, packed, 8);
    case 16: return tiledRow<FixedSize<16>, kRead>(row, x, count, packed, 16);
    default: return tiledRow<AnySize, kRead>(row, x, count, packed, s.elementBytes);
  }
}

}  // namespace

void readRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* out) { moveRow<true>(s, x, y, count, out); }

void writeRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, const std::byte* in) {
  moveRow<false>(s, x, y, count, const_cast<std::byte*>(in));
}

void fillElements(std::byte* out, uint64_t count, const std::byte* element, uint32_t elementBytes) {
  uint64_t bytes = count * elementBytes;
  if (bytes == 0) return;
  if (std::all_of(element + 1, element + elementBytes, [&](std::byte b) { return b == element[0]; })) {
    std::memset(out, int(element[0]), bytes);
    return;
  }
  // A pattern of 16 elements is a whole number of vectors; copies of it follow.
  std::byte pattern[16 * 32];
  uint64_t unit = 16 * uint64_t(elementBytes);
  for (int i = 0; i < 16; ++i) std::memcpy(pattern + i * elementBytes, element, elementBytes);
  for (; bytes >= unit; bytes -= unit, out += unit) std::memcpy(out, pattern, unit);
  std::memcpy(out, pattern, bytes);
}

}  // namespace pumice::texture
