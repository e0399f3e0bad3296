#include "pipeline/decisions.h"

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <string>

#include "base/env.h"
#include "base/log.h"

namespace pumice::pipeline {

namespace {

constexpr uint32_t kMagic = 0x43454450;   // "PDEC"

struct File {
  std::string wanted;      // the variable's text that it was opened for
  bool compares = false;
  std::FILE* file = nullptr;
  ~File() { close(); }
  void close() {
    if (file) std::fclose(file);
    file = nullptr;
  }

  void open(const std::string& text) {
    if (text == wanted) return;
    close();
    wanted = text;
    compares = text.starts_with("compare:");
    if (!compares && !text.starts_with("write:")) return base::logError("PUMICE_DECISIONS=%s: write:FILE or compare:FILE expected", text.c_str());
    const std::string path = text.substr(text.find(':') + 1);
    file = std::fopen(path.c_str(), compares ? "rbe" : "wbe");
    if (!file) base::logError("PUMICE_DECISIONS: cannot open %s", path.c_str());
  }
};

}  // namespace

uint64_t decisionMismatches(const DecisionRecord& a, const DecisionRecord& b) {
  const size_t pixels = size_t(a.width) * a.height, planes = size_t(a.layers) * a.samples;
  if (a.words.size() != b.words.size() || a.words.size() != pixels * planes || a.width != b.width) return pixels;
  uint64_t count = 0;
  for (size_t i = 0; i < pixels; ++i) {
    bool differs = false;
    for (size_t p = 0; p < planes; ++p) differs |= a.words[p * pixels + i] != b.words[p * pixels + i];
    count += differs;
  }
  return count;
}

bool wantedDecisions() { return base::envString(base::EnvVar::Decisions).has_value(); }

void keepDecisions(const DecisionRecord& record) {
  const auto text = base::envString(base::EnvVar::Decisions);
  if (!text) return;
  static std::mutex mutex;
  static File file;
  std::lock_guard lock(mutex);
  file.open(*text);
  if (!file.file) return;
  const uint32_t header[5] = {kMagic, record.width, record.height, record.layers, record.samples};
  if (!file.compares) {
    const bool done = std::fwrite(header, sizeof header, 1, file.file) == 1 &&
                      std::fwrite(record.words.data(), 4, record.words.size(), file.file) == record.words.size() && !std::fflush(file.file);
    if (!done) base::logError("PUMICE_DECISIONS: writing failed");
    return;
  }
  uint32_t found[5] = {};
  DecisionRecord other{record.width, record.height, record.layers, record.samples, std::vector<uint32_t>(record.words.size())};
  if (std::fread(found, sizeof found, 1, file.file) != 1 || !std::equal(found, found + 5, header) ||
      std::fread(other.words.data(), 4, other.words.size(), file.file) != other.words.size()) {
    base::logError("PUMICE_DECISIONS: the file's next pass is not this one (%u x %u, %u layers, %u samples)", record.width, record.height,
                   record.layers, record.samples);
    file.close();
    return;
  }
  std::fprintf(stderr, "pumice: decisions: pass %ux%u: %llu of %llu pixels decided otherwise\n", record.width, record.height,
               static_cast<unsigned long long>(decisionMismatches(record, other)),
               static_cast<unsigned long long>(uint64_t(record.width) * record.height));
}

}  // namespace pumice::pipeline
