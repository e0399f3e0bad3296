// Constants of the block decoders, part of the table ir::kTableConstants.
#pragma once

#include <cstdint>

namespace pumice::texture {

//! Which of a block's texels belong to which subset (spec, "Partition table for 2-subset BPTC", "for 3-subset BPTC").
struct BlockPartition {
  uint32_t shape;    //!< subset of texel t in bits 2t, 2t+1
  uint32_t anchors;  //!< texel whose index lacks its highest bit: of subset 1 in bits 0..4, of subset 2 in bits 8..12; 16: none
};
//! Entry 0: one subset; 1 to 64: two; 65 to 128: three.
constexpr uint32_t kPartitionsOfTwo = 1, kPartitionsOfThree = 65, kPartitions = 129;

//! One mode of BC7: where its fields begin. Bytes are packed so that one load brings several.
struct Bc7Mode {
  uint32_t header;   //!< mask of the partition bits | first entry of its partitions << 8 | mask of the rotation bits << 16 | index selection bit << 24
  uint32_t colour;   //!< position | bits << 8 | bits from one channel to the next << 16 | position of alpha << 24
  uint32_t alpha;    //!< bits | position of the p-bits << 8 | position of the indices << 16 | position of the second indices << 24
  uint32_t rest;     //!< bits of an index | of a second index << 8 | p-bit appended << 16 | p-bits belong to endpoints, not subsets << 24
};
constexpr uint32_t kBc7Modes = 9;  //!< the last one is the reserved mode: all fields empty

//! One mode of BC6H.
struct Bc6hMode {
  //! endpoint bits (5) | two subsets << 5 | transformed << 6 | valid << 7 | delta bits of r, g, b << 8, 12, 16 | how far the bits of
  //! the first endpoint above the tenth are shifted, of r, g, b << 20, 23, 26 | their number << 29
  uint32_t header;
  uint32_t scattered[2];  //!< six places of 5 bits each in the word that decodeBc6h() collects: g2[4,5] b2[4,5] g3[4,5]; b3[0..5]
  uint32_t padding;
};
constexpr uint32_t kBc6hModes = 32;  //!< by the low five bits of the block

constexpr uint32_t kColour5Steps = 187, kColour6Steps = 379;  //!< values of interpolated 5 and 6 bit components: k / 186, k / 378

struct BlockTables {
  BlockPartition partition[kPartitions];
  Bc7Mode bc7[kBc7Modes];
  Bc6hMode bc6h[kBc6hModes];
  float srgb5[kColour5Steps];  //!< linear value of k / 186, correctly rounded
  float srgb6[kColour6Steps];  //!< of k / 378
};

BlockTables makeBlockTables(long double (*decodeSrgb)(long double));

}  // namespace pumice::texture
