// What a process keeps of freed memory between one large piece of work and the next. For programs, not for libraries;
// to be called from one thread.
#pragma once

#include <cstddef>

namespace planish {

// From now on memory that is freed stays with the process, and memory that is taken comes in huge pages where the
// kernel gives them (transparent huge pages, "madvise" or "always"). The solver takes and frees vectors of tens of
// megabytes all the time; handing each back to the kernel and having it zeroed again costs a tenth of a solve, and so
// do small pages.
void KeepFreedMemory();

// Hands back what is free, but for `keep` bytes that the next piece of work gets without asking the kernel.
void ReturnFreedMemory(std::size_t keep = 0);

// After KeepFreedMemory(): asks for huge pages for the next `bytes` of the heap, at most 1 GiB, as KeepFreedMemory()
// does for the first. For a caller that has handed memory back since.
void ReserveHeap(std::size_t bytes);

}  // namespace planish
