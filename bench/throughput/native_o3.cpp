#include "bench/throughput/native.h"

#include <cmath>
#include <cstring>

namespace pumice::bench::o3 {
#include "bench/throughput/native.inc"
}  // namespace pumice::bench::o3
