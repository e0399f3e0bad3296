// The unmodified vkcube, in a window, on both drivers.
#include "cts_subset/harness/compare.h"
#include "cts_subset/tests/vkcube_window.h"
#include "cts_subset/tests/world.h"

#include <glm/gtc/matrix_transform.hpp>

#include <algorithm>
#include <iostream>

namespace pumice::cts {
namespace {

std::vector<std::string> driverEnvironment(const std::string& manifest) {
  std::vector<std::string> environment = {"VK_ICD_FILENAMES=" + manifest, "VK_DRIVER_FILES=" + manifest};
#ifdef PUMICE_SANITIZER_RUNTIME  // vkcube itself is not instrumented
  environment.push_back("LD_PRELOAD=" PUMICE_SANITIZER_RUNTIME);
  // Leaks of a driver that has been unloaded have no names to suppress.
  if (manifest == lavapipeManifest()) environment.push_back("ASAN_OPTIONS=detect_leaks=0");
#endif
  return environment;
}

// The cube turns by a fixed angle with every frame, so after a given number of frames the picture
// is always the same, but for one thing: vkcube does not wait until its last frame is on the
// screen, so that a swapchain may drop it (lavapipe's sometimes does). Then the window shows the
// frame before, which is as good a picture to compare, if it is compared with its like.
std::vector<std::string> vkcube(int frames, int presentMode) {
  return {"vkcube",
          "--c",
          std::to_string(frames),
          "--suppress_popups",
          "--present_mode",
          std::to_string(presentMode)};
}
constexpr int kImmediate = 0, kFifo = 2;

// vkcube's cube after so many frames: 4 degrees a frame about the y axis. Three corners a triangle, clip
// space.
std::vector<glm::vec4> cubeAt(int frame) {
  glm::mat4 projection = glm::perspective(glm::radians(45.0f), 1.0f, 0.1f, 100.0f);
  projection[1][1] = -projection[1][1];
  glm::mat4 view = glm::lookAt(glm::vec3(0, 3, 5), glm::vec3(0), glm::vec3(0, 1, 0));
  glm::mat4 matrix =
      projection * view * glm::rotate(glm::mat4(1), glm::radians(-4.0f * float(frame)), {0, 1, 0});
  std::vector<glm::vec4> out;
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) {
      auto corner = [&](float u, float v) {
        glm::vec3 p;
        p[axis] = side, p[(axis + 1) % 3] = u, p[(axis + 2) % 3] = v;
        return matrix * glm::vec4(p, 1);
      };
      glm::vec4 a = corner(-1, -1), b = corner(1, -1), c = corner(1, 1), d = corner(-1, 1);
      for (const glm::vec4& v : {a, b, c, a, c, d}) out.push_back(v);
    }
  return out;
}

// How many pixels contradict the outline of that frame's cube: background well inside it, or cube well
// outside.
size_t pixelsAgainst(const Picture& picture, int frame) {
  std::vector<glm::vec4> clip = cubeAt(frame);
  std::vector<glm::dvec2> corners;
  for (const glm::vec4& p : clip)
    corners.push_back({(p.x / p.w + 1) * 0.5 * picture.width, (p.y / p.w + 1) * 0.5 * picture.height});
  size_t count = 0;
  for (uint32_t y = 0; y < picture.height; ++y)
    for (uint32_t x = 0; x < picture.width; ++x) {
      // The signed distance to the nearest outline among the triangles that hold the pixel: positive inside.
      double inside = -1e9;
      for (size_t i = 0; i < corners.size(); i += 3) {
        glm::dvec2 p(x + 0.5, y + 0.5);
        double nearest = 1e9, turn = 0;
        for (int k = 0; k < 3; ++k) {
          glm::dvec2 a = corners[i + k], along = corners[i + (k + 1) % 3] - a;
          glm::dvec2 third = corners[i + (k + 2) % 3] - a;
          turn = along.x * third.y - along.y * third.x;
          double d = (along.x * (p.y - a.y) - along.y * (p.x - a.x)) / glm::length(along);
          nearest = std::min(nearest, turn > 0 ? d : -d);
        }
        inside = std::max(inside, nearest);
      }
      bool background = picture.pixel(x, y) == std::array<int, 4>{51, 51, 51, 255};
      if ((inside > 0.02 && background) || (inside < -0.02 && !background)) ++count;
    }
  return count;
}

// A few pixels of the cube may happen to have the colour of the background.
bool shows(const Picture& picture, int frame) { return pixelsAgainst(picture, frame) < 100; }

Expectation cubeExpectation(int frame) {
  Expectation e;
  e.onGrid = false;
  e.stepFunctions = true;  // nearest-filtered texels
  e.edges = edgesOfTriangles(cubeAt(frame), {0, 0, 500, 500});
  return e;
}

#define PUMICE_NEED_WINDOW(run)                                           \
  do {                                                                    \
    if ((run).missing) PUMICE_MISS_PEER((run).problem);                   \
    ASSERT_EQ((run).problem, "") << (run).output;                         \
  } while (false)

// The last frames follow one another in a millisecond: on a loaded machine whoever looks at the window may be too late for both of them.
WindowRun lastFramesOfPumice(int last, auto mode) {
  WindowRun run;
  for (int attempt = 0; attempt < 5; ++attempt) {
    run = runInWindow(vkcube(last, mode), driverEnvironment(pumiceManifest()));
    if (!run.problem.empty() || shows(run.picture, last) || shows(run.picture, last - 1)) break;
  }
  return run;
}

TEST(Vkcube, WindowEqualsLavapipes) {
  if (lavapipeManifest().empty()) PUMICE_MISS_PEER("lavapipe is not installed: nothing to compare with");
  for (int frames : {30, 101}) {
    SCOPED_TRACE(frames);
    // A run may end without its last picture having been seen, and some pictures of lavapipe's never are: what it
    // shows is what is compared.
    WindowRun peer, tested;
    int frame = 0;
    for (int attempt = 0; attempt < 9 && !frame; ++attempt) {
      const int last = frames + attempt % 3;
      peer = runInWindow(vkcube(last, kImmediate), driverEnvironment(lavapipeManifest()));
      PUMICE_NEED_WINDOW(peer);
      for (int shown : {last, last - 1, last - 2})
        if (!frame && shows(peer.picture, shown)) frame = shown;
    }
    ASSERT_TRUE(frame) << "lavapipe shows none of the last frames";
    for (int last : {frame, frame + 1, frame}) {
      tested = lastFramesOfPumice(last, kImmediate);
      PUMICE_NEED_WINDOW(tested);
      EXPECT_NE(tested.output.find(testedDeviceName()), std::string::npos) << tested.output;
      EXPECT_TRUE(shows(tested.picture, last) || shows(tested.picture, last - 1))
          << "this is neither frame " << last << " nor the one before";
      if (shows(tested.picture, frame)) break;
    }
    ASSERT_TRUE(shows(tested.picture, frame)) << "frame " << frame << " was never caught";
    Comparison result = compare(tested.picture, peer.picture, cubeExpectation(frame));
    std::string name = "vkcube_" + std::to_string(frames);
    std::cout << name << " (frame " << frame << "): " << result.summary() << "\n";
    std::string paths = leavePictures(name, tested.picture, peer.picture);
    EXPECT_TRUE(result.passed) << result.summary() << "\npictures: " << paths;
    // The same picture against the next frame: the comparison can fail.
    WindowRun other = runInWindow(vkcube(frame + 2, kImmediate), driverEnvironment(lavapipeManifest()));
    PUMICE_NEED_WINDOW(other);
    EXPECT_FALSE(compare(tested.picture, other.picture, cubeExpectation(frame)).passed);
    EXPECT_FALSE(shows(other.picture, frame));
  }
}

TEST(Vkcube, ThreeHundredFramesInFifo) {
  WindowRun run = lastFramesOfPumice(300, kFifo);
  PUMICE_NEED_WINDOW(run);
  EXPECT_NE(run.output.find(testedDeviceName()), std::string::npos) << run.output;
  EXPECT_TRUE(shows(run.picture, 300) || shows(run.picture, 299));
}

}  // namespace
}  // namespace pumice::cts
