// 64-bit hashes of bytes (XXH3), for caches within a process: not for hostile input, not for files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace pumice::base {

uint64_t hashBytes(const void* bytes, size_t size, uint64_t seed = 0);

template <typename T>
uint64_t hashSpan(std::span<const T> values, uint64_t seed = 0) {
  static_assert(std::has_unique_object_representations_v<T>, "padding or floats would be hashed");
  return hashBytes(values.data(), values.size_bytes(), seed);
}

// A key struct without padding: its bytes are its identity.
template <typename T>
uint64_t hashObject(const T& key, uint64_t seed = 0) {
  static_assert(std::has_unique_object_representations_v<T>, "padding or floats would be hashed");
  return hashBytes(&key, sizeof(key), seed);
}

// The hash of an ordered pair of hashes (the finaliser of MurmurHash3 over a sum that keeps the order).
constexpr uint64_t hashCombine(uint64_t first, uint64_t second) {
  uint64_t h = first * 0x9e3779b97f4a7c15u + second + 0x632be59bd9b4e019u;
  h ^= h >> 33;
  h *= 0xff51afd7ed558ccdu;
  h ^= h >> 33;
  h *= 0xc4ceb9fe1a85ec53u;
  h ^= h >> 33;
  return h;
}

}  // namespace pumice::base
