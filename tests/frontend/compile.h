// GLSL to SPIR-V for tests.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace pumice::frontend::test {

enum class GlslStage { Vertex, Fragment, Compute };

//! SPIR-V of a GLSL shader (Vulkan 1.3 semantics, SPIR-V 1.6 or the version given). Empty, with the compiler's
//! text in `log`, on errors.
std::vector<uint32_t> compileGlsl(GlslStage stage, const std::string& source, std::string* log = nullptr,
                                  bool oldSpirv = false);

//! The module after spirv-opt -O: values travel through OpPhi and OpSelect instead of variables.
std::vector<uint32_t> optimised(const std::vector<uint32_t>& words);

//! SPIR-V of an assembly text (version 1.3 unless given otherwise, e.g. "1.6"). Empty, with the reason in `log`, on errors.
std::vector<uint32_t> assemble(const std::string& text, std::string* log = nullptr, const char* version = "1.3");

}  // namespace pumice::frontend::test
