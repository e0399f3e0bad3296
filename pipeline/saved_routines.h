// Routines that outlive their pipeline: linked and optimised lane IR, by what it was made from. A pipeline that is made with a
// VkPipelineCache leaves its routines there as bytes, whenever they are made, and one made of the same things finds them again,
// in this process or a later one: nothing is left to do for them but to emit.
//
// The bytes may come from anywhere. Before a routine is compiled it is asked of the IR's verifier, and each thing that it names
// of its surroundings must be there (`check`): so the executors, which rely on that, can be led nowhere by it. What remains are
// addresses: loads and stores take bases that a routine computes, as those of buffers' device addresses are computed in any
// shader. So who hands in a blob can do what a shader of his can do, and no more.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "pipeline/routine.h"

namespace pumice::pipeline {

//! What a routine is given by those who run it.
struct Surroundings {
  std::vector<ir::Type> inputs, outputs;   //!< by slot; None: there is none
  std::vector<uint16_t> planes;            //!< element bytes by tile plane; 0: there is none
  uint32_t recordBytes = 0;                //!< of a quad's record
  uint32_t drawBytes = sizeof(DrawConstants);   //!< behind kTableDraw
  uint32_t sets = 0;                       //!< of the layout: the tables end there
  bool oneRecord = false;                  //!< loads from it say so (ir::kOneRecord)
  std::vector<uint32_t> inUnit;            //!< offsets of planes whose loads may say so (ir::kPlaneInUnit)
  bool workGroup = false;                  //!< work-group memory and barriers
};
//! Empty, or why the function is no routine for these surroundings.
std::string check(const ir::Function& f, const Surroundings& s);

//! A routine as it was before it was compiled, and what its maker found out beside.
struct SavedRoutine {
  ir::Function function;
  uint32_t traits = 0;
};

//! Keys of routines within a pipeline as bytes, and back (nothing if they are none).
std::string savedKey(const VertexKey& key);
std::string savedKey(const FragmentKey& key);
std::string savedKey(const ComputeKey& key);
struct SavedKeys {
  std::vector<VertexKey> vertex;
  std::vector<FragmentKey> fragment;   //!< those of Rows::Any first
  std::vector<ComputeKey> compute;
};

//! The routines of a pipeline. Thread-safe.
class SavedPipeline {
 public:
  SavedPipeline() = default;
  SavedPipeline(const SavedPipeline& other) : routines_(other.routines()) {}
  void insert(const std::string& key, const ir::Function& f, uint32_t traits);
  //! Nothing when it is not there, or turns out not to be sound; then it is forgotten.
  std::optional<SavedRoutine> find(const std::string& key, const Surroundings& surroundings);
  SavedKeys keys() const;
  void merge(const SavedPipeline& other);
  std::vector<std::byte> toBytes() const;
  //! Null if these are no such bytes. What the routines are is looked at when they are found.
  static std::shared_ptr<SavedPipeline> fromBytes(std::span<const std::byte> bytes);

 private:
  using Routines = std::map<std::string, std::vector<std::byte>>;
  Routines routines() const {
    std::lock_guard lock(mutex_);
    return routines_;
  }
  mutable std::mutex mutex_;
  Routines routines_;
};

//! Everything but the routine's own key that decides what a routine is: shaders, state and layout. `vertex` and `fragment` (or
//! `compute`) identify the shaders.
SavedPipelineKey savedPipelineKey(const GraphicsState& state, const Layout& layout, const ShaderIdentity& vertex, const ShaderIdentity& fragment);
SavedPipelineKey savedPipelineKey(ir::Numerics numerics, const Layout& layout, const ShaderIdentity& compute);

//! Everything that decides what a vertex routine is, but nothing that only fragments look at. The shader counts by its address.
SavedPipelineKey vertexPartKey(const GraphicsPipeline& pipeline, const VertexKey& key);

//! The pipelines of a VkPipelineCache. Thread-safe.
class PipelineStore {
 public:
  std::shared_ptr<SavedPipeline> find(const SavedPipelineKey& key) const;
  //! What is there already stays.
  std::shared_ptr<SavedPipeline> insert(const SavedPipelineKey& key, std::shared_ptr<SavedPipeline> pipeline);
  void merge(const PipelineStore& other);
  std::map<SavedPipelineKey, std::shared_ptr<SavedPipeline>> pipelines() const;

 private:
  mutable std::mutex mutex_;
  std::map<SavedPipelineKey, std::shared_ptr<SavedPipeline>> pipelines_;
};

//! Since the process started.
struct RoutineCounts {
  uint64_t linked = 0;      //!< expanded and optimised
  uint64_t restored = 0;    //!< found among saved ones instead
};
RoutineCounts routineCounts();
void countLinked();
void countRestored();

}  // namespace pumice::pipeline
