// Shader modules and pipelines.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "icd/device.h"
#include "icd/extended_state.h"
#include "icd/host_containers.h"
#include "pipeline/pipeline.h"

namespace pumice::icd {

struct ShaderModule {
  explicit ShaderModule(const HostAllocator& a) : words(HostStl<uint32_t>(a)) {}
  HostVector<uint32_t> words;
  std::mutex mutex;
  std::shared_ptr<const frontend::Module> module;   //!< parsed on first use
  //! Shaders that were made of it: many pipelines use one.
  struct Translated {
    frontend::Stage stage;
    std::string entryPoint;
    std::vector<frontend::SpecializationConstant> constants;
    unsigned checks;
    std::shared_ptr<const frontend::Shader> shader;
  };
  std::vector<Translated> translated;
  std::optional<std::array<uint64_t, 2>> key;       //!< of the words, made when a cache is used
};

struct Pipeline {
  VkPipelineBindPoint bindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  std::shared_ptr<pipeline::GraphicsPipeline> graphics;
  std::unique_ptr<PipelineFamily> family;   //!< when extended state is dynamic; then `graphics` is null
  std::shared_ptr<pipeline::ComputePipeline> compute;
};

PUMICE_HANDLE(ShaderModule, VkShaderModule)
PUMICE_HANDLE(Pipeline, VkPipeline)

}  // namespace pumice::icd
