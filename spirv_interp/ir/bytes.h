// Functions, and what stands around them, as bytes: for caches that outlive the process. One description of the fields
// serves both directions: `fields(archive, thing)` with a writer or a reader. A reader survives any bytes; whether what
// it made is sound is to be asked of verify() and of whoever knows what the function may name.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

class ByteWriter {
 public:
  static constexpr bool kReads = false;
  template <typename T>
  void value(const T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto* p = reinterpret_cast<const std::byte*>(&v);
    bytes.insert(bytes.end(), p, p + sizeof v);
  }
  //! Seven bits a byte, the lowest first.
  void number(uint64_t n) {
    for (; n >= 0x80; n >>= 7) bytes.push_back(std::byte(n | 0x80));
    bytes.push_back(std::byte(n));
  }
  void size(size_t& n, size_t) { number(n); }
  std::vector<std::byte> bytes;
  bool ok = true;
};

class ByteReader {
 public:
  static constexpr bool kReads = true;
  explicit ByteReader(std::span<const std::byte> b) : rest(b) {}
  template <typename T>
  void value(T& v) {
    if (rest.size() < sizeof v) {
      ok = false;
      return;
    }
    if constexpr (std::is_same_v<T, bool>) {
      v = rest[0] != std::byte(0);   // other bytes than 0 and 1 are no bool
    } else {
      std::memcpy(&v, rest.data(), sizeof v);
    }
    rest = rest.subspan(sizeof v);
  }
  uint64_t number() {
    uint64_t n = 0;
    for (unsigned shift = 0; shift < 64 && !rest.empty(); shift += 7) {
      const auto b = uint64_t(rest[0]);
      rest = rest.subspan(1);
      n |= (b & 0x7f) << shift;
      if (!(b & 0x80)) return n;
    }
    ok = false;
    return 0;
  }
  //! A count of elements that take at least so many bytes each: what is not there is not allocated.
  void size(size_t& n, size_t elementBytes) {
    const uint64_t stored = number();
    if (!ok || stored > rest.size() / elementBytes) ok = false, n = 0;
    else n = size_t(stored);
  }
  std::span<const std::byte> rest;
  bool ok = true;
};

template <typename A, typename T, typename Each>
void list(A& a, std::vector<T>& items, size_t elementBytes, Each&& each) {
  size_t n = items.size();
  a.size(n, elementBytes);
  if constexpr (A::kReads) items.assign(n, T{});
  for (T& item : items) {
    each(item);
    if (!a.ok) return;
  }
}

template <typename A>
void text(A& a, std::string& s) {
  size_t n = s.size();
  a.size(n, 1);
  if constexpr (A::kReads) s.resize(n);
  for (char& c : s) a.value(c);
}

//! Five to six bytes an instruction. Rates are left out: computeRates() finds them again. What is written must verify().
void fields(ByteWriter& a, const Function& f);
void fields(ByteReader& a, Function& f);

}  // namespace pumice::ir
