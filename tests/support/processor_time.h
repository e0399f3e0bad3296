// Time that a busy machine does not stretch.
#pragma once

#include <ctime>

namespace pumice::test {

//! Seconds for which the calling thread has had a processor.
inline double processorSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + double(t.tv_nsec) * 1e-9;
}

}  // namespace pumice::test
