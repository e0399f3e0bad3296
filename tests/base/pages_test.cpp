#include "base/pages.h"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <algorithm>

namespace pumice::base {
namespace {

TEST(Pages, AreZeroedWritableToTheLastByteAndLargeOnesAligned) {
  for (uint64_t bytes : {uint64_t(1), uint64_t(4096), uint64_t(100'000), uint64_t(2) << 20, (uint64_t(2) << 20) + 1, (uint64_t(7) << 20) + 12345}) {
    auto* pages = static_cast<std::byte*>(mapPages(bytes));
    ASSERT_NE(pages, nullptr) << bytes;
    EXPECT_TRUE(std::all_of(pages, pages + bytes, [](std::byte b) { return b == std::byte(0); })) << bytes;
    std::fill(pages, pages + bytes, std::byte(1));
    if (bytes >= uint64_t(2) << 20) EXPECT_EQ(reinterpret_cast<uintptr_t>(pages) % (2 << 20), 0u) << bytes;
    EXPECT_EQ(::munmap(pages, bytes), 0) << bytes;
  }
}

TEST(Pages, TooManyAreRefused) {
  EXPECT_EQ(mapPages(uint64_t(1) << 60), nullptr);
  EXPECT_EQ(mapPages(~uint64_t(0)), nullptr);
}

}  // namespace
}  // namespace pumice::base
