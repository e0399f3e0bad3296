// Runs translated shaders with the evaluator of lane IR, for tests.
#pragma once

#include <bit>
#include <string>
#include <vector>

#include "spirv_interp/frontend/shader.h"
#include "tests/ir/evaluate.h"

namespace pumice::frontend::test {

//! The first output location of a vertex shader, per lane and component. `inputs[lane]` are the components of
//! input location 0. Storage and uniform buffer 0 is `buffer`, if there is one.
struct RunResult {
  std::string error;
  std::vector<std::vector<uint32_t>> outputs;  //!< [lane][component]
  std::vector<bool> discarded;
};
RunResult run(const Shader& shader, const std::vector<std::vector<uint32_t>>& inputs,
              std::vector<uint32_t>* buffer = nullptr, const std::vector<uint32_t>& push = {});

}  // namespace pumice::frontend::test
