// What is visible in one tile: Hi-Z, depth, and for each sample the primitive that wins (docs/architecture.md, "Visible first").
//
// Depth of a block is in the attachment's memory, or is still a clear value or a primitive's plane that no one has needed as numbers
// (*virtual* depth). Winners of a block are one primitive that owns all of it, or one number per sample.
// Where both are the same for all blocks of a 16x16 square, they stand there once, until a block has to be looked at
// (visible_squares.cpp).
#pragma once

#include <vector>

#include "raster/depth_block.h"
#include "raster/tiles.h"

namespace pumice::raster {

//! How a draw tests depth. test false: everything passes and nothing is written.
struct DepthTest {
  bool test = false, write = false;
  VkCompareOp compare = VK_COMPARE_OP_ALWAYS;
};

//! The depth attachment where the tile lies. base null: there is none that draws of this kind could test.
struct DepthMemory {
  std::byte* base = nullptr;      //!< of the tile's first block, sample 0
  uint64_t samplePitch = 0;
  uint32_t rowElements = 0;       //!< elements from one row of blocks to the next
  DepthKind kind = DepthKind::Float32;
};

//! In samples, but for fragments. Not kept exactly unless `exact`: what is rejected by the square is not looked at.
struct VisibilityCounters {
  uint64_t fragments = 0, tested = 0, passed = 0;   //!< fragments: pixels with coverage
  uint64_t rejected = 0;                            //!< by Hi-Z, without a look at their own depths
  uint64_t hidden = 0;                              //!< passed, but overwritten before they were shaded
  VisibilityCounters& operator+=(const VisibilityCounters& o);
};

class Visibility final : public BlockSink {
 public:
  //! A primitive in this tile.
  struct Entry {
    const Primitive* primitive;
    void* user;                    //!< the draw
    uint32_t group;                //!< number of the draw among those whose winners are pending
    uint32_t recordGeneration;     //!< the owner's: what `record` is worth
    bool own;                      //!< `record` is the primitive's own: good for ever
    const std::byte* record;       //!< the primitive's own, if it has one
    DepthEquation depth;
  };
  //! Winners of one primitive in one block: a mask per sample at `masks`. Or in 8 blocks or some squares, from a multiple of 8 on, all of them
  //! whole.
  struct Item {
    uint16_t entry;
    uint8_t block, blocks;
    uint32_t masks;
  };

  //! `vectors`: with functions of the processor's own, where there are such. Tests compare with those that run everywhere.
  //! `squares`: what is the same in all of a square may stand there once.
  explicit Visibility(bool hiZ = true, bool vectors = true, bool squares = true)
      : hiZ_(hiZ), vectors_(vectors), squares_(squares), kernels_(vectors ? depthKernels() : plainDepthKernels()) {}

  //! Nothing is known of the tile, nothing pending. (tileX, tileY) counted in tiles.
  void begin(uint32_t tileX, uint32_t tileY, uint32_t samples, const DepthMemory& depth, bool exact);
  //! Clears the depth of the blocks wholly inside a rectangle of the tile's pixels; the rectangle is made of whole blocks.
  void clearDepth(const VkRect2D& inTile, uint32_t stored);
  //! The memory has been written by others.
  void forgetDepth();
  //! Most of the tile's depth will be wanted soon.
  void fetchDepth() const;
  //! Gives all depths to the memory.
  void materialise();
  //! The same as the last thing before begin(): less is kept up.
  void storeDepth();

  // --- opaque runs

  //! Primitives come from this draw now. `shaded`: it has colours to win.
  void beginDraw(void* user, const DepthTest& test, bool shaded);
  //! `clamp`: what the draw clamps depths to. `sampleMask`: samples that may be covered. `whole`: it covers all of the tile.
  void draw(const Primitive& primitive, const DepthRange& clamp, uint32_t sampleMask, const VkRect2D& bounds, bool whole = false);
  bool pending() const { return (pending_[0] | pending_[1] | pending_[2] | pending_[3]) != 0; }
  //! Room for entries runs out: winners must be taken, and depths made real, before the next draw().
  bool full() const { return entries_.size() >= kMaxEntries - 1; }
  //! The winners, sorted by draw; none is pending afterwards. Valid until the next call that changes anything.
  struct Winners {
    std::span<const Item> items;
    const uint16_t* masks;
  };
  Winners takeWinners();
  //! Bit per block: one primitive wins all of it.
  void ownedBlocks(uint64_t (&out)[kBlocksPerTile / 64]) const;
  Entry& entry(uint32_t number) { return entries_[number]; }
  //! After takeWinners() and materialise().
  void dropEntries() { entries_.clear(); }

  // --- Hi-Z for draws that are not part of a run. Depths must be real.

  //! A primitive of such a draw: `exactDepth`: it writes no depths but those of its plane.
  void beginOther(const Primitive& primitive, const DepthRange& clamp, const DepthTest& test, bool exactDepth);
  //! No sample of the square (16 or 64 pixels) can pass.
  bool othersFail(uint32_t x, uint32_t y, uint32_t size);
  bool otherFails(uint32_t block) const {
    return compareBounds(test_.compare, own_, {low_[block], high_[block]}) == Outcome::Fails;
  }
  //! The block's depths may have been written.
  void otherWrote(uint32_t block);

  void block(uint32_t x, uint32_t y, const uint16_t* masks) override;
  bool square(uint32_t x, uint32_t y, uint32_t size, bool whole) override;
  void blocks(uint32_t tileX, uint32_t tileY, const BlockList& list) override;
  uint32_t squares(uint32_t whole) override;

