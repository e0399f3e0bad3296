// Translated shaders as bytes, for caches that outlive the process. What is read may come from anywhere: it is checked
// until nothing behind it can be led astray, or refused.
#pragma once

#include "spirv_interp/frontend/shader.h"

namespace pumice::frontend {

//! Changes with the layout of the bytes; IR and build are the caller's to tell apart.
constexpr uint32_t kShaderBytesVersion = 2;

//! Whether everything that the shader names is there: interface variables, resources, operations. The IR is not looked at by its verifier.
//! What the translator makes of a module that was not validated need not be.
bool namesOnlyWhatIsThere(const Shader& shader);

std::vector<std::byte> toBytes(const Shader& shader);
//! Null when the bytes are not those of a shader that translate() could have made: what is cut off, what the IR's verifier
//! refuses, and what names interface variables, resources or operations that are not there.
std::shared_ptr<const Shader> fromBytes(std::span<const std::byte> bytes);

}  // namespace pumice::frontend
