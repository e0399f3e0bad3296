// The state of a render pass between begin() and end(). Internal to pipeline/.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <optional>

#include "base/arena.h"
#include "pipeline/builders.h"
#include "pipeline/execute.h"
#include "pipeline/ideas.h"

namespace pumice::pipeline {

//! Bytes of primitives and draws that a pass collects before its tiles are finished in between.
constexpr uint64_t kBinBudget = uint64_t(32) << 20;
constexpr uint64_t kArenaKept = uint64_t(48) << 20;   //!< what an arena may keep from pass to pass

//! A draw, or a clear in the middle of a pass: what a bin entry's number refers to.
struct DrawRecord {
  bool isClear = false;
  bool settled = false;          //!< part of opaque runs: its routine shades what is visible
  // Draws
  std::shared_ptr<GraphicsPipeline> pipeline;
  std::shared_ptr<const FragmentRoutine> fragment;
  DrawConstants constants;
  std::byte push[kMaxPushBytes];
  interp::Tables tables;
  interp::UniformBank bank;
  class RowBank {
   public:
    //! The first caller makes it.
    const interp::UniformBank& get(const RoutineCode& code, const interp::Tables& tables) {
      if (!made_.load(std::memory_order_acquire))
        std::call_once(once_, [&] {
          bank_ = code->preamble(tables);
          made_.store(true, std::memory_order_release);
        });
      return bank_;
    }

   private:
    std::once_flag once_;
    std::atomic<bool> made_{false};   // once_ says the same, at the price of a call
    interp::UniformBank bank_;
  };
  RowBank rowBanks[kRowKinds];   //!< for fragment->forRows()
  raster::DepthRange depthRanges[raster::kMaxViewports];
  const VisibilityTraits* visibility = nullptr;   //!< the pipeline's
  bool leavesViewport = false;   //!< depths may leave the viewport's range; they are clamped to:
  raster::DepthRange freeRange;
  //! What depths of a primitive in the viewport are clamped to; ordered.
  raster::DepthRange clamp(uint32_t viewport) const {
    if (leavesViewport) return freeRange;
    const raster::DepthRange& r = depthRanges[viewport];
    return {std::min(r.low, r.high), std::max(r.low, r.high)};
  }
  uint64_t* occlusion = nullptr;
  PipelineStatistics* query = nullptr;
  uint8_t oneColors = 0;         //!< of Impl::oneColor, those that are written
  bool takesOneColor = false;    //!< blocks covered as a whole may be written as one colour
  // Clears
  VkClearAttachment clear{};
  VkRect2D rect{};
};

//! One plane of an attachment as tiles address it: layer 0 of the view, sample 0.
struct AttachmentPlane {
  std::byte* base = nullptr;
  uint64_t samplePitch = 0, layerPitch = 0;
  uint32_t rowElements = 0;      //!< elements from one row of blocks to the next
  uint32_t elementBytes = 0;
};

struct TileWorker;
struct FrontWorker;
struct FrontQueue;

//! Draws of a pass by number. They stay where they are: tables and chunks on their way refer to them.
class DrawList {
 public:
  ~DrawList() { clear(); }
  size_t size() const { return count_; }
  DrawRecord& operator[](size_t i) { return *at(first_ + i); }
  DrawRecord& add() {
    const size_t i = first_ + count_;
    if (i == slabs_.size() * kSlab) slabs_.push_back(std::make_unique<Slab>());
    DrawRecord& record = at(i).emplace();
    ++count_;
    return record;
  }
  void removeLast() { at(first_ + --count_).reset(); }
  //! The last one becomes number 0.
  void keepLast() {
    if (count_ < 2) return;
    const size_t last = first_ + count_ - 1;
    for (size_t i = first_; i < last; ++i) at(i).reset();
    std::swap(slabs_[0], slabs_[last / kSlab]);
    first_ = last % kSlab;
    count_ = 1;
    letGo();
  }
  void clear() {
    for (size_t i = 0; i < count_; ++i) at(first_ + i).reset();
    first_ = count_ = 0;
    letGo();
  }

 private:
  static constexpr size_t kSlab = 32, kSlabsKept = 512;   //!< records; slabs from pass to pass (23 MB): to give them back and take them again costs page faults
  using Slab = std::array<std::optional<DrawRecord>, kSlab>;
  std::optional<DrawRecord>& at(size_t i) { return (*slabs_[i / kSlab])[i % kSlab]; }
  void letGo() {
    if (slabs_.size() > kSlabsKept) slabs_.resize(kSlabsKept);
  }
  std::vector<std::unique_ptr<Slab>> slabs_;
  size_t first_ = 0, count_ = 0;
};

struct PassExecutor::Impl {
  explicit Impl(base::ThreadPool& pool);
  ~Impl();

