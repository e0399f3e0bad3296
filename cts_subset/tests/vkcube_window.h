// vkcube's window, as it stands after its last frame.
#pragma once

#include "cts_subset/harness/picture.h"

#include <string>
#include <vector>

namespace pumice::cts {

struct WindowRun {
  Picture picture;       // empty when something failed
  std::string problem;   // why
  bool missing = false;  // Xvfb or the program is not installed
  std::string output;    // what the program printed
};

// Starts Xvfb, runs `program` in it until it ends by itself, and returns what its window showed
// last. The program finds its driver by `environment` (NAME=value).
WindowRun runInWindow(const std::vector<std::string>& program, const std::vector<std::string>& environment);

}  // namespace pumice::cts
