#include "core/base/heap.h"

#include <malloc.h>

namespace planish {

void KeepFreedMemory() {
  constexpr int kLargest = 1 << 30;
  mallopt(M_MMAP_THRESHOLD, kLargest);
  mallopt(M_TRIM_THRESHOLD, kLargest);
}

void ReturnFreedMemory() {
  malloc_trim(0);
}

}  // namespace planish