  base::ThreadPool& pool;
  const bool stats;              //!< print them
  bool collect = false, statistics = false;   //!< wanted from the next pass on; in this one
  PassBegin pass;
  bool open = false;
  uint32_t samples = 1;
  AttachmentPlane colorPlanes[kMaxColorAttachments], depth, stencil;
  std::byte clearElements[kMaxColorAttachments][32];   //!< clear values as they are stored, where the load operation clears
  uint32_t marked = 0;           //!< colour attachments whose cleared tiles are only marked (texture/cleared.h)
  AttachmentPlane decisions;     //!< of the record, if the pass has one
  std::vector<uint32_t> decisionWords;   //!< its memory, in blocks as attachments have them
  DecisionRecord decisionRecord; //!< of the last finished pass
  std::optional<raster::DepthKind> depthKind;   //!< how depth is stored, if tiles can deal with it
  uint32_t clearDepth = 0;       //!< then: the clear value as it is stored, where the load operation clears
  Ideas disabled;
  DrawList draws;
  std::optional<raster::Bins> bins;
  uint64_t collected = 0;        //!< bytes since the last flush
  bool loaded = false;           //!< load operations are done
  bool last = false;             //!< the flush at hand is the pass's last
  uint32_t oneColor = 0;         //!< colour attachments, bit each, whose blocks may keep one colour for all samples
  std::vector<uint64_t> oneColorBits;    //!< OneColor's, four words for each tile and attachment
  std::optional<texture::BlockResolve> blockResolves[kMaxColorAttachments];   //!< of those
  uint64_t* occlusion = nullptr;
  PipelineStatistics* query = nullptr;
  std::vector<std::unique_ptr<FrontWorker>> front;
  std::unique_ptr<FrontQueue> waiting;   //!< chunks of draws that have not been worked on
  std::vector<std::unique_ptr<TileWorker>> tileWorkers;
  base::Arena clearArena;
  PassCounters counters;

  void begin(const PassBegin& pass);
  void draw(const DrawState& state, const DrawParams& params);
  void clear(const VkClearAttachment& attachment, const VkClearRect& rect);
  void end();
  //! Finishes the tiles for what was collected. Draws before the last one are forgotten. `isLast`: the pass ends.
  void flush(bool isLast = false);
  //! Fills a rectangle of one layer of the view with an element as it is stored.
  void clearColor(uint32_t attachment, uint32_t layer, const VkRect2D& rect, const std::byte* element);
  void disable(Ideas ideas);
  //! Whether anybody sees depths of the attachment after the flush at hand.
  bool keepsDepth() const {
    return !last || pass.depthStencil.storeOp != VK_ATTACHMENT_STORE_OP_DONT_CARE || (pass.depthResolve && pass.depthStencilResolve.memory.layout);
  }

 private:
  bool fits(const GraphicsState& state) const;
  void countFrontEnd(PipelineStatistics& statistics, bool add) const;
  bool beginFragments(const DrawState& state, DrawRecord& record, bool lookedAt);
  void frontEnd(const DrawState& state, const DrawParams& params, std::shared_ptr<const VertexRoutine> vertex, DrawRecord& record);
  //! Works on the chunks that wait. `drawGoesOn`: the last draw has more of them.
  void runFront(bool drawGoesOn = false);
  void clearTiles(uint32_t first, uint32_t count);
  uint64_t clearedBytes() const;
  void beginCleared();
  void beginOneColor();
  VkImageResolve resolveRegion(const Attachment& src, const Attachment& dst) const;
  void resolve();
  void beginDecisions();
  void endDecisions();
  void printCounters() const;
  void forgetPrimitives();
};

VkRect2D intersect(const VkRect2D& a, const VkRect2D& b);
inline bool isEmpty(const VkRect2D& r) { return !r.extent.width || !r.extent.height; }

//! Fills a rectangle of an attachment's layers [baseLayer, baseLayer + layerCount) of the view with one element.
void fillAttachment(const Attachment& a, VkImageAspectFlags aspect, uint32_t baseLayer, uint32_t layerCount, const VkRect2D& rect,
                    const VkClearValue& value);
//! The same with an element as it is stored; the first `samples` samples.
void fillAttachment(const Attachment& a, VkImageAspectFlags aspect, uint32_t baseLayer, uint32_t layerCount, const VkRect2D& rect,
                    const std::byte* element, uint32_t samples = ~0u);

}  // namespace pumice::pipeline
