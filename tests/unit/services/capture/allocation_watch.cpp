// SPDX-License-Identifier: AGPL-3.0-or-later
// In a file of its own: inlined into their users, these operators would look mismatched to the compiler.
#include "tests/unit/services/capture/allocation_watch.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::size_t> largest_request = 0;

}  // namespace

void* operator new(std::size_t size) {
  std::size_t seen = largest_request.load(std::memory_order_relaxed);
  while (size > seen && !largest_request.compare_exchange_weak(seen, size, std::memory_order_relaxed)) {
  }
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace vorocast::capture::testing {

void WatchAllocations() { largest_request = 0; }
std::size_t LargestAllocation() { return largest_request; }

}  // namespace vorocast::capture::testing
