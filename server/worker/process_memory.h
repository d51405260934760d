// How much memory this process has, and how much it may take. Reads /proc/self through descriptors that are opened
// once: in a sandbox there is no opening files.
#pragma once

#include <cstdint>

namespace planish {

// Opens what the others read. Before threads and sandbox; without it, and where there is no /proc, the figures come
// from getrusage or are 0.
void WatchProcessMemory();

// What this process holds when idle beside memory that is ready for the next job (the free end of the heap): what is
// resident, or private memory with the holes that freed blocks left in it, if that is more. 0: not known.
std::int64_t HeldBytes();

// High-water mark of resident memory, since ResetPeakMemory() where the kernel can do that.
std::int64_t PeakMemoryBytes();
void ResetPeakMemory();

// While it lives, this process may take `bytes` (and stacks for `threads`) beyond what it holds; then allocations fail.
// For a process that does nothing but the work in hand. Counts private memory that can be written to, touched or not
// (RLIMIT_DATA), and each blob by itself (RLIMIT_FSIZE, whose signal must be ignored). One at a time.
//
// First hands back free memory beyond what this work is expected to take: the high-water mark is then that of the work,
// or of what was expected of it. Asks for huge pages for half of what is expected.
class MemoryLimit {
 public:
  // bytes <= 0: no limit. Without WatchProcessMemory() none either. expected <= 0: not known.
  MemoryLimit(std::int64_t bytes, std::int64_t expected, int threads);
  ~MemoryLimit();
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

 private:
  bool limited_ = false;
};

}  // namespace planish
