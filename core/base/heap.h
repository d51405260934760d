// Keeps freed memory in the process between large pieces of work. For programs, not for libraries; call from one
// thread.
#pragma once

#include <cstddef>

namespace planish {

// From now on the process keeps freed memory, and gets new memory in huge pages if the kernel provides them
// (transparent huge pages, "madvise" or "always"). The solver allocates and frees vectors of tens of megabytes all the
// time. Returning each to the kernel and having it zeroed again costs a tenth of a solve, and small pages cost as much.
void KeepFreedMemory();

// Returns free memory to the kernel, except for `keep` bytes that the next piece of work gets without a system call.
void ReturnFreedMemory(std::size_t keep = 0);

// Asks for huge pages for the next `bytes` of the heap, at most 1 GiB, as KeepFreedMemory() does at first. For callers
// that have returned memory since.
void ReserveHeap(std::size_t bytes);

}  // namespace planish
