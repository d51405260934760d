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

// Asks for huge pages for the addresses that the heap will grow into next. This uses no memory until it is written to.
// Does nothing if the kernel has no huge pages or the addresses are not available.
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
  // Sanitizers have an allocator of their own. mallopt() does not reach it, and it writes shadow memory of an eighth of
  // the size of each block, so that reserving a large block is expensive.
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
