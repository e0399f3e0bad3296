// What the kernels of memory operations share.
#pragma once

#include <cstring>

#include "spirv_interp/interpreter/bytecode.h"

namespace pumice::interp {

//! Calls f(lane) for each active lane, in order.
template <class F>
inline void eachActive(const RunState& s, F f) {
  if (s.full()) {
    for (uint32_t i = 0, end = s.lanes; i < end; i++) f(i);
    return;
  }
  for (unsigned w = 0; w < kMaskWords; w++)
    for (uint64_t bits = s.exec[w]; bits; bits &= bits - 1) f(w * 64 + unsigned(__builtin_ctzll(bits)));
}

template <class T>
inline T read(const void* p) {
  T v;
  std::memcpy(&v, p, sizeof(T));
  return v;
}
template <class T>
inline void write(void* p, T v) {
  std::memcpy(p, &v, sizeof(T));
}

//! offset + constant + bytes <= size, without wrapping. On success `at` is offset + constant.
inline bool inside(uint64_t offset, uint64_t constant, uint64_t bytes, uint64_t size, uint64_t& at) {
  at = offset + constant;
  return at >= offset && size >= bytes && at <= size - bytes;
}

//! Lanes one by one: the meaning of every load from one range of memory.
template <class T, class Offset>
inline void loadLanes(const RunState& s, T* dst, const Offset* offset, uint64_t constant, const std::byte* base, uint64_t size) {
  eachActive(s, [&](uint32_t i) {
    uint64_t at;
    dst[i] = base && inside(offset[i], constant, sizeof(T), size, at) ? read<T>(base + at) : T(0);
  });
}
template <class T, class Offset>
inline void storeLanes(const RunState& s, const T* value, const Offset* offset, uint64_t constant, std::byte* base, uint64_t size) {
  eachActive(s, [&](uint32_t i) {
    uint64_t at;
    if (base && inside(offset[i], constant, sizeof(T), size, at)) write<T>(base + at, value[i]);
  });
}

// Local memory: word w of lane l lies at word w * kMaxLanes + l, so that lanes with equal offsets are neighbours.
inline std::byte* localByte(const RunState& s, uint32_t area, uint64_t at, uint32_t lane) {
  return s.local + area + ((at >> 2) * kMaxLanes + lane) * 4 + (at & 3);
}
template <class T>
inline T readLocal(const RunState& s, uint32_t area, uint64_t at, uint32_t lane) {
  if (sizeof(T) <= 4 && at % sizeof(T) == 0) return read<T>(localByte(s, area, at, lane));
  std::byte bytes[sizeof(T)];
  for (unsigned b = 0; b < sizeof(T); b++) bytes[b] = *localByte(s, area, at + b, lane);
  return read<T>(bytes);
}
template <class T>
inline void writeLocal(const RunState& s, uint32_t area, uint64_t at, uint32_t lane, T v) {
  if (sizeof(T) <= 4 && at % sizeof(T) == 0) {
    write<T>(localByte(s, area, at, lane), v);
    return;
  }
  std::byte bytes[sizeof(T)];
  write<T>(bytes, v);
  for (unsigned b = 0; b < sizeof(T); b++) *localByte(s, area, at + b, lane) = bytes[b];
}
//! src: offset row, (value row), -, area, size
template <class T>
inline void localLoadLanes(const RunState& s, const Code* c) {
  T* dst = s.row<T>(c->dst);
  const uint32_t* offset = s.row<uint32_t>(c->src[0]);
  eachActive(s, [&](uint32_t i) {
    uint64_t at;
    dst[i] = inside(offset[i], uint32_t(c->imm), sizeof(T), c->src[4], at) ? readLocal<T>(s, c->src[3], at, i) : T(0);
  });
}
template <class T>
inline void localStoreLanes(const RunState& s, const Code* c) {
  const uint32_t* offset = s.row<uint32_t>(c->src[0]);
  const T* value = s.row<T>(c->src[1]);
  eachActive(s, [&](uint32_t i) {
    uint64_t at;
    if (inside(offset[i], uint32_t(c->imm), sizeof(T), c->src[4], at)) writeLocal<T>(s, c->src[3], at, i, value[i]);
  });
}

}  // namespace pumice::interp
