// Conversions of texels outside of draws: small lane IR routines that run once per pixel of a box, in the interpreter.
#pragma once

#include <functional>
#include <memory>

#include "base/threads.h"
#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/builder.h"

namespace pumice::texture {

//! Selects a routine. Hashed and compared as bytes.
struct RoutineKey {
  enum Kind : uint8_t { None, Pack, Blit, Resolve };
  uint8_t kind = None;
  uint8_t dimensions = 2;
  uint8_t linearFilter = 0;
  uint8_t sourceAddressing = 0, targetAddressing = 0;  //!< ViewKey::tiled
  uint8_t samples = 1;
  uint16_t sourceFormat = 0, targetFormat = 0;   //!< formatKey()
  uint8_t agreeing = 0;                          //!< of resolves: all samples are known to equal the first
  uint8_t padding = 0;
  bool operator==(const RoutineKey&) const = default;
};
static_assert(sizeof(RoutineKey) == 12);

//! The compiled routine for a key; made by `build` if it is not in the cache. Null (and logged) if it cannot be made.
//! Safe from several threads; the cache is bounded.
std::shared_ptr<const interp::Executable> pixelRoutine(const RoutineKey& key, const std::function<void(ir::Builder&)>& build);

//! Empties the cache (with the last instance, so that an unloaded driver leaves nothing).
void forgetPixelRoutines();

struct PixelBox {
  uint32_t x = 0, y = 0, z = 0;
  uint32_t width = 0, height = 0, depth = 1;
};

//! Runs a routine once per pixel: input slots 0, 1, 2 are x, y, z (i32).
void runPixels(base::ThreadPool& pool, const interp::Executable& routine, const interp::Table* tables, const PixelBox& box);

}  // namespace pumice::texture
