// Copies and fills of plain bytes, as fast as memory goes. The vector width is chosen at run time; the bytes never depend on it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace pumice::texture {

enum class Store { kCached, kStream };
//! Whole fills and copies of this many bytes would only push everything else out of the caches: they go past them, and a line
//! that is overwritten as a whole is not read first.
constexpr uint64_t kStreamBytes = 8 * 1024 * 1024;
inline Store storeFor(uint64_t bytes) { return bytes >= kStreamBytes ? Store::kStream : Store::kCached; }

//! memcpy; or the same past the caches.
void copyBytes(std::byte* out, const std::byte* in, uint64_t bytes, Store store);

//! Fills with a pattern of 32 bytes, which begins anew at `out`.
void fillBytes(std::byte* out, uint64_t bytes, const std::byte* pattern, Store store);

}  // namespace pumice::texture
