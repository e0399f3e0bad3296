#include "pipeline/ideas.h"

#include <iterator>
#include <string_view>

#include "base/env.h"
#include "base/log.h"

namespace pumice::pipeline {

static Ideas readDisabled() {
  static constexpr std::string_view kNames[] = {
#define PUMICE_IDEA(id, name) name,
      PUMICE_IDEAS(PUMICE_IDEA)
#undef PUMICE_IDEA
  };
  Ideas off = 0;
  const auto text = base::envString(base::EnvVar::Disable);
  std::string_view rest = text ? std::string_view(*text) : std::string_view();
  while (!rest.empty()) {
    const std::string_view word = rest.substr(0, rest.find(','));
    rest.remove_prefix(word.size() < rest.size() ? word.size() + 1 : word.size());
    bool known = false;
    for (uint32_t i = 0; i < std::size(kNames); ++i)
      if (word == kNames[i]) off |= 1u << i, known = true;
    if (!known) base::logError("PUMICE_DISABLE: there is no \"%.*s\"", int(word.size()), word.data());
  }
  return off;
}

Ideas disabledIdeas() {
  static const Ideas off = readDisabled();
  return off;
}

}  // namespace pumice::pipeline
