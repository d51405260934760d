// Measures and limits the memory of this process. Reads /proc/self through descriptors that are opened in advance,
// since a sandbox cannot open files.
#pragma once

#include <cstdint>

namespace planish {

// Opens the files that the other functions read. Call it before there are threads or a sandbox. Otherwise, and without
// /proc, the figures come from getrusage or are 0.
void WatchProcessMemory();

// Memory that an idle process holds, without the free end of the heap, which is ready for the next job: its resident
// memory, or its private memory including holes of freed blocks, whichever is more. 0 if unknown.
std::int64_t HeldBytes();

// Peak resident memory, since ResetPeakMemory() if the kernel supports that.
std::int64_t PeakMemoryBytes();
void ResetPeakMemory();

// While the object lives, this process may take `bytes` (and stacks for `threads`) beyond what it holds; beyond that,
// allocations fail. For a process that does only this work. Limits writable private memory, touched or not
// (RLIMIT_DATA), and the size of each blob (RLIMIT_FSIZE, whose signal must be ignored). There may be one object at a
// time.
//
// The constructor returns free memory beyond `expected` to the kernel, so that the peak is that of the work, or
// `expected` if that is more. It asks for huge pages for half of `expected`.
class MemoryLimit {
 public:
  // bytes <= 0: no limit. There is none without WatchProcessMemory() either. expected <= 0: unknown.
  MemoryLimit(std::int64_t bytes, std::int64_t expected, int threads);
  ~MemoryLimit();
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

 private:
  bool limited_ = false;
};

}  // namespace planish
