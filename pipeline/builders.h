// The parts that routines are made of, and the pipelines they are made for. Internal to pipeline/.
#pragma once

#include "pipeline/expander.h"
#include "pipeline/saved_routines.h"
#include "pipeline/variants.h"

namespace pumice::pipeline {

class GraphicsPipeline {
 public:
  GraphicsState state;
  std::shared_ptr<const Layout> layout;
  std::shared_ptr<const frontend::Shader> vertex, fragment;   //!< fragment may be null: depth only
  StageLink link;
  ImageUses vertexImages, fragmentImages;
  VisibilityTraits visibility;
  Variants<VertexKey, VertexRoutine> vertexVariants;
  Variants<FragmentKey, FragmentRoutine> fragmentVariants;
  std::shared_ptr<SavedPipeline> saved;   //!< null: routines are not kept
  base::ThreadPool* workers = nullptr;    //!< who emits what was made with it
};

inline uint64_t hashKey(const ComputeKey& k) { return base::hashCombine(uint64_t(k.numerics), hashImages(k.images)); }

class ComputePipeline {
 public:
  std::shared_ptr<const Layout> layout;
  std::shared_ptr<const frontend::Shader> shader;
  ir::Numerics numerics = ir::Numerics::F32;
  ImageUses images;
  Variants<ComputeKey, ComputeRoutine> variants;
  std::shared_ptr<SavedPipeline> saved;
  base::ThreadPool* workers = nullptr;
};

//! With `workers` these do the JIT's work (RoutineCode).
base::Result<std::shared_ptr<VertexRoutine>> buildVertexRoutine(const GraphicsPipeline& pipeline, const VertexKey& key, base::ThreadPool* workers = nullptr);
base::Result<std::shared_ptr<FragmentRoutine>> buildFragmentRoutine(const GraphicsPipeline& pipeline, const FragmentKey& key,
                                                                    base::ThreadPool* workers = nullptr);
VisibilityTraits visibilityTraits(const GraphicsPipeline& pipeline);
//! False when nothing that the fragment shader does can be seen: colours that are masked, or that nobody takes.
bool hasEffect(const GraphicsState& state, const frontend::Shader& fragment);
base::Result<std::shared_ptr<ComputeRoutine>> buildComputeRoutine(const ComputePipeline& pipeline, const ComputeKey& key, base::ThreadPool* workers = nullptr);
//! The same from what was saved; null where there is nothing, or nothing sound.
std::shared_ptr<VertexRoutine> restoreVertexRoutine(const GraphicsPipeline& pipeline, const VertexKey& key, base::ThreadPool* workers = nullptr);
std::shared_ptr<FragmentRoutine> restoreFragmentRoutine(const GraphicsPipeline& pipeline, const FragmentKey& key, base::ThreadPool* workers = nullptr);
std::shared_ptr<ComputeRoutine> restoreComputeRoutine(const ComputePipeline& pipeline, const ComputeKey& key, base::ThreadPool* workers = nullptr);

//! A vertex attribute as the shader sees it: four components of the location's format, f32 or (integer formats) i32.
//! `checked`: PUMICE_CHECK looks whether the buffer holds it.
texture::Texel fetchAttribute(ir::Builder& b, const GraphicsState& state, uint32_t location, bool checked = false);

//! Depth bounds, stencil and depth test of one sample, in this order, with their writes. `live` (0 = all active lanes) are the
//! lanes to test; gives the lanes that pass (0 = all active). `depth` is f32, already clamped.
//! `stencilReference` (i32; 0 = the draw's): the shader's own.
ir::Value testSample(ir::Builder& b, const GraphicsState& state, uint32_t sample, ir::Value live, ir::Value depth, ir::Value stencilReference = 0);
//! Whether testSample does anything.
bool testsSamples(const GraphicsState& state);

//! Blends, masks and stores one sample of a colour attachment for the active lanes. The sources are the shader's outputs with
//! index 0 and 1 (dual source); i32 for integer formats.
void writeColor(ir::Builder& b, const GraphicsState& state, uint32_t attachment, uint32_t sample, const texture::Texel& source,
                const texture::Texel& source1);
//! False when nothing of the attachment is ever written.
bool writesColor(const GraphicsState& state, uint32_t attachment);
//! True when what is written does not depend on what was there.
bool replacesColor(const GraphicsState& state, uint32_t attachment);

}  // namespace pumice::pipeline
