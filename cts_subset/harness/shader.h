// GLSL to SPIR-V at run time, by the glslang library.
#pragma once

#include <vulkan/vulkan.h>

#include <cstdint>
#include <string>
#include <vector>

namespace pumice::cts {

enum class ShaderTarget { kVulkan10, kVulkan13 };  // SPIR-V 1.0 and 1.6

// Throws std::runtime_error with glslang's log.
// The result is kept for the life of the process: both drivers get the very same words.
const std::vector<uint32_t>& compileGlsl(VkShaderStageFlagBits stage, const std::string& source,
                                         ShaderTarget target = ShaderTarget::kVulkan10);

// SPIR-V from its assembly (version 1.6). Throws std::runtime_error with the assembler's complaint.
std::vector<uint32_t> assemble(const std::string& text);

}  // namespace pumice::cts
