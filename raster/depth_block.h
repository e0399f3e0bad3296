// Depth of 4x4 blocks: evaluated from a primitive's plane, compared, written and bounded, sixteen pixels at a time.
//
// The same IEEE operations as the fragment routine's (pipeline/fragment_routine.cpp: evaluatePlane, clampDepth; texture/pack.cpp:
// packDepth), so that it makes no difference which of the two tests a sample. Depths are compared as *keys*: what is stored, as a
// float (unsigned normalised formats have at most 24 bits, so their integers are exact floats).
//
// Both fused multiply-adds of a plane are monotone in each coordinate, rounding included: over a rectangle of sample places the
// extremes are those of two corners, exactly. Clamping and packing are monotone too. So bounds need no margin.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include <vulkan/vulkan_core.h>

namespace pumice::raster {

//! How depth is stored. Unorm24 in the low bits of 32; what lies above them is written as zero.
enum class DepthKind : uint8_t { Float32, Unorm16, Unorm24 };
constexpr uint32_t depthBytes(DepthKind kind) { return kind == DepthKind::Unorm16 ? 2 : 4; }

//! A primitive's depth in one grid cell, as in its record, and what it is clamped to (low <= high, no NaN).
struct DepthEquation {
  float origin = 0, dx = 0, dy = 0;
  float low = 0, high = 1;
  bool inside = false;           //!< at covered samples all depths lie between low and high, not on them, and within [0, 1]
  //! False: sums may overflow, so corners say nothing.
  bool tame() const {
    // Three terms, coordinates below 64: no sum comes near to overflow. False for NaN.
    constexpr float kMost = 0x1p110f;
    return std::fabs(origin) < kMost && std::fabs(dx) < kMost && std::fabs(dy) < kMost;
  }
};

//! Of keys; from -infinity to infinity where nothing is known, or where there is a NaN.
struct KeyBounds {
  float low, high;
};

//! A rectangle of sample places, relative to the cell's corner.
struct Places {
  float x0, y0, x1, y1;
};

//! Of a tile's squares, bit each: all of one's samples fail, or pass. Neither: nothing is known.
struct SquareOutcomes {
  uint32_t fails, passes;
};

//! A block of depths, `count` planes of it.
struct BlockSamples {
  uint32_t count;
  const float *x, *y;            //!< each sample's place in its pixel
  float blockX, blockY;          //!< of the block, relative to the cell's corner
  std::byte* memory;             //!< of the first sample
  uint64_t pitch;                //!< bytes from one sample's plane to the next
};

struct DepthKernels {
  //! Keys of all places in a rectangle. The equation is tame.
  KeyBounds (*bounds)(const DepthEquation& depth, DepthKind kind, const Places& places);
  //! The same for each of the sixteen blocks of a 16x16 square, row by row; `first` is the first block's rectangle.
  void (*boundsOfBlocks)(const DepthEquation& depth, DepthKind kind, const Places& first, float* low, float* high);
  //! The same for the sixteen 16x16 squares of a tile, and what these bounds say of tests against those of what is stored.
  SquareOutcomes (*testSquares)(const DepthEquation& depth, DepthKind kind, VkCompareOp compare, const Places& first, const float* storedLow,
                                const float* storedHigh, float* low, float* high);
  //! Writes the block's sixteen depths (quad-major). (x, y): the sample's place in the block's first pixel.
  void (*write)(const DepthEquation& depth, DepthKind kind, float x, float y, std::byte* memory);
  //! Tests a block's samples, those of `masks[s]` of each plane, writes those that pass if `write` is set, and gives them in `passed`.
  //! Bounds: of the block afterwards.
  void (*test)(const DepthEquation& depth, DepthKind kind, VkCompareOp compare, bool write, const BlockSamples& samples, const uint16_t* masks,
               uint16_t* passed, KeyBounds& bounds);
};

//! For this processor, no better than PUMICE_ISA allows.
const DepthKernels& depthKernels();
//! Those that run everywhere.
const DepthKernels& plainDepthKernels();
//! All there are for this processor (tests): the first one runs everywhere.
struct NamedDepthKernels {
  const char* name;
  const DepthKernels* kernels;
};
size_t availableDepthKernels(NamedDepthKernels (&out)[2]);

//! The key of a clear value, as stored: f32 bits or the integer.
float depthKey(DepthKind kind, uint32_t stored);

//! What bounds alone say about a test of all of [own] against all of [stored].
enum class Outcome : uint8_t { Fails, Passes, Open };
inline Outcome compareBounds(VkCompareOp op, const KeyBounds& own, const KeyBounds& stored) {
  const auto say = [](bool fails, bool passes) { return fails ? Outcome::Fails : passes ? Outcome::Passes : Outcome::Open; };
  switch (op) {
    case VK_COMPARE_OP_NEVER: return Outcome::Fails;
    case VK_COMPARE_OP_LESS: return say(own.low >= stored.high, own.high < stored.low);
    case VK_COMPARE_OP_EQUAL: return say(own.high < stored.low || own.low > stored.high, false);
    case VK_COMPARE_OP_LESS_OR_EQUAL: return say(own.low > stored.high, own.high <= stored.low);
    case VK_COMPARE_OP_GREATER: return say(own.high <= stored.low, own.low > stored.high);
    case VK_COMPARE_OP_NOT_EQUAL: return say(false, own.high < stored.low || own.low > stored.high);
    case VK_COMPARE_OP_GREATER_OR_EQUAL: return say(own.high < stored.low, own.low >= stored.high);
    default: return Outcome::Passes;
  }
}

}  // namespace pumice::raster
