// How far Pumice's picture of a scene is from the one computed in double (PUMICE_NUMERICS=reference), and how many of its pixels
// decided otherwise there (PUMICE_DECISIONS): the errors of colours are those of the other pixels.
#pragma once

#include "cts_subset/harness/scene.h"

namespace pumice::cts {

// The words of every pass of a run, as PUMICE_DECISIONS=write:FILE leaves them.
struct DecisionPass {
  uint32_t width = 0, height = 0, layers = 0, samples = 0;
  std::vector<uint32_t> words;  // [layer][sample][y][x]
};
std::vector<DecisionPass> readDecisions(const std::string& path);

struct OracleError {
  uint64_t pixels = 0;
  uint64_t unequal = 0;     // bit for bit
  uint64_t beyond = 0;      // more than `units` of 1/255 away
  bool comparable = false;  // both runs had the same passes
  uint64_t mismatches = 0;  // pixels that decided otherwise, in passes of the picture's size
  uint64_t elsewhere = 0;   // the same in other passes
  // Of the pixels that decided alike:
  uint64_t colourBeyond = 0;
  int largest = 0;          // in 1/255
  double mean = 0;          // in 1/255, over all components
  double depth = 0;         // largest error of Picture::depth
};

OracleError oracleError(const Picture& picture, const Picture& oracle, const std::vector<DecisionPass>& passes,
                        const std::vector<DecisionPass>& oraclePasses, int units);

struct OracleRun {
  Picture picture;
  std::vector<DecisionPass> passes;
  double seconds = 0;
};
// The good variant with records of what was decided. Numerics are a pipeline's property, read when it is created.
OracleRun renderRecorded(Device& device, const Scene& scene, bool inDouble);

}  // namespace pumice::cts
