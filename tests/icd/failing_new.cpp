// C++ allocations that fail on demand, in the test and in the driver: the dynamic linker gives the driver the
// program's operator new. Sanitizers bring their own.
#include <cstdlib>
#include <new>

#ifndef PUMICE_SANITIZER_RUNTIME
//! How many allocations this thread may still make; -1: no end.
thread_local long allocationsLeft = -1;

void* operator new(size_t size) {
  if (allocationsLeft == 0) throw std::bad_alloc();
  if (allocationsLeft > 0) allocationsLeft--;
  if (void* memory = std::malloc(size ? size : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }
#endif
