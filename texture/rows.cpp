#include "texture/rows.h"

#include <algorithm>
#include <bit>

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
void moveRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* packed, Store store = Store::kCached) {
  std::byte* row = s.row(y);
  if (!s.tiled) {
    std::byte* at = row + uint64_t(x) * s.elementBytes;
    copyBytes(kRead ? packed : at, kRead ? at : packed, uint64_t(count) * s.elementBytes, store);
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

// Whole blocks from column x, a multiple of 4.
template <typename Size, bool kRead>
void tiledBlocks(std::byte* block, uint32_t blocks, std::byte* packed, uint64_t pitch, uint32_t elementBytes) {
  const uint64_t size = Size::bytes(elementBytes);
  for (uint32_t i = 0; i < blocks; ++i, block += 16 * size, packed += 4 * size) {
    for (uint32_t y = 0; y < 4; ++y) {
      std::byte *image = block + blockIndex(0, y) * size, *flat = packed + y * pitch;
      for (int half = 0; half < 2; ++half, image += 4 * size, flat += 2 * size) {
        if constexpr (kRead) {
          std::memcpy(flat, image, 2 * size);
        } else {
          std::memcpy(image, flat, 2 * size);
        }
      }
    }
  }
}

template <bool kRead>
void moveFourRows(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* packed, uint64_t pitch, Store store) {
  uint32_t blocks = s.tiled && x % 4 == 0 ? count / 4 : 0;
  if (blocks) {
    std::byte* first = s.row(y) + uint64_t(x) * 4 * s.elementBytes;
    switch (s.elementBytes) {
      case 1: tiledBlocks<FixedSize<1>, kRead>(first, blocks, packed, pitch, 1); break;
      case 2: tiledBlocks<FixedSize<2>, kRead>(first, blocks, packed, pitch, 2); break;
      case 4: tiledBlocks<FixedSize<4>, kRead>(first, blocks, packed, pitch, 4); break;
      case 8: tiledBlocks<FixedSize<8>, kRead>(first, blocks, packed, pitch, 8); break;
      case 16: tiledBlocks<FixedSize<16>, kRead>(first, blocks, packed, pitch, 16); break;
      default: blocks = 0; break;
    }
  }
  if (const uint32_t done = 4 * blocks; done < count)
    for (uint32_t i = 0; i < 4; ++i) moveRow<kRead>(s, x + done, y + i, count - done, packed + i * pitch + uint64_t(done) * s.elementBytes, store);
}

}  // namespace

void readFourRows(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* out, uint64_t pitch, Store store) {
  moveFourRows<true>(s, x, y, count, out, pitch, store);
}

void writeFourRows(const Slice& s, uint32_t x, uint32_t y, uint32_t count, const std::byte* in, uint64_t pitch, Store store) {
  moveFourRows<false>(s, x, y, count, const_cast<std::byte*>(in), pitch, store);
}

void readRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, std::byte* out) { moveRow<true>(s, x, y, count, out); }

void writeRow(const Slice& s, uint32_t x, uint32_t y, uint32_t count, const std::byte* in) {
  moveRow<false>(s, x, y, count, const_cast<std::byte*>(in));
}

void fillElements(std::byte* out, uint64_t count, const std::byte* element, uint32_t elementBytes, Store store) {
  uint64_t bytes = count * elementBytes;
  if (bytes == 0) return;
  if (bytes < 4096 && std::all_of(element + 1, element + elementBytes, [&](std::byte b) { return b == element[0]; })) {
    std::memset(out, int(element[0]), bytes);
    return;
  }
  // A vector of elements, or 32 of them, or as many as there are; copies of it follow.
  alignas(16) std::byte pattern[32 * 32];
  const bool fits = std::has_single_bit(elementBytes) && elementBytes <= 32;
  const uint64_t unit = std::min<uint64_t>(fits ? 32 : 32 * uint64_t(elementBytes), bytes);
  std::memcpy(pattern, element, elementBytes);
  for (uint64_t done = elementBytes; done < unit;) {
    const uint64_t more = std::min(done, unit - done);
    std::memcpy(pattern + done, pattern, more);
    done += more;
  }
  if (fits && unit == 32) return fillBytes(out, bytes, pattern, store);
  for (; bytes >= unit; bytes -= unit, out += unit) std::memcpy(out, pattern, unit);
  std::memcpy(out, pattern, bytes);
}

void fillBuffer(base::ThreadPool& pool, const BufferMemory& buffer, uint32_t word) {
  const Store store = storeFor(buffer.size);
  const uint64_t pages = (buffer.size + 4095) / 4096;
  parallelRanges(pool, uint32_t(pages), 4096, [&](uint32_t begin, uint32_t end) {
    const uint64_t from = uint64_t(begin) * 4096, to = std::min(uint64_t(end) * 4096, buffer.size);
    fillElements(buffer.base + from, (to - from) / 4, reinterpret_cast<const std::byte*>(&word), 4, store);
  });
}

void copyBuffer(base::ThreadPool& pool, const BufferMemory& src, const BufferMemory& dst, uint64_t size) {
  size = std::min({size, src.size, dst.size});
  const Store store = storeFor(size);
  parallelRanges(pool, uint32_t((size + 4095) / 4096), 4096, [&](uint32_t begin, uint32_t end) {
    const uint64_t from = uint64_t(begin) * 4096, to = std::min(uint64_t(end) * 4096, size);
    copyBytes(dst.base + from, src.base + from, to - from, store);
  });
}

}  // namespace pumice::texture
