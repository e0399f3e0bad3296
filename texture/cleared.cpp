#include "texture/cleared.h"

#include <algorithm>

namespace pumice::texture {

void writeClearedTile(const ImageMemory& image, uint32_t tileX, uint32_t tileY) {
  ClearedTiles* c = image.cleared;
  if (!c || !c->mark(tileX, tileY)) return;
  c->mark(tileX, tileY) = 0;
  const LevelLayout& level = image.layout->planes[0].levels[0];
  const uint32_t x = tileX * c->kEdge, y = tileY * c->kEdge;
  fillRect(image, VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 0, {{int32_t(x), int32_t(y)}, {std::min(c->kEdge, level.width - x), std::min(c->kEdge, level.height - y)}}, c->element);
}

void writeCleared(const ImageMemory& image) {
  if (!image.cleared) return;
  for (uint32_t y = 0; y < image.cleared->down; ++y)
    for (uint32_t x = 0; x < image.cleared->across; ++x) writeClearedTile(image, x, y);
}

}  // namespace pumice::texture
