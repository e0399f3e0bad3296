// Messages for the person who runs a program on Pumice. They go to stderr, one line each, as
// "pumice: warn: message"; PUMICE_LOG=off|error|warn|info|debug sets how much is said (default: error).
// Safe from several threads; a message that is not wanted costs one load and a comparison (its
// arguments are evaluated: ask logEnabled() first where that is dear).
#pragma once

#include <atomic>
#include <functional>
#include <string_view>

namespace pumice::base {

enum class LogLevel : int { Off = 0, Error, Warn, Info, Debug };

namespace detail {
// -1 until PUMICE_LOG has been read.
extern std::atomic<int> logLevel;
int readLogLevel();
}  // namespace detail

inline bool logEnabled(LogLevel level) {
  int wanted = detail::logLevel.load(std::memory_order_relaxed);
  if (wanted < 0) [[unlikely]]
    wanted = detail::readLogLevel();
  return int(level) <= wanted;
}

// Overrides PUMICE_LOG for the rest of the process.
void setLogLevel(LogLevel level);

[[gnu::format(printf, 2, 3)]] void logMessage(LogLevel level, const char* format, ...);
[[gnu::format(printf, 1, 2)]] void logError(const char* format, ...);
[[gnu::format(printf, 1, 2)]] void logWarn(const char* format, ...);
[[gnu::format(printf, 1, 2)]] void logInfo(const char* format, ...);
[[gnu::format(printf, 1, 2)]] void logDebug(const char* format, ...);
// What a shader prints (PUMICE_CHECK=printf), as "pumice: printf: text"; said where errors are.
[[gnu::format(printf, 1, 2)]] void logPrinted(const char* format, ...);

// While it lives, the messages of this thread (errors and warnings at least, whatever PUMICE_LOG says) go
// to `sink` instead of stderr. May be nested: the innermost one receives. For tests and for collecting the
// reasons of a failure.
class ScopedLogSink {
 public:
  using Sink = std::function<void(LogLevel, std::string_view)>;

  explicit ScopedLogSink(Sink sink);
  ~ScopedLogSink();
  ScopedLogSink(const ScopedLogSink&) = delete;
  ScopedLogSink& operator=(const ScopedLogSink&) = delete;

 private:
  friend struct LogAccess;
  Sink sink_;
  ScopedLogSink* outer_;
};

}  // namespace pumice::base
