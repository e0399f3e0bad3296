// Every scene of the gallery, drawn by the driver under test and by lavapipe.
#include "cts_subset/harness/canvas.h"
#include "cts_subset/harness/oracle.h"
#include "cts_subset/tests/world.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>

namespace pumice::cts {
namespace {

const Picture& peerPicture(const Scene& scene) {
  static std::map<std::string, Picture> drawn;
  auto found = drawn.find(scene.name);
  if (found == drawn.end())
    found = drawn.emplace(scene.name, scene.render(*world().peer, Variant::kGood)).first;
  return found->second;
}

class Gallery : public testing::TestWithParam<size_t> {
 protected:
  const Scene& scene() const { return allScenes()[GetParam()]; }
};

// True whatever the peers do.
TEST_P(Gallery, PictureIsRightInItself) {
  PUMICE_NEED_TESTED();
  if (!scene().supported(*world().tested))
    GTEST_SKIP() << scene().name << ": not reported as supported by the device";
  Picture picture = scene().render(*world().tested, Variant::kGood);
  std::string wrong = scene().verify(picture);
  if (!wrong.empty()) {
    std::string path = outputDirectory() + "/" + scene().name + ".wrong.png";
    writePng(path, picture);
    FAIL() << wrong << "\nthe picture: " << path;
  }
  Picture again = scene().render(*world().tested, Variant::kGood);
  EXPECT_TRUE(picture.rgba == again.rgba && picture.depth == again.depth)
      << "two runs of the scene give different bits";
}

TEST_P(Gallery, AgreesWithLavapipe) {
  PUMICE_NEED_TESTED();
  PUMICE_NEED_PEER();
  if (!scene().supported(*world().tested) || !scene().supported(*world().peer))
    GTEST_SKIP() << scene().name << ": not reported as supported by both devices";
  Picture tested = scene().render(*world().tested, Variant::kGood);
  const Picture& peer = peerPicture(scene());
  Comparison result = compare(tested, peer, scene().expectation());
  std::cout << scene().name << ": " << result.summary() << "\n";
  EXPECT_TRUE(result.passed) << result.summary()
                             << "\npictures: " << leavePictures(scene().name, tested, peer);
}

// The proof that the comparison can fail.
TEST_P(Gallery, BrokenVariantIsCaught) {
  PUMICE_NEED_TESTED();
  if (!scene().supported(*world().tested)) GTEST_SKIP() << scene().name << ": not reported as supported by the device";
  // What the peer cannot draw, the truth about the picture alone must catch.
  if (world().peer && !scene().supported(*world().peer)) {
    Picture broken = scene().render(*world().tested, Variant::kBroken);
    EXPECT_FALSE(scene().verify(broken).empty()) << "'" << scene().broken << "' was not noticed";
    return;
  }
  PUMICE_NEED_PEER();
  Picture broken = scene().render(*world().tested, Variant::kBroken);
  const Picture& peer = peerPicture(scene());
  Comparison result = compare(broken, peer, scene().expectation());
  EXPECT_FALSE(result.passed) << "'" << scene().broken << "' was not noticed: " << result.summary()
                              << "\npictures: " << leavePictures(scene().name + ".broken", broken, peer);
}

TEST_P(Gallery, AgreesWithOracle) {
  PUMICE_NEED_TESTED();
  if (testedDeviceName() != "Pumice") GTEST_SKIP() << "only Pumice has an oracle";
  if (!scene().supported(*world().tested)) GTEST_SKIP() << scene().name << ": not reported as supported by the device";
  const OracleBound& bound = scene().oracle;
  EXPECT_TRUE(bound.cause || (bound.units <= 1 && bound.share <= 0.001)) << "a looser bound needs its cause";
  const OracleRun oracle = renderRecorded(*world().tested, scene(), true);
  const OracleRun recorded = renderRecorded(*world().tested, scene(), false);
  const Picture usual = scene().render(*world().tested, Variant::kGood);
  EXPECT_TRUE(usual.rgba == recorded.picture.rgba && usual.depth == recorded.picture.depth) << "recording decisions changes bits";
  const OracleError d = oracleError(usual, oracle.picture, recorded.passes, oracle.passes, bound.units);
  EXPECT_TRUE(d.comparable) << "the runs have other passes";
  std::cout << scene().name << ": of " << d.pixels << " pixels " << d.unequal << " unequal, " << d.mismatches << " decided otherwise ("
            << d.elsewhere << " in other passes), " << d.beyond << " beyond " << bound.units << "; where decided alike: " << d.colourBeyond
            << " beyond, largest " << d.largest << ", mean " << d.mean << ", depth " << d.depth << "\n";
  EXPECT_LE(double(d.beyond), bound.share * double(d.pixels)) << "pictures: " << leavePictures(scene().name + ".oracle", usual, oracle.picture);
  // What is further away was decided otherwise; a colour that was not is as near as its format can say.
  EXPECT_EQ(d.colourBeyond, 0u) << "pictures: " << leavePictures(scene().name + ".oracle", usual, oracle.picture);
  EXPECT_LE(d.depth, 1.0 / 65535);
  // The bound can fail.
  Picture broken = scene().render(*world().tested, Variant::kBroken);
  if (broken.width != usual.width || broken.height != usual.height) return;
  const OracleError wrong = oracleError(broken, oracle.picture, {}, {}, bound.units);
  EXPECT_TRUE(double(wrong.beyond) > bound.share * double(d.pixels) || wrong.depth > 1.0 / 65535)
      << "'" << scene().broken << "' is within the bound: " << wrong.beyond << " pixels beyond " << bound.units;
}

//! The scene, with a pipeline cache that begins with `blob`. What the cache holds afterwards takes its place.
Picture renderCached(Device& device, const Scene& scene, std::vector<std::byte>& blob) {
  VkPipelineCacheCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO;
  info.initialDataSize = blob.size();
  info.pInitialData = blob.data();
  check(vkCreatePipelineCache(device.handle, &info, nullptr, &device.pipelineCache), "vkCreatePipelineCache");
  Picture picture = scene.render(device, Variant::kGood);
  size_t size = 0;
  check(vkGetPipelineCacheData(device.handle, device.pipelineCache, &size, nullptr), "vkGetPipelineCacheData");
  blob.resize(size);
  check(vkGetPipelineCacheData(device.handle, device.pipelineCache, &size, blob.data()), "vkGetPipelineCacheData");
  vkDestroyPipelineCache(device.handle, device.pipelineCache, nullptr);
  device.pipelineCache = VK_NULL_HANDLE;
  return picture;
}

// A run that begins with the pipeline cache of an earlier one translates no shader and links no routine, and draws the same.
TEST_P(Gallery, ASecondRunOnlyEmits) {
  PUMICE_NEED_TESTED();
  if (testedDeviceName() != "Pumice") GTEST_SKIP() << "only Pumice counts what it does";
  if (!scene().supported(*world().tested)) GTEST_SKIP() << scene().name << ": not reported as supported by the device";
  const Picture usual = scene().render(*world().tested, Variant::kGood);
  std::vector<std::byte> blob;
  const Picture first = renderCached(*world().tested, scene(), blob), second = renderCached(*world().tested, scene(), blob);
  EXPECT_TRUE(first.rgba == usual.rgba && first.depth == usual.depth) << "a cache changes bits";
  EXPECT_TRUE(second.rgba == usual.rgba && second.depth == usual.depth) << "what is found in a cache changes bits";

  // What is printed of a run, of its last pass at the latest.
  setenv("PUMICE_STATS", "1", 1);
  auto counted = std::make_unique<Device>(world().tested->physical);
  const auto run = [&] {
    testing::internal::CaptureStderr();
    renderCached(*counted, scene(), blob);
    Canvas(*counted, 1, 1).draw({0, 0, 0, 1}, [](VkCommandBuffer) {});
    uint64_t sums[3] = {};
    const std::string printed = testing::internal::GetCapturedStderr();
    for (size_t at = 0; (at = printed.find("pumice: stats: ", at)) != std::string::npos; ++at) {
      unsigned long long n[3];
      if (std::sscanf(printed.c_str() + at, "pumice: stats: %llu shaders translated, %llu routines linked and optimised, %llu taken", n, n + 1, n + 2) != 3) continue;
      for (int i = 0; i < 3; ++i) sums[i] += n[i];
    }
    return std::array<uint64_t, 3>{sums[0], sums[1], sums[2]};
  };
  const bool clearsOnly = blob.size() <= sizeof(VkPipelineCacheHeaderVersionOne);
  blob.clear();
  const auto cold = run(), warm = run();
  unsetenv("PUMICE_STATS");
  if (clearsOnly) return;
  EXPECT_GT(cold[0], 0u) << "shaders translated by the first run";
  EXPECT_GT(cold[1], 0u) << "routines linked by the first run";
  EXPECT_EQ(warm[0], 0u) << "shaders translated by the second run";
  EXPECT_EQ(warm[1], 0u) << "routines linked by the second run";
  EXPECT_GT(warm[2], 0u) << "routines taken from the cache";
}

std::vector<size_t> sceneNumbers() {
  std::vector<size_t> numbers(allScenes().size());
  for (size_t i = 0; i < numbers.size(); ++i) numbers[i] = i;
  return numbers;
}

INSTANTIATE_TEST_SUITE_P(Scenes, Gallery, testing::ValuesIn(sceneNumbers()),
                         [](const testing::TestParamInfo<size_t>& info) {
                           return allScenes()[info.param].name;
                         });

}  // namespace
}  // namespace pumice::cts
