#include "pipeline/variants.h"

namespace pumice::pipeline {

uint64_t hashImages(std::span<const ImageState> images) {
  uint64_t h = images.size();
  for (const ImageState& i : images) {
    h = base::hashCombine(h, i.use);
    h = base::hashBytes(&i.view, sizeof i.view, h);
    h = base::hashBytes(&i.sampler, sizeof i.sampler, h);
  }
  return h;
}

bool addStates(std::vector<ImageState>& images, std::span<const ImageState> more) {
  std::vector<ImageState> all = images;
  for (const ImageState& s : more) {
    if (std::find(all.begin(), all.end(), s) != all.end()) continue;
    // Behind the others of its use: uses are in order.
    const auto end = std::find_if(all.begin(), all.end(), [&](const ImageState& other) { return other.use > s.use; });
    const auto count = std::count_if(all.begin(), end, [&](const ImageState& other) { return other.use == s.use; });
    if (size_t(count) >= kTableStates) return false;
    all.insert(end, s);
  }
  images = std::move(all);
  return true;
}

}  // namespace pumice::pipeline
