// Lane IR for texels: unpack, pack, addresses, sampling. The only place where a format's bits or a texel's address
// is turned into arithmetic; executors see plain IR.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "spirv_interp/ir/builder.h"
#include "texture/descriptor.h"
#include "texture/keys.h"

namespace pumice::texture {

//! Four components; f32, or i32 for integer formats (see Numeric). Absent ones are 0, alpha 1.
using Texel = std::array<ir::Value, 4>;

//! Raw bits of one element as little-endian words: elements of 1 and 2 bytes as one i32 (zero extended),
//! 4 bytes one i32, 8: two, 12: three, 16: four; 64-bit components take two words each.
using RawElement = std::array<ir::Value, 8>;
//! Number and type of the consecutive loads for an element: {I8,1}, {I16,1}, {I32,n}; elements of 3 and 6 bytes: {I8,3}, {I16,3}.
//! RawElement holds one i32 per load, zero extended. Compressed formats: count 0.
struct RawLoads { ir::Type type; uint32_t count; };
RawLoads rawLoads(const FormatInfo& f);

//! The format of one plane: for combined depth/stencil the format of that aspect alone (X8_D24, D32, D16, S8), for an aspect PLANE_n
//! of multi-planar formats that plane's, else f.
const FormatInfo& planeFormat(const FormatInfo& f, VkImageAspectFlags aspect);

//! What the caller of a routine must give as table ir::kTableConstants (the sRGB tables). Made on first use, lives for ever.
struct ConstantTable { const std::byte* data; uint64_t size; };
ConstantTable constantTable();

//! Bits to components. Exact: UNORM n bits gives the correctly rounded quotient v / (2^n - 1); sRGB by the exact formula rounded once
//! (256-entry table in constant memory allowed); packed floats and shared exponent exact.
Texel unpack(ir::Builder& b, const FormatInfo& f, const RawElement& raw);
//! Components to bits. UNORM: clamp (NaN to 0), round to nearest even of c * (2^n - 1); as the conversion rules of the spec.
RawElement pack(ir::Builder& b, const FormatInfo& f, const Texel& texel);

//! Depth as stored: D16 and D24 unsigned normalised, D32 float. `raw` is i16, i32 or f32 as TileLoad gives it; packDepth gives
//! i32 for D16 (zero extended) and D24 (upper byte 0), f32 for D32.
ir::Value unpackDepth(ir::Builder& b, const FormatInfo& f, ir::Value raw);
ir::Value packDepth(ir::Builder& b, const FormatInfo& f, ir::Value depth);

//! Loads one element at address base + offset (robust: outside `size` gives zero bits) and unpacks it.
Texel loadTexel(ir::Builder& b, const FormatInfo& f, ir::Value base, ir::Value offset, ir::Value size, bool constant);
void storeTexel(ir::Builder& b, const FormatInfo& f, ir::Value base, ir::Value offset, ir::Value size, const Texel& texel);

//! An image descriptor's fields, loaded from set memory. `table` and `constOffset` say where the binding's
//! element 0 is, `dynamicOffset` (i32 or 0) where the array element is.
struct ImageRef {
  uint32_t table = 0;
  uint32_t constOffset = 0;
  ir::Value dynamicOffset = 0;
  ViewKey key;
};
struct SamplerRef {
  uint32_t table = 0;
  uint32_t constOffset = 0;
  ir::Value dynamicOffset = 0;
  SamplerKey key;
};

//! Expands one image instruction (operands in the order ir.h gives). Returns 4 components for samples, fetches and reads, the
//! queries' components else, nothing for writes. Fails with an empty vector and `error` set for what is not there yet.
std::vector<ir::Value> expandImage(ir::Builder& b, const ir::ImageOpInfo& op, std::span<const ir::Value> operands,
                                   const ImageRef& image, const SamplerRef& sampler, const char** error);

//! Byte offset (i64) of element (x, y, z) in level memory from its LevelLayout at address `levels` + level*sizeof.
ir::Value elementOffset(ir::Builder& b, const ViewKey& key, ir::Value levelsAddress, ir::Value level, ir::Value layer, ir::Value layerPitch,
                        ir::Value x, ir::Value y, ir::Value z);

}  // namespace pumice::texture
