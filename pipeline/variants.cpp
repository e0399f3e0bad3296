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

}  // namespace pumice::pipeline
