// Choice among the instruction sets a kernel file was compiled for. Included once per kernel file, in its
// HWY_ONCE part: PUMICE_CALL_TARGET(bit, function, arguments...) calls N_<TARGET>::function.
#pragma once

#if HWY_TARGETS & HWY_AVX3
#define PUMICE_TARGET_AVX3(bit, f, ...) if ((bit) == HWY_AVX3) return N_AVX3::f(__VA_ARGS__);
#else
#define PUMICE_TARGET_AVX3(bit, f, ...)
#endif
#if HWY_TARGETS & HWY_AVX2
#define PUMICE_TARGET_AVX2(bit, f, ...) if ((bit) == HWY_AVX2) return N_AVX2::f(__VA_ARGS__);
#else
#define PUMICE_TARGET_AVX2(bit, f, ...)
#endif
#if HWY_TARGETS & HWY_SSE4
#define PUMICE_TARGET_SSE4(bit, f, ...) if ((bit) == HWY_SSE4) return N_SSE4::f(__VA_ARGS__);
#else
#define PUMICE_TARGET_SSE4(bit, f, ...)
#endif
#if HWY_TARGETS & HWY_NEON
#define PUMICE_TARGET_NEON(bit, f, ...) if ((bit) == HWY_NEON) return N_NEON::f(__VA_ARGS__);
#else
#define PUMICE_TARGET_NEON(bit, f, ...)
#endif
#if HWY_TARGETS & HWY_EMU128
#define PUMICE_TARGET_EMU128(bit, f, ...) if ((bit) == HWY_EMU128) return N_EMU128::f(__VA_ARGS__);
#else
#define PUMICE_TARGET_EMU128(bit, f, ...)
#endif
#if HWY_TARGETS & HWY_SCALAR
#define PUMICE_TARGET_SCALAR(bit, f, ...) if ((bit) == HWY_SCALAR) return N_SCALAR::f(__VA_ARGS__);
#else
#define PUMICE_TARGET_SCALAR(bit, f, ...)
#endif

#define PUMICE_CALL_TARGET(bit, f, ...)        \
  PUMICE_TARGET_AVX3(bit, f, __VA_ARGS__)      \
  PUMICE_TARGET_AVX2(bit, f, __VA_ARGS__)      \
  PUMICE_TARGET_SSE4(bit, f, __VA_ARGS__)      \
  PUMICE_TARGET_NEON(bit, f, __VA_ARGS__)      \
  PUMICE_TARGET_EMU128(bit, f, __VA_ARGS__)    \
  PUMICE_TARGET_SCALAR(bit, f, __VA_ARGS__)
