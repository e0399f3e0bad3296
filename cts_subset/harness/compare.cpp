#include "cts_subset/harness/compare.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

namespace pumice::cts {
namespace {

int channelDistance(const uint8_t* a, const uint8_t* b) {
  int largest = 0;
  for (int c = 0; c < 4; ++c) largest = std::max(largest, std::abs(int(a[c]) - int(b[c])));
  return largest;
}

double distanceToSegment(glm::dvec2 p, glm::dvec2 a, glm::dvec2 b) {
  glm::dvec2 along = b - a;
  double squared = glm::dot(along, along);
  double t = squared > 0 ? std::clamp(glm::dot(p - a, along) / squared, 0.0, 1.0) : 0.0;
  return glm::length(p - (a + t * along));
}

bool isNearEdge(uint32_t x, uint32_t y, const std::vector<Edge>& edges) {
  glm::dvec2 centre(x + 0.5, y + 0.5);
  return std::any_of(edges.begin(), edges.end(), [&](const Edge& edge) {
    return distanceToSegment(centre, edge.a, edge.b) <= edge.tolerance;
  });
}

// Does `picture` have `value` somewhere in the 3x3 pixels around (x, y)?
bool hasNeighbour(const Picture& picture, uint32_t x, uint32_t y, const uint8_t* value, int tolerance) {
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      int64_t u = int64_t(x) + dx, v = int64_t(y) + dy;
      if (u < 0 || v < 0 || u >= picture.width || v >= picture.height) continue;
      if (channelDistance(picture.at(uint32_t(u), uint32_t(v)), value) <= tolerance) return true;
    }
  return false;
}

std::string text(const std::array<int, 4>& p) {
  std::ostringstream out;
  out << "(" << p[0] << " " << p[1] << " " << p[2] << " " << p[3] << ")";
  return out.str();
}

}  // namespace

std::string Comparison::summary() const {
  std::ostringstream out;
  out << pixels << " pixels: " << equal << " equal, " << withinColour << " within tolerance, " << nearEdge
      << " at edges, " << stepBorder << " at texel borders, " << wrong << " wrong";
  if (largestDepthError > 0 || wrongDepth > 0)
    out << "; depth: largest error " << largestDepthError << ", " << wrongDepth << " wrong";
  if (first) {
    out << "; first difference at x=" << first->x << " y=" << first->y << ": tested " << text(first->tested)
        << ", peer " << text(first->peer);
    if (wrongDepth > 0) out << ", depths " << first->testedDepth << " and " << first->peerDepth;
  }
  return out.str();
}

Comparison compare(const Picture& tested, const Picture& peer, const Expectation& expectation) {
  if (tested.width != peer.width || tested.height != peer.height || tested.depth.size() != peer.depth.size())
    throw std::runtime_error("compare: the pictures differ in shape");
  Comparison result;
  result.pixels = uint64_t(tested.width) * tested.height;
  int firstRank = 0;
  auto note = [&](int rank, uint32_t x, uint32_t y) {
    if (rank <= firstRank) return;
    firstRank = rank;
    result.first = {x, y, tested.pixel(x, y), peer.pixel(x, y)};
    if (!tested.depth.empty()) {
      result.first->testedDepth = tested.depth[size_t(y) * tested.width + x];
      result.first->peerDepth = peer.depth[size_t(y) * tested.width + x];
    }
  };
  for (uint32_t y = 0; y < tested.height; ++y)
    for (uint32_t x = 0; x < tested.width; ++x) {
      const uint8_t* a = tested.at(x, y);
      const uint8_t* b = peer.at(x, y);
      int distance = channelDistance(a, b);
      bool excused = false;
      if (distance == 0) {
        ++result.equal;
      } else if (distance <= expectation.colourTolerance) {
        ++result.withinColour;
        note(1, x, y);
      } else if (!expectation.onGrid && isNearEdge(x, y, expectation.edges)) {
        ++result.nearEdge;
        excused = true;
        note(2, x, y);
      } else if (expectation.stepFunctions && hasNeighbour(peer, x, y, a, expectation.colourTolerance) &&
                 hasNeighbour(tested, x, y, b, expectation.colourTolerance)) {
        ++result.stepBorder;
        note(2, x, y);
      } else if (expectation.either && expectation.either(a, b)) {
        ++result.stepBorder;
        note(2, x, y);
      } else {
        ++result.wrong;
        note(3, x, y);
      }
      if (tested.depth.empty() || excused) continue;
      size_t i = size_t(y) * tested.width + x;
      double error = std::abs(double(tested.depth[i]) - double(peer.depth[i]));
      if (error > expectation.depthTolerance && !expectation.onGrid && isNearEdge(x, y, expectation.edges))
        continue;
      result.largestDepthError = std::max(result.largestDepthError, error);
      if (!(error <= expectation.depthTolerance)) {
        ++result.wrongDepth;
        note(3, x, y);
      }
    }
  double share = 1.0 / double(result.pixels);
  result.passed = result.wrong == 0 && result.wrongDepth == 0 &&
                  double(result.nearEdge) * share <= expectation.edgeShare &&
                  double(result.stepBorder) * share <= expectation.stepShare;
  return result;
}

