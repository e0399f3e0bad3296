// Memory of a thread for what is too big for its stack.
#pragma once

#include <cstddef>
#include <cstring>
#include <new>

namespace pumice::interp {

//! Grows only. What get() gave before is gone with the next get().
class Scratch {
 public:
  static constexpr size_t kAlign = 64;

  Scratch() = default;
  ~Scratch() { operator delete(data_, std::align_val_t(kAlign)); }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  //! Null if there is none.
  std::byte* get(size_t bytes) {
    if (bytes > size_) {
      operator delete(data_, std::align_val_t(kAlign));
      size_ = 0;
      data_ = static_cast<std::byte*>(operator new(bytes, std::align_val_t(kAlign), std::nothrow));
      if (data_) {
        std::memset(data_, 0, bytes);   // registers that nobody wrote show a shader nothing of the process
        size_ = bytes;
      }
    }
    return data_;
  }

 private:
  std::byte* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace pumice::interp
