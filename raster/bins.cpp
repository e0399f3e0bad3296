// Bins, sample locations and fragment records.
#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>

#include "raster/tiles.h"

namespace pumice::raster {

void Bins::addToSome(uint32_t draw, const Primitive& p) {
  constexpr int32_t kTile = int32_t(kTileSize);
  if (p.maxX < 0 || p.maxY < 0 || p.minX > p.maxX || p.minY > p.maxY) return;
  const int32_t x0 = std::max(p.minX, 0) / kTile, x1 = std::min(p.maxX / kTile, int32_t(grid_.tilesX) - 1);
  const int32_t y0 = std::max(p.minY, 0) / kTile, y1 = std::min(p.maxY / kTile, int32_t(grid_.tilesY) - 1);
  if (x0 > x1 || y0 > y1) return;
  if (p.layer >= grid_.layers) return;
  const size_t layer = size_t(p.layer) * grid_.tilesX * grid_.tilesY;
  // A small one in two tiles side by side touches both, but for what the scissor cuts off: its edges need not even be fetched.
  if ((x1 - x0) + (y1 - y0) == 1 && p.edgeCount && std::max(p.maxX - p.minX, p.maxY - p.minY) < kTile - 1) {
    tiles_[layer + size_t(y0) * grid_.tilesX + size_t(x0)].push_back({draw, false, &p});
    tiles_[layer + size_t(y1) * grid_.tilesX + size_t(x1)].push_back({draw, false, &p});
    return;
  }
  // A tile is left out when even its corner that is deepest inside lies outside one edge. Samples lie on
  // [0, 255] / 256 of their pixel, so the tile spans [0, last] in 1/256 pixels.
  constexpr int64_t kSpan = int64_t(kTile) * kSubpixelOne;
  constexpr int64_t kLast = kSpan - 1;
  // It covers all of a tile when the corner that is least inside lies inside of all edges, and its rectangle goes as far.
  // Two edges each: at the deepest corner; to the next tile; from the deepest corner to the least deep one.
  typedef int64_t Two __attribute__((vector_size(16)));
  const int32_t wholeX0 = (p.minX + kTile - 1) / kTile, wholeX1 = (p.maxX + 1) / kTile - 1;
  const int32_t wholeY0 = (p.minY + kTile - 1) / kTile, wholeY1 = (p.maxY + 1) / kTile - 1;
  for (int32_t y = y0; y <= y1; y++) {
    Two best[2] = {}, across[2] = {}, spread[2] = {};
    for (uint32_t e = 0; e < p.edgeCount; e++) {
      const Edge& edge = p.edges[e];
      const int64_t cornerX = x0 * kSpan + (edge.a > 0 ? kLast : 0), cornerY = y * kSpan + (edge.b > 0 ? kLast : 0);
      best[e / 2][e % 2] = edge.a * cornerX + edge.b * cornerY + edge.c;
      across[e / 2][e % 2] = edge.a * kSpan;
      spread[e / 2][e % 2] = (std::abs(int64_t(edge.a)) + std::abs(int64_t(edge.b))) * kLast;
    }
    const bool wholeRow = p.edgeCount && y >= wholeY0 && y <= wholeY1;
    std::vector<BinEntry>* tile = &tiles_[layer + size_t(y) * grid_.tilesX + x0];
    for (int32_t x = x0; x <= x1; x++, tile++) {
      // Negative as soon as one edge says so.
      const Two least = best[0] | best[1], leastWhole = (best[0] - spread[0]) | (best[1] - spread[1]);
      best[0] += across[0];
      best[1] += across[1];
      if ((least[0] | least[1]) < 0) continue;
      tile->push_back({draw, wholeRow && (leastWhole[0] | leastWhole[1]) >= 0 && x >= wholeX0 && x <= wholeX1, &p});
    }
  }
}

bool Bins::empty() const {
  return std::all_of(tiles_.begin(), tiles_.end(), [](const auto& tile) { return tile.empty(); });
}

void Bins::clear() {
  for (auto& tile : tiles_) tile.clear();
}

namespace {

using Location = std::array<uint8_t, 2>;
constexpr Location kSamples1[] = {{8, 8}};
constexpr Location kSamples2[] = {{12, 12}, {4, 4}};
constexpr Location kSamples4[] = {{6, 2}, {14, 6}, {2, 10}, {10, 14}};
constexpr Location kSamples8[] = {{9, 5}, {7, 11}, {13, 9}, {5, 3}, {3, 13}, {1, 7}, {11, 15}, {15, 1}};
constexpr Location kSamples16[] = {{9, 9},  {7, 5},  {5, 10}, {12, 7}, {3, 6},  {10, 13}, {13, 11}, {11, 3},
                                   {6, 14}, {8, 1},  {4, 2},  {2, 12}, {0, 8},  {15, 4},  {14, 15}, {1, 0}};

}  // namespace

std::span<const Location> sampleLocations(uint32_t samples) {
  switch (samples) {
    case 2: return kSamples2;
    case 4: return kSamples4;
    case 8: return kSamples8;
    case 16: return kSamples16;
    default: return kSamples1;
  }
}

static void fillHeader(const Primitive& p, uint32_t cellX, uint32_t cellY, std::byte* record, const DepthRange& depth) {
  RecordHeader header;
  header.frontFacing = p.frontFacing ? ~0u : 0u;
  header.primitiveId = p.primitiveId;
  header.cellX = float(cellX);
  header.cellY = float(cellY);
  header.layer = p.layer;
  header.viewport = p.viewport;
  header.minDepth = depth.low;
  header.maxDepth = depth.high;
  std::memcpy(record, &header, sizeof header);
}

void fillRecord(const Primitive& p, std::span<const Varying> varyings, uint32_t cellX, uint32_t cellY, std::byte* record,
                const DepthRange& depth) {
  fillHeader(p, cellX, cellY, record, depth);
  std::byte* out = record + kRecordPlanes;
  for (size_t i = 0; i < 2 + varyings.size(); i++, out += 12) {
    float words[3];
    if (i >= 2 && varyings[i - 2].mode == VaryingMode::Flat) {
      words[0] = 0;
      std::memcpy(&words[0], &p.flat[i - 2], 4);
      words[1] = words[2] = 0;
    } else {
      const Plane& plane = p.planes[i];
      words[0] = float(plane.origin + plane.dx * double(cellX) + plane.dy * double(cellY));
      words[1] = float(plane.dx);
      words[2] = float(plane.dy);
    }
    std::memcpy(out, words, sizeof words);
  }
}

void fillWideRecord(const Primitive& p, std::span<const Varying> varyings, uint32_t cellX, uint32_t cellY, std::byte* record,
                    const DepthRange& depth) {
  fillHeader(p, cellX, cellY, record, depth);
  std::byte* out = record + kRecordPlanes;
  for (size_t i = 0; i < 2 + varyings.size(); i++, out += 24) {
    double words[3] = {};
    if (i >= 2 && varyings[i - 2].mode == VaryingMode::Flat) {
      std::memcpy(&words[0], &p.flat[2 * (i - 2)], 8);
    } else {
      const Plane& plane = p.planes[i];
      words[0] = plane.origin + plane.dx * double(cellX) + plane.dy * double(cellY);
      words[1] = plane.dx;
      words[2] = plane.dy;
    }
    std::memcpy(out, words, sizeof words);
  }
}

}  // namespace pumice::raster