Picture difference(const Picture& tested, const Picture& peer) {
  constexpr int kAmplify = 32, kFloor = 64;
  Picture out(tested.width, tested.height);
  for (size_t i = 0; i < out.rgba.size(); ++i) {
    int d = std::abs(int(tested.rgba[i]) - int(peer.rgba[i]));
    out.rgba[i] = d == 0 ? 0 : uint8_t(std::min(255, kFloor + d * kAmplify));
  }
  // A difference in alpha alone must not be invisible.
  for (size_t i = 0; i < out.rgba.size(); i += 4)
    for (int c = 0; c < 3; ++c) out.rgba[i + c] = std::max(out.rgba[i + c], out.rgba[i + 3]);
  return out;
}

std::string outputDirectory() {
  const char* chosen = std::getenv("PUMICE_TEST_OUTPUT");
  std::string directory = chosen && *chosen ? chosen : PUMICE_TEST_OUTPUT_DIR;
  std::filesystem::create_directories(directory);
  return directory;
}

std::string leavePictures(const std::string& name, const Picture& tested, const Picture& peer) {
  std::string stem = outputDirectory() + "/" + name;
  writePng(stem + ".tested.png", tested);
  writePng(stem + ".peer.png", peer);
  writePng(stem + ".difference.png", difference(tested, peer));
  return stem + ".{tested,peer,difference}.png";
}

std::vector<Edge> edgesOfTriangles(const std::vector<glm::vec4>& clip, const Viewport& viewport) {
  // Half spaces dot(plane, p) >= 0. w is kept well above zero so that the division is harmless;
  // what lies beyond is far outside every viewport.
  const glm::dvec4 kPlanes[] = {{0, 0, 1, 0}, {0, 0, -1, 1}, {0, 0, 0, 1}};
  std::vector<Edge> edges;
  for (size_t i = 0; i + 2 < clip.size(); i += 3) {
    std::vector<glm::dvec4> polygon(clip.begin() + i, clip.begin() + i + 3);
    for (const glm::dvec4& plane : kPlanes) {
      double offset = plane.w == 1 && plane.z == 0 ? 1e-6 : 0.0;
      std::vector<glm::dvec4> kept;
      for (size_t j = 0; j < polygon.size(); ++j) {
        const glm::dvec4& p = polygon[j];
        const glm::dvec4& q = polygon[(j + 1) % polygon.size()];
        double dp = glm::dot(plane, p) - offset, dq = glm::dot(plane, q) - offset;
        if (dp >= 0) kept.push_back(p);
        if ((dp >= 0) != (dq >= 0)) kept.push_back(p + (q - p) * (dp / (dp - dq)));
      }
      polygon = std::move(kept);
    }
    auto project = [&](const glm::dvec4& p) {
      return glm::dvec2(viewport.x + (p.x / p.w + 1) * 0.5 * viewport.width,
                        viewport.y + (p.y / p.w + 1) * 0.5 * viewport.height);
    };
    for (size_t j = 0; j < polygon.size(); ++j)
      edges.push_back({project(polygon[j]), project(polygon[(j + 1) % polygon.size()])});
  }
  return edges;
}

}  // namespace pumice::cts
