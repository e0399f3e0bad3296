// The front end's draws on their way to the bins, and the scratch memory of its threads. Internal to pipeline/.
#pragma once

#include "pipeline/pass_impl.h"

namespace pumice::pipeline {

constexpr uint32_t kChunkPrimitives = 512;                //!< of one piece of work of the front end; even, so strips keep their winding
constexpr uint32_t kChunkVertices = kChunkPrimitives * 3;

//! From indices of a chunk to vertex slots. Cleared by counting generations.
class IndexTable {
 public:
  IndexTable() : entries_(kSize) {}
  void clear() { ++generation_; }
  //! The slot of (instance, index); `fresh` when it was not known and now has the slot `next`.
  uint32_t find(uint32_t instance, uint32_t index, uint32_t next, bool& fresh) {
    uint32_t at = (index * 0x9e3779b1u + instance * 0x85ebca6bu) >> (32 - kBits);
    for (;; at = (at + 1) & (kSize - 1)) {
      Entry& e = entries_[at];
      if (e.generation != generation_) {
        e = {generation_, instance, index, next};
        fresh = true;
        return next;
      }
      if (e.index == index && e.instance == instance) {
        fresh = false;
        return e.slot;
      }
    }
  }

 private:
  static constexpr uint32_t kBits = 12, kSize = 1u << kBits;
  static_assert(kSize >= 2 * kChunkVertices, "the table must stay half empty");
  struct Entry { uint64_t generation = 0; uint32_t instance = 0, index = 0, slot = 0; };
  std::vector<Entry> entries_;
  uint64_t generation_ = 0;
};

struct Run { uint32_t start, primitives, primitiveId; };       // between two restarts
struct Segment { uint32_t instance, start, first, primitives, primitiveId; };   // of one run, in one chunk

struct Chunk {
  std::vector<Segment> segments;
  std::span<const raster::Primitive> primitives;
  const uint32_t* tiles = nullptr;   //!< of each: TileGrid::onlyTile
  bool outOfMemory = false;
};

//! The draw's index buffer. Reads outside give index 0 (robust buffer access).
struct Indices {
  const std::byte* base = nullptr;
  uint64_t size = 0;
  uint32_t bytes = 0;   // 0: not indexed
  uint32_t first = 0;
  int32_t vertexOffset = 0;

  uint32_t raw(uint32_t position) const {
    const uint64_t at = (uint64_t(first) + position) * bytes;
    if (!base || at + bytes > size) return 0;
    const auto read = [&]<typename T>(T) {   // of a known size: no call
      T v;
      std::memcpy(&v, base + at, sizeof v);
      return uint32_t(v);
    };
    return bytes == 4 ? read(uint32_t()) : bytes == 2 ? read(uint16_t()) : read(uint8_t());
  }
  uint32_t restart() const { return bytes == 4 ? ~0u : (1u << (8 * bytes)) - 1; }
};

//! A draw whose chunks are being worked on: all that they share.
struct FrontDraw {
  std::shared_ptr<const VertexRoutine> vertex;
  DrawRecord* record = nullptr;
  std::vector<std::byte> constants;  //!< VertexConstants, to the last vertex buffer that there is
  std::vector<interp::Table> tables; //!< the record's, with these constants
  interp::UniformBank bank;
  bool prepared = false;
  raster::SetupState setup;
  std::vector<raster::View> further; //!< setup's
  const raster::TileGrid* grid = nullptr;
  Indices indices;
  uint32_t firstVertex = 0, firstInstance = 0;
  const std::atomic<bool>* stop = nullptr;

  //! Runs the preambles of the draw's routines: once, before the first chunk. The arena, if there is one, keeps what tiles need.
  void prepare(base::Arena* arena);
  //! The index positions of a segment's vertices: `count` from `begin`, and before them, of a fan, the run's first.
  struct Positions { bool apex; uint32_t begin, count; };
  Positions positions(const Segment& s) const {
    switch (setup.topology) {
      case VK_PRIMITIVE_TOPOLOGY_POINT_LIST: return {false, s.start + s.first, s.primitives};
      case VK_PRIMITIVE_TOPOLOGY_LINE_LIST: return {false, s.start + s.first * 2, s.primitives * 2};
      case VK_PRIMITIVE_TOPOLOGY_LINE_STRIP: return {false, s.start + s.first, s.primitives + 1};
      case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP: return {false, s.start + s.first, s.primitives + 2};
      case VK_PRIMITIVE_TOPOLOGY_TRIANGLE_FAN: return {true, s.start + s.first + 1, s.primitives + 1};
      default: return {false, s.start + s.first * 3, s.primitives * 3};
    }
  }

  void run(FrontWorker& w, Chunk& chunk) const;

 private:
  template <typename T>
  T* const* shade(FrontWorker& w) const;
};

//! Chunks of one draw or of many that have not been worked on. The order of chunks is the order of their primitives in the bins.
struct FrontQueue {
  struct Item { FrontDraw* draw; uint32_t number; Chunk chunk; };   //!< number: of the draw's record
  std::vector<Item> items;
  std::vector<std::unique_ptr<FrontDraw>> draws;                    //!< the first `used`; the others are used again
  size_t used = 0;
  uint64_t primitives = 0;

  FrontDraw& add() {
    if (used == draws.size()) draws.push_back(std::make_unique<FrontDraw>());
    return *draws[used++];
  }
  //! Items and draws; `keepLast`: but for the last draw, which has more to come.
  void clear(bool keepLast) {
    items.clear();
    primitives = 0;
    if (keepLast) std::swap(draws.front(), draws[used - 1]);
    for (size_t i = keepLast; i < used; ++i) draws[i]->vertex.reset(), draws[i]->bank = {};
    used = keepLast;
  }
  //! Between passes.
  void shrink() {
    if (draws.size() > kDrawsKept) draws.resize(kDrawsKept);
  }

 private:
  static constexpr size_t kDrawsKept = 64;
};

struct FrontWorker {
  base::Arena arena{256 * 1024};      //!< primitives and planes: lives until the tiles are finished
  base::Arena scratch{256 * 1024};    //!< rows of one chunk
  std::vector<raster::Primitive> primitives;
  std::vector<uint32_t> slots, vertexIndex, vertexInstance;
  IndexTable table;
  raster::SetupCounters setup;
  uint64_t shaded = 0, reused = 0;
};

}  // namespace pumice::pipeline
