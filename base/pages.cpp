#include "base/pages.h"

#include <sys/mman.h>

namespace pumice::base {

namespace {
constexpr uint64_t kHugePage = 2 * 1024 * 1024;
}

void* mapPages(uint64_t bytes) {
  const auto map = [](uint64_t size) -> std::byte* {
    void* pages = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    return pages == MAP_FAILED ? nullptr : static_cast<std::byte*>(pages);
  };
  if (bytes < kHugePage || bytes > UINT64_MAX - kHugePage) return map(bytes);
  // More than is needed, cut to where a huge page begins.
  std::byte* pages = map(bytes + kHugePage);
  if (!pages) return map(bytes);
  const uint64_t head = -reinterpret_cast<uintptr_t>(pages) & (kHugePage - 1);
  const uint64_t used = (bytes + 4095) & ~uint64_t(4095);
  if (head) ::munmap(pages, head);
  pages += head;
  ::munmap(pages + used, kHugePage - head);
  ::madvise(pages, bytes & ~(kHugePage - 1), MADV_HUGEPAGE);  // a hint
  return pages;
}

}  // namespace pumice::base
