// VkPipelineCache: translated and optimised shaders (lane IR) by what they were made from, and the routines that pipelines
// linked them into (pipeline/saved_routines.h). What comes from the application's hands is IR that is verified before use,
// never machine code.
//
// The blob: VkPipelineCacheHeaderVersionOne, whose UUID is of this very build of the driver, then entries of
//   key (16 bytes), checksum of the content (8), size of the content (4), what it is (4), content (frontend/shader_bytes.h,
//   or pipeline::SavedPipeline).
#pragma once

#include <array>
#include <map>
#include <mutex>
#include <vector>

#include "icd/device.h"
#include "pipeline/saved_routines.h"
#include "spirv_interp/frontend/shader.h"

namespace pumice::icd {

//! Of SPIR-V words, stage, entry point, specialization, and what PUMICE_CHECK asks for.
using ShaderKey = std::array<uint64_t, 2>;
ShaderKey shaderKey(const ShaderKey& words, frontend::Stage stage, std::string_view entryPoint, std::span<const frontend::SpecializationConstant> constants);
ShaderKey wordsKey(std::span<const uint32_t> words);

//! Of this build of the driver: what a pipeline cache must come from.
void buildUuid(uint8_t out[VK_UUID_SIZE]);

//! Thread-safe.
class PipelineCache {
 public:
  //! Takes what is whole and of this build; everything else is left out without an error (spec, vkCreatePipelineCache).
  void load(const VkPhysicalDeviceProperties& device, std::span<const std::byte> blob);
  //! Null when it is not there, or turns out not to be sound.
  std::shared_ptr<const frontend::Shader> find(const ShaderKey& key);
  void insert(const ShaderKey& key, std::shared_ptr<const frontend::Shader> shader);
  void merge(PipelineCache& other);
  //! Writes as many whole entries as fit and sets `size`. Null `out`: the size of everything.
  VkResult write(const VkPhysicalDeviceProperties& device, size_t& size, std::byte* out);
  //! Outlives the cache where pipelines still leave routines.
  const std::shared_ptr<pipeline::PipelineStore>& routines() const { return routines_; }

 private:
  struct Entry {
    std::vector<std::byte> bytes;                     //!< made when they are asked for, or loaded
    std::shared_ptr<const frontend::Shader> shader;   //!< made from bytes when it is asked for
  };
  std::mutex mutex_;
  std::map<ShaderKey, Entry> entries_;
  std::shared_ptr<pipeline::PipelineStore> routines_ = std::make_shared<pipeline::PipelineStore>();
};

PUMICE_HANDLE(PipelineCache, VkPipelineCache)

}  // namespace pumice::icd
