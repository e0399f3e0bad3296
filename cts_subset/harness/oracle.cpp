#include "cts_subset/harness/oracle.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace pumice::cts {

std::vector<DecisionPass> readDecisions(const std::string& path) {
  constexpr uint32_t kMagic = 0x43454450;  // "PDEC"
  std::vector<DecisionPass> passes;
  std::ifstream file(path, std::ios::binary);
  uint32_t header[5];
  while (file.read(reinterpret_cast<char*>(header), sizeof header) && header[0] == kMagic) {
    DecisionPass pass{header[1], header[2], header[3], header[4], {}};
    pass.words.resize(size_t(pass.width) * pass.height * pass.layers * pass.samples);
    if (!file.read(reinterpret_cast<char*>(pass.words.data()), std::streamsize(pass.words.size() * 4))) break;
    passes.push_back(std::move(pass));
  }
  return passes;
}

OracleError oracleError(const Picture& picture, const Picture& oracle, const std::vector<DecisionPass>& passes,
                        const std::vector<DecisionPass>& oraclePasses, int units) {
  OracleError out;
  out.pixels = uint64_t(picture.width) * picture.height;
  out.comparable = passes.size() == oraclePasses.size();
  std::vector<bool> decided(out.pixels);
  for (size_t p = 0; p < passes.size() && out.comparable; ++p) {
    const DecisionPass &a = passes[p], &b = oraclePasses[p];
    if (a.width != b.width || a.words.size() != b.words.size()) {
      out.comparable = false;
      break;
    }
    const size_t pixels = size_t(a.width) * a.height;
    for (size_t i = 0; i < pixels; ++i) {
      bool differs = false;
      for (size_t plane = 0; plane < size_t(a.layers) * a.samples; ++plane) differs |= a.words[plane * pixels + i] != b.words[plane * pixels + i];
      if (!differs) continue;
      if (a.width == picture.width && a.height == picture.height) decided[i] = true;
      else ++out.elsewhere;
    }
  }
  out.mismatches = uint64_t(std::count(decided.begin(), decided.end(), true));
  double sum = 0;
  uint64_t alike = 0;
  for (size_t i = 0; i < out.pixels; ++i) {
    int largest = 0, total = 0;
    for (size_t c = 0; c < 4; ++c) {
      const int d = std::abs(int(picture.rgba[4 * i + c]) - int(oracle.rgba[4 * i + c]));
      largest = std::max(largest, d);
      total += d;
    }
    out.unequal += largest != 0;
    out.beyond += largest > units;
    if (decided[i]) continue;
    ++alike;
    sum += total;
    out.colourBeyond += largest > units;
    out.largest = std::max(out.largest, largest);
    if (!picture.depth.empty()) out.depth = std::max(out.depth, std::abs(double(picture.depth[i]) - double(oracle.depth[i])));
  }
  out.mean = alike ? sum / (4.0 * double(alike)) : 0;
  return out;
}

OracleRun renderRecorded(Device& device, const Scene& scene, bool inDouble) {
  OracleRun run;
  const std::string path = outputDirectory() + "/decisions." + scene.name + (inDouble ? ".reference" : ".f32");
  if (inDouble) setenv("PUMICE_NUMERICS", "reference", 1);
  setenv("PUMICE_DECISIONS", ("write:" + path).c_str(), 1);
  const auto start = std::chrono::steady_clock::now();
  try {
    run.picture = scene.render(device, Variant::kGood);
  } catch (...) {
    unsetenv("PUMICE_NUMERICS");
    unsetenv("PUMICE_DECISIONS");
    throw;
  }
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  unsetenv("PUMICE_NUMERICS");
  unsetenv("PUMICE_DECISIONS");
  run.passes = readDecisions(path);
  std::filesystem::remove(path);
  return run;
}

}  // namespace pumice::cts
