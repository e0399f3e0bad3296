#include "icd/pipelines.h"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "base/fpenv.h"
#include "base/log.h"
#include "entrypoints.h"
#include "icd/descriptors.h"
#include "icd/pipeline_cache.h"
#include "icd/render_pass.h"
#include "spirv_interp/frontend/shader_bytes.h"
#include "spirv_interp/ir/checks.h"

namespace pumice::icd {
namespace {

constexpr size_t kMostTranslated = 8;   //!< of one module, kept

using ShaderResult = base::Result<std::shared_ptr<const frontend::Shader>>;

base::Result<std::shared_ptr<const frontend::Module>> moduleOf(const VkPipelineShaderStageCreateInfo& stage, base::ThreadPool& workers) {
  if (ShaderModule* m = from(stage.module)) {
    std::lock_guard lock(m->mutex);
    if (!m->module) {
      auto parsed = frontend::parseModule(m->words, frontend::Validate::Beside, &workers);
      if (!parsed) return parsed;
      m->module = *parsed;
    }
    return m->module;
  }
  auto* inlined = findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  if (!inlined) return base::Error{"a stage has no shader module"};
  return frontend::parseModule({inlined->pCode, inlined->codeSize / 4}, frontend::Validate::Beside, &workers);
}

frontend::Stage stageOf(VkShaderStageFlagBits s);

void keep(ShaderModule& holder, ShaderModule::Translated made) {
  std::lock_guard lock(holder.mutex);
  if (holder.translated.size() < kMostTranslated) holder.translated.push_back(std::move(made));
}

//! `unjudged`: the module, if the validator may still have something against it.
ShaderResult shaderOf(const VkPipelineShaderStageCreateInfo& stage, const std::vector<frontend::SpecializationConstant>& constants, base::ThreadPool& workers,
                      std::shared_ptr<const frontend::Module>& unjudged) {
  ShaderModule* const holder = from(stage.module);
  const frontend::Stage kind = stageOf(stage.stage);
  const unsigned checks = ir::wantedChecks();
  if (holder) {
    std::lock_guard lock(holder->mutex);
    for (const ShaderModule::Translated& t : holder->translated)
      if (t.stage == kind && t.checks == checks && t.entryPoint == stage.pName && t.constants == constants) return t.shader;
  }
  auto module = moduleOf(stage, workers);
  if (!module) return std::move(module).error();
  auto shader = frontend::translate(**module, kind, stage.pName, constants);
  // What the translator makes of any words is verified; with this it may be linked as well, before the verdict.
  if (shader && frontend::namesOnlyWhatIsThere(**shader)) {
    unjudged = *module;
    return shader;
  }
  if (auto valid = frontend::validity(**module, &workers); !valid) return valid.error();
  if (shader && holder) keep(*holder, {kind, stage.pName, constants, checks, *shader});
  return shader;
}

frontend::Stage stageOf(VkShaderStageFlagBits s) {
  switch (s) {
    case VK_SHADER_STAGE_VERTEX_BIT: return frontend::Stage::Vertex;
    case VK_SHADER_STAGE_TESSELLATION_CONTROL_BIT: return frontend::Stage::TessControl;
    case VK_SHADER_STAGE_TESSELLATION_EVALUATION_BIT: return frontend::Stage::TessEval;
    case VK_SHADER_STAGE_GEOMETRY_BIT: return frontend::Stage::Geometry;
    case VK_SHADER_STAGE_FRAGMENT_BIT: return frontend::Stage::Fragment;
    default: return frontend::Stage::Compute;
  }
}

ShaderKey wordsKeyOf(const VkPipelineShaderStageCreateInfo& stage) {
  if (ShaderModule* m = from(stage.module)) {
    std::lock_guard lock(m->mutex);
    if (!m->key) m->key = wordsKey(m->words);
    return *m->key;
  }
  auto* inlined = findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  return inlined ? wordsKey({inlined->pCode, inlined->codeSize / 4}) : ShaderKey{};
}

//! What the making of one pipeline may use, and what it came to.
struct Making {
  base::ThreadPool& workers;
  PipelineCache* cache = nullptr;
  bool mayTranslate = true;
  bool refused = false;             //!< something had to be translated and might not
  uint32_t stages = 0, hits = 0;
  VkPipelineCreationFeedback feedback[8] = {};   //!< of the stages, in the order of the create-info
  //! Shaders of modules on which there was no verdict yet, and where they are kept when it is good.
  struct Unjudged {
    std::shared_ptr<const frontend::Module> module;
    ShaderModule* holder;
    ShaderModule::Translated made;
    ShaderKey key;
  };
  std::vector<Unjudged> unjudged;
  //! Where routines are left. What PUMICE_CHECK watches is the interpreter's, and not worth it.
  std::shared_ptr<pipeline::PipelineStore> keeps() const { return cache && !ir::wantedChecks() ? cache->routines() : nullptr; }
};

uint64_t nanosecondsSince(std::chrono::steady_clock::time_point start) {
  return uint64_t(std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now() - start).count());
}

ShaderResult translateStage(const VkPipelineShaderStageCreateInfo& stage, uint32_t number, Making& making, ShaderKey& key) {
  const auto start = std::chrono::steady_clock::now();
  making.stages++;
  auto done = [&](VkPipelineCreationFeedbackFlags flags) {
    if (number < std::size(making.feedback)) making.feedback[number] = {VK_PIPELINE_CREATION_FEEDBACK_VALID_BIT | flags, nanosecondsSince(start)};
  };
  std::vector<frontend::SpecializationConstant> constants;
  if (const VkSpecializationInfo* info = stage.pSpecializationInfo)
    for (uint32_t i = 0; i < info->mapEntryCount; i++) {
      const VkSpecializationMapEntry& e = info->pMapEntries[i];
      if (e.offset > info->dataSize || e.size > info->dataSize - e.offset) continue;
      auto* data = static_cast<const std::byte*>(info->pData) + e.offset;
      constants.push_back({e.constantID, {data, data + e.size}});
    }
  if (making.cache) {
    key = shaderKey(wordsKeyOf(stage), stageOf(stage.stage), stage.pName, constants);
    if (auto found = making.cache->find(key); found && found->stage == stageOf(stage.stage)) {
      making.hits++;
      done(VK_PIPELINE_CREATION_FEEDBACK_APPLICATION_PIPELINE_CACHE_HIT_BIT);
      return found;
    }
  }
  if (!making.mayTranslate) {
    making.refused = true;
    return base::Error{"the shader is not in the cache"};
  }
  std::shared_ptr<const frontend::Module> module;
  auto shader = shaderOf(stage, constants, making.workers, module);
  if (module) making.unjudged.push_back({std::move(module), from(stage.module), {stageOf(stage.stage), stage.pName, std::move(constants), ir::wantedChecks(), *shader}, key});
  else if (shader && making.cache) making.cache->insert(key, *shader);
  done(0);
  return shader;
}

//! What the validator has against the modules. Shaders of good ones are kept.
base::Status judge(Making& making) {
  base::Status verdict;
  for (Making::Unjudged& u : making.unjudged) {
    if (auto valid = frontend::validity(*u.module, &making.workers); !valid) {
      if (verdict) verdict = valid;
      continue;
    }
    if (making.cache) making.cache->insert(u.key, u.made.shader);
    if (u.holder) keep(*u.holder, std::move(u.made));
  }
  return verdict;
}

// Everything of the create-info that is not ignored for this pipeline (spec, VkGraphicsPipelineCreateInfo).
pipeline::GraphicsState graphicsStateOf(const VkGraphicsPipelineCreateInfo& info, uint32_t& extended) {
  pipeline::GraphicsState s;
  if (info.pDynamicState)
    for (uint32_t i = 0; i < info.pDynamicState->dynamicStateCount; i++) {
      VkDynamicState d = info.pDynamicState->pDynamicStates[i];
      if (d == VK_DYNAMIC_STATE_VIEWPORT_WITH_COUNT) d = VK_DYNAMIC_STATE_VIEWPORT;
      if (d == VK_DYNAMIC_STATE_SCISSOR_WITH_COUNT) d = VK_DYNAMIC_STATE_SCISSOR;
      if (d < 32) s.dynamic |= 1u << d;
      extended |= extendedBit(d);
    }
  if (auto* v = extended & kDynamicVertexInput ? nullptr : info.pVertexInputState) {
    s.vertexBindings.assign(v->pVertexBindingDescriptions, v->pVertexBindingDescriptions + v->vertexBindingDescriptionCount);
    if (auto* d = findInChain<VkPipelineVertexInputDivisorStateCreateInfoEXT>(v->pNext, VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_DIVISOR_STATE_CREATE_INFO_EXT))
      s.divisors.assign(d->pVertexBindingDivisors, d->pVertexBindingDivisors + d->vertexBindingDivisorCount);
    s.vertexAttributes.assign(v->pVertexAttributeDescriptions, v->pVertexAttributeDescriptions + v->vertexAttributeDescriptionCount);
  }
  if (auto* a = info.pInputAssemblyState) {
    s.topology = a->topology;
    s.primitiveRestart = a->primitiveRestartEnable;
  }
  if (auto* r = info.pRasterizationState) {
    s.rasterizerDiscard = r->rasterizerDiscardEnable;
    s.depthClamp = r->depthClampEnable;
    s.depthClip = !s.depthClamp;
    if (auto* clip = findInChain<VkPipelineRasterizationDepthClipStateCreateInfoEXT>(r->pNext, VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_DEPTH_CLIP_STATE_CREATE_INFO_EXT))
      s.depthClip = clip->depthClipEnable;
    if (auto* provoking = findInChain<VkPipelineRasterizationProvokingVertexStateCreateInfoEXT>(r->pNext, VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_PROVOKING_VERTEX_STATE_CREATE_INFO_EXT))
      s.provokingLast = provoking->provokingVertexMode == VK_PROVOKING_VERTEX_MODE_LAST_VERTEX_EXT;
    s.polygonMode = r->polygonMode;
    s.cullMode = r->cullMode;
    s.frontFace = r->frontFace;
    s.depthBias = r->depthBiasEnable;
    s.depthBiasConstant = r->depthBiasConstantFactor;
    s.depthBiasClamp = r->depthBiasClamp;
    s.depthBiasSlope = r->depthBiasSlopeFactor;
    s.lineWidth = r->lineWidth;
    if (auto* line = findInChain<VkPipelineRasterizationLineStateCreateInfoEXT>(r->pNext, VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_LINE_STATE_CREATE_INFO_EXT))
      if (line->lineRasterizationMode == VK_LINE_RASTERIZATION_MODE_BRESENHAM_EXT) s.lineMode = raster::LineMode::Bresenham;
  }
  if (s.rasterizerDiscard && !(extended & kDynamicRasterizerDiscard)) return s;
  if (auto* v = info.pViewportState) {
    if (auto* control = findInChain<VkPipelineViewportDepthClipControlCreateInfoEXT>(v->pNext, VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_DEPTH_CLIP_CONTROL_CREATE_INFO_EXT))
      s.depthFromMinusOne = control->negativeOneToOne;
    // A count of 0 is one that comes with the dynamic state.
    s.viewportCount = v->viewportCount ? v->viewportCount : raster::kMaxViewports;
    if (v->pViewports && v->viewportCount) {
      s.viewport = v->pViewports[0];
      s.furtherViewports.assign(v->pViewports + 1, v->pViewports + v->viewportCount);
    }
    if (v->pScissors && v->scissorCount) {
      s.scissor = v->pScissors[0];
      s.furtherScissors.assign(v->pScissors + 1, v->pScissors + v->scissorCount);
    }
    s.furtherViewports.resize(s.viewportCount - 1);
    s.furtherScissors.resize(s.viewportCount - 1);
  }
  if (auto* m = info.pMultisampleState) {
    s.samples = m->rasterizationSamples;
    if (m->pSampleMask) s.sampleMask = m->pSampleMask[0];
    s.sampleShading = m->sampleShadingEnable;
    s.minSampleShading = m->minSampleShading;
    s.alphaToCoverage = m->alphaToCoverageEnable;
    s.alphaToOne = m->alphaToOneEnable;
  }
  s.feedbackLoop = info.flags & (VK_PIPELINE_CREATE_COLOR_ATTACHMENT_FEEDBACK_LOOP_BIT_EXT | VK_PIPELINE_CREATE_DEPTH_STENCIL_ATTACHMENT_FEEDBACK_LOOP_BIT_EXT);
  const Subpass* subpass = nullptr;
  if (const RenderPass* pass = from(info.renderPass)) {
    subpass = &pass->subpasses[info.subpass];
    auto format = [&](uint32_t a) { return a < pass->attachments.size() ? pass->attachments[a].format : VK_FORMAT_UNDEFINED; };
    s.colorCount = uint32_t(std::min<size_t>(subpass->colors.size(), pipeline::kMaxColorAttachments));
    for (uint32_t i = 0; i < s.colorCount; i++) s.colorFormats[i] = format(subpass->colors[i]);
    s.depthStencilFormat = format(subpass->depthStencil);
  } else if (auto* r = findInChain<VkPipelineRenderingCreateInfo>(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO)) {
    s.colorCount = std::min(r->colorAttachmentCount, pipeline::kMaxColorAttachments);
    std::copy_n(r->pColorAttachmentFormats, s.colorCount, s.colorFormats);
    s.depthStencilFormat = r->depthAttachmentFormat ? r->depthAttachmentFormat : r->stencilAttachmentFormat;
    s.depthAttached = r->depthAttachmentFormat;
    s.stencilAttached = r->stencilAttachmentFormat;
  }
  if (auto* d = info.pDepthStencilState; d && s.depthStencilFormat != VK_FORMAT_UNDEFINED) {
    s.depthTest = d->depthTestEnable;
    s.depthWrite = d->depthTestEnable && d->depthWriteEnable;
    s.depthCompare = d->depthCompareOp;
    s.depthBoundsTest = d->depthBoundsTestEnable;
    s.stencilTest = d->stencilTestEnable;
    s.stencilFront = d->front;
    s.stencilBack = d->back;
    s.minDepthBounds = d->minDepthBounds;
    s.maxDepthBounds = d->maxDepthBounds;
    leaveOutMissingAspects(s);
  }
  if (auto* c = info.pColorBlendState; c && s.colorCount) {
    s.logicOpEnable = c->logicOpEnable;
    s.logicOp = c->logicOp;
    s.blend.assign(c->pAttachments, c->pAttachments + c->attachmentCount);
    std::copy_n(c->blendConstants, 4, s.blendConstants);
    auto* writes = findInChain<VkPipelineColorWriteCreateInfoEXT>(c->pNext, VK_STRUCTURE_TYPE_PIPELINE_COLOR_WRITE_CREATE_INFO_EXT);
    if (writes && !(extended & kDynamicColorWrite)) {
      uint32_t enabled = ~0u;
      for (uint32_t i = 0; i < writes->attachmentCount && i < pipeline::kMaxColorAttachments; i++)
        if (!writes->pColorWriteEnables[i]) enabled &= ~(1u << i);
      leaveOutColorWrites(s, enabled);
    }
  }
  return s;
}

base::Status makeGraphics(const Device& device, const VkGraphicsPipelineCreateInfo& info, Making& making, Pipeline& out) {
  uint32_t extended = 0;
  pipeline::GraphicsState state = graphicsStateOf(info, extended);
  state.wholeAttributes = device.features[size_t(Feature::robustBufferAccess2)];
  state.unrestrictedDepth = device.extensions[size_t(Extension::kVK_EXT_depth_range_unrestricted)];
  auto* robustness = findInChain<VkPipelineRobustnessCreateInfoEXT>(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_ROBUSTNESS_CREATE_INFO_EXT);
  if (robustness && robustness->vertexInputs != VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_DEVICE_DEFAULT_EXT)
    state.wholeAttributes = robustness->vertexInputs == VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_2_EXT;
  std::shared_ptr<const frontend::Shader> vertex, fragment;
  pipeline::Keeping keeping{.store = making.keeps(), .workers = &making.workers};
  for (uint32_t i = 0; i < info.stageCount; i++) {
    const auto& stage = info.pStages[i];
    if (stage.stage == VK_SHADER_STAGE_FRAGMENT_BIT && state.rasterizerDiscard && !(extended & kDynamicRasterizerDiscard)) continue;
    auto* slot = stage.stage == VK_SHADER_STAGE_VERTEX_BIT ? &vertex : stage.stage == VK_SHADER_STAGE_FRAGMENT_BIT ? &fragment : nullptr;
    if (!slot) return base::Error{"tessellation and geometry stages are not supported"};
    auto shader = translateStage(stage, i, making, slot == &vertex ? keeping.vertex : keeping.fragment);
    if (!shader) return std::move(shader).error();
    *slot = *shader;
  }
  if (!vertex) return base::Error{"a graphics pipeline needs a vertex shader"};
  auto layout = from(info.layout)->layout;
  if (extended) out.family = std::make_unique<PipelineFamily>(extended, state, layout, vertex, fragment, keeping);
  // Which attributes there are is not known yet.
  if (extended & kDynamicVertexInput) return {};
  // A family is tried with the static values, so that what cannot work fails here and not at a draw.
  auto made = pipeline::createGraphicsPipeline(std::move(state), std::move(layout), std::move(vertex), std::move(fragment), keeping);
  if (!made) return std::move(made).error();
  if (!extended) out.graphics = *made;
  return {};
}

base::Result<std::shared_ptr<pipeline::ComputePipeline>> makeCompute(const VkComputePipelineCreateInfo& info, Making& making) {
  pipeline::Keeping keeping{.store = making.keeps(), .workers = &making.workers};
  auto shader = translateStage(info.stage, 0, making, keeping.vertex);
  if (!shader) return std::move(shader).error();
  return pipeline::createComputePipeline(from(info.layout)->layout, *shader, pipeline::defaultNumerics(), keeping);
}

// Fills VkPipelineCreationFeedbackCreateInfo of a pipeline.
void giveFeedback(const void* chain, std::chrono::steady_clock::time_point start, const Making& making) {
  auto* feedback = findInChain<VkPipelineCreationFeedbackCreateInfo>(chain, VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO);
  if (!feedback) return;
  const bool hit = making.stages && making.hits == making.stages;
  const VkPipelineCreationFeedbackFlags flags = VK_PIPELINE_CREATION_FEEDBACK_VALID_BIT | (hit ? VK_PIPELINE_CREATION_FEEDBACK_APPLICATION_PIPELINE_CACHE_HIT_BIT : 0);
  *feedback->pPipelineCreationFeedback = {flags, nanosecondsSince(start)};
  for (uint32_t i = 0; i < feedback->pipelineStageCreationFeedbackCount; i++)
    feedback->pPipelineStageCreationFeedbacks[i] = i < std::size(making.feedback) ? making.feedback[i] : VkPipelineCreationFeedback{};
}

template <typename Info, typename Make>
VkResult createPipelines(VkDevice handle, VkPipelineCache cache, uint32_t count, const Info* infos, const VkAllocationCallbacks* callbacks, VkPipeline* out, const char* what, Make&& make) {
  base::ScopedFpEnv environment;   // constants are folded on the application's thread
  VkResult result = VK_SUCCESS;
  bool stop = false;
  for (uint32_t i = 0; i < count; i++) {
    out[i] = VK_NULL_HANDLE;
    if (stop) continue;
    VkResult one = VK_SUCCESS;
    auto start = std::chrono::steady_clock::now();
    Making making{.workers = from(handle)->pool, .cache = from(cache), .mayTranslate = !(infos[i].flags & VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT)};
    auto* object = from(handle)->make<Pipeline>(callbacks);
    if (!object) {
      one = VK_ERROR_OUT_OF_HOST_MEMORY;
    } else {
      try {
        base::Status made = make(infos[i], making, *object);
        if (auto valid = judge(making); !valid) made = std::move(valid);   // says more than what came of it
        if (!made && making.refused) {
          one = VK_PIPELINE_COMPILE_REQUIRED;
        } else if (!made) {
          base::logError("%s: %s", what, made.error().message.c_str());
          // The spec has no better word for a shader that cannot be translated.
          one = VK_ERROR_UNKNOWN;
        }
      } catch (const std::bad_alloc&) {
        one = VK_ERROR_OUT_OF_HOST_MEMORY;
      }
      giveFeedback(infos[i].pNext, start, making);
      if (one == VK_SUCCESS)
        out[i] = to<VkPipeline>(object);
      else
        from(handle)->destroy(callbacks, object);
    }
    if (one != VK_SUCCESS) {
      if (result >= 0) result = one;   // an error says more than that compilation was not wanted
      stop = infos[i].flags & VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT;
    }
  }
  return result;
}

}  // namespace

