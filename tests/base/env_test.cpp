#include "base/env.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "base/log.h"

namespace pumice::base {
namespace {

std::string readFile(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Env, UnsetAndEmptyAreTheSame) {
  ::unsetenv("PUMICE_THREADS");
  EXPECT_FALSE(envString(EnvVar::Threads));
  ::setenv("PUMICE_THREADS", "", 1);
  EXPECT_FALSE(envString(EnvVar::Threads));
  ::setenv("PUMICE_THREADS", "3", 1);
  EXPECT_EQ(envString(EnvVar::Threads), "3");
  ::unsetenv("PUMICE_THREADS");
}

TEST(Env, NumbersOutOfRangeOrWithTrailingTextAreRefused) {
  std::string said;
  ScopedLogSink sink([&](LogLevel, std::string_view text) { said = text; });
  ::setenv("PUMICE_THREADS", "12", 1);
  EXPECT_EQ(envInteger(EnvVar::Threads, 1, 12), 12);
  EXPECT_EQ(said, "");
  for (const char* text : {"13", "0", "-1", "4x", "x", " 4", "99999999999999999999"}) {
    said.clear();
    ::setenv("PUMICE_THREADS", text, 1);
    EXPECT_FALSE(envInteger(EnvVar::Threads, 1, 12)) << text;
    EXPECT_EQ(said, "PUMICE_THREADS=" + std::string(text) + " is not a number from 1 to 12");
  }
  ::unsetenv("PUMICE_THREADS");
}

TEST(Env, AWrongValueIsNamedOnceHoweverOftenItIsRead) {
  int said = 0;
  ScopedLogSink sink([&](LogLevel, std::string_view) { said++; });
  ::setenv("PUMICE_THREADS", "seven", 1);
  for (int i = 0; i < 3; i++) EXPECT_FALSE(envInteger(EnvVar::Threads, 1, 12));
  EXPECT_EQ(said, 1);
  ::setenv("PUMICE_THREADS", "eight", 1);
  EXPECT_FALSE(envInteger(EnvVar::Threads, 1, 12));
  EXPECT_EQ(said, 2);
  ::unsetenv("PUMICE_THREADS");
}

TEST(Env, FlagsTakeTheUsualWords) {
  std::string said;
  ScopedLogSink sink([&](LogLevel, std::string_view text) { said = text; });
  ::setenv("PUMICE_THREADS", "yes", 1);
  EXPECT_TRUE(envFlag(EnvVar::Threads, false));
  ::setenv("PUMICE_THREADS", "off", 1);
  EXPECT_FALSE(envFlag(EnvVar::Threads, true));
  EXPECT_EQ(said, "");
  ::setenv("PUMICE_THREADS", "maybe", 1);
  EXPECT_TRUE(envFlag(EnvVar::Threads, true));
  EXPECT_EQ(said, "PUMICE_THREADS=maybe is neither on nor off");
  ::unsetenv("PUMICE_THREADS");
}

// The table in README.md is made of exactly these rows.
TEST(Env, TheReadmeListsEveryVariable) {
  std::string readme = readFile(PUMICE_SOURCE_DIR "/README.md");
  ASSERT_FALSE(readme.empty());
  std::set<std::string> known;
  for (const EnvInfo& info : envTable()) {
    known.insert(info.name);
    std::string row = std::string("| `") + info.name + "` | " + info.values + " | " + info.fallback + " | " +
                      info.description + " |";
    EXPECT_NE(readme.find(row + "\n"), std::string::npos) << "README.md has no row\n" << row;
  }
  std::regex row("\\n\\| `(PUMICE_[A-Z0-9_]+)` \\|");
  for (std::sregex_iterator it(readme.begin(), readme.end(), row), end; it != end; ++it)
    EXPECT_TRUE(known.count((*it)[1])) << "README.md describes " << (*it)[1] << ", which nothing reads";
}

// A variable read past the table would be missing in the README.
TEST(Env, TheDriverReadsVariablesThroughTheTableOnly) {
  namespace fs = std::filesystem;
  std::regex getenvCall("(^|[^a-zA-Z_])(secure_)?getenv *\\(");
  size_t files = 0;
  for (const char* room : {"base", "texture", "spirv_interp", "raster", "pipeline", "icd"}) {
    fs::path folder = fs::path(PUMICE_SOURCE_DIR) / room;
    if (!fs::exists(folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      fs::path path = entry.path();
      if (path.extension() != ".cpp" && path.extension() != ".h") continue;
      files++;
      if (path == fs::path(PUMICE_SOURCE_DIR) / "base/env.cpp") continue;
      std::istringstream text(readFile(path));
      for (std::string line; std::getline(text, line);) {
        std::string code = line.substr(0, line.find("//"));
        EXPECT_FALSE(std::regex_search(code, getenvCall)) << path << ": " << line;
      }
    }
  }
  EXPECT_GT(files, 10u);
}

}  // namespace
}  // namespace pumice::base
