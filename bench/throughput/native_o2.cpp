#include "bench/throughput/native.h"

#include <cmath>
#include <cstring>

namespace pumice::bench::o2 {
#include "bench/throughput/native.inc"
}  // namespace pumice::bench::o2
