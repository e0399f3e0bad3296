// What the preamble saves, measured by doing without: its values computed again for every row.
#pragma once

#include "spirv_interp/interpreter/executor.h"

namespace pumice::pipeline {

//! The same results; preamble() gives an empty bank, and each run computes one of its own.
std::unique_ptr<interp::Executable> preambleEachRow(std::unique_ptr<interp::Executable> routine);

}  // namespace pumice::pipeline
