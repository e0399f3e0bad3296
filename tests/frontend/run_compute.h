// Runs compute shaders with the interpreter, for tests.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "spirv_interp/frontend/shader.h"

namespace pumice::frontend::test {

using Buffers = std::vector<std::vector<uint32_t>>;

//! Translates entry point "main" of a module; fails the test and gives null if that cannot be done.
std::shared_ptr<const Shader> translatedCompute(std::span<const uint32_t> words);

//! Runs `groups` work groups, one after the other, of a one-dimensional size of up to 128. Buffer `binding + element` is
//! what a descriptor stands for. Gives an error or nothing.
std::string runCompute(const Shader& shader, uint32_t groups, Buffers& buffers);

//! The same from GLSL or from assembly; failures are those of the test.
void runGlsl(const std::string& glsl, uint32_t groups, Buffers& buffers, bool optimise = false);
void runAssembly(const std::string& text, uint32_t groups, Buffers& buffers, const char* version = "1.3");

}  // namespace pumice::frontend::test
