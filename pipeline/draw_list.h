// The draws that a pass has collected. Internal to pipeline/.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <new>
#include <optional>
#include <vector>

#include "pipeline/builders.h"
#include "pipeline/execute.h"

namespace pumice::pipeline {

//! A draw, or a clear in the middle of a pass: what a bin entry's number refers to.
//! Many draws are collected before tiles are finished, so it is small: what a layout may have and this one does not takes no room.
struct DrawRecord {
  bool isClear = false;
  bool settled = false;          //!< part of opaque runs: its routine shades what is visible
  // Draws
  std::shared_ptr<GraphicsPipeline> pipeline;
  std::shared_ptr<const FragmentRoutine> fragment;
  interp::Table* tables = nullptr;   //!< in DrawList::Values, as what they show of constants and push constants
  raster::DepthRange* depthRanges = nullptr;   //!< of the pipeline's viewports; there, too
  uint32_t samples = 1;
  interp::UniformBank bank;
  class RowBank {
   public:
    ~RowBank() { delete bank_.load(std::memory_order_relaxed); }
    //! Made by the first caller; of several at a time by each, and one of them stays: what they make is the same.
    const interp::UniformBank& get(const RoutineCode& code, const interp::Table* tables) {
      if (const interp::UniformBank* known = bank_.load(std::memory_order_acquire)) return *known;
      auto made = std::make_unique<const interp::UniformBank>(code->preamble(tables));
      const interp::UniformBank* first = nullptr;
      if (!bank_.compare_exchange_strong(first, made.get(), std::memory_order_acq_rel, std::memory_order_acquire)) return *first;
      return *made.release();
    }

   private:
    std::atomic<const interp::UniformBank*> bank_{nullptr};
  };
  RowBank rowBanks[kRowKinds];   //!< for fragment->forRows()
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
  std::unique_ptr<std::byte[]> ownValues;   //!< that are not the slab's
  uint32_t valuesBegin = 0;      //!< in the slab's
  // Clears
  VkClearAttachment clear{};
  VkRect2D rect{};
};

//! Draws of a pass by number. They stay where they are: tables and chunks on their way refer to them.
class DrawList {
 public:
  //! What a draw's routines read besides descriptors and buffers, in bytes; and how many tables and depth ranges there are.
  struct Shape { uint32_t constants = 0, push = 0, tables = 0, ranges = 0; };
  struct Values { std::byte *constants, *push; };

  ~DrawList() { clear(); }
  size_t size() const { return count_; }
  DrawRecord& operator[](size_t i) { return *at(first_ + i); }
  DrawRecord& add() {
    const size_t i = first_ + count_;
    if (i == slabs_.size() * kSlab) slabs_.push_back(std::make_unique<Slab>());
    Slab& slab = *slabs_[i / kSlab];
    if (i % kSlab == 0) slab.valuesUsed = 0;
    DrawRecord& record = slab.records[i % kSlab].emplace();
    record.valuesBegin = slab.valuesUsed;
    ++count_;
    return record;
  }
  //! Room for the last record's values, as long as it is there: its tables and depth ranges (default ones), and the rest.
  Values makeValues(const Shape& shape) {
    Slab& slab = *slabs_[(first_ + count_ - 1) / kSlab];
    DrawRecord& record = (*this)[count_ - 1];
    const auto rounded = [](uint32_t bytes) { return (bytes + 15) & ~15u; };
    static_assert(sizeof(interp::Table) == 16 && alignof(raster::DepthRange) <= 16);
    const uint32_t tables = shape.tables * uint32_t(sizeof(interp::Table)), constants = rounded(shape.constants), push = rounded(shape.push);
    const uint32_t bytes = tables + constants + push + rounded(shape.ranges * uint32_t(sizeof(raster::DepthRange)));
    std::byte* memory = slab.values + slab.valuesUsed;
    if (bytes <= sizeof slab.values - slab.valuesUsed) {
      slab.valuesUsed += bytes;
    } else {
      record.ownValues = std::make_unique<std::byte[]>(bytes);
      memory = record.ownValues.get();
    }
    record.tables = new (memory) interp::Table[shape.tables];
    record.depthRanges = new (memory + tables + constants + push) raster::DepthRange[shape.ranges];
    return {memory + tables, memory + tables + constants};
  }
  void removeLast() {
    const size_t i = first_ + --count_;
    slabs_[i / kSlab]->valuesUsed = at(i)->valuesBegin;
    at(i).reset();
  }
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
  static constexpr size_t kSlab = 32, kSlabsKept = 512;   //!< records; slabs from pass to pass (8 MB): to give them back and take them again costs page faults
  struct Slab {
    std::array<std::optional<DrawRecord>, kSlab> records;
    uint32_t valuesUsed = 0;
    alignas(16) std::byte values[kSlab * 256];   //!< those beyond are records' own
  };
  std::optional<DrawRecord>& at(size_t i) { return slabs_[i / kSlab]->records[i % kSlab]; }
  void letGo() {
    if (slabs_.size() > kSlabsKept) slabs_.resize(kSlabsKept);
  }
  std::vector<std::unique_ptr<Slab>> slabs_;
  size_t first_ = 0, count_ = 0;
};

}  // namespace pumice::pipeline
