#include "base/address_ranges.h"

#include <algorithm>

namespace pumice::base {

void AddressRanges::add(uint64_t begin, uint64_t size) {
  std::lock_guard guard(lock_);
  ranges_.emplace(begin, size);
}

void AddressRanges::remove(uint64_t begin, uint64_t size) {
  std::lock_guard guard(lock_);
  auto [at, end] = ranges_.equal_range(begin);
  at = std::find_if(at, end, [&](const auto& r) { return r.second == size; });
  if (at != end) ranges_.erase(at);
}

AddressRanges::Place AddressRanges::find(uint64_t address) const {
  std::lock_guard guard(lock_);
  auto after = ranges_.upper_bound(address);
  if (after == ranges_.begin()) return {};
  Place place{true, std::prev(after)->first, 0};
  for (auto [at, end] = ranges_.equal_range(place.begin); at != end; ++at) place.size = std::max(place.size, at->second);
  return place;
}

AddressRanges& addressRanges() {
  static AddressRanges* ranges = new AddressRanges;   // outlives every device
  return *ranges;
}

}  // namespace pumice::base
