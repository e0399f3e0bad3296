#include "base/log.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

namespace pumice::base {
namespace {

class Log : public testing::Test {
 protected:
  void TearDown() override { setLogLevel(LogLevel::Error); }
};

TEST_F(Log, WritesOneLineWithPrefixAndLevel) {
  setLogLevel(LogLevel::Warn);
  testing::internal::CaptureStderr();
  logWarn("%d and %s", 7, "eight");
  logError("no");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "pumice: warn: 7 and eight\npumice: error: no\n");
}

TEST_F(Log, LevelsBelowTheWantedOneAreSilent) {
  setLogLevel(LogLevel::Error);
  testing::internal::CaptureStderr();
  logWarn("w");
  logInfo("i");
  logDebug("d");
  setLogLevel(LogLevel::Off);
  logError("e");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_FALSE(logEnabled(LogLevel::Error));
}

TEST_F(Log, TheEnvironmentSetsTheLevel) {
  ::setenv("PUMICE_LOG", "info", 1);
  detail::logLevel = -1;
  EXPECT_TRUE(logEnabled(LogLevel::Info));
  EXPECT_FALSE(logEnabled(LogLevel::Debug));
  ::unsetenv("PUMICE_LOG");
  detail::logLevel = -1;
  EXPECT_TRUE(logEnabled(LogLevel::Error));
  EXPECT_FALSE(logEnabled(LogLevel::Warn));
}

TEST_F(Log, AnUnknownLevelIsReportedAndTheDefaultHolds) {
  ::setenv("PUMICE_LOG", "loud", 1);
  detail::logLevel = -1;
  testing::internal::CaptureStderr();
  EXPECT_FALSE(logEnabled(LogLevel::Warn));
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "pumice: error: PUMICE_LOG=loud is not one of off, error, warn, info, debug\n");
  ::unsetenv("PUMICE_LOG");
}

TEST_F(Log, ASinkCollectsTheMessagesOfItsThreadOnly) {
  setLogLevel(LogLevel::Off);
  std::vector<std::string> outer, inner;
  {
    ScopedLogSink first([&](LogLevel, std::string_view text) { outer.emplace_back(text); });
    logError("one");
    {
      ScopedLogSink second([&](LogLevel level, std::string_view text) {
        EXPECT_EQ(level, LogLevel::Warn);
        inner.emplace_back(text);
        logError("from inside a sink");
      });
      logWarn("two");
    }
    std::thread([] { logError("elsewhere"); }).join();
    logInfo("not wanted");
  }
  logError("after");
  EXPECT_EQ(outer, (std::vector<std::string>{"one", "from inside a sink"}));
  EXPECT_EQ(inner, std::vector<std::string>{"two"});
}

TEST_F(Log, LongMessagesAreComplete) {
  std::string word(3000, 'y'), seen;
  ScopedLogSink sink([&](LogLevel, std::string_view text) { seen = text; });
  logError("<%s>", word.c_str());
  EXPECT_EQ(seen, "<" + word + ">");
}

}  // namespace
}  // namespace pumice::base
