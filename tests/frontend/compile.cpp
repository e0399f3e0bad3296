#include "tests/frontend/compile.h"

#include <glslang/Public/ShaderLang.h>
#include <glslang/SPIRV/GlslangToSpv.h>
#include <spirv-tools/optimizer.hpp>

namespace pumice::frontend::test {

namespace {

// The limits that matter to the language, generous.
TBuiltInResource limits() {
  TBuiltInResource r{};
  r.maxLights = r.maxClipPlanes = r.maxTextureUnits = r.maxTextureCoords = 32;
  r.maxVertexAttribs = r.maxVertexUniformComponents = r.maxVaryingFloats = 4096;
  r.maxVertexTextureImageUnits = r.maxCombinedTextureImageUnits = r.maxTextureImageUnits = 80;
  r.maxFragmentUniformComponents = r.maxVaryingComponents = 4096;
  r.maxDrawBuffers = 8;
  r.maxVertexUniformVectors = r.maxVaryingVectors = r.maxFragmentUniformVectors = 256;
  r.maxVertexOutputVectors = r.maxFragmentInputVectors = 16;
  r.minProgramTexelOffset = -8;
  r.maxProgramTexelOffset = 7;
  r.maxClipDistances = r.maxCullDistances = r.maxCombinedClipAndCullDistances = 8;
  r.maxComputeWorkGroupCountX = r.maxComputeWorkGroupCountY = r.maxComputeWorkGroupCountZ = 65535;
  r.maxComputeWorkGroupSizeX = r.maxComputeWorkGroupSizeY = 1024;
  r.maxComputeWorkGroupSizeZ = 64;
  r.maxComputeUniformComponents = 1024;
  r.maxComputeTextureImageUnits = r.maxComputeImageUniforms = 16;
  r.maxImageUnits = r.maxCombinedImageUnitsAndFragmentOutputs = r.maxImageSamples = 8;
  r.maxCombinedImageUniforms = r.maxFragmentImageUniforms = r.maxVertexImageUniforms = 8;
  r.maxCombinedShaderOutputResources = 8;
  r.maxVertexOutputComponents = r.maxFragmentInputComponents = 128;
  r.maxViewports = 16;
  r.maxSamples = 8;
  r.limits.nonInductiveForLoops = r.limits.whileLoops = r.limits.doWhileLoops = true;
  r.limits.generalUniformIndexing = r.limits.generalAttributeMatrixVectorIndexing = true;
  r.limits.generalVaryingIndexing = r.limits.generalSamplerIndexing = true;
  r.limits.generalVariableIndexing = r.limits.generalConstantMatrixVectorIndexing = true;
  return r;
}

struct Process {
  Process() { glslang::InitializeProcess(); }
  ~Process() { glslang::FinalizeProcess(); }
};

}  // namespace

std::vector<uint32_t> compileGlsl(GlslStage stage, const std::string& source, std::string* log, bool oldSpirv) {
  static Process process;
  EShLanguage language = stage == GlslStage::Vertex     ? EShLangVertex
                         : stage == GlslStage::Fragment ? EShLangFragment
                                                        : EShLangCompute;
  glslang::TShader shader(language);
  const char* text = source.c_str();
  shader.setStrings(&text, 1);
  shader.setEnvInput(glslang::EShSourceGlsl, language, glslang::EShClientVulkan, 100);
  shader.setEnvClient(glslang::EShClientVulkan,
                      oldSpirv ? glslang::EShTargetVulkan_1_0 : glslang::EShTargetVulkan_1_3);
  shader.setEnvTarget(glslang::EShTargetSpv, oldSpirv ? glslang::EShTargetSpv_1_0 : glslang::EShTargetSpv_1_6);
  TBuiltInResource resources = limits();
  auto messages = EShMessages(EShMsgSpvRules | EShMsgVulkanRules);
  glslang::TProgram program;
  bool good = shader.parse(&resources, 450, false, messages);
  if (good) {
    program.addShader(&shader);
    good = program.link(messages);
  }
  std::vector<uint32_t> words;
  if (good) {
    glslang::SpvOptions options;
    options.generateDebugInfo = true;
    options.disableOptimizer = true;
    glslang::GlslangToSpv(*program.getIntermediate(language), words, &options);
  } else if (log) {
    *log = std::string(shader.getInfoLog()) + program.getInfoLog();
  }
  return words;
}

std::vector<uint32_t> assemble(const std::string& text, std::string* log, const char* version) {
  spv_target_env environment = SPV_ENV_UNIVERSAL_1_3;
  if (std::string(version) == "1.0") environment = SPV_ENV_UNIVERSAL_1_0;
  if (std::string(version) == "1.6") environment = SPV_ENV_UNIVERSAL_1_6;
  spvtools::SpirvTools tools(environment);
  tools.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t& at, const char* message) {
    if (log) *log += std::to_string(at.line + 1) + ": " + message + "\n";
  });
  std::vector<uint32_t> words;
  if (!tools.Assemble(text, &words, SPV_TEXT_TO_BINARY_OPTION_PRESERVE_NUMERIC_IDS)) words.clear();
  return words;
}

std::vector<uint32_t> optimised(const std::vector<uint32_t>& words) {
  spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_3);
  optimizer.RegisterPerformancePasses();
  std::vector<uint32_t> out;
  if (!optimizer.Run(words.data(), words.size(), &out)) out.clear();
  return out;
}

}  // namespace pumice::frontend::test
