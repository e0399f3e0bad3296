// Routines: shader plus the fixed function around it as one piece of lane IR, made for the exact state of a draw.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>

#include "pipeline/execute.h"
#include "pipeline/routine_code.h"
#include "raster/visibility.h"
#include "spirv_interp/interpreter/executor.h"

namespace pumice::pipeline {

//! View and sampler state of an image descriptor that a shader uses: part of the routine's key. A use with a constant index
//! has one; one with a dynamic index has one for each state that the array's descriptors are in.
struct ImageState {
  uint32_t use = 0;           //!< index in ImageUses::uses()
  texture::ViewKey view;
  texture::SamplerKey sampler;
  bool operator==(const ImageState&) const = default;
};

//! Selects a vertex routine within a pipeline. Nothing outside it (and the pipeline) influences the code.
struct VertexKey {
  ir::Numerics numerics = ir::Numerics::F32;
  std::vector<ImageState> images;
  bool operator==(const VertexKey&) const = default;
};

//! What the rows that a fragment routine is run for have in common.
enum class Rows : uint8_t {
  Any,
  OneRecord,   //!< all quads have the same record
  Whole,       //!< also, they are whole blocks of pixels, covered at all samples
  WholeFlat,   //!< also, 1/w is 1 everywhere
  WholeUnit,   //!< also, all varyings that are not flat lie between +0 and 1: to clamp them changes nothing
  WholeOne,    //!< Whole; of colours the first sample alone is read and written, for all the rest (one_color.h)
  WholeOneFlat,
  WholeOneUnit,
};
constexpr uint32_t kRowKinds = 8;
constexpr bool isFlat(Rows r) { return r == Rows::WholeFlat || r == Rows::WholeUnit || r == Rows::WholeOneFlat || r == Rows::WholeOneUnit; }
constexpr bool isInUnit(Rows r) { return r == Rows::WholeUnit || r == Rows::WholeOneUnit; }

struct FragmentKey {
  ir::Numerics numerics = ir::Numerics::F32;
  bool countSamples = false;                //!< an occlusion query is open
  bool statistics = false;                  //!< shader invocations are counted too
  bool settled = false;                     //!< depth is tested before: coverage is what is visible (opaque runs)
  Rows rows = Rows::Any;
  uint8_t depthTiled = 1;
  std::vector<ImageState> images;
  bool operator==(const FragmentKey&) const = default;
};

//! Vertex fetch + vertex shader. Inputs: slot 0 = VertexIndex (i32, base vertex added; also the index into
//! per-vertex buffers), slot 1 = InstanceIndex (first instance added). Output slot r is row r of raster::VertexOutputs:
//! 0..3 clip position, then `rows` below. The oracle's rows are wide (raster::VertexOutputs::wideRows).
struct VertexRoutine {
  RoutineCode code;
  uint32_t rowCount = 4;
  bool wide = false;
};

//! Interpolation, fragment shader, depth/stencil test, blending, packing. Input slots: 0 = x and 1 = y of the pixel
//! centre relative to the grid cell's corner (f32), 2 = coverage (i32, bit per sample). Quads read raster records;
//! tile planes are numbered by planeIndex(). Output slot 0 (countSamples): i32, bit per sample that passed; slot 1
//! (statistics): i32, 1 where the shader ran for the pixel itself.
//! With `perSample` it shades one sample: 0 and 1 are that sample's place, 3 = its number (i32), 4 and 5 = the pixel's
//! centre, planes of sample 0 are that sample's, and bit 0 of the output is its result.
struct FragmentRoutine {
  //! The same for rows of a kind: what is read from their one record is then one value for all lanes. Made when so many rows of the
  //! kind have come that it pays. Null until then, and where it does not pay. May be called by any number of threads.
  const FragmentRoutine* forRows(Rows kind) const;
  //! Takes one that was made in an earlier run.
  void restore(Rows kind, std::shared_ptr<FragmentRoutine> routine) const;
  //! Whether there may ever be one.
  bool hasRows(Rows kind) const { return siblings[size_t(kind)] != nullptr; }
  struct Sibling {
    std::once_flag once;
    std::atomic<uint32_t> rows{0};
    std::atomic<const FragmentRoutine*> ready{nullptr};
    std::unique_ptr<FragmentRoutine> routine;
    std::function<std::unique_ptr<FragmentRoutine>()> make;   //!< null if it cannot be made
  };
  std::unique_ptr<Sibling> siblings[kRowKinds];   //!< by Rows; of Any: null
  RoutineCode code;
  std::vector<raster::Varying> varyings;    //!< order of the record's planes; vertexRow refers to the pipeline's vertex rows
  bool wide = false;                        //!< the oracle's: reads wide records
  bool needsHelpers = false;                //!< run whole quads: `active` covers all four lanes
  bool perSample = false;                   //!< to be run once for every sample
  bool present = true;                      //!< false: nothing is written or counted, skip the draw
};

//! Number of the tile plane of colour attachment `color`, or of depth / stencil, at one sample.
constexpr uint32_t colorPlane(uint32_t color, uint32_t sample, uint32_t samples) { return color * samples + sample; }
constexpr uint32_t depthPlane(uint32_t sample, uint32_t samples) { return kMaxColorAttachments * samples + sample; }
constexpr uint32_t stencilPlane(uint32_t sample, uint32_t samples) { return (kMaxColorAttachments + 1) * samples + sample; }
static_assert(stencilPlane(15, 16) < interp::kMaxTilePlanes);
//! Of the record of decisions (32-bit elements), behind those of attachments.
constexpr uint32_t decisionPlane(uint32_t sample, uint32_t samples) { return (kMaxColorAttachments + 2) * samples + sample; }
constexpr uint32_t kRowPlanes = decisionPlane(15, 16) + 1;

//! Find or make the routine for a draw. Thread-safe; null (and a reason logged once) if it cannot be made.
std::shared_ptr<const VertexRoutine> vertexRoutine(GraphicsPipeline& pipeline, const DrawState& draw);
std::shared_ptr<const FragmentRoutine> fragmentRoutine(GraphicsPipeline& pipeline, const DrawState& draw, bool countSamples, bool statistics, bool settled);

//! What a pipeline's fragments allow the tiles to do before they are shaded (docs/architecture.md, "Visible first").
struct VisibilityTraits {
  bool opaque = false;          //!< may be part of an opaque run
  bool hiZ = false;             //!< fragments that fail the depth test have no effect
  bool planeDepth = true;       //!< writes no depth but its plane's
  uint8_t colors = 0;           //!< bit per attachment that is written. Draws of a run write the same ones
  uint32_t sampleMask = ~0u;
  raster::DepthTest depth;
  uint8_t written = 0, replaced = 0;   //!< attachments that are written; of which nothing is left where fragments cover all samples
  bool oneColor = false;        //!< a pixel that is covered at all samples gets the same in all of them, tests or not at all
  bool readsAttachments = false;
};
//! What depths are clamped to that may leave the viewport's range (a bias, the shader's own, no clipping; no clamping asked for).
raster::DepthRange freeDepths(const GraphicsState& state);

struct ComputeKey {
  ir::Numerics numerics = ir::Numerics::F32;
  std::vector<ImageState> images;
  bool operator==(const ComputeKey&) const = default;
};

//! Compute: input slots 0..2 = LocalInvocationId, 3..5 = WorkgroupId (i32 rows).
struct ComputeRoutine {
  RoutineCode code;
  std::array<uint32_t, 3> localSize{1, 1, 1};
  uint32_t sharedBytes = 0;
  bool groupsApart = false;                 //!< a row never holds invocations of two work groups: shared memory, barriers, subgroups, waiting
  bool waits = false;                       //!< loops hold atomic operations or volatile loads: a work group may wait for another
};
std::shared_ptr<const ComputeRoutine> computeRoutine(ComputePipeline& pipeline, const DispatchState& dispatch);

//! The draw constants that come from state; vertexOffset and what follows it up to drawIndex are the draw command's.
void fillConstants(const DrawState& draw, DrawConstants& constants);
//! The table list of a draw. Everything pointed to must outlive the routines' runs.
//! `sets`: those of the pipeline's layout; no shader of it reads tables of others, so there need not be any.
void fillTables(std::span<const std::byte> push, const std::byte* const* setMemory, const uint64_t* setSize, size_t sets,
                std::span<const std::byte> constants, interp::Table* tables);

}  // namespace pumice::pipeline