VKAPI_ATTR VkResult VKAPI_CALL vkCreateShaderModule(VkDevice device, const VkShaderModuleCreateInfo* info, const VkAllocationCallbacks* callbacks, VkShaderModule* out) {
  auto* module = from(device)->make<ShaderModule>(callbacks, from(device)->allocatorFor(callbacks));
  if (!module) return VK_ERROR_OUT_OF_HOST_MEMORY;
  try {
    module->words.assign(info->pCode, info->pCode + info->codeSize / 4);
  } catch (const std::bad_alloc&) {
    from(device)->destroy(callbacks, module);
    return VK_ERROR_OUT_OF_HOST_MEMORY;
  }
  *out = to<VkShaderModule>(module);
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL vkDestroyShaderModule(VkDevice device, VkShaderModule module, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(module)); }

VKAPI_ATTR VkResult VKAPI_CALL vkCreateGraphicsPipelines(VkDevice device, VkPipelineCache cache, uint32_t count, const VkGraphicsPipelineCreateInfo* infos,
                                                         const VkAllocationCallbacks* callbacks, VkPipeline* out) {
  return createPipelines(device, cache, count, infos, callbacks, out, "vkCreateGraphicsPipelines", [&](const VkGraphicsPipelineCreateInfo& info, Making& making, Pipeline& p) -> base::Status {
    p.bindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    return makeGraphics(*from(device), info, making, p);
  });
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateComputePipelines(VkDevice device, VkPipelineCache cache, uint32_t count, const VkComputePipelineCreateInfo* infos,
                                                        const VkAllocationCallbacks* callbacks, VkPipeline* out) {
  return createPipelines(device, cache, count, infos, callbacks, out, "vkCreateComputePipelines", [](const VkComputePipelineCreateInfo& info, Making& making, Pipeline& p) -> base::Status {
    auto made = makeCompute(info, making);
    if (!made) return std::move(made).error();
    p.bindPoint = VK_PIPELINE_BIND_POINT_COMPUTE;
    p.compute = *made;
    return {};
  });
}

VKAPI_ATTR void VKAPI_CALL vkDestroyPipeline(VkDevice device, VkPipeline pipeline, const VkAllocationCallbacks* callbacks) { from(device)->destroy(callbacks, from(pipeline)); }

}  // namespace pumice::icd
