// Where the buffers with device addresses lie, for checks of what shaders do with addresses. One registry for the process: an
// address means the same to every device.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>

namespace pumice::base {

class AddressRanges {
 public:
  struct Place {
    bool known = false;
    uint64_t begin = 0, size = 0;
  };
  void add(uint64_t begin, uint64_t size);
  void remove(uint64_t begin, uint64_t size);
  //! The last range that begins at or before the address; it need not reach so far. Of ranges with the same beginning, the largest.
  Place find(uint64_t address) const;

 private:
  mutable std::mutex lock_;
  std::multimap<uint64_t, uint64_t> ranges_;
};

AddressRanges& addressRanges();

}  // namespace pumice::base
