// ViewKey::tiled: how the texels of a view are addressed.
#pragma once

#include "texture/keys.h"

namespace pumice::texture {

enum Addressing : uint8_t {
  kTiled = 1,    //!< blocks of 4x4 elements; else rows
  kCompact = 2,  //!< less than 4 GiB from the view's base: every place in it is one i32 offset
};

//! Of a view of `size` bytes (ImageDescriptor::size).
constexpr uint8_t addressing(bool tiled, uint64_t size) { return uint8_t((tiled ? kTiled : 0) | (size < (uint64_t(1) << 32) ? kCompact : 0)); }
inline bool isTiled(const ViewKey& k) { return k.tiled & kTiled; }
inline bool isCompact(const ViewKey& k) { return k.tiled & kCompact; }

}  // namespace pumice::texture
