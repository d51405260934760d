#include "core/base/heap.h"

#include <malloc.h>
#include <sys/mman.h>

#include <algorithm>
#include <climits>
#include <cstdint>
#include <cstdlib>

#include "core/base/sanitizers.h"

namespace planish {
namespace {

constexpr std::size_t kReserved = std::size_t{1} << 30;

bool keep_freed_memory = false;

// Asks for huge pages for what the heap will grow into next. Addresses only: no memory is used before it is written to.
// Where the kernel has no huge pages to give, or so many addresses are not to be had, everything is as without.
void PreferHugePages(std::size_t reserved) {
  constexpr std::size_t kHugePage = std::size_t{1} << 21;
  if (reserved < 2 * kHugePage) return;
  void* const block = std::malloc(reserved);
  if (block == nullptr) return;
  const auto address = reinterpret_cast<std::uintptr_t>(block);
  const std::size_t skipped = (kHugePage - address % kHugePage) % kHugePage;
  madvise(static_cast<char*>(block) + skipped, (reserved - skipped) / kHugePage * kHugePage, MADV_HUGEPAGE);
  std::free(block);
}

}  // namespace

void KeepFreedMemory() {
  // A sanitizer has a heap of its own, which none of this reaches, and writes to an eighth of each block that it gives.
  if (kSanitized) return;
  mallopt(M_MMAP_THRESHOLD, INT_MAX);
  mallopt(M_TRIM_THRESHOLD, INT_MAX);
  keep_freed_memory = true;
  PreferHugePages(kReserved);
}

void ReturnFreedMemory(std::size_t keep) {
  malloc_trim(keep);
}

void ReserveHeap(std::size_t bytes) {
  if (keep_freed_memory) PreferHugePages(std::min(bytes, kReserved));
}

}  // namespace planish
