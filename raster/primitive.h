// From post-vertex positions to primitives that can be rasterized: assembly, clipping, culling, setup in
// fixed point, planes in double.
//
// Exactness (docs/architecture.md): vertices snap to 8 sub-pixel bits; edge functions are exact integers; the
// top-left rule decides ties, so shared edges are watertight and never doubled; clip intersections are computed
// in one canonical edge direction, so neighbours agree. Clipping is only against w, near/far and the guard band.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "base/arena.h"

namespace pumice::raster {

constexpr int kSubpixelBits = 8;
constexpr int kSubpixelOne = 1 << kSubpixelBits;
constexpr uint32_t kGridCell = 64;          //!< pixels: planes are re-based to the corner of this fixed framebuffer grid
constexpr uint32_t kMaxVaryings = 128;      //!< scalar components between vertex and fragment stage
constexpr uint32_t kMaxViewports = 16;
constexpr uint32_t kMaxClipDistances = 8;   //!< clip and cull distances together
constexpr float kMinPointSize = 1, kMaxPointSize = 1024;   //!< pixels (pointSizeRange)
constexpr float kMinLineWidth = 1, kMaxLineWidth = 64;     //!< pixels (lineWidthRange); strictLines is true

//! VkLineRasterizationModeEXT; DEFAULT is Rectangular, as strictLines says.
enum class LineMode : uint8_t { Rectangular, Bresenham };

//! PointX and PointY: PointCoord, made by the setup of points and zero elsewhere; they have no row.
enum class VaryingMode : uint8_t { Perspective, Linear, Flat, PointX, PointY };

//! One scalar that the fragment routine really reads.
struct Varying {
  uint16_t vertexRow;        //!< row of VertexOutputs it comes from
  VaryingMode mode;
};

//! Structure of arrays: rows[r][vertex slot]. Rows 0..3 are the clip-space position x, y, z, w; the others are 32-bit words.
//! Vertex slots are numbered by the front end after index de-duplication.
struct VertexOutputs {
  const float* const* rows = nullptr;
  const double* const* wideRows = nullptr;   //!< instead of rows, from the oracle's routines: numbers as doubles, words in the low half of 64 bits
  uint32_t rowCount = 0;
  uint32_t vertexCount = 0;
  int32_t pointSizeRow = -1;
  int32_t viewportRow = -1, layerRow = -1;          //!< integers; the provoking vertex's count
  int32_t clipDistanceRow = -1, cullDistanceRow = -1;   //!< the first of as many rows
  int32_t decisionRow = -1;                         //!< hashes: a Flat varying of this row is the sum of all own vertices' words
  uint32_t clipDistances = 0, cullDistances = 0;

  double number(uint32_t row, uint32_t slot) const { return wideRows ? wideRows[row][slot] : double(rows[row][slot]); }
  uint32_t word(uint32_t row, uint32_t slot) const {
    return wideRows ? uint32_t(std::bit_cast<uint64_t>(wideRows[row][slot])) : std::bit_cast<uint32_t>(rows[row][slot]);
  }
};

//! A viewport, and what limits pixels of its primitives: scissor, render area and framebuffer intersected.
struct View {
  VkViewport viewport{};
  VkRect2D bounds{};
};

//! Everything about a draw that assembly, clipping and setup need. Plain values, captured from Vulkan state.
struct SetupState {
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  VkViewport viewport{};
  VkRect2D bounds{};                 //!< scissor, render area and framebuffer intersected: nothing outside is produced
  std::span<const View> furtherViews;   //!< viewports 1 and up, for vertices that choose one (viewportRow)
  uint32_t layers = 1;               //!< of the framebuffer: primitives of others are dropped
  VkPolygonMode polygonMode = VK_POLYGON_MODE_FILL;
  VkCullModeFlags cullMode = 0;
  VkFrontFace frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;
  bool depthClampEnable = false;
  bool depthFromMinusOne = false;    //!< clip-space depth goes from -w to w
  bool depthClipEnable = true;       //!< near and far clip where this is set and depthClampEnable is not
  bool provokingLast = false;
  bool depthBiasEnable = false;
  float depthBiasConstant = 0, depthBiasClamp = 0, depthBiasSlope = 0;
  VkFormat depthFormat = VK_FORMAT_UNDEFINED;    //!< for the unit of the constant bias
  float lineWidth = 1;
  LineMode lineMode = LineMode::Rectangular;
  uint32_t samples = 1;
  bool cellRecords = false;          //!< triangles inside of one grid cell get their record, and no planes
  bool singly = false;               //!< never several triangles at once (tests compare the two ways)
  std::span<const Varying> varyings;
};

//! v(x, y) = origin + dx * x + dy * y at pixel coordinates relative to a point (framebuffer origin or grid cell corner).
struct Plane { double dx = 0, dy = 0, origin = 0; };

//! One edge: inside where a * x + b * y + c >= 0 at sample positions in 1/256 pixel units; c already holds the top-left rule's bias.
//! Within the guard band |a| and |b| stay below 2^30.
struct Edge {
  int32_t a = 0, b = 0;
  int64_t c = 0;
};

//! A primitive that covers something. Lives in an arena until its render pass is finished. Tiles fetch these from all over memory, so it
//! is two cache lines.
struct alignas(64) Primitive {
  Edge edges[4];                   //!< triangles use 3, rectangles (lines, points) 4
  uint8_t edgeCount = 3;
  bool frontFacing = true;
  bool wholePixels = false;        //!< covers all samples of the pixels whose centre is inside, and no others (Bresenham lines)
  uint16_t layer = 0, viewport = 0;
  uint32_t primitiveId = 0;
  int32_t minX, minY, maxX, maxY;  //!< pixels that may be covered, inclusive, inside `bounds` (triangles: and the viewport, which only this limits)
  float minZ, maxZ;                //!< hold every depth that a record's plane gives at a covered sample, after bias; who clamps depth clamps these
  const Plane* planes = nullptr;   //!< from the framebuffer's origin: [0] depth, [1] 1/w, then one per Varying: Perspective value/w, Linear the value
  const uint32_t* flat = nullptr;  //!< one word (of wide rows: two) per Varying, valid for Flat ones
  const std::byte* record = nullptr;   //!< instead of planes and flat: the record of the one grid cell it lies in (tiles.h)
};
static_assert(sizeof(Primitive) == 128);

//! Why triangles were dropped (PUMICE_STATS).
struct SetupCounters {
  uint64_t input = 0, clippedAway = 0, culledFace = 0, culledZeroArea = 0, culledOutside = 0, culledNoSample = 0, output = 0;
};

//! Assembles primitives [first, first+count) of the draw from a list of vertex slots, clips, culls and sets them up.
//! `slots` are the vertex slots in index order (strips and fans restarted by the caller: one span per restart run).
//! Appends to `out`, in order. Memory comes from the arena. Primitives without area, or outside, or with NaN positions vanish.
void setupPrimitives(const SetupState& state, const VertexOutputs& vertices, std::span<const uint32_t> slots,
                     uint32_t firstPrimitiveId, base::Arena& arena, std::vector<Primitive>& out, SetupCounters& counters);

}  // namespace pumice::raster
