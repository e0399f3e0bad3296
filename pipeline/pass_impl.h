// The state of a render pass between begin() and end(). Internal to pipeline/.
#pragma once

#include <optional>

#include "base/arena.h"
#include "pipeline/draw_list.h"
#include "pipeline/execute.h"
#include "pipeline/ideas.h"

namespace pumice::pipeline {

//! Bytes of primitives and draws that a pass collects before its tiles are finished in between.
constexpr uint64_t kBinBudget = uint64_t(32) << 20;
constexpr size_t kDrawBudget = 2048;   //!< draws, likewise: a record and what was computed for it are a kilobyte
constexpr uint64_t kArenaKept = uint64_t(48) << 20;   //!< what an arena may keep from pass to pass

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
  void frontEnd(const DrawState& state, const DrawParams& params, const DrawConstants& constants, std::shared_ptr<const VertexRoutine> vertex,
                DrawRecord& record);
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
