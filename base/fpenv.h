// The floating-point environment in which every result of Pumice is defined: round to nearest even,
// subnormals kept, exceptions masked. A host may have set flush-to-zero (threads inherit it), so code that
// computes on the application's thread stands in a ScopedFpEnv, and threads of ours set it once.
#pragma once

#include <cstdint>

#if defined(__x86_64__) || defined(__i386__)
#include <xmmintrin.h>
#endif

namespace pumice::base {

#if defined(__x86_64__) || defined(__i386__)

inline constexpr uint32_t kDefaultFpEnv = 0x1f80;
inline uint32_t readFpEnv() { return _mm_getcsr(); }
inline void writeFpEnv(uint32_t environment) { _mm_setcsr(environment); }

#elif defined(__aarch64__)

inline constexpr uint32_t kDefaultFpEnv = 0;
inline uint32_t readFpEnv() { return uint32_t(__builtin_aarch64_get_fpcr()); }
inline void writeFpEnv(uint32_t environment) { __builtin_aarch64_set_fpcr(environment); }

#else
#error "base/fpenv.h: how is the floating-point environment set on this processor?"
#endif

// Sets the default environment; the destructor puts back what was there, status flags included.
class ScopedFpEnv {
 public:
  ScopedFpEnv() : saved_(readFpEnv()) { writeFpEnv(kDefaultFpEnv); }
  ~ScopedFpEnv() { writeFpEnv(saved_); }
  ScopedFpEnv(const ScopedFpEnv&) = delete;
  ScopedFpEnv& operator=(const ScopedFpEnv&) = delete;

 private:
  uint32_t saved_;
};

}  // namespace pumice::base
