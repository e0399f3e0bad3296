// Shader modules, pipeline caches, pipelines.
#pragma once

#include <memory>
#include <mutex>

#include "icd/device.h"
#include "icd/extended_state.h"
#include "icd/host_containers.h"
#include "pipeline/pipeline.h"

namespace pumice::icd {

struct ShaderModule {
  explicit ShaderModule(const HostAllocator& a) : words(HostStl<uint32_t>(a)) {}
  HostVector<uint32_t> words;
  std::mutex mutex;
  std::shared_ptr<const frontend::Module> module;   //!< parsed and validated on first use
};

struct PipelineCache {
  explicit PipelineCache(const HostAllocator& a) : data(HostStl<std::byte>(a)) {}
  HostVector<std::byte> data;   //!< the standard header alone: nothing is cached yet
};

struct Pipeline {
  VkPipelineBindPoint bindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  std::shared_ptr<pipeline::GraphicsPipeline> graphics;
  std::unique_ptr<PipelineFamily> family;   //!< when extended state is dynamic; then `graphics` is null
  std::shared_ptr<pipeline::ComputePipeline> compute;
};

PUMICE_HANDLE(ShaderModule, VkShaderModule)
PUMICE_HANDLE(PipelineCache, VkPipelineCache)
PUMICE_HANDLE(Pipeline, VkPipeline)

}  // namespace pumice::icd
