#include "base/env.h"

#include <atomic>
#include <charconv>
#include <cstdlib>
#include <functional>

#include "base/log.h"

namespace pumice::base {

namespace {

constexpr EnvInfo kTable[] = {
#define PUMICE_ENV_ROW(id, name, values, fallback, description) {name, values, fallback, description},
    PUMICE_ENV_LIST(PUMICE_ENV_ROW)
#undef PUMICE_ENV_ROW
};

// The text of each variable that was complained about last.
constinit std::atomic<size_t> complained[std::size(kTable)] = {};

}  // namespace

bool firstComplaint(EnvVar variable, const std::string& text) {
  const size_t mark = std::hash<std::string>{}(text) | 1;
  return complained[int(variable)].exchange(mark, std::memory_order_relaxed) != mark;
}

std::span<const EnvInfo> envTable() { return kTable; }

const EnvInfo& envInfo(EnvVar variable) { return kTable[int(variable)]; }

std::optional<std::string> envString(EnvVar variable) {
  const char* text = ::secure_getenv(envInfo(variable).name);
  if (!text || !*text) return std::nullopt;
  return std::string(text);
}

std::optional<int64_t> envInteger(EnvVar variable, int64_t lowest, int64_t highest) {
  auto text = envString(variable);
  if (!text) return std::nullopt;
  int64_t number = 0;
  const char* end = text->data() + text->size();
  auto [stop, problem] = std::from_chars(text->data(), end, number);
  if (problem != std::errc() || stop != end || number < lowest || number > highest) {
    if (firstComplaint(variable, *text))
      logError("%s=%s is not a number from %lld to %lld", envInfo(variable).name, text->c_str(),
               (long long)lowest, (long long)highest);
    return std::nullopt;
  }
  return number;
}

bool envFlag(EnvVar variable, bool fallback) {
  auto text = envString(variable);
  if (!text) return fallback;
  for (const char* word : {"1", "on", "true", "yes"})
    if (*text == word) return true;
  for (const char* word : {"0", "off", "false", "no"})
    if (*text == word) return false;
  if (firstComplaint(variable, *text)) logError("%s=%s is neither on nor off", envInfo(variable).name, text->c_str());
  return fallback;
}

}  // namespace pumice::base
