// The rules by which a picture of the driver under test is held against the peer's.
//
//  - Vertices exactly on the 1/256 pixel grid: coverage is equal pixel by pixel.
//  - Elsewhere: a pixel may differ only within 1/128 px of an edge, at most 0.05 % of the picture.
//  - Colours agree within 1/255.
//  - Borders of nearest-filtered texels (or of another step function in the shader) are counted
//    apart, at most 0.1 %: such a pixel must carry a value that the other picture has next to it.
#pragma once

#include "cts_subset/harness/picture.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace pumice::cts {

struct Edge {
  glm::dvec2 a, b;  // pixels
  double tolerance = 1.0 / 128;
};

struct Expectation {
  bool onGrid = true;       // every vertex lies exactly on the 1/256 grid
  std::vector<Edge> edges;  // what decides coverage, where onGrid is false
  bool stepFunctions = false;
  // Two values of which either is right at some pixels, counted with the borders of texels.
  std::function<bool(const uint8_t* tested, const uint8_t* peer)> either;
  int colourTolerance = 1;    // in 1/255
  double depthTolerance = 0;  // for Picture::depth
  double edgeShare = 0.0005;  // of all pixels
  double stepShare = 0.001;
};

struct Comparison {
  uint64_t pixels = 0;
  uint64_t equal = 0;         // bit for bit
  uint64_t withinColour = 0;  // not equal, but within the colour tolerance
  uint64_t nearEdge = 0;
  uint64_t stepBorder = 0;
  uint64_t wrong = 0;  // explained by nothing
  uint64_t wrongDepth = 0;
  double largestDepthError = 0;
  bool passed = false;

  struct FirstDifference {
    uint32_t x, y;
    std::array<int, 4> tested, peer;
    float testedDepth = 0, peerDepth = 0;
  };
  std::optional<FirstDifference> first;  // prefers a wrong pixel to a tolerated one

  std::string summary() const;
};

Comparison compare(const Picture& tested, const Picture& peer, const Expectation& expectation);

// |tested - peer|, amplified so that one unit is visible.
Picture difference(const Picture& tested, const Picture& peer);

// $PUMICE_TEST_OUTPUT or the build directory's test_output; created when missing.
std::string outputDirectory();

// Leaves `<name>.tested.png`, `<name>.peer.png` and `<name>.difference.png`; says where.
std::string leavePictures(const std::string& name, const Picture& tested, const Picture& peer);

struct Viewport {
  double x = 0, y = 0, width = 0, height = 0;
};

// The screen-space outline of triangles given in clip space (three vertices each), after clipping
// in double precision against w > 0 and 0 <= z <= w.
std::vector<Edge> edgesOfTriangles(const std::vector<glm::vec4>& clipPositions, const Viewport& viewport);

}  // namespace pumice::cts
