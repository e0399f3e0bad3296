// The same bits, whatever the number of threads and the instruction set, and with each idea that saves work on or off.
//
// These are settled when the driver is loaded, so each setting draws the gallery in a process of its own.
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>

#include "cts_subset/harness/compare.h"
#include "cts_subset/harness/vulkan_context.h"

#include <gtest/gtest.h>

namespace pumice::cts {
namespace {

// File name to contents.
std::map<std::string, std::string> galleryWith(const std::string& setting) {
  std::string directory = outputDirectory() + "/invariance/" + (setting.empty() ? "default" : setting);
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  std::string command = "env " + setting + " '" PUMICE_GALLERY_PROGRAM "' --out '" + directory + "' > '" +
                        directory + "/log' 2>&1";
  int status = std::system(command.c_str());
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    std::ifstream file(entry.path(), std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    if (entry.path().extension() == ".png") files[entry.path().filename()] = bytes;
    if (entry.path().filename() == "log" && status != 0) ADD_FAILURE() << setting << ": " << bytes;
  }
  return files;
}

// The pictures have the bits they had when somebody last looked at them. Where one is meant to change, look at it, then copy
// its line from the hashes.txt that pumice_gallery writes. A scene without a line is not held.
TEST(Invariance, GalleryHasItsGoldenBits) {
  if (testedDeviceName() != "Pumice") GTEST_SKIP() << "only promised for Pumice";
  galleryWith("");
  std::ifstream goldenFile(PUMICE_GOLDEN_HASHES), file(outputDirectory() + "/invariance/default/hashes.txt");
  ASSERT_TRUE(goldenFile && file);
  std::map<std::string, std::string> golden;
  std::string name, hash;
  while (goldenFile >> name >> hash) golden[name] = hash;
  size_t held = 0;
  while (file >> name >> hash) {
    auto expected = golden.find(name);
    if (expected == golden.end()) {
      std::cout << "no golden hash: " << name << " " << hash << "\n";
      continue;
    }
    EXPECT_EQ(hash, expected->second) << name << ": see " << outputDirectory() << "/invariance/default/" << name << ".png";
    ++held;
  }
  EXPECT_EQ(held, golden.size()) << "scenes in the list are gone";
}

TEST(Invariance, GalleryHasTheSameBitsWithEveryThreadCountInstructionSetAndIdea) {
  if (testedDeviceName() != "Pumice") GTEST_SKIP() << "only promised for Pumice";
  auto usual = galleryWith("");
  ASSERT_GT(usual.size(), 20u);
  // An instruction set that this processor lacks is replaced by the best one, with a message: no harm.
  for (const char* setting :
       {"PUMICE_THREADS=1", "PUMICE_THREADS=7", "PUMICE_ENGINE=interp", "PUMICE_ENGINE=jit", "PUMICE_ISA=scalar",
        "PUMICE_ISA=sse4", "PUMICE_ISA=avx2", "PUMICE_DISABLE=visible-first", "PUMICE_DISABLE=hi-z", "PUMICE_DISABLE=one-record",
        "PUMICE_DISABLE=whole-blocks,lazy-clear", "PUMICE_DISABLE=one-color", "PUMICE_DISABLE=squares", "PUMICE_DISABLE=in-unit", "PUMICE_DISABLE=preamble,interleaving,runs-itself",
        "PUMICE_DISABLE=specialised-sampling", "PUMICE_DISABLE=visible-first,hi-z,one-record,whole-blocks,lazy-clear,one-color,squares"}) {
    auto other = galleryWith(setting);
    ASSERT_EQ(other.size(), usual.size()) << setting;
    for (const auto& [name, bytes] : usual)
      EXPECT_TRUE(other[name] == bytes) << name << " differs with " << setting;
  }
}

}  // namespace
}  // namespace pumice::cts
