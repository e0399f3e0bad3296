#include "base/log.h"

#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <string>

#include "base/env.h"

namespace pumice::base {

namespace {

constexpr const char* kLevelNames[] = {"off", "error", "warn", "info", "debug"};
constexpr int kDefaultLevel = int(LogLevel::Error);

thread_local constinit ScopedLogSink* innermostSink = nullptr;

}  // namespace

namespace detail {

constinit std::atomic<int> logLevel{-1};

int readLogLevel() {
  int level = kDefaultLevel;
  auto text = envString(EnvVar::Log);
  bool known = !text;
  if (text) {
    for (int i = 0; i < int(std::size(kLevelNames)); i++) {
      if (*text == kLevelNames[i]) {
        level = i;
        known = true;
      }
    }
  }
  // A level that was set by hand in the meantime stays.
  int expected = -1;
  bool first = logLevel.compare_exchange_strong(expected, level, std::memory_order_relaxed);
  if (first && !known) {
    logError("PUMICE_LOG=%s is not one of off, error, warn, info, debug", text->c_str());
  }
  return first ? level : expected;
}

}  // namespace detail

struct LogAccess {
  static void write(LogLevel level, const char* label, const char* format, va_list args) {
    ScopedLogSink* sink = innermostSink;
    bool collected = sink && level <= LogLevel::Warn;
    if (level == LogLevel::Off || (!collected && !logEnabled(level))) return;

    // One write per line, so that lines of several threads do not mix.
    char small[512];
    std::string large;
    va_list again;
    va_copy(again, args);
    int length = std::vsnprintf(small, sizeof(small), format, args);
    std::string_view text;
    if (length >= int(sizeof(small))) {
      large.resize(size_t(length));
      std::vsnprintf(large.data(), size_t(length) + 1, format, again);
      text = large;
    } else if (length > 0) {
      text = std::string_view(small, size_t(length));
    }
    va_end(again);

    if (sink) {
      // A sink that logs must not call itself.
      innermostSink = sink->outer_;
      sink->sink_(level, text);
      innermostSink = sink;
      return;
    }
    std::fprintf(stderr, "pumice: %s: %.*s\n", label, int(text.size()), text.data());
  }
};

void setLogLevel(LogLevel level) { detail::logLevel.store(int(level), std::memory_order_relaxed); }

void logMessage(LogLevel level, const char* format, ...) {
  va_list args;
  va_start(args, format);
  LogAccess::write(level, kLevelNames[int(level)], format, args);
  va_end(args);
}

#define PUMICE_DEFINE_LOG(function, level, label)           \
  void function(const char* format, ...) {                  \
    va_list args;                                           \
    va_start(args, format);                                 \
    LogAccess::write(LogLevel::level, label, format, args); \
    va_end(args);                                           \
  }
PUMICE_DEFINE_LOG(logError, Error, "error")
PUMICE_DEFINE_LOG(logWarn, Warn, "warn")
PUMICE_DEFINE_LOG(logInfo, Info, "info")
PUMICE_DEFINE_LOG(logDebug, Debug, "debug")
PUMICE_DEFINE_LOG(logPrinted, Error, "printf")
#undef PUMICE_DEFINE_LOG

ScopedLogSink::ScopedLogSink(Sink sink) : sink_(std::move(sink)), outer_(innermostSink) {
  innermostSink = this;
}

ScopedLogSink::~ScopedLogSink() { innermostSink = outer_; }

}  // namespace pumice::base
