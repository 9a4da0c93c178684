#pragma once
// Allocations of a thread, counted in the program's own malloc and relatives on top of glibc's;
// operator new and Eigen call them. Any number of a program's source files may include this.

#include <dashpot/tests/support/sanitized.hpp>

#include <cerrno>
#include <cstddef>

// Sanitizers bring their own malloc: there nothing is counted, and a test has to skip.
#if DASHPOT_SANITIZED || !defined(__GLIBC__)
#define DASHPOT_COUNTS_ALLOCATIONS 0
#else
#define DASHPOT_COUNTS_ALLOCATIONS 1
#endif

namespace dashpot::testing {

inline constinit thread_local bool counting_allocations = false;
inline constinit thread_local int allocations = 0;
inline constinit thread_local std::size_t largest_allocation = 0;  ///< bytes
inline constinit thread_local bool refusing_memory = false;

/// Returns whether there is memory.
inline bool note_allocation(std::size_t size) {
  if (counting_allocations) {  // a breakpoint here shows who allocates
    ++allocations;
    if (size > largest_allocation) largest_allocation = size;
  }
  return !refusing_memory;
}

/// Allocations of this thread while `act` runs; the largest is left in largest_allocation.
template <class Act>
int allocations_of(const Act& act) {
  allocations = 0;
  largest_allocation = 0;
  counting_allocations = true;
  act();
  counting_allocations = false;
  return allocations;
}

/// Does `act` while this thread gets no memory.
template <class Act>
void without_memory(const Act& act) {
  struct Refusal {
    Refusal() { refusing_memory = true; }
    ~Refusal() { refusing_memory = false; }
  } const refusal;
  act();
}

}  // namespace dashpot::testing

#if DASHPOT_COUNTS_ALLOCATIONS
#define DASHPOT_SHARED __attribute__((weak, visibility("default")))
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

DASHPOT_SHARED void* malloc(std::size_t size) noexcept {
  return dashpot::testing::note_allocation(size) ? __libc_malloc(size) : nullptr;
}
DASHPOT_SHARED void* calloc(std::size_t count, std::size_t size) noexcept {
  return dashpot::testing::note_allocation(count * size) ? __libc_calloc(count, size) : nullptr;
}
DASHPOT_SHARED void* realloc(void* block, std::size_t size) noexcept {
  return dashpot::testing::note_allocation(size) ? __libc_realloc(block, size) : nullptr;
}
DASHPOT_SHARED void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  return dashpot::testing::note_allocation(size) ? __libc_memalign(alignment, size) : nullptr;
}
DASHPOT_SHARED void* memalign(std::size_t alignment, std::size_t size) noexcept {
  return dashpot::testing::note_allocation(size) ? __libc_memalign(alignment, size) : nullptr;
}
DASHPOT_SHARED int posix_memalign(void** block, std::size_t alignment, std::size_t size) noexcept {
  *block = dashpot::testing::note_allocation(size) ? __libc_memalign(alignment, size) : nullptr;
  return *block != nullptr ? 0 : ENOMEM;
}
}
#undef DASHPOT_SHARED
#endif