  uint64_t drawPassed = 0;   //!< samples since it was last set to zero (occlusion queries)
  VisibilityCounters counters;

 private:
  static constexpr uint32_t kMaxEntries = 0xffff;
  static constexpr uint16_t kNone = 0, kMixed = 0xffff;      // owners
  static constexpr uint16_t kMemory = 0, kClear = 0xffff;    // where depth is
  static constexpr uint32_t kWords = kBlocksPerTile / 64;
  struct Sixteen {
    alignas(32) uint16_t of[16];
  };

  DepthEquation equation(const Primitive& primitive, const DepthRange& clamp) const;
  KeyBounds keyRange(const DepthEquation& d, float low, float high) const;
  Places placesOf(uint32_t x, uint32_t y, uint32_t size) const {
    return {float(x) + sampleLowX_, float(y) + sampleLowY_, float(x + size - 1) + sampleHighX_, float(y + size - 1) + sampleHighY_};
  }
  std::byte* depthOf(uint32_t block, uint32_t sample) const {
    return memory_.base + sample * memory_.samplePitch +
           (size_t(blockY(block) >> 2) * memory_.rowElements + size_t(blockX(block)) * 4) * depthBytes(memory_.kind);
  }
  uint16_t* winnersOf(uint32_t block, uint32_t sample) { return winners_[size_t(block) * samples_ + sample].of; }
  uint16_t number();               // of the primitive at hand, plus one
  void own(uint32_t block);        // it takes all of the block
  void mark(uint32_t block, const uint16_t* passed);
  void full(uint32_t block, const KeyBounds& own);
  void testBlock(uint32_t block, const uint16_t* masks);
  void makeReal(uint32_t block);
  void setBounds(uint32_t block, const KeyBounds& b);
  void writeDepth(uint32_t block, uint16_t source) const;
  KeyBounds squareBounds(uint32_t square);
  KeyBounds tileBounds();
  void ownSquares(uint32_t squares);
  //! Before anything of a block is looked at or changed.
  void spread(uint32_t square) {
    if ((lazyDepth_ | lazyOwner_) >> square & 1) spreadSquare(square);
  }
  void spreadSquare(uint32_t square);
  void spreadAll();
  void splitBlock(uint32_t block);

  //! block() for all of a list, where depth is tested and no sample masked out (visible_blocks.cpp).
  using TakeBlocks = void (*)(Visibility&, const BlockList&);
  static TakeBlocks takeBlocksFor(DepthKind kind, uint32_t samples);
  template <DepthKind kind, bool one>
  static void takeBlocks(Visibility& v, const BlockList& list);
  //! Entries of the items, and masks, of a block that several have parts of; at most 16 items for each sample.
  using TakeMixed = uint32_t (*)(const Sixteen* winners, uint32_t samples, Item* items, uint16_t* masks);
  static uint32_t takeMixed(const Sixteen* winners, uint32_t samples, Item* items, uint16_t* masks);
  template <bool one>
  static uint32_t takeMixedAvx2(const Sixteen* winners, uint32_t samples, Item* items, uint16_t* masks);
  static TakeMixed takeMixedFor(uint32_t samples);

  const bool hiZ_, vectors_, squares_;
  const DepthKernels& kernels_;
  bool exact_ = false;
  uint32_t tileX_ = 0, tileY_ = 0, samples_ = 1;
  float sampleLowX_ = 0.5f, sampleLowY_ = 0.5f, sampleHighX_ = 0.5f, sampleHighY_ = 0.5f;
  float placeX_[16] = {}, placeY_[16] = {};   // of the samples
  DepthMemory memory_;
  uint32_t clearStored_ = 0;

  alignas(64) float low_[kBlocksPerTile];
  alignas(64) float high_[kBlocksPerTile];
  alignas(64) float squareLow_[16], squareHigh_[16];
  uint32_t staleSquares_ = 0xffff;
  KeyBounds tile_{};                  // of all squares, if
  bool tileKnown_ = false;
  // Squares, bit each, of whose blocks bounds and source_, or owner_, are not filled in: those of the square hold for all of them.
  uint32_t lazyDepth_ = 0, lazyOwner_ = 0;
  uint16_t squareSource_[16], squareOwner_[16];
  alignas(64) uint16_t source_[kBlocksPerTile];
  alignas(64) uint16_t owner_[kBlocksPerTile];
  uint64_t virtual_[kWords] = {}, pending_[kWords] = {};
  std::vector<Sixteen> winners_;
  TakeBlocks takeBlocks_ = nullptr;   // of the tile's kind of depth and number of samples
  TakeMixed takeMixed_ = nullptr;

  std::vector<Entry> entries_;
  std::vector<Item> items_, sorted_;   // room; takeWinners() says how many
  std::vector<uint16_t> masks_;
  std::vector<uint32_t> groupStart_;
  uint32_t groups_ = 0;            // draws whose winners may be pending
  uint64_t runPassed_ = 0;         // samples that won something in this run, if only for a while
  void* user_ = nullptr;
  DepthTest test_;
  bool shaded_ = false, otherExact_ = false;

  // The primitive at hand
  const Primitive* primitive_ = nullptr;
  DepthEquation equation_;
  bool tame_ = false;
  uint32_t maskedOut_ = 0;         // samples that its draw leaves out
  KeyBounds own_{};                // of all of it
  uint16_t number_ = 0;            // 0: has no entry yet
};

}  // namespace pumice::raster
