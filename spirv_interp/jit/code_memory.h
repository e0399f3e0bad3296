// Executable memory. Written once, then made executable; never both at a time.
#pragma once

#include <cstddef>
#include <span>

#include "base/result.h"

namespace pumice::jit {

class CodeMemory {
 public:
  CodeMemory() = default;
  CodeMemory(CodeMemory&& o) noexcept : data_(o.data_), size_(o.size_) { o.data_ = nullptr; }
  CodeMemory& operator=(CodeMemory&&) = delete;
  ~CodeMemory();
  //! Error: the system denies memory, or execution.
  static base::Result<CodeMemory> make(std::span<const std::byte> code);
  const std::byte* data() const { return data_; }

 private:
  std::byte* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace pumice::jit
