// The unmodified vkcube, in a window, on both drivers.
#include "cts_subset/harness/compare.h"
#include "cts_subset/tests/vkcube_window.h"
#include "cts_subset/tests/world.h"

#include <iostream>

namespace pumice::cts {
namespace {

std::vector<std::string> driverEnvironment(const std::string& manifest) {
  std::vector<std::string> environment = {"VK_ICD_FILENAMES=" + manifest, "VK_DRIVER_FILES=" + manifest};
#ifdef PUMICE_SANITIZER_RUNTIME  // vkcube itself is not instrumented
  environment.push_back("LD_PRELOAD=" PUMICE_SANITIZER_RUNTIME);
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

// Silhouettes and texel borders are both step functions here: what differs must be the value of a
// neighbouring pixel, and 0.15 % (edges and texels together) is the most that may.
Expectation cubeExpectation() {
  Expectation e;
  e.stepFunctions = true;
  e.stepShare = 0.0015;
  return e;
}

#define PUMICE_NEED_WINDOW(run)                                           \
  do {                                                                    \
    if ((run).missing && !peersRequired()) GTEST_SKIP() << (run).problem; \
    ASSERT_EQ((run).problem, "") << (run).output;                         \
  } while (false)

TEST(Vkcube, WindowEqualsLavapipes) {
  if (lavapipeManifest().empty()) {
    if (peersRequired()) FAIL() << "lavapipe is not installed, and PUMICE_REQUIRE_PEERS is set";
    GTEST_SKIP() << "lavapipe is not installed: nothing to compare with";
  }
  for (int frames : {30, 101}) {
    SCOPED_TRACE(frames);
    WindowRun tested = runInWindow(vkcube(frames, kImmediate), driverEnvironment(pumiceManifest()));
    PUMICE_NEED_WINDOW(tested);
    EXPECT_NE(tested.output.find(testedDeviceName()), std::string::npos) << tested.output;
    std::string name = "vkcube_" + std::to_string(frames);
    Comparison result;
    Picture compared;
    for (int shown : {frames, frames, frames - 1}) {
      WindowRun peer = runInWindow(vkcube(shown, kImmediate), driverEnvironment(lavapipeManifest()));
      PUMICE_NEED_WINDOW(peer);
      Comparison now = compare(tested.picture, peer.picture, cubeExpectation());
      if (compared.rgba.empty() || now.wrong < result.wrong) result = now, compared = peer.picture;
      if (result.passed) break;
    }
    std::cout << name << ": " << result.summary() << "\n";
    std::string paths = leavePictures(name, tested.picture, compared);
    EXPECT_TRUE(result.passed) << result.summary() << "\npictures: " << paths;
  }
}

TEST(Vkcube, AnotherFrameIsNoticed) {
  WindowRun one = runInWindow(vkcube(30, kImmediate), driverEnvironment(pumiceManifest()));
  PUMICE_NEED_WINDOW(one);
  WindowRun other = runInWindow(vkcube(33, kImmediate), driverEnvironment(pumiceManifest()));
  PUMICE_NEED_WINDOW(other);
  EXPECT_FALSE(compare(one.picture, other.picture, cubeExpectation()).passed);
  bool repeated = false;
  for (int attempt = 0; attempt < 4 && !repeated; ++attempt) {
    WindowRun again = runInWindow(vkcube(30, kImmediate), driverEnvironment(pumiceManifest()));
    PUMICE_NEED_WINDOW(again);
    repeated = one.picture.rgba == again.picture.rgba;
  }
  EXPECT_TRUE(repeated) << "no two runs of 30 frames end with the same bits";
}

TEST(Vkcube, ThreeHundredFramesInFifo) {
  WindowRun run = runInWindow(vkcube(300, kFifo), driverEnvironment(pumiceManifest()));
  PUMICE_NEED_WINDOW(run);
  EXPECT_NE(run.output.find(testedDeviceName()), std::string::npos) << run.output;
}

}  // namespace
}  // namespace pumice::cts
