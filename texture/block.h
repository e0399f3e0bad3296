// Texels of block-compressed images (BC1 to BC7), decoded where they are read: the compressed bits are all there is.
//
// Source: Khronos Data Format Specification, chapters "S3TC", "RGTC" and "BPTC". BC1 to BC5 give the correctly rounded quotient of
// the exact rational value, BC6H and BC7 the exact half or byte; sRGB formats the transfer function of the exact value.
#pragma once

#include "texture/builders.h"

namespace pumice::texture {

//! Texel (x, y) (i32, each 0..3) of the block at base + offset; outside `size` the block's bits are zero. Without `scale` the division
//! that makes components of the decoder's integers is left to scaleBlockTexel(): filtering is linear, so one after it does.
Texel loadBlockTexel(ir::Builder& b, const FormatInfo& f, ir::Value base, ir::Value offset, ir::Value size, bool constant, ir::Value x, ir::Value y,
                     bool scale = true);
Texel scaleBlockTexel(ir::Builder& b, const FormatInfo& f, const Texel& unscaled);

//! The bits of a block as 32-bit words and a texel's number in it: what the decoders below work on.
struct BlockBits {
  ir::Builder& b;
  ir::Value word[4] = {};
  ir::Value texel = 0;  //!< y * 4 + x

  //! Bits [position, position + width) at a constant position.
  ir::Value field(unsigned position, unsigned width) const;
  //! The same at a position that varies (i32 below 128), cut by `mask` (i32 of low ones, at most 32 bits).
  ir::Value fieldAt(ir::Value position, ir::Value mask) const;
};

//! BC7: bytes 0..255 of red, green, blue, alpha.
void decodeBc7(const BlockBits& block, ir::Value (&rgba)[4]);
//! BC6H: bits of three halves.
void decodeBc6h(const BlockBits& block, bool isSigned, ir::Value (&rgb)[3]);

}  // namespace pumice::texture
