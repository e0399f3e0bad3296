// Large pieces of memory, straight from the system.
#pragma once

#include <cstddef>
#include <cstdint>

namespace pumice::base {

//! Zeroed pages that come when they are touched: what is never used costs nothing. What is large is aligned to huge pages and asks for
//! them, as far as it fills them: a copy between such pieces takes a quarter less time, and page faults are few. Null when there is
//! no more. munmap() gives them back.
void* mapPages(uint64_t bytes);

}  // namespace pumice::base
