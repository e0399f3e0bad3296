#include "cts_subset/harness/shader.h"

#include <glslang/Public/ResourceLimits.h>
#include <glslang/Public/ShaderLang.h>
#include <glslang/SPIRV/GlslangToSpv.h>
#include <spirv-tools/libspirv.h>

#include <map>
#include <mutex>
#include <stdexcept>
#include <tuple>

namespace pumice::cts {
namespace {

EShLanguage languageOf(VkShaderStageFlagBits stage) {
  if (stage == VK_SHADER_STAGE_VERTEX_BIT) return EShLangVertex;
  if (stage == VK_SHADER_STAGE_FRAGMENT_BIT) return EShLangFragment;
  if (stage == VK_SHADER_STAGE_COMPUTE_BIT) return EShLangCompute;
  throw std::runtime_error("compileGlsl: stage not known to the harness");
}

std::vector<uint32_t> compile(VkShaderStageFlagBits stage, const std::string& source, ShaderTarget target) {
  static const bool kStarted = glslang::InitializeProcess();
  if (!kStarted) throw std::runtime_error("glslang does not start");

  EShLanguage language = languageOf(stage);
  glslang::TShader shader(language);
  const char* text = source.c_str();
  shader.setStrings(&text, 1);
  shader.setEnvInput(glslang::EShSourceGlsl, language, glslang::EShClientVulkan, 100);
  bool newest = target == ShaderTarget::kVulkan13;
  shader.setEnvClient(glslang::EShClientVulkan, newest ? glslang::EShTargetVulkan_1_3 : glslang::EShTargetVulkan_1_0);
  shader.setEnvTarget(glslang::EShTargetSpv, newest ? glslang::EShTargetSpv_1_6 : glslang::EShTargetSpv_1_0);
  auto messages = static_cast<EShMessages>(EShMsgSpvRules | EShMsgVulkanRules);
  if (!shader.parse(GetDefaultResources(), 450, false, messages))
    throw std::runtime_error(std::string("glslang: ") + shader.getInfoLog() + "\n" + source);
  glslang::TProgram program;
  program.addShader(&shader);
  if (!program.link(messages))
    throw std::runtime_error(std::string("glslang: ") + program.getInfoLog() + "\n" + source);

  std::vector<uint32_t> words;
  glslang::GlslangToSpv(*program.getIntermediate(language), words);
  return words;
}

}  // namespace

const std::vector<uint32_t>& compileGlsl(VkShaderStageFlagBits stage, const std::string& source, ShaderTarget target) {
  static std::mutex lock;
  static std::map<std::tuple<int, int, std::string>, std::vector<uint32_t>> known;
  std::lock_guard guard(lock);
  auto key = std::make_tuple(static_cast<int>(stage), static_cast<int>(target), source);
  auto found = known.find(key);
  if (found == known.end()) found = known.emplace(key, compile(stage, source, target)).first;
  return found->second;
}

std::vector<uint32_t> assemble(const std::string& text) {
  spv_context context = spvContextCreate(SPV_ENV_VULKAN_1_3);
  spv_binary binary = nullptr;
  spv_diagnostic diagnostic = nullptr;
  spv_result_t result = spvTextToBinary(context, text.data(), text.size(), &binary, &diagnostic);
  std::vector<uint32_t> words;
  if (result == SPV_SUCCESS) words.assign(binary->code, binary->code + binary->wordCount);
  std::string problem = diagnostic ? "line " + std::to_string(diagnostic->position.line + 1) + ": " + diagnostic->error : "";
  spvDiagnosticDestroy(diagnostic);
  spvBinaryDestroy(binary);
  spvContextDestroy(context);
  if (result != SPV_SUCCESS) throw std::runtime_error("SPIR-V assembly, " + problem);
  return words;
}

}  // namespace pumice::cts
