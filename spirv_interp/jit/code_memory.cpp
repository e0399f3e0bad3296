#include "spirv_interp/jit/code_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace pumice::jit {

CodeMemory::~CodeMemory() {
  if (data_) munmap(data_, size_);
}

base::Result<CodeMemory> CodeMemory::make(std::span<const std::byte> code) {
  const size_t page = size_t(sysconf(_SC_PAGESIZE));
  CodeMemory m;
  m.size_ = (code.size() + page - 1) / page * page;
  void* p = mmap(nullptr, m.size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (p == MAP_FAILED) return base::errorf("no memory for code: %s", std::strerror(errno));
  m.data_ = static_cast<std::byte*>(p);
  std::memcpy(m.data_, code.data(), code.size());
  if (mprotect(p, m.size_, PROT_READ | PROT_EXEC)) return base::errorf("code may not be executed: %s", std::strerror(errno));
  return m;
}

}  // namespace pumice::jit
